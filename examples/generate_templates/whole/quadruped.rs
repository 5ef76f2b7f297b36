//! A four-legged animal of the size of a fox.

use super::{
    super::{
        parts::{eye, jaw, leg_3joint, single_control, tail},
        writer::{CENTER, Failure, LEFT, RIGHT, Writer},
    },
    creature::{MAIN, chain, limb, main},
};

/// The character.
pub fn quadruped() -> Result<Writer, Failure> {
    let about = "A four-legged animal of a fox's size: IK and FK on all legs, springy tail, jaw, eyes that look.";
    let mut writer = Writer::new("quadruped", "character", about);
    joints(&mut writer);
    writer.orient().pair();
    for eye in ["eye_l", "eye_r"] {
        eye::forwards(&mut writer, eye);
    }
    tail::turn(&mut writer, &["tail_1", "tail_2", "tail_3", "tail_4", "tail_5", "tail_6"]);
    let w = &mut writer;
    main(w, "hips", 0.35);
    chain(w, "trunk", &["spine_1", "spine_2", "chest"], 0.11);
    chain(w, "neck", &["neck", "head"], 0.08);
    w.part("jaw", |w| jaw::tags(w, "jaw", 30.0));
    w.part("tail", |w| tail::tags(w, "tail_1"));
    for side in ["_l", "_r"] {
        let name = |label: &str| format!("{label}{side}");
        w.part(&format!("eye{side}"), |w| {
            eye::tags(w, &name("eye"), "@command neck role:control pick:END", [0.0, 0.0, 0.4])
        });
        w.part(&format!("ear{side}"), |w| single_control::tags(w, &name("ear"), "pin"));
        w.part(&format!("shoulder{side}"), |w| single_control::tags(w, &name("scapula"), "half_circle"));
        w.part(&format!("front{side}"), |w| {
            limb(w, [&name("upper_arm"), &name("forearm"), &name("carpus")], "Front Leg", 0.04);
        });
        w.part(&format!("paw{side}"), |w| chain(w, "fk", &[&name("paw"), &name("fingers")], 0.03));
        w.part(&format!("hind{side}"), |w| {
            leg_3joint::tags(w, [&name("thigh"), &name("shin"), &name("metatarsus"), &name("foot")], MAIN);
        });
        w.part(&format!("toes{side}"), |w| chain(w, "fk", &[&name("toes")], 0.03));
    }
    Ok(writer)
}

fn joints(w: &mut Writer) {
    w.group("body", CENTER).chain(
        "",
        &[
            ("hips", [0.0, 0.43, -0.20]),
            ("spine_1", [0.0, 0.44, -0.11]),
            ("spine_2", [0.0, 0.445, -0.01]),
            ("chest", [0.0, 0.44, 0.09]),
        ],
    );
    w.group("head", CENTER).chain("chest", &[("neck", [0.0, 0.47, 0.19]), ("head", [0.0, 0.57, 0.27])]);
    w.chain("head", &[("jaw", [0.0, 0.55, 0.30]), ("jaw_tip", [0.0, 0.53, 0.39])]);
    w.group("tail", CENTER).chain(
        "hips",
        &[
            ("tail_1", [0.0, 0.43, -0.27]),
            ("tail_2", [0.0, 0.41, -0.34]),
            ("tail_3", [0.0, 0.38, -0.41]),
            ("tail_4", [0.0, 0.345, -0.475]),
            ("tail_5", [0.0, 0.31, -0.54]),
            ("tail_6", [0.0, 0.28, -0.61]),
        ],
    );
    for (side, out, color) in [("_l", 1.0, LEFT), ("_r", -1.0, RIGHT)] {
        let labels = |names: &[(&str, [f32; 3])]| -> Vec<(String, [f32; 3])> {
            names.iter().map(|(name, [x, y, z])| (format!("{name}{side}"), [x * out, *y, *z])).collect()
        };
        let mut hang = |group: &str, parent: &str, names: &[(&str, [f32; 3])]| {
            let named = labels(names);
            let list: Vec<(&str, [f32; 3])> = named.iter().map(|(name, place)| (name.as_str(), *place)).collect();
            w.group(&format!("{group}{side}"), color).chain(parent, &list);
        };
        hang("face", "head", &[("eye", [0.032, 0.595, 0.335])]);
        hang("face", "head", &[("ear", [0.035, 0.63, 0.265]), ("ear_tip", [0.05, 0.70, 0.25])]);
        hang(
            "front",
            "chest",
            &[
                ("scapula", [0.045, 0.47, 0.12]),
                ("upper_arm", [0.06, 0.36, 0.18]),
                ("forearm", [0.06, 0.25, 0.11]),
                ("carpus", [0.06, 0.09, 0.12]),
                ("paw", [0.06, 0.03, 0.13]),
                ("fingers", [0.06, 0.015, 0.16]),
            ],
        );
        hang(
            "hind",
            "hips",
            &[
                ("thigh", [0.055, 0.41, -0.22]),
                ("shin", [0.055, 0.265, -0.15]),
                ("metatarsus", [0.055, 0.165, -0.275]),
                ("foot", [0.055, 0.03, -0.245]),
                ("toes", [0.055, 0.015, -0.205]),
            ],
        );
    }
}
