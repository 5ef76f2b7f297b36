//! Common values of the selected joints, and the operations that change them.

use std::{collections::HashMap, f32::consts::PI};

use bevy::{math::EulerRot, prelude::*};

use crate::{
    editor::panels::{
        displayed_rig::{DisplayedRig, Stamp},
        fields::CommonValue,
    },
    rig::{JointData, NodeKind, PoseOffset, Rig, Uid, operations::Operation},
};

/// Values of the selected joints; positions in model units, angles in degrees.
#[derive(Debug, Default)]
pub(super) struct Values {
    made_from: Option<(Stamp, Stamp)>,
    /// The selected joints, the active one last.
    pub joints: Vec<Uid>,
    /// Label, empty for none.
    pub label: CommonValue<String>,
    pub group: CommonValue<Option<Uid>>,
    pub kind: CommonValue<NodeKind>,
    pub locked: CommonValue<bool>,
    /// Marks that one of the joints is not at rest.
    pub posed: bool,
    vectors: [[CommonValue<f32>; 3]; Part::ALL.len()],
    /// Distances at rest from each joint to its children.
    pub lengths: Vec<f32>,
    /// The extent of the skeleton, for the speed of drags.
    extent: f32,
    /// The distance of its farthest joint from the rig's origin.
    far: f32,
    typed: TypedAngles,
}

/// Vector of a joint that the panel shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    /// Rest position in the rig's space.
    Position,
    /// Rest position relative to the parent.
    Local,
    /// Rest rotation relative to the parent: degrees about X, then the turned Y, then the turned Z.
    Rotation,
    /// Rest scale.
    Scale,
    /// Rotation by the pose, in degrees as above, about the joint's own axes at rest.
    PoseRotation,
    /// Translation by the pose, along the joint's own axes at rest.
    PosePosition,
    /// Scale by the pose.
    PoseScale,
}

impl Part {
    const ALL: [Self; 7] = [
        Self::Position,
        Self::Local,
        Self::Rotation,
        Self::Scale,
        Self::PoseRotation,
        Self::PosePosition,
        Self::PoseScale,
    ];
}

/// Angles in degrees as they were last typed: of the many triples for one rotation, the ones that people expect to see.
#[derive(Debug, Clone, Default)]
struct TypedAngles {
    rest: Vec<(Uid, Vec3)>,
    pose: Vec<(Uid, Vec3)>,
}

impl Values {
    /// Reads the values again after a change of the rig or the selection.
    pub fn refresh(&mut self, shown: &DisplayedRig) {
        let key = (shown.stamp(), shown.selection_stamp());
        if self.made_from == Some(key) {
            return;
        }
        let typed = std::mem::take(&mut self.typed);
        *self = Self::of(&shown.rig, &shown.selection.0, typed).unwrap_or_default();
        self.made_from = Some(key);
    }

