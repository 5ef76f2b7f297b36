//! The paint tool without a window: strokes under the pointer become one step each, or are refused with the reason.

use std::sync::Arc;

use bevy::prelude::*;
use rigsmith::{
    algo::paint::{BrushMode, BrushReach},
    editor::{
        actions::{Action, ActionRequest},
        keys::KeyBindings,
        mode::Mode,
        notice::{Notice, StatusLine},
        pointer::{ModifierKeys, PointerAct, ViewportPointer},
        tools::paint::{
            PaintTool, SelectedPoints,
            brush::{BrushAction, PaintBrush},
        },
    },
    mesh::model::Weights,
    plugins::{
        display::{MeshDisplay, WeightColors},
        history::RigHistory,
        painting::PaintCanvas,
    },
    prelude::*,
    rig::{SkinData, skin::skin_data_bytes},
};

use crate::{
    bench::wait,
    viewport_app::{CONTROL, DROPPED, MESH, PLAIN, SHIFT, front, open_body, tools_app},
};

const BOTH: ModifierKeys = ModifierKeys { shift: true, ..CONTROL };

struct Bench {
    app: App,
    rig: Entity,
    mesh: Entity,
    joints: Vec<Uid>,
}

impl Bench {
    /// The bundled character with a spine and an arm, all of it held by the hips, in Paint mode.
    fn new() -> Self {
        let mut bench = Self::without_weights();
        let count = bench.app.world().get::<RigMesh>(bench.mesh).unwrap().rest.points.len();
        let mut weights = Weights { starts: vec![0], ..Weights::default() };
        (0..count).for_each(|_| weights.push([(0, 1.0)]));
        let skin = SkinData { joints: vec![bench.joints[0]], weights, at_rest: true, ..SkinData::default() };
        bench.operate(Operation::Edits(vec![RigEdit::SetSkin(MESH, Some(Arc::new(skin)))]));
        bench.mode(Mode::Paint);
        bench.wait("the canvas", |bench| bench.app.world().get::<PaintCanvas>(bench.mesh).is_some());
        bench.app.update();
        bench
    }

    fn without_weights() -> Self {
        let (mut app, rig) = tools_app();
        let mesh = open_body(&mut app, rig);
        let mut bench = Self { app, rig, mesh, joints: Vec::new() };
        let chain = |places: [[f32; 3]; 3], parent| Operation::Chain {
            positions: places.into_iter().map(Vec3::from).collect(),
            parent,
        };
        bench.operate(chain([[0.0, 0.95, 0.0], [0.0, 1.15, 0.0], [0.0, 1.4, 0.0]], None));
        let neck = bench.selected()[0];
        bench.operate(chain([[0.17, 1.4, 0.0], [0.37, 1.2, 0.0], [0.53, 1.02, 0.0]], Some(neck)));
        bench.joints = bench.rig().walk().map(|joint| joint.data.uid).collect();
        bench
    }

    fn wait(&mut self, what: &str, done: impl Fn(&Self) -> bool) {
        wait(self, what, |bench| bench.app.update(), done);
    }

    fn operate(&mut self, operation: Operation) {
        self.change(Change::Do(operation));
    }

    fn change(&mut self, change: Change) {
        self.app.world_mut().write_message(EditRequest { rig: self.rig, change });
        self.app.update();
    }

    fn mode(&mut self, mode: Mode) {
        self.app.insert_resource(mode);
        self.app.update();
    }

    fn act(&mut self, action: Action) {
        self.app.world_mut().write_message(ActionRequest(action));
        self.app.update();
    }

    fn select(&mut self, joint: Uid) {
        self.app.world_mut().get_mut::<Selection>(self.rig).unwrap().0 = vec![joint];
        self.app.update();
    }

    fn brush(&mut self, change: impl FnOnce(&mut PaintBrush)) {
        change(&mut self.app.world_mut().resource_mut::<PaintBrush>());
        self.app.update();
    }

    /// One frame in which the pointer does all this.
    fn point(&mut self, held: ModifierKeys, acts: &[(Vec2, PointerAct)]) {
        for (at, act) in acts {
            self.app.world_mut().write_message(ViewportPointer { at: *at, act: *act, held });
        }
        self.app.update();
    }

