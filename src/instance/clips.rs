//! Clips of files on instances.

use std::sync::{Arc, Weak};

use bevy::{
    asset::{Asset, AssetId, AssetLoader, LoadContext, io::Reader},
    prelude::*,
    reflect::TypePath,
};

use super::{BuiltTemplate, RigInstance, RigTemplate, RunningTemplate, clip_updates::ClipOrigin};
use crate::{
    plugins::{
        animation::{ClipTargets, RigClips, animation_clip},
        runtime::RigRuntime,
    },
    rig::{
        BuiltRig, Rig, SourceError, Uid,
        animation::{NodeNames, RigClip},
        format::animation::{BoundClips, ReadAnimation, read_animation},
    },
    solve::{
        packed_clip::{PackedClipError, PackedSkeleton},
        program::RigProgram,
    },
};

/// Clips of a file as an asset: `.anim.ron`, or packed ones (`.rigclip`), which have keys on joints.
#[derive(Asset, TypePath, Debug, Clone)]
pub struct RigAnimation(Arc<ReadAnimation>);

impl RigAnimation {
    /// Clips that a text holds.
    ///
    /// # Errors
    /// See [`read_animation`].
    pub fn read(content: &[u8]) -> Result<Self, SourceError> {
        Ok(Self(Arc::new(read_animation(content)?)))
    }

    /// Clips of packed ones; `name` is for their identities, and files on one instance have names of their own.
    ///
    /// # Errors
    /// See [`PackedSkeleton::from_bytes`].
    pub fn unpack(content: &[u8], name: &str) -> Result<Self, PackedClipError> {
        Ok(Self(Arc::new(PackedSkeleton::from_bytes(content)?.animation(name))))
    }

    /// Clips as the file has them.
    pub fn clips(&self) -> &[RigClip] {
        &self.0.clips
    }

    /// The clips on a rig, and nodes that it lacks: see [`ReadAnimation::onto`].
    pub fn onto(&self, rig: &Rig, built: Option<&BuiltRig>) -> BoundClips {
        self.0.onto(rig, built)
    }
}

/// Reader of clips for Bevy's asset server.
#[derive(Debug, Clone, Copy, Default, TypePath)]
pub struct RigAnimationLoader;

/// Reason for not loading clips.
#[derive(Debug, thiserror::Error)]
pub enum RigAnimationError {
    /// The source of assets cannot be read.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// The file has no clips that can be read.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// The file has no packed clips that can be read.
    #[error(transparent)]
    Packed(#[from] PackedClipError),
}

impl AssetLoader for RigAnimationLoader {
    type Asset = RigAnimation;
    type Settings = ();
    type Error = RigAnimationError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        (): &(),
        context: &mut LoadContext<'_>,
    ) -> Result<RigAnimation, Self::Error> {
        let mut content = Vec::new();
        reader.read_to_end(&mut content).await?;
        if PackedSkeleton::may_begin_with(&content) {
            return Ok(RigAnimation::unpack(&content, &context.path().to_string())?);
        }
        Ok(RigAnimation::read(&content)?)
    }

    fn extensions(&self) -> &[&str] {
        &["anim.ron", "rigclip"]
    }
}

/// Clips of a file on an instance: once both are there, its [`RigClips`] are those of the file, with the instance's own nodes,
/// and [`ClipsBound`] tells it; after a change of the file or the template again. A changed template does not change the motion: the
/// clips are re-expressed for it, and those of the file are for the version with which they came. An instance with
/// [`ClipTargets`] gets [`InstanceAnimations`], too. Taken off, it leaves the clips as they are.
#[derive(Component, Reflect, Debug, Clone, PartialEq, Eq)]
#[reflect(Component)]
pub struct InstanceClips(pub Handle<RigAnimation>);

/// Clips of an instance for Bevy's own animation, in the order of its [`RigClips`]. Handles stay the same when the file or the
/// template changes.
#[derive(Component, Reflect, Debug, Clone, Default, PartialEq, Eq)]
#[reflect(Component)]
pub struct InstanceAnimations(pub Vec<Handle<AnimationClip>>);

/// The clips of a file are on an instance.
#[derive(EntityEvent, Debug, Clone)]
pub struct ClipsBound {
    /// The instance.
    pub entity: Entity,
    /// Nodes of the file that the instance lacks; their keys have no effect.
    pub missing: Vec<Uid>,
}

/// Sources of an instance's clips.
#[derive(Component)]
pub(super) struct ClipSource {
    file: Arc<ReadAnimation>,
    id: AssetId<RigTemplate>,
    template: Arc<BuiltTemplate>,
    program: Arc<RigProgram>,
    has_animations: bool,
}

/// Clips on the nodes of a version of a template, which instances share.
pub(super) struct Binding {
    /// Clips that went through an earlier version; `None` for those of the file.
    earlier: Option<Weak<[RigClip]>>,
    file: Weak<ReadAnimation>,
    template: Weak<BuiltTemplate>,
    clips: Weak<[RigClip]>,
    missing: Vec<Uid>,
}

