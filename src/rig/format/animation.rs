//! Clips, the `*.anim.ron` files of animators.
//!
//! A file holds clips of one rig. Each track names its node by uid, with its label (and the role that a command gave to it)
//! beside it, so that the clips can be put onto another rig, too: see [`ReadAnimation::onto`]. One key is one line. Reading
//! checks everything before it returns, reading what was written gives the same clips, and writing those the same bytes.

mod clip_binding;
mod file;
mod write;

pub(super) use file::{ClipFile, ClipPlace, clip_fields};
pub(super) use write::write_clips;

use serde::Deserialize;

use super::{
    scan::{self, Field},
    source::{ron_options, utf8},
    tree::Tree,
    version::Format,
};
use crate::rig::{
    BuiltRig, Rig, SourceError, Uid,
    animation::{NodeNames, RigClip},
};

/// Format that this version reads and writes.
pub const FORMAT: u32 = 1;

/// Largest size in bytes of a file of clips that is read.
pub const MAX_BYTES: usize = 128 << 20;

/// Content of a file of clips.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReadAnimation {
    /// Uid of the rig that the clips were made for.
    pub rig: Uid,
    /// Name of that rig.
    pub rig_name: String,
    /// The clips.
    pub clips: Vec<RigClip>,
    /// Names that the file gives to nodes.
    pub names: NodeNames,
    /// Notes about content that the reader ignored, a sentence each.
    pub notes: Vec<String>,
}

/// Clips of a file on a rig.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BoundClips {
    /// The clips, with the uids of the rig's nodes. Keys of nodes that were not found keep the uids of the file.
    pub clips: Vec<RigClip>,
    /// Nodes that were found by their labels: uid in the file and in the rig.
    pub by_label: Vec<(Uid, Uid)>,
    /// Nodes of the file that the rig does not have.
    pub missing: Vec<Uid>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AnimationFile {
    #[serde(rename = "format")]
    _format: u32,
    rig: Uid,
    #[serde(default)]
    rig_name: String,
    #[serde(default)]
    clips: Vec<ClipFile>,
}

const ANIMATION: Format = Format { what: "animation", number: FORMAT, known: known_names };

/// Text of a file with clips of a rig. `built` gives the labels of nodes that commands created. The same clips give the same
/// bytes.
pub fn write_animation(rig: &Rig, built: Option<&BuiltRig>, clips: &[RigClip]) -> String {
    write_named(rig.uid(), &rig.about().name, &NodeNames::of(rig, built), clips)
}

/// Text of a file with clips, with names for their nodes.
pub fn write_named(rig: Uid, rig_name: &str, names: &NodeNames, clips: &[RigClip]) -> String {
    let mut out = String::new();
    write::write_file(&mut out, (rig, rig_name), names, clips).unwrap_or_default();
    out
}

/// Reads a file of clips. An error anywhere refuses the whole file.
pub fn read_animation(bytes: &[u8]) -> Result<ReadAnimation, SourceError> {
    let text = utf8(bytes, MAX_BYTES, "animation")?;
    let mut notes = Vec::new();
    let known = if is_newer(text) {
        ANIMATION.readable(text, &scan::fields(text), 1, &mut notes)?
    } else {
        std::borrow::Cow::Borrowed(text)
    };
    let file: AnimationFile = ron_options().from_str(&known).map_err(|error| SourceError::from_ron(text, &error))?;
    let mut names = NodeNames::default();
    let clips = file::clips(file.clips, &mut names).map_err(|(place, message)| {
        SourceError::at(text, file::offset(text, &[], &place).unwrap_or_default(), message)
    })?;
    Ok(ReadAnimation { rig: file.rig, rig_name: file.rig_name, clips, names, notes })
}

/// True unless the text begins as a file of this format does: only others need a search for what is not known.
fn is_newer(text: &str) -> bool {
    let start: String = text.chars().take(200).filter(|c| !c.is_whitespace()).collect();
    !start.starts_with("(format:1,")
}

/// Converts clips of a project's rig. The place of an error is below the field `clips` of the struct at `path`.
pub(super) fn clips_in(
    files: Vec<ClipFile>,
    text: &str,
    path: &[(&str, usize)],
) -> Result<(Vec<RigClip>, NodeNames), SourceError> {
    let mut names = NodeNames::default();
    let clips = file::clips(files, &mut names).map_err(|(place, message)| {
        SourceError::at(text, file::offset(text, path, &place).unwrap_or_default(), message)
    })?;
    Ok((clips, names))
}

/// The start of the clip with that number of a project's rig.
pub(super) fn clip_offset(text: &str, path: &[(&str, usize)], clip: usize) -> Option<usize> {
    file::offset(text, path, &ClipPlace { clip, ..ClipPlace::default() })
}

/// Names that are allowed for a field at its place.
fn known_names(fields: &[Field], field: &Field) -> Option<&'static [&'static str]> {
    let above = |field: &Field| field.parent.map(|parent| &fields[parent]);
    let mut path: Vec<&str> =
        std::iter::successors(above(field), |field| above(field)).map(|field| field.name).collect();
    path.reverse();
    match path[..] {
        [] if field.depth == 1 => Some(&["format", "rig", "rig_name", "clips"]),
        ["clips", ref rest @ ..] => clip_fields(rest),
        _ => None,
    }
}

impl ReadAnimation {
    /// The clips on a rig: nodes are found by their uid, else by their label and role, where only one node has them and the
    /// file has no node with its uid.
    pub fn onto(&self, rig: &Rig, built: Option<&BuiltRig>) -> BoundClips {
        clip_binding::bind_clips(self, &NodeNames::of(rig, built))
    }
}

impl BoundClips {
    /// Labels of the nodes that the rig does not have, sorted, each once; the uid where the file has no label.
    pub fn missing_labels(&self) -> Vec<String> {
        let label = |node: &Uid| {
            let known = self.clips.iter().find_map(|clip| clip.names.0.get(node));
            let label = known.map(|name| name.label.clone()).filter(|label| !label.is_empty());
            label.unwrap_or_else(|| node.to_string())
        };
        let labels: std::collections::BTreeSet<String> = self.missing.iter().map(label).collect();
        labels.into_iter().collect()
    }
}

/// Node of a syntax tree.
type Place<'a> = (&'a Tree<'a>, usize);
