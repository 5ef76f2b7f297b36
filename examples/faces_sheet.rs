//! Draws heads in six expressions and two densities, as in the README, above the same expressions summed from given
//! shapes.
//!
//! ```text
//! cargo run --release --example faces_sheet -- docs/faces.png SHAPES.json HEAD.obj...
//! ```
//!
//! The shapes have the names of ARKit. Heads with another number of points than the shapes have no row of sums.

use std::{collections::BTreeMap, error::Error, path::Path};

use bevy::{asset::RenderAssetUsages, math::UVec2, prelude::*, render::render_resource::Extent3d};
use rigsmith::{
    algo::{
        face::{
            auto::AutoSettings,
            expression::{Expression, ExpressionSet, Mix, Sides},
        },
        view::View,
    },
    files::{RealDisk, load_model, load_shapes, save_atomic, stem},
    headless::Workbench,
    mesh::{model::Model, shapes::Shapes},
    plugins::drawing::{LabelChoice, RigDrawing},
    render::{PictureSettings, png, take_picture},
};

/// Pixels of one picture of the sheet.
const CELL: UVec2 = UVec2::new(160, 176);

/// Bones of the upper and of the lower row of each head.
const DENSITIES: [usize; 2] = [20, 60];

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let output = arguments.next().ok_or("say where to write: FILE.png SHAPES.json HEAD...")?;
    let shapes = arguments.next().ok_or("say where the shapes are: FILE.png SHAPES.json HEAD...")?;
    let heads: Vec<String> = arguments.collect();
    let mut rows = Vec::new();
    for head in &heads {
        for bones in DENSITIES {
            println!("{} with {bones} bones", stem(Path::new(head)));
            rows.push(row(Path::new(head), bones)?);
        }
        let model = load_model(&RealDisk, Path::new(head))?;
        match load_shapes(&RealDisk, Path::new(&shapes), &model) {
            Ok(shapes) => {
                println!("{} by its shapes", stem(Path::new(head)));
                rows.push(row_of_sums(&model, &shapes)?);
            }
            Err(error) => println!("no row of sums: {error}"),
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

/// The head at rest, then the six expressions as sums of shapes.
fn row_of_sums(model: &Model, shapes: &Shapes) -> Result<Vec<Image>, Box<dyn Error>> {
    let mut rest = Workbench::new(1, "face");
    rest.open(model.clone(), true)?;
    rest.face(AutoSettings::default(), None, &mut |_, _| {})?;
    let bounds = rest.placed_face().map(|face| face.analysis.face_box());
    let mut pictures = Vec::new();
    for expression in std::iter::once(None).chain(ExpressionSet::bundled().six().map(Some)) {
        let mut moved = model.clone();
        if let Some(expression) = expression {
            add_shapes(&mut moved, expression, shapes);
        }
        let mut bench = Workbench::new(1, "shapes");
        bench.open(moved, true)?;
        pictures.push(drawn(&bench, false, bounds)?);
    }
    Ok(pictures)
}

/// Moves the points of a model by the shapes of an expression's units.
fn add_shapes(model: &mut Model, expression: &Expression, shapes: &Shapes) {
    let units = ExpressionSet::bundled().unit_set();
    let mix = Mix::of(&[(expression, 1.0)], units);
    for (name, moved) in shapes.names.iter().zip(&shapes.displacements) {
        // The shape of the cheek muscle alone; ARKit has it with the lids.
        let cheek = name
            .strip_prefix("cheekRaiser_")
            .and_then(|side| Some((units.index("cheek_raise")?, if side == "L" { Sides::Left } else { Sides::Right })));
        let Some((unit, side)) = cheek.or_else(|| units.arkit(name)) else { continue };
        let sides = mix.strengths[unit];
        let strength = match side {
            Sides::Left => sides[0],
            Sides::Right => sides[1],
            _ => 0.5 * (sides[0] + sides[1]),
        };
        for (point, moved) in model.points.iter_mut().zip(moved) {
            *point += *moved * strength;
        }
    }
    for part in &mut model.parts {
        part.normals.clear();
    }
}

fn picture(bench: &Workbench, rig: bool) -> Result<Image, Box<dyn Error>> {
    drawn(bench, rig, bench.placed_face().map(|face| face.analysis.face_box()))
}

fn drawn(bench: &Workbench, rig: bool, bounds: Option<[Vec3; 2]>) -> Result<Image, Box<dyn Error>> {
    let drawing = RigDrawing { rig, grid: false, labels: LabelChoice::None, ball_scale: 0.4, ..RigDrawing::default() };
    let settings = PictureSettings { size: CELL, view: View::Front, drawing, bounds, ..PictureSettings::default() };
    let mesh = bench.mesh().ok_or("no mesh")?.clone();
    Ok(take_picture(bench.rig().clone(), vec![mesh], &settings)?)
}
