//! `fk_chain`: a control for each joint of a chain.

use super::super::writer::{CENTER, Writer};

/// The part.
pub fn part() -> Writer {
    let mut writer = Writer::new("fk_chain", "part", "A chain of joints, each with a control: forward kinematics.");
    writer
        .group("chain", CENTER)
        .chain(
            "",
            &[
                ("chain_1", [0.0, 1.0, 0.0]),
                ("chain_2", [0.0, 1.2, 0.0]),
                ("chain_3", [0.0, 1.4, 0.0]),
                ("chain_4", [0.0, 1.6, 0.0]),
            ],
        )
        .orient();
    tags(&mut writer, &["chain_1", "chain_2", "chain_3", "chain_4"]);
    writer
}

/// The tags of a chain.
pub fn tags(writer: &mut Writer, joints: &[&str]) {
    let [first, ..] = joints else { return };
    let at = joints.iter().map(|joint| format!("@joint {joint}")).collect::<Vec<_>>().join(" + ");
    writer.feature(first, "fk", "fk");
    writer.optional("fk", first, "controls", "control", format!("(at: \"{at}\")"));
}
