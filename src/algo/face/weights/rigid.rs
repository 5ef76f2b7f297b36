//! Parts that no expression bends: glasses, monocles, earrings, piercings, hats.
//!
//! Lashes and brows are on the skin along their whole length. Frames of glasses are as near to the eyes, but touch the skin
//! at few places, such as the bridge of the nose, or go around the eye and across the face.

use std::collections::BTreeMap;

use glam::Vec3;

use super::{Face, HEAD, NECK, Row};

/// Largest extent of a lash, a tuft or a bead, which are on the skin wherever they touch it, in distances of the eyes'
/// outer corners.
const SMALL: f32 = 0.25;
/// Largest extent of a piercing, bead or single hair, which is stiff on the skin that moves it.
const STIFF: f32 = 0.15;
/// Largest extent of a part that hangs on one place, such as an earring.
const HANGING: f32 = 0.6;
/// Number of sections across a part, and the least number of those that touch the skin in a lash or a brow.
const SECTIONS: usize = 12;
const TOUCHING: usize = 6;

/// Least and greatest corner of a shell.
fn bounds(face: &Face, members: &[usize]) -> (Vec3, Vec3) {
    let places = || members.iter().map(|&v| face.places[v]);
    (places().fold(Vec3::INFINITY, Vec3::min), places().fold(Vec3::NEG_INFINITY, Vec3::max))
}

/// True for a shell near the eyes that stands off the face, such as a pair of glasses.
///
/// `is_touching` tells of each member, by its number in `members`, whether it is on the skin.
pub(super) fn is_frame(face: &Face, members: &[usize], is_touching: impl Fn(usize) -> bool) -> bool {
    let e = face.map.scale;
    let (low, high) = bounds(face, members);
    if (high - low).max_element() <= SMALL * e {
        return false;
    }
    let eyes = 0.5 * (face.map.halves[0].eye().y + face.map.halves[1].eye().y);
    let is_across = (face.map.middle - low.x).min(high.x - face.map.middle) > 0.2 * e && low.y < eyes;
    let mut touching = [None; SECTIONS];
    for (at, &v) in members.iter().enumerate() {
        let share = (face.places[v].x - low.x) / (high.x - low.x).max(f32::MIN_POSITIVE);
        let section = ((share * SECTIONS as f32) as usize).min(SECTIONS - 1);
        touching[section] = Some(touching[section].unwrap_or(false) || is_touching(at));
    }
    let filled = touching.iter().flatten().count();
    let held = touching.iter().flatten().filter(|is_touching| **is_touching).count();
    is_across || held * SECTIONS < TOUCHING * filled
}

/// Gives all vertices of a small shell on the skin the mean of their weights, so that a piercing keeps its shape.
pub(super) fn stiffen(face: &Face, members: &[usize], rows: &mut [Row]) {
    let (low, high) = bounds(face, members);
    if (high - low).max_element() > STIFF * face.map.scale {
        return;
    }
    let mut sums: BTreeMap<u32, f32> = BTreeMap::new();
    for &v in members {
        for &(joint, value) in &rows[v] {
            *sums.entry(joint).or_default() += value;
        }
    }
    let count = members.len().max(1) as f32;
    let mean: Row = sums.into_iter().map(|(joint, sum)| (joint, sum / count)).collect();
    for &v in members {
        rows[v].clone_from(&mean);
    }
}

/// Fills the rows of a shell that rides with head and neck; a small one hangs on its highest place and stays stiff.
pub(super) fn hang(face: &Face, members: &[usize], rows: &mut [Row]) {
    let (low, high) = bounds(face, members);
    let is_small = (high - low).max_element() <= HANGING * face.map.scale;
    let top = members.iter().map(|&v| face.places[v]).max_by(|a, b| a.y.total_cmp(&b.y));
    for &v in members {
        let neck = face.neck_share(top.filter(|_| is_small).unwrap_or(face.places[v]));
        rows[v] = vec![(HEAD, 1.0 - neck), (NECK, neck)];
    }
}
