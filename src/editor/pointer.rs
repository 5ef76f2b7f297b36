//! What the pointer does over the viewport, after panels, popups and the camera have taken what is theirs.
//!
//! Places are logical pixels from the viewport's top left corner, y down. All movements between two frames arrive, so
//! strokes stay smooth at any frame rate. A pen is a pointer like any other.

use bevy::{
    input::{ButtonState, keyboard::KeyboardInput, mouse::MouseScrollUnit},
    prelude::*,
    window::{PrimaryWindow, WindowEvent},
};
use bevy_egui::{EguiContext, PrimaryEguiContext, egui};

/// Turns what the window reports into [`ViewportPointer`] messages.
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

/// One thing the pointer did in the viewport.
#[derive(Message, Debug, Clone, Copy, PartialEq)]
pub struct ViewportPointer {
    /// Where, in logical pixels from the viewport's top left corner. During a drag it may lie outside.
    pub at: Vec2,
    /// What.
    pub act: PointerAct,
    /// Keys held.
    pub held: Held,
}

/// What a pointer did. Presses, drags and releases are those of the tool's button (left, or the pen's tip).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PointerAct {
    /// Moved without a button.
    Moved,
    /// Left the viewport.
    Left,
    /// The button went down.
    Pressed,
    /// Moved with the button down.
    Dragged,
    /// The button went up; `dragged` is true if it moved more than a click may, `count` is 2 for a double click.
    Released {
        /// True for the end of a drag, false for a click.
        dragged: bool,
        /// Clicks in a row.
        count: u8,
    },
    /// The wheel turned by so many notches while the tool had asked for it (see [`WheelUse`]); up is positive.
    Wheel(f32),
}

/// Modifier keys.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Held {
    /// Shift.
    pub shift: bool,
    /// Control, or Command.
    pub control: bool,
    /// Alt.
    pub alt: bool,
}

impl Held {
    /// Takes a key into account; true if it is a modifier. Events of one frame are taken in their order, so that a quick
    /// Ctrl+Z within a slow frame still is one.
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

/// Who gets the wheel while it turns over the viewport.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum WheelUse {
    /// It zooms.
    #[default]
    Zoom,
    /// The tool gets it; with Control it still zooms.
    Tool,
}

/// Where the viewport is in the window and where the pointer is in it.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Default)]
pub struct ViewportArea {
    /// The viewport's top left corner in the window, logical pixels.
    pub min: Vec2,
    /// Its size, logical pixels.
    pub size: Vec2,
    /// Physical pixels a logical one.
    pub scale: f32,
    /// The pointer over the viewport, from its top left corner; `None` elsewhere.
    pub pointer: Option<Vec2>,
}

/// What the pointer was doing at the end of the last frame.
#[derive(Resource, Debug, Clone, Copy, Default)]
pub struct PointerState {
    /// Where, in the window.
    at: Vec2,
    /// Where the tool's button went down, while it is down and the tool has it.
    pressed: Option<Vec2>,
    /// True once it has moved more than a click may.
    dragged: bool,
    /// The last click: where, when, and how many in a row.
    last_click: Option<(Vec2, f64, u8)>,
    /// True while another button, or Alt, moves the camera.
    camera: bool,
}

impl PointerState {
    /// True while a tool drags, or the camera does.
    pub fn is_busy(&self) -> bool {
        self.pressed.is_some() || self.camera
    }

    /// True while a drag moves the camera.
    pub fn is_camera(&self) -> bool {
        self.camera
    }

    /// True while a tool has the button.
    pub fn is_captured(&self) -> bool {
        self.pressed.is_some()
    }
}

/// How far a click may move, in logical pixels.
const CLICK_REACH: f32 = 4.0;
/// How long the clicks of a double click may lie apart, in seconds.
const DOUBLE_CLICK: f64 = 0.4;

/// Reads the window's events in their order. What lies under a panel, a popup or a dialog is not the viewport's.
pub(super) fn follow_pointer(
    mut events: MessageReader<WindowEvent>,
    windows: Query<Entity, With<PrimaryWindow>>,
    mut contexts: Query<&mut EguiContext, With<PrimaryEguiContext>>,
    wheel: Res<WheelUse>,
    time: Res<Time<Real>>,
    mut area: ResMut<ViewportArea>,
    mut state: ResMut<PointerState>,
    mut modifiers: Local<Held>,
    mut pointer: MessageWriter<ViewportPointer>,
) {
    if events.is_empty() {
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
    let mut send = |at: Vec2, act: PointerAct, held: Held, area: &ViewportArea| {
        pointer.write(ViewportPointer { at: at - area.min, act, held });
    };
    for event in events.read() {
        match event {
            WindowEvent::KeyboardInput(input) => {
                modifiers.follow(input);
            }
            WindowEvent::WindowFocused(focus) if !focus.focused => *modifiers = Held::default(),
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
}
