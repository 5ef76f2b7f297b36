//! The hierarchy of joints: filter, names, drags, clicks and the menu of a row.

use super::*;

#[test]
fn the_filter_keeps_matches_and_what_is_above_them() {
    let mut desk = Desk::new(HierarchyPanel::default());
    let joints = desk.chain(&["hips", "spine", "Arm_L", "hand_L"]);
    desk.chain(&["tail"]);
    desk.edit(Operation::Group { joints: vec![joints[1]], name: "Trunk".into(), color: None });
    let cases: &[(&str, &[&str])] = &[
        ("", &["hips", "spine", "Arm_L", "hand_L", "tail"]),
        ("arm", &["hips", "spine", "Arm_L"]),
        ("trunk", &["hips", "spine"]),
        ("_l hand", &["hips", "spine", "Arm_L", "hand_L"]),
        ("TAIL", &["tail"]),
        ("nothing", &[]),
    ];
    for (filter, expected) in cases {
        let found = rows(desk.rig(), &HashSet::new(), filter);
        let labels: Vec<&str> = found.iter().map(|row| desk.label(row.joint)).collect();
        assert_eq!(labels, *expected, "{filter}");
    }
    let folded = rows(desk.rig(), &[joints[1]].into(), "");
    assert_eq!(folded.iter().map(|row| desk.label(row.joint)).collect::<Vec<_>>(), ["hips", "spine", "tail"]);

    // The same, typed.
    desk.click("Filter");
    desk.type_text("arm");
    desk.frames(2);
    assert!(desk.look("Arm_L").is_some() && desk.look("hips").is_some() && desk.look("tail").is_none());
    desk.click("Clear filter");
    desk.frames(2);
    assert!(desk.look("tail").is_some());
}

#[test]
fn the_filter_finds_joints_by_what_is_built_on_them() {
    let mut desk = Desk::new(HierarchyPanel::default());
    let joints = desk.chain(&["hips", "spine", "head"]);
    let kind = TagKind::Command { module: "space_switch".into(), params: "()".into(), feature: None };
    desk.edit(Operation::Tags(TagOperation::Add { joints: vec![joints[1]], kind, index: None }));
    let cases: &[(&str, &[&str])] =
        &[("Space", &["hips", "spine"]), ("space spine", &["hips", "spine"]), ("space head", &[])];
    for (filter, expected) in cases {
        let found = rows(desk.rig(), &HashSet::new(), filter);
        let labels: Vec<&str> = found.iter().map(|row| desk.label(row.joint)).collect();
        assert_eq!(labels, *expected, "{filter}");
    }
}

#[test]
fn rows_tell_their_tags() {
    let mut desk = Desk::new(HierarchyPanel::default());
    let [a, b, long] = desk.chain(&["a", "b", "a joint whose name takes all the room of its row and more"])[..] else {
        panic!()
    };
    for (joint, module) in [(b, "control"), (b, "null"), (b, "spring"), (long, "control"), (long, "null")] {
        let kind = TagKind::Command { module: module.into(), params: "()".into(), feature: None };
        desk.edit(Operation::Tags(TagOperation::Add { joints: vec![joint], kind, index: None }));
    }
    desk.select(&[a]);
    let tags = |desk: &Desk| -> Vec<String> {
        let told = desk.seen.iter().filter(|seen| seen.label.starts_with("Tags of "));
        told.map(|seen| seen.label.clone()).collect()
    };
    let of_long = format!("Tags of {}: control, null", desk.label(long));
    assert_eq!(tags(&desk), ["Tags of b: control, null, spring", of_long.as_str()]);
    // The number alone takes little from a long name.
    let (row, told) = (desk.find(desk.label(long)).rect, desk.find(&of_long).rect);
    assert!(told.width() < 0.1 * row.width() && row.contains_rect(told), "{told:?} {row:?}");
    let short = desk.find("Tags of b: control, null, spring").rect;
    assert!(short.width() > told.width() && short.width() < 0.4 * row.width(), "{short:?}");
    // A click there is one on the row.
    desk.click("Tags of b: control, null, spring");
    assert_eq!(desk.selected(), [b]);
    let tag = desk.rig().joint(b).unwrap().data.tags[1].uid;
    desk.edit(Operation::Tags(TagOperation::Enable(vec![tag], false)));
    assert!(desk.look("Tags of b: control, null (off), spring").is_some(), "{:?}", tags(&desk));
}

