//! One joint that one control moves: a prop, a hat, a door.

use super::super::writer::{CENTER, Writer};

/// The part alone.
pub fn part() -> Writer {
    let mut writer = Writer::new("single_control", "part", "One joint with one control: props, ears, doors.");
    writer.group("control", CENTER).joint("control", "", [0.0, 0.5, 0.0]);
    writer.part("single", |writer| tags(writer, "control", "cube"));
    writer
}

/// A control that the joint follows in place, turn and scale.
pub fn tags(writer: &mut Writer, joint: &str, shape: &str) {
    writer.command(
        joint,
        "control",
        "control",
        format!("(follow_scale: true, shape: \"{shape}\", relative_size: 0.6)"),
    );
}
