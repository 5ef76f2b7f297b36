//! Updates of a rig to another version of its template.

use bevy::math::Vec3;
use rigsmith::rig::{
    GroupData, JointData, PoseOffset, Rig, RigEdit, RigJoint, TagData, TagKind, Uid, UidSource,
    update::{Change, ChangeKind, Take, diff, edits_between, update},
};

use super::template_text::{CHAIN, Dice, apply, change, handwritten, plain, read};

fn changes(base: Option<&Rig>, now: &Rig, file: &Rig) -> Vec<String> {
    update(base, now, file, Take::Mine).changes.iter().map(change_text).collect()
}

fn change_text(change: &Change) -> String {
    let parts = [&change.joint, &change.tag, &change.field, &change.from, &change.to];
    let parts: Vec<&str> = parts.into_iter().flatten().map(String::as_str).collect();
    let conflict = if change.conflict { "conflict " } else { "" };
    format!("{conflict}{:?} {}", change.kind, parts.join(" "))
}

#[test]
fn what_each_side_changed_is_there_afterwards() {
    let base = read(CHAIN);
    let file = read(
        &CHAIN
            .replace("relative_size: 0.5", "relative_size: 0.75")
            .replace("(0, 1, 0)", "(0, 1.5, 0)")
            .replace("// The tip", "(label: \"side\", parent: \"tail_2\", tags: [null]), // The tip"),
    );
    let mut now = base.clone();
    let tip = now.find_label("tail_3").unwrap();
    let mut tag = now.joint(tip).unwrap().data.tags[1].clone();
    let TagKind::Command { params, .. } = &mut tag.kind else { panic!() };
    *params = params.replace("(name: \"tips\")", "(name: \"tips\"), shape: \"cube\"");
    apply(&mut now, RigEdit::SetTag(tip, Box::new(tag)));
    apply(&mut now, RigEdit::SetLocked(tip, true));
    let own = JointData { uid: Uid(9), label: Some("mine".into()), ..JointData::default() };
    apply(&mut now, RigEdit::AddJoint { joint: Box::new(own), parent: Some(tip), index: 0 });

    let updated = update(Some(&base), &now, &file, Take::Mine);
    let lines: Vec<String> = updated.changes.iter().map(change_text).collect();
    assert_eq!(
        lines,
        [
            "Changed tail_1 translation (0.0, 1.0, 0.0) (0.0, 1.5, 0.0)",
            "Added side",
            "Changed tail_3 control/tips params.relative_size 0.5 0.75",
        ]
    );
    let text = plain(updated.rig.clone());
    for part in ["relative_size:0.75", "shape:\"cube\"", "\"mine\"", "\"side\"", "locked: true", "(0.0, 1.5, 0.0)"] {
        assert!(text.contains(part), "{part}\n{text}");
    }
    // The edits of it do the same, and can be taken back.
    let edits = edits_between(&now, &updated.rig).unwrap();
    assert_eq!(edits.len(), 3, "{edits:?}");
    let mut by_edits = now.clone();
    let back = by_edits.apply(&RigEdit::Batch(edits)).unwrap();
    assert_eq!(by_edits, updated.rig);
    apply(&mut by_edits, back);
    assert_eq!(by_edits, now);
    // Once more changes nothing.
    assert_eq!(changes(Some(&file), &updated.rig, &file), Vec::<String>::new());
}

/// A rig of thousands of joints takes little more memory through an update that changes few of them.
#[test]
fn joints_that_stay_are_held_once() {
    let now = read(CHAIN);
    let file = read(&CHAIN.replace("(0, 1, 0)", "(0, 1.5, 0)"));
    let updated = update(Some(&now), &now, &file, Take::Mine).rig;
    for joint in now.walk() {
        let is_shared = std::ptr::eq(joint, updated.joint(joint.data.uid).unwrap());
        assert_eq!(is_shared, joint.data.label.as_deref() != Some("tail_1"), "{:?}", joint.data.label);
    }
}

