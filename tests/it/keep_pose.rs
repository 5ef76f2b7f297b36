//! Poses that mean the same when a rig changes: the bundled biped in a hundred poses, changed in the ways in which riggers
//! change rigs.

use std::{collections::HashSet, sync::Arc};

use bevy::math::{EulerRot, Quat, Vec3};
use rigsmith::{
    modules,
    processor::{Builder, PoseNote, keep_poses},
    rig::{GroupData, JointData, NodeType, PoseOffset, Rig, RigEdit, StoredPose, TagData, TagKind, Uid, UidSource},
    solve::{
        program::{CompileOptions, RigProgram, RigState},
        weights::{multiply, relative},
    },
};

use super::template_text::{Dice, apply};

const POSES: u64 = 100;
/// Metres and degrees.
const NEAR: (f32, f32) = (1e-4, 0.05);

fn biped() -> Rig {
    crate::bench::shipped("biped")
}

fn program(rig: &Rig) -> Arc<RigProgram> {
    let built = Builder::build(rig, &Arc::new(modules::all())).unwrap();
    Arc::new(RigProgram::compile(&built, &CompileOptions::default()).unwrap())
}

/// A rig with poses of random controls, half of them with arms in inverse kinematics.
fn posed(mut rig: Rig) -> Rig {
    let program = program(&rig);
    let controls: Vec<Uid> =
        program.nodes().iter().filter(|node| node.kind == NodeType::Control).map(|node| node.uid).collect();
    let switches: Vec<(Uid, String)> = program
        .attributes()
        .iter()
        .filter(|attribute| attribute.is_settable && attribute.name.contains("ik_fk"))
        .map(|attribute| (program.nodes()[attribute.node].uid, attribute.name.to_string()))
        .collect();
    assert!(switches.len() >= 4, "{:?}", program.attributes().iter().map(|one| &one.name).collect::<Vec<_>>());
    for number in 0..POSES {
        let mut dice = Dice(UidSource::seeded(1000 + number));
        let mut pose =
            StoredPose { uid: Uid(0xbeef_0000 + number), name: format!("pose {number}"), ..Default::default() };
        for _ in 0..16 {
            let mut share = || dice.below(2001) as f32 / 1000.0 - 1.0;
            let turn = Vec3::new(share(), share(), share()) * 0.4;
            let translation = Vec3::new(share(), share(), share()) * 0.03;
            let rotation = Quat::from_euler(EulerRot::XYZ, turn.x, turn.y, turn.z);
            let control = controls[dice.below(controls.len() as u64) as usize];
            pose.offsets.insert(control, PoseOffset { translation, rotation, scale: Vec3::ONE });
        }
        for (node, name) in &switches {
            pose.values.entry(*node).or_default().insert(name.clone(), dice.below(2) as f32);
        }
        apply(&mut rig, RigEdit::AddStoredPose(Box::new(pose), usize::MAX));
    }
    rig
}

fn state(program: &Arc<RigProgram>, pose: &StoredPose) -> RigState {
    let mut state = RigState::new(program.clone());
    for (node, offset) in &pose.offsets {
        if let Some(slot) = program.node(*node) {
            state.set_offset_at(slot, *offset);
        }
    }
    for (node, values) in &pose.values {
        for (name, value) in values {
            let _ = state.set_attribute(*node, name, *value);
        }
    }
    state.evaluate(0.0);
    state
}

