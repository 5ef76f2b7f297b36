//! Parts and abilities beyond the plain limb: pivots of feet, pinned elbows, shoulders that follow, necks, lips, tongues.

use std::collections::BTreeSet;

use bevy::math::{Quat, Vec3};
use rigsmith::{
    files::{RealDisk, load_template},
    rig::{NodeType, PoseOffset, part::PartNeeds, template::read_template},
};

use super::Puppet;

fn near(found: Vec3, wanted: Vec3, tolerance: f32, what: &str) {
    assert!(found.distance(wanted) <= tolerance, "{what}: {found} is not {wanted}");
}

#[test]
fn every_pivot_control_turns_the_foot_about_its_point() {
    for (template, side) in [("parts/leg", "l"), ("biped", "r")] {
        for role in ["heel_control", "toe_control", "inner_control", "outer_control", "ball_control"] {
            let mut puppet = Puppet::of(template);
            let [ankle, ball] = ["foot", "toe"].map(|joint| format!("{joint}_{side}"));
            let subject = puppet.joint(&ankle);
            let control = puppet.built.nodes.iter().find(|node| {
                node.kind == NodeType::Control
                    && node.origin.as_ref().is_some_and(|origin| &*origin.role == role && origin.subject == subject)
            });
            let control = control.unwrap_or_else(|| panic!("{template} has no {role}")).uid;
            let (frame, was) = (puppet.at(control), [&ankle, &ball].map(|joint| puppet.at(puppet.joint(joint))));
            let turn = Quat::from_rotation_x(0.12) * Quat::from_rotation_y(-0.2);
            puppet.state.set_offset(control, PoseOffset::from_rotation(turn)).unwrap();
            puppet.state.evaluate(0.0);
            let whole = frame.rotation * turn * frame.rotation.inverse();
            let what = format!("{template}, {role}");
            near(puppet.at(control).translation, frame.translation, 1e-5, &what);
            let wanted = frame.translation + whole * (was[0].translation - frame.translation);
            near(puppet.place(&ankle), wanted, 2e-4, &what);
            assert!(wanted.distance(was[0].translation) > 1e-3, "{what}: the ankle moves");
            let turned = puppet.at(puppet.joint(&ankle)).rotation;
            assert!(turned.angle_between(whole * was[0].rotation) < 2e-3, "{what}: the foot turns along");
            // The toes stay where the ball alone is turned, else they go with the foot.
            let toes = puppet.at(puppet.joint(&ball)).rotation;
            let expected = if role == "ball_control" { was[1].rotation } else { whole * was[1].rotation };
            assert!(toes.angle_between(expected) < 2e-3, "{what}: the toes");
        }
    }
}

#[test]
fn the_pivots_of_a_foot_stand_on_its_marks() {
    let puppet = Puppet::of("parts/leg");
    let role = |role: &str| {
        let found = puppet.built.nodes.iter().find(|node| node.origin.as_ref().is_some_and(|o| &*o.role == role));
        puppet.at(found.unwrap_or_else(|| panic!("no {role}")).uid).translation
    };
    for (pivot, mark) in
        [("heel", "heel_mark_l"), ("toe_tip", "tip_mark_l"), ("inner", "inner_mark_l"), ("outer", "outer_mark_l")]
    {
        let mark = puppet.at(puppet.named(NodeType::Null, mark).uid).translation;
        near(role(pivot), mark, 1e-5, pivot);
        assert!(mark.y.abs() < 2e-3, "{pivot} is on the ground: {mark}");
    }
    let [heel, tip, inner, outer] = ["heel", "toe_tip", "inner", "outer"].map(role);
    assert!(heel.z < puppet.place("foot_l").z && tip.z > puppet.place("toe_l").z);
    assert!(inner.x < puppet.place("toe_l").x && outer.x > puppet.place("toe_l").x);
}

