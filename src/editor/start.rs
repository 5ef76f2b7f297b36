//! Start page: recent files, bundled meshes and templates as pictures, three jobs, and a tour.
//!
//! The page stands in front of an empty document when the window opens without a file, or with one that cannot be opened. It
//! closes with Escape and when something is opened, and asks nothing.

mod bones;
mod pictures;
mod recent;
mod tour;
mod tour_card;
mod view;

use std::path::PathBuf;

use bevy::prelude::*;
use bevy_egui::egui;

pub use self::{
    bones::BonePicture,
    pictures::StartPictures,
    recent::{RecentFile, RecentFiles, RecentProblem},
    tour::{Tour, TourStep},
};
use super::{
    ActiveRig,
    actions::{Action, ActionRequest},
    dock::ShowPanel,
    files::{BODY, DocumentLanded, HEAD, OpenRequest, attend},
    keys::KeyBindings,
    mode::Mode,
    panel::PanelApp,
    recovery,
    settings::EditorSettings,
};
use crate::{files::journal::Origin, plugins::RigSystems};

/// Plugin of the start page and the tour; it opens the first document.
#[derive(Debug, Clone, Default)]
pub struct StartPlugin {
    /// The file to open first; an empty document behind the start page without one, and where it cannot be opened.
    pub file: Option<PathBuf>,
}

impl Plugin for StartPlugin {
    fn build(&self, app: &mut App) {
        let first = self.file.clone().map_or(OpenRequest::Empty, OpenRequest::File);
        let is_shown = self.file.is_none();
        app.insert_resource(StartPage { is_shown, waits: true, job: None })
            .insert_resource(FirstDocument(first))
            .init_resource::<RecentFiles>()
            .init_resource::<StartPictures>()
            .init_resource::<Tour>()
            .init_resource::<EditorSettings>()
            .init_resource::<KeyBindings>()
            .init_resource::<Mode>()
            .add_message::<ActionRequest>()
            .add_message::<OpenRequest>()
            .add_message::<DocumentLanded>()
            .add_message::<StartJob>()
            .add_message::<ShowPanel>()
            .add_message::<bevy::window::RequestRedraw>()
            .add_overlay(view::StartView::default())
            .add_painter(tour_card::TourCard)
            .add_systems(Startup, open_first.after(recovery::look))
            .add_systems(
                Update,
                (begin, toggle, land, recent::look, pictures::draw, tour::follow)
                    .chain()
                    .after(attend)
                    .before(RigSystems::Script),
            );
    }
}

/// Document to open first.
#[derive(Resource, Debug, Clone)]
struct FirstDocument(OpenRequest);

/// State of the start page.
#[derive(Resource, Debug, Clone, PartialEq, Eq, Default)]
pub struct StartPage {
    is_shown: bool,
    /// Marks that the first document is still being opened.
    waits: bool,
    /// Job whose document is being opened.
    job: Option<Job>,
}

impl StartPage {
    /// True while the page is shown.
    pub fn is_shown(&self) -> bool {
        self.is_shown
    }

    /// The page, closed.
    fn closed(&self) -> Self {
        Self { is_shown: false, ..self.clone() }
    }
}

/// Name of the page's area on the screen.
pub fn page_id() -> egui::Id {
    egui::Id::new("start page")
}

/// Request for a job of the start page.
#[derive(Message, Debug, Clone, Copy, PartialEq, Eq)]
pub struct StartJob(pub Job);

/// Job of the start page: what it opens, and the mode and panel in which it begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Job {
    /// A skeleton, weights and a pose for a body.
    Character,
    /// Controls, parts and tags on a skeleton.
    Rig,
    /// Bones, weights and expressions for a head.
    Face,
    /// The tour on the bundled body.
    Tour,
}

impl Job {
    /// The jobs beside the tour.
    pub const ALL: [Self; 3] = [Self::Character, Self::Rig, Self::Face];

