//! Rigs that a text is compared with as they are.

use crate::rig::{Rig, format::template::read::read_text};

/// True if a text says a rig without tags and stored poses, value by value. A reader takes all of such a rig as it is written, so
/// that nothing has to be written in full, and read, to compare it.
pub(super) fn says_plain_rig(rig: &Rig, text: &str) -> bool {
    let is_plain = |rig: &Rig| !rig.has_tags() && rig.stored_poses().is_empty();
    let is_same = |read: Rig| {
        is_plain(&read)
            && (read.uid, &read.about, &read.roots) == (rig.uid, &rig.about, &rig.roots)
            && (&read.groups, &read.inputs, &read.joints) == (&rig.groups, &rig.inputs, &rig.joints)
    };
    is_plain(rig) && read_text(text, 1).is_ok_and(|template| is_same(template.rig))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_say_what_is_in_them() {
        let text = |joint: &str| format!("(format: 2, name: \"n\", joints: [(label: \"a\"), (label: \"b\"{joint})])");
        let texts =
            ["", ", translation: (0, 1, 0)", ", parent: \"a\"", ", tags: [Command(module: \"control\")]"].map(text);
        for (number, text) in texts.iter().enumerate() {
            let rig = read_text(text, 1).unwrap().rig;
            let said = texts.each_ref().map(|text| says_plain_rig(&rig, text));
            // Names of commands depend on what a text says of others.
            assert_eq!(said, [0, 1, 2, 3].map(|other| other == number && !rig.has_tags()), "{text}");
        }
        assert!(!says_plain_rig(&Rig::default(), "(format: 2"));
    }
}
