//! The text of a template that comes to another folder, or becomes that of another rig.

use super::{quoted, text_patch::patch::Patch};
use crate::rig::{
    Uid,
    format::{
        layout::INDENT,
        tree::{NodeId, Tree},
    },
};

/// Blanks before a change of a part instance, from the instance on.
const CHANGE_INDENT: usize = 2 * INDENT;

/// The text with other files for some of its part instances, in their order. Each gets the uid beside it, unless it has one: a uid
/// that is left out follows from the name of the file. `None` for a text with another number of instances.
pub(crate) fn with_part_files(text: &str, files: &[Option<(String, Uid)>]) -> Option<String> {
    let tree = Tree::parse(text)?;
    let elements = tree.elements(tree.root(), "parts");
    if elements.len() != files.len() {
        return None;
    }
    let mut patch = Patch::new(&tree);
    for (item, file) in elements.iter().zip(files) {
        let Some((file, uid)) = file else { continue };
        patch.set(item.value, "part", &quoted(file));
        if tree.field(item.value, "uid").is_none() {
            patch.put_first(item.value, &format!("uid: \"{uid}\""));
        }
    }
    Some(patch.text())
}

/// The text with those uids of some of its part instances, in their order. `None` for a text with another number of instances.
pub(crate) fn with_part_uids(text: &str, uids: &[Option<Uid>]) -> Option<String> {
    let tree = Tree::parse(text)?;
    let elements = tree.elements(tree.root(), "parts");
    if elements.len() != uids.len() {
        return None;
    }
    let mut patch = Patch::new(&tree);
    for (item, uid) in elements.iter().zip(uids) {
        let Some(uid) = uid else { continue };
        match tree.field(item.value, "uid") {
            Some(field) => patch.replace(field.value, &format!("\"{uid}\"")),
            None => patch.put_first(item.value, &format!("uid: \"{uid}\"")),
        }
    }
    Some(patch.text())
}

/// The text with that uid of its rig; `None` for a text whose brackets do not match.
pub(crate) fn with_rig_uid(text: &str, uid: Uid) -> Option<String> {
    let tree = Tree::parse(text)?;
    let written = format!("\"{uid}\"");
    let mut patch = Patch::new(&tree);
    match tree.field(tree.root(), "uid") {
        Some(field) => patch.replace(field.value, &written),
        None => patch.put_first(tree.root(), &format!("uid: {written}")),
    }
    Some(patch.text())
}

/// The text with a line for each change of those part instances that stand on one line, have several changes, and are not in
/// `before` as they are.
pub(crate) fn with_changes_on_lines(text: &str, before: &str) -> String {
    let Some(tree) = Tree::parse(text) else { return text.to_owned() };
    let mut out = String::with_capacity(text.len());
    let mut at = 0;
    for item in tree.elements(tree.root(), "parts") {
        let (range, written) = (tree.node(item.value).range.clone(), tree.written(item.value));
        let line = text[..range.start].rfind('\n').map_or(0, |end| end + 1);
        let blanks = &text[line..range.start];
        let is_alone = blanks.chars().all(char::is_whitespace);
        let has_lines = written.contains('\n') || tree.elements(item.value, "changes").len() < 2;
        // A comment within would be lost.
        if has_lines || !is_alone || written.contains("/*") || before.contains(written) {
            continue;
        }
        out.push_str(&text[at..range.start]);
        out.push_str(&instance_on_lines(&tree, item.value, blanks));
        at = range.end;
    }
    out.push_str(&text[at..]);
    out
}

/// A part instance with a line for each field and each change.
fn instance_on_lines(tree: &Tree, instance: NodeId, blanks: &str) -> String {
    let changes = tree.elements(instance, "changes").iter();
    let changes: String =
        changes.map(|change| format!("{blanks}{:CHANGE_INDENT$}{},\n", "", tree.written(change.value))).collect();
    let node = tree.node(instance);
    let fields = node.items.iter().filter_map(|item| Some((item.key?, item.value)));
    let fields: String = fields
        .map(|(key, value)| match key {
            "changes" => format!("{blanks}{:INDENT$}changes: [\n{changes}{blanks}{:INDENT$}],\n", "", ""),
            _ => format!("{blanks}{:INDENT$}{key}: {},\n", "", tree.written(value)),
        })
        .collect();
    format!("{}(\n{fields}{blanks})", node.name)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "(
    format: 2, // the second
    name: \"a\",
    parts: [
        (part: \"b.rig.ron\", onto: [\"c\"]),
        (
            part: \"d.rig.ron\",
            uid: \"00000000000000aa\",
        ),
    ],
)
";

    #[test]
    fn files_of_instances_are_exchanged_and_their_uids_stay() {
        let files = [Some(("../b.rig.ron".to_owned(), Uid(0xbb))), Some(("../d.rig.ron".to_owned(), Uid(0xaa)))];
        let wanted = TEXT
            .replace("(part: \"b.rig.ron\"", "(uid: \"00000000000000bb\", part: \"../b.rig.ron\"")
            .replace("\"d.rig.ron\"", "\"../d.rig.ron\"");
        assert_eq!(with_part_files(TEXT, &files), Some(wanted));
        assert_eq!(with_part_files(TEXT, &[None, None]).as_deref(), Some(TEXT));
        assert_eq!(with_part_files(TEXT, &[None]), None);
    }

    #[test]
    fn a_rig_gets_its_uid() {
        let once = with_rig_uid(TEXT, Uid(7)).unwrap();
        assert_eq!(once, TEXT.replacen("(\n", "(\n    uid: \"0000000000000007\",\n", 1));
        assert_eq!(with_rig_uid(&once, Uid(8)), Some(once.replace("07\"", "08\"")));
    }

    #[test]
    fn several_changes_have_a_line_each() {
        let changes = "changes: [(joint: \"e\", scale: (1, 2, 3)), (joint: \"f\")]";
        let text = TEXT.replace("onto: [\"c\"]", &format!("onto: [\"c\"], {changes}"));
        let wanted = TEXT.replace(
            "(part: \"b.rig.ron\", onto: [\"c\"])",
            "(
            part: \"b.rig.ron\",
            onto: [\"c\"],
            changes: [
                (joint: \"e\", scale: (1, 2, 3)),
                (joint: \"f\"),
            ],
        )",
        );
        assert_eq!(with_changes_on_lines(&text, TEXT), wanted);
        // What people wrote so stays so.
        assert_eq!(with_changes_on_lines(&text, &text), text);
        assert_eq!(with_changes_on_lines(&wanted, TEXT), wanted);
    }
}
