//! Tails and other chains that swing.

use rigsmith::files::PartFiles;

use super::*;

/// Lets time pass.
fn wait(stage: &mut Stage, seconds: f32) {
    for _ in 0..(seconds * 60.0) as usize {
        stage.state.evaluate(1.0 / 60.0);
    }
}

#[test]
fn a_chain_lags_behind_and_settles() {
    for (name, root, tip) in [("tail", "tail_1", "tail_6"), ("spring_chain", "chain_1", "chain_5")] {
        let mut stage = Stage::new(part(name));
        wait(&mut stage, 0.5);
        stage.check_rest(&format!("{name} after a while"));
        // Where it would be without lag.
        let turn = Quat::from_rotation_x(0.6);
        let mut stiff = Stage::new(part(name));
        stiff.set(root, "swing", 0.0);
        let control = stiff.control(root, "circle");
        stiff.rotate(control, turn);
        stiff.state.evaluate(1.0);
        let (start, wanted) = (stage.place(tip), stiff.place(tip));
        let way = start.distance(wanted);
        assert!(way > 0.1, "{name}");

        stage.rotate(control, turn);
        wait(&mut stage, 0.05);
        let early = stage.place(tip).distance(wanted) / way;
        assert!(early > 0.4, "{name}: after a moment {early} of the way is left");
        // It swings past and comes back, less each time, until it stands.
        let mut furthest: f32 = 0.0;
        let direction = (wanted - start).normalize();
        for _ in 0..60 {
            wait(&mut stage, 1.0 / 60.0 + 1e-4);
            furthest = furthest.max((stage.place(tip) - start).dot(direction) / way);
        }
        assert!(furthest > 1.02, "{name} does not swing: {furthest}");
        wait(&mut stage, 4.0);
        let late = stage.place(tip).distance(wanted) / way;
        assert!(late < 0.01, "{name}: after five seconds {late} of the way is left");
        assert!(stage.place(root).distance(stiff.place(root)) < 1e-5, "{name}: its root does not swing");
    }
}

#[test]
fn lag_can_be_tuned() {
    let after = |damping: f32, frequency: f32| {
        let mut stage = Stage::new(part("tail"));
        stage.set("tail_1", "damping", damping);
        stage.set("tail_1", "frequency", frequency);
        stage.state.evaluate(1.0 / 60.0);
        let control = stage.control("tail_1", "circle");
        let start = stage.place("tail_6");
        stage.rotate(control, Quat::from_rotation_x(0.5));
        wait(&mut stage, 0.1);
        stage.place("tail_6").distance(start)
    };
    assert!(after(0.35, 6.0) > 1.5 * after(0.35, 1.0), "a stiff spring follows sooner");
}

#[test]
fn bending_one_control_bends_the_rest_of_the_tail() {
    let mut stage = Stage::new(part("tail"));
    stage.set("tail_1", "swing", 0.0);
    let control = stage.control("tail_3", "circle");
    let before: Vec<Vec3> = (1..=6).map(|n| stage.place(&format!("tail_{n}"))).collect();
    stage.rotate(control, Quat::from_rotation_x(0.5));
    let after: Vec<Vec3> = (1..=6).map(|n| stage.place(&format!("tail_{n}"))).collect();
    for n in 0..6 {
        let moved = after[n].distance(before[n]);
        assert_eq!(moved > 1e-4, n > 2, "tail_{} moved by {moved}", n + 1);
    }
    assert!(after[5].y > before[5].y, "it goes up");
}

#[test]
fn the_tail_follows_a_curve() {
    let mut stage = Stage::new(part("tail"));
    stage.set("tail_1", "swing", 0.0);
    stage.set("tail_1", "curve", 1.0);
    // A curve through three points runs near the joints, and not exactly through all of them.
    assert!(stage.off_rest().0 < 0.05 * stage.height(), "{:?}", stage.off_rest());
    let end = stage.control("tail_6", "diamond");
    let before = stage.place("tail_6");
    stage.shift(end, Vec3::new(0.12, 0.0, 0.0));
    let tip = stage.place("tail_6");
    let goal = stage.global(end).translation;
    assert!(tip.distance(goal) < 0.6 * before.distance(goal), "{tip} is not near {goal}, from {before}");
    let lengths = |stage: &Stage| -> Vec<f32> {
        (1..6).map(|n| stage.place(&format!("tail_{n}")).distance(stage.place(&format!("tail_{}", n + 1)))).collect()
    };
    for (now, was) in lengths(&stage).iter().zip(lengths(&Stage::new(part("tail")))) {
        assert!((now / was - 1.0).abs() < 1e-3, "bones keep their length");
    }
    // Off the curve nothing of it is left.
    stage.set("tail_1", "curve", 0.0);
    stage.check_rest("tail off its curve");
}

/// The part `spring_chain` with options, beside two joints at places.
fn chain_beside(places: [Vec3; 2], options: &str) -> Stage {
    let joint = |label: &str, at: Vec3| format!("(label: \"{label}\", translation: ({}, {}, {}))", at.x, at.y, at.z);
    let text = format!(
        "(format: 2, name: \"t\", joints: [(label: \"head\", translation: (0, 1, 0)), {}, {}], parts: [\
         (part: \"parts/spring_chain.rig.ron\", name: \"hair\", parent: \"head\", adds: true, options: {{{options}}})])",
        joint("ball", places[0]),
        joint("far", places[1]),
    );
    let template = PartFiles::given(&BTreeMap::new()).complete(Path::new("t.rig.ron"), text.as_bytes()).unwrap();
    assert_eq!(template.notes, [""; 0]);
    let mut stage = Stage::new(template.rig);
    wait(&mut stage, 0.5);
    stage
}

#[test]
fn colliders_of_a_spring_chain_keep_it_out() {
    let tip = chain_beside([Vec3::ZERO, Vec3::X], "").place("chain_5");
    let (aside, radius) = (Vec3::new(0.0, 0.0, 0.03), 0.08);
    let ball = tip + aside;
    let away = |stage: &Stage| stage.place("chain_5").distance(ball);
    let free = chain_beside([ball, Vec3::X], "");
    assert!(away(&free) < 0.5 * radius, "nothing keeps it out: {}", away(&free));
    let kept = chain_beside([ball, Vec3::X], "\"colliders\": \"@joint ball\", \"radii\": [0.08]");
    assert!(away(&kept) > 0.99 * radius && away(&kept) < 1.5 * radius, "the tip lies on the ball: {}", away(&kept));
    let free_root = free.place("chain_1").distance(kept.place("chain_1"));
    assert!(free_root < 1e-5, "the root stays: {free_root}");

    // A body from joint to joint, whose ends are out of reach.
    let ends = [ball - 0.5 * Vec3::X, ball + 0.5 * Vec3::X];
    let line = "\"colliders\": \"@joint ball\", \"radii\": [0.08]";
    let off_axis = |stage: &Stage| (stage.place("chain_5") - ball).reject_from(Vec3::X).length();
    assert!(off_axis(&chain_beside(ends, line)) < 0.5 * radius, "a ball at one end touches nothing");
    let kept = chain_beside(ends, &format!("{line}, \"collider_ends\": \"@joint far\""));
    assert!(off_axis(&kept) > 0.97 * radius, "{}", off_axis(&kept));
}
