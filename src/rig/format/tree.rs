//! Syntax tree of a RON text: the place of every bracket, item and value, independent of their meaning.
//!
//! Readers turn what people leave out into text that says everything, and writers change single values, without touching
//! comments and blanks around them.

use std::ops::Range;

use super::scan::{Token, tokens};

/// Most brackets around a value: as many as the RON reader takes.
const DEPTH: usize = 128;

/// Most nodes of a tree: this many, and one for so many bytes of its text. A text of nothing but short numbers has more,
/// and would need a hundred times its size.
const FREE_NODES: usize = 300_000;
const BYTES_PER_NODE: usize = 8;

/// Number of a node in its [`Tree`].
pub(in crate::rig) type NodeId = usize;

/// Syntax tree of a text.
pub(in crate::rig) struct Tree<'a> {
    /// The text.
    pub text: &'a str,
    nodes: Vec<PackedNode>,
    /// Items of all brackets, in the order in which these are closed.
    items: Vec<Item<'a>>,
}

/// A value.
pub(in crate::rig) struct Node<'t, 'a> {
    /// Identifier before the opening bracket; empty without one.
    pub name: &'a str,
    /// Opening bracket: `(`, `[` or `{`; `None` for a plain value.
    pub bracket: Option<char>,
    /// Bytes from the identifier or bracket, or the first token of a plain value, to the end of the last.
    pub range: Range<usize>,
    /// Place behind the opening bracket.
    pub inside: usize,
    /// Items between the brackets.
    pub items: &'t [Item<'a>],
}

/// A value in few bytes, because a text has several for each joint.
struct PackedNode {
    /// Bytes from the identifier or bracket, or the first token of a plain value, to the end of the last.
    start: u32,
    end: u32,
    /// Length of the identifier, which the value begins with.
    name: u32,
    bracket: Option<char>,
    inside: u32,
    /// Place and number of the items among those of the tree.
    first_item: u32,
    item_count: u32,
}

/// An item of a list, struct or map.
pub(in crate::rig) struct Item<'a> {
    /// Name of a field, or key of a map; `None` for an element.
    pub key: Option<&'a str>,
    /// Start of the key, or of the value without one.
    pub start: usize,
    /// The value.
    pub value: NodeId,
    /// End of the value, or behind the comma after it.
    pub end: usize,
    /// True where a comma follows.
    pub has_comma: bool,
}

impl<'a> Tree<'a> {
    /// Tree of a text with one value; `None` if its brackets do not match, an item has no value, brackets are nested
    /// deeper than [`DEPTH`], there are too many of them, or the text has 4 GiB. A node has a lower number than those
    /// inside of it. Time is linear.
    pub fn parse(text: &'a str) -> Option<Self> {
        u32::try_from(text.len()).ok()?;
        let most = most_items(text);
        let (mut nodes, mut all_items) = (Vec::with_capacity(most + 2), Vec::with_capacity(most));
        nodes.push(PackedNode::plain(0, 0));
        let mut open: Vec<OpenBracket> = vec![OpenBracket::of(0)];
        for token in tokens(text).skip(attribute(text)) {
            if open.len() > DEPTH || nodes.len() > FREE_NODES + text.len() / BYTES_PER_NODE {
                return None;
            }
            let start = start_of(text, &token);
            let end = token.start + token.text.len();
            let OpenBracket { items, pending, .. } = open.last_mut()?;
            match token.text {
                "(" | "[" | "{" => {
                    // An identifier before the bracket belongs to it.
                    let named = pending.as_ref().and_then(|pending| pending.value);
                    let node = match named {
                        Some(node) if nodes[node].bracket.is_none() => node,
                        Some(_) => return None,
                        None => {
                            nodes.push(PackedNode::plain(start, end));
                            let pending = pending.get_or_insert(PendingItem { key: None, start, value: None });
                            *pending.value.insert(nodes.len() - 1)
                        }
                    };
                    let opened = &mut nodes[node];
                    opened.name = if named.is_some() { opened.end - opened.start } else { 0 };
                    opened.bracket = token.text.chars().next();
                    opened.inside = end as u32;
                    open.push(OpenBracket::of(node));
                }
                ")" | "]" | "}" => {
                    let OpenBracket { node: closed, mut items, pending: last } = open.pop()?;
                    let fits = matches!((nodes[closed].bracket?, token.text), ('(', ")") | ('[', "]") | ('{', "}"));
                    if !fits {
                        return None;
                    }
                    if let Some(last) = last {
                        items.push(last.finished(&nodes, None)?);
                    }
                    nodes[closed].put_items(items, &mut all_items);
                    nodes[closed].end = end as u32;
                }
                "," => items.push(pending.take()?.finished(&nodes, Some(end))?),
                ":" if pending.as_ref().is_some_and(|pending| pending.key.is_none()) => {
                    let pending = pending.as_mut()?;
                    let key = pending.value.take()?;
                    pending.key = Some(&text[nodes[key].range()]);
                    // A key is no value: its node makes room for that of the value.
                    if key + 1 == nodes.len() {
                        nodes.pop();
                    }
                }
                _ => {
                    let pending = pending.get_or_insert(PendingItem { key: None, start, value: None });
                    match pending.value {
                        Some(value) => nodes[value].end = end as u32,
                        None => {
                            nodes.push(PackedNode::plain(start, end));
                            pending.value = Some(nodes.len() - 1);
                        }
                    }
                }
            }
        }
        let OpenBracket { items, pending, .. } = open.pop()?;
        let item = pending?.finished(&nodes, None)?;
        if !open.is_empty() || !items.is_empty() {
            return None;
        }
        nodes[0].put_items(vec![item], &mut all_items);
        nodes.shrink_to_fit();
        all_items.shrink_to_fit();
        Some(Self { text, nodes, items: all_items })
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// The node with that number.
    pub fn node(&self, id: NodeId) -> Node<'_, 'a> {
        let node = &self.nodes[id];
        let range = node.range();
        let name = &self.text[range.start..range.start + node.name as usize];
        Node { name, bracket: node.bracket, range, inside: node.inside as usize, items: self.items_of(id) }
    }

    fn items_of(&self, id: NodeId) -> &[Item<'a>] {
        let first = self.nodes[id].first_item as usize;
        &self.items[first..first + self.nodes[id].item_count as usize]
    }

    /// The value of the whole text.
    pub fn root(&self) -> NodeId {
        self.items_of(0)[0].value
    }

    /// The item of a struct with that name.
    pub fn field(&self, node: NodeId, name: &str) -> Option<&Item<'a>> {
        self.items_of(node).iter().find(|item| item.key == Some(name))
    }

