//! Edits that give a rig a face: joints, pairs, tags, weights; and the removal of the bones that it replaces.

use std::{
    collections::{BTreeMap, HashSet},
    sync::Arc,
};

use glam::{Affine3A, Quat, Vec3};

use super::placed_bones::{FACE, FaceRig, PlacedBone, placement};
use crate::{
    algo::face::{
        auto::{AutoFace, FaceAnalysis},
        bones::{FaceBone, FaceBoneKind, Region},
    },
    mesh::{influences::keep_strongest, model::Weights},
    modules::control::{ControlModule, ShapeAxes},
    processor::differing_params,
    rig::{
        GroupData, JointData, Limits, NodeKind, RestTransform, Rig, RigEdit, RigJoint, SkinData, TagData, TagKind, Uid,
        UidSource,
    },
};

/// The edits that give a rig a face.
pub(super) struct FaceEdits {
    /// Edits in their order.
    pub edits: Vec<RigEdit>,
    /// The joint of each bone.
    pub joints: Vec<Uid>,
}

/// Face to put into the rig.
pub(super) struct NewFace<'a> {
    pub analysis: &'a FaceAnalysis,
    pub face: &'a AutoFace,
    /// The bones of the rig that stay, in the order of the face's fixed places.
    pub kept: &'a [PlacedBone],
    /// The mesh whose weights are set.
    pub mesh: Uid,
}

/// The colour of the local group.
const FACE_COLOR: [f32; 3] = [0.95, 0.62, 0.55];

pub(super) fn face_edits(rig: &Rig, known: &FaceRig, new: &NewFace, uids: &mut UidSource) -> FaceEdits {
    let NewFace { analysis, face, kept, mesh } = *new;
    let mut edits = Vec::new();
    let to_rig = analysis.to_mesh();
    let group = known.group.unwrap_or_else(|| {
        let group = GroupData { uid: uids.next_uid(), name: FACE.to_owned(), color: FACE_COLOR, enabled: true };
        let uid = group.uid;
        edits.push(RigEdit::AddLocalGroup(group, rig.groups().len()));
        uid
    });
    let host = known.head.and_then(|head| rig.joint(head)).map(|joint| joint.data.uid);
    let (neck, head, head_global) = match host {
        Some(head) => (known.neck, head, rig_affine(rig, head)),
        None => skull(rig, analysis, uids, &mut edits),
    };
    let feature = known.feature.unwrap_or_else(|| {
        let (kind, name) = (FACE.to_owned(), "Face".to_owned());
        let kind = TagKind::Feature { kind, name, switch: String::new(), choice: String::new() };
        let tag = TagData { uid: uids.next_uid(), enabled: true, comment: "controls of the face".to_owned(), kind };
        let uid = tag.uid;
        edits.push(RigEdit::AddTag { joint: head, tag: Box::new(tag), index: usize::MAX });
        uid
    });
    let joints: Vec<Uid> = face
        .bones
        .iter()
        .map(|bone| bone.fixed.and_then(|fixed| kept.get(fixed)).map_or_else(|| uids.next_uid(), |bone| bone.uid))
        .collect();
    let eye = analysis.landmarks.eye_distance();
    let jaw = face.bones.iter().position(|bone| bone.kind == FaceBoneKind::Jaw).map(|jaw| {
        let made = Affine3A::from_rotation_translation(to_rig, to_rig * face.bones[jaw].position);
        (joints[jaw], rig.joint(joints[jaw]).map_or(made, |joint| rig_affine(rig, joint.data.uid)))
    });
    for (bone, uid) in face.bones.iter().zip(&joints) {
        if bone.fixed.is_some_and(|fixed| fixed < kept.len()) {
            continue;
        }
        let position = to_rig * bone.position;
        let global = Affine3A::from_rotation_translation(to_rig, position);
        let (parent, parent_global) = match jaw {
            Some((jaw, global)) if bone.kind == FaceBoneKind::Tongue => (jaw, global),
            _ => (head, head_global),
        };
        let kind = TagKind::Command {
            module: "control".to_owned(),
            params: differing_params(&control(bone, eye)),
            feature: Some(feature),
        };
        let tag = TagData { uid: uids.next_uid(), enabled: true, comment: comment(bone), kind };
        let joint = JointData {
            uid: *uid,
            label: Some(bone.label.clone()),
            group: Some(group),
            rest: local(&parent_global, &global),
            tags: vec![tag],
            face: Some(placement(bone, position)),
            ..JointData::default()
        };
        edits.push(RigEdit::AddJoint { joint: Box::new(joint), parent: Some(parent), index: usize::MAX });
    }
    pairs(rig, face, &joints, &mut edits);
    let skin = skin(rig, new, known, neck, head, &joints);
    edits.push(RigEdit::SetSkin(mesh, Some(Arc::new(skin))));
    let stays: Vec<Uid> = kept.iter().map(|bone| bone.uid).collect();
    let gone = known.bones.iter().filter(|bone| !stays.contains(&bone.uid));
    // A joint goes before the one that it hangs on.
    let (carried, others): (Vec<&PlacedBone>, Vec<&PlacedBone>) = gone.partition(|bone| bone.carrier.is_some());
    for bone in carried.into_iter().chain(others) {
        // A partner that stays must not refer to a removed joint.
        let partner = rig.joint(bone.uid).and_then(|joint| joint.data.mirror);
        if let Some(partner) = partner.filter(|partner| stays.contains(partner)) {
            let renewed = joints.contains(&partner)
                && face.bones.iter().zip(&joints).any(|(b, j)| *j == partner && b.pair.is_some());
            if !renewed {
                edits.push(RigEdit::SetMirror(partner, None));
            }
        }
        edits.push(RigEdit::RemoveJoint(bone.uid));
    }
    FaceEdits { edits, joints }
}

