//! The engine as Bevy plugins: one plugin a file, each public, replaceable and usable alone where that makes sense.
//!
//! # Writers of components
//!
//! A rig is told by components ([`schema`]). The document ([`Rig`](crate::rig::Rig)) stays the truth; the entities follow
//! it, and what somebody else writes to them is taken up in the next frame.
//!
//! | component | written by | somebody else writes it |
//! | --- | --- | --- |
//! | `Rig` | the edit path ([`document`]) | only with [`document::EditRequest`]; a replaced component is another document without its history; taking it off despawns what came of it |
//! | [`NodeLabel`](schema::NodeLabel), [`InGroup`](schema::InGroup), [`RestTransform`](crate::rig::RestTransform), `ChildOf` of a joint | the document | an edit, one step of the history a frame; a value that the document refuses is put back and told |
//! | [`RestTransform`](crate::rig::RestTransform) of a node of a game's instance | the instance: the built rest pose, below the built parent; that of a joint of the document is the document's instead | no effect on the pose; overwritten by the next template |
//! | [`LocalGroup`](schema::LocalGroup), [`Tag`](schema::Tag), [`CommandTag`](schema::CommandTag), [`FeatureTag`](schema::FeatureTag), [`TagOf`](schema::TagOf), [`GroupOf`](schema::GroupOf), the order of [`Tags`](schema::Tags), [`InFeature`](schema::InFeature) | the document | an edit, as above; a command that becomes a feature, too, or a feature in a feature is put back and told |
//! | a spawned [`Joint`](schema::Joint) below a rig or joint, a tag on a joint, a group of a rig | | added to the document; the entity stays the same and gets a [`Uid`](crate::rig::Uid); below or on another part of a rig it loses that relation and is told, and so is a tag that is both command and feature, or in what is no feature; a joint in a group of another rig is added without it, and that is told |
//! | a despawned joint, tag or group | | deleted, joints with their subtree; undoing spawns others |
//! | `Transform` of a joint or created node | the program, and the document where its pose changes | becomes the node's pose in the same frame, within the channels and limits of a control; a driven node answers with what its constraints make of it |
//! | [`Attributes`](schema::Attributes) | the program, and the document where its values change | drives the rig in the same frame; a driven value is put back and told for each entity and name ([`document::EntityWriteError::DrivenAttribute`]); one that the node does not have is taken off and told likewise ([`document::EntityWriteError::UnknownAttribute`]); where all are taken off, they are put back and told |
//! | `GlobalTransform` of a node | propagation, corrected where Bevy would shear | overwritten |
//! | [`Null`](schema::Null) | the document, for joints without weights, and the build, for created nulls | on a joint: an edit, it is without weights; on a created node it is put back and told |
//! | `Uid` | the document, and the build | immutable in place; what is inserted or removed, on a rig, too, is put back in the same frame and told ([`document::EntityWriteError::Uid`]); a part that is spawned with a free one keeps it |
//! | [`CreatedRole`](schema::CreatedRole), [`Control`](schema::Control), [`NodeLayer`](schema::NodeLayer), [`ParkedNode`](schema::ParkedNode), [`commands::BuildResult`], [`ConstraintKind`](schema::ConstraintKind), [`ConstraintTargets`](schema::ConstraintTargets), [`controls::NodeVisible`] | the build | immutable in place; what is inserted or removed is put back in the same frame and told ([`document::EntityWriteError::BuiltContent`]) |
//! | [`commands::CommandReport`], [`commands::BuildFailure`], [`commands::RunFailure`] | the build | immutable in place; what is inserted or removed stands until the build writes it again |
//! | [`Control`](schema::Control), [`NodeLayer`](schema::NodeLayer), [`CreatedRole`](schema::CreatedRole), [`NodeOf`](schema::NodeOf), [`Null`](schema::Null), [`NodeLabel`](schema::NodeLabel) and `Name` of a node of a game's instance | the instance | not guarded, because an instance has no document: stands until the instance takes another template over; [`controls::NodeVisible`] follows it, and is put back and told here as well |
//! | [`controls::size::ShapeFactor`] | the measurement of shapes on a mesh | stands until the mesh or the build changes |
//! | [`controls::density::CrowdedControl`] | apps with a view, for the controls that it leaves out | takes effect in the same frame |
//! | [`CreatedBy`](schema::CreatedBy), [`Constrains`](schema::Constrains), [`NodeOf`](schema::NodeOf) | the build, and the document for its joints | put back in the same frame and told, but on nodes of games' instances |
//! | a despawned constraint | | spawned again and told: change the command instead |
//! | [`RigNodes`](schema::RigNodes), [`LocalGroups`](schema::LocalGroups), [`GroupMembers`](schema::GroupMembers), [`FeatureCommands`](schema::FeatureCommands), [`CreatedNodes`](schema::CreatedNodes), [`NodeConstraints`](schema::NodeConstraints) | Bevy, as the other side of a relation | write the relation instead |
//! | [`NodeSlot`](schema::NodeSlot) | the instance of a game | immutable |
//! | [`ControlPose`](schema::ControlPose) | games and animations, of instances without a hierarchy | drives the node in the same frame, within the channels and limits of a control |
//! | [`runtime::InstanceMode`], [`runtime::HandOver`], [`runtime::OutsideTransform`] | games | takes effect in the same frame |
//! | [`surface::RigMesh`], [`surface::SkinOf`] | whoever loads a mesh | the mesh is bound, shown and found by rays anew |
//! | [`selection::Selection`] | picking, gestures, edits, undo | stands until one of them writes it |
//! | label, group, rest and parent of a created node, and the node itself | the build | put back and told: change the command instead |
//! | [`face::Expressions`] of a mesh | an [`face::ExpressRequest`] | becomes one, an edit of the pose in the same frame, or once its pose is computed ([`face::BackgroundPosing`]); what is shown already is none; unknown names are told by [`face::ExpressionAnswer`] |
//! | [`face::Expressions`] of a game's instance | games | poses the joints by the stored poses of the template in the same frame; what cannot be shown is told by [`ExpressFailed`](crate::instance::ExpressFailed) |
//! | [`animation::ClipPlayer`] | a person or a game; its time by the playback | plays from there |
//! | `Name` of rigs, joints and groups | the name or label | an edit of the name or label; a rig takes over the one that it is spawned with; one that is removed comes back; of a created node it is put back and told |
//! | [`document::ShowRest`], [`document::Symmetry`], [`animation::AutoKey`] | the editor | takes effect with the next edit |
//! | [`selection::HoveredNode`] | picking | stands until the pointer moves |
//! | [`stage::RigStage`] | the build | immutable; send a [`stage::StageRequest`] |
//! | [`runtime::RigInputs`] | games | read each frame: where the entities of a template's inputs stand |
//! | [`animation::RigClips`], [`animation::RootMotion`], [`animation::ClipTargets`] | games | takes effect in the same frame; the movement in `RootMotion` is written each frame |
//! | [`surface::RigMeshes`] | Bevy, as the other side of a relation | write [`surface::SkinOf`] instead |
//! | [`runtime::DrivenMorphs`] | whoever binds a mesh; its weights by the rig | drives other morph targets; weights are overwritten |
//! | [`face::Face`], [`fit::FittedRig`] | the analysis of a mesh and the fit | opaque; taking it off ends expressions, or corrections of the fit |
//! | [`fit::FitMarkers`] | corrections of a fit, undo and redo | the next fit starts from them; taking it off forgets them |
//! | [`RigInstance`](crate::instance::RigInstance), [`RigSource`](crate::instance::RigSource), [`ExposedNodes`](crate::instance::ExposedNodes), `SharedMesh` (feature `draw`) | games | another template or other nodes are spawned; taking it off despawns what came of it |
//! | [`ModelFile`](crate::instance::ModelFile) | games and the window | another file is followed; taking it off leaves the mesh |
//! | [`InstanceClips`](crate::instance::InstanceClips) | games | another file is bound; taking it off leaves the clips |
//! | [`InstanceAnimations`](crate::instance::InstanceAnimations) | instances with clips | overwritten when file or template change |
//! | [`history::RigHistory`] | the edit path | opaque; a replaced one forgets what can be undone |
//! | [`document::JointEntities`], [`document::TagEntities`], [`document::GroupEntities`], [`commands::BuiltEntities`] | the document and the build | opaque; other code reads them: one that is replaced or taken off loses the entities of its rig |
//! | [`commands::Processor`] | a [`commands::BuildRequest`] | other code reads it; where it is taken off, the next request builds from the beginning |
//! | [`runtime::RigRuntime`] | the build, and instances | opaque; poses and values that are set with [`runtime::RigRuntime::state_mut`] take effect in the same frame; where it is taken off, the rig stands still until it is built otherwise |
//! | [`journal::RigJournal`] | whoever opens a document | opaque; taking it off ends the storing of changes |
//! | [`surface::RigSurface`] | the refresh of surfaces | other code reads it |
//! | [`gesture::GestureScript`] | whoever has gestures to carry out | its gestures are carried out; taking it off ends them |
//! | [`stroke::StrokeTips`] | strokes | opaque; stands until the next stroke |
//! | [`skinning::InstanceBody`], [`skinning::InstanceSkin`] | instances with meshes | opaque; stands until the template or the mesh changes |
//! | [`painting::PaintCanvas`] | the preparation of a mesh for brushes | opaque; taking it off prepares the mesh anew |
//! | `RigViewport` (feature `draw`) | whoever spawns the camera | takes effect in the same frame |
//! | `RigLabels`, `DisplayJob`, `DisplayPiece` (feature `draw`) | the drawing of rigs and meshes | stands until that draws anew |
//! | [`RunningTemplate`](crate::instance::RunningTemplate), [`UpdateOffer`](crate::instance::UpdateOffer), [`BoundTo`](crate::instance::BoundTo) | instances | opaque; stands until the template, the offer or the mesh changes |
//!
//! "Told" means an [`EditRefusal`](document::EditRefusal) and a warning, once for each entity and component, until a write
//! is accepted or the component has its right value anew.
//!
//! Running tasks and notes of the plugins are components without reflection:
//!
//! | component without reflection | written by | somebody else writes it |
//! | --- | --- | --- |
//! | [`face::FaceJob`], [`skinning::SkinningJob`], [`fit::FitJob`] | a request | taking it off stops the task; its result is dropped |
//! | [`face::FacePreparation`], [`mesh_reload::ReloadJob`], [`painting::WeightChangeJob`], [`painting::CanvasJob`] | a request, and changed files | taking it off drops the task and its result |
//! | [`face::FacePosing`] | requests of expressions | taking it off stops the pose that is computed; expressions need it |
//! | [`stage::Deletions`] | stages of a rig | other code leaves it alone |
//! | [`controls::size::MeasuredShapes`] | the measurement of shapes on a mesh | taking it off ends the measurement |
//! | `PlayedClip` | the playback of a clip | other code leaves it alone |

