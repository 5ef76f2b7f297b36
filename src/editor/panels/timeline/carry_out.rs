//! Actions and requests of the timeline, carried out: edits are sent on to the document, everything else changes what the
//! window shows.

use std::sync::Arc;

use bevy::{prelude::*, window::RequestRedraw};

use super::{
    action::{TimelineAction, obstacle},
    import,
    own_motion::own_file,
    shown_pose::{all_nodes, shown_values},
    state::{OpenClip, Timeline, TimelineRequest, all_keys, fitted, frame_at, key_times, second_of, snapped},
    switches,
};
use crate::{
    editor::{
        ActiveRig,
        actions::{Action, ActionRequest, queue_requests},
        notice::Notice,
    },
    plugins::{
        animation::{AutoKey, ClipPlayer, EndPlayback},
        commands::BuildResult,
        document::{EditRequest, Selection},
    },
    rig::{
        Rig, Uid, UidSource,
        animation::{ClipAbout, LayerMode, Marker, RigClip},
        operations::{ClipOperation, KeyClipboard, KeyEase, KeyOperation, KeyTimes, Operation},
    },
};

/// Seconds of a clip that is made.
const LENGTH: f32 = 2.0;

/// Carries out what panels, keys and menus ask for, before the edits of the same frame.
pub(super) fn attend(
    requests: MessageReader<TimelineRequest>,
    actions: MessageReader<ActionRequest>,
    commands: Commands,
) {
    let own = |action| if let Action::Timeline(action) = action { Some(action) } else { None };
    queue_requests(requests, answer, actions, own, act, commands);
}

fn answer(world: &mut World, request: TimelineRequest) {
    match request {
        TimelineRequest::Open(clip) => {
            let active = world.get_resource::<ActiveRig>().map(|active| active.0);
            let found = active.and_then(|rig| world.get::<Rig>(rig)?.clip(clip?)).cloned();
            open(world, found.as_ref());
        }
        TimelineRequest::Layer(layer) => {
            let mut timeline = world.resource_mut::<Timeline>();
            if timeline.layer != Some(layer) {
                timeline.layer = Some(layer);
                timeline.select(KeyTimes::new());
            }
        }
        TimelineRequest::Scrub(time) => seek(world, time),
        TimelineRequest::Show(span) => {
            if span[0].is_finite() && span[1].is_finite() && span[1] > span[0] {
                world.resource_mut::<Timeline>().span = span;
            }
        }
        TimelineRequest::Select(keys) => world.resource_mut::<Timeline>().select(keys),
        TimelineRequest::Tolerance(tolerance) => world.resource_mut::<Timeline>().tolerance = tolerance,
        TimelineRequest::Hover(panel, is_over) => {
            let mut timeline = world.resource_mut::<Timeline>();
            // Of two panels in sight the one that the pointer has left may tell last.
            if is_over || timeline.hovered == Some(panel) {
                timeline.hovered = is_over.then_some(panel);
            }
        }
    }
}

/// Opens a clip, which may reach the document within this frame; `None` ends the playback.
pub(super) fn open(world: &mut World, clip: Option<&RigClip>) {
    let Some(active) = world.get_resource::<ActiveRig>().map(|active| active.0) else { return };
    let mut timeline = world.resource_mut::<Timeline>();
    timeline.rig = Some(active);
    timeline.clip = clip.map(|clip| clip.uid);
    timeline.layer = None;
    (timeline.playing, timeline.starting) = (false, false);
    timeline.select(KeyTimes::new());
    let Some(clip) = clip else {
        if let Ok(mut rig) = world.get_entity_mut(active) {
            rig.remove::<AutoKey>();
        }
        world.write_message(EndPlayback { rig: active });
        return;
    };
    timeline.time = clip.range[0];
    timeline.span = fitted(clip);
    if let Ok(mut rig) = world.get_entity_mut(active) {
        rig.insert(ClipPlayer { playing: false, ..ClipPlayer::new(clip) });
    }
}

