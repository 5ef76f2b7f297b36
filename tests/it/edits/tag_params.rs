//! Parameters of tags that an edit takes: RON of any shape, and nothing else.

use std::collections::BTreeSet;

use rigsmith::{
    files::{BUNDLED_CHARACTERS, BUNDLED_PARTS},
    rig::{JointData, Rig, RigEdit, TagData, TagKind, Uid, template::read_template},
};
use ron::{Options, value::RawValue};

use crate::random::Random;

/// Texts that come into parameters at random places.
const PIECES: [&str; 26] = [
    "(", ")", "[", "]", "{", "}", ",", ":", "\"", "\\", "/", "//", "/*", "'", ".", "-", "1e5", "0x", "r\"", "Some",
    "true(", "inf", " ", "\u{b}", "é", "#",
];

/// Parameters that the general reader takes, as an edit stores them.
fn read(params: &str) -> Option<String> {
    let options = Options::default().with_recursion_limit(100);
    let raw: Box<RawValue> = options.from_str(&format!("{params}\n")).ok()?;
    Some(raw.trim().get_ron().to_owned())
}

/// A rig of one joint.
fn one_joint() -> Rig {
    let mut rig = Rig::new(Uid(1), "one");
    let joint = Box::new(JointData { uid: Uid(2), ..JointData::default() });
    rig.apply(&RigEdit::AddJoint { joint, parent: None, index: 0 }).unwrap();
    rig
}

/// Parameters that the rig has once a tag with them was added; `None` if it was refused.
fn taken(params: &str) -> Option<String> {
    let mut rig = one_joint();
    let kind = TagKind::Command { module: "null".to_owned(), params: params.to_owned(), feature: None };
    let tag = Box::new(TagData { uid: Uid(3), enabled: true, comment: String::new(), kind });
    rig.apply(&RigEdit::AddTag { joint: Uid(2), tag, index: 0 }).ok()?;
    match &rig.find_tag(Uid(3))?.1.kind {
        TagKind::Command { params, .. } => Some(params.clone()),
        TagKind::Feature { .. } => None,
    }
}

#[test]
fn edits_take_the_parameters_that_the_general_reader_takes() {
    let texts = BUNDLED_PARTS.iter().chain(BUNDLED_CHARACTERS).map(|(_, text)| *text);
    let mut known = BTreeSet::new();
    for text in texts {
        let Ok(template) = read_template(text.as_bytes()) else { continue };
        for tag in template.rig.walk().flat_map(|joint| &joint.data.tags) {
            if let TagKind::Command { params, .. } = &tag.kind {
                known.insert(params.clone());
            }
        }
    }
    assert!(known.len() > 100, "{}", known.len());
    let mut random = Random(7);
    let (mut refused, mut other) = (0, 0);
    for params in &known {
        assert_eq!(taken(params).as_ref(), Some(params), "as it is in a template");
        for _ in 0..20 {
            let mut changed = params.clone();
            for _ in 0..=random.below(2) {
                let places: Vec<usize> = changed.char_indices().map(|(at, _)| at).collect();
                let Some(place) = random.of(&places) else { continue };
                if random.chance(2) {
                    changed.remove(place);
                } else {
                    changed.insert_str(place, PIECES[random.below(PIECES.len())]);
                }
            }
            let expected = read(&changed);
            assert_eq!(taken(&changed), expected, "{changed}");
            refused += usize::from(expected.is_none());
            other += usize::from(expected.is_some_and(|text| text != *params));
        }
    }
    assert!(refused > 200 && other > 200, "{refused} refused, {other} taken");
}

#[test]
fn an_option_without_brackets_is_refused() {
    for params in ["(a: Some 1)", "(a: Some \"/\")", "(a: Some \"é\")"] {
        assert_eq!(taken(params), None, "{params}");
    }
    assert_eq!(taken(" (a: Some(\"/\")) // one").as_deref(), Some("(a: Some(\"/\"))"));
}
