//! `path`: nodes on a smooth curve through others.

use glam::Vec3;

use crate::{
    parameters,
    processor::{Amount, Axis, BuildScope, ModuleError, RigModule, check_finite, mirrored_direction},
    rig::{
        Constraint, Scalar,
        reference::{NodeRef, NodeRefs},
    },
};

parameters! {
    /// Puts nodes onto a curve through other nodes: a train on its track, a bead on a string.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::path::Path};
    /// let params = r#"(
    ///     points: "@command control/track#00000000000000aa",
    ///     control: "@command control/train#00000000000000ab",
    ///     share: "along",
    /// )"#;
    /// # rigsmith::modules::all().load(Path::NAME, params).map(|_| ()).unwrap();
    /// ```
    pub struct Path {
        /// The nodes that lie on the curve.
        pub node: NodeRefs = NodeRef::this().into(),
        /// Two or more nodes that the curve runs through, from start to end.
        pub points: NodeRefs = NodeRefs::NONE,
        /// Place of the first node as a share of the curve's length, 0 to 1; a number or an attribute's name.
        pub share: Amount = Amount::Value(0.0),
        /// Distance from each node to the next as a share of the curve's length, -1 to 1.
        pub spacing: f32 = 0.0,
        /// The control whose attributes the numbers may name; the first of the nodes if left out.
        pub control: NodeRefs = NodeRefs::NONE,
        /// True: the nodes turn along the curve.
        pub turn: bool = true,
        /// The axis that points along the curve: x, y, z, neg_x, neg_y or neg_z.
        pub aim: Axis = Axis::Y,
        /// The axis that is kept up.
        pub up_axis: Axis = Axis::Z,
        /// Direction in the rig's space that is up.
        pub direction: Vec3 = Vec3::Y,
        /// 0 leaves the nodes where they are, 1 puts them onto the curve; a number or an attribute's name.
        pub weight: Amount = Amount::Value(1.0),
    }
}

impl RigModule for Path {
    const NAME: &'static str = "path";
    const DOC: &'static str = "Puts nodes onto a smooth curve through other nodes.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["aim", "up_axis", "direction"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/path.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/path.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        if self.aim.is_along(self.up_axis) {
            return Err(ModuleError::parameter("up_axis", "lies along the aim, too; choose one of the other two axes"));
        }
        check_finite("direction", &self.direction.to_array())?;
        scope.in_range("spacing", self.spacing, -1.0..=1.0)?;
        let nodes = scope.resolve_some("node", &self.node)?;
        let points = scope.resolve_all("points", &self.points)?;
        if points.len() < 2 {
            return Err(ModuleError::reference("points", &self.points, "finds one node; a curve needs two or more"));
        }
        if let Some(point) = points.iter().find(|point| nodes.contains(point)) {
            let problem = format!("{} lies on the curve itself; refer to other nodes", scope.name(*point));
            return Err(ModuleError::reference("points", &self.points, problem));
        }
        let control = scope.resolve_maybe("control", &self.control)?.or(nodes.first().copied());
        let share = scope.amount("share", &self.share, control, 0.0..=1.0, 0.0)?;
        let weight = scope.amount("weight", &self.weight, control, 0.0..=1.0, 1.0)?;
        for (node, place) in nodes.into_iter().zip(0..) {
            let constraint = Constraint::Path {
                driven: scope.uid(node),
                points: points.iter().map(|point| scope.uid(*point)).collect(),
                share: shifted(&share, self.spacing * place as f32),
                aim: self.turn.then(|| [self.aim.vector(), self.up_axis.vector()]),
                up: self.direction,
                weight: weight.clone(),
            };
            scope.constrain("path", node, 0, constraint)?;
        }
        Ok(())
    }

    fn mirror(&mut self) {
        self.aim = self.aim.mirrored();
        self.up_axis = self.up_axis.mirrored();
        self.direction = mirrored_direction(self.direction);
    }
}

/// A number with another one added.
fn shifted(scalar: &Scalar, by: f32) -> Scalar {
    match scalar.clone() {
        Scalar::Value(value) => Scalar::Value(value + by),
        Scalar::Attribute { node, name, factor, add } => Scalar::Attribute { node, name, factor, add: add + by },
        other => other,
    }
}
