//! Booth: an editor's app without a window, of whose panels, overlays and whole frame pictures are taken.
//!
//! Time stands still in the app and passes in equal steps in the interface, so that the same state gives the same picture.

use std::{collections::VecDeque, path::PathBuf, time::Duration};

use bevy::{prelude::*, time::TimeUpdateStrategy};
use bevy_egui::{
    EguiContext, EguiPrimaryContextPass, PrimaryEguiContext,
    egui::{self, Pos2, RawInput, Rect, Shape, ViewportId, accesskit, vec2},
};
use rigsmith::{
    editor::{
        ActiveRig,
        files::{
            LoadJob, OpenRequest, SaveJob,
            dialog::{Answer, Dialog, DialogAnswer, Question},
        },
        library::{LibraryPictures, TemplateLibrary},
        panel::{EditorOverlay, EditorPanel, Panels, Requests},
        panels::log::ClearLog,
        recovery::Recovery,
        settings::EditorSettings,
        start::{StartPage, StartPictures},
        style::{self, Look},
    },
    plugins::{
        face::FaceJob,
        fit::FitJob,
        skinning::SkinningJob,
        surface::{RigMesh, SkinOf},
    },
    prelude::*,
};

use super::{
    picture::Picture,
    queries::{Text, Widget, texts, widgets},
    raster::{self, Blending, Scene, Textures},
};
use crate::{
    bench::{HANG, wait},
    window_app::docked_app,
};

/// Subject of a picture.
pub enum Subject {
    /// A panel in a tab.
    Panel(Box<dyn EditorPanel>),
    /// An overlay alone.
    Overlay(Box<dyn EditorOverlay>),
    /// All overlays that the app's plugins have added.
    Overlays,
    /// The whole window.
    Window,
}

/// Size and look of a picture.
#[derive(Clone, Copy)]
pub struct Frame {
    /// Width and height in points.
    pub size: [u16; 2],
    pub scale: f32,
    pub look: Look,
}

