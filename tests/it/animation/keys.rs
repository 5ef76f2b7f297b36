//! Changes that animators make to keys.

use std::sync::Arc;

use bevy::math::{Quat, Vec3};
use rigsmith::rig::{
    PoseOffset, Rig, RigEdit, Uid, UidSource,
    animation::{Ease, Key, Property, RigClip, Track, TrackTarget},
    operations::{
        ClipOperation, KeyClipboard, KeyEase, KeyOperation, KeyTolerance, Operation, OperationError, Outcome,
    },
};

use super::{BASE, CLIP, Random, TOP, animated, apply, biped, built, controls, program, share, target, turn};

fn run(rig: &mut Rig, operation: Operation) -> Outcome {
    let before = rig.clone();
    let outcome = operation.run(rig, &mut UidSource::seeded(11), None).unwrap();
    // One step, with an exact way back.
    let mut back = rig.clone();
    for inverse in &outcome.inverses {
        back.apply(inverse).unwrap();
    }
    assert_eq!(back, before, "{operation:?}");
    outcome
}

pub fn keys(rig: &mut Rig, layer: Uid, change: KeyOperation) -> Outcome {
    run(rig, Operation::Clips(ClipOperation::Keys { clip: CLIP, layer, change }))
}

pub fn track<'a>(rig: &'a Rig, layer: usize, target: &TrackTarget) -> &'a [Key] {
    rig.clips()[0].layers[layer].tracks.get(target).map_or(&[], |track| &track.keys)
}

fn times(keys: &[Key]) -> Vec<f32> {
    keys.iter().map(|key| key.time).collect()
}

#[test]
fn keys_of_the_pose_give_the_pose() {
    let mut rig = animated();
    let nodes = controls(&program(&rig));
    let mut random = Random(8);
    for node in nodes.iter().take(12) {
        let translation = Vec3::new(share(&mut random), share(&mut random), 0.0) * 0.1;
        let offset = PoseOffset { translation, rotation: turn(&mut random, 0.3), scale: Vec3::new(1.0, 1.2, 1.0) };
        apply(&mut rig, RigEdit::SetOffset(*node, Some(offset)));
    }
    apply(&mut rig, RigEdit::SetAttributeValue(nodes[0], "glow".into(), Some(0.75)));
    // On the base, and on a layer that adds half of its values to it.
    for layer in [BASE, TOP] {
        let mut rig = rig.clone();
        keys(&mut rig, layer, KeyOperation::Pose { time: 0.6, nodes: nodes[..12].to_vec() });
        let clip = rig.clip(CLIP).unwrap();
        for node in &nodes[..12] {
            let wanted = rig.offset(*node).copied().unwrap();
            let property = |property| clip.layers[usize::from(layer == TOP)].tracks[&target(*node, property)].clone();
            assert!(property(Property::Scale).keys.iter().any(|key| key.time == 0.6));
            if layer == BASE && clip.layers[1].tracks.keys().any(|target| target.node == *node) {
                continue;
            }
            let found = clip.sample(0.6).offsets[node];
            assert!(found.translation.distance(wanted.translation) < 1e-5, "{found:?} {wanted:?}");
            assert!(found.rotation.dot(wanted.rotation).abs() > 1.0 - 1e-5, "{found:?} {wanted:?}");
            assert!(found.scale.distance(wanted.scale) < 1e-5);
        }
        assert_eq!(clip.sample(0.6).values[&nodes[0]]["glow"], 0.75);
    }
}

