//! Editing a rig: every edit has its exact inverse, every operation is done as a whole or not at all.

mod lists;
mod skeleton;
mod tag_params;

use std::sync::Arc;

use bevy::math::{Quat, Vec3};
use proptest::prelude::*;
use rigsmith::{
    mesh::model::Weights,
    plugins::{document::Selection, history::RigHistory},
    rig::{
        EditError, GroupData, JointData, NodeKind, PoseOffset, RestTransform, Rig, RigAbout, RigEdit, SkinData,
        StoredPose, TagData, TagKind, Uid, UidSource,
        operations::{Axis, MirrorPlane, Operation, OperationError, Outcome},
    },
};

/// Material of a random step: kind, two joints, a place.
pub type Step = (u8, u16, u16, [i8; 3]);

pub fn steps(most: usize) -> impl Strategy<Value = Vec<Step>> {
    proptest::collection::vec(any::<Step>(), 1..most)
}

/// Texts that break careless writers.
const TEXTS: [&str; 10] = [
    "",
    "arm_l",
    "Hand.R.001",
    "q\"uo\\te",
    "line\nbreak\r\ttab",
    "左手 \u{1F600}",
    "\u{0}\u{7f}\u{2028}",
    "// no comment",
    "None",
    "joints: [",
];

/// Parameters of modules in every shape of RON.
const PARAMS: [&str; 9] = [
    "()",
    "(a: 1, uid: \"0000000000000001\", joints: [(uid: 3)])",
    "[1,\n    2, // two\n]",
    "{\"k\": 'c', 'x': '\\''}",
    "r#\"raw \" string\"#",
    "Some(Name(-1.5e3))",
    "\"text, with ) and ]\"",
    "/* a */ 1 // trailing",
    "(t: \"@joint x#0000000000000001 + @this\", u: r#\"@command 'a b'#0000000000000002\"#)",
];

fn a_joint(rig: &Rig, number: u16) -> Uid {
    // One more than there are, so that unknown joints are asked for, too.
    rig.walk().nth(usize::from(number) % (rig.len() + 1)).map_or(Uid(0xdead), |joint| joint.data.uid)
}