    fn drag(&mut self, held: ModifierKeys, from: Vec2, to: Vec2) {
        self.point(held, &[(from, PointerAct::Moved), (from, PointerAct::Pressed)]);
        for step in 1..=5 {
            self.point(held, &[(from.lerp(to, step as f32 / 5.0), PointerAct::Dragged)]);
        }
    }

    fn stroke(&mut self, held: ModifierKeys, from: Vec2, to: Vec2) {
        self.drag(held, from, to);
        self.point(held, &[(to, DROPPED)]);
    }

    fn rig(&self) -> &Rig {
        self.app.world().get::<Rig>(self.rig).unwrap()
    }

    fn bytes(&self) -> Vec<u8> {
        skin_data_bytes(self.rig().skin(MESH).unwrap()).unwrap()
    }

    fn selected(&self) -> Vec<Uid> {
        self.app.world().get::<Selection>(self.rig).unwrap().0.clone()
    }

    fn steps(&self) -> usize {
        self.app.world().get::<RigHistory>(self.rig).unwrap().steps().1
    }

    fn status(&self) -> &StatusLine {
        self.app.world().resource()
    }

    fn tool(&self) -> &PaintTool {
        self.app.world().resource()
    }

    fn notices(&mut self) -> Vec<Notice> {
        self.app.world_mut().resource_mut::<Messages<Notice>>().drain().collect()
    }

    /// Places of the points that a joint moves, with its weights.
    fn moved_by(&self, joint: Uid) -> Vec<(Vec3, f32)> {
        let skin = self.rig().skin(MESH).unwrap();
        let points = &self.app.world().get::<RigMesh>(self.mesh).unwrap().rest.points;
        let Some(number) = skin.joints.iter().position(|other| *other == joint) else { return Vec::new() };
        let of = |point: usize| skin.weights.of(point).find(|(other, _)| *other as usize == number);
        (0..skin.weights.len()).filter_map(|point| Some((points[point], of(point)?.1))).collect()
    }
}

/// Pixels over the upper and the lower arm.
fn arm() -> [Vec2; 2] {
    [Vec3::new(0.27, 1.3, 0.0), Vec3::new(0.42, 1.14, 0.0)].map(|place| front().project(place).unwrap())
}

fn total(moved: &[(Vec3, f32)]) -> f32 {
    moved.iter().map(|(_, weight)| weight).sum()
}

#[test]
fn a_stroke_is_one_step_and_its_undo_gives_the_first_bytes() {
    let mut bench = Bench::new();
    let elbow = bench.joints[4];
    bench.select(elbow);
    let (steps, bytes, rig) = (bench.steps(), bench.bytes(), bench.rig().clone());
    let [from, to] = arm();
    bench.drag(PLAIN, from, to);
    assert!(bench.tool().is_painting());
    assert!(!bench.moved_by(elbow).is_empty(), "the mesh shows the stroke while it lasts");
    assert_eq!(bench.steps(), steps, "and the history does not");
    bench.point(PLAIN, &[(to, DROPPED)]);
    assert!(!bench.tool().is_painting());
    assert_eq!(bench.steps(), steps + 1);
    let (names, _) = bench.app.world().get::<RigHistory>(bench.rig).unwrap().steps();
    assert_eq!(names.last(), Some(&"Paint weights"));
    let moved = bench.moved_by(elbow);
    assert!(moved.len() > 20, "{} points", moved.len());
    let strength = bench.app.world().resource::<PaintBrush>().strength;
    for (place, weight) in &moved {
        assert!(place.x > 0.1 && place.y > 0.9, "{place} is not on the arm");
        assert!(*weight <= strength + 1e-6, "{weight}: a stroke goes over a point once");
    }
    let skin = bench.rig().skin(MESH).unwrap().clone();
    for point in 0..skin.weights.len() {
        let sum: f32 = skin.weights.of(point).map(|(_, weight)| weight).sum();
        assert!((sum - 1.0).abs() < 1e-5, "{sum}");
    }
    bench.change(Change::Undo);
    assert_eq!((bench.rig(), bench.bytes()), (&rig, bytes), "bytes of the weights, and the list of joints");
    bench.change(Change::Redo);
    assert_eq!(bench.rig().skin(MESH), Some(&skin));
    // A click is a stroke, too.
    bench.point(PLAIN, &[(to, PointerAct::Pressed), (to, PointerAct::Released { dragged: false, count: 1 })]);
    assert_eq!(bench.steps(), steps + 2);
    assert_eq!(bench.selected(), [elbow], "painting selects nothing");
}

