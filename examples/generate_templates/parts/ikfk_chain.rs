//! `ikfk_chain`: a chain of any length that bends by its controls or reaches for a goal.

use super::{
    super::writer::{CENTER, Writer},
    Around, fk_chain, joints,
};

/// The part.
pub fn part() -> Writer {
    let about = "A chain of joints with forward and inverse kinematics and a switch between them.";
    let mut writer = Writer::new("ikfk_chain", "part", about);
    writer.group("chain", CENTER).chain("", &fk_chain::chain()).orient();
    let around = Around::make(&mut writer, "chain_1", "body");
    tags(&mut writer, &["chain_1", "chain_2", "chain_3", "chain_4", "chain_5"], &around);
    writer
}

/// The tags of a chain.
pub fn tags(writer: &mut Writer, chain: &[&str], around: &Around) {
    let [first, .., last] = chain else { return };
    let Around { root, .. } = around;
    writer.command(first, "fk", "control", format!("(at: \"{}\")", joints(chain)));
    writer.feature(last, "ik", "ik").switch(last, "ik", "ik", "space");
    writer.optional(
        "ik",
        last,
        "ik",
        "control",
        format!("(parent: \"{root}\", follow: false, shape: \"cube\", creation: (name: \"chain_ik\"))"),
    );
    writer.optional(
        "ik",
        last,
        "switch",
        "ik_fk_switch",
        format!(
            "(start: \"@joint {first}\", end: \"@this\", fk: \"@command fk role:control\", \
             goal: \"@command ik role:control\", solver: fabrik)"
        ),
    );
    writer.optional("ik:space", last, "spaces", "space_switch", around.switch("@command ik role:control", ""));
}
