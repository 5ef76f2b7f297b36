//! Figures given in another way: turned, with its points in another order, with other diagonals, with more faces, and
//! with specks around it.

use std::collections::{BTreeMap, BTreeSet};

use bevy::math::{Mat3, Quat, Vec3};

use super::Random;

/// Points and triangles.
pub type Mesh = (Vec<Vec3>, Vec<[u32; 3]>);

/// Cosine of the angle between the normals of two triangles within which their common side is a mere diagonal.
const PLANE: f32 = 0.98;

/// The 24 turns that put axes onto axes.
pub fn right_turns() -> Vec<Mat3> {
    let axes = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
    let pairs = axes.iter().flat_map(|a| axes.iter().map(move |b| (*a, *b))).filter(|(a, b)| a.dot(*b) == 0.0);
    pairs.map(|(a, b)| Mat3::from_cols(a, b, a.cross(b))).collect()
}

/// Ten turns that put axes onto no axes.
pub fn odd_turns(random: &mut Random) -> Vec<Mat3> {
    let mut part = || random.unit() - 0.5;
    (0..10).map(|_| Mat3::from_quat(Quat::from_xyzw(part(), part(), part(), part()).normalize())).collect()
}

/// The same triangles over points in another order.
pub fn with_points_shuffled(points: &[Vec3], triangles: &[[u32; 3]], random: &mut Random) -> Mesh {
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    random.shuffle(&mut order);
    let mut others = points.to_vec();
    order.iter().zip(points).for_each(|(to, point)| others[*to as usize] = *point);
    let faces = triangles.iter().map(|corners| corners.map(|corner| order[corner as usize])).collect();
    (others, faces)
}

/// The same surface triangulated otherwise: two triangles that lie nearly in a plane share the other diagonal.
pub fn with_other_diagonals(points: &[Vec3], triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    // Triangles with corners of their own share sides where these lie at one place.
    let mut first: BTreeMap<[u32; 3], u32> = BTreeMap::new();
    let mut welded = |corner: u32| *first.entry(points[corner as usize].to_array().map(f32::to_bits)).or_insert(corner);
    let triangles: Vec<[u32; 3]> = triangles.iter().map(|corners| corners.map(&mut welded)).collect();
    let key = |a: u32, b: u32| (a.min(b), a.max(b));
    let mut sides: BTreeMap<(u32, u32), Vec<(usize, usize)>> = BTreeMap::new();
    for (number, corners) in triangles.iter().enumerate() {
        for side in 0..3 {
            sides.entry(key(corners[side], corners[(side + 1) % 3])).or_default().push((number, side));
        }
    }
    let normal = |corners: [u32; 3]| {
        let [a, b, c] = corners.map(|corner| points[corner as usize]);
        (b - a).cross(c - a)
    };
    let mut known: BTreeSet<(u32, u32)> = sides.keys().copied().collect();
    let mut faces = triangles.clone();
    let mut is_turned = vec![false; triangles.len()];
    for pair in sides.values() {
        let &[(one, side), (two, other)] = pair.as_slice() else { continue };
        let [a, b, c] = [0, 1, 2].map(|next| triangles[one][(side + next) % 3]);
        let d = triangles[two][(other + 2) % 3];
        // Each triangle once, and no side that is there already.
        let is_free = !is_turned[one] && !is_turned[two] && c != d && !known.contains(&key(c, d));
        if !is_free || triangles[two][other] != b {
            continue;
        }
        let (first, second) = (normal(triangles[one]), normal(triangles[two]));
        let is_plane = first.dot(second) > PLANE * first.length() * second.length();
        let turned = [[a, d, c], [b, c, d]];
        if is_plane && turned.iter().all(|corners| normal(*corners).dot(first + second) > 0.0) {
            for (number, corners) in [one, two].into_iter().zip(turned) {
                faces[number] = corners;
                is_turned[number] = true;
            }
            known.insert(key(c, d));
        }
    }
    faces
}

/// Every triangle in four.
pub fn subdivided(points: &[Vec3], triangles: &[[u32; 3]]) -> Mesh {
    let mut points = points.to_vec();
    let mut middles = BTreeMap::new();
    let mut faces = Vec::with_capacity(4 * triangles.len());
    for corners in triangles {
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push(points[a as usize].midpoint(points[b as usize]));
                points.len() as u32 - 1
            })
        };
        let [a, b, c] = *corners;
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        faces.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    (points, faces)
}

/// Twelve loose triangles around the figure.
pub fn with_specks(points: &[Vec3], triangles: &[[u32; 3]], random: &mut Random) -> Mesh {
    let (low, high) = points.iter().fold((Vec3::MAX, Vec3::MIN), |(a, b), p| (a.min(*p), b.max(*p)));
    let (mut points, mut triangles) = (points.to_vec(), triangles.to_vec());
    let size = 0.002 * (high - low).max_element();
    for _ in 0..12 {
        let at = low + (high - low) * Vec3::new(random.unit(), random.unit(), random.unit());
        let first = points.len() as u32;
        points.extend([at, at + size * Vec3::X, at + size * Vec3::Y]);
        triangles.push([first, first + 1, first + 2]);
    }
    (points, triangles)
}
