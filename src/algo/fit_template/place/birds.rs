//! Heads of birds: beak and skull before a neck that is drawn in or stretched.

use super::Work;
use crate::algo::fit_template::{
    limbs::{Limb, LimbKind},
    line::CentreLine,
};

/// Most of a head's free length that is beak and skull.
const SKULL: f32 = 0.85;

impl Work<'_> {
    /// Gives beak and skull of a bird the size that they have in the whole figure. Birds draw their necks in and stretch them, so
    /// the length from the end of the beak to the chest is shared out over the bones of the neck alone.
    pub(super) fn keep_skull(&self, limb: &Limb, line: &CentreLine, lengths: &mut [f32]) {
        if limb.kind != LimbKind::Head || self.template.is_upright() || self.template.is_on_fours() {
            return;
        }
        let (Some(&whole), Some(&head)) = (lengths.first(), lengths.last()) else { return };
        let skull = (limb.beyond * self.hypothesis.alignment.scale).min(SKULL * line.free);
        if whole - head > 1e-9 && skull < whole {
            let share = (whole - skull) / (whole - head);
            lengths.iter_mut().for_each(|length| *length = whole - (whole - *length) * share);
        }
    }
}