fn rig_affine(rig: &Rig, joint: Uid) -> Affine3A {
    let global = rig.rest_global(joint);
    Affine3A { matrix3: global.matrix3.into(), translation: global.translation.into() }
}

/// Makes neck and head. Their Y axes lie along their bones; X and Z are the head's.
fn skull(
    rig: &Rig,
    analysis: &FaceAnalysis,
    uids: &mut UidSource,
    edits: &mut Vec<RigEdit>,
) -> (Option<Uid>, Uid, Affine3A) {
    let to_rig = analysis.to_mesh();
    let bones = &analysis.head_bones;
    let along = |bone: Vec3| match bone.try_normalize() {
        Some(direction) => to_rig * Quat::from_rotation_arc(Vec3::Y, direction),
        None => to_rig,
    };
    let place = |turn: Quat, at: Vec3| Affine3A::from_rotation_translation(turn, to_rig * at);
    let neck_global = place(along(bones.neck.tail - bones.neck.head), bones.neck.head);
    let head_global = place(along(bones.head.tail - bones.head.head), bones.head.head);
    let end_global = place(along(bones.head.tail - bones.head.head), bones.head.tail);
    let mut add = |label: &str, kind: NodeKind, rest: RestTransform, parent: Option<Uid>, index: usize| {
        let joint =
            JointData { uid: uids.next_uid(), label: Some(label.to_owned()), kind, rest, ..JointData::default() };
        let uid = joint.uid;
        edits.push(RigEdit::AddJoint { joint: Box::new(joint), parent, index });
        uid
    };
    let root = Affine3A::IDENTITY;
    let neck = add("neck", NodeKind::Joint, local(&root, &neck_global), None, rig.roots().len());
    let head = add("head", NodeKind::Joint, local(&neck_global, &head_global), Some(neck), 0);
    // The end of the head moves no skin, but it shows the direction of the bone.
    add("head_end", NodeKind::Null, local(&head_global, &end_global), Some(head), 0);
    (Some(neck), head, head_global)
}

fn local(parent: &Affine3A, global: &Affine3A) -> RestTransform {
    let (scale, rotation, translation) = (parent.inverse() * *global).to_scale_rotation_translation();
    let snapped = |factor: f32| if (factor - 1.0).abs() < 1e-5 { 1.0 } else { factor };
    let scale = Vec3::new(snapped(scale.x), snapped(scale.y), snapped(scale.z));
    RestTransform { translation, rotation: rotation.normalize(), scale }
}

/// Pairs mirrored bones.
fn pairs(rig: &Rig, face: &AutoFace, joints: &[Uid], edits: &mut Vec<RigEdit>) {
    for (bone, uid) in face.bones.iter().zip(joints) {
        let Some(partner) = bone.pair.and_then(|pair| joints.get(pair)).copied() else { continue };
        if rig.joint(*uid).and_then(|joint| joint.data.mirror) != Some(partner) {
            edits.push(RigEdit::SetMirror(*uid, Some(partner)));
        }
    }
}

