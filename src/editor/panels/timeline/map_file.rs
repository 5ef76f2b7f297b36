//! Map files for motion that waits: pairs of names from a file take the place of what was guessed, and the map is saved as such
//! a file, for other files of the same skeleton and for the command.

use std::path::Path;

use bevy::prelude::*;

use super::import::{ClipImport, MapDraft};
use crate::{
    editor::{
        counts::counted,
        files::{
            ask_path,
            dialog::{Dialog, Purpose, Question},
        },
        notice::Notice,
    },
    files::{FileKind, LoadError, RealDisk, load_joint_map, save_atomic},
    rig::{
        Rig, Uid,
        animation::joint_map::{FoundBy, JointMap, JointMapError, write_joint_map},
    },
};

/// Kinds of files that have maps of joints.
pub(in crate::editor) const MAP_FILES: &[FileKind] = &[FileKind::Gestures];

/// Reason why a map is not taken.
#[derive(Debug, thiserror::Error)]
enum MapFileError {
    /// The file cannot be read.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// The map has joints that are not there, or none.
    #[error(transparent)]
    Map(#[from] JointMapError),
}

/// Joint of the rig for each of so many joints of a motion.
pub(super) fn targets_of(map: &JointMap, rig: &Rig, count: usize) -> Vec<Option<Uid>> {
    let joints: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
    let mut targets = vec![None; count];
    for (from, to) in map.joint_pairs() {
        if let Some(target) = targets.get_mut(from) {
            *target = joints.get(to).copied();
        }
    }
    targets
}

/// Asks for a map file.
pub(super) fn ask(world: &mut World) {
    if let Some(mut dialog) = world.get_resource_mut::<Dialog>() {
        dialog.ask(Question::JointMap);
    }
}

/// Takes the map of a file for the motion that waits: its pairs win over what names and shape say.
pub(super) fn load(world: &mut World, path: &Path) {
    let Some(draft) = world.resource::<ClipImport>().draft().cloned() else { return };
    let Some(rig) = world.get::<Rig>(draft.rig) else { return };
    let name = file_name(path);
    match mapped(&draft, rig, path) {
        Ok(targets) => {
            if let Some(known) = &mut world.resource_mut::<ClipImport>().draft {
                (known.targets, known.found_by) = (targets, Some(FoundBy::Map));
            }
            world.write_message(Notice::done(format!("Took the map of joints from {name}")));
        }
        Err(error) => {
            world.write_message(Notice::error(format!("Could not take the map of joints from {name}: {error}")));
        }
    }
}

/// Asks for a path to which the map of the motion that waits is saved.
pub(super) fn ask_save(world: &mut World) {
    let is_waiting = world.resource::<ClipImport>().draft().is_some();
    if is_waiting && world.contains_resource::<Dialog>() {
        ask_path(world, Purpose::JointMap, None);
    }
}

/// Writes the map of the motion that waits to a file, and tells of it.
pub(super) fn save(world: &mut World, path: &Path) {
    let Some(draft) = world.resource::<ClipImport>().draft() else { return };
    let Some(rig) = world.get::<Rig>(draft.rig) else { return };
    let (name, pairs) = (file_name(path), draft.pairs(rig));
    let differing = draft.differing(rig, &pairs);
    let notice = match save_atomic(&RealDisk, path, write_joint_map(&pairs).as_bytes()) {
        Ok(()) if differing > 0 => Notice::warning(format!(
            "Saved the map of joints to {name}; what {} moves is otherwise once it is read: names are missing, or say more",
            counted(differing, "joint", "joints")
        )),
        Ok(()) => Notice::done(format!("Saved the map of joints to {name}")),
        Err(error) => Notice::error(format!("Could not save the map of joints to {name}: {error}")),
    };
    world.write_message(notice);
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn mapped(draft: &MapDraft, rig: &Rig, path: &Path) -> Result<Vec<Option<Uid>>, MapFileError> {
    let pairs = load_joint_map(&RealDisk, path)?;
    let Some(motion) = draft.motions.first() else { return Ok(draft.targets.clone()) };
    Ok(targets_of(&JointMap::new(motion, rig, &pairs)?, rig, draft.targets.len()))
}
