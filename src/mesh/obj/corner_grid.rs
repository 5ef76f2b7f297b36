//! Grid of the corners of a polygon, for the question which of them lie in a triangle.
//!
//! A long triangle that leans to one side touches few of the cells in its box: of each row of cells, those between its
//! two sides.

use glam::DVec2;

use super::NONE;

/// Largest number of cells that are all looked into, whether a triangle touches them or its box only.
const SMALL_BOX: usize = 8;
/// Share of a cell, or of the largest coordinate in cells, by which triangles are thicker than they are.
const SLACK: f64 = 1e-6;

/// Points sorted into square cells.
#[derive(Debug, Default)]
pub(super) struct CornerGrid {
    low: DVec2,
    /// Number of cells per unit; zero along an axis along which all points are equal.
    scale: DVec2,
    /// Factors from units to cells: the scale, or that of the other axis where it is zero.
    unit: DVec2,
    /// Largest coordinate of a point from bottom to top, in cells.
    top: f64,
    side: usize,
    starts: Vec<u32>,
    /// Number of points of each cell that may still be wanted.
    counts: Vec<u32>,
    members: Vec<u32>,
}

/// A triangle in cells of a grid.
struct CellTriangle {
    corners: [DVec2; 3],
    slack: f64,
}

impl CornerGrid {
    /// Sorts the wanted ones of points into cells.
    pub(super) fn build(&mut self, points: &[DVec2], wanted: &[bool]) {
        let inside = || points.iter().zip(wanted).filter(|(_, wanted)| **wanted).map(|(point, _)| *point);
        let count = inside().count();
        // The number of cells in a row doubles until a cell holds four points or fewer on average (at most 1024 cells).
        self.side = 1;
        while self.side * self.side * 4 < count && self.side < 1024 {
            self.side *= 2;
        }
        self.low = inside().fold(DVec2::INFINITY, DVec2::min);
        let extent = inside().fold(DVec2::NEG_INFINITY, DVec2::max) - self.low;
        let cells = |extent: f64| if extent > 0.0 && extent.is_finite() { self.side as f64 / extent } else { 0.0 };
        self.scale = DVec2::new(cells(extent.x), cells(extent.y));
        let other = if self.scale.max_element() > 0.0 { self.scale.max_element() } else { 1.0 };
        let unit = |scale: f64| if scale > 0.0 { scale } else { other };
        self.unit = DVec2::new(unit(self.scale.x), unit(self.scale.y));
        self.top = if self.scale.y > 0.0 { self.side as f64 } else { 0.0 };
        self.starts.clear();
        self.starts.resize(self.side * self.side + 1, 0);
        for point in inside() {
            let cell = self.cell(point);
            self.starts[cell + 1] += 1;
        }
        for cell in 1..self.starts.len() {
            self.starts[cell] += self.starts[cell - 1];
        }
        self.members.clear();
        self.members.resize(count, NONE);
        for (id, (point, _)) in points.iter().zip(wanted).enumerate().filter(|(_, (_, wanted))| **wanted) {
            let mut slot = self.starts[self.cell(*point)] as usize;
            while self.members[slot] != NONE {
                slot += 1;
            }
            self.members[slot] = id as u32;
        }
        self.counts.clear();
        self.counts.extend(self.starts.windows(2).map(|pair| pair[1] - pair[0]));
    }

    fn coordinates(&self, point: DVec2) -> [usize; 2] {
        let place = (point - self.low) * self.scale;
        [place.x, place.y].map(|place| (place.max(0.0) as usize).min(self.side - 1))
    }

    fn cell(&self, point: DVec2) -> usize {
        let [x, y] = self.coordinates(point);
        y * self.side + x
    }

    /// A triangle in cells; `None` for numbers that are too large.
    fn triangle(&self, corners: [DVec2; 3]) -> Option<CellTriangle> {
        let corners = corners.map(|corner| (corner - self.low) * self.unit);
        let most = corners.iter().fold(1.0, |most: f64, corner| most.max(corner.abs().max_element()));
        let is_finite = corners.iter().all(|corner| corner.is_finite());
        is_finite.then_some(CellTriangle { corners, slack: SLACK * most })
    }

    /// First and last cell of a row that a triangle may touch where the row has points; `None` if there is none.
    fn columns(&self, triangle: &CellTriangle, row: usize) -> Option<[usize; 2]> {
        let CellTriangle { corners: [a, b, c], slack } = *triangle;
        let (low, high) = (row as f64 - slack, (row as f64 + 1.0).min(self.top) + slack);
        let (mut first, mut last) = (f64::INFINITY, f64::NEG_INFINITY);
        for (one, other) in [(a, b), (b, c), (c, a)] {
            let (from, to) = if one.y <= other.y { (one, other) } else { (other, one) };
            if to.y < low || from.y > high {
                continue;
            }
            let at = |y: f64| from.x + (to.x - from.x) * ((y - from.y) / (to.y - from.y));
            let lower = if from.y < low { at(low) } else { from.x };
            let upper = if to.y > high { at(high) } else { to.x };
            first = first.min(lower).min(upper);
            last = last.max(lower).max(upper);
        }
        let column = |place: f64| (place.max(0.0) as usize).min(self.side - 1);
        (first <= last).then(|| [column(first - slack), column(last + slack)])
    }

    /// Returns `true` if `test` holds for any wanted point in the cells that a triangle touches, or of the cells that the box of
    /// a small one touches. Points that are not wanted any more leave their cells. Cells and points are added to `work`.
    pub(super) fn any(
        &mut self,
        corners: [DVec2; 3],
        work: &mut u64,
        wanted: impl Fn(u32) -> bool,
        mut test: impl FnMut(u32) -> bool,
    ) -> bool {
        let [a, b, c] = corners;
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let ([left, bottom], [right, top]) = (self.coordinates(low), self.coordinates(high));
        let is_small = (right - left + 1) * (top - bottom + 1) <= SMALL_BOX;
        let triangle = if is_small { None } else { self.triangle(corners) };
        for row in bottom..=top {
            let [mut first, mut last] = [left, right];
            if let Some(triangle) = &triangle {
                *work += 1;
                let Some(columns) = self.columns(triangle, row) else { continue };
                [first, last] = [left.max(columns[0]), right.min(columns[1])];
            }
            for cell in row * self.side + first..=row * self.side + last {
                *work += 1;
                let start = self.starts[cell] as usize;
                let mut place = start;
                while place < start + self.counts[cell] as usize {
                    *work += 1;
                    let id = self.members[place];
                    if !wanted(id) {
                        self.counts[cell] -= 1;
                        self.members.swap(place, start + self.counts[cell] as usize);
                    } else if test(id) {
                        return true;
                    } else {
                        place += 1;
                    }
                }
            }
        }
        false
    }
}
