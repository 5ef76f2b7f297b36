//! Growth of the time of lists of clicks and strokes with their length.
//!
//! `cargo bench --no-default-features --bench clicks [-- COUNT]` carries out lists of COUNT clicks on a box (25,000 without a
//! number), of twice and of four times as many, without a window, and lists of a fifth as many strokes of five joints each.
//! It prints one line for a single chain, one for chains that begin anew with each other joint, and two for strokes: such that
//! start beside all joints, and such that start on them. Each has milliseconds of each list, and the growth from one to the
//! next.

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
    row(count, "clicks and more, one chain", |count| clicks(count, usize::MAX))?;
    row(count, "clicks and more, a chain each other joint", |count| clicks(count, 2))?;
    row(count / 5, "strokes and more, beside all joints", |count| strokes(count, 1e-6))?;
    row(count / 5, "strokes and more, on joints", |count| strokes(count, 0.01))
}

/// Prints the times of lists of so many gestures, of twice and of four times as many.
fn row(count: usize, name: &str, list: impl Fn(usize) -> Vec<Gesture>) -> Result<(), Box<dyn std::error::Error>> {
    let mut times = Vec::new();
    for count in [count, 2 * count, 4 * count] {
        times.push(seconds(list(count))?);
    }
    let list: Vec<String> = times.iter().map(|time| format!("{:.0} ms", 1e3 * time)).collect();
    let growth: Vec<String> = times.windows(2).map(|pair| format!("{:.2}x", pair[1] / pair[0])).collect();
    println!("{count} {name}: {}; growth {}", list.join(", "), growth.join(", "));
    Ok(())
}

/// Strokes of five joints each, which start on the joint within `reach` of their first point.
fn strokes(count: usize, reach: f32) -> Vec<Gesture> {
    let stroke = |number: usize| {
        let share = |step: f64| (number as f64 * step).fract() as f32;
        let (across, up) = (-0.9 + 1.2 * share(0.618_034), -0.9 + 1.2 * share(0.754_877_7));
        Gesture::Stroke { points: vec![(across, up), (across + 0.4, up + 0.3)], threshold: None, joints: Some(5) }
    };
    let settings = [Gesture::Recentre(false), Gesture::Reach(reach)];
    settings.into_iter().chain((0..count).map(stroke)).collect()
}

/// Clicks, of which each `every`-th lies in the middle and the others beside it.
fn clicks(count: usize, every: usize) -> Vec<Gesture> {
    let click = |number: usize| {
        let across = if number.is_multiple_of(every) { 0.0 } else { 0.05 + 0.009 * (number * 37 % 100) as f32 };
        Gesture::Click((across, -0.9 + 0.018 * (number * 61 % 100) as f32))
    };
    (0..count).map(click).collect()
}

/// Seconds of a list of gestures on a cube, each of which has an effect.
fn seconds(gestures: Vec<Gesture>) -> Result<f64, Box<dyn std::error::Error>> {
    let mut bench = Workbench::new(7, "clicks");
    bench.open(cube(), false)?;
    let count = gestures.len();
    let start = Instant::now();
    let answers = bench.gestures(gestures);
    let time = start.elapsed().as_secs_f64();
    let done = answers.iter().filter(|answer| answer.done).count();
    if done != count {
        return Err(format!("{done} of {count} gestures had an effect").into());
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
