//! Head of a quadruped: spheres about its snout, and the search for the snout's end.

use glam::Vec3;

use super::{Body, Cut, PLANES, neck};
use crate::mesh::adjacency;

/// Largest distance of the neck, as a share of the distance to the farthest place.
const FARTHEST: f32 = 0.55;
/// Widening of a ring, relative to the shortest one, at which a quadruped's neck ends.
const WIDENS: f32 = 1.06;
/// Least length of a head's rings, as a share of the longest ring up to its neck: a nose alone is no head.
const HEAD: f32 = 0.4;
/// Largest height of feet, as a share of the body's height.
const FEET: f32 = 0.12;
/// Distance at which the ends of a quadruped begin, as a share of its half length.
const END: f32 = 0.4;

/// Intersection of a sphere about the snout with the part connected to the snout.
#[derive(Debug, Clone, Copy)]
struct Ring {
    center: Vec3,
    length: f32,
}

/// Cuts a quadruped that looks along +z behind its head.
pub(super) fn cut(body: &Body) -> Option<Cut> {
    let tip = tip(body)?;
    let from = body.places[tip];
    let away: Vec<f32> = body.places.iter().map(|place| place.distance(from)).collect();
    // Wings do not count.
    let farthest = body.places.iter().map(|place| (*place - from).with_x(0.0).length()).fold(0.0, f32::max);
    let rings = rings(body, &away, tip, farthest);
    let lengths: Vec<f32> = rings.iter().map(|ring| ring.length).collect();
    // A head does not reach to the feet.
    let ground = body.low.y + FEET * body.size().y;
    let feet = body.places.iter().zip(&away).filter(|(place, _)| place.y < ground).map(|(_, away)| *away);
    let last = (feet.fold(f32::MAX, f32::min) / farthest).min(FARTHEST) * PLANES as f32;
    let (_, end) = neck(&lengths, last as usize, HEAD, WIDENS)?;
    let center = rings.get(end)?.center;
    let reach = farthest * (end + 1) as f32 / PLANES as f32;
    let toward = (from - center).try_normalize()?;
    Some(Cut { away, reach, tip, plane: (center, toward) })
}

/// Height of the middle of a quadruped's front end (+z) above the middle of its back end, as a share of the body's height:
/// a head is carried higher than a rump or a tail. `None` if the body does not stand on legs, or is upright.
pub fn carriage(body: &Body) -> Option<f32> {
    let size = body.size();
    if size.is_nan() || size.min_element() <= 0.0 || body.is_biped() || !body.stands(None) {
        return None;
    }
    let middle = (body.low + body.high) * 0.5;
    let strip = 0.1 * size.x.min(size.y);
    let top = |sign: f32| {
        let own =
            |place: &&Vec3| (place.x - middle.x).abs() < strip && sign * (place.z - middle.z) > 0.5 * END * size.z;
        body.places.iter().filter(own).map(|place| place.y).fold(body.low.y, f32::max)
    };
    Some((top(1.0) - top(-1.0)) / size.y)
}

/// The snout: a place far out along z, high, and in the middle.
fn tip(body: &Body) -> Option<usize> {
    let (island_of, islands) = adjacency::islands(&body.joined, body.places.len());
    let areas = body.areas(&body.joined, &island_of, islands);
    let largest = (0..islands).max_by(|a, b| areas[*a].total_cmp(&areas[*b]))?;
    let middle = (body.low.x + body.high.x) * 0.5;
    let worth = |place: usize| {
        let at = body.places[place];
        at.z + 0.5 * at.y - 0.5 * (at.x - middle).abs()
    };
    (0..body.places.len())
        .filter(|place| island_of[*place] as usize == largest)
        .max_by(|a, b| worth(*a).total_cmp(&worth(*b)))
}

/// Rings at equal steps from the tip to `farthest`, of triangles that are connected with the tip on its side.
fn rings(body: &Body, away: &[f32], tip: usize, farthest: f32) -> Vec<Ring> {
    let ends = |triangle: &[u32; 3]| {
        let at = triangle.map(|corner| away[corner as usize]);
        (at[0].min(at[1]).min(at[2]), at[0].max(at[1]).max(at[2]))
    };
    let mut order: Vec<usize> = (0..body.joined.len()).collect();
    order.sort_by(|a, b| ends(&body.joined[*a]).1.total_cmp(&ends(&body.joined[*b]).1));
    let mut joined = JoinedPlaces((0..body.places.len() as u32).collect());
    let mut next = 0;
    let mut rings = Vec::with_capacity(PLANES);
    for step in 1..=PLANES {
        let level = farthest * step as f32 / PLANES as f32;
        while let Some(triangle) = order.get(next).map(|index| &body.joined[*index])
            && ends(triangle).1 <= level
        {
            joined.join(triangle[0], triangle[1]);
            joined.join(triangle[1], triangle[2]);
            next += 1;
        }
        let head = joined.root(tip as u32);
        let (mut sum, mut length) = (Vec3::ZERO, 0.0);
        for triangle in order[next..].iter().map(|index| &body.joined[*index]) {
            if ends(triangle).0 > level {
                continue;
            }
            let mut crossing = [Vec3::ZERO; 2];
            let mut found = 0;
            let mut own = false;
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                let (a, b) = (triangle[a], triangle[b]);
                let (da, db) = (away[a as usize], away[b as usize]);
                if (da <= level) != (db <= level) && found < 2 {
                    own |= joined.root(if da <= level { a } else { b }) == head;
                    crossing[found] = body.places[a as usize].lerp(body.places[b as usize], (level - da) / (db - da));
                    found += 1;
                }
            }
            if found == 2 && own {
                let part = crossing[0].distance(crossing[1]);
                sum += (crossing[0] + crossing[1]) * 0.5 * part;
                length += part;
            }
        }
        rings.push(Ring { center: sum / f32::max(length, f32::MIN_POSITIVE), length });
    }
    rings
}

/// Union-find of connected places.
struct JoinedPlaces(Vec<u32>);

impl JoinedPlaces {
    fn root(&mut self, mut place: u32) -> u32 {
        while self.0[place as usize] != place {
            let above = self.0[self.0[place as usize] as usize];
            self.0[place as usize] = above;
            place = above;
        }
        place
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}
