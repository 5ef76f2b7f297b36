//! Keys in text fields: each has the modifiers of its own moment, however many come in one frame.

use bevy::{
    input::{
        ButtonState,
        keyboard::{Key, KeyCode, KeyboardFocusLost, KeyboardInput},
    },
    prelude::*,
};
use bevy_egui::{
    EguiContextSettings, PrimaryEguiContext,
    egui::{self, Event, RawInput},
    input::EguiInputEvent,
};
use rigsmith::{
    editor::typing::{TypingPlugin, context_settings},
    test_app::strict_app,
};

/// A text field that has the focus, and a keyboard before it.
struct Field {
    app: App,
    window: Entity,
    ctx: egui::Context,
    text: String,
    time: f64,
}

impl Field {
    fn new(text: &str) -> Self {
        let mut app = App::new();
        app.add_plugins(TypingPlugin);
        let mut app = strict_app(app);
        app.world_mut().spawn((PrimaryEguiContext, context_settings()));
        let window = app.world_mut().spawn_empty().id();
        let mut field = Self { app, window, ctx: egui::Context::default(), text: text.to_owned(), time: 0.0 };
        (0..3).for_each(|_| drop(field.frame(&[])));
        field
    }

    /// A frame in which keys go down (`+`) and up (`-`), in that order; what the field is told.
    fn frame(&mut self, keys: &[&str]) -> Vec<Event> {
        for key in keys {
            let (state, name) = key.split_at(1);
            let (logical_key, key_code) = match name {
                "Ctrl" => (Key::Control, KeyCode::ControlLeft),
                "Alt" => (Key::Alt, KeyCode::AltLeft),
                "Space" => (Key::Space, KeyCode::Space),
                "a" => (Key::Character("a".into()), KeyCode::KeyA),
                "c" => (Key::Character("c".into()), KeyCode::KeyC),
                "@" => (Key::Character("@".into()), KeyCode::KeyQ),
                other => (Key::Character(other.into()), KeyCode::KeyX),
            };
            let state = if state == "+" { ButtonState::Pressed } else { ButtonState::Released };
            let window = self.window;
            let input = KeyboardInput { key_code, logical_key, state, text: None, repeat: false, window };
            self.app.world_mut().write_message(input);
        }
        self.app.update();
        let sent = self.app.world_mut().resource_mut::<Messages<EguiInputEvent>>().drain().collect::<Vec<_>>();
        let events: Vec<Event> = sent.into_iter().map(|sent| sent.event).collect();
        self.time += 1.0;
        let input = RawInput { time: Some(self.time), events: events.clone(), ..default() };
        let text = &mut self.text;
        let mut output = self.ctx.run_ui(input, |ui| ui.text_edit_singleline(text).request_focus());
        output.textures_delta.clear();
        events
    }
}

#[test]
fn a_whole_chord_in_one_frame_types_nothing_and_does_what_it_is_for() {
    // In a frame each, as on a fast machine, and all in one.
    let frames: [&[&[&str]]; 3] = [
        &[&["+Ctrl"], &["+a"], &["-a"], &["-Ctrl"]],
        &[&["+Ctrl", "+a", "-a", "-Ctrl"]],
        &[&["+Ctrl", "+a"], &["-a", "-Ctrl"]],
    ];
    for frames in frames {
        let mut field = Field::new("one two");
        frames.iter().for_each(|keys| drop(field.frame(keys)));
        assert_eq!(field.text, "one two", "{frames:?}");
        field.frame(&["+x", "-x"]);
        assert_eq!(field.text, "x", "all of it was selected: {frames:?}");
    }
}

#[test]
fn letters_before_and_after_a_chord_in_the_same_frame_are_typed() {
    let mut field = Field::new("");
    field.frame(&["+x", "-x", "+Ctrl"]);
    assert_eq!(field.text, "x", "the modifier came after it");
    field.frame(&["-Ctrl", "+Space", "-Space", "+a", "-a"]);
    assert_eq!(field.text, "x a");
    field.frame(&["+Ctrl", "+a", "-a", "-Ctrl", "+c", "-c"]);
    assert_eq!(field.text, "c", "it replaces what the chord selects");
    // Ctrl and Alt together are the key for further signs.
    field.frame(&["+Ctrl", "+Alt", "+@", "-@", "-Alt", "-Ctrl"]);
    assert_eq!(field.text, if cfg!(target_os = "macos") { "c" } else { "c@" });
}

#[test]
fn a_copy_in_one_frame_is_one_and_lost_keys_are_forgotten() {
    let mut field = Field::new("one");
    // The chords of macOS have another key.
    if !cfg!(target_os = "macos") {
        let events = field.frame(&["+Ctrl", "+a", "-a", "+c", "-c", "-Ctrl"]);
        assert_eq!(events.iter().filter(|event| **event == Event::Copy).count(), 1, "{events:?}");
        assert!(!events.iter().any(|event| matches!(event, Event::Text(_))), "{events:?}");
    }
    field.frame(&["+Ctrl"]);
    field.app.world_mut().write_message(KeyboardFocusLost);
    field.frame(&["+x", "-x"]);
    assert!(field.text.ends_with('x'), "Ctrl was released in another window: {}", field.text);
}

#[test]
fn panels_get_no_key_twice() {
    let settings: EguiContextSettings = context_settings();
    assert!(!settings.input_system_settings.run_write_keyboard_input_messages_system);
    let mut field = Field::new("");
    let events = field.frame(&["+a", "-a"]);
    assert_eq!(events.iter().filter(|event| matches!(event, Event::Text(_))).count(), 1, "{events:?}");
}
