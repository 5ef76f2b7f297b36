//! Clips of few bytes that would become many transforms, clips in great number, and more markers and frames than are taken.

use std::{collections::HashSet, fs, path::Path, sync::Arc};

use rigsmith::{
    files::{RealDisk, load_model, load_packed_clips, load_template},
    mesh::model::ChannelTarget,
    modules,
    processor::Builder,
    rig::{
        NodeType, Rig, Uid, UidSource,
        animation::RigClip,
        operations::{ClipOperation, Operation},
    },
};

use super::{json_answer, memory::check, memory_allowance};
use crate::cli::explained;

fn asset(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets").join(name)
}

/// A clip of two keys that moves the hips of the biped for so many seconds, at 60 frames a second.
fn long_clip(seconds: u32) -> String {
    let rig = load_template(&RealDisk, &asset("templates/biped.rig.ron")).unwrap().rig;
    let built = Builder::build(&rig, &Arc::new(modules::all())).unwrap();
    let mut controls = built.nodes.iter().filter(|node| node.kind == NodeType::Control);
    let hips = controls.find(|node| node.name.contains("hips")).expect("the biped has a control of its hips");
    format!(
        "(format: 1, rig: \"{}\", rig_name: \"biped\", clips: [(uid: \"00000000c11b0001\", name: \"slow\", frame_rate: \
         60.0, range: (0.0, {seconds}.0), layers: [(uid: \"00000000c11b0002\", name: \"Base\", tracks: [(node: \"{}\", \
         property: Translation, keys: [(t: 0.0, v: (0, 0, 0)), (t: {seconds}.0, v: (0, -0.1, 0.1))])])])])",
        rig.uid(),
        hips.uid
    )
}

/// Motion capture of so many frames, thirty a second: a walk again and again.
fn long_motion(frames: usize) -> String {
    let (skeleton, motion) = include_str!("../retarget/walker.bvh").split_once("MOTION").unwrap();
    let rows: Vec<&str> = motion.trim().lines().skip(2).collect();
    let rows: String = rows.iter().cycle().take(frames).map(|row| format!("{row}\n")).collect();
    format!("{skeleton}MOTION\nFrames: {frames}\nFrame Time: 0.0333333\n{rows}")
}

#[test]
fn motion_of_many_frames_is_retargeted_within_its_memory() {
    let folder = tempfile::tempdir().unwrap();
    let motion = "walk.bvh";
    fs::write(folder.path().join(motion), long_motion(3_600)).unwrap();
    check(folder.path(), &[(&[motion], &["animate", "biped", motion, "-o", "walk.anim.ron"])]);
}

/// Motion capture of a chain of joints called j0, j1 and so on.
fn chain_motion(joints: usize, frames: usize) -> String {
    let joint = |number: usize| {
        let place = if number == 0 { "ROOT" } else { "JOINT" };
        format!("{place} j{number}\n{{\nOFFSET 0 1 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n")
    };
    let opened: String = (0..joints).map(joint).collect();
    let row = vec!["1"; 3 * joints].join(" ") + "\n";
    format!(
        "HIERARCHY\n{opened}End Site\n{{\nOFFSET 0 1 0\n}}\n{}MOTION\nFrames: {frames}\nFrame Time: 0.033333\n{}",
        "}\n".repeat(joints),
        row.repeat(frames)
    )
}

/// Frames hold the joints that the motion moves, however many others the rig has.
#[test]
fn motion_of_few_joints_on_a_rig_of_many_stays_within_its_memory() {
    let folder = tempfile::tempdir().unwrap();
    let joints: Vec<String> =
        (1..3_000).map(|number| format!("(label: \"j{number}\", parent: \"j0\", translation: (0, 0.1, 0))")).collect();
    let rig = format!("(format: 2, name: \"star\", joints: [(label: \"j0\"), {}])", joints.join(", "));
    fs::write(folder.path().join("star.rig.ron"), rig).unwrap();
    fs::write(folder.path().join("chain.bvh"), chain_motion(100, 300)).unwrap();
    // The first joint carries all others, so that each of these moves in every frame.
    fs::write(folder.path().join("long.bvh"), chain_motion(3, 1_500)).unwrap();
    for motion in ["chain.bvh", "long.bvh"] {
        let files = ["star.rig.ron", motion];
        check(folder.path(), &[(&files[..], &["animate", files[0], files[1], "-o", "out.anim.ron"])]);
    }
}

