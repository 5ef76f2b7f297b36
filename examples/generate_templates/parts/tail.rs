//! A tail: a control a joint, a curve through three controls, and lag.

use super::super::writer::{CENTER, Writer};
use super::spring_chain;

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
    writer.group("tail", CENTER).chain("", &chain).orient();
    writer.part("tail", |writer| tags(writer, "tail_1"));
    writer
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
