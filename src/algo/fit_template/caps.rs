//! Caps: triangles that close the holes of a mesh, so that its volume is that of the whole body.
//!
//! A hole is a ring of edges that one triangle uses each. It is closed where it is small beside the island that it lies in;
//! the rim of a sheet (a cape, a feather, a loose triangle) stays open. A short ring is what a few missing faces leave: of all
//! its triangulations the one is taken that bends least against the faces around it (Liepa 2003, "Filling holes in meshes"),
//! which for most rings restores those faces. A mesh that is the same on both sides of a plane tells more: faces whose images
//! lie across a hole's image come before all others.

use std::collections::BTreeMap;

use bevy::math::ops;
use glam::{DVec3, Vec3};

use super::images;
use crate::mesh::adjacency;

/// Square of a hole's length above which it stays open, in areas of its island. A flat or rolled sheet has at least 12.6
/// (that of a disc), a half sphere 6.3, a box without one face 3.2.
const WIDEST: f64 = 9.0;
/// Most edges of a ring whose triangulations are tried; the work grows with the cube of their number.
const SHORT: usize = 12;
/// Mean angle, in radians, by which the least bent triangulation of a ring bends along it, above which the ring is an opening that
/// was made, such as a sleeve, and not what missing faces leave.
const STEEP: f32 = 1.2;

/// Closes the small holes of `triangles`, whose points are welded; adds points in the middle of long rings.
pub(super) fn close_holes(points: &mut Vec<Vec3>, triangles: &mut Vec<[u32; 3]>) {
    let rims = rims(triangles);
    if rims.is_empty() {
        return;
    }
    let rings = rings(points, triangles, &rims);
    let opposite = Opposite::of(points, triangles, &rings);
    let (islands, count) = adjacency::islands(triangles, points.len());
    let mut areas = vec![0.0f64; count];
    for t in triangles.iter() {
        areas[islands[t[0] as usize] as usize] += 0.5 * cross(points, *t).length();
    }
    let mut caps = Vec::new();
    for ring in rings {
        let at = |place: usize| points[ring[place % ring.len()] as usize].as_dvec3();
        let length: f64 = (0..ring.len()).map(|place| at(place).distance(at(place + 1))).sum();
        let area = areas[islands[ring[0] as usize] as usize];
        let is_small = length * length <= WIDEST * area;
        if !is_small {
            continue;
        }
        if ring.len() <= SHORT {
            let Cap { unmatched, bend, faces } = flattest(points, triangles, &rims, &opposite, &ring);
            if ring.len() <= 4 || unmatched == 0 || bend <= STEEP * length as f32 {
                caps.extend(faces);
                continue;
            }
        }
        let middle = (0..ring.len()).map(at).sum::<DVec3>() / ring.len() as f64;
        let centre = points.len() as u32;
        caps.extend((0..ring.len()).map(|place| [ring[place], ring[(place + 1) % ring.len()], centre]));
        points.push(middle.as_vec3());
    }
    triangles.append(&mut caps);
}

/// Product of two edges of a triangle: its normal times twice its area.
fn cross(points: &[Vec3], corners: [u32; 3]) -> DVec3 {
    let [a, b, c] = corners.map(|corner| points[corner as usize].as_dvec3());
    (b - a).cross(c - a)
}

/// The faces of a mesh that has a plane of symmetry.
#[derive(Default)]
struct Opposite {
    /// Image of each point; none without a plane of symmetry.
    images: Vec<u32>,
    /// Faces, each from its least corner on, in order.
    faces: Vec<[u32; 3]>,
}

impl Opposite {
    /// The faces of a mesh that has rings which may be closed in more than one way.
    fn of(points: &[Vec3], triangles: &[[u32; 3]], rings: &[Vec<u32>]) -> Self {
        if !rings.iter().any(|ring| (4..=SHORT).contains(&ring.len())) {
            return Self::default();
        }
        let Some(images) = images::images(points) else { return Self::default() };
        let mut faces: Vec<[u32; 3]> = triangles.iter().map(|face| from_least(*face)).collect();
        faces.sort_unstable();
        Self { images, faces }
    }

