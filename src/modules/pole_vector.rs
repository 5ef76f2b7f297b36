//! `pole_vector`: places the node towards which a chain bends.

use glam::Vec3;

use crate::{
    mesh::model::Trs,
    parameters,
    processor::{
        Amount, BuildScope, Creation, ModuleError, Resize, RigModule, TargetParams, check_finite, mirrored_direction,
    },
    rig::{Constraint, NodeType, reference::NodeRefs},
};

parameters! {
    /// Puts a control or null where a chain bends to, for an `ik_handle` to take as its pole. Without one it makes a null,
    /// with the role `pole`. With targets, the pole follows them, with the role `constraint`.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::pole_vector::PoleVectorModule};
    /// let params = r#"(chain: "@hierarchy this pick:0,1,2", pole: "@command control#00000000000000aa", distance: 0.8)"#;
    /// # assert!(rigsmith::modules::all().load(PoleVectorModule::NAME, params).is_ok());
    /// ```
    pub struct PoleVectorModule {
        /// Chain of at least three nodes from its root to its end.
        pub chain: NodeRefs = NodeRefs::NONE,
        /// Control or null that is put in place; a null is made if left out.
        pub pole: NodeRefs = NodeRefs::NONE,
        /// Distance of the pole from the bend, as a share of the chain's length, above 0.
        pub distance: f32 = 0.75,
        /// Direction in which a straight chain bends, in the rig's space.
        pub prefer: Vec3 = Vec3::Z,
        /// Parent of a null that is made; the rig if left out.
        pub parent: NodeRefs = NodeRefs::NONE,
        /// Nodes that the pole follows from its present place; without any, the pole moves with its parent alone.
        pub targets: NodeRefs = NodeRefs::NONE,
        /// Share of each target, a number from 0 or the name of an attribute; equal shares if left out.
        pub weights: Vec<Amount> = Vec::new(),
        /// Node with the attributes; missing attributes are added to it.
        pub control: NodeRefs = NodeRefs::NONE,
        /// Weight with which the pole follows, a number from 0 to 1 or the name of an attribute of the control.
        pub weight: Amount = Amount::Value(1.0),
        /// Name, groups and label of a null that is made.
        pub creation: Creation = Creation::default(),
    }
}

impl RigModule for PoleVectorModule {
    const NAME: &'static str = "pole_vector";
    const DOC: &'static str = "Puts a control or null where a chain bends to, and lets it follow weighted targets.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["prefer"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/pole_vector.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/pole_vector.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        scope.in_range("distance", self.distance, f32::MIN_POSITIVE..=f32::INFINITY)?;
        check_finite("prefer", &self.prefer.to_array())?;
        let chain = scope.resolve_chain("chain", &self.chain, 3)?;
        let position = scope.pole_position(&chain, self.distance, self.prefer);
        let pole = match scope.resolve_maybe("pole", &self.pole)? {
            Some(pole) => {
                scope.need_kind("pole", pole, &[NodeType::Control, NodeType::Null], "a control or null")?;
                // What takes a control's place moves for it, so that the control's own base stays as it is.
                let holder = scope.offset_of(pole).unwrap_or(pole);
                let global = scope.global(holder);
                scope.set_global(holder, Trs { translation: position, ..global });
                holder
            }
            None => {
                let parent = scope.resolve_parent("parent", &self.parent)?.flatten();
                let global = Trs { translation: position, ..Trs::IDENTITY };
                scope.spawn_at(NodeType::Null, "pole", chain[0], 0, parent, global, &self.creation)?
            }
        };
        if self.targets.is_empty() {
            return Ok(());
        }
        let params = TargetParams { targets: &self.targets, weights: &self.weights, control: &self.control };
        let nodes = match scope.weighted_nodes(&params) {
            // What it follows is off: it stays where its parent takes it.
            Err(ModuleError::Off { .. }) => return Ok(()),
            nodes => nodes?,
        };
        let control = scope.resolve_maybe("control", &self.control)?;
        let weight = scope.amount("weight", &self.weight, control, 0.0..=1.0, 1.0)?;
        let constraint = Constraint::Transform {
            driven: scope.uid(pole),
            targets: scope.targets(pole, &nodes, true),
            translate: [true; 3],
            rotate: [false; 3],
            scale: [false; 3],
            weight,
            keep_pose: true,
        };
        scope.constrain("constraint", chain[0], 0, constraint)?;
        Ok(())
    }

    fn resize(&mut self, change: &Resize) {
        self.prefer = change.turned(self.prefer);
    }

    fn mirror(&mut self) {
        self.prefer = mirrored_direction(self.prefer);
    }
}
