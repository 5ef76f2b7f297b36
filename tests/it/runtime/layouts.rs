//! Layouts that programs share: a program with other numbers is the one that is compiled from nothing, and an instance that goes
//! on with it stands where a fresh one does.

use std::sync::Arc;

use bevy::math::{Quat, Vec3};
use rigsmith::{
    modules,
    processor::Builder,
    rig::{BuiltRig, Constraint, PoseOffset, Scalar},
    solve::program::{Carry, CompileOptions, ProgramCache, RigProgram, RigState},
};

/// Everything in a program but its number.
fn content(program: &RigProgram) -> String {
    let text = format!("{program:?}");
    let (_, content) = text.split_once(", ").unwrap();
    content.to_owned()
}

/// Changes a number in a scalar; false if it is none.
fn scaled(scalar: &mut Scalar, by: f32) -> bool {
    match scalar {
        Scalar::Value(value) => *value *= by,
        Scalar::Attribute { factor, .. } => *factor *= by,
        _ => return false,
    }
    true
}

/// Changes numbers of a constraint; false if it has none of a kind that this knows.
fn changed(constraint: &mut Constraint, by: f32) -> bool {
    match constraint {
        Constraint::Transform { targets, .. } => {
            targets[0].offset.translation += Vec3::splat(0.01 * by);
            true
        }
        Constraint::TwoBone { max_stretch, soft, .. } => {
            *max_stretch *= by;
            scaled(soft, by)
        }
        Constraint::Stretch { range, rest, volume, .. } => {
            range.1 *= by;
            *rest *= by;
            scaled(volume, by)
        }
        Constraint::Aim { offset, .. } => {
            *offset *= Quat::from_rotation_x(0.1 * by);
            true
        }
        Constraint::Twist { driven, .. } => driven.first_mut().is_some_and(|(_, share)| scaled(share, by)),
        Constraint::DrivenKey { keys, .. } => keys.last_mut().map(|key| key.1 += 0.1 * by).is_some(),
        _ => false,
    }
}

#[test]
fn programs_with_other_numbers_are_those_compiled_from_nothing() {
    let rig = crate::bench::shipped("biped");
    let mut built: BuiltRig = (*Arc::new(Builder::build(&rig, &Arc::new(modules::all())).unwrap())).clone();
    let options = CompileOptions::default();
    let mut cache = ProgramCache::default();
    let mut state = RigState::new(cache.get(&built, &options).unwrap());
    for slot in (0..state.program().nodes().len()).step_by(7) {
        state.set_offset_at(slot, PoseOffset::from_rotation(Quat::from_rotation_y(0.03 * (slot % 11) as f32)));
    }
    state.evaluate(0.0);
    let (mut partial, mut rounds) = (0, 0);
    for round in 0..built.constraints.len() + 40 {
        let by = 1.0 + 0.01 * (1 + round % 9) as f32;
        match built.constraints.get_mut(round) {
            Some(constraint) => {
                let mut other = (*constraint.constraint).clone();
                if !changed(&mut other, by) {
                    continue;
                }
                constraint.constraint = Arc::new(other);
            }
            None => {
                let node = 3 + (round * 17) % (built.nodes.len() - 3);
                built.nodes[node].base.translation *= by;
            }
        }
        rounds += 1;
        let program = cache.get(&built, &options).unwrap();
        assert_eq!(content(&program), content(&RigProgram::compile(&built, &options).unwrap()), "round {round}");
        let carry = Carry::between(state.program(), &program);
        partial += usize::from(carry.is_partial());
        let mut fresh = RigState::new(Arc::clone(&program));
        fresh.carry_over(&state);
        fresh.evaluate(0.0);
        state.exchange(&program, &carry);
        state.evaluate(0.0);
        assert_eq!(state.globals(), fresh.globals(), "round {round}");
        for slot in 0..program.nodes().len() {
            assert_eq!(state.local_at(slot), fresh.local_at(slot), "round {round}");
        }
    }
    assert!(rounds > 100 && partial * 2 > rounds, "{partial} of {rounds} exchanges run only what differs");
}

/// A changed number runs what depends on it and nothing else.
#[test]
fn exchanged_programs_run_what_differs() {
    let rig = crate::bench::shipped("biped");
    let mut built: BuiltRig = (*Arc::new(Builder::build(&rig, &Arc::new(modules::all())).unwrap())).clone();
    let options = CompileOptions::default();
    let mut cache = ProgramCache::default();
    let mut state = RigState::new(cache.get(&built, &options).unwrap());
    state.evaluate(0.0);
    let hand = built.nodes.iter().position(|node| node.label.as_deref() == Some("hand_l")).unwrap();
    let below = |mut node: usize| {
        while let Some(parent) = built.nodes[node].parent.filter(|_| node != hand) {
            node = parent;
        }
        node == hand
    };
    let is_below: Vec<bool> = (0..built.nodes.len()).map(below).collect();
    // The base of a node that constraints place moves nothing.
    let moves = |node: &usize| {
        let mut changed = built.clone();
        changed.nodes[*node].base.translation += Vec3::new(0.01, 0.0, 0.0);
        let mut fresh = RigState::new(Arc::new(RigProgram::compile(&changed, &options).unwrap()));
        fresh.evaluate(0.0);
        fresh.global_at(*node) != state.global_at(*node)
    };
    let finger = (hand + 1..built.nodes.len()).filter(|node| is_below[*node]).find(moves).unwrap();
    built.nodes[finger].base.translation += Vec3::new(0.01, 0.0, 0.0);
    let program = cache.get(&built, &options).unwrap();
    let carry = Carry::between(state.program(), &program);
    assert!(carry.is_partial());
    state.exchange(&program, &carry);
    assert!(state.evaluate(0.0));
    let moved: Vec<usize> = state.moved().collect();
    assert!(moved.contains(&finger), "{moved:?}");
    assert!(moved.len() < 40, "{} nodes moved", moved.len());
}
