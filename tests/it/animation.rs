//! Clips: edits with exact inverses, what animators do with keys, files, playback, and motion that survives changes.

mod app;
mod files;
pub mod keep;
mod kept_changes;
mod keys;
mod layers;
mod motion_capture;
mod random;
mod reduction;
mod root_motion;
mod sampler;
mod switch_range;

use std::sync::Arc;

use bevy::math::{EulerRot, Quat, Vec3};
use rigsmith::{
    modules,
    processor::Builder,
    rig::{
        BuiltRig, EditError, NodeType, Rig, RigEdit, Uid, UidSource,
        animation::{
            ClipFault, ClipLayer, Ease, Key, KeyFault, LayerMode, Marker, Property, RigClip, Track, TrackTarget,
        },
        operations::{ClipOperation, KeyOperation, Operation, OperationError},
        step::{Commit, Step, edits_from_empty, replay},
        update::{Take, clip_edits, update},
    },
    solve::program::{CompileOptions, RigProgram},
};

use crate::random::Random;

const CLIP: Uid = Uid(0xC11B_0001);
const BASE: Uid = Uid(0xC11B_0002);
const TOP: Uid = Uid(0xC11B_0003);

fn biped() -> Rig {
    crate::bench::shipped("biped")
}

fn built(rig: &Rig) -> BuiltRig {
    Builder::build(rig, &Arc::new(modules::all())).unwrap()
}

fn program(rig: &Rig) -> Arc<RigProgram> {
    Arc::new(RigProgram::compile(&built(rig), &CompileOptions::default()).unwrap())
}

fn apply(rig: &mut Rig, edit: RigEdit) {
    rig.apply(&edit).unwrap();
}

fn target(node: Uid, property: Property) -> TrackTarget {
    TrackTarget { node, property }
}

/// A number from -1 to 1.
fn share(random: &mut Random) -> f32 {
    random.below(2001) as f32 / 1000.0 - 1.0
}

fn turn(random: &mut Random, most: f32) -> Quat {
    Quat::from_euler(EulerRot::XYZ, share(random) * most, share(random) * most, share(random) * most)
}

/// A clip of two seconds with tracks of all kinds on these nodes, on two layers.
fn clip_on(nodes: &[Uid], random: &mut Random) -> RigClip {
    let mut clip = RigClip { range: [0.0, 2.0], looped: true, ..RigClip::new(CLIP, BASE, "walk") };
    clip.markers =
        vec![Marker { time: 0.5, name: "left foot".into() }, Marker { time: 1.5, name: "right \"foot\"".into() }];
    let top = ClipLayer { name: "breath".into(), mode: LayerMode::Additive, weight: 0.5, ..ClipLayer::empty(TOP) };
    clip.layers.push(top);
    for (number, node) in nodes.iter().enumerate() {
        let times: Vec<f32> = (0..=8).map(|frame| frame as f32 * 0.25).collect();
        let rotations = times.iter().map(|time| Key::rotation(*time, turn(random, 0.5)));
        let mut keys: Vec<Key> = rotations.collect();
        if number % 5 == 3 {
            keys[2].ease = Ease::Stepped;
        }
        clip.layers[0].tracks.insert(target(*node, Property::Rotation), Arc::new(Track { keys }));
        if number % 3 == 0 {
            let mut place = || Vec3::new(share(random), share(random), share(random)) * 0.03;
            let keys: Vec<Key> = times.iter().step_by(2).map(|time| Key::vector(*time, place())).collect();
            clip.layers[0].tracks.insert(target(*node, Property::Translation), Arc::new(Track { keys }));
        }
        if number % 4 == 0 {
            let keys = vec![Key::rotation(0.1, turn(random, 0.2)), Key::rotation(1.7, turn(random, 0.2))];
            clip.layers[1].tracks.insert(target(*node, Property::Rotation), Arc::new(Track { keys }));
        }
        if number % 7 == 2 {
            let tangents = |random: &mut Random| [share(random) * 0.1, share(random) * 0.1, 0.0, 0.0];
            let cubic = |time: f32, random: &mut Random| Key {
                ease: Ease::Cubic { arrive: tangents(random), leave: tangents(random) },
                ..Key::vector(time, Vec3::splat(share(random) * 0.02))
            };
            let keys = vec![cubic(0.0, random), cubic(0.7, random), cubic(2.0, random)];
            clip.layers[0].tracks.insert(target(*node, Property::Translation), Arc::new(Track { keys }));
        }
    }
    clip
}

