//! Lowering of constraints that read poses, and of those that put a node onto a curve or a triangle.

use glam::{Quat, Vec3};

use super::Lower;
use crate::{
    mesh::model::Trs,
    rig::{Collider, Constraint, Output, Scalar, Uid},
    solve::{
        aim::Aim,
        pose_reader::{Cone, PoseReader},
        program::{
            ProgramError,
            graph::valid,
            op::{ColliderReg, ConeOp, Op, PathOp, ReaderOp, RivetOp, Span, TravelOp, X},
        },
        rotate::direction,
    },
};

impl Lower<'_, '_> {
    /// Lowers a reader, or a constraint that puts a node onto something.
    pub(super) fn reader(&mut self) -> Result<(), ProgramError> {
        let rig = self.graph.rig;
        match &*rig.constraints[self.at].constraint {
            Constraint::Cone { source, axis, reference, towards, inner, outer, output } => {
                self.cone((*source, *reference), [*axis, *towards], [*inner, *outer], output)
            }
            Constraint::PoseReader { source, reference, poses, radius } => {
                self.poses(*source, *reference, poses, *radius)
            }
            Constraint::Travel { source, reference, axis, factor, output } => {
                self.travel(*source, *reference, *axis, *factor, output)
            }
            Constraint::Path { driven, points, share, aim, up, weight } => {
                self.path(*driven, points, [share, weight], *aim, *up)
            }
            Constraint::Rivet { driven, corners, shares, offset, weight } => {
                self.rivet(*driven, *corners, *shares, *offset, weight)
            }
            _ => Ok(()),
        }
    }

    /// Registers of a source and of the node against which it is read: its parent unless there is a reference.
    fn read_against(&mut self, source: Uid, reference: Option<Uid>) -> Result<[X; 2], ProgramError> {
        let from = self.driven("source", source)?;
        let against = match reference {
            Some(node) => self.graph.read(self.at, "reference", node)?,
            None => self.graph.parent(from),
        };
        Ok([self.graph.global(from), against])
    }

    /// Bodies that a spring does not enter, in the table.
    pub(super) fn colliders(&mut self, colliders: &[Collider]) -> Result<Span, ProgramError> {
        let mut list = Vec::with_capacity(colliders.len());
        for Collider { node, end, radius } in colliders {
            if !(*radius > 0.0 && radius.is_finite()) {
                return Err(self.bad(format!("the radius of a collider is {radius}; it must be above zero")));
            }
            let start = self.graph.read_position(self.at, "collider", *node)?;
            let end = match end {
                Some(end) => self.graph.read_position(self.at, "collider's end", *end)?,
                None => start,
            };
            list.push(ColliderReg { start, end, radius: *radius });
        }
        let span = Span { start: self.graph.tables.colliders.len() as u32, len: list.len() as u32 };
        self.graph.tables.colliders.extend(list);
        Ok(span)
    }

    fn cone(
        &mut self,
        (source, reference): (Uid, Option<Uid>),
        [axis, towards]: [Vec3; 2],
        [inner, outer]: [f32; 2],
        output: &Output,
    ) -> Result<(), ProgramError> {
        let [source, reference] = self.read_against(source, reference)?;
        let no_length = || "a direction has no length; write one, such as (0, 1, 0)".to_owned();
        let axis = direction(axis).ok_or_else(|| self.bad(no_length()))?;
        let towards = direction(towards).ok_or_else(|| self.bad(no_length()))?;
        if !(inner.is_finite() && outer.is_finite() && 0.0 <= inner && inner <= outer) {
            return Err(self.bad(format!("the cone opens from {inner} to {outer} degrees; write two angles that rise")));
        }
        let cone = Cone { inner: inner.to_radians(), outer: outer.to_radians() };
        let out = self.graph.new_n(0.0);
        self.graph.tables.cones.push(ConeOp { source, reference, axis, towards, cone, out });
        let at = self.graph.tables.cones.len() - 1;
        self.output(Op::Cone(at as u32), output, out)
    }

