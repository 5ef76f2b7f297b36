//! glTF in and out: what is read, what is written, and that nothing is lost between.

pub mod compose;
pub mod data;
mod errors;
mod external;
mod peer_files;
mod writing;

use compose::{ComposedDocument, PNG, character, triangle};
use glam::{Vec2, Vec3, Vec4};
use rigsmith::mesh::{
    gltf::{ExternalError, ExternalFile, GltfWriteSettings, read_gltf, write_glb, write_gltf},
    model::{ChannelTarget, Image, Interpolation, Model},
};
use serde_json::{Value, json};

fn has_note(model: &Model, words: &str) -> bool {
    model.notes.iter().any(|note| note.contains(words))
}

fn names(model: &Model) -> Vec<&str> {
    model.nodes.iter().map(|node| node.name.as_str()).collect()
}

#[test]
fn skeleton() {
    let model = character().read().unwrap();
    assert_eq!(model.name, "test");
    assert_eq!(names(&model), ["armature", "hip", "knee", "toe"]);
    assert_eq!(model.nodes.iter().map(|node| node.parent).collect::<Vec<_>>(), [None, Some(0), Some(1), Some(2)]);
    assert_eq!(model.nodes.iter().map(|node| node.joint).collect::<Vec<_>>(), [false, true, true, true]);
    assert_eq!(model.nodes[2].rest.rotation.to_array(), [0.0, 0.6, 0.0, 0.8]);
    assert_eq!(model.nodes[1].extras, Some(json!({"id": 7})));
    assert_eq!(model.skins[0].joints, [2, 1, 3]);
    assert_eq!(model.skins[0].inverse_binds[2].w_axis, Vec4::new(0.0, -2.0, 0.0, 1.0));
    let weights = model.weights.as_ref().unwrap();
    let of = |point: usize| weights.of(point).collect::<Vec<_>>();
    assert_eq!(weights.len(), model.points.len());
    assert_eq!(of(0), [(1, 1.0)]);
    assert_eq!(of(1), [(1, 0.75), (2, 0.25)]);
    // The knee is listed twice; it counts once.
    assert_eq!(of(3), [(2, 1.0)]);
    // Points of the other objects have none.
    assert_eq!(of(4), []);
    assert_eq!(model.notes, Vec::<String>::new());
}

