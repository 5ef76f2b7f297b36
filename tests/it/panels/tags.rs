//! The list of a joint's tags tells what became of each command.

use std::{
    fs,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
};

use bevy::prelude::*;
use bevy_egui::egui;
use rigsmith::{
    editor::{
        panel::{EditorPanel, Requests},
        panels::{
            controls::ControlsPanel, hierarchy::HierarchyPanel, process::ProcessPanel, properties::PropertiesPanel,
            tags::TagsPanel,
        },
    },
    files::{RealDisk, load_template, store_rig_over},
    plugins::commands::{BuildRequest, BuildStep, Processor, RegisterRigModule},
    processor::{BuildScope, ModuleError, RigModule},
    rig::{
        RigEdit, TagData, TagKind, Uid,
        operations::{Operation, PasteContent, PasteTo, TagClipboard, TagOperation},
        template::read_template,
    },
};
use serde::{Deserialize, Deserializer, Serialize};

use super::desk::{Desk, Sheet};

/// Two panels, side by side.
struct Both(Box<dyn EditorPanel>, Box<dyn EditorPanel>);

impl Both {
    fn sheet(left: impl EditorPanel, right: impl EditorPanel) -> Sheet {
        Sheet::Panel(Box::new(Self(Box::new(left), Box::new(right))))
    }
}

impl EditorPanel for Both {
    fn title(&self) -> &'static str {
        "Both"
    }

    fn show(&mut self, ui: &mut egui::Ui, world: &World, requests: &mut Requests) {
        let Self(first, second) = self;
        ui.columns_const(|[left, right]| {
            first.show(left, world, requests);
            second.show(right, world, requests);
        });
    }
}

#[test]
fn a_failed_command_leads_to_its_card_and_commands_to_what_they_made() {
    let sheet = Both::sheet(ProcessPanel::default(), TagsPanel::default());
    let mut desk = Desk::with(sheet, egui::vec2(900.0, 900.0));
    let [a, b] = desk.chain(&["a", "b"])[..] else { panic!() };
    let add = |desk: &mut Desk, joint: Uid, module: &str, params: &str| {
        let kind = TagKind::Command { module: module.into(), params: params.into(), feature: None };
        desk.edit(Operation::Tags(TagOperation::Add { joints: vec![joint], kind, index: None }));
    };
    add(&mut desk, a, "control", "()");
    add(&mut desk, b, "null", "(oops: 1)");
    desk.select(&[]);
    desk.app.world_mut().write_message(BuildRequest { rig: desk.rig, step: BuildStep::All });
    desk.frames(3);
    let wrong = desk.rig().joint(b).unwrap().data.tags[0].uid;
    let status = desk.app.world().get::<Processor>(desk.rig).unwrap().builder().status(wrong).unwrap();
    let reason = status.error.expect("it fails").to_string();
    assert!(!desk.says(&reason), "{:?}", desk.seen);
    let row = |desk: &Desk, name: &str| {
        let found = desk.seen.iter().find(|seen| seen.label.starts_with(name));
        found.unwrap_or_else(|| panic!("{name} is not among {:?}", desk.seen)).label.clone()
    };
    let failed = row(&desk, "b null failed");
    desk.click(&failed);
    // Away from the row, over which the reason is, too.
    desk.move_to(egui::pos2(890.0, 890.0));
    desk.frames(4);
    assert_eq!(desk.selected(), [b]);
    assert!(desk.says(&reason), "the card is open: {:?}", desk.seen);
    // What runs is only selected, and leads to what it made.
    let built = row(&desk, "a control built");
    desk.click(&built);
    desk.frames(2);
    assert_eq!(desk.selected(), [a]);
    desk.secondary_click(&built);
    desk.click("Select what it made");
    desk.frames(2);
    let control = desk.selected().to_vec();
    assert!(!control.is_empty() && !control.contains(&a), "{control:?}");
}