/// The operation of a random step, right or wrong.
pub fn operation(rig: &Rig, step: &Step) -> Operation {
    let &(kind, a, b, place) = step;
    let (x, y) = (a_joint(rig, a), a_joint(rig, b));
    let place = Vec3::from(place.map(|p| f32::from(p) / 16.0));
    let parent = if b % 5 == 0 { None } else { Some(y) };
    let text = TEXTS[usize::from(b) % TEXTS.len()].to_owned();
    let odd = b % 2 == 1;
    let uid = Uid(u64::from(a) << 8 | u64::from(kind));
    let edit = |edit| Operation::Edits(vec![edit]);
    let offset = PoseOffset {
        translation: if odd { place } else { Vec3::ZERO },
        rotation: Quat::from_rotation_z(place.y) * Quat::from_rotation_x(place.x),
        scale: if a % 3 == 0 { place.abs() + 0.5 } else { Vec3::ONE },
    };
    let stored = rig.stored_poses().get(usize::from(b) % (rig.stored_poses().len() + 1)).map_or(uid, |pose| pose.uid);
    match kind % 37 {
        0 | 1 => Operation::Place { position: place, parent },
        2 | 3 => Operation::Chain { positions: vec![place, place + Vec3::X, place + Vec3::Y * 2.0], parent },
        4 => Operation::Insert { child: x, position: place },
        5 => Operation::Delete { joints: vec![x, y], keep_children: odd },
        6 => Operation::Move { to: vec![(x, place), (y, place + Vec3::Z)], with_children: odd },
        7 => Operation::Rotate {
            joints: vec![x, y],
            rotation: Quat::from_rotation_y(place.x),
            pivot: odd.then_some(place),
            with_children: a % 2 == 0,
        },
        8 => Operation::Scale {
            joints: vec![x],
            scale: place.abs() + 0.1,
            axes: Quat::IDENTITY,
            pivot: odd.then_some(place),
            with_children: a % 2 == 0,
        },
        9 => Operation::Reparent { joints: vec![x], parent },
        10 => Operation::Labels(vec![(x, text)]),
        11 => Operation::Orient { joints: vec![x, y], along: [Axis::X, Axis::Y, Axis::Z][usize::from(b) % 3] },
        12 => Operation::Mirror { joints: vec![x] },
        13 => Operation::Group { joints: vec![x, y], name: text, color: odd.then_some([0.5, 0.25, 1.0]) },
        14 => Operation::Lock(vec![x], odd),
        15 => edit(RigEdit::AddJoint {
            joint: Box::new(JointData {
                uid,
                label: Some(text),
                kind: NodeKind::Null,
                rest: RestTransform {
                    translation: place,
                    rotation: Quat::from_rotation_x(place.y),
                    scale: place.abs() + 0.5,
                },
                tags: vec![command(Uid(uid.0 + 7), PARAMS[usize::from(a) % PARAMS.len()], None)],
                ..Default::default()
            }),
            parent,
            index: usize::from(b % 4),
        }),
        16 => edit(RigEdit::SetParent { joint: x, parent, index: usize::from(a % 4) }),
        17 => edit(RigEdit::AddTag {
            joint: x,
            tag: Box::new(command(uid, PARAMS[usize::from(b) % PARAMS.len()], odd.then_some(Uid(uid.0 / 2)))),
            index: usize::from(b % 3),
        }),
        18 => edit(RigEdit::AddTag {
            joint: x,
            tag: Box::new(TagData {
                uid,
                enabled: odd,
                comment: text.clone(),
                kind: TagKind::Feature { kind: "limb".into(), name: text.clone(), switch: text.clone(), choice: text },
            }),
            index: 0,
        }),
        19 => match rig.joint(x).and_then(|joint| joint.data.tags.first()) {
            Some(tag) => edit(RigEdit::RemoveTag(x, tag.uid)),
            None => edit(RigEdit::RemoveTag(x, uid)),
        },
        20 => match rig.joint(x).and_then(|joint| joint.data.tags.last()) {
            Some(tag) => {
                edit(RigEdit::SetTag(x, Box::new(TagData { enabled: !tag.enabled, comment: text, ..tag.clone() })))
            }
            None => edit(RigEdit::SetTag(x, Box::new(command(uid, "()", None)))),
        },
        21 => edit(RigEdit::AddLocalGroup(GroupData { uid, name: text, color: [0.1, 0.2, 1e-9], enabled: odd }, 0)),
        22 => match rig.groups().first() {
            Some(group) if odd => edit(RigEdit::RemoveLocalGroup(group.uid)),
            Some(group) => edit(RigEdit::SetLocalGroup(GroupData { name: text, ..group.clone() })),
            None => edit(RigEdit::RemoveLocalGroup(uid)),
        },
        23 => edit(RigEdit::SetAbout(Box::new(RigAbout {
            name: text.clone(),
            description: text.clone(),
            preview: odd.then_some(text),
            ..Default::default()
        }))),
        24 => edit(RigEdit::SetMirror(x, (b % 3 > 0).then_some(y))),
        25 | 26 => Operation::Pose(vec![(x, offset), (y, PoseOffset::from_rotation(offset.rotation))]),
        27 => Operation::ResetPose(if odd { vec![x] } else { Vec::new() }),
        28 => Operation::StorePose(text),
        29 => Operation::ApplyPose(stored),
        30 => Operation::RenamePose(stored, text),
        31 => Operation::DeletePose(stored),
        32 => edit(RigEdit::AddStoredPose(
            // A joint that never was, as after a deletion.
            Box::new(StoredPose {
                uid,
                name: text,
                offsets: [(x, offset), (Uid(0xbeef), offset)].into(),
                ..Default::default()
            }),
            usize::from(b % 3),
        )),
        // Nodes that commands may create one day.
        33 => edit(RigEdit::SetOffset(Uid(0xc0 + u64::from(a % 4)), (b % 3 > 0).then_some(offset))),
        34 | 35 => edit(RigEdit::SetAttributeValue(
            if odd { x } else { Uid(0xc0 + u64::from(a % 4)) },
            text,
            (b % 3 > 0).then_some(place.x),
        )),
        _ => Operation::Edits(vec![
            RigEdit::SetLocked(x, odd),
            RigEdit::Batch(vec![RigEdit::SetLabel(x, Some(text)), RigEdit::RemoveJoint(y)]),
        ]),
    }
}