    /// Name on the start page.
    pub fn title(self) -> &'static str {
        match self {
            Self::Character => "Rig a character",
            Self::Rig => "Build a rig",
            Self::Face => "Make a face",
            Self::Tour => "Take the tour",
        }
    }

    /// Description in a sentence.
    pub fn about(self) -> &'static str {
        match self {
            Self::Character => "A body without bones: fit a skeleton or draw one, skin it, pose it.",
            Self::Rig => "A skeleton with parts and tags: its controls and switches build themselves.",
            Self::Face => "A head: bones, weights and expressions are placed in it with one button.",
            Self::Tour => "Three steps on the bundled body: you do them, and the window sees when they are done.",
        }
    }

    /// Request for the document that the job opens.
    pub fn request(self) -> OpenRequest {
        match self {
            Self::Character | Self::Tour => OpenRequest::Model(BODY.to_owned()),
            Self::Rig => OpenRequest::Template(BODY.to_owned()),
            Self::Face => OpenRequest::Model(HEAD.to_owned()),
        }
    }

    /// Start of the document that the job opens.
    fn origin(self) -> Origin {
        match self.request() {
            OpenRequest::Model(name) => Origin::Bundled(name),
            OpenRequest::Template(name) => OpenRequest::origin_of_template(&name),
            OpenRequest::Bundled | OpenRequest::Empty => Origin::Empty,
            OpenRequest::File(_) | OpenRequest::Files { .. } => Origin::Empty,
        }
    }

    /// The mode in which the job begins.
    pub fn mode(self) -> Mode {
        match self {
            Self::Character => Mode::Stroke,
            Self::Rig | Self::Tour => Mode::Select,
            Self::Face => Mode::Pose,
        }
    }

    /// The panel in which the job goes on.
    pub fn panel(self) -> Option<&'static str> {
        match self {
            Self::Character | Self::Tour => None,
            Self::Rig => Some("Tags"),
            Self::Face => Some("Face"),
        }
    }
}

fn open_first(first: Res<FirstDocument>, mut requests: MessageWriter<OpenRequest>) {
    requests.write(first.0.clone());
}

/// Opens what a job needs.
fn begin(mut jobs: MessageReader<StartJob>, mut page: ResMut<StartPage>, mut requests: MessageWriter<OpenRequest>) {
    for StartJob(job) in jobs.read() {
        page.job = Some(*job);
        requests.write(job.request());
    }
}

/// Shows and hides the page.
pub(super) fn toggle(mut actions: MessageReader<ActionRequest>, mut page: ResMut<StartPage>) {
    for ActionRequest(action) in actions.read() {
        match action {
            Action::StartPage => page.is_shown = !page.is_shown,
            Action::Cancel if page.is_shown => page.is_shown = false,
            _ => {}
        }
    }
}

/// Closes the page once something is open, and goes on with the job for which it was opened. Shows it where the first file could
/// not be opened, so that an empty document stands in its place.
fn land(
    mut landed: MessageReader<DocumentLanded>,
    (active, first): (Option<Res<ActiveRig>>, Res<FirstDocument>),
    mut page: ResMut<StartPage>,
    mut mode: ResMut<Mode>,
    mut tour: ResMut<Tour>,
    mut panels: MessageWriter<ShowPanel>,
) {
    let Some(DocumentLanded { origin }) = landed.read().last() else { return };
    let is_first = std::mem::take(&mut page.waits) && *origin == Origin::Empty;
    if is_first {
        page.is_shown |= matches!(first.0, OpenRequest::File(_));
        return;
    }
    page.is_shown = false;
    // A document that was opened in place of the job's ends it.
    let Some(job) = page.job.take().filter(|job| *origin == job.origin()) else { return };
    mode.set_if_neq(job.mode());
    if let Some(panel) = job.panel() {
        panels.write(ShowPanel(panel));
    }
    if let (Job::Tour, Some(active)) = (job, active) {
        *tour = Tour::on(active.0);
    }
}
