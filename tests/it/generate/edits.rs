//! Operations on a rig: those of people, raw edits of every kind, right ones and ones that have to be refused.

use std::sync::Arc;

use glam::{Quat, Vec3};
use rigsmith::{
    mesh::model::Weights,
    processor::Modules,
    rig::{
        FaceBonePart, FacePlacement, GroupData, JointData, NodeKind, PoseOffset, RestTransform, Rig, RigAbout, RigEdit,
        RigInput, SkinData, StoredPose, TagData, TagKind, Uid, WeightPatch,
        animation::{ClipLayer, LayerMode, RigClip, TrackTarget},
        feature::FeatureKey,
        operations::{Axis, ClipOperation, Operation, TagOperation},
    },
};

use super::{
    Choices,
    clips::{clip, keys, property},
    params::{NAMES, Scene, command},
};

/// Texts that break careless writers.
const TEXTS: [&str; 8] =
    ["arm_l", "hand_r", "", "q\"uo\\te", "line\nbreak", "左手 \u{1F600}", "\u{0}\u{7f}\u{202e}", "joints: ["];

/// Uid that no rig of these tests has.
const NOBODY: Uid = Uid(0xDEAD);

/// The things of a rig as references name them.
pub fn scene_of(rig: &Rig) -> Scene {
    let mut scene = Scene::default();
    let joints: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
    for joint in rig.walk() {
        scene.joints.push(format!("#{}", joint.data.uid));
        scene.parents.push(joint.parent.and_then(|parent| joints.iter().position(|uid| *uid == parent)));
        let commands = joint.data.tags.iter().filter(|tag| matches!(tag.kind, TagKind::Command { .. }));
        scene.commands.extend(commands.map(|tag| format!("#{}", tag.uid)));
    }
    scene.groups.extend(rig.groups().iter().map(|group| format!("#{}", group.uid)));
    scene.inputs.extend(rig.inputs().iter().map(|input| format!("#{}", input.uid)));
    scene
}

/// Joints and tags of a rig, for choices among them.
struct RigParts {
    joints: Vec<Uid>,
    tags: Vec<(Uid, TagData)>,
    groups: Vec<Uid>,
}

impl RigParts {
    fn of(rig: &Rig) -> Self {
        let tags = |joint: &rigsmith::rig::RigJoint| {
            let uid = joint.data.uid;
            joint.data.tags.iter().map(|tag| (uid, tag.clone())).collect::<Vec<_>>()
        };
        Self {
            joints: rig.walk().map(|joint| joint.data.uid).collect(),
            tags: rig.walk().flat_map(tags).collect(),
            groups: rig.groups().iter().map(|group| group.uid).collect(),
        }
    }

    /// A joint; one in 16 is none.
    fn joint(&self, choices: &mut Choices) -> Uid {
        choices.of(&self.joints).filter(|_| !choices.chance(16)).unwrap_or(NOBODY)
    }

    fn group(&self, choices: &mut Choices) -> Option<Uid> {
        choices.of(&self.groups).filter(|_| !choices.chance(4))
    }

    fn tag(&self, choices: &mut Choices) -> Option<(Uid, TagData)> {
        let at = choices.below(self.tags.len());
        self.tags.get(at).cloned()
    }
}

fn rest(choices: &mut Choices) -> RestTransform {
    let mut rest = RestTransform { translation: choices.vector(), rotation: choices.rotation(), scale: Vec3::ONE };
    match choices.below(16) {
        0 => rest.scale = choices.pick(&[Vec3::splat(2.0), Vec3::ZERO, Vec3::new(-1.0, 1.0, 1.0)]),
        1 => rest.translation.x = choices.any_number(),
        2 => rest.rotation = choices.pick(&[Quat::IDENTITY, Quat::from_xyzw(0.0, 0.0, 0.0, 0.0)]),
        _ => {}
    }
    rest
}

fn offset(choices: &mut Choices) -> PoseOffset {
    PoseOffset { translation: choices.vector() * 0.1, rotation: choices.rotation(), scale: Vec3::ONE }
}

