//! Clips, their layers and their keys, as people change them. Each operation is one step of the history.

mod ease;
mod keys;
mod mirror;
mod pose;
mod reduce;
mod time;

use std::{
    collections::{BTreeMap, HashMap, HashSet},
    sync::Arc,
};

use super::{Draft, OperationError};
use crate::rig::{
    BuiltRig, EditError, RigEdit, Uid,
    animation::{ClipAbout, ClipLayer, Key, LayerAbout, LayerMode, RigClip, TrackTarget},
};

pub use ease::KeyEase;
pub use keys::KeyClipboard;
pub(super) use mirror::{carried as carried_key, frame_of, partners};
pub(super) use pose::keyed;
pub use reduce::KeyTolerance;

/// Selected keys: times by what they animate. Times without a key are passed over.
pub type KeyTimes = BTreeMap<TrackTarget, Vec<f32>>;

/// Change of clips.
#[derive(Debug, Clone, PartialEq)]
pub enum ClipOperation {
    /// Creates a clip with one base layer, as the last one.
    Create {
        /// Name of the clip, which no other clip has.
        name: String,
        /// Frames a second.
        frame_rate: f32,
        /// First and last second.
        range: [f32; 2],
    },
    /// Adds a clip, from a file for example. A name or uid that is taken gets another one.
    Add(Box<RigClip>),
    /// Adds clips, those of a file for example, as [`ClipOperation::Add`] adds each.
    AddAll(Vec<RigClip>),
    /// Renames a clip.
    Rename(Uid, String),
    /// Sets name, frame rate, range, loop and markers of a clip.
    About(Uid, Box<ClipAbout>),
    /// Deletes a clip.
    Delete(Uid),
    /// Adds a layer on top of a clip.
    AddLayer {
        /// The clip.
        clip: Uid,
        /// Name of the layer.
        name: String,
        /// Manner in which its values meet those below.
        mode: LayerMode,
    },
    /// Sets name, mode, weight, mask and muting of a layer.
    SetLayer {
        /// The clip.
        clip: Uid,
        /// The layer.
        layer: Uid,
        /// The layer's header.
        about: Box<LayerAbout>,
    },
    /// Puts a layer to another place.
    MoveLayer {
        /// The clip.
        clip: Uid,
        /// The layer.
        layer: Uid,
        /// Index from the bottom.
        index: usize,
    },
    /// Deletes a layer with its keys.
    DeleteLayer {
        /// The clip.
        clip: Uid,
        /// The layer.
        layer: Uid,
    },
    /// Stretches a span of time of a whole clip: keys of all layers and markers. What comes later moves along.
    Retime {
        /// The clip.
        clip: Uid,
        /// First and last second of the span.
        from: [f32; 2],
        /// Seconds at which the span begins and ends afterwards.
        to: [f32; 2],
    },
    /// Sets the frame rate of a clip so that all keys and markers stay on their frames: it takes longer at a lower rate.
    SetRate {
        /// The clip.
        clip: Uid,
        /// Frames a second.
        rate: f32,
    },
    /// Replaces the keys of all layers by linear ones at the clip's frame rate; steps stay steps.
    Bake(Uid),
    /// Removes keys of all layers without which their tracks stay within a tolerance, at the keys and between them. The keys
    /// that stay keep their tangents.
    Reduce {
        /// The clip.
        clip: Uid,
        /// Largest differences.
        tolerance: KeyTolerance,
    },
    /// Gives the keys of nodes that are gone to others, in all layers, as [`KeyOperation::Adopt`] does for one.
    Adopt {
        /// The clip.
        clip: Uid,
        /// Pairs of a node that is gone, and the one that gets its keys.
        nodes: Vec<[Uid; 2]>,
    },
    /// Changes keys of a layer.
    Keys {
        /// The clip.
        clip: Uid,
        /// The layer.
        layer: Uid,
        /// The change.
        change: KeyOperation,
    },
}

