//! Volumes: the intervals of a ray that lie inside a body.

use crate::mesh::ray::Hit;

/// An interval of a ray inside the surface, as distances from the ray's origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Volume {
    /// Distance at which the interval begins.
    pub near: f32,
    /// Distance at which the interval ends; equal to `near` for a sheet whose other side is missing.
    pub far: f32,
}

impl Volume {
    /// The distance halfway between both ends.
    pub fn middle(&self) -> f32 {
        self.near + (self.far - self.near) * 0.5
    }
}

/// Groups the hits of one ray, sorted by distance, into disjoint volumes, sorted by distance.
///
/// The rule:
/// 1. Opposite hits at the same distance are a two-sided sheet or a mere touch. They are left out, unless the ray meets
///    nothing else; then sheets go in and out in turn.
/// 2. If as many hits enter as leave, a volume is a stretch where the winding number is not zero. So shells inside a
///    shell (teeth in a body), duplicates of a shell and shells that overlap make one volume; a shell turned inside out
///    makes the same volume as its right self; a cavity (a mouth whose walls belong to the body) separates two.
/// 3. Otherwise some surface is open. Each exit is paired with the last entry before it that has none; the remaining
///    hits are paired the other way around (exit first: inside out); outermost pairs are volumes. A hit that finds no
///    partner and lies in no volume is a sheet: a volume whose `near` and `far` are equal.
///
/// Linear time.
pub fn volumes(hits: &[Hit]) -> Vec<Volume> {
    let (solid, sheets) = split_sheets(hits);
    if solid.is_empty() {
        return sheets.chunks(2).map(|pair| Volume { near: pair[0], far: pair[pair.len() - 1] }).collect();
    }
    let winding: i64 = solid.iter().map(|&(_, entering)| if entering { 1 } else { -1 }).sum();
    if winding == 0 { winding_volumes(&solid) } else { paired_volumes(&solid) }
}

/// Distance, and whether the ray enters.
type Side = (f32, bool);

/// Removes opposite hits at one distance; returns the remaining hits and the distances of the removed ones.
fn split_sheets(hits: &[Hit]) -> (Vec<Side>, Vec<f32>) {
    let (mut solid, mut sheets) = (Vec::with_capacity(hits.len()), Vec::new());
    for same in hits.chunk_by(|a, b| b.distance - a.distance <= a.distance.abs() * 1e-6) {
        let ins = same.iter().filter(|hit| hit.entering).count();
        let outs = same.len() - ins;
        if ins == outs {
            sheets.push(same[0].distance);
        }
        for _ in 0..ins.abs_diff(outs) {
            solid.push((same[0].distance, ins > outs));
        }
    }
    (solid, sheets)
}

/// Intervals where the winding number is not zero; the sum over all hits is zero.
fn winding_volumes(hits: &[Side]) -> Vec<Volume> {
    let mut volumes = Vec::new();
    let (mut winding, mut near) = (0, 0.0);
    for &(distance, entering) in hits {
        if winding == 0 {
            near = distance;
        }
        winding += if entering { 1 } else { -1 };
        if winding == 0 {
            volumes.push(Volume { near, far: distance });
        }
    }
    volumes
}

/// Outermost pairs, and hits without a partner as sheets.
fn paired_volumes(hits: &[Side]) -> Vec<Volume> {
    let mut partner: Vec<usize> = (0..hits.len()).collect();
    for opens in [true, false] {
        let mut open: Vec<usize> = Vec::new();
        for i in 0..hits.len() {
            if partner[i] != i {
                continue;
            }
            if hits[i].1 == opens {
                open.push(i);
            } else if let Some(start) = open.pop() {
                (partner[i], partner[start]) = (start, i);
            }
        }
    }
    let mut volumes: Vec<Volume> = Vec::new();
    let mut covered = 0;
    for i in 0..hits.len() {
        if i < covered {
            covered = covered.max(partner[i] + 1);
            if let Some(last) = volumes.last_mut() {
                last.far = hits[covered - 1].0;
            }
        } else {
            covered = i.max(partner[i]) + 1;
            volumes.push(Volume { near: hits[i].0, far: hits[covered - 1].0 });
        }
    }
    volumes
}
