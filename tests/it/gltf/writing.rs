//! Written files: only joints that deform, as much as asked for, and nothing lost on the way back.

use super::{
    compose::{PNG, character, read, triangle},
    names,
};
use glam::{Mat4, Vec2, Vec3};
use rigsmith::mesh::{
    gltf::{ExternalError, GltfError, GltfWriteSettings, read_gltf, write_glb},
    model::{ChannelTarget, Model, Node, Object, Part, SkinBinding, Trs, Weights},
};
use serde_json::{Value, json};

/// The JSON of a GLB.
fn json_of(glb: &[u8]) -> Value {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    serde_json::from_slice(&glb[20..20 + length]).unwrap()
}

/// Writes, checks that reading and writing again changes nothing, keeps the file for the validator.
pub fn there_and_back(name: &str, model: &Model, settings: &GltfWriteSettings) -> Model {
    let first = write_glb(model, settings).unwrap();
    assert_eq!(first, write_glb(model, settings).unwrap());
    assert_eq!(first.len() % 4, 0);
    let other_reader = ::gltf::Gltf::from_slice(&first);
    assert!(other_reader.is_ok(), "{name}: {other_reader:?}");
    let again = read_gltf(&first, name, &mut |uri| Err(ExternalError::new(format!("there is no {uri}")))).unwrap();
    let second = write_glb(&again, settings).unwrap();
    let third = read_gltf(&second, name, &mut |uri| Err(ExternalError::new(format!("there is no {uri}")))).unwrap();
    assert!(again == third, "{name} changes when written again");
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("gltf");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join(format!("{name}.glb")), first).unwrap();
    again
}

fn all_joints() -> GltfWriteSettings {
    GltfWriteSettings { all_joints: true, ..Default::default() }
}

#[test]
fn everything_comes_back() {
    let model = character().read().unwrap();
    let mut again = there_and_back("character_all", &model, &all_joints());
    again.name.clone_from(&model.name);
    // The hat's vertices have been to its node and back.
    for (point, before) in again.points.iter_mut().zip(&model.points) {
        assert!(point.abs_diff_eq(*before, 1e-6));
        *point = *before;
    }
    assert_eq!(again, model);
}

#[test]
fn only_joints_that_deform() {
    let model = character().read().unwrap();
    let again = there_and_back("character", &model, &GltfWriteSettings::default());
    assert_eq!(names(&again), ["armature", "hip", "knee"]);
    assert_eq!(again.skins[0].joints, [2, 1]);
    assert_eq!(again.skins[0].inverse_binds, model.skins[0].inverse_binds[..2]);
    assert_eq!(again.weights, model.weights);
    // The toe was all that wiggled.
    assert_eq!(again.clips, model.clips[..1]);
    assert_eq!(
        (&again.material_set, &again.parts, &again.objects),
        (&model.material_set, &model.parts, &model.objects)
    );
}

#[test]
fn ancestors_keep_their_kind() {
    // Of a chain of joints with a plain node between, only the last has weights.
    let mut file = character();
    let joints = file.bytes(&[1, 0, 0, 0].repeat(4), "VEC4");
    let weights = file.floats(&[1.0, 0.0, 0.0, 0.0].repeat(4), "VEC4");
    let attributes = &mut file.json["meshes"][0]["primitives"][0]["attributes"];
    (attributes["JOINTS_0"], attributes["WEIGHTS_0"]) = (joints.into(), weights.into());
    file.json["skins"][0] = json!({"joints": [1, 3]});
    let again = there_and_back("character_plain_between", &file.read().unwrap(), &GltfWriteSettings::default());
    assert_eq!(names(&again), ["armature", "hip", "knee", "toe"]);
    assert_eq!(again.nodes.iter().map(|node| node.joint).collect::<Vec<_>>(), [false, true, false, true]);
}

/// A square of points with the given influences, over joints that are all roots.
fn rigged(joints: usize, influences: impl Fn(usize) -> Vec<(u32, f32)>) -> Model {
    let mut weights = Weights::default();
    (0..3).for_each(|point| weights.push(influences(point)));
    let node = |i: usize| Node {
        name: format!("joint{}", i % 2),
        rest: Trs { translation: Vec3::splat(i as f32), ..Trs::IDENTITY },
        joint: true,
        ..Default::default()
    };
    let bind = |i: usize| Mat4::from_translation(Vec3::splat(-(i as f32)));
    Model {
        points: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        objects: vec![Object { name: "body".into(), skin: Some(0), ..Default::default() }],
        parts: vec![Part { vertices: vec![0, 1, 2], triangles: vec![[0, 1, 2]], ..Default::default() }],
        nodes: (0..joints).map(node).collect(),
        skins: vec![SkinBinding {
            joints: (0..joints).collect(),
            inverse_binds: (0..joints).map(bind).collect(),
            ..Default::default()
        }],
        weights: Some(weights),
        ..Default::default()
    }
}

