//! Another version of a mesh takes its place: joints stay, weights are transferred, undo and redo go both ways.

use std::sync::Arc;

use bevy::{math::Vec3, prelude::*};
use rigsmith::{
    headless::headless_app,
    mesh::model::Model,
    plugins::{
        document::Change,
        mesh_reload::{ReloadAnswer, ReloadError, ReloadRequest},
        skinning::{BindAnswer, BindRequest},
        surface::{RigMesh, SkinOf},
    },
    prelude::*,
    test_app::strict_app,
};

use crate::{bench::RigBench, gestures::boxes};

struct Bench {
    base: RigBench,
    mesh: Entity,
}

impl Bench {
    /// Two joints in a tower of boxes, bound.
    fn new() -> Self {
        let mut base = RigBench::with(strict_app(headless_app(3)), Rig::new(Uid(1), "rig"));
        let mesh = base.app.world_mut().spawn((RigMesh::new(Uid(9), tower(1.0), Vec::new()), SkinOf(base.rig))).id();
        let mut bench = Self { base, mesh };
        bench.base.app.update();
        let positions = vec![Vec3::ZERO, Vec3::Y, Vec3::Y * 2.0];
        bench.base.change(Change::Do(Operation::Chain { positions, parent: None }));
        bench.base.ask::<_, BindAnswer>(BindRequest::new(mesh));
        bench.base.app.update();
        assert!(bench.skin().is_some());
        bench
    }

    fn reload(&mut self, model: Model) -> Result<rigsmith::plugins::mesh_reload::ReloadReport, ReloadError> {
        let request = ReloadRequest { mesh: self.mesh, model: Arc::new(model) };
        let result = self.base.ask::<_, ReloadAnswer>(request).result;
        self.base.frames(2);
        result
    }

    fn skin(&self) -> Option<usize> {
        self.base.rig().skin(Uid(9)).map(|skin| skin.weights.len())
    }

    fn points(&self) -> usize {
        self.base.get::<RigMesh>(self.mesh).unwrap().rest.points.len()
    }
}

/// Boxes above one another, as wide as `width`.
fn tower(width: f32) -> Model {
    let half = 0.2 * width;
    boxes(&(0..5).map(|n| n as f32 * 0.4).map(|y| [[-half, y, -half], [half, y + 0.4, half]]).collect::<Vec<_>>())
}

#[test]
fn weights_follow_the_next_version_and_the_history() {
    let mut bench = Bench::new();
    let (joints, points) = (bench.base.rig().len(), bench.points());
    let wider = bench.reload(tower(1.1)).unwrap();
    assert_eq!((wider.points, bench.base.rig().len()), ([points; 2], joints));
    assert!((wider.moved - 0.02 * 2.0_f32.sqrt()).abs() < 1e-4, "{}", wider.moved);
    // More boxes: other points, each with weights.
    let mut more = tower(1.0);
    let extra = boxes(&[[[-0.1, 2.0, -0.1], [0.1, 2.2, 0.1]]]);
    let first = more.points.len() as u32;
    more.points.extend(&extra.points);
    let mut part = extra.parts[0].clone();
    part.vertices.iter_mut().for_each(|point| *point += first);
    part.object = 0;
    more.parts.push(part);
    let report = bench.reload(more).unwrap();
    assert_eq!(report.points, [points, points + 8]);
    assert_eq!((bench.points(), bench.skin()), (points + 8, Some(points + 8)));

    for (undo, expected) in [(true, points), (true, points), (false, points), (false, points + 8), (true, points)] {
        bench.base.change(if undo { Change::Undo } else { Change::Redo });
        bench.base.app.update();
        assert_eq!((bench.points(), bench.skin()), (expected, Some(expected)), "mesh and weights belong together");
    }
}

/// The exchange waits while steps can be redone, and takes the weights that are there when it comes.
#[test]
fn a_late_version_never_cuts_off_undone_steps() {
    let mut bench = Bench::new();
    let points = bench.points();
    bench.base.change(Change::Do(Operation::Place { position: Vec3::Y * 3.0, parent: None }));
    let joints = bench.base.rig().len();
    bench.base.change(Change::Undo);
    let mut more = tower(1.0);
    more.points.push(Vec3::Y);
    bench.base.app.world_mut().write_message(ReloadRequest { mesh: bench.mesh, model: Arc::new(more) });
    bench.base.next_message::<rigsmith::plugins::landing::ResultHeld>();
    bench.base.frames(5);
    assert_eq!(bench.points(), points, "it waits");
    bench.base.change(Change::Redo);
    assert_eq!(bench.base.rig().len(), joints, "the step was not lost");
    bench.base.next_message::<ReloadAnswer>();
    bench.base.frames(2);
    assert_eq!((bench.points(), bench.skin()), (points + 1, Some(points + 1)));
}

#[test]
fn a_version_that_is_none_changes_nothing() {
    let mut bench = Bench::new();
    let before = (bench.points(), bench.skin());
    assert_eq!(bench.reload(Model::default()), Err(ReloadError::Empty));
    assert_eq!((bench.points(), bench.skin()), before);
    // A mesh without weights is exchanged alone.
    let rig = bench.base.app.world_mut().spawn(Rig::new(Uid(2), "bare")).id();
    let mesh = bench.base.app.world_mut().spawn((RigMesh::new(Uid(8), tower(1.0), Vec::new()), SkinOf(rig))).id();
    bench.mesh = mesh;
    let report = bench.reload(tower(2.0)).unwrap();
    assert_eq!(report.weights, None);
}
