//! Common imports of games and tools that use Rigsmith.
//!
//! - Characters of a game: [`RigInstance`] on a [`RigTemplate`], posed with [`ControlPoses`] on the nodes that
//!   [`InstanceNodes`] finds; [`RigSource`] where people edit the rig in the app.
//! - Rigs that are edited: [`Rig`], [`EditRequest`] with an [`Operation`] or [`RigEdit`]s, answered by an [`EditReport`] or
//!   an [`EditRefusal`].
//! - Tools of a viewport: [`PickRequest`], [`PlaceRequest`], [`StrokeRequest`] and lists of [`Gesture`]s, whose rays and
//!   views are in the rig's space; [`BindRequest`] for weights.
//!
//! Lengths have the unit of the mesh, angles are radians in code and degrees in templates, poses are relative to rest.

pub use crate::{
    algo::{
        placement::PlaceSettings,
        stroke::{ChainChoice, StrokeSettings},
        view::{View, ViewPlane},
        weights::WeightSettings,
    },
    files::{RealDisk, load_model},
    instance::{
        AcceptUpdate, ControlPoses, InstanceNodes, RigBuilt, RigFailed, RigInstance, RigInstancePlugin, RigSource,
        RigTemplate, RigUpdated, TemplateFiles, UpdateOffer,
    },
    plugins::{
        RigPlugins, RigSystems,
        commands::BuildResult,
        controls::ControlsInUse,
        document::{Change, EditRefusal, EditReport, EditRequest, Joint, NodeOf, Selection, Symmetry},
        gesture::{Gesture, GestureScript},
        picking::{HoverJoint, HoverRequest, Pick, PickAnswer, PickRequest},
        placement::{PlaceAnswer, PlaceRequest},
        runtime::{HandOver, InstanceMode, OutsideTransform, RigInputs},
        skinning::{BindAnswer, BindRequest},
        stage::{RigStage, StageRequest},
        stroke::{FollowedStroke, StrokeDone, StrokeParent, StrokeRequest, StrokeResult},
        surface::{RigMesh, RigSurface, SkinOf},
    },
    rig::{PoseOffset, Rig, RigEdit, Uid, UidSource, operations::Operation},
};
#[cfg(feature = "draw")]
pub use crate::{
    instance::SharedMesh,
    plugins::{
        display::{DisplayPlugin, MeshDisplay},
        drawing::{DrawingPlugin, RigDrawing},
        viewport::RigViewport,
    },
};
