//! The dock of the window: every panel's tab lies in the bar of its place and is reached with one click.

use std::time::Duration;

use bevy::prelude::*;
use bevy_egui::{
    EguiContext, EguiPrimaryContextPass, PrimaryEguiContext,
    egui::{self, Event, Modifiers, PointerButton, Pos2, RawInput, Rect},
};
use rigsmith::{
    editor::{
        ActiveRig,
        dock::{DockPlugin, Layout, VIEWPORT},
        files::{FilesPlugin, StateFolder},
        follow::FollowPlugin,
        notice::StatusLine,
        panel::Panels,
        panels::{PanelsPlugin, log::LogBook},
    },
    headless::headless_app,
    prelude::*,
    rig::JointData,
    test_app::strict_app,
};

use crate::window_app::decline_foreign_offers;

/// Size of the window as it opens.
pub const USUAL: [f32; 2] = [1280.0, 720.0];

/// The window without a system's window: frames are run with raw input.
pub struct Frames {
    pub app: App,
    ctx: egui::Context,
    size: egui::Vec2,
    time: f64,
    events: Vec<Event>,
    /// Words of the last frame: where they are, and the part of the window in which they are seen.
    words: Vec<(String, Rect, Rect)>,
    /// Time after which the last frame asked for another one; the window draws on at once for any.
    wakes_in: Duration,
    _state: tempfile::TempDir,
}

impl Frames {
    pub fn new([width, height]: [f32; 2]) -> Self {
        let state = tempfile::tempdir().unwrap();
        let mut app = headless_app(7);
        app.insert_resource(StateFolder(Some(state.path().to_owned())))
            .add_plugins((FilesPlugin, FollowPlugin, PanelsPlugin, DockPlugin, decline_foreign_offers))
            .add_message::<AppExit>();
        let mut app = strict_app(app);
        app.update();
        let entity = app.world_mut().spawn(PrimaryEguiContext).id();
        let ctx = app.world_mut().get_mut::<EguiContext>(entity).unwrap().get_mut().clone();
        let size = egui::vec2(width, height);
        let mut frames = Self {
            app,
            ctx,
            size,
            time: 0.0,
            events: Vec::new(),
            words: Vec::new(),
            wakes_in: Duration::MAX,
            _state: state,
        };
        (0..4).for_each(|_| frames.frame());
        frames
    }

    pub fn frame(&mut self) {
        self.time += 0.4;
        self.ctx.begin_pass(RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, self.size)),
            time: Some(self.time),
            events: std::mem::take(&mut self.events),
            ..default()
        });
        self.app.world_mut().run_schedule(EguiPrimaryContextPass);
        let mut output = self.ctx.end_pass();
        self.wakes_in = output.viewport_output.values().map(|view| view.repaint_delay).min().unwrap_or(Duration::MAX);
        // Nothing is drawn, so no texture has to be made.
        output.textures_delta.clear();
        self.words.clear();
        output.shapes.iter().for_each(|shape| words(&shape.shape, shape.clip_rect, &mut self.words));
        self.app.update();
    }

    pub fn click(&mut self, at: Pos2, button: PointerButton) {
        self.events.push(Event::PointerMoved(at));
        self.frame();
        for pressed in [true, false] {
            self.events.push(Event::PointerButton { pos: at, button, pressed, modifiers: Modifiers::NONE });
            self.frame();
        }
        (0..2).for_each(|_| self.frame());
    }

    pub fn drag(&mut self, from: Pos2, to: Pos2) {
        let button = |pos: Pos2, pressed: bool| Event::PointerButton {
            pos,
            button: PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        };
        self.events.push(Event::PointerMoved(from));
        self.frame();
        self.events.push(button(from, true));
        self.frame();
        for step in 1..=4 {
            self.events.push(Event::PointerMoved(from.lerp(to, step as f32 / 4.0)));
            self.frame();
        }
        self.events.push(button(to, false));
        (0..3).for_each(|_| self.frame());
    }

    /// Place of a text of the last frame, as far as it is seen.
    pub fn find(&self, text: &str) -> Option<Rect> {
        let (_, rect, clip) = self.words.iter().find(|(word, ..)| word == text)?;
        Some(rect.intersect(*clip)).filter(Rect::is_positive)
    }

    fn layout(&self) -> &Layout {
        self.app.world().resource::<Layout>()
    }

    /// The word on a panel's tab, which is in the bar at the top of its place, and the part of the window that shows it.
    fn tab(&self, title: &str) -> (Rect, Rect) {
        let area = self.layout().area(title).unwrap_or_else(|| panic!("{title} is not shown"));
        let bar = Rect::from_min_size(area.min, egui::vec2(area.width(), 24.0));
        let is_it = |(word, rect, _): &&(String, Rect, Rect)| word == title && bar.y_range().contains(rect.center().y);
        let near = |(_, rect, _): &&(String, Rect, Rect)| rect.left() >= bar.left() - 1.0;
        let found = self.words.iter().filter(is_it).find(near);
        found.map(|(_, rect, clip)| (*rect, *clip)).unwrap_or_else(|| panic!("{title} has no tab: {:?}", self.words))
    }
}

