//! The Graph panel: it shows what the rig and its builder say, and what a person does there reaches the document as one step.

mod edits;
mod focus;
mod frames;
mod layout;
mod letters;

use std::collections::BTreeSet;

use bevy::prelude::*;
use bevy_egui::egui::{self, Modifiers, Pos2};
use rigsmith::{
    editor::{
        actions::{Action, ActionRequest},
        help::describe,
        keys::KeyBindings,
        palette::{found, obstacle},
        panels::graph::{GraphAction, GraphPanel, GraphRequest, GraphView, layout::GRID, over_graph},
    },
    plugins::commands::{BuildRequest, BuildStep, Processor},
    prelude::*,
    rig::{
        TagData, TagKind,
        operations::TagOperation,
        reference::{NodeRef, Source, references_in},
        template::write_template,
    },
};

use crate::panels::desk::{Desk, Sheet, ShownWidget};

/// Point of the panel below the nodes.
const GROUND: Pos2 = Pos2::new(40.0, 560.0);

/// A panel beside a rig of three joints: a control on the first, a null at what that makes on the second, and on the third a
/// null that refers to neither.
fn opened() -> (Desk, [Uid; 3], [Uid; 3]) {
    let mut desk = Desk::with(Sheet::Panel(Box::new(GraphPanel::default())), egui::vec2(900.0, 600.0));
    let joints = desk.chain(&["a", "b", "c"]);
    let [a, b, c] = joints[..] else { panic!("{joints:?}") };
    let control = add(&mut desk, a, "control", "()");
    let at_control = format!("(at: \"{}\")", NodeRef::command(control));
    let middle = add(&mut desk, b, "null", &at_control);
    let last = add(&mut desk, c, "null", "()");
    desk.app.world_mut().write_message(BuildRequest { rig: desk.rig, step: BuildStep::All });
    settle(&mut desk);
    (desk, [a, b, c], [control, middle, last])
}

fn add(desk: &mut Desk, joint: Uid, module: &str, params: &str) -> Uid {
    let known: BTreeSet<Uid> = commands(desk).into_iter().collect();
    let kind = TagKind::Command { module: module.into(), params: params.into(), feature: None };
    desk.edit(Operation::Tags(TagOperation::Add { joints: vec![joint], kind, index: None }));
    commands(desk).into_iter().find(|tag| !known.contains(tag)).unwrap()
}

fn commands(desk: &Desk) -> Vec<Uid> {
    let tags = desk.rig().walk().flat_map(|joint| &joint.data.tags);
    tags.filter(|tag| matches!(tag.kind, TagKind::Command { .. })).map(|tag| tag.uid).collect()
}

/// Commands that a parameter of a command refers to.
fn referred(desk: &Desk, tag: Uid) -> Vec<Uid> {
    let TagKind::Command { params, .. } = &desk.rig().find_tag(tag).unwrap().1.kind else { panic!("no command") };
    let references = references_in(params).flat_map(|found| found.references.unwrap().0);
    references
        .filter_map(|reference| match reference.source {
            Source::Command(tag) => Some(tag),
            _ => None,
        })
        .collect()
}

/// Lets flashes go out, and shows all.
fn settle(desk: &mut Desk) {
    desk.frames(3);
    desk.time += 2.0;
    act(desk, GraphAction::ShowAll);
    desk.frames(3);
}

fn act(desk: &mut Desk, action: GraphAction) {
    desk.app.world_mut().write_message(ActionRequest(Action::Graph(action)));
    desk.frames(3);
}

fn bytes(desk: &Desk) -> String {
    write_template(desk.rig())
}

fn view(desk: &Desk) -> &GraphView {
    desk.app.world().resource::<GraphView>()
}

/// The node whose name begins with a text.
#[track_caller]
fn node(desk: &Desk, name: &str) -> ShownWidget {
    let labels: Vec<&str> = desk.seen.iter().map(|seen| seen.label.as_str()).collect();
    let found = desk.seen.iter().find(|seen| seen.label.starts_with(&format!("{name}, ")));
    found.unwrap_or_else(|| panic!("{name:?} is not among {labels:?}")).clone()
}

