//! Sizes of control shapes on a body: none lies in the flesh.

use std::{path::Path, sync::Arc};

use bevy::{
    app::App,
    math::{Affine3A, Vec3},
};
use rigsmith::{
    algo::{
        control_size::{OUTSIDE, SEEN, clear_factor, is_inside, outside_share, seen_factor},
        face::auto::AutoSettings,
    },
    files::{RealDisk, load_model},
    headless::Workbench,
    mesh::surface::Surface,
    modules,
    plugins::{
        commands::{BuildResult, BuildStep, BuiltEntities},
        controls::{
            outline::lines_of,
            size::{MeasuredShapes, ShapeFactor, shape_factors},
        },
        surface::RigMeshes,
    },
    processor::Builder,
    rig::{BuiltRig, Rig, Uid},
};

use crate::bench::wait;

/// A box about the origin, twice as long as half of it is wide.
fn flesh(half: f32) -> Surface {
    let corner = |at: usize| Vec3::new((at & 1) as f32, (at >> 1 & 1) as f32, (at >> 2) as f32) * 2.0 - Vec3::ONE;
    let points: Vec<Vec3> = (0..8).map(|at| corner(at) * half).collect();
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<[u32; 3]> = sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    Surface::build(&points, &triangles)
}

fn ring(radius: f32) -> Vec<Vec<Vec3>> {
    let point = |turn: usize| {
        let angle = turn as f32 / 32.0 * std::f32::consts::TAU;
        Vec3::new(angle.cos(), 0.0, angle.sin()) * radius
    };
    vec![(0..=32).map(point).collect()]
}

#[test]
fn a_ring_grows_until_it_is_around_the_flesh() {
    let surface = flesh(1.0);
    assert!(is_inside(&surface, Vec3::new(0.3, -0.2, 0.9)) && !is_inside(&surface, Vec3::new(0.3, -0.2, 1.1)));
    assert_eq!(outside_share(&surface, &ring(0.5), Vec3::ZERO, 1.0), 0.0);
    let factor = clear_factor(&surface, &ring(0.5), Vec3::ZERO);
    // Corners of the box stick out of the ring that is just large enough.
    assert!((2.0..3.0).contains(&factor), "{factor}");
    assert!(outside_share(&surface, &ring(0.5), Vec3::ZERO, factor) >= OUTSIDE);
    assert_eq!(clear_factor(&surface, &ring(1.5), Vec3::ZERO), 1.0, "one that is large enough stays");
    assert_eq!(clear_factor(&surface, &[], Vec3::ZERO), 1.0, "without lines");
}

/// A shape with a size of its own is no larger than it has to be: half of it is seen.
#[test]
fn a_ring_that_is_to_be_seen_grows_less_than_one_that_is_to_be_clear() {
    let surface = flesh(1.0);
    let factor = seen_factor(&surface, &ring(0.45), Vec3::ZERO);
    let share = outside_share(&surface, &ring(0.45), Vec3::ZERO, factor);
    assert!(factor > 1.0 && (SEEN..OUTSIDE).contains(&share), "{factor}: {share}");
    assert!(clear_factor(&surface, &ring(0.45), Vec3::ZERO) > factor);
    // Where nothing helps it stays; the other one grows further.
    assert_eq!(seen_factor(&surface, &ring(0.16), Vec3::ZERO), 1.0);
}

/// Controls of eyes stand before the lids. In the head they would be enlarged, and cross over the nose.
#[test]
fn controls_of_eyes_stay_beside_the_nose() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/head.obj");
    let mut bench = Workbench::new(1, "face");
    bench.open(load_model(&RealDisk, &path).unwrap(), false).unwrap();
    bench.face(AutoSettings { bones: 40, ..AutoSettings::default() }, None, &mut |_, _| {}).unwrap();
    assert!(bench.build(BuildStep::All).error.is_none());
    measured(&mut bench);
    let rig = bench.rig_entity();
    let world = bench.app_mut().world();
    let entities = world.get::<BuiltEntities>(rig).unwrap();
    let built = &world.get::<BuildResult>(rig).unwrap().0;
    let mut eyes = 0;
    for (at, node) in built.nodes.iter().enumerate().filter(|(_, node)| node.name.starts_with("eye_")) {
        let Some(control) = &node.control else { continue };
        let factor = entities.get(node.uid).and_then(|entity| world.get::<ShapeFactor>(entity));
        let factor = factor.map_or(1.0, |factor| factor.0);
        let place = place_of(built, at);
        let about = (place * control.offset.affine()).translation.x;
        let points = lines_of(control, place).into_iter().flatten();
        let nearest =
            points.map(|point| (about + (point.x - about) * factor) * about.signum()).fold(f32::MAX, f32::min);
        assert!(nearest > 0.0, "{} reaches {nearest} beyond the nose, enlarged by {factor}", node.name);
        assert!(factor < 1.5, "{}: {factor}", node.name);
        eyes += 1;
    }
    assert_eq!(eyes, 2);
}

