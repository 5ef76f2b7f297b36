//! Files of motion: clips of rigs, motion capture, and the animations of models, as clips of the rig.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use serde_json::{Map, Value, json};

use super::AnimateArgs;
use crate::{
    cli::{Failure, Report, limits, progress::spinning, report::counted},
    files::{FileKind, RealDisk, load_animation, load_joint_map, load_motion, save_atomic, stem},
    headless::{Workbench, posing::PoseError},
    mesh::model::Model,
    rig::{
        Rig,
        animation::{
            RigClip,
            file_clip::{motion_of, numbered_clip, own_joints},
            humanoid::HumanBone,
            joint_map::{JointMap, write_joint_map},
            motion::Motion,
        },
        operations::{ClipOperation, KeyTolerance, Operation},
    },
    solve::{
        reduction::CurveKind,
        retarget::{MotionTarget, RetargetSettings, RetargetedMotion, measure_feet, measure_hands, retarget},
    },
};

/// Error of choosing among the clips of the files.
#[derive(Debug, thiserror::Error)]
enum ClipChoiceError {
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
}

/// Clips that are taken, by name or number; all without any choice.
struct Choice<'a> {
    chosen: &'a [String],
    /// Names of all clips of all files.
    known: Vec<String>,
    /// Marks the choices that some clip fulfils.
    found: Vec<bool>,
}

impl Choice<'_> {
    /// True if the next clip, which has that name, is taken.
    fn takes(&mut self, name: &str) -> bool {
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
    fn check(&self) -> Result<(), ClipChoiceError> {
        let Some(missing) = self.found.iter().position(|found| !found) else { return Ok(()) };
        let known: Vec<String> =
            self.known.iter().enumerate().map(|(at, name)| format!("{} \"{name}\"", at + 1)).collect();
        Err(ClipChoiceError::NoClip { name: self.chosen[missing].clone(), known: known.join(", ") })
    }
}

impl From<ClipChoiceError> for Failure {
    fn from(error: ClipChoiceError) -> Self {
        Self::Input(Box::new(error))
    }
}

/// Clips of all files, added to the rig as one would add them in the window.
pub(super) fn clips(
    args: &AnimateArgs,
    onto: MotionTarget,
    bench: &mut Workbench,
    report: &mut Report,
) -> Result<Vec<RigClip>, Failure> {
    let mut choice = Choice { chosen: &args.chosen, known: Vec::new(), found: vec![false; args.chosen.len()] };
    let mut added = Vec::new();
    let mut told: Vec<Map<String, Value>> = Vec::new();
    for path in &args.clips {
        match FileKind::of(path) {
            Some(kind) if kind.is_gltf() => {
                let model = spinning("reading the animations", || limits::load_model(path))?;
                let source = ModelSource { path, model };
                source.add(args, onto, bench, &mut choice, &mut added, &mut told, report)?;
            }
            Some(FileKind::Bvh) => {
                let motion = spinning("reading the motion", || load_motion(&RealDisk, path))?;
                if choice.takes(&motion.name) {
                    added.push(moved(args, path, &motion, onto, bench, &mut told, report)?);
                }
            }
            _ => added.extend(read_clips(args, path, bench, &mut choice, report)?),
        }
    }
    choice.check()?;
    // A single motion is told without a list, too.
    if let [only] = &told[..] {
        report.json.extend(only.clone());
    }
    if !told.is_empty() {
        report.set("motions", told.into_iter().map(Value::from).collect::<Vec<_>>());
    }
    Ok(added)
}

/// Clips of a file of clips.
fn read_clips(
    args: &AnimateArgs,
    path: &Path,
    bench: &mut Workbench,
    choice: &mut Choice,
    report: &mut Report,
) -> Result<Vec<RigClip>, Failure> {
    let read = load_animation(&RealDisk, path)?;
    report.notes(read.notes.iter().cloned());
    let bound = read.onto(bench.rig(), bench.built());
    if !bound.missing.is_empty() {
        report.notes.push(counted(
            bound.missing.len(),
            "node of the clips is not in the rig; its keys have no effect",
            "nodes of the clips are not in the rig; their keys have no effect",
        ));
    }
    if bound.clips.is_empty() {
        return Err(ClipChoiceError::Empty { path: path.to_owned() }.into());
    }
    let mut added = Vec::new();
    for mut clip in bound.clips {
        if choice.takes(&clip.name) {
            clip.looped |= args.looped;
            added.push(add(bench, clip)?);
        }
    }
    Ok(added)
}