fn words(shape: &egui::Shape, clip: Rect, seen: &mut Vec<(String, Rect, Rect)>) {
    match shape {
        egui::Shape::Text(text) => {
            let rect = Rect::from_min_size(text.pos, text.galley.size());
            seen.push((text.galley.text().to_owned(), rect, clip));
        }
        egui::Shape::Vec(shapes) => shapes.iter().for_each(|shape| words(shape, clip, seen)),
        _ => {}
    }
}

fn titles(frames: &Frames) -> Vec<&'static str> {
    frames.app.world().resource::<Panels>().panels.iter().map(|panel| panel.title()).collect()
}

#[test]
fn all_tabs_of_the_usual_layout_lie_in_their_bars() {
    for size in [USUAL, [1024.0, 600.0], [1920.0, 1080.0], [3840.0, 2160.0]] {
        let frames = Frames::new(size);
        for title in titles(&frames) {
            let (word, clip) = frames.tab(title);
            let area = frames.layout().area(title).unwrap();
            assert!(clip.contains_rect(word), "{size:?}: {title} is cut: {word:?} in {clip:?}");
            assert!(area.x_range().contains(word.left() - 7.0), "{size:?}: {title}: {word:?} in {area:?}");
            assert!(area.x_range().contains(word.right() + 7.0), "{size:?}: {title}: {word:?} in {area:?}");
            assert!(word.height() >= 9.0, "{size:?}: {title} can be read: {word:?}");
        }
    }
}

/// Menus, tools, the status line and the panels in front: no word is cut off at a side, or smaller than those of tabs.
#[test]
fn all_words_of_the_window_can_be_read() {
    for size in [[1024.0, 600.0], USUAL, [3840.0, 2160.0]] {
        let frames = Frames::new(size);
        for title in ["File", "Help", "Bones", "Hierarchy", "Log"] {
            assert!(frames.find(title).is_some(), "{size:?}: {title} is not in sight");
        }
        for (word, rect, clip) in frames.words.iter().filter(|(_, rect, clip)| rect.intersects(*clip)) {
            let is_whole = rect.left() >= clip.left() - 1.0 && rect.right() <= clip.right() + 1.0;
            assert!(is_whole, "{size:?}: {word:?} is cut: {rect:?} in {clip:?}");
            assert!(rect.right() <= size[0] && rect.bottom() <= size[1] + 1.0, "{size:?}: {word:?} at {rect:?}");
            assert!(word.trim().is_empty() || rect.height() >= 9.0, "{size:?}: {word:?} is small: {rect:?}");
        }
    }
}

/// Words of the status line share it: the tool's, the next step and the counts, also in a small window or in large letters.
#[test]
fn words_of_the_status_line_never_meet() {
    let hint = "Drag a handle to pose hand_ik_l (world axes: V), or any joint or control to pull it. Ctrl: in steps.";
    for size in [[640.0, 360.0], [853.0, 480.0], [1024.0, 600.0], USUAL, [1920.0, 1080.0]] {
        let mut frames = Frames::new(size);
        let rig = frames.app.world_mut().spawn(Rig::new(Uid(1), "rig")).id();
        frames.app.insert_resource(ActiveRig(rig));
        frames.app.insert_resource(StatusLine { hint: hint.to_owned(), ..default() });
        (0..3).for_each(|_| frames.frame());
        let is_there = |(_, rect, _): &&(String, Rect, Rect)| rect.center().y > size[1] - 18.0;
        let mut line: Vec<(&str, Rect)> =
            frames.words.iter().filter(is_there).map(|(word, rect, _)| (word.as_str(), *rect)).collect();
        line.sort_by(|a, b| a.1.left().total_cmp(&b.1.left()));
        let [(said, left), (end, right)] = line[..] else { panic!("{size:?}: {line:?}") };
        assert!(said == hint && end.starts_with("Next: "), "{size:?}: {line:?}");
        assert!(left.right() < right.left() && right.right() <= size[0], "{size:?}: {line:?}");
        let shares = [left, right].map(|rect| rect.width() / size[0]);
        assert!(shares[0] > 0.25 && shares[1] > 0.15, "{size:?}: both are seen: {line:?}");
    }
}

