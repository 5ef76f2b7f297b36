//! The library of poses, selection sets, and the menu of a control.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_egui::egui::{self, Key, Pos2};
use rigsmith::{
    editor::{
        actions::{Action, ActionRequest},
        camera::ViewportSight,
        mode::Mode,
        panels::{poses::PosesPanel, selection_sets::SelectionSetsPanel, timeline::TimelineRequest},
        pointer::ViewportArea,
    },
    plugins::{
        commands::{BuildRequest, BuildResult, BuildStep},
        document::HoveredNode,
        runtime::RigRuntime,
    },
    prelude::*,
    rig::{
        AttributeKind, BuiltRig, JointData, Matching, PoseOffset, RestTransform,
        animation::{Key as ClipKey, Property, RigClip, Track, TrackTarget},
        operations::{MirrorPlane, WholePose},
        project::{Project, ProjectRig, read_project, write_project},
        template::write_template,
    },
};

use super::desk::{Desk, Sheet, ShownWidget};

/// Two arms that are partners, with the left one bent.
fn arms(panel: impl rigsmith::editor::panel::EditorPanel) -> (Desk, [Uid; 3]) {
    let mut desk = Desk::with(Sheet::Panel(Box::new(panel)), egui::vec2(300.0, 900.0));
    let [hips, left, right] = [Uid(11), Uid(12), Uid(13)];
    let joint = |uid, label: &str, x: f32, mirror: Option<Uid>| JointData {
        uid,
        label: Some(label.to_owned()),
        rest: RestTransform::from_translation(Vec3::new(x, 1.0, 0.0)),
        mirror,
        ..default()
    };
    let add = |joint: JointData, parent| RigEdit::AddJoint { joint: Box::new(joint), parent, index: 9 };
    desk.edit(Operation::Edits(vec![
        add(joint(hips, "hips", 0.0, None), None),
        add(joint(left, "arm_l", 1.0, Some(right)), Some(hips)),
        add(joint(right, "arm_r", -1.0, Some(left)), Some(hips)),
    ]));
    desk.edit(Operation::Pose(vec![(left, bent(0.8))]));
    desk.select(&[]);
    (desk, [hips, left, right])
}

fn bent(angle: f32) -> PoseOffset {
    PoseOffset::from_rotation(Quat::from_rotation_z(angle))
}

/// Everything of the rig that is saved, poses included.
fn bytes(desk: &Desk) -> String {
    let rig = desk.rig();
    format!("{}{:?}{:?}", write_template(rig), rig.pose(), rig.selection_sets())
}

#[track_caller]
fn assert_turned(desk: &Desk, joint: Uid, angle: f32) {
    let turn = desk.rig().offset(joint).copied().unwrap_or_default().rotation;
    assert!(turn.angle_between(Quat::from_rotation_z(angle)) < 2e-3, "{turn} for {angle}");
}

/// Does something that is one step; undo takes it back to the byte.
#[track_caller]
fn one_step(desk: &mut Desk, what: impl FnOnce(&mut Desk), check: impl FnOnce(&Desk)) {
    let (before, steps) = (bytes(desk), desk.steps().1);
    what(desk);
    desk.frames(3);
    check(desk);
    assert_eq!(desk.steps().1, steps + 1, "one step");
    assert_ne!(bytes(desk), before);
    desk.undo(1);
    assert_eq!((bytes(desk), desk.steps().1), (before, steps));
}

#[test]
fn poses_are_mirrored_and_reset_in_one_step() {
    let (mut desk, [_, left, right]) = arms(PosesPanel::default());
    assert!(!desk.find("Mirror selected").enabled && !desk.find("Reset selected").enabled, "nothing is selected");
    one_step(
        &mut desk,
        |desk| desk.click("Flip all"),
        |desk| {
            assert_turned(desk, left, 0.0);
            assert_turned(desk, right, -0.8);
        },
    );
    desk.select(&[left]);
    one_step(
        &mut desk,
        |desk| desk.click("Mirror selected"),
        |desk| {
            assert_turned(desk, left, 0.8);
            assert_turned(desk, right, -0.8);
        },
    );
    one_step(&mut desk, |desk| desk.click("Reset selected"), |desk| assert!(desk.rig().pose().is_empty()));
    one_step(&mut desk, |desk| desk.click("Reset all"), |desk| assert!(desk.rig().pose().is_empty()));
    // The key does the same.
    let act = |desk: &mut Desk| {
        desk.app.world_mut().write_message(ActionRequest(Action::MirrorPose));
    };
    one_step(&mut desk, act, |desk| assert_turned(desk, right, -0.8));
    desk.select(&[]);
    one_step(&mut desk, act, |desk| assert_turned(desk, left, 0.0));
}