    /// The text of a value as written.
    pub fn written(&self, node: NodeId) -> &'a str {
        &self.text[self.nodes[node].range()]
    }

    /// The text of the string literal that is the value of a field; `None` if it is another value.
    pub fn string(&self, node: NodeId, name: &str) -> Option<String> {
        let field = self.field(node, name)?;
        ron::from_str(self.written(self.optional(field.value))).ok()
    }

    /// The value inside `Some(...)`, or the value itself.
    pub fn optional(&self, node: NodeId) -> NodeId {
        match self.items_of(node) {
            [only] if self.node(node).name == "Some" && only.key.is_none() => only.value,
            _ => node,
        }
    }

    /// Elements of the list that is the value of a field; empty for another value.
    pub fn elements(&self, node: NodeId, name: &str) -> &[Item<'a>] {
        let list = self.field(node, name).map(|field| self.node(field.value));
        list.filter(|list| list.bracket == Some('[')).map_or(&[], |list| list.items)
    }
}

impl PackedNode {
    fn plain(start: usize, end: usize) -> Self {
        let (start, end) = (start as u32, end as u32);
        Self { start, end, name: 0, bracket: None, inside: start, first_item: 0, item_count: 0 }
    }

    fn range(&self) -> Range<usize> {
        self.start as usize..self.end as usize
    }

    /// Puts the items of the node behind those of others.
    fn put_items<'a>(&mut self, items: Vec<Item<'a>>, all: &mut Vec<Item<'a>>) {
        (self.first_item, self.item_count) = (all.len() as u32, items.len() as u32);
        all.extend(items);
    }
}

/// A bracket that is open while a text is read.
struct OpenBracket<'a> {
    node: NodeId,
    items: Vec<Item<'a>>,
    /// The item under construction.
    pending: Option<PendingItem<'a>>,
}

impl OpenBracket<'_> {
    fn of(node: NodeId) -> Self {
        Self { node, items: Vec::new(), pending: None }
    }
}

struct PendingItem<'a> {
    key: Option<&'a str>,
    start: usize,
    value: Option<NodeId>,
}

impl<'a> PendingItem<'a> {
    fn finished(self, nodes: &[PackedNode], comma: Option<usize>) -> Option<Item<'a>> {
        let value = self.value?;
        let end = comma.unwrap_or(nodes[value].end as usize);
        Some(Item { key: self.key, start: self.start, value, end, has_comma: comma.is_some() })
    }
}

