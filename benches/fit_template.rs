//! Errors and times of fitted templates on meshes whose joints are known.
//!
//! ```text
//! RIGSMITH_DATA=DATA cargo bench --bench fit_template --no-default-features
//! RIGSMITH_DATA=DATA cargo bench --bench fit_template --no-default-features -- variants
//! RIGSMITH_DATA=DATA cargo bench --bench fit_template --no-default-features --features cli -- command
//! ```
//!
//! Distances are hundredths of the mesh's height: of the joints of the body, of the fingers, and the largest one. Times are
//! medians in milliseconds: of the analysis, of the fit after it, and of the fit that follows a drag of the worst elbow or knee
//! to its place. `variants` compares the fit of each mesh with those of the mesh turned, scaled, shuffled, triangulated
//! otherwise, decimated, subdivided, damaged, and with specks. `command` runs the command, which reads the mesh, chooses a
//! template, fits, binds and writes, and puts its time beside those of analysis and fit; `male_young` also with every face in
//! sixteen.

#[path = "../tests/it/fit_data/decimate.rs"]
mod decimate;
#[expect(dead_code, reason = "tests use more of it")]
#[path = "../tests/it/random.rs"]
mod random;
#[path = "../tests/it/fit_data/true_joints.rs"]
mod true_joints;
#[path = "../tests/it/fit_data/variants.rs"]
mod variants;

use std::{
    error::Error,
    fmt::Write,
    path::{Path, PathBuf},
    process::Command,
    time::Instant,
};

use glam::{Mat3, Vec3};
use rigsmith::{
    algo::fit_template::{
        FitError, FitSettings, FittedSkeleton, MeshAnalysis, TemplateJoint, fit_template, refit_template,
    },
    files::bundled_characters,
};

use self::{
    decimate::decimated,
    random::Random,
    true_joints::{Figure, figures, held_back, is_finger, template_joints},
    variants::{odd_turns, right_turns, subdivided, with_other_diagonals, with_points_shuffled, with_specks},
};

/// Runs of which a time is the median.
const RUNS: usize = 3;

fn main() -> Result<(), Box<dyn Error>> {
    let Some(data) = std::env::var_os("RIGSMITH_DATA") else {
        println!("skipped: RIGSMITH_DATA names no folder with test meshes");
        return Ok(());
    };
    let asked = |name: &str| std::env::args().any(|argument| argument == name);
    let (variants, command) = (asked("variants"), asked("command"));
    let characters = bundled_characters();
    if command {
        println!("{:<28} {:>9} {:>9} {:>9} {:>9}", "mesh", "points", "analysis", "fit", "command");
    } else if !variants {
        println!(
            "{:<28} {:>6} {:>8} {:>6} {:>22} {:>7} {:>9} {:>9} {:>9}",
            "mesh", "body", "fingers", "worst", "at", "doubt", "analysis", "fit", "drag"
        );
    }
    let data = Path::new(&data);
    for figure in figures(data)?.into_iter().chain([held_back(data)?]) {
        let rig = characters.iter().find(|rig| rig.about().name == figure.template).ok_or("no template")?;
        let joints = template_joints(rig);
        if variants {
            changed(&figure, &joints)?;
        } else if command {
            commanded(data, &figure, &joints)?;
        } else {
            measured(&figure, &joints)?;
        }
    }
    Ok(())
}

fn fit(points: &[Vec3], triangles: &[[u32; 3]], joints: &[TemplateJoint]) -> Result<FittedSkeleton, FitError> {
    let analysis = MeshAnalysis::new(points, triangles, None, &|_| true)?;
    fit_template(&analysis, joints, &FitSettings::default(), &|_| true)
}

/// The last result of some runs, and the median of their times in milliseconds.
fn timed<T, E>(mut run: impl FnMut() -> Result<T, E>) -> Result<(T, f64), E> {
    let mut once = || -> Result<(T, f64), E> {
        let start = Instant::now();
        let result = run()?;
        Ok((result, start.elapsed().as_secs_f64() * 1e3))
    };
    let (mut result, time) = once()?;
    let mut times = vec![time];
    for _ in 1..RUNS {
        let (again, time) = once()?;
        result = again;
        times.push(time);
    }
    times.sort_by(f64::total_cmp);
    Ok((result, times[times.len() / 2]))
}

/// Prints how far the joints are from where they should be.
fn measured(figure: &Figure, joints: &[TemplateJoint]) -> Result<(), Box<dyn Error>> {
    let (analysis, first) = timed(|| MeshAnalysis::new(&figure.points, &figure.triangles, None, &|_| true))?;
    let (fit, second) = timed(|| fit_template(&analysis, joints, &FitSettings::default(), &|_| true))?;
    let (mut body, mut fingers, mut worst) = (Vec::new(), Vec::new(), (0.0, ""));
    // The elbow or knee that a person would drag, and where to.
    let mut bend = (0.0, None);
    for (label, place) in &figure.truth {
        let Some(at) = joints.iter().position(|joint| joint.label == label) else { continue };
        let off = 100.0 * fit.joints[at].position.distance(*place) / fit.height;
        if is_finger(label) { &mut fingers } else { &mut body }.push(off);
        if !is_finger(label) && off > worst.0 {
            worst = (off, joints[at].label);
        }
        if (label.starts_with("forearm") || label.starts_with("shin")) && off > bend.0 {
            bend = (off, Some((at, *place)));
        }
    }
    let mean = |list: &[f32]| list.iter().fold(0.0, |sum, off| sum + off) / list.len().max(1) as f32;
    let doubtful = fit.joints.iter().filter(|joint| joint.confidence < 0.5).count();
    let settings = FitSettings { markers: bend.1.into_iter().collect(), ..FitSettings::default() };
    let (_, drag) = timed(|| refit_template(&analysis, joints, &settings, &fit))?;
    let (name, body, fingers) = (&figure.name, mean(&body), mean(&fingers));
    println!(
        "{name:<28} {body:>6.2} {fingers:>8.2} {:>6.2} {:>22} {doubtful:>7} {first:>9.0} {second:>9.0} {drag:>9.1}",
        worst.0, worst.1
    );
    Ok(())
}

