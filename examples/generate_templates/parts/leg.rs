//! `leg`: thigh, shin, foot and toes, with a foot that rolls over heel, ball and toe.

use super::{
    super::writer::{LEFT, Writer},
    Around,
    arm::{halves, settings, twists},
    joints,
};

/// The part.
pub fn part() -> Writer {
    let about =
        "A left leg: forward and inverse kinematics with a switch, a foot that rolls, spaces, twist and stretch.";
    let mut writer = Writer::new("leg", "part", about);
    writer
        .group("leg_l", LEFT)
        .chain(
            "",
            &[
                ("thigh_l", [0.09, 0.925, -0.004]),
                ("shin_l", [0.112, 0.498, 0.004]),
                ("foot_l", [0.124, 0.08, -0.018]),
                ("toe_l", [0.1381, 0.018, 0.11326]),
            ],
        )
        .orient();
    let around = Around::make(&mut writer, "thigh_l", "hips");
    tags(&mut writer, &around);
    writer
}

/// The tags of a left leg.
pub fn tags(writer: &mut Writer, around: &Around) {
    let Around { root, .. } = around;
    let limb = joints(&["thigh_l", "shin_l", "foot_l"]);
    writer.command(
        "thigh_l",
        "fk",
        "control",
        format!("(at: \"{limb} + @joint toe_l\", creation: (name: \"leg_fk_l\"))"),
    );
    writer.feature("thigh_l", "space", "space").optional("space", "thigh_l", "fk_space", "space_switch", {
        let mut spaces = around.spaces.clone();
        // The hips first: that is how the leg was built.
        spaces.swap(0, 1);
        let upper = "@command fk role:control pick:START";
        Around { root: root.clone(), spaces }.switch(upper, ", translate: false")
    });

    let at = "foot_l";
    writer
        .feature(at, "ik", "ik")
        .switch(at, "ik", "ik", "foot_roll")
        .feature(at, "deform", "stretch")
        .switch(at, "ik", "ik", "space");
    writer.optional(
        "ik",
        at,
        "foot",
        "control",
        format!(
            "(parent: \"{root}\", axes: rig, follow: false, shape: \"foot\", relative_size: 1.0, shape_axes: rig, \
             creation: (name: \"foot_ik_l\"))"
        ),
    );
    writer.optional(
        "ik",
        at,
        "knee",
        "control",
        format!(
            "(at: \"@joint shin_l\", parent: \"{root}\", axes: rig, follow: false, shape: \"diamond\", \
             relative_size: 0.12, creation: (name: \"knee_l\"))"
        ),
    );
    writer.optional(
        "ik",
        at,
        "knee_place",
        "pole_vector",
        format!("(chain: \"{limb}\", pole: \"@command knee role:control\", prefer: (0.0, 0.0, 1.0))"),
    );
    settings(writer, at, "leg_settings_l");
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
        "goal",
        "null",
        "(parent: \"@command foot role:control\", creation: (name: \"foot_goal_l\"))",
    );
    writer.optional(
        "ik:foot_roll",
        at,
        "roll",
        "reverse_foot",
        "(ball: \"@joint toe_l\", control: \"@command foot role:control\", weight: \"ik_fk\", \
         weight_control: \"@command settings role:control\")",
    );
    // Where the pivots take the ankle, the goal goes along.
    let hung = "(at: \"@command goal\", parent: \"@command roll role:goal\", insert: true)";
    writer.optional("ik:foot_roll", at, "rolled", "null", hung);
    writer.optional(
        "ik",
        at,
        "switch",
        "ik_fk_switch",
        "(start: \"@joint thigh_l\", end: \"@this\", fk: \"@command fk role:control pick:0,1,2\", \
         goal: \"@command goal\", pole: \"@command knee role:control\", \
         control: \"@command settings role:control\", soft: \"soft\", stretch: \"stretch\", \
         prefer: Some((0.0, 0.0, 1.0)))",
    );
    writer.optional("ik:space", at, "foot_space", "space_switch", around.switch("@command foot role:control", ""));
    let knee = around.with(&[("foot", "@command foot role:control")]);
    writer.optional(
        "ik:space",
        at,
        "knee_space",
        "space_switch",
        knee.switch("@command knee role:control", ", rotate: false"),
    );
    twists(writer, at, ("thigh_l", "shin_l"), ("shin_l", "foot_l"));
    halves(writer, at, &[("thigh_l", 0.0), ("shin_l", 0.04)]);
}
