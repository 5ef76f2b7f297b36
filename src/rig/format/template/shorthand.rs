//! Shorthand of format 2: what people leave out of a template follows from what they write.
//!
//! A uid that is left out is derived: a joint's from its label, a group's and a stored pose's from the name, a tag's from
//! its joint, its module and the name that it gives, the rig's from its name. Joints, groups and features are referred to
//! by these names, `control(shape: "ring")` stands for `Command(module: "control", params: (shape: "ring"))`, and three
//! angles in degrees for a rotation. [`explicit`] writes all of it out, so that one strict reader reads every file, and
//! keeps the places of the source for errors.

mod declarations;

use std::{
    borrow::Cow,
    cell::{Cell, OnceCell},
    collections::{BTreeMap, HashMap},
    ops::Range,
};

use crate::rig::{
    Uid, UidError, degrees,
    format::{
        scan::tokens,
        source::{SourceError, TextLines},
        template::{quaternion, quoted},
        tree::{Item, NodeId, Tree},
    },
    nearest::{did_you_mean, listed_first},
    reference::{MOST_COMPARED, NameKind},
};

pub(in crate::rig::format) use declarations::{Declaration, Declarations, TagForm};

/// The first format with shorthand.
pub(super) const FIRST_FORMAT: u32 = 2;

/// Fields of a tag in the short form; all others are parameters of its module.
pub(in crate::rig::format) const TAG_FIELDS: [&str; 4] = ["uid", "enabled", "comment", "feature"];

/// Text of a template without shorthand, with the place in its source of everything in it.
pub struct ExplicitText<'a> {
    source: &'a str,
    /// The text.
    pub text: Cow<'a, str>,
    /// Pieces of the text in order; empty if it is the source.
    pieces: Vec<Piece>,
    /// Names that nothing has, and declarations that nothing identifies.
    pub faults: Vec<SourceError>,
    /// Names of parents that the file does not have and its parts may bring, by the uids that stand for them in the text.
    parents: BTreeMap<Uid, String>,
}

/// Piece of an explicit text: copied from the source, or written in place of some of it.
struct Piece {
    start: usize,
    source: usize,
    is_copy: bool,
}

impl<'a> ExplicitText<'a> {
    /// Source of the text.
    pub fn source(&self) -> &'a str {
        self.source
    }

    /// Place in the source of a place in the text, in bytes.
    pub fn in_source(&self, offset: usize) -> usize {
        let Some(number) = self.pieces.partition_point(|piece| piece.start <= offset).checked_sub(1) else {
            return offset.min(self.source.len());
        };
        let piece = &self.pieces[number];
        piece.source + if piece.is_copy { offset - piece.start } else { 0 }
    }

    /// Name of the parent for which a uid stands in the text; `None` for a uid that the source has itself.
    pub(super) fn parent_name(&self, uid: Uid) -> Option<&str> {
        self.parents.get(&uid).map(String::as_str)
    }

    /// An error in the text as one in the source.
    pub fn fault(&self, error: SourceError) -> SourceError {
        match self.pieces.is_empty() {
            true => error,
            false => SourceError::at(self.source, self.in_source(error.offset), error.message),
        }
    }

    /// Errors in the text as errors in the source.
    pub(super) fn faults_in_source(&self, errors: Vec<SourceError>) -> Vec<SourceError> {
        if self.pieces.is_empty() || errors.is_empty() {
            return errors;
        }
        let lines = TextLines::new(self.source);
        errors.into_iter().map(|error| lines.error(self.in_source(error.offset), error.message)).collect()
    }
}

