//! A tail: a control a joint, a curve through three controls, and lag.

use bevy::math::{Mat3, Quat, Vec3};

use super::{
    super::writer::{CENTER, Writer},
    spring_chain,
};

/// The part alone.
pub fn part() -> Writer {
    let about =
        "A tail of any length: a control a joint that lags behind and settles, or a curve through three controls.";
    let mut writer = Writer::new("tail", "part", about);
    let chain = [
        ("tail_1", [0.0, 0.80, -0.30]),
        ("tail_2", [0.0, 0.79, -0.42]),
        ("tail_3", [0.0, 0.76, -0.53]),
        ("tail_4", [0.0, 0.71, -0.63]),
        ("tail_5", [0.0, 0.65, -0.72]),
        ("tail_6", [0.0, 0.58, -0.80]),
    ];
    writer.group("tail", CENTER).chain("", &chain);
    turn(&mut writer, &chain.map(|(label, _)| label));
    writer.part("tail", |writer| tags(writer, "tail_1"));
    writer
}

/// Turns the joints of a tail: Y along it, X to the side all the way, so that turning about X lifts and lowers it.
pub fn turn(writer: &mut Writer, labels: &[&str]) {
    let place = |writer: &Writer, label: &str| writer.rig().find_label(label).map(|joint| writer.rig().position(joint));
    let mut last = None;
    for (number, label) in labels.iter().enumerate() {
        let next = labels.get(number + 1).and_then(|next| place(writer, next));
        let bone = next.zip(place(writer, label)).map(|(next, here)| next - here).or(last);
        let Some(along) = bone.and_then(Vec3::try_normalize) else { continue };
        last = Some(along);
        let side = along.cross(Vec3::Y).normalize_or(Vec3::X);
        writer.turn(label, Quat::from_mat3(&Mat3::from_cols(side, along, side.cross(along))).normalize());
    }
}

/// Controls, springs and a curve for the joint and the joints below it.
pub fn tags(writer: &mut Writer, joint: &str) {
    spring_chain::controls(writer, joint);
    let feature = "Tail Curve";
    let points = "@command points role:control";
    writer
        .feature(joint, "spine", feature)
        .optional(feature, joint, "curve_root", "null", r#"(creation: (name: "tail_curve"))"#)
        .optional(
            feature,
            joint,
            "points",
            "control",
            r#"(at: "@hierarchy this pick:START,MIDDLE,END", parent: "@command curve_root", hierarchy: false, follow: false, shape: "diamond", relative_size: 0.5)"#,
        )
        .optional(
            feature,
            joint,
            "curve",
            "attribute",
            r#"(node: "@command fk role:control pick:START", name: "curve", min: 0.0, max: 1.0)"#,
        )
        .optional(
            feature,
            joint,
            "spline",
            "spline_ik",
            format!(
                r#"(start: "@command fk role:control pick:START", end: "@command fk role:control pick:END", points: "{points}", control: "@command fk role:control pick:START", weight: "curve")"#
            ),
        );
    // What swings does so on top of the curve.
    spring_chain::springs(writer, joint, "Tail Spring");
}
