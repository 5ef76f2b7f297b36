//! Helpers of modules: names of several nodes, bones, chains, limits, layers.

use std::sync::Arc;

use glam::Vec3;

use super::{BuildScope, Creation, ListedNodes, ModuleError, NodeId, Side};
use crate::{
    mesh::model::Trs,
    rig::{
        LayerData, Limits, NodeType,
        label::label_side,
        reference::{NodeRef, NodeRefs, Source},
    },
};

impl BuildScope<'_> {
    /// Creation parameters for one of several nodes, the one for `subject`: names after the first get a number, and the
    /// label and group are those of the subject, where it has them, unless the tag says otherwise.
    pub fn creation_for(&mut self, creation: &Creation, subject: NodeId, index: usize) -> Creation {
        let name = creation.name.as_ref().map(|name| match index {
            0 => name.clone(),
            index => format!("{name}_{}", index + 1),
        });
        let label = match &creation.label {
            Some(label) => Some(label.clone()),
            None => self.label(subject).map(|label| label.to_string()),
        };
        let local_group = match creation.local_group {
            Some(group) => Some(group),
            None => self.group(subject),
        };
        Creation { name, label, local_group, global_group: creation.global_group }
    }

    /// Puts a node elsewhere in the rig's space without what is below it.
    pub fn set_global_alone(&mut self, node: NodeId, global: Trs) {
        let children: Vec<(NodeId, Trs)> =
            self.children(node).into_iter().map(|child| (child, self.global(child))).collect();
        self.set_global(node, global);
        for (child, global) in children {
            self.set_global(child, global);
        }
    }

    /// The nearest node above `node` that is in the list, as its place in it.
    pub fn upper_in(&mut self, node: NodeId, list: &ListedNodes) -> Option<usize> {
        // Whatever stands above, it is not in the list.
        if list.is_empty() {
            return None;
        }
        let mut at = self.parent(node);
        while let Some(node) = at {
            if let Some(place) = list.place(node) {
                return Some(place);
            }
            at = self.parent(node);
        }
        None
    }

    /// True if a node stands below another one, however far.
    pub fn is_below(&mut self, node: NodeId, upper: NodeId) -> bool {
        let mut at = self.parent(node);
        while let Some(node) = at.filter(|node| *node != upper) {
            at = self.parent(node);
        }
        at.is_some()
    }

    /// The one joint below `joint` that continues its chain.
    ///
    /// # Errors
    /// If there is none, or several; `parameter` is the one that can name it.
    pub fn only_child(&mut self, parameter: &str, joint: NodeId) -> Result<NodeId, ModuleError> {
        match self.child_joints(joint)[..] {
            [child] => Ok(child),
            [] => {
                let name = self.name(joint);
                Err(ModuleError::parameter(parameter, format!("{name} has no joint below it; choose one further up")))
            }
            ref several => {
                let names: Vec<String> = several.iter().take(4).map(|child| self.name(*child)).collect();
                let (name, names) = (self.name(joint), names.join(", "));
                let count = several.len();
                let problem = format!("{name} has {count} joints below it ({names}); name the one that is meant");
                Err(ModuleError::parameter(parameter, problem))
            }
        }
    }

    /// Nodes of a chain that references stand for, from the top down.
    ///
    /// # Errors
    /// See [`BuildScope::resolve`]; fewer than `least`, or nodes that do not stand below one another.
    pub fn resolve_chain(
        &mut self,
        parameter: &str,
        references: &NodeRefs,
        least: usize,
    ) -> Result<Vec<NodeId>, ModuleError> {
        let nodes = self.resolve_all(parameter, references)?;
        if nodes.len() < least {
            let problem = format!("finds {} where a chain of at least {least} nodes is needed", nodes.len());
            return Err(ModuleError::reference(parameter, references, problem));
        }
        for pair in nodes.windows(2) {
            if !self.is_below(pair[1], pair[0]) {
                let (upper, lower) = (self.name(pair[0]), self.name(pair[1]));
                let problem = format!(
                    "{lower} is not below {upper}; a chain needs each node below the one before: list them one by one"
                );
                return Err(ModuleError::reference(parameter, references, problem));
            }
        }
        Ok(nodes)
    }

    /// The bone that starts at a node: from it to the joint below, or to the middle of several that lie to one side. Of
    /// a node at the end of a chain it is half the bone above, in the same direction; `None` of one that stands alone, or on its
    /// parent's place.
    pub fn bone(&mut self, node: NodeId) -> Option<Vec3> {
        /// Part of the distance from the origin below which two nodes share a place, beyond rounding.
        const SAME: f32 = 1e-4;
        let position = self.position(node);
        let ends: Vec<Vec3> =
            self.child_joints(node).into_iter().map(|child| self.position(child) - position).collect();
        let longest = ends.iter().map(|end| end.length()).fold(0.0, f32::max);
        if longest > 0.0 {
            let mean = ends.iter().sum::<Vec3>() / ends.len() as f32;
            if mean.length() > 0.3 * longest {
                return Some(mean.normalize() * longest);
            }
            return ends.into_iter().find(|end| end.length() == longest);
        }
        let parent = self.parent(node)?;
        let above = position - self.position(parent);
        (above.length() > SAME * position.length()).then_some(above * 0.5)
    }

    /// The length of the bone that starts at a node, in the rig's units. A node on its parent's place, such as a null, has that of
    /// the node that it was made for. Of a node that stands alone it is a tenth of its distance from the rig's origin, and 1 on the
    /// origin.
    pub fn bone_length(&mut self, node: NodeId) -> f32 {
        let mut at = Some(node);
        while let Some(place) = at {
            if let Some(bone) = self.bone(place) {
                return bone.length();
            }
            let origin = self.parent(place).and_then(|_| self.origin(place));
            at = origin.and_then(|origin| self.id(origin.subject)).filter(|subject| *subject != place);
        }
        match self.position(node).length() {
            0.0 => 1.0,
            distance => 0.1 * distance,
        }
    }

    /// The side that a node's label names, or where it stands if the label names none.
    pub fn named_side(&mut self, node: NodeId) -> Side {
        match self.label(node).map_or(0, |label| label_side(&label)) {
            1.. => Side::Left,
            ..=-1 => Side::Right,
            0 => self.side(node),
        }
    }

    /// The null that takes a control's place: its parent, if the same command made it for the same node.
    pub fn offset_of(&mut self, control: NodeId) -> Option<NodeId> {
        let parent = self.parent(control)?;
        let (own, above) = (self.origin(control)?, self.origin(parent)?);
        let is_offset = above.command == own.command && above.subject == own.subject && &*above.role == "offset";
        is_offset.then_some(parent)
    }

    /// Position of a pole for a chain: in the plane in which it bends, beside its middle, `distance` times its length
    /// away. A straight chain bends towards `prefer` (rig space).
    pub fn pole_position(&mut self, chain: &[NodeId], distance: f32, prefer: Vec3) -> Vec3 {
        let places: Vec<Vec3> = chain.iter().map(|node| self.position(*node)).collect();
        let (Some(first), Some(last)) = (places.first(), places.last()) else { return Vec3::ZERO };
        let length: f32 = places.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
        let line = (last - first).normalize_or_zero();
        let aside = |place: Vec3| (place - first) - line * (place - first).dot(line);
        // The joint furthest from the line shows the plane best.
        let middle = &places[1..places.len().max(2) - 1];
        let furthest = middle.iter().map(|place| (aside(*place), *place)).max_by(|a, b| {
            let (a, b) = (a.0.length_squared(), b.0.length_squared());
            a.total_cmp(&b)
        });
        let (bend, from) = furthest.unwrap_or((Vec3::ZERO, *first));
        let straight = bend.length() <= 1e-4 * length;
        let wanted = if straight { prefer - line * prefer.dot(line) } else { bend };
        let direction = wanted.try_normalize().unwrap_or_else(|| sideways(line));
        from + direction * (distance * length)
    }

    /// The layer of that name, if a node is in it.
    pub fn find_layer(&mut self, name: &str) -> Option<Arc<LayerData>> {
        let all = self.resolve("nodes", &NodeRef::from(Source::Any).into()).ok()?;
        all.into_iter().find_map(|node| self.layer(node).filter(|layer| layer.name == name))
    }

    /// Refuses a node of another kind; `what` says which kind is needed, with its article.
    ///
    /// # Errors
    /// If it is not of these kinds.
    pub fn need_kind(
        &mut self,
        parameter: &str,
        node: NodeId,
        kinds: &[NodeType],
        what: &str,
    ) -> Result<(), ModuleError> {
        match self.kind(node) {
            Some(kind) if kinds.contains(&kind) => Ok(()),
            _ => {
                let name = self.name(node);
                Err(ModuleError::parameter(parameter, format!("{name} is not {what}; refer to one")))
            }
        }
    }
}

