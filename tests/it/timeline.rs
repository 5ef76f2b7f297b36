//! The timeline and its curves: what a person does there reaches the document as one step, and looking at a clip never does.

mod curves;
mod import_choices;
mod keys;
mod looks;
mod parts;
mod whole_clip;

use std::{sync::Arc, time::Duration};

use bevy::{prelude::*, time::TimeUpdateStrategy};
use bevy_egui::egui::{self, Key as KeyboardKey, Modifiers, Pos2};
use rigsmith::{
    editor::{
        actions::{Action, ActionRequest},
        help::describe,
        keys::KeyBindings,
        next_step::next_step,
        palette::{found, obstacle},
        panel::EditorPanel,
        panels::timeline::{
            OpenClip, Timeline, TimelineAction, TimelinePanel, TimelineRequest, import::ImportRequest, over_timeline,
        },
    },
    plugins::{
        animation::{AutoKey, ClipPlayer},
        document::JointEntities,
    },
    prelude::*,
    rig::{
        animation::{Ease, Key, Property, RigClip, Track, TrackTarget},
        format::animation::write_animation,
        operations::{ClipOperation, KeyOperation, KeyTimes},
        template::write_template,
    },
};

use crate::panels::desk::{Desk, Sheet};

const CLIP: Uid = Uid(0xC11B_0001);
const BASE: Uid = Uid(0xC11B_0002);

/// A panel beside a rig of three joints, with a clip of two seconds on both arms that is not open yet.
fn desk_with(panel: impl EditorPanel) -> (Desk, [Uid; 3]) {
    let mut desk = Desk::with(Sheet::Panel(Box::new(panel)), egui::vec2(900.0, 420.0));
    let joints = desk.chain(&["hips", "arm_l", "arm_r"]);
    let clip = clip_on(&joints[1..]);
    desk.edit(Operation::Edits(vec![RigEdit::AddClip(Box::new(clip), 0)]));
    (desk, [joints[0], joints[1], joints[2]])
}

/// A clip of two seconds with turns of nodes; the second key is between frames, the third one is stepped.
fn clip_on(nodes: &[Uid]) -> RigClip {
    let mut clip = RigClip { range: [0.0, 2.0], ..RigClip::new(CLIP, BASE, "walk") };
    for (number, node) in nodes.iter().enumerate() {
        let turn = |time: f32| Key::rotation(time, Quat::from_rotation_z(time * (0.5 + number as f32)));
        let mut keys: Vec<Key> = [0.0, 0.51, 1.0, 2.0].map(turn).to_vec();
        keys[2].ease = Ease::Stepped;
        clip.layers[0].tracks.insert(turned(*node), Arc::new(Track { keys }));
    }
    clip
}

fn turned(node: Uid) -> TrackTarget {
    TrackTarget { node, property: Property::Rotation }
}

/// The timeline with the clip open.
fn opened() -> (Desk, [Uid; 3]) {
    let (mut desk, joints) = desk_with(TimelinePanel::default());
    ask(&mut desk, TimelineRequest::Open(Some(CLIP)));
    (desk, joints)
}

fn ask(desk: &mut Desk, request: TimelineRequest) {
    desk.app.world_mut().write_message(request);
    desk.frames(3);
}

fn act(desk: &mut Desk, action: TimelineAction) {
    desk.app.world_mut().write_message(ActionRequest(Action::Timeline(action)));
    desk.frames(3);
}

fn change(desk: &mut Desk, change: Change) {
    desk.app.world_mut().write_message(EditRequest { rig: desk.rig, change });
    desk.frames(3);
}

fn undo(desk: &mut Desk) {
    change(desk, Change::Undo);
}

/// Everything that is saved of the rig, as text.
fn bytes(desk: &Desk) -> String {
    let rig = desk.rig();
    format!("{}{}{:?}", write_template(rig), write_animation(rig, None, rig.clips()), rig.pose())
}

fn timeline(desk: &Desk) -> &Timeline {
    desk.app.world().resource::<Timeline>()
}

