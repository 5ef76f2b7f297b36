//! Driven keys: a curve from one number to another.
//!
//! Between keys a curve holds, goes straight or runs smoothly; slopes that are left open are chosen so that the curve
//! never overshoots its keys (Fritsch and Butland, "A method for constructing local monotone piecewise cubic
//! interpolants", SIAM J. Sci. Stat. Comput. 5(2), 1984).

use thiserror::Error;

/// Interpolation of a curve from a key to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub enum Interpolation {
    /// Constant: the value of the key up to the next one.
    Constant,
    /// A straight line.
    Linear,
    /// A cubic with the slopes of both keys (Hermite).
    #[default]
    Smooth,
}

/// Extrapolation of a curve before its first and after its last key.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub enum Extrapolation {
    /// Constant: the value of the end key.
    #[default]
    Hold,
    /// Linear: a straight line with the slope of the curve at its end.
    Linear,
}

/// A key of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(default)]
pub struct CurveKey {
    /// The driving value.
    pub x: f32,
    /// The driven value.
    pub y: f32,
    /// Interpolation from this key to the next.
    pub interpolation: Interpolation,
    /// Slope (driven by driving units) before the key; chosen if open.
    pub slope_in: Option<f32>,
    /// Slope after the key; chosen if open.
    pub slope_out: Option<f32>,
}

impl CurveKey {
    /// A smooth key with chosen slopes.
    pub fn new(x: f32, y: f32) -> Self {
        Self { x, y, ..Self::default() }
    }
}

/// Error in the keys of a curve. Keys are counted from 1.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum CurveError {
    /// The curve has no key.
    #[error("the curve has no key; give it at least one")]
    Empty,
    /// A number is not finite.
    #[error("key {key} of the curve holds a number that is not finite; give it finite x, y and slopes")]
    NotFinite {
        /// Number of the key, from 1.
        key: usize,
    },
    /// Keys are not in order.
    #[error(
        "key {key} of the curve stands at x = {x}, which is not after x = {before} of the key before it; sort the \
         keys and leave only one at each x"
    )]
    Order {
        /// Number of the later key, from 1.
        key: usize,
        /// The later key's x.
        x: f32,
        /// The x of the key before it.
        before: f32,
    },
}

/// A key with both slopes filled in.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Knot {
    x: f32,
    y: f32,
    slope_in: f32,
    slope_out: f32,
    interpolation: Interpolation,
}

/// A curve through keys, ready to be evaluated.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    knots: Vec<Knot>,
    extrapolation: [Extrapolation; 2],
}

impl Curve {
    /// A curve through keys, which have ascending x; `beyond` gives the extrapolation before and after them.
    ///
    /// # Errors
    ///
    /// See [`CurveError`]: no key, numbers that are not finite, keys out of order.
    pub fn new(keys: &[CurveKey], extrapolation: [Extrapolation; 2]) -> Result<Self, CurveError> {
        if keys.is_empty() {
            return Err(CurveError::Empty);
        }
        for (i, key) in keys.iter().enumerate() {
            let slopes = [key.slope_in, key.slope_out];
            let finite = key.x.is_finite() && key.y.is_finite() && slopes.iter().flatten().all(|s| s.is_finite());
            if !finite {
                return Err(CurveError::NotFinite { key: i + 1 });
            }
            if let Some(before) = i.checked_sub(1).map(|before| keys[before].x)
                && before >= key.x
            {
                return Err(CurveError::Order { key: i + 1, x: key.x, before });
            }
        }
        let knots = (0..keys.len()).map(|i| {
            let key = &keys[i];
            let slope = chosen_slope(keys, i);
            Knot {
                x: key.x,
                y: key.y,
                slope_in: key.slope_in.unwrap_or(slope),
                slope_out: key.slope_out.unwrap_or(slope),
                interpolation: key.interpolation,
            }
        });
        Ok(Self { knots: knots.collect(), extrapolation })
    }

    /// The driven value at `x`; at NaN that of the first key. The value is always finite for keys of reasonable size:
    /// where numbers overflow, it is the value of the nearest key before.
    #[inline]
    pub fn evaluate(&self, x: f32) -> f32 {
        // Keys up to x, at least the first.
        let next = self.knots.partition_point(|knot| knot.x <= x);
        let Some(knot) = self.knots.get(next.saturating_sub(1)) else { return 0.0 };
        let y = match (next, self.knots.get(next)) {
            (0, _) => self.outside(0, x, knot),
            (_, None) => self.outside(1, x, knot),
            (_, Some(after)) => between(knot, after, x),
        };
        if y.is_finite() { y } else { knot.y }
    }

    /// The extrapolated value before the first (`side` 0) or after the last key (1).
    #[inline]
    fn outside(&self, side: usize, x: f32, knot: &Knot) -> f32 {
        match self.extrapolation[side] {
            Extrapolation::Hold => knot.y,
            Extrapolation::Linear => knot.y + self.end_slope(side, knot) * (x - knot.x),
        }
    }

    /// The slope at the end of a curve: of its last piece where that is straight, else of the key.
    fn end_slope(&self, side: usize, knot: &Knot) -> f32 {
        let count = self.knots.len();
        if count < 2 {
            return if side == 0 { knot.slope_in } else { knot.slope_out };
        }
        let piece = if side == 0 { [&self.knots[0], &self.knots[1]] } else { [&self.knots[count - 2], knot] };
        match piece[0].interpolation {
            Interpolation::Constant => 0.0,
            Interpolation::Linear => (piece[1].y - piece[0].y) / (piece[1].x - piece[0].x),
            Interpolation::Smooth if side == 0 => knot.slope_out,
            Interpolation::Smooth => knot.slope_in,
        }
    }
}

/// The value between two keys.
#[inline]
fn between(a: &Knot, b: &Knot, x: f32) -> f32 {
    let width = b.x - a.x;
    let t = (x - a.x) / width;
    match a.interpolation {
        Interpolation::Constant => a.y,
        Interpolation::Linear => a.y + (b.y - a.y) * t,
        Interpolation::Smooth => {
            let s = 1.0 - t;
            let line = a.y + (b.y - a.y) * (t * t * (3.0 - 2.0 * t));
            line + width * t * s * (a.slope_out * s - b.slope_in * t)
        }
    }
}

/// The slope of a key that leaves it open: flat at the ends and at hills and valleys, else a mean of both sides that
/// keeps the curve from overshooting.
fn chosen_slope(keys: &[CurveKey], i: usize) -> f32 {
    if i == 0 || i + 1 >= keys.len() {
        return 0.0;
    }
    let slope = |a: &CurveKey, b: &CurveKey| (b.y - a.y) / (b.x - a.x);
    let (before, after) = (slope(&keys[i - 1], &keys[i]), slope(&keys[i], &keys[i + 1]));
    // Signs are compared, because the product of the slopes may underflow.
    if before == 0.0 || after == 0.0 || (before < 0.0) != (after < 0.0) {
        return 0.0;
    }
    let (low, high) = (before.abs().min(after.abs()), before.abs().max(after.abs()));
    let mean = 3.0 * low * high / (high + 2.0 * low);
    if mean.is_finite() { mean.copysign(before) } else { 0.0 }
}