#[test]
fn geometry() {
    let model = character().read().unwrap();
    let object = |i: usize| &model.objects[i];
    assert_eq!(
        model.objects.iter().map(|object| object.name.as_str()).collect::<Vec<_>>(),
        ["body", "the hat", "stone"]
    );
    assert_eq!((object(0).skin, object(0).node), (Some(0), None));
    assert_eq!((object(1).skin, object(1).node), (None, Some(2)));
    assert_eq!((object(2).skin, object(2).node), (None, None));
    assert_eq!(object(0).morph_names, ["fat", "thin"]);
    assert_eq!(object(0).morph_weights, [0.25, 0.0]);
    assert_eq!(object(0).extras, Some(json!({"more": true})));

    let body = &model.parts[0];
    assert_eq!(model.points[3], Vec3::new(0.0, 2.0, 0.1));
    assert_eq!(body.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(body.normals, [Vec3::Z; 4]);
    assert_eq!(body.tangents, [Vec4::new(1.0, 0.0, 0.0, -1.0); 4]);
    assert_eq!(body.uvs.iter().map(|set| set[1]).collect::<Vec<_>>(), [Vec2::X, Vec2::new(1.0, 0.5)]);
    assert_eq!(body.colors, [Vec4::new(1.0, 0.5, 0.25, 1.0); 4]);
    assert_eq!(body.material, Some(0));
    assert_eq!(body.morphs[0].positions, [Vec3::new(0.0, 0.0, 0.5); 4]);
    assert_eq!(body.morphs[0].normals, [Vec3::new(0.1, 0.0, 0.0); 4]);
    assert_eq!(body.morphs[1].normals, []);

    // The hat is where its node is at rest: scale 2, 0.5 + 1 + 0.25 up, turned about Y.
    let corner = |part: usize, corner: usize| model.points[model.parts[part].vertices[corner] as usize];
    assert!(corner(1, 0).abs_diff_eq(Vec3::new(0.0, 3.5, 0.0), 1e-6));
    assert!(corner(1, 1).abs_diff_eq(Vec3::new(0.56, 3.5, -1.92), 1e-6));
    assert_eq!(model.parts[1].triangles, [[0, 1, 2]]);
    // The stone is mirrored, so it is turned to keep facing outward.
    assert_eq!(corner(2, 1), Vec3::new(4.0, 0.0, 0.0));
    assert_eq!(model.parts[2].triangles, [[0, 2, 1]]);
    assert_eq!(model.parts[2].normals, [Vec3::Z; 3]);
}

#[test]
fn materials() {
    let file = character();
    let material_set = file.read().unwrap().material_set;
    assert_eq!(&material_set.materials, file.json["materials"].as_array().unwrap());
    assert_eq!(&material_set.textures, file.json["textures"].as_array().unwrap());
    assert_eq!(&material_set.samplers, file.json["samplers"].as_array().unwrap());
    assert_eq!((material_set.images[0].name.as_str(), material_set.images[0].mime.as_str()), ("skin", "image/png"));
    assert_eq!(material_set.images[0].bytes, PNG);
    assert_eq!(Value::from(material_set.images[0].rest.clone()), json!({"extras": 1}));
    assert_eq!(material_set.extensions_used, ["KHR_materials_ior"]);
}

#[test]
fn clips() {
    let model = character().read().unwrap();
    let walk = &model.clips[0];
    assert_eq!((walk.name.as_str(), &walk.extras), ("walk", &Some(json!("left, right"))));
    let kinds: Vec<_> = walk.channels.iter().map(|channel| (channel.target, channel.interpolation)).collect();
    assert_eq!(
        kinds,
        [
            (ChannelTarget::Translation(1), Interpolation::Linear),
            (ChannelTarget::Rotation(2), Interpolation::Step),
            (ChannelTarget::Scale(2), Interpolation::CubicSpline),
            (ChannelTarget::MorphWeights(0), Interpolation::Linear),
        ]
    );
    assert_eq!(walk.channels[0].times, [0.0, 0.5, 1.25]);
    assert_eq!(walk.channels[0].values[3..6], [0.1, 0.5, 0.0]);
    assert_eq!(walk.channels[2].values.len(), 27);
    assert_eq!(walk.channels[3].values, [0.0, 1.0, 0.5, 0.0, 1.0, 0.25]);
    // Normalised integers become floats.
    assert_eq!(model.clips[1].channels[0].values[..4], [0.0, 19660.0 / 32767.0, 0.0, 26214.0 / 32767.0]);
}

#[test]
fn primitive_modes() {
    let check = |mode: u32, indices: Option<&[u8]>, expected: &[[u32; 3]]| {
        let mut file = ComposedDocument::new();
        let points: Vec<f32> = (0..6).flat_map(|i| [i as f32, (i * i) as f32, 0.0]).collect();
        let position = file.floats(&points, "VEC3");
        let mut primitive = json!({"attributes": {"POSITION": position}, "mode": mode});
        if let Some(indices) = indices {
            primitive["indices"] = file.bytes(indices, "SCALAR").into();
        }
        file.push("meshes", json!({"primitives": [primitive]}));
        file.root(json!({"mesh": 0}));
        let model = file.read().unwrap();
        let triangles = model.parts.first().map_or(&[][..], |part| &part.triangles);
        assert_eq!(triangles, expected, "mode {mode}, indices {indices:?}");
        assert_eq!(has_note(&model, "no triangles"), expected.is_empty());
    };
    check(4, None, &[[0, 1, 2], [3, 4, 5]]);
    check(4, Some(&[5, 0, 1, 2, 3]), &[[5, 0, 1]]);
    check(4, Some(&[5, 0]), &[]);
    check(5, None, &[[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]]);
    // The repeated vertices join two strips.
    check(5, Some(&[0, 1, 2, 2, 3, 3, 4, 5]), &[[0, 1, 2], [3, 5, 4]]);
    check(6, None, &[[1, 2, 0], [2, 3, 0], [3, 4, 0], [4, 5, 0]]);
    check(6, Some(&[5, 4, 3]), &[[4, 3, 5]]);
    for mode in 0..4 {
        check(mode, None, &[]);
    }
}

#[test]
fn component_types() {
    let check = |component: u32, normalized: bool, bytes: &[u8], expected: [f32; 2]| {
        let mut file = triangle();
        let uv = file.accessor(&bytes.repeat(3), component, "VEC2", 3);
        file.json["accessors"][uv]["normalized"] = normalized.into();
        file.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = uv.into();
        let model = file.read().unwrap();
        assert_eq!(model.parts[0].uvs, [[Vec2::from_array(expected); 3].to_vec()], "{component} {normalized}");
    };
    check(5120, true, &[127, 128], [1.0, -1.0]);
    check(5120, false, &[127, 128], [127.0, -128.0]);
    check(5121, true, &[51, 255], [0.2, 1.0]);
    check(5121, false, &[51, 255], [51.0, 255.0]);
    check(5122, true, &[0xFF, 0x7F, 0x01, 0x80], [1.0, -1.0]);
    check(5123, true, &[0, 0, 0xFF, 0xFF], [0.0, 1.0]);
    check(5125, false, &[1, 0, 0, 0, 0, 1, 0, 0], [1.0, 256.0]);
    check(5126, false, &[0, 0, 0x80, 0x3F, 0, 0, 0, 0xBF], [1.0, -0.5]);
}

#[test]
fn strides_and_sparse_accessors() {
    // Positions every 16 bytes.
    let mut file = triangle();
    let bytes: Vec<u8> =
        (0..12).flat_map(|i| (i as f32 * if i % 4 == 3 { f32::NAN } else { 1.0 }).to_le_bytes()).collect();
    let position = file.accessor(&bytes[..44], 5126, "VEC3", 3);
    file.json["bufferViews"][1]["byteStride"] = 16.into();
    file.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = position.into();
    let expected = [Vec3::new(0.0, 1.0, 2.0), Vec3::new(4.0, 5.0, 6.0), Vec3::new(8.0, 9.0, 10.0)];
    assert_eq!(file.read().unwrap().points, expected);

    // Zeros, with one position replaced, and the triangle with two replaced.
    let check = |over: Option<usize>, at: &[u8], values: &[f32], expected: [Vec3; 3]| {
        let mut file = triangle();
        let indices = file.view(at);
        let values: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        let values = file.view(&values);
        let mut accessor = json!({"componentType": 5126, "count": 3, "type": "VEC3", "sparse": {"count": at.len(),
            "indices": {"bufferView": indices, "componentType": 5121}, "values": {"bufferView": values}}});
        if let Some(view) = over {
            accessor["bufferView"] = view.into();
        }
        let accessor = file.push("accessors", accessor);
        file.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = accessor.into();
        assert_eq!(file.read().unwrap().points, expected);
    };
    check(None, &[1], &[1.0, 2.0, 3.0], [Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0), Vec3::ZERO]);
    check(Some(0), &[0, 2], &[9.0, 9.0, 9.0, 8.0, 8.0, 8.0], [Vec3::splat(9.0), Vec3::X, Vec3::splat(8.0)]);
}