#[test]
fn escape_and_undo_drop_a_stroke_that_lasts() {
    let mut bench = Bench::new();
    bench.select(bench.joints[4]);
    let [from, to] = arm();
    bench.stroke(PLAIN, from, to);
    let (steps, rig) = (bench.steps(), bench.rig().clone());
    for action in [Action::Cancel, Action::Undo] {
        bench.drag(PLAIN, to, from);
        assert_ne!(bench.rig(), &rig, "{action:?}");
        bench.act(action);
        assert_eq!((bench.rig(), bench.steps(), bench.tool().is_painting()), (&rig, steps, false), "{action:?}");
        bench.point(PLAIN, &[(from, DROPPED)]);
        assert_eq!((bench.rig(), bench.steps()), (&rig, steps), "{action:?}");
    }
}

#[test]
fn control_turns_the_brush_round_and_shift_smooths() {
    let mut bench = Bench::new();
    let elbow = bench.joints[4];
    bench.select(elbow);
    let [from, to] = arm();
    let both = |bench: &mut Bench, held| {
        let before = bench.moved_by(elbow);
        bench.stroke(held, from, to);
        (before, bench.moved_by(elbow))
    };
    bench.brush(|brush| brush.softness = 0.0);
    let (_, added) = both(&mut bench, PLAIN);
    let least = |moved: &[(Vec3, f32)]| moved.iter().map(|(_, weight)| *weight).fold(f32::INFINITY, f32::min);
    let (before, smooth) = both(&mut bench, SHIFT);
    assert_eq!(before, added);
    assert!(least(&smooth) < 0.95 * least(&added), "{} {}", least(&smooth), least(&added));
    assert!(bench.status().hint.contains("Add"), "{:?}", bench.status());
    let (before, less) = both(&mut bench, CONTROL);
    assert!(total(&less) < 0.5 * total(&before), "{} {}", total(&less), total(&before));
    let (names, _) = bench.app.world().get::<RigHistory>(bench.rig).unwrap().steps();
    assert_eq!(names[names.len() - 3..], ["Paint weights", "Smooth weights", "Paint weights"]);
}

#[test]
fn symmetry_paints_both_sides_with_the_pair() {
    let mut bench = Bench::new();
    bench.operate(Operation::Mirror { joints: vec![bench.joints[3]] });
    bench.act(Action::Symmetry);
    let elbow = bench.joints[4];
    let other = bench.rig().joint(elbow).unwrap().data.mirror.unwrap();
    bench.select(elbow);
    let [from, to] = arm();
    let steps = bench.steps();
    bench.stroke(PLAIN, from, to);
    assert_eq!(bench.steps(), steps + 1, "both sides are one step");
    let (own, others) = (bench.moved_by(elbow), bench.moved_by(other));
    assert!(own.len() > 20);
    assert_eq!(own.len(), others.len());
    for (place, weight) in &own {
        let image = others.iter().find(|(other, _)| *other == Vec3::new(-place.x, place.y, place.z));
        let image = image.unwrap_or_else(|| panic!("{place} has no image")).1;
        assert!((weight - image).abs() < 1e-5, "{weight} {image}");
    }
}

