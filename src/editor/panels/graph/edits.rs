//! Edits of the graph: wires that are connected, removed and broken by an inserted command. Each is one operation on tags,
//! or is refused with the reason.

use std::{collections::BTreeSet, sync::Arc};

use super::{
    look::reference_parameters,
    model::{Graph, GraphWire},
};
use crate::{
    processor::{Builder, CommandState, Modules},
    rig::{
        NodeRef, NodeRefs, Rig, SourceError, TagKind, Uid, UidSource,
        operations::{Operation, Rewiring, TagOperation},
        reference::{Source, refresh_names},
        ron_text,
    },
};

/// Reason why a wire stays as it is.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(super) enum WireError {
    /// Command that would refer to itself.
    #[error("{0} cannot refer to what it makes itself; refer to an earlier command")]
    Itself(String),
    /// Command that runs before the one that it would refer to.
    #[error("{reader} runs before {from}, so it cannot refer to what that makes; move the tag of {from} up first")]
    Order {
        /// Title of the command that would refer.
        reader: String,
        /// Title of the command that would be meant.
        from: String,
    },
    /// Module without parameters that take references.
    #[error("the module {0} has no parameter that takes a reference; choose another command")]
    NoInput(String),
    /// Module with several parameters that take references.
    #[error("{title} takes references as {}; let go on the one that is meant", inputs.join(", "))]
    Which {
        /// Title of the command.
        title: String,
        /// Names of the parameters.
        inputs: Vec<String>,
    },
    /// Wire that no reference makes.
    #[error(
        "{reader} reads what {from} made or changed without a reference to it, so there is none to remove; change or \
         delete one of the two"
    )]
    NoReference {
        /// Title of the command that reads.
        reader: String,
        /// Title of the command that is read from.
        from: String,
    },
    /// Wire of a reference that means more than one command.
    #[error(
        "{reader} finds {from} with {text}, which means more than that; change `{parameter}` in the Tags panel instead"
    )]
    Broad {
        /// Title of the command that reads.
        reader: String,
        /// Title of the command that is read from.
        from: String,
        /// Name of the parameter.
        parameter: String,
        /// The references as text.
        text: String,
    },
    /// Unknown module.
    #[error("there is no module \"{0}\"; register it, or choose another")]
    NoModule(String),
    /// Command that is gone.
    #[error("the command is not in the rig any more; choose another")]
    Gone,
    /// Parameters that cannot be read, or do not take the value.
    #[error("the parameters of {title} cannot be changed: {}; correct them in the Tags panel", source.message)]
    Parameters {
        /// Title of the command.
        title: String,
        /// Error of the module's reader.
        source: SourceError,
    },
}

/// Rig with its modules and its graph.
pub(super) struct Bench<'a> {
    pub rig: &'a Rig,
    pub modules: &'a Arc<Modules>,
    pub graph: &'a Graph,
}

