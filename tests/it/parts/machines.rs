//! Modules for machines, surfaces and correctives, as a person writes them in a template.

use bevy::math::{Quat, Vec3};
use rigsmith::{
    processor::review,
    rig::{Rig, template::read_template},
};

use super::{Puppet, all_modules};

fn rig(joints: &str) -> Rig {
    let text = format!("(format: 2, name: \"machine\", joints: [{joints}])");
    read_template(text.as_bytes()).unwrap_or_else(|error| panic!("{error}")).rig
}

fn problem(joints: &str) -> String {
    let problems = review(&rig(joints), &all_modules());
    format!("{problems:?}")
}

#[test]
fn a_piston_points_at_its_other_end() {
    let mut puppet = Puppet::new(rig(r#"(label: "base", tags: [control()]),
        (label: "cylinder", parent: "base", translation: (0, 0, 0), rotation: (0, 0, -60)),
        (label: "arm", translation: (1, 0.5, 0), tags: [control()]),
        (label: "rod", parent: "arm", rotation: (10, 20, 30), tags: [
            piston(first: "@joint cylinder", second: "@this", direction: (0, 0, 1)),
        ])"#));
    let (off, angle, which) = puppet.off_rest();
    assert!(off < 1e-5 && angle < 0.05, "{which}: {off} {angle}");
    let [first, second] = ["cylinder", "rod"].map(|label| puppet.at(puppet.joint(label)).rotation);
    let way = |puppet: &Puppet| (puppet.place("rod") - puppet.place("cylinder")).normalize();
    let axes = [first.inverse() * way(&puppet), second.inverse() * way(&puppet)];
    for place in [Vec3::new(0.8, 0.9, 0.2), Vec3::new(1.2, -0.3, -0.4), Vec3::new(0.1, 1.0, 0.0)] {
        puppet.move_to("arm_control", place);
        for (label, axis) in ["cylinder", "rod"].into_iter().zip(axes) {
            let points = puppet.axis(label, axis);
            assert!(points.dot(way(&puppet)) > 0.99999, "{label} points along {points}, not {}", way(&puppet));
        }
    }
    let below = r#"(label: "a", tags: []), (label: "b", parent: "a", translation: (0, 1, 0), tags: [
        piston(first: "@joint a", second: "@this")])"#;
    assert!(problem(below).contains("below the other end"), "{}", problem(below));
}

