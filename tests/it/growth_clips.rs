//! Growth of the work for baked clips, counted: a clip takes work for the nodes that it moves, however many there are.

use std::sync::Arc;

use bevy::math::Vec3;
use rigsmith::{
    mesh::model::{ChannelTarget, Clip, Model, Node, Trs},
    modules,
    processor::Builder,
    rig::{
        Rig, Uid, UidSource,
        animation::{Ease, Key, Property, RigClip, Track, TrackTarget},
        character::import_skeleton,
        operations::KeyTolerance,
    },
    solve::{
        bake_clip::{BakePlan, BakeSettings, BakedNode, bake_clip},
        program::{CompileOptions, RigProgram},
    },
};

/// A chain of joints.
fn chain(count: usize) -> (Rig, Vec<BakedNode>) {
    let node = |number: usize| Node {
        name: format!("joint {number}"),
        parent: number.checked_sub(1),
        rest: Trs { translation: Vec3::Y * 0.1, ..Trs::default() },
        joint: true,
        extras: None,
    };
    let model = Model { name: "chain".to_owned(), nodes: (0..count).map(node).collect(), ..Model::default() };
    let mut uids = UidSource::seeded(7);
    let mut rig = Rig::new(uids.next_uid(), "chain");
    let skeleton = import_skeleton(&model, &mut uids);
    skeleton.edits.iter().for_each(|edit| {
        rig.apply(edit).unwrap();
    });
    let baked = |(uid, node): (&Uid, &Node)| BakedNode { uid: *uid, parent: node.parent, rest: node.rest };
    let nodes = skeleton.nodes.iter().zip(&model.nodes).map(baked).collect();
    (rig, nodes)
}

/// A clip that moves one joint.
fn clip_on(joint: Uid) -> RigClip {
    let mut clip = RigClip { range: [0.0, 1.0], ..RigClip::new(Uid(0xC1), Uid(0xC2), "wave") };
    let key = |time: f32| Key { time, value: [time, 0.0, 0.0, 0.0], ease: Ease::Linear };
    let target = TrackTarget { node: joint, property: Property::Translation };
    clip.layers[0].tracks.insert(target, Arc::new(Track { keys: vec![key(0.0), key(1.0)] }));
    clip
}

fn program(rig: &Rig) -> Arc<RigProgram> {
    let built = Builder::build(rig, &Arc::new(modules::all())).unwrap();
    Arc::new(RigProgram::compile(&built, &CompileOptions::default()).unwrap())
}

fn targets(clip: &Clip) -> Vec<ChannelTarget> {
    clip.channels.iter().map(|channel| channel.target).collect()
}

#[test]
fn clips_look_at_the_nodes_that_they_move() {
    for count in [100, 200, 400] {
        let (rig, nodes) = chain(count);
        let program = program(&rig);
        let plan = BakePlan::new(&program, &nodes);
        for (at, node) in nodes.iter().enumerate() {
            let clip = clip_on(node.uid);
            let baked = plan.bake(&clip, &BakeSettings::new(24.0, KeyTolerance::default())).unwrap();
            assert_eq!(targets(&baked), [ChannelTarget::Translation(at)]);
        }
        assert_eq!(plan.visits(), count as u64);
    }
}

/// A node that stands elsewhere in the file has a channel in each clip.
#[test]
fn nodes_that_stand_elsewhere_in_the_file_have_channels() {
    let (rig, mut nodes) = chain(20);
    nodes[3].rest.translation.x = 1.0;
    nodes[8].rest.scale.y = 2.0;
    let program = program(&rig);
    let settings = BakeSettings::new(24.0, KeyTolerance::default());
    let clip = clip_on(nodes[5].uid);
    let baked = BakePlan::new(&program, &nodes).bake(&clip, &settings).unwrap();
    let expected = [ChannelTarget::Translation(3), ChannelTarget::Translation(5), ChannelTarget::Scale(8)];
    assert_eq!(targets(&baked), expected);
    assert_eq!(bake_clip(&program, &clip, &nodes, &settings), Ok(baked));
}
