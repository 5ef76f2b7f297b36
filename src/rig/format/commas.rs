//! Commas that a RON text lacks: where one is forgotten, what stands behind it is read as part of something else.

use std::borrow::Cow;

use super::{
    scan::{Token, tokens},
    source::{SourceError, TextPlace},
};

/// Most missing commas that are told.
const MOST: usize = 100;

/// Number of characters of what lacks a comma that are shown.
const SHOWN: usize = 24;

/// The text with the missing commas between fields and elements, each in place of a blank, so that all else stays where it
/// is; and the places where they are missing. Commas for which there is no blank are not told.
/// Texts that can be read lack none.
pub fn with_missing_commas(text: &str) -> (Cow<'_, str>, Vec<SourceError>) {
    let (mut faults, mut blanks) = (Vec::new(), Vec::new());
    let mut place = TextPlace::start(text);
    let mut open: Vec<&str> = Vec::new();
    let (mut further, mut before): (Option<Token>, Option<Token>) = (None, None);
    for token in tokens(text) {
        if let (Some(bracket), Some(before)) = (open.last(), &before)
            && lacks_comma(bracket, further.as_ref(), before, &token)
            && let Some(blank) = blank_between(text, before, &token)
            && faults.len() < MOST
        {
            let shown: String = token.text.chars().take(SHOWN).collect();
            faults.push(place.error(token.start, format!("Expected comma before `{shown}`; add it")));
            blanks.push(blank);
        }
        match token.text {
            "(" | "[" | "{" => open.push(token.text),
            ")" | "]" | "}" => {
                open.pop();
            }
            _ => {}
        }
        further = before.replace(token);
    }
    if blanks.is_empty() {
        return (Cow::Borrowed(text), faults);
    }
    let mut whole = text.to_owned();
    for blank in blanks {
        whole.replace_range(blank..blank + 1, ",");
    }
    (Cow::Owned(whole), faults)
}

/// True if a token begins a field or an element behind another one, whose last token is `before`, without a comma between.
fn lacks_comma(bracket: &str, further: Option<&Token>, before: &Token, token: &Token) -> bool {
    let is_opening = |text: &str| matches!(text, "(" | "[" | "{");
    let is_name = before.text.starts_with(|c: char| c.is_alphabetic() || c == '_');
    // The name of a struct stands before its bracket, and one without a colon is no value.
    if is_name && (is_opening(token.text) || bracket != "[" && further.is_none_or(|further| further.text != ":")) {
        return false;
    }
    let ends = |c: char| c.is_alphanumeric() || matches!(c, '_' | '"' | '\'' | '#' | ')' | ']' | '}');
    let begins = |c: char| c.is_alphanumeric() || matches!(c, '_' | '"' | '\'' | '-');
    let is_apart = before.start + before.text.len() < token.start;
    is_apart && before.text.starts_with(ends) && (is_opening(token.text) || token.text.starts_with(begins))
}

/// Place of a blank between two tokens, behind the one or before the other.
fn blank_between(text: &str, before: &Token, token: &Token) -> Option<usize> {
    let ends = [before.start + before.text.len(), token.start.saturating_sub(1)];
    ends.into_iter().find(|at| matches!(text.as_bytes().get(*at), Some(b' ' | b'\t')))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commas_come_where_they_are_missing_and_nowhere_else() {
        for (text, whole) in [
            ("(a: 1 b: 2)", "(a: 1,b: 2)"),
            ("(a: \"x\"\n    b: (1 -2, 3.5 4))", "(a: \"x\"\n   ,b: (1,-2, 3.5,4))"),
            ("(a: [x() y(z: 1) w \"q\"])", "(a: [x(),y(z: 1),w,\"q\"])"),
            ("(a: (b: 1) // c\n c: true d: [1])", "(a: (b: 1),// c\n c: true,d: [1])"),
        ] {
            let (found, faults) = with_missing_commas(text);
            assert_eq!((&*found, faults.len()), (whole, whole.matches(',').count() - text.matches(',').count()));
        }
        for text in [
            "#![enable(implicit_some)] (a: Some (1), b: point (x: 1.5e-3, y: -2), c: r#\"x\"#, d: 'x', e: [true, r\"y\"])",
            "(label \"a\", b: 1)",
            "{ \"a\": 1, 2: [a, b] } // x y",
            "(a: 1\nb: 2)",
        ] {
            assert_eq!(with_missing_commas(text), (Cow::Borrowed(text), Vec::new()), "{text}");
        }
    }
}
