//! `half_joint`: joints that turn by half of a bend, so that skin keeps its volume there.

use bevy::prelude::Vec3;

use crate::{
    mesh::model::Trs,
    parameters,
    processor::{BuildScope, Creation, ModuleError, RigModule},
    rig::{
        Constraint, NodeType, Scalar, Target, Uid,
        deform::HALF,
        reference::{NodeRef, NodeRefs},
    },
};

parameters! {
    /// Makes a joint for each of some joints that turns halfway between it and its parent. Roles: `half`, and `unbent` for
    /// the null that a pushed joint needs.
    ///
    /// Skinning gives it the skin that both hold in common: see `algo/weights`.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::half_joint::HalfJoint};
    /// let params = r#"(at: "@joint shin_l#0000000000000002", share: 0.5)"#;
    /// # assert!(rigsmith::modules::all().load(HalfJoint::NAME, params).is_ok());
    /// ```
    pub struct HalfJoint {
        /// The joints that bend, such as a shin; those without a parent are passed over.
        pub at: NodeRefs = NodeRef::this().into(),
        /// Share of the bend, 0 (the parent's side) to 1.
        pub share: f32 = 0.5,
        /// Length by which each joint moves outwards, like the tip of an elbow, as a share of the bone that begins there: at
        /// an angle, and with a share of 0.5, by this times the sine of half the angle.
        pub push: f32 = 0.0,
        /// `true` lets the binding of a mesh set `push`, so that the mesh keeps its volume in the bend.
        pub fit_push: bool = true,
        /// Name, groups and label of the joints that are made; by default those of each joint.
        pub creation: Creation = Creation::default(),
    }
}

impl RigModule for HalfJoint {
    const NAME: &'static str = "half_joint";
    const DOC: &'static str =
        "Makes joints that turn by half of a bend: skin on knees, elbows, hips and shoulders keeps its volume.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/half_joint.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/half_joint.svg"));

    fn set_push(&mut self, push: f32) -> bool {
        if self.fit_push {
            self.push = push;
        }
        self.fit_push
    }

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        scope.in_range("share", self.share, 0.0..=1.0)?;
        scope.in_range("push", self.push, -1.0..=1.0)?;
        for (joint, number) in scope.resolve_some("at", &self.at)?.into_iter().zip(0..) {
            // Nothing bends at a root: a limb that is not connected yet builds, too.
            let Some(parent) = scope.parent(joint) else { continue };
            let creation = scope.creation_for(&self.creation, joint, number);
            let mut targets = [(parent, scope.kept_offset(joint, parent)), (joint, Trs::IDENTITY)];
            let mut rest = Trs::IDENTITY;
            // Two targets beside the joint, along the two bones: their mean leaves the joint when the limb bends. The
            // first one goes with the joint, which may move, and turns with the parent.
            let bone = if self.push == 0.0 { None } else { scope.bone(joint) };
            if let Some(bone) = bone {
                let (here, upper) = (scope.global(joint), scope.global(parent));
                let length = self.push * bone.length();
                let on = (here.translation - upper.translation).normalize_or_zero() * length;
                let back = bone.normalize_or_zero() * -length;
                let point = |offset: Vec3| Trs { translation: here.translation + offset, ..here }.relative_to(&here);
                let name = creation.name.as_ref().map(|name| format!("{name}_unbent"));
                // The label is that of the joint which is asked for.
                let own = Creation { name, label: None, ..creation.clone() };
                let unbent = scope.spawn(NodeType::Null, "unbent", joint, 0, Some(joint), Trs::IDENTITY, &own)?;
                let kept = Target { node: scope.uid(parent), weight: Scalar::Value(1.0), offset: targets[0].1 };
                scope.constrain("unbend", joint, 0, turned(scope.uid(unbent), vec![kept], false))?;
                targets = [(unbent, point(on)), (joint, point(back))];
                rest = point(on.lerp(back, self.share));
            }
            let half = scope.spawn(NodeType::Joint, HALF, joint, 0, Some(joint), rest, &creation)?;
            let weights = [1.0 - self.share, self.share].map(Scalar::Value);
            let targets = targets.into_iter().zip(weights);
            let targets = targets.map(|((node, offset), weight)| Target { node: scope.uid(node), weight, offset });
            let constraint = turned(scope.uid(half), targets.collect(), bone.is_some());
            scope.constrain("turn", joint, 0, constraint)?;
        }
        Ok(())
    }
}

/// A constraint that turns a node with its targets, and moves it with them if `moves`.
fn turned(driven: Uid, targets: Vec<Target>, moves: bool) -> Constraint {
    Constraint::Transform {
        driven,
        targets,
        translate: [moves; 3],
        rotate: [true; 3],
        scale: [false; 3],
        weight: Scalar::Value(1.0),
        keep_pose: false,
    }
}
