//! Clip: put on a rig, written and read, sampled, baked into a file, and taken from there onto the rig again.

use std::sync::Arc;

use rigsmith::{
    files::{load_animation, load_model, store_animation, store_model},
    mesh::{
        gltf::GltfWriteSettings,
        model::{Model, Node},
    },
    rig::{
        BuiltRig, Rig, RigEdit, Uid,
        animation::{
            ClipSampler, RigClip, SampleCursor,
            clip_extras::MAX_MARKERS,
            file_clip::{own_joints, rig_clips},
        },
        bake::baked,
        character::{Character, character},
        format::animation::{read_animation, write_animation},
        operations::KeyTolerance,
        template::write_template,
    },
    solve::{
        bake_clip::{BakeError, BakeSettings, BakedNode, MOST_TRANSFORMS, bake_clip},
        program::{CompileOptions, RigProgram},
    },
};

use super::{
    build, limited,
    memory_disk::{MemoryDisk, at},
    promises,
    skin::{cube, held_by_first},
    template::refused,
};
use crate::generate::{Choices, clips::clip, template::template};

/// Carries a clip through all of it.
pub fn check(bytes: &[u8]) {
    let mut choices = Choices::new(bytes);
    let made = template(&mut choices, &limited(), false);
    let Some(mut rig) = made.read().map(|template| template.rig) else { return };
    let built = build(&rig);
    let nodes: Vec<Uid> = match &built {
        Some(built) => built.nodes.iter().map(|node| node.uid).collect(),
        None => rig.walk().map(|joint| joint.data.uid).collect(),
    };
    let clip = clip(&mut choices, 0xC11_9000, &nodes);
    let before = write_template(&rig);
    let undo = match rig.apply(&RigEdit::AddClip(Box::new(clip.clone()), 0)) {
        Ok(undo) => undo,
        Err(error) => {
            promises::error(&error);
            assert!(rig.clips().is_empty(), "a refused clip is there");
            // Whatever the file says, no such clip comes of it.
            let text = write_animation(&rig, built.as_ref(), std::slice::from_ref(&clip));
            let read = read_animation(text.as_bytes());
            assert!(read.is_err(), "the document refuses it ({error}), the reader takes it:\n{text}");
            return;
        }
    };
    written(&rig, built.as_ref(), &clip);
    sampled(&clip);
    if let Some(built) = &built {
        exported(&rig, built, &clip, !choices.was_odd());
    }
    rig.apply(&undo).expect("what was added can be taken back");
    assert!(rig.clips().is_empty() && write_template(&rig) == before);
}

/// The same clips come back from their file, and the same bytes from them.
fn written(rig: &Rig, built: Option<&BuiltRig>, clip: &RigClip) {
    let disk = MemoryDisk::default();
    store_animation(&disk, &at("c.anim.ron"), rig, built, rig.clips()).unwrap_or_else(|error| panic!("{error}"));
    let read = load_animation(&disk, &at("c.anim.ron")).expect("it was written");
    assert_eq!(read.clips, std::slice::from_ref(clip));
    let bound = read.onto(rig, built);
    assert_eq!(bound.clips, read.clips, "a rig's own clips are bound to other nodes");
    let text = disk.get("c.anim.ron").expect("it is there");
    assert!(write_animation(rig, built, &read.clips).into_bytes() == text, "the second file is another");
}

/// Both ways to sample give finite numbers at every moment, and none panics at one that is none.
fn sampled(clip: &RigClip) {
    let sampler = ClipSampler::new(clip);
    let mut values = vec![glam::Vec4::ZERO; sampler.targets().len()];
    let mut cursor = SampleCursor::default();
    for time in [clip.range[0], 0.3, 1.0, clip.range[1], f32::INFINITY, -1e30, f32::NAN] {
        sampler.sample(time, &mut cursor, &mut values);
        let pose = clip.sample(time);
        if !time.is_nan() {
            assert!(values.iter().all(|value| value.is_finite()), "{time}: {values:?}");
            assert!(pose.offsets.values().all(|offset| offset.translation.is_finite() && offset.rotation.is_finite()));
        }
    }
}

/// A clip in a file moves what it moved, and is a clip of the rig again.
fn exported(rig: &Rig, built: &BuiltRig, clip: &RigClip, is_ordinary: bool) {
    let Ok(program) = RigProgram::compile(built, &CompileOptions::default()) else { return };
    let (mesh, skin) = (cube(), held_by_first(rig, 8));
    let model =
        character(&Character { rig, built: Some(built), file: &mesh, rest: &mesh, nodes: &[], skin: Some(&skin) });
    let skeleton = baked(rig, built);
    let node = |(uid, node): (Uid, &Node)| BakedNode { uid, parent: node.parent, rest: node.rest };
    let nodes: Vec<BakedNode> = skeleton.walk().map(|joint| joint.data.uid).zip(&model.nodes).map(node).collect();
    let settings = BakeSettings::new(clip.frame_rate, KeyTolerance::default());
    let done = match bake_clip(&Arc::new(program), clip, &nodes, &settings) {
        Ok(done) => done,
        Err(error) => {
            promises::error(&error);
            match error {
                BakeError::TooLong { frames, .. } => assert!(frames > 1_000_000, "{error}"),
                BakeError::TooMuch { frames, nodes, .. } => {
                    assert!(frames.saturating_mul(nodes) > MOST_TRANSFORMS, "{error}");
                }
                BakeError::Markers { count } => assert!(count > MAX_MARKERS, "{error}"),
                BakeError::Names { .. } => panic!("it is no packed clip: {error}"),
            }
            return;
        }
    };
    let disk = MemoryDisk::default();
    let settings = GltfWriteSettings { all_joints: true, bind_unweighted: true, ..GltfWriteSettings::default() };
    match store_model(&disk, &at("c.glb"), &Model { clips: vec![done], ..model }, &settings) {
        Ok(_) => {
            let back = load_model(&disk, &at("c.glb")).expect("it was written");
            promises::model(&back);
            let Some(joints) = own_joints(&back, &skeleton) else { return };
            let mut again = skeleton.clone();
            for clip in rig_clips(&skeleton, &back, &joints) {
                again.apply(&RigEdit::AddClip(Box::new(clip), 0)).unwrap_or_else(|error| panic!("{error}"));
            }
        }
        Err(error) => {
            assert!(!is_ordinary || clip.frame_rate > 1e3 || clip.duration() > 1e3, "{error}");
            refused(&disk, "c.glb", &error);
        }
    }
}