#[test]
fn clips_of_many_frames_are_baked_within_their_memory() {
    let folder = tempfile::tempdir().unwrap();
    let clip = "slow.anim.ron";
    fs::write(folder.path().join(clip), long_clip(240)).unwrap();
    check(
        folder.path(),
        &[
            (&[clip], &["animate", "biped", clip, "-o", "slow.glb"]),
            (&[clip], &["animate", "biped", clip, "-o", "slow.rigclip"]),
        ],
    );
    // Both files have the whole motion.
    let whole = load_model(&RealDisk, &folder.path().join("slow.glb")).unwrap();
    let packed = load_packed_clips(&RealDisk, &folder.path().join("slow.rigclip")).unwrap().model("slow");
    for model in [&whole, &packed] {
        let hips = model.nodes.iter().position(|node| node.name == "hips").unwrap();
        let is_way = |target: ChannelTarget| target == ChannelTarget::Translation(hips);
        let way = model.clips[0].channels.iter().find(|channel| is_way(channel.target)).expect("the hips move");
        assert!(way.times.is_sorted_by(|a, b| a < b), "{:?}", way.times);
        assert!((way.times.last().unwrap() - 240.0).abs() < 1e-2, "{:?}", way.times);
        // A straight way needs few keys, though the clip has 14,401 frames.
        assert!(way.times.len() < 2_000, "{} keys", way.times.len());
        let moved: f32 =
            (0..3).map(|axis| way.values[way.values.len() - 3 + axis] - way.values[axis]).map(|d| d * d).sum();
        assert!(moved.sqrt() > 0.05, "{moved}");
    }
}

/// Clips of one key each: what a clip takes besides its keys counts.
#[test]
fn thousands_of_short_clips_stay_within_their_memory() {
    let folder = tempfile::tempdir().unwrap();
    let rig = "(format: 2, name: \"n\", joints: [(uid: \"0000000000001001\", label: \"j\", translation: (0, 0.1, 0))])";
    fs::write(folder.path().join("j.rig.ron"), rig).unwrap();
    let one = |number: usize| {
        format!(
            "(uid: \"00000000c1{number:06x}\", name: \"c{number}\", frame_rate: 30.0, range: (0.0, 10.0), layers: [(uid: \
             \"00000000c2{number:06x}\", name: \"Base\", tracks: [(node: \"0000000000001001\", property: Translation, \
             keys: [(t: 0.0, v: (0, 0, 1))])])])"
        )
    };
    let all: Vec<String> = (0..6_000).map(one).collect();
    let text = format!("(format: 1, rig: \"0000000000000099\", rig_name: \"n\", clips: [{}])", all.join(", "));
    let clips = "many.anim.ron";
    fs::write(folder.path().join(clips), text).unwrap();
    check(
        folder.path(),
        &[
            (&[clips], &["animate", "j.rig.ron", clips, "-o", "out.anim.ron"]),
            (&[clips], &["animate", "j.rig.ron", clips, "-o", "out.glb"]),
            (&[clips], &["animate", "j.rig.ron", clips, "-o", "out.rigclip"]),
        ],
    );
}

#[test]
fn transforms_and_markers_beyond_their_limits_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let text = long_clip(10);
    fs::write(folder.path().join("slow.anim.ron"), &text).unwrap();
    let marker = |number: usize| format!("(time: {:.3}, name: \"m{number}\")", number as f64 / 1000.0);
    let markers: Vec<String> = (0..10_001).map(marker).collect();
    let marked = text.replacen("layers:", &format!("markers: [{}], layers:", markers.join(", ")), 1);
    fs::write(folder.path().join("marked.anim.ron"), marked).unwrap();
    for output in ["out.glb", "out.rigclip"] {
        let cases: [(&[&str], &[&str]); 2] = [
            (&["slow.anim.ron", "--limit", "baked=1000"], &["slow", "601 frames", "--limit baked="]),
            (&["marked.anim.ron"], &["slow", "10001 markers", "10000"]),
        ];
        for (args, wanted) in cases {
            let (ended, answer) = json_answer(folder.path(), &[&["animate", "biped"], args, &["-o", output]].concat());
            assert_eq!(ended.code, Some(1), "{args:?}: {answer:.600}");
            let told = explained(&answer);
            assert!(wanted.iter().all(|part| told.contains(part)), "{args:?}: {told}");
            assert!(!folder.path().join(output).exists(), "{args:?}");
        }
    }
}

