//! `orient`, `point`, `scale` and `parent`: nodes that follow the rotation, the place, the scale or the whole transform of
//! targets.

use crate::{
    parameters,
    processor::{Amount, BuildScope, FollowParams, ModuleError, RigModule, TargetParams},
    rig::reference::{NodeRef, NodeRefs},
};

/// Declares a constraint module: its name, its words, and its channels with their defaults.
macro_rules! follow_module {
    (
        $(#[$meta:meta])*
        $Name:ident, $name:literal, $doc:literal,
        $($(#[doc = $channel_doc:literal])+ $channel:ident: $default:expr),+
    ) => {
        parameters! {
            $(#[$meta])*
            pub struct $Name {
                /// Nodes that follow.
                pub node: NodeRefs = NodeRef::this().into(),
                /// Nodes that are followed.
                pub targets: NodeRefs = NodeRefs::NONE,
                /// Share of each target, a number from 0 or the name of an attribute; equal shares if left out.
                pub weights: Vec<Amount> = Vec::new(),
                /// Node with the attributes; missing attributes are added to it.
                pub control: NodeRefs = NodeRefs::NONE,
                $($(#[doc = $channel_doc])+ pub $channel: [bool; 3] = $default,)+
                /// Keeps the node's present place in the space of each target, so that it circles a target that turns;
                /// false: the node lies on its targets.
                pub keep_offset: bool = true,
                /// Adds the node's own pose on top, so that people can still move the node.
                pub keep_pose: bool = false,
                /// Weight of the constraint, a number from 0 to 1 or the name of an attribute of the control.
                pub weight: Amount = Amount::Value(1.0),
            }
        }

        impl RigModule for $Name {
            const NAME: &'static str = $name;
            const DOC: &'static str = $doc;
            const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
            const FORM: Option<&'static str> = Some(include_str!(concat!("../../assets/modules/", $name, ".ui.ron")));
            const ICON: Option<&'static str> = Some(include_str!(concat!("../../assets/modules/", $name, ".svg")));

            fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
                let targets = TargetParams { targets: &self.targets, weights: &self.weights, control: &self.control };
                let mut follow = FollowParams {
                    node: &self.node,
                    targets,
                    translate: [false; 3],
                    rotate: [false; 3],
                    scale: [false; 3],
                    keep_offset: self.keep_offset,
                    keep_pose: self.keep_pose,
                    weight: &self.weight,
                };
                $(follow.$channel = self.$channel;)+
                scope.follow(&follow)
            }
        }
    };
}

follow_module! {
    /// Lets nodes turn like weighted targets. Role: `constraint`, for each node.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::follow::OrientModule};
    /// let params = r#"(node: "@this", targets: "@command control#00000000000000aa", keep_offset: true)"#;
    /// # assert!(rigsmith::modules::all().load(OrientModule::NAME, params).is_ok());
    /// ```
    OrientModule, "orient", "Lets nodes turn like weighted targets.",
    /// Angles about X, Y and Z that follow, in the parent's space.
    rotate: [true; 3]
}

follow_module! {
    /// Lets nodes follow the place of weighted targets. Role: `constraint`, for each node.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::follow::PointModule};
    /// let params = r#"(node: "@this", targets: "@command control#00000000000000aa", keep_offset: true)"#;
    /// # assert!(rigsmith::modules::all().load(PointModule::NAME, params).is_ok());
    /// ```
    PointModule, "point", "Lets nodes follow the place of weighted targets.",
    /// Axes of the translation that follow, in the parent's space.
    translate: [true; 3]
}

follow_module! {
    /// Lets nodes scale like weighted targets. Role: `constraint`, for each node.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::follow::ScaleModule};
    /// let params = r#"(node: "@this", targets: "@command control#00000000000000aa", keep_offset: true)"#;
    /// # assert!(rigsmith::modules::all().load(ScaleModule::NAME, params).is_ok());
    /// ```
    ScaleModule, "scale", "Lets nodes scale like weighted targets.",
    /// Factors along X, Y and Z that follow.
    scale: [true; 3]
}

follow_module! {
    /// Lets nodes follow weighted targets as if they stood on them. Role: `constraint`, for each node.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::follow::ParentModule};
    /// let params = r#"(node: "@this", targets: "@command control#00000000000000aa", keep_offset: true)"#;
    /// # assert!(rigsmith::modules::all().load(ParentModule::NAME, params).is_ok());
    /// ```
    ParentModule, "parent", "Lets nodes follow weighted targets as if they stood on them.",
    /// Axes of the translation that follow, in the parent's space.
    translate: [true; 3],
    /// Angles about X, Y and Z that follow, in the parent's space.
    rotate: [true; 3],
    /// Factors along X, Y and Z that follow.
    scale: [false; 3]
}
