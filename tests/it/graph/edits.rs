//! Wires that are connected, removed and broken by a command: one step each, or refused with the reason.

use super::*;

/// Middle of a wire between two pins.
fn middle_of(desk: &Desk, from: &str, to: &str) -> Pos2 {
    pin(desk, from).lerp(pin(desk, to), 0.5)
}

/// Undoes one step, after which the rig has these bytes.
#[track_caller]
fn undone(desk: &mut Desk, before: &str, steps: usize) {
    assert_eq!(desk.steps().1, steps + 1, "{:?}", desk.told());
    assert_ne!(bytes(desk), before);
    desk.undo(1);
    assert_eq!((bytes(desk).as_str(), desk.steps().1), (before, steps));
}

#[test]
fn a_wire_sets_the_parameter_that_it_is_dropped_on() {
    let (mut desk, _, [control, middle, last]) = opened();
    let (before, steps) = (bytes(&desk), desk.steps().1);
    let ends = |desk: &Desk| (pin(desk, "Control · a: output"), pin(desk, "Null · c: parent"));
    let (from, to) = ends(&desk);
    desk.drag(from, to);
    desk.frames(3);
    assert_eq!(referred(&desk, last), [control], "{:?}", desk.told());
    let TagKind::Command { params, .. } = &desk.rig().find_tag(last).unwrap().1.kind else { unreachable!() };
    assert!(params.contains("parent") && params.contains("control"), "the name stands beside the uid: {params}");
    undone(&mut desk, &before, steps);
    settle(&mut desk);

    // From the input backwards, and besides what is there.
    let (from, to) = ends(&desk);
    desk.drag(to, from);
    desk.frames(3);
    settle(&mut desk);
    assert_eq!(referred(&desk, last), [control]);
    desk.hold(Modifiers::SHIFT);
    let (from, to) = (pin(&desk, "Null · b: output"), pin(&desk, "Null · c: parent"));
    desk.drag(from, to);
    desk.hold(Modifiers::NONE);
    desk.frames(3);
    assert_eq!(referred(&desk, last), [control, middle], "{:?}", desk.told());
}

#[test]
fn wires_that_make_no_sense_are_refused_with_the_reason() {
    let (mut desk, _, _) = opened();
    let (before, steps) = (bytes(&desk), desk.steps());
    let title = node(&desk, "Null · c").rect.center_top() + egui::vec2(0.0, 12.0);
    let cases = [
        ("Null · c: output", pin(&desk, "Null · b: at"), "runs before"),
        ("Null · b: output", pin(&desk, "Null · b: parent"), "cannot refer to what it makes itself"),
        ("Control · a: output", title, "takes references as at, parent"),
    ];
    for (from, to, reason) in cases {
        let from = pin(&desk, from);
        desk.drag(from, to);
        desk.frames(3);
        assert!(desk.told().last().is_some_and(|told| told.contains(reason)), "{reason}: {:?}", desk.told());
        assert_eq!((bytes(&desk), desk.steps()), (before.clone(), steps));
    }
    let (told, from) = (desk.told().len(), pin(&desk, "Control · a: output"));
    desk.drag(from, GROUND);
    assert_eq!((bytes(&desk), desk.told().len()), (before, told), "let go over nothing");
}

#[test]
fn a_wire_is_removed_where_a_reference_makes_it() {
    let (mut desk, [_, _, c], [_, middle, _]) = opened();
    let (before, steps) = (bytes(&desk), desk.steps().1);
    let at = middle_of(&desk, "Control · a: output", "Null · b: at");
    desk.secondary_click_at(at);
    choose(&mut desk, "Remove reference");
    assert!(referred(&desk, middle).is_empty());
    undone(&mut desk, &before, steps);

    // A reference that means more than one command stays.
    desk.edit(Operation::Tags(TagOperation::Enable(vec![middle], false)));
    let broad = add(&mut desk, c, "null", "(at: \"@module control\")");
    desk.edit(Operation::Tags(TagOperation::Comment(broad, "broad".into())));
    desk.edit(Operation::Labels(vec![(c, "hand".into())]));
    desk.edit(Operation::Tags(TagOperation::Delete(vec![middle])));
    settle(&mut desk);
    let before = bytes(&desk);
    let pins: Vec<Pos2> =
        desk.seen.iter().filter(|seen| seen.label == "Null · hand: at").map(|seen| seen.rect.center()).collect();
    let from = pin(&desk, "Control · a: output");
    // Of the two nulls the one that reads stands right of the control.
    let to = pins.into_iter().max_by(|a, b| a.x.total_cmp(&b.x)).unwrap();
    desk.secondary_click_at(from.lerp(to, 0.5));
    choose(&mut desk, "Remove reference");
    assert!(desk.told().last().is_some_and(|told| told.contains("means more than that")), "{:?}", desk.told());
    assert_eq!(bytes(&desk), before);
}

/// Chooses a module in the library of a wire's menu.
fn insert(desk: &mut Desk, at: Pos2, module: &str) {
    desk.secondary_click_at(at);
    choose(desk, "Insert command");
    desk.type_text(module);
    desk.key(egui::Key::Enter);
    desk.frames(3);
}