#[test]
fn no_card_of_a_pose_is_cut_and_each_is_reached_at_every_height() {
    let (mut desk, _) = arms(PosesPanel::default());
    let names: Vec<String> = (1..=5).map(|number| format!("Pose {number}")).collect();
    names.iter().for_each(|_| desk.click("Store"));
    desk.frames(3);
    for height in (140..=640).step_by(25) {
        let (width, height) = (257.0, height as f32);
        desk.resize(width, height);
        // A list that ends between cards may end this side of the panel's edge.
        let middle = egui::pos2(width / 2.0, height - 75.0);
        desk.scroll(middle, 5000.0);
        let is_high = height > 350.0;
        if is_high {
            assert!(desk.find("Store").rect.bottom() < height && desk.look("Pose 1").is_some(), "{height}");
            for card in desk.seen.iter().filter(|seen| names.contains(&seen.label)) {
                assert!(card.rect.bottom() <= height, "{} at {height}: {:?}", card.label, card.rect);
            }
        }
        desk.scroll(middle, -5000.0);
        let last = desk.find("Pose 5").rect;
        assert!(last.top() >= 0.0 && last.bottom() <= height, "the last one at {height}: {last:?}");
        let is_whole = |seen: &ShownWidget| seen.label == "Delete" && last.contains_rect(seen.rect);
        assert!(desk.seen.iter().any(is_whole), "its buttons at {height}: {:?}", desk.seen);
    }
}

#[test]
fn a_stored_pose_goes_to_all_to_the_selection_or_to_the_other_side() {
    let (mut desk, [hips, left, right]) = arms(PosesPanel::default());
    desk.edit(Operation::Pose(vec![(hips, bent(0.3))]));
    desk.click("Store");
    desk.frames(2);
    desk.edit(Operation::ResetPose(Vec::new()));
    let more = |desk: &mut Desk, entry: &str| {
        desk.click("More of Pose 1");
        desk.frames(2);
        desk.click(entry);
    };
    one_step(
        &mut desk,
        |desk| desk.click("Apply"),
        |desk| {
            assert_turned(desk, hips, 0.3);
            assert_turned(desk, left, 0.8);
        },
    );
    desk.select(&[left]);
    one_step(
        &mut desk,
        |desk| more(desk, "Apply to selected"),
        |desk| {
            assert_turned(desk, hips, 0.0);
            assert_turned(desk, left, 0.8);
        },
    );
    one_step(
        &mut desk,
        |desk| more(desk, "Apply mirrored"),
        |desk| {
            assert_turned(desk, hips, -0.3);
            assert_turned(desk, left, 0.0);
            assert_turned(desk, right, -0.8);
        },
    );
    desk.select(&[right]);
    one_step(
        &mut desk,
        |desk| more(desk, "Apply mirrored to selected"),
        |desk| {
            assert_turned(desk, hips, 0.0);
            assert_turned(desk, right, -0.8);
        },
    );
}

#[test]
fn a_slider_tweens_to_a_stored_pose() {
    let (mut desk, [_, left, _]) = arms(PosesPanel::default());
    desk.click("Store");
    desk.frames(2);
    desk.edit(Operation::ResetPose(Vec::new()));
    assert!(!desk.find("Tween").enabled, "no pose is chosen");
    desk.click("Pose 1");
    desk.frames(2);
    let rect = desk.find("Tween").rect;
    let at = |share: f32| Pos2::new(rect.left() + rect.width() * share, rect.center().y);
    one_step(
        &mut desk,
        |desk| desk.drag(at(0.05), at(0.5)),
        |desk| {
            let turn = desk.rig().offset(left).unwrap().rotation.angle_between(Quat::IDENTITY);
            assert!((turn - 0.4).abs() < 0.08, "{turn}");
        },
    );
    one_step(
        &mut desk,
        |desk| desk.drag(at(0.05), at(1.2)),
        |desk| {
            assert_eq!(desk.rig().offset(left), Some(&bent(0.8)), "the end is exact");
        },
    );
    // Escape takes it back, and the release makes no step.
    let (before, steps) = (bytes(&desk), desk.steps());
    desk.press(at(0.05));
    desk.move_to(at(0.5));
    desk.frames(2);
    assert_ne!(bytes(&desk), before);
    desk.key(Key::Escape);
    desk.frames(2);
    assert_eq!(bytes(&desk), before);
    desk.release(at(0.7));
    desk.frames(3);
    assert_eq!((bytes(&desk), desk.steps()), (before, steps));
}