/// Entries of menus and buttons of the toolbar that can do nothing are greyed, and say why.
#[test]
fn menus_and_the_toolbar_say_why_an_action_can_do_nothing() {
    let mut frames = Frames::new(USUAL);
    let rig = frames.app.world_mut().spawn(Rig::new(Uid(1), "rig")).id();
    frames.app.insert_resource(ActiveRig(rig));
    (0..3).for_each(|_| frames.frame());
    let point = |frames: &mut Frames, word: &str| {
        let at = frames.find(word).unwrap_or_else(|| panic!("{word} is not in sight")).center();
        frames.events.push(Event::PointerMoved(at));
        (0..5).for_each(|_| frames.frame());
        at
    };
    let is_asked = |frames: &Frames, action: &str| {
        let mut told = frames.app.world().resource::<LogBook>().entries();
        told.any(|entry| entry.notice.text.starts_with(action))
    };
    let fit = point(&mut frames, "Fit");
    assert!(frames.find("no mesh is open").is_some(), "the button says why");
    frames.click(fit, PointerButton::Primary);
    let menu = point(&mut frames, "Rig");
    frames.click(menu, PointerButton::Primary);
    let entry = point(&mut frames, "Store pose");
    assert!(frames.find("there are no joints").is_some(), "the entry says why");
    frames.click(entry, PointerButton::Primary);
    assert!(!is_asked(&frames, "Store pose") && !is_asked(&frames, "There is no mesh"));
}

/// A field that waits for a key asks for no frame, as a caret that blinks would.
#[test]
fn a_text_field_with_the_focus_asks_for_no_frame() {
    let mut frames = Frames::new(USUAL);
    let mut rig = Rig::new(Uid(1), "rig");
    let joint = JointData { uid: Uid(2), ..default() };
    rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent: None, index: 0 }).unwrap();
    let rig = frames.app.world_mut().spawn(rig).id();
    frames.app.insert_resource(ActiveRig(rig));
    (0..4).for_each(|_| frames.frame());
    let field = frames.find("Filter").expect("the hierarchy has a field").center();
    frames.click(field, PointerButton::Primary);
    frames.events.push(Event::PointerMoved(Pos2::new(640.0, 300.0)));
    (0..20).for_each(|_| frames.frame());
    assert!(frames.ctx.text_edit_focused(), "the field has the focus");
    assert_eq!(frames.wakes_in, Duration::MAX);
}

/// The bar of the viewport's tab is none of its picture.
#[test]
fn the_viewport_has_two_fifths_of_a_large_window() {
    for size in [[1920.0, 1080.0], [3840.0, 2160.0]] {
        let frames = Frames::new(size);
        let area = frames.layout().area("Viewport").expect("the viewport always stays");
        let share = area.width() * (area.height() - 24.0) / (size[0] * size[1]);
        assert!(share >= 0.4, "{share} of {size:?}");
    }
}

