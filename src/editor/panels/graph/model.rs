//! The graph of a rig: a node for each command, a wire for each dependency, a frame for each feature that has commands, and
//! for each local group with commands that are in no feature.

use std::collections::{BTreeMap, BTreeSet};

use super::look::{ModuleLook, ModuleLooks};
use crate::{
    editor::panels::{joint_name, words},
    processor::{Builder, Modules},
    rig::{
        JointData, Rig, TagData, TagKind, Uid, fields,
        reference::{Source, references_in},
    },
};

/// The graph.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Graph {
    /// Commands in the order in which they run.
    pub nodes: Vec<GraphNode>,
    /// Index of each command.
    pub at: BTreeMap<Uid, usize>,
    /// Dependencies, sorted.
    pub wires: Vec<GraphWire>,
    /// Frames that have commands, in the order of their first ones.
    pub frames: Vec<GraphFrame>,
}

/// A command.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct GraphNode {
    /// The tag.
    pub tag: Uid,
    /// The joint that carries it.
    pub joint: Uid,
    /// The module.
    pub module: String,
    /// Title of the module, and the label of the joint.
    pub title: String,
    /// Parameters in words.
    pub summary: String,
    /// Names of the parameters that take references; what the command reads besides comes in below them.
    pub inputs: Vec<String>,
    /// Index of its frame.
    pub frame: Option<usize>,
    /// The tag's own switch.
    pub enabled: bool,
    /// References to commands that stand in the parameters: (parameter, command that is meant).
    pub written: Vec<(String, Uid)>,
    /// Texts that the words were made of.
    source: NodeSource,
}

/// Texts that the words of a node are made of.
#[derive(Debug, Clone, PartialEq)]
struct NodeSource {
    joint_name: String,
    comment: String,
    params: String,
}

impl NodeSource {
    fn is(&self, joint_name: &str, tag: &TagData, params: &str) -> bool {
        self.joint_name == joint_name && self.comment == tag.comment && self.params == params
    }
}

/// Dependency of a command on an earlier one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct GraphWire {
    /// Index of the command that reads.
    pub to: usize,
    /// Index of the parameter among the inputs; their number for what is read besides.
    pub input: usize,
    /// Index of the command that is read from.
    pub from: usize,
}

/// A feature, or a local group.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct GraphFrame {
    /// The feature tag, or the group.
    pub uid: Uid,
    /// True for a feature.
    pub is_feature: bool,
    /// Name for people.
    pub name: String,
    /// Local group of the joint that carries the feature tag, which tells one limb from another; empty for a group.
    pub place: String,
    /// Switch of the feature tag, or of the group.
    pub enabled: bool,
}

impl GraphFrame {
    /// Name with the place, as a title.
    pub fn title(&self) -> String {
        match self.place.as_str() {
            "" => self.name.clone(),
            place => format!("{place} · {}", self.name),
        }
    }
}

/// Frame of a command: its feature, or else the local group of its joint.
pub(super) fn frame_of(rig: &Rig, joint: &JointData, tag: &TagData) -> Option<Uid> {
    let TagKind::Command { feature, .. } = &tag.kind else { return None };
    let is_feature = |uid: &Uid| rig.find_tag(*uid).is_some_and(|(_, tag)| matches!(tag.kind, TagKind::Feature { .. }));
    feature.filter(is_feature).or(joint.group)
}

/// True if a command of a rig is in a frame.
pub(super) fn has_frames(rig: &Rig) -> bool {
    let mut tags = rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| (&joint.data, tag)));
    tags.any(|(joint, tag)| frame_of(rig, joint, tag).is_some())
}

/// A frame by its uid; `None` for one that is gone.
fn frame(rig: &Rig, uid: Uid) -> Option<GraphFrame> {
    if let Some(group) = rig.group(uid) {
        let (name, place, enabled) = (group.name.clone(), String::new(), group.enabled);
        return Some(GraphFrame { uid, is_feature: false, name, place, enabled });
    }
    let (joint, tag) = rig.find_tag(uid)?;
    let TagKind::Feature { kind, name, switch, .. } = &tag.kind else { return None };
    let name = words::feature(kind, name, switch);
    let place = joint.data.group.and_then(|group| rig.group(group)).map(|group| group.name.clone());
    Some(GraphFrame { uid, is_feature: true, name, place: place.unwrap_or_default(), enabled: tag.enabled })
}

