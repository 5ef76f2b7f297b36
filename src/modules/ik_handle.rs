//! `ik_handle`: a chain of joints that reaches for a goal.

use glam::Vec3;

use crate::{
    parameters,
    processor::{
        Amount, BuildScope, Ik, IkSolver, JointAngles, ModuleError, Resize, RigModule, mirrored_direction,
        mirrored_limits,
    },
    rig::reference::{NodeRef, NodeRefs},
};

parameters! {
    /// Makes a chain of joints reach for a goal.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::ik_handle::IkHandle};
    /// let params = r#"(
    ///     start: "@this",
    ///     end: "@joint hand_l#0000000000000003",
    ///     goal: "@command control/hand_l#00000000000000aa",
    ///     pole: "@command control/elbow_l#00000000000000ab",
    ///     soft: 0.02,
    ///     stretch: "stretch",
    /// )"#;
    /// # rigsmith::modules::all().load(IkHandle::NAME, params).map(|_| ()).unwrap();
    /// ```
    pub struct IkHandle {
        /// The first joint of the chain, such as a shoulder.
        pub start: NodeRefs = NodeRef::this().into(),
        /// The last joint of the chain, such as a wrist: what reaches the goal.
        pub end: NodeRefs = NodeRefs::NONE,
        /// The control or null that the end goes to.
        pub goal: NodeRefs = NodeRefs::NONE,
        /// A control or null on the side to which the chain bends; none: it bends as it stands.
        pub pole: NodeRefs = NodeRefs::NONE,
        /// The control whose attributes the numbers may name; the goal if left out.
        pub control: NodeRefs = NodeRefs::NONE,
        /// auto, two_bone (three joints), fabrik or ccd (any number; ccd keeps limits).
        pub solver: IkSolver = IkSolver::Auto,
        /// 0 leaves the chain as it is, 1 reaches; a number or an attribute's name.
        pub weight: Amount = Amount::Value(1.0),
        /// Share of the length, 0 to 1, over which two bones ease into being straight; or an attribute's name.
        pub soft: Amount = Amount::Value(0.0),
        /// 0 keeps the lengths of two bones, 1 stretches them to the goal; or an attribute's name.
        pub stretch: Amount = Amount::Value(0.0),
        /// Longest stretch as a factor, 1 or more.
        pub max_stretch: f32 = 2.0,
        /// Turn of two bones about the line to the goal in degrees; or an attribute's name.
        pub twist: Amount = Amount::Value(0.0),
        /// 0 bends two bones towards the pole, 1 lengthens both so that their joint is at the pole; or an attribute's name.
        pub pin: Amount = Amount::Value(0.0),
        /// The end turns with the goal, keeping how the two stand to each other as built.
        pub orient_end: bool = true,
        /// Direction in the rig's space in which a straight chain bends; as built, or to the pole, if left out.
        pub prefer: Option<Vec3> = None,
        /// Lowest and highest angles in degrees about X, Y and Z of each joint, from the first on; for ccd.
        pub limits: Vec<JointAngles> = Vec::new(),
        /// Rounds at most, 1 to 1000; for fabrik and ccd.
        pub iterations: u32 = 24,
        /// Distance from the goal that is near enough, as a share of the length; for fabrik and ccd.
        pub tolerance: f32 = 1e-4,
        /// Goal and pole are hidden while an attribute as weight is 0: their attribute "visible" is driven.
        pub hide: bool = true,
    }
}

impl RigModule for IkHandle {
    const NAME: &'static str = "ik_handle";
    const DOC: &'static str = "Makes a chain of joints reach for a goal: two bones exactly, longer chains in rounds.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["twist", "prefer", "limits"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/ik_handle.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/ik_handle.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        let start = scope.resolve_one("start", &self.start)?;
        let end = scope.resolve_one("end", &self.end)?;
        let chain = scope.chain(start, end)?;
        let goal = scope.resolve_one("goal", &self.goal)?;
        let pole = scope.resolve_maybe("pole", &self.pole)?;
        let control = scope.resolve_maybe("control", &self.control)?;
        let weight = scope.amount("weight", &self.weight, Some(control.unwrap_or(goal)), 0.0..=1.0, 1.0)?;
        if self.hide {
            for node in [Some(goal), pole].into_iter().flatten() {
                scope.show_where(node, &weight, [(0.0, 0.0), (1e-3, 1.0)])?;
            }
        }
        scope.add_ik(&Ik {
            pole,
            control,
            solver: self.solver,
            prefer: self.prefer,
            weight,
            soft: self.soft.clone(),
            stretch: self.stretch.clone(),
            max_stretch: self.max_stretch,
            twist: self.twist.clone(),
            pin: self.pin.clone(),
            orient_end: self.orient_end,
            limits: self.limits.clone(),
            iterations: self.iterations,
            tolerance: self.tolerance,
            ..Ik::new(chain, goal)
        })?;
        Ok(())
    }

    fn resize(&mut self, change: &Resize) {
        self.prefer = self.prefer.map(|prefer| change.turned(prefer));
    }

    fn mirror(&mut self) {
        self.twist = self.twist.opposite();
        self.prefer = self.prefer.map(mirrored_direction);
        self.limits.iter_mut().for_each(|limits| *limits = mirrored_limits(*limits));
    }
}
