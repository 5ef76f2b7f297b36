//! Files of motion: clips of rigs, motion capture, and the animations of models, as clips of the rig.

use std::{collections::HashMap, path::Path, sync::Arc};

use serde_json::{Map, Value, json};

use super::{
    AnimateArgs,
    animated_rig::AnimatedRig,
    bake_settings,
    choice::{Choice, ClipFileError, GivenMap, check_rate},
    size_of, tolerance,
};
use crate::{
    cli::{Failure, Report, limits, progress::spinning, report::counted},
    files::{FileKind, RealDisk, StagedFile, load_animation, load_joint_map, load_motion, stage_file, stem},
    headless::{Workbench, posing::PoseError},
    mesh::model::Model,
    rig::{
        Rig, Uid,
        animation::{
            RigClip,
            file_clip::{motion_of, numbered_clip, own_joints, rig_clip},
            humanoid::HumanBone,
            joint_map::{JointMap, write_joint_map},
            motion::Motion,
        },
        format::animation::BoundClips,
        operations::KeyTolerance,
    },
    solve::{
        bake_clip::{BakedNode, bake_clip},
        reduction::CurveKind,
        retarget::{MotionTarget, RetargetSettings, RetargetedMotion, measure_feet, measure_hands, retarget},
    },
};

/// Clips of all files, and the map of joints that is to be written with them.
type ClipsWithMap = (Vec<RigClip>, Option<StagedFile<'static>>);

/// Clips of all files, added to the rig as one would add them in the window. `whole` is the rig with its commands where the
/// animated one has its joints alone: clips of its controls are baked onto the joints.
pub(super) fn clips(
    args: &AnimateArgs,
    onto: MotionTarget,
    animated: &mut AnimatedRig,
    whole: Option<&Workbench>,
    report: &mut Report,
) -> Result<ClipsWithMap, Failure> {
    let pairs = args.map.as_deref().map(|path| load_joint_map(&RealDisk, path)).transpose()?.unwrap_or_default();
    let mut taking = ClipCollector {
        args,
        onto,
        choice: Choice::new(&args.chosen),
        maps: GivenMap::new(pairs),
        map_file: None,
        added: Vec::new(),
        told: Vec::new(),
        set_aside: Vec::new(),
    };
    let mut failed = None;
    for path in &args.clips {
        limits::check_time("reading the motion")?;
        match FileKind::of(path) {
            Some(kind) if kind.is_gltf() => {
                let model = spinning("reading the animations", || limits::load_model(path))?;
                taking.add_model(path, &model, animated, report)?;
            }
            Some(FileKind::PackedClips) => {
                let model = spinning("unpacking the clips", || limits::load_packed_clips(path))?;
                taking.add_model(path, &model, animated, report)?;
            }
            Some(FileKind::Bvh) => {
                let motion = spinning("reading the motion", || load_motion(&RealDisk, path))?;
                if taking.choice.takes(&motion.name)
                    && let Err(error) = taking.add_motion(path, &motion, animated, report)
                {
                    failed = failed.or(Some(error));
                }
            }
            _ => taking.add_clips(path, animated, whole, report)?,
        }
    }
    // A misspelt name in the map is why a motion has no joint of the rig.
    taking.maps.check(args, report)?;
    if let Some(error) = failed {
        return Err(error);
    }
    taking.choice.check()?;
    // A single motion is told without a list, too.
    if let [only] = &taking.told[..] {
        report.json.extend(only.clone());
    }
    if !taking.told.is_empty() {
        report.set("motions", taking.told.into_iter().map(Value::from).collect::<Vec<_>>());
    }
    if !taking.set_aside.is_empty() {
        report.set("set_aside", taking.set_aside);
    }
    Ok((taking.added, taking.map_file))
}

/// Work of taking clips from files.
struct ClipCollector<'a> {
    args: &'a AnimateArgs,
    onto: MotionTarget,
    choice: Choice<'a>,
    maps: GivenMap,
    /// The map that is to be written.
    map_file: Option<StagedFile<'static>>,
    /// Clips as the document has them.
    added: Vec<RigClip>,
    /// Facts about motions, for programs.
    told: Vec<Map<String, Value>>,
    /// Nodes that the rig does not have, by files, for programs.
    set_aside: Vec<Value>,
}

