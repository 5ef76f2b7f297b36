//! Actions of the timeline, as keys, menus and the palette name them, and the reasons why they can do nothing at present.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    import::ClipImport,
    own_motion::own_file,
    state::{OpenClip, Timeline, has_any},
    switches,
};
use crate::{
    editor::{ActiveRig, actions::Action},
    plugins::document::{Selection, ShowRest},
    rig::Rig,
};

/// An action of the timeline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum TimelineAction {
    /// Plays the clip, or halts it.
    Play,
    /// Shows the next frame.
    NextFrame,
    /// Shows the frame before.
    PreviousFrame,
    /// Goes to the next key of the selected nodes, or of all.
    NextKey,
    /// Goes to the key before.
    PreviousKey,
    /// Goes to the start of the clip.
    Start,
    /// Goes to the end of the clip.
    End,
    /// Shows the whole clip.
    Fit,
    /// Plays the clip over and over, or once.
    Loop,
    /// Sets keys of the selected nodes as they are shown.
    Key,
    /// Sets keys of all controls as they are shown, or of all joints if there are none.
    KeyAll,
    /// Sets keys with each finished pose, or no longer.
    AutoKey,
    /// Adds a marker at the playhead.
    Marker,
    /// Selects all keys of the layer.
    SelectAll,
    /// Selects no key.
    SelectNone,
    /// Copies the selected keys.
    Copy,
    /// Inserts the copied keys at the playhead.
    Paste,
    /// Deletes the selected keys.
    Delete,
    /// Copies the selected keys to the other side, as their mirror image.
    Mirror,
    /// Makes the selected keys stepped.
    Stepped,
    /// Makes the selected keys linear.
    Linear,
    /// Makes the selected keys cubic.
    Cubic,
    /// Moves the selected keys to whole frames.
    Snap,
    /// Doubles the distances of the selected keys from the playhead.
    Slower,
    /// Halves the distances of the selected keys from the playhead.
    Faster,
    /// Turns the selected keys round about the playhead.
    Reverse,
    /// Makes a clip.
    NewClip,
    /// Makes a copy of the open clip.
    DuplicateClip,
    /// Deletes the open clip.
    DeleteClip,
    /// Asks for a file of motion and puts it onto the rig.
    Import,
    /// Puts the motion of the file that the mesh has come from onto the rig.
    ImportOwn,
    /// Adds a layer on top of the clip, which adds to those below.
    NewLayer,
    /// Replaces the keys of the tracks with selected keys by linear ones, one a frame.
    Bake,
    /// Replaces all keys of the clip by linear ones, one a frame.
    BakeClip,
    /// Removes what nobody would miss of the tracks with selected keys.
    Reduce,
    /// Removes what nobody would miss of all tracks of the clip.
    ReduceClip,
    /// Makes the clip take twice as long, with its keys and markers.
    Longer,
    /// Makes the clip take half as long, with its keys and markers.
    Shorter,
    /// Stretches keys and markers with the range and the frame rate of the clip when these are changed, or no longer.
    Stretch,
    /// Throws the switch of kinematics of the selected control over the selected keys, or the whole clip.
    SwitchKinematics,
    /// Gives the selected control its next space over the selected keys, or the whole clip.
    SwitchSpace,
}

impl TimelineAction {
    /// Every action.
    pub const ALL: [Self; 41] = [
        Self::Play,
        Self::NextFrame,
        Self::PreviousFrame,
        Self::NextKey,
        Self::PreviousKey,
        Self::Start,
        Self::End,
        Self::Fit,
        Self::Loop,
        Self::Key,
        Self::KeyAll,
        Self::AutoKey,
        Self::Marker,
        Self::SelectAll,
        Self::SelectNone,
        Self::Copy,
        Self::Paste,
        Self::Delete,
        Self::Mirror,
        Self::Stepped,
        Self::Linear,
        Self::Cubic,
        Self::Snap,
        Self::Slower,
        Self::Faster,
        Self::Reverse,
        Self::NewClip,
        Self::DuplicateClip,
        Self::DeleteClip,
        Self::Import,
        Self::ImportOwn,
        Self::NewLayer,
        Self::Bake,
        Self::BakeClip,
        Self::Reduce,
        Self::ReduceClip,
        Self::Longer,
        Self::Shorter,
        Self::Stretch,
        Self::SwitchKinematics,
        Self::SwitchSpace,
    ];

    /// Description in a few words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Play => "Play or pause the clip",
            Self::NextFrame => "Next frame",
            Self::PreviousFrame => "Previous frame",
            Self::NextKey => "Next key",
            Self::PreviousKey => "Previous key",
            Self::Start => "Start of the clip",
            Self::End => "End of the clip",
            Self::Fit => "Whole clip in the timeline",
            Self::Loop => "Loop the clip",
            Self::Key => "Key the selected controls",
            Self::KeyAll => "Key all controls",
            Self::AutoKey => "Auto-key",
            Self::Marker => "Add marker",
            Self::SelectAll => "Select all keys",
            Self::SelectNone => "Select no keys",
            Self::Copy => "Copy keys",
            Self::Paste => "Paste keys at the playhead",
            Self::Delete => "Delete keys",
            Self::Mirror => "Mirror keys",
            Self::Stepped => "Stepped keys",
            Self::Linear => "Linear keys",
            Self::Cubic => "Cubic keys",
            Self::Snap => "Snap keys to frames",
            Self::Slower => "Keys twice as slow",
            Self::Faster => "Keys twice as fast",
            Self::Reverse => "Reverse keys",
            Self::NewClip => "New clip",
            Self::DuplicateClip => "Duplicate clip",
            Self::DeleteClip => "Delete clip",
            Self::Import => "Import motion",
            Self::ImportOwn => "Import motion of the mesh's file",
            Self::NewLayer => "New animation layer",
            Self::Bake => "Bake tracks to frames",
            Self::BakeClip => "Bake the whole clip to frames",
            Self::Reduce => "Reduce keys of tracks",
            Self::ReduceClip => "Reduce keys of the whole clip",
            Self::Longer => "Clip twice as long",
            Self::Shorter => "Clip half as long",
            Self::Stretch => "Stretch keys with range and rate",
            Self::SwitchKinematics => "Switch IK and FK over range",
            Self::SwitchSpace => "Switch space over range",
        }
    }

    /// True for actions on the selected keys.
    fn is_of_keys(self) -> bool {
        matches!(
            self,
            Self::Copy
                | Self::Delete
                | Self::Mirror
                | Self::Stepped
                | Self::Linear
                | Self::Cubic
                | Self::Snap
                | Self::Slower
                | Self::Faster
                | Self::Reverse
                | Self::Bake
                | Self::Reduce
        )
    }
}

