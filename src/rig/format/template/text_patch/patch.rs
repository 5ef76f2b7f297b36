//! Changes of single fields and list elements of a text.

use std::{
    cmp::Reverse,
    collections::{BTreeMap, BTreeSet, HashMap, HashSet},
    ops::Range,
};

use crate::rig::{
    Uid,
    format::{
        layout::{INDENT, value_laid_out, value_on_one_line},
        template::{file::TEMPLATE_FIELDS, shorthand::Declaration},
        tree::{Item, NodeId, Tree},
    },
};

/// Fields of a template's header, in the order in which they are written. What lists headers reads the beginning of a file alone.
const HEADER: &[&str] = TEMPLATE_FIELDS.split_at(11).0;

/// Changes of a text, collected in any order.
pub(in crate::rig::format::template) struct Patch<'d, 'a> {
    tree: &'d Tree<'a>,
    /// Starts of the lines of the text but the first.
    lines: Vec<usize>,
    changes: Vec<(Range<usize>, String)>,
    /// Items that come and go, by the bracket that they are in.
    items: BTreeMap<NodeId, ItemChanges>,
}

/// Changes of the items of a bracket.
#[derive(Default)]
struct ItemChanges {
    /// Numbers of the items that go.
    removed: BTreeSet<usize>,
    /// The items that come.
    added: Vec<AddedItem>,
}

/// An item that comes into a bracket.
struct AddedItem {
    /// Number of the item behind which it comes; `None` before the first.
    behind: Option<usize>,
    text: String,
    /// True for a text that stands as it is where it has a line of its own; others get their layout.
    is_line: bool,
}

impl<'d, 'a> Patch<'d, 'a> {
    pub fn new(tree: &'d Tree<'a>) -> Self {
        let lines = tree.text.match_indices('\n').map(|(at, _)| at + 1).collect();
        Self { tree, lines, changes: Vec::new(), items: BTreeMap::new() }
    }

