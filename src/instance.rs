//! Characters of a game: instances of templates, which are updated while they move when the template's file is saved.
//!
//! A [`RigInstance`] on an entity makes it a character of a [`RigTemplate`]. A template is built once, on a thread of its own,
//! for all of its instances, which share the program and have poses, attribute values and springs of their own. With
//! [`RigInstancePlugin::live`] the files of templates are watched: a saved file is read, compared with what runs, and only the
//! commands that it concerns run again; then every instance goes on with the new program in one frame, in the pose that it has.
//! A file that cannot be read, or whose build fails, changes nothing: it is told ([`RigFailed`]), and the next good save is
//! taken over.
//!
//! A [`RigMesh`](crate::plugins::surface::RigMesh) of an instance is bound to the template's joints in the background, once for
//! all instances with the mesh; [`SkinBound`] tells it. With a [`ModelFile`] and the [`ModelFilesPlugin`] it follows its file.
//! Skinned meshes that Bevy loaded below an instance are moved by it, and by the file's own clips where no command of the rig drives
//! a joint; [`JointsHeld`] tells the others.
//!
//! Clips of a `.anim.ron` or `.rigclip` go onto an instance with [`InstanceClips`]; a [`ClipPlayer`](crate::plugins::animation::ClipPlayer)
//! plays them where [`ClipPlugin`](crate::plugins::animation::ClipPlugin) is added, or Bevy's own player. When a saved template
//! changes what their keys mean, they are re-expressed, so that the joints move as before; [`RigUpdated`] tells what is not kept.
//!
//! A face shows the strengths that a game writes to [`Expressions`](crate::plugins::face::Expressions) on its instance, by the poses
//! that its template stores; [`ExpressFailed`] tells names that it cannot show.
//!
//! An instance is as its template says. A rig that people edit has a document of its own: [`RigSource`].
//!
//! ```
//! use bevy::prelude::*;
//! use rigsmith::instance::{RigInstance, RigInstancePlugin, RigTemplate};
//!
//! let mut app = App::new();
//! app.add_plugins((MinimalPlugins, TransformPlugin, RigInstancePlugin::default()));
//! app.add_systems(Startup, |mut commands: Commands, mut templates: ResMut<Assets<RigTemplate>>| {
//!     let text = br#"(format: 2, name: "arm", joints: [(label: "arm", tags: [control])])"#;
//!     if let Ok(template) = RigTemplate::read(text) {
//!         commands.spawn(RigInstance(templates.add(template)));
//!     }
//! });
//! app.update();
//! ```

mod apply;
mod asset;
mod bodies;
mod builds;
mod clip_updates;
mod clips;
mod exchange;
mod faces;
mod file_nodes;
mod folders;
mod model_files;
mod skins;
mod source;
mod template_file;