pub fn command(uid: Uid, params: &str, feature: Option<Uid>) -> TagData {
    let kind = TagKind::Command { module: "a \"module\"".into(), params: params.into(), feature };
    TagData { uid, enabled: uid.0.is_multiple_of(2), comment: String::new(), kind }
}

/// A rig after random steps; those that are refused are passed over.
pub fn random_rig(steps: &[Step]) -> Rig {
    let mut rig = Rig::new(Uid(42), "random");
    let mut uids = UidSource::seeded(5);
    for step in steps {
        let plane = (step.1 % 3 == 0).then(|| MirrorPlane::sagittal(2.0));
        let _ = operation(&rig, step).run(&mut rig, &mut uids, plane);
    }
    rig
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_operation_is_taken_back_exactly(steps in steps(40)) {
        let mut rig = Rig::new(Uid(42), "random");
        let mut uids = UidSource::seeded(5);
        for step in &steps {
            let plane = (step.1 % 3 == 0).then(|| MirrorPlane::sagittal(2.0));
            let operation = operation(&rig, step);
            let before = rig.clone();
            match operation.run(&mut rig, &mut uids, plane) {
                Err(_) => prop_assert_eq!(&rig, &before, "refused, but changed by {:?}", operation),
                Ok(Outcome { edits, inverses, selected, .. }) => {
                    let after = rig.clone();
                    for inverse in &inverses {
                        prop_assert!(rig.apply(inverse).is_ok(), "{:?} of {:?} was refused", inverse, operation);
                    }
                    prop_assert_eq!(&rig, &before, "not taken back: {:?}", operation);
                    for edit in &edits {
                        prop_assert!(rig.apply(edit).is_ok());
                    }
                    prop_assert_eq!(&rig, &after, "not done again: {:?}", operation);
                    prop_assert!(selected.unwrap_or_default().iter().all(|joint| rig.joint(*joint).is_some()));
                }
            }
            let walked: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
            prop_assert_eq!(walked.len(), rig.len(), "a joint cannot be reached");
        }
    }

    #[test]
    fn history_goes_back_to_the_start_and_forth_to_the_end(steps in steps(30)) {
        let mut rig = Rig::new(Uid(42), "random");
        let (mut uids, mut selection, mut history) = (UidSource::seeded(5), Selection::default(), RigHistory::default());
        let mut states = vec![(rig.clone(), selection.clone())];
        for step in &steps {
            let plane = (step.1 % 3 == 0).then(|| MirrorPlane::sagittal(2.0));
            let operation = operation(&rig, step);
            let done = history.edit(&mut rig, &mut selection, &mut uids, plane, &operation).is_ok();
            let now = (rig.clone(), selection.clone());
            // An operation that changed nothing (locking what is locked is an edit, reparenting nobody is not) is no step.
            if history.steps().1 == states.len() {
                prop_assert!(done);
                states.push(now);
            } else {
                prop_assert_eq!(states.last(), Some(&now), "changed without a step: {:?}", operation);
            }
        }
        prop_assert_eq!(history.steps().1, states.len() - 1);
        for state in states.iter().rev().skip(1) {
            prop_assert!(matches!(history.undo(&mut rig, &mut selection), Some(Ok(_))));
            prop_assert_eq!((&rig, &selection), (&state.0, &state.1));
        }
        prop_assert!(history.undo(&mut rig, &mut selection).is_none());
        for state in &states[1..] {
            prop_assert!(matches!(history.redo(&mut rig, &mut selection), Some(Ok(_))));
            prop_assert_eq!((&rig, &selection), (&state.0, &state.1));
        }
        prop_assert!(history.redo(&mut rig, &mut selection).is_none());
    }
}

