//! Mean distances by summing over all pairs of points.

use wide::f32x4;

/// Points as three lists of coordinates.
#[derive(Clone, Default)]
pub(super) struct Points {
    pub(super) x: Vec<f32>,
    pub(super) y: Vec<f32>,
    pub(super) z: Vec<f32>,
}

/// Range of a cluster's points.
#[derive(Clone, Copy, Default)]
pub(super) struct Span {
    pub(super) start: u32,
    pub(super) size: u32,
}

/// Largest relative error of [`Points::sum`]: differences, squares, sums and the root are rounded once each (about 3
/// units in all), and a lane sums at most nine in single precision.
pub(super) const ROUNDING: f64 = 8e-7;

/// Number of groups of four that are summed in single precision before they are added in double precision.
const BLOCK: usize = 8;

impl Points {
    pub(super) fn with_capacity(capacity: usize) -> Self {
        Self { x: Vec::with_capacity(capacity), y: Vec::with_capacity(capacity), z: Vec::with_capacity(capacity) }
    }

    pub(super) fn len(&self) -> usize {
        self.x.len()
    }

    pub(super) fn push(&mut self, place: [f32; 3]) {
        self.x.push(place[0]);
        self.y.push(place[1]);
        self.z.push(place[2]);
    }

    /// Appends a cluster's points of another list.
    pub(super) fn append(&mut self, from: &Self, span: Span) {
        let range = span.range();
        self.x.extend_from_slice(&from.x[range.clone()]);
        self.y.extend_from_slice(&from.y[range.clone()]);
        self.z.extend_from_slice(&from.z[range]);
    }

    /// Appends a cluster's points of this list once more.
    pub(super) fn repeat(&mut self, span: Span) {
        self.x.extend_from_within(span.range());
        self.y.extend_from_within(span.range());
        self.z.extend_from_within(span.range());
    }

    pub(super) fn at(&self, index: usize) -> [f32; 3] {
        [self.x[index], self.y[index], self.z[index]]
    }

    /// The sum of distances over all pairs, in double precision.
    pub(super) fn exact_sum(&self, a: Span, b: Span) -> f64 {
        let mut sum = 0.0;
        for i in a.range() {
            let place = self.at(i).map(f64::from);
            for j in b.range() {
                let x = f64::from(self.x[j]) - place[0];
                let y = f64::from(self.y[j]) - place[1];
                let z = f64::from(self.z[j]) - place[2];
                sum += (x * x + y * y + z * z).sqrt();
            }
        }
        sum
    }

    /// The sum of distances over all pairs, with the relative error [`ROUNDING`]. The order of the two matters for the
    /// last bits.
    pub(super) fn sum(&self, a: Span, b: Span) -> f64 {
        // The longer one is processed in fours.
        let (a, b) = if a.size > b.size { (b, a) } else { (a, b) };
        if b.size < 4 {
            return self.exact_sum(a, b);
        }
        let (rows, columns) = (a.range(), b.range());
        let (bx, by, bz) = (&self.x[columns.clone()], &self.y[columns.clone()], &self.z[columns]);
        let (fx, rest_x) = bx.as_chunks::<4>();
        let (fy, rest_y) = by.as_chunks::<4>();
        let (fz, rest_z) = bz.as_chunks::<4>();
        let mut total = 0.0;
        let rows = self.x[rows.clone()].iter().zip(&self.y[rows.clone()]).zip(&self.z[rows]);
        let tail = Tail::new(rest_x, rest_y, rest_z);
        for ((&x, &y), &z) in rows {
            let (x, y, z) = (f32x4::splat(x), f32x4::splat(y), f32x4::splat(z));
            let mut sum = tail.distances(x, y, z);
            let blocks = fx.chunks(BLOCK).zip(fy.chunks(BLOCK)).zip(fz.chunks(BLOCK));
            for ((cx, cy), cz) in blocks {
                for ((&px, &py), &pz) in cx.iter().zip(cy).zip(cz) {
                    let dx = f32x4::new(px) - x;
                    let dy = f32x4::new(py) - y;
                    let dz = f32x4::new(pz) - z;
                    sum += (dx * dx + dy * dy + dz * dz).sqrt();
                }
                total += add(sum);
                sum = f32x4::ZERO;
            }
        }
        total
    }
}

impl Span {
    fn range(self) -> std::ops::Range<usize> {
        self.start as usize..(self.start + self.size) as usize
    }
}

/// The points left over from fours.
struct Tail {
    x: f32x4,
    y: f32x4,
    z: f32x4,
    used: f32x4,
}

impl Tail {
    fn new(x: &[f32], y: &[f32], z: &[f32]) -> Self {
        let four = |values: &[f32]| {
            let mut four = [0.0; 4];
            four[..values.len()].copy_from_slice(values);
            f32x4::new(four)
        };
        let mut used = [0.0; 4];
        used[..x.len()].fill(1.0);
        Self { x: four(x), y: four(y), z: four(z), used: f32x4::new(used) }
    }

    fn distances(&self, x: f32x4, y: f32x4, z: f32x4) -> f32x4 {
        let (x, y, z) = (self.x - x, self.y - y, self.z - z);
        (x * x + y * y + z * z).sqrt() * self.used
    }
}

fn add(four: f32x4) -> f64 {
    let [a, b, c, d] = four.to_array();
    (f64::from(a) + f64::from(c)) + (f64::from(b) + f64::from(d))
}
