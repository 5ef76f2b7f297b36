//! Command modules: what a tag can do, one a file.
//!
//! A module is a type whose fields are the parameters of its tag; see [`RigModule`](crate::processor::RigModule). A module
//! needs its own file and one line in [`register`]; one from outside is registered the same way with
//! [`Modules::add`].

pub mod aim;
pub mod attribute;
pub mod blend;
pub mod cone_reader;
pub mod control;
pub mod driven_key;
pub mod duplicate_chain;
pub mod expression;
pub mod follow;
pub mod half_joint;
pub mod ik_fk_switch;
pub mod ik_handle;
pub mod insert_joints;
pub mod layer;
pub mod limit;
pub mod mirror_joints;
pub mod morph;
pub mod null;
pub mod orient_joints;
pub mod path;
pub mod piston;
pub mod pole_vector;
pub mod rbf_reader;
pub mod reverse_foot;
pub mod rivet;
pub mod space_switch;
pub mod spline_ik;
pub mod spring;
pub mod stretch;
pub mod twist;
pub mod wheel;

use crate::processor::Modules;

/// Registers every module of this crate.
pub fn register(modules: &mut Modules) {
    modules.add::<aim::AimModule>();
    modules.add::<attribute::AttributeModule>();
    modules.add::<blend::BlendModule>();
    modules.add::<cone_reader::ConeReader>();
    modules.add::<control::ControlModule>();
    modules.add::<driven_key::DrivenKey>();
    modules.add::<duplicate_chain::DuplicateChainModule>();
    modules.add::<expression::Expression>();
    modules.add::<half_joint::HalfJoint>();
    modules.add::<ik_fk_switch::IkFkSwitch>();
    modules.add::<ik_handle::IkHandle>();
    modules.add::<insert_joints::InsertJointsModule>();
    modules.add::<layer::LayerModule>();
    modules.add::<limit::LimitModule>();
    modules.add::<mirror_joints::MirrorJointsModule>();
    modules.add::<morph::Morph>();
    modules.add::<null::NullModule>();
    modules.add::<follow::OrientModule>();
    modules.add::<orient_joints::OrientJointsModule>();
    modules.add::<follow::ParentModule>();
    modules.add::<path::Path>();
    modules.add::<piston::Piston>();
    modules.add::<follow::PointModule>();
    modules.add::<pole_vector::PoleVectorModule>();
    modules.add::<rbf_reader::RbfReader>();
    modules.add::<reverse_foot::ReverseFoot>();
    modules.add::<rivet::Rivet>();
    modules.add::<follow::ScaleModule>();
    modules.add::<space_switch::SpaceSwitch>();
    modules.add::<spline_ik::SplineIk>();
    modules.add::<spring::Spring>();
    modules.add::<stretch::Stretch>();
    modules.add::<twist::Twist>();
    modules.add::<wheel::Wheel>();
}

/// Every module of this crate.
pub fn all() -> Modules {
    let mut modules = Modules::new();
    register(&mut modules);
    modules
}
