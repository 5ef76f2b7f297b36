//! Titles of operations: their names with what they change (joints, tags and parameters, poses, clips, groups), which tell the
//! steps of a history apart.

use std::{
    borrow::Cow,
    collections::{BTreeMap, BTreeSet},
};

use super::{ClipOperation, KeyOperation, KeyTimes, Operation, PasteTo, TagOperation};
use crate::rig::{Rig, RigEdit, SelectionSet, TagKind, Uid, animation::TrackTarget, feature::FeatureKey, format::scan};

/// Largest number of letters of a joint's name in a title.
const LETTERS: usize = 40;

/// Largest number of nodes of a pose that its title is about; a pose of more is one of the whole rig.
const FEW: usize = 3;

/// Largest number of letters of a module or parameter, which stands beside a joint's name.
const WORD_LETTERS: usize = 24;

impl Operation {
    /// Title of the step that the operation makes on `rig`: "Pose hand_l", "Move hand_l and 2 more", "Set size of control of
    /// hips"; [`Self::name`] where the operation is about nothing in particular. `name_of` gives the name of a node before the
    /// operation.
    pub fn title(&self, rig: &Rig, name_of: &dyn Fn(Uid) -> Option<String>) -> Cow<'static, str> {
        let names = TitleNames { rig, name_of };
        let title = match self {
            Self::Place { parent, .. } => names.below("Place joint", *parent),
            Self::Chain { parent, .. } => names.below("Draw chain", *parent),
            Self::Insert { child, .. } => names.nodes("Insert joint above", &[*child]),
            Self::Delete { joints, .. } => names.nodes("Delete", joints),
            Self::Move { to, .. } => names.nodes("Move", &first_of(to)),
            Self::Rotate { joints, .. } => names.nodes("Rotate", joints),
            Self::Scale { joints, .. } => names.nodes("Scale", joints),
            Self::Rest { to, .. } => names.nodes("Set rest of", &first_of(to)),
            Self::Reparent { joints, .. } => names.nodes("Reparent", joints),
            Self::Labels(labels) => names.nodes("Rename", &first_of(labels)),
            Self::Orient { joints, .. } => names.nodes("Orient", joints),
            Self::Mirror { joints } => names.nodes("Mirror", joints),
            Self::Group { joints, name, .. } if name.is_empty() => names.nodes("Ungroup", joints),
            Self::Group { joints, name, .. } => {
                names.nodes("Group", joints).map(|title| format!("{title} in {}", cut(name, LETTERS)))
            }
            Self::Lock(joints, true) => names.nodes("Lock", joints),
            Self::Lock(joints, false) => names.nodes("Unlock", joints),
            Self::Pose(offsets) => names.nodes("Pose", &first_of(offsets)),
            Self::ResetPose(joints) => names.nodes("Reset", joints),
            Self::StorePose(name) | Self::StoreShown(name, _) => Some(format!("Store pose {}", cut(name, LETTERS))),
            Self::ApplyPose(pose) => names.pose("Apply", *pose),
            Self::RenamePose(pose, _) => names.pose("Rename", *pose),
            Self::DeletePose(pose) => names.pose("Delete", *pose),
            Self::Clips(operation) => names.clips(operation),
            Self::Tags(operation) => names.tags(operation),
            Self::Merge { other, .. } => {
                let name = &other.about().name;
                (!name.is_empty()).then(|| format!("Merge rig {}", cut(name, LETTERS)))
            }
            Self::Edits(edits) => names.edits(edits),
            Self::Named { name, edits } => names.attribute(edits).or_else(|| names.set(name, edits)),
            Self::Keyed { operation, .. } | Self::Built { operation, .. } | Self::Carried { operation, .. } => {
                return operation.title(rig, name_of);
            }
            Self::SetPose { name, offsets, values } => {
                let posed = offsets.iter().map(|(node, _)| *node).chain(values.iter().map(|(node, ..)| *node));
                let posed: Vec<Uid> = posed.collect::<BTreeSet<Uid>>().into_iter().collect();
                let is_few = posed.len() <= FEW;
                if is_few { names.nodes(&format!("{name} of"), &posed) } else { None }
            }
        };
        title.map_or(Cow::Borrowed(self.name()), Cow::Owned)
    }
}

/// Names of what a rig has before an operation.
struct TitleNames<'a> {
    rig: &'a Rig,
    name_of: &'a dyn Fn(Uid) -> Option<String>,
}

