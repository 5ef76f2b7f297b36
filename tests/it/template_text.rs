//! Templates that people write: shorthand, saving over a text, layout, and the page that teaches them.

use std::{collections::BTreeSet, fmt::Write, fs, path::Path, sync::Arc};

use bevy::math::Vec3;
use rigsmith::{
    instance::RigTemplate,
    modules,
    processor::{Builder, review},
    rig::{
        JointData, Rig, RigEdit, TagData, TagKind, Uid, UidSource,
        template::{
            UidStyle, format_template, read_header, read_template, survey_template, write_template, write_template_over,
        },
    },
    solve::program::{CompileOptions, RigProgram},
};

pub(super) fn read(text: &str) -> Rig {
    read_template(text.as_bytes()).unwrap_or_else(|error| panic!("{error}\n{text}")).rig
}

pub(super) fn apply(rig: &mut Rig, edit: RigEdit) {
    rig.apply(&edit).unwrap();
}

/// A rig without blanks in its parameters.
pub(super) fn plain(mut rig: Rig) -> String {
    let tags: Vec<(Uid, TagData)> =
        rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| (joint.data.uid, tag.clone()))).collect();
    for (joint, mut tag) in tags {
        if let TagKind::Command { params, .. } = &mut tag.kind {
            *params = without_blanks(params);
            apply(&mut rig, RigEdit::SetTag(joint, Box::new(tag)));
        }
    }
    write_template(&rig)
}

/// RON text without blanks, comments and last commas.
pub(super) fn without_blanks(text: &str) -> String {
    let (mut out, mut rest) = (String::new(), text);
    while let Some(c) = rest.chars().next() {
        let length = match c {
            '"' => rest[1..].find('"').unwrap() + 2,
            '/' if rest.starts_with("//") => rest.find('\n').unwrap_or(rest.len()),
            '/' => rest.find("*/").unwrap() + 2,
            _ => c.len_utf8(),
        };
        if c != '/' && !c.is_whitespace() {
            out.push_str(&rest[..length]);
        }
        rest = &rest[length..];
    }
    out.replace(",)", ")").replace(",]", "]")
}

/// Lines of both texts that differ: those between their common beginning and their common end.
fn changed_lines(before: &str, after: &str) -> (usize, usize) {
    let (a, b): (Vec<&str>, Vec<&str>) = (before.lines().collect(), after.lines().collect());
    let same = a.iter().zip(&b).take_while(|(a, b)| a == b).count();
    let rest = a[same..].iter().rev().zip(b[same..].iter().rev()).take_while(|(a, b)| a == b).count();
    (a.len() - same - rest, b.len() - same - rest)
}

pub(super) const CHAIN: &str = include_str!("../frozen/format-2-shorthand.rig.ron");

#[test]
fn shorthand_says_the_same_as_the_long_form() {
    let rig = read(CHAIN);
    let labels: Vec<_> = rig.walk().map(|joint| joint.data.label.clone().unwrap()).collect();
    assert_eq!(labels, ["tail_1", "tail_2", "tail_3"]);
    let tip = rig.joint(rig.find_label("tail_3").unwrap()).unwrap();
    assert!(tip.data.rest.rotation.angle_between(bevy::math::Quat::from_rotation_y(90f32.to_radians())) < 1e-5);
    let root = rig.joint(rig.find_label("tail_1").unwrap()).unwrap();
    assert_eq!(root.data.group, Some(rig.groups()[0].uid));
    let TagKind::Command { module, feature, params } = &tip.data.tags[1].kind else { panic!() };
    assert_eq!((module.as_str(), *feature), ("control", Some(tip.data.tags[0].uid)));
    assert!(!params.contains("feature") && params.contains("relative_size: 0.5"), "{params}");
    // The same at each load, and what is written out in full is the same rig.
    assert_eq!(read(CHAIN), rig);
    assert_eq!(read(&write_template(&rig)), rig);
    assert!(review(&rig, &Arc::new(modules::all())).is_empty());
    let built = Builder::build(&rig, &Arc::new(modules::all())).unwrap();
    assert_eq!(built.nodes.iter().filter(|node| node.control.is_some()).count(), 4);
    // A header knows what the author left out.
    let header = read_header(CHAIN.as_bytes()).unwrap();
    assert_eq!((header.uid, header.joint_count, header.features.len()), (rig.uid(), 3, 1));
}

