//! Gestures that jobs take: a press to its release, a key, or a turn of the wheel. Each test does its job with keys as they are
//! bound, with the pointer in the viewport and on widgets, and fails where a job takes more gestures than is written down in
//! `docs/gestures.md`.

use std::{collections::BTreeMap, path::Path};

use bevy::prelude::*;
use bevy_egui::egui;
use rigsmith::{
    editor::{
        ActiveRig,
        actions::{Action, ActionRequest},
        building::BuildingPlugin,
        camera::ViewportSight,
        fitting::FittingPlugin,
        keys::{Chord, KeyBindings},
        mode::Mode,
        panel::{EditorPanel, Requests},
        panels::{PanelsPlugin, hierarchy::HierarchyPanel, tags::TagsPanel},
        pointer::{ModifierKeys, PointerAct, ViewportPointer},
        tools::{
            ToolsPlugin,
            stroke::{StrokeState, StrokeTool},
        },
    },
    files::{RealDisk, bundled_characters, load_model},
    headless::headless_app,
    plugins::{
        commands::BuildResult,
        document::{Change, EditRequest},
        fit::FitJob,
        skinning::SkinningJob,
        surface::RigMesh,
        viewport::{RigViewport, Sight},
    },
    prelude::*,
    rig::{Matching, template::write_template},
    test_app::strict_app,
};

use super::panels::desk::{Desk, Sheet};

const MESH: Uid = Uid(99);
const PLAIN: ModifierKeys = ModifierKeys { shift: false, control: false, alt: false };

/// Names of joints and tags beside each other, as in the window.
#[derive(Default)]
struct SidePanels {
    hierarchy: HierarchyPanel,
    tags: TagsPanel,
}

impl EditorPanel for SidePanels {
    fn title(&self) -> &'static str {
        "Side panels"
    }

    fn show(&mut self, ui: &mut egui::Ui, world: &World, requests: &mut Requests) {
        ui.columns(2, |sides| {
            self.hierarchy.show(&mut sides[0], world, requests);
            self.tags.show(&mut sides[1], world, requests);
        });
    }
}

/// A person at a window without a display.
struct Session {
    desk: Desk,
    sight: Sight,
    gestures: Vec<String>,
}

fn sight(height: f32, distance: f32) -> Sight {
    let middle = Vec3::Y * height;
    let camera = Transform::from_translation(middle + Vec3::Z * distance).looking_at(middle, Vec3::Y);
    let projection = Projection::Perspective(PerspectiveProjection { fov: 0.55, ..default() });
    let viewport = RigViewport { focus: distance };
    Sight::new(&camera.into(), &projection, &viewport, Vec2::splat(800.0), &GlobalTransform::IDENTITY).unwrap()
}

fn asset(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models").join(name)
}

/// Places of the joints of a bundled skeleton.
fn skeleton(name: &str) -> impl Fn(&str) -> Vec3 {
    let text = std::fs::read_to_string(asset(name)).unwrap();
    let place = |line: &str| -> Option<(String, Vec3)> {
        let words: Vec<&str> = line.split_whitespace().collect();
        let number = |place: usize| words.get(place)?.parse::<f32>().ok();
        Some(((*words.get(6)?).to_owned(), Vec3::new(number(3)?, number(4)?, number(5)?)))
    };
    let places: BTreeMap<String, Vec3> =
        text.lines().filter(|line| line.starts_with("joint ")).filter_map(place).collect();
    move |label: &str| *places.get(label).unwrap_or_else(|| panic!("no {label}"))
}