impl Bench<'_> {
    fn title(&self, number: usize) -> String {
        self.graph.nodes[number].title.clone()
    }

    /// Parameters of a command, and the references of one of them.
    fn references(&self, number: usize, parameter: &str) -> Result<(String, NodeRefs), WireError> {
        let node = &self.graph.nodes[number];
        let (_, tag) = self.rig.find_tag(node.tag).ok_or(WireError::Gone)?;
        let TagKind::Command { params, .. } = &tag.kind else { return Err(WireError::Gone) };
        let module = self.modules.get(&node.module).ok_or_else(|| WireError::NoModule(node.module.clone()))?;
        let wrong = |source| WireError::Parameters { title: node.title.clone(), source };
        let values = module.values(params).map_err(wrong)?;
        let text = values.get(parameter).and_then(|value| ron::from_str::<String>(value).ok()).unwrap_or_default();
        // Parameters that the module reads hold references that can be read.
        Ok((params.clone(), text.parse().unwrap_or(NodeRefs::NONE)))
    }

    /// Gives a parameter other references; without any it gets back its default.
    fn with_references(&self, number: usize, parameter: &str, references: &NodeRefs) -> Result<String, WireError> {
        let node = &self.graph.nodes[number];
        let (params, _) = self.references(number, parameter)?;
        let module = self.modules.get(&node.module).ok_or_else(|| WireError::NoModule(node.module.clone()))?;
        let changed = match references.is_empty() {
            true => module.with_default(&params, parameter),
            false => module.with_value(&params, parameter, &ron_text(&references.to_string())),
        };
        let text = changed.map_err(|source| WireError::Parameters { title: node.title.clone(), source })?;
        Ok(refresh_names(&text, self.rig).into_owned())
    }

    /// Index of the input that is meant by a wire which ends at a command.
    pub fn input_of(&self, to: usize, input: Option<usize>) -> Result<usize, WireError> {
        let node = &self.graph.nodes[to];
        match (input.filter(|input| *input < node.inputs.len()), node.inputs.len()) {
            (Some(input), _) => Ok(input),
            (None, 0) => Err(WireError::NoInput(node.module.clone())),
            (None, 1) => Ok(0),
            (None, _) => Err(WireError::Which { title: node.title.clone(), inputs: node.inputs.clone() }),
        }
    }

    /// Lets a parameter refer to the nodes of a command, in place of what it means so far or besides.
    pub fn connected(&self, wire: GraphWire, besides: bool) -> Result<TagOperation, WireError> {
        if wire.from == wire.to {
            return Err(WireError::Itself(self.title(wire.to)));
        }
        if wire.from > wire.to {
            return Err(WireError::Order { reader: self.title(wire.to), from: self.title(wire.from) });
        }
        let input = self.input_of(wire.to, Some(wire.input))?;
        let node = &self.graph.nodes[wire.to];
        let parameter = &node.inputs[input];
        let (_, mut references) = self.references(wire.to, parameter)?;
        let added = NodeRef::command(self.graph.nodes[wire.from].tag);
        if !besides {
            references = NodeRefs::NONE;
        }
        if !references.0.contains(&added) {
            references.0.push(added);
        }
        let params = self.with_references(wire.to, parameter, &references)?;
        Ok(TagOperation::Params(vec![(node.tag, params)]))
    }

    /// Takes the references to a command out of a parameter.
    pub fn disconnected(&self, wire: GraphWire) -> Result<TagOperation, WireError> {
        let node = &self.graph.nodes[wire.to];
        let (reader, from) = (self.title(wire.to), self.title(wire.from));
        let Some(parameter) = node.inputs.get(wire.input) else { return Err(WireError::NoReference { reader, from }) };
        let (_, mut references) = self.references(wire.to, parameter)?;
        let source = Source::Command(self.graph.nodes[wire.from].tag);
        let before = references.0.len();
        let text = references.to_text(self.rig);
        references.0.retain(|reference| reference.source != source);
        if references.0.len() == before {
            return Err(WireError::Broad { reader, from, parameter: parameter.clone(), text });
        }
        let params = self.with_references(wire.to, parameter, &references)?;
        Ok(TagOperation::Params(vec![(node.tag, params)]))
    }

    /// Inserts a command of a module into a wire: behind the command that is read from, with a reference to it. If the command
    /// makes nodes, the references of the reader go over to those. Returns `true` with the operation if they do.
    pub fn inserted(&self, wire: GraphWire, module: &str) -> Result<(TagOperation, bool), WireError> {
        let info = self.modules.get(module).ok_or_else(|| WireError::NoModule(module.to_owned()))?;
        let first = reference_parameters(info).into_iter().next();
        let first = first.ok_or_else(|| WireError::NoInput(module.to_owned()))?;
        let (source, reader) = (&self.graph.nodes[wire.from], &self.graph.nodes[wire.to]);
        let reference = ron_text(&NodeRef::command(source.tag).to_string());
        let wrong = |error| WireError::Parameters { title: module.to_owned(), source: error };
        let params = info.with_value("()", &first, &reference).map_err(wrong)?;
        let feature = self.rig.find_tag(source.tag).and_then(|(_, tag)| match &tag.kind {
            TagKind::Command { feature, .. } => *feature,
            TagKind::Feature { .. } => None,
        });
        let operation = |rewired: Option<Rewiring>| TagOperation::Insert {
            joint: source.joint,
            before: self.graph.next_on_joint(wire.from),
            kind: TagKind::Command { module: module.to_owned(), params: params.clone(), feature },
            rewired,
        };
        let plain = operation(None);
        let parameter = reader.inputs.get(wire.input).filter(|parameter| {
            let means = |references: NodeRefs| {
                references.iter().any(|reference| reference.source == Source::Command(source.tag))
            };
            self.references(wire.to, parameter).is_ok_and(|(_, references)| means(references))
        });
        let Some(parameter) = parameter.filter(|_| self.makes_nodes(&plain)) else { return Ok((plain, false)) };
        let rewired = Rewiring { tag: reader.tag, parameter: parameter.clone(), source: source.tag };
        Ok((operation(Some(rewired)), true))
    }

    /// True if a command that an operation inserts makes nodes: tried on a copy of the rig.
    fn makes_nodes(&self, operation: &TagOperation) -> bool {
        let mut rig = self.rig.clone();
        let known: BTreeSet<Uid> = self.graph.nodes.iter().map(|node| node.tag).collect();
        // The copy is dropped, so its uids need not differ from those of other rigs.
        let mut uids = UidSource::seeded(1);
        if Operation::Tags(operation.clone()).run(&mut rig, &mut uids, None).is_err() {
            return false;
        }
        let mut builder = Builder::new(self.modules.clone());
        builder.sync(&rig);
        let list = builder.list();
        let Some(place) = list.iter().position(|entry| !known.contains(&entry.command)) else { return false };
        builder.run_to(place + 1);
        let tag = list[place].command;
        let is_done = builder.status(tag).is_some_and(|status| status.state == CommandState::Done);
        let built = builder.built();
        is_done && built.nodes.iter().any(|node| node.origin.as_ref().is_some_and(|origin| origin.command == tag))
    }
}