    fn of(rig: &Rig, selected: &[Uid], typed: TypedAngles) -> Option<Self> {
        let known: Vec<_> = selected.iter().filter_map(|uid| rig.joint(*uid)).collect();
        let data = || known.iter().map(|joint| &joint.data);
        let places: HashMap<Uid, Vec3> =
            rig.rest_globals().into_iter().map(|(uid, global)| (uid, global.translation)).collect();
        let place = |uid: Uid| places.get(&uid).copied().unwrap_or_default();
        let mut vectors = [[CommonValue::default(); 3]; Part::ALL.len()];
        for part in Part::ALL {
            let of = |joint: &JointData| match part {
                Part::Position => place(joint.uid),
                _ => vector(rig, joint, part, &typed),
            };
            let list: Vec<Vec3> = data().map(of).collect();
            for axis in 0..3 {
                vectors[part as usize][axis] = CommonValue::of(list.iter().map(|vector| vector[axis]))?;
            }
        }
        let finite = places.values().filter(|place| place.is_finite());
        let (low, high) =
            finite.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)));
        let bones = known.iter().flat_map(|joint| joint.children.iter().map(|child| (joint.data.uid, *child)));
        Some(Self {
            made_from: None,
            label: CommonValue::of(data().map(|joint| joint.label.clone().unwrap_or_default()))?,
            group: CommonValue::of(data().map(|joint| joint.group))?,
            kind: CommonValue::of(data().map(|joint| joint.kind))?,
            locked: CommonValue::of(data().map(|joint| joint.locked))?,
            posed: data().any(|joint| rig.offset(joint.uid).is_some()),
            vectors,
            lengths: bones.map(|(head, tail)| place(head).distance(place(tail))).collect(),
            extent: (high - low).max_element().max(0.0),
            far: if low.is_finite() { low.abs().max(high.abs()).length() } else { 0.0 },
            joints: data().map(|joint| joint.uid).collect(),
            typed,
        })
    }

    /// Common values of one of the joints' vectors.
    pub fn vector(&self, part: Part) -> [CommonValue<f32>; 3] {
        self.vectors[part as usize]
    }

    /// The operation that sets a number on an axis of one of the vectors of all selected joints.
    pub fn set(&mut self, rig: &Rig, part: Part, axis: usize, number: f32, with_children: bool) -> Operation {
        let joints: Vec<&JointData> =
            self.joints.iter().filter_map(|uid| rig.joint(*uid)).map(|joint| &joint.data).collect();
        let changed = |joint: &JointData| {
            let mut changed = match part {
                Part::Position => rig.position(joint.uid),
                _ => vector(rig, joint, part, &self.typed),
            };
            changed[axis] = number;
            (joint.uid, changed)
        };
        let to: Vec<(Uid, Vec3)> = joints.iter().map(|joint| changed(joint)).collect();
        match part {
            Part::Rotation => self.typed.rest.clone_from(&to),
            Part::PoseRotation => self.typed.pose.clone_from(&to),
            _ => {}
        }
        let pairs = joints.into_iter().zip(to);
        match part {
            Part::Position => Operation::Move { to: pairs.map(|(_, to)| to).collect(), with_children },
            Part::Local | Part::Rotation | Part::Scale => {
                let rest = |(joint, (uid, to)): (&JointData, (Uid, Vec3))| {
                    let mut rest = joint.rest;
                    match part {
                        Part::Local => rest.translation = to,
                        Part::Rotation => rest.rotation = rotation(to),
                        _ => rest.scale = to,
                    }
                    (uid, rest)
                };
                Operation::Rest { to: pairs.map(rest).collect(), with_children }
            }
            Part::PoseRotation | Part::PosePosition | Part::PoseScale => {
                let offset = |(_, (uid, to)): (&JointData, (Uid, Vec3))| {
                    let mut offset = rig.offset(uid).copied().unwrap_or(PoseOffset::IDENTITY);
                    match part {
                        Part::PoseRotation => offset.rotation = rotation(to),
                        Part::PosePosition => offset.translation = to,
                        _ => offset.scale = to,
                    }
                    (uid, offset)
                };
                Operation::Pose(pairs.map(offset).collect())
            }
        }
    }

    /// Size of the skeleton: the distance of its farthest joint from the rig's origin.
    pub fn size(&self) -> f32 {
        self.far
    }

    /// Change per pixel of a drag, in model units.
    pub fn speed(&self) -> f64 {
        let extent = if self.extent.is_finite() && self.extent > 0.0 { self.extent } else { 1.0 };
        f64::from(extent) / 1000.0
    }
}

/// A vector of one joint, relative to its parent.
fn vector(rig: &Rig, joint: &JointData, part: Part, typed: &TypedAngles) -> Vec3 {
    let offset = rig.offset(joint.uid).copied().unwrap_or(PoseOffset::IDENTITY);
    match part {
        Part::Position | Part::Local => joint.rest.translation,
        Part::Rotation => angles(joint.uid, joint.rest.rotation, &typed.rest),
        Part::Scale => joint.rest.scale,
        Part::PoseRotation => angles(joint.uid, offset.rotation, &typed.pose),
        Part::PosePosition => offset.translation,
        Part::PoseScale => offset.scale,
    }
}

/// Angles in degrees; the typed ones, if they still give the same rotation.
fn angles(uid: Uid, turned: Quat, typed: &[(Uid, Vec3)]) -> Vec3 {
    let known = typed.iter().find(|(joint, _)| *joint == uid).map(|(_, angles)| *angles);
    if let Some(known) = known.filter(|known| rotation(*known).dot(turned).abs() > 1.0 - 1e-6) {
        return known;
    }
    let (x, y, z) = turned.to_euler(EulerRot::XYZ);
    Vec3::new(x, y, z) * (180.0 / PI)
}

/// The rotation of angles in degrees.
fn rotation(angles: Vec3) -> Quat {
    let [x, y, z] = (angles * (PI / 180.0)).to_array();
    Quat::from_euler(EulerRot::XYZ, x, y, z).normalize()
}
