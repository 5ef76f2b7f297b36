//! Root motion: a clip's travel goes to the game, and what carries the character stays where it begins.

use bevy::prelude::*;
use rigsmith::{
    plugins::{
        animation::{ClipPlayer, RootMotion},
        document::JointEntities,
    },
    rig::{
        RigEdit, Uid,
        animation::{Property, joint_map::JointMap},
        format::bvh::read_bvh,
    },
    solve::retarget::{MotionTarget, RetargetSettings, retarget},
};

use super::{
    app::{app, joints, walk, with_document},
    apply, biped, controls,
    keep::state,
    program, target,
};

/// Place of a joint's entity in the world.
fn place(app: &App, rig: Entity, joint: Uid) -> Vec3 {
    let joint = app.world().get::<JointEntities>(rig).unwrap().get(joint).unwrap();
    app.world().get::<GlobalTransform>(joint).unwrap().translation()
}

/// Runs a frame and carries on from `walked` by the root motion of the frame.
fn walk_on(app: &mut App, rig: Entity, walked: &mut Transform) {
    app.update();
    *walked = walked.mul_transform(app.world().get::<RootMotion>(rig).unwrap().delta);
}

#[test]
fn root_motion_goes_to_the_game() {
    let mut rig = biped();
    let program = program(&rig);
    let root = controls(&program)[0];
    apply(&mut rig, RigEdit::AddClip(Box::new(walk(root)), 0));
    let clip = rig.clips()[0].clone();
    let mut app = app();
    let entity = with_document(&mut app, rig);
    let start = joints(&mut app, entity);
    app.world_mut().entity_mut(entity).insert((ClipPlayer::new(&clip), RootMotion::of(root)));
    let mut walked = Transform::IDENTITY;
    for _ in 0..25 {
        walk_on(&mut app, entity, &mut walked);
    }
    let base = program.nodes()[program.node(root).unwrap()].base;
    let wanted = base.rotation * (base.scale * Vec3::new(0.0, 0.0, 1.25));
    assert!(walked.translation.distance(wanted) < 1e-3, "{walked:?} {wanted}");
    for ((_, was), (_, is)) in start.iter().zip(joints(&mut app, entity)) {
        assert!(was.translation.distance(is.translation) < 1e-5);
    }
    app.world_mut().get_mut::<ClipPlayer>(entity).unwrap().playing = false;
    app.update();
    assert_eq!(app.world().get::<RootMotion>(entity).unwrap().delta, Transform::IDENTITY);
}

/// Motion of another skeleton onto joints has its travel on the hips.
#[test]
fn root_motion_of_an_imported_clip_goes_to_the_game() {
    let mut rig = biped();
    let tags = rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| (joint.data.uid, tag.uid)));
    let edits = tags.map(|(joint, tag)| RigEdit::RemoveTag(joint, tag)).collect();
    apply(&mut rig, RigEdit::Batch(edits));
    let motion = read_bvh(include_bytes!("../retarget/walker.bvh"), "walker").unwrap();
    let map = JointMap::new(&motion, &rig, &[]).unwrap();
    let settings = RetargetSettings { onto: MotionTarget::Joints, ..RetargetSettings::default() };
    let clip = retarget(&rig, &super::built(&rig), &motion, &map, &settings).unwrap().clip;
    let hips = rig.find_label("hips").unwrap();
    let moved = clip
        .nodes()
        .into_iter()
        .filter(|node| clip.layers[0].tracks.contains_key(&target(*node, Property::Translation)));
    assert_eq!(moved.collect::<Vec<_>>(), [hips], "the travel is on the hips alone");
    apply(&mut rig, RigEdit::AddClip(Box::new(clip.clone()), 0));

    // The hips in the rig's space; no joint above them has keys.
    let program = program(&rig);
    let at = |time: f32| state(&program, Some(&clip), time).global(hips).unwrap();
    let (start, end) = (at(clip.range[0]), at(clip.range[1]));
    let travel = start.translation.distance(end.translation);
    assert!(travel > 0.02, "{travel}");
    let mut app = app();
    let entity = app.world_mut().spawn(rig).id();
    app.update();
    app.world_mut()
        .entity_mut(entity)
        .insert((ClipPlayer { looped: false, ..ClipPlayer::new(&clip) }, RootMotion::of(hips)));
    let mut walked = Transform::IDENTITY;
    for _ in 0..15 {
        walk_on(&mut app, entity, &mut walked);
        let off = place(&app, entity, hips).distance(start.translation);
        assert!(off < 1e-3, "the hips stand where they begin: {off}");
    }
    let local = walked.translation.length();
    assert!(walked.translation.is_finite() && local > 0.02, "{walked:?}");
    // Where the game puts a rig that has walked, the hips are where the clip has them at its end.
    let begun = Isometry3d::new(start.translation, start.rotation);
    let ended = Isometry3d::new(end.translation, end.rotation);
    let wanted = ended * begun.inverse();
    let off = walked.translation.distance(Vec3::from(wanted.translation));
    assert!(off < 2e-3 && walked.rotation.angle_between(wanted.rotation) < 5e-3, "{walked:?} {wanted:?}");
}

