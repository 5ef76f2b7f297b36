//! Retargeting: the motion of one skeleton on the rig of another one.
//!
//! Both skeletons are turned so that they stand and face alike at rest. A joint then turns by what its counterpart turns
//! beyond *its* rest, after a constant rotation that brings the target's rest pose onto the source's: that takes up T-poses,
//! A-poses and any roll of bones. A file whose nodes rest in some other pose stands as its mesh was bound, where that is
//! more like the target. Limbs go by the directions of the source's bones, and bend about their own hinges, so that knees
//! and elbows never bend backwards. The hips move by the ratio of the legs' lengths. While a foot stands ([`Stance`]) it is
//! held in its place on the ground, and a hand is where it touches something ([`Touch`]), each by the inverse controls of
//! its limb. The figure travels where a clip walks on the spot.
//!
//! The result is a clip of the rig's controls, or of its joints where it has no controls.

mod body;
mod contacts;
mod controls;
mod figure;
mod joints;
mod limbs;
mod measure;
mod player;
mod pose;
mod touches;
mod tracks;

use serde::Serialize;

use self::{body::Body, contacts::Contacts, figure::Figure, touches::Touches};
pub use self::{
    contacts::Stance,
    measure::{FootReport, HandReport, measure_feet, measure_hands},
    touches::{Touch, TouchTarget},
};
use super::{
    matching::MatchError,
    program::{CompileOptions, ProgramError, RigProgram},
    reduction::CurveKind,
};
use crate::rig::{
    BuiltRig, Rig, Uid,
    animation::{RigClip, joint_map::JointMap, motion::Motion},
    operations::KeyTolerance,
};

/// Nodes that get the keys of a retargeted motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MotionTarget {
    /// Controls of the rig, so that an animator can go on.
    Controls,
    /// Joints of a rig without commands.
    Joints,
}

/// Settings of [`retarget`].
#[derive(Debug, Clone, PartialEq)]
pub struct RetargetSettings {
    /// Frames a second of the clip; the motion's own, but at most 60, if `None`.
    pub frame_rate: Option<f32>,
    /// True if the clip is played over and over; so is that of a motion which says so itself.
    pub looped: bool,
    /// Nodes that get keys.
    pub onto: MotionTarget,
    /// True to let a figure travel that walks on the spot.
    pub travel: bool,
    /// True to put the travel over the ground onto the control that carries the whole figure, so that a game can take it over as
    /// root motion. Without effect on joints, where the hips have it.
    pub root_motion: bool,
    /// True to hold standing feet in their places.
    pub lock_feet: bool,
    /// True to hold hands where they touch something.
    pub lock_hands: bool,
    /// Distances and angles by which joints may be off at any frame through the removal of keys, on a human in metres.
    pub tolerance: KeyTolerance,
    /// Curves of the keys.
    pub curves: CurveKind,
    /// Largest frames of the clip.
    pub max_frames: usize,
}

impl Default for RetargetSettings {
    fn default() -> Self {
        Self {
            frame_rate: None,
            looped: false,
            onto: MotionTarget::Controls,
            travel: true,
            root_motion: false,
            lock_feet: true,
            lock_hands: true,
            tolerance: KeyTolerance::captured(),
            curves: CurveKind::Fewest,
            max_frames: 100_000,
        }
    }
}

/// A retargeted motion.
#[derive(Debug, Clone, PartialEq)]
pub struct RetargetedMotion {
    /// The clip, with one layer.
    pub clip: RigClip,
    /// Numbers of keys before and after the reduction.
    pub keys: [usize; 2],
    /// Times at which feet stand.
    pub stances: Vec<Stance>,
    /// Times at which hands touch something.
    pub touches: Vec<Touch>,
    /// Labels of mapped joints that no control moves.
    pub unmoved: Vec<String>,
    /// Control that carries the travel over the ground; `None` if the settings ask for none or the rig has no such control.
    pub root: Option<Uid>,
    /// Remarks, a sentence each.
    pub notes: Vec<String>,
}

