//! Sampling of clips on one core: time for a character, and for a crowd.
//!
//! ```text
//! cargo bench --bench animation --no-default-features
//! ```
//!
//! Clips are ten seconds of random motion, made before the clock starts: baked at 30 frames a second (all tracks have the same
//! times), or with keys of their own for each track, or with cubic keys. Each time is the least of several runs; a run plays
//! the clip forwards at 60 frames a second. The peers are Bevy's `AnimatableKeyframeCurve` with the same keys in the same run, and
//! ozz-animation-rs where it is built: it needs features of Rust that are not stable, so it is a dependency under a `cfg`:
//!
//! ```text
//! RUSTFLAGS="--cfg rigsmith_ozz" cargo +nightly bench --bench animation --no-default-features
//! ```
//!
//! With `-- bvh` it reads motion capture instead: a million frames of 31 joints with 96 channels, made before the clock starts, as
//! bytes and as a file. Takes 3 GiB of memory.
//!
//! Prints one JSON line.

#[path = "../tests/it/random.rs"]
#[expect(dead_code, reason = "tests use more of it")]
mod random;

#[cfg(rigsmith_ozz)]
#[path = "animation/ozz.rs"]
mod ozz;

use std::{hint::black_box, sync::Arc, time::Instant};

use bevy::{
    animation::prelude::AnimatableKeyframeCurve,
    math::{EulerRot, Quat, Vec3, Vec4, curve::Curve},
};
use rigsmith::{
    files::{RealDisk, load_motion},
    rig::{
        Uid,
        animation::{ClipSampler, Ease, Key, Property, RigClip, SampleCursor, Track, TrackTarget},
        format::bvh::read_bvh,
    },
};

use random::Random;

const SECONDS: f32 = 10.0;
const CROWD: usize = 1000;
const TRACKS: usize = 57;

/// Spacing of the keys of a clip.
#[derive(Clone, Copy, PartialEq)]
enum Keys {
    Baked,
    /// Baked, rotations alone.
    Turns,
    Own,
    Cubic,
}

fn main() {
    if std::env::args().any(|argument| argument == "bvh") {
        motion_capture();
        return;
    }
    let mut random = Random(1);
    let mut report = Vec::new();
    for (name, keys) in [("baked", Keys::Baked), ("own_times", Keys::Own), ("cubic", Keys::Cubic)] {
        let clip = clip(&mut random, 100, keys);
        let sampler = ClipSampler::new(&clip);
        let mut cursor = sampler.cursor();
        let mut out = vec![Vec4::ZERO; sampler.targets().len()];
        let frames = (SECONDS * 60.0) as u32;
        let seconds = best(20, || {
            for frame in 0..frames {
                sampler.sample(frame as f32 / 60.0, &mut cursor, &mut out);
                black_box(&out);
            }
        });
        report.push(format!("\"{name}_100_tracks_us\": {:.3}", seconds / f64::from(frames) * 1e6));
    }
    let clip = clip(&mut random, TRACKS, Keys::Baked);
    let phases: Vec<f32> = (0..CROWD).map(|_| random.unit() * SECONDS).collect();
    report.push(format!("\"crowd_1000_x_57_ms\": {:.3}", crowd(&clip, &phases)));
    let (rotations, places) = curves(&clip);
    let seconds = best(10, || {
        for frame in 0..30 {
            for phase in &phases {
                let time = (phase + frame as f32 / 60.0) % SECONDS;
                for curve in &rotations {
                    black_box(curve.sample_clamped(time));
                }
                for curve in &places {
                    black_box(curve.sample_clamped(time));
                }
            }
        }
    });
    report.push(format!("\"bevy_crowd_1000_x_57_ms\": {:.3}", seconds / 30.0 * 1e3));
    let turns = self::clip(&mut random, TRACKS, Keys::Turns);
    report.push(format!("\"crowd_1000_x_57_rotations_ms\": {:.3}", crowd(&turns, &phases)));
    #[cfg(rigsmith_ozz)]
    {
        let mut ozz = ozz::Crowd::new(&turns, CROWD);
        let mut frame = 0_u32;
        let seconds = best(10, || {
            for _ in 0..30 {
                ozz.sample(|number| (phases[number] + frame as f32 / 60.0) % SECONDS / SECONDS);
                frame += 1;
            }
        });
        report.push(format!("\"ozz_crowd_1000_x_57_ms\": {:.3}", seconds / 30.0 * 1e3));
    }
    println!("{{{}}}", report.join(", "));
}

