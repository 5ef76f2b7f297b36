//! The surface in the background: it follows the pose, leaves alone what an edit does not touch, and nobody waits for
//! it on the main thread.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use bevy::{math::Affine3A, prelude::*};
use rigsmith::{
    algo::{placement::Placement, stroke::stroke_chain, view::ViewPlane},
    mesh::{
        model::{Model, Weights},
        obj::{ObjSettings, read_model},
        ray::Ray,
        skinning::skin_points,
        surface::Surface,
    },
    plugins::{
        document::{HoveredNode, JointEntities},
        placement::PlaceRefusal,
        stroke::StrokeFailure,
    },
    prelude::*,
    rig::SkinData,
};

use crate::{
    bench::{HANG, RigBench, new_clip, undo_meanwhile},
    gestures::boxes,
};

const MESH: Uid = Uid(99);

impl RigBench {
    /// The bundled character on its template, held by the two joints nearest to each point.
    fn biped() -> Self {
        let assets = concat!(env!("CARGO_MANIFEST_DIR"), "/assets");
        let read = |name: &str| std::fs::read(format!("{assets}/{name}")).unwrap();
        let mut bench = Self::of(crate::bench::shipped("biped"));
        let obj = read("models/biped.obj");
        let model = read_model(obj.as_slice(), "biped", &ObjSettings::default(), &mut |_| None).unwrap();
        let skin = near_weights(bench.rig(), &model.points);
        bench.app.world_mut().spawn((RigMesh::new(MESH, model, Vec::new()), SkinOf(bench.rig)));
        bench.edit(Operation::Edits(vec![RigEdit::SetSkin(MESH, Some(skin.into()))]));
        bench.settle();
        bench
    }

    fn settle(&mut self) {
        self.wait("the surface", |bench| bench.surface().is_some_and(|surface| !surface.is_stale()));
    }

    fn labelled(&self, label: &str) -> Uid {
        self.rig().find_label(label).unwrap_or_else(|| panic!("no joint {label}"))
    }

    /// Turns a joint; the surface has been told when this returns.
    fn pose(&mut self, joint: Uid, rotation: Quat) {
        let entity = self.get::<JointEntities>(self.rig).unwrap().get(joint).unwrap();
        self.app.world_mut().get_mut::<Transform>(entity).unwrap().rotation = rotation;
        self.app.update();
    }
}

/// Weights of the two nearest joints.
fn near_weights(rig: &Rig, points: &[Vec3]) -> SkinData {
    let joints = rig.rest_globals();
    let mut weights = Weights::default();
    for point in points {
        let mut near: Vec<(f32, u32)> = joints
            .iter()
            .enumerate()
            .map(|(number, (_, joint))| (joint.translation.distance_squared(*point), number as u32))
            .collect();
        near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        weights.push([(near[0].1, 0.75), (near[1].1, 0.25)]);
    }
    SkinData { joints: joints.into_iter().map(|(uid, _)| uid).collect(), weights, at_rest: true, ..Default::default() }
}

/// Rays onto a grid of the front view.
fn rays() -> impl Iterator<Item = Ray> {
    (0..1600).map(|i| Ray {
        origin: Vec3::new((i % 40) as f32 * 0.05 - 0.98, (i / 40) as f32 * 0.05 - 0.01, 5.0),
        direction: Vec3::NEG_Z,
    })
}

