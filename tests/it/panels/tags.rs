//! The list of a joint's tags tells what became of each command.

use rigsmith::{
    editor::panels::properties::PropertiesPanel,
    plugins::commands::{BuildRequest, BuildStep},
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
