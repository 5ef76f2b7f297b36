//! Reduction of keys: how many are left, and how far joints are off at every frame.

use std::{
    cell::{Cell, RefCell},
    sync::Arc,
};

use rigsmith::{
    rig::{
        Rig,
        animation::{Ease, Key, Property, Track, TrackTarget, motion::Motion},
        operations::KeyTolerance,
    },
    solve::{
        curve_fit::sampled,
        reduction::{CurveKind, FrameErrors, SampledTrack, reduce_tracks},
    },
};

use super::{MotionTarget, PlayedRig, RetargetSettings, joints::strip, motion, shipped, test_data};

/// A figure whose joints all swing slowly, each at a pace of its own.
fn swinging() -> Motion {
    let walker = rigsmith::rig::format::bvh::read_bvh(include_bytes!("walker.bvh"), "swing").unwrap();
    let (width, rest) = (walker.width(), walker.values[..walker.width()].to_vec());
    let value = |frame: usize, channel: usize| {
        // The hips stay, knees are bent about their hinges, and all other rotations swing by ten degrees.
        let pace = 0.8 + 0.05 * (channel % 7) as f32;
        let swing = 10.0 * (frame as f32 / 60.0 * pace + channel as f32).sin();
        match channel {
            0..6 => rest[channel],
            15 | 16 | 27 | 28 => 0.0,
            17 | 29 => 25.0 + swing,
            _ => swing,
        }
    };
    let values = (0..1200).flat_map(|frame| (0..width).map(move |channel| value(frame, channel))).collect();
    Motion { frame_time: 1.0 / 60.0, values, ..walker }
}

/// Plays a motion with usual and with hardly any tolerance; gives both and the largest distance of a joint between them.
fn check(rig: &Rig, motion: &Motion, settings: &RetargetSettings) -> (PlayedRig, PlayedRig, f32) {
    let reduced = PlayedRig::new(rig.clone(), motion, settings);
    let exact = RetargetSettings { tolerance: KeyTolerance::captured().scaled(1e-3), ..settings.clone() };
    let exact = PlayedRig::new(rig.clone(), motion, &exact);
    let labels: Vec<&str> = rig.walk().filter_map(|joint| joint.data.label.as_deref()).collect();
    let times = reduced.times();
    let pairs = reduced.globals(&times, &labels).into_iter().zip(exact.globals(&times, &labels));
    let off = |(a, b): (Vec<rigsmith::mesh::model::Trs>, Vec<rigsmith::mesh::model::Trs>)| {
        a.iter().zip(&b).map(|(a, b)| a.translation.distance(b.translation)).fold(0.0, f32::max)
    };
    let worst = pairs.map(off).fold(0.0, f32::max);
    println!("keys {:?} and {:?}, off {:.3} mm", reduced.done.keys, exact.done.keys, 1e3 * worst);
    (reduced, exact, worst)
}

fn joints_alone() -> Rig {
    let mut rig = shipped("biped");
    strip(&mut rig);
    rig
}

#[test]
fn smooth_motion_needs_a_twentieth_of_its_keys() {
    let settings =
        RetargetSettings { onto: MotionTarget::Joints, travel: false, lock_feet: false, ..RetargetSettings::default() };
    let (reduced, _, off) = check(&joints_alone(), &swinging(), &settings);
    let [before, after] = reduced.done.keys;
    assert!(after * 20 <= before, "{after} of {before} keys are left");
    assert!(off <= 0.52e-3 * reduced.height / 1.7, "{off}");
}

