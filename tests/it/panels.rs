//! The editor's panels: what a person does in them reaches the rig as one step, and everything is told.

pub(crate) mod desk;
mod face;
mod features;
mod posing;
mod tags;
mod walk;
mod weights;

use std::collections::HashSet;

use bevy::prelude::*;
use bevy_egui::egui::{self, Key, Modifiers, Pos2};
use rigsmith::{
    editor::{
        actions::{Action, ActionRequest},
        dock::ShowPanel,
        mode::Mode,
        notice::{Notice, Severity},
        panel::EditorPanel,
        panels::{
            controls::ControlsPanel,
            hierarchy::{HierarchyPanel, rows::rows},
            history::HistoryPanel,
            log::{LogBook, LogPanel},
            poses::PosesPanel,
            process::ProcessPanel,
            properties::PropertiesPanel,
            skinning::{SkinningClaims, SkinningPanel, SkinningParts, SkinningResults},
            toasts::Toasts,
        },
    },
    plugins::{
        commands::{BuildRequest, BuildResult, BuildStep},
        document::HoveredNode,
        runtime::RigRuntime,
        skinning::{MeshPart, PartBinding, SkinningJob, held_objects},
        stage::RigStage,
    },
    prelude::*,
    rig::{TagKind, operations::TagOperation},
};

use crate::gestures::boxes;
use desk::{Desk, Sheet};

#[test]
fn the_filter_keeps_matches_and_what_is_above_them() {
    let mut desk = Desk::new(HierarchyPanel::default());
    let joints = desk.chain(&["hips", "spine", "Arm_L", "hand_L"]);
    desk.chain(&["tail"]);
    desk.edit(Operation::Group { joints: vec![joints[1]], name: "Trunk".into(), color: None });
    let cases: &[(&str, &[&str])] = &[
        ("", &["hips", "spine", "Arm_L", "hand_L", "tail"]),
        ("arm", &["hips", "spine", "Arm_L"]),
        ("trunk", &["hips", "spine"]),
        ("_l hand", &["hips", "spine", "Arm_L", "hand_L"]),
        ("TAIL", &["tail"]),
        ("nothing", &[]),
    ];
    for (filter, expected) in cases {
        let found = rows(desk.rig(), &HashSet::new(), filter);
        let labels: Vec<&str> = found.iter().map(|row| desk.label(row.joint)).collect();
        assert_eq!(labels, *expected, "{filter}");
    }
    let folded = rows(desk.rig(), &[joints[1]].into(), "");
    assert_eq!(folded.iter().map(|row| desk.label(row.joint)).collect::<Vec<_>>(), ["hips", "spine", "tail"]);

    // The same, typed.
    desk.click("Filter");
    desk.type_text("arm");
    desk.frames(2);
    assert!(desk.look("Arm_L").is_some() && desk.look("hips").is_some() && desk.look("tail").is_none());
    desk.click("Clear filter");
    desk.frames(2);
    assert!(desk.look("tail").is_some());
}

#[test]
fn the_filter_finds_joints_by_what_is_built_on_them() {
    let mut desk = Desk::new(HierarchyPanel::default());
    let joints = desk.chain(&["hips", "spine", "head"]);
    let kind = TagKind::Command { module: "space_switch".into(), params: "()".into(), feature: None };
    desk.edit(Operation::Tags(TagOperation::Add { joints: vec![joints[1]], kind, index: None }));
    let cases: &[(&str, &[&str])] =
        &[("Space", &["hips", "spine"]), ("space spine", &["hips", "spine"]), ("space head", &[])];
    for (filter, expected) in cases {
        let found = rows(desk.rig(), &HashSet::new(), filter);
        let labels: Vec<&str> = found.iter().map(|row| desk.label(row.joint)).collect();
        assert_eq!(labels, *expected, "{filter}");
    }
}

#[test]
fn built_nodes_are_listed_and_lead_to_their_commands() {
    let mut desk = Desk::new(HierarchyPanel::default());
    let [a, b] = desk.chain(&["a", "b"])[..] else { panic!() };
    let kind = TagKind::Command { module: "control".into(), params: "()".into(), feature: None };
    desk.edit(Operation::Tags(TagOperation::Add { joints: vec![b], kind, index: None }));
    desk.app.world_mut().write_message(BuildRequest { rig: desk.rig, step: BuildStep::All });
    desk.frames(3);
    let steps = desk.steps();
    desk.secondary_click("a");
    desk.click("Show all built nodes");
    desk.frames(2);
    assert!(desk.look("a, joint").is_some() && desk.look("b, joint").is_some(), "{:?}", desk.seen);
    let control = desk.seen.iter().find(|seen| seen.label.ends_with(", control")).expect("the control").label.clone();
    desk.click(&control);
    desk.frames(2);
    let [node] = desk.selected() else { panic!("{:?}", desk.selected()) };
    assert!(![a, b].contains(node) && desk.find(&control).on == Some(true));
    desk.secondary_click(&control);
    desk.click("Show the command that made it");
    desk.frames(2);
    assert_eq!(desk.selected(), [b]);
    // With words it is a list.
    desk.click("Filter");
    desk.type_text("control");
    desk.frames(2);
    assert!(desk.look("a, joint").is_none() && desk.look(&control).is_some(), "{:?}", desk.seen);
    desk.click("Clear filter");
    desk.click("Joints");
    desk.frames(2);
    assert!(desk.look("a").is_some() && desk.look(&control).is_none(), "{:?}", desk.seen);
    assert_eq!(desk.steps(), steps, "looking is no step");
}

