//! Systems that play clips.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use bevy::{math::Vec4, prelude::*};

use super::{AutoKey, ClipPlayer, MarkerReached, RigClips, RootMotion};
use crate::{
    plugins::{
        document::{JointEntities, ShowRest},
        runtime::{ControlPose, InstanceMode, RigRuntime},
        schema::Attributes,
    },
    rig::{
        PoseOffset, RestTransform, Revision, Rig, Uid,
        animation::{ClipSampler, Property, RigClip, SampleCursor, TrackTarget},
    },
};

/// Most times that a clip ends in one frame.
const LAPS: usize = 16;

/// The clip that a player plays, compiled.
#[derive(Component, Debug, Default)]
pub struct PlayedClip {
    compiled: Option<CompiledClip>,
    /// Time up to which markers were told.
    told: Option<f32>,
    due: PendingWrite,
    /// Revision of the document that was followed last.
    revision: Option<Revision>,
    /// Properties that a clip has moved and moves no longer: they go back to the pose of the document.
    pub(super) released: BTreeSet<TrackTarget>,
    /// Properties that hold what a clip moved in another version of a rig without a document: they go back to rest.
    pub(super) unposed: Vec<TrackTarget>,
}

/// Nodes of a halted clip that the next frame writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
enum PendingWrite {
    /// None: what was posed on top of the clip stays.
    #[default]
    None,
    /// Nodes whose values in the clip have changed.
    Changed,
    /// All nodes of the clip.
    All,
}

#[derive(Debug)]
struct CompiledClip {
    clip: Arc<RigClip>,
    sampler: ClipSampler,
    cursor: SampleCursor,
    values: Vec<Vec4>,
    /// Values that were written last; `None` for those that never were.
    written: Vec<Option<Vec4>>,
    nodes: Vec<PlayedNode>,
}

/// Node with the places of its values.
#[derive(Debug)]
struct PlayedNode {
    uid: Uid,
    translation: Option<usize>,
    rotation: Option<usize>,
    scale: Option<usize>,
    attributes: Vec<(String, usize)>,
}

/// Compiles clips that are new or that were changed.
pub(super) fn compile(
    mut players: Query<(
        Ref<ClipPlayer>,
        &mut PlayedClip,
        Option<Ref<Rig>>,
        Option<Ref<RigClips>>,
        Option<Ref<ShowRest>>,
    )>,
) {
    for (player, mut played, rig, clips, rest) in &mut players {
        let is_new = rig.as_ref().is_some_and(Ref::is_changed) || clips.as_ref().is_some_and(Ref::is_changed);
        // A pose that is set on top of a halted clip stays until time goes on; other changes of the rig may bring nodes that
        // the clip has to move.
        let revision = rig.as_ref().map(|rig| rig.revision().clone());
        let is_other_rig = match (&played.revision, &revision) {
            (Some(known), Some(now)) => !known.is_same(now),
            (None, None) => false,
            _ => true,
        };
        if is_other_rig || player.is_changed() || rest.is_some_and(|rest| rest.is_changed()) {
            played.due = PendingWrite::All;
        }
        if is_other_rig {
            played.revision = revision;
        }
        let known = played.compiled.as_ref().map(|compiled| compiled.clip.uid);
        if known == Some(player.clip) && !is_new {
            continue;
        }
        let of_rig = rig.as_ref().and_then(|rig| rig.clip(player.clip));
        let given = || clips.as_ref().and_then(|clips| clips.0.iter().find(|clip| clip.uid == player.clip));
        let Some(clip) = of_rig.or_else(given) else {
            played.end();
            continue;
        };
        if played.compiled.as_ref().is_some_and(|compiled| *compiled.clip == *clip) {
            continue;
        }
        if known == Some(player.clip) {
            played.due = played.due.max(PendingWrite::Changed);
        } else {
            played.told = None;
            played.due = PendingWrite::All;
        }
        let mut next = CompiledClip::new(clip);
        if let Some(before) = played.compiled.take() {
            let written = before.sampler.targets().iter().zip(before.written);
            let mut written: BTreeMap<&TrackTarget, Option<Vec4>> = written.collect();
            for (target, place) in next.sampler.targets().iter().zip(&mut next.written) {
                *place = written.remove(target).flatten();
            }
            let gone = written.into_iter().filter(|(_, value)| value.is_some());
            let gone: Vec<TrackTarget> = gone.map(|(target, _)| target.clone()).collect();
            played.released.extend(gone);
        }
        for target in next.sampler.targets() {
            played.released.remove(target);
        }
        played.compiled = Some(next);
    }
}

