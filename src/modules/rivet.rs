//! `rivet`: nodes that ride on a triangle of three others.

use glam::Vec3;

use crate::{
    mesh::model::Trs,
    parameters,
    processor::{Amount, BuildScope, ModuleError, RigModule},
    rig::{
        Constraint,
        reference::{NodeRef, NodeRefs},
    },
    solve::rivet::{corner_shares, triangle_frame},
};

parameters! {
    /// Lets nodes ride on the surface between three others, as a button rides on cloth: they keep their place in the
    /// triangle and their height above it, and turn with it.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::rivet::Rivet};
    /// let params = r#"(corners: "@joint a#0000000000000001 + @joint b#0000000000000002 + @joint c#0000000000000003")"#;
    /// # rigsmith::modules::all().load(Rivet::NAME, params).map(|_| ()).unwrap();
    /// ```
    pub struct Rivet {
        /// The nodes that ride.
        pub node: NodeRefs = NodeRef::this().into(),
        /// Three nodes that are the corners of the triangle.
        pub corners: NodeRefs = NodeRefs::NONE,
        /// The control whose attribute the weight may name; the first of the nodes if left out.
        pub control: NodeRefs = NodeRefs::NONE,
        /// 0 leaves the nodes as they are, 1 lets them ride; a number or an attribute's name.
        pub weight: Amount = Amount::Value(1.0),
    }
}

impl RigModule for Rivet {
    const NAME: &'static str = "rivet";
    const DOC: &'static str = "Lets nodes ride on the surface between three others.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/rivet.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/rivet.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        let nodes = scope.resolve_some("node", &self.node)?;
        let [a, b, c] = scope.resolve_all("corners", &self.corners)?[..] else {
            return Err(ModuleError::reference("corners", &self.corners, "does not find three nodes; give three"));
        };
        let control = scope.resolve_maybe("control", &self.control)?.or(nodes.first().copied());
        let weight = scope.amount("weight", &self.weight, control, 0.0..=1.0, 1.0)?;
        let places: [Vec3; 3] = [a, b, c].map(|corner| scope.position(corner));
        for node in nodes {
            let global = scope.global(node);
            let shares = corner_shares(places, global.translation);
            let frame = shares.and_then(|shares| Some((shares, triangle_frame(places, shares)?)));
            let Some((shares, (translation, rotation))) = frame else {
                return Err(ModuleError::reference("corners", &self.corners, "lie on a line; move one of them"));
            };
            let constraint = Constraint::Rivet {
                driven: scope.uid(node),
                corners: [a, b, c].map(|corner| scope.uid(corner)),
                shares,
                offset: global.relative_to(&Trs { translation, rotation, ..Trs::IDENTITY }),
                weight: weight.clone(),
            };
            scope.constrain("rivet", node, 0, constraint)?;
        }
        Ok(())
    }
}