/// Step before a picture is taken.
#[derive(Clone, Copy)]
pub enum Step {
    /// Clicks the first widget whose name begins so.
    Click(&'static str),
    /// Clicks it with the right button.
    Menu(&'static str),
    /// Types into the field that has the keyboard.
    Type(&'static str),
}

/// A step that could not be taken.
#[derive(Debug, Clone, Copy, thiserror::Error)]
#[error("nothing called {0:?} is there to be clicked")]
pub struct StepError(&'static str);

/// A picture, and everything in it that can be asked for.
pub struct Shot {
    pub picture: Picture,
    /// Triangles and textures of the picture.
    pub scene: Scene,
    /// Steps that could not be taken.
    pub missed: Vec<StepError>,
    pub widgets: Vec<Widget>,
    pub texts: Vec<Text>,
}

/// Frames until animations and layouts have come to rest.
const FRAMES: usize = 12;
/// Time between two frames in seconds.
const STEP: f64 = 0.08;
/// Margin of a tab's content, as in the dock.
const MARGIN: i8 = 6;

/// An interface with its textures.
pub struct Canvas {
    ctx: egui::Context,
    textures: Textures,
    time: f64,
    /// Input of the next frames.
    events: VecDeque<Vec<egui::Event>>,
}

impl Canvas {
    /// An interface of its own.
    pub fn new() -> Self {
        Self::of(egui::Context::default())
    }

    fn of(ctx: egui::Context) -> Self {
        ctx.enable_accesskit();
        Self { ctx, textures: Textures::default(), time: 0.0, events: VecDeque::new() }
    }

    /// A picture of widgets that need no app.
    pub fn shoot(&mut self, frame: Frame, mut show: impl FnMut(&mut egui::Ui)) -> Shot {
        style::apply(&self.ctx, frame.look);
        let mut last = None;
        for _ in 0..3 {
            let input = self.input(frame);
            let mut output = self.ctx.run_ui(input, &mut show);
            self.follow(&mut output);
            last = Some(output);
        }
        let ground = self.ctx.global_style().visuals.panel_fill;
        self.develop(frame, last.expect("a frame was drawn"), ground)
    }

    /// A line of text, as wide as a picture or wider.
    pub fn caption(&mut self, text: &str, width: usize) -> Picture {
        let width = (width as u16).max(7 * text.chars().count() as u16);
        let frame = Frame { size: [width, 18], scale: 1.0, look: Look::default() };
        self.shoot(frame, |ui| {
            ui.add(egui::Label::new(text).extend());
        })
        .picture
    }

    /// Queues the input of a step for the next frames; an error if what is to be clicked is not there.
    fn queue(&mut self, step: Step, seen: &[Widget]) -> Result<(), StepError> {
        match step {
            Step::Click(name) => self.queue_click(named(seen, name)?, egui::PointerButton::Primary),
            Step::Menu(name) => self.queue_click(named(seen, name)?, egui::PointerButton::Secondary),
            Step::Type(text) => self.events.push_back(vec![egui::Event::Text(text.to_owned())]),
        }
        Ok(())
    }

    fn queue_click(&mut self, pos: Pos2, button: egui::PointerButton) {
        let modifiers = egui::Modifiers::NONE;
        let turned = |pressed| egui::Event::PointerButton { pos, button, pressed, modifiers };
        let frames = [egui::Event::PointerMoved(pos), turned(true), turned(false), egui::Event::PointerGone];
        self.events.extend(frames.map(|event| vec![event]));
    }

    fn input(&mut self, frame: Frame) -> RawInput {
        self.time += STEP;
        let [width, height] = frame.size.map(f32::from);
        let mut input = RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, vec2(width, height))),
            time: Some(self.time),
            max_texture_side: Some(4096),
            events: self.events.pop_front().unwrap_or_default(),
            ..default()
        };
        input.viewports.entry(ViewportId::ROOT).or_default().native_pixels_per_point = Some(frame.scale);
        input
    }

    /// Takes over the textures of a frame.
    fn follow(&mut self, output: &mut egui::FullOutput) {
        self.textures.apply(std::mem::take(&mut output.textures_delta));
    }

    fn develop(&mut self, frame: Frame, mut output: egui::FullOutput, ground: egui::Color32) -> Shot {
        output.shapes.iter_mut().for_each(|shape| hide_times(&self.ctx, &mut shape.shape));
        let nodes = output.platform_output.accesskit_update.map(|update| update.nodes).unwrap_or_default();
        let texts = texts(&output.shapes);
        let primitives = self.ctx.tessellate(output.shapes, output.pixels_per_point);
        let size = frame.size.map(|side| (f32::from(side) * frame.scale).round() as usize);
        let textures = self.textures.clone();
        let scene = Scene { textures, primitives, pixels_per_point: output.pixels_per_point, size, ground };
        let picture = raster::draw(&scene, Blending::Gamma);
        Shot { picture, scene, missed: Vec::new(), widgets: widgets(&nodes), texts }
    }
}

/// Middle of the first widget whose name begins so.
fn named(seen: &[Widget], name: &'static str) -> Result<Pos2, StepError> {
    let found = seen.iter().find(|widget| widget.label.starts_with(name));
    found.map(|widget| widget.rect.center()).ok_or(StepError(name))
}

/// Takes the durations of commands out of texts: they differ from run to run.
fn hide_times(ctx: &egui::Context, shape: &mut Shape) {
    let is_time = |text: &str| {
        let number = text.strip_suffix(" ms").or_else(|| text.strip_suffix(" µs"));
        number.is_some_and(|number| number.parse::<f32>().is_ok())
    };
    match shape {
        Shape::Text(text) if is_time(text.galley.text()) => *shape = Shape::Noop,
        Shape::Text(text) => {
            let Some((state, _)) = text.galley.text().split_once(" · ").filter(|(_, time)| is_time(time)) else {
                return;
            };
            let Some(format) = text.galley.job.sections.first().map(|section| section.format.clone()) else { return };
            let state = state.to_owned();
            text.galley = ctx.fonts_mut(|fonts| fonts.layout_no_wrap(state, format.font_id, format.color));
        }
        Shape::Vec(shapes) => shapes.iter_mut().for_each(|shape| hide_times(ctx, shape)),
        _ => {}
    }
}

/// The app.
pub struct Booth {
    pub app: App,
    /// The canvas of overlays and of the window, which keep textures of their own.
    canvas: Canvas,
    folder: tempfile::TempDir,
}

impl Booth {
    /// An app with an empty document, whose library has these folders.
    pub fn new(folders: &[&str]) -> Self {
        let mut booth = Self::with(folders, TimeUpdateStrategy::ManualDuration(Duration::ZERO));
        booth.settle();
        booth
    }

    /// An app in which time passes, as files need that are watched.
    pub fn in_time(folders: &[&str]) -> Self {
        let mut booth = Self::with(folders, TimeUpdateStrategy::Automatic);
        booth.settle();
        booth
    }

    fn with(folders: &[&str], time: TimeUpdateStrategy) -> Self {
        let folder = tempfile::tempdir().expect("a folder for the test");
        let folders = folders.iter().map(PathBuf::from).collect();
        let mut app = docked_app(folder.path().join("state"), folders, time);
        app.finish();
        app.cleanup();
        let window = app.world_mut().spawn(PrimaryEguiContext).id();
        let ctx = app.world_mut().get_mut::<EguiContext>(window).expect("a context").get_mut().clone();
        Self { app, canvas: Canvas::of(ctx), folder }
    }

