//! Switches in an app: inverse and forward kinematics, and spaces, are thrown by one request, without a jump, as one step
//! of the history.

use bevy::prelude::*;
use rigsmith::{
    plugins::{
        commands::{Attributes, BuildResult},
        controls::SwitchRequest,
        document::EditRefusal,
    },
    prelude::*,
    rig::{AttributeKind, Matching, NodeType, PoseOffset, SwitchData},
};

use super::{NEAR, RigBench, shipped};

/// Largest distance, in units of the templates (meters), and angle that a joint may jump by.
const STILL: f32 = 1e-4;

/// World transforms of the built joints' entities.
fn joints(stage: &RigBench) -> Vec<(String, GlobalTransform)> {
    let built = &stage.get::<BuildResult>(stage.rig).unwrap().0;
    let joints = built.nodes.iter().filter(|node| node.kind == NodeType::Joint);
    let place = |uid| *stage.get::<GlobalTransform>(stage.node(uid).unwrap()).unwrap();
    joints.map(|joint| (joint.name.to_string(), place(joint.uid))).collect()
}

#[track_caller]
fn stand_as_before(stage: &RigBench, before: &[(String, GlobalTransform)], what: &str) {
    for ((name, before), (_, after)) in before.iter().zip(joints(stage)) {
        let off = before.translation().distance(after.translation());
        assert!(off < STILL, "{what}: {name} jumps by {off}");
        let (a, b) = (before.rotation(), after.rotation());
        let angle = 2.0 * (a.conjugate() * b).xyz().length().min(1.0).asin();
        assert!(angle < 1e-3, "{what}: {name} turns by {angle}");
    }
}

/// Values of a switch: both kinematics, or all spaces.
fn values(stage: &RigBench, switch: &SwitchData) -> Vec<f32> {
    let built = &stage.get::<BuildResult>(stage.rig).unwrap().0;
    let node = built.node(switch.control).unwrap();
    let attribute = node.attributes.iter().find(|attribute| attribute.name == switch.attribute).unwrap();
    match &attribute.kind {
        AttributeKind::Choice(names) => (0..names.len()).map(|number| number as f32).collect(),
        _ => vec![0.0, 1.0],
    }
}

fn value(stage: &RigBench, switch: &SwitchData) -> f32 {
    let entity = stage.node(switch.control).unwrap();
    stage.get::<Attributes>(entity).unwrap().0[&*switch.attribute]
}

fn throw(stage: &mut RigBench, switch: &SwitchData, value: f32) {
    let (rig, control, attribute) = (stage.rig, switch.control, switch.attribute.to_string());
    stage.app.world_mut().write_message(SwitchRequest { rig, control, attribute, value });
    stage.app.update();
}

fn refusals(stage: &mut RigBench) -> Vec<String> {
    let mut messages = stage.app.world_mut().resource_mut::<Messages<EditRefusal>>();
    messages.drain().map(|refused| refused.reason.to_string()).collect()
}

#[test]
fn switches_keep_every_joint_in_place_as_one_step() {
    let mut counts = [0, 0];
    for name in ["biped", "quadruped", "bird"] {
        let (_, rig) = shipped().into_iter().find(|(template, _)| template == name).unwrap();
        let mut stage = RigBench::of_built(rig);
        let built = stage.get::<BuildResult>(stage.rig).unwrap().0.clone();
        // Bent limbs: their goals are a little nearer to their roots, and turned.
        let goals = built.switches.iter().filter_map(|switch| match &switch.matching {
            Matching::IkFk { goal, .. } => Some(*goal),
            Matching::Space { .. } => None,
        });
        let index = built.index();
        let mut bent = Vec::new();
        for goal in goals {
            let mut at = &built.nodes[index[&goal]];
            while at.kind != NodeType::Control {
                at = &built.nodes[at.parent.expect("a control carries the goal")];
            }
            let global = stage.runtime().state().global(at.uid).unwrap();
            let way = 0.05 * (Vec3::new(0.0, 0.6, 0.0) - global.translation) + Vec3::new(0.0, 0.02, 0.03);
            let rotation = Quat::from_rotation_y(0.2);
            let translation = global.rotation.inverse() * way / global.scale;
            bent.push((at.uid, PoseOffset { translation, rotation, scale: Vec3::ONE }));
        }
        stage.change(Change::Do(Operation::Pose(bent)));
        let posed = joints(&stage);
        refusals(&mut stage);
        let first = stage.steps();
        for switch in &built.switches {
            let at_first = value(&stage, switch);
            let all = values(&stage, switch);
            for wanted in all.iter().copied().chain([at_first]) {
                let label = built.node(switch.control).unwrap().name.to_string();
                let what = format!("{name}: {label}.{} = {wanted}", switch.attribute);
                let (before, steps_before) = (value(&stage, switch), stage.steps());
                throw(&mut stage, switch, wanted);
                assert_eq!(refusals(&mut stage), Vec::<String>::new(), "{what}");
                stand_as_before(&stage, &posed, &what);
                assert_eq!(value(&stage, switch), wanted, "{what}");
                let by = stage.steps() - steps_before;
                assert!(by == 1 || by == 0 && before == wanted, "{what}: {by} steps of the history");
                let off = stage.off();
                assert!(off <= NEAR, "{what}: {off}");
                if by == 1 {
                    stage.change(Change::Undo);
                    assert_eq!((value(&stage, switch), stage.steps()), (before, steps_before), "{what}: undone");
                    stand_as_before(&stage, &posed, &format!("{what}, undone"));
                    stage.change(Change::Redo);
                    stand_as_before(&stage, &posed, &format!("{what}, redone"));
                    counts[usize::from(matches!(switch.matching, Matching::Space { .. }))] += 1;
                }
            }
        }
        // Of all switches nothing is left when their steps are undone.
        while stage.steps() > first {
            stage.change(Change::Undo);
        }
        stand_as_before(&stage, &posed, name);
    }
    assert!(counts[0] >= 10 && counts[1] >= 10, "{counts:?} switches of kinematics and of spaces");
}

#[test]
fn a_switch_that_is_not_there_is_refused_aloud() {
    let (_, rig) = shipped().into_iter().find(|(name, _)| name == "biped").unwrap();
    let mut stage = RigBench::started(rig);
    let switch = SwitchRequest { rig: stage.rig, control: Uid(1), attribute: "ik".into(), value: 1.0 };
    stage.app.world_mut().write_message(switch.clone());
    stage.app.update();
    let said = refusals(&mut stage);
    assert!(said.len() == 1 && said[0].contains("not built"), "{said:?}");
    stage.step(rigsmith::plugins::commands::BuildStep::All);
    let before = stage.steps();
    stage.app.world_mut().write_message(switch);
    stage.app.update();
    let said = refusals(&mut stage);
    assert!(said.len() == 1 && said[0].contains("no switch"), "{said:?}");
    assert_eq!(stage.steps(), before);
}