    /// The text with all changes.
    pub fn text(mut self) -> String {
        for (node, items) in std::mem::take(&mut self.items) {
            self.change_items(node, &items);
        }
        // What comes at a place stands before what is changed there, and what goes is cut out whole.
        self.changes.sort_by_key(|(range, _)| (range.start, !range.is_empty(), Reverse(range.end)));
        let source = self.tree.text;
        let added: usize = self.changes.iter().map(|(_, text)| text.len()).sum();
        let mut out = String::with_capacity(source.len() + added);
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

    /// Writes another value in place of one: in its layout where that has lines of its own, else on the line.
    pub fn replace(&mut self, node: NodeId, value: &str) {
        let range = self.tree.node(node).range.clone();
        let (line, indent) = self.line_of(range.start);
        let start = &self.tree.text[line..range.start];
        let key = start.trim().trim_end_matches(':').trim_end();
        let is_key = key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        let comma = self.tree.text[range.end..].starts_with(',');
        let is_last = self.tree.text[self.line_end(range.end + usize::from(comma))..].starts_with('\n');
        let text = match is_key && is_last || self.tree.text[range.clone()].contains('\n') {
            true => value_laid_out(value, indent, start.chars().count()),
            false => value_on_one_line(value),
        };
        self.changes.push((range, text));
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
            (None, Some(_)) => {
                let place = self.tree.node(node).items.iter().position(|item| item.key == Some(field));
                self.remove(node, place);
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
        let written = self.tree.field(node, field).map(|item| self.tree.node(item.value).items);
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

    /// Takes elements out of the list of a field, and adds others behind the last element, each on a line of its own. A list
    /// that becomes empty goes with its field.
    pub fn exchange(&mut self, node: NodeId, field: &str, gone: &[usize], fresh: &[String]) {
        let Some(list) = self.tree.field(node, field).map(|item| item.value) else {
            if !fresh.is_empty() {
                self.add_list(node, field, fresh);
            }
            return;
        };
        let count = self.tree.node(list).items.len();
        if fresh.is_empty() && !gone.is_empty() && gone.len() == count {
            return self.set_or_remove(node, field, None);
        }
        self.remove(list, gone.iter().copied());
        for text in fresh {
            let added = AddedItem { behind: count.checked_sub(1), text: text.clone(), is_line: true };
            self.items.entry(list).or_default().added.push(added);
        }
    }

    /// [`exchange`](Self::exchange) of elements that go and that come; a list that is not there yet comes before the first field
    /// of those names.
    pub fn exchange_before(
        &mut self,
        node: NodeId,
        field: &str,
        (gone, fresh): (&[usize], &[String]),
        before: &[&str],
    ) {
        let items = self.tree.node(node).items;
        let place = items.iter().position(|item| item.key.is_some_and(|key| before.contains(&key)));
        match place.filter(|_| !fresh.is_empty() && self.tree.field(node, field).is_none()) {
            Some(place) => self.insert(node, place.checked_sub(1), &format!("{field}: [{}]", fresh.join(", "))),
            None => self.exchange(node, field, gone, fresh),
        }
    }

    /// Puts elements behind the last one of the list that is the value of a field, each in its layout.
    pub fn append(&mut self, node: NodeId, field: &str, elements: &[String]) {
        match self.tree.field(node, field).map(|item| item.value) {
            Some(list) => {
                let last = self.tree.node(list).items.len().checked_sub(1);
                elements.iter().for_each(|element| self.insert(list, last, element));
            }
            None => self.add(node, field, &format!("[{}]", elements.join(", "))),
        }
    }

    /// Adds a field with a list to a struct: on one line, or with a line for each of several where the fields have lines.
    fn add_list(&mut self, node: NodeId, field: &str, elements: &[String]) {
        let items = self.tree.node(node).items;
        let text = match items.last().filter(|last| elements.len() > 1 && self.is_alone(last)) {
            Some(last) => {
                let blanks = self.indentation(last.start);
                let lines: String =
                    elements.iter().map(|element| format!("{blanks}{:INDENT$}{element},\n", "")).collect();
                format!("{field}: [\n{lines}{blanks}]")
            }
            None => format!("{field}: [{}]", elements.join(", ")),
        };
        let added = AddedItem { behind: items.len().checked_sub(1), text, is_line: true };
        self.items.entry(node).or_default().added.push(added);
    }

    /// Takes items out of a bracket.
    fn remove(&mut self, node: NodeId, places: impl IntoIterator<Item = usize>) {
        self.items.entry(node).or_default().removed.extend(places);
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
        let list = self.tree.field(node, field).map(|field| field.value);
        for (place, (_, declared)) in elements.iter().zip(there).enumerate() {
            if set.contains(&declared.uid) {
                places.insert(declared.uid, place);
            } else {
                list.into_iter().for_each(|list| self.remove(list, [place]));
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

    /// Adds a field to a struct: one of a header in its place there, others before the tags, which may be long, else at the end.
    fn add(&mut self, node: NodeId, field: &str, value: &str) {
        let items = self.tree.node(node).items;
        let in_header = (node == self.tree.root()).then(|| HEADER.iter().position(|known| *known == field)).flatten();
        let behind = match in_header {
            Some(number) => {
                HEADER[..number].iter().rev().find_map(|before| items.iter().position(|item| item.key == Some(*before)))
            }
            None if field == "tags" => items.len().checked_sub(1),
            None => items.iter().rposition(|item| item.key != Some("tags")),
        };
        self.insert(node, behind, &format!("{field}: {value}"));
    }

    /// Inserts an item behind another one, or before the first.
    pub fn insert(&mut self, node: NodeId, behind: Option<usize>, text: &str) {
        self.items.entry(node).or_default().added.push(AddedItem { behind, text: text.to_owned(), is_line: false });
    }

    /// Writes which items of a bracket go, and which come behind those that stay.
    fn change_items(&mut self, node: NodeId, changes: &ItemChanges) {
        let tree = self.tree;
        let (items, inside) = (tree.node(node).items, tree.node(node).inside);
        if tree.node(node).bracket.is_none() {
            let texts: Vec<String> = changes.added.iter().map(|added| item_on_one_line(&added.text)).collect();
            let end = tree.node(node).range.end;
            return self.changes.push((end..end, format!("({})", texts.join(", "))));
        }
        let stays = |place: &usize| !changes.removed.contains(place);
        let last = (0..items.len()).rev().find(stays);
        let end_of = |item: &Item| tree.node(item.value).range.end;
        let ends_with_comma = items.last().is_some_and(|item| item.has_comma);
        // The end of a line takes the comma before it along; elsewhere everything that goes has its own.
        let cut_from = last.and_then(|last| Some((&items[last], items.get(last + 1)?)));
        let is_joined = |(item, next): &(&Item, &Item)| {
            !self.is_alone(next) && tree.text[item.end..next.start].trim_matches(' ').is_empty()
        };
        let cut_from = cut_from.filter(is_joined).map(|(item, _)| item);
        for place in &changes.removed {
            let mut range = self.block(&items[*place]);
            if let Some(item) = cut_from.filter(|_| last.is_some_and(|last| *place == last + 1)) {
                range.start = if ends_with_comma { item.end } else { end_of(item) };
            }
            self.changes.push((range, String::new()));
        }
        let mut added: BTreeMap<Option<usize>, Vec<&AddedItem>> = BTreeMap::new();
        for item in &changes.added {
            let behind = item.behind.and_then(|behind| (0..=behind).rev().find(stays));
            added.entry(behind).or_default().push(item);
        }
        let on_line = |item: &AddedItem, blanks: &str| match item.is_line {
            true => format!("\n{blanks}{}", item.text),
            false => format!("\n{blanks}{}", laid_out_item(&item.text, blanks.len())),
        };
        for (behind, added) in added {
            let texts = || added.iter().map(|item| item_on_one_line(&item.text));
            let Some(item) = behind.map(|behind| &items[behind]) else {
                let text = match items.first() {
                    Some(first) if self.is_alone(first) => {
                        let blanks = self.indentation(first.start);
                        added.iter().map(|item| format!("{},", on_line(item, blanks))).collect()
                    }
                    _ if last.is_some() => texts().map(|text| format!("{text}, ")).collect(),
                    _ => texts().collect::<Vec<_>>().join(", "),
                };
                self.changes.push((inside..inside, text));
                continue;
            };
            let value_end = end_of(item);
            if self.is_alone(item) {
                let blanks = self.indentation(item.start);
                let lines: Vec<String> = added.iter().map(|item| on_line(item, blanks)).collect();
                let comma = if item.has_comma { "," } else { "" };
                if !item.has_comma {
                    self.changes.push((value_end..value_end, ",".to_owned()));
                }
                let at = self.line_end(item.end);
                self.changes.push((at..at, format!("{}{comma}", lines.join(","))));
            } else if behind != last || ends_with_comma {
                let text: String = texts().map(|text| format!(" {text},")).collect();
                self.changes.push((item.end..item.end, text));
            } else {
                let text: String = texts().map(|text| format!(", {text}")).collect();
                // Where something behind the item goes without leaving its line, the comma stays and does for the first.
                match item.has_comma && cut_from.is_none() {
                    true => self.changes.push((item.end..item.end, format!("{},", &text[1..]))),
                    false => self.changes.push((value_end..value_end, text)),
                }
            }
        }
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
        let before = self.lines.partition_point(|line| *line <= at);
        let line = before.checked_sub(1).map_or(0, |last| self.lines[last]);
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
        let rest = &self.tree.text[at..];
        // A text on one line would be read once for each of its values.
        if !is_end_or_comment(rest) {
            return at;
        }
        let line = rest.split('\n').next().unwrap_or_default();
        let behind = line.trim();
        let is_comment = behind.starts_with("//") || behind.starts_with("/*") && behind.ends_with("*/");
        if behind.is_empty() || is_comment { at + line.len() } else { at }
    }
}

/// Returns `true` where a line ends behind blanks, and where a comment begins behind them.
pub(super) fn is_end_or_comment(text: &str) -> bool {
    let rest = text.trim_start_matches(|c: char| c.is_whitespace() && c != '\n');
    rest.is_empty() || ["\n", "//", "/*"].iter().any(|start| rest.starts_with(start))
}

/// An item in the layout of a line of its own.
fn laid_out_item(text: &str, indent: usize) -> String {
    let (key, value) = key_and_value(text);
    format!("{key}{}", value_laid_out(value, indent, indent + key.chars().count()))
}

/// An item on one line, as far as no comment is in it.
fn item_on_one_line(text: &str) -> String {
    if !text.contains('\n') {
        return text.to_owned();
    }
    let (key, value) = key_and_value(text);
    format!("{key}{}", value_on_one_line(value))
}

/// Name of a field with the colon and the blank behind it, and the value; an empty name for an element.
fn key_and_value(text: &str) -> (&str, &str) {
    let name = text.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(text.len());
    let start = if text[name..].starts_with(": ") { name + 2 } else { 0 };
    text.split_at(start)
}
