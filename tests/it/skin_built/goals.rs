//! Hands and feet follow their controls in an app: what is posed through a workbench, and where the entities stand.

use bevy::prelude::*;
use rigsmith::{
    headless::{
        Workbench,
        posing::{ControlWrite, PosedNode, WriteValue},
    },
    plugins::commands::BuildStep,
};

use super::{figure::Figure, figures};

/// Largest distance, in units of the bodies (meters), of a hand or foot from its goal.
const REACH: f32 = 1e-4;

/// A node by its name; joints by their label.
fn named<'a>(nodes: &'a [PosedNode], name: &str) -> &'a PosedNode {
    let is = |node: &&PosedNode| match &node.node.origin {
        Some(_) => *node.node.name == *name,
        None => node.node.label.as_deref() == Some(name),
    };
    nodes.iter().find(is).unwrap_or_else(|| panic!("no node {name}"))
}

fn place(nodes: &[PosedNode], name: &str) -> Vec3 {
    named(nodes, name).entity.translation
}

/// Moves the end of a limb, by its label, half way to the root of the limb and a little forward.
fn reach(figure: &Figure, bench: &mut Workbench, limb: [&str; 3], side: &str) {
    let [end, root, mid] = limb.map(|label| format!("{label}{side}"));
    let before = bench.nodes().unwrap();
    let [end_at, root_at, mid_at] = [&end, &root, &mid].map(|label| place(&before, label));
    let length = root_at.distance(mid_at) + mid_at.distance(end_at);
    let control = named(&before, &format!("{}_ik{side}", limb[0])).clone();
    let by = root_at.midpoint(end_at) + 0.2 * length * Vec3::Z - end_at;
    // Values are along the control's own axes at rest.
    let own = control.entity.rotation.inverse() * by / control.entity.scale;
    let write = ControlWrite { node: end.clone(), value: WriteValue::Translate(own) };
    bench.pose(&[write]).unwrap_or_else(|error| panic!("{}: {error}", figure.name));
    let after = bench.nodes().unwrap();
    let (wanted, is) = (control.entity.translation + by, place(&after, &control.node.name));
    assert!(is.distance(wanted) < REACH, "{}: the control of {end} is at {is}, not at {wanted}", figure.name);
    let (wanted, is) = (end_at + by, place(&after, &end));
    let off = is.distance(wanted);
    assert!(off < REACH, "{}: {end} is off by {off}", figure.name);
    let apart = |node: &PosedNode| node.entity.translation.distance(node.program.translation);
    let worst = after.iter().map(apart).fold(0.0, f32::max);
    assert!(worst < 1e-5, "{}: entities and program differ by {worst}", figure.name);
}

#[test]
fn entities_of_hands_and_feet_reach_their_goals() {
    for figure in figures() {
        let mut bench = figure.bench(None);
        assert!(bench.build(BuildStep::All).error.is_none());
        // Nodes are reported in the rig's space, wherever the rig stands in the world.
        let at_origin = bench.nodes().unwrap();
        let rig = bench.rig_entity();
        let elsewhere = Transform::from_xyz(1.0, 0.0, 0.5).with_rotation(Quat::from_rotation_y(0.5));
        *bench.app_mut().world_mut().get_mut::<Transform>(rig).unwrap() = elsewhere;
        bench.app_mut().update();
        for (before, after) in at_origin.iter().zip(bench.nodes().unwrap()) {
            let off = before.entity.translation.distance(after.entity.translation);
            assert!(off < 1e-5, "{}: {} is off by {off}", figure.name, before.node.name);
        }
        for side in ["_l", "_r"] {
            reach(&figure, &mut bench, ["hand", "upper_arm", "forearm"], side);
            reach(&figure, &mut bench, ["foot", "thigh", "shin"], side);
        }
    }
}
