//! Operands of operations, listed in one place for renumbering, ordering and connecting.

use super::{Link, N, Op, Pose, Tables, TargetReg, UpReg, X};

/// A register or slot that an operation names.
pub(in super::super) enum Operand<'a> {
    ReadX(&'a mut X),
    WriteX(&'a mut X),
    ReadN(&'a mut N),
    WriteN(&'a mut N),
    Pose(&'a mut Pose),
}

impl Op {
    /// Calls `f` with every operand of an operation, reads before writes.
    pub(in super::super) fn visit(&mut self, tables: &mut Tables, mut f: impl FnMut(Operand<'_>)) {
        use Operand::{ReadN, ReadX, WriteN, WriteX};
        match self {
            Self::Node { pose, parent, out, .. } => {
                f(Operand::Pose(pose));
                f(ReadX(parent));
                f(WriteX(out));
            }
            Self::Local { pose, drives, out, .. } => {
                f(Operand::Pose(pose));
                tables.drives[drives.range()].iter_mut().for_each(|(_, value)| f(ReadN(value)));
                f(WriteX(out));
            }
            Self::Drive { input, drives, out } => {
                f(ReadX(input));
                tables.drives[drives.range()].iter_mut().for_each(|(_, value)| f(ReadN(value)));
                f(WriteX(out));
            }
            Self::Global { parent, local, out } => {
                f(ReadX(parent));
                f(ReadX(local));
                f(WriteX(out));
            }
            Self::Turn { input, angle, out, .. } => {
                f(ReadX(input));
                f(ReadN(angle));
                f(WriteX(out));
            }
            Self::Scale { input, along, across, out, .. } => {
                f(ReadX(input));
                f(ReadN(along));
                f(ReadN(across));
                f(WriteX(out));
            }
            Self::Linear { input, out, .. } | Self::Choice { input, out, .. } | Self::Clamp { input, out, .. } => {
                f(ReadN(input));
                f(WriteN(out));
            }
            Self::Channel { pose, out, .. } => {
                f(Operand::Pose(pose));
                f(WriteN(out));
            }
            Self::Product { a, b, out } => {
                f(ReadN(a));
                f(ReadN(b));
                f(WriteN(out));
            }
            Self::Sum { list, out } => {
                tables.numbers[list.range()].iter_mut().for_each(|value| f(ReadN(value)));
                f(WriteN(out));
            }
            Self::Key(at) => {
                let op = &mut tables.keys[*at as usize];
                f(ReadN(&mut op.driver));
                f(WriteN(&mut op.out));
            }
            Self::Expression(at) => {
                let op = &mut tables.expressions[*at as usize];
                tables.numbers[op.inputs.range()].iter_mut().for_each(|value| f(ReadN(value)));
                f(WriteN(&mut op.out));
            }
            Self::Foot(at) => {
                let op = &mut tables.feet[*at as usize];
                [&mut op.roll, &mut op.break_angle, &mut op.bank].into_iter().for_each(|value| f(ReadN(value)));
                op.outs.iter_mut().for_each(|value| f(WriteN(value)));
            }
            Self::Twist(at) => {
                let op = &mut tables.twists[*at as usize];
                f(ReadX(&mut op.source));
                f(ReadX(&mut op.reference));
                f(WriteN(&mut op.out));
            }
            Self::Stretch(at) => {
                let op = &mut tables.stretches[*at as usize];
                f(ReadX(&mut op.start));
                f(ReadX(&mut op.end));
                f(ReadN(&mut op.volume));
                f(ReadN(&mut op.weight));
                f(WriteN(&mut op.along));
                f(WriteN(&mut op.across));
            }
            Self::Transform(at) => {
                let op = &mut tables.transforms[*at as usize];
                f(ReadX(&mut op.input));
                f(ReadX(&mut op.parent));
                f(Operand::Pose(&mut op.pose));
                targets(&mut tables.targets[op.targets.range()], &mut f);
                f(ReadN(&mut op.weight));
                f(WriteX(&mut op.out));
            }
            Self::Aim(at) => {
                let op = &mut tables.aims[*at as usize];
                f(ReadX(&mut op.input));
                f(ReadX(&mut op.parent));
                targets(&mut tables.targets[op.targets.range()], &mut f);
                if let UpReg::Point(x) | UpReg::Axis(x, _) = &mut op.up {
                    f(ReadX(x));
                }
                f(ReadN(&mut op.weight));
                f(WriteX(&mut op.out));
            }
            Self::TwoBone(at) => {
                let op = &mut tables.two_bones[*at as usize];
                f(ReadX(&mut op.parent));
                f(ReadX(&mut op.goal));
                op.pole.iter_mut().for_each(|pole| f(ReadX(pole)));
                [&mut op.weight, &mut op.soft, &mut op.stretch, &mut op.twist, &mut op.pin]
                    .into_iter()
                    .for_each(|value| f(ReadN(value)));
                links(&mut op.links, &mut f);
            }
            Self::Chain(at) => {
                let op = &mut tables.chains[*at as usize];
                f(ReadX(&mut op.parent));
                f(ReadX(&mut op.goal));
                op.pole.iter_mut().for_each(|pole| f(ReadX(pole)));
                f(ReadN(&mut op.weight));
                links(&mut tables.links[op.links.range()], &mut f);
            }
            Self::Spline(at) => {
                let op = &mut tables.splines[*at as usize];
                f(ReadX(&mut op.parent));
                tables.points[op.points.range()].iter_mut().for_each(|point| f(ReadX(point)));
                [&mut op.stretch, &mut op.twist, &mut op.weight].into_iter().for_each(|value| f(ReadN(value)));
                links(&mut tables.links[op.links.range()], &mut f);
            }
            Self::Limit(at) => {
                let op = &mut tables.limits[*at as usize];
                f(ReadX(&mut op.input));
                f(WriteX(&mut op.out));
            }
            Self::Spring(at) => {
                let op = &mut tables.springs[*at as usize];
                f(ReadX(&mut op.input));
                f(ReadX(&mut op.parent));
                [&mut op.frequency, &mut op.damping, &mut op.weight, &mut op.motion]
                    .into_iter()
                    .for_each(|value| f(ReadN(value)));
                for collider in &mut tables.colliders[op.colliders.range()] {
                    f(ReadX(&mut collider.start));
                    f(ReadX(&mut collider.end));
                }
                f(WriteX(&mut op.out));
            }
            Self::Cone(at) => {
                let op = &mut tables.cones[*at as usize];
                f(ReadX(&mut op.source));
                f(ReadX(&mut op.reference));
                f(WriteN(&mut op.out));
            }
            Self::Reader(at) => {
                let op = &mut tables.readers[*at as usize];
                f(ReadX(&mut op.source));
                f(ReadX(&mut op.reference));
                op.outs.iter_mut().for_each(|out| f(WriteN(out)));
            }
            Self::Travel(at) => {
                let op = &mut tables.travels[*at as usize];
                f(ReadX(&mut op.source));
                f(ReadX(&mut op.reference));
                f(WriteN(&mut op.out));
            }
            Self::Path(at) => {
                let op = &mut tables.paths[*at as usize];
                f(ReadX(&mut op.input));
                f(ReadX(&mut op.parent));
                tables.points[op.points.range()].iter_mut().for_each(|point| f(ReadX(point)));
                f(ReadN(&mut op.share));
                f(ReadN(&mut op.weight));
                f(WriteX(&mut op.out));
            }
            Self::Rivet(at) => {
                let op = &mut tables.rivets[*at as usize];
                f(ReadX(&mut op.input));
                f(ReadX(&mut op.parent));
                op.corners.iter_mut().for_each(|corner| f(ReadX(corner)));
                f(ReadN(&mut op.weight));
                f(WriteX(&mut op.out));
            }
        }
    }
}

fn targets(list: &mut [TargetReg], f: &mut impl FnMut(Operand<'_>)) {
    for target in list {
        f(Operand::ReadX(&mut target.node));
        f(Operand::ReadN(&mut target.weight));
    }
}

fn links(list: &mut [Link], f: &mut impl FnMut(Operand<'_>)) {
    list.iter_mut().for_each(|link| f(Operand::ReadX(&mut link.input)));
    list.iter_mut().for_each(|link| f(Operand::WriteX(&mut link.out)));
}
