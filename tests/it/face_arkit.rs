//! Blend shapes of ARKit, baked from the bones on the command line.

use std::path::{Path, PathBuf};

use glam::{Affine3A, Quat, Vec3};
use rigsmith::{
    files::{RealDisk, load_model, load_template},
    mesh::{
        model::{ChannelTarget, Model},
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
