//! Gizmos: drags under the pointer in every kind of view, previews that leave no trace, poses, the other side.

mod limits;
mod poses;
mod pull;

use std::sync::{Arc, Mutex};

use bevy::prelude::*;
use rigsmith::{
    editor::{
        ActiveRig,
        actions::Action,
        building::BuildingPlugin,
        camera::ViewportSight,
        mode::Mode,
        pointer::{ModifierKeys, PointerAct, ViewportPointer},
        settings::{EditorSettings, GizmoSpace},
        tools::{
            ToolsPlugin,
            gizmo::{Delta, GizmoDrag, GizmoFrame, GizmoParts, Handle, HandleShape, LENGTH, LinePaint, handle_at},
            transform::{GizmoTool, PoseMoves},
        },
    },
    headless::headless_app,
    plugins::{
        commands::{BuildFailure, BuildResult},
        controls::{ControlsInUse, outline::lines_of},
        document::{JointEntities, ShowRest},
        journal::RigJournal,
        runtime::RigRuntime,
        viewport::{RigViewport, Sight},
    },
    prelude::*,
    rig::{
        Matching, PoseOffset,
        operations::MirrorPlane,
        step::{Commit, SinkError, StepSink},
    },
    test_app::strict_app,
};

use crate::bench::RigBench;

const SIZE: Vec2 = Vec2::new(1000.0, 800.0);

/// Views from where no axis points at the camera.
fn sights(place: Transform) -> [Sight; 2] {
    let camera = Transform::from_xyz(3.0, 3.0, 5.0).looking_at(Vec3::Y, Vec3::Y);
    let focus = camera.translation.distance(Vec3::Y);
    let mut flat = OrthographicProjection::default_3d();
    flat.area = Rect::from_center_size(Vec2::ZERO, Vec2::new(5.0, 4.0));
    [Projection::Perspective(PerspectiveProjection { fov: 0.6, ..default() }), Projection::Orthographic(flat)].map(
        |projection| {
            Sight::new(&camera.into(), &projection, &RigViewport { focus }, SIZE, &GlobalTransform::from(place))
                .unwrap()
        },
    )
}

#[derive(Default, Clone)]
struct Sink(Arc<Mutex<Vec<Commit>>>);

impl StepSink for Sink {
    fn record(&self, committed: Commit) {
        self.0.lock().unwrap().push(committed);
    }
    fn trouble(&self) -> Option<SinkError> {
        None
    }
    fn flush(&self, _: std::time::Duration) -> Result<(), SinkError> {
        Ok(())
    }
}

struct Bench {
    base: RigBench,
    sink: Sink,
}

impl Bench {
    fn new(sight: Sight, place: Transform) -> Self {
        let mut app = headless_app(1);
        app.add_plugins(ToolsPlugin);
        let sink = Sink::default();
        let bundle = (Rig::new(Uid(1), "rig"), place, RigJournal::new(sink.clone()));
        let mut base = RigBench::with(strict_app(app), bundle);
        base.app.insert_resource(ActiveRig(base.rig)).insert_resource(ViewportSight(Some(sight)));
        base.app.update();
        Self { base, sink }
    }

    /// A rig with commands in view, which are carried out as soon as it is open; the tools are added to the app.
    fn built(mut app: App, rig: Rig, sight: Sight) -> Self {
        app.add_plugins((ToolsPlugin, BuildingPlugin));
        let mut app = strict_app(app);
        let rig = app.world_mut().spawn(rig).id();
        app.insert_resource(ActiveRig(rig)).insert_resource(ViewportSight(Some(sight)));
        app.update();
        app.update();
        Self { base: RigBench { app, rig }, sink: Sink::default() }
    }

    fn place(&mut self, position: [f32; 3], parent: Option<Uid>) -> Uid {
        self.base.edit(Operation::Place { position: position.into(), parent });
        self.base.get::<Selection>(self.base.rig).unwrap().active().unwrap()
    }

    fn mode(&mut self, mode: Mode) {
        self.base.mode(mode);
        self.base.app.update();
    }

