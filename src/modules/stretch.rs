//! `stretch`: nodes that grow and shrink with the distance between two others.

use glam::Vec3;

use crate::{
    parameters,
    processor::{Amount, BuildScope, ModuleError, RigModule, mirrored_line},
    rig::{
        Constraint,
        reference::{NodeRef, NodeRefs},
    },
};

parameters! {
    /// Scales nodes along an axis by how far two others are apart, and keeps their volume.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::stretch::Stretch};
    /// let params = r#"(
    ///     start: "@command control/hips#00000000000000a0",
    ///     end: "@command control/chest#00000000000000a1",
    ///     driven: "@joint spine#0000000000000002",
    ///     volume: 1.0,
    /// )"#;
    /// # rigsmith::modules::all().load(Stretch::NAME, params).map(|_| ()).unwrap();
    /// ```
    pub struct Stretch {
        /// The node from which the distance is measured.
        pub start: NodeRefs = NodeRefs::NONE,
        /// The node to which it is measured; not one below what is scaled.
        pub end: NodeRefs = NodeRefs::NONE,
        /// The nodes that are scaled.
        pub driven: NodeRefs = NodeRef::this().into(),
        /// The axis that stretches, in the space of each; the one nearest to the line from start to end if left out.
        pub axis: Option<Vec3> = None,
        /// 0 keeps the other two axes, 1 keeps the volume; a number from -4 to 4 or an attribute's name.
        pub volume: Amount = Amount::Value(1.0),
        /// Lowest factor, above 0.
        pub min: f32 = 0.1,
        /// Highest factor, not below min.
        pub max: f32 = 10.0,
        /// 0 is no stretch, 1 all of it; a number or an attribute's name.
        pub weight: Amount = Amount::Value(1.0),
        /// The control whose attributes the numbers may name; the end if left out.
        pub control: NodeRefs = NodeRefs::NONE,
    }
}

impl RigModule for Stretch {
    const NAME: &'static str = "stretch";
    const DOC: &'static str = "Scales nodes along an axis by how far two others are apart, keeping their volume.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["axis"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/stretch.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/stretch.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        let start = scope.resolve_one("start", &self.start)?;
        let end = scope.resolve_one("end", &self.end)?;
        let driven = scope.resolve_some("driven", &self.driven)?;
        scope.in_range("min", self.min, 1e-3..=1e3)?;
        scope.in_range("max", self.max, self.min..=1e3)?;
        let line = scope.position(end) - scope.position(start);
        let rest = line.length();
        if rest <= 1e-6 {
            return Err(ModuleError::parameter("end", "stands where start stands; choose two nodes that are apart"));
        }
        let control = scope.resolve_maybe("control", &self.control)?.or(Some(end));
        let volume = scope.amount("volume", &self.volume, control, -4.0..=4.0, 1.0)?;
        let weight = scope.amount("weight", &self.weight, control, 0.0..=1.0, 1.0)?;
        for node in driven {
            let axis = match self.axis {
                Some(axis) => axis.try_normalize().ok_or_else(|| {
                    ModuleError::parameter("axis", "has no direction; write one such as (0, 1, 0), or leave it out")
                })?,
                None => nearest_axis(scope.global(node).rotation.inverse() * line),
            };
            let constraint = Constraint::Stretch {
                start: scope.uid(start),
                end: scope.uid(end),
                rest,
                axis,
                volume: volume.clone(),
                range: (self.min, self.max),
                driven: vec![scope.uid(node)],
                weight: weight.clone(),
            };
            scope.constrain("stretch", node, 0, constraint)?;
        }
        Ok(())
    }

    fn mirror(&mut self) {
        self.axis = self.axis.map(mirrored_line);
    }
}

/// X, Y or Z.
fn nearest_axis(direction: Vec3) -> Vec3 {
    let along = direction.abs();
    match along.max_element() {
        most if most == along.x => Vec3::X,
        most if most == along.y => Vec3::Y,
        _ => Vec3::Z,
    }
}
