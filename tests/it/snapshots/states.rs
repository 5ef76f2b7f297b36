//! States of documents that panels show: nothing yet, a usual character, far more than usual, a face, a newer template.

use std::{collections::BTreeMap, fs, sync::Arc};

use bevy::prelude::*;
use rigsmith::{
    editor::{
        actions::{Action, ActionRequest},
        files::OpenRequest,
        library::{ChosenTemplate, ListTemplates, TemplateLibrary},
        mode::Mode,
        notice::Notice,
        panels::timeline::{TimelineAction, TimelineRequest},
        tools::paint::SelectedPoints,
    },
    mesh::model::{Model, Weights},
    plugins::{
        commands::BuildResult,
        face::{Face, FaceRequest},
    },
    prelude::*,
    rig::{
        JointData, RestTransform, SelectionSet, SkinData, StoredPose, TagData, TagKind,
        animation::{Ease, Key, Marker, Property, RigClip, Track, TrackTarget},
    },
};

use super::booth::Booth;
use crate::{bench::save_whole, gestures::boxes};

const MESH: Uid = Uid(0x5A_0001);
const CLIP: Uid = Uid(0x5A_0002);
const BASE: Uid = Uid(0x5A_0003);
const SEED: u64 = 0x5A00_0000;

fn model(name: &str) -> Model {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("assets/models/{name}.obj"));
    load_model(&RealDisk, &path).unwrap_or_else(|error| panic!("{error}"))
}

fn bent(angle: f32) -> PoseOffset {
    PoseOffset::from_rotation(Quat::from_rotation_z(angle))
}

fn edits(booth: &mut Booth, edits: Vec<RigEdit>) {
    booth.edit(Operation::Edits(edits));
}

/// An empty project.
pub fn empty() -> Booth {
    let mut booth = Booth::new(&[]);
    booth.open(OpenRequest::Empty);
    booth.tell([]);
    booth
}

/// The bundled biped, built and skinned, with a clip, poses, sets and a selection.
pub fn typical() -> Booth {
    let mut booth = Booth::new(&[]);
    booth.open(OpenRequest::Template("biped".to_owned()));
    booth.add_mesh(RigMesh::new(MESH, model("biped"), Vec::new()));
    booth.send(ActionRequest(Action::Skin));
    let joints: Vec<Uid> = booth.rig().walk().map(|joint| joint.data.uid).collect();
    let rig = booth.rig().clone();
    let named = |label: &str| rig.find_label(label);
    let moved: Vec<Uid> = joints.iter().copied().take(9).collect();
    for (number, name) in ["T-pose", "Wave", "Crouch"].into_iter().enumerate() {
        let offsets = moved.iter().skip(number).step_by(2).map(|joint| (*joint, bent(0.2 + 0.15 * number as f32)));
        booth.edit(Operation::Pose(offsets.collect()));
        booth.edit(Operation::StorePose(name.to_owned()));
    }
    booth.edit(Operation::ResetPose(Vec::new()));
    let sets = [("Spine", &joints[..4]), ("Left arm", &joints[4..9]), ("All", &joints[..])];
    let sets = sets.map(|(name, nodes)| SelectionSet { name: name.to_owned(), nodes: nodes.to_vec() });
    edits(&mut booth, vec![RigEdit::SetSelectionSets(sets.to_vec())]);
    edits(&mut booth, vec![RigEdit::AddClip(Box::new(clip(CLIP, BASE, "walk", &moved, 8)), 0)]);
    booth.send(TimelineRequest::Open(Some(CLIP)));
    booth.send(TimelineRequest::Scrub(0.8));
    // The joint with the most tags has the most to show.
    let most = rig.walk().max_by_key(|joint| (joint.data.tags.len(), std::cmp::Reverse(joint.data.uid)));
    let active = most.map(|joint| joint.data.uid).or(named("hips")).expect("the biped has joints");
    booth.select(&[joints[0], active]);
    booth.app.world_mut().resource_mut::<SelectedPoints>().add(MESH, [10, 400, 900, 1200]);
    booth.app.insert_resource(Mode::Select);
    booth.tell([
        Notice::info("biped.rig.ron is open: 71 joints.").quiet(),
        Notice::done("biped is skinned: 100 % of 13380 points have weights.").named().quiet(),
        Notice::warning("2 joints move nothing: the Skinning panel lists them.").quiet(),
        Notice::error("No face was placed: the mesh has no head. Choose \"Whole mesh\" in the Face panel.").quiet(),
    ]);
    booth
}