    pub fn world(&self) -> &World {
        self.app.world()
    }

    /// The folder of the test's own files.
    pub fn folder(&self) -> &std::path::Path {
        self.folder.path()
    }

    /// The open rig.
    pub fn entity(&self) -> Entity {
        self.world().resource::<ActiveRig>().0
    }

    pub fn rig(&self) -> &Rig {
        self.world().get::<Rig>(self.entity()).expect("a rig is open")
    }

    /// Writes a message and waits until everything that follows from it is done.
    pub fn send<M: Message>(&mut self, message: M) {
        self.app.world_mut().write_message(message);
        self.settle();
    }

    pub fn edit(&mut self, operation: Operation) {
        let rig = self.entity();
        self.app.world_mut().write_message(EditRequest::operation(rig, operation));
        self.app.update();
    }

    /// Opens something, and closes the start page.
    pub fn open(&mut self, request: OpenRequest) {
        self.send(request);
        assert!(self.world().get_resource::<ActiveRig>().is_some(), "a document is open");
    }

    /// Adds a mesh to the open rig.
    pub fn add_mesh(&mut self, mesh: RigMesh) -> Entity {
        let rig = self.entity();
        let mesh = self.app.world_mut().spawn((mesh, SkinOf(rig))).id();
        self.settle();
        mesh
    }

    pub fn select(&mut self, joints: &[Uid]) {
        let rig = self.entity();
        self.send(PickRequest { rig, what: Pick::Joints(joints.to_vec()), add: false });
    }

    /// Empties the log and writes these notices into it.
    pub fn tell(&mut self, notices: impl IntoIterator<Item = rigsmith::editor::notice::Notice>) {
        self.send(ClearLog);
        for notice in notices {
            self.app.world_mut().write_message(notice);
        }
        self.settle();
    }

    /// Asks a question of files in place of the present one.
    pub fn question(&mut self, question: Question) {
        self.app.world_mut().resource_mut::<Dialog>().ask(question);
    }

    /// Cancels the present question.
    pub fn cancel_question(&mut self) {
        if self.world().resource::<Dialog>().question().is_some() {
            self.send(DialogAnswer(Answer::Cancel));
        }
    }

    /// Stops the clocks.
    pub fn stand_still(&mut self) {
        self.app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
        self.app.update();
    }

    /// Runs frames until something is so.
    #[track_caller]
    pub fn until(&mut self, what: &str, is_so: impl Fn(&World) -> bool) {
        wait(self, what, |booth| booth.app.update(), |booth| is_so(booth.world()));
    }

    /// Runs frames until nothing goes on in the background.
    #[track_caller]
    pub fn settle(&mut self) {
        let started = std::time::Instant::now();
        let mut quiet = 0;
        while quiet < 5 {
            self.app.update();
            // Work that other tests left in the system's folder for temporary files is none of ours.
            if matches!(self.world().resource::<Dialog>().question(), Some(Question::Recover(_))) {
                self.app.world_mut().write_message(DialogAnswer(Answer::Cancel));
            }
            quiet = if self.is_busy() { 0 } else { quiet + 1 };
            assert!(started.elapsed() < HANG, "something never ends");
            if quiet == 0 {
                std::thread::sleep(Duration::from_millis(2));
            }
        }
    }

    fn is_busy(&mut self) -> bool {
        let world = self.app.world_mut();
        let library = world.resource::<TemplateLibrary>();
        let pictures = world.resource::<LibraryPictures>();
        let is_drawing = library.listing().templates().any(|listed| pictures.is_wanted(listed));
        let is_open = world.contains_resource::<ActiveRig>();
        let work = world.resource::<LoadJob>().name().is_some()
            || world.resource::<SaveJob>().name().is_some()
            || world.resource::<Recovery>().is_looking()
            || library.is_listing()
            // There are always those that come with Rigsmith.
            || library.is_begun() && library.listing().templates().next().is_none();
        let mut jobs = world.query_filtered::<(), Or<(With<SkinningJob>, With<FaceJob>, With<FitJob>)>>();
        let has_jobs = jobs.iter(world).count() > 0;
        !is_open || work || is_drawing || has_jobs
    }

    /// True while the start page waits for its pictures.
    fn is_starting(&self) -> bool {
        let start = self.world().resource::<StartPictures>();
        self.world().resource::<StartPage>().is_shown() && start.model("biped").is_none()
    }

