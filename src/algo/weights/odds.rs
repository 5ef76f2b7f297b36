//! Shares of two joints as odds: the scale on which a blend is drawn out and moved.

use std::ops::Range;

use bevy::math::ops;

/// Shares beyond these stay as they are: so far from a joint there is nothing to share.
const SHARED: Range<f32> = 1e-3..1.0 - 1e-3;

/// A share whose odds have the logarithm `contrast * x + shift`, where `x` is that of `share`. A `contrast` below 1 draws
/// a blend out, a positive `shift` moves it towards the other side.
pub(super) fn shifted(share: f32, contrast: f32, shift: f32) -> f32 {
    if !SHARED.contains(&share) {
        return share;
    }
    let odds = contrast * ops::ln(share / (1.0 - share)) + shift;
    1.0 / (1.0 + ops::exp(-odds))
}
