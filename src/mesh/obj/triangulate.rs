//! Polygons cut into triangles, concave ones along diagonals that lie inside.
//!
//! Ear clipping (Meisters 1975; Eberly, "Triangulation by Ear Clipping") on the polygon's shadow along the axis closest
//! to its best-fit normal (Newell). Coordinates are floats and differences and products are doubles, so the signs of
//! areas are those of the true ones but for extreme ranges. Only corners that are reflex or straight can lie in an
//! ear, and a grid finds those near it. A polygon that touches or crosses itself still gets corners minus two
//! triangles.

use glam::{DVec2, DVec3};

use super::corner_grid::CornerGrid;

/// Buffers of the triangulation, reused from polygon to polygon.
#[derive(Debug, Default)]
pub(super) struct Triangulator {
    flat: Vec<DVec2>,
    previous: Vec<u32>,
    next: Vec<u32>,
    /// Marks corners that may lie in an ear: not cut off yet, and reflex or straight.
    inner: Vec<bool>,
    grid: CornerGrid,
    /// Number of comparisons and cells of the grid on all polygons so far.
    work: u64,
    /// Work up to which ears of the polygon at hand are looked for.
    most_work: u64,
    /// Number of polygons that were too tangled for ear clipping within the limit of work.
    pub fans: usize,
}

/// Work after which large polygons are cut into fans: about a second, and far more than real meshes need.
const MOST_WORK: u64 = 1 << 26;
/// Work on a polygon, for each of its corners, after which its remaining corners are cut off without a look at the others:
/// polygons that cross themselves would take work with the square of their corners.
const WORK_OF_CORNER: u64 = 1 << 12;

/// A vector at right angles to a polygon, as long as twice its area (Newell's method): the normal of the best-fitting
/// plane.
pub(super) fn newell(corners: impl ExactSizeIterator<Item = DVec3> + Clone) -> DVec3 {
    let Some(origin) = corners.clone().next() else { return DVec3::ZERO };
    let mut sum = DVec3::ZERO;
    let mut last = DVec3::ZERO;
    for corner in corners.skip(1) {
        let corner = corner - origin;
        sum += last.cross(corner);
        last = corner;
    }
    sum
}

impl Triangulator {
    /// Cuts the polygon `points` into triangles over their numbers, in the polygon's own turning direction. Less than
    /// three points give nothing.
    pub fn polygon(&mut self, points: &[DVec3], triangles: &mut Vec<[u32; 3]>) {
        match points.len() {
            0..3 => {}
            3 => triangles.push([0, 1, 2]),
            4 => triangles.extend(quad(points)),
            count => {
                self.flatten(points);
                if self.convex() || self.work > MOST_WORK {
                    triangles.extend((2..count as u32).map(|corner| [0, corner - 1, corner]));
                    self.fans += usize::from(self.work > MOST_WORK);
                } else {
                    self.clip(triangles);
                }
            }
        }
    }

    /// Projects along the axis closest to the normal, so that the shadow turns counter-clockwise.
    fn flatten(&mut self, points: &[DVec3]) {
        let normal = newell(points.iter().copied());
        let size = normal.abs();
        let shadow = |point: &DVec3| match size {
            _ if size.z >= size.x && size.z >= size.y => (point.x, point.y, normal.z),
            _ if size.x >= size.y => (point.y, point.z, normal.x),
            _ => (point.z, point.x, normal.y),
        };
        self.flat.clear();
        self.flat.extend(points.iter().map(|point| {
            let (x, y, facing) = shadow(point);
            if facing < 0.0 { DVec2::new(y, x) } else { DVec2::new(x, y) }
        }));
    }

    /// Returns `true` if no corner turns right and the turns add up to one round.
    fn convex(&self) -> bool {
        let count = self.flat.len();
        let edge = |corner: usize| self.flat[(corner + 1) % count] - self.flat[corner % count];
        let mut changes = 0;
        for corner in 0..count {
            let (here, after) = (edge(corner), edge(corner + 1));
            let turn = here.perp_dot(after);
            // Straight corners are left to ear clipping: a fan from one has a flat triangle.
            if turn <= 0.0 {
                return false;
            }
            // A convex polygon's edges change between going right and left twice.
            changes += usize::from((here.x < 0.0) != (after.x < 0.0));
        }
        changes <= 2
    }

