//! Names of controls, choices, nodes and features on the command line, and wrong ones.

use super::*;

#[test]
fn controls_are_named_by_name_label_or_reference() {
    let folder = folder();
    let run = |name: &str| pose(folder.path(), "crane.rig.ron", &["--set", &format!("{name}.rotate=(10,20,30)")]);
    let by_name = run("lift");
    assert!(place(&by_name, "hook").distance(Vec3::new(1.0, 1.0, 0.0)) > 0.1);
    for other in ["boom control", "@command control/lift role:control", "@any label:\"boom control\" type:control"] {
        assert_eq!(run(other)["nodes"], by_name["nodes"], "{other}");
    }
    // The label of the hand means the goal of the arm while the arm follows it, else the forward control.
    let arm = bundled("parts/arm");
    let rest = place(&pose(folder.path(), &arm, &[]), "hand_l");
    let kinematics = |switch: &str, set: &str| pose(folder.path(), &arm, &["--switch", switch, "--set", set]);
    let goal = kinematics("arm_l=ik", "hand_l.translate=(0,-0.05,0)");
    assert!((place(&goal, "hand_l").distance(rest) - 0.05).abs() < 1e-4, "{rest} {}", place(&goal, "hand_l"));
    assert!(place(&goal, "hand_l").distance(place(&goal, "hand_ik_l")) < 1e-4);
    let forward = kinematics("arm_l=fk", "hand_l.rotate=(0,0,30)");
    assert!(place(&forward, "hand_l").distance(rest) < 1e-4);
    let turned = quat(&node(&forward, "hand_l")["rotation"]).angle_between(quat(&node(&goal, "hand_l")["rotation"]));
    assert!((turned.to_degrees() - 30.0).abs() < 0.1, "{turned}");
}

/// A choice is set by its name or by its number. The name wins where it looks like a number.
#[test]
fn choices_are_set_by_name() {
    let folder = folder();
    let hook = |set: &str| place(&pose(folder.path(), "crane.rig.ron", &["--set", set]), "hook").x;
    let rest = hook("base.mode=slow");
    let table = [("base.mode=fast", 0.5), ("base.mode = 1", 0.5), ("base.mode=0", 1.0)];
    for (set, wanted) in table {
        let moved = hook(set) - rest;
        assert!((moved - wanted).abs() < 1e-5, "{set}: {moved}");
    }
}

