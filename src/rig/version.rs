//! Versions of templates, as their authors write them.

use std::{cmp::Ordering, fmt};

use crate::rig::RigAbout;

/// Order of two versions: numeric parts count as numbers, a missing part as 0, and a word comes before any number, so that
/// `1.0-beta` is before `1.0`. A `v` in front does not matter. No version at all comes before every version.
///
/// ```
/// use std::cmp::Ordering;
/// use rigsmith::rig::version::compare;
///
/// assert_eq!(compare("1.2", "1.10"), Ordering::Less);
/// assert_eq!(compare("v2", "2.0.0"), Ordering::Equal);
/// assert_eq!(compare("1.0-beta", "1.0"), Ordering::Less);
/// ```
pub fn compare(a: &str, b: &str) -> Ordering {
    let (a, b) = (a.trim(), b.trim());
    match (a.is_empty(), b.is_empty()) {
        (false, false) => {}
        (is_a_empty, is_b_empty) => return is_b_empty.cmp(&is_a_empty),
    }
    let (a, b) = (parts(a), parts(b));
    for at in 0..a.len().max(b.len()) {
        let zero = Part::Number("");
        let order = a.get(at).unwrap_or(&zero).key().cmp(&b.get(at).unwrap_or(&zero).key());
        if order != Ordering::Equal {
            return order;
        }
    }
    Ordering::Equal
}

/// Part of a version. Words come before numbers.
enum Part<'a> {
    Word(String),
    Number(&'a str),
}

impl Part<'_> {
    fn key(&self) -> (bool, usize, &str) {
        match self {
            Self::Word(word) => (false, 0, word),
            // Without zeros in front, the longer number is the larger one.
            Self::Number(digits) => (true, digits.len(), digits),
        }
    }
}

fn parts(version: &str) -> Vec<Part<'_>> {
    let is_prefixed = |rest: &&str| rest.starts_with(|c: char| c.is_ascii_digit());
    let version = version.strip_prefix(['v', 'V']).filter(is_prefixed).unwrap_or(version);
    let mut parts = Vec::new();
    let mut rest = version;
    while let Some(first) = rest.chars().next() {
        let is_digit = first.is_ascii_digit();
        if !first.is_alphanumeric() {
            rest = &rest[first.len_utf8()..];
            continue;
        }
        let end = rest.find(|c: char| c.is_ascii_digit() != is_digit || !c.is_alphanumeric()).unwrap_or(rest.len());
        let (part, after) = rest.split_at(end);
        parts.push(match is_digit {
            true => Part::Number(part.trim_start_matches('0')),
            false => Part::Word(part.to_lowercase()),
        });
        rest = after;
    }
    parts
}

/// A change of version.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VersionChange {
    /// Version before.
    pub from: String,
    /// Version after.
    pub to: String,
}

impl VersionChange {
    /// The change between two versions of a template; `None` if they say the same version.
    pub fn between(from: &RigAbout, to: &RigAbout) -> Option<Self> {
        let change = Self { from: from.version.clone(), to: to.version.clone() };
        (compare(&change.from, &change.to) != Ordering::Equal).then_some(change)
    }

    /// True if the version after is the older one.
    pub fn is_back(&self) -> bool {
        compare(&self.from, &self.to) == Ordering::Greater
    }
}

impl fmt::Display for VersionChange {
    /// `1.0 to 1.2`, or `1.2 to 1.0, which is older`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let said = |version: &str| if version.is_empty() { "no version".to_owned() } else { version.to_owned() };
        write!(f, "{} to {}", said(&self.from), said(&self.to))?;
        if self.is_back() { f.write_str(", which is older") } else { Ok(()) }
    }
}
