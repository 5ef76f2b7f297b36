//! Head part: the head of a whole body or beast.
//!
//! A body stands on legs: near the ground its surface is two parts or more. From the head's extremity (the top of a
//! biped, the front and top of a beast) planes walk into the body; where their sections are narrowest behind the head is
//! the neck, and where they widen from there to the body it is cut.

use glam::Vec3;
use thiserror::Error;

use super::sections::{Section, sections};
use crate::mesh::adjacency;

/// The head of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct HeadPart {
    /// True if the mesh is more than a head.
    pub is_part: bool,
    /// True for points of the head with its neck; all points if the mesh is a head itself.
    pub points: Vec<bool>,
    /// What the mesh is taken for, a sentence for the user.
    pub reason: String,
    /// Where the neck is cut, a point and a unit normal towards the head, if it is.
    pub cut: Option<(Vec3, Vec3)>,
}

/// Why there is no head.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum HeadPartError {
    /// Nothing to look at.
    #[error("the mesh has no points or no triangles to find a head in; pick a mesh with a surface")]
    Empty,
    /// A coordinate is infinite or not a number.
    #[error("point {point} has a coordinate that is not a finite number; remove it or repair the mesh")]
    NotFinite {
        /// Its index.
        point: usize,
    },
}

/// Planes from the head's extremity through the body.
const PLANES: usize = 64;
/// A biped is so much higher than deep.
const BIPED: f32 = 1.8;
/// The neck ends where a section is this much wider than its narrowest.
const WIDENS: f32 = 1.3;

/// Finds the head of a mesh: all of it, or the head part of a body.
///
/// `points` are in head space (+y up, +z forward), in any unit.
///
/// # Errors
/// [`HeadPartError`]: nothing to look at, or coordinates that are not finite. Near linear time.
pub fn head_part(points: &[Vec3], triangles: &[[u32; 3]]) -> Result<HeadPart, HeadPartError> {
    if points.is_empty() || triangles.is_empty() {
        return Err(HeadPartError::Empty);
    }
    if let Some(point) = points.iter().position(|point| !point.is_finite()) {
        return Err(HeadPartError::NotFinite { point });
    }
    let whole =
        HeadPart { is_part: false, points: vec![true; points.len()], reason: "the mesh is a head".into(), cut: None };
    let (welded, count) = adjacency::weld(points);
    let joined: Vec<[u32; 3]> = triangles
        .iter()
        .filter(|triangle| triangle.iter().all(|corner| (*corner as usize) < points.len()))
        .map(|triangle| triangle.map(|corner| welded[corner as usize]))
        .collect();
    let mut places = vec![Vec3::ZERO; count];
    for (point, number) in points.iter().zip(&welded) {
        places[*number as usize] = *point;
    }
    let (low, high) = places.iter().fold((Vec3::MAX, Vec3::MIN), |(low, high), p| (low.min(*p), high.max(*p)));
    let size = high - low;
    if !(size.min_element() > 0.0) || ![0.06, 0.12].iter().all(|share| legs(&places, &joined, low, size, *share) >= 2) {
        return Ok(whole);
    }
    let biped = size.y > BIPED * size.z;
    let toward = if biped { Vec3::Y } else { Vec3::new(0.0, 1.0, 1.0).normalize() };
    let (bottom, top) =
        places.iter().map(|p| p.dot(toward)).fold((f32::MAX, f32::MIN), |(low, high), at| (low.min(at), high.max(at)));
    // Sections along the inverse direction: the first is at the head.
    let planes = sections(&places, &joined, -toward, [-top, -bottom], PLANES);
    let at = -cut_at(&planes, if biped { 0.35 } else { 0.6 });
    let above: Vec<[u32; 3]> = joined
        .iter()
        .filter(|triangle| triangle.iter().all(|corner| places[*corner as usize].dot(toward) >= at))
        .copied()
        .collect();
    let (island_of, _) = adjacency::islands(&above, count);
    let head = (0..count).max_by(|a, b| places[*a].dot(toward).total_cmp(&places[*b].dot(toward)));
    let Some(head) = head.map(|place| island_of[place]) else { return Ok(whole) };
    let mut inside = (Vec3::MAX, Vec3::MIN);
    for (place, island) in places.iter().zip(&island_of) {
        if *island == head {
            inside = (inside.0.min(*place), inside.1.max(*place));
        }
    }
    // Eyes and teeth are loose, and lie within the head's box; hands held high do not.
    let within = |place: Vec3| place.cmpge(inside.0).all() && place.cmple(inside.1).all();
    let keep: Vec<bool> = (0..count)
        .map(|place| island_of[place] == head || (places[place].dot(toward) >= at && within(places[place])))
        .collect();
    if keep.iter().filter(|keep| **keep).count() < 8 || keep.iter().all(|keep| *keep) {
        return Ok(whole);
    }
    let what = if biped { "a whole body" } else { "a whole beast" };
    Ok(HeadPart {
        is_part: true,
        points: welded.iter().map(|number| keep[*number as usize]).collect(),
        reason: format!("the mesh is {what}: it stands on legs. Its head and neck are taken"),
        cut: Some((toward * at, toward)),
    })
}

/// How many parts of the surface there are below a share of the height, dust aside.
fn legs(places: &[Vec3], joined: &[[u32; 3]], low: Vec3, size: Vec3, share: f32) -> usize {
    let height = low.y + share * size.y;
    let below: Vec<[u32; 3]> = joined
        .iter()
        .filter(|triangle| triangle.iter().any(|corner| places[*corner as usize].y < height))
        .copied()
        .collect();
    let (island_of, islands) = adjacency::islands(&below, places.len());
    let mut areas = vec![0.0_f32; islands];
    for triangle in &below {
        let [a, b, c] = triangle.map(|corner| places[corner as usize]);
        areas[island_of[triangle[0] as usize] as usize] += (b - a).cross(c - a).length();
    }
    let largest = areas.iter().copied().fold(0.0, f32::max);
    areas.iter().filter(|area| **area > 0.2 * largest).count()
}

/// Where to cut, given sections from the head into the body: past the narrowest behind the head, where they widen.
fn cut_at(planes: &[Section], farthest: f32) -> f32 {
    let last = ((planes.len() as f32 * farthest) as usize).min(planes.len().saturating_sub(1));
    let Some(end) = planes.get(last) else { return 0.0 };
    let size = |index: usize| planes[index].size();
    // The narrowest place that has something wider on either side, by the most.
    let mut best: Option<(f32, usize)> = None;
    let mut before = 0.0_f32;
    for index in 1..last {
        before = before.max(size(index - 1));
        let after = (index + 1..=(index + PLANES / 4).min(planes.len() - 1)).map(size).fold(0.0, f32::max);
        let waist = before.min(after) / size(index).max(f32::MIN_POSITIVE);
        if waist > 1.08 && best.is_none_or(|best| waist > best.0) {
            best = Some((waist, index));
        }
    }
    // Without a waist: half of how far the head may reach.
    let Some((_, narrow)) = best else { return planes[last / 2].at.min(end.at) };
    let wide = (narrow..=last).find(|index| size(*index) > WIDENS * size(narrow)).unwrap_or(last);
    planes[wide.saturating_sub(1).max(narrow)].at
}
