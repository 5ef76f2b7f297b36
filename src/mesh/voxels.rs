//! Solid voxels of any triangle soup: open, leaky, self-intersecting, inside-out or in many shells.
//!
//! Surface voxels come from a conservative triangle/box overlap test (Schwarz and Seidel 2010, "Fast parallel surface
//! and solid voxelization on GPUs"), the inside from a flood of the outside. Where holes let the flood in, straight
//! lines along the three axes vote by parity and winding on whether a cell is inside, so that a body with many missing
//! faces still has an inside.

mod enclose;
mod raster;

use glam::Vec3;

/// The largest number of cells along one axis.
pub const MAX_RESOLUTION: usize = 1024;
/// Largest number of cells of a grid; a finer resolution is coarsened.
const MAX_CELLS: f64 = 8.0e6;
/// Largest number of cell columns visited while triangles are drawn, besides those that many small triangles need at
/// any resolution; a finer resolution is coarsened.
const MAX_WORK: f64 = 2.0e7;
/// Columns that every triangle may visit: a few along each axis.
const WORK_EACH: f64 = 12.0;
/// Empty cells around the mesh, so that the outside is connected and samples near the border have neighbours.
const MARGIN: usize = 2;

/// Error of making voxels.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum VoxelizeError {
    /// A triangle refers to a point that does not exist.
    #[error(
        "triangle {triangle} refers to point {point}, but there are only {points}: the mesh is damaged, export it again"
    )]
    PointOutOfRange {
        /// Index of the triangle.
        triangle: usize,
        /// The point it refers to.
        point: u32,
        /// The number of points.
        points: usize,
    },
    /// The box contains no triangle with finite corners.
    #[error(
        "there is no triangle with finite corners to make voxels of; check that the mesh has faces near the skeleton"
    )]
    NoSurface,
}

/// A regular grid of cubic cells over a mesh, with a bit for "solid" and one for "core" in each cell.
///
/// Cells are addressed by coordinates `[x, y, z]` or, if solid, by a dense index in x, y, z order (x fastest).
#[derive(Debug, Clone)]
pub struct Voxels {
    origin: [f64; 3],
    cell: f64,
    dims: [usize; 3],
    words: usize,
    solid: Vec<u64>,
    core: Vec<u64>,
    ranks: Vec<u32>,
    rescued: usize,
}