#[test]
fn joints_are_renamed_in_place() {
    let mut desk = Desk::new(HierarchyPanel::default());
    let joints = desk.chain(&["a", "b", "c"]);
    let before = desk.steps().0;
    desk.double_click("b");
    assert_eq!(desk.selected(), [joints[1]]);
    desk.type_text("elbow");
    desk.key(Key::Enter);
    assert_eq!((desk.label(joints[1]), desk.steps().0), ("elbow", before + 1), "typing replaces the selected text");

    desk.click("a");
    desk.key(Key::F2);
    desk.type_text("dropped");
    desk.key(Key::Escape);
    assert_eq!((desk.label(joints[0]), desk.steps().0), ("a", before + 1), "Escape drops it");

    desk.key(Key::F2);
    desk.type_text("kept");
    desk.click("c");
    assert_eq!((desk.label(joints[0]), desk.steps().0), ("kept", before + 2), "a click elsewhere takes it");

    desk.key(Key::F2);
    desk.key(Key::Enter);
    assert_eq!(desk.steps().0, before + 2, "the same name is no step");
}

#[test]
fn drags_reparent_and_refuse_cycles() {
    let mut desk = Desk::new(HierarchyPanel::default());
    let [hips, spine, head] = desk.chain(&["hips", "spine", "head"])[..] else { panic!() };
    let [tail, tip] = desk.chain(&["tail", "tip"])[..] else { panic!() };
    let before = desk.steps().0;
    let at = |desk: &Desk, label: &str| desk.find(label).rect.center();

    let place = desk.rig().position(tail);
    desk.drag(at(&desk, "tail"), at(&desk, "hips"));
    assert_eq!((desk.parent(tail), desk.parent(tip), desk.steps().0), (Some(hips), Some(tail), before + 1));
    assert!(desk.rig().position(tail).distance(place) < 1e-5, "it stays where it is");

    desk.drag(at(&desk, "hips"), at(&desk, "head"));
    assert_eq!((desk.parent(hips), desk.steps().0), (None, before + 1));
    assert!(desk.told().last().is_some_and(|told| told.contains("hips cannot hang below head")), "{:?}", desk.told());

    desk.drag(at(&desk, "spine"), at(&desk, "spine") + egui::vec2(30.0, 1.0));
    assert_eq!(desk.steps().0, before + 1, "let go where it was");

    let below = desk.find("tip").rect.center() + egui::vec2(0.0, 300.0);
    desk.drag(at(&desk, "head"), below);
    assert_eq!((desk.parent(head), desk.steps().0), (None, before + 2), "the empty space makes roots");

    // What is selected goes along; what hangs below it anyway does not.
    desk.select(&[tip, tail, spine]);
    desk.drag(at(&desk, "tail"), at(&desk, "head"));
    assert_eq!([tip, tail, spine].map(|joint| desk.parent(joint)), [Some(tail), Some(head), Some(head)]);
    assert_eq!(desk.steps().0, before + 3);
}

#[test]
fn clicks_select_one_a_range_or_one_more() {
    let mut desk = Desk::new(HierarchyPanel::default());
    let joints = desk.chain(&["a", "b", "c", "d"]);
    desk.click("b");
    assert_eq!(desk.selected(), [joints[1]]);
    desk.hold(Modifiers::SHIFT);
    desk.click("d");
    assert_eq!(desk.selected(), [joints[1], joints[2], joints[3]], "the clicked one is active");
    desk.click("a");
    assert_eq!(desk.selected(), [joints[1], joints[0]], "a range begins where the last click was");
    desk.hold(Modifiers::COMMAND);
    desk.click("c");
    assert_eq!(desk.selected(), [joints[1], joints[0], joints[2]]);
    desk.click("a");
    assert_eq!(desk.selected(), [joints[1], joints[2]]);
    desk.hold(Modifiers::NONE);
    let steps = desk.steps();
    desk.key(Key::ArrowUp);
    assert_eq!(desk.selected(), [joints[1]], "the row above the active one");
    assert_eq!(desk.steps(), steps, "selecting is no step");

    // Both ways: what is selected elsewhere is unfolded and shown.
    desk.click("Fold all");
    desk.frames(2);
    assert!(desk.look("d").is_none());
    desk.select(&[joints[3]]);
    assert_eq!(desk.find("d").on, Some(true));

    // And the row under the pointer is the hovered joint.
    desk.move_to(desk.find("c").rect.center());
    desk.frames(2);
    assert_eq!(desk.app.world().get::<HoveredNode>(desk.rig), Some(&HoveredNode(Some(joints[2]))));
    desk.move_to(Pos2::new(150.0, 590.0));
    desk.frames(2);
    assert_eq!(desk.app.world().get::<HoveredNode>(desk.rig), Some(&HoveredNode(None)));
}

#[test]
fn the_menu_of_a_row_is_about_the_selection() {
    let mut desk = Desk::new(HierarchyPanel::default());
    let joints = desk.chain(&["a", "b", "c"]);
    let choose = |desk: &mut Desk, row: &str, entry: &str| {
        desk.secondary_click(row);
        desk.click(entry);
        desk.frames(2);
    };
    choose(&mut desk, "b", "Lock weights");
    assert_eq!(desk.selected(), [joints[1]]);
    assert!(desk.rig().joint(joints[1]).unwrap().data.locked);
    choose(&mut desk, "a", "Select hierarchy");
    assert_eq!(desk.selected(), [joints[1], joints[2], joints[0]]);
    desk.select(&[joints[1]]);
    choose(&mut desk, "b", "Delete");
    assert_eq!((desk.rig().len(), desk.parent(joints[2])), (2, Some(joints[0])));
    choose(&mut desk, "a", "Delete hierarchy");
    assert!(desk.rig().is_empty());
}