    fn clip(&mut self, triangles: &mut Vec<[u32; 3]>) {
        let count = self.flat.len();
        self.previous.clear();
        self.previous.extend((0..count as u32).map(|corner| corner.checked_sub(1).unwrap_or(count as u32 - 1)));
        self.next.clear();
        self.next.extend((0..count as u32).map(|corner| (corner + 1) % count as u32));
        self.inner.clear();
        self.inner.resize(count, false);
        for corner in 0..count {
            self.inner[corner] = self.turn(corner) <= 0.0;
        }
        self.grid.build(&self.flat, &self.inner);
        let mut left = count;
        let mut corner = 0;
        // Number of corners tested since the last cut, and the tolerated defects: first none; then touching and flat
        // ears; then all, for a polygon that crosses itself.
        let mut looked = 0;
        let mut lenience = Lenience::Strict;
        self.most_work = MOST_WORK.min(self.work + WORK_OF_CORNER * count as u64);
        while left > 3 {
            self.work += 1;
            if self.work > self.most_work {
                lenience = Lenience::Anything;
            }
            if self.is_ear(corner, lenience) {
                let (before, after) = (self.previous[corner], self.next[corner]);
                triangles.push([before, corner as u32, after]);
                self.next[before as usize] = after;
                self.previous[after as usize] = before;
                self.inner[corner] = false;
                for neighbour in [before as usize, after as usize] {
                    self.inner[neighbour] = self.inner[neighbour] && self.turn(neighbour) <= 0.0;
                }
                left -= 1;
                // Moving on past the neighbour spreads the cuts around, which makes better triangles than a fan.
                corner = self.next[after as usize] as usize;
                looked = 0;
                lenience = Lenience::Strict;
            } else {
                corner = self.next[corner] as usize;
                looked += 1;
                if looked >= left {
                    looked = 0;
                    lenience = lenience.more();
                }
            }
        }
        triangles.push([self.previous[corner], corner as u32, self.next[corner]]);
        self.fans += usize::from(self.work > self.most_work);
    }

    /// Twice the area of the triangle at a corner; positive if it turns left.
    fn turn(&self, corner: usize) -> f64 {
        let [a, b, c] = [self.previous[corner], corner as u32, self.next[corner]].map(|at| self.flat[at as usize]);
        area(a, b, c)
    }

    fn is_ear(&mut self, corner: usize, lenience: Lenience) -> bool {
        let ids = [self.previous[corner], corner as u32, self.next[corner]];
        let [a, b, c] = ids.map(|at| self.flat[at as usize]);
        let turn = area(a, b, c);
        match lenience {
            Lenience::Strict if turn <= 0.0 => return false,
            Lenience::Touching if turn < 0.0 => return false,
            Lenience::Touching if turn == 0.0 => return true,
            Lenience::Anything => return true,
            _ => {}
        }
        let Self { flat, previous, next, inner, grid, work, .. } = self;
        let is_inner = |other: u32| inner[other as usize];
        !grid.any([a, b, c], work, is_inner, |other| {
            if ids.contains(&other) {
                return false;
            }
            let point = flat[other as usize];
            let sides = [area(a, b, point), area(b, c, point), area(c, a, point)];
            if let Some(at) = [a, b, c].iter().position(|corner| *corner == point) {
                // The polygon touches itself at a corner of the ear (a hole joined by a slit, for example). That corner
                // blocks the ear if the polygon continues into the ear from there.
                let [tip, to, from] = [[a, b, c], [b, c, a], [c, a, b]][at];
                let into = |neighbour: u32| {
                    let goal = flat[neighbour as usize];
                    area(tip, to, goal) > 0.0 && area(from, tip, goal) > 0.0
                };
                return into(previous[other as usize]) || into(next[other as usize]);
            }
            match lenience {
                Lenience::Strict => sides.iter().all(|side| *side >= 0.0),
                _ => sides.iter().all(|side| *side > 0.0),
            }
        })
    }
}

/// Defects that an ear may have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Lenience {
    Strict,
    Touching,
    Anything,
}

impl Lenience {
    fn more(self) -> Self {
        match self {
            Self::Strict => Self::Touching,
            _ => Self::Anything,
        }
    }
}

