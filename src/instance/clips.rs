//! Clips of files on instances.

use std::sync::Arc;

use bevy::{
    asset::{Asset, AssetLoader, LoadContext, io::Reader},
    prelude::*,
    reflect::TypePath,
};

use super::{BuiltTemplate, RunningTemplate};
use crate::{
    plugins::{
        animation::{ClipTargets, RigClips, animation_clip},
        runtime::RigRuntime,
    },
    rig::{
        BuiltRig, Rig, SourceError, Uid,
        animation::RigClip,
        format::animation::{BoundClips, ReadAnimation, read_animation},
    },
    solve::program::RigProgram,
};

/// Clips of a file as an asset, `.anim.ron`.
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
}

impl AssetLoader for RigAnimationLoader {
    type Asset = RigAnimation;
    type Settings = ();
    type Error = RigAnimationError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        (): &(),
        _: &mut LoadContext<'_>,
    ) -> Result<RigAnimation, Self::Error> {
        let mut content = Vec::new();
        reader.read_to_end(&mut content).await?;
        Ok(RigAnimation::read(&content)?)
    }

    fn extensions(&self) -> &[&str] {
        &["anim.ron"]
    }
}

/// Clips of a file on an instance: once both are there, its [`RigClips`] are those of the file, with the instance's own nodes,
/// and [`ClipsBound`] tells it; after a change of the file or the template again. An instance with [`ClipTargets`] gets
/// [`InstanceAnimations`], too. Taken off, it leaves the clips as they are.
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
    template: Arc<BuiltTemplate>,
    program: Arc<RigProgram>,
    has_animations: bool,
}

/// Gives instances the clips of their files.
pub(super) fn give_clips(
    instances: Query<(
        Entity,
        &InstanceClips,
        &RunningTemplate,
        &RigRuntime,
        Has<ClipTargets>,
        Option<&ClipSource>,
        Option<&InstanceAnimations>,
    )>,
    files: Res<Assets<RigAnimation>>,
    mut animations: Option<ResMut<Assets<AnimationClip>>>,
    mut commands: Commands,
) {
    for (entity, clips, template, runtime, is_target, source, known) in &instances {
        let Some(file) = files.get(&clips.0) else { continue };
        let (template, program) = (template.get(), runtime.state().program());
        let is_same = source.is_some_and(|source| {
            Arc::ptr_eq(&source.file, &file.0)
                && Arc::ptr_eq(&source.template, template)
                && Arc::ptr_eq(&source.program, program)
                && source.has_animations == is_target
        });
        if is_same {
            continue;
        }
        let bound = file.onto(&template.rig, Some(&template.built));
        if let Some(animations) = animations.as_mut().filter(|_| is_target) {
            let mut handles = Vec::with_capacity(bound.clips.len());
            for (number, clip) in bound.clips.iter().enumerate() {
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
        let source = ClipSource {
            file: file.0.clone(),
            template: template.clone(),
            program: program.clone(),
            has_animations: is_target,
        };
        commands.entity(entity).try_insert((RigClips(bound.clips.into()), source));
        commands.trigger(ClipsBound { entity, missing: bound.missing });
    }
}
