//! Freedom of controls: open channels, limits of rotations, and hidden controls.

use bevy::math::Quat;
use rigsmith::rig::{ControlData, NodeType, VISIBLE};

use super::{Puppet, files};

/// Controls whose scale is meant for use: those that carry a whole rig, and the part that is one control.
const SCALED: [&str; 2] = ["root", "main"];

/// Controls of hinges (template, name, least and greatest angle from rest about X).
const HINGES: [(&str, &str, f32, f32); 9] = [
    ("parts/arm", "arm_fk_l_2", -16.0, 149.0),
    ("biped", "arm_fk_r_2", -16.0, 149.0),
    ("parts/leg", "leg_fk_l_2", -160.7, 4.3),
    ("biped", "leg_fk_r_2", -160.7, 4.3),
    ("parts/leg_3joint", "leg_fk_l_2", -88.3, 76.7),
    ("parts/front_leg", "front_fk_l_2", -36.3, 128.7),
    ("parts/hand", "index_l_2", -31.9, 103.1),
    ("parts/hand", "index_l_3", -15.0, 120.0),
    ("biped", "pinky_r_3", -15.0, 120.0),
];

/// Controls that turn without an end by intent, without side and number.
const TURN_FREELY: [&[&str]; 4] = [
    // What carries the rig, or a large part of it.
    &["root", "main", "body", "torso", "hips", "chest", "spine", "spine_fk", "scapula", "shoulder", "hand", "forearm"],
    // Goals: what they carry turns as far as its limb lets it.
    &[
        "hand_ik",
        "foot_ik",
        "leg_goal",
        "front_goal",
        "wing_tip",
        "chest_ik",
        "head_ik",
        "chain_ik",
        "limb_start",
        "limb_end",
        "hock",
        "thumb_tip",
        "index_tip",
        "middle_tip",
        "ring_tip",
        "pinky_tip",
    ],
    // Ball joints, whose ends depend on where the limb is.
    &["arm_fk", "leg_fk", "front_fk", "foot_fk", "head", "neck", "neck_fk"],
    // Chains of no anatomy, and what is soft.
    &["chain", "control", "tail_bend", "tongue_fk", "tongue_bend"],
];

/// Name of a control without the side, the number and the ending of those that are called like their joints.
fn stem(name: &str) -> &str {
    let mut stem = name;
    loop {
        let ends = ["_control", "_l", "_r"].into_iter().find_map(|end| stem.strip_suffix(end));
        let numbered = stem.rsplit_once('_').filter(|(_, end)| end.bytes().all(|byte| byte.is_ascii_digit()));
        match ends.or(numbered.map(|(start, _)| start)) {
            Some(shorter) => stem = shorter,
            None => return stem,
        }
    }
}

#[test]
fn every_control_has_ends_or_locks_to_its_turns_or_is_free_by_intent() {
    let mut free = 0;
    for (template, _) in files() {
        let puppet = Puppet::of(&template);
        let made = puppet
            .built
            .nodes
            .iter()
            .filter(|node| node.origin.as_ref().is_some_and(|origin| *origin.role == *"control"));
        for node in made {
            let Some(control) = node.control.as_deref() else { continue };
            let is_open = |axis: usize| {
                let (low, high) = control.limits.rotate[axis];
                control.channels.rotate[axis] && (low.is_none() || high.is_none())
            };
            if (0..3).any(is_open) {
                let stem = stem(&node.name);
                assert!(
                    TURN_FREELY.iter().any(|names| names.contains(&stem)),
                    "{template}: {} turns without end",
                    node.name
                );
                free += 1;
            }
        }
    }
    assert!(free > 40, "{free}");
}