#[test]
fn identities_follow_from_names_and_nothing_else() {
    let rig = read(CHAIN);
    // Order, place, blanks, and other things do not matter.
    let moved =
        CHAIN.replace("(0, 0.3, 0)", "(0, 9, 0)").replace("// half as big", "").replace("shape: \"cube\"", "size: 2");
    let uids = |rig: &Rig| -> BTreeSet<Uid> {
        rig.walk()
            .flat_map(|joint| std::iter::once(joint.data.uid).chain(joint.data.tags.iter().map(|tag| tag.uid)))
            .collect()
    };
    assert_eq!(uids(&read(&moved)), uids(&rig));
    // A written uid keeps what another label would lose.
    let tip = rig.find_label("tail_3").unwrap();
    let renamed = read(
        &CHAIN
            .replace("label: \"tail_3\"", &format!("uid: \"{tip}\", label: \"tip\""))
            .replace("@joint tail_3", "@this"),
    );
    assert_eq!(renamed.find_label("tip"), Some(tip));
    // A new joint of the old name makes way.
    let both = CHAIN
        .replace("label: \"tail_3\"", &format!("uid: \"{tip}\", label: \"tip\""))
        .replace("// The root.", "(label: \"tail_3\"),");
    let both = read(&both);
    assert_eq!(both.find_label("tip"), Some(tip));
    assert!(both.find_label("tail_3").is_some_and(|uid| uid != tip));
}

#[test]
fn all_faults_of_shorthand_are_told_with_their_places() {
    let text = CHAIN
        .replace("parent: \"tail_1\"", "parent: \"tial_1\"")
        .replace("group: \"back\"", "group: \"bakc\"")
        .replace("feature: \"tip\"", "feature: \"top\"")
        .replace("// The root.", "(label: \"tail_2\"), (),");
    let (_, faults) = survey_template(text.as_bytes()).unwrap();
    let told: Vec<String> = faults.iter().map(ToString::to_string).collect();
    for (line, part) in [
        (10, "\"tail_2\" is there already"),
        (8, "neither a label nor a uid"),
        (9, "no local group \"bakc\" in the file; did you mean \"back\"?"),
        (10, "no joint \"tial_1\" in the file; did you mean \"tail_1\", "),
        (21, "no feature \"top\" in the file"),
    ] {
        assert!(
            told.iter().any(|told| told.contains(part) && told.contains(&format!("line {line},"))),
            "{part}: {told:#?}"
        );
    }
    let first = read_template(text.as_bytes()).unwrap_err();
    assert_eq!(first, faults[0]);
    // A fault in a parameter has its place in the text that the person wrote.
    let wrong = CHAIN.replace("relative_size: 0.5", "relative_size: \"big\"");
    let rig = read(&wrong);
    let problems = review(&rig, &Arc::new(modules::all()));
    let explicit = rigsmith::rig::template::explicit(&wrong);
    let place = rigsmith::processor::SourceText::new(&explicit).locate(&rig, &problems[0]);
    let at = &wrong.lines().nth(place.line - 1).unwrap()[place.column - 1..];
    assert!(place.line == 23 && at.trim_start().starts_with("\"big\""), "{place}");
}

