//! Everything that is wrong with a rig's commands at once.

use std::sync::Arc;

use super::{BuildError, BuildProblem, Builder, Modules};
use crate::rig::{Rig, RigEdit, SourceError, TagData, TagKind, Uid};

/// How many failing commands are looked for.
const MOST: usize = 200;

/// The problems of all commands of a rig, in the order of the build list: those whose module or parameters are wrong,
/// switched off or not, and those that fail when they run. A command that fails is left out for the rest, so what only
/// fails because of it is told, too.
pub fn review(rig: &Rig, modules: &Arc<Modules>) -> Vec<BuildError> {
    let mut problems = Vec::new();
    let mut rig = rig.clone();
    let mut off = Vec::new();
    for joint in rig.walk() {
        for tag in &joint.data.tags {
            let TagKind::Command { module, params, .. } = &tag.kind else { continue };
            if let Err(problem) = modules.load(module, params) {
                problems.push(BuildError {
                    command: tag.uid,
                    joint: joint.data.uid,
                    joint_label: joint.data.label.clone().unwrap_or_else(|| joint.data.uid.to_string()).into(),
                    module: module.as_str().into(),
                    problem,
                });
                off.push((joint.data.uid, tag.clone()));
            }
        }
    }
    let order: Vec<Uid> = rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| tag.uid)).collect();
    off.into_iter().for_each(|(joint, tag)| switch_off(&mut rig, joint, tag));
    let mut builder = Builder::new(modules.clone());
    for _ in 0..MOST {
        builder.sync(&rig);
        let Some(error) = builder.run_all().error else { break };
        let tags = rig.joint(error.joint).map(|joint| joint.data.tags.clone()).unwrap_or_default();
        let Some(tag) = tags.into_iter().find(|tag| tag.uid == error.command) else { break };
        switch_off(&mut rig, error.joint, tag);
        problems.push(error);
    }
    problems.sort_by_key(|error| order.iter().position(|tag| *tag == error.command));
    problems
}

fn switch_off(rig: &mut Rig, joint: Uid, tag: TagData) {
    // The tag was just there: nothing can be refused.
    let _ = rig.apply(&RigEdit::SetTag(joint, Box::new(TagData { enabled: false, ..tag })));
}

/// Where the problem of a command is in the text of its template: in its parameters if they cannot be read, else at its
/// tag. The beginning of the text if the tag is not in it.
pub fn locate(text: &str, error: &BuildError) -> SourceError {
    let tag = tag_offset(text, error.command).unwrap_or(0);
    let message = format!("{}: {}", error.module, error.problem);
    let BuildProblem::Parameters(inner) = &error.problem else { return SourceError::at(text, tag, message) };
    let params = text[tag..].find("params:").map_or(tag, |at| tag + at + "params:".len());
    let params = params + text[params..].len() - text[params..].trim_start().len();
    SourceError::at(text, params + inner.offset, format!("{}: {}", error.module, inner.message))
}

/// The place of the uid by which a tag introduces itself.
fn tag_offset(text: &str, tag: Uid) -> Option<usize> {
    let quoted = format!("\"{tag}\"");
    let introduces =
        |at: usize| text[..at].trim_end().strip_suffix(':').is_some_and(|before| before.trim_end().ends_with("uid"));
    text.match_indices(&quoted).map(|(at, _)| at).find(|at| introduces(*at))
}
