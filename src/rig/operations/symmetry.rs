//! Symmetry: mirror planes, for live mirroring and for mirroring afterwards.

use std::collections::HashMap;

use bevy::math::{Affine3, Mat3, Vec3};

use super::{Draft, OperationError};
use crate::rig::{EditError, JointData, RigEdit, Uid, label::mirrored_label};

/// A plane to mirror across, in the rig's space.
#[derive(bevy::reflect::Reflect, Debug, Clone, Copy, PartialEq)]
pub struct MirrorPlane {
    /// A point of the plane.
    pub point: Vec3,
    /// Normal of the plane, of unit length.
    pub normal: Vec3,
    /// Largest distance of central joints, which belong to both sides and are put exactly on the plane.
    pub tolerance: f32,
}

impl MirrorPlane {
    /// The plane between the character's left and right, x = 0, with a tolerance that fits a mesh of that height.
    pub fn sagittal(height: f32) -> Self {
        Self { point: Vec3::ZERO, normal: Vec3::X, tolerance: height.abs() * 0.01 }
    }

    /// Signed distance of a point.
    pub fn distance(&self, point: Vec3) -> f32 {
        (point - self.point).dot(self.normal)
    }

    /// The nearest point of the plane.
    pub fn onto(&self, point: Vec3) -> Vec3 {
        point - self.normal * self.distance(point)
    }

    /// The point on the other side.
    pub fn mirrored(&self, point: Vec3) -> Vec3 {
        point - self.normal * (2.0 * self.distance(point))
    }

    /// Returns `true` if a line through these places runs along the plane, like a spine drawn by hand: nowhere further
    /// from it than five tolerances or a sixth of the line's length (but at least one tolerance), on average less than
    /// three tolerances.
    pub fn runs_along(&self, places: &[Vec3]) -> bool {
        let (Some(first), Some(last)) = (places.first(), places.last()) else { return false };
        let length = first.distance(*last);
        let most = (length / 6.0).min(5.0 * self.tolerance).max(self.tolerance);
        let mean = places.iter().map(|place| self.distance(*place)).sum::<f32>() / places.len() as f32;
        places.iter().all(|place| self.distance(*place).abs() <= most) && mean.abs() <= 3.0 * self.tolerance
    }

    /// The reflection of directions.
    pub fn reflection(&self) -> Mat3 {
        let n = self.normal;
        Mat3::from_cols(Vec3::X - n * (2.0 * n.x), Vec3::Y - n * (2.0 * n.y), Vec3::Z - n * (2.0 * n.z))
    }

    /// The transform on the other side: position and local axes mirrored, with the local axis across the plane turned
    /// over, so that the rotation stays proper.
    pub fn mirrored_affine(&self, global: &Affine3) -> Affine3 {
        let reflect = self.reflection();
        Affine3 { matrix3: reflect * global.matrix3 * reflect, translation: self.mirrored(global.translation) }
    }
}

