//! A hind leg: thigh, shin, metatarsus and foot.
//!
//! Two stages of two bones each, so that nothing is left to chance: a hidden leg of nulls from hip to foot bends at the
//! knee as the foot moves; the metatarsus leans on the foot by a share of the hidden thigh's turn, as tendons make it do
//! in animals; and thigh and shin reach for its upper end. Knee and hock bend in the senses in which they were built.

use super::super::writer::{LEFT, Writer};

/// The part alone.
pub fn part() -> Writer {
    let about = "A hind leg with IK and FK: the knee bends forwards, the hock back; a control for the hock.";
    let mut writer = Writer::new("leg_3joint", "part", about);
    let chain = [
        ("thigh_l", [0.06, 0.48, -0.22]),
        ("shin_l", [0.06, 0.29, -0.13]),
        ("metatarsus_l", [0.06, 0.17, -0.28]),
        ("foot_l", [0.06, 0.03, -0.24]),
    ];
    writer.group("leg_l", LEFT).chain("", &chain).orient();
    writer.command("thigh_l", "space", "null", r#"(parent: "@root", orient: false, creation: (name: "leg_space"))"#);
    writer.part("leg", |writer| tags(writer, ["thigh_l", "shin_l", "metatarsus_l", "foot_l"], "@command space"));
    writer
}

/// Controls and solvers for the four joints; the foot's control stands on `space`.
pub fn tags(writer: &mut Writer, [thigh, shin, metatarsus, foot]: [&str; 4], space: &str) {
    let goal = "@command foot role:control";
    let ik = "Leg";
    writer
        .feature(thigh, "limb", ik)
        .optional(
            ik,
            thigh,
            "fk",
            "control",
            format!(
                r#"(at: "@joint {thigh} + @joint {shin} + @joint {metatarsus}", follow: false, shape: "circle", relative_size: 0.3)"#
            ),
        )
        .optional(
            ik,
            thigh,
            "fk_foot",
            "control",
            format!(
                r#"(at: "@joint {foot}", parent: "@command fk role:control pick:END", follow: false, shape: "circle", relative_size: 0.3)"#
            ),
        )
        .optional(
            ik,
            thigh,
            "foot",
            "control",
            format!(
                r#"(at: "@joint {foot}", parent: "{space}", axes: rig, follow: false, shape: "foot", relative_size: 0.6, shape_axes: rig)"#
            ),
        )
        .optional(
            ik,
            thigh,
            "pole",
            "control",
            format!(
                r#"(at: "@joint {shin}", parent: "{space}", axes: rig, follow: false, shape: "diamond", relative_size: 0.2, channels: (rotate: (false, false, false), scale: (false, false, false)))"#
            ),
        )
        .optional(
            ik,
            thigh,
            "pole_place",
            "pole_vector",
            format!(
                r#"(chain: "@joint {thigh} + @joint {shin} + @joint {foot}", pole: "@command pole role:control", distance: 0.5, targets: "{goal}", control: "{goal}", weight: "knee_follow")"#
            ),
        )
        // The hidden leg.
        .optional(ik, thigh, "hip", "null", format!(r#"(at: "@joint {thigh}", creation: (name: "hip_driver"))"#))
        .optional(
            ik,
            thigh,
            "knee",
            "null",
            format!(r#"(at: "@joint {shin}", parent: "@command hip", creation: (name: "knee_driver"))"#),
        )
        .optional(
            ik,
            thigh,
            "ankle",
            "null",
            format!(r#"(at: "@joint {foot}", parent: "@command knee", creation: (name: "foot_driver"))"#),
        )
        .optional(
            ik,
            thigh,
            "driver",
            "ik_handle",
            format!(
                r#"(start: "@command hip", end: "@command ankle", goal: "{goal}", pole: "@command pole role:control", orient_end: false)"#
            ),
        )
        // The metatarsus stands on the foot and leans with the thigh.
        .optional(
            ik,
            thigh,
            "lean_share",
            "attribute",
            format!(r#"(node: "{goal}", name: "hock_follow", min: 0.0, max: 1.0, default: 1.0)"#),
        )
        .optional(
            ik,
            thigh,
            "lean",
            "null",
            format!(r#"(at: "@joint {foot}", parent: "{goal}", creation: (name: "hock_lean"))"#),
        )
        .optional(
            ik,
            thigh,
            "leaning",
            "orient",
            format!(
                r#"(node: "@command lean", targets: "{goal} + @command hip", weights: [1.0, "hock_follow"], control: "{goal}")"#
            ),
        )
        .optional(
            ik,
            thigh,
            "hock",
            "control",
            r#"(at: "@command lean", parent: "@command lean", offset_group: false, follow: false, shape: "ring_arrows", relative_size: 0.5, shape_axes: control, channels: (translate: (false, false, false), scale: (false, false, false)))"#.to_owned(),
        )
        .optional(
            ik,
            thigh,
            "goal",
            "null",
            format!(
                r#"(at: "@joint {metatarsus}", parent: "@command hock role:control", creation: (name: "hock_goal"))"#
            ),
        )
        // Thigh and shin bend in their own plane, which turns with the hidden thigh.
        .optional(
            ik,
            thigh,
            "plane",
            "pole_vector",
            format!(
                r#"(chain: "@joint {thigh} + @joint {shin} + @joint {metatarsus}", parent: "@command hip", creation: (name: "knee_plane"))"#
            ),
        )
        .optional(
            ik,
            thigh,
            "reach",
            "ik_fk_switch",
            format!(
                r#"(end: "@joint {metatarsus}", fk: "@command fk role:control ", goal: "@command goal", pole: "@command plane", control: "{goal}", attribute: "ik_fk")"#
            ),
        )
        .optional(
            ik,
            thigh,
            "fk_sole",
            "orient",
            format!(r#"(node: "@joint {foot}", targets: "@command fk_foot role:control")"#),
        )
        .optional(
            ik,
            thigh,
            "sole",
            "orient",
            format!(r#"(node: "@joint {foot}", targets: "{goal}", control: "{goal}", weight: "ik_fk")"#),
        );
}