#[test]
fn a_pinned_elbow_is_where_its_pole_is() {
    let limbs = [
        ("parts/arm", "arm_settings_l", "hand_ik_l", "elbow_l", ["upper_arm_l", "forearm_l", "hand_l"]),
        ("parts/leg", "leg_settings_l", "foot_ik_l", "knee_l", ["thigh_l", "shin_l", "foot_l"]),
        ("biped", "arm_settings_r", "hand_ik_r", "elbow_r", ["upper_arm_r", "forearm_r", "hand_r"]),
    ];
    for (template, settings, goal, pole, joints) in limbs {
        let mut puppet = Puppet::of(template);
        let [root, middle, end] = joints.map(|joint| puppet.place(joint));
        let length = root.distance(middle) + middle.distance(end);
        let target = end + Vec3::new(0.05, 0.1, 0.08);
        puppet.move_to(goal, target);
        let free = puppet.place(joints[1]);
        for aside in [Vec3::new(0.1, 0.05, 0.2), Vec3::new(-0.2, -0.1, -0.15), Vec3::new(0.0, 0.3, 0.0)] {
            let place = middle + aside * length;
            puppet.move_to(pole, place);
            puppet.set(settings, "pin", 1.0);
            near(puppet.place(joints[1]), place, 1e-4, template);
            near(puppet.place(joints[2]), target, 1e-4, template);
            near(puppet.place(joints[0]), root, 1e-5, template);
            puppet.set(settings, "pin", 0.0);
            let loose = puppet.place(joints[1]);
            assert!((loose.distance(root) - free.distance(root)).abs() < 1e-4, "{template}: bones have their length");
            puppet.set(settings, "pin", 0.5);
            near(puppet.place(joints[1]), loose.midpoint(place), 1e-4, template);
            near(puppet.place(joints[2]), target, 1e-4, template);
            puppet.set(settings, "pin", 0.0);
        }
    }
}

#[test]
fn a_shoulder_follows_the_goal_of_the_hand_by_itself() {
    for (template, side) in [("parts/arm", "l"), ("biped", "r")] {
        let mut puppet = Puppet::of(template);
        let name = |name: &str| format!("{name}_{side}");
        let clavicle = |puppet: &Puppet| puppet.axis(&name("clavicle"), Vec3::Y);
        let rest = clavicle(&puppet);
        let raised = puppet.place(&name("upper_arm")) + Vec3::new(if side == "l" { 0.1 } else { -0.1 }, 0.4, 0.1);
        puppet.move_to(&name("hand_ik"), raised);
        near(clavicle(&puppet), rest, 1e-5, "without auto");
        puppet.set(&name("shoulder"), "auto", 1.0);
        let lifted = clavicle(&puppet);
        let angle = lifted.angle_between(rest).to_degrees();
        assert!(lifted.y > rest.y + 0.1 && (10.0..50.0).contains(&angle), "{template}: {rest} turns to {lifted}");
        near(puppet.place(&name("hand")), raised, 1e-4, template);
        puppet.set(&name("shoulder"), "auto", 0.5);
        let half = clavicle(&puppet).angle_between(rest).to_degrees();
        assert!((half - 0.5 * angle).abs() < 0.1 * angle, "{template}: {half} of {angle}");
        // It is the goal that counts: without inverse kinematics nothing turns.
        puppet.set(&name("arm_settings"), "ik_fk", 0.0);
        near(clavicle(&puppet), rest, 1e-5, "forward");
    }
}

#[test]
fn lids_follow_the_gaze_up_and_down() {
    let mut puppet = Puppet::of("parts/eye");
    let ahead = |puppet: &Puppet, label: &str| puppet.axis(label, Vec3::Z);
    puppet.move_by("look_l", Vec3::new(0.0, 0.15, 0.0));
    let pitch = |direction: Vec3| direction.y.atan2(direction.z).to_degrees();
    let eye = pitch(ahead(&puppet, "eye_l"));
    assert!(eye > 15.0, "{eye}");
    for lid in ["lid_upper_l", "lid_lower_l"] {
        let half = pitch(ahead(&puppet, lid));
        assert!((half - 0.5 * eye).abs() < 0.5, "{lid}: {half} of {eye}");
    }
    puppet.set("eye_l", "lid_follow", 0.0);
    assert!(pitch(ahead(&puppet, "lid_upper_l")).abs() < 1e-3);
    puppet.set("eye_l", "lid_follow", 1.0);
    assert!((pitch(ahead(&puppet, "lid_upper_l")) - eye).abs() < 0.1);
    // Aside they do not go, and they blink from where they are.
    puppet.move_by("look_l", Vec3::new(0.2, -0.15, 0.0));
    assert!(ahead(&puppet, "eye_l").x > 0.3);
    assert!(ahead(&puppet, "lid_upper_l").x.abs() < 1e-3);
    puppet.set("eye_l", "blink", 1.0);
    assert!(ahead(&puppet, "lid_upper_l").y < -0.4);
}

