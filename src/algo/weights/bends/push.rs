//! Lengths by which half joints leave a bend.

use super::{Bend, Part, Pose};

/// Loss of volume, as a share of a section, that is aimed at.
const LOSS: f32 = 0.08;
/// Gain of volume, as a share of a section, that is allowed where a joint turns aside.
const SWELL: f32 = 0.55;
/// Angle by which joints turn aside, in radians.
const ASIDE: f32 = 1.0;

/// The least push of a bend with which a mesh loses little, in limits.
pub(super) fn push(bend: &Bend, part: &Part, section: f32) -> Option<f32> {
    let lost = |push: f32| part.lost(&Pose::new(bend, bend.axis, bend.angle, push)) / section;
    let [least, mut most] = bend.push;
    for (axis, angle) in bend.aside.into_iter().flat_map(|axis| [(axis, ASIDE), (axis, -ASIDE)]) {
        let gained = |push: f32| -part.lost(&Pose::new(bend, axis, angle, push)) / section;
        let (low, high) = (gained(least), gained(most));
        let allowed = SWELL.max(low);
        if high > allowed {
            most = least + (most - least) * (allowed - low) / (high - low);
        }
    }
    let (mut low, mut high) = ((least, lost(least)), (most, lost(most)));
    if !(low.1.is_finite() && high.1.is_finite()) {
        return None;
    }
    if low.1 <= LOSS {
        return Some(least);
    }
    if high.1 >= LOSS {
        return (high.1 < low.1).then_some(most);
    }
    // Volume is a polynomial of the third degree in the length, and nearly straight.
    for _ in 0..4 {
        let push = low.0 + (high.0 - low.0) * (low.1 - LOSS) / (low.1 - high.1);
        let is = (push, lost(push));
        if is.1 > LOSS { low = is } else { high = is }
    }
    let off = |end: (f32, f32)| (end.1 - LOSS).abs();
    Some(if off(low) < off(high) { low.0 } else { high.0 })
}