/// Makes or updates the other side of `joints` and of their hierarchies, across the draft's plane (or x = 0).
///
/// A joint on the plane is its own other side; an unpaired joint at the mirrored place is the other side. Labels, local
/// groups with a side in their name, locks and pairs are mirrored; tags stay with the side they were put on.
pub(super) fn mirror(draft: &mut Draft, joints: &[Uid]) -> Result<(), OperationError> {
    let plane = draft.symmetry().unwrap_or_else(|| MirrorPlane::sagittal(height(draft)));
    let mut sources: Vec<Uid> = Vec::new();
    let mut seen = std::collections::HashSet::new();
    for &joint in joints {
        draft.rig().joint(joint).ok_or(EditError::NoJoint(joint))?;
        sources.extend(draft.rig().hierarchy(joint).map(|j| j.data.uid).filter(|uid| seen.insert(*uid)));
    }
    // A hierarchy may hold both sides already (the hips and all below): then the first of a pair is the source.
    let mut target_of: HashMap<Uid, Uid> = HashMap::new();
    let mut is_target = std::collections::HashSet::new();
    for joint in sources {
        if is_target.contains(&joint) {
            continue;
        }
        let Some(source) = draft.rig().joint(joint).cloned() else { continue };
        let global = draft.rig().rest_global(joint);
        if plane.distance(global.translation).abs() <= plane.tolerance {
            target_of.insert(joint, joint);
            let mut centered = global;
            centered.translation = plane.onto(global.translation);
            if centered.translation != global.translation {
                draft.keeping_children(joint, |draft| draft.set_global(joint, &centered))?;
            }
            continue;
        }
        let parent = source.parent.map(|parent| {
            let partner = draft.rig().joint(parent).and_then(|parent| parent.data.mirror);
            target_of.get(&parent).copied().or(partner).unwrap_or(parent)
        });
        let label = source.data.label.as_ref().map(|label| mirrored_label(label).unwrap_or_else(|| label.clone()));
        let mirrored = plane.mirrored_affine(&global);
        let known = source.data.mirror.filter(|partner| draft.rig().joint(*partner).is_some());
        let known = known.or_else(|| standing_at(draft, parent, &plane, mirrored.translation));
        let partner = match known {
            Some(partner) => {
                let now = draft.rig().joint(partner).cloned().unwrap_or_default();
                if now.parent != parent {
                    draft.apply(RigEdit::SetParent { joint: partner, parent, index: usize::MAX })?;
                }
                if source.data.mirror != Some(partner) {
                    draft.apply(RigEdit::SetMirror(joint, Some(partner)))?;
                }
                if now.data.mirror != Some(joint) {
                    draft.apply(RigEdit::SetMirror(partner, Some(joint)))?;
                }
                if now.data.locked != source.data.locked {
                    draft.apply(RigEdit::SetLocked(partner, source.data.locked))?;
                }
                draft.keeping_children(partner, |draft| draft.set_global(partner, &mirrored))?;
                draft.apply(RigEdit::SetLabel(partner, label))?;
                partner
            }
            None => {
                let uid = draft.next_uid();
                let rest = draft.rig().local_rest(parent, &mirrored);
                let data = JointData {
                    uid,
                    label,
                    rest,
                    group: source.data.group,
                    kind: source.data.kind,
                    mirror: Some(joint),
                    locked: source.data.locked,
                    tags: Vec::new(),
                    face: None,
                };
                draft.apply(RigEdit::AddJoint { joint: Box::new(data), parent, index: usize::MAX })?;
                draft.apply(RigEdit::SetMirror(joint, Some(uid)))?;
                uid
            }
        };
        let group = other_group(draft, source.data.group)?.or(source.data.group);
        if draft.rig().joint(partner).is_some_and(|partner| partner.data.group != group) {
            draft.apply(RigEdit::SetGroup(partner, group))?;
        }
        is_target.insert(partner);
        target_of.insert(joint, partner);
    }
    Ok(())
}

/// An unpaired joint below `parent` at the mirrored place: the other side of a skeleton that was not made by mirroring.
fn standing_at(draft: &Draft, parent: Option<Uid>, plane: &MirrorPlane, place: Vec3) -> Option<Uid> {
    let unpaired = |uid: &&Uid| draft.rig().joint(**uid).is_some_and(|joint| joint.data.mirror.is_none());
    let near = draft
        .rig()
        .children(parent)
        .iter()
        .filter(unpaired)
        .map(|uid| (draft.rig().position(*uid).distance(place), *uid));
    let near = near.filter(|(distance, _)| *distance <= plane.tolerance);
    near.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, uid)| uid)
}

/// The group with the mirrored name of a group whose name has a side, created if needed.
fn other_group(draft: &mut Draft, group: Option<Uid>) -> Result<Option<Uid>, OperationError> {
    let Some(group) = group.and_then(|group| draft.rig().group(group)) else { return Ok(None) };
    let Some(name) = mirrored_label(&group.name) else { return Ok(None) };
    super::named_group(draft, &name, None)
}

fn height(draft: &Draft) -> f32 {
    let heights = draft.rig().rest_globals();
    let (low, high) = heights.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), (_, global)| {
        (low.min(global.translation.y), high.max(global.translation.y))
    });
    if low < high { high - low } else { 1.0 }
}
