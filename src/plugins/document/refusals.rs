//! Refused writes that were told: code that repeats one, in each frame for example, is told once.
//!
//! A refused write is put back, and a later look finds the component as it should be: that is no reason to tell the next
//! refusal. Another equal value is, and so is a write that is accepted.

use std::collections::{BTreeSet, HashMap};

use bevy::prelude::*;

use super::{EditRefusal, error::EntityWriteError};
use crate::rig::Uid;

/// Bearer of components that other code wrote.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(in crate::plugins) enum Bearer {
    /// Part of the rig of this entity; the part may get another entity.
    Part(Entity, Uid),
    /// Any other entity.
    Entity(Entity),
}

/// Components of each bearer whose refused writes were told. The value is true until the component was looked at once
/// more, as it was put back.
#[derive(Debug, Default)]
pub(in crate::plugins) struct RefusalLog(HashMap<Bearer, HashMap<&'static str, bool>>);

impl RefusalLog {
    /// True if no refusal was told that is still remembered.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Takes all refusals of one look at a bearer, and returns the ones to tell.
    pub fn look(&mut self, bearer: Bearer, refused: Vec<EntityWriteError>) -> Vec<EntityWriteError> {
        if refused.is_empty() && !self.0.contains_key(&bearer) {
            return refused;
        }
        let told = self.0.entry(bearer).or_default();
        told.retain(|component, is_put_back| {
            refused.iter().any(|reason| reason.component() == *component) || std::mem::take(is_put_back)
        });
        let fresh = refused.into_iter().filter(|reason| told.insert(reason.component(), true).is_none()).collect();
        if told.is_empty() {
            self.0.remove(&bearer);
        }
        fresh
    }

    /// Takes all refusals of one look at a bearer, and sends and logs the ones to tell. Returns `true` if there is one.
    pub fn tell(
        &mut self,
        bearer: Bearer,
        rig: Entity,
        refused: Vec<EntityWriteError>,
        mut send: impl FnMut(EditRefusal),
    ) -> bool {
        let fresh = self.look(bearer, refused);
        let has_told = !fresh.is_empty();
        for reason in fresh {
            warn!("{reason}");
            send(EditRefusal { rig, request: None, reason: reason.into() });
        }
        has_told
    }

    /// Takes a look at all bearers but these, nothing of which is refused.
    pub fn look_at_others(&mut self, seen: &BTreeSet<Bearer>) {
        self.0.retain(|bearer, told| {
            if !seen.contains(bearer) {
                told.retain(|_, is_put_back| std::mem::take(is_put_back));
            }
            !told.is_empty()
        });
    }

    /// Lets the next refusal of a component be told, because a write to it was accepted.
    pub fn accept(&mut self, bearer: Bearer, component: &'static str) {
        if let Some(told) = self.0.get_mut(&bearer) {
            told.remove(component);
        }
    }

    /// Forgets bearers that are gone.
    pub fn retain(&mut self, is_there: impl Fn(Bearer) -> bool) {
        self.0.retain(|bearer, _| is_there(*bearer));
    }
}
