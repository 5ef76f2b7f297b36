//! `mirror_joints`: the other side of a hierarchy of joints.

use bevy::math::{Mat3, Quat};
use glam::Vec3;

use crate::{
    mesh::model::Trs,
    parameters,
    processor::{
        BuildScope, Creation, ListedNodes, ModuleError, NodeId, RigModule, check_finite, mirrored_direction,
        mirrored_line,
    },
    rig::{
        NodeType,
        label::mirrored_label,
        operations::MirrorPlane,
        reference::{NodeRefs, Source, Top},
    },
};

parameters! {
    /// Makes the mirror image of joints as joints of their own. Role: `joint`.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::mirror_joints::MirrorJointsModule};
    /// let params = r#"(joints: "@hierarchy this", opposed: true)"#;
    /// # assert!(rigsmith::modules::all().load(MirrorJointsModule::NAME, params).is_ok());
    /// ```
    pub struct MirrorJointsModule {
        /// The joints to mirror; this joint and all below it if left out.
        pub joints: NodeRefs = Source::Hierarchy(Top::This).into(),
        /// Parent of the uppermost copies; the parent of each joint if left out.
        pub parent: NodeRefs = NodeRefs::NONE,
        /// A point of the mirror plane, in the rig's units.
        pub point: Vec3 = Vec3::ZERO,
        /// The direction across the plane, in the rig's space; X between left and right.
        pub normal: Vec3 = Vec3::X,
        /// True: the copies' axes point the other way, so that the same turn on both sides is a mirrored movement.
        pub opposed: bool = false,
        /// Name, groups and label; by default each joint's label with the other side in it.
        pub creation: Creation = Creation::default(),
    }
}

impl RigModule for MirrorJointsModule {
    const NAME: &'static str = "mirror_joints";
    const DOC: &'static str = "Makes the mirror image of joints, with labels of the other side.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["point", "normal"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/mirror_joints.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/mirror_joints.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        check_finite("point", &self.point.to_array())?;
        check_finite("normal", &self.normal.to_array())?;
        let Some(normal) = self.normal.try_normalize() else {
            return Err(ModuleError::parameter("normal", "has no direction; write one, such as (1.0, 0.0, 0.0)"));
        };
        let plane = MirrorPlane { point: self.point, normal, tolerance: 0.0 };
        let joints = scope.resolve_some("joints", &self.joints)?;
        let parent = scope.resolve_parent("parent", &self.parent)?;
        let mut copies: Vec<NodeId> = Vec::with_capacity(joints.len());
        let mut copied = ListedNodes::default();
        for (index, joint) in joints.iter().copied().enumerate() {
            let above = match (scope.upper_in(joint, &copied), parent) {
                (Some(upper), _) => Some(copies[upper]),
                (None, Some(parent)) => parent,
                (None, None) => scope.parent(joint),
            };
            let label = scope.label(joint);
            let other = label.as_deref().map(|label| mirrored_label(label).unwrap_or_else(|| label.to_owned()));
            let mut creation = scope.creation_for(&self.creation, joint, index);
            if self.creation.label.is_none() {
                creation.label = other.clone();
            }
            if creation.name.is_none() && other != label.as_deref().map(str::to_owned) {
                creation.name = other;
            }
            let global = self.mirrored(&plane, scope.global(joint));
            let kind = scope.kind(joint).unwrap_or(NodeType::Joint);
            let copy = scope.spawn_at(kind, "joint", joint, 0, above, global, &creation)?;
            copies.push(copy);
            copied.push(joint);
        }
        Ok(())
    }

    fn mirror(&mut self) {
        self.point = mirrored_direction(self.point);
        self.normal = mirrored_line(self.normal);
    }
}

impl MirrorJointsModule {
    fn mirrored(&self, plane: &MirrorPlane, global: Trs) -> Trs {
        let reflect = plane.reflection();
        // A reflected frame is left-handed; turning over all its axes, or the one across the plane, mends that.
        let back = if self.opposed { Mat3::from_diagonal(Vec3::NEG_ONE) } else { reflect };
        let rotation = Quat::from_mat3(&(reflect * Mat3::from_quat(global.rotation) * back)).normalize();
        Trs { translation: plane.mirrored(global.translation), rotation, scale: global.scale }
    }
}