#[test]
fn a_ring_in_wide_flesh_grows_further_until_half_of_it_is_seen() {
    let surface = flesh(1.0);
    let small = ring(0.16);
    assert_eq!(outside_share(&surface, &small, Vec3::ZERO, 4.0), 0.0);
    let factor = clear_factor(&surface, &small, Vec3::ZERO);
    assert!((6.0..=8.0).contains(&factor), "{factor}");
    let share = outside_share(&surface, &small, Vec3::ZERO, factor);
    assert!((0.5..0.9).contains(&share), "no larger than it has to be: {share}");
    assert_eq!(clear_factor(&surface, &ring(0.1), Vec3::ZERO), 1.0, "one that nothing helps stays");
}

/// Runs frames until the shapes of the rig's controls are measured.
fn measured(bench: &mut Workbench) {
    let (rig, app) = (bench.rig_entity(), bench.app_mut());
    app.update();
    wait(app, "the shapes", App::update, |app| {
        let world = app.world();
        let is_done = |measured: &MeasuredShapes| !measured.is_busy();
        world.get::<RigMeshes>(rig).is_some() && world.get::<MeasuredShapes>(rig).is_some_and(is_done)
    });
    app.update();
}

/// Controls of a built rig: name, share of its shape outside of the mesh as it is drawn, and the factor.
fn shares(bench: &mut Workbench, surface: &Surface) -> Vec<(String, f32, f32)> {
    let rig = bench.rig_entity();
    let world = bench.app_mut().world();
    let built: Arc<BuiltRig> = world.get::<BuildResult>(rig).unwrap().0.clone();
    let entities = world.get::<BuiltEntities>(rig).unwrap();
    shares_of(&built, surface, &|uid| {
        entities.get(uid).and_then(|entity| world.get::<ShapeFactor>(entity)).map_or(1.0, |factor| factor.0)
    })
}

/// Place of a node at rest, in the rig's space.
fn place_of(built: &BuiltRig, at: usize) -> Affine3A {
    let mut place = built.nodes[at].base.affine();
    let mut above = built.nodes[at].parent;
    while let Some(parent) = above {
        place = built.nodes[parent].base.affine() * place;
        above = built.nodes[parent].parent;
    }
    place
}

fn shares_of(built: &BuiltRig, surface: &Surface, factor: &dyn Fn(Uid) -> f32) -> Vec<(String, f32, f32)> {
    let mut found = Vec::new();
    for (at, node) in built.nodes.iter().enumerate() {
        let Some(control) = &node.control else { continue };
        let place = place_of(built, at);
        let factor = factor(node.uid);
        let about = (place * control.offset.affine()).translation.into();
        let share = outside_share(surface, &lines_of(control, place), about, factor);
        found.push((node.name.to_string(), share, factor));
    }
    found
}

#[test]
fn no_control_of_the_bundled_biped_lies_in_its_flesh() {
    let rig = crate::bench::shipped("biped");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/biped.obj");
    let model = load_model(&RealDisk, &path).unwrap();
    let surface = Surface::build(&model.points, &model.point_triangles());
    let mut bench = Workbench::with_rig(1, rig.clone());
    assert!(bench.build(BuildStep::All).error.is_none());
    let before = shares(&mut bench, &surface);
    let inside = before.iter().filter(|(_, share, _)| *share < 0.5).count();
    assert!(inside > 0, "sizes that follow from bones alone are too small somewhere");
    bench.open(model, true).unwrap();
    measured(&mut bench);
    let after = shares(&mut bench, &surface);
    assert!(after.len() > 100, "{}", after.len());
    for (name, share, factor) in &after {
        assert!(*share >= 0.5, "{name}: {share} of its shape is outside, enlarged by {factor}");
        assert!((1.0..=4.0).contains(factor), "{name}: {factor}");
    }
    let clear = after.iter().filter(|(_, share, _)| *share >= OUTSIDE).count();
    assert!(clear * 10 >= after.len() * 9, "{clear} of {}", after.len());
    // The document and the built rig know nothing of it.
    assert_eq!(bench.rig(), &rig);
    let built = Builder::build(&rig, &Arc::new(modules::all())).unwrap();
    let rig = bench.rig_entity();
    assert_eq!(*bench.app_mut().world().get::<BuildResult>(rig).unwrap().0, built);
}

