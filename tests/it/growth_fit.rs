//! Growth of the work of a fit, counted, in meshes whose triangles lie over each other, and wishes that are refused before any
//! work.

use std::{path::Path, sync::Arc};

use glam::Vec3;
use rigsmith::{
    algo::fit_template::MeshAnalysis,
    files::{RealDisk, bundled_characters, load_model},
    headless::{Workbench, WorkbenchError},
    mesh::{model::Model, surface::Surface},
    plugins::fit::{FitFailure, FitTemplate, FitTemplates},
};

/// Points and triangles.
type Mesh = (Vec<Vec3>, Vec<[u32; 3]>);

/// Triangles that all share one edge, on both sides of it.
fn shared_edge(count: usize) -> Mesh {
    let mut points = vec![Vec3::ZERO, Vec3::Y * 2.0];
    points.extend((0..count).map(|number| {
        let (column, row) = (number % 1000, number / 1000);
        Vec3::new(column as f32 / 500.0 - 1.0, 1.0, 0.05 + row as f32 / 50.0)
    }));
    let triangles = (0..count as u32).map(|number| [0, 1, number + 2]).collect();
    (points, triangles)
}

/// Two cones of long triangles on one ring.
fn cones(count: usize) -> Mesh {
    let mut points = vec![Vec3::Y * 2.0, Vec3::ZERO];
    points.extend((0..count).map(|number| {
        let (sin, cos) = bevy::math::ops::sin_cos(std::f32::consts::TAU * number as f32 / count as f32);
        Vec3::new(cos, 0.0, sin)
    }));
    let ring = |number: u32| 2 + number % count as u32;
    let triangles =
        (0..count as u32).flat_map(|at| [[0, ring(at), ring(at + 1)], [1, ring(at + 1), ring(at)]]).collect();
    (points, triangles)
}

fn bundled_body() -> Model {
    load_model(&RealDisk, &Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/biped.obj")).unwrap()
}

fn is_crowded((points, triangles): &Mesh) -> bool {
    MeshAnalysis::new(points, triangles, None, &|_| true).unwrap().is_crowded()
}

#[test]
fn triangles_over_each_other_bound_the_looks_for_nearest_points() {
    for count in [4000, 8000] {
        assert!(is_crowded(&shared_edge(count)), "{count} triangles share an edge");
        assert!(is_crowded(&cones(count)), "{count} triangles share a corner");
    }
    let body = bundled_body();
    assert!(!is_crowded(&(body.points.clone(), body.point_triangles())), "a body is looked at exactly");
}

/// A bounded look takes no more leaves for more triangles; where there are enough, its answer is the exact one.
#[test]
fn bounded_looks_take_as_few_leaves_for_more_triangles() {
    let place = Vec3::new(0.0, 1.0, -0.3);
    for count in [2000, 4000, 8000] {
        let (points, triangles) = shared_edge(count);
        let surface = Surface::build(&points, &triangles);
        let (exact, all) = surface.closest_point_within(place, usize::MAX);
        assert!(all > count / 16, "{all} leaves of {count} triangles: the look is no trial");
        assert_eq!(exact, surface.closest_point(place));
        let (found, leaves) = surface.closest_point_within(place, 32);
        assert_eq!(leaves, 32);
        let (found, exact) = (found.unwrap(), exact.unwrap());
        assert!((found.distance - exact.distance).abs() < 1e-4, "{found:?} instead of {exact:?}");
    }
    let body = bundled_body();
    let surface = Surface::build(&body.points, &body.point_triangles());
    for place in body.points.iter().step_by(97).map(|point| *point * 1.01) {
        let (found, leaves) = surface.closest_point_within(place, 1000);
        assert!(leaves < 1000, "{leaves} leaves");
        assert_eq!(found, surface.closest_point(place));
    }
}

/// A marker of a joint that the template lacks is refused before the mesh, which is flat, is looked at.
#[test]
fn unknown_joints_of_markers_are_told_before_the_mesh_is_looked_at() {
    let mut model = crate::gestures::boxes(&[[[0.0; 3], [1.0; 3]]]);
    model.points.iter_mut().for_each(|point| point.z = 0.0);
    for (template, text) in [
        (FitTemplate::Named("biped".to_owned()), "no joint of \"biped\" is called \"hend_l\"; did you mean \"hand_l\""),
        (FitTemplate::Choose, "no joint of any template is called \"hend_l\"; did you mean \"hand_l\""),
    ] {
        let mut bench = Workbench::new(7, "fit");
        bench.open(model.clone(), true).unwrap();
        bench.offer_templates(FitTemplates(Arc::new(bundled_characters)));
        let result = bench.fit(
            |request| {
                request.template = template;
                request.markers = vec![("hend_l".to_owned(), Vec3::ZERO)];
            },
            &mut |_| (),
        );
        let Err(error) = result else { panic!("fitted") };
        let is_of_marker = matches!(
            error,
            WorkbenchError::Fit(FitFailure::NoJoint { .. }) | WorkbenchError::Fit(FitFailure::NoJointOfAny { .. })
        );
        assert!(is_of_marker && error.to_string().starts_with(text), "{error}");
    }
}