/// Reason why a motion cannot be retargeted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RetargetError {
    /// The motion has no frames.
    #[error("the motion has no frames; give a file with motion")]
    NoFrames,
    /// The clip would have too many frames.
    #[error("the clip would have {frames} frames, more than {most}; give a lower --fps or cut the motion")]
    TooLong {
        /// Frames of the clip.
        frames: usize,
        /// Most frames.
        most: usize,
    },
    /// A skeleton has no size.
    #[error("all joints of the {0} stand at one place at rest; give another file")]
    NoSize(&'static str),
    /// The built rig does not run.
    #[error(transparent)]
    Program(#[from] ProgramError),
    /// A limb cannot be posed.
    #[error(transparent)]
    Limb(#[from] MatchError),
}

/// Puts a motion onto a rig. `rig` is the document and `built` the result of its commands; for [`MotionTarget::Joints`]
/// the rig has no commands, and `built` only its joints.
///
/// Takes some milliseconds a frame for the controls of a character, on all cores; the result is the same on any number of them.
///
/// # Errors
/// See [`RetargetError`].
pub fn retarget(
    rig: &Rig,
    built: &BuiltRig,
    motion: &Motion,
    map: &JointMap,
    settings: &RetargetSettings,
) -> Result<RetargetedMotion, RetargetError> {
    if motion.frames() == 0 {
        return Err(RetargetError::NoFrames);
    }
    let rate = settings.frame_rate.unwrap_or_else(|| default_rate(motion.frame_time));
    let count = (f64::from(motion.duration()) * f64::from(rate) + 1e-3).floor() as usize + 1;
    if count > settings.max_frames {
        return Err(RetargetError::TooLong { frames: count, most: settings.max_frames });
    }
    let times: Vec<f32> = (0..count).map(|frame| (frame as f64 / f64::from(rate)) as f32).collect();
    let target = Figure::of_rig(rig, map).ok_or(RetargetError::NoSize("rig"))?;
    let source = Figure::of_motion(motion, map, &target).ok_or(RetargetError::NoSize("motion"))?;
    let mut body = Body::new(&source, &target, map, motion, &times);
    let mut notes = Vec::new();
    if settings.travel && contacts::travel(&mut body, rate) {
        notes.push("the motion walks on the spot; the figure travels by the movement of its standing feet".to_owned());
    }
    let contacts = if settings.lock_feet { Contacts::find(&body, rate) } else { Contacts::none(&body) };
    let has_twist = settings.onto == MotionTarget::Controls;
    let touches = if settings.lock_hands { Touches::find(&body, rate) } else { Touches::default() };
    let poses = body.poses(&contacts, &touches, rate, has_twist);
    let range = [0.0, *times.last().unwrap_or(&0.0)];
    let mut clip = tracks::empty_clip(rig, &motion.name, rate, range, settings.looped || motion.looped);
    clip.markers.clone_from(&motion.markers);
    let program = std::sync::Arc::new(RigProgram::compile(built, &CompileOptions::default())?);
    let (keyed, unmoved) = match settings.onto {
        MotionTarget::Controls => {
            controls::keyed(built, &program, &body, &poses, touches.hands(), settings.root_motion)?
        }
        MotionTarget::Joints => (joints::keyed(&body, &poses), Vec::new()),
    };
    // Poses of a long motion make room for the places that reducing it takes.
    drop(poses);
    let root = keyed.root;
    if settings.root_motion && settings.onto == MotionTarget::Controls && root.is_none() {
        notes.push("no control carries the whole figure; the travel stays where it is without root motion".to_owned());
    }
    let tolerance = settings.tolerance.for_height(target.height);
    let keys = tracks::fill(&mut clip, keyed, &times, &program, &tolerance, settings.curves);
    let (stances, touches) = (contacts.stances(&body, &times), touches.list(&times));
    Ok(RetargetedMotion { clip, keys, stances, touches, unmoved, root, notes })
}

/// Frame rate of a motion, divided until it is at most 60.
fn default_rate(frame_time: f32) -> f32 {
    let rate = 1.0 / frame_time;
    // Files round the time between frames.
    let rate = if (rate - rate.round()).abs() < 2e-3 * rate { rate.round() } else { rate };
    rate / (rate / 60.0 - 1e-3).ceil().max(1.0)
}
