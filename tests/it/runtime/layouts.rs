//! Layouts that programs share: a program with other numbers is the one that is compiled from nothing, and an instance that goes
//! on with it stands where a fresh one does.

use std::sync::Arc;

use bevy::math::{Quat, Vec3};
use rigsmith::{
    mesh::model::Trs,
    modules,
    processor::Builder,
    rig::{BuiltRig, Channel, Collider, Constraint, Limits, NodeType, Output, PoseOffset, Scalar, Uid},
    solve::program::{Carry, CompileOptions, LANES, Memory, ProgramCache, RigProgram, RigState},
};

use super::{biped::RigBuilder, controls, turned};

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

/// The built biped, and its state where every seventh node is turned.
fn posed_biped(cache: &mut ProgramCache) -> (BuiltRig, RigState) {
    let rig = crate::bench::shipped("biped");
    let built: BuiltRig = (*Arc::new(Builder::build(&rig, &Arc::new(modules::all())).unwrap())).clone();
    let mut state = RigState::new(cache.get(&built, &CompileOptions::default()).unwrap());
    for slot in (0..state.program().nodes().len()).step_by(7) {
        state.set_offset_at(slot, PoseOffset::from_rotation(Quat::from_rotation_y(0.03 * (slot % 11) as f32)));
    }
    state.evaluate(0.0);
    (built, state)
}

