//! Parts that are read ahead, so that menus and cards tell where one would be refused before it is asked for.
//!
//! A part is put onto a copy of the rig. That is done where a menu asks for it, and again only after a change of the rig's
//! joints and tags, of the template that it follows, of the selection, or of the sides. A preview changes nothing of that.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
};

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
    window::RequestRedraw,
};

use super::{
    ChosenTemplate, LibraryFolders, PartSides, TemplateLibrary,
    joints::{AdditionError, added},
    work::Snapshot,
};
use crate::{
    editor::ActiveRig,
    files::{RealDisk, TemplatePlace, read_listed},
    instance::RigSource,
    plugins::{document::Selection, history::RigHistory},
    rig::{Revision, Rig, Uid, UidSource, operations::Operation, part::Part, step::Step},
};

/// Request to read a part, so that a menu can tell where it would be refused. The chosen template is read without one.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub struct ReadPart(pub TemplatePlace);

/// Reason why a part would be refused.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::editor) enum PartRefusal {
    /// The joints have such a part; in a sentence.
    Occupied(String),
    /// The part does not fit the joints; in a sentence.
    Misfit(String),
}

impl PartRefusal {
    /// The reason in a few words.
    pub fn short(&self) -> &'static str {
        match self {
            Self::Occupied(_) => "the selected joints have such a part already",
            Self::Misfit(_) => "the part does not fit the selected joints",
        }
    }

    /// The reason as it is told when the part is refused.
    pub fn words(&self) -> &str {
        match self {
            Self::Occupied(words) | Self::Misfit(words) => words,
        }
    }
}

/// Parts that were read since the templates were listed last, and what was found out about them.
#[derive(Resource, Default)]
pub(super) struct ReadParts {
    /// Number of the listing.
    listing: u64,
    parts: BTreeMap<TemplatePlace, PartState>,
    verdicts: Mutex<BTreeMap<TemplatePlace, Verdict>>,
}

enum PartState {
    Reading(Task<Option<Part>>),
    /// The part, if it could be read.
    Read(Option<Arc<Part>>),
}

/// Refusal of a part, if any, with everything that it follows from.
struct Verdict {
    rig: Entity,
    revision: Revision,
    /// Version of the template that the rig follows, whose part instances it has.
    base: Option<Arc<Rig>>,
    joints: Vec<Uid>,
    are_both: bool,
    /// The last step, whose joints are a stroke.
    last: Option<Arc<Step>>,
    refusal: Option<PartRefusal>,
}

/// Reads the chosen part, and those that are asked for, in the background.
pub(super) fn read_parts(
    mut requests: MessageReader<ReadPart>,
    chosen: Res<ChosenTemplate>,
    library: Res<TemplateLibrary>,
    folders: Res<LibraryFolders>,
    mut parts: ResMut<ReadParts>,
    mut commands: Commands,
) {
    let parts = parts.bypass_change_detection();
    let listing = library.listing();
    if parts.listing != listing.number {
        *parts = ReadParts { listing: listing.number, ..ReadParts::default() };
    }
    let wanted: Vec<TemplatePlace> =
        chosen.0.iter().cloned().chain(requests.read().map(|request| request.0.clone())).collect();
    for place in wanted {
        if parts.parts.contains_key(&place) || listing.find(&place).is_none_or(|listed| !listed.is_part()) {
            continue;
        }
        let (folders, of_task) = (folders.clone(), place.clone());
        let task = AsyncComputeTaskPool::get().spawn(async move {
            let site = folders.read().ok()?;
            read_listed(&RealDisk, &of_task, &site).ok().map(Part::from)
        });
        parts.parts.insert(place, PartState::Reading(task));
    }
    for state in parts.parts.values_mut() {
        let PartState::Reading(task) = state else { continue };
        let read = check_ready(task);
        commands.write_message(RequestRedraw);
        if let Some(part) = read {
            *state = PartState::Read(part.map(Arc::new));
        }
    }
}

/// True if a part was read, or is being read, since the templates were listed last.
pub(in crate::editor) fn is_part_known(world: &World, place: &TemplatePlace) -> bool {
    world.get_resource::<ReadParts>().is_some_and(|parts| parts.parts.contains_key(place))
}

/// Reason why a part would be refused on the selected joints; `None` if it would not, if there are none, and before it is read.
pub(in crate::editor) fn part_refusal(world: &World, place: &TemplatePlace) -> Option<PartRefusal> {
    let parts = world.get_resource::<ReadParts>()?;
    let PartState::Read(Some(part)) = parts.parts.get(place)? else { return None };
    let entity = world.get_resource::<ActiveRig>()?.0;
    let (rig, history) = (world.get::<Rig>(entity)?, world.get::<RigHistory>(entity)?);
    let joints = &world.get::<Selection>(entity)?.0;
    if !joints.iter().any(|joint| rig.joint(*joint).is_some()) {
        return None;
    }
    let (are_both, last) = (PartSides::are_both(world), history.last());
    let base = world.get::<RigSource>(entity).and_then(RigSource::base);
    let mut verdicts = parts.verdicts.lock().unwrap_or_else(PoisonError::into_inner);
    let is_same = |known: &&Verdict| {
        (known.rig, &known.joints, known.are_both) == (entity, joints, are_both)
            && (history.is_previewing() || known.revision.is_same(rig.revision()))
            && known.base.as_ref().map(Arc::as_ptr) == base.map(Arc::as_ptr)
            && known.last.as_ref().map(Arc::as_ptr) == last.map(Arc::as_ptr)
    };
    if let Some(known) = verdicts.get(place).filter(is_same) {
        return known.refusal.clone();
    }
    let (snapshot, uids) = (Snapshot::of(world, entity)?, world.get_resource::<UidSource>()?.clone());
    let refusal = refusal_of(snapshot, (place.stem(), Part::clone(part)), joints, uids);
    let (revision, joints, last) = (rig.revision().clone(), joints.clone(), last.cloned());
    let verdict =
        Verdict { rig: entity, revision, base: base.cloned(), joints, are_both, last, refusal: refusal.clone() };
    verdicts.insert(place.clone(), verdict);
    refusal
}

/// Puts a part onto joints of a copy of the rig, to see why it would be refused.
fn refusal_of(
    mut snapshot: Snapshot,
    part: (String, Part),
    joints: &[Uid],
    mut uids: UidSource,
) -> Option<PartRefusal> {
    let joints = (joints, snapshot.stroke.as_slice());
    let rig = (&snapshot.rig, snapshot.instances());
    let operation = match added(rig, joints, part, &[], snapshot.both, &snapshot.modules) {
        Ok(addition) => addition.operation,
        Err(AdditionError::Occupied(occupied)) => return Some(PartRefusal::Occupied(occupied.to_string())),
        Err(error) => return Some(PartRefusal::Misfit(error.to_string())),
    };
    let refused = Operation::Tags(operation).run(&mut snapshot.rig, &mut uids, None).err();
    refused.map(|error| PartRefusal::Misfit(error.to_string()))
}
