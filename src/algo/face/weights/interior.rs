//! Weights of parts other than skin: eyeballs, teeth, tongue, lashes, hair.

use std::collections::BTreeMap;

use super::{
    Face, HEAD, NECK, Row,
    sides::{Rim, Sides},
    smooth,
};
use crate::algo::face::{bones::map::line_distance, shells::ShellKind};

/// Distance from the skin up to which a cover lies on it, as a share of the face's scale.
const WORN: f32 = 0.06;
/// Least share of a cover's vertices that lie on the skin of the face, for a brow or a beard.
const ON_FACE: f32 = 0.8;

/// Fills the rows of vertices that are not skin, shell by shell.
pub(crate) fn rows(face: &Face, sides: &Sides, shell: &[u32], kinds: &[ShellKind], rows: &mut [Row]) {
    let mut members: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    let mut covers: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for v in 0..face.places.len() {
        match kinds[v] {
            ShellKind::Skin => {}
            ShellKind::LeftEye => rows[v] = vec![(face.eyes[0], 1.0)],
            ShellKind::RightEye => rows[v] = vec![(face.eyes[1], 1.0)],
            ShellKind::Cover => covers.entry(shell[v]).or_default().push(v),
            ShellKind::Inside => members.entry(shell[v]).or_default().push(v),
        }
    }
    for members in members.values() {
        if in_mouth(face, members) {
            mouth(face, members, rows);
        } else if !lashes(face, sides, members, rows) {
            stiff(face, members, rows);
        }
    }
    if covers.is_empty() {
        return;
    }
    let skin = SkinGrid::new(face);
    for members in covers.values() {
        if !lashes(face, sides, members, rows) && !worn(face, &skin, members, rows) {
            stiff(face, members, rows);
        }
    }
}

/// Fills the rows of vertices that follow the head, and below it the neck.
fn stiff(face: &Face, members: &[usize], rows: &mut [Row]) {
    for &v in members {
        let neck = face.neck_share(face.places[v]);
        rows[v] = vec![(HEAD, 1.0 - neck), (NECK, neck)];
    }
}

/// Fills the rows of a brow or a beard, nearly all of which lies on the skin of the face, with those of the nearest
/// skin; returns `false` for hair.
fn worn(face: &Face, skin: &SkinGrid, members: &[usize], rows: &mut [Row]) -> bool {
    if !face.map.trusted {
        return false;
    }
    let nearest: Vec<Option<usize>> = members.iter().map(|&v| skin.nearest(face, face.places[v])).collect();
    let on_face = nearest.iter().flatten().filter(|&&s| face.mask[s]).count();
    if (on_face as f32) < ON_FACE * members.len() as f32 {
        return false;
    }
    for (&v, nearest) in members.iter().zip(nearest) {
        match nearest {
            Some(s) => rows[v] = rows[s].clone(),
            None => stiff(face, &[v], rows),
        }
    }
    true
}

/// Vertices of the skin in cells as wide as a cover may be away from it.
struct SkinGrid {
    cell: f32,
    vertices: BTreeMap<[i32; 3], Vec<usize>>,
}

impl SkinGrid {
    fn new(face: &Face) -> Self {
        let cell = (WORN * face.map.scale).max(f32::MIN_POSITIVE);
        let mut grid = Self { cell, vertices: BTreeMap::new() };
        for v in (0..face.places.len()).filter(|&v| face.skin[v]) {
            grid.vertices.entry(grid.cell_of(face.places[v])).or_default().push(v);
        }
        grid
    }

    fn cell_of(&self, place: glam::Vec3) -> [i32; 3] {
        (place / self.cell).floor().as_ivec3().to_array()
    }

    /// The nearest vertex of the skin, if it is not farther than a cell is wide.
    fn nearest(&self, face: &Face, place: glam::Vec3) -> Option<usize> {
        let [x, y, z] = self.cell_of(place);
        let around = |at: i32| (-1..=1).map(move |step| at.saturating_add(step));
        let cells = around(x).flat_map(|x| around(y).flat_map(move |y| around(z).map(move |z| [x, y, z])));
        let near = cells.filter_map(|cell| self.vertices.get(&cell)).flatten().copied();
        let far = |v: usize| face.places[v].distance_squared(place);
        let nearest = near.min_by(|&a, &b| far(a).total_cmp(&far(b)).then(a.cmp(&b)));
        nearest.filter(|&v| far(v) <= self.cell * self.cell)
    }
}