#[test]
fn a_save_changes_what_changed_and_nothing_else() {
    let rig = read(CHAIN);
    assert_eq!(write_template_over(&rig, CHAIN).as_deref(), Some(CHAIN));
    let (tip, middle) = (rig.find_label("tail_3").unwrap(), rig.find_label("tail_2").unwrap());
    let joint = |rig: &Rig, uid: Uid| rig.joint(uid).unwrap().data.clone();
    let changed = |edits: &[RigEdit]| {
        let mut rig = rig.clone();
        edits.iter().for_each(|edit| apply(&mut rig, edit.clone()));
        let text = write_template_over(&rig, CHAIN).unwrap();
        assert_eq!(plain(read(&text)), plain(rig), "{text}");
        text
    };
    let mut rest = joint(&rig, tip).rest;
    rest.translation.y = 0.25;
    let text = changed(&[RigEdit::SetRest(tip, rest)]);
    assert_eq!(text, CHAIN.replace("(0, 0.3, 0),\n            rot", "(0, 0.25, 0),\n            rot"));

    let tag = joint(&rig, tip).tags[1].clone();
    let TagKind::Command { module, params, feature } = tag.kind.clone() else { panic!() };
    let with = |params: String| {
        let kind = TagKind::Command { module: module.clone(), params, feature };
        RigEdit::SetTag(tip, Box::new(TagData { kind, ..tag.clone() }))
    };
    let text = changed(&[with(params.replace("relative_size: 0.5", "relative_size: 0.7"))]);
    assert_eq!(text, CHAIN.replace("0.5, // half", "0.7, // half"));
    let text = changed(&[with(params.replace("(name: \"tips\"),", "(name: \"tips\"), shape: \"cube\","))]);
    assert_eq!(changed_lines(CHAIN, &text), (0, 1), "{text}");
    let off = TagData { enabled: false, ..tag.clone() };
    let text = changed(&[RigEdit::SetTag(tip, Box::new(off))]);
    assert_eq!(changed_lines(CHAIN, &text), (0, 1), "{text}");

    // A new name: the old identity is written, and whoever was called by the name is called by the new one.
    let text = changed(&[RigEdit::SetLabel(middle, Some("middle".into()))]);
    assert!(text.contains(&format!("(uid: \"{middle}\", label: \"middle\", parent: \"tail_1\"")), "{text}");
    assert!(text.contains("parent: \"middle\",") && text.contains("\"@joint tail_3 + @joint middle\","), "{text}");
    for comment in
        ["// A tail.", "// of a cat", "// The root.", "// The tip moves most.", "// to the side", "// half as big"]
    {
        assert!(text.contains(comment), "{comment}");
    }

    // A joint more, one less, another order.
    let new = JointData { uid: Uid(7), label: Some("side".into()), ..JointData::default() };
    let add = RigEdit::AddJoint { joint: Box::new(new), parent: Some(middle), index: 0 };
    let text = changed(std::slice::from_ref(&add));
    assert_eq!(changed_lines(CHAIN, &text), (0, 1), "{text}");
    let text = changed(&[RigEdit::RemoveJoint(tip)]);
    assert!(!text.contains("tail_3") && !text.contains("moves most") && text.contains("// The root."), "{text}");
    let order = [add, RigEdit::SetParent { joint: tip, parent: Some(middle), index: 0 }];
    let text = changed(&order);
    assert!(text.contains("// The tip moves most.") && text.contains("// half as big"), "{text}");
    // Another rig takes nothing from the text.
    let other = Rig::new(Uid(5), "other");
    assert_eq!(write_template_over(&other, CHAIN), None);
}

#[test]
fn identities_that_follow_from_names_are_the_same_for_ever() {
    let rig = read(CHAIN);
    let joint = |label: &str| rig.find_label(label).unwrap();
    let tags: Vec<Uid> = rig.joint(joint("tail_3")).unwrap().data.tags.iter().map(|tag| tag.uid).collect();
    let all = [rig.uid(), joint("tail_1"), joint("tail_2"), joint("tail_3"), rig.groups()[0].uid];
    let frozen = ["75cf7c607d896d8a", "30bf6cd6793088ed", "2f2699b9b40e944e", "1a6acedcf0787c25", "e5c86d09d20ecada"];
    assert_eq!(all.map(|uid| uid.to_string()), frozen);
    let frozen = ["8549bee81b4a0d44", "a377f8a053ddb9e6", "192dc29f67a18ed7"];
    assert_eq!(tags.iter().map(Uid::to_string).collect::<Vec<_>>(), frozen);
}

#[test]
fn what_is_inserted_stands_as_far_in_as_its_neighbours() {
    let text = CHAIN.replace("    ", "\t");
    let rig = read(&text);
    let mut changed = rig.clone();
    let tip = rig.find_label("tail_3").unwrap();
    let new = JointData { uid: Uid(7), label: Some("side".into()), ..JointData::default() };
    apply(&mut changed, RigEdit::AddJoint { joint: Box::new(new), parent: Some(tip), index: 0 });
    let saved = write_template_over(&changed, &text).unwrap();
    let line = saved.lines().find(|line| line.contains("\"side\"")).unwrap();
    assert!(line.starts_with("\t\t("), "{line:?}");
}

