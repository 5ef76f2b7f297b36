//! `blend`: nodes that follow one of two targets each, or a place between both.

use crate::{
    parameters,
    processor::{Amount, BuildScope, ModuleError, RigModule},
    rig::{
        Constraint, Scalar,
        reference::{NodeRef, NodeRefs},
    },
};

parameters! {
    /// Lets each of some nodes follow one of the list `a` or one of the list `b`, or something between. Role: `constraint`,
    /// for each node.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::blend::BlendModule};
    /// let params = r#"(
    ///     nodes: "@hierarchy this",
    ///     a: "@command duplicate_chain#00000000000000aa",
    ///     b: "@command duplicate_chain#00000000000000ab",
    ///     control: "@command control#00000000000000ac",
    ///     blend: "ik",
    /// )"#;
    /// # assert!(rigsmith::modules::all().load(BlendModule::NAME, params).is_ok());
    /// ```
    pub struct BlendModule {
        /// Nodes that are driven.
        pub nodes: NodeRefs = NodeRef::this().into(),
        /// Targets at 0: as many nodes, in the same order.
        pub a: NodeRefs = NodeRefs::NONE,
        /// Targets at 1: as many nodes, in the same order.
        pub b: NodeRefs = NodeRefs::NONE,
        /// Blend from `a` (0) to `b` (1): a number, or the name of an attribute of the control.
        pub blend: Amount = Amount::Value(0.0),
        /// Node with the attribute; a missing attribute is added to it.
        pub control: NodeRefs = NodeRefs::NONE,
        /// Axes of the translation that follow, in the parent's space.
        pub translate: [bool; 3] = [true; 3],
        /// Angles about X, Y and Z that follow, in the parent's space.
        pub rotate: [bool; 3] = [true; 3],
        /// Factors along X, Y and Z that follow.
        pub scale: [bool; 3] = [false; 3],
        /// Keeps the nodes' present places in the space of each target; false: the nodes lie on their targets.
        pub keep_offset: bool = true,
    }
}

impl RigModule for BlendModule {
    const NAME: &'static str = "blend";
    const DOC: &'static str = "Lets each of some nodes follow one of two others, or something between.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/blend.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/blend.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        if [self.translate, self.rotate, self.scale] == [[false; 3]; 3] {
            return Err(ModuleError::other("no axis follows; switch on at least one, or disable the tag"));
        }
        let nodes = scope.resolve_all("nodes", &self.nodes)?;
        let (a, b) = (scope.resolve_all("a", &self.a)?, scope.resolve_all("b", &self.b)?);
        for (parameter, references, list) in [("a", &self.a, &a), ("b", &self.b, &b)] {
            if list.len() != nodes.len() {
                let (found, needed) = (list.len(), nodes.len());
                let problem = format!("finds {found} nodes for {needed} that are driven; refer to one for each");
                return Err(ModuleError::reference(parameter, references, problem));
            }
        }
        let control = scope.resolve_maybe("control", &self.control)?;
        let to_b = scope.amount("blend", &self.blend, control, 0.0..=1.0, 0.0)?;
        let to_a = match &to_b {
            Scalar::Attribute { node, name, factor, add } => {
                Scalar::Attribute { node: *node, name: name.clone(), factor: -factor, add: 1.0 - add }
            }
            other => Scalar::Value(1.0 - scope.built_value(other)),
        };
        for ((node, a), b) in nodes.into_iter().zip(a).zip(b) {
            let targets = scope.targets(node, &[(a, to_a.clone()), (b, to_b.clone())], self.keep_offset);
            let constraint = Constraint::Transform {
                driven: scope.uid(node),
                targets,
                translate: self.translate,
                rotate: self.rotate,
                scale: self.scale,
                weight: Scalar::Value(1.0),
                keep_pose: false,
            };
            scope.constrain("constraint", node, 0, constraint)?;
        }
        Ok(())
    }
}