#[test]
fn instances_become_objects() {
    let mut file = triangle();
    file.root(json!({"mesh": 0, "translation": [0.0, 0.0, 3.0], "name": "second"}));
    let model = file.read().unwrap();
    assert_eq!(model.objects.iter().map(|object| object.name.as_str()).collect::<Vec<_>>(), ["triangle", "second"]);
    assert_eq!(model.points[4] - model.points[1], Vec3::new(0.0, 0.0, 3.0));
}

#[test]
fn shared_vertices_are_shared() {
    let mut file = triangle();
    let indices = [file.bytes(&[0, 1, 2], "SCALAR"), file.bytes(&[2, 1, 0], "SCALAR")];
    let primitives = indices.map(|indices| json!({"attributes": {"POSITION": 0}, "indices": indices}));
    file.json["meshes"][0]["primitives"] = primitives.to_vec().into();
    let model = file.read().unwrap();
    assert_eq!((model.points.len(), model.parts.len()), (3, 2));
    assert_eq!(model.parts[1].normals, [-Vec3::Z; 3]);
}

#[test]
fn careless_files_are_put_right() {
    let check = |name: &str, values: &[f32], kind: &str, note: &str, right: &dyn Fn(&Model) -> bool| {
        let mut file = triangle();
        let normal = file.floats(&[0.0, 0.0, 1.0].repeat(3), "VEC3");
        file.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = normal.into();
        let accessor = file.floats(values, kind);
        file.json["meshes"][0]["primitives"][0]["attributes"][name] = accessor.into();
        let model = file.read().unwrap();
        assert!(right(&model), "{name} {values:?}: {:?}", model.parts);
        assert_eq!(has_note(&model, note), !note.is_empty(), "{:?}", model.notes);
    };
    let nan = f32::NAN;
    let up = |model: &Model| model.parts[0].normals == [Vec3::Z; 3];
    check("NORMAL", &[0.0, 0.0, 2.0].repeat(3), "VEC3", "", &up);
    check("NORMAL", &[0.0; 9], "VEC3", "A normal without direction", &up);
    check("NORMAL", &[nan; 9], "VEC3", "A normal without direction", &up);
    let across = |model: &Model| {
        model.parts[0].tangents.iter().all(|t| t.z == 0.0 && t.w == 1.0 && t.truncate().is_normalized())
    };
    check("TANGENT", &[0.0; 12], "VEC4", "A tangent without direction", &across);
    check("TANGENT", &[nan; 12], "VEC4", "A tangent without direction", &across);
    check("TEXCOORD_0", &[nan; 6], "VEC2", "texture coordinate", &|model| model.parts[0].uvs[0] == [Vec2::ZERO; 3]);
    check("TEXCOORD_1", &[1.0; 6], "VEC2", "A gap", &|model| {
        model.parts[0].uvs == [[Vec2::ZERO; 3].to_vec(), [Vec2::ONE; 3].to_vec()]
    });
    check("COLOR_0", &[2.0, -1.0, nan].repeat(3), "VEC3", "colour", &|model| {
        model.parts[0].colors == [Vec4::new(1.0, 0.0, 0.0, 1.0); 3]
    });
    check("COLOR_1", &[1.0; 9], "VEC3", "Only the first set", &|model| model.parts[0].colors.is_empty());
    check("_HEAT", &[1.0; 3], "SCALAR", "unknown kind", &up);
}