/// A clip of two seconds that turns nodes, with a number of keys for each.
fn clip(uid: Uid, base: Uid, name: &str, nodes: &[Uid], keys: usize) -> RigClip {
    let mut clip = RigClip { range: [0.0, 2.0], ..RigClip::new(uid, base, name) };
    for (number, node) in nodes.iter().enumerate() {
        let turn = |key: usize| {
            let time = 2.0 * key as f32 / (keys - 1) as f32;
            let angle = 0.4 * bevy::math::ops::sin(3.0 * time + 0.3 * number as f32);
            let mut key = Key::rotation(time, Quat::from_rotation_z(angle));
            key.ease = [Ease::Linear, Ease::Stepped][usize::from(number % 4 == 3)];
            key
        };
        let target = TrackTarget { node: *node, property: Property::Rotation };
        clip.layers[0].tracks.insert(target, Arc::new(Track { keys: (0..keys).map(turn).collect() }));
    }
    for (time, name) in [(0.5, "left foot down"), (1.5, "right foot down")] {
        clip.markers.push(Marker { time, name: name.to_owned() });
    }
    clip
}

/// Chooses the first listed part that has options.
pub fn choose_part(booth: &mut Booth) {
    booth.send(ListTemplates);
    let listing = booth.world().resource::<TemplateLibrary>().listing().clone();
    let has_options =
        listing.templates().find(|listed| listed.header.as_ref().is_ok_and(|header| !header.options.is_empty()));
    let chosen = has_options.or(listing.templates().next()).map(|listed| listed.place.clone());
    booth.app.insert_resource(ChosenTemplate(chosen));
}

/// Selects a control of the built rig.
pub fn select_control(booth: &mut Booth) {
    let built = booth.world().get::<BuildResult>(booth.entity()).expect("the rig is built").0.clone();
    let control = built.switches.first().map(|switch| switch.control).expect("the biped has switches");
    booth.select(&[control]);
}

/// Sets keys of the control of the left hand.
pub fn key_hand(booth: &mut Booth) {
    let built = booth.world().get::<BuildResult>(booth.entity()).expect("the rig is built").0.clone();
    let hand = built.nodes.iter().find(|node| *node.name == *"hand_ik_l").expect("the biped has the control");
    booth.app.insert_resource(Mode::Select);
    booth.select(&[hand.uid]);
    booth.send(ActionRequest(Action::Timeline(TimelineAction::Key)));
}

/// Nothing but what is shown already.
pub fn as_it_is(_: &mut Booth) {}

/// Clears the selection.
pub fn select_nothing(booth: &mut Booth) {
    booth.select(&[]);
}

/// Selects the first joint alone.
pub fn select_first(booth: &mut Booth) {
    let first = booth.rig().walk().next().map(|joint| joint.data.uid).expect("the rig has joints");
    booth.select(&[first]);
}

/// Enters Pose mode.
pub fn pose_mode(booth: &mut Booth) {
    booth.app.insert_resource(Mode::Pose);
}

/// Names in scripts that the fonts have and that they lack, and longer than any panel.
fn long_name(number: usize) -> String {
    let name = [
        "a_rather_long_label_of_a_joint_in_the_middle_of_the_spine",
        "Schulterblattverbindungsknochen_äußerer_Übergang_links",
        "αριστερή_κλείδα_και_ώμος_του_χαρακτήρα",
        "левая_ключица_вспомогательный_сустав",
        "左鎖骨の補助関節",
        "עצם_הבריח_השמאלית",
        "x",
    ];
    format!("{}_{number:03}", name[number % name.len()])
}

