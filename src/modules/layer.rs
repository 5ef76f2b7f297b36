//! `layer`: nodes that are shown and hidden together.

use std::sync::Arc;

use crate::{
    parameters,
    processor::{BuildScope, ModuleError, RigModule},
    rig::{
        LayerData, LayerDisplay,
        reference::{NodeRef, NodeRefs},
    },
};

parameters! {
    /// Puts nodes into a layer.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::layer::LayerModule};
    /// let params = r#"(nodes: "@any type:control", name: "controls", display: reference)"#;
    /// # assert!(rigsmith::modules::all().load(LayerModule::NAME, params).is_ok());
    /// ```
    pub struct LayerModule {
        /// The nodes; each is in one layer at most, the last one.
        pub nodes: NodeRefs = NodeRef::this().into(),
        /// The layer's name.
        pub name: String = "layer".to_owned(),
        /// False: its nodes are hidden.
        pub visible: bool = true,
        /// Display of the nodes, normal: as they are; template: grey and not to be picked; reference: not to be picked.
        pub display: LayerDisplay = LayerDisplay::Normal,
        /// sRGB colour, 0 to 1 each, in place of the nodes' own; their own if left out.
        pub color: Option<[f32; 3]> = None,
        /// True: if an earlier command made a layer of that name, it stays as it is and gets the nodes.
        pub use_existing: bool = false,
    }
}

impl RigModule for LayerModule {
    const NAME: &'static str = "layer";
    const DOC: &'static str = "Puts nodes into a layer, to be shown and hidden together.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/layer.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/layer.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        if self.name.trim().is_empty() {
            return Err(ModuleError::parameter("name", "is empty; a layer needs a name"));
        }
        for part in self.color.unwrap_or_default() {
            scope.in_range("color", part, 0.0..=1.0)?;
        }
        let nodes = scope.resolve_some("nodes", &self.nodes)?;
        let existing = if self.use_existing { scope.find_layer(&self.name) } else { None };
        let layer = existing.unwrap_or_else(|| {
            let (name, visible) = (self.name.clone(), self.visible);
            Arc::new(LayerData { name, visible, display: self.display, color: self.color })
        });
        for node in nodes {
            scope.set_layer(node, layer.clone());
        }
        Ok(())
    }
}
