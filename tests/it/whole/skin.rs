//! Binding: a mesh of any shape and joints anywhere become weights, a skin file and a character, and all of them are read again.

use glam::Vec3;
use rigsmith::{
    algo::weights::{Method, WeightJoint, WeightSettings, skin_weights},
    files::{StoreError, load_model, load_skin, store_model, store_skin},
    headless::Workbench,
    mesh::{
        gltf::GltfWriteSettings,
        model::{Model, Part, Weights},
        obj::{ObjSettings, read_model},
    },
    rig::{
        JointData, RestTransform, Rig, RigEdit, SkinData, Uid,
        skin::{SkinFile, SkinJoint},
    },
};

use super::{
    memory_disk::{MemoryDisk, at},
    promises,
    template::refused,
};
use crate::generate::{Choices, models::shape};

const CUBE: &str = "o box\nv -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n\
    f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

/// A cube of eight points.
pub fn cube() -> Model {
    read_model(CUBE.as_bytes(), "cube", &ObjSettings::default(), &mut |_| None).expect("a cube")
}

/// Weights that bind all points to the first joint.
pub fn held_by_first(rig: &Rig, points: usize) -> SkinData {
    let mut weights = Weights::default();
    (0..points).for_each(|_| weights.push([(0, 1.0)]));
    let joints = rig.walk().map(|joint| joint.data.uid).collect();
    SkinData { joints, weights, at_rest: true, ..SkinData::default() }
}

/// A model of points and triangles in one part.
fn model_of(points: &[Vec3], triangles: &[[u32; 3]]) -> Model {
    let vertices: Vec<u32> = (0..points.len() as u32).collect();
    let part =
        Part { vertices, normals: vec![Vec3::Y; points.len()], triangles: triangles.to_vec(), ..Part::default() };
    Model { points: points.to_vec(), objects: vec![Default::default()], parts: vec![part], ..Model::default() }
}

/// Binds a mesh and carries the weights to a file and back.
pub fn check(bytes: &[u8]) {
    let choices = &mut Choices::new(bytes);
    let (points, triangles) = shape(choices);
    let count = 1 + choices.below(8);
    let mut rig = Rig::new(Uid(1), "made");
    let mut joints: Vec<WeightJoint> = Vec::new();
    for number in 0..count {
        let parent = (number > 0).then(|| if choices.chance(4) { choices.below(number) } else { number - 1 });
        let head = if choices.chance(3) { choices.vector() } else { Vec3::new(0.5, number as f32 * 0.4, 0.0) };
        let deforms = !choices.chance(8);
        joints.push(WeightJoint { head, parent, tail: None, deforms, twist: None, halves: None });
        let local = head - parent.map_or(Vec3::ZERO, |parent| joints[parent].head);
        let (uid, rest) = (Uid(10 + number as u64), RestTransform::from_translation(local));
        let joint = JointData { uid, label: Some(format!("j{number}")), rest, ..JointData::default() };
        let parent = parent.map(|parent| Uid(10 + parent as u64));
        let add = RigEdit::AddJoint { joint: Box::new(joint), parent, index: usize::MAX };
        rig.apply(&add).expect("a joint with a finite place");
    }
    let settings = WeightSettings {
        max_influences: 1 + choices.below(8),
        smoothing: choices.pick(&[1.0, 0.25, 4.0, 0.0, -1.0, f32::NAN, f32::INFINITY]),
        method: choices.pick(&[Method::Auto, Method::Heat, Method::Voxel]),
        voxel_resolution: choices.pick(&[16, 32, 1, 0, 48]),
        prune: choices.pick(&[0.002, 0.0, 0.5, 2.0]),
        stiff_parts: !choices.chance(3),
        ..WeightSettings::default()
    };
    let bound = skin_weights(&points, &triangles, &joints, &[], None, &settings, &|_| true);
    let again = skin_weights(&points, &triangles, &joints, &[], None, &settings, &|_| true);
    assert_eq!(bound.as_ref().map(|(weights, _)| weights), again.as_ref().map(|(weights, _)| weights));
    let weights = match bound {
        Ok((weights, report)) => {
            assert_eq!(report.points, points.len());
            weights
        }
        Err(error) => return promises::error(&error),
    };
    promises::weights(&weights, points.len(), joints.len(), 1e-6);
    let most = settings.max_influences.max(1);
    assert!((0..points.len()).all(|point| (1..=most).contains(&weights.of(point).len())), "a point without weights");

    let skin = SkinData {
        joints: rig.walk().map(|joint| joint.data.uid).collect(),
        weights: reordered(&weights, &rig),
        at_rest: true,
        ..SkinData::default()
    };
    let disk = MemoryDisk::default();
    let file = SkinFile::new(SkinJoint::list(&rig, &skin), skin.weights.clone(), &points, &triangles, true);
    let file = file.expect("weights that were computed fit their mesh");
    store_skin(&disk, &at("w.skin"), &file).expect("weights can be saved");
    let read = load_skin(&disk, &at("w.skin")).expect("what was saved can be read");
    assert!(read.fits(&points, &triangles));
    assert_eq!(read.write(), file.write());
    exported(rig, &points, &triangles, skin);
}

/// Weights over the rig's joints in the order of its walk.
fn reordered(weights: &Weights, rig: &Rig) -> Weights {
    let places: Vec<u32> = {
        let order: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
        let place = |number: u64| order.iter().position(|uid| *uid == Uid(10 + number)).unwrap_or_default() as u32;
        (0..order.len() as u64).map(place).collect()
    };
    let mut out = Weights::default();
    for point in 0..weights.len() {
        out.push(weights.of(point).map(|(joint, value)| (places[joint as usize], value)));
    }
    out
}

/// The character goes through a workbench into a file; it comes back with as many influences.
fn exported(rig: Rig, points: &[Vec3], triangles: &[[u32; 3]], skin: SkinData) {
    let mut bench = Workbench::with_rig(1, rig);
    bench.open(model_of(points, triangles), true).expect("a mesh without a skeleton opens");
    bench.bind(skin).expect("weights over joints of the rig");
    let model = bench.character();
    let disk = MemoryDisk::default();
    let settings = GltfWriteSettings { all_joints: true, max_influences: 8, ..GltfWriteSettings::default() };
    match store_model(&disk, &at("c.glb"), &model, &settings) {
        Ok(_) => {
            let back = load_model(&disk, &at("c.glb")).expect("what was saved can be read");
            promises::model(&back);
            let list = back.weights.as_ref().expect("a skinned mesh");
            assert!((0..list.len()).all(|point| list.of(point).len() > 0), "a vertex without weights");
        }
        Err(error) => {
            assert!(!matches!(error, StoreError::Lost { .. } | StoreError::Unreadable { .. }), "{error}");
            refused(&disk, "c.glb", &error);
        }
    }
}
