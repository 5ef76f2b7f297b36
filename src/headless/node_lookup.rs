//! Look-up of the nodes that a pose names.

use std::collections::BTreeSet;

use super::{
    Workbench,
    posing::{PoseError, WriteValue},
};
use crate::rig::{
    BuiltNode, Matching, NodeType, Uid,
    feature::off_at,
    nearest::{did_you_mean, listed, nearest},
};

/// Channels of a control.
const CHANNELS: [&str; 3] = ["translate", "rotate", "scale"];

impl Workbench {
    /// Error of an attribute that a node does not have, or of a channel with a slip of the pen.
    fn lacks_attribute(&self, node: &BuiltNode, attribute: &str) -> PoseError {
        let all: Vec<&str> = node.attributes.iter().map(|attribute| &*attribute.name).collect();
        let channels = nearest(attribute, CHANNELS, 1);
        let known = match channels.first().filter(|_| nearest(attribute, &all, 1).is_empty()) {
            Some(channel) => format!("; did you mean the channel \"{channel}\"?"),
            None if all.is_empty() => "; it has none".to_owned(),
            None => did_you_mean(attribute, &all),
        };
        let off = self.processor().and_then(|processor| processor.builder().off_named(attribute));
        let off = off.map_or_else(String::new, |off| format!("; one of that name is not built: {off}"));
        PoseError::NoAttribute { node: node.name.to_string(), attribute: attribute.to_owned(), known: known + &off }
    }

    /// Node that a write refers to. A name wins over a label. Among controls with the same label the one in effect
    /// wins: the goal of a limb while it follows inverse kinematics, else the forward control.
    pub(super) fn find_node(&self, name: &str, value: &WriteValue) -> Result<BuiltNode, PoseError> {
        let built = self.built().ok_or(PoseError::NotBuilt)?;
        let state = self.runtime()?.state();
        let attribute = value.attribute();
        let what = if attribute.is_some() { "node" } else { "control" };
        let is_meant = |node: &BuiltNode| match attribute {
            Some(_) => !node.attributes.is_empty(),
            None => node.kind == NodeType::Control,
        };
        let of_kind = || built.nodes.iter().filter(|node| is_meant(node));
        let is_named = |node: &&BuiltNode| *node.name == *name;
        let is_labelled = |node: &&BuiltNode| node.label.as_deref() == Some(name);
        let mut found: Vec<&BuiltNode> = of_kind().filter(is_named).collect();
        if found.is_empty() {
            found = of_kind().filter(is_labelled).collect();
        }
        if found.is_empty()
            && let Some(node) = name.parse::<Uid>().ok().and_then(|uid| built.node(uid))
        {
            found.extend(is_meant(node).then_some(node));
        }
        if found.is_empty() && name.starts_with('@') {
            let processor = self.processor().ok_or(PoseError::NotBuilt)?;
            let uids = processor.builder().find(self.rig(), name)?;
            let named: Vec<&BuiltNode> = uids.iter().filter_map(|uid| built.node(*uid)).collect();
            found = named.iter().copied().filter(|node| is_meant(node)).collect();
            if found.is_empty() && !named.is_empty() {
                let labels: BTreeSet<&str> = named.iter().filter_map(|node| node.label.as_deref()).collect();
                let there = |label: &&&str| of_kind().any(|node| node.label.as_deref() == Some(**label));
                let labels: Vec<&str> = labels.iter().filter(there).copied().collect();
                let nearest = match labels[..] {
                    [] => String::new(),
                    _ => format!("; write {}", listed(&labels, "or")),
                };
                return Err(PoseError::OtherKind { what, name: name.to_owned(), nearest });
            }
        }
        if let Some(attribute) = attribute {
            let with: Vec<&BuiltNode> = found
                .iter()
                .copied()
                .filter(|node| node.attributes.iter().any(|known| *known.name == *attribute))
                .collect();
            if with.is_empty()
                && let Some(node) = found.first()
            {
                return Err(self.lacks_attribute(node, attribute));
            }
            found = with;
        }
        if found.len() > 1 {
            // The goal of a foot is a node of its own, which the control carries.
            let carrier = |goal: Uid| {
                let mut at = built.nodes.iter().position(|node| node.uid == goal);
                while let Some(node) = at.map(|at| &built.nodes[at]).filter(|node| node.kind != NodeType::Control) {
                    at = node.parent;
                }
                at.map(|at| built.nodes[at].uid)
            };
            let in_effect = |node: &Uid| {
                let mut of = built.switches.iter().filter_map(|switch| match &switch.matching {
                    Matching::IkFk { fk, goal, .. } => {
                        let is_goal = carrier(*goal) == Some(*node);
                        let on = state.attribute(switch.control, &switch.attribute).unwrap_or_default() >= 0.5;
                        (is_goal || fk.contains(node)).then_some(on == is_goal)
                    }
                    Matching::Space { .. } => None,
                });
                of.next_back()
            };
            let active: Vec<&BuiltNode> =
                found.iter().copied().filter(|node| in_effect(&node.uid) == Some(true)).collect();
            if active.len() == 1 {
                found = active;
            }
        }
        match found[..] {
            [node] => Ok(node.clone()),
            [] => {
                if let Some(off) = self.processor().and_then(|processor| processor.builder().off_named(name)) {
                    return Err(PoseError::Off { name: name.to_owned(), off });
                }
                let is_called = |node: &&BuiltNode| is_named(node) || is_labelled(node);
                if let (Some(attribute), Some(node)) = (attribute, built.nodes.iter().find(is_called)) {
                    return Err(self.lacks_attribute(node, attribute));
                }
                let names =
                    of_kind().flat_map(|node| [Some(node.name.to_string()), node.label.as_deref().map(str::to_owned)]);
                let nearest = did_you_mean(name, names.flatten());
                Err(PoseError::NoNode { what, name: name.to_owned(), nearest })
            }
            _ => {
                // Nodes of one name are told apart by their uids.
                let first = &found[0].name;
                let is_one_name = found.iter().all(|node| node.name == *first);
                let called = |node: &&BuiltNode| match is_one_name {
                    true => node.uid.to_string(),
                    false => node.name.to_string(),
                };
                let names: Vec<String> = found.iter().map(called).collect();
                let off = off_at(self.rig(), name).map_or_else(String::new, |off| format!(" ({off})"));
                Err(PoseError::Ambiguous { name: name.to_owned(), candidates: names.join(", "), off })
            }
        }
    }
}
