//! Pointer input over the viewport, after panels, popups and the camera have taken their share.
//!
//! Places are logical pixels from the viewport's top left corner, y down. All movements between two frames arrive, so
//! strokes stay smooth at any frame rate. A pen is a pointer like any other.

use bevy::{
    input::{ButtonState, keyboard::KeyboardInput, mouse::MouseScrollUnit},
    prelude::*,
    window::{PrimaryWindow, WindowEvent},
};
use bevy_egui::{EguiContext, PrimaryEguiContext, egui};

/// Plugin that turns window events into [`ViewportPointer`] messages.
pub struct PointerPlugin;

impl Plugin for PointerPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<ViewportArea>()
            .init_resource::<WheelUse>()
            .init_resource::<PointerState>()
            .add_message::<ViewportPointer>()
            .add_systems(PreUpdate, follow_pointer.after(bevy::input::InputSystems));
    }
}

/// An event of the pointer in the viewport.
#[derive(Message, Debug, Clone, Copy, PartialEq)]
pub struct ViewportPointer {
    /// Position in logical pixels from the viewport's top left corner. During a drag it may lie outside.
    pub at: Vec2,
    /// Kind of the event.
    pub act: PointerAct,
    /// Modifier keys held.
    pub held: ModifierKeys,
}

/// Kind of a pointer event. Presses, drags and releases are those of the tool's button (left, or the pen's tip).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PointerAct {
    /// The pointer moved without a button.
    Moved,
    /// The pointer left the viewport.
    Left,
    /// The button went down.
    Pressed,
    /// The pointer moved with the button down.
    Dragged,
    /// The button went up.
    Released {
        /// End of a drag (`true`, the pointer moved further than in a click), or a click (`false`).
        dragged: bool,
        /// Number of clicks in a row: 2 for a double click.
        count: u8,
    },
    /// The wheel turned by this number of notches while the tool had requested it (see [`WheelUse`]); up is positive.
    Wheel(f32),
}

/// Modifier keys.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ModifierKeys {
    /// Shift.
    pub shift: bool,
    /// Control, or Command.
    pub control: bool,
    /// Alt.
    pub alt: bool,
}

impl ModifierKeys {
    /// Updates the modifiers for a key event; returns `true` if the key is a modifier. Events of one frame are handled
    /// in their order, so that a quick Ctrl+Z within a slow frame is recognised.
    pub fn follow(&mut self, input: &KeyboardInput) -> bool {
        let down = input.state == ButtonState::Pressed;
        match input.key_code {
            KeyCode::ShiftLeft | KeyCode::ShiftRight => self.shift = down,
            KeyCode::ControlLeft | KeyCode::ControlRight | KeyCode::SuperLeft | KeyCode::SuperRight => {
                self.control = down;
            }
            KeyCode::AltLeft | KeyCode::AltRight => self.alt = down,
            _ => return false,
        }
        true
    }
}

/// Receiver of the wheel over the viewport.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum WheelUse {
    /// The camera, which zooms.
    #[default]
    Zoom,
    /// The tool; with Control the wheel still zooms.
    Tool,
}

/// Area of the viewport in the window, and the pointer's position in it.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Default)]
pub struct ViewportArea {
    /// The viewport's top left corner in the window, logical pixels.
    pub min: Vec2,
    /// Size in logical pixels.
    pub size: Vec2,
    /// Number of physical pixels per logical one.
    pub scale: f32,
    /// The pointer over the viewport, from its top left corner; `None` elsewhere.
    pub pointer: Option<Vec2>,
}

/// State of the pointer at the end of the last frame.
#[derive(Resource, Debug, Clone, Copy, Default)]
pub struct PointerState {
    /// Position in the window.
    at: Vec2,
    /// Position of the press, while the tool has the button.
    pressed: Option<Vec2>,
    /// Marks that the pointer has moved further than in a click.
    dragged: bool,
    /// The last click: position, time, and number in a row.
    last_click: Option<(Vec2, f64, u8)>,
    /// Marks that another button, or Alt, moves the camera.
    camera: bool,
}

impl PointerState {
    /// Returns `true` while a tool or the camera drags.
    pub fn is_busy(&self) -> bool {
        self.pressed.is_some() || self.camera
    }

    /// Returns `true` while a drag moves the camera.
    pub fn is_camera(&self) -> bool {
        self.camera
    }

    /// Returns `true` while a tool has the button.
    pub fn is_captured(&self) -> bool {
        self.pressed.is_some()
    }
}

/// Largest movement of a click, in logical pixels.
const CLICK_REACH: f32 = 4.0;
/// Largest time between the clicks of a double click, in seconds.
const DOUBLE_CLICK: f64 = 0.4;