/// Clicks the entry of a menu that begins with a text: those with entries of their own end in an arrow.
#[track_caller]
fn choose(desk: &mut Desk, entry: &str) {
    let found = desk.seen.iter().find(|seen| seen.label.starts_with(entry));
    let label = found.unwrap_or_else(|| panic!("{entry:?} is not among {:?}", desk.seen)).label.clone();
    desk.click(&label);
    desk.frames(3);
}

#[track_caller]
fn pin(desk: &Desk, name: &str) -> Pos2 {
    desk.find(name).rect.center()
}

#[test]
fn commands_are_nodes_with_their_states_and_pins() {
    let (mut desk, [_, b, _], [_, middle, _]) = opened();
    for name in ["Control · a, built", "Null · b, built", "Null · c, built", "Control · a: output", "Null · b: at"]
    {
        desk.find(name);
    }
    assert!(desk.seen.iter().any(|seen| seen.value.starts_with("3 commands")), "{:?}", desk.seen);
    // What is read stands left of what reads it.
    assert!(node(&desk, "Control · a").rect.right() < node(&desk, "Null · b").rect.left());
    desk.edit(Operation::Tags(TagOperation::Enable(vec![middle], false)));
    desk.frames(2);
    desk.find("Null · b, passed over");
    desk.edit(Operation::Labels(vec![(b, "elbow".into())]));
    desk.frames(2);
    desk.find("Null · elbow, passed over");
    desk.edit(Operation::Tags(TagOperation::Params(vec![(middle, "(rotate: (1.0, 2.0, oops))".into())])));
    desk.edit(Operation::Tags(TagOperation::Enable(vec![middle], true)));
    desk.frames(2);
    desk.find("Null · elbow, failed");
    desk.find("Null · c, not built yet");
}

#[test]
fn dependencies_are_those_of_the_last_runs() {
    let (mut desk, [_, _, c], [control, middle, last]) = opened();
    let of_module = add(&mut desk, c, "null", "(at: \"@module control\")");
    desk.frames(3);
    let builder = |desk: &Desk| desk.app.world().get::<Processor>(desk.rig).unwrap().builder().dependencies();
    let found = builder(&desk);
    let has = |reader: Uid, source: Uid| {
        found
            .iter()
            .any(|read| read.reader == reader && read.source == source && read.parameter.as_deref() == Some("at"))
    };
    assert!(has(middle, control) && has(of_module, control), "{found:?}");
    assert!(!found.iter().any(|read| read.reader == last || read.reader == control), "{found:?}");
    // What does not run reads nothing.
    desk.edit(Operation::Tags(TagOperation::Enable(vec![middle], false)));
    assert!(!builder(&desk).iter().any(|read| read.reader == middle));
}

#[test]
fn the_selection_goes_both_ways() {
    let (mut desk, [a, b, c], [control, middle, last]) = opened();
    let steps = desk.steps();
    let selected = |desk: &Desk| view(desk).selected.iter().copied().collect::<BTreeSet<Uid>>();
    let click = |desk: &mut Desk, name: &str| {
        desk.time += 1.0;
        let at = node(desk, name).rect.center();
        desk.click_at(at);
        desk.frames(3);
    };
    click(&mut desk, "Null · b");
    assert_eq!((desk.selected(), selected(&desk)), (&[b][..], BTreeSet::from([middle])));
    assert_eq!(node(&desk, "Null · b").on, Some(true));
    desk.hold(Modifiers::SHIFT);
    click(&mut desk, "Control · a");
    assert_eq!(selected(&desk), BTreeSet::from([control, middle]));
    desk.hold(Modifiers::COMMAND);
    click(&mut desk, "Null · b");
    assert_eq!((desk.selected(), selected(&desk)), (&[a][..], BTreeSet::from([control])));
    desk.hold(Modifiers::NONE);
    desk.select(&[c]);
    assert_eq!(selected(&desk), BTreeSet::from([last]));
    // A box over everything, from the empty ground; Escape drops it.
    desk.press(GROUND);
    desk.move_to(Pos2::new(400.0, 300.0));
    desk.move_to(Pos2::new(870.0, 60.0));
    desk.key(egui::Key::Escape);
    desk.release(Pos2::new(870.0, 60.0));
    desk.frames(2);
    assert_eq!(selected(&desk), BTreeSet::from([last]));
    desk.drag(GROUND, Pos2::new(870.0, 60.0));
    desk.frames(2);
    assert_eq!(selected(&desk), BTreeSet::from([control, middle, last]));
    let joints: BTreeSet<Uid> = desk.selected().iter().copied().collect();
    assert_eq!(joints, BTreeSet::from([a, b, c]));
    desk.click_at(GROUND);
    desk.frames(3);
    assert!(selected(&desk).is_empty() && desk.selected().is_empty());
    assert_eq!(desk.steps(), steps, "selecting is no step");
}

