//! Random changes of an animated biped that keep its motion, in one history. Keys of nodes that live stay at their times, keys of
//! nodes that are gone stay as they were and are listed, joints that are not listed move as before, and undo brings back the
//! first bytes.

use std::{
    collections::{BTreeSet, HashSet},
    sync::Arc,
};

use bevy::math::{EulerRot, Quat};
use rigsmith::{
    modules,
    plugins::{document::Selection, history::RigHistory},
    processor::{Builder, ClipReport, Modules, keep_clips, keep_poses},
    rig::{
        BuiltRig, GroupData, MovedNodes, NodeType, PoseOffset, Rig, RigEdit, StoredPose, Uid, UidSource,
        animation::{Key, NodeNames, Property, RigClip, TrackTarget},
        operations::{ClipOperation, KeyOperation, Operation},
        update::{clip_edits, edits_between, pose_edits},
    },
    solve::program::{CompileOptions, RigProgram},
};

use super::{
    BASE, CLIP, Random, apply, built, controls,
    keep::{FLIPPED, NEAR, gentle, joints_off, state},
    program,
    random::{TemplateVersions, bytes},
    turn,
};
use crate::keep_pose::{flip, reparent};

/// Number of kinds of changes; numbers after it mean undo, redo, and keys.
const KINDS: usize = 6;
const UNDO: usize = KINDS;
const REDO: usize = KINDS + 1;

/// The biped with a clip whose frames lie at its keys and halfway between them, with a pose and a stored pose.
fn moving() -> Rig {
    let mut rig = gentle();
    let mut about = rig.clip(CLIP).unwrap().about();
    about.frame_rate = 4.0;
    apply(&mut rig, RigEdit::SetClipAbout(CLIP, Box::new(about)));
    let mut random = Random(7);
    let nodes = controls(&program(&rig));
    let mut pose = StoredPose { uid: Uid(0xbeef_0000), name: "stored".into(), ..StoredPose::default() };
    for _ in 0..6 {
        let (one, other) = (random.pick(&nodes), random.pick(&nodes));
        apply(&mut rig, RigEdit::SetOffset(one, Some(PoseOffset::from_rotation(turn(&mut random, 0.2)))));
        pose.offsets.insert(other, PoseOffset::from_rotation(turn(&mut random, 0.2)));
    }
    apply(&mut rig, RigEdit::AddStoredPose(Box::new(pose), 0));
    rig
}

/// Joints of the biped that changes turn and move.
struct ChangedJoints {
    flipped: Vec<Uid>,
    clavicle: Uid,
    parents: Vec<Uid>,
}

impl ChangedJoints {
    fn of(rig: &Rig) -> Self {
        let joint = |label: &str| rig.find_label(label).unwrap();
        Self {
            flipped: FLIPPED.map(joint).to_vec(),
            clavicle: joint("clavicle_l"),
            parents: ["spine_1", "chest"].map(joint).to_vec(),
        }
    }
}

/// The rig after a change of a kind, with poses and clips as they are.
fn changed(
    rig: &Rig,
    kind: usize,
    random: &mut Random,
    joints: &ChangedJoints,
    versions: &mut TemplateVersions,
) -> Rig {
    let mut after = rig.clone();
    let all: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
    let one = random.pick(&all);
    match kind {
        0 => {
            let label = rig.joint(random.pick(&joints.flipped)).and_then(|joint| joint.data.label.as_deref()).unwrap();
            flip(&mut after, label, Quat::from_euler(EulerRot::XYZ, 0.0, std::f32::consts::PI, 0.0));
        }
        1 => {
            let parent = rig.joint(joints.clavicle).unwrap().parent;
            let others: Vec<Uid> = joints.parents.iter().copied().filter(|uid| Some(*uid) != parent).collect();
            reparent(&mut after, joints.clavicle, random.pick(&others));
        }
        2 => return versions.updated(rig, random),
        3 => {
            let label = Some(format!("joint {}", random.next()));
            apply(&mut after, RigEdit::SetLabel(one, label));
        }
        4 => {
            let group = GroupData { uid: Uid(random.next()), name: "g".into(), ..rig.groups()[0].clone() };
            apply(&mut after, RigEdit::AddLocalGroup(group.clone(), 0));
            apply(&mut after, RigEdit::SetGroup(one, Some(group.uid)));
        }
        _ => {
            if let Some(mut tag) = rig.joint(one).and_then(|joint| joint.data.tags.first()).cloned() {
                tag.enabled = !tag.enabled;
                apply(&mut after, RigEdit::SetTag(one, Box::new(tag)));
            }
        }
    }
    after
}