#[test]
fn weights_are_settled() {
    let check = |weights: [f32; 4], joints: [u8; 4], expected: &[(u32, f32)]| {
        let mut file = character();
        let weights_accessor = file.floats(&weights.repeat(4), "VEC4");
        let joints_accessor = file.bytes(&joints.repeat(4), "VEC4");
        let attributes = &mut file.json["meshes"][0]["primitives"][0]["attributes"];
        attributes["WEIGHTS_0"] = weights_accessor.into();
        attributes["JOINTS_0"] = joints_accessor.into();
        let model = file.read().unwrap();
        assert_eq!(model.weights.unwrap().of(2).collect::<Vec<_>>(), expected, "{weights:?} {joints:?}");
    };
    check([2.0, 6.0, 0.0, 0.0], [0, 1, 9, 9], &[(1, 0.75), (2, 0.25)]);
    check([0.25, 0.25, 0.25, 0.25], [0, 1, 0, 1], &[(1, 0.5), (2, 0.5)]);
    check([1.0, -1.0, 0.0, 0.0], [0, 1, 0, 0], &[(2, 1.0)]);
    check([0.0; 4], [0; 4], &[]);
}

#[test]
fn second_sets_of_weights_are_merged() {
    let mut file = character();
    let weights = file.floats(&[0.5, 0.0, 0.0, 0.0].repeat(4), "VEC4");
    let joints = file.bytes(&[2, 0, 0, 0].repeat(4), "VEC4");
    let attributes = &mut file.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["WEIGHTS_1"] = weights.into();
    attributes["JOINTS_1"] = joints.into();
    let model = file.read().unwrap();
    let list: Vec<_> = model.weights.unwrap().of(0).collect();
    assert_eq!(list.iter().map(|(joint, _)| *joint).collect::<Vec<_>>(), [1, 3]);
    assert!((list[0].1 - 2.0 / 3.0).abs() < 1e-7 && list[0].1 + list[1].1 == 1.0);
}

