//! The existing face of a rig: its facial bones, and the ones that a person has edited.

use glam::Vec3;

use crate::{
    algo::face::{
        auto::FaceAnalysis,
        bones::{FaceBone, FaceBoneKind, region_of, side_of},
        expression::BonePose,
    },
    rig::{FaceBonePart, FacePlacement, Rig, RigJoint, TagKind, Uid},
};

/// Name of a new local group of facial joints, and kind of its feature.
pub(super) const FACE: &str = "face";

/// The existing face of a rig.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FaceRig {
    /// The parent joint of the facial bones.
    pub head: Option<Uid>,
    /// The joint above the head, if it is the neck.
    pub neck: Option<Uid>,
    /// The local group.
    pub group: Option<Uid>,
    /// The feature tag.
    pub feature: Option<Uid>,
    /// The facial bones, in the rig's order, and then those that a facial bone carries.
    pub bones: Vec<PlacedBone>,
}

/// A facial bone of a rig.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedBone {
    /// The joint.
    pub uid: Uid,
    /// Rest position, in the rig's space.
    pub position: Vec3,
    /// Function of the bone.
    pub kind: FaceBoneKind,
    /// Label of the bone.
    pub label: String,
    /// Marks a bone that a person made, or has moved, renamed, locked, retagged or given a child.
    pub touched: bool,
    /// Number of the facial bone above; `None` below a joint that is no facial bone.
    pub carrier: Option<usize>,
}

/// The record of a bone's placement, from which later manual changes are recognised.
pub(super) fn placement(bone: &FaceBone, position: Vec3) -> FacePlacement {
    let part = match bone.kind {
        FaceBoneKind::Skin => FaceBonePart::Skin,
        FaceBoneKind::Jaw => FaceBonePart::Jaw,
        FaceBoneKind::Eye => FaceBonePart::Eye,
        FaceBoneKind::Tongue => FaceBonePart::Tongue,
    };
    FacePlacement { part, label: bone.label.clone(), position }
}

fn kind_of(part: FaceBonePart) -> FaceBoneKind {
    match part {
        FaceBonePart::Skin => FaceBoneKind::Skin,
        FaceBonePart::Jaw => FaceBoneKind::Jaw,
        FaceBonePart::Eye => FaceBoneKind::Eye,
        FaceBonePart::Tongue => FaceBoneKind::Tongue,
    }
}

/// The most frequent uid; the first of several.
fn most_frequent(uids: impl Iterator<Item = Uid>) -> Option<Uid> {
    let mut counts: Vec<(Uid, usize)> = Vec::new();
    for uid in uids {
        match counts.iter_mut().find(|(known, _)| *known == uid) {
            Some((_, count)) => *count += 1,
            None => counts.push((uid, 1)),
        }
    }
    counts.into_iter().rev().max_by_key(|(_, count)| *count).map(|(uid, _)| uid)
}

impl FaceRig {
    /// Reads the face of a rig. A rig without a face may have a head that one can be attached to.
    pub fn read(rig: &Rig) -> Self {
        let placed = || rig.walk().filter(|joint| joint.data.face.is_some());
        let group = most_frequent(placed().filter_map(|joint| joint.data.group));
        let feature = most_frequent(placed().flat_map(|joint| &joint.data.tags).filter_map(|tag| match &tag.kind {
            TagKind::Command { feature, .. } => *feature,
            TagKind::Feature { .. } => None,
        }));
        let head = most_frequent(placed().filter_map(|joint| joint.parent)).or_else(|| named(rig, "head"));
        let above = head.and_then(|head| rig.joint(head)).and_then(|joint| joint.parent);
        let neck = above.filter(|above| rig.joint(*above).is_some_and(|joint| is_named(joint, "neck")));
        // Joints that a person puts into the group are facial bones, too.
        let is_facial = |joint: &&RigJoint| match group {
            Some(_) => joint.data.group == group,
            None => joint.data.face.is_some(),
        };
        let around = head.map(|head| rig.children(Some(head))).unwrap_or_default();
        let joints = around.iter().filter_map(|uid| rig.joint(*uid));
        let mut bones: Vec<PlacedBone> = joints.filter(is_facial).map(|joint| placed_bone(rig, joint)).collect();
        if let Some(jaw) = bones.iter().position(|bone| bone.kind == FaceBoneKind::Jaw) {
            let below = rig.children(Some(bones[jaw].uid)).iter().filter_map(|uid| rig.joint(*uid));
            let tongues = below.filter(|joint| is_tongue(joint));
            bones.extend(tongues.map(|joint| PlacedBone { carrier: Some(jaw), ..placed_bone(rig, joint) }));
        }
        Self { head, neck, group, feature, bones }
    }

