//! Limits: how much a file may hold, how much a build may make, how long a job may take, and how much is told.
//!
//! An app with rigs has them as the resource [`RigLimits`]: builds, background jobs and gesture lists obey it, and whoever reads
//! a file asks [`RigLimits::check_model`] and [`RigLimits::check_rig`]. The window and the commands take the same limits as
//! `--limit NAME=NUMBER`.
//!
//! ```
//! use bevy::prelude::*;
//! use rigsmith::plugins::limits::{Limit, RigLimits};
//!
//! let mut app = rigsmith::headless::headless_app(1);
//! app.insert_resource(RigLimits::default().with(Limit::Nodes, 2_000).with(Limit::Seconds, 30));
//! ```

use std::{sync::Arc, time::Duration};

use bevy::prelude::*;

pub use crate::processor::{Deadline, OutOfTime};

use super::{commands::RigModules, gesture::Gesture, surface::RigMesh};
use crate::{
    mesh::model::Model,
    processor::BuildLimits,
    rig::{Rig, animation::motion::Motion, text::RigText},
    solve::{bake_clip::MOST_TRANSFORMS, packed_clip::PackedSkeleton},
};

/// Limit that can be set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Limit {
    /// Joints of a rig that is read.
    Joints,
    /// Nodes and constraints that commands make.
    Nodes,
    /// Attributes of one node.
    Attributes,
    /// Values that commands read and write in one run.
    Work,
    /// Points of a mesh.
    Points,
    /// Triangles of a mesh.
    Triangles,
    /// Influences of a mesh.
    Influences,
    /// Gestures of a list.
    Gestures,
    /// Points of one stroke of a list.
    StrokePoints,
    /// Seconds of work: of a whole command, or of one background job of an app.
    Seconds,
    /// Joints and problems that commands list for people.
    Listed,
    /// Notes about one file.
    Notes,
    /// Characters of one note or error.
    Message,
    /// Bytes of the unpacked clips of a file, beyond [`UNPACKED_FOR_A_BYTE`] for each byte of the file.
    Unpacked,
    /// Frames that pass for springs.
    Frames,
    /// Transforms of a clip that is baked: one for each frame and node.
    Baked,
}

/// Bytes of unpacked clips that are taken for each byte of their file.
pub const UNPACKED_FOR_A_BYTE: u64 = 12;

/// Name, value and meaning of each limit, in the order of [`Limit`].
const LIMITS: [(Limit, &str, u64, &str); 16] = [
    (Limit::Joints, "joints", 500_000, "joints of a rig"),
    (Limit::Nodes, "nodes", 16_384, "nodes and constraints that the commands of a rig make"),
    (Limit::Attributes, "attributes", 1_024, "attributes of one node"),
    (Limit::Work, "work", 1_000_000_000, "values that commands read and write in one run"),
    (Limit::Points, "points", 100_000_000, "points of a mesh"),
    (Limit::Triangles, "triangles", 200_000_000, "triangles of a mesh"),
    (Limit::Influences, "influences", 1_000_000_000, "influences of a mesh, of all its points"),
    (Limit::Gestures, "gestures", 1_000_000, "gestures of a list"),
    (Limit::StrokePoints, "stroke_points", 1_000_000, "points of one stroke"),
    (Limit::Seconds, "seconds", 3_600, "seconds of work of one command, or of one background job"),
    (Limit::Listed, "listed", 200, "joints and problems that are listed for people"),
    (Limit::Notes, "notes", 200, "notes of one command"),
    (Limit::Message, "message", 1_500, "characters of one note or error"),
    (Limit::Unpacked, "unpacked", 40_000_000, "bytes of the unpacked clips of a file, beyond 12 for each of its bytes"),
    (Limit::Frames, "frames", 1_000_000, "frames of a sixtieth of a second that pass for springs"),
    (Limit::Baked, "baked", MOST_TRANSFORMS, "transforms of a baked clip, one for each frame and node"),
];

impl Limit {
    /// All limits, in order.
    pub fn all() -> impl Iterator<Item = Self> {
        LIMITS.iter().map(|(limit, ..)| *limit)
    }

