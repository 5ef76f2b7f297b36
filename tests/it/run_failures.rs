//! Reasons why a built rig cannot run, in the names that people know.

use bevy::prelude::*;
use rigsmith::{
    editor::{ActiveRig, building::BuildingPlugin},
    headless::headless_app,
    plugins::commands::RunFailure,
    prelude::*,
    rig::TagKind,
    solve::program::ProgramError,
    test_app::strict_app,
};

use crate::bench::{RigBench, shipped};

/// Commands of a joint whose module has this name.
fn commands(rig: &Rig, joint: &str, wanted: &str) -> Vec<Uid> {
    let tags = &rig.joint(rig.find_label(joint).unwrap()).unwrap().data.tags;
    let is_meant = |kind: &TagKind| matches!(kind, TagKind::Command { module, .. } if module == wanted);
    tags.iter().filter(|tag| is_meant(&tag.kind)).map(|tag| tag.uid).collect()
}

/// A circle of the arm's commands, with texts that are full of uids.
fn cycle(rig: &Rig, commands: Vec<Uid>) -> RunFailure {
    let nodes: Vec<Uid> = ["forearm_l", "hand_l"].map(|label| rig.find_label(label).unwrap()).to_vec();
    let loop_text = format!("{} drives {}, on which the first depends", commands[0], nodes[0]);
    RunFailure(ProgramError::Cycle { loop_text, constraints: commands.clone(), commands, nodes })
}

#[test]
fn a_cycle_names_tags_and_joints() {
    let rig = shipped("biped");
    let (switch, control) = (commands(&rig, "hand_l", "ik_fk_switch")[0], commands(&rig, "upper_arm_l", "control")[0]);
    let words = cycle(&rig, vec![switch, control]).words(&rig);
    for part in ["\"ik fk switch on hand_l\"", "\"control on upper_arm_l\"", "\"forearm_l\" and \"hand_l\"", "turn one"]
    {
        assert!(words.contains(part), "{part} is not in: {words}");
    }
    let hand = rig.find_label("hand_l").unwrap();
    for uid in [switch, control, hand] {
        assert!(!words.contains(&uid.to_string()), "{uid} is in: {words}");
    }
    assert!(!words.contains("twice"), "{words}");
    // Two controls of a joint have the same name, as those of two parts of a kind have.
    let controls = commands(&rig, "hand_l", "control");
    let words = cycle(&rig, controls).words(&rig);
    assert!(words.contains("\"control on hand_l\" is there twice"), "{words}");
    // Tags that are gone leave the text of the program.
    let gone = cycle(&rig, vec![Uid(1)]);
    assert_eq!(gone.words(&rig), gone.0.to_string());
}

/// The command line, and apps without a window, tell a cycle of the program as the window does.
#[test]
fn apps_without_a_window_tell_a_cycle_by_names() {
    use rigsmith::{headless::Workbench, plugins::commands::BuildStep};

    let rig = shipped("biped");
    let mut bench = Workbench::with_rig(1, rig.clone());
    bench.build(BuildStep::All);
    assert!(bench.runtime().is_ok());
    let failure = cycle(&rig, commands(&rig, "hand_l", "ik_fk_switch"));
    let words = failure.words(&rig);
    let entity = bench.rig_entity();
    bench.app_mut().world_mut().entity_mut(entity).insert(failure);
    let told = bench.runtime().map(drop).unwrap_err().to_string();
    assert_eq!(told, format!("the built rig cannot run: {words}"));
}

/// A reference to two joints, of which the rig has the first alone, is blamed on the second.
#[cfg(feature = "cli")]
#[test]
fn a_build_tells_the_name_that_is_missing() {
    use std::fs;

    use rigsmith::{headless::Workbench, plugins::commands::BuildStep};

    use crate::cli_outputs::{json, rig};

    let folder = tempfile::tempdir().unwrap();
    let text = r#"(
        format: 2,
        name: "two",
        joints: [
            (label: "a", tags: [point(targets: "@joint b + @joint nope")]),
            (label: "b", translation: (1, 0, 0), tags: [control()]),
        ],
    )"#;
    fs::write(folder.path().join("two.rig.ron"), text).unwrap();
    let is_right = |told: &str| told.contains("there is no joint \"nope\"") && !told.contains("no joint \"b\"");
    for args in [&["build", "two.rig.ron"][..], &["pose", "two.rig.ron", "--set", "b.translate=(1,0,0)"]] {
        let (code, told) = json(folder.path(), args);
        let what = told["error"]["what"].as_str().unwrap();
        assert!(code == 1 && is_right(what), "{args:?}: {told}");
        let of_command = told["commands"][0]["error"].as_str();
        assert!(of_command.is_none_or(is_right), "{args:?}: {told}");
    }
    let mut bench = Workbench::with_rig(1, rig(folder.path(), "two.rig.ron"));
    let error = bench.build(BuildStep::All).error.unwrap().to_string();
    assert!(is_right(&error), "{error}");
}

#[test]
fn the_window_tells_a_cycle_by_names() {
    let mut app = headless_app(1);
    app.add_plugins(BuildingPlugin);
    let mut bench = RigBench::with(strict_app(app), shipped("biped"));
    bench.app.insert_resource(ActiveRig(bench.rig));
    (0..3).for_each(|_| bench.app.update());
    bench.notices();
    let failure = cycle(bench.rig(), commands(bench.rig(), "hand_l", "ik_fk_switch"));
    bench.app.world_mut().entity_mut(bench.rig).insert(failure);
    bench.app.update();
    let notices = bench.notices();
    let told = |part: &str| notices.iter().any(|notice| notice.text.contains(part));
    assert!(told("cannot run: the tags \"ik fk switch on hand_l\" wait for each other"), "{notices:?}");
}