#[test]
fn a_failed_command_leads_to_the_field_at_fault() {
    let height = 240.0;
    let sheet = Both::sheet(ProcessPanel::default(), TagsPanel::default());
    let mut desk = Desk::with(sheet, egui::vec2(900.0, height));
    let [a, b] = desk.chain(&["a", "b"])[..] else { panic!() };
    let params = |direction: &str| format!("(targets: \"@joint a#{a}\", direction: {direction})");
    let kind = TagKind::Command { module: "aim".into(), params: params("(0.0, 0.0, 0.0)"), feature: None };
    desk.edit(Operation::Tags(TagOperation::Add { joints: vec![b], kind, index: None }));
    let tag = desk.rig().joint(b).unwrap().data.tags[0].uid;
    desk.select(&[]);
    desk.app.world_mut().write_message(BuildRequest { rig: desk.rig, step: BuildStep::All });
    desk.frames(3);
    let marks = |desk: &Desk| -> Vec<String> {
        let marks = desk.seen.iter().filter(|seen| seen.label.ends_with(" is wrong"));
        marks.map(|seen| seen.label.clone()).collect()
    };
    assert!(marks(&desk).is_empty(), "{:?}", marks(&desk));
    let failed = desk.seen.iter().find(|seen| seen.label.starts_with("b aim failed"));
    let failed = failed.unwrap_or_else(|| panic!("no failed command in {:?}", desk.seen)).label.clone();
    desk.click(&failed);
    desk.frames(60);
    assert_eq!(desk.selected(), [b]);
    assert_eq!(marks(&desk), ["Direction is wrong"]);
    let field = desk.find("Direction is wrong").rect;
    assert!(field.top() > 0.0 && field.bottom() < height, "the field is in sight: {field:?}");
    // Once it is mended, nothing is marked.
    desk.edit(Operation::Tags(TagOperation::Params(vec![(tag, params("(0.0, 1.0, 0.0)"))])));
    desk.frames(5);
    assert!(marks(&desk).is_empty(), "{:?}", marks(&desk));
}

#[test]
fn tags_are_listed_with_what_became_of_them() {
    let mut desk = Desk::new(PropertiesPanel::default());
    desk.resize(320.0, 1200.0);
    let text = r#"(format: 1, uid: "0000000000000001", name: "n", joints: [(uid: "0000000000000002", label: "a",
        translation: (0.0, 1.0, 0.0), tags: [
        Command(uid: "000000000000000a", module: "control", params: ()),
        Command(uid: "000000000000000b", module: "contrl", params: ()),
    ])])"#;
    let rig = read_template(text.as_bytes()).unwrap().rig;
    let entity = desk.rig;
    desk.app.world_mut().entity_mut(entity).insert(rig);
    desk.select(&[Uid(2)]);
    desk.frames(2);
    let labels: Vec<&str> = desk.seen.iter().map(|seen| seen.label.as_str()).collect();
    assert!(desk.says("Tags") && !desk.says("failed"), "{labels:?}");
    desk.app.world_mut().write_message(BuildRequest { rig: entity, step: BuildStep::All });
    desk.frames(3);
    assert!(desk.says("built") && desk.says("failed"));

    let steps = desk.steps().0;
    desk.click("control");
    desk.frames(3);
    assert_eq!(desk.steps().0, steps + 1);
    let is_on = |desk: &Desk| desk.rig().find_tag(Uid(10)).unwrap().1.enabled;
    assert!(!is_on(&desk) && desk.says("passed over"));
    desk.click("control");
    desk.frames(3);
    assert!(is_on(&desk) && !desk.says("passed over"));
}

#[test]
fn a_module_is_dragged_onto_a_joint() {
    let sheet = Both::sheet(HierarchyPanel::default(), TagsPanel::default());
    let mut desk = Desk::with(sheet, egui::vec2(900.0, 900.0));
    let [a, b] = desk.chain(&["a", "b"])[..] else { panic!() };
    desk.select(&[a]);
    let (before, steps) = (desk.rig().clone(), desk.steps().1);
    desk.click("+ Add");
    desk.frames(3);
    desk.type_text("null");
    desk.frames(3);
    let (null, row) = (desk.find("null").rect, desk.find("b").rect);
    assert!(!null.x_range().contains(row.center().x), "the library lies over the joints: {null:?} {row:?}");
    desk.drag(null.center(), row.center());
    desk.frames(3);
    assert!(desk.modules(a).is_empty(), "{:?}", desk.modules(a));
    assert_eq!(desk.modules(b), ["null"], "{:?}", desk.told());
    assert_eq!(desk.steps().1, steps + 1);
    desk.undo(1);
    assert_eq!(*desk.rig(), before);
}

#[test]
fn modules_are_found_by_words_and_enter_adds_the_first() {
    let mut desk = Desk::new(TagsPanel::default());
    desk.resize(400.0, 900.0);
    let [a, _] = desk.chain(&["a", "b"])[..] else { panic!() };
    desk.select(&[a]);
    desk.click("+ Add");
    desk.frames(3);
    assert!(desk.look("null").is_some() && desk.look("control").is_some(), "{:?}", desk.seen);
    desk.type_text("no such module");
    desk.frames(3);
    assert!(desk.says("No module is called so.") && desk.look("control").is_none(), "{:?}", desk.seen);
    desk.hold(egui::Modifiers::COMMAND);
    desk.key(egui::Key::A);
    desk.hold(egui::Modifiers::NONE);
    desk.type_text("null");
    desk.frames(3);
    desk.key(egui::Key::Enter);
    desk.frames(3);
    assert_eq!(desk.modules(a), ["null"], "{:?}", desk.told());
}