    /// True if the image of a triangle is a face.
    fn has(&self, corners: [u32; 3]) -> bool {
        let image = |corner: u32| self.images.get(corner as usize).copied().unwrap_or(u32::MAX);
        let [a, b, c] = corners.map(image);
        !self.images.is_empty() && self.faces.binary_search(&from_least([a, c, b])).is_ok()
    }
}

/// A face from its least corner on.
fn from_least([a, b, c]: [u32; 3]) -> [u32; 3] {
    match a.min(b).min(c) {
        least if least == a => [a, b, c],
        least if least == b => [b, c, a],
        _ => [c, a, b],
    }
}

/// Triangulation of a ring.
struct Cap {
    /// Number of its triangles whose images are no faces.
    unmatched: u32,
    /// Sum of the angles along its edges, times their lengths.
    bend: f32,
    faces: Vec<[u32; 3]>,
}

/// The triangulation of a short ring that bends least of those with the most triangles whose images are faces: the least sum of
/// angles between triangles, times the lengths of the edges between them.
fn flattest(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    rims: &BTreeMap<(u32, u32), u32>,
    opposite: &Opposite,
    ring: &[u32],
) -> Cap {
    let count = ring.len();
    let corners = |[i, m, k]: [usize; 3]| [ring[i], ring[m], ring[k]];
    let bend = |edge: [usize; 2], a: DVec3, b: DVec3| {
        let [from, to] = edge.map(|place| points[ring[place] as usize]);
        let cosine = a.normalize_or_zero().dot(b.normalize_or_zero()).clamp(-1.0, 1.0);
        ops::acos(cosine as f32) * from.distance(to)
    };
    // The triangle beyond an edge of the ring.
    let beyond = |from: usize, to: usize| {
        let triangle = rims.get(&(ring[from], ring[to])).and_then(|triangle| triangles.get(*triangle as usize));
        triangle.map_or(DVec3::ZERO, |triangle| cross(points, *triangle))
    };
    // For the part of the ring from one place to another: the fewest triangles without an image, the least sum, and the place that
    // forms a triangle with both.
    let mut best = vec![(0u32, 0.0f32, 0usize); count * count];
    for span in 2..count {
        for first in 0..count - span {
            let last = first + span;
            let mut least = (u32::MAX, f32::INFINITY, first + 1);
            for middle in first + 1..last {
                let face = corners([first, middle, last]);
                let normal = cross(points, face);
                let over = |from: usize, to: usize| {
                    let (unmatched, sum, apex) = best[from * count + to];
                    let other = match to - from {
                        1 => beyond(from, to),
                        _ => cross(points, corners([from, apex, to])),
                    };
                    (unmatched, sum + bend([from, to], normal, other))
                };
                let (before, after) = (over(first, middle), over(middle, last));
                let unmatched = before.0 + after.0 + u32::from(!opposite.has(face));
                let mut sum = before.1 + after.1;
                if span == count - 1 {
                    sum += bend([last, first], normal, beyond(last, first));
                }
                if unmatched < least.0 || unmatched == least.0 && sum < least.1 {
                    least = (unmatched, sum, middle);
                }
            }
            best[first * count + last] = least;
        }
    }
    let mut faces = Vec::with_capacity(count.saturating_sub(2));
    let mut open = vec![(0, count - 1)];
    while let Some((first, last)) = open.pop() {
        if last > first + 1 {
            let middle = best[first * count + last].2;
            faces.push(corners([first, middle, last]));
            open.extend([(first, middle), (middle, last)]);
        }
    }
    let (unmatched, bend, _) = best[count - 1];
    Cap { unmatched, bend, faces }
}