    fn settings(&mut self, change: impl FnOnce(&mut EditorSettings)) {
        change(&mut self.base.app.world_mut().resource_mut::<EditorSettings>());
        self.base.app.update();
    }

    fn journaled(&self) -> usize {
        self.sink.0.lock().unwrap().len()
    }

    fn shapes(&self) -> Vec<HandleShape> {
        self.base.app.world().resource::<GizmoTool>().shapes.clone()
    }

    /// A pixel on a handle and on no other.
    #[track_caller]
    fn grip(&self, handle: Handle) -> Vec2 {
        let shapes = self.shapes();
        let shape = shapes.iter().find(|shape| shape.handle == handle).unwrap_or_else(|| panic!("no {handle:?}"));
        let lines = shape.lines.iter().filter(|line| line.paint != LinePaint::Far);
        let area = |points: &[Vec2]| points.iter().sum::<Vec2>() / points.len() as f32;
        let mut places = lines.flat_map(|line| {
            let middle = (line.paint == LinePaint::Area).then(|| area(&line.points));
            middle.into_iter().chain(line.points.iter().copied()).collect::<Vec<_>>()
        });
        places.find(|at| handle_at(&shapes, *at) == Some(handle)).unwrap_or_else(|| panic!("{handle:?} is hidden"))
    }

    fn pointer(&mut self, at: Vec2, act: PointerAct, held: ModifierKeys) {
        self.base.send(ViewportPointer { at, act, held });
    }

    /// A press, two moves; the button stays down.
    fn drag(&mut self, from: Vec2, by: Vec2, held: ModifierKeys) {
        self.pointer(from, PointerAct::Moved, held);
        self.pointer(from, PointerAct::Pressed, held);
        for share in [0.4, 1.0] {
            self.pointer(from + by * share, PointerAct::Dragged, held);
        }
    }

    fn release(&mut self, at: Vec2) {
        self.pointer(at, PointerAct::Released { dragged: true, count: 1 }, ModifierKeys::default());
    }
}

/// A root, turned and scaled, with two joints below.
fn chain(bench: &mut Bench) -> [Uid; 3] {
    let root = bench.place([0.0, 1.0, 0.0], None);
    bench.base.edit(Operation::Rotate {
        joints: vec![root],
        rotation: Quat::from_rotation_y(0.7) * Quat::from_rotation_x(0.4),
        pivot: None,
        with_children: true,
    });
    bench.base.edit(Operation::Scale {
        joints: vec![root],
        scale: Vec3::splat(1.5),
        axes: Quat::IDENTITY,
        pivot: None,
        with_children: true,
    });
    let middle = bench.place([0.3, 1.2, 0.1], Some(root));
    let tip = bench.place([0.6, 1.3, 0.1], Some(middle));
    [root, middle, tip]
}

fn somewhere() -> Transform {
    Transform::from_xyz(0.2, -0.1, 0.3).with_rotation(Quat::from_rotation_y(0.5)).with_scale(Vec3::splat(1.3))
}

#[test]
fn every_axis_keeps_the_grabbed_place_under_the_pointer() {
    for (view, sight) in sights(Transform::IDENTITY).into_iter().enumerate() {
        let frame = GizmoFrame { origin: Vec3::new(0.2, 1.1, 0.1), axes: [Vec3::X, Vec3::Y, Vec3::Z] };
        for axis in 0..3 {
            let grabbed = frame.origin + frame.axes[axis] * (LENGTH * 0.8 * sight.pixel_at(frame.origin));
            let press = sight.project(grabbed).unwrap();
            let run = (press - sight.project(frame.origin).unwrap()).normalize();
            for pixels in [-150.0, 3.0, 80.0] {
                let mut drag = GizmoDrag::new(Handle::MoveAxis(axis), frame, sight, press);
                let Delta::Move(by) = drag.to(press + run * pixels, None) else { panic!("no movement") };
                assert!(by.reject_from(frame.axes[axis]).length() < 1e-5);
                let now = sight.project(grabbed + by).unwrap();
                assert!(now.distance(press + run * pixels) < 0.1, "view {view} axis {axis}: {now}");
            }
        }
        let at = sight.project(frame.origin).unwrap();
        let mut drag = GizmoDrag::new(Handle::MoveView, frame, sight, at);
        let Delta::Move(by) = drag.to(at + Vec2::new(60.0, -45.0), None) else { panic!("no movement") };
        assert!(by.dot(sight.plane.towards()).abs() < 1e-4, "the depth stays");
        assert!(sight.project(frame.origin + by).unwrap().distance(at + Vec2::new(60.0, -45.0)) < 0.1);
    }
}

