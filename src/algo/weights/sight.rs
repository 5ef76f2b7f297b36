//! Lines of sight through a triangle soup: is a segment clear, where does a ray first meet a surface, is a point
//! inside.
//!
//! Every answer is the same for either orientation of the triangles, so shells that are inside-out cause no trouble.

use glam::Vec3;
use rayon::prelude::*;

use super::islands::Islands;
use crate::mesh::{ray::Ray, surface::Surface};

/// Directions in which [`encloses`] looks.
const DIRECTIONS: usize = 32;
/// The share of a segment at either end in which nothing blocks it: the surface the point lies on.
const MARGIN: f32 = 1e-3;
/// Leaves of a hierarchy that a ray through a body may meet. Through a mesh of a million triangles it meets some dozens; in a
/// soup of triangles from everywhere to everywhere it meets a share of all, and which side it is on has no meaning.
const MOST_LEAVES: usize = 1024;

/// A surface that answers lines of sight.
pub(crate) struct Sight {
    whole: Surface,
    /// Large islands of a surface of several, each alone.
    islands: Vec<Option<Surface>>,
    /// The island of each point.
    of: Vec<u32>,
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
            is_part.then(|| Surface::build(points, triangles))
        };
        let islands_of = islands.of.clone();
        let islands = parts.par_iter().enumerate().map(island).collect();
        Self { whole, islands, of: islands_of }
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
        self.islands[self.of[point] as usize].as_ref().unwrap_or(&self.whole)
    }

    /// The distance along the unit vector `direction` to the first surface.
    pub fn first(&self, origin: Vec3, direction: Vec3) -> Option<f32> {
        self.whole.closest(&Ray { origin, direction }).map(|hit| hit.distance)
    }

    /// True if the surface is around `point`.
    pub fn encloses(&self, point: Vec3) -> bool {
        encloses(&self.whole, point)
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
        self.islands[island].as_ref().is_none_or(|island| encloses(island, point) && !stands_aside(island, point))
    }

    /// True if something of a large island lies between two places.
    pub fn is_between(&self, island: usize, from: Vec3, to: Vec3) -> bool {
        let length = from.distance(to);
        let ray = Ray { origin: from, direction: (to - from) / length };
        length > 0.0 && self.islands[island].as_ref().is_some_and(|island| island.crosses(&ray, 0.0, length))
    }

    /// The large islands of a surface of several.
    pub fn parts(&self) -> impl Iterator<Item = usize> {
        (0..self.islands.len()).filter(|island| self.islands[*island].is_some())
    }

    /// Distance from a place to the surface; `None` without triangles.
    pub fn gap(&self, place: Vec3) -> Option<f32> {
        self.whole.closest_point(place).map(|nearest| nearest.distance)
    }

    /// The place of the surface that is nearest to a place; `None` without triangles.
    pub fn nearest(&self, place: Vec3) -> Option<Vec3> {
        self.whole.closest_point(place).map(|nearest| nearest.point)
    }

    /// Distance from a place to a large island; infinite to others.
    pub fn distance(&self, island: usize, place: Vec3) -> f32 {
        let nearest = self.islands[island].as_ref().and_then(|island| island.closest_point(place));
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

/// True if a surface is around `point`, by two measures over evenly spread rays, each of which some damage spoils.
///
/// The mean of signed crossings is the generalised winding number (Jacobson et al. 2013), which holes weaken and shells
/// inside each other strengthen, but which needs triangles of one orientation. The share of rays with an odd number of
/// crossings does not.
fn encloses(surface: &Surface, point: Vec3) -> bool {
    let (mut winding, mut odd) = (0i32, 0usize);
    let mut hits = Vec::new();
    for direction in evenly_spread() {
        surface.hits(&Ray { origin: point, direction }, &mut hits);
        winding += hits.iter().map(|hit| if hit.entering { -1 } else { 1 }).sum::<i32>();
        odd += hits.len() % 2;
    }
    winding.unsigned_abs() as usize * 3 > DIRECTIONS || odd * 8 > DIRECTIONS * 5
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