/// A rig with operations run on it, which must succeed.
pub struct Bench {
    pub rig: Rig,
    pub uids: UidSource,
    pub plane: Option<MirrorPlane>,
}

impl Bench {
    pub fn new() -> Self {
        Self { rig: Rig::new(Uid(1), "rig"), uids: UidSource::seeded(3), plane: None }
    }

    pub fn run(&mut self, operation: Operation) -> Vec<Uid> {
        self.try_run(operation).unwrap().selected.unwrap_or_default()
    }

    pub fn try_run(&mut self, operation: Operation) -> Result<Outcome, OperationError> {
        operation.run(&mut self.rig, &mut self.uids, self.plane)
    }

    pub fn place(&mut self, position: [f32; 3], parent: Option<Uid>) -> Uid {
        self.run(Operation::Place { position: position.into(), parent })[0]
    }

    /// Joints from the given one upwards, the given one first, named by a chain of places from a root.
    pub fn chain(&mut self, places: &[[f32; 3]], parent: Option<Uid>) -> Vec<Uid> {
        let positions = places.iter().map(|place| Vec3::from(*place)).collect();
        let last = self.run(Operation::Chain { positions, parent })[0];
        let above: Vec<Uid> = self.rig.ancestors(last).map(|joint| joint.data.uid).collect();
        let mut chain: Vec<Uid> = above.into_iter().take(places.len() - 1).collect();
        chain.reverse();
        chain.push(last);
        chain
    }

    pub fn at(&self, joint: Uid) -> Vec3 {
        self.rig.position(joint)
    }
}

#[track_caller]
pub fn assert_at(bench: &Bench, joint: Uid, place: impl Into<Vec3>) {
    let (found, place) = (bench.at(joint), place.into());
    assert!(found.distance(place) < 1e-5, "{joint} is at {found}, not at {place}");
}

/// A turned and scaled root with a chain of three and a second child.
fn tree() -> (Bench, Vec<Uid>) {
    let mut bench = Bench::new();
    let root = bench.place([1.0, 0.0, 0.0], None);
    bench.run(Operation::Rotate {
        joints: vec![root],
        rotation: Quat::from_rotation_z(0.7) * Quat::from_rotation_x(0.3),
        pivot: None,
        with_children: true,
    });
    bench.run(Operation::Scale {
        joints: vec![root],
        scale: Vec3::splat(2.0),
        axes: Quat::IDENTITY,
        pivot: None,
        with_children: true,
    });
    let mut joints = vec![root];
    joints.extend(bench.chain(&[[1.0, 1.0, 0.0], [1.0, 2.0, 0.5], [1.5, 3.0, 0.0]], Some(root)));
    joints.push(bench.place([-1.0, 0.0, 0.0], Some(root)));
    (bench, joints)
}

#[test]
fn copies_share_joints_until_they_change() {
    let mut rig = Rig::new(Uid(1), "r");
    for uid in 2..5 {
        let joint = Box::new(JointData { uid: Uid(uid), ..Default::default() });
        rig.apply(&RigEdit::AddJoint { joint, parent: None, index: usize::MAX }).unwrap();
    }
    let mut copy = rig.clone();
    let shared =
        |copy: &Rig| [2, 3, 4].map(|uid| std::ptr::eq(rig.joint(Uid(uid)).unwrap(), copy.joint(Uid(uid)).unwrap()));
    assert_eq!(shared(&copy), [true; 3]);
    copy.apply(&RigEdit::SetLabel(Uid(3), Some("x".to_owned()))).unwrap();
    assert_eq!(shared(&copy), [true, false, true]);
    assert_eq!(rig.joint(Uid(3)).unwrap().data.label, None);
}