/// Weights of a mesh of a few points; now and then ones that do not fit.
fn skin(choices: &mut Choices, known: &RigParts) -> SkinData {
    let mut weights = Weights::default();
    for _ in 0..choices.below(6) {
        let joint = choices.below(known.joints.len().max(1)) as u32;
        weights.push([(joint, 1.0)]);
    }
    let mut joints = known.joints.clone();
    if choices.chance(8) {
        joints.push(NOBODY);
    }
    SkinData { joints, weights, at_rest: true, ..SkinData::default() }
}

/// Weights of two points, over a joint that joins their list; the mesh may have fewer points.
fn patch(rig: &Rig, joint: Uid) -> WeightPatch {
    let joints = rig.skin(Uid(0x50)).map_or(0, |skin| skin.joints.len() as u32);
    let mut rows = Weights::default();
    rows.push([(joints, 1.0)]);
    rows.push([]);
    WeightPatch { kept: joints, added: vec![(joint, None)], points: vec![0, 2], rows }
}

/// A command or a feature.
pub fn tag(choices: &mut Choices, rig: &Rig, modules: &Modules, uid: Uid) -> TagData {
    let features: Vec<Uid> = rig
        .walk()
        .flat_map(|joint| &joint.data.tags)
        .filter(|tag| matches!(tag.kind, TagKind::Feature { .. }))
        .map(|tag| tag.uid)
        .collect();
    let kind = match choices.chance(5) {
        true => TagKind::Feature {
            kind: choices.pick(&["ik", "generic", "nothing"]).to_owned(),
            name: choices.pick(&NAMES).to_owned(),
            switch: choices.pick(&["", "a", "b"]).to_owned(),
            choice: choices.pick(&["", "", "solver"]).to_owned(),
        },
        false => {
            let (module, params) = command(choices, &scene_of(rig), modules);
            let feature = choices.of(&features).filter(|_| choices.chance(3));
            TagKind::Command { module, params, feature }
        }
    };
    let comment = if choices.chance(8) { choices.pick(&TEXTS).to_owned() } else { String::new() };
    TagData { uid, enabled: !choices.chance(10), comment, kind }
}

/// An operation; `number` is another one each time, for the uids of what it adds.
pub fn operation(choices: &mut Choices, rig: &Rig, modules: &Modules, number: u64) -> Operation {
    let known = RigParts::of(rig);
    let (one, other) = (known.joint(choices), known.joint(choices));
    let text = choices.pick(&TEXTS).to_owned();
    let parent = choices.chance(2).then_some(other);
    match choices.below(24) {
        0 | 1 => Operation::Place { position: choices.vector(), parent },
        2 => Operation::Chain { positions: (0..choices.below(5)).map(|_| choices.vector()).collect(), parent },
        3 => Operation::Insert { child: one, position: choices.vector() },
        4 => Operation::Delete { joints: vec![one, other], keep_children: choices.chance(2) },
        5 => Operation::Move { to: vec![(one, choices.vector())], with_children: choices.chance(2) },
        6 => Operation::Rotate {
            joints: vec![one, other],
            rotation: choices.rotation(),
            pivot: None,
            with_children: choices.chance(2),
        },
        7 => Operation::Scale {
            joints: vec![one],
            scale: choices.pick(&[Vec3::splat(1.5), Vec3::ONE, Vec3::ZERO, Vec3::splat(1e18)]),
            axes: choices.rotation(),
            pivot: choices.chance(2).then(|| choices.vector()),
            with_children: choices.chance(2),
        },
        8 => Operation::Reparent { joints: vec![one], parent },
        9 => Operation::Labels(vec![(one, text)]),
        10 => Operation::Orient { joints: vec![one, other], along: choices.pick(&[Axis::Y, Axis::X, Axis::Z]) },
        11 => Operation::Mirror { joints: vec![one] },
        12 => Operation::Group { joints: vec![one, other], name: text, color: None },
        13 => Operation::Pose(vec![(one, offset(choices))]),
        14 => match choices.below(4) {
            0 => Operation::StorePose(text),
            1 => Operation::ResetPose(vec![one]),
            2 => Operation::Rest { to: vec![(one, rest(choices))], with_children: choices.chance(2) },
            _ => {
                let pose = rig.stored_poses().first().map_or(NOBODY, |pose| pose.uid);
                choices.pick(&[Operation::ApplyPose as fn(Uid) -> Operation, Operation::DeletePose])(pose)
            }
        },
        15 | 16 => Operation::Tags(tags(choices, rig, modules, &known)),
        17 => Operation::Clips(clips(choices, rig, &known)),
        _ => Operation::Edits((0..1 + choices.below(2)).map(|_| edit(choices, rig, modules, &known, number)).collect()),
    }
}

