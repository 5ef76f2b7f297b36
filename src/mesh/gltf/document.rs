//! The document: the content of the JSON, typed, with every reference and every range of bytes checked.

use std::{collections::BTreeMap, mem::size_of, ops::Deref, rc::Rc};

use super::{
    ExternalError, ExternalFile, ExternalKind, GltfError,
    accessor::{Accessor, View},
    budget::{Budget, Notes},
    json::JsonObject,
    primitive::Mesh,
    tree::{Fields, Json},
    uri,
};

/// A buffer as declared.
pub(super) struct BufferEntry<'a> {
    length: usize,
    uri: Option<&'a str>,
}

/// The bytes of a buffer.
pub(super) enum BufferBytes<'b> {
    /// The binary chunk of a GLB.
    Chunk(&'b [u8]),
    /// A file, or decoded data; several buffers may share one.
    Shared(Rc<Vec<u8>>),
}

impl Deref for BufferBytes<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Chunk(bytes) => bytes,
            Self::Shared(bytes) => bytes,
        }
    }
}

/// A node as declared; its transform is read where it is needed. The place is written out only there: a file may have many
/// nodes for its size.
pub(super) struct NodeEntry<'a> {
    pub(super) map: &'a Fields<'a>,
    pub(super) name: &'a str,
    pub(super) children: Vec<usize>,
    pub(super) mesh: Option<usize>,
    pub(super) skin: Option<usize>,
    pub(super) camera: bool,
}

impl<'a> NodeEntry<'a> {
    /// The JSON object of the node, which is the one with the number `node`.
    pub(super) fn at(&self, node: usize) -> JsonObject<'a> {
        JsonObject { map: self.map, place: format!("/nodes/{node}") }
    }
}

/// A skin as declared.
pub(super) struct SkinEntry<'a> {
    pub(super) place: String,
    pub(super) name: &'a str,
    pub(super) joints: Vec<usize>,
    pub(super) inverse_binds: Option<usize>,
}

/// A channel of an animation that targets a node.
pub(super) struct ChannelEntry<'a> {
    pub(super) place: String,
    pub(super) node: usize,
    pub(super) path: &'a str,
    pub(super) input: usize,
    pub(super) output: usize,
    pub(super) interpolation: &'a str,
}

/// An animation as declared.
pub(super) struct AnimationEntry<'a> {
    pub(super) name: &'a str,
    pub(super) extras: Option<&'a Json<'a>>,
    pub(super) channels: Vec<ChannelEntry<'a>>,
}

/// Document whose references and ranges of bytes have been checked.
pub(super) struct Document<'a> {
    pub(super) root: JsonObject<'a>,
    buffers: Vec<BufferEntry<'a>>,
    pub(super) views: Vec<View>,
    pub(super) accessors: Vec<Accessor>,
    pub(super) nodes: Vec<NodeEntry<'a>>,
    pub(super) meshes: Vec<Mesh<'a>>,
    pub(super) skins: Vec<SkinEntry<'a>>,
    pub(super) animations: Vec<AnimationEntry<'a>>,
    /// Root nodes of the scene to load.
    pub(super) scene: Option<Vec<usize>>,
    /// The file's `extensionsUsed` and `extensionsRequired`.
    pub(super) extensions_used: Vec<&'a str>,
    pub(super) extensions_required: Vec<&'a str>,
}

/// Extensions that this reader understands, carries unread, or can ignore.
const SUPPORTED: &[&str] = &[
    "EXT_texture_avif",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_lights_punctual",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
    "MSFT_texture_dds",
];

