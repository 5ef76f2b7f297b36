//! Common imports of games and tools that use Rigsmith.

pub use crate::{
    algo::{
        placement::PlaceSettings,
        stroke::{ChainChoice, StrokeSettings},
        view::{View, ViewPlane},
        weights::WeightSettings,
    },
    plugins::{
        RigPlugins, RigSystems,
        document::{Change, EditRefused, EditRequest, Edited, Joint, NodeOf, Selection, Symmetry},
        gesture::{Gesture, GestureScript},
        picking::{HoverJoint, HoverRequest, Pick, PickRequest, Picked},
        placement::{PlaceRequest, Placed},
        skinning::{BindRequest, Bound},
        stroke::{FollowedStroke, StrokeDone, StrokeParent, StrokeRequest, StrokeResult},
        surface::{RigMesh, RigSurface, SkinOf},
    },
    rig::{Rig, RigEdit, Uid, UidSource, operations::Operation},
};
