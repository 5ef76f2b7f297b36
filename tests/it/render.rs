//! Pictures by the renderer, held against small references in `tests/pictures`. They need a graphics adapter, be it a
//! software one.
//!
//! `RIGSMITH_BLESS=1` writes the references; look at them before committing. What differs is left as `NAME.seen.png` in
//! the target folder.

use std::{path::PathBuf, sync::Mutex};

use bevy::{math::UVec2, prelude::Quat};
use rigsmith::{
    algo::{view::View, weights::WeightSettings},
    headless::Workbench,
    mesh::obj::{ObjSettings, read_model},
    plugins::{
        display::{MeshDisplay, WeightColors},
        drawing::{LabelChoice, RigDrawing},
        gesture::read_gestures,
        surface::RigMesh,
    },
    render::{PictureSettings, adapter, png, take_picture},
    rig::{PoseOffset, Rig, operations::Operation, template::read_template},
};

use crate::prerequisites::skip;

/// One renderer at a time: several on one software adapter take their time from each other.
static TURN: Mutex<()> = Mutex::new(());

/// True if pictures can be taken; says why not, and fails where they must be.
#[track_caller]
fn can_draw() -> bool {
    if adapter().is_some() {
        return true;
    }
    skip("there is no graphics adapter, not even a software one", "RIGSMITH_REQUIRE_GPU");
    false
}

/// The bundled character, sketched, skinned and with one arm raised.
fn character() -> (Rig, RigMesh) {
    let mesh = include_bytes!("../../assets/models/biped.obj");
    let model = read_model(&mesh[..], "biped", &ObjSettings::default(), &mut |_| None).unwrap();
    let mut bench = Workbench::new(1, "biped");
    bench.open(model, false).unwrap();
    bench.gestures(read_gestures(include_bytes!("../../assets/gestures/biped.ron")).unwrap());
    bench.skin(WeightSettings::default(), Vec::new(), &mut |_| {}).unwrap();
    (bench.rig().clone(), bench.mesh().unwrap().clone())
}

/// Mean difference of channels and part of pixels that differ clearly; both from 0 to 1.
fn difference(a: &image::RgbImage, b: &image::RgbImage) -> (f32, f32) {
    assert_eq!(a.dimensions(), b.dimensions());
    let (mut sum, mut far) = (0.0, 0);
    for (a, b) in a.pixels().zip(b.pixels()) {
        let apart = a.0.iter().zip(b.0).map(|(a, b)| f32::from(a.abs_diff(b))).fold(0.0, f32::max);
        sum += a.0.iter().zip(b.0).map(|(a, b)| f32::from(a.abs_diff(b))).sum::<f32>() / 3.0;
        far += usize::from(apart > 48.0);
    }
    let count = a.pixels().len() as f32;
    (sum / count / 255.0, far as f32 / count)
}