impl<'a> Document<'a> {
    pub(super) fn new(root: &'a Json<'a>, budget: &Budget, notes: &Notes) -> Result<Self, GltfError> {
        let root = JsonObject::new(root, String::new())?;
        check_version(&root)?;
        let extensions_used = names(&root, "extensionsUsed")?;
        let extensions_required = names(&root, "extensionsRequired")?;
        for name in &extensions_required {
            if !SUPPORTED.contains(name) && !name.starts_with("KHR_materials_") {
                return Err(GltfError::Extension { file: String::new(), name: (*name).to_owned() });
            }
        }
        let count = |key: &str| Ok::<_, GltfError>(root.array(key)?.len());
        let (node_count, mesh_count, skin_count) = (count("nodes")?, count("meshes")?, count("skins")?);
        let (accessor_count, material_count) = (count("accessors")?, count("materials")?);
        let camera_count = count("cameras")?;

        let mut buffers = Vec::new();
        for at in root.objects("buffers")? {
            let at = at?;
            buffers.push(BufferEntry { length: at.need("byteLength", at.uint("byteLength")?)?, uri: at.text("uri")? });
        }
        let mut views = Vec::new();
        for at in root.objects("bufferViews")? {
            views.push(view(&at?, &buffers)?);
        }
        budget.take(accessor_count, size_of::<Accessor>() + 32, "/accessors")?;
        let mut accessors = Vec::with_capacity(accessor_count);
        for at in root.objects("accessors")? {
            accessors.push(Accessor::new(&at?, &views)?);
        }
        let mut meshes = Vec::new();
        for at in root.objects("meshes")? {
            meshes.push(Mesh::new(&at?, &accessors, material_count, budget, notes)?);
        }
        budget.take(node_count, size_of::<NodeEntry>() + 32, "/nodes")?;
        let mut nodes = Vec::with_capacity(node_count);
        for at in root.objects("nodes")? {
            let at = at?;
            nodes.push(NodeEntry {
                name: at.name(),
                children: at.indices("children", node_count, "node")?,
                mesh: at.index("mesh", mesh_count, "mesh")?,
                skin: at.index("skin", skin_count, "skin")?,
                camera: at.index("camera", camera_count, "camera")?.is_some(),
                map: at.map,
            });
        }
        let mut skins = Vec::new();
        for at in root.objects("skins")? {
            skins.push(skin(&at?, node_count, &accessors)?);
        }
        let mut animations = Vec::new();
        for at in root.objects("animations")? {
            animations.push(animation(&at?, node_count, accessor_count, notes)?);
        }
        let scene = scene(&root, node_count, notes)?;
        Ok(Self {
            root,
            buffers,
            views,
            accessors,
            nodes,
            meshes,
            skins,
            animations,
            scene,
            extensions_used,
            extensions_required,
        })
    }

    /// The bytes of every buffer, exactly as long as declared; `None` for a buffer that has no data of its own.
    pub(super) fn load_buffers<'b>(
        &self,
        bin: Option<&'b [u8]>,
        budget: &Budget,
        external: &mut dyn FnMut(ExternalFile) -> Result<Vec<u8>, ExternalError>,
    ) -> Result<Vec<Option<BufferBytes<'b>>>, GltfError> {
        let mut loaded = Vec::with_capacity(self.buffers.len());
        // Several buffers may name one file.
        let mut files: BTreeMap<String, Rc<Vec<u8>>> = BTreeMap::new();
        for (i, buffer) in self.buffers.iter().enumerate() {
            let place = format!("/buffers/{i}");
            let bytes = match (buffer.uri, bin) {
                (None, Some(bin)) if i == 0 => BufferBytes::Chunk(bin),
                (None, _) => {
                    loaded.push(None);
                    continue;
                }
                (Some(text), _) => {
                    let place = format!("{place}/uri");
                    budget.take(text.len(), 1, &place)?;
                    match uri::resolve(text, &place)? {
                        uri::UriTarget::Data { bytes, .. } => BufferBytes::Shared(Rc::new(bytes)),
                        uri::UriTarget::File(path) => match files.get(&path) {
                            Some(bytes) => BufferBytes::Shared(bytes.clone()),
                            None => {
                                let file = ExternalFile { path: &path, kind: ExternalKind::Buffer, limit: u64::MAX };
                                let bytes = external(file).map_err(|error| uri::fault(&place, text, error))?;
                                budget.add_input(bytes.len() as u64);
                                let bytes = Rc::new(bytes);
                                files.insert(path, bytes.clone());
                                BufferBytes::Shared(bytes)
                            }
                        },
                    }
                }
            };
            if bytes.len() < buffer.length {
                let what = format!("says {} bytes, but has {}", buffer.length, bytes.len());
                return Err(GltfError::at(format!("{place}/byteLength"), what));
            }
            loaded.push(Some(bytes));
        }
        Ok(loaded)
    }
}

