//! Constraints of chains: two bones, solvers of many, limits, and splines.

use super::*;

/// An arm along X that reaches for a goal, with its elbow behind.
fn arm(change: impl FnOnce(&mut Constraint)) -> RigBuilder {
    let mut rig = controls(&[("goal", Vec3::X * 2.0), ("pole", Vec3::new(1.0, 0.0, -3.0)), ("settings", Vec3::ZERO)]);
    rig.attribute("settings", "ik", 1.0, (0.0, 1.0));
    chain(&mut rig, &[("shoulder", Vec3::ZERO), ("elbow", Vec3::X), ("wrist", Vec3::X * 2.0)]);
    let mut constraint = Constraint::TwoBone {
        root: rig.uid("shoulder"),
        mid: rig.uid("elbow"),
        end: rig.uid("wrist"),
        goal: rig.uid("goal"),
        pole: Some(rig.uid("pole")),
        prefer: Vec3::NEG_Z,
        weight: Scalar::attribute(rig.uid("settings"), "ik"),
        soft: Scalar::Value(0.0),
        stretch: Scalar::Value(0.0),
        max_stretch: 3.0,
        twist: Scalar::Value(0.0),
        pin: Scalar::Value(0.0),
        orient_end: Some(Quat::IDENTITY),
    };
    change(&mut constraint);
    rig.constrain(constraint);
    rig
}

#[test]
fn two_bones_reach_and_bend_towards_the_pole() {
    let mut state = state(&arm(|_| ()));
    for goal in [Vec3::new(1.0, 1.0, 0.0), Vec3::new(0.2, -0.3, 0.4), Vec3::new(-1.0, 0.5, 1.0)] {
        pose(&mut state, "goal", moved(goal - Vec3::X * 2.0));
        near(position(&state, "wrist"), goal, 2e-5);
        assert!((position(&state, "elbow") - goal * 0.5).dot(Vec3::new(1.0, 0.0, -3.0)) > 0.0, "bends the wrong way");
    }
    let turn = PoseOffset { translation: Vec3::new(-1.0, 0.0, 0.0), ..turned(Vec3::X, 70.0) };
    pose(&mut state, "goal", turn);
    let (wrist, goal) = (global(&state, "wrist").rotation, global(&state, "goal").rotation);
    assert!(wrist.angle_between(goal) < 1e-3, "the end turns with the goal");
    // Switched off, the arm stands as it was built; half on, between.
    state
        .set_attribute(state.program().attributes().first().map(|_| uid(&state, "settings")).unwrap(), "ik", 0.0)
        .unwrap();
    state.evaluate(0.0);
    near(position(&state, "wrist"), Vec3::X * 2.0, 1e-6);
}

#[test]
fn two_bones_stretch_as_far_as_they_may() {
    let stretchy = |constraint: &mut Constraint| {
        if let Constraint::TwoBone { stretch, max_stretch, .. } = constraint {
            (*stretch, *max_stretch) = (Scalar::Value(1.0), 1.5);
        }
    };
    let mut state = state(&arm(stretchy));
    for (goal, reached) in [(2.6, 2.6), (3.0, 3.0), (5.0, 3.0), (1.9, 1.9)] {
        pose(&mut state, "goal", moved(Vec3::X * (goal - 2.0)));
        near(position(&state, "wrist"), Vec3::X * reached, 1e-4);
    }
}

