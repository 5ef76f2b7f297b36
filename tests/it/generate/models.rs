//! Models: meshes with a skeleton, weights, morph targets and clips, as glTF and OBJ text, and shapes that break binding.

use std::fmt::Write as _;

use glam::Vec3;
use serde_json::{Value, json};

use super::{Choices, choices::bend};

/// The smallest picture: what readers look at is its first bytes.
const PNG: &[u8] = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01\x08\x02\0\0\0\x90wS\xde\0\0\0\x0cIDATx\x9cc\xf8\
\xcf\xc0\0\0\x03\x01\x01\0\xc9\xfe\x92\xef\0\0\0\0IEND\xaeB`\x82";

/// A GLB.
#[derive(Debug, Clone)]
pub struct MadeModel {
    /// The file.
    pub glb: Vec<u8>,
    /// True if the file was bent, so that it may be no model.
    pub is_bent: bool,
}

/// Document that grows.
#[derive(Default)]
struct Document {
    accessors: Vec<Value>,
    views: Vec<Value>,
    bin: Vec<u8>,
}

impl Document {
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.views.push(json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()}));
        self.bin.extend_from_slice(bytes);
        self.views.len() - 1
    }

    fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.accessors.push(json!({"bufferView": view, "componentType": component, "count": count, "type": kind}));
        self.accessors.len() - 1
    }

    fn floats(&mut self, values: &[f32], kind: &str) -> usize {
        let width = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(&bytes, 5126, kind, values.len() / width)
    }

    /// Vectors with the bounds that positions need.
    fn vectors(&mut self, values: &[Vec3]) -> usize {
        let flat: Vec<f32> = values.iter().flat_map(|value| value.to_array()).collect();
        let at = self.floats(&flat, "VEC3");
        let bound = |of: fn(Vec3, Vec3) -> Vec3| values.iter().copied().reduce(of).unwrap_or_default().to_array();
        self.accessors[at]["min"] = json!(bound(Vec3::min));
        self.accessors[at]["max"] = json!(bound(Vec3::max));
        at
    }
}

/// Points of a strip with two columns of `rows` rows, bent and moved by choices.
fn points(choices: &mut Choices, rows: usize) -> Vec<Vec3> {
    let mut list = Vec::with_capacity(2 * rows);
    for row in 0..rows {
        for side in 0..2 {
            let plain = Vec3::new(side as f32, row as f32 * 0.5, 0.0);
            list.push(if choices.chance(4) { plain + choices.vector() * 0.25 } else { plain });
        }
    }
    list
}

/// Triangles of such a strip; a few are repeated, empty or turned over.
fn triangles(choices: &mut Choices, rows: usize) -> Vec<[u32; 3]> {
    let mut list = Vec::new();
    for row in 0..rows.saturating_sub(1) as u32 {
        let first = 2 * row;
        list.extend([[first, first + 1, first + 3], [first, first + 3, first + 2]]);
    }
    if choices.chance(6) && !list.is_empty() {
        let at = choices.below(list.len());
        let [a, b, c] = list[at];
        list.push(choices.pick(&[[a, b, c], [a, c, b], [a, a, b], [a, a, a]]));
    }
    list
}

/// A model: up to three meshes, a skeleton of up to ten joints, clips.
pub fn model(choices: &mut Choices) -> MadeModel {
    let mut document = Document::default();
    let joints = choices.below(10);
    let mut nodes: Vec<Value> = Vec::new();
    let mut roots: Vec<usize> = Vec::new();
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); joints];
    for number in 0..joints {
        let mut node = json!({"name": format!("joint {}", number % 7), "translation": [0.0, 0.5, 0.0]});
        if choices.chance(3) {
            node["rotation"] = json!(choices.rotation().to_array());
        }
        if choices.chance(8) {
            node["scale"] = json!([1.0, 2.0, 0.5]);
        }
        let parent = match choices.below(6) {
            0..=3 => number.checked_sub(1),
            4 => (number > 0).then(|| choices.below(number)),
            _ => None,
        };
        match parent {
            Some(parent) => children[parent].push(number),
            None => roots.push(number),
        }
        nodes.push(node);
    }
    for (node, below) in nodes.iter_mut().zip(&children) {
        if !below.is_empty() {
            node["children"] = json!(below);
        }
    }
    let skins = if joints > 0 && !choices.chance(4) { vec![skin(choices, &mut document, joints)] } else { Vec::new() };
    let mut meshes = Vec::new();
    for number in 0..1 + choices.below(3) {
        meshes.push(mesh(choices, &mut document, joints, !skins.is_empty()));
        let mut node = json!({"name": format!("object {number}"), "mesh": number});
        if !skins.is_empty() && !choices.chance(4) {
            node["skin"] = json!(0);
        } else if choices.chance(3) {
            node["translation"] = json!(choices.vector().to_array());
            node["scale"] = json!(choices.pick(&[[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [2.0, 2.0, 2.0]]));
        }
        roots.push(nodes.len());
        nodes.push(node);
    }
    let mut animations = Vec::new();
    for number in 0..choices.below(3) {
        if let Some(animation) = animation(choices, &mut document, joints, number) {
            animations.push(animation);
        }
    }
    let mut json = json!({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": roots}], "nodes": nodes,
        "meshes": meshes});
    if choices.chance(3) {
        let picture = document.view(PNG);
        json["images"] = json!([{"bufferView": picture, "mimeType": "image/png", "name": "skin"}]);
        json["textures"] = json!([{"source": 0}]);
        json["materials"] = json!([{"name": "skin", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
        json["meshes"][0]["primitives"][0]["material"] = json!(0);
    }
    for (name, list) in [("skins", skins), ("animations", animations)] {
        if !list.is_empty() {
            json[name] = json!(list);
        }
    }
    json["accessors"] = json!(document.accessors);
    json["bufferViews"] = json!(document.views);
    json["buffers"] = json!([{"byteLength": document.bin.len()}]);
    let mut text = json.to_string();
    let is_bent = choices.chance(4);
    if is_bent {
        bend(choices, &mut text);
    }
    MadeModel { glb: glb(text.as_bytes(), &document.bin), is_bent }
}

fn skin(choices: &mut Choices, document: &mut Document, joints: usize) -> Value {
    let mut order: Vec<usize> = (0..joints).collect();
    if choices.chance(2) {
        order.reverse();
    }
    let mut skin = json!({"joints": order});
    if !choices.chance(3) {
        let mut binds = Vec::new();
        for joint in &order {
            let mut matrix = [0.0; 16];
            (matrix[0], matrix[5], matrix[10], matrix[15]) = (1.0, 1.0, 1.0, 1.0);
            matrix[13] = -0.5 * (*joint as f32 + 1.0);
            binds.extend(matrix);
        }
        skin["inverseBindMatrices"] = json!(document.floats(&binds, "MAT4"));
    }
    skin
}

/// A mesh with one primitive.
fn mesh(choices: &mut Choices, document: &mut Document, joints: usize, is_skinned: bool) -> Value {
    let rows = 2 + choices.below(12);
    let (points, triangles) = (points(choices, rows), triangles(choices, rows));
    let count = points.len();
    let mut attributes = json!({"POSITION": document.vectors(&points)});
    if choices.chance(2) {
        attributes["NORMAL"] = json!(document.vectors(&vec![Vec3::Z; count]));
    }
    if choices.chance(2) {
        let uvs: Vec<f32> = (0..2 * count).map(|_| choices.unit()).collect();
        attributes["TEXCOORD_0"] = json!(document.floats(&uvs, "VEC2"));
    }
    if is_skinned {
        let (mut of, mut shares) = (Vec::new(), Vec::new());
        for _ in 0..count {
            let share = choices.unit();
            of.extend([choices.below(joints) as u8, choices.below(joints) as u8, 0, 0]);
            shares.extend([share, 1.0 - share, 0.0, 0.0]);
        }
        attributes["JOINTS_0"] = json!(document.accessor(&of, 5121, "VEC4", count));
        attributes["WEIGHTS_0"] = json!(document.floats(&shares, "VEC4"));
    }
    let corners: Vec<u8> = triangles.iter().flatten().flat_map(|corner| corner.to_le_bytes()).collect();
    let indices = document.accessor(&corners, 5125, "SCALAR", 3 * triangles.len());
    let morphs = choices.below(3);
    let mut primitive = json!({"attributes": attributes, "indices": indices});
    let mut mesh = json!({"name": "mesh"});
    if morphs > 0 {
        let lists: Vec<Value> = (0..morphs)
            .map(|_| {
                let offsets: Vec<Vec3> = (0..count).map(|_| choices.vector() * 0.1).collect();
                json!({"POSITION": document.vectors(&offsets)})
            })
            .collect();
        primitive["targets"] = json!(lists);
        let names: Vec<String> = (0..morphs).map(|number| format!("morph {number}")).collect();
        mesh["extras"] = json!({"targetNames": names});
    }
    mesh["primitives"] = json!([primitive]);
    mesh
}

fn animation(choices: &mut Choices, document: &mut Document, joints: usize, number: usize) -> Option<Value> {
    if joints == 0 {
        return None;
    }
    let keys = 1 + choices.below(6);
    let times: Vec<f32> = (0..keys).map(|key| key as f32 * 0.25).collect();
    let input = document.floats(&times, "SCALAR");
    let (mut samplers, mut channels) = (Vec::new(), Vec::new());
    for joint in 0..1 + choices.below(joints) {
        let mut path = choices.pick(&["rotation", "translation", "scale"]);
        if channels.len() >= 3 {
            path = "rotation";
        }
        let interpolation = choices.pick(&["LINEAR", "STEP", "CUBICSPLINE"]);
        let parts = if interpolation == "CUBICSPLINE" { 3 } else { 1 };
        let mut values: Vec<f32> = Vec::new();
        for _ in 0..keys {
            for part in 0..parts {
                let is_tangent = parts == 3 && part != 1;
                match path {
                    "rotation" if is_tangent => values.extend([0.0; 4]),
                    "rotation" => values.extend(choices.rotation().to_array()),
                    _ if is_tangent => values.extend([0.0; 3]),
                    _ => values.extend((choices.vector() * 0.125 + Vec3::ONE).to_array()),
                }
            }
        }
        let output = document.floats(&values, if path == "rotation" { "VEC4" } else { "VEC3" });
        channels.push(json!({"sampler": samplers.len(), "target": {"node": joint, "path": path}}));
        samplers.push(json!({"input": input, "output": output, "interpolation": interpolation}));
    }
    Some(json!({"name": format!("clip {number}"), "samplers": samplers, "channels": channels}))
}

/// A GLB of its parts.
fn glb(json: &[u8], bin: &[u8]) -> Vec<u8> {
    let pad = |bytes: &[u8], with: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), with);
        bytes
    };
    let (json, bin) = (pad(json, b' '), pad(bin, 0));
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend(((28 + json.len() + bin.len()) as u32).to_le_bytes());
    out.extend((json.len() as u32).to_le_bytes());
    out.extend(b"JSON");
    out.extend(json);
    out.extend((bin.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(bin);
    out
}

/// OBJ text: polygons of any size, groups, materials, negative indices, gaps in attributes.
pub fn obj(choices: &mut Choices) -> String {
    let mut text = String::from("# made\n");
    let rows = 2 + choices.below(10);
    let points = points(choices, rows);
    for point in &points {
        let _ = writeln!(text, "v {} {} {}", point.x, point.y, point.z);
    }
    let has_uvs = choices.chance(2);
    if has_uvs {
        for _ in &points {
            let _ = writeln!(text, "vt {} {}", choices.unit(), choices.unit());
        }
    }
    for row in 0..rows - 1 {
        match choices.below(8) {
            0 => {
                let _ = writeln!(text, "o object {row}");
            }
            1 => text.push_str("usemtl wood\n"),
            2 => text.push_str("s 1\n"),
            3 => text.push_str("\n# a remark\n"),
            _ => {}
        }
        let first = 2 * row + 1;
        let corners = [first, first + 1, first + 3, first + 2];
        let written: Vec<String> = corners
            .iter()
            .map(|corner| match (has_uvs, choices.chance(6)) {
                (true, _) => format!("{corner}/{corner}"),
                (false, false) => corner.to_string(),
                (false, true) => format!("-{}", points.len() + 1 - corner),
            })
            .collect();
        match choices.chance(3) {
            true => {
                let _ = writeln!(text, "f {}", written.join(" "));
            }
            false => {
                let _ = writeln!(text, "f {} {} {}", written[0], written[1], written[2]);
                let _ = writeln!(text, "f {} {} {}", written[0], written[2], written[3]);
            }
        }
    }
    text
}

/// Points and triangles that broke binding: strips, equal triangles, fans, loose ones, degenerate and far ones.
pub fn shape(choices: &mut Choices) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let count = 1 + choices.below(60);
    let mut list = Vec::new();
    let mut corners = Vec::new();
    match choices.below(6) {
        0 | 1 => {
            let rows = 2 + count / 2;
            list = points(choices, rows);
            corners = triangles(choices, rows);
        }
        2 => {
            list = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
            corners = vec![[0, 1, 2]; count];
        }
        3 => {
            list.push(Vec3::ZERO);
            list.extend((0..=count).map(|at| Vec3::new(1.0 - at as f32 / count as f32, at as f32 / count as f32, 0.0)));
            corners = (0..count as u32).map(|at| [0, at + 1, at + 2]).collect();
        }
        4 => {
            for at in 0..count as u32 {
                list.extend([choices.vector(), choices.vector(), choices.vector()]);
                corners.push([3 * at, 3 * at + 1, 3 * at + 2]);
            }
        }
        _ => {
            list = (0..count).map(|_| choices.vector()).collect();
            corners = (0..count).map(|_| [(); 3].map(|()| choices.below(count) as u32)).collect();
        }
    }
    if choices.chance(4) {
        let factor = choices.pick(&[1e-3, 1e3, 1e-20, 1e18]);
        list.iter_mut().for_each(|point| *point *= factor);
    }
    (list, corners)
}
