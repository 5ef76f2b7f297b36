//! Local groups: made and reset by the selection, by hierarchies and for the whole rig.

use bevy_egui::egui::Key;
use rigsmith::{
    editor::panels::local_groups::GroupsPanel,
    rig::operations::{Operation, merged_groups},
};

use super::{
    desk::Desk,
    tag_values::{add_command, params_of},
};

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

/// A desk with two joints in groups of those names.
fn grouped(names: [&str; 2]) -> Desk {
    let mut desk = Desk::new(GroupsPanel::default());
    let joints = desk.chain(&["hips", "spine"]);
    for (joint, name) in joints.iter().zip(names) {
        desk.edit(Operation::Group { joints: vec![*joint], name: name.to_owned(), color: None });
    }
    desk.frames(3);
    desk
}

#[test]
fn a_group_takes_no_name_of_another() {
    let mut desk = grouped(["arm", "armx"]);
    let steps = desk.steps().0;
    let type_behind = |desk: &mut Desk, text: &str| {
        desk.double_click("arm");
        desk.frames(2);
        desk.type_text(text);
        desk.key(Key::Enter);
        desk.frames(3);
    };
    type_behind(&mut desk, "x");
    assert_eq!((groups(&desk), desk.steps().0), (["arm", "armx"].map(String::from).to_vec(), steps));
    assert!(desk.told().iter().any(|told| told.contains("called \"armx\"")), "{:?}", desk.told());
    type_behind(&mut desk, "y");
    assert_eq!((groups(&desk), desk.steps().0), (["army", "armx"].map(String::from).to_vec(), steps + 1));
}

#[test]
fn commands_that_name_a_group_name_the_one_that_it_was_merged_into() {
    let mut desk = grouped(["arm", "leg"]);
    let [arm, leg] = [0, 1].map(|at| desk.rig().groups()[at].uid);
    let hips = desk.rig().walk().next().unwrap().data.uid;
    let tag = add_command(&mut desk, hips, "null", &format!("(at: \"@joints group:arm#{arm}\")"));
    let other = add_command(&mut desk, hips, "null", &format!("(at: \"@joints group:leg#{leg}\")"));
    let (before, steps) = (desk.rig().clone(), desk.steps().0);
    let edits = merged_groups(desk.rig(), arm, leg);
    assert_eq!(edits.len(), 3, "a joint, a command and the group: {edits:?}");
    desk.edit(Operation::Named { name: "Merge groups", edits });
    assert_eq!((groups(&desk), desk.rig().groups().len()), (vec!["leg".to_owned(); 2], 1));
    assert_eq!(params_of(&desk, tag), params_of(&desk, other));
    assert_eq!(desk.steps().0, steps + 1);
    desk.undo(1);
    assert_eq!(*desk.rig(), before);
    assert!(merged_groups(&before, arm, arm).is_empty() && merged_groups(&before, hips, leg).is_empty());
}