#[test]
fn influences() {
    let model = rigged(10, |_| (0..10).map(|joint| (joint, (10 - joint) as f32 / 55.0)).collect());
    for (most, kept) in [(1, 1), (3, 3), (4, 4), (5, 5), (8, 8), (100, 8), (0, 1)] {
        let settings = GltfWriteSettings { max_influences: most, ..Default::default() };
        let again = there_and_back(&format!("influences_{most}"), &model, &settings);
        let list: Vec<_> = again.weights.as_ref().unwrap().of(1).collect();
        assert_eq!(list.len(), kept);
        let total: f32 = (10 - kept as u32 + 1..=10).sum::<u32>() as f32;
        for (place, (joint, weight)) in list.iter().enumerate() {
            // Several joints are joined by a root, which is node 0.
            assert_eq!(*joint as usize, place + usize::from(kept > 1));
            assert!((weight - (10 - place) as f32 / total).abs() < 1e-6);
        }
        let sum: f64 = list.iter().map(|(_, weight)| f64::from(*weight)).sum();
        assert!((sum - 1.0).abs() < 1e-7, "{sum}");
    }
}

#[test]
fn several_roots_get_one() {
    let model = rigged(3, |point| vec![(point as u32, 1.0)]);
    let again = there_and_back("several_roots", &model, &GltfWriteSettings::default());
    assert_eq!(names(&again), ["skeleton", "joint0", "joint1", "joint0"]);
    assert_eq!(again.nodes.iter().map(|node| node.parent).collect::<Vec<_>>(), [None, Some(0), Some(0), Some(0)]);
    assert!(!again.nodes[0].joint && again.nodes[0].rest == Trs::IDENTITY);
    // One root that deforms needs no help.
    let model = rigged(3, |_| vec![(1, 1.0)]);
    let again = there_and_back("one_root", &model, &GltfWriteSettings::default());
    assert_eq!(names(&again), ["joint1"]);
}

#[test]
fn many_joints() {
    for (count, component) in [(256, 5121), (257, 5123)] {
        let model = rigged(count, |point| vec![((count - 1 - point) as u32, 1.0)]);
        let glb = write_glb(&model, &all_joints()).unwrap();
        let json = json_of(&glb);
        let joints = json["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"].as_u64().unwrap() as usize;
        assert_eq!(json["accessors"][joints]["componentType"], component);
        let again = there_and_back(&format!("joints_{count}"), &model, &all_joints());
        assert_eq!(again.weights.unwrap().of(0).next(), Some((count as u32, 1.0)));
    }
}

#[test]
fn unweighted_points() {
    let model = rigged(3, |point| if point == 1 { vec![(2, 1.0)] } else { vec![] });
    let error = write_glb(&model, &GltfWriteSettings::default()).unwrap_err();
    assert_eq!(error, GltfError::Unweighted { object: "body".into(), points: 2 });
    let settings = GltfWriteSettings { bind_unweighted: true, ..Default::default() };
    let again = there_and_back("unweighted", &model, &settings);
    assert_eq!(names(&again), ["skeleton", "joint0", "joint0"]);
    let weights = again.weights.unwrap();
    assert_eq!(
        (0..3).map(|point| weights.of(point).next()).collect::<Vec<_>>(),
        [Some((1, 1.0)), Some((2, 1.0)), Some((1, 1.0))]
    );
}