#[test]
fn wrong_inputs_are_refused_and_write_nothing() {
    let folder = folder();
    fs::write(folder.path().join("broken.rig.ron"), CRANE.replace("control(follow_scale", "controll(follow_scale"))
        .unwrap();
    let (arm, biped) = (bundled("parts/arm"), bundled("biped"));
    let crane = "crane.rig.ron";
    let wrong_sets: &[(&str, i32, &str)] = &[
        ("lift", 2, "sets nothing"),
        ("lift.rotate", 2, "sets nothing"),
        ("lift.rotate=", 2, "sets nothing"),
        ("lift.rotate=(1,2)", 2, "sets nothing"),
        ("lift.rotate=(1,2,3,4)", 2, "sets nothing"),
        ("lift.rotate=(nan,0,0)", 2, "sets nothing"),
        ("lift.rotate=(inf,0,0)", 2, "sets nothing"),
        ("lift.rotate=1,2,3", 2, "sets nothing"),
        (".rotate=(1,2,3)", 2, "sets nothing"),
        ("base.turn=", 2, "sets nothing"),
        ("base.turn=much", 1, "write a number"),
        ("base.turn=nan", 1, "write a number"),
        ("base.mode=fats", 1, "write \"slow\", \"fast\" or \"0\""),
        ("lifd.rotate=(0,0,0)", 1, "lift"),
        ("base.trun=1", 1, "turn"),
        ("lift.turn=1", 1, "lift"),
        ("lift.rotte=(0,0,9)", 1, "\"lift\" has no attribute \"rotte\"; did you mean the channel \"rotate\"?"),
        ("base.transalte=(0,1,0)", 1, "did you mean the channel \"translate\"?"),
        ("hook.turn=1", 1, "\"hook\" has no attribute \"turn\"; it has none"),
        ("lift.translate=(1e20,0,0)", 1, "out of all proportion to the rig; write numbers up to"),
        ("lift.scale=(1e6,1,1)", 1, "out of all proportion"),
        ("lift.scale=(0,1,1)", 1, "flattens everything below"),
        ("lift.rotate=(0,99999,0)", 1, "more than ten turns"),
        ("hook.rotate=(0,0,0)", 1, "control"),
        ("@joint hook.rotate=(0,0,0)", 1, "control"),
        ("@joint nothing.rotate=(0,0,0)", 1, "nothing"),
        ("@.rotate=(0,0,0)", 1, "@"),
    ];
    let mut table: Vec<(Vec<&str>, i32, &str)> =
        wrong_sets.iter().map(|(set, code, words)| (vec![crane, "--set", set], *code, *words)).collect();
    table.extend([
        (vec![crane, "-o", "out.txt"], 2, "out.txt"),
        (vec![crane, "-o", "crane.rig.ron"], 2, "input"),
        (vec![crane, "--mesh", "block.obj", "-o", "block.obj"], 2, "block.obj"),
        (vec![crane, "--frames", "-1"], 2, "-1"),
        (vec![crane, "--frames", "many"], 2, "many"),
        (vec![crane, "--frames", "1000001"], 1, "--limit frames=1000001"),
        (vec![crane, "--mesh", "gone.obj", "-o", "out.glb"], 1, "gone.obj"),
        (vec!["gone.rig.ron"], 1, "gone.rig.ron"),
        (vec!["broken.rig.ron", "-o", "out.glb"], 1, "controll"),
        (vec![crane, "--group", "leg=off"], 2, "arm"),
        (vec![crane, "--switch", "arm"], 2, "NAME=VALUE"),
        (vec![crane, "--switch", "arm=fk"], 1, "no switch"),
        (vec![&arm, "--switch", "arm_x=fk"], 1, "arm_settings_l"),
        (vec![&arm, "--switch", "arm_l=wk"], 1, "ik"),
        (vec![&arm, "--switch", "arm_l=nan"], 1, "ik"),
        (vec![&biped, "--group", "arm_r=off", "--switch", "arm_r=fk"], 1, "the group arm_r is off; turn it on"),
        (vec![&biped, "--feature", "ik=off", "--switch", "arm_r=fk"], 1, "the feature ik is off; turn it on"),
        (vec![&biped, "--feature", "ik=off", "--set", "hand_r.rotate=(0,0,9)"], 1, "ik is off"),
        (vec![crane, "--group", "arm=off", "--set", "lift.rotate=(0,0,9)"], 1, "in the group arm, which is off"),
        (vec![&biped, "--feature", "fingers=curl=off", "--set", "thumb_01_l.curl=1"], 1, "fingers:curl"),
        (
            vec![&biped, "--feature", "arm_l:ik=off", "--switch", "hand_ik_l=chest"],
            1,
            "\"hand_ik_l\" is not built: control/hand_l is in the feature ik, which is off; turn it on",
        ),
        (
            vec![&biped, "--feature", "arm_l:ik=off", "--switch", "arm_settings_l=fk"],
            1,
            "\"arm_settings_l\" is not built: the feature ik is off; turn it on",
        ),
        (
            vec![&biped, "--feature", "arm_l:ik=off", "--set", "arm_settings_l.ik_fk=1"],
            1,
            "the feature ik is off there",
        ),
        (
            vec![&biped, "--group", "hand_l=off", "--set", "thumb_1_l.rotate=(0,9,0)"],
            1,
            "did you mean \"thumb_01_l\"? It is not built: thumb_01_l is in the group hand_l, which is off; turn it on",
        ),
        (vec![&biped, "--feature", "leg_l:fingers=off"], 2, "the group \"leg_l\" has no feature \"fingers\"; it is in"),
    ]);
    let names = |folder: &Path| -> BTreeSet<String> {
        let entries = fs::read_dir(folder).unwrap();
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    };
    let before = names(folder.path());
    for (args, code, words) in table {
        let answer = rigsmith(folder.path(), &[&["pose"], &args[..]].concat());
        assert_eq!(answer.code, code, "{args:?}: {}{}", answer.out, answer.err);
        assert!(answer.err.contains(words), "{args:?} says \"{words}\": {}", answer.err);
        assert_eq!(names(folder.path()), before, "{args:?} writes nothing");
    }
    assert_eq!(fs::read_to_string(folder.path().join(crane)).unwrap(), CRANE);
    // One wrong value: none is written, and all is said by the exit code with --json, too.
    let answer = rigsmith(folder.path(), &["pose", crane, "--json", "--set", "lift.rotate=(0,0,9)", "--set", "x.y=1"]);
    assert_eq!(answer.code, 1);
    assert_eq!(answer.json()["ok"], false);
    // All switches are listed once where none has a similar name.
    let answer = rigsmith(folder.path(), &["pose", &arm, "--switch", "zzzzzzzz=fk"]);
    assert_eq!(answer.err.matches("arm_settings_l.ik_fk").count(), 1, "{}", answer.err);
    // Whoever says so may.
    let answer = rigsmith(folder.path(), &["pose", crane, "-o", crane, "--in-place"]);
    assert_eq!(answer.code, 0, "{}", answer.err);
    assert!(fs::read_to_string(folder.path().join(crane)).unwrap() != CRANE);
}

/// The uid of a node, as --json gives it, names it.
#[test]
fn nodes_are_named_by_their_uids() {
    let folder = folder();
    let json = pose(folder.path(), "crane.rig.ron", &[]);
    let uid = node(&json, "lift")["uid"].as_str().unwrap().to_owned();
    let by_uid = pose(folder.path(), "crane.rig.ron", &["--set", &format!("{uid}.rotate=(0,0,30)")]);
    let by_name = pose(folder.path(), "crane.rig.ron", &["--set", "lift.rotate=(0,0,30)"]);
    assert_eq!(by_uid["nodes"], by_name["nodes"]);
}

/// A feature is named by the group that bears it, and by the group on whose joints it acts.
#[test]
fn features_of_one_limb_are_named_by_either_group() {
    let folder = folder();
    let nodes = |feature: &str| pose(folder.path(), &bundled("biped"), &["--feature", feature])["nodes"].clone();
    assert_eq!(nodes("hand_l:fingers=off"), nodes("arm_l:fingers=off"));
    assert_ne!(nodes("hand_l:fingers=off"), nodes("hand_r:fingers=off"));
}

#[test]
fn a_reference_to_joints_says_what_names_their_controls() {
    let folder = folder();
    let args = ["pose", "crane.rig.ron", "--set", "@hierarchy root type:joint.translate=(0,0.1,0)"];
    let answer = rigsmith(folder.path(), &args);
    assert_eq!(answer.code, 1);
    assert!(answer.err.contains("no control") && !answer.err.contains("did you mean"), "{}", answer.err);
    let biped = bundled("biped");
    let answer = rigsmith(folder.path(), &["pose", &biped, "--set", "@joint hand_l.translate=(0,0.1,0)"]);
    assert!(answer.code == 1 && answer.err.contains("write \"hand_l\""), "{}", answer.err);
}
