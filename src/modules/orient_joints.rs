//! `orient_joints`: joints whose axes lie along their bones.

use bevy::reflect::Reflect;
use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use crate::{
    mesh::model::Trs,
    parameters,
    processor::{Axis, BuildScope, ListedNodes, ModuleError, NodeId, RigModule, check_finite, mirrored_direction},
    rig::{
        NodeType,
        reference::{NodeRefs, Source, Top},
    },
    solve::aim::{Aim, Up},
};

/// Direction of the up axis of joints.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UpMode {
    /// Direction in the rig's space.
    #[default]
    Direction,
    /// Normal of the plane in which the chain bends; the direction where it is straight.
    Plane,
    /// Direction towards a node.
    Node,
}

/// Treatment of joints without another below them.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EndMode {
    /// Turned like the joint above.
    #[default]
    Parent,
    /// Turned like the rig's axes.
    Rig,
    /// Left as they are.
    Keep,
}

parameters! {
    /// Turns joints so that one axis lies along the bone and another points up. Joints stay where they are.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::orient_joints::OrientJointsModule};
    /// let params = r#"(joints: "@hierarchy this", along: y, up_axis: z, up: plane, direction: (0.0, 0.0, 1.0))"#;
    /// # assert!(rigsmith::modules::all().load(OrientJointsModule::NAME, params).is_ok());
    /// ```
    pub struct OrientJointsModule {
        /// The joints to turn; this joint and all below it if left out.
        pub joints: NodeRefs = Source::Hierarchy(Top::This).into(),
        /// The axis that points to the next joint: x, y, z, neg_x, neg_y or neg_z.
        pub along: Axis = Axis::Y,
        /// The axis that points up as far as the bone allows.
        pub up_axis: Axis = Axis::Z,
        /// Meaning of up, direction: one of the rig; plane: across the plane in which the chain bends; node: to a node.
        pub up: UpMode = UpMode::Direction,
        /// Up direction in the rig's space; used where a chain is straight, too.
        pub direction: Vec3 = Vec3::Z,
        /// The node that is up where `up` is node.
        pub up_node: NodeRefs = NodeRefs::NONE,
        /// Joints at the end of a chain: parent: turned like the one above; rig: along the rig's axes; keep: as they
        /// are.
        pub end: EndMode = EndMode::Parent,
    }
}

impl RigModule for OrientJointsModule {
    const NAME: &'static str = "orient_joints";
    const DOC: &'static str = "Turns joints so that one axis lies along the bone and another points up.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["along", "up_axis", "direction"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/orient_joints.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/orient_joints.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        if self.along.is_along(self.up_axis) {
            return Err(ModuleError::parameter(
                "up_axis",
                "lies along the bone, too; choose one of the other two axes",
            ));
        }
        check_finite("direction", &self.direction.to_array())?;
        if self.direction == Vec3::ZERO {
            return Err(ModuleError::parameter("direction", "has no direction; write one, such as (0.0, 0.0, 1.0)"));
        }
        let up_node = match self.up {
            UpMode::Node => Some(scope.resolve_one("up_node", &self.up_node)?),
            UpMode::Direction | UpMode::Plane => None,
        };
        let joints = scope.resolve_some("joints", &self.joints)?;
        for joint in &joints {
            scope.need_kind("joints", *joint, &[NodeType::Joint, NodeType::Null], "a joint or null")?;
        }
        let listed: ListedNodes = joints.iter().copied().collect();
        for joint in &joints {
            let global = scope.global(*joint);
            let rotation = match self.next(scope, *joint, &listed) {
                Some(next) => self.along_bone(scope, *joint, next, up_node),
                None => match (self.end, scope.parent(*joint)) {
                    (EndMode::Parent, Some(parent)) => scope.global(parent).rotation,
                    (EndMode::Rig, _) => Quat::IDENTITY,
                    (EndMode::Parent, None) | (EndMode::Keep, _) => global.rotation,
                },
            };
            scope.set_global_alone(*joint, Trs { rotation, ..global });
        }
        Ok(())
    }

    fn mirror(&mut self) {
        self.along = self.along.mirrored();
        self.up_axis = self.up_axis.mirrored();
        self.direction = mirrored_direction(self.direction);
    }
}

impl OrientJointsModule {
    /// The joint that the bone leads to: a child in the list rather than another, and none in the same place.
    fn next(&self, scope: &mut BuildScope<'_>, joint: NodeId, joints: &ListedNodes) -> Option<NodeId> {
        let place = scope.position(joint);
        let mut children = scope.child_joints(joint);
        children.retain(|child| scope.position(*child) != place);
        let listed = children.iter().copied().find(|child| joints.contains(*child));
        listed.or(children.first().copied())
    }

    fn along_bone(&self, scope: &mut BuildScope<'_>, joint: NodeId, next: NodeId, up_node: Option<NodeId>) -> Quat {
        let (from, to, current) = (scope.position(joint), scope.position(next), scope.global(joint).rotation);
        let up = match (self.up, up_node) {
            (UpMode::Node, Some(node)) => Up::Point(scope.position(node)),
            (UpMode::Plane, _) => Up::Vector(self.across(scope, joint, next)),
            _ => Up::Vector(self.direction),
        };
        Aim { axis: self.along.vector(), up_axis: self.up_axis.vector() }.solve(from, to, up, current)
    }

    /// The normal of the plane through the joint, the one above and the next, or through the two next, on the side of
    /// the direction.
    fn across(&self, scope: &mut BuildScope<'_>, joint: NodeId, next: NodeId) -> Vec3 {
        let (here, there) = (scope.position(joint), scope.position(next));
        let after = scope.child_joints(next).first().copied();
        let before = scope.parent(joint);
        for (third, from) in [(after, there), (before, here)] {
            let Some(third) = third else { continue };
            let (bone, other) = (there - here, scope.position(third) - from);
            let normal = bone.cross(other);
            if normal.length() > 1e-4 * bone.length() * other.length() {
                return if normal.dot(self.direction) < 0.0 { -normal } else { normal };
            }
        }
        self.direction
    }
}
