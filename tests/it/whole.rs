//! Whole paths through the library, from bytes that a generator turns into an input, to files that are read again.
//!
//! Each module has one function `check`, which panics where a promise is broken. Memory and time stay bounded, because the
//! inputs are small and the limits of builds are set low: what would go over them has to end in an error that names the limit.
//! The tests here and the coverage-guided targets in `fuzz/` share these files, so the paths of the modules are written out.

#[path = "whole/calls.rs"]
pub mod calls;
#[path = "whole/clip.rs"]
pub mod clip;
#[path = "whole/edits.rs"]
pub mod edits;
#[path = "whole/entities.rs"]
pub mod entities;
#[path = "whole/gestures.rs"]
pub mod gestures;
#[path = "whole/memory_disk.rs"]
pub mod memory_disk;
#[path = "whole/mesh.rs"]
pub mod mesh;
#[path = "whole/pose.rs"]
pub mod pose;
#[path = "whole/project.rs"]
pub mod project;
#[path = "whole/promises.rs"]
pub mod promises;
#[path = "whole/skin.rs"]
pub mod skin;
#[path = "whole/template.rs"]
pub mod template;
#[path = "whole/update.rs"]
pub mod update;

use std::sync::{Arc, LazyLock};

use rigsmith::{
    modules,
    processor::{BuildLimits, BuildProblem, Builder, ModuleError, Modules},
    rig::{BuiltRig, Rig},
};

/// Limits of builds: far above what a made template needs, far below what one that names everything would make.
pub const LIMITS: BuildLimits = BuildLimits { made: 600, attributes: 32, work: 200_000 };

/// Values that one command may read and write beyond the limit before it is looked at.
const OVER: u64 = 2_000_000;

/// The modules, with low limits.
pub fn limited() -> Arc<Modules> {
    static MODULES: LazyLock<Arc<Modules>> = LazyLock::new(|| {
        let mut modules = modules::all();
        modules.limits = LIMITS;
        Arc::new(modules)
    });
    MODULES.clone()
}

/// Builds a rig within the limits; the error of a build that stopped is one that says what to do.
pub fn build(rig: &Rig) -> Option<BuiltRig> {
    let mut builder = Builder::new(limited());
    builder.sync(rig);
    let report = builder.run_all();
    check_limits(&builder, rig);
    match report.error {
        None => Some(builder.built()),
        Some(error) => {
            promises::error(&error);
            if let BuildProblem::Module(ModuleError::TooMany { name, limit, .. }) = &error.problem {
                let known = [("nodes", LIMITS.made), ("attributes", LIMITS.attributes), ("work", LIMITS.work as usize)];
                assert!(known.contains(&(*name, *limit)), "{error}");
            }
            None
        }
    }
}

/// Fails where a build has made, or done, more than its limits allow.
pub fn check_limits(builder: &Builder, rig: &Rig) {
    let built = builder.built();
    let made = built.nodes.iter().filter(|node| node.origin.is_some()).count() + built.constraints.len();
    assert!(made <= LIMITS.made, "{made} nodes and constraints of {} joints", rig.len());
    assert!(built.nodes.iter().all(|node| node.attributes.len() <= LIMITS.attributes));
    assert!(builder.work() <= LIMITS.work + OVER, "{} values for {} joints", builder.work(), rig.len());
}

/// Lines of a text, for places in errors.
pub fn lines(text: &str) -> usize {
    1 + text.bytes().filter(|byte| *byte == b'\n').count()
}
