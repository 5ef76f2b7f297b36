//! `reverse_foot`: pivots over which a foot rolls, from heel to toe and from side to side.

use glam::{Mat3, Quat, Vec3};

use crate::{
    mesh::model::Trs,
    modules::control::side_color,
    parameters,
    processor::{Amount, BuildScope, Creation, ModuleError, NodeId, Resize, RigModule, mirrored_direction},
    rig::{
        AttributeKind, Channel, Channels, Constraint, ControlData, KeyEase, Limits, NodeType, Output, Scalar, Target,
        reference::{NodeRef, NodeRefs},
    },
};

parameters! {
    /// Makes the pivots of a foot below its control, and the attributes that roll it.
    ///
    /// The pivots carry one another: heel, toe tip, outer and inner edge, the turn on the ball, the lift on the ball. The
    /// last carries the node with the role `goal`, to which the leg's inverse kinematics go.
    ///
    /// ```
    /// # use rigsmith::{processor::RigModule, modules::reverse_foot::ReverseFoot};
    /// let params = r#"(
    ///     ankle: "@joint foot_l#0000000000000003",
    ///     ball: "@joint ball_l#0000000000000004",
    ///     toe: "@joint toe_l#0000000000000005",
    ///     control: "@command control/foot_l#00000000000000aa",
    /// )"#;
    /// # rigsmith::modules::all().load(ReverseFoot::NAME, params).map(|_| ()).unwrap();
    /// ```
    pub struct ReverseFoot {
        /// The ankle's joint: the end of the leg.
        pub ankle: NodeRefs = NodeRef::this().into(),
        /// The joint at the ball of the foot.
        pub ball: NodeRefs = NodeRefs::NONE,
        /// A joint or null at the tip of the toes; beyond the ball, half as far as it is from ankle, if left out.
        pub toe: NodeRefs = NodeRefs::NONE,
        /// The foot's control; the pivots hang below it, and it gets the attributes.
        pub control: NodeRefs = NodeRefs::NONE,
        /// A joint or null at the back of the sole; placed by heel_back if left out.
        pub heel: NodeRefs = NodeRefs::NONE,
        /// A joint or null at the inner edge of the sole; placed by width if left out.
        pub inner: NodeRefs = NodeRefs::NONE,
        /// A joint or null at the outer edge of the sole; placed by width if left out.
        pub outer: NodeRefs = NodeRefs::NONE,
        /// Distance of the heel behind the ankle, as a share of that from ankle to toe tip; 0 or more.
        pub heel_back: f32 = 0.3,
        /// Width of the sole at the ball, as a share of the distance from ankle to toe tip; 0 or more.
        pub width: f32 = 0.4,
        /// Direction up from the sole, in the rig's space.
        pub up: Vec3 = Vec3::Y,
        /// Degrees at which the roll moves on from ball to toe, until somebody sets others; 0 to 180.
        pub break_angle: f32 = 35.0,
        /// A control beside each pivot, which turns the foot about it; their roles are `heel_control`, `toe_control`,
        /// `outer_control`, `inner_control` and `ball_control`.
        pub pivots: bool = false,
        /// Half the width of these controls, as a share of the distance from ankle to toe tip.
        pub pivot_size: f32 = 0.12,
        /// The ball's joint turns with the toes, which stay flat while the heel lifts.
        pub drive_ball: bool = true,
        /// Share of that, 0 to 1: a number or an attribute's name, such as that of ik_fk_switch.
        pub weight: Amount = Amount::Value(1.0),
        /// The control that carries that attribute; the foot's if left out.
        pub weight_control: NodeRefs = NodeRefs::NONE,
        /// Name, group and label of the pivots.
        pub creation: Creation = Creation::default(),
    }
}

/// Positions of the pivots in the rig's space.
struct Sole {
    heel: Vec3,
    toe: Vec3,
    ball: Vec3,
    inner: Vec3,
    outer: Vec3,
    /// Y up, Z to the toes.
    frame: Quat,
    /// Y up, Z such that a turn about it tips outwards.
    tip: Quat,
    /// Distance from ankle to toe tip along the ground.
    length: f32,
}