#[test]
fn pictures_are_like_their_references_on_a_gpu() {
    if !can_draw() {
        return;
    }
    let _turn = TURN.lock();
    let (rig, mesh) = character();
    let arm = rig.find_label("upper_arm.L").or(rig.find_label("L_upper_arm")).or(rig.find_label("upper_arm_l"));
    let arm = arm.unwrap_or_else(|| rig.walk().nth(rig.len() / 2).unwrap().data.uid);
    let mut posed = rig.clone();
    let offset = PoseOffset { rotation: Quat::from_rotation_z(0.8), ..PoseOffset::default() };
    let mut uids = rigsmith::rig::UidSource::seeded(3);
    Operation::Pose(vec![(arm, offset)]).run(&mut posed, &mut uids, None).unwrap();
    let plain = PictureSettings { size: UVec2::new(240, 180), ..PictureSettings::default() };
    let display = |display: MeshDisplay| PictureSettings { display, ..plain.clone() };
    let no_rig = RigDrawing { rig: false, ..RigDrawing::default() };
    let labels = RigDrawing { labels: LabelChoice::All, axes: true, ..RigDrawing::default() };
    let pictures: Vec<(&str, &Rig, PictureSettings)> = vec![
        ("front", &rig, plain.clone()),
        ("mesh_only", &rig, PictureSettings { drawing: no_rig, view: View::Orbit(35.0, 15.0), ..plain.clone() }),
        (
            "xray_side",
            &rig,
            PictureSettings {
                orthographic: true,
                view: View::Left,
                ..display(MeshDisplay { xray: true, ..MeshDisplay::default() })
            },
        ),
        ("wireframe", &rig, display(MeshDisplay { wireframe: true, ..MeshDisplay::default() })),
        (
            "weights",
            &rig,
            PictureSettings {
                selected: vec![arm],
                ..display(MeshDisplay { weights: WeightColors::Joint(arm), ..MeshDisplay::default() })
            },
        ),
        ("posed", &posed, PictureSettings { selected: vec![arm], drawing: labels, ..plain.clone() }),
    ];
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/pictures");
    let seen = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let bless = std::env::var("RIGSMITH_BLESS").is_ok_and(|value| value == "1");
    let mut wrong = Vec::new();
    let mut shown: Vec<image::RgbImage> = Vec::new();
    for (name, rig, settings) in pictures {
        let bytes = png(take_picture(rig.clone(), vec![mesh.clone()], &settings).unwrap()).unwrap();
        let picture = image::load_from_memory(&bytes).unwrap().to_rgb8();
        let path = folder.join(format!("{name}.png"));
        if bless {
            std::fs::write(&path, &bytes).unwrap();
        } else {
            let reference = image::load_from_memory(&std::fs::read(&path).unwrap()).unwrap().to_rgb8();
            let (mean, far) = difference(&picture, &reference);
            println!("{name}: mean {mean:.4}, clearly different {far:.4}");
            if mean > 0.012 || far > 0.015 {
                let kept = seen.join(format!("{name}.seen.png"));
                std::fs::write(&kept, &bytes).unwrap();
                wrong.push(format!("{name}: mean {mean:.4}, clearly different {far:.4}; see {}", kept.display()));
            }
        }
        // What a picture shows is seen in it: no two of them are alike.
        for other in &shown {
            let (mean, far) = difference(&picture, other);
            assert!(mean > 0.004 || far > 0.004, "{name} looks like another picture: mean {mean}, far {far}");
        }
        shown.push(picture);
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_same_input_gives_the_same_picture_on_a_gpu() {
    if !can_draw() {
        return;
    }
    let _turn = TURN.lock();
    let (rig, mesh) = character();
    let settings = PictureSettings { size: UVec2::new(120, 90), ..PictureSettings::default() };
    let take = || png(take_picture(rig.clone(), vec![mesh.clone()], &settings).unwrap()).unwrap();
    assert_eq!(take(), take());
}

/// The camera turns with a figure that stands along Z.
#[test]
fn the_view_follows_the_axes_of_the_figure_on_a_gpu() {
    if !can_draw() {
        return;
    }
    let _turn = TURN.lock();
    let take = |places: [&str; 2], turn: Quat| {
        let text = format!(
            r#"(format: 2, name: "two", joints: [
                (label: "a"),
                (label: "b", parent: "a", translation: {}),
                (label: "c", parent: "b", translation: {}),
            ])"#,
            places[0], places[1]
        );
        let rig = read_template(text.as_bytes()).unwrap().rig;
        let drawing = RigDrawing { grid: false, ..RigDrawing::default() };
        let settings = PictureSettings { size: UVec2::new(120, 90), turn, drawing, ..PictureSettings::default() };
        image::load_from_memory(&png(take_picture(rig, Vec::new(), &settings).unwrap()).unwrap()).unwrap().to_rgb8()
    };
    let upright = take(["(0, 1, 0)", "(0.5, 0.2, 0)"], Quat::IDENTITY);
    let along_z = ["(0, 0, 1)", "(0.5, 0, 0.2)"];
    let (_, turned) = difference(&upright, &take(along_z, Quat::from_rotation_x(std::f32::consts::FRAC_PI_2)));
    let (_, still) = difference(&upright, &take(along_z, Quat::IDENTITY));
    assert!(turned < 0.02 && 2.0 * turned < still, "{turned} of the pixels differ, {still} without the turn");
}

#[test]
fn impossible_sizes_are_refused() {
    for (width, height) in [(0, 10), (10, 0), (100_000, 10)] {
        let settings = PictureSettings { size: UVec2::new(width, height), ..PictureSettings::default() };
        let error = take_picture(Rig::default(), Vec::new(), &settings).unwrap_err().to_string();
        assert!(error.contains("choose"), "{error}");
    }
}