use std::{
    collections::{HashMap, HashSet},
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use bevy::{
    app::{AnimationSystems, MainScheduleOrder},
    asset::{AssetId, AssetPlugin, io::file::FileAssetReader},
    ecs::{schedule::ScheduleLabel, system::SystemParam},
    prelude::*,
};

use self::builds::{Builds, Work};
#[cfg(feature = "draw")]
pub use self::skins::SharedMesh;
pub use self::{
    asset::{RigTemplate, RigTemplateLoader, RigTemplateSaver},
    bodies::InstanceSkins,
    builds::BuiltTemplate,
    clips::{ClipsBound, InstanceAnimations, InstanceClips, RigAnimation, RigAnimationError, RigAnimationLoader},
    faces::ExpressFailed,
    file_nodes::JointsHeld,
    folders::{FolderError, FolderFault, FolderRead, GesturesRead, WatchedFolder, WatchedFolderPlugin, WatchedFolders},
    model_files::{FollowedModels, ModelFault, ModelFile, ModelFileError, ModelFilesPlugin},
    skins::{BoundTo, SkinBound},
    source::{AcceptUpdate, RigSource, UPDATE, UpdateOffer},
};
use crate::{
    algo::weights::WeightError,
    files::LOOK,
    mesh::model::Trs,
    modules,
    plugins::{
        RigSystems,
        animation::ClipSystems,
        commands::{BuildResult, NamedProgramError, RigModules},
        runtime::{ControlPose, InstanceMode, NodeOf, RigRuntime, RuntimePlugin},
    },
    processor::{ClipReport, PoseNote},
    rig::{PoseOffset, RestTransform, SourceError, Uid, update::Change},
    solve::program::ExposedNode,
};

/// Plugin of instances. Add it after Bevy's [`AssetPlugin`] and [`RigPlugins`](crate::plugins::RigPlugins) where an app has
/// them; it adds what it needs of both otherwise.
#[derive(Debug, Clone)]
pub struct RigInstancePlugin {
    /// True if files of templates are watched, so that instances go on with what is saved.
    pub live: bool,
    /// Time between two looks at a watched file; with many files it is longer.
    pub look: Duration,
    /// Time for which a file that cannot be read as a template may stay so before [`RigFailed`] tells it: it may be half
    /// written.
    pub patience: Duration,
}

impl Default for RigInstancePlugin {
    fn default() -> Self {
        Self { live: false, look: LOOK, patience: Duration::from_millis(250) }
    }
}

impl RigInstancePlugin {
    /// Plugin that takes over files when they are saved.
    pub fn live() -> Self {
        Self { live: true, ..Self::default() }
    }
}

/// Schedule in which templates are taken over, right after `Update`.
#[derive(ScheduleLabel, Debug, Clone, PartialEq, Eq, Hash)]
pub struct UpdateInstances;

impl Plugin for RigInstancePlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<AssetPlugin>() {
            app.add_plugins(AssetPlugin::default());
        }
        if !app.is_plugin_added::<RuntimePlugin>() {
            app.add_plugins(RuntimePlugin);
        }
        if !app.world().contains_resource::<RigModules>() {
            app.insert_resource(RigModules(Arc::new(modules::all())));
        }
        let root = app.get_added_plugins::<AssetPlugin>().first().map(|plugin| plugin.file_path.clone());
        let root = root.map(|root| FileAssetReader::get_base_path().join(root));
        app.init_asset::<RigTemplate>()
            .register_asset_loader(RigTemplateLoader)
            .init_asset::<RigAnimation>()
            .register_asset_loader(RigAnimationLoader)
            .init_resource::<clip_updates::ClipJobs>()
            .insert_resource(RigTemplates {
                builds: Builds::start(self.look, self.patience),
                is_live: self.live,
                root,
                built: HashMap::new(),
                failed: HashMap::new(),
                own: HashMap::new(),
                is_fresh: false,
            })
            .init_schedule(UpdateInstances);
        app.world_mut().resource_mut::<MainScheduleOrder>().insert_after(Update, UpdateInstances);
        app.add_systems(
            UpdateInstances,
            (
                (apply::tell_known_failures, follow_assets, apply::follow_failures, watch_files).chain(),
                apply::take_outcomes,
                apply::update_instances.run_if(apply::is_due),
                (
                    source::follow_steps,
                    source::try_updates,
                    source::accept_offers,
                    source::compare_templates,
                    source::bind_meshes,
                )
                    .chain(),
                clips::give_clips,
            )
                .chain(),
        );
        source::add(app);
        app.init_resource::<bodies::InstanceSkins>().add_systems(
            UpdateInstances,
            (bodies::land_bodies, bodies::give_bodies, bodies::bind_bodies).chain().after(apply::update_instances),
        );
        skins::add(app);
        app.add_systems(
            UpdateInstances,
            faces::express.after(clips::give_clips).after(bodies::bind_bodies).after(file_nodes::fit_skins),
        )
        .add_systems(
            PostUpdate,
            (
                file_nodes::note_rests.before(AnimationSystems),
                file_nodes::follow_nodes.after(AnimationSystems).before(ClipSystems).before(RigSystems::Solve),
            )
                // Cameras have transforms, too; these are those of files' nodes and of rigs alone.
                .ambiguous_with_all(),
        );
        app.add_observer(apply::leave);
    }
}