#[test]
fn strokes_are_refused_with_the_reason() {
    let mut bench = Bench::new();
    let [from, to] = arm();
    let told = |bench: &mut Bench, from: Vec2, words: &str| {
        let (rig, steps) = (bench.rig().clone(), bench.steps());
        bench.notices();
        let mut notices = Vec::new();
        // Messages are kept for two frames.
        for act in [(from, PointerAct::Pressed), (from.lerp(to, 0.5), PointerAct::Dragged), (to, DROPPED)] {
            bench.point(PLAIN, &[act]);
            notices.extend(bench.notices());
        }
        assert!(notices.iter().any(|notice| notice.text.contains(words)), "{words}: {notices:?}");
        assert_eq!((bench.rig(), bench.steps()), (&rig, steps), "{words}");
    };
    bench.act(Action::SelectNone);
    told(&mut bench, from, "no joint is selected");
    bench.point(PLAIN, &[(from, PointerAct::Moved)]);
    assert!(bench.status().obstacle.as_ref().is_some_and(|why| why.contains("no joint is selected")));
    let elbow = bench.joints[4];
    bench.select(elbow);
    told(&mut bench, Vec2::splat(5.0), "beside the mesh");
    for (radius, strength, words) in [
        (0.0, 0.5, "radius"),
        (-1.0, 0.5, "radius"),
        (f32::NAN, 0.5, "radius"),
        (0.1, 1.5, "strength"),
        (0.1, f32::NAN, "strength"),
    ] {
        bench.brush(|brush| (brush.radius, brush.strength) = (Some(radius), strength));
        told(&mut bench, from, words);
    }
    bench.brush(|brush| *brush = PaintBrush::default());
    bench.operate(Operation::Lock(vec![elbow], true));
    told(&mut bench, from, "locked");
    bench.operate(Operation::Lock(vec![elbow], false));
    bench.operate(Operation::Edits(vec![RigEdit::SetKind(elbow, rigsmith::rig::NodeKind::Null)]));
    told(&mut bench, from, "only joints move points");
    // The hips hold everything: nobody could take what they would lose.
    bench.select(bench.joints[0]);
    bench.brush(|brush| brush.mode = BrushMode::Subtract);
    told(&mut bench, from, "no other free joint");

    let mut bench = Bench::without_weights();
    bench.mode(Mode::Paint);
    bench.wait("the canvas", |bench| bench.app.world().get::<PaintCanvas>(bench.mesh).is_some());
    bench.select(bench.joints[4]);
    told(&mut bench, from, "no weights yet");
}

#[test]
fn the_ring_has_the_radius_of_the_brush_on_the_surface() {
    let mut bench = Bench::new();
    bench.select(bench.joints[0]);
    let radius = 0.06;
    bench.brush(|brush| (brush.radius, brush.softness) = (Some(radius), 0.5));
    let chest = front().project(Vec3::new(0.0, 1.25, 0.1)).unwrap();
    bench.point(PLAIN, &[(chest, PointerAct::Moved)]);
    let cursor = bench.tool().cursor.clone().unwrap();
    let surface = bench.app.world().get::<RigSurface>(bench.rig).unwrap().ready().unwrap();
    for (ring, size) in [(&cursor.outer, radius), (&cursor.inner, 0.5 * radius)] {
        assert!(ring.len() > 20);
        for place in ring {
            let far = place.distance(cursor.middle);
            assert!((0.6 * size..1.4 * size).contains(&far), "{far} for {size}");
            assert!(surface.closest_point(*place).unwrap().distance < 1e-4, "{place} is off the surface");
        }
    }
    bench.point(PLAIN, &[(Vec2::splat(3.0), PointerAct::Moved)]);
    assert_eq!(bench.tool().cursor, None, "beside the mesh");
    bench.point(PLAIN, &[(chest, PointerAct::Moved)]);
    bench.mode(Mode::Select);
    assert_eq!(bench.tool().cursor, None);
}

