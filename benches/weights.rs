//! Automatic weights on real bodies: error against hand-made weights, coverage, time, volume at bent joints, damaged
//! meshes.
//!
//! `RIGSMITH_DATA=../shared/data cargo bench --bench weights [-- body...]`. With `RIGSMITH_BLENDER` set to a Python
//! that has `bpy` and `RIGSMITH_PEERS` to the folder of `heat_weights.py`, Blender's bone heat runs on the same input
//! in alternation. Rigs are given as joint heads and parents only; Blender gets the true tails.

use std::{collections::BTreeMap, fs, path::Path, process::Command, time::Instant};

use glam::{Quat, Vec3};
use rigsmith::{
    algo::weights::{WeightJoint, WeightReport, WeightSettings, skin_weights},
    mesh::model::Weights,
};
use serde_json::{Value, json};

const BODIES: [&str; 7] = [
    "male_young",
    "female_young",
    "female_heavy_tpose",
    "female_young_armsdown",
    "male_child_tpose",
    "male_muscular_action",
    "baby",
];
const RIGS: [Rig; 2] = [
    Rig { name: "game_engine", elbows: ["upperarm_l", "upperarm_r"], knees: ["thigh_l", "thigh_r"] },
    Rig {
        name: "mixamo",
        elbows: ["mixamorig:LeftArm", "mixamorig:RightArm"],
        knees: ["mixamorig:LeftUpLeg", "mixamorig:RightUpLeg"],
    },
];
const RUNS: usize = 5;

