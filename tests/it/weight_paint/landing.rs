//! Computed weights that come while others are painted, undone or locked.

use super::*;

/// Asks for something, makes and undoes a step before it lands, and waits until its result waits for that step.
fn held<M: Message>(bench: &mut RigBench, undone: Operation, request: M) {
    bench.messages::<ResultHeld>();
    begin_drag(&mut bench.app, bench.rig);
    bench.send(request);
    undo_meanwhile(&mut bench.app, bench.rig, undone);
    bench.wait("the word that the result waits", |bench| {
        !bench.app.world().resource::<Messages<ResultHeld>>().is_empty()
    });
}

/// A pose, from which no weights follow.
fn posed(joint: Uid) -> Operation {
    Operation::Pose(vec![(joint, PoseOffset { translation: Vec3::X, ..PoseOffset::default() })])
}

#[test]
fn weights_that_were_painted_meanwhile_are_not_replaced_by_computed_ones() {
    let answer = |bench: &mut RigBench| {
        bench.wait("the answer", |bench| !bench.app.world().resource::<Messages<BindAnswer>>().is_empty());
        let answer = bench.messages::<BindAnswer>().remove(0).result.map(|_| ());
        (0..3).for_each(|_| bench.app.update());
        answer
    };
    let (mut bench, [one, _], joints) = app();
    held(&mut bench, posed(joints[0]), BindRequest::new(one));
    let skin = bench.rig().skin(MESH).unwrap().clone();
    let joint = PaintableJoint { uid: joints[1], subject: None };
    let stroke = row_edit(bench.rig(), (MESH, &skin), joint, [2, 5], 0.5).unwrap();
    bench.edit(stroke.clone());
    let painted = bench.rig().clone();
    assert_eq!(answer(&mut bench), Err(SkinningError::Changed));
    assert_eq!(*bench.rig(), painted, "the stroke stays");
    // Weights that are there again are the same.
    bench.change(Change::Undo);
    begin_drag(&mut bench.app, bench.rig);
    bench.send(BindRequest::new(one));
    bench.change(Change::Redo);
    assert_eq!(answer(&mut bench), Err(SkinningError::Changed), "computed for the weights before the stroke");
    held(&mut bench, posed(joints[0]), BindRequest::new(one));
    bench.change(Change::Redo);
    assert_eq!(answer(&mut bench), Ok(()));
    assert_ne!(bench.rig().skin(MESH), painted.skin(MESH), "what was asked for after the stroke replaces it");
}

#[test]
fn computed_weights_that_wait_can_be_dropped() {
    let (mut bench, [one, _], joints) = app();
    let before = bench.rig().clone();
    held(&mut bench, posed(joints[0]), BindRequest::new(one));
    let job = bench.get::<SkinningJob>(one).unwrap();
    assert!(job.waits());
    job.cancel();
    bench.app.update();
    assert!(bench.get::<SkinningJob>(one).is_none());
    bench.change(Change::Redo);
    bench.change(Change::Undo);
    assert_eq!(*bench.rig(), before);
}

/// Steps that were undone before a person asked go with the result, as with any other edit.
#[test]
fn weights_that_are_asked_for_after_an_undo_do_not_wait_for_it() {
    let (mut bench, [one, other], joints) = app();
    bench.edit(posed(joints[0]));
    bench.change(Change::Undo);
    bench.send(BindRequest::new(other));
    bench.wait("the weights", |bench| bench.rig().skin(Uid(0x51)).is_some());
    assert!(!bench.get::<RigHistory>(bench.rig).unwrap().can_redo());
    bench.edit(posed(joints[0]));
    bench.change(Change::Undo);
    assert_eq!(change(&mut bench, one, WeightChange::Normalise), Ok(8));
    assert!(bench.messages::<ResultHeld>().is_empty());
}

#[test]
fn a_step_that_takes_the_place_of_an_undone_one_is_no_less_kept() {
    let (mut bench, [one, _], joints) = app();
    bench.edit(posed(joints[0]));
    bench.change(Change::Undo);
    // One step is undone when the weights are asked for, and one, another, when they are ready.
    held(&mut bench, posed(joints[1]), BindRequest::new(one));
    bench.messages::<BindAnswer>();
    let before = bench.rig().clone();
    bench.change(Change::Redo);
    assert_ne!(bench.rig().pose(), before.pose(), "the step can be redone");
    bench.wait("the answer", |bench| !bench.app.world().resource::<Messages<BindAnswer>>().is_empty());
    assert!(bench.messages::<BindAnswer>().remove(0).result.is_ok());
}

#[test]
fn a_lock_during_a_change_of_weights_keeps_them() {
    let (mut bench, [one, _], joints) = app();
    let request = WeightChangeRequest { mesh: one, change: WeightChange::Normalise };
    held(&mut bench, Operation::Lock(vec![joints[1]], true), request);
    assert!(bench.get::<WeightChangeJob>(one).unwrap().waits());
    bench.messages::<WeightChangeAnswer>();
    let before = bytes(bench.rig());
    bench.change(Change::Redo);
    bench.wait("the answer", |bench| !bench.app.world().resource::<Messages<WeightChangeAnswer>>().is_empty());
    assert_eq!(bench.messages::<WeightChangeAnswer>().remove(0).result, Err(WeightChangeError::Changed));
    (0..3).for_each(|_| bench.app.update());
    assert_eq!(bytes(bench.rig()), before);
}
