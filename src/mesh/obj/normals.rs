//! Computed normals for files without them: smooth within smoothing groups, flat after `s off`.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use super::{NONE, ObjArrays, corner_table::CornerTable, triangulate::newell};

/// Smooth normals at points, one for each smoothing group at the point.
pub(super) struct SmoothNormals {
    /// Sums of face normals, by point if there is one group only, else by number in `table`.
    sums: Vec<Vec3>,
    table: Option<CornerTable>,
}

/// The normal scaled to length 1; `None` if it has no direction. A normal of unit length to within rounding keeps its
/// bits.
pub(super) fn unit(normal: [f32; 3]) -> Option<Vec3> {
    let long = DVec3::from(normal.map(f64::from));
    let square = long.length_squared();
    if (square - 1.0).abs() < 2e-6 {
        return Some(Vec3::from(normal));
    }
    (square > 0.0).then(|| (long / square.sqrt()).as_vec3())
}

/// The normal that the file gives a corner, if it has a direction.
pub(super) fn given(arrays: &ObjArrays, corner: usize) -> Option<(u32, Vec3)> {
    let index = *arrays.corner_normals.get(corner)?;
    if index == NONE {
        return None;
    }
    Some((index, unit(arrays.normals[index as usize])?))
}

/// Returns `true` if faces with this value of `s` are flat. Files without any `s` have smooth faces, as all readers
/// take it.
pub(super) fn is_flat(smoothing: u32) -> bool {
    smoothing == 0
}

/// The position of a point.
pub(super) fn position(arrays: &ObjArrays, point: u32) -> DVec3 {
    DVec3::from(arrays.positions[point as usize].map(f64::from))
}

/// The unit normal of a face, or zero for one without area.
pub(super) fn face_normal(arrays: &ObjArrays, face: usize) -> DVec3 {
    let corners = arrays.corners[arrays.face(face)].iter();
    newell(corners.map(|point| position(arrays, *point))).normalize_or_zero()
}

impl SmoothNormals {
    /// Sums the normals of all smooth faces that have a corner without normal at each of their corners, weighted by the
    /// angle there (Thürmer and Wüthrich 1998), so that the cut of a surface into faces does not matter. `groups` are
    /// the runs' numbers of [`group_numbers`].
    pub fn new(arrays: &ObjArrays, groups: &[u32]) -> Self {
        let smooth = |run: &usize| !is_flat(arrays.runs[*run].smoothing);
        let lacking = |face: &usize| arrays.face(*face).any(|corner| given(arrays, corner).is_none());
        let mut met = (0..arrays.runs.len()).filter(smooth).map(|run| groups[run]);
        let first = met.next();
        let several = met.any(|group| Some(group) != first);
        let mut table = several.then(|| CornerTable::new(arrays.positions.len()));
        let mut sums: Vec<Vec3> = Vec::new();
        for run in (0..arrays.runs.len()).filter(smooth) {
            for face in arrays.run_faces(run).filter(lacking) {
                let corners = &arrays.corners[arrays.face(face)];
                let normal = face_normal(arrays, face);
                if normal == DVec3::ZERO {
                    continue;
                }
                if !several && sums.is_empty() {
                    sums.resize(arrays.positions.len(), Vec3::ZERO);
                }
                let mut before = position(arrays, corners[corners.len() - 1]);
                let mut here = position(arrays, corners[0]);
                for (at, point) in corners.iter().enumerate() {
                    let after = position(arrays, corners[(at + 1) % corners.len()]);
                    let weight = angle(before - here, after - here);
                    let slot = match &mut table {
                        Some(table) => table.vertex(*point, u64::from(groups[run])).0 as usize,
                        None => *point as usize,
                    };
                    if slot == sums.len() {
                        sums.push(Vec3::ZERO);
                    }
                    sums[slot] += (normal * weight).as_vec3();
                    (before, here) = (here, after);
                }
            }
        }
        Self { sums, table }
    }

    /// The normal at a point for a face with this number of its smoothing group; `None` where the faces around have no
    /// area or cancel out.
    pub fn at(&self, point: u32, group: u32) -> Option<Vec3> {
        let slot = match &self.table {
            Some(table) => table.find(point, u64::from(group))? as usize,
            None => point as usize,
        };
        unit(self.sums.get(slot)?.to_array())
    }
}

/// The angle between two vectors in radians to within 1e-4; 0 if one is zero.
///
/// A polynomial (Abramowitz and Stegun 4.4.45), so that it is the same on every machine.
fn angle(a: DVec3, b: DVec3) -> f64 {
    let lengths = (a.length_squared() * b.length_squared()).sqrt();
    if lengths == 0.0 {
        return 0.0;
    }
    let cosine = (a.dot(b) / lengths).clamp(-1.0, 1.0);
    let x = cosine.abs();
    let polynomial = ((-0.018_729_3 * x + 0.074_261) * x - 0.212_114_4) * x + 1.570_728_8;
    let angle = (1.0 - x).sqrt() * polynomial;
    if cosine < 0.0 { std::f64::consts::PI - angle } else { angle }
}

/// Largest number of different smoothing groups.
const MOST_GROUPS: usize = 4096;

/// A number for the smoothing group of each run, in the order of their first use. Groups after the 4096th share the
/// last number.
pub(super) fn group_numbers(arrays: &ObjArrays) -> Vec<u32> {
    let mut numbers = HashMap::new();
    let mut number = |smoothing: u32| {
        let next = numbers.len().min(MOST_GROUPS - 1) as u32;
        *numbers.entry(smoothing).or_insert(next)
    };
    arrays.runs.iter().map(|run| number(run.smoothing)).collect()
}
