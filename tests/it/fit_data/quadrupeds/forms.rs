//! Forms of animals on all fours: maps of a fox's points and of its true joints, as smooth as its skin.

use bevy::math::{Quat, Vec3, ops};

/// Change of a form. Angles are in degrees, sizes are factors.
#[derive(Debug, Clone, Copy)]
pub enum Change {
    /// Length of the legs below the belly.
    Legs(f32),
    /// Neck: angle upwards, and length.
    Neck(f32, f32),
    /// Angle of the head to the neck, upwards.
    Nod(f32),
    /// Size of the head.
    Head(f32),
    /// Tail: angle upwards at its root, angle over its length, length, and thickness.
    Tail(f32, f32, f32, f32),
    /// Width of all of the animal.
    Width(f32),
    /// Length of the trunk between the legs.
    Length(f32),
    /// Depth of the belly.
    Belly(f32),
    /// Rise of the back between the legs, as a share of the height of the hips.
    Arch(f32),
    /// Angles forward of the left and right forelegs and the left and right hind legs.
    Stride([f32; 4]),
    /// Angle by which the right foreleg is bent, with its foot off the ground.
    Lift(f32),
    /// Fold of the legs at elbows, knees and hocks, as a share of the height of the hips.
    Crouch(f32),
    /// Size of the feet.
    Feet(f32),
}

/// Points and true joints of an animal in a form: up is +Y, the front is +Z.
#[derive(Debug, Clone)]
pub struct Form {
    pub points: Vec<Vec3>,
    pub truth: Vec<(String, Vec3)>,
}

fn smooth(from: f32, to: f32, at: f32) -> f32 {
    let share = ((at - from) / (to - from)).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}

/// Turn about the axis to the left by which what leads forward rises.
fn rise(degrees: f32) -> Quat {
    Quat::from_rotation_x(-degrees.to_radians())
}

impl Form {
    /// Applies changes in their order, each to the form that the ones before it left.
    pub fn changed(mut self, changes: &[Change]) -> Self {
        for change in changes {
            let map = self.map(*change);
            let points = self.points.iter().map(|point| map(*point)).collect();
            let truth = self.truth.iter().map(|(label, place)| (label.clone(), map(*place))).collect();
            self = Self { points, truth };
        }
        self
    }

    fn joint(&self, label: &str) -> Vec3 {
        self.truth.iter().find(|(known, _)| known == label).map(|(_, place)| *place).unwrap()
    }