#[test]
fn motion_without_frames_and_with_too_many_is_told() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("none.bvh"), chain_motion(2, 0)).unwrap();
    let rig =
        "(format: 2, name: \"n\", joints: [(label: \"j0\"), (label: \"j1\", parent: \"j0\", translation: (0, 1, 0))])";
    fs::write(folder.path().join("two.rig.ron"), rig).unwrap();
    let text = long_clip(10).replace("10.0", "3e38");
    fs::write(folder.path().join("long.anim.ron"), text).unwrap();
    fs::write(folder.path().join("empty.ron"), "[Stroke(points: [], joints: 5)]").unwrap();
    fs::copy(asset("models/head.obj"), folder.path().join("head.obj")).unwrap();
    let cases: [(&[&str], &[&str]); 3] = [
        (&["animate", "two.rig.ron", "none.bvh", "-o", "out.glb"], &["none.bvh", "no frames"]),
        (&["animate", "biped", "long.anim.ron", "-o", "out.glb"], &["slow", "more than a million million frames"]),
        (&["sketch", "head.obj", "empty.ron", "-o", "out.glb"], &["empty.ron", "no joint", "gesture 1"]),
    ];
    for (args, wanted) in cases {
        let (ended, answer) = json_answer(folder.path(), args);
        assert_eq!(ended.code, Some(1), "{args:?}: {answer:.600}");
        let told = explained(&answer);
        assert!(wanted.iter().all(|part| told.contains(part)), "{args:?}: {told}");
        assert!(!folder.path().join("out.glb").exists(), "{args:?}");
    }
}

/// 20,000 clips of one name and one uid get names and uids of their own.
#[test]
fn many_clips_alike_are_added_in_one_step() {
    let mut rig = Rig::new(Uid::derived(["many clips"]), "n");
    let mut uids = UidSource::seeded(7);
    let one = RigClip::new(Uid::derived(["clip"]), Uid::derived(["layer"]), "walk");
    let add = Operation::Clips(ClipOperation::AddAll(vec![one; 20_000]));
    let outcome = add.run(&mut rig, &mut uids, None).unwrap();
    assert_eq!(outcome.edits.len(), 20_000);
    let names: HashSet<&str> = rig.clips().iter().map(|clip| clip.name.as_str()).collect();
    assert_eq!(names.len(), 20_000);
    assert!(names.contains("walk") && names.contains("walk 2") && names.contains("walk 20000"));
    let own = |clip: &RigClip| [clip.uid, clip.layers[0].uid];
    assert_eq!(rig.clips().iter().flat_map(own).collect::<HashSet<Uid>>().len(), 40_000);
    // A layer and a clip that are gone leave their uids.
    let [clip, layer] = own(&rig.clips()[3]);
    assert!(rig.is_taken(clip) && rig.is_taken(layer));
    Operation::Clips(ClipOperation::DeleteLayer { clip, layer }).run(&mut rig, &mut uids, None).unwrap();
    assert!(rig.is_taken(clip) && !rig.is_taken(layer));
    Operation::Clips(ClipOperation::Delete(clip)).run(&mut rig, &mut uids, None).unwrap();
    assert!(!rig.is_taken(clip));
}

#[test]
fn shapes_of_faces_stay_within_their_memory() {
    let folder = tempfile::tempdir().unwrap();
    fs::copy(asset("models/head.obj"), folder.path().join("head.obj")).unwrap();
    let (ended, answer) = json_answer(folder.path(), &["face", "head.obj", "--arkit", "-o", "head.glb"]);
    assert_eq!(ended.code, Some(0), "{answer:.600}");
    let allowance = memory_allowance(fs::metadata(folder.path().join("head.obj")).unwrap().len());
    assert!(ended.memory <= allowance, "{} KiB of {}", ended.memory >> 10, allowance >> 10);
}