#[test]
fn nodes_are_moved_on_the_grid_and_laid_out_again() {
    let (mut desk, _, [control, middle, _]) = opened();
    let (before, steps) = (bytes(&desk), desk.steps());
    let from = node(&desk, "Null · b").rect;
    desk.drag(from.center(), from.center() + egui::vec2(93.0, 71.0));
    desk.frames(2);
    let moved = view(&desk).moved.clone();
    assert_eq!(moved.keys().copied().collect::<Vec<_>>(), [middle]);
    assert!(moved[&middle].iter().all(|number| number % GRID == 0.0), "{moved:?}");
    let by = node(&desk, "Null · b").rect.center() - from.center();
    assert!((by - egui::vec2(93.0, 71.0)).length() < GRID, "{by:?}");
    // Selected nodes go together.
    let both = BTreeSet::from([control, middle]);
    desk.app.world_mut().write_message(GraphRequest::Select(both.clone()));
    desk.frames(3);
    let first = node(&desk, "Control · a").rect.center();
    desk.drag(first, first + egui::vec2(0.0, 120.0));
    desk.frames(2);
    assert_eq!(view(&desk).moved.keys().copied().collect::<BTreeSet<_>>(), both);
    assert_eq!(view(&desk).moved[&middle][1], moved[&middle][1] + 120.0);
    assert_eq!((bytes(&desk), desk.steps()), (before, steps), "places of nodes are not in the document");
    desk.click("Lay out again");
    desk.frames(3);
    assert!(view(&desk).moved.is_empty());
    assert!(!desk.find("Lay out again").enabled);
}

/// Actions that change the document, each by one step that undo takes back to the byte.
#[test]
fn every_action_is_one_step_or_none() {
    let (mut desk, _, [_, middle, last]) = opened();
    let mut edits = Vec::new();
    for action in GraphAction::ALL {
        desk.app.world_mut().write_message(GraphRequest::Select([middle, last].into()));
        desk.app.world_mut().write_message(GraphRequest::Move(vec![(middle, [61.0, -39.0])]));
        desk.frames(3);
        assert_eq!(view(&desk).moved[&middle], [60.0, -40.0]);
        if desk.is_one_step(&format!("{action:?}"), bytes, |desk| act(desk, action)) {
            edits.push(action);
        }
    }
    assert_eq!(edits, [GraphAction::Toggle, GraphAction::Delete]);
}