/// Halts the playback and puts the playhead to a second.
fn seek(world: &mut World, time: f32) {
    let Some(open) = OpenClip::of(world).filter(|_| time.is_finite()) else { return };
    let (entity, clip) = (open.entity, open.clip.uid);
    let mut timeline = world.resource_mut::<Timeline>();
    timeline.time = time;
    (timeline.playing, timeline.starting) = (false, false);
    // Whatever the playhead goes to is seen, with a tenth of the visible span beside it.
    let [start, end] = timeline.span;
    let room = (end - start) * 0.1;
    if time < start {
        timeline.span = [time - room, end - start + time - room];
    } else if time > end {
        timeline.span = [start - end + time + room, time + room];
    }
    if let Some(mut player) = world.get_mut::<ClipPlayer>(entity).filter(|player| player.clip == clip) {
        (player.time, player.playing) = (time, false);
    }
    if let Some(mut auto_key) = world.get_mut::<AutoKey>(entity).filter(|auto_key| auto_key.clip == clip) {
        auto_key.time = time;
    }
}

fn act(world: &mut World, action: TimelineAction) {
    let is_key = matches!(action, TimelineAction::Key | TimelineAction::KeyAll);
    // A clip that is refused is not begun again and again; a key with an obstacle is no longer waited for.
    let has_begun = is_key && std::mem::take(&mut world.resource_mut::<Timeline>().begun);
    if let Some(reason) = obstacle(world, action) {
        let text = format!("{}: {reason}.", action.name());
        world.write_message(Notice::info(text));
        return;
    }
    if is_key && !has_begun && OpenClip::of(world).is_none() {
        begin_clip(world);
        // The clip reaches the document within this frame.
        world.resource_mut::<Timeline>().begun = true;
        world.write_message(ActionRequest(Action::Timeline(action)));
        world.write_message(RequestRedraw);
        return;
    }
    match action {
        TimelineAction::AutoKey => {
            let mut timeline = world.resource_mut::<Timeline>();
            timeline.auto_key = !timeline.auto_key;
        }
        TimelineAction::Stretch => {
            let mut timeline = world.resource_mut::<Timeline>();
            timeline.stretch = !timeline.stretch;
        }
        TimelineAction::SwitchKinematics | TimelineAction::SwitchSpace => {
            let request = OpenClip::of(world).and_then(|open| switches::request(world, &open, action).ok());
            if let Some(request) = request {
                world.write_message(request);
                // Switches are thrown before the timeline attends to anything.
                world.write_message(RequestRedraw);
            }
        }
        TimelineAction::NewClip => new_clip(world),
        TimelineAction::Import => import::ask(world),
        TimelineAction::ImportOwn => {
            if let Some(path) = own_file(world) {
                world.write_message(import::ImportRequest(path));
                world.write_message(RequestRedraw);
            }
        }
        _ => {
            let Some(open) = OpenClip::of(world) else { return };
            match edit(world, &open, action) {
                Some(operation) if keys_nothing(&operation) => {
                    world.write_message(Notice::info("What is selected has nothing that can be keyed."));
                }
                Some(operation) => {
                    let request = EditRequest::operation(open.entity, operation);
                    world.write_message(request);
                }
                None => show(world, action),
            }
        }
    }
}

fn keys_nothing(operation: &Operation) -> bool {
    let Operation::Clips(ClipOperation::Keys { change: KeyOperation::Values { values, .. }, .. }) = operation else {
        return false;
    };
    values.is_empty()
}

