//! Mean distances of clusters that are far from each other, by their moments.
//!
//! With Δ between the means of two clusters and x the difference of two points' places from these means, the distance
//! is |Δ + x|, a series in t = |x| / |Δ| whose terms are (up to sign) Gegenbauer polynomials of the angle: with p the
//! part of x along Δ and s = x², both in units of Δ,
//!
//! |Δ + x| / |Δ| = 1 + p + (s - p²)/2 + (p³ - ps)/2 + (-s² + 6p²s - 5p⁴)/8 + ...
//!
//! Its mean over all pairs needs the clusters' moments only. The n-th term is at most 2/(2n - 1) tⁿ, since it is a
//! difference of two Legendre polynomials over 2n - 1. So the error of omitting all terms after the fourth is at most
//! 2/9 E(t⁴) r/(1 - r), where r is the largest t. Clusters with a larger error are halved; small ones are summed.

use super::pair::{Points, Span};

/// Largest relative error of a distance by omitted moments; a fiftieth of it is usual.
const LEFT_OUT: f64 = 2e-5;
/// Largest block that is not halved.
const LEAF: u32 = 12;
/// Largest number of pairs of points that are summed directly.
const FEW: u32 = 32;

/// A block of points and its central moments.
#[derive(Clone, Copy, Default)]
pub(super) struct Block {
    mean: [f64; 3],
    /// Distance of the furthest point from the mean.
    radius: f64,
    /// E(x²).
    square: f64,
    /// E(x⁴), the length to the fourth.
    fourth: f64,
    /// xx, yy, zz, xy, xz, yz.
    second: [f64; 6],
    /// E(x x²), the length squared times the vector.
    third_trace: [f64; 3],
    /// xxx, yyy, zzz, xxy, xxz, yyx, yyz, zzx, zzy, xyz.
    third: [f64; 10],
    /// The moments of `second`, each times the length squared.
    fourth_trace: [f64; 6],
    /// xxxx, yyyy, zzzz, xxxy, xxxz, yyyx, yyyz, zzzx, zzzy, xxyy, xxzz, yyzz, xxyz, yyxz, zzxy.
    fourths: [f64; 15],
    span: Span,
    /// Index of the first of its two halves, or 0.
    halves: u32,
}

/// Blocks of one cluster, each split into halves; the first is the whole.
pub(super) struct Tree {
    blocks: Vec<Block>,
}

impl Tree {
    /// Cuts the points of `span` into blocks. `order` receives the indices of the points (from 0 at the start of the span) in
    /// the order in which blocks are contiguous.
    pub(super) fn new(points: &Points, span: Span, order: &mut [u32]) -> Self {
        let mut blocks = vec![Block { span, ..Block::default() }];
        let mut at = 0;
        while at < blocks.len() {
            let Span { start, size } = blocks[at].span;
            let part = &mut order[(start - span.start) as usize..(start - span.start + size) as usize];
            if size > LEAF {
                let axis = longest(points, part);
                let half = (size / 2).next_multiple_of(4);
                let along = [&points.x, &points.y, &points.z][axis];
                part.select_nth_unstable_by(half as usize, |&a, &b| {
                    along[a as usize].total_cmp(&along[b as usize]).then(a.cmp(&b))
                });
                blocks[at].halves = blocks.len() as u32;
                blocks.push(Block { span: Span { start, size: half }, ..Block::default() });
                blocks.push(Block { span: Span { start: start + half, size: size - half }, ..Block::default() });
            }
            at += 1;
        }
        for block in &mut blocks {
            let Span { start, size } = block.span;
            block.measure(points, &order[(start - span.start) as usize..(start - span.start + size) as usize]);
        }
        Self { blocks }
    }

    /// The sum of distances over all pairs of points, one of each. `points` are in the trees' order.
    pub(super) fn sum(&self, other: &Self, points: &Points) -> f64 {
        pairs(&self.blocks, 0, &other.blocks, 0, points)
    }
}

fn pairs(left: &[Block], a: u32, right: &[Block], b: u32, points: &Points) -> f64 {
    let (first, second) = (&left[a as usize], &right[b as usize]);
    let count = first.span.size * second.span.size;
    if count <= FEW {
        return points.sum(first.span, second.span);
    }
    if let Some(mean) = far(first, second) {
        return mean * f64::from(first.span.size) * f64::from(second.span.size);
    }
    if first.halves > 0 && (second.halves == 0 || first.radius >= second.radius) {
        pairs(left, first.halves, right, b, points) + pairs(left, first.halves + 1, right, b, points)
    } else if second.halves > 0 {
        pairs(left, a, right, second.halves, points) + pairs(left, a, right, second.halves + 1, points)
    } else {
        points.sum(first.span, second.span)
    }
}

fn longest(points: &Points, part: &[u32]) -> usize {
    let side = |values: &[f32]| {
        let (low, high) = part.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &at| {
            (low.min(values[at as usize]), high.max(values[at as usize]))
        });
        high - low
    };
    let (x, y, z) = (side(&points.x), side(&points.y), side(&points.z));
    if x >= y && x >= z {
        0
    } else if y >= z {
        1
    } else {
        2
    }
}