#[test]
fn labels_groups_and_locks_are_set_and_taken_away() {
    let (mut bench, joints) = tree();
    bench.run(Operation::Labels(vec![(joints[1], "arm".into())]));
    assert_eq!(bench.rig.find_label("arm"), Some(joints[1]));
    bench.run(Operation::Labels(vec![(joints[1], String::new())]));
    assert_eq!(bench.rig.joint(joints[1]).unwrap().data.label, None);

    let group =
        |joints: &[Uid], name: &str, color| Operation::Group { joints: joints.to_vec(), name: name.into(), color };
    bench.run(group(&joints[1..3], "spine", Some([1.0, 0.0, 0.0])));
    bench.run(group(&joints[3..4], "spine", None));
    assert_eq!(bench.rig.groups().len(), 1);
    let uid = bench.rig.groups()[0].uid;
    assert_eq!(bench.rig.groups()[0].color, [1.0, 0.0, 0.0]);
    assert!(joints[1..4].iter().all(|joint| bench.rig.joint(*joint).unwrap().data.group == Some(uid)));
    assert_eq!(bench.rig.apply(&RigEdit::RemoveLocalGroup(uid)), Err(EditError::GroupInUse(uid)));
    bench.run(group(&joints, "", None));
    assert!(bench.rig.walk().all(|joint| joint.data.group.is_none()));

    bench.run(Operation::Lock(vec![joints[2]], true));
    assert!(bench.rig.joint(joints[2]).unwrap().data.locked);
}

#[test]
fn what_could_not_be_saved_is_refused() {
    let (mut bench, joints) = tree();
    bench.run(Operation::Edits(vec![
        RigEdit::AddLocalGroup(GroupData { uid: Uid(50), name: "g".into(), color: [0.0; 3], enabled: true }, 0),
        RigEdit::AddTag { joint: joints[0], tag: Box::new(command(Uid(51), "()", None)), index: 0 },
    ]));
    let nan = Vec3::new(0.0, f32::NAN, 0.0);
    let before = bench.rig.clone();
    let nowhere = RestTransform::from_translation(nan);
    let unturned = RestTransform { rotation: Quat::from_xyzw(0.0, 0.0, 0.0, 0.5), ..Default::default() };
    let joint = |uid| JointData { uid, ..Default::default() };
    let add = |joint| RigEdit::AddJoint { joint: Box::new(joint), parent: None, index: 0 };
    let tag =
        |uid, params: &str| RigEdit::AddTag { joint: joints[1], tag: Box::new(command(uid, params, None)), index: 0 };
    let painted = |uid, color| GroupData { uid, name: "p".into(), color, enabled: true };
    let weights = |starts: &[u32], values: &[f32]| {
        let weights = Weights { starts: starts.to_vec(), joints: vec![0; values.len()], values: values.to_vec() };
        RigEdit::SetSkin(
            Uid(9),
            Some(Arc::new(SkinData { joints: vec![joints[0]], weights, at_rest: true, ..Default::default() })),
        )
    };
    let table = [
        (RigEdit::SetRest(joints[0], nowhere), EditError::BadTransform(joints[0])),
        (RigEdit::SetRest(joints[0], unturned), EditError::BadTransform(joints[0])),
        (add(JointData { rest: nowhere, ..joint(Uid(5)) }), EditError::BadTransform(Uid(5))),
        (add(joint(joints[1])), EditError::UidInUse(joints[1])),
        (add(joint(Uid(50))), EditError::UidInUse(Uid(50))),
        (add(joint(Uid(51))), EditError::UidInUse(Uid(51))),
        (add(JointData { tags: vec![command(Uid(5), "()", None)], ..joint(Uid(5)) }), EditError::UidInUse(Uid(5))),
        (add(JointData { group: Some(Uid(6)), ..joint(Uid(5)) }), EditError::NoGroup(Uid(6))),
        (RigEdit::RemoveJoint(joints[0]), EditError::HasChildren(joints[0])),
        (RigEdit::SetGroup(joints[0], Some(Uid(6))), EditError::NoGroup(Uid(6))),
        (RigEdit::AddLocalGroup(painted(joints[0], [0.0; 3]), 0), EditError::UidInUse(joints[0])),
        (RigEdit::AddLocalGroup(painted(Uid(7), [0.0, f32::INFINITY, 0.0]), 0), EditError::BadColor(Uid(7))),
        (RigEdit::SetLocalGroup(painted(Uid(50), [f32::NAN; 3])), EditError::BadColor(Uid(50))),
        (tag(Uid(51), "()"), EditError::UidInUse(Uid(51))),
        (tag(joints[2], "()"), EditError::UidInUse(joints[2])),
        (weights(&[0, 1], &[1.0, 1.0]), EditError::BadWeights),
        (weights(&[1, 0, 2], &[1.0, 1.0]), EditError::BadWeights),
        (weights(&[0, 1], &[f32::NAN]), EditError::BadWeights),
    ];
    for (edit, error) in table {
        assert_eq!(bench.rig.apply(&edit), Err(error), "{edit:?}");
        assert_eq!(bench.rig, before);
    }
    let deep = format!("{}{}", "[".repeat(110), "]".repeat(110));
    for params in ["", "(", "1, 2", "a b", "1 /*", deep.as_str()] {
        assert!(matches!(bench.rig.apply(&tag(Uid(8), params)), Err(EditError::BadParams(Uid(8), _))), "{params}");
        assert_eq!(bench.rig, before);
    }
    let joint = joints[1];
    let turn = Quat::from_xyzw(0.0, 0.0, 0.0, 2.0);
    for operation in [
        Operation::Place { position: nan, parent: None },
        Operation::Chain { positions: vec![Vec3::ZERO, nan], parent: None },
        Operation::Insert { child: joint, position: nan },
        Operation::Move { to: vec![(joints[0], Vec3::ZERO), (joint, nan)], with_children: true },
        Operation::Rotate { joints: vec![joint], rotation: turn, pivot: None, with_children: true },
        Operation::Rotate { joints: vec![joint], rotation: Quat::IDENTITY, pivot: Some(nan), with_children: true },
        Operation::Scale {
            joints: vec![joint],
            scale: Vec3::ONE,
            axes: Quat::IDENTITY,
            pivot: Some(nan),
            with_children: false,
        },
        Operation::Group { joints: vec![joint], name: "n".into(), color: Some([f32::NAN; 3]) },
    ] {
        assert!(bench.try_run(operation.clone()).is_err(), "{operation:?}");
        assert_eq!(bench.rig, before, "{operation:?}");
    }
}

