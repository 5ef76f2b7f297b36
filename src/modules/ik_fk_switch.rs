//! `ik_fk_switch`: a limb that follows its joints' controls, a goal, or anything between.

use glam::Vec3;

use crate::{
    mesh::model::Trs,
    parameters,
    processor::{Amount, BuildScope, Creation, Ik, IkSolver, ModuleError, Resize, RigModule, mirrored_direction},
    rig::{
        AttributeKind, Constraint, Matching, NodeType, Scalar, SwitchData, Target,
        reference::{NodeRef, NodeRefs},
    },
};

parameters! {
    /// Moves a limb by forward or inverse kinematics, as an attribute says; thrown without a jump.
    ///
    /// A null on each forward control (role `fk`) stands for its joint. The joints follow these, and the inverse kinematics come on top of that with the attribute as their
    /// weight. Everything is made here: no `ik_handle` or `parent` is needed for these joints.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::ik_fk_switch::IkFkSwitch};
    /// let params = r#"(
    ///     start: "@joint upper_arm_l#0000000000000001",
    ///     end: "@joint hand_l#0000000000000003",
    ///     fk: "@command control/upper_arm_l#00000000000000a0",
    ///     goal: "@command control/hand_l#00000000000000aa",
    ///     pole: "@command control/elbow_l#00000000000000ab",
    ///     control: "@command control/arm_settings_l#00000000000000ac",
    ///     stretch: "stretch",
    /// )"#;
    /// # rigsmith::modules::all().load(IkFkSwitch::NAME, params).map(|_| ()).unwrap();
    /// ```
    pub struct IkFkSwitch {
        /// The first joint of the limb, such as a shoulder.
        pub start: NodeRefs = NodeRef::this().into(),
        /// The last joint of the limb, such as a wrist.
        pub end: NodeRefs = NodeRefs::NONE,
        /// A control for each joint from start to end, in that order.
        pub fk: NodeRefs = NodeRefs::NONE,
        /// The control or null that the end goes to by inverse kinematics.
        pub goal: NodeRefs = NodeRefs::NONE,
        /// A control on the side to which the limb bends; none: it bends as the forward controls say.
        pub pole: NodeRefs = NodeRefs::NONE,
        /// The control that carries the attributes; the goal if left out.
        pub control: NodeRefs = NodeRefs::NONE,
        /// Name of the attribute that switches: 0 forward, 1 inverse. Added if the control lacks it.
        pub attribute: String = "ik_fk".to_owned(),
        /// Value of the attribute until somebody sets another, 0 to 1.
        pub default: f32 = 1.0,
        /// The joints below the first follow the positions of their controls, too: needed for stretching.
        pub translate: bool = true,
        /// The first joint follows the position of its control, too, and leaves its parent with it.
        pub translate_root: bool = false,
        /// auto, two_bone (three joints), fabrik or ccd (any number).
        pub solver: IkSolver = IkSolver::Auto,
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
        /// Direction in the rig's space in which a straight limb bends; as built, or to the pole, if left out.
        pub prefer: Option<Vec3> = None,
        /// Controls of the kinematics that has no effect are hidden: their attribute "visible" is driven.
        pub hide: bool = true,
        /// More controls that are hidden with the forward ones.
        pub forward_controls: NodeRefs = NodeRefs::NONE,
        /// More controls that are hidden with the goal, such as those of a foot's pivots.
        pub inverse_controls: NodeRefs = NodeRefs::NONE,
        /// Controls above the limb that keep their place when the switch is thrown, such as that of a shoulder which turns
        /// with the goal.
        pub held: NodeRefs = NodeRefs::NONE,
        /// Name, group and label of the nulls that stand on the forward controls for the joints.
        pub creation: Creation = Creation::default(),
    }
}

