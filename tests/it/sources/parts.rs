//! Part instances in the file that a rig with a document follows.

use rigsmith::files::store_document_over;

use super::*;

const HAND: &str = r#"(
    format: 2,
    name: "hand",
    joints: [
        // The palm.
        (label: "palm", translation: (0.5, 1, 0), tags: [control]),
    ],
    parts: [
        // The finger.
        (part: "link.rig.ron", name: "index", parent: "palm", prefix: "a_"),
    ],
)
"#;

impl Studio {
    fn source(&self) -> &RigSource {
        self.base.get(self.base.rig).unwrap()
    }

    /// Saves the document as the window does, over a text; nothing is lost. Returns what is saved.
    fn document_over(&self, name: &str, text: &str) -> String {
        let path = self.file.with_file_name(name);
        fs::write(&path, text).unwrap();
        let notes =
            store_document_over(&RealDisk, &path, self.base.rig(), self.source().taken_over(), &[&path]).unwrap();
        assert_eq!(notes, Vec::<String>::new());
        fs::read_to_string(path).unwrap()
    }

    /// Runs frames until the rig has taken over a version with a part instance of that name.
    fn until_called(&mut self, name: &str) {
        let has = |source: &RigSource| source.taken_over().parts.iter().any(|part| part.name == name);
        self.until("the name", |world, rig| world.get::<RigSource>(rig).is_some_and(has));
    }
}

#[test]
fn a_part_that_got_another_name_in_the_file_stays_a_part_in_the_next_save() {
    let mut studio = Studio::of(true, HAND);
    assert_eq!(studio.document_over("copy.rig.ron", HAND), HAND);
    let uid = studio.source().taken_over().parts[0].uid;
    let tip = studio.joint("a_1");
    let before = studio.base.rig().clone();
    let renamed = HAND.replace("\"index\"", "\"pointer\"");
    studio.save(&renamed);
    studio.until_called("pointer");
    assert_eq!(studio.base.rig(), &before, "joints and tags keep their identities");
    // The uid that the part had by its first name is written, and nothing else.
    let written = renamed.replace("(part: \"link", &format!("(uid: \"{uid}\", part: \"link"));
    assert_eq!(studio.document_over("copy.rig.ron", &renamed), written);
    // One value is one line.
    let palm = studio.joint("palm");
    let mut rest = studio.base.rig().joint(palm).unwrap().data.rest;
    rest.translation.y = 2.0;
    studio.base.apply(RigEdit::SetRest(palm, rest));
    let moved = written.replace("(0.5, 1, 0)", "(0.5, 2.0, 0)");
    assert_eq!(studio.document_over("copy.rig.ron", &renamed), moved);
    assert_eq!(studio.document_over("copy.rig.ron", &moved), moved);
    // The next version of the file still has the name alone; what it changes arrives at the same joint.
    studio.save(&renamed.replace("prefix: \"a_\"", "prefix: \"b_\""));
    studio.until("the prefix", |world, _| world.resource::<InstanceReport>().updated == 1);
    assert_eq!(studio.joint("b_1"), tip);
}

#[test]
fn undoing_an_update_of_a_part_brings_the_former_instance_back() {
    let mut studio = Studio::of(true, HAND);
    let before = studio.base.rig().clone();
    let longer = HAND.replace("\"index\"", "\"pointer\"").replace("prefix: \"a_\"", "prefix: \"b_\"");
    studio.save(&longer);
    studio.until("the update", |world, _| world.resource::<InstanceReport>().updated == 1);
    let names =
        |studio: &Studio| studio.source().taken_over().parts.iter().map(|part| part.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&studio), ["pointer"]);
    studio.base.change(Change::Undo);
    assert_eq!((studio.base.rig(), names(&studio)), (&before, vec!["index".to_owned()]));
    assert_eq!(studio.document_over("copy.rig.ron", HAND), HAND);
    studio.base.change(Change::Redo);
    assert_eq!(names(&studio), ["pointer"]);
}

/// Merges a change of a part instance's fields in the window and by the command line, and compares the documents.
#[cfg(feature = "cli")]
fn check_merge(field: &str, change: impl Fn(&str) -> String) {
    let base = hand();
    merged_on_both_ways(field, [crate::part_fields::PART, &base, &change(&base)], resized, "relative_size: 0.9");
}

/// The hand with a finger, without the reference to it.
#[cfg(feature = "cli")]
fn hand() -> String {
    let reference = ", tags: [parent(targets: \"@command control/a_base role:control\")]";
    let base = crate::part_fields::BASE.replace(reference, "");
    assert_ne!(base, crate::part_fields::BASE);
    base
}

/// Another size of the last control of the finger.
#[cfg(feature = "cli")]
fn resized(rig: &Rig) -> RigEdit {
    let (joint, tag) = control_of(rig, "a_bone_3");
    RigEdit::SetTag(joint, Box::new(tag))
}

