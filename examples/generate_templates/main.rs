//! Makes `assets/templates/**/*.rig.ron`: parts, and characters that are made of them.
//!
//! `cargo run --release --example generate_templates` writes the files; a test compares them with what is written here.

pub mod parts;
pub mod whole;
pub mod writer;

use std::path::Path;

use rigsmith::{
    files::{RealDisk, store_rig},
    rig::Rig,
};

use writer::{Failure, Writer};

/// Every template with its path below `assets/templates`.
///
/// # Errors
/// The first thing that went wrong while one was written.
pub fn templates() -> Result<Vec<(String, Rig)>, Failure> {
    let mut list = Vec::new();
    for (name, write) in parts::ALL {
        list.push((format!("parts/{name}.rig.ron"), finished(write())?));
    }
    for (name, write) in whole::ALL {
        list.push((format!("{name}.rig.ron"), finished(write()?)?));
    }
    Ok(list)
}

fn finished(writer: Writer) -> Result<Rig, Failure> {
    writer.finish()
}

#[allow(dead_code)] // a test reads this file as a module
fn main() -> Result<(), Failure> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates");
    std::fs::create_dir_all(folder.join("parts"))?;
    for (path, rig) in templates()? {
        let tags = rig.walk().map(|joint| joint.data.tags.len()).sum::<usize>();
        println!("{path}: {} joints, {tags} tags", rig.len());
        store_rig(&RealDisk, &folder.join(path), &rig)?;
    }
    Ok(())
}