#[test]
fn posed_answers_are_those_of_skinning_by_hand() {
    let mut bench = RigBench::biped();
    let rest = bench.surface().unwrap().shared().unwrap();
    for (label, turn) in [("upper_arm_l", Quat::from_rotation_z(0.8)), ("thigh_r", Quat::from_rotation_x(-1.2))] {
        let joint = bench.labelled(label);
        let rotation = turn * bench.rig().joint(joint).unwrap().data.rest.rotation;
        bench.pose(joint, rotation);
        let was_stale = bench.surface().unwrap().is_stale();
        bench.settle();
        assert!(was_stale, "a mesh of {} triangles is not refreshed within the frame", rest.triangle_count());
        let mesh = bench.app.world_mut().query::<&RigMesh>().single(bench.app.world()).unwrap().clone();
        let skin = bench.rig().skin(MESH).unwrap().clone();
        let entities = bench.get::<JointEntities>(bench.rig).unwrap();
        let matrices = skin.joints.iter().map(|uid| {
            let pose = bench.get::<GlobalTransform>(entities.get(*uid).unwrap()).unwrap().affine();
            pose * Affine3A::from(bench.rig().rest_global(*uid)).inverse()
        });
        let mut points = Vec::new();
        skin_points(&mesh.rest.points, &skin.weights, &matrices.collect::<Vec<_>>(), &mut points);
        let expected = Surface::build(&points, &mesh.triangles);
        let (mut hits, mut crossed, mut moved) = (Vec::new(), 0, 0);
        for ray in rays() {
            expected.hits(&ray, &mut hits);
            let found = bench.surface().unwrap().hits(&ray);
            crossed += hits.len();
            // A ray along an outline may meet it or not: rounding.
            let same = found.len() == hits.len()
                && found.iter().zip(&hits).all(|(a, b)| (a.distance - b.distance).abs() < 1e-4);
            moved += usize::from(!same);
        }
        assert!(crossed > 400 && moved <= 2, "{label}: {moved} rays of {crossed} hits differ");
        let bounds = bench.surface().unwrap().bounds();
        let [low, high] = [points.iter().copied().reduce(Vec3::min), points.iter().copied().reduce(Vec3::max)];
        assert!(bounds[0].distance(low.unwrap()) < 1e-4 && bounds[1].distance(high.unwrap()) < 1e-4, "{bounds:?}");
    }
    let mut hits = Vec::new();
    rest.hits(&Ray { origin: Vec3::new(0.0, 1.2, 5.0), direction: Vec3::NEG_Z }, &mut hits);
    assert!(!hits.is_empty(), "what somebody holds stays as it was");
}

#[test]
fn a_pose_is_refitted_once() {
    let mut bench = RigBench::biped();
    let joint = bench.labelled("upper_arm_l");
    let shown = |bench: &RigBench| Arc::as_ptr(&bench.surface().unwrap().shared().unwrap());
    for i in 1..9 {
        let (asked, before) = (bench.surface().unwrap().wanted(), shown(&bench));
        bench.pose(joint, Quat::from_rotation_z(0.1 * i as f32));
        bench.settle();
        let (after, at_rest) = (shown(&bench), bench.surface().unwrap().wanted());
        assert_eq!(at_rest, asked + 1, "one pose is one request");
        assert_ne!(before, after, "the pose has landed");
        bench.app.update();
        bench.app.update();
        assert_eq!((shown(&bench), bench.surface().unwrap().wanted()), (after, at_rest), "nothing is done twice");
    }
}

#[test]
fn while_a_joint_moves_the_latest_pose_wins() {
    let mut bench = RigBench::biped();
    let joint = bench.labelled("upper_arm_l");
    let shown = |bench: &RigBench| Arc::as_ptr(&bench.surface().unwrap().shared().unwrap());
    let first = bench.surface().unwrap().wanted();
    let (mut poses, mut landed, mut last) = (0, 0, shown(&bench));
    let started = Instant::now();
    // Poses go on until surfaces have landed while the joint was moving.
    while landed < 3 || poses < 50 {
        assert!(started.elapsed() < HANG, "the surface stands still while the joint moves");
        poses += 1;
        bench.pose(joint, Quat::from_rotation_z(0.0003 * poses as f32));
        std::thread::sleep(Duration::from_millis(1));
        landed += usize::from(std::mem::replace(&mut last, shown(&bench)) != last);
    }
    assert_eq!(bench.surface().unwrap().wanted() - first, poses, "each pose is asked for");
    // One that is under way, and one for all that came since.
    let mut after = vec![shown(&bench)];
    while bench.surface().unwrap().is_stale() {
        bench.app.update();
        after.push(shown(&bench));
    }
    assert!(after.windows(2).filter(|pair| pair[0] != pair[1]).count() <= 2);
}