fn clip(desk: &Desk) -> &RigClip {
    desk.rig().clip(CLIP).unwrap()
}

fn times(desk: &Desk, node: Uid) -> Vec<f32> {
    let track = clip(desk).layers[0].tracks.get(&turned(node));
    track.map_or_else(Vec::new, |track| track.keys.iter().map(|key| key.time).collect())
}

/// Turn of a joint's entity beyond its rest.
fn shown(desk: &Desk, joint: Uid) -> Quat {
    let entity = desk.app.world().get::<JointEntities>(desk.rig).unwrap().get(joint).unwrap();
    let rest = desk.rig().joint(joint).unwrap().data.rest;
    PoseOffset::between(&rest, desk.app.world().get::<Transform>(entity).unwrap()).rotation
}

#[track_caller]
fn assert_turned(desk: &Desk, joint: Uid, angle: f32) {
    let turn = shown(desk, joint);
    let off = turn.angle_between(Quat::from_rotation_z(angle));
    assert!(off < 2e-3, "{turn} is {off} off {angle}");
}

/// Pixel of a time.
fn x(desk: &Desk, time: f32) -> f32 {
    let (rect, [start, end]) = (desk.find("Keys of walk").rect, timeline(desk).span);
    rect.left() + (time - start) / (end - start) * rect.width()
}

/// Pixel of a time in the row of that name.
fn at(desk: &Desk, row: &str, time: f32) -> Pos2 {
    Pos2::new(x(desk, time), desk.find(row).rect.center().y)
}

fn selected(desk: &Desk) -> usize {
    timeline(desk).keys.values().map(Vec::len).sum()
}

#[test]
fn scrubbing_poses_the_rig_and_leaves_the_document() {
    let (mut desk, [_, left, right]) = opened();
    let (before, steps) = (bytes(&desk), desk.steps());
    assert_turned(&desk, left, 0.0);
    let ruler = desk.find("Playhead").rect;
    let place = |desk: &Desk, time: f32| Pos2::new(x(desk, time), ruler.center().y);
    desk.press(place(&desk, 0.2));
    desk.move_to(place(&desk, 0.5));
    desk.move_to(place(&desk, 0.8));
    // The pose follows while the button is held; the playhead stands on a frame.
    let time = timeline(&desk).time;
    assert!((time - 0.8).abs() < 1e-6, "{time}");
    assert_turned(&desk, left, 0.4);
    assert_turned(&desk, right, 1.2);
    desk.hold(Modifiers::SHIFT);
    desk.move_to(place(&desk, 0.815));
    assert!((timeline(&desk).time - 0.815).abs() < 2e-3 && timeline(&desk).time != 0.8, "with Shift between frames");
    desk.release(place(&desk, 0.815));
    desk.hold(Modifiers::NONE);
    desk.frames(3);
    assert_eq!((bytes(&desk), desk.steps()), (before, steps));

    // Without a clip the rig shows its own pose.
    ask(&mut desk, TimelineRequest::Open(None));
    assert_turned(&desk, left, 0.0);
    assert!(desk.app.world().get::<ClipPlayer>(desk.rig).is_none());
    assert!(desk.says("Choose a clip above; without one the rig shows its own pose."));
}

#[test]
fn playing_leaves_the_document() {
    let (mut desk, [_, left, _]) = opened();
    desk.app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(100)));
    let (before, steps) = (bytes(&desk), desk.steps());
    desk.click("Play or pause the clip");
    desk.frames(5);
    let time = timeline(&desk).time;
    assert!(timeline(&desk).playing && time > 0.3, "{time}");
    assert_turned(&desk, left, time * 0.5);
    desk.click("Play or pause the clip");
    desk.frames(2);
    let halted = timeline(&desk).time;
    let frame = halted * 30.0;
    assert!(!timeline(&desk).playing && (frame - frame.round()).abs() < 1e-3, "{halted}");
    desk.frames(3);
    assert_eq!(timeline(&desk).time, halted);
    // It stops at the end, and begins again there.
    act(&mut desk, TimelineAction::End);
    act(&mut desk, TimelineAction::PreviousFrame);
    act(&mut desk, TimelineAction::Play);
    desk.frames(4);
    assert_eq!((timeline(&desk).playing, timeline(&desk).time), (false, 2.0));
    act(&mut desk, TimelineAction::Play);
    assert!(timeline(&desk).playing && timeline(&desk).time < 1.0);
    assert_eq!((bytes(&desk), desk.steps()), (before, steps));
}