impl TitleNames<'_> {
    /// Name of a node, as titles have it.
    fn name(&self, node: Uid) -> Option<String> {
        Some(cut(&(self.name_of)(node)?, LETTERS))
    }

    /// Title about nodes; `None` for no node, or one without a name.
    fn nodes(&self, verb: &str, nodes: &[Uid]) -> Option<String> {
        several(verb, self.name(*nodes.first()?)?, nodes.len())
    }

    fn below(&self, verb: &str, parent: Option<Uid>) -> Option<String> {
        Some(format!("{verb} below {}", self.name(parent?)?))
    }

    fn pose(&self, verb: &str, pose: Uid) -> Option<String> {
        let stored = self.rig.stored_pose(pose)?;
        Some(format!("{verb} pose {}", cut(&stored.name, LETTERS)))
    }

    fn group(&self, verb: &str, group: Uid) -> Option<String> {
        Some(format!("{verb} group {}", cut(&self.rig.group(group)?.name, LETTERS)))
    }

    /// Kind of a tag with the name of its joint: "control of hips".
    fn tag(&self, tag: Uid) -> Option<String> {
        let (joint, tag) = self.rig.find_tag(tag)?;
        Some(format!("{} of {}", kind_name(&tag.kind), self.name(joint.data.uid)?))
    }

    /// Title about tags; `None` for no tag, or one that is not there.
    fn each_tag(&self, verb: &str, tags: &[Uid]) -> Option<String> {
        several(verb, self.tag(*tags.first()?)?, tags.len())
    }

    fn tags(&self, operation: &TagOperation) -> Option<String> {
        match operation {
            TagOperation::Add { joints, kind, .. } => self.nodes(&format!("Add {} to", kind_name(kind)), joints),
            TagOperation::Insert { joint, kind, .. } => {
                self.nodes(&format!("Insert {} on", kind_name(kind)), &[*joint])
            }
            TagOperation::Delete(tags) => self.each_tag("Delete", tags),
            TagOperation::Enable(tags, true) => self.each_tag("Enable", tags),
            TagOperation::Enable(tags, false) => self.each_tag("Disable", tags),
            TagOperation::Move { tags, .. } => self.each_tag("Move", tags),
            TagOperation::MoveEach(moves) => several("Move", self.tag(moves.first()?.0)?, moves.len()),
            TagOperation::Comment(tag, _) => self.each_tag("Comment", &[*tag]),
            TagOperation::Params(tags) => self.params(tags),
            TagOperation::Feature { tag, .. } => self.each_tag("Change", &[*tag]),
            TagOperation::Choice(tags, _) => self.each_tag("Change choice of", tags),
            TagOperation::Attach(tags, Some(feature)) => {
                let (_, feature) = self.rig.find_tag(*feature)?;
                Some(format!("{} to {}", self.each_tag("Attach", tags)?, kind_name(&feature.kind)))
            }
            TagOperation::Attach(tags, None) => self.each_tag("Detach", tags),
            TagOperation::Cut(clipboard) => {
                let joints: Vec<Uid> = clipboard.joints.iter().map(|joint| joint.uid).collect();
                self.nodes("Cut tags of", &joints)
            }
            TagOperation::Paste { to: PasteTo::Joints(joints), .. } => self.nodes("Paste tags onto", joints),
            TagOperation::Paste { to: PasteTo::Mirror, clipboard, .. } => {
                let joints: Vec<Uid> = clipboard.joints.iter().map(|joint| joint.uid).collect();
                self.nodes("Paste tags mirrored of", &joints)
            }
            TagOperation::Drop { part, joints, .. } => {
                self.nodes(&format!("Drop part {} onto", cut(&part.rig.about().name, WORD_LETTERS)), joints)
            }
            TagOperation::AddPart { part, .. } => Some(format!("Add part {}", part_name(part))),
            TagOperation::AddPair { part, .. } => Some(format!("Add part {} on both sides", part_name(part))),
            TagOperation::SetFeature(key, on) => Some(turned(self.feature(key), *on)),
            TagOperation::SetSwitch(key, switch, on) => {
                Some(turned(format!("{} of {}", cut(switch, WORD_LETTERS), self.feature(key)), *on))
            }
            TagOperation::ChooseSwitch(key, switch) => {
                Some(format!("Choose {} of {}", cut(switch, WORD_LETTERS), self.feature(key)))
            }
            TagOperation::EnableGroup(group, true) => self.group("Enable", *group),
            TagOperation::EnableGroup(group, false) => self.group("Disable", *group),
        }
    }

    /// Name of a combined feature with that of its group.
    fn feature(&self, key: &FeatureKey) -> String {
        let name = cut(&key.name, WORD_LETTERS);
        match key.group.and_then(|group| self.rig.group(group)) {
            Some(group) => format!("{name} of {}", cut(&group.name, LETTERS)),
            None => name,
        }
    }

    /// Title of new parameters, with the one that changes if it is the only one.
    fn params(&self, tags: &[(Uid, String)]) -> Option<String> {
        let (first, after) = tags.first()?;
        let verb = match &self.rig.find_tag(*first)?.1.kind {
            TagKind::Command { params: before, .. } => match &changed(before, after)[..] {
                [only] => format!("Set {} of", cut(only, WORD_LETTERS)),
                _ => "Change".to_owned(),
            },
            TagKind::Feature { .. } => "Change".to_owned(),
        };
        several(&verb, self.tag(*first)?, tags.len())
    }

    fn clips(&self, operation: &ClipOperation) -> Option<String> {
        let name = |clip: Uid| Some(cut(&self.rig.clip(clip)?.name, LETTERS));
        let about = |clip: Uid| Some(format!("{} {}", operation.name(), name(clip)?));
        let within = |clip: Uid| Some(format!("{} of {}", operation.name(), name(clip)?));
        match operation {
            ClipOperation::Create { name, .. } => Some(format!("Create clip {}", cut(name, LETTERS))),
            ClipOperation::Add(clip) => Some(format!("Add clip {}", cut(&clip.name, LETTERS))),
            ClipOperation::AddAll(clips) => several("Add clip", cut(&clips.first()?.name, LETTERS), clips.len()),
            ClipOperation::Rename(clip, _)
            | ClipOperation::About(clip, _)
            | ClipOperation::Delete(clip)
            | ClipOperation::Retime { clip, .. }
            | ClipOperation::Bake(clip)
            | ClipOperation::Reduce { clip, .. } => about(*clip),
            ClipOperation::SetRate { clip, .. } => Some(format!("Retime clip {} to frame rate", name(*clip)?)),
            ClipOperation::AddLayer { clip, .. }
            | ClipOperation::SetLayer { clip, .. }
            | ClipOperation::MoveLayer { clip, .. }
            | ClipOperation::DeleteLayer { clip, .. }
            | ClipOperation::Adopt { clip, .. } => within(*clip),
            ClipOperation::Keys { clip, change, .. } => {
                let nodes = key_nodes(change);
                self.nodes(&format!("{} of", operation.name()), &nodes).or_else(|| within(*clip))
            }
        }
    }

    /// Title of edits that set one value of an attribute.
    fn attribute(&self, edits: &[RigEdit]) -> Option<String> {
        let [RigEdit::SetAttributeValue(node, attribute, _)] = edits else { return None };
        Some(format!("Set {} of {}", cut(attribute, WORD_LETTERS), self.name(*node)?))
    }

    /// Title of edits that change a selection set: their name with that of the set.
    fn set(&self, name: &str, edits: &[RigEdit]) -> Option<String> {
        let [RigEdit::SetSelectionSets(sets)] = edits else { return None };
        let now: &[SelectionSet] = self.rig.selection_sets();
        let is_in = |list: &[SelectionSet], set: &SelectionSet| list.contains(set);
        let other = sets.iter().find(|set| !is_in(now, set)).or_else(|| now.iter().find(|set| !is_in(sets, set)));
        Some(format!("{name} {}", cut(&other?.name, LETTERS)))
    }

    fn edits(&self, edits: &[RigEdit]) -> Option<String> {
        match edits {
            [RigEdit::SetLocalGroup(group)] => {
                let now = self.rig.group(group.uid)?;
                let verb = match (now.name == group.name, now.color == group.color) {
                    (false, true) => "Rename",
                    (true, false) => "Recolour",
                    _ => "Change",
                };
                self.group(verb, group.uid)
            }
            [RigEdit::AddLocalGroup(group, _)] => Some(format!("Add group {}", cut(&group.name, LETTERS))),
            [.., RigEdit::RemoveLocalGroup(last)] => {
                let count = edits.iter().filter(|edit| matches!(edit, RigEdit::RemoveLocalGroup(_))).count();
                several("Remove group", cut(&self.rig.group(*last)?.name, LETTERS), count)
            }
            [RigEdit::SetAbout(_)] => Some("Change header".to_owned()),
            [RigEdit::SetInputs(_)] => Some("Change inputs".to_owned()),
            [RigEdit::SetSkin(_, None)] => Some("Unbind mesh".to_owned()),
            [RigEdit::SetKind(joint, _)] => self.nodes("Change kind of", &[*joint]),
            [RigEdit::SetMirror(joint, _)] => self.nodes("Set other side of", &[*joint]),
            _ => self.attribute(edits),
        }
    }
}

