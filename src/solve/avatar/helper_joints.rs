//! Joints that only follow other joints: twist and half joints in another rest pose.

use std::{collections::BTreeMap, sync::Arc};

use bevy::math::Quat;

use crate::{
    mesh::model::Trs,
    rig::{BuiltRig, Constraint, Dependency, NodeType, PoseOffset, Uid},
    solve::program::{CompileOptions, RigProgram, RigState},
};

/// Program of those constraints alone by which joints follow joints.
pub(super) struct HelperJoints {
    state: RigState,
    driven: Vec<Uid>,
}

impl HelperJoints {
    /// Helper joints of a built rig; `None` if it has none. No joint in `posed` is one.
    pub fn new(built: &BuiltRig, posed: &dyn Fn(Uid) -> bool) -> Option<Self> {
        let kinds: BTreeMap<Uid, NodeType> = built.nodes.iter().map(|node| (node.uid, node.kind)).collect();
        let created: BTreeMap<Uid, bool> = built.nodes.iter().map(|node| (node.uid, node.origin.is_some())).collect();
        let is_joint = |dependency: &Dependency| match dependency {
            Dependency::Node(uid) => kinds.get(uid).is_some_and(|kind| *kind != NodeType::Control),
            Dependency::Attribute(..) => false,
        };
        let is_helper = |dependency: &Dependency, is_twist: bool| match dependency {
            Dependency::Node(uid) => {
                is_joint(dependency) && !posed(*uid) && (is_twist || created.get(uid).copied().unwrap_or_default())
            }
            Dependency::Attribute(..) => false,
        };
        let mut bare = built.clone();
        bare.switches.clear();
        bare.constraints.retain(|constraint| {
            let constraint = &*constraint.constraint;
            let is_twist = matches!(constraint, Constraint::Twist { .. });
            (is_twist || matches!(constraint, Constraint::Transform { .. }))
                && constraint.reads().iter().all(is_joint)
                && constraint.drives().iter().all(|driven| is_helper(driven, is_twist))
        });
        let driven: Vec<Uid> = bare
            .constraints
            .iter()
            .flat_map(|constraint| constraint.constraint.drives())
            .filter_map(|driven| match driven {
                Dependency::Node(uid) => Some(uid),
                Dependency::Attribute(..) => None,
            })
            .collect();
        if driven.is_empty() {
            return None;
        }
        // Fewer constraints than those of a rig that runs have no cycle that it lacks.
        let program = RigProgram::compile(&bare, &CompileOptions::default()).ok()?;
        Some(Self { state: RigState::new(Arc::new(program)), driven })
    }

    /// Transforms of the rig's nodes in its space, with joints turned in their own spaces; one for each node asked for.
    pub fn globals(&mut self, turned: &BTreeMap<Uid, Quat>, nodes: &[Uid]) -> Vec<Option<Trs>> {
        for (uid, rotation) in turned {
            // A joint that takes no pose stays; none of the document's joints is one.
            let _ = self.state.set_offset(*uid, PoseOffset::from_rotation(*rotation));
        }
        self.state.evaluate(0.0);
        nodes.iter().map(|node| self.state.global(*node)).collect()
    }

    /// True for joints that follow others.
    pub fn drives(&self, uid: Uid) -> bool {
        self.driven.contains(&uid)
    }
}
