//! Lowering of constraints to operations.

mod chains;
mod readers;

use std::sync::Arc;

use glam::{Quat, Vec3};

use super::{
    ConstraintName, NumberPlace, ProgramError,
    cache::ByConstraint,
    graph::Graph,
    name,
    op::{
        AimOp, ExpressionOp, FootOp, KeyOp, LimitOp, Link, N, Op, Pose, Span, SpringOp, StretchOp, TargetReg,
        TransformOp, TwistOp, UpReg, X,
    },
};
use crate::{
    mesh::model::Trs,
    rig::{AimUp, AngleLimits, Collider, Constraint, KeyEase, Output, Scalar, Target, Uid},
    solve::{
        aim::Aim,
        curve::{Curve, CurveKey, Extrapolation, Interpolation},
        expression::Expression,
        limit::Bounds,
        rotate::{direction, unit},
    },
};

/// Adds the operations of all constraints in list order.
pub(super) fn lower(
    graph: &mut Graph<'_>,
    expressions: &mut ByConstraint<Arc<Expression>>,
) -> Result<(), ProgramError> {
    for at in 0..graph.rig.constraints.len() {
        Lower { at, graph, expressions }.constraint()?;
    }
    Ok(())
}

/// Lowering of one constraint.
struct Lower<'g, 'a> {
    at: usize,
    graph: &'g mut Graph<'a>,
    expressions: &'g mut ByConstraint<Arc<Expression>>,
}

impl Lower<'_, '_> {
    fn constraint(&mut self) -> Result<(), ProgramError> {
        let rig = self.graph.rig;
        match &*rig.constraints[self.at].constraint {
            Constraint::Transform { driven, targets, translate, rotate, scale, weight, keep_pose } => {
                self.transform(*driven, targets, [*translate, *rotate, *scale], weight, *keep_pose)
            }
            Constraint::Relative { driven, source, space, translate, rotate, weight } => {
                let node = self.driven("driven node", *driven)?;
                let parent = self.graph.read(self.at, "space", *space)?;
                let target = TargetReg {
                    node: self.graph.read(self.at, "source", *source)?,
                    weight: self.scalar(&Scalar::Value(1.0))?,
                    offset: None,
                };
                let (targets, weight) = (self.targets(vec![target]), self.scalar(weight)?);
                let (input, out) = self.graph.take_local(node, self.at, *translate);
                let (translate, rotate, scale) = ([*translate; 3], [*rotate; 3], [false; 3]);
                let op = TransformOp {
                    input,
                    parent,
                    pose: Pose::NONE,
                    targets,
                    weight,
                    translate,
                    rotate,
                    scale,
                    is_global: false,
                    out,
                };
                self.graph.tables.transforms.push(op);
                let at = self.graph.tables.transforms.len() - 1;
                self.push(Op::Transform(at as u32), node);
                Ok(())
            }
            Constraint::Aim { driven, targets, aim, up, world_up, offset, weight } => {
                self.aim(*driven, targets, [*aim, *up], world_up, *offset, weight)
            }
            Constraint::TwoBone { .. } => self.two_bone(),
            Constraint::Chain { .. } => self.chain(),
            Constraint::Spline { joints, points, stretch, twist, weight } => {
                self.spline(joints, points, [stretch, twist, weight])
            }
            Constraint::Twist { source, reference, axis, driven } => self.twist(*source, *reference, *axis, driven),
            Constraint::Stretch { .. } => self.stretch(),
            Constraint::Limit { driven, limits } => {
                let node = self.driven("node", *driven)?;
                let bounds = |ends: &AngleLimits| Bounds::new(ends.map(|end| end.0), ends.map(|end| end.1));
                let radians = |end: Option<f32>| end.map(f32::to_radians);
                let places = limits.translate.iter().any(|end| *end != (None, None));
                let (input, out) = self.graph.take_local(node, self.at, places);
                let op = LimitOp {
                    input,
                    base: self.graph.base(node),
                    translate: bounds(&limits.translate),
                    rotate: bounds(&limits.rotate.map(|(low, high)| (radians(low), radians(high)))),
                    scale: bounds(&limits.scale),
                    out,
                };
                self.graph.tables.limits.push(op);
                let at = self.graph.tables.limits.len() - 1;
                self.push(Op::Limit(at as u32), node);
                Ok(())
            }
            Constraint::Spring { driven, frequency, damping, weight, translate, rotate, motion, colliders } => {
                self.spring(*driven, [frequency, damping, weight, motion], *translate, *rotate, colliders)
            }
            Constraint::DrivenKey { driver, keys, ease, output } => {
                let interpolation = match ease {
                    KeyEase::Step => Interpolation::Constant,
                    KeyEase::Linear => Interpolation::Linear,
                    KeyEase::Smooth => Interpolation::Smooth,
                };
                let keys: Vec<CurveKey> =
                    keys.iter().map(|(x, y)| CurveKey { interpolation, ..CurveKey::new(*x, *y) }).collect();
                let curve = Curve::new(&keys, [Extrapolation::Hold; 2]).map_err(|error| self.bad(error.to_string()))?;
                let (driver, out) = (self.scalar(driver)?, self.graph.new_n(0.0));
                self.graph.tables.keys.push(KeyOp { driver, curve, out });
                let at = self.graph.tables.keys.len() - 1;
                self.output(Op::Key(at as u32), output, out)
            }
            Constraint::Expression { text, inputs, output } => {
                let read = || {
                    let names: Vec<&str> = inputs.iter().map(|(name, _)| name.as_str()).collect();
                    Expression::new(text, &names).map(Arc::new)
                };
                let expression = self.expressions.try_of(&rig.constraints[self.at].constraint, read);
                let expression = expression.map_err(|error| self.bad(error.to_string()))?;
                let inputs = inputs.iter().map(|(_, scalar)| self.scalar(scalar)).collect::<Result<Vec<N>, _>>()?;
                let inputs = self.numbers(inputs);
                let out = self.graph.new_n(0.0);
                self.graph.tables.expressions.push(ExpressionOp { expression, inputs, out });
                let at = self.graph.tables.expressions.len() - 1;
                self.output(Op::Expression(at as u32), output, out)
            }
            Constraint::Foot { .. } => self.foot(),
            Constraint::Cone { .. }
            | Constraint::PoseReader { .. }
            | Constraint::Travel { .. }
            | Constraint::Path { .. }
            | Constraint::Rivet { .. } => self.reader(),
        }
    }

