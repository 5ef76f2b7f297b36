//! Signed distance shapes and smooth blends: the clay that the models are made of.
//!
//! A field is a function from a point (metres) to an approximate signed distance, negative inside. Only additions,
//! products, divisions and square roots are used, so that every machine computes the same bits.

use glam::{DMat3, DVec3, dvec3};

/// Sine and cosine of an angle in degrees between -180 and 180, by their power series.
pub fn sin_cos(degrees: f64) -> (f64, f64) {
    let x = degrees * (std::f64::consts::PI / 180.0);
    let (mut sin, mut cos, mut term) = (0.0, 0.0, 1.0);
    for n in 0..32 {
        match n % 4 {
            0 => cos += term,
            1 => sin += term,
            2 => cos -= term,
            _ => sin -= term,
        }
        term *= x / f64::from(n + 1);
    }
    (sin, cos)
}

/// Rotation about the X axis by degrees, Y towards Z.
pub fn turn_x(degrees: f64) -> DMat3 {
    let (s, c) = sin_cos(degrees);
    DMat3::from_cols(DVec3::X, dvec3(0.0, c, s), dvec3(0.0, -s, c))
}

/// Rotation about the Y axis by degrees, Z towards X.
pub fn turn_y(degrees: f64) -> DMat3 {
    let (s, c) = sin_cos(degrees);
    DMat3::from_cols(dvec3(c, 0.0, -s), DVec3::Y, dvec3(s, 0.0, c))
}

/// Rotation about the Z axis by degrees, X towards Y.
pub fn turn_z(degrees: f64) -> DMat3 {
    let (s, c) = sin_cos(degrees);
    DMat3::from_cols(dvec3(c, s, 0.0), dvec3(-s, c, 0.0), DVec3::Z)
}

/// A place with an orientation.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// The origin.
    pub at: DVec3,
    /// Columns are the axes; orthonormal.
    pub axes: DMat3,
}

impl Frame {
    /// The frame of the world.
    pub const WORLD: Self = Self { at: DVec3::ZERO, axes: DMat3::IDENTITY };

    /// A point given in the frame, in the outer space.
    pub fn out(&self, p: DVec3) -> DVec3 {
        self.at + self.axes * p
    }

    /// A point of the outer space, in the frame.
    pub fn local(&self, p: DVec3) -> DVec3 {
        self.axes.transpose() * (p - self.at)
    }

    /// A frame whose origin is `at` (in this frame), turned by `axes` against this frame.
    pub fn child(&self, at: DVec3, axes: DMat3) -> Self {
        Self { at: self.out(at), axes: self.axes * axes }
    }
}

/// Union with a fillet of about `k`; never further out than `k / 4` beyond the plain union.
pub fn union(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0);
    a.min(b) - h * h / (4.0 * k)
}

/// Intersection with a rounded edge of about `k`.
pub fn intersect(a: f64, b: f64, k: f64) -> f64 {
    -union(-a, -b, k)
}

/// `a` without `b`, with a rounded rim of about `k`.
pub fn cut(a: f64, b: f64, k: f64) -> f64 {
    intersect(a, -b, k)
}

/// Smooth step from 0 at `from` to 1 at `to`, with flat ends.
pub fn ease(from: f64, to: f64, x: f64) -> f64 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Ellipsoid along the axes; close to a distance near its surface.
pub fn ellipsoid(p: DVec3, center: DVec3, radii: DVec3) -> f64 {
    let q = (p - center) / radii;
    let k0 = q.length();
    let k1 = (q / radii).length();
    if k1 < 1e-9 { -radii.min_element() } else { k0 * (k0 - 1.0) / k1 }
}

/// Ellipsoid along the axes of a frame.
pub fn ellipsoid_in(p: DVec3, frame: &Frame, radii: DVec3) -> f64 {
    ellipsoid(frame.local(p), DVec3::ZERO, radii)
}

/// Capsule from `a` to `b` whose radius runs from `ra` to `rb`.
pub fn cone(p: DVec3, a: DVec3, b: DVec3, ra: f64, rb: f64) -> f64 {
    let ab = b - a;
    let t = ((p - a).dot(ab) / ab.length_squared()).clamp(0.0, 1.0);
    (p - a - ab * t).length() - (ra + (rb - ra) * t)
}

/// A tube along a smooth line through points with radii, with round ends.
pub fn path(p: DVec3, nodes: &[(DVec3, f64)]) -> f64 {
    const PIECES: usize = 3;
    let last = nodes.len() - 1;
    let slope = |i: usize| {
        let (a, b) = (nodes[i.saturating_sub(1)], nodes[(i + 1).min(last)]);
        if i == 0 || i == last { (b.0 - a.0, b.1 - a.1) } else { ((b.0 - a.0) / 2.0, (b.1 - a.1) / 2.0) }
    };
    let mut least = f64::MAX;
    for i in 0..last {
        let ((pa, ra), (pb, rb)) = (nodes[i], nodes[i + 1]);
        let ((ta, sa), (tb, sb)) = (slope(i), slope(i + 1));
        let mut from = (pa, ra);
        for piece in 1..=PIECES {
            let t = piece as f64 / PIECES as f64;
            let (t2, t3) = (t * t, t * t * t);
            let w = [2.0 * t3 - 3.0 * t2 + 1.0, t3 - 2.0 * t2 + t, 3.0 * t2 - 2.0 * t3, t3 - t2];
            let to = (pa * w[0] + ta * w[1] + pb * w[2] + tb * w[3], ra * w[0] + sa * w[1] + rb * w[2] + sb * w[3]);
            least = least.min(cone(p, from.0, to.0, from.1, to.1));
            from = to;
        }
    }
    least
}

