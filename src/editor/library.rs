//! Library of templates in the window: what the folders of the site, the document's own folder and Rigsmith itself have, and
//! what is done with it on the open rig.
//!
//! Folders are listed and headers read in the background, when the list is first looked at, when it is asked for and when
//! something has been saved; files that have not changed are not read again. Every request becomes one step of the history.

mod action;
mod drop_target;
mod follow;
mod joints;
mod listing;
mod part_check;
mod pictures;
mod preview;
mod save;
mod sides;
mod work;

use bevy::prelude::*;

pub use self::{
    action::{LibraryAction, obstacle},
    listing::{LibraryFolder, LibraryFolders, LibraryListing, ListTemplates, TemplateLibrary},
    part_check::ReadPart,
    pictures::{LibraryPictures, PictureRequest, TemplatePicture},
    save::{SaveTemplate, TemplateContent, TemplateDraft, TemplateSave},
    sides::PartSides,
    work::{LOAD, LibraryAct, LibraryJobs, LibraryRequest},
};
pub(in crate::editor) use self::{
    drop_target::{attach, dropping, goes_onto_both},
    part_check::{PartRefusal, is_part_known, part_refusal},
    save::{HEADER, header_step},
    sides::{partner, partners},
};
use super::{
    actions::ActionRequest,
    dock::ShowPanel,
    files::{DocumentLanded, ExportRequest, SaveJob, attend},
    follow::OfferAnswer,
    notice::Notice,
    panel::PanelApp,
};
use crate::{
    files::TemplatePlace,
    plugins::{
        RigSystems,
        document::{EditRefusal, EditReport, EditRequest},
        fit::{FitAnswer, FitRequest},
        stage::StageRequest,
    },
};

/// Plugin of the library.
pub struct LibraryPlugin;

impl Plugin for LibraryPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<TemplateLibrary>()
            .init_resource::<LibraryFolders>()
            .init_resource::<LibraryPictures>()
            .init_resource::<LibraryJobs>()
            .init_resource::<ChosenTemplate>()
            .init_resource::<TemplateDraft>()
            .init_resource::<PartSides>()
            .init_resource::<part_check::ReadParts>()
            .init_resource::<follow::LoadSteps>()
            .init_resource::<TemplateSave>()
            .init_resource::<SaveJob>()
            .add_message::<ListTemplates>()
            .add_message::<PictureRequest>()
            .add_message::<ReadPart>()
            .add_message::<LibraryRequest>()
            .add_message::<SaveTemplate>()
            .add_message::<ActionRequest>()
            .add_message::<DocumentLanded>()
            .add_message::<EditRequest>()
            .add_message::<EditReport>()
            .add_message::<EditRefusal>()
            .add_message::<ExportRequest>()
            .add_message::<FitAnswer>()
            .add_message::<FitRequest>()
            .add_message::<Notice>()
            .add_message::<OfferAnswer>()
            .add_message::<ShowPanel>()
            .add_message::<StageRequest>()
            .add_message::<bevy::window::RequestRedraw>()
            .add_painter(drop_target::DropTarget)
            .add_systems(
                Update,
                (
                    (action::carry_out, work::start, work::land, listing::list, part_check::read_parts, pictures::draw)
                        .chain()
                        .after(attend)
                        .before(RigSystems::Script),
                    // What was typed before a click on Save is in the rig, and the picture's name is before it is taken back.
                    (save::go_on, save::start).chain().after(RigSystems::Edits).before(RigSystems::Build),
                    follow::follow_loads.after(RigSystems::Edits).before(RigSystems::Build),
                    follow::watch_fits.after(RigSystems::Bind),
                ),
            );
    }
}

/// Template that was chosen in the list.
#[derive(Resource, Debug, Clone, PartialEq, Eq, Default)]
pub struct ChosenTemplate(pub Option<TemplatePlace>);

/// Module that is dragged from the library of the Tags panel onto a joint or a wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DraggedModule(pub &'static str);

/// Template that is dragged from the list onto a joint.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DraggedTemplate {
    /// Place of the template.
    pub place: TemplatePlace,
    /// Name for people.
    pub name: String,
}
