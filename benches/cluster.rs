//! Average linkage and k-means on the vertices of a real head, with fastcluster and scikit-learn in the same sitting.
//!
//! `RIGSMITH_DATA=../shared/data cargo bench --bench cluster` prints a row for each: milliseconds (median), peak memory, heights.
//! With `RIGSMITH_PEERS` (the folder of `upgma.py` and `kmeans.py`) and `RIGSMITH_PYTHON` set, the peers run in turns with
//! ours on the same points, and each row has the ratio and how heights or errors compare. `-- --write-mesh FILE.obj`
//! writes the head subdivided once (Catmull and Clark), `-- --write-mesh FILE.obj 2` twice. `-- linkage` or `-- kmeans` does
//! only one.

use std::{
    alloc::System,
    collections::BTreeMap,
    path::{Path, PathBuf},
    process::Command,
    time::Instant,
};

use glam::Vec3;
use rigsmith::algo::{
    kmeans::{KMeansSettings, kmeans},
    linkage::{Dendrogram, average_linkage, average_linkage_1d, squared_linkage},
};
use serde_json::Value;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

const TURNS: usize = 5;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let Some(data) = std::env::var_os("RIGSMITH_DATA").map(PathBuf::from) else {
        println!("skipped: RIGSMITH_DATA is not set");
        return;
    };
    let Ok(text) = std::fs::read_to_string(data.join("heads/ict_neutral.obj")) else {
        println!("skipped: heads/ict_neutral.obj cannot be read");
        return;
    };
    let once = Mesh::read(&text).subdivided();
    let twice = once.subdivided();
    if let Some(at) = words.iter().position(|word| word == "--write-mesh") {
        let file = words.get(at + 1).map_or("head.obj", String::as_str);
        let mesh = if words.get(at + 2).is_some_and(|times| times == "2") { &twice } else { &once };
        mesh.write(Path::new(file), 1);
        return;
    }
    let wanted = |name: &str| words.is_empty() || words.iter().any(|word| word == name);
    if wanted("linkage") {
        linkage(&once, 15_000, true);
        linkage(&once, 22_500, true);
        linkage(&twice, 100_000, false);
        line(&once);
    }
    if wanted("kmeans") {
        groups(&twice, 100_000, 200);
    }
}

/// Milliseconds of `work`, and its answer.
fn timed<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let start = Instant::now();
    let answer = work();
    (start.elapsed().as_secs_f64() * 1e3, answer)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn linkage(mesh: &Mesh, most: usize, peer: bool) {
    let step = mesh.points.len().div_ceil(most);
    let points: Vec<Vec3> = mesh.points.iter().copied().step_by(step).collect();
    let cluster = || average_linkage(&points, &|_| true).expect("finite points");
    let region = Region::new(ALLOCATOR);
    let tree = cluster();
    // All that was ever allocated bounds the peak from above.
    let bytes = region.change().bytes_allocated as f64 / 1e6;
    let script = if peer { peer_script("upgma.py") } else { None };
    let (mut ours, mut theirs, mut apart) = (Vec::new(), Vec::new(), 0.0_f64);
    for turn in 0..TURNS {
        ours.extend((0..3).map(|_| timed(cluster).0));
        if let Some((python, script)) = script.as_ref().filter(|_| turn < 3) {
            let file = std::env::temp_dir().join("rigsmith_bench_linkage.obj");
            mesh.write(&file, step);
            let answer = ask(Command::new(python).arg(script).arg(&file).args(["--max", &most.to_string()]));
            theirs.extend(answer["seconds"].as_f64().map(|seconds| seconds * 1e3));
            apart = apart.max(heights_apart(&tree, &answer));
        }
    }
    let (ours, theirs) = (median(ours), median(theirs));
    println!("average linkage, {} points: {ours:.1} ms, at most {bytes:.0} MB", points.len());
    if theirs.is_finite() {
        println!("  fastcluster {theirs:.0} ms, ratio {:.0}, top heights apart by {apart:.1e}", theirs / ours);
    }
    let preview = median((0..5).map(|_| timed(|| squared_linkage(&points, &|_| true)).0).collect());
    println!("  squared preview: {preview:.1} ms");
}

fn heights_apart(tree: &Dendrogram, answer: &Value) -> f64 {
    let theirs = answer["top_heights"].as_array().cloned().unwrap_or_default();
    let heights = tree.heights(theirs.len());
    let apart = theirs.iter().filter_map(Value::as_f64).zip(heights);
    apart.map(|(theirs, ours)| (theirs - f64::from(ours)).abs() / theirs).fold(0.0, f64::max)
}

fn line(mesh: &Mesh) {
    let depth: Vec<f32> = mesh.points.iter().map(|point| point.z).collect();
    for count in [depth.len() / 4, depth.len()] {
        let values = &depth[..count];
        let times = (0..9).map(|_| timed(|| average_linkage_1d(values, &|_| true)).0).collect();
        println!("average linkage in depth, {count} values: {:.2} ms", median(times));
    }
}

