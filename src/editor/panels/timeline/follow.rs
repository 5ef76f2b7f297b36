//! Systems at the end of a frame: the playhead goes with the playback, poses set keys at the playhead, and the timeline
//! belongs to the active rig.

use bevy::{prelude::*, window::RequestRedraw};

use super::state::{Timeline, layer_of};
use crate::{
    editor::{ActiveRig, dock::Layout},
    plugins::{
        animation::{AutoKey, ClipPlayer},
        commands::BuildResult,
        document::EditReport,
        history::RigHistory,
    },
    rig::{Rig, animation::NodeNames, step::Commit},
};

/// Keeps the playhead with the player of the open clip, and the keys that poses set with the playhead.
pub(super) fn follow_playback(
    active: Option<Res<ActiveRig>>,
    rigs: Query<(&Rig, &RigHistory)>,
    mut players: Query<&mut ClipPlayer>,
    mut auto_keys: Query<&mut AutoKey>,
    mut reports: MessageReader<EditReport>,
    mut timeline: ResMut<Timeline>,
    mut commands: Commands,
) {
    let active = active.map(|active| active.0);
    if timeline.rig != active {
        let Timeline { auto_key, tolerance, .. } = *timeline;
        *timeline = Timeline { rig: active, auto_key, tolerance, ..Timeline::default() };
    }
    let Some((entity, (rig, history))) = active.and_then(|entity| Some((entity, rigs.get(entity).ok()?))) else {
        reports.clear();
        return;
    };
    // A pose that was undone or dropped leaves the pose of the clip, not that of the document.
    let last = reports.read().filter(|report| report.rig == entity).last();
    let is_taken_back = last.is_some_and(|report| match &report.committed {
        Some(commit) => !matches!(commit, Commit::Done(_)),
        None => report.preview && !history.is_previewing(),
    });
    let Some(clip) = timeline.clip.and_then(|clip| rig.clip(clip)) else {
        // Poses would be refused with keys for a clip that is gone.
        if auto_keys.contains(entity) {
            commands.entity(entity).try_remove::<AutoKey>();
        }
        (timeline.playing, timeline.starting) = (false, false);
        return;
    };
    let was_playing = timeline.playing;
    match players.get_mut(entity) {
        Ok(mut player) if player.clip == clip.uid => {
            if is_taken_back {
                player.set_changed();
            }
            if player.looped != clip.looped {
                player.looped = clip.looped;
            }
            if timeline.starting {
                player.playing = true;
            }
            let (time, playing) = (player.time, player.playing);
            timeline.starting = false;
            timeline.time = time;
            timeline.playing = playing;
        }
        // The clip came back with an undone or redone step.
        _ => {
            let player = ClipPlayer { time: timeline.time, playing: false, ..ClipPlayer::new(clip) };
            commands.entity(entity).try_insert(player);
            (timeline.playing, timeline.starting) = (false, false);
        }
    }
    let layer = layer_of(clip, timeline.layer).map(|layer| layer.uid);
    let wanted = AutoKey { on: timeline.auto_key, clip: clip.uid, layer, time: timeline.time };
    match auto_keys.get_mut(entity) {
        Ok(mut auto_key) => {
            auto_key.set_if_neq(wanted);
        }
        Err(_) if wanted.on => {
            commands.entity(entity).try_insert(wanted);
        }
        Err(_) => {}
    }
    if (was_playing || timeline.playing)
        && let Some(next) = turned_page(timeline.span, timeline.time)
    {
        timeline.span = next;
    }
    if timeline.playing {
        commands.write_message(RequestRedraw);
    }
}

/// Span of time of the same length with the playhead a tenth from its start, if the playhead is outside of the visible one.
fn turned_page([start, end]: [f32; 2], time: f32) -> Option<[f32; 2]> {
    let (length, is_seen) = (end - start, (start..=end).contains(&time));
    let next = time - 0.1 * length;
    (!is_seen && length > 0.0 && next.is_finite()).then_some([next, next + length])
}

/// Remembers the names of nodes, by which keys of nodes that are gone are listed.
pub(super) fn remember_names(
    active: Option<Res<ActiveRig>>,
    rigs: Query<(&Rig, Option<Ref<BuildResult>>)>,
    mut timeline: ResMut<Timeline>,
) {
    let Some((rig, built)) = active.and_then(|active| rigs.get(active.0).ok()) else { return };
    let is_known = timeline.named.as_ref().is_some_and(|named| named.is_same(rig.revision()));
    if is_known && !built.as_ref().is_some_and(Ref::is_changed) {
        return;
    }
    let names = NodeNames::of(rig, built.as_deref().map(|built| &*built.0));
    timeline.names.extend(&names);
    timeline.named = Some(rig.revision().clone());
}

/// Forgets the pointer over a panel that is hidden or behind another one, which cannot tell that the pointer has left it.
pub(super) fn forget_hover(layout: Option<Res<Layout>>, mut timeline: ResMut<Timeline>) {
    let Some((panel, layout)) = timeline.hovered.zip(layout) else { return };
    if !layout.is_forward(panel) {
        timeline.hovered = None;
    }
}