/// Larger letters, or a smaller window, leave places less room than they had; later they have it again.
#[test]
fn places_have_their_former_size_after_a_smaller_window() {
    let mut frames = Frames::new(USUAL);
    let sizes = |frames: &Frames| {
        let layout = frames.layout();
        let area = |title| layout.area(title).expect("the panel is shown");
        ["Hierarchy", "Properties", "History", "Timeline", VIEWPORT].map(|title| area(title).size().round())
    };
    let resize = |frames: &mut Frames, scale: f32| {
        frames.size = egui::vec2(USUAL[0] / scale, USUAL[1] / scale);
        (0..4).for_each(|_| frames.frame());
    };
    let before = sizes(&frames);
    for scale in [1.1, 1.25, 1.5, 1.75, 2.0, 1.75, 1.5, 1.25, 1.1, 1.0] {
        resize(&mut frames, scale);
        let least = sizes(&frames)[0].x;
        assert!(least >= 170.0, "{scale}: the panels at the left can be read: {least}");
    }
    assert_eq!(sizes(&frames), before);

    // A border that a person moves while there is little room stays where it was put.
    resize(&mut frames, 2.0);
    let area = frames.layout().area("Hierarchy").expect("the panel is shown");
    let (from, to) = (Pos2::new(area.right() + 1.0, area.center().y), Pos2::new(area.right() + 41.0, area.center().y));
    frames.drag(from, to);
    let moved = sizes(&frames)[0].x;
    assert!((moved - area.width() - 40.0).abs() < 4.0, "{moved} after {}", area.width());
    resize(&mut frames, 1.0);
    resize(&mut frames, 2.0);
    assert!((sizes(&frames)[0].x - moved).abs() < 2.0, "{:?} after {moved}", sizes(&frames));

    // What is kept for the next time are the borders for a window of any size.
    let mut frames = Frames::new(USUAL);
    resize(&mut frames, 2.0);
    let text = ron::to_string(frames.layout()).expect("a layout is text");
    let again: Layout = ron::from_str(&text).expect("a layout is read");
    frames.app.insert_resource(again);
    resize(&mut frames, 1.0);
    assert_eq!(sizes(&frames), before);
}

#[test]
fn each_panel_is_reached_with_one_click_on_its_tab() {
    let mut frames = Frames::new(USUAL);
    let mut titles = titles(&frames);
    titles.reverse();
    let front = |frames: &Frames| titles.iter().filter(|title| frames.layout().is_forward(title)).count();
    let places = front(&frames) + 1;
    assert_eq!(frames.layout().places().len(), places, "the viewport has a place of its own");
    for title in &titles {
        let (word, _) = frames.tab(title);
        frames.click(word.center(), PointerButton::Primary);
        assert!(frames.layout().is_forward(title), "{title}");
    }
    assert_eq!(front(&frames) + 1, places);
}

#[test]
fn a_closed_panel_comes_back_beside_its_neighbours() {
    let mut frames = Frames::new(USUAL);
    let of = |frames: &Frames, title: &str| {
        let places = frames.layout().places();
        places.iter().find(|place| place.contains(&title)).map(|place| place.len())
    };
    for title in ["Face", "Skinning", "Sets", "Graph"] {
        let before = of(&frames, title);
        let (word, _) = frames.tab(title);
        frames.click(word.center(), PointerButton::Middle);
        assert_eq!(of(&frames, title), None, "{title} is closed");
        let mut layout = frames.layout().clone();
        layout.bring_forward(title);
        frames.app.insert_resource(layout);
        (0..3).for_each(|_| frames.frame());
        assert_eq!(of(&frames, title), before, "{title} is where it was");
        assert!(frames.layout().is_forward(title));
    }
    // The menu of a tab closes its panel, too; the viewport stays.
    let (word, _) = frames.tab("Log");
    frames.click(word.center(), PointerButton::Secondary);
    let close = frames.words.iter().find(|(text, ..)| text == "Close").map(|(_, rect, _)| rect.center());
    frames.click(close.expect("the menu has an entry"), PointerButton::Primary);
    assert!(!frames.layout().shows("Log"));
    let (word, _) = frames.tab(VIEWPORT);
    frames.click(word.center(), PointerButton::Middle);
    assert!(frames.layout().shows(VIEWPORT));
}

#[test]
fn a_panel_whose_neighbours_are_all_closed_is_shown_all_the_same() {
    let mut layout = Layout::default();
    for place in [["Timeline", "Curves", "Graph", "Process"], ["Updater", "Display", "Log", "Face"]] {
        place.into_iter().for_each(|title| layout.toggle(title));
    }
    let places = layout.places().len();
    layout.bring_forward("Graph");
    assert!(layout.is_forward("Graph"));
    assert_eq!(layout.places().len(), places + 1, "it is below the viewport again");
    for title in ["Properties", "Tags", "Controls", "Skinning"] {
        layout.toggle(title);
    }
    layout.bring_forward("Tags");
    assert!(layout.is_forward("Tags"));
}
