//! Suggestions of similar names, for errors about unknown names.

/// The names nearest to `name`, best first, at most `most` of them; names that have little in common are left out.
///
/// Nearness is the optimal string alignment distance (insertions, deletions, substitutions and swaps of neighbours)
/// without regard to upper and lower case; a name that contains the other counts as near. Equally near names are in
/// alphabetical order. Time grows with the product of the lengths, for each name.
pub fn nearest<S: AsRef<str>>(name: &str, among: impl IntoIterator<Item = S>, most: usize) -> Vec<String> {
    let wanted = folded(name);
    let mut found: Vec<(usize, String)> = among
        .into_iter()
        .filter_map(|other| {
            let other = other.as_ref();
            let folded = folded(other);
            let longer = wanted.len().max(folded.len());
            let distance = distance(&wanted, &folded);
            let contained = wanted.len().min(folded.len()) >= 3 && (holds(&wanted, &folded) || holds(&folded, &wanted));
            let near = contained || distance <= (longer / 3).max(1) && distance < longer;
            near.then(|| (distance, other.to_owned()))
        })
        .collect();
    found.sort_unstable();
    found.dedup();
    found.into_iter().take(most).map(|(_, name)| name).collect()
}

/// The end of an error's sentence about an unknown name: `; did you mean "a" or "b"?`, or all names if they are few and
/// none is near, or nothing.
pub fn did_you_mean<S: AsRef<str>>(name: &str, among: impl IntoIterator<Item = S>) -> String {
    let mut all: Vec<String> = among.into_iter().map(|name| name.as_ref().to_owned()).collect();
    all.sort_unstable();
    all.dedup();
    let near = nearest(name, &all, 3);
    match (near.is_empty(), all.len()) {
        (false, _) => format!("; did you mean {}?", listed(&near, "or")),
        (true, 1..=12) => format!("; known are {}", listed(&all, "and")),
        (true, _) => String::new(),
    }
}

/// Names in quotation marks as a list in words: `"a", "b" or "c"`.
pub fn listed<S: AsRef<str>>(names: &[S], word: &str) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("{:?}", name.as_ref())).collect();
    match quoted.split_last() {
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} {word} {last}", rest.join(", ")),
        None => String::new(),
    }
}

/// Number of names that lists of [`listed_first`] have.
pub(crate) const MOST_LISTED: usize = 12;

/// The first of `count` names as [`listed`] lists them; of more than twelve it says how many others there are.
pub fn listed_first(names: impl IntoIterator<Item = String>, count: usize, word: &str) -> String {
    let first: Vec<String> = names.into_iter().take(MOST_LISTED).collect();
    if count <= MOST_LISTED {
        return listed(&first, word);
    }
    let quoted: Vec<String> = first.iter().map(|name| format!("{name:?}")).collect();
    format!("{} {word} one of {} others", quoted.join(", "), count - first.len())
}

/// Number of characters that are compared, so that very long names cost little.
const LONGEST: usize = 64;

fn folded(name: &str) -> Vec<char> {
    name.chars().flat_map(char::to_lowercase).take(LONGEST).collect()
}

fn holds(long: &[char], short: &[char]) -> bool {
    long.windows(short.len().max(1)).any(|window| window == short)
}

fn distance(a: &[char], b: &[char]) -> usize {
    let mut before: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut row = Vec::with_capacity(b.len() + 1);
        row.push(i + 1);
        for (j, y) in b.iter().enumerate() {
            let mut least = (last[j] + usize::from(x != y)).min(last[j + 1] + 1).min(row[j] + 1);
            if i > 0 && j > 0 && *x == b[j - 1] && a[i - 1] == *y {
                least = least.min(before[j - 1] + 1);
            }
            row.push(least);
        }
        before = std::mem::replace(&mut last, row);
    }
    last.last().copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_count_edits() {
        for (a, b, expected) in [("", "abc", 3), ("kitten", "sitting", 3), ("ab", "ba", 1), ("hand", "hand", 0)] {
            assert_eq!(distance(&folded(a), &folded(b)), expected, "{a} {b}");
        }
    }

    #[test]
    fn the_nearest_come_first_and_strangers_not_at_all() {
        let names = ["hand_r", "Hand_l", "upper_arm_l", "hadn_l", "spine"];
        assert_eq!(nearest("hand_l", names, 3), ["Hand_l", "hadn_l", "hand_r"]);
        assert_eq!(nearest("arm", names, 3), ["upper_arm_l"]);
        assert_eq!(nearest("tail", names, 3), [""; 0]);
    }
}
