//! Parts in a template's file: what it lets others vary, and the parts that it uses itself.

use std::{collections::HashSet, fmt, sync::Arc};

use bevy::math::Vec3;
use ron::value::RawValue;
use serde::Serialize;

use super::{
    super::{
        FORMAT, Template,
        file::{ChainFile, PartChangeFile, PartFile},
    },
    Places, bind_references, read_text,
};
use crate::rig::{
    RestTransform, Rig, RigEdit, SourceError, Uid, degrees,
    format::{scan::Field, source::ron_text},
    label::mirrored_label,
    part::{MOST_JOINTS, MirrorParams, Part, PartChain, PartChange, PartError, PartInstance},
};

/// Chains of a part. One that does not fit the joints is told and left out.
pub(super) fn chains(rig: &Rig, files: Vec<ChainFile>, notes: &mut Vec<String>) -> Vec<PartChain> {
    let mut known: Vec<PartChain> = Vec::with_capacity(files.len());
    for ChainFile { name, joints: labels, min, max } in files {
        let joints: Vec<Uid> = labels.iter().filter_map(|label| rig.find_label(label)).collect();
        let (min, max) = (min.unwrap_or(1), max.unwrap_or(MOST_JOINTS));
        let parent = |joint: Uid| rig.joint(joint).and_then(|joint| joint.parent);
        let fault = if joints.len() != labels.len() || joints.len() < 2 {
            "it needs two joints or more, all of them in the file".to_owned()
        } else if joints.windows(2).any(|pair| parent(pair[1]) != Some(pair[0])) {
            "each of its joints must be the parent of the next".to_owned()
        } else if !(1..=joints.len()).contains(&min) || !(joints.len()..=MOST_JOINTS).contains(&max) {
            format!("`min` is 1 to {0}, and `max` {0} to {MOST_JOINTS}, for its {0} joints", joints.len())
        } else if known.iter().any(|chain| chain.name == name || chain.joints.iter().any(|of| joints.contains(of))) {
            "another has its name or one of its joints".to_owned()
        } else {
            known.push(PartChain { name, joints, min, max });
            continue;
        };
        notes.push(format!("chain \"{name}\" has the number of joints in the file, always: {fault}"));
    }
    known
}

/// The part instances of a file, with their places in the text.
pub(super) fn instances(places: &Places, parts: Vec<PartFile>, faults: &mut Vec<SourceError>) -> Vec<PartInstance> {
    let is_part = |field: &&Field| {
        let parent = field.parent.map(|parent| places.fields[parent].name);
        field.depth == 3 && field.name == "part" && parent == Some("parts")
    };
    let mut offsets = places.fields.iter().filter(is_part).map(|field| field.start);
    let mut seen = HashSet::new();
    let mut found = Vec::with_capacity(parts.len());
    for file in parts {
        let offset = offsets.next().unwrap_or_default();
        let mut fault = |message: String| faults.push(SourceError::at(places.text, offset, message));
        let onto = file.onto.join(" ");
        let title = if file.name.is_empty() { onto.as_str() } else { &file.name };
        let uid = file.uid.unwrap_or_else(|| Uid::derived(["part instance", file.part.as_str(), title]));
        if !seen.insert(uid) {
            fault(format!("two uses of \"{}\" are called the same; give each a `name`", file.part));
            continue;
        }
        if !file.onto.is_empty() && file.parent.is_some() {
            fault("a part goes onto joints, or below a parent with its own; leave out `onto` or `parent`".to_owned());
        }
        let counts = file.counts.into_iter().map(|of| (of.chain, of.count));
        let counts: Vec<(String, usize)> =
            file.count.map(|count| (String::new(), count)).into_iter().chain(counts).collect();
        let rest = RestTransform {
            translation: <[f32; 3]>::from(file.translation).into(),
            rotation: degrees(<[f32; 3]>::from(file.rotation).into()),
            scale: Vec3::splat(file.scale),
        };
        if !rest.is_valid() {
            fault("the place of the part is not finite; correct the numbers".to_owned());
            continue;
        }
        let mut changes = Vec::with_capacity(file.changes.len());
        for change in file.changes {
            match change_of(change) {
                Ok(change) => changes.push(change),
                Err(error) => fault(error.to_string()),
            }
        }
        found.push(PartInstance {
            uid,
            part: file.part,
            name: file.name,
            onto: file.onto,
            adds: file.adds,
            counts,
            parent: file.parent,
            rest,
            is_world: file.world,
            prefix: file.prefix,
            mirror: file.mirror,
            off: file.off,
            changes,
            offset,
        });
    }
    found
}