impl PlayedClip {
    /// Takes back what the clip has moved, and offsets of nodes that hold what it shows, before the clip, which moves others now,
    /// is shown again.
    pub(crate) fn unpose(&mut self, nodes: &[Uid]) {
        let all = [Property::Translation, Property::Rotation, Property::Scale];
        let of_node = |node: &Uid| all.clone().map(|property| TrackTarget { node: *node, property });
        self.unposed = nodes.iter().flat_map(of_node).collect();
        if let Some(compiled) = &self.compiled {
            let written = compiled.sampler.targets().iter().zip(&compiled.written);
            let posed = written.filter(|(target, value)| value.is_some() && all.contains(&target.property));
            self.unposed.extend(posed.map(|(target, _)| target.clone()));
        }
        self.due = PendingWrite::All;
    }

    /// Ends the playback; what the clip has moved goes back to the pose of the document.
    pub(super) fn end(&mut self) {
        let Some(compiled) = self.compiled.take() else { return };
        self.told = None;
        let written = compiled.sampler.targets().iter().zip(&compiled.written).filter(|(_, value)| value.is_some());
        self.released.extend(written.map(|(target, _)| target.clone()));
    }
}

impl CompiledClip {
    fn new(clip: &RigClip) -> Self {
        let sampler = ClipSampler::new(clip);
        let mut nodes: BTreeMap<Uid, PlayedNode> = BTreeMap::new();
        for (place, TrackTarget { node, property }) in sampler.targets().iter().enumerate() {
            let none = || PlayedNode { uid: *node, translation: None, rotation: None, scale: None, attributes: vec![] };
            let played = nodes.entry(*node).or_insert_with(none);
            match property {
                Property::Translation => played.translation = Some(place),
                Property::Rotation => played.rotation = Some(place),
                Property::Scale => played.scale = Some(place),
                Property::Attribute(name) => played.attributes.push((name.clone(), place)),
            }
        }
        let (values, written) = (vec![Vec4::ZERO; sampler.targets().len()], vec![None; sampler.targets().len()]);
        let (cursor, nodes) = (sampler.cursor(), nodes.into_values().collect());
        Self { clip: Arc::new(clip.clone()), sampler, cursor, values, written, nodes }
    }
}

impl PlayedNode {
    /// Places of its values.
    fn places(&self) -> impl Iterator<Item = usize> {
        let own = [self.translation, self.rotation, self.scale].into_iter().flatten();
        own.chain(self.attributes.iter().map(|(_, place)| *place))
    }
}