#[test]
fn joints_are_a_tree_or_a_list() {
    let mut desk = Desk::new(HierarchyPanel::default());
    let joints = desk.chain(&["hips", "spine", "Arm_L"]);
    desk.chain(&["tail"]);
    for (filter, expected) in
        [("", vec!["hips", "spine", "Arm_L", "tail"]), ("arm", vec!["Arm_L"]), ("nothing", vec![])]
    {
        let found = flat_rows(desk.rig(), filter);
        assert!(found.iter().all(|row| row.depth == 0 && !row.parent && row.matches), "{found:?}");
        let labels: Vec<&str> = found.iter().map(|row| desk.label(row.joint)).collect();
        assert_eq!(labels, expected, "{filter}");
    }
    let (before, steps) = (desk.rig().clone(), desk.steps());
    desk.click("Fold hips");
    desk.frames(2);
    assert!(desk.look("spine").is_none());
    desk.click("As a list");
    desk.frames(2);
    assert_eq!(desk.find("As a list").on, Some(true));
    assert!(desk.look("Arm_L").is_some() && desk.look("Fold hips").is_none() && desk.look("Fold all").is_none());
    desk.click("spine");
    desk.hold(Modifiers::SHIFT);
    desk.click("tail");
    desk.hold(Modifiers::NONE);
    let tail = desk.rig().walk().last().unwrap().data.uid;
    assert_eq!(desk.selected(), [joints[1], joints[2], tail]);
    desk.click("As a list");
    desk.frames(2);
    assert_eq!(desk.find("As a list").on, Some(false));
    assert!(desk.look("Fold all").is_some());
    assert_eq!((desk.rig(), desk.steps()), (&before, steps), "looking is no step");
}

#[test]
fn built_nodes_are_listed_and_lead_to_their_commands() {
    let mut desk = Desk::new(HierarchyPanel::default());
    let [a, b] = desk.chain(&["a", "b"])[..] else { panic!() };
    let kind = TagKind::Command { module: "control".into(), params: "()".into(), feature: None };
    desk.edit(Operation::Tags(TagOperation::Add { joints: vec![b], kind, index: None }));
    desk.app.world_mut().write_message(BuildRequest { rig: desk.rig, step: BuildStep::All });
    desk.frames(3);
    let steps = desk.steps();
    desk.secondary_click("a");
    desk.click("Show all built nodes");
    desk.frames(2);
    assert!(desk.look("a, joint").is_some() && desk.look("b, joint").is_some(), "{:?}", desk.seen);
    let control = desk.seen.iter().find(|seen| seen.label.ends_with(", control")).expect("the control").label.clone();
    desk.click(&control);
    desk.frames(2);
    let [node] = desk.selected() else { panic!("{:?}", desk.selected()) };
    assert!(![a, b].contains(node) && desk.find(&control).on == Some(true));
    desk.secondary_click(&control);
    desk.click("Show the command that made it");
    desk.frames(2);
    assert_eq!(desk.selected(), [b]);
    // With words it is a list.
    desk.click("Filter");
    desk.type_text("control");
    desk.frames(2);
    assert!(desk.look("a, joint").is_none() && desk.look(&control).is_some(), "{:?}", desk.seen);
    desk.click("Clear filter");
    desk.click("Joints");
    desk.frames(2);
    assert!(desk.look("a").is_some() && desk.look(&control).is_none(), "{:?}", desk.seen);
    assert_eq!(desk.steps(), steps, "looking is no step");
}

