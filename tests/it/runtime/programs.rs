//! Programs as a whole: what is skipped does not show, not even in the last bit.

use super::{biped::biped, *};
use proptest::prelude::*;
use rigsmith::{
    rig::{BuiltRig, Channel, Collider, Constraint, Output, Uid},
    solve::program::{ContentHash, ExposedNode, Keep, LANES, Memory, ProgramCache},
};

fn compile(rig: &BuiltRig, keep: Keep) -> Arc<RigProgram> {
    let options = CompileOptions { keep, ..CompileOptions::default() };
    Arc::new(RigProgram::compile(rig, &options).unwrap_or_else(|error| panic!("{error}")))
}

fn deform() -> Keep {
    Keep::DeformAndExposed(vec![ExposedNode::Controls])
}

/// A change of one input, with numbers between 0 and 1.
#[derive(Debug, Clone)]
struct Change {
    which: f32,
    is_attribute: bool,
    value: [f32; 7],
}

fn change() -> impl Strategy<Value = Change> {
    (0f32..1.0, prop::bool::weighted(0.3), prop::array::uniform7(0f32..1.0))
        .prop_map(|(which, is_attribute, value)| Change { which, is_attribute, value })
}

/// Makes the change to what has the same uid in several states.
fn apply(change: &Change, states: &mut [&mut RigState], controls: &[Uid], attributes: &[(Uid, String)]) {
    let [a, b, c, d, e, f, g] = change.value;
    if change.is_attribute {
        let (node, name) = &attributes[(change.which * attributes.len() as f32) as usize];
        states.iter_mut().for_each(|state| state.set_attribute(*node, name, (a - 0.3) * 3.0).unwrap());
        return;
    }
    let node = controls[(change.which * controls.len() as f32) as usize];
    let axis = Vec3::new(a - 0.5, b - 0.5, c - 0.5).normalize_or(Vec3::X);
    let offset = PoseOffset {
        translation: Vec3::new(d - 0.5, e - 0.5, f - 0.5) * 0.2,
        rotation: Quat::from_axis_angle(axis, 2.0 * g - 1.0),
        scale: if a > 0.8 { Vec3::new(1.0 + b * 0.1, 1.0, 1.0 - c * 0.1) } else { Vec3::ONE },
    };
    let offset = if g < 0.1 { PoseOffset::IDENTITY } else { offset };
    states.iter_mut().for_each(|state| state.set_offset(node, offset).unwrap());
}

/// A biped with springs on top.
fn sprung() -> BuiltRig {
    let mut rig = biped();
    for label in ["head", "finger_L_0_2", "spine_2"] {
        let node = rig.find_label(label).unwrap().uid;
        let mut constraint = rig.constraints[0].clone();
        constraint.uid = Uid(900_000 + node.0);
        constraint.constraint = Arc::new(Constraint::Spring {
            driven: node,
            frequency: Scalar::Value(3.0),
            damping: Scalar::Value(0.6),
            weight: Scalar::Value(0.8),
            translate: label == "spine_2",
            rotate: true,
            motion: Scalar::Value(if label == "head" { 1.0 } else { 0.4 }),
            colliders: vec![Collider {
                node: rig.find_label("arm_L_goal").unwrap().uid,
                end: (label == "head").then(|| rig.find_label("arm_R_goal").unwrap().uid),
                radius: 0.3,
            }],
        });
        rig.constraints.push(constraint);
    }
    read(&mut rig);
    rig
}

/// Adds readers of poses and ways, and nodes on a curve and on a triangle.
fn read(rig: &mut BuiltRig) {
    let uid = |label: &str| rig.find_label(label).unwrap_or_else(|| panic!("no {label}")).uid;
    let channel = |label: &str, channel| Output::Channel(uid(label), channel);
    let list = [
        Constraint::Cone {
            source: uid("head_control"),
            axis: Vec3::Y,
            reference: None,
            towards: Vec3::Y,
            inner: 5.0,
            outer: 40.0,
            output: channel("jaw_control", Channel::RotateX),
        },
        Constraint::PoseReader {
            source: uid("head_control"),
            reference: Some(uid("chest")),
            poses: vec![
                (Quat::IDENTITY, channel("jaw_control", Channel::RotateY)),
                (Quat::from_rotation_x(0.6), channel("jaw_control", Channel::RotateZ)),
            ],
            radius: 30.0,
        },
        Constraint::Travel {
            source: uid("arm_L_goal"),
            reference: Some(uid("chest")),
            axis: Vec3::X,
            factor: 60.0,
            output: channel("finger_control_R_1_1", Channel::RotateX),
        },
        Constraint::Path {
            driven: uid("finger_R_0_2"),
            points: vec![uid("arm_L_goal"), uid("chest"), uid("arm_R_goal")],
            share: Scalar::Value(0.3),
            aim: Some([Vec3::Y, Vec3::Z]),
            up: Vec3::Z,
            weight: Scalar::Value(0.9),
        },
        Constraint::Rivet {
            driven: uid("finger_R_2_2"),
            corners: [uid("arm_L_goal"), uid("chest"), uid("arm_R_goal")],
            shares: [0.2, 0.3, 0.5],
            offset: Trs { translation: Vec3::Z * 0.1, ..Trs::IDENTITY },
            weight: Scalar::Value(1.0),
        },
    ];
    for (number, constraint) in list.into_iter().enumerate() {
        let mut built = rig.constraints[0].clone();
        built.uid = Uid(950_000 + number as u64);
        built.constraint = Arc::new(constraint);
        rig.constraints.push(built);
    }
}