#[test]
fn a_chain_of_ten_thousand_joints_is_no_problem() {
    let mut bench = Bench::new();
    let positions = (0..10_000).map(|i| Vec3::Y * i as f32 * 0.001).collect();
    bench.run(Operation::Chain { positions, parent: None });
    let root = bench.rig.roots()[0];
    assert_eq!(bench.rig.hierarchy(root).count(), 10_000);
    bench.run(Operation::Delete { joints: vec![root], keep_children: false });
    assert!(bench.rig.is_empty());
}

#[test]
fn meshes_come_and_go_with_edits_that_undo_each_other() {
    let mut rig = Rig::new(Uid(1), "rig");
    let before = rig.clone();
    let both = RigEdit::Batch(vec![RigEdit::AddMesh(Uid(5)), RigEdit::RemoveMesh(Uid(6))]);
    let inverse = rig.apply(&both).unwrap();
    assert_eq!(inverse, RigEdit::Batch(vec![RigEdit::AddMesh(Uid(6)), RigEdit::RemoveMesh(Uid(5))]));
    assert!(rig == before && both.is_of_motion(), "the rig holds no meshes");
    let changes = |edit: &RigEdit| {
        let mut meshes = std::collections::BTreeMap::from([(Uid(5), false), (Uid(7), true)]);
        edit.mesh_changes(&mut meshes);
        meshes.into_iter().collect::<Vec<_>>()
    };
    assert_eq!(changes(&both), [(Uid(5), true), (Uid(6), false), (Uid(7), true)]);
    assert_eq!(changes(&inverse), [(Uid(5), false), (Uid(6), true), (Uid(7), true)]);
    let written: RigEdit = ron::from_str(&ron::to_string(&both).unwrap()).unwrap();
    assert_eq!(written, both);
}