impl Session {
    fn new(rig: Rig, mesh: Option<&str>, sight: Sight) -> Self {
        let mut app = headless_app(1);
        app.add_plugins((ToolsPlugin, FittingPlugin, PanelsPlugin, BuildingPlugin));
        let mut app = strict_app(app);
        let rig = app.world_mut().spawn(rig).id();
        app.insert_resource(ActiveRig(rig)).insert_resource(ViewportSight(Some(sight)));
        if let Some(mesh) = mesh {
            let model = load_model(&RealDisk, &asset(mesh)).unwrap();
            app.world_mut().spawn((RigMesh::new(MESH, model, Vec::new()), SkinOf(rig)));
        }
        let sheet = Sheet::Panel(Box::new(SidePanels::default()));
        let desk = Desk::of(app, rig, sheet, egui::vec2(720.0, 1000.0));
        let mut session = Self { desk, sight, gestures: Vec::new() };
        session.settle();
        session
    }

    fn world(&self) -> &World {
        self.desk.app.world()
    }

    /// Runs frames until nothing is computed any more.
    fn settle(&mut self) {
        self.desk.frames(4);
        self.desk.until("rest", |desk| {
            let world = desk.app.world();
            let surface = world.get::<RigSurface>(desk.rig);
            let is_ready = surface.is_none_or(|surface| surface.ready().is_some() && !surface.is_stale());
            let meshes = world.get::<rigsmith::plugins::surface::RigMeshes>(desk.rig);
            let is_busy = meshes.is_some_and(|meshes| {
                meshes
                    .iter()
                    .any(|mesh| world.get::<SkinningJob>(mesh).is_some() || world.get::<FitJob>(mesh).is_some())
            });
            is_ready && !is_busy && !world.resource::<StrokeTool>().is_busy()
        });
        self.desk.frames(4);
    }

    fn key(&mut self, key: &str) {
        self.gestures.push(key.to_owned());
        let chord = Chord::try_from(key.to_owned()).unwrap();
        let action = KeyBindings::default().action(&chord).unwrap_or_else(|| panic!("{key} is not bound"));
        match action {
            Action::Mode(mode) => {
                self.desk.app.insert_resource(mode);
            }
            action => {
                self.desk.app.world_mut().write_message(ActionRequest(action));
            }
        }
        self.settle();
    }

    fn point(&mut self, at: Vec2, act: PointerAct) {
        self.desk.app.world_mut().write_message(ViewportPointer { at, act, held: PLAIN });
        self.desk.frame();
    }

    /// Drags along places in the model, in small steps as a hand does.
    fn drag(&mut self, line: &[Vec3]) {
        self.gestures.push("drag".to_owned());
        let line: Vec<Vec2> = line.iter().map(|place| self.sight.project(*place).unwrap()).collect();
        self.point(line[0], PointerAct::Moved);
        self.point(line[0], PointerAct::Pressed);
        for ends in line.windows(2) {
            for step in 1..=12 {
                self.point(ends[0].lerp(ends[1], step as f32 / 12.0), PointerAct::Dragged);
            }
        }
        // The chain before this line is in the rig by now.
        self.desk.frames(4);
        self.point(line[line.len() - 1], PointerAct::Released { dragged: true, count: 1 });
        self.settle();
    }

    fn preview(&self) -> Option<&rigsmith::algo::stroke::StrokeChain> {
        match &self.world().resource::<StrokeTool>().state {
            StrokeState::Preview(preview) => preview.chain(),
            _ => None,
        }
    }

    /// Gives the previewed chain a number of joints: a turn of the wheel where it has another one.
    fn joints(&mut self, count: usize) {
        let now = self.preview().expect("a stroke is shown").joints.len();
        if now != count {
            self.gestures.push("wheel".to_owned());
            let notches = count as f32 - now as f32;
            self.point(Vec2::splat(400.0), PointerAct::Wheel(notches));
            self.settle();
        }
        assert_eq!(self.preview().expect("a stroke is shown").joints.len(), count);
    }

    /// Clicks a widget.
    #[track_caller]
    fn click(&mut self, name: &str) {
        self.gestures.push(format!("click {name}"));
        self.desk.click(name);
        self.settle();
    }

    /// A gesture that only brings a panel forward, which is always shown here.
    fn tab(&mut self, name: &str) {
        self.gestures.push(format!("click {name}"));
    }

