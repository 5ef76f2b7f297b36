//! The list of a joint's tags tells what became of each command.

use std::fs;

use rigsmith::{
    editor::panels::{properties::PropertiesPanel, tags::TagsPanel},
    files::{RealDisk, load_template, store_rig_over},
    plugins::{
        commands::{BuildRequest, BuildStep},
        document::{Change, EditRequest},
    },
    rig::{Uid, template::read_template},
};

use super::desk::Desk;

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
    desk.app.world_mut().write_message(EditRequest { rig: desk.rig, change: Change::Undo });
    desk.frames(3);
    assert_eq!(*desk.rig(), before);
    assert!(!save(&desk).contains("parts"));
}
