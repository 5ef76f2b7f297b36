//! `hand`: five fingers with controls, and numbers that curl and spread them.
//!
//! Finger joints bend about their X towards the palm, and spread about their Z; [`orient`] turns them so.

use bevy::math::{Mat3, Quat, Vec3};

use super::{
    super::writer::{LEFT, Writer},
    Around,
};

/// The fingers from the thumb on, and how far each turns aside when they spread, in degrees.
pub const FINGERS: [(&str, f32); 5] =
    [("thumb", 12.0), ("index", 12.0), ("middle", 3.0), ("ring", -6.0), ("pinky", -15.0)];

/// The part.
pub fn part() -> Writer {
    let about = "A left hand: a control for each joint of five fingers, curl and spread.";
    let mut writer = Writer::new("hand", "part", about);
    writer.group("hand_l", LEFT).joint("hand_l", "", [0.53517, 1.02489, 0.05346]);
    let places: [[[f32; 3]; 3]; 5] = [
        [[0.53446, 1.00777, 0.07751], [0.54278, 0.97361, 0.1056], [0.54965, 0.94219, 0.12176]],
        [[0.586, 0.96544, 0.10405], [0.60693, 0.93017, 0.11697], [0.6132, 0.90548, 0.12216]],
        [[0.59757, 0.963, 0.0844], [0.61968, 0.92286, 0.09485], [0.62459, 0.89348, 0.09839]],
        [[0.60015, 0.96395, 0.0624], [0.62039, 0.92553, 0.06951], [0.62337, 0.89778, 0.07173]],
        [[0.59789, 0.96635, 0.04126], [0.61375, 0.93644, 0.04437], [0.61584, 0.91657, 0.04536]],
    ];
    for ((finger, _), places) in FINGERS.iter().zip(places) {
        let mut above = "hand_l".to_owned();
        for (place, number) in places.into_iter().zip(1..) {
            let label = format!("{finger}_0{number}_l");
            writer.joint(&label, &above, place);
            above = label;
        }
    }
    writer.orient();
    orient(&mut writer, "_l");
    let around = Around::make(&mut writer, "hand_l", "arm");
    tags(&mut writer, &around.root);
    writer
}

/// Turns the joints of the fingers: Y along the bone, Z to the palm.
pub fn orient(writer: &mut Writer, side: &str) {
    let place = |writer: &Writer, label: &str| writer.rig().find_label(label).map(|joint| writer.rig().position(joint));
    let knuckle = |writer: &Writer, finger: &str| place(writer, &format!("{finger}_01{side}"));
    let (Some(hand), Some(index), Some(middle), Some(pinky)) = (
        place(writer, &format!("hand{side}")),
        knuckle(writer, "index"),
        knuckle(writer, "middle"),
        knuckle(writer, "pinky"),
    ) else {
        return;
    };
    let across = (index - pinky).normalize();
    let turned = if side == "_l" { 1.0 } else { -1.0 };
    let palm = (middle - hand).cross(across).normalize() * turned;
    for (finger, _) in FINGERS {
        // The thumb bends across the palm.
        let towards = if finger == "thumb" { (palm - across).normalize() } else { palm };
        let labels: Vec<String> = ["00", "01", "02", "03"].map(|number| format!("{finger}_{number}{side}")).into();
        let labels: Vec<&String> = labels.iter().filter(|label| writer.rig().find_label(label).is_some()).collect();
        let places: Vec<Vec3> = labels.iter().filter_map(|label| place(writer, label)).collect();
        let mut rotation = Quat::IDENTITY;
        for (at, label) in labels.into_iter().enumerate() {
            if let Some(next) = places.get(at + 1) {
                let along = (*next - places[at]).normalize();
                let front = towards.reject_from(along).normalize();
                rotation = Quat::from_mat3(&Mat3::from_cols(along.cross(front), along, front)).normalize();
            }
            writer.turn(label, rotation);
        }
    }
}