/// The text of a RON struct with another value of one of its fields. The rest stays as it is written; a field that is left
/// out comes first. A text that is no RON stays.
pub(crate) fn with_field(text: &str, name: &str, value: &str) -> String {
    let text = if text.trim().is_empty() { "()" } else { text };
    let Some(tree) = Tree::parse(text) else { return text.to_owned() };
    let root = tree.node(tree.root());
    let (place, written) = match (tree.field(tree.root(), name), root.bracket) {
        (Some(field), _) => (tree.node(field.value).range.clone(), value.to_owned()),
        (None, Some(_)) => {
            let comma = if root.items.is_empty() { "" } else { ", " };
            (root.inside..root.inside, format!("{name}: {value}{comma}"))
        }
        (None, None) => (root.range.clone(), format!("({name}: {value})")),
    };
    [&text[..place.start], &written, &text[place.end..]].concat()
}

/// Places of the items of a RON list in its text; none for a text that is no list.
pub(crate) fn list_items(text: &str) -> Vec<Range<usize>> {
    let Some(tree) = Tree::parse(text) else { return Vec::new() };
    let root = tree.node(tree.root());
    if root.bracket != Some('[') {
        return Vec::new();
    }
    root.items.iter().map(|item| tree.node(item.value).range.clone()).collect()
}

/// Most items of a text, each of which ends with a comma, a bracket or the text. Lists with room for as many need not grow, which
/// takes as much memory again.
fn most_items(text: &str) -> usize {
    let ends = text.bytes().filter(|byte| matches!(byte, b',' | b')' | b']' | b'}')).count();
    ends.min(FREE_NODES + text.len() / BYTES_PER_NODE) + 1
}

/// Number of the tokens of an attribute of the file, such as `#![enable(implicit_some)]`.
fn attribute(text: &str) -> usize {
    let is_there = tokens(text).map(|token| token.text).take(3).eq(["#", "!", "["]);
    if is_there { tokens(text).take_while(|token| token.text != "]").count() + 1 } else { 0 }
}

/// Start of a token, with the letters before a raw string.
fn start_of(text: &str, token: &Token) -> usize {
    let before = &text.as_bytes()[..token.start];
    let raw = token.text.starts_with(['"', '#']) && token.text.len() > 1 && before.last() == Some(&b'r');
    let bytes = raw && before.iter().rev().nth(1) == Some(&b'b');
    token.start - usize::from(raw) - usize::from(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_have_their_places() {
        let text = "(a: -1.5, // one\n b: [x(y: Some(\"q\")), r#\"(\"#], c: {\"k\": 2},)";
        let tree = Tree::parse(text).unwrap();
        let root = tree.node(tree.root());
        let keys: Vec<_> = root.items.iter().filter_map(|item| item.key).collect();
        assert_eq!(keys, ["a", "b", "c"]);
        assert_eq!(tree.written(root.items[0].value), "-1.5");
        let elements = tree.elements(tree.root(), "b");
        assert_eq!(elements.len(), 2);
        assert_eq!(tree.node(elements[0].value).name, "x");
        assert_eq!(tree.string(elements[0].value, "y").as_deref(), Some("q"));
        assert_eq!(tree.written(elements[1].value), "r#\"(\"#");
        assert_eq!(&text[root.items[2].start..root.items[2].end], "c: {\"k\": 2},");
    }

    #[test]
    fn fields_are_set_in_place_or_come_first() {
        assert_eq!(with_field("(a: 1, /* two */ b: [2] )", "b", "[3]"), "(a: 1, /* two */ b: [3] )");
        assert_eq!(with_field("(a: (b: 1))", "b", "2"), "(b: 2, a: (b: 1))");
        assert_eq!(with_field("", "b", "2"), "(b: 2)");
        assert_eq!(with_field("Named()", "b", "2"), "Named(b: 2)");
        assert_eq!(with_field("(a: [1)", "b", "2"), "(a: [1)");
    }

    #[test]
    fn nodes_are_small() {
        assert!(size_of::<PackedNode>() <= 28);
        let tree = Tree::parse("(a: [1, b(c: 2)], d: e (3))").unwrap();
        assert_eq!((tree.len(), tree.items.len()), (8, 7));
        let named: Vec<&str> = (1..tree.len()).map(|id| tree.node(id).name).filter(|name| !name.is_empty()).collect();
        assert_eq!(named, ["b", "e"]);
    }

    #[test]
    fn unbalanced_texts_have_no_tree() {
        for text in ["", "(", "(a: )", "(a: 1))", "[1, , 2]", "(a: [1)]", "1, 2"] {
            assert!(Tree::parse(text).is_none(), "{text}");
        }
    }

    #[test]
    fn items_of_lists_are_whole_values() {
        let text = "[ (a: \"x, ]\"), b(1), -2.5, [3, 4], ]";
        let items: Vec<&str> = list_items(text).into_iter().map(|place| &text[place]).collect();
        assert_eq!(items, ["(a: \"x, ]\")", "b(1)", "-2.5", "[3, 4]"]);
        for other in ["", "(1, 2)", "[", "[1"] {
            assert!(list_items(other).is_empty(), "{other}");
        }
    }
}