const JOINTS: usize = 200;

/// 200 joints with long names in several scripts, 1000 commands of which one fails, 10,000 keys, long lists of everything.
pub fn extreme() -> Booth {
    let site = "tests/it/snapshots/site";
    assert!(fs::exists(site).is_ok_and(|exists| exists), "tests run in the folder of the package, which has {site}");
    let mut booth = Booth::new(&[site, "no/such/folder"]);
    booth.open(OpenRequest::Empty);
    let joint = |number: usize| Uid(SEED + 1 + number as u64);
    let mut list = Vec::new();
    for number in 0..JOINTS {
        let data = JointData {
            uid: joint(number),
            label: Some(long_name(number)),
            rest: RestTransform::from_translation(Vec3::new(0.01 * (number % 12) as f32, 0.05, 0.0)),
            locked: number % 9 == 4,
            ..default()
        };
        let parent = match number {
            0 => None,
            _ if number % 12 == 0 => Some(joint(number - 12)),
            _ => Some(joint(number - 1)),
        };
        list.push(RigEdit::AddJoint { joint: Box::new(data), parent, index: usize::MAX });
    }
    edits(&mut booth, list);
    for number in 0..12 {
        let joints = (0..JOINTS).skip(number).step_by(12).map(joint).collect();
        booth.edit(Operation::Group { joints, name: format!("Group of {}", long_name(number)), color: None });
    }
    // A history of many steps with long titles.
    for number in 0..90 {
        booth.edit(Operation::Labels(vec![(joint(number), format!("{}.", long_name(number)))]));
    }
    let poses = (0..60).map(|number| {
        let offsets = [(joint(number), bent(0.5)), (joint(number + 20), bent(-0.7))].into();
        let uid = Uid(SEED + 0x1000 + number as u64);
        let name = format!("Pose {} {}", number + 1, long_name(number));
        RigEdit::SetStoredPose(Box::new(StoredPose { uid, name, offsets, values: BTreeMap::new() }))
    });
    edits(&mut booth, poses.collect());
    let sets = (0..60).map(|number| {
        let nodes = (0..JOINTS + 30).skip(number).step_by(7).map(joint).collect();
        SelectionSet { name: format!("Set {} {}", number + 1, long_name(number)), nodes }
    });
    edits(&mut booth, vec![RigEdit::SetSelectionSets(sets.collect())]);
    add_boxes(&mut booth, joint);
    let nodes: Vec<Uid> = (0..100).map(joint).collect();
    let clips = (0..3).map(|number| {
        let (uid, base) = (Uid(SEED + 0x2000 + number), Uid(SEED + 0x2100 + number));
        let keys = if number == 0 { 100 } else { 3 };
        let name = format!("clip {} {}", number + 1, long_name(number as usize));
        RigEdit::AddClip(Box::new(clip(uid, base, &name, &nodes, keys)), number as usize)
    });
    edits(&mut booth, clips.collect());
    add_commands(&mut booth, joint);
    booth.settle();
    booth.send(TimelineRequest::Open(Some(Uid(SEED + 0x2000))));
    booth.send(TimelineRequest::Scrub(0.8));
    booth.select(&(0..JOINTS).step_by(2).map(joint).collect::<Vec<_>>());
    booth.app.world_mut().resource_mut::<SelectedPoints>().add(MESH, 0..120);
    let told = |number: usize| {
        let text = format!("notice {number}: {} is not what {} expects", long_name(number), long_name(number + 1));
        let notice = match number % 4 {
            0 => Notice::info(text),
            1 => Notice::done(text),
            2 => Notice::warning(text),
            _ => Notice::error(format!("{text}.\nA second line says where.\nA third one says what to do about it.")),
        };
        notice.named().quiet()
    };
    booth.tell((0..2300).map(told));
    booth
}