/// The tags of a left hand; `root` is what goals of fingertips stand on.
pub fn tags(writer: &mut Writer, root: &str) {
    let hand = "hand_l";
    writer.feature(hand, "hand", "fingers").switch(hand, "hand", "fingers", "curl");
    writer.optional(
        "fingers",
        hand,
        "pose",
        "control",
        "(parent: \"@this\", follow: false, offset_group: false, shape: \"hand\", relative_size: 1.2, \
         channels: (translate: (false, false, false), rotate: (false, false, false), scale: (false, false, false)), \
         creation: (name: \"fingers_l\"))",
    );
    for name in ["curl", "spread"] {
        writer.optional("fingers:curl", hand, name, "attribute", number("@command pose", name, -1.0));
    }
    for (finger, aside) in FINGERS {
        self::finger(writer, finger, aside, root);
    }
}

/// The tags of one finger, which spreads by `aside` degrees.
fn finger(writer: &mut Writer, finger: &str, aside: f32, root: &str) {
    let metacarpal = writer.rig().find_label(&format!("{finger}_00_l")).is_some();
    let joint = |number: u32| format!("{finger}_0{number}_l");
    let top = joint(if metacarpal { 0 } else { 1 });
    let alias = |what: &str| format!("{finger}_{what}");
    let (controls, master) = (alias("controls"), alias("master"));
    writer.optional(
        "fingers",
        &top,
        &controls,
        "control",
        format!("(at: \"@hierarchy this\", relative_size: 0.3, creation: (name: \"{finger}_l\"))"),
    );
    writer.optional(
        "fingers",
        &top,
        &master,
        "control",
        format!(
            "(at: \"@joint {}\", parent: \"@joint hand_l\", follow: false, shape: \"pin\", relative_size: 0.8, \
             shape_rotate: (90.0, 0.0, 0.0), creation: (name: \"{finger}_master_l\"))",
            joint(1)
        ),
    );
    let on_master = format!("@command {master} role:control");
    writer.optional("fingers:curl", &top, &alias("curl"), "attribute", number(&on_master, "curl", -1.0));
    // A thumb bends less, and not at its root.
    let (first, angle) = if finger == "thumb" { (1, 55.0) } else { (0, 85.0) };
    let bent: Vec<String> = (first..3).map(|number| (number + usize::from(metacarpal)).to_string()).collect();
    writer.optional(
        "fingers:curl",
        &top,
        &alias("bend"),
        "expression",
        format!(
            "(text: \"{angle:.1} * clamp(all + own, -0.3, 1.2)\", inputs: [\
             (name: \"all\", node: \"@command pose\", attribute: \"curl\"), \
             (name: \"own\", node: \"{on_master}\", attribute: \"curl\")], \
             output: \"@command {controls} role:offset pick:{}\", output_channel: Some(RotateX))",
            bent.join(",")
        ),
    );
    writer.optional(
        "fingers:curl",
        &top,
        &alias("spread"),
        "driven_key",
        format!(
            "(driver: \"@command pose\", driver_attribute: \"spread\", keys: [(-1.0, {:.1}), (1.0, {aside:.1})], \
             ease: Linear, output: \"@command {controls} role:offset pick:{}\", output_channel: Some(RotateZ))",
            -aside,
            usize::from(metacarpal)
        ),
    );
    // Fingertips that stay on what they touch.
    let tip = joint(3);
    writer.switch("hand_l", "hand", "fingers", &alias("tip"));
    let switch = format!("fingers:{}", alias("tip"));
    writer.optional(
        &switch,
        &tip,
        &alias("goal"),
        "control",
        format!(
            "(parent: \"{root}\", follow: false, shape: \"sphere\", relative_size: 0.35, \
             creation: (name: \"{finger}_tip_l\"))"
        ),
    );
    writer.optional(&switch, &tip, &alias("ik"), "attribute", number(&on_master, "ik", 0.0));
    writer.optional(
        &switch,
        &tip,
        &alias("reach"),
        "ik_handle",
        format!(
            "(start: \"@joint {}\", end: \"@this\", goal: \"@command {} role:control\", control: \"{on_master}\", \
             weight: \"ik\")",
            joint(1),
            alias("goal")
        ),
    );
}

/// Parameters of a number from `min` to 1.
fn number(node: &str, name: &str, min: f32) -> String {
    format!("(node: \"{node}\", name: \"{name}\", min: Some({min:.1}), max: Some(1.0))")
}