/// Moves time on, tells markers, and writes the pose to the entities.
pub(super) fn play(
    mut players: Query<(
        Entity,
        &mut ClipPlayer,
        &mut PlayedClip,
        Option<&mut RootMotion>,
        Option<&mut RigRuntime>,
        Option<&Rig>,
        Option<&JointEntities>,
        Option<&ShowRest>,
    )>,
    mut transforms: Query<&mut Transform>,
    mut poses: Query<&mut ControlPose>,
    mut attributes: Query<&mut Attributes>,
    time: Res<Time>,
    mut commands: Commands,
) {
    for (entity, mut player, mut played, mut motion, mut runtime, rig, joints, rest) in &mut players {
        let PlayedClip { compiled, told, due, .. } = played.bypass_change_detection();
        if let Some(motion) = &mut motion
            && motion.delta != Transform::IDENTITY
        {
            motion.delta = Transform::IDENTITY;
        }
        let Some(compiled) = compiled else { continue };
        let clip = Arc::clone(&compiled.clip);
        if player.playing {
            let from = player.time;
            let spans = advance(&mut player, &clip, time.delta_secs());
            if told.is_none() {
                tell(entity, &clip, &Span { from, to: from, is_whole: true }, &mut commands);
            }
            for span in &spans {
                tell(entity, &clip, span, &mut commands);
                let Some(motion) = &mut motion else { continue };
                let Some(base) = base_of(motion.node, runtime.as_deref(), rig) else { continue };
                let step = travelled(&clip, motion.node, &base, span.from).inverse()
                    * travelled(&clip, motion.node, &base, span.to);
                motion.delta = Transform::from_isometry(motion.delta.to_isometry() * step);
            }
            *told = Some(player.time);
            *due = PendingWrite::All;
        }
        let due = std::mem::take(due);
        if due == PendingWrite::None {
            continue;
        }
        // A rig that is shown at rest waits for its pose.
        if rest.is_some_and(|rest| rest.0) {
            continue;
        }
        let CompiledClip { sampler, cursor, values, written, nodes, .. } = compiled;
        sampler.sample(player.time, cursor, values);
        let held = motion.as_ref().map(|motion| motion.node);
        for node in nodes.iter() {
            if due == PendingWrite::Changed && node.places().all(|at| written[at] == Some(values[at])) {
                continue;
            }
            let Some(place) = NodePlace::of(node.uid, runtime.as_deref(), rig, joints) else { continue };
            node.places().for_each(|at| written[at] = Some(values[at]));
            let mut offset = place.offset;
            let vector = |at: usize| values[at].truncate();
            offset.translation = node.translation.map_or(offset.translation, vector);
            offset.rotation = node.rotation.map_or(offset.rotation, |at| Quat::from_vec4(values[at]));
            offset.scale = node.scale.map_or(offset.scale, vector);
            if held == Some(node.uid) {
                let start = clip_offset(&clip, node.uid, clip.range[0]);
                (offset.translation, offset.rotation) = (start.translation, start.rotation);
            }
            let is_posed = node.translation.is_some() || node.rotation.is_some() || node.scale.is_some();
            if is_posed && place.is_posable {
                if place.is_direct {
                    if let Ok(mut pose) = poses.get_mut(place.entity) {
                        pose.set_if_neq(offset.into());
                    }
                } else if let Ok(mut transform) = transforms.get_mut(place.entity) {
                    transform.set_if_neq(offset.on(&place.base));
                }
            }
            if node.attributes.is_empty() {
                continue;
            }
            if let Ok(mut told) = attributes.get_mut(place.entity) {
                for (name, at) in &node.attributes {
                    let value = values[*at].x;
                    if told.0.get(name).is_some_and(|known| *known != value) {
                        told.0.insert(name.clone(), value);
                    }
                }
            } else if let Some(runtime) = &mut runtime {
                // Entities of instances without a document hold no attributes.
                let state = runtime.bypass_change_detection().state_mut();
                for (name, at) in &node.attributes {
                    if let Some(slot) = state.program().attribute(node.uid, name) {
                        state.set_attribute_at(slot, values[*at].x);
                    }
                }
            }
        }
    }
}

/// Entity of a node, with what its pose is told by.
pub(super) struct NodePlace {
    pub entity: Entity,
    pub base: RestTransform,
    pub offset: PoseOffset,
    pub is_direct: bool,
    pub is_posable: bool,
}

impl NodePlace {
    pub fn of(
        node: Uid,
        runtime: Option<&RigRuntime>,
        rig: Option<&Rig>,
        joints: Option<&JointEntities>,
    ) -> Option<Self> {
        if let Some(runtime) = runtime {
            let slot = runtime.state().program().node(node)?;
            let found = &runtime.state().program().nodes()[slot];
            return Some(Self {
                entity: runtime.entity(slot)?,
                base: rest_of(&found.base),
                offset: runtime.state().offset_at(slot),
                is_direct: runtime.mode() == InstanceMode::Direct,
                is_posable: found.is_posable(),
            });
        }
        let rig = rig?;
        Some(Self {
            entity: joints?.get(node)?,
            base: rig.joint(node)?.data.rest,
            offset: rig.offset(node).copied().unwrap_or_default(),
            is_direct: false,
            is_posable: true,
        })
    }
}

