//! Eyes that look, jaws that open, single controls.

use super::*;

#[test]
fn an_eye_looks_at_its_control() {
    let mut stage = Stage::new(part("eye"));
    let (eye, look) = (stage.joint("eye_l"), stage.control("eye_l", "eye"));
    let at = stage.place("eye_l");
    assert!(stage.global(look).translation.z > at.z + 0.2, "the control is in front of the eye");
    for shift in [
        Vec3::ZERO,
        Vec3::new(0.3, 0.0, 0.0),
        Vec3::new(-0.3, 0.1, 0.0),
        Vec3::new(0.0, -0.25, 0.2),
        Vec3::new(0.2, 0.2, -0.3),
        Vec3::new(0.1, 0.0, 5.0),
    ] {
        stage.shift(look, shift);
        let wanted = (stage.global(look).translation - at).normalize();
        let ahead = axis(stage.global(eye), Vec3::Z);
        assert!(ahead.angle_between(wanted) < 2e-3, "{shift}: it looks along {ahead} and not {wanted}");
        assert!(stage.place("eye_l").distance(at) < 1e-6, "{shift}: the eye stays in its socket");
        // By the shortest turn, without rolling.
        let shortest = Quat::from_rotation_arc(Vec3::Z, wanted);
        assert!(stage.global(eye).rotation.angle_between(shortest) < 5e-3, "{shift}: it rolls");
    }
    // Half a look, and none.
    stage.shift(look, Vec3::new(0.4, 0.0, 0.0));
    let turned = |stage: &Stage| axis(stage.global(eye), Vec3::Z).angle_between(Vec3::Z).to_degrees();
    let whole = turned(&stage);
    stage.set("eye_l", "look", 0.5);
    assert!((turned(&stage) - whole * 0.5).abs() < 0.15 * whole, "{} of {whole}", turned(&stage));
    stage.set("eye_l", "look", 0.0);
    assert!(turned(&stage) < 0.1);
    // Without looking it turns by hand.
    let by_hand = stage.control("eye_l", "circle");
    stage.rotate(by_hand, Quat::from_rotation_y(0.3));
    assert!((turned(&stage) - 0.3_f32.to_degrees()).abs() < 0.1);
}

#[test]
fn lids_close_over_the_eye() {
    let mut stage = Stage::new(part("eye"));
    let ahead = |stage: &Stage, label: &str| axis(stage.global(stage.joint(label)), Vec3::Z);
    for label in ["lid_upper_l", "lid_lower_l"] {
        assert!(ahead(&stage, label).y.abs() < 1e-3);
    }
    stage.set("eye_l", "blink", 1.0);
    assert!(ahead(&stage, "lid_upper_l").y < -0.4, "the upper lid goes down");
    assert!(ahead(&stage, "lid_lower_l").y > 0.2, "the lower lid goes up");
    assert!(ahead(&stage, "eye_l").y.abs() < 1e-3, "the eye does not");
    // It goes no further, and half is between.
    let closed = ahead(&stage, "lid_upper_l").y;
    stage.set("eye_l", "blink", 4.0);
    assert_eq!(ahead(&stage, "lid_upper_l").y, closed);
    stage.set("eye_l", "blink", 0.5);
    assert!(ahead(&stage, "lid_upper_l").y < -0.2 && ahead(&stage, "lid_upper_l").y > closed + 0.1);
}

#[test]
fn an_eye_alone_takes_the_part_without_lids() {
    let part = part("eye");
    let (mut rig, joints) = host(&part, "head", 1.0);
    drop_onto(&mut rig, &part, &joints[..1]);
    let mut stage = Stage::new(rig);
    stage.check_rest("eye alone");
    let look = stage.control("eye_l", "eye");
    stage.shift(look, Vec3::new(0.2, 0.1, 0.0));
    let eye = stage.global(joints[0]);
    let before = stage.rig.rest_global(joints[0]).to_scale_rotation_translation().1;
    assert!(eye.rotation.angle_between(before) > 0.2, "it looks");
}

#[test]
fn a_jaw_opens_downwards_and_stops() {
    for (mut stage, jaw, tip, most) in [
        (Stage::new(part("jaw")), "jaw", "jaw_tip", 28.0),
        (Stage::new(template("quadruped")), "jaw", "jaw_tip", 30.0),
        (Stage::new(template("bird")), "beak", "beak_tip", 25.0),
    ] {
        let rest = stage.place(tip);
        let hinge = stage.place(jaw);
        let angle = |stage: &Stage| (stage.place(tip) - hinge).angle_between(rest - hinge).to_degrees();
        stage.set(jaw, "open", 0.5);
        assert!((angle(&stage) - 0.5 * most).abs() < 0.2, "{jaw}: half open is {}", angle(&stage));
        stage.set(jaw, "open", 1.0);
        let open = stage.place(tip);
        assert!(open.y < rest.y - 0.3 * (rest - hinge).length(), "{jaw}: the tip goes down, to {open} from {rest}");
        assert!((open.x - rest.x).abs() < 1e-5 && stage.place(jaw).distance(hinge) < 1e-6, "{jaw}");
        assert!((angle(&stage) - most).abs() < 0.2, "{jaw}: open is {}", angle(&stage));
        // Neither the attribute nor the control nor both together go further.
        stage.set(jaw, "open", 9.0);
        assert!(angle(&stage) < most + 0.2, "{jaw}: {}", angle(&stage));
        let control = stage.control(jaw, "half_circle");
        stage.rotate(control, Quat::from_rotation_x(-1.0));
        assert!(angle(&stage) < most + 0.2, "{jaw}: {} with the control", angle(&stage));
        assert!(stage.place(tip).y < rest.y);
        // Shut, it goes up by no more than a little.
        stage.set(jaw, "open", 0.0);
        stage.rotate(control, Quat::from_rotation_x(1.0));
        assert!(stage.place(tip).y > rest.y && angle(&stage) < 5.2, "{jaw}: {}", angle(&stage));
    }
}

#[test]
fn a_single_control_moves_its_joint() {
    let mut stage = Stage::new(part("single_control"));
    let (joint, control) = (stage.joint("control"), stage.control("control", "cube"));
    let offset = PoseOffset {
        translation: Vec3::new(0.1, 0.2, -0.3),
        rotation: Quat::from_rotation_z(0.8),
        scale: Vec3::new(1.0, 2.0, 1.0),
    };
    let before = stage.global(joint);
    stage.pose(control, offset);
    let after = stage.global(joint);
    assert!(after.translation.distance(before.translation + offset.translation) < 1e-6);
    assert!(after.rotation.angle_between(offset.rotation) < 1e-3);
    assert!(after.scale.distance(offset.scale) < 1e-5);
}
