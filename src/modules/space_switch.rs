//! `space_switch`: a control that moves with one of several nodes, as an attribute says.

use crate::{
    parameters,
    processor::{BuildScope, Creation, ModuleError, RigModule},
    rig::{
        AttributeKind, Constraint, Matching, NodeType, Scalar, SwitchData, Target,
        label::mirror_label,
        reference::{NodeRef, NodeRefs},
    },
};

parameters! {
    /// Lets a control move with one of several nodes, as a choice attribute says; thrown without a jump.
    ///
    /// A null between the control and its parent follows the chosen space and keeps how it was built relative to it, so the
    /// control itself stays free.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::space_switch::SpaceSwitch};
    /// let params = r#"(
    ///     control: "@command control/hand_l#00000000000000aa",
    ///     spaces: "@command control/root#00000000000000a0 + @joint chest#0000000000000005 + @joint head#0000000000000007",
    ///     names: ["world", "chest", "head"],
    /// )"#;
    /// # rigsmith::modules::all().load(SpaceSwitch::NAME, params).map(|_| ()).unwrap();
    /// ```
    pub struct SpaceSwitch {
        /// The control that changes spaces. A null that follows the space is put between it and its parent.
        pub control: NodeRefs = NodeRef::this().into(),
        /// Nodes that the control can move with, in the order of the choices.
        pub spaces: NodeRefs = NodeRefs::NONE,
        /// A name for each space, in that order; the nodes' own names if left out.
        pub names: Vec<String> = Vec::new(),
        /// The control that carries the attribute; the control itself if left out.
        pub attribute_on: NodeRefs = NodeRefs::NONE,
        /// Name of the choice attribute that is added.
        pub attribute: String = "space".to_owned(),
        /// Number of the space until somebody chooses another, counted from 0.
        pub default: u32 = 0,
        /// The position follows the space.
        pub translate: bool = true,
        /// The rotation follows the space.
        pub rotate: bool = true,
        /// The scale follows the space.
        pub scale: bool = false,
        /// Name, group and label of the null.
        pub creation: Creation = Creation::default(),
    }
}

impl RigModule for SpaceSwitch {
    const NAME: &'static str = "space_switch";
    const DOC: &'static str = "Lets a control move with one of several nodes, as an attribute says; spaces can be changed \
                               without a jump.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["names", "attribute"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/space_switch.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/space_switch.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        let control = scope.resolve_one("control", &self.control)?;
        // A space that is off keeps its number, which values and keys hold: chosen, it is the control's parent.
        let spaces = scope.resolve_each("spaces", &self.spaces)?;
        let names: Vec<String> = match self.names.len() {
            0 => {
                spaces.iter().map(|space| space.map_or_else(|| "off".to_owned(), |it| scope.name_to_keep(it))).collect()
            }
            count if count == spaces.len() => self.names.clone(),
            count => {
                return Err(ModuleError::parameter(
                    "names",
                    format!("there are {count} for {} spaces; write one for each, in their order", spaces.len()),
                ));
            }
        };
        if self.default as usize >= spaces.len() {
            return Err(ModuleError::parameter(
                "default",
                format!("there is no space {}; they are counted from 0 to {}", self.default, spaces.len() - 1),
            ));
        }
        if !(self.translate || self.rotate || self.scale) {
            return Err(ModuleError::parameter("translate", "nothing follows; turn on translate, rotate or scale"));
        }
        let carrier = scope.resolve_maybe("attribute_on", &self.attribute_on)?.unwrap_or(control);
        let parent = scope.parent(control);
        let global = scope.global(control);
        let null = scope.spawn_at(NodeType::Null, "space", control, 0, parent, global, &self.creation)?;
        scope.set_parent(control, Some(null))?;
        let attribute = crate::rig::Attribute {
            name: self.attribute.as_str().into(),
            kind: AttributeKind::Choice(names),
            default: self.default as f32,
        };
        scope.add_attribute(carrier, attribute)?;
        let mut targets = Vec::with_capacity(spaces.len());
        let built = spaces.iter().enumerate().filter_map(|(number, space)| Some((number, (*space)?)));
        for (number, space) in built {
            targets.push(Target {
                node: scope.uid(space),
                weight: Scalar::Choice {
                    node: scope.uid(carrier),
                    name: self.attribute.as_str().into(),
                    value: number as f32,
                },
                offset: scope.kept_offset(null, space),
            });
        }
        let constraint = Constraint::Transform {
            driven: scope.uid(null),
            targets,
            translate: [self.translate; 3],
            rotate: [self.rotate; 3],
            scale: [self.scale; 3],
            weight: Scalar::Value(1.0),
            keep_pose: false,
        };
        scope.constrain("follow", control, 0, constraint)?;
        let switch = SwitchData {
            command: scope.command(),
            control: scope.uid(carrier),
            attribute: self.attribute.as_str().into(),
            matching: Matching::Space { control: scope.uid(control) },
        };
        scope.switch("switch", control, switch)
    }

    fn mirror(&mut self) {
        self.names.iter_mut().for_each(mirror_label);
    }
}
