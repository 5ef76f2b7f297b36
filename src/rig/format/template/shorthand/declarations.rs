//! Declarations of a template's text: its groups, inputs, joints, tags and stored poses with their identities, written or derived.

use std::collections::{HashMap, HashSet};

use crate::rig::{
    Uid,
    format::{
        source::{SourceError, TextPlace},
        tree::{Item, NodeId, Tree},
    },
};

/// Declarations of a text, in its order.
pub(in crate::rig::format) struct Declarations<'a> {
    pub tree: Tree<'a>,
    pub rig: Declaration,
    pub groups: Vec<Declaration>,
    pub inputs: Vec<Declaration>,
    pub joints: Vec<Declaration>,
    /// Tags of each of the joints.
    pub tags: Vec<Vec<Declaration>>,
    pub poses: Vec<Declaration>,
    /// Declarations that nothing identifies.
    pub faults: Vec<SourceError>,
}

/// Declaration of one thing.
pub(in crate::rig::format) struct Declaration {
    /// The written uid, or the derived one.
    pub uid: Uid,
    /// The uid that follows from its names; `None` if they identify nothing.
    pub derived: Option<Uid>,
    /// True if the text has its uid.
    pub is_written: bool,
    /// The value that declares it.
    pub node: NodeId,
    /// Name of a group, input or pose, label of a joint.
    pub name: Option<String>,
}

impl<'a> Declarations<'a> {
    /// Declarations of a text; `None` if it is no struct with matching brackets.
    pub fn find(text: &'a str) -> Option<Self> {
        let tree = Tree::parse(text)?;
        let root = tree.root();
        if tree.node(root).bracket != Some('(') {
            return None;
        }
        let mut finder = Finder {
            tree: &tree,
            taken: written_uids(&tree),
            named: HashSet::new(),
            next: HashMap::new(),
            faults: Vec::new(),
            place: TextPlace::start(text),
        };
        let rig = finder.named(root, "rig", "name");
        let groups = finder.list(root, "groups", "group", "name");
        let inputs = finder.list(root, "inputs", "input", "name");
        let joints = finder.list(root, "joints", "joint", "label");
        let tags = joints.iter().map(|joint| finder.tags(joint)).collect();
        let poses = finder.list(root, "poses", "pose", "name");
        let faults = finder.faults;
        Some(Self { rig, groups, inputs, joints, tags, poses, faults, tree })
    }

    /// Format number of the file; 0 if it says none.
    pub fn format(&self) -> u32 {
        let field = self.tree.field(self.tree.root(), "format");
        field.and_then(|field| self.tree.written(field.value).parse().ok()).unwrap_or_default()
    }

    /// All declarations but that of the rig.
    pub fn all(&self) -> impl Iterator<Item = &Declaration> {
        let tags = self.tags.iter().flatten();
        self.groups.iter().chain(&self.inputs).chain(&self.joints).chain(tags).chain(&self.poses)
    }
}

/// Tag as it is written.
pub(in crate::rig::format) enum TagForm<'a> {
    /// `Command(module: "control", params: (...))`.
    Command,
    /// `Feature(...)`.
    Feature,
    /// `control(...)`: parameters stand beside the fields of the tag.
    Short(&'a str),
}

impl<'a> TagForm<'a> {
    /// Form of the tag that a value declares; `None` if it declares none.
    pub fn of(tree: &Tree<'a>, node: NodeId) -> Option<Self> {
        let value = tree.node(node);
        let word = match value.bracket {
            Some('(') => value.name,
            Some(_) => return None,
            None => tree.written(node),
        };
        match word {
            "Command" => Some(Self::Command),
            "Feature" => Some(Self::Feature),
            word => is_module(word).then_some(Self::Short(word)),
        }
    }
}

/// Returns `true` for names of modules that can stand before a bracket.
fn is_module(word: &str) -> bool {
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    word.starts_with(|c: char| c.is_lowercase() || c == '_') && word.chars().all(is_part)
}

struct Finder<'t, 'a> {
    tree: &'t Tree<'a>,
    taken: HashSet<Uid>,
    /// Uids that follow from names so far.
    named: HashSet<Uid>,
    /// The first number that is not tried yet, by names: those before it are taken.
    next: HashMap<String, u32>,
    faults: Vec<SourceError>,
    /// Place of the last fault.
    place: TextPlace<'t>,
}

impl Finder<'_, '_> {
    fn list(&mut self, root: NodeId, list: &str, kind: &str, name: &str) -> Vec<Declaration> {
        let tree = self.tree;
        tree.elements(root, list).iter().map(|item| self.named(item.value, kind, name)).collect()
    }