impl RigModule for ReverseFoot {
    const NAME: &'static str = "reverse_foot";
    const DOC: &'static str = "Makes the pivots over which a foot rolls, with the attributes roll, bank, toe, swivel and \
                               break_angle; the node with the role goal is where the leg's inverse kinematics go.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = Self::PARAMETERS;
    const SIDED: &'static [&'static str] = &["up"];
    const FORM: Option<&'static str> = Some(include_str!("../../assets/modules/reverse_foot.ui.ron"));
    const ICON: Option<&'static str> = Some(include_str!("../../assets/modules/reverse_foot.svg"));

    fn construct(&self, scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        let ankle = scope.resolve_one("ankle", &self.ankle)?;
        let ball = scope.resolve_one("ball", &self.ball)?;
        let toe = scope.resolve_maybe("toe", &self.toe)?;
        let control = scope.resolve_one("control", &self.control)?;
        let sole = self.sole(scope, ankle, ball, toe)?;

        let at = |translation: Vec3, rotation: Quat| Trs { translation, rotation, scale: Vec3::ONE };
        let make = |scope: &mut BuildScope<'_>, role: &str, parent: NodeId, place: Trs| {
            scope.spawn_at(NodeType::Null, role, ankle, 0, Some(parent), place, &self.creation)
        };
        let size = self.pivot_size * sole.length;
        let pivot = |scope: &mut BuildScope<'_>, [role, name]: [&str; 2], parent: NodeId, place: Trs| {
            let node = make(scope, role, parent, place)?;
            if self.pivots {
                self.pivot_control(scope, [ankle, parent, node], name, place, size)?;
            }
            Ok(node)
        };
        let heel = pivot(scope, ["heel", "heel_control"], control, at(sole.heel, sole.frame))?;
        let toe_tip = pivot(scope, ["toe_tip", "toe_control"], heel, at(sole.toe, sole.frame))?;
        let outer = pivot(scope, ["outer", "outer_control"], toe_tip, at(sole.outer, sole.tip))?;
        let inner = pivot(scope, ["inner", "inner_control"], outer, at(sole.inner, sole.tip))?;
        let swivel = make(scope, "swivel", inner, at(sole.ball, sole.frame))?;
        let lift = pivot(scope, ["ball", "ball_control"], swivel, at(sole.ball, sole.frame))?;
        let toes = make(scope, "toes", swivel, at(sole.ball, sole.frame))?;
        let ankle_global = scope.global(ankle);
        make(scope, "goal", lift, at(ankle_global.translation, ankle_global.rotation))?;

        let open = AttributeKind::Number { min: None, max: None };
        let mut attribute = |name: &str, kind: &AttributeKind, default: f32| {
            scope.ensure_attribute(control, name, kind.clone(), default)
        };
        let roll = attribute("roll", &open, 0.0)?;
        let bank = attribute("bank", &open, 0.0)?;
        let toe_lift = attribute("toe", &open, 0.0)?;
        let turn = attribute("swivel", &open, 0.0)?;
        let angles = AttributeKind::Number { min: Some(0.0), max: Some(180.0) };
        let break_angle = attribute("break_angle", &angles, self.break_angle)?;
        let foot = Constraint::Foot {
            heel: scope.uid(heel),
            toe: scope.uid(toe_tip),
            ball: scope.uid(lift),
            inner: Some(scope.uid(inner)),
            outer: Some(scope.uid(outer)),
            roll,
            break_angle,
            bank,
            toes: Some((scope.uid(toes), toe_lift)),
            // The toes turn along, so a pivot of its own carries both them and the lift.
            swivel: Scalar::Value(0.0),
        };
        scope.constrain("foot", ankle, 0, foot)?;
        let turning = Constraint::DrivenKey {
            driver: turn,
            keys: vec![(-720.0, -720.0), (720.0, 720.0)],
            ease: KeyEase::Linear,
            output: Output::Channel(scope.uid(swivel), Channel::RotateY),
        };
        scope.constrain("turn", ankle, 0, turning)?;
        if self.drive_ball {
            let carrier = scope.resolve_maybe("weight_control", &self.weight_control)?.unwrap_or(control);
            let weight = scope.amount("weight", &self.weight, Some(carrier), 0.0..=1.0, 1.0)?;
            let target =
                Target { node: scope.uid(toes), weight: Scalar::Value(1.0), offset: scope.kept_offset(ball, toes) };
            let follow = Constraint::Transform {
                driven: scope.uid(ball),
                targets: vec![target],
                translate: [false; 3],
                rotate: [true; 3],
                scale: [false; 3],
                weight,
                keep_pose: true,
            };
            scope.constrain("toes", ball, 0, follow)?;
        }
        Ok(())
    }

    fn resize(&mut self, change: &Resize) {
        self.up = change.turned(self.up);
    }

    fn mirror(&mut self) {
        self.up = mirrored_direction(self.up);
    }
}

