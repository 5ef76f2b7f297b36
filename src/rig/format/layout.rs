//! Layout of RON texts for people: what fits in 100 columns stands on one line, else every item has its own; comments,
//! blank lines and the order stay.

use super::{
    scan::tokens,
    source::SourceError,
    tree::{Item, NodeId, Tree},
};

/// Most columns of a line with several items.
const COLUMNS: usize = 100;

/// Blanks before the items of a bracket.
pub(in crate::rig) const INDENT: usize = 4;

/// The text in its layout. Text in its layout already stays as it is, to the byte.
///
/// # Errors
/// The place of brackets that do not match, of nesting deeper than the RON reader takes, and of a comment between a name and
/// its value, which has no place in the layout.
pub(in crate::rig) fn laid_out(text: &str) -> Result<String, SourceError> {
    let Some(tree) = Tree::parse(text) else {
        return Err(SourceError::at(text, 0, "brackets or commas do not match; `check` tells where"));
    };
    let root = tree.root();
    let range = tree.node(root).range.clone();
    let mut layout = Layout { is_file: true, ..Layout::new(&tree) };
    layout.gap(&text[..range.start], 0, false);
    layout.value(root, 0, 0);
    layout.gap(&text[range.end..], 0, true);
    if !layout.out.ends_with('\n') {
        layout.out.push('\n');
    }
    let out = layout.out;
    let mut kept = comments(&out).into_iter();
    let lost = comments(text).into_iter().find(|(_, comment)| kept.next().is_none_or(|(_, kept)| kept != *comment));
    match lost {
        Some((at, _)) => Err(SourceError::at(text, at, "a comment cannot stand here; put it on a line of its own")),
        None => Ok(out),
    }
}

/// One value in its layout, at that indentation, where `before` columns of its first line are taken.
pub(in crate::rig) fn value_laid_out(text: &str, indent: usize, before: usize) -> String {
    let Some(tree) = Tree::parse(text) else { return text.to_owned() };
    let mut layout = Layout::new(&tree);
    layout.value(tree.root(), indent, before);
    layout.out
}

/// One value on one line, as far as no comment or blank line is in it.
pub(in crate::rig) fn value_on_one_line(text: &str) -> String {
    let Some(tree) = Tree::parse(text) else { return text.to_owned() };
    let mut layout = Layout { columns: usize::MAX, ..Layout::new(&tree) };
    layout.value(tree.root(), 0, 0);
    layout.out
}

struct Layout<'t, 'a> {
    tree: &'t Tree<'a>,
    /// Columns of every node on one line.
    widths: Vec<usize>,
    /// Places of comments and blank lines.
    breaks: Vec<usize>,
    /// True for a whole file, which never stands on one line.
    is_file: bool,
    /// Most columns of a line with several items.
    columns: usize,
    out: String,
}

impl<'t, 'a> Layout<'t, 'a> {
    fn new(tree: &'t Tree<'a>) -> Self {
        let mut widths = vec![0; tree.len()];
        for id in (0..tree.len()).rev() {
            let node = tree.node(id);
            widths[id] = match node.bracket {
                None => tree.text[node.range.clone()].chars().count(),
                Some(_) => {
                    let key = |item: &Item| item.key.map_or(0, |key| key.chars().count() + 2);
                    let items: usize = node.items.iter().map(|item| key(item) + widths[item.value] + 2).sum();
                    node.name.chars().count() + 2 + items.saturating_sub(2)
                }
            };
        }
        Self {
            tree,
            widths,
            breaks: breaks(tree.text),
            is_file: false,
            columns: COLUMNS,
            out: String::with_capacity(tree.text.len()),
        }
    }

    /// Writes a value; its first line has `before` columns already.
    fn value(&mut self, id: NodeId, indent: usize, before: usize) {
        let tree = self.tree;
        let node = tree.node(id);
        if self.is_flat(id, before) {
            return self.flat(id);
        }
        let close = node.range.end - 1;
        self.out
            .push_str(&tree.text[node.range.start..node.inside.min(node.range.end)].replace(char::is_whitespace, ""));
        let inner = indent + INDENT;
        let (mut at, mut late) = (node.inside, "");
        for (number, item) in node.items.iter().enumerate() {
            self.gap_behind(late, &tree.text[at..item.start], inner, number > 0);
            let value = tree.node(item.value);
            if let Some(key) = item.key {
                self.out.push_str(key);
                self.out.push_str(": ");
            }
            let column = inner + item.key.map_or(0, |key| key.chars().count() + 2);
            self.value(item.value, inner, column);
            self.out.push(',');
            let end = if item.has_comma { item.end - 1 } else { item.end };
            late = &tree.text[value.range.end..end];
            at = item.end;
        }
        self.gap_behind(late, &tree.text[at..close], inner, !node.items.is_empty());
        let blanks = self.out.trim_end_matches(' ').len();
        self.out.truncate(blanks);
        while self.out.ends_with("\n\n") {
            self.out.pop();
        }
        self.out.push_str(&" ".repeat(indent));
        self.out.push_str(&tree.text[close..node.range.end]);
    }