#[test]
fn keys_move_scale_paste_and_go() {
    let mut rig = animated();
    let node = controls(&program(&rig))[1];
    let rotation = target(node, Property::Rotation);
    let before = track(&rig, 0, &rotation).to_vec();
    let some = |times: &[f32]| [(rotation.clone(), times.to_vec())].into();
    keys(&mut rig, BASE, KeyOperation::Move { keys: some(&[0.5, 0.75]), by: 0.25 });
    // The key at 1.0 is replaced, the one at 0.5 is gone.
    assert_eq!(times(track(&rig, 0, &rotation)), [0.0, 0.25, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0]);
    assert_eq!(track(&rig, 0, &rotation)[3].value, before[3].value);
    keys(&mut rig, BASE, KeyOperation::Scale { keys: some(&[0.0, 0.25, 0.75]), pivot: 0.0, factor: -1.0 });
    assert_eq!(times(track(&rig, 0, &rotation))[..4], [-0.75, -0.25, 0.0, 1.0]);
    let clipboard = Arc::new(KeyClipboard::copy(&rig.clips()[0].layers[0], &some(&[-0.25, 0.0])));
    keys(&mut rig, TOP, KeyOperation::Paste { clipboard: clipboard.clone(), at: 3.0 });
    let pasted = track(&rig, 1, &rotation);
    assert_eq!(times(&pasted[pasted.len() - 2..]), [3.0, 3.25]);
    let other = Uid(0xabc);
    let moved = Arc::new(clipboard.with_nodes(|_| other));
    keys(&mut rig, TOP, KeyOperation::Paste { clipboard: moved, at: 0.0 });
    assert_eq!(times(track(&rig, 1, &target(other, Property::Rotation))), [0.0, 0.25]);
    let all = times(track(&rig, 0, &rotation));
    keys(&mut rig, BASE, KeyOperation::Delete(some(&all)));
    assert!(track(&rig, 0, &rotation).is_empty());
    assert!(keys(&mut rig, BASE, KeyOperation::Delete(some(&all))).edits.is_empty(), "nothing is left to delete");
    keys(&mut rig, BASE, KeyOperation::Set(vec![(rotation.clone(), before.clone())]));
    assert_eq!(track(&rig, 0, &rotation), before);
}

#[test]
fn a_span_of_a_clip_is_retimed() {
    let mut rig = animated();
    let clip = rig.clip(CLIP).unwrap().clone();
    run(&mut rig, Operation::Clips(ClipOperation::Retime { clip: CLIP, from: [0.5, 1.5], to: [0.5, 3.5] }));
    let slow = rig.clip(CLIP).unwrap();
    assert_eq!((slow.range, slow.markers[1].time), ([0.0, 4.0], 3.5));
    for (time, then) in [(0.3, 0.3), (0.5, 0.5), (0.7, 1.1), (1.4, 3.2), (1.9, 3.9)] {
        let (was, is) = (clip.sample(time), slow.sample(then));
        for (node, offset) in &was.offsets {
            assert!(offset.rotation.dot(is.offsets[node].rotation).abs() > 1.0 - 1e-5, "{time}");
        }
    }
    // Cubic keys keep their curves inside of the span and beside it.
    let cubic = clip.layers[0].tracks.iter().find(|(_, track)| matches!(track.keys[0].ease, Ease::Cubic { .. }));
    let (target, track) = cubic.unwrap();
    let at = |time: f32| {
        if time <= 0.5 {
            time
        } else if time <= 1.5 {
            0.5 + (time - 0.5) * 3.0
        } else {
            time + 2.0
        }
    };
    let stretched = &slow.layers[0].tracks[target];
    for step in 0..=40 {
        let time = step as f32 * 0.05;
        let (was, is) = (track.sample(&target.property, time), stretched.sample(&target.property, at(time)));
        let off = was.unwrap().iter().zip(is.unwrap()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 1e-6, "{time}: {off}");
    }
    let mut whole = animated();
    run(&mut whole, Operation::Clips(ClipOperation::Retime { clip: CLIP, from: [0.0, 2.0], to: [1.0, 2.0] }));
    let fast = &whole.clip(CLIP).unwrap().layers[0].tracks[target];
    for step in 0..20 {
        let time = step as f32 * 0.1;
        let (was, is) = (track.sample(&target.property, time), fast.sample(&target.property, 1.0 + time * 0.5));
        let off = was.unwrap().iter().zip(is.unwrap()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 1e-6, "{time}: {off}");
    }
}