/// Change of keys of a layer.
#[derive(Debug, Clone, PartialEq)]
pub enum KeyOperation {
    /// Sets keys at a time so that the clip has the current pose of nodes there: translation and rotation, and what is not
    /// at rest or has keys already.
    Pose {
        /// Second in the clip.
        time: f32,
        /// The nodes.
        nodes: Vec<Uid>,
    },
    /// Sets keys at a time so that the clip has these values there, mixed with the layers below.
    Values {
        /// Second in the clip.
        time: f32,
        /// The values, of which the first [`Property::width`](crate::rig::animation::Property::width) numbers count.
        values: Vec<(TrackTarget, [f32; 4])>,
    },
    /// Sets keys; those at the same times are replaced.
    Set(Vec<(TrackTarget, Vec<Key>)>),
    /// Puts keys to other times: each pair has the time of a key and the one that it gets. Keys that they meet are replaced;
    /// pairs without a key are passed over.
    Place(Vec<(TrackTarget, Vec<[f32; 2]>)>),
    /// Moves keys in time. Keys that they meet are replaced.
    Move {
        /// The keys.
        keys: KeyTimes,
        /// Seconds.
        by: f32,
    },
    /// Scales the times of keys about a pivot, tangents with them. Keys that they meet are replaced.
    Scale {
        /// The keys.
        keys: KeyTimes,
        /// Second that stays.
        pivot: f32,
        /// Factor; a negative one turns the keys round, zero is refused.
        factor: f32,
    },
    /// Deletes keys.
    Delete(KeyTimes),
    /// Inserts copied keys so that the first is at a time. Keys at the same times are replaced.
    Paste {
        /// The copied keys.
        clipboard: Arc<KeyClipboard>,
        /// Second of the first key.
        at: f32,
    },
    /// Copies keys to the nodes on the other side, as their mirror image, and those of central nodes onto themselves. Keys of
    /// a pair that are both selected are exchanged.
    Mirror {
        /// The keys.
        keys: KeyTimes,
        /// Result of the rig's commands, for the pairs of created nodes.
        built: Option<Arc<BuiltRig>>,
    },
    /// Sets the interpolation from keys to the next ones.
    Ease {
        /// The keys.
        keys: KeyTimes,
        /// The interpolation.
        ease: KeyEase,
    },
    /// Replaces the keys of tracks by linear ones at a rate; steps stay steps.
    Bake {
        /// The tracks.
        targets: Vec<TrackTarget>,
        /// Keys a second.
        rate: f32,
    },
    /// Removes keys without which a track stays within a tolerance, as [`ClipOperation::Reduce`] does.
    Reduce {
        /// The tracks.
        targets: Vec<TrackTarget>,
        /// Largest differences.
        tolerance: KeyTolerance,
    },
    /// Gives the keys of a node that is gone to another one; a property that the other one has keys of keeps those. A layer that
    /// concerns only some nodes, the one that is gone among them, concerns the other one, too.
    Adopt {
        /// The node that is gone.
        from: Uid,
        /// The node that gets its keys.
        to: Uid,
    },
}

impl ClipOperation {
    /// A few words for the history panel.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Create { .. } => "Create clip",
            Self::Add(_) => "Add clip",
            Self::AddAll(_) => "Add clips",
            Self::Rename(..) => "Rename clip",
            Self::About(..) => "Set clip",
            Self::Delete(_) => "Delete clip",
            Self::AddLayer { .. } => "Add animation layer",
            Self::SetLayer { .. } => "Set animation layer",
            Self::MoveLayer { .. } => "Move animation layer",
            Self::DeleteLayer { .. } => "Delete animation layer",
            Self::Retime { .. } => "Retime clip",
            Self::SetRate { .. } => "Retime clip to frame rate",
            Self::Bake(_) => "Bake clip",
            Self::Reduce { .. } => "Reduce clip",
            Self::Adopt { .. } => "Adopt keys",
            Self::Keys { change, .. } => match change {
                KeyOperation::Pose { .. } | KeyOperation::Values { .. } | KeyOperation::Set(_) => "Set keys",
                KeyOperation::Move { .. } | KeyOperation::Place(_) => "Move keys",
                KeyOperation::Scale { .. } => "Scale keys",
                KeyOperation::Delete(_) => "Delete keys",
                KeyOperation::Paste { .. } => "Paste keys",
                KeyOperation::Mirror { .. } => "Mirror keys",
                KeyOperation::Ease { .. } => "Set interpolation",
                KeyOperation::Bake { .. } => "Bake keys",
                KeyOperation::Reduce { .. } => "Reduce keys",
                KeyOperation::Adopt { .. } => "Adopt keys",
            },
        }
    }
}