pub mod animation;
pub mod commands;
pub mod controls;
#[cfg(feature = "draw")]
pub mod display;
pub mod document;
#[cfg(feature = "draw")]
pub mod drawing;
pub mod face;
pub mod fit;
pub mod gesture;
pub mod history;
mod job_control;
pub mod journal;
pub mod landing;
pub mod limits;
pub mod mesh_reload;
pub mod painting;
pub mod picking;
pub mod placement;
pub mod runtime;
pub mod schema;
pub mod selection;
pub mod skinning;
pub mod stage;
pub mod stroke;
pub mod surface;
#[cfg(feature = "draw")]
pub mod viewport;

use bevy::{
    app::{AnimationSystems, PluginGroupBuilder, TaskPoolOptions},
    prelude::*,
    transform::systems::sync_simple_transforms,
};

/// Plugins of rigs, without window and renderer. What they take, make and wait for is bounded by [`limits::RigLimits`].
///
/// | plugin | gives |
/// | --- | --- |
/// | [`document::DocumentPlugin`] | rigs, their joint entities, the one edit path, undo and redo |
/// | [`commands::CommandsPlugin`] | tags as entities, building, stepping and rolling back |
/// | [`stage::StagePlugin`] | stages of a rig: skeleton, edited, built, deleted |
/// | [`controls::ControlsPlugin`] | which controls are visible; switches without a jump |
/// | [`surface::SurfacePlugin`] | the posed surface that rays meet |
/// | [`picking::PickingPlugin`] | selecting joints |
/// | [`placement::PlacementPlugin`] | placing joints with rays |
/// | [`stroke::StrokePlugin`] | chains from strokes |
/// | [`gesture::GesturePlugin`] | lists of gestures that drive all of the above |
/// | [`skinning::SkinningPlugin`] | automatic weights in the background |
/// | [`painting::PaintingPlugin`] | weights by hand: brushes, normalising, pruning, copying between meshes |
/// | [`face::FacePlugin`] | faces: bones, weights and expressions |
/// | [`fit::FitPlugin`] | templates moved into meshes |
/// | [`mesh_reload::MeshReloadPlugin`] | meshes exchanged for other versions of them, with their weights |
/// | [`runtime::RuntimePlugin`] | compiled rigs that run each frame |
/// | [`animation::ClipPlugin`] | clips that play on rigs; keys set with each pose |
/// | [`journal::JournalPlugin`] | every change stored at once, for rigs that request it |
///
/// Each plugin can be left out or replaced, as in any [`PluginGroup`]:
///
/// ```
/// use bevy::prelude::*;
/// use rigsmith::{plugins::journal::JournalPlugin, prelude::*};
///
/// let mut app = App::new();
/// app.add_plugins((MinimalPlugins, TransformPlugin, RigPlugins.build().disable::<JournalPlugin>()));
/// ```
pub struct RigPlugins;

