//! Peer ozz-animation-rs: keys of rotations as a file of ozz, and a crowd that samples it.
//!
//! Every joint of ozz has a translation and a scale, too; here they have one value all the time.

use std::{cell::RefCell, hint::black_box, rc::Rc};

use ozz_animation_rs::{Animation, Archive, SamplingContext, SamplingJob, SamplingJobRc, SoaTransform};
use rigsmith::rig::animation::{Property, RigClip};

/// Characters that share an animation.
pub struct Crowd {
    jobs: Vec<SamplingJobRc>,
}

impl Crowd {
    pub fn new(clip: &RigClip, count: usize) -> Self {
        let mut archive = Archive::from_vec(file(clip)).expect("a header");
        let animation = Rc::new(Animation::from_archive(&mut archive).expect("an animation"));
        let out = Rc::new(RefCell::new(vec![SoaTransform::default(); animation.num_soa_tracks()]));
        let job = || {
            let mut job: SamplingJobRc = SamplingJob::default();
            job.set_animation(animation.clone());
            job.set_context(SamplingContext::new(animation.num_tracks()));
            job.set_output(out.clone());
            job
        };
        Self { jobs: (0..count).map(|_| job()).collect() }
    }

    /// Samples each character at a time, as a share of the clip.
    pub fn sample(&mut self, ratio: impl Fn(usize) -> f32) {
        for (number, job) in self.jobs.iter_mut().enumerate() {
            job.set_ratio(ratio(number));
            job.run().expect("a valid job");
            black_box(job.output());
        }
    }
}

/// Keys of one kind for all joints, in the order in which they are needed.
#[derive(Default)]
struct Stream {
    ratios: Vec<u16>,
    previous: Vec<u16>,
    values: Vec<[u16; 3]>,
}

impl Stream {
    /// `key` gives the value of a joint at a time; joints from `moving` on have a first and a last key alone.
    fn new(joints: usize, moving: usize, times: usize, key: impl Fn(usize, usize) -> [u16; 3]) -> Self {
        let mut stream = Self::default();
        let mut last = vec![0; joints];
        let mut add = |joint: usize, time: usize, first: bool| {
            let at = stream.values.len();
            let back = if first { 0 } else { at - last[joint] };
            last[joint] = at;
            stream.ratios.push(u16::try_from(time).expect("few times"));
            stream.previous.push(u16::try_from(back).expect("keys near one another"));
            stream.values.push(key(joint, time));
        };
        (0..joints).for_each(|joint| add(joint, 0, true));
        (0..joints).for_each(|joint| add(joint, if joint < moving { 1 } else { times - 1 }, false));
        for time in 2..times {
            (0..moving).for_each(|joint| add(joint, time, false));
        }
        stream
    }

    fn write(&self, out: &mut Vec<u8>) {
        for list in [&self.ratios, &self.previous] {
            list.iter().for_each(|number| out.extend(number.to_le_bytes()));
        }
        // No keys to begin at in the middle.
        out.extend(0.0_f32.to_le_bytes());
        self.values.as_flattened().iter().for_each(|number| out.extend(number.to_le_bytes()));
    }
}

/// Bytes of a file of version 7 whose tracks all have keys at the same times.
fn file(clip: &RigClip) -> Vec<u8> {
    let tracks: Vec<_> = clip.layers[0].tracks.iter().collect();
    assert!(tracks.iter().all(|(target, _)| target.property == Property::Rotation), "ozz gets rotations");
    let times: Vec<f32> = tracks[0].1.keys.iter().map(|key| key.time).collect();
    let end = *times.last().expect("keys");
    let joints = tracks.len().next_multiple_of(4);
    let turn = |joint: usize, time: usize| match tracks.get(joint) {
        Some((_, track)) => packed(track.keys[time].value),
        None => packed([0.0, 0.0, 0.0, 1.0]),
    };
    // Zero and one as half floats.
    let translations = Stream::new(joints, 0, times.len(), |_, _| [0; 3]);
    let rotations = Stream::new(joints, tracks.len(), times.len(), turn);
    let scales = Stream::new(joints, 0, times.len(), |_, _| [0x3C00; 3]);
    let mut out = vec![1];
    out.extend(b"ozz-animation\0");
    out.extend(7_u32.to_le_bytes());
    out.extend(end.to_le_bytes());
    let counts = [tracks.len(), 0, times.len(), translations.values.len(), rotations.values.len(), scales.values.len()];
    for count in counts.into_iter().chain([0; 6]) {
        out.extend((count as u32).to_le_bytes());
    }
    times.iter().for_each(|time| out.extend((time / end).to_le_bytes()));
    [translations, rotations, scales].iter().for_each(|stream| stream.write(&mut out));
    out
}

/// Rotation in 48 bits: the place of its largest component, that one's sign, and 15 bits for each of the others.
fn packed(turn: [f32; 4]) -> [u16; 3] {
    let largest = (0..4).max_by(|a, b| turn[*a].abs().total_cmp(&turn[*b].abs())).unwrap_or(3);
    let others = (0..4).filter(|part| *part != largest);
    let mut bits = largest as u64 | (u64::from(turn[largest] < 0.0) << 2);
    for (number, part) in others.enumerate() {
        let share = (turn[part] * std::f32::consts::FRAC_1_SQRT_2 + 0.5).clamp(0.0, 1.0);
        bits |= ((share * 32767.0).round() as u64) << (3 + 15 * number);
    }
    [bits as u16, (bits >> 16) as u16, (bits >> 32) as u16]
}
