//! Labels of the left and right side.

/// Gives a label the name of the other side, if it names a side.
pub fn mirror_label(label: &mut String) {
    if let Some(mirrored) = mirrored_label(label) {
        *label = mirrored;
    }
}

/// The mirrored label, for the joint on the other side, or `None` if the label names no side.
///
/// The recognised sides are endings `_l`/`_r`, `.l`/`.r`, `-l`/`-r` and the words `left`/`right` anywhere, in lower,
/// upper or title case. A side's ending may be followed by a number, as Blender writes it (`hand.L.001`).
pub fn mirrored_label(label: &str) -> Option<String> {
    swap_ending(label).or_else(|| swap_start(label)).or_else(|| swap_word(label))
}

/// Pairs of labels that differ in their side alone, as indices, each below its partner's; labels that stand twice have no
/// pair.
pub fn label_pairs(labels: &[Option<&str>]) -> Vec<[usize; 2]> {
    let mut places: std::collections::BTreeMap<&str, Option<usize>> = std::collections::BTreeMap::new();
    for (index, label) in labels.iter().enumerate() {
        if let Some(label) = label {
            places.entry(label).and_modify(|place| *place = None).or_insert(Some(index));
        }
    }
    let place = |label: &str| places.get(label).copied().flatten();
    let pair = |index: usize| {
        let label = labels[index]?;
        let other = mirrored_label(label)?;
        let is_pair = mirrored_label(&other).as_deref() == Some(label) && place(label) == Some(index);
        place(&other).filter(|partner| is_pair && index < *partner).map(|partner| [index, partner])
    };
    (0..labels.len()).filter_map(pair).collect()
}

/// Side that a label names: `-1` right, `1` left, `0` none.
pub fn label_side(label: &str) -> i32 {
    let Some(other) = mirrored_label(label) else { return 0 };
    // The first character at which the two labels differ belongs to the side.
    let differing = label.chars().zip(other.chars()).find(|(a, b)| a != b);
    match differing.map(|(a, _)| a.to_ascii_lowercase()) {
        Some('l') => 1,
        Some('r') => -1,
        _ => 0,
    }
}

fn other_letter(letter: char) -> Option<char> {
    Some(match letter {
        'l' => 'r',
        'r' => 'l',
        'L' => 'R',
        'R' => 'L',
        _ => return None,
    })
}

fn is_separator(c: char) -> bool {
    matches!(c, '_' | '.' | '-' | ' ')
}

fn swap_ending(label: &str) -> Option<String> {
    // `hand.L.001`: the side is before a trailing separator and number.
    let without_number = label.trim_end_matches(|c: char| c.is_ascii_digit());
    let stem = match without_number.strip_suffix(is_separator) {
        Some(stem) if without_number.len() < label.len() => stem,
        _ => label,
    };
    let mut end = stem.chars();
    let letter = other_letter(end.next_back()?)?;
    let before = end.as_str();
    if !before.ends_with(is_separator) || before.len() < 2 {
        return None;
    }
    Some(format!("{before}{letter}{}", &label[stem.len()..]))
}

fn swap_start(label: &str) -> Option<String> {
    let mut start = label.chars();
    let letter = other_letter(start.next()?)?;
    let rest = start.as_str();
    (rest.starts_with(is_separator) && rest.len() > 1).then(|| format!("{letter}{rest}"))
}

fn swap_word(label: &str) -> Option<String> {
    const WORDS: [(&str, &str); 3] = [("Left", "Right"), ("left", "right"), ("LEFT", "RIGHT")];
    let mut best: Option<(usize, &str, &str)> = None;
    for (left, right) in WORDS {
        for (from, to) in [(left, right), (right, left)] {
            if let Some(at) = find_word(label, from)
                && best.is_none_or(|(other, ..)| at < other)
            {
                best = Some((at, from, to));
            }
        }
    }
    let (at, from, to) = best?;
    Some(format!("{}{to}{}", &label[..at], &label[at + from.len()..]))
}

/// Finds `word` where a word begins: `upright` names no side, `mixamorig:RightHand`, `handRight` and `eye_right` do.
fn find_word(label: &str, word: &str) -> Option<usize> {
    label.match_indices(word).map(|(at, _)| at).find(|&at| {
        let before = label[..at].chars().next_back();
        let after = label[at + word.len()..].chars().next();
        let title = word.starts_with(char::is_uppercase) && word.ends_with(char::is_lowercase);
        let begins = match before {
            None => true,
            Some(c) if title => !c.is_uppercase(),
            Some(c) => !c.is_alphabetic(),
        };
        let ends = match after {
            None => true,
            Some(c) if title => !c.is_lowercase(),
            Some(c) => !c.is_lowercase() || !word.ends_with(char::is_lowercase),
        };
        begins && ends
    })
}