/// Any direction across a line; up if it has no direction.
fn sideways(line: Vec3) -> Vec3 {
    if line == Vec3::ZERO { Vec3::Y } else { line.any_orthonormal_vector() }
}

/// Refuses ends of limits that are not finite or in the wrong order.
///
/// # Errors
/// Which channel, and what to write.
pub fn check_limits(parameter: &str, limits: &Limits) -> Result<(), ModuleError> {
    let kinds = [("translate", &limits.translate), ("rotate", &limits.rotate), ("scale", &limits.scale)];
    for (kind, axes) in kinds {
        for ((low, high), axis) in axes.iter().zip(["X", "Y", "Z"]) {
            let bad = |end: &Option<f32>| end.is_some_and(|end| !end.is_finite());
            if bad(low) || bad(high) {
                return Err(ModuleError::parameter(parameter, format!("{kind} {axis} has to be a finite number")));
            }
            if let (Some(low), Some(high)) = (low, high)
                && low > high
            {
                let problem = format!("{kind} {axis} goes from {low} to {high}: exchange the two");
                return Err(ModuleError::parameter(parameter, problem));
            }
        }
    }
    Ok(())
}

/// Refuses numbers that are not finite.
///
/// # Errors
/// If one of them is not.
pub fn check_finite(parameter: &str, numbers: &[f32]) -> Result<(), ModuleError> {
    if numbers.iter().all(|number| number.is_finite()) {
        return Ok(());
    }
    Err(ModuleError::parameter(parameter, "has to be finite; write ordinary numbers"))
}
