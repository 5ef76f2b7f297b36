//! Uids written into templates and taken out again, names beside them, and words about names that nothing has.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use rigsmith::{
    files::{
        HeaderMemory, RealDisk, SearchPaths, format_template_file, list_templates, load_template, newest_versions,
    },
    modules,
    processor::review,
    rig::{
        Rig, Uid,
        template::{UidStyle, format_template, read_template},
    },
};

use super::template_text::{plain, read};

/// Templates that come with Rigsmith, with their paths and texts.
fn bundled() -> Vec<(PathBuf, String)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates");
    let mut list = Vec::new();
    for folder in [folder.clone(), folder.join("parts")] {
        let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        list.extend(
            entries.filter(|path| path.is_file()).map(|path| (path.clone(), fs::read_to_string(path).unwrap())),
        );
    }
    list.retain(|(path, _)| path.to_string_lossy().ends_with(".rig.ron"));
    list.sort();
    list
}

fn formatted(path: &Path, text: &str, uids: UidStyle) -> String {
    format_template_file(&RealDisk, path, text, uids).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[test]
fn uids_that_were_written_are_taken_out_again_and_the_text_is_as_before() {
    let all = bundled();
    assert!(all.len() > 20);
    let (mut references, mut instances) = (0, 0);
    for (path, text) in all {
        let written = formatted(&path, &text, UidStyle::Written);
        references += written.matches('#').count();
        for part in read_template(text.as_bytes()).unwrap().parts {
            assert!(written.contains(&format!("uid: \"{}\"", part.uid)), "{}: {}", path.display(), part.title());
            instances += 1;
        }
        assert_eq!(formatted(&path, &written, UidStyle::Written), written, "{}", path.display());
        assert_eq!(formatted(&path, &written, UidStyle::Derived), text, "{}", path.display());
    }
    assert!(references > 100 && instances > 8, "{references} {instances}");
}

const HOST: &str = r#"(
    format: 2,
    name: "host",
    joints: [
        (
            label: "base",
            tags: [
                null(creation: (name: "world")),
                control(creation: (name: "own")),
                point(node: "@command null/base", targets: "@command control/own role:control"),
            ],
        ),
    ],
    parts: [
        (part: "parts/arm.rig.ron", name: "arm", parent: "base"),
    ],
)
"#;

fn loaded(path: &Path, text: &str) -> Rig {
    fs::write(path, text).unwrap();
    let template = load_template(&RealDisk, path).unwrap_or_else(|error| panic!("{error}"));
    assert!(template.notes.is_empty(), "{:?}", template.notes);
    template.rig
}

#[test]
fn names_that_parts_have_too_keep_their_meaning() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("host.rig.ron");
    let before = plain(loaded(&path, HOST));
    let written = formatted(&path, HOST, UidStyle::Written);
    assert!(written.contains("control/own#"), "the name is that of the text: {written}");
    assert_eq!(plain(loaded(&path, &written)), before);
    // Of the arm, too, there is a `null` called `world`.
    let other = written.replace("null/base#", "null/world#");
    let derived = formatted(&path, &other, UidStyle::Derived);
    assert_eq!(derived, HOST);
    assert_eq!(plain(loaded(&path, &derived)), before);
    // Who does not know what the part brings leaves the uids.
    let alone = format_template(&written, UidStyle::Derived).unwrap();
    assert_eq!(alone.matches('#').count(), 2, "{alone}");
    assert_eq!(plain(loaded(&path, &alone)), before);
}

#[test]
fn a_part_whose_uid_is_written_takes_another_name_and_stays_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("host.rig.ron");
    let written = formatted(&path, HOST, UidStyle::Written);
    let hand = |text: &str| loaded(&path, text).find_label("hand_l").unwrap();
    let before = hand(HOST);
    let renamed = |text: &str| text.replace("name: \"arm\"", "name: \"left arm\"");
    assert_eq!(hand(&renamed(&written)), before);
    assert_ne!(hand(&renamed(HOST)), before);
    // A uid that does not follow from the name stays.
    assert!(formatted(&path, &renamed(&written), UidStyle::Derived).contains("(uid: \""), "{written}");
}

