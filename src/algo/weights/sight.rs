//! Lines of sight through a triangle soup: is a segment clear, where does a ray first meet a surface, is a point
//! inside.
//!
//! Every answer is the same for either orientation of the triangles, so shells that are inside-out cause no trouble.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use glam::Vec3;
use rayon::prelude::*;

use super::{bone::BoneSegment, bone_tree::BoneTree, islands::Islands};
use crate::mesh::{ray::Ray, surface::Surface};

/// Directions in which [`encloses`] looks.
const DIRECTIONS: usize = 32;
/// The share of a segment at either end in which nothing blocks it: the surface the point lies on.
const MARGIN: f32 = 1e-3;
/// Leaves of a hierarchy that a ray through a body may meet. Through a mesh of a million triangles it meets some dozens; in a
/// soup of triangles from everywhere to everywhere it meets a share of all, and which side it is on has no meaning.
const MOST_LEAVES: usize = 1024;
/// Rounding errors of rays beside a mesh of size 2 are smaller than this.
const SLACK: f32 = 1e-5;
/// Places that are looked for in large islands: so many in any mesh, and some more for each island and joint. Of characters
/// with dozens of parts and hundreds of joints some thousand are.
const MOST_LOOKS: u64 = 1 << 16;
const LOOKS_OF_EACH: u64 = 16;
/// Crossings of the whole surface from which on it is a soup, unless there are few for each place that was looked for: so many in
/// any mesh, and some more for each place. From a joint in a body a ray crosses the surface once to three times.
const MOST_CROSSINGS: u64 = 1 << 22;
const CROSSINGS_OF_EACH: u64 = 16 * DIRECTIONS as u64;

/// Large island of a surface of several.
struct Part {
    surface: Surface,
    /// Corners of the box around the island.
    corners: [Vec3; 2],
    /// Unit vector across the island, and the range along it that the island fills: nothing of a flat one.
    across: Vec3,
    range: [f32; 2],
}

impl Part {
    fn build(points: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let mut area = Vec3::ZERO;
        for [a, b, c] in triangles.iter().map(|corners| corners.map(|corner| points[corner as usize])) {
            area += (b - a).cross(c - a);
        }
        let across = area.normalize_or_zero();
        let (mut corners, mut range) = ([Vec3::INFINITY, Vec3::NEG_INFINITY], [f32::INFINITY, f32::NEG_INFINITY]);
        for point in triangles.iter().flatten().map(|corner| points[*corner as usize]) {
            corners = [corners[0].min(point), corners[1].max(point)];
            range = [range[0].min(across.dot(point)), range[1].max(across.dot(point))];
        }
        Self { surface: Surface::build(points, triangles), corners, across, range }
    }

    /// False for places that lie outside of the convex hull of the island. Rays from there which meet the island meet nothing the
    /// other way, so the island is not around such a place.
    fn may_enclose(&self, place: Vec3) -> bool {
        let [low, high] = self.corners;
        let along = self.across.dot(place);
        place.cmpge(low - SLACK).all()
            && place.cmple(high + SLACK).all()
            && along >= self.range[0] - SLACK
            && along <= self.range[1] + SLACK
    }
}

/// A surface that answers lines of sight.
pub(crate) struct Sight {
    whole: Surface,
    /// Large islands of a surface of several, each alone.
    islands: Vec<Option<Part>>,
    /// Indices of the large islands, and a tree over their boxes.
    parts: Vec<u32>,
    boxes: BoneTree,
    /// The island of each point.
    of: Vec<u32>,
    /// Number of places that were compared with islands, and of those that were looked for in one.
    comparisons: AtomicU64,
    looks: AtomicU64,
    /// Places that were looked for in the whole surface, and crossings that were found for them.
    places: AtomicU64,
    crossings: AtomicU64,
}

impl Sight {
    /// Builds the hierarchies; indices must be in range and points finite. Triangles without area hide nothing.
    pub fn new(points: &[Vec3], triangles: &[[u32; 3]], islands: &Islands) -> Self {
        let whole = Surface::build(points, triangles);
        let mut parts = vec![Vec::new(); islands.extents.len()];
        for triangle in triangles {
            parts[islands.of[triangle[0] as usize] as usize].push(*triangle);
        }
        let is_alone = parts.iter().filter(|part| !part.is_empty()).count() < 2;
        let island = |(island, triangles): (usize, &Vec<[u32; 3]>)| {
            let is_part = !is_alone && !triangles.is_empty() && !islands.are_small(island);
            is_part.then(|| Part::build(points, triangles))
        };
        let islands_of = islands.of.clone();
        let islands: Vec<Option<Part>> = parts.par_iter().enumerate().map(island).collect();
        let parts: Vec<u32> = (0..islands.len() as u32).filter(|&island| islands[island as usize].is_some()).collect();
        let diagonal = |&Part { corners: [head, tail], .. }: &Part| BoneSegment { joint: 0, head, tail };
        let diagonals: Vec<BoneSegment> = islands.iter().flatten().map(diagonal).collect();
        let boxes = BoneTree::of_boxes(&diagonals);
        let [comparisons, looks, places, crossings] = [0; 4].map(AtomicU64::new);
        Self { whole, islands, parts, boxes, of: islands_of, comparisons, looks, places, crossings }
    }

