//! `control`: what people take hold of.

use bevy::{math::ops, reflect::Reflect};
use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use crate::{
    mesh::model::Trs,
    parameters,
    processor::{
        BuildScope, Creation, ListedNodes, ModuleError, NodeId, Resize, RigModule, Side, check_finite, check_limits,
        mirrored_angles, mirrored_direction, opposite,
    },
    rig::{
        Channels, Constraint, ControlData, Limits, NodeType, Scalar, Target, degrees,
        nearest::did_you_mean,
        reference::{NodeRef, NodeRefs},
        shapes,
    },
};

/// Sine of the bend under which two bones count as straight.
const STRAIGHT: f32 = 1e-3;

/// Angle in degrees by which a hinge about X has to be bent as built to say in which sense it bends.
const FLAT: f32 = 2.0;

/// A node that turns about one axis.
#[derive(Debug, Clone, Copy)]
struct Hinge {
    /// Rotation of the control in the rig's space: its X is the axis.
    rotation: Quat,
    /// Angle between the two bones as built, in degrees, and 1.0 if a turn about X bends them further, else -1.0.
    bent: Option<(f32, f32)>,
}

/// sRGB colours of controls on the left, on the right and in the middle.
pub const SIDE_COLORS: [[f32; 3]; 3] = [[0.25, 0.55, 1.0], [1.0, 0.3, 0.27], [1.0, 0.82, 0.2]];

/// Colour of controls on a side.
pub fn side_color(side: Side) -> [f32; 3] {
    match side {
        Side::Left => SIDE_COLORS[0],
        Side::Right => SIDE_COLORS[1],
        Side::Middle => SIDE_COLORS[2],
    }
}

/// Directions of a control's axes.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ControlAxes {
    /// Directions of the axes of its node.
    #[default]
    Node,
    /// Directions of the axes of the rig.
    Rig,
}

/// Axis about which the control of a hinge turns.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HingeAxis {
    /// The axis about which the bones above and below the node are bent as built; the control's X lies along it. X of the
    /// node where the bones are straight.
    #[default]
    Bend,
    /// X of the node. A node that is built bent bends further in that sense, a straight one in that of a turn about X.
    X,
}

/// Axis and range of the controls of hinges.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HingeRange {
    /// Axis of the turn.
    pub axis: HingeAxis,
    /// Least angle between the two bones in degrees, 0 where they are straight.
    pub min: Option<f32>,
    /// Greatest angle between the two bones in degrees.
    pub max: Option<f32>,
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
        /// Directions of the control's axes, node: like its node's; rig: like the rig's.
        pub axes: ControlAxes = ControlAxes::Node,
        /// Turn of the axes of the rig that the control or its shape has, about X, Y and Z, in degrees: of a figure that does
        /// not stand along Y.
        pub axes_rotate: Vec3 = Vec3::ZERO,
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
        /// Direction of the shape's Y, bone: along the bone; control: along the control's Y; rig: along the rig's.
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
        /// Nodes among them whose controls the limits are for; all of them without any.
        pub limited: NodeRefs = NodeRefs::NONE,
        /// Nodes among them whose controls turn about one axis only, such as elbows and knees.
        pub hinges: NodeRefs = NodeRefs::NONE,
        /// The axis of hinges (bend: about which the bones are bent as built; x: X of the node), and the least and the
        /// greatest angle between the two bones in degrees, 0 where they are straight.
        pub hinge: HingeRange = HingeRange::default(),
        /// Name, groups and label; by default those of the node.
        pub creation: Creation = Creation::default(),
    }
}

/// A control, and the node that stands on it as its node does.
#[derive(Debug, Clone, Copy)]
struct MadeControl {
    control: NodeId,
    /// The control itself, or a null on one whose axes lie otherwise.
    carrier: NodeId,
}