    /// The limit with that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::all().find(|limit| limit.name() == name)
    }

    /// Name of the limit.
    pub fn name(self) -> &'static str {
        LIMITS[self as usize].1
    }

    /// Value of the limit where nobody sets it.
    pub fn default_value(self) -> u64 {
        LIMITS[self as usize].2
    }

    /// Description of what the limit counts.
    pub fn meaning(self) -> &'static str {
        LIMITS[self as usize].3
    }
}

/// Values of all limits.
#[derive(Resource, Debug, Clone, PartialEq, Eq)]
pub struct RigLimits([u64; LIMITS.len()]);

impl Default for RigLimits {
    fn default() -> Self {
        Self(LIMITS.map(|(_, _, value, _)| value))
    }
}

/// Error of something that holds more than a limit.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{file}`: {holder} has {count} {what}, and no more than {limit} are taken; split it, or raise the limit: --limit \
     {name}={count}"
)]
pub struct LimitError {
    /// File, or name of the mesh or list.
    pub file: String,
    /// Holder of the counted things, as a subject.
    pub holder: String,
    /// Kind of the counted things, in words.
    pub what: &'static str,
    /// Name of the limit.
    pub name: &'static str,
    /// Number of things.
    pub count: u64,
    /// Value of the limit.
    pub limit: u64,
}

impl RigLimits {
    /// Copy of the limits with another value of one.
    pub fn with(mut self, limit: Limit, value: u64) -> Self {
        self.set(limit, value);
        self
    }

    /// Sets a limit.
    pub fn set(&mut self, limit: Limit, value: u64) {
        self.0[limit as usize] = value;
    }

    /// Value of a limit.
    pub fn get(&self, limit: Limit) -> u64 {
        self.0[limit as usize]
    }

    /// Value of a limit, as a count of things in memory.
    pub fn most(&self, limit: Limit) -> usize {
        usize::try_from(self.get(limit)).unwrap_or(usize::MAX)
    }

    /// Limits of builds.
    pub fn build(&self) -> BuildLimits {
        BuildLimits {
            made: self.most(Limit::Nodes),
            attributes: self.most(Limit::Attributes),
            work: self.get(Limit::Work),
        }
    }

    /// Time that work may take.
    pub fn time(&self) -> Duration {
        Duration::from_secs(self.get(Limit::Seconds))
    }

    /// Deadline of work that begins now.
    pub fn deadline(&self) -> Deadline {
        Deadline::after(self.time())
    }

    /// Text within the limit of messages: its beginning and its end, which says what to do, and between them the number of
    /// characters that were left out.
    pub fn shortened(&self, text: &str) -> String {
        let most = self.most(Limit::Message);
        let count = text.chars().count();
        if count <= most {
            return text.to_owned();
        }
        // Byte at which a character begins.
        let start = |number: usize| text.char_indices().nth(number).map_or(text.len(), |(at, _)| at);
        let (head, tail) = (start(most - most / 4), start(count - most / 4));
        format!("{} … {} characters left out … {}", &text[..head], count - most, &text[tail..])
    }

    /// Refuses a model with more than is taken.
    ///
    /// # Errors
    /// [`LimitError`] with the first of points, triangles, influences and joints that are too many.
    pub fn check_model(&self, file: &str, model: &Model) -> Result<(), LimitError> {
        self.check_mesh(file, model)?;
        let influences = model.weights.as_ref().map_or(0, |weights| weights.joints.len());
        self.check(Limit::Influences, influences, file, "the mesh")?;
        self.check(Limit::Joints, model.nodes.len(), file, "the skeleton")
    }

    fn check_mesh(&self, file: &str, model: &Model) -> Result<(), LimitError> {
        self.check(Limit::Points, model.points.len(), file, "the mesh")?;
        let triangles: usize = model.parts.iter().map(|part| part.triangles.len()).sum();
        self.check(Limit::Triangles, triangles, file, "the mesh")
    }

