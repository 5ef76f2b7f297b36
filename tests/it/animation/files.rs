//! Files of clips, and clips inside of projects.

use std::sync::Arc;

use bevy::math::{Quat, Vec3};
use rigsmith::{
    files::{FileKind, LoadError, RealDisk, StoreError, load_animation, stem, store_animation},
    rig::{
        Rig, RigEdit, Uid,
        animation::{
            ClipLayer, Ease, Key, LayerMode, Marker, NodeName, NodeNames, Property, RigClip, Track, orphaned_keys,
        },
        format::animation::{read_animation, write_animation, write_named},
        operations::{ClipOperation, KeyOperation, Operation},
        project::{Project, ProjectRig, read_project, write_project},
    },
};

use super::{BASE, CLIP, Random, TOP, animated, apply, biped, built, clip_on, target};

const FROZEN: &str = include_str!("../../frozen/format-1.anim.ron");

/// The clip of the frozen file.
fn frozen() -> RigClip {
    let mut clip =
        RigClip { frame_rate: 24.0, range: [-0.5, 2.0], looped: true, ..RigClip::new(CLIP, BASE, "wave \"1\"") };
    clip.markers = vec![Marker { time: 0.25, name: "up".into() }];
    let (hand, other) = (Uid(0x1001), Uid(0x1002));
    let cubic = |time: f32, x: f32| Key {
        ease: Ease::Cubic { arrive: [x, 0.0, 1e-7, 0.0], leave: [-x, 0.25, 0.0, 0.0] },
        ..Key::vector(time, Vec3::new(0.1, x, -3.0))
    };
    let tracks = &mut clip.layers[0].tracks;
    tracks.insert(
        target(hand, Property::Translation),
        Arc::new(Track { keys: vec![cubic(-0.5, 0.3), cubic(1.0, -0.2)] }),
    );
    let turns = vec![Key::rotation(0.0, Quat::IDENTITY), Key::rotation(1.5, Quat::from_rotation_y(0.5))];
    tracks.insert(target(hand, Property::Rotation), Arc::new(Track { keys: turns }));
    let switch = vec![Key { ease: Ease::Stepped, ..Key::number(0.0, 1.0) }, Key::number(1.0, 0.0)];
    tracks.insert(target(other, Property::Attribute("ik \n fk".into())), Arc::new(Track { keys: switch }));
    let grown = vec![Key::vector(0.0, Vec3::new(1.0, 1.1, 1.0))];
    clip.layers.push(ClipLayer {
        name: "add".into(),
        mode: LayerMode::Additive,
        weight: 0.5,
        mask: vec![other],
        muted: true,
        tracks: [(target(other, Property::Scale), Arc::new(Track { keys: grown }))].into(),
        ..ClipLayer::empty(TOP)
    });
    clip
}

fn names() -> NodeNames {
    let hand = NodeName { label: "hand_l".into(), role: "control".into() };
    NodeNames([(Uid(0x1001), hand), (Uid(0x1002), NodeName { label: "spine".into(), role: String::new() })].into())
}

#[test]
fn the_frozen_file_of_format_1_opens() {
    let read = read_animation(FROZEN.as_bytes()).unwrap();
    assert_eq!(read.clips, [frozen()]);
    assert_eq!((read.rig, read.rig_name.as_str(), &read.names, read.notes.len()), (Uid(0x99), "Biped", &names(), 0));
    assert_eq!(write_named(Uid(0x99), "Biped", &names(), &read.clips), FROZEN);
}

#[test]
fn what_is_written_comes_back_with_a_key_on_each_line() {
    let rig = animated();
    let built = built(&rig);
    let text = write_animation(&rig, Some(&built), rig.clips());
    let read = read_animation(text.as_bytes()).unwrap();
    assert_eq!(read.clips, rig.clips());
    assert_eq!(text.lines().filter(|line| line.trim_start().starts_with("(t: ")).count(), rig.clips()[0].key_count());
    assert_eq!(write_animation(&rig, Some(&built), &read.clips), text);
    let bound = read.onto(&rig, Some(&built));
    assert_eq!((bound.clips.as_slice(), bound.by_label.len(), bound.missing.len()), (rig.clips(), 0, 0));
}