#[test]
fn the_same_field_on_both_sides_is_a_choice() {
    let base = read(CHAIN);
    let now = read(&CHAIN.replace("relative_size: 0.5", "relative_size: 0.6"));
    let file = read(&CHAIN.replace("relative_size: 0.5", "relative_size: 0.7"));
    assert_eq!(
        changes(Some(&base), &now, &file),
        ["conflict Changed tail_3 control/tips params.relative_size 0.6 0.7"]
    );
    let size = |take: Take| plain(update(Some(&base), &now, &file, take).rig);
    assert!(size(Take::Mine).contains("relative_size:0.6") && size(Take::Theirs).contains("relative_size:0.7"));
    // The same change on both sides is none.
    assert!(changes(Some(&base), &now, &now).is_empty());
    // Without a base nobody knows who changed it, and what only the rig has stays.
    let mut more = base.clone();
    let own = JointData { uid: Uid(9), label: Some("mine".into()), ..JointData::default() };
    apply(&mut more, RigEdit::AddJoint { joint: Box::new(own), parent: None, index: 0 });
    let lines = changes(None, &more, &file);
    assert_eq!(lines, ["conflict Changed tail_3 control/tips params.relative_size 0.5 0.7"]);

    // Deleted on one side, changed on the other: a joint with a tag of somebody's own is not taken away silently.
    let without = read(
        &CHAIN
            .replace("(label: \"tail_2\", parent: \"tail_1\", translation: (0, 0.3, 0), tags: [control]),", "")
            .replace("parent: \"tail_2\"", "parent: \"tail_1\"")
            .replace(" + @joint tail_2", ""),
    );
    let middle = base.find_label("tail_2").unwrap();
    let mut tagged = base.clone();
    let tag = TagData {
        uid: Uid(77),
        enabled: true,
        comment: "own".into(),
        kind: TagKind::Command { module: "null".into(), params: "()".into(), feature: None },
    };
    apply(&mut tagged, RigEdit::AddTag { joint: middle, tag: Box::new(tag), index: 0 });
    let lines = changes(Some(&base), &tagged, &without);
    assert!(lines.contains(&"conflict Removed tail_2".to_owned()), "{lines:?}");
    assert!(update(Some(&base), &tagged, &without, Take::Mine).rig.find_tag(Uid(77)).is_some());
    assert!(update(Some(&base), &tagged, &without, Take::Theirs).rig.joint(middle).is_none());
    assert!(changes(Some(&base), &base, &without).contains(&"Removed tail_2".to_owned()));
    let lines = changes(Some(&base), &without, &read(&CHAIN.replace("tags: [control])", "tags: [control(size: 2)])")));
    assert!(lines.contains(&"conflict Added tail_2".to_owned()), "{lines:?}");
}

#[test]
fn another_name_is_told_as_such_and_keeps_the_identity() {
    let base = read(CHAIN);
    let tip = base.find_label("tail_3").unwrap();
    let file = read(
        &CHAIN.replace("tail_3", "tip").replace("\"tips\"", "\"points\"").replace("control/tips", "control/points"),
    );
    assert!(file.joint(tip).is_none());
    let updated = update(Some(&base), &base, &file, Take::Mine);
    let lines: Vec<String> = updated.changes.iter().map(change_text).collect();
    assert_eq!(lines[0], "Renamed tail_3 label tail_3 tip");
    assert!(lines.iter().all(|line| !line.starts_with("Added") && !line.starts_with("Removed")), "{lines:?}");
    assert_eq!(updated.rig.find_label("tip"), Some(tip));
    assert_eq!(updated.rig.len(), 3);
    assert!(plain(updated.rig).contains(&format!("@joint tip#{tip}")));
    // A tag's name alone.
    let file = read(&CHAIN.replace("\"tips\"", "\"points\"").replace("control/tips", "control/points"));
    let updated = update(Some(&base), &base, &file, Take::Mine);
    assert_eq!(updated.changes[0].kind, ChangeKind::Renamed);
    assert_eq!(updated.rig.joint(tip).unwrap().data.tags[1].uid, base.joint(tip).unwrap().data.tags[1].uid);
    // Two that could be it are none of them.
    let twins = CHAIN.replace("(label: \"tail_1\"", "(label: \"a\"), (label: \"b\"), (label: \"tail_1\"");
    let one = update(
        Some(&read(&twins)),
        &read(&twins),
        &read(&twins.replace("(label: \"a\"), (label: \"b\")", "(label: \"c\")")),
        Take::Mine,
    );
    assert!(one.changes.iter().all(|change| change.kind != ChangeKind::Renamed));
}

