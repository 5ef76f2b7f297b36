//! Writing a model as GLB or glTF: the same model gives the same bytes.

mod buffer;
mod check;
mod clips;
mod document;
mod materials;
mod meshes;
mod skeleton;
mod vrm;

use serde_json::{Map, Value};

use super::{GltfError, uri::percent_encode};
use crate::mesh::{CompanionSink, model::Model, vrm::Avatar};
use buffer::Bin;
use document::{Document, Lists, Scene};
use skeleton::Skeleton;

/// Settings of [`write_glb`] and [`write_gltf`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GltfWriteSettings {
    /// Influences a vertex, 1 to 8; the strongest are kept and scaled to sum to one. Over 4, vertices get a second set
    /// (`JOINTS_1`, `WEIGHTS_1`), which not every program reads.
    pub max_influences: usize,
    /// Writes all nodes if `true`. If `false`, only joints with weights, nodes that carry rigid parts, and the
    /// ancestors of both are written; channels of other nodes are left out, and so are clips without any channel left.
    pub all_joints: bool,
    /// Binds points without weights to the first root joint of their skin if `true`, as a file may have had them. If
    /// `false`, such points are an error, because they were probably forgotten in skinning.
    pub bind_unweighted: bool,
    /// The program's name, for `asset.generator`.
    pub generator: String,
}

impl Default for GltfWriteSettings {
    /// Default settings: four influences, only joints that deform, an error for unweighted points.
    fn default() -> Self {
        Self { max_influences: 4, all_joints: false, bind_unweighted: false, generator: "Rigsmith".to_owned() }
    }
}

/// Writes a model as one GLB file.
///
/// Every object with triangles becomes a mesh and a node: skinned objects and objects without a carrying node lie at
/// the scene's root with the identity transform, rigid parts below their node. Vertices that no triangle uses are not
/// written. Joints of one skin below several roots get a common root node named `skeleton`, which glTF demands. Reading
/// the result and writing it again gives the same model and the same bytes.
///
/// # Errors
/// [`GltfError::Model`] if the model's indices or lists do not fit together or a number is not finite,
/// [`GltfError::Unweighted`] if `bind_unweighted` is off. Costs time and memory linear in the model.
pub fn write_glb(model: &Model, settings: &GltfWriteSettings) -> Result<Vec<u8>, GltfError> {
    glb(document(model, settings, None, None)?)
}

/// Writes an avatar in VRM 1.0: a GLB file as [`write_glb`] writes it, with the extensions of the avatar.
///
/// # Errors
/// As [`write_glb`], and [`GltfError::Model`] if the avatar refers to a node that is not in the model or is not written
/// ([`GltfWriteSettings::all_joints`] writes all), or to a morph target that is not there.
pub fn write_vrm(model: &Model, avatar: &Avatar, settings: &GltfWriteSettings) -> Result<Vec<u8>, GltfError> {
    glb(document(model, settings, Some(avatar), None)?)
}

/// File of a document and its buffer. The buffer becomes the file: it moves up behind the text, so that it is held once.
fn glb(document: Document<'_>) -> Result<Vec<u8>, GltfError> {
    const JSON: usize = 20;
    let mut head = vec![0_u8; JSON];
    serde_json::to_writer(&mut head, &document).map_err(|error| GltfError::model(error.to_string()))?;
    head.resize(head.len().next_multiple_of(4), b' ');
    let Document { root, scene, lists, buffer, bytes: mut glb } = document;
    drop((root, scene, lists, buffer));
    let bin = glb.len();
    let word = |number: usize| {
        let number = u32::try_from(number).map_err(|_| GltfError::model("a GLB holds at most 4 GiB; write .gltf"))?;
        Ok::<_, GltfError>(number.to_le_bytes())
    };
    let bin_chunk = if bin == 0 { 0 } else { 8 + bin };
    let (json, length) = (word(head.len() - JSON)?, word(head.len() + bin_chunk)?);
    head[..8].copy_from_slice(b"glTF\x02\0\0\0");
    head[8..12].copy_from_slice(&length);
    head[12..16].copy_from_slice(&json);
    head[16..JSON].copy_from_slice(b"JSON");
    if bin == 0 {
        return Ok(head);
    }
    head.extend_from_slice(&word(bin)?);
    head.extend_from_slice(b"BIN\0");
    glb.reserve_exact(head.len());
    glb.resize(head.len() + bin, 0);
    glb.copy_within(..bin, head.len());
    glb[..head.len()].copy_from_slice(&head);
    Ok(glb)
}