#[test]
fn only_parameters_are_references_to_the_formatter() {
    let text = CHAIN.replace("control(shape: \"cube\")", "control(comment: \"@joint tail_2\", shape: \"cube\")");
    let written = format_template(&text, UidStyle::Written).unwrap();
    assert!(written.contains("comment: \"@joint tail_2\""), "{written}");
    assert!(written.contains("@joint tail_3#1a6acedcf0787c25"), "{written}");
    let derived = format_template(&written, UidStyle::Derived).unwrap();
    assert!(!derived.contains('#') && derived.contains("comment: \"@joint tail_2\""), "{derived}");
    assert_eq!(plain(read(&derived)), plain(read(&text)));
}

/// Numbers from a seed.
pub(super) struct Dice(pub(super) UidSource);

impl Dice {
    pub(super) fn below(&mut self, count: u64) -> u64 {
        self.0.next_uid().0 % count
    }

    fn pick<'a>(&mut self, among: &[&'a str]) -> &'a str {
        among[self.below(among.len() as u64) as usize]
    }
}

/// A template as somebody might write it, with comments in odd places, in an uneven layout.
pub(super) fn handwritten(seed: u64) -> String {
    let dice = &mut Dice(UidSource::seeded(seed));
    let comments = ["", "", "", " // why not", " /* sic */", "\n    // \"quoted\" (and bracketed]\n", "\n\n"];
    let mut out = String::from(dice.pick(&["", "// A rig.\n", "/* two\n   lines */\n\n"]));
    let gap = |dice: &mut Dice| format!("{}{}", dice.pick(&comments), dice.pick(&["\n  ", "\n    ", "\n\t"]));
    write!(out, "({}format: 2,{}name: \"rig {seed}\",", gap(dice), gap(dice)).unwrap();
    let groups = dice.below(3);
    if groups > 0 {
        write!(out, "{}groups: [", gap(dice)).unwrap();
        for group in 0..groups {
            write!(
                out,
                "(name: \"g{group}\"{}){}",
                dice.pick(&["", ", color: (0.5, 0.25, 1)"]),
                dice.pick(&[",", ",\n"])
            )
            .unwrap();
        }
        out.push_str("],");
    }
    write!(out, "{}joints: [", gap(dice)).unwrap();
    for joint in 0..1 + dice.below(9) {
        let between = if dice.below(2) == 0 { " ".to_owned() } else { gap(dice) };
        write!(out, "{}({}label: \"j{joint}\",", gap(dice), between.trim_matches(' ')).unwrap();
        if joint > 0 {
            write!(out, "{between}parent: \"j{}\",", dice.below(joint)).unwrap();
        }
        if groups > 0 && dice.below(2) == 0 {
            write!(out, "{between}group: \"g{}\",", dice.below(groups)).unwrap();
        }
        write!(out, "{between}translation: ({}, 0.{}, -1e-1),", dice.below(9), dice.below(99)).unwrap();
        if dice.below(3) == 0 {
            write!(out, "{between}rotation: ({}, 0, {}.5)", dice.below(90), dice.below(90)).unwrap();
            out.push_str(dice.pick(&[",", ""]));
            if out.ends_with(')') {
                out.push(',');
            }
        }
        write!(out, "{between}tags: [").unwrap();
        for tag in 0..dice.below(4) {
            match dice.below(4) {
                0 => write!(out, "{}Feature(kind: \"generic\", name: \"f{tag}\"),", gap(dice)).unwrap(),
                1 => {
                    let comma = dice.pick(&["", ","]);
                    write!(out, "{}Command(module: \"control\", params: (size: 0.{}{comma})),", gap(dice), tag + 1)
                        .unwrap();
                }
                2 => {
                    write!(
                        out,
                        "{}control(shape: \"cube\",{between}size: 1.{tag}, at: \"@joint j{joint}\"),",
                        gap(dice)
                    )
                    .unwrap();
                }
                _ => write!(out, " null(comment: \"n\", creation: (name: \"n{tag}\")), ").unwrap(),
            }
        }
        write!(out, "{}]{}),", gap(dice), dice.pick(&["", ",", ",\n"])).unwrap();
    }
    write!(out, "{}],{})\n{}", gap(dice), gap(dice), dice.pick(&["", "// end\n"])).unwrap();
    out
}

