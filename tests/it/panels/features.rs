//! The Controls panel lists the features of the rig, with their groups, switches and choices.

use rigsmith::{
    editor::panels::controls::ControlsPanel,
    files::{RealDisk, load_template},
    plugins::commands::BuildResult,
    rig::feature::combined_features,
};

use super::desk::Desk;

#[test]
fn features_switches_and_choices_are_turned_by_a_click() {
    let mut desk = Desk::new(ControlsPanel::default());
    desk.resize(320.0, 1600.0);
    let file = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/templates/parts/ikfk_chain.rig.ron"));
    let rig = load_template(&RealDisk, file).unwrap().rig;
    let entity = desk.rig;
    desk.app.world_mut().entity_mut(entity).insert(rig);
    desk.frames(3);
    desk.click("Features");
    desk.frames(30);
    for name in ["chain", "ik", "space", "fabrik", "ccd"] {
        assert!(
            desk.look(name).is_some(),
            "{name}: {:?}",
            desk.seen.iter().map(|seen| &seen.label).collect::<Vec<_>>()
        );
    }
    let is_on = |desk: &Desk, switch: &str| {
        let features = combined_features(desk.rig());
        features[0].active_switches().any(|active| active == switch)
    };
    assert!(is_on(&desk, "fabrik") && !is_on(&desk, "ccd"));
    let (steps, bytes) = (desk.steps().0, rigsmith::rig::template::write_template(desk.rig()));

    desk.click("ccd");
    desk.frames(3);
    assert!(!is_on(&desk, "fabrik") && is_on(&desk, "ccd"), "a choice has one switch on");
    assert_eq!(desk.steps().0, steps + 1);
    desk.click("ccd");
    desk.frames(3);
    assert_eq!(desk.steps().0, steps + 1, "the chosen switch stays");

    desk.click("ik");
    desk.frames(3);
    assert!(!is_on(&desk, "ccd"));
    desk.click("ik");
    desk.frames(3);
    desk.click("chain");
    desk.frames(3);
    assert!(desk.rig().groups().iter().all(|group| !group.enabled));
    desk.click("chain");
    desk.frames(3);
    desk.click("fabrik");
    desk.frames(3);
    assert_eq!(rigsmith::rig::template::write_template(desk.rig()), bytes, "there and back");
    assert!(desk.app.world().get::<BuildResult>(entity).is_none(), "the panel itself builds nothing");
}
