//! Mirror symmetry of a mesh across the planes at right angles to the axes.

use glam::Vec3;

/// Cells along each side of the occupancy grid.
const CELLS: i32 = 40;

/// Asymmetry for each axis: the difference of the mesh from its mirror image across the plane through `center`, 0 for
/// equal, 1 for disjoint.
///
/// Compares the grid cells that the surface passes; neighbouring cells count as equal, which allows for rounding by a
/// cell.
pub fn skew(points: &[Vec3], triangles: &[[u32; 3]], center: Vec3, size: f32) -> Vec3 {
    let mut filled = vec![false; (CELLS * CELLS * CELLS) as usize];
    let scale = CELLS as f32 * 0.495 / size;
    let index = |cell: [i32; 3]| {
        let inside = cell.iter().all(|c| (0..CELLS).contains(c));
        inside.then(|| ((cell[2] * CELLS + cell[1]) * CELLS + cell[0]) as usize)
    };
    let cell_of = |point: Vec3| ((point - center) * scale + CELLS as f32 * 0.5).floor().to_array().map(|c| c as i32);
    let mut cells = Vec::new();
    let mut fill = |point: Vec3| {
        let cell = cell_of(point);
        if let Some(index) = index(cell)
            && !filled[index]
        {
            filled[index] = true;
            cells.push(cell);
        }
    };
    for triangle in triangles {
        let [Some(a), Some(b), Some(c)] = triangle.map(|corner| points.get(corner as usize).copied()) else { continue };
        for point in [a, b, c, (a + b + c) / 3.0, (a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5] {
            fill(point);
        }
    }
    let near = |cell: [i32; 3]| {
        let steps = [[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
        steps.iter().any(|s| index([cell[0] + s[0], cell[1] + s[1], cell[2] + s[2]]).is_some_and(|i| filled[i]))
    };
    Vec3::from_array([0, 1, 2].map(|axis| {
        let missed = cells.iter().filter(|cell| {
            let mut mirrored = **cell;
            mirrored[axis] = CELLS - 1 - mirrored[axis];
            !near(mirrored)
        });
        missed.count() as f32 / cells.len().max(1) as f32
    }))
}