/// A change of one value of a rig.
pub(super) fn change(rig: &mut Rig, dice: &mut Dice) -> &'static str {
    let joints: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
    let uid = joints[dice.below(joints.len() as u64) as usize];
    let data = rig.joint(uid).unwrap().data.clone();
    let tag = (!data.tags.is_empty()).then(|| data.tags[dice.below(data.tags.len() as u64) as usize].clone());
    match (dice.below(5), tag) {
        (0, Some(tag)) => {
            apply(rig, RigEdit::SetTag(uid, Box::new(TagData { enabled: !tag.enabled, ..tag })));
            "enabled"
        }
        (1, Some(tag)) => {
            apply(rig, RigEdit::SetTag(uid, Box::new(TagData { comment: "said".into(), ..tag })));
            "comment"
        }
        (2 | 3, Some(TagData { kind: TagKind::Command { module, params, feature }, uid: own, enabled, comment })) => {
            let params = match params.contains("size: 1.") {
                true => params.replace("size: 1.", "size: 2."),
                false => params.replace("size: 0.", "size: 3."),
            };
            let kind = TagKind::Command { module, params, feature };
            apply(rig, RigEdit::SetTag(uid, Box::new(TagData { uid: own, enabled, comment, kind })));
            "parameter"
        }
        (4, _) => {
            apply(rig, RigEdit::SetLocked(uid, !data.locked));
            "locked"
        }
        _ => {
            let mut rest = data.rest;
            rest.translation += Vec3::new(0.0, 0.5, 0.0);
            apply(rig, RigEdit::SetRest(uid, rest));
            "translation"
        }
    }
}

#[test]
fn two_hundred_written_files_stay_to_the_byte_and_one_value_is_one_line() {
    for seed in 0..200 {
        let text = handwritten(seed);
        let rig = read(&text);
        assert_eq!(write_template_over(&rig, &text).as_ref(), Some(&text), "seed {seed}");
        let dice = &mut Dice(UidSource::seeded(seed + 1000));
        for _ in 0..4 {
            let mut changed = rig.clone();
            let what = change(&mut changed, dice);
            let saved = write_template_over(&changed, &text).unwrap();
            assert_eq!(plain(read(&saved)), plain(changed), "seed {seed}, {what}");
            let (before, after) = changed_lines(&text, &saved);
            assert!(
                before <= 1 && after <= 1,
                "seed {seed}, {what}: {before} lines became {after}:\n{text}\n---\n{saved}"
            );
        }
    }
}

#[test]
fn a_random_walk_of_edits_is_saved_over_and_over() {
    for seed in 0..40 {
        let mut text = handwritten(seed);
        let mut rig = read(&text);
        let dice = &mut Dice(UidSource::seeded(seed + 5000));
        for step in 0..12 {
            let joints: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
            let one = joints[dice.below(joints.len() as u64) as usize];
            let new = Uid(1 + dice.below(u64::MAX - 1));
            match dice.below(6) {
                0 if joints.len() > 2 && rig.children(Some(one)).is_empty() => {
                    apply(&mut rig, RigEdit::RemoveJoint(one))
                }
                1 => {
                    let data = JointData { uid: new, label: Some(format!("new {step}")), ..JointData::default() };
                    apply(
                        &mut rig,
                        RigEdit::AddJoint { joint: Box::new(data), parent: Some(one), index: dice.below(3) as usize },
                    );
                }
                2 => apply(&mut rig, RigEdit::SetLabel(one, Some(format!("other {step}")))),
                3 => {
                    let parent = rig.joint(one).unwrap().parent;
                    apply(&mut rig, RigEdit::SetParent { joint: one, parent, index: dice.below(3) as usize });
                }
                _ => drop(change(&mut rig, dice)),
            }
            let comments = text.matches("// why not").count();
            let saved = write_template_over(&rig, &text).unwrap();
            assert_eq!(plain(read(&saved)), plain(rig.clone()), "seed {seed}, step {step}");
            assert!(saved.matches("// why not").count() + 9 >= comments, "comments are lost: seed {seed}, step {step}");
            assert!(saved.matches("format: 2").count() == 1 && !saved.contains("joint_count"), "written anew: {saved}");
            // Saving again changes nothing.
            assert_eq!(write_template_over(&rig, &saved).as_ref(), Some(&saved));
            text = saved;
        }
    }
}

