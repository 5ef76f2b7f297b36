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
    nodes: Vec<Node<'a>>,
}

/// A value.
pub(in crate::rig) struct Node<'a> {
    /// Identifier before the opening bracket; empty without one.
    pub name: &'a str,
    /// Opening bracket: `(`, `[` or `{`; `None` for a plain value.
    pub bracket: Option<char>,
    /// Bytes from the identifier or bracket, or the first token of a plain value, to the end of the last.
    pub range: Range<usize>,
    /// Place behind the opening bracket.
    pub inside: usize,
    /// Items between the brackets; with no room for more of them, because a text has a bracket for each joint.
    pub items: Box<[Item<'a>]>,
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
    /// deeper than [`DEPTH`], or there are too many of them. A node has a lower number than those inside of it. Time is linear.
    pub fn parse(text: &'a str) -> Option<Self> {
        let mut nodes: Vec<Node> = vec![Node::plain(0..0)];
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
                            nodes.push(Node::plain(start..end));
                            let pending = pending.get_or_insert(PendingItem { key: None, start, value: None });
                            *pending.value.insert(nodes.len() - 1)
                        }
                    };
                    nodes[node].name = if named.is_some() { &text[nodes[node].range.clone()] } else { "" };
                    nodes[node].bracket = token.text.chars().next();
                    nodes[node].inside = end;
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
                    nodes[closed].items = items.into();
                    nodes[closed].range.end = end;
                }
                "," => items.push(pending.take()?.finished(&nodes, Some(end))?),
                ":" if pending.as_ref().is_some_and(|pending| pending.key.is_none()) => {
                    let pending = pending.as_mut()?;
                    let key = pending.value.take()?;
                    pending.key = Some(&text[nodes[key].range.clone()]);
                    // A key is no value: its node makes room for that of the value.
                    if key + 1 == nodes.len() {
                        nodes.pop();
                    }
                }
                _ => {
                    let pending = pending.get_or_insert(PendingItem { key: None, start, value: None });
                    match pending.value {
                        Some(value) => nodes[value].range.end = end,
                        None => {
                            nodes.push(Node::plain(start..end));
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
        nodes[0].items = Box::new([item]);
        nodes.shrink_to_fit();
        Some(Self { text, nodes })
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// The node with that number.
    pub fn node(&self, id: NodeId) -> &Node<'a> {
        &self.nodes[id]
    }

    /// The value of the whole text.
    pub fn root(&self) -> NodeId {
        self.nodes[0].items[0].value
    }

    /// The item of a struct with that name.
    pub fn field(&self, node: NodeId, name: &str) -> Option<&Item<'a>> {
        self.nodes[node].items.iter().find(|item| item.key == Some(name))
    }

    /// The text of a value as written.
    pub fn written(&self, node: NodeId) -> &'a str {
        &self.text[self.nodes[node].range.clone()]
    }

    /// The text of the string literal that is the value of a field; `None` if it is another value.
    pub fn string(&self, node: NodeId, name: &str) -> Option<String> {
        let field = self.field(node, name)?;
        ron::from_str(self.written(self.optional(field.value))).ok()
    }

    /// The value inside `Some(...)`, or the value itself.
    pub fn optional(&self, node: NodeId) -> NodeId {
        match &*self.nodes[node].items {
            [only] if self.nodes[node].name == "Some" && only.key.is_none() => only.value,
            _ => node,
        }
    }

    /// Elements of the list that is the value of a field; empty for another value.
    pub fn elements(&self, node: NodeId, name: &str) -> &[Item<'a>] {
        let list = self.field(node, name).map(|field| &self.nodes[field.value]);
        list.filter(|list| list.bracket == Some('[')).map_or(&[], |list| &list.items)
    }
}

impl Node<'_> {
    fn plain(range: Range<usize>) -> Self {
        Self { name: "", bracket: None, inside: range.start, range, items: Box::default() }
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
    fn finished(self, nodes: &[Node], comma: Option<usize>) -> Option<Item<'a>> {
        let value = self.value?;
        let end = comma.unwrap_or(nodes[value].range.end);
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