#[test]
fn actions_are_in_the_palette_with_their_obstacles() {
    let (mut desk, _, _) = opened();
    assert!(KeyBindings::default().doubles().is_empty());
    for action in GraphAction::ALL.map(Action::Graph) {
        assert!(found(&describe(action)).contains(&action) && Action::all().contains(&action), "{action:?}");
    }
    let reason = |desk: &Desk, action: GraphAction| obstacle(desk.app.world(), Action::Graph(action));
    assert_eq!(reason(&desk, GraphAction::ShowAll), None);
    act(&mut desk, GraphAction::SelectNone);
    assert_eq!(reason(&desk, GraphAction::LayOut), Some("no node was moved by hand"));
    assert_eq!(reason(&desk, GraphAction::Delete), Some("no command is selected in the Graph"));
    act(&mut desk, GraphAction::Delete);
    assert!(desk.told().last().is_some_and(|told| told.contains("no command is selected")), "{:?}", desk.told());
    act(&mut desk, GraphAction::SelectAll);
    assert_eq!((view(&desk).selected.len(), reason(&desk, GraphAction::Delete)), (3, None));
    // Over the graph the keys of joints are those of its commands.
    assert_eq!(over_graph(Action::Delete), Action::Graph(GraphAction::Delete));
    assert_eq!(over_graph(Action::Undo), Action::Undo);
    desk.move_to(Pos2::new(450.0, 300.0));
    desk.frames(2);
    assert!(view(&desk).hovered);
    desk.move_to(Pos2::new(2000.0, 2000.0));
    desk.frames(2);
    assert!(!view(&desk).hovered);
}

#[test]
fn a_command_that_ran_flashes_and_then_all_is_quiet() {
    let (mut desk, _, [_, middle, _]) = opened();
    desk.move_to(Pos2::new(2000.0, 2000.0));
    desk.frames(5);
    assert!(!desk.awake, "nothing asks for a frame");
    desk.edit(Operation::Tags(TagOperation::Params(vec![(middle, "(translate: (0.0, 0.1, 0.0))".into())])));
    desk.frames(2);
    assert!(desk.awake, "it flashes");
    desk.time += 1.0;
    desk.frames(4);
    assert!(!desk.awake);
}

/// Commands on one joint, of which most refer to the one before.
fn many(count: usize) -> Desk {
    many_in(Sheet::Panel(Box::new(GraphPanel::default())), count)
}

fn many_in(sheet: Sheet, count: usize) -> Desk {
    let mut desk = Desk::with(sheet, egui::vec2(900.0, 600.0));
    let joint = desk.chain(&["a"])[0];
    let tag = |number: usize| {
        let uid = |number: usize| Uid(0xC0_0000 + number as u64);
        let params = match number % 10 {
            0 => "()".to_owned(),
            _ => format!("(at: \"{}\")", NodeRef::command(uid(number - 1))),
        };
        let kind = TagKind::Command { module: "null".into(), params, feature: None };
        let tag = TagData { uid: uid(number), enabled: true, comment: String::new(), kind };
        RigEdit::AddTag { joint, tag: Box::new(tag), index: number }
    };
    desk.edit(Operation::Edits((0..count).map(tag).collect()));
    settle(&mut desk);
    desk
}

#[test]
fn a_thousand_commands_are_few_shapes() {
    let [few, all] = [400, 1_000].map(|count| {
        let mut desk = many(count);
        act(&mut desk, GraphAction::OpenFrames);
        desk.app.world_mut().write_message(GraphRequest::Select([Uid(0xC0_0000)].into()));
        act(&mut desk, GraphAction::ShowSelected);
        assert!(desk.look("Null · a: output").is_some(), "names near by");
        act(&mut desk, GraphAction::ShowAll);
        (desk.seen.len(), desk.shapes)
    });
    assert_eq!(few, all, "widgets and shapes");
    assert!(all.1 < 80, "{all:?}");
    // Near by, only the nodes in view are laid out.
    let mut desk = many(1_000);
    act(&mut desk, GraphAction::OpenFrames);
    desk.app.world_mut().write_message(GraphRequest::Select([Uid(0xC0_0000 + 500)].into()));
    desk.frames(2);
    act(&mut desk, GraphAction::ShowSelected);
    let laid_out = desk.seen.iter().filter(|seen| seen.label.starts_with("Null · a, ")).count();
    assert!((1..=40).contains(&laid_out), "{laid_out}");
    assert!(desk.shapes < 900, "{}", desk.shapes);
    assert!(desk.look("Null · a: output").is_some());
}
