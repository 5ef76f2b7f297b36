//! Work in the background: results that wait for undone steps are discarded with the button of the status line, so that the
//! steps can be redone, and work that runs is stopped with it.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_egui::egui::PointerButton;
use rigsmith::{
    algo::face::auto::AutoSettings,
    editor::{
        ActiveRig,
        files::{LoadJob, OpenRequest},
        library::{LibraryAct, LibraryJobs, LibraryRequest},
        notice::Notice,
        panels::timeline::import::{ClipImport, ImportRequest},
        result_queue::waiting,
        running_work::{StopWork, StoppableWork},
    },
    files::{RealDisk, TemplatePlace, load_model},
    mesh::model::{Model, Weights},
    plugins::{
        face::{FaceJob, FaceRequest},
        history::RigHistory,
        landing::HeldResult,
        mesh_reload::{ReloadAnswer, ReloadError, ReloadJob, ReloadRequest},
        painting::{WeightChange, WeightChangeAnswer, WeightChangeError, WeightChangeJob, WeightChangeRequest},
        skinning::{BindRequest, SkinningJob},
        surface::{RigMesh, SkinOf},
    },
    prelude::*,
    rig::{SkinData, animation::RigClip, format::animation::write_animation},
};

use crate::{
    bench::{begin_drag, new_clip, undo_meanwhile, wait},
    dock::{Frames, USUAL},
    gestures::boxes,
};

const MESH: Uid = Uid(0x50);

fn tower(width: f32) -> Model {
    boxes(&[[[-0.2 * width, 0.0, -0.2], [0.2 * width, 1.0, 0.2]]])
}

/// The window with two joints and a mesh whose weights do not sum to one.
fn opened() -> (Frames, Entity, Entity) {
    let mut frames = Frames::new(USUAL);
    let world = frames.app.world_mut();
    let rig = world.spawn(Rig::new(Uid(1), "rig")).id();
    let mesh = world.spawn((RigMesh::new(MESH, tower(1.0), Vec::new()), SkinOf(rig))).id();
    world.insert_resource(ActiveRig(rig));
    frames.frame();
    change(&mut frames, rig, Change::Do(Operation::Chain { positions: vec![Vec3::ZERO, Vec3::Y], parent: None }));
    let joints: Vec<Uid> = frames.app.world().get::<Rig>(rig).unwrap().walk().map(|joint| joint.data.uid).collect();
    let mut weights = Weights { starts: vec![0], ..Weights::default() };
    (0..8).for_each(|point| weights.push([(0, 0.6), (1, 0.2 + 0.01 * point as f32)]));
    let skin = SkinData { joints, weights, at_rest: true, ..SkinData::default() };
    let edits = vec![RigEdit::SetSkin(MESH, Some(Arc::new(skin)))];
    change(&mut frames, rig, Change::Do(Operation::Edits(edits)));
    (frames, rig, mesh)
}

fn change(frames: &mut Frames, rig: Entity, change: Change) {
    frames.app.world_mut().write_message(EditRequest { rig, change });
    (0..3).for_each(|_| frames.frame());
}

/// Asks for a job, makes and undoes a step meanwhile, and waits until the status line has the button.
fn held<M: Message>(frames: &mut Frames, rig: Entity, request: M) {
    begin_drag(&mut frames.app, rig);
    frames.app.world_mut().write_message(request);
    frames.frame();
    let number = frames.app.world().get::<Rig>(rig).unwrap().clips().len();
    undo_meanwhile(&mut frames.app, rig, new_clip(&format!("wave {number}")));
    wait(frames, "the button", Frames::frame, |frames| frames.find("Discard").is_some());
}

/// Clicks the button; afterwards nothing waits, nothing has changed, and the step can be redone.
fn discard(frames: &mut Frames, (rig, kind): (Entity, HeldResult), is_gone: impl Fn(&World) -> bool) {
    assert_eq!(waiting(frames.app.world()).map(|(kind, _)| kind), Some(kind));
    let before = frames.app.world().get::<Rig>(rig).unwrap().clone();
    let button = frames.find("Discard").unwrap();
    frames.click(button.center(), PointerButton::Primary);
    (0..4).for_each(|_| frames.frame());
    assert!(is_gone(frames.app.world()) && frames.find("Discard").is_none());
    assert_eq!(frames.app.world().get::<Rig>(rig), Some(&before));
    assert!(frames.app.world().get::<RigHistory>(rig).unwrap().can_redo());
    change(frames, rig, Change::Redo);
    let now = frames.app.world().get::<Rig>(rig).unwrap();
    assert_eq!((now.clips().len(), now.skin(MESH)), (before.clips().len() + 1, before.skin(MESH)));
}

