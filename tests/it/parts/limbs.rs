//! Arms, legs, chains and hands.

use bevy::math::{Quat, Vec3};

use rigsmith::rig::feature::{combined_features, set_switch};

use super::{Puppet, template};

/// Limbs of the left: template, joints, goal, pole, settings.
const ARM: Limb = Limb { joints: ["upper_arm_l", "forearm_l", "hand_l"], goal: "hand_ik_l", pole: "elbow_l" };
const LEG: Limb = Limb { joints: ["thigh_l", "shin_l", "foot_l"], goal: "foot_ik_l", pole: "knee_l" };

struct Limb {
    joints: [&'static str; 3],
    goal: &'static str,
    pole: &'static str,
}

impl Limb {
    fn length(&self, puppet: &Puppet) -> f32 {
        let [root, middle, end] = self.joints.map(|joint| puppet.place(joint));
        root.distance(middle) + middle.distance(end)
    }

    /// The direction in which the limb bends, across the line from root to end.
    fn bend(&self, puppet: &Puppet) -> Vec3 {
        let [root, middle, end] = self.joints.map(|joint| puppet.place(joint));
        (middle - root).reject_from(end - root)
    }
}

#[test]
fn limbs_reach_their_goals_and_bend_to_their_poles() {
    for (name, limb) in [("parts/arm", ARM), ("parts/leg", LEG), ("biped", ARM), ("biped", LEG)] {
        let mut puppet = Puppet::of(name);
        let length = limb.length(&puppet);
        let root = puppet.place(limb.joints[0]);
        let front = if limb.goal == "hand_ik_l" { -Vec3::Z } else { Vec3::Z };
        for direction in [Vec3::new(0.3, -0.8, 0.4), Vec3::new(0.9, -0.2, 0.3), Vec3::new(0.1, -1.0, -0.1)] {
            for share in [0.5, 0.8, 0.97] {
                let goal = root + direction.normalize() * (share * length);
                puppet.move_to(limb.goal, goal);
                let off = puppet.place(limb.joints[2]).distance(goal) / length;
                assert!(off < 1e-4, "{name}: {} is off by {off} of the limb at {share}", limb.goal);
                let bend = limb.bend(&puppet);
                assert!(bend.dot(front) > 0.0, "{name}: {} bends to {bend} at {share} {direction}", limb.goal);
            }
        }
        let goal = root + Vec3::new(0.2, -0.6, 0.1).normalize() * (0.7 * length);
        puppet.move_to(limb.goal, goal);
        for side in [Vec3::X, -Vec3::X] {
            let place = puppet.place(limb.joints[0]).midpoint(goal) + (side + 0.4 * front) * length;
            puppet.move_to(limb.pole, place);
            let bend = limb.bend(&puppet);
            assert!(bend.dot(side) > 0.0, "{name}: {} does not bend to the pole: {bend}", limb.pole);
        }
    }
}

#[test]
fn limbs_stretch_if_they_shall() {
    for (name, limb, settings) in [("parts/arm", ARM, "arm_settings_l"), ("parts/leg", LEG, "leg_settings_l")] {
        let mut puppet = Puppet::of(name);
        let length = limb.length(&puppet);
        let root = puppet.place(limb.joints[0]);
        let goal = root + Vec3::new(0.5, -0.8, 0.2).normalize() * (1.3 * length);
        puppet.move_to(limb.goal, goal);
        let off = puppet.place(limb.joints[2]).distance(goal) / length;
        assert!(off < 1e-4, "{name} does not stretch: {off}");
        puppet.set(settings, "stretch", 0.0);
        let reach = puppet.place(limb.joints[2]).distance(root) / length;
        assert!((reach - 1.0).abs() < 1e-3, "{name} is {reach} of its length");
    }
}

#[test]
fn forward_controls_move_a_limb_that_is_switched_to_them() {
    for (name, limb, settings, upper) in
        [("parts/arm", ARM, "arm_settings_l", "arm_fk_l"), ("parts/leg", LEG, "leg_settings_l", "leg_fk_l")]
    {
        let mut puppet = Puppet::of(name);
        let before = limb.joints.map(|joint| puppet.place(joint));
        puppet.set(settings, "ik_fk", 0.0);
        for (joint, before) in limb.joints.iter().zip(before) {
            let off = puppet.place(joint).distance(before);
            assert!(off < 1e-4, "{name}: {joint} jumps by {off}");
        }
        puppet.turn(upper, Quat::from_rotation_x(0.5));
        let moved = puppet.place(limb.joints[2]).distance(before[2]);
        let expected = 2.0 * (0.25_f32).sin() * before[2].distance(before[0]);
        assert!(moved > 0.5 * expected && puppet.place(limb.joints[0]).distance(before[0]) < 1e-5, "{name}: {moved}");
        let goal = puppet.place(limb.joints[2]);
        puppet.move_by(limb.goal, Vec3::new(0.1, 0.1, 0.0));
        assert_eq!(puppet.place(limb.joints[2]), goal, "{name}: the goal still pulls");
    }
}

#[test]
fn twists_are_shared_along_the_bones() {
    let mut puppet = Puppet::of("parts/arm");
    puppet.set("arm_settings_l", "ik_fk", 0.0);
    let rest: Vec<Quat> = twists(&puppet);
    assert_eq!(rest.len(), 8);
    puppet.turn("arm_fk_l_3", Quat::from_rotation_y(1.2));
    let hand = turns(&puppet, &rest);
    assert!(hand[..4].iter().all(|turn| turn.abs() < 1e-3), "the hand turns the upper arm: {hand:?}");
    for (turn, share) in hand[4..].iter().zip([0.2, 0.4, 0.6, 0.8]) {
        assert!((turn - share * 1.2).abs() < 0.02, "{hand:?}");
    }
    puppet.turn("arm_fk_l_3", Quat::IDENTITY);
    puppet.turn("arm_fk_l", Quat::from_rotation_y(0.9));
    let upper = turns(&puppet, &rest);
    for (turn, share) in upper[..4].iter().zip([0.0, 0.25, 0.5, 0.75]) {
        assert!((turn - share * 0.9).abs() < 0.02, "{upper:?}");
    }
}

fn twists(puppet: &Puppet) -> Vec<Quat> {
    let made = puppet.built.nodes.iter().filter(|node| node.origin.as_ref().is_some_and(|o| &*o.role == "twist"));
    let mut made: Vec<_> = made.collect();
    made.sort_by_key(|node| (node.name.contains("forearm"), node.origin.as_ref().map(|o| o.number)));
    made.iter().map(|node| puppet.at(node.uid).rotation).collect()
}

/// Turn of each twist joint since then, in radians.
fn turns(puppet: &Puppet, rest: &[Quat]) -> Vec<f32> {
    twists(puppet).iter().zip(rest).map(|(now, rest)| now.angle_between(*rest)).collect()
}

#[test]
fn a_foot_rolls_over_heel_ball_and_toe() {
    for name in ["parts/leg", "biped"] {
        let rest = Puppet::of(name);
        let [ankle, ball] = ["foot_l", "toe_l"].map(|joint| rest.place(joint));
        let forward = (ball - ankle).with_y(0.0).normalize();
        let mut puppet = Puppet::of(name);

        puppet.set("foot_ik_l", "roll", 25.0);
        let [lifted, planted] = ["foot_l", "toe_l"].map(|joint| puppet.place(joint));
        assert!(planted.distance(ball) < 1e-4, "{name}: the ball leaves its place by {}", planted.distance(ball));
        assert!(lifted.y > ankle.y + 0.02 && (lifted - ankle).dot(forward) > 0.0, "{name}: the heel stays: {lifted}");
        let toes = puppet.axis("toe_l", Vec3::Y).dot(rest.axis("toe_l", Vec3::Y));
        assert!(toes > 0.9999, "{name}: the toes do not stay flat: {toes}");
        assert!(lifted.distance(ball) - ankle.distance(ball) < 1e-4, "{name}: the foot grows");

        puppet.set("foot_ik_l", "roll", -20.0);
        let [back, up] = ["foot_l", "toe_l"].map(|joint| puppet.place(joint));
        assert!(up.y > ball.y + 0.03, "{name}: the ball does not lift over the heel: {up}");
        assert!((back - ankle).dot(forward) < 0.0, "{name}: the ankle does not go back: {back}");

        puppet.set("foot_ik_l", "roll", 80.0);
        assert!(puppet.place("toe_l").y > ball.y + 0.01, "{name}: the ball does not lift over the toe");

        puppet.set("foot_ik_l", "roll", 0.0);
        puppet.set("foot_ik_l", "bank", 20.0);
        let banked = puppet.place("foot_l");
        assert!(banked.x > ankle.x + 0.01, "{name}: the foot does not tip outwards: {banked} from {ankle}");
        puppet.set("foot_ik_l", "bank", 0.0);
        puppet.set("foot_ik_l", "toe", 30.0);
        assert!(puppet.place("foot_l").distance(ankle) < 1e-4, "{name}: bent toes move the ankle");
        let bent = puppet.axis("toe_l", Vec3::Y).y - rest.axis("toe_l", Vec3::Y).y;
        assert!(bent.abs() > 0.2, "{name}: the toes do not bend: {bent}");
        puppet.set("foot_ik_l", "toe", 0.0);
        puppet.set("foot_ik_l", "swivel", 30.0);
        assert!(puppet.place("toe_l").distance(ball) < 1e-4, "{name}: the ball leaves its place as the heel swivels");
        assert!(puppet.place("foot_l").distance(ankle) > 0.03, "{name}: the heel does not swivel");
    }
}

#[test]
fn a_knee_follows_the_foot_or_the_world() {
    let mut puppet = Puppet::of("parts/leg");
    let knee = puppet.at(puppet.control("knee_l")).translation;
    puppet.move_by("foot_ik_l", Vec3::new(0.0, 0.1, 0.2));
    assert!(
        puppet.at(puppet.control("knee_l")).translation.distance(knee) < 1e-5,
        "the knee's pole stands in the world"
    );
    puppet.set("knee_l", "space", 2.0);
    let moved = puppet.at(puppet.control("knee_l")).translation - knee;
    assert!(moved.distance(Vec3::new(0.0, 0.1, 0.2)) < 1e-4, "the knee's pole does not go with the foot: {moved}");
}

#[test]
fn fingers_curl_to_the_palm_and_spread() {
    for (name, control, sides) in
        [("parts/hand", "fingers", &["_l"][..]), ("hand", "fingers", &["_l"]), ("biped", "fingers", &["_l", "_r"])]
    {
        for side in sides {
            let label = |finger: &str, number: &str| format!("{finger}_{number}{side}");
            let rest = Puppet::of(name);
            let hand = rest.place(&format!("hand{side}"));
            let knuckle = |finger: &str| rest.place(&label(finger, "01"));
            let across = knuckle("index") - knuckle("pinky");
            let turned = if *side == "_l" { 1.0 } else { -1.0 };
            let palm = turned * (knuckle("middle") - hand).cross(across).normalize();
            let mut puppet = Puppet::of(name);
            puppet.set(&format!("{control}{side}"), "curl", 0.5);
            for finger in ["index", "middle", "ring", "pinky"] {
                let [before, after] = [&rest, &puppet]
                    .map(|puppet| puppet.place(&label(finger, "03")) - puppet.place(&label(finger, "01")));
                let moved = (after - before).normalize();
                assert!(moved.dot(palm) > 0.3, "{name}: {finger}{side} curls to {moved}, the palm faces {palm}");
                assert!(after.normalize().dot(before.normalize()) < 0.9, "{name}: {finger}{side} stays straight");
            }
            let thumb = puppet.place(&label("thumb", "03")) - rest.place(&label("thumb", "03"));
            assert!(thumb.dot(palm - across.normalize()) > 0.0, "{name}: the thumb{side} moves by {thumb}");
            // One finger alone.
            puppet.set(&format!("{control}{side}"), "curl", 0.0);
            puppet.set(&format!("index_master{side}"), "curl", 1.0);
            let off = |finger: &str| puppet.place(&label(finger, "03")).distance(rest.place(&label(finger, "03")));
            assert!(off("index") > 0.02 && off("middle") < 1e-5, "{name}: {} {}", off("index"), off("middle"));
            puppet.set(&format!("index_master{side}"), "curl", 0.0);
            let width =
                |puppet: &Puppet| puppet.place(&label("index", "03")).distance(puppet.place(&label("pinky", "03")));
            puppet.set(&format!("{control}{side}"), "spread", 1.0);
            assert!(width(&puppet) > width(&rest) + 0.005, "{name}: fingers{side} do not spread");
        }
    }
}

#[test]
fn a_fingertip_stays_on_its_goal() {
    for name in ["parts/hand", "biped"] {
        let mut puppet = Puppet::of(name);
        puppet.set("index_master_l", "ik", 1.0);
        let root = puppet.place("index_01_l");
        let goal = root + (puppet.place("index_03_l") - root) * 0.8 + puppet.axis("index_01_l", Vec3::Z) * 0.02;
        puppet.move_to("index_tip_l", goal);
        let off = puppet.place("index_03_l").distance(goal);
        assert!(off < 1e-5, "{name}: the tip is off by {off}");
    }
}

#[test]
fn chains_follow_their_controls_or_reach() {
    let mut puppet = Puppet::of("parts/fk_chain");
    let tip = puppet.place("chain_5");
    puppet.turn("chain_2_control", Quat::from_rotation_x(0.4));
    assert!(puppet.place("chain_5").distance(tip) > 0.1 && puppet.place("chain_1").distance(Vec3::Y) < 1e-5);

    // With either of its two solvers.
    let goal = Vec3::new(0.2, 1.5, 0.3);
    let mut middles = Vec::new();
    for solver in ["fabrik", "ccd"] {
        let mut rig = template("parts/ikfk_chain");
        let key = combined_features(&rig)[0].key.clone();
        for edit in set_switch(&rig, &key, solver, true).unwrap() {
            rig.apply(&edit).unwrap();
        }
        let mut puppet = Puppet::new(rig);
        puppet.move_to("chain_ik", goal);
        assert!(puppet.place("chain_5").distance(goal) < 1e-3, "{solver}: {}", puppet.place("chain_5"));
        middles.push(puppet.place("chain_3"));
    }
    assert!(middles[0].distance(middles[1]) > 0.01, "the solvers bend the chain differently: {middles:?}");
}