#[test]
fn tags_that_changes_of_a_part_add_have_uids_that_can_be_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("host.rig.ron");
    let tags = "null(creation: (name: \"grip\")), Feature(kind: \"generic\", name: \"More\"), null(feature: \"More\")";
    let changes = format!("changes: [(joint: \"hand_l\", tags: [{tags}])]");
    let text = HOST.replace("parent: \"base\"),", &format!("parent: \"base\", {changes}),"));
    let plainly_laid_out = formatted(&path, &text, UidStyle::Kept);
    let before = plain(loaded(&path, &text));
    let written = formatted(&path, &text, UidStyle::Written);
    let added = &written[written.find("changes:").unwrap()..];
    assert_eq!(added.matches("uid: \"").count(), 3, "{written}");
    assert_eq!(plain(loaded(&path, &written)), before);
    assert_eq!(formatted(&path, &written, UidStyle::Written), written);
    // Another name of a tag is another uid, unless it is written.
    let tags = |text: &str| {
        let rig = loaded(&path, &text.replace("\"grip\"", "\"handle\""));
        let hand = rig.joint(rig.find_label("hand_l").unwrap()).unwrap();
        hand.data.tags.iter().map(|tag| tag.uid).collect::<Vec<Uid>>()
    };
    let rig = loaded(&path, &text);
    let own: Vec<Uid> =
        rig.joint(rig.find_label("hand_l").unwrap()).unwrap().data.tags.iter().map(|tag| tag.uid).collect();
    assert!(tags(&written) == own && tags(&text) != own, "{own:?}");
    assert_eq!(formatted(&path, &written, UidStyle::Derived), plainly_laid_out);
}

#[test]
fn names_beside_uids_that_mean_something_else_are_brought_up_to_date() {
    let text = HOST.split("    parts:").next().unwrap().to_owned() + ")\n";
    let written = format_template(&text, UidStyle::Written).unwrap();
    let stale = written.replace("control/own#", "control/gone#");
    assert!(stale != written && format_template(&stale, UidStyle::Written).unwrap().contains("control/base#"));
    assert_eq!(format_template(&stale, UidStyle::Derived).unwrap(), text.replace("control/own", "control/base"));
}

#[test]
fn a_comment_without_a_place_is_told_where_the_source_has_it() {
    let text = HOST.replace("label: \"base\"", "label /* odd */ : \"base\"");
    let told = [UidStyle::Kept, UidStyle::Written, UidStyle::Derived]
        .map(|uids| format_template(&text, uids).expect_err("no place between a name and its colon"));
    assert!(text[told[0].offset..].trim_start().starts_with("/* odd */"), "{}", told[0]);
    assert!(told.iter().all(|error| *error == told[0]), "{told:?}");
}

#[test]
fn fields_and_values_that_do_not_exist_are_told_with_the_nearest() {
    let modules = Arc::new(modules::all());
    for (params, wanted) in [
        ("shap: \"cube\"", "there is no field `shap` here; did you mean `shape`"),
        ("axes: rigg", "there is no value `rigg` here; did you mean `rig`?"),
        ("creation: (nmae: \"x\")", "there is no field `nmae` here; did you mean `name`?"),
        ("qqqq: 1", "there is no field `qqqq` here; remove it or correct its name: known are `at`, `parent`, "),
    ] {
        let rig = read(&format!("(format: 2, name: \"x\", joints: [(label: \"a\", tags: [control({params})])])"));
        let told = format!("{:?}", review(&rig, &modules));
        assert!(told.contains(wanted) && !told.contains("ControlModule"), "{params}: {told}");
    }
}

#[test]
fn templates_that_come_with_rigsmith_are_no_versions_of_each_other() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates");
    let listing =
        list_templates(&RealDisk, &folder, usize::MAX, &SearchPaths::default(), &HeaderMemory::default()).unwrap();
    assert!(listing.templates.len() > 20);
    assert_eq!(newest_versions(listing.templates.iter()).len(), listing.templates.len());
}