#[test]
fn eyes_lids_lips_wings_paws_toes_ears_tails_and_knuckles_turn_as_far_as_they_do() {
    // Template, control, whether it stays in its place.
    let ended = [
        ("parts/eye", "eye_l", true),
        ("quadruped", "eye_r", true),
        ("parts/lips", "lip_upper", false),
        ("parts/lips", "lip_corner_r", false),
        ("parts/wing", "wing_fk_l_2", true),
        ("bird", "wing_fk_r", true),
        ("bird", "quill_6_r", true),
        ("bird", "toe_middle_l_control", true),
        ("bird", "tail_fan_r_control", true),
        ("quadruped", "toes_r_control", true),
        ("quadruped", "paw_l_control", true),
        ("quadruped", "fingers_r_control", true),
        ("quadruped", "ear_l_control", true),
        ("quadruped", "tail_fk_6", true),
        ("parts/tail", "tail_fk", true),
        ("parts/leg", "leg_fk_l_4", false),
        ("biped", "leg_fk_r_4", false),
        ("parts/hand", "thumb_l", false),
        ("parts/hand", "index_l", false),
        ("biped", "thumb_r", false),
        ("biped", "pinky_r", false),
    ];
    for (template, name, stays) in ended {
        let puppet = Puppet::of(template);
        let (_, control) = controls(&puppet).into_iter().find(|(known, _)| known == name).unwrap();
        for (low, high) in control.limits.rotate {
            let (low, high) = (low.unwrap(), high.unwrap());
            assert!((-150.0..0.0).contains(&low) && (0.0..=150.0).contains(&high), "{template}: {name}: {low} {high}");
        }
        assert_eq!(control.channels.translate, [!stays; 3], "{template}: {name}");
    }
    // The limits are for the toes alone.
    for joint in ["leg_fk_l", "leg_fk_l_3"] {
        let (_, control) = controls(&Puppet::of("parts/leg")).into_iter().find(|(known, _)| known == joint).unwrap();
        assert_eq!(control.limits.rotate, [(None, None); 3], "{joint}");
    }
    // Toes go up to their end and no further, on both sides.
    for name in ["leg_fk_l_4", "leg_fk_r_4"] {
        let mut puppet = Puppet::of("biped");
        let slot = puppet.state.program().node(puppet.control(name)).unwrap();
        puppet.turn(name, Quat::from_rotation_x(2.0));
        let taken = puppet.state.offset_at(slot).rotation;
        assert!((2.0 * taken.x.atan2(taken.w).to_degrees() - 80.0).abs() < 0.5, "{name}: {taken}");
    }
    // Lips stay near the mouth.
    let (_, lip) = controls(&Puppet::of("parts/lips")).into_iter().find(|(known, _)| known == "lip_lower").unwrap();
    assert!(lip.limits.translate.iter().all(|(low, high)| low.is_some() && high.is_some()));
}

fn controls(puppet: &Puppet) -> Vec<(String, ControlData)> {
    let controls = puppet.built.nodes.iter().filter(|node| node.kind == NodeType::Control);
    controls.map(|node| (node.name.to_string(), node.control.as_deref().unwrap().clone())).collect()
}

#[test]
fn every_control_of_every_template_is_open_where_it_has_an_effect() {
    let mut hinges = 0;
    for (template, _) in files() {
        let puppet = Puppet::of(&template);
        for (name, control) in controls(&puppet) {
            let what = format!("{template}: {name}");
            let channels = control.channels;
            if !SCALED.contains(&name.as_str()) && template != "parts/single_control" {
                assert_eq!(channels.scale, [false; 3], "{what} scales");
            }
            let is_pole = ["elbow", "knee", "front_pole", "look"].iter().any(|pole| name.starts_with(pole));
            let moved_only =
                ["upper_arm_bend", "forearm_bend", "thigh_bend", "shin_bend", "waist", "neck_bend", "limb_bend"];
            let is_bend = moved_only.iter().any(|bend| name.starts_with(bend)) || name.ends_with("tangent");
            if is_pole || is_bend {
                assert_eq!(channels.rotate, [false; 3], "{what} turns");
                assert_eq!(channels.translate, [true; 3], "{what} does not move");
            }
            // A control that turns about one axis has an end to its turn on both sides.
            if channels.rotate == [true, false, false] {
                let (low, high) = control.limits.rotate[0];
                assert!(low.is_some_and(|low| (-170.0..=0.0).contains(&low)), "{what}: {low:?}");
                assert!(high.is_some_and(|high| (0.0..=170.0).contains(&high)), "{what}: {high:?}");
                hinges += 1;
            }
        }
    }
    assert!(hinges > 40, "{hinges}");
}

#[test]
fn elbows_and_knees_turn_about_their_hinge_within_human_limits() {
    for (template, name, low, high) in HINGES {
        let mut puppet = Puppet::of(template);
        let (_, control) = controls(&puppet).into_iter().find(|(known, _)| known == name).unwrap();
        let what = format!("{template}: {name}");
        assert_eq!(control.channels.rotate, [true, false, false], "{what}");
        let (least, most) = control.limits.rotate[0];
        let off = |found: Option<f32>, wanted: f32| found.is_none_or(|found| (found - wanted).abs() > 1.0);
        assert!(!off(least, low) && !off(most, high), "{what}: {least:?} to {most:?}");
        // Neither a turn about another axis nor a bend too far is taken.
        let uid = puppet.control(name);
        let slot = puppet.state.program().node(uid).unwrap();
        for (wanted, expected) in [
            (Quat::from_rotation_y(0.5), 0.0),
            (Quat::from_rotation_x((high + 20.0).to_radians()), high),
            (Quat::from_rotation_x((low - 20.0).to_radians()), low),
            (Quat::from_rotation_x(0.05), 0.05f32.to_degrees()),
        ] {
            puppet.turn(name, wanted);
            let taken = puppet.state.offset_at(slot).rotation;
            let angle = 2.0 * taken.x.atan2(taken.w).to_degrees();
            assert!(taken.y.abs() < 1e-4 && taken.z.abs() < 1e-4, "{what}: {taken}");
            assert!((angle - expected).abs() < 1.0, "{what}: {wanted} becomes {angle} degrees");
        }
    }
}