#[test]
fn a_field_is_one_step() {
    let mut desk = Desk::new(PropertiesPanel::default());
    let joints = desk.chain(&["a", "b", "c"]);
    desk.select(&[joints[1]]);
    let before = desk.steps().0;
    let child = desk.rig().position(joints[2]);

    let at = desk.find("Position X").rect.center();
    desk.drag(at, at + egui::vec2(80.0, 0.0));
    let x = desk.rig().position(joints[1]).x;
    assert!(x > 0.01, "{x}");
    assert_eq!(desk.steps().0, before + 1, "a drag of many pixels");
    assert!(desk.rig().position(joints[2]).distance(child) < 1e-5, "children stay");

    // The rig shows it before it is let go, and Escape takes it back.
    let steps = desk.steps();
    desk.time += 1.0;
    desk.press(at);
    desk.move_to(at + egui::vec2(20.0, 0.0));
    desk.move_to(at + egui::vec2(60.0, 0.0));
    assert!((desk.rig().position(joints[1]).x - x).abs() > 0.01);
    assert_eq!(desk.steps(), steps);
    desk.key(Key::Escape);
    desk.release(at);
    assert_eq!((desk.rig().position(joints[1]).x, desk.steps()), (x, steps));

    let typed = [
        ("Position Y", "1.25", 1.25),
        ("Local position Z", "-0,5", -0.5),
        ("Rotation X", "45°", 45.0),
        ("Scale Y", "2", 2.0),
    ];
    for (number, (field, text, value)) in typed.into_iter().enumerate() {
        desk.click(field);
        desk.type_text(text);
        desk.key(Key::Enter);
        desk.frames(2);
        assert_eq!(desk.steps().0, before + 2 + number, "{field}");
        let shown: f32 =
            desk.find(field).value.trim_start_matches(['X', 'Y', 'Z', ' ']).trim_end_matches('°').parse().unwrap();
        assert!((shown - value).abs() < 1e-3, "{field} shows {shown}");
    }
    let position = desk.rig().position(joints[1]);
    assert!((position.y - 1.25).abs() < 1e-5 && (position.z + 0.5).abs() < 1e-5, "{position}");

    let steps = desk.steps();
    desk.click("Scale X");
    desk.type_text("7");
    desk.key(Key::Escape);
    assert_eq!(desk.steps(), steps, "Escape");
    desk.click("Scale X");
    desk.type_text("seven");
    desk.key(Key::Enter);
    assert_eq!(desk.steps(), steps, "no number");
    desk.click("Scale X");
    desk.key(Key::Enter);
    assert_eq!(desk.steps(), steps, "Escape, no number, the same number");

    desk.click("Label");
    desk.type_text("x");
    desk.key(Key::Enter);
    assert_eq!((desk.label(joints[1]), desk.steps().0), ("bx", steps.0 + 1));
}

#[test]
fn several_joints_share_fields() {
    let mut desk = Desk::new(PropertiesPanel::default());
    let joints = desk.chain(&["a", "b", "c"]);
    desk.select(&joints);
    let before = desk.steps().0;
    assert!(desk.find("Position Y").value.contains("mixed"));
    assert!(!desk.find("Position X").value.contains("mixed"));

    desk.click("Position Y");
    // The active one's own height: the others get it, too.
    desk.type_text("2");
    desk.key(Key::Enter);
    assert_eq!(desk.steps().0, before + 1);
    assert!(joints.iter().all(|joint| (desk.rig().position(*joint).y - 2.0).abs() < 1e-5));

    desk.click("Label");
    desk.type_text("bone_#");
    desk.key(Key::Enter);
    assert_eq!(joints.iter().map(|joint| desk.label(*joint)).collect::<Vec<_>>(), ["bone_1", "bone_2", "bone_3"]);

    desk.click("Lock weights");
    assert!(joints.iter().all(|joint| desk.rig().joint(*joint).unwrap().data.locked));
    assert_eq!(desk.steps().0, before + 3);
}

#[test]
fn pose_mode_edits_the_pose_and_never_the_rest() {
    let mut desk = Desk::new(PropertiesPanel::default());
    let joints = desk.chain(&["a", "b"]);
    desk.select(&[joints[0]]);
    let rest = desk.rig().joint(joints[0]).unwrap().data.rest;
    desk.app.insert_resource(Mode::Pose);
    desk.frames(2);
    assert!(desk.look("Rotation X").is_none(), "no rest field is in reach");
    desk.click("Pose rotation Z");
    desk.type_text("30");
    desk.key(Key::Enter);
    let turned = desk.rig().offset(joints[0]).unwrap().rotation;
    assert!(turned.angle_between(Quat::from_rotation_z(30f32.to_radians())) < 1e-3);
    assert_eq!(desk.rig().joint(joints[0]).unwrap().data.rest, rest);
    desk.frames(2);
    desk.click("Reset pose of the selection");
    assert!(desk.rig().offset(joints[0]).is_none());
}

#[test]
fn poses_are_stored_applied_renamed_and_deleted() {
    let mut desk = Desk::new(PosesPanel::default());
    let joints = desk.chain(&["a", "b"]);
    let bent = rigsmith::rig::PoseOffset::from_rotation(Quat::from_rotation_z(1.0));
    desk.edit(Operation::Pose(vec![(joints[1], bent)]));
    desk.click("Pose name");
    desk.type_text("bent");
    desk.key(Key::Enter);
    desk.click("Store");
    let names = |desk: &Desk| desk.rig().stored_poses().iter().map(|pose| pose.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&desk), ["bent", "Pose 1"], "without a name it gets the next free one");
    desk.click("Reset all");
    assert!(desk.rig().pose().is_empty());
    desk.frames(2);
    desk.click("Apply");
    assert_eq!(desk.rig().pose().len(), 1);
    desk.double_click("bent");
    desk.type_text("waving");
    desk.key(Key::Enter);
    assert_eq!(names(&desk), ["waving", "Pose 1"]);
    desk.frames(2);
    desk.click("Delete");
    assert_eq!(names(&desk).len(), 1);

    desk.app.world_mut().write_message(ActionRequest(Action::ResetPose));
    desk.frame();
    assert!(desk.rig().pose().is_empty(), "the key does the same as the button");
}

