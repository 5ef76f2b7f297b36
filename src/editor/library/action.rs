//! Actions of the library, as menus and the palette name them, and the reasons why they can do nothing at present.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    ChosenTemplate, ListTemplates, PartRefusal, TemplateDraft, TemplateLibrary, part_refusal,
    work::{LibraryAct, LibraryRequest, body},
};
use crate::{
    editor::{
        ActiveRig,
        actions::{Action, ActionRequest},
        dock::ShowPanel,
        follow::OfferAnswer,
        notice::Notice,
    },
    instance::{RigSource, UpdateOffer},
    plugins::{
        commands::Processor,
        document::Selection,
        stage::{RigStage, StageRequest},
    },
    rig::{Rig, Uid, update::Take},
};

/// An action of the library.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum LibraryAction {
    /// Shows the Loader panel.
    Loader,
    /// Lists the templates again.
    List,
    /// Brings the rig to the stage in which its joints alone are there.
    LoadSkeleton,
    /// Brings the rig to the stage in which its joints are edited.
    EditSkeleton,
    /// Brings the rig to the stage in which all commands are in effect.
    BuildRig,
    /// Brings the rig to the stage in which nothing is there.
    DeleteRig,
    /// Puts the chosen template in place of the rig.
    Load,
    /// Puts the chosen template in place of the rig, and into the mesh.
    Fit,
    /// Adds the joints of the chosen template below the active joint.
    Merge,
    /// Puts the tags of the chosen template onto the selected joints.
    Inject,
    /// Puts the chosen part onto the selected joints.
    Part,
    /// Shows the form in which the rig is written as a template, or some of its joints as a part.
    Save,
    /// Shows the Updater panel.
    Updater,
    /// Takes the changed file over; in conflicts the values of the rig stay.
    TakeMine,
    /// Takes the changed file over; in conflicts the values of the file are taken.
    TakeTheirs,
    /// Leaves the rig as it is until the file changes again.
    Leave,
    /// Takes over whatever is saved to the file, or asks again.
    Live,
}

impl LibraryAction {
    /// All actions.
    pub const ALL: [Self; 17] = [
        Self::Loader,
        Self::List,
        Self::LoadSkeleton,
        Self::EditSkeleton,
        Self::BuildRig,
        Self::DeleteRig,
        Self::Load,
        Self::Fit,
        Self::Merge,
        Self::Inject,
        Self::Part,
        Self::Save,
        Self::Updater,
        Self::TakeMine,
        Self::TakeTheirs,
        Self::Leave,
        Self::Live,
    ];

    /// Description in a few words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Loader => "Loader: templates, stages and features",
            Self::List => "List the templates again",
            Self::LoadSkeleton => "Load skeleton",
            Self::EditSkeleton => "Edit skeleton",
            Self::BuildRig => "Build rig, and follow edits",
            Self::DeleteRig => "Delete rig",
            Self::Load => "Load the chosen template",
            Self::Fit => "Fit the chosen template onto the mesh",
            Self::Merge => "Merge the chosen template below the active joint",
            Self::Inject => "Inject the chosen template's tags onto the selected joints",
            Self::Part => "Add the chosen part onto the selected joints",
            Self::Save => "Save as template, or extract joints",
            Self::Updater => "Updater: changes of the template's file",
            Self::TakeMine => "Take the update over, mine stay",
            Self::TakeTheirs => "Take the update over, theirs",
            Self::Leave => "Leave the update",
            Self::Live => "Live updates",
        }
    }

    /// Stage that the action brings the rig to.
    pub fn stage(self) -> Option<RigStage> {
        match self {
            Self::LoadSkeleton => Some(RigStage::Skeleton),
            Self::EditSkeleton => Some(RigStage::Edit),
            Self::BuildRig => Some(RigStage::Built),
            Self::DeleteRig => Some(RigStage::Deleted),
            _ => None,
        }
    }

    /// True for actions that need no rig.
    pub fn is_of_window(self) -> bool {
        matches!(self, Self::Loader | Self::List | Self::Updater)
    }
}

