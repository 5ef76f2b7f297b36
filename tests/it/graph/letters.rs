//! Letters of the graph at every scale, and the place that a zoom keeps.

use bevy_egui::egui::{FontId, Vec2};

use super::*;
use crate::panels::desk::DrawnText;

/// Smallest size of letters that people can read.
const LEAST: f32 = 8.0;

/// Turns the wheel with Control over a place.
fn zoom(desk: &mut Desk, at: Pos2, points: f32) {
    desk.hold(Modifiers::COMMAND);
    desk.scroll(at, points);
    desk.hold(Modifiers::NONE);
    desk.frames(2);
}

#[track_caller]
fn is_sharp(desk: &Desk, drawn: &DrawnText) {
    let height = desk.ctx.fonts_mut(|fonts| fonts.row_height(&FontId::proportional(drawn.size)));
    assert!((drawn.height - height).abs() < 0.05 * height, "{drawn:?} is stretched from a height of {height}");
}

#[test]
fn letters_are_sharp_and_large_enough_at_every_scale() {
    let (mut desk, ..) = opened();
    let titles = ["Control · a", "Null · b", "Null · c"];
    let at = node(&desk, "Null · b").rect.center();
    let (mut widths, mut sizes) = (Vec::new(), Vec::new());
    for points in [0.0, 60.0, 60.0, -200.0, -60.0, -60.0, -60.0, -60.0, -120.0, -300.0] {
        zoom(&mut desk, at, points);
        // Nodes are laid out one by one as long as they are large enough.
        let seen = desk.seen.iter().find(|seen| seen.label.starts_with("Null · b, "));
        widths.extend(seen.map(|seen| seen.rect.width()));
        let is_title = |drawn: &&DrawnText| titles.contains(&drawn.text.as_str());
        let of_nodes: Vec<&DrawnText> = desk.texts.iter().filter(is_title).collect();
        assert!(seen.is_none() || !of_nodes.is_empty(), "no titles of nodes after {points}");
        for drawn in &desk.texts {
            assert!(drawn.size >= LEAST, "{drawn:?} after {points}");
        }
        of_nodes.iter().for_each(|drawn| is_sharp(&desk, drawn));
        sizes.extend(of_nodes.iter().map(|drawn| drawn.size.to_bits()));
    }
    sizes.sort_unstable();
    sizes.dedup();
    let least = widths.iter().copied().fold(f32::INFINITY, f32::min);
    let most = widths.iter().copied().fold(0.0, f32::max);
    assert!(sizes.len() > 2 && most > 1.5 * least, "{sizes:?} {widths:?}");

    // From afar the pointer tells what a node is.
    let is_told = |desk: &Desk| desk.texts.iter().any(|drawn| drawn.text == "Null · b");
    desk.move_to(GROUND);
    desk.frames(10);
    assert!(!is_told(&desk), "{:?}", desk.texts);
    desk.move_to(at);
    desk.frames(60);
    assert!(is_told(&desk), "{:?}", desk.texts);
}

#[test]
fn a_zoom_keeps_what_is_under_the_pointer() {
    let (mut desk, ..) = opened();
    let node_of = |desk: &Desk| node(desk, "Null · b").rect;
    let place = |desk: &Desk, at: Pos2| (at - node_of(desk).min) / node_of(desk).size();
    let at = node_of(&desk).min + node_of(&desk).size() * Vec2::new(0.2, 0.7);
    for points in [-60.0, -40.0, 60.0, 40.0] {
        let (before, size) = (place(&desk, at), node_of(&desk).size());
        zoom(&mut desk, at, points);
        let now = place(&desk, at);
        assert!((now - before).length() < 0.02, "{before:?} went to {now:?}");
        let grown = node_of(&desk).width() > size.x;
        assert_eq!(grown, points > 0.0, "{points}");
    }
}