/// Adds a clip to the document; returns it as the document has it.
fn add(bench: &mut Workbench, clip: RigClip) -> Result<RigClip, Failure> {
    bench.operate(Operation::Clips(ClipOperation::Add(Box::new(clip.clone()))))?;
    Ok(bench.rig().clips().last().cloned().unwrap_or(clip))
}

/// A model with animations.
struct ModelSource<'a> {
    path: &'a Path,
    model: Model,
}

impl ModelSource<'_> {
    /// Adds the chosen animations: key by key where the model's joints are those of the rig, else retargeted.
    #[expect(clippy::too_many_arguments, reason = "the parts of one command")]
    fn add(
        &self,
        args: &AnimateArgs,
        onto: MotionTarget,
        bench: &mut Workbench,
        choice: &mut Choice,
        added: &mut Vec<RigClip>,
        told: &mut Vec<Map<String, Value>>,
        report: &mut Report,
    ) -> Result<(), Failure> {
        let has_keys = onto == MotionTarget::Joints && args.map.is_none() && args.map_out.is_none();
        let own = has_keys.then(|| own_joints(&self.model, bench.rig())).flatten();
        let before = added.len();
        let mut is_any_left_out = false;
        for (number, clip) in self.model.clips.iter().enumerate() {
            let name = if clip.name.trim().is_empty() { stem(self.path) } else { clip.name.trim().to_owned() };
            if !choice.takes(&name) {
                is_any_left_out = true;
                continue;
            }
            let Some(joints) = &own else {
                let motion = Motion { name: name.clone(), ..motion_of(&self.model, clip) };
                if motion.frames() == 0 {
                    report.notes.push(format!("the clip \"{name}\" moves no joint"));
                } else {
                    added.push(moved(args, self.path, &motion, onto, bench, told, report)?);
                }
                continue;
            };
            let Some(mut clip) = numbered_clip(bench.rig(), &self.model, number, joints) else {
                report.notes.push(format!("the clip \"{name}\" moves no joint"));
                continue;
            };
            clip.name = name;
            clip.looped |= args.looped;
            clip.frame_rate = args.fps.unwrap_or(clip.frame_rate);
            let clip = add(bench, clip)?;
            let keys = clip.key_count();
            report.line(format!("\"{}\" has its keys on the joints of the rig", clip.name));
            told.push(Map::from_iter([
                ("file".to_owned(), self.path.display().to_string().into()),
                ("clip".to_owned(), clip.name.clone().into()),
                ("onto".to_owned(), json!(onto)),
                ("found_by".to_owned(), "joints".into()),
                ("keys_before".to_owned(), keys.into()),
                ("keys_after".to_owned(), keys.into()),
            ]));
            added.push(clip);
        }
        if added.len() == before && !is_any_left_out {
            return Err(ClipChoiceError::Empty { path: self.path.to_owned() }.into());
        }
        Ok(())
    }
}