#[test]
fn programs_with_other_numbers_are_those_compiled_from_nothing() {
    let options = CompileOptions::default();
    let mut cache = ProgramCache::default();
    let (mut built, mut state) = posed_biped(&mut cache);
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

/// A number that was equal to others, and one that becomes so, is a number like any other: what reads it runs, and nothing else.
#[test]
fn numbers_that_others_have_too_change_alone() {
    let rig = crate::bench::shipped("biped");
    let mut built: BuiltRig = (*Arc::new(Builder::build(&rig, &Arc::new(modules::all())).unwrap())).clone();
    let is_soft = |constraint: &Constraint| matches!(constraint, Constraint::TwoBone { soft: Scalar::Value(_), .. });
    let limbs: Vec<usize> =
        (0..built.constraints.len()).filter(|at| is_soft(&built.constraints[*at].constraint)).collect();
    assert!(limbs.len() > 3, "{limbs:?}");
    let options = CompileOptions::default();
    let mut cache = ProgramCache::default();
    let mut state = RigState::new(cache.get(&built, &options).unwrap());
    for slot in (0..state.program().nodes().len()).step_by(7) {
        state.set_offset_at(slot, PoseOffset::from_rotation(Quat::from_rotation_y(0.03 * (slot % 11) as f32)));
    }
    state.evaluate(0.0);
    for (at, value) in limbs.iter().flat_map(|at| [0.05, 0.25, 0.0, 0.05].map(|value| (*at, value))) {
        let mut other = (*built.constraints[at].constraint).clone();
        if let Constraint::TwoBone { soft, .. } = &mut other {
            *soft = Scalar::Value(value);
        }
        built.constraints[at].constraint = Arc::new(other);
        let program = cache.get(&built, &options).unwrap();
        let carry = Carry::between(state.program(), &program);
        assert_eq!(carry.operations_of_registers(&program), Some(1), "constraint {at}: {value}");
        let mut fresh = RigState::new(Arc::clone(&program));
        fresh.carry_over(&state);
        fresh.evaluate(0.0);
        state.exchange(&program, &carry);
        state.evaluate(0.0);
        assert!(bits(&state) == bits(&fresh), "constraint {at}: {value}");
    }
}

/// A program of another layout runs whole, and tells the nodes that move alone: the others stand where they stood.
#[test]
fn programs_of_other_layouts_tell_what_moves() {
    let options = CompileOptions::default();
    let mut cache = ProgramCache::default();
    let (mut built, mut state) = posed_biped(&mut cache);
    let finger = built.nodes.iter().find(|node| node.label.as_deref() == Some("index_03_l")).unwrap();
    // The finger gets longer by one more constraint.
    let least = finger.base.translation.length() + 0.01;
    let limits = Limits { translate: [(Some(least), None); 3], ..Limits::default() };
    let mut longer = built.constraints[0].clone();
    (longer.uid, longer.constraint) = (Uid(77), Arc::new(Constraint::Limit { driven: finger.uid, limits }));
    built.constraints.push(longer);
    let program = cache.get(&built, &options).unwrap();
    let carry = Carry::between(state.program(), &program);
    assert!(!carry.is_partial());
    let mut fresh = RigState::new(Arc::clone(&program));
    fresh.carry_over(&state);
    fresh.evaluate(0.0);
    let before = state.globals().to_vec();
    state.exchange(&program, &carry);
    assert!(state.evaluate(0.0));
    assert!(bits(&state) == bits(&fresh));
    let moved: Vec<usize> = state.moved().collect();
    let others: Vec<usize> = (0..before.len()).filter(|slot| before[*slot] != *state.global_at(*slot)).collect();
    assert!(!others.is_empty() && others.iter().all(|slot| moved.contains(slot)), "{others:?}");
    assert!(moved.len() < 40, "{} nodes move", moved.len());
    assert_eq!(fresh.moved().count(), program.nodes().len(), "nobody knows where a fresh one stood");
}

/// Bits of the results of an instance.
fn bits(state: &RigState) -> (Vec<[u32; 10]>, Vec<u32>) {
    let of = |trs: &Trs| {
        let [x, y, z, w] = trs.rotation.to_array();
        let ([a, b, c], [d, e, f]) = (trs.translation.to_array(), trs.scale.to_array());
        [a, b, c, x, y, z, w, d, e, f].map(f32::to_bits)
    };
    let attributes = 0..state.program().attributes().len();
    (state.globals().iter().map(of).collect(), attributes.map(|slot| state.attribute_at(slot).to_bits()).collect())
}

/// Instances that remember results only run what a changed number reaches, in step and alone, to the bits of a full run.
#[test]
fn instances_of_a_crowd_run_what_a_difference_reaches() {
    let rig = crate::bench::shipped("biped");
    let mut built: BuiltRig = (*Arc::new(Builder::build(&rig, &Arc::new(modules::all())).unwrap())).clone();
    let options = CompileOptions::default();
    let mut cache = ProgramCache::default();
    let first = cache.get(&built, &options).unwrap();
    let posed = |number: usize| {
        let mut state = RigState::with_memory(Arc::clone(&first), Memory::Results);
        for slot in (number..first.nodes().len()).step_by(5) {
            state.set_offset_at(slot, PoseOffset::from_rotation(Quat::from_rotation_y(0.02 * (slot % 13) as f32)));
        }
        state.evaluate(0.0);
        state
    };
    let mut states: Vec<RigState> = (0..=LANES).map(posed).collect();
    let (mut short, mut rounds) = (0, 0);
    for round in 0..built.constraints.len() {
        let mut other = (*built.constraints[round].constraint).clone();
        if !changed(&mut other, 1.0 + 0.01 * (1 + round % 9) as f32) {
            continue;
        }
        built.constraints[round].constraint = Arc::new(other);
        rounds += 1;
        let program = cache.get(&built, &options).unwrap();
        let carry = Carry::between(states[0].program(), &program);
        let operations = carry.operations_of_results(&program);
        short += usize::from(operations * 2 < program.operations());
        let full = |state: &RigState| {
            let mut fresh = RigState::with_memory(Arc::clone(&program), Memory::Results);
            fresh.carry_over(state);
            fresh.evaluate(0.0);
            bits(&fresh)
        };
        let (mut wanted, before): (Vec<_>, Vec<_>) = states.iter().map(|state| (full(state), bits(state))).unzip();
        states.iter_mut().for_each(|state| state.exchange(&program, &carry));
        // What is posed in the same frame needs a full run, of all that run in step.
        if round % 4 == 0 {
            let slot = (round..program.nodes().len()).find(|slot| program.nodes()[*slot].is_posable()).unwrap_or(0);
            states[1].set_offset_at(slot, PoseOffset::from_rotation(Quat::from_rotation_z(0.01 * round as f32)));
            wanted[1] = full(&states[1]);
        }
        let [a, b, c, d, alone] = &mut states[..] else { panic!("there are five") };
        assert_eq!(RigState::evaluate_together([Some(a), Some(b), Some(c), Some(d)], 0.0), [true; LANES]);
        assert!(alone.evaluate(0.0) && !alone.evaluate(0.0));
        for ((state, wanted), before) in states.iter().zip(&wanted).zip(&before) {
            assert!(bits(state) == *wanted, "round {round}: {operations} of {} operations", program.operations());
            let is_told = |slot: usize| wanted.0[slot] == before.0[slot] || state.is_moved(slot);
            assert!((0..program.nodes().len()).all(is_told), "round {round}: a node moved and is not told");
        }
    }
    assert!(rounds > 50 && short * 8 > rounds, "{short} of {rounds} exchanges run less than half");
}

/// Readers, springs with bodies, and nodes on curves and triangles, between a few controls.
fn readers() -> RigBuilder {
    let places = [("a", Vec3::ZERO), ("b", Vec3::X), ("c", Vec3::Y), ("d", Vec3::new(0.3, 0.2, 1.0))];
    let mut rig = controls(&places);
    for label in ["ear", "train", "button", "wheel", "lid", "brow"] {
        rig.node(label, NodeType::Joint, "a", Vec3::new(0.2, 0.4, 0.1));
    }
    rig.node("tip", NodeType::Joint, "ear", Vec3::new(0.2, 1.4, 0.1));
    let uid = |label: &str| rig.uid(label);
    let channel = |label: &str, channel| Output::Channel(uid(label), channel);
    let list = [
        Constraint::Spring {
            driven: uid("ear"),
            frequency: Scalar::Value(2.0),
            damping: Scalar::Value(0.45),
            weight: Scalar::Value(1.0),
            translate: false,
            rotate: true,
            motion: Scalar::Value(0.6),
            colliders: vec![Collider { node: uid("b"), end: Some(uid("c")), radius: 0.2 }],
        },
        Constraint::Cone {
            source: uid("a"),
            axis: Vec3::Y,
            reference: None,
            towards: Vec3::Y,
            inner: 5.0,
            outer: 60.0,
            output: channel("lid", Channel::RotateX),
        },
        Constraint::PoseReader {
            source: uid("b"),
            reference: Some(uid("a")),
            poses: vec![
                (Quat::IDENTITY, channel("lid", Channel::RotateY)),
                (Quat::from_rotation_x(0.6), channel("brow", Channel::RotateZ)),
            ],
            radius: 30.0,
        },
        Constraint::Travel {
            source: uid("d"),
            reference: None,
            axis: Vec3::Z,
            factor: 30.0,
            output: channel("wheel", Channel::RotateX),
        },
        Constraint::Path {
            driven: uid("train"),
            points: ["a", "b", "c"].map(uid).to_vec(),
            share: Scalar::Value(0.4),
            aim: Some([Vec3::Z, Vec3::Y]),
            up: Vec3::Z,
            weight: Scalar::Value(0.9),
        },
        Constraint::Rivet {
            driven: uid("button"),
            corners: ["a", "b", "c"].map(uid),
            shares: [0.5, 0.25, 0.25],
            offset: Trs { translation: Vec3::Z * 0.1, ..Trs::IDENTITY },
            weight: Scalar::Value(0.8),
        },
    ];
    list.into_iter().for_each(|constraint| _ = rig.constrain(constraint));
    rig
}

/// Every number of a reader reaches programs that share its layout.
#[test]
fn numbers_of_readers_reach_programs_of_their_layout() {
    type Change = fn(&mut Constraint);
    macro_rules! set {
        ($kind:ident { $field:ident } => $value:expr) => {
            |constraint: &mut Constraint| match constraint {
                Constraint::$kind { $field, .. } => *$field = $value,
                _ => unreachable!(),
            }
        };
    }
    // By the constraint's place in the list.
    let changes: [(usize, Change); 16] = [
        (0, set!(Spring { frequency } => Scalar::Value(3.0))),
        (0, set!(Spring { motion } => Scalar::Value(0.65))),
        (0, |constraint| match constraint {
            Constraint::Spring { colliders, .. } => colliders[0].radius = 0.9,
            _ => unreachable!(),
        }),
        (1, set!(Cone { axis } => Vec3::new(0.2, 1.0, 0.0))),
        (1, set!(Cone { towards } => Vec3::new(0.0, 1.0, 0.4))),
        (1, set!(Cone { outer } => 80.0)),
        (2, set!(PoseReader { radius } => 50.0)),
        (2, |constraint| match constraint {
            Constraint::PoseReader { poses, .. } => poses[1].0 = Quat::from_rotation_z(0.7),
            _ => unreachable!(),
        }),
        (3, set!(Travel { axis } => Vec3::new(0.5, 0.0, 1.0))),
        (3, set!(Travel { factor } => 90.0)),
        (4, set!(Path { share } => Scalar::Value(0.7))),
        (4, set!(Path { aim } => None)),
        (4, set!(Path { up } => Vec3::X)),
        (4, set!(Path { weight } => Scalar::Value(0.3))),
        (5, set!(Rivet { shares } => [0.2, 0.4, 0.4])),
        (5, set!(Rivet { offset } => Trs { translation: Vec3::Z * 0.3, ..Trs::IDENTITY })),
    ];
    let options = CompileOptions::default();
    for (number, (at, change)) in changes.into_iter().enumerate() {
        let mut rig = readers().rig;
        let mut cache = ProgramCache::default();
        let mut state = RigState::new(cache.get(&rig, &options).unwrap());
        for (label, turn) in [("a", 0.4), ("b", 0.2), ("d", 0.1)] {
            let offset = PoseOffset { translation: Vec3::splat(0.2), ..turned(Vec3::X, turn * 90.0) };
            state.set_offset_at(state.program().find_label(label).unwrap(), offset);
        }
        state.evaluate(0.0);
        let before = state.globals().to_vec();
        let mut constraint = (*rig.constraints[at].constraint).clone();
        change(&mut constraint);
        rig.constraints[at].constraint = Arc::new(constraint);
        let program = cache.get(&rig, &options).unwrap();
        assert_eq!(content(&program), content(&RigProgram::compile(&rig, &options).unwrap()), "change {number}");
        let carry = Carry::between(state.program(), &program);
        assert!(carry.is_partial(), "change {number}");
        let mut fresh = RigState::new(Arc::clone(&program));
        fresh.carry_over(&state);
        fresh.evaluate(0.0);
        state.exchange(&program, &carry);
        state.evaluate(0.0);
        assert_eq!(state.globals(), fresh.globals(), "change {number}");
        // A spring's numbers count from the next moment on.
        if at > 0 {
            assert_ne!(state.globals(), before, "change {number} changes nothing");
        }
    }
}