/// The noise of a capture is larger than the tolerance; keys go nevertheless.
#[test]
fn captured_motion_stays_within_half_a_millimetre() {
    let Some(data) = test_data() else { return };
    let motion = motion(&data, "cmu_01_01");
    let rig = joints_alone();
    let settings = RetargetSettings { onto: MotionTarget::Joints, ..RetargetSettings::default() };
    let (reduced, _, off) = check(&rig, &motion, &settings);
    assert!(off <= 0.52e-3 * reduced.height / 1.7, "{off}");
    let [before, after] = reduced.done.keys;
    assert!(2 * before >= 5 * after, "{after} of {before} keys are left");
    // Against a key each frame for translation, rotation and scale of every joint, as compressors of clips count.
    let whole = 3 * rig.walk().count() * reduced.times().len();
    assert!(whole >= 20 * after, "{after} keys for {whole}");
    // Floats of keys: the time, the value, and two tangents where a track is cubic.
    let floats = |(target, track): (&TrackTarget, &Arc<Track>)| {
        let width = target.property.width();
        let of = |key: &Key| 1 + width * if matches!(key.ease, Ease::Cubic { .. }) { 3 } else { 1 };
        track.keys.iter().map(of).sum::<usize>()
    };
    let stored: usize = reduced.done.clip.layers[0].tracks.iter().map(floats).sum();
    let raw = 10 * rig.walk().count() * reduced.times().len();
    println!(
        "keys of moving tracks {:.1} : 1, of all tracks {:.1} : 1, floats {:.1} : 1",
        before as f32 / after as f32,
        whole as f32 / after as f32,
        raw as f32 / stored as f32
    );
}

#[test]
fn controls_stay_within_half_a_millimetre() {
    let Some(data) = test_data() else { return };
    let motion = motion(&data, "makehuman_walk1");
    let (reduced, exact, off) = check(&shipped("biped"), &motion, &RetargetSettings::default());
    assert!(off <= 0.52e-3 * reduced.height / 1.7, "{off}");
    assert!(reduced.done.keys[1] < exact.done.keys[1], "{:?} {:?}", reduced.done.keys, exact.done.keys);
}

/// Frames that are off through a closer fit of others cost a key each, not the keys of all frames.
#[test]
fn frames_that_are_off_again_and_again_get_keys() {
    const FRAMES: usize = 400;
    const ROUNDS: usize = 20;
    let times: Vec<f32> = (0..FRAMES).map(|frame| frame as f32 / 30.0).collect();
    let values: Vec<[f32; 4]> = times.iter().map(|time| [(3.0 * time).sin(), 0.0, 0.0, 0.0]).collect();
    let property = Property::Attribute("x".to_owned());
    let track = SampledTrack { property: property.clone(), values: values.clone(), tolerance: 0.05 };
    let (calls, off) = (Cell::new(0), RefCell::new(Vec::new()));
    let keys = reduce_tracks(&times, &[track], CurveKind::Linear, |found| {
        // Another frame is off in each round.
        let round = calls.replace(calls.get() + 1);
        let is_off = |frame: &usize| found[0][*frame] != values[*frame];
        let worst = (40 + 13 * round..FRAMES).find(is_off).filter(|_| round < ROUNDS);
        off.borrow_mut().extend(worst);
        let of = |frame: usize| if worst == Some(frame) { 2.0 } else { 0.0 };
        (0..FRAMES).map(|frame| FrameErrors { worst: of(frame), of_tracks: vec![of(frame)] }).collect()
    });
    assert_eq!((calls.get(), off.borrow().len()), (ROUNDS + 1, ROUNDS));
    let keys = &keys[0];
    println!("{} keys of {FRAMES}", keys.len());
    assert!(3 * keys.len() < FRAMES, "{}", keys.len());
    // The last ones have keys.
    for frame in &off.borrow()[ROUNDS - 6..] {
        assert!(keys.iter().any(|key| key.time == times[*frame]), "frame {frame} has no key");
    }
    for (found, wanted) in sampled(&property, &times, keys.clone()).iter().zip(&values) {
        assert!((found[0] - wanted[0]).abs() <= 0.0501, "{found:?} {wanted:?}");
    }
}

/// A larger tolerance does not bring back the keys of all frames.
#[test]
fn every_tolerance_leaves_few_keys() {
    let Some(data) = test_data() else { return };
    let motion = motion(&data, "cmu_01_01");
    for share in [1.2, 2.0, 4.0] {
        let tolerance = KeyTolerance::captured().scaled(share);
        let settings = RetargetSettings { tolerance, frame_rate: Some(30.0), ..RetargetSettings::default() };
        let played = PlayedRig::new(shipped("biped"), &motion, &settings);
        let [before, after] = played.done.keys;
        println!("within {:.1} mm: {after} keys of {before}", 0.5 * share);
        assert!(3 * after <= before, "within {:.1} mm {after} keys of {before} are left", 0.5 * share);
    }
}