fn groups(mesh: &Mesh, most: usize, groups: usize) {
    let step = mesh.points.len().div_ceil(most);
    let points: Vec<Vec3> = mesh.points.iter().copied().step_by(step).collect();
    let file = std::env::temp_dir().join("rigsmith_bench_kmeans.obj");
    let (mut ours, mut theirs, mut errors, mut peer) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for seed in 0..3 {
        let settings = KMeansSettings { groups, starts: 1, seed, max_rounds: 1000 };
        let (time, answer) = timed(|| kmeans(&points, &[], &settings, &|_| true).expect("finite points"));
        ours.push(time);
        errors.push(answer.square_error);
    }
    if let Some((python, script)) = peer_script("kmeans.py") {
        mesh.write(&file, step);
        let answer = ask(Command::new(python).arg(script).arg(&file).arg(groups.to_string()));
        theirs.extend(answer["seconds"].as_f64().map(|seconds| seconds * 1e3));
        peer.extend(answer["best_inertia"].as_f64());
    }
    let least = errors.iter().copied().fold(f64::INFINITY, f64::min);
    println!(
        "k-means, {} points, {groups} groups: {:.1} ms a start, least error of 3 {least:.1}",
        points.len(),
        median(ours.clone())
    );
    if let (Some(theirs), Some(peer)) = (theirs.first(), peer.first()) {
        println!("  scikit-learn {theirs:.0} ms, ratio {:.0}, least error of 3 {peer:.1}", theirs / median(ours));
    }
}

/// The interpreter and a peer's script, if both are given.
fn peer_script(name: &str) -> Option<(PathBuf, PathBuf)> {
    let python = std::env::var_os("RIGSMITH_PYTHON")?;
    let folder = std::env::var_os("RIGSMITH_PEERS")?;
    Some((python.into(), Path::new(&folder).join(name)))
}

fn ask(command: &mut Command) -> Value {
    let output = command.output().map(|output| output.stdout).unwrap_or_default();
    serde_json::from_slice(&output).unwrap_or(Value::Null)
}

/// Polygons as the file has them.
struct Mesh {
    points: Vec<Vec3>,
    faces: Vec<Vec<u32>>,
}

impl Mesh {
    fn read(text: &str) -> Self {
        let (mut points, mut faces) = (Vec::new(), Vec::new());
        for line in text.lines() {
            let mut words = line.split_whitespace();
            match words.next() {
                Some("v") => {
                    let mut value = || words.next().and_then(|word| word.parse().ok()).unwrap_or_default();
                    points.push(Vec3::new(value(), value(), value()));
                }
                Some("f") => faces.push(words.filter_map(corner).collect()),
                _ => {}
            }
        }
        Self { points, faces }
    }

    fn write(&self, file: &Path, step: usize) {
        let mut text = String::new();
        for point in self.points.iter().step_by(step) {
            text += &format!("v {} {} {}\n", point.x, point.y, point.z);
        }
        for face in self.faces.iter().filter(|_| step == 1) {
            let corners: Vec<String> = face.iter().map(|corner| (corner + 1).to_string()).collect();
            text += &format!("f {}\n", corners.join(" "));
        }
        std::fs::write(file, text).expect("a file that can be written");
    }

    /// Catmull and Clark's subdivision, borders as splines.
    fn subdivided(&self) -> Self {
        let count = self.points.len();
        let middle =
            |face: &Vec<u32>| face.iter().map(|&at| self.points[at as usize]).sum::<Vec3>() / face.len() as f32;
        let centers: Vec<Vec3> = self.faces.iter().map(middle).collect();
        let mut edges: BTreeMap<(u32, u32), Vec<usize>> = BTreeMap::new();
        for (at, face) in self.faces.iter().enumerate() {
            for (a, b) in sides(face) {
                edges.entry((a.min(b), a.max(b))).or_default().push(at);
            }
        }
        // Sums and counts around each vertex: faces, edges, border edges.
        let mut around = vec![(Vec3::ZERO, 0.0_f32, Vec3::ZERO, 0.0_f32, Vec3::ZERO, 0); count];
        for (face, center) in self.faces.iter().zip(&centers) {
            for &at in face {
                around[at as usize].0 += *center;
                around[at as usize].1 += 1.0;
            }
        }
        let mut points = vec![Vec3::ZERO; count];
        let mut number = BTreeMap::new();
        for (&(a, b), faces) in &edges {
            let half = (self.points[a as usize] + self.points[b as usize]) * 0.5;
            for at in [a, b] {
                let entry = &mut around[at as usize];
                entry.2 += half;
                entry.3 += 1.0;
                if faces.len() == 1 {
                    entry.4 += half;
                    entry.5 += 1;
                }
            }
            number.insert((a, b), points.len() as u32);
            let inside = faces.len() == 2;
            points.push(if inside { (half * 2.0 + centers[faces[0]] + centers[faces[1]]) * 0.25 } else { half });
        }
        for (at, &(faces, face_count, halves, half_count, border, borders)) in around.iter().enumerate() {
            let own = self.points[at];
            points[at] = if borders == 2 {
                own * 0.5 + border * 0.25
            } else if borders > 0 || face_count == 0.0 {
                own
            } else {
                (faces / face_count + halves / half_count * 2.0 + own * (face_count - 3.0)) / face_count
            };
        }
        let mut quads = Vec::new();
        for (face, center) in self.faces.iter().zip(&centers) {
            let middle = points.len() as u32;
            points.push(*center);
            let halves: Vec<u32> = sides(face).map(|(a, b)| number[&(a.min(b), a.max(b))]).collect();
            for (at, &corner) in face.iter().enumerate() {
                quads.push(vec![corner, halves[at], middle, halves[(at + face.len() - 1) % face.len()]]);
            }
        }
        Self { points, faces: quads }
    }
}

fn corner(word: &str) -> Option<u32> {
    word.split('/').next()?.parse::<u32>().ok()?.checked_sub(1)
}

fn sides(face: &[u32]) -> impl Iterator<Item = (u32, u32)> {
    face.iter().enumerate().map(|(at, &corner)| (corner, face[(at + 1) % face.len()]))
}
