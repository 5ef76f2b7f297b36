//! Changes of single fields and list elements of a text.

use std::{
    collections::{HashMap, HashSet},
    ops::Range,
};

use crate::rig::{
    Uid,
    format::{
        layout::value_laid_out,
        template::shorthand::Declaration,
        tree::{Item, NodeId, Tree},
    },
};

/// Changes of a text, collected in any order.
pub(in crate::rig::format::template) struct Patch<'d, 'a> {
    tree: &'d Tree<'a>,
    changes: Vec<(Range<usize>, String)>,
}

impl<'d, 'a> Patch<'d, 'a> {
    pub fn new(tree: &'d Tree<'a>) -> Self {
        Self { tree, changes: Vec::new() }
    }

    /// The text with all changes.
    pub fn text(mut self) -> String {
        self.changes.sort_by_key(|(range, _)| (range.start, range.end));
        let source = self.tree.text;
        let mut out = String::with_capacity(source.len());
        let mut at = 0;
        for (range, text) in &self.changes {
            // What is inside of something removed goes with it.
            if range.start < at {
                continue;
            }
            out.push_str(&source[at..range.start]);
            out.push_str(text);
            at = range.end;
        }
        out.push_str(&source[at..]);
        out
    }

    /// Writes another value in place of one, in its layout.
    pub fn replace(&mut self, node: NodeId, value: &str) {
        let range = self.tree.node(node).range.clone();
        let (line, indent) = self.line_of(range.start);
        let before = self.tree.text[line..range.start].chars().count();
        self.changes.push((range, value_laid_out(value, indent, before)));
    }

    /// Sets a field to a value.
    pub fn set(&mut self, node: NodeId, field: &str, value: &str) {
        match self.tree.field(node, field) {
            Some(item) => self.replace(item.value, value),
            None => self.add(node, field, value),
        }
    }

    /// Sets a field to a value, or takes it out.
    pub fn set_or_remove(&mut self, node: NodeId, field: &str, value: Option<&str>) {
        match (value, self.tree.field(node, field)) {
            (Some(value), _) => self.set(node, field, value),
            (None, Some(item)) => {
                let range = self.block(item);
                self.changes.push((range, String::new()));
            }
            (None, None) => {}
        }
    }

    /// Sets the numbers of a field that differ, each in its place where all are written.
    pub fn set_numbers(&mut self, node: NodeId, field: &str, old: &[f32], new: &[f32]) {
        let same = |(a, b): (&f32, &f32)| a.to_bits() == b.to_bits();
        if old.iter().zip(new).all(same) {
            return;
        }
        let written = self.tree.field(node, field).map(|item| &self.tree.node(item.value).items);
        match written.filter(|items| items.len() == new.len()) {
            Some(items) => {
                for ((item, old), new) in items.iter().zip(old).zip(new) {
                    if !same((old, new)) {
                        self.changes.push((self.tree.node(item.value).range.clone(), format!("{new:?}")));
                    }
                }
            }
            None => {
                let numbers: Vec<String> = new.iter().map(|number| format!("{number:?}")).collect();
                self.set(node, field, &format!("({})", numbers.join(", ")));
            }
        }
    }

    /// Adds elements behind the last one of the list that is the value of a field.
    pub fn push(&mut self, node: NodeId, field: &str, texts: &[String]) {
        if texts.is_empty() {
            return;
        }
        let list = self.tree.field(node, field).map(|item| item.value);
        match list.map(|list| (list, self.tree.node(list).items.len())) {
            Some((list, count)) if count > 0 => {
                for text in texts {
                    self.insert(list, Some(count - 1), text);
                }
            }
            _ => self.set(node, field, &format!("[{}]", texts.join(", "))),
        }
    }

    /// Takes elements out of the list that is the value of a field, and the field if none is left.
    pub fn pull(&mut self, node: NodeId, field: &str, places: &[usize]) {
        let elements = self.tree.elements(node, field);
        if !places.is_empty() && places.len() == elements.len() {
            return self.set_or_remove(node, field, None);
        }
        for place in places {
            let range = self.block(&elements[*place]);
            self.changes.push((range, String::new()));
        }
    }

    /// Puts text before the first item of a struct.
    pub fn put_first(&mut self, node: NodeId, text: &str) {
        self.insert(node, None, text);
    }