/// Changes of all sorts.
fn change_much(rig: &mut Rig, dice: &mut Dice, seed: u64) {
    for step in 0..1 + dice.below(5) {
        let joints: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
        let one = joints[dice.below(joints.len() as u64) as usize];
        let other = joints[dice.below(joints.len() as u64) as usize];
        let new = Uid(1 + seed * 1000 + dice.below(900) * 100 + step);
        match dice.below(9) {
            0 if joints.len() > 2 && rig.children(Some(one)).is_empty() => apply(rig, RigEdit::RemoveJoint(one)),
            1 => {
                let data = JointData { uid: new, label: Some(format!("n{}", new.0)), ..JointData::default() };
                apply(
                    rig,
                    RigEdit::AddJoint { joint: Box::new(data), parent: Some(one), index: dice.below(3) as usize },
                );
            }
            2 => apply(rig, RigEdit::SetLabel(one, Some(format!("l{}", new.0)))),
            3 => {
                drop(rig.apply(&RigEdit::SetParent { joint: one, parent: Some(other), index: dice.below(3) as usize }))
            }
            4 => {
                let kind = TagKind::Command {
                    module: "null".into(),
                    params: "(translate: (0.0, 0.1, 0.0))".into(),
                    feature: None,
                };
                let tag = TagData { uid: new, enabled: true, comment: String::new(), kind };
                apply(rig, RigEdit::AddTag { joint: one, tag: Box::new(tag), index: dice.below(3) as usize });
            }
            5 => {
                let tags: Vec<Uid> = rig.joint(one).unwrap().data.tags.iter().map(|tag| tag.uid).collect();
                if let Some(tag) = tags.first() {
                    apply(rig, RigEdit::RemoveTag(one, *tag));
                }
            }
            6 => {
                let group = GroupData { uid: new, name: format!("g{}", new.0), color: [0.5; 3], enabled: true };
                apply(rig, RigEdit::AddLocalGroup(group, 0));
                apply(rig, RigEdit::SetGroup(one, Some(new)));
            }
            _ => drop(change(rig, dice)),
        }
    }
}

#[test]
fn random_updates_keep_both_sides_and_edits_do_the_same() {
    for seed in 0..300 {
        let base = read(&handwritten(seed % 60));
        let dice = &mut Dice(UidSource::seeded(seed));
        let (mut now, mut file) = (base.clone(), base.clone());
        change_much(&mut now, dice, seed * 2 + 1);
        change_much(&mut file, dice, seed * 2 + 2);
        // One side alone: exactly that side.
        assert_eq!(
            plain(update(Some(&base), &base, &file, Take::Mine).rig),
            plain(file.clone()),
            "seed {seed}: theirs"
        );
        let mine = update(Some(&base), &now, &base, Take::Theirs);
        assert_eq!((plain(mine.rig), mine.changes), (plain(now.clone()), Vec::new()), "seed {seed}: mine");
        for take in [Take::Mine, Take::Theirs] {
            let updated = update(Some(&base), &now, &file, take);
            let edits = edits_between(&now, &updated.rig).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
            let mut by_edits = now.clone();
            let back = by_edits.apply(&RigEdit::Batch(edits)).unwrap();
            assert_eq!(plain(by_edits.clone()), plain(updated.rig.clone()), "seed {seed}: edits");
            apply(&mut by_edits, back);
            assert_eq!(by_edits, now, "seed {seed}: back");
            // The result is a rig that can be saved and read.
            assert_eq!(
                plain(read(&rigsmith::rig::template::write_template(&updated.rig))),
                plain(updated.rig),
                "seed {seed}"
            );
        }
        // The way from one to the other.
        let edits = edits_between(&now, &file).unwrap();
        let mut there = now.clone();
        apply(&mut there, RigEdit::Batch(edits));
        assert_eq!(plain(there), plain(file.clone()), "seed {seed}: between");
        assert!(diff(&file, &file).is_empty());
    }
}