#[test]
fn a_command_is_inserted_into_a_wire() {
    let (mut desk, [a, _, _], [control, middle, _]) = opened();
    let (before, steps) = (bytes(&desk), desk.steps().1);
    let at = middle_of(&desk, "Control · a: output", "Null · b: at");
    insert(&mut desk, at, "null");
    let tags: Vec<Uid> = desk.rig().joint(a).unwrap().data.tags.iter().map(|tag| tag.uid).collect();
    let [first, inserted] = tags[..] else { panic!("{tags:?}: {:?}", desk.told()) };
    assert_eq!((first, referred(&desk, inserted), referred(&desk, middle)), (control, vec![control], vec![inserted]));
    desk.frames(3);
    assert!(desk.seen.iter().all(|seen| !seen.label.ends_with(", failed")), "{:?}", desk.seen);
    undone(&mut desk, &before, steps);
    settle(&mut desk);

    // A module that makes no nodes stands between the two, and the reference stays.
    let at = middle_of(&desk, "Control · a: output", "Null · b: at");
    insert(&mut desk, at, "limit");
    assert_eq!(referred(&desk, middle), [control]);
    let told = desk.told();
    assert!(told.iter().any(|told| told.contains("still refers to Control · a")), "{told:?}");
    undone(&mut desk, &before, steps);
}

#[test]
fn the_menu_of_a_node_adds_turns_off_and_deletes() {
    let (mut desk, [a, b, _], [control, middle, _]) = opened();
    let (before, steps) = (bytes(&desk), desk.steps().1);
    let menu = |desk: &mut Desk, name: &str, entry: &str| {
        let at = node(desk, name).rect.center();
        desk.secondary_click_at(at);
        choose(desk, entry);
    };
    menu(&mut desk, "Null · b", "Selected commands on or off");
    assert!(!desk.rig().find_tag(middle).unwrap().1.enabled);
    undone(&mut desk, &before, steps);
    menu(&mut desk, "Null · b", "Delete the selected commands");
    assert!(desk.rig().joint(b).unwrap().data.tags.is_empty());
    undone(&mut desk, &before, steps);
    settle(&mut desk);
    menu(&mut desk, "Control · a", "Add command behind");
    desk.type_text("null");
    desk.key(egui::Key::Enter);
    desk.frames(3);
    let tags = &desk.rig().joint(a).unwrap().data.tags;
    assert_eq!((tags.len(), tags[0].uid), (2, control));
    undone(&mut desk, &before, steps);
}

#[test]
fn a_module_is_dropped_on_a_wire() {
    let (mut desk, [a, _, c], [control, middle, _]) = opened();
    desk.select(&[c]);
    settle(&mut desk);
    let (before, steps) = (bytes(&desk), desk.steps().1);
    desk.click("+ Add");
    desk.frames(3);
    desk.type_text("null");
    desk.frames(3);
    let (from, to) = (desk.find("null").rect.center(), middle_of(&desk, "Control · a: output", "Null · b: at"));
    desk.drag(from, to);
    desk.frames(3);
    let tags: Vec<Uid> = desk.rig().joint(a).unwrap().data.tags.iter().map(|tag| tag.uid).collect();
    let [_, inserted] = tags[..] else { panic!("{tags:?}: {:?}", desk.told()) };
    assert_eq!((referred(&desk, inserted), referred(&desk, middle)), (vec![control], vec![inserted]));
    undone(&mut desk, &before, steps);
}

#[test]
fn features_are_frames_with_a_switch() {
    let (mut desk, [a, _, _], [_, middle, _]) = opened();
    let [kind, name, switch, choice] = ["feature", "arm", "", ""].map(str::to_owned);
    let kind = TagKind::Feature { kind, name, switch, choice };
    desk.edit(Operation::Tags(TagOperation::Add { joints: vec![a], kind, index: None }));
    let tags = &desk.rig().joint(a).unwrap().data.tags;
    let feature = tags.iter().find(|tag| matches!(tag.kind, TagKind::Feature { .. })).unwrap().uid;
    let title = |desk: &Desk| node(desk, "Null · b").rect.left_top() + egui::vec2(60.0, -20.0);
    settle(&mut desk);
    // Without commands of its own a feature is no frame.
    let at = title(&desk);
    desk.secondary_click_at(at);
    assert!(desk.seen.iter().all(|seen| !seen.label.starts_with("Turn arm")), "{:?}", desk.seen);
    desk.click_at(GROUND);
    desk.edit(Operation::Tags(TagOperation::Attach(vec![middle], Some(feature))));
    settle(&mut desk);
    let (before, steps) = (bytes(&desk), desk.steps().1);
    let at = title(&desk);
    desk.secondary_click_at(at);
    choose(&mut desk, "Turn arm off");
    assert!(!desk.rig().find_tag(feature).unwrap().1.enabled);
    desk.find("Null · b, passed over");
    undone(&mut desk, &before, steps);
    let at = title(&desk);
    desk.secondary_click_at(at);
    choose(&mut desk, "Select its commands");
    assert_eq!(view(&desk).selected, BTreeSet::from([middle]));
}
