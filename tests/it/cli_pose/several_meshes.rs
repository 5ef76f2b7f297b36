//! Several meshes, of a project or of files, written as one character.

use std::{fs, path::Path, sync::Arc};

use bevy::math::{Quat, Vec3};
use rigsmith::{
    files::{MeshShape, MeshToSave, ProjectToSave, RealDisk, load_model, store_animation, store_project, store_rig},
    mesh::model::Weights,
    rig::{
        JointData, Rig, RigEdit, SkinData, Uid,
        animation::{Key, Property, RigClip, Track, TrackTarget},
    },
};

use crate::cli_build::rigsmith;

/// A rig of two joints, and a file of a clip that turns the lower one.
fn two_joints(folder: &Path) -> Rig {
    let mut rig = Rig::new(Uid(1), "rig");
    for number in 0..2 {
        let mut joint = JointData { uid: Uid(10 + number), label: Some(format!("j{number}")), ..Default::default() };
        joint.rest.translation = Vec3::Y * number as f32;
        rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent: None, index: usize::MAX }).unwrap();
    }
    let mut clip = RigClip::new(Uid(77), Uid(78), "turn");
    let keys = [0.0, 1.0].map(|time| Key::rotation(time, Quat::from_rotation_z(time))).to_vec();
    let target = TrackTarget { node: Uid(10), property: Property::Rotation };
    clip.layers[0].tracks.insert(target, Arc::new(Track { keys }));
    store_animation(&RealDisk, &folder.join("turn.anim.ron"), &rig, None, &[clip]).unwrap();
    rig
}

/// A project of two joints with a square for each, and a square without weights; and a clip that turns a joint.
fn write_project(folder: &Path) {
    let mut rig = two_joints(folder);
    let mut meshes = Vec::new();
    for (number, name) in ["body", "coat", "loose"].into_iter().enumerate() {
        let (left, right) = (10 * number, 10 * number + 1);
        let square = format!("o {name}\nv {left} 0 0\nv {right} 0 0\nv {right} 1 0\nv {left} 1 0\nf 1 2 3 4\n");
        let path = folder.join(format!("{name}.obj"));
        fs::write(&path, square).unwrap();
        let model = load_model(&RealDisk, &path).unwrap();
        let uid = Uid(0x50 + number as u64);
        if name != "loose" {
            let mut weights = Weights::default();
            model.points.iter().for_each(|_| weights.push([(0, 1.0)]));
            let joints = vec![Uid(10 + number as u64)];
            let skin = SkinData { joints, weights, at_rest: true, ..Default::default() };
            rig.apply(&RigEdit::SetSkin(uid, Some(Arc::new(skin)))).unwrap();
        }
        let shape = MeshShape::Open { triangles: model.point_triangles().into(), rest: Arc::new(model.at_rest()) };
        meshes.push(MeshToSave { uid, rig: rig.uid(), path, nodes: Arc::default(), shape });
    }
    let project = ProjectToSave { name: "dressed".into(), rigs: vec![rig], meshes, ..Default::default() };
    store_project(&RealDisk, &folder.join("dressed.rigsmith.ron"), &project).unwrap();
}

#[test]
fn all_bound_meshes_of_a_project_are_posed_and_animated() {
    let folder = tempfile::tempdir().unwrap();
    write_project(folder.path());
    let pose = ["pose", "dressed.rigsmith.ron", "-o", "posed.glb"];
    let animate = ["animate", "dressed.rigsmith.ron", "turn.anim.ron", "-o", "moving.glb"];
    for (args, clips) in [(&pose[..], 0), (&animate[..], 1)] {
        let answer = rigsmith(folder.path(), args);
        assert_eq!(answer.code, 0, "{}", answer.err);
        assert!(answer.err.contains("the mesh \"loose\" is left out"), "what is left out is told: {}", answer.err);
        let model = load_model(&RealDisk, &folder.path().join(args[args.len() - 1])).unwrap();
        assert_eq!((model.points.len(), model.skins.len(), model.clips.len()), (8, 1, clips), "{args:?}");
        let weights = model.weights.as_ref().unwrap();
        for part in &model.parts {
            let name = &model.objects[part.object].name;
            let wanted = if name == "body" { (0.0, "j0") } else { (10.0, "j1") };
            for point in &part.vertices {
                let joints: Vec<&str> =
                    weights.of(*point as usize).map(|(node, _)| model.nodes[node as usize].name.as_str()).collect();
                assert_eq!(joints, [wanted.1], "{args:?}: {name}");
                let x = model.points[*point as usize].x;
                assert!((wanted.0..=wanted.0 + 1.0).contains(&x), "{args:?}: {name} at {x}");
            }
        }
        assert_eq!(model.parts.len(), 2, "{args:?}");
    }
}