#[test]
fn skinning_says_why_not_runs_once_and_can_be_cancelled() {
    let mut desk = Desk::new(SkinningPanel::default());
    assert!(!desk.find("Skin").enabled);
    desk.app.world_mut().write_message(ActionRequest(Action::Skin));
    desk.frames(2);
    assert!(desk.told().last().is_some_and(|told| told.contains("no mesh")), "{:?}", desk.told());
    // Two hundred thousand points are not done within a few frames.
    let grid: Vec<[[f32; 3]; 2]> = (0..25_000)
        .map(|i| {
            let (x, y, z) = ((i % 30) as f32, (i / 30 % 30) as f32, (i / 900) as f32);
            [[x * 0.03, y * 0.03, z * 0.03], [x * 0.03 + 0.029, y * 0.03 + 0.029, z * 0.03 + 0.029]]
        })
        .collect();
    let mesh = RigMesh::new(Uid(99), boxes(&grid), Vec::new());
    let mesh = desk.app.world_mut().spawn((mesh, SkinOf(desk.rig))).id();
    desk.frames(2);
    assert!(!desk.find("Skin").enabled, "there are no joints");
    desk.chain(&["a", "b"]);
    desk.frames(2);
    desk.click("Skin");
    desk.frames(2);
    assert!(desk.app.world().get::<SkinningJob>(mesh).is_some(), "it runs");
    desk.app.world_mut().write_message(ActionRequest(Action::Skin));
    desk.frames(2);
    assert!(desk.told().last().is_some_and(|told| told.contains("running")), "{:?}", desk.told());
    assert!(desk.app.world().get::<SkinningJob>(mesh).is_some(), "nothing is lost");
    desk.click("Cancel");
    wait(&mut desk, mesh);
    assert!(desk.rig().skin(Uid(99)).is_none());
    assert!(desk.told().last().is_some_and(|told| told.contains("cancelled")), "{:?}", desk.told());

    desk.app.world_mut().entity_mut(mesh).despawn();
    let small = RigMesh::new(Uid(98), boxes(&[[[-0.2, 0.0, -0.2], [0.2, 1.0, 0.2]]]), Vec::new());
    let small = desk.app.world_mut().spawn((small, SkinOf(desk.rig))).id();
    desk.frames(2);
    desk.click("Skin");
    wait(&mut desk, small);
    assert!(desk.rig().skin(Uid(98)).is_some());
    assert!(desk.told().last().is_some_and(|told| told.contains("100 %")), "{:?}", desk.told());
}

#[test]
fn parts_tell_what_holds_them_and_keep_to_choices() {
    let mut desk = Desk::new(SkinningPanel::default());
    desk.resize(320.0, 900.0);
    let boxes = boxes(&[[[-0.2, 0.0, -0.2], [0.2, 1.0, 0.2]], [[-0.1, 1.05, -0.1], [0.1, 1.2, 0.1]]]);
    let mesh = RigMesh::new(Uid(97), boxes, Vec::new());
    let mesh = desk.app.world_mut().spawn((mesh, SkinOf(desk.rig))).id();
    let joints = desk.chain(&["low", "high"]);
    desk.frames(2);
    desk.click("Skin");
    wait(&mut desk, mesh);
    desk.click("Parts (2)");
    desk.frames(30);
    let says =
        |desk: &Desk, text: &str| desk.seen.iter().any(|seen| seen.value.contains(text) || seen.label.contains(text));
    assert!(says(&desk, "Automatic: moves with low"), "{:?}", desk.seen);
    // The joint of a choice holds the object after the next computation.
    desk.select(&joints[1..]);
    let key = (Uid(97), MeshPart::Object(0));
    desk.app.world_mut().resource_mut::<SkinningParts>().0.insert(key, PartBinding::Rigid(joints[1]));
    desk.frames(2);
    assert!(says(&desk, "Moves with high"), "{:?}", desk.seen);
    desk.click("Skin");
    wait(&mut desk, mesh);
    let mesh = desk.app.world().get::<RigMesh>(mesh).unwrap();
    assert_eq!(held_objects(mesh, desk.rig().skin(Uid(97)).unwrap())[0], Some(joints[1]));
}

