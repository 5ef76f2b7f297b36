//! Sides that a part goes onto: where its joints have partners on the other side, both, with a mirrored instance there.

use std::collections::HashSet;

use bevy::prelude::*;

use crate::{
    editor::ActiveRig,
    plugins::document::Symmetry,
    rig::{Rig, Uid, label::mirrored_label},
};

/// Choice of the sides that parts go onto.
///
/// Parts go onto both sides while live mirroring is on, and onto one while it is off; a person's choice holds until it is
/// switched.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PartSides {
    /// Choice of both sides, and whether live mirroring was on then.
    chosen: Option<(bool, bool)>,
}

impl PartSides {
    /// True if parts go onto both sides.
    pub fn are_both(world: &World) -> bool {
        let is_mirroring = is_mirroring(world);
        let sides = world.get_resource::<Self>().copied().unwrap_or_default();
        let chosen = sides.chosen.filter(|(_, then)| *then == is_mirroring);
        chosen.map_or(is_mirroring, |(both, _)| both)
    }

    /// The choice of one side or both.
    pub fn choice(world: &World, both: bool) -> Self {
        Self { chosen: Some((both, is_mirroring(world))) }
    }
}

fn is_mirroring(world: &World) -> bool {
    let active = world.get_resource::<ActiveRig>().and_then(|active| world.get::<Symmetry>(active.0));
    active.is_some_and(|symmetry| symmetry.0.is_some())
}

/// Partner of a joint: the one that it is paired with, or else the one whose label differs by its side alone.
pub(in crate::editor) fn partner(rig: &Rig, joint: Uid) -> Option<Uid> {
    let data = &rig.joint(joint)?.data;
    let paired = data.mirror.filter(|partner| rig.joint(*partner).is_some());
    let labelled = || rig.labelled(&mirrored_label(data.label.as_deref()?)?);
    paired.or_else(labelled).filter(|partner| *partner != joint)
}

/// Partners of joints in the same order; `None` if a joint has none, or both sides are among them.
pub(in crate::editor) fn partners(rig: &Rig, joints: &[Uid]) -> Option<Vec<Uid>> {
    let found: Vec<Uid> = joints.iter().map(|joint| partner(rig, *joint)).collect::<Option<_>>()?;
    let all: HashSet<Uid> = joints.iter().chain(&found).copied().collect();
    (!joints.is_empty() && all.len() == 2 * joints.len()).then_some(found)
}