    fn transform(
        &mut self,
        driven: Uid,
        targets: &[Target],
        [translate, rotate, scale]: [[bool; 3]; 3],
        weight: &Scalar,
        keep_pose: bool,
    ) -> Result<(), ProgramError> {
        let node = self.driven("driven node", driven)?;
        if targets.is_empty() {
            return Err(self.too_few("targets", 0, 1));
        }
        // An offset translation follows the turns and scales of the target, and so do rotations.
        let whole = rotate != [false; 3] || scale != [false; 3];
        let list = targets.iter().map(|target| self.target(target, whole)).collect::<Result<Vec<_>, _>>()?;
        let is_whole = !keep_pose
            && [translate, rotate] == [[true; 3]; 2]
            && (scale == [true; 3] || scale == [false; 3])
            && matches!(weight, Scalar::Value(weight) if *weight >= 1.0);
        let is_sure = targets.iter().any(|target| matches!(target.weight, Scalar::Value(weight) if weight > 0.0));
        let (targets, weight) = (self.targets(list), self.scalar(weight)?);
        let (mut input, out) = self.graph.take_local(node, self.at, translate != [false; 3]);
        let pose = if keep_pose { self.graph.pose(node) } else { Pose::NONE };
        let mut parent = self.graph.parent(node);
        let at = self.graph.tables.transforms.len() as u32;
        if is_whole {
            self.graph.is_whole(node, at);
        }
        if is_whole && is_sure && scale[0] && self.graph.is_last(self.at, driven) {
            // Nothing of the node's own transform is left.
            (input, parent) = (X::RIG, X::RIG);
        }
        let op = TransformOp { input, parent, pose, targets, weight, translate, rotate, scale, is_global: false, out };
        self.graph.tables.transforms.push(op);
        self.push(Op::Transform(at), node);
        Ok(())
    }

