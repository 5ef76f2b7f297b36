//! Local changes of parts that are made in the program: they become changes of the part's instance in the text.

use std::{collections::HashMap, fs, path::Path, sync::Arc};

use bevy::prelude::*;
use rigsmith::{
    files::{PartFiles, RealDisk, load_template, store_rig_over},
    modules,
    processor::Builder,
    rig::{Rig, RigEdit, TagData, TagKind, Uid, UidSource},
};

use super::{
    part_instances::{hand, load},
    saved_text::Desk,
    template_text::{Dice, apply, plain, without_blanks},
};

impl Desk {
    /// Saves a rig over the template; the text, which must say the rig with its parts.
    fn saved_parts(&self, rig: &Rig) -> String {
        let path = self.path();
        assert_eq!(store_rig_over(&RealDisk, &path, rig, &[&path]).unwrap(), Vec::<String>::new());
        assert_eq!(text_of_rig(load(&path)), text_of_rig(rig.clone()));
        fs::read_to_string(path).unwrap()
    }
}

/// The template of a rig, with the parameters of every command in the order of their names, which means nothing: a parameter
/// that a change sets comes behind those of the part.
fn text_of_rig(mut rig: Rig) -> String {
    let tags: Vec<(Uid, TagData)> =
        rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| (joint.data.uid, tag.clone()))).collect();
    for (joint, mut tag) in tags {
        if let TagKind::Command { params, .. } = &mut tag.kind {
            *params = unbound_params(&sorted(&without_blanks(params)));
            apply(&mut rig, RigEdit::SetTag(joint, Box::new(tag)));
        }
    }
    plain(rig)
}

/// Parameters whose references have names alone: reading binds a name to the uid that it stands for.
fn unbound_params(params: &str) -> String {
    let mut pieces = params.split('#');
    let mut text = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        let digits = piece.chars().take_while(char::is_ascii_hexdigit).count();
        if digits == 16 {
            text.push_str(&piece[16..]);
        } else {
            text.push('#');
            text.push_str(piece);
        }
    }
    text
}

/// Parameters in the order of their names.
fn sorted(params: &str) -> String {
    let inside = params.trim().strip_prefix('(').and_then(|rest| rest.strip_suffix(')')).unwrap();
    let (mut fields, mut depth, mut is_text) = (vec![String::new()], 0, false);
    for c in inside.chars() {
        match c {
            '"' => is_text = !is_text,
            '(' | '[' if !is_text => depth += 1,
            ')' | ']' if !is_text => depth -= 1,
            ',' if !is_text && depth == 0 => {
                fields.push(String::new());
                continue;
            }
            _ => {}
        }
        fields.last_mut().unwrap().push(c);
    }
    let mut fields: Vec<&str> = fields.iter().map(|field| field.trim()).filter(|field| !field.is_empty()).collect();
    fields.sort_unstable();
    format!("({})", fields.join(", "))
}

/// Lines of a text that another does not have.
fn lines_beyond(text: &str, other: &str) -> Vec<String> {
    let mut left: HashMap<&str, usize> = HashMap::new();
    for line in other.lines() {
        *left.entry(line).or_default() += 1;
    }
    let mut beyond = Vec::new();
    for line in text.lines() {
        match left.get_mut(line) {
            Some(count) if *count > 0 => *count -= 1,
            _ => beyond.push(line.to_owned()),
        }
    }
    beyond
}

fn joint(rig: &Rig, label: &str) -> Uid {
    rig.find_label(label).unwrap_or_else(|| panic!("no joint {label}"))
}

/// Changes the tag of a joint whose module has that name.
fn change_tag(rig: &mut Rig, label: &str, module: &str, change: impl FnOnce(&mut TagData)) {
    let joint = joint(rig, label);
    let is_it = |tag: &&TagData| matches!(&tag.kind, TagKind::Command { module: known, .. } if known == module);
    let mut tag = rig.joint(joint).unwrap().data.tags.iter().find(is_it).unwrap().clone();
    change(&mut tag);
    apply(rig, RigEdit::SetTag(joint, Box::new(tag)));
}

fn set_params(rig: &mut Rig, label: &str, from: &str, to: &str) {
    change_tag(rig, label, "control", |tag| {
        let TagKind::Command { params, .. } = &mut tag.kind else { panic!("{label}") };
        assert!(params.contains(from), "{params}");
        *params = params.replace(from, to);
    });
}

fn null(uid: u64, params: &str) -> TagData {
    let kind = TagKind::Command { module: "null".into(), params: params.into(), feature: None };
    TagData { uid: Uid(uid), enabled: true, comment: String::new(), kind }
}

type RigChange = fn(&mut Rig);

