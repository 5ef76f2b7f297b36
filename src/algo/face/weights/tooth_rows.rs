//! Rows of single teeth: shells that stand side by side in a mouth and move as one.
//!
//! A tooth alone does not tell its jaw: where a row rises or sinks to the back, an upper tooth is as low as lower teeth in
//! front. Side by side teeth of one row differ little in height, and a tooth never belongs to the row of one that it meets.
//! Nearest teeth are joined first, as in single linkage, but no two rows with teeth that meet.

use glam::Vec3;

use super::Face;

/// Largest extent of a tooth with its root, in distances of the eyes' outer corners. Rows of one mesh and gums are larger.
const LARGEST: f32 = 0.35;
/// Largest gap between neighbours of a row with a tooth missing, in distances of the eyes' outer corners.
const GAP: f32 = 0.3;
/// Largest difference of neighbours' heights, and least overlap, as shares of the shorter one's height.
const STEP: f32 = 0.45;
const OVERLAP: f32 = 0.5;
/// Weight of a difference in height beside a gap along the row.
const RISE: f32 = 3.0;
/// Largest number of teeth that are compared. More small shells are no teeth.
const MOST: usize = 128;

/// Bounds of one shell.
#[derive(Clone, Copy)]
struct Tooth {
    low: Vec3,
    high: Vec3,
}

impl Tooth {
    fn new(face: &Face, members: &[usize]) -> Self {
        let places = || members.iter().map(|&v| face.places[v]);
        Self { low: places().fold(Vec3::INFINITY, Vec3::min), high: places().fold(Vec3::NEG_INFINITY, Vec3::max) }
    }

    fn size(&self) -> Vec3 {
        self.high - self.low
    }

    /// Difference of the heights of two middles.
    fn rise(&self, other: &Self) -> f32 {
        0.5 * (self.low.y + self.high.y - other.low.y - other.high.y).abs()
    }

    /// True if one stands over the other, so that they are of different jaws, or crown and root.
    fn meets(&self, other: &Self) -> bool {
        let overlap = self.high.min(other.high) - self.low.max(other.low);
        let least = self.size().min(other.size());
        overlap.x >= 0.5 * least.x && overlap.z >= 0.5 * least.z && self.rise(other) > 0.5 * least.y
    }

    /// Cost of joining two teeth of a face of scale `e`; `None` if they are no neighbours.
    fn cost(&self, other: &Self, e: f32) -> Option<f32> {
        let apart = (self.low.max(other.low) - self.high.min(other.high)).max(Vec3::ZERO);
        let gap = apart.with_y(0.0).length();
        let overlap = self.high.y.min(other.high.y) - self.low.y.max(other.low.y);
        let least = self.size().y.min(other.size().y);
        // The roots of fangs are in line with those of other teeth, and their tips are not.
        let ends = (self.low.y - other.low.y).abs().min((self.high.y - other.high.y).abs());
        let rise = self.rise(other);
        let is_beside = gap <= GAP * e && overlap >= OVERLAP * least && rise.min(ends) <= STEP * least;
        is_beside.then(|| (RISE * rise).hypot(gap))
    }
}

/// The rows among shells in a mouth, each as the numbers of its shells in order; a shell that stands alone is a row of one.
///
/// Rows are in the order of their first shells. Quadratic in the number of teeth, of which there are at most [`MOST`].
pub(super) fn rows(face: &Face, shells: &[&[usize]]) -> Vec<Vec<usize>> {
    let e = face.map.scale;
    let teeth: Vec<Tooth> = shells.iter().map(|members| Tooth::new(face, members)).collect();
    let single: Vec<usize> =
        (0..teeth.len()).filter(|&shell| teeth[shell].size().max_element() <= LARGEST * e).collect();
    let mut rows: Vec<Vec<usize>> = (0..teeth.len()).map(|shell| vec![shell]).collect();
    if single.len() > MOST {
        return rows;
    }
    let pairs = single.iter().enumerate().flat_map(|(at, &a)| single[at + 1..].iter().map(move |&b| (a, b)));
    let mut joints: Vec<(f32, usize, usize)> =
        pairs.filter_map(|(a, b)| Some((teeth[a].cost(&teeth[b], e)?, a, b))).collect();
    joints.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut row_of: Vec<usize> = (0..teeth.len()).collect();
    for (_, a, b) in joints {
        let (first, second) = (row_of[a].min(row_of[b]), row_of[a].max(row_of[b]));
        let meet = |one: &usize| rows[second].iter().any(|other| teeth[*one].meets(&teeth[*other]));
        if first == second || rows[first].iter().any(meet) {
            continue;
        }
        let moved = std::mem::take(&mut rows[second]);
        for &shell in &moved {
            row_of[shell] = first;
        }
        rows[first].extend(moved);
    }
    rows.retain(|row| !row.is_empty());
    rows.iter_mut().for_each(|row| row.sort_unstable());
    rows
}