#[test]
fn keys_change_the_brush_within_its_limits() {
    let mut bench = Bench::new();
    let brush = |bench: &Bench| *bench.app.world().resource::<PaintBrush>();
    let size = 1.75;
    let radius = |bench: &Bench| brush(bench).of_size(size).radius;
    let before = radius(&bench);
    bench.act(Action::Brush(BrushAction::Larger));
    assert!(radius(&bench) > 1.1 * before);
    bench.act(Action::Brush(BrushAction::Smaller));
    assert!((radius(&bench) - before).abs() < 1e-2 * before);
    for _ in 0..200 {
        bench.act(Action::Brush(BrushAction::Smaller));
        bench.act(Action::Brush(BrushAction::Weaker));
    }
    assert_eq!(brush(&bench).of_size(size).check(), Ok(()));
    assert_eq!(brush(&bench).strength, 0.0);
    for _ in 0..200 {
        bench.act(Action::Brush(BrushAction::Larger));
        bench.act(Action::Brush(BrushAction::Stronger));
    }
    assert_eq!((brush(&bench).of_size(size).check(), brush(&bench).strength), (Ok(()), 1.0));
    for mode in BrushMode::ALL {
        bench.act(Action::Brush(BrushAction::of_mode(mode)));
        assert_eq!(brush(&bench).mode, mode);
    }
    bench.act(Action::Brush(BrushAction::Reach));
    assert_eq!(brush(&bench).reach, BrushReach::Volume);
    let keys = KeyBindings::default();
    assert!(keys.doubles().is_empty(), "{:?}", keys.doubles());
    for action in [BrushAction::Smaller, BrushAction::Larger, BrushAction::Weaker, BrushAction::Stronger] {
        assert!(keys.key(Action::Brush(action)).is_some(), "{action:?}");
    }
    assert!(keys.key(Action::Mode(Mode::Paint)).is_some());
}

#[test]
fn colours_follow_the_joint_and_return() {
    let mut bench = Bench::new();
    let weights = |bench: &Bench| bench.app.world().resource::<MeshDisplay>().weights;
    bench.select(bench.joints[4]);
    assert_eq!(weights(&bench), WeightColors::Joint(bench.joints[4]));
    bench.act(Action::Brush(BrushAction::Colors));
    bench.app.update();
    assert_eq!(weights(&bench), WeightColors::AllJoints);
    bench.mode(Mode::Weights);
    assert_eq!(weights(&bench), WeightColors::AllJoints, "weights are shown in both modes");
    bench.mode(Mode::Select);
    bench.app.update();
    assert_eq!(weights(&bench), WeightColors::Off, "as it was");
    assert!(bench.app.world().get::<PaintCanvas>(bench.mesh).is_none(), "nothing is kept for brushes");
}

#[test]
fn points_are_selected_with_control_and_shift() {
    let mut bench = Bench::new();
    let [from, to] = arm();
    let selected = |bench: &Bench| bench.app.world().resource::<SelectedPoints>().clone();
    let rig = bench.rig().clone();
    let click = [(from, PointerAct::Pressed), (from, PointerAct::Released { dragged: false, count: 1 })];
    bench.point(BOTH, &click);
    assert_eq!((selected(&bench).mesh, selected(&bench).points.len()), (Some(MESH), 1));
    bench.point(BOTH, &click);
    assert_eq!(selected(&bench).points.len(), 0, "a second click takes it out");
    bench.stroke(BOTH, from, to);
    assert!(selected(&bench).points.len() > 20);
    assert_eq!(bench.rig(), &rig, "selecting paints nothing");
    bench.act(Action::Brush(BrushAction::NoPoints));
    assert!(selected(&bench).points.is_empty());
    bench.point(PLAIN, &[(from, PointerAct::Moved)]);
    assert_eq!(bench.tool().under.map(|(mesh, _)| mesh), Some(MESH));
}

#[test]
fn the_idle_tool_changes_nothing() {
    let mut bench = Bench::new();
    bench.select(bench.joints[4]);
    bench.point(PLAIN, &[(arm()[0], PointerAct::Moved)]);
    (0..3).for_each(|_| bench.app.update());
    let ticks = |bench: &Bench| {
        let world = bench.app.world();
        [
            world.get_resource_change_ticks::<PaintTool>(),
            world.get_resource_change_ticks::<PaintBrush>(),
            world.get_resource_change_ticks::<SelectedPoints>(),
            world.get_resource_change_ticks::<StatusLine>(),
            world.get_resource_change_ticks::<MeshDisplay>(),
        ]
        .map(|ticks| ticks.map(|ticks| ticks.changed))
    };
    let before = ticks(&bench);
    (0..5).for_each(|_| bench.app.update());
    assert_eq!(ticks(&bench), before);
}
