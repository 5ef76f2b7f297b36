//! `wheel`: nodes that turn by the way that another one goes.

use glam::Vec3;

use crate::{
    parameters,
    processor::{BuildScope, ModuleError, Resize, RigModule, mirrored_direction},
    rig::{
        Channel, Constraint, Output,
        reference::{NodeRef, NodeRefs},
    },
};

parameters! {
    /// Rolls nodes by the way that a node goes along a direction: a turn for each circumference. The way counts from
    /// where the node was built, so the same place gives the same turn, whatever happened before.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::wheel::Wheel};
    /// let params = r#"(
    ///     source: "@command control/car#00000000000000aa",
    ///     radius: 0.3,
    ///     output: "@joint wheel_l#0000000000000001",
    /// )"#;
    /// # rigsmith::modules::all().load(Wheel::NAME, params).map(|_| ()).unwrap();
    /// ```
    pub struct Wheel {
        /// The node that goes, such as the control of a car.
        pub source: NodeRefs = NodeRefs::NONE,
        /// The node in whose space the way is measured; the rig if left out.
        pub reference: NodeRefs = NodeRefs::NONE,
        /// Direction of the way forwards, in the rig's space as built.
        pub direction: Vec3 = Vec3::Z,
        /// Radius of the wheels, above 0, in the rig's units.
        pub radius: f32 = 0.5,
        /// The nodes that roll.
        pub output: NodeRefs = NodeRef::this().into(),
        /// The channel about which they roll: RotateX, RotateY or RotateZ.
        pub channel: Channel = Channel::RotateX,
        /// True: they roll the other way.
        pub reverse: bool = false,
    }
}

impl RigModule for Wheel {
    const NAME: &'static str = "wheel";
    const DOC: &'static str = "Rolls nodes by the way that another node goes along a direction.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["direction", "reverse"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/wheel.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/wheel.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        let source = scope.resolve_one("source", &self.source)?;
        let reference = scope.resolve_maybe("reference", &self.reference)?;
        scope.in_range("radius", self.radius, f32::MIN_POSITIVE..=f32::INFINITY)?;
        if !matches!(self.channel, Channel::RotateX | Channel::RotateY | Channel::RotateZ) {
            return Err(ModuleError::parameter("channel", "is no turn; write RotateX, RotateY or RotateZ"));
        }
        let direction = self.direction.try_normalize().filter(|direction| direction.is_finite()).ok_or_else(|| {
            ModuleError::parameter("direction", "has no direction; write one, such as (0.0, 0.0, 1.0)")
        })?;
        let axis = match reference {
            Some(node) => (scope.global(node).rotation.inverse() * direction).normalize(),
            None => direction,
        };
        let sense = if self.reverse { -1.0 } else { 1.0 };
        for node in scope.resolve_some("output", &self.output)? {
            let constraint = Constraint::Travel {
                source: scope.uid(source),
                reference: reference.map(|node| scope.uid(node)),
                axis,
                factor: sense * (1.0 / self.radius).to_degrees(),
                output: Output::Channel(scope.uid(node), self.channel),
            };
            scope.constrain("roll", node, 0, constraint)?;
        }
        Ok(())
    }

    fn resize(&mut self, change: &Resize) {
        self.radius *= change.factor;
        self.direction = change.turn * self.direction;
    }

    fn mirror(&mut self) {
        self.direction = mirrored_direction(self.direction);
        if self.channel.is_turned_over() {
            self.reverse = !self.reverse;
        }
    }
}