pub(super) fn rest_of(base: &crate::mesh::model::Trs) -> RestTransform {
    RestTransform { translation: base.translation, rotation: base.rotation, scale: base.scale }
}

fn base_of(node: Uid, runtime: Option<&RigRuntime>, rig: Option<&Rig>) -> Option<RestTransform> {
    match runtime {
        Some(runtime) => {
            let program = runtime.state().program();
            Some(rest_of(&program.nodes()[program.node(node)?].base))
        }
        None => Some(rig?.joint(node)?.data.rest),
    }
}

fn clip_offset(clip: &RigClip, node: Uid, time: f32) -> PoseOffset {
    let value = |property: Property| {
        let target = TrackTarget { node, property };
        clip.value(&target, time).unwrap_or_else(|| target.property.rest())
    };
    let [x, y, z, _] = value(Property::Translation);
    PoseOffset {
        translation: Vec3::new(x, y, z),
        rotation: Quat::from_array(value(Property::Rotation)),
        ..PoseOffset::IDENTITY
    }
}

/// Way of a node from the start of a clip to a time, in its parent's space.
fn travelled(clip: &RigClip, node: Uid, base: &RestTransform, time: f32) -> Isometry3d {
    let at = |time: f32| {
        let posed = clip_offset(clip, node, time).on(base);
        Isometry3d::new(posed.translation, posed.rotation)
    };
    at(time) * at(clip.range[0]).inverse()
}

/// Span of a clip that playback passed.
struct Span {
    from: f32,
    to: f32,
    /// True if the span contains the moment at which it begins.
    is_whole: bool,
}

/// Moves a player's time on; returns the spans of the clip that it passed.
fn advance(player: &mut ClipPlayer, clip: &RigClip, seconds: f32) -> Vec<Span> {
    let [start, end] = clip.range;
    let mut left = seconds * player.speed;
    if !left.is_finite() || left == 0.0 {
        return Vec::new();
    }
    let mut spans = Vec::new();
    let mut from = player.time.clamp(start, end);
    let (limit, begin) = if left > 0.0 { (end, start) } else { (start, end) };
    for lap in 0..LAPS {
        let (room, is_whole) = (limit - from, lap > 0);
        if left.abs() < room.abs() {
            player.time = from + left;
            spans.push(Span { from, to: player.time, is_whole });
            return spans;
        }
        spans.push(Span { from, to: limit, is_whole });
        if !player.looped || end <= start {
            player.time = limit;
            player.playing = false;
            return spans;
        }
        left -= room;
        from = begin;
    }
    // So many laps in one frame are as good as none.
    player.time = begin + left % (end - start);
    spans
}

/// Tells the markers of a span.
fn tell(entity: Entity, clip: &RigClip, span: &Span, commands: &mut Commands) {
    let (low, high) = (span.from.min(span.to), span.from.max(span.to));
    let is_in = |time: f32| (low..=high).contains(&time) && (span.is_whole || time != span.from);
    let mut reached: Vec<_> = clip.markers.iter().filter(|marker| is_in(marker.time)).collect();
    if span.to < span.from {
        reached.reverse();
    }
    for marker in reached {
        let (clip, name, time) = (clip.uid, marker.name.clone(), marker.time);
        commands.trigger(MarkerReached { entity, clip, name, time });
    }
}

/// Keeps the time at which poses set keys with the player of the same clip.
pub(super) fn follow_player(mut rigs: Query<(&ClipPlayer, &mut AutoKey), Changed<ClipPlayer>>) {
    for (player, mut auto_key) in &mut rigs {
        if player.clip == auto_key.clip && player.time != auto_key.time {
            auto_key.time = player.time;
        }
    }
}