#[test]
fn lips_follow_the_jaw_whole_by_half_and_not() {
    let mut puppet = Puppet::of("parts/lips");
    let labels = ["lip_lower", "lip_corner_l", "lip_corner_r", "lip_upper"];
    let rest = labels.map(|label| puppet.at(puppet.joint(label)));
    let jaw = puppet.joint("jaw");
    puppet.state.set_offset(jaw, PoseOffset::from_rotation(Quat::from_rotation_x(-0.4))).unwrap();
    puppet.state.evaluate(0.0);
    let now = labels.map(|label| puppet.at(puppet.joint(label)));
    for (at, share) in [1.0, 0.5, 0.5, 0.0].into_iter().enumerate() {
        let turned = now[at].rotation.angle_between(rest[at].rotation);
        assert!((turned - 0.4 * share).abs() < 3e-3, "{}: {turned}", labels[at]);
    }
    let opened = rest[0].translation.y - now[0].translation.y;
    assert!(opened > 0.01, "the mouth opens: {opened}");
    let corner = rest[1].translation.y - now[1].translation.y;
    assert!(corner > 0.3 * opened && corner < 0.7 * opened, "{corner} of {opened}");
    // Each has a control of its own on top.
    puppet.move_by("lip_corner_l", Vec3::new(0.01, 0.0, 0.0));
    assert!(puppet.place("lip_corner_l").distance(now[1].translation) > 0.009);
    near(puppet.place("lip_corner_r"), now[2].translation, 1e-6, "the other corner");
}

#[test]
fn a_tongue_moves_joint_by_joint_and_along_its_curve() {
    let mut puppet = Puppet::of("parts/tongue");
    let tip = puppet.place("tongue_4");
    puppet.turn("tongue_fk_2", Quat::from_rotation_x(0.5));
    assert!(puppet.place("tongue_4").distance(tip) > 0.005);
    puppet.turn("tongue_fk_2", Quat::IDENTITY);
    puppet.set("tongue_fk", "curve", 1.0);
    puppet.move_by("tongue_bend_3", Vec3::new(0.02, 0.0, 0.0));
    assert!(puppet.place("tongue_4").x > 0.005, "{}", puppet.place("tongue_4"));
    near(puppet.place("tongue_1"), Puppet::of("parts/tongue").place("tongue_1"), 1e-5, "its root");
}

