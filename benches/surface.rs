//! Rays against a million triangles: build, refit, closest hit, near and far, and skinning.
//!
//! Prints one JSON line with the fields of the peer script `rays.py` (embreex and trimesh), and the crate obvhs in the
//! same run (which is neither watertight nor finds the furthest hit). To compare all on the same mesh and rays:
//!
//! ```text
//! cargo bench --bench surface -- --write-mesh torus.obj
//! python rays.py torus.obj
//! cargo bench --bench surface -- --rays rays.f32
//! ```
//!
//! where `rays.f32` holds origin and direction of each ray, six little-endian `f32`: in `rays.py`'s terms,
//! `np.hstack([origins, directions]).astype('<f4').tofile('rays.f32')`. Without `--rays`, rays of the same
//! distribution are made here. `--only NAME` runs one part, for a profiler.

use std::{
    hint::black_box,
    io::Write,
    time::{Duration, Instant},
};

use glam::{Affine3A, Vec3, Vec3A};
use obvhs::{BvhBuildParams, cwbvh::builder::build_cwbvh_from_tris, ray::RayHit, triangle::Triangle};
use rayon::prelude::*;
use rigsmith::mesh::{model::Weights, ray::Ray, skinning::skin_points, surface::Surface};

/// Quads around the ring and around the tube.
const SIZE: [usize; 2] = [1000, 500];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let value = |name: &str| arguments.iter().position(|a| a == name).and_then(|i| arguments.get(i + 1));
    let (points, triangles) = torus();
    if let Some(path) = value("--write-mesh") {
        return Ok(write_obj(path, &points, &triangles)?);
    }
    let low = points.iter().copied().reduce(Vec3::min).ok_or("no points")?;
    let high = points.iter().copied().reduce(Vec3::max).ok_or("no points")?;
    let rays = match value("--rays") {
        Some(path) => read_rays(&std::fs::read(path)?),
        None => seeded_rays(200_000, low, high),
    };
    let only = value("--only");
    let wanted = |name: &str| only.is_none_or(|only| only == name);
    let mut report = vec![format!("\"triangles\": {}", triangles.len()), format!("\"rays\": {}", rays.len())];
    let mut note = |name: &str, value: f64| report.push(format!("\"{name}\": {value:.7}"));

    let mut surface = Surface::build(&points, &triangles);
    if wanted("build") {
        note("build_s", best(9, || drop(black_box(Surface::build(&points, &triangles)))));
    }
    if wanted("refit") {
        let bent: Vec<Vec3> = points.iter().map(|p| *p + Vec3::Y * (0.1 * p.x)).collect();
        let mut turn = 0;
        let seconds = best(40, || {
            turn += 1;
            surface.refit(if turn % 2 == 0 { &points } else { &bent }).unwrap_or_else(|error| println!("{error}"));
        });
        note("refit_s", seconds);
    }
    let mray = |seconds: f64| rays.len() as f64 / seconds / 1e6;
    if wanted("closest") {
        let mut found = 0;
        let seconds = best(9, || found = rays.iter().filter(|ray| surface.closest(ray).is_some()).count());
        note("closest_mray_s_one_core", mray(seconds));
        note("closest_hit_share", found as f64 / rays.len() as f64);
    }
    if wanted("near_far") {
        let seconds = best(5, || {
            for ray in &rays {
                black_box(surface.near_far(ray));
            }
        });
        note("near_far_mray_s_one_core", mray(seconds));
        let mut found = Vec::new();
        note(
            "near_far_mray_s",
            mray(best(5, || found = rays.par_iter().with_min_len(256).map(|ray| surface.near_far(ray)).collect())),
        );
        let few = rays.len().min(50_000);
        let ends: Vec<_> = found[..few].iter().flatten().collect();
        let mean = |sum: f64| sum / ends.len() as f64;
        note("near_mean", mean(ends.iter().map(|(near, _)| f64::from(near.distance)).sum()));
        note("far_mean", mean(ends.iter().map(|(_, far)| f64::from(far.distance)).sum()));
    }
    if wanted("obvhs") {
        let corners: Vec<Triangle> = triangles
            .iter()
            .map(|t| t.map(|i| Vec3A::from(points[i as usize])))
            .map(|[v0, v1, v2]| Triangle { v0, v1, v2 })
            .collect();
        let build = || build_cwbvh_from_tris(&corners, BvhBuildParams::fast_build(), &mut Duration::default());
        note("obvhs_build_s", best(5, || drop(black_box(build()))));
        let bvh = build();
        let ordered: Vec<Triangle> = bvh.primitive_indices.iter().map(|&i| corners[i as usize]).collect();
        let seconds = best(5, || {
            for ray in &rays {
                let mut hit = RayHit::none();
                let ray = obvhs::ray::Ray::new_inf(ray.origin.into(), ray.direction.into());
                black_box(bvh.ray_traverse(ray, &mut hit, |ray, i| ordered[i].intersect(ray)));
            }
        });
        note("obvhs_closest_mray_s_one_core", mray(seconds));
    }
    if wanted("all") {
        let mut hits = Vec::new();
        note("all_hits_mray_s_one_core", mray(best(3, || rays.iter().for_each(|ray| surface.hits(ray, &mut hits)))));
    }
    if wanted("closest_point") {
        let few = &rays[..rays.len().min(20_000)];
        let seconds = best(3, || {
            for ray in few {
                black_box(surface.closest_point(ray.origin));
            }
        });
        note("closest_point_m_s_one_core", few.len() as f64 / seconds / 1e6);
    }
    if wanted("skin") {
        let (points, weights, matrices) = skin();
        let mut posed = Vec::new();
        note("skin_1m_points_s", best(20, || skin_points(&points, &weights, &matrices, &mut posed)));
    }
    println!("{{{}}}", report.join(", "));
    Ok(())
}