#[test]
fn nodes_of_one_rig_or_of_all_are_listed() {
    let mut desk = Desk::new(HierarchyPanel::default());
    let [hips, spine, _] = desk.chain(&["hips", "spine", "head"])[..] else { panic!() };
    assert!(desk.look("Listed hierarchy").is_none(), "there is one alone");
    let [_, tip] = desk.chain(&["tail", "tip"])[..] else { panic!() };
    for joint in [spine, tip] {
        let kind = TagKind::Command { module: "control".into(), params: "()".into(), feature: None };
        desk.edit(Operation::Tags(TagOperation::Add { joints: vec![joint], kind, index: None }));
    }
    desk.app.world_mut().write_message(BuildRequest { rig: desk.rig, step: BuildStep::All });
    desk.frames(3);
    let (before, steps) = (desk.rig().clone(), desk.steps());
    let choose = |desk: &mut Desk, entry: &str| {
        desk.click("Listed hierarchy");
        desk.frames(3);
        desk.click(entry);
        desk.frames(3);
    };
    let shows = |desk: &Desk| ["hips", "spine", "head", "tail", "tip"].map(|label| desk.look(label).is_some());
    assert_eq!(shows(&desk), [true; 5]);
    choose(&mut desk, "Only tail");
    assert_eq!(shows(&desk), [false, false, false, true, true]);
    // Of built nodes those stay that the commands of its joints made.
    let controls = |desk: &Desk| desk.seen.iter().filter(|seen| seen.label.ends_with(", control")).count();
    desk.click("Nodes");
    desk.frames(2);
    assert_eq!((controls(&desk), desk.look("spine, joint").is_some()), (1, false), "{:?}", desk.seen);
    assert!(desk.look("tip, joint").is_some(), "{:?}", desk.seen);
    choose(&mut desk, "All");
    assert_eq!((controls(&desk), desk.look("spine, joint").is_some()), (2, true), "{:?}", desk.seen);
    desk.click("Joints");
    desk.frames(2);
    assert_eq!(shows(&desk), [true; 5]);
    // Any joint can be the top, though one above it is folded.
    desk.secondary_click("spine");
    desk.click("List this hierarchy only");
    desk.frames(3);
    assert_eq!(shows(&desk), [false, true, true, false, false]);
    desk.secondary_click("head");
    desk.click("List everything");
    desk.frames(3);
    assert_eq!(shows(&desk), [true; 5]);
    desk.click("Fold hips");
    desk.frames(2);
    choose(&mut desk, "Only hips");
    assert_eq!(shows(&desk), [true, false, false, false, false]);
    assert_eq!((desk.rig(), desk.steps()), (&before, steps), "looking is no step");
    // Without the joint all are back.
    desk.edit(Operation::Delete { joints: vec![hips], keep_children: true });
    desk.frames(2);
    assert_eq!(shows(&desk), [false, true, true, true, true]);
}

#[test]
fn a_built_node_that_is_picked_comes_into_sight() {
    let mut desk = Desk::new(HierarchyPanel::default());
    let labels: Vec<String> = (0..80).map(|number| format!("joint_{number}")).collect();
    let joints = desk.chain(&labels.iter().map(String::as_str).collect::<Vec<_>>());
    let kind = TagKind::Command { module: "null".into(), params: "()".into(), feature: None };
    desk.edit(Operation::Tags(TagOperation::Add { joints: vec![joints[0]], kind, index: None }));
    desk.app.world_mut().write_message(BuildRequest { rig: desk.rig, step: BuildStep::All });
    desk.frames(3);
    desk.select(&[joints[0]]);
    desk.click("Nodes");
    desk.frames(3);
    assert!(desk.look("joint_0, joint").is_some() && desk.look("joint_79, joint").is_none(), "{:?}", desk.seen);
    desk.select(&[joints[79]]);
    desk.frames(3);
    assert_eq!(desk.find("joint_79, joint").on, Some(true));
    // The list stays where a person scrolls it to.
    desk.scroll(egui::pos2(150.0, 300.0), 5000.0);
    assert!(desk.look("joint_0, joint").is_some() && desk.look("joint_79, joint").is_none(), "{:?}", desk.seen);
}

#[test]
fn joints_are_renamed_in_place() {
    let mut desk = Desk::new(HierarchyPanel::default());
    let joints = desk.chain(&["a", "b", "c"]);
    let before = desk.steps().0;
    desk.double_click("b");
    assert_eq!(desk.selected(), [joints[1]]);
    desk.type_text("elbow");
    desk.key(Key::Enter);
    assert_eq!((desk.label(joints[1]), desk.steps().0), ("elbow", before + 1), "typing replaces the selected text");

    desk.click("a");
    desk.key(Key::F2);
    desk.type_text("dropped");
    desk.key(Key::Escape);
    assert_eq!((desk.label(joints[0]), desk.steps().0), ("a", before + 1), "Escape drops it");

    desk.key(Key::F2);
    desk.type_text("kept");
    desk.click("c");
    assert_eq!((desk.label(joints[0]), desk.steps().0), ("kept", before + 2), "a click elsewhere takes it");

    desk.key(Key::F2);
    desk.key(Key::Enter);
    assert_eq!(desk.steps().0, before + 2, "the same name is no step");
}

