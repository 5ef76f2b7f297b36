//! Values that a rig does not take as they are written: those of locked or limited channels, and those out of any range.

use std::fmt;

use bevy::prelude::*;

use super::{
    Workbench,
    posing::{PoseError, WriteValue},
};
use crate::rig::{
    BuiltNode, PoseOffset, RestTransform,
    proportion::{ProportionError, Quantity},
};

/// Difference, relative to the value, from which on a value is held.
const SAME: f32 = 1e-4;

/// Written value that limits or channels changed, with the value that the control or attribute has in its place.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldValue {
    /// Name of the node.
    pub node: String,
    /// Name of the channel or attribute.
    pub channel: String,
    /// The value that was written.
    pub written: String,
    /// The value that holds.
    pub held: String,
}

impl fmt::Display for HeldValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { node, channel, written, held } = self;
        write!(
            f,
            "{node}.{channel}={written} is held at {held}, by the locks and limits of the node or by what drives it"
        )
    }
}

/// Node to which a value is written, with its entity.
pub(super) type NodeWrite = (Entity, BuiltNode, WriteValue);

impl Workbench {
    /// Refuses values that make no sense on the rig, such as those where numbers have no digits left.
    pub(super) fn check_range(&self, writes: &[NodeWrite]) -> Result<(), PoseError> {
        let built = self.built().ok_or(PoseError::NotBuilt)?;
        let state = self.runtime()?.state();
        let far = built.nodes.iter().filter_map(|node| Some(state.global(node.uid)?.translation.length()));
        let size = far.filter(|far| far.is_finite()).fold(1e-3, f32::max);
        for (_, node, written) in writes {
            let (vector, quantity) = match written {
                WriteValue::Translate(by) => (by, Quantity::Distance { size }),
                WriteValue::Rotate(by) => (by, Quantity::Degrees),
                WriteValue::Scale(by) => (by, Quantity::Factor),
                WriteValue::Attribute(..) | WriteValue::AttributeText(..) => continue,
            };
            for number in vector.to_array() {
                let Err(reason) = quantity.check(number) else { continue };
                let (node, value) = (node.name.to_string(), vector.to_string());
                return Err(match reason {
                    ProportionError::TooLarge { most, .. } => PoseError::OutOfRange { node, value, most },
                    reason => PoseError::Disproportionate { node, reason },
                });
            }
        }
        Ok(())
    }

    /// The values that are not as they were written. Of several writes of one channel the last counts.
    pub(super) fn held_values(&self, writes: &[NodeWrite]) -> Result<Vec<HeldValue>, PoseError> {
        let state = self.runtime()?.state();
        if let Some(node) = self.built().and_then(|built| {
            let is_lost =
                |node: &&BuiltNode| state.global(node.uid).is_some_and(|global| !global.translation.is_finite());
            built.nodes.iter().find(is_lost)
        }) {
            return Err(PoseError::NotFinite { node: node.name.to_string() });
        }
        let mut held = Vec::new();
        for (number, (entity, node, value)) in writes.iter().enumerate() {
            let is_again = |(other, _, again): &NodeWrite| other == entity && again.channel() == value.channel();
            if writes[number + 1..].iter().any(is_again) {
                continue;
            }
            let mut tell = |written: String, is: String| {
                let (node, channel) = (node.name.to_string(), value.channel().to_owned());
                held.push(HeldValue { node, channel, written, held: is });
            };
            if let WriteValue::Attribute(name, wanted) = value {
                if let Some(is) = state.attribute(node.uid, name).filter(|is| differ(*is, *wanted)) {
                    tell(wanted.to_string(), is.to_string());
                }
                continue;
            }
            let Some(transform) = self.app.world().get::<Transform>(*entity) else { continue };
            let base = state.program().node(node.uid).map_or(node.base, |slot| state.program().nodes()[slot].base);
            let rest = RestTransform::from(base);
            let is = PoseOffset::between(&rest, transform);
            match *value {
                WriteValue::Translate(wanted) if differs(is.translation, wanted) => {
                    tell(vector(wanted), vector(is.translation))
                }
                WriteValue::Scale(wanted) if differs(is.scale, wanted) => tell(vector(wanted), vector(is.scale)),
                WriteValue::Rotate(wanted) if turns(is.rotation, rotation(wanted)) => {
                    let (x, y, z) = is.rotation.to_euler(EulerRot::XYZ);
                    tell(vector(wanted), vector(Vec3::new(x, y, z).map(f32::to_degrees)));
                }
                _ => {}
            }
        }
        Ok(held)
    }
}

/// Rotation by angles in degrees about X, Y and Z in that order.
pub(super) fn rotation(degrees: Vec3) -> Quat {
    let [x, y, z] = degrees.to_array().map(f32::to_radians);
    Quat::from_euler(EulerRot::XYZ, x, y, z)
}

/// True for rotations that differ by more than rounding: the angle itself would be inexact where it is small.
fn turns(is: Quat, wanted: Quat) -> bool {
    let apart = |wanted: Quat| (is - wanted).length();
    apart(wanted).min(apart(-wanted)) > 1e-3
}

fn differ(is: f32, wanted: f32) -> bool {
    (is - wanted).abs() > SAME * wanted.abs().max(1.0)
}

fn differs(is: Vec3, wanted: Vec3) -> bool {
    is.to_array().into_iter().zip(wanted.to_array()).any(|(is, wanted)| differ(is, wanted))
}

fn vector(value: Vec3) -> String {
    // No digits of rounding, and no negative zero.
    let [x, y, z] = value.to_array().map(|number| (number * 1e4).round() / 1e4 + 0.0);
    format!("({x},{y},{z})")
}