/// A box clicked free bends after the next computation and can be made rigid again; a joint far above the boxes is idle until
/// it claims skin.
#[test]
fn rigid_parts_and_idle_joints_have_a_choice_each() {
    let mut desk = Desk::new(SkinningPanel::default());
    desk.resize(360.0, 1400.0);
    let boxes = boxes(&[[[-0.2, 0.0, -0.2], [0.2, 1.0, 0.2]], [[-0.1, 1.05, -0.1], [0.1, 1.2, 0.1]]]);
    let mesh = RigMesh::new(Uid(97), boxes, Vec::new());
    let mesh = desk.app.world_mut().spawn((mesh, SkinOf(desk.rig))).id();
    let joints = desk.chain(&["low", "high", "far"]);
    desk.frames(2);
    desk.click("Skin");
    wait(&mut desk, mesh);
    open(&mut desk, "Rigid parts (");
    let rigid = {
        let report = desk.app.world().resource::<SkinningResults>().get(mesh).unwrap().as_ref().unwrap();
        assert!(report.idle_joints.iter().any(|idle| idle.joint == joints[2]), "{report:?}");
        report.rigid_parts.clone()
    };
    assert_eq!(desk.find("rigid").on, Some(true));
    desk.click("rigid");
    desk.frames(2);
    let chosen = desk.app.world().resource::<SkinningParts>().0.clone();
    let [(key, PartBinding::Bends)] = chosen.into_iter().collect::<Vec<_>>()[..] else { panic!("{:?}", desk.seen) };
    let first = rigid.into_iter().find(|rigid| (Uid(97), rigid.part) == key).unwrap();
    desk.click("Skin");
    wait(&mut desk, mesh);
    let bends = |desk: &Desk| {
        let report = desk.app.world().resource::<SkinningResults>().get(mesh).unwrap().as_ref().unwrap();
        let is_rigid = report.rigid_parts.iter().any(|rigid| rigid.part == first.part);
        !is_rigid && report.bending_parts.iter().any(|(part, name)| *part == first.part && *name == first.name)
    };
    assert!(bends(&desk));
    assert_eq!(desk.find("rigid").on, Some(false), "the row stays");
    desk.click("rigid");
    desk.frames(2);
    assert!(desk.app.world().resource::<SkinningParts>().0.is_empty());
    open(&mut desk, "Rigid parts (");
    open(&mut desk, "Idle joints (");
    desk.click("claims skin");
    desk.frames(2);
    assert_eq!(desk.app.world().resource::<SkinningClaims>().0.len(), 1);
    desk.click("claims skin");
    desk.frames(2);
    assert!(desk.app.world().resource::<SkinningClaims>().0.is_empty());
}

/// Clicks the header that begins with a text.
#[track_caller]
fn open(desk: &mut Desk, header: &str) {
    let seen = desk.seen.iter().find(|seen| seen.label.starts_with(header));
    let label = seen.unwrap_or_else(|| panic!("{header:?} is not among {:?}", desk.seen)).label.clone();
    desk.click(&label);
    desk.frames(30);
}

fn wait(desk: &mut Desk, mesh: Entity) {
    crate::bench::wait(desk, "the end of the job", Desk::frame, |desk| {
        desk.app.world().get::<SkinningJob>(mesh).is_none()
    });
    desk.frames(3);
}

#[test]
fn the_history_jumps() {
    let mut desk = Desk::new(HistoryPanel::default());
    for number in 0..6 {
        desk.edit(Operation::Place { position: Vec3::new(number as f32, 0.0, 0.0), parent: None });
    }
    assert_eq!(desk.find("6 Place joint").on, Some(true));
    for (row, joints) in [("2 Place joint", 2), ("0 Start", 0), ("5 Place joint", 5)] {
        desk.click(row);
        desk.frames(2);
        assert_eq!((desk.rig().len(), desk.steps()), (joints, (6, joints)), "{row}");
        assert_eq!(desk.find(row).on, Some(true));
    }
    desk.click("⮪ Undo");
    assert_eq!(desk.steps(), (6, 4));
    desk.click("⮫ Redo");
    assert_eq!(desk.steps(), (6, 5));
}

#[test]
fn everything_is_told_and_the_log_is_capped() {
    let mut desk = Desk::new(LogPanel::default());
    desk.edit(Operation::Delete { joints: vec![Uid(404)], keep_children: true });
    desk.frames(2);
    let told = desk.told();
    assert!(told.len() == 1 && told[0].starts_with("There is no joint"), "{told:?}");
    for number in 0..LogBook::CAPACITY + 300 {
        desk.app.world_mut().write_message(Notice::info(format!("notice {number}")));
    }
    for _ in 0..5 {
        desk.app.world_mut().write_message(Notice::warning("again"));
    }
    desk.frames(4);
    let book = desk.app.world().resource::<LogBook>();
    assert_eq!(book.entries().len(), LogBook::CAPACITY);
    assert_eq!(book.entries().next_back().map(|last| last.times), Some(5), "repetitions are counted");
    assert!(desk.look("again").is_some(), "the newest is in view");
    desk.click("Search");
    desk.type_text("notice 1234");
    desk.frames(3);
    assert!(desk.look("notice 1234").is_some() && desk.look("again").is_none());
    desk.click("Clear");
    desk.frames(2);
    assert!(desk.told().is_empty());
    // An entry leads to the panel that it is about.
    desk.click("Clear search");
    desk.app.world_mut().write_message(Notice::error("It stopped.").at("Process"));
    desk.frames(3);
    desk.click("It stopped.");
    desk.frames(2);
    desk.time += 1.0;
    let at = desk.find("Show in Process").rect.center();
    desk.press(at);
    desk.release(at);
    let shown: Vec<ShowPanel> = desk.app.world_mut().resource_mut::<Messages<ShowPanel>>().drain().collect();
    assert_eq!(shown, [ShowPanel("Process")]);
}

#[test]
fn toasts_are_few_and_errors_stay_longest() {
    let size = egui::vec2(1280.0, 720.0);
    let mut desk = Desk::with(Sheet::Overlay(Box::new(Toasts::default())), size);
    let shown = |desk: &Desk| desk.seen.iter().filter(|seen| seen.label == "Close").count();
    desk.app.world_mut().write_message(Notice::error("It cannot be. Do that instead."));
    desk.app.world_mut().write_message(Notice::info("not shown").quiet());
    for number in 0..7 {
        desk.app.world_mut().write_message(Notice::info(format!("notice {number}")));
    }
    desk.frames(4);
    assert_eq!(shown(&desk), 4);
    let low = desk.seen.iter().filter(|seen| seen.label == "Close").all(|seen| seen.rect.top() > 200.0);
    assert!(low, "none is near the toolbar");
    desk.time += 8.0;
    desk.frames(3);
    assert_eq!(shown(&desk), 1, "the error stays longer");
    desk.click("Close");
    desk.frames(2);
    assert_eq!(shown(&desk), 0);
    desk.app.world_mut().write_message(Notice::error("It cannot be. Do that instead."));
    desk.frames(3);
    assert_eq!(shown(&desk), 1);
    desk.time += 60.0;
    desk.frames(3);
    assert_eq!(shown(&desk), 0, "even an error goes, and is in the log");
    assert!(desk.told().iter().any(|told| told.starts_with("It cannot be")));
}