/// Twice the signed area of a triangle.
fn area(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// The two triangles of a quad: cut from its first corner if both halves face as the whole does, else the other way.
fn quad(points: &[DVec3]) -> [[u32; 3]; 2] {
    let normal = newell(points.iter().copied());
    let facing = |[a, b, c]: [usize; 3]| (points[b] - points[a]).cross(points[c] - points[a]).dot(normal);
    let first = facing([0, 1, 2]).min(facing([0, 2, 3]));
    if first > 0.0 || first >= facing([1, 2, 3]).min(facing([1, 3, 0])) {
        [[0, 1, 2], [0, 2, 3]]
    } else {
        [[0, 1, 3], [1, 2, 3]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Triangulates a flat polygon and returns the sum of the areas and of their absolute values, doubled.
    fn areas(points: &[DVec3]) -> (usize, f64, f64) {
        let mut triangles = Vec::new();
        Triangulator::default().polygon(points, &mut triangles);
        let doubled = |[a, b, c]: [u32; 3]| {
            let [a, b, c] = [a, b, c].map(|at| points[at as usize].truncate());
            area(a, b, c)
        };
        (
            triangles.len(),
            triangles.iter().map(|t| doubled(*t)).sum(),
            triangles.iter().map(|t| doubled(*t).abs()).sum(),
        )
    }

    fn flat(points: &[[f64; 2]]) -> Vec<DVec3> {
        points.iter().map(|[x, y]| DVec3::new(*x, *y, 0.0)).collect()
    }

    #[test]
    fn triangles_cover_the_polygon_once() {
        let comb = (0..400).map(|i| [f64::from(i), if i % 2 == 0 { 0.0 } else { 10.0 + f64::from(i % 7) }]);
        let comb: Vec<[f64; 2]> = comb.chain([[399.0, -5.0], [0.0, -5.0]]).collect();
        let keyhole = [
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 4.0],
            [0.0, 4.0],
            [0.0, 0.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [3.0, 3.0],
            [3.0, 1.0],
            [1.0, 1.0],
        ];
        let cases: [(&str, &[[f64; 2]], f64); 6] = [
            ("arrow", &[[0.0, 0.0], [2.0, 1.0], [0.0, 2.0], [0.5, 1.0]], 3.0),
            ("arrow from its notch", &[[0.5, 1.0], [0.0, 0.0], [2.0, 1.0], [0.0, 2.0]], 3.0),
            ("letter L", &[[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]], 10.0),
            ("straight corners", &[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 2.0], [0.0, 2.0]], 8.0),
            ("square with a hole", &keyhole, 24.0),
            ("comb", &comb, {
                let n = comb.len();
                (0..n).map(|i| DVec2::from(comb[i]).perp_dot(DVec2::from(comb[(i + 1) % n]))).sum::<f64>().abs()
            }),
        ];
        for (name, points, wanted) in cases {
            for reversed in [false, true] {
                let mut points = flat(points);
                if reversed {
                    points.reverse();
                }
                for start in 0..points.len().min(12) {
                    points.rotate_left(start.min(1));
                    let (count, sum, covered) = areas(&points);
                    assert_eq!(count, points.len() - 2, "{name}");
                    assert!((sum.abs() - wanted).abs() < 1e-9 * wanted, "{name}: {sum}, not {wanted}");
                    assert!((covered - wanted).abs() < 1e-9 * wanted, "{name}: covers {covered}, not {wanted}");
                }
            }
        }
    }

    /// A comb of long teeth that all lean to one side: the box of each holds the roots of many others.
    #[test]
    fn leaning_teeth_take_no_work_for_all_others() {
        for count in [500, 4000] {
            let lean = f64::from(count / 2);
            let tooth = |number: i32| {
                let x = f64::from(number);
                [[x, 0.1 * f64::from(7 * number % 5)], [x + 0.5 + lean, lean]]
            };
            let end = f64::from(count);
            let mut comb: Vec<[f64; 2]> = (0..count).flat_map(tooth).collect();
            comb.extend([[end, 0.0], [end, -5.0], [0.0, -5.0]]);
            comb.reverse();
            let points = flat(&comb);
            let (mut triangulator, mut triangles) = (Triangulator::default(), Vec::new());
            triangulator.polygon(&points, &mut triangles);
            assert_eq!((triangles.len(), triangulator.fans), (comb.len() - 2, 0));
            assert!(triangulator.work < 200 * comb.len() as u64, "{} for {}", triangulator.work, comb.len());
            let next = |at: usize| DVec2::from(comb[(at + 1) % comb.len()]);
            let wanted = (0..comb.len()).map(|at| DVec2::from(comb[at]).perp_dot(next(at))).sum::<f64>().abs();
            let (_, sum, covered) = areas(&points);
            assert!((sum.abs() - wanted).abs() < 1e-9 * wanted, "{count}: {sum}, not {wanted}");
            assert!((covered - wanted).abs() < 1e-9 * wanted, "{count}: covers {covered}, not {wanted}");
        }
    }

    #[test]
    fn work_on_tangled_polygons_grows_with_their_corners() {
        let works = [1000, 2000, 4000].map(|count| {
            let mut state = 1_u32;
            let mut random = move || {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                f64::from(state >> 8)
            };
            let points: Vec<DVec3> = (0..count).map(|_| DVec3::new(random(), random(), 0.0)).collect();
            let (mut triangulator, mut triangles) = (Triangulator::default(), Vec::new());
            triangulator.polygon(&points, &mut triangles);
            assert_eq!((triangles.len(), triangulator.fans), (count - 2, 1));
            triangulator.work
        });
        for pair in works.windows(2) {
            assert!(pair[0] > 0 && pair[1] as f64 <= 2.3 * pair[0] as f64, "{works:?}");
        }
    }

    #[test]
    fn tangled_polygons_end() {
        let mut state = 1_u32;
        let mut random = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 24)
        };
        for (count, rounds) in [(3, 9), (4, 99), (5, 99), (6, 99), (9, 99), (30, 50), (300, 5), (3000, 1)] {
            for _ in 0..rounds {
                let points: Vec<DVec3> = (0..count).map(|_| DVec3::new(random(), random(), random())).collect();
                let mut triangles = Vec::new();
                Triangulator::default().polygon(&points, &mut triangles);
                assert_eq!(triangles.len(), count - 2);
                assert!(triangles.iter().flatten().all(|corner| (*corner as usize) < count));
            }
        }
        assert_eq!(areas(&[DVec3::ONE; 50]).0, 48, "all corners at one point");
    }
}