/// A closed box of half a unit around the axis, from a height to a unit above it.
fn write_box(folder: &Path, name: &str, low: f32) {
    let mut text = format!("o {name}\n");
    for corner in 0..8 {
        let side = |axis: u32| if corner >> axis & 1 == 1 { 1.0 } else { 0.0 };
        text += &format!("v {} {} {}\n", 0.5 * side(0) - 0.25, low + side(1), 0.5 * side(2) - 0.25);
    }
    for [a, b, c, d] in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
        text += &format!("f {} {} {} {}\n", a + 1, b + 1, c + 1, d + 1);
    }
    fs::write(folder.join(format!("{name}.obj")), text).unwrap();
}

#[test]
fn meshes_of_several_files_become_one_character() {
    let folder = tempfile::tempdir().unwrap();
    let rig = two_joints(folder.path());
    store_rig(&RealDisk, &folder.path().join("two.rig.ron"), &rig).unwrap();
    write_box(folder.path(), "body", 0.0);
    write_box(folder.path(), "coat", 1.0);
    let meshes = ["--mesh", "body.obj", "--mesh", "coat.obj"];
    let skin = vec!["skin", "two.rig.ron", "body.obj", "coat.obj"];
    let build = [&["build", "two.rig.ron"][..], &meshes].concat();
    let pose = [&["pose", "two.rig.ron"][..], &meshes].concat();
    let animate = [&["animate", "two.rig.ron", "turn.anim.ron"][..], &meshes].concat();
    for (args, clips) in [(skin, 0), (build, 0), (pose, 0), (animate, 1)] {
        let answer = rigsmith(folder.path(), &[&["--json"][..], &args, &["-o", "both.glb"]].concat());
        assert_eq!(answer.code, 0, "{args:?}: {}", answer.err);
        let json = answer.json();
        let told: Vec<(&str, u64)> = json["meshes"]
            .as_array()
            .unwrap()
            .iter()
            .map(|mesh| (mesh["mesh"].as_str().unwrap(), mesh["weights"]["points"].as_u64().unwrap()))
            .collect();
        assert_eq!(told, [("body", 8), ("coat", 8)], "{args:?}: {json}");
        let model = load_model(&RealDisk, &folder.path().join("both.glb")).unwrap();
        assert_eq!((model.parts.len(), model.clips.len()), (2, clips), "{args:?}");
        let weights = model.weights.as_ref().unwrap();
        for part in &model.parts {
            let object = &model.objects[part.object];
            let low = if object.name == "body" { 0.0 } else { 1.0 };
            assert!(object.skin.is_some(), "{args:?}: {}", object.name);
            for point in &part.vertices {
                let height = model.points[*point as usize].y;
                assert!((low..=low + 1.0).contains(&height), "{args:?}: {} at {height}", object.name);
                assert!(weights.of(*point as usize).next().is_some(), "{args:?}: {}", object.name);
            }
        }
    }
    let text = rigsmith(folder.path(), &["skin", "two.rig.ron", "body.obj", "coat.obj", "-o", "both.glb"]).out;
    assert!(text.contains("body: 8 points weighted") && text.contains("coat: 8 points weighted"), "{text}");
    for option in [&["-o", "both.skin"][..], &["-o", "both.glb", "--blend", "body"]] {
        let answer = rigsmith(folder.path(), &[&["skin", "two.rig.ron", "body.obj", "coat.obj"][..], option].concat());
        assert!(answer.code == 2 && answer.err.contains("is about one mesh, and 2 are given"), "{}", answer.err);
    }
}