/// Reason why a change of a part cannot be read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
enum PartChangeError {
    /// A change of neither a joint nor a tag, or of both.
    #[error("a change of a part is one of a `joint` or of a `tag`; name one of the two")]
    Subject,
    /// A place or tags for a tag.
    #[error("a tag of a part has no place and no tags; change the `joint`")]
    TagFields,
    /// A switch or parameters for a joint.
    #[error("a joint of a part has no parameters; change the `tag`")]
    JointFields,
    /// Tags that cannot be read.
    #[error("{}", .0.message)]
    Tags(#[from] SourceError),
}

/// Template of one joint, through which the tags of a change are read.
#[derive(Serialize)]
struct TagTemplate<'a> {
    format: u32,
    name: &'a str,
    joints: &'a [TaggedJoint<'a>],
}

/// Joint with the tags of a change as they are written.
#[derive(Serialize)]
struct TaggedJoint<'a> {
    label: &'a str,
    tags: &'a RawValue,
}

fn change_of(file: PartChangeFile) -> Result<PartChange, PartChangeError> {
    if file.joint.is_none() == file.tag.is_none() {
        return Err(PartChangeError::Subject);
    }
    if file.tag.is_some() && (file.translation.is_some() || file.rotation.is_some() || file.tags.is_some()) {
        return Err(PartChangeError::TagFields);
    }
    if file.joint.is_some() && (file.enabled.is_some() || file.params.is_some()) {
        return Err(PartChangeError::JointFields);
    }
    let mut tags = Vec::new();
    if let (Some(text), Some(joint)) = (&file.tags, &file.joint) {
        let joints = &[TaggedJoint { label: joint, tags: text }];
        let read = read_text(&ron_text(&TagTemplate { format: FORMAT, name: "part", joints }), 1)?;
        tags = read.rig.walk().next().map(|joint| joint.data.tags.clone()).unwrap_or_default();
    }
    Ok(PartChange {
        joint: file.joint,
        tag: file.tag,
        enabled: file.enabled,
        params: file.params.map(|params| params.trim().get_ron().to_owned()),
        translation: file.translation.map(Into::into),
        rotation: file.rotation.map(Into::into),
        tags,
    })
}

impl Template {
    /// The template with its parts, each of which `part` gives.
    ///
    /// # Errors
    /// A part that cannot be had or does not fit, with its place in `source`, the text of the template.
    pub fn with_parts<E: fmt::Display + From<PartError>>(
        mut self,
        source: &str,
        part: &mut dyn FnMut(&str) -> Result<Arc<Part>, E>,
        mirror: MirrorParams,
    ) -> Result<Self, SourceError> {
        for instance in std::mem::take(&mut self.parts) {
            let put = part(&instance.part).and_then(|part| Ok(instance.put_into(&mut self.rig, &part, mirror)?));
            match put {
                Ok(notes) => self.notes.extend(notes),
                Err(error) => {
                    let message = format!("part \"{}\": {error}", instance.title());
                    return Err(SourceError::at(source, instance.offset, message));
                }
            }
            self.instances.push(instance);
        }
        if !self.instances.is_empty() {
            pair_sides(&mut self.rig);
        }
        bind_references(&mut self.rig, &mut self.notes);
        Ok(self)
    }
}

/// Makes joints partners whose labels differ by their side alone, where neither has one: a side comes from a part that knows
/// nothing of the other.
fn pair_sides(rig: &mut Rig) {
    let free = |rig: &Rig, joint: Uid| rig.joint(joint).is_some_and(|joint| joint.data.mirror.is_none());
    let labelled: Vec<(Uid, Option<String>)> =
        rig.walk().map(|joint| (joint.data.uid, joint.data.label.as_deref().and_then(mirrored_label))).collect();
    for (joint, opposite) in labelled {
        let Some(other) = opposite.and_then(|label| rig.find_label(&label)) else { continue };
        if free(rig, joint) && free(rig, other) {
            for (of, to) in [(joint, other), (other, joint)] {
                let done = rig.apply(&RigEdit::SetMirror(of, Some(to)));
                debug_assert!(done.is_ok(), "a partner of the rig was refused: {done:?}");
            }
        }
    }
}