    /// True if nothing of its own island lies strictly between a point of the surface and a place: a collar hides no
    /// neck from the head, nor does a shirt hide the arm. Small islands lie inside of others, which do hide them.
    pub fn clear(&self, point: usize, from: Vec3, to: Vec3) -> bool {
        let way = to - from;
        let length = way.length();
        let ray = Ray { origin: from, direction: way / length };
        !self.around(point).crosses(&ray, MARGIN * length, (1.0 - MARGIN) * length)
    }

    /// True if `to`, a place inside the surface, lies on the outer side of the skin at `from`: the way there goes through
    /// the air and enters the surface once more than it leaves it. A soup has no sides.
    pub fn faces_away(&self, point: usize, from: Vec3, to: Vec3) -> bool {
        let mut hits = Vec::new();
        let way = to - from;
        let length = way.length();
        let ray = Ray { origin: from, direction: way / length };
        if !self.around(point).hits_within(&ray, MOST_LEAVES, &mut hits) {
            return false;
        }
        let between = MARGIN * length..(1.0 - MARGIN) * length;
        hits.iter().filter(|hit| between.contains(&hit.distance)).count() % 2 == 1
    }

    fn around(&self, point: usize) -> &Surface {
        self.islands[self.of[point] as usize].as_ref().map_or(&self.whole, |part| &part.surface)
    }

    /// The distance along the unit vector `direction` to the first surface.
    pub fn first(&self, origin: Vec3, direction: Vec3) -> Option<f32> {
        self.whole.closest(&Ray { origin, direction }).map(|hit| hit.distance)
    }

    /// True if the surface is around `point`. A soup is around nothing.
    pub fn encloses(&self, point: Vec3) -> bool {
        if self.crossings.load(Relaxed) > MOST_CROSSINGS + CROSSINGS_OF_EACH * self.places.load(Relaxed) {
            return false;
        }
        let (is_around, crossings) = enclosure(&self.whole, point);
        self.places.fetch_add(1, Relaxed);
        self.crossings.fetch_add(crossings, Relaxed);
        is_around
    }

    /// True if the surface or one of its large islands is around a place: sheets of hair beside a head spoil the count of crossings
    /// of the whole.
    pub fn is_inside(&self, place: Vec3) -> bool {
        self.encloses(place) || self.candidates(place).into_iter().any(|island| self.is_within(island, place))
    }

    /// True if the pieces of a surface of several are around `point` in most directions, though none encloses it: hips between
    /// plates. Below a robe or between two shoes about half of the directions are free.
    pub fn is_amid(&self, point: Vec3) -> bool {
        let meets = |direction: &Vec3| self.first(point, *direction).is_some();
        self.parts().next().is_some() && evenly_spread().filter(meets).count() * 8 > DIRECTIONS * 5
    }

    /// True if a large island is around `point`; of a surface of one island, always. A sheet beside it is not around it, however
    /// wide it is.
    pub fn is_within(&self, island: usize, point: Vec3) -> bool {
        let Some(part) = &self.islands[island] else { return true };
        if !part.may_enclose(point) {
            return false;
        }
        self.looks.fetch_add(1, Relaxed);
        encloses(&part.surface, point) && !stands_aside(&part.surface, point)
    }

    /// The large islands whose boxes are around a place, or nearly so; rising.
    pub fn boxes_around(&self, place: Vec3) -> Vec<usize> {
        let mut near = Vec::new();
        self.boxes.any_within(place, SLACK, |part| {
            self.comparisons.fetch_add(1, Relaxed);
            near.push(self.parts[part as usize] as usize);
            false
        });
        near.sort_unstable();
        near
    }

    /// The large islands that may be around a place; rising.
    pub fn candidates(&self, place: Vec3) -> Vec<usize> {
        let mut near = self.boxes_around(place);
        near.retain(|&island| self.islands[island].as_ref().is_some_and(|part| part.may_enclose(place)));
        near
    }

    /// True if more places were looked for in islands than a surface with so many joints has sense in: shells in shells, without
    /// end.
    pub fn is_crowded(&self, joints: usize) -> bool {
        self.searches() > DIRECTIONS as u64 * (MOST_LOOKS + LOOKS_OF_EACH * (self.parts.len() + joints) as u64)
    }

    /// Work so far: crossings, places that were compared with islands, and rays for those that were looked for.
    pub fn work(&self) -> u64 {
        self.crossings.load(Relaxed) + self.searches()
    }

