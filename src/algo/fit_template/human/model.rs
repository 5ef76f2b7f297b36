//! Model of the human figure: bones, surface points with weights, and how bodies vary, unpacked from its constants.

use glam::Vec3;

use super::{
    shape::{BONES, JOINTS},
    surface_points::POINTS,
};

/// Number of bones.
pub(in super::super) const BONE_COUNT: usize = BONES.len();
/// Components of the variation of bodies.
pub(super) const COMPONENTS: usize = 4;
/// Groups of bones that share a length and a girth.
pub(super) const GROUPS: usize = 13;

/// A surface point of the model.
#[derive(Debug, Clone, Copy)]
pub(super) struct ModelPoint {
    pub(super) mean: Vec3,
    pub(super) normal: Vec3,
    pub(super) components: [Vec3; COMPONENTS],
    pub(super) bones: [usize; 3],
    pub(super) weights: [f32; 3],
    /// Share in the distance between surfaces.
    pub(super) importance: f32,
}

/// A bone of the model.
#[derive(Debug, Clone)]
pub(super) struct ModelBone {
    pub(super) name: &'static str,
    pub(super) parent: Option<usize>,
    pub(super) mean: Vec3,
    pub(super) components: [Vec3; COMPONENTS],
    /// Direction of the bone at rest.
    pub(super) axis: Vec3,
    pub(super) group: usize,
    /// Bits of the bone itself and all bones above it.
    pub(super) above: u64,
    pub(super) mirror: usize,
}

/// The whole model.
#[derive(Debug, Clone)]
pub(in super::super) struct HumanModel {
    pub(super) bones: Vec<ModelBone>,
    pub(super) points: Vec<ModelPoint>,
}

/// Index of the bone of a name.
pub(in super::super) fn bone(name: &str) -> usize {
    BONES.iter().position(|b| b.0 == name).unwrap_or(0)
}

/// Name of a bone.
pub(super) fn bone_name(bone: usize) -> &'static str {
    BONES[bone].0
}

fn mirrored_name(name: &str) -> String {
    match (name.strip_suffix("_l"), name.strip_suffix("_r")) {
        (Some(stem), _) => format!("{stem}_r"),
        (_, Some(stem)) => format!("{stem}_l"),
        _ => name.to_owned(),
    }
}

fn group(name: &str) -> usize {
    const STARTS: [(&str, usize); 12] = [
        ("pelvis", 0),
        ("spine", 1),
        ("neck", 2),
        ("head", 3),
        ("clavicle", 4),
        ("upperarm", 5),
        ("lowerarm", 6),
        ("hand", 7),
        ("thigh", 9),
        ("calf", 10),
        ("foot", 11),
        ("ball", 12),
    ];
    STARTS.iter().find(|s| name.starts_with(s.0)).map_or(8, |s| s.1)
}

fn vector(row: &[i16], unit: f32) -> Vec3 {
    Vec3::new(f32::from(row[0]), f32::from(row[1]), f32::from(row[2])) * unit
}

fn components(row: &[i16]) -> [Vec3; COMPONENTS] {
    std::array::from_fn(|k| vector(&row[3 * k..], 2e-5))
}

impl HumanModel {
    /// Unpacks the model.
    pub(in super::super) fn new() -> Self {
        let mut bones: Vec<ModelBone> = BONES
            .iter()
            .zip(&JOINTS)
            .enumerate()
            .map(|(i, (&(name, parent), row))| ModelBone {
                name,
                parent: (i > 0).then_some(parent),
                mean: vector(row, 1e-4),
                components: components(&row[3..]),
                axis: Vec3::ZERO,
                group: group(name),
                above: 1 << i,
                mirror: bone(&mirrored_name(name)),
            })
            .collect();
        for i in 1..bones.len() {
            let parent = bones[i].parent.unwrap_or(0);
            bones[i].above |= bones[parent].above;
        }
        for i in 0..bones.len() {
            // The child that goes on: the middle finger of a hand, the neck of a chest, else the first one.
            let children = (0..bones.len()).filter(|&c| bones[c].parent == Some(i));
            let along = children.max_by_key(|&c| {
                let name = bones[c].name;
                (
                    name.starts_with("middle") || name.starts_with("neck") || name.starts_with("spine"),
                    std::cmp::Reverse(c),
                )
            });
            let axis = match along {
                Some(child) => bones[child].mean - bones[i].mean,
                None => bones[i].mean - bones[bones[i].parent.unwrap_or(0)].mean,
            };
            bones[i].axis = if bones[i].name == "head" { Vec3::Y } else { axis.normalize_or_zero() };
        }
        let mut points = Vec::with_capacity(2 * POINTS.len());
        for row in &POINTS {
            let bone_at = |k: usize| row[18 + k] as usize;
            let sum: f32 = (0..3).map(|k| f32::from(row[21 + k])).sum();
            let point = ModelPoint {
                mean: vector(row, 1e-4),
                normal: vector(&row[3..], 0.01).normalize_or_zero(),
                components: components(&row[6..]),
                bones: std::array::from_fn(bone_at),
                weights: std::array::from_fn(|k| f32::from(row[21 + k]) / sum.max(1.0)),
                importance: match bones[bone_at(0)].group {
                    8 => 0.25,
                    7 => 0.4,
                    11 | 12 => 0.6,
                    _ => 1.0,
                },
            };
            points.push(point);
            if row[0].abs() > 10 {
                let flip = |v: Vec3| Vec3::new(-v.x, v.y, v.z);
                points.push(ModelPoint {
                    mean: flip(point.mean),
                    normal: flip(point.normal),
                    components: point.components.map(flip),
                    bones: point.bones.map(|b| bones[b].mirror),
                    ..point
                });
            }
        }
        Self { bones, points }
    }

    /// The surface point furthest along a direction among those of bones whose name begins with `start`.
    pub(super) fn extreme(&self, start: &str, side: &str, direction: Vec3) -> usize {
        let fits = |p: &ModelPoint| {
            let name = self.bones[p.bones[0]].name;
            name.starts_with(start) && name.ends_with(side)
        };
        let candidates = (0..self.points.len()).filter(|&i| fits(&self.points[i]));
        candidates
            .reduce(|a, b| if self.points[b].mean.dot(direction) > self.points[a].mean.dot(direction) { b } else { a })
            .unwrap_or(0)
    }
}