impl ClipCollector<'_> {
    /// Adds the chosen clips of a file of clips.
    fn add_clips(
        &mut self,
        path: &Path,
        animated: &mut AnimatedRig,
        whole: Option<&Workbench>,
        report: &mut Report,
    ) -> Result<(), Failure> {
        let read = load_animation(&RealDisk, path)?;
        report.notes(read.notes.iter().cloned());
        let bound = match whole {
            Some(whole) => read.onto(whole.rig(), whole.built()),
            None => read.onto(animated.rig(), animated.built()),
        };
        drop(read);
        self.tell_missing(path, &bound, report);
        self.tell_unused(path, whole.is_some(), report);
        if bound.clips.is_empty() {
            return Err(ClipFileError::Empty { path: path.to_owned() }.into());
        }
        let mut taken = Vec::new();
        for mut clip in bound.clips {
            if !self.choice.takes(&clip.name) {
                continue;
            }
            check_rate(self.args, &clip.name, clip.duration())?;
            if let Some(whole) = whole {
                let Some(baked) = on_joints(self.args, &clip, animated.rig(), whole)? else {
                    report.notes.push(format!("the clip \"{}\" moves no joint", clip.name));
                    continue;
                };
                report.line(format!(
                    "\"{}\" is baked onto joints: {}",
                    clip.name,
                    counted(baked.key_count(), "key", "keys")
                ));
                clip = baked;
            }
            clip.looped |= self.args.looped;
            clip.frame_rate = self.args.fps.unwrap_or(clip.frame_rate);
            taken.push(clip);
        }
        self.added.extend(animated.add_all(taken)?);
        Ok(())
    }

    /// Tells of nodes that the rig does not have. Their keys stay in the clips, with their names.
    fn tell_missing(&mut self, path: &Path, bound: &BoundClips, report: &mut Report) {
        let labels = bound.missing_labels();
        let Some(first) = labels.first() else { return };
        let shown = match labels.len() {
            1 => first.clone(),
            count if count > SHOWN => format!("{} and {} more", labels[..SHOWN].join(", "), count - SHOWN),
            _ => labels.join(", "),
        };
        report.notes.push(format!(
            "{}: {shown}",
            counted(
                bound.missing.len(),
                "node of the clips is not in the rig; its keys are set aside and have no effect",
                "nodes of the clips are not in the rig; their keys are set aside and have no effect",
            )
        ));
        self.set_aside.push(json!({ "file": path.display().to_string(), "nodes": labels }));
    }

    /// Tells of options that have no effect on clips of the rig; those that are baked have other keys.
    fn tell_unused(&self, path: &Path, is_baked: bool, report: &mut Report) {
        let args = self.args;
        let is_baked =
            is_baked || FileKind::of(&args.output).is_some_and(|kind| kind == FileKind::PackedClips || kind.is_gltf());
        let options = [
            (args.in_place, "--in-place"),
            (args.free_feet, "--free-feet"),
            (args.free_hands, "--free-hands"),
            (args.root_motion, "--root-motion"),
            (args.tolerance.is_some() && !is_baked, "--tolerance"),
        ];
        let unused: Vec<&str> = options.iter().filter(|(is_given, _)| *is_given).map(|(_, name)| *name).collect();
        if !unused.is_empty() {
            let (file, unused) = (path.display(), unused.join(", "));
            report.notes.push(format!("`{file}`: it moves the rig as its keys say; without effect on it: {unused}"));
        }
    }
}

/// Most nodes that a note names.
const SHOWN: usize = 12;

/// A clip of a rig with commands, baked onto its joints alone; `None` if no joint moves.
fn on_joints(args: &AnimateArgs, clip: &RigClip, rig: &Rig, whole: &Workbench) -> Result<Option<RigClip>, Failure> {
    let places: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
    let place_of: HashMap<Uid, usize> = places.iter().copied().zip(0..).collect();
    let node = |joint: &crate::rig::RigJoint| BakedNode {
        uid: joint.data.uid,
        parent: joint.parent.and_then(|parent| place_of.get(&parent).copied()),
        rest: joint.data.rest.into(),
    };
    let nodes: Vec<BakedNode> = rig.walk().map(node).collect();
    let size = size_of(rig.rest_globals().iter().map(|(_, at)| at.translation.into()));
    let program = whole.runtime()?.state().program();
    let settings = bake_settings(args.fps.unwrap_or(clip.frame_rate), tolerance(args, size));
    let baked = spinning("baking", || bake_clip(program, clip, &nodes, &settings))
        .map_err(|source| ClipFileError::Bake { clip: clip.name.clone(), source })?;
    let joints: Vec<Option<Uid>> = places.into_iter().map(Some).collect();
    Ok(rig_clip(rig, &clip.name, &baked, &joints))
}