/// A rig of the data, and the joints above the bends (their only child is the one that turns).
struct Rig {
    name: &'static str,
    elbows: [&'static str; 2],
    knees: [&'static str; 2],
}

#[derive(Clone, Default)]
struct Mesh {
    points: Vec<Vec3>,
    faces: Vec<Vec<u32>>,
    /// The vertex of the undamaged body that a point stands for.
    origin: Vec<Option<u32>>,
}

struct Skeleton {
    names: Vec<String>,
    joints: Vec<WeightJoint>,
    tails: Vec<Vec3>,
    truth: Vec<Vec<(u32, f32)>>,
}

fn main() {
    let Some(data) = std::env::var_os("RIGSMITH_DATA") else {
        println!("skipped: RIGSMITH_DATA is not set");
        return;
    };
    let bodies = Path::new(&data).join("bodies");
    let chosen: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let mut settings = WeightSettings::default();
    if let Some(smoothing) = std::env::var("RIGSMITH_SMOOTHING").ok().and_then(|s| s.parse().ok()) {
        settings.smoothing = smoothing;
    }
    for rig in &RIGS {
        println!(
            "\n{}\n{:24} {:>8} {:>8} {:>8} {:>7}   region volume at 90 degrees (true weights)   Blender",
            rig.name, "body", "points", "weighted", "error", "ms"
        );
        for body in BODIES {
            if !chosen.is_empty() && !chosen.iter().any(|c| c == body) {
                continue;
            }
            let mesh = read_obj(&bodies.join(body).join("body.obj"));
            let skeleton = read_rig(&bodies, body, rig.name);
            row(body, &mesh, &skeleton, Some(rig), &settings);
            if body == "baby" {
                row("baby x10", &scaled(&mesh, 10.0), &scaled_rig(&skeleton, 10.0), None, &settings);
            }
            if body == "male_young" {
                row("  x0.001", &scaled(&mesh, 0.001), &scaled_rig(&skeleton, 0.001), None, &settings);
                row("  x1000", &scaled(&mesh, 1000.0), &scaled_rig(&skeleton, 1000.0), None, &settings);
                for (name, damaged) in damages(&mesh) {
                    row(&format!("  {name}"), &damaged, &skeleton, None, &settings);
                }
                row("  subdivided twice", &split(&split(&mesh)), &skeleton, None, &settings);
            }
        }
    }
}

/// Binds a mesh and prints what came out.
fn row(name: &str, mesh: &Mesh, skeleton: &Skeleton, bends: Option<&Rig>, settings: &WeightSettings) {
    let triangles = triangulated(mesh);
    let mut times = Vec::new();
    let mut result = None;
    for _ in 0..RUNS {
        let start = Instant::now();
        let bound = skin_weights(&mesh.points, &triangles, &skeleton.joints, &[], None, settings, &|_| true);
        times.push(start.elapsed().as_secs_f64() * 1e3);
        result = Some(bound.expect("the input is sound"));
    }
    times.sort_by(f64::total_cmp);
    let Some((weights, report)) = result else { return };
    let covered = (0..weights.len()).filter(|&p| (weights.of(p).map(|e| e.1).sum::<f32>() - 1.0).abs() < 1e-4).count();
    print!(
        "{name:24} {:>8} {:>7.2}% {:>8.4} {:>7.0} ",
        mesh.points.len(),
        100.0 * covered as f64 / mesh.points.len() as f64,
        error(mesh, skeleton, &weights),
        times[RUNS / 2],
    );
    if let Some(rig) = bends {
        for (what, joints, towards) in [("elbow", rig.elbows, Vec3::Z), ("knee", rig.knees, Vec3::NEG_Z)] {
            print!(" {what}");
            for joint in joints {
                let ours = bent_volume(&triangles, mesh, skeleton, &weights, joint, towards);
                let theirs = bent_volume(&triangles, mesh, skeleton, &as_weights(&skeleton.truth), joint, towards);
                print!(" {:+.1}% ({:+.1}%)", 100.0 * ours, 100.0 * theirs);
            }
        }
    }
    if let Some((seconds, share, error)) = blender(mesh, skeleton) {
        print!("  Blender {:.0} ms {:.0}% {error:.4}", seconds * 1e3, share * 100.0);
    }
    let WeightReport { by_surface, by_voxels, by_fill, by_nearest, .. } = report;
    println!("  [{by_surface} surface, {by_voxels} voxels, {by_fill} fill, {by_nearest} nearest]");
}

/// The mean over the body's vertices of half the sum of absolute differences from the true weights.
fn error(mesh: &Mesh, skeleton: &Skeleton, weights: &Weights) -> f64 {
    let mut sums = vec![(0.0f64, 0u32); skeleton.truth.len()];
    let mut difference = vec![0f64; skeleton.joints.len()];
    for (point, origin) in mesh.origin.iter().enumerate() {
        let Some(origin) = *origin else { continue };
        difference.fill(0.0);
        for (joint, weight) in weights.of(point) {
            difference[joint as usize] += f64::from(weight);
        }
        for &(joint, weight) in &skeleton.truth[origin as usize] {
            difference[joint as usize] -= f64::from(weight);
        }
        let sum = &mut sums[origin as usize];
        sum.0 += difference.iter().map(|d| d.abs()).sum::<f64>() / 2.0;
        sum.1 += 1;
    }
    let met = sums.iter().filter(|s| s.1 > 0);
    met.clone().map(|s| s.0 / f64::from(s.1)).sum::<f64>() / met.count() as f64
}

/// Change of the limb's volume around a bend when the joint below `upper` turns by 90 degrees towards a
/// side.
///
/// The limb is where the true weights of both joints hold most; its openings are closed with fans.
fn bent_volume(
    triangles: &[[u32; 3]],
    mesh: &Mesh,
    skeleton: &Skeleton,
    weights: &Weights,
    upper: &str,
    towards: Vec3,
) -> f64 {
    let index = |name: &str| skeleton.names.iter().position(|n| n == name).expect("the rig has the joint");
    let upper = index(upper);
    let lower =
        (0..skeleton.joints.len()).find(|&j| skeleton.joints[j].parent == Some(upper)).expect("a limb has two joints");
    let pivot = skeleton.joints[lower].head;
    let end =
        (0..skeleton.joints.len()).find(|&j| skeleton.joints[j].parent == Some(lower)).expect("a limb has an end");
    let axis = (skeleton.joints[end].head - pivot).cross(towards).normalize();
    let turn = Quat::from_axis_angle(axis, std::f32::consts::FRAC_PI_2);
    let mut moves = vec![false; skeleton.joints.len()];
    for (joint, moves) in moves.iter_mut().enumerate() {
        let mut at = Some(joint);
        while let Some(j) = at {
            *moves |= j == lower;
            at = skeleton.joints[j].parent;
        }
    }
    let bent: Vec<Vec3> = mesh
        .points
        .iter()
        .enumerate()
        .map(|(p, &point)| {
            let share: f32 = weights.of(p).filter(|e| moves[e.0 as usize]).map(|e| e.1).sum();
            point + (pivot + turn * (point - pivot) - point) * share
        })
        .collect();
    let inside: Vec<bool> = (0..mesh.points.len())
        .map(|p| {
            let held: f32 =
                skeleton.truth[p].iter().filter(|e| e.0 as usize == upper || e.0 as usize == lower).map(|e| e.1).sum();
            held > 0.5
        })
        .collect();
    let limb: Vec<[u32; 3]> = triangles.iter().copied().filter(|t| t.iter().all(|&p| inside[p as usize])).collect();
    volume(&bent, &limb) / volume(&mesh.points, &limb) - 1.0
}

/// The volume inside a piece of surface whose openings are closed with a fan each.
fn volume(points: &[Vec3], triangles: &[[u32; 3]]) -> f64 {
    let mut next = BTreeMap::new();
    let mut sides = BTreeMap::new();
    for &[a, b, c] in triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *sides.entry((from.min(to), from.max(to))).or_insert(0) += 1;
        }
    }
    for &[a, b, c] in triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            if sides[&(from.min(to), from.max(to))] == 1 {
                next.insert(to, from);
            }
        }
    }
    let reference = points[triangles[0][0] as usize];
    let tetrahedron =
        |a: Vec3, b: Vec3, c: Vec3| f64::from((a - reference).dot((b - reference).cross(c - reference))) / 6.0;
    let mut sum: f64 = triangles
        .iter()
        .map(|t| tetrahedron(points[t[0] as usize], points[t[1] as usize], points[t[2] as usize]))
        .sum();
    while let Some((&start, _)) = next.iter().next() {
        let mut ring = vec![start];
        let mut at = start;
        while let Some(to) = next.remove(&at) {
            if to == start {
                break;
            }
            ring.push(to);
            at = to;
        }
        let center = ring.iter().map(|&p| points[p as usize]).sum::<Vec3>() / ring.len() as f32;
        for i in 0..ring.len() {
            sum += tetrahedron(center, points[ring[i] as usize], points[ring[(i + 1) % ring.len()] as usize]);
        }
    }
    sum
}

