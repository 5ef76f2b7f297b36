//! glTF files made in the test, so that every field can be bent.

use rigsmith::mesh::{
    gltf::{ExternalError, GltfError, read_gltf},
    model::Model,
};
use serde_json::{Value, json};

/// A document and its binary chunk.
#[derive(Clone)]
pub struct ComposedDocument {
    pub json: Value,
    pub bin: Vec<u8>,
}

impl ComposedDocument {
    pub fn new() -> Self {
        let json = json!({
            "asset": {"version": "2.0"}, "accessors": [], "bufferViews": [], "meshes": [], "nodes": [],
            "scenes": [{"nodes": []}], "scene": 0
        });
        Self { json, bin: Vec::new() }
    }

    /// Appends an object to a list; returns its index.
    pub fn push(&mut self, list: &str, value: Value) -> usize {
        if self.json.get(list).is_none() {
            self.json[list] = json!([]);
        }
        let list = self.json[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let view = json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()});
        self.bin.extend_from_slice(bytes);
        self.push("bufferViews", view)
    }

    pub fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.push("accessors", json!({"bufferView": view, "componentType": component, "count": count, "type": kind}))
    }

    pub fn floats(&mut self, values: &[f32], kind: &str) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        let width = match kind {
            "SCALAR" => 1,
            "MAT4" => 16,
            kind => kind[3..].parse().unwrap(),
        };
        self.accessor(&bytes, 5126, kind, values.len() / width)
    }

    pub fn bytes(&mut self, values: &[u8], kind: &str) -> usize {
        let width = if kind == "VEC4" { 4 } else { 1 };
        self.accessor(values, 5121, kind, values.len() / width)
    }

    /// Puts a node at the root of the scene.
    pub fn root(&mut self, node: Value) -> usize {
        let node = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(node.into());
        node
    }

    /// The document as it stands, with a buffer as long as the chunk.
    fn document(&self, uri: Option<&str>) -> Value {
        let mut json = self.json.clone();
        if json.get("buffers").is_none() && !self.bin.is_empty() {
            let mut buffer = json!({"byteLength": self.bin.len()});
            if let Some(uri) = uri {
                buffer["uri"] = uri.into();
            }
            json["buffers"] = json!([buffer]);
        }
        json
    }

    pub fn glb(&self) -> Vec<u8> {
        glb(self.document(None).to_string().as_bytes(), &self.bin)
    }

    /// The JSON file, whose buffer is outside of it.
    pub fn gltf(&self, uri: &str) -> Vec<u8> {
        self.document(Some(uri)).to_string().into_bytes()
    }

    pub fn read(&self) -> Result<Model, GltfError> {
        read(&self.glb())
    }
}

/// A GLB of its parts.
pub fn glb(json: &[u8], bin: &[u8]) -> Vec<u8> {
    let pad = |bytes: &[u8], with: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), with);
        bytes
    };
    let (json, bin) = (pad(json, b' '), pad(bin, 0));
    let length = 20 + json.len() + if bin.is_empty() { 0 } else { 8 + bin.len() };
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend((length as u32).to_le_bytes());
    out.extend((json.len() as u32).to_le_bytes());
    out.extend(b"JSON");
    out.extend(json);
    if !bin.is_empty() {
        out.extend((bin.len() as u32).to_le_bytes());
        out.extend(b"BIN\0");
        out.extend(bin);
    }
    out
}

/// Reads a file that refers to nothing outside.
pub fn read(bytes: &[u8]) -> Result<Model, GltfError> {
    read_gltf(bytes, "folder/test.glb", &mut |uri| Err(ExternalError::new(format!("there is no {uri}"))))
}

/// The smallest picture: what readers look at is its first bytes.
pub const PNG: &[u8] =
    b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01\x08\x02\0\0\0\x90wS\xde\0\0\0\x0cIDATx\x9cc\xf8\