#[track_caller]
fn equal(found: &RigState, wanted: &RigState) {
    for (slot, node) in found.program().nodes().iter().enumerate() {
        let wanted = wanted.global(node.uid).unwrap();
        assert!(same_bits(found.global_at(slot), &wanted), "{:?}: {:?} {wanted:?}", node.label, found.global_at(slot));
    }
    for (found, wanted) in found.morphs().iter().zip(wanted.morphs()) {
        assert_eq!(found.to_bits(), wanted.to_bits());
    }
}

fn settable(program: &RigProgram) -> Vec<(Uid, String)> {
    let settable = program.attributes().iter().filter(|attribute| attribute.is_settable);
    settable.map(|attribute| (program.nodes()[attribute.node].uid, attribute.name.to_string())).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, ..ProptestConfig::default() })]

    #[test]
    fn what_changed_is_enough(frames in prop::collection::vec((prop::collection::vec(change(), 0..4), 0u32..3), 1..12)) {
        let rig = sprung();
        let (all, few) = (compile(&rig, Keep::All), compile(&rig, deform()));
        let controls: Vec<Uid> = few.nodes().iter().filter(|node| node.is_posable()).map(|node| node.uid).collect();
        let attributes = settable(&few);
        // What changed of everything, everything, what changed of what a game needs, and that from nothing.
        let mut changed = RigState::new(Arc::clone(&all));
        let mut whole = RigState::new(all);
        let mut game = RigState::new(Arc::clone(&few));
        let mut crowd = RigState::with_memory(Arc::clone(&few), Memory::Results);
        // In step with others, two of which are set differently.
        let mut lanes: [RigState; LANES] =
            std::array::from_fn(|_| RigState::with_memory(Arc::clone(&few), Memory::Results));
        for (number, (changes, frames)) in frames.into_iter().enumerate() {
            for change in &changes {
                let states = &mut [&mut changed, &mut whole, &mut game, &mut crowd];
                apply(change, states, &controls, &attributes);
                let [a, b, c, d] = &mut lanes;
                apply(change, &mut [a, c], &controls, &attributes);
                if number % 2 == 0 {
                    apply(change, &mut [b, d], &controls, &attributes);
                }
            }
            let dt = frames as f32 / 60.0;
            if frames > 0 {
                // The rig walks, in some frames.
                let motion = Trs {
                    translation: Vec3::new(0.03, 0.0, 0.01 * number as f32),
                    rotation: Quat::from_rotation_y(0.02),
                    scale: Vec3::ONE,
                };
                let [a, b, c, d] = &mut lanes;
                for state in [&mut changed, &mut whole, &mut game, &mut crowd, a, c] {
                    state.move_frame(&motion);
                }
                b.move_frame(&Trs { translation: Vec3::X, ..Trs::IDENTITY });
                d.move_frame(&Trs::IDENTITY);
            }
            whole.mark_all();
            for state in [&mut changed, &mut whole, &mut game, &mut crowd] {
                state.evaluate(dt);
            }
            equal(&changed, &whole);
            equal(&game, &whole);
            equal(&crowd, &whole);
            RigState::evaluate_together(lanes.each_mut().map(Some), dt);
            equal(&lanes[0], &whole);
            equal(&lanes[2], &whole);
        }
    }
}

#[test]
fn the_biped_stands_as_it_was_built() {
    let rig = biped();
    let mut state = RigState::new(compile(&rig, Keep::All));
    state.evaluate(0.0);
    let mut built = Vec::new();
    for (slot, node) in rig.nodes.iter().enumerate() {
        let above = node.parent.map_or(Trs::IDENTITY, |parent| built[parent]);
        built.push(above * node.base);
        let (found, wanted) = (state.global_at(slot), &built[slot]);
        let off = found.translation.distance(wanted.translation);
        let turned = found.rotation.angle_between(wanted.rotation);
        let place = node.label.as_deref().unwrap_or_default();
        assert!(off < 3e-3 && turned < 2e-2, "{place} is off by {off} and {turned}");
    }
    let joints = rig.nodes.iter().filter(|node| node.kind == NodeType::Joint).count();
    assert!(joints >= 60 && rig.nodes.len() >= 300, "{joints} joints, {} nodes", rig.nodes.len());
}