/// Controls of a rig as they are drawn on a mesh.
fn drawn(rig: &Rig, surface: &Surface) -> Vec<(String, f32, f32)> {
    let built = Builder::build(rig, &Arc::new(modules::all())).unwrap();
    let factors = shape_factors(&built, surface);
    shares_of(&built, surface, &|uid| {
        factors.iter().find(|(known, _)| *known == uid).map_or(1.0, |(_, factor)| *factor)
    })
}

/// Flesh about the bones of a rig: a closed tube for each, as thick as a part of its length.
fn tubes(rig: &Rig, thickness: f32) -> Surface {
    const SIDES: usize = 12;
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for joint in rig.walk() {
        let Some(parent) = joint.parent else { continue };
        let ends = [rig.position(parent), rig.position(joint.data.uid)];
        let along = ends[1] - ends[0];
        let Some(axis) = along.try_normalize() else { continue };
        let (x, y) = axis.any_orthonormal_pair();
        let (start, radius) = (points.len() as u32, thickness * along.length());
        for end in ends {
            points.extend((0..SIDES).map(|side| {
                let angle = side as f32 / SIDES as f32 * std::f32::consts::TAU;
                end + (x * angle.cos() + y * angle.sin()) * radius
            }));
        }
        let sides = SIDES as u32;
        for side in 0..sides {
            let (here, next) = (start + side, start + (side + 1) % sides);
            triangles.extend([[here, next, next + sides], [here, next + sides, here + sides]]);
        }
        for side in 1..sides - 1 {
            triangles.push([start, start + side + 1, start + side]);
            triangles.push([start + sides, start + sides + side, start + sides + side + 1]);
        }
    }
    Surface::build(&points, &triangles)
}

#[test]
fn no_control_of_animals_lies_in_the_flesh_about_their_bones() {
    for name in ["quadruped", "bird"] {
        let rig = crate::bench::shipped(name);
        // Quills lie side by side.
        let surface = tubes(&rig, if name == "bird" { 0.1 } else { 0.3 });
        let middle =
            rig.walk().find_map(|joint| Some((rig.position(joint.parent?), rig.position(joint.data.uid)))).unwrap();
        assert!(is_inside(&surface, middle.0.midpoint(middle.1)), "{name}: the bones are in flesh");
        let drawn = drawn(&rig, &surface);
        assert!(drawn.len() > 40, "{name}: {}", drawn.len());
        for (control, share, factor) in drawn {
            assert!(share >= 0.5, "{name}: {control}: {share} of its shape is outside, enlarged by {factor}");
            assert!((1.0..=4.0).contains(&factor), "{name}: {control}: {factor}");
        }
    }
}

/// Flesh as thick above and below a height as that, and as wide as a bird.
fn sheet(height: f32, thickness: f32) -> Surface {
    let corner = |at: usize| Vec3::new((at & 1) as f32, (at >> 1 & 1) as f32, (at >> 2) as f32) * 2.0 - Vec3::ONE;
    let points: Vec<Vec3> = (0..8).map(|at| corner(at) * Vec3::new(2.0, thickness, 2.0) + Vec3::Y * height).collect();
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<[u32; 3]> = sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    Surface::build(&points, &triangles)
}

/// Quills lie in a wing that is wider than any enlargement, so their controls stand on it.
#[test]
fn controls_of_quills_stand_on_the_wing() {
    let rig = crate::bench::shipped("bird");
    let quills: Vec<Uid> = rig
        .walk()
        .filter(|joint| joint.data.label.as_deref().is_some_and(|label| label.starts_with("feather_")))
        .map(|joint| joint.data.uid)
        .collect();
    assert_eq!(quills.len(), 12);
    let height = rig.position(quills[0]).y;
    assert!(quills.iter().all(|quill| (rig.position(*quill).y - height).abs() < 0.01), "the wings are spread flat");
    for (thickness, most) in [(0.01, 1.0), (0.02, 1.0), (0.05, 3.0)] {
        let drawn = drawn(&rig, &sheet(height, thickness));
        let of_quills = drawn.iter().filter(|(control, ..)| control.starts_with("quill_"));
        assert_eq!(of_quills.clone().count(), 12);
        for (control, share, factor) in of_quills {
            assert!(*share >= 0.5, "{thickness}: {control}: {share} of its shape is outside");
            assert!(*factor <= most, "{thickness}: {control}: enlarged by {factor}");
        }
    }
}