    /// Puts a part onto what is selected or was drawn last.
    fn part(&mut self, name: &str) {
        let steps = self.desk.steps().1;
        self.click("Part");
        let tile = format!("Part {name}");
        self.desk.until("the list of parts", |desk| desk.look(&tile).is_some());
        let waiting = steps + usize::from(self.desk.steps().1 > steps);
        self.click(&tile);
        self.desk.until("the part", |desk| desk.steps().1 > waiting);
        self.settle();
    }

    #[track_caller]
    fn took(&self, job: &str, most: usize) {
        println!("{job}: {} gestures: {}", self.gestures.len(), self.gestures.join(", "));
        assert!(self.gestures.len() <= most, "{job} takes {} gestures: {:?}", self.gestures.len(), self.gestures);
    }
}

#[test]
fn a_body_is_fitted_skinned_and_posed() {
    let mut session = Session::new(Rig::new(Uid(1), "rig"), Some("biped.obj"), sight(0.9, 4.0));
    session.key("F");
    let rig = session.desk.rig();
    assert!(rig.len() > 40, "{:?}", session.desk.told());
    session.key("Enter");
    session.key("B");
    assert_eq!(session.desk.rig().skins().count(), 1, "{:?}", session.desk.told());
    session.key("P");
    let hand = session.desk.rig().position(session.desk.rig().find_label("hand_l").unwrap());
    session.drag(&[hand, hand + Vec3::new(-0.1, 0.2, 0.0)]);
    assert!(!session.desk.rig().pose().is_empty(), "{:?}", session.desk.told());
    assert_eq!(session.desk.selected().len(), 1, "what was pulled is selected");
    session.took("a body fitted, skinned and posed", 5);
}

/// One gesture moves a joint that is not selected, and a click still only selects.
#[test]
fn a_joint_is_corrected_by_one_drag() {
    let rig = bundled_characters().into_iter().find(|rig| rig.about().name == "biped").unwrap();
    let mut session = Session::new((*rig).clone(), None, sight(0.9, 4.0));
    session.key("W");
    let elbow = session.desk.rig().find_label("forearm_l").unwrap();
    let place = session.desk.rig().position(elbow);
    let steps = session.desk.steps().0;
    session.drag(&[place, place + Vec3::new(0.04, 0.03, 0.0)]);
    let moved = session.desk.rig().position(elbow) - place;
    assert!(moved.distance(Vec3::new(0.04, 0.03, 0.0)) < 5e-3, "{moved}");
    assert_eq!((session.desk.selected(), session.desk.steps().0), ([elbow].as_slice(), steps + 1));
    session.took("a joint corrected", 2);

    let knee = session.desk.rig().find_label("shin_l").unwrap();
    let at = session.sight.project(session.desk.rig().position(knee)).unwrap();
    session.point(at, PointerAct::Pressed);
    session.point(at, PointerAct::Released { dragged: false, count: 1 });
    session.settle();
    assert_eq!((session.desk.selected(), session.desk.steps().0), ([knee].as_slice(), steps + 1));
    // Escape gives the joint back its place.
    let before = write_template(session.desk.rig());
    session.point(at, PointerAct::Pressed);
    session.point(at + Vec2::splat(30.0), PointerAct::Dragged);
    assert_ne!(write_template(session.desk.rig()), before);
    session.key("Escape");
    session.point(at + Vec2::splat(30.0), PointerAct::Released { dragged: true, count: 1 });
    session.settle();
    assert_eq!(write_template(session.desk.rig()), before);
}

