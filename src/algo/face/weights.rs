//! Weights of a face: skin bones, jaw and eyes, head and neck.
//!
//! Each point of the facial mask begins with its nearest bone, and heat spreads these patches along the surface until
//! neighbours overlap (two implicit steps, as wide as the bones are apart). Upper and lower lips and lids are separated
//! along the surface, so that no bone of one moves the other. Heat from outside the mask belongs to the head bone.

mod facial_hair;
mod interior;
mod rigid;
mod sides;
mod skin;
mod skin_columns;
mod symmetry;
mod tooth_rows;

use glam::Vec3;

use super::{
    bones::{FaceBone, FaceBoneKind, Side, extent, map::FaceMap},
    grouping::HeadGroups,
    landmarks::Landmarks,
    shells::{ShellKind, Shells},
};
use crate::{
    algo::weights::laplacian::Graph,
    mesh::{adjacency::weld, influences::keep_strongest_softly, model::Weights},
};

pub(crate) use symmetry::Mirror;

/// Joint of the neck bone.
pub const NECK: u32 = 0;
/// Joint of the head bone.
pub const HEAD: u32 = 1;
/// Joint of the first facial bone.
pub const FIRST: u32 = 2;

/// Weights below this are dropped.
const PRUNE: f32 = 0.002;

/// Error of computing the weights of a face.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FaceWeightsError {
    /// A point that is not finite.
    #[error("point {point} of the mesh is not finite; repair the mesh before binding")]
    Point {
        /// Index of the first such point.
        point: usize,
    },
    /// A bone that is not finite.
    #[error("facial bone {bone} is not at a finite place; move it before binding")]
    Bone {
        /// Index of the first such bone.
        bone: usize,
    },
    /// A triangle with a corner that does not exist.
    #[error("triangle {triangle} has a corner past the last point: the mesh is damaged")]
    Triangle {
        /// Index of the first such triangle.
        triangle: usize,
    },
    /// Cancelled by the progress callback.
    #[error("computing facial weights was cancelled")]
    Cancelled,
}

/// Data shared by the parts of the binding: the welded mesh and the map of the face on it.
pub(crate) struct Face<'a> {
    /// Positions of the welded vertices.
    pub places: Vec<Vec3>,
    /// The welded surface.
    pub graph: Graph,
    /// Marks vertices of the skin.
    pub skin: Vec<bool>,
    /// Marks visible vertices of the mask.
    pub mask: Vec<bool>,
    pub map: FaceMap,
    pub bones: &'a [FaceBone],
    /// The joint that lower teeth and chin follow.
    pub jaw: Option<u32>,
    /// Position of the jaw's axis.
    pub pivot: Vec3,
    /// Height of the underside of the chin.
    pub chin: f32,
    /// Joint of each eye, left and right.
    pub eyes: [u32; 2],
    /// The joint that the tongue follows from its tip to its root.
    pub tongue: Option<u32>,
    pub upper_mean: Vec3,
    pub lower_mean: Vec3,
    /// True if the lips can part; a mouth that is one closed surface stretches instead.
    pub lips_part: bool,
}

