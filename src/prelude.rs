//! Common imports of games and tools that use Rigsmith.

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
