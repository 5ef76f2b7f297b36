//! Lists of gestures: what a person does with clicks and strokes, written down.
//!
//! A [`GestureScript`] on a rig drives the same requests that a window sends, one gesture a frame, and keeps an answer
//! for each. The command line, tests and tutorials use it; nothing in it can do what a person could not.

mod script;

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::{RigSystems, configure_sets};
use crate::{
    algo::view::View,
    rig::{SourceError, elements, operations::Axis, parse_ron, utf8},
};

pub use script::{GestureAnswer, GestureScript};

/// The longest gesture file that is read, in bytes.
pub const MAX_BYTES: usize = 16 << 20;

/// Adds gesture scripts.
pub struct GesturePlugin;

impl Plugin for GesturePlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.add_systems(Update, script::run_scripts.in_set(RigSystems::Script));
    }
}

/// One gesture. Points are along the view's right and up axes, in model units, from the model's origin; the view is
/// orthographic. [`Gesture::View`], [`Gesture::Depth`], [`Gesture::Volume`], [`Gesture::Mirror`],
/// [`Gesture::Recentre`] and [`Gesture::Reach`] hold for the gestures after them until changed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Gesture {
    /// Looks from somewhere else. The first view is the front.
    View(View),
    /// Places a joint.
    Click((f32, f32)),
    /// Draws a stroke: a chain; or, unless `joints` is given, a joint in the bone it crosses, or the end of what it
    /// scribbles over. A stroke that starts on a joint continues from it.
    Stroke {
        /// At least two points.
        points: Vec<(f32, f32)>,
        /// Joints wherever the stroke strays further than this from the line between two neighbours; 2 % of the
        /// model's size if neither this nor `joints` is given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        threshold: Option<f32>,
        /// Exactly this many joints.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        joints: Option<usize>,
    },
    /// Where between the nearest and the furthest hit joints are placed: 0 near, 1 far, 0.5 at the start.
    Depth(f32),
    /// Which entry/exit pair of the ray joints are placed in, counted from one at the camera; 0, as at the start, for
    /// the whole span.
    Volume(u32),
    /// Turns mirroring across x = 0 on or off.
    Mirror(bool),
    /// Whether joints of strokes step to the middle of the limb; true at the start.
    Recentre(bool),
    /// How near, in model units, counts as on a joint; half a percent of the model's size at the start.
    Reach(f32),
    /// Selects the joint that a click here means; again at the same spot: the next nearest.
    Select((f32, f32)),
    /// Adds the joint that a click here means to the selection.
    Add((f32, f32)),
    /// Selects all joints in a box between two corners.
    Box((f32, f32), (f32, f32)),
    /// Selects the joint with this label.
    SelectLabel(String),
    /// Selects everything.
    SelectAll,
    /// Selects nothing, so that the next joint becomes a root.
    Deselect,
    /// Names the active joint.
    Label(String),
    /// Names the joints of the chain that ends at the active joint, first to last.
    Labels(Vec<String>),
    /// Moves the active joint along the view plane, keeping its depth; what hangs below stays.
    Move((f32, f32)),
    /// Moves the active joint to a point of the rig's space; what hangs below stays.
    MoveTo((f32, f32, f32)),
    /// Turns the selected joints about the view's axis (degrees, counter-clockwise) with all that hangs below.
    Rotate(f32),
    /// Scales the selected joints about the active one, with all that hangs below.
    Scale(f32),
    /// Puts a joint into the bone above the active joint, at this point of the view.
    Insert((f32, f32)),
    /// Deletes the selected joints; what hangs below moves up.
    Delete,
    /// Deletes the selected joints and all that hangs below.
    DeleteHierarchy,
    /// Hangs all selected joints but the active one below the active one.
    Parent,
    /// Makes the selected joints roots.
    Unparent,
    /// Turns the selected joints so that this axis points along their bone.
    Orient(Axis),
    /// Makes or renews the other side of the selected joints and all that hangs below.
    MirrorSelected,
    /// Puts the selected joints into a local group, with a colour if the second value is given.
    Group(String, Option<(f32, f32, f32)>),
    /// Protects the selected joints' weights from skinning, or no longer.
    Lock(bool),
    /// Takes the last change back.
    Undo,
    /// Does the last undone change again.
    Redo,
}

/// Reads a list of gestures in RON.
pub fn read_gestures(bytes: &[u8]) -> Result<Vec<Gesture>, SourceError> {
    let text = utf8(bytes, MAX_BYTES, "gesture file")?;
    let gestures: Vec<Gesture> = parse_ron(text)?;
    match gestures.iter().position(|gesture| !gesture.is_finite()) {
        Some(number) => Err(SourceError::at(
            text,
            elements(text).get(number).copied().unwrap_or(0),
            format!("gesture {} has a number that is not finite; write an ordinary number", number + 1),
        )),
        None => Ok(gestures),
    }
}

impl Gesture {
    fn is_finite(&self) -> bool {
        let finite = |point: &(f32, f32)| point.0.is_finite() && point.1.is_finite();
        match self {
            Self::View(View::Orbit(yaw, pitch)) => finite(&(*yaw, *pitch)),
            Self::Click(point) | Self::Select(point) | Self::Add(point) | Self::Move(point) | Self::Insert(point) => {
                finite(point)
            }
            Self::Stroke { points, threshold, .. } => points.iter().all(finite) && threshold.is_none_or(f32::is_finite),
            Self::Box(a, b) => finite(a) && finite(b),
            Self::MoveTo((x, y, z)) => x.is_finite() && y.is_finite() && z.is_finite(),
            Self::Depth(number) | Self::Reach(number) | Self::Rotate(number) | Self::Scale(number) => {
                number.is_finite()
            }
            Self::Group(_, Some((r, g, b))) => r.is_finite() && g.is_finite() && b.is_finite(),
            _ => true,
        }
    }
}