/// Title about the first of several things.
fn several(verb: &str, first: String, count: usize) -> Option<String> {
    match count {
        0 => None,
        1 => Some(format!("{verb} {first}")),
        _ => Some(format!("{verb} {first} and {} more", count - 1)),
    }
}

fn turned(what: String, on: bool) -> String {
    format!("Turn {what} {}", if on { "on" } else { "off" })
}

fn first_of<T>(pairs: &[(Uid, T)]) -> Vec<Uid> {
    pairs.iter().map(|(node, _)| *node).collect()
}

/// Module of a command, or a feature with its name.
fn kind_name(kind: &TagKind) -> String {
    match kind {
        TagKind::Command { module, .. } => cut(module, WORD_LETTERS),
        TagKind::Feature { kind, name, .. } => {
            format!("feature {}", cut(if name.is_empty() { kind } else { name }, WORD_LETTERS))
        }
    }
}

/// Name of a part by its file.
fn part_name(file: &str) -> String {
    let name = file.rsplit(['/', '\\']).next().unwrap_or(file);
    cut(name.strip_suffix(".rig.ron").unwrap_or(name), WORD_LETTERS)
}

/// Outermost parameters that differ between two texts, by name.
fn changed<'a>(before: &'a str, after: &'a str) -> Vec<&'a str> {
    let (before, after) = (values(before), values(after));
    let names: BTreeSet<&str> = before.keys().chain(after.keys()).copied().collect();
    names.into_iter().filter(|name| before.get(name) != after.get(name)).collect()
}

