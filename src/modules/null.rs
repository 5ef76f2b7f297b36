//! `null`: a node that carries others, at other nodes.

use glam::Vec3;

use crate::{
    mesh::model::Trs,
    parameters,
    processor::{
        BuildScope, Creation, ModuleError, Resize, RigModule, check_finite, mirrored_angles, mirrored_direction,
    },
    rig::{
        NodeType, degrees,
        reference::{NodeRef, NodeRefs},
    },
};

parameters! {
    /// Makes a null for each of some nodes. Role: `null`.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::null::NullModule};
    /// let params = r#"(at: "@this", world: true, creation: (name: "arm_root"))"#;
    /// # assert!(rigsmith::modules::all().load(NullModule::NAME, params).is_ok());
    /// ```
    pub struct NullModule {
        /// The nodes that get one.
        pub at: NodeRefs = NodeRef::this().into(),
        /// Parent of the nulls; the parent of each node if left out.
        pub parent: NodeRefs = NodeRefs::NONE,
        /// True: they stand below the rig itself, on no parent.
        pub world: bool = false,
        /// True: each node is hung below its null, which takes its place.
        pub insert: bool = false,
        /// True: they turn and scale like the nodes; false: along the rig's axes.
        pub orient: bool = true,
        /// Distance from the node, along the null's axes before it is turned, in the rig's units.
        pub translate: Vec3 = Vec3::ZERO,
        /// Turn against the node about X, Y and Z, in degrees.
        pub rotate: Vec3 = Vec3::ZERO,
        /// Name, groups and label; by default those of the node.
        pub creation: Creation = Creation::default(),
    }
}

impl RigModule for NullModule {
    const NAME: &'static str = "null";
    const DOC: &'static str = "Makes a node that carries others, at each of some nodes.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["translate", "rotate"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/null.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/null.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        check_finite("translate", &self.translate.to_array())?;
        check_finite("rotate", &self.rotate.to_array())?;
        let nodes = scope.resolve_some("at", &self.at)?;
        let parent = match self.insert && !self.parent.is_empty() {
            // What takes a node's place decides how it moves: without its parent the node stays as it is.
            true => Some(Some(scope.resolve_one("parent", &self.parent)?)),
            false => scope.resolve_parent("parent", &self.parent)?,
        };
        if parent.is_some() && self.world {
            return Err(ModuleError::parameter("world", "is true, but there is a parent; leave one of the two out"));
        }
        for (index, node) in nodes.into_iter().enumerate() {
            let above = match parent {
                Some(parent) => parent,
                None if self.world => None,
                None => scope.parent(node),
            };
            let mut place = scope.global(node);
            if !self.orient {
                place = Trs { translation: place.translation, ..Trs::IDENTITY };
            }
            let offset =
                Trs { translation: self.translate / place.scale, rotation: degrees(self.rotate), scale: Vec3::ONE };
            let creation = scope.creation_for(&self.creation, node, index);
            let null = scope.spawn_at(NodeType::Null, "null", node, 0, above, place * offset, &creation)?;
            if self.insert {
                scope.set_parent(node, Some(null))?;
            }
        }
        Ok(())
    }

    fn resize(&mut self, change: &Resize) {
        self.translate *= if self.world { change.floor_factor } else { change.factor };
        if !self.orient {
            if self.translate != Vec3::ZERO {
                self.translate = change.turned(self.translate);
            }
            self.rotate = change.turned_angles(self.rotate);
        }
    }

    fn mirror(&mut self) {
        self.translate = mirrored_direction(self.translate);
        self.rotate = mirrored_angles(self.rotate);
    }
}