#[test]
fn scenes_and_what_is_not_kept() {
    let mut file = triangle();
    file.push("nodes", json!({"mesh": 0, "name": "elsewhere"}));
    file.push("scenes", json!({"nodes": [1]}));
    file.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}));
    file.root(json!({"camera": 0}));
    file.root(json!({"name": "nothing"}));
    let model = file.read().unwrap();
    assert_eq!((model.objects.len(), model.nodes.len()), (1, 0));
    for words in ["2 scenes; only scene 0", "A camera", "A node without mesh"] {
        assert!(has_note(&model, words), "{:?}", model.notes);
    }
    file.json["scene"] = 1.into();
    assert_eq!(file.read().unwrap().objects[0].name, "elsewhere");
    // Without scenes everything is read.
    file.json.as_object_mut().unwrap().retain(|key, _| !key.starts_with("scene"));
    assert_eq!(file.read().unwrap().objects.len(), 2);
}

#[test]
fn animated_meshes_are_rigid_parts() {
    let mut file = triangle();
    file.json["nodes"][0]["name"] = "wheel".into();
    file.push("nodes", json!({"mesh": 0, "name": "hub", "translation": [1.0, 0.0, 0.0]}));
    file.json["nodes"][0]["children"] = json!([1]);
    let times = file.floats(&[0.0, 1.0], "SCALAR");
    let values = file.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0], "VEC4");
    file.push("animations", json!({"samplers": [{"input": times, "output": values}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}},
            {"sampler": 0, "target": {"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": "/materials/0"}}}}]}));
    let model = file.read().unwrap();
    assert_eq!(names(&model), ["wheel"]);
    assert_eq!(model.objects.iter().map(|object| object.node).collect::<Vec<_>>(), [Some(0), Some(0)]);
    assert!(!model.nodes[0].joint && has_note(&model, "does not target a node"));
}

#[test]
fn matrices_are_taken_apart() {
    let check = |matrix: [f32; 16], note: &str| {
        let mut file = character();
        let node = file.json["nodes"][1].as_object_mut().unwrap();
        node.shift_remove("translation");
        node.insert("matrix".into(), json!(matrix));
        let rest = file.json.clone();
        let model = file.read().unwrap();
        let again = glam::Mat4::from(model.nodes[1].rest.affine());
        let whole = again.abs_diff_eq(glam::Mat4::from_cols_array(&matrix), 1e-5);
        assert_eq!((whole, has_note(&model, "shear")), (note.is_empty(), !note.is_empty()), "{again} {rest}");
        assert!(model.nodes[1].rest.rotation.is_normalized());
    };
    check([0.0, 2.0, 0.0, 0.0, -3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0, 0.0, 5.0, 6.0, 7.0, 1.0], "");
    check([-1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0], "");
    check([1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0], "");
    check([0.0; 15].into_iter().chain([1.0]).collect::<Vec<_>>().try_into().unwrap(), "");
    check([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0], "");
    check([1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0], "shear");
}

#[test]
fn outside_buffers_and_images() {
    let mut file = character();
    let image = file.json["images"][0].as_object_mut().unwrap();
    image.shift_remove("bufferView");
    image.insert("uri".into(), "textures/my%20skin%C3%A9.png".into());
    let bytes = file.gltf("./a b.bin");
    let mut asked = Vec::new();
    let mut load = |ExternalFile { path: uri, .. }: ExternalFile| {
        asked.push(uri.to_owned());
        if uri.ends_with(".bin") { Ok(file.bin.clone()) } else { Ok(PNG.to_vec()) }
    };
    let model = read_gltf(&bytes, "test.gltf", &mut load).unwrap();
    assert_eq!(asked, ["a b.bin", "textures/my skin\u{e9}.png"]);
    assert_eq!(model.material_set.images[0].bytes, PNG);

    // A missing image is a pity, a missing buffer an error.
    let mut load = |ExternalFile { path: uri, .. }: ExternalFile| {
        if uri.ends_with(".bin") { Ok(file.bin.clone()) } else { Err(ExternalError::new("not found")) }
    };
    let model = read_gltf(&bytes, "test.gltf", &mut load).unwrap();
    assert!(has_note(&model, "(not found)"), "{:?}", model.notes);
    let again = compose::read(&write_glb(&model, &GltfWriteSettings::default()).unwrap()).unwrap();
    assert_eq!((again.material_set.images.len(), again.material_set.textures[0].clone()), (0, json!({"sampler": 0})));
    let error = read_gltf(&bytes, "test.gltf", &mut |_| Err(ExternalError::new("not found"))).unwrap_err().to_string();
    assert_eq!(error, "test.gltf: /buffers/0/uri: \"./a b.bin\": not found");
}