#[test]
fn rings_turn_with_the_pointer_round_and_round() {
    let [_, flat] = sights(Transform::IDENTITY);
    let frame = GizmoFrame { origin: Vec3::Y, axes: [flat.plane.right, flat.plane.up, flat.plane.towards()] };
    let middle = flat.project(frame.origin).unwrap();
    let at = |turn: f32| middle + 74.0 * Vec2::new(turn.cos(), -turn.sin());
    for handle in [Handle::Ring(2), Handle::ViewRing] {
        let mut drag = GizmoDrag::new(handle, frame, flat, at(0.3));
        let mut last = 0.0;
        for number in 1..=50 {
            let turn = number as f32 * 0.2;
            let Delta::Turn { axis, angle } = drag.to(at(0.3 + turn), None) else { panic!("no turn") };
            assert!(axis.distance(flat.plane.towards()) < 1e-4);
            assert!((angle - turn).abs() < 1e-2, "{handle:?}: {angle} for {turn}");
            last = angle;
        }
        let Delta::Turn { angle, .. } = drag.to(at(0.3 + 10.0), Some(0.1)) else { panic!("no turn") };
        let steps = angle / 15f32.to_radians();
        assert!((steps - steps.round()).abs() < 1e-3 && (angle - last).abs() <= 7.6f32.to_radians());
    }
}

#[test]
fn handles_are_found_where_they_are_painted() {
    let parts = |moves, turns, scales| GizmoParts { moves, turns, scales };
    for sight in sights(Transform::IDENTITY) {
        let frame = GizmoFrame { origin: Vec3::Y, axes: [Vec3::X, Vec3::Y, Vec3::Z] };
        for parts in [parts(true, false, false), parts(false, true, false), parts(false, false, true)] {
            let shapes = frame.shapes(parts, &sight);
            let middle = sight.project(frame.origin).unwrap();
            assert!(!shapes.is_empty());
            for shape in &shapes {
                let points = shape.lines.iter().filter(|line| line.paint != LinePaint::Far).flat_map(|l| &l.points);
                let hit = points.filter(|at| handle_at(&shapes, **at) == Some(shape.handle)).count();
                assert!(hit > 0, "{:?} cannot be hit", shape.handle);
            }
            assert_eq!(handle_at(&shapes, middle + Vec2::new(0.0, 130.0)), None);
            if parts.turns {
                // Between the rings other joints can be clicked.
                let free = (0..4000)
                    .map(|number| middle + Vec2::new((number % 64 - 32) as f32, (number / 64 - 31) as f32))
                    .filter(|at| handle_at(&shapes, *at).is_none())
                    .count();
                assert!(free > 1500, "only {free} pixels are free");
            }
        }
    }
}

