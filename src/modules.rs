//! Command modules: what a tag can do, one a file.
//!
//! A module is a type whose fields are the parameters of its tag; see [`RigModule`](crate::build::RigModule). A module
//! needs its own file and one line in [`register`]; one from outside is registered the same way with
//! [`Modules::add`].

pub mod attribute;
pub mod driven_key;
pub mod expression;
pub mod ik_fk_switch;
pub mod ik_handle;
pub mod morph;
pub mod reverse_foot;
pub mod space_switch;
pub mod spline_ik;
pub mod spring;
pub mod stretch;
pub mod twist;

use crate::build::Modules;

/// Registers every module of this crate.
pub fn register(modules: &mut Modules) {
    modules.add::<attribute::AttributeModule>();
    modules.add::<driven_key::DrivenKey>();
    modules.add::<expression::Expression>();
    modules.add::<ik_fk_switch::IkFkSwitch>();
    modules.add::<ik_handle::IkHandle>();
    modules.add::<morph::Morph>();
    modules.add::<reverse_foot::ReverseFoot>();
    modules.add::<space_switch::SpaceSwitch>();
    modules.add::<spline_ik::SplineIk>();
    modules.add::<spring::Spring>();
    modules.add::<stretch::Stretch>();
    modules.add::<twist::Twist>();
}

/// Every module of this crate.
pub fn all() -> Modules {
    let mut modules = Modules::new();
    register(&mut modules);
    modules
}