    fn poses(
        &mut self,
        source: Uid,
        reference: Option<Uid>,
        poses: &[(Quat, Output)],
        radius: f32,
    ) -> Result<(), ProgramError> {
        let node = self.driven("source", source)?;
        let [source, reference] = self.read_against(source, reference)?;
        let rotations: Vec<Quat> = poses.iter().map(|(rotation, _)| *rotation).collect();
        if rotations.iter().any(|rotation| !rotation.is_finite()) {
            return Err(self.not_finite());
        }
        let reader = PoseReader::new(&rotations, radius.to_radians()).map_err(|error| self.bad(error.to_string()))?;
        let outs: Vec<_> = poses.iter().map(|_| self.graph.new_n(0.0)).collect();
        self.graph.tables.readers.push(ReaderOp { source, reference, reader, outs: outs.clone().into() });
        let at = self.graph.tables.readers.len() - 1;
        self.push(Op::Reader(at as u32), node);
        for ((_, output), out) in poses.iter().zip(outs) {
            self.write(output, out)?;
        }
        Ok(())
    }

    fn travel(
        &mut self,
        source: Uid,
        reference: Option<Uid>,
        axis: Vec3,
        factor: f32,
        output: &Output,
    ) -> Result<(), ProgramError> {
        let axis = direction(axis).ok_or_else(|| self.bad("the way has no direction; write one".to_owned()))?;
        if !factor.is_finite() {
            return Err(self.not_finite());
        }
        let against = reference.map_or(Trs::IDENTITY, |node| self.graph.built_of(node));
        let built = Trs { translation: self.graph.built_of(source).translation, ..Trs::IDENTITY };
        let rest = built.relative_to(&against).translation.dot(axis);
        let source = self.graph.read_position(self.at, "source", source)?;
        let reference = match reference {
            Some(node) => self.graph.read(self.at, "reference", node)?,
            None => X::RIG,
        };
        let out = self.graph.new_n(0.0);
        self.graph.tables.travels.push(TravelOp { source, reference, axis, rest, factor, out });
        let at = self.graph.tables.travels.len() - 1;
        self.output(Op::Travel(at as u32), output, out)
    }

    fn path(
        &mut self,
        driven: Uid,
        points: &[Uid],
        [share, weight]: [&Scalar; 2],
        aim: Option<[Vec3; 2]>,
        up: Vec3,
    ) -> Result<(), ProgramError> {
        if points.len() < 2 {
            return Err(self.too_few("points", points.len(), 2));
        }
        let node = self.driven("driven node", driven)?;
        let registers = points
            .iter()
            .map(|point| self.graph.read_position(self.at, "point", *point))
            .collect::<Result<Vec<X>, ProgramError>>()?;
        let [share, weight] = [self.scalar(share)?, self.scalar(weight)?];
        let start = self.graph.tables.points.len() as u32;
        self.graph.tables.points.extend(registers);
        let points = Span { start, len: points.len() as u32 };
        let (input, out) = self.graph.take_local(node, self.at, true);
        let aim = aim.map(|[axis, up_axis]| Aim { axis, up_axis });
        let parent = self.graph.parent(node);
        self.graph.tables.paths.push(PathOp { input, parent, points, share, aim, up, weight, out });
        let at = self.graph.tables.paths.len() - 1;
        self.push(Op::Path(at as u32), node);
        Ok(())
    }

    fn rivet(
        &mut self,
        driven: Uid,
        corners: [Uid; 3],
        shares: [f32; 3],
        offset: Trs,
        weight: &Scalar,
    ) -> Result<(), ProgramError> {
        let node = self.driven("driven node", driven)?;
        if !(valid(&offset) && shares.iter().all(|share| share.is_finite())) {
            return Err(self.not_finite());
        }
        let [a, b, c] = corners.map(|corner| self.graph.read_position(self.at, "corner", corner));
        let corners = [a?, b?, c?];
        let weight = self.scalar(weight)?;
        let (input, out) = self.graph.take_local(node, self.at, true);
        let parent = self.graph.parent(node);
        self.graph.tables.rivets.push(RivetOp { input, parent, corners, shares, offset, weight, out });
        let at = self.graph.tables.rivets.len() - 1;
        self.push(Op::Rivet(at as u32), node);
        Ok(())
    }
}
