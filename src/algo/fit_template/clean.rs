//! Cleaning: the triangles of a file in an order and a frame that depend on its shape alone.
//!
//! Points are welded by position and sorted, triangles are sorted, and everything is turned to the principal axes of
//! the surface. So the order of points and faces changes no byte of a fit, and turns and scales of the file change it
//! by no more than rounding.

use glam::{DMat3, DVec3, Vec3};

use super::{caps, eigen::eigen};
use crate::mesh::adjacency;

/// Share of the whole surface below which a loose island may be a speck.
const SPECK_AREA: f64 = 2e-3;
/// Share of the whole surface that all specks together may have; a soup of loose triangles is kept.
const SPECKS_AREA: f64 = 0.06;

/// Skewness of the surface along an axis below which it is even there.
const EVEN: f64 = 5e-3;

/// Grain of positions in unit space, a power of two.
const GRAIN: f32 = 1.0 / 262_144.0;

/// The map between the space of the file and the unit space of the analysis: `unit = turn * (file - centre) * scale`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct UnitSpace {
    pub(super) centre: DVec3,
    pub(super) turn: DMat3,
    pub(super) scale: f64,
}

impl UnitSpace {
    pub(super) fn to_unit(self, point: Vec3) -> Vec3 {
        (self.turn * (point.as_dvec3() - self.centre) * self.scale).as_vec3()
    }

    pub(super) fn to_file(self, point: Vec3) -> Vec3 {
        (self.turn.transpose() * (point.as_dvec3() / self.scale) + self.centre).as_vec3()
    }

    pub(super) fn direction_to_unit(self, direction: Vec3) -> Vec3 {
        (self.turn * direction.as_dvec3()).as_vec3().normalize_or_zero()
    }

    pub(super) fn direction_to_file(self, direction: Vec3) -> Vec3 {
        (self.turn.transpose() * direction.as_dvec3()).as_vec3().normalize_or_zero()
    }
}

/// A mesh in unit space: its longest side along the principal axes is one.
#[derive(Debug, Clone)]
pub(super) struct CleanMesh {
    pub(super) points: Vec<Vec3>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) space: UnitSpace,
    /// Loose islands that were left out as specks.
    pub(super) specks: usize,
}

