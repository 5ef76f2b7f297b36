//! Drafts: runs of edits that are kept or undone as a whole.

use bevy::math::{Affine3, Mat3, Vec3};

use super::{MirrorPlane, clips::carried_key, frame::Frame};
use crate::rig::{EditError, PoseOffset, Rig, RigEdit, Uid, UidSource, animation::Key};

/// A rig under change: edits are applied at once and recorded with their inverses.
pub struct Draft<'a> {
    rig: &'a mut Rig,
    uids: &'a mut UidSource,
    symmetry: Option<MirrorPlane>,
    /// False for a draft that is never taken back.
    is_recorded: bool,
    done: Vec<RigEdit>,
    inverses: Vec<RigEdit>,
    selected: Option<Vec<Uid>>,
    notes: Vec<String>,
}

/// Result of an operation.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Outcome {
    /// The edits, in the order they were applied.
    pub edits: Vec<RigEdit>,
    /// Inverses of the edits, in the order in which undo applies them.
    pub inverses: Vec<RigEdit>,
    /// The joints to select afterwards; `None` keeps the selection.
    pub selected: Option<Vec<Uid>>,
    /// Sentences for people: tags without a place, references to nothing.
    pub notes: Vec<String>,
}

impl<'a> Draft<'a> {
    /// Begins a draft on a rig; uids of added objects come from `uids`.
    pub fn new(rig: &'a mut Rig, uids: &'a mut UidSource, symmetry: Option<MirrorPlane>) -> Self {
        Self {
            rig,
            uids,
            symmetry,
            is_recorded: true,
            done: Vec::new(),
            inverses: Vec::new(),
            selected: None,
            notes: Vec::new(),
        }
    }

    /// A draft without a record of its edits, which take more memory than what they add. It cannot be taken back.
    #[cfg(feature = "cli")]
    pub(super) fn without_record(rig: &'a mut Rig, uids: &'a mut UidSource) -> Self {
        Self { is_recorded: false, ..Self::new(rig, uids, None) }
    }

    /// The rig in its current state.
    pub fn rig(&self) -> &Rig {
        self.rig
    }

    /// The plane of live mirroring.
    pub fn symmetry(&self) -> Option<MirrorPlane> {
        self.symmetry
    }

    /// A uid that is free in the rig.
    pub fn next_uid(&mut self) -> Uid {
        loop {
            let uid = self.uids.next_uid();
            if !self.rig.is_taken(uid) {
                return uid;
            }
        }
    }

    /// Applies one edit.
    pub fn apply(&mut self, edit: RigEdit) -> Result<(), EditError> {
        let inverse = self.rig.apply(&edit)?;
        if self.is_recorded {
            self.done.push(edit);
            self.inverses.push(inverse);
        }
        Ok(())
    }

    /// Sets the joints to select afterwards.
    pub fn select(&mut self, joints: Vec<Uid>) {
        self.selected = Some(joints);
    }

    /// Adds a note for people about the result.
    pub fn note(&mut self, note: String) {
        self.notes.push(note);
    }

    /// The joint on the other side, if live mirroring is on and there is one.
    pub fn partner(&self, joint: Uid) -> Option<Uid> {
        self.symmetry?;
        let partner = self.rig.joint(joint)?.data.mirror?;
        self.rig.joint(partner).map(|_| partner)
    }

    /// Joints and, if live mirroring is on, their partners; each once, in order. Unknown joints stay in the list, so
    /// that editing them is refused.
    pub fn with_partners(&self, joints: &[Uid]) -> Vec<Uid> {
        let mut list = Vec::with_capacity(joints.len() * 2);
        let mut seen = std::collections::HashSet::new();
        for &joint in joints {
            if seen.insert(joint) {
                list.push(joint);
            }
        }
        for &joint in joints {
            if let Some(partner) = self.partner(joint).filter(|partner| seen.insert(*partner)) {
                list.push(partner);
            }
        }
        list
    }

    /// Sets the transform of a joint in the rig's space; joints below keep their own rest transforms.
    pub fn set_global(&mut self, joint: Uid, global: &Affine3) -> Result<(), EditError> {
        let parent = self.rig.joint(joint).ok_or(EditError::NoJoint(joint))?.parent;
        let rest = self.rig.local_rest(parent, global);
        self.apply(RigEdit::SetRest(joint, rest))
    }

    /// Runs `change` on a joint and restores the transforms of its children. Poses and clips keep turning and moving the joint
    /// along the same axes of the rig, whatever its own axes are now.
    pub fn keeping_children(
        &mut self,
        joint: Uid,
        change: impl FnOnce(&mut Self) -> Result<(), EditError>,
    ) -> Result<(), EditError> {
        let children: Vec<(Uid, Affine3)> =
            self.rig.children(Some(joint)).iter().map(|child| (*child, self.rig.rest_global(*child))).collect();
        let before = Frame::of(self.rig, joint);
        change(self)?;
        children.iter().try_for_each(|(child, global)| self.set_global(*child, global))?;
        let now = Frame::of(self.rig, joint);
        if before.is_like(&now) { Ok(()) } else { self.carry_poses(joint, &before, &now) }
    }

    fn carry_poses(&mut self, joint: Uid, before: &Frame, now: &Frame) -> Result<(), EditError> {
        let carried = |offset: &PoseOffset| before.carried(offset, now, Mat3::IDENTITY);
        if let Some(offset) = self.rig.offset(joint).map(carried) {
            self.apply(RigEdit::SetOffset(joint, Some(offset)))?;
        }
        let stored = self.rig.stored_poses().iter().filter(|pose| pose.offsets.contains_key(&joint));
        for mut pose in stored.cloned().collect::<Vec<_>>() {
            pose.offsets.entry(joint).and_modify(|offset| *offset = carried(offset));
            self.apply(RigEdit::SetStoredPose(Box::new(pose)))?;
        }
        let mut edits = Vec::new();
        for clip in self.rig.clips() {
            for layer in &clip.layers {
                for (target, track) in layer.tracks.iter().filter(|(target, _)| target.node == joint) {
                    let carried = |key: &Key| carried_key(key, &target.property, (before, now), Mat3::IDENTITY);
                    let inserted: Vec<Key> = track.keys.iter().map(carried).collect();
                    if inserted == track.keys {
                        continue;
                    }
                    edits.push(RigEdit::SetKeys {
                        clip: clip.uid,
                        layer: layer.uid,
                        target: target.clone(),
                        removed: track.keys.iter().map(|key| key.time).collect(),
                        inserted,
                    });
                }
            }
        }
        edits.into_iter().try_for_each(|edit| self.apply(edit))
    }

    /// Position of a joint, or an error.
    pub fn position(&self, joint: Uid) -> Result<Vec3, EditError> {
        self.rig.joint(joint).ok_or(EditError::NoJoint(joint))?;
        Ok(self.rig.position(joint))
    }

    /// Ends the draft and keeps its changes.
    pub fn finish(mut self) -> Outcome {
        self.inverses.reverse();
        Outcome { edits: self.done, inverses: self.inverses, selected: self.selected, notes: self.notes }
    }

    /// Ends the draft and undoes its changes.
    pub fn take_back(self) {
        for inverse in self.inverses.iter().rev() {
            let undone = self.rig.apply(inverse);
            debug_assert!(undone.is_ok(), "an inverse was refused: {undone:?}");
        }
    }
}
