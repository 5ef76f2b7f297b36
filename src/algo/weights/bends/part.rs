//! Flesh around a joint that bends, and the motion of that flesh.

use glam::{Affine3A, Mat3A, Quat, Vec3, Vec3A};

use super::{Bend, Flesh, REACH};

/// Triangles with less area than this share of their longest edge squared are slivers, whose direction means nothing.
const SLIVER: f32 = 1e-3;

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

/// Triangles that a bend concerns, with the shares of the bending and of the half joint at their corners.
#[derive(Clone)]
pub(super) struct Part {
    at: Vec3,
    pub triangles: Vec<[u32; 3]>,
    /// Shares of every place of the mesh.
    pub shares: Vec<[f32; 2]>,
    /// Side of each joint: true below the bend.
    pub lower: Vec<bool>,
    pub half: u32,
    /// True for a joint between two bones of about the same length.
    pub is_hinge: bool,
}

impl Part {
    pub fn new(flesh: &Flesh, bend: &Bend) -> Self {
        let joints = flesh.joints;
        let mut lower = vec![false; joints.len()];
        // Parents need not come before their children.
        for (joint, below) in lower.iter_mut().enumerate() {
            let mut chain = std::iter::successors(Some(joint), |joint| joints[*joint].parent).take(joints.len());
            *below = chain.any(|above| above == bend.joint);
        }
        lower[bend.half] = false;
        let at = joints[bend.joint].head;
        let above = joints[bend.joint].parent.map_or(0.0, |parent| joints[parent].head.distance(at));
        let reach = REACH * bend.below.length().max(above);
        let is_near = |corners: &&[u32; 3]| flesh.points[corners[0] as usize].distance(at) < reach;
        let triangles = flesh.triangles.iter().filter(is_near).copied().collect();
        let (half, is_hinge) = (bend.half as u32, bend.section == 0.0);
        let mut part = Self { at, triangles, shares: vec![[0.0; 2]; flesh.rows.len()], lower, half, is_hinge };
        let all: Vec<u32> = (0..flesh.rows.len() as u32).collect();
        part.read(flesh, &all);
        // What does not move, and what moves as one, cannot fold and keeps its volume. Smoothing reaches a little further.
        let is_still = |[lower, half]: [f32; 2]| half == 0.0 && (lower == 0.0 || lower > 0.999);
        let still: Vec<bool> = part.shares.iter().map(|shares| is_still(*shares)).collect();
        let mut near = still.iter().map(|still| !still).collect::<Vec<bool>>();
        for _ in 0..8 {
            let wider: Vec<usize> = (0..near.len()).filter(|place| near[*place]).collect();
            for place in wider {
                flesh.neighbours[place].iter().for_each(|other| near[*other as usize] = true);
            }
        }
        part.triangles.retain(|corners| corners.iter().any(|corner| near[*corner as usize]));
        part
    }

    /// Takes up the weights of some places.
    pub fn read(&mut self, flesh: &Flesh, places: &[u32]) {
        for &place in places {
            let mut shares = [0.0; 2];
            for (joint, weight) in &flesh.rows[place as usize] {
                if *joint == self.half {
                    shares[1] += weight;
                } else if self.lower[*joint as usize] {
                    shares[0] += weight;
                }
            }
            self.shares[place as usize] = shares;
        }
    }

    /// Corners of a triangle from the joint, at rest and posed, and the mean motion of the flesh there.
    pub fn corners(&self, flesh: &Flesh, pose: &Pose, corners: &[u32; 3]) -> ([Vec3; 3], [Vec3; 3], Mat3A) {
        let mut motion = Mat3A::ZERO;
        let rest = corners.map(|corner| flesh.points[corner as usize] - self.at);
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
    pub fn openness(&self, flesh: &Flesh, pose: &Pose, corners: &[u32; 3]) -> Option<f32> {
        let normal = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a);
        let (rest, posed, motion) = self.corners(flesh, pose, corners);
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
    pub fn lost(&self, flesh: &Flesh, pose: &Pose) -> f32 {
        let volume = |[a, b, c]: [Vec3; 3]| f64::from(a.dot(b.cross(c))) / 6.0;
        let lost = |corners: &[u32; 3]| {
            let (rest, posed, _) = self.corners(flesh, pose, corners);
            volume(rest) - volume(posed)
        };
        self.triangles.iter().map(lost).sum::<f64>() as f32
    }
}