impl ReverseFoot {
    /// Makes the control that turns a foot about a pivot.
    ///
    /// The pivot follows its control and does not hang on it: the control above the goal is that of the whole foot, which
    /// moves freely.
    fn pivot_control(
        &self,
        scope: &mut BuildScope<'_>,
        [ankle, parent, pivot]: [NodeId; 3],
        role: &str,
        place: Trs,
        size: f32,
    ) -> Result<(), ModuleError> {
        let name = self.creation.name.as_ref().map(|name| format!("{name}_{role}"));
        let creation = Creation { name, ..self.creation.clone() };
        let control = scope.spawn_at(NodeType::Control, role, ankle, 0, Some(parent), place, &creation)?;
        let side = scope.named_side(ankle);
        let data = ControlData {
            shape: "sphere".to_owned(),
            color: side_color(side),
            size,
            offset: Trs::IDENTITY,
            fits: true,
            channels: Channels { translate: [false; 3], rotate: [true; 3], scale: [false; 3] },
            limits: Limits::default(),
        };
        scope.set_control(control, data);
        let target = Target { node: scope.uid(control), weight: Scalar::Value(1.0), offset: Trs::IDENTITY };
        // Roll and bank turn the pivot on top of this.
        let follow = Constraint::Transform {
            driven: scope.uid(pivot),
            targets: vec![target],
            translate: [false; 3],
            rotate: [true; 3],
            scale: [false; 3],
            weight: Scalar::Value(1.0),
            keep_pose: false,
        };
        scope.constrain("pivot", pivot, 0, follow)?;
        Ok(())
    }

    fn sole(
        &self,
        scope: &mut BuildScope<'_>,
        ankle: NodeId,
        ball: NodeId,
        toe: Option<NodeId>,
    ) -> Result<Sole, ModuleError> {
        scope.in_range("heel_back", self.heel_back, 0.0..=f32::INFINITY)?;
        scope.in_range("width", self.width, 0.0..=f32::INFINITY)?;
        scope.in_range("pivot_size", self.pivot_size, f32::MIN_POSITIVE..=f32::INFINITY)?;
        scope.in_range("break_angle", self.break_angle, 0.0..=180.0)?;
        let up = self.up.try_normalize().ok_or_else(|| {
            ModuleError::parameter("up", "has no direction; write that up from the sole, such as (0, 1, 0)")
        })?;
        let [at_ankle, at_ball] = [ankle, ball].map(|joint| scope.position(joint));
        let flat = |direction: Vec3| direction - up * direction.dot(up);
        let at_toe = toe.map_or_else(|| at_ball + 0.5 * flat(at_ball - at_ankle), |toe| scope.position(toe));
        let ahead = flat(at_toe - at_ankle);
        let length = ahead.length();
        let forward = ahead.try_normalize().ok_or_else(|| {
            ModuleError::parameter("toe", "stands over or under the ankle; choose the tip of the toes, or correct up")
        })?;
        let ground = |point: Vec3| point + up * (at_toe - point).dot(up);
        let side = up.cross(forward);
        let mut pivot = |parameter: &str, references: &NodeRefs, otherwise: Vec3| {
            let node = scope.resolve_maybe(parameter, references)?;
            Ok(node.map_or(otherwise, |node| scope.position(node)))
        };
        let heel = pivot("heel", &self.heel, ground(at_ankle) - forward * (self.heel_back * length))?;
        // The outer edge is away from the middle plane.
        let out = if side.x * at_ball.x < 0.0 { -side } else { side };
        let edge = |share: f32| ground(at_ball) + out * (share * self.width * length);
        let inner = pivot("inner", &self.inner, edge(-0.5))?;
        let outer = pivot("outer", &self.outer, edge(0.5))?;
        let outwards = if flat(outer - inner).dot(side) < 0.0 { -side } else { side };
        let tip = up.cross(outwards);
        Ok(Sole {
            heel,
            toe: at_toe,
            ball: at_ball,
            inner,
            outer,
            frame: Quat::from_mat3(&Mat3::from_cols(side, up, forward)).normalize(),
            tip: Quat::from_mat3(&Mat3::from_cols(up.cross(tip), up, tip)).normalize(),
            length,
        })
    }
}
