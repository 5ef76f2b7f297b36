//! The examples of the README, run as their users run them, with a picture of what they show.

use std::{
    path::{Path, PathBuf},
    process::Command,
    sync::Mutex,
};

use image::RgbImage;
use rigsmith::render::adapter;

use crate::prerequisites::skip;

/// One renderer at a time: several on one software adapter take their time from each other.
static TURN: Mutex<()> = Mutex::new(());

/// Runs an example with `--screenshot`, and returns its pictures, those with the suffixes first; `None` where there is no
/// adapter or the examples are not built.
#[track_caller]
fn run(name: &str, args: &[&str], suffixes: &[&str]) -> Option<Vec<RgbImage>> {
    if adapter().is_none() {
        skip("there is no graphics adapter, not even a software one", "RIGSMITH_REQUIRE_GPU");
        return None;
    }
    let folder: PathBuf = std::env::current_exe().unwrap().parent().unwrap().parent().unwrap().join("examples");
    let program = folder.join(name);
    if !program.exists() {
        skip(
            "the examples are not built: `cargo test` builds them, `cargo test --test it` does not",
            "RIGSMITH_REQUIRE_GPU",
        );
        return None;
    }
    let _turn = TURN.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let out = tempfile::tempdir().unwrap();
    let picture = out.path().join("picture.png");
    let mut command = Command::new(program);
    command.current_dir(Path::new(env!("CARGO_MANIFEST_DIR"))).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    let answer = command.args(args).arg("--screenshot").arg(&picture).output().unwrap();
    let said = String::from_utf8_lossy(&answer.stderr).into_owned() + &String::from_utf8_lossy(&answer.stdout);
    assert!(answer.status.success(), "{name}: {said}");
    let files = suffixes.iter().map(|suffix| out.path().join(format!("picture{suffix}.png"))).chain([picture.clone()]);
    let open = |file: PathBuf| {
        let image = image::open(&file).unwrap_or_else(|error| panic!("{name}: {}: {error}: {said}", file.display()));
        image.to_rgb8()
    };
    Some(files.map(open).collect())
}

/// Share of the pixels that two pictures do not have in common.
fn changed(a: &RgbImage, b: &RgbImage) -> f32 {
    let far = |(a, b): &(&image::Rgb<u8>, &image::Rgb<u8>)| a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > 24);
    let pixels = a.pixels().zip(b.pixels()).filter(far).count();
    pixels as f32 / (a.width() * a.height()) as f32
}

/// Share of the pixels that do not show the background, which the first pixel shows; and their mean height, from 0 at the
/// lower edge to 1.
fn shown(image: &RgbImage) -> (f32, f32) {
    let ground = *image.get_pixel(0, 0);
    let is_shown = |pixel: &image::Rgb<u8>| pixel.0.iter().zip(ground.0).any(|(a, b)| a.abs_diff(b) > 12);
    let rows: Vec<u32> = image.enumerate_pixels().filter(|(.., pixel)| is_shown(pixel)).map(|(_, y, _)| y).collect();
    let count = rows.len().max(1) as f32;
    let mean = rows.iter().map(|row| *row as f32).sum::<f32>() / count;
    (rows.len() as f32 / (image.width() * image.height()) as f32, 1.0 - mean / image.height() as f32)
}

#[test]
fn embed_shows_a_character() {
    let Some(pictures) = run("embed", &[], &[]) else { return };
    let (share, _) = shown(&pictures[0]);
    assert!((0.03..0.6).contains(&share), "{share}");
}

#[test]
fn hot_reload_shows_the_file_before_and_after() {
    let Some(pictures) = run("hot_reload", &[], &["-before"]) else { return };
    assert!(shown(&pictures[0]).0 > 0.03 && shown(&pictures[1]).0 > 0.03);
    let changed = changed(&pictures[0], &pictures[1]);
    assert!((0.002..0.3).contains(&changed), "{changed}");
}

#[test]
fn crowd_shows_many() {
    // A software renderer takes minutes for a thousand; the instances bench runs them all.
    let Some(pictures) = run("crowd", &["--count", "16"], &[]) else { return };
    let (share, _) = shown(&pictures[0]);
    assert!((0.005..0.95).contains(&share), "{share}");
}

