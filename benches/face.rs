//! Faces, from a click to the skinned face: the bundled head, the heads of the test data and one of them subdivided, at
//! several densities; and the expressions, units and shapes of ARKit of these faces.
//!
//! Prints a line for people and one JSON line for each. Times are medians of several runs through the plugins, the edit
//! of the rig included; those of one expression are of the algorithm, points included.
//!
//! ```text
//! RIGSMITH_DATA=DATA cargo bench --no-default-features --bench face
//! ```

#[path = "face/expressions.rs"]
mod expressions;

use std::{collections::BTreeMap, error::Error, path::Path, time::Instant};

use bevy::math::Vec3;
use rigsmith::{
    algo::face::auto::AutoSettings,
    files::{RealDisk, load_model},
    headless::Workbench,
    mesh::{adjacency::edges, model::Model},
    plugins::face::FaceReport,
};

fn main() -> Result<(), Box<dyn Error>> {
    let bundled = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/head.obj");
    let bundled = load_model(&RealDisk, &bundled)?;
    for bones in [20, 40, 80] {
        row("the bundled head", &bundled, bones, 9)?;
    }
    let Some(data) = std::env::var_os("RIGSMITH_DATA") else {
        println!("skipped: RIGSMITH_DATA names no folder with test meshes");
        return Ok(());
    };
    let heads = Path::new(&data).join("heads");
    for name in ["ict_neutral", "ict_identity_1", "ict_identity_2", "ict_identity_3", "lee_perry_smith"] {
        let model = load_model(&RealDisk, &heads.join(format!("{name}.obj")))?;
        for bones in [20, 40, 80] {
            row(name, &model, bones, 9)?;
        }
    }
    let model = subdivided(&load_model(&RealDisk, &heads.join("ict_neutral.obj"))?);
    row("ict_neutral, subdivided once", &model, 40, 5)
}

/// One line of the table.
fn row(name: &str, model: &Model, bones: usize, runs: usize) -> Result<(), Box<dyn Error>> {
    let mut times = Vec::new();
    let mut slides = Vec::new();
    let mut report = FaceReport::default();
    let mut placed = None;
    for _ in 0..runs {
        let mut bench = Workbench::new(1, name);
        bench.open(model.clone(), true)?;
        let start = Instant::now();
        report = bench.face(AutoSettings { bones, ..AutoSettings::default() }, None, &mut |_, _| {})?;
        times.push(start.elapsed().as_secs_f64() * 1e3);
        let before = bench.rig().pose().len();
        bench.express(BTreeMap::from([("happiness".to_owned(), 1.0)]))?;
        assert!(bench.rig().pose().len() > before, "an expression moves something");
        // A slider that is dragged.
        for step in 1..=9 {
            let start = Instant::now();
            bench.express(BTreeMap::from([("happiness".to_owned(), 0.1 * step as f32)]))?;
            slides.push(start.elapsed().as_secs_f64() * 1e3);
        }
        bench.express(BTreeMap::new())?;
        placed = Some(bench);
    }
    let [median, slide] = [times, slides].map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    });
    let steps: Vec<String> =
        report.times.iter().map(|(step, time)| format!("\"{step}\": {:.2}", time.as_secs_f64() * 1e3)).collect();
    println!(
        "{name}: {} points, {bones} bones, {median:.0} ms from click to skinned face, {slide:.1} ms a slider's step, {} folds",
        model.points.len(),
        report.folds
    );
    println!(
        "{{\"head\": \"{name}\", \"points\": {}, \"bones\": {bones}, \"click_to_face_ms\": {median:.2}, \
         \"slider_ms\": {slide:.2}, \"folds\": {}, \"steps_ms\": {{{}}}}}",
        model.points.len(),
        report.folds,
        steps.join(", ")
    );
    if let Some(bench) = placed {
        expressions::print_expressions(name, &bench, bones)?;
        expressions::print_bake(name, &bench, bones)?;
    }
    Ok(())
}

/// Every triangle cut into four at the middles of its edges.
fn subdivided(model: &Model) -> Model {
    let triangles = model.point_triangles();
    let sides = edges(&triangles);
    let mut points = model.points.clone();
    let first = points.len() as u32;
    points.extend(sides.iter().map(|edge| {
        let [a, b] = edge.points.map(|point| model.points[point as usize]);
        0.5 * (a + b)
    }));
    let middle = |a: u32, b: u32| {
        let found = sides.binary_search_by_key(&[a.min(b), a.max(b)], |edge| edge.points);
        found.map_or(a, |at| first + at as u32)
    };
    let mut split: Vec<[u32; 3]> = Vec::with_capacity(4 * triangles.len());
    for [a, b, c] in triangles {
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        split.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    let mut finer = Model { points, ..Model::default() };
    finer.objects = vec![rigsmith::mesh::model::Object::default()];
    finer.parts = vec![rigsmith::mesh::model::Part {
        vertices: (0..finer.points.len() as u32).collect(),
        normals: vec![Vec3::Z; finer.points.len()],
        triangles: split,
        ..Default::default()
    }];
    finer
}
