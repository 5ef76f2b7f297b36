//! Options of the linker that keep commands small in memory.
//!
//! The table of relocations, which the loader reads whole at every start, takes a few hundredths of its size where it is packed.
//! Functions that run once at the start stand together, so that few pages of the program are read for them. Linkers that do
//! not know an option pass over it with a warning.

use std::{env, process::Command};

/// First version of the GNU C library whose loader reads packed relocations.
const PACKED_RELOCATIONS: (u32, u32) = (2, 36);

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rustc-check-cfg=cfg(has_packed_relocations)");
    let of_target = |name: &str| env::var(name).unwrap_or_default();
    if of_target("CARGO_CFG_TARGET_OS") != "linux" || of_target("CARGO_CFG_TARGET_ENV") != "gnu" {
        return;
    }
    println!("cargo:rustc-link-arg-bins=-Wl,-z,keep-text-section-prefix");
    // The loader of another machine is not known.
    let is_for_this_machine = of_target("HOST") == of_target("TARGET");
    if is_for_this_machine && c_library_version().is_some_and(|version| version >= PACKED_RELOCATIONS) {
        println!("cargo:rustc-link-arg-bins=-Wl,-z,pack-relative-relocs");
        println!("cargo:rustc-cfg=has_packed_relocations");
    }
}

/// Version of this machine's GNU C library: `glibc 2.39` is (2, 39).
fn c_library_version() -> Option<(u32, u32)> {
    let told = Command::new("getconf").arg("GNU_LIBC_VERSION").output().ok()?;
    let told = String::from_utf8(told.stdout).ok()?;
    let (major, minor) = told.trim().strip_prefix("glibc ")?.split_once('.')?;
    Some((major.parse().ok()?, minor.split('.').next()?.parse().ok()?))
}