#[test]
fn edits_leave_the_surface_alone() {
    let mut bench = RigBench::biped();
    let before = bench.surface().unwrap().shared().unwrap();
    let number = bench.surface().unwrap().wanted();
    let (hand, head) = (bench.labelled("hand_l"), bench.labelled("head"));
    let top = bench.rig().position(head) + Vec3::Y * 0.1;
    for operation in [
        Operation::Labels(vec![(hand, "other".into())]),
        Operation::Place { position: top, parent: Some(head) },
        Operation::Group { joints: vec![head], name: "g".into(), color: None },
        Operation::Move { to: vec![(head, top)], with_children: true },
        Operation::Delete { joints: vec![hand], keep_children: false },
    ] {
        bench.edit(operation.clone());
        assert!(bench.messages::<EditRefusal>().is_empty());
        bench.app.update();
        let surface = bench.surface().unwrap();
        assert!(surface.wanted() == number && !surface.is_stale(), "{operation:?}");
        assert!(Arc::ptr_eq(&surface.shared().unwrap(), &before), "{operation:?}");
    }
    for _ in 0..5 {
        bench.send(EditRequest { rig: bench.rig, change: Change::Undo });
    }
    assert!(bench.labelled("hand_l") == hand && Arc::ptr_eq(&bench.surface().unwrap().shared().unwrap(), &before));
    // The rig as a whole may move as well.
    bench.app.world_mut().get_mut::<Transform>(bench.rig).unwrap().translation = Vec3::new(0.5, 0.25, 2.0);
    bench.app.update();
    assert_eq!(bench.surface().unwrap().wanted(), number);
}

#[test]
fn a_broken_pose_leaves_triangles_out_until_it_is_repaired() {
    let mut bench = RigBench::biped();
    let joint = bench.labelled("upper_arm_l");
    let rest = bench.rig().joint(joint).unwrap().data.rest.rotation;
    let count = |bench: &RigBench| bench.surface().unwrap().ready().unwrap().triangle_count();
    let all = count(&bench);
    bench.pose(joint, Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0));
    bench.settle();
    assert!(count(&bench) < all && count(&bench) > all / 2, "the arm is left out: {} of {all}", count(&bench));
    bench.pose(joint, rest);
    bench.settle();
    assert_eq!(count(&bench), all);
}

#[test]
fn the_surface_goes_with_its_meshes() {
    let mut bench = RigBench::of(Rig::new(Uid(1), "rig"));
    let mut open = |uid: u64, x: f32| {
        let model = boxes(&[[[x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]]]);
        bench.app.world_mut().spawn((RigMesh::new(Uid(uid), model, Vec::new()), SkinOf(bench.rig))).id()
    };
    let meshes = [open(7, 0.0), open(5, 3.0)];
    bench.app.update();
    let high = |bench: &RigBench| bench.surface().map(|surface| surface.bounds()[1].x);
    assert_eq!(high(&bench), Some(4.0));
    bench.app.world_mut().despawn(meshes[1]);
    bench.app.update();
    assert_eq!(high(&bench), Some(1.0));
    bench.app.world_mut().despawn(meshes[0]);
    bench.app.update();
    assert_eq!(high(&bench), None);
}

#[test]
fn hovering_shows_what_a_click_picks() {
    let mut bench = RigBench::biped();
    let rig = bench.rig;
    let bounds = bench.surface().unwrap().bounds();
    let plane = ViewPlane::orthographic(View::Orbit(20.0, 10.0), bounds);
    let hovered = |bench: &RigBench| bench.get::<HoveredNode>(rig).unwrap().0;
    let reach = 0.01;
    let mut picks = 0;
    for i in 0..60 {
        let point = Vec2::new((i % 6) as f32 * 0.3 - 0.75, (i / 6) as f32 * 0.2 - 0.05);
        bench.send(HoverRequest { rig, what: Some((plane, point, reach)) });
        // Clicking on, the pointer at rest: each click takes what was shown before it.
        for _ in 0..3 {
            let shown = hovered(&bench);
            bench.messages::<PickAnswer>();
            bench.send(PickRequest { rig, what: Pick::Click { plane, point, reach }, add: false });
            let picked = bench.messages::<PickAnswer>();
            assert_eq!(picked[0].joints.first().copied(), shown, "at {point}");
            picks += picked[0].joints.len();
            bench.app.update();
        }
        // Another view is another spot, and so is the same one after an edit.
        let other = ViewPlane::orthographic(View::Front, bounds);
        bench.send(HoverRequest { rig, what: Some((other, point, reach)) });
        let shown = hovered(&bench);
        bench.messages::<PickAnswer>();
        bench.send(PickRequest { rig, what: Pick::Click { plane: other, point, reach }, add: false });
        assert_eq!(bench.messages::<PickAnswer>()[0].joints.first().copied(), shown, "at {point} from the front");
    }
    assert_eq!(picks, 180);
    bench.send(HoverRequest { rig, what: None });
    assert_eq!(hovered(&bench), None);
    // Under a pointer that rests, a joint that comes in is shown.
    let point = Vec2::new(0.0, 1.2);
    let front = ViewPlane::orthographic(View::Front, bounds);
    bench.send(HoverRequest { rig, what: Some((front, point, reach)) });
    let hit = front.ray(point).at(bench.surface().unwrap().hits(&front.ray(point))[0].distance);
    bench.edit(Operation::Place { position: hit, parent: None });
    bench.app.update();
    bench.app.update();
    let placed = bench.rig().walk().last().unwrap().data.uid;
    assert_eq!(hovered(&bench), Some(placed));
}