#[test]
fn drags_move_joints_in_every_space_and_are_one_step() {
    for place in [Transform::IDENTITY, somewhere()] {
        for sight in sights(place) {
            for space in [GizmoSpace::World, GizmoSpace::Local, GizmoSpace::View] {
                for axis in 0..3 {
                    let mut bench = Bench::new(sight, place);
                    let [_, middle, tip] = chain(&mut bench);
                    bench.settings(|settings| settings.gizmo_space = space);
                    bench.base.select(&[middle]);
                    bench.mode(Mode::Move);
                    let (steps, before) = (bench.base.steps(), bench.base.rig().clone());
                    let Some(_) = bench.shapes().iter().find(|shape| shape.handle == Handle::MoveAxis(axis)) else {
                        assert!(space == GizmoSpace::View && axis == 2, "{space:?} {axis} is missing");
                        continue;
                    };
                    let from = bench.grip(Handle::MoveAxis(axis));
                    let start = sight.project(before.position(middle)).unwrap();
                    let by = (from - start).normalize() * 70.0;
                    bench.drag(from, by, ModifierKeys::default());
                    assert_eq!((bench.base.steps(), bench.journaled()), (steps, steps), "a preview is no step");
                    assert_ne!(bench.base.rig().position(middle), before.position(middle), "a drag is seen at once");
                    bench.release(from + by);
                    assert_eq!((bench.base.steps(), bench.journaled()), (steps + 1, steps + 1));
                    let moved = bench.base.rig().position(middle) - before.position(middle);
                    let along = match space {
                        GizmoSpace::World => place.rotation.inverse() * Vec3::AXES[axis],
                        GizmoSpace::Local => before.rest_global(middle).matrix3.col(axis).normalize(),
                        GizmoSpace::View => [sight.plane.right, sight.plane.up, sight.plane.towards()][axis],
                    };
                    assert!(moved.reject_from(along).length() < 1e-4, "{space:?} {axis}: {moved} along {along}");
                    assert!(bench.base.rig().position(tip).distance(before.position(tip)) < 1e-4, "children stay");
                    let now = sight.project(bench.base.rig().position(middle)).unwrap();
                    let is_flat = sight.plane.eye.is_none();
                    assert!(!is_flat || now.distance(start + by) < 1.0, "{now} is not {}", start + by);
                }
            }
        }
    }
}

#[test]
fn the_middle_takes_the_joint_along_with_the_pointer() {
    for sight in sights(somewhere()) {
        let mut bench = Bench::new(sight, somewhere());
        let [_, middle, tip] = chain(&mut bench);
        bench.settings(|settings| settings.move_children = true);
        bench.base.select(&[middle]);
        bench.mode(Mode::Move);
        let before = bench.base.rig().clone();
        let from = bench.grip(Handle::MoveView);
        let start = sight.project(before.position(middle)).unwrap();
        bench.drag(from, Vec2::new(90.0, -60.0), ModifierKeys::default());
        bench.release(from + Vec2::new(90.0, -60.0));
        let now = sight.project(bench.base.rig().position(middle)).unwrap();
        assert!(now.distance(start + Vec2::new(90.0, -60.0)) < 1.0);
        let moved = bench.base.rig().position(middle) - before.position(middle);
        let child = bench.base.rig().position(tip) - before.position(tip);
        assert!(moved.distance(child) < 1e-4, "children come along");
    }
}

#[test]
fn escape_and_other_edits_take_a_drag_back_to_the_bit() {
    let [sight, _] = sights(Transform::IDENTITY);
    for (mode, handle) in [
        (Mode::Move, Handle::MoveView),
        (Mode::Rotate, Handle::ViewRing),
        (Mode::Scale, Handle::ScaleAll),
        (Mode::Pose, Handle::ViewRing),
    ] {
        let mut bench = Bench::new(sight, Transform::IDENTITY);
        let [root, middle, tip] = chain(&mut bench);
        bench.base.edit(Operation::Pose(vec![(tip, PoseOffset::from_rotation(Quat::from_rotation_z(0.4)))]));
        bench.base.select(&[middle, tip]);
        bench.mode(mode);
        let before = bench.base.rig().clone();
        let (steps, journaled) = (bench.base.steps(), bench.journaled());
        let from = bench.grip(handle);
        bench.drag(from, Vec2::new(31.0, 47.0), ModifierKeys::default());
        assert_ne!(*bench.base.rig(), before, "{mode:?} shows nothing");
        bench.base.act(Action::Cancel);
        assert_eq!(*bench.base.rig(), before, "{mode:?} is not taken back");
        bench.pointer(from, PointerAct::Dragged, ModifierKeys::default());
        bench.release(from);
        assert_eq!(*bench.base.rig(), before, "{mode:?} goes on after Escape");
        assert_eq!((bench.base.steps(), bench.journaled()), (steps, journaled));

        bench.drag(from, Vec2::new(31.0, 47.0), ModifierKeys::default());
        bench.base.edit(Operation::Lock(vec![root], true));
        bench.pointer(from, PointerAct::Dragged, ModifierKeys::default());
        bench.release(from + 50.0);
        bench.base.change(Change::Undo);
        assert_eq!(*bench.base.rig(), before, "{mode:?}: the other edit had the preview in it");
    }
}