/// Writes a model as a `.gltf` file. Its buffer, which would be called `<stem>.bin`, and the images go to `companion`.
///
/// # Errors
/// As [`write_glb`].
pub fn write_gltf(
    model: &Model,
    settings: &GltfWriteSettings,
    stem: &str,
    companion: &mut CompanionSink,
) -> Result<Vec<u8>, GltfError> {
    let document = document(model, settings, None, Some((stem, companion)))?;
    serde_json::to_vec_pretty(&document).map_err(|error| GltfError::model(error.to_string()))
}

/// Document and buffer of a model. With `outside` (a stem and a sink of companions), buffer and images go to the sink.
fn document<'a>(
    model: &'a Model,
    settings: &GltfWriteSettings,
    avatar: Option<&Avatar>,
    mut outside: Option<(&str, &mut CompanionSink)>,
) -> Result<Document<'a>, GltfError> {
    check::check(model)?;
    let mut bin = Bin::default();
    let skeleton = Skeleton::new(model, settings)?;
    check::check_places(model, &skeleton)?;
    let mut nodes = skeleton.nodes(model);
    let mut scene_nodes = skeleton.roots.clone();
    let meshes = meshes::write(model, &skeleton, &mut bin, &mut nodes, &mut scene_nodes)?;
    let skins = skeleton.skins(model, &mut bin);
    let animations = clips::write(model, &skeleton, &meshes.node_of_object, &mut bin);
    let mut written = materials::write(&model.material_set, outside.as_mut(), &mut bin);
    let mut extensions = Map::new();
    if let Some(avatar) = avatar {
        extensions = vrm::write(avatar, model, &skeleton, &meshes.node_of_object, &mut nodes)?;
        let names = vrm::NAMES.into_iter().filter(|name| match *name {
            vrm::CONSTRAINT => !avatar.constraints.is_empty(),
            name => extensions.contains_key(name),
        });
        written.extensions_used.extend(names.map(str::to_owned));
    }

    let mut asset = Map::new();
    asset.insert("version".to_owned(), "2.0".into());
    if !settings.generator.is_empty() {
        asset.insert("generator".to_owned(), settings.generator.as_str().into());
    }
    let scene = (!scene_nodes.is_empty()).then_some(Scene { name: &model.name, nodes: scene_nodes });
    let (accessors, views, mut bytes) = bin.finish();
    let mut root = Map::new();
    root.insert("asset".to_owned(), asset.into());
    insert_list(&mut root, "extensionsUsed", written.extensions_used);
    insert_list(&mut root, "extensionsRequired", written.extensions_required);
    if !extensions.is_empty() {
        root.insert("extensions".to_owned(), extensions.into());
    }
    let lists = Lists {
        nodes,
        meshes: meshes.meshes,
        skins,
        animations,
        materials: &model.material_set.materials,
        textures: written.textures,
        images: written.images,
        samplers: &model.material_set.samplers,
        accessors,
        views,
    };
    let mut declared = None;
    if !bytes.is_empty() {
        let mut buffer = Map::new();
        buffer.insert("byteLength".to_owned(), bytes.len().into());
        if let Some((stem, companion)) = outside {
            let name = companion(&format!("{stem}.bin"), std::mem::take(&mut bytes));
            buffer.insert("uri".to_owned(), percent_encode(&name).into());
        }
        declared = Some(Value::from(buffer));
    }
    Ok(Document { root, scene, lists, buffer: declared, bytes })
}

/// Inserts a list unless it is empty, which glTF forbids.
fn insert_list<T: Into<Value>>(map: &mut Map<String, Value>, key: &str, list: Vec<T>) {
    if !list.is_empty() {
        map.insert(key.to_owned(), Value::Array(list.into_iter().map(Into::into).collect()));
    }
}

fn insert_name(map: &mut Map<String, Value>, name: &str) {
    if !name.is_empty() {
        map.insert("name".to_owned(), name.into());
    }
}
