//! Fits in the window: keys, the bar, the pointer, undo and redo, without a display.

mod again;
mod regions;

use std::{
    path::Path,
    sync::{Arc, OnceLock},
};

use bevy::prelude::*;
use bevy_egui::egui;
use rigsmith::{
    editor::{
        ActiveRig,
        actions::{Action, ActionRequest},
        camera::ViewportSight,
        fitting::{
            FittingPlugin,
            doubts::{FitMarkKind, fit_marks},
        },
        notice::Notice,
        pointer::{ModifierKeys, PointerAct, ViewportPointer},
        result_queue::{self, DiscardResult, HeldPlugin},
        tools::{
            ToolsPlugin,
            region::{RegionSkeleton, RegionTool},
        },
    },
    files::{RealDisk, bundled_characters, load_model},
    headless::headless_app,
    mesh::model::{Model, Weights},
    plugins::{
        document::Change,
        fit::{FitJob, FitMarkers, FitRegion, FitRequest, FitTemplate, FittedRig},
        history::RigHistory,
        landing::HeldResult,
        surface::RigMesh,
    },
    prelude::*,
    rig::{SkinData, template::write_template},
    test_app::strict_app,
};

use super::panels::desk::{Desk, Sheet, ShownWidget};
use crate::{
    bench::{begin_drag, new_clip, undo_meanwhile},
    viewport_app::{CONTROL, MESH, PLAIN, SHIFT, front},
};

/// Notices and actions of a window.
#[derive(Resource, Default)]
struct WindowMessages {
    notices: Vec<String>,
    actions: Vec<Action>,
}

fn collect(
    mut told: ResMut<WindowMessages>,
    mut notices: MessageReader<Notice>,
    mut actions: MessageReader<ActionRequest>,
) {
    told.notices.extend(notices.read().map(|notice| notice.text.clone()));
    told.actions.extend(actions.read().map(|action| action.0));
}

fn body() -> Model {
    static BODY: OnceLock<Model> = OnceLock::new();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/biped.obj");
    BODY.get_or_init(|| load_model(&RealDisk, &path).unwrap()).clone()
}

fn character(name: &str) -> Arc<Rig> {
    bundled_characters().into_iter().find(|rig| rig.about().name == name).unwrap()
}

/// A window with a mesh and an empty rig.
struct Window {
    desk: Desk,
    mesh: Entity,
}

impl Window {
    fn new(model: Model) -> Self {
        let mut app = headless_app(1);
        app.add_plugins((ToolsPlugin, FittingPlugin, HeldPlugin))
            .init_resource::<WindowMessages>()
            .add_systems(Last, collect);
        let mut app = strict_app(app);
        let rig = app.world_mut().spawn(Rig::new(Uid(1), "rig")).id();
        app.insert_resource(ActiveRig(rig)).insert_resource(ViewportSight(Some(front())));
        let mesh = app.world_mut().spawn((RigMesh::new(MESH, model, Vec::new()), SkinOf(rig))).id();
        let desk = Desk::of(app, rig, Sheet::Window, egui::vec2(1200.0, 800.0));
        let mut window = Self { desk, mesh };
        window.until(|window| {
            let surface = window.world().get::<RigSurface>(window.desk.rig);
            surface.is_some_and(|surface| surface.ready().is_some())
        });
        window
    }

    /// The bundled body with the biped in it.
    fn fitted() -> Self {
        let mut window = Self::new(body());
        window.fit();
        window
    }

    fn world(&self) -> &World {
        self.desk.app.world()
    }

