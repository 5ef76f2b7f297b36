//! Clips in an app: playback on rigs, keys set with each pose, and clips for Bevy's own animation.
//!
//! A [`ClipPlayer`] beside a rig samples one of its clips each frame and writes the pose to the entities of the rig's nodes,
//! before the rig is evaluated: `Transform` or [`ControlPose`](super::runtime::ControlPose), and
//! [`Attributes`](super::schema::Attributes). The document stays as it is. A game that has an `AnimationGraph` of its own
//! takes [`animation_clip`] instead, and blends and masks with Bevy.

mod graph;
mod play;
mod release;

use std::{borrow::Cow, sync::Arc};

use bevy::{app::AnimationSystems, prelude::*};

pub use graph::{AttributeProperty, ClipTargets, animation_clip, target_id};
pub(crate) use play::PlayedClip;

use super::{RigSystems, configure_sets};
use crate::rig::{RigEdit, Uid, animation::RigClip, operations::Operation};

/// Plugin that plays clips on rigs.
pub struct ClipPlugin;

impl Plugin for ClipPlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.add_message::<EndPlayback>().add_systems(Update, graph::name_targets.after(RigSystems::Build)).add_systems(
            PostUpdate,
            (release::end_playback, play::compile, release::release, play::play, play::follow_player)
                .chain()
                .in_set(ClipSystems)
                .after(AnimationSystems)
                .before(RigSystems::Solve),
        );
    }
}

/// Systems that play clips in `PostUpdate`, between Bevy's animation and [`RigSystems::Solve`].
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
pub struct ClipSystems;

/// Playback of a clip on a rig. A clip that is halted poses the rig when its time or its keys change: what is posed on top of it
/// in between stays. Nodes that a clip moves no longer go back to the pose of the document.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component)]
#[require(PlayedClip)]
pub struct ClipPlayer {
    /// The clip, of the rig's document or of [`RigClips`].
    pub clip: Uid,
    /// Second in the clip.
    pub time: f32,
    /// Rate of playback: 1 is as recorded, a negative one plays backwards.
    pub speed: f32,
    /// True to begin again at the end. Otherwise the clip stops there.
    pub looped: bool,
    /// True while time goes on. A clip that is halted still shows a changed `time`.
    pub playing: bool,
}

impl ClipPlayer {
    /// Playback of a clip from its start, as it says itself.
    pub fn new(clip: &RigClip) -> Self {
        Self { clip: clip.uid, time: clip.range[0], speed: 1.0, looped: clip.looped, playing: true }
    }
}

/// Request to end the playback of a rig: its [`ClipPlayer`] is taken off, and the nodes that the clip moved show the pose of the
/// document again.
#[derive(Message, Debug, Clone, Copy, PartialEq, Eq)]
pub struct EndPlayback {
    /// The rig.
    pub rig: Entity,
}

/// Clips of a rig without a document.
#[derive(Component, Reflect, Debug, Clone, PartialEq, Default)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
pub struct RigClips(pub Arc<[RigClip]>);

/// Event that playback passed a marker of a clip.
#[derive(EntityEvent, Debug, Clone, PartialEq)]
pub struct MarkerReached {
    /// The rig.
    pub entity: Entity,
    /// The clip.
    pub clip: Uid,
    /// Name of the marker.
    pub name: String,
    /// Second of the marker.
    pub time: f32,
}

/// Root motion: movement of one node that is handed to the game in place of the pose. The node stands where it stands at the
/// start of the clip, and the game multiplies the rig's `Transform` by `delta` after each frame.
///
/// Motion of another skeleton that was put onto joints (`MotionTarget::Joints`, `rigsmith animate --onto joints`) has all of its
/// travel on the hips, which are the node to give. Motion on controls suits where one control carries all others and has all of the
/// travel, as with `RetargetSettings::root_motion` and `rigsmith animate --root-motion`; goals that have keys of their own in the
/// rig's space would stay behind otherwise. Bevy's own animation of
/// [`animation_clip`] hands no motion over: there the node moves, or a mask leaves it out and the game moves the rig itself, by
/// the way of the node in [`RigClip::value`](crate::rig::animation::RigClip::value).
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component)]
pub struct RootMotion {
    /// The node, whose parents the clip does not move.
    pub node: Uid,
    /// Movement of the last frame: what the transform of the rig is multiplied by.
    pub delta: Transform,
}

impl RootMotion {
    /// Root motion of a node.
    pub fn of(node: Uid) -> Self {
        Self { node, delta: Transform::IDENTITY }
    }
}

/// Keys that are set with each pose that is committed, in the same step of the history. On the entity of a rig.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component)]
pub struct AutoKey {
    /// True to set keys.
    pub on: bool,
    /// The clip.
    pub clip: Uid,
    /// The layer; `None` for the topmost one.
    pub layer: Option<Uid>,
    /// Second of the keys. It follows a [`ClipPlayer`] of the same clip.
    pub time: f32,
}

impl AutoKey {
    /// An operation that sets keys as well, if it poses.
    pub(super) fn keyed<'a>(&self, operation: &'a Operation) -> Cow<'a, Operation> {
        let is_pose = |edit: &RigEdit| matches!(edit, RigEdit::SetOffset(..) | RigEdit::SetAttributeValue(..));
        let poses = match operation {
            Operation::Pose(_) | Operation::SetPose { .. } => true,
            Operation::ResetPose(_) | Operation::ApplyPose(_) => true,
            Operation::Edits(edits) | Operation::Named { edits, .. } => !edits.is_empty() && edits.iter().all(is_pose),
            _ => false,
        };
        if !self.on || !poses {
            return Cow::Borrowed(operation);
        }
        let operation = Box::new(operation.clone());
        Cow::Owned(Operation::Keyed { operation, clip: self.clip, layer: self.layer, time: self.time })
    }
}