#[test]
fn clips_find_the_nodes_of_another_rig_by_their_labels() {
    let read = read_animation(FROZEN.as_bytes()).unwrap();
    let mut rig = biped();
    let spine = rig.find_label("spine").unwrap();
    let built = built(&rig);
    let bound = read.onto(&rig, Some(&built));
    assert!(bound.by_label.contains(&(Uid(0x1002), spine)), "{:?}", bound.by_label);
    assert!(bound.clips[0].layers[1].tracks.contains_key(&target(spine, Property::Scale)));
    assert_eq!(bound.clips[0].layers[1].mask, [spine]);
    // No control has that label: its keys are kept aside, and offered once one has.
    let alone = read.onto(&rig, None);
    assert_eq!(alone.missing, [Uid(0x1001)]);
    apply(&mut rig, RigEdit::AddClip(Box::new(alone.clips[0].clone()), 0));
    let mut known = read.names.clone();
    let orphans = orphaned_keys(&rig, None, &known);
    assert_eq!((orphans.len(), orphans[0].node, orphans[0].tracks, orphans[0].keys), (1, Uid(0x1001), 2, 4));
    assert_eq!(orphans[0].offer, None);
    known.0.insert(Uid(0x1001), NodeName { label: "hand_l".into(), role: String::new() });
    let offer = orphaned_keys(&rig, None, &known)[0].offer.unwrap();
    assert_eq!(Some(offer), rig.find_label("hand_l"));
    let change = KeyOperation::Adopt { from: Uid(0x1001), to: offer };
    let adopt = Operation::Clips(ClipOperation::Keys { clip: CLIP, layer: BASE, change });
    adopt.run(&mut rig, &mut rigsmith::rig::UidSource::seeded(1), None).unwrap();
    assert!(orphaned_keys(&rig, None, &known).is_empty());
    assert_eq!(rig.clips()[0].layers[0].tracks[&target(offer, Property::Rotation)].keys.len(), 2);
}

#[test]
fn keys_of_a_joint_that_is_gone_wait_for_it() {
    let mut rig = biped();
    let tip = rig.walk().last().unwrap().data.uid;
    apply(&mut rig, RigEdit::AddClip(Box::new(clip_on(&[tip], &mut Random(2))), 0));
    let before = rig.clone();
    let back = rig.apply(&RigEdit::RemoveJoint(tip)).unwrap();
    assert_eq!(rig.clips(), before.clips());
    let names = NodeNames::of(&before, None);
    let orphans = orphaned_keys(&rig, None, &names);
    assert_eq!(orphans.len(), 2, "on two layers");
    assert_eq!((orphans[0].node, &orphans[0].name), (tip, &names.0[&tip]));
    apply(&mut rig, back);
    assert_eq!(rig, before);
    assert!(orphaned_keys(&rig, None, &names).is_empty());
}

#[test]
fn mistakes_are_named_with_their_places() {
    let cases = [
        ("v: (0.1, 0.3, -3.0)", "v: (0.1, 0.3)", "2 numbers"),
        ("v: (0.1, 0.3, -3.0)", "v: (0.1, inf, -3.0)", "not finite"),
        ("v: (0.0, 0.0, 0.0, 1.0)", "v: (0.0, 0.0, 0.5, 1.0)", "not of length 1"),
        ("t: 1.5,", "t: -1.5,", "do not rise"),
        ("weight: 0.5", "weight: 2.0", "from 0 to 1"),
        ("frame_rate: 24.0", "frame_rate: 0.0", "frame rate"),
        ("property: Rotation", "property: Translation", "two tracks"),
        ("ease: Stepped", "ease: Stopped", "Stopped"),
        ("muted: true", "mutd: true", "mutd"),
        ("format: 1", "format: 0", "never released"),
    ];
    for (from, to, told) in cases {
        assert!(FROZEN.contains(from), "{from}");
        let text = FROZEN.replacen(from, to, 1);
        let error = read_animation(text.as_bytes()).unwrap_err();
        assert!(error.to_string().contains(told), "{to}: {error}");
        let line = 1 + text[..FROZEN.find(from).unwrap()].matches('\n').count();
        let near = if told == "frame rate" { line..=line + 1 } else { line..=line };
        assert!(near.contains(&error.line), "{to}: {error}, not in line {line}");
    }
    for bytes in [&b""[..], b"(", b"\xff", b"(format: 1)", b"(format: 1, rig: \"zz\")"] {
        assert!(read_animation(bytes).is_err(), "{bytes:?}");
    }
}