/// Reads the window's events in their order. Events over a panel, a popup or a dialog do not belong to the viewport.
pub(super) fn follow_pointer(
    mut events: MessageReader<WindowEvent>,
    windows: Query<Entity, With<PrimaryWindow>>,
    mut contexts: Query<&mut EguiContext, With<PrimaryEguiContext>>,
    wheel: Res<WheelUse>,
    time: Res<Time<Real>>,
    mut area: ResMut<ViewportArea>,
    mut state: ResMut<PointerState>,
    mut modifiers: Local<ModifierKeys>,
    mut pointer: MessageWriter<ViewportPointer>,
) {
    // What comes over a resting pointer takes it without an event.
    if events.is_empty() && area.pointer.is_none() {
        return;
    }
    let (Ok(window), Ok(mut context)) = (windows.single(), contexts.single_mut()) else {
        events.clear();
        return;
    };
    let context = context.get_mut();
    let over = |at: Vec2, area: &ViewportArea| {
        let inside = at.cmpge(area.min).all() && at.cmplt(area.min + area.size).all();
        inside
            && context.dragged_id().is_none()
            && context.layer_id_at(egui::pos2(at.x, at.y)).is_none_or(|layer| layer.order == egui::Order::Background)
    };
    let mut send = |at: Vec2, act: PointerAct, held: ModifierKeys, area: &ViewportArea| {
        pointer.write(ViewportPointer { at: at - area.min, act, held });
    };
    for event in events.read() {
        match event {
            WindowEvent::KeyboardInput(input) => {
                modifiers.follow(input);
            }
            WindowEvent::WindowFocused(focus) if !focus.focused => *modifiers = ModifierKeys::default(),
            WindowEvent::CursorMoved(moved) if moved.window == window => {
                state.at = moved.position;
                let here = over(state.at, &area);
                let was = area.pointer.is_some();
                let next = here.then(|| state.at - area.min);
                if area.pointer != next {
                    area.pointer = next;
                }
                match state.pressed {
                    Some(start) => {
                        state.dragged |= start.distance(state.at) > CLICK_REACH;
                        if state.dragged {
                            send(state.at, PointerAct::Dragged, *modifiers, &area);
                        }
                    }
                    None if here && !state.camera => send(state.at, PointerAct::Moved, *modifiers, &area),
                    None if was && !here => send(state.at, PointerAct::Left, *modifiers, &area),
                    None => {}
                }
            }
            WindowEvent::CursorLeft(left)
                if left.window == window && state.pressed.is_none() && area.pointer.is_some() =>
            {
                area.pointer = None;
                send(state.at, PointerAct::Left, *modifiers, &area);
            }
            WindowEvent::MouseButtonInput(input) if input.window == window => {
                let down = input.state == ButtonState::Pressed;
                let tool = input.button == MouseButton::Left && !modifiers.alt;
                if !down && input.button == MouseButton::Left && state.pressed.is_some() {
                    let dragged = std::mem::take(&mut state.dragged);
                    let at = state.at;
                    state.pressed = None;
                    let now = time.elapsed_secs_f64();
                    let count = match state.last_click {
                        Some((place, when, count))
                            if now - when < DOUBLE_CLICK && place.distance(at) <= CLICK_REACH =>
                        {
                            count.saturating_add(1)
                        }
                        _ => 1,
                    };
                    state.last_click = (!dragged).then_some((at, now, count));
                    send(at, PointerAct::Released { dragged, count }, *modifiers, &area);
                    // The pointer left during the drag, which had it until now.
                    if !over(at, &area) {
                        send(at, PointerAct::Left, *modifiers, &area);
                    }
                } else if down && tool && over(state.at, &area) {
                    state.pressed = Some(state.at);
                    state.dragged = false;
                    send(state.at, PointerAct::Pressed, *modifiers, &area);
                } else if !tool || !down {
                    state.camera = down && over(state.at, &area);
                }
            }
            WindowEvent::MouseWheel(turned) if turned.window == window => {
                let notches = match turned.unit {
                    MouseScrollUnit::Line => turned.y,
                    MouseScrollUnit::Pixel => turned.y / 40.0,
                };
                if *wheel == WheelUse::Tool && !modifiers.control && notches != 0.0 && over(state.at, &area) {
                    send(state.at, PointerAct::Wheel(notches), *modifiers, &area);
                }
            }
            _ => {}
        }
    }
    if area.pointer.is_some() && state.pressed.is_none() && !over(state.at, &area) {
        area.pointer = None;
        send(state.at, PointerAct::Left, *modifiers, &area);
    }
}
