//! Flesh around a joint that bends, and the motion of that flesh.

use glam::{Affine3A, Mat3A, Quat, Vec3, Vec3A};

use super::{Bend, Flesh, REACH, triangle_tree::TriangleTree};

/// Triangles with less area than this share of their longest edge squared are slivers, whose direction means nothing.
const SLIVER: f32 = 1e-3;
/// Edges from places whose shares a bend changes to the furthest place that smoothing and mending reach.
const RINGS: usize = 8;

/// Motions of the flesh in a bend about the joint; flesh above it stays.
pub(super) struct Pose {
    lower: Affine3A,
    half: Affine3A,
}

impl Pose {
    pub fn new(bend: &Bend, axis: Vec3, angle: f32, push: f32) -> Self {
        let length = push * bend.below.length();
        let turn = Quat::from_axis_angle(axis, angle);
        let share = Quat::from_axis_angle(axis, angle * bend.share);
        let on = bend.above * length;
        let back = bend.below.normalize_or_zero() * -length;
        let (rest, posed) = (on.lerp(back, bend.share), on.lerp(turn * back, bend.share));
        let half = Affine3A::from_rotation_translation(share, posed) * Affine3A::from_translation(-rest);
        Self { lower: Affine3A::from_quat(turn), half }
    }
}

/// Marks of places of the mesh, which many searches share.
pub(super) struct Marks {
    number: u32,
    /// Number of the last search that reached each place.
    of_place: Vec<u32>,
}

impl Marks {
    /// No mark on any of so many places.
    pub fn new(places: usize) -> Self {
        Self { number: 0, of_place: vec![0; places] }
    }

    fn has(&self, place: u32) -> bool {
        self.of_place[place as usize] == self.number
    }

    /// Marks places and those around them, and returns all of them.
    fn spread(&mut self, flesh: &Flesh, places: impl Iterator<Item = u32>) -> Vec<u32> {
        self.number += 1;
        let Self { number, of_place } = self;
        let mut is_first = |place: &u32| std::mem::replace(&mut of_place[*place as usize], *number) != *number;
        let mut reached: Vec<u32> = places.filter(&mut is_first).collect();
        let mut from = 0;
        for _ in 0..RINGS {
            let end = reached.len();
            for at in from..end {
                let around = &flesh.neighbours[reached[at] as usize];
                reached.extend(around.iter().copied().filter(&mut is_first));
            }
            from = end;
        }
        reached
    }
}

/// Triangles that a bend concerns, with the shares of the bending and of the half joint at their corners.
#[derive(Clone)]
pub(super) struct Part {
    /// Places at the corners of the triangles, rising.
    pub places: Vec<u32>,
    /// Places from the joint.
    points: Vec<Vec3>,
    /// Triangles as indices into `places`.
    pub triangles: Vec<[u32; 3]>,
    /// Shares of each place.
    pub shares: Vec<[f32; 2]>,
    /// Joint that bends.
    joint: usize,
    pub half: u32,
    /// True for a joint between two bones of about the same length.
    pub is_hinge: bool,
}

impl Part {
    pub fn new(flesh: &Flesh, tree: &TriangleTree, marks: &mut Marks, bend: &Bend) -> Self {
        let joints = flesh.joints;
        let at = joints[bend.joint].head;
        let above = joints[bend.joint].parent.map_or(0.0, |parent| joints[parent].head.distance(at));
        let reach = REACH * bend.below.length().max(above);
        let is_near = |corners: &[u32; 3]| flesh.points[corners[0] as usize].distance(at) < reach;
        let found = tree.beginning(at, reach).into_iter().map(|number| flesh.triangles[number]);
        let mut triangles: Vec<[u32; 3]> = found.filter(is_near).collect();
        let (half, is_hinge) = (bend.half as u32, bend.section == 0.0);
        // What does not move, and what moves as one, cannot fold and keeps its volume. Smoothing reaches a little further.
        let is_still = |[lower, half]: [f32; 2]| half == 0.0 && (lower == 0.0 || lower > 0.999);
        let around = marks.spread(flesh, triangles.iter().flatten().copied());
        let turning = around.iter().copied().filter(|place| !is_still(flesh.shares(bend.joint, half, *place)));
        let near = marks.spread(flesh, turning);
        flesh.count(triangles.len() + around.len() + near.len());
        triangles.retain(|corners| corners.iter().any(|corner| marks.has(*corner)));
        let mut places: Vec<u32> = triangles.iter().flatten().copied().collect();
        places.sort_unstable();
        places.dedup();
        for corner in triangles.iter_mut().flatten() {
            let place = *corner;
            *corner = places.partition_point(|other| *other < place) as u32;
        }
        let points = places.iter().map(|place| flesh.points[*place as usize] - at).collect();
        let shares = vec![[0.0; 2]; places.len()];
        let mut part = Self { places, points, triangles, shares, joint: bend.joint, half, is_hinge };
        part.read(flesh);
        part
    }

    /// Takes up the weights of its places.
    pub fn read(&mut self, flesh: &Flesh) {
        for (place, shares) in self.places.iter().zip(&mut self.shares) {
            *shares = flesh.shares(self.joint, self.half, *place);
        }
    }

    /// True if a joint is below the bend.
    pub fn is_lower(&self, flesh: &Flesh, joint: u32) -> bool {
        joint != self.half && flesh.hierarchy.has(self.joint, joint as usize)
    }

    /// Corners of a triangle from the joint, at rest and posed, and the mean motion of the flesh there.
    pub fn corners(&self, pose: &Pose, corners: &[u32; 3]) -> ([Vec3; 3], [Vec3; 3], Mat3A) {
        let mut motion = Mat3A::ZERO;
        let rest = corners.map(|corner| self.points[corner as usize]);
        let mut posed = rest;
        for (corner, point) in corners.iter().zip(&mut posed) {
            let [lower, half] = self.shares[*corner as usize];
            let still = 1.0 - lower - half;
            motion += Mat3A::IDENTITY * still + pose.lower.matrix3 * lower + pose.half.matrix3 * half;
            *point = *point * still
                + pose.lower.transform_point3(*point) * lower
                + pose.half.transform_point3(*point) * half;
        }
        (rest, posed, motion)
    }

    /// Area of a triangle in a pose, seen in the direction in which the flesh around it turns its normal, as a share of the area
    /// at rest; below zero where it folds. `None` for slivers.
    pub fn openness(&self, pose: &Pose, corners: &[u32; 3]) -> Option<f32> {
        let normal = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a);
        let (rest, posed, motion) = self.corners(pose, corners);
        let [a, b, c] = rest;
        let longest = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
        let before = normal(rest);
        if before.length() <= SLIVER * longest {
            return None;
        }
        let turned = motion.inverse().transpose() * Vec3A::from(before);
        Some(Vec3::from(turned).normalize_or_zero().dot(normal(posed)) / before.length())
    }

    /// Volume that the bend takes. Motions are about the joint, so what moves as one keeps its share of the volume, and
    /// holes of the mesh do not matter.
    pub fn lost(&self, pose: &Pose) -> f32 {
        let volume = |[a, b, c]: [Vec3; 3]| f64::from(a.dot(b.cross(c))) / 6.0;
        let lost = |corners: &[u32; 3]| {
            let (rest, posed, _) = self.corners(pose, corners);
            volume(rest) - volume(posed)
        };
        self.triangles.iter().map(lost).sum::<f64>() as f32
    }
}
