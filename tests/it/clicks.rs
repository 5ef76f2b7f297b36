//! Clicks in panels in slow frames: each is on the widget under it, however far the pointer has gone by the end of the frame.

use bevy::{prelude::*, window::RequestRedraw};
use bevy_egui::{
    EguiInput, PrimaryEguiContext,
    egui::{self, Event, Modifiers, PointerButton, Pos2, RawInput, Rect, Sense, vec2},
};
use rigsmith::{editor::clicks::ClicksPlugin, test_app::strict_app};

/// Places of two buttons, and of something that is dragged.
const BUTTONS: [(&str, Pos2); 2] = [("a", Pos2::new(50.0, 50.0)), ("b", Pos2::new(250.0, 50.0))];
const HANDLE: Pos2 = Pos2::new(50.0, 150.0);

/// A panel with the buttons and the handle, and what became of them.
struct Panel {
    app: App,
    context: Entity,
    ctx: egui::Context,
    time: f64,
    clicked: Vec<&'static str>,
    dragged: f32,
}

impl Panel {
    fn new() -> Self {
        let mut app = App::new();
        app.add_plugins(ClicksPlugin);
        let mut app = strict_app(app);
        let context = app.world_mut().spawn(PrimaryEguiContext).id();
        let (ctx, clicked) = (egui::Context::default(), Vec::new());
        let mut panel = Self { app, context, ctx, time: 0.0, clicked, dragged: 0.0 };
        (0..3).for_each(|_| {
            panel.frame(&[]);
        });
        panel
    }

    /// A frame in which these events come; the number of those that the panel gets, and whether another frame is asked for.
    fn frame(&mut self, events: &[Event]) -> (usize, bool) {
        let mut input = self.app.world_mut().get_mut::<EguiInput>(self.context).unwrap();
        input.events.extend(events.iter().cloned());
        self.app.update();
        let mut input = self.app.world_mut().get_mut::<EguiInput>(self.context).unwrap();
        let events = std::mem::take(&mut input.events);
        let count = events.len();
        let is_asked = self.app.world_mut().resource_mut::<Messages<RequestRedraw>>().drain().count() > 0;
        self.time += 0.3;
        let screen_rect = Some(Rect::from_min_size(Pos2::ZERO, vec2(400.0, 300.0)));
        let input = RawInput { screen_rect, time: Some(self.time), events, ..default() };
        let (clicked, dragged) = (&mut self.clicked, &mut self.dragged);
        let mut output = self.ctx.run_ui(input, |ui| {
            for (name, at) in BUTTONS {
                if ui.place(Rect::from_center_size(at, vec2(40.0, 20.0)), egui::Button::new(name)).clicked() {
                    clicked.push(name);
                }
            }
            let handle = Rect::from_center_size(HANDLE, vec2(40.0, 20.0));
            *dragged += ui.interact(handle, egui::Id::new("handle"), Sense::drag()).drag_delta().x;
        });
        output.textures_delta.clear();
        (count, is_asked)
    }
}

fn to(at: Pos2) -> Event {
    Event::PointerMoved(at)
}

fn button(pos: Pos2, pressed: bool) -> Event {
    Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers: Modifiers::NONE }
}

#[test]
fn a_click_is_on_the_button_under_it_though_the_pointer_moves_on() {
    let [(_, a), (_, b)] = BUTTONS;
    let mut panel = Panel::new();
    assert_eq!(panel.frame(&[to(a), button(a, true), button(a, false), to(b)]), (3, true));
    assert_eq!(panel.frame(&[]), (1, false), "the rest comes in the next frame");
    panel.frame(&[]);
    assert_eq!(panel.clicked, ["a"]);
    // The pointer comes from there, and goes back.
    panel.frame(&[button(b, true), button(b, false), to(a), button(a, true), button(a, false), to(b)]);
    (0..4).for_each(|_| {
        panel.frame(&[]);
    });
    assert_eq!(panel.clicked, ["a", "b", "a"]);
    assert_eq!(panel.frame(&[]), (0, false), "nothing waits any more");
}

#[test]
fn a_trembling_hand_clicks_within_one_frame() {
    let [(_, a), _] = BUTTONS;
    let mut panel = Panel::new();
    let near = a + vec2(2.0, 1.0);
    assert_eq!(panel.frame(&[to(a), button(a, true), to(near), button(near, false)]), (4, false));
    panel.frame(&[]);
    assert_eq!(panel.clicked, ["a"]);
}

#[test]
fn a_whole_drag_in_one_frame_goes_its_whole_way() {
    let mut panel = Panel::new();
    let (half, end) = (HANDLE + vec2(40.0, 0.0), HANDLE + vec2(150.0, 0.0));
    panel.frame(&[to(HANDLE), button(HANDLE, true), to(half), to(end), button(end, false), to(BUTTONS[0].1)]);
    (0..5).for_each(|_| {
        panel.frame(&[]);
    });
    assert!((panel.dragged - 150.0).abs() < 0.5, "{}", panel.dragged);
    assert!(panel.clicked.is_empty());
}
