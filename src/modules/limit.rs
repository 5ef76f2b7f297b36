//! `limit`: nodes that stay within ends.

use crate::{
    parameters,
    processor::{BuildScope, ModuleError, Resize, RigModule, check_limits},
    rig::{
        Constraint, Limits,
        reference::{NodeRef, NodeRefs},
    },
};

parameters! {
    /// Keeps nodes within ends, whatever drives them. Role: `constraint`, for each node.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::limit::LimitModule};
    /// let params = r#"(nodes: "@this", limits: (rotate: ((0.0, 150.0), (0.0, 0.0), (0.0, 0.0))))"#;
    /// # assert!(rigsmith::modules::all().load(LimitModule::NAME, params).is_ok());
    /// ```
    pub struct LimitModule {
        /// The nodes.
        pub nodes: NodeRefs = NodeRef::this().into(),
        /// Lowest and highest values against how they were built; rotation in degrees; None where open.
        pub limits: Limits = Limits::default(),
    }
}

impl RigModule for LimitModule {
    const NAME: &'static str = "limit";
    const DOC: &'static str = "Keeps nodes within ends, whatever drives them.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["limits"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/limit.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/limit.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        check_limits("limits", &self.limits)?;
        if self.limits == Limits::default() {
            return Err(ModuleError::parameter("limits", "are all open; set at least one end, or disable the tag"));
        }
        for node in scope.resolve_some("nodes", &self.nodes)? {
            let constraint = Constraint::Limit { driven: scope.uid(node), limits: self.limits };
            scope.constrain("constraint", node, 0, constraint)?;
        }
        Ok(())
    }

    fn resize(&mut self, change: &Resize) {
        self.limits = self.limits.resized(change.factor);
    }

    fn mirror(&mut self) {
        self.limits = self.limits.mirrored();
    }
}