#[test]
fn a_toast_leads_to_the_panel_that_it_is_about() {
    let size = egui::vec2(1280.0, 720.0);
    let mut desk = Desk::with(Sheet::Overlay(Box::new(Toasts::default())), size);
    for (notice, name, panel) in [
        (Notice::error("The build stopped.").at("Process"), "Show in Process", "Process"),
        (Notice::warning("Something else."), "Show in the log", "Log"),
    ] {
        desk.app.world_mut().write_message(notice);
        desk.frames(4);
        desk.time += 1.0;
        let at = desk.find(name).rect.left_center() + egui::vec2(3.0, 0.0);
        desk.press(at);
        desk.release(at);
        let shown: Vec<ShowPanel> = desk.app.world_mut().resource_mut::<Messages<ShowPanel>>().drain().collect();
        assert_eq!(shown, [ShowPanel(panel)], "{name}");
    }
}

#[test]
fn equal_toasts_are_counted() {
    let size = egui::vec2(1280.0, 720.0);
    let mut desk = Desk::with(Sheet::Overlay(Box::new(Toasts::default())), size);
    let shown = |desk: &Desk| desk.seen.iter().filter(|seen| seen.label == "Close").count();
    let send = |desk: &mut Desk, notice: Notice| {
        desk.app.world_mut().write_message(notice);
    };
    send(&mut desk, Notice::warning("again"));
    send(&mut desk, Notice::warning("again"));
    desk.frames(3);
    assert!(desk.says("again ×2"), "{:?}", desk.seen);
    // Another one between them makes no second toast.
    send(&mut desk, Notice::info("other"));
    desk.frames(2);
    send(&mut desk, Notice::warning("again"));
    desk.frames(3);
    assert!(desk.says("again ×3") && desk.says("other") && shown(&desk) == 2, "{:?}", desk.seen);

    // A key pressed too often is told, as what it is.
    for change in [Change::Undo, Change::Undo, Change::Redo] {
        desk.app.world_mut().write_message(EditRequest { rig: desk.rig, change });
    }
    desk.frames(3);
    let book = desk.app.world().resource::<LogBook>();
    let told: Vec<_> = book.entries().map(|entry| (entry.notice.severity, entry.notice.text.as_str())).collect();
    let none = |what: &str| (Severity::Info, format!("There is nothing to {what}."));
    let [undo, redo] = ["undo", "redo"].map(none);
    assert!(told.contains(&(undo.0, undo.1.as_str())) && told.contains(&(redo.0, redo.1.as_str())), "{told:?}");
    assert!(desk.says("There is nothing to undo. ×2"), "{:?}", desk.seen);
}

/// A wrong number is told, and neither dropped nor taken: in the fields of a joint at rest and posed.
#[test]
fn wrong_numbers_are_told() {
    let mut desk = Desk::new(PropertiesPanel::default());
    let joints = desk.chain(&["a", "b"]);
    desk.select(&[joints[1]]);
    let (steps, before) = (desk.steps(), desk.rig().clone());
    let cases: &[(bool, &str, &str, &str)] = &[
        (false, "Position Y", "seven", "\"seven\" is no number"),
        (false, "Position Y", "1e20", "out of all proportion"),
        (false, "Scale X", "0", "flattens everything below"),
        (false, "Rotation Z", "99999", "more than ten turns"),
        (true, "Pose scale Y", "0", "flattens everything below"),
        (true, "Pose rotation X", "-99999", "more than ten turns"),
        (true, "Pose offset X", "inf", "\"inf\" is no number"),
    ];
    for (posing, field, text, reason) in cases {
        desk.app.insert_resource(if *posing { Mode::Pose } else { Mode::Move });
        desk.frames(2);
        desk.click(field);
        desk.type_text(text);
        desk.key(Key::Enter);
        desk.frames(2);
        let told = desk.told().pop().unwrap_or_default();
        assert!(told.starts_with(&format!("{field} stays as it was: ")) && told.contains(reason), "{field}: {told}");
        assert_eq!(desk.steps(), steps, "{field}");
    }
    assert_eq!(*desk.rig(), before);

    // What makes sense is taken, and undo brings back every byte.
    let text = |desk: &Desk| rigsmith::rig::template::write_template(desk.rig());
    let bytes = text(&desk);
    desk.app.insert_resource(Mode::Move);
    desk.frames(2);
    for (field, number) in [("Scale X", "0.5"), ("Rotation Z", "90"), ("Position Y", "100")] {
        desk.click(field);
        desk.type_text(number);
        desk.key(Key::Enter);
        desk.frames(2);
    }
    assert_eq!(desk.steps().1, steps.1 + 3, "{:?}", desk.told());
    for _ in 0..3 {
        desk.app.world_mut().write_message(EditRequest { rig: desk.rig, change: Change::Undo });
        desk.frames(2);
    }
    assert_eq!(text(&desk), bytes);
}