#[test]
fn one_change_of_a_part_is_one_line() {
    // Fields on lines of their own, with comments.
    let wide = hand("hand", 3, false, "").replace(
        "(part: \"finger.rig.ron\", name: \"finger 1\", parent: \"palm\", ",
        "(\n            // The second.\n            part: \"finger.rig.ron\",\n            name: \"finger 1\",\n            parent: \"palm\", // on it\n            ",
    ).replace(", prefix: \"f1_\"),", ",\n            prefix: \"f1_\",\n        ),");
    let cases: [(&str, RigChange, &str); 9] = [
        (
            "a value",
            |rig| set_params(rig, "f1_bone_2", "0.4", "0.7"),
            r#"(tag: "control/bone_2", params: (relative_size: 0.7))"#,
        ),
        ("a value more", |rig| set_params(rig, "f1_bone_2", "(", "(shape: \"star\", "), r#"params: (shape: "star")"#),
        ("a default", |rig| set_params(rig, "f1_bone_2", "relative_size: 0.4", ""), r#"unset: ["relative_size"]"#),
        (
            "off",
            |rig| change_tag(rig, "f1_bone_2", "control", |tag| tag.enabled = false),
            r#"(tag: "control/bone_2", enabled: false)"#,
        ),
        (
            "a note",
            |rig| change_tag(rig, "f1_bone_2", "control", |tag| tag.comment = "why".into()),
            r#"comment: "why""#,
        ),
        (
            "a label",
            |rig| {
                let joint = joint(rig, "f1_bone_2");
                apply(rig, RigEdit::SetLabel(joint, Some("knuckle".into())));
            },
            r#"(joint: "bone_2", label: "knuckle")"#,
        ),
        (
            "a place",
            |rig| {
                let joint = joint(rig, "f1_bone_3");
                let mut rest = rig.joint(joint).unwrap().data.rest;
                (rest.translation.y, rest.rotation) = (0.07, Quat::from_xyzw(0.1, 0.2, 0.3, 0.9).normalize());
                apply(rig, RigEdit::SetRest(joint, rest));
            },
            r#"(joint: "bone_3", translation: ("#,
        ),
        (
            "a tag more",
            |rig| {
                let tag = Box::new(null(77, "(parent: \"@joint palm\", creation: (name: \"nail\"))"));
                let joint = joint(rig, "f1_bone_3");
                apply(rig, RigEdit::AddTag { joint, tag, index: usize::MAX });
            },
            "null",
        ),
        (
            "a tag less",
            |rig| {
                let joint = joint(rig, "f1_bone_2");
                let tag = rig.joint(joint).unwrap().data.tags[0].uid;
                apply(rig, RigEdit::RemoveTag(joint, tag));
            },
            r#"(tag: "control/bone_2", removed: true)"#,
        ),
    ];
    for text in [hand("hand", 3, false, ""), hand("hand", 3, true, ""), wide] {
        for (what, made, line) in cases {
            let desk = Desk::new(&text);
            let mut rig = load(&desk.path());
            made(&mut rig);
            let saved = desk.saved_parts(&rig);
            let (added, gone) = (lines_beyond(&saved, &text), lines_beyond(&text, &saved));
            assert!(
                added.iter().any(|added| added.contains(line)) && gone.len() <= 1,
                "{what}: {added:?} for {gone:?}"
            );
            assert_eq!(added.len(), 1, "{what}: {added:#?}");
            assert!(added.iter().all(|line| !line.contains("finger 0") && !line.contains("finger 2")), "{added:?}");
            // Saved again, nothing changes; and what the part says again is no change any more.
            assert_eq!(desk.saved_parts(&rig), saved, "{what}");
            let first = load(&Desk::new(&text).path());
            if what != "a tag less" {
                assert_eq!(desk.saved_parts(&first), text, "{what}");
            }
        }
    }
}

#[test]
fn a_change_that_is_there_is_changed() {
    let changes = ", off: [\"fk\"], changes: [(tag: \"control/bone_2\", params: (relative_size: 0.9)), \
                   (joint: \"bone_3\", translation: (0, 0.05, 0), tags: [null(creation: (name: \"nail\"))])]";
    let text = hand("hand", 2, false, changes);
    let desk = Desk::new(&text);
    let mut rig = load(&desk.path());
    set_params(&mut rig, "f0_bone_2", "0.9", "0.8");
    assert_eq!(desk.saved_parts(&rig), text.replace("0.9", "0.8"));
    let last = joint(&rig, "f0_bone_3");
    let mut rest = rig.joint(last).unwrap().data.rest;
    rest.translation.y = 0.06;
    apply(&mut rig, RigEdit::SetRest(last, rest));
    assert_eq!(desk.saved_parts(&rig), text.replace("0.9", "0.8").replace("(0, 0.05, 0)", "(0.0, 0.06, 0.0)"));
    // A feature that is off goes on again in the list of those that are off, and another goes there.
    let base = joint(&rig, "f0_bone_1");
    let mut feature = rig.joint(base).unwrap().data.tags[0].clone();
    feature.enabled = true;
    apply(&mut rig, RigEdit::SetTag(base, Box::new(feature.clone())));
    assert!(!desk.saved_parts(&rig).contains("off:"));
    let other = joint(&rig, "f1_bone_1");
    let mut feature = rig.joint(other).unwrap().data.tags[0].clone();
    feature.enabled = false;
    apply(&mut rig, RigEdit::SetTag(other, Box::new(feature)));
    assert!(desk.saved_parts(&rig).contains("prefix: \"f1_\", off: [\"fk\"]"));
    // The tag that the change adds is changed, and taken away.
    change_tag(&mut rig, "f0_bone_3", "null", |tag| tag.enabled = false);
    assert!(desk.saved_parts(&rig).contains("enabled: false"));
    let tag = rig.joint(last).unwrap().data.tags[0].uid;
    apply(&mut rig, RigEdit::RemoveTag(last, tag));
    let saved = desk.saved_parts(&rig);
    assert!(!saved.contains("nail") && saved.contains("(joint: \"bone_3\", translation: (0.0, 0.06, 0.0))"), "{saved}");
}

#[test]
fn another_name_of_the_templates_own_joint_goes_on_in_its_parts() {
    let onto = "(\n    format: 2,\n    name: \"claw\",\n    joints: [\n        (label: \"a\"),\n        (label: \"b\", parent: \"a\", translation: (0, 0.3, 0)),\n        (label: \"c\", parent: \"b\", translation: (0, 0.3, 0)),\n    ],\n    parts: [\n        (part: \"finger.rig.ron\", onto: [\"a\", \"b\", \"c\"]),\n        (part: \"finger.rig.ron\", name: \"thumb\", parent: \"b\", prefix: \"t_\"),\n    ],\n)\n";
    let desk = Desk::new(onto);
    let mut rig = load(&desk.path());
    let middle = joint(&rig, "b");
    apply(&mut rig, RigEdit::SetLabel(middle, Some("elbow".into())));
    let saved = desk.saved_parts(&rig);
    assert!(
        saved.contains("onto: [\"a\", \"elbow\", \"c\"]") && saved.contains("parent: \"elbow\", prefix"),
        "{saved}"
    );
    // A tag on a joint that a part goes onto comes behind the part's own, and so it does when it is read again.
    apply(
        &mut rig,
        RigEdit::AddTag { joint: middle, tag: Box::new(null(9, "(creation: (name: \"mark\"))")), index: usize::MAX },
    );
    apply(&mut rig, RigEdit::AddTag { joint: middle, tag: Box::new(null(8, "()")), index: 0 });
    desk.saved_parts(&rig);
}

#[test]
fn any_mixture_of_changes_is_saved_and_read_again() {
    for seed in 0..4 {
        let dice = &mut Dice(UidSource::seeded(seed));
        let text = hand("hand", 3, seed % 2 == 1, "");
        let desk = Desk::new(&text);
        let mut rig = load(&desk.path());
        for step in 0..40u64 {
            let joints: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
            let joint = joints[dice.below(joints.len() as u64) as usize];
            let data = rig.joint(joint).unwrap().data.clone();
            let tag = (!data.tags.is_empty()).then(|| data.tags[dice.below(data.tags.len() as u64) as usize].clone());
            let share = dice.below(100) as f32 / 100.0;
            let edit = match (dice.below(7), tag) {
                (0, _) => {
                    let rest = rigsmith::rig::RestTransform { translation: Vec3::new(share, 0.1, 0.0), ..data.rest };
                    RigEdit::SetRest(joint, rest)
                }
                (1, _) => RigEdit::SetLabel(joint, Some(format!("own_{step}"))),
                (2, _) => RigEdit::SetLocked(joint, share > 0.5),
                (3, _) => {
                    let tag = Box::new(null(1000 + step, &format!("(creation: (name: \"extra_{step}\"))")));
                    RigEdit::AddTag { joint, tag, index: usize::MAX }
                }
                (4, Some(tag)) => RigEdit::RemoveTag(joint, tag.uid),
                (5, Some(mut tag)) => {
                    tag.enabled = !tag.enabled;
                    RigEdit::SetTag(joint, Box::new(tag))
                }
                (_, Some(mut tag)) => {
                    if let TagKind::Command { params, .. } = &mut tag.kind {
                        let place = params.find("creation").map_or("()".to_owned(), |at| format!("({}", &params[at..]));
                        *params = place.replacen('(', &format!("(relative_size: {share:?}, "), 1).replace(", )", ")");
                    }
                    RigEdit::SetTag(joint, Box::new(tag))
                }
                _ => continue,
            };
            apply(&mut rig, edit);
            if step % 4 == 3 {
                desk.saved_parts(&rig);
            }
        }
        desk.saved_parts(&rig);
    }
}

#[test]
fn a_value_of_the_bundled_biped_is_one_line() {
    let bundled = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates/biped.rig.ron");
    let text = fs::read_to_string(&bundled).unwrap();
    let rig = load_template(&RealDisk, &bundled).unwrap().rig;
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("biped.rig.ron");
    let mut changed = 0;
    let sized: Vec<(Uid, TagData)> = rig
        .walk()
        .flat_map(|joint| joint.data.tags.iter().map(move |tag| (joint.data.uid, tag.clone())))
        .filter(|(_, tag)| matches!(&tag.kind, TagKind::Command { module, .. } if module == "control"))
        .collect();
    for (joint, mut tag) in sized.into_iter().step_by(7) {
        let TagKind::Command { params, .. } = &mut tag.kind else { continue };
        let line = "color: (0.125, 0.25, 0.5)";
        if params.contains("color:") || params.trim() == "()" {
            continue;
        }
        *params = params.replacen('(', &format!("({line}, "), 1);
        let mut rig = rig.clone();
        apply(&mut rig, RigEdit::SetTag(joint, Box::new(tag)));
        fs::write(&out, &text).unwrap();
        assert_eq!(store_rig_over(&RealDisk, &out, &rig, &[&out]).unwrap(), Vec::<String>::new());
        let saved = fs::read_to_string(&out).unwrap();
        let added = lines_beyond(&saved, &text);
        assert!(added.len() == 1 && added[0].contains(line), "{added:#?}");
        assert!(lines_beyond(&text, &saved).len() <= 1);
        assert_eq!(text_of_rig(load(&out)), text_of_rig(rig));
        changed += 1;
    }
    assert!(changed > 5, "{changed}");
}

/// A part with an attribute that a weight follows.
const LID: &str = r#"(
    format: 2,
    name: "lid",
    kind: "part",
    joints: [
        (
            label: "lid",
            tags: [
                control(creation: (name: "lid_ctl")),
                attribute(node: "@command control/lid_ctl role:control", name: "open", max: Some(1.0)),
            ],
        ),
        (
            label: "tip",
            parent: "lid",
            translation: (0, 0.1, 0),
            tags: [
                orient(
                    targets: "@command control/lid_ctl role:control",
                    control: "@command control/lid_ctl role:control",
                    weight: "open",
                ),
            ],
        ),
    ],
)"#;

/// The prefix of an instance names its joints and nodes, not the attributes by which its parameters refer to each other.
#[test]
fn attributes_keep_their_names_under_a_prefix() {
    let host = r#"(
    format: 2,
    name: "host",
    joints: [(label: "head")],
    parts: [(part: "lid.rig.ron", parent: "head", prefix: "x_")],
)"#;
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("lid.rig.ron"), LID).unwrap();
    let path = folder.path().join("host.rig.ron");
    let template = PartFiles::new(&RealDisk).complete(&path, host.as_bytes()).unwrap();
    let built = Builder::build(&template.rig, &Arc::new(modules::all())).unwrap();
    let control = built.nodes.iter().find(|node| *node.name == *"x_lid_ctl").unwrap();
    let names: Vec<&str> = control.attributes.iter().map(|attribute| &*attribute.name).collect();
    assert_eq!(names, ["open"]);
}