    /// Returns `true` if a value stands on one line: it fits, and no comment or blank line is in it. The lists of a file, and
    /// the file itself, never do.
    fn is_flat(&self, id: NodeId, before: usize) -> bool {
        let node = self.tree.node(id);
        let is_list_of_file = || {
            let file = self.tree.node(self.tree.root());
            node.bracket == Some('[') && file.items.iter().any(|item| item.value == id)
        };
        if node.bracket.is_none() || node.items.is_empty() && !self.has_break(node.inside, node.range.end) {
            return true;
        }
        let is_outer = self.is_file && (id == self.tree.root() || is_list_of_file());
        !is_outer && !self.has_break(node.inside, node.range.end) && before + self.widths[id] < self.columns
    }

    fn has_break(&self, start: usize, end: usize) -> bool {
        let first = self.breaks.partition_point(|at| *at < start);
        self.breaks.get(first).is_some_and(|at| *at < end)
    }

    /// Writes a value on one line.
    fn flat(&mut self, id: NodeId) {
        let tree = self.tree;
        let node = tree.node(id);
        let Some(open) = node.bracket else {
            return self.out.push_str(&tree.text[node.range.clone()]);
        };
        self.out.push_str(node.name);
        self.out.push(open);
        for (number, item) in node.items.iter().enumerate() {
            self.out.push_str(if number > 0 { ", " } else { "" });
            if let Some(key) = item.key {
                self.out.push_str(key);
                self.out.push_str(": ");
            }
            self.flat(item.value);
        }
        self.out.push_str(&tree.text[node.range.end - 1..node.range.end]);
    }

    /// Writes what stands between two items, see [`gap`](Self::gap): comments of `late`, before the comma, go behind it.
    fn gap_behind(&mut self, late: &str, after: &str, indent: usize, follows: bool) {
        let comments = late.trim();
        if comments.is_empty() {
            return self.gap(after, indent, follows);
        }
        let rest = after.trim_start_matches([' ', '\t']);
        let ends_line = late.trim_end_matches([' ', '\t']).ends_with('\n');
        let between = match ends_line {
            _ if rest.is_empty() || rest.starts_with(['\r', '\n']) => "",
            true => "\n",
            false => " ",
        };
        self.gap(&format!("{comments}{between}{rest}"), indent, follows);
    }

    /// Writes the comments and blank lines between two items, and begins the next line. A comment on the line of the item
    /// before stays there.
    fn gap(&mut self, gap: &str, indent: usize, follows: bool) {
        let is_file_start = self.out.is_empty();
        let mut rest = gap;
        let (line, below) = rest.split_once('\n').unwrap_or((rest, ""));
        let line_comment = line.trim();
        if follows && !line_comment.is_empty() && open_comments(line_comment, 0) == 0 {
            self.out.push(' ');
            self.out.push_str(line_comment);
            rest = if rest.contains('\n') { below } else { "" };
        } else if line_comment.is_empty() && rest.contains('\n') {
            rest = below;
        }
        if !is_file_start {
            self.out.push('\n');
        }
        let mut blank = false;
        let mut inside = 0_usize;
        let mut lines = rest.split('\n').peekable();
        while let Some(line) = lines.next() {
            let text = line.trim();
            if text.is_empty() && inside == 0 {
                // The last piece is the indentation of what comes next.
                blank |= lines.peek().is_some();
                continue;
            }
            if std::mem::take(&mut blank) && follows_line(&self.out) {
                self.out.push('\n');
            }
            // Lines of a comment over several lines keep their indentation.
            if inside == 0 {
                self.out.push_str(&" ".repeat(indent));
                self.out.push_str(text);
            } else {
                self.out.push_str(line.trim_end());
            }
            self.out.push('\n');
            inside = open_comments(line, inside);
        }
        if blank && follows_line(&self.out) {
            self.out.push('\n');
        }
        self.out.push_str(&" ".repeat(indent));
    }
}

/// Returns `true` if the text ends with a whole line that is neither blank nor an opening bracket.
fn follows_line(out: &str) -> bool {
    let before = out.strip_suffix('\n').unwrap_or(out);
    out.ends_with('\n') && !before.ends_with(['\n', '(', '[', '{']) && !before.is_empty()
}