/// Controls of a built rig.
fn controls(program: &RigProgram) -> Vec<Uid> {
    let is_control =
        |node: &&rigsmith::solve::program::ProgramNode| node.kind == NodeType::Control && node.is_posable();
    program.nodes().iter().filter(is_control).map(|node| node.uid).collect()
}

/// The biped with a clip on all of its controls and its arms in inverse kinematics for half of it.
fn animated() -> Rig {
    let mut rig = biped();
    let program = program(&rig);
    let mut clip = clip_on(&controls(&program), &mut Random(3));
    for attribute in program.attributes().iter().filter(|one| one.is_settable && one.name.contains("ik_fk")) {
        let node = program.nodes()[attribute.node].uid;
        let key = |time, value| Key { ease: Ease::Stepped, ..Key::number(time, value) };
        let track = Track { keys: vec![key(0.0, 0.0), key(1.0, 1.0)] };
        clip.layers[0].tracks.insert(target(node, Property::Attribute(attribute.name.to_string())), Arc::new(track));
    }
    assert!(clip.key_count() > 500 && clip.layers[1].tracks.len() > 5, "{}", clip.key_count());
    apply(&mut rig, RigEdit::AddClip(Box::new(clip), 0));
    rig
}

/// Applies an edit, checks that its inverse gives the same rig, and applies it again.
fn there_and_back(rig: &mut Rig, edit: RigEdit) {
    let before = rig.clone();
    let inverse = rig.apply(&edit).unwrap();
    let after = rig.clone();
    assert_ne!(before, after, "{edit:?} changes nothing");
    let again = rig.apply(&inverse).unwrap();
    assert_eq!(*rig, before, "{edit:?}");
    apply(rig, again);
    assert_eq!(*rig, after);
    // As in the journal.
    let text = ron::to_string(&[&edit, &inverse]).unwrap();
    let read: [RigEdit; 2] = ron::from_str(&text).unwrap();
    assert_eq!(read, [edit, inverse]);
}

#[test]
fn every_edit_of_clips_has_its_inverse() {
    let mut rig = biped();
    let node = rig.roots()[0];
    let rotation = target(node, Property::Rotation);
    let clip = clip_on(&[node], &mut Random(1));
    there_and_back(&mut rig, RigEdit::AddClip(Box::new(clip.clone()), 5));
    let other = RigClip::new(Uid(77), Uid(78), "other");
    there_and_back(&mut rig, RigEdit::AddClip(Box::new(other), 0));
    there_and_back(&mut rig, RigEdit::RemoveClip(Uid(77)));
    let mut about = clip.about();
    (about.name, about.frame_rate, about.looped) = ("run".into(), 24.0, false);
    there_and_back(&mut rig, RigEdit::SetClipAbout(CLIP, Box::new(about)));
    let mut layer = clip.layers[1].clone();
    layer.uid = Uid(79);
    there_and_back(&mut rig, RigEdit::AddLayer { clip: CLIP, layer: Box::new(layer), index: 1 });
    let mut about = clip.layers[1].about();
    (about.weight, about.mask, about.muted) = (0.25, vec![node], true);
    there_and_back(&mut rig, RigEdit::SetLayer { clip: CLIP, layer: TOP, about: Box::new(about) });
    there_and_back(&mut rig, RigEdit::RemoveLayer { clip: CLIP, layer: Uid(79) });
    let set = |removed: Vec<f32>, inserted| RigEdit::SetKeys {
        clip: CLIP,
        layer: BASE,
        target: rotation.clone(),
        removed,
        inserted,
    };
    let key = |time| Key::rotation(time, Quat::from_rotation_x(time));
    there_and_back(&mut rig, set(vec![0.0, 0.5], vec![key(-1.0), key(0.3), key(0.5), key(9.0)]));
    let all: Vec<f32> = rig.clips()[0].layers[0].tracks[&rotation].keys.iter().map(|key| key.time).collect();
    there_and_back(&mut rig, set(all, vec![]));
    assert!(!rig.clips()[0].layers[0].tracks.contains_key(&rotation), "a track without keys is none");
    there_and_back(&mut rig, set(vec![], vec![key(1.0)]));
    assert!([CLIP, BASE, TOP].iter().all(|uid| rig.is_taken(*uid)));
}