impl Binding {
    fn is_of(
        &self,
        file: &Arc<ReadAnimation>,
        template: &Arc<BuiltTemplate>,
        earlier: Option<&Arc<[RigClip]>>,
    ) -> bool {
        let is_same = match (&self.earlier, earlier) {
            (Some(known), Some(earlier)) => std::ptr::addr_eq(known.as_ptr(), Arc::as_ptr(earlier)),
            (None, None) => true,
            _ => false,
        };
        is_same && self.file.as_ptr() == Arc::as_ptr(file) && self.template.as_ptr() == Arc::as_ptr(template)
    }
}

/// The clips of a file on a version of a template. Those that an instance has from it already, for an earlier version, go on:
/// nodes that came back under another uid get the keys that wait for them.
fn bound(
    file: &Arc<ReadAnimation>,
    template: &Arc<BuiltTemplate>,
    earlier: Option<(&ClipSource, &Arc<[RigClip]>)>,
    known: &mut Vec<Binding>,
) -> (Arc<[RigClip]>, Vec<Uid>) {
    let own = earlier.map(|(_, clips)| clips);
    let found = known.iter().find(|known| known.is_of(file, template, own));
    if let Some((clips, missing)) = found.and_then(|known| Some((known.clips.upgrade()?, known.missing.clone()))) {
        return (clips, missing);
    }
    let bound = match earlier {
        None => file.onto(&template.rig, Some(&template.built)),
        Some((source, clips)) => {
            let mut names = file.names.clone();
            names.extend(&NodeNames::of(&source.template.rig, Some(&source.template.built)));
            let read = ReadAnimation { clips: clips.to_vec(), names, ..ReadAnimation::default() };
            read.onto(&template.rig, Some(&template.built))
        }
    };
    let clips = match own.filter(|own| own[..] == bound.clips[..]) {
        Some(own) => own.clone(),
        None => bound.clips.into(),
    };
    known.push(Binding {
        earlier: own.map(Arc::downgrade),
        file: Arc::downgrade(file),
        template: Arc::downgrade(template),
        clips: Arc::downgrade(&clips),
        missing: bound.missing.clone(),
    });
    (clips, bound.missing)
}

/// Gives instances the clips of their files.
pub(super) fn give_clips(
    mut instances: Query<(
        Entity,
        (&InstanceClips, &RigInstance, &RunningTemplate, &RigRuntime),
        Has<ClipTargets>,
        Option<&ClipSource>,
        Option<&RigClips>,
        Option<&mut ClipOrigin>,
        Option<&InstanceAnimations>,
    )>,
    files: Res<Assets<RigAnimation>>,
    mut animations: Option<ResMut<Assets<AnimationClip>>>,
    mut bindings: Local<Vec<Binding>>,
    mut commands: Commands,
) {
    bindings.retain(|known| known.clips.strong_count() > 0);
    for (entity, (clips, instance, template, runtime), is_target, source, own, origin, known) in &mut instances {
        let Some(RigAnimation(file)) = files.get(&clips.0) else { continue };
        let (id, template, program) = (instance.0.id(), template.get(), runtime.state().program());
        let is_same = source.is_some_and(|source| {
            Arc::ptr_eq(&source.file, file)
                && Arc::ptr_eq(&source.template, template)
                && Arc::ptr_eq(&source.program, program)
                && source.has_animations == is_target
        });
        if is_same {
            continue;
        }
        let is_going_on = |source: &&ClipSource| Arc::ptr_eq(&source.file, file) && source.id == id;
        let earlier = source.filter(is_going_on).zip(own.map(|own| &own.0));
        let (bound, missing) = bound(file, template, earlier, &mut bindings);
        if let Some(animations) = animations.as_mut().filter(|_| is_target) {
            let mut handles = Vec::with_capacity(bound.len());
            for (number, clip) in bound.iter().enumerate() {
                let made = animation_clip(clip, program, runtime.mode());
                match known.and_then(|known| known.0.get(number)) {
                    Some(handle) => {
                        // A handle that lives has a place.
                        let _ = animations.insert(handle.id(), made);
                        handles.push(handle.clone());
                    }
                    None => handles.push(animations.add(made)),
                }
            }
            commands.entity(entity).try_insert(InstanceAnimations(handles));
        }
        let is_other = own.is_none_or(|own| !Arc::ptr_eq(&own.0, &bound));
        if let (Some(mut origin), Some(own)) = (origin, own)
            && earlier.is_some()
            && is_other
            && Arc::ptr_eq(&origin.shown, &own.0)
        {
            origin.shown = bound.clone();
        }
        if is_other {
            commands.entity(entity).try_insert(RigClips(bound));
        }
        let source = ClipSource {
            file: file.clone(),
            id,
            template: template.clone(),
            program: program.clone(),
            has_animations: is_target,
        };
        commands.entity(entity).try_insert(source);
        commands.trigger(ClipsBound { entity, missing });
    }
}
