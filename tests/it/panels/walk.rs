//! A walk over every action and over all widgets of the panels, as far as clicks lead: each changes the document by one step that
//! undo takes back to the last value, or leaves it alone.
//!
//! The Loader writes files; the walk over it, whose files lie in the test's folder, is in `of_library`, and the walks over actions
//! and panels of meshes are in `with_mesh`. That no action and no panel is left out is told by `coverage`.

mod coverage;
mod of_library;
mod states;
mod with_mesh;

use std::{
    collections::{BTreeSet, VecDeque},
    sync::Arc,
    time::{Duration, Instant},
};

use bevy::{prelude::*, time::TimeUpdateStrategy};
use bevy_egui::egui::{self, Key, Pos2, Rect};
use rigsmith::{
    editor::{
        ActiveRig,
        actions::{Action, ActionRequest},
        files::{
            LoadJob, OpenRequest, SaveJob,
            dialog::{Answer, Dialog, DialogAnswer, Question},
        },
        fitting::FittingPlugin,
        library::{
            ChosenTemplate, LibraryAction, LibraryFolders, LibraryJobs, TemplateDraft, TemplateLibrary, TemplateSave,
        },
        mode::Mode,
        onion::OnionSkin,
        panel::EditorPanel,
        panels::{
            controls::ControlsPanel,
            curves::CurvesPanel,
            display::DisplayPanel,
            face::FacePanel,
            graph::GraphPanel,
            hierarchy::HierarchyPanel,
            history::HistoryPanel,
            loader::LoaderPanel,
            local_groups::GroupsPanel,
            log::LogPanel,
            poses::PosesPanel,
            process::ProcessPanel,
            properties::PropertiesPanel,
            selection_sets::SelectionSetsPanel,
            skinning::SkinningPanel,
            tags::TagsPanel,
            timeline::{Timeline, TimelinePanel, TimelineRequest},
            updater::UpdaterPanel,
            weights::WeightsPanel,
        },
        recovery::Recovery,
        running_work::running,
        tools::{ToolsPlugin, paint::brush::PaintBrush},
    },
    files::{SearchPaths, TemplatePlace},
    plugins::{
        fit::FitJob,
        history::RigHistory,
        stage::{RigStage, StageRequest},
    },
    prelude::*,
    rig::{
        JointData, RestTransform, SelectionSet, TagKind,
        animation::{Key as ClipKey, Property, RigClip, Track, TrackTarget},
        operations::TagOperation,
        template::write_template,
    },
};

use super::desk::{Desk, Sheet, ShownWidget};
use crate::{bench::HANG, window_app::docked_app};

const CLIP: Uid = Uid(0xA1_0001);
const BASE: Uid = Uid(0xA1_0002);
const JOINTS: [Uid; 3] = [Uid(11), Uid(12), Uid(13)];

/// Most widgets of one panel that are clicked.
const MOST_WIDGETS: usize = 120;

/// The panel with a walk of its own.
const OF_LIBRARY: &str = "Loader";

/// Panels with their titles, and the sizes at which they show all that they have.
fn panels() -> Vec<(&'static str, Box<dyn EditorPanel>, egui::Vec2)> {
    let (beside, below) = (egui::vec2(360.0, 2000.0), egui::vec2(1100.0, 700.0));
    vec![
        ("Hierarchy", Box::new(HierarchyPanel::default()), beside),
        ("Properties", Box::new(PropertiesPanel::default()), beside),
        ("Tags", Box::new(TagsPanel::default()), beside),
        ("Controls", Box::new(ControlsPanel::default()), beside),
        ("Process", Box::new(ProcessPanel::default()), beside),
        ("Groups", Box::new(GroupsPanel::default()), beside),
        ("Skinning", Box::new(SkinningPanel::default()), beside),
        ("Weights", Box::new(WeightsPanel::default()), beside),
        ("Face", Box::new(FacePanel::default()), beside),
        ("Poses", Box::new(PosesPanel::default()), beside),
        ("Sets", Box::new(SelectionSetsPanel::default()), beside),
        ("History", Box::new(HistoryPanel::default()), beside),
        ("Updater", Box::new(UpdaterPanel::default()), beside),
        ("Display", Box::new(DisplayPanel::default()), beside),
        ("Timeline", Box::new(TimelinePanel::default()), below),
        ("Curves", Box::new(CurvesPanel::default()), below),
        ("Graph", Box::new(GraphPanel::default()), below),
        ("Log", Box::new(LogPanel::default()), below),
    ]
}

