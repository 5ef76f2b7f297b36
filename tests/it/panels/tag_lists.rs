//! Lists in the cards of the Tags panel: a row for each item, which is added, edited, moved and removed, each in one step.

use bevy_egui::egui;
use rigsmith::{
    editor::panels::tags::TagsPanel,
    plugins::document::{Change, EditRequest},
    processor::form::{FormElement, ListItem, read_module_form},
};

use super::{
    desk::Desk,
    tag_values::{add_command, params_of},
};

/// A tall panel with the open card of a command.
fn card(module: &str, params: &str) -> (Desk, rigsmith::rig::Uid) {
    let mut desk = Desk::new(TagsPanel::default());
    desk.resize(420.0, 1600.0);
    let [a, _] = desk.chain(&["a", "b"])[..] else { panic!() };
    let tag = add_command(&mut desk, a, module, params);
    desk.select(&[a]);
    desk.click(&format!("Values of {module}"));
    desk.frames(3);
    (desk, tag)
}

/// Parameters without blanks.
fn dense(desk: &Desk, tag: rigsmith::rig::Uid) -> String {
    params_of(desk, tag).replace(' ', "")
}

/// Clicks, and expects one more step that leaves such parameters.
#[track_caller]
fn click_leaves(desk: &mut Desk, tag: rigsmith::rig::Uid, label: &str, expected: &str) {
    let steps = desk.steps().1;
    desk.click(label);
    desk.frames(3);
    let params = dense(desk, tag);
    assert!(params.contains(expected), "{label}: {params}");
    assert_eq!(desk.steps().1, steps + 1, "{label} is one step");
}

#[track_caller]
fn undo_all(desk: &mut Desk, steps: usize) {
    let rig = desk.rig;
    while desk.steps().1 > steps {
        desk.app.world_mut().write_message(EditRequest { rig, change: Change::Undo });
        desk.frames(2);
    }
}

#[test]
fn texts_of_a_list_are_added_moved_and_removed() {
    let (mut desk, tag) = card("attribute", "(name: \"space\", choices: [\"world\", \"hips\"])");
    let (before, steps) = (desk.rig().clone(), desk.steps().1);
    let rows = |desk: &Desk| (1..).take_while(|number| desk.look(&format!("{number}: Choices")).is_some()).count();
    assert_eq!(rows(&desk), 2);
    for (label, is_enabled) in [
        ("Move 1 of Choices up", false),
        ("Move 1 of Choices down", true),
        ("Move 2 of Choices up", true),
        ("Move 2 of Choices down", false),
    ] {
        assert_eq!(desk.find(label).enabled, is_enabled, "{label}");
    }
    click_leaves(&mut desk, tag, "Add to Choices", "choices:[\"world\",\"hips\",\"\"]");
    // What is typed is one step more.
    desk.click("3: Choices");
    desk.type_text("hand");
    desk.key(egui::Key::Enter);
    desk.frames(3);
    assert!(dense(&desk, tag).contains("choices:[\"world\",\"hips\",\"hand\"]"), "{}", dense(&desk, tag));
    assert_eq!(desk.steps().1, steps + 2);
    click_leaves(&mut desk, tag, "Move 3 of Choices up", "choices:[\"world\",\"hand\",\"hips\"]");
    click_leaves(&mut desk, tag, "Move 1 of Choices down", "choices:[\"hand\",\"world\",\"hips\"]");
    click_leaves(&mut desk, tag, "Remove 2 of Choices", "choices:[\"hand\",\"hips\"]");
    assert_eq!(rows(&desk), 2);
    // Only the whole list has a default; an item has none to go back to.
    let resets = desk.seen.iter().filter(|seen| seen.label.starts_with("Reset ") && seen.label.contains("Choices"));
    assert_eq!(resets.map(|seen| seen.label.as_str()).collect::<Vec<_>>(), ["Reset Choices to default"]);
    undo_all(&mut desk, steps);
    assert_eq!(*desk.rig(), before);
}