/// Cleans a mesh; `None` if no triangle with finite corners and an area is left.
pub(super) fn clean(points: &[Vec3], triangles: &[[u32; 3]]) -> Option<CleanMesh> {
    let (mut points, mut triangles) = sorted(points, triangles);
    caps::close_holes(&mut points, &mut triangles);
    let corners = |t: &[u32; 3]| t.map(|c| points[c as usize].as_dvec3());
    // Areas relative to the extent, so that squares of huge and tiny coordinates stay in range.
    let extent = points.iter().fold(0.0f64, |m, p| m.max(p.as_dvec3().abs().max_element()));
    if extent.is_nan() || extent <= 0.0 {
        return None;
    }
    let area = |t: &[u32; 3]| {
        let [a, b, c] = corners(t).map(|p| p / extent);
        0.5 * (b - a).cross(c - a).length()
    };
    let areas: Vec<f64> = triangles.iter().map(area).collect();
    let whole: f64 = areas.iter().sum();
    if whole.is_nan() || whole <= 0.0 {
        return None;
    }
    let (triangles, areas, specks) = without_specks(points.len(), triangles, areas, whole);
    let total: f64 = areas.iter().sum();
    let mut centre = DVec3::ZERO;
    for (t, area) in triangles.iter().zip(&areas) {
        let [a, b, c] = corners(t);
        centre += (a + b + c) * (area / 3.0);
    }
    centre /= total;
    let mut moments = [[0.0f64; 3]; 3];
    for (t, area) in triangles.iter().zip(&areas) {
        let [a, b, c] = corners(t).map(|p| (p - centre) / extent);
        // The exact second moment of a triangle about the centre.
        for q in [(a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5] {
            let q = q.to_array();
            for i in 0..3 {
                for j in 0..3 {
                    moments[i][j] += area / 3.0 * q[i] * q[j];
                }
            }
        }
    }
    let axes = principal_axes(moments);
    let mut thirds = [0.0f64; 3];
    for (t, area) in triangles.iter().zip(&areas) {
        let [a, b, c] = corners(t);
        let q = ((a + b + c) / 3.0 - centre) / extent;
        for (third, axis) in thirds.iter_mut().zip(axes) {
            *third += area * q.dot(axis).powi(3);
        }
    }
    let [x, y, z] = signed(axes, moments, thirds, total);
    let turn = DMat3::from_cols(x, y, z).transpose();
    let mut space = UnitSpace { centre, turn, scale: 1.0 };
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for point in triangles.iter().flat_map(corners) {
        let q = turn * (point - centre);
        (low, high) = (low.min(q), high.max(q));
    }
    let side = (high - low).max_element();
    if side.is_nan() || side <= 0.0 {
        return None;
    }
    space.scale = 1.0 / side;
    // Rounded and sorted once more, a mesh and its turned copy are the same but for the last bits of few points.
    let unit: Vec<Vec3> = points.iter().map(|&p| (space.to_unit(p) / GRAIN).round() * GRAIN).collect();
    let (points, triangles) = sorted(&unit, &triangles);
    Some(CleanMesh { points, triangles, space, specks })
}

/// Axes that lead where the surface reaches furthest; one follows from the other two. That is the third one, or one across a plane
/// of symmetry, whose sign rounding alone would tell. `area` is that of the surface, of which the moments are sums.
fn signed(axes: [DVec3; 3], moments: [[f64; 3]; 3], thirds: [f64; 3], area: f64) -> [DVec3; 3] {
    let is_even = |&i: &usize| {
        let variance: f64 = (0..3).map(|a| (0..3).map(|b| axes[i][a] * moments[a][b] * axes[i][b]).sum::<f64>()).sum();
        thirds[i].abs() * area.sqrt() < EVEN * variance * variance.sqrt()
    };
    let even = [0, 1].into_iter().find(is_even).unwrap_or(2);
    let mut signed = axes;
    for i in (0..3).filter(|&i| i != even && thirds[i] < 0.0) {
        signed[i] = -signed[i];
    }
    signed[even] = signed[(even + 1) % 3].cross(signed[(even + 2) % 3]);
    signed
}

/// Welds points of equal position and sorts points and triangles; drops triangles without three finite corners.
fn sorted(points: &[Vec3], triangles: &[[u32; 3]]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (numbers, count) = adjacency::weld(points);
    let mut used = vec![false; count];
    let mut places = vec![Vec3::ZERO; count];
    for (point, &number) in points.iter().zip(&numbers) {
        places[number as usize] = *point + Vec3::ZERO;
    }
    let usable = |c: u32| points.get(c as usize).is_some_and(|p| p.is_finite() && p.abs().max_element() < 1e18);
    let mut kept: Vec<[u32; 3]> = triangles
        .iter()
        .filter(|t| t.iter().all(|&c| usable(c)))
        .map(|t| t.map(|c| numbers[c as usize]))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect();
    kept.iter().flatten().for_each(|&c| used[c as usize] = true);
    let mut order: Vec<u32> = (0..count as u32).filter(|&i| used[i as usize]).collect();
    let key = |i: u32| places[i as usize].to_array();
    order.sort_unstable_by(|&a, &b| {
        let (a, b) = (key(a), key(b));
        a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])).then(a[2].total_cmp(&b[2]))
    });
    let mut rank = vec![0u32; count];
    for (i, &number) in order.iter().enumerate() {
        rank[number as usize] = i as u32;
    }
    for t in &mut kept {
        let [a, b, c] = t.map(|c| rank[c as usize]);
        *t = if a < b && a < c {
            [a, b, c]
        } else if b < a && b < c {
            [b, c, a]
        } else {
            [c, a, b]
        };
    }
    kept.sort_unstable();
    (order.iter().map(|&i| places[i as usize]).collect(), kept)
}

/// Leaves out islands of a tiny area, unless they are much of the mesh.
fn without_specks(
    points: usize,
    triangles: Vec<[u32; 3]>,
    areas: Vec<f64>,
    whole: f64,
) -> (Vec<[u32; 3]>, Vec<f64>, usize) {
    let (islands, count) = adjacency::islands(&triangles, points);
    let mut sums = vec![0.0f64; count];
    for (t, area) in triangles.iter().zip(&areas) {
        sums[islands[t[0] as usize] as usize] += area;
    }
    let small: Vec<bool> = sums.iter().map(|&s| s < SPECK_AREA * whole).collect();
    let dropped: f64 = sums.iter().zip(&small).filter(|(_, small)| **small).map(|(s, _)| s).sum();
    if dropped == 0.0 || dropped > SPECKS_AREA * whole {
        return (triangles, areas, 0);
    }
    let specks = sums.iter().zip(&small).filter(|(s, small)| **small && **s > 0.0).count();
    let keep = |t: &[u32; 3]| !small[islands[t[0] as usize] as usize];
    let (triangles, areas) = triangles.iter().zip(&areas).filter(|(t, _)| keep(t)).map(|(t, a)| (*t, *a)).unzip();
    (triangles, areas, specks)
}

/// Unit eigenvectors of a symmetric matrix, that of the largest eigenvalue first.
pub(super) fn principal_axes(matrix: [[f64; 3]; 3]) -> [DVec3; 3] {
    let (values, vectors) = eigen(matrix);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
    order.map(|i| DVec3::new(vectors[0][i], vectors[1][i], vectors[2][i]).normalize_or_zero())
}