    fn aim(
        &mut self,
        driven: Uid,
        targets: &[Target],
        [axis, up_axis]: [Vec3; 2],
        world_up: &AimUp,
        offset: Quat,
        weight: &Scalar,
    ) -> Result<(), ProgramError> {
        let node = self.driven("driven node", driven)?;
        if targets.is_empty() {
            return Err(self.too_few("targets", 0, 1));
        }
        let list = targets
            .iter()
            .map(|target| {
                let node = self.graph.read_position(self.at, "target", target.node)?;
                Ok(TargetReg { node, weight: self.scalar(&target.weight)?, offset: None })
            })
            .collect::<Result<Vec<_>, ProgramError>>()?;
        let targets = self.targets(list);
        let up = match world_up {
            AimUp::Direction(direction) => UpReg::Direction(*direction),
            AimUp::Node(node) => UpReg::Point(self.graph.read_position(self.at, "up node", *node)?),
            AimUp::Axis(node, axis) => UpReg::Axis(self.graph.read(self.at, "up node", *node)?, *axis),
        };
        let weight = self.scalar(weight)?;
        let (input, out) = self.graph.take_local(node, self.at, false);
        let (parent, aim) = (self.graph.parent(node), Aim { axis, up_axis });
        self.graph.tables.aims.push(AimOp { input, parent, targets, aim, up, offset: unit(offset), weight, out });
        let at = self.graph.tables.aims.len() - 1;
        self.push(Op::Aim(at as u32), node);
        Ok(())
    }

    fn twist(
        &mut self,
        source: Uid,
        reference: Option<Uid>,
        axis: Vec3,
        driven: &[(Uid, Scalar)],
    ) -> Result<(), ProgramError> {
        let from = self.driven("source", source)?;
        let (reference, against) = match reference {
            Some(node) => (self.graph.read(self.at, "reference", node)?, self.graph.built_of(node)),
            None => {
                let parent = self.graph.rig.nodes[from].parent;
                (self.graph.parent(from), parent.map_or(Trs::IDENTITY, |parent| self.graph.built[parent]))
            }
        };
        let axis =
            direction(axis).ok_or_else(|| self.bad("the axis has no length; give the bone's axis".to_owned()))?;
        let between = against.rotation.conjugate() * self.graph.built[from].rotation;
        let (source, out) = (self.graph.global(from), self.graph.new_n(0.0));
        let op = TwistOp { source, reference, rest: between.conjugate(), axis, out };
        self.graph.tables.twists.push(op);
        let at = self.graph.tables.twists.len() - 1;
        self.push(Op::Twist(at as u32), from);
        for (node, share) in driven {
            let node = self.driven("driven node", *node)?;
            let angle = self.product(out, share, node)?;
            self.turn(node, axis, angle);
        }
        Ok(())
    }

    fn stretch(&mut self) -> Result<(), ProgramError> {
        let rig = self.graph.rig;
        let Constraint::Stretch { start, end, rest, axis, volume, range, driven, weight } =
            &*rig.constraints[self.at].constraint
        else {
            return Ok(());
        };
        if !(rest.is_finite() && *rest > 0.0) {
            return Err(self.bad(format!("the distance at rest is {rest}; it must be above zero")));
        }
        let axis =
            direction(*axis).ok_or_else(|| self.bad("the axis has no length; give the bone's axis".to_owned()))?;
        let start = self.graph.read_position(self.at, "start", *start)?;
        let end = self.graph.read_position(self.at, "end", *end)?;
        let [volume, weight] = [self.scalar(volume)?, self.scalar(weight)?];
        let nodes = driven.iter().map(|node| self.driven("driven node", *node)).collect::<Result<Vec<usize>, _>>()?;
        let Some(first) = nodes.first().copied() else { return Err(self.too_few("driven nodes", 0, 1)) };
        let (along, across) = (self.graph.new_n(1.0), self.graph.new_n(1.0));
        let op = StretchOp { start, end, rest: *rest, range: *range, volume, weight, along, across };
        self.graph.tables.stretches.push(op);
        let at = self.graph.tables.stretches.len() - 1;
        self.push(Op::Stretch(at as u32), first);
        let axis = self.graph.axis(axis);
        for node in nodes {
            let (input, out) = self.graph.take_local(node, self.at, false);
            self.push(Op::Scale { input, axis, along, across, out }, node);
        }
        Ok(())
    }

