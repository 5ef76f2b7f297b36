//! `neck_head`: a neck and a head that can keep looking where it looks.

use super::{
    super::writer::{CENTER, Writer},
    Around,
};

/// The part.
pub fn part() -> Writer {
    let about = "A neck and a head that turns with the neck, the chest or the world.";
    let mut writer = Writer::new("neck_head", "part", about);
    writer.group("head", CENTER).chain("", &[("neck", [0.0, 1.46, -0.026]), ("head", [0.0, 1.5775, 0.004])]).orient();
    let around = Around::make(&mut writer, "neck", "chest");
    tags(&mut writer, &around);
    writer
}

/// The tags of a neck and a head.
pub fn tags(writer: &mut Writer, around: &Around) {
    writer.command("neck", "neck", "control", "(relative_size: 0.7, creation: (name: \"neck\"))");
    writer.command(
        "head",
        "head",
        "control",
        "(shape: \"square\", relative_size: 2.2, shape_axes: rig, creation: (name: \"head\"))",
    );
    writer.feature("head", "space", "space").optional("space", "head", "head_space", "space_switch", {
        let own = [("neck", "@command neck role:control".to_owned())];
        let spaces = own.into_iter().chain(around.spaces.iter().cloned()).collect();
        Around { root: around.root.clone(), spaces }.switch("@command head role:control", ", translate: false")
    });
}
