//! Draws a sheet of meshes, each with the template that was fitted into it and, beside it, the skinned figure with that skeleton
//! posed.
//!
//! ```text
//! RIGSMITH_DATA=DATA cargo run --release --example fit_sheet -- --screenshot docs/fit.png
//! cargo run --release --example fit_sheet -- MESH...
//! ```
//!
//! The meshes that are named, else those of the folder of test meshes that `RIGSMITH_DATA` names, else the bundled body. The
//! sheet is written to `fit_sheet.png` in the current folder, or to the file after `--screenshot`.

use std::{
    error::Error,
    path::{Path, PathBuf},
    sync::Arc,
};

use bevy::math::{Quat, UVec2};
use rigsmith::{
    algo::view::View,
    files::{RealDisk, bundled_characters, load_model, save_atomic},
    headless::Workbench,
    plugins::{display::MeshDisplay, drawing::RigDrawing, fit::FitTemplates},
    render::{PictureSettings, png, take_picture},
    rig::{PoseOffset, operations::Operation},
};

/// Width and height of one picture in pixels, and the number of figures in a row.
const TILE: UVec2 = UVec2::new(300, 400);
const COLUMNS: u32 = 4;

/// Meshes of the sheet, in the folder of test meshes.
const MESHES: [&str; 16] = [
    "bodies/male_young/body.obj",
    "bodies/female_young/body.obj",
    "bodies/female_heavy_tpose/body.obj",
    "bodies/female_young_armsdown/body.obj",
    "bodies/male_muscular_action/body.obj",
    "bodies/male_child_tpose/body.obj",
    "bodies/baby/body.obj",
    "gltf_skinned/CesiumMan.glb",
    "gltf_skinned/RobotExpressive.glb",
    "characters/Mage.glb",
    "hands/webxr_generic_hand_left.glb",
    "creatures/fox-fox.glb",
    "creatures/fox-dog.glb",
    "gltf_skinned/Fox.glb",
    "creatures/spot.obj",
    "creatures/bird-eagle.glb",
];

/// The file of the sheet and its meshes, as arguments and `RIGSMITH_DATA` name them.
fn asked() -> Result<(PathBuf, Vec<PathBuf>), Box<dyn Error>> {
    let mut sheet = PathBuf::from("fit_sheet.png");
    let mut meshes = Vec::new();
    let mut arguments = std::env::args_os().skip(1);
    while let Some(argument) = arguments.next() {
        if argument == "--screenshot" {
            sheet = arguments.next().ok_or("name a file after --screenshot")?.into();
        } else {
            meshes.push(PathBuf::from(argument));
        }
    }
    if meshes.is_empty() {
        match std::env::var_os("RIGSMITH_DATA").filter(|folder| !folder.is_empty()) {
            Some(folder) => meshes.extend(MESHES.map(|mesh| Path::new(&folder).join(mesh))),
            None => meshes.push(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/models/biped.obj").into()),
        }
    }
    Ok((sheet, meshes))
}

fn main() -> Result<(), Box<dyn Error>> {
    let (sheet, meshes) = asked()?;
    let mut tiles = Vec::new();
    for mesh in &meshes {
        match pictures(mesh) {
            Ok(pictures) => tiles.extend(pictures),
            Err(error) => eprintln!("{}: {error}", mesh.display()),
        }
    }
    if tiles.is_empty() {
        return Err("no mesh has been fitted; nothing is written".into());
    }
    let columns = (2 * COLUMNS).min(tiles.len() as u32);
    let rows = (tiles.len() as u32).div_ceil(columns);
    let mut all = image::RgbImage::new(columns * TILE.x, rows * TILE.y);
    for (tile, number) in tiles.iter().zip(0..) {
        let (x, y) = (number % columns * TILE.x, number / columns * TILE.y);
        image::imageops::replace(&mut all, tile, i64::from(x), i64::from(y));
    }
    let mut bytes = std::io::Cursor::new(Vec::new());
    all.write_to(&mut bytes, image::ImageFormat::Png)?;
    save_atomic(&RealDisk, &sheet, &bytes.into_inner())?;
    println!("wrote {}: {} figures", sheet.display(), tiles.len() / 2);
    Ok(())
}

/// The fitted skeleton in a mesh, and the mesh in a pose of it.
fn pictures(mesh: &Path) -> Result<[image::RgbImage; 2], Box<dyn Error>> {
    let mut bench = Workbench::new(1, "fit");
    bench.open(load_model(&RealDisk, mesh)?, true)?;
    bench.offer_templates(FitTemplates(Arc::new(bundled_characters)));
    let report = bench.fit(|_| (), &mut |_| ())?;
    let doubtful: Vec<_> = report.doubtful().collect();
    println!("{}: {} with confidence {:.2}", mesh.display(), report.template, report.fit.confidence);
    let settings = PictureSettings {
        size: TILE,
        view: View::Orbit(20.0, 8.0),
        display: MeshDisplay { xray: true, ..MeshDisplay::default() },
        drawing: RigDrawing { grid: false, ..RigDrawing::default() },
        selected: doubtful,
        ..PictureSettings::default()
    };
    let take = |bench: &Workbench, settings: &PictureSettings| -> Result<image::RgbImage, Box<dyn Error>> {
        let image = take_picture(bench.rig().clone(), bench.mesh().cloned().into_iter().collect(), settings)?;
        Ok(image::load_from_memory(&png(image)?)?.to_rgb8())
    };
    let fitted = take(&bench, &settings)?;
    bench.skin(Default::default(), Vec::new(), &mut |_| {})?;
    // Elbows, knees and the head bend, whatever the template.
    let bends =
        [("forearm", 50.0), ("shin", 40.0), ("upper_arm", -25.0), ("thigh", -30.0), ("head", 20.0), ("carpus", 30.0)];
    let mut pose = Vec::new();
    for joint in bench.rig().walk() {
        let label = joint.data.label.as_deref().unwrap_or_default();
        let bend = bends.iter().find(|(name, _)| label.starts_with(name) && !label.ends_with("_r"));
        if let Some((_, degrees)) = bend {
            let rotation = Quat::from_rotation_x(f32::to_radians(*degrees));
            pose.push((joint.data.uid, PoseOffset { rotation, ..PoseOffset::default() }));
        }
    }
    bench.operate(Operation::Pose(pose))?;
    let settings = PictureSettings {
        display: MeshDisplay::default(),
        drawing: RigDrawing { rig: false, grid: false, ..RigDrawing::default() },
        selected: Vec::new(),
        ..settings
    };
    Ok([fitted, take(&bench, &settings)?])
}