/// Compares every joint of every pose with where it stood, and fails if one is off and not listed.
fn check(what: &str, before: &Rig, after: &Rig) -> PoseDeviation {
    let mut kept = after.clone();
    let notes: Vec<PoseNote> = keep_poses(before, &mut kept, &Arc::new(modules::all())).unwrap();
    let (from, to) = (program(before), program(after));
    let rest = |program: &Arc<RigProgram>| state(program, &StoredPose::default());
    let (rest_before, rest_after) = (rest(&from), rest(&to));
    let mut worst = [(0.0f32, 0.0f32); 2];
    let listed: HashSet<(Option<&str>, Uid)> =
        notes.iter().map(|note| (note.pose.as_deref(), note.deviation.joint)).collect();
    for pose in before.stored_poses() {
        let was = state(&from, pose);
        for (rig, worst) in [&kept, after].into_iter().zip(&mut worst) {
            let is_kept = std::ptr::eq(rig, &kept);
            let is = state(&to, rig.stored_pose(pose.uid).unwrap());
            for (slot, node) in to.nodes().iter().enumerate().filter(|(_, node)| node.kind == NodeType::Joint) {
                let Some(known) = from.node(node.uid) else { continue };
                let turned = relative(rest_before.global_at(known), rest_after.global_at(slot));
                assert!(turned.translation.length() < 1e-4, "{what}: the change moves {:?} at rest", node.label);
                let (now, wanted) = (is.global_at(slot), multiply(was.global_at(known), &turned));
                let distance = now.translation.distance(wanted.translation);
                let turn = (now.rotation.conjugate() * wanted.rotation).xyz().length().min(1.0);
                let angle = (turn.asin() * 2.0).to_degrees();
                let is_listed = listed.contains(&(Some(pose.name.as_str()), node.uid));
                if is_kept && !is_listed {
                    assert!(
                        distance <= NEAR.0 && angle <= NEAR.1,
                        "{what}, {}: {:?} is off by {distance} m and {angle}°, and not listed",
                        pose.name,
                        node.label
                    );
                }
                *worst = (worst.0.max(distance), worst.1.max(angle));
            }
        }
    }
    let off: HashSet<&Option<String>> = notes.iter().map(|note| &note.pose).collect();
    let [kept, plain] = worst;
    println!(
        "{what}: {:.3} mm {:.3}° kept, {:.1} mm {:.1}° otherwise, {} joints of {} poses are listed",
        kept.0 * 1e3,
        kept.1,
        plain.0 * 1e3,
        plain.1,
        notes.len(),
        off.len()
    );
    PoseDeviation { plain, off: off.len() }
}

/// Effect of a change on the poses: largest distance and angle where they are left as they are, and the number of poses
/// that cannot be held.
struct PoseDeviation {
    plain: (f32, f32),
    off: usize,
}

impl PoseDeviation {
    /// All poses but a few are as before, and would not be without the keeper.
    fn is_held(&self, but: usize) {
        assert!(self.off <= but, "{} poses are off", self.off);
        assert!(self.plain.0 > NEAR.0 || self.plain.1 > NEAR.1, "the change changes nothing");
    }
}

fn set_params(rig: &mut Rig, tag: Uid, change: impl Fn(&str) -> String) {
    let (joint, found) = rig.find_tag(tag).unwrap();
    let (joint, mut found) = (joint.data.uid, found.clone());
    let TagKind::Command { params, .. } = &mut found.kind else { panic!() };
    let changed = change(params);
    assert_ne!(*params, changed);
    *params = changed;
    apply(rig, RigEdit::SetTag(joint, Box::new(found)));
}

fn remove_tag(rig: &mut Rig, tag: Uid) {
    let joint = rig.find_tag(tag).unwrap().0.data.uid;
    apply(rig, RigEdit::RemoveTag(joint, tag));
}

/// Hangs a joint on another one; it stays where it is.
pub fn reparent(rig: &mut Rig, joint: Uid, parent: Uid) {
    let global = rig.rest_global(joint);
    apply(rig, RigEdit::SetParent { joint, parent: Some(parent), index: usize::MAX });
    let rest = rig.local_rest(Some(parent), &global);
    apply(rig, RigEdit::SetRest(joint, rest));
}

/// Turns a joint's axes; what hangs on it stays where it is.
pub fn flip(rig: &mut Rig, label: &str, turn: Quat) {
    let joint = rig.find_label(label).unwrap();
    let children: Vec<_> = rig.children(Some(joint)).iter().map(|child| (*child, rig.rest_global(*child))).collect();
    let mut rest = rig.joint(joint).unwrap().data.rest;
    rest.rotation = (rest.rotation * turn).normalize();
    apply(rig, RigEdit::SetRest(joint, rest));
    for (child, global) in children {
        let rest = rig.local_rest(Some(joint), &global);
        apply(rig, RigEdit::SetRest(child, rest));
    }
}

