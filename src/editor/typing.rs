//! Keys for panels, each with the modifiers that were held when it was pressed.
//!
//! Where a frame takes long, a whole `Ctrl+A` comes within one frame. The modifiers at the end of the frame are none then, and
//! the letter would be typed into the text field that it was to select all of.

use bevy::{
    input::{
        ButtonState,
        keyboard::{Key, KeyboardFocusLost, KeyboardInput},
    },
    prelude::*,
};
use bevy_egui::{
    EguiClipboard, EguiContextSettings, EguiInputSet, EguiInputSystemSettings, EguiPreUpdateSet, PrimaryEguiContext,
    egui::{self, Event},
    helpers::{bevy_to_egui_key, bevy_to_egui_physical_key},
    input::{EguiInputEvent, ModifierKeysState},
};

/// Plugin that hands keys to panels.
pub struct TypingPlugin;

impl Plugin for TypingPlugin {
    fn build(&self, app: &mut App) {
        app.add_message::<KeyboardInput>()
            .add_message::<KeyboardFocusLost>()
            .add_message::<EguiInputEvent>()
            .init_resource::<EguiClipboard>()
            .add_systems(
                PreUpdate,
                hand_over
                    .in_set(EguiPreUpdateSet::ProcessInput)
                    .after(EguiInputSet::ReadBevyMessages)
                    .before(EguiInputSet::WriteEguiEvents),
            );
    }
}

/// Settings of the panels' context, whose keys come from [`TypingPlugin`].
pub fn context_settings() -> EguiContextSettings {
    EguiContextSettings {
        input_system_settings: EguiInputSystemSettings { run_write_keyboard_input_messages_system: false, ..default() },
        ..default()
    }
}

fn hand_over(
    mut keys: MessageReader<KeyboardInput>,
    mut unfocused: MessageReader<KeyboardFocusLost>,
    mut held: Local<ModifierKeysState>,
    mut clipboard: ResMut<EguiClipboard>,
    contexts: Query<Entity, With<PrimaryEguiContext>>,
    mut events: MessageWriter<EguiInputEvent>,
) {
    // Keys that are released in another window are not told to this one.
    if unfocused.read().count() > 0 {
        *held = ModifierKeysState::default();
    }
    let Ok(context) = contexts.single() else { return keys.clear() };
    for key in keys.read() {
        let is_pressed = key.state == ButtonState::Pressed;
        hold(&mut held, &key.logical_key, is_pressed);
        let modifiers = held.to_egui_modifiers();
        let mut send = |event| {
            events.write(EguiInputEvent { context, event });
        };
        if let Some(text) = typed(key).filter(|_| held.text_input_is_allowed()) {
            send(Event::Text(text));
        }
        let physical_key = bevy_to_egui_physical_key(&key.key_code);
        // Layouts without Latin letters have those of the places of their keys.
        let Some(name) = bevy_to_egui_key(&key.logical_key).or(physical_key) else { continue };
        send(Event::Key { key: name, physical_key, pressed: is_pressed, repeat: false, modifiers });
        if is_pressed && modifiers.command {
            let event = match name {
                egui::Key::C => Some(Event::Copy),
                egui::Key::X => Some(Event::Cut),
                egui::Key::V => clipboard.get_text().map(Event::Text),
                _ => None,
            };
            event.into_iter().for_each(send);
        }
    }
}

fn hold(held: &mut ModifierKeysState, key: &Key, is_pressed: bool) {
    match key {
        Key::Shift => held.shift = is_pressed,
        Key::Control => held.ctrl = is_pressed,
        Key::Alt => held.alt = is_pressed,
        Key::Super | Key::Meta => held.win = is_pressed,
        _ => {}
    }
}

/// Text that the press of a key means.
fn typed(key: &KeyboardInput) -> Option<String> {
    match &key.logical_key {
        _ if key.state == ButtonState::Released => None,
        Key::Character(text) if !text.chars().any(char::is_control) => Some(text.to_string()),
        Key::Space => Some(" ".to_owned()),
        _ => None,
    }
}
