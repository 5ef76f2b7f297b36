//! `aim`: nodes that look at others.

use bevy::reflect::Reflect;
use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use crate::{
    parameters,
    processor::{
        Amount, Axis, BuildScope, ModuleError, NodeId, RigModule, TargetParams, check_finite, mirrored_direction,
    },
    rig::{
        AimUp, Constraint, Scalar,
        reference::{NodeRef, NodeRefs},
    },
    solve::aim::{Aim, Up},
};

/// Reference for the up axis.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AimUpMode {
    /// A direction of the rig, or of the up node if there is one.
    #[default]
    Direction,
    /// The up node itself.
    Node,
}

parameters! {
    /// Turns nodes so that an axis points at weighted targets. Role: `constraint`, for each node.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::aim::AimModule};
    /// let params = r#"(targets: "@command control#00000000000000aa", aim: z, up_axis: y, direction: (0.0, 1.0, 0.0))"#;
    /// # assert!(rigsmith::modules::all().load(AimModule::NAME, params).is_ok());
    /// ```
    pub struct AimModule {
        /// The nodes that look.
        pub node: NodeRefs = NodeRef::this().into(),
        /// The nodes that they look at.
        pub targets: NodeRefs = NodeRefs::NONE,
        /// Share of each target: a number from 0 or the name of an attribute; all the same if left out.
        pub weights: Vec<Amount> = Vec::new(),
        /// The node that has the attributes; those that it lacks are added.
        pub control: NodeRefs = NodeRefs::NONE,
        /// The axis that points at the targets: x, y, z, neg_x, neg_y or neg_z.
        pub aim: Axis = Axis::Y,
        /// The axis that is kept up as far as the aim allows.
        pub up_axis: Axis = Axis::Z,
        /// Meaning of up, direction: a direction of the rig, or of the up node; node: the place of the up node.
        pub up: AimUpMode = AimUpMode::Direction,
        /// The direction that is up.
        pub direction: Vec3 = Vec3::Y,
        /// The node that is up, or in whose space the direction is; the rig's if left out.
        pub up_node: NodeRefs = NodeRefs::NONE,
        /// True: the nodes stay turned as they are, and only what the targets do counts.
        pub keep_offset: bool = true,
        /// Weight of the turn, a number from 0 to 1 or the name of an attribute of the control.
        pub weight: Amount = Amount::Value(1.0),
    }
}

impl RigModule for AimModule {
    const NAME: &'static str = "aim";
    const DOC: &'static str = "Turns nodes so that one of their axes points at weighted targets.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["aim", "up_axis", "direction"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/aim.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/aim.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        if self.aim.is_along(self.up_axis) {
            return Err(ModuleError::parameter("up_axis", "lies along the aim, too; choose one of the other two axes"));
        }
        check_finite("direction", &self.direction.to_array())?;
        let Some(direction) = self.direction.try_normalize() else {
            return Err(ModuleError::parameter("direction", "has no direction; write one, such as (0.0, 1.0, 0.0)"));
        };
        let driven = scope.resolve_some("node", &self.node)?;
        let params = TargetParams { targets: &self.targets, weights: &self.weights, control: &self.control };
        let nodes = scope.weighted_nodes(&params)?;
        let up_node = match self.up {
            AimUpMode::Node => Some(scope.resolve_one("up_node", &self.up_node)?),
            AimUpMode::Direction => scope.resolve_maybe("up_node", &self.up_node)?,
        };
        let world_up = match (self.up, up_node) {
            (AimUpMode::Node, Some(node)) => AimUp::Node(scope.uid(node)),
            (AimUpMode::Direction, Some(node)) => AimUp::Axis(scope.uid(node), direction),
            (_, None) => AimUp::Direction(direction),
        };
        let control = scope.resolve_maybe("control", &self.control)?;
        let weight = scope.amount("weight", &self.weight, control, 0.0..=1.0, 1.0)?;
        for node in driven {
            let offset = match self.keep_offset {
                true => self.offset(scope, node, &nodes, up_node, direction),
                false => Quat::IDENTITY,
            };
            let constraint = Constraint::Aim {
                driven: scope.uid(node),
                targets: scope.targets(node, &nodes, false),
                aim: self.aim.vector(),
                up: self.up_axis.vector(),
                world_up: world_up.clone(),
                offset,
                weight: weight.clone(),
            };
            scope.constrain("constraint", node, 0, constraint)?;
        }
        Ok(())
    }

    fn mirror(&mut self) {
        self.aim = self.aim.mirrored();
        self.up_axis = self.up_axis.mirrored();
        self.direction = mirrored_direction(self.direction);
    }
}

impl AimModule {
    /// Rotation of a node beyond the one that the aim alone would give it.
    fn offset(
        &self,
        scope: &mut BuildScope<'_>,
        node: NodeId,
        targets: &[(NodeId, Scalar)],
        up_node: Option<NodeId>,
        direction: Vec3,
    ) -> Quat {
        let (mut sum, mut all) = (Vec3::ZERO, 0.0);
        for (target, weight) in targets {
            let share = scope.built_value(weight).max(0.0);
            sum += scope.position(*target) * share;
            all += share;
        }
        if all <= 0.0 {
            return Quat::IDENTITY;
        }
        let global = scope.global(node);
        let up = match (self.up, up_node) {
            (AimUpMode::Node, Some(node)) => Up::Point(scope.position(node)),
            (AimUpMode::Direction, Some(node)) => Up::Vector(scope.global(node).rotation * direction),
            (_, None) => Up::Vector(direction),
        };
        let aim = Aim { axis: self.aim.vector(), up_axis: self.up_axis.vector() };
        let aimed = aim.solve(global.translation, sum / all, up, global.rotation);
        (aimed.inverse() * global.rotation).normalize()
    }
}
