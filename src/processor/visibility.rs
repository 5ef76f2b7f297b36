//! Visibility of controls that a module drives.

use super::{BuildScope, ModuleError, world::NodeId};
use crate::rig::{Attribute, AttributeKind, Constraint, KeyEase, NodeType, Output, Scalar, VISIBLE};

impl BuildScope<'_> {
    /// Drives the attribute [`VISIBLE`] of a control by an attribute, along two keys (value of `driver`, visibility) that
    /// hold until the next. A null stands for the control that carries it through nulls alone, such as that of a foot whose
    /// goal hangs below it. Nothing is driven for a constant `driver`, for the control that carries the attribute itself, and
    /// for a control whose visibility is driven already.
    ///
    /// # Errors
    /// See [`BuildScope::constrain`].
    pub fn show_where(&mut self, node: NodeId, driver: &Scalar, keys: [(f32, f32); 2]) -> Result<(), ModuleError> {
        let mut above = Some(node);
        while let Some(at) = above.filter(|at| self.kind(*at) == Some(NodeType::Null)) {
            above = self.parent(at);
        }
        // A null below a joint is no part of a control that happens to carry the joint, such as that of the whole rig.
        let control = above.filter(|at| self.kind(*at) == Some(NodeType::Control));
        let (Some(control), Some(carrier)) = (control, driver.node()) else { return Ok(()) };
        let is_driven = self.attributes(control).has(VISIBLE);
        if is_driven || self.uid(control) == carrier {
            return Ok(());
        }
        let kind = AttributeKind::Number { min: Some(0.0), max: Some(1.0) };
        self.add_attribute(control, Attribute { name: VISIBLE.into(), kind, default: 1.0 })?;
        let output = Output::Attribute(self.uid(control), VISIBLE.into());
        let (driver, keys) = (driver.clone(), keys.to_vec());
        let constraint = Constraint::DrivenKey { driver, keys, ease: KeyEase::Step, output };
        self.constrain("visible", control, 0, constraint).map(|_| ())
    }
}
