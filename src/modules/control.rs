//! `control`: what people take hold of.

use bevy::reflect::Reflect;
use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use crate::{
    mesh::model::Trs,
    parameters,
    processor::{
        BuildScope, Creation, ModuleError, NodeId, Resize, RigModule, Side, check_finite, check_limits,
        mirrored_angles, mirrored_direction,
    },
    rig::{
        Channels, Constraint, ControlData, Limits, NodeType, Scalar, Target, degrees,
        nearest::did_you_mean,
        reference::{NodeRef, NodeRefs},
        shapes,
    },
};

/// sRGB colours of controls on the left, on the right and in the middle.
pub const SIDE_COLORS: [[f32; 3]; 3] = [[0.25, 0.55, 1.0], [1.0, 0.3, 0.27], [1.0, 0.82, 0.2]];

/// Directions of a control's axes.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ControlAxes {
    /// Like those of its node.
    #[default]
    Node,
    /// Like those of the rig.
    Rig,
}

/// Directions of a control's shape before its own rotation.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ShapeAxes {
    /// The shape's Y points along the bone that starts at the node.
    #[default]
    Bone,
    /// The shape's axes are the control's.
    Control,
    /// The shape's axes are the rig's.
    Rig,
}

parameters! {
    /// Makes a control for each of some nodes, which follow it. Roles: `control`, and `offset` for the null that takes its
    /// place.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::control::ControlModule};
    /// let params = r#"(shape: "cube", size: 0.1, limits: (rotate: ((-90.0, 90.0), (None, None), (None, None))))"#;
    /// # assert!(rigsmith::modules::all().load(ControlModule::NAME, params).is_ok());
    /// ```
    pub struct ControlModule {
        /// The nodes that get one.
        pub at: NodeRefs = NodeRef::this().into(),
        /// Parent of the controls; the parent of each node if left out.
        pub parent: NodeRefs = NodeRefs::NONE,
        /// True: each stands below the control of the nearest node above it in the list.
        pub hierarchy: bool = true,
        /// node: its axes lie like its node's; rig: like the rig's.
        pub axes: ControlAxes = ControlAxes::Node,
        /// True: a null takes its place, so that its own base changes nothing.
        pub offset_group: bool = true,
        /// True: the nodes follow their controls in place and turn.
        pub follow: bool = true,
        /// True: the nodes follow the scale of their controls, too.
        pub follow_scale: bool = false,
        /// True: the nodes' own pose, of an expression say, is put on top of what their controls say.
        pub keep_pose: bool = false,
        /// Name of the wire shape.
        pub shape: String = "circle".to_owned(),
        /// Half the width of the shape in the rig's units, above 0; from the bone's length if left out.
        pub size: Option<f32> = None,
        /// Half the width of the shape as a share of the bone's length, where size is left out.
        pub relative_size: f32 = 0.35,
        /// bone: the shape's Y lies along the bone; control: along the control's Y; rig: along the rig's.
        pub shape_axes: ShapeAxes = ShapeAxes::Bone,
        /// Offset of the shape along its own axes, in the rig's units.
        pub shape_translate: Vec3 = Vec3::ZERO,
        /// Turn of the shape about X, Y and Z, in degrees.
        pub shape_rotate: Vec3 = Vec3::ZERO,
        /// Factors of the shape along X, Y and Z.
        pub shape_scale: Vec3 = Vec3::ONE,
        /// sRGB colour, 0 to 1 each; by the side of the body if left out.
        pub color: Option<[f32; 3]> = None,
        /// Axes of translation, rotation and scale that people move and keys are set on.
        pub channels: Channels = Channels::default(),
        /// Lowest and highest values of these; rotation in degrees.
        pub limits: Limits = Limits::default(),
        /// Name, groups and label; by default those of the node.
        pub creation: Creation = Creation::default(),
    }
}

impl RigModule for ControlModule {
    const NAME: &'static str = "control";
    const DOC: &'static str = "Makes a control, which people move and animate, for each of some nodes.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["shape_translate", "shape_rotate", "limits", "color"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/control.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/control.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        self.check(scope)?;
        let nodes = scope.resolve_some("at", &self.at)?;
        let parent = scope.resolve_parent("parent", &self.parent)?;
        let mut controls: Vec<NodeId> = Vec::with_capacity(nodes.len());
        for (index, node) in nodes.iter().copied().enumerate() {
            let upper = if self.hierarchy { scope.upper_in(node, &nodes[..index]) } else { None };
            let above = match (upper, parent) {
                (Some(upper), _) => Some(controls[upper]),
                (None, Some(parent)) => parent,
                (None, None) => scope.parent(node),
            };
            // The control of the node right above, whose space is that of the node's own parent.
            let parent_control =
                upper.filter(|upper| scope.parent(node) == Some(nodes[*upper])).map(|upper| controls[upper]);
            let control = self.make(scope, node, index, above, parent_control)?;
            controls.push(control);
        }
        Ok(())
    }

    fn resize(&mut self, change: &Resize) {
        self.size = self.size.map(|size| size * change.factor);
        self.shape_translate *= change.factor;
        self.limits = self.limits.resized(change.factor);
    }

    fn mirror(&mut self) {
        self.shape_translate = mirrored_direction(self.shape_translate);
        self.shape_rotate = mirrored_angles(self.shape_rotate);
        self.limits = self.limits.mirrored();
        if let Some(color) = &mut self.color {
            let [left, right, _] = SIDE_COLORS;
            *color = match *color {
                color if color == left => right,
                color if color == right => left,
                color => color,
            };
        }
    }
}