#[test]
fn ragdoll_falls_and_gets_up() {
    let Some(pictures) = run("ragdoll", &[], &["-before", "-after"]) else { return };
    let [before, after, lying] = [0, 1, 2].map(|at| shown(&pictures[at]));
    assert!(lying.1 < before.1 - 0.1, "{before:?} {lying:?}");
    assert!((after.1 - before.1).abs() < 0.02 && (after.0 / before.0 - 1.0).abs() < 0.1, "{before:?} {after:?}");
}

#[test]
fn animate_dances_and_looks_at_the_ball() {
    let Some(pictures) = run("animate", &[], &["-before"]) else { return };
    assert!(pictures.iter().all(|picture| (0.03..0.6).contains(&shown(picture).0)));
    let changed = changed(&pictures[0], &pictures[1]);
    assert!((0.005..0.4).contains(&changed), "{changed}");
    // The ball is the only thing that is red, and it is on the other side of its circle a second later.
    let [before, after] = [0, 1].map(|at| {
        let is_red = |pixel: &image::Rgb<u8>| {
            let [r, g, b] = pixel.0.map(u32::from);
            r > 90 && 2 * r > 3 * g && 2 * r > 3 * b
        };
        let red = pictures[at].enumerate_pixels().filter(|(.., pixel)| is_red(pixel));
        let places: Vec<[f32; 2]> = red.map(|(x, y, _)| [x as f32, y as f32]).collect();
        assert!(places.len() > 100, "the ball is not shown: {} pixels", places.len());
        [0, 1].map(|axis| places.iter().map(|place| place[axis]).sum::<f32>() / places.len() as f32)
    });
    let way = (before[0] - after[0]).hypot(before[1] - after[1]);
    assert!(way > 60.0, "{before:?} {after:?}");
}

#[test]
fn retarget_walks_on_three_bodies() {
    let Some(pictures) = run("retarget", &[], &["-before"]) else { return };
    // Figures are runs of columns that show something; feet and hands of one may be a few columns apart.
    let figures = |image: &RgbImage| {
        let ground = *image.get_pixel(0, 0);
        let is_shown = |x: u32, y: u32| image.get_pixel(x, y).0.iter().zip(ground.0).any(|(a, b)| a.abs_diff(b) > 12);
        let mut found: Vec<[u32; 4]> = Vec::new();
        for x in 0..image.width() {
            let rows = || (0..image.height()).filter(|y| is_shown(x, *y));
            let (Some(top), Some(bottom)) = (rows().min(), rows().max()) else { continue };
            match found.last_mut() {
                Some(last) if x - last[1] < 12 => *last = [last[0], x, last[2].min(top), last[3].max(bottom)],
                _ => found.push([x, x, top, bottom]),
            }
        }
        found
    };
    for picture in &pictures {
        let found = figures(picture);
        assert_eq!(found.len(), 3, "{found:?}");
        let [short, grown, child] = [0, 1, 2].map(|at| (found[at][3] - found[at][2]) as f32);
        assert!(short < 0.97 * grown && child < 0.85 * grown, "{found:?}");
    }
    let changed = changed(&pictures[0], &pictures[1]);
    assert!((0.005..0.4).contains(&changed), "{changed}");
}

#[test]
fn headless_build_writes_a_character() {
    let out = tempfile::tempdir().unwrap();
    let file = out.path().join("out.glb");
    let Some(pictures) = run("headless_build", &[&file.display().to_string()], &[]) else { return };
    assert!(shown(&pictures[0]).0 > 0.03);
    let model = rigsmith::files::load_model(&rigsmith::files::RealDisk, &file).unwrap();
    assert!(model.weights.is_some() && model.nodes.len() > 52);
}

/// The sheet of fits: a mesh with the skeleton in it, and beside it the skinned figure in another pose.
#[test]
fn fit_sheet_shows_skeletons_and_poses() {
    let body = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/models/biped.obj");
    let Some(pictures) = run("fit_sheet", &[body], &[]) else { return };
    let sheet = &pictures[0];
    assert_eq!(sheet.dimensions(), (600, 400));
    let [fitted, posed] = [0, 300].map(|left| image::imageops::crop_imm(sheet, left, 0, 300, 400).to_image());
    for (name, picture) in [("fitted", &fitted), ("posed", &posed)] {
        let share = shown(picture).0;
        assert!(share > 0.03, "{name}: {share} of the picture");
    }
    let differs = changed(&fitted, &posed);
    assert!(differs > 0.01, "{differs} of the two pictures differ");
}
