//! Exchange of one version of a template for the next: what is the same for all of its instances is worked out once, on the
//! thread that builds templates, so that the frame that takes a version over only goes through the instances.

use std::{
    collections::BTreeMap,
    sync::{Arc, Weak},
};

use super::BuiltTemplate;
use crate::{
    rig::{BuiltNode, BuiltRig, MovedNodes, Rig, Uid},
    solve::{
        keep_pose::PoseKeeper,
        program::{Carry, ProgramNode, RigProgram},
    },
};

/// Exchange of one program for another, the same for all of its instances.
#[derive(Debug)]
pub(super) struct Exchange {
    // A weak reference keeps the address from being given to another program, and lets the program go.
    from: Weak<RigProgram>,
    to: Weak<RigProgram>,
    pub carry: Carry,
    /// Keeper of poses; `None` where every pose means the same in both.
    pub keeper: Option<PoseKeeper>,
    /// True if the nodes are not the same, in the same places.
    pub is_other: bool,
    /// Nodes that go on under another uid.
    pub moved: Arc<MovedNodes>,
}

impl Exchange {
    pub fn between(from: &Arc<RigProgram>, to: &Arc<RigProgram>, moved: &Arc<MovedNodes>) -> Self {
        Self {
            moved: moved.clone(),
            carry: Carry::between(from, to),
            keeper: Some(PoseKeeper::between(from, to)).filter(|keeper| !keeper.is_idle()),
            is_other: !has_same_nodes(from, to),
            from: Arc::downgrade(from),
            to: Arc::downgrade(to),
        }
    }

    pub fn is_between(&self, from: &Arc<RigProgram>, to: &Arc<RigProgram>) -> bool {
        (self.from.as_ptr(), self.to.as_ptr()) == (Arc::as_ptr(from), Arc::as_ptr(to))
    }
}

/// True if two programs have the same nodes in the same order, with the same parents and kinds.
fn has_same_nodes(a: &RigProgram, b: &RigProgram) -> bool {
    let (a, b) = (a.nodes(), b.nodes());
    let same = |(a, b): (&ProgramNode, &ProgramNode)| {
        (a.uid, a.parent, a.kind, a.is_posable(), &a.label) == (b.uid, b.parent, b.kind, b.is_posable(), &b.label)
    };
    a.len() == b.len() && a.iter().zip(b).all(same)
}

/// Way from one version of a template to the next.
#[derive(Debug)]
pub(super) struct NextVersion {
    from: Weak<BuiltTemplate>,
    /// Indices of the built nodes that are described otherwise.
    described: Arc<[usize]>,
    /// Exchanges of the programs that instances run.
    exchanges: Vec<Arc<Exchange>>,
}

impl NextVersion {
    /// The way from a version to a build with those pairs of programs, before and now. Pairs whose program no instance runs
    /// are left out.
    pub fn between<'p>(
        from: &Arc<BuiltTemplate>,
        (rig, built): (&Rig, &BuiltRig),
        programs: impl IntoIterator<Item = (&'p Arc<RigProgram>, &'p Arc<RigProgram>)>,
    ) -> Self {
        let is_run = |(before, now): &(&Arc<RigProgram>, &Arc<RigProgram>)| {
            !Arc::ptr_eq(before, now) && Arc::strong_count(before) > 1
        };
        let exchanges = programs.into_iter().filter(is_run);
        let moved = Arc::new(MovedNodes::between((&*from.rig, &*from.built), (rig, built)));
        Self {
            from: Arc::downgrade(from),
            described: described_otherwise(&from.built, built).into(),
            exchanges: exchanges.map(|(before, now)| Arc::new(Exchange::between(before, now, &moved))).collect(),
        }
    }

    /// Indices of the built nodes whose description differs from that in the version `from`; `None` if the exchange begins
    /// at another version.
    pub fn described_since(&self, from: &Arc<BuiltTemplate>) -> Option<&Arc<[usize]>> {
        (self.from.as_ptr() == Arc::as_ptr(from)).then_some(&self.described)
    }

    /// True if every pose of the former version is known to mean the same in the next one.
    pub fn holds_poses(&self, from: &BuiltTemplate, to: &BuiltTemplate) -> bool {
        [(&from.whole, &to.whole), (&from.lean, &to.lean)].into_iter().any(|(from, to)| {
            Arc::ptr_eq(from, to) || self.exchange(from, to).is_some_and(|exchange| exchange.keeper.is_none())
        })
    }

    /// The exchange of two programs, if it is known.
    pub fn exchange(&self, from: &Arc<RigProgram>, to: &Arc<RigProgram>) -> Option<&Arc<Exchange>> {
        self.exchanges.iter().find(|known| known.is_between(from, to))
    }
}

/// Indices of the nodes of the second build that entities describe by other components than those of the first.
pub(super) fn described_otherwise(before: &BuiltRig, now: &BuiltRig) -> Vec<usize> {
    let known: BTreeMap<Uid, &BuiltNode> = before.nodes.iter().map(|node| (node.uid, node)).collect();
    let same = |a: &BuiltNode, b: &BuiltNode| {
        (a.base, &a.name, &a.label, &a.control, &a.layer, &a.origin)
            == (b.base, &b.name, &b.label, &b.control, &b.layer, &b.origin)
    };
    let is_other = |node: &BuiltNode| known.get(&node.uid).is_none_or(|known| !same(known, node));
    now.nodes.iter().enumerate().filter(|(_, node)| is_other(node)).map(|(number, _)| number).collect()
}
