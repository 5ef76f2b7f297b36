//! Channels and limits of a control hold for its gizmo.

use rigsmith::{plugins::commands::BuildStep, rig::RestTransform};

use super::*;
use crate::world::limits::limited_rig;

/// The pose mode with the control of a chain selected, which may move by a tenth along Y and turn by ten degrees about Z.
fn bench(sight: Sight) -> (Bench, Uid) {
    let mut app = headless_app(1);
    app.add_plugins((ToolsPlugin, BuildingPlugin));
    let mut app = strict_app(app);
    let rig = app.world_mut().spawn(limited_rig()).id();
    app.insert_resource(ActiveRig(rig)).insert_resource(ViewportSight(Some(sight)));
    app.world_mut().write_message(rigsmith::plugins::commands::BuildRequest { rig, step: BuildStep::All });
    app.update();
    app.update();
    let mut bench = Bench { base: RigBench { app, rig }, sink: Sink::default() };
    let built = bench.base.get::<BuildResult>(rig).unwrap().0.clone();
    let control = built.nodes.iter().find(|node| node.control.is_some()).expect("a control").uid;
    bench.mode(Mode::Pose);
    bench.base.select(&[control]);
    bench.base.app.update();
    (bench, control)
}

/// Offset of the control's entity from rest.
fn offset(bench: &Bench, control: Uid) -> PoseOffset {
    let world = bench.base.app.world();
    let runtime = world.get::<RigRuntime>(bench.base.rig).unwrap();
    let entity = runtime.entity(runtime.state().program().node(control).unwrap()).unwrap();
    PoseOffset::between(world.get::<RestTransform>(entity).unwrap(), world.get::<Transform>(entity).unwrap())
}

/// Fails unless an offset keeps to the channels and limits.
#[track_caller]
fn is_within(offset: PoseOffset, what: &str) {
    let PoseOffset { translation, rotation, scale } = offset;
    assert!(translation.x.abs() < 1e-6 && translation.z.abs() < 1e-6, "{what}: {translation}");
    assert!(translation.y.abs() < 0.1 + 1e-6, "{what}: {translation}");
    assert!(rotation.x.abs() < 1e-6 && rotation.y.abs() < 1e-6, "{what}: {rotation}");
    assert!(rotation.angle_between(Quat::IDENTITY).to_degrees() < 10.0 + 1e-3, "{what}: {rotation}");
    assert!(scale.distance(Vec3::ONE) < 1e-6, "{what}: {scale}");
}

#[test]
fn gizmos_keep_controls_within_their_channels_and_limits() {
    for sight in sights(Transform::IDENTITY) {
        let (mut bench, control) = bench(sight);
        let handles: Vec<Handle> = bench.shapes().iter().map(|shape| shape.handle).collect();
        assert!(handles.contains(&Handle::MoveAxis(1)) && handles.contains(&Handle::Ring(2)), "{handles:?}");
        let mut reached = [false; 2];
        let dragged = [0, 1, 2].into_iter().flat_map(|axis| [Handle::MoveAxis(axis), Handle::Ring(axis)]);
        for handle in dragged.chain([Handle::MoveView]).filter(|handle| handles.contains(handle)) {
            for by in [Vec2::new(40.0, -160.0), Vec2::new(-150.0, 90.0)] {
                let what = format!("{handle:?} by {by}");
                let from = bench.grip(handle);
                let steps = bench.base.steps();
                bench.drag(from, by, ModifierKeys::default());
                is_within(offset(&bench, control), &format!("{what}, while it is dragged"));
                bench.release(from + by);
                bench.base.app.update();
                let held = offset(&bench, control);
                is_within(held, &what);
                reached[0] |= (held.translation.y.abs() - 0.1).abs() < 1e-5;
                reached[1] |= (held.rotation.angle_between(Quat::IDENTITY).to_degrees() - 10.0).abs() < 1e-2;
                assert!(bench.base.steps() <= steps + 1, "{what}: a drag is one step");
                if bench.base.steps() > steps {
                    bench.base.change(Change::Undo);
                }
                assert!(offset(&bench, control).is_rest(1e-6), "{what}: undone");
                bench.base.app.update();
            }
        }
        assert_eq!(reached, [true; 2], "drags reach the limits of the free channels");
    }
}