#[test]
fn parents_that_go_in_a_circle_are_a_conflict() {
    let chain = |parents: [Option<&str>; 3]| {
        let joint = |(label, parent): (&str, Option<&str>)| {
            let parent = parent.map(|parent| format!(", parent: \"{parent}\"")).unwrap_or_default();
            format!("(label: \"{label}\"{parent}, translation: (0, 1, 0)),")
        };
        let joints: String = ["a", "b", "c"].into_iter().zip(parents).map(joint).collect();
        read(&format!("(format: 2, name: \"r\", joints: [{joints}])"))
    };
    let base = chain([None, None, Some("a")]);
    let now = chain([Some("b"), None, Some("a")]);
    let file = chain([None, Some("a"), Some("a")]);
    for (take, wanted) in [(Take::Mine, &now), (Take::Theirs, &file)] {
        let updated = update(Some(&base), &now, &file, take);
        let parents: Vec<Change> =
            updated.changes.iter().filter(|change| change.field.as_deref() == Some("parent")).cloned().collect();
        assert_eq!(parents.len(), 2, "{:?}", updated.changes);
        assert!(parents.iter().all(|change| change.conflict), "{parents:?}");
        for joint in wanted.walk() {
            let (uid, label) = (joint.data.uid, &joint.data.label);
            assert_eq!(updated.rig.joint(uid).unwrap().parent, joint.parent, "{label:?} with {take:?}");
        }
    }
}

#[test]
fn poses_of_joints_that_go_go_with_them() {
    let base = read(CHAIN);
    let tip = base.find_label("tail_3").unwrap();
    let mut now = base.clone();
    let (turned, other) = (PoseOffset { translation: Vec3::Y, ..PoseOffset::IDENTITY }, Uid(77));
    apply(&mut now, RigEdit::SetOffset(tip, Some(turned)));
    apply(&mut now, RigEdit::SetOffset(other, Some(turned)));
    let mut file = base.clone();
    apply(&mut file, RigEdit::RemoveJoint(tip));
    let updated = update(Some(&base), &now, &file, Take::Theirs).rig;
    assert_eq!((updated.offset(tip), updated.offset(other)), (None, Some(&turned)), "that of a created node stays");
    let edits = edits_between(&now, &updated).unwrap();
    apply(&mut now, RigEdit::Batch(edits));
    assert_eq!(now, updated);
}

#[test]
fn values_show_uids_only_where_names_do_not_identify() {
    let text = |parent: &str, node: &str, more: &str| {
        read(&format!(
            "(format: 2, name: \"names\", joints: [(label: \"a\"), (label: \"b\"), {more}(label: \"c\", parent: \"{parent}\", \
             tags: [null(parent: \"@joint {node}\")])])"
        ))
    };
    let told = |base: &Rig, file: &Rig| changes(Some(base), base, file);
    assert_eq!(
        told(&text("a", "a", ""), &text("b", "b", "")),
        ["Changed c parent a b", "Changed c null params.parent \"@joint a\" \"@joint b\""]
    );
    // Two of one label are told apart by their uids.
    let twin = "(uid: \"00000000000000b2\", label: \"b\"), ";
    let b = text("a", "a", "").find_label("b").unwrap();
    let [from, to] = [text("a", "a", twin), text(&b.to_string(), &format!("b#{b}"), twin)];
    assert_eq!(
        told(&from, &to),
        [format!("Changed c parent a b#{b}"), format!("Changed c null params.parent \"@joint a\" \"@joint b#{b}\"")]
    );
    // The same name for other things says nothing.
    let other = text("00000000000000b2", "b#00000000000000b2", twin);
    let lines = told(&to, &other);
    assert_eq!(lines[0], format!("Changed c parent b#{b} b#00000000000000b2"), "{lines:?}");
}

