//! The input of a fit, checked and brought to a common scale.

use glam::{DVec3, Vec3};

use super::FitError;
use crate::mesh::adjacency::weld;

/// Number of values processed together.
pub(super) const LANES: usize = 8;
/// Least movement of a moving point in some shape, as a share of the largest movement.
const STILL: f32 = 1e-4;

/// The moving points, centred at the origin and scaled to about one unit.
pub(super) struct Problem {
    /// Index of each moving point in the whole mesh.
    pub origin: Vec<u32>,
    /// Rest positions.
    pub points: Vec<DVec3>,
    /// The neighbours of each point on the welded surface: those of point `p` are `starts[p]..starts[p + 1]`.
    pub neighbours: Vec<u32>,
    pub starts: Vec<u32>,
    /// The number of shapes.
    pub shapes: usize,
    /// Three numbers a shape, filled up to whole lanes.
    pub width: usize,
    /// Displacements, `width` numbers a point.
    pub moved: Vec<f32>,
    /// Squared length of each row of `moved`.
    pub energy: Vec<f64>,
    /// Size of a unit in the caller's space, and position of the origin there.
    pub scale: f64,
    pub center: DVec3,
    /// Number of all points.
    pub all: usize,
}

impl Problem {
    /// Checks the input and selects the moving points; see [`FitError`].
    pub fn new(rest: &[Vec3], triangles: &[[u32; 3]], shapes: &[impl AsRef<[Vec3]>]) -> Result<Self, FitError> {
        let furthest = check(rest, triangles, shapes)?;
        let still = furthest * STILL;
        let moves = |p: usize| shapes.iter().any(|shape| shape.as_ref()[p].abs().max_element() > still);
        let origin: Vec<u32> = (0..rest.len()).filter(|&p| moves(p)).map(|p| p as u32).collect();
        let (low, high) = origin.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &p| {
            (low.min(rest[p as usize]), high.max(rest[p as usize]))
        });
        let center = (low.as_dvec3() + high.as_dvec3()) * 0.5;
        let size = (high.as_dvec3() - low.as_dvec3()).length() * 0.5;
        let scale = size.max(f64::from(furthest));
        let points = origin.iter().map(|&p| (rest[p as usize].as_dvec3() - center) / scale).collect();
        let width = (3 * shapes.len()).next_multiple_of(LANES);
        let mut moved = vec![0.0; origin.len() * width];
        for (row, &p) in moved.chunks_exact_mut(width).zip(&origin) {
            for (out, shape) in row.chunks_exact_mut(3).zip(shapes) {
                let moved = shape.as_ref()[p as usize].as_dvec3() / scale;
                out.copy_from_slice(&moved.as_vec3().to_array());
            }
        }
        let square = |row: &[f32]| row.iter().map(|&d| f64::from(d) * f64::from(d)).sum::<f64>();
        let energy = moved.chunks_exact(width).map(square).collect();
        let (starts, neighbours) = surface(rest, triangles, &origin);
        let (shapes, all) = (shapes.len(), rest.len());
        Ok(Self { origin, points, neighbours, starts, shapes, width, moved, energy, scale, center, all })
    }

    /// The displacements of one moving point.
    pub fn row(&self, point: usize) -> &[f32] {
        &self.moved[point * self.width..(point + 1) * self.width]
    }

    /// The neighbours of one moving point.
    pub fn around(&self, point: usize) -> &[u32] {
        &self.neighbours[self.starts[point] as usize..self.starts[point + 1] as usize]
    }
}

/// Checks the input and returns the largest movement along an axis.
fn check(rest: &[Vec3], triangles: &[[u32; 3]], shapes: &[impl AsRef<[Vec3]>]) -> Result<f32, FitError> {
    if let Some(point) = rest.iter().position(|p| !p.is_finite()) {
        return Err(FitError::Point { point });
    }
    if let Some(triangle) = triangles.iter().position(|t| t.iter().any(|&p| p as usize >= rest.len())) {
        return Err(FitError::Triangle { triangle });
    }
    if shapes.is_empty() {
        return Err(FitError::NoShapes);
    }
    let mut furthest = 0.0f32;
    for (index, shape) in shapes.iter().enumerate() {
        let shape = shape.as_ref();
        if shape.len() != rest.len() {
            return Err(FitError::ShapeLength { shape: index, has: shape.len(), points: rest.len() });
        }
        if let Some(point) = shape.iter().position(|d| !d.is_finite()) {
            return Err(FitError::Shape { shape: index, point });
        }
        furthest = shape.iter().fold(furthest, |furthest, d| furthest.max(d.abs().max_element()));
    }
    // A movement below a thousandth of single precision at the mesh's own position and size counts as none.
    let size = rest.iter().fold(0.0f32, |size, p| size.max(p.abs().max_element()));
    if furthest <= size * 1e-10 { Err(FitError::NothingMoves) } else { Ok(furthest) }
}

/// Neighbours of the moving points, as starts and indices among the moving points; points at one place share theirs.
fn surface(rest: &[Vec3], triangles: &[[u32; 3]], origin: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let (place, places) = weld(rest);
    // Any point at a place represents all of them: they move together, or not at all.
    let mut stands = vec![u32::MAX; places];
    for (index, &p) in origin.iter().enumerate().rev() {
        stands[place[p as usize] as usize] = index as u32;
    }
    let mut pairs: Vec<(u32, u32)> = triangles
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a), (b, a), (c, b), (a, c)])
        .map(|(a, b)| (place[a as usize], place[b as usize]))
        .filter(|(a, b)| a != b)
        .collect();
    pairs.sort_unstable();
    pairs.dedup();
    let mut starts = vec![0];
    let mut neighbours = Vec::new();
    for &p in origin {
        let place = place[p as usize];
        let first = pairs.partition_point(|e| e.0 < place);
        let others = pairs[first..].iter().take_while(|e| e.0 == place).map(|e| stands[e.1 as usize]);
        neighbours.extend(others.filter(|&other| other != u32::MAX));
        starts.push(neighbours.len() as u32);
    }
    (starts, neighbours)
}
