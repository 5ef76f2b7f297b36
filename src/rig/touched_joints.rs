//! Log of the joints and local groups that the last edits touched: what follows a document looks at these alone.

use std::{
    collections::{BTreeSet, VecDeque},
    fmt,
};

use crate::rig::{Revision, Rig, RigEdit, Uid};

/// Number of edits that the log holds.
const MOST: usize = 4096;

/// Log of a rig. It follows from its edits and is no content: any two compare as equal, and a clone is empty.
#[derive(Default)]
pub(super) struct TouchedJoints(VecDeque<LoggedEdit>);

/// An edit of anything but motion.
struct LoggedEdit {
    before: Revision,
    after: Revision,
    touched: EditReach,
}

/// Joints or groups that an edit reaches.
#[derive(Clone, Copy)]
enum EditReach {
    /// None; the edits of a batch are logged one by one.
    Nothing,
    /// One joint, which it adds, removes, moves to another parent or changes.
    Joint(Uid),
    /// One local group, which it adds, removes or changes. Joints are in it, or not, by edits of their own.
    Group(Uid),
    /// More than can be told.
    Any,
}

impl EditReach {
    fn by(edit: &RigEdit) -> Self {
        use RigEdit::{
            AddJoint, AddLocalGroup, AddTag, Batch, RemoveJoint, RemoveLocalGroup, RemoveTag, SetFace, SetGroup,
            SetKind, SetLabel, SetLocalGroup, SetLocked, SetMirror, SetParent, SetRest, SetTag,
        };
        match edit {
            Batch(_) => Self::Nothing,
            AddJoint { joint, .. } => Self::Joint(joint.uid),
            SetParent { joint, .. } | AddTag { joint, .. } | RemoveTag(joint, _) | SetTag(joint, _) => {
                Self::Joint(*joint)
            }
            RemoveJoint(joint) | SetRest(joint, _) | SetLabel(joint, _) | SetGroup(joint, _) => Self::Joint(*joint),
            SetMirror(joint, _) | SetLocked(joint, _) | SetKind(joint, _) | SetFace(joint, _) => Self::Joint(*joint),
            AddLocalGroup(group, _) | SetLocalGroup(group) => Self::Group(group.uid),
            RemoveLocalGroup(group) => Self::Group(*group),
            _ => Self::Any,
        }
    }
}

impl Clone for TouchedJoints {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl PartialEq for TouchedJoints {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl fmt::Debug for TouchedJoints {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("TouchedJoints")
    }
}

impl Rig {
    /// Makes a revision for an edit that is about to be tried, and logs the edit. One that is refused touches nothing, which
    /// does no harm.
    pub(super) fn begin_edit(&mut self, edit: &RigEdit) {
        let before = std::mem::take(&mut self.revision);
        let log = &mut self.touched.0;
        if log.len() >= MOST {
            log.pop_front();
        }
        log.push_back(LoggedEdit { before, after: self.revision.clone(), touched: EditReach::by(edit) });
    }

    /// Joints that edits of anything but motion have touched since a revision: added, removed, moved to another parent, or
    /// changed, with their tags. Joints may be listed that are as they were, and that are gone.
    ///
    /// `None` where more than single joints may have changed, or where the revision is too long ago, or another rig's.
    pub fn touched_since(&self, revision: &Revision) -> Option<BTreeSet<Uid>> {
        self.reached_since(revision, |reach| match reach {
            EditReach::Joint(joint) => Some(joint),
            _ => None,
        })
    }

    /// Local groups that edits have added, removed or changed since a revision, as [`touched_since`](Self::touched_since) tells
    /// joints. The order of the others stays.
    pub fn touched_groups_since(&self, revision: &Revision) -> Option<BTreeSet<Uid>> {
        self.reached_since(revision, |reach| match reach {
            EditReach::Group(group) => Some(group),
            _ => None,
        })
    }

    fn reached_since(&self, revision: &Revision, reached: fn(EditReach) -> Option<Uid>) -> Option<BTreeSet<Uid>> {
        let mut touched = BTreeSet::new();
        let mut at = self.revision();
        let mut log = self.touched.0.iter().rev();
        while !at.is_same(revision) {
            // Not all revisions are made by edits.
            let logged = log.next().filter(|logged| logged.after.is_same(at))?;
            if matches!(logged.touched, EditReach::Any) {
                return None;
            }
            touched.extend(reached(logged.touched));
            at = &logged.before;
        }
        Some(touched)
    }
}
