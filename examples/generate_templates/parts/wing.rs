//! A wing: arm and hand with IK and FK, and feathers that fold with it and fan out.

use std::f32::consts::FRAC_PI_2;

use bevy::math::{Quat, Vec3};

use super::super::writer::{LEFT, Writer};

/// Labels of the arm's joints, without their side.
pub const ARM: [&str; 3] = ["wing_1", "wing_2", "wing_3"];
/// Label of each feather without its side, the joint of the arm that carries it, its place along that bone (0 to 1),
/// its direction in degrees from straight out to the front, and its turn when the wing is folded.
const FEATHERS: [(&str, usize, f32, f32, f32); 6] = [
    ("feather_1", 1, 0.25, -86.0, -74.0),
    ("feather_2", 1, 0.60, -82.0, -76.0),
    ("feather_3", 1, 0.95, -76.0, -78.0),
    ("feather_4", 2, 0.35, -62.0, 44.0),
    ("feather_5", 2, 0.70, -40.0, 24.0),
    ("feather_6", 2, 1.00, -16.0, 2.0),
];
/// Turns of the arm's joints when the wing is folded, in degrees.
const FOLD: [f32; 3] = [-62.0, 127.0, -139.0];

/// The part alone.
pub fn part() -> Writer {
    let about = "A wing with IK and FK that folds by an attribute, with feathers that fold and fan.";
    let mut writer = Writer::new("wing", "part", about);
    writer.group("wing_l", LEFT);
    joints(&mut writer, "", [0.06, 0.42, 0.06], "_l");
    turn(&mut writer, "_l");
    writer.command("wing_1_l", "space", "null", r#"(parent: "@root", orient: false, creation: (name: "wing_space"))"#);
    writer.part("wing", |writer| tags(writer, "_l", "@command space"));
    writer
}

/// The bones of the arm of a left wing, from joint to joint and to the tip.
const BONES: [[f32; 3]; 3] = [[0.18, 0.01, -0.06], [0.24, 0.01, 0.04], [0.20, 0.0, -0.04]];

/// The joints of a wing, spread to its side; [`turn`] gives them their axes.
pub fn joints(writer: &mut Writer, parent: &str, shoulder: [f32; 3], side: &str) {
    let mut place = Vec3::from(shoulder);
    let mut above = parent.to_owned();
    for (number, label) in ARM.iter().enumerate() {
        let label = format!("{label}{side}");
        writer.joint(&label, &above, place.to_array());
        above = label;
        let bone = Vec3::from(BONES[number]) * Vec3::new(out(side), 1.0, 1.0);
        for (feather, _, share, ..) in FEATHERS.iter().filter(|feather| feather.1 == number) {
            writer.joint(&format!("{feather}{side}"), &above, (place + bone * *share).to_array());
        }
        place += bone;
    }
}

/// Turns the joints of a wing: Y along arm and feathers, and X down, so that turning about X opens and folds.
pub fn turn(writer: &mut Writer, side: &str) {
    for (label, [x, _, z]) in ARM.iter().zip(BONES) {
        writer.turn(&format!("{label}{side}"), along(bevy::math::ops::atan2(z, x), out(side)));
    }
    for (feather, _, _, angle, _) in FEATHERS {
        writer.turn(&format!("{feather}{side}"), along(angle.to_radians(), out(side)));
    }
}

/// To which side a wing goes along X.
fn out(side: &str) -> f32 {
    if side == "_r" { -1.0 } else { 1.0 }
}

/// The turn of a bone of the left wing that goes at an angle from straight out to the front, and its mirror image for
/// -1: then the same angle about X is the same move on both sides.
fn along(angle: f32, out: f32) -> Quat {
    let about = |axis: Vec3, angle: f32| {
        let (sin, cos) = bevy::math::ops::sin_cos(angle * 0.5);
        Quat::from_xyzw(axis.x * sin, axis.y * sin, axis.z * sin, cos)
    };
    let turned = (about(Vec3::Y, -angle) * about(Vec3::Z, -FRAC_PI_2)).normalize();
    Quat::from_xyzw(turned.x, turned.y * out, turned.z * out, turned.w)
}

/// Controls, solvers and folding for the joints of [`joints`]; the control of the hand stands on `space`.
pub fn tags(writer: &mut Writer, side: &str, space: &str) {
    let [arm, forearm, hand] = ARM.map(|label| format!("{label}{side}"));
    let (arm, forearm, hand) = (arm.as_str(), forearm.as_str(), hand.as_str());
    let first = "@command fk role:control pick:START";
    writer
        .command(
            arm,
            "fk",
            "control",
            format!(r#"(at: "@joint {arm} + @joint {forearm} + @joint {hand}", follow: false, shape: "circle", relative_size: 0.25)"#),
        )
        .command(
            arm,
            "hand",
            "control",
            format!(
                r#"(at: "@joint {hand}", parent: "{space}", axes: rig, follow: false, shape: "cube", relative_size: 0.25, shape_axes: rig)"#
            ),
        )
        .command(
            arm,
            "reach",
            "ik_fk_switch",
            format!(
                r#"(end: "@joint {hand}", fk: "@command fk role:control", goal: "@command hand role:control", attribute: "ik_fk", default: 0.0, twist: "elbow_twist")"#
            ),
        )
        .feature(arm, "limb", "Fold")
        .optional("Fold", arm, "fold", "attribute", format!(r#"(node: "{first}", name: "fold", min: 0.0, max: 1.0)"#))
        .optional("Fold", arm, "fan", "attribute", format!(r#"(node: "{first}", name: "fan", min: -1.0, max: 1.0)"#));
    for (feather, ..) in FEATHERS {
        let at = format!("@joint {feather}{side}");
        writer.command(arm, feather, "control", format!(r#"(at: "{at}", shape: "pin", size: 0.05)"#));
    }
    for (place, angle) in FOLD.iter().enumerate() {
        writer.optional(
            "Fold",
            arm,
            &format!("fold_{}", place + 1),
            "driven_key",
            format!(
                r#"(driver: "{first}", driver_attribute: "fold", keys: [(0.0, 0.0), (1.0, {angle:?})], ease: Linear, output: "@command fk role:offset pick:{place}", output_channel: RotateX)"#
            ),
        );
    }
    for (place, (feather, _, _, _, angle)) in FEATHERS.iter().enumerate() {
        // Apart from the middle of the fan, by up to 10 degrees from one to the next.
        let spread = 10.0 * (place as f32 - 2.5);
        writer.optional(
            "Fold",
            arm,
            &format!("fold_{feather}"),
            "expression",
            format!(
                r#"(text: "fold * {angle:?} + fan * (1 - fold) * {spread:?}", inputs: [(name: "fold", node: "{first}", attribute: "fold"), (name: "fan", node: "{first}", attribute: "fan")], output: "@command {feather} role:offset", output_channel: RotateX)"#
            ),
        );
    }
}