    fn map(&self, change: Change) -> Box<dyn Fn(Vec3) -> Vec3> {
        let ground = self.points.iter().map(|point| point.y).fold(f32::INFINITY, f32::min);
        let [hips, chest, neck, head, shoulder, hip] =
            ["hips", "chest", "neck", "head", "upper_arm_l", "thigh_l"].map(|label| self.joint(label));
        let belly = ground + 0.85 * (shoulder.y - ground);
        let between = move |z: f32| {
            let share = ((z - hip.z) / (shoulder.z - hip.z)).clamp(0.0, 1.0);
            ops::sin(share * std::f32::consts::PI).powi(2)
        };
        let way = head - neck;
        let along_neck = move |place: Vec3| (place - neck).dot(way) / way.length_squared();
        let legs = ["l", "r"].map(|side| {
            let front = ["upper_arm", "forearm", "carpus", "paw"];
            let hind = ["thigh", "shin", "metatarsus", "foot"];
            [front, hind].map(|leg| leg.map(|joint| self.joint(&format!("{joint}_{side}"))))
        });
        let middle = 0.5 * (shoulder.z + hip.z);
        let leg_of = move |place: Vec3| legs[usize::from(place.x < 0.0)][usize::from(place.z < middle)];
        // Nothing between the legs belongs to one of them.
        let of_leg = move |place: Vec3| smooth(0.0, 0.2 * (shoulder.z - hip.z), (place.z - middle).abs());
        match change {
            Change::Legs(size) => {
                Box::new(move |p| Vec3::new(p.x, p.y + (size - 1.0) * (p.y.min(belly) - ground), p.z))
            }
            Change::Neck(angle, length) => Box::new(move |p| {
                let along = along_neck(p);
                let longer = p + way * ((length - 1.0) * along.clamp(0.0, 1.0));
                neck + rise(angle * smooth(-0.1, 0.9, along)) * (longer - neck)
            }),
            Change::Nod(angle) => {
                Box::new(move |p| head + rise(angle * smooth(0.75, 1.25, along_neck(p))) * (p - head))
            }
            Change::Head(size) => {
                Box::new(move |p| head + (p - head) * (1.0 + (size - 1.0) * smooth(0.7, 1.2, along_neck(p))))
            }
            Change::Tail(angle, bend, length, thickness) => {
                let (root, end) = (self.joint("tail_1"), self.joint("tail_6"));
                let way = end - root;
                Box::new(move |p| {
                    let along = (p - root).dot(way) / way.length_squared();
                    let aside = (p - root - way * along) * (1.0 + (thickness - 1.0) * smooth(0.0, 0.25, along));
                    let inner = along.clamp(0.0, 1.0);
                    let p = aside + way * (along + (length - 1.0) * inner);
                    let arc = -bend.to_radians() * inner;
                    let along = p.dot(way) / way.length_squared();
                    let ahead = way * along.clamp(0.0, length);
                    let curved = match arc.abs() < 1e-4 {
                        true => ahead,
                        false => {
                            let across = Vec3::X.cross(ahead);
                            (ahead * ops::sin(arc) - across * (1.0 - ops::cos(arc))) / arc
                        }
                    };
                    let bent = curved + rise(-bend * inner) * (p - ahead);
                    root + rise(-angle * smooth(0.0, 0.3, inner)) * bent
                })
            }
            Change::Width(size) => Box::new(move |p| Vec3::new(size * p.x, p.y, p.z)),
            Change::Length(size) => {
                let (low, high) = (hip.z + 0.2 * (shoulder.z - hip.z), hip.z + 0.8 * (shoulder.z - hip.z));
                Box::new(move |p| p + Vec3::Z * ((size - 1.0) / 0.6 * (p.z.clamp(low, high) - low)))
            }
            Change::Belly(size) => {
                let spine = 0.5 * (hips.y + chest.y);
                Box::new(move |p| p + Vec3::Y * ((size - 1.0) * between(p.z) * (p.y - spine).min(0.0)))
            }
            Change::Arch(share) => Box::new(move |p| p + Vec3::Y * (share * (hips.y - ground) * between(p.z))),
            Change::Stride(angles) => Box::new(move |p| {
                let leg = leg_of(p);
                let angle = angles[2 * usize::from(p.z < middle) + usize::from(p.x < 0.0)];
                let share = smooth(0.0, 0.5, (belly - p.y) / (belly - ground)) * of_leg(p);
                leg[0] + rise(angle * share) * (p - leg[0])
            }),
            Change::Lift(angle) => Box::new(move |p| {
                if p.x >= 0.0 || p.z < middle {
                    return p;
                }
                let [_, elbow, wrist, _] = leg_of(p);
                let soft = 0.15 * (elbow.y - ground);
                let below = |joint: Vec3| smooth(-soft, soft, joint.y - p.y);
                let bent = wrist + rise(-1.6 * angle * below(wrist)) * (p - wrist);
                elbow + rise(angle * below(elbow)) * (bent - elbow)
            }),
            Change::Crouch(share) => Box::new(move |p| {
                let leg = leg_of(p);
                let folds = if p.z < middle { [0.0, 1.0, -1.0, 0.0] } else { [0.0, -0.8, 0.3, 0.0] };
                let mut fold = 0.0;
                for (joints, folds) in leg.windows(2).zip(folds.windows(2)) {
                    if p.y <= joints[0].y && p.y > joints[1].y {
                        let share = (joints[0].y - p.y) / (joints[0].y - joints[1].y);
                        fold = folds[0] + (folds[1] - folds[0]) * share;
                    }
                }
                p + Vec3::Z * (share * (hips.y - ground) * fold * of_leg(p))
            }),
            Change::Feet(size) => Box::new(move |p| {
                let foot = leg_of(p)[3];
                let share = smooth(0.22, 0.1, (p.y - ground) / (belly - ground));
                let larger = 1.0 + (size - 1.0) * share;
                Vec3::new(foot.x + (p.x - foot.x) * larger, p.y, foot.z + (p.z - foot.z) * larger)
            }),
        }
    }
}

