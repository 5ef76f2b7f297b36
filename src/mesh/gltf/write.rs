//! Writing a model as GLB or glTF: the same model gives the same bytes.

mod buffer;
mod check;
mod clips;
mod looks;
mod meshes;
mod skeleton;

use serde_json::{Map, Value};

use super::{GltfError, uri::percent_encode};
use crate::mesh::model::Model;
use buffer::Bin;
use skeleton::Skeleton;

/// What to write, and how.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GltfWriteSettings {
    /// Influences a vertex, 1 to 8; the strongest are kept and scaled to sum to one. Over 4, vertices get a second set
    /// (`JOINTS_1`, `WEIGHTS_1`), which not every program reads.
    pub max_influences: usize,
    /// True to write all nodes. False: only joints with weights, nodes that carry rigid parts, and the ancestors of
    /// both; channels of other nodes are left out, and clips that this empties.
    pub all_joints: bool,
    /// True to bind points without weights to the first root joint of their skin, as a file may have had them. False:
    /// they are an error, because whoever skinned the mesh forgot them.
    pub bind_unweighted: bool,
    /// The program's name, for `asset.generator`.
    pub generator: String,
}

impl Default for GltfWriteSettings {
    /// Four influences, only joints that deform, unweighted points are an error.
    fn default() -> Self {
        Self { max_influences: 4, all_joints: false, bind_unweighted: false, generator: "Rigsmith".to_owned() }
    }
}

/// A glTF model as several files.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct GltfFiles {
    /// The `.gltf` file.
    pub json: Vec<u8>,
    /// The name of the buffer's file, which the JSON refers to.
    pub bin_name: String,
    /// The buffer; empty if the JSON refers to none.
    pub bin: Vec<u8>,
    /// Names and contents of the image files, which the JSON refers to.
    pub images: Vec<(String, Vec<u8>)>,
}

/// Writes a model as one GLB file.
///
/// Every object with triangles becomes a mesh and a node: skinned ones and those that nothing carries at the scene's
/// root with the identity transform, rigid parts below their node. Vertices that no triangle uses are not written.
/// Joints of one skin below several roots get a common root node named `skeleton`, which glTF demands.
/// Reading the result and writing it again gives the same model and the same bytes.
///
/// # Errors
/// [`GltfError::Model`] if the model's indices or lists do not fit together or something is not finite,
/// [`GltfError::Unweighted`] as the settings say. Costs time and memory linear in the model.
pub fn write_glb(model: &Model, settings: &GltfWriteSettings) -> Result<Vec<u8>, GltfError> {
    let Document { json, bin, .. } = document(model, settings, None)?;
    let mut json = to_bytes(&json, false)?;
    json.resize(json.len().next_multiple_of(4), b' ');
    let bin_chunk = if bin.is_empty() { 0 } else { 8 + bin.len() };
    let length = 12 + 8 + json.len() + bin_chunk;
    let word = |number: usize| {
        let number = u32::try_from(number).map_err(|_| GltfError::model("a GLB holds at most 4 GiB; write .gltf"))?;
        Ok::<_, GltfError>(number.to_le_bytes())
    };
    let mut glb = Vec::with_capacity(length);
    glb.extend_from_slice(b"glTF\x02\0\0\0");
    glb.extend_from_slice(&word(length)?);
    glb.extend_from_slice(&word(json.len())?);
    glb.extend_from_slice(b"JSON");
    glb.append(&mut json);
    if !bin.is_empty() {
        glb.extend_from_slice(&word(bin.len())?);
        glb.extend_from_slice(b"BIN\0");
        glb.extend_from_slice(&bin);
    }
    Ok(glb)
}

/// Writes a model as a `.gltf` file, a buffer named `<stem>.bin`, and the images as files beside it.
///
/// # Errors
/// As [`write_glb`].
pub fn write_gltf(model: &Model, settings: &GltfWriteSettings, stem: &str) -> Result<GltfFiles, GltfError> {
    let Document { json, bin, images } = document(model, settings, Some(stem))?;
    Ok(GltfFiles { json: to_bytes(&json, true)?, bin_name: format!("{stem}.bin"), bin, images })
}

fn to_bytes(root: &Map<String, Value>, pretty: bool) -> Result<Vec<u8>, GltfError> {
    let bytes = if pretty { serde_json::to_vec_pretty(root) } else { serde_json::to_vec(root) };
    bytes.map_err(|error| GltfError::model(error.to_string()))
}

/// A document in its parts.
struct Document {
    json: Map<String, Value>,
    bin: Vec<u8>,
    /// Image files, if images are not in the buffer.
    images: Vec<(String, Vec<u8>)>,
}

/// The whole document; with a stem, its buffer and images are files.
fn document(model: &Model, settings: &GltfWriteSettings, stem: Option<&str>) -> Result<Document, GltfError> {
    check::check(model)?;
    let mut bin = Bin::default();
    let skeleton = Skeleton::new(model, settings)?;
    let mut nodes = skeleton.nodes(model);
    let mut scene_nodes = skeleton.roots.clone();
    let meshes = meshes::write(model, &skeleton, &mut bin, &mut nodes, &mut scene_nodes)?;
    let skins = skeleton.skins(model, &mut bin);
    let animations = clips::write(model, &skeleton, &meshes.node_of_object, &mut bin);
    let looks = looks::write(&model.looks, stem, &mut bin);

    let mut asset = Map::new();
    asset.insert("version".to_owned(), "2.0".into());
    if !settings.generator.is_empty() {
        asset.insert("generator".to_owned(), settings.generator.as_str().into());
    }
    let mut scene = Map::new();
    insert_name(&mut scene, &model.name);
    insert_list(&mut scene, "nodes", scene_nodes);
    let (accessors, views, bytes) = bin.finish();
    let mut root = Map::new();
    root.insert("asset".to_owned(), asset.into());
    insert_list(&mut root, "extensionsUsed", looks.extensions_used);
    insert_list(&mut root, "extensionsRequired", looks.extensions_required);
    // Some readers take no scene without nodes.
    if scene.contains_key("nodes") {
        root.insert("scene".to_owned(), 0.into());
        root.insert("scenes".to_owned(), vec![Value::from(scene)].into());
    }
    insert_list(&mut root, "nodes", nodes);
    insert_list(&mut root, "meshes", meshes.meshes);
    insert_list(&mut root, "skins", skins);
    insert_list(&mut root, "animations", animations);
    insert_list(&mut root, "materials", looks.materials);
    insert_list(&mut root, "textures", looks.textures);
    insert_list(&mut root, "images", looks.images);
    insert_list(&mut root, "samplers", looks.samplers);
    insert_list(&mut root, "accessors", accessors);
    insert_list(&mut root, "bufferViews", views);
    if !bytes.is_empty() {
        let mut buffer = Map::new();
        if let Some(stem) = stem {
            buffer.insert("uri".to_owned(), percent_encode(&format!("{stem}.bin")).into());
        }
        buffer.insert("byteLength".to_owned(), bytes.len().into());
        root.insert("buffers".to_owned(), vec![Value::from(buffer)].into());
    }
    Ok(Document { json: root, bin: bytes, images: looks.files })
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

/// Floats as JSON numbers that read back to the same bits.
fn floats(values: &[f32]) -> Value {
    values.iter().map(|value| Value::from(f64::from(*value))).collect()
}