#[cfg(feature = "cli")]
#[test]
fn no_control_of_fitted_animals_lies_in_their_flesh() {
    use crate::{cli_outputs::rigsmith, prerequisites::test_data};

    let Some(data) = test_data() else { return };
    let folder = tempfile::tempdir().unwrap();
    for (mesh, template) in [("fox-fox", "quadruped"), ("fox-dog", "quadruped"), ("bird-eagle", "bird")] {
        let mesh = data.join(format!("creatures/{mesh}.glb"));
        let fit = ["fit", mesh.to_str().unwrap(), "--template", template, "-o", "fitted.rig.ron"];
        let (code, said) = rigsmith(folder.path(), &fit);
        assert_eq!(code, 0, "{said}");
        let rig = rigsmith::files::load_template(&RealDisk, &folder.path().join("fitted.rig.ron")).unwrap().rig;
        let model = load_model(&RealDisk, &mesh).unwrap();
        let surface = Surface::build(&model.points, &model.point_triangles());
        let drawn = drawn(&rig, &surface);
        for (control, share, factor) in &drawn {
            assert!(*share >= 0.25, "{}: {control}: {share} outside, enlarged by {factor}", mesh.display());
        }
        // Feathers may be wider than any enlargement.
        let seen = drawn.iter().filter(|(_, share, _)| *share >= 0.5).count();
        assert!(seen * 9 >= drawn.len() * 8, "{}: {seen} of {}", mesh.display(), drawn.len());
        std::fs::remove_file(folder.path().join("fitted.rig.ron")).unwrap();
    }
}

/// A control at a null on its parent's place is as large as the bone that the null was made for asks.
#[test]
fn controls_of_hocks_are_as_large_as_feet_ask() {
    for (name, toes) in [("quadruped", "toes_"), ("bird", "toe_middle_")] {
        let rig = crate::bench::shipped(name);
        let built = Builder::build(&rig, &Arc::new(modules::all())).unwrap();
        for side in ["l", "r"] {
            let control = built.nodes.iter().find(|node| *node.name == *format!("hock_{side}")).unwrap();
            let toe = rig.labelled(&format!("{toes}{side}")).unwrap();
            let foot = rig.walk().find(|joint| joint.data.uid == toe).unwrap().parent.unwrap();
            let bone = rig.position(foot).distance(rig.position(toe));
            let size = control.control.as_ref().unwrap().size;
            assert!((0.3..=1.0).contains(&(size / bone)), "{name}: hock_{side}: {size} at a foot of {bone}");
        }
    }
}

/// The control of the whole figure lies flat, also where the hips lead sideways: it stands at a null of its own.
#[test]
fn the_root_lies_flat_wherever_the_hips_lead() {
    let text = r#"(format: 2, name: "root", joints: [
        (label: "hips", translation: (0, 1, 0), tags: [
            null(world: true, orient: false, translate: (0, -1, 0), creation: (name: "origin")),
            control(at: "@command null/origin", parent: "@command null/origin", follow: false, shape: "four_arrows",
                size: 0.5, creation: (name: "root")),
        ]),
        (label: "spine", parent: "hips", translation: (0, 0.1, 0)),
        (label: "thigh_l", parent: "hips", translation: (0.3, -0.05, 0)),
        (label: "thigh_r", parent: "hips", translation: (-0.3, -0.05, 0)),
    ])"#;
    let rig = rigsmith::rig::template::read_template(text.as_bytes()).unwrap().rig;
    let built = Builder::build(&rig, &Arc::new(modules::all())).unwrap();
    let root = built.nodes.iter().find(|node| *node.name == *"root").unwrap();
    let lines = lines_of(root.control.as_ref().unwrap(), bevy::math::Affine3A::IDENTITY);
    assert!(lines.iter().flatten().count() > 10);
    assert!(lines.iter().flatten().all(|point| point.y.abs() < 1e-4), "{lines:?}");
}

#[test]
fn below_an_open_sheet_is_outside() {
    let corners =
        [Vec3::new(-9.0, 0.0, -9.0), Vec3::new(9.0, 0.0, -9.0), Vec3::new(9.0, 0.0, 9.0), Vec3::new(-9.0, 0.0, 9.0)];
    for faces in [[[0, 1, 2], [0, 2, 3]], [[2, 1, 0], [3, 2, 0]]] {
        let sheet = Surface::build(&corners, &faces);
        for side in [-0.5, 0.5] {
            assert!(!is_inside(&sheet, Vec3::new(0.1, side, 0.2)), "{side}");
        }
    }
}

#[test]
fn a_written_size_stays_unless_it_lies_in_the_flesh() {
    let surface = flesh(1.0);
    for (size, grows) in [(0.5, true), (1.3, false), (1.6, false)] {
        let text = format!("(format: 2, name: \"one\", joints: [(label: \"one\", tags: [control(size: {size:?})])])");
        let rig = rigsmith::rig::template::read_template(text.as_bytes()).unwrap().rig;
        let drawn = drawn(&rig, &surface);
        let (_, share, factor) = &drawn[0];
        assert!(*share >= 0.5 && (*factor > 1.0) == grows, "{size}: {share} outside, enlarged by {factor}");
    }
}