#[test]
fn the_other_side_follows() {
    let [_, sight] = sights(Transform::IDENTITY);
    for (mode, handle) in
        [(Mode::Move, Handle::MoveAxis(0)), (Mode::Rotate, Handle::Ring(1)), (Mode::Scale, Handle::ScaleAll)]
    {
        let mut bench = Bench::new(sight, Transform::IDENTITY);
        let root = bench.place([0.0, 1.0, 0.0], None);
        bench.base.app.world_mut().get_mut::<Symmetry>(bench.base.rig).unwrap().0 = Some(MirrorPlane::sagittal(2.0));
        let left = bench.place([0.4, 1.2, 0.1], Some(root));
        let hand = bench.place([0.8, 1.0, 0.2], Some(left));
        let other = |bench: &Bench, joint: Uid| bench.base.rig().joint(joint).unwrap().data.mirror.unwrap();
        let (right, right_hand) = (other(&bench, left), other(&bench, hand));
        bench.settings(|settings| settings.move_children = true);
        bench.base.select(&[right, left]);
        bench.mode(mode);
        let before = bench.base.rig().clone();
        let from = bench.grip(handle);
        bench.drag(from, Vec2::new(50.0, 20.0), ModifierKeys::default());
        bench.release(from + Vec2::new(50.0, 20.0));
        assert_ne!(*bench.base.rig(), before, "{mode:?}");
        for (here, there) in [(left, right), (hand, right_hand)] {
            let mirrored = bench.base.rig().position(here) * Vec3::new(-1.0, 1.0, 1.0);
            let off = mirrored.distance(bench.base.rig().position(there));
            assert!(off < 1e-5, "{mode:?}: off by {off}");
        }
    }
}

#[test]
fn control_snaps_and_clicks_on_handles_pick_what_is_there() {
    let [_, sight] = sights(Transform::IDENTITY);
    let mut bench = Bench::new(sight, Transform::IDENTITY);
    let joint = bench.place([0.0, 1.0, 0.0], None);
    let top = bench.place([0.0, 2.0, 0.0], None);
    bench.base.select(&[joint]);
    bench.mode(Mode::Move);
    let from = bench.grip(Handle::MoveAxis(1));
    let control = ModifierKeys { control: true, ..default() };
    bench.drag(from, Vec2::new(0.0, -33.0), control);
    bench.pointer(from - Vec2::new(0.0, 33.0), PointerAct::Released { dragged: true, count: 1 }, control);
    // The skeleton is one unit high.
    let moved = (bench.base.rig().position(joint).y - 1.0) / 0.01;
    assert!(moved > 5.0 && (moved - moved.round()).abs() < 1e-2, "{moved} steps");

    // A joint right under the arrow can be clicked.
    let under = sight.plane.lift(sight.point(bench.grip(Handle::MoveAxis(1))));
    bench.base.edit(Operation::Move { to: vec![(top, under)], with_children: false });
    bench.base.select(&[joint]);
    bench.mode(Mode::Move);
    let (steps, at) = (bench.base.steps(), sight.project(under).unwrap());
    assert!(handle_at(&bench.shapes(), at).is_some());
    bench.pointer(at, PointerAct::Pressed, ModifierKeys::default());
    bench.pointer(at, PointerAct::Released { dragged: false, count: 1 }, ModifierKeys::default());
    bench.base.app.update();
    assert_eq!(bench.base.get::<Selection>(bench.base.rig).unwrap().0, [top]);
    assert_eq!(bench.base.steps(), steps, "a click is no drag");
}
