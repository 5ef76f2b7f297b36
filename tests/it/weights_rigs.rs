//! Automatic weights on bodies with skeletons that no weights are painted for: what must hold whatever a painter would choose.

use std::path::Path;

use glam::Vec3;
use rigsmith::mesh::model::Weights;
use serde_json::Value;

use crate::{
    prerequisites::{BODIES, test_data},
    weights_bodies::Body,
};

/// A body bound to a rig, with the bones as the data has them.
struct Bound {
    body: Body,
    weights: Weights,
    /// Head and tail of the bone of each joint.
    bones: Vec<[Vec3; 2]>,
}

impl Bound {
    fn new(bodies: &Path, name: &str, rig: &str) -> Self {
        let body = Body::unpainted(bodies, name, rig, None);
        let (weights, report) = body.bound();
        assert_eq!(report.by_surface, body.points.len(), "{name} with {rig}");
        for point in 0..body.points.len() {
            let sum: f32 = weights.of(point).map(|(_, weight)| weight).sum();
            assert!((sum - 1.0).abs() < 1e-4, "{name} with {rig}: the weights of point {point} sum to {sum}");
        }
        let text = std::fs::read_to_string(bodies.join(name).join("joints.json")).unwrap();
        let data: Value = serde_json::from_str(&text).unwrap();
        let end = |joint: &String, end: &str| {
            Vec3::from_array(std::array::from_fn(|axis| data[rig][joint][end][axis].as_f64().unwrap() as f32))
        };
        let bones = body.names.iter().map(|joint| [end(joint, "head"), end(joint, "tail")]).collect();
        Self { body, weights, bones }
    }

    fn joint(&self, name: &str) -> usize {
        self.body.names.iter().position(|joint| joint == name).unwrap()
    }

    /// The sum of the weights of some joints at a point.
    fn share(&self, point: usize, joints: &[usize]) -> f32 {
        self.weights.of(point).filter(|(joint, _)| joints.contains(&(*joint as usize))).map(|(_, weight)| weight).sum()
    }

    /// The mean share of some joints in points, and the share of the points that are theirs by 0.95.
    fn held(&self, joints: &[usize], is_in: impl Fn(usize, Vec3) -> bool) -> (f32, f32) {
        let points = self.body.points.iter().enumerate().filter(|(index, point)| is_in(*index, **point));
        let shares: Vec<f32> = points.map(|(index, _)| self.share(index, joints)).collect();
        assert!(shares.len() > 10, "{} points", shares.len());
        let count = shares.len() as f32;
        (shares.iter().sum::<f32>() / count, shares.iter().filter(|share| **share >= 0.95).count() as f32 / count)
    }

    /// The mean share of a joint in the middle of its bone, of the points that are nearest to this bone.
    fn held_in_the_middle(&self, name: &str) -> f32 {
        let joint = self.joint(name);
        let along = |[head, tail]: [Vec3; 2], point: Vec3| {
            let way = tail - head;
            ((point - head).dot(way) / way.length_squared()).clamp(0.0, 1.0)
        };
        let distance = |bone: [Vec3; 2], point: Vec3| point.distance(bone[0].lerp(bone[1], along(bone, point)));
        let is_middle = |_: usize, point: Vec3| {
            let own = distance(self.bones[joint], point);
            (0.3..0.7).contains(&along(self.bones[joint], point))
                && self.bones.iter().all(|bone| distance(*bone, point) >= own)
        };
        self.held(&[joint], is_middle).0
    }
}

/// The neck of a rig of key points ends at the nose, and its head has joints in eyes and ears only: the face is theirs.
#[test]
fn faces_of_key_points_belong_to_eyes_and_ears() {
    let Some(data) = test_data() else { return };
    for name in BODIES {
        let bound = Bound::new(&data.join("bodies"), name, "openpose");
        let face = ["LEye", "REye", "LEar", "REar"].map(|joint| bound.joint(joint));
        let (neck, nose) = (bound.bones[bound.joint("Neck")][0], bound.bones[face[0]][0]);
        // Beside the length of the neck's bone: from the chin to the crown, and not the sides.
        let beside = |point: Vec3| (point - nose) / nose.distance(neck);
        let is_face = |_: usize, point: Vec3| {
            let place = beside(point);
            place.y > -0.23 && place.z > -0.35 && place.x.abs() < 0.3
        };
        let (mean, whole) = bound.held(&face, is_face);
        let (skull, _) = bound.held(&face, |_, point| beside(point).y > 0.0);
        println!("{name}: face {mean:.4}, {whole:.4} of it by 0.95, above the nose {skull:.4}");
        assert!(mean > 0.99 && whole > 0.98, "{name}: {mean} of the face, {whole} of it by 0.95");
        assert!(skull > 0.93, "{name}: {skull} of what lies above the nose");
        hold_limbs(&bound, name, [["LWrist", "RWrist"], ["LKnee", "RKnee"], ["LAnkle", "RAnkle"]]);
    }
}

/// A rig with two joints in the neck and none behind the head.
#[test]
fn crowns_belong_to_heads_and_limbs_to_their_bones() {
    let Some(data) = test_data() else { return };
    for name in BODIES {
        let bound = Bound::new(&data.join("bodies"), name, "cmu_mb");
        let head = bound.joint("Head");
        let [from, to] = bound.bones[head];
        let is_crown = |_: usize, point: Vec3| {
            let way = to - from;
            (point - from).dot(way) > 0.5 * way.length_squared() && point.distance(from) < 1.6 * way.length()
        };
        let (mean, whole) = bound.held(&[head], is_crown);
        println!("{name}: crown {mean:.4}, {whole:.4} of it by 0.95");
        // The head's joint of the baby lies in the middle of the skull, and the neck's reach to there.
        let least = if name == "baby" { 0.73 } else { 0.98 };
        assert!(mean > least, "{name}: {mean} of the crown");
        let limbs = [["LeftForeArm", "RightForeArm"], ["LeftUpLeg", "RightUpLeg"], ["LeftLeg", "RightLeg"]];
        hold_limbs(&bound, name, limbs);
    }
}

/// Forearms, thighs and shins are their own bones'. Beside arms that hang down the hands are as near to the thighs.
fn hold_limbs(bound: &Bound, name: &str, limbs: [[&str; 2]; 3]) {
    for (sides, least) in limbs.into_iter().zip([0.98, 0.94, 0.98]) {
        for bone in sides {
            let held = bound.held_in_the_middle(bone);
            println!("{name}: {held:.3} of the middle of {bone}");
            let hangs = name == "female_young_armsdown" && sides != limbs[2];
            assert!(held > least || hangs, "{name}: {held} of the middle of {bone}");
        }
    }
}
