//! A chain that hangs, swings and settles: hair, an ear, an antenna.

use super::super::writer::{CENTER, Writer};

/// The part alone.
pub fn part() -> Writer {
    let about =
        "A chain of any length with a control a joint, which lags behind, swings and settles: hair, ears, antennas.";
    let mut writer = Writer::new("spring_chain", "part", about);
    let places: Vec<(String, [f32; 3])> =
        (0..5).map(|n| (format!("chain_{}", n + 1), [0.0, 1.0 - 0.1 * n as f32, -0.01 * (n * n) as f32])).collect();
    let chain: Vec<(&str, [f32; 3])> = places.iter().map(|(label, place)| (label.as_str(), *place)).collect();
    writer.group("chain", CENTER).chain("", &chain).orient();
    writer.part("chain", |writer| {
        controls(writer, "chain_1");
        springs(writer, "chain_1", "Spring");
    });
    writer
}

/// A control for the joint and each joint below it, each directly below the one before, so that they are a chain that
/// solvers and springs can drive.
pub fn controls(writer: &mut Writer, joint: &str) {
    writer.command(joint, "fk", "control", r#"(at: "@hierarchy this", offset_group: false, shape: "circle")"#);
}

/// Springs on those controls, not on the joints: so each carries those after it along.
pub fn springs(writer: &mut Writer, joint: &str, feature: &str) {
    let first = "@command fk role:control pick:START";
    let attribute = |name: &str, [min, max]: [f32; 2], default: f32| {
        format!(r#"(node: "{first}", name: "{name}", min: {min:?}, max: {max:?}, default: {default:?})"#)
    };
    writer
        .feature(joint, "dynamics", feature)
        .optional(feature, joint, "swing", "attribute", attribute("swing", [0.0, 1.0], 1.0))
        .optional(feature, joint, "frequency", "attribute", attribute("frequency", [0.1, 20.0], 2.0))
        .optional(feature, joint, "damping", "attribute", attribute("damping", [0.0, 2.0], 0.35))
        .optional(
            feature,
            joint,
            "spring",
            "spring",
            format!(
                r#"(nodes: "@command fk role:control", control: "{first}", frequency: "frequency", damping: "damping", weight: "swing")"#
            ),
        );
}
