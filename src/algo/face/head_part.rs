//! Head part: the head of a whole body, human or animal.
//!
//! A body stands on legs: near the ground its surface has two parts or more. Planes or spheres walk from the head's
//! extremity (the top of a biped, the snout of a quadruped) into the body; their narrowest section behind the head is
//! the neck, and the cut lies between it and the body, where they widen.

use glam::Vec3;
use thiserror::Error;

use super::sections::{Section, sections};
use crate::mesh::adjacency;

pub(super) mod snout;

/// The head of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct HeadPart {
    /// Marks a mesh that is more than a head.
    pub is_part: bool,
    /// Marks points of the head with its neck; all points if the mesh is a head itself.
    pub points: Vec<bool>,
    /// Interpretation of the mesh, as a sentence for the user.
    pub reason: String,
    /// Cut through the neck, a point and a unit normal towards the head, if there is one.
    pub cut: Option<(Vec3, Vec3)>,
}

/// Error of the search for a head.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum HeadPartError {
    /// No points or triangles.
    #[error("the mesh has no points or no triangles to find a head in; pick a mesh with a surface")]
    Empty,
    /// A coordinate that is not finite.
    #[error("point {point} has a coordinate that is not a finite number; remove it or repair the mesh")]
    NotFinite {
        /// Index of the point.
        point: usize,
    },
}

/// Number of planes from the head's extremity through the body.
const PLANES: usize = 64;
/// Least ratio of height to depth of a biped.
const BIPED: f32 = 1.8;
/// Widening of a section, relative to the narrowest one, at which the neck ends.
const WIDENS: f32 = 1.3;
/// Least ratio of the height of a body to that of its head if it lifts a leg.
const LIFTED: f32 = 3.0;

/// Least share of a loose part's width and depth that lies below or within the head's topmost part, if it belongs to the head.
const SHARED: f32 = 0.5;

/// Finds the head of a mesh: all of it, or the head part of a body.
///
/// `points` are in head space (+y up, +z forward), in any unit.
///
/// # Errors
/// [`HeadPartError`]: no points or triangles, or coordinates that are not finite. Near linear time.
pub fn head_part(points: &[Vec3], triangles: &[[u32; 3]]) -> Result<HeadPart, HeadPartError> {
    if points.is_empty() || triangles.is_empty() {
        return Err(HeadPartError::Empty);
    }
    if let Some(point) = points.iter().position(|point| !point.is_finite()) {
        return Err(HeadPartError::NotFinite { point });
    }
    let whole =
        HeadPart { is_part: false, points: vec![true; points.len()], reason: "the mesh is a head".into(), cut: None };
    let body = Body::new(points, triangles);
    if body.size().is_nan() || body.size().min_element() <= 0.0 {
        return Ok(whole);
    }
    let biped = body.is_biped();
    let cut = match biped {
        true => crown_cut(&body).filter(|(_, head)| body.stands(Some(*head))).map(|(cut, _)| cut),
        false => Some(()).filter(|()| body.stands(None)).and_then(|()| snout::cut(&body)),
    };
    let Some(cut) = cut else { return Ok(whole) };
    let keep = body.within(&cut);
    if keep.iter().filter(|keep| **keep).count() < 8 || keep.iter().all(|keep| *keep) {
        return Ok(whole);
    }
    let what = if biped { "a whole body" } else { "a whole beast" };
    Ok(HeadPart {
        is_part: true,
        points: body.welded.iter().map(|number| keep[*number as usize]).collect(),
        reason: format!("the mesh is {what}: it stands on legs. Its head and neck are taken"),
        cut: Some(cut.plane),
    })
}

/// Cut of a head from its body.
pub(super) struct Cut {
    /// Distance of each place from the head's extremity.
    away: Vec<f32>,
    /// Distance up to which places belong to the head.
    reach: f32,
    /// Index of the place at the extremity.
    tip: usize,
    /// A point and a normal towards the head.
    plane: (Vec3, Vec3),
}

/// The cut of an upright body, horizontal and below the topmost part, and the head's height above the narrowest place.
fn crown_cut(body: &Body) -> Option<(Cut, f32)> {
    let planes = sections(&body.places, &body.joined, Vec3::NEG_Y, [-body.high.y, -body.low.y], PLANES);
    let sizes: Vec<f32> = planes.iter().map(Section::size).collect();
    let last = (sizes.len() as f32 * 0.35) as usize;
    let (narrow, end) = neck(&sizes, last, 0.0, WIDENS)?;
    let (narrow, end) = (-planes.get(narrow)?.at, planes.get(end)?);
    let tip = (0..body.places.len()).max_by(|a, b| body.places[*a].y.total_cmp(&body.places[*b].y))?;
    let cut = Cut {
        away: body.places.iter().map(|place| body.high.y - place.y).collect(),
        reach: body.high.y + end.at,
        tip,
        plane: (end.centroid, Vec3::Y),
    };
    Some((cut, body.high.y - narrow))
}

/// A mesh whose points of one position are welded.
pub(super) struct Body {
    welded: Vec<u32>,
    pub(super) places: Vec<Vec3>,
    pub(super) joined: Vec<[u32; 3]>,
    pub(super) low: Vec3,
    pub(super) high: Vec3,
}

impl Body {
    /// Welds a mesh. Triangles with corners past the end are left out.
    pub(super) fn new(points: &[Vec3], triangles: &[[u32; 3]]) -> Self {
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
        Self { welded, places, joined, low, high }
    }

