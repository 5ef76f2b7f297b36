//! Command modules: what a tag can do, one a file.
//!
//! A module is a type whose fields are the parameters of its tag; see [`RigModule`](crate::build::RigModule). A module
//! needs its own file and one line in [`register`]; one from outside is registered the same way with
//! [`Modules::add`].

pub mod attribute;
pub mod ik_fk_switch;
pub mod ik_handle;

use crate::build::Modules;

/// Registers every module of this crate.
pub fn register(modules: &mut Modules) {
    modules.add::<attribute::AttributeModule>();
    modules.add::<ik_fk_switch::IkFkSwitch>();
    modules.add::<ik_handle::IkHandle>();
}

/// Every module of this crate.
pub fn all() -> Modules {
    let mut modules = Modules::new();
    register(&mut modules);
    modules
}
