//! What animals have in common: a main control, a trunk, legs of two bones.

use super::super::writer::Writer;

/// A control on the ground that carries everything, and one for the root joint. Others name it `@command main role:control`.
pub fn main(writer: &mut Writer, root: &str, size: f32) {
    let [x, y, z] = place(writer, root);
    writer
        .command(
            root,
            "origin",
            "null",
            format!("(world: true, orient: false, translate: ({:?}, {:?}, {:?}), creation: (name: \"origin\"))", -x, -y, -z),
        )
        .command(
            root,
            "main",
            "control",
            format!(
                "(at: \"@command origin\", parent: \"@command origin\", offset_group: false, follow: false, \
                 shape: \"four_arrows\", size: {size:?}, shape_axes: rig, creation: (name: \"main\"))"
            ),
        )
        .command(
            root,
            "body",
            "control",
            format!(
                "(parent: \"@command main role:control\", shape: \"square\", size: {:?}, shape_axes: rig, creation: (name: \"body\"))",
                size * 0.5
            ),
        );
}

/// What follows the main control.
pub const MAIN: &str = "@command main role:control";

/// A control for each joint of a chain that stays where it is, such as the trunk; the alias of the command is `alias`.
pub fn chain(writer: &mut Writer, alias: &str, joints: &[&str], size: f32) {
    let Some(first) = joints.first() else { return };
    let at: Vec<String> = joints.iter().map(|joint| format!("@joint {joint}")).collect();
    writer.command(first, alias, "control", format!("(at: \"{}\", shape: \"circle\", size: {size:?})", at.join(" + ")));
}

/// A limb of two bones with its foot, by IK and FK; all of it in a feature.
pub fn limb(writer: &mut Writer, [upper, lower, end]: [&str; 3], feature: &str, size: f32) {
    let goal = "@command goal role:control";
    writer
        .feature(upper, "limb", feature)
        .optional(
            feature,
            upper,
            "fk",
            "control",
            format!("(at: \"@joint {upper} + @joint {lower} + @joint {end}\", follow: false, shape: \"circle\", size: {size:?})"),
        )
        .optional(
            feature,
            upper,
            "goal",
            "control",
            format!(
                "(at: \"@joint {end}\", parent: \"{MAIN}\", axes: rig, follow: false, shape: \"cube\", size: {size:?}, \
                 shape_axes: rig)"
            ),
        )
        .optional(
            feature,
            upper,
            "pole",
            "control",
            format!(
                "(at: \"@joint {lower}\", parent: \"{MAIN}\", axes: rig, follow: false, shape: \"diamond\", size: {:?}, \
                 shape_axes: control, channels: (rotate: (false, false, false), scale: (false, false, false)))",
                size * 0.5
            ),
        )
        .optional(
            feature,
            upper,
            "pole_place",
            "pole_vector",
            format!(
                "(chain: \"@joint {upper} + @joint {lower} + @joint {end}\", pole: \"@command pole role:control\", \
                 targets: \"{goal}\", control: \"{goal}\", weight: \"pole_follow\")"
            ),
        )
        .optional(
            feature,
            upper,
            "reach",
            "ik_fk_switch",
            format!(
                "(end: \"@joint {end}\", fk: \"@command fk role:control\", goal: \"{goal}\", attribute: \"ik_fk\", \
                 pole: \"@command pole role:control\")"
            ),
        );
}

/// Where a joint is.
fn place(writer: &Writer, label: &str) -> [f32; 3] {
    let joint = writer.rig().find_label(label);
    joint.map_or([0.0; 3], |joint| writer.rig().position(joint).to_array())
}
