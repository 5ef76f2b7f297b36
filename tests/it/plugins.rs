//! The plugins in an app: joint entities follow the rig, surfaces follow the pose, work in the background can be stopped.

use std::panic::{AssertUnwindSafe, catch_unwind};

use bevy::{ecs::schedule::ScheduleLabel, prelude::*};
use rigsmith::{
    headless::headless_app,
    mesh::{model::Weights, ray::Ray},
    plugins::{
        document::{ChangeError, GroupEntities, NodeLabel},
        landing::ResultHeld,
        schema::InGroup,
        skinning::{SkinningError, SkinningJob},
    },
    prelude::*,
    rig::{RestTransform, SkinData},
    test_app::strict_app,
};

use crate::{
    bench::{RigBench, begin_drag},
    gestures::boxes,
};

impl RigBench {
    /// A component of a joint's entity.
    fn of_joint<C: Component>(&self, joint: Uid) -> Option<&C> {
        self.get(self.find(joint)?)
    }

    /// Opens a mesh and waits for its surface.
    fn open(&mut self, corners: &[[[f32; 3]; 2]]) -> Entity {
        let mesh = RigMesh::new(Uid(99), boxes(corners), Vec::new());
        let mesh = self.app.world_mut().spawn((mesh, SkinOf(self.rig))).id();
        self.wait("the surface", |bench| bench.surface().is_some_and(|surface| surface.ready().is_some()));
        mesh
    }

    /// Distances along a ray from (x, y, 10) to the front.
    fn hits(&self, x: f32, y: f32) -> Vec<f32> {
        let ray = Ray { origin: Vec3::new(x, y, 10.0), direction: Vec3::NEG_Z };
        self.surface().unwrap().hits(&ray).iter().map(|hit| hit.distance).collect()
    }
}

#[test]
fn joint_entities_follow_the_rig() {
    let mut bench = RigBench::new();
    let joints = bench.chain(&[[0.0, 1.0, 0.0], [0.0, 2.0, 0.0], [1.0, 2.0, 0.0]]);
    let entities: Vec<Entity> = joints.iter().map(|joint| bench.find(*joint).unwrap()).collect();
    assert_eq!(bench.of_joint::<ChildOf>(joints[0]).unwrap().parent(), bench.rig);
    assert_eq!(bench.of_joint::<ChildOf>(joints[2]).unwrap().parent(), entities[1]);
    assert_eq!(bench.of_joint::<Uid>(joints[1]), Some(&joints[1]));
    assert_eq!(bench.of_joint::<NodeOf>(joints[1]).unwrap().0, bench.rig);
    let end = bench.of_joint::<GlobalTransform>(joints[2]).unwrap().translation();
    assert!(end.distance(Vec3::new(1.0, 2.0, 0.0)) < 1e-6, "{end}");

    let drawn = bench.of_joint::<NodeLabel>(joints[1]).cloned();
    assert_eq!(drawn, Some(NodeLabel("arm_l_2".into())), "joints are named when they are drawn");
    bench.edit(Operation::Labels(vec![(joints[1], "arm_l".into())]));
    assert_eq!(bench.of_joint::<NodeLabel>(joints[1]), Some(&NodeLabel("arm_l".into())));
    assert_eq!(bench.of_joint::<Name>(joints[1]).map(Name::as_str), Some("arm_l"));
    bench.edit(Operation::Group { joints: vec![joints[1]], name: "g".into(), color: None });
    let group = bench.app.world().get::<GroupEntities>(bench.rig).unwrap().get(bench.rig().groups()[0].uid).unwrap();
    assert_eq!(bench.of_joint::<InGroup>(joints[1]), Some(&InGroup(group)));
    bench.change(Change::Undo);
    bench.change(Change::Undo);
    assert_eq!(bench.of_joint::<NodeLabel>(joints[1]), drawn.as_ref());
    assert_eq!(bench.of_joint::<Name>(joints[1]).map(Name::as_str), Some("arm_l_2"));
    assert!(bench.of_joint::<InGroup>(joints[1]).is_none());

    bench.edit(Operation::Reparent { joints: vec![joints[2]], parent: Some(joints[0]) });
    assert_eq!(bench.of_joint::<ChildOf>(joints[2]).unwrap().parent(), entities[0]);
    let local = bench.of_joint::<Transform>(joints[2]).unwrap().translation;
    assert!(local.distance(Vec3::new(1.0, 1.0, 0.0)) < 1e-6, "{local}");

    bench.edit(Operation::Delete { joints: vec![joints[0]], keep_children: true });
    assert!(bench.app.world().get_entity(entities[0]).is_err(), "its entity is gone");
    assert_eq!(bench.find(joints[0]), None);
    for joint in &joints[1..] {
        assert_eq!(
            bench.of_joint::<ChildOf>(*joint).unwrap().parent(),
            bench.rig,
            "kept, though its parent's entity is gone"
        );
    }
    assert_eq!([1, 2].map(|i| bench.find(joints[i]).unwrap()), [entities[1], entities[2]], "the same entities");
    bench.change(Change::Undo);
    let root = bench.find(joints[0]).unwrap();
    assert_eq!(bench.of_joint::<ChildOf>(joints[1]).unwrap().parent(), root);
    let all = bench.app.world_mut().query::<&Joint>().iter(bench.app.world()).count();
    assert_eq!(all, 3);
    bench.edit(Operation::Delete { joints: vec![joints[0]], keep_children: false });
    let all = bench.app.world_mut().query::<&Joint>().iter(bench.app.world()).count();
    assert_eq!(all, 0);
}

