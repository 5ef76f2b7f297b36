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
        commands::Built,
        controls::ControlsInUse,
        document::{Change, EditRefused, EditRequest, Edited, Joint, NodeOf, Selection, Symmetry},
        gesture::{Gesture, GestureScript},
        picking::{HoverJoint, HoverRequest, Pick, PickRequest, Picked},
        placement::{PlaceRequest, Placed},
        runtime::{HandOver, InstanceMode, OutsideTransform, RigInputs},
        skinning::{BindRequest, Bound},
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
