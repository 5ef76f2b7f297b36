//! Distance of a stroke's joints from the middle of a limb, on real bodies.
//!
//! `RIGSMITH_DATA=../shared/data cargo bench --bench stroke [-- FILTER]` prints, for each body, limb and view, the mean
//! distance of the joints to the line of the limb's section centroids in parts of the local radius, and, for bent limbs
//! stroked with `joints: 3`, how far the middle joint lies from the true elbow or knee in parts of the limb's length. The
//! line is computed here from the mesh itself: planes square to the true bone, the loop of the cut around it, the centroid of
//! that loop's area. Where the limb is already part of the torso, joints are compared with that line carried on straight
//! ("extended") and with the true bone. `-- detail` prints every case, `-- quick` runs a sixth, `-- time` only the timings.

#[path = "stroke/body.rs"]
mod body;

use std::{collections::BTreeMap, path::PathBuf, time::Instant};

use glam::{Vec2, Vec3};
use rigsmith::{
    algo::{
        stroke::{ChainChoice, StrokeSamples, StrokeSettings},
        view::View,
    },
    mesh::surface::Surface,
};

use body::{Body, Line};

const BODIES: [&str; 7] = [
    "baby",
    "female_heavy_tpose",
    "female_young",
    "female_young_armsdown",
    "male_child_tpose",
    "male_muscular_action",
    "male_young",
];
const SEEDS: u64 = 8;

fn main() {
    let Some(data) = std::env::var_os("RIGSMITH_DATA").map(PathBuf::from) else {
        println!("skipped: RIGSMITH_DATA is not set");
        return;
    };
    let words: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let detail = words.iter().any(|w| w == "detail");
    let mut table = Table::default();
    for name in BODIES {
        let Some(body) = Body::load(&data.join("bodies").join(name), name) else {
            println!("{name}: cannot be read");
            continue;
        };
        if !words.iter().any(|w| w == "time") {
            centring(&body, detail, &mut table);
            bending(&body, detail, &mut table);
        }
        if name == "male_young" && !quick() {
            timing(&body);
        }
    }
    table.print();
}

/// A small generator of repeatable numbers from -1 to 1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let mut x = self.0;
        x ^= x >> 33;
        x = x.wrapping_mul(0xff51_afd7_ed55_8ccd);
        x ^= x >> 33;
        (x >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }
}

/// Deviation of a hand from the line that it means to draw, by at most `reach`.
#[derive(Clone, Copy, PartialEq)]
enum Jitter {
    /// Every point on its own.
    White,
    /// A slow waver of a few swings along the stroke.
    Waver,
    /// The whole stroke to one side.
    Shift,
}

fn jittered(line: &[Vec2], count: usize, reach: f32, jitter: Jitter, seed: u64) -> Vec<Vec2> {
    let mut random = Random(seed.wrapping_mul(7919).wrapping_add(17));
    for _ in 0..4 {
        random.next();
    }
    let total: f32 = line.windows(2).map(|w| w[0].distance(w[1])).sum();
    let phases = [random.next(), random.next(), random.next(), random.next()];
    let swings = [1.5 + random.next(), 1.5 + random.next()];
    (0..count)
        .map(|i| {
            let t = i as f32 / (count - 1) as f32;
            let mut left = t * total;
            let mut p = line[line.len() - 1];
            for w in line.windows(2) {
                let l = w[0].distance(w[1]);
                if left <= l {
                    p = w[0].lerp(w[1], left / l);
                    break;
                }
                left -= l;
            }
            let stray = match jitter {
                Jitter::White => loop {
                    let d = Vec2::new(random.next(), random.next());
                    if d.length() <= 1.0 {
                        break d;
                    }
                },
                Jitter::Waver => {
                    let turn = |s: f32, p: f32| (std::f32::consts::PI * (2.0 * s * t + p)).sin();
                    0.707 * Vec2::new(turn(swings[0], phases[0]), turn(swings[1], phases[1]))
                }
                Jitter::Shift => Vec2::new(phases[0], phases[1]).normalize_or(Vec2::X),
            };
            p + stray * reach
        })
        .collect()
}

fn quick() -> bool {
    std::env::args().any(|a| a == "quick")
}

fn seeds() -> u64 {
    if quick() { 2 } else { SEEDS }
}

fn jitters() -> Vec<(Jitter, &'static str)> {
    let all = [(Jitter::White, "white"), (Jitter::Waver, "waver"), (Jitter::Shift, "shift")];
    all[..if quick() { 1 } else { 3 }].to_vec()
}

