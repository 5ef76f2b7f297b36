//! Key bindings: the action of each key.

use bevy::{
    input::{
        ButtonState,
        keyboard::{Key, KeyboardInput},
    },
    prelude::*,
    window::{WindowEvent, WindowFocused},
};
use bevy_egui::{EguiContext, PrimaryEguiContext};
use serde::{Deserialize, Serialize};

use super::{
    actions::{Action, ActionRequest},
    files::dialog::Dialog,
    help::describe,
    mode::Mode,
    notice::Notice,
    panels::{
        graph::{GraphView, over_graph},
        timeline::{Timeline, TimelineAction, over_timeline},
    },
    pointer::ModifierKeys,
    tools::paint::brush::BrushAction,
};

/// Plugin that turns key presses into actions.
pub struct KeysPlugin;

impl Plugin for KeysPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<KeyBindings>()
            .init_resource::<ChosenKey>()
            .add_message::<ActionRequest>()
            .add_message::<KeyBound>()
            .add_message::<Notice>()
            .add_message::<WindowEvent>()
            .add_systems(
                PreUpdate,
                (press_keys, bind).chain().after(bevy::input::InputSystems).after(super::pointer::follow_pointer),
            );
    }
}

/// A key with its modifiers, for example `Ctrl+Shift+S`.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Chord {
    /// Name of the key: `A`, `1`, `Tab`, `Delete`, `F2`.
    pub key: String,
    /// Control, or Command.
    pub control: bool,
    /// Shift.
    pub shift: bool,
    /// Alt.
    pub alt: bool,
}

/// Error of a text that names no key.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` names no key; write one such as `S`, `Ctrl+S`, `Shift+F`, `Tab` or `F2`")]
pub struct ChordError(String);

impl TryFrom<String> for Chord {
    type Error = ChordError;

    fn try_from(text: String) -> Result<Self, ChordError> {
        let mut chord = Self { key: String::new(), control: false, shift: false, alt: false };
        for part in text.split('+') {
            match part.trim() {
                "Ctrl" | "Cmd" => chord.control = true,
                "Shift" => chord.shift = true,
                "Alt" => chord.alt = true,
                key if chord.key.is_empty() && !key.is_empty() => chord.key = key.to_owned(),
                _ => return Err(ChordError(text.clone())),
            }
        }
        if chord.key.is_empty() { Err(ChordError(text)) } else { Ok(chord) }
    }
}

impl From<Chord> for String {
    fn from(chord: Chord) -> Self {
        chord.to_string()
    }
}

impl std::fmt::Display for Chord {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (held, name) in [(self.control, "Ctrl+"), (self.shift, "Shift+"), (self.alt, "Alt+")] {
            if held {
                f.write_str(name)?;
            }
        }
        f.write_str(&self.key)
    }
}

/// Keys and their actions.
#[derive(Resource, Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct KeyBindings(pub Vec<(Chord, Action)>);

/// Action that waits for its key: the next one that is pressed, unless that is Escape.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ChosenKey(pub Option<Action>);

/// Message that a person pressed a key to bind an action to it. The key takes the place of the action's former keys.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
pub struct KeyBound {
    /// The key.
    pub chord: Chord,
    /// The action.
    pub action: Action,
}

/// Key that was bound to two actions.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DoubleBinding {
    /// The key.
    pub chord: Chord,
    /// The action that keeps it.
    pub kept: Action,
    /// The action that does not get it.
    pub refused: Action,
}

