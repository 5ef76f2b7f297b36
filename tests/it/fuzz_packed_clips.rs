//! Fuzzing of the reader of packed clips: no panic, no hang, and whatever it accepts is played and writes itself again.

use std::cell::Cell;

use rigsmith::{
    rig::{
        Uid,
        animation::motion::{Motion, MotionJoint},
        format::bvh::read_bvh,
        operations::KeyTolerance,
    },
    solve::packed_clip::{PackedNode, PackedSkeleton, pack_motion},
};

use crate::{fuzz_bvh::HUMAN, mutate::run_fuzz, random::Random};

/// Bytes of the skeleton of motions, with a clip of each.
fn packed(motions: &[Motion]) -> Vec<u8> {
    let joints = motions.first().map(|motion| motion.joints.as_slice()).unwrap_or_default();
    let node = |(number, joint): (u64, &MotionJoint)| PackedNode {
        uid: Uid(number),
        name: joint.name.clone(),
        parent: joint.parent,
        rest: joint.rest,
    };
    let clips = motions.iter().map(|motion| pack_motion(motion, &KeyTolerance::captured().for_height(10.0)));
    PackedSkeleton { nodes: (1..).zip(joints).map(node).collect(), clips: clips.collect() }.to_bytes()
}

#[test]
fn no_bytes_break_the_reader_of_packed_clips() {
    let short = read_bvh(HUMAN.as_bytes(), "short").unwrap();
    // Motion with noise, which has a value for each frame, and a smooth one, which has keys.
    let (width, mut random) = (short.width(), Random(3));
    let noise = (0..40 * width).map(|_| 0.2 * random.signed()).collect();
    let noise = Motion { name: "noise".into(), values: noise, ..short.clone() };
    let wave = |at: usize| 20.0 * bevy::math::ops::sin((at / width) as f32 * 0.2 + (at % width) as f32);
    let smooth = Motion { name: "smooth".into(), values: (0..40 * width).map(wave).collect(), ..short.clone() };
    let seeds = [packed(&[]), packed(std::slice::from_ref(&short)), packed(&[noise, short, smooth])];
    let (is_read, is_refused) = (Cell::new(0), Cell::new(0));
    run_fuzz("packed_clips", &seeds, &[b"rigpack1", b"rigclip1"], |bytes| match PackedSkeleton::from_bytes(bytes) {
        Ok(read) => {
            is_read.set(is_read.get() + 1);
            let written = read.to_bytes();
            let again = PackedSkeleton::from_bytes(&written).unwrap();
            assert_eq!((again.to_bytes(), again), (written, read.clone()));
            for channel in read.model("fuzz").clips.iter().flat_map(|clip| &clip.channels) {
                assert!(channel.times.windows(2).all(|pair| pair[0] < pair[1]), "{:?}", channel.times);
                assert!(channel.times.iter().chain(&channel.values).all(|number| number.is_finite()));
            }
            drop(read.animation("fuzz"));
        }
        Err(error) => {
            is_refused.set(is_refused.get() + 1);
            assert!(error.to_string().contains("pack"), "{error}");
        }
    });
    let (read, refused) = (is_read.get(), is_refused.get());
    assert!(read > 100 && refused > 100, "{read} are read, {refused} refused");
}