#[test]
fn whole_poses_are_mixed_and_mirrored_twice_to_themselves() {
    let (desk, [_, left, right]) = arms(PosesPanel::default());
    let rig = desk.rig();
    let mut pose = WholePose::of(rig);
    pose.offsets.insert(right, PoseOffset { translation: Vec3::new(0.1, 0.2, -0.3), ..bent(0.2) });
    pose.values.entry(left).or_default().insert("twist".into(), 3.0);
    let twice = pose.mirrored(rig, None, &MirrorPlane::sagittal(1.0)).mirrored(rig, None, &MirrorPlane::sagittal(1.0));
    assert_eq!(twice.values, pose.values);
    for (node, offset) in &pose.offsets {
        let other = twice.offsets[node];
        assert!(other.rotation.angle_between(offset.rotation) < 1e-4, "{node}");
        assert!(other.translation.distance(offset.translation) < 1e-5, "{node}");
    }
    let rest = WholePose::default();
    assert_eq!((rest.towards(&pose, 0.0, None), rest.towards(&pose, 1.0, None)), (rest.clone(), pose.clone()));
    let half = rest.towards(&pose, 0.5, None).offsets[&left].rotation;
    assert!(half.angle_between(Quat::from_rotation_z(0.4)) < 1e-3);
}

#[test]
fn selections_are_stored_recalled_and_kept_in_the_project() {
    let (mut desk, [hips, left, right]) = arms(SelectionSetsPanel::default());
    assert!(!desk.find("Store").enabled, "nothing is selected");
    desk.select(&[left, right]);
    one_step(
        &mut desk,
        |desk| desk.click("Store"),
        |desk| {
            assert_eq!(desk.rig().selection_sets()[0].nodes, [left, right]);
        },
    );
    desk.click("Set name");
    desk.type_text("arms");
    desk.key(Key::Enter);
    desk.frames(2);
    desk.select(&[hips]);
    desk.click("arms");
    desk.frames(3);
    assert_eq!(desk.selected(), [left, right]);
    let file = Project {
        name: "sets".into(),
        rigs: vec![ProjectRig { rig: desk.rig().clone(), skins: Vec::new() }],
        ..Project::default()
    };
    let text = write_project(&file);
    let read = read_project(text.as_bytes()).unwrap().project;
    assert_eq!(read.rigs[0].rig.selection_sets(), desk.rig().selection_sets());
    assert_eq!(write_project(&read), text);
    one_step(&mut desk, |desk| desk.click("Delete set"), |desk| assert!(desk.rig().selection_sets().is_empty()));
    // A node that is gone stays in the set, and is passed over.
    desk.edit(Operation::Delete { joints: vec![right], keep_children: true });
    desk.select(&[hips]);
    desk.click("arms");
    desk.frames(3);
    assert_eq!((desk.selected(), desk.rig().selection_sets()[0].nodes.len()), (&[left][..], 2));
}

/// The window with the bundled biped, built, in Pose mode.
fn built_biped() -> (Desk, Arc<BuiltRig>) {
    let mut desk = Desk::with(Sheet::Window, egui::vec2(900.0, 700.0));
    let (entity, rig) = (desk.rig, crate::bench::shipped("biped"));
    desk.app.world_mut().entity_mut(entity).insert(rig);
    desk.app.world_mut().write_message(BuildRequest { rig: entity, step: BuildStep::All });
    desk.app.insert_resource(Mode::Pose);
    desk.frames(4);
    let built = Arc::clone(&desk.app.world().get::<BuildResult>(entity).unwrap().0);
    (desk, built)
}