#[test]
fn keys_are_mirrored_onto_the_other_side() {
    let mut rig = biped();
    let all = built(&rig);
    let hand = |side: &str| {
        all.find_label(&format!("hand_ik_{side}"))
            .unwrap_or_else(|| all.find_label(&format!("hand_{side}")).unwrap())
            .uid
    };
    let upper = |side: &str| rig.find_label(&format!("upper_arm_{side}")).unwrap();
    let (hand_l, hand_r, arm_l, arm_r) = (hand("l"), hand("r"), upper("l"), upper("r"));
    let mut clip = RigClip::new(CLIP, BASE, "wave");
    let tracks = &mut clip.layers[0].tracks;
    let up = Key::vector(0.5, Vec3::new(0.1, 0.2, 0.05));
    tracks.insert(target(hand_l, Property::Translation), Arc::new(Track { keys: vec![up] }));
    let bent = Key::rotation(0.5, Quat::from_rotation_z(0.7) * Quat::from_rotation_x(0.2));
    tracks.insert(target(arm_l, Property::Rotation), Arc::new(Track { keys: vec![bent] }));
    apply(&mut rig, RigEdit::AddClip(Box::new(clip), 0));
    let selected: rigsmith::rig::operations::KeyTimes =
        rig.clips()[0].layers[0].tracks.keys().map(|target| (target.clone(), vec![0.5])).collect();
    keys(&mut rig, BASE, KeyOperation::Mirror { keys: selected, built: Some(Arc::new(all)) });
    let tracks = &rig.clips()[0].layers[0].tracks;
    assert_eq!(tracks.len(), 4);
    assert!(tracks.contains_key(&target(hand_r, Property::Translation)));
    // The joint of the other arm is where the mirror image is.
    let mut posed = rig.clone();
    for (node, offset) in rig.clips()[0].sample(0.5).offsets {
        apply(&mut posed, RigEdit::SetOffset(node, Some(offset)));
    }
    let below = |side: &str| posed.posed_global(rig.find_label(&format!("forearm_{side}")).unwrap()).translation;
    let (left, right) = (below("l"), below("r"));
    assert!(left.distance(right * Vec3::new(-1.0, 1.0, 1.0)) < 1e-4, "{left} {right}");
    assert!(tracks[&target(arm_r, Property::Rotation)].keys[0].time == 0.5);
}

#[test]
fn baked_keys_follow_the_track_and_reduced_ones_stay_within_the_tolerance() {
    let mut rig = animated();
    let targets: Vec<TrackTarget> = rig.clips()[0].layers[0].tracks.keys().cloned().collect();
    let before = rig.clip(CLIP).unwrap().clone();
    keys(&mut rig, BASE, KeyOperation::Bake { targets: targets.clone(), rate: 60.0 });
    let baked = rig.clip(CLIP).unwrap().clone();
    for target in &targets {
        let (was, is) = (&before.layers[0].tracks[target], &baked.layers[0].tracks[target]);
        assert!(is.keys.iter().all(|key| !matches!(key.ease, Ease::Cubic { .. })));
        for key in &is.keys {
            assert_eq!(was.sample(&target.property, key.time), Some(key.value), "{target:?} {}", key.time);
        }
    }
    assert!(baked.key_count() > before.key_count() * 5);
    let tolerance = KeyTolerance::default();
    keys(&mut rig, BASE, KeyOperation::Reduce { targets: targets.clone(), tolerance });
    let reduced = rig.clip(CLIP).unwrap();
    assert!(reduced.key_count() * 3 < baked.key_count(), "{} of {}", reduced.key_count(), baked.key_count());
    for target in &targets {
        for key in &baked.layers[0].tracks[target].keys {
            let now = reduced.layers[0].tracks[target].sample(&target.property, key.time).unwrap();
            match target.property {
                Property::Rotation => {
                    let (a, b) = (Quat::from_array(key.value), Quat::from_array(now));
                    let chord = (a - b).length().min((a + b).length());
                    let angle = 4.0 * (chord * 0.5).asin().to_degrees();
                    assert!(angle <= tolerance.angle + 1e-3, "{target:?}: {angle}");
                }
                _ => {
                    let off = key.value.iter().zip(now).map(|(a, b)| (a - b).powi(2)).sum::<f32>().sqrt();
                    assert!(off <= 1.01e-4, "{target:?}: {off}");
                }
            }
        }
    }
}

