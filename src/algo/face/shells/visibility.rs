//! Visibility of shells from outside.

use glam::Vec3;

use super::Island;

/// Cells along each side of the pictures.
const CELLS: usize = 72;

/// Visible share of each shell from the six sides along the axes, relative to the shell without the others.
///
/// Each triangle is drawn into three pictures, each of which keeps the nearest shell from either side.
pub fn shares(points: &[Vec3], triangles: &[[u32; 3]], shell_of: &[u32], islands: &[Island]) -> Vec<f32> {
    let (mut low, mut high) = (Vec3::MAX, Vec3::MIN);
    for island in islands.iter().filter(|island| island.area > 0.0) {
        low = low.min(island.low);
        high = high.max(island.high);
    }
    let size = (high - low).max_element();
    let mut shown = vec![0_u32; islands.len()];
    let mut alone = vec![0_u32; islands.len()];
    if size <= 0.0 || !size.is_finite() {
        return vec![1.0; islands.len()];
    }
    // Shells are drawn one by one, so that one stamp a cell records whether a shell has drawn there.
    let mut order: Vec<u32> = (0..triangles.len() as u32)
        .filter(|index| triangles[*index as usize].iter().all(|corner| (*corner as usize) < points.len()))
        .collect();
    let shell = |index: &u32| shell_of[triangles[*index as usize][0] as usize];
    order.sort_by_key(shell);
    let scale = (CELLS - 1) as f32 / size;
    for axis in 0..3 {
        let mut picture = Picture::new();
        for index in &order {
            let corners = triangles[*index as usize].map(|corner| {
                let [x, y, z] = ((points[corner as usize] - low) * scale).to_array();
                match axis {
                    0 => Vec3::new(y, z, x),
                    1 => Vec3::new(z, x, y),
                    _ => Vec3::new(x, y, z),
                }
            });
            picture.draw(corners, shell(index), &mut alone);
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
