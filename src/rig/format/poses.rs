//! Poses in templates and projects: offsets of joints, values of attributes, and stored poses.

use std::fmt::Write;

use bevy::math::{Quat, Vec3};
use serde::Deserialize;

use super::template::{quaternion, quoted, vector};
use crate::rig::{AttributeValues, PoseOffset, Rig, RigEdit, StoredPose, Uid};

/// A stored pose.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PoseFile {
    pub uid: Uid,
    pub name: String,
    #[serde(default)]
    pub offsets: Vec<OffsetFile>,
    #[serde(default)]
    pub values: Vec<ValueFile>,
}

/// A value of an attribute.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ValueFile {
    pub node: Uid,
    pub name: String,
    pub value: f32,
}

/// An offset of a joint or a created node.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct OffsetFile {
    pub joint: Uid,
    #[serde(default)]
    pub translation: (f32, f32, f32),
    #[serde(default = "no_rotation")]
    pub rotation: (f32, f32, f32, f32),
    #[serde(default = "no_scale")]
    pub scale: (f32, f32, f32),
}

impl OffsetFile {
    /// The offset, checked by nobody yet.
    pub fn offset(&self) -> PoseOffset {
        let (x, y, z, w) = self.rotation;
        PoseOffset {
            translation: <[f32; 3]>::from(self.translation).into(),
            rotation: Quat::from_xyzw(x, y, z, w),
            scale: <[f32; 3]>::from(self.scale).into(),
        }
    }
}

pub(super) fn no_rotation() -> (f32, f32, f32, f32) {
    (0.0, 0.0, 0.0, 1.0)
}

pub(super) fn no_scale() -> (f32, f32, f32) {
    (1.0, 1.0, 1.0)
}

/// Writes a list of attribute values, unless there are none.
pub(super) fn write_values(out: &mut String, values: &AttributeValues, indent: &str) -> std::fmt::Result {
    if values.is_empty() {
        return Ok(());
    }
    writeln!(out, "{indent}values: [")?;
    for (node, values) in values {
        for (name, value) in values {
            writeln!(out, "{indent}    (node: \"{node}\", name: {}, value: {value:?}),", quoted(name))?;
        }
    }
    writeln!(out, "{indent}],")
}

/// Writes offsets, one a line.
pub(super) fn write_offsets<'a>(
    out: &mut String,
    offsets: impl IntoIterator<Item = (&'a Uid, &'a PoseOffset)>,
    indent: &str,
) -> std::fmt::Result {
    for (joint, offset) in offsets {
        write!(out, "{indent}(joint: \"{joint}\"")?;
        if offset.translation != Vec3::ZERO {
            write!(out, ", translation: {}", vector(offset.translation))?;
        }
        if offset.rotation != Quat::IDENTITY {
            write!(out, ", rotation: {}", quaternion(offset.rotation))?;
        }
        if offset.scale != Vec3::ONE {
            write!(out, ", scale: {}", vector(offset.scale))?;
        }
        writeln!(out, "),")?;
    }
    Ok(())
}

/// Writes the stored poses of a rig, as elements of a list.
pub(super) fn write_stored_poses(out: &mut String, rig: &Rig, indent: &str) -> std::fmt::Result {
    rig.stored_poses().iter().try_for_each(|pose| write_stored_pose(out, pose, indent))
}

/// Writes a stored pose, as an element of a list.
pub(super) fn write_stored_pose(out: &mut String, pose: &StoredPose, indent: &str) -> std::fmt::Result {
    writeln!(out, "{indent}(\n{indent}    uid: \"{}\",", pose.uid)?;
    writeln!(out, "{indent}    name: {},\n{indent}    offsets: [", quoted(&pose.name))?;
    write_offsets(out, &pose.offsets, &format!("{indent}        "))?;
    writeln!(out, "{indent}    ],")?;
    write_values(out, &pose.values, &format!("{indent}    "))?;
    writeln!(out, "{indent}),")
}

/// Adds stored poses; `fault` takes the uid of a wrong pose, the place of that uid among equal ones, the field and the
/// message. Offsets of nodes that are not there stay: commands may build them.
pub(super) fn add_poses(rig: &mut Rig, poses: Vec<PoseFile>, fault: &mut dyn FnMut(Uid, usize, &str, String)) {
    for PoseFile { uid, name, offsets, values } in poses {
        let mut stored = StoredPose { uid, name, ..StoredPose::default() };
        for offset in offsets {
            let joint = offset.joint;
            if !offset.offset().is_valid() {
                let message = format!(
                    "the transform of {joint} is not finite or its rotation not of length 1; correct the numbers"
                );
                fault(uid, 0, "offsets", message);
            } else if stored.offsets.insert(joint, offset.offset()).is_some() {
                fault(uid, 0, "offsets", format!("joint {joint} is in the pose twice; keep one of the two"));
            }
        }
        for ValueFile { node, name, value } in values {
            if !value.is_finite() {
                fault(uid, 0, "values", format!("the value of \"{name}\" of {node} is not finite; correct the number"));
            } else if stored.values.entry(node).or_default().insert(name.clone(), value).is_some() {
                fault(uid, 0, "values", format!("\"{name}\" of {node} has two values; keep one of them"));
            }
        }
        if let Err(error) = rig.apply(&RigEdit::AddStoredPose(Box::new(stored), usize::MAX)) {
            fault(uid, 1, "uid", error.to_string());
        }
    }
}