impl Voxels {
    /// Makes voxels of a triangle soup in the space of `points`, with about `resolution` cells along the longest side
    /// of the mesh, or of the part of it inside `clip` (lowest and highest corner) if that is given.
    ///
    /// The resolution is at most [`MAX_RESOLUTION`] and lower where memory (some tens of megabytes) or time (many
    /// huge triangles) call for it. Triangles with a corner that is not finite are left out. The result does not
    /// depend on the number of threads. Cost: the area of the triangles in cells, plus the number of cells.
    ///
    /// # Errors
    /// [`VoxelizeError::PointOutOfRange`] for a damaged mesh, [`VoxelizeError::NoSurface`] if nothing lies in the box.
    pub fn new(
        points: &[Vec3],
        triangles: &[[u32; 3]],
        resolution: usize,
        clip: Option<(Vec3, Vec3)>,
    ) -> Result<Self, VoxelizeError> {
        let count = points.len();
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&point) = corners.iter().find(|&&c| c as usize >= count) {
                return Err(VoxelizeError::PointOutOfRange { triangle, point, points: count });
            }
        }
        let (low, high) = bounds(points, triangles, clip).ok_or(VoxelizeError::NoSurface)?;
        let mut grid = Self::layout(low, high, resolution);
        let work = raster::work(&grid, points, triangles);
        let allowed = MAX_WORK + WORK_EACH * triangles.len() as f64;
        if work > allowed {
            let cells = grid.dims.iter().max().map_or(1, |&n| n - 2 * MARGIN) as f64;
            grid = Self::layout(low, high, (cells * (allowed / work).sqrt()).max(8.0) as usize);
        }
        let surface = raster::surface(&grid, points, triangles);
        enclose::enclose(&mut grid, surface, points, triangles);
        grid.index();
        if grid.is_empty() { Err(VoxelizeError::NoSurface) } else { Ok(grid) }
    }

    fn layout(low: [f64; 3], high: [f64; 3], resolution: usize) -> Self {
        let extent = [0, 1, 2].map(|a| high[a] - low[a]);
        let longest = extent[0].max(extent[1]).max(extent[2]);
        // A mesh without extent still gets one cell; f64 holds the range of f32 without overflow.
        let longest = if longest > 0.0 { longest } else { 1e-3 };
        let mut resolution = resolution.clamp(1, MAX_RESOLUTION) as f64;
        loop {
            let cell = longest / resolution;
            let dims = extent.map(|e| (e / cell).floor() as usize + 1 + 2 * MARGIN);
            let words = dims[0].div_ceil(64);
            if (words * 64) as f64 * dims[1] as f64 * dims[2] as f64 <= MAX_CELLS || resolution <= 8.0 {
                let used = [0, 1, 2].map(|a| (dims[a] - 2 * MARGIN) as f64 * cell);
                // The slack of rounding up is shared by both sides.
                let origin = [0, 1, 2].map(|a| low[a] - MARGIN as f64 * cell - 0.5 * (used[a] - extent[a]));
                return Self {
                    origin,
                    cell,
                    dims,
                    words,
                    solid: Vec::new(),
                    core: Vec::new(),
                    ranks: Vec::new(),
                    rescued: 0,
                };
            }
            resolution *= 0.9;
        }
    }

    /// Counts set bits before each word, which makes the dense index of a solid cell a look-up.
    fn index(&mut self) {
        let mut rank = 0;
        self.ranks = Vec::with_capacity(self.solid.len() + 1);
        for word in &self.solid {
            self.ranks.push(rank);
            rank += word.count_ones();
        }
        self.ranks.push(rank);
    }

    fn word(&self, y: usize, z: usize) -> usize {
        (z * self.dims[1] + y) * self.words
    }

    /// The number of solid cells.
    pub fn len(&self) -> usize {
        self.ranks.last().copied().unwrap_or(0) as usize
    }

    /// Returns `true` if no cell is solid.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The number of cells along each axis, with the empty margin.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// The edge of a cell, in units of the points.
    pub fn cell(&self) -> f64 {
        self.cell
    }

    /// Number of cells found to be inside although the flood of the outside reached them through holes.
    pub fn rescued(&self) -> usize {
        self.rescued
    }

    /// A position in units of cells; the cell `[x, y, z]` spans `x..x + 1` and so on.
    pub fn to_grid(&self, point: Vec3) -> [f64; 3] {
        let point = point.to_array();
        [0, 1, 2].map(|a| (f64::from(point[a]) - self.origin[a]) / self.cell)
    }

    /// The centre of a cell in the space of the points.
    pub fn center(&self, cell: [usize; 3]) -> Vec3 {
        Vec3::from_array([0, 1, 2].map(|a| (self.origin[a] + (cell[a] as f64 + 0.5) * self.cell) as f32))
    }

    /// The cell that contains a position in grid units, if it is in the grid.
    pub fn cell_at(&self, grid: [f64; 3]) -> Option<[usize; 3]> {
        let inside = (0..3).all(|a| grid[a] >= 0.0 && grid[a] < self.dims[a] as f64);
        inside.then(|| grid.map(|g| g as usize))
    }

    /// The dense index of a solid cell, `None` if the cell is empty or not in the grid.
    #[inline]
    pub fn solid_index(&self, [x, y, z]: [usize; 3]) -> Option<usize> {
        if x >= self.dims[0] || y >= self.dims[1] || z >= self.dims[2] {
            return None;
        }
        let word = self.word(y, z) + x / 64;
        let bits = self.solid[word];
        let bit = 1u64 << (x % 64);
        (bits & bit != 0).then(|| (self.ranks[word] + (bits & (bit - 1)).count_ones()) as usize)
    }

    /// Returns `true` for a solid cell whose centre lies inside the mesh, `false` for the outer half of the surface
    /// layer.
    #[inline]
    pub fn is_core(&self, [x, y, z]: [usize; 3]) -> bool {
        x < self.dims[0]
            && y < self.dims[1]
            && z < self.dims[2]
            && self.core[self.word(y, z) + x / 64] >> (x % 64) & 1 != 0
    }

    /// Calls `visit` for the up to 26 solid neighbours of a solid cell, in x, y, z order, with the dense index of each,
    /// the kind of step to it (0 over a face, 1 over an edge, 2 over a corner), and whether it is a core cell.
    #[inline]
    pub fn neighbours(&self, [x, y, z]: [usize; 3], mut visit: impl FnMut(usize, usize, bool)) {
        // Solid cells lie inside the empty margin, so all neighbours are in the grid.
        let (low, shift) = ((x - 1) / 64, (x - 1) % 64);
        for row in 0..9 {
            let (dy, dz) = (row % 3, row / 3);
            let word = self.word(y + dy - 1, z + dz - 1) + low;
            let three = |bits: &[u64]| {
                // Three bits of a row, which may lie in two words.
                let next = if shift > 61 { bits[word + 1] << (64 - shift) } else { 0 };
                (bits[word] >> shift | next) & 7
            };
            let mut solid = three(&self.solid);
            if solid == 0 {
                continue;
            }
            let core = three(&self.core);
            let mut index = (self.ranks[word] + (self.solid[word] & ((1u64 << shift) - 1)).count_ones()) as usize;
            let moved = usize::from(dy != 1) + usize::from(dz != 1);
            while solid != 0 {
                let dx = solid.trailing_zeros();
                solid &= solid - 1;
                if let Some(kind) = (moved + usize::from(dx != 1)).checked_sub(1) {
                    visit(index, kind, core >> dx & 1 != 0);
                }
                index += 1;
            }
        }
    }

    /// Calls `visit` with the dense index of the solid cells along a straight line between two points, in order; the
    /// same cell may come twice.
    pub fn along(&self, from: Vec3, to: Vec3, mut visit: impl FnMut(usize)) {
        if from.is_finite() && to.is_finite() {
            raster::segment(self.to_grid(from), self.to_grid(to), self.dims, |cell| {
                if let Some(index) = self.solid_index(cell) {
                    visit(index);
                }
            });
        }
    }

    /// Coordinates of all solid cells in the order of their dense index.
    pub fn cells(&self) -> Vec<[u16; 3]> {
        let mut cells = Vec::with_capacity(self.len());
        for z in 0..self.dims[2] {
            for y in 0..self.dims[1] {
                let row = self.word(y, z);
                for (w, &word) in self.solid[row..row + self.words].iter().enumerate() {
                    let mut bits = word;
                    while bits != 0 {
                        // Coordinates stay far below 2^16: see MAX_RESOLUTION.
                        cells.push([(w * 64) as u16 + bits.trailing_zeros() as u16, y as u16, z as u16]);
                        bits &= bits - 1;
                    }
                }
            }
        }
        cells
    }
}

/// The box of all finite triangles, cut to `clip`.
fn bounds(points: &[Vec3], triangles: &[[u32; 3]], clip: Option<(Vec3, Vec3)>) -> Option<([f64; 3], [f64; 3])> {
    let (clip_low, clip_high) = clip.unwrap_or((Vec3::splat(f32::MIN), Vec3::splat(f32::MAX)));
    let (mut low, mut high) = (Vec3::splat(f32::INFINITY), Vec3::splat(f32::NEG_INFINITY));
    for corners in triangles {
        let [a, b, c] = corners.map(|c| points[c as usize]);
        if !(a.is_finite() && b.is_finite() && c.is_finite()) {
            continue;
        }
        let (least, most) = (a.min(b).min(c), a.max(b).max(c));
        if least.cmple(clip_high).all() && most.cmpge(clip_low).all() {
            low = low.min(least.max(clip_low));
            high = high.max(most.min(clip_high));
        }
    }
    low.cmple(high).all().then(|| (low.to_array().map(f64::from), high.to_array().map(f64::from)))
}