#[test]
fn rigid_parts_hang_where_they_were() {
    // A carrier whose transform can be undone by a node, and one where only moving the vertices helps.
    for (name, scale) in
        [("even", Vec3::splat(4.0)), ("uneven", Vec3::new(1.0, 2.0, 5.0)), ("mirrored", Vec3::new(-1.0, 2.0, 5.0))]
    {
        let mut model = rigged(2, |_| vec![(1, 1.0)]);
        model.nodes[1].parent = Some(0);
        model.nodes[0].rest.scale = scale;
        model.nodes[1].rest.rotation = glam::Quat::from_xyzw(0.48, 0.6, 0.0, 0.64);
        model.objects.push(Object { name: "hat".into(), node: Some(1), ..Default::default() });
        model.points.extend([Vec3::new(3.0, 1.0, 2.0), Vec3::new(3.0, 2.0, 2.0), Vec3::new(3.0, 1.0, 4.0)]);
        (0..3).for_each(|_| model.weights.as_mut().unwrap().push([]));
        let mut part = Part { object: 1, vertices: vec![3, 4, 5], triangles: vec![[0, 1, 2]], ..Default::default() };
        part.normals = vec![Vec3::X; 3];
        model.parts.push(part);
        let glb = write_glb(&model, &GltfWriteSettings::default()).unwrap();
        let json = json_of(&glb);
        assert_eq!(json["nodes"][1]["children"], json!([3]), "{name}: {json}");
        let again = read(&glb).unwrap();
        assert_eq!((again.objects[1].node, again.parts[1].triangles[0]), (Some(1), [0, 1, 2]));
        for point in 3..6 {
            assert!(again.points[point].abs_diff_eq(model.points[point], 1e-5), "{name}");
            assert!(again.parts[1].normals[point - 3].abs_diff_eq(Vec3::X, 1e-5), "{name}");
        }
        there_and_back(&format!("rigid_{name}"), &model, &GltfWriteSettings { bind_unweighted: true, ..all_joints() })
            .name
            .clear();
    }
}

/// A chain that turns, grows and shrinks by the same amounts, with an object on each of its nodes.
#[test]
fn objects_all_along_a_chain_hang_where_they_were() {
    const COUNT: usize = 60;
    // A skin on the last joint, for which all are kept.
    let mut model = rigged(COUNT, |_| vec![(COUNT as u32 - 1, 1.0)]);
    for number in 0..COUNT {
        let node = &mut model.nodes[number];
        node.parent = number.checked_sub(1);
        node.rest = Trs {
            translation: Vec3::new(0.1, 0.2, 0.0),
            rotation: glam::Quat::from_rotation_z(0.3),
            scale: Vec3::splat(if number % 2 == 0 { 1.25 } else { 0.8 }),
        };
        let first = model.points.len() as u32;
        model.points.extend([0.0, 0.5, 1.0].map(|along| Vec3::new(along, along * along, 0.01 * number as f32)));
        (0..3).for_each(|_| model.weights.as_mut().unwrap().push([]));
        model.objects.push(Object { name: format!("o{number}"), node: Some(number), ..Object::default() });
        model.parts.push(Part {
            object: number + 1,
            vertices: vec![first, first + 1, first + 2],
            triangles: vec![[0, 1, 2]],
            ..Part::default()
        });
    }
    let again = there_and_back("objects_on_a_chain", &model, &GltfWriteSettings::default());
    assert_eq!(again.points.len(), model.points.len());
    for (point, before) in again.points.iter().zip(&model.points) {
        assert!(point.abs_diff_eq(*before, 1e-4), "{point} was {before}");
    }
    let carriers = |model: &Model| -> Vec<Option<usize>> { model.objects.iter().map(|object| object.node).collect() };
    assert_eq!(carriers(&again), carriers(&model));
}

#[test]
fn unused_vertices_are_not_written() {
    let mut model = triangle().read().unwrap();
    model.points.insert(0, Vec3::splat(9.0));
    model.parts[0].vertices = vec![0, 1, 0, 2, 3];
    model.parts[0].normals = vec![Vec3::Z; 5];
    model.parts[0].triangles = vec![[1, 3, 4]];
    let again = there_and_back("unused", &model, &GltfWriteSettings::default());
    assert_eq!((again.points.len(), &again.parts[0].triangles[0]), (3, &[0, 1, 2]));
    assert_eq!(again.points, model.points[1..]);
}

#[test]
fn names_are_unchanged_or_left_out() {
    let mut model = rigged(2, |point| vec![(point as u32 % 2, 1.0)]);
    model.nodes[1].parent = Some(0);
    for node in &mut model.nodes {
        node.name = "twice \"\u{e9}\u{1F600}\"".into();
    }
    model.objects[0].name.clear();
    let json = json_of(&write_glb(&model, &GltfWriteSettings::default()).unwrap());
    assert_eq!(json["nodes"][0]["name"], "twice \"\u{e9}\u{1F600}\"");
    assert_eq!(json["nodes"][0]["name"], json["nodes"][1]["name"]);
    assert_eq!((json["nodes"][2].get("name"), json["meshes"][0].get("name")), (None, None));
    assert_eq!(json["nodes"][2]["skin"], 0);
    there_and_back("names", &model, &GltfWriteSettings::default());
}

#[test]
fn nothing_to_write() {
    let json = json_of(&write_glb(&Model::default(), &GltfWriteSettings::default()).unwrap());
    assert_eq!(json, json!({"asset": {"version": "2.0", "generator": "Rigsmith"}}));
    there_and_back("empty", &Model::default(), &GltfWriteSettings::default());
}