    /// Takes a picture after some steps.
    pub fn take(&mut self, subject: &mut Subject, frame: Frame, steps: &[Step]) -> Shot {
        let mut own = matches!(subject, Subject::Panel(_) | Subject::Overlay(_)).then(Canvas::new);
        if own.is_none() {
            let mut settings = self.app.world_mut().resource_mut::<EditorSettings>();
            (settings.theme, settings.high_contrast) = (frame.look.theme, frame.look.high_contrast);
        }
        let mut output = self.rest(&mut own, subject, frame);
        let mut missed = Vec::new();
        for step in steps {
            let nodes = output.platform_output.accesskit_update.take().map(|update| update.nodes).unwrap_or_default();
            let canvas = own.as_mut().unwrap_or(&mut self.canvas);
            missed.extend(canvas.queue(*step, &widgets(&nodes)).err());
            output = self.rest(&mut own, subject, frame);
        }
        let canvas = own.as_mut().unwrap_or(&mut self.canvas);
        let ground = match subject {
            Subject::Panel(_) => canvas.ctx.global_style().visuals.panel_fill,
            _ => egui::Color32::from_rgb(70, 78, 92),
        };
        let shot = Shot { missed, ..canvas.develop(frame, output, ground) };
        if matches!(subject, Subject::Window) && !steps.is_empty() {
            // A click beside a menu closes it.
            let [width, height] = frame.size.map(f32::from);
            self.canvas.queue_click(egui::pos2(0.5 * width, 0.7 * height), egui::PointerButton::Primary);
            self.rest(&mut None, subject, frame);
        }
        shot
    }

    /// Draws the overlays as they are, without a picture, so that pages notice that they are closed.
    pub fn draw_overlays(&mut self) {
        let frame = Frame { size: [1024, 600], scale: 1.0, look: Look::default() };
        self.rest(&mut None, &mut Subject::Overlays, frame);
    }

    /// Draws frames until everything has come to rest; the output of the last one.
    fn rest(&mut self, own: &mut Option<Canvas>, subject: &mut Subject, frame: Frame) -> egui::FullOutput {
        let started = std::time::Instant::now();
        let mut last = None;
        let mut frames = 0;
        while frames < FRAMES {
            let is_whole = matches!(subject, Subject::Overlays | Subject::Window);
            // What ends between a frame and the look at it is not in its picture.
            let was_busy = self.is_busy() || is_whole && self.is_starting();
            let canvas = own.as_mut().unwrap_or(&mut self.canvas);
            style::apply(&canvas.ctx, frame.look);
            canvas.ctx.all_styles_mut(|style| style.visuals.text_cursor.blink = false);
            let input = canvas.input(frame);
            let mut output = match subject {
                Subject::Window => {
                    canvas.ctx.begin_pass(input);
                    self.app.world_mut().run_schedule(EguiPrimaryContextPass);
                    canvas.ctx.end_pass()
                }
                _ => draw(&canvas.ctx, input, subject, self.app.world_mut()),
            };
            canvas.follow(&mut output);
            last = Some(output);
            self.app.update();
            frames += 1;
            // The causes are those of the frame before, which is one of the last frames, too.
            let causes = own.as_ref().unwrap_or(&self.canvas).ctx.repaint_causes();
            let is_drawing = causes.iter().any(|cause| cause.file.ends_with("thumbnail.rs"));
            if was_busy || is_drawing || self.is_busy() || is_whole && self.is_starting() {
                // What the frame asked for is not there yet: lists and pictures of files.
                assert!(started.elapsed() < HANG, "something never ends");
                std::thread::sleep(Duration::from_millis(20));
                self.settle();
                frames = 0;
            }
        }
        last.expect("a frame was drawn")
    }
}

/// Draws a frame and carries out what it asks for.
fn draw(ctx: &egui::Context, input: RawInput, subject: &mut Subject, world: &mut World) -> egui::FullOutput {
    let mut requests = Requests::default();
    let mut panels = match subject {
        Subject::Overlays => world.remove_resource::<Panels>(),
        _ => None,
    };
    let output = ctx.run_ui(input, |ui| match &mut *subject {
        Subject::Panel(panel) => {
            let inside = egui::Frame::new().inner_margin(egui::Margin::same(MARGIN));
            inside.show(ui, |ui| panel.show(ui, world, &mut requests));
        }
        Subject::Overlay(overlay) => overlay.show(&ui.ctx().clone(), world, &mut requests),
        Subject::Overlays => {
            let ctx = ui.ctx().clone();
            for overlay in panels.iter_mut().flat_map(|panels| &mut panels.overlays) {
                overlay.show(&ctx, world, &mut requests);
            }
        }
        Subject::Window => {}
    });
    if let Some(panels) = panels {
        world.insert_resource(panels);
    }
    requests.carry_out(world);
    output
}

/// Nodes of the tree for screen readers.
pub type Nodes = [(accesskit::NodeId, accesskit::Node)];