/// The bundled biped, with the menu of the control of its left hand.
#[test]
fn the_menu_of_a_control_switches_kinematics_without_a_jump() {
    let (mut desk, built) = built_biped();
    let entity = desk.rig;
    let hand = built.find_label("hand_l").unwrap().uid;
    let switch = built.switches.iter().find(|switch| match &switch.matching {
        Matching::IkFk { joints, .. } => joints.contains(&hand),
        Matching::Space { .. } => false,
    });
    let switch = switch.unwrap().clone();
    let Matching::IkFk { goal, .. } = &switch.matching else { panic!("a limb") };
    let middle = Pos2::new(450.0, 350.0);
    desk.secondary_click_at(middle);
    assert!(desk.look("Reset pose").is_none(), "nothing is under the pointer");
    desk.app.world_mut().entity_mut(entity).insert(HoveredNode(Some(*goal)));
    desk.frames(2);
    desk.secondary_click_at(middle);
    assert_eq!(desk.selected(), [*goal]);
    for entry in ["Reset pose", "Mirror pose to the other side", "Store selection as a set"] {
        assert!(desk.look(entry).is_some(), "{entry} is not in {:?}", desk.seen);
    }
    let state = |desk: &Desk| desk.app.world().get::<RigRuntime>(entity).unwrap().state().clone();
    let value = state(&desk).attribute(switch.control, &switch.attribute).unwrap();
    let place = |desk: &Desk| state(desk).global(hand).unwrap().translation;
    let (before, steps) = (place(&desk), desk.steps().1);
    let names = ["FK", "fk", "IK", "ik", "Fk", "Ik"];
    let other = desk.seen.iter().find(|seen| names.contains(&seen.label.as_str()) && seen.on != Some(true));
    let other = other.unwrap_or_else(|| panic!("no value in {:?}", desk.seen)).rect.center();
    desk.click_at(other);
    desk.frames(4);
    assert_ne!(state(&desk).attribute(switch.control, &switch.attribute), Some(value));
    assert!(place(&desk).distance(before) < 1e-3, "the hand jumps");
    assert_eq!(desk.steps().1, steps + 1);
    assert!(desk.look("Reset pose").is_none(), "the menu is closed");
    desk.undo(1);
    assert_eq!(state(&desk).attribute(switch.control, &switch.attribute), Some(value));
    desk.secondary_click_at(middle);
    assert!(desk.look("Reset pose").is_some());
    desk.key(Key::Escape);
    desk.frames(2);
    assert!(desk.look("Reset pose").is_none());
}

/// The pointer has gone to another joint by the end of the slow frame in which it clicked.
#[test]
fn the_menu_is_that_of_the_joint_under_the_click() {
    let mut desk = Desk::with(Sheet::Window, egui::vec2(800.0, 800.0));
    let [low, high] = desk.chain(&["low", "high"])[..] else { panic!() };
    let sight = crate::viewport_app::front();
    let [here, there] = [low, high].map(|joint| sight.project(desk.rig().position(joint)).unwrap());
    let area = ViewportArea { size: Vec2::splat(800.0), scale: 1.0, pointer: Some(there), ..default() };
    desk.app.insert_resource(ViewportSight(Some(sight))).insert_resource(area).insert_resource(Mode::Pose);
    let rig = desk.rig;
    desk.app.world_mut().entity_mut(rig).insert(HoveredNode(Some(high)));
    desk.secondary_click_at(Pos2::new(here.x, here.y));
    assert_eq!(desk.selected(), [low]);
    assert!(desk.look("Reset pose").is_some(), "{:?}", desk.seen);
}

