//! Packed clips: every joint is within the tolerance at every frame, bytes come back, and damage is told.

use std::sync::Arc;

use rigsmith::{
    mesh::model::{Clip, Model, Node},
    modules,
    plugins::limits::{Limit, RigLimits},
    processor::Builder,
    rig::{
        Rig,
        animation::{
            Key, Marker,
            clip_extras::ClipExtras,
            file_clip::motion_of,
            joint_map::JointMap,
            motion::{Motion, MotionChannel},
        },
        format::bvh::read_bvh,
        operations::KeyTolerance,
    },
    solve::{
        bake_clip::{BakeSettings, BakedNode},
        packed_clip::{PackedClip, PackedClipError, PackedSkeleton, pack_clip, pack_motion},
        program::{CompileOptions, RigProgram},
        retarget::{RetargetSettings, retarget},
    },
};

use crate::{bench::shipped, prerequisites::test_data, random::Random};

/// A figure whose joints all swing, with a hold in the middle.
fn swinging() -> Motion {
    let walker = read_bvh(include_bytes!("retarget/walker.bvh"), "swing").unwrap();
    let value = |frame: usize, channel: usize| {
        let time = if (100..140).contains(&frame) { 100.0 } else { frame as f32 } / 60.0;
        let size = if channel < 6 { 0.5 } else { 25.0 };
        size * (time * (1.0 + 0.1 * (channel % 7) as f32) + channel as f32).sin()
    };
    let width = walker.width();
    let values = (0..300).flat_map(|frame| (0..width).map(move |channel| value(frame, channel))).collect();
    let markers = vec![Marker { time: 0.5, name: "left".to_owned() }];
    Motion { frame_time: 1.0 / 60.0, values, looped: true, markers, ..walker }
}

/// Bytes of one float key a frame a track: translation, rotation and scale of each joint.
fn whole(joints: usize, frames: usize) -> usize {
    joints * frames * 10 * 4
}

/// Greatest distance of a joint from where a motion has it, at any of its frames, as the unpacked clip is played.
fn off(motion: &Motion, clip: &Clip) -> f32 {
    let node = |joint: &rigsmith::rig::animation::motion::MotionJoint| Node {
        name: joint.name.clone(),
        parent: joint.parent,
        rest: joint.rest,
        joint: true,
        extras: None,
    };
    let model = Model { nodes: motion.joints.iter().map(node).collect(), ..Model::default() };
    let played = motion_of(&model, clip);
    assert_eq!(played.frames(), motion.frames());
    let at = |frame: usize| {
        let pairs = played.globals(frame).into_iter().zip(motion.globals(frame));
        pairs.map(|(is, was)| is.translation.distance(was.translation)).fold(0.0, f32::max)
    };
    (0..motion.frames()).map(at).fold(0.0, f32::max)
}

#[test]
fn joints_are_within_the_tolerance_at_every_frame() {
    let motion = swinging();
    let height = 170.0;
    for share in [1.0, 0.1, 20.0] {
        let tolerance = KeyTolerance::captured().scaled(share).for_height(height);
        let packed = pack_motion(&motion, &tolerance);
        let (clip, bytes) = (packed.unpacked(), packed.to_bytes());
        let off = off(&motion, &clip);
        let ratio = whole(motion.joints.len(), motion.frames()) as f32 / bytes.len() as f32;
        println!(
            "{} bytes, {} keys, {ratio:.1} : 1, off {off} of {}",
            bytes.len(),
            packed.key_count(),
            tolerance.distance
        );
        assert!(off <= 1.02 * tolerance.distance, "{off} of {}", tolerance.distance);
        assert!(share < 1.0 || ratio > 10.0, "{ratio}");
        // Joints at rest in a part have no channel for it.
        assert!(clip.channels.len() < 2 * motion.joints.len());
        let facts = ClipExtras::read(clip.extras.as_ref());
        assert!(facts.looped && facts.markers == motion.markers);
        // Bytes are the clip again, and the same bytes.
        let again = PackedClip::from_bytes(&bytes).unwrap();
        assert_eq!((&again, again.to_bytes()), (&packed, bytes));
    }
    assert_eq!(pack_motion(&motion, &KeyTolerance::captured()), pack_motion(&motion, &KeyTolerance::captured()));
}