impl ControlModule {
    fn check(&self, scope: &BuildScope<'_>) -> Result<(), ModuleError> {
        if shapes::shape(&self.shape).is_none() {
            let nearest = did_you_mean(&self.shape, shapes::names());
            return Err(ModuleError::parameter("shape", format!("there is no shape \"{}\"{nearest}", self.shape)));
        }
        scope.in_range("size", self.size.unwrap_or(1.0), f32::MIN_POSITIVE..=f32::INFINITY)?;
        scope.in_range("relative_size", self.relative_size, f32::MIN_POSITIVE..=f32::INFINITY)?;
        for (parameter, vector) in [
            ("shape_translate", self.shape_translate),
            ("shape_rotate", self.shape_rotate),
            ("shape_scale", self.shape_scale),
        ] {
            check_finite(parameter, &vector.to_array())?;
        }
        for part in self.color.unwrap_or_default() {
            scope.in_range("color", part, 0.0..=1.0)?;
        }
        check_limits("limits", &self.limits)
    }

    fn make(
        &self,
        scope: &mut BuildScope<'_>,
        node: NodeId,
        index: usize,
        above: Option<NodeId>,
        upper: Option<NodeId>,
    ) -> Result<NodeId, ModuleError> {
        let place = match self.axes {
            ControlAxes::Node => scope.global(node),
            ControlAxes::Rig => Trs { translation: scope.position(node), ..Trs::IDENTITY },
        };
        let creation = scope.creation_for(&self.creation, node, index);
        let control = if self.offset_group {
            let name = creation.name.as_ref().map(|name| format!("{name}_offset"));
            let own = Creation { name, ..creation.clone() };
            let offset = scope.spawn_at(NodeType::Null, "offset", node, 0, above, place, &own)?;
            scope.spawn(NodeType::Control, "control", node, 0, Some(offset), Trs::IDENTITY, &creation)?
        } else {
            scope.spawn_at(NodeType::Control, "control", node, 0, above, place, &creation)?
        };
        let data = ControlData {
            shape: self.shape.clone(),
            color: self.color.unwrap_or_else(|| match scope.named_side(node) {
                Side::Left => SIDE_COLORS[0],
                Side::Right => SIDE_COLORS[1],
                Side::Middle => SIDE_COLORS[2],
            }),
            size: self.size.unwrap_or_else(|| self.relative_size * scope.bone_length(node)),
            offset: self.shape_offset(scope, node, place),
            channels: self.channels,
            limits: self.limits,
        };
        scope.set_control(control, data);
        if self.follow {
            let constraint = match upper {
                // A joint that may be driven together with the one above it, by inverse kinematics say, cannot follow in
                // the rig's space: that would depend on where the one above ends up.
                Some(upper) if self.axes == ControlAxes::Node && !self.follow_scale && !self.keep_pose => {
                    Constraint::Relative {
                        driven: scope.uid(node),
                        source: scope.uid(control),
                        space: scope.uid(upper),
                        translate: true,
                        rotate: true,
                        weight: Scalar::Value(1.0),
                    }
                }
                _ => self.following(scope, node, control, place),
            };
            scope.constrain("follow", node, 0, constraint)?;
        }
        Ok(control)
    }

    /// The node stands where its control says, in the rig's space.
    fn following(&self, scope: &mut BuildScope<'_>, node: NodeId, control: NodeId, place: Trs) -> Constraint {
        let offset = match self.axes {
            ControlAxes::Node => Trs::IDENTITY,
            ControlAxes::Rig => scope.global(node).relative_to(&place),
        };
        Constraint::Transform {
            driven: scope.uid(node),
            targets: vec![Target { node: scope.uid(control), weight: Scalar::Value(1.0), offset }],
            translate: [true; 3],
            rotate: [true; 3],
            scale: [self.follow_scale; 3],
            weight: Scalar::Value(1.0),
            keep_pose: self.keep_pose,
        }
    }

    /// Transform of the shape in the control's space.
    fn shape_offset(&self, scope: &mut BuildScope<'_>, node: NodeId, place: Trs) -> Trs {
        let back = place.rotation.inverse();
        let axes = match self.shape_axes {
            ShapeAxes::Control => Quat::IDENTITY,
            ShapeAxes::Rig => back,
            ShapeAxes::Bone => match scope.bone(node).map(|bone| (back * bone).normalize()) {
                // Exactly along an axis is the rule, and shall not become nearly so by rounding.
                Some(bone) if bone.dot(Vec3::Y) < 1.0 - 1e-5 => Quat::from_rotation_arc(Vec3::Y, bone),
                _ => Quat::IDENTITY,
            },
        };
        let rotation = (axes * degrees(self.shape_rotate)).normalize();
        Trs { translation: axes * self.shape_translate, rotation, scale: self.shape_scale }
    }
}
