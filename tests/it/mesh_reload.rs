//! Another version of a mesh takes its place: joints stay, weights are transferred, undo and redo go both ways.

use std::sync::Arc;

use bevy::{math::Vec3, prelude::*};
use rigsmith::{
    headless::headless_app,
    mesh::model::Model,
    plugins::{
        document::{Change, EditRequest},
        mesh_reload::{ReloadAnswer, ReloadError, ReloadRequest},
        skinning::{BindAnswer, BindRequest},
        surface::{RigMesh, SkinOf},
    },
    prelude::*,
    test_app::strict_app,
};

use crate::gestures::boxes;

struct Bench {
    app: App,
    rig: Entity,
    mesh: Entity,
}

impl Bench {
    /// Two joints in a tower of boxes, bound.
    fn new() -> Self {
        let mut app = strict_app(headless_app(3));
        let rig = app.world_mut().spawn(Rig::new(Uid(1), "rig")).id();
        let mesh = app.world_mut().spawn((RigMesh::new(Uid(9), tower(1.0), Vec::new()), SkinOf(rig))).id();
        let mut bench = Self { app, rig, mesh };
        bench.app.update();
        let positions = vec![Vec3::ZERO, Vec3::Y, Vec3::Y * 2.0];
        bench.change(Change::Do(Operation::Chain { positions, parent: None }));
        let request = BindRequest::new(mesh);
        bench.app.world_mut().write_message(request);
        bench.until::<BindAnswer>();
        bench.app.update();
        assert!(bench.skin().is_some());
        bench
    }

    fn until<M: Message + Clone>(&mut self) -> M {
        let start = std::time::Instant::now();
        loop {
            self.app.update();
            if let Some(message) = self.app.world_mut().resource_mut::<Messages<M>>().drain().last() {
                return message;
            }
            assert!(start.elapsed() < crate::bench::HANG);
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    }

    fn change(&mut self, change: Change) {
        self.app.world_mut().write_message(EditRequest { rig: self.rig, change });
        self.app.update();
    }

    fn reload(&mut self, model: Model) -> Result<rigsmith::plugins::mesh_reload::ReloadReport, ReloadError> {
        self.app.world_mut().write_message(ReloadRequest { mesh: self.mesh, model: Arc::new(model) });
        let result = self.until::<ReloadAnswer>().result;
        (0..2).for_each(|_| self.app.update());
        result
    }

    fn rig(&self) -> &Rig {
        self.app.world().get::<Rig>(self.rig).unwrap()
    }

    fn skin(&self) -> Option<usize> {
        self.rig().skin(Uid(9)).map(|skin| skin.weights.len())
    }

    fn points(&self) -> usize {
        self.app.world().get::<RigMesh>(self.mesh).unwrap().rest.points.len()
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
    let (joints, points) = (bench.rig().len(), bench.points());
    let wider = bench.reload(tower(1.1)).unwrap();
    assert_eq!((wider.points, bench.rig().len()), ([points; 2], joints));
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
        bench.change(if undo { Change::Undo } else { Change::Redo });
        bench.app.update();
        assert_eq!((bench.points(), bench.skin()), (expected, Some(expected)), "mesh and weights belong together");
    }
}

/// The exchange waits while steps can be redone, and takes the weights that are there when it comes.
#[test]
fn a_late_version_never_cuts_off_undone_steps() {
    let mut bench = Bench::new();
    let points = bench.points();
    bench.change(Change::Do(Operation::Place { position: Vec3::Y * 3.0, parent: None }));
    let joints = bench.rig().len();
    bench.change(Change::Undo);
    let mut more = tower(1.0);
    more.points.push(Vec3::Y);
    bench.app.world_mut().write_message(ReloadRequest { mesh: bench.mesh, model: Arc::new(more) });
    bench.until::<rigsmith::plugins::landing::ResultHeld>();
    (0..5).for_each(|_| bench.app.update());
    assert_eq!(bench.points(), points, "it waits");
    bench.change(Change::Redo);
    assert_eq!(bench.rig().len(), joints, "the step was not lost");
    bench.until::<ReloadAnswer>();
    (0..2).for_each(|_| bench.app.update());
    assert_eq!((bench.points(), bench.skin()), (points + 1, Some(points + 1)));
}

#[test]
fn a_version_that_is_none_changes_nothing() {
    let mut bench = Bench::new();
    let before = (bench.points(), bench.skin());
    assert_eq!(bench.reload(Model::default()), Err(ReloadError::Empty));
    assert_eq!((bench.points(), bench.skin()), before);
    // A mesh without weights is exchanged alone.
    let rig = bench.app.world_mut().spawn(Rig::new(Uid(2), "bare")).id();
    let mesh = bench.app.world_mut().spawn((RigMesh::new(Uid(8), tower(1.0), Vec::new()), SkinOf(rig))).id();
    bench.mesh = mesh;
    let report = bench.reload(tower(2.0)).unwrap();
    assert_eq!(report.weights, None);
}