/// Makes an entity a character of a template. Its nodes are spawned when the template is loaded and built, as
/// [`InstanceMode`] says; [`RigBuilt`] tells it. Taking the component off despawns them; another mode spawns others, unposed.
/// What a game hung on a node that is despawned stays, on the instance.
#[derive(Component, Reflect, Debug, Clone, PartialEq, Eq)]
#[reflect(Component)]
#[require(InstanceMode, Transform)]
pub struct RigInstance(pub Handle<RigTemplate>);

/// Nodes besides joints and sockets that an instance in [`InstanceMode::Direct`] has as entities, and that can be posed. Without
/// this component these are all controls, and also where the template lacks one of the nodes, which [`RigFailed`] tells. Joints
/// that stored poses move can be posed in any case. Instances with the same nodes share a program.
#[derive(Component, Reflect, Debug, Clone, PartialEq, Eq, Default)]
#[reflect(Component)]
pub struct ExposedNodes(pub Vec<ExposedNode>);

/// The built template that an instance runs.
#[derive(Component, Reflect, Debug, Clone)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
pub struct RunningTemplate(Arc<BuiltTemplate>);

impl RunningTemplate {
    /// The built template.
    pub fn get(&self) -> &Arc<BuiltTemplate> {
        &self.0
    }
}

/// An instance has its nodes.
#[derive(EntityEvent, Debug, Clone)]
pub struct RigBuilt {
    /// The instance.
    pub entity: Entity,
}

/// An instance goes on with a changed template.
#[derive(EntityEvent, Debug, Clone)]
pub struct RigUpdated {
    /// The instance.
    pub entity: Entity,
    /// Differences from the template, or the version of it, that the instance had.
    pub changes: Arc<[Change]>,
    /// Tags of the commands that ran again.
    pub ran: Arc<[Uid]>,
    /// Joints that could not be held where they stood, although the change moved only what a pose means.
    pub poses: Arc<[PoseNote]>,
    /// Motion that the clips could not keep, and keys whose nodes are gone: compared with the clips as they were made.
    pub clips: Arc<ClipReport>,
}

/// The template of an instance was not taken over; the instance goes on as it was. An instance that comes later, to a template
/// that has never been built, is told the reason, too.
#[derive(EntityEvent, Debug, Clone)]
pub struct RigFailed {
    /// The instance.
    pub entity: Entity,
    /// The reason.
    pub error: TemplateError,
}

/// Reason for which a template is not taken over.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TemplateError {
    /// The file is no template, or a command in it fails.
    #[error("{}{source}", named(file.as_deref()))]
    Source {
        /// The file, if the template has one.
        file: Option<PathBuf>,
        /// Place and reason.
        source: SourceError,
    },
    /// The built rig cannot run.
    #[error("{}what is built cannot run: {source}", named(file.as_deref()))]
    CannotRun {
        /// The file, if the template has one.
        file: Option<PathBuf>,
        /// The reason.
        source: NamedProgramError,
    },
    /// The file cannot be loaded.
    #[error("{0}")]
    Load(String),
    /// A mesh of the instance cannot be bound to the joints.
    #[error("a mesh is not bound: {source}")]
    CannotBind {
        /// The reason.
        source: WeightError,
    },
}

fn named(file: Option<&Path>) -> String {
    file.map(|file| format!("`{}`: ", file.display())).unwrap_or_default()
}

/// Templates that are built, and their files.
#[derive(Resource)]
pub struct RigTemplates {
    builds: Builds,
    is_live: bool,
    /// Folder of the asset server's files.
    root: Option<PathBuf>,
    built: HashMap<AssetId<RigTemplate>, Arc<BuiltTemplate>>,
    /// Reasons for which templates have no build.
    failed: HashMap<AssetId<RigTemplate>, TemplateError>,
    /// Templates that the thread has built before they became assets.
    own: HashMap<AssetId<RigTemplate>, RigTemplate>,
    is_fresh: bool,
}

impl RigTemplates {
    /// The built template of an asset; `None` until it is built.
    pub fn built(&self, template: &Handle<RigTemplate>) -> Option<&Arc<BuiltTemplate>> {
        self.built.get(&template.id())
    }