impl PluginGroup for RigPlugins {
    fn build(self) -> PluginGroupBuilder {
        PluginGroupBuilder::start::<Self>()
            .add(document::DocumentPlugin)
            .add(commands::CommandsPlugin)
            .add(stage::StagePlugin)
            .add(controls::ControlsPlugin)
            .add(surface::SurfacePlugin)
            .add(picking::PickingPlugin)
            .add(placement::PlacementPlugin)
            .add(stroke::StrokePlugin)
            .add(gesture::GesturePlugin)
            .add(skinning::SkinningPlugin)
            .add(painting::PaintingPlugin)
            .add(face::FacePlugin)
            .add(fit::FitPlugin)
            .add(mesh_reload::MeshReloadPlugin)
            .add(runtime::RuntimePlugin)
            .add(animation::ClipPlugin)
            .add(journal::JournalPlugin)
    }
}

/// Order of the systems of rigs. Unless they say otherwise they are in `Update`, in this order.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RigSystems {
    /// Turns scripted gestures into requests.
    Script,
    /// Carries out pick requests, which change selections.
    Pick,
    /// Turns place and stroke requests into edit requests.
    Gesture,
    /// Carries out edit, undo and redo requests: the only place where rigs change.
    Edits,
    /// Writes changes of rigs to their joint entities.
    Build,
    /// Writes changed weights to meshes; starts background skinning and takes over its results.
    Bind,
    /// Runs rigs in `PostUpdate`, between Bevy's animation and its propagation of transforms.
    Solve,
    /// Writes world transforms of instances' joints in games, in `PostUpdate`, at the end of the propagation of
    /// transforms.
    Scatter,
    /// Has surfaces follow changed poses, in `PostUpdate`, after transforms have propagated.
    Surface,
}

