//! Look-up of the nodes that a pose names.

use std::collections::BTreeSet;

use super::{
    Workbench,
    posing::{PoseError, WriteValue},
};
use crate::{
    plugins::{
        commands::Processor,
        controls::{SwitchError, find_switches},
    },
    rig::{
        BuiltNode, BuiltRig, Matching, NodeType, Uid,
        feature::off_at,
        nearest::{did_you_mean, listed, nearest},
    },
    solve::program::RigState,
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
        let here = || node.label.as_deref().and_then(|label| off_at(self.rig(), label));
        let off = match off {
            Some(off) => format!("; one of that name is not built: {off}"),
            // A similar name is likely what is meant.
            None if known.ends_with('?') => String::new(),
            None => here().map_or_else(String::new, |off| format!("; {off} there")),
        };
        PoseError::NoAttribute { node: node.name.to_string(), attribute: attribute.to_owned(), known: known + &off }
    }

    /// Node that a write refers to. A name wins over a label. Among controls with the same label the one in effect
    /// wins: the goal of a limb while it follows inverse kinematics, else the forward control.
    pub(super) fn find_node(&self, name: &str, value: &WriteValue) -> Result<BuiltNode, PoseError> {
        let built = self.built().ok_or(PoseError::NotBuilt)?;
        let state = self.runtime()?.state();
        let query = NodeQuery { name, attribute: value.attribute() };
        let mut found = self.candidates(built, query)?;
        if let Some(attribute) = query.attribute {
            let has_attribute = |node: &&BuiltNode| node.attributes.iter().any(|known| *known.name == *attribute);
            let with: Vec<&BuiltNode> = found.iter().copied().filter(has_attribute).collect();
            if with.is_empty()
                && let Some(node) = found.first()
            {
                return Err(self.lacks_attribute(node, attribute));
            }
            found = with;
        }
        if found.len() > 1 {
            let is_active = |node: &&BuiltNode| is_in_effect(built, state, node.uid) == Some(true);
            let active: Vec<&BuiltNode> = found.iter().copied().filter(is_active).collect();
            if active.len() == 1 {
                found = active;
            }
        }
        match found[..] {
            [node] => Ok(node.clone()),
            [] => Err(self.not_found(built, query)),
            _ => Err(self.ambiguous(name, &found)),
        }
    }

    /// Nodes of the kind that a query asks for: those of that name, else of that label, else of that uid, else those that a
    /// reference in its text form finds.
    fn candidates<'a>(&self, built: &'a BuiltRig, query: NodeQuery) -> Result<Vec<&'a BuiltNode>, PoseError> {
        let name = query.name;
        let of_kind = move || built.nodes.iter().filter(move |node| query.is_of_kind(node));
        let mut found: Vec<&BuiltNode> = of_kind().filter(|node| query.is_named(node)).collect();
        if found.is_empty() {
            found = of_kind().filter(|node| query.is_labelled(node)).collect();
        }
        if found.is_empty()
            && let Some(node) = name.parse::<Uid>().ok().and_then(|uid| built.node(uid))
        {
            found.extend(query.is_of_kind(node).then_some(node));
        }
        if !found.is_empty() || !name.starts_with('@') {
            return Ok(found);
        }
        let processor = self.processor().ok_or(PoseError::NotBuilt)?;
        let uids = processor.builder().find(self.rig(), name)?;
        let named: Vec<&BuiltNode> = uids.iter().filter_map(|uid| built.node(*uid)).collect();
        found = named.iter().copied().filter(|node| query.is_of_kind(node)).collect();
        if found.is_empty() && !named.is_empty() {
            let labels: BTreeSet<&str> = named.iter().filter_map(|node| node.label.as_deref()).collect();
            let there = |label: &&&str| of_kind().any(|node| node.label.as_deref() == Some(**label));
            let labels: Vec<&str> = labels.iter().filter(there).copied().collect();
            let nearest = match labels[..] {
                [] => String::new(),
                _ => format!("; write {}", listed(&labels, "or")),
            };
            return Err(PoseError::OtherKind { what: query.kind_name(), name: name.to_owned(), nearest });
        }
        Ok(found)
    }

    /// Error of a query that finds no node.
    fn not_found(&self, built: &BuiltRig, query: NodeQuery) -> PoseError {
        let name = query.name;
        if let Some(off) = self.processor().and_then(|processor| processor.builder().off_named(name)) {
            return PoseError::Off { name: name.to_owned(), off };
        }
        let is_called = |node: &&BuiltNode| query.is_named(node) || query.is_labelled(node);
        if let (Some(attribute), Some(node)) = (query.attribute, built.nodes.iter().find(is_called)) {
            return self.lacks_attribute(node, attribute);
        }
        let of_kind = built.nodes.iter().filter(|node| query.is_of_kind(node));
        let names = of_kind.flat_map(|node| [Some(node.name.to_string()), node.label.as_deref().map(str::to_owned)]);
        let names: Vec<String> = names.flatten().collect();
        let nearest = self.nearest_off(name, &names).unwrap_or_else(|| did_you_mean(name, &names));
        PoseError::NoNode { what: query.kind_name(), name: name.to_owned(), nearest }
    }

    /// End of the sentence about an unknown name where something that is off has the nearest name; `None` where a name of
    /// `built` is at least as near.
    fn nearest_off(&self, name: &str, built: &[String]) -> Option<String> {
        let builder = self.processor()?.builder();
        let off = builder.names_off();
        let near = nearest(name, built.iter().chain(&off), 1);
        let near = near.first().filter(|near| !built.contains(near))?;
        let off = builder.off_named(near)?;
        Some(format!("; did you mean {near:?}? It is not built: {off}; turn it on"))
    }

    /// Switches that a name matches, each as its control, its attribute and the number of `value`: see
    /// [`find_switches`].
    ///
    /// # Errors
    /// The rig is not built, or no switch has the name or the value. A switch whose control is off is told as such.
    pub fn switches_named(&self, name: &str, value: &str) -> Result<Vec<(Uid, String, f32)>, PoseError> {
        let built = self.built().ok_or(PoseError::NotBuilt)?;
        find_switches(built, self.rig(), name, value).map_err(|error| self.switch_error(error))
    }

    /// Error of a switch; where the name is that of a control that is off, it says so.
    fn switch_error(&self, error: SwitchError) -> PoseError {
        let SwitchError::NoSwitch { name, .. } = &error else { return error.into() };
        let off = self.processor().map(Processor::builder).and_then(|builder| {
            let control = name.rsplit_once('.').map(|(control, _)| control);
            builder.off_named(name).or_else(|| builder.off_named(control?))
        });
        match off {
            Some(off) => SwitchError::Off { name: name.clone(), off: off.to_string() }.into(),
            None => error.into(),
        }
    }

    /// Error of a name that finds several nodes. Nodes of one name are told apart by their uids.
    fn ambiguous(&self, name: &str, found: &[&BuiltNode]) -> PoseError {
        let is_one_name = found.iter().all(|node| node.name == found[0].name);
        let called = |node: &&BuiltNode| match is_one_name {
            true => node.uid.to_string(),
            false => node.name.to_string(),
        };
        let names: Vec<String> = found.iter().map(called).collect();
        let off = off_at(self.rig(), name).map_or_else(String::new, |off| format!(" ({off})"));
        PoseError::Ambiguous { name: name.to_owned(), candidates: names.join(", "), off }
    }
}