/// The operation of an action that edits the document.
fn edit(world: &World, open: &OpenClip, action: TimelineAction) -> Option<Operation> {
    let timeline = world.get_resource::<Timeline>()?;
    let clip = open.clip.uid;
    let on_layer =
        |change: KeyOperation| Some(Operation::Clips(ClipOperation::Keys { clip, layer: open.layer?.uid, change }));
    let about = |about: ClipAbout| Some(Operation::Clips(ClipOperation::About(clip, Box::new(about))));
    let keys = || timeline.keys.clone();
    let ease = |ease: KeyEase| on_layer(KeyOperation::Ease { keys: keys(), ease });
    let scale = |factor: f32| on_layer(KeyOperation::Scale { keys: keys(), pivot: open.time, factor });
    let pose =
        |nodes: &[Uid]| on_layer(KeyOperation::Values { time: open.time, values: shown_values(world, open, nodes) });
    match action {
        TimelineAction::Loop => about(ClipAbout { looped: !open.clip.looped, ..open.clip.about() }),
        TimelineAction::Marker => about(with_marker(open.clip, open.time)),
        TimelineAction::Key => pose(&world.get::<Selection>(open.entity)?.0),
        TimelineAction::KeyAll => pose(&all_nodes(world, open)),
        TimelineAction::Paste => on_layer(KeyOperation::Paste { clipboard: timeline.copied.clone()?, at: open.time }),
        TimelineAction::Delete => on_layer(KeyOperation::Delete(keys())),
        TimelineAction::Mirror => {
            let built = world.get::<BuildResult>(open.entity).map(|built| Arc::clone(&built.0));
            on_layer(KeyOperation::Mirror { keys: keys(), built })
        }
        TimelineAction::Stepped => ease(KeyEase::Stepped),
        TimelineAction::Linear => ease(KeyEase::Linear),
        TimelineAction::Cubic => ease(KeyEase::Cubic),
        TimelineAction::Snap => {
            let pairs = |times: &Vec<f32>| times.iter().map(|time| [*time, snapped(open.clip, *time)]).collect();
            on_layer(KeyOperation::Place(
                timeline.keys.iter().map(|(key, times)| (key.clone(), pairs(times))).collect(),
            ))
        }
        TimelineAction::Slower => scale(2.0),
        TimelineAction::Faster => scale(0.5),
        TimelineAction::Reverse => scale(-1.0),
        TimelineAction::Bake => {
            let targets = timeline.keys.keys().cloned().collect();
            on_layer(KeyOperation::Bake { targets, rate: open.clip.frame_rate })
        }
        TimelineAction::Reduce => {
            let targets = timeline.keys.keys().cloned().collect();
            on_layer(KeyOperation::Reduce { targets, tolerance: timeline.tolerance.of_keys(open.rig) })
        }
        TimelineAction::BakeClip => Some(Operation::Clips(ClipOperation::Bake(clip))),
        TimelineAction::ReduceClip => {
            Some(Operation::Clips(ClipOperation::Reduce { clip, tolerance: timeline.tolerance.of_keys(open.rig) }))
        }
        TimelineAction::Longer => retimed(open.clip, 2.0),
        TimelineAction::Shorter => retimed(open.clip, 0.5),
        TimelineAction::DeleteClip => Some(Operation::Clips(ClipOperation::Delete(clip))),
        TimelineAction::NewLayer => {
            let name = format!("Layer {}", open.clip.layers.len() + 1);
            Some(Operation::Clips(ClipOperation::AddLayer { clip, name, mode: LayerMode::Additive }))
        }
        _ => None,
    }
}

/// The clip with another length, from its start on.
fn retimed(clip: &RigClip, factor: f32) -> Option<Operation> {
    let [start, end] = clip.range;
    let to = [start, start + (end - start) * factor];
    Some(Operation::Clips(ClipOperation::Retime { clip: clip.uid, from: clip.range, to }))
}

/// Header of a clip with a marker more.
fn with_marker(clip: &RigClip, time: f32) -> ClipAbout {
    let mut about = clip.about();
    let is_taken = |name: &String| about.markers.iter().any(|marker| marker.name == *name);
    let name = (1..).map(|number| format!("Marker {number}")).find(|name| !is_taken(name)).unwrap_or_default();
    let place = about.markers.partition_point(|marker| marker.time <= time);
    about.markers.insert(place, Marker { time, name });
    about
}