/// Hundreds of joints, groups, inputs and commands that are only called otherwise stay the same ones, each for itself.
#[test]
fn hundreds_of_things_with_other_names_stay_the_same_ones() {
    let count = 300;
    let text = |end: &str| {
        let list = |element: &dyn Fn(usize) -> String| (0..count).map(element).collect::<Vec<String>>().join(", ");
        let groups = list(&|n| format!("(name: \"group_{n}{end}\")"));
        let inputs = list(&|n| format!("(name: \"input_{n}{end}\", translation: ({n}, 0, 0))"));
        let tags = list(&|n| format!("null(translate: ({n}.0, 0.0, 0.0), creation: (name: \"null_{n}{end}\"))"));
        let place = |n: usize| format!("group: \"group_{n}{end}\", translation: (0, {n}, 0)");
        let joints = list(&|n| format!("(label: \"joint_{n}{end}\", parent: \"top\", {})", place(n)));
        let joints = format!("(label: \"top\", tags: [{tags}]), {joints}");
        format!("(format: 2, name: \"n\", groups: [{groups}], inputs: [{inputs}], joints: [{joints}])")
    };
    let (base, file) = (read(&text("")), read(&text("_new")));
    let updated = update(Some(&base), &base, &file, Take::Mine);
    let renamed = updated.changes.iter().filter(|change| change.kind == ChangeKind::Renamed);
    assert_eq!(renamed.count(), 4 * count);
    assert_eq!(updated.rig.len(), base.len());
    for joint in base.walk() {
        let now = updated.rig.joint(joint.data.uid).unwrap();
        let (was, is) = (joint.data.label.clone().unwrap(), now.data.label.clone().unwrap());
        assert!(is == was && was == "top" || is == format!("{was}_new"), "{was} is called {is}");
        assert_eq!(now.data.group, joint.data.group, "{was}");
        let tags = |joint: &RigJoint| joint.data.tags.iter().map(|tag| tag.uid).collect::<Vec<Uid>>();
        assert_eq!(tags(now), tags(joint), "{was}");
    }
    let uids = |rig: &Rig| rig.inputs().iter().map(|input| input.uid).collect::<Vec<Uid>>();
    assert_eq!(uids(&updated.rig), uids(&base));
}

/// A uid that names a thing of another kind in the file: what it named goes, and the other comes.
#[test]
fn a_uid_changes_its_kind() {
    let of = |content: &str| {
        let text = format!("(format: 2, uid: \"00000000000000f0\", name: \"kinds\", {content})");
        rigsmith::rig::template::read_template(text.as_bytes()).unwrap_or_else(|error| panic!("{content}: {error}")).rig
    };
    const U: &str = "uid: \"00000000000000aa\"";
    let joint = |number: usize, inside: &str| {
        format!("(uid: \"00000000000000b{number}\", label: \"{}\"{inside})", ["one", "two"][number - 1])
    };
    let rigs = [
        of(&format!(
            "joints: [({U}, label: \"was\"), {}, {}]",
            joint(1, ", parent: \"was\", translation: (0, 1, 0)"),
            joint(2, ", parent: \"one\"")
        )),
        of(&format!("groups: [({U}, name: \"g\")], joints: [{}, {}]", joint(1, ", group: \"g\""), joint(2, ""))),
        of(&format!("inputs: [({U}, name: \"eyes\")], joints: [{}]", joint(1, ""))),
        of(&format!("joints: [{}], poses: [({U}, name: \"rest\")]", joint(1, ""))),
        of(&format!("joints: [{}]", joint(1, &format!(", tags: [null({U}, at: \"@this\")]")))),
    ];
    for (number, from) in rigs.iter().enumerate() {
        for (other, to) in rigs.iter().enumerate() {
            let case = format!("{number} to {other}");
            let mut rig = from.clone();
            let edits = edits_between(from, to).unwrap_or_else(|error| panic!("{case}: {error}"));
            let inverses: Vec<RigEdit> = edits.iter().map(|edit| rig.apply(edit).unwrap()).collect();
            assert_eq!(&rig, to, "{case}");
            inverses.iter().rev().for_each(|edit| drop(rig.apply(edit).unwrap()));
            assert_eq!(&rig, from, "{case}");
            assert_eq!(&update(Some(from), from, to, Take::Mine).rig, to, "{case}");
            assert_eq!(diff(from, to).is_empty(), number == other, "{case}");
            // What a person has made of it is in the way of nothing.
            let mine = update(None, from, to, Take::Mine).rig;
            edits_between(from, &mine).unwrap_or_else(|error| panic!("{case}: {error}"));
        }
    }
}