/// Default bindings.
const DEFAULTS: &[(&str, Action)] = &[
    ("Q", Action::Mode(Mode::Select)),
    ("A", Action::Mode(Mode::Place)),
    ("S", Action::Mode(Mode::Stroke)),
    ("W", Action::Mode(Mode::Move)),
    ("E", Action::Mode(Mode::Rotate)),
    ("R", Action::Mode(Mode::Scale)),
    ("P", Action::Mode(Mode::Pose)),
    ("G", Action::Mode(Mode::Weights)),
    ("T", Action::Mode(Mode::Paint)),
    ("Ctrl+N", Action::New),
    ("Ctrl+O", Action::Open),
    ("Ctrl+S", Action::Save),
    ("Ctrl+Shift+S", Action::SaveAs),
    ("Ctrl+E", Action::Export),
    ("Ctrl+Q", Action::Quit),
    ("Ctrl+Z", Action::Undo),
    ("Ctrl+Shift+Z", Action::Redo),
    ("Ctrl+Y", Action::Redo),
    ("Delete", Action::Delete),
    ("Shift+Delete", Action::DeleteHierarchy),
    ("Ctrl+A", Action::SelectAll),
    ("Ctrl+D", Action::SelectNone),
    ("Ctrl+M", Action::MirrorSelected),
    ("M", Action::Symmetry),
    ("C", Action::MoveChildren),
    ("Enter", Action::Accept),
    ("Escape", Action::Cancel),
    ("Tab", Action::NextVolume),
    ("F", Action::Fit),
    ("Ctrl+F", Action::FitPart),
    ("N", Action::NextDoubt),
    ("B", Action::Skin),
    ("Shift+P", Action::ResetPose),
    ("Ctrl+Shift+P", Action::StorePose),
    ("Ctrl+P", Action::Palette),
    ("Ctrl+B", Action::Build),
    ("Ctrl+Shift+B", Action::RollBack),
    ("Ctrl+Right", Action::StepForward),
    ("Ctrl+Left", Action::StepBack),
    ("V", Action::GizmoSpace),
    ("Shift+F", Action::FrameSelected),
    ("Home", Action::FrameAll),
    ("1", Action::ViewFront),
    ("Ctrl+1", Action::ViewBack),
    ("3", Action::ViewLeft),
    ("Ctrl+3", Action::ViewRight),
    ("7", Action::ViewTop),
    ("Ctrl+7", Action::ViewBottom),
    ("5", Action::Projection),
    ("X", Action::XRay),
    ("Z", Action::Wireframe),
    ("L", Action::Labels),
    ("Shift+L", Action::LocalAxes),
    ("Shift+G", Action::Grid),
    ("Shift+C", Action::Controls),
    ("F1", Action::Help),
    ("Shift+F1", Action::StartPage),
    ("H", Action::Bones),
    ("Shift+H", Action::Meshes),
    ("Shift+D", Action::Deforming),
    ("Ctrl+Plus", Action::UiLarger),
    ("Ctrl+Shift+Plus", Action::UiLarger),
    ("Ctrl+Equal", Action::UiLarger),
    ("Ctrl+Minus", Action::UiSmaller),
    ("Ctrl+0", Action::UiUsual),
    ("BracketLeft", Action::Brush(BrushAction::Smaller)),
    ("BracketRight", Action::Brush(BrushAction::Larger)),
    ("Shift+BracketLeft", Action::Brush(BrushAction::Weaker)),
    ("Shift+BracketRight", Action::Brush(BrushAction::Stronger)),
    ("Shift+T", Action::Brush(BrushAction::Reach)),
    ("Ctrl+T", Action::Brush(BrushAction::Colors)),
    ("Ctrl+L", Action::Brush(BrushAction::Lock)),
    ("Space", Action::Timeline(TimelineAction::Play)),
    ("Period", Action::Timeline(TimelineAction::NextFrame)),
    ("Comma", Action::Timeline(TimelineAction::PreviousFrame)),
    ("Shift+Period", Action::Timeline(TimelineAction::NextKey)),
    ("Shift+Comma", Action::Timeline(TimelineAction::PreviousKey)),
    ("Ctrl+Home", Action::Timeline(TimelineAction::Start)),
    ("Ctrl+End", Action::Timeline(TimelineAction::End)),
    ("Shift+Home", Action::Timeline(TimelineAction::Fit)),
    ("K", Action::Timeline(TimelineAction::Key)),
    ("Shift+K", Action::Timeline(TimelineAction::KeyAll)),
    ("Ctrl+K", Action::Timeline(TimelineAction::AutoKey)),
    ("Shift+M", Action::Timeline(TimelineAction::Marker)),
    ("Ctrl+C", Action::Timeline(TimelineAction::Copy)),
    ("Ctrl+V", Action::Timeline(TimelineAction::Paste)),
    ("Ctrl+Delete", Action::Timeline(TimelineAction::Delete)),
    ("Ctrl+Shift+M", Action::Timeline(TimelineAction::Mirror)),
    ("Ctrl+I", Action::Timeline(TimelineAction::Import)),
];

impl Default for KeyBindings {
    fn default() -> Self {
        let chords =
            DEFAULTS.iter().filter_map(|(text, action)| Some((Chord::try_from((*text).to_owned()).ok()?, *action)));
        Self(chords.collect())
    }
}

impl KeyBindings {
    /// The action of a key.
    pub fn action(&self, chord: &Chord) -> Option<Action> {
        self.0.iter().find(|(known, _)| known == chord).map(|(_, action)| *action)
    }

    /// The first key of an action, for menus and tooltips.
    pub fn key(&self, action: Action) -> Option<&Chord> {
        self.0.iter().find(|(_, known)| *known == action).map(|(chord, _)| chord)
    }

    /// All keys of an action.
    pub fn keys(&self, action: Action) -> impl Iterator<Item = &Chord> {
        self.0.iter().filter(move |(_, known)| *known == action).map(|(chord, _)| chord)
    }

    /// Binds a key to an action in place of the action's keys; returns the action that had the key before.
    pub fn bind(&mut self, chord: Chord, action: Action) -> Option<Action> {
        let before = self.action(&chord).filter(|other| *other != action);
        self.0.retain(|(known, other)| *known != chord && *other != action);
        self.0.push((chord, action));
        before
    }

    /// Removes the bindings of keys that are bound to another action before; returns them.
    pub fn refuse_doubles(&mut self) -> Vec<DoubleBinding> {
        let mut refused = Vec::new();
        let mut kept: Vec<(Chord, Action)> = Vec::with_capacity(self.0.len());
        for (chord, action) in std::mem::take(&mut self.0) {
            match kept.iter().find(|(known, _)| *known == chord) {
                Some((_, first)) if *first == action => {}
                Some((_, first)) => refused.push(DoubleBinding { chord, kept: *first, refused: action }),
                None => kept.push((chord, action)),
            }
        }
        self.0 = kept;
        refused
    }

