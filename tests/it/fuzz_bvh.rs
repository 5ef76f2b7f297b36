//! Fuzzing of the BVH reader, and of retargeting what it accepts: no panic, no hang, and finite numbers.

use rigsmith::{
    rig::{
        RigEdit,
        animation::{joint_map::JointMap, motion::MotionChannel},
        format::bvh::read_bvh,
    },
    solve::retarget::{MotionTarget, RetargetSettings, retarget},
};

use crate::{bench::shipped, mutate::run_fuzz};

/// Two frames of a human.
pub const HUMAN: &str = "HIERARCHY\nROOT Hips\n{\n OFFSET 0 0 0\n CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation\n\
    JOINT LeftUpLeg\n{\n OFFSET 1 -1 0\n CHANNELS 3 Zrotation Yrotation Xrotation\n JOINT LeftLeg\n{\n OFFSET 0 -4 0.1\n CHANNELS 3 Zrotation Yrotation Xrotation\n\
    JOINT LeftFoot\n{\n OFFSET 0 -4 0\n CHANNELS 3 Zrotation Yrotation Xrotation\n End Site\n{\n OFFSET 0 -1 1\n}\n}\n}\n}\n\
    JOINT RightUpLeg\n{\n OFFSET -1 -1 0\n CHANNELS 3 Zrotation Yrotation Xrotation\n JOINT RightLeg\n{\n OFFSET 0 -4 0.1\n CHANNELS 3 Zrotation Yrotation Xrotation\n\
    JOINT RightFoot\n{\n OFFSET 0 -4 0\n CHANNELS 3 Zrotation Yrotation Xrotation\n End Site\n{\n OFFSET 0 -1 1\n}\n}\n}\n}\n\
    JOINT Spine\n{\n OFFSET 0 2 0\n CHANNELS 3 Zrotation Yrotation Xrotation\n JOINT Head\n{\n OFFSET 0 4 0\n CHANNELS 0\n End Site\n{\n OFFSET 0 1 0\n}\n}\n}\n}\n\
    MOTION\nFrames: 2\nFrame Time: 0.0333333\n\
    0 9 0 0 0 0 10 0 5 0 0 20 0 0 0 -10 0 -5 0 0 20 0 0 0 0 5 0\n\
    0 9 1 0 0 0 12 0 5 0 0 25 0 0 0 -12 0 -5 0 0 15 0 0 0 0 6 0\n";

#[test]
fn no_text_breaks_the_bvh_reader() {
    let small = "HIERARCHY\r\nROOT The Root{OFFSET 0 0 0 CHANNELS 3 Zrotation Yrotation Xrotation\r\nEnd Site { OFFSET 0 1 0 } }\r\nMOTION\r\nFrames: 2\r\nFrame Time: .04\r\n1 2 3\r\n4 5 6";
    let seeds = [HUMAN, small, "HIERARCHY\rROOT a\r{\rOFFSET 0 0 0\r}\rMOTION\rFrames: 0\rFrame Time: 1\r"];
    let seeds: Vec<Vec<u8>> = seeds.map(|text| text.as_bytes().to_vec()).to_vec();
    let dictionary: &[&[u8]] = &[
        b"HIERARCHY",
        b"ROOT",
        b"JOINT a\n{\nOFFSET 0 0 0\nCHANNELS 0\n}",
        b"End Site",
        b"OFFSET",
        b"CHANNELS 1 Xrotation",
        b"Zposition",
        b"MOTION",
        b"Frames: 1",
        b"Frame Time: 0.03",
        b"{",
        b"}",
    ];
    let mut bare = shipped("biped");
    let tags: Vec<RigEdit> = bare
        .walk()
        .flat_map(|joint| joint.data.tags.iter().map(|tag| RigEdit::RemoveTag(joint.data.uid, tag.uid)))
        .collect();
    bare.apply(&RigEdit::Batch(tags)).unwrap();
    run_fuzz("bvh", &seeds, dictionary, |bytes| match read_bvh(bytes, "fuzz") {
        Ok(motion) => {
            let width: usize = motion.joints.iter().map(|joint| joint.channels.len()).sum();
            assert_eq!(motion.values.len(), motion.frames() * width);
            assert!(motion.values.iter().all(|value| value.is_finite()) && motion.frame_time > 0.0);
            for (at, joint) in motion.joints.iter().enumerate() {
                assert!(joint.parent.is_none_or(|parent| parent < at) && joint.rest.translation.is_finite());
                assert!(joint.channels.iter().all(|channel| {
                    matches!(channel, MotionChannel::Position(0..3) | MotionChannel::Rotation(0..3))
                }));
            }
            if motion.joints.len() > 200 || motion.frames() > 20 {
                return;
            }
            let Ok(map) = JointMap::new(&motion, &bare, &[]) else { return };
            let settings =
                RetargetSettings { onto: MotionTarget::Joints, max_frames: 200, ..RetargetSettings::default() };
            if let Ok(done) = retarget(&bare, &Default::default(), &motion, &map, &settings) {
                let mut tracks = done.clip.layers.iter().flat_map(|layer| layer.tracks.values());
                assert!(
                    tracks.all(|track| track.keys.iter().all(|key| key.value.iter().all(|value| value.is_finite())))
                );
            }
        }
        Err(error) => {
            let lines = 1 + bytes.iter().filter(|byte| b"\r\n".contains(byte)).count();
            assert!((1..=lines).contains(&error.line()), "{error}");
            let text = error.to_string();
            assert!(text.len() < 400 && !text.chars().any(char::is_control), "{text:?}");
        }
    });
}