#[test]
fn the_playhead_goes_by_frames_and_keys() {
    let (mut desk, [hips, left, _]) = opened();
    let steps = [
        (TimelineAction::NextFrame, 1.0 / 30.0),
        (TimelineAction::NextFrame, 2.0 / 30.0),
        (TimelineAction::PreviousFrame, 1.0 / 30.0),
        (TimelineAction::NextKey, 0.51),
        (TimelineAction::NextKey, 1.0),
        (TimelineAction::PreviousKey, 0.51),
        (TimelineAction::End, 2.0),
        (TimelineAction::NextKey, 2.0),
        (TimelineAction::Start, 0.0),
        (TimelineAction::PreviousKey, 0.0),
    ];
    for (action, time) in steps {
        act(&mut desk, action);
        assert!((timeline(&desk).time - time).abs() < 1e-6, "{action:?}: {}", timeline(&desk).time);
    }
    // Keys of the selected nodes, or of all where these have none.
    let more = Key::rotation(0.25, Quat::IDENTITY);
    let set = KeyOperation::Set(vec![(turned(left), vec![more])]);
    desk.edit(Operation::Clips(ClipOperation::Keys { clip: CLIP, layer: BASE, change: set }));
    desk.select(&[left]);
    act(&mut desk, TimelineAction::NextKey);
    assert_eq!(timeline(&desk).time, 0.25);
    act(&mut desk, TimelineAction::Start);
    desk.select(&[hips]);
    act(&mut desk, TimelineAction::NextKey);
    assert_eq!(timeline(&desk).time, 0.25);
}

/// Actions that change the document, each by one step that undo takes back to the byte.
#[test]
fn every_action_is_one_step_or_none() {
    let (mut desk, [_, left, right]) = opened();
    let keys: KeyTimes = [left, right].map(|node| (turned(node), vec![0.0, 0.51, 1.0])).into();
    ask(&mut desk, TimelineRequest::Select(keys.clone()));
    act(&mut desk, TimelineAction::Copy);
    let mut edits = Vec::new();
    for action in TimelineAction::ALL {
        desk.select(&[left]);
        ask(&mut desk, TimelineRequest::Open(Some(CLIP)));
        ask(&mut desk, TimelineRequest::Scrub(1.5));
        ask(&mut desk, TimelineRequest::Select(keys.clone()));
        if desk.is_one_step(&format!("{action:?}"), bytes, |desk| act(desk, action)) {
            edits.push(action);
        }
    }
    let wanted = [
        TimelineAction::Loop,
        TimelineAction::Key,
        TimelineAction::KeyAll,
        TimelineAction::Marker,
        TimelineAction::Paste,
        TimelineAction::Delete,
        TimelineAction::Mirror,
        TimelineAction::Stepped,
        TimelineAction::Linear,
        TimelineAction::Cubic,
        TimelineAction::Snap,
        TimelineAction::Slower,
        TimelineAction::Faster,
        TimelineAction::Reverse,
        TimelineAction::NewClip,
        TimelineAction::DuplicateClip,
        TimelineAction::DeleteClip,
        TimelineAction::NewLayer,
        TimelineAction::Bake,
        TimelineAction::BakeClip,
        TimelineAction::Reduce,
        TimelineAction::ReduceClip,
        TimelineAction::Longer,
        TimelineAction::Shorter,
    ];
    assert_eq!(edits, wanted);
}