/// The action of a key while the pointer is over the timeline: what selects and deletes joints elsewhere selects and deletes
/// keys there.
pub fn over_timeline(action: Action) -> Action {
    match action {
        Action::Delete => Action::Timeline(TimelineAction::Delete),
        Action::SelectAll => Action::Timeline(TimelineAction::SelectAll),
        Action::SelectNone => Action::Timeline(TimelineAction::SelectNone),
        action => action,
    }
}

/// The reason why an action can do nothing at present, in a few words; `None` if it can.
pub fn obstacle(world: &World, action: TimelineAction) -> Option<&'static str> {
    let Some(active) = world.get_resource::<ActiveRig>() else { return Some("no rig is open") };
    let rig = world.get::<Rig>(active.0)?;
    let timeline = world.get_resource::<Timeline>()?;
    match action {
        // What is on can be turned off.
        TimelineAction::AutoKey => return (rig.is_empty() && !timeline.auto_key).then_some("there are no joints"),
        TimelineAction::Stretch => {
            return (rig.clips().is_empty() && !timeline.stretch).then_some("the rig has no clips");
        }
        TimelineAction::NewClip => return rig.is_empty().then_some("there are no joints"),
        TimelineAction::Import | TimelineAction::ImportOwn => {
            let is_busy = world.get_resource::<ClipImport>().is_some_and(|import| import.name().is_some());
            let is_own = action == TimelineAction::ImportOwn;
            return match (rig.is_empty(), is_busy) {
                (true, _) => Some("there are no joints"),
                (false, true) => Some("another file is being read"),
                (false, false) if is_own && own_file(world).is_none() => Some("the mesh has no file with motion"),
                (false, false) => None,
            };
        }
        _ => {}
    }
    if matches!(action, TimelineAction::Key | TimelineAction::KeyAll) && OpenClip::of(world).is_none() {
        // The key brings a clip with it.
        let is_selected = world.get::<Selection>(active.0).is_some_and(|selected| !selected.0.is_empty());
        return match action {
            _ if rig.is_empty() => Some("there are no joints"),
            _ if shows_rest(world, active.0) => Some("the rig is shown at rest: change to Select or Pose mode"),
            TimelineAction::Key if !is_selected => Some("nothing is selected"),
            _ => None,
        };
    }
    let Some(open) = OpenClip::of(world) else { return Some("no clip is open: choose or make one in the Timeline") };
    let has_keys = || open.clip.layers.iter().any(|layer| !layer.tracks.is_empty());
    match action {
        TimelineAction::NextKey | TimelineAction::PreviousKey => (!has_keys()).then_some("the clip has no keys"),
        TimelineAction::BakeClip | TimelineAction::ReduceClip => (!has_keys()).then_some("the clip has no keys"),
        TimelineAction::SwitchKinematics | TimelineAction::SwitchSpace => {
            switches::request(world, &open, action).err().map(switches::NoSwitch::text)
        }
        TimelineAction::Play | TimelineAction::Longer | TimelineAction::Shorter => {
            (open.clip.duration() <= 0.0).then_some("the clip has no length")
        }
        TimelineAction::Key | TimelineAction::KeyAll if shows_rest(world, open.entity) => {
            Some("the rig is shown at rest: change to Select or Pose mode")
        }
        TimelineAction::Key if open.layer.is_none() => Some("the clip has no layer"),
        TimelineAction::Key => {
            let selected = world.get::<Selection>(open.entity);
            selected.is_none_or(|selected| selected.0.is_empty()).then_some("nothing is selected")
        }
        TimelineAction::KeyAll => open.layer.is_none().then_some("the clip has no layer"),
        TimelineAction::Paste if open.layer.is_none() => Some("the clip has no layer"),
        TimelineAction::Paste => timeline.copied.is_none().then_some("no keys were copied"),
        TimelineAction::SelectNone => timeline.keys.is_empty().then_some("no key is selected"),
        TimelineAction::SelectAll => {
            open.layer.is_none_or(|layer| layer.tracks.is_empty()).then_some("the layer has no keys")
        }
        action if action.is_of_keys() => {
            let is_any = open.layer.is_some_and(|layer| has_any(layer, &timeline.keys));
            (!is_any).then_some("no key is selected")
        }
        _ => None,
    }
}

fn shows_rest(world: &World, rig: Entity) -> bool {
    world.get::<ShowRest>(rig).is_some_and(|rest| rest.0)
}
