//! Visibility of shells from outside.

use glam::Vec3;

use super::Island;

/// Cells along each side of the pictures.
const CELLS: usize = 72;

/// A frame around shells, in whose cells they are drawn.
struct Frame {
    low: Vec3,
    /// Cells in the mesh's unit.
    scale: f32,
}

impl Frame {
    /// The frame around all shells with an area; `None` if they have no extent.
    fn around(islands: &[Island]) -> Option<Self> {
        let (mut low, mut high) = (Vec3::MAX, Vec3::MIN);
        for island in islands.iter().filter(|island| island.area > 0.0) {
            low = low.min(island.low);
            high = high.max(island.high);
        }
        let size = (high - low).max_element();
        (size > 0.0 && size.is_finite()).then(|| Self { low, scale: (CELLS - 1) as f32 / size })
    }

    /// Corners of a triangle in cells, turned so that the view along an axis is along z.
    fn corners(&self, points: &[Vec3], triangle: [u32; 3], axis: usize) -> [Vec3; 3] {
        triangle.map(|corner| {
            let [x, y, z] = ((points[corner as usize] - self.low) * self.scale).to_array();
            match axis {
                0 => Vec3::new(y, z, x),
                1 => Vec3::new(z, x, y),
                _ => Vec3::new(x, y, z),
            }
        })
    }
}

/// Numbers of the triangles whose corners exist, shell by shell.
fn by_shell(points: &[Vec3], triangles: &[[u32; 3]], shell_of: &[u32]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..triangles.len() as u32)
        .filter(|index| triangles[*index as usize].iter().all(|corner| (*corner as usize) < points.len()))
        .collect();
    order.sort_by_key(|index| shell_of[triangles[*index as usize][0] as usize]);
    order
}

/// Visible share of each shell from the six sides along the axes, relative to the shell without the others.
///
/// Each triangle is drawn into three pictures, each of which keeps the nearest shell from either side.
pub fn shares(points: &[Vec3], triangles: &[[u32; 3]], shell_of: &[u32], islands: &[Island]) -> Vec<f32> {
    let mut shown = vec![0_u32; islands.len()];
    let mut alone = vec![0_u32; islands.len()];
    let Some(frame) = Frame::around(islands) else { return vec![1.0; islands.len()] };
    // Shells are drawn one by one, so that one stamp a cell records whether a shell has drawn there.
    let order = by_shell(points, triangles, shell_of);
    for axis in 0..3 {
        let mut picture = Picture::new();
        for index in &order {
            let triangle = triangles[*index as usize];
            picture.draw(frame.corners(points, triangle, axis), shell_of[triangle[0] as usize], &mut alone);
        }
        for (near, far) in picture.near.iter().zip(&picture.far) {
            for owner in [near.1, far.1] {
                if let Some(count) = shown.get_mut(owner as usize) {
                    *count += 1;
                }
            }
        }
    }
    // A shell alone would show every cell it covers, from both sides.
    shown.iter().zip(&alone).map(|(shown, alone)| *shown as f32 / (2 * *alone).max(1) as f32).collect()
}

/// Share of the visible places of each shell, from the six sides along the axes, that have another shell close behind
/// them: no further than `close`, as a share of the largest extent. Only shells that `takes_part` marks are looked at.
pub fn covering(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    shell_of: &[u32],
    islands: &[Island],
    takes_part: &[bool],
    close: f32,
) -> Vec<f32> {
    let mut shown = vec![0_u32; islands.len()];
    let mut over = vec![0_u32; islands.len()];
    let Some(frame) = Frame::around(islands) else { return vec![0.0; islands.len()] };
    let mut order = by_shell(points, triangles, shell_of);
    let shell = |index: &u32| shell_of[triangles[*index as usize][0] as usize];
    order.retain(|index| takes_part.get(shell(index) as usize).copied().unwrap_or(false));
    let close = close * (CELLS - 1) as f32;
    let mut unused = vec![0_u32; islands.len()];
    for axis in 0..3 {
        // The nearest two shells of each cell from either side.
        let mut sides = [vec![Nearest::default(); CELLS * CELLS], vec![Nearest::default(); CELLS * CELLS]];
        for part in order.chunk_by(|one, other| shell(one) == shell(other)) {
            let mut picture = Picture::new();
            for index in part {
                picture.draw(frame.corners(points, triangles[*index as usize], axis), shell(index), &mut unused);
            }
            for (cell, (near, far)) in picture.near.iter().zip(&picture.far).enumerate() {
                sides[0][cell].add(near.0, near.1);
                sides[1][cell].add(-far.0, far.1);
            }
        }
        for Nearest { first, second } in sides.iter().flatten() {
            if let Some(count) = shown.get_mut(first.1 as usize) {
                *count += 1;
                over[first.1 as usize] += u32::from(second.0 - first.0 <= close);
            }
        }
    }
    over.iter().zip(&shown).map(|(over, shown)| *over as f32 / (*shown).max(1) as f32).collect()
}

/// The two shells that are nearest to the viewer, with their depths.
#[derive(Clone, Copy)]
struct Nearest {
    first: (f32, u32),
    second: (f32, u32),
}

impl Default for Nearest {
    fn default() -> Self {
        Self { first: (f32::MAX, u32::MAX), second: (f32::MAX, u32::MAX) }
    }
}

impl Nearest {
    fn add(&mut self, depth: f32, shell: u32) {
        if shell == u32::MAX {
            return;
        }
        if depth < self.first.0 {
            (self.first, self.second) = ((depth, shell), self.first);
        } else if depth < self.second.0 {
            self.second = (depth, shell);
        }
    }
}

struct Picture {
    near: Vec<(f32, u32)>,
    far: Vec<(f32, u32)>,
    stamp: Vec<u32>,
}

impl Picture {
    fn new() -> Self {
        let cells = CELLS * CELLS;
        Self {
            near: vec![(f32::MAX, u32::MAX); cells],
            far: vec![(f32::MIN, u32::MAX); cells],
            stamp: vec![u32::MAX; cells],
        }
    }

    fn draw(&mut self, [a, b, c]: [Vec3; 3], shell: u32, alone: &mut [u32]) {
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        if !(low.is_finite() && high.is_finite()) {
            return;
        }
        // The centroid is always drawn: triangles smaller than a cell may hit no cell's centre.
        let middle = (a + b + c) / 3.0;
        self.put(middle.x as usize, middle.y as usize, middle.z, shell, alone);
        let area = (b - a).truncate().perp_dot((c - a).truncate());
        if area == 0.0 {
            return;
        }
        for y in low.y.ceil() as usize..=high.y as usize {
            for x in low.x.ceil() as usize..=high.x as usize {
                let at = Vec3::new(x as f32, y as f32, 0.0);
                let u = (b - at).truncate().perp_dot((c - at).truncate()) / area;
                let v = (c - at).truncate().perp_dot((a - at).truncate()) / area;
                let w = 1.0 - u - v;
                if u >= 0.0 && v >= 0.0 && w >= 0.0 {
                    self.put(x, y, u * a.z + v * b.z + w * c.z, shell, alone);
                }
            }
        }
    }

    fn put(&mut self, x: usize, y: usize, depth: f32, shell: u32, alone: &mut [u32]) {
        let cell = y.min(CELLS - 1) * CELLS + x.min(CELLS - 1);
        if self.stamp[cell] != shell {
            self.stamp[cell] = shell;
            alone[shell as usize] += 1;
        }
        if depth < self.near[cell].0 {
            self.near[cell] = (depth, shell);
        }
        if depth > self.far[cell].0 {
            self.far[cell] = (depth, shell);
        }
    }
}