    pub(super) fn size(&self) -> Vec3 {
        self.high - self.low
    }

    pub(super) fn is_biped(&self) -> bool {
        self.size().y > BIPED * self.size().z
    }

    /// Returns `true` if the body stands on two legs or more, or stands on one, lifts another, and is much higher than
    /// its `head`.
    pub(super) fn stands(&self, head: Option<f32>) -> bool {
        let two = |shares: [f32; 2]| shares.into_iter().all(|share| self.legs(share) >= 2);
        two([0.06, 0.12]) || (head.is_some_and(|head| self.size().y > LIFTED * head) && two([0.2, 0.3]))
    }

    /// Number of parts of the surface below a share of the height, without tiny ones.
    fn legs(&self, share: f32) -> usize {
        let height = self.low.y + share * self.size().y;
        let below: Vec<[u32; 3]> = self
            .joined
            .iter()
            .filter(|triangle| triangle.iter().any(|corner| self.places[*corner as usize].y < height))
            .copied()
            .collect();
        let (island_of, islands) = adjacency::islands(&below, self.places.len());
        let areas = self.areas(&below, &island_of, islands);
        let largest = areas.iter().copied().fold(0.0, f32::max);
        areas.iter().filter(|area| **area > 0.2 * largest).count()
    }

    /// The area of each island.
    fn areas(&self, triangles: &[[u32; 3]], island_of: &[u32], islands: usize) -> Vec<f32> {
        let mut areas = vec![0.0_f32; islands];
        for triangle in triangles {
            let [a, b, c] = triangle.map(|corner| self.places[corner as usize]);
            areas[island_of[triangle[0] as usize] as usize] += (b - a).cross(c - a).length();
        }
        areas
    }

    /// Marks the places of the head: those connected with its tip before the cut, and loose parts among them.
    fn within(&self, cut: &Cut) -> Vec<bool> {
        let near = |place: usize| cut.away[place] <= cut.reach;
        let above: Vec<[u32; 3]> = self
            .joined
            .iter()
            .filter(|triangle| triangle.iter().all(|corner| near(*corner as usize)))
            .copied()
            .collect();
        let (island_of, count) = adjacency::islands(&above, self.places.len());
        let mut boxes = vec![(Vec3::MAX, Vec3::MIN); count];
        for corner in above.iter().flatten() {
            let (place, (low, high)) =
                (self.places[*corner as usize], &mut boxes[island_of[*corner as usize] as usize]);
            (*low, *high) = (low.min(place), high.max(place));
        }
        let head = island_of[cut.tip] as usize;
        let mut inside = boxes[head];
        // The crown may be that of hair or of a hat, which are parts of their own: what lies below or within belongs to the
        // head. Raised hands lie beside it.
        let is_upright = cut.plane.1 == Vec3::Y;
        let mut is_head = vec![false; count];
        is_head[head] = true;
        let mut largest: Vec<usize> = (0..count).filter(|island| boxes[*island].0.x <= boxes[*island].1.x).collect();
        let size = |island: &usize| (boxes[*island].1 - boxes[*island].0).length();
        largest.sort_by(|a, b| size(b).total_cmp(&size(a)).then(a.cmp(b)));
        for island in largest {
            let (low, high) = boxes[island];
            let shared = high.min(inside.1) - low.max(inside.0);
            let least = SHARED * (high - low);
            if is_upright && shared.x >= least.x && shared.z >= least.z && shared.x > 0.0 && shared.z > 0.0 {
                is_head[island] = true;
                inside = (inside.0.min(low), inside.1.max(high));
            }
        }
        // Eyes and teeth are loose, and lie within the head's box.
        let boxed = |place: Vec3| place.cmpge(inside.0).all() && place.cmple(inside.1).all();
        (0..self.places.len())
            .map(|place| is_head[island_of[place] as usize] || (near(place) && boxed(self.places[place])))
            .collect()
    }
}

/// Indices of the narrowest section of the neck and of the cut, given sizes of sections from the head into the body, of
/// which the first `last` may be the neck. The cut lies past the narrowest section behind the head, where sections
/// widen. Sections of the head are at least a share `head` of the largest of them.
fn neck(sizes: &[f32], last: usize, head: f32, widens: f32) -> Option<(usize, usize)> {
    let last = last.min(sizes.len().checked_sub(1)?);
    let least = head * sizes[..=last].iter().copied().fold(0.0, f32::max);
    // The narrowest place with the largest ratio to wider places on either side; a waist farther off counts less.
    let mut best: Option<(f32, usize)> = None;
    let mut before = 0.0_f32;
    for index in 1..last {
        before = before.max(sizes[index - 1]);
        let after = sizes[index + 1..=(index + PLANES / 4).min(sizes.len() - 1)].iter().copied().fold(0.0, f32::max);
        let waist = before.min(after) / sizes[index].max(f32::MIN_POSITIVE);
        let worth = waist * (1.0 - index as f32 / PLANES as f32);
        if waist > 1.08 && before >= least && best.is_none_or(|best| worth > best.0) {
            best = Some((worth, index));
        }
    }
    // Without a waist: half of the largest reach of the head.
    let Some((_, narrow)) = best else { return Some((last / 2, last / 2)) };
    let wide = (narrow..=last).find(|index| sizes[*index] > widens * sizes[narrow]).unwrap_or(last);
    Some((narrow, wide.saturating_sub(1).max(narrow)))
}