/// The mean distance, if the clusters are so far apart that the omitted terms do not matter.
fn far(a: &Block, b: &Block) -> Option<f64> {
    let delta = [b.mean[0] - a.mean[0], b.mean[1] - a.mean[1], b.mean[2] - a.mean[2]];
    let square = dot(delta, delta);
    let reach = a.radius + b.radius;
    // The largest t; the division below needs it away from one.
    if reach * reach * 9.0 > square {
        return None;
    }
    let inverse = 1.0 / square;
    // E|x|⁴ of the difference: the parts' own moments, and their mixed terms.
    let (c, k) = (&a.second, &b.second);
    let crossed = c[0] * k[0] + c[1] * k[1] + c[2] * k[2] + 2.0 * (c[3] * k[3] + c[4] * k[4] + c[5] * k[5]);
    let fourth = a.fourth + b.fourth + 2.0 * a.square * b.square + 4.0 * crossed;
    let s2 = fourth * inverse * inverse;
    let length = square.sqrt();
    let ratio = reach / length;
    if 2.0 / 9.0 * s2 * ratio > LEFT_OUT * (1.0 - ratio) {
        return None;
    }
    let over = 1.0 / length;
    let u = delta.map(|value| value * over);
    let [x, y, z] = u;
    let (xx, yy, zz, xy, xz, yz) = (x * x, y * y, z * z, x * y, x * z, y * z);
    let (ca, cb) = (times(c, u), times(k, u));
    let (pa, pb) = (dot(u, ca), dot(u, cb));
    let p2 = (pa + pb) * inverse;
    let s = (a.square + b.square) * inverse;
    // Odd moments of b - a: the moments of a change their sign.
    let t = |at: usize| b.third[at] - a.third[at];
    let p3 = t(0) * xx * x
        + t(1) * yy * y
        + t(2) * zz * z
        + 3.0 * (xx * (t(3) * y + t(4) * z) + yy * (t(5) * x + t(6) * z) + zz * (t(7) * x + t(8) * y))
        + 6.0 * t(9) * xy * z;
    let ps = x * (b.third_trace[0] - a.third_trace[0])
        + y * (b.third_trace[1] - a.third_trace[1])
        + z * (b.third_trace[2] - a.third_trace[2]);
    let f = |at: usize| a.fourths[at] + b.fourths[at];
    let p4 = f(0) * xx * xx
        + f(1) * yy * yy
        + f(2) * zz * zz
        + 4.0 * (xx * (f(3) * xy + f(4) * xz) + yy * (f(5) * xy + f(6) * yz) + zz * (f(7) * xz + f(8) * yz))
        + 6.0 * (f(9) * xx * yy + f(10) * xx * zz + f(11) * yy * zz)
        + 12.0 * (f(12) * xx * yz + f(13) * yy * xz + f(14) * zz * xy)
        + 6.0 * pa * pb;
    let g = |at: usize| a.fourth_trace[at] + b.fourth_trace[at];
    let p2s = g(0) * xx
        + g(1) * yy
        + g(2) * zz
        + 2.0 * (g(3) * xy + g(4) * xz + g(5) * yz)
        + pa * b.square
        + pb * a.square
        + 4.0 * dot(ca, cb);
    let cubic = (p3 - ps) * inverse * over;
    let quartic = (6.0 * p2s - 5.0 * p4) * inverse * inverse - s2;
    Some(length * (1.0 + 0.5 * (s - p2) + 0.5 * cubic + 0.125 * quartic))
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn times(c: &[f64; 6], u: [f64; 3]) -> [f64; 3] {
    [
        c[0] * u[0] + c[3] * u[1] + c[4] * u[2],
        c[3] * u[0] + c[1] * u[1] + c[5] * u[2],
        c[4] * u[0] + c[5] * u[1] + c[2] * u[2],
    ]
}

impl Block {
    fn measure(&mut self, points: &Points, part: &[u32]) {
        let share = 1.0 / part.len() as f64;
        let mut sum = [0.0; 3];
        for &at in part {
            let place = points.at(at as usize);
            for axis in 0..3 {
                sum[axis] += f64::from(place[axis]);
            }
        }
        self.mean = sum.map(|sum| sum * share);
        let mut widest = 0.0_f64;
        for &at in part {
            let place = points.at(at as usize);
            let [x, y, z] = [0, 1, 2].map(|axis| f64::from(place[axis]) - self.mean[axis]);
            let second = [x * x, y * y, z * z, x * y, x * z, y * z];
            let [xx, yy, zz, xy, xz, yz] = second;
            let square = xx + yy + zz;
            widest = widest.max(square);
            self.square += square;
            self.fourth += square * square;
            add(&mut self.second, &second);
            add(&mut self.fourth_trace, &second.map(|value| value * square));
            add(&mut self.third_trace, &[x * square, y * square, z * square]);
            add(&mut self.third, &[xx * x, yy * y, zz * z, xx * y, xx * z, yy * x, yy * z, zz * x, zz * y, xy * z]);
            let fourths = [
                xx * xx,
                yy * yy,
                zz * zz,
                xx * xy,
                xx * xz,
                yy * xy,
                yy * yz,
                zz * xz,
                zz * yz,
                xx * yy,
                xx * zz,
                yy * zz,
                xx * yz,
                yy * xz,
                zz * xy,
            ];
            add(&mut self.fourths, &fourths);
        }
        self.radius = widest.sqrt();
        self.square *= share;
        self.fourth *= share;
        scale(&mut self.second, share);
        scale(&mut self.fourth_trace, share);
        scale(&mut self.third_trace, share);
        scale(&mut self.third, share);
        scale(&mut self.fourths, share);
    }
}

fn add<const N: usize>(to: &mut [f64; N], values: &[f64; N]) {
    for (to, value) in to.iter_mut().zip(values) {
        *to += value;
    }
}

fn scale<const N: usize>(values: &mut [f64; N], by: f64) {
    for value in values {
        *value *= by;
    }
}