fn bent(angle: f32) -> PoseOffset {
    PoseOffset::from_rotation(Quat::from_rotation_z(angle))
}

/// The window's app without the window, whose rig has something for each panel.
struct Walk {
    desk: Desk,
    size: egui::Vec2,
    wrong: Vec<String>,
    /// Deeds that made a step.
    made: BTreeSet<String>,
    /// State of the Loader before each deed.
    shelf: Option<Shelf>,
    folder: tempfile::TempDir,
}

/// A template that is chosen in the Loader, and the choices of the form in which the rig is written.
struct Shelf {
    chosen: TemplatePlace,
    draft: TemplateDraft,
}

impl Walk {
    fn new(panel: Box<dyn EditorPanel>, size: egui::Vec2) -> Self {
        let mut walk = Self::empty(panel, size);
        walk.fill();
        walk
    }

    /// The app with an empty document.
    fn empty(panel: Box<dyn EditorPanel>, size: egui::Vec2) -> Self {
        Self::with(Sheet::Panel(panel), size)
    }

    /// The app with an empty document, and what of it is drawn.
    fn with(sheet: Sheet, size: egui::Vec2) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let time = TimeUpdateStrategy::ManualDuration(Duration::ZERO);
        let mut app = docked_app(folder.path().join("state"), Vec::new(), time);
        app.add_plugins((ToolsPlugin, FittingPlugin));
        app.finish();
        app.cleanup();
        let desk = Desk::of(app, Entity::PLACEHOLDER, sheet, size);
        let mut walk = Self { desk, size, wrong: Vec::new(), made: BTreeSet::new(), shelf: None, folder };
        walk.desk.until("a document", |desk| desk.app.world().contains_resource::<ActiveRig>());
        walk.desk.app.world_mut().write_message(OpenRequest::Empty);
        walk.rest();
        walk.desk.rig = walk.desk.app.world().resource::<ActiveRig>().0;
        walk
    }

    /// Joints with partners, a group, commands, a pose, a selection set and a clip.
    fn fill(&mut self) {
        let [hips, left, right] = JOINTS;
        let joint = |uid, label: &str, x: f32, mirror: Option<Uid>| JointData {
            uid,
            label: Some(label.to_owned()),
            rest: RestTransform::from_translation(Vec3::new(x, 1.0, 0.0)),
            mirror,
            ..default()
        };
        let add = |joint: JointData, parent| RigEdit::AddJoint { joint: Box::new(joint), parent, index: 9 };
        let command = |module: &str| TagKind::Command { module: module.into(), params: "()".into(), feature: None };
        let mut clip = RigClip { range: [0.0, 2.0], ..RigClip::new(CLIP, BASE, "walk") };
        let keys = [0.0, 1.0, 2.0].map(|time| ClipKey::rotation(time, Quat::from_rotation_z(0.5 * time))).to_vec();
        let target = TrackTarget { node: left, property: Property::Rotation };
        clip.layers[0].tracks.insert(target, Arc::new(Track { keys }));
        let arms = SelectionSet { name: "Arms".to_owned(), nodes: vec![left, right] };
        for operation in [
            Operation::Edits(vec![
                add(joint(hips, "hips", 0.0, None), None),
                add(joint(left, "arm_l", 1.0, Some(right)), Some(hips)),
                add(joint(right, "arm_r", -1.0, Some(left)), Some(hips)),
            ]),
            Operation::Group { joints: vec![left], name: "left".into(), color: None },
            Operation::Tags(TagOperation::Add { joints: vec![left], kind: command("control"), index: None }),
            Operation::Tags(TagOperation::Add { joints: vec![left, right], kind: command("null"), index: None }),
            Operation::Pose(vec![(left, bent(0.8))]),
            Operation::StorePose("wave".to_owned()),
            Operation::Edits(vec![RigEdit::SetSelectionSets(vec![arms])]),
            Operation::Edits(vec![RigEdit::AddClip(Box::new(clip), 0)]),
        ] {
            self.desk.edit(operation);
        }
        self.rest();
        assert_eq!((self.desk.rig().len(), self.desk.steps().1), (3, 8), "{:?}", self.desk.told());
    }

    /// Runs frames until nothing goes on in the background.
    fn rest(&mut self) {
        let (started, mut quiet) = (Instant::now(), 0);
        while quiet < 2 {
            self.desk.frame();
            let world = self.desk.app.world();
            let is_busy = world.resource::<LibraryJobs>().name().is_some()
                || world.resource::<LoadJob>().name().is_some()
                || world.resource::<SaveJob>().name().is_some()
                || world.resource::<Recovery>().is_looking()
                || world.resource::<TemplateLibrary>().is_listing()
                || world.resource::<TemplateSave>().is_writing()
                || running(world).is_some()
                || is_fitting(world);
            // Work that other tests left in the system's folder for temporary files is none of ours.
            let asks = matches!(world.resource::<Dialog>().question(), Some(Question::Recover(_)));
            if asks {
                self.desk.app.world_mut().write_message(DialogAnswer(Answer::Cancel));
            }
            let is_busy = is_busy || asks;
            quiet = if is_busy { 0 } else { quiet + 1 };
            assert!(started.elapsed() < HANG, "something never ends");
            if is_busy {
                std::thread::sleep(Duration::from_millis(1));
            }
        }
    }

    /// Selects an arm, and opens the clip; a deed leaves nothing of the Loader's state to the next one.
    fn ready(&mut self) {
        if let Some(Shelf { chosen, draft }) = &self.shelf {
            self.desk.app.insert_resource(ChosenTemplate(Some(chosen.clone()))).insert_resource(draft.clone());
            let stage = StageRequest { rig: self.desk.rig, stage: RigStage::Built };
            self.desk.app.world_mut().write_message(stage);
            self.rest();
        }
        if self.desk.selected() != &JOINTS[1..2] {
            self.desk.select(&[JOINTS[1]]);
        }
        self.desk.app.world_mut().write_message(TimelineRequest::Open(Some(CLIP)));
        self.desk.frames(2);
    }

    fn change(&mut self, change: Change) {
        self.desk.app.world_mut().write_message(EditRequest { rig: self.desk.rig, change });
        self.desk.frames(2);
    }

    /// Does something that makes so many steps at most, judges what became of the document, and takes it back.
    fn check(&mut self, what: &str, most: usize, act: impl FnOnce(&mut Desk)) {
        let (before, bytes, done) = (self.desk.rig().clone(), write_template(self.desk.rig()), self.desk.steps().1);
        act(&mut self.desk);
        self.rest();
        if self.desk.app.world().get::<RigHistory>(self.desk.rig).is_some_and(RigHistory::is_previewing) {
            self.wrong.push(format!("{what} leaves a preview"));
            self.change(Change::CancelPreview);
        }
        let now = self.desk.steps().1;
        let steps = now.abs_diff(done);
        let is_as_before = |walk: &Self| *walk.desk.rig() == before && write_template(walk.desk.rig()) == bytes;
        if steps == 0 && !is_as_before(self) {
            self.wrong.push(format!("{what} changes the document without a step"));
        } else if steps > 0 {
            if steps > most {
                self.wrong.push(format!("{what} makes {now} steps of {done}"));
            }
            for _ in 0..steps {
                self.change(if now > done { Change::Undo } else { Change::Redo });
            }
            if is_as_before(self) && self.desk.steps().1 == done {
                self.made.insert(what.to_owned());
            } else {
                self.wrong.push(format!("{what} is not taken back"));
            }
        }
    }

    /// Names of everything in sight that can be clicked, each once, with its place.
    fn names(&self) -> Vec<(String, Pos2)> {
        names(&self.desk, self.size)
    }

    /// Clicks everything, and what clicks bring into sight; entries of menus, too.
    fn crawl(&mut self, panel: &str) {
        let most = if panel == "History" { usize::MAX } else { 1 };
        let size = self.size;
        self.ready();
        let mut todo: VecDeque<String> = self.names().into_iter().map(|(name, _)| name).collect();
        let mut known: BTreeSet<String> = todo.iter().cloned().collect();
        while let Some(name) = todo.pop_front() {
            for is_menu in [false, true] {
                self.ready();
                let Some(at) = place(&self.desk, size, &name) else { continue };
                let before: BTreeSet<String> = self.names().into_iter().map(|(name, _)| name).collect();
                let mut opened = Vec::new();
                let what = format!("{panel}: {name}{}", if is_menu { " (menu)" } else { "" });
                self.check(&what, most, |desk| {
                    open(desk, at, is_menu);
                    let seen = names(desk, size).into_iter().map(|(name, _)| name);
                    opened.extend(seen.filter(|seen| !before.contains(seen)));
                    escape(desk);
                });
                // What stays in sight is a widget of the panel.
                let stays: BTreeSet<String> = self.names().into_iter().map(|(name, _)| name).collect();
                for entry in opened {
                    if stays.contains(&entry) {
                        if known.len() < MOST_WIDGETS && known.insert(entry.clone()) {
                            todo.push_back(entry);
                        }
                        continue;
                    }
                    self.ready();
                    let Some(at) = place(&self.desk, size, &name) else { break };
                    // A click that opens a menu may be a step of its own.
                    let most = if self.made.contains(&what) { most.max(2) } else { most };
                    self.check(&format!("{what}: {entry}"), most, |desk| {
                        open(desk, at, is_menu);
                        if let Some(at) = place(desk, size, &entry) {
                            open(desk, at, false);
                        }
                        escape(desk);
                    });
                }
            }
        }
    }

    /// Drags everything a little: numbers, sliders, keys, tags, nodes.
    fn drag_all(&mut self, panel: &str) {
        let most = if panel == "History" { usize::MAX } else { 1 };
        let size = self.size;
        self.ready();
        let names: Vec<String> = self.names().into_iter().map(|(name, _)| name).collect();
        for name in names.into_iter().take(MOST_WIDGETS / 2) {
            self.ready();
            let Some(at) = place(&self.desk, size, &name) else { continue };
            self.check(&format!("{panel}: {name} (drag)"), most, |desk| {
                desk.drag(at, at + egui::vec2(40.0, 3.0));
                escape(desk);
            });
        }
    }
}

