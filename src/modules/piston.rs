//! `piston`: two nodes that point at each other.

use glam::{Quat, Vec3};

use crate::{
    mesh::model::Trs,
    parameters,
    processor::{Axis, BuildScope, Creation, ModuleError, NodeId, RigModule, mirrored_direction},
    rig::{AimUp, Constraint, NodeType, Scalar, Target, reference::NodeRefs},
    solve::aim::{Aim, Up},
};

parameters! {
    /// Turns two nodes so that each points at the other: the cylinder and the rod of a piston, a strut, a rope. Each points
    /// at where the other hangs below its own parent. Role: `end`.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::piston::Piston};
    /// let params = r#"(first: "@joint cylinder#0000000000000001", second: "@joint rod#0000000000000002")"#;
    /// # rigsmith::modules::all().load(Piston::NAME, params).map(|_| ()).unwrap();
    /// ```
    pub struct Piston {
        /// The first node, such as the cylinder's joint.
        pub first: NodeRefs = NodeRefs::NONE,
        /// The second node, such as the rod's joint.
        pub second: NodeRefs = NodeRefs::NONE,
        /// The axis of the nodes that is kept up: x, y, z, neg_x, neg_y or neg_z.
        pub up_axis: Axis = Axis::Z,
        /// Direction in the space of each node's parent, as built along the rig's axes, that is up.
        pub direction: Vec3 = Vec3::Z,
    }
}

impl RigModule for Piston {
    const NAME: &'static str = "piston";
    const DOC: &'static str = "Turns two nodes so that each points at the other: pistons, struts, ropes.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["up_axis", "direction"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/piston.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/piston.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        let first = scope.resolve_one("first", &self.first)?;
        let second = scope.resolve_one("second", &self.second)?;
        let way = scope.position(second) - scope.position(first);
        let Some(way) = way.try_normalize() else {
            let problem = format!("stands where {} stands; move one of them", scope.name(first));
            return Err(ModuleError::reference("second", &self.second, problem));
        };
        if scope.is_below(second, first) || scope.is_below(first, second) {
            let problem = "is below the other end, which turns it; hang the two on different nodes";
            return Err(ModuleError::reference("second", &self.second, problem.to_owned()));
        }
        let direction = self.direction.try_normalize().filter(|direction| direction.is_finite()).ok_or_else(|| {
            ModuleError::parameter("direction", "has no direction; write one, such as (0.0, 0.0, 1.0)")
        })?;
        self.point(scope, first, second, way, direction)?;
        self.point(scope, second, first, -way, direction)
    }

    fn mirror(&mut self) {
        self.up_axis = self.up_axis.mirrored();
        self.direction = mirrored_direction(self.direction);
    }
}

impl Piston {
    /// Points a node at another, as it was built towards it.
    fn point(
        &self,
        scope: &mut BuildScope<'_>,
        node: NodeId,
        target: NodeId,
        way: Vec3,
        direction: Vec3,
    ) -> Result<(), ModuleError> {
        let global = scope.global(node);
        let world_up = match scope.parent(node) {
            Some(parent) => AimUp::Axis(scope.uid(parent), scope.global(parent).rotation.inverse() * direction),
            None => AimUp::Direction(direction),
        };
        // Where the other end hangs: both point at once, so neither waits for the other.
        let (place, above) = (scope.global(target), scope.parent(target));
        let end = scope.spawn_at(NodeType::Null, "end", target, 0, above, place, &Creation::default())?;
        // The direction that points as built, whatever the node's axes.
        let aim = (global.rotation.inverse() * way).normalize();
        let solved = Aim { axis: aim, up_axis: self.up_axis.vector() }.solve(
            global.translation,
            global.translation + way,
            Up::Vector(direction),
            global.rotation,
        );
        let offset: Quat = (solved.inverse() * global.rotation).normalize();
        let constraint = Constraint::Aim {
            driven: scope.uid(node),
            targets: vec![Target { node: scope.uid(end), weight: Scalar::Value(1.0), offset: Trs::IDENTITY }],
            aim,
            up: self.up_axis.vector(),
            world_up,
            offset,
            weight: Scalar::Value(1.0),
        };
        scope.constrain("aim", node, 0, constraint)?;
        Ok(())
    }
}
