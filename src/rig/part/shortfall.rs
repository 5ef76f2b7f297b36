//! Joints and sockets that parts of a template should have brought, and have not because of faults of their own.

use std::collections::HashSet;

use super::{PartError, PartInstance, SocketError};
use crate::rig::Rig;

/// Joints and sockets that are not there because parts are at fault: that others do not find them is no fault of theirs.
#[derive(Default)]
pub(in crate::rig) struct Shortfall {
    labels: HashSet<String>,
    titles: Vec<String>,
    /// True if nobody knows what one of the parts would have brought.
    is_unknown: bool,
}

impl Shortfall {
    /// Notes an instance whose part is not known.
    pub fn add_unknown(&mut self, instance: &PartInstance) {
        self.titles.push(instance.title().to_owned());
        self.is_unknown = true;
    }

    /// Notes an instance whose part, as it is fitted, could not be put into the rig.
    pub fn add(&mut self, instance: &PartInstance, fitted: &Rig) {
        self.titles.push(instance.title().to_owned());
        if instance.onto.is_empty() || instance.adds {
            let added = fitted.walk().skip(instance.onto.len());
            self.labels.extend(added.filter_map(|joint| joint.data.label.clone()));
            let labels = instance.changes.iter().filter_map(|change| change.label.clone());
            self.labels.extend(labels);
        }
    }

    /// Returns `true` for a label that one of the parts may have brought.
    pub fn may_have(&self, label: &str) -> bool {
        self.is_unknown || self.labels.contains(label)
    }

    /// Returns `true` for the fault of a part that lacks what another one should have brought.
    pub fn explains(&self, error: &PartError) -> bool {
        let is_of_part = |name: &str| {
            self.titles.iter().any(|title| name.strip_prefix(title.as_str()).is_some_and(|rest| rest.starts_with('.')))
        };
        match error {
            PartError::UnknownHostJoint { label, .. } | PartError::Socket(SocketError::NoJoint { label, .. }) => {
                self.may_have(label)
            }
            PartError::Socket(SocketError::Unknown { name, .. }) => is_of_part(name),
            _ => false,
        }
    }
}