/// Far too many boxes for a surface in the frame that asks for it.
fn many_boxes() -> Model {
    let grid: Vec<[[f32; 3]; 2]> = (0..20_000)
        .map(|i| {
            let low = [(i % 30) as f32 * 0.03, (i / 30 % 30) as f32 * 0.03, (i / 900) as f32 * 0.03];
            [low, low.map(|c| c + 0.029)]
        })
        .collect();
    boxes(&grid)
}

#[test]
fn a_click_that_waits_for_the_surface_does_not_cut_off_steps_that_were_undone_meanwhile() {
    let mut bench = RigBench::of(Rig::new(Uid(1), "rig"));
    let rig = bench.rig;
    bench.app.world_mut().spawn((RigMesh::new(MESH, many_boxes(), Vec::new()), SkinOf(rig)));
    let ray = ViewPlane::orthographic(View::Front, [Vec3::ZERO, Vec3::ONE]).ray(Vec2::new(0.11, 0.14));
    let request = PlaceRequest { rig, ray, settings: PlaceSettings::default() };
    bench.app.world_mut().write_message(request.clone());
    undo_meanwhile(&mut bench.app, rig, new_clip("wave"));
    bench.wait("the answer", |bench| !bench.app.world().resource::<Messages<PlaceAnswer>>().is_empty());
    let answer = bench.messages::<PlaceAnswer>().remove(0);
    assert_eq!((answer.refusal, answer.placement), (Some(PlaceRefusal::Undone), Placement::Nothing));
    assert!(answer.waited && bench.rig().is_empty(), "{answer:?}");
    bench.change(Change::Redo);
    assert_eq!(bench.rig().clips().len(), 1);
    // Asked for anew, it is placed.
    bench.app.world_mut().write_message(request);
    bench.wait("the joint", |bench| !bench.rig().is_empty());
    let answer = bench.messages::<PlaceAnswer>().remove(0);
    assert!(answer.refusal.is_none() && answer.placement != Placement::Nothing, "{answer:?}");
}

