//! Bones fitted to the true shapes of a head: error on all shapes, error on shapes left out, time.
//!
//! `RIGSMITH_DATA=../shared/data cargo bench --bench fit [-- bones...]`. The error is the square root of the mean, over
//! all points and shapes, of the squared distance, in millimetres (the head is in centimetres). For the second error,
//! bones and weights are found from 40 shapes, and only transforms for the 17 left out, which a fixed seed chooses.

use std::{error::Error, path::Path, time::Instant};

use glam::Vec3;
use rigsmith::{
    algo::fit::{FitSettings, fit, fit_moves},
    files::{RealDisk, load_model, load_shapes},
};

const LEFT_OUT: usize = 17;

fn main() -> Result<(), Box<dyn Error>> {
    let Some(data) = std::env::var_os("RIGSMITH_DATA") else {
        println!("skipped: RIGSMITH_DATA is not set");
        return Ok(());
    };
    let mut bones: Vec<usize> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    if bones.is_empty() {
        bones = vec![10, 20, 40, 80];
    }
    let folder = Path::new(&data).join("heads");
    let model = load_model(&RealDisk, &folder.join("ict_neutral.obj"))?;
    let triangles = model.point_triangles();
    let shapes = load_shapes(&RealDisk, &folder.join("ict_expressions.json"), &model)?.displacements;
    let out = left_out(shapes.len(), 1);
    println!("left out: {out:?}");
    let is_out = |shape: &usize| out.contains(shape);
    let learned: Vec<&Vec<Vec3>> = (0..shapes.len()).filter(|s| !is_out(s)).map(|s| &shapes[s]).collect();
    let unseen: Vec<&Vec<Vec3>> = out.iter().map(|&s| &shapes[s]).collect();
    println!(
        "{:>6} {:>10} {:>9} {:>12} {:>14} {:>9}",
        "bones", "error, mm", "seconds", "40 shapes", "17 left out", "seconds"
    );
    for bones in bones {
        let settings = FitSettings { bones, ..FitSettings::default() };
        let start = Instant::now();
        let all = fit(&model.points, &triangles, &shapes, &settings, &|_| true).expect("a fit");
        let seconds = start.elapsed().as_secs_f64();
        let part = fit(&model.points, &triangles, &learned, &settings, &|_| true).expect("a fit");
        let start = Instant::now();
        let (_, unseen) = fit_moves(&model.points, &part.positions, &part.weights, &unseen, &|_| true).expect("moves");
        println!(
            "{bones:>6} {:>10.3} {seconds:>9.2} {:>12.3} {:>14.3} {:>9.2}",
            all.error * 10.0,
            part.error * 10.0,
            unseen * 10.0,
            start.elapsed().as_secs_f64()
        );
    }
    Ok(())
}

/// A choice of shapes by a seed, sorted.
fn left_out(shapes: usize, seed: u64) -> Vec<usize> {
    let mut order: Vec<usize> = (0..shapes).collect();
    let mut state = seed;
    for k in (1..shapes).rev() {
        // A linear congruential generator, of which the high bits are good enough for a shuffle.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        order.swap(k, (state >> 33) as usize % (k + 1));
    }
    order.truncate(LEFT_OUT.min(shapes.saturating_sub(1)));
    order.sort_unstable();
    order
}
