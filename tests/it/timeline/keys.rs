//! Keys by hand: selected, dragged, scaled, set, and set with each pose.

use rigsmith::{editor::dock::Layout, plugins::history::RigHistory};

use super::*;

fn frames(times: &[f32]) -> Vec<f32> {
    times.iter().map(|time| (time * 30.0 * 100.0).round() / 100.0).collect()
}

#[test]
fn keys_are_selected_by_clicks() {
    let (mut desk, [_, left, right]) = opened();
    let keys = |desk: &Desk, node: Uid| timeline(desk).keys.get(&turned(node)).cloned().unwrap_or_default();
    desk.time += 1.0;
    desk.click_at(at(&desk, "arm_l", 1.0));
    assert_eq!((keys(&desk, left), selected(&desk)), (vec![1.0], 1));
    desk.hold(Modifiers::SHIFT);
    desk.time += 1.0;
    desk.click_at(at(&desk, "arm_r", 0.0));
    assert_eq!((keys(&desk, left), keys(&desk, right)), (vec![1.0], vec![0.0]));
    desk.hold(Modifiers::COMMAND);
    desk.time += 1.0;
    desk.click_at(at(&desk, "arm_l", 1.0));
    assert_eq!((keys(&desk, left), keys(&desk, right)), (vec![], vec![0.0]), "Control takes it out again");
    desk.hold(Modifiers::NONE);
    // The row of all keys selects a whole column; beside the keys a click selects none.
    desk.time += 1.0;
    desk.click_at(at(&desk, "All keys", 2.0));
    assert_eq!((keys(&desk, left), keys(&desk, right)), (vec![2.0], vec![2.0]));
    desk.time += 1.0;
    desk.click_at(at(&desk, "arm_l", 1.5));
    assert_eq!(selected(&desk), 0);
    // Names select in the viewport, tracks their keys.
    desk.click("arm_r");
    assert_eq!(desk.selected(), [right]);
    desk.click("Unfold arm_l");
    desk.frames(2);
    desk.click("arm_l rotation");
    assert_eq!(keys(&desk, left), [0.0, 0.51, 1.0, 2.0]);
    desk.double_click("arm_r");
    assert_eq!((keys(&desk, right).len(), selected(&desk)), (4, 4));
}

#[test]
fn a_box_selects_keys() {
    let (mut desk, [_, left, right]) = opened();
    let steps = desk.steps();
    let from = at(&desk, "arm_l", 0.3) - egui::vec2(0.0, 6.0);
    let to = at(&desk, "arm_r", 1.2);
    desk.drag(from, to);
    let wanted: KeyTimes = [left, right].map(|node| (turned(node), vec![0.51, 1.0])).into();
    assert_eq!(timeline(&desk).keys, wanted);
    // With Shift more; from below and from the right as well.
    desk.hold(Modifiers::SHIFT);
    desk.drag(at(&desk, "arm_r", 2.05) + egui::vec2(0.0, 5.0), at(&desk, "arm_r", 1.8) - egui::vec2(0.0, 5.0));
    assert_eq!(timeline(&desk).keys[&turned(right)], [0.51, 1.0, 2.0]);
    assert_eq!(timeline(&desk).keys[&turned(left)], [0.51, 1.0]);
    assert_eq!(desk.steps(), steps, "a selection is no step");
}

