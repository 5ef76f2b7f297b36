//! Growth of the time of lists of clicks with their length.
//!
//! `cargo bench --no-default-features --bench clicks [-- COUNT]` carries out lists of COUNT clicks on a box (25,000 without a
//! number), of twice and of four times as many, without a window. It prints one line for a single chain, and one for chains
//! that begin anew with each other joint: milliseconds of each list, and the growth from one to the next.

use std::time::Instant;

use bevy::math::Vec3;
use rigsmith::{
    headless::Workbench,
    mesh::model::{Faces, Model, Object, Part},
    plugins::gesture::Gesture,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Cargo passes an argument of its own.
    let count = std::env::args().skip(1).find_map(|argument| argument.parse().ok()).unwrap_or(25_000);
    for (name, every) in [("one chain", usize::MAX), ("a chain each other joint", 2)] {
        let mut times = Vec::new();
        for count in [count, 2 * count, 4 * count] {
            times.push(seconds(count, every)?);
        }
        let list: Vec<String> = times.iter().map(|time| format!("{:.0} ms", 1e3 * time)).collect();
        let growth: Vec<String> = times.windows(2).map(|pair| format!("{:.2}x", pair[1] / pair[0])).collect();
        println!("{count} clicks and more, {name}: {}; growth {}", list.join(", "), growth.join(", "));
    }
    Ok(())
}

/// Seconds of a list of clicks, of which each `every`-th lies in the middle and the others beside it.
fn seconds(count: usize, every: usize) -> Result<f64, Box<dyn std::error::Error>> {
    let mut bench = Workbench::new(7, "clicks");
    bench.open(cube(), false)?;
    let click = |number: usize| {
        let across = if number.is_multiple_of(every) { 0.0 } else { 0.05 + 0.009 * (number * 37 % 100) as f32 };
        Gesture::Click((across, -0.9 + 0.018 * (number * 61 % 100) as f32))
    };
    let clicks: Vec<Gesture> = (0..count).map(click).collect();
    let start = Instant::now();
    let answers = bench.gestures(clicks);
    let time = start.elapsed().as_secs_f64();
    if bench.rig().len() != count || answers.iter().any(|answer| !answer.done) {
        return Err(format!("{} of {count} clicks placed a joint", bench.rig().len()).into());
    }
    Ok(time)
}

/// A cube from -1 to 1 along each axis.
fn cube() -> Model {
    let sign = |corner: usize, axis: usize| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 };
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let mut model = Model { name: "cube".into(), ..Model::default() };
    model.points.extend((0..8).map(|corner| Vec3::from_array([0, 1, 2].map(|axis| sign(corner, axis)))));
    model.objects.push(Object { name: "cube".into(), ..Object::default() });
    model.parts.push(Part {
        object: 0,
        vertices: (0..8).collect(),
        faces: Faces { starts: (0..=6).map(|face| 4 * face).collect(), corners: quads.concat() },
        triangles: quads.iter().flat_map(|quad| [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]).collect(),
        ..Part::default()
    });
    model
}