/// The text of a template without shorthand. A text of format 1, and one whose brackets do not match, is itself.
pub fn explicit(source: &str) -> ExplicitText<'_> {
    let (text, parents) = (Cow::Borrowed(source), BTreeMap::new());
    let unchanged = ExplicitText { source, text, pieces: Vec::new(), faults: Vec::new(), parents };
    if says_older_format(source) {
        return unchanged;
    }
    let Some(declared) = Declarations::find(source).filter(|declared| declared.format() >= FIRST_FORMAT) else {
        return unchanged;
    };
    // The tree, which is larger than the text, is gone before the text with the changes comes.
    let Omissions { changes, faults, parents } = omissions_of(declared);
    if changes.is_empty() {
        return ExplicitText { faults, ..unchanged };
    }
    let (mut text, mut pieces) = (String::with_capacity(source.len() * 2), Vec::new());
    let mut at = 0;
    for Change { range, text: with } in &changes {
        pieces.push(Piece { start: text.len(), source: at, is_copy: true });
        text.push_str(&source[at..range.start.max(at)]);
        pieces.push(Piece { start: text.len(), source: range.start, is_copy: false });
        text.push_str(with);
        at = range.end.max(at);
    }
    pieces.push(Piece { start: text.len(), source: at, is_copy: true });
    text.push_str(&source[at..]);
    ExplicitText { source, text: Cow::Owned(text), pieces, faults, parents }
}

/// Text of the things that a source leaves out, in the order of their places, and what is at fault.
struct Omissions {
    changes: Vec<Change>,
    faults: Vec<SourceError>,
    parents: BTreeMap<Uid, String>,
}

fn omissions_of(declared: Declarations) -> Omissions {
    let mut writer = Writer::new(&declared);
    writer.declarations();
    let Writer { mut changes, mut faults, parents, .. } = writer;
    faults.extend(declared.faults);
    faults.sort_by_key(|fault| fault.offset);
    changes.sort_by_key(|change| (change.range.start, change.range.end));
    Omissions { changes, faults, parents }
}

/// Returns `true` for a text that says a format without shorthand: no tree of it is needed, which is ten times as large.
fn says_older_format(text: &str) -> bool {
    let (mut tokens, mut depth, mut before) = (tokens(text), 0_usize, "");
    while let Some(token) = tokens.next() {
        match token.text {
            "(" | "[" | "{" => depth += 1,
            ")" | "]" | "}" => depth = depth.saturating_sub(1),
            "format" if depth == 1 && matches!(before, "(" | ",") => {
                let is_field = tokens.next().is_some_and(|colon| colon.text == ":");
                let number = tokens.next().and_then(|number| number.text.parse::<u32>().ok());
                return is_field && number.is_some_and(|number| number < FIRST_FORMAT);
            }
            _ => {}
        }
        before = token.text;
    }
    false
}

/// Text in place of a range of the source.
struct Change {
    range: Range<usize>,
    text: String,
}

/// Reason why a name in a template means nothing.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(in crate::rig::format) enum NameError {
    /// A name that nothing of its kind has.
    #[error("there is no {kind} \"{name}\" in the file{nearest}")]
    Unknown {
        /// Kind of thing: joint, group, feature.
        kind: String,
        /// The name.
        name: String,
        /// End of the sentence with similar names.
        nearest: String,
    },
    /// A name that several things of its kind have.
    #[error("{count} {kind}s are called \"{name}\"; write the uid, {uids}")]
    Ambiguous {
        /// Kind of thing: joint, group, feature.
        kind: String,
        /// The name.
        name: String,
        /// Number of the things with that name.
        count: usize,
        /// Uids of the first of them, in words: thousands of things with one name make no text each that names them all.
        uids: String,
    },
}

impl NameError {
    /// Error about a name that things with these uids have.
    pub fn ambiguous(kind: &str, name: &str, uids: &[Uid]) -> Self {
        let listed = listed_first(uids.iter().map(Uid::to_string), uids.len(), "or");
        Self::Ambiguous { kind: kind.to_owned(), name: name.to_owned(), count: uids.len(), uids: listed }
    }
}