/// The command of a module on a joint whose parameters say this.
fn command(rig: &Rig, joint: &str, module: &str, says: &str) -> Uid {
    let joint = rig.joint(rig.find_label(joint).unwrap()).unwrap();
    let is_it = |tag: &&TagData| match &tag.kind {
        TagKind::Command { module: of, params, .. } => of == module && params.contains(says),
        TagKind::Feature { .. } => false,
    };
    let mut found = joint.data.tags.iter().filter(is_it);
    let first = found.next().unwrap_or_else(|| panic!("no {module} with {says}")).uid;
    assert!(found.next().is_none(), "several {module} with {says}");
    first
}

/// Uids of commands and joints of the left arm and the trunk.
struct CharacterUids {
    hand_ik: Uid,
    elbow: Uid,
    pole: Uid,
    pole_spaces: Uid,
    arm_switch: Uid,
    arm_fk: Uid,
    spine_fk: Uid,
    root: Uid,
    torso: Uid,
    hips: Uid,
}

impl CharacterUids {
    fn of(rig: &Rig) -> Self {
        let elbow = command(rig, "hand_l", "control", "\"elbow_l\"");
        Self {
            elbow,
            hand_ik: command(rig, "hand_l", "control", "\"hand_ik_l\""),
            pole: command(rig, "hand_l", "pole_vector", ""),
            pole_spaces: command(rig, "hand_l", "space_switch", &format!("control: \"@command control/hand_l#{elbow}")),
            arm_switch: command(rig, "hand_l", "ik_fk_switch", ""),
            arm_fk: command(rig, "upper_arm_l", "control", "arm_fk_l"),
            spine_fk: command(rig, "spine", "control", "spine_fk"),
            root: command(rig, "hips", "control", "\"root\""),
            torso: command(rig, "hips", "control", "\"torso\""),
            hips: command(rig, "hips", "control", "\"hips\""),
        }
    }
}

/// Renames a joint and a control, moves a joint to a group of its own, and makes a control larger.
pub fn rename_and_regroup(rig: &mut Rig) {
    let (arm, hand) = (rig.find_label("forearm_l").unwrap(), rig.find_label("hand_l").unwrap());
    let known = CharacterUids::of(rig);
    apply(rig, RigEdit::SetLabel(arm, Some("lower_arm_l".into())));
    set_params(rig, known.arm_fk, |params| params.replace("arm_fk_l", "forward_l"));
    let group = GroupData { uid: Uid(4711), name: "other".into(), ..rig.groups()[0].clone() };
    apply(rig, RigEdit::AddLocalGroup(group, usize::MAX));
    apply(rig, RigEdit::SetGroup(hand, Some(Uid(4711))));
    set_params(rig, known.hand_ik, |params| params.replace("relative_size: 0.5", "relative_size: 0.7"));
}

/// Hangs the control of the spine on that of the hips.
pub fn hang_spine_on_hips(rig: &mut Rig) {
    let known = CharacterUids::of(rig);
    set_params(rig, known.spine_fk, |params| params.replace(&known.torso.to_string(), &known.hips.to_string()));
}

/// Hangs a clavicle on another joint of the spine.
pub fn hang_clavicle_lower(rig: &mut Rig) {
    let [clavicle, spine] = ["clavicle_l", "spine_1"].map(|label| rig.find_label(label).unwrap());
    reparent(rig, clavicle, spine);
}

/// Turns the axes of joints in spine, limbs and head by half a turn.
pub fn flip_axes(rig: &mut Rig) {
    for label in ["spine_1", "forearm_l", "hand_r", "index_02_l", "head", "shin_l"] {
        flip(rig, label, Quat::from_euler(EulerRot::XYZ, 0.0, std::f32::consts::PI, 0.0));
    }
}