#[test]
fn a_hand_is_drawn_and_skinned() {
    let at = skeleton("hand.rig");
    let tip = |finger: &str| {
        let [last, before] = [3, 2].map(|number| at(&format!("{finger}_0{number}_l")));
        last + 0.25 * (last - before)
    };
    let wrist = at("hand_l");
    let mut session = Session::new(Rig::new(Uid(1), "hand"), Some("hand.obj"), sight(0.15, 0.7));
    session.key("S");
    session.drag(&[wrist, at("index_01_l"), at("index_02_l"), tip("index")]);
    session.joints(5);
    // Fingers start where the hand shows that the wrist will be.
    let wrist = session.preview().unwrap().joints[0].position;
    for finger in ["middle", "ring", "pinky"] {
        let [first, second] = [1, 2].map(|number| at(&format!("{finger}_0{number}_l")));
        session.drag(&[wrist, first, second, tip(finger)]);
    }
    session.drag(&[wrist, at("thumb_01_l"), at("thumb_02_l"), tip("thumb")]);
    session.key("B");
    let rig = session.desk.rig();
    assert_eq!((rig.len(), rig.skins().count()), (21, 1), "{:?}", session.desk.told());
    let root = rig.roots()[0];
    assert_eq!((rig.roots().len(), rig.children(Some(root)).len()), (1, 5), "five fingers hang on the wrist");
    session.took("a hand of 21 joints drawn and skinned", 8);
}

#[test]
fn a_biped_with_inverse_kinematics_is_made_of_parts() {
    let at = skeleton("biped.rig");
    let mut session = Session::new(Rig::new(Uid(1), "biped"), Some("biped.obj"), sight(0.9, 4.0));
    session.key("M");
    session.key("S");
    session.drag(&[at("hips"), at("chest"), at("neck")]);
    if session.preview().unwrap().joints.len() < 3 {
        session.joints(3);
    }
    session.key("Enter");
    session.tab("Tags");
    session.part("spine");
    // What begins next to the plane of symmetry begins on it.
    let clavicle = at("clavicle_l").lerp(at("upper_arm_l"), 0.35);
    session.drag(&[clavicle, at("upper_arm_l"), at("forearm_l"), at("hand_l")]);
    session.joints(4);
    session.part("arm");
    session.drag(&[at("thigh_l"), at("shin_l"), at("foot_l"), at("toe_l")]);
    session.joints(4);
    session.part("leg");
    let built = session.world().get::<BuildResult>(session.desk.rig).expect("it is built");
    let limbs = built.0.switches.iter().filter(|switch| matches!(switch.matching, Matching::IkFk { .. })).count();
    assert!(limbs >= 4, "{limbs} limbs have inverse kinematics: {:?}", session.desk.told());
    let parts: Vec<String> = session.desk.rig().dropped_parts().iter().map(|part| part.part.clone()).collect();
    let names = ["spine", "arm", "arm", "leg", "leg"].map(|name| format!("parts/{name}.rig.ron"));
    assert_eq!(parts, names, "with symmetry both sides get the part");
    // Both sides of a part are one step.
    let before = session.desk.rig().dropped_parts().len();
    let rig = session.desk.rig;
    session.desk.app.world_mut().write_message(EditRequest { rig, change: Change::Undo });
    session.settle();
    assert_eq!(session.desk.rig().dropped_parts().len(), before - 2);
    session.took("a biped with inverse kinematics from parts", 16);
}

#[test]
fn one_parameter_of_a_module_is_changed() {
    let rig = bundled_characters().into_iter().find(|rig| rig.about().name == "biped").unwrap();
    let mut session = Session::new((*rig).clone(), None, sight(0.9, 4.0));
    session.desk.app.insert_resource(Mode::Select);
    session.settle();
    let (before, steps) = (write_template(session.desk.rig()), session.desk.steps().0);
    session.click("head");
    session.tab("Tags");
    session.click("Values of control");
    session.gestures.push("drag Relative size".to_owned());
    let field = session.desk.find("Relative size").rect.center();
    session.desk.drag(field, field + egui::vec2(40.0, 0.0));
    session.settle();
    assert_eq!(session.desk.steps().0, steps + 1, "{:?}", session.desk.told());
    assert_ne!(write_template(session.desk.rig()), before);
    session.took("a parameter of a module changed", 4);
}