/// The reason why an action can do nothing at present, in a few words; `None` if it can.
pub fn obstacle(world: &World, action: LibraryAction) -> Option<&'static str> {
    if action.is_of_window() {
        return None;
    }
    let Some(entity) = world.get_resource::<ActiveRig>().map(|active| active.0) else { return Some("no rig is open") };
    let rig = world.get::<Rig>(entity)?;
    let is_empty = rig.is_empty();
    let stage = world.get::<RigStage>(entity).copied();
    let selection: &[Uid] = world.get::<Selection>(entity).map_or(&[], |selection| &selection.0);
    let is_selected = selection.iter().any(|node| rig.joint(*node).is_some());
    let chosen = world.get_resource::<ChosenTemplate>().and_then(|chosen| chosen.0.as_ref());
    if let Some(own) = action.stage().filter(|own| own.is_kept(stage, world.get::<Processor>(entity))) {
        return Some(match own {
            RigStage::Skeleton => "the skeleton is loaded",
            RigStage::Edit => "the skeleton is being edited",
            RigStage::Built => "the rig is built",
            RigStage::Deleted => "the rig is deleted",
        });
    }
    match action {
        LibraryAction::Loader | LibraryAction::List | LibraryAction::Updater => None,
        LibraryAction::LoadSkeleton | LibraryAction::EditSkeleton | LibraryAction::BuildRig => {
            (is_empty && stage != Some(RigStage::Deleted)).then_some("there are no joints")
        }
        LibraryAction::DeleteRig => is_empty.then_some("there are no joints"),
        LibraryAction::Save => is_empty.then_some("there are no joints"),
        LibraryAction::TakeMine | LibraryAction::TakeTheirs | LibraryAction::Leave => {
            world.get::<UpdateOffer>(entity).is_none().then_some("the file has no changes")
        }
        LibraryAction::Live => world.get::<RigSource>(entity).is_none().then_some("the rig follows no template"),
        _ if chosen.is_none() => Some("no template is chosen in the Loader"),
        _ if stage == Some(RigStage::Deleted) => Some("the rig is deleted: choose another stage first"),
        LibraryAction::Fit => body(world, entity).is_none().then_some("no mesh is open"),
        LibraryAction::Inject | LibraryAction::Part if !is_selected => Some("no joint is selected"),
        LibraryAction::Part => {
            let listing = world.get_resource::<TemplateLibrary>().map(TemplateLibrary::listing);
            let is_part = chosen.and_then(|place| listing?.find(place)).is_some_and(|listed| listed.is_part());
            if !is_part {
                return Some("the chosen template is no part");
            }
            chosen.and_then(|place| part_refusal(world, place)).map(|refusal| refusal.short())
        }
        LibraryAction::Load | LibraryAction::Merge | LibraryAction::Inject => None,
    }
}

/// Carries out actions of the library.
pub(super) fn carry_out(mut actions: MessageReader<ActionRequest>, mut commands: Commands) {
    for ActionRequest(action) in actions.read() {
        if let Action::Library(action) = *action {
            commands.queue(move |world: &mut World| act(world, action));
        }
    }
}

fn act(world: &mut World, action: LibraryAction) {
    if let Some(reason) = obstacle(world, action) {
        let place = world.get_resource::<ChosenTemplate>().and_then(|chosen| chosen.0.as_ref());
        let refusal = place.and_then(|place| part_refusal(world, place));
        let refusal = refusal.filter(|refusal| refusal.short() == reason);
        let told = refusal.as_ref().map_or(reason, PartRefusal::words);
        let text = format!("{}: {told}.", action.name());
        world.write_message(Notice::warning(text));
        return;
    }
    match action {
        LibraryAction::Loader => show(world, "Loader"),
        LibraryAction::Updater => show(world, "Updater"),
        LibraryAction::List => {
            world.write_message(ListTemplates);
        }
        LibraryAction::Save => {
            world.resource_mut::<TemplateDraft>().is_open = true;
            show(world, "Loader");
        }
        LibraryAction::TakeMine => answer(world, OfferAnswer::Take(Take::Mine)),
        LibraryAction::TakeTheirs => answer(world, OfferAnswer::Take(Take::Theirs)),
        LibraryAction::Leave => answer(world, OfferAnswer::Leave),
        LibraryAction::Live => {
            let source = world.get_resource::<ActiveRig>().and_then(|active| world.get::<RigSource>(active.0));
            let is_live = source.is_some_and(|source| source.is_live);
            answer(world, OfferAnswer::Live(!is_live));
        }
        _ => on_rig(world, action),
    }
}

fn show(world: &mut World, panel: &'static str) {
    world.write_message(ShowPanel(panel));
}

fn answer(world: &mut World, answer: OfferAnswer) {
    world.write_message(answer);
}

fn on_rig(world: &mut World, action: LibraryAction) {
    let Some(rig) = world.get_resource::<ActiveRig>().map(|active| active.0) else { return };
    if let Some(stage) = action.stage() {
        world.write_message(StageRequest { rig, stage });
        return;
    }
    let Some(place) = world.resource::<ChosenTemplate>().0.clone() else { return };
    let joints: Vec<Uid> = world.get::<Selection>(rig).map(|selection| selection.0.clone()).unwrap_or_default();
    let act = match action {
        LibraryAction::Fit => LibraryAct::Fit { keep: true },
        LibraryAction::Merge => LibraryAct::Merge { parent: joints.last().copied() },
        LibraryAction::Inject => LibraryAct::Inject { joints },
        LibraryAction::Part => LibraryAct::Part { joints, options: Vec::new() },
        _ => LibraryAct::Load { keep: true },
    };
    world.write_message(LibraryRequest { place, act });
}
