//! Lowering of constraints on chains of joints.

use glam::{Quat, Vec3};

use super::Lower;
use crate::{
    mesh::model::Trs,
    rig::{AngleLimits, ChainSolver, Constraint, Scalar, Uid},
    solve::{
        limit::{Bounds, JointLimit},
        program::{
            ProgramError,
            chains::frames,
            op::{ChainOp, Link, Op, Span, SplineOp, TwoBoneOp},
        },
        rotate::{EulerOrder, direction, perpendicular_or_any, unit},
        spline::{ArcTable, Spline, SplineKind},
    },
};

impl Lower<'_, '_> {
    pub(super) fn two_bone(&mut self) -> Result<(), ProgramError> {
        let rig = self.graph.rig;
        let Constraint::TwoBone {
            root,
            mid,
            end,
            goal,
            pole,
            prefer,
            weight,
            soft,
            stretch,
            max_stretch,
            twist,
            pin,
            orient_end,
        } = &*rig.constraints[self.at].constraint
        else {
            return Ok(());
        };
        let nodes = self.joints(&[*root, *mid, *end])?;
        let goal = self.goal(*goal, orient_end.is_some())?;
        let pole = self.pole(*pole)?;
        let can_stretch = [stretch, pin].iter().any(|share| **share != Scalar::Value(0.0));
        let [weight, soft, stretch, twist] =
            [self.scalar(weight)?, self.scalar(soft)?, self.scalar(stretch)?, self.scalar(twist)?];
        let pin = self.scalar(pin)?;
        let links = [self.link(nodes[0], false), self.link(nodes[1], can_stretch), self.link(nodes[2], can_stretch)];
        let op = TwoBoneOp {
            parent: self.graph.parent(nodes[0]),
            links,
            goal,
            pole,
            prefer: *prefer,
            weight,
            soft,
            stretch,
            max_stretch: *max_stretch,
            twist,
            pin,
            orient_end: orient_end.map(unit),
        };
        self.graph.tables.two_bones.push(op);
        let at = self.graph.tables.two_bones.len() - 1;
        self.push(Op::TwoBone(at as u32), nodes[0]);
        Ok(())
    }

    pub(super) fn chain(&mut self) -> Result<(), ProgramError> {
        let rig = self.graph.rig;
        let Constraint::Chain { joints, goal, pole, solver, iterations, tolerance, weight, orient_end } =
            &*rig.constraints[self.at].constraint
        else {
            return Ok(());
        };
        if joints.len() < 2 {
            return Err(self.too_few("joints", joints.len(), 2));
        }
        let nodes = self.joints(joints)?;
        let goal = self.goal(*goal, orient_end.is_some())?;
        let pole = self.pole(*pole)?;
        let weight = self.scalar(weight)?;
        let limits = match solver {
            ChainSolver::Fabrik => None,
            ChainSolver::Ccd(limits) => {
                let limit = |at: usize| limits.get(at).map_or(JointLimit::Free, joint_limit);
                Some((0..joints.len() - 1).map(limit).collect())
            }
        };
        let links: Vec<Link> = nodes.iter().map(|node| self.link(*node, false)).collect();
        let op = ChainOp {
            parent: self.graph.parent(nodes[0]),
            links: self.links(links),
            goal,
            pole,
            limits,
            iterations: (*iterations).min(1000),
            tolerance: if tolerance.is_finite() { tolerance.max(0.0) } else { return Err(self.not_finite()) },
            weight,
            orient_end: orient_end.map(unit),
        };
        self.graph.tables.chains.push(op);
        let at = self.graph.tables.chains.len() - 1;
        self.push(Op::Chain(at as u32), nodes[0]);
        Ok(())
    }

    pub(super) fn spline(
        &mut self,
        joints: &[Uid],
        points: &[Uid],
        [stretch, twist, weight]: [&Scalar; 3],
    ) -> Result<(), ProgramError> {
        let (true, [first, .., last]) = (joints.len() >= 2, points) else {
            return Err(if joints.len() < 2 {
                self.too_few("joints", joints.len(), 2)
            } else {
                self.too_few("points", points.len(), 2)
            });
        };
        let nodes = self.joints(joints)?;
        let mut registers = Vec::with_capacity(points.len());
        for (number, point) in points.iter().enumerate() {
            let whole = number == 0 || number + 1 == points.len();
            registers.push(if whole {
                self.graph.read(self.at, "point", *point)?
            } else {
                self.graph.read_position(self.at, "point", *point)?
            });
        }
        let [stretch, twist, weight] = [self.scalar(stretch)?, self.scalar(twist)?, self.scalar(weight)?];
        let built = |node: &Uid| self.graph.built_of(*node);
        let ends = [built(first).rotation, built(last).rotation];
        let rests: Vec<Trs> = joints.iter().map(built).collect();
        let along = direction(rests[1].translation - rests[0].translation).unwrap_or(Vec3::Y);
        let up = perpendicular_or_any(along, &[rests[0].rotation * Vec3::Z, rests[0].rotation * Vec3::X]);
        let controls: Vec<Vec3> = points.iter().map(|point| built(point).translation).collect();
        let corrections = corrections(&rests, &controls, up);
        let links: Vec<Link> = nodes.iter().map(|node| self.link(*node, true)).collect();
        let start = self.graph.tables.points.len() as u32;
        self.graph.tables.points.extend(registers);
        let op = SplineOp {
            parent: self.graph.parent(nodes[0]),
            links: self.links(links),
            points: Span { start, len: points.len() as u32 },
            ends,
            along,
            up: ends[0].conjugate() * up,
            corrections,
            stretch,
            twist,
            weight,
        };
        self.graph.tables.splines.push(op);
        let at = self.graph.tables.splines.len() - 1;
        self.push(Op::Spline(at as u32), nodes[0]);
        Ok(())
    }
}

/// Rotations from the frames that the solver lays along the curve of the built rig to the joints as built.
fn corrections(rests: &[Trs], controls: &[Vec3], up: Vec3) -> Box<[Quat]> {
    let lengths: Vec<f32> = rests.windows(2).map(|pair| pair[0].translation.distance(pair[1].translation)).collect();
    let (mut positions, mut rotations) = (vec![Vec3::ZERO; rests.len()], vec![Quat::IDENTITY; rests.len()]);
    let curve = Spline { kind: SplineKind::Through, points: controls };
    frames(0.0, up).solve(&curve, &ArcTable::new(&curve), &lengths, &mut positions, &mut rotations);
    let correction = |(frame, rest): (&Quat, &Trs)| (frame.conjugate() * rest.rotation).normalize();
    rotations.iter().zip(rests).map(correction).collect()
}

fn joint_limit(ends: &AngleLimits) -> JointLimit {
    if ends.iter().all(|end| *end == (None, None)) {
        return JointLimit::Free;
    }
    let radians = |end: Option<f32>| end.map(f32::to_radians);
    let bounds = Bounds::new(ends.map(|end| radians(end.0)), ends.map(|end| radians(end.1)));
    JointLimit::Euler { order: EulerOrder::Xyz, bounds }
}