impl RigModule for ControlModule {
    const NAME: &'static str = "control";
    const DOC: &'static str = "Makes a control, which people move and animate, for each of some nodes.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["axes_rotate", "shape_translate", "shape_rotate", "limits", "color"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/control.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/control.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        self.check(scope)?;
        let nodes = scope.resolve_some("at", &self.at)?;
        let parent = scope.resolve_parent("parent", &self.parent)?;
        let listed: ListedNodes = nodes.iter().copied().collect();
        let hinges = among(scope, &listed, "hinges", &self.hinges)?;
        let limited = among(scope, &listed, "limited", &self.limited)?;
        let mut controls: Vec<MadeControl> = Vec::with_capacity(nodes.len());
        let mut controlled = ListedNodes::default();
        for (index, node) in nodes.iter().copied().enumerate() {
            let upper = if self.hierarchy { scope.upper_in(node, &controlled) } else { None };
            let above = match (upper, parent) {
                (Some(upper), _) => Some(controls[upper].control),
                (None, Some(parent)) => parent,
                (None, None) => scope.parent(node),
            };
            // The control of the node right above, whose space is that of the node's own parent.
            let parent_control =
                upper.filter(|upper| scope.parent(node) == Some(nodes[*upper])).map(|upper| controls[upper].carrier);
            let hinge = if hinges.contains(node) { Some(self.hinge(scope, node, &listed)) } else { None };
            let is_limited = self.limited == NodeRefs::NONE || limited.contains(node);
            let limits = if is_limited { self.limits } else { Limits::default() };
            controls.push(self.make(scope, node, index, above, parent_control, (limits, hinge))?);
            controlled.push(node);
        }
        Ok(())
    }

    fn resize(&mut self, change: &Resize) {
        self.size = self.size.map(|size| size * change.factor);
        self.shape_translate *= change.factor;
        self.limits = self.limits.resized(change.factor);
        if self.axes == ControlAxes::Rig || self.shape_axes == ShapeAxes::Rig {
            self.axes_rotate = change.turned_angles(self.axes_rotate);
        }
    }

    fn mirror(&mut self) {
        self.axes_rotate = mirrored_angles(self.axes_rotate);
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

/// Nodes that a parameter names among those that get a control.
fn among(
    scope: &mut BuildScope<'_>,
    nodes: &ListedNodes,
    parameter: &str,
    named: &NodeRefs,
) -> Result<ListedNodes, ModuleError> {
    let found = scope.resolve(parameter, named)?;
    if let Some(outside) = found.iter().find(|node| !nodes.contains(**node)) {
        let problem = format!("{} gets no control here; name nodes of \"at\"", scope.name(*outside));
        return Err(ModuleError::reference(parameter, named, problem));
    }
    Ok(found.into_iter().collect())
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
            ("axes_rotate", self.axes_rotate),
            ("shape_translate", self.shape_translate),
            ("shape_rotate", self.shape_rotate),
            ("shape_scale", self.shape_scale),
        ] {
            check_finite(parameter, &vector.to_array())?;
        }
        for part in self.color.unwrap_or_default() {
            scope.in_range("color", part, 0.0..=1.0)?;
        }
        let (low, high) = (self.hinge.min.unwrap_or(-180.0), self.hinge.max.unwrap_or(180.0));
        scope.in_range("hinge.min", low, -180.0..=180.0)?;
        scope.in_range("hinge.max", high, low..=180.0)?;
        check_limits("limits", &self.limits)
    }

    /// The hinge of a node between two bones: how its control is turned, and how it is bent as built.
    fn hinge(&self, scope: &mut BuildScope<'_>, node: NodeId, nodes: &ListedNodes) -> Hinge {
        let global = scope.global(node);
        let plain = Hinge { rotation: global.rotation, bent: None };
        let own = scope.child_joints(node).into_iter().find(|child| nodes.contains(*child));
        let lower = match own {
            Some(child) => Some(scope.position(child) - global.translation),
            None => scope.bone(node),
        };
        let upper = scope.parent(node).map(|parent| global.translation - scope.position(parent));
        let unit = |bone: Option<Vec3>| bone.and_then(Vec3::try_normalize);
        let (Some(upper), Some(lower)) = (unit(upper), unit(lower)) else { return plain };
        let x = global.rotation * Vec3::X;
        let across = upper.cross(lower);
        if self.hinge.axis == HingeAxis::X {
            // Seen along the axis.
            let flat = |bone: Vec3| bone - x * bone.dot(x);
            let (upper, lower) = (flat(upper), flat(lower));
            let bent = ops::atan2(upper.cross(lower).dot(x), upper.dot(lower)).to_degrees();
            let sense = if bent < -FLAT { -1.0 } else { 1.0 };
            return Hinge { bent: Some((bent * sense, sense)), ..plain };
        }
        let (Some(axis), true) = (across.try_normalize(), across.length() > STRAIGHT) else { return plain };
        // The axis that is nearer to the node's own: a control turns in the sense in which its node does.
        let sense = if axis.dot(x) < 0.0 { -1.0 } else { 1.0 };
        // A node with its X along the axis is as it is, not nearly so by rounding.
        let rotation = match axis.dot(x).abs() {
            near if near > 1.0 - 1e-6 => global.rotation,
            _ => (Quat::from_rotation_arc(x, axis * sense) * global.rotation).normalize(),
        };
        let bent = ops::atan2(across.length(), upper.dot(lower)).to_degrees();
        Hinge { rotation, bent: Some((bent, sense)) }
    }

    /// Limits of the control of a hinge: the range of the bend, from how it is bent as built.
    fn hinge_limits(&self, mut limits: Limits, hinge: &Hinge) -> Limits {
        if let Some((bent, sense)) = hinge.bent {
            let low = self.hinge.min.map(|low| (low - bent).min(0.0));
            let high = self.hinge.max.map(|high| (high - bent).max(0.0));
            let opposed = |end: Option<f32>| end.map(opposite);
            limits.rotate[0] = if sense < 0.0 { (opposed(high), opposed(low)) } else { (low, high) };
        }
        limits
    }

    fn make(
        &self,
        scope: &mut BuildScope<'_>,
        node: NodeId,
        index: usize,
        above: Option<NodeId>,
        upper: Option<NodeId>,
        (limits, hinge): (Limits, Option<Hinge>),
    ) -> Result<MadeControl, ModuleError> {
        let own = scope.global(node);
        let place = match (self.axes, &hinge) {
            (ControlAxes::Node, Some(hinge)) => Trs { rotation: hinge.rotation, ..own },
            (ControlAxes::Node, None) => own,
            (ControlAxes::Rig, _) => {
                Trs { translation: own.translation, rotation: degrees(self.axes_rotate), scale: Vec3::ONE }
            }
        };
        let channels = match hinge {
            Some(_) => Channels { rotate: [true, false, false], ..self.channels },
            None => self.channels,
        };
        let limits = hinge.as_ref().map_or(limits, |hinge| self.hinge_limits(limits, hinge));
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
            color: self.color.unwrap_or_else(|| side_color(scope.named_side(node))),
            size: self.size.unwrap_or_else(|| self.relative_size * scope.bone_length(node)),
            offset: self.shape_offset(scope, node, place),
            // A size that somebody wrote stays.
            fits: self.size.is_none(),
            channels,
            limits,
        };
        scope.set_control(control, data);
        let is_turned = self.follow && self.axes == ControlAxes::Node && place.rotation != own.rotation;
        let carrier = match is_turned {
            // A null that stands as the node does, below the control with axes of its own.
            true => scope.spawn_at(NodeType::Null, "carrier", node, 0, Some(control), own, &self.carrier(&creation))?,
            false => control,
        };
        if self.follow {
            let constraint = match upper {
                // A joint that may be driven together with the one above it, by inverse kinematics say, cannot follow in
                // the rig's space: that would depend on where the one above ends up.
                Some(upper) if self.axes == ControlAxes::Node && !self.follow_scale && !self.keep_pose => {
                    Constraint::Relative {
                        driven: scope.uid(node),
                        source: scope.uid(carrier),
                        space: scope.uid(upper),
                        translate: true,
                        rotate: true,
                        weight: Scalar::Value(1.0),
                    }
                }
                _ => self.following(scope, node, carrier, if is_turned { own } else { place }),
            };
            scope.constrain("follow", node, 0, constraint)?;
        }
        Ok(MadeControl { control, carrier })
    }

    /// Name, groups and label of the null that carries a node for its control.
    fn carrier(&self, creation: &Creation) -> Creation {
        let name = creation.name.as_ref().map(|name| format!("{name}_carrier"));
        Creation { name, ..creation.clone() }
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
            // Without a turn to the bit as the inverse.
            ShapeAxes::Rig if self.axes_rotate == Vec3::ZERO => back,
            ShapeAxes::Rig => (back * degrees(self.axes_rotate)).normalize(),
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
