//! Orders of a rig's lists: updates take them over, and edits between two rigs make them.

use bevy::math::Vec3;
use rigsmith::rig::{
    GroupData, JointData, RestTransform, Rig, RigAbout, RigEdit, RigInput, StoredPose, TagData, TagKind, Uid,
    animation::{ClipLayer, RigClip},
    part::{HeaderSocket, PartOption},
    update::{Take, clip_edits, edits_between, update},
};

use super::template_text::apply;

/// Lists of a rig, each of four things.
const LISTS: [&str; 10] =
    ["groups", "inputs", "roots", "children", "tags", "poses", "sockets", "options", "clips", "layers"];

/// Lists that updates leave as they are.
const OF_A_PERSON: [&str; 2] = ["clips", "layers"];

/// Orders of four things.
const ORDERS: [[u64; 4]; 7] =
    [[3, 2, 1, 0], [1, 0, 2, 3], [0, 1, 3, 2], [3, 0, 1, 2], [1, 2, 3, 0], [2, 0, 3, 1], [0, 2, 1, 3]];

/// The rig whose lists have these orders.
fn rig(orders: &[[u64; 4]; LISTS.len()]) -> Rig {
    let mut rig = Rig::new(Uid(1), "lists");
    let [groups, inputs, roots, children, tags, poses, sockets, options, clips, layers] = *orders;
    for number in groups {
        let (uid, name) = (Uid(10 + number), format!("group {number}"));
        apply(&mut rig, RigEdit::AddLocalGroup(GroupData { uid, name, color: [0.5; 3], enabled: true }, usize::MAX));
    }
    let input = |number: u64| {
        let (uid, name) = (Uid(20 + number), format!("input {number}"));
        RigInput { uid, name, rest: RestTransform::default() }
    };
    apply(&mut rig, RigEdit::SetInputs(inputs.map(input).to_vec()));
    for number in roots {
        apply(&mut rig, joint(Uid(30 + number), None, number));
    }
    for number in children {
        apply(&mut rig, joint(Uid(40 + number), Some(Uid(30)), number));
    }
    for number in tags {
        let kind = TagKind::Command { module: "null".into(), params: format!("(size: {number})"), feature: None };
        let tag = Box::new(TagData { uid: Uid(50 + number), enabled: true, comment: String::new(), kind });
        apply(&mut rig, RigEdit::AddTag { joint: Uid(30), tag, index: usize::MAX });
    }
    for number in poses {
        let pose = StoredPose { uid: Uid(60 + number), name: format!("pose {number}"), ..StoredPose::default() };
        apply(&mut rig, RigEdit::AddStoredPose(Box::new(pose), usize::MAX));
    }
    let socket = |number: u64| HeaderSocket {
        name: format!("socket {number}"),
        joint: Uid(30 + number),
        translation: Vec3::ZERO,
        rotation: Vec3::ZERO,
    };
    let option = |number: u64| PartOption {
        name: format!("option {number}"),
        default: number.to_string(),
        description: String::new(),
        form: None,
        sets: Vec::new(),
    };
    let (sockets, options) = (sockets.map(socket).to_vec(), options.map(option).to_vec());
    let about = RigAbout { sockets, options, ..rig.about().clone() };
    apply(&mut rig, RigEdit::SetAbout(Box::new(about)));
    for number in clips {
        let layer = |layer: u64| ClipLayer::empty(Uid(100 + 10 * number + layer));
        let clip = RigClip::new(Uid(70 + number), Uid(80 + number), format!("clip {number}"));
        let clip = RigClip { layers: layers.map(layer).to_vec(), ..clip };
        apply(&mut rig, RigEdit::AddClip(Box::new(clip), usize::MAX));
    }
    rig
}

/// The edit that adds a joint of a group behind its siblings.
fn joint(uid: Uid, parent: Option<Uid>, group: u64) -> RigEdit {
    let data = JointData { uid, label: Some(uid.to_string()), group: Some(Uid(10 + group)), ..JointData::default() };
    RigEdit::AddJoint { joint: Box::new(data), parent, index: usize::MAX }
}

/// Fails unless edits make `to` of `from`, and their inverses bring the first one back.
fn edits_make(from: &Rig, to: &Rig, case: &str) {
    let mut edits = edits_between(from, to).unwrap_or_else(|error| panic!("{case}: {error}"));
    edits.extend(clip_edits(from, to).unwrap_or_else(|error| panic!("{case}: {error}")));
    let mut made = from.clone();
    let back = made.apply(&RigEdit::Batch(edits)).unwrap_or_else(|error| panic!("{case}: {error}"));
    assert_eq!(made, *to, "{case}: the edits");
    apply(&mut made, back);
    assert_eq!(made, *from, "{case}: back");
}

#[test]
fn each_list_can_get_another_order() {
    let plain = [[0, 1, 2, 3]; LISTS.len()];
    let now = rig(&plain);
    for (list, name) in LISTS.iter().enumerate() {
        for order in ORDERS {
            let mut orders = plain;
            orders[list] = order;
            let (file, case) = (rig(&orders), format!("{name} {order:?}"));
            assert_ne!(file, now, "{case}");
            edits_make(&now, &file, &case);
            edits_make(&file, &now, &case);
            let updated = update(Some(&now), &now, &file, Take::Mine).rig;
            assert_eq!(updated, if OF_A_PERSON.contains(name) { now.clone() } else { file.clone() }, "{case}");
            for (base, take) in [(Some(&now), Take::Theirs), (Some(&file), Take::Mine), (None, Take::Theirs)] {
                edits_make(&now, &update(base, &now, &file, take).rig, &case);
            }
        }
    }
}

#[test]
fn all_lists_can_get_other_orders_at_once() {
    let now = rig(&[[0, 1, 2, 3]; LISTS.len()]);
    for first in 0..ORDERS.len() {
        let orders = std::array::from_fn(|list| ORDERS[(first + list) % ORDERS.len()]);
        let file = rig(&orders);
        edits_make(&now, &file, &format!("{orders:?}"));
        edits_make(&file, &now, &format!("back from {orders:?}"));
    }
}

/// Groups that move among groups that come and go, and that change meanwhile.
#[test]
fn groups_move_among_others() {
    let now = rig(&[[0, 1, 2, 3]; LISTS.len()]);
    let mut file = now.clone();
    let joints: Vec<Uid> = file.walk().map(|joint| joint.data.uid).collect();
    for joint in joints {
        apply(&mut file, RigEdit::SetGroup(joint, None));
    }
    for number in 0..4 {
        apply(&mut file, RigEdit::RemoveLocalGroup(Uid(10 + number)));
    }
    // Two have left, one is new, and the one that moved has another name and is disabled.
    let listed = [(13, "group 3", true), (200, "new", true), (11, "moved", false)];
    for (uid, name, enabled) in listed {
        let group = GroupData { uid: Uid(uid), name: name.into(), color: [0.5; 3], enabled };
        apply(&mut file, RigEdit::AddLocalGroup(group, usize::MAX));
    }
    for (joint, group) in [(30, 11), (31, 200), (33, 13), (41, 11)] {
        apply(&mut file, RigEdit::SetGroup(Uid(joint), Some(Uid(group))));
    }
    edits_make(&now, &file, "to the file");
    edits_make(&file, &now, "from the file");
}