/// Work of the changes.
#[derive(Debug, Default)]
struct Counts {
    kept: usize,
    rewritten: usize,
    joints: usize,
    listed: usize,
    set_aside: usize,
}

/// Keeps poses and clips through a change, and checks what that promises.
fn keep(rig: &Rig, after: &mut Rig, modules: &Arc<Modules>, counts: &mut Counts, step: usize) {
    let plain = after.clone();
    keep_poses(rig, after, modules).unwrap();
    let report = keep_clips(rig, after, modules).unwrap();
    let after: &Rig = after;
    let (was, is) = (built(rig), built(after));
    let moved = MovedNodes::between((rig, &was), (after, &is));
    let clips = [rig.clip(CLIP).unwrap(), after.clip(CLIP).unwrap()];
    let names = [NodeNames::of(rig, Some(&was)), NodeNames::of(after, Some(&is))];
    check_keys(clips, &names, &moved, &report, step);
    if moved.is_empty() {
        counts.joints += check_joints([&was, &is], clips, &report, step);
    }
    counts.kept += 1;
    counts.rewritten += usize::from(after.clips() != plain.clips());
    counts.listed += report.notes.len();
    counts.set_aside += report.set_aside.len();
}

/// Checks that nodes that live have all keys at their times, and others have them as they were and are listed.
fn check_keys(
    [before, after]: [&RigClip; 2],
    [was, is]: &[NodeNames; 2],
    moved: &MovedNodes,
    report: &ClipReport,
    step: usize,
) {
    let listed: BTreeSet<Uid> = report.set_aside.iter().map(|aside| aside.keys.node).collect();
    assert_eq!(before.layers.len(), after.layers.len(), "step {step}");
    for (from, to) in before.layers.iter().zip(&after.layers) {
        for (target, track) in &from.tracks {
            let now = to.tracks.get(target);
            if let Some(next) = moved.get(target.node) {
                let next = to.tracks.get(&TrackTarget { node: next, ..target.clone() });
                let is_carried = next.into_iter().chain(now).any(|found| found == track);
                assert!(is_carried, "step {step}: {target:?} has not moved along");
            } else if is.0.contains_key(&target.node) {
                let now = now.unwrap_or_else(|| panic!("step {step}: {target:?} has no keys"));
                for key in &track.keys {
                    let is_there = now.keys.iter().any(|now| now.time == key.time);
                    assert!(is_there, "step {step}: {target:?} at {} s", key.time);
                }
            } else {
                assert_eq!(now, Some(track), "step {step}: {target:?}");
                let is_told = listed.contains(&target.node) || !was.0.contains_key(&target.node);
                assert!(is_told, "step {step}: {target:?} is set aside and not listed");
            }
        }
    }
}

