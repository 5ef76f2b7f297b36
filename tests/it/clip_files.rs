//! Clips of mesh files as motion and as keys, and clips as files and back: keys survive, and the second round is the
//! same bytes.

use std::sync::Arc;

use bevy::math::{EulerRot, Quat, Vec3};
use rigsmith::{
    mesh::{
        gltf::{GltfWriteSettings, read_gltf, write_glb},
        model::{Channel, ChannelTarget, Clip, Interpolation, Model, Node, Trs},
    },
    modules,
    processor::Builder,
    rig::{
        Rig, Uid, UidSource,
        animation::{
            Ease, Key, LayerMode, Marker, Property, RigClip, Track, TrackTarget,
            clip_extras::{ClipExtras, joined_extras},
            file_clip::{motion_of, own_joints, rig_clips},
            humanoid::by_names,
            joint_map::motion_joints,
        },
        character::import_skeleton,
        operations::KeyTolerance,
    },
    solve::{
        bake_clip::{BakeSettings, BakedNode, bake_clip},
        program::{CompileOptions, RigProgram},
    },
};

use crate::random::Random;

fn share(random: &mut Random) -> f32 {
    random.below(2001) as f32 / 1000.0 - 1.0
}

fn turn(random: &mut Random) -> Quat {
    Quat::from_euler(EulerRot::XYZ, share(random), share(random), share(random))
}

/// A chain of joints that are turned and scaled at rest.
fn chain(random: &mut Random) -> Model {
    let node = |number: usize| Node {
        name: format!("joint {number}"),
        parent: number.checked_sub(1),
        rest: Trs {
            translation: Vec3::new(share(random), 1.0, share(random)),
            rotation: turn(random),
            scale: if number == 2 { Vec3::new(0.5, 2.0, 1.25) } else { Vec3::ONE },
        },
        joint: true,
        extras: None,
    };
    Model { name: "chain".to_owned(), nodes: (0..4).map(node).collect(), ..Model::default() }
}

fn rig_of(model: &Model) -> (Rig, Vec<Uid>) {
    let mut uids = UidSource::seeded(7);
    let mut rig = Rig::new(uids.next_uid(), "chain");
    let skeleton = import_skeleton(model, &mut uids);
    skeleton.edits.iter().for_each(|edit| {
        rig.apply(edit).unwrap();
    });
    (rig, skeleton.nodes)
}

/// Keys of every kind on the joints.
fn clip_on(joints: &[Uid], random: &mut Random) -> RigClip {
    let mut clip = RigClip { range: [0.0, 2.0], ..RigClip::new(Uid(0xC1), Uid(0xC2), "wave") };
    let mut add = |joint: usize, property: Property, kind: usize, random: &mut Random| {
        let key = |number: usize| {
            let value = match property {
                Property::Rotation => turn(random).to_array(),
                Property::Scale => [1.0 + 0.3 * share(random), 1.0 + 0.3 * share(random), 1.1, 0.0],
                _ => [share(random), share(random), share(random), 0.0],
            };
            let mut tangent = || std::array::from_fn(|axis| if axis < property.width() { share(random) } else { 0.0 });
            let ease = match kind {
                0 => Ease::Linear,
                1 => Ease::Stepped,
                _ => Ease::Cubic { arrive: tangent(), leave: tangent() },
            };
            Key { time: number as f32 * 0.4, value, ease }
        };
        let keys = (0..6).map(key).collect();
        clip.layers[0]
            .tracks
            .insert(TrackTarget { node: joints[joint], property: property.clone() }, Arc::new(Track { keys }));
    };
    add(0, Property::Translation, 0, random);
    add(0, Property::Rotation, 2, random);
    add(1, Property::Rotation, 0, random);
    add(2, Property::Translation, 2, random);
    add(2, Property::Scale, 2, random);
    add(2, Property::Rotation, 1, random);
    add(3, Property::Translation, 1, random);
    clip
}