/// The least of several timings, in seconds: what the machine can do when it is left alone.
fn best(runs: usize, mut run: impl FnMut()) -> f64 {
    (0..runs)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min)
}

/// A bumpy torus of a million triangles, in quads.
fn torus() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let [around, tube] = SIZE;
    let tau = std::f64::consts::TAU;
    let mut points = Vec::with_capacity(around * tube);
    let mut triangles = Vec::with_capacity(2 * around * tube);
    for i in 0..around {
        for j in 0..tube {
            let (u, v) = (i as f64 / around as f64 * tau, j as f64 / tube as f64 * tau);
            let r = 0.4 + 0.05 * (9.0 * u).sin() * (7.0 * v).sin() + 0.02 * (41.0 * u + 3.0 * v).sin();
            let ring = 1.0 + r * v.cos();
            points.push(Vec3::new((ring * u.cos()) as f32, (r * v.sin()) as f32, (ring * u.sin()) as f32));
            let at = |i: usize, j: usize| ((i % around) * tube + j % tube) as u32;
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles.extend([[a, d, c], [a, c, b]]);
        }
    }
    (points, triangles)
}

fn write_obj(path: &str, points: &[Vec3], triangles: &[[u32; 3]]) -> std::io::Result<()> {
    let mut file = std::io::BufWriter::new(std::fs::File::create(path)?);
    for p in points {
        writeln!(file, "v {} {} {}", p.x, p.y, p.z)?;
    }
    for t in triangles {
        writeln!(file, "f {} {} {}", t[0] + 1, t[1] + 1, t[2] + 1)?;
    }
    file.flush()
}

fn read_rays(bytes: &[u8]) -> Vec<Ray> {
    let numbers: Vec<f32> = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    numbers
        .chunks_exact(6)
        .map(|n| Ray { origin: Vec3::new(n[0], n[1], n[2]), direction: Vec3::new(n[3], n[4], n[5]) })
        .collect()
}

/// Origins on a sphere of 1.5 times the bounding radius, targets uniform in the box.
fn seeded_rays(count: usize, low: Vec3, high: Vec3) -> Vec<Ray> {
    let mut state = 7_u64;
    let mut unit = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    let mut rays = Vec::with_capacity(count);
    while rays.len() < count {
        let v = Vec3::new(unit(), unit(), unit()) * 2.0 - 1.0;
        let target = low + (high - low) * Vec3::new(unit(), unit(), unit());
        // Rejection keeps directions uniform.
        if v.length_squared() > 1.0 || v.length_squared() < 1e-4 {
            continue;
        }
        let origin = (low + high) * 0.5 + v.normalize() * (high - low).length() * 0.75;
        rays.push(Ray { origin, direction: (target - origin).normalize() });
    }
    rays
}

/// A million points with four influences each.
fn skin() -> (Vec<Vec3>, Weights, Vec<Affine3A>) {
    let count = 1_000_000;
    let mut weights = Weights::default();
    let mut points = Vec::with_capacity(count);
    for i in 0..count {
        points.push(Vec3::new(i as f32 * 1e-6, (i % 97) as f32, (i % 31) as f32));
        let joint = (i / 16_000) as u32;
        weights.push([(joint, 0.5), (joint + 1, 0.25), (joint + 2, 0.125), (joint + 3, 0.125)]);
    }
    let matrices = (0..70).map(|i| Affine3A::from_translation(Vec3::X * i as f32)).collect();
    (points, weights, matrices)
}
