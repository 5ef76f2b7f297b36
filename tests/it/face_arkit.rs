//! Blend shapes of ARKit, baked from the bones on the command line.

use std::path::{Path, PathBuf};

use glam::{Affine3A, Quat, Vec3};
use rigsmith::{
    files::{RealDisk, load_model, load_template, store_model},
    mesh::{
        gltf::GltfWriteSettings,
        model::{Channel, ChannelTarget, Clip, Interpolation, Model, Morph},
        skinning::skin_points,
    },
};

use crate::cli_build::rigsmith;

#[test]
fn the_shapes_of_arkit_are_those_of_the_bones() {
    let folder = tempfile::tempdir().unwrap();
    let head = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/head.obj").display().to_string();
    let exports = std::env::var_os("RIGSMITH_EXPORTS").map(PathBuf::from);
    let glb = exports.map_or_else(|| folder.path().join("arkit.glb"), |exports| exports.join("arkit.glb"));
    let (glb, rig) = (glb.display().to_string(), folder.path().join("arkit.rig.ron").display().to_string());
    let answer = rigsmith(folder.path(), &["face", &head, "--arkit", "-o", &glb, "--json"]);
    assert_eq!(answer.code, 0, "{}", answer.err);
    assert_eq!(answer.json()["arkit"].as_array().unwrap().len(), 51);
    assert_eq!(answer.json()["arkit_left_out"], serde_json::json!(["tongueOut"]));
    let model = load_model(&RealDisk, Path::new(&glb)).unwrap();
    let names = &model.objects[model.parts[0].object].morph_names;
    assert_eq!(names.len(), 51);
    for name in ["eyeBlinkLeft", "jawOpen", "mouthClose", "mouthSmileRight", "noseSneerLeft", "browInnerUp"] {
        assert!(names.iter().any(|known| known == name), "{name} is baked");
    }
    let size = model.points.iter().fold(Vec3::ZERO, |most, point| most.max(point.abs())).max_element();
    let (mut furthest, mut largest) = (0.0_f32, 0.0_f32);
    for (number, name) in names.iter().enumerate() {
        let clip = model.clips.iter().find(|clip| clip.name == *name).unwrap_or_else(|| panic!("no clip {name}"));
        let mut posed = model.clone();
        for channel in &clip.channels {
            match (channel.target, channel.values.as_slice()) {
                (ChannelTarget::Translation(node), [x, y, z]) => {
                    posed.nodes[node].rest.translation = Vec3::new(*x, *y, *z);
                }
                (ChannelTarget::Rotation(node), [x, y, z, w]) => {
                    posed.nodes[node].rest.rotation = Quat::from_xyzw(*x, *y, *z, *w);
                }
                (target, values) => panic!("{name}: {target:?} {values:?}"),
            }
        }
        let (moved, rest) = (skinned(&posed), skinned(&model));
        for part in &model.parts {
            for (vertex, point) in part.vertices.iter().enumerate() {
                let own = moved[*point as usize] - rest[*point as usize];
                furthest = furthest.max(own.distance(part.morphs[number].positions[vertex]));
                largest = largest.max(own.length());
            }
        }
    }
    assert!(largest > 0.02 * size, "shapes move: {largest}");
    println!("{furthest} between shapes and bones on a head of {size}");
    // In metres.
    assert!(furthest <= 5e-5, "{furthest} between shapes and bones on a head of {size}");

    assert_eq!(rigsmith(folder.path(), &["face", &head, "--arkit", "-o", &rig]).code, 0);
    let template = load_template(&RealDisk, Path::new(&rig)).unwrap();
    // And both sides of three units without a name in ARKit.
    assert_eq!(template.rig.stored_poses().len(), 57);
}

/// Clips of the mesh that move morph targets of its own do so beside the baked shapes, too.
#[test]
fn clips_of_morph_targets_stay() {
    let folder = tempfile::tempdir().unwrap();
    let head = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/head.obj");
    let mut model = load_model(&RealDisk, &head).unwrap();
    let own = ["puff", "lift"].map(str::to_owned);
    for object in &mut model.objects {
        object.morph_names = own.to_vec();
    }
    for part in &mut model.parts {
        let along = |axis: Vec3| Morph { positions: vec![0.01 * axis; part.vertices.len()], ..Morph::default() };
        part.morphs = vec![along(Vec3::Z), along(Vec3::Y)];
    }
    let rows = [[0.0_f32, 0.25], [0.5, 1.0], [0.125, 0.75]].concat();
    let clip = |name: &str, interpolation: Interpolation, times: Vec<f32>| Clip {
        name: name.to_owned(),
        channels: vec![Channel { target: ChannelTarget::MorphWeights(0), interpolation, times, values: rows.clone() }],
        extras: None,
    };
    // The three rows of a cubic spline are the one key with its tangents.
    model.clips = vec![
        clip("line", Interpolation::Linear, vec![0.0, 1.0, 2.0]),
        clip("spline", Interpolation::CubicSpline, vec![0.0]),
    ];
    let [mesh, glb] = ["morphs.glb", "arkit.glb"].map(|file| folder.path().join(file));
    store_model(&RealDisk, &mesh, &model, &GltfWriteSettings::default()).unwrap();
    let args = ["face", "morphs.glb", "--bones", "12", "--arkit", "-o", "arkit.glb"];
    let answer = rigsmith(folder.path(), &args);
    assert_eq!(answer.code, 0, "{}", answer.err);
    let written = load_model(&RealDisk, &glb).unwrap();
    for name in ["line", "spline"] {
        let clip = written.clips.iter().find(|clip| clip.name == name).unwrap_or_else(|| panic!("no clip {name}"));
        let [channel] = clip.channels.as_slice() else { panic!("{:?}", clip.channels) };
        let ChannelTarget::MorphWeights(object) = channel.target else { panic!("{:?}", channel.target) };
        let names = &written.objects[object].morph_names;
        assert!(names.starts_with(&own) && names.len() == 2 + 51, "{names:?}");
        assert_eq!(channel.values.len(), 3 * names.len(), "{name}");
        for (row, before) in channel.values.chunks(names.len()).zip(rows.chunks(2)) {
            assert_eq!(&row[..2], before, "{name}");
            assert!(row[2..].iter().all(|value| *value == 0.0), "{name}: {row:?}");
        }
    }
}

/// Points of a model skinned by its nodes as they stand.
pub fn skinned(model: &Model) -> Vec<Vec3> {
    let mut globals: Vec<Affine3A> = Vec::new();
    for node in &model.nodes {
        let own = Affine3A::from_scale_rotation_translation(node.rest.scale, node.rest.rotation, node.rest.translation);
        globals.push(node.parent.map_or(own, |parent| globals[parent] * own));
    }
    let skin = &model.skins[0];
    let mut matrices = vec![Affine3A::IDENTITY; model.nodes.len()];
    for (joint, inverse) in skin.joints.iter().zip(&skin.inverse_binds) {
        matrices[*joint] = globals[*joint] * Affine3A::from_mat4(*inverse);
    }
    let mut points = Vec::new();
    skin_points(&model.points, model.weights.as_ref().unwrap(), &matrices, &mut points);
    points
}