    /// Number of templates that are built. Those of which nobody has a handle are forgotten.
    pub fn count(&self) -> usize {
        self.built.len()
    }

    /// Sets a function that lets an app which sleeps run a frame. The thread that builds templates calls it after each result.
    pub fn set_wake(&self, wake: impl Fn() + Send + 'static) {
        self.builds.send(Work::Wake(Box::new(wake)));
    }

    /// Forgets a template, and ends the watch of its file.
    fn forget(&mut self, id: AssetId<RigTemplate>) {
        self.own.remove(&id);
        self.built.remove(&id);
        self.failed.remove(&id);
        self.builds.send(Work::Forget { id });
    }

    /// Sends templates that were changed by code, or loaded, to be built.
    fn follow(&mut self, id: AssetId<RigTemplate>, template: &RigTemplate, modules: &RigModules) {
        if self.own.get(&id).is_some_and(|own| own.is_same(template)) {
            return;
        }
        self.own.insert(id, template.clone());
        self.builds.send(Work::Build { id, template: template.clone(), modules: modules.0.clone() });
    }
}

/// Templates from files anywhere, also outside of the folder of assets.
///
/// ```no_run
/// use bevy::prelude::*;
/// use rigsmith::instance::{RigInstance, TemplateFiles};
///
/// fn spawn(mut commands: Commands, files: TemplateFiles) {
///     commands.spawn(RigInstance(files.open("characters/biped.rig.ron")));
/// }
/// ```
#[derive(SystemParam)]
pub struct TemplateFiles<'w> {
    assets: Res<'w, Assets<RigTemplate>>,
    modules: Res<'w, RigModules>,
    templates: Res<'w, RigTemplates>,
}

impl TemplateFiles<'_> {
    /// Loads a template from a file; relative to the working folder. With [`RigInstancePlugin::live`] the file is watched.
    pub fn open(&self, file: impl Into<PathBuf>) -> Handle<RigTemplate> {
        let handle = self.assets.reserve_handle();
        let (id, file, modules) = (handle.id(), file.into(), self.modules.0.clone());
        self.templates.builds.send(Work::Open { id, file, modules, is_watched: self.templates.is_live });
        handle
    }

    /// Takes over a content for a template as if it had been saved to its file.
    pub fn offer(&self, template: &Handle<RigTemplate>, content: Vec<u8>) {
        let (id, modules) = (template.id(), self.modules.0.clone());
        self.templates.builds.send(Work::Content { id, content, modules });
    }
}

/// Nodes of instances by name.
#[derive(SystemParam)]
pub struct InstanceNodes<'w, 's> {
    instances: Query<'w, 's, (AnyOf<(&'static RunningTemplate, &'static BuildResult)>, &'static RigRuntime)>,
    sources: Query<'w, 's, &'static RigSource>,
}

impl InstanceNodes<'_, '_> {
    /// Entity of the node with that name, or else of the first with that label: `hand_ik_l`, for example. Look it up once
    /// and keep it: it stays the same when the template changes.
    pub fn find(&self, instance: Entity, name: &str) -> Option<Entity> {
        let ((template, built), runtime) = self.instances.get(instance).ok()?;
        let built = template.map(|template| &template.0.built).or(built.map(|built| &built.0))?;
        let nodes = || built.nodes.iter();
        let named = nodes().filter(|node| &*node.name == name);
        let labelled = nodes().filter(|node| node.label.as_deref() == Some(name));
        let mut entities = named.chain(labelled).filter_map(|node| entity(runtime, node.uid));
        entities.next()
    }

    /// Socket of an instance: the entity of its joint, and its place relative to that. Something that is a child of the joint
    /// with the place as its transform hangs on the socket. The name is `hand` for a socket of the template itself, and
    /// `left arm.hand` for one of its part of that name.
    pub fn socket(&self, instance: Entity, name: &str) -> Option<(Entity, Transform)> {
        let ((template, _), runtime) = self.instances.get(instance).ok()?;
        let built = template.map(|template| &template.0);
        let built = built.or_else(|| self.sources.get(instance).ok()?.built())?;
        let socket = built.sockets.iter().find(|socket| socket.name == name)?;
        Some((entity(runtime, socket.joint?)?, socket.rest.into()))
    }