/// Means by row.
#[derive(Default)]
struct Table(BTreeMap<String, Vec<f32>>);

impl Table {
    fn add(&mut self, row: String, value: f32) {
        self.0.entry(row).or_default().push(value);
    }

    fn print(&self) {
        for (row, values) in &self.0 {
            let mean = values.iter().sum::<f32>() / values.len() as f32;
            let mut sorted = values.clone();
            sorted.sort_by(f32::total_cmp);
            let p90 = sorted[(sorted.len() * 9 / 10).min(sorted.len() - 1)];
            println!(
                "{row:48} mean {mean:7.3}  p90 {p90:7.3}  worst {:7.3}  n {}",
                sorted[sorted.len() - 1],
                sorted.len()
            );
        }
    }
}

const LIMBS: [(&str, &str, &str); 4] = [
    ("upper arm", "upperarm01", "lowerarm01"),
    ("forearm", "lowerarm01", "wrist"),
    ("thigh", "upperleg01", "lowerleg01"),
    ("calf", "lowerleg01", "foot"),
];

fn views(side: &str) -> [(View, &'static str); 5] {
    [
        (View::Front, "front"),
        (if side == "L" { View::Left } else { View::Right }, "side"),
        (View::Top, "top"),
        (View::Orbit(if side == "L" { 35.0 } else { -35.0 }, 20.0), "orbit"),
        (View::Back, "back"),
    ]
}

fn centring(body: &Body, detail: bool, table: &mut Table) {
    for (limb, from, to) in LIMBS {
        for side in ["L", "R"] {
            let (a, b) = (body.head(&format!("{from}.{side}")), body.head(&format!("{to}.{side}")));
            let line = Line::new(body, a, b);
            for (view, view_name) in views(side) {
                let plane = body.plane(view);
                let project = |p: Vec3| plane.project(p).unwrap_or(Vec2::ZERO);
                if project(a).distance(project(b)) < 0.5 * a.distance(b) {
                    continue;
                }
                for (jitter, jitter_name) in jitters() {
                    for (low, high, extent) in [(0.1, 0.9, "inner"), (0.0, 1.0, "whole")] {
                        let mut seen = Vec::new();
                        for seed in 0..seeds() {
                            // The middle of the limb as seen: what a user traces.
                            let aim: Vec<Vec2> = [low, high].iter().map(|&t| project(a.lerp(b, t))).collect();
                            let stroke = jittered(&aim, 60, 0.3 * line.radius(), jitter, seed);
                            let settings = StrokeSettings::default();
                            let Ok(samples) = StrokeSamples::new(&body.surface, &plane, &stroke, settings) else {
                                seen.push(9.0);
                                continue;
                            };
                            for joint in samples.chain(&body.surface, ChainChoice::Joints(4)).joints {
                                let (distance, extended) = line.distance(joint.position);
                                if !extended {
                                    seen.push(distance);
                                }
                                if extended {
                                    let distance = from_bone(joint.position, a, b) / line.radius();
                                    table.add(format!("{extent} extended from bone {limb} {view_name}"), distance);
                                    if detail {
                                        println!(
                                            "  {} {limb} {side} {view_name} {extent}: from bone {distance:.2} {joint:.3?}",
                                            body.name
                                        );
                                    }
                                }
                                table.add(
                                    format!("{extent}{} {limb} {view_name}", if extended { " extended" } else { "" }),
                                    distance,
                                );
                            }
                        }
                        if seen.is_empty() {
                            continue;
                        }
                        let mean = seen.iter().sum::<f32>() / seen.len() as f32;
                        table.add(format!("all {extent} {}", if limb.contains("arm") { "arms" } else { "legs" }), mean);
                        if detail {
                            println!("{} {limb} {side} {view_name} {jitter_name} {extent}: {mean:.3} radii", body.name);
                        }
                    }
                }
            }
        }
    }
}

fn bending(body: &Body, detail: bool, table: &mut Table) {
    for (limb, bones) in
        [("elbow", ["upperarm01", "lowerarm01", "wrist"]), ("knee", ["upperleg01", "lowerleg01", "foot"])]
    {
        for side in ["L", "R"] {
            let [a, b, c] = bones.map(|bone| body.head(&format!("{bone}.{side}")));
            let bend = (b - a).angle_between(c - b).to_degrees();
            let length = a.distance(b) + b.distance(c);
            let radius = Line::new(body, b, c).radius();
            for (view, view_name) in views(side) {
                let plane = body.plane(view);
                let project = |p: Vec3| plane.project(p).unwrap_or(Vec2::ZERO);
                if project(a).distance(project(b)) + project(b).distance(project(c)) < 0.5 * length {
                    continue;
                }
                for (jitter, jitter_name) in jitters() {
                    let mut seen = Vec::new();
                    for seed in 0..seeds() {
                        let mut random = Random(seed + 99);
                        let ends = [0.06 * random.next(), 0.06 * random.next()];
                        let aim = [project(a.lerp(b, ends[0].max(0.0))), project(b), project(c.lerp(b, ends[1]))];
                        let stroke = jittered(&aim, 90, 0.3 * radius, jitter, seed);
                        let settings = StrokeSettings::default();
                        let Ok(samples) = StrokeSamples::new(&body.surface, &plane, &stroke, settings) else {
                            seen.push(1.0);
                            continue;
                        };
                        let joints = samples.chain(&body.surface, ChainChoice::Joints(3)).joints;
                        let Some(middle) = joints.get(1) else {
                            seen.push(1.0);
                            continue;
                        };
                        let (along, t) = along(&[a, b, c], middle.position);
                        let _ = t;
                        seen.push((along - a.distance(b)) / length);
                    }
                    let mean = seen.iter().map(|e| e.abs()).sum::<f32>() / seen.len() as f32;
                    let worst = seen.iter().map(|e| e.abs()).fold(0.0, f32::max);
                    let kind = if bend > 25.0 { "bent" } else { "straight" };

                    for e in &seen {
                        table.add(format!("{kind} {limb} {view_name}"), e.abs());
                        table.add(format!("{kind} {limb} all"), e.abs());
                    }
                    if detail {
                        println!(
                            "{} {limb} {side} {bend:.0}° {view_name} {jitter_name}: mean {mean:.3} worst {worst:.3} signed {:.3}",
                            body.name,
                            seen.iter().sum::<f32>() / seen.len() as f32
                        );
                    }
                }
            }
        }
    }
}

/// Distance from the line through two joints.
fn from_bone(p: Vec3, a: Vec3, b: Vec3) -> f32 {
    (p - a).reject_from(b - a).length()
}

/// Length along a polyline to the point nearest to `p`, and its distance.
fn along(line: &[Vec3], p: Vec3) -> (f32, f32) {
    let mut best = (0.0, f32::INFINITY);
    let mut before = 0.0;
    for (i, w) in line.windows(2).enumerate() {
        let d = w[1] - w[0];
        let mut t = (p - w[0]).dot(d) / d.length_squared();
        if i > 0 {
            t = t.max(0.0);
        }
        if i + 2 < line.len() {
            t = t.min(1.0);
        }
        let distance = p.distance(w[0] + d * t);
        if distance < best.1 {
            best = (before + t * d.length(), distance);
        }
        before += d.length();
    }
    best
}

/// A stroke of 500 points on a body subdivided to about a million triangles.
fn timing(body: &Body) {
    let (mut points, mut triangles) = (body.points.clone(), body.triangles.clone());
    while triangles.len() < 800_000 {
        let mut middles: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for t in &triangles {
            let m = [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])].map(|(a, b)| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    points.push(0.5 * (points[a as usize] + points[b as usize]));
                    points.len() as u32 - 1
                })
            });
            finer.extend([[t[0], m[0], m[2]], [m[0], t[1], m[1]], [m[2], m[1], t[2]], m]);
        }
        triangles = finer;
    }
    let surface = Surface::build(&points, &triangles);
    let plane = body.plane(View::Front);
    let aim: Vec<Vec2> = ["upperarm01.L", "lowerarm01.L", "wrist.L"]
        .iter()
        .map(|b| plane.project(body.head(b)).unwrap_or(Vec2::ZERO))
        .collect();
    let stroke = jittered(&aim, 500, 0.01, Jitter::White, 1);
    let mut times = [Vec::new(), Vec::new()];
    for _ in 0..30 {
        let start = Instant::now();
        let Ok(samples) = StrokeSamples::new(&surface, &plane, &stroke, StrokeSettings::default()) else { return };
        times[0].push(start.elapsed().as_secs_f64() * 1e3);
        let start = Instant::now();
        std::hint::black_box(samples.chain(&surface, ChainChoice::Joints(3)));
        times[1].push(start.elapsed().as_secs_f64() * 1e3);
    }
    for t in &mut times {
        t.sort_by(f64::total_cmp);
    }
    println!(
        "time, 500 points on {} triangles: samples {:.2} ms, chain {:.3} ms (medians)",
        triangles.len(),
        times[0][15],
        times[1][15]
    );
}
