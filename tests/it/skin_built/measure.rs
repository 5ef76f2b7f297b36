//! Measures of a bent limb: folds, and the volume around the joint.

use std::collections::{BTreeMap, BTreeSet};

use bevy::math::{Affine3A, Mat3A, Quat, Vec3, Vec3A};
use rigsmith::solve::program::RigState;

use super::figure::{Figure, carry};

/// Share of the way to the front from which on a limb counts as raised: 45 degrees.
const RAISED: f32 = 0.7;

/// The joints that are bent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Joint {
    Knee,
    Elbow,
    Hip,
    Shoulder,
}

impl Joint {
    pub const ALL: [Self; 4] = [Self::Knee, Self::Elbow, Self::Hip, Self::Shoulder];

    /// Labels of the limb's joints, and names of its controls.
    fn limb(self, side: &str) -> ([String; 3], [String; 2]) {
        let names = |joints: [&str; 3], controls: [&str; 2]| {
            (joints.map(|name| format!("{name}{side}")), controls.map(|name| format!("{name}{side}")))
        };
        match self {
            Self::Knee | Self::Hip => names(["thigh", "shin", "foot"], ["foot_ik", "knee"]),
            Self::Elbow | Self::Shoulder => names(["upper_arm", "forearm", "hand"], ["hand_ik", "elbow"]),
        }
    }

    fn is_hinge(self) -> bool {
        matches!(self, Self::Knee | Self::Elbow)
    }

    /// True if the limb of a hip or shoulder is raised to the front at rest: a right angle more would press the limb into
    /// the trunk.
    pub fn is_raised(self, figure: &Figure, side: &str) -> bool {
        let [root, mid, _] = self.limb(side).0.map(|label| figure.at(&label));
        !self.is_hinge() && (mid - root).normalize().z > RAISED
    }

    /// The rig with the joint bent by a right angle through the goal and the pole of its limb: hinges in their plane,
    /// hips and shoulders to the front. A limb that is raised at rest is bent to a right angle with the trunk.
    pub fn bend(self, figure: &Figure, side: &str) -> RigState {
        let (joints, [goal, pole]) = self.limb(side);
        let [root, mid, end] = joints.map(|label| figure.at(&label));
        let mut state = figure.state();
        let [goal, pole] = [goal, pole].map(|name| figure.control(&name));
        let about = |place: Vec3, turn: Quat| {
            Affine3A::from_translation(place) * Affine3A::from_quat(turn) * Affine3A::from_translation(-place)
        };
        if self.is_hinge() {
            let line = (end - root).normalize();
            let to_pole = state.global(pole).unwrap().translation - root;
            let ahead = (to_pole - line * to_pole.dot(line)).normalize();
            let turn = Quat::from_axis_angle((end - mid).cross(-ahead).normalize(), std::f32::consts::FRAC_PI_2);
            carry(&mut state, goal, about(mid, turn));
        } else {
            if self.is_raised(figure, side) {
                return self.swing(figure, side, Vec3::Z);
            }
            let from = (mid - root).normalize();
            return self.swing(figure, side, Vec3::Z - from * from.z);
        }
        state
    }

    /// The rig with the limb of a hip or shoulder turned so that its first bone points in a direction.
    pub fn swing(self, figure: &Figure, side: &str, to: Vec3) -> RigState {
        let (joints, controls) = self.limb(side);
        let [root, mid, _] = joints.map(|label| figure.at(&label));
        let mut state = figure.state();
        let turn = Quat::from_rotation_arc((mid - root).normalize(), to.normalize());
        let about = Affine3A::from_translation(root) * Affine3A::from_quat(turn) * Affine3A::from_translation(-root);
        for name in controls.iter().rev() {
            carry(&mut state, figure.control(name), about);
        }
        state
    }

    /// The angle by which the joint has turned against what it hangs on.
    pub fn angle(self, figure: &Figure, side: &str, bent: &RigState) -> f32 {
        let [root, mid, end] = self.limb(side).0.map(|label| figure.joint(&label));
        let (at, next) = if self.is_hinge() { (mid, end) } else { (root, mid) };
        let above = figure.rig.joint(at).unwrap().parent.unwrap();
        let direction = |state: &RigState| {
            let [above, at, next] = [above, at, next].map(|joint| state.global(joint).unwrap());
            above.rotation.inverse() * (next.translation - at.translation)
        };
        direction(&figure.state()).angle_between(direction(bent))
    }
}

/// Triangles that turn by more than a right angle against the motion of the flesh around them, slivers left out.
pub fn folds(figure: &Figure, bent: &RigState) -> usize {
    let matrices = figure.matrices(bent);
    let posed = figure.posed(bent);
    let normal = |points: &[Vec3], triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|corner| points[corner as usize]);
        ((b - a).cross(c - a), (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared()))
    };
    let is_folded = |triangle: &&[u32; 3]| {
        let (rest, longest) = normal(&figure.model.points, triangle);
        let mut motion = Mat3A::ZERO;
        for corner in **triangle {
            for (joint, weight) in figure.skin.weights.of(corner as usize) {
                motion += matrices[joint as usize].matrix3 * weight;
            }
        }
        let turned = motion.inverse().transpose() * Vec3A::from(rest);
        rest.length() > 1e-3 * longest && Vec3::from(turned).dot(normal(&posed, triangle).0) < 0.0
    };
    figure.triangles.iter().filter(is_folded).count()
}