/// Steps of the history say which joint.
#[test]
fn steps_name_their_joints() {
    let mut desk = Desk::new(HistoryPanel::default());
    let joints = desk.chain(&["hips", "hand_l", "hand_r"]);
    let bent = rigsmith::rig::PoseOffset::from_rotation(Quat::from_rotation_z(1.0));
    let start = desk.rig().clone();
    let operations = [
        (Operation::Pose(vec![(joints[1], bent)]), "Pose hand_l"),
        (Operation::Pose(joints.iter().map(|joint| (*joint, bent)).collect()), "Pose hips and 2 more"),
        (Operation::ResetPose(vec![joints[2]]), "Reset hand_r"),
        (Operation::ResetPose(Vec::new()), "Reset pose"),
        (Operation::Move { to: vec![(joints[0], Vec3::ONE)], with_children: true }, "Move hips"),
        (Operation::Labels(vec![(joints[1], "wrist_l".to_owned())]), "Rename hand_l"),
        (Operation::Delete { joints: vec![joints[2]], keep_children: true }, "Delete hand_r"),
    ];
    let count = operations.len();
    let before = desk.steps().0;
    for (operation, title) in operations {
        desk.edit(operation);
        let history = desk.app.world().get::<rigsmith::plugins::history::RigHistory>(desk.rig).unwrap();
        assert_eq!(history.steps().0.last(), Some(&title));
    }
    let number = before + count;
    assert_eq!(desk.find(&format!("{number} Delete hand_r")).on, Some(true));
    for _ in 0..count {
        desk.app.world_mut().write_message(EditRequest { rig: desk.rig, change: Change::Undo });
        desk.frames(2);
    }
    assert_eq!(*desk.rig(), start);
}

#[test]
fn symbols_are_in_the_fonts() {
    let ctx = egui::Context::default();
    ctx.run_ui(egui::RawInput::default(), |_| {}).textures_delta.clear();
    let shape = |c: char| {
        let font = egui::FontId::proportional(13.0);
        let galley = ctx.fonts_mut(|fonts| fonts.layout_no_wrap(c.to_string(), font, egui::Color32::WHITE));
        galley.rows[0].glyphs[0].uv_rect
    };
    // What the fonts lack is drawn like what no font has.
    let missing: Vec<char> =
        "✖⏷⏵🗑✏🔒ℹ✔⚠⮪⮫×°…⏮⏪⏴▶⏸⏩⏭🔁🔑⏺⚑⌖👁".chars().filter(|c| shape(*c) == shape('\u{10fffd}')).collect();
    assert!(missing.is_empty(), "{missing:?}");
}

#[test]
fn nothing_is_cut_off_in_a_narrow_panel() {
    let panels: [(&str, fn() -> Box<dyn EditorPanel>); 6] = [
        ("hierarchy", || Box::new(HierarchyPanel::default())),
        ("properties", || Box::new(PropertiesPanel::default())),
        ("skinning", || Box::new(SkinningPanel::default())),
        ("poses", || Box::new(PosesPanel::default())),
        ("history", || Box::new(HistoryPanel::default())),
        ("log", || Box::new(LogPanel::default())),
    ];
    for (name, panel) in panels {
        let mut desk = Desk::with(Sheet::Panel(panel()), egui::vec2(180.0, 400.0));
        let joints = desk.chain(&["hips", "a_rather_long_label_of_a_joint_in_the_middle_of_the_spine", "head"]);
        desk.edit(Operation::Group { joints: joints.clone(), name: "A group with a long name".into(), color: None });
        desk.edit(Operation::StorePose("A pose with a name that is long".into()));
        desk.app.world_mut().write_message(Notice::error("A long sentence that says what went wrong, and where."));
        desk.select(&joints[1..2]);
        for width in [180.0, 260.0, 700.0] {
            desk.resize(width, 400.0);
            // The text in a field may be longer than the field, which cuts it off and scrolls: it has no label.
            for seen in desk.seen.iter().filter(|seen| !seen.label.is_empty()) {
                assert!(seen.rect.right() <= width + 0.5, "{name} at {width}: {seen:?}");
            }
        }
    }
}

#[test]
fn only_rows_in_view_are_drawn() {
    let [few, many] = [1_000, 5_000].map(|count| {
        let mut desk = Desk::with(Sheet::Panel(Box::new(HierarchyPanel::default())), egui::vec2(300.0, 640.0));
        let labels: Vec<String> = (0..count).map(|number| format!("joint_{number}")).collect();
        for chunk in labels.chunks(20) {
            let labels: Vec<&str> = chunk.iter().map(String::as_str).collect();
            let positions = (0..chunk.len()).map(|number| Vec3::new(0.0, number as f32, 0.0)).collect();
            let from = desk.rig().len();
            let edit = |desk: &mut Desk, operation| {
                desk.app.world_mut().write_message(EditRequest::operation(desk.rig, operation));
                desk.app.update();
            };
            edit(&mut desk, Operation::Chain { positions, parent: None });
            let joints: Vec<Uid> = desk.rig().walk().map(|joint| joint.data.uid).skip(from).collect();
            let named = joints.iter().zip(labels).map(|(uid, label)| (*uid, label.to_owned()));
            edit(&mut desk, Operation::Labels(named.collect()));
        }
        desk.frames(3);
        (desk.seen.len(), desk.shapes)
    });
    assert_eq!(few, many, "widgets and shapes");
    assert!(few.0 > 20 && few.1 > 20, "{few:?}");
}