/// Task pools in which a long task (weights, a file) does not delay a short one (the surface of a pose, a stroke): at
/// least four background threads, where Bevy takes one on a small machine. Set it on `MinimalPlugins` or
/// `DefaultPlugins` of the first app in a process.
pub fn task_pools() -> TaskPoolPlugin {
    let mut task_pool_options = TaskPoolOptions::default();
    task_pool_options.async_compute.min_threads = 4;
    TaskPoolPlugin { task_pool_options }
}

/// Orders [`RigSystems`]; added by every plugin of [`RigPlugins`], harmless when repeated.
pub(crate) fn configure_sets(app: &mut App) {
    app.configure_sets(
        Update,
        (
            RigSystems::Script,
            RigSystems::Pick,
            RigSystems::Gesture,
            RigSystems::Edits,
            RigSystems::Build,
            RigSystems::Bind,
        )
            .chain(),
    )
    .configure_sets(
        PostUpdate,
        (
            RigSystems::Solve.after(AnimationSystems).before(TransformSystems::Propagate),
            // The set is inside the propagation, so that systems after it see these joints, too.
            RigSystems::Scatter.in_set(TransformSystems::Propagate).after(sync_simple_transforms),
            RigSystems::Surface.after(TransformSystems::Propagate),
        ),
    );
}