/// A key far away makes a clip long, and its tracks together have too many keys.
#[test]
fn baking_refuses_what_fills_the_memory() {
    let mut rig = animated();
    let joints = rig.walk().map(|joint| joint.data.uid).take(12);
    let targets: Vec<TrackTarget> = joints.map(|joint| target(joint, Property::Translation)).collect();
    let ends = || [0.0, 30_000.0].map(|time| Key::vector(time, Vec3::ZERO)).to_vec();
    let far = targets.iter().map(|target| (target.clone(), ends())).collect();
    keys(&mut rig, BASE, KeyOperation::Set(far));
    let before = rig.clone();
    for (targets, rate) in [(&targets[..], 30.0), (&targets[..1], 60.0)] {
        let change = KeyOperation::Bake { targets: targets.to_vec(), rate };
        let bake = Operation::Clips(ClipOperation::Keys { clip: CLIP, layer: BASE, change });
        let refused = bake.run(&mut rig, &mut UidSource::seeded(1), None);
        assert!(matches!(refused, Err(OperationError::BadNumber(_))), "{} tracks at {rate}", targets.len());
        assert_eq!(rig, before);
    }
    keys(&mut rig, BASE, KeyOperation::Bake { targets: targets[..1].to_vec(), rate: 0.5 });
    assert_eq!(track(&rig, 0, &targets[0]).len(), 15_001);
}

#[test]
fn a_committed_pose_sets_keys_in_the_same_step() {
    let mut rig = animated();
    let node = controls(&program(&rig))[5];
    let offset = PoseOffset::from_rotation(Quat::from_rotation_y(0.4));
    let posed = Operation::Pose(vec![(node, offset)]);
    let keyed = Operation::Keyed { operation: Box::new(posed.clone()), clip: CLIP, layer: Some(BASE), time: 0.4 };
    let count = rig.clips()[0].key_count();
    run(&mut rig, keyed.clone());
    assert_eq!(rig.offset(node), Some(&offset));
    let at = |rig: &Rig, time: f32| {
        rig.clips()[0].layers[0].tracks[&target(node, Property::Rotation)].sample(&Property::Rotation, time)
    };
    assert_eq!(at(&rig, 0.4), Some(offset.rotation.to_array()));
    assert!((1..=3).contains(&(rig.clips()[0].key_count() - count)));
    // The same pose at another time is no change of the document, and sets a key nevertheless.
    let again = Operation::Keyed { operation: Box::new(posed), clip: CLIP, layer: Some(BASE), time: 1.6 };
    run(&mut rig, again);
    assert_eq!(at(&rig, 1.6), Some(offset.rotation.to_array()));
    assert_eq!(keyed.name(), "Pose joints");
}

#[test]
fn turned_axes_keep_the_motion_of_their_keys() {
    let mut rig = biped();
    let joint = rig.find_label("forearm_l").unwrap();
    let hand = rig.find_label("hand_l").unwrap();
    let mut clip = RigClip::new(CLIP, BASE, "bend");
    let keys = vec![Key::rotation(0.0, Quat::from_rotation_x(0.3)), Key::rotation(1.0, Quat::from_rotation_z(-0.9))];
    clip.layers[0].tracks.insert(target(joint, Property::Rotation), Arc::new(Track { keys }));
    apply(&mut rig, RigEdit::AddClip(Box::new(clip), 0));
    let at = |rig: &Rig, time: f32| {
        let mut posed = rig.clone();
        for (node, offset) in rig.clips()[0].sample(time).offsets {
            apply(&mut posed, RigEdit::SetOffset(node, Some(offset)));
        }
        posed.posed_global(hand).translation
    };
    let before = [0.0, 0.5, 1.0].map(|time| at(&rig, time));
    let mut rest = rig.joint(joint).unwrap().data.rest;
    rest.rotation = (rest.rotation * Quat::from_euler(bevy::math::EulerRot::XYZ, 0.5, 1.0, -0.4)).normalize();
    run(&mut rig, Operation::Rest { to: vec![(joint, rest)], with_children: false });
    for (time, before) in [0.0, 0.5, 1.0].into_iter().zip(before) {
        assert!(at(&rig, time).distance(before) < 1e-5, "{time}");
    }
}

#[test]
fn values_are_keyed_above_the_layers_below() {
    let mut rig = animated();
    let node = controls(&program(&rig))[1];
    let rotation = target(node, Property::Rotation);
    let wanted = Quat::from_rotation_x(0.7).to_array();
    // The top layer adds half of its values.
    for layer in [BASE, TOP] {
        let mut rig = rig.clone();
        keys(&mut rig, layer, KeyOperation::Values { time: 0.6, values: vec![(rotation.clone(), wanted)] });
        let clip = rig.clip(CLIP).unwrap();
        let own = &clip.layers[usize::from(layer == TOP)].tracks[&rotation];
        assert!(own.keys.iter().any(|key| key.time == 0.6));
        let below = layer == BASE && clip.layers[1].tracks.contains_key(&rotation);
        let found = clip.value(&rotation, 0.6).unwrap();
        let alike: f32 = found.iter().zip(&wanted).map(|(a, b)| a * b).sum();
        assert!(below || alike.abs() > 1.0 - 1e-5, "{found:?}");
    }
    let bad = KeyOperation::Values { time: f32::NAN, values: vec![(rotation, wanted)] };
    let bad = Operation::Clips(ClipOperation::Keys { clip: CLIP, layer: BASE, change: bad });
    assert!(bad.run(&mut rig, &mut UidSource::seeded(1), None).is_err());
}