#[test]
fn rotations_all_around_and_single_frames_are_kept() {
    let mut motion = swinging();
    let turned = motion.joints.iter().position(|joint| joint.channels.len() == 3).unwrap();
    let channel = motion.joints[..turned].iter().map(|joint| joint.channels.len()).sum::<usize>();
    assert!(matches!(motion.joints[turned].channels[0], MotionChannel::Rotation(_)));
    let width = motion.width();
    for frame in 0..motion.frames() {
        motion.values[frame * width + channel] = 9.0 * frame as f32;
    }
    let tolerance = KeyTolerance::captured().for_height(170.0);
    let packed = pack_motion(&motion, &tolerance);
    assert!(off(&motion, &packed.unpacked()) <= 1.02 * tolerance.distance);
    for frames in [0, 1, 2] {
        let mut short = motion.clone();
        short.values.truncate(frames * width);
        let packed = pack_motion(&short, &tolerance);
        assert_eq!(packed.frames(), frames);
        assert_eq!(PackedClip::from_bytes(&packed.to_bytes()).unwrap(), packed);
    }
}

fn put_number(out: &mut Vec<u8>, mut number: u32) {
    while number >= 0x80 {
        out.push(number as u8 | 0x80);
        number >>= 7;
    }
    out.push(number as u8);
}

/// A file with one node, whose rotation has a value for each frame, each of them in three bits.
pub fn dense_clip(frames: u32) -> Vec<u8> {
    let floats = |out: &mut Vec<u8>, list: &[f32]| list.iter().for_each(|number| out.extend(number.to_le_bytes()));
    let mut clip = b"rigclip1\0\0".to_vec();
    floats(&mut clip, &[30.0, frames as f32 / 30.0]);
    put_number(&mut clip, frames);
    put_number(&mut clip, 1);
    // Translation and scale stay at rest; steps of a rotation begin with the middle one, the first numbers and a step.
    clip.extend([0, 4, 1]);
    floats(&mut clip, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1e-3]);
    for _ in 0..3 {
        clip.extend([1, 0]);
        put_number(&mut clip, frames.div_ceil(8));
        clip.resize(clip.len() + frames.div_ceil(8) as usize, 0);
    }
    clip.push(0);
    let mut out = b"rigpack1\x01".to_vec();
    out.extend(7_u64.to_le_bytes());
    out.extend([0, 0]);
    floats(&mut out, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]);
    out.push(1);
    put_number(&mut out, clip.len() as u32);
    out.extend(clip);
    out
}

/// Bytes of the keys of a clip, in a file's model and in a rig.
fn bytes_of_keys(clip: &Clip) -> u64 {
    let bytes = |numbers: usize| (size_of::<f32>() * numbers) as u64;
    let channel = |channel: &rigsmith::mesh::model::Channel| {
        bytes(channel.times.len() + channel.values.len()) + (size_of::<Key>() * channel.times.len()) as u64
    };
    clip.channels.iter().map(channel).sum()
}

#[test]
fn memory_of_unpacked_clips_is_known_and_bounded() {
    let limits = RigLimits::default();
    let swinging = pack_motion(&swinging(), &KeyTolerance::captured().for_height(170.0));
    let dense = PackedSkeleton::from_bytes(&dense_clip(5_000)).unwrap();
    let whole = dense.model("dense").clips.remove(0);
    assert_eq!(whole.channels.iter().map(|channel| channel.times.len()).collect::<Vec<_>>(), [5_000]);
    assert!(swinging.unpacked_bytes() >= bytes_of_keys(&swinging.unpacked()));
    let (told, keys) = (dense.unpacked_bytes(), bytes_of_keys(&whole));
    assert!(told >= keys && told < 3 * keys, "{told} for {keys}");
    limits.check_packed("dense.rigclip", &dense).unwrap();

    // 400 KB with a million keys.
    let bytes = dense_clip(1 << 20);
    let dense = PackedSkeleton::from_bytes(&bytes).unwrap();
    assert_eq!(dense.to_bytes(), bytes);
    let error = limits.check_packed("dense.rigclip", &dense).unwrap_err();
    assert_eq!((error.name, error.count), ("unpacked", dense.unpacked_bytes()));
    assert_eq!(error.limit, limits.get(Limit::Unpacked) + 12 * bytes.len() as u64);
    let text = error.to_string();
    assert!(text.contains("`dense.rigclip`") && text.contains(&format!("--limit unpacked={}", error.count)), "{text}");
    limits.with(Limit::Unpacked, error.count).check_packed("dense.rigclip", &dense).unwrap();
}

