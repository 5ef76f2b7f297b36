//! `fk_chain`: a control for each joint of a chain.

use super::{
    super::writer::{CENTER, Writer},
    joints,
};

/// The part.
pub fn part() -> Writer {
    let mut writer = Writer::new("fk_chain", "part", "A chain of joints, each with a control: forward kinematics.");
    writer.group("chain", CENTER).chain("", &chain()).orient();
    tags(&mut writer, &["chain_1", "chain_2", "chain_3", "chain_4", "chain_5"]);
    writer
}

/// A chain of five joints that goes up and leans a little to the front in the middle.
pub fn chain() -> [(&'static str, [f32; 3]); 5] {
    [
        ("chain_1", [0.0, 1.0, 0.0]),
        ("chain_2", [0.0, 1.2, 0.02]),
        ("chain_3", [0.0, 1.4, 0.03]),
        ("chain_4", [0.0, 1.6, 0.02]),
        ("chain_5", [0.0, 1.8, 0.0]),
    ]
}

/// The tags of a chain.
pub fn tags(writer: &mut Writer, chain: &[&str]) {
    let [first, ..] = chain else { return };
    writer.feature(first, "fk", "fk");
    writer.optional("fk", first, "controls", "control", format!("(at: \"{}\", size: None)", joints(chain)));
}