    #[track_caller]
    fn until(&mut self, is_so: impl Fn(&Self) -> bool) {
        let start = std::time::Instant::now();
        while !is_so(self) {
            assert!(start.elapsed() < crate::bench::HANG, "it does not come: {:?}", self.told().notices);
            self.desk.frame();
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    }

    fn told(&self) -> &WindowMessages {
        self.world().resource::<WindowMessages>()
    }

    #[track_caller]
    fn says(&self, part: &str) {
        let notices = &self.told().notices;
        assert!(notices.iter().any(|notice| notice.contains(part)), "{part} is not among {notices:?}");
    }

    fn act(&mut self, action: Action) {
        self.desk.app.world_mut().write_message(ActionRequest(action));
        self.desk.frames(3);
    }

    fn settle(&mut self) {
        self.until(|window| window.world().get::<FitJob>(window.mesh).is_none());
        self.desk.frames(4);
    }

    fn fit(&mut self) {
        self.act(Action::Fit);
        self.settle();
    }

    fn change(&mut self, change: Change) {
        let rig = self.desk.rig;
        self.desk.app.world_mut().write_message(EditRequest { rig, change });
        self.desk.frames(4);
    }

    fn rig(&self) -> &Rig {
        self.desk.rig()
    }

    fn text(&self) -> String {
        write_template(self.rig())
    }

    fn joint(&self, label: &str) -> Uid {
        self.rig().find_label(label).unwrap_or_else(|| panic!("no joint {label}"))
    }

    fn at(&self, label: &str) -> Vec3 {
        self.rig().position(self.joint(label))
    }

    fn steps(&self) -> usize {
        self.world().get::<RigHistory>(self.desk.rig).unwrap().steps().1
    }

    fn open(&self) -> Option<&FittedRig> {
        self.world().get(self.desk.rig)
    }

    fn markers(&self) -> Vec<Uid> {
        let markers = self.world().get::<FitMarkers>(self.desk.rig);
        markers.map(|markers| markers.0.keys().copied().collect()).unwrap_or_default()
    }

    fn faces(&self) -> usize {
        self.world().resource::<RegionTool>().faces.as_ref().map_or(0, |faces| faces.triangles.len())
    }

    /// Moves a joint by hand, and gives its place.
    fn drag(&mut self, label: &str, by: Vec3) -> Vec3 {
        let (joint, to) = (self.joint(label), self.at(label) + by);
        self.change(Change::Do(Operation::Move { to: vec![(joint, to)], with_children: false }));
        to
    }

    fn point(&mut self, held: ModifierKeys, acts: &[(Vec2, PointerAct)]) {
        for (at, act) in acts {
            self.desk.app.world_mut().write_message(ViewportPointer { at: *at, act: *act, held });
        }
        self.desk.frame();
    }

    fn click(&mut self, held: ModifierKeys, at: Vec3) {
        let at = front().project(at).unwrap();
        self.point(held, &[(at, PointerAct::Pressed)]);
        self.point(held, &[(at, PointerAct::Released { dragged: false, count: 1 })]);
        self.desk.frame();
    }

    /// Drags a box around all between two places.
    fn drag_box(&mut self, held: ModifierKeys, from: Vec3, to: Vec3) {
        let [from, to] = [from, to].map(|place| front().project(place).unwrap());
        self.point(held, &[(from, PointerAct::Pressed)]);
        self.point(held, &[(from.midpoint(to), PointerAct::Dragged), (to, PointerAct::Dragged)]);
        self.point(held, &[(to, PointerAct::Released { dragged: true, count: 1 })]);
        self.desk.frame();
    }

    /// Drags a box around a hand of the bundled body: 1 for the left one, -1 for the right one.
    fn box_hand(&mut self, side: f32) {
        self.drag_box(PLAIN, Vec3::new(0.5 * side, 1.3, 0.0), Vec3::new(0.8 * side, 0.6, 0.0));
    }
}

/// A joint that is put far outside of the mesh stays there, and it is told that the others stay where they are.
#[test]
fn a_drag_out_of_the_mesh_is_told() {
    let mut window = Window::fitted();
    let (hand, knee) = (window.at("hand_l"), window.at("shin_r"));
    let place = window.drag("forearm_l", Vec3::new(50.0, 0.0, 0.0));
    window.says("were not fitted again");
    assert!(window.at("forearm_l").distance(place) < 1e-3 && window.at("shin_r").distance(knee) < 1e-4);
    // Back in the mesh it takes its neighbours along again.
    let out = window.at("hand_l");
    window.drag("forearm_l", Vec3::new(-49.97, 0.04, 0.0));
    assert!(window.at("hand_l").distance(hand) < 0.2, "{} was {out}", window.at("hand_l"));
    assert_eq!(window.markers().len(), 1);
}

#[test]
fn undo_and_redo_of_a_fit_keep_what_a_drag_needs() {
    let mut window = Window::fitted();
    assert!(window.open().is_some() && window.desk.look("Accept").is_some());
    let steps = window.steps();
    // Undone, nothing is left of it.
    window.change(Change::Undo);
    assert!(window.rig().is_empty() && window.open().is_none() && window.markers().is_empty());
    assert!(window.desk.look("Accept").is_none(), "the bar is gone");
    assert!(fit_marks(window.world()).is_empty());
    // Redone, a drag takes the neighbours along, and is undone and redone itself.
    window.change(Change::Redo);
    assert!(window.open().is_some());
    let hand = window.at("hand_l");
    let place = window.drag("forearm_l", Vec3::new(0.03, 0.04, 0.0));
    assert_eq!(window.steps(), steps + 2, "the move and what follows it");
    assert!(window.at("forearm_l").distance(place) < 1e-4);
    assert!(window.at("hand_l").distance(hand) > 1e-4, "the hand follows");
    let elbow = window.joint("forearm_l");
    assert_eq!(window.markers(), [elbow]);
    let corrected = window.text();
    (0..2).for_each(|_| window.change(Change::Undo));
    assert!(window.open().is_some() && window.markers().is_empty());
    (0..2).for_each(|_| window.change(Change::Redo));
    assert_eq!(window.text(), corrected);
    assert_eq!(window.markers(), [elbow], "a marker comes back with its step");
    assert_eq!(window.open().unwrap().markers.get(&elbow).map(|at| at.distance(place) < 1e-4), Some(true));

    // An accepted fit as well: redo opens it again.
    window.act(Action::Accept);
    assert!(window.open().is_none());
    (0..3).for_each(|_| window.change(Change::Undo));
    assert!(window.rig().is_empty() && window.open().is_none());
    window.change(Change::Redo);
    let (steps, shin) = (window.steps(), window.at("foot_r"));
    window.drag("shin_r", Vec3::new(0.02, 0.03, 0.0));
    assert_eq!(window.steps(), steps + 2, "the drag is followed");
    assert!(window.at("foot_r").distance(shin) < 0.1);
    assert!(window.at("forearm_l").distance(place) > 0.01, "of the undone correction nothing comes back");
}

#[test]
fn a_fit_waits_for_steps_that_were_undone_while_it_ran() {
    let mut window = Window::new(body());
    let rig = window.desk.rig;
    let job = |window: &Window| window.world().get::<FitJob>(window.mesh).map(FitJob::waits);
    let waiting = |window: &mut Window, step: &str| {
        begin_drag(&mut window.desk.app, rig);
        window.act(Action::Fit);
        window.until(|window| job(window) == Some(true));
        undo_meanwhile(&mut window.desk.app, rig, new_clip(step));
        window.desk.frames(3);
        assert!(window.rig().is_empty() && job(window) == Some(true));
    };
    // Esc drops it, and the step can be redone.
    waiting(&mut window, "wave");
    window.act(Action::Cancel);
    window.settle();
    window.says("The fit was cancelled");
    window.change(Change::Redo);
    assert!(window.rig().is_empty());
    assert_eq!((window.rig().clips().len(), window.steps()), (1, 1));
    // So does the button of the status line.
    waiting(&mut window, "jump");
    assert_eq!(result_queue::waiting(window.world()).map(|(kind, _)| kind), Some(HeldResult::Fit));
    window.desk.app.world_mut().write_message(DiscardResult(HeldResult::Fit));
    window.settle();
    assert_eq!(job(&window), None);
    window.change(Change::Redo);
    assert!(window.rig().is_empty());
    // After the redo it lands.
    waiting(&mut window, "run");
    window.change(Change::Redo);
    window.settle();
    assert!(!window.rig().is_empty());
    assert_eq!((window.rig().clips().len(), window.steps()), (3, 4));
}

#[test]
fn places_that_a_person_chose_are_kept_listed_and_let_go() {
    let mut window = Window::new(body());
    let before = window.text();
    window.fit();
    let place = window.drag("forearm_l", Vec3::new(0.02, 0.03, 0.0));
    window.drag("shin_r", Vec3::new(0.02, 0.02, 0.0));
    let mut placed = vec![window.joint("forearm_l"), window.joint("shin_r")];
    placed.sort();
    assert_eq!(window.markers(), placed, "through several drags");
    assert!(window.at("forearm_l").distance(place) < 1e-4);
    for label in ["forearm_l ×", "shin_r ×"] {
        assert!(window.desk.look(label).is_some(), "{label} is listed");
    }
    let marks = fit_marks(window.world());
    assert_eq!(marks.iter().filter(|mark| mark.kind == FitMarkKind::Placed).count(), 2);

    // One is let go, and the fit places it again; undo holds it again.
    let knee = window.at("shin_r");
    window.desk.click("shin_r ×");
    window.desk.frames(4);
    assert_eq!(window.markers(), [window.joint("forearm_l")]);
    assert!(window.at("shin_r").distance(knee) > 0.005, "the knee is {} away", window.at("shin_r").distance(knee));
    assert!(window.at("forearm_l").distance(place) < 1e-4);
    window.change(Change::Undo);
    assert_eq!(window.markers(), placed);
    assert!(window.at("shin_r").distance(knee) < 1e-5);

    // The next fit starts from them, even after this one was accepted.
    window.act(Action::Accept);
    assert!(window.open().is_none());
    assert_eq!(window.markers(), placed);
    let accepted = window.text();
    window.fit();
    assert!(window.at("forearm_l").distance(place) < 1e-4, "the elbow is at {}", window.at("forearm_l"));
    assert!(window.at("shin_r").distance(knee) < 1e-4);
    // Cancelled, the rig is as it was before that fit.
    window.act(Action::Cancel);
    window.desk.frames(4);
    assert_eq!(window.text(), accepted);
    assert!(window.open().is_none());

    // Cancelled at once, no place is left of a fit, and the rig has its first bytes.
    let mut window = Window::fitted();
    window.drag("forearm_l", Vec3::new(0.02, 0.03, 0.0));
    assert_eq!(window.markers().len(), 1);
    window.act(Action::Cancel);
    window.desk.frames(4);
    assert_eq!(window.text(), before);
    assert!(window.markers().is_empty() && window.open().is_none());
}

/// The keys of a person: the first fit is open while the second one is cancelled.
#[test]
fn a_cancelled_second_fit_leaves_the_first_one_open() {
    let mut window = Window::fitted();
    let place = window.drag("forearm_l", Vec3::new(0.02, 0.03, 0.0));
    let first = window.text();
    window.fit();
    assert!(window.at("forearm_l").distance(place) < 1e-4);
    window.act(Action::Cancel);
    window.desk.frames(4);
    assert_eq!(window.text(), first);
    assert!(window.open().is_some(), "the first fit can be corrected");
    assert_eq!(window.markers(), [window.joint("forearm_l")]);
    window.act(Action::Cancel);
    window.desk.frames(4);
    assert!(window.rig().is_empty() && window.open().is_none() && window.markers().is_empty());
}

#[test]
fn a_running_fit_shows_its_progress_and_is_cancelled() {
    for by_key in [true, false] {
        let mut window = Window::new(body());
        let (before, rig) = (window.text(), window.desk.rig);
        // Nothing lands during a drag, however fast it is computed.
        begin_drag(&mut window.desk.app, rig);
        window.desk.app.world_mut().write_message(ActionRequest(Action::Fit));
        window.desk.frames(2);
        let job = window.world().get::<FitJob>(window.mesh);
        assert!(job.is_some_and(|job| (0.0..=1.0).contains(&job.progress())));
        window.desk.frame();
        let at = window.desk.find("Cancel").rect.center();
        if !by_key {
            window.desk.press(at);
        }
        // The fit is cancelled in the first frame after the drag, before its result can land.
        window.desk.app.world_mut().write_message(EditRequest { rig, change: Change::CancelPreview });
        window.desk.app.update();
        if by_key {
            window.act(Action::Cancel);
        } else {
            window.desk.release(at);
        }
        window.settle();
        window.says("The fit was cancelled. The rig is as it was.");
        assert_eq!(window.text(), before);
        assert_eq!(window.steps(), 0);
        assert!(window.open().is_none() && window.desk.look("Cancel").is_none());
    }
}

/// Meshes that show no figure: an error with the reason or a warning, and nothing that Esc does not take back.
#[test]
fn meshes_without_a_figure_change_nothing() {
    let block = crate::gestures::boxes(&[[[0.0; 3], [1.0, 1.0, 1.0]]]);
    let mut flat = block.clone();
    flat.points.iter_mut().for_each(|point| point.z = 0.0);
    for (name, model, reason) in [("a plane", flat, Some("flat")), ("a block", block, None)] {
        let mut window = Window::new(model);
        let before = window.text();
        window.fit();
        match reason {
            Some(reason) => window.says(&format!("No skeleton was fitted: the mesh is {reason}")),
            None if window.open().is_some() => {
                window.says("but the mesh may be something else");
                window.act(Action::Cancel);
                window.desk.frames(4);
            }
            None => window.says("No skeleton was fitted: "),
        }
        assert_eq!(window.text(), before, "{name}");
        assert_eq!(window.steps(), 0, "{name}");
        assert!(window.open().is_none(), "{name}");
    }
    // Without a mesh there is nothing to fit into.
    let mut window = Window::new(crate::gestures::boxes(&[[[0.0; 3], [1.0, 1.0, 1.0]]]));
    let mesh = window.mesh;
    window.desk.app.world_mut().entity_mut(mesh).despawn();
    window.act(Action::Fit);
    window.says("There is no mesh to fit a skeleton into");
}

#[test]
fn doubtful_joints_stand_out_and_are_visited_one_by_one() {
    let mut window = Window::new(body());
    // A body whose left arm ends below the shoulder.
    let request = FitRequest {
        template: FitTemplate::Rig(character("biped")),
        region: FitRegion::Box([Vec3::new(-2.0, -1.0, -1.0), Vec3::new(0.33, 3.0, 1.0)]),
        ..FitRequest::new(window.mesh)
    };
    window.desk.app.world_mut().write_message(request);
    window.desk.frames(2);
    window.settle();
    let report = window.open().unwrap().report.clone();
    let doubts: Vec<Uid> = report.doubtful().collect();
    let hand = window.joint("hand_l");
    assert!(doubts.contains(&hand) && doubts.len() < report.joints.len(), "{} doubts", doubts.len());
    assert_eq!(window.desk.selected(), doubts, "they are selected");
    let marks = fit_marks(window.world());
    let ringed: Vec<Uid> = marks.iter().filter(|mark| mark.kind == FitMarkKind::Doubt).map(|mark| mark.joint).collect();
    assert_eq!(ringed, doubts);
    let (_, first, fit) = report.doubts().next().unwrap();
    let row = format!("{first}: {}", fit.reason);
    let counted = format!("{}: {} joints, {} doubtful joints", report.template, report.joints.len(), doubts.len());
    assert!(window.desk.look(&counted).is_some() || window.desk.says(&counted), "{counted}");
    // A click on a row selects the joint and goes there.
    window.desk.click(&row);
    window.desk.frames(4);
    assert_eq!(window.desk.selected(), [doubts[0]]);
    assert!(window.told().actions.contains(&Action::FrameSelected));
    // The key goes on to the next one, and from the last one to the first.
    for doubt in doubts.iter().skip(1).chain([&doubts[0]]) {
        window.act(Action::NextDoubt);
        assert_eq!(window.desk.selected(), [*doubt]);
    }
    // Rings stay while other joints are selected, and go with the fit.
    window.desk.select(&[window.joint("hips")]);
    assert!(fit_marks(window.world()).len() >= doubts.len());
    window.act(Action::Accept);
    assert!(fit_marks(window.world()).is_empty());
    window.act(Action::NextDoubt);
    window.says("No fit has doubtful joints.");
}
