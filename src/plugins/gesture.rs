//! Lists of gestures: clicks and strokes as data.
//!
//! A [`GestureScript`] on a rig drives the same requests that a window sends, one gesture a frame, and keeps an answer
//! for each. Clicks, strokes, labels, groups, picks, operations on selected joints and undone steps that nobody watches come several
//! a frame. The command line, tests and tutorials use it; a script can do nothing that a person could not.

mod answers;
mod click_run;
mod error;
mod operation;
mod pick_run;
mod script;
mod selection_run;
mod stroke_run;

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::{RigSystems, configure_sets, limits::RigLimits};
use crate::{
    algo::view::View,
    rig::{SourceError, elements, operations::Axis, parse_ron, utf8},
};

pub use script::{GestureAnswer, GestureScript};

/// Largest size of a gesture file in bytes.
pub const MAX_BYTES: usize = 16 << 20;

/// Plugin of gesture scripts.
pub struct GesturePlugin;

impl Plugin for GesturePlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.init_resource::<RigLimits>().add_systems(Update, script::run_scripts.in_set(RigSystems::Script));
    }
}

/// A gesture. Points are along the view's right and up axes, in model units, from the model's origin; the view is
/// orthographic. [`Gesture::View`], [`Gesture::Depth`], [`Gesture::Volume`], [`Gesture::Mirror`], [`Gesture::Recentre`]
/// and [`Gesture::Reach`] hold for the gestures after them until changed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Gesture {
    /// Changes the view. The first view is the front.
    View(View),
    /// Places a joint.
    Click((f32, f32)),
    /// Draws a stroke: a chain; or, unless `joints` is given, a joint inserted into the bone that it crosses, or the
    /// deletion of joints under a scribble. A stroke that starts on a joint continues from it.
    Stroke {
        /// Points of the stroke, two or more.
        points: Vec<(f32, f32)>,
        /// Largest distance of the stroke from the line between two neighbouring joints; 2 % of the model's size if
        /// neither this nor `joints` is given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        threshold: Option<f32>,
        /// Exact number of joints.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        joints: Option<usize>,
    },
    /// Depth of placed joints between the nearest and the furthest hit: 0 near, 1 far, 0.5 at the start.
    Depth(f32),
    /// Entry/exit pair of the ray in which joints are placed, counted from one at the camera; 0, as at the start, for
    /// the whole span.
    Volume(u32),
    /// Turns mirroring across x = 0 on or off.
    Mirror(bool),
    /// Turns recentring of strokes on or off; on at the start.
    Recentre(bool),
    /// Largest distance, in model units, at which a point is on a joint; half a percent of the model's size at the
    /// start.
    Reach(f32),
    /// Selects the joint that a click here picks; again at the same spot: the next nearest.
    Select((f32, f32)),
    /// Adds the joint that a click here picks to the selection.
    Add((f32, f32)),
    /// Selects all joints in a box between two corners.
    Box((f32, f32), (f32, f32)),
    /// Selects the joint with this label.
    SelectLabel(String),
    /// Selects all joints.
    SelectAll,
    /// Clears the selection, so that the next joint becomes a root.
    Deselect,
    /// Names the active joint.
    Label(String),
    /// Names the joints of the chain that ends at the active joint, first to last.
    Labels(Vec<String>),
    /// Moves the active joint along the view plane, keeping its depth; its children stay.
    Move((f32, f32)),
    /// Moves the active joint to a point of the rig's space; its children stay.
    MoveTo((f32, f32, f32)),
    /// Turns the selected joints about the view's axis (degrees, counter-clockwise) with their hierarchies.
    Rotate(f32),
    /// Scales the selected joints about the active one, with their hierarchies.
    Scale(f32),
    /// Inserts a joint into the bone above the active joint, at this point of the view.
    Insert((f32, f32)),
    /// Deletes the selected joints; their children move up.
    Delete,
    /// Deletes the selected joints with their hierarchies.
    DeleteHierarchy,
    /// Moves all selected joints but the active one below the active one.
    Parent,
    /// Makes the selected joints roots.
    Unparent,
    /// Turns the selected joints so that this axis points along their bone.
    Orient(Axis),
    /// Makes or updates the other side of the selected joints and of their hierarchies.
    MirrorSelected,
    /// Puts the selected joints into a local group, with a colour if the second value is given.
    Group(String, Option<(f32, f32, f32)>),
    /// Locks the selected joints' weights against skinning, or unlocks them.
    Lock(bool),
    /// Fits a template to the first mesh of the rig: the one with that name, or the one whose limbs the mesh shows. A rig
    /// that has joints has those moved; a part (`parts/hand`) is added, below the selected joint. Joints that are moved
    /// afterwards correct the fit.
    Fit {
        /// Name of the template, or of the part.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        template: Option<String>,
    },
    /// Undoes the last change.
    Undo,
    /// Redoes the last undone change.
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
    /// True for a gesture that changes the view or how joints are placed, and nothing else.
    fn is_setting(&self) -> bool {
        matches!(self, Self::View(_) | Self::Depth(_) | Self::Volume(_) | Self::Recentre(_) | Self::Reach(_))
    }

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