#[test]
fn requests_wait_for_the_surface_and_hovering_does_not() {
    let mut bench = RigBench::of(Rig::new(Uid(1), "rig"));
    let rig = bench.rig;
    bench.edit(Operation::Place { position: Vec3::new(0.1, 0.1, 0.5), parent: None });
    let root = bench.rig().roots()[0];
    bench.app.world_mut().spawn((RigMesh::new(MESH, many_boxes(), Vec::new()), SkinOf(rig)));
    let plane = ViewPlane::orthographic(View::Front, [Vec3::ZERO, Vec3::ONE]);
    let point = Vec2::new(0.11, 0.14);
    let ray = plane.ray(point);
    let world = bench.app.world_mut();
    world.write_message(HoverRequest { rig, what: Some((plane, point, 0.01)) });
    world.write_message(PickRequest { rig, what: Pick::Click { plane, point, reach: 0.01 }, add: false });
    world.write_message(PickRequest { rig, what: Pick::None, add: false });
    world.write_message(PlaceRequest { rig, ray, settings: PlaceSettings::default() });
    let mut waited = 0;
    loop {
        bench.app.update();
        if bench.surface().is_some_and(|surface| surface.ready().is_some()) {
            break;
        }
        waited += 1;
        assert_eq!(bench.get::<HoveredNode>(rig), Some(&HoveredNode(None)));
        assert_eq!(bench.rig().len(), 1);
        assert!(bench.surface().is_none_or(|surface| surface.hits(&ray).is_empty()));
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(waited > 0, "the surface was there at once");
    let (mut picked, mut placed) = (bench.messages::<PickAnswer>(), bench.messages::<PlaceAnswer>());
    bench.app.update();
    picked.extend(bench.messages::<PickAnswer>());
    placed.extend(bench.messages::<PlaceAnswer>());
    assert_eq!(picked.iter().map(|picked| picked.joints.len()).collect::<Vec<_>>(), [1, 0], "in their order");
    assert_eq!(placed.len(), 1);
    assert_eq!(bench.rig().len(), 2, "the answer came once");
    assert_eq!(bench.rig().roots().len(), 2, "below nothing: the second request took the selection away");
    assert!(bench.get::<HoveredNode>(rig).unwrap().0.is_some());
    assert!(bench.rig().joint(root).is_some());
    // A rig that is closed takes its requests with it.
    bench.app.world_mut().write_message(PlaceRequest { rig, ray, settings: PlaceSettings::default() });
    bench.app.world_mut().despawn(rig);
    bench.app.update();
    assert!(bench.messages::<PlaceAnswer>().is_empty());
}

/// A stroke along the left arm.
fn along_arm(bench: &RigBench) -> StrokeRequest {
    let plane = ViewPlane::orthographic(View::Front, bench.surface().unwrap().bounds());
    let [shoulder, hand] = ["upper_arm_l", "hand_l"].map(|label| bench.rig().position(bench.labelled(label)));
    StrokeRequest {
        rig: bench.rig,
        plane,
        points: (0..=40).map(|i| shoulder.lerp(hand, i as f32 / 40.0).truncate()).collect(),
        choice: ChainChoice::Joints(3),
        settings: StrokeSettings::default(),
        chain_only: true,
        reach: 0.0,
        parent: StrokeParent::default(),
        chain: None,
    }
}

#[test]
fn a_stroke_does_not_cut_off_steps_that_were_undone_while_it_was_followed() {
    let mut bench = RigBench::biped();
    let request = along_arm(&bench);
    let before = bench.rig().clone();
    bench.messages::<StrokeDone>();
    // The mesh has far too many triangles to follow a stroke in the frame that asks for it.
    bench.app.world_mut().write_message(request.clone());
    undo_meanwhile(&mut bench.app, bench.rig, new_clip("wave"));
    bench.wait("the answer", |bench| !bench.app.world().resource::<Messages<StrokeDone>>().is_empty());
    let done = bench.messages::<StrokeDone>().remove(0).result;
    assert!(matches!(done, StrokeResult::Nothing(StrokeFailure::Undone)), "{done:?}");
    assert_eq!(*bench.rig(), before);
    bench.change(Change::Redo);
    assert_eq!(bench.rig().clips().len(), before.clips().len() + 1);
    // Drawn again, it is no different from any other.
    bench.app.world_mut().write_message(request);
    bench.wait("the answer", |bench| !bench.app.world().resource::<Messages<StrokeDone>>().is_empty());
    let done = bench.messages::<StrokeDone>().remove(0).result;
    assert!(matches!(done, StrokeResult::Chain { .. }), "{done:?}");
}

#[test]
fn strokes_are_followed_in_the_background_one_after_another() {
    let mut bench = RigBench::biped();
    let surface = bench.surface().unwrap().shared().unwrap();
    let request = along_arm(&bench);
    let (plane, points) = (request.plane, request.points.clone());
    let expected = stroke_chain(&surface, &plane, &points, request.settings, request.choice).unwrap();
    let before = bench.rig().len();
    bench.messages::<StrokeDone>();
    // The second starts on the first one's last joint, which is not there yet.
    let end = plane.project(expected.joints[2].position).unwrap();
    let on = StrokeRequest {
        points: vec![end, end + Vec2::new(0.01, -0.02), end + Vec2::new(0.02, -0.05)],
        reach: 0.004,
        ..request.clone()
    };
    bench.app.world_mut().write_message(request);
    bench.app.world_mut().write_message(on);
    let (started, mut done) = (Instant::now(), Vec::new());
    while done.len() < 2 {
        assert!(started.elapsed() < HANG, "{done:?}");
        bench.app.update();
        done.extend(bench.messages::<StrokeDone>());
        std::thread::sleep(Duration::from_millis(1));
    }
    bench.app.update();
    let StrokeResult::Chain { chain, .. } = &done[0].result else { panic!("{:?}", done[0]) };
    assert_eq!(chain.joints, expected.joints);
    let added: Vec<Uid> = bench.rig().walk().skip(before).map(|joint| joint.data.uid).collect();
    let StrokeResult::Chain { parent, .. } = &done[1].result else { panic!("{:?}", done[1]) };
    let last = bench.rig().joint(parent.unwrap()).unwrap();
    assert!(bench.rig().position(last.data.uid).distance(expected.joints[2].position) < 1e-5);
    assert!(added.len() >= 4, "{}", added.len());
}