#[test]
fn a_wheel_turns_once_a_circumference() {
    let mut puppet = Puppet::new(rig(r#"(label: "car", translation: (0, 0.3, 0), tags: [control()]),
        (label: "wheel", parent: "car", translation: (0.5, 0, 1), tags: [
            wheel(source: "@command control/car role:control", radius: 0.3),
        ])"#));
    let around = std::f32::consts::TAU * 0.3;
    for (share, wanted) in [(0.25, Vec3::Z), (0.5, Vec3::NEG_Y), (0.75, Vec3::NEG_Z), (3.0, Vec3::Y)] {
        puppet.move_to("car_control", Vec3::new(0.0, 0.3, share * around));
        let up = puppet.axis("wheel", Vec3::Y);
        assert!(up.distance(wanted) < 1e-3, "{share}: {up}");
    }
    let flat = r#"(label: "a", tags: [wheel(source: "@this", radius: 0.0)])"#;
    assert!(problem(flat).contains("radius"), "{}", problem(flat));
}

#[test]
fn beads_hang_on_a_path() {
    let mut puppet = Puppet::new(rig(r#"(label: "a", tags: [control()]),
        (label: "b", translation: (1, 0, 0), tags: [control()]),
        (label: "c", translation: (2, 0, 0), tags: [control()]),
        (label: "bead_1", translation: (0.5, 0, 0)),
        (label: "bead_2", translation: (1, 0, 0), tags: [
            path(
                node: "@joint bead_1 + @joint bead_2",
                points: "@joint a + @joint b + @joint c",
                control: "@command control/a role:control",
                share: "along",
                spacing: 0.25,
                aim: x,
            ),
        ])"#));
    puppet.set("a_control", "along", 0.25);
    for (label, x) in [("bead_1", 0.5), ("bead_2", 1.0)] {
        assert!(puppet.place(label).distance(Vec3::X * x) < 1e-3, "{label}: {}", puppet.place(label));
        assert!(puppet.axis(label, Vec3::X).dot(Vec3::X) > 0.9999);
    }
    puppet.move_by("b_control", Vec3::Y);
    assert!(puppet.place("bead_2").y > 0.8, "{}", puppet.place("bead_2"));
    assert!(puppet.place("bead_1").y > 0.2 && puppet.axis("bead_1", Vec3::X).y > 0.3);
    let short = r#"(label: "a", tags: [control(), path(points: "@command control/a role:control")])"#;
    assert!(problem(short).contains("two or more"), "{}", problem(short));
}

#[test]
fn a_button_rides_on_cloth() {
    let mut puppet = Puppet::new(rig(r#"(label: "a", tags: [control()]),
        (label: "b", translation: (1, 0, 0), tags: [control()]),
        (label: "c", translation: (0, 1, 0), tags: [control()]),
        (label: "button", translation: (0.3, 0.3, 0.05), rotation: (10, 20, 30), tags: [
            rivet(corners: "@joint a + @joint b + @joint c"),
        ])"#));
    let (off, angle, _) = puppet.off_rest();
    assert!(off < 1e-5 && angle < 0.05, "{off} {angle}");
    let rest = puppet.at(puppet.joint("button")).rotation;
    for name in ["a_control", "b_control", "c_control"] {
        puppet.move_by(name, Vec3::new(0.2, 0.0, 1.0));
    }
    assert!(puppet.place("button").distance(Vec3::new(0.5, 0.3, 1.05)) < 1e-4, "{}", puppet.place("button"));
    puppet.move_by("b_control", Vec3::new(-1.0, 0.0, -1.0));
    let turned = puppet.at(puppet.joint("button")).rotation.angle_between(rest);
    assert!((turned - std::f32::consts::FRAC_PI_2).abs() < 1e-2, "{turned}");
    let line = r#"(label: "a"), (label: "b", translation: (1, 0, 0)), (label: "c", translation: (2, 0, 0), tags: [
        rivet(node: "@joint c", corners: "@joint a + @joint b + @joint c")])"#;
    assert!(problem(line).contains("line"), "{}", problem(line));
}

#[test]
fn readers_drive_correctives() {
    let mut puppet = Puppet::new(rig(r#"(label: "body"),
        (label: "arm", parent: "body", translation: (0, 1, 0), tags: [
            control(),
            null(creation: (name: "numbers")),
            attribute(node: "@command null/numbers", name: "raised", min: 0.0, max: 1.0),
            cone_reader(
                towards: (1, 0, 0),
                outer: 60.0,
                output: "@command null/numbers",
                output_attribute: "raised",
            ),
            rbf_reader(
                poses: [
                    (attribute: "rest"),
                    (rotate: (0, 0, -80), attribute: "aside"),
                    (rotate: (70, 0, 0), morph: "forward"),
                ],
                output: "@command null/numbers",
            ),
        ]),
        (label: "hand", parent: "arm", translation: (0, 1, 0))"#));
    let numbers = puppet.named(rigsmith::rig::NodeType::Null, "numbers").uid;
    let read = |puppet: &Puppet, name: &str| puppet.state.attribute(numbers, name).unwrap();
    assert_eq!((read(&puppet, "raised"), puppet.state.morphs()[0]), (0.0, 0.0));
    assert!((read(&puppet, "rest") - 1.0).abs() < 1e-4);
    puppet.turn("arm_control", Quat::from_rotation_z(-80f32.to_radians()));
    assert!(read(&puppet, "raised") > 0.9 && (read(&puppet, "aside") - 1.0).abs() < 1e-3);
    assert!(read(&puppet, "rest") < 1e-3);
    puppet.turn("arm_control", Quat::from_rotation_x(70f32.to_radians()));
    assert!((puppet.state.morphs()[0] - 1.0).abs() < 1e-3 && read(&puppet, "aside") < 1e-3);
    assert_eq!(read(&puppet, "raised"), 0.0);
    let twice = r#"(label: "a", tags: [rbf_reader(poses: [(morph: "x"), (morph: "y")])])"#;
    assert!(problem(twice).contains("same rotation"), "{}", problem(twice));
    let nothing = r#"(label: "a", tags: [rbf_reader(poses: [()])])"#;
    assert!(problem(nothing).contains("each drives one thing"), "{}", problem(nothing));
}

#[test]
fn hair_stays_off_the_head() {
    let joints = r#"(label: "head", tags: [control()]),
        (label: "hair", parent: "head", translation: (0, 1, 0), tags: [
            spring(frequency: 2.0, colliders: "@joint ball", radii: [0.5]),
        ]),
        (label: "tip", parent: "hair", translation: (0, 1, 0)),
        (label: "ball", translation: (0, 2, 2), tags: [control()])"#;
    let mut puppet = Puppet::new(rig(joints));
    puppet.move_to("ball_control", Vec3::new(0.0, 2.0, 0.2));
    for _ in 0..60 {
        puppet.state.evaluate(1.0 / 60.0);
        let apart = puppet.place("tip").distance(Vec3::new(0.0, 2.0, 0.2));
        assert!(apart > 0.499, "{apart}");
    }
    assert!(puppet.place("tip").z < -0.2, "{}", puppet.place("tip"));
    let uneven = joints.replace(
        "colliders: \"@joint ball\",",
        "colliders: \"@joint ball\", collider_ends: \"@joint ball + @joint head\",",
    );
    assert!(problem(&uneven).contains("2 nodes for 1 colliders"), "{}", problem(&uneven));
}