/// Weights of all points of a head.
///
/// `points` are in head space; `shells`, `groups`, `landmarks` and `bones` belong to them. Joints of the result: 0 is
/// the neck, 1 the head, 2 + i is `bones[i]`. Every point has one to `most` influences, strongest first, that sum to
/// one; points at equal places have equal weights, and so, mirrored, have points of a symmetric head that are each
/// other's mirror images. The same input gives the same bits with any number of threads.
/// `progress` is called with a share from 0 to 1 and returns whether to go on.
///
/// # Errors
/// Input that is not finite or refers to points that do not exist, and [`FaceWeightsError::Cancelled`]; no input
/// panics. Cost: one sparse factorisation over the mask and two solves a bone.
pub fn face_weights(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    shells: &Shells,
    groups: &HeadGroups,
    landmarks: &Landmarks,
    bones: &[FaceBone],
    most: usize,
    progress: &(dyn Fn(f32) -> bool + Sync),
) -> Result<Weights, FaceWeightsError> {
    if let Some(point) = points.iter().position(|p| !p.is_finite()) {
        return Err(FaceWeightsError::Point { point });
    }
    if let Some(bone) = bones.iter().position(|b| !b.position.is_finite()) {
        return Err(FaceWeightsError::Bone { bone });
    }
    if let Some(triangle) = triangles.iter().position(|t| t.iter().any(|&i| i as usize >= points.len())) {
        return Err(FaceWeightsError::Triangle { triangle });
    }
    let (welded, count) = weld(points);
    let map = FaceMap::new(landmarks, landmarks.symmetric, extent(points));
    let mut places = vec![Vec3::ZERO; count];
    let (mut skin, mut mask) = (vec![false; count], vec![false; count]);
    let mut shell = vec![u32::MAX; count];
    let mut kinds = vec![ShellKind::Inside; count];
    for (i, &v) in welded.iter().enumerate() {
        let v = v as usize;
        places[v] = points[i];
        mask[v] |= groups.visible.get(i).copied().unwrap_or(false);
        if !skin[v] {
            kinds[v] = shells.kind(i);
            skin[v] = kinds[v] == ShellKind::Skin;
            shell[v] = shells.shell_of.get(i).copied().unwrap_or(u32::MAX);
        }
    }
    let surface: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|i| welded[i as usize])).collect();
    let graph = Graph::new(&places, &surface);
    if !progress(0.1) {
        return Err(FaceWeightsError::Cancelled);
    }
    let joint = |kind, side: Option<Side>| {
        let found = bones.iter().position(|b| b.kind == kind && side.is_none_or(|s| b.side == s));
        found.map(|i| FIRST + i as u32)
    };
    let jaw = joint(FaceBoneKind::Jaw, None);
    let ear: Vec3 = map.halves.iter().map(|h| h.jaw[8] + h.jaw[6]).sum::<Vec3>() / 4.0;
    let face = Face {
        places,
        graph,
        skin,
        mask,
        bones,
        jaw,
        pivot: jaw.and_then(|j| bones.get((j - FIRST) as usize)).map_or(ear, |b| b.position),
        chin: if groups.chin.is_finite() { groups.chin } else { 0.0 },
        eyes: [Side::Left, Side::Right].map(|s| joint(FaceBoneKind::Eye, Some(s)).unwrap_or(HEAD)),
        tongue: joint(FaceBoneKind::Tongue, None),
        upper_mean: groups.upper_mean,
        lower_mean: groups.lower_mean,
        lips_part: landmarks.mouth_open,
        map,
    };
    let sides = sides::Sides::new(&face);
    let mut rows = skin::rows(&face, &sides, progress)?;
    let stiff = interior::rows(&face, &sides, &shell, &kinds, &mut rows);
    rows.iter_mut().for_each(|row| finish(row, most, jaw));
    if !progress(1.0) {
        return Err(FaceWeightsError::Cancelled);
    }
    let mut weights = Weights { starts: vec![0], ..Weights::default() };
    for &v in &welded {
        weights.push(rows[v as usize].iter().copied());
    }
    if let Some(mirror) = Mirror::new(points, bones, landmarks) {
        mirror.apply(&mut weights, most);
        let part_of: Vec<Option<u32>> = welded.iter().map(|&v| stiff[v as usize]).collect();
        mirror.stiffen(&mut weights, &part_of);
    }
    Ok(weights)
}

/// The influences of one vertex.
pub(crate) type Row = Vec<(u32, f32)>;

/// Keeps the strongest influences of a vertex, and the share of the jaw, which all skin around has; a vertex without any belongs to
/// the head.
fn finish(row: &mut Row, most: usize, jaw: Option<u32>) {
    keep_strongest_softly(row, most, PRUNE, jaw);
    if row.is_empty() {
        row.push((HEAD, 1.0));
    }
}

impl Face<'_> {
    /// Share of the neck in the head's weight, 0 to 1.
    ///
    /// On a face the border rises from below the chin to the base of the skull; elsewhere it is half way between the
    /// means of the middle group.
    pub fn neck_share(&self, p: Vec3) -> f32 {
        let e = self.map.scale;
        if self.map.trusted {
            let front = self.map.halves[0].jaw[0].z;
            let border = self.chin - 0.3 * e + 0.28 * (front - p.z).clamp(0.0, 2.5 * e);
            return smooth(0.45 * e, -0.45 * e, p.y - border);
        }
        let along = (self.lower_mean - self.upper_mean).with_x(0.0);
        let share = (p - self.upper_mean).dot(along) / along.length_squared();
        if share.is_finite() { smooth(0.3, 0.8, share) } else { 0.0 }
    }

    /// Distance of a place below the plane through the jaw's axis and the line between the lips.
    pub fn below_lips(&self, p: Vec3) -> f32 {
        let half = &self.map.halves[0];
        let line = half.lip_line();
        let mouth = (line[0] - self.pivot).with_x(0.0);
        let down = Vec3::new(0.0, -mouth.z, mouth.y).normalize_or_zero();
        let down = if down.y > 0.0 { -down } else { down };
        (p - self.pivot).dot(down)
    }
}

/// A smooth step from 0 at `from` to 1 at `to`.
pub(crate) fn smooth(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