/// The body in every condition it should survive.
fn damages(mesh: &Mesh) -> Vec<(&'static str, Mesh)> {
    let mut random = Random(0x9e37_79b9);
    let mut specks = mesh.clone();
    for _ in 0..12 {
        let center = Vec3::new(random.next() - 0.5, random.next() * 1.8, random.next() * 0.6 - 0.3);
        let base = specks.points.len() as u32;
        for corner in [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z] {
            specks.points.push(center + corner * 0.004);
            specks.origin.push(None);
        }
        specks
            .faces
            .extend([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]].map(|f: [u32; 3]| f.map(|c| base + c).to_vec()));
    }
    let mut unwelded = Mesh::default();
    for face in &mesh.faces {
        let base = unwelded.points.len() as u32;
        unwelded.points.extend(face.iter().map(|&p| mesh.points[p as usize]));
        unwelded.origin.extend(face.iter().map(|&p| mesh.origin[p as usize]));
        unwelded.faces.push((0..face.len() as u32).map(|c| base + c).collect());
    }
    let mut holes = mesh.clone();
    holes.faces.retain(|_| random.next() > 1.0 / 3.0);
    let mut doubled = mesh.clone();
    let count = mesh.points.len() as u32;
    doubled.points.extend_from_slice(&mesh.points);
    doubled.origin.extend_from_slice(&mesh.origin);
    for face in &mut doubled.faces {
        for corner in face {
            *corner += if random.next() > 0.5 { count } else { 0 };
        }
    }
    let mut flipped = mesh.clone();
    flipped.faces.iter_mut().for_each(|f| f.reverse());
    let mut mixed = mesh.clone();
    mixed.faces.iter_mut().filter(|_| random.next() > 0.5).for_each(|f| f.reverse());
    let mut all = Mesh { points: specks.points.clone(), origin: specks.origin.clone(), faces: Vec::new() };
    for face in &specks.faces {
        if random.next() > 1.0 / 3.0 {
            let base = all.points.len() as u32;
            all.points.extend(face.iter().map(|&p| specks.points[p as usize]));
            all.origin.extend(face.iter().map(|&p| specks.origin[p as usize]));
            all.faces.push((0..face.len() as u32).rev().map(|c| base + c).collect());
        }
    }
    vec![
        ("12 specks", specks),
        ("unwelded", unwelded),
        ("a third removed", holes),
        ("duplicated", doubled),
        ("flipped", flipped),
        ("half flipped", mixed),
        ("all of these", all),
    ]
}