/// Things of a text by the names that refer to them.
pub(super) struct NameIndex<'d> {
    groups: ByName<'d>,
    joints: ByName<'d>,
    features: ByName<'d>,
    /// Features of each joint by their names, `None` for several of one name; joints are told by their first tag.
    of_joints: HashMap<NodeId, HashMap<String, Option<Uid>>>,
    /// Number of names that unknown ones were compared with.
    compared: Cell<usize>,
}

type ByName<'d> = HashMap<Cow<'d, str>, Vec<Uid>>;

impl<'d> NameIndex<'d> {
    pub fn new(declared: &'d Declarations) -> Self {
        fn by_name<'d>(named: impl Iterator<Item = (Cow<'d, str>, Uid)>) -> ByName<'d> {
            let mut called = ByName::new();
            for (name, uid) in named {
                called.entry(name).or_default().push(uid);
            }
            called
        }
        let named = |one: &'d Declaration| Some((Cow::Borrowed(one.name.as_deref()?), one.uid));
        let (mut of_joints, mut features) = (HashMap::new(), ByName::new());
        for tags in &declared.tags {
            let mut own: HashMap<String, Option<Uid>> = HashMap::new();
            for tag in tags {
                let Some(name) = feature_name(&declared.tree, tag.node) else { continue };
                own.entry(name.clone()).and_modify(|only| *only = None).or_insert(Some(tag.uid));
                features.entry(Cow::Owned(name)).or_default().push(tag.uid);
            }
            if let Some(first) = tags.first().filter(|_| !own.is_empty()) {
                of_joints.insert(first.node, own);
            }
        }
        Self {
            groups: by_name(declared.groups.iter().filter_map(named)),
            joints: by_name(declared.joints.iter().filter_map(named)),
            features,
            of_joints,
            compared: Cell::new(0),
        }
    }

    /// The only joint or group with that name.
    ///
    /// # Errors
    /// See [`NameError`].
    pub fn find(&self, name: &str, kind: NameKind) -> Result<Uid, NameError> {
        let among = if kind == NameKind::Group { &self.groups } else { &self.joints };
        self.found(among, name, &kind.to_string())
    }

    /// The feature with that name: by name, or by name and switch with a point between, or by its kind if it has no name;
    /// of the same joint, whose tags are `own`, else the only one of the file.
    ///
    /// # Errors
    /// As [`find`](Self::find).
    pub fn feature(&self, name: &str, own: &[Declaration]) -> Result<Uid, NameError> {
        let of_joint = own.first().and_then(|first| self.of_joints.get(&first.node));
        match of_joint.and_then(|features| features.get(name)) {
            Some(Some(uid)) => Ok(*uid),
            _ => self.found(&self.features, name, "feature"),
        }
    }

    /// The only thing with that name. An unknown name is compared with all others, until these are [`MOST_COMPARED`].
    ///
    /// # Errors
    /// See [`NameError`].
    fn found(&self, among: &ByName, name: &str, kind: &str) -> Result<Uid, NameError> {
        match among.get(name).map(Vec::as_slice) {
            Some([uid]) => Ok(*uid),
            Some(uids) => Err(NameError::ambiguous(kind, name, uids)),
            None => {
                let mut names: Vec<&str> = Vec::new();
                if self.compared.get() < MOST_COMPARED {
                    names.extend(among.keys().map(|name| &**name));
                    names.sort_unstable();
                }
                self.compared.set(self.compared.get() + names.len());
                let nearest = did_you_mean(name, names);
                Err(NameError::Unknown { kind: kind.to_owned(), name: name.to_owned(), nearest })
            }
        }
    }
}

struct Writer<'d, 'a> {
    declared: &'d Declarations<'a>,
    /// Index of names, made when the first is looked up: a text whose references are uids needs none.
    called: OnceCell<NameIndex<'d>>,
    changes: Vec<Change>,
    faults: Vec<SourceError>,
    /// Lines of the text, marked for the first fault.
    lines: OnceCell<TextLines<'a>>,
    parents: BTreeMap<Uid, String>,
}