/// A motion on the rig, with its clip added to the document.
fn moved(
    args: &AnimateArgs,
    path: &Path,
    motion: &Motion,
    onto: MotionTarget,
    bench: &mut Workbench,
    told: &mut Vec<Map<String, Value>>,
    report: &mut Report,
) -> Result<RigClip, Failure> {
    report.notes(motion.notes.iter().cloned());
    let given = args.map.as_deref().map(|path| load_joint_map(&RealDisk, path)).transpose()?.unwrap_or_default();
    let map = JointMap::new(motion, bench.rig(), &given)?;
    let mut entry = describe_map(&map, motion, bench.rig(), report);
    // All clips of a model have one skeleton, and so one map.
    if let Some(path) = args.map_out.as_ref().filter(|_| told.is_empty()) {
        let text = write_joint_map(&map.names(motion, bench.rig()));
        save_atomic(&RealDisk, path, text.as_bytes()).map_err(|error| Failure::Input(Box::new(error)))?;
        report.line(format!("wrote {}", path.display()));
    }
    // Keys of joints go into such files as they are.
    let is_written = onto == MotionTarget::Joints && FileKind::of(&args.output).is_some_and(FileKind::is_gltf);
    let settings = RetargetSettings {
        frame_rate: args.fps,
        looped: args.looped,
        onto,
        travel: !args.in_place,
        lock_feet: !args.free_feet,
        lock_hands: !args.free_hands,
        tolerance: KeyTolerance::captured().scaled(args.tolerance.map_or(1.0, |most| most / 0.5)),
        curves: if is_written { CurveKind::Linear } else { CurveKind::Fewest },
        ..RetargetSettings::default()
    };
    let built = bench.built().ok_or(PoseError::NotBuilt)?;
    let done = spinning("retargeting", || retarget(bench.rig(), built, motion, &map, &settings))?;
    let RetargetedMotion { clip, keys, stances, touches, unmoved, notes } = done;
    report.notes(notes);
    if !unmoved.is_empty() {
        report
            .notes
            .push(format!("no control turns {}: they keep their places at the joints above", unmoved.join(", ")));
    }
    let clip = add(bench, clip)?;
    let program = Arc::clone(bench.runtime()?.state().program());
    let feet = measure_feet(bench.rig(), &program, &clip, &map.target, &stances);
    let hands = measure_hands(bench.rig(), &program, &clip, &map.target, &touches);
    let reduction = keys[0] as f32 / keys[1].max(1) as f32;
    report.line(format!(
        "{} instead of {} ({reduction:.1} : 1); feet stand {}, slide {:.2} % and are off the ground by {:.2} % of the height at most",
        counted(keys[1], "key", "keys"),
        keys[0],
        counted(feet.stances, "time", "times"),
        feet.slide,
        feet.ankle,
    ));
    if hands.touches > 0 {
        report.line(format!(
            "hands touch something {}, and slide by {:.2} % of the height at most where they hold it",
            counted(hands.touches, "time", "times"),
            hands.slide
        ));
    }
    entry.extend([
        ("file".to_owned(), path.display().to_string().into()),
        ("clip".to_owned(), clip.name.clone().into()),
        ("onto".to_owned(), json!(onto)),
        ("foot_slide".to_owned(), feet.slide.into()),
        ("ankle_off".to_owned(), feet.ankle.into()),
        ("stances".to_owned(), json!(stances)),
        ("touches".to_owned(), json!(touches)),
        ("hand_slide".to_owned(), hands.slide.into()),
        ("unmoved".to_owned(), unmoved.into()),
        ("keys_before".to_owned(), keys[0].into()),
        ("keys_after".to_owned(), keys[1].into()),
        ("reduction".to_owned(), reduction.into()),
    ]);
    told.push(entry);
    Ok(clip)
}

fn describe_map(map: &JointMap, motion: &Motion, rig: &Rig, report: &mut Report) -> Map<String, Value> {
    let labels: Vec<String> =
        rig.walk().map(|joint| joint.data.label.clone().unwrap_or_else(|| joint.data.uid.to_string())).collect();
    let source = |joints: &[usize]| joints.iter().map(|joint| motion.joints[*joint].name.clone()).collect::<Vec<_>>();
    let target = |joints: &[usize]| joints.iter().map(|joint| labels[*joint].clone()).collect::<Vec<_>>();
    let entry = |(bone, from, to): (HumanBone, &[usize], &[usize])| json!({ "bone": bone.to_string(), "from": source(from), "to": target(to) });
    let mut mapped: Vec<Value> = map.bones().map(entry).collect();
    mapped.extend(map.pairs.iter().map(|(from, to)| json!({ "from": source(&[*from]), "to": target(&[*to]) })));
    let (from, to) = (map.unmapped_source(motion), map.unmapped_target(rig));
    report.line(format!(
        "{} mapped; {} of the motion and {} of the rig are not",
        counted(mapped.len(), "bone is", "bones are"),
        counted(from.len(), "joint", "joints"),
        to.len()
    ));
    Map::from_iter([
        ("found_by".to_owned(), json!(map.found_by)),
        ("mapped".to_owned(), mapped.into()),
        ("unmapped_source".to_owned(), from.into()),
        ("unmapped_target".to_owned(), to.into()),
    ])
}