/// Reads a long BVH file.
fn motion_capture() {
    const FRAMES: usize = 1_000_000;
    let mut random = Random(3);
    let mut text = "HIERARCHY\n".to_owned();
    let channels = "Zrotation Yrotation Xrotation";
    for joint in 0..31 {
        let kind = if joint == 0 { "ROOT" } else { "JOINT" };
        let own =
            if joint == 0 { format!("6 Xposition Yposition Zposition {channels}") } else { format!("3 {channels}") };
        text.push_str(&format!("{kind} joint{joint}\n{{\nOFFSET 0 1 0\nCHANNELS {own}\n"));
    }
    text.push_str("End Site\n{\nOFFSET 0 1 0\n}\n");
    text.push_str(&"}\n".repeat(31));
    text.push_str(&format!("MOTION\nFrames: {FRAMES}\nFrame Time: .0083333\n"));
    let row = |random: &mut Random| {
        let number = |_| format!("{:.4}", random.unit() * 180.0 - 90.0);
        (0..96).map(number).collect::<Vec<_>>().join(" ") + "\n"
    };
    let rows: String = (0..1000).map(|_| row(&mut random)).collect();
    text.push_str(&rows.repeat(FRAMES / 1000));
    let from_bytes = best(3, || {
        let motion = read_bvh(black_box(text.as_bytes()), "long").expect("a motion");
        assert_eq!(motion.frames(), FRAMES);
    });
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("long.bvh");
    std::fs::write(&path, &text).expect("room for the file");
    let megabytes = text.len() as f64 / 1e6;
    drop(text);
    let from_file = best(3, || assert_eq!(load_motion(&RealDisk, &path).expect("a motion").frames(), FRAMES));
    println!(
        "{{\"bvh_frames\": {FRAMES}, \"bvh_mb\": {megabytes:.0}, \"bvh_bytes_s\": {from_bytes:.3}, \"bvh_file_s\": {from_file:.3}}}"
    );
}

/// Milliseconds of a frame of a crowd, each at a phase of its own; time goes on from run to run.
fn crowd(clip: &RigClip, phases: &[f32]) -> f64 {
    let sampler = ClipSampler::new(clip);
    let mut cursors: Vec<SampleCursor> = vec![sampler.cursor(); phases.len()];
    let mut out = vec![Vec4::ZERO; sampler.targets().len()];
    let mut frame = 0_u32;
    let seconds = best(10, || {
        for _ in 0..30 {
            for (cursor, phase) in cursors.iter_mut().zip(phases) {
                sampler.sample((phase + frame as f32 / 60.0) % SECONDS, cursor, &mut out);
                black_box(&out);
            }
            frame += 1;
        }
    });
    seconds / 30.0 * 1e3
}

/// A clip of rotations, with a translation for each seventh track unless it has rotations alone.
fn clip(random: &mut Random, tracks: usize, spacing: Keys) -> RigClip {
    let mut clip = RigClip { range: [0.0, SECONDS], ..RigClip::new(Uid(1), Uid(2), "random") };
    for number in 0..tracks {
        let is_place = number % 7 == 0 && spacing != Keys::Turns;
        let property = if is_place { Property::Translation } else { Property::Rotation };
        let mut turn = Vec3::ZERO;
        let mut time = 0.0;
        let mut keys = Vec::new();
        while time <= SECONDS {
            turn += Vec3::new(random.unit() - 0.5, random.unit() - 0.5, random.unit() - 0.5) * 0.1;
            let mut key = match is_place {
                true => Key::vector(time, turn),
                false => Key::rotation(time, Quat::from_euler(EulerRot::XYZ, turn.x, turn.y, turn.z)),
            };
            if spacing == Keys::Cubic {
                key.ease = Ease::Cubic { arrive: [0.0; 4], leave: [0.0; 4] };
            }
            keys.push(key);
            time += match spacing {
                Keys::Baked | Keys::Turns => 1.0 / 30.0,
                Keys::Own | Keys::Cubic => 0.05 + random.unit() * 0.1,
            };
        }
        let target = TrackTarget { node: Uid(100 + number as u64), property };
        clip.layers[0].tracks.insert(target, Arc::new(Track { keys }));
    }
    clip
}

type Curves<T> = Vec<AnimatableKeyframeCurve<T>>;

/// The tracks of a clip as curves of Bevy.
fn curves(clip: &RigClip) -> (Curves<Quat>, Curves<Vec3>) {
    let (mut rotations, mut places) = (Vec::new(), Vec::new());
    for (target, track) in &clip.layers[0].tracks {
        if target.property == Property::Rotation {
            let keys = track.keys.iter().map(|key| (key.time, Quat::from_array(key.value)));
            rotations.extend(AnimatableKeyframeCurve::new(keys));
        } else {
            let keys = track.keys.iter().map(|key| (key.time, Vec3::from_slice(&key.value)));
            places.extend(AnimatableKeyframeCurve::new(keys));
        }
    }
    (rotations, places)
}

/// Least time of several runs, in seconds.
fn best(runs: u32, mut run: impl FnMut()) -> f64 {
    let once = || {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64()
    };
    std::iter::repeat_with(once).take(runs as usize).fold(f64::INFINITY, f64::min)
}