    /// Refuses to work on an open mesh with more than is taken.
    pub(super) fn check_open(&self, mesh: &RigMesh) -> Result<(), LimitError> {
        self.check_mesh(&mesh.file.name, &mesh.rest)
    }

    /// Refuses a rig with more joints than are taken.
    ///
    /// # Errors
    /// [`LimitError`].
    pub fn check_rig(&self, file: &str, rig: &Rig) -> Result<(), LimitError> {
        self.check(Limit::Joints, rig.len(), file, "the rig")
    }

    /// Refuses the motion of a skeleton with more joints than are taken.
    ///
    /// # Errors
    /// [`LimitError`].
    pub fn check_motion(&self, file: &str, motion: &Motion) -> Result<(), LimitError> {
        self.check(Limit::Joints, motion.joints.len(), file, "the motion")
    }

    /// Refuses packed clips that take more memory than is taken while they become clips of a rig.
    ///
    /// # Errors
    /// [`LimitError`].
    pub fn check_packed(&self, file: &str, packed: &PackedSkeleton) -> Result<(), LimitError> {
        let count = packed.unpacked_bytes();
        if count <= self.get(Limit::Unpacked) {
            return Ok(());
        }
        let for_file = UNPACKED_FOR_A_BYTE.saturating_mul(packed.to_bytes().len() as u64);
        let limit = self.get(Limit::Unpacked).saturating_add(for_file);
        self.check_against(limit, Limit::Unpacked, count, file, "the motion")
    }

    /// Refuses more frames than pass for springs.
    ///
    /// # Errors
    /// [`LimitError`].
    pub fn check_frames(&self, file: &str, count: u32) -> Result<(), LimitError> {
        self.check_against(self.get(Limit::Frames), Limit::Frames, u64::from(count), file, "the pose")
    }

    /// Refuses a skeleton of a text with more joints than are taken.
    ///
    /// # Errors
    /// [`LimitError`].
    pub fn check_rig_text(&self, file: &str, text: &RigText) -> Result<(), LimitError> {
        self.check(Limit::Joints, text.joints.len(), file, "the rig")
    }

    /// Refuses a list with more gestures than are taken, or with a stroke of more points.
    ///
    /// # Errors
    /// [`LimitError`].
    pub fn check_gestures(&self, file: &str, gestures: &[Gesture]) -> Result<(), LimitError> {
        self.check(Limit::Gestures, gestures.len(), file, "the list")?;
        gestures.iter().enumerate().try_for_each(|(at, gesture)| self.check_gesture(file, at + 1, gesture))
    }

    pub(super) fn check_gesture(&self, file: &str, number: usize, gesture: &Gesture) -> Result<(), LimitError> {
        match gesture {
            Gesture::Stroke { points, .. } => {
                self.check(Limit::StrokePoints, points.len(), file, &format!("gesture {number} (Stroke)"))
            }
            _ => Ok(()),
        }
    }

    /// Refuses a count above a limit.
    pub(super) fn check(&self, of: Limit, count: usize, file: &str, holder: &str) -> Result<(), LimitError> {
        self.check_against(self.get(of), of, count as u64, file, holder)
    }

    fn check_against(&self, limit: u64, of: Limit, count: u64, file: &str, holder: &str) -> Result<(), LimitError> {
        if count <= limit {
            return Ok(());
        }
        let meaning = of.meaning();
        let what = meaning.split(" of ").next().unwrap_or(meaning);
        Err(LimitError { file: file.to_owned(), holder: holder.to_owned(), what, name: of.name(), count, limit })
    }
}

/// Gives the limits of builds to the modules where an app sets them.
pub(super) fn limit_builds(limits: Res<RigLimits>, modules: Option<ResMut<RigModules>>, mut was_set: Local<bool>) {
    // An app may have limited the modules alone.
    let is_left = !std::mem::replace(&mut *was_set, true) && *limits == RigLimits::default();
    if is_left {
        return;
    }
    if let Some(mut modules) = modules.filter(|modules| modules.0.limits != limits.build()) {
        Arc::make_mut(&mut modules.0).limits = limits.build();
    }
}
