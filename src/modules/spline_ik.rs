//! `spline_ik`: a chain of joints along a smooth curve.

use crate::{
    parameters,
    processor::{Amount, BuildScope, ModuleError, RigModule},
    rig::{
        Constraint,
        reference::{NodeRef, NodeRefs},
    },
};

parameters! {
    /// Lays a chain of joints along a curve through controls: spines, necks, tails.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::spline_ik::SplineIk};
    /// let params = r#"(
    ///     start: "@joint spine_1#0000000000000001",
    ///     end: "@joint chest#0000000000000005",
    ///     points: "@command control/hips#00000000000000a1 + @command control/chest#00000000000000a2",
    ///     stretch: "stretch",
    /// )"#;
    /// # rigsmith::modules::all().load(SplineIk::NAME, params).map(|_| ()).unwrap();
    /// ```
    pub struct SplineIk {
        /// The first joint of the chain.
        pub start: NodeRefs = NodeRef::this().into(),
        /// The last joint of the chain.
        pub end: NodeRefs = NodeRefs::NONE,
        /// Two or more controls, from start to end: the curve runs through them, first and last give the twist.
        pub points: NodeRefs = NodeRefs::NONE,
        /// The control whose attributes the numbers may name; the last point if left out.
        pub control: NodeRefs = NodeRefs::NONE,
        /// 0 keeps the bones' lengths, 1 spreads the joints over the whole curve; or an attribute's name.
        pub stretch: Amount = Amount::Value(0.0),
        /// Twist along the chain in degrees, on top of that of the first and last points; or an attribute's name.
        pub twist: Amount = Amount::Value(0.0),
        /// 0 leaves the chain as it is, 1 follows the curve; a number or an attribute's name.
        pub weight: Amount = Amount::Value(1.0),
        /// The points are hidden while an attribute as weight is 0: their attribute "visible" is driven.
        pub hide: bool = true,
    }
}

impl RigModule for SplineIk {
    const NAME: &'static str = "spline_ik";
    const DOC: &'static str = "Lays a chain of joints along a smooth curve through controls: spines, necks, tails.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["twist"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/spline_ik.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/spline_ik.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        let start = scope.resolve_one("start", &self.start)?;
        let end = scope.resolve_one("end", &self.end)?;
        let chain = scope.chain(start, end)?;
        if chain.len() < 2 {
            return Err(ModuleError::parameter("end", "is the same joint as start; choose one further down the chain"));
        }
        let points = scope.resolve_all("points", &self.points)?;
        if points.len() < 2 {
            return Err(ModuleError::reference("points", &self.points, "finds one node; a curve needs two or more"));
        }
        if let Some(point) = points.iter().find(|point| chain.contains(point)) {
            let problem = format!("{} is a joint of the chain itself; refer to controls", scope.name(*point));
            return Err(ModuleError::reference("points", &self.points, problem));
        }
        let control = scope.resolve_maybe("control", &self.control)?.or(points.last().copied());
        let weight = scope.amount("weight", &self.weight, control, 0.0..=1.0, 1.0)?;
        if self.hide {
            for point in &points {
                scope.show_where(*point, &weight, [(0.0, 0.0), (1e-3, 1.0)])?;
            }
        }
        let constraint = Constraint::Spline {
            joints: chain.iter().map(|joint| scope.uid(*joint)).collect(),
            points: points.iter().map(|point| scope.uid(*point)).collect(),
            stretch: scope.amount("stretch", &self.stretch, control, 0.0..=1.0, 0.0)?,
            twist: scope.amount("twist", &self.twist, control, f32::NEG_INFINITY..=f32::INFINITY, 0.0)?,
            weight,
        };
        scope.constrain("spline", start, 0, constraint)?;
        Ok(())
    }

    fn mirror(&mut self) {
        self.twist = self.twist.opposite();
    }
}
