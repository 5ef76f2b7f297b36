//! Choices of imported motion that concern its clip, and the map of its joints as a file.

use rigsmith::{
    editor::panels::timeline::{
        import::{ClipImport, MapDraft, MapRequest},
        motion_options::MotionOptions,
    },
    rig::animation::joint_map::{FoundBy, read_joint_map},
};

use super::{
    parts::{accept, captured, captured_of},
    *,
};
use crate::panels::{face_drag::busy_threads, obstacles::assert_greyed};

fn draft(desk: &Desk) -> Option<MapDraft> {
    desk.app.world().resource::<ClipImport>().draft().cloned()
}

fn options(desk: &Desk) -> MotionOptions {
    draft(desk).expect("a map").options
}

fn send(desk: &mut Desk, request: MapRequest) {
    desk.app.world_mut().write_message(request);
    desk.frames(3);
}

#[test]
fn the_clip_of_imported_motion_has_the_rate_and_the_loop_that_are_chosen() {
    let walk = include_str!("../retarget/walker.bvh");
    let (mut plain, _folder) = captured_of(walk);
    assert_eq!((options(&plain).looped, options(&plain).frame_rate), (false, None));
    accept(&mut plain);
    let [clip] = plain.rig().clips() else { panic!("{:?}", plain.told()) };
    assert!(!clip.looped && clip.frame_rate != 12.0, "{}", clip.frame_rate);

    let (mut desk, _folder) = captured_of(walk);
    for label in ["Loop", "Frame rate"] {
        desk.click(label);
        desk.frames(3);
    }
    assert_eq!((options(&desk).looped, options(&desk).frame_rate), (true, Some(30.0)));
    // Escape leaves the field and nothing else.
    desk.click("Frames a second of the clip");
    desk.type_text("7");
    desk.key(KeyboardKey::Escape);
    desk.frames(3);
    assert_eq!(options(&desk).frame_rate, Some(30.0));
    desk.click("Frames a second of the clip");
    desk.type_text("5000");
    desk.key(KeyboardKey::Enter);
    desk.frames(3);
    assert_eq!(options(&desk).frame_rate, Some(30.0));
    let told = "Frames a second of the clip stays as it was: 5000 is none of its numbers; write one from 1 to 1000.";
    assert_eq!(desk.told().last().map(String::as_str), Some(told));
    desk.click("Frames a second of the clip");
    desk.type_text("12");
    desk.key(KeyboardKey::Enter);
    desk.frames(3);
    assert_eq!(options(&desk).frame_rate, Some(12.0));
    accept(&mut desk);
    let [clip] = desk.rig().clips() else { panic!("{:?}", desk.told()) };
    assert_eq!((clip.looped, clip.frame_rate), (true, 12.0));
}

/// A rate that leaves nothing of the motion is refused with the reason, and the map waits on.
#[test]
fn a_rate_that_leaves_one_frame_is_refused() {
    let (mut desk, _folder) = captured();
    let (before, steps) = (bytes(&desk), desk.steps());
    let slow = MotionOptions { frame_rate: Some(12.0), ..options(&desk) };
    send(&mut desk, MapRequest::Options(slow));
    send(&mut desk, MapRequest::Accept);
    let is_refused = |desk: &Desk| {
        desk.told().iter().any(|told| told.contains("no frame more than the first at a frame rate of 12"))
    };
    desk.until("the reason", is_refused);
    assert!(draft(&desk).is_some());
    assert_eq!((bytes(&desk), desk.steps()), (before, steps));
}

/// A changed map comes back from the file that people saved, with joints that are to move nothing.
#[test]
fn the_map_of_joints_is_saved_and_read_again() {
    let (mut desk, folder) = captured();
    assert!(desk.look("Save map…").is_some());
    let first = draft(&desk).expect("a map");
    let number = |name: &str| first.joints().position(|joint| joint == name).unwrap();
    let [left, right, foot] = ["LeftLeg", "RightLeg", "LeftFoot"].map(number);
    let [shin_l, shin_r] = ["shin_l", "shin_r"].map(|label| desk.rig().find_label(label));
    assert!(first.targets[foot].is_some());
    for (joint, target) in [(left, shin_r), (right, shin_l), (foot, None)] {
        send(&mut desk, MapRequest::Set(joint, target));
    }
    let changed = draft(&desk).expect("a map").targets;
    let path = folder.path().join("step.map.ron");
    send(&mut desk, MapRequest::Save(path.clone()));
    assert!(desk.told().iter().any(|told| told == "Saved the map of joints to step.map.ron"), "{:?}", desk.told());
    let pairs = read_joint_map(&std::fs::read(&path).unwrap()).unwrap();
    for (from, to) in [("LeftLeg", "shin_r"), ("RightLeg", "shin_l"), ("LeftFoot", "")] {
        assert!(pairs.contains(&(from.to_owned(), to.to_owned())), "{from}: {pairs:?}");
    }
    for (joint, target) in first.targets.iter().enumerate() {
        send(&mut desk, MapRequest::Set(joint, *target));
    }
    assert_ne!(draft(&desk).expect("a map").targets, changed);
    send(&mut desk, MapRequest::File(path.clone()));
    let read = draft(&desk).expect("a map");
    assert_eq!((read.targets, read.found_by), (changed, Some(FoundBy::Map)));

    // A joint that a file gives to one bone still moves that of its name as well, which is told.
    send(&mut desk, MapRequest::Set(left, None));
    send(&mut desk, MapRequest::Save(path));
    assert!(desk.told().iter().any(|told| told.contains("what 1 joint moves is otherwise")), "{:?}", desk.told());

    // A folder that is gone is told, and the map waits on.
    send(&mut desk, MapRequest::Save(folder.path().join("gone/step.map.ron")));
    assert!(desk.told().iter().any(|told| told.contains("Could not save the map of joints to step.map.ron")));
    assert!(draft(&desk).is_some());
}

/// The table takes nothing while the motion is being put onto the rig, and says so.
#[test]
fn a_table_that_is_accepted_says_why_it_is_greyed() {
    let (mut desk, _folder) = captured();
    let (held, threads) = busy_threads();
    desk.click("Import motion");
    desk.frames(2);
    for label in ["Import motion", "Load map…", "Save map…", "Cancel import", "Travel", "Joint for LeftLeg"] {
        assert_greyed(&mut desk, label, "The motion is being put onto the rig");
    }
    drop(held);
    desk.until("the clip", |desk| !desk.rig().clips().is_empty());
    drop(threads);
}