    /// Changes a list so that it has the wanted elements. New ones come behind their forerunner, by default the one before
    /// in `wanted`; what stays keeps its place.
    pub fn list(
        &mut self,
        node: NodeId,
        field: &str,
        there: &[Declaration],
        wanted: &[Uid],
        forerunner: Option<&dyn Fn(Uid) -> Option<Uid>>,
        text: impl Fn(Uid) -> String,
    ) {
        let set: HashSet<Uid> = wanted.iter().copied().collect();
        let elements = self.tree.elements(node, field);
        let mut places: HashMap<Uid, usize> = HashMap::new();
        for (place, (item, declared)) in elements.iter().zip(there).enumerate() {
            if set.contains(&declared.uid) {
                places.insert(declared.uid, place);
            } else {
                let range = self.block(item);
                self.changes.push((range, String::new()));
            }
        }
        // New ones, each with the element of the text behind which it comes.
        let mut anchors: HashMap<Uid, Option<usize>> = HashMap::new();
        let mut added: Vec<(Option<usize>, Uid)> = Vec::new();
        let mut before = None;
        for uid in wanted {
            let behind = forerunner.map_or(before, |forerunner| forerunner(*uid));
            before = Some(*uid);
            if places.contains_key(uid) {
                continue;
            }
            let anchor =
                behind.and_then(|behind| places.get(&behind).copied().or(anchors.get(&behind).copied().flatten()));
            anchors.insert(*uid, anchor);
            added.push((anchor, *uid));
        }
        if added.is_empty() {
            return;
        }
        let list = self.tree.field(node, field).map(|field| field.value);
        match list.filter(|_| !places.is_empty()) {
            Some(list) => {
                for (anchor, uid) in added {
                    self.insert(list, anchor, &text(uid));
                }
            }
            None => {
                let all: Vec<String> = added.iter().map(|(_, uid)| text(*uid)).collect();
                self.set(node, field, &format!("[{}]", all.join(", ")));
            }
        }
    }

    /// Adds a field to a struct: before its tags, which may be long, else at its end.
    fn add(&mut self, node: NodeId, field: &str, value: &str) {
        let items = &self.tree.node(node).items;
        let last = items.iter().rposition(|item| item.key != Some("tags"));
        self.insert(
            node,
            if field == "tags" { items.len().checked_sub(1) } else { last },
            &format!("{field}: {value}"),
        );
    }

    /// Inserts an item behind another one, or before the first.
    fn insert(&mut self, node: NodeId, behind: Option<usize>, text: &str) {
        let tree = self.tree;
        let value = tree.node(node);
        if value.bracket.is_none() {
            return self.changes.push((value.range.end..value.range.end, format!("({text})")));
        }
        let Some(behind) = behind.map(|behind| &value.items[behind]) else {
            let text = match value.items.first() {
                Some(first) if self.is_alone(first) => {
                    let blanks = self.indentation(first.start);
                    format!("\n{blanks}{},", laid_out_item(text, blanks.len()))
                }
                Some(_) => format!("{text}, "),
                None => text.to_owned(),
            };
            return self.changes.push((value.inside..value.inside, text));
        };
        let end = tree.node(behind.value).range.end;
        let comma = if behind.has_comma { "," } else { "" };
        if !behind.has_comma {
            self.changes.push((end..end, ",".to_owned()));
        }
        if !self.is_alone(behind) {
            return self.changes.push((behind.end..behind.end, format!(" {text}{comma}")));
        }
        let blanks = self.indentation(behind.start);
        let at = self.line_end(behind.end);
        self.changes.push((at..at, format!("\n{blanks}{}{comma}", laid_out_item(text, blanks.len()))));
    }

    /// Range of an item that is taken out: with its lines and the comments right above where it has lines of its own.
    fn block(&self, item: &Item) -> Range<usize> {
        let text = self.tree.text;
        if !self.is_alone(item) {
            let blanks = text[item.end..].len() - text[item.end..].trim_start_matches([' ', '\t']).len();
            return item.start..item.end + blanks;
        }
        let mut start = self.line_of(item.start).0;
        while start > 0 {
            let above = text[..start - 1].rfind('\n').map_or(0, |at| at + 1);
            if !text[above..start].trim_start().starts_with("//") {
                break;
            }
            start = above;
        }
        start..(self.line_end(item.end) + 1).min(text.len())
    }

    /// Returns `true` if an item begins and ends lines of its own.
    fn is_alone(&self, item: &Item) -> bool {
        let (line, indent) = self.line_of(item.start);
        line + indent == item.start && self.tree.text[self.line_end(item.end)..].starts_with('\n')
    }

    /// Start of the line of a place, and the number of blanks there.
    fn line_of(&self, at: usize) -> (usize, usize) {
        let line = self.tree.text[..at].rfind('\n').map_or(0, |at| at + 1);
        let text = &self.tree.text[line..];
        (line, text.len() - text.trim_start_matches([' ', '\t']).len())
    }

    /// Blanks at the start of the line of a place.
    fn indentation(&self, at: usize) -> &'a str {
        let (line, indent) = self.line_of(at);
        &self.tree.text[line..line + indent]
    }

    /// End of the blanks and the comment behind a place on its line.
    fn line_end(&self, at: usize) -> usize {
        let line = self.tree.text[at..].split('\n').next().unwrap_or_default();
        let behind = line.trim();
        let is_comment = behind.starts_with("//") || behind.starts_with("/*") && behind.ends_with("*/");
        if behind.is_empty() || is_comment { at + line.len() } else { at }
    }
}

/// An item in the layout of a line of its own.
fn laid_out_item(text: &str, indent: usize) -> String {
    let name = text.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(text.len());
    match text[name..].strip_prefix(": ") {
        Some(value) => {
            let key = &text[..name];
            format!("{key}: {}", value_laid_out(value, indent, indent + key.chars().count() + 2))
        }
        None => value_laid_out(text, indent, indent),
    }
}