#[test]
fn what_no_clip_can_have_is_refused_and_changes_nothing() {
    let mut rig = biped();
    let node = rig.roots()[0];
    apply(&mut rig, RigEdit::AddClip(Box::new(clip_on(&[node], &mut Random(1))), 0));
    let before = rig.clone();
    let mut refuse = |edit: RigEdit, wanted: &dyn Fn(&EditError) -> bool| {
        let error = rig.apply(&edit).unwrap_err();
        assert!(wanted(&error), "{edit:?}: {error:?}");
        assert_eq!(rig, before);
    };
    let set = |property, removed, inserted| RigEdit::SetKeys {
        clip: CLIP,
        layer: BASE,
        target: target(node, property),
        removed,
        inserted,
    };
    let fault = |wanted: fn(&KeyFault) -> bool| move |error: &EditError| matches!(error, EditError::BadKeys { fault, .. } if wanted(fault));
    let key = |time| Key::rotation(time, Quat::IDENTITY);
    let long = Key { value: [1.0; 4], ..key(0.1) };
    let wide = Key { value: [1.0; 4], ..Key::number(0.1, 0.0) };
    let cubic = Key { ease: Ease::Cubic { arrive: [f32::INFINITY; 4], leave: [0.0; 4] }, ..key(0.1) };
    let rotation = || Property::Rotation;
    refuse(set(rotation(), vec![], vec![key(0.2), key(0.1)]), &fault(|f| matches!(f, KeyFault::Order(_))));
    refuse(set(rotation(), vec![], vec![key(0.1), key(0.1)]), &fault(|f| matches!(f, KeyFault::Order(_))));
    refuse(set(rotation(), vec![0.25, 0.0], vec![]), &fault(|f| matches!(f, KeyFault::Order(_))));
    refuse(set(rotation(), vec![], vec![key(f32::NAN)]), &fault(|f| matches!(f, KeyFault::NotFinite(_))));
    refuse(set(rotation(), vec![], vec![cubic]), &fault(|f| matches!(f, KeyFault::NotFinite(_))));
    refuse(set(rotation(), vec![], vec![long]), &fault(|f| matches!(f, KeyFault::NotARotation(_))));
    refuse(set(Property::Attribute("a".into()), vec![], vec![wide]), &fault(|f| matches!(f, KeyFault::Width(_))));
    refuse(set(rotation(), vec![0.1], vec![]), &fault(|f| matches!(f, KeyFault::Absent(_))));
    refuse(set(rotation(), vec![f32::NAN], vec![]), &fault(|f| matches!(f, KeyFault::Absent(_))));
    refuse(set(rotation(), vec![], vec![key(0.25)]), &fault(|f| matches!(f, KeyFault::Taken(_))));
    let clip = || RigClip::new(Uid(5), Uid(6), "x");
    let bad = |fault| move |error: &EditError| *error == EditError::BadClip(Uid(5), fault);
    let add = |clip| RigEdit::AddClip(Box::new(clip), 0);
    refuse(add(RigClip { frame_rate: 0.0, ..clip() }), &bad(ClipFault::FrameRate));
    refuse(add(RigClip { range: [1.0, 0.0], ..clip() }), &bad(ClipFault::Range));
    let markers = [1.0, 0.0].map(|time| Marker { time, name: String::new() }).to_vec();
    refuse(add(RigClip { markers, ..clip() }), &bad(ClipFault::Markers));
    let layers = vec![ClipLayer { weight: 1.5, ..ClipLayer::empty(Uid(6)) }];
    refuse(add(RigClip { layers, ..clip() }), &bad(ClipFault::Weight));
    refuse(add(RigClip::new(Uid(5), node, "x")), &|error| *error == EditError::UidInUse(node));
    refuse(add(RigClip::new(Uid(5), Uid(5), "x")), &|error| *error == EditError::UidInUse(Uid(5)));
    refuse(RigEdit::RemoveClip(Uid(5)), &|error| *error == EditError::NoClip(Uid(5)));
    let remove = RigEdit::RemoveLayer { clip: CLIP, layer: Uid(5) };
    refuse(remove, &|error| *error == EditError::NoLayer(CLIP, Uid(5)));
}

