//! The existing face of a rig: its facial bones, and the ones that a person has edited.

use glam::Vec3;

use crate::{
    algo::face::{
        auto::FaceAnalysis,
        bones::{FaceBone, FaceBoneKind, region_of, side_of},
    },
    rig::{Rig, RigJoint, TagKind, Uid},
};

/// Name of the local group of facial joints.
pub const FACE_GROUP: &str = "face";

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
    /// The facial bones, in the rig's order.
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
}

/// Content of the comment of a facial bone's control tag: the bone's label and its placed position, from which later
/// manual changes are recognised.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlacementRecord {
    pub kind: FaceBoneKind,
    pub label: String,
    pub position: Vec3,
}

impl PlacementRecord {
    pub fn comment(&self) -> String {
        let Vec3 { x, y, z } = self.position;
        format!("{} {}, placed at {x} {y} {z}", kind_words(self.kind), self.label)
    }

    pub fn read(comment: &str) -> Option<Self> {
        let (named, place) = comment.split_once(", placed at ")?;
        let kinds = [FaceBoneKind::Skin, FaceBoneKind::Jaw, FaceBoneKind::Eye];
        let (kind, label) = kinds
            .into_iter()
            .find_map(|kind| Some((kind, named.strip_prefix(kind_words(kind))?.strip_prefix(' ')?.to_owned())))?;
        let mut numbers = place.split(' ').map(|number| number.parse::<f32>().ok());
        let mut next = || numbers.next().flatten();
        Some(Self { kind, label, position: Vec3::new(next()?, next()?, next()?) })
    }
}

fn kind_words(kind: FaceBoneKind) -> &'static str {
    match kind {
        FaceBoneKind::Skin => "face bone",
        FaceBoneKind::Jaw => "jaw bone",
        FaceBoneKind::Eye => "eye bone",
    }
}

impl FaceRig {
    /// Reads the face of a rig. A rig without a face may have a head that one can be attached to.
    pub fn read(rig: &Rig) -> Self {
        let group = rig.groups().iter().find(|group| group.name == FACE_GROUP).map(|group| group.uid);
        let feature = rig.walk().flat_map(|joint| &joint.data.tags).find_map(|tag| match &tag.kind {
            TagKind::Feature { kind, .. } if kind == FACE_GROUP => Some(tag.uid),
            _ => None,
        });
        let by_feature = feature.and_then(|tag| rig.find_tag(tag)).map(|(joint, _)| joint.data.uid);
        let head = by_feature.or_else(|| named(rig, "head"));
        let above = head.and_then(|head| rig.joint(head)).and_then(|joint| joint.parent);
        let neck = above.filter(|above| rig.joint(*above).is_some_and(|joint| is_named(joint, "neck")));
        let bones = match (head, group) {
            (Some(head), Some(_)) => rig
                .children(Some(head))
                .iter()
                .filter_map(|uid| rig.joint(*uid))
                .filter(|joint| joint.data.group == group)
                .map(|joint| known(rig, joint))
                .collect(),
            _ => Vec::new(),
        };
        Self { head, neck, group, feature, bones }
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

fn known(rig: &Rig, joint: &RigJoint) -> PlacedBone {
    let data = &joint.data;
    let label = data.label.clone().unwrap_or_default();
    let position = rig.position(data.uid);
    let placed = data.tags.iter().find_map(|tag| PlacementRecord::read(&tag.comment).map(|placed| (tag, placed)));
    let (kind, touched) = match placed {
        None => (FaceBoneKind::Skin, true),
        Some((tag, placed)) => {
            // Joints store their position relative to the joint above, which costs some bits of precision.
            let slack = 1e-5 * (position.abs().max_element() + placed.position.abs().max_element());
            let moved = (position - placed.position).abs().max_element() > slack;
            let as_made = data.tags.len() == 1 && tag.enabled && joint.children.is_empty() && !data.locked;
            (placed.kind, moved || !as_made || placed.label != label)
        }
    };
    PlacedBone { uid: data.uid, position, kind, label, touched }
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
