//! `arm`: shoulder, upper arm, forearm and hand.
//!
//! Forward controls carry one another; the hand's control and the elbow's are for inverse kinematics, and the settings
//! at the hand switch between the two.

use super::{
    super::writer::{LEFT, Writer},
    Around, joints,
};

/// The part.
pub fn part() -> Writer {
    let about = "A left arm: shoulder, forward and inverse kinematics with a switch, spaces, twist and stretch.";
    let mut writer = Writer::new("arm", "part", about);
    writer
        .group("arm_l", LEFT)
        .chain(
            "",
            &[
                ("clavicle_l", [0.026, 1.405, 0.01]),
                ("upper_arm_l", [0.171, 1.402, -0.016]),
                ("forearm_l", [0.36689, 1.19915, -0.016]),
                ("hand_l", [0.53517, 1.02489, 0.05346]),
            ],
        )
        .orient();
    let around = Around::make(&mut writer, "clavicle_l", "chest");
    tags(&mut writer, &around);
    writer
}

/// The tags of a left arm.
pub fn tags(writer: &mut Writer, around: &Around) {
    let Around { root, .. } = around;
    let limb = joints(&["upper_arm_l", "forearm_l", "hand_l"]);
    writer.command(
        "clavicle_l",
        "clavicle",
        "control",
        "(shape: \"half_circle\", relative_size: 0.6, creation: (name: \"shoulder_l\"))",
    );
    writer.command("upper_arm_l", "fk", "control", format!("(at: \"{limb}\", creation: (name: \"arm_fk_l\"))"));
    writer.feature("upper_arm_l", "space", "space").optional("space", "upper_arm_l", "fk_space", "space_switch", {
        let upper = "@command fk role:control pick:START";
        // The shoulder's own space first: that is how the arm was built.
        let own = [("shoulder", "@command clavicle role:control".to_owned())];
        let spaces = own.into_iter().chain(around.spaces.iter().cloned()).collect();
        Around { root: root.clone(), spaces }.switch(upper, ", translate: false")
    });

    let at = "hand_l";
    writer.feature(at, "ik", "ik").feature(at, "deform", "stretch").switch(at, "ik", "ik", "space");
    let cube = "follow: false, shape: \"cube\", relative_size: 0.5";
    writer.optional(
        "ik",
        at,
        "hand",
        "control",
        format!("(parent: \"{root}\", {cube}, creation: (name: \"hand_ik_l\"))"),
    );
    writer.optional(
        "ik",
        at,
        "elbow",
        "control",
        format!(
            "(at: \"@joint forearm_l\", parent: \"{root}\", axes: rig, follow: false, shape: \"diamond\", \
             relative_size: 0.12, creation: (name: \"elbow_l\"))"
        ),
    );
    writer.optional(
        "ik",
        at,
        "elbow_place",
        "pole_vector",
        format!("(chain: \"{limb}\", pole: \"@command elbow role:control\", prefer: (0.0, 0.0, -1.0))"),
    );
    settings(writer, at, "arm_settings_l");
    writer.optional(
        "stretch",
        at,
        "stretch",
        "attribute",
        "(node: \"@command settings role:control\", name: \"stretch\", min: Some(0.0), max: Some(1.0), default: 1.0)",
    );
    writer.optional(
        "ik",
        at,
        "switch",
        "ik_fk_switch",
        "(start: \"@joint upper_arm_l\", end: \"@this\", fk: \"@command fk role:control\", \
         goal: \"@command hand role:control\", pole: \"@command elbow role:control\", \
         control: \"@command settings role:control\", soft: \"soft\", stretch: \"stretch\", \
         prefer: Some((0.0, 0.0, -1.0)))",
    );
    writer.optional("ik:space", at, "hand_space", "space_switch", around.switch("@command hand role:control", ""));
    let elbow = around.with(&[("hand", "@command hand role:control")]);
    writer.optional(
        "ik:space",
        at,
        "elbow_space",
        "space_switch",
        elbow.switch("@command elbow role:control", ", rotate: false"),
    );
    twists(writer, at, ("upper_arm_l", "forearm_l"), ("forearm_l", "hand_l"));
    halves(writer, at, &[("upper_arm_l", 0.02), ("forearm_l", 0.03)]);
}

/// A control that carries the switches of a limb and goes with its end.
pub fn settings(writer: &mut Writer, at: &str, name: &str) {
    writer.command(
        at,
        "settings",
        "control",
        format!(
            "(parent: \"@this\", follow: false, offset_group: false, shape: \"cog\", relative_size: 0.8, \
             shape_axes: rig, shape_rotate: (90.0, 0.0, 0.0), channels: (translate: (false, false, false), \
             rotate: (false, false, false), scale: (false, false, false)), creation: (name: \"{name}\"))"
        ),
    );
}

/// Joints that turn by half of a limb's bends, so that skin keeps its volume there, in the feature `volume`. Each bend
/// has the length by which its joint moves outwards.
pub fn halves(writer: &mut Writer, at: &str, bends: &[(&str, f32)]) {
    writer.feature(at, "deform", "volume");
    for (bend, push) in bends {
        let name = format!("{}_half_l", bend.trim_end_matches("_l"));
        let push = if *push == 0.0 { String::new() } else { format!(" push: {push},") };
        writer.optional(
            "volume",
            at,
            &format!("{bend}_half"),
            "half_joint",
            format!("(at: \"@joint {bend}\",{push} creation: (name: \"{name}\"))"),
        );
    }
}

/// How many joints share the twist of a bone.
const TWISTS: usize = 4;

/// Joints that share the twist of the two bones of a limb, in the feature `twist`, with its switch `bend`.
pub fn twists(writer: &mut Writer, at: &str, upper: (&str, &str), lower: (&str, &str)) {
    let side = "_l";
    writer.feature(at, "deform", "twist").switch(at, "deform", "twist", "bend");
    let named = |bone: &str| format!("{}_twist{side}", bone.trim_end_matches(side));
    writer.optional(
        "twist",
        at,
        "upper_twist",
        "twist",
        format!(
            "(start: \"@joint {0}\", end: \"@joint {1}\", counter: true, count: {3}, creation: (name: \"{2}\"))",
            upper.0,
            upper.1,
            named(upper.0),
            TWISTS
        ),
    );
    writer.optional(
        "twist",
        at,
        "lower_twist",
        "twist",
        format!(
            "(start: \"@joint {0}\", end: \"@joint {1}\", count: {3}, creation: (name: \"{2}\"))",
            lower.0,
            lower.1,
            named(lower.0),
            TWISTS
        ),
    );
    // Small controls that bend the limb between its joints.

    for (bone, command, first) in [(upper.0, "upper_twist", 1), (lower.0, "lower_twist", 0)] {
        let name = format!("{}_bend{side}", bone.trim_end_matches(side));
        let places = (first..TWISTS).map(|place| place.to_string()).collect::<Vec<_>>().join(",");
        writer.optional(
            "twist:bend",
            at,
            &format!("{command}_bend"),
            "control",
            format!(
                "(at: \"@command {command} pick:{places}\", parent: \"@joint {bone}\", hierarchy: false, follow: false, \
                 relative_size: 0.15, creation: (name: \"{name}\"))"
            ),
        );
        for place in first..TWISTS {
            writer.optional(
                "twist:bend",
                at,
                &format!("{command}_bend_{place}"),
                "point",
                format!(
                    "(node: \"@command {command} pick:{place}\", \
                     targets: \"@command {command}_bend role:control pick:{}\")",
                    place - first
                ),
            );
        }
    }
}