#[test]
fn extremes() {
    let model = compose::extremes().read().unwrap();
    assert_eq!(names(&model), ["left", ""]);
    let skins: Vec<_> =
        model.objects.iter().map(|object| (object.skin, object.node, object.morph_weights.clone())).collect();
    let none = Vec::new;
    assert_eq!(
        skins,
        [(Some(0), None, none()), (Some(1), None, vec![0.5]), (None, Some(1), none()), (None, None, none())]
    );
    assert_eq!(model.parts.iter().map(|part| part.triangles.len()).collect::<Vec<_>>(), [6, 2, 6, 2, 6, 6]);
    // Both primitives of the first mesh use the same eight vertices; the second has triangles of the first six only.
    assert_eq!((model.points.len(), model.parts[1].vertices.len()), (4 * 8, 6));
    let weights = model.weights.as_ref().unwrap();
    let of =
        |point: usize| weights.of(point).map(|(joint, weight)| (joint, (weight * 1020.0).round())).collect::<Vec<_>>();
    assert_eq!(of(0), [(0, 533.0), (1, 487.0)]);
    assert_eq!(of(8), [(1, 533.0), (0, 487.0)]);
    assert_eq!(model.parts[0].uvs[1][0], Vec2::new(0.0, 128.0 / 255.0));
    assert_eq!(model.parts[0].morphs[0].positions[5], Vec3::ZERO);
    for words in ["2 scenes", "A gap", "Points or lines"] {
        assert!(has_note(&model, words), "{words}: {:?}", model.notes);
    }
}

#[test]
fn several_files() {
    let settings = GltfWriteSettings::default();
    let model = character().read().unwrap();
    let mut files = Vec::new();
    let mut companion = |plain: &str, bytes| {
        files.push((plain.to_owned(), bytes));
        format!("1 {plain}")
    };
    let json = write_gltf(&model, &settings, "my character", &mut companion).unwrap();
    assert_eq!(files[0], ("skin.png".to_owned(), PNG.to_vec()));
    assert_eq!((files.len(), files[1].0.as_str()), (2, "my character.bin"));
    let mut load = |ExternalFile { path: uri, .. }: ExternalFile| match uri {
        "1 my character.bin" => Ok(files[1].1.clone()),
        "1 skin.png" => Ok(PNG.to_vec()),
        _ => Err(ExternalError::new(format!("asked for {uri}"))),
    };
    let again = read_gltf(&json, "test.glb", &mut load).unwrap();
    assert_eq!(again, compose::read(&write_glb(&model, &settings).unwrap()).unwrap());

    // Images that cannot have their own name as a file get one.
    let mut model = model;
    let image = model.material_set.images[0].clone();
    let names = ["skin", "SKIN.png", "../skin", "", "hat.tga", "m_image3"];
    model.material_set.images = names.map(|name| Image { name: name.into(), ..image.clone() }).to_vec();
    let mut found = Vec::new();
    let mut companion = |plain: &str, _| {
        found.push(plain.to_owned());
        plain.to_owned()
    };
    write_gltf(&model, &settings, "m", &mut companion).unwrap();
    let images = ["skin.png", "m_image1.png", "m_image2.png", "m_image3.png", "hat.png", "m_image5.png"];
    assert_eq!(found, [&images[..], &["m.bin"]].concat());
}