#[test]
fn weights_that_wait_are_discarded_in_the_status_line() {
    let (mut frames, rig, mesh) = opened();
    held(&mut frames, rig, BindRequest::new(mesh));
    assert!(frames.find("The weights wait: redo, or go on editing").is_some());
    discard(&mut frames, (rig, HeldResult::Weights), |world| world.get::<SkinningJob>(mesh).is_none());
}

#[test]
fn a_change_of_weights_that_waits_is_discarded_in_the_status_line() {
    let (mut frames, rig, mesh) = opened();
    let request = || WeightChangeRequest { mesh, change: WeightChange::Normalise };
    held(&mut frames, rig, request());
    discard(&mut frames, (rig, HeldResult::Weights), |world| world.get::<WeightChangeJob>(mesh).is_none());
    // Asked for again, it is done.
    let before = frames.app.world().get::<Rig>(rig).unwrap().skin(MESH).cloned();
    frames.app.world_mut().write_message(request());
    let skin = |frames: &Frames| frames.app.world().get::<Rig>(rig).unwrap().skin(MESH).cloned();
    wait(&mut frames, "the change", Frames::frame, |frames| skin(frames) != before);
}

#[test]
fn a_version_of_a_mesh_that_waits_is_discarded_in_the_status_line() {
    let (mut frames, rig, mesh) = opened();
    let points = |frames: &Frames| frames.app.world().get::<RigMesh>(mesh).unwrap().rest.points.clone();
    let before = points(&frames);
    held(&mut frames, rig, ReloadRequest { mesh, model: Arc::new(tower(2.0)) });
    discard(&mut frames, (rig, HeldResult::Mesh), |world| world.get::<ReloadJob>(mesh).is_none());
    assert_eq!(points(&frames), before);
    // The next version is taken as before.
    frames.app.world_mut().write_message(ReloadRequest { mesh, model: Arc::new(tower(3.0)) });
    wait(&mut frames, "the version", Frames::frame, |frames| points(frames) != before);
}

#[test]
fn a_face_that_waits_is_discarded_in_the_status_line() {
    let (mut frames, rig, _) = opened();
    let head = load_model(&RealDisk, "assets/models/head.obj".as_ref()).unwrap();
    let head = (RigMesh::new(Uid(0x51), head, Vec::new()), SkinOf(rig));
    let mesh = frames.app.world_mut().spawn(head).id();
    frames.frame();
    let settings = AutoSettings { bones: 24, ..AutoSettings::default() };
    held(&mut frames, rig, FaceRequest { mesh, settings, fit: None });
    assert!(frames.find("The face waits: redo, or go on editing").is_some());
    discard(&mut frames, (rig, HeldResult::Face), |world| world.get::<FaceJob>(mesh).is_none());
}

#[test]
fn motion_that_waits_is_discarded_in_the_status_line() {
    let (mut frames, rig, _) = opened();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.anim.ron");
    let clip = RigClip::new(Uid(0x77), Uid(0x78), "run");
    let text = write_animation(frames.app.world().get::<Rig>(rig).unwrap(), None, &[clip]);
    std::fs::write(&path, text).unwrap();
    held(&mut frames, rig, ImportRequest(path));
    assert!(frames.find("run.anim.ron waits: redo, or go on editing").is_some());
    let is_gone = |world: &World| world.resource::<ClipImport>().waits().is_none();
    discard(&mut frames, (rig, HeldResult::Motion), is_gone);
}

#[test]
fn jobs_answer_that_their_result_was_discarded() {
    let (mut frames, rig, mesh) = opened();
    held(&mut frames, rig, ReloadRequest { mesh, model: Arc::new(tower(2.0)) });
    frames.app.world_mut().resource_mut::<Messages<ReloadAnswer>>().clear();
    frames.app.world_mut().get_mut::<ReloadJob>(mesh).unwrap().discard();
    frames.app.update();
    let answer = frames.app.world_mut().resource_mut::<Messages<ReloadAnswer>>().drain().next();
    assert_eq!(answer.map(|answer| answer.result), Some(Err(ReloadError::Discarded)));

    change(&mut frames, rig, Change::Redo);
    held(&mut frames, rig, WeightChangeRequest { mesh, change: WeightChange::Normalise });
    frames.app.world_mut().resource_mut::<Messages<WeightChangeAnswer>>().clear();
    frames.app.world_mut().get_mut::<WeightChangeJob>(mesh).unwrap().discard();
    frames.app.update();
    let answer = frames.app.world_mut().resource_mut::<Messages<WeightChangeAnswer>>().drain().next();
    assert_eq!(answer.map(|answer| answer.result), Some(Err(WeightChangeError::Discarded)));

    // Stopped, it makes no step, however far it has come.
    change(&mut frames, rig, Change::Redo);
    let before = frames.app.world().get::<Rig>(rig).unwrap().skin(MESH).cloned();
    held(&mut frames, rig, WeightChangeRequest { mesh, change: WeightChange::Normalise });
    frames.app.world_mut().resource_mut::<Messages<WeightChangeAnswer>>().clear();
    frames.app.world_mut().get_mut::<WeightChangeJob>(mesh).unwrap().stop();
    frames.app.update();
    let answer = frames.app.world_mut().resource_mut::<Messages<WeightChangeAnswer>>().drain().next();
    assert_eq!(answer.map(|answer| answer.result), Some(Err(WeightChangeError::Stopped)));
    assert!(frames.app.world().get::<WeightChangeJob>(mesh).is_none());
    assert_eq!(frames.app.world().get::<Rig>(rig).unwrap().skin(MESH).cloned(), before);
}

