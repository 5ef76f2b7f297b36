//! Readers of poses, nodes on curves and triangles, springs in a moving world.

use super::*;
use rigsmith::{
    rig::{Channel, Collider, Constraint, Output, Uid},
    solve::pose_reader::{PoseReader, PoseReaderError},
};

fn attribute(rig: &mut RigBuilder, node: &str, name: &str) -> Output {
    rig.attribute(node, name, 0.0, (-1e6, 1e6));
    Output::Attribute(rig.uid(node), name.into())
}

fn value(state: &RigState, rig: &RigBuilder, node: &str, name: &str) -> f32 {
    state.attribute(rig.uid(node), name).unwrap()
}

#[test]
fn a_cone_is_one_inside_zero_outside_and_smooth_between() {
    let mut rig = controls(&[("body", Vec3::ZERO), ("settings", Vec3::X)]);
    rig.node("arm", NodeType::Control, "body", Vec3::Y);
    let output = attribute(&mut rig, "settings", "up");
    rig.constrain(Constraint::Cone {
        source: rig.uid("arm"),
        axis: Vec3::Y,
        reference: None,
        towards: Vec3::Y,
        inner: 20.0,
        outer: 60.0,
        output,
    });
    let mut state = state(&rig);
    for (degrees, wanted) in [(0.0, 1.0), (19.0, 1.0), (40.0, 0.5), (61.0, 0.0), (180.0, 0.0)] {
        for axis in [Vec3::X, Vec3::Z] {
            pose(&mut state, "arm", turned(axis, degrees));
            let found = value(&state, &rig, "settings", "up");
            assert!((found - wanted).abs() < 1e-3, "{degrees}: {found}");
        }
    }
    // Only the turn against the parent counts, and none about the axis itself.
    pose(&mut state, "arm", turned(Vec3::Y, 130.0));
    pose(&mut state, "body", turned(Vec3::X, 130.0));
    assert!((value(&state, &rig, "settings", "up") - 1.0).abs() < 1e-3);
}

#[test]
fn a_pose_reader_is_one_at_its_pose_and_zero_at_the_others() {
    let mut rig = controls(&[("body", Vec3::ZERO), ("settings", Vec3::X)]);
    rig.node("arm", NodeType::Control, "body", Vec3::Y);
    let poses: [(Vec3, f32); 4] = [(Vec3::X, 0.0), (Vec3::X, 80.0), (Vec3::Z, 70.0), (Vec3::Z, -60.0)];
    let list = poses.iter().enumerate().map(|(number, (axis, degrees))| {
        let output = attribute(&mut rig, "settings", &format!("pose_{number}"));
        (Quat::from_axis_angle(*axis, degrees.to_radians()), output)
    });
    let list: Vec<_> = list.collect();
    rig.constrain(Constraint::PoseReader { source: rig.uid("arm"), reference: None, poses: list, radius: 60.0 });
    let mut state = state(&rig);
    let read = |state: &RigState| [0, 1, 2, 3].map(|at| value(state, &rig, "settings", &format!("pose_{at}")));
    for (number, (axis, degrees)) in poses.into_iter().enumerate() {
        pose(&mut state, "arm", turned(axis, degrees));
        for (other, found) in read(&state).into_iter().enumerate() {
            let wanted = f32::from(other == number);
            assert!((found - wanted).abs() < 1e-3, "pose {number}: number {other} is {found}");
        }
    }
    pose(&mut state, "arm", turned(Vec3::X, 40.0));
    let [rest, raised, ..] = read(&state);
    assert!(rest > 0.1 && raised > 0.1 && rest < 0.9 && raised < 0.9, "{rest} {raised}");
    // Far from all poses nothing is left.
    pose(&mut state, "arm", turned(Vec3::X, -170.0));
    assert!(read(&state).iter().all(|number| *number < 0.1), "{:?}", read(&state));
}

#[test]
fn poses_that_cannot_be_told_apart_are_refused() {
    let (rest, same) = (Quat::IDENTITY, Quat::from_rotation_x(1e-4));
    assert_eq!(PoseReader::new(&[], 1.0), Err(PoseReaderError::Count(0)));
    assert_eq!(PoseReader::new(&[rest; 33], 1.0), Err(PoseReaderError::Count(33)));
    assert_eq!(PoseReader::new(&[rest, same], 1.0), Err(PoseReaderError::Alike(1, 2)));
    assert!(matches!(PoseReader::new(&[rest], f32::NAN), Err(PoseReaderError::Radius(_))));
    assert_eq!(PoseReader::new(&[rest], 0.5).unwrap().read(0, Quat::from_rotation_y(0.0)), 1.0);
}

