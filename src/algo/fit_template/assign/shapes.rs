//! Shapes of branches: heads are thick, arms and tails are not, and a bird's head is round and its tail is flat.

use super::{Assignment, Search};
use crate::algo::fit_template::limbs::LimbKind;

/// Penalties of an arm or a wing, and of a tail, that is thicker than the head, for a factor of e.
const THICKER: f32 = 0.12;
const THICKER_TAIL: f32 = 0.3;
/// Thickness that the trunk may have, as a factor of the head's.
const STOUT: f32 = 1.8;
/// Thickness that another branch may have, as a factor of the head's.
const LOOSELY: f32 = 1.3;
/// Penalties of a head of a bird that is flat and of a tail that is round, for a factor of e.
const FLAT_HEAD: f32 = 0.15;
const ROUND_TAIL: f32 = 0.08;
/// Flatness up to which a branch may be a bird's head, and from which on it may be its tail.
const ROUND: f32 = 1.7;
const FLAT: f32 = 2.5;

impl Search<'_> {
    /// The penalty of branches that are not shaped as the limbs that they are chosen for.
    pub(super) fn unlike_shapes(&self, chosen: &Assignment) -> f32 {
        let mut cost = self.unlike_bird(chosen);
        let thickness = |leaf: usize| self.tree.lines[self.leaves[leaf]].thickness();
        let heads = self.template.limbs.iter().zip(chosen).filter(|(l, _)| l.kind == LimbKind::Head);
        if let Some(head) = heads.filter_map(|(_, c)| *c).next() {
            // The thickest of all branches that do not belong to the head.
            let others = (0..self.leaves.len())
                .filter(|&o| !self.tree.branches.on_one_way(self.leaves[o], self.leaves[head]))
                .map(|o| thickness(o) / if chosen.contains(&Some(o)) { 1.0 } else { LOOSELY });
            let thicker = bevy::math::ops::ln(others.fold(0.0, f32::max).max(1.0) / (LOOSELY * thickness(head)));
            cost += THICKER * thicker.max(0.0);
            // Where the centre of the branches lies in a large head, no branch is the head.
            let thicker = bevy::math::ops::ln(self.tree.trunk_thickness / (STOUT * thickness(head)));
            cost += THICKER * thicker.max(0.0);
            for (limb, leaf) in self.template.limbs.iter().zip(chosen) {
                let weight = match limb.kind {
                    LimbKind::Tail => THICKER_TAIL,
                    LimbKind::Arm | LimbKind::Wing => THICKER,
                    _ => continue,
                };
                if let Some(leaf) = *leaf {
                    let thicker = bevy::math::ops::ln(thickness(leaf) / thickness(head));
                    cost += weight * thicker.max(0.0);
                }
            }
        }
        cost
    }

    /// The penalty of heads and tails of a template with wings that are not shaped as those of birds. Spread and folded wings say
    /// little of where the front is, and a fan of feathers is as long as a head with its neck.
    fn unlike_bird(&self, chosen: &Assignment) -> f32 {
        if self.template.count(LimbKind::Wing) == 0 {
            return 0.0;
        }
        let penalty = |kind: LimbKind, leaf: usize| {
            let flatness = self.tree.lines[self.leaves[leaf]].flatness(self.graph.cell).max(1.0);
            match kind {
                LimbKind::Head => FLAT_HEAD * bevy::math::ops::ln(flatness / ROUND).max(0.0),
                LimbKind::Tail => ROUND_TAIL * bevy::math::ops::ln(FLAT / flatness).max(0.0),
                _ => 0.0,
            }
        };
        let limbs = self.template.limbs.iter().zip(chosen);
        limbs.filter_map(|(limb, leaf)| Some(penalty(limb.kind, (*leaf)?))).sum()
    }
}
