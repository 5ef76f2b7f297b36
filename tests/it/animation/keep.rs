//! Motion that survives changes of the rig.

use std::{
    collections::{BTreeMap, HashSet},
    sync::Arc,
};

use bevy::math::{EulerRot, Quat};
use rigsmith::{
    modules,
    processor::{ClipNote, keep_clips},
    rig::{
        NodeType, Rig, RigEdit, Uid,
        animation::{Key, Property, RigClip, Track},
    },
    solve::{
        program::{RigProgram, RigState},
        weights::{multiply, relative},
    },
};

use super::{BASE, CLIP, Random, animated, apply, biped, controls, program, target, turn};
use crate::keep_pose::flip;

/// Metres and degrees.
pub const NEAR: (f32, f32) = (1e-4, 0.05);

/// An instance where a clip puts it, by the program alone.
pub fn state(program: &Arc<RigProgram>, clip: Option<&RigClip>, time: f32) -> RigState {
    let mut state = RigState::new(program.clone());
    if let Some(clip) = clip {
        let pose = clip.sample(time);
        for (node, offset) in pose.offsets {
            let _ = state.set_offset(node, offset);
        }
        for (node, values) in pose.values {
            for (name, value) in values {
                let _ = state.set_attribute(node, &name, value);
            }
        }
    }
    state.evaluate(0.0);
    state
}

/// Largest distance and angle by which a clip on a rig moves joints otherwise than another one on an earlier version of the rig,
/// over some times, for each joint of both.
pub fn joints_off(
    (from, was): (&Arc<RigProgram>, &RigClip),
    (to, is): (&Arc<RigProgram>, &RigClip),
    times: &[f32],
) -> BTreeMap<Uid, (f32, f32)> {
    let (rest_before, rest_after) = (state(from, None, 0.0), state(to, None, 0.0));
    let mut most: BTreeMap<Uid, (f32, f32)> = BTreeMap::new();
    for time in times {
        let (was, is) = (state(from, Some(was), *time), state(to, Some(is), *time));
        for (slot, node) in to.nodes().iter().enumerate().filter(|(_, node)| node.kind == NodeType::Joint) {
            let Some(known) = from.node(node.uid) else { continue };
            let turned = relative(rest_before.global_at(known), rest_after.global_at(slot));
            let (now, wanted) = (is.global_at(slot), multiply(was.global_at(known), &turned));
            let distance = now.translation.distance(wanted.translation);
            let chord = (now.rotation.conjugate() * wanted.rotation).xyz().length().min(1.0);
            let angle = (chord.asin() * 2.0).to_degrees();
            let own = most.entry(node.uid).or_default();
            *own = (own.0.max(distance), own.1.max(angle));
        }
    }
    most
}

/// Checks, over all keys and frames, that joints which are not listed move as before, and that they would not with the clip as
/// it was.
fn check(what: &str, before: &Rig, after: &Rig, most_frames: usize) -> Rig {
    let mut kept = after.clone();
    let notes: Vec<ClipNote> = keep_clips(before, &mut kept, &Arc::new(modules::all())).unwrap().notes;
    let listed: HashSet<Uid> = notes.iter().map(|note| note.deviation.joint).collect();
    let frames = notes.iter().map(|note| note.frames).max().unwrap_or_default();
    println!("{what}: {} joints are listed, one of them at {frames} frames", listed.len());
    assert!(frames <= most_frames, "{what}: a joint is listed at {frames} frames, {:?}", notes.first());
    let (from, to) = (program(before), program(after));
    let clip = before.clip(CLIP).unwrap();
    let times: Vec<f32> = (0..=60).map(|frame| frame as f32 / clip.frame_rate).chain(clip.key_times()).collect();
    for (joint, (distance, angle)) in joints_off((&from, clip), (&to, kept.clip(CLIP).unwrap()), &times) {
        assert!(
            listed.contains(&joint) || (distance <= NEAR.0 && angle <= NEAR.1),
            "{what}: {joint} is off by {distance} m and {angle}°"
        );
    }
    let plain = joints_off((&from, clip), (&to, after.clip(CLIP).unwrap()), &times);
    let plain = plain.into_values().fold((0.0f32, 0.0f32), |most, own| (most.0.max(own.0), most.1.max(own.1)));
    assert!(plain.0 > NEAR.0 || plain.1 > NEAR.1, "{what}: the change moves nothing");
    kept
}

#[test]
fn names_and_groups_leave_clips_alone() {
    let before = animated();
    let mut after = before.clone();
    let hand = after.find_label("hand_l").unwrap();
    apply(&mut after, RigEdit::SetLabel(hand, Some("fist_l".into())));
    apply(&mut after, RigEdit::SetGroup(hand, None));
    let mut kept = after.clone();
    assert!(keep_clips(&before, &mut kept, &Arc::new(modules::all())).unwrap().is_empty());
    assert_eq!(kept, after);
}

/// Joints whose axes are flipped.
pub const FLIPPED: [&str; 4] = ["spine_1", "forearm_l", "hand_r", "head"];

/// The biped with a gentle motion of a few controls, and of all that stand on joints which are flipped.
pub fn gentle() -> Rig {
    let mut rig = biped();
    let program = program(&rig);
    let nodes = controls(&program);
    let on_flipped = program.nodes().iter().filter(|node| {
        node.kind == NodeType::Control && node.label.as_deref().is_some_and(|label| FLIPPED.contains(&label))
    });
    let on_flipped: Vec<Uid> = on_flipped.map(|node| node.uid).collect();
    assert!(on_flipped.len() >= FLIPPED.len());
    let mut random = Random(12);
    let mut clip = RigClip { range: [0.0, 2.0], ..RigClip::new(CLIP, BASE, "gentle") };
    for number in 0..on_flipped.len() + 12 {
        let keys = (0..=4).map(|time| Key::rotation(time as f32 * 0.5, turn(&mut random, 0.25))).collect();
        let node = on_flipped.get(number).copied().unwrap_or_else(|| random.pick(&nodes));
        clip.layers[0].tracks.insert(target(node, Property::Rotation), Arc::new(Track { keys }));
    }
    apply(&mut rig, RigEdit::AddClip(Box::new(clip), 0));
    rig
}

/// Turns the axes of those joints by half a turn.
pub fn flip_all(rig: &mut Rig) {
    for label in FLIPPED {
        flip(rig, label, Quat::from_euler(EulerRot::XYZ, 0.0, std::f32::consts::PI, 0.0));
    }
}

#[test]
fn flipped_axes_hold_the_motion() {
    let before = gentle();
    let mut after = before.clone();
    flip_all(&mut after);
    let kept = check("flipped axes", &before, &after, 6);
    assert_ne!(kept.clips(), after.clips());
}

#[test]
fn another_parent_holds_the_motion() {
    let before = animated();
    let mut after = before.clone();
    let [clavicle, spine] = ["clavicle_l", "spine_1"].map(|label| after.find_label(label).unwrap());
    let global = after.rest_global(clavicle);
    apply(&mut after, RigEdit::SetParent { joint: clavicle, parent: Some(spine), index: usize::MAX });
    let rest = after.local_rest(Some(spine), &global);
    apply(&mut after, RigEdit::SetRest(clavicle, rest));
    check("a clavicle below another joint", &before, &after, 0);
}