/// Note for people on a bone's control.
fn comment(bone: &FaceBone) -> String {
    let part = match bone.kind {
        FaceBoneKind::Skin => "face",
        FaceBoneKind::Jaw => "jaw",
        FaceBoneKind::Eye => "eye",
        FaceBoneKind::Tongue => "tongue",
    };
    format!("{part} bone {}", bone.label)
}

/// Share of the distance of the eyes' outer corners by which the control of an eye stands before its center: before the lids.
const BEFORE_EYE: f32 = 0.22;

/// A bone's control: its shape, and limits within which skin moves as on a face.
fn control(bone: &FaceBone, eye: f32) -> ControlModule {
    let (shape, size) = match bone.kind {
        FaceBoneKind::Skin => ("sphere", 0.035),
        FaceBoneKind::Jaw => ("half_circle", 0.3),
        FaceBoneKind::Eye => ("eye", 0.18),
        FaceBoneKind::Tongue => ("sphere", 0.06),
    };
    let range = |(low, high): (f32, f32), unit: f32| (Some(rounded(low * unit)), Some(rounded(high * unit)));
    let (translate, rotate) = limits(bone);
    ControlModule {
        shape: shape.to_owned(),
        size: Some(rounded(size * eye)),
        shape_translate: match bone.kind {
            FaceBoneKind::Eye => Vec3::new(0.0, 0.0, rounded(BEFORE_EYE * eye)),
            _ => Vec3::ZERO,
        },
        shape_axes: ShapeAxes::Control,
        offset_group: false,
        keep_pose: true,
        limits: Limits {
            translate: translate.map(|ends| range(ends, eye)),
            rotate: rotate.map(|ends| range(ends, 1.0)),
            ..Limits::default()
        },
        ..ControlModule::default()
    }
}

/// The number with four significant digits.
fn rounded(number: f32) -> f32 {
    format!("{number:.3e}").parse().unwrap_or(number)
}

/// Lowest and highest translation, as a share of the distance of the eyes' outer corners, and rotation in degrees.
fn limits(bone: &FaceBone) -> ([(f32, f32); 3], [(f32, f32); 3]) {
    let both = |reach: f32| (-reach, reach);
    let (side, up, down, depth) = match bone.kind {
        FaceBoneKind::Jaw => return ([both(0.08), (-0.1, 0.04), (-0.06, 0.1)], [(-5.0, 35.0), both(12.0), both(6.0)]),
        FaceBoneKind::Eye => return ([both(0.0); 3], [both(35.0), both(45.0), both(0.0)]),
        FaceBoneKind::Tongue => {
            return ([both(0.2), (-0.2, 0.2), (-0.25, 0.8)], [(-40.0, 40.0), both(30.0), both(30.0)]);
        }
        FaceBoneKind::Skin => match bone.region {
            Region::Brow => (0.1, 0.2, 0.14, 0.06),
            Region::Forehead => (0.06, 0.12, 0.08, 0.04),
            Region::Lid | Region::Eye => (0.06, 0.14, 0.16, 0.08),
            Region::Nose => (0.08, 0.1, 0.06, 0.06),
            Region::Cheek => (0.1, 0.14, 0.1, 0.12),
            Region::Lip => (0.18, 0.2, 0.4, 0.16),
            Region::Jaw => (0.1, 0.12, 0.4, 0.14),
            Region::Temple => (0.06, 0.08, 0.06, 0.04),
        },
    };
    ([both(side), (-down, up), both(depth)], [both(25.0); 3])
}