/// Adds a mesh of many objects with weights for as many joints.
fn add_boxes(booth: &mut Booth, joint: impl Fn(usize) -> Uid) {
    let corners: Vec<[[f32; 3]; 2]> = (0..30)
        .map(|number| {
            let low = 0.06 * number as f32;
            [[-0.1, low, -0.1], [0.1, low + 0.05, 0.1]]
        })
        .collect();
    let mut model = boxes(&corners);
    model.name = "a_mesh_whose_name_is_longer_than_the_panel_that_shows_it".to_owned();
    let joints: Vec<Uid> = (0..30).map(joint).collect();
    let mut weights = Weights { starts: vec![0], ..Weights::default() };
    for point in 0..model.points.len() {
        let first = point / 8;
        weights.push((0..4).map(|n| (((first + n) % 30) as u32, 0.25)));
    }
    let skin = SkinData { joints, weights, at_rest: true, ..SkinData::default() };
    booth.add_mesh(RigMesh::new(MESH, model, Vec::new()));
    edits(booth, vec![RigEdit::SetSkin(MESH, Some(Arc::new(skin)))]);
}

/// Adds five commands to each joint; the parameters of one cannot be read.
fn add_commands(booth: &mut Booth, joint: impl Fn(usize) -> Uid) {
    let mut list = Vec::new();
    for number in 0..JOINTS {
        for index in 0..5 {
            let module = if index == 0 { "control" } else { "null" };
            let is_wrong = number == 150 && index == 2;
            let params = if is_wrong { "(rotate: (1.0, 2.0, oops))" } else { "()" };
            let tag = TagData {
                uid: Uid(SEED + 0x10_0000 + (number * 5 + index) as u64),
                enabled: index != 4,
                comment: if index == 1 { format!("why {} is here", long_name(number)) } else { String::new() },
                kind: TagKind::Command { module: module.to_owned(), params: params.to_owned(), feature: None },
            };
            list.push(RigEdit::AddTag { joint: joint(number), tag: Box::new(tag), index });
        }
    }
    edits(booth, list);
}

/// The bundled head with a face.
pub fn head() -> Booth {
    let mut booth = Booth::new(&[]);
    booth.open(OpenRequest::Empty);
    let mesh = booth.add_mesh(RigMesh::new(MESH, model("head"), Vec::new()));
    booth.send(FaceRequest { mesh, settings: default(), fit: None });
    booth.until("the face", |world| world.get::<Face>(mesh).is_some());
    booth.settle();
    booth.tell([]);
    booth
}

/// A rig whose template lies in a file, with the same joints as in it.
pub fn followed() -> Booth {
    let mut booth = Booth::in_time(&[]);
    let file = booth.folder().join("chain_of_many_joints.rig.ron");
    fs::write(&file, chain("1.0.0", 0.1)).expect("written");
    booth.open(OpenRequest::File(file));
    let rig = booth.entity();
    booth.until("the followed file", |world| world.get::<RigSource>(rig).is_some_and(|source| source.base().is_some()));
    booth
}

/// The file of the rig becomes newer: some of its changes are conflicts.
pub fn make_conflicts(booth: &mut Booth) {
    let moved: Vec<Uid> = booth.rig().walk().map(|joint| joint.data.uid).step_by(3).collect();
    let raise = |joint: &Uid| RigEdit::SetRest(*joint, RestTransform::from_translation(Vec3::Y * 0.5));
    edits(booth, moved.iter().map(raise).collect());
    let file = booth.folder().join("chain_of_many_joints.rig.ron");
    save_whole(&file, chain("1.1.0", 0.2));
    let rig = booth.entity();
    booth.until("the offer", |world| world.get::<UpdateOffer>(rig).is_some());
    booth.stand_still();
}

fn chain(version: &str, step: f32) -> String {
    let joint = |number: usize| {
        let parent = match number {
            0 => String::new(),
            _ => format!("parent: \"bone_{:02}\", ", number - 1),
        };
        format!("        (label: \"bone_{number:02}\", {parent}translation: (0, {step}, 0)),\n")
    };
    let joints: String = (0..40).map(joint).collect();
    format!("(\n    format: 2,\n    name: \"chain\",\n    version: \"{version}\",\n    joints: [\n{joints}    ],\n)\n")
}
