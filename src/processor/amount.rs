//! Parameters that are a fixed number or follow an attribute.

use std::ops::RangeInclusive;

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

use super::{BuildScope, ModuleError, error::number_text, mirror::opposite, world::NodeId};
use crate::{
    mesh::model::Trs,
    rig::{Attribute, AttributeKind, Scalar},
};

/// A number, or the name of an attribute that it follows in every frame. In files either is written as it is:
/// `soft: 0.05` or `soft: "soft"`; `twist: "-twist"` follows the opposite of the attribute, as the other side of a mirrored
/// limb does.
#[derive(Reflect, Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Amount {
    /// Number that stays the same in every frame.
    Value(f32),
    /// Value of the attribute of that name; its opposite if the name begins with [`OPPOSITE`](Self::OPPOSITE).
    Attribute(String),
}

impl Amount {
    /// Sign before the name of an attribute whose opposite counts.
    pub const OPPOSITE: char = '-';
}

impl Default for Amount {
    fn default() -> Self {
        Self::Value(0.0)
    }
}

impl From<f32> for Amount {
    fn from(value: f32) -> Self {
        Self::Value(value)
    }
}

impl From<&str> for Amount {
    fn from(name: &str) -> Self {
        Self::Attribute(name.to_owned())
    }
}

impl BuildScope<'_> {
    /// A parameter that is a number or an attribute of `control`. An attribute that the control does not have yet is
    /// added, so that the number is within `range` (open where that is infinite) and begins as `default`.
    ///
    /// # Errors
    /// A number that is not finite or outside of the range; an attribute without a control to carry it;
    /// [`ModuleError::Off`] if that control is off.
    pub fn amount(
        &mut self,
        parameter: &str,
        amount: &Amount,
        control: Option<NodeId>,
        range: RangeInclusive<f32>,
        default: f32,
    ) -> Result<Scalar, ModuleError> {
        match (amount, control) {
            (Amount::Value(value), _) => {
                self.in_range(parameter, *value, range)?;
                Ok(Scalar::Value(*value))
            }
            (Amount::Attribute(name), Some(control)) => {
                let end = |end: f32| Some(end).filter(|end| end.is_finite());
                let (min, max) = (end(*range.start()), end(*range.end()));
                match name.strip_prefix(Amount::OPPOSITE) {
                    None => self.ensure_attribute(control, name, AttributeKind::Number { min, max }, default),
                    Some(name) => {
                        let kind = AttributeKind::Number { min: max.map(opposite), max: min.map(opposite) };
                        self.ensure_attribute(control, name, kind, opposite(default))?;
                        Ok(Scalar::opposite(self.uid(control), name))
                    }
                }
            }
            (Amount::Attribute(name), None) => Err(match self.trace.optional_off.clone() {
                Some((parameter, off)) if parameter == "control" => ModuleError::Off { parameter, off },
                _ => ModuleError::parameter(
                    parameter,
                    format!(
                        "\"{name}\" is an attribute of a control: say which one with \"control\", or write a number"
                    ),
                ),
            }),
        }
    }

    /// Refuses a number outside of a range.
    ///
    /// # Errors
    /// Says the range; numbers that are not finite are outside of every one.
    pub fn in_range(&self, parameter: &str, value: f32, range: RangeInclusive<f32>) -> Result<(), ModuleError> {
        if value.is_finite() && range.contains(&value) {
            return Ok(());
        }
        let is_above_zero = *range.start() == f32::MIN_POSITIVE;
        let (start, end) = (number_text(*range.start()), number_text(*range.end()));
        let needed = match (range.start().is_finite(), range.end().is_finite()) {
            (true, true) if is_above_zero => format!("a number above 0 that is not above {end}"),
            (true, false) if is_above_zero => "a number above 0".to_owned(),
            (true, true) => format!("a number from {start} to {end}"),
            (true, false) => format!("a number that is not below {start}"),
            (false, true) => format!("a number that is not above {end}"),
            (false, false) => "a finite number".to_owned(),
        };
        Err(ModuleError::OutOfRange { parameter: parameter.to_owned(), value, needed })
    }

    /// An attribute of a node as a number that constraints follow, added with that kind and value if the node does not
    /// have it.
    ///
    /// # Errors
    /// See [`BuildScope::add_attribute`].
    pub fn ensure_attribute(
        &mut self,
        node: NodeId,
        name: &str,
        kind: AttributeKind,
        default: f32,
    ) -> Result<Scalar, ModuleError> {
        if !self.attributes(node).has(name) {
            self.add_attribute(node, Attribute { name: name.into(), kind, default })?;
        }
        Ok(Scalar::attribute(self.uid(node), name))
    }
    /// Transform of a node in the space of another one, as built so far: the offset of a [`Target`](crate::rig::Target)
    /// that keeps the node where it is.
    pub fn kept_offset(&mut self, node: NodeId, target: NodeId) -> Trs {
        let target = self.global(target);
        self.global(node).relative_to(&target)
    }
}
