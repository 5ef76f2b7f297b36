//! Clicks in panels, each on what lay under the pointer when the button was pressed.
//!
//! egui looks for the widget of a press where the pointer is at the end of a frame. Where a frame takes long, the pointer presses,
//! lets go and moves on within one frame, and the click would be lost or be another widget's. So a frame ends for panels where the
//! pointer leaves the place of a press or release; what comes later waits for the next one.

use bevy::{prelude::*, window::RequestRedraw};
use bevy_egui::{
    EguiInput, EguiPreUpdateSet, PrimaryEguiContext,
    egui::{Event, Pos2},
};

/// Plugin that hands the pointer's events to panels frame by frame.
pub struct ClicksPlugin;

impl Plugin for ClicksPlugin {
    fn build(&self, app: &mut App) {
        app.add_message::<RequestRedraw>().add_systems(
            PreUpdate,
            hold_back.after(EguiPreUpdateSet::ProcessInput).before(EguiPreUpdateSet::BeginPass),
        );
    }
}

/// Largest movement of a click in points.
const CLICK_REACH: f32 = 6.0;

/// Events that wait for the next frame.
#[derive(Default)]
pub(super) struct HeldEvents {
    events: Vec<Event>,
    /// Place of the press, while a button is down.
    pressed: Option<Pos2>,
}

/// Leaves the panels the events of this frame, and keeps the later ones.
pub(super) fn hold_back(
    mut inputs: Query<&mut EguiInput, With<PrimaryEguiContext>>,
    mut held: Local<HeldEvents>,
    mut redraw: MessageWriter<RequestRedraw>,
) {
    let Ok(mut input) = inputs.single_mut() else { return held.events.clear() };
    if input.events.is_empty() && held.events.is_empty() {
        return;
    }
    let HeldEvents { events: waiting, pressed } = &mut *held;
    let mut events = std::mem::take(waiting);
    events.append(&mut input.events);
    *waiting = events.split_off(end_of_frame(&events, pressed));
    if !waiting.is_empty() {
        redraw.write(RequestRedraw);
    }
    input.events = events;
}

/// Number of events that one frame gets, one at least. `pressed` is the place of the press, which these events may change.
fn end_of_frame(events: &[Event], pressed: &mut Option<Pos2>) -> usize {
    let is_far = |from: Option<Pos2>, at: Pos2| from.is_some_and(|from| from.distance(at) > CLICK_REACH);
    let (mut button, mut is_dragged) = (None, false);
    for (number, event) in events.iter().enumerate() {
        match event {
            Event::PointerMoved(at) => {
                if is_far(button, *at) {
                    return number;
                }
                is_dragged |= is_far(*pressed, *at);
            }
            Event::PointerButton { pos, pressed: is_down, .. } => {
                // The end of a drag comes a frame after its last movement, which would be none otherwise.
                if is_dragged && !is_down {
                    return number;
                }
                button = Some(*pos);
                *pressed = is_down.then_some(*pos);
            }
            _ => {}
        }
    }
    events.len()
}