    fn spring(
        &mut self,
        driven: Uid,
        [frequency, damping, weight, motion]: [&Scalar; 4],
        translate: bool,
        rotate: bool,
        colliders: &[Collider],
    ) -> Result<(), ProgramError> {
        let node = self.driven("driven node", driven)?;
        let rig = self.graph.rig;
        let (sum, count) = (rig.nodes.iter().filter(|child| child.parent == Some(node)))
            .fold((Vec3::ZERO, 0.0), |(sum, count), child| (sum + child.base.translation, count + 1.0));
        let tip = Some(if count > 0.0 { sum / count } else { Vec3::Y }).filter(|_| rotate);
        let tip = tip.map(|tip| if tip.length_squared() > 0.0 { tip } else { Vec3::Y });
        let [frequency, damping, weight] = [self.scalar(frequency)?, self.scalar(damping)?, self.scalar(weight)?];
        let motion = self.scalar(motion)?;
        let colliders = self.colliders(colliders)?;
        let (input, out) = self.graph.take_local(node, self.at, translate);
        let (parent, state) = (self.graph.parent(node), self.graph.tables.springs.len() as u32);
        let constraint = rig.constraints[self.at].uid;
        let op = SpringOp {
            constraint,
            input,
            parent,
            frequency,
            damping,
            weight,
            motion,
            colliders,
            translate,
            tip,
            state,
            out,
        };
        self.graph.tables.springs.push(op);
        self.push(Op::Spring(state), node);
        Ok(())
    }

    fn foot(&mut self) -> Result<(), ProgramError> {
        let rig = self.graph.rig;
        let Constraint::Foot { heel, toe, ball, inner, outer, roll, break_angle, bank, toes, swivel } =
            &*rig.constraints[self.at].constraint
        else {
            return Ok(());
        };
        let [roll, break_angle, bank] = [self.scalar(roll)?, self.scalar(break_angle)?, self.scalar(bank)?];
        let swivel = self.scalar(swivel)?;
        let pivots = [
            Some(self.driven("heel", *heel)?),
            Some(self.driven("ball", *ball)?),
            Some(self.driven("toe", *toe)?),
            inner.map(|node| self.driven("inner pivot", node)).transpose()?,
            outer.map(|node| self.driven("outer pivot", node)).transpose()?,
        ];
        let outs = pivots.map(|_| self.graph.new_n(0.0));
        self.graph.tables.feet.push(FootOp { roll, break_angle, bank, outs });
        let at = self.graph.tables.feet.len() - 1;
        let first = pivots[0].unwrap_or_default();
        self.push(Op::Foot(at as u32), first);
        if let Some(ball) = pivots[1] {
            self.turn(ball, Vec3::Y, swivel);
        }
        for (number, (pivot, angle)) in pivots.into_iter().zip(outs).enumerate() {
            if let Some(node) = pivot {
                self.turn(node, if number < 3 { Vec3::X } else { Vec3::Z }, angle);
            }
        }
        if let Some((node, lift)) = toes {
            let (node, lift) = (self.driven("toes", *node)?, self.scalar(lift)?);
            // Degrees about X lower the front of the foot, the roll lifts the heel: the signs are opposite.
            let out = self.graph.new_n(0.0);
            self.push(Op::Linear { input: lift, factor: -1.0, add: 0.0, out }, node);
            self.turn(node, Vec3::X, out);
        }
        Ok(())
    }

    /// Turns a node about an axis of its own by a number of degrees.
    fn turn(&mut self, node: usize, axis: Vec3, angle: N) {
        let (input, out) = self.graph.take_local(node, self.at, false);
        let axis = self.graph.axis(axis);
        self.push(Op::Turn { input, axis, angle, out }, node);
    }

    /// A register times a number.
    fn product(&mut self, a: N, scalar: &Scalar, node: usize) -> Result<N, ProgramError> {
        if *scalar == Scalar::Value(1.0) {
            return Ok(a);
        }
        let (b, out) = (self.scalar(scalar)?, self.graph.new_n(0.0));
        self.push(Op::Product { a, b, out }, node);
        Ok(out)
    }

