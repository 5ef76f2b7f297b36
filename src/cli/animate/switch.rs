//! `--switch`: kinematics and spaces thrown over a range of clips, with keys that keep every joint in its place.

use std::sync::Arc;

use clap::Args;
use serde_json::{Value, json};

use crate::{
    cli::{Failure, Report, progress::spinning},
    headless::{Workbench, posing::PoseError},
    plugins::controls::{SwitchError, switch_over},
    rig::{Uid, animation::RigClip},
    solve::matching::{SwitchOverError, SwitchedRange},
};

/// Switches over a range of clips.
#[derive(Args, Debug, Default)]
pub(super) struct SwitchOverArgs {
    /// Throw a switch over the clips, with keys that keep all joints in their places: NAME=ik, fk or the name of a space; NAME
    /// is a local group, a control or a joint of the limb; may be repeated
    #[arg(long = "switch", value_name = "NAME=VALUE")]
    switches: Vec<String>,
    /// Frames over which --switch throws a switch, at the frame rate of each clip; the whole clip if left out
    #[arg(long, value_name = "A..B", requires = "switches", value_parser = frames, allow_hyphen_values = true)]
    range: Option<[f32; 2]>,
}

impl SwitchOverArgs {
    /// True if no switch is thrown.
    pub fn is_empty(&self) -> bool {
        self.switches.is_empty()
    }
}

/// Error of a range of frames.
#[derive(Debug, thiserror::Error)]
enum RangeError {
    /// No range.
    #[error("write two frames, the second one after the first, for example 10..48")]
    NoRange,
}

fn frames(text: &str) -> Result<[f32; 2], RangeError> {
    let (from, to) = text.split_once("..").ok_or(RangeError::NoRange)?;
    let frame = |text: &str| text.trim().parse::<f32>().ok().filter(|frame| frame.is_finite());
    let (from, to) = frame(from).zip(frame(to)).ok_or(RangeError::NoRange)?;
    if from < to { Ok([from, to]) } else { Err(RangeError::NoRange) }
}

/// Throws the switches over each clip, which the document has as well.
pub(super) fn throw(
    args: &SwitchOverArgs,
    bench: &mut Workbench,
    clips: &mut [RigClip],
    report: &mut Report,
) -> Result<(), Failure> {
    let mut told: Vec<Value> = Vec::new();
    for switch in &args.switches {
        let wrong = || Failure::Usage(format!("--switch {switch}: write NAME=VALUE, for example arm_l=fk"));
        let (name, value) = switch.split_once('=').ok_or_else(wrong)?;
        let found = bench.switches_named(name.trim(), value.trim())?;
        for clip in &mut *clips {
            let seconds = |frame: f32| (f64::from(frame) / f64::from(clip.frame_rate)) as f32;
            let span = args.range.map_or(clip.range, |range| range.map(seconds));
            for (control, attribute, number) in &found {
                let thrown = spinning("switching", || one(bench, clip, (*control, attribute.as_str(), *number), span))?;
                let Some(SwitchedRange { frames, keys, notes, .. }) = thrown else {
                    report.notes.push(format!("clip \"{}\": {switch} holds in the whole range already", clip.name));
                    continue;
                };
                report.line(format!("clip \"{}\": {switch} over {frames} frames, with {keys} keys", clip.name));
                report.notes.extend(notes.iter().map(|note| format!("clip \"{}\": {note}", clip.name)));
                told.push(json!({
                    "clip": clip.name,
                    "switch": switch,
                    "frames": frames,
                    "keys": keys,
                    "off": notes,
                }));
            }
        }
    }
    if !args.switches.is_empty() {
        report.set("switched", told);
    }
    Ok(())
}

/// Throws a switch over a span of a clip; `None` if it has that value there already.
fn one(
    bench: &mut Workbench,
    clip: &mut RigClip,
    (control, attribute, value): (Uid, &str, f32),
    span: [f32; 2],
) -> Result<Option<SwitchedRange>, Failure> {
    let program = Arc::clone(bench.runtime()?.state().program());
    let built = bench.built().ok_or(PoseError::NotBuilt)?;
    let switched = switch_over(bench.rig(), built, &program, (control, attribute, value), (clip.uid, None, span));
    let (operation, switched) = match switched {
        Ok(switched) => switched,
        Err(SwitchError::Over(SwitchOverError::Already)) => return Ok(None),
        Err(error) => return Err(PoseError::from(error).into()),
    };
    bench.operate(operation)?;
    if let Some(changed) = bench.rig().clip(clip.uid) {
        clip.clone_from(changed);
    }
    Ok(Some(switched))
}