fn tags(choices: &mut Choices, rig: &Rig, modules: &Modules, known: &RigParts) -> TagOperation {
    let (one, other) = (known.joint(choices), known.joint(choices));
    let (_, first) = known.tag(choices).unwrap_or((NOBODY, tag(choices, rig, modules, NOBODY)));
    let key = FeatureKey { group: None, kind: "ik".into(), name: choices.pick(&NAMES).to_owned() };
    match choices.below(10) {
        0..=2 => {
            let kind = tag(choices, rig, modules, NOBODY).kind;
            TagOperation::Add { joints: vec![one, other], kind, index: choices.chance(2).then_some(0) }
        }
        3 => TagOperation::Delete(vec![first.uid]),
        4 => TagOperation::Enable(vec![first.uid], choices.chance(2)),
        5 => TagOperation::Move { tags: vec![first.uid], joint: one, before: None },
        6 => TagOperation::Comment(first.uid, choices.pick(&TEXTS).to_owned()),
        7 => TagOperation::Params(vec![(first.uid, command(choices, &scene_of(rig), modules).1)]),
        8 => TagOperation::Choice(vec![first.uid], choices.pick(&["", "solver"]).to_owned()),
        _ => match choices.below(3) {
            0 => TagOperation::SetFeature(key, choices.chance(2)),
            1 => TagOperation::ChooseSwitch(key, "a".to_owned()),
            _ => TagOperation::SetSwitch(key, "a".to_owned(), choices.chance(2)),
        },
    }
}

fn clips(choices: &mut Choices, rig: &Rig, known: &RigParts) -> ClipOperation {
    let own = rig.clips().first();
    let (uid, layer) =
        own.map_or((NOBODY, NOBODY), |own: &RigClip| (own.uid, own.layers.first().map_or(NOBODY, |l| l.uid)));
    let name = choices.pick(&NAMES).to_owned();
    match choices.below(8) {
        0 => ClipOperation::Create { name, frame_rate: choices.pick(&[30.0, 0.0, f32::NAN]), range: [0.0, 2.0] },
        1 => ClipOperation::Rename(uid, name),
        2 => ClipOperation::Delete(uid),
        3 => ClipOperation::AddLayer { clip: uid, name, mode: LayerMode::Additive },
        4 => ClipOperation::MoveLayer { clip: uid, layer, index: choices.below(3) },
        5 => ClipOperation::DeleteLayer { clip: uid, layer },
        6 => ClipOperation::Retime {
            clip: uid,
            from: choices.pick(&[[0.0, 1.0], [0.0, 0.0], [1.0, 0.0]]),
            to: choices.pick(&[[0.0, 2.0], [0.0, 0.0], [0.5, 3e38]]),
        },
        _ => ClipOperation::Add(Box::new(clip(choices, 0xC11_0000, &known.joints))),
    }
}