/// Splits every face into four-sided ones around its middle; the first points stay.
fn split(mesh: &Mesh) -> Mesh {
    let mut result = Mesh { points: mesh.points.clone(), origin: mesh.origin.clone(), faces: Vec::new() };
    let mut middles = BTreeMap::new();
    for face in &mesh.faces {
        let center = face.iter().map(|&p| mesh.points[p as usize]).sum::<Vec3>() / face.len() as f32;
        let center_index = result.points.len() as u32;
        result.points.push(center);
        let sides: Vec<u32> = (0..face.len())
            .map(|i| {
                let (a, b) = (face[i], face[(i + 1) % face.len()]);
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    result.points.push((mesh.points[a as usize] + mesh.points[b as usize]) * 0.5);
                    result.points.len() as u32 - 1
                })
            })
            .collect();
        for i in 0..face.len() {
            result.faces.push(vec![face[i], sides[i], center_index, sides[(i + face.len() - 1) % face.len()]]);
        }
    }
    result.origin.resize(result.points.len(), None);
    result
}

fn scaled(mesh: &Mesh, scale: f32) -> Mesh {
    Mesh { points: mesh.points.iter().map(|&p| p * scale).collect(), ..mesh.clone() }
}

fn scaled_rig(skeleton: &Skeleton, scale: f32) -> Skeleton {
    Skeleton {
        names: skeleton.names.clone(),
        joints: skeleton.joints.iter().map(|&j| WeightJoint { head: j.head * scale, ..j }).collect(),
        tails: skeleton.tails.iter().map(|&t| t * scale).collect(),
        truth: skeleton.truth.clone(),
    }
}

fn triangulated(mesh: &Mesh) -> Vec<[u32; 3]> {
    mesh.faces.iter().flat_map(|f| (2..f.len()).map(|i| [f[0], f[i - 1], f[i]])).collect()
}

fn as_weights(rows: &[Vec<(u32, f32)>]) -> Weights {
    let mut weights = Weights::default();
    for row in rows {
        weights.push(row.iter().copied());
    }
    weights
}

fn read_obj(path: &Path) -> Mesh {
    let text = fs::read_to_string(path).expect("the body is readable");
    let mut mesh = Mesh::default();
    for line in text.lines() {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                let c: Vec<f32> = words.take(3).map(|w| w.parse().expect("a number")).collect();
                mesh.points.push(Vec3::new(c[0], c[1], c[2]));
            }
            Some("f") => {
                let corner = |w: &str| w.split('/').next().and_then(|i| i.parse::<u32>().ok()).expect("an index") - 1;
                mesh.faces.push(words.map(corner).collect());
            }
            _ => {}
        }
    }
    mesh.origin = (0..mesh.points.len() as u32).map(Some).collect();
    mesh
}