#[test]
fn numbers_of_a_list_are_dragged_and_typed() {
    let (mut desk, tag) = card("twist", "(shares: [0.25, 0.5])");
    let (before, steps) = (desk.rig().clone(), desk.steps().1);
    // Another number is like the last one.
    click_leaves(&mut desk, tag, "Add to Shares", "shares:[0.25,0.5,0.5]");
    desk.click("3: Shares");
    desk.type_text("0.75");
    desk.key(egui::Key::Enter);
    desk.frames(3);
    assert!(dense(&desk, tag).contains("shares:[0.25,0.5,0.75]"), "{}", dense(&desk, tag));
    assert_eq!(desk.steps().1, steps + 2);
    let number = desk.find("1: Shares").rect.center();
    desk.drag(number, number + egui::vec2(20.0, 0.0));
    desk.frames(3);
    let params = dense(&desk, tag);
    assert!(!params.contains("shares:[0.25,") && params.ends_with(",0.5,0.75])"), "{params}");
    assert_eq!(desk.steps().1, steps + 3, "a drag is one step");
    undo_all(&mut desk, steps);
    assert_eq!(*desk.rig(), before);
}

#[test]
fn items_with_fields_have_the_elements_of_their_fields() {
    let (mut desk, tag) = card("expression", "()");
    let (before, steps) = (desk.rig().clone(), desk.steps().1);
    assert!(desk.look("1: Name").is_none(), "{:?}", desk.seen);
    desk.click("Add to Inputs");
    desk.frames(3);
    desk.click("1: Name");
    desk.type_text("lift");
    desk.key(egui::Key::Enter);
    desk.frames(3);
    desk.click("1: Channel");
    desk.frames(3);
    desk.click("RotateX");
    desk.frames(3);
    let params = dense(&desk, tag);
    assert!(params.contains("name:\"lift\"") && params.contains("channel:RotateX"), "{params}");
    assert_eq!(desk.steps().1, steps + 3);
    // A reference is picked as in any other field.
    assert!(desk.look("1: Node: pick in the viewport").is_some(), "{:?}", desk.seen);
    click_leaves(&mut desk, tag, "Remove 1 of Inputs", "inputs:[]");
    undo_all(&mut desk, steps);
    assert_eq!(*desk.rig(), before);
}

#[test]
fn a_list_that_differs_among_commands_is_text() {
    let mut desk = Desk::new(TagsPanel::default());
    desk.resize(420.0, 1600.0);
    let joints = desk.chain(&["a", "b"]);
    for (joint, params) in joints.iter().zip(["(choices: [\"one\"])", "(choices: [\"one\", \"two\"])"]) {
        add_command(&mut desk, *joint, "attribute", params);
    }
    desk.select(&joints);
    desk.click("Values of attribute");
    desk.frames(3);
    assert!(desk.look("Choices").is_some() && desk.look("Add to Choices").is_none(), "{:?}", desk.seen);
}

#[test]
fn every_list_of_the_bundled_modules_has_rows() {
    let mut lists = 0;
    for module in rigsmith::modules::all().iter() {
        let Some(form) = &module.form else { continue };
        let form = read_module_form(form.as_bytes(), module).unwrap();
        for element in form.elements() {
            let FormElement::List(bound) = element else { continue };
            let item = ListItem::of(module, &bound.param);
            let item = item.unwrap_or_else(|| panic!("{}: `{}` is text", module.name, bound.param));
            let rows = item.row(&bound.param, 1, "Item");
            assert!(!rows.is_empty(), "{}: `{}`", module.name, bound.param);
            // Values of two fresh items are found by the paths of the rows.
            let params = format!("({}: [{fresh}, {fresh}])", bound.param, fresh = item.fresh);
            let values = module.values(&params).unwrap();
            for row in &rows {
                let (path, label) = row.bound().unwrap();
                assert!(label.starts_with("2: "), "{label}");
                let value = values.get(path).unwrap_or_else(|| panic!("{}: no value at `{path}`", module.name));
                let set = module.with_value(&params, path, value).unwrap();
                let again = module.values(&set).unwrap();
                assert_eq!(again, values, "{}: `{path}`", module.name);
            }
            lists += 1;
        }
    }
    assert!(lists >= 13, "only {lists} lists");
}
