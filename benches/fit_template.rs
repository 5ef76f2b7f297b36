//! Errors and times of fitted templates on meshes whose joints are known.
//!
//! ```text
//! RIGSMITH_DATA=DATA cargo bench --bench fit_template --no-default-features
//! RIGSMITH_DATA=DATA cargo bench --bench fit_template --no-default-features -- variants
//! ```
//!
//! Distances are hundredths of the mesh's height: of the joints of the body, of the fingers, and the largest one. `variants`
//! compares the fit of each mesh with those of the mesh turned, scaled, shuffled, decimated, subdivided and damaged.

#[path = "../tests/it/fit_data/known_joints.rs"]
mod known_joints;
#[expect(dead_code, reason = "tests use more of it")]
#[path = "../tests/it/random.rs"]
mod random;

use std::{error::Error, path::Path, time::Instant};

use glam::{Mat3, Quat, Vec3};
use rigsmith::{
    algo::fit_template::{FitError, FitSettings, FittedSkeleton, MeshAnalysis, TemplateJoint, fit_template},
    files::bundled_characters,
};

use self::{
    known_joints::{Figure, figures, held_back, is_finger, template_joints},
    random::Random,
};

fn main() -> Result<(), Box<dyn Error>> {
    let Some(data) = std::env::var_os("RIGSMITH_DATA") else {
        println!("skipped: RIGSMITH_DATA names no folder with test meshes");
        return Ok(());
    };
    let variants = std::env::args().any(|argument| argument == "variants");
    let characters = bundled_characters();
    println!("{:<28} {:>6} {:>8} {:>6} {:>22} {:>7} {:>11}", "mesh", "body", "fingers", "worst", "at", "doubt", "ms");
    let data = Path::new(&data);
    for figure in figures(data)?.into_iter().chain([held_back(data)?]) {
        let rig = characters.iter().find(|rig| rig.about().name == figure.template).ok_or("no template")?;
        let joints = template_joints(rig);
        if variants {
            changed(&figure, &joints)?;
        } else {
            measured(&figure, &joints)?;
        }
    }
    Ok(())
}

fn fit(points: &[Vec3], triangles: &[[u32; 3]], joints: &[TemplateJoint]) -> Result<(FittedSkeleton, f64), FitError> {
    let start = Instant::now();
    let analysis = MeshAnalysis::new(points, triangles, None, &|_| true)?;
    let fit = fit_template(&analysis, joints, &FitSettings::default(), &|_| true)?;
    Ok((fit, start.elapsed().as_secs_f64() * 1e3))
}

/// Prints how far the joints are from where they should be.
fn measured(figure: &Figure, joints: &[TemplateJoint]) -> Result<(), Box<dyn Error>> {
    let mut times = Vec::new();
    let mut fitted = None;
    for _ in 0..3 {
        let (fit, time) = fit(&figure.points, &figure.triangles, joints)?;
        times.push(time);
        fitted = Some(fit);
    }
    times.sort_by(f64::total_cmp);
    let fit = fitted.ok_or("no fit")?;
    let (mut body, mut fingers, mut worst) = (Vec::new(), Vec::new(), (0.0, ""));
    for (label, place) in &figure.truth {
        let Some(at) = joints.iter().position(|joint| joint.label == label) else { continue };
        let off = 100.0 * fit.joints[at].position.distance(*place) / fit.height;
        if is_finger(label) { &mut fingers } else { &mut body }.push(off);
        if !is_finger(label) && off > worst.0 {
            worst = (off, joints[at].label);
        }
    }
    let mean = |list: &[f32]| list.iter().fold(0.0, |sum, off| sum + off) / list.len().max(1) as f32;
    let doubtful = fit.joints.iter().filter(|joint| joint.confidence < 0.5).count();
    let (body, fingers) = (mean(&body), mean(&fingers));
    let name = &figure.name;
    println!("{name:<28} {body:>6.2} {fingers:>8.2} {:>6.2} {:>22} {doubtful:>7} {:>11.0}", worst.0, worst.1, times[1]);
    Ok(())
}

/// Prints how far joints move when the same figure is given in another way.
fn changed(figure: &Figure, joints: &[TemplateJoint]) -> Result<(), Box<dyn Error>> {
    let Figure { name, points, triangles, .. } = figure;
    let (base, _) = fit(points, triangles, joints)?;
    let furthest =
        |points: &[Vec3], triangles: &[[u32; 3]], back: &dyn Fn(Vec3) -> Vec3| match fit(points, triangles, joints) {
            Ok((fit, _)) => {
                let pairs = fit.joints.iter().zip(&base.joints);
                pairs.map(|(a, b)| 100.0 * back(a.position).distance(b.position) / base.height).fold(0.0, f32::max)
            }
            Err(_) => f32::INFINITY,
        };
    let turned = |turn: Quat| {
        let points: Vec<Vec3> = points.iter().map(|point| turn * *point).collect();
        furthest(&points, triangles, &|place| turn.inverse() * place)
    };
    let axes = [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z];
    let pairs = axes.iter().flat_map(|a| axes.iter().map(move |b| (*a, *b))).filter(|(a, b)| a.dot(*b) == 0.0);
    let right = pairs.map(|(a, b)| turned(Quat::from_mat3(&Mat3::from_cols(a, b, a.cross(b))))).fold(0.0, f32::max);
    let mut random = Random(12345);
    let odd = (0..10).map(|_| {
        let mut part = || random.unit() - 0.5;
        Quat::from_xyzw(part(), part(), part(), part()).normalize()
    });
    let odd = odd.collect::<Vec<_>>().into_iter().map(turned).fold(0.0, f32::max);
    let scaled = [0.001, 1000.0].map(|scale| {
        let points: Vec<Vec3> = points.iter().map(|point| *point * scale).collect();
        furthest(&points, triangles, &|place| place / scale)
    });
    let mut faces = triangles.clone();
    random.shuffle(&mut faces);
    let faces = furthest(points, &faces, &|place| place);
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    random.shuffle(&mut order);
    let mut others = points.clone();
    order.iter().zip(points).for_each(|(to, point)| others[*to as usize] = *point);
    let renamed: Vec<[u32; 3]> = triangles.iter().map(|corners| corners.map(|corner| order[corner as usize])).collect();
    let order = furthest(&others, &renamed, &|place| place);
    let missing: Vec<[u32; 3]> = triangles.iter().copied().filter(|_| random.unit() > 0.1).collect();
    let missing = furthest(points, &missing, &|place| place);
    println!(
        "{name:<28} turned {right:.2}, oddly {odd:.2}, scaled {:.2}, faces in another order {faces:.2}, points {order:.2}, a tenth \
         missing {missing:.2}",
        scaled[0].max(scaled[1])
    );
    Ok(())
}
