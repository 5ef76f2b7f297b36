//! Sampling of clips on one core: time for a character, and for a crowd.
//!
//! ```text
//! cargo bench --bench animation --no-default-features
//! ```
//!
//! Clips are ten seconds of random motion, made before the clock starts: baked at 30 frames a second (all tracks have the same
//! times), or with keys of their own for each track, or with cubic keys. Each time is the least of several runs; a run plays
//! the clip forwards at 60 frames a second. The peer is Bevy's `AnimatableKeyframeCurve` with the same keys in the same run.
//! Prints one JSON line.

#[path = "../tests/it/random.rs"]
#[expect(dead_code, reason = "tests use more of it")]
mod random;

use std::{hint::black_box, sync::Arc, time::Instant};

use bevy::{
    animation::prelude::AnimatableKeyframeCurve,
    math::{EulerRot, Quat, Vec3, Vec4, curve::Curve},
};
use rigsmith::rig::{
    Uid,
    animation::{ClipSampler, Ease, Key, Property, RigClip, SampleCursor, Track, TrackTarget},
};

use random::Random;

const SECONDS: f32 = 10.0;
const CROWD: usize = 1000;
const TRACKS: usize = 57;

/// Spacing of the keys of a clip.
#[derive(Clone, Copy, PartialEq)]
enum Keys {
    Baked,
    Own,
    Cubic,
}

fn main() {
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
    let sampler = ClipSampler::new(&clip);
    let mut cursors: Vec<SampleCursor> = vec![sampler.cursor(); CROWD];
    let mut out = vec![Vec4::ZERO; sampler.targets().len()];
    let phases: Vec<f32> = (0..CROWD).map(|_| random.unit() * SECONDS).collect();
    let seconds = best(10, || {
        for frame in 0..30 {
            for (cursor, phase) in cursors.iter_mut().zip(&phases) {
                sampler.sample((phase + frame as f32 / 60.0) % SECONDS, cursor, &mut out);
                black_box(&out);
            }
        }
    });
    report.push(format!("\"crowd_1000_x_57_ms\": {:.3}", seconds / 30.0 * 1e3));
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
    println!("{{{}}}", report.join(", "));
}

/// A clip of rotations, with a translation for each seventh track.
fn clip(random: &mut Random, tracks: usize, spacing: Keys) -> RigClip {
    let mut clip = RigClip { range: [0.0, SECONDS], ..RigClip::new(Uid(1), Uid(2), "random") };
    for number in 0..tracks {
        let is_place = number % 7 == 0;
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
            time += if spacing == Keys::Baked { 1.0 / 30.0 } else { 0.05 + random.unit() * 0.1 };
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
