//! Programs of built rigs: what constraints do, in which order, what is refused, and that what is skipped does not show.

pub mod biped;
mod constraints;
mod layouts;
mod programs;
mod readers;
mod refusals;
mod systems;

use std::sync::Arc;

use biped::RigBuilder;
use glam::{Quat, Vec3};
use rigsmith::{
    mesh::model::Trs,
    rig::{NodeType, PoseOffset, Scalar, Target},
    solve::program::{CompileOptions, RigProgram, RigState},
};

/// An instance of what a builder made, evaluated once.
fn state(rig: &RigBuilder) -> RigState {
    let program = RigProgram::compile(&rig.rig, &CompileOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let mut state = RigState::new(Arc::new(program));
    state.evaluate(0.0);
    state
}

/// Where the node of a label is.
fn global(state: &RigState, label: &str) -> Trs {
    *state.global_at(state.program().find_label(label).unwrap_or_else(|| panic!("no {label}")))
}

fn position(state: &RigState, label: &str) -> Vec3 {
    global(state, label).translation
}

/// Poses a node and evaluates.
fn pose(state: &mut RigState, label: &str, offset: PoseOffset) {
    let slot = state.program().find_label(label).unwrap_or_else(|| panic!("no {label}"));
    assert!(state.set_offset_at(slot, offset), "{label} takes no pose");
    state.evaluate(0.0);
}

fn moved(by: Vec3) -> PoseOffset {
    PoseOffset { translation: by, ..PoseOffset::IDENTITY }
}

fn turned(axis: Vec3, degrees: f32) -> PoseOffset {
    PoseOffset::from_rotation(Quat::from_axis_angle(axis, degrees.to_radians()))
}

fn scaled(by: Vec3) -> PoseOffset {
    PoseOffset { scale: by, ..PoseOffset::IDENTITY }
}

/// A target without offset.
fn target(rig: &RigBuilder, label: &str, weight: f32) -> Target {
    Target { node: rig.uid(label), weight: Scalar::Value(weight), offset: Trs::IDENTITY }
}

/// A node for each place, all below the rig.
fn controls(places: &[(&str, Vec3)]) -> RigBuilder {
    let mut rig = RigBuilder::default();
    for (label, place) in places {
        rig.node(label, NodeType::Control, "", *place);
    }
    rig
}

/// A chain of joints.
fn chain(rig: &mut RigBuilder, places: &[(&str, Vec3)]) {
    let mut above = "";
    for (label, place) in places {
        rig.node(label, NodeType::Joint, above, *place);
        above = label;
    }
}

#[track_caller]
fn near(found: Vec3, wanted: Vec3, tolerance: f32) {
    assert!(found.distance(wanted) <= tolerance, "{found} is not {wanted}");
}

/// True if two transforms are equal bit by bit.
fn same_bits(a: &Trs, b: &Trs) -> bool {
    let bits = |trs: &Trs| {
        let numbers = trs.translation.to_array().into_iter().chain(trs.rotation.to_array());
        numbers.chain(trs.scale.to_array()).map(f32::to_bits).collect::<Vec<_>>()
    };
    bits(a) == bits(b)
}
