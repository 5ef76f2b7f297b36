//! The editor's panels: what a person does in them reaches the rig as one step, and everything is told.

pub(crate) mod desk;
mod face;
pub(crate) mod face_drag;
mod features;
mod group_colors;
mod groups;
mod hierarchy;
mod looks;
mod notices;
pub(crate) mod obstacles;
mod posing;
mod process;
mod saved_forms;
mod skinning;
mod stepping;
mod tag_lists;
mod tag_values;
mod tags;
mod titles;
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
            hierarchy::{
                HierarchyPanel,
                rows::{flat_rows, rows},
            },
            history::HistoryPanel,
            log::{LogBook, LogPanel},
            poses::PosesPanel,
            process::ProcessPanel,
            properties::PropertiesPanel,
            skinning::{SkinningClaims, SkinningPanel, SkinningParts, SkinningResults, SkinningSettings},
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
    desk.undo(3);
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
    desk.undo(count);
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

/// Nodes that commands made have no properties of their own: the panel says where their values are.
#[test]
fn properties_say_where_the_values_of_controls_are() {
    let mut desk = Desk::new(PropertiesPanel::default());
    let entity = desk.rig;
    desk.app.world_mut().entity_mut(entity).insert(crate::bench::shipped("biped"));
    desk.app.world_mut().write_message(BuildRequest { rig: entity, step: BuildStep::All });
    desk.frames(4);
    let built = desk.app.world().get::<BuildResult>(entity).unwrap().0.clone();
    let made = built.nodes.iter().find(|node| desk.rig().joint(node.uid).is_none()).unwrap().uid;
    desk.app.world_mut().get_mut::<Selection>(entity).unwrap().0 = vec![made];
    desk.frames(2);
    let hint = "Commands made what is selected. Controls has the values of controls, Tags the commands of joints.";
    assert!(desk.says(hint));
}