/// Merges a file into a document in which a person has changed the part, in the window and by the command line, and compares
/// the documents, both of which have the text of what is kept. Returns the document.
#[cfg(feature = "cli")]
fn merged_on_both_ways(
    field: &str,
    [part, base, file]: [&str; 3],
    own: impl Fn(&Rig) -> RigEdit,
    kept: &str,
) -> Studio {
    use crate::{cli_outputs::rigsmith, part_fields};

    assert_ne!(file, base, "{field}");
    let mut studio = Studio::with_part(true, base, ("finger.rig.ron", part));
    let edit = own(studio.base.rig());
    studio.base.apply(edit);
    let mine = studio.document_over("mine.rig.ron", base);
    assert!(mine.contains(kept), "{field}: {mine}");
    let folder = studio.file.parent().unwrap().to_owned();
    fs::write(folder.join("base.rig.ron"), base).unwrap();
    fs::write(folder.join("file.rig.ron"), file).unwrap();
    let (code, said) = rigsmith(&folder, &part_fields::UPDATE);
    assert_eq!(code, 0, "{field}: {said}");
    let told = fs::read_to_string(folder.join("out.rig.ron")).unwrap();
    let known = studio.source().taken_over().parts.to_vec();
    studio.save(file);
    studio.until(field, |world, rig| {
        world.get::<RigSource>(rig).is_some_and(|source| source.taken_over().parts != known.as_slice())
    });
    assert_eq!(studio.instance_report().failed, Vec::<String>::new(), "{field}");
    // The document says what the command line has written, to the byte.
    assert_eq!(studio.document_over("again.rig.ron", &told), told, "{field}");
    assert!(told.contains(kept) && told != mine, "{field}: {told}");
    studio
}

/// Replaces the prefix of the part by fields.
#[cfg(feature = "cli")]
fn with_fields(fields: &'static str) -> impl Fn(&str) -> String {
    move |base| base.replace("prefix: \"a_\",", fields)
}

#[cfg(feature = "cli")]
#[test]
fn a_count_is_merged_as_by_the_command_line() {
    check_merge("count", with_fields("prefix: \"a_\", count: 5,"));
}

#[cfg(feature = "cli")]
#[test]
fn a_prefix_is_merged_as_by_the_command_line() {
    check_merge("prefix", with_fields("prefix: \"b_\","));
}

#[cfg(feature = "cli")]
#[test]
fn a_side_is_merged_as_by_the_command_line() {
    // The finger is the same on both sides: nothing of the rig differs but the field.
    check_merge("side", with_fields("prefix: \"a_\", mirror: true,"));
}

#[cfg(feature = "cli")]
#[test]
fn a_side_that_is_taken_back_is_merged_as_by_the_command_line() {
    let (base, part) = (hand(), crate::part_fields::PART);
    let sided = with_fields("prefix: \"a_\", mirror: true,")(&base);
    merged_on_both_ways("no side", [part, &sided, &base], resized, "relative_size: 0.9");
}

#[cfg(feature = "cli")]
#[test]
fn a_joint_that_a_person_moved_stays_there_on_both_sides() {
    let bone = "(label: \"bone_2\", parent: \"bone_1\", translation: (0, 1, 0)";
    let part = crate::part_fields::PART.replace(bone, &bone.replace("(0, 1, 0)", "(0.25, 1, 0)"));
    assert_ne!(part, crate::part_fields::PART);
    let moved = |rig: &Rig| {
        let joint = rig.joint(rig.find_label("a_bone_3").unwrap()).unwrap();
        let mut rest = joint.data.rest;
        rest.translation = Vec3::new(0.5, 1.5, 0.0);
        RigEdit::SetRest(joint.data.uid, rest)
    };
    let base = hand();
    let sided = with_fields("prefix: \"a_\", mirror: true,")(&base);
    let mut studio = merged_on_both_ways("side", [&part, &base, &sided], moved, "translation: (0.5, 1.5, ");
    let place =
        |studio: &Studio, label: &str| studio.base.rig().joint(studio.joint(label)).unwrap().data.rest.translation;
    let places = |studio: &Studio| [place(studio, "a_bone_2"), place(studio, "a_bone_3")];
    assert_eq!(places(&studio), [Vec3::new(-0.25, 1.0, 0.0), Vec3::new(0.5, 1.5, 0.0)]);
    // Taken back in the file, the side is the first one again.
    studio.save(&base);
    studio.until("the first side", |world, rig| {
        world.get::<RigSource>(rig).is_some_and(|source| source.taken_over().parts.iter().all(|part| !part.mirror))
    });
    assert_eq!(studio.instance_report().failed, Vec::<String>::new());
    assert_eq!(places(&studio), [Vec3::new(0.25, 1.0, 0.0), Vec3::new(0.5, 1.5, 0.0)]);
    // Undo brings the other side back.
    studio.base.change(Change::Undo);
    assert_eq!(places(&studio), [Vec3::new(-0.25, 1.0, 0.0), Vec3::new(0.5, 1.5, 0.0)]);
    assert!(studio.source().taken_over().parts.iter().all(|part| part.mirror));
}

#[cfg(feature = "cli")]
#[test]
fn an_option_is_merged_as_by_the_command_line() {
    check_merge("option", with_fields("prefix: \"a_\", options: {\"size\": 0.25},"));
}

#[cfg(feature = "cli")]
#[test]
fn a_feature_is_merged_as_by_the_command_line() {
    check_merge("feature", with_fields("prefix: \"a_\", off: [\"fk\"],"));
}

#[cfg(feature = "cli")]
#[test]
fn a_socket_is_merged_as_by_the_command_line() {
    let place = "            parent: \"palm\",\n            translation: (0, 0.1, 0),\n";
    check_merge("socket", |base| base.replace(place, "            socket: \"side\",\n"));
}

/// The command on a joint, with another size, and the joint.
#[cfg(feature = "cli")]
fn control_of(rig: &Rig, label: &str) -> (Uid, rigsmith::rig::TagData) {
    use rigsmith::rig::TagKind;

    let joint = rig.joint(rig.find_label(label).unwrap()).unwrap();
    let mut tag = joint.data.tags.first().unwrap().clone();
    let TagKind::Command { params, .. } = &mut tag.kind else { panic!("{label} has a command") };
    *params = "(relative_size: 0.9)".to_owned();
    (joint.data.uid, tag)
}