/// A control that is much larger than the joints is in the picture as a whole.
#[test]
fn controls_are_framed_on_a_gpu() {
    if !can_draw() {
        return;
    }
    let _turn = TURN.lock();
    let text = r#"(format: 2, name: "wide", joints: [
        (label: "a", tags: [control(size: 6.0)]),
        (label: "b", parent: "a", translation: (0, 1, 0)),
    ])"#;
    let rig = read_template(text.as_bytes()).unwrap().rig;
    let drawing = RigDrawing { grid: false, ..RigDrawing::default() };
    let settings = PictureSettings {
        size: UVec2::new(240, 180),
        view: View::Orbit(30.0, 35.0),
        drawing,
        build: true,
        ..PictureSettings::default()
    };
    let bytes = png(take_picture(rig, Vec::new(), &settings).unwrap()).unwrap();
    let picture = image::load_from_memory(&bytes).unwrap().to_rgb8();
    let ground = *picture.get_pixel(0, 0);
    let is_drawn = |pixel: &image::Rgb<u8>| pixel.0.iter().zip(ground.0).any(|(a, b)| a.abs_diff(b) > 24);
    let places: Vec<(u32, u32)> =
        picture.enumerate_pixels().filter(|(.., pixel)| is_drawn(pixel)).map(|(x, y, _)| (x, y)).collect();
    let across = [places.iter().map(|(x, _)| *x).min().unwrap(), places.iter().map(|(x, _)| *x).max().unwrap()];
    let tall = [places.iter().map(|(_, y)| *y).min().unwrap(), places.iter().map(|(_, y)| *y).max().unwrap()];
    assert!(across[0] > 2 && across[1] < 237 && tall[0] > 2 && tall[1] < 177, "{across:?} {tall:?}");
    assert!(across[1] - across[0] > 80, "the control fills the picture: {across:?}");
}

/// Without a display nothing asks for one, on whichever way to a graphics card.
#[cfg(feature = "cli")]
#[test]
fn the_command_draws_quietly_without_a_display_on_a_gpu() {
    if !can_draw() {
        return;
    }
    let _turn = TURN.lock();
    let folder = tempfile::tempdir().unwrap();
    let mesh = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/models/hand.obj");
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_rigsmith"))
        .current_dir(folder.path())
        .args(["render", mesh, "--output", "hand.png", "--size", "64x48"])
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("XDG_RUNTIME_DIR")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && folder.path().join("hand.png").exists(), "{said}");
    assert!(!said.contains("XDG_RUNTIME_DIR") && !said.contains("error"), "{said}");
}

/// A twisted forearm is drawn otherwise with dual quaternions, and all else is drawn alike.
#[cfg(feature = "cli")]
#[test]
fn the_command_shows_dual_quaternions_on_a_gpu() {
    if !can_draw() {
        return;
    }
    let _turn = TURN.lock();
    let folder = tempfile::tempdir().unwrap();
    let asset = |path: &str| format!("{}/assets/{path}", env!("CARGO_MANIFEST_DIR"));
    let (rig, mesh) = (asset("templates/biped.rig.ron"), asset("models/biped.obj"));
    let [turn, reach] = ["hand_ik_l.rotate=(0,150,0)", "hand_ik_l.translate=(0,0.3,0.25)"];
    let picture = |deform: &str| {
        let file = format!("{deform}.png");
        let args: [&str; 12] =
            ["pose", &rig, "--mesh", &mesh, "--set", turn, "--set", reach, "--deform", deform, "-o", &file];
        let answer = crate::cli_build::rigsmith(folder.path(), &args);
        assert_eq!(answer.code, 0, "{deform}: {}", answer.err);
        image::open(folder.path().join(&file)).unwrap().to_rgb8()
    };
    let [linear, dual] = ["linear", "dqs"].map(picture);
    assert_eq!(linear.dimensions(), dual.dimensions());
    let is_other = |(a, b): &(&image::Rgb<u8>, &image::Rgb<u8>)| a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > 24);
    let differing = linear.pixels().zip(dual.pixels()).filter(is_other).count();
    assert!((300..30_000).contains(&differing), "{differing} pixels differ");
}
