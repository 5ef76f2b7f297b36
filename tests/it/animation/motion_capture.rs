//! Motion capture that survives changes of the rig: the first 300 frames of each file of motion, retargeted onto controls of the
//! biped, which is then changed in the ways in which riggers change rigs.

use std::{collections::HashSet, path::Path, sync::Arc};

use rigsmith::{
    files::{RealDisk, load_motion},
    modules,
    processor::keep_clips,
    rig::{
        Rig, RigEdit, Uid,
        animation::{RigClip, joint_map::JointMap, motion::Motion},
    },
    solve::retarget::{RetargetSettings, retarget},
};

use super::{
    apply, biped, built,
    keep::{NEAR, joints_off},
    program,
};
use crate::{
    keep_pose::{
        flip_axes, hang_clavicle_lower, hang_spine_on_hips, insert_neck_joint, rename_and_regroup, split_torso,
        without_pole,
    },
    prerequisites::test_data,
};

const NAMES: [&str; 4] = ["cmu_01_01", "makehuman_dance1", "makehuman_tpose", "makehuman_walk1"];
/// Frames of each file that count.
const FIRST: usize = 300;

/// So many of the first frames of a motion, evenly spread.
fn spread(mut motion: Motion, count: usize) -> Motion {
    let (width, whole) = (motion.width(), motion.frames().min(FIRST));
    let step = whole.div_ceil(count.max(1)).max(1);
    let frames = (0..whole).step_by(step);
    motion.values = frames.flat_map(|frame| motion.values[frame * width..][..width].to_vec()).collect();
    motion.frame_time *= step as f32;
    motion.markers.clear();
    motion
}

/// The motions on a rig.
fn clips(rig: &Rig, data: &Path, count: usize) -> Vec<RigClip> {
    let built = built(rig);
    let clip = |(number, name): (usize, &&str)| {
        let motion = load_motion(&RealDisk, &data.join("bvh").join(format!("{name}.bvh"))).unwrap();
        let motion = spread(motion, count);
        let map = JointMap::new(&motion, rig, &[]).unwrap();
        let mut clip = retarget(rig, &built, &motion, &map, &RetargetSettings::default()).unwrap().clip;
        clip.uid = Uid(0xCA00 + number as u64);
        clip.layers.iter_mut().for_each(|layer| layer.uid = Uid(0xCB00 + number as u64));
        clip
    };
    NAMES.iter().enumerate().map(clip).collect()
}

#[test]
fn captured_motion_survives_changes_of_the_rig() {
    let Some(data) = test_data() else { return };
    // All frames take minutes without optimisation.
    let count = std::env::var("RIGSMITH_FRAMES").ok().and_then(|count| count.parse().ok()).unwrap_or(10);
    let (whole, poleless) = (biped(), without_pole());
    let (of_whole, of_poleless) = (clips(&whole, &data, count), clips(&poleless, &data, count));
    let changed = |change: fn(&mut Rig)| {
        let mut rig = whole.clone();
        change(&mut rig);
        rig
    };
    let changes = [
        ("a control in two", &whole, &of_whole, changed(split_torso)),
        ("an added pole", &poleless, &of_poleless, biped()),
        ("a joint in the neck", &whole, &of_whole, changed(insert_neck_joint)),
        ("rename and regroup", &whole, &of_whole, changed(rename_and_regroup)),
        ("a spine below the hips", &whole, &of_whole, changed(hang_spine_on_hips)),
        ("a clavicle below another joint", &whole, &of_whole, changed(hang_clavicle_lower)),
        ("flipped axes", &whole, &of_whole, changed(flip_axes)),
    ];
    let modules = Arc::new(modules::all());
    let mut moving = 0;
    for (what, before, clips, after) in changes {
        let mut before = before.clone();
        let mut kept = after.clone();
        for clip in clips {
            for rig in [&mut before, &mut kept] {
                apply(rig, RigEdit::AddClip(Box::new(clip.clone()), usize::MAX));
            }
        }
        let report = keep_clips(&before, &mut kept, &modules).unwrap();
        assert!(report.set_aside.is_empty(), "{what}: {:?}", report.set_aside);
        let listed: HashSet<(Uid, Uid)> = report.notes.iter().map(|note| (note.clip, note.deviation.joint)).collect();
        let (from, to) = (program(&before), program(&after));
        let (mut frames, mut is_moving) = (0, false);
        for clip in clips {
            let mut times: Vec<f32> = clip.key_times();
            times
                .extend((0..=(clip.duration() * clip.frame_rate) as usize).map(|frame| frame as f32 / clip.frame_rate));
            frames += times.len();
            let off = joints_off((&from, clip), (&to, kept.clip(clip.uid).unwrap()), &times);
            for (joint, (distance, angle)) in &off {
                assert!(
                    listed.contains(&(clip.uid, *joint)) || (*distance <= NEAR.0 && *angle <= NEAR.1),
                    "{what}, {}: {joint} is off by {distance} m and {angle}°, and not listed",
                    clip.name
                );
            }
            let plain = joints_off((&from, clip), (&to, clip), &times);
            is_moving |= plain.values().any(|(distance, angle)| *distance > 0.01 || *angle > 1.0);
        }
        let told: usize = report.notes.iter().map(|note| note.frames).sum();
        println!("{what}: {} joints of clips are listed, {told} times in {frames} frames", listed.len());
        // Nearly all joints are held in nearly all frames.
        assert!(told * 10 <= frames * before.len(), "{what}: joints are listed {told} times in {frames} frames");
        if what == "rename and regroup" {
            assert!(report.is_empty() && kept.clips() == before.clips(), "names mean nothing to keys");
        }
        moving += usize::from(is_moving);
    }
    assert!(moving >= 2, "{moving} changes of seven move the joints where clips stay as they are");
}