/// Motion of models and of motion capture.
impl ClipCollector<'_> {
    /// Adds the chosen animations of a model: key by key where the model's joints are those of the rig, else retargeted.
    fn add_model(
        &mut self,
        path: &Path,
        model: &Model,
        animated: &mut AnimatedRig,
        report: &mut Report,
    ) -> Result<(), Failure> {
        let args = self.args;
        let has_keys = self.onto == MotionTarget::Joints && args.map.is_none() && args.map_out.is_none();
        let own = has_keys.then(|| own_joints(model, animated.rig())).flatten();
        let before = self.added.len();
        let mut taken = Vec::new();
        let mut is_any_left_out = false;
        for (number, clip) in model.clips.iter().enumerate() {
            let name = if clip.name.trim().is_empty() { stem(path) } else { clip.name.trim().to_owned() };
            if !self.choice.takes(&name) {
                is_any_left_out = true;
                continue;
            }
            let Some(joints) = &own else {
                let motion = Motion { name: name.clone(), ..motion_of(model, clip) };
                if motion.frames() == 0 {
                    report.notes.push(format!("the clip \"{name}\" moves no joint"));
                } else {
                    self.add_motion(path, &motion, animated, report)?;
                }
                continue;
            };
            let Some(mut clip) = numbered_clip(animated.rig(), model, number, joints) else {
                report.notes.push(format!("the clip \"{name}\" moves no joint"));
                continue;
            };
            check_rate(args, &name, clip.duration())?;
            clip.name = name;
            clip.looped |= args.looped;
            clip.frame_rate = args.fps.unwrap_or(clip.frame_rate);
            taken.push(clip);
        }
        for clip in animated.add_all(taken)? {
            let keys = clip.key_count();
            report.line(format!("\"{}\" has its keys on the joints of the rig", clip.name));
            self.told.push(Map::from_iter([
                ("file".to_owned(), path.display().to_string().into()),
                ("clip".to_owned(), clip.name.clone().into()),
                ("onto".to_owned(), json!(self.onto)),
                ("found_by".to_owned(), "joints".into()),
                ("keys_before".to_owned(), keys.into()),
                ("keys_after".to_owned(), keys.into()),
            ]));
            self.added.push(clip);
        }
        if self.added.len() == before && !is_any_left_out {
            return Err(ClipFileError::Empty { path: path.to_owned() }.into());
        }
        if own.is_some() && self.added.len() > before {
            self.tell_unused(path, false, report);
        }
        Ok(())
    }

    /// Puts a motion onto the rig, and adds its clip to the document.
    fn add_motion(
        &mut self,
        path: &Path,
        motion: &Motion,
        animated: &mut AnimatedRig,
        report: &mut Report,
    ) -> Result<(), Failure> {
        let (args, onto) = (self.args, self.onto);
        report.notes(motion.notes.iter().cloned());
        check_rate(args, &motion.name, motion.duration())?;
        let map = self.maps.of(args, path, motion, animated.rig(), report)?;
        let mut entry = describe_map(&map, motion, animated.rig(), report);
        // All clips of a model have one skeleton, and so one map.
        if let Some(path) = args.map_out.as_ref().filter(|_| self.told.is_empty()) {
            let text = write_joint_map(&map.names(motion, animated.rig()));
            self.map_file = Some(stage_file(&RealDisk, path, text.as_bytes())?);
        }
        // Keys of joints go into such files as they are.
        let is_written = onto == MotionTarget::Joints && FileKind::of(&args.output).is_some_and(FileKind::is_gltf);
        let settings = RetargetSettings {
            frame_rate: args.fps,
            looped: args.looped,
            onto,
            travel: !args.in_place,
            root_motion: args.root_motion,
            lock_feet: !args.free_feet,
            lock_hands: !args.free_hands,
            tolerance: KeyTolerance::captured().scaled(args.tolerance.map_or(1.0, |most| most / 0.5)),
            curves: if is_written { CurveKind::Linear } else { CurveKind::Fewest },
            ..RetargetSettings::default()
        };
        let built = animated.built().ok_or(PoseError::NotBuilt)?;
        let done = spinning("retargeting", || retarget(animated.rig(), built, motion, &map, &settings))
            .map_err(|source| ClipFileError::Retarget { path: path.to_owned(), source })?;
        let RetargetedMotion { clip, keys, stances, touches, unmoved, root, notes } = done;
        report.notes(notes);
        if let Some(root) = root {
            let name = built.node(root).map_or_else(|| root.to_string(), |node| node.name.to_string());
            report.line(format!("the travel is on {name}, for root motion"));
            entry.insert("root".to_owned(), json!({"node": root, "name": name}));
        }
        if keys[1] == 0 {
            let name = &clip.name;
            report
                .notes
                .push(format!("the clip \"{name}\" moves nothing: no joint that is mapped moves in the motion"));
        }
        if !unmoved.is_empty() {
            report
                .notes
                .push(format!("no control turns {}: they keep their places at the joints above", unmoved.join(", ")));
        }
        let clip = animated.add_all(vec![clip.clone()])?.pop().unwrap_or(clip);
        let program = Arc::clone(animated.program()?);
        let feet = measure_feet(animated.rig(), &program, &clip, &map.target, &stances);
        let hands = measure_hands(animated.rig(), &program, &clip, &map.target, &touches);
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
        self.told.push(entry);
        self.added.push(clip);
        Ok(())
    }
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