/// The volume that a pose takes from around a joint, as a share of a section of the limb as long as it is thick.
///
/// Poses bend one joint and leave all else as it is, so what the whole closed mesh loses it loses there.
pub fn loss(figure: &Figure, joint: Joint, side: &str, bent: &RigState) -> f32 {
    let section = volume(&figure.model.points, &section(figure, joint, side));
    let whole = |points: &[Vec3]| volume(points, &figure.triangles);
    (whole(&figure.model.points) - whole(&figure.posed(bent))) / section
}

/// The surface of the limb within its own radius to both sides of a hinge; of the middle of its first bone for hips and
/// shoulders, where the limb has no section of its own.
fn section(figure: &Figure, joint: Joint, side: &str) -> Vec<[u32; 3]> {
    let points = &figure.model.points;
    let [root, mid, end] = joint.limb(side).0.map(|label| figure.at(&label));
    let (above, below) = ((mid - root).normalize(), (end - mid).normalize());
    let (place, across) =
        if joint.is_hinge() { (mid, (above + below).normalize()) } else { ((root + mid) * 0.5, above) };
    let slab = |half: f32| connected(figure, place, &|point| (*point - place).dot(across).abs() < half);
    let first = slab(0.15 * (mid - root).length().min((end - mid).length()));
    let corners: BTreeSet<u32> = first.iter().flatten().copied().collect();
    let far = |corner: &u32| {
        let from = points[*corner as usize] - place;
        let bone = if joint.is_hinge() && from.dot(across) > 0.0 { below } else { above };
        (from - bone * from.dot(bone)).length()
    };
    slab(corners.iter().map(far).sum::<f32>() / corners.len() as f32)
}

/// The triangles with all corners inside that hang together with the one nearest to a place.
fn connected(figure: &Figure, place: Vec3, inside: &dyn Fn(&Vec3) -> bool) -> Vec<[u32; 3]> {
    let points = &figure.model.points;
    let within = |triangle: &&[u32; 3]| triangle.iter().all(|corner| inside(&points[*corner as usize]));
    let all: Vec<[u32; 3]> = figure.triangles.iter().filter(within).copied().collect();
    let mut of: BTreeMap<u32, u32> = all.iter().flatten().map(|corner| (*corner, *corner)).collect();
    fn top(of: &BTreeMap<u32, u32>, mut corner: u32) -> u32 {
        while of[&corner] != corner {
            corner = of[&corner];
        }
        corner
    }
    for [a, b, c] in &all {
        for other in [b, c] {
            let (a, b) = (top(&of, *a), top(&of, *other));
            of.insert(a.max(b), a.min(b));
        }
    }
    let near = |corner: &&u32| (points[**corner as usize].distance(place) * 1e6) as u64;
    let nearest = *of.keys().min_by_key(near).unwrap();
    let wanted = top(&of, nearest);
    all.into_iter().filter(|triangle| top(&of, triangle[0]) == wanted).collect()
}

/// The volume of a patch of surface, closed by a fan over each of its borders.
fn volume(points: &[Vec3], patch: &[[u32; 3]]) -> f32 {
    let at = |corner: u32| points[corner as usize];
    let middle = patch.iter().flatten().map(|corner| at(*corner)).sum::<Vec3>() / (3 * patch.len()) as f32;
    let tetrahedron = |a: Vec3, b: Vec3, c: Vec3| (a - middle).dot((b - middle).cross(c - middle)) / 6.0;
    let mut sum: f32 = patch.iter().map(|[a, b, c]| tetrahedron(at(*a), at(*b), at(*c))).sum();
    let mut border: BTreeSet<(u32, u32)> = BTreeSet::new();
    for [a, b, c] in patch {
        for (from, to) in [(*a, *b), (*b, *c), (*c, *a)] {
            if !border.remove(&(to, from)) {
                border.insert((from, to));
            }
        }
    }
    while let Some(first) = border.first().copied() {
        // The whole border that hangs together with this edge.
        let mut ring = vec![first];
        border.remove(&first);
        let mut next = 0;
        while next < ring.len() {
            let to = ring[next].1;
            next += 1;
            let found: Vec<(u32, u32)> = border.range((to, 0)..=(to, u32::MAX)).copied().collect();
            for edge in found {
                border.remove(&edge);
                ring.push(edge);
            }
        }
        let centre = ring.iter().map(|(from, _)| at(*from)).sum::<Vec3>() / ring.len() as f32;
        sum += ring.iter().map(|(from, to)| tetrahedron(at(*to), at(*from), centre)).sum::<f32>();
    }
    sum
}
