//! `point`: nodes that follow the place of others.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

use crate::{
    processor::{Amount, BuildScope, FollowParams, ModuleError, RigModule, TargetParams},
    rig::reference::{NodeRef, NodeRefs},
};

/// Lets nodes follow the place of weighted targets. Role: `constraint`, for each node.
///
/// ```
/// # use rigsmith::{processor::RigModule, modules::point::PointModule};
/// let params = r#"(node: "@this", targets: "@command control#00000000000000aa", keep_offset: true)"#;
/// # assert!(rigsmith::modules::all().load(PointModule::NAME, params).is_ok());
/// ```
#[derive(Reflect, Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PointModule {
    /// The nodes that follow.
    pub node: NodeRefs,
    /// Nodes that are followed.
    pub targets: NodeRefs,
    /// A share for each target.
    pub weights: Vec<Amount>,
    /// The node with the attributes.
    pub control: NodeRefs,
    /// Axes whose translation follows.
    pub translate: [bool; 3],
    /// True if the node stays where it stands now.
    pub keep_offset: bool,
    /// True if the node's own pose comes on top.
    pub keep_pose: bool,
    /// Weight of the constraint, 0 to 1.
    pub weight: Amount,
}

impl Default for PointModule {
    fn default() -> Self {
        Self {
            node: NodeRef::this().into(),
            targets: NodeRefs::NONE,
            weights: Vec::new(),
            control: NodeRefs::NONE,
            translate: [true; 3],
            keep_offset: true,
            keep_pose: false,
            weight: Amount::Value(1.0),
        }
    }
}

impl RigModule for PointModule {
    const NAME: &'static str = "point";
    const DOC: &'static str = "Lets nodes follow the place of weighted targets.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = &[
        ("node", "The nodes that follow."),
        ("targets", "The nodes that they follow."),
        (
            "weights",
            "For each target its share, a number from 0 or the name of an attribute; all the same if left out.",
        ),
        ("control", "The node that has the attributes; those that it lacks are added."),
        ("translate", "Which axes of the translation follow, in the parent's space."),
        (
            "keep_offset",
            "Keep where the node stands now, in the space of each target: as the target turns, it goes around it.",
        ),
        ("keep_pose", "True: the node's own pose comes on top, so that people can still move it."),
        ("weight", "How much the nodes follow, a number from 0 to 1 or the name of an attribute of the control."),
    ];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/point.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/point.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        scope.follow(&FollowParams {
            node: &self.node,
            targets: TargetParams { targets: &self.targets, weights: &self.weights, control: &self.control },
            translate: self.translate,
            rotate: [false; 3],
            scale: [false; 3],
            keep_offset: self.keep_offset,
            keep_pose: self.keep_pose,
            weight: &self.weight,
        })
    }
}