/// Form of an animal on all fours: name, changes, and the number of triangles that are left, if fewer.
pub type NamedForm = (&'static str, &'static [Change], Option<usize>);

/// Forms on which rules were chosen.
pub const KNOWN: [NamedForm; 15] = [
    ("long legs", &[Change::Legs(1.5)], None),
    ("grazing", &[Change::Nod(20.0), Change::Neck(-75.0, 1.2)], None),
    ("big head", &[Change::Head(1.6)], None),
    ("wide", &[Change::Width(1.5), Change::Belly(1.15)], None),
    ("tail up", &[Change::Tail(60.0, 70.0, 0.8, 1.0)], None),
    ("short tail", &[Change::Tail(0.0, 0.0, 0.25, 0.8)], None),
    (
        "giraffe",
        &[Change::Legs(1.5), Change::Tail(-60.0, 0.0, 0.6, 0.6), Change::Nod(-30.0), Change::Neck(25.0, 2.2)],
        None,
    ),
    (
        "lizard",
        &[Change::Legs(0.6), Change::Length(1.3), Change::Tail(0.0, 0.0, 1.3, 1.7), Change::Neck(-20.0, 1.0)],
        None,
    ),
    ("walk", &[Change::Stride([20.0, -14.0, -14.0, 18.0])], None),
    ("hanging tail", &[Change::Tail(-60.0, -20.0, 0.9, 0.7)], None),
    ("stalk", &[Change::Crouch(0.09), Change::Legs(0.85), Change::Neck(-35.0, 1.1)], None),
    (
        "bear",
        &[
            Change::Legs(0.8),
            Change::Feet(1.5),
            Change::Width(1.3),
            Change::Belly(1.25),
            Change::Tail(-30.0, 0.0, 0.2, 0.8),
            Change::Head(1.2),
        ],
        None,
    ),
    (
        "calf",
        &[Change::Width(0.8), Change::Legs(1.6), Change::Head(1.3), Change::Tail(-80.0, 0.0, 0.5, 0.5)],
        Some(1000),
    ),
    ("dachshund", &[Change::Legs(0.4), Change::Length(1.8)], None),
    (
        "dinosaur",
        &[
            Change::Tail(5.0, 0.0, 1.4, 2.2),
            Change::Belly(1.2),
            Change::Head(0.7),
            Change::Nod(-20.0),
            Change::Neck(30.0, 1.7),
        ],
        None,
    ),
];

/// Forms that are measured only.
pub const UNSEEN: [NamedForm; 10] = [
    ("short legs", &[Change::Legs(0.6)], None),
    ("raised neck", &[Change::Nod(-15.0), Change::Neck(25.0, 1.5)], None),
    ("narrow", &[Change::Width(0.65)], None),
    ("tail down", &[Change::Tail(-75.0, -35.0, 0.7, 0.8)], None),
    ("crouch", &[Change::Crouch(0.13), Change::Legs(0.75)], None),
    ("arched back", &[Change::Arch(0.2)], None),
    ("large feet", &[Change::Feet(1.7)], None),
    (
        "horse",
        &[
            Change::Legs(1.4),
            Change::Feet(0.8),
            Change::Tail(-70.0, 0.0, 0.6, 0.9),
            Change::Belly(1.15),
            Change::Nod(-30.0),
            Change::Neck(20.0, 1.6),
        ],
        None,
    ),
    (
        "sauropod",
        &[
            Change::Width(1.2),
            Change::Feet(1.3),
            Change::Tail(-8.0, 10.0, 1.25, 1.9),
            Change::Belly(1.2),
            Change::Head(0.65),
            Change::Neck(5.0, 2.0),
        ],
        None,
    ),
    ("step", &[Change::Stride([-10.0, 20.0, 20.0, -15.0]), Change::Lift(45.0)], Some(900)),
];
