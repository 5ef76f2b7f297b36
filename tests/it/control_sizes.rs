//! Sizes of control shapes on a body: none lies in the flesh.

use std::{path::Path, sync::Arc, time::Duration};

use bevy::math::Vec3;
use rigsmith::{
    algo::control_size::{OUTSIDE, clear_factor, is_inside, outside_share},
    files::{RealDisk, load_model},
    headless::Workbench,
    mesh::surface::Surface,
    modules,
    plugins::{
        commands::{BuildResult, BuildStep, BuiltEntities},
        controls::{outline::lines_of, size::MeasuredShapes, size::ShapeFactor},
        surface::RigMeshes,
    },
    processor::Builder,
    rig::BuiltRig,
};

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

/// Runs frames until the shapes of the rig's controls are measured.
fn measured(bench: &mut Workbench) {
    for _ in 0..20_000 {
        let rig = bench.rig_entity();
        bench.app_mut().update();
        let world = bench.app_mut().world();
        let is_done = |measured: &MeasuredShapes| !measured.is_busy();
        if world.get::<RigMeshes>(rig).is_some() && world.get::<MeasuredShapes>(rig).is_some_and(is_done) {
            return bench.app_mut().update();
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    panic!("the shapes are not measured");
}

/// Controls of a built rig: name, share of its shape outside of the mesh as it is drawn, and the factor.
fn shares(bench: &mut Workbench, surface: &Surface) -> Vec<(String, f32, f32)> {
    let rig = bench.rig_entity();
    let world = bench.app_mut().world();
    let built: Arc<BuiltRig> = world.get::<BuildResult>(rig).unwrap().0.clone();
    let entities = world.get::<BuiltEntities>(rig).unwrap();
    let mut found = Vec::new();
    for (at, node) in built.nodes.iter().enumerate() {
        let Some(control) = &node.control else { continue };
        let mut place = node.base.affine();
        let mut above = built.nodes[at].parent;
        while let Some(parent) = above {
            place = built.nodes[parent].base.affine() * place;
            above = built.nodes[parent].parent;
        }
        let factor = entities.get(node.uid).and_then(|entity| world.get::<ShapeFactor>(entity)).map_or(1.0, |f| f.0);
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