impl Graph {
    /// The graph of a rig. `builder` tells what commands read in their last runs; the references to commands that stand in
    /// the parameters are wires before any run, too. Nodes of `known` that say the same as before are taken from there.
    pub fn of(rig: &Rig, builder: Option<&Builder>, modules: &Modules, looks: &mut ModuleLooks, known: Self) -> Self {
        let mut known: BTreeMap<Uid, GraphNode> = known.nodes.into_iter().map(|node| (node.tag, node)).collect();
        let mut graph = Self::default();
        let mut frames: BTreeMap<Uid, Option<usize>> = BTreeMap::new();
        for joint in rig.walk() {
            for tag in &joint.data.tags {
                let TagKind::Command { module, params, .. } = &tag.kind else { continue };
                let name = joint_name(&joint.data);
                let same =
                    known.remove(&tag.uid).filter(|node| node.module == *module && node.source.is(&name, tag, params));
                let frame = frame_of(rig, &joint.data, tag).and_then(|uid| {
                    *frames.entry(uid).or_insert_with(|| {
                        graph.frames.push(frame(rig, uid)?);
                        Some(graph.frames.len() - 1)
                    })
                });
                graph.add(match same {
                    Some(node) => GraphNode { joint: joint.data.uid, frame, enabled: tag.enabled, ..node },
                    None => {
                        let node = node(&joint.data, tag, (module, params), looks.of(module, modules));
                        GraphNode { frame, ..node }
                    }
                });
            }
        }
        graph.wire(builder);
        graph
    }

    fn add(&mut self, node: GraphNode) {
        self.at.insert(node.tag, self.nodes.len());
        self.nodes.push(node);
    }

    fn wire(&mut self, builder: Option<&Builder>) {
        let mut wires: BTreeSet<GraphWire> = BTreeSet::new();
        let mut add = |reader: Uid, parameter: Option<&str>, source: Uid| {
            let (Some(to), Some(from)) = (self.at.get(&reader).copied(), self.at.get(&source).copied()) else { return };
            let inputs = &self.nodes[to].inputs;
            let found = parameter.and_then(|parameter| inputs.iter().position(|known| known == parameter));
            wires.insert(GraphWire { to, input: found.unwrap_or(inputs.len()), from });
        };
        for node in &self.nodes {
            for (parameter, source) in &node.written {
                add(node.tag, Some(parameter), *source);
            }
        }
        for read in builder.map(Builder::dependencies).unwrap_or_default() {
            // Errors and reads of a part of a parameter name the part: `names[2]`.
            let parameter = read.parameter.as_deref().map(|name| name.split(['[', '.']).next().unwrap_or(name));
            add(read.reader, parameter, read.source);
        }
        self.wires = wires.into_iter().collect();
    }

    /// The joint's commands that stand after a command, the next one first.
    pub fn next_on_joint(&self, number: usize) -> Option<Uid> {
        let joint = self.nodes[number].joint;
        self.nodes.get(number + 1).filter(|node| node.joint == joint).map(|node| node.tag)
    }
}

fn node(joint: &JointData, tag: &TagData, (module, params): (&str, &str), look: &ModuleLook) -> GraphNode {
    let name = joint_name(joint).into_owned();
    GraphNode {
        tag: tag.uid,
        joint: joint.uid,
        module: module.to_owned(),
        title: format!("{} · {name}", look.title),
        summary: words::summary(&tag.comment, params),
        inputs: look.inputs.clone(),
        frame: None,
        enabled: tag.enabled,
        written: written_references(params),
        source: NodeSource { joint_name: name, comment: tag.comment.clone(), params: params.to_owned() },
    }
}

/// References to commands in parameters: (parameter, command that is meant).
fn written_references(params: &str) -> Vec<(String, Uid)> {
    if !params.contains("@command") {
        return Vec::new();
    }
    let fields = fields(params);
    let mut list = Vec::new();
    for found in references_in(params) {
        let Ok(references) = found.references else { continue };
        let field = fields
            .iter()
            .find(|field| field.depth == 1 && field.value <= found.range.start && found.range.end <= field.end);
        let Some(field) = field else { continue };
        for reference in &references {
            if let Source::Command(source) = reference.source {
                list.push((field.name.to_owned(), source));
            }
        }
    }
    list
}