fn written(rig: &Rig, model: &Model, joints: &[Uid], clip: &RigClip) -> Vec<u8> {
    let built = Builder::build(rig, &Arc::new(modules::all())).unwrap();
    let program = Arc::new(RigProgram::compile(&built, &CompileOptions::default()).unwrap());
    let node = |(uid, node): (&Uid, &Node)| BakedNode { uid: *uid, parent: node.parent, rest: node.rest };
    let nodes: Vec<BakedNode> = joints.iter().zip(&model.nodes).map(node).collect();
    let settings = BakeSettings::new(clip.frame_rate, KeyTolerance::default());
    let baked = bake_clip(&program, clip, &nodes, &settings).unwrap();
    let settings = GltfWriteSettings { all_joints: true, ..GltfWriteSettings::default() };
    write_glb(&Model { clips: vec![baked], ..model.clone() }, &settings).unwrap()
}

fn read(bytes: &[u8]) -> Model {
    read_gltf(bytes, "chain.glb", &mut |_| Ok(Vec::new())).unwrap()
}

#[test]
fn keys_go_out_and_in_again() {
    for seed in 1..20 {
        let mut random = Random(seed);
        let model = chain(&mut random);
        let (rig, joints) = rig_of(&model);
        let clip = clip_on(&joints, &mut random);
        let first = read(&written(&rig, &model, &joints, &clip));
        let found = own_joints(&first, &rig).unwrap();
        assert_eq!(found, joints.iter().copied().map(Some).collect::<Vec<_>>());
        let [once] = &rig_clips(&rig, &first, &found)[..] else { panic!("not one clip") };
        assert_eq!((once.name.as_str(), once.range), ("wave", [0.0, 2.0]));
        assert_eq!(once.layers[0].tracks.len(), clip.layers[0].tracks.len());
        for (target, track) in &clip.layers[0].tracks {
            let again = &once.layers[0].tracks[target];
            assert_eq!(again.keys.len(), track.keys.len(), "{target:?}");
            let near = |a: &[f32; 4], b: &[f32; 4]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4);
            let is_alike = |a: &[f32; 4], b: &[f32; 4]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-3);
            for (was, is) in track.keys.iter().zip(&again.keys) {
                assert!(was.time == is.time && near(&was.value, &is.value), "{target:?}: {was:?} {is:?}");
                match (was.ease, is.ease) {
                    (Ease::Cubic { arrive, leave }, Ease::Cubic { arrive: arrives, leave: leaves }) => {
                        assert!(is_alike(&arrive, &arrives) && is_alike(&leave, &leaves), "{target:?}: {was:?} {is:?}");
                    }
                    (was, is) => assert_eq!(was, is),
                }
            }
        }
        let bytes = written(&rig, &model, &joints, once);
        let [twice] = &rig_clips(&rig, &read(&bytes), &found)[..] else { panic!("not one clip") };
        assert_eq!(once, twice);
        assert_eq!(bytes, written(&rig, &model, &joints, twice));
    }
}

/// Markers, the loop and a rate that no key tells survive a file, and the second round is the same bytes.
#[test]
fn what_channels_cannot_hold_goes_out_and_in_again() {
    let mut random = Random(11);
    let model = chain(&mut random);
    let (rig, joints) = rig_of(&model);
    let mut clip = RigClip { range: [0.5, 2.5], frame_rate: 29.97, looped: true, ..clip_on(&joints, &mut random) };
    for layer in &mut clip.layers {
        for track in layer.tracks.values_mut() {
            Arc::make_mut(track).keys.iter_mut().for_each(|key| key.time += 0.5);
        }
    }
    clip.markers = [(0.5, "start"), (1.1, "left \"foot\""), (2.5, "end"), (2.5, "end")]
        .map(|(time, name)| Marker { time, name: name.to_owned() })
        .to_vec();
    let file = read(&written(&rig, &model, &joints, &clip));
    let found = own_joints(&file, &rig).unwrap();
    let [once] = &rig_clips(&rig, &file, &found)[..] else { panic!("not one clip") };
    assert_eq!((once.looped, once.frame_rate, once.range), (true, 29.97, [0.0, 2.0]));
    let markers: Vec<(f32, &str)> = once.markers.iter().map(|marker| (marker.time, &*marker.name)).collect();
    assert_eq!(markers, [(0.0, "start"), (1.1 - 0.5, "left \"foot\""), (2.0, "end"), (2.0, "end")]);
    let bytes = written(&rig, &model, &joints, once);
    let [twice] = &rig_clips(&rig, &read(&bytes), &found)[..] else { panic!("not one clip") };
    assert_eq!((once, &bytes), (twice, &written(&rig, &model, &joints, twice)));
    // A motion of another skeleton has them, too.
    let motion = motion_of(&file, &file.clips[0]);
    assert!(motion.looped && (motion.frame_time * 29.97 - 1.0).abs() < 1e-5);
    assert_eq!(motion.markers, once.markers);

    // A clip without any says so.
    let plain = RigClip { looped: false, markers: Vec::new(), ..once.clone() };
    let file = read(&written(&rig, &model, &joints, &plain));
    assert_eq!(ClipExtras::read(file.clips[0].extras.as_ref()), ClipExtras::of(&plain, 29.97));
}