/// Returns `true` for a shell whose middle lies behind the lips.
fn in_mouth(face: &Face, members: &[usize]) -> bool {
    if !face.map.trusted {
        return false;
    }
    let middle = members.iter().map(|&v| face.places[v]).sum::<glam::Vec3>() / members.len().max(1) as f32;
    let (half, p) = face.map.fold(middle);
    let corner = half.lip_corner();
    let e = face.map.scale;
    p.x < 1.3 * corner.x && (p.y - corner.y).abs() < 0.4 * e && p.z < half.lip_line()[0].z + 0.02 * e
}

/// Fills the rows of teeth and tongue: a part below the lips follows the jaw fully; a bag that spans both is shared
/// smoothly.
fn mouth(face: &Face, members: &[usize], rows: &mut [Row]) {
    let Some(jaw) = face.jaw else {
        for &v in members {
            rows[v] = vec![(HEAD, 1.0)];
        }
        return;
    };
    let below: Vec<f32> = members.iter().map(|&v| face.below_lips(face.places[v])).collect();
    let low = below.iter().copied().fold(f32::INFINITY, f32::min);
    let high = below.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let mean = below.iter().sum::<f32>() / below.len().max(1) as f32;
    let e = face.map.scale;
    let spans = low < -0.1 * e && high > 0.1 * e && mean.abs() < 0.3 * (high - low);
    for (&v, &below) in members.iter().zip(&below) {
        let share = match spans {
            true => smooth(-0.06 * e, 0.06 * e, below),
            false => f32::from(u8::from(mean > 0.0)),
        };
        rows[v] = vec![(jaw, share), (HEAD, 1.0 - share)];
    }
}

/// Fills the rows of lashes, brows and the like that lie on the skin with the weights of the nearest skin; returns
/// `false` for a shell of another kind.
fn lashes(face: &Face, sides: &Sides, members: &[usize], rows: &mut [Row]) -> bool {
    if !face.map.trusted {
        return false;
    }
    let e = face.map.scale;
    let middle = members.iter().map(|&v| face.places[v]).sum::<glam::Vec3>() / members.len().max(1) as f32;
    let (half, p) = face.map.fold(middle);
    let near = half.eye().distance(p) < 0.3 * e || line_distance(&half.brow, p) < 0.15 * e;
    if !near {
        return false;
    }
    let low = members.iter().fold(glam::Vec3::INFINITY, |a, &v| a.min(face.places[v]));
    let high = members.iter().fold(glam::Vec3::NEG_INFINITY, |a, &v| a.max(face.places[v]));
    let margin = glam::Vec3::splat(0.12 * e);
    let skin: Vec<usize> = (0..face.places.len())
        .filter(|&v| face.mask[v] && (face.places[v].cmpge(low - margin) & face.places[v].cmple(high + margin)).all())
        .collect();
    let nearest = |v: usize, rim: Option<(usize, Rim)>| {
        skin.iter()
            .copied()
            .filter(|&s| rim.is_none_or(|(opening, rim)| sides.rim(s, opening) == rim))
            .map(|s| (face.places[s].distance_squared(face.places[v]), s))
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
    };
    let found: Vec<Option<(f32, usize)>> = members.iter().map(|&v| nearest(v, None)).collect();
    let Some(root) = found.iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).copied() else {
        return false;
    };
    if root.0 > (0.03 * e) * (0.03 * e) {
        return false;
    }
    // Tips may be nearer to the other lid: all vertices follow the lid at the root.
    let opening = if p.x == 0.0 || middle.x >= face.map.middle { 1 } else { 2 };
    let rim = sides.rim(root.1, opening);
    for (&v, found) in members.iter().zip(found) {
        let own = if rim == Rim::None { found } else { nearest(v, Some((opening, rim))).or(found) };
        rows[v] = own.map_or_else(|| vec![(HEAD, 1.0)], |(_, s)| rows[s].clone());
    }
    true
}
