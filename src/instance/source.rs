//! Rigs with documents of their own, which follow their templates by three-way updates.

use std::{path::Path, sync::Arc};

use bevy::{
    ecs::{entity::EntityHashSet, message::MessageId},
    prelude::*,
};

use super::{
    BuiltTemplate, RigBuilt, RigFailed, RigTemplate, RigTemplates, RigUpdated, TemplateError,
    template_file::BaseVersion,
};
use crate::{
    files::{DocumentBase, TemplateBase},
    plugins::{
        commands::{BuildFailure, BuildRequest, BuildResult, BuildStep, RigModules},
        document::{Change, EditRefusal, EditReport, EditRequest},
        skinning::BindRequest,
        surface::{RigMesh, RigMeshes},
    },
    processor::{ClipReport, PoseNote, keep_clips, keep_poses},
    rig::{
        Rig,
        operations::Operation,
        step::{Commit, Step},
        update::{Change as Difference, Choices, Take, Update, clip_edits, edits_between, pose_edits, update_with},
        version::VersionChange,
    },
};

/// Name of the step that an update is in the history.
pub const UPDATE: &str = "Update from template";

/// Makes an entity a rig of a template with a document of its own, which people may edit, and which meshes are bound to.
///
/// An entity without a [`Rig`] gets the template's, built; meshes of it without weights are bound. When the template changes,
/// the base (the version accepted last), the rig as it is now and the template are compared: what the template changed is
/// taken over, what was changed or added here stays. A `live` rig takes it over at once, as one step of its history, unless
/// both changed the same field to different values; such an update, and every one of a rig that is not live, is an
/// [`UpdateOffer`] until an [`AcceptUpdate`]. Undoing the step brings the base back, and nothing more is taken over until the
/// file changes again. An update that cannot be built is taken back and told ([`RigFailed`]).
#[derive(Component, Reflect, Debug, Clone)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
#[require(Transform)]
pub struct RigSource {
    /// The template.
    pub template: Handle<RigTemplate>,
    /// Takes updates over at once.
    pub is_live: bool,
    base: Option<BaseVersion>,
    /// True if the rig has come from the first version that is seen.
    is_first: bool,
    /// True if meshes without weights stay so.
    is_unbound: bool,
    /// The template that was compared last.
    seen: Option<Arc<BuiltTemplate>>,
    /// An update that was requested.
    pending: Option<RequestedUpdate>,
    /// An update that was made in this frame.
    trial: Option<Arc<BuiltTemplate>>,
    /// Poses and motion that could not be kept in the update that was requested.
    notes: UpdateNotes,
    /// True if the build had failed before the update.
    had_failed: bool,
    steps: Vec<AcceptedUpdate>,
}

/// Update that was requested, and the base that it brings.
#[derive(Debug, Clone)]
struct RequestedUpdate {
    request: MessageId<EditRequest>,
    built: Arc<BuiltTemplate>,
    base: BaseVersion,
}

/// Poses and motion that an update cannot keep.
#[derive(Debug, Clone, Default)]
struct UpdateNotes {
    poses: Arc<[PoseNote]>,
    clips: Arc<ClipReport>,
}

/// Step of an update, with the bases before and after it.
#[derive(Debug, Clone)]
struct AcceptedUpdate {
    step: Arc<Step>,
    before: Option<BaseVersion>,
    after: BaseVersion,
}

impl RigSource {
    /// A rig that is asked before it is updated.
    pub fn new(template: Handle<RigTemplate>) -> Self {
        Self {
            template,
            is_live: false,
            base: None,
            is_first: false,
            is_unbound: false,
            seen: None,
            pending: None,
            trial: None,
            notes: UpdateNotes::default(),
            had_failed: false,
            steps: Vec::new(),
        }
    }

    /// A rig that takes updates over at once.
    pub fn live(template: Handle<RigTemplate>) -> Self {
        Self { is_live: true, ..Self::new(template) }
    }

    /// The rig has come from this version of the template.
    pub fn with_base(mut self, base: Arc<Rig>) -> Self {
        self.base = Some(BaseVersion { rig: base, file: None });
        self
    }

    /// The rig has come from this version of the template in a file, as a project keeps it.
    pub fn with_kept_base(mut self, base: &TemplateBase, file: &Path) -> Self {
        self.base = Some(BaseVersion::kept(base, file));
        self
    }