#[test]
fn required_extensions_stay_required() {
    let mut file = character();
    file.json["extensionsUsed"] = json!(["KHR_texture_basisu", "KHR_materials_ior", "KHR_mesh_quantization"]);
    file.json["extensionsRequired"] = json!(["KHR_mesh_quantization", "KHR_texture_basisu"]);
    file.json["textures"][0] = json!({"extensions": {"KHR_texture_basisu": {"source": 0}}});
    let json = json_of(&write_glb(&file.read().unwrap(), &GltfWriteSettings::default()).unwrap());
    assert_eq!(json["extensionsUsed"], json!(["KHR_texture_basisu", "KHR_materials_ior"]));
    assert_eq!(json["extensionsRequired"], json!(["KHR_texture_basisu"]));
    assert_eq!(json["textures"][0], json!({"extensions": {"KHR_texture_basisu": {"source": 0}}}));
    assert_eq!(json["images"][0]["mimeType"], "image/png");
    assert_eq!(
        PNG.len() as u64,
        json["bufferViews"][json["images"][0]["bufferView"].as_u64().unwrap() as usize]["byteLength"].as_u64().unwrap()
    );
}

#[test]
fn textures_get_the_coordinates_they_need() {
    let mut model = character().read().unwrap();
    model.parts[0].uvs = vec![];
    model.parts[2].uvs = vec![vec![], vec![Vec2::ONE; 3]];
    let again = there_and_back("uv_sets", &model, &GltfWriteSettings::default());
    // The skin's texture uses the second set, the hat has none.
    assert_eq!(again.parts[0].uvs, vec![vec![Vec2::ZERO; 4]; 2]);
    assert_eq!(again.parts[1].uvs, Vec::<Vec<Vec2>>::new());
    assert_eq!(again.parts[2].uvs, [vec![Vec2::ZERO; 3], vec![Vec2::ONE; 3]]);
}

#[test]
fn models_that_do_not_fit_together() {
    let check = |change: &dyn Fn(&mut Model), text: &str| {
        let mut model = character().read().unwrap();
        change(&mut model);
        let error = write_glb(&model, &GltfWriteSettings::default()).unwrap_err().to_string();
        assert!(error.starts_with("the model cannot be written as glTF: ") && error.contains(text), "{text}: {error}");
    };
    check(&|model| model.nodes[1].parent = Some(1), "node 1 comes before its parent");
    check(&|model| model.nodes[1].rest.scale.x = f32::NAN, "rest transform of node 1");
    check(
        &|model| model.nodes.iter_mut().for_each(|node| node.rest.scale = Vec3::splat(1e30)),
        "is at no finite place: its numbers and those of the joints above it",
    );
    let unnamed = |model: &mut Model| {
        for node in &mut model.nodes {
            node.rest.scale = Vec3::splat(1e30);
            node.name.clear();
        }
    };
    check(&unnamed, "joint 1 is at no finite place");
    check(&|model| model.skins[0].joints[0] = 9, "skin 0 refers to a node");
    check(&|model| model.skins[0].joints[0] = 1, "skin 0 lists a node twice");
    check(&|model| model.skins[0].joints.truncate(2), "skin 0 has 2 joints, 3 matrices");
    check(&|model| model.skins[0].inverse_binds[0].x_axis.x = f32::INFINITY, "inverse bind matrix of skin 0");
    check(&|model| model.objects[0].skin = Some(1), "object 0 refers to a skin");
    check(&|model| model.objects[1].node = Some(4), "object 1 refers to a node");
    check(&|model| model.weights = None, "object 0 has a skin, but");
    check(&|model| model.objects[0].morph_weights = vec![1.0], "object 0 has a wrong number");
    check(&|model| model.objects[0].morph_names.clear(), "object 0 has a wrong number");
    check(&|model| model.parts[1].object = 3, "part 1: refers to an object");
    check(&|model| model.parts[1].material = Some(2), "part 1: refers to a material");
    check(&|model| model.parts[1].vertices[0] = 10, "part 1: a vertex refers to a point");
    check(&|model| model.parts[1].triangles[0][2] = 3, "part 1: a triangle refers to a vertex");
    check(&|model| model.parts[0].normals.truncate(3), "part 0: a list of attributes");
    check(&|model| model.parts[0].morphs.truncate(1), "part 0: has another number of morph targets");
    check(&|model| model.parts[0].morphs[0].positions[0].x = f32::NAN, "part 0: a texture coordinate or morph");
    check(&|model| model.points[0].x = f32::NAN, "part 0: a point is not finite");
    check(&|model| model.points.truncate(9), "part 2: a vertex refers to a point");
    check(&|model| model.points.push(Vec3::ZERO), "weights are not as long");
    let weights = |change: fn(&mut Weights)| move |model: &mut Model| change(model.weights.as_mut().unwrap());
    check(&weights(|weights| weights.joints[0] = 4), "weights refer to a node");
    check(&weights(|weights| weights.values[0] = f32::NAN), "a weight is not finite");
    check(&weights(|weights| weights.starts[1] = 60), "weights are not as long");
    check(&weights(|weights| weights.joints[0] = 0), "point 0 has weights on node 0, which its skin does not list");
    check(&|model| model.clips[0].channels[0].target = ChannelTarget::Scale(4), "clip 0 refers to something");
    check(&|model| model.clips[0].channels[0].values.truncate(8), "clip 0 has a wrong number");
    check(&|model| model.clips[0].channels[0].times[1] = 0.0, "clip 0 is not finite, or its times");
}

