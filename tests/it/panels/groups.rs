//! Local groups: made and reset by the selection, by hierarchies and for the whole rig.

use rigsmith::editor::panels::local_groups::GroupsPanel;

use super::desk::Desk;

/// Names of the groups of all joints.
fn groups(desk: &Desk) -> Vec<String> {
    let rig = desk.rig();
    let name = |group| rig.group(group).map_or_else(String::new, |group| group.name.clone());
    rig.walk().map(|joint| joint.data.group.map_or_else(String::new, name)).collect()
}

fn choose(desk: &mut Desk, joints: &str) {
    desk.click("Joints of the change");
    desk.frames(3);
    desk.click(joints);
    desk.frames(3);
}

#[test]
fn groups_are_made_and_reset_by_selection_hierarchy_and_all() {
    let mut desk = Desk::new(GroupsPanel::default());
    let [hips, _, head] = desk.chain(&["hips", "spine", "head"])[..] else { panic!() };
    desk.chain(&["tail"]);
    let create = |desk: &mut Desk, name: &str| {
        desk.click("New group");
        desk.type_text(name);
        desk.click("Create");
        desk.frames(3);
    };
    let (before, steps) = (desk.rig().clone(), desk.steps().1);
    desk.select(&[hips]);
    assert!(!desk.find("Reset").enabled, "nothing is in a group");
    choose(&mut desk, "Selected and below");
    create(&mut desk, "body");
    assert_eq!(groups(&desk), ["body", "body", "body", ""]);
    choose(&mut desk, "Selected joints");
    desk.select(&[head]);
    create(&mut desk, "skull");
    assert_eq!((groups(&desk), desk.steps().1), (["body", "body", "skull", ""].map(String::from).to_vec(), steps + 2));
    // Resetting takes joints out of whatever group they are in.
    desk.click("Reset");
    desk.frames(3);
    assert_eq!(groups(&desk), ["body", "body", "", ""]);
    assert!(desk.look("Remove 1 empty").is_some() && !desk.find("Reset").enabled, "{:?}", desk.seen);
    choose(&mut desk, "All joints");
    desk.click("Reset");
    desk.frames(3);
    assert_eq!((groups(&desk), desk.steps().1), (vec![String::new(); 4], steps + 4));
    desk.select(&[]);
    create(&mut desk, "all");
    assert_eq!(groups(&desk), ["all"; 4], "all joints need no selection");
    desk.click("Remove 2 empty");
    desk.frames(3);
    let names: Vec<&str> = desk.rig().groups().iter().map(|group| group.name.as_str()).collect();
    assert_eq!((names, desk.steps().1), (vec!["all"], steps + 6));
    desk.undo(6);
    assert_eq!(*desk.rig(), before);
}
