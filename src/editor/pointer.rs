//! What the pointer does over the viewport, after panels, popups and the camera have taken what is theirs.
//!
//! Places are logical pixels from the viewport's top left corner, y down. All movements between two frames arrive, so
//! strokes stay smooth at any frame rate. A pen is a pointer like any other.

use bevy::prelude::*;

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