impl<'d, 'a> Writer<'d, 'a> {
    fn new(declared: &'d Declarations<'a>) -> Self {
        let (called, parents) = (OnceCell::new(), BTreeMap::new());
        Self { declared, called, changes: Vec::new(), faults: Vec::new(), lines: OnceCell::new(), parents }
    }

    fn called(&self) -> &NameIndex<'d> {
        self.called.get_or_init(|| NameIndex::new(self.declared))
    }

    fn tree(&self) -> &'d Tree<'a> {
        &self.declared.tree
    }

    fn declarations(&mut self) {
        let declared = self.declared;
        let named = declared.groups.iter().chain(&declared.inputs).chain(&declared.poses);
        for declaration in std::iter::once(&declared.rig).chain(named) {
            self.say_uid(declaration);
        }
        for input in &declared.inputs {
            self.say_rotation(input.node);
        }
        for pose in &declared.poses {
            for (list, field) in [("offsets", "joint"), ("values", "node")] {
                for item in self.tree().elements(pose.node, list) {
                    self.refer(item.value, field, NameKind::Joint);
                    self.say_rotation(item.value);
                }
            }
        }
        for (joint, tags) in declared.joints.iter().zip(&declared.tags) {
            self.say_uid(joint);
            self.refer(joint.node, "parent", NameKind::Joint);
            self.refer(joint.node, "mirror", NameKind::Joint);
            self.refer(joint.node, "group", NameKind::Group);
            self.say_rotation(joint.node);
            for tag in tags {
                if let Some(TagForm::Short(module)) = TagForm::of(self.tree(), tag.node) {
                    self.say_command(tag, module, tags);
                    continue;
                }
                self.say_uid(tag);
                self.say_parameters(tag.node);
                if let Some(field) = self.tree().field(tag.node, "feature") {
                    let said = self.feature(field, tags);
                    self.replace(field.value, said);
                }
            }
        }
    }

    fn say_uid(&mut self, declaration: &Declaration) {
        let tree = self.tree();
        let node = tree.node(declaration.node);
        if declaration.is_written || node.bracket != Some('(') {
            return;
        }
        let said = format!("\"{}\"", declaration.uid);
        if let Some(field) = tree.field(declaration.node, "uid") {
            let message = match tree.string(declaration.node, "uid") {
                Some(text) => UidError(text).to_string(),
                None => format!("{} is no uid; write 16 hexadecimal digits in quotes", tree.written(field.value)),
            };
            self.tell(tree.node(field.value).range.start, message);
            self.replace(field.value, said);
        } else {
            let comma = if node.items.is_empty() { "" } else { ", " };
            self.put(node.inside..node.inside, format!("uid: {said}{comma}"));
        }
    }

    /// Writes the parameters of a command that leaves them out.
    fn say_parameters(&mut self, tag: NodeId) {
        let node = self.tree().node(tag);
        let is_command = matches!(TagForm::of(self.tree(), tag), Some(TagForm::Command));
        if is_command && self.tree().field(tag, "params").is_none() && !node.items.is_empty() {
            self.put(node.inside..node.inside, "params: (), ".to_owned());
        }
    }

    /// Writes the uid in place of a name in a field.
    fn refer(&mut self, node: NodeId, field: &str, kind: NameKind) {
        let Some(item) = self.tree().field(node, field) else { return };
        let Some(name) = self.tree().string(node, field).filter(|name| name.parse::<Uid>().is_err()) else { return };
        let said = match self.called().find(&name, kind) {
            Ok(uid) => format!("\"{uid}\""),
            Err(NameError::Unknown { .. }) if field == "parent" && self.has_parts() => {
                let uid = Uid::derived(["parent in a part", name.as_str()]);
                self.parents.insert(uid, name);
                format!("\"{uid}\"")
            }
            Err(error) => self.fault(item, error.to_string()),
        };
        self.replace(item.value, said);
    }

    /// True if the template uses parts.
    fn has_parts(&self) -> bool {
        let tree = self.tree();
        let has_fields = |item: &Item| tree.node(item.value).items.iter().any(|item| item.key.is_some());
        tree.elements(tree.root(), "parts").iter().any(has_fields)
    }

    /// Value of a field that names a feature.
    fn feature(&mut self, item: &Item<'a>, own: &[Declaration]) -> String {
        let tree = self.tree();
        let written = tree.written(item.value);
        let name: Option<String> = ron::from_str(tree.written(tree.optional(item.value))).ok();
        let Some(name) = name.filter(|name| name.parse::<Uid>().is_err()) else { return written.to_owned() };
        match self.called().feature(&name, own) {
            Ok(uid) => format!("\"{uid}\""),
            Err(error) => self.fault(item, error.to_string()),
        }
    }

    /// Writes a command of the short form in the long one.
    fn say_command(&mut self, tag: &Declaration, module: &str, tags: &[Declaration]) {
        let tree = self.tree();
        let node = tree.node(tag.node);
        let mut front = format!("Command(uid: \"{}\", module: {}, ", tag.uid, quoted(module));
        for item in node.items.iter().filter(|item| item.key.is_some_and(|key| TAG_FIELDS.contains(&key))) {
            let field = item.key.unwrap_or_default();
            let said = match field {
                "feature" => self.feature(item, tags),
                _ => tree.written(item.value).to_owned(),
            };
            if field != "uid" {
                front.push_str(&format!("{field}: {said}, "));
            } else if !tag.is_written {
                let message =
                    format!("{said} is no uid; write 16 hexadecimal digits in quotes, or leave the field out");
                self.fault(item, message);
            }
            let blanks = tree.text[item.end..].len() - tree.text[item.end..].trim_start_matches([' ', '\t']).len();
            self.put(item.start..item.end + blanks, String::new());
        }
        front.push_str("params: (");
        if node.bracket.is_none() {
            self.put(node.range.clone(), format!("{front}))"));
            return;
        }
        self.put(node.range.start..node.inside, front);
        self.put(node.range.end..node.range.end, ")".to_owned());
    }

    /// Writes a quaternion in place of three angles.
    fn say_rotation(&mut self, node: NodeId) {
        let tree = self.tree();
        let Some(value) = tree.field(node, "rotation").map(|field| field.value) else { return };
        let angles: Vec<f32> =
            tree.node(value).items.iter().filter_map(|item| tree.written(item.value).parse().ok()).collect();
        if let ([x, y, z], 3) = (angles.as_slice(), tree.node(value).items.len()) {
            self.replace(value, quaternion(degrees([*x, *y, *z].into())));
        }
    }

    fn replace(&mut self, node: NodeId, text: String) {
        self.put(self.tree().node(node).range.clone(), text);
    }

    fn put(&mut self, range: Range<usize>, text: String) {
        self.changes.push(Change { range, text });
    }

    /// Tells a fault at a place of the text.
    fn tell(&mut self, offset: usize, message: String) {
        let error = self.lines.get_or_init(|| TextLines::new(self.declared.tree.text)).error(offset, message);
        self.faults.push(error);
    }

    /// Tells a fault of a field; returns the value that stands for the missing one.
    fn fault(&mut self, item: &Item, message: String) -> String {
        self.tell(item.start, message);
        "None".to_owned()
    }
}

/// Name by which commands refer to a feature; `None` for another tag.
pub(in crate::rig::format) fn feature_name(tree: &Tree, node: NodeId) -> Option<String> {
    if !matches!(TagForm::of(tree, node)?, TagForm::Feature) {
        return None;
    }
    let text = |field: &str| tree.string(node, field).filter(|text| !text.is_empty());
    let name = text("name").or_else(|| text("kind"))?;
    Some(match text("switch") {
        Some(switch) => format!("{name}.{switch}"),
        None => name,
    })
}