#[test]
fn damaged_bytes_are_told_and_never_panic() {
    let packed = pack_motion(&swinging(), &KeyTolerance::captured().for_height(170.0));
    let bytes = packed.to_bytes();
    assert_eq!(PackedClip::from_bytes(b"something else"), Err(PackedClipError::Other));
    for length in (8..bytes.len()).step_by(7) {
        let error = PackedClip::from_bytes(&bytes[..length]).unwrap_err();
        assert!(!error.to_string().is_empty());
    }
    let mut longer = bytes.clone();
    longer.push(0);
    assert!(matches!(PackedClip::from_bytes(&longer), Err(PackedClipError::Damaged { .. })));
    // Times rise: a clip of many frames does not end where it starts.
    let rate = (1.0 / swinging().frame_time).to_le_bytes();
    let place = bytes.windows(4).position(|window| window == rate).unwrap();
    let mut ended = bytes.clone();
    ended[place + 4..place + 8].fill(0);
    let is_told = matches!(
        PackedClip::from_bytes(&ended),
        Err(PackedClipError::Damaged { what: "a duration of fewer frames", .. })
    );
    assert!(is_told);
    let mut random = Random(5);
    let mut told = 0;
    for _ in 0..500 {
        let mut damaged = bytes.clone();
        let place = 8 + random.below(damaged.len() - 8);
        damaged[place] ^= 1 << random.below(8);
        match PackedClip::from_bytes(&damaged) {
            Ok(read) => drop(read.unpacked()),
            Err(error) => {
                told += 1;
                assert!(error.to_string().contains("pack"), "{error}");
            }
        }
    }
    assert!(told > 0);
}

fn stripped() -> Rig {
    use rigsmith::rig::RigEdit;
    let mut rig = shipped("biped");
    let tags = rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| (joint.data.uid, tag.uid)));
    let edits = tags.map(|(joint, tag)| RigEdit::RemoveTag(joint, tag)).collect();
    rig.apply(&RigEdit::Batch(edits)).unwrap();
    rig
}

/// Captured motion within half a millimetre, on its own skeleton and on the biped, against one float key a frame a track.
#[test]
fn captured_motion_takes_a_twentieth() {
    let Some(data) = test_data() else { return };
    let motion = rigsmith::files::load_motion(&rigsmith::files::RealDisk, &data.join("bvh/cmu_01_01.bvh")).unwrap();
    let rest = motion.rest_globals();
    let heights = || rest.iter().map(|at| at.translation.y);
    let height = heights().fold(f32::MIN, f32::max) - heights().fold(f32::MAX, f32::min);
    let tolerance = KeyTolerance::captured().for_height(height);
    let packed = pack_motion(&motion, &tolerance);
    let off = off(&motion, &packed.unpacked());
    let bytes = packed.to_bytes().len();
    let ratio = whole(motion.joints.len(), motion.frames()) as f32 / bytes as f32;
    let keys = (3 * motion.joints.len() * motion.frames()) as f32 / packed.key_count() as f32;
    println!(
        "its own {} joints at {:.0} frames a second: {bytes} bytes, {ratio:.1} : 1, keys {keys:.1} : 1, off {:.3} mm of 1.7 m",
        motion.joints.len(),
        1.0 / motion.frame_time,
        off * 1.7e3 / height
    );
    assert!(off <= 1.02 * tolerance.distance, "{off} of {}", tolerance.distance);
    assert!(ratio >= 20.0, "{ratio}");

    let rig = stripped();
    let built = Builder::build(&rig, &Arc::new(modules::all())).unwrap();
    let program = Arc::new(RigProgram::compile(&built, &CompileOptions::default()).unwrap());
    let map = JointMap::new(&motion, &rig, &[]).unwrap();
    let exact = KeyTolerance::captured().scaled(1e-3);
    let settings = RetargetSettings {
        onto: rigsmith::solve::retarget::MotionTarget::Joints,
        frame_rate: Some(30.0),
        tolerance: exact,
        ..RetargetSettings::default()
    };
    let clip = retarget(&rig, &built, &motion, &map, &settings).unwrap().clip;
    let joints: Vec<_> = rig.walk().collect();
    let place = |uid| joints.iter().position(|joint| joint.data.uid == uid);
    let node = |joint: &&rigsmith::rig::RigJoint| BakedNode {
        uid: joint.data.uid,
        parent: joint.parent.and_then(place),
        rest: joint.data.rest.into(),
    };
    let nodes: Vec<BakedNode> = joints.iter().map(node).collect();
    let packed = pack_clip(&program, &clip, &nodes, &BakeSettings::new(30.0, KeyTolerance::captured())).unwrap();
    let bytes = packed.to_bytes().len();
    let ratio = whole(nodes.len(), packed.frames()) as f32 / bytes as f32;
    println!("the biped's {} joints at 30 frames a second: {bytes} bytes, {ratio:.1} : 1", nodes.len());
    assert!(ratio >= 20.0, "{ratio}");
}