/// Draws space together around a point: within `core` of `center` lengths shrink to `scale`; from `radius` on nothing
/// changes.
pub fn lens(p: DVec3, center: DVec3, core: f64, radius: f64, scale: f64) -> DVec3 {
    let r = p - center;
    center + r * (scale + (1.0 - scale) * ease(core, radius, r.length()))
}

/// A cross-section of a [`Loft`]: how far it reaches along both axes.
#[derive(Debug, Clone, Copy)]
pub struct Section {
    /// Place along the loft's axis.
    pub s: f64,
    /// Least and greatest `u`.
    pub u: [f64; 2],
    /// Least and greatest `v`.
    pub v: [f64; 2],
}

/// Shorthand for a [`Section`].
pub const fn section(s: f64, u: [f64; 2], v: [f64; 2]) -> Section {
    Section { s, u, v }
}

/// A tube through cross-sections, each made of four quarter ellipses, with smooth lines between them.
#[derive(Debug, Clone)]
pub struct Loft {
    sections: Vec<Section>,
    /// Place of the widest line of a section between its ends, for `u` and `v` (0.5 is the middle).
    middle: [f64; 2],
    /// 0: ellipses; 1: rounded squares.
    boxy: f64,
    /// Rate at which it closes beyond its ends.
    closing: f64,
}

impl Loft {
    /// A loft through at least two sections in rising order of `s`.
    pub fn new(sections: &[Section], boxy: f64) -> Self {
        Self { sections: sections.to_vec(), middle: [0.5; 2], boxy, closing: 1.4 }
    }

    /// Moves the widest line of all sections; see the field `middle`.
    pub fn with_middle(mut self, u: f64, v: f64) -> Self {
        self.middle = [u, v];
        self
    }

    /// Closes faster or slower beyond the ends than the usual 1.4.
    pub fn with_closing(mut self, closing: f64) -> Self {
        self.closing = closing;
        self
    }

    /// The section at `s`: cubic between the given ones, constant beyond the ends.
    fn at(&self, s: f64) -> [f64; 4] {
        let list = &self.sections;
        let n = list.len();
        let value = |i: usize| [list[i].u[0], list[i].u[1], list[i].v[0], list[i].v[1]];
        if s <= list[0].s {
            return value(0);
        }
        if s >= list[n - 1].s {
            return value(n - 1);
        }
        let i = list.partition_point(|x| x.s <= s) - 1;
        let h = list[i + 1].s - list[i].s;
        let t = (s - list[i].s) / h;
        let (a, b) = (value(i), value(i + 1));
        let slope = |j: usize, c: usize| {
            if j == 0 || j == n - 1 {
                return 0.0;
            }
            let (h0, h1) = (list[j].s - list[j - 1].s, list[j + 1].s - list[j].s);
            let (d0, d1) = ((value(j)[c] - value(j - 1)[c]) / h0, (value(j + 1)[c] - value(j)[c]) / h1);
            (d0 * h1 + d1 * h0) / (h0 + h1)
        };
        let (t2, t3) = (t * t, t * t * t);
        std::array::from_fn(|c| {
            (2.0 * t3 - 3.0 * t2 + 1.0) * a[c]
                + (t3 - 2.0 * t2 + t) * h * slope(i, c)
                + (3.0 * t2 - 2.0 * t3) * b[c]
                + (t3 - t2) * h * slope(i + 1, c)
        })
    }

    /// Approximate distance of the point `(s, u, v)`.
    pub fn distance(&self, s: f64, u: f64, v: f64) -> f64 {
        let e = self.at(s);
        let (cu, cv) = (e[0] + (e[1] - e[0]) * self.middle[0], e[2] + (e[3] - e[2]) * self.middle[1]);
        let (u, v) = (u - cu, v - cv);
        let ru = if u < 0.0 { cu - e[0] } else { e[1] - cu };
        let rv = if v < 0.0 { cv - e[2] } else { e[3] - cv };
        let (a, b) = (u / ru, v / rv);
        let (a2, b2) = (a * a, b * b);
        let round = (a2 + b2).sqrt();
        let square = (a2 * a2 + b2 * b2).sqrt().sqrt();
        let k0 = round + (square - round) * self.boxy;
        let k1 = ((a / ru) * (a / ru) + (b / rv) * (b / rv)).sqrt();
        let inner = -ru.min(rv);
        let d = if round < 1e-6 { inner } else { ((k0 - 1.0) * round / k1).max(inner) };
        let list = &self.sections;
        let over = (list[0].s - s).max(s - list[list.len() - 1].s);
        // Beyond its ends a loft closes gradually, so that nothing of an end shows inside another shape.
        let over = over.max(0.0);
        d + self.closing * over * over / (over + 0.012)
    }
}

/// The gradient of a field by central differences over `step`.
pub fn gradient(field: &(impl Fn(DVec3) -> f64 + ?Sized), p: DVec3, step: f64) -> DVec3 {
    let d = |e: DVec3| (field(p + e * step) - field(p - e * step)) / (2.0 * step);
    dvec3(d(DVec3::X), d(DVec3::Y), d(DVec3::Z))
}