/// The control of the left hand in a posed biped, whose spaces are at other places than at rest.
#[test]
fn the_menu_of_a_control_changes_its_space_without_a_jump() {
    let (mut desk, built) = built_biped();
    let entity = desk.rig;
    let hand = built.nodes.iter().find(|node| *node.name == *"hand_ik_l").expect("the control").uid;
    let is_of_hand = |switch: &Matching| matches!(switch, Matching::Space { control } if *control == hand);
    let switch = built.switches.iter().find(|switch| is_of_hand(&switch.matching)).expect("spaces").clone();
    let others = built.nodes.iter().filter(|node| node.control.is_some() && node.uid != hand);
    desk.edit(Operation::Pose(others.map(|node| (node.uid, bent(0.2))).collect()));
    desk.frames(3);
    assert!(!desk.rig().pose().is_empty());
    let state = |desk: &Desk| desk.app.world().get::<RigRuntime>(entity).unwrap().state().clone();
    let value = |desk: &Desk| state(desk).attribute(switch.control, &switch.attribute).unwrap();
    let place = |desk: &Desk| state(desk).global(hand).unwrap();
    let (first, before, rig, steps) = (value(&desk), place(&desk), desk.rig().clone(), desk.steps().1);
    // Without a matching pose the hand would go along with the other space.
    let jumps = |number: &usize| {
        let mut other = state(&desk);
        other.set_attribute(switch.control, &switch.attribute, *number as f32).unwrap();
        other.evaluate(0.0);
        other.global(hand).unwrap().translation.distance(before.translation) > 1e-2
    };
    let carrier = built.node(switch.control).unwrap();
    let attribute = carrier.attributes.iter().find(|known| known.name == switch.attribute).expect("the attribute");
    let AttributeKind::Choice(names) = &attribute.kind else { panic!("{attribute:?}") };
    let number = (0..names.len()).find(jumps).expect("a space elsewhere");

    desk.app.world_mut().entity_mut(entity).insert(HoveredNode(Some(hand)));
    desk.frames(2);
    let middle = Pos2::new(450.0, 350.0);
    desk.secondary_click_at(middle);
    // Another switch may have spaces of the same names.
    let title = format!("Space ({} {})", carrier.name, switch.attribute);
    let title = desk.seen.iter().find(|seen| seen.label == title || seen.value == title);
    let title = title.unwrap_or_else(|| panic!("no spaces in {:?}", desk.seen)).rect;
    let entries = desk.seen.iter().filter(|seen| seen.label == names[number] && seen.rect.top() >= title.top());
    let entry = entries.min_by(|a, b| a.rect.top().total_cmp(&b.rect.top())).expect("the space").clone();
    assert_eq!(entry.on, Some(false), "{entry:?}");
    desk.click_at(entry.rect.center());
    desk.frames(4);
    assert!((value(&desk) - number as f32).abs() < 1e-6, "the space is {} in place of {number}", value(&desk));
    let after = place(&desk);
    assert!(after.translation.distance(before.translation) < 1e-3, "the hand jumps");
    assert!(after.rotation.angle_between(before.rotation) < 2e-3, "the hand turns");
    assert_eq!(desk.steps().1, steps + 1, "one step");
    assert_ne!(*desk.rig(), rig);
    desk.undo(1);
    assert_eq!((value(&desk), desk.rig(), desk.steps().1), (first, &rig, steps));
    assert!(place(&desk).translation.distance(before.translation) < 1e-6);
}

#[test]
fn a_slider_tweens_the_shown_pose_to_a_neighbouring_key() {
    let (mut desk, [_, left, _]) = arms(PosesPanel::default());
    desk.edit(Operation::ResetPose(Vec::new()));
    let mut clip = RigClip { range: [0.0, 2.0], ..RigClip::new(Uid(71), Uid(72), "wave") };
    let keys = [0.0_f32, 1.0].map(|time| ClipKey::rotation(time, Quat::from_rotation_z(time))).to_vec();
    clip.layers[0].tracks.insert(TrackTarget { node: left, property: Property::Rotation }, Arc::new(Track { keys }));
    desk.edit(Operation::Edits(vec![RigEdit::AddClip(Box::new(clip), 0)]));
    for request in [TimelineRequest::Open(Some(Uid(71))), TimelineRequest::Scrub(0.5)] {
        desk.app.world_mut().write_message(request);
        desk.frames(3);
    }
    assert!(desk.says("1 joint is posed"), "what the clip shows: {:?}", desk.seen);
    let choose = |desk: &mut Desk, target: &str| {
        let combo = desk.find("Tween to").rect.center();
        desk.time += 1.0;
        desk.click_at(combo);
        desk.frames(2);
        desk.click(target);
        desk.frames(2);
    };
    for (target, angle) in [("Key after", 1.0), ("Key before", 0.0)] {
        choose(&mut desk, target);
        let rect = desk.find("Tween").rect;
        let at = |share: f32| Pos2::new(rect.left() + rect.width() * share, rect.center().y);
        let (before, steps) = (bytes(&desk), desk.steps().1);
        desk.drag(at(0.05), at(0.5));
        desk.frames(2);
        assert_eq!(desk.steps().1, steps + 1);
        let turn = desk.rig().offset(left).expect("a pose").rotation.angle_between(Quat::IDENTITY);
        assert!((turn - (0.5 + angle) / 2.0).abs() < 0.06, "{target}: {turn}");
        desk.undo(1);
        assert_eq!(bytes(&desk), before, "{target}");
    }
}