#[test]
fn a_pose_stays_on_top_of_the_rest_pose() {
    let mut bench = RigBench::new();
    let joints = bench.chain(&[[0.0, 1.0, 0.0], [0.0, 2.0, 0.0]]);
    let entity = bench.find(joints[1]).unwrap();
    let turn = Quat::from_rotation_z(0.5);
    bench.app.world_mut().get_mut::<Transform>(entity).unwrap().rotation = turn;
    bench.edit(Operation::Move {
        to: vec![(joints[1], Vec3::new(0.5, 2.0, 0.0)), (joints[0], Vec3::Y)],
        with_children: true,
    });
    let pose = *bench.of_joint::<Transform>(joints[1]).unwrap();
    assert!(pose.translation.distance(Vec3::new(0.5, 1.0, 0.0)) < 1e-6, "{pose:?}");
    assert!(pose.rotation.angle_between(turn) < 1e-3, "{pose:?}");
    assert_eq!(bench.of_joint::<RestTransform>(joints[1]).unwrap().rotation, Quat::IDENTITY);
    bench.edit(Operation::Labels(vec![(joints[0], "x".into())]));
    assert_eq!(*bench.of_joint::<Transform>(joints[1]).unwrap(), pose, "what does not move leaves the pose alone");
}

#[test]
fn refusals_and_edits_are_told() {
    let mut bench = RigBench::new();
    let stranger = bench.app.world_mut().spawn_empty().id();
    bench.app.world_mut().write_message(EditRequest::operation(stranger, Operation::Lock(Vec::new(), true)));
    bench.app.update();
    let refused = bench.messages::<EditRefusal>();
    assert!(
        refused.len() == 1 && refused[0].rig == stranger && refused[0].reason == ChangeError::NoRig(stranger),
        "{refused:?}"
    );
    bench.change(Change::Undo);
    assert_eq!(bench.messages::<EditRefusal>()[0].reason, ChangeError::NothingToUndo);
    bench.change(Change::Redo);
    assert_eq!(bench.messages::<EditRefusal>()[0].reason, ChangeError::NothingToRedo);
    bench.edit(Operation::Lock(vec![Uid(5)], true));
    assert!(bench.messages::<EditRefusal>()[0].reason.to_string().contains("no joint"));
    assert!(bench.messages::<EditReport>().is_empty());
    bench.edit(Operation::Place { position: Vec3::ZERO, parent: None });
    let edited = bench.messages::<EditReport>();
    assert!(edited.len() == 1 && edited[0].rig == bench.rig && edited[0].name == "Place joint");
}

#[test]
fn several_rigs_do_not_meet() {
    let mut bench = RigBench::new();
    let other = bench.app.world_mut().spawn(Rig::default()).id();
    bench.chain(&[[0.0; 3], [1.0; 3]]);
    assert!(bench.app.world().get::<Rig>(other).unwrap().is_empty());
    bench.app.world_mut().entity_mut(other).despawn();
    bench.app.update();
    assert_eq!(bench.rig().len(), 2);
    bench.app.world_mut().entity_mut(bench.rig).despawn();
    bench.app.update();
    assert_eq!(bench.app.world_mut().query::<&Joint>().iter(bench.app.world()).count(), 0);
}

