//! Springs in an app: their motion goes on through edits that build the rig anew.

use std::time::Duration;

use bevy::{prelude::*, time::TimeUpdateStrategy};
use rigsmith::{
    plugins::commands::{BuildResult, BuildStep},
    prelude::*,
    rig::{BuiltNode, NodeType, RestTransform, TagData, TagKind},
    test_app::test_app,
};

use super::{RigBench, shipped};

/// The part `spring_chain`, built and at rest, in an app with frames of a sixtieth of a second.
fn chain() -> RigBench {
    let (_, rig) = shipped().into_iter().find(|(name, _)| name == "spring_chain").unwrap();
    let mut app = test_app();
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_nanos(16_666_667)));
    let rig = app.world_mut().spawn(rig).id();
    app.update();
    let mut stage = RigBench { app, rig };
    stage.step(BuildStep::All);
    stage
}

/// Turns the first control of the chain.
fn swing(stage: &mut RigBench) {
    let root = stage.rig().roots()[0];
    let built = &stage.get::<BuildResult>(stage.rig).unwrap().0;
    let is_first = |node: &&BuiltNode| {
        node.kind == NodeType::Control && node.origin.as_ref().is_some_and(|origin| origin.subject == root)
    };
    let control = stage.node(built.nodes.iter().find(is_first).unwrap().uid).unwrap();
    stage.app.world_mut().get_mut::<Transform>(control).unwrap().rotation *= Quat::from_rotation_x(0.8);
    (0..6).for_each(|_| stage.app.update());
}

fn places(stage: &RigBench) -> Vec<Vec3> {
    let joints = stage.rig().walk().map(|joint| stage.node(joint.data.uid).unwrap());
    joints.map(|joint| stage.get::<GlobalTransform>(joint).unwrap().translation()).collect()
}

fn largest(a: &[Vec3], b: &[Vec3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max)
}

/// Edits of a joint's commands, by what they change of the program.
fn edits(rig: &Rig) -> Vec<(&'static str, RigEdit)> {
    let tip = rig.find_label("chain_5").unwrap();
    let null = TagKind::Command { module: "null".into(), params: "()".into(), feature: None };
    let null = TagData { uid: Uid(77), enabled: true, comment: String::new(), kind: null };
    let (joint, spring) = rig
        .walk()
        .flat_map(|joint| joint.data.tags.iter().map(|tag| (joint.data.uid, tag.clone())).collect::<Vec<_>>())
        .find(|(_, tag)| matches!(&tag.kind, TagKind::Command { module, .. } if module == "spring"))
        .unwrap();
    let remark = TagData { comment: "hair".into(), ..spring };
    let rest = rig.joint(tip).unwrap().data.rest;
    let turned = RestTransform { rotation: rest.rotation * Quat::from_rotation_y(0.3), ..rest };
    vec![
        ("a comment", RigEdit::SetTag(joint, Box::new(remark))),
        ("a label", RigEdit::SetLabel(tip, Some("tip".into()))),
        ("a further node", RigEdit::AddTag { joint: tip, tag: Box::new(null), index: 0 }),
        ("the rest pose of the tip", RigEdit::SetRest(tip, turned)),
    ]
}

#[test]
fn springs_go_on_through_a_rebuild() {
    let rig = chain().rig().clone();
    for (what, edit) in edits(&rig) {
        let (mut plain, mut edited) = (chain(), chain());
        let still = places(&plain);
        for stage in [&mut plain, &mut edited] {
            swing(stage);
        }
        assert!(largest(&places(&plain), &still) > 0.02, "the chain moves");
        edited.apply(edit);
        plain.app.update();
        let mut moved: f32 = 0.0;
        for frame in 0..30 {
            let (a, b) = (places(&plain), places(&edited));
            let off = largest(&a, &b);
            assert!(off < 1e-5, "{what}: {frame} frames later the chain is off by {off}");
            plain.app.update();
            edited.app.update();
            moved = moved.max(largest(&a, &places(&plain)));
        }
        assert!(moved > 1e-3, "{what}: the chain still swings afterwards");
        // The same for the way back.
        edited.change(Change::Undo);
        plain.app.update();
        let off = largest(&places(&plain), &places(&edited));
        assert!(off < 1e-5, "{what}: undone, the chain is off by {off}");
    }
}