/// A few keys far apart are not sampled into more memory than a file of this size may take; keys of each frame are.
#[test]
fn frames_between_keys_that_lie_far_apart_are_bounded() {
    let nodes = 2_000;
    let node = |number: usize| Node {
        name: format!("joint {number}"),
        parent: None,
        rest: Trs::default(),
        joint: true,
        extras: None,
    };
    let clip = |times: Vec<f32>, nodes: usize| {
        let channel = |node: usize| Channel {
            target: ChannelTarget::Rotation(node),
            interpolation: Interpolation::Linear,
            times: times.clone(),
            values: times.iter().flat_map(|_| [0.0, 0.0, 0.0, 1.0]).collect(),
        };
        Clip { name: "long".to_owned(), channels: (0..nodes).map(channel).collect(), extras: None }
    };
    let model = Model { nodes: (0..nodes).map(node).collect(), ..Model::default() };
    let sparse = motion_of(&model, &clip(vec![0.0, 1_000.0], nodes));
    assert!(sparse.values.len() <= 8 << 20 && sparse.frames() >= 1_000, "{} frames", sparse.frames());
    assert!(sparse.notes.iter().any(|note| note.contains("\"long\" has more than")), "{:?}", sparse.notes);
    let dense = motion_of(&model, &clip((0..3_000).map(|frame| frame as f32 / 30.0).collect(), 4));
    assert_eq!((dense.frames(), dense.notes.len()), (3_000, 0), "{:?}", dense.notes);
}

#[test]
fn damaged_extras_are_passed_over_and_others_stay() {
    let read = |text: &str| ClipExtras::read(Some(&serde_json::from_str(text).unwrap()));
    for text in ["null", "[]", "7", "{}", r#"{"rigsmith": null}"#, r#"{"rigsmith": {"markers": 3, "frame_rate": "x"}}"#]
    {
        assert_eq!(read(text), ClipExtras::default(), "{text}");
    }
    let damaged = r#"{"rigsmith": {"frame_rate": -1, "looped": 1, "markers": [
        {"time": 2, "name": "b"}, {"time": 1e300, "name": "far"}, {"name": "none"}, 5, {"time": 1, "name": "a"}]}}"#;
    let found = read(damaged);
    let names: Vec<&str> = found.markers.iter().map(|marker| &*marker.name).collect();
    assert_eq!((found.frame_rate, found.looped, names), (None, false, vec!["a", "b"]));

    let own = ClipExtras { looped: true, ..ClipExtras::default() }.written();
    let of_file = serde_json::json!({ "other": [1, 2], "rigsmith": { "looped": false } });
    let all = joined_extras(Some(own.clone()), Some(of_file)).unwrap();
    assert_eq!((all["other"].clone(), all["rigsmith"]["looped"].clone()), (serde_json::json!([1, 2]), true.into()));
    assert_eq!(joined_extras(Some(own.clone()), None), Some(own));
}

