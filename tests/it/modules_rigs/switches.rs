//! Switches of a limb and of spaces, without a jump.

use super::*;

fn with_pole(extra: &str) -> String {
    format!(", pole: \"{}\"{extra}", knob(104))
}

#[test]
fn a_limb_is_switched_without_a_jump() {
    let cases = [
        with_pole(""),
        String::new(),
        with_pole(", soft: 0.1"),
        with_pole(", stretch: 1.0"),
        with_pole(", stretch: 0.5"),
        with_pole(", twist: 25.0"),
        with_pole(", orient_end: false"),
        ", solver: fabrik".to_owned(),
    ];
    let turns = [
        [Quat::from_rotation_z(0.4), Quat::from_rotation_y(0.9), Quat::from_rotation_x(0.5)],
        [Quat::from_rotation_y(-1.1), Quat::from_rotation_y(0.3), Quat::IDENTITY],
        [Quat::from_rotation_x(2.0), Quat::from_rotation_y(1.8), Quat::from_rotation_z(-1.0)],
        // The elbow bends a little the other way than it was built.
        [Quat::IDENTITY, Quat::from_rotation_y(-0.6), Quat::IDENTITY],
        // The arm is all but straight.
        [Quat::IDENTITY, Quat::from_rotation_y(-0.3301), Quat::IDENTITY],
    ];
    let goals = [([-0.2, 0.15, 0.1], 0.4), ([0.3, 0.1, 0.0], 0.0), ([-0.45, -0.2, 0.2], -1.2)];
    for extra in &cases {
        let (bench, tags) = arm_with_switch(extra);
        let mut play = bench.play();
        let [upper, lower, hand, goal, pole] = tags.map(|tag| play.knob(tag));
        let joints = |play: &mut Play| [2, 3, 4].map(|joint| play.joint(joint));
        let check = |before: [Trs; 3], after: [Trs; 3], thrown: &MatchedSwitch, what: &str| {
            for (a, b) in before.iter().zip(&after) {
                let (moved, turned) = (a.translation.distance(b.translation), degrees(a.rotation, b.rotation));
                assert!(moved < 0.6e-4 && turned < 0.1, "{extra}, {what}: {moved} {turned}\n{before:?}\n{after:?}");
                assert!(thrown.distance < 0.6e-4 && thrown.angle < 0.1, "{extra}, {what}: {thrown:?}");
            }
        };
        for (number, [a, b, c]) in turns.into_iter().enumerate() {
            play.value(goal, "ik_fk", 0.0);
            for (control, turn) in [(upper, a), (lower, b), (hand, c)] {
                play.pose(control, [0.0; 3], turn);
            }
            let before = joints(&mut play);
            let thrown = play.match_switch(1.0);
            let after = joints(&mut play);
            check(before, after, &thrown, &format!("to inverse {number}"));
            // Somewhere on the way.
            let thrown = play.match_switch(0.4);
            let between = joints(&mut play);
            check(after, between, &thrown, &format!("between {number}"));
        }
        for (number, (moved, turned)) in goals.into_iter().enumerate() {
            play.value(goal, "ik_fk", 1.0);
            play.pose(goal, moved, Quat::from_rotation_y(turned));
            play.pose(pole, [0.1, 0.5 * turned, 0.0], Quat::IDENTITY);
            let before = joints(&mut play);
            let thrown = play.match_switch(0.0);
            let after = joints(&mut play);
            check(before, after, &thrown, &format!("to forward {number}"));
        }
    }
}

#[test]
fn what_is_left_of_a_jump_is_told() {
    // A goal that goes ahead of a soft limb also lengthens its bones where they stretch: the end stays, the elbow cannot.
    let (bench, tags) = arm_with_switch(&with_pole(", soft: 0.05, stretch: 0.5"));
    let mut play = bench.play();
    let [upper, lower, _, goal, _] = tags.map(|tag| play.knob(tag));
    play.value(goal, "ik_fk", 0.0);
    play.pose(upper, [0.0; 3], Quat::from_rotation_z(0.4));
    play.pose(lower, [0.0; 3], Quat::from_rotation_y(0.9));
    let before = [2, 3, 4].map(|joint| play.joint(joint));
    let thrown = play.match_switch(1.0);
    let after = [2, 3, 4].map(|joint| play.joint(joint));
    near(before[2].translation, after[2].translation, "the end");
    let moved = before[1].translation.distance(after[1].translation);
    assert!(moved > 1e-4 && (thrown.distance - moved).abs() < 1e-5, "{moved} {thrown:?}");
    assert!(thrown.angle > 0.1, "{thrown:?}");
}

#[test]
fn a_control_changes_spaces_without_a_jump() {
    let mut bench = Bench::new(&ARM);
    let root = bench.tag(1, "knob", "()");
    let head = bench.tag(1, "knob", "(at: (0, 1.7, 0), turn: 30)");
    let hand = bench.tag(4, "knob", &format!("(below: \"{}\", turn: 15)", knob(root)));
    bench.tag(
        4,
        "space_switch",
        &format!(
            "(control: \"{}\", spaces: \"{} + {} + {}\", names: [\"root\", \"head\", \"chest\"], default: 1)",
            knob(hand),
            knob(root),
            knob(head),
            joint(2)
        ),
    );
    let mut play = bench.play();
    let [root, head, hand] = [root, head, hand].map(|tag| play.knob(tag));
    let attribute = &play.built.node(hand).unwrap().attributes[0];
    assert_eq!((&*attribute.name, attribute.default), ("space", 1.0));
    near(play.at(hand).translation, Vec3::new(0.8, 1.4, 0.0), "as built");
    play.pose(head, [0.1, 0.2, 0.0], Quat::from_rotation_x(0.5));
    let carried = play.at(hand);
    assert!(carried.translation.distance(Vec3::new(0.8, 1.4, 0.0)) > 0.1, "it goes with the head");
    play.pose(root, [0.0, 0.0, 0.3], Quat::from_rotation_y(0.5));
    near(play.at(hand).translation, carried.translation, "and not with the root");
    play.pose(hand, [0.05, 0.0, 0.1], Quat::from_rotation_z(0.2));
    for space in [0.0, 2.0, 1.0, 0.0, 0.5] {
        let before = play.at(hand);
        let thrown = play.match_switch(space);
        let after = play.at(hand);
        near(before.translation, after.translation, "thrown");
        assert!(degrees(before.rotation, after.rotation) < 0.1);
        assert!(thrown.distance < 1e-4 && thrown.angle < 0.1, "{thrown:?}");
        assert_eq!(thrown.edits.len(), 2);
    }
}
