//! Values in the cards of the Tags panel: references that are picked, sliders, resets, words, and the clipboard.

use bevy_egui::egui;
use rigsmith::{
    editor::panels::tags::TagsPanel,
    plugins::commands::{BuildRequest, BuildResult, BuildStep},
    rig::{
        RigEdit, TagKind, Uid,
        operations::{Operation, TagOperation},
    },
};

use super::desk::Desk;

/// Parameters of a command.
pub(super) fn params_of(desk: &Desk, tag: Uid) -> String {
    match &desk.rig().find_tag(tag).unwrap().1.kind {
        TagKind::Command { params, .. } => params.clone(),
        TagKind::Feature { name, .. } => panic!("{name} is no command"),
    }
}

/// Adds a command to a joint; returns its tag.
pub(super) fn add_command(desk: &mut Desk, joint: Uid, module: &str, params: &str) -> Uid {
    let kind = TagKind::Command { module: module.into(), params: params.into(), feature: None };
    desk.edit(Operation::Tags(TagOperation::Add { joints: vec![joint], kind, index: None }));
    desk.rig().joint(joint).unwrap().data.tags.last().unwrap().uid
}

#[test]
fn a_reference_is_picked_while_its_card_stays() {
    let mut desk = Desk::new(TagsPanel::default());
    desk.resize(400.0, 1600.0);
    let [a, b] = desk.chain(&["a", "b"])[..] else { panic!() };
    let made = add_command(&mut desk, a, "control", "()");
    let aim = add_command(&mut desk, b, "aim", "()");
    desk.app.world_mut().write_message(BuildRequest { rig: desk.rig, step: BuildStep::All });
    desk.frames(3);
    desk.select(&[b]);
    desk.click("Values of aim");
    desk.frames(3);
    let (before, steps) = (desk.rig().clone(), desk.steps().1);
    let (pick, waits) = ("Targets: pick in the viewport", "Click a joint or a control; Esc leaves it");
    desk.click(pick);
    desk.frames(3);
    assert!(desk.says(waits), "{:?}", desk.seen);
    desk.select(&[a]);
    desk.frames(3);
    assert!(params_of(&desk, aim).contains(&format!("@joint a#{a}")), "{}", params_of(&desk, aim));
    assert_eq!((desk.selected(), desk.steps().1), (&[b][..], steps + 1), "the joint of the card is selected again");
    assert!(!desk.says(waits) && desk.look(pick).is_some(), "{:?}", desk.seen);
    // A control is what its command makes.
    let built = &desk.app.world().get::<BuildResult>(desk.rig).unwrap().0;
    let control = built.nodes.iter().find(|node| node.control.is_some()).expect("the control").uid;
    desk.click(pick);
    desk.frames(2);
    desk.select(&[control]);
    desk.frames(3);
    let params = params_of(&desk, aim);
    assert!(params.contains("@command control") && params.contains(&made.to_string()), "{params}");
    assert_eq!((desk.selected(), desk.steps().1), (&[b][..], steps + 2));
    // A second click takes the joints of the card, Escape and an empty selection nothing.
    desk.click(pick);
    desk.frames(2);
    desk.click("Targets: take the joints of this card");
    desk.frames(3);
    assert!(params_of(&desk, aim).contains(&format!("@joint b#{b}")), "{}", params_of(&desk, aim));
    assert_eq!(desk.steps().1, steps + 3);
    for is_key in [true, false] {
        desk.click(pick);
        desk.frames(2);
        if is_key {
            desk.key(egui::Key::Escape)
        } else {
            desk.select(&[])
        }
        desk.frames(3);
        assert!(!desk.says(waits) && desk.look(pick).is_some(), "{:?}", desk.seen);
    }
    desk.select(&[a]);
    desk.frames(3);
    assert_eq!((desk.selected(), desk.steps().1), (&[a][..], steps + 3), "nothing waits");
    desk.undo(3);
    assert_eq!(*desk.rig(), before);
}

#[test]
fn values_are_reset_by_a_button_beside_them() {
    let mut desk = Desk::new(TagsPanel::default());
    desk.resize(400.0, 1600.0);
    let [a, b] = desk.chain(&["a", "b"])[..] else { panic!() };
    let aim = add_command(&mut desk, b, "aim", &format!("(targets: \"@joint a#{a}\", direction: (0.0, 0.0, 1.0))"));
    desk.select(&[b]);
    desk.click("Values of aim");
    desk.frames(3);
    let offered = |desk: &Desk| -> Vec<String> {
        let buttons = desk.seen.iter().filter(|seen| seen.label.ends_with(" to default"));
        buttons.map(|seen| seen.label.clone()).collect()
    };
    let mut now = offered(&desk);
    now.sort_unstable();
    assert_eq!(now, ["Reset Direction to default", "Reset Targets to default"]);
    let (before, steps) = (desk.rig().clone(), desk.steps().1);
    desk.click("Reset Direction to default");
    desk.frames(3);
    let params = params_of(&desk, aim);
    assert!(!params.contains("direction") && params.contains("targets"), "{params}");
    assert_eq!((offered(&desk), desk.steps().1), (vec!["Reset Targets to default".to_owned()], steps + 1));
    desk.undo(1);
    assert_eq!(*desk.rig(), before);
}

