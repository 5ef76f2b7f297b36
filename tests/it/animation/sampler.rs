//! Compiled clips give what clips give.

use std::sync::Arc;

use bevy::math::{Quat, Vec4};
use rigsmith::rig::{
    Uid,
    animation::{ClipSampler, Key, LayerMode, Property, RigClip, SampleCursor, Track},
};

use super::{BASE, CLIP, Random, animated, target, turn};

/// Compares a compiled clip with the clip at random and at rising times.
fn compare(clip: &RigClip) {
    let sampler = ClipSampler::new(clip);
    let mut out = vec![Vec4::ZERO; sampler.targets().len()];
    let mut cursors = [sampler.cursor(), SampleCursor::default()];
    let mut random = Random(4);
    let rising = (0..400).map(|step| step as f32 * 0.006 - 0.2);
    let mut times: Vec<f32> = rising.collect();
    times.extend((0..400).map(|_| random.below(3000) as f32 / 1000.0 - 0.5));
    times.extend(clip.key_times());
    for time in times {
        for cursor in &mut cursors {
            sampler.sample(time, cursor, &mut out);
            for (target, value) in sampler.targets().iter().zip(&out) {
                let wanted = Vec4::from_array(clip.value(target, time).unwrap());
                let wanted = match target.property {
                    Property::Rotation if wanted.dot(*value) < 0.0 => -wanted,
                    _ => wanted,
                };
                assert!(wanted.abs_diff_eq(*value, 2e-6), "{target:?} at {time}: {value} for {wanted}");
            }
        }
    }
}

#[test]
fn a_compiled_clip_gives_the_values_of_the_clip() {
    let mut clip = animated().clip(CLIP).unwrap().clone();
    compare(&clip);
    clip.layers[1].mode = LayerMode::Override;
    compare(&clip);
    clip.layers[1].muted = true;
    compare(&clip);
    clip.layers[1].muted = false;
    clip.layers[1].mask = vec![clip.layers[1].tracks.keys().next().unwrap().node];
    compare(&clip);
    clip.layers.truncate(1);
    compare(&clip);
}

#[test]
fn far_turns_are_spherical() {
    let mut clip = RigClip::new(CLIP, BASE, "turns");
    let mut random = Random(9);
    for node in 1..20 {
        let turns = (0..6).map(|time| Key::rotation(time as f32 * 0.4, turn(&mut random, 3.0)));
        clip.layers[0].tracks.insert(target(Uid(node), Property::Rotation), Arc::new(Track { keys: turns.collect() }));
    }
    let half = vec![Key::rotation(0.0, Quat::IDENTITY), Key::rotation(2.0, Quat::from_rotation_x(3.1))];
    clip.layers[0].tracks.insert(target(Uid(99), Property::Rotation), Arc::new(Track { keys: half }));
    compare(&clip);
}

#[test]
fn times_that_are_no_numbers_give_the_start() {
    let clip = animated().clip(CLIP).unwrap().clone();
    let sampler = ClipSampler::new(&clip);
    let mut cursor = sampler.cursor();
    let mut values = [vec![Vec4::ZERO; sampler.targets().len()], vec![Vec4::ZERO; sampler.targets().len()]];
    sampler.sample(f32::NAN, &mut cursor, &mut values[0]);
    sampler.sample(f32::NEG_INFINITY, &mut cursor, &mut values[1]);
    assert_eq!(values[0], values[1]);
    assert_eq!(clip.sample(f32::NAN), clip.sample(-1.0));
    sampler.sample(f32::INFINITY, &mut cursor, &mut values[0]);
    assert_ne!(values[0], values[1]);
}
