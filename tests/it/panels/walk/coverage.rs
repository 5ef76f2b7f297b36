//! Completeness of the walks: an action or a panel that is added and not walked over is told here.

use std::{path::Path, time::Duration};

use rigsmith::editor::{
    dock::Layout,
    panel::PanelTitles,
    panels::{graph::GraphAction, timeline::TimelineAction},
    style::{self, Look},
    tools::paint::brush::BrushAction,
};
use serde::de::DeserializeOwned;

use super::*;

/// Names of all variants of an enum, which its reader tells of a name that is none.
fn variants<T: DeserializeOwned>() -> BTreeSet<String> {
    match ron::from_str::<T>("NoSuchVariant").map_err(|error| error.code) {
        Err(ron::Error::NoSuchEnumVariant { expected, .. }) => expected.iter().map(|name| (*name).to_owned()).collect(),
        Err(error) => panic!("{error}"),
        Ok(_) => panic!("there is a variant of that name"),
    }
}

/// Names of the variants of listed values.
fn listed<T: std::fmt::Debug>(values: impl IntoIterator<Item = T>) -> BTreeSet<String> {
    let name = |value: T| format!("{value:?}").split('(').next().unwrap_or_default().to_owned();
    values.into_iter().map(name).collect()
}

/// The walks go over the list of all actions, so that list has to be whole.
#[test]
fn no_action_is_left_out() {
    assert_eq!(listed(Action::all()), variants::<Action>());
    assert_eq!(listed(Mode::ALL), variants::<Mode>());
    assert_eq!(listed(TimelineAction::ALL), variants::<TimelineAction>());
    assert_eq!(listed(GraphAction::ALL), variants::<GraphAction>());
    assert_eq!(listed(LibraryAction::ALL), variants::<LibraryAction>());
    assert_eq!(listed(BrushAction::ALL), variants::<BrushAction>());
    let nested = Mode::ALL.len()
        + TimelineAction::ALL.len()
        + GraphAction::ALL.len()
        + LibraryAction::ALL.len()
        + BrushAction::ALL.len();
    // Five variants of an action hold those of others.
    assert_eq!(Action::all().len(), variants::<Action>().len() - 5 + nested, "each is listed once");
}

#[test]
fn no_panel_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let app = docked_app(folder.path().join("state"), Vec::new(), TimeUpdateStrategy::ManualDuration(Duration::ZERO));
    let shown: BTreeSet<&str> = app.world().resource::<PanelTitles>().0.iter().copied().collect();
    let walked: BTreeSet<&str> = panels().into_iter().map(|(title, ..)| title).chain([OF_LIBRARY]).collect();
    assert_eq!(walked, shown);
    for (title, panel, _) in panels() {
        assert_eq!(panel.title(), title, "the panel of that title is walked over");
    }
}

/// Rows of pictures in the README name the panels that they show.
#[test]
fn every_panel_has_a_picture_in_the_readme() {
    let readme = Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md");
    let text = std::fs::read_to_string(readme).unwrap();
    let captions: Vec<&str> = text
        .lines()
        .filter(|line| line.starts_with("| ![") && line.contains("](docs/"))
        .flat_map(|line| line.split('|').filter_map(|cell| cell.split_once(".png)")).map(|(_, caption)| caption))
        .collect();
    let names = |caption: &&str, title: &str| caption.split(|c: char| !c.is_alphanumeric()).any(|word| word == title);
    for title in panels().into_iter().map(|(title, ..)| title).chain([OF_LIBRARY]) {
        assert!(captions.iter().any(|caption| names(caption, title)), "{title}: {captions:?}");
    }
}

#[test]
fn no_panel_asks_for_frames_while_nothing_happens() {
    let loader: Box<dyn EditorPanel> = Box::new(LoaderPanel::default());
    let loader = (OF_LIBRARY, loader, egui::vec2(360.0, 2000.0));
    for (title, panel, size) in panels().into_iter().chain([loader]) {
        let mut walk = Walk::new(panel, size);
        walk.ready();
        walk.rest();
        walk.desk.move_to(Pos2::new(-10.0, -10.0));
        // Bars that fade and lists that come in the background are done by then.
        walk.desk.frames(120);
        let wakes_in = walk.desk.wakes_in;
        assert_eq!(wakes_in, Duration::MAX, "{title} asks for a frame, with nothing to show in it");
        assert!(!walk.desk.asks, "{title} sends requests, with nothing that happens");
    }
}

/// The pointer that rests on a panel brings a tip and a light, and no more frames.
#[test]
fn no_panel_asks_for_frames_while_the_pointer_rests_on_it() {
    for (title, panel, size) in panels() {
        let mut walk = Walk::new(panel, size);
        // A panel that the pointer is over is in front of others.
        walk.desk.app.world_mut().resource_mut::<Layout>().bring_forward(title);
        walk.ready();
        walk.rest();
        let places = walk.names().into_iter().map(|(_, at)| at);
        for at in places.step_by(7).take(4).chain([Pos2::new(0.5 * size.x, 0.5 * size.y)]).collect::<Vec<_>>() {
            walk.desk.move_to(at);
            walk.desk.frames(120);
            assert_eq!(walk.desk.wakes_in, Duration::MAX, "{title} asks for a frame, with the pointer at {at:?}");
            assert!(!walk.desk.asks, "{title} sends requests, with the pointer at {at:?}");
        }
    }
}

/// Overlays of the window wait for a person without a frame.
#[test]
fn no_overlay_asks_for_frames_while_nothing_happens() {
    for action in [Action::Palette, Action::Help, Action::StartPage, Action::Open] {
        let mut walk = Walk::with(Sheet::Window, egui::vec2(1280.0, 720.0));
        // The caret of a field blinks in no look of the window.
        style::apply(&walk.desk.ctx, Look::default());
        walk.desk.frames(3);
        let drawn = walk.desk.shapes;
        walk.desk.app.world_mut().write_message(ActionRequest(action));
        walk.desk.frames(10);
        assert_ne!(walk.desk.shapes, drawn, "{action:?} shows something");
        walk.desk.move_to(Pos2::new(-10.0, -10.0));
        let rests = |desk: &Desk| desk.wakes_in == Duration::MAX && !desk.asks;
        walk.desk.until("a rest", rests);
        for _ in 0..60 {
            walk.desk.frame();
            assert!(rests(&walk.desk), "{action:?} asks for a frame after {:?}", walk.desk.wakes_in);
        }
    }
}