/// Carries out an action that changes what is shown.
fn show(world: &mut World, action: TimelineAction) {
    let Some(open) = OpenClip::of(world) else { return };
    if let Some(time) = destination(world, &open, action) {
        return seek(world, time);
    }
    let clip = open.clip;
    match action {
        TimelineAction::Play => play(world),
        TimelineAction::Fit => {
            let span = fitted(clip);
            world.resource_mut::<Timeline>().span = span;
        }
        TimelineAction::SelectAll => {
            let keys = open.layer.map(all_keys).unwrap_or_default();
            world.resource_mut::<Timeline>().select(keys);
        }
        TimelineAction::SelectNone => world.resource_mut::<Timeline>().select(KeyTimes::new()),
        TimelineAction::Copy => {
            let Some(layer) = open.layer else { return };
            let copied = world.get_resource::<Timeline>().map(|timeline| KeyClipboard::copy(layer, &timeline.keys));
            world.resource_mut::<Timeline>().copied = copied.map(Arc::new);
        }
        TimelineAction::DuplicateClip => {
            let mut copy = clip.clone();
            let mut uids = world.resource_mut::<UidSource>();
            copy.uid = uids.next_uid();
            copy.layers.iter_mut().for_each(|layer| layer.uid = uids.next_uid());
            add(world, copy);
        }
        _ => {}
    }
}

/// Second to which an action moves the playhead.
fn destination(world: &World, open: &OpenClip, action: TimelineAction) -> Option<f32> {
    let (clip, time) = (open.clip, open.time);
    let step = |frames: i64| Some(second_of(clip, frame_at(clip, time) + frames));
    match action {
        TimelineAction::NextFrame => step(1),
        TimelineAction::PreviousFrame => step(-1),
        TimelineAction::Start => Some(clip.range[0]),
        TimelineAction::End => Some(clip.range[1]),
        TimelineAction::NextKey | TimelineAction::PreviousKey => {
            let selected = world.get::<Selection>(open.entity).map_or(&[] as &[Uid], |selection| &selection.0);
            let times = key_times(clip, selected);
            // Keys that stand less than a hundredth of a frame away count as reached.
            let near = 0.01 / clip.frame_rate;
            match action {
                TimelineAction::NextKey => times.into_iter().find(|key| *key > time + near),
                _ => times.into_iter().rev().find(|key| *key < time - near),
            }
        }
        _ => None,
    }
}

fn play(world: &mut World) {
    let Some(open) = OpenClip::of(world) else { return };
    let ([start, end], is_looped) = (open.clip.range, open.clip.looped);
    let (time, frame) = (open.time, snapped(open.clip, open.time));
    let mut timeline = world.resource_mut::<Timeline>();
    if timeline.playing {
        // Keys that are set now stand on a frame.
        seek(world, frame);
        return;
    }
    if !is_looped && time >= end || time < start || time > end {
        seek(world, start);
        timeline = world.resource_mut::<Timeline>();
    }
    (timeline.playing, timeline.starting) = (true, true);
}

/// Opens the first clip of the rig, or one that is made for it.
fn begin_clip(world: &mut World) {
    let rig = world.get_resource::<ActiveRig>().and_then(|active| world.get::<Rig>(active.0));
    match rig.and_then(|rig| rig.clips().first()).cloned() {
        Some(clip) => open(world, Some(&clip)),
        None => new_clip(world),
    }
}

fn new_clip(world: &mut World) {
    let Some(rig) = world.get_resource::<ActiveRig>().and_then(|active| world.get::<Rig>(active.0)) else { return };
    let is_taken = |name: &String| rig.clips().iter().any(|clip| clip.name == *name);
    let name = (1..).map(|number| format!("Clip {number}")).find(|name| !is_taken(name)).unwrap_or_default();
    let mut uids = world.resource_mut::<UidSource>();
    let (uid, layer) = (uids.next_uid(), uids.next_uid());
    add(world, RigClip { range: [0.0, LENGTH], ..RigClip::new(uid, layer, name) });
}

/// Adds a clip to the document, and opens it.
fn add(world: &mut World, clip: RigClip) {
    let Some(active) = world.get_resource::<ActiveRig>().map(|active| active.0) else { return };
    open(world, Some(&clip));
    world.write_message(EditRequest::operation(active, Operation::Clips(ClipOperation::Add(Box::new(clip)))));
}