/// Checks that joints which are not listed move as before at the keys, and returns their number. A skeleton of other proportions
/// is not checked: its solvers turn joints that rest where they did, too, as its author wants.
fn check_joints(versions: [&BuiltRig; 2], [was, is]: [&RigClip; 2], report: &ClipReport, step: usize) -> usize {
    let [from, to] = versions.map(|built| Arc::new(RigProgram::compile(built, &CompileOptions::default()).unwrap()));
    let listed: HashSet<Uid> = report.notes.iter().map(|note| note.deviation.joint).collect();
    let rests = [&from, &to].map(|program| state(program, None, 0.0));
    let is_still = |joint: Uid| {
        let [before, after] = rests.each_ref().map(|rest| rest.global(joint).map(|at| at.translation));
        before.zip(after).is_some_and(|(before, after)| before.distance(after) < 1e-5)
    };
    if from
        .nodes()
        .iter()
        .any(|node| node.kind == NodeType::Joint && to.node(node.uid).is_some() && !is_still(node.uid))
    {
        return 0;
    }
    let mut compared = 0;
    for (joint, (distance, angle)) in joints_off((&from, was), (&to, is), &was.key_times()) {
        if !listed.contains(&joint) {
            assert!(
                distance <= NEAR.0 * 1.05 && angle <= NEAR.1 * 1.05,
                "step {step}: {joint} is off by {distance} m and {angle}°, and not listed"
            );
            compared += 1;
        }
    }
    compared
}

/// A key of the clip at another time or with another value.
fn keyed(rig: &Rig, random: &mut Random) -> Operation {
    let tracks = &rig.clip(CLIP).unwrap().layers[0].tracks;
    let targets: Vec<TrackTarget> =
        tracks.keys().filter(|target| target.property == Property::Rotation).cloned().collect();
    let key = Key::rotation(random.below(9) as f32 * 0.25, turn(random, 0.25));
    let change = KeyOperation::Set(vec![(random.pick(&targets), vec![key])]);
    Operation::Clips(ClipOperation::Keys { clip: CLIP, layer: BASE, change })
}

#[test]
fn random_changes_keep_the_motion_and_undo_brings_back_the_first_bytes() {
    let steps: usize = std::env::var("RIGSMITH_STEPS").ok().and_then(|count| count.parse().ok()).unwrap_or(32);
    let modules = Arc::new(modules::all());
    let mut rig = moving();
    let first = bytes(&rig);
    let (mut history, mut selection, mut uids) = (RigHistory::default(), Selection::default(), UidSource::seeded(5));
    let (mut random, mut versions) = (Random(11), TemplateVersions::new());
    let (joints, mut counts) = (ChangedJoints::of(&rig), Counts::default());
    for step in 0..steps {
        // Each kind happens once, and then by chance.
        let kind = if step < KINDS { step } else { random.below(KINDS + 4) };
        let operation = match kind {
            0..KINDS => {
                let mut after = changed(&rig, kind, &mut random, &joints, &mut versions);
                if after == rig || Builder::build(&after, &modules).is_err() {
                    continue;
                }
                keep(&rig, &mut after, &modules, &mut counts, step);
                let mut edits = edits_between(&rig, &after).unwrap();
                edits.extend(pose_edits(&rig, &after));
                edits.extend(clip_edits(&rig, &after).unwrap());
                history
                    .edit(&mut rig, &mut selection, &mut uids, None, &Operation::Named { name: "change", edits })
                    .unwrap();
                assert_eq!(rig.clips(), after.clips(), "step {step}");
                assert_eq!((rig.pose(), rig.stored_poses()), (after.pose(), after.stored_poses()), "step {step}");
                continue;
            }
            UNDO => {
                history.undo(&mut rig, &mut selection).transpose().unwrap();
                continue;
            }
            REDO => {
                history.redo(&mut rig, &mut selection).transpose().unwrap();
                continue;
            }
            _ => keyed(&rig, &mut random),
        };
        history.edit(&mut rig, &mut selection, &mut uids, None, &operation).unwrap();
    }
    println!("{counts:?}");
    assert!(counts.kept >= 4 && counts.rewritten > 0 && counts.joints > 100, "{counts:?}");
    while history.steps().1 > 0 {
        history.undo(&mut rig, &mut selection).unwrap().unwrap();
    }
    assert_eq!(bytes(&rig), first);
}
