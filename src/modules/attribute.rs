//! `attribute`: a named number or choice on a node, for people to set and for other commands to follow.

use crate::{
    parameters,
    processor::{BuildScope, ModuleError, RigModule},
    rig::{
        Attribute, AttributeKind,
        reference::{NodeRef, NodeRefs},
    },
};

parameters! {
    /// Adds an attribute to nodes.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::attribute::AttributeModule};
    /// let params = r#"(node: "@this", name: "follow", min: 0.0, max: 1.0, default: 0.5)"#;
    /// # assert!(rigsmith::modules::all().load(AttributeModule::NAME, params).is_ok());
    /// ```
    pub struct AttributeModule {
        /// The nodes that get it.
        pub node: NodeRefs = NodeRef::this().into(),
        /// Name of the attribute, unique on the node.
        pub name: String = "value".to_owned(),
        /// Lowest value; open if left out.
        pub min: Option<f32> = None,
        /// Highest value; open if left out.
        pub max: Option<f32> = None,
        /// Names of choices, of which the value is the number; a plain number if there are none.
        pub choices: Vec<String> = Vec::new(),
        /// The value until somebody sets another.
        pub default: f32 = 0.0,
    }
}

impl RigModule for AttributeModule {
    const NAME: &'static str = "attribute";
    const DOC: &'static str =
        "Adds a named number or choice to nodes, for people to set and for other commands to follow.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/attribute.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/attribute.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        if ![self.min.unwrap_or(0.0), self.max.unwrap_or(0.0), self.default].iter().all(|number| number.is_finite()) {
            return Err(ModuleError::parameter("default", "min, max and default have to be finite numbers"));
        }
        let kind = if self.choices.is_empty() {
            AttributeKind::Number { min: self.min, max: self.max }
        } else {
            AttributeKind::Choice(self.choices.clone())
        };
        for node in scope.resolve_some("node", &self.node)? {
            let attribute = Attribute { name: self.name.as_str().into(), kind: kind.clone(), default: self.default };
            scope.add_attribute(node, attribute)?;
        }
        Ok(())
    }
}