#[test]
fn a_slider_is_one_step_and_other_numbers_are_typed() {
    let mut desk = Desk::new(TagsPanel::default());
    desk.resize(400.0, 1600.0);
    let [a, _] = desk.chain(&["a", "b"])[..] else { panic!() };
    let tag = add_command(&mut desk, a, "control", "()");
    desk.select(&[a]);
    desk.click("Values of control");
    desk.frames(3);
    let steps = desk.steps().1;
    let slider = desk.find("Relative size slider").rect;
    // Its ends are those of the form.
    for (to, size) in [(slider.right_center() + egui::vec2(30.0, 0.0), 2.0), (slider.left_center(), 0.05)] {
        let done = desk.steps().1;
        desk.drag(slider.center(), to);
        desk.frames(3);
        let params = params_of(&desk, tag);
        assert!(params.contains(&format!("relative_size: {size}")), "{params}");
        assert_eq!(desk.steps().1, done + 1, "a drag is one step");
    }
    desk.click("Relative size");
    desk.type_text("3.5");
    desk.key(egui::Key::Enter);
    desk.frames(3);
    let params = params_of(&desk, tag);
    assert!(params.contains("relative_size: 3.5"), "{params}");
    assert_eq!(desk.steps().1, steps + 3);
    // In a narrow panel the number has all room.
    desk.resize(200.0, 1600.0);
    assert!(desk.look("Relative size slider").is_none() && desk.look("Relative size").is_some(), "{:?}", desk.seen);
}

#[test]
fn cards_say_their_values_in_words() {
    let mut desk = Desk::new(TagsPanel::default());
    desk.resize(600.0, 900.0);
    let [a, b] = desk.chain(&["a", "b"])[..] else { panic!() };
    add_command(&mut desk, b, "aim", &format!("(targets: \"@joint a#{a}\", up_axis: x, keep_offset: false)"));
    desk.select(&[b]);
    desk.frames(2);
    assert!(desk.says("targets a, up axis x, no keep offset"), "{:?}", desk.seen);
    add_command(&mut desk, b, "control", "(shape: \"cube\", creation: (name: \"body\"))");
    desk.frames(2);
    assert!(desk.says("shape cube, creation name body"), "{:?}", desk.seen);
}

#[test]
fn tags_are_copied_and_pasted_over_a_scope_and_mirrored() {
    let mut desk = Desk::new(TagsPanel::default());
    desk.resize(420.0, 900.0);
    let [a, b, _] = desk.chain(&["a", "b", "c"])[..] else { panic!() };
    let [d, e, f] = desk.chain(&["d", "e", "f"])[..] else { panic!() };
    add_command(&mut desk, a, "control", "()");
    add_command(&mut desk, b, "null", "()");
    let choose = |desk: &mut Desk, menu: &str, entry: &str| {
        desk.click(menu);
        desk.frames(3);
        desk.click(entry);
        desk.frames(3);
    };
    desk.select(&[a]);
    choose(&mut desk, "Copy", "All tags of the hierarchy");
    assert!(desk.told().iter().any(|told| told == "Copied 2 tags."), "{:?}", desk.told());
    desk.select(&[d]);
    let (before, steps) = (desk.rig().clone(), desk.steps().1);
    choose(&mut desk, "Paste", "Tags and values onto the hierarchy");
    let of = |desk: &Desk| [d, e, f].map(|joint| desk.modules(joint).join(" "));
    assert_eq!(of(&desk), ["control", "null", ""], "{:?}", desk.told());
    assert_eq!(desk.steps().1, steps + 1);
    desk.undo(1);
    assert_eq!(*desk.rig(), before);
    // Onto the other side of what was copied.
    let pairs = [(a, d), (b, e), (d, a), (e, b)];
    desk.edit(Operation::Edits(pairs.map(|(one, other)| RigEdit::SetMirror(one, Some(other))).to_vec()));
    desk.select(&[a]);
    choose(&mut desk, "Copy", "All tags of the rig");
    choose(&mut desk, "Paste", "Tags and values onto the other side");
    assert_eq!(of(&desk), ["control", "null", ""], "{:?}", desk.told());
    // Cutting takes them away.
    desk.select(&[d]);
    choose(&mut desk, "Copy", "Cut all tags");
    assert_eq!(of(&desk), ["", "null", ""], "{:?}", desk.told());
}