#[test]
fn dragged_keys_fall_on_frames_in_one_step() {
    let (mut desk, [_, left, right]) = opened();
    let (before, steps) = (bytes(&desk), desk.steps().1);
    // 12 frames later, from a pixel beside the key.
    let from = at(&desk, "arm_l", 1.0);
    desk.drag(from + egui::vec2(2.0, 0.0), at(&desk, "arm_l", 1.4) + egui::vec2(3.0, 0.0));
    assert_eq!(frames(&times(&desk, left)), [0.0, 15.3, 42.0, 60.0]);
    assert_eq!(times(&desk, left)[2], (42.0 / 30.0f64) as f32, "the time of the frame itself");
    assert_eq!(frames(&times(&desk, right)), [0.0, 15.3, 30.0, 60.0]);
    assert_eq!(desk.steps().1, steps + 1);
    // The dragged key is what is selected, and it goes on from there.
    let wanted: KeyTimes = [(turned(left), vec![(42.0 / 30.0f64) as f32])].into();
    assert_eq!(timeline(&desk).keys, wanted);
    undo(&mut desk);
    assert_eq!((bytes(&desk), desk.steps().1), (before.clone(), steps));

    // A whole column, over a key that it replaces; between frames with Alt.
    desk.hold(Modifiers::ALT);
    desk.drag(at(&desk, "All keys", 1.0), at(&desk, "All keys", 1.111));
    desk.hold(Modifiers::NONE);
    assert!((times(&desk, left)[2] - 1.111).abs() < 3e-3 && times(&desk, left)[2] != 1.1, "{:?}", times(&desk, left));
    assert_eq!(times(&desk, left), times(&desk, right));
    undo(&mut desk);
    desk.drag(at(&desk, "All keys", 1.0), at(&desk, "All keys", 2.0));
    assert_eq!(frames(&times(&desk, right)), [0.0, 15.3, 60.0]);
    undo(&mut desk);
    assert_eq!(bytes(&desk), before);
}

#[test]
fn a_drag_previews_and_escape_drops_it() {
    let (mut desk, [_, left, _]) = opened();
    let (before, steps) = (bytes(&desk), desk.steps());
    ask(&mut desk, TimelineRequest::Scrub(1.2));
    let place = at(&desk, "arm_l", 1.0);
    desk.time += 1.0;
    desk.press(place);
    desk.move_to(place + egui::vec2(20.0, 0.0));
    desk.move_to(at(&desk, "arm_l", 1.4));
    desk.frames(2);
    assert_eq!(frames(&times(&desk, left))[2], 42.0);
    assert!(desk.app.world().get::<RigHistory>(desk.rig).unwrap().is_previewing());
    // The pose is that of the moved keys: 1.2 s lies before the stepped one now.
    assert!(shown(&desk, left).angle_between(Quat::from_rotation_z(0.5)) > 3e-2);
    desk.key(KeyboardKey::Escape);
    desk.release(at(&desk, "arm_l", 1.4));
    desk.frames(3);
    assert_eq!((bytes(&desk), desk.steps()), (before, steps));
    assert_turned(&desk, left, 0.5);
}

#[test]
fn keys_are_scaled_about_the_playhead() {
    let (mut desk, [_, left, right]) = opened();
    let steps = desk.steps().1;
    ask(&mut desk, TimelineRequest::Scrub(0.0));
    act(&mut desk, TimelineAction::SelectAll);
    desk.hold(Modifiers::COMMAND);
    desk.drag(at(&desk, "arm_l", 2.0), at(&desk, "arm_l", 1.0));
    desk.hold(Modifiers::NONE);
    for node in [left, right] {
        assert_eq!(frames(&times(&desk, node)), [0.0, 7.65, 15.0, 30.0]);
    }
    assert_eq!(desk.steps().1, steps + 1);
    // What is copied comes in at the playhead.
    ask(&mut desk, TimelineRequest::Scrub(1.5));
    let one: KeyTimes = [(turned(left), vec![0.5, 1.0])].into();
    ask(&mut desk, TimelineRequest::Select(one));
    act(&mut desk, TimelineAction::Copy);
    act(&mut desk, TimelineAction::Paste);
    assert_eq!(frames(&times(&desk, left)), [0.0, 7.65, 15.0, 30.0, 45.0, 60.0]);
}

#[test]
fn rows_of_tracks_and_of_all_keys_have_the_menu_of_keys() {
    let (mut desk, [_, left, right]) = opened();
    let before = bytes(&desk);
    desk.click("Unfold arm_l");
    desk.frames(2);
    desk.secondary_click("arm_l rotation");
    desk.frames(2);
    let wanted: KeyTimes = [(turned(left), times(&desk, left))].into();
    assert_eq!(timeline(&desk).keys, wanted, "a right click selects the keys of the row");
    desk.click("Delete keys");
    desk.frames(3);
    assert!(times(&desk, left).is_empty() && times(&desk, right).len() == 4);
    undo(&mut desk);
    assert_eq!(bytes(&desk), before);
    desk.secondary_click("All keys");
    desk.frames(2);
    assert_eq!(selected(&desk), 8);
    desk.click("Delete keys");
    desk.frames(3);
    assert!(times(&desk, left).is_empty() && times(&desk, right).is_empty());
    undo(&mut desk);
    assert_eq!(bytes(&desk), before);
    // Of more keys than those of the row, the menu is that of all of them.
    act(&mut desk, TimelineAction::SelectAll);
    desk.secondary_click("arm_l rotation");
    desk.frames(2);
    assert_eq!(selected(&desk), 8);
}