#[test]
fn a_newer_format_opens_and_says_what_it_does_not_know() {
    let text = FROZEN
        .replacen("format: 1,", "format: 2, mood: \"glad\",", 1)
        .replacen("looped: true,", "looped: true, pivot: (1, 2),", 1)
        .replacen("property: Rotation,", "property: Rotation, color: 3,", 1);
    let read = read_animation(text.as_bytes()).unwrap();
    assert_eq!(read.clips, [frozen()]);
    let told = read.notes.join("\n");
    for part in ["animation has format 2", "`mood`", "`pivot`", "`color`"] {
        assert!(told.contains(part), "{part}: {told}");
    }
}

#[test]
fn projects_hold_clips() {
    let rig = animated();
    let project = Project { rigs: vec![ProjectRig { rig: rig.clone(), skins: Vec::new() }], ..Default::default() };
    let text = write_project(&project);
    assert!(text.starts_with("(\n    format: 3,"));
    let read = read_project(text.as_bytes()).unwrap();
    assert_eq!(read.project.rigs[0].rig.clips(), rig.clips());
    assert_eq!((read.notes.len(), write_project(&read.project)), (0, text.clone()));
    let plain = Project { rigs: vec![ProjectRig { rig: biped(), skins: Vec::new() }], ..Default::default() };
    assert!(write_project(&plain).starts_with("(\n    format: 1,"), "older versions read what they can hold");
    let wrong = text.replacen("range: (0.0, 2.0)", "range: (3.0, 2.0)", 1);
    let error = read_project(wrong.as_bytes()).unwrap_err();
    let line = 1 + wrong[..wrong.find("range: (3.0").unwrap()].matches('\n').count();
    assert_eq!(error.line, line, "{error}");
    let taken = text.replacen(&format!("uid: \"{CLIP}\""), &format!("uid: \"{}\"", rig.roots()[0]), 1);
    assert!(read_project(taken.as_bytes()).unwrap_err().to_string().contains("already used"));
}

#[test]
fn files_are_saved_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("Walk.anim.ron");
    let rig: Rig = animated();
    assert_eq!((FileKind::of(&path), stem(&path).as_str()), (Some(FileKind::Animation), "Walk"));
    store_animation(&RealDisk, &path, &rig, None, rig.clips()).unwrap();
    assert_eq!(load_animation(&RealDisk, &path).unwrap().clips, rig.clips());
    let other = folder.path().join("walk.ron");
    let refused = store_animation(&RealDisk, &other, &rig, None, rig.clips());
    assert!(matches!(refused, Err(StoreError::Kind { .. })));
    let bad = RigClip { frame_rate: f32::NAN, ..rig.clips()[0].clone() };
    assert!(matches!(store_animation(&RealDisk, &path, &rig, None, &[bad]), Err(StoreError::Unreadable { .. })));
    assert_eq!(load_animation(&RealDisk, &path).unwrap().clips, rig.clips());
    std::fs::write(&path, "(format: 1, rig: 3)").unwrap();
    assert!(matches!(load_animation(&RealDisk, &path), Err(LoadError::Source { .. })));
}