    /// Chords bound to two actions.
    pub fn doubles(&self) -> Vec<&Chord> {
        let twice = |number: usize| self.0[..number].iter().any(|(chord, _)| *chord == self.0[number].0);
        (0..self.0.len()).filter(|number| twice(*number)).map(|number| &self.0[number].0).collect()
    }
}

/// Name of a key: letters, plus and minus by the character they type, all other keys by their position.
pub fn key_name(input: &KeyboardInput) -> Option<String> {
    if let Key::Character(text) = &input.logical_key {
        let mut letters = text.chars();
        match (letters.next(), letters.next()) {
            (Some(letter), None) if letter.is_alphabetic() => return Some(letter.to_uppercase().collect()),
            (Some('+'), None) => return Some("Plus".to_owned()),
            (Some('-'), None) => return Some("Minus".to_owned()),
            _ => {}
        }
    }
    let name = format!("{:?}", input.key_code);
    let short = ["Key", "Digit", "Numpad", "Arrow"].iter().find_map(|prefix| name.strip_prefix(prefix));
    let name = short.unwrap_or(&name);
    (!name.is_empty() && !name.contains(' ')).then(|| name.to_owned())
}

/// Turns key presses into actions, unless a text field has the keyboard focus.
///
/// Actions are carried out before the pointer's events of their frame. In a slow frame a button may be released and a key be
/// pressed after it: that key waits for the next frame, and so meets what the release did.
fn press_keys(
    mut keys: MessageReader<KeyboardInput>,
    mut events: MessageReader<WindowEvent>,
    mut waiting: Local<Vec<Action>>,
    mut lost: MessageReader<WindowFocused>,
    mut held: Local<ModifierKeys>,
    bindings: Res<KeyBindings>,
    (dialog, timeline, graph): (Option<Res<Dialog>>, Option<Res<Timeline>>, Option<Res<GraphView>>),
    mut chosen: ResMut<ChosenKey>,
    mut contexts: Query<&mut EguiContext, With<PrimaryEguiContext>>,
    (mut actions, mut bound): (MessageWriter<ActionRequest>, MessageWriter<KeyBound>),
) {
    actions.write_batch(waiting.drain(..).map(ActionRequest));
    let first_late = keys.len().saturating_sub(keys_after_release(events.read()));
    if lost.read().any(|focus| !focus.focused) {
        *held = ModifierKeys::default();
    }
    if keys.is_empty() {
        return;
    }
    let typing = contexts.iter_mut().any(|mut context| context.get_mut().egui_wants_keyboard_input());
    let is_over_timeline = timeline.is_some_and(|timeline| timeline.hovered.is_some());
    let is_over_graph = graph.is_some_and(|graph| graph.hovered);
    let is_asked = dialog.is_some_and(|dialog| dialog.question().is_some());
    for (number, input) in keys.read().enumerate() {
        if held.follow(input) || is_asked || input.state == ButtonState::Released || input.repeat {
            continue;
        }
        let Some(key) = key_name(input) else { continue };
        let chord = Chord { key, control: held.control, shift: held.shift, alt: held.alt };
        if let Some(action) = chosen.0 {
            chosen.0 = None;
            if chord.key != "Escape" {
                bound.write(KeyBound { chord, action });
            }
            continue;
        }
        match bindings.action(&chord) {
            // Text fields do not use these chords.
            Some(action) if !typing || matches!(action, Action::Save | Action::SaveAs | Action::Help) => {
                let action = if is_over_timeline { over_timeline(action) } else { action };
                let action = if is_over_graph { over_graph(action) } else { action };
                if number < first_late {
                    actions.write(ActionRequest(action));
                } else {
                    waiting.push(action);
                }
            }
            _ => {}
        }
    }
}

/// Number of key events of a frame that came after a release of a mouse button.
fn keys_after_release<'e>(events: impl Iterator<Item = &'e WindowEvent>) -> usize {
    let is_release = |event: &WindowEvent| match event {
        WindowEvent::MouseButtonInput(input) => input.state == ButtonState::Released,
        _ => false,
    };
    let late = events.skip_while(|event| !is_release(event));
    late.filter(|event| matches!(event, WindowEvent::KeyboardInput(_))).count()
}

/// Binds keys that were pressed for actions, and tells of actions that lost theirs.
fn bind(mut bound: MessageReader<KeyBound>, mut bindings: ResMut<KeyBindings>, mut notices: MessageWriter<Notice>) {
    for KeyBound { chord, action } in bound.read() {
        let name = describe(*action);
        notices.write(match bindings.bind(chord.clone(), *action) {
            None => Notice::done(format!("{chord} is the key of \"{name}\".")),
            Some(other) => {
                let other = describe(other);
                Notice::warning(format!("{chord} is the key of \"{name}\", and no more that of \"{other}\"."))
            }
        });
    }
}