    /// The poses of the joints, of poses of the bones in head space: a joint moves with the one that carries it.
    pub fn joint_poses(&self, analysis: &FaceAnalysis, poses: &[BonePose]) -> Vec<BonePose> {
        let turn = analysis.axes.rotation();
        let own = |(bone, pose): (&PlacedBone, &BonePose)| {
            let carrier = bone.carrier.and_then(|carrier| Some((self.bones.get(carrier)?, poses.get(carrier)?)));
            match carrier {
                Some((carrier, carried)) => pose.below(turn * bone.position, carried, turn * carrier.position),
                None => *pose,
            }
        };
        self.bones.iter().zip(poses).map(own).collect()
    }

    /// The bones in the form of the algorithms, in head space.
    pub fn face_bones(&self, analysis: &FaceAnalysis) -> Vec<FaceBone> {
        let turn = analysis.axes.rotation();
        let numbered = self.bones.iter().enumerate();
        numbered
            .map(|(number, bone)| {
                let position = turn * bone.position;
                FaceBone {
                    position,
                    kind: bone.kind,
                    region: region_of(position, &analysis.landmarks),
                    side: side_of(position, &analysis.landmarks),
                    label: bone.label.clone(),
                    pair: None,
                    fixed: Some(number),
                }
            })
            .collect()
    }
}

fn placed_bone(rig: &Rig, joint: &RigJoint) -> PlacedBone {
    let data = &joint.data;
    let label = data.label.clone().unwrap_or_default();
    let position = rig.position(data.uid);
    let (kind, touched) = match &data.face {
        None => (FaceBoneKind::Skin, true),
        Some(placed) => {
            // Joints store their position relative to the joint above, which costs some bits of precision.
            let slack = 1e-5 * (position.abs().max_element() + placed.position.abs().max_element());
            let moved = (position - placed.position).abs().max_element() > slack;
            let is_tagged_as_made = data.tags.len() == 1 && data.tags.iter().all(|tag| tag.enabled);
            // The tongue hangs on the jaw.
            let is_as_made = |child: &Uid| {
                let child = rig.joint(*child).filter(|child| placed.part == FaceBonePart::Jaw && is_tongue(child));
                child.is_some_and(|child| !placed_bone(rig, child).touched)
            };
            let as_made = is_tagged_as_made && joint.children.iter().all(is_as_made) && !data.locked;
            (kind_of(placed.part), moved || !as_made || placed.label != label)
        }
    };
    PlacedBone { uid: data.uid, position, kind, label, touched, carrier: None }
}

fn is_tongue(joint: &RigJoint) -> bool {
    joint.data.face.as_ref().is_some_and(|placed| placed.part == FaceBonePart::Tongue)
}

/// The first joint with that name, ignoring prefixes of exporters (`mixamorig:Head`).
fn named(rig: &Rig, name: &str) -> Option<Uid> {
    rig.walk().find(|joint| is_named(joint, name)).map(|joint| joint.data.uid)
}

fn is_named(joint: &RigJoint, name: &str) -> bool {
    let label = joint.data.label.as_deref().unwrap_or_default();
    let own = label.rsplit([':', '|']).next().unwrap_or(label);
    let own = own.trim_end_matches(|c: char| c.is_ascii_digit() || c == '_' || c == '.');
    own.eq_ignore_ascii_case(name)
}