/// Edges that one triangle uses, against the direction of that triangle, with its number.
fn rims(triangles: &[[u32; 3]]) -> BTreeMap<(u32, u32), u32> {
    let mut uses: Vec<((u32, u32), (u32, u32), u32)> = Vec::with_capacity(3 * triangles.len());
    for (number, t) in triangles.iter().enumerate() {
        let ends = (0..3).map(|corner| (t[corner], t[(corner + 1) % 3]));
        uses.extend(ends.map(|(a, b)| ((a.min(b), a.max(b)), (b, a), number as u32)));
    }
    uses.sort_unstable();
    let single = uses.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() == 1);
    single.map(|same| (same[0].1, same[0].2)).collect()
}

/// Rings of such edges, so that triangles on them face as their neighbours do. Where holes touch at a point, each ring goes on
/// around its own hole.
fn rings(points: &[Vec3], triangles: &[[u32; 3]], rims: &BTreeMap<(u32, u32), u32>) -> Vec<Vec<u32>> {
    let mut next: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for &(from, to) in rims.keys() {
        next.entry(from).or_default().push(to);
    }
    let mut normals: BTreeMap<u32, DVec3> =
        next.iter().filter(|(_, ways)| ways.len() > 1).map(|(point, _)| (*point, DVec3::ZERO)).collect();
    let faces = if normals.is_empty() { &[] } else { triangles };
    for t in faces {
        let normal = cross(points, *t);
        for corner in t {
            if let Some(sum) = normals.get_mut(corner) {
                *sum += normal;
            }
        }
    }
    // Angle from one edge to another across the hole between them, which lies clockwise of the first.
    let across = |from: u32, here: u32, to: u32| {
        let normal = normals.get(&here).map_or(DVec3::ZERO, |sum| sum.normalize_or_zero());
        let [from, here, to] = [from, here, to].map(|point| points[point as usize].as_dvec3());
        let (from, to) = (from - here, to - here);
        let level = from.dot(to) - from.dot(normal) * to.dot(normal);
        let angle = ops::atan2(to.cross(from).dot(normal) as f32, level as f32);
        if angle > 0.0 { angle } else { angle + std::f32::consts::TAU }
    };
    let mut rings = Vec::new();
    let mut place_of: BTreeMap<u32, usize> = BTreeMap::new();
    while let Some((&start, _)) = next.first_key_value() {
        // A walk along unused edges; where it meets itself a ring is cut off, and what led there goes on.
        let mut path = vec![start];
        place_of.clear();
        place_of.insert(start, 0);
        while let Some(&here) = path.last() {
            let Some(ways) = next.get_mut(&here) else { break };
            if let [.., before, _] = *path.as_slice() {
                ways.sort_by(|a, b| across(before, here, *b).total_cmp(&across(before, here, *a)));
            }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// An octahedron, twice subdivided onto an ellipsoid.
    fn ellipsoid() -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let mut points = vec![Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
        let mut faces: Vec<[u32; 3]> = Vec::new();
        for octant in 0..8u32 {
            let [x, y, z] = [octant & 1, 2 + (octant >> 1 & 1), 4 + (octant >> 2)];
            let is_even = octant.count_ones() % 2 == 0;
            faces.push(if is_even { [x, y, z] } else { [x, z, y] });
        }
        for _ in 0..2 {
            let mut middles = BTreeMap::new();
            let mut finer = Vec::new();
            for [a, b, c] in faces {
                let mut middle = |a: u32, b: u32| {
                    *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                        points.push(points[a as usize].midpoint(points[b as usize]).normalize());
                        points.len() as u32 - 1
                    })
                };
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
            }
            faces = finer;
        }
        (points.into_iter().map(|point| point * Vec3::new(1.0, 0.7, 1.6)).collect(), faces)
    }

    /// Faces, each from its least corner on, in order.
    fn in_order(faces: &[[u32; 3]]) -> Vec<[u32; 3]> {
        let mut faces: Vec<[u32; 3]> = faces.iter().map(|face| from_least(*face)).collect();
        faces.sort_unstable();
        faces
    }

    /// The ellipsoid with one side dented, so that no plane of symmetry tells what is missing.
    fn dented() -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let (points, faces) = ellipsoid();
        let dent = |point: Vec3| point - Vec3::new(1.0, 0.7, 0.4) * (2e-3 * (point.dot(Vec3::ONE)).max(0.0));
        (points.into_iter().map(dent).collect(), faces)
    }

    /// Closes the holes that missing faces leave, and compares the mesh with the whole one.
    #[track_caller]
    fn check_restored(missing: &[usize]) {
        for (mut points, faces) in [ellipsoid(), dented()] {
            let count = points.len();
            let left = faces.iter().enumerate().filter(|(number, _)| !missing.contains(number));
            let mut left: Vec<[u32; 3]> = left.map(|(_, face)| *face).collect();
            close_holes(&mut points, &mut left);
            assert_eq!(points.len(), count, "{missing:?}");
            assert_eq!(in_order(&left), in_order(&faces), "{missing:?}");
        }
    }

    /// Two faces on each side share the more bent one of their diagonals: those of one side are restored by those of the other.
    #[test]
    fn faces_on_the_other_side_tell_what_is_missing() {
        let (points, mut faces) = ellipsoid();
        let images = images::images(&points).unwrap();
        let is_apart = |face: &&[u32; 3]| face.iter().all(|corner| points[*corner as usize].min_element() > 0.1);
        let [a, b, c] = *faces.iter().find(is_apart).unwrap();
        let opposite = [a, b, c].map(|corner| images[corner as usize]);
        let beyond = |from: u32, to: u32, inner: u32| {
            let own = faces.iter().find(|face| face.contains(&from) && face.contains(&to) && !face.contains(&inner));
            *own.unwrap().iter().find(|corner| **corner != from && **corner != to).unwrap()
        };
        let d = beyond(a, b, c);
        let image = images[d as usize];
        assert!(opposite.iter().all(|corner| ![a, b, c, d].contains(corner)) && image != d);
        faces.retain(|face| ![a, b].iter().all(|corner| face.contains(corner)));
        faces.retain(|face| !opposite[..2].iter().all(|corner| face.contains(corner)));
        let [e, f, g] = opposite;
        faces.extend([[e, g, image], [image, g, f]]);
        let whole: Vec<[u32; 3]> = faces.iter().copied().chain([[a, d, c], [d, b, c]]).collect();
        let closed = |mut points: Vec<Vec3>| {
            let mut left = faces.clone();
            close_holes(&mut points, &mut left);
            in_order(&left)
        };
        assert_eq!(closed(points.clone()), in_order(&whole));
        let (dented, _) = dented();
        assert!(images::images(&dented).is_none());
        assert_ne!(closed(dented), in_order(&whole));
    }

    fn common_corners(a: [u32; 3], b: [u32; 3]) -> usize {
        a.iter().filter(|corner| b.contains(corner)).count()
    }

    #[test]
    fn strips_of_missing_faces_are_restored() {
        let (_, faces) = ellipsoid();
        let beside = |one: usize| (0..faces.len()).filter(move |&other| other != one);
        for first in 0..faces.len() {
            for second in beside(first).filter(|&other| common_corners(faces[first], faces[other]) == 2) {
                check_restored(&[first, second]);
                let third = beside(second).filter(|&other| common_corners(faces[second], faces[other]) == 2);
                for third in third.filter(|third| *third != first) {
                    check_restored(&[first, second, third]);
                }
            }
        }
    }

    #[test]
    fn holes_that_touch_are_closed_apart() {
        let (_, faces) = ellipsoid();
        for first in 0..faces.len() {
            for second in (0..first).filter(|&other| common_corners(faces[first], faces[other]) == 1) {
                check_restored(&[first, second]);
                let is_apart = |third: &usize| {
                    [first, second].iter().all(|other| common_corners(faces[*third], faces[*other]) == 1)
                };
                for third in (0..second).filter(is_apart) {
                    check_restored(&[first, second, third]);
                }
            }
        }
    }
}