#[test]
fn a_wheel_rolls_by_the_way() {
    let mut rig = controls(&[("road", Vec3::ZERO), ("car", Vec3::new(1.0, 0.0, 2.0))]);
    rig.node("wheel", NodeType::Joint, "car", Vec3::new(1.0, 0.3, 2.0));
    let output = Output::Channel(rig.uid("wheel"), Channel::RotateX);
    rig.constrain(Constraint::Travel {
        source: rig.uid("car"),
        reference: None,
        axis: Vec3::Z,
        factor: (1.0f32 / 0.3).to_degrees(),
        output,
    });
    let mut state = state(&rig);
    near(global(&state, "wheel").rotation * Vec3::Y, Vec3::Y, 1e-6);
    // A quarter of the circumference; aside counts for nothing.
    let quarter = std::f32::consts::FRAC_PI_2 * 0.3;
    pose(&mut state, "car", moved(Vec3::new(5.0, 0.0, quarter)));
    near(global(&state, "wheel").rotation * Vec3::Y, Vec3::Z, 1e-4);
    pose(&mut state, "car", moved(Vec3::ZERO));
    near(global(&state, "wheel").rotation * Vec3::Y, Vec3::Y, 1e-6);
}

#[test]
fn a_node_goes_along_a_path() {
    let places = [("a", Vec3::ZERO), ("b", Vec3::X * 2.0), ("c", Vec3::X * 4.0), ("train", Vec3::Y)];
    let mut rig = controls(&places);
    rig.attribute("train", "along", 0.0, (0.0, 1.0));
    let train = rig.uid("train");
    rig.constrain(Constraint::Path {
        driven: train,
        points: ["a", "b", "c"].map(|point| rig.uid(point)).to_vec(),
        share: Scalar::attribute(train, "along"),
        aim: Some([Vec3::Z, Vec3::Y]),
        up: Vec3::Y,
        weight: Scalar::Value(1.0),
    });
    let mut state = state(&rig);
    for share in [0.0, 0.25, 0.5, 1.0] {
        state.set_attribute(train, "along", share).unwrap();
        state.evaluate(0.0);
        near(position(&state, "train"), Vec3::X * (4.0 * share), 1e-3);
        near(global(&state, "train").rotation * Vec3::Z, Vec3::X, 1e-3);
    }
    state.set_attribute(train, "along", 0.5).unwrap();
    pose(&mut state, "b", moved(Vec3::Y));
    near(position(&state, "train"), Vec3::new(2.0, 1.0, 0.0), 1e-3);
}

#[test]
fn a_rivet_rides_on_its_triangle() {
    let corners = [("a", Vec3::ZERO), ("b", Vec3::X), ("c", Vec3::Y), ("button", Vec3::new(0.25, 0.25, 0.1))];
    let mut rig = controls(&corners);
    rig.constrain(Constraint::Rivet {
        driven: rig.uid("button"),
        corners: ["a", "b", "c"].map(|corner| rig.uid(corner)),
        shares: [0.5, 0.25, 0.25],
        offset: Trs { translation: Vec3::Z * 0.1, ..Trs::IDENTITY },
        weight: Scalar::Value(1.0),
    });
    let mut state = state(&rig);
    near(position(&state, "button"), Vec3::new(0.25, 0.25, 0.1), 1e-6);
    for corner in ["a", "b", "c"] {
        pose(&mut state, corner, moved(Vec3::Z * 3.0));
    }
    near(position(&state, "button"), Vec3::new(0.25, 0.25, 3.1), 1e-5);
    // The triangle stands up about X: its normal turns from Z to -Y.
    pose(&mut state, "c", moved(Vec3::new(0.0, -1.0, 4.0)));
    near(global(&state, "button").rotation * Vec3::Z, Vec3::NEG_Y, 1e-5);
    near(position(&state, "button"), Vec3::new(0.25, -0.1, 3.25), 1e-5);
}

/// A bone with a spring, which feels a share of the world's motion.
fn antenna(motion: f32, colliders: impl Fn(&RigBuilder) -> Vec<Collider>) -> RigBuilder {
    let mut rig = controls(&[("head", Vec3::ZERO), ("ball", Vec3::new(0.0, 0.0, 1.0))]);
    rig.node("ear", NodeType::Joint, "head", Vec3::Y);
    rig.node("tip", NodeType::Joint, "ear", Vec3::Y * 2.0);
    let constraint = Constraint::Spring {
        driven: rig.uid("ear"),
        frequency: Scalar::Value(2.0),
        damping: Scalar::Value(0.5),
        weight: Scalar::Value(1.0),
        translate: false,
        rotate: true,
        motion: Scalar::Value(motion),
        colliders: colliders(&rig),
    };
    rig.constrain(constraint);
    rig
}

