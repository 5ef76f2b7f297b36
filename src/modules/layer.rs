//! `layer`: nodes that are shown and hidden together.

use std::sync::Arc;

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

use crate::{
    processor::{BuildScope, ModuleError, RigModule},
    rig::{
        LayerData, LayerDisplay,
        reference::{NodeRef, NodeRefs},
    },
};

/// Puts nodes into a layer.
///
/// ```
/// # use rigsmith::{processor::RigModule, modules::layer::LayerModule};
/// let params = r#"(nodes: "@any type:control", name: "controls", display: reference)"#;
/// # assert!(rigsmith::modules::all().load(LayerModule::NAME, params).is_ok());
/// ```
#[derive(Reflect, Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LayerModule {
    /// The nodes.
    pub nodes: NodeRefs,
    /// The layer's name.
    pub name: String,
    /// True if it is shown.
    pub visible: bool,
    /// Display of the layer.
    pub display: LayerDisplay,
    /// Colour of the layer.
    pub color: Option<[f32; 3]>,
    /// True if a layer of that name is taken as it is.
    pub use_existing: bool,
}

impl Default for LayerModule {
    fn default() -> Self {
        Self {
            nodes: NodeRef::this().into(),
            name: "layer".to_owned(),
            visible: true,
            display: LayerDisplay::Normal,
            color: None,
            use_existing: false,
        }
    }
}

impl RigModule for LayerModule {
    const NAME: &'static str = "layer";
    const DOC: &'static str = "Puts nodes into a layer, to be shown and hidden together.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = &[
        ("nodes", "The nodes; each is in one layer at most, the last one."),
        ("name", "The layer's name."),
        ("visible", "False: its nodes are hidden."),
        ("display", "normal: as they are; template: grey and not to be picked; reference: not to be picked."),
        ("color", "sRGB colour, 0 to 1 each, in place of the nodes' own; their own if left out."),
        (
            "use_existing",
            "True: if an earlier command made a layer of that name, it stays as it is and gets the nodes.",
        ),
    ];
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
