//! The paint tool without a window: strokes under the pointer become one step each, or are refused with the reason.

use std::sync::Arc;

use bevy::prelude::*;
use rigsmith::{
    algo::paint::{BrushMode, BrushReach},
    editor::{
        actions::Action,
        keys::KeyBindings,
        mode::Mode,
        notice::StatusLine,
        pointer::{ModifierKeys, PointerAct},
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
    bench::RigBench,
    viewport_app::{CONTROL, DROPPED, MESH, PLAIN, SHIFT, front},
};

const BOTH: ModifierKeys = ModifierKeys { shift: true, ..CONTROL };

struct Bench {
    base: RigBench,
    mesh: Entity,
    joints: Vec<Uid>,
}

impl Bench {
    /// The bundled character with a spine and an arm, all of it held by the hips, in Paint mode.
    fn new() -> Self {
        let mut bench = Self::without_weights();
        let count = bench.base.get::<RigMesh>(bench.mesh).unwrap().rest.points.len();
        let mut weights = Weights { starts: vec![0], ..Weights::default() };
        (0..count).for_each(|_| weights.push([(0, 1.0)]));
        let skin = SkinData { joints: vec![bench.joints[0]], weights, at_rest: true, ..SkinData::default() };
        bench.base.edit(Operation::Edits(vec![RigEdit::SetSkin(MESH, Some(Arc::new(skin)))]));
        bench.base.mode(Mode::Paint);
        bench.wait_for_canvas();
        bench.base.app.update();
        bench
    }

    fn wait_for_canvas(&mut self) {
        let mesh = self.mesh;
        self.base.wait("the canvas", |bench| bench.get::<PaintCanvas>(mesh).is_some());
    }

    fn without_weights() -> Self {
        let mut base = RigBench::with_tools();
        let mesh = base.open_body();
        let mut bench = Self { base, mesh, joints: Vec::new() };
        let chain = |places: [[f32; 3]; 3], parent| Operation::Chain {
            positions: places.into_iter().map(Vec3::from).collect(),
            parent,
        };
        bench.base.edit(chain([[0.0, 0.95, 0.0], [0.0, 1.15, 0.0], [0.0, 1.4, 0.0]], None));
        let neck = bench.base.selected()[0];
        bench.base.edit(chain([[0.17, 1.4, 0.0], [0.37, 1.2, 0.0], [0.53, 1.02, 0.0]], Some(neck)));
        bench.joints = bench.base.rig().walk().map(|joint| joint.data.uid).collect();
        bench
    }

    fn brush(&mut self, change: impl FnOnce(&mut PaintBrush)) {
        change(&mut self.base.app.world_mut().resource_mut::<PaintBrush>());
        self.base.app.update();
    }

    fn drag(&mut self, held: ModifierKeys, from: Vec2, to: Vec2) {
        self.base.point(held, &[(from, PointerAct::Moved), (from, PointerAct::Pressed)]);
        for step in 1..=5 {
            self.base.point(held, &[(from.lerp(to, step as f32 / 5.0), PointerAct::Dragged)]);
        }
    }

    fn stroke(&mut self, held: ModifierKeys, from: Vec2, to: Vec2) {
        self.drag(held, from, to);
        self.base.point(held, &[(to, DROPPED)]);
    }

    fn bytes(&self) -> Vec<u8> {
        skin_data_bytes(self.base.rig().skin(MESH).unwrap()).unwrap()
    }

    fn tool(&self) -> &PaintTool {
        self.base.app.world().resource()
    }

    /// Places of the points that a joint moves, with its weights.
    fn moved_by(&self, joint: Uid) -> Vec<(Vec3, f32)> {
        let skin = self.base.rig().skin(MESH).unwrap();
        let points = &self.base.get::<RigMesh>(self.mesh).unwrap().rest.points;
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
    bench.base.select(&[elbow]);
    let (steps, bytes, rig) = (bench.base.steps(), bench.bytes(), bench.base.rig().clone());
    let [from, to] = arm();
    bench.drag(PLAIN, from, to);
    assert!(bench.tool().is_painting());
    assert!(!bench.moved_by(elbow).is_empty(), "the mesh shows the stroke while it lasts");
    assert_eq!(bench.base.steps(), steps, "and the history does not");
    bench.base.point(PLAIN, &[(to, DROPPED)]);
    assert!(!bench.tool().is_painting());
    assert_eq!(bench.base.steps(), steps + 1);
    let (names, _) = bench.base.get::<RigHistory>(bench.base.rig).unwrap().steps();
    assert_eq!(names.last(), Some(&"Paint weights"));
    let moved = bench.moved_by(elbow);
    assert!(moved.len() > 20, "{} points", moved.len());
    let strength = bench.base.app.world().resource::<PaintBrush>().strength;
    for (place, weight) in &moved {
        assert!(place.x > 0.1 && place.y > 0.9, "{place} is not on the arm");
        assert!(*weight <= strength + 1e-6, "{weight}: a stroke goes over a point once");
    }
    let skin = bench.base.rig().skin(MESH).unwrap().clone();
    for point in 0..skin.weights.len() {
        let sum: f32 = skin.weights.of(point).map(|(_, weight)| weight).sum();
        assert!((sum - 1.0).abs() < 1e-5, "{sum}");
    }
    bench.base.change(Change::Undo);
    assert_eq!((bench.base.rig(), bench.bytes()), (&rig, bytes), "bytes of the weights, and the list of joints");
    bench.base.change(Change::Redo);
    assert_eq!(bench.base.rig().skin(MESH), Some(&skin));
    // A click is a stroke, too.
    bench.base.point(PLAIN, &[(to, PointerAct::Pressed), (to, PointerAct::Released { dragged: false, count: 1 })]);
    assert_eq!(bench.base.steps(), steps + 2);
    assert_eq!(bench.base.selected(), [elbow], "painting selects nothing");
}

#[test]
fn escape_and_undo_drop_a_stroke_that_lasts() {
    let mut bench = Bench::new();
    bench.base.select(&[bench.joints[4]]);
    let [from, to] = arm();
    bench.stroke(PLAIN, from, to);
    let (steps, rig) = (bench.base.steps(), bench.base.rig().clone());
    for action in [Action::Cancel, Action::Undo] {
        bench.drag(PLAIN, to, from);
        assert_ne!(bench.base.rig(), &rig, "{action:?}");
        bench.base.act(action);
        assert_eq!(
            (bench.base.rig(), bench.base.steps(), bench.tool().is_painting()),
            (&rig, steps, false),
            "{action:?}"
        );
        bench.base.point(PLAIN, &[(from, DROPPED)]);
        assert_eq!((bench.base.rig(), bench.base.steps()), (&rig, steps), "{action:?}");
    }
}

#[test]
fn control_turns_the_brush_round_and_shift_smooths() {
    let mut bench = Bench::new();
    let elbow = bench.joints[4];
    bench.base.select(&[elbow]);
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
    assert!(bench.base.status().hint.contains("Add"), "{:?}", bench.base.status());
    let (before, less) = both(&mut bench, CONTROL);
    assert!(total(&less) < 0.5 * total(&before), "{} {}", total(&less), total(&before));
    let (names, _) = bench.base.get::<RigHistory>(bench.base.rig).unwrap().steps();
    assert_eq!(names[names.len() - 3..], ["Paint weights", "Smooth weights", "Paint weights"]);
}

#[test]
fn symmetry_paints_both_sides_with_the_pair() {
    let mut bench = Bench::new();
    bench.base.edit(Operation::Mirror { joints: vec![bench.joints[3]] });
    bench.base.act(Action::Symmetry);
    let elbow = bench.joints[4];
    let other = bench.base.rig().joint(elbow).unwrap().data.mirror.unwrap();
    bench.base.select(&[elbow]);
    let [from, to] = arm();
    let steps = bench.base.steps();
    bench.stroke(PLAIN, from, to);
    assert_eq!(bench.base.steps(), steps + 1, "both sides are one step");
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
        let (rig, steps) = (bench.base.rig().clone(), bench.base.steps());
        bench.base.notices();
        let mut notices = Vec::new();
        // Messages are kept for two frames.
        for act in [(from, PointerAct::Pressed), (from.lerp(to, 0.5), PointerAct::Dragged), (to, DROPPED)] {
            bench.base.point(PLAIN, &[act]);
            notices.extend(bench.base.notices());
        }
        assert!(notices.iter().any(|notice| notice.text.contains(words)), "{words}: {notices:?}");
        assert_eq!((bench.base.rig(), bench.base.steps()), (&rig, steps), "{words}");
    };
    bench.base.act(Action::SelectNone);
    told(&mut bench, from, "no joint is selected");
    bench.base.point(PLAIN, &[(from, PointerAct::Moved)]);
    assert!(bench.base.status().obstacle.as_ref().is_some_and(|why| why.contains("no joint is selected")));
    let elbow = bench.joints[4];
    bench.base.select(&[elbow]);
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
    bench.base.edit(Operation::Lock(vec![elbow], true));
    told(&mut bench, from, "locked");
    bench.base.edit(Operation::Lock(vec![elbow], false));
    bench.base.edit(Operation::Edits(vec![RigEdit::SetKind(elbow, rigsmith::rig::NodeKind::Null)]));
    told(&mut bench, from, "only joints move points");
    // The hips hold everything: nobody could take what they would lose.
    bench.base.select(&[bench.joints[0]]);
    bench.brush(|brush| brush.mode = BrushMode::Subtract);
    told(&mut bench, from, "no other free joint");

    let mut bench = Bench::without_weights();
    bench.base.mode(Mode::Paint);
    bench.wait_for_canvas();
    bench.base.select(&[bench.joints[4]]);
    told(&mut bench, from, "no weights yet");
}

#[test]
fn the_ring_has_the_radius_of_the_brush_on_the_surface() {
    let mut bench = Bench::new();
    bench.base.select(&[bench.joints[0]]);
    let radius = 0.06;
    bench.brush(|brush| (brush.radius, brush.softness) = (Some(radius), 0.5));
    let chest = front().project(Vec3::new(0.0, 1.25, 0.1)).unwrap();
    bench.base.point(PLAIN, &[(chest, PointerAct::Moved)]);
    let cursor = bench.tool().cursor.clone().unwrap();
    let surface = bench.base.get::<RigSurface>(bench.base.rig).unwrap().ready().unwrap();
    for (ring, size) in [(&cursor.outer, radius), (&cursor.inner, 0.5 * radius)] {
        assert!(ring.len() > 20);
        for place in ring {
            let far = place.distance(cursor.middle);
            assert!((0.6 * size..1.4 * size).contains(&far), "{far} for {size}");
            assert!(surface.closest_point(*place).unwrap().distance < 1e-4, "{place} is off the surface");
        }
    }
    bench.base.point(PLAIN, &[(Vec2::splat(3.0), PointerAct::Moved)]);
    assert_eq!(bench.tool().cursor, None, "beside the mesh");
    bench.base.point(PLAIN, &[(chest, PointerAct::Moved)]);
    bench.base.mode(Mode::Select);
    assert_eq!(bench.tool().cursor, None);
}

#[test]
fn keys_change_the_brush_within_its_limits() {
    let mut bench = Bench::new();
    let brush = |bench: &Bench| *bench.base.app.world().resource::<PaintBrush>();
    let size = 1.75;
    let radius = |bench: &Bench| brush(bench).of_size(size).radius;
    let before = radius(&bench);
    bench.base.act(Action::Brush(BrushAction::Larger));
    assert!(radius(&bench) > 1.1 * before);
    bench.base.act(Action::Brush(BrushAction::Smaller));
    assert!((radius(&bench) - before).abs() < 1e-2 * before);
    for _ in 0..200 {
        bench.base.act(Action::Brush(BrushAction::Smaller));
        bench.base.act(Action::Brush(BrushAction::Weaker));
    }
    assert_eq!(brush(&bench).of_size(size).check(), Ok(()));
    assert_eq!(brush(&bench).strength, 0.0);
    for _ in 0..200 {
        bench.base.act(Action::Brush(BrushAction::Larger));
        bench.base.act(Action::Brush(BrushAction::Stronger));
    }
    assert_eq!((brush(&bench).of_size(size).check(), brush(&bench).strength), (Ok(()), 1.0));
    for mode in BrushMode::ALL {
        bench.base.act(Action::Brush(BrushAction::of_mode(mode)));
        assert_eq!(brush(&bench).mode, mode);
    }
    bench.base.act(Action::Brush(BrushAction::Reach));
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
    let weights = |bench: &Bench| bench.base.app.world().resource::<MeshDisplay>().weights;
    bench.base.select(&[bench.joints[4]]);
    assert_eq!(weights(&bench), WeightColors::Joint(bench.joints[4]));
    bench.base.act(Action::Brush(BrushAction::Colors));
    bench.base.app.update();
    assert_eq!(weights(&bench), WeightColors::AllJoints);
    bench.base.mode(Mode::Weights);
    assert_eq!(weights(&bench), WeightColors::AllJoints, "weights are shown in both modes");
    bench.base.mode(Mode::Select);
    bench.base.app.update();
    assert_eq!(weights(&bench), WeightColors::Off, "as it was");
    assert!(bench.base.get::<PaintCanvas>(bench.mesh).is_none(), "nothing is kept for brushes");
}

#[test]
fn points_are_selected_with_control_and_shift() {
    let mut bench = Bench::new();
    let [from, to] = arm();
    let selected = |bench: &Bench| bench.base.app.world().resource::<SelectedPoints>().clone();
    let rig = bench.base.rig().clone();
    let click = [(from, PointerAct::Pressed), (from, PointerAct::Released { dragged: false, count: 1 })];
    bench.base.point(BOTH, &click);
    assert_eq!((selected(&bench).mesh, selected(&bench).points.len()), (Some(MESH), 1));
    bench.base.point(BOTH, &click);
    assert_eq!(selected(&bench).points.len(), 0, "a second click takes it out");
    bench.stroke(BOTH, from, to);
    assert!(selected(&bench).points.len() > 20);
    assert_eq!(bench.base.rig(), &rig, "selecting paints nothing");
    bench.base.act(Action::Brush(BrushAction::NoPoints));
    assert!(selected(&bench).points.is_empty());
    bench.base.point(PLAIN, &[(from, PointerAct::Moved)]);
    assert_eq!(bench.tool().under.map(|(mesh, _)| mesh), Some(MESH));
}

#[test]
fn the_idle_tool_changes_nothing() {
    let mut bench = Bench::new();
    bench.base.select(&[bench.joints[4]]);
    bench.base.point(PLAIN, &[(arm()[0], PointerAct::Moved)]);
    (0..3).for_each(|_| bench.base.app.update());
    let ticks = |bench: &Bench| {
        let world = bench.base.app.world();
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
    (0..5).for_each(|_| bench.base.app.update());
    assert_eq!(ticks(&bench), before);
}