#[test]
fn a_spring_feels_the_motion_of_the_rig() {
    let lag = |motion: f32| {
        let mut state = state(&antenna(motion, |_| Vec::new()));
        state.move_frame(&Trs { translation: Vec3::X * 0.5, ..Trs::IDENTITY });
        assert!(state.is_dirty(0.0));
        state.evaluate(1.0 / 60.0);
        let lag = -(position(&state, "tip").x);
        for _ in 0..600 {
            state.evaluate(1.0 / 60.0);
        }
        near(position(&state, "tip"), Vec3::Y * 2.0, 1e-4);
        assert!(!state.is_dirty(1.0 / 60.0), "it settles");
        lag
    };
    let [none, half, whole] = [0.0, 0.5, 1.0].map(lag);
    assert!(none.abs() < 1e-6, "{none}");
    assert!(half > 0.15 && whole > 1.5 * half, "{half} {whole}");
}

#[test]
fn a_motion_that_is_no_motion_leaves_a_spring_as_it_is() {
    let mut state = state(&antenna(1.0, |_| Vec::new()));
    state.move_frame(&Trs { translation: Vec3::NAN, ..Trs::IDENTITY });
    assert!(!state.is_dirty(0.1));
    state.move_frame(&Trs { translation: Vec3::X, ..Trs::IDENTITY });
    state.move_frame(&Trs { translation: Vec3::NEG_X, ..Trs::IDENTITY });
    state.evaluate(0.1);
    near(position(&state, "tip"), Vec3::Y * 2.0, 1e-5);
}

#[test]
fn a_spring_stays_outside_of_its_colliders() {
    let bodies: [(&str, fn(&RigBuilder) -> Vec<Collider>); 2] = [
        ("ball", |rig| vec![Collider { node: rig.uid("ball"), end: None, radius: 0.6 }]),
        ("capsule", |rig| vec![Collider { node: rig.uid("ball"), end: Some(rig.uid("head")), radius: 0.4 }]),
    ];
    for (name, bodies) in bodies {
        let mut state = state(&antenna(0.0, bodies));
        let radius = if name == "ball" { 0.6 } else { 0.4 };
        // The body moves to where the tip is.
        pose(&mut state, "ball", moved(Vec3::new(0.1, 1.7, -0.9)));
        for frame in 0..120 {
            state.evaluate(1.0 / 60.0);
            let (tip, ball) = (position(&state, "tip"), position(&state, "ball"));
            assert!(tip.distance(ball) > radius - 1e-3, "{name}, frame {frame}: {}", tip.distance(ball));
            assert!((tip.distance(Vec3::Y) - 1.0).abs() < 1e-4, "{name}: the bone keeps its length");
        }
        // A second run in the same frame changes nothing.
        let before = global(&state, "tip");
        state.mark_all();
        state.evaluate(0.0);
        assert!(same_bits(&before, &global(&state, "tip")), "{name}");
        pose(&mut state, "ball", moved(Vec3::new(5.0, 0.0, 0.0)));
        for _ in 0..600 {
            state.evaluate(1.0 / 60.0);
        }
        near(position(&state, "tip"), Vec3::Y * 2.0, 1e-3);
    }
}

#[test]
fn bad_colliders_and_readers_are_refused() {
    let rig = antenna(0.0, |rig| vec![Collider { node: rig.uid("ball"), end: None, radius: 0.0 }]);
    let refused = |rig: &RigBuilder| RigProgram::compile(&rig.rig, &CompileOptions::default()).unwrap_err().to_string();
    assert!(refused(&rig).contains("radius of a collider"), "{}", refused(&rig));
    let rig = antenna(0.0, |_| vec![Collider { node: Uid(12345), end: None, radius: 1.0 }]);
    assert!(refused(&rig).contains("collider"), "{}", refused(&rig));
    let mut rig = controls(&[("a", Vec3::ZERO), ("b", Vec3::X)]);
    let output = attribute(&mut rig, "b", "out");
    let (axis, towards) = (Vec3::ZERO, Vec3::Y);
    let source = rig.uid("a");
    rig.constrain(Constraint::Cone { source, axis, reference: None, towards, inner: 0.0, outer: 9.0, output });
    assert!(refused(&rig).contains("direction"), "{}", refused(&rig));
}