    /// The rig has come from the template as it is when it is seen first.
    pub fn of_first_version(mut self) -> Self {
        self.is_first = true;
        self
    }

    /// Meshes without weights are left alone.
    pub fn without_binding(mut self) -> Self {
        self.is_unbound = true;
        self
    }

    /// The update of this request; any other one stays.
    fn take_requested(&mut self, request: Option<MessageId<EditRequest>>) -> Option<RequestedUpdate> {
        self.pending.take_if(|update| Some(update.request) == request)
    }

    /// The template as it was built last.
    pub(super) fn built(&self) -> Option<&Arc<BuiltTemplate>> {
        self.seen.as_ref()
    }

    /// Takes note that the template was saved from the rig, as it was then.
    pub fn rebase(&mut self, saved: Arc<Rig>) {
        // The file has the same part instances as before.
        let file = self.base.take().and_then(|base| base.file);
        self.base = Some(BaseVersion { rig: saved, file });
    }

    /// The version of the template that was accepted last; `None` until it is loaded, or if nobody knows.
    pub fn base(&self) -> Option<&Arc<Rig>> {
        self.base.as_ref().map(|base| &base.rig)
    }

    /// The version of the template that was accepted last, as a project keeps it.
    pub fn base_to_keep(&self) -> Option<TemplateBase> {
        self.base.as_ref().map(BaseVersion::to_keep)
    }

    /// The version of the template that was accepted last, for a save over its file: with the uids that its part instances have
    /// in the rig, as a uid that the file leaves out may be another one there.
    pub fn taken_over(&self) -> DocumentBase<'_> {
        let parts = self.base.as_ref().map_or(&[][..], BaseVersion::parts);
        DocumentBase { rig: self.base.as_ref().map(|base| &*base.rig), parts }
    }

    /// True if the built template has been compared with the rig.
    #[cfg(feature = "remote")]
    pub(crate) fn has_seen(&self, built: &Arc<BuiltTemplate>) -> bool {
        self.seen.as_ref().is_some_and(|seen| Arc::ptr_eq(seen, built))
    }

    /// Changes that an update of the rig to a template would make.
    #[cfg(feature = "remote")]
    pub(crate) fn changes_to(&self, rig: &Rig, template: &RigTemplate, choices: &Choices) -> Vec<Difference> {
        let (base, file) = (self.base.as_ref(), super::template_file::TemplateFile::of(template.clone()));
        let of_parts = base.and_then(|base| base.update_of_parts(rig, &file, choices));
        let whole = || update_with(base.map(|base| &*base.rig), rig, template.rig(), choices);
        of_parts.map_or_else(whole, |(update, _)| update).changes
    }

    /// True if no update is under way.
    #[cfg(feature = "remote")]
    pub(crate) fn is_settled(&self) -> bool {
        self.pending.is_none() && self.trial.is_none()
    }
}

/// An update that waits for an [`AcceptUpdate`].
#[derive(Component, Reflect, Debug, Clone)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
pub struct UpdateOffer {
    /// Changes that it would make; conflicts have the value now and that of the template.
    pub changes: Arc<[Difference]>,
    /// Joints that would not stand as before in a pose, although nothing but the meaning of the pose changes.
    pub poses: Arc<[PoseNote]>,
    /// Motion that the clips could not keep, and keys that would be set aside with their nodes.
    pub clips: Arc<ClipReport>,
    /// Version that the rig comes from and that of the template, if they say different ones.
    pub version: Option<VersionChange>,
    built: Arc<BuiltTemplate>,
}

/// Accepts the [`UpdateOffer`] of a rig.
#[derive(Message, Debug, Clone)]
pub struct AcceptUpdate {
    /// The rig.
    pub rig: Entity,
    /// Choices in conflicts; a [`Take`] becomes one for all.
    pub choices: Choices,
}

pub(super) fn add(app: &mut App) {
    app.add_message::<AcceptUpdate>()
        .add_message::<EditReport>()
        .add_message::<EditRefusal>()
        .add_message::<EditRequest>()
        .add_message::<BuildRequest>()
        .add_message::<BindRequest>();
}

