//! Painted weights in the journal: records as large as what was painted, and all of it back after a crash.

use std::sync::Arc;

use rigsmith::{
    files::journal::{Basis, recover},
    mesh::model::Weights,
    rig::{RigEdit, SkinData, Uid, WeightPatch},
};

use super::{Desk, skin};

#[test]
fn painted_weights_come_back_from_the_journal() {
    let folder = tempfile::tempdir().unwrap();
    let mut desk = Desk::apart(folder.path());
    let mesh = Uid(8);
    let whole = skin(4000, 0);
    desk.edit(RigEdit::SetSkin(mesh, Some(whole.clone())));
    let size = desk.bytes().len();
    let paint = |desk: &mut Desk, points: std::ops::Range<u32>, share: f32, added: Vec<(Uid, Option<Uid>)>| {
        let before = desk.rig.skin(mesh).unwrap().clone();
        let mut rows = Weights { starts: vec![0], ..Weights::default() };
        let last = (before.joints.len() + added.len()) as u32 - 1;
        points.clone().for_each(|_| rows.push([(0, share), (last, 1.0 - share)]));
        let patch = WeightPatch::new(&before, added, points.collect(), rows);
        desk.edit(RigEdit::SetWeights(mesh, Box::new(patch)));
    };
    paint(&mut desk, 10..40, 0.1, Vec::new());
    paint(&mut desk, 20..50, 0.7, vec![(Uid(500), Some(Uid(100)))]);
    let grown = desk.bytes().len() - size;
    assert!(grown < size / 2, "{grown} bytes for two strokes on a mesh of {size}");
    paint(&mut desk, 3999..4000, f32::MIN_POSITIVE, Vec::new());
    desk.undo();
    desk.undo();
    desk.redo();
    let found = recover(&desk.bytes()).unwrap();
    assert!(found.gaps().is_empty());
    let replayed = found.restore(Basis::Journal, None).replayed;
    assert_eq!(replayed.refused, None);
    assert_eq!(replayed.rig, desk.rig);
    assert_eq!(replayed.rig.skin(mesh), desk.rig.skin(mesh));
    assert_eq!(replayed.rig.skin(mesh).unwrap().joints.len(), 5);
    // The history that came back undoes to the weights from before all strokes.
    let mut rig = replayed.rig;
    for step in replayed.stacks.done.iter().skip(1).rev() {
        step.backward.iter().for_each(|edit| drop(rig.apply(edit).unwrap()));
    }
    assert_eq!(rig.skin(mesh).map(Arc::as_ref), Some(whole.as_ref()));
}

/// As text, this stroke would be longer than a record may be, and no later change could be written.
#[test]
fn a_stroke_over_a_large_mesh_is_written_as_any_other() {
    const POINTS: u32 = 400_000;
    let row =
        |point: u32, turn: u32| (0..8).map(move |joint| (joint, 1.0 / (3 + (point + 7 * joint + turn) % 997) as f32));
    let folder = tempfile::tempdir().unwrap();
    let mut desk = Desk::apart(folder.path());
    let mesh = Uid(8);
    let mut weights = Weights { starts: vec![0], ..Weights::default() };
    (0..POINTS).for_each(|point| weights.push(row(point, 0)));
    let joints = (0..8).map(|joint| Uid(100 + joint)).collect();
    let whole = Arc::new(SkinData { joints, weights, at_rest: true, ..SkinData::default() });
    desk.edit(RigEdit::SetSkin(mesh, Some(whole.clone())));
    let points: Vec<u32> = (0..POINTS).filter(|point| point % 10 != 3).collect();
    let mut rows = Weights { starts: vec![0], ..Weights::default() };
    points.iter().for_each(|point| rows.push(row(*point, 400)));
    let patch = WeightPatch::new(&whole, vec![(Uid(500), Some(Uid(100)))], points, rows);
    desk.edit(RigEdit::SetWeights(mesh, Box::new(patch)));
    desk.place(1);
    let found = recover(&desk.bytes()).unwrap();
    assert!(found.gaps().is_empty());
    let replayed = found.restore(Basis::Journal, None).replayed;
    assert_eq!(replayed.refused, None);
    assert!(replayed.rig == desk.rig);
    assert_eq!(replayed.stacks.done.len(), 3);
    let mut rig = replayed.rig;
    for step in replayed.stacks.done.iter().skip(1).rev() {
        step.backward.iter().for_each(|edit| drop(rig.apply(edit).unwrap()));
    }
    assert!(rig.skin(mesh).map(Arc::as_ref) == Some(whole.as_ref()));
}
