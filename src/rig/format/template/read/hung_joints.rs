//! Joints of a template beside those of its parts: they hang on what parts bring, and are in groups that parts look for.

use std::collections::{BTreeMap, HashMap, HashSet};

use super::super::{
    HungJoint, Template,
    shorthand::{Declarations, NameError},
};
use crate::rig::{
    Rig, RigEdit, RigJoint, SourceError, Uid, format::source::TextLines, nearest::did_you_mean, part::Shortfall,
    reference::MOST_COMPARED,
};

/// Reason why a joint of a template cannot hang on a joint that a part brings.
#[derive(Debug, thiserror::Error)]
enum HangError {
    /// A parent that neither the file nor one of its parts has.
    #[error("there is no joint \"{name}\", neither in the file nor in what its parts bring{nearest}")]
    Unknown {
        /// Label or uid of the parent.
        name: String,
        /// End of the sentence with similar labels.
        nearest: String,
    },
    /// A label of several joints.
    #[error(transparent)]
    Ambiguous(#[from] NameError),
    /// A parent that hangs on the joint.
    #[error("joint \"{name}\" hangs on this joint, by a part; give one of the two another parent")]
    Circle {
        /// Label or uid of the parent.
        name: String,
    },
}

impl Template {
    /// Hangs joints on those of their parents that are in the rig by now. The others go on waiting.
    pub(super) fn hang_joints(&mut self, waiting: &mut Vec<HungJoint>) {
        if waiting.is_empty() {
            return;
        }
        let bearers = bearers(&self.rig, waiting);
        waiting.retain(|hung| {
            let Some([parent]) = bearers.get(&hung.parent).map(Vec::as_slice) else { return true };
            self.rig.apply(&RigEdit::SetParent { joint: hung.joint, parent: Some(*parent), index: usize::MAX }).is_err()
        });
    }

    /// Puts the joints that hang on what parts have brought behind the joints of the parts. Returns what is wrong with the parents
    /// of the others, which are still `waiting`; a parent of the `shortfall` is the fault of a part, and not told again.
    pub(super) fn settle_hung(
        &mut self,
        hung: &[HungJoint],
        waiting: &[HungJoint],
        source: &str,
        shortfall: &Shortfall,
    ) -> Vec<SourceError> {
        if hung.is_empty() {
            return Vec::new();
        }
        for HungJoint { joint, .. } in hung {
            if let Some(parent) = self.rig.joint(*joint).and_then(|joint| joint.parent) {
                let done =
                    self.rig.apply(&RigEdit::SetParent { joint: *joint, parent: Some(parent), index: usize::MAX });
                debug_assert!(done.is_ok(), "the last place below a parent was refused: {done:?}");
            }
        }
        let bearers = bearers(&self.rig, hung);
        let (mut faults, mut compared) = (Vec::new(), 0);
        for one in hung {
            let name = one.parent.clone();
            let uids = bearers.get(&name).map(Vec::as_slice).unwrap_or_default();
            let fault = match uids {
                [] if shortfall.may_have(&name) => continue,
                [] => {
                    let is_compared = compared < MOST_COMPARED;
                    compared += self.rig.len();
                    let nearest = if is_compared { did_you_mean(&name, labels(&self.rig)) } else { String::new() };
                    HangError::Unknown { nearest, name }
                }
                [_] if !waiting.contains(one) => continue,
                [_] => HangError::Circle { name },
                uids => NameError::ambiguous("joint", &name, uids).into(),
            };
            faults.push((one.joint, fault));
        }
        if faults.is_empty() {
            return Vec::new();
        }
        let (lines, places) = (TextLines::new(source), places_of_parents(source));
        let place = |joint: &Uid| places.get(joint).copied().unwrap_or_default();
        faults.into_iter().map(|(joint, fault)| lines.error(place(&joint), fault.to_string())).collect()
    }
}

impl Template {
    /// Takes joints onto which no part goes out of their groups: a part takes a group of its name where nobody else is in it, and
    /// joints of the template itself do not keep it from that. Returns the joints with their groups.
    pub(super) fn take_groups(&mut self) -> Vec<(Uid, Uid)> {
        let groups = self.grouped();
        groups.iter().for_each(|(joint, _)| self.set_group(*joint, None));
        groups
    }

    /// Joints in groups onto which no part goes, with their groups.
    fn grouped(&self) -> Vec<(Uid, Uid)> {
        let onto: HashSet<&str> = self.parts.iter().flat_map(|part| &part.onto).map(String::as_str).collect();
        let is_free = |joint: &&RigJoint| joint.data.label.as_deref().is_none_or(|label| !onto.contains(label));
        let grouped = |joint: &RigJoint| Some((joint.data.uid, joint.data.group?));
        self.rig.walk().filter(is_free).filter_map(grouped).collect()
    }

    /// Puts joints back into their groups.
    pub(super) fn give_groups(&mut self, groups: Vec<(Uid, Uid)>) {
        groups.into_iter().for_each(|(joint, group)| self.set_group(joint, Some(group)));
    }

    fn set_group(&mut self, joint: Uid, group: Option<Uid>) {
        let done = self.rig.apply(&RigEdit::SetGroup(joint, group));
        debug_assert!(done.is_ok(), "a group of the rig was refused: {done:?}");
    }
}

/// Joints of a rig that have the label or uid by which each of some joints names its parent.
fn bearers(rig: &Rig, hung: &[HungJoint]) -> BTreeMap<String, Vec<Uid>> {
    let mut found: BTreeMap<String, Vec<Uid>> = hung.iter().map(|hung| (hung.parent.clone(), Vec::new())).collect();
    for joint in rig.walk() {
        if let Some(bearers) = joint.data.label.as_deref().and_then(|label| found.get_mut(label)) {
            bearers.push(joint.data.uid);
        }
    }
    for (name, bearers) in &mut found {
        if let Some(uid) = name.parse::<Uid>().ok().filter(|uid| rig.joint(*uid).is_some()) {
            *bearers = vec![uid];
        }
    }
    found
}

fn labels(rig: &Rig) -> impl Iterator<Item = &str> {
    rig.walk().filter_map(|joint| joint.data.label.as_deref())
}

/// Places of the parents of joints in the text that declares them, by joint.
fn places_of_parents(source: &str) -> HashMap<Uid, usize> {
    let mut places = HashMap::new();
    let Some(declared) = Declarations::find(source) else { return places };
    for joint in &declared.joints {
        if let Some(parent) = declared.tree.field(joint.node, "parent") {
            places.entry(joint.uid).or_insert(parent.start);
        }
    }
    places
}