#[test]
fn work_that_runs_is_stopped_in_the_status_line() {
    let (mut frames, rig, _) = opened();
    // Two hundred thousand points are not done within a few frames.
    let cube = |number: usize| {
        let low = [number % 30, number / 30 % 30, number / 900].map(|place| place as f32 * 0.03);
        [low, low.map(|place| place + 0.029)]
    };
    let cubes: Vec<[[f32; 3]; 2]> = (0..25_000).map(cube).collect();
    let uid = Uid(0x52);
    let mesh = (RigMesh::new(uid, boxes(&cubes), Vec::new()), SkinOf(rig));
    let mesh = frames.app.world_mut().spawn(mesh).id();
    frames.frame();
    assert!(frames.find("Stop").is_none(), "nothing runs");
    frames.app.world_mut().write_message(BindRequest::new(mesh));
    wait(&mut frames, "the button", Frames::frame, |frames| frames.find("Stop").is_some());
    let button = frames.find("Stop").unwrap();
    frames.click(button.center(), PointerButton::Primary);
    wait(&mut frames, "the end", Frames::frame, |frames| frames.app.world().get::<SkinningJob>(mesh).is_none());
    frames.frame();
    assert!(frames.find("Stop").is_none() && frames.app.world().get::<Rig>(rig).unwrap().skin(uid).is_none());
}

fn active(frames: &Frames) -> Entity {
    frames.app.world().resource::<ActiveRig>().0
}

/// Asks for work until it is stopped before its end; false if it always ends first. The document is then as before.
fn is_stopped<M: Message + Clone>(
    frames: &mut Frames,
    request: M,
    kind: StoppableWork,
    is_running: impl Fn(&World) -> bool,
) -> bool {
    (0..100).any(|_| {
        frames.app.world_mut().write_message(request.clone());
        frames.app.update();
        let rig = active(frames);
        let before = frames.app.world().get::<Rig>(rig).unwrap().clone();
        if !is_running(frames.app.world()) {
            return false;
        }
        // Notices of earlier work may still be there.
        let mut cursor = frames.app.world().resource::<Messages<Notice>>().get_cursor_current();
        frames.app.world_mut().write_message(StopWork(kind));
        frames.app.update();
        let notices = frames.app.world().resource::<Messages<Notice>>();
        if !cursor.read(notices).any(|notice| notice.text.ends_with("it was stopped")) {
            return false;
        }
        (0..3).for_each(|_| frames.app.update());
        assert!(!is_running(frames.app.world()), "it goes on");
        assert_eq!((active(frames), frames.app.world().get::<Rig>(rig)), (rig, Some(&before)));
        true
    })
}

#[test]
fn files_that_are_read_can_be_stopped() {
    let (mut frames, ..) = opened();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long.bvh");
    let channels = "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation";
    let head = format!("HIERARCHY\nROOT a\n{{\nOFFSET 0 0 0\n{channels}\nEnd Site\n{{\nOFFSET 0 1 0\n}}\n}}\n");
    let lines = "0 0 0 0 0 0\n".repeat(20_000);
    std::fs::write(&path, format!("{head}MOTION\nFrames: 20000\nFrame Time: 0.01\n{lines}")).unwrap();
    let is_read = |world: &World| world.resource::<ClipImport>().name().is_some();
    assert!(is_stopped(&mut frames, ImportRequest(path), StoppableWork::Motion, is_read));
    let is_opened = |world: &World| world.resource::<LoadJob>().name().is_some();
    assert!(is_stopped(&mut frames, OpenRequest::Bundled, StoppableWork::Opening, is_opened));
    let load = LibraryRequest { place: TemplatePlace::Bundled("biped"), act: LibraryAct::Load { keep: true } };
    let is_loaded = |world: &World| world.resource::<LibraryJobs>().name().is_some();
    assert!(is_stopped(&mut frames, load, StoppableWork::Library, is_loaded));
}