#[test]
fn the_controls_panel_poses_resets_and_switches() {
    let mut desk = Desk::new(ControlsPanel::default());
    assert!(desk.says("The rig has no commands yet."));
    let rig = crate::bench::shipped("biped");
    let entity = desk.rig;
    desk.app.world_mut().entity_mut(entity).insert(rig);
    desk.app.world_mut().write_message(BuildRequest { rig: entity, step: BuildStep::All });
    desk.frames(3);
    let built = desk.app.world().get::<BuildResult>(entity).unwrap().0.clone();
    let switch = built.switches.iter().find(|switch| matches!(switch.matching, rigsmith::rig::Matching::IkFk { .. }));
    let switch = switch.unwrap();
    let rigsmith::rig::Matching::IkFk { goal, .. } = &switch.matching else { unreachable!() };
    let state = |desk: &Desk| desk.app.world().get::<RigRuntime>(entity).unwrap().state().clone();

    // The pose of the selected control.
    desk.app.world_mut().get_mut::<Selection>(entity).unwrap().0 = vec![*goal];
    desk.frames(2);
    let steps = desk.steps().0;
    desk.click("Translation Y");
    desk.type_text("0.125");
    desk.key(Key::Enter);
    desk.frames(2);
    assert_eq!(desk.steps().0, steps + 1);
    let slot = state(&desk).program().node(*goal).unwrap();
    assert_eq!(state(&desk).offset_at(slot).translation, Vec3::new(0.0, 0.125, 0.0));
    desk.click("Reset");
    desk.frames(2);
    assert_eq!(state(&desk).offset_at(slot).translation, Vec3::ZERO);

    // One of the limbs changes its kinematics.
    let inverse = |desk: &Desk| -> Vec<bool> {
        let state = state(desk);
        let is_ik = |switch: &std::sync::Arc<rigsmith::rig::SwitchData>| {
            state.attribute(switch.control, &switch.attribute).unwrap() >= 0.5
        };
        let limbs = built.switches.iter();
        limbs.filter(|switch| matches!(switch.matching, rigsmith::rig::Matching::IkFk { .. })).map(is_ik).collect()
    };
    assert!(desk.says("Switches"));
    // All of it in sight, so that a click meets it.
    desk.resize(320.0, 2400.0);
    let before = inverse(&desk);
    let steps = desk.steps().0;
    let is_other = |seen: &&desk::ShownWidget| ["FK", "IK"].contains(&&*seen.label) && seen.on == Some(false);
    let at = desk.seen.iter().find(is_other).expect("a limb with a value to choose").rect.center();
    desk.time += 1.0;
    desk.click_at(at);
    desk.frames(2);
    let changed = inverse(&desk).iter().zip(&before).filter(|(now, before)| now != before).count();
    assert_eq!((changed, desk.steps().0), (1, steps + 1));

    // The build steps back and forwards.
    let (place, all) = {
        let processor = desk.app.world().get::<rigsmith::plugins::commands::Processor>(entity).unwrap();
        (processor.builder().cursor(), processor.builder().len())
    };
    assert_eq!(place, all);
    desk.click("Take back the last command");
    desk.frames(2);
    let counts = desk.app.world().get::<rigsmith::plugins::commands::Processor>(entity).unwrap().builder().counts();
    let off = if counts.off == 0 { String::new() } else { format!(", {} off", counts.off) };
    assert!(counts.built < counts.all || counts.off > 0, "{counts:?}");
    assert!(desk.says(&format!("{} of {} commands{off}", counts.built, counts.all)), "{:?}", desk.seen);
}

#[test]
fn the_stage_of_a_rig_is_chosen_in_the_process_panel() {
    let mut desk = Desk::new(ProcessPanel::default());
    let rig = rigsmith::rig::template::read_template(crate::template_text::CHAIN.as_bytes()).unwrap().rig;
    let count = rig.len();
    let entity = desk.rig;
    desk.app.world_mut().entity_mut(entity).insert(rig);
    desk.app.world_mut().write_message(BuildRequest { rig: entity, step: BuildStep::All });
    desk.frames(3);
    let stage = |desk: &Desk| *desk.app.world().get::<RigStage>(entity).unwrap();
    assert_eq!(stage(&desk), RigStage::Built);
    for (name, wanted) in [("Edit", RigStage::Edit), ("Deleted", RigStage::Deleted), ("Built", RigStage::Built)] {
        let now = stage(&desk).name();
        let combo = desk.seen.iter().find(|seen| seen.value == now || seen.label == now).expect("the stage").rect;
        desk.time += 1.0;
        desk.click_at(combo.center());
        desk.frames(2);
        desk.click(name);
        desk.frames(3);
        assert_eq!(stage(&desk), wanted);
        let joints = desk.rig().len();
        assert_eq!(joints, if wanted == RigStage::Deleted { 0 } else { count });
    }
}

#[test]
fn commands_that_are_off_are_counted_apart() {
    let mut desk = Desk::new(ProcessPanel::default());
    let joints = desk.chain(&["a", "b", "c"]);
    let kind = TagKind::Command { module: "null".into(), params: "()".into(), feature: None };
    desk.edit(Operation::Tags(TagOperation::Add { joints: joints.clone(), kind, index: None }));
    desk.edit(Operation::Group { joints: vec![joints[1], joints[2]], name: "tail".into(), color: None });
    let group = desk.rig().joint(joints[1]).unwrap().data.group.unwrap();
    desk.app.world_mut().write_message(BuildRequest { rig: desk.rig, step: BuildStep::All });
    desk.frames(3);
    assert!(desk.says("3 of 3"), "{:?}", desk.seen);
    desk.edit(Operation::Tags(TagOperation::EnableGroup(group, false)));
    desk.frames(2);
    assert!(desk.says("1 of 1") && desk.says("2 off"), "{:?}", desk.seen);
    // What is off is no command to wait for, either.
    desk.app.world_mut().write_message(BuildRequest { rig: desk.rig, step: BuildStep::RollBack });
    desk.frames(2);
    assert!(desk.says("0 of 1") && desk.says("2 off"), "{:?}", desk.seen);
    let next = rigsmith::editor::next_step::next_step(desk.app.world());
    assert!(next.as_ref().is_some_and(|next| next.starts_with("Built 0 of 1 command, 2 off")), "{next:?}");
    desk.edit(Operation::Tags(TagOperation::EnableGroup(group, true)));
    desk.frames(2);
    assert!(!desk.says("2 off") && desk.says("0 of 3"), "{:?}", desk.seen);
}
