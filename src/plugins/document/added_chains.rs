//! Drawn chains, and the joints that requests of one frame added: a chain may go on from one of them.

use std::{collections::BTreeMap, iter};

use bevy::prelude::*;

use super::Change;
use crate::rig::{Rig, Uid};

/// Parent of a drawn chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChainParent {
    /// Joint that is active when the request is carried out; without one the chain is a root.
    Active,
    /// Joint of the rig.
    Joint(Uid),
    /// Joint that a [`Change::Place`] or [`Change::Draw`] of the same frame adds.
    Added {
        /// Number of that request among those of the frame that place or draw joints of the rig, from zero.
        request: usize,
        /// Number of the joint in its chain, from zero.
        joint: usize,
    },
}

/// Joints that requests of one frame placed and drew, by rig and request.
#[derive(Default)]
pub(super) struct AddedChains(BTreeMap<Entity, Vec<Vec<Uid>>>);

impl AddedChains {
    /// Joint that a chain hangs on; `None` for a root.
    pub(super) fn parent(&self, rig: Entity, document: &Rig, parent: ChainParent, active: Option<Uid>) -> Option<Uid> {
        match parent {
            ChainParent::Active => active.filter(|joint| document.joint(*joint).is_some()),
            ChainParent::Joint(joint) => Some(joint),
            ChainParent::Added { request, joint } => self.0.get(&rig)?.get(request)?.get(joint).copied(),
        }
    }

    /// Notes the joints of a request that places or draws some; `tip` is the last of them, or `None` if it was refused.
    pub(super) fn note(&mut self, rig: Entity, document: &Rig, request: &Change, tip: Option<Uid>) {
        let count = match request {
            Change::Place(_) => 1,
            Change::Draw { positions, .. } => positions.len(),
            _ => return,
        };
        let upwards = |tip: Uid| iter::once(tip).chain(document.ancestors(tip).map(|joint| joint.data.uid)).take(count);
        let mut chain: Vec<Uid> = tip.into_iter().flat_map(upwards).collect();
        chain.reverse();
        self.0.entry(rig).or_default().push(chain);
    }
}
