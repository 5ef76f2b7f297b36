//! Choices among the clips of files, maps for their joints, and reasons for not taking them.

use std::{
    collections::{BTreeSet, HashSet},
    path::{Path, PathBuf},
};

use super::{AnimateArgs, is_motion};
use crate::{
    cli::{Failure, Report},
    rig::{
        Rig,
        animation::{
            joint_map::{JointMap, JointMapError, NamePairs},
            motion::Motion,
        },
        nearest::did_you_mean,
    },
    solve::{bake_clip::BakeError, retarget::RetargetError},
};

/// Error of taking the clips of the files.
#[derive(Debug, thiserror::Error)]
pub(super) enum ClipFileError {
    /// No file has that clip.
    #[error("no file has a clip \"{name}\"; there are {known}")]
    NoClip {
        /// The name or number.
        name: String,
        /// Names of the clips with their numbers.
        known: String,
    },
    /// A file has no clips, or none that moves a joint.
    #[error("`{}` has no clips that move joints; give a file with animations of its skeleton", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// The motion of a file cannot be mapped to the rig.
    #[error("`{}`: {source}", path.display())]
    Map {
        /// The file.
        path: PathBuf,
        /// Reason.
        source: JointMapError,
    },
    /// The motion of a file cannot be put onto the rig.
    #[error("`{}`: {source}", path.display())]
    Retarget {
        /// The file.
        path: PathBuf,
        /// Reason.
        source: RetargetError,
    },
    /// The map names a joint that no file has.
    #[error("the map of --map: none of the files of motion has a joint \"{name}\"{nearest}")]
    NoJoint {
        /// Name in the map.
        name: String,
        /// End of the sentence, with names that are near.
        nearest: String,
    },
    /// A clip would have a single frame.
    #[error(
        "the clip \"{clip}\" lasts {seconds} s, which is no frame more than the first at --fps {rate}; give a higher one"
    )]
    OneFrame {
        /// The clip.
        clip: String,
        /// Seconds from its start to its end.
        seconds: f32,
        /// Frames a second.
        rate: f32,
    },
    /// A clip cannot be baked.
    #[error("clip \"{clip}\": {source}")]
    Bake {
        /// The clip.
        clip: String,
        /// Reason.
        source: BakeError,
    },
}

/// Clips that are taken, by name or number; all without any choice.
pub(super) struct Choice<'a> {
    chosen: &'a [String],
    /// Names of all clips of all files.
    known: Vec<String>,
    /// Marks the choices that some clip fulfils.
    found: Vec<bool>,
}

impl<'a> Choice<'a> {
    /// Choice of names and numbers.
    pub fn new(chosen: &'a [String]) -> Self {
        Self { chosen, known: Vec::new(), found: vec![false; chosen.len()] }
    }

    /// True if the next clip, which has that name, is taken.
    pub fn takes(&mut self, name: &str) -> bool {
        self.known.push(name.to_owned());
        let number = self.known.len();
        let mut is_taken = self.chosen.is_empty();
        for (chosen, found) in self.chosen.iter().zip(&mut self.found) {
            if chosen == name || chosen.parse() == Ok(number) {
                *found = true;
                is_taken = true;
            }
        }
        is_taken
    }

    /// Checks that there is a clip for each choice.
    pub fn check(&self) -> Result<(), ClipFileError> {
        let Some(missing) = self.found.iter().position(|found| !found) else { return Ok(()) };
        let known: Vec<String> =
            self.known.iter().enumerate().map(|(at, name)| format!("{} \"{name}\"", at + 1)).collect();
        Err(ClipFileError::NoClip { name: self.chosen[missing].clone(), known: known.join(", ") })
    }
}

impl From<ClipFileError> for Failure {
    fn from(error: ClipFileError) -> Self {
        Self::Input(Box::new(error))
    }
}

/// Map of joints that was given, for all files of motion.
pub(super) struct GivenMap {
    pairs: NamePairs,
    /// Places of pairs whose joint some motion has.
    used: BTreeSet<usize>,
    /// Names of the joints of all motions.
    joints: BTreeSet<String>,
}

impl GivenMap {
    /// Map of pairs of names.
    pub fn new(pairs: NamePairs) -> Self {
        Self { pairs, used: BTreeSet::new(), joints: BTreeSet::new() }
    }

    /// Map of the motion of a file, with the pairs whose joints it has; of a single file all have to be there.
    pub fn of(
        &mut self,
        args: &AnimateArgs,
        path: &Path,
        motion: &Motion,
        rig: &Rig,
        report: &mut Report,
    ) -> Result<JointMap, ClipFileError> {
        let is_single = args.clips.iter().filter(|clip| is_motion(clip)).count() < 2;
        self.joints.extend(motion.joints.iter().map(|joint| joint.name.clone()));
        let mut own = NamePairs::new();
        let names: HashSet<&str> = motion.joints.iter().map(|joint| joint.name.as_str()).collect();
        for (place, pair) in self.pairs.iter().enumerate() {
            let is_there = names.contains(pair.0.as_str());
            if is_there {
                self.used.insert(place);
            }
            if is_there || is_single {
                own.push(pair.clone());
            }
        }
        let note = format!("`{}`: the map of --map has none of its joints; its bones are guessed", path.display());
        if own.is_empty() && !self.pairs.is_empty() && !report.notes.contains(&note) {
            report.notes.push(note);
        }
        JointMap::new(motion, rig, &own).map_err(|source| ClipFileError::Map { path: path.to_owned(), source })
    }

    /// Checks that some motion has the joint of each pair. Where clips are chosen, others may have it.
    pub fn check(&self, args: &AnimateArgs, report: &mut Report) -> Result<(), ClipFileError> {
        let mut pairs = self.pairs.iter().enumerate().filter(|(place, _)| !self.used.contains(place));
        let Some((_, (name, _))) = pairs.next() else { return Ok(()) };
        let nearest = did_you_mean(name, &self.joints);
        let error = ClipFileError::NoJoint { name: name.clone(), nearest };
        if args.chosen.is_empty() {
            return Err(error);
        }
        report.notes.push(error.to_string());
        Ok(())
    }
}

/// Refuses a frame rate at which a clip would be a pose.
pub(super) fn check_rate(args: &AnimateArgs, clip: &str, seconds: f32) -> Result<(), ClipFileError> {
    match args.fps {
        Some(rate) if seconds > 0.0 && seconds * rate < 1.0 - 1e-3 => {
            Err(ClipFileError::OneFrame { clip: clip.to_owned(), seconds, rate })
        }
        _ => Ok(()),
    }
}