#[test]
fn a_card_is_dragged_into_a_feature_and_its_switch() {
    let sheet = Both::sheet(ControlsPanel::default(), TagsPanel::default());
    let mut desk = Desk::with(sheet, egui::vec2(900.0, 900.0));
    let [a, _] = desk.chain(&["a", "b"])[..] else { panic!() };
    let feature = |switch: &str| TagKind::Feature {
        kind: "feature".into(),
        name: "arm".into(),
        switch: switch.into(),
        choice: String::new(),
    };
    let null = TagKind::Command { module: "null".into(), params: "()".into(), feature: None };
    for kind in [feature(""), feature("soft"), null] {
        desk.edit(Operation::Tags(TagOperation::Add { joints: vec![a], kind, index: None }));
    }
    let [arm, soft, command] = desk.rig().joint(a).unwrap().data.tags.iter().map(|tag| tag.uid).collect::<Vec<_>>()[..]
    else {
        panic!()
    };
    desk.select(&[a]);
    desk.click("Features");
    desk.frames(30);
    let owner = |desk: &Desk| match &desk.rig().find_tag(command).unwrap().1.kind {
        TagKind::Command { feature, .. } => *feature,
        TagKind::Feature { .. } => panic!("it is a command"),
    };
    let onto = |desk: &mut Desk, dragged: &str, name: &str| {
        let (from, to) = (desk.find(dragged).rect.center(), desk.find(name).rect.center());
        desk.drag(from, to);
        desk.frames(3);
    };
    let (before, steps) = (desk.rig().clone(), desk.steps().1);
    onto(&mut desk, "Drag null", "soft");
    assert_eq!((owner(&desk), desk.steps().1), (Some(soft), steps + 1), "{:?}", desk.told());
    onto(&mut desk, "Drag null", "soft");
    assert_eq!(desk.steps().1, steps + 1, "it is there already");
    onto(&mut desk, "Drag null", "arm");
    assert_eq!((owner(&desk), desk.steps().1), (Some(arm), steps + 2), "{:?}", desk.told());
    onto(&mut desk, "Drag feature arm", "soft");
    assert_eq!(desk.steps().1, steps + 2, "a feature is no command");
    desk.undo(2);
    assert_eq!(*desk.rig(), before);
}

#[test]
fn what_an_operation_notes_is_told_once_it_is_done() {
    let mut desk = Desk::new(TagsPanel::default());
    let [a, b, c] = desk.chain(&["a", "b", "c"])[..] else { panic!() };
    let kind = TagKind::Command { module: "null".into(), params: "()".into(), feature: None };
    desk.edit(Operation::Tags(TagOperation::Add { joints: vec![a, b], kind, index: None }));
    let tags: Vec<Uid> = desk.rig().walk().flat_map(|joint| &joint.data.tags).map(|tag| tag.uid).collect();
    let clipboard = Arc::new(TagClipboard::copy_tags(desk.rig(), &tags).unwrap());
    let paste = |to: PasteTo| {
        let clipboard = Arc::clone(&clipboard);
        Operation::Tags(TagOperation::Paste { clipboard, what: PasteContent::Both, to })
    };
    let is_told = |desk: &Desk| desk.told().iter().filter(|told| told.contains("left over")).count();
    // A refused one notes nothing.
    let steps = desk.steps();
    desk.edit(paste(PasteTo::Joints(vec![Uid(404)])));
    assert_eq!((desk.steps(), is_told(&desk)), (steps, 0), "{:?}", desk.told());
    desk.edit(paste(PasteTo::Joints(vec![c])));
    let told = "1 copied joint is left over: the selection has only 1.";
    assert!(desk.told().iter().any(|known| known == told), "{:?}", desk.told());
    // Undo tells nothing again.
    desk.undo(1);
    assert_eq!((desk.steps().1, is_told(&desk)), (steps.1, 1), "{:?}", desk.told());
}