/// A triangle with a skin of its own, again and again, all of the same content.
fn alike(count: usize) -> Model {
    let mut model = rigged(3, |point| vec![(point as u32, 1.0)]);
    let (part, skin) = (model.parts[0].clone(), model.skins[0].clone());
    let row: Vec<Vec<(u32, f32)>> = (0..3).map(|point| model.weights.as_ref().unwrap().of(point).collect()).collect();
    for number in 1..count {
        let first = model.points.len() as u32;
        model.points.extend_from_within(..3);
        row.iter().for_each(|row| model.weights.as_mut().unwrap().push(row.iter().copied()));
        model.objects.push(Object { name: format!("o{number}"), skin: Some(number), ..Object::default() });
        model.parts.push(Part { object: number, vertices: vec![first, first + 1, first + 2], ..part.clone() });
        model.skins.push(skin.clone());
    }
    model
}

#[test]
fn accessors_of_the_same_content_are_written_once() {
    let count = |json: &Value, list: &str| json[list].as_array().unwrap().len();
    let one = json_of(&write_glb(&alike(1), &GltfWriteSettings::default()).unwrap());
    let many = json_of(&write_glb(&alike(20), &GltfWriteSettings::default()).unwrap());
    for list in ["accessors", "bufferViews"] {
        assert_eq!(count(&many, list), count(&one, list), "{list}");
    }
    assert_eq!((count(&many, "meshes"), count(&many, "skins")), (20, 20));
    assert_eq!(many["buffers"], one["buffers"]);
    // Objects that have the same name, too, are one mesh in several places.
    let mut namesakes = alike(20);
    namesakes.objects.iter_mut().for_each(|object| object.name = "twin".to_owned());
    namesakes.objects[8].extras = Some(json!({"id": 8}));
    let json = json_of(&write_glb(&namesakes, &GltfWriteSettings::default()).unwrap());
    let meshes: Vec<u64> = json["nodes"].as_array().unwrap().iter().filter_map(|node| node["mesh"].as_u64()).collect();
    assert_eq!(count(&json, "meshes"), 2);
    assert!(
        meshes.len() == 20 && meshes.iter().enumerate().all(|(at, mesh)| *mesh == u64::from(at == 8)),
        "{meshes:?}"
    );
    let again = there_and_back("namesakes", &namesakes, &GltfWriteSettings::default());
    assert_eq!(again.objects[8].extras, namesakes.objects[8].extras);
    let again = there_and_back("alike", &alike(20), &GltfWriteSettings::default());
    assert_eq!((again.points.len(), again.skins.len(), again.parts.len()), (60, 20, 20));
}

/// Parts of one object keep points of their own, though all of them lie in the same places.
#[test]
fn parts_in_the_same_place_keep_their_points() {
    let mut model = alike(4);
    for (part, object) in model.parts.iter_mut().zip([0, 0, 1, 1]) {
        part.object = object;
    }
    model.objects.truncate(2);
    let json = json_of(&write_glb(&model, &GltfWriteSettings::default()).unwrap());
    let position = |mesh: usize, primitive: usize| {
        json["meshes"][mesh]["primitives"][primitive]["attributes"]["POSITION"].as_u64().unwrap()
    };
    assert_ne!(position(0, 0), position(0, 1));
    assert_ne!(position(1, 0), position(1, 1));
    let bounds =
        |accessor: u64| (&json["accessors"][accessor as usize]["min"], &json["accessors"][accessor as usize]["max"]);
    assert_eq!(bounds(position(0, 0)), bounds(position(0, 1)));
    let again = there_and_back("same_place", &model, &GltfWriteSettings::default());
    assert_eq!(again.points, model.points);
}