#[test]
fn keys_of_a_curve_are_dragged_added_and_removed() {
    let mut desk = Desk::new(TagsPanel::default());
    desk.resize(400.0, 1600.0);
    let [a, _] = desk.chain(&["a", "b"])[..] else { panic!() };
    let tag = add_command(&mut desk, a, "driven_key", "()");
    desk.select(&[a]);
    desk.click("Values of driven_key");
    desk.frames(3);
    let keys = |desk: &Desk| -> Vec<String> {
        let keys = desk.seen.iter().filter(|seen| seen.label.starts_with("Keys key "));
        let mut keys: Vec<String> = keys.map(|seen| seen.label.clone()).collect();
        keys.sort_unstable();
        keys
    };
    assert_eq!(keys(&desk), ["Keys key 1: 0, 0", "Keys key 2: 1, 1"]);
    let (before, steps) = (desk.rig().clone(), desk.steps().1);
    let last = desk.find("Keys key 2: 1, 1").rect.center();
    desk.drag(last, last + egui::vec2(-80.0, 20.0));
    desk.frames(3);
    assert_eq!(desk.steps().1, steps + 1, "a drag is one step");
    assert!(params_of(&desk, tag).contains("keys: ["), "{}", params_of(&desk, tag));
    let moved = keys(&desk);
    assert!(moved.len() == 2 && moved[0] == "Keys key 1: 0, 0" && moved[1] != "Keys key 2: 1, 1", "{moved:?}");
    // A drag that Escape ends changes nothing.
    let last = desk.find(&moved[1]).rect.center();
    desk.time += 1.0;
    desk.press(last);
    desk.move_to(last + egui::vec2(-10.0, 5.0));
    desk.move_to(last + egui::vec2(-30.0, 10.0));
    desk.key(egui::Key::Escape);
    desk.release(last);
    desk.frames(3);
    assert_eq!((keys(&desk), desk.steps().1), (moved, steps + 1));
    let ground = desk.find("Keys as a curve").rect.center();
    desk.double_click("Keys as a curve");
    desk.frames(3);
    assert_eq!((keys(&desk).len(), desk.steps().1), (3, steps + 2), "{:?}", keys(&desk));
    let middle = keys(&desk)[1].clone();
    assert!(desk.find(&middle).rect.center().distance(ground) < 3.0, "it is where the click was");
    desk.secondary_click(&middle);
    desk.frames(3);
    assert_eq!((keys(&desk).len(), desk.steps().1), (2, steps + 3));
    // Two keys are the least.
    let first = keys(&desk)[0].clone();
    desk.secondary_click(&first);
    desk.frames(3);
    assert_eq!((keys(&desk).len(), desk.steps().1), (2, steps + 3));
    desk.undo(3);
    assert_eq!(*desk.rig(), before);
}

#[test]
fn alike_tags_of_several_joints_are_reordered_at_once() {
    let mut desk = Desk::new(TagsPanel::default());
    desk.resize(420.0, 900.0);
    let joints = desk.chain(&["a", "b", "c"]);
    for (joint, modules) in
        joints.iter().zip([&["control", "null", "aim"][..], &["control", "aim"][..], &["aim", "null"][..]])
    {
        for module in modules {
            add_command(&mut desk, *joint, module, "()");
        }
    }
    desk.select(&joints);
    desk.frames(2);
    let order = |desk: &Desk| -> Vec<String> { joints.iter().map(|joint| desk.modules(*joint).join(" ")).collect() };
    let (before, steps) = (desk.rig().clone(), desk.steps().1);
    let [from, to] = ["Drag aim", "Drag control"].map(|label| desk.find(label).rect.center());
    desk.drag(from, to);
    desk.frames(3);
    assert_eq!(order(&desk), ["aim control null", "aim control", "aim null"], "{:?}", desk.told());
    assert_eq!(desk.steps().1, steps + 1);
    // And back by the menu.
    for _ in 0..2 {
        desk.click("Menu of aim");
        desk.frames(3);
        desk.click("Move down");
        desk.frames(3);
    }
    assert_eq!(order(&desk), ["control null aim", "control aim", "null aim"], "{:?}", desk.told());
    desk.undo(3);
    assert_eq!(*desk.rig(), before);
}
