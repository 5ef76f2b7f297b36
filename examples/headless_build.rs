//! A pipeline's step without window and renderer: builds a template, binds a mesh, poses the character, and writes a GLB file.
//!
//! ```text
//! cargo run --no-default-features --example headless_build -- out.glb
//! cargo run --example headless_build -- out.glb --screenshot headless_build.png
//! ```

use std::path::Path;

use bevy::prelude::*;
use rigsmith::{
    algo::weights::WeightSettings,
    files::{RealDisk, load_model, load_template, store_model},
    headless::{Workbench, posing::ControlWrite},
    mesh::gltf::GltfWriteSettings,
    plugins::commands::BuildStep,
};

fn main() -> Result {
    let mut words = std::env::args().skip(1).peekable();
    let out = words.next_if(|word| !word.starts_with("--")).unwrap_or_else(|| "biped.glb".to_owned());
    let template = load_template(&RealDisk, Path::new("assets/templates/biped.rig.ron"))?;
    let mut bench = Workbench::with_rig(1, template.rig);
    bench.open(load_model(&RealDisk, Path::new("assets/models/biped.obj"))?, true)?;
    let report = bench.build(BuildStep::All);
    println!("{} commands ran", report.executed.len());
    let bound = bench.skin(WeightSettings::default(), Vec::new(), &mut |_| {})?;
    println!("{bound:?}");
    let writes: Vec<ControlWrite> = vec!["hand_ik_l.translate=(0.1,0.6,0.2)".parse()?];
    bench.pose(&writes)?;
    for node in bench.nodes()?.iter().filter(|node| node.node.name.starts_with("hand_")) {
        println!("{:<20} {:.3}", node.node.name, node.entity.translation);
    }
    store_model(&RealDisk, Path::new(&out), &bench.character(), &GltfWriteSettings::default())?;
    println!("wrote {out}");
    match words.next().as_deref() {
        Some("--screenshot") => picture(&bench, &words.next().unwrap_or_else(|| "headless_build.png".to_owned())),
        _ => Ok(()),
    }
}

/// Writes a picture of the posed character.
#[cfg(feature = "render")]
fn picture(bench: &Workbench, file: &str) -> Result {
    use rigsmith::render::{PictureSettings, png, take_picture};

    let meshes = bench.mesh().cloned().into_iter().collect();
    let picture = take_picture(bench.posed_document()?, meshes, &PictureSettings { build: true, ..default() })?;
    std::fs::write(file, png(picture)?)?;
    Ok(())
}

#[cfg(not(feature = "render"))]
fn picture(_: &Workbench, file: &str) -> Result {
    Err(format!("cannot draw {file}: this was built without the feature `render`").into())
}
