//! Keys that people give to actions: the next key that is pressed, each for one action alone.

use bevy::{
    input::{
        ButtonState,
        keyboard::{Key, KeyCode, KeyboardInput},
    },
    prelude::*,
    window::WindowFocused,
};
use rigsmith::{
    editor::{
        actions::{Action, ActionRequest},
        keys::{Chord, ChosenKey, KeyBindings, KeysPlugin},
        notice::Notice,
        palette,
    },
    headless::headless_app,
    test_app::strict_app,
};

fn press(app: &mut App, key_code: KeyCode, logical_key: Key) -> Vec<Action> {
    let window = Entity::PLACEHOLDER;
    let state = ButtonState::Pressed;
    let input = KeyboardInput { key_code, logical_key, state, text: None, repeat: false, window };
    app.world_mut().write_message(input);
    app.update();
    app.world_mut().resource_mut::<Messages<ActionRequest>>().drain().map(|request| request.0).collect()
}

fn chord(text: &str) -> Chord {
    Chord::try_from(text.to_owned()).unwrap()
}

#[test]
fn the_next_key_is_that_of_the_chosen_action() {
    let mut app = headless_app(1);
    app.add_message::<KeyboardInput>().add_message::<WindowFocused>().add_plugins(KeysPlugin);
    let mut app = strict_app(app);
    let (j, x) = (|| Key::Character("j".into()), || Key::Character("x".into()));
    assert!(press(&mut app, KeyCode::KeyJ, j()).is_empty(), "no action has it");

    app.insert_resource(ChosenKey(Some(Action::Grid)));
    assert!(press(&mut app, KeyCode::KeyJ, j()).is_empty(), "the key is chosen, not used");
    let bindings = |app: &App| app.world().resource::<KeyBindings>().clone();
    assert_eq!(bindings(&app).keys(Action::Grid).collect::<Vec<_>>(), [&chord("J")]);
    assert_eq!(press(&mut app, KeyCode::KeyJ, j()), [Action::Grid]);

    // A key of another action goes over, and that is told.
    app.insert_resource(ChosenKey(Some(Action::Grid)));
    app.world_mut().resource_mut::<Messages<Notice>>().clear();
    press(&mut app, KeyCode::KeyX, x());
    assert_eq!(press(&mut app, KeyCode::KeyX, x()), [Action::Grid]);
    let now = bindings(&app);
    assert!(now.doubles().is_empty() && now.key(Action::XRay).is_none() && now.action(&chord("J")).is_none());
    let told: Vec<String> =
        app.world_mut().resource_mut::<Messages<Notice>>().drain().map(|notice| notice.text).collect();
    assert!(told.iter().any(|told| told.starts_with("X is the key of")), "{told:?}");

    // Escape leaves the keys as they are.
    app.insert_resource(ChosenKey(Some(Action::Labels)));
    assert!(press(&mut app, KeyCode::Escape, Key::Escape).is_empty());
    assert_eq!(bindings(&app), now);
    assert_eq!(*app.world().resource::<ChosenKey>(), ChosenKey(None));
}

#[test]
fn every_action_takes_another_key() {
    let mut app = headless_app(1);
    app.add_message::<KeyboardInput>().add_message::<WindowFocused>().add_plugins(KeysPlugin);
    let mut app = strict_app(app);
    for action in Action::all() {
        app.insert_resource(ChosenKey(Some(action)));
        let j = || Key::Character("j".into());
        assert!(press(&mut app, KeyCode::KeyJ, j()).is_empty(), "{action:?}: the key is chosen, not used");
        let bindings = app.world().resource::<KeyBindings>();
        assert_eq!((bindings.keys(action).count(), bindings.action(&chord("J"))), (1, Some(action)));
        assert!(bindings.doubles().is_empty(), "{action:?}");
        assert_eq!(press(&mut app, KeyCode::KeyJ, j()), [action]);
    }
}

/// "graph" is in "orthographic", too.
#[test]
fn the_palette_lists_words_that_begin_so_before_parts_of_words() {
    let found = palette::found("graph");
    assert_eq!(found.last(), Some(&Action::Projection), "{found:?}");
    assert!(found.len() > 2, "{found:?}");
}