\xcf\xc0\0\0\x03\x01\x01\0\xc9\xfe\x92\xef\0\0\0\0IEND\xaeB`\x82";

/// One triangle at the root.
pub fn triangle() -> ComposedDocument {
    let mut file = ComposedDocument::new();
    let position = file.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], "VEC3");
    let mesh = file.push("meshes", json!({"name": "triangle", "primitives": [{"attributes": {"POSITION": position}}]}));
    file.root(json!({"mesh": mesh}));
    file
}

/// A character of a few triangles that uses everything: a plain node above two joints and a third without weights, a skinned
/// quad with morph targets, colours, two sets of texture coordinates, a material with extensions and a texture, a rigid
/// part below a joint, a mirrored static part, and clips of every kind.
///
/// Nodes: 0 armature, 1 hip, 2 knee, 3 toe (no weights), 4 body, 5 hat, 6 stone. Joints: knee, hip, toe.
pub fn character() -> ComposedDocument {
    let mut file = ComposedDocument::new();
    let position = file.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 2.0, 0.0, 0.0, 2.0, 0.1], "VEC3");
    let normal = file.floats(&[0.0, 0.0, 1.0].repeat(4), "VEC3");
    let tangent = file.floats(&[1.0, 0.0, 0.0, -1.0].repeat(4), "VEC4");
    let uv = file.floats(&[0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0], "VEC2");
    let uv1 = file.floats(&[0.5, 0.0, 1.0, 0.5, 1.0, 0.25, 0.0, 1.0], "VEC2");
    let color = file.floats(&[1.0, 0.5, 0.25, 1.0].repeat(4), "VEC4");
    let joints = file.bytes(&[1, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0], "VEC4");
    let weights =
        file.floats(&[1.0, 0.0, 0.0, 0.0, 0.75, 0.25, 0.0, 0.0, 0.9, 0.1, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0], "VEC4");
    let indices = file.bytes(&[0, 1, 2, 0, 2, 3], "SCALAR");
    let fat = file.floats(&[0.0, 0.0, 0.5].repeat(4), "VEC3");
    let fat_normal = file.floats(&[0.1, 0.0, 0.0].repeat(4), "VEC3");
    let thin = file.floats(&[0.0, 0.0, -0.25].repeat(4), "VEC3");
    let triangle = file.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], "VEC3");
    #[rustfmt::skip]
    let binds = file.floats(&[
        1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.5, 0.0, 1.0,
        1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -0.5, 0.0, 1.0,
        1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -2.0, 0.0, 1.0,
    ], "MAT4");
    let picture = file.view(PNG);

    file.push("images", json!({"bufferView": picture, "mimeType": "image/png", "name": "skin", "extras": 1}));
    file.push("samplers", json!({"wrapS": 33071}));
    file.push("textures", json!({"sampler": 0, "source": 0}));
    file.push(
        "materials",
        json!({
            "name": "skin", "doubleSided": true, "extras": {"a": [1, 2.5]},
            "extensions": {"KHR_materials_ior": {"ior": 1.25}},
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}}
        }),
    );
    file.push("materials", json!({"name": "hat"}));
    file.json["extensionsUsed"] = json!(["KHR_lights_punctual", "KHR_materials_ior"]);
    let body = json!({
        "attributes": {"POSITION": position, "NORMAL": normal, "TANGENT": tangent, "TEXCOORD_0": uv, "TEXCOORD_1": uv1,
            "COLOR_0": color, "JOINTS_0": joints, "WEIGHTS_0": weights},
        "indices": indices, "material": 0, "targets": [{"POSITION": fat, "NORMAL": fat_normal}, {"POSITION": thin}]
    });
    file.push(
        "meshes",
        json!({"name": "body mesh", "primitives": [body], "weights": [0.25, 0.0],
        "extras": {"targetNames": ["fat", "thin"], "more": true}}),
    );
    file.push("meshes", json!({"name": "hat", "primitives": [{"attributes": {"POSITION": triangle}, "material": 1}]}));
    file.push("skins", json!({"name": "rig", "joints": [2, 1, 3], "inverseBindMatrices": binds}));

    file.root(json!({"name": "armature", "children": [1], "scale": [2.0, 2.0, 2.0]}));
    file.push("nodes", json!({"name": "hip", "children": [2], "translation": [0.0, 0.5, 0.0], "extras": {"id": 7}}));
    file.push(
        "nodes",
        json!({"name": "knee", "children": [3, 5], "translation": [0.0, 1.0, 0.0],
        "rotation": [0.0, 0.6, 0.0, 0.8]}),
    );
    file.push("nodes", json!({"name": "toe", "translation": [0.0, 0.5, 0.0]}));
    file.root(json!({"name": "body", "mesh": 0, "skin": 0}));
    file.push("nodes", json!({"name": "the hat", "mesh": 1, "translation": [0.0, 0.25, 0.0]}));
    file.root(json!({"name": "stone", "mesh": 1, "scale": [-1.0, 1.0, 1.0], "translation": [5.0, 0.0, 0.0]}));

    let times = file.floats(&[0.0, 0.5, 1.25], "SCALAR");
    let moves = file.floats(&[0.0, 0.5, 0.0, 0.1, 0.5, 0.0, 0.0, 0.6, 0.0], "VEC3");
    let half = 0.5_f32.sqrt();
    let turns = file.floats(&[0.0, 0.6, 0.0, 0.8, half, 0.0, 0.0, half, 0.0, 0.0, 0.0, 1.0], "VEC4");
    let short: Vec<u8> =
        [0, 19660, 0, 26214, 32767, 0, 0, 0, 0, 0, 0, 32767].into_iter().flat_map(i16::to_le_bytes).collect();
    let short = file.accessor(&short, 5122, "VEC4", 3);
    file.json["accessors"][short]["normalized"] = true.into();
    let cubic = file.floats(&(0..27).map(|i| 1.0 + i as f32 / 64.0).collect::<Vec<_>>(), "VEC3");
    let fats = file.floats(&[0.0, 1.0, 0.5, 0.0, 1.0, 0.25], "SCALAR");
    let channel =
        |sampler: usize, node: usize, path: &str| json!({"sampler": sampler, "target": {"node": node, "path": path}});
    file.push("animations", json!({"name": "walk", "extras": "left, right", "samplers": [
        {"input": times, "output": moves}, {"input": times, "output": turns, "interpolation": "STEP"},
        {"input": times, "output": cubic, "interpolation": "CUBICSPLINE"}, {"input": times, "output": fats}
    ], "channels": [channel(0, 1, "translation"), channel(1, 2, "rotation"), channel(2, 2, "scale"), channel(3, 4, "weights")]}));
    file.push(
        "animations",
        json!({"name": "wiggle", "samplers": [{"input": times, "output": short}],
        "channels": [channel(0, 3, "rotation")]}),
    );
    file
}

/// Sparse and strided accessors, strips, a gap in texture coordinates, several roots and scenes, two skins over the same
/// joints, two sets of weights, data URIs.
pub fn extremes() -> ComposedDocument {
    let mut file = ComposedDocument::new();
    let points: Vec<f32> = (0..8).flat_map(|i| [(i / 2) as f32, (i % 2) as f32, 0.25, f32::NAN]).collect();
    let points: Vec<u8> = points.iter().flat_map(|value| value.to_le_bytes()).collect();
    let position = file.accessor(&points[..124], 5126, "VEC3", 8);
    file.json["bufferViews"][0]["byteStride"] = 16.into();
    let at = file.view(&[1, 0, 5, 0]);
    let values = file.view(&[0; 24]);
    let morph = file.push(
        "accessors",
        json!({"componentType": 5126, "count": 8, "type": "VEC3", "sparse": {"count": 2,
        "indices": {"bufferView": at, "componentType": 5123}, "values": {"bufferView": values}}}),
    );
    let uv = file.accessor(&[0, 128].repeat(8), 5121, "VEC2", 8);
    file.json["accessors"][uv]["normalized"] = true.into();
    let joints: Vec<u8> = [0_u16, 1, 0, 0].repeat(8).into_iter().flat_map(u16::to_le_bytes).collect();
    let joints = file.accessor(&joints, 5123, "VEC4", 8);
    let weights = file.accessor(&[200, 55, 0, 0].repeat(8), 5121, "VEC4", 8);
    file.json["accessors"][weights]["normalized"] = true.into();
    let more = file.floats(&[0.0, 0.5, 0.0, 0.0].repeat(8), "VEC4");
    let indices: Vec<u8> = [0_u32, 1, 2, 3, 4, 5, 6, 7].into_iter().flat_map(u32::to_le_bytes).collect();
    let indices = file.accessor(&indices, 5125, "SCALAR", 8);
    let attributes = json!({"POSITION": position, "TEXCOORD_1": uv, "JOINTS_0": joints, "WEIGHTS_0": weights,
        "JOINTS_1": joints, "WEIGHTS_1": more});
    let strip = json!({"attributes": attributes, "indices": indices, "mode": 5, "targets": [{"POSITION": morph}]});
    let fan =
        json!({"attributes": {"POSITION": position}, "indices": indices, "mode": 6, "targets": [{"POSITION": morph}]});
    let list = json!({"attributes": attributes, "targets": [{"POSITION": morph, "NORMAL": morph}]});
    file.push("meshes", json!({"primitives": [strip, list]}));
    file.push(
        "meshes",
        json!({"primitives": [fan, {"attributes": {"POSITION": position}, "mode": 1, "targets": [{}]}]}),
    );
    file.root(json!({"name": "left", "translation": [1.0, 0.0, 0.0]}));
    file.root(json!({"matrix": [0.0, 2.0, 0.0, 0.0, -2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0], "children": [4]}));
    file.root(json!({"mesh": 0, "skin": 0, "children": [5]}));
    file.root(json!({"mesh": 0, "skin": 1, "weights": [0.5]}));
    file.push("nodes", json!({"mesh": 1, "scale": [1.0, 2.0, 3.0], "rotation": [0.6, 0.0, 0.0, 0.8]}));
    file.push("nodes", json!({"mesh": 1, "scale": [1.0, -1.0, 1.0]}));
    file.push("skins", json!({"joints": [0, 1]}));
    file.push("skins", json!({"joints": [1, 0], "skeleton": 0}));
    file.push("scenes", json!({"nodes": [5]}));
    file.push("images", json!({"uri": "data:image/png;base64,iVBORw0KGgo="}));
    file.push("textures", json!({"extensions": {"EXT_texture_webp": {"source": 0}}}));
    file.push("materials", json!({"normalTexture": {"index": 0, "scale": 2}}));
    file
}
