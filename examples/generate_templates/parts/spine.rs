//! `spine`: hips, two joints between and the chest.
//!
//! Forward controls carry one another from the hips up. A curve through the hips, the waist and the chest lays the
//! joints between, so that the spine reaches wherever the chest's control goes.

use super::{
    super::writer::{CENTER, Writer},
    Around, joints,
};

/// The part.
pub fn part() -> Writer {
    let about = "Hips, spine and chest: forward kinematics, and a curve from the hips to the chest.";
    let mut writer = Writer::new("spine", "part", about);
    writer
        .group("spine", CENTER)
        .chain(
            "",
            &[
                ("hips", [0.0, 0.955, -0.006]),
                ("spine", [0.0, 1.05, 0.004]),
                ("spine_1", [0.0, 1.155, 0.004]),
                ("chest", [0.0, 1.27, -0.006]),
                ("chest_end", [0.0, 1.46, -0.026]),
            ],
        )
        .orient();
    let around = Around::make(&mut writer, "hips", "body");
    tags(&mut writer, &around);
    writer
}

/// The tags of a spine.
pub fn tags(writer: &mut Writer, around: &Around) {
    let Around { root, .. } = around;
    writer.command(
        "hips",
        "torso",
        "control",
        format!(
            "(parent: \"{root}\", axes: rig, follow: false, shape: \"square\", relative_size: 2.6, shape_axes: rig, \
             creation: (name: \"torso\"))"
        ),
    );
    writer.command(
        "hips",
        "hips",
        "control",
        "(parent: \"@command torso role:control\", relative_size: 1.8, creation: (name: \"hips\"))",
    );
    let fk = joints(&["spine", "spine_1", "chest"]);
    writer.command(
        "spine",
        "fk",
        "control",
        format!(
            "(at: \"{fk}\", parent: \"@command torso role:control\", relative_size: 1.3, creation: (name: \"spine_fk\"))"
        ),
    );
    let at = "chest";
    writer.feature(at, "ik", "ik").switch(at, "ik", "ik", "stretch");
    writer.optional(
        "ik",
        at,
        "base",
        "null",
        "(at: \"@joint spine\", parent: \"@command hips role:control\", creation: (name: \"spine_base\"))",
    );
    writer.optional(
        "ik",
        at,
        "waist",
        "control",
        "(at: \"@joint spine_1\", parent: \"@command fk role:control pick:1\", follow: false, shape: \"ring_arrows\", \
         relative_size: 1.1, creation: (name: \"waist\"))",
    );
    writer.optional(
        "ik",
        at,
        "chest",
        "control",
        "(parent: \"@command fk role:control pick:2\", follow: false, shape: \"cube\", relative_size: 0.7, \
         shape_scale: (1.0, 0.3, 1.0), creation: (name: \"chest_ik\"))",
    );
    writer.optional(
        "ik:stretch",
        at,
        "stretch",
        "attribute",
        "(node: \"@command chest role:control\", name: \"stretch\", min: Some(0.0), max: Some(1.0), default: 1.0)",
    );
    writer.optional(
        "ik",
        at,
        "curve",
        "spline_ik",
        "(start: \"@joint spine\", end: \"@this\", points: \"@command base + @command waist role:control + \
         @command chest role:control\", control: \"@command chest role:control\", stretch: \"stretch\")",
    );
    writer.optional("ik", at, "chest_turn", "orient", "(targets: \"@command chest role:control\")");
}