    /// Adds the operation that calculates a number, and writes the number to its output.
    fn output(&mut self, op: Op, output: &Output, value: N) -> Result<(), ProgramError> {
        let node = match output {
            Output::Channel(node, _) | Output::Attribute(node, _) => self.driven("driven node", *node)?,
            Output::Morph(_) => self.graph.rig.nodes.len(),
        };
        self.push(op, node);
        self.write(output, value)
    }

    /// Writes a calculated number to its output.
    fn write(&mut self, output: &Output, value: N) -> Result<(), ProgramError> {
        match output {
            Output::Channel(node, channel) => {
                let node = self.driven("driven node", *node)?;
                self.graph.drive_channel(node, self.at, *channel, value);
                Ok(())
            }
            Output::Attribute(node, name) => {
                let node = self.driven("driven node", *node)?;
                self.graph.drive_attribute(self.at, node, name, value)
            }
            Output::Morph(name) => {
                self.graph.drive_morph(name, value);
                Ok(())
            }
        }
    }

    fn joints(&mut self, joints: &[Uid]) -> Result<Vec<usize>, ProgramError> {
        let nodes = joints.iter().map(|node| self.driven("joint", *node)).collect::<Result<Vec<usize>, _>>()?;
        for pair in nodes.windows(2) {
            if self.graph.rig.nodes[pair[1]].parent != Some(pair[0]) {
                return Err(ProgramError::NotAChain {
                    constraint: self.text(),
                    parent: name(self.graph.rig, pair[0]),
                    child: name(self.graph.rig, pair[1]),
                });
            }
        }
        Ok(nodes)
    }

    fn link(&mut self, node: usize, places: bool) -> Link {
        let (input, out) = self.graph.take_local(node, self.at, places);
        Link { input, out, base: self.graph.base(node) }
    }

    fn links(&mut self, links: Vec<Link>) -> Span {
        let span = Span { start: self.graph.tables.links.len() as u32, len: links.len() as u32 };
        self.graph.tables.links.extend(links);
        span
    }

    fn numbers(&mut self, numbers: Vec<N>) -> Span {
        let span = Span { start: self.graph.tables.numbers.len() as u32, len: numbers.len() as u32 };
        self.graph.tables.numbers.extend(numbers);
        span
    }

    fn target(&mut self, target: &Target, whole: bool) -> Result<TargetReg, ProgramError> {
        let offset = (target.offset != Trs::IDENTITY).then_some(target.offset);
        if !super::graph::valid(&target.offset) {
            return Err(self.not_finite());
        }
        let node = if whole || offset.is_some() {
            self.graph.read(self.at, "target", target.node)?
        } else {
            self.graph.read_position(self.at, "target", target.node)?
        };
        Ok(TargetReg { node, weight: self.scalar(&target.weight)?, offset })
    }

    fn targets(&mut self, targets: Vec<TargetReg>) -> Span {
        let span = Span { start: self.graph.tables.targets.len() as u32, len: targets.len() as u32 };
        self.graph.tables.targets.extend(targets);
        span
    }

    fn goal(&mut self, goal: Uid, whole: bool) -> Result<X, ProgramError> {
        if whole { self.graph.read(self.at, "goal", goal) } else { self.graph.read_position(self.at, "goal", goal) }
    }

    fn pole(&mut self, pole: Option<Uid>) -> Result<Option<X>, ProgramError> {
        pole.map(|pole| self.graph.read_position(self.at, "pole", pole)).transpose()
    }

    fn driven(&self, role: &'static str, node: Uid) -> Result<usize, ProgramError> {
        self.graph.driven(self.at, role, node)
    }

    fn scalar(&mut self, scalar: &Scalar) -> Result<N, ProgramError> {
        self.graph.scalar(self.at, scalar)
    }

    fn push(&mut self, op: Op, node: usize) {
        self.graph.push(op, node, Some(self.at));
    }

    fn text(&self) -> ConstraintName {
        ConstraintName::from(&self.graph.rig.constraints[self.at])
    }

    fn bad(&self, problem: String) -> ProgramError {
        ProgramError::BadParameter { constraint: self.text(), problem }
    }

    fn not_finite(&self) -> ProgramError {
        ProgramError::NotFinite { place: NumberPlace::Constraint(self.text()) }
    }

    fn too_few(&self, what: &'static str, found: usize, needed: usize) -> ProgramError {
        ProgramError::TooFew { constraint: self.text(), what, found, needed }
    }
}