impl RigModule for IkFkSwitch {
    const NAME: &'static str = "ik_fk_switch";
    const DOC: &'static str = "Moves a limb by its joints' own controls (0) or by a goal (1), as an attribute says; the \
                               switch can be thrown without a jump.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["attribute", "twist", "prefer"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/ik_fk_switch.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/ik_fk_switch.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        let start = scope.resolve_one("start", &self.start)?;
        let end = scope.resolve_one("end", &self.end)?;
        let chain = scope.chain(start, end)?;
        let fk = scope.resolve_all("fk", &self.fk)?;
        if fk.len() != chain.len() {
            let problem = format!(
                "finds {} controls for the {} joints from {} to {}; give one for each joint, in that order",
                fk.len(),
                chain.len(),
                scope.name(start),
                scope.name(end)
            );
            return Err(ModuleError::reference("fk", &self.fk, problem));
        }
        let goal = scope.resolve_one("goal", &self.goal)?;
        let pole = scope.resolve_maybe("pole", &self.pole)?;
        let control = scope.resolve_maybe("control", &self.control)?.unwrap_or(goal);
        scope.in_range("default", self.default, 0.0..=1.0)?;
        let kind = AttributeKind::Number { min: Some(0.0), max: Some(1.0) };
        let weight = scope.ensure_attribute(control, &self.attribute, kind, self.default)?;

        // What each joint would be by forward kinematics alone. Those below the first follow relative to the one above:
        // where that ends up depends on the inverse kinematics.
        let mut above = None;
        for (joint, control) in chain.iter().zip(&fk) {
            let place = scope.kept_offset(*joint, *control);
            let at = scope.spawn(NodeType::Null, "fk", *joint, 0, Some(*control), place, &self.creation)?;
            let constraint = match above.replace(at) {
                None => Constraint::Transform {
                    driven: scope.uid(*joint),
                    targets: vec![Target { node: scope.uid(at), weight: Scalar::Value(1.0), offset: Trs::IDENTITY }],
                    translate: [self.translate_root; 3],
                    rotate: [true; 3],
                    scale: [false; 3],
                    weight: Scalar::Value(1.0),
                    keep_pose: false,
                },
                Some(above) => Constraint::Relative {
                    driven: scope.uid(*joint),
                    source: scope.uid(at),
                    space: scope.uid(above),
                    translate: self.translate,
                    rotate: true,
                    weight: Scalar::Value(1.0),
                },
            };
            scope.constrain("follow", *joint, 0, constraint)?;
        }
        scope.add_ik(&Ik {
            pole,
            control: Some(control),
            solver: self.solver,
            prefer: self.prefer,
            weight: weight.clone(),
            soft: self.soft.clone(),
            stretch: self.stretch.clone(),
            max_stretch: self.max_stretch,
            twist: self.twist.clone(),
            pin: self.pin.clone(),
            orient_end: self.orient_end,
            ..Ik::new(chain.clone(), goal)
        })?;
        if self.hide {
            // Between the ends of the switch both kinds are visible.
            let more = scope.resolve("forward_controls", &self.forward_controls)?;
            for node in fk.iter().copied().chain(more) {
                scope.show_where(node, &weight, [(0.0, 1.0), (1.0, 0.0)])?;
            }
            let more = scope.resolve("inverse_controls", &self.inverse_controls)?;
            for node in [Some(goal), pole].into_iter().flatten().chain(more) {
                scope.show_where(node, &weight, [(0.0, 0.0), (1e-3, 1.0)])?;
            }
        }
        let held = scope.resolve("held", &self.held)?;
        let switch = SwitchData {
            command: scope.command(),
            control: scope.uid(control),
            attribute: self.attribute.as_str().into(),
            matching: Matching::IkFk {
                joints: chain.iter().map(|joint| scope.uid(*joint)).collect(),
                fk: fk.iter().map(|control| scope.uid(*control)).collect(),
                goal: scope.uid(goal),
                goal_offset: scope.kept_offset(end, goal),
                pole: pole.map(|pole| scope.uid(pole)),
                held: held.iter().map(|control| scope.uid(*control)).collect(),
            },
        };
        scope.switch("switch", start, switch)
    }

    fn resize(&mut self, change: &Resize) {
        self.prefer = self.prefer.map(|prefer| change.turned(prefer));
    }

    fn mirror(&mut self) {
        self.twist = self.twist.opposite();
        self.prefer = self.prefer.map(mirrored_direction);
    }
}