/// The rig of a text, with what its parts bring.
fn whole(text: &str) -> Rig {
    (**RigTemplate::read(text.as_bytes()).unwrap_or_else(|error| panic!("{error}\n{text}")).rig()).clone()
}

#[test]
fn formatting_is_the_identity_on_formatted_files_and_keeps_the_rig() {
    let mut texts: Vec<String> = (0..60).map(handwritten).collect();
    texts.push(CHAIN.to_owned());
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates");
    for folder in [folder.clone(), folder.join("parts")] {
        let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        texts.extend(entries.filter(|path| path.is_file()).map(|path| fs::read_to_string(path).unwrap()));
    }
    assert!(texts.len() > 75);
    for text in &texts {
        let rig = whole(text);
        for style in [UidStyle::Kept, UidStyle::Written, UidStyle::Derived] {
            let formatted = format_template(text, style).unwrap_or_else(|error| panic!("{style:?}: {error}\n{text}"));
            assert!(plain(whole(&formatted)) == plain(rig.clone()), "{style:?}\n{text}");
            assert_eq!(format_template(&formatted, style).unwrap(), formatted, "{style:?}: not the identity");
            let code = formatted.lines().map(|line| line.split(" //").next().unwrap().trim_end());
            let of_one = |line: &&str| {
                line.trim_end_matches(',')
                    .split_once(": \"")
                    .is_some_and(|(_, text)| text.find('"') == Some(text.len() - 1))
            };
            let long =
                code.filter(|line| !of_one(line) && line.chars().count() > 100 && !line.contains("description: "));
            assert_eq!(long.collect::<Vec<_>>(), Vec::<&str>::new());
        }
        let all = format_template(text, UidStyle::Written).unwrap();
        let none = format_template(&all, UidStyle::Derived).unwrap();
        assert!(plain(whole(&none)) == plain(rig), "uids written and taken out again\n{text}");
    }
    let all = format_template(CHAIN, UidStyle::Written).unwrap();
    assert_eq!(all.matches("uid: \"").count(), 1 + 1 + 3 + 5, "{all}");
    assert!(all.matches('#').count() == 3, "references have uids, too: {all}");
    let none = format_template(&all, UidStyle::Derived).unwrap();
    assert!(!none.contains("uid") && !none.contains('#'), "{none}");
    assert_eq!(
        format_template(CHAIN, UidStyle::Kept).unwrap().replace("control()", "control"),
        CHAIN.replace("[(name: \"back\")]", "[\n        (name: \"back\"),\n    ]")
    );
}

/// Texts between "```ron" and "```".
fn examples(page: &str) -> Vec<String> {
    page.split("```ron\n").skip(1).map(|rest| rest.split("```").next().unwrap().to_owned()).collect()
}

#[test]
fn the_page_on_writing_rigs_is_right() {
    let page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/write-a-rig.md")).unwrap();
    let examples = examples(&page);
    assert_eq!(examples.len(), 4);
    let modules = Arc::new(modules::all());
    for (text, lines) in examples.iter().zip([12, 60, 40, 12]) {
        let rig = read(text);
        assert!(text.lines().count() <= lines, "{} has {} lines", rig.about().name, text.lines().count());
        assert_eq!(review(&rig, &modules), Vec::new());
        let built = Builder::build(&rig, &modules).unwrap();
        assert!(built.nodes.iter().any(|node| node.control.is_some()));
        assert!(RigProgram::compile(&built, &CompileOptions::default()).is_ok(), "{} moves", rig.about().name);
        assert_eq!(&format_template(text, UidStyle::Kept).unwrap(), text, "the page's own layout");
        assert_eq!(write_template_over(&rig, text).as_ref(), Some(text));
    }
}