/// Follows updates through the history: the base is that of the last one in effect.
pub(super) fn follow_steps(
    mut edited: MessageReader<EditReport>,
    mut refused: MessageReader<EditRefusal>,
    mut sources: Query<&mut RigSource>,
    mut commands: Commands,
) {
    for EditReport { rig, request, committed, .. } in edited.read() {
        let (Ok(mut source), Some(committed)) = (sources.get_mut(*rig), committed) else { continue };
        let known = source.steps.iter().find(|known| Arc::ptr_eq(&known.step, committed.step())).cloned();
        match (committed, known) {
            (Commit::Done(step), _) => {
                let own = source.bypass_change_detection().take_requested(*request);
                let Some(update) = own else { continue };
                let (built, after) = (update.built, update.base);
                let before = source.base.take();
                source.base = Some(after.clone());
                // Steps that the history dropped are neither undone nor redone.
                source.steps.retain(|known| Arc::strong_count(&known.step) > 1);
                source.steps.push(AcceptedUpdate { step: step.clone(), before, after });
                source.trial = Some(built);
            }
            (Commit::Undone(_), Some(known)) => source.base = known.before,
            (Commit::Redone(_), Some(known)) => source.base = Some(known.after),
            _ => {}
        }
    }
    for EditRefusal { rig, request, reason } in refused.read() {
        if let Ok(mut source) = sources.get_mut(*rig)
            && source.take_requested(*request).is_some()
        {
            commands.trigger(RigFailed { entity: *rig, error: TemplateError::Load(reason.to_string()) });
        }
    }
}

/// Tells updates that were made in this frame, and takes back those that cannot be built.
pub(super) fn try_updates(
    mut sources: Query<(Entity, &mut RigSource, Option<&BuildFailure>)>,
    mut requests: MessageWriter<EditRequest>,
    mut commands: Commands,
) {
    for (entity, mut source, failure) in &mut sources {
        let Some(built) = source.bypass_change_detection().trial.take() else { continue };
        match failure.filter(|_| !source.had_failed) {
            Some(BuildFailure(error)) => {
                requests.write(EditRequest { rig: entity, change: Change::Undo });
                commands.trigger(RigFailed { entity, error: TemplateError::Load(error.to_string()) });
            }
            None => {
                let (changes, ran) = (built.changes.clone(), built.ran.clone());
                let UpdateNotes { poses, clips } = source.notes.clone();
                commands.trigger(RigUpdated { entity, changes, ran, poses, clips });
            }
        }
    }
}

/// Compares rigs with their templates where these have changed.
pub(super) fn compare_templates(
    templates: Res<RigTemplates>,
    modules: Res<RigModules>,
    mut sources: Query<(Entity, &mut RigSource, Option<&Rig>, Has<BuildFailure>)>,
    mut edits: MessageWriter<EditRequest>,
    mut builds: MessageWriter<BuildRequest>,
    mut commands: Commands,
) {
    for (entity, mut source, rig, had_failed) in &mut sources {
        let Some(built) = templates.built.get(&source.template.id()) else { continue };
        if source.seen.as_ref().is_some_and(|seen| Arc::ptr_eq(seen, built)) {
            continue;
        }
        source.seen = Some(built.clone());
        let Some(rig) = rig else {
            source.base = Some(BaseVersion::of(built));
            commands.entity(entity).try_insert((*built.rig).clone());
            builds.write(BuildRequest { rig: entity, step: BuildStep::All });
            continue;
        };
        commands.entity(entity).try_remove::<UpdateOffer>();
        if std::mem::take(&mut source.is_first) {
            source.base = Some(BaseVersion::of(built));
            continue;
        }
        let updated = updated(source.base.as_ref(), rig, built, &Take::Mine.into(), &modules);
        if updated.update.changes.is_empty() {
            source.base = Some(updated.base);
        } else if source.is_live && updated.update.conflicts() == 0 {
            source.had_failed = had_failed;
            take_over(entity, rig, updated, built, &mut source, &mut edits, &mut commands);
        } else {
            let from = source.base().map_or(rig, |base| &**base);
            let version = VersionChange::between(from.about(), built.rig.about());
            let (UpdateNotes { poses, clips }, built) = (updated.notes, built.clone());
            let offer = UpdateOffer { changes: updated.update.changes.into(), poses, clips, version, built };
            commands.entity(entity).try_insert(offer);
        }
    }
}

