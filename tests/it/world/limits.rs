//! Channels and limits of controls hold for whoever writes: code, edits, animation, and the tools of the window.

use bevy::{
    animation::{AnimatedBy, AnimationTargetId, animated_field},
    prelude::*,
};
use rigsmith::{
    plugins::commands::{BuildResult, BuildStep},
    prelude::*,
    rig::{JointData, NodeType, PoseOffset, RestTransform, TagData, TagKind},
};

use super::{NEAR, RigBench};

/// A chain of three joints whose middle one has a control: it may only move along Y by up to a tenth, and turn about Z by
/// up to ten degrees.
pub fn limited_rig() -> Rig {
    let mut rig = Rig::new(Uid(1000), "rig");
    for number in 1..=3 {
        let joint = JointData {
            uid: Uid(number),
            label: Some(format!("j{number}")),
            rest: RestTransform::from_translation(Vec3::Y),
            ..default()
        };
        let parent = (number > 1).then(|| Uid(number - 1));
        rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent, index: 0 }).unwrap();
    }
    let params = "(channels: (translate: (false, true, false), rotate: (false, false, true), \
                  scale: (false, false, false)), \
                  limits: (translate: ((None, None), (-0.1, 0.1), (None, None)), \
                  rotate: ((None, None), (None, None), (-10.0, 10.0))))";
    let kind = TagKind::Command { module: "control".into(), params: params.into(), feature: None };
    let tag = TagData { uid: Uid(77), enabled: true, comment: String::new(), kind };
    rig.apply(&RigEdit::AddTag { joint: Uid(2), tag: Box::new(tag), index: 0 }).unwrap();
    rig
}

/// The built rig, and its only control.
fn limited() -> (RigBench, Uid) {
    let stage = RigBench::of_built(limited_rig());
    let control = only_control(&stage);
    (stage, control)
}

fn only_control(stage: &RigBench) -> Uid {
    let built = &stage.get::<BuildResult>(stage.rig).unwrap().0;
    let control = built.nodes.iter().find(|node| node.kind == NodeType::Control);
    control.unwrap_or_else(|| panic!("no control in {:?}", built.nodes)).uid
}

/// Far outside of the limits in every channel.
const FAR: PoseOffset = PoseOffset {
    translation: Vec3::splat(5.0),
    rotation: Quat::from_xyzw(0.0, 0.0, core::f32::consts::FRAC_1_SQRT_2, core::f32::consts::FRAC_1_SQRT_2),
    scale: Vec3::splat(3.0),
};

fn rest(stage: &RigBench, control: Uid) -> RestTransform {
    *stage.get::<RestTransform>(stage.node(control).unwrap()).unwrap()
}

/// Fails unless the control is held at its limits, and what hangs on it, too.
#[track_caller]
fn is_held(stage: &RigBench, control: Uid, who: &str) {
    let entity = stage.node(control).unwrap();
    let offset = PoseOffset::between(&rest(stage, control), stage.get::<Transform>(entity).unwrap());
    assert!(offset.translation.distance(Vec3::new(0.0, 0.1, 0.0)) < 1e-6, "{who}: {offset:?}");
    let angle = offset.rotation.angle_between(Quat::IDENTITY).to_degrees();
    assert!((angle - 10.0).abs() < 1e-3, "{who}: {angle}");
    assert!(offset.scale.distance(Vec3::ONE) < 1e-6, "{who}: {offset:?}");
    // The joint that follows the control is held, too.
    let tip = stage.get::<GlobalTransform>(stage.node(Uid(3)).unwrap()).unwrap().translation();
    let wanted = Vec3::new(-(10.0_f32.to_radians().sin()), 2.1 + 10.0_f32.to_radians().cos(), 0.0);
    assert!(tip.distance(wanted) < 1e-4, "{who}: {tip}, not {wanted}");
    assert!(stage.off() <= NEAR, "{who}");
}

#[test]
fn channels_and_limits_hold_for_whoever_writes() {
    let (mut stage, control) = limited();
    let entity = stage.node(control).unwrap();
    let posed = FAR.on(&rest(&stage, control));
    *stage.app.world_mut().get_mut::<Transform>(entity).unwrap() = posed;
    stage.app.update();
    is_held(&stage, control, "code");

    let (mut stage, control) = limited();
    stage.change(Change::Do(Operation::Pose(vec![(control, FAR)])));
    is_held(&stage, control, "an edit");
    stage.change(Change::Undo);
    let entity = stage.node(control).unwrap();
    let offset = PoseOffset::between(&rest(&stage, control), stage.get::<Transform>(entity).unwrap());
    assert!(offset.translation.length() < 1e-6);

    // Limits that come later hold a pose that is there already.
    let (mut stage, control) = limited();
    let loose = {
        let mut tag = stage.rig().find_tag(Uid(77)).unwrap().1.clone();
        tag.kind = TagKind::Command { module: "control".into(), params: "()".into(), feature: None };
        tag
    };
    stage.apply(RigEdit::SetTag(Uid(2), Box::new(loose)));
    let entity = stage.node(control).unwrap();
    *stage.app.world_mut().get_mut::<Transform>(entity).unwrap() = posed;
    stage.app.update();
    assert!(stage.get::<Transform>(entity).unwrap().translation.x > 4.0, "nothing holds it now");
    stage.change(Change::Undo);
    is_held(&stage, control, "limits that come back");
}

#[test]
fn channels_and_limits_hold_for_animations() {
    let mut app = rigsmith::headless::headless_app(1);
    app.add_plugins((bevy::asset::AssetPlugin::default(), bevy::animation::AnimationPlugin));
    app.finish();
    app.cleanup();
    let rig = app.world_mut().spawn(limited_rig()).id();
    app.update();
    let mut stage = RigBench { app, rig };
    stage.step(BuildStep::All);
    let control = only_control(&stage);
    let entity = stage.node(control).unwrap();
    let posed = FAR.on(&rest(&stage, control));
    let mut clip = AnimationClip::default();
    let id = AnimationTargetId::from_name(&Name::new("control"));
    let vectors = |value: Vec3| AnimatableKeyframeCurve::new([(0.0, value), (10.0, value)]).unwrap();
    let rotation = AnimatableKeyframeCurve::new([(0.0, posed.rotation), (10.0, posed.rotation)]).unwrap();
    let translation = AnimatableCurve::new(animated_field!(Transform::translation), vectors(posed.translation));
    clip.add_curve_to_target(id, translation);
    clip.add_curve_to_target(id, AnimatableCurve::new(animated_field!(Transform::rotation), rotation));
    clip.add_curve_to_target(id, AnimatableCurve::new(animated_field!(Transform::scale), vectors(posed.scale)));
    let clip = stage.app.world_mut().resource_mut::<Assets<AnimationClip>>().add(clip);
    let (graph, node) = AnimationGraph::from_clip(clip);
    let graph = stage.app.world_mut().resource_mut::<Assets<AnimationGraph>>().add(graph);
    let mut player = AnimationPlayer::default();
    player.play(node).repeat();
    stage.app.world_mut().entity_mut(rig).insert((AnimationGraphHandle(graph), player));
    stage.app.world_mut().entity_mut(entity).insert((id, AnimatedBy(rig)));
    for frame in 0..4 {
        stage.app.update();
        if frame > 1 {
            is_held(&stage, control, "an animation");
        }
    }
}