/// A raw edit, as files, remote calls and updates make them.
fn edit(choices: &mut Choices, rig: &Rig, modules: &Modules, known: &RigParts, number: u64) -> RigEdit {
    let (one, other) = (known.joint(choices), known.joint(choices));
    let uid = Uid(0xED17_0000_0000 + number);
    let found = known.tag(choices);
    let index = choices.below(4);
    match choices.below(26) {
        0 | 1 => {
            let joint = JointData {
                uid: if choices.chance(16) { one } else { uid },
                label: choices.chance(2).then(|| choices.pick(&TEXTS).to_owned()),
                group: known.group(choices),
                kind: if choices.chance(6) { NodeKind::Null } else { NodeKind::Joint },
                rest: rest(choices),
                tags: vec![tag(choices, rig, modules, Uid(uid.0 + (1 << 40)))],
                ..JointData::default()
            };
            RigEdit::AddJoint { joint: Box::new(joint), parent: choices.chance(2).then_some(other), index }
        }
        2 => RigEdit::RemoveJoint(one),
        3 => RigEdit::SetRest(one, rest(choices)),
        4 => RigEdit::SetParent { joint: one, parent: choices.chance(3).then_some(other), index },
        5 => RigEdit::SetLabel(one, choices.chance(3).then(|| choices.pick(&TEXTS).to_owned())),
        6 => RigEdit::SetGroup(one, known.group(choices)),
        7 => RigEdit::SetMirror(one, choices.chance(2).then_some(other)),
        8 => RigEdit::SetLocked(one, choices.chance(2)),
        9 | 10 => RigEdit::AddTag { joint: one, tag: Box::new(tag(choices, rig, modules, uid)), index },
        11 => found.map_or(RigEdit::RemoveTag(one, NOBODY), |(joint, tag)| RigEdit::RemoveTag(joint, tag.uid)),
        12 => match found {
            Some((joint, before)) => RigEdit::SetTag(joint, Box::new(tag(choices, rig, modules, before.uid))),
            None => RigEdit::SetTag(one, Box::new(tag(choices, rig, modules, NOBODY))),
        },
        13 => {
            let color = [choices.unit(), choices.any_number(), 0.5];
            let group = GroupData { uid, name: choices.pick(&TEXTS).to_owned(), color, enabled: !choices.chance(3) };
            RigEdit::AddLocalGroup(group, index)
        }
        14 => RigEdit::RemoveLocalGroup(known.group(choices).unwrap_or(NOBODY)),
        15 => match known.group(choices).and_then(|group| rig.group(group)) {
            Some(group) => RigEdit::SetLocalGroup(GroupData { enabled: !group.enabled, ..group.clone() }),
            None => RigEdit::SetKind(one, NodeKind::Null),
        },
        16 => RigEdit::SetAbout(Box::new(RigAbout {
            name: choices.pick(&TEXTS).to_owned(),
            version: choices.pick(&["", "1.2", "x"]).to_owned(),
            ..RigAbout::default()
        })),
        // Without a choice of its own, so that findings from before stay what they are.
        17 if index == 3 && rig.skin(Uid(0x50)).is_some() => RigEdit::SetWeights(Uid(0x50), Box::new(patch(rig, one))),
        17 => RigEdit::SetSkin(Uid(0x50), choices.chance(3).then(|| Arc::new(skin(choices, known)))),
        18 => RigEdit::SetOffset(one, choices.chance(3).then(|| offset(choices))),
        19 => RigEdit::SetAttributeValue(one, choices.pick(&NAMES).to_owned(), Some(choices.any_number())),
        20 => RigEdit::AddStoredPose(
            Box::new(StoredPose { uid, name: choices.pick(&TEXTS).to_owned(), ..StoredPose::default() }),
            index,
        ),
        21 => match rig.clips().first() {
            Some(clip) if choices.chance(2) => {
                RigEdit::AddLayer { clip: clip.uid, layer: Box::new(ClipLayer::empty(uid)), index }
            }
            Some(clip) => {
                let property = property(choices);
                let inserted = keys(choices, &property);
                let layer = clip.layers.first().map_or(NOBODY, |layer| layer.uid);
                let target = TrackTarget { node: one, property };
                RigEdit::SetKeys { clip: clip.uid, layer, target, removed: Vec::new(), inserted }
            }
            None => RigEdit::AddClip(Box::new(clip(choices, uid.0, &known.joints)), index),
        },
        22 => RigEdit::SetFace(
            one,
            choices.chance(2).then(|| {
                let position = choices.vector();
                Box::new(FacePlacement { part: FaceBonePart::Skin, label: choices.pick(&NAMES).to_owned(), position })
            }),
        ),
        23 => {
            let inputs = (0..choices.below(3) as u64).map(|at| RigInput {
                uid: Uid(uid.0 + at * (1 << 41)),
                name: choices.pick(&NAMES).to_owned(),
                rest: rest(choices),
            });
            RigEdit::SetInputs(inputs.collect())
        }
        24 => RigEdit::SetKind(one, NodeKind::Joint),
        _ => RigEdit::Batch(vec![
            RigEdit::SetRest(one, rest(choices)),
            RigEdit::SetLabel(other, Some(choices.pick(&TEXTS).to_owned())),
        ]),
    }
}
