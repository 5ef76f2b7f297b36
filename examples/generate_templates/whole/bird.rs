//! A bird of the size of an eagle, wings spread.

use super::{
    super::{
        parts::{eye, jaw, leg_3joint, wing},
        writer::{CENTER, Failure, LEFT, RIGHT, Writer},
    },
    creature::{MAIN, chain, main},
};

/// The character.
pub fn bird() -> Result<Writer, Failure> {
    let about = "A bird of an eagle's size: wings that fold and fan, legs with IK and FK, neck, beak, eyes that look.";
    let mut writer = Writer::new("bird", "character", about);
    joints(&mut writer);
    writer.orient().pair();
    for side in ["_l", "_r"] {
        eye::forwards(&mut writer, &format!("eye{side}"));
        wing::turn(&mut writer, side);
    }
    let w = &mut writer;
    main(w, "hips", 0.35);
    chain(w, "trunk", &["chest"], 0.12);
    chain(w, "neck", &["neck_1", "neck_2", "neck_3", "head"], 0.06);
    w.part("beak", |w| jaw::tags(w, "beak", 25.0));
    w.part("tail", |w| chain(w, "fk", &["tail", "tail_fan", "tail_fan_l", "tail_fan_r"], 0.05));
    for side in ["_l", "_r"] {
        let name = |label: &str| format!("{label}{side}");
        w.part(&format!("eye{side}"), |w| {
            let ahead = if side == "_l" { [0.2, 0.0, 0.3] } else { [-0.2, 0.0, 0.3] };
            eye::tags(w, &name("eye"), "@command neck role:control pick:END", ahead);
        });
        w.part(&format!("wing{side}"), |w| wing::tags(w, side, MAIN));
        w.part(&format!("leg{side}"), |w| {
            leg_3joint::tags(w, [&name("thigh"), &name("shin"), &name("metatarsus"), &name("foot")], MAIN);
        });
        w.part(&format!("toes{side}"), |w| {
            chain(w, "fk", &[&name("toe_middle"), &name("toe_inner"), &name("toe_outer"), &name("toe_back")], 0.02);
        });
    }
    Ok(writer)
}

fn joints(w: &mut Writer) {
    w.group("body", CENTER).chain("", &[("hips", [0.0, 0.36, -0.12]), ("chest", [0.0, 0.40, 0.03])]);
    w.group("head", CENTER).chain(
        "chest",
        &[
            ("neck_1", [0.0, 0.44, 0.13]),
            ("neck_2", [0.0, 0.50, 0.17]),
            ("neck_3", [0.0, 0.56, 0.19]),
            ("head", [0.0, 0.61, 0.22]),
        ],
    );
    w.chain("head", &[("beak", [0.0, 0.60, 0.26]), ("beak_tip", [0.0, 0.585, 0.32])]);
    w.group("tail", CENTER).chain("hips", &[("tail", [0.0, 0.35, -0.20]), ("tail_fan", [0.0, 0.34, -0.26])]);
    for (side, out, color) in [("_l", 1.0, LEFT), ("_r", -1.0, RIGHT)] {
        let mut hang = |group: &str, parent: &str, names: &[(&str, [f32; 3])]| {
            let named: Vec<(String, [f32; 3])> =
                names.iter().map(|(name, [x, y, z])| (format!("{name}{side}"), [x * out, *y, *z])).collect();
            let list: Vec<(&str, [f32; 3])> = named.iter().map(|(name, place)| (name.as_str(), *place)).collect();
            w.group(&format!("{group}{side}"), color).chain(parent, &list);
        };
        hang("face", "head", &[("eye", [0.028, 0.63, 0.245])]);
        hang("tail", "tail", &[("tail_fan", [0.03, 0.34, -0.25])]);
        hang(
            "leg",
            "hips",
            &[
                ("thigh", [0.05, 0.33, -0.08]),
                ("shin", [0.05, 0.24, 0.0]),
                ("metatarsus", [0.05, 0.13, -0.08]),
                ("foot", [0.05, 0.03, -0.03]),
            ],
        );
        let foot = format!("foot{side}");
        for (toe, place) in [
            ("toe_middle", [0.05, 0.012, 0.01]),
            ("toe_inner", [0.035, 0.012, 0.0]),
            ("toe_outer", [0.065, 0.012, 0.0]),
            ("toe_back", [0.05, 0.012, -0.06]),
        ] {
            hang("leg", &foot, &[(toe, place)]);
        }
        w.group(&format!("wing{side}"), color);
        wing::joints(w, "chest", [0.06 * out, 0.43, 0.07], side);
    }
}
