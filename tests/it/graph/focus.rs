//! Wires in focus: those of few selected commands, and of the command under the pointer, are drawn in full, all others are
//! faded, and those of hubs are cut short.

use rigsmith::editor::panels::graph::MOST_LIT;

use super::{frames::Shared, *};

fn command(number: usize) -> Uid {
    Uid(0xC0_0000 + number as u64)
}

fn select(desk: &mut Desk, tags: impl IntoIterator<Item = Uid>) {
    desk.app.world_mut().write_message(GraphRequest::Select(tags.into_iter().collect()));
    desk.frames(3);
}

#[test]
fn wires_fade_that_touch_neither_the_selection_nor_the_pointer() {
    let panel = Shared::default();
    let mut desk = many_in(Sheet::Panel(Box::new(panel.clone())), MOST_LIT + 20);
    let full = |desk: &Desk| panel.0.lock().unwrap().wires_in_full(view(desk));
    let chart = |desk: &Desk| panel.0.lock().unwrap().chart(view(desk));
    select(&mut desk, []);
    let all = chart(&desk).wires;
    assert!(all.len() > MOST_LIT, "{}", all.len());
    assert_eq!(full(&desk), all, "nothing is selected, and nothing fades");

    let touches = |desk: &Desk, number: usize, wires: &[[Pos2; 2]]| {
        let (_, rect) = chart(desk).commands.into_iter().find(|(tag, _)| *tag == command(number)).unwrap();
        let rect = rect.expand(0.5);
        wires.iter().all(|wire| wire.iter().any(|end| rect.contains(*end)))
    };
    select(&mut desk, [command(5)]);
    let own = full(&desk);
    assert!((2..all.len()).contains(&own.len()) && touches(&desk, 5, &own), "{own:?}");

    // The pointer adds what it is over to few selected commands, and is all that counts with many.
    act(&mut desk, GraphAction::ShowSelected);
    let is_selected = |seen: &&ShownWidget| seen.label.starts_with("Null · a, ") && seen.on == Some(true);
    let at = desk.seen.iter().find(is_selected).expect("the selected node").rect.center();
    select(&mut desk, (0..MOST_LIT).map(command));
    assert!(full(&desk).len() > own.len(), "as many as are lit");
    select(&mut desk, (0..=MOST_LIT).map(command));
    assert!(full(&desk).is_empty(), "too many to be told apart");
    desk.move_to(at);
    desk.frames(2);
    assert_eq!(full(&desk), own, "those of the node under the pointer");
    select(&mut desk, []);
    assert_eq!(full(&desk), own, "without a selection, too");
    desk.move_to(Pos2::new(2000.0, 2000.0));
    desk.frames(2);
    assert_eq!(full(&desk), all);
}

#[test]
fn wires_of_a_hub_are_cut_short_where_they_are_out_of_focus() {
    let panel = Shared::default();
    let mut desk = Desk::with(Sheet::Panel(Box::new(panel.clone())), egui::vec2(900.0, 600.0));
    let joint = desk.chain(&["a"])[0];
    let count = 31;
    let tag = |number: usize| {
        let read = if number > 20 { number - 1 } else { 0 };
        let params = match number {
            0 => "()".to_owned(),
            _ => format!("(at: \"{}\")", NodeRef::command(command(read))),
        };
        let kind = TagKind::Command { module: "null".into(), params, feature: None };
        let tag = TagData { uid: command(number), enabled: true, comment: String::new(), kind };
        RigEdit::AddTag { joint, tag: Box::new(tag), index: number }
    };
    desk.edit(Operation::Edits((0..count).map(tag).collect()));
    settle(&mut desk);
    let full = |desk: &Desk| panel.0.lock().unwrap().wires_in_full(view(desk)).len();
    let short = |desk: &Desk| panel.0.lock().unwrap().wires_cut_short(view(desk)).len();
    select(&mut desk, []);
    let all = full(&desk);
    assert!(all >= 30 && short(&desk) == 0, "{all}: nothing is out of focus");
    // A reader of the hub: its own wire stays whole, those of the other 19 readers do not; those of few readers do.
    select(&mut desk, [command(3)]);
    let (own, cut) = (full(&desk), short(&desk));
    assert!(own >= 1 && cut >= 19 && own + cut < all, "{own} and {cut} of {all}");
    select(&mut desk, [command(25)]);
    let (own, cut) = (full(&desk), short(&desk));
    assert!(own >= 2 && cut >= 20 && own + cut < all, "{own} and {cut} of {all}");
    select(&mut desk, [command(0)]);
    let (own, cut) = (full(&desk), short(&desk));
    assert!(own >= 20 && cut == 0, "{own} and {cut} of {all}");
}