#[test]
fn the_surface_follows_the_pose() {
    let mut bench = RigBench::new();
    let joints = bench.chain(&[[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    // Two boxes, one above the other: each held by one joint.
    bench.open(&[[[-0.2, 0.0, -0.2], [0.2, 1.0, 0.2]], [[-0.2, 1.0, -0.2], [0.2, 2.0, 0.2]]]);
    let mut weights = Weights::default();
    for point in 0..16 {
        weights.push([(u32::from(point >= 8), 1.0)]);
    }
    let skin = SkinData { joints: joints.clone(), weights, at_rest: true, ..Default::default() };
    bench.edit(Operation::Edits(vec![RigEdit::SetSkin(Uid(99), Some(skin.into()))]));
    assert_eq!((bench.hits(0.0, 1.5).len(), bench.hits(0.7, 1.0).len()), (2, 0));
    let pose = |bench: &mut RigBench, rotation: Quat| {
        let entity = bench.find(joints[1]).unwrap();
        bench.app.world_mut().get_mut::<Transform>(entity).unwrap().rotation = rotation;
        bench.app.update();
    };
    // The upper box falls over to the left; at once, while the hierarchy is refitted, and afterwards.
    pose(&mut bench, Quat::from_rotation_z(-std::f32::consts::FRAC_PI_2));
    for _ in 0..2 {
        assert_eq!((bench.hits(0.03, 1.7).len(), bench.hits(0.01, 0.5).len()), (0, 2));
        let fallen = bench.hits(0.7, 1.03);
        assert!(fallen.len() == 2 && (fallen[0] - 9.8).abs() < 1e-4 && (fallen[1] - 10.2).abs() < 1e-4, "{fallen:?}");
        bench.wait("the refit", |bench| bench.surface().unwrap().ready().is_some());
    }
    let high = bench.surface().unwrap().bounds()[1];
    assert!(high.distance(Vec3::new(1.0, 1.2, 0.2)) < 1e-4, "{high}");
    // Picking means the posed joint's place, placing the posed surface.
    let rig = bench.rig;
    let ray = Ray { origin: Vec3::new(0.7, 1.03, 10.0), direction: Vec3::NEG_Z };
    bench.app.world_mut().write_message(PlaceRequest { rig, ray, settings: PlaceSettings::default() });
    bench.app.update();
    let placed = bench.rig().walk().last().unwrap().data.uid;
    assert!(bench.rig().position(placed).distance(Vec3::new(0.7, 1.03, 0.0)) < 1e-4);
    pose(&mut bench, Quat::IDENTITY);
    bench.wait("the refit", |bench| bench.surface().unwrap().ready().is_some());
    assert_eq!((bench.hits(0.03, 1.7).len(), bench.hits(0.7, 1.03).len()), (2, 0));
    // A joint moved at rest leaves the mesh where it is.
    bench.edit(Operation::Move { to: vec![(joints[1], Vec3::new(0.0, 1.1, 0.0))], with_children: false });
    assert_eq!(bench.hits(0.03, 1.7).len(), 2);
}

#[test]
fn a_rig_that_stands_elsewhere_has_the_same_surface() {
    let mut bench = RigBench::new();
    bench.chain(&[[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    bench.open(&[[[-0.2, 0.0, -0.2], [0.2, 1.0, 0.2]]]);
    *bench.app.world_mut().get_mut::<Transform>(bench.rig).unwrap() =
        Transform::from_xyz(5.0, -3.0, 2.0).with_rotation(Quat::from_rotation_y(1.0));
    bench.app.update();
    bench.app.update();
    assert_eq!(bench.hits(0.05, 0.5).len(), 2);
}

#[test]
fn skinning_runs_in_the_background_and_can_be_stopped() {
    let mut bench = RigBench::new();
    let joints = bench.chain(&[[0.0, 0.1, 0.0], [0.0, 0.9, 0.0]]);
    let mesh = bench.open(&[[[-0.2, 0.0, -0.2], [0.2, 1.0, 0.2]]]);
    let request = || BindRequest::new(mesh);
    bench.app.world_mut().write_message(request());
    bench.app.update();
    bench.wait("the weights", |bench| bench.rig().skin(Uid(99)).is_some());
    let skin = bench.rig().skin(Uid(99)).unwrap();
    assert_eq!((skin.weights.len(), &skin.joints), (8, &joints));
    let bound = bench.messages::<BindAnswer>();
    assert!(bound.len() == 1 && bound[0].mesh == mesh && bound[0].result.is_ok(), "{bound:?}");
    bench.change(Change::Undo);
    assert!(bench.rig().skin(Uid(99)).is_none(), "one step of the history");

    // Nothing lands during a drag, however fast two hundred thousand points are done.
    begin_drag(&mut bench.app, bench.rig);
    let grid: Vec<[[f32; 3]; 2]> = (0..25_000)
        .map(|i| {
            let (x, y, z) = ((i % 30) as f32, (i / 30 % 30) as f32, (i / 900) as f32);
            [[x * 0.03, y * 0.03, z * 0.03], [x * 0.03 + 0.029, y * 0.03 + 0.029, z * 0.03 + 0.029]]
        })
        .collect();
    let large = bench.app.world_mut().spawn((RigMesh::new(Uid(100), boxes(&grid), Vec::new()), SkinOf(bench.rig))).id();
    bench.app.world_mut().write_message(BindRequest { mesh: large, ..request() });
    bench.app.update();
    let job = bench.app.world().get::<SkinningJob>(large).expect("the job is under way");
    assert!((0.0..=1.0).contains(&job.progress()));
    job.cancel();
    bench.messages::<BindAnswer>();
    bench.wait("the end of the job", |bench| bench.app.world().get::<SkinningJob>(large).is_none());
    let bound = bench.messages::<BindAnswer>();
    assert!(bound.len() == 1 && bound[0].mesh == large && bound[0].result.is_err(), "{bound:?}");
    assert!(bench.rig().skin(Uid(100)).is_none());
    bench.change(Change::CancelPreview);

    let stranger = bench.app.world_mut().spawn_empty().id();
    bench.app.world_mut().write_message(BindRequest { mesh: stranger, ..request() });
    bench.app.update();
    assert_eq!(bench.messages::<BindAnswer>()[0].result, Err(SkinningError::NoRig));
}

#[derive(Resource, Default)]
struct Number(u32);

fn double(mut number: ResMut<Number>) {
    number.0 *= 2;
}

fn increase(mut number: ResMut<Number>) {
    number.0 += 1;
}

#[test]
fn ambiguous_systems_are_refused_in_every_schedule() {
    let schedules = [
        PreStartup.intern(),
        Startup.intern(),
        PreUpdate.intern(),
        Update.intern(),
        PostUpdate.intern(),
        Last.intern(),
    ];
    for schedule in schedules {
        let mut app = headless_app(1);
        app.init_resource::<Number>().add_systems(schedule, (double, increase));
        let mut app = strict_app(app);
        let outcome = catch_unwind(AssertUnwindSafe(|| app.update()));
        let message = *outcome.expect_err("ambiguous systems run").downcast::<String>().unwrap();
        assert!(message.contains("double") && message.contains("increase"), "{schedule:?}: {message}");
        let mut app = headless_app(1);
        app.init_resource::<Number>().add_systems(schedule, (double, increase).chain());
        strict_app(app).update();
    }
}

/// Undoing while weights are computed must lose neither the undone steps nor put weights onto a rig without joints.
#[test]
fn a_late_result_never_cuts_off_undone_steps() {
    let mut bench = RigBench::new();
    bench.chain(&[[0.0, 0.1, 0.0], [0.0, 0.9, 0.0]]);
    bench.edit(Operation::Place { position: Vec3::new(0.1, 0.5, 0.0), parent: None });
    let boxes: Vec<[[f32; 3]; 2]> = (0..5000)
        .map(|i| {
            let low = [(i % 20) as f32 * 0.02 - 0.2, (i / 400) as f32 * 0.08, (i / 20 % 20) as f32 * 0.02 - 0.2];
            [low, low.map(|at| at + 0.018)]
        })
        .collect();
    let mesh = bench.open(&boxes);
    let whole = bench.rig().clone();
    let start = |bench: &mut RigBench| {
        bench.messages::<BindAnswer>();
        bench.messages::<ResultHeld>();
        // The weights come after the steps are undone, however fast they are computed: a drag holds them.
        begin_drag(&mut bench.app, bench.rig);
        bench.app.world_mut().write_message(BindRequest::new(mesh));
        bench.app.update();
        assert!(bench.app.world().get::<SkinningJob>(mesh).is_some(), "it lands after the drag");
        for _ in 0..2 {
            bench.app.world_mut().write_message(EditRequest { rig: bench.rig, change: Change::Undo });
        }
        bench.app.update();
        assert!(bench.rig().is_empty());
    };

    // Held while the steps can be redone, and bound to the very state it was computed for.
    start(&mut bench);
    let held = |bench: &RigBench| !bench.app.world().resource::<Messages<ResultHeld>>().is_empty();
    bench.wait("the word that the result waits", held);
    assert!(bench.messages::<BindAnswer>().is_empty() && bench.rig().skin(Uid(99)).is_none());
    bench.change(Change::Redo);
    bench.change(Change::Redo);
    assert_eq!(*bench.rig(), whole, "nothing was lost");
    bench.wait("the weights", |bench| bench.rig().skin(Uid(99)).is_some());
    bench.change(Change::Undo);
    assert_eq!(*bench.rig(), whole);

    // Dropped once the person has gone another way.
    start(&mut bench);
    bench.edit(Operation::Place { position: Vec3::new(0.0, 0.5, 0.0), parent: None });
    bench.wait("the end of the job", |bench| bench.app.world().get::<SkinningJob>(mesh).is_none());
    let bound = bench.messages::<BindAnswer>();
    assert!(bound.len() == 1 && bound[0].result.is_err(), "{bound:?}");
    assert!(bench.rig().skin(Uid(99)).is_none());
}