fn is_fitting(world: &World) -> bool {
    let jobs = world.try_query::<&FitJob>();
    jobs.is_some_and(|mut jobs| jobs.iter(world).any(|job| !job.waits()))
}

fn names(desk: &Desk, size: egui::Vec2) -> Vec<(String, Pos2)> {
    let inside = Rect::from_min_size(Pos2::ZERO, size);
    let is_meant = |seen: &&ShownWidget| {
        seen.clickable && seen.enabled && !seen.label.trim().is_empty() && inside.contains(seen.rect.center())
    };
    let mut known = BTreeSet::new();
    let all = desk.seen.iter().filter(is_meant).map(|seen| (seen.label.clone(), seen.rect.center()));
    all.filter(|(name, _)| known.insert(name.clone())).collect()
}

fn place(desk: &Desk, size: egui::Vec2, name: &str) -> Option<Pos2> {
    names(desk, size).into_iter().find(|(known, _)| known == name).map(|(_, at)| at)
}

fn open(desk: &mut Desk, at: Pos2, is_menu: bool) {
    desk.time += 1.0;
    if is_menu {
        desk.secondary_click_at(at);
    } else {
        desk.click_at(at);
    }
    desk.frames(1);
}

/// Closes menus and drops what is being typed.
fn escape(desk: &mut Desk) {
    desk.key(Key::Escape);
    desk.move_to(Pos2::new(-10.0, -10.0));
}