    /// Entity of the node with that uid.
    pub fn find_uid(&self, instance: Entity, node: Uid) -> Option<Entity> {
        entity(self.instances.get(instance).ok()?.1, node)
    }
}

/// Poses of controls and joints of running rigs, in either [`InstanceMode`].
#[derive(SystemParam)]
pub struct ControlPoses<'w, 's> {
    nodes: Query<'w, 's, (&'static Uid, &'static NodeOf, AnyOf<(&'static mut ControlPose, &'static mut Transform)>)>,
    rigs: Query<'w, 's, &'static RigRuntime>,
}

impl ControlPoses<'_, '_> {
    /// Poses a node: the offset is on top of its rest pose, in its own space at rest. It takes effect in the same frame, within
    /// the channels and limits of a control. Returns false if the entity is no node of a running rig.
    pub fn set(&mut self, node: Entity, offset: PoseOffset) -> bool {
        let Ok((uid, of, (pose, transform))) = self.nodes.get_mut(node) else { return false };
        let Ok(runtime) = self.rigs.get(of.0) else { return false };
        let program = runtime.state().program();
        let Some(node) = program.node(*uid).map(|slot| &program.nodes()[slot]) else { return false };
        match (pose, transform) {
            (Some(mut pose), _) => pose.set_if_neq(offset.into()),
            (None, Some(mut transform)) => {
                let Trs { translation, rotation, scale } = node.base;
                transform.set_if_neq(offset.on(&RestTransform { translation, rotation, scale }))
            }
            (None, None) => return false,
        };
        true
    }
}

fn entity(runtime: &RigRuntime, node: Uid) -> Option<Entity> {
    runtime.entity(runtime.state().program().node(node)?)
}

/// Entities that use templates.
#[derive(SystemParam)]
struct Users<'w, 's> {
    all: Query<'w, 's, (Entity, AnyOf<(&'static RigInstance, &'static RigSource)>)>,
}

impl Users<'_, '_> {
    /// Entities that use the template.
    fn of(&self, id: AssetId<RigTemplate>) -> impl Iterator<Item = Entity> {
        let uses = move |(instance, source): (Option<&RigInstance>, Option<&RigSource>)| {
            instance.is_some_and(|instance| instance.0.id() == id)
                || source.is_some_and(|source| source.template.id() == id)
        };
        self.all.iter().filter(move |(_, of)| uses(*of)).map(|(entity, _)| entity)
    }
}

fn follow_assets(
    mut events: MessageReader<AssetEvent<RigTemplate>>,
    assets: Res<Assets<RigTemplate>>,
    modules: Res<RigModules>,
    mut templates: ResMut<RigTemplates>,
) {
    for event in events.read() {
        match event {
            AssetEvent::Added { id } | AssetEvent::Modified { id } => {
                if let Some(template) = assets.get(*id) {
                    templates.follow(*id, template, &modules);
                }
            }
            // A template that never became an asset is told as unused alone.
            AssetEvent::Removed { id } | AssetEvent::Unused { id } => templates.forget(*id),
            AssetEvent::LoadedWithDependencies { .. } => {}
        }
    }
}

/// Watches the files of instances' templates that the asset server loads, or fails to load.
fn watch_files(
    instances: Query<&RigInstance, Changed<RigInstance>>,
    sources: Query<&RigSource, Added<RigSource>>,
    server: Res<AssetServer>,
    modules: Res<RigModules>,
    templates: Res<RigTemplates>,
    mut watched: Local<HashSet<AssetId<RigTemplate>>>,
) {
    let Some(root) = templates.root.as_ref().filter(|_| templates.is_live) else { return };
    let handles = instances.iter().map(|instance| &instance.0).chain(sources.iter().map(|source| &source.template));
    for handle in handles {
        let id = handle.id();
        let Some(path) = server.get_path(id) else { continue };
        if path.source().as_str().is_none() && path.label().is_none() && watched.insert(id) {
            let (file, modules) = (root.join(path.path()), modules.0.clone());
            templates.builds.send(Work::Watch { id, file, modules });
        }
    }
}
