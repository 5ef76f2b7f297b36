//! An eye that looks at a control, with lids.

use super::super::writer::{CENTER, Writer};
use bevy::math::Quat;

/// The part alone.
pub fn part() -> Writer {
    let about = "An eye that looks at a control, with two lids that blink; dropped onto one joint it is the eye alone.";
    let mut writer = Writer::new("eye", "part", about);
    writer.group("eye", CENTER);
    for joint in ["eye", "lid_upper", "lid_lower"] {
        writer.joint(joint, "", [0.0, 1.6, 0.08]);
    }
    let space = null(&mut writer, "eye");
    writer.part("eye", |writer| {
        tags(writer, "eye", &space, [0.0, 0.0, 0.4]);
        lids(writer, "eye", ["lid_upper", "lid_lower"]);
    });
    writer
}

/// What the look-at control of an eye that stands alone moves with.
fn null(writer: &mut Writer, joint: &str) -> String {
    writer.command(joint, "space", "null", r#"(parent: "@root", orient: false, creation: (name: "eye_space"))"#);
    "@command space".to_owned()
}

/// Turns a joint so that its Y points to the front and its Z up, as eyes shall stand.
pub fn forwards(writer: &mut Writer, joint: &str) {
    writer.turn(joint, Quat::from_xyzw(0.0, std::f32::consts::FRAC_1_SQRT_2, std::f32::consts::FRAC_1_SQRT_2, 0.0));
}

/// A control for turning the eye, and one that it looks at, `ahead` of it in the rig's units.
pub fn tags(writer: &mut Writer, joint: &str, space: &str, ahead: [f32; 3]) {
    let [x, y, z] = ahead;
    let distance = (x * x + y * y + z * z).sqrt();
    let feature = "Look At";
    writer
        .command(joint, "turn", "control", format!("(shape: \"circle\", size: {:?}, shape_axes: control)", distance * 0.08))
        .feature(joint, "face", feature)
        .optional(
            feature,
            joint,
            "place",
            "null",
            format!("(parent: \"{space}\", orient: false, translate: ({x:?}, {y:?}, {z:?}), creation: (name: \"look_place\"))"),
        )
        .optional(
            feature,
            joint,
            "look",
            "control",
            format!(
                "(at: \"@command place\", parent: \"@command place\", offset_group: false, follow: false, shape: \"eye\", \
                 size: {:?}, shape_axes: rig, shape_rotate: (90.0, 0.0, 0.0))",
                distance * 0.08
            ),
        )
        // One bone that cannot reach points at its goal, by the shortest turn: as eyes do.
        .optional(
            feature,
            joint,
            "front",
            "null",
            format!(
                "(parent: \"@this\", orient: false, translate: ({:?}, {:?}, {:?}), creation: (name: \"eye_front\"))",
                x * 0.05,
                y * 0.05,
                z * 0.05
            ),
        )
        .optional(
            feature,
            joint,
            "aim",
            "ik_handle",
            r#"(end: "@command front", goal: "@command look role:control", solver: fabrik, weight: "look", orient_end: false)"#,
        );
}

/// Lids that close over the eye.
pub fn lids(writer: &mut Writer, eye: &str, lids: [&str; 2]) {
    writer.command(
        eye,
        "blink",
        "attribute",
        r#"(node: "@command turn role:control", name: "blink", min: 0.0, max: 1.0)"#,
    );
    for (lid, name, angle) in [(lids[0], "upper", 35.0), (lids[1], "lower", -20.0)] {
        writer
            .command(
                lid,
                name,
                "control",
                "(shape: \"half_circle\", size: 0.02, shape_axes: control, shape_translate: (0.0, 0.0, 0.02))",
            )
            .command(
                lid,
                &format!("{name}_blink"),
                "driven_key",
                format!(
                    "(driver: \"@command turn role:control\", driver_attribute: \"blink\", keys: [(0.0, 0.0), (1.0, {angle:?})], \
                     ease: Linear, output: \"@command {name} role:offset\", output_channel: RotateX)"
                ),
            );
    }
}
