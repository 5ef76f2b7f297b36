//! `duplicate_chain`: a copy of a chain, such as one that is moved by hand and one that reaches.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

use crate::{
    parameters,
    processor::{BuildScope, Creation, ListedNodes, ModuleError, NodeId, RigModule},
    rig::{
        NodeType,
        reference::{NodeRefs, Source, Top},
    },
};

/// Kind of the nodes of a copy.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CopyKind {
    /// Nodes that carry others and move no mesh.
    #[default]
    Null,
    /// Joints.
    Joint,
}

parameters! {
    /// Copies nodes with their hierarchy. Role: `copy`.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::duplicate_chain::DuplicateChainModule};
    /// let params = r#"(joints: "@hierarchy this", suffix: "ik")"#;
    /// # assert!(rigsmith::modules::all().load(DuplicateChainModule::NAME, params).is_ok());
    /// ```
    pub struct DuplicateChainModule {
        /// The nodes to copy; this joint and all below it if left out.
        pub joints: NodeRefs = Source::Hierarchy(Top::This).into(),
        /// Parent of the uppermost copies; the parent of each node if left out.
        pub parent: NodeRefs = NodeRefs::NONE,
        /// Kind of the copies, null: nodes that move no mesh; joint: joints.
        pub kind: CopyKind = CopyKind::Null,
        /// Ending of the names of the copies.
        pub suffix: String = "copy".to_owned(),
        /// Name, groups and label; by default those of each node.
        pub creation: Creation = Creation::default(),
    }
}

impl RigModule for DuplicateChainModule {
    const NAME: &'static str = "duplicate_chain";
    const DOC: &'static str = "Copies nodes with their hierarchy, such as one chain to pose and one that reaches.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/duplicate_chain.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/duplicate_chain.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        let nodes = scope.resolve_some("joints", &self.joints)?;
        let parent = scope.resolve_parent("parent", &self.parent)?;
        let kind = match self.kind {
            CopyKind::Null => NodeType::Null,
            CopyKind::Joint => NodeType::Joint,
        };
        let mut copies: Vec<NodeId> = Vec::with_capacity(nodes.len());
        let mut copied = ListedNodes::default();
        for (index, node) in nodes.iter().copied().enumerate() {
            let above = match (scope.upper_in(node, &copied), parent) {
                (Some(upper), _) => Some(copies[upper]),
                (None, Some(parent)) => parent,
                (None, None) => scope.parent(node),
            };
            let mut creation = scope.creation_for(&self.creation, node, index);
            if creation.name.is_none()
                && let Some(label) = scope.label(node)
                && !self.suffix.is_empty()
            {
                creation.name = Some(format!("{label}_{}", self.suffix));
            }
            let global = scope.global(node);
            copies.push(scope.spawn_at(kind, "copy", node, 0, above, global, &creation)?);
            copied.push(node);
        }
        Ok(())
    }
}
