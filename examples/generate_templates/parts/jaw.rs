//! A jaw or the lower half of a beak.

use super::super::writer::{CENTER, Writer};

/// The part alone.
pub fn part() -> Writer {
    let about = "A jaw that opens by an attribute from 0 to 1, with a control for the rest.";
    let mut writer = Writer::new("jaw", "part", about);
    writer.group("jaw", CENTER).chain("", &[("jaw", [0.0, 1.55, 0.02]), ("jaw_tip", [0.0, 1.52, 0.10])]).orient();
    writer.part("jaw", |writer| tags(writer, "jaw", 28.0));
    writer
}

/// A control, and an attribute that opens the jaw by up to so many degrees. The bone points forwards: turning about X
/// against its front lowers it.
pub fn tags(writer: &mut Writer, joint: &str, open: f32) {
    let limits = format!("(rotate: ((-{open:?}, 5.0), (-12.0, 12.0), (-8.0, 8.0)))");
    writer
        .command(
            joint,
            "control",
            "control",
            format!("(shape: \"half_circle\", relative_size: 0.6, channels: (scale: (false, false, false)), limits: {limits})"),
        )
        .command(
            joint,
            "open",
            "attribute",
            r#"(node: "@command control role:control", name: "open", min: 0.0, max: 1.0)"#,
        )
        .command(
            joint,
            "opening",
            "driven_key",
            format!(
                "(driver: \"@command control role:control\", driver_attribute: \"open\", keys: [(0.0, 0.0), (1.0, -{open:?})], \
                 ease: Linear, output: \"@command control role:offset\", output_channel: RotateX)"
            ),
        )
        // The two together go no further than a jaw does.
        .command(joint, "stop", "limit", format!("(limits: {limits})"));
}