fn read_rig(bodies: &Path, body: &str, rig: &str) -> Skeleton {
    let read = |path: &Path| -> Value { serde_json::from_slice(&fs::read(path).expect("readable")).expect("JSON") };
    let truth = read(&bodies.join(format!("gt_weights_{rig}.json")));
    let bones = read(&bodies.join(body).join("joints.json"))[rig].take();
    let names: Vec<String> = truth["bone_order"]
        .as_array()
        .expect("a list")
        .iter()
        .map(|n| n.as_str().expect("a name").to_owned())
        .collect();
    let vector = |v: &Value| Vec3::from_array(std::array::from_fn(|i| v[i].as_f64().expect("a number") as f32));
    let joints = names
        .iter()
        .map(|name| WeightJoint {
            head: vector(&bones[name]["head"]),
            parent: bones[name]["parent"].as_str().and_then(|p| names.iter().position(|n| n == p)),
            tail: None,
            deforms: true,
            twist: None,
            halves: None,
        })
        .collect();
    let tails = names.iter().map(|name| vector(&bones[name]["tail"])).collect();
    let influence = |e: &Value| (e[0].as_u64().expect("an index") as u32, e[1].as_f64().expect("a weight") as f32);
    let truth = truth["weights"]
        .as_array()
        .expect("a list")
        .iter()
        .map(|l| l.as_array().expect("a list").iter().map(influence).collect())
        .collect();
    Skeleton { names, joints, tails, truth }
}

/// Seconds, share of weighted vertices and error of Blender's bone heat on the same input, if it is there.
fn blender(mesh: &Mesh, skeleton: &Skeleton) -> Option<(f64, f64, f64)> {
    let python = std::env::var_os("RIGSMITH_BLENDER")?;
    let script = Path::new(&std::env::var_os("RIGSMITH_PEERS")?).join("heat_weights.py");
    let folder = std::env::temp_dir().join(format!("rigsmith-weights-{}", std::process::id()));
    fs::create_dir_all(&folder).ok()?;
    let mut obj = String::new();
    for p in &mesh.points {
        obj += &format!("v {} {} {}\n", p.x, p.y, p.z);
    }
    for face in &mesh.faces {
        obj += "f";
        for corner in face {
            obj += &format!(" {}", corner + 1);
        }
        obj += "\n";
    }
    fs::write(folder.join("mesh.obj"), obj).ok()?;
    let joints: Vec<Value> = skeleton
        .joints
        .iter()
        .zip(&skeleton.names)
        .zip(&skeleton.tails)
        .map(|((j, name), tail)| json!({"name": name, "parent": j.parent.map_or(-1, |p| p as i64), "head": j.head.to_array(), "tail": tail.to_array()}))
        .collect();
    let weights: Vec<Vec<(u32, f32)>> =
        mesh.origin.iter().map(|o| o.map_or(Vec::new(), |o| skeleton.truth[o as usize].clone())).collect();
    fs::write(folder.join("rig.json"), json!({"joints": joints, "weights": weights}).to_string()).ok()?;
    let output =
        Command::new(python).arg(script).arg(folder.join("mesh.obj")).arg(folder.join("rig.json")).output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let line = text.lines().find(|l| l.starts_with('{'))?;
    let value: Value = serde_json::from_str(line).ok()?;
    fs::remove_dir_all(&folder).ok();
    Some((
        value["seconds"].as_f64()?,
        value["weighted_share"].as_f64()?,
        value["error_vs_truth"].as_f64().unwrap_or(f64::NAN),
    ))
}

/// A small generator of repeatable numbers from 0 to 1 (xorshift).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 40) as f32 / (1u32 << 24) as f32
    }
}