/// Outermost parameters of a text with the texts of their values.
fn values(params: &str) -> BTreeMap<&str, &str> {
    let outermost = scan::fields(params).into_iter().filter(|field| field.depth == 1);
    let value = |field: scan::Field| {
        let text = params.get(field.value..field.end)?;
        Some(text.trim().trim_end_matches(',').trim_end())
    };
    outermost.filter_map(|field| Some((field.name, value(field)?))).collect()
}

/// Nodes whose keys are changed, each once; none where the change names no key.
fn key_nodes(change: &KeyOperation) -> Vec<Uid> {
    fn of<'a>(targets: impl Iterator<Item = &'a TrackTarget>) -> Vec<Uid> {
        let nodes: BTreeSet<Uid> = targets.map(|target| target.node).collect();
        nodes.into_iter().collect()
    }
    let times = |keys: &KeyTimes| of(keys.keys());
    match change {
        KeyOperation::Pose { nodes, .. } => nodes.clone(),
        KeyOperation::Values { values, .. } => of(values.iter().map(|(target, _)| target)),
        KeyOperation::Set(keys) => of(keys.iter().map(|(target, _)| target)),
        KeyOperation::Place(keys) => of(keys.iter().map(|(target, _)| target)),
        KeyOperation::Move { keys, .. }
        | KeyOperation::Scale { keys, .. }
        | KeyOperation::Mirror { keys, .. }
        | KeyOperation::Ease { keys, .. }
        | KeyOperation::Delete(keys) => times(keys),
        KeyOperation::Bake { targets, .. } | KeyOperation::Reduce { targets, .. } => of(targets.iter()),
        KeyOperation::Adopt { to, .. } => vec![*to],
        KeyOperation::Paste { .. } => Vec::new(),
    }
}

/// A name in one line, of at most so many letters.
fn cut(name: &str, letters: usize) -> String {
    let mut all = name.chars().map(|letter| if letter.is_control() { ' ' } else { letter });
    let mut text: String = all.by_ref().take(letters).collect();
    if all.next().is_some() {
        text.push('…');
    }
    text
}