/// The weights of the whole mesh. On a rig with weights the face takes its share from the existing ones.
fn skin(rig: &Rig, new: &NewFace, known: &FaceRig, neck: Option<Uid>, head: Uid, joints: &[Uid]) -> SkinData {
    let NewFace { analysis, face, mesh, .. } = *new;
    let old = rig.skin(mesh).filter(|skin| skin.weights.len() == analysis.mesh_points);
    let face_joints: HashSet<Uid> = known.bones.iter().map(|bone| bone.uid).chain(joints.iter().copied()).collect();
    let is_own = |uid: &Uid| Some(*uid) == neck || *uid == head || face_joints.contains(uid);
    let subjects = old.map(|skin| skin.subjects.clone()).unwrap_or_default();
    // Joints that commands created are not in the document, whether they are built or not.
    let is_there = |uid: &Uid| rig.joint(*uid).is_some() || subjects.contains_key(uid);
    let body = old.filter(|skin| skin.joints.iter().any(|uid| !is_own(uid) && is_there(uid)));
    let mut table = Table::default();
    let [neck_number, head_number] = [neck.unwrap_or(head), head].map(|uid| table.number(uid));
    let numbers: Vec<u32> = joints.iter().map(|uid| table.number(*uid)).collect();
    let locked = |uid: &Uid| rig.joint(*uid).is_some_and(|joint: &RigJoint| joint.data.locked);
    let mut of_part: Vec<Option<usize>> = vec![None; analysis.mesh_points];
    for point in 0..analysis.points.len() {
        if let Some(slot) = of_part.get_mut(analysis.mesh_point(point)) {
            *slot = Some(point);
        }
    }
    let mut weights = Weights::default();
    let mut shares: BTreeMap<u32, f32> = BTreeMap::new();
    for (point, part) in of_part.iter().enumerate() {
        shares.clear();
        let mut add = |joint: u32, share: f32| *shares.entry(joint).or_default() += share;
        // Locked weights stay; all others share the rest.
        let held: Vec<(Uid, f32)> = old.map_or_else(Vec::new, |skin| {
            let influences = skin.weights.of(point).map(|(joint, weight)| (skin.joints[joint as usize], weight));
            influences.filter(|(uid, _)| is_there(uid)).collect()
        });
        let kept: f32 = held.iter().filter(|(uid, _)| locked(uid)).map(|(_, weight)| weight).sum();
        for (uid, weight) in held.iter().filter(|(uid, _)| locked(uid)) {
            add(table.number(*uid), *weight);
        }
        let free = (1.0 - kept).max(0.0);
        let mut below = 1.0;
        let computed: Vec<(u32, f32)> = part.map_or_else(Vec::new, |part| face.weights.of(part).collect());
        for (joint, weight) in computed.iter().filter(|(joint, _)| *joint >= 2) {
            if let Some(number) = numbers.get(*joint as usize - 2).filter(|_| !locked(&joints[*joint as usize - 2])) {
                add(*number, weight * free);
                below -= weight;
            }
        }
        let below = f32::max(below, 0.0) * free;
        match body {
            Some(_) => {
                // Former facial bones had taken the head's share.
                let others = held.iter().filter(|(uid, _)| !locked(uid));
                let sum: f32 = others.clone().map(|(_, weight)| weight).sum();
                for (uid, weight) in others {
                    let uid = if face_joints.contains(uid) { head } else { *uid };
                    add(table.number(uid), below * weight / sum.max(f32::MIN_POSITIVE));
                }
                if sum <= 0.0 && below > 0.0 {
                    add(head_number, below);
                }
            }
            None => {
                let of_neck: f32 = computed.iter().filter(|(joint, _)| *joint == 0).map(|(_, weight)| weight).sum();
                let of_head: f32 = computed.iter().filter(|(joint, _)| *joint == 1).map(|(_, weight)| weight).sum();
                match part {
                    Some(_) if of_neck + of_head > 0.0 => {
                        add(neck_number, below * of_neck / (of_neck + of_head));
                        add(head_number, below * of_head / (of_neck + of_head));
                    }
                    Some(_) => add(head_number, below),
                    // The rest of a body follows the neck until it gets joints of its own.
                    None => add(neck_number, below),
                }
            }
        }
        weights.push(strongest(&shares));
    }
    SkinData { joints: table.uids, weights, at_rest: true, subjects }
}

/// Joints of the weights, in the order of their first use.
#[derive(Default)]
struct Table {
    uids: Vec<Uid>,
    numbers: BTreeMap<Uid, u32>,
}

impl Table {
    fn number(&mut self, uid: Uid) -> u32 {
        *self.numbers.entry(uid).or_insert_with(|| {
            self.uids.push(uid);
            self.uids.len() as u32 - 1
        })
    }
}

/// The strongest eight influences at most, strongest first, summing to one.
fn strongest(shares: &BTreeMap<u32, f32>) -> Vec<(u32, f32)> {
    let mut list: Vec<(u32, f32)> =
        shares.iter().map(|(joint, share)| (*joint, *share)).filter(|(_, s)| *s > 1e-4).collect();
    keep_strongest(&mut list, 8, 0.0);
    list
}