#[test]
fn actions_are_in_the_palette_with_their_keys_and_obstacles() {
    let (mut desk, _) = desk_with(TimelinePanel::default());
    let keys = KeyBindings::default();
    assert_eq!(keys.doubles(), Vec::<&rigsmith::editor::keys::Chord>::new());
    for action in TimelineAction::ALL.map(Action::Timeline) {
        assert!(found(&describe(action)).contains(&action), "{action:?}");
        assert!(Action::all().contains(&action), "{action:?}");
    }
    let play = Action::Timeline(TimelineAction::Play);
    assert_eq!(keys.key(play).map(ToString::to_string).as_deref(), Some("Space"));
    let reason = |desk: &Desk, action: TimelineAction| obstacle(desk.app.world(), Action::Timeline(action));
    assert!(reason(&desk, TimelineAction::Play).is_some_and(|reason| reason.starts_with("no clip is open")));
    assert_eq!(reason(&desk, TimelineAction::NewClip), None);
    // An action that can do nothing says so, and a greyed button has the reason.
    assert!(!desk.find("Play or pause the clip").enabled);
    act(&mut desk, TimelineAction::Play);
    assert!(desk.told().last().is_some_and(|told| told.contains("no clip is open")), "{:?}", desk.told());
    ask(&mut desk, TimelineRequest::Open(Some(CLIP)));
    assert!(desk.find("Play or pause the clip").enabled);
    let reasons = [
        (TimelineAction::Play, None),
        (TimelineAction::Delete, Some("no key is selected")),
        (TimelineAction::Key, Some("nothing is selected")),
        (TimelineAction::Paste, Some("no keys were copied")),
        (TimelineAction::KeyAll, None),
    ];
    desk.select(&[]);
    for (action, wanted) in reasons {
        assert_eq!(reason(&desk, action), wanted, "{action:?}");
    }
    // Over the timeline the keys of joints are those of its keys.
    assert_eq!(over_timeline(Action::Delete), Action::Timeline(TimelineAction::Delete));
    assert_eq!(over_timeline(Action::Undo), Action::Undo);
    desk.move_to(at(&desk, "All keys", 1.0));
    desk.frames(2);
    assert_eq!(timeline(&desk).hovered, Some("Timeline"));
    desk.move_to(Pos2::new(2000.0, 2000.0));
    desk.frames(2);
    assert_eq!(timeline(&desk).hovered, None);
}

#[test]
fn the_next_step_mentions_clips() {
    let (mut desk, _) = desk_with(TimelinePanel::default());
    desk.app.init_resource::<KeyBindings>();
    let said = |desk: &Desk| next_step(desk.app.world()).unwrap_or_default();
    assert!(said(&desk).contains("\"walk\""), "{}", said(&desk));
    ask(&mut desk, TimelineRequest::Open(Some(CLIP)));
    ask(&mut desk, TimelineRequest::Scrub(1.0));
    assert!(said(&desk).contains("Space plays; K keys the selected controls at frame 30"), "{}", said(&desk));
    act(&mut desk, TimelineAction::AutoKey);
    assert!(said(&desk).contains("keys are set at frame 30"), "{}", said(&desk));
    act(&mut desk, TimelineAction::AutoKey);
    act(&mut desk, TimelineAction::NewClip);
    assert!(said(&desk).contains("The clip has no keys"), "{}", said(&desk));
}

/// Everything that a pointer does in the panel, while nothing of what it asks for is done: the document stays, and so does what
/// the window shows.
#[test]
fn the_panel_changes_nothing_itself() {
    let (mut desk, _) = opened();
    desk.frames(2);
    let (before, steps, shown) = (bytes(&desk), desk.steps(), format!("{:?}", timeline(&desk)));
    desk.deaf = true;
    let (from, to) = (at(&desk, "arm_l", 1.0), at(&desk, "arm_l", 1.4));
    desk.click_at(from);
    desk.drag(from, to);
    desk.drag(at(&desk, "arm_l", 0.2), at(&desk, "arm_r", 1.8));
    let ruler = desk.find("Playhead").rect.center();
    desk.drag(ruler, ruler + egui::vec2(100.0, 0.0));
    let labels: Vec<String> = desk.seen.iter().filter(|seen| seen.enabled).map(|seen| seen.label.clone()).collect();
    for label in labels.iter().filter(|label| !label.is_empty()) {
        if desk.look(label).is_some() {
            desk.click(label);
            desk.key(KeyboardKey::Escape);
        }
    }
    desk.frames(3);
    assert_eq!((bytes(&desk), desk.steps()), (before, steps));
    assert_eq!(format!("{:?}", timeline(&desk)), shown);
}