#[test]
fn clips_come_back_from_edits_and_from_steps() {
    let rig = animated();
    let mut again = Rig::new(rig.uid(), "");
    for edit in edits_from_empty(&rig) {
        again.apply(&edit).unwrap();
    }
    assert_eq!(again.clips(), rig.clips());
    let mut other = rig.clone();
    let mut uids = UidSource::seeded(9);
    let delete =
        KeyOperation::Delete([(target(controls(&program(&rig))[0], Property::Rotation), vec![0.5, 0.75])].into());
    let operation = Operation::Clips(ClipOperation::Keys { clip: CLIP, layer: BASE, change: delete });
    let outcome = operation.run(&mut other, &mut uids, None).unwrap();
    assert_eq!(other.clips()[0].key_count() + 2, rig.clips()[0].key_count());
    let step = Step {
        name: operation.name().into(),
        forward: outcome.edits,
        backward: outcome.inverses,
        before: vec![],
        after: vec![],
    };
    let step = Arc::new(step);
    let done = replay(rig.clone(), &[Commit::Done(step.clone())], 0);
    assert_eq!((done.refused, &done.rig), (None, &other));
    let undone = replay(rig.clone(), &[Commit::Done(step.clone()), Commit::Undone(step)], 0);
    assert_eq!(undone.rig, rig);
    // The edits between two rigs are those alone that differ.
    let edits = clip_edits(&rig, &other).unwrap();
    assert!(
        matches!(&edits[..], [RigEdit::SetKeys { removed, inserted, .. }] if removed.len() == 2 && inserted.is_empty())
    );
    for (from, to) in [(&rig, &other), (&other, &rig), (&rig, &biped()), (&biped(), &rig)] {
        let mut changed = from.clone();
        for edit in clip_edits(from, to).unwrap() {
            changed.apply(&edit).unwrap();
        }
        assert_eq!(changed.clips(), to.clips());
    }
}

#[test]
fn updates_leave_clips_alone() {
    let (base, now) = (biped(), animated());
    let mut file = base.clone();
    let hand = file.find_label("hand_l").unwrap();
    apply(&mut file, RigEdit::SetLabel(hand, Some("fist_l".into())));
    let below: Vec<Uid> = file.hierarchy(file.find_label("index_02_l").unwrap()).map(|joint| joint.data.uid).collect();
    for joint in below.iter().rev() {
        apply(&mut file, RigEdit::RemoveJoint(*joint));
    }
    let updated = update(Some(&base), &now, &file, Take::Theirs);
    assert_eq!(updated.rig.clips(), now.clips());
    assert!(updated.rig.joint(below[0]).is_none());
}

#[test]
fn clips_have_names_of_their_own() {
    let mut rig = biped();
    let mut uids = UidSource::seeded(4);
    let mut run = |rig: &mut Rig, operation| Operation::Clips(operation).run(rig, &mut uids, None);
    let create = |name: &str| ClipOperation::Create { name: name.into(), frame_rate: 24.0, range: [0.0, 3.0] };
    run(&mut rig, create(" walk ")).unwrap();
    assert_eq!(run(&mut rig, create("walk")), Err(OperationError::ClipName("walk".into())));
    assert_eq!(run(&mut rig, create(" ")), Err(OperationError::NoClipName));
    let clip = rig.clips()[0].clone();
    assert_eq!((clip.name.as_str(), clip.frame_rate, clip.layers.len()), ("walk", 24.0, 1));
    run(&mut rig, ClipOperation::Add(Box::new(clip.clone()))).unwrap();
    assert_eq!(rig.clips()[1].name, "walk 2");
    assert_ne!((rig.clips()[1].uid, rig.clips()[1].layers[0].uid), (clip.uid, clip.layers[0].uid));
    assert_eq!(
        run(&mut rig, ClipOperation::Rename(clip.uid, "walk 2".into())),
        Err(OperationError::ClipName("walk 2".into()))
    );
    run(&mut rig, ClipOperation::Rename(clip.uid, "stroll".into())).unwrap();
    run(&mut rig, ClipOperation::AddLayer { clip: clip.uid, name: "head".into(), mode: LayerMode::Additive }).unwrap();
    let top = rig.clips()[0].layers[1].uid;
    run(&mut rig, ClipOperation::MoveLayer { clip: clip.uid, layer: top, index: 0 }).unwrap();
    assert_eq!(rig.clips()[0].layers[0].name, "head");
    run(&mut rig, ClipOperation::DeleteLayer { clip: clip.uid, layer: top }).unwrap();
    run(&mut rig, ClipOperation::Delete(clip.uid)).unwrap();
    assert_eq!(rig.clips().iter().map(|clip| clip.name.as_str()).collect::<Vec<_>>(), ["walk 2"]);
}