#[test]
fn chains_reach_and_keep_their_lengths() {
    for solver in [ChainSolver::Fabrik, ChainSolver::Ccd(Vec::new())] {
        let mut rig = controls(&[("goal", Vec3::new(0.0, 4.0, 0.0))]);
        let places = ["a", "b", "c", "d", "e"].map(|label| label);
        let places: Vec<_> = places.iter().enumerate().map(|(i, label)| (*label, Vec3::Y * i as f32)).collect();
        chain(&mut rig, &places);
        rig.constrain(Constraint::Chain {
            joints: places.iter().map(|place| rig.uid(place.0)).collect(),
            goal: rig.uid("goal"),
            pole: None,
            solver: solver.clone(),
            iterations: 60,
            tolerance: 1e-4,
            weight: Scalar::Value(1.0),
            orient_end: None,
        });
        let mut state = state(&rig);
        for goal in [Vec3::new(2.0, 1.0, 0.5), Vec3::new(-1.0, 2.0, 1.0)] {
            pose(&mut state, "goal", moved(goal - Vec3::Y * 4.0));
            near(position(&state, "e"), goal, 2e-3);
            for pair in places.windows(2) {
                let length = position(&state, pair[0].0).distance(position(&state, pair[1].0));
                assert!((length - 1.0).abs() < 1e-4, "{solver:?}: a bone is {length} long");
            }
        }
    }
}

#[test]
fn limits_of_a_chain_hold() {
    let mut rig = controls(&[("goal", Vec3::new(0.0, 2.0, 0.0))]);
    chain(&mut rig, &[("a", Vec3::ZERO), ("b", Vec3::Y), ("c", Vec3::Y * 2.0)]);
    let hinge = [(Some(0.0), Some(0.0)), (Some(0.0), Some(0.0)), (Some(-20.0), Some(20.0))];
    rig.constrain(Constraint::Chain {
        joints: ["a", "b", "c"].map(|label| rig.uid(label)).to_vec(),
        goal: rig.uid("goal"),
        pole: None,
        solver: ChainSolver::Ccd(vec![hinge, hinge]),
        iterations: 50,
        tolerance: 1e-4,
        weight: Scalar::Value(1.0),
        orient_end: None,
    });
    let mut state = state(&rig);
    pose(&mut state, "goal", moved(Vec3::new(3.0, -2.0, 2.0)));
    for (label, above) in [("a", Quat::IDENTITY), ("b", global(&state, "a").rotation)] {
        let local = above.conjugate() * global(&state, label).rotation;
        let (axis, angle) = local.to_axis_angle();
        assert!(
            angle.to_degrees() <= 20.1 && axis.dot(Vec3::Z).abs() > 0.999 || angle < 1e-3,
            "{label}: {axis} {angle}"
        );
    }
}

#[test]
fn a_spline_lies_on_its_points_and_twists() {
    let mut rig = controls(&[("p0", Vec3::ZERO), ("p1", Vec3::Y), ("p2", Vec3::Y * 2.0)]);
    rig.attribute("p0", "stretch", 0.0, (0.0, 1.0));
    let labels = ["s0", "s1", "s2", "s3", "s4"];
    let places: Vec<_> = labels.iter().enumerate().map(|(i, label)| (*label, Vec3::Y * 0.5 * i as f32)).collect();
    chain(&mut rig, &places);
    rig.constrain(Constraint::Spline {
        joints: labels.map(|label| rig.uid(label)).to_vec(),
        points: ["p0", "p1", "p2"].map(|label| rig.uid(label)).to_vec(),
        stretch: Scalar::attribute(rig.uid("p0"), "stretch"),
        twist: Scalar::Value(0.0),
        weight: Scalar::Value(1.0),
    });
    let mut state = state(&rig);
    for (label, place) in &places {
        near(position(&state, label), *place, 1e-4);
        assert!(global(&state, label).rotation.angle_between(Quat::IDENTITY) < 1e-3, "{label} is turned at rest");
    }
    pose(&mut state, "p2", turned(Vec3::Y, 80.0));
    for (number, label) in labels.iter().enumerate() {
        let found = global(&state, label).rotation * Vec3::X;
        near(found, Quat::from_rotation_y((20.0 * number as f32).to_radians()) * Vec3::X, 2e-3);
    }
    pose(&mut state, "p2", moved(Vec3::new(0.0, 2.0, 0.0)));
    near(position(&state, "s4"), Vec3::Y * 2.0, 1e-3);
    state.set_attribute(rig.uid("p0"), "stretch", 1.0).unwrap();
    state.evaluate(0.0);
    near(position(&state, "s4"), Vec3::Y * 4.0, 1e-3);
}
