//! Helpers of constraint modules: weighted targets, kept offsets, weights that follow attributes.

use super::{Amount, BuildScope, ModuleError, NodeId};
use crate::{
    mesh::model::Trs,
    rig::{Constraint, Scalar, Target, reference::NodeRefs},
};

/// Parameters of what is followed.
#[derive(Debug, Clone, Copy)]
pub struct TargetParams<'a> {
    /// The nodes that are followed.
    pub targets: &'a NodeRefs,
    /// A share for each; all the same if there are none.
    pub weights: &'a [Amount],
    /// The node that has the attributes which shares are named after.
    pub control: &'a NodeRefs,
}

/// Parameters of a constraint that copies transforms.
#[derive(Debug, Clone, Copy)]
pub struct FollowParams<'a> {
    /// The nodes that follow.
    pub node: &'a NodeRefs,
    /// Nodes that are followed.
    pub targets: TargetParams<'a>,
    /// Axes whose translation follows.
    pub translate: [bool; 3],
    /// Axes whose rotation follows.
    pub rotate: [bool; 3],
    /// Axes whose scale follows.
    pub scale: [bool; 3],
    /// Keep where the node stands now relative to each target.
    pub keep_offset: bool,
    /// Put the node's own pose on top.
    pub keep_pose: bool,
    /// Weight of the constraint, 0 to 1.
    pub weight: &'a Amount,
}

impl BuildScope<'_> {
    /// Nodes to follow with their shares. Attributes that the control does not have are added, from 0 to 1. Targets
    /// that are off are left out with their shares.
    ///
    /// # Errors
    /// See [`BuildScope::resolve_some`] and [`BuildScope::amount`]; a list of another length, shares that are all 0.
    pub fn weighted_nodes(&mut self, params: &TargetParams) -> Result<Vec<(NodeId, Scalar)>, ModuleError> {
        let nodes = self.resolve_each("targets", params.targets)?;
        let (count, given) = (nodes.len(), params.weights.len());
        if given != 0 && given != count {
            let problem = format!("has {given} for {count} targets; write one for each target, or none");
            return Err(ModuleError::parameter("weights", problem));
        }
        let control = self.resolve_maybe("control", params.control)?;
        let mut list = Vec::with_capacity(count);
        let built = nodes.into_iter().enumerate().filter_map(|(place, node)| Some((place, node?)));
        for (place, node) in built {
            let weight = match params.weights.get(place) {
                Some(amount @ Amount::Value(_)) => self.amount("weights", amount, control, 0.0..=f32::INFINITY, 1.0)?,
                // Without anybody's doing, the first is followed.
                Some(amount) => self.amount("weights", amount, control, 0.0..=1.0, f32::from(place == 0))?,
                None => Scalar::Value(1.0),
            };
            list.push((node, weight));
        }
        if list.iter().all(|(_, weight)| *weight == Scalar::Value(0.0)) {
            // Where only targets without a share are left, what is off decides.
            self.resolve_all("targets", params.targets)?;
            return Err(ModuleError::parameter("weights", "are all 0; give at least one target a share above 0"));
        }
        Ok(list)
    }

    /// Targets for a node, with where it stands now in the space of each if `keep_offset`.
    pub fn targets(&mut self, driven: NodeId, nodes: &[(NodeId, Scalar)], keep_offset: bool) -> Vec<Target> {
        let mut targets = Vec::with_capacity(nodes.len());
        for (node, weight) in nodes {
            let offset = if keep_offset { self.kept_offset(driven, *node) } else { Trs::IDENTITY };
            targets.push(Target { node: self.uid(*node), weight: weight.clone(), offset });
        }
        targets
    }

    /// The value of a number as the rig stands after building: what a person or an animation changes is not known.
    pub fn built_value(&mut self, scalar: &Scalar) -> f32 {
        let (name, node) = match scalar {
            Scalar::Value(value) => return *value,
            Scalar::Channel { .. } => return 0.0,
            Scalar::Attribute { node, name, .. } | Scalar::Choice { node, name, .. } => (name.clone(), *node),
        };
        let attributes = self.id(node).map(|node| self.attributes(node));
        let known = attributes.as_ref().and_then(|list| list.get(&name));
        let value = known.map_or(0.0, |known| known.default);
        match scalar {
            Scalar::Attribute { factor, add, .. } => value * factor + add,
            Scalar::Choice { value: choice, .. } => (1.0 - (value - choice).abs()).max(0.0),
            _ => value,
        }
    }

    /// Lets nodes follow targets: one constraint for each node, with the role `constraint`.
    ///
    /// # Errors
    /// See [`BuildScope::weighted_nodes`]; and no axis that is on.
    pub fn follow(&mut self, params: &FollowParams) -> Result<(), ModuleError> {
        let channels = [params.translate, params.rotate, params.scale];
        if channels == [[false; 3]; 3] {
            return Err(ModuleError::other("no axis follows; switch on at least one, or disable the tag"));
        }
        let driven = self.resolve_some("node", params.node)?;
        let nodes = self.weighted_nodes(&params.targets)?;
        let control = self.resolve_maybe("control", params.targets.control)?;
        let weight = self.amount("weight", params.weight, control, 0.0..=1.0, 1.0)?;
        for node in driven {
            let targets = self.targets(node, &nodes, params.keep_offset);
            let constraint = Constraint::Transform {
                driven: self.uid(node),
                targets,
                translate: params.translate,
                rotate: params.rotate,
                scale: params.scale,
                weight: weight.clone(),
                keep_pose: params.keep_pose,
            };
            self.constrain("constraint", node, 0, constraint)?;
        }
        Ok(())
    }
}