/// The hinge of a limb is the axis about which its solver bends it, so its end stays in one plane.
#[test]
fn hinges_bend_limbs_in_their_plane() {
    let limbs = [
        ("parts/arm", "arm_settings_l", "arm_fk_l_2", ["upper_arm_l", "forearm_l", "hand_l"], 1.0),
        ("parts/leg", "leg_settings_l", "leg_fk_l_2", ["thigh_l", "shin_l", "foot_l"], -1.0),
        ("biped", "leg_settings_r", "leg_fk_r_2", ["thigh_r", "shin_r", "foot_r"], -1.0),
    ];
    for (template, settings, control, joints, sense) in limbs {
        let mut puppet = Puppet::of(template);
        puppet.set(settings, "ik_fk", 0.0);
        let normal = |puppet: &Puppet| {
            let [root, middle, end] = joints.map(|joint| puppet.place(joint));
            ((middle - root).cross(end - middle).normalize(), (middle - root).angle_between(end - middle).to_degrees())
        };
        let (plane, rest) = normal(&puppet);
        puppet.turn(control, Quat::from_rotation_x(sense * 1.0));
        let (bent_plane, bent) = normal(&puppet);
        assert!(plane.dot(bent_plane) > 0.9999, "{template}: {plane} becomes {bent_plane}");
        assert!((bent - rest - 1f32.to_degrees()).abs() < 0.1, "{template}: {rest} becomes {bent}");
    }
}

fn visible(puppet: &Puppet, name: &str) -> Option<f32> {
    puppet.state.attribute(puppet.control(name), VISIBLE)
}

#[test]
fn controls_are_hidden_by_the_mode_they_are_not_in() {
    // Template, control with the attribute, attribute, controls of 0, controls of 1.
    type Mode = (&'static str, &'static str, &'static str, &'static [&'static str], &'static [&'static str]);
    let modes: [Mode; 7] = [
        ("parts/arm", "arm_settings_l", "ik_fk", &["arm_fk_l", "arm_fk_l_2", "arm_fk_l_3"], &["hand_ik_l", "elbow_l"]),
        ("parts/leg", "leg_settings_l", "ik_fk", &["leg_fk_l", "leg_fk_l_2", "leg_fk_l_3"], &["foot_ik_l", "knee_l"]),
        (
            "parts/leg_3joint",
            "leg_goal_l",
            "ik_fk",
            &["leg_fk_l", "leg_fk_l_2", "leg_fk_l_3", "foot_fk_l"],
            &["knee_l", "hock_l"],
        ),
        ("parts/tail", "tail_fk", "curve", &[], &["tail_bend", "tail_bend_2", "tail_bend_3"]),
        ("parts/tongue", "tongue_fk", "curve", &[], &["tongue_bend", "tongue_bend_2", "tongue_bend_3"]),
        ("parts/hand", "index_master_l", "ik", &[], &["index_tip_l"]),
        ("quadruped", "leg_goal_l", "ik_fk", &["foot_fk_l"], &["knee_l", "hock_l"]),
    ];
    for (template, control, attribute, off, on) in modes {
        let mut puppet = Puppet::of(template);
        for value in [0.0, 1.0] {
            puppet.set(control, attribute, value);
            for (names, shown) in [(off, 1.0 - value), (on, value)] {
                for name in names {
                    assert_eq!(visible(&puppet, name), Some(shown), "{template}: {name} with {attribute} at {value}");
                }
            }
        }
        // The control that carries the attribute, and those that carry the rig, are never hidden.
        for name in [control, "main", "root", "body"] {
            let driven = puppet.built.nodes.iter().filter(|node| *node.name == *name && node.control.is_some());
            driven.for_each(|node| assert_eq!(puppet.state.attribute(node.uid, VISIBLE), None, "{template}: {name}"));
        }
    }
    let foot = Puppet::of("parts/leg");
    let pivots = foot.built.nodes.iter().filter(|node| {
        node.origin.as_ref().is_some_and(|origin| origin.role.ends_with("_control")) && node.control.is_some()
    });
    let pivots: Vec<_> = pivots.map(|node| foot.state.attribute(node.uid, VISIBLE)).collect();
    assert_eq!(pivots, [Some(1.0); 5]);
    // A goal that carries the attribute which hides it stays to be found.
    assert_eq!(visible(&Puppet::of("parts/eye"), "look_l"), None);
}
