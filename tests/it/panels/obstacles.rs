//! Actions that can do nothing are greyed in panels, and say why under the pointer.

use bevy::math::Vec3;
use bevy_egui::egui::{Key, pos2};
use rigsmith::{
    editor::{
        actions::Action,
        library::LibraryAction,
        notice::Notice,
        palette::obstacle,
        panels::{
            controls::ControlsPanel, history::HistoryPanel, loader::LoaderPanel, log::LogPanel, process::ProcessPanel,
            tags::TagsPanel,
        },
    },
    plugins::{
        commands::{BuildRequest, BuildResult, BuildStep, Processor},
        document::Selection,
        stage::{RigStage, StageRequest},
    },
    prelude::*,
    rig::{Matching, PoseOffset},
};

use super::{desk::Desk, tag_values::add_command};

/// Asserts that a widget is greyed, and its reason.
#[track_caller]
pub(crate) fn assert_greyed(desk: &mut Desk, label: &str, reason: &str) {
    let widget = desk.find(label);
    assert!(!widget.enabled, "{label} is not greyed");
    // A widget that was clicked tells nothing until the pointer comes again.
    desk.move_to(pos2(3000.0, 3000.0));
    desk.frames(3);
    desk.move_to(widget.rect.center());
    desk.frames(60);
    assert!(desk.says(reason), "{label} does not say {reason:?}: {:?}", desk.seen);
    desk.move_to(pos2(3000.0, 3000.0));
    desk.frames(3);
}

#[test]
fn a_control_at_rest_is_not_reset() {
    let mut desk = Desk::new(ControlsPanel::default());
    let entity = desk.rig;
    desk.app.world_mut().entity_mut(entity).insert(crate::bench::shipped("biped"));
    desk.app.world_mut().write_message(BuildRequest { rig: entity, step: BuildStep::All });
    desk.frames(3);
    let built = desk.app.world().get::<BuildResult>(entity).unwrap().0.clone();
    let goals = built.switches.iter().filter_map(|switch| match &switch.matching {
        Matching::IkFk { goal, .. } => Some(*goal),
        Matching::Space { .. } => None,
    });
    let goals: Vec<Uid> = goals.collect();
    let why_not = |desk: &Desk| obstacle(desk.app.world(), Action::ResetPose);
    desk.app.world_mut().get_mut::<Selection>(entity).unwrap().0 = vec![goals[0]];
    desk.frames(2);
    let reason = "This control is at rest";
    assert_greyed(&mut desk, "Reset", reason);
    assert_eq!(why_not(&desk), Some("nothing is posed"));
    // The pose of another control is none of this one.
    let bent = PoseOffset { translation: Vec3::Y * 0.1, ..PoseOffset::IDENTITY };
    desk.edit(Operation::Pose(vec![(goals[1], bent)]));
    assert_greyed(&mut desk, "Reset", reason);
    assert_eq!(why_not(&desk), Some("nothing of what is selected is posed"));
    let steps = desk.steps().1;
    desk.click("Translation Y");
    desk.type_text("0.125");
    desk.key(Key::Enter);
    desk.frames(2);
    assert!(desk.find("Reset").enabled && why_not(&desk).is_none(), "{:?}", desk.seen);
    desk.click("Reset");
    desk.frames(2);
    assert_eq!(desk.steps().1, steps + 2);
    assert_greyed(&mut desk, "Reset", reason);
    // Without a selection all of the pose is meant.
    desk.select(&[]);
    assert_eq!(why_not(&desk), None);
}

#[test]
fn an_empty_log_is_not_cleared_and_not_copied() {
    let mut desk = Desk::new(LogPanel::default());
    desk.frames(2);
    for button in ["Clear", "Copy"] {
        assert_greyed(&mut desk, button, "The log is empty");
    }
    desk.app.world_mut().write_message(Notice::info("It began."));
    desk.frames(3);
    assert!(desk.find("Clear").enabled && desk.find("Copy").enabled, "{:?}", desk.seen);
    desk.click("Search");
    desk.type_text("ended");
    desk.frames(3);
    assert!(desk.find("Clear").enabled);
    assert_greyed(&mut desk, "Copy", "No entry is listed");
    desk.click("Clear");
    desk.frames(3);
    assert_greyed(&mut desk, "Clear", "The log is empty");
}

