//! `spring`: nodes that lag behind, swing and settle.

use crate::{
    parameters,
    processor::{Amount, BuildScope, ModuleError, Resize, RigModule},
    rig::{
        Collider, Constraint,
        reference::{NodeRef, NodeRefs},
    },
};

parameters! {
    /// Lets nodes lag behind what moves them, swing and settle: hair, tails, ears, antennas.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::spring::Spring};
    /// let params = r#"(nodes: "@hierarchy this", frequency: 3.0, damping: 0.3)"#;
    /// # rigsmith::modules::all().load(Spring::NAME, params).map(|_| ()).unwrap();
    /// ```
    pub struct Spring {
        /// The nodes, each of which swings for itself.
        pub nodes: NodeRefs = NodeRef::this().into(),
        /// Swings a second, above 0 to 60; a number or an attribute's name.
        pub frequency: Amount = Amount::Value(2.0),
        /// 0 swings for ever, 1 settles without swinging, up to 10; a number or an attribute's name.
        pub damping: Amount = Amount::Value(0.4),
        /// 0 leaves the nodes as they are, 1 swings; a number or an attribute's name.
        pub weight: Amount = Amount::Value(1.0),
        /// The position lags.
        pub translate: bool = false,
        /// The direction lags in which the node's children lie.
        pub rotate: bool = true,
        /// Share of the character's own motion in the world that counts, 0 to 1; a number or an attribute's name.
        pub motion: Amount = Amount::Value(1.0),
        /// Nodes that carry bodies which the tips do not enter: balls about them.
        pub colliders: NodeRefs = NodeRefs::NONE,
        /// Nodes to which the bodies of the colliders reach, in their order; balls if left out.
        pub collider_ends: NodeRefs = NodeRefs::NONE,
        /// Radius of each body in the rig's units, above 0; the last one holds for those that follow.
        pub radii: Vec<f32> = vec![0.1],
        /// The control whose attributes the numbers may name; the first of the nodes if left out.
        pub control: NodeRefs = NodeRefs::NONE,
    }
}

impl RigModule for Spring {
    const NAME: &'static str = "spring";
    const DOC: &'static str = "Lets nodes lag behind what moves them, swing and settle: hair, tails, ears, antennas.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/spring.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/spring.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        let nodes = scope.resolve_some("nodes", &self.nodes)?;
        if !(self.translate || self.rotate) {
            return Err(ModuleError::parameter("rotate", "nothing lags; turn on rotate or translate"));
        }
        let control = scope.resolve_maybe("control", &self.control)?.or(nodes.first().copied());
        let frequency = scope.amount("frequency", &self.frequency, control, 1e-2..=60.0, 2.0)?;
        let damping = scope.amount("damping", &self.damping, control, 0.0..=10.0, 0.4)?;
        let weight = scope.amount("weight", &self.weight, control, 0.0..=1.0, 1.0)?;
        let motion = scope.amount("motion", &self.motion, control, 0.0..=1.0, 1.0)?;
        let colliders = self.bodies(scope)?;
        for node in nodes {
            let constraint = Constraint::Spring {
                driven: scope.uid(node),
                frequency: frequency.clone(),
                damping: damping.clone(),
                weight: weight.clone(),
                translate: self.translate,
                rotate: self.rotate,
                motion: motion.clone(),
                colliders: colliders.clone(),
            };
            scope.constrain("spring", node, 0, constraint)?;
        }
        Ok(())
    }

    fn resize(&mut self, change: &Resize) {
        self.radii.iter_mut().for_each(|radius| *radius *= change.factor);
    }
}

impl Spring {
    /// Bodies of the colliders that are on.
    fn bodies(&self, scope: &mut BuildScope<'_>) -> Result<Vec<Collider>, ModuleError> {
        if self.colliders.is_empty() {
            return Ok(Vec::new());
        }
        let nodes = scope.resolve_each("colliders", &self.colliders)?;
        let ends = match self.collider_ends.is_empty() {
            true => vec![None; nodes.len()],
            false => scope.resolve_each("collider_ends", &self.collider_ends)?,
        };
        if ends.len() != nodes.len() {
            let problem =
                format!("finds {} nodes for {} colliders; give one for each, or none", ends.len(), nodes.len());
            return Err(ModuleError::reference("collider_ends", &self.collider_ends, problem));
        }
        let Some(last) = self.radii.last().copied() else {
            return Err(ModuleError::parameter("radii", "has no radius; write one, such as [0.1]"));
        };
        let mut bodies = Vec::with_capacity(nodes.len());
        for (at, (node, end)) in nodes.into_iter().zip(ends).enumerate() {
            let radius = self.radii.get(at).copied().unwrap_or(last);
            scope.in_range("radii", radius, f32::MIN_POSITIVE..=f32::INFINITY)?;
            if let Some(node) = node {
                bodies.push(Collider { node: scope.uid(node), end: end.map(|end| scope.uid(end)), radius });
            }
        }
        Ok(bodies)
    }
}