    fn searches(&self) -> u64 {
        self.comparisons.load(Relaxed) + DIRECTIONS as u64 * self.looks.load(Relaxed)
    }

    /// True if something of a large island lies between two places.
    pub fn is_between(&self, island: usize, from: Vec3, to: Vec3) -> bool {
        let length = from.distance(to);
        let ray = Ray { origin: from, direction: (to - from) / length };
        length > 0.0 && self.islands[island].as_ref().is_some_and(|part| part.surface.crosses(&ray, 0.0, length))
    }

    /// The large islands of a surface of several.
    pub fn parts(&self) -> impl Iterator<Item = usize> {
        self.parts.iter().map(|&part| part as usize)
    }

    /// Distance from a place to the surface; `None` without triangles.
    pub fn gap(&self, place: Vec3) -> Option<f32> {
        self.whole.closest_point(place).map(|nearest| nearest.distance)
    }

    /// The place of the surface that is nearest to a place; `None` without triangles.
    pub fn nearest(&self, place: Vec3) -> Option<Vec3> {
        self.whole.closest_point(place).map(|nearest| nearest.point)
    }

    /// Box around a large island; `None` for others.
    pub fn corners(&self, island: usize) -> Option<[Vec3; 2]> {
        self.islands[island].as_ref().map(|part| part.corners)
    }

    /// Distance from a place to a large island; infinite to others.
    pub fn distance(&self, island: usize, place: Vec3) -> f32 {
        self.comparisons.fetch_add(1, Relaxed);
        let nearest = self.islands[island].as_ref().and_then(|part| part.surface.closest_point(place));
        nearest.map_or(f32::INFINITY, |nearest| nearest.distance)
    }

    /// Number of islands.
    pub fn islands(&self) -> usize {
        self.islands.len()
    }

    /// The island of a point.
    pub fn island(&self, point: usize) -> usize {
        self.of[point] as usize
    }
}

/// True if a surface is around `point`, by two measures over evenly spread rays, each of which some damage spoils. A soup is around
/// nothing.
///
/// The mean of signed crossings is the generalised winding number (Jacobson et al. 2013), which holes weaken and shells
/// inside each other strengthen, but which needs triangles of one orientation. The share of rays with an odd number of
/// crossings does not.
pub(super) fn encloses(surface: &Surface, point: Vec3) -> bool {
    enclosure(surface, point).0
}

/// Flag of whether a surface is around `point`, and the number of crossings that tell it.
fn enclosure(surface: &Surface, point: Vec3) -> (bool, u64) {
    let (mut winding, mut odd, mut crossings) = (0i32, 0usize, 0);
    let mut hits = Vec::new();
    for direction in evenly_spread() {
        if !surface.hits_within(&Ray { origin: point, direction }, MOST_LEAVES, &mut hits) {
            return (false, crossings + MOST_LEAVES as u64);
        }
        crossings += hits.len() as u64;
        winding += hits.iter().map(|hit| if hit.entering { -1 } else { 1 }).sum::<i32>();
        odd += hits.len() % 2;
    }
    (winding.unsigned_abs() as usize * 3 > DIRECTIONS || odd * 8 > DIRECTIONS * 5, crossings)
}

/// True if a surface is around `place` in nearly all directions, as around teeth; a mouth may stand open.
pub(super) fn is_surrounded(surface: &Surface, place: Vec3) -> bool {
    let misses = |direction: &Vec3| surface.closest(&Ray { origin: place, direction: *direction }).is_none();
    evenly_spread().filter(misses).nth(DIRECTIONS / 8).is_none()
}

/// True if a surface stands on one side of `place`, as a cape behind a back: of the rays that meet it, most meet nothing the other
/// way. A wide sheet has a winding number of nearly a half beside it.
fn stands_aside(surface: &Surface, place: Vec3) -> bool {
    let meets = |direction: &Vec3| surface.closest(&Ray { origin: place, direction: *direction }).is_some();
    let (mut met, mut met_twice) = (0, 0);
    for direction in evenly_spread().filter(meets) {
        met += 1;
        met_twice += usize::from(meets(&-direction));
    }
    4 * met_twice < met
}

/// Unit vectors on a spherical Fibonacci lattice. The golden angle is turned by repeated complex multiplication, so no
/// sine is needed.
fn evenly_spread() -> impl Iterator<Item = Vec3> {
    const COS: f32 = -0.737_368_9;
    const SIN: f32 = 0.675_490_3;
    let mut turn = (1.0f32, 0.0f32);
    (0..DIRECTIONS).map(move |i| {
        let y = 1.0 - (2 * i + 1) as f32 / DIRECTIONS as f32;
        let radius = (1.0 - y * y).max(0.0).sqrt();
        turn = (turn.0 * COS - turn.1 * SIN, turn.0 * SIN + turn.1 * COS);
        Vec3::new(radius * turn.0, y, radius * turn.1)
    })
}