#[test]
fn a_rig_is_not_brought_to_its_own_stage() {
    let mut desk = Desk::new(ProcessPanel::default());
    desk.resize(777.0, 400.0);
    let [a, b] = desk.chain(&["a", "b"])[..] else { panic!() };
    for joint in [a, b] {
        add_command(&mut desk, joint, "control", "()");
    }
    desk.select(&[]);
    let go_to = |desk: &mut Desk, stage: RigStage| {
        desk.app.world_mut().write_message(StageRequest { rig: desk.rig, stage });
        desk.frames(4);
    };
    let why_not = |desk: &Desk, action| obstacle(desk.app.world(), Action::Library(action));
    let place = |desk: &Desk| desk.app.world().get::<Processor>(desk.rig).unwrap().builder().cursor();
    let open = |desk: &mut Desk, stage: &str| {
        let combo = desk.seen.iter().find(|seen| seen.value == stage && seen.clickable).expect("the stage").rect;
        desk.time += 1.0;
        desk.click_at(combo.center());
        desk.frames(3);
    };
    go_to(&mut desk, RigStage::Built);
    assert_eq!(place(&desk), 2);
    for step in ["Carry out the next command", "Carry out the next joint", "Run to the next breakpoint, or to the end"]
    {
        assert_greyed(&mut desk, step, "All commands are carried out");
    }
    assert_greyed(&mut desk, "Selection only", "Select the joints first");
    assert_eq!(why_not(&desk, LibraryAction::BuildRig), Some("the rig is built"));
    open(&mut desk, "Built");
    assert_greyed(&mut desk, "Built", "The rig is at this stage");
    assert!(desk.find("Edit").enabled && desk.find("Skeleton").enabled);
    desk.key(Key::Escape);
    desk.frames(3);

    // Commands that were stepped back since are carried out again.
    desk.click("Roll all back");
    desk.frames(3);
    assert_eq!(place(&desk), 0);
    for step in ["Roll all back", "Roll the last joint back", "Take the last command back"] {
        assert_greyed(&mut desk, step, "No command is carried out");
    }
    assert_eq!(why_not(&desk, LibraryAction::BuildRig), None);
    open(&mut desk, "Built");
    desk.click("Built");
    desk.frames(4);
    assert_eq!(place(&desk), 2, "{:?}", desk.told());

    for (stage, own, reason) in [
        (RigStage::Edit, LibraryAction::EditSkeleton, "the skeleton is being edited"),
        (RigStage::Skeleton, LibraryAction::LoadSkeleton, "the skeleton is loaded"),
        (RigStage::Deleted, LibraryAction::DeleteRig, "the rig is deleted"),
        (RigStage::Built, LibraryAction::BuildRig, "the rig is built"),
    ] {
        go_to(&mut desk, stage);
        let actions = [
            LibraryAction::EditSkeleton,
            LibraryAction::LoadSkeleton,
            LibraryAction::DeleteRig,
            LibraryAction::BuildRig,
        ];
        for action in actions {
            let wanted = (action == own).then_some(reason);
            assert_eq!(why_not(&desk, action), wanted, "{action:?} at {stage:?}");
        }
    }
}

#[test]
fn stages_of_the_loader_are_greyed_where_they_change_nothing() {
    let mut desk = Desk::new(LoaderPanel::default());
    desk.frames(2);
    let stages = [
        (RigStage::Edit, "Edit skeleton"),
        (RigStage::Skeleton, "Load skeleton"),
        (RigStage::Deleted, "Delete rig"),
        (RigStage::Built, "Build rig"),
    ];
    for (_, label) in stages {
        assert_greyed(&mut desk, label, "There are no joints: load a template first");
    }
    let [a, b] = desk.chain(&["a", "b"])[..] else { panic!() };
    for joint in [a, b] {
        add_command(&mut desk, joint, "control", "()");
    }
    desk.select(&[]);
    for (stage, own) in stages {
        desk.app.world_mut().write_message(StageRequest { rig: desk.rig, stage });
        desk.frames(4);
        assert_eq!(desk.find(own).on, Some(true), "{own}");
        assert_greyed(&mut desk, own, "The rig is at this stage");
        for (_, other) in stages.into_iter().filter(|(_, other)| *other != own) {
            assert!(desk.find(other).enabled, "{other} is greyed at {stage:?}");
        }
    }
    // Commands that were taken back since are carried out again.
    let place = |desk: &Desk| desk.app.world().get::<Processor>(desk.rig).unwrap().builder().cursor();
    desk.app.world_mut().write_message(BuildRequest { rig: desk.rig, step: BuildStep::RollBack });
    desk.frames(3);
    assert_eq!(place(&desk), 0);
    desk.click("Build rig");
    desk.frames(4);
    assert_eq!(place(&desk), 2, "{:?}", desk.told());
}

#[test]
fn build_buttons_of_the_controls_say_why_they_are_greyed() {
    let mut desk = Desk::new(ControlsPanel::default());
    desk.resize(400.0, 600.0);
    let [a, _] = desk.chain(&["a", "b"])[..] else { panic!() };
    add_command(&mut desk, a, "control", "()");
    desk.app.world_mut().write_message(BuildRequest { rig: desk.rig, step: BuildStep::All });
    desk.frames(3);
    for button in ["Build", "Carry out the next command"] {
        assert_greyed(&mut desk, button, "All commands are carried out");
    }
    desk.click("Roll back");
    desk.frames(3);
    for button in ["Roll back", "Take back the last command"] {
        assert_greyed(&mut desk, button, "No command is carried out");
    }
}

#[test]
fn greyed_buttons_of_the_history_and_the_tags_say_why() {
    let mut desk = Desk::new(HistoryPanel::default());
    desk.frames(2);
    assert_greyed(&mut desk, "⮪ Undo", "There is no step to undo");
    assert_greyed(&mut desk, "⮫ Redo", "Nothing was undone");
    desk.chain(&["a", "b"]);
    assert!(desk.find("⮪ Undo").enabled);
    desk.click("⮪ Undo");
    desk.frames(3);
    assert!(desk.find("⮫ Redo").enabled, "{:?}", desk.told());

    let mut desk = Desk::new(TagsPanel::default());
    let [a, _] = desk.chain(&["a", "b"])[..] else { panic!() };
    desk.select(&[a]);
    desk.frames(2);
    assert_greyed(&mut desk, "Paste", "Copy or cut tags first");
}
