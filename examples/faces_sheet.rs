//! Draws heads in six expressions and two densities, as in the README.
//!
//! ```text
//! cargo run --release --example faces_sheet -- docs/faces.png HEAD.obj...
//! ```

use std::{collections::BTreeMap, error::Error, path::Path};

use bevy::{asset::RenderAssetUsages, math::UVec2, prelude::*, render::render_resource::Extent3d};
use rigsmith::{
    algo::{
        face::{auto::AutoSettings, expression::ExpressionSet},
        view::View,
    },
    files::{RealDisk, load_model, save_atomic, stem},
    headless::Workbench,
    plugins::drawing::{LabelChoice, RigDrawing},
    render::{PictureSettings, png, take_picture},
};

/// Pixels of one picture of the sheet.
const CELL: UVec2 = UVec2::new(160, 176);

/// Bones of the upper and of the lower row of each head.
const DENSITIES: [usize; 2] = [20, 60];

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let output = arguments.next().ok_or("say where to write: FILE.png HEAD...")?;
    let heads: Vec<String> = arguments.collect();
    let mut rows = Vec::new();
    for head in &heads {
        for bones in DENSITIES {
            println!("{} with {bones} bones", stem(Path::new(head)));
            rows.push(row(Path::new(head), bones)?);
        }
    }
    let columns = rows.first().map_or(0, Vec::len);
    let size =
        Extent3d { width: CELL.x * columns as u32, height: CELL.y * rows.len() as u32, depth_or_array_layers: 1 };
    let first = rows.first().and_then(|row| row.first()).ok_or("give at least one head")?;
    let format = first.texture_descriptor.format;
    let mut bytes = vec![255; (size.width * size.height * 4) as usize];
    for (y, row) in rows.iter().enumerate() {
        for (x, cell) in row.iter().enumerate() {
            let data = cell.data.as_ref().ok_or("a picture without pixels")?;
            for line in 0..CELL.y as usize {
                let to = ((y * CELL.y as usize + line) * size.width as usize + x * CELL.x as usize) * 4;
                let from = line * CELL.x as usize * 4;
                let length = CELL.x as usize * 4;
                bytes[to..to + length].copy_from_slice(&data[from..from + length]);
            }
        }
    }
    let sheet = Image::new(size, first.texture_descriptor.dimension, bytes, format, RenderAssetUsages::MAIN_WORLD);
    save_atomic(&RealDisk, Path::new(&output), &png(sheet)?)?;
    println!("wrote {output}");
    Ok(())
}

/// One head: where its bones are, then the six expressions.
fn row(head: &Path, bones: usize) -> Result<Vec<Image>, Box<dyn Error>> {
    let mut bench = Workbench::new(1, "face");
    bench.open(load_model(&RealDisk, head)?, true)?;
    bench.face(AutoSettings { bones, ..AutoSettings::default() }, None, &mut |_, _| {})?;
    let mut pictures = vec![picture(&bench, true)?];
    for expression in ExpressionSet::bundled().six() {
        bench.express(BTreeMap::from([(expression.name.clone(), 1.0)]))?;
        pictures.push(picture(&bench, false)?);
    }
    Ok(pictures)
}

fn picture(bench: &Workbench, rig: bool) -> Result<Image, Box<dyn Error>> {
    let drawing = RigDrawing { rig, grid: false, labels: LabelChoice::None, ball_scale: 0.4, ..RigDrawing::default() };
    let bounds = bench.placed_face().map(|face| face.analysis.face_box());
    let settings = PictureSettings { size: CELL, view: View::Front, drawing, bounds, ..PictureSettings::default() };
    let mesh = bench.mesh().ok_or("no mesh")?.clone();
    Ok(take_picture(bench.rig().clone(), vec![mesh], &settings)?)
}