/// Carries out accepted offers.
pub(super) fn accept_offers(
    mut accepted: MessageReader<AcceptUpdate>,
    modules: Res<RigModules>,
    mut sources: Query<(&mut RigSource, &Rig, &UpdateOffer, Has<BuildFailure>)>,
    mut edits: MessageWriter<EditRequest>,
    mut commands: Commands,
) {
    for AcceptUpdate { rig: entity, choices } in accepted.read() {
        let Ok((mut source, rig, offer, had_failed)) = sources.get_mut(*entity) else {
            warn!("rig {entity} has no update to accept");
            continue;
        };
        source.had_failed = had_failed;
        let updated = updated(source.base.as_ref(), rig, &offer.built, choices, &modules);
        commands.entity(*entity).try_remove::<UpdateOffer>();
        take_over(*entity, rig, updated, &offer.built, &mut source, &mut edits, &mut commands);
    }
}

/// An update of a rig to its template.
struct RigUpdate {
    update: Update,
    /// Losses of poses and clips.
    notes: UpdateNotes,
    /// The version that the rig has taken over then.
    base: BaseVersion,
}

/// An update whose poses and clips mean the same. Fields of part instances are compared by themselves, as
/// [`update_template`](crate::files::update_template) compares them.
fn updated(
    base: Option<&BaseVersion>,
    rig: &Rig,
    built: &BuiltTemplate,
    choices: &Choices,
    modules: &RigModules,
) -> RigUpdate {
    let of_parts = base.and_then(|base| base.update_of_parts(rig, built.file.as_deref()?, choices));
    let (mut update, base) = of_parts.unwrap_or_else(|| {
        (update_with(base.map(|base| &*base.rig), rig, &built.rig, choices), BaseVersion::of(built))
    });
    let poses = keep_poses(rig, &mut update.rig, &modules.0).unwrap_or_else(|error| {
        warn!("poses were not re-expressed: {error}");
        Vec::new()
    });
    let clips = keep_clips(rig, &mut update.rig, &modules.0).unwrap_or_else(|error| {
        warn!("clips were not re-expressed: {error}");
        ClipReport::default()
    });
    RigUpdate { update, notes: UpdateNotes { poses: poses.into(), clips: clips.into() }, base }
}

/// Requests the edits of an update.
fn take_over(
    entity: Entity,
    rig: &Rig,
    RigUpdate { update, notes, base }: RigUpdate,
    built: &Arc<BuiltTemplate>,
    source: &mut RigSource,
    requests: &mut MessageWriter<EditRequest>,
    commands: &mut Commands,
) {
    source.notes = notes;
    match edits_between(rig, &update.rig) {
        // What is taken is there already.
        Ok(edits) if edits.is_empty() => source.base = Some(base),
        Ok(mut edits) => {
            edits.extend(pose_edits(rig, &update.rig));
            match clip_edits(rig, &update.rig) {
                Ok(clips) => edits.extend(clips),
                Err(error) => warn!("clips were not re-expressed: {error}"),
            }
            let request = requests.write(EditRequest::operation(entity, Operation::Named { name: UPDATE, edits }));
            source.pending = Some(RequestedUpdate { request, built: built.clone(), base });
        }
        Err(error) => commands.trigger(RigFailed { entity, error: TemplateError::Load(error.to_string()) }),
    }
}

/// Tells rigs that are built for the first time, and binds their meshes that have no weights.
pub(super) fn bind_meshes(
    fresh: Query<Entity, (With<RigSource>, Added<BuildResult>)>,
    rigs: Query<(&Rig, &RigMeshes, &RigSource), With<BuildResult>>,
    meshes: Query<&RigMesh>,
    mut asked: Local<EntityHashSet>,
    mut requests: MessageWriter<BindRequest>,
    mut commands: Commands,
) {
    for entity in &fresh {
        commands.trigger(RigBuilt { entity });
    }
    for (rig, of, _) in rigs.iter().filter(|(.., source)| !source.is_unbound) {
        for entity in of.iter() {
            let Ok(mesh) = meshes.get(entity) else { continue };
            if rig.skin(mesh.uid).is_none() && asked.insert(entity) {
                requests.write(BindRequest::new(entity));
            }
        }
    }
}