/// Number of comments over several lines that are open behind a line of comments, with `open` before it.
fn open_comments(line: &str, mut open: usize) -> usize {
    let mut rest = line;
    while let Some(at) = rest.find(['/', '*']) {
        rest = &rest[at..];
        let mark = rest.get(..2).unwrap_or_default();
        match mark {
            "//" if open == 0 => return 0,
            "/*" => open += 1,
            "*/" => open = open.saturating_sub(1),
            _ => {
                rest = &rest[1..];
                continue;
            }
        }
        rest = &rest[2..];
    }
    open
}

/// Places of comments and blank lines between tokens.
fn breaks(text: &str) -> Vec<usize> {
    let is_break = |(at, gap): &(usize, &str)| {
        // Blank lines right inside of brackets go.
        let is_inside = text[..*at].ends_with(['(', '[', '{']) || text[at + gap.len()..].starts_with([')', ']', '}']);
        gap.contains('/') || !is_inside && gap.matches('\n').count() > 1
    };
    gaps(text).filter(is_break).map(|(at, _)| at).collect()
}

/// Comments of a text with their places, without blanks around their lines.
fn comments(text: &str) -> Vec<(usize, String)> {
    let all = gaps(text).filter(|(_, gap)| gap.contains('/'));
    all.flat_map(|(at, gap)| gap.lines().flat_map(pieces).map(move |piece| (at, piece.to_owned()))).collect()
}

/// Comments of a line, or pieces of one over several lines.
fn pieces(line: &str) -> Vec<&str> {
    let (mut rest, mut found) = (line.trim(), Vec::new());
    while !rest.is_empty() {
        let end = if rest.starts_with("//") { None } else { rest.find("*/").map(|at| at + 2) };
        let (piece, behind) = rest.split_at(end.unwrap_or(rest.len()));
        found.push(piece.trim());
        rest = behind.trim();
    }
    found
}

/// Text between tokens, without commas, with its place.
fn gaps(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let (mut tokens, mut next) = (tokens(text), Some(0_usize));
    std::iter::from_fn(move || {
        let at = next.take()?;
        let Some(token) = tokens.next() else { return Some((at, &text[at..])) };
        let before = text.as_bytes()[..token.start].last() == Some(&b'r') && token.text.starts_with(['"', '#']);
        let start = (token.start - usize::from(before)).max(at);
        next = Some(token.start + token.text.len());
        Some((at, &text[at..start]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_values_stand_on_one_line_and_comments_stay() {
        let text = "// head\n(a:1,b : [ (x:1,\ny:2) , z(), ], // of b\n\n\n  // on c\n  c: (k: [1,2], // in k\n l: {\"m\":3}), d: \"// no\",\n  // end\n)\n// tail";
        let wanted = "// head\n(\n    a: 1,\n    b: [\n        (x: 1, y: 2),\n        z(),\n    ], // of b\n\n    // on c\n    c: (\n        k: [1, 2], // in k\n        l: {\"m\": 3},\n    ),\n    d: \"// no\",\n    // end\n)\n// tail\n";
        let out = laid_out(text).unwrap();
        assert_eq!(out, wanted);
        assert_eq!(laid_out(&out).unwrap(), wanted, "the identity on its own text");
    }

    #[test]
    fn long_values_have_an_item_a_line() {
        let long = "x".repeat(60);
        let text = format!("(tags: [control(at: \"{long}\", shape: \"{long}\")])");
        let out = laid_out(&text).unwrap();
        assert_eq!(
            out,
            format!(
                "(\n    tags: [\n        control(\n            at: \"{long}\",\n            shape: \"{long}\",\n        ),\n    ],\n)\n"
            )
        );
        assert_eq!(laid_out(&out).unwrap(), out);
    }

    #[test]
    fn comments_before_a_comma_go_behind_it() {
        let text = "(a: 1 /* x */, // y\n b: 2 // z\n , // w\n c: 3 /* s */, /* t */\n)";
        let wanted = "(\n    a: 1, /* x */ // y\n    b: 2, // z\n    // w\n    c: 3, /* s */ /* t */\n)\n";
        assert_eq!(laid_out(text).unwrap(), wanted);
        assert_eq!(laid_out(wanted).unwrap(), wanted, "the identity on its own text");
        let over_lines = laid_out("(a: [1 /* p\n q */ , 2, // r\n ])").unwrap();
        assert_eq!(laid_out(&over_lines).unwrap(), over_lines);
    }

    #[test]
    fn comments_without_a_place_are_refused() {
        let error = laid_out("(\n a: // why\n 1)").unwrap_err();
        assert_eq!(error.line, 2, "{error}");
        assert!(laid_out("(a: 1").is_err());
    }
}