/// Name of a node in a pose, and the attribute that is written.
#[derive(Clone, Copy)]
struct NodeQuery<'a> {
    name: &'a str,
    /// Attribute of a node of any kind; `None` for a channel of a control.
    attribute: Option<&'a str>,
}

impl NodeQuery<'_> {
    /// Kind of node, in words.
    fn kind_name(&self) -> &'static str {
        if self.attribute.is_some() { "node" } else { "control" }
    }

    fn is_of_kind(&self, node: &BuiltNode) -> bool {
        match self.attribute {
            Some(_) => !node.attributes.is_empty(),
            None => node.kind == NodeType::Control,
        }
    }

    fn is_named(&self, node: &BuiltNode) -> bool {
        *node.name == *self.name
    }

    fn is_labelled(&self, node: &BuiltNode) -> bool {
        node.label.as_deref() == Some(self.name)
    }
}

/// True if a node is the goal of a limb that follows inverse kinematics, or a forward control of one that does not; `None`
/// if no switch concerns the node.
fn is_in_effect(built: &BuiltRig, state: &RigState, node: Uid) -> Option<bool> {
    // The goal of a foot is a node of its own, which the control carries.
    let carrier = |goal: Uid| {
        let mut at = built.nodes.iter().position(|node| node.uid == goal);
        while let Some(node) = at.map(|at| &built.nodes[at]).filter(|node| node.kind != NodeType::Control) {
            at = node.parent;
        }
        at.map(|at| built.nodes[at].uid)
    };
    let mut of = built.switches.iter().filter_map(|switch| match &switch.matching {
        Matching::IkFk { fk, goal, .. } => {
            let is_goal = carrier(*goal) == Some(node);
            let on = state.attribute(switch.control, &switch.attribute).unwrap_or_default() >= 0.5;
            (is_goal || fk.contains(&node)).then_some(on == is_goal)
        }
        Matching::Space { .. } => None,
    });
    of.next_back()
}