#[test]
fn a_clip_keeps_its_length_where_nothing_moves() {
    let mut random = Random(3);
    let model = chain(&mut random);
    let (rig, joints) = rig_of(&model);
    let mut clip = RigClip { range: [1.0, 4.0], ..RigClip::new(Uid(0xC1), Uid(0xC2), "stand") };
    let held = Key {
        ease: Ease::Cubic { arrive: [1.0, 0.0, 0.0, 0.0], leave: [2.0, 0.0, 0.0, 0.0] },
        ..Key::vector(2.0, Vec3::X)
    };
    let track = Arc::new(Track { keys: vec![held] });
    clip.layers[0].tracks.insert(TrackTarget { node: joints[1], property: Property::Translation }, track);
    let file = read(&written(&rig, &model, &joints, &clip));
    let [channel] = &file.clips[0].channels[..] else { panic!("{:?}", file.clips[0]) };
    assert_eq!(channel.times, [0.0, 1.0, 3.0]);
    let found = own_joints(&file, &rig).unwrap();
    let again = &rig_clips(&rig, &file, &found)[0];
    let target = TrackTarget { node: joints[1], property: Property::Translation };
    for time in [0.0, 0.5, 1.0, 2.0, 3.0] {
        let value = again.layers[0].tracks[&target].sample(&target.property, time).unwrap();
        assert!((value[0] - 1.0).abs() < 1e-4 && value[1].abs() < 1e-4, "{time}: {value:?}");
    }
}

/// Keys that a channel cannot hold, and layers, are baked.
#[test]
fn layers_are_baked() {
    let mut random = Random(5);
    let model = chain(&mut random);
    let (rig, joints) = rig_of(&model);
    let mut clip = clip_on(&joints, &mut random);
    let mut top = clip.layers[0].clone();
    (top.uid, top.mode, top.weight) = (Uid(0xC3), LayerMode::Additive, 0.5);
    top.tracks.retain(|target, _| target.node == joints[1]);
    clip.layers.push(top);
    let file = read(&written(&rig, &model, &joints, &clip));
    let of = |node: usize| {
        let is_rotation = |channel: &&Channel| channel.target == ChannelTarget::Rotation(node);
        file.clips[0].channels.iter().find(is_rotation).unwrap()
    };
    assert_eq!((of(0).times.len(), of(0).interpolation), (6, Interpolation::CubicSpline));
    assert_ne!(
        of(1).values[4..8],
        clip.layers[0].tracks[&TrackTarget { node: joints[1], property: Property::Rotation }].keys[1].value
    );
    let motion = motion_of(&file, &file.clips[0]);
    for frame in [0, 7, 31, 60] {
        let time = frame as f32 / 30.0;
        let offset = clip.sample(time).offsets[&joints[1]].rotation;
        let wanted = model.nodes[1].rest.rotation * offset;
        let local = motion.locals((time / motion.frame_time).round() as usize)[1].rotation;
        assert!(wanted.dot(local).abs() > 1.0 - 1e-6, "frame {frame}");
    }
}