/// Names in an instance's changes: those of the template before those of the part without the prefix.
#[test]
fn names_in_changes_need_no_prefix() {
    let host = |node: &str| {
        format!(
            "(format: 2, name: \"host\", joints: [(label: \"head\"), (label: \"lid\", \
             uid: \"00000000000000aa\", parent: \"head\")], parts: [\
             (part: \"lid.rig.ron\", parent: \"head\", prefix: \"x_\", changes: [\
             (tag: \"orient/tip\", params: (node: \"@joint {node}\"))])])"
        )
    };
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("lid.rig.ron"), LID).unwrap();
    for (node, meant) in [("x_lid", "x_lid"), ("lid", "lid"), ("tip", "x_tip")] {
        let path = folder.path().join("host.rig.ron");
        let rig = PartFiles::new(&RealDisk).complete(&path, host(node).as_bytes()).unwrap().rig;
        let orients = rig.walk().flat_map(|joint| &joint.data.tags).filter_map(|tag| match &tag.kind {
            TagKind::Command { module, params, .. } if *module == "orient" => Some(params.clone()),
            _ => None,
        });
        let wanted = format!("@joint {meant}#{}", rig.find_label(meant).unwrap());
        let orients: Vec<String> = orients.collect();
        assert!(orients.iter().any(|params| params.contains(&wanted)), "{node}: {orients:?}");
    }
}