#[test]
fn a_part_that_is_added_stays_a_part() {
    let mut desk = Desk::new(TagsPanel::default());
    desk.resize(400.0, 1200.0);
    let joints = desk.chain(&["horn_1", "horn_2", "horn_3"]);
    desk.select(&[joints[0]]);
    desk.frames(2);
    let (before, steps) = (desk.rig().clone(), desk.steps().0);
    desk.click("Part");
    desk.until("the list of parts", |desk| desk.look("Part fk chain").is_some());
    // The search brings the tile to the top: a row that is partly scrolled out of sight cannot be clicked in its middle.
    desk.click("Search templates");
    desk.type_text("fk chain");
    desk.frames(3);
    desk.click("Part fk chain");
    desk.until("the part", |desk| desk.steps().0 > steps);
    assert_eq!(desk.steps().0, steps + 1, "{:?}", desk.told());
    let [part] = desk.rig().dropped_parts() else { panic!("{:?}", desk.rig().dropped_parts()) };
    assert_eq!((part.part.as_str(), &part.joints), ("parts/fk_chain.rig.ron", &joints));
    // The file names the part, and reads as the rig in the window.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("horn.rig.ron");
    let save = |desk: &Desk| -> String {
        assert_eq!(store_rig_over(&RealDisk, &path, desk.rig(), &[&path]).unwrap(), Vec::<String>::new());
        fs::read_to_string(&path).unwrap()
    };
    let text = save(&desk);
    let line = "(part: \"parts/fk_chain.rig.ron\", onto: [\"horn_1\", \"horn_2\", \"horn_3\"])";
    assert!(text.contains(line) && !text.contains("Command"), "{text}");
    assert_eq!(load_template(&RealDisk, &path).unwrap().instances.len(), 1);
    // Undo takes it out of the rig and, with the next save, out of the file.
    desk.undo(1);
    assert_eq!(*desk.rig(), before);
    assert!(!save(&desk).contains("parts"));
}

/// Number of times that parameters of [`Counted`] were read.
static READS: AtomicUsize = AtomicUsize::new(0);

/// A module that counts how often its parameters are read.
#[derive(Reflect, Serialize, Deserialize, Debug, Clone, Default)]
#[serde(default, deny_unknown_fields)]
struct Counted {
    #[serde(deserialize_with = "counted")]
    size: f32,
}

fn counted<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f32, D::Error> {
    READS.fetch_add(1, Ordering::Relaxed);
    f32::deserialize(deserializer)
}

impl RigModule for Counted {
    const NAME: &'static str = "counted";
    const DOC: &'static str = "Counts how often it is read.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = &[("size", "A number.")];

    fn construct(&self, _scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        Ok(())
    }
}

#[test]
fn open_cards_read_their_values_only_when_they_change() {
    let mut desk = Desk::new(TagsPanel::default());
    desk.resize(400.0, 1200.0);
    desk.app.register_rig_module::<Counted>();
    let joints = desk.chain(&["a", "b"]);
    let tag = |uid: u64, params: &str| TagData {
        uid: Uid(uid),
        enabled: true,
        comment: String::new(),
        kind: TagKind::Command { module: "counted".to_owned(), feature: None, params: params.to_owned() },
    };
    let add = |joint: Uid, tag: TagData| RigEdit::AddTag { joint, tag: Box::new(tag), index: usize::MAX };
    let edits = vec![add(joints[0], tag(0xa1, "(size: 2.5)")), add(joints[1], tag(0xa2, "(size: 2.5)"))];
    desk.edit(Operation::Edits(edits));
    desk.select(&joints);
    let reads = |desk: &mut Desk, frames: usize| {
        let before = READS.load(Ordering::Relaxed);
        desk.frames(frames);
        READS.load(Ordering::Relaxed) - before
    };
    let shows = |desk: &Desk, value: &str| desk.seen.iter().any(|seen| seen.value == value);
    assert!(!shows(&desk, "2.5"), "the card is closed");
    desk.click("Values of counted");
    desk.frames(5);
    assert!(shows(&desk, "2.5"), "{:?}", desk.seen);
    assert_eq!(reads(&mut desk, 40), 0, "nothing changes");
    // Of another joint nothing is read again.
    desk.edit(Operation::Labels(vec![(joints[1], "c".to_owned())]));
    desk.frames(5);
    assert_eq!(reads(&mut desk, 40), 0, "a name changes");
    let before = READS.load(Ordering::Relaxed);
    desk.edit(Operation::Tags(TagOperation::Params(vec![(Uid(0xa1), "(size: 3.5)".to_owned())])));
    desk.frames(5);
    assert!(READS.load(Ordering::Relaxed) > before && shows(&desk, "mixed"), "{:?}", desk.seen);
    desk.edit(Operation::Tags(TagOperation::Params(vec![(Uid(0xa2), "(size: 3.5)".to_owned())])));
    desk.frames(5);
    assert!(shows(&desk, "3.5"), "{:?}", desk.seen);
    assert_eq!(reads(&mut desk, 40), 0, "nothing changes");
    // Parameters that cannot be read are told, and not read again and again either.
    desk.edit(Operation::Tags(TagOperation::Params(vec![(Uid(0xa2), "(size: 3.5, width: 1)".to_owned())])));
    desk.frames(5);
    assert!(desk.seen.iter().any(|seen| seen.label.contains("line 1") || seen.value.contains("line 1")));
    assert_eq!(reads(&mut desk, 40), 0, "nothing changes");
}
