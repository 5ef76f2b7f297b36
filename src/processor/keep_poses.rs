//! Poses of a document that mean the same after an update of it.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use super::{Builder, Modules, keep_moved_nodes::carry_pose};
use crate::{
    rig::{AttributeValues, BuiltRig, EditError, MovedNodes, MovedTags, PoseOffset, Rig, RigEdit, StoredPose, Uid},
    solve::{
        keep_pose::{Deviation, PoseKeeper},
        program::{CompileOptions, RigProgram},
    },
};

/// Joint that a pose could not hold in its place through an update.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct PoseNote {
    /// Name of the stored pose; `None` for the current pose.
    pub pose: Option<String>,
    /// The joint, and by how much it is off.
    #[serde(flatten)]
    pub deviation: Deviation,
}

impl std::fmt::Display for PoseNote {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Deviation { joint, label, distance, angle } = &self.deviation;
        let joint = label.as_deref().map_or_else(|| joint.to_string(), str::to_owned);
        match &self.pose {
            Some(pose) => write!(f, "pose \"{pose}\": ")?,
            None => write!(f, "the current pose: ")?,
        }
        write!(f, "{joint} stands {distance:.4} units and {angle:.2}° from where it stood")
    }
}

/// Re-expresses the current pose and the stored poses of `after`, as far as they are those of `before`, so that the joints
/// stand as they did: see [`PoseKeeper`]. Returns what could not be held. What is stored of nodes whose command moved to
/// another joint goes along, as it is.
///
/// Poses stay as they are where nothing moved what they mean, or where one of the two rigs cannot be built. Builds both rigs
/// if there are poses: some tens of milliseconds for a character.
///
/// # Errors
/// If a pose is refused, which a valid rig's is not.
pub fn keep_poses(before: &Rig, after: &mut Rig, modules: &Arc<Modules>) -> Result<Vec<PoseNote>, EditError> {
    // What the update itself changed in a pose is wanted; offsets of joints that are gone are gone.
    let is_kept = |pose: &&StoredPose| {
        before
            .stored_pose(pose.uid)
            .is_some_and(|was| is_part(&pose.offsets, &was.offsets) && was.values == pose.values)
    };
    let stored: Vec<StoredPose> = after.stored_poses().iter().filter(is_kept).cloned().collect();
    let is_posed = !after.pose().is_empty() && is_part(after.pose(), before.pose());
    if stored.is_empty() && !is_posed && MovedTags::between(before, after).is_empty() {
        return Ok(Vec::new());
    }
    let (Some((was_built, from)), Some((built, to))) = (built_program(before, modules), built_program(after, modules))
    else {
        return Ok(Vec::new());
    };
    let moved = MovedNodes::between((before, &was_built), (&*after, &built));
    let keeper = PoseKeeper::between(&from, &to);
    let mut notes = Vec::new();
    let mut note = |pose: Option<&str>, deviations: Vec<Deviation>| {
        let named = |deviation| PoseNote { pose: pose.map(str::to_owned), deviation };
        notes.extend(deviations.into_iter().map(named));
    };
    let kept_of = |was: &Offsets, now: &Offsets, values: &AttributeValues| {
        let [was, carried] = moved.split_offsets(was);
        let mut kept = keeper.keep(&was, &moved.split_values(values)[0]);
        kept.offsets.retain(|node, _| now.contains_key(node) || to.node(*node).is_some());
        kept.offsets.extend(carried);
        kept
    };
    if is_posed {
        let kept = kept_of(before.pose(), after.pose(), after.attribute_values());
        let nodes: BTreeSet<Uid> = after.pose().keys().chain(kept.offsets.keys()).copied().collect();
        for node in nodes {
            let offset = kept.offsets.get(&node).copied();
            if after.offset(node).copied() != offset {
                after.apply(&RigEdit::SetOffset(node, offset))?;
            }
        }
        note(None, kept.deviations);
    }
    carry_pose(after, &moved)?;
    for mut pose in stored {
        let Some(was) = before.stored_pose(pose.uid) else { continue };
        let kept = kept_of(&was.offsets, &pose.offsets, &pose.values);
        note(Some(&pose.name), kept.deviations);
        let [mut values, carried] = moved.split_values(&pose.values);
        values.extend(carried);
        if kept.offsets != pose.offsets || values != pose.values {
            (pose.offsets, pose.values) = (kept.offsets, values);
            after.apply(&RigEdit::SetStoredPose(Box::new(pose)))?;
        }
    }
    Ok(notes)
}

type Offsets = BTreeMap<Uid, PoseOffset>;

/// True if all of a pose is in another one.
fn is_part(pose: &Offsets, of: &Offsets) -> bool {
    pose.iter().all(|(node, offset)| of.get(node) == Some(offset))
}

/// A rig as its commands build it, and the program with all of its nodes.
pub(super) fn built_program(rig: &Rig, modules: &Arc<Modules>) -> Option<(BuiltRig, Arc<RigProgram>)> {
    let built = Builder::build(rig, modules).ok()?;
    let program = RigProgram::compile(&built, &CompileOptions::default()).ok()?;
    Some((built, Arc::new(program)))
}