#[test]
fn motion_of_a_model_has_all_interpolations() {
    let mut random = Random(9);
    let mut model = chain(&mut random);
    let (half, one) = (Quat::from_rotation_x(0.5), Quat::from_rotation_x(1.0));
    let channel = |target, interpolation, times: &[f32], values: Vec<f32>| Channel {
        target,
        interpolation,
        times: times.to_vec(),
        values,
    };
    let line = [Quat::IDENTITY.to_array(), one.to_array()].concat();
    let steps = vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
    // Tangents of zero, then values, then tangents of zero.
    let spline = [[0.0; 3], [1.0; 3], [0.0; 3], [0.0; 3], [3.0; 3], [0.0; 3]].concat();
    model.clips = vec![Clip {
        name: "all".to_owned(),
        channels: vec![
            channel(ChannelTarget::Rotation(0), Interpolation::Linear, &[0.5, 1.5], line),
            channel(ChannelTarget::Translation(1), Interpolation::Step, &[0.5, 1.0], steps),
            channel(ChannelTarget::Scale(2), Interpolation::CubicSpline, &[0.5, 1.5], spline),
            // Keys of morph targets decide neither the length nor the frame rate.
            channel(ChannelTarget::MorphWeights(0), Interpolation::Linear, &[0.0, 0.513, 4.0], vec![0.0; 3]),
        ],
        extras: None,
    }];
    let motion = motion_of(&model, &model.clips[0]);
    assert_eq!((motion.frames(), motion.joints.len(), motion.width()), (31, 4, 10));
    assert!((motion.duration() - 1.0).abs() < 1e-5 && motion.notes.is_empty());
    let at = |frame: usize| motion.locals(frame);
    assert!(at(15)[0].rotation.angle_between(half) < 3e-3 && at(30)[0].rotation.angle_between(one) < 3e-3);
    assert_eq!((at(14)[1].translation, at(15)[1].translation), (Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)));
    assert!(at(15)[2].scale.distance(Vec3::splat(2.0)) < 1e-4, "{}", at(15)[2].scale);
    let quarter = 1.0 + 2.0 * (3.0 * 0.2_f32.powi(2) - 2.0 * 0.2_f32.powi(3));
    assert!((at(6)[2].scale.x - quarter).abs() < 1e-4, "{}", at(6)[2].scale);
    // What has no channel is as at rest.
    let (still, rest) = (at(3)[3], model.nodes[3].rest);
    assert!(still.translation == rest.translation && still.rotation.angle_between(rest.rotation) < 3e-3);

    // A clip that is too long for memory is cut, and the note says so.
    model.clips[0].channels[0].times = vec![0.5, 1e9];
    let long = motion_of(&model, &model.clips[0]);
    assert!(long.frames() <= 200_000 && long.notes[0].contains("frames"), "{} {:?}", long.frames(), long.notes);
    model.clips[0].channels.clear();
    assert_eq!(motion_of(&model, &model.clips[0]).frames(), 0);
}

#[test]
fn another_rig_has_no_joints_of_a_file() {
    let mut random = Random(4);
    let mut model = chain(&mut random);
    let (rig, _) = rig_of(&model);
    let joint = |node: usize| Channel {
        target: ChannelTarget::Translation(node),
        interpolation: Interpolation::Linear,
        times: vec![0.0],
        values: vec![0.0; 3],
    };
    model.clips = vec![Clip { channels: vec![joint(3)], ..Clip::default() }];
    assert!(own_joints(&model, &rig).is_some());
    model.nodes[3].rest.translation += Vec3::Y;
    assert_eq!(own_joints(&model, &rig), None);
    model.nodes[3].rest.translation -= Vec3::Y;
    model.nodes[3].name = "other".to_owned();
    assert_eq!(own_joints(&model, &rig), None);
}

/// A motion file without a skin, in which only one thigh has keys: the others stand still, and are joints nevertheless.
#[test]
fn a_file_of_motion_alone_keeps_joints_that_are_still() {
    let file = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 5]}], "nodes": [
                {"name": "Hips", "children": [1, 3]}, {"name": "LeftUpLeg", "children": [2]}, {"name": "LeftLeg"},
                {"name": "RightUpLeg", "children": [4]}, {"name": "RightLeg"}, {"name": "beside"}],
            "animations": [{"samplers": [{"input": 0, "output": 1}],
                "channels": [{"sampler": 0, "target": {"node": 1, "path": "rotation"}}]}],
            "accessors": [
                {"bufferView": 0, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [1]},
                {"bufferView": 1, "componentType": 5126, "count": 2, "type": "VEC4"}],
            "bufferViews": [{"buffer": 0, "byteLength": 8}, {"buffer": 0, "byteOffset": 8, "byteLength": 32}],
            "buffers": [{"byteLength": 40, "uri":
                "data:application/octet-stream;base64,AAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAAAAAACamRk/zcxMPw=="}]}"#;
    let model = read_gltf(file.as_bytes(), "motion.gltf", &mut |_| Ok(Vec::new())).unwrap();
    let names: Vec<&str> = model.nodes.iter().map(|node| node.name.as_str()).collect();
    assert_eq!(names, ["Hips", "LeftUpLeg", "LeftLeg", "RightUpLeg", "RightLeg"]);
    let motion = motion_of(&model, &model.clips[0]);
    let found: Vec<&str> = by_names(&motion_joints(&motion)).values().map(|of| names[of[0]]).collect();
    assert_eq!(found, names, "a human");
}