#[test]
fn all_that_panels_do_is_taken_back_by_undo() {
    let (mut wrong, mut made) = (Vec::new(), BTreeSet::new());
    for (name, panel, size) in panels() {
        let mut walk = Walk::new(panel, size);
        walk.crawl(name);
        wrong.append(&mut walk.wrong);
        made.append(&mut walk.made);
    }
    assert!(wrong.is_empty(), "{} are wrong:\n{}", wrong.len(), wrong.join("\n"));
    assert!(made.len() > 20, "only these made a step: {made:?}");
}

#[test]
fn all_that_drags_in_panels_do_is_taken_back_by_undo() {
    let (mut wrong, mut made) = (Vec::new(), BTreeSet::new());
    for (name, panel, size) in panels() {
        let mut walk = Walk::new(panel, size);
        walk.drag_all(name);
        wrong.append(&mut walk.wrong);
        made.append(&mut walk.made);
    }
    assert!(wrong.is_empty(), "{} are wrong:\n{}", wrong.len(), wrong.join("\n"));
    assert!(!made.is_empty(), "no drag made a step");
}

/// Clicks, drags and menus leave the document and the window as they are while nothing that panels ask for is carried out.
#[test]
fn panels_change_nothing_themselves() {
    let mut count = 0;
    let loader: Box<dyn EditorPanel> = Box::new(LoaderPanel::default());
    let loader = (OF_LIBRARY, loader, egui::vec2(360.0, 2000.0));
    for (name, panel, size) in panels().into_iter().chain([loader]) {
        let mut walk = Walk::new(panel, size);
        walk.ready();
        let state = |walk: &Walk| {
            let world = walk.desk.app.world();
            let of_window =
                (*world.resource::<Mode>(), *world.resource::<OnionSkin>(), *world.resource::<PaintBrush>());
            let of_timeline = format!("{:?}", world.resource::<Timeline>());
            (walk.desk.steps(), walk.desk.selected().to_vec(), of_window, of_timeline)
        };
        let (rig, before) = (walk.desk.rig().clone(), state(&walk));
        walk.desk.deaf = true;
        for (widget, at) in walk.names().into_iter().take(MOST_WIDGETS / 3) {
            open(&mut walk.desk, at, count % 2 == 1);
            escape(&mut walk.desk);
            walk.desk.drag(at, at + egui::vec2(40.0, 3.0));
            escape(&mut walk.desk);
            assert!(*walk.desk.rig() == rig, "{name}: {widget} changes the document");
            assert_eq!(state(&walk), before, "{name}: {widget}");
            count += 1;
        }
    }
    assert!(count > 80, "only {count} widgets were met");
}

/// Actions that are no edits of the open document by what they are: they open, save or close documents, or are undo itself.
const OF_FILES: [Action; 9] = [
    Action::New,
    Action::Open,
    Action::AddMesh,
    Action::Save,
    Action::SaveAs,
    Action::Export,
    Action::Quit,
    Action::Undo,
    Action::Redo,
];

#[test]
fn all_actions_are_taken_back_by_undo() {
    let mut walk = Walk::new(Box::new(HierarchyPanel::default()), egui::vec2(360.0, 600.0));
    for action in Action::all() {
        if OF_FILES.contains(&action) {
            continue;
        }
        walk.ready();
        walk.check(&format!("{action:?}"), 1, |desk| {
            desk.app.world_mut().write_message(ActionRequest(action));
            desk.frames(4);
        });
    }
    assert!(walk.wrong.is_empty(), "{} are wrong:\n{}", walk.wrong.len(), walk.wrong.join("\n"));
    for action in [Action::Delete, Action::DeleteHierarchy] {
        assert!(walk.made.contains(&format!("{action:?}")), "{action:?} made no step: {:?}", walk.made);
    }
}