fn check_version(root: &JsonObject) -> Result<(), GltfError> {
    let asset = root.need("asset", root.object("asset")?)?;
    let version = asset.need("version", asset.text("version")?)?;
    let needed = asset.text("minVersion")?.unwrap_or("2.0");
    if version.split('.').next() != Some("2") || needed != "2.0" {
        let what = format!("glTF {version} that needs a reader of {needed} at least; only 2.0 can be read");
        return Err(asset.fail("version", what));
    }
    Ok(())
}

fn names<'a>(root: &JsonObject<'a>, key: &str) -> Result<Vec<&'a str>, GltfError> {
    let name = |value: &'a Json<'a>| value.as_str().ok_or_else(|| root.fail(key, "must be a list of names"));
    root.array(key)?.iter().map(name).collect()
}

fn view(at: &JsonObject, buffers: &[BufferEntry]) -> Result<View, GltfError> {
    let buffer = at.need("buffer", at.index("buffer", buffers.len(), "buffer")?)?;
    let offset = at.uint("byteOffset")?.unwrap_or(0);
    let length = at.need("byteLength", at.uint("byteLength")?)?;
    let stride = at.uint("byteStride")?;
    let size = buffers[buffer].length;
    if offset.checked_add(length).is_none_or(|end| end > size) {
        let what = format!("bytes {offset} to {offset} + {length}, but buffer {buffer} has {size}");
        return Err(at.fail("byteLength", what));
    }
    if stride == Some(0) || stride.is_some_and(|stride| stride > 252) {
        return Err(at.fail("byteStride", "must be from 4 to 252"));
    }
    Ok(View { buffer, offset, length, stride })
}

fn skin<'a>(at: &JsonObject<'a>, nodes: usize, accessors: &[Accessor]) -> Result<SkinEntry<'a>, GltfError> {
    at.need("joints", at.map.get("joints"))?;
    let joints = at.indices("joints", nodes, "node")?;
    at.index("skeleton", nodes, "node")?;
    let inverse_binds = at.index("inverseBindMatrices", accessors.len(), "accessor")?;
    if let Some(index) = inverse_binds
        && accessors[index].count < joints.len()
    {
        let what = format!("{} matrices for {} joints", accessors[index].count, joints.len());
        return Err(at.fail("inverseBindMatrices", what));
    }
    let mut sorted = joints.clone();
    sorted.sort_unstable();
    if let Some(pair) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(at.fail("joints", format!("node {} is listed twice", pair[0])));
    }
    Ok(SkinEntry { place: at.place.clone(), name: at.name(), joints, inverse_binds })
}

fn animation<'a>(
    at: &JsonObject<'a>,
    nodes: usize,
    accessors: usize,
    notes: &Notes,
) -> Result<AnimationEntry<'a>, GltfError> {
    let mut samplers = Vec::new();
    for sampler in at.objects("samplers")? {
        let sampler = sampler?;
        samplers.push((
            sampler.need("input", sampler.index("input", accessors, "accessor")?)?,
            sampler.need("output", sampler.index("output", accessors, "accessor")?)?,
            sampler.text("interpolation")?.unwrap_or("LINEAR"),
        ));
    }
    let mut channels = Vec::new();
    for channel in at.objects("channels")? {
        let channel = channel?;
        let sampler = channel.need("sampler", channel.index("sampler", samplers.len(), "sampler")?)?;
        let target = channel.need("target", channel.object("target")?)?;
        let path = target.need("path", target.text("path")?)?;
        let Some(node) = target.index("node", nodes, "node")? else {
            notes.add("An animation channel that does not target a node was not kept");
            continue;
        };
        let (input, output, interpolation) = samplers[sampler];
        channels.push(ChannelEntry { place: channel.place.clone(), node, path, input, output, interpolation });
    }
    Ok(AnimationEntry { name: at.name(), extras: at.map.get("extras"), channels })
}

/// The roots of the default scene, else of the first; `None` if the file has no scene.
fn scene(root: &JsonObject, nodes: usize, notes: &Notes) -> Result<Option<Vec<usize>>, GltfError> {
    let count = root.array("scenes")?.len();
    let chosen = root.index("scene", count, "scene")?.unwrap_or(0);
    let mut roots = None;
    for (i, at) in root.objects("scenes")?.enumerate() {
        let list = at?.indices("nodes", nodes, "node")?;
        if i == chosen {
            roots = Some(list);
        }
    }
    if count > 1 {
        notes.add(format!("The file has {count} scenes; only scene {chosen} was read"));
    }
    Ok(roots)
}