/// Gives the spine, which the torso moved with the hips, a control of its own.
pub fn split_torso(rig: &mut Rig) {
    let spine = rig.find_label("spine").unwrap();
    let known = CharacterUids::of(rig);
    let root = format!("@command control/hips#{} role:control", known.root);
    let kind = TagKind::Command {
        module: "control".into(),
        params: format!("(parent: \"{root}\", follow: false, creation: (name: \"upper_body\"))"),
        feature: None,
    };
    let upper = TagData { uid: Uid(0x1234), enabled: true, comment: String::new(), kind };
    apply(rig, RigEdit::AddTag { joint: spine, tag: Box::new(upper), index: 0 });
    set_params(rig, known.spine_fk, |params| params.replace(&known.torso.to_string(), "0000000000001234"));
}

/// Inserts a joint with a control between neck and head.
pub fn insert_neck_joint(rig: &mut Rig) {
    let [neck, head] = ["neck", "head"].map(|label| rig.find_label(label).unwrap());
    let mut middle = JointData { uid: Uid(0x77), label: Some("neck_1".into()), ..JointData::default() };
    middle.rest.translation = rig.joint(head).unwrap().data.rest.translation / 2.0;
    let control = TagData {
        uid: Uid(0x78),
        enabled: true,
        comment: String::new(),
        kind: TagKind::Command { module: "control".into(), params: "()".into(), feature: None },
    };
    middle.tags.push(control);
    apply(rig, RigEdit::AddJoint { joint: Box::new(middle), parent: Some(neck), index: usize::MAX });
    reparent(rig, head, Uid(0x77));
}

/// The biped before its left elbow got a pole.
pub fn without_pole() -> Rig {
    let mut rig = biped();
    let known = CharacterUids::of(&rig);
    for tag in [known.pole_spaces, known.pole, known.elbow] {
        remove_tag(&mut rig, tag);
    }
    set_params(&mut rig, known.arm_switch, |params| {
        let start = params.find("pole: ").unwrap();
        let end = start + params[start..].find("\",").unwrap() + 2;
        format!("{}{}", &params[..start], &params[end..])
    });
    rig
}

#[test]
fn names_groups_and_values_leave_poses_alone() {
    let before = posed(biped());
    let mut after = before.clone();
    rename_and_regroup(&mut after);
    let mut kept = after.clone();
    assert!(keep_poses(&before, &mut kept, &Arc::new(modules::all())).unwrap().is_empty());
    assert_eq!(kept, after);
    let plain = check("rename and regroup", &before, &after).plain;
    assert!(plain.0 == 0.0 && plain.1 < 1e-4, "{plain:?}");
}

#[test]
fn controls_below_another_parent_hold_the_joints() {
    let before = posed(biped());
    let mut after = before.clone();
    hang_spine_on_hips(&mut after);
    check("a spine below the hips", &before, &after).is_held(0);
    let mut after = before.clone();
    hang_clavicle_lower(&mut after);
    check("a clavicle below another joint", &before, &after).is_held(0);
}

#[test]
fn flipped_axes_hold_the_joints() {
    let before = posed(biped());
    let mut after = before.clone();
    flip_axes(&mut after);
    check("flipped axes", &before, &after).is_held(6);
    let mut after = before.clone();
    flip(&mut after, "clavicle_r", Quat::from_euler(EulerRot::XYZ, 0.4, -1.2, 0.8));
    flip(&mut after, "neck", Quat::from_euler(EulerRot::XYZ, 1.4, 0.3, -0.8));
    check("turned axes", &before, &after).is_held(2);
}

#[test]
fn a_control_that_is_split_holds_the_joints() {
    let before = posed(biped());
    let mut after = before.clone();
    split_torso(&mut after);
    check("a control in two", &before, &after).is_held(2);
}

#[test]
fn an_inserted_joint_holds_the_others() {
    let before = posed(biped());
    let mut after = before.clone();
    insert_neck_joint(&mut after);
    let found = check("a joint in the neck", &before, &after);
    assert_eq!(found.off, 0);
}

#[test]
fn an_added_pole_holds_the_limb() {
    let before = posed(without_pole());
    let mut after = biped();
    for pose in before.stored_poses() {
        apply(&mut after, RigEdit::AddStoredPose(Box::new(pose.clone()), usize::MAX));
    }
    check("an added pole", &before, &after).is_held(0);
    check("a pole less", &after, &before);
}
