//! Comparison of operations of two programs of one layout.

use super::{Link, Op, Span, Tables};

impl Op {
    /// True if an operation does what the one at the same place of a program with the same layout does: their registers are the
    /// same, so parameters decide.
    pub(in super::super) fn is_same(&self, tables: &Tables, other: &Self, others: &Tables) -> bool {
        let base = |a: &u32, b: &u32| tables.bases[*a as usize] == others.bases[*b as usize];
        let axis = |a: &u32, b: &u32| tables.axes[*a as usize] == others.axes[*b as usize];
        let drives = |a: &Span, b: &Span| tables.drives[a.range()] == others.drives[b.range()];
        let link = |(a, b): (&Link, &Link)| base(&a.base, &b.base);
        let links = |a: Span, b: Span| {
            let (a, b) = (&tables.links[a.range()], &others.links[b.range()]);
            a.len() == b.len() && a.iter().zip(b).all(link)
        };
        match (self, other) {
            (Self::Node { base: a, .. }, Self::Node { base: b, .. }) => base(a, b),
            (Self::Local { base: a, drives: c, .. }, Self::Local { base: b, drives: d, .. }) => {
                base(a, b) && drives(c, d)
            }
            (Self::Drive { drives: a, .. }, Self::Drive { drives: b, .. }) => drives(a, b),
            (Self::Turn { axis: a, .. }, Self::Turn { axis: b, .. })
            | (Self::Scale { axis: a, .. }, Self::Scale { axis: b, .. }) => axis(a, b),
            (Self::Clamp { ends: a, .. }, Self::Clamp { ends: b, .. }) => {
                tables.ends[*a as usize].map(f32::to_bits) == others.ends[*b as usize].map(f32::to_bits)
            }
            (Self::Sum { list: a, .. }, Self::Sum { list: b, .. }) => {
                tables.numbers[a.range()] == others.numbers[b.range()]
            }
            (Self::Key(a), Self::Key(b)) => tables.keys[*a as usize] == others.keys[*b as usize],
            (Self::Expression(a), Self::Expression(b)) => {
                let (a, b) = (&tables.expressions[*a as usize], &others.expressions[*b as usize]);
                std::sync::Arc::ptr_eq(&a.expression, &b.expression)
                    && tables.numbers[a.inputs.range()] == others.numbers[b.inputs.range()]
            }
            (Self::Foot(a), Self::Foot(b)) => tables.feet[*a as usize] == others.feet[*b as usize],
            (Self::Twist(a), Self::Twist(b)) => tables.twists[*a as usize] == others.twists[*b as usize],
            (Self::Stretch(a), Self::Stretch(b)) => tables.stretches[*a as usize] == others.stretches[*b as usize],
            (Self::Transform(a), Self::Transform(b)) => {
                let (a, b) = (tables.transforms[*a as usize], others.transforms[*b as usize]);
                let is_same = tables.targets[a.targets.range()] == others.targets[b.targets.range()];
                is_same && a == super::TransformOp { targets: a.targets, ..b }
            }
            (Self::Aim(a), Self::Aim(b)) => {
                let (a, b) = (tables.aims[*a as usize], others.aims[*b as usize]);
                let is_same = tables.targets[a.targets.range()] == others.targets[b.targets.range()];
                is_same && a == super::AimOp { targets: a.targets, ..b }
            }
            (Self::TwoBone(a), Self::TwoBone(b)) => {
                let (a, b) = (tables.two_bones[*a as usize], others.two_bones[*b as usize]);
                a.links.iter().zip(&b.links).all(link) && a == super::TwoBoneOp { links: a.links, ..b }
            }
            (Self::Chain(a), Self::Chain(b)) => {
                let (a, b) = (&tables.chains[*a as usize], &others.chains[*b as usize]);
                links(a.links, b.links) && *a == super::ChainOp { links: a.links, ..b.clone() }
            }
            (Self::Spline(a), Self::Spline(b)) => {
                let (a, b) = (&tables.splines[*a as usize], &others.splines[*b as usize]);
                let is_same = tables.points[a.points.range()] == others.points[b.points.range()];
                let spans = (a.links, a.points);
                is_same
                    && links(a.links, b.links)
                    && *a == super::SplineOp { links: spans.0, points: spans.1, ..b.clone() }
            }
            (Self::Limit(a), Self::Limit(b)) => {
                let (a, b) = (tables.limits[*a as usize], others.limits[*b as usize]);
                base(&a.base, &b.base) && a == super::LimitOp { base: a.base, ..b }
            }
            (Self::Spring(a), Self::Spring(b)) => {
                let (a, b) = (tables.springs[*a as usize], others.springs[*b as usize]);
                let is_same = tables.colliders[a.colliders.range()] == others.colliders[b.colliders.range()];
                is_same && a == super::SpringOp { colliders: a.colliders, ..b }
            }
            (Self::Cone(a), Self::Cone(b)) => tables.cones[*a as usize] == others.cones[*b as usize],
            (Self::Reader(a), Self::Reader(b)) => tables.readers[*a as usize] == others.readers[*b as usize],
            (Self::Travel(a), Self::Travel(b)) => tables.travels[*a as usize] == others.travels[*b as usize],
            (Self::Path(a), Self::Path(b)) => {
                let (a, b) = (tables.paths[*a as usize], others.paths[*b as usize]);
                let is_same = tables.points[a.points.range()] == others.points[b.points.range()];
                is_same && a == super::PathOp { points: a.points, ..b }
            }
            (Self::Rivet(a), Self::Rivet(b)) => tables.rivets[*a as usize] == others.rivets[*b as usize],
            // Inline parameters, and operations that are of different kinds.
            (a, b) => a == b,
        }
    }
}