#[test]
fn only_dependents_move() {
    let rig = biped();
    let mut state = RigState::new(compile(&rig, Keep::All));
    state.evaluate(0.0);
    pose(&mut state, "finger_control_L_2_1", turned(Vec3::X, 30.0));
    let labels: Vec<&str> = state.moved().map(|slot| state.program().nodes()[slot].label.as_deref().unwrap()).collect();
    assert!(labels.contains(&"finger_L_2_2"), "{labels:?}");
    assert!(labels.iter().all(|label| label.contains("finger") && label.contains("L_2")), "{labels:?}");
    // The same value again is no change.
    pose(&mut state, "finger_control_L_2_1", turned(Vec3::X, 30.0));
    assert!(!state.is_dirty(1.0));
}

#[test]
fn limbs_reach_their_goals_and_switch() {
    let mut state = RigState::new(compile(&biped(), deform()));
    pose(&mut state, "arm_L_goal", moved(Vec3::new(-0.2, 0.2, 0.2)));
    pose(&mut state, "cog", moved(Vec3::new(0.0, -0.1, 0.0)));
    near(position(&state, "arm_L_end"), position(&state, "arm_L_goal"), 1e-4);
    near(position(&state, "leg_L_end"), Vec3::new(0.1, 0.08, 0.0), 1e-4);
    let settings = state.program().nodes()[state.program().find_label("arm_L_settings").unwrap()].uid;
    state.set_attribute(settings, "ik", 0.0).unwrap();
    state.evaluate(0.0);
    near(position(&state, "arm_L_end"), position(&state, "arm_L_fk_end"), 1e-5);
}

#[test]
fn threads_do_not_show() {
    use rayon::prelude::*;
    let program = compile(&sprung(), deform());
    let controls: Vec<usize> = (0..program.nodes().len()).filter(|slot| program.nodes()[*slot].is_posable()).collect();
    let run = |parallel: bool| {
        let mut states: Vec<RigState> =
            (0..64).map(|_| RigState::with_memory(Arc::clone(&program), Memory::Results)).collect();
        for frame in 0..4 {
            let step = |(number, state): (usize, &mut RigState)| {
                for (at, control) in controls.iter().enumerate().filter(|(at, _)| (at + number + frame) % 3 == 0) {
                    let angle = (at + 7 * number + 13 * frame) as f32 % 40.0 - 20.0;
                    state.set_offset_at(*control, turned(Vec3::new(0.6, 0.0, 0.8), angle));
                }
            };
            states.iter_mut().enumerate().for_each(step);
            if parallel {
                states.par_chunks_mut(LANES).for_each(|states| {
                    let mut states = states.iter_mut();
                    RigState::evaluate_together(std::array::from_fn(|_| states.next()), 1.0 / 60.0);
                });
            } else {
                states.iter_mut().for_each(|state| {
                    state.evaluate(1.0 / 60.0);
                });
            }
        }
        states
    };
    run(true).iter().zip(&run(false)).for_each(|(a, b)| equal(a, b));
}

#[test]
fn equal_content_shares_a_program() {
    let options = |keep: Keep| CompileOptions { keep, ..CompileOptions::default() };
    let mut cache = ProgramCache::default();
    let first = cache.get(&biped(), &options(Keep::All)).unwrap();
    let again = cache.get(&biped(), &options(Keep::All)).unwrap();
    assert!(Arc::ptr_eq(&first, &again));
    let other = cache.get(&biped(), &options(deform())).unwrap();
    assert!(!Arc::ptr_eq(&first, &other) && cache.len() == 2);
    drop((first, again, other));
    assert!(cache.is_empty(), "what nobody uses is let go");

    let hash = |rig: &BuiltRig| ContentHash::of(rig, &CompileOptions::default());
    let known = hash(&biped());
    let mut changed = biped();
    changed.nodes[40].base.translation.x += 1e-6;
    assert_ne!(hash(&changed), known);
    let mut changed = biped();
    changed.constraints.swap(3, 4);
    assert_ne!(hash(&changed), known);
    let mut changed = biped();
    changed.nodes[3].name = "another".into();
    assert_eq!(hash(&changed), known, "names do not count");
}

/// A body that stands is as high as its joints; one that lies flat is measured along its longest side.
#[test]
fn the_height_at_rest_is_that_of_the_joints_alone() {
    let height = |places: &[(&str, Vec3)]| {
        let mut rig = controls(&[("goal", Vec3::Y * 9.0)]);
        chain(&mut rig, places);
        compile(&rig.rig, Keep::All).rest_height()
    };
    assert_eq!(height(&[("a", Vec3::Y), ("b", Vec3::Y * 2.0), ("c", Vec3::new(0.25, 2.5, 0.0))]), 1.5);
    assert_eq!(height(&[("a", Vec3::Y), ("b", Vec3::new(0.0, 1.0, 2.0))]), 2.0);
    assert_eq!(height(&[]), 0.0);
}
