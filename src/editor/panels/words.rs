//! Parameters and features in words.

use crate::rig::fields;

/// Most letters of a value.
const LONG: usize = 28;

/// Name of a feature for people.
pub(super) fn feature(kind: &str, name: &str, switch: &str) -> String {
    let named: Vec<&str> = [name, switch].into_iter().filter(|part| !part.is_empty()).collect();
    if named.is_empty() { format!("feature {kind}") } else { named.join(", ") }
}

/// Parameters in words, behind the comment: `Left hand · parent control/arm_l, shape cube`.
pub(super) fn summary(comment: &str, params: &str) -> String {
    let values = fields(params).into_iter().filter(|field| field.depth == 1);
    let said = values.map(|field| {
        let value = value(params[field.value..field.end].trim().trim_end_matches(','));
        let name = field.name.replace('_', " ");
        match value.as_str() {
            "true" => name,
            "false" => format!("no {name}"),
            _ => format!("{name} {value}"),
        }
    });
    let said = said.collect::<Vec<_>>().join(", ");
    match (comment, said.as_str()) {
        ("", _) => said,
        (_, "") => comment.to_owned(),
        _ => format!("{comment} · {said}"),
    }
}

/// A value without quotation marks, uids and what only files need.
fn value(text: &str) -> String {
    let plain = text.trim_matches('"').replace("@command ", "").replace("@joint ", "").replace('@', "");
    let has_fields = plain.starts_with('(') && plain.contains(": ");
    let plain = if has_fields { plain.replace(['(', ')', '"'], "").replace(": ", " ") } else { plain };
    let mut said = String::new();
    let mut is_uid = false;
    for letter in plain.chars() {
        // The uid behind a name goes up to the next blank.
        is_uid = letter == '#' || is_uid && letter.is_ascii_hexdigit();
        if !is_uid {
            said.push(if letter.is_whitespace() { ' ' } else { letter });
        }
    }
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    match said.char_indices().nth(LONG) {
        Some((end, _)) => format!("{}…", &said[..end]),
        None => said,
    }
}