/// Motion of another skeleton onto controls has its travel on the control that carries the rig, if that is wanted.
#[test]
fn root_motion_on_controls_goes_to_the_game() {
    let mut rig = biped();
    let motion = read_bvh(include_bytes!("../retarget/walker.bvh"), "walker").unwrap();
    let (built, program) = (super::built(&rig), program(&rig));
    let map = JointMap::new(&motion, &rig, &[]).unwrap();
    let of = |root_motion: bool| {
        let settings = RetargetSettings { root_motion, ..RetargetSettings::default() };
        retarget(&rig, &built, &motion, &map, &settings).unwrap()
    };
    let (plain, done) = (of(false), of(true));
    assert_eq!(plain.root, None);
    let (clip, root) = (done.clip, done.root.unwrap());
    assert_eq!(&*built.node(root).unwrap().name, "root");
    let moved = target(root, Property::Translation);
    assert!(clip.layers[0].tracks.contains_key(&moved) && !plain.clip.layers[0].tracks.contains_key(&moved));
    // The joints move as they do without.
    for frame in 0..=18 {
        let time = clip.range[1] * frame as f32 / 18.0;
        let (with, without) = (state(&program, Some(&clip), time), state(&program, Some(&plain.clip), time));
        for joint in rig.walk().map(|joint| joint.data.uid) {
            let off = with.global(joint).unwrap().translation.distance(without.global(joint).unwrap().translation);
            assert!(off < 3e-3, "{joint} at {time} s is off by {off}");
        }
    }
    let hips = rig.find_label("hips").unwrap();
    let at = |time: f32| state(&program, Some(&clip), time).global(hips).unwrap().translation;
    let (start, end) = (at(clip.range[0]), at(clip.range[1]));
    assert!((end - start).with_y(0.0).length() > 0.02, "{start} {end}");
    apply(&mut rig, RigEdit::AddClip(Box::new(clip.clone()), 0));

    let mut app = app();
    let entity = with_document(&mut app, rig);
    app.world_mut()
        .entity_mut(entity)
        .insert((ClipPlayer { looped: false, ..ClipPlayer::new(&clip) }, RootMotion::of(root)));
    let mut walked = Transform::IDENTITY;
    for _ in 0..15 {
        walk_on(&mut app, entity, &mut walked);
        let off = (place(&app, entity, hips) - start).with_y(0.0).length();
        assert!(off < 2e-3, "the hips stand over the place where they begin: {off}");
    }
    let off = walked.transform_point(place(&app, entity, hips)).distance(end);
    assert!(off < 3e-3, "where the game puts the rig, the hips are where the clip has them: {off}");
}
