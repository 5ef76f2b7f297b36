//! Caps: triangles that close the holes of a mesh, so that its volume is that of the whole body.
//!
//! A hole is a ring of edges that one triangle uses each. It is closed where it is small beside the island that it lies in;
//! the rim of a sheet (a cape, a feather, a loose triangle) stays open.

use std::collections::BTreeMap;

use glam::{DVec3, Vec3};

use crate::mesh::adjacency;

/// Square of a hole's length above which it stays open, in areas of its island. A flat or rolled sheet has at least 12.6
/// (that of a disc), a half sphere 6.3, a box without one face 3.2.
const WIDEST: f64 = 9.0;

/// Closes the small holes of `triangles`, whose points are welded; adds points in the middle of rings of more than four edges.
pub(super) fn close_holes(points: &mut Vec<Vec3>, triangles: &mut Vec<[u32; 3]>) {
    let rings = rings(triangles);
    if rings.is_empty() {
        return;
    }
    let (islands, count) = adjacency::islands(triangles, points.len());
    let mut areas = vec![0.0f64; count];
    for t in triangles.iter() {
        let [a, b, c] = t.map(|corner| points[corner as usize].as_dvec3());
        areas[islands[t[0] as usize] as usize] += 0.5 * (b - a).cross(c - a).length();
    }
    for ring in rings {
        let at = |place: usize| points[ring[place % ring.len()] as usize].as_dvec3();
        let length: f64 = (0..ring.len()).map(|place| at(place).distance(at(place + 1))).sum();
        let area = areas[islands[ring[0] as usize] as usize];
        let is_small = length * length <= WIDEST * area;
        if !is_small {
            continue;
        }
        match *ring {
            [a, b, c] => triangles.push([a, b, c]),
            [a, b, c, d] if at(0).distance_squared(at(2)) <= at(1).distance_squared(at(3)) => {
                triangles.extend([[a, b, c], [a, c, d]]);
            }
            [a, b, c, d] => triangles.extend([[a, b, d], [b, c, d]]),
            _ => {
                let middle = (0..ring.len()).map(at).sum::<DVec3>() / ring.len() as f64;
                let centre = points.len() as u32;
                triangles.extend((0..ring.len()).map(|place| [ring[place], ring[(place + 1) % ring.len()], centre]));
                points.push(middle.as_vec3());
            }
        }
    }
}

/// Rings of edges that one triangle uses each, against the direction of that triangle, so that triangles on them face as
/// their neighbours do.
fn rings(triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let ends = |t: &[u32; 3], corner: usize| (t[corner], t[(corner + 1) % 3]);
    let mut uses: Vec<((u32, u32), (u32, u32))> = Vec::with_capacity(3 * triangles.len());
    for t in triangles {
        uses.extend((0..3).map(|corner| ends(t, corner)).map(|(a, b)| ((a.min(b), a.max(b)), (b, a))));
    }
    uses.sort_unstable();
    let single = uses.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() == 1).map(|same| same[0].1);
    let mut next: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (from, to) in single {
        next.entry(from).or_default().push(to);
    }
    let mut rings = Vec::new();
    let mut place_of: BTreeMap<u32, usize> = BTreeMap::new();
    while let Some((&start, _)) = next.first_key_value() {
        // A walk along unused edges; where it meets itself a ring is cut off, and what led there goes on.
        let mut path = vec![start];
        place_of.clear();
        place_of.insert(start, 0);
        while let Some(&here) = path.last() {
            let Some(ways) = next.get_mut(&here) else { break };
            let to = ways.pop();
            if ways.is_empty() {
                next.remove(&here);
            }
            let Some(to) = to else { break };
            if let Some(&place) = place_of.get(&to) {
                let ring = path.split_off(place);
                ring.iter().for_each(|point| {
                    place_of.remove(point);
                });
                if ring.len() > 2 {
                    rings.push(ring);
                }
                path.push(to);
                place_of.insert(to, place);
            } else {
                place_of.insert(to, path.len());
                path.push(to);
            }
        }
    }
    rings
}