#[test]
fn keys_are_placed_at_times_of_their_own() {
    let mut rig = animated();
    let rotation = target(controls(&program(&rig))[1], Property::Rotation);
    let before = track(&rig, 0, &rotation).to_vec();
    // The key at 1.0 is met, the one at 9.0 does not exist.
    let pairs = vec![[0.25, 0.3], [0.5, 1.0], [9.0, 9.5]];
    keys(&mut rig, BASE, KeyOperation::Place(vec![(rotation.clone(), pairs)]));
    let now = track(&rig, 0, &rotation);
    assert_eq!(times(now), [0.0, 0.3, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0]);
    assert_eq!((now[1].value, now[3].value), (before[1].value, before[2].value));
}

#[test]
fn interpolation_is_set_for_the_keys_that_are_named() {
    let mut rig = animated();
    let translation = target(Uid(0xabc), Property::Translation);
    let heights = [0.0, 1.0, 3.0, 2.0];
    let line = heights.iter().zip([0.0, 0.5, 1.0, 1.5]);
    let line: Vec<Key> = line.map(|(height, time)| Key::vector(time, Vec3::new(0.0, *height, 0.0))).collect();
    keys(&mut rig, BASE, KeyOperation::Set(vec![(translation.clone(), line)]));
    let some = |times: &[f32]| [(translation.clone(), times.to_vec())].into();
    keys(&mut rig, BASE, KeyOperation::Ease { keys: some(&[0.5]), ease: KeyEase::Stepped });
    let eases = |rig: &Rig| track(rig, 0, &translation).iter().map(|key| key.ease).collect::<Vec<_>>();
    assert_eq!(eases(&rig), [Ease::Linear, Ease::Stepped, Ease::Linear, Ease::Linear]);
    keys(&mut rig, BASE, KeyOperation::Ease { keys: some(&[1.5, 0.0, 1.0, 0.5]), ease: KeyEase::Cubic });
    let slopes = eases(&rig).into_iter().map(|ease| match ease {
        Ease::Cubic { arrive, leave } if arrive == leave => leave[1],
        other => panic!("{other:?}"),
    });
    // Level at the ends and where the height turns back; three units a second in between.
    assert_eq!(slopes.collect::<Vec<_>>(), [0.0, 3.0, 0.0, 0.0]);
    let own = &rig.clips()[0].layers[0].tracks[&translation];
    let most = (0..=150).map(|step| own.sample(&Property::Translation, step as f32 * 0.01).unwrap()[1]);
    assert!(most.fold(0.0, f32::max) <= 3.0 + 1e-5, "a curve that swings beyond its keys");

    // Two signs of one rotation: the curve between them stays.
    let rotation = target(Uid(0xabc), Property::Rotation);
    let turned = [0.1f32, 0.2, 0.3].map(Quat::from_rotation_y);
    let turned = [turned[0], -turned[1], turned[2]];
    let line = turned.iter().zip([0.0, 0.5, 1.0]).map(|(turn, time)| Key::rotation(time, *turn)).collect();
    keys(&mut rig, BASE, KeyOperation::Set(vec![(rotation.clone(), line)]));
    let all = [(rotation.clone(), vec![0.0, 0.5, 1.0])].into();
    keys(&mut rig, BASE, KeyOperation::Ease { keys: all, ease: KeyEase::Cubic });
    let own = &rig.clips()[0].layers[0].tracks[&rotation];
    for step in 0..=20 {
        let at = Quat::from_array(own.sample(&Property::Rotation, step as f32 * 0.05).unwrap());
        let angle = at.angle_between(Quat::IDENTITY);
        assert!((0.1 - 1e-3..=0.3 + 1e-3).contains(&angle), "{angle}");
    }
}