/// Prints the time of the whole command, and of analysis and fit in it.
fn commanded(data: &Path, figure: &Figure, joints: &[TemplateJoint]) -> Result<(), Box<dyn Error>> {
    let Figure { name, points, triangles, .. } = figure;
    // Bodies have the name of a folder, others that of their file.
    let file = if name.contains('.') { data.join(name) } else { data.join("bodies").join(name).join("body.obj") };
    commanded_on(name, &file, points, triangles, joints)?;
    if name == "male_young" {
        let (points, triangles) = subdivided(points, triangles);
        let (points, triangles) = subdivided(&points, &triangles);
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("fine.obj");
        let mut text = String::new();
        for point in &points {
            writeln!(text, "v {} {} {}", point.x, point.y, point.z)?;
        }
        for [a, b, c] in &triangles {
            writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1)?;
        }
        std::fs::write(&file, text)?;
        commanded_on("the same, sixteenfold", &file, &points, &triangles, joints)?;
    }
    Ok(())
}

fn commanded_on(
    name: &str,
    file: &Path,
    points: &[Vec3],
    triangles: &[[u32; 3]],
    joints: &[TemplateJoint],
) -> Result<(), Box<dyn Error>> {
    let (analysis, first) = timed(|| MeshAnalysis::new(points, triangles, None, &|_| true))?;
    let (_, second) = timed(|| fit_template(&analysis, joints, &FitSettings::default(), &|_| true))?;
    let whole = match option_env!("CARGO_BIN_EXE_rigsmith") {
        Some(program) => format!("{:.0}", timed(|| run(Path::new(program), file))?.1),
        None => "not built".to_owned(),
    };
    println!("{name:<28} {:>9} {first:>9.0} {second:>9.0} {whole:>9}", points.len());
    Ok(())
}

/// Fits a file by the command and writes the bound character.
fn run(program: &Path, file: &Path) -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let output: PathBuf = folder.path().join("fitted.glb");
    let answer = Command::new(program).arg("fit").arg(file).arg("-o").arg(&output).output()?;
    if !answer.status.success() {
        return Err(String::from_utf8_lossy(&answer.stderr).into());
    }
    Ok(())
}

/// Prints how far joints move when the same figure is given in another way.
fn changed(figure: &Figure, joints: &[TemplateJoint]) -> Result<(), Box<dyn Error>> {
    let Figure { name, points, triangles, .. } = figure;
    let base = fit(points, triangles, joints)?;
    let furthest =
        |points: &[Vec3], triangles: &[[u32; 3]], back: &dyn Fn(Vec3) -> Vec3| match fit(points, triangles, joints) {
            Ok(fit) => {
                let pairs = fit.joints.iter().zip(&base.joints);
                pairs.map(|(a, b)| 100.0 * back(a.position).distance(b.position) / base.height).fold(0.0, f32::max)
            }
            Err(_) => f32::INFINITY,
        };
    let same = |place: Vec3| place;
    let turned = |turn: Mat3| {
        let points: Vec<Vec3> = points.iter().map(|point| turn * *point).collect();
        furthest(&points, triangles, &|place| turn.transpose() * place)
    };
    let mut random = Random(12345);
    let right = right_turns().into_iter().map(turned).fold(0.0, f32::max);
    let odd = odd_turns(&mut random).into_iter().map(turned).fold(0.0, f32::max);
    let scaled = [0.001, 1000.0].map(|scale| {
        let points: Vec<Vec3> = points.iter().map(|point| *point * scale).collect();
        furthest(&points, triangles, &|place| place / scale)
    });
    let mut faces = triangles.clone();
    random.shuffle(&mut faces);
    let faces = furthest(points, &faces, &same);
    let (others, renamed) = with_points_shuffled(points, triangles, &mut random);
    let order = furthest(&others, &renamed, &same);
    let diagonals = furthest(points, &with_other_diagonals(points, triangles), &same);
    let missing: Vec<[u32; 3]> = triangles.iter().copied().filter(|_| random.unit() > 0.1).collect();
    let missing = furthest(points, &missing, &same);
    let (fewer, coarse) = decimated(points, triangles, triangles.len() / 5);
    let fewer = furthest(&fewer, &coarse, &same);
    let (finer, fine) = subdivided(points, triangles);
    let finer = furthest(&finer, &fine, &same);
    let (specks, with) = with_specks(points, triangles, &mut random);
    let specks = furthest(&specks, &with, &same);
    println!(
        "{name:<28} turned {right:.2}, oddly {odd:.2}, scaled {:.2}, faces in another order {faces:.2}, points {order:.2}, other \
         diagonals {diagonals:.2}, a tenth missing {missing:.2}, a fifth of the faces {fewer:.2}, subdivided {finer:.2}, specks \
         {specks:.2}",
        scaled[0].max(scaled[1])
    );
    Ok(())
}
