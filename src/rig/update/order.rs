//! Order of a list of which two sides have changed versions.

use std::collections::{HashMap, HashSet};

use crate::rig::Uid;

/// Order of everything that is in `now` or `file`: as in `now`, but where only the file changed the order of what both have,
/// as in the file. What only the file has comes behind what it comes behind there.
pub(super) fn merged_order(base: Option<&Vec<Uid>>, now: &[Uid], file: &[Uid]) -> Vec<Uid> {
    let in_file: HashSet<Uid> = file.iter().copied().collect();
    let in_now: HashSet<Uid> = now.iter().copied().collect();
    let common = |list: &[Uid]| -> Vec<Uid> {
        list.iter().copied().filter(|uid| in_file.contains(uid) && in_now.contains(uid)).collect()
    };
    let (mine, theirs) = (common(now), common(file));
    let was = base.map(|base| common(base));
    let mut order: Vec<Uid> = now.to_vec();
    // What both have, at the places of it, in the order of the file.
    if was.as_ref() == Some(&mine) && mine != theirs {
        let mut next = theirs.iter();
        for place in order.iter_mut().filter(|uid| in_file.contains(uid)) {
            *place = *next.next().unwrap_or(place);
        }
    }
    let mut behind: HashMap<Option<Uid>, Vec<Uid>> = HashMap::new();
    let mut last = None;
    for uid in file {
        if in_now.contains(uid) {
            last = Some(*uid);
        } else {
            behind.entry(last).or_default().push(*uid);
        }
    }
    let mut merged = behind.remove(&None).unwrap_or_default();
    for uid in order {
        merged.push(uid);
        merged.extend(behind.remove(&Some(uid)).unwrap_or_default());
    }
    merged
}

/// Uids of the lists, without repeats: those of the file first, then of the rig now, then of the base.
pub(super) fn all([base, now, file]: &[Vec<Uid>; 3]) -> Vec<Uid> {
    let mut seen = HashSet::new();
    file.iter().chain(now).chain(base).copied().filter(|uid| seen.insert(*uid)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn list(text: &str) -> Vec<Uid> {
        text.bytes().map(|b| Uid(u64::from(b))).collect()
    }

    #[test]
    fn both_sides_keep_their_order() {
        let cases = [
            ("abc", "abc", "acb", "acb"),
            ("abc", "cab", "abc", "cab"),
            ("abc", "axbc", "abyc", "axbyc"),
            ("abc", "xcba", "acb", "xcba"),
            ("abc", "ac", "cba", "cba"),
            ("", "ab", "zab", "zab"),
        ];
        for (base, now, file, wanted) in cases {
            let merged = merged_order(Some(&list(base)), &list(now), &list(file));
            // What is gone on one side is left out by the caller.
            assert_eq!(merged, list(wanted), "{base} {now} {file}");
        }
    }
}