/// A command hides the panel, or another one comes forward, while the pointer rests.
#[test]
fn a_hidden_panel_takes_no_keys() {
    let (mut desk, _) = opened();
    desk.app.init_resource::<Layout>();
    let layout = |desk: &mut Desk, change: &dyn Fn(&mut Layout)| {
        change(&mut desk.app.world_mut().resource_mut::<Layout>());
        desk.frames(2);
    };
    desk.move_to(at(&desk, "All keys", 1.0));
    desk.frames(2);
    assert_eq!(timeline(&desk).hovered, Some("Timeline"));
    layout(&mut desk, &|layout| layout.toggle("Timeline"));
    assert_eq!(timeline(&desk).hovered, None);
    layout(&mut desk, &|layout| layout.bring_forward("Timeline"));
    assert_eq!(timeline(&desk).hovered, Some("Timeline"));
    layout(&mut desk, &|layout| layout.bring_forward("Curves"));
    assert_eq!(timeline(&desk).hovered, None);
}

#[test]
fn the_menu_sets_the_interpolation() {
    let (mut desk, [_, left, _]) = opened();
    let eases = |desk: &Desk| {
        let keys = &clip(desk).layers[0].tracks[&turned(left)].keys;
        keys.iter().map(|key| matches!(key.ease, Ease::Cubic { .. })).collect::<Vec<_>>()
    };
    act(&mut desk, TimelineAction::SelectAll);
    let steps = desk.steps().1;
    desk.secondary_click("Keys of walk");
    desk.click("Cubic keys");
    desk.frames(3);
    assert_eq!((eases(&desk), desk.steps().1), (vec![true; 4], steps + 1));
    assert_eq!(selected(&desk), 8, "the keys stay selected");
    desk.secondary_click("Keys of walk");
    desk.click("Delete keys");
    desk.frames(3);
    assert_eq!((clip(&desk).key_count(), desk.steps().1), (0, steps + 2));
}

#[test]
fn a_pose_sets_keys_at_the_playhead_while_auto_key_is_on() {
    let (mut desk, [hips, left, _]) = opened();
    ask(&mut desk, TimelineRequest::Scrub(0.7));
    desk.click("Auto-key");
    desk.frames(2);
    assert_eq!(desk.find("Auto-key").on, Some(true));
    let auto_key = *desk.app.world().get::<AutoKey>(desk.rig).unwrap();
    assert_eq!((auto_key.on, auto_key.clip, auto_key.layer), (true, CLIP, Some(BASE)));
    let (before, steps) = (bytes(&desk), desk.steps().1);
    let pose = |angle: f32| {
        let turn = |node: Uid| (node, PoseOffset::from_rotation(Quat::from_rotation_z(angle)));
        Operation::Pose(vec![turn(hips), turn(left)])
    };
    for angle in [0.5, 1.0] {
        change(&mut desk, Change::Preview(pose(angle)));
    }
    assert_turned(&desk, left, 1.0);
    change(&mut desk, Change::Commit);
    assert_eq!(desk.steps().1, steps + 1, "pose and keys are one step");
    let time = timeline(&desk).time;
    for node in [hips, left] {
        assert!(times(&desk, node).contains(&time), "{:?}", times(&desk, node));
    }
    assert_turned(&desk, left, 1.0);
    undo(&mut desk);
    assert_eq!((bytes(&desk), desk.steps().1), (before, steps));
    assert_turned(&desk, left, 0.35);
    // Off, and without a clip, a pose is a pose.
    for prepare in [TimelineAction::AutoKey, TimelineAction::DeleteClip] {
        act(&mut desk, prepare);
        let keys = desk.rig().clip(CLIP).map(RigClip::key_count);
        change(&mut desk, Change::Do(pose(0.9)));
        assert_eq!(desk.rig().clip(CLIP).map(RigClip::key_count), keys);
        assert_eq!(desk.rig().pose().len(), 2, "{:?}", desk.told());
        act(&mut desk, TimelineAction::AutoKey);
    }
}