    /// Declaration of something that a name identifies.
    fn named(&mut self, node: NodeId, kind: &str, field: &str) -> Declaration {
        let name = self.tree.string(node, field).filter(|name| !name.is_empty());
        let derived = name.as_deref().map(|name| Uid::derived([kind, name]));
        if let Some(uid) = written_uid(self.tree, node) {
            return Declaration { uid, derived, is_written: true, node, name };
        }
        let is_identified = derived.is_some_and(|uid| self.named.insert(uid));
        if self.tree.field(node, "uid").is_none() && !is_identified {
            let at = self.tree.field(node, field).map_or(self.tree.node(node).range.start, |field| field.start);
            let message = match &name {
                Some(name) => format!(
                    "a {kind} with the {field} \"{name}\" is there already: give this one another {field}, or a uid of its own"
                ),
                None => format!("this {kind} has neither a {field} nor a uid; give it one of them"),
            };
            self.faults.push(self.place.error(at, message));
        }
        // The name may have been another's, who kept the uid.
        let uid = match derived.filter(|uid| self.taken.insert(*uid)) {
            Some(uid) => uid,
            None => self.free([kind, name.as_deref().unwrap_or_default(), ""]),
        };
        Declaration { uid, derived, is_written: false, node, name }
    }

    /// Tags of a joint: the second of equal module and name, and so on, are told apart by their number.
    fn tags(&mut self, joint: &Declaration) -> Vec<Declaration> {
        let tree = self.tree;
        let on = joint.uid.to_string();
        let mut counted: HashMap<[String; 3], usize> = HashMap::new();
        let mut list = Vec::new();
        for item in tree.elements(joint.node, "tags") {
            let key = tag_key(tree, item);
            let number = counted.entry(key.clone()).and_modify(|count| *count += 1).or_default();
            let number = if *number > 0 { number.to_string() } else { String::new() };
            let [module, name, switch] = &key;
            let derived = Uid::derived(["tag", &on, module, name, switch, &number]);
            let written = written_uid(tree, item.value);
            let uid = match written {
                Some(uid) => uid,
                None if self.taken.insert(derived) => derived,
                None => self.free([&on, module, &number]),
            };
            let name = Some(name.clone()).filter(|name| !name.is_empty());
            let is_written = written.is_some();
            list.push(Declaration { uid, derived: Some(derived), is_written, node: item.value, name });
        }
        list
    }

    /// A derived uid that nothing else has.
    fn free(&mut self, names: [&str; 3]) -> Uid {
        let next = self.next.entry(names.join("\0")).or_default();
        loop {
            let uid = Uid::derived(names.into_iter().chain(["again", &u32::to_string(next)]));
            *next += 1;
            if self.taken.insert(uid) {
                return uid;
            }
        }
    }
}

/// Key of a tag on its joint: module and name, or kind, name and switch of a feature.
fn tag_key(tree: &Tree, item: &Item) -> [String; 3] {
    let text = |name: &str| tree.string(item.value, name).unwrap_or_default();
    match TagForm::of(tree, item.value) {
        Some(TagForm::Feature) => [format!("feature {}", text("kind")), text("name"), text("switch")],
        Some(TagForm::Command) => {
            let params = tree.field(item.value, "params").map(|params| params.value);
            [text("module"), params.map(|params| given_name(tree, params)).unwrap_or_default(), String::new()]
        }
        Some(TagForm::Short(module)) => [module.to_owned(), given_name(tree, item.value), String::new()],
        None => [String::new(), String::new(), String::new()],
    }
}

/// Name that a command gives: that of its nodes, else of what else it makes.
fn given_name(tree: &Tree, params: NodeId) -> String {
    let creation = tree.field(params, "creation").map(|creation| tree.optional(creation.value));
    let of_nodes = creation.and_then(|creation| tree.string(creation, "name")).filter(|name| !name.is_empty());
    of_nodes.or_else(|| tree.string(params, "name")).unwrap_or_default()
}

fn written_uid(tree: &Tree, node: NodeId) -> Option<Uid> {
    tree.string(node, "uid")?.parse().ok()
}

/// All uids that declarations of a text say themselves: derived ones make way for them.
fn written_uids(tree: &Tree) -> HashSet<Uid> {
    let root = tree.root();
    let lists = ["groups", "inputs", "joints", "poses"].into_iter().flat_map(|list| tree.elements(root, list));
    let things = lists.flat_map(|item| {
        let tags = tree.elements(item.value, "tags").iter().map(|tag| tag.value);
        std::iter::once(item.value).chain(tags)
    });
    things.filter_map(|node| written_uid(tree, node)).collect()
}