/// Ten thousand keys and a hundred thousand: the number of shapes follows from the size of the panel.
#[test]
fn many_keys_are_few_shapes() {
    let shapes = [250, 2500].map(|count| {
        let mut desk = Desk::with(Sheet::Panel(Box::new(TimelinePanel::default())), egui::vec2(900.0, 420.0));
        let labels: Vec<String> = (0..40).map(|number| format!("joint_{number}")).collect();
        let joints = desk.chain(&labels.iter().map(String::as_str).collect::<Vec<_>>());
        let mut clip = RigClip { range: [0.0, 10.0], ..RigClip::new(CLIP, BASE, "walk") };
        for joint in &joints {
            let keys = (0..count).map(|key| Key::rotation(key as f32 * (10.0 / count as f32), Quat::IDENTITY));
            clip.layers[0].tracks.insert(turned(*joint), Arc::new(Track { keys: keys.collect() }));
        }
        assert_eq!(clip.key_count(), 40 * count);
        desk.edit(Operation::Edits(vec![RigEdit::AddClip(Box::new(clip), 0)]));
        ask(&mut desk, TimelineRequest::Open(Some(CLIP)));
        act(&mut desk, TimelineAction::SelectAll);
        assert_eq!(selected(&desk), 40 * count);
        (desk.shapes, desk.seen.len())
    });
    // 20 rows of 20 pixels at most, each with a mark every seven pixels at most, and the bars above.
    let bound = 20 * (660 / 7 + 12) + 400;
    assert!(shapes.iter().all(|(shapes, _)| (200..bound).contains(shapes)), "{shapes:?}, {bound}");
    assert_eq!(shapes[0].1, shapes[1].1, "widgets");
    assert!(shapes[1].0 <= shapes[0].0 + 200, "{shapes:?}");
}

#[test]
fn nothing_is_cut_off_in_a_narrow_timeline() {
    let (mut desk, _) = opened();
    act(&mut desk, TimelineAction::Marker);
    desk.click("Layers");
    for width in [180.0, 300.0, 700.0] {
        desk.resize(width, 420.0);
        for seen in desk.seen.iter().filter(|seen| !seen.label.is_empty()) {
            assert!(seen.rect.right() <= width + 0.5, "{width}: {seen:?}");
        }
    }
}

#[test]
fn a_key_brings_a_clip_where_none_is_open() {
    let mut desk = Desk::new(TimelinePanel::default());
    let joints = desk.chain(&["a", "b"]);
    desk.select(&[]);
    act(&mut desk, TimelineAction::Key);
    assert!(desk.told().last().is_some_and(|told| told.contains("nothing is selected")), "{:?}", desk.told());
    desk.select(&[joints[1]]);
    let turn = rigsmith::rig::PoseOffset::from_rotation(Quat::from_rotation_z(0.4));
    desk.edit(rigsmith::rig::operations::Operation::Pose(vec![(joints[1], turn)]));
    act(&mut desk, TimelineAction::Key);
    desk.frames(4);
    let keys = |desk: &Desk| desk.rig().clips().iter().map(|clip| clip.key_count()).collect::<Vec<_>>();
    assert_eq!(keys(&desk).len(), 1, "{:?}", desk.told());
    assert!(keys(&desk)[0] > 0);
    assert_eq!(timeline(&desk).clip, Some(desk.rig().clips()[0].uid));
    // The next key goes into the same clip.
    act(&mut desk, TimelineAction::NextFrame);
    act(&mut desk, TimelineAction::Key);
    desk.frames(4);
    assert_eq!(keys(&desk).len(), 1);
}
