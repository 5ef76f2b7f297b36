//! Projects with several meshes, written as one character.

use std::{fs, path::Path, sync::Arc};

use bevy::math::{Quat, Vec3};
use rigsmith::{
    files::{MeshShape, MeshToSave, ProjectToSave, RealDisk, load_model, store_animation, store_project},
    mesh::model::Weights,
    rig::{
        JointData, Rig, RigEdit, SkinData, Uid,
        animation::{Key, Property, RigClip, Track, TrackTarget},
    },
};

use crate::cli_build::rigsmith;

/// A project of two joints with a square for each, and a square without weights; and a clip that turns a joint.
fn write_project(folder: &Path) {
    let mut rig = Rig::new(Uid(1), "rig");
    for number in 0..2 {
        let mut joint = JointData { uid: Uid(10 + number), label: Some(format!("j{number}")), ..Default::default() };
        joint.rest.translation = Vec3::Y * number as f32;
        rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent: None, index: usize::MAX }).unwrap();
    }
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
    let mut clip = RigClip::new(Uid(77), Uid(78), "turn");
    let keys = [0.0, 1.0].map(|time| Key::rotation(time, Quat::from_rotation_z(time))).to_vec();
    let target = TrackTarget { node: Uid(10), property: Property::Rotation };
    clip.layers[0].tracks.insert(target, Arc::new(Track { keys }));
    store_animation(&RealDisk, &folder.join("turn.anim.ron"), &rig, None, &[clip]).unwrap();
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