#[test]
fn drags_reparent_and_refuse_cycles() {
    let mut desk = Desk::new(HierarchyPanel::default());
    let [hips, spine, head] = desk.chain(&["hips", "spine", "head"])[..] else { panic!() };
    let [tail, tip] = desk.chain(&["tail", "tip"])[..] else { panic!() };
    let before = desk.steps().0;
    let at = |desk: &Desk, label: &str| desk.find(label).rect.center();

    let place = desk.rig().position(tail);
    desk.drag(at(&desk, "tail"), at(&desk, "hips"));
    assert_eq!((desk.parent(tail), desk.parent(tip), desk.steps().0), (Some(hips), Some(tail), before + 1));
    assert!(desk.rig().position(tail).distance(place) < 1e-5, "it stays where it is");

    desk.drag(at(&desk, "hips"), at(&desk, "head"));
    assert_eq!((desk.parent(hips), desk.steps().0), (None, before + 1));
    assert!(desk.told().last().is_some_and(|told| told.contains("hips cannot hang below head")), "{:?}", desk.told());

    desk.drag(at(&desk, "spine"), at(&desk, "spine") + egui::vec2(30.0, 1.0));
    assert_eq!(desk.steps().0, before + 1, "let go where it was");

    let below = desk.find("tip").rect.center() + egui::vec2(0.0, 300.0);
    desk.drag(at(&desk, "head"), below);
    assert_eq!((desk.parent(head), desk.steps().0), (None, before + 2), "the empty space makes roots");

    // What is selected goes along; what hangs below it anyway does not.
    desk.select(&[tip, tail, spine]);
    desk.drag(at(&desk, "tail"), at(&desk, "head"));
    assert_eq!([tip, tail, spine].map(|joint| desk.parent(joint)), [Some(tail), Some(head), Some(head)]);
    assert_eq!(desk.steps().0, before + 3);
}

#[test]
fn clicks_select_one_a_range_or_one_more() {
    let mut desk = Desk::new(HierarchyPanel::default());
    let joints = desk.chain(&["a", "b", "c", "d"]);
    desk.click("b");
    assert_eq!(desk.selected(), [joints[1]]);
    desk.hold(Modifiers::SHIFT);
    desk.click("d");
    assert_eq!(desk.selected(), [joints[1], joints[2], joints[3]], "the clicked one is active");
    desk.click("a");
    assert_eq!(desk.selected(), [joints[1], joints[0]], "a range begins where the last click was");
    desk.hold(Modifiers::COMMAND);
    desk.click("c");
    assert_eq!(desk.selected(), [joints[1], joints[0], joints[2]]);
    desk.click("a");
    assert_eq!(desk.selected(), [joints[1], joints[2]]);
    desk.hold(Modifiers::NONE);
    let steps = desk.steps();
    desk.key(Key::ArrowUp);
    assert_eq!(desk.selected(), [joints[1]], "the row above the active one");
    assert_eq!(desk.steps(), steps, "selecting is no step");

    // Both ways: what is selected elsewhere is unfolded and shown.
    desk.click("Fold all");
    desk.frames(2);
    assert!(desk.look("d").is_none());
    desk.select(&[joints[3]]);
    assert_eq!(desk.find("d").on, Some(true));

    // And the row under the pointer is the hovered joint.
    desk.move_to(desk.find("c").rect.center());
    desk.frames(2);
    assert_eq!(desk.app.world().get::<HoveredNode>(desk.rig), Some(&HoveredNode(Some(joints[2]))));
    desk.move_to(Pos2::new(150.0, 590.0));
    desk.frames(2);
    assert_eq!(desk.app.world().get::<HoveredNode>(desk.rig), Some(&HoveredNode(None)));
}

#[test]
fn the_menu_of_a_row_is_about_the_selection() {
    let mut desk = Desk::new(HierarchyPanel::default());
    let joints = desk.chain(&["a", "b", "c"]);
    let choose = |desk: &mut Desk, row: &str, entry: &str| {
        desk.secondary_click(row);
        desk.click(entry);
        desk.frames(2);
    };
    choose(&mut desk, "b", "Lock weights");
    assert_eq!(desk.selected(), [joints[1]]);
    assert!(desk.rig().joint(joints[1]).unwrap().data.locked);
    choose(&mut desk, "a", "Select hierarchy");
    assert_eq!(desk.selected(), [joints[1], joints[2], joints[0]]);
    desk.select(&[joints[1]]);
    choose(&mut desk, "b", "Delete");
    assert_eq!((desk.rig().len(), desk.parent(joints[2])), (2, Some(joints[0])));
    choose(&mut desk, "a", "Delete hierarchy");
    assert!(desk.rig().is_empty());
}