/// Runs a change of clips.
pub(super) fn run(draft: &mut Draft, operation: &ClipOperation) -> Result<(), OperationError> {
    match operation {
        ClipOperation::Create { name, frame_rate, range } => {
            let name = free_name(draft, None, name)?;
            let (uid, layer) = (draft.next_uid(), draft.next_uid());
            let clip = RigClip { frame_rate: *frame_rate, range: *range, ..RigClip::new(uid, layer, name) };
            Ok(draft.apply(RigEdit::AddClip(Box::new(clip), usize::MAX))?)
        }
        ClipOperation::Add(clip) => add_all(draft, std::slice::from_ref(&**clip)),
        ClipOperation::AddAll(clips) => add_all(draft, clips),
        ClipOperation::Rename(clip, name) => {
            let name = free_name(draft, Some(*clip), name)?.to_owned();
            let about = find(draft, *clip)?.about();
            set_about(draft, *clip, ClipAbout { name, ..about })
        }
        ClipOperation::About(clip, about) => {
            free_name(draft, Some(*clip), &about.name)?;
            set_about(draft, *clip, (**about).clone())
        }
        ClipOperation::Delete(clip) => Ok(draft.apply(RigEdit::RemoveClip(*clip))?),
        ClipOperation::AddLayer { clip, name, mode } => {
            let uid = draft.next_uid();
            let layer = Box::new(ClipLayer { name: name.clone(), mode: *mode, ..ClipLayer::empty(uid) });
            Ok(draft.apply(RigEdit::AddLayer { clip: *clip, layer, index: usize::MAX })?)
        }
        ClipOperation::SetLayer { clip, layer, about } => {
            if layer_of(draft, *clip, *layer)?.about() == **about {
                return Ok(());
            }
            Ok(draft.apply(RigEdit::SetLayer { clip: *clip, layer: *layer, about: about.clone() })?)
        }
        ClipOperation::MoveLayer { clip, layer, index } => {
            let moved = layer_of(draft, *clip, *layer)?.clone();
            draft.apply(RigEdit::RemoveLayer { clip: *clip, layer: *layer })?;
            Ok(draft.apply(RigEdit::AddLayer { clip: *clip, layer: Box::new(moved), index: *index })?)
        }
        ClipOperation::DeleteLayer { clip, layer } => {
            Ok(draft.apply(RigEdit::RemoveLayer { clip: *clip, layer: *layer })?)
        }
        ClipOperation::Retime { clip, from, to } => time::retime(draft, *clip, *from, *to),
        ClipOperation::SetRate { clip, rate } => time::set_rate(draft, *clip, *rate),
        ClipOperation::Bake(clip) => {
            let rate = find(draft, *clip)?.frame_rate;
            on_all_keys(draft, *clip, |targets| KeyOperation::Bake { targets, rate })
        }
        ClipOperation::Reduce { clip, tolerance } => {
            on_all_keys(draft, *clip, |targets| KeyOperation::Reduce { targets, tolerance: *tolerance })
        }
        ClipOperation::Adopt { clip, nodes } => {
            let layers: Vec<Uid> = find(draft, *clip)?.layers.iter().map(|layer| layer.uid).collect();
            for layer in layers {
                for [from, to] in nodes {
                    keys::run(draft, *clip, layer, &KeyOperation::Adopt { from: *from, to: *to })?;
                }
            }
            Ok(())
        }
        ClipOperation::Keys { clip, layer, change } => keys::run(draft, *clip, *layer, change),
    }
}

/// Changes the tracks of each layer of a clip.
fn on_all_keys(
    draft: &mut Draft,
    clip: Uid,
    change: impl Fn(Vec<TrackTarget>) -> KeyOperation,
) -> Result<(), OperationError> {
    let tracks = |layer: &ClipLayer| (layer.uid, layer.tracks.keys().cloned().collect());
    let layers: Vec<(Uid, Vec<TrackTarget>)> = find(draft, clip)?.layers.iter().map(tracks).collect();
    layers.into_iter().try_for_each(|(layer, targets)| keys::run(draft, clip, layer, &change(targets)))
}

fn add_all(draft: &mut Draft, clips: &[RigClip]) -> Result<(), OperationError> {
    let mut names: HashSet<String> = draft.rig().clips().iter().map(|clip| clip.name.clone()).collect();
    // Number to try next for each name, so that clips named alike need no search from 2 on.
    let mut numbers: HashMap<String, u64> = HashMap::new();
    for clip in clips {
        let mut clip = clip.clone();
        for uid in std::iter::once(&mut clip.uid).chain(clip.layers.iter_mut().map(|layer| &mut layer.uid)) {
            if draft.rig().is_taken(*uid) {
                *uid = draft.next_uid();
            }
        }
        let name = if clip.name.trim().is_empty() { "clip".to_owned() } else { clip.name.trim().to_owned() };
        clip.name.clone_from(&name);
        if names.contains(&name) {
            let number = numbers.entry(name.clone()).or_insert(2);
            while names.contains(&clip.name) {
                clip.name = format!("{name} {number}");
                *number += 1;
            }
        }
        names.insert(clip.name.clone());
        draft.apply(RigEdit::AddClip(Box::new(clip), usize::MAX))?;
    }
    Ok(())
}

fn set_about(draft: &mut Draft, clip: Uid, about: ClipAbout) -> Result<(), OperationError> {
    if find(draft, clip)?.about() == about {
        return Ok(());
    }
    Ok(draft.apply(RigEdit::SetClipAbout(clip, Box::new(about)))?)
}

/// A name without blanks around it, which no clip but `own` has.
fn free_name<'a>(draft: &Draft, own: Option<Uid>, name: &'a str) -> Result<&'a str, OperationError> {
    let name = name.trim();
    if name.is_empty() {
        return Err(OperationError::NoClipName);
    }
    if draft.rig().clips().iter().any(|clip| Some(clip.uid) != own && clip.name == name) {
        return Err(OperationError::ClipName(name.to_owned()));
    }
    Ok(name)
}

fn find<'a>(draft: &'a Draft, clip: Uid) -> Result<&'a RigClip, OperationError> {
    Ok(draft.rig().clip(clip).ok_or(EditError::NoClip(clip))?)
}

fn layer_of<'a>(draft: &'a Draft, clip: Uid, layer: Uid) -> Result<&'a ClipLayer, OperationError> {
    Ok(find(draft, clip)?.layer(layer).ok_or(EditError::NoLayer(clip, layer))?)
}