/// A pose on top of the clip stays until the playhead moves, and is what the key takes.
#[test]
fn keys_take_what_is_shown() {
    let (mut desk, [hips, left, right]) = opened();
    ask(&mut desk, TimelineRequest::Scrub(0.7));
    let bent = PoseOffset { translation: Vec3::X * 0.25, ..PoseOffset::from_rotation(Quat::from_rotation_z(-0.8)) };
    change(&mut desk, Change::Do(Operation::Pose(vec![(left, bent)])));
    desk.frames(3);
    assert_turned(&desk, left, -0.8);
    assert_turned(&desk, right, 1.05);
    desk.select(&[left]);
    let steps = desk.steps().1;
    act(&mut desk, TimelineAction::Key);
    assert_eq!(desk.steps().1, steps + 1);
    let time = timeline(&desk).time;
    let value = |desk: &Desk, node: Uid, property: Property| {
        let target = TrackTarget { node, property: property.clone() };
        clip(desk).layers[0].tracks.get(&target).and_then(|track| track.sample(&property, time))
    };
    let rotation = Quat::from_array(value(&desk, left, Property::Rotation).unwrap());
    assert!(rotation.angle_between(bent.rotation) < 1e-3, "{rotation}");
    assert_eq!(value(&desk, left, Property::Translation), Some([0.25, 0.0, 0.0, 0.0]));
    assert_eq!(value(&desk, left, Property::Scale), None, "what is at rest has no key");
    assert_eq!(times(&desk, right), [0.0, 0.51, 1.0, 2.0]);
    // Elsewhere the clip poses again, and here it has what was keyed.
    ask(&mut desk, TimelineRequest::Scrub(0.0));
    assert_turned(&desk, left, 0.0);
    ask(&mut desk, TimelineRequest::Scrub(time));
    assert_turned(&desk, left, -0.8);
    // All joints, where the rig has no controls.
    act(&mut desk, TimelineAction::KeyAll);
    assert!([hips, left, right].iter().all(|node| times(&desk, *node).contains(&time)));
    // A pose that is undone leaves the pose of the clip.
    change(
        &mut desk,
        Change::Do(Operation::Pose(vec![(right, PoseOffset::from_rotation(Quat::from_rotation_x(1.0)))])),
    );
    undo(&mut desk);
    assert_turned(&desk, right, 1.05);
}

#[test]
fn controls_are_keyed_on_their_free_channels() {
    let (mut desk, _) = desk_with(TimelinePanel::default());
    let rig = crate::bench::shipped("biped");
    let entity = desk.rig;
    desk.app.world_mut().entity_mut(entity).insert(rig);
    let build = rigsmith::plugins::commands::BuildStep::All;
    desk.app.world_mut().write_message(rigsmith::plugins::commands::BuildRequest { rig: entity, step: build });
    desk.frames(4);
    act(&mut desk, TimelineAction::NewClip);
    let built = desk.app.world().get::<BuildResult>(entity).unwrap().0.clone();
    let limb = built.nodes.iter().find(|node| {
        node.control.as_ref().is_some_and(|control| {
            control.channels.rotate.contains(&true) && !control.channels.translate.contains(&true)
        })
    });
    let limb = limb.expect("a control that turns alone").uid;
    desk.app.world_mut().get_mut::<Selection>(entity).unwrap().0 = vec![limb];
    act(&mut desk, TimelineAction::Key);
    let open = |desk: &Desk| OpenClip::of(desk.app.world()).unwrap().clip.clone();
    let targets: Vec<TrackTarget> = open(&desk).layers[0].tracks.keys().cloned().collect();
    assert!(targets.contains(&turned(limb)), "{targets:?}");
    assert!(!targets.iter().any(|target| target.property == Property::Translation), "{targets:?}");
    act(&mut desk, TimelineAction::KeyAll);
    let controls = built.nodes.iter().filter(|node| node.control.is_some()).count();
    let keyed = open(&desk).nodes().len();
    assert!(keyed > controls / 2 && keyed <= built.nodes.len(), "{keyed} of {controls}");
    // Switches are keyed, too.
    assert!(open(&desk).layers[0].tracks.keys().any(|target| matches!(target.property, Property::Attribute(_))));
}
