//! Changes of nodes by modules: places, parents, looks, labels, attributes.

use std::sync::Arc;

use crate::{
    mesh::model::Trs,
    processor::{
        BuildScope, ModuleError,
        world::{Aspect, NodeId, Value},
    },
    rig::{Attribute, AttributeKind, ControlData, LayerData, Scalar},
};

impl BuildScope<'_> {
    /// Puts a node elsewhere, relative to its parent.
    pub fn set_base(&mut self, node: NodeId, base: Trs) {
        self.write(node, Aspect::Base, Value::Base(Arc::new(base)));
    }

    /// Puts a node elsewhere in the rig's space; what is below it moves along.
    pub fn set_global(&mut self, node: NodeId, global: Trs) {
        let base = match self.parent(node) {
            Some(parent) => global.relative_to(&self.global(parent)),
            None => global,
        };
        self.set_base(node, base);
    }

    /// Hangs a node below another one (below the rig for `None`); it stays where it is.
    ///
    /// # Errors
    /// If the node would stand below itself.
    pub fn set_parent(&mut self, node: NodeId, parent: Option<NodeId>) -> Result<(), ModuleError> {
        self.check_inside(Some(node))?;
        self.check_inside(parent)?;
        let mut above = parent;
        while let Some(ancestor) = above {
            if ancestor == node {
                let (node, parent) = (self.name(node), parent.map(|parent| self.name(parent)).unwrap_or_default());
                return Err(ModuleError::other(format!("{node} cannot stand below {parent}, which stands below it")));
            }
            above = self.parent(ancestor);
        }
        let global = self.global(node);
        self.write(node, Aspect::Parent, Value::Parent(parent));
        self.set_global(node, global);
        Ok(())
    }

    /// Makes a node look and move like this.
    pub fn set_control(&mut self, node: NodeId, control: ControlData) {
        self.write(node, Aspect::Control, Value::Control(Arc::new(control)));
    }

    /// Puts a node into a layer.
    pub fn set_layer(&mut self, node: NodeId, layer: Arc<LayerData>) {
        self.write(node, Aspect::Layer, Value::Layer(layer));
    }

    /// Gives a node a label.
    pub fn set_label(&mut self, node: NodeId, label: Option<&str>) {
        self.write(node, Aspect::Label, Value::Label(label.map(Into::into)));
    }

    /// Adds an attribute to a node.
    ///
    /// # Errors
    /// If it has one of that name already, or the name is empty, or the ends are in the wrong order, or it has as many
    /// as it may.
    pub fn add_attribute(&mut self, node: NodeId, attribute: Attribute) -> Result<(), ModuleError> {
        self.check_inside(Some(node))?;
        let name = &attribute.name;
        let list = self.attributes(node);
        if name.trim().is_empty() {
            return Err(ModuleError::parameter("name", "an attribute needs a name"));
        }
        if list.has(name) {
            let node = self.name(node);
            return Err(ModuleError::other(format!("{node} has an attribute \"{name}\" already; choose another name")));
        }
        if let AttributeKind::Number { min: Some(min), max: Some(max) } = attribute.kind
            && min > max
        {
            return Err(ModuleError::parameter(
                "min",
                format!("\"{name}\" goes from {min} to {max}: exchange the two"),
            ));
        }
        let limit = self.world.limits.attributes;
        if list.len() >= limit {
            return Err(ModuleError::TooMany { what: "attributes of one node", name: "attributes", limit });
        }
        let default = attribute.clamp(attribute.default);
        self.write(node, Aspect::Attributes, Value::Attributes(list.with(Attribute { default, ..attribute })));
        Ok(())
    }

    /// An attribute of a node as a number that constraints follow.
    ///
    /// # Errors
    /// If the node has no such attribute, with the nearest names.
    pub fn attribute(&mut self, node: NodeId, name: &str) -> Result<Scalar, ModuleError> {
        let list = self.attributes(node);
        if list.has(name) {
            return Ok(Scalar::attribute(self.uid(node), name));
        }
        let nearest = crate::rig::nearest::did_you_mean(name, list.iter().map(|known| known.name.to_string()));
        let node = self.name(node);
        Err(ModuleError::other(format!("{node} has no attribute \"{name}\"{nearest}; add it before this command")))
    }
}
