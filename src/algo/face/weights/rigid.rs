//! Parts that no expression bends: glasses, monocles, earrings, piercings, hats.
//!
//! Lashes and brows are on the skin along their whole length. Frames of glasses are as near to the eyes, but touch the
//! skin at few places, such as the bridge of the nose, or go around the eye and across the face.

use std::{collections::BTreeMap, f32::consts::TAU};

use bevy::math::ops::atan2;
use glam::Vec3;

use super::{Face, HEAD, NECK, Row};
use crate::algo::face::bones::map::line_distance;

/// Largest extent of a lash, a tuft or a bead, which are on the skin wherever they touch it, in distances of the eyes'
/// outer corners.
const SMALL: f32 = 0.25;
/// Largest extent of a piercing or bead, which is stiff on the skin that moves it.
const STIFF: f32 = 0.15;
/// Largest extent of a part that hangs on one place, such as an earring.
const HANGING: f32 = 0.6;
/// Number of sections across a part, and the least number of those that touch the skin in a lash or a brow.
const SECTIONS: usize = 12;
const TOUCHING: usize = 6;
/// Least distance of a lens's frame from the lids, on whose rims lashes stand.
const OFF_LIDS: f32 = 0.08;
/// Distance from the middle of an eye, as seen from the front, at which a vertex is over the eye; rims of lids are
/// further away.
const OVER_EYE: f32 = 0.05;
/// Number of directions from the middle of an eye, and the least number of those in which a frame is off the lids.
const DIRECTIONS: usize = 12;
const CLEAR: usize = 8;

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
    is_across || held * SECTIONS < TOUCHING * filled || is_around_eye(face, members, [low, high], &is_touching)
}

/// True for a shell that goes around an eye off its lids, such as a monocle, even one that brow and cheek hold, and for
/// one that covers the eye and reaches beyond the lids, such as dark glass; paint around an eye lies on the skin
/// everywhere.
fn is_around_eye(face: &Face, members: &[usize], [low, high]: [Vec3; 2], is_touching: impl Fn(usize) -> bool) -> bool {
    let (middle, reach) = (face.map.middle, OFF_LIDS * face.map.scale);
    let (half, _) = face.map.fold(0.5 * (low + high));
    let (eye, side) = (half.eye(), if low.x + high.x < 2.0 * middle { -1.0 } else { 1.0 });
    let mut nearest = [f32::INFINITY; DIRECTIONS];
    let mut furthest = [0.0_f32; DIRECTIONS];
    let mut covers = false;
    for &v in members {
        let at = face.places[v];
        let at = at.with_x(side * (at.x - middle));
        let turn = atan2(at.y - eye.y, at.x - eye.x) / TAU + 0.5;
        let direction = ((turn * DIRECTIONS as f32) as usize).min(DIRECTIONS - 1);
        let distance = line_distance(&half.upper_lid, at).min(line_distance(&half.lower_lid, at));
        nearest[direction] = nearest[direction].min(distance);
        furthest[direction] = furthest[direction].max(distance);
        covers |= at.truncate().distance(eye.truncate()) < OVER_EYE * face.map.scale;
    }
    let is_whole = nearest.iter().all(|distance| distance.is_finite());
    let off_lids =
        |distances: [f32; DIRECTIONS]| distances.iter().filter(|distance| **distance > reach).count() >= CLEAR;
    let touching = (0..members.len()).filter(|&at| is_touching(at)).count();
    is_whole && (off_lids(nearest) && 10 * touching < 9 * members.len() || covers && off_lids(furthest))
}

/// Number of edges of a shell.
fn edges(face: &Face, members: &[usize]) -> usize {
    let neighbours = |v: usize| face.graph.starts[v + 1] - face.graph.starts[v];
    members.iter().map(|&v| neighbours(v) as usize).sum::<usize>() / 2
}

/// True for a shell without a border, by its number of edges (Euler). Strands and lashes of flat strips have one.
fn is_closed(face: &Face, members: &[usize]) -> bool {
    members.len() > 4 && edges(face, members) + 6 >= 3 * members.len()
}

/// True for a closed shell with a hole, too large for a piercing: an earring, which hangs even where it lies on the skin.
pub(super) fn is_hanging_ring(face: &Face, members: &[usize]) -> bool {
    let (low, high) = bounds(face, members);
    let size = (high - low).max_element() / face.map.scale;
    members.len() > 4 && size > STIFF && size <= HANGING && edges(face, members) >= 3 * members.len()
}

/// Gives all vertices of a small closed shell on the skin the mean of their weights, so that a piercing keeps its shape;
/// returns `false` for a larger or an open one, such as a strand of a beard, whose root goes with the skin.
pub(super) fn stiffen(face: &Face, members: &[usize], rows: &mut [Row]) -> bool {
    let (low, high) = bounds(face, members);
    if (high - low).max_element() > STIFF * face.map.scale || !is_closed(face, members) {
        return false;
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
    true
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