/// A neck with so many joints below the head, hung on a chest.
fn neck(count: usize) -> Puppet {
    let text = format!(
        "(format: 2, name: \"figure\", joints: [(label: \"chest\", translation: (0, 1.3, 0))], parts: [(part: \
         \"parts/neck_chain.rig.ron\", parent: \"chest\", translation: (0, 0.16, 0), count: {count})])"
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("figure.rig.ron");
    std::fs::write(&path, &text).unwrap();
    assert!(read_template(text.as_bytes()).is_ok());
    Puppet::new(rigsmith::files::load_template(&rigsmith::files::RealDisk, &path).unwrap().rig)
}

#[test]
fn a_neck_of_many_joints_shares_what_the_head_does() {
    for count in 3..=7 {
        let mut puppet = neck(count);
        let labels: Vec<String> = puppet.rig.walk().skip(1).map(|joint| joint.data.label.clone().unwrap()).collect();
        assert_eq!(labels.len(), count, "{labels:?}");
        let (off, _, which) = puppet.off_rest();
        assert!(off < 0.02, "{count}: {which} is off by {off}");
        let rest: Vec<Quat> = labels.iter().map(|label| puppet.at(puppet.joint(label)).rotation).collect();
        puppet.turn("head_ik", Quat::from_rotation_y(0.9));
        let turns: Vec<f32> = labels
            .iter()
            .zip(&rest)
            .map(|(label, rest)| puppet.at(puppet.joint(label)).rotation.angle_between(*rest))
            .collect();
        assert!(turns.windows(2).all(|pair| pair[1] > pair[0] + 0.02), "{count}: {turns:?}");
        assert!(turns[0] < 0.05 && (turns[count - 1] - 0.9).abs() < 0.02, "{count}: {turns:?}");
        puppet.turn("head_ik", Quat::IDENTITY);
        // The neck reaches wherever the head's control goes.
        puppet.move_by("head_ik", Vec3::new(0.03, 0.04, 0.05));
        let goal = puppet.at(puppet.control("head_ik")).translation;
        near(puppet.place("head"), goal, 1e-3, "the head");
        // A forward control carries what is above it.
        puppet.turn("neck_fk", Quat::from_rotation_z(0.4));
        assert!(puppet.place("head").distance(goal) > 0.02);
    }
}

#[test]
fn a_bendy_limb_bends_and_keeps_its_tangents() {
    let mut puppet = Puppet::of("parts/bendy_limb");
    let rest = puppet.place("limb_3");
    puppet.move_by("limb_bend", Vec3::new(0.2, 0.0, 0.0));
    assert!(puppet.place("limb_3").x > rest.x + 0.1, "{}", puppet.place("limb_3"));
    puppet.move_by("limb_bend", Vec3::new(-0.2, 0.0, 0.0));
    // The ends reach their controls, and the bend stays in the middle.
    puppet.move_by("limb_end", Vec3::new(0.3, 0.2, 0.0));
    let end = puppet.at(puppet.control("limb_end")).translation;
    near(puppet.place("limb_5"), end, 1e-3, "the end");
    assert!(puppet.place("limb_3").x > 0.05);
    // A turn of the start turns its tangent, and with it the first bone.
    let before = puppet.place("limb_2");
    puppet.turn("limb_start", Quat::from_rotation_z(0.6));
    let after = puppet.place("limb_2");
    assert!(after.distance(before) > 0.03, "{before} {after}");
    near(puppet.place("limb_1"), Vec3::Y, 1e-4, "the start");
    near(puppet.place("limb_5"), end, 1e-3, "the end");
}

/// A description says in words which joints a part needs, where it hangs, and where others hang on it.
#[test]
fn descriptions_of_parts_name_their_needs_and_sockets() {
    let parts = super::files().into_iter().filter(|(name, _)| name.starts_with("parts/"));
    let mut count = 0;
    for (name, path) in parts {
        let template = load_template(&RealDisk, &path).unwrap();
        let (needs, text) = (PartNeeds::of(&template.rig), &template.rig.about().description);
        let words: BTreeSet<&str> = text.split(|c: char| !c.is_alphanumeric() && c != '_').collect();
        let missing = needs.joints.iter().filter(|joint| !words.contains(joint.as_str())).collect::<Vec<_>>();
        assert!(missing.is_empty(), "{name} needs {missing:?}: {text}");
        for place in needs.sockets.iter().map(ToString::to_string) {
            let ends = text.match_indices(&place).map(|(at, _)| text[at + place.len()..].chars().next());
            let is_told = ends.into_iter().any(|next| next.is_none_or(|c| !c.is_alphanumeric() && c != '_'));
            assert!(is_told, "{name} hangs on {place}: {text}");
        }
        for socket in &template.sockets {
            assert!(words.contains(socket.name.as_str()), "others hang on {} of {name}: {text}", socket.name);
        }
        count += 1;
    }
    assert_eq!(count, super::BUNDLED_PARTS.len());
}
