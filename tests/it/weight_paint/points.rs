//! Edits of the weights of some points.

use super::*;

#[test]
fn changes_of_points_are_taken_back_to_the_bit() {
    let mut rig = Rig::new(Uid(9), "rig");
    rig.apply(&RigEdit::SetSkin(MESH, Some(Arc::new(skin(30))))).unwrap();
    let first = (rig.clone(), bytes(&rig));
    let mut changed = Weights { starts: vec![0], ..Weights::default() };
    changed.push([(2, 0.5), (0, 0.5)]);
    changed.push([]);
    changed.push([(1, 1.0)]);
    let added = vec![(Uid(3), Some(Uid(1)))];
    let patch = WeightPatch::new(rig.skin(MESH).unwrap(), added, vec![0, 4, 29], changed.clone());
    let edit = RigEdit::SetWeights(MESH, Box::new(patch.clone()));
    let inverse = rig.apply(&edit).unwrap();
    let skin = rig.skin(MESH).unwrap();
    assert_eq!((skin.joints.len(), skin.subjects.len(), skin.weights.len()), (3, 2, 30));
    for (number, point) in [0, 4, 29].into_iter().enumerate() {
        assert!(skin.weights.of(point).eq(changed.of(number)));
    }
    assert!(skin.weights.of(1).eq(first.0.skin(MESH).unwrap().weights.of(1)), "others stay");
    assert!(edit.weight_bytes() < RigEdit::SetSkin(MESH, Some(skin.clone())).weight_bytes() / 2);
    let second = rig.clone();
    assert_eq!(rig.apply(&inverse).unwrap(), edit, "the inverse of the inverse");
    assert_eq!((&rig, bytes(&rig)), (&first.0, first.1));
    // As text, and as the difference of two sets of weights.
    let text = ron::to_string(&edit).unwrap();
    assert_eq!(ron::from_str::<RigEdit>(&text).unwrap(), edit);
    let [before, after] = [&first.0, &second].map(|rig| (**rig.skin(MESH).unwrap()).clone());
    let between = WeightPatch::between(&before, &after).unwrap();
    assert_eq!(between, patch);
    assert!(matches!(weight_edit(MESH, &before, after), Some(RigEdit::SetWeights(..))));
    assert_eq!(weight_edit(MESH, &before, before.clone()), None);
    let other = SkinData { joints: vec![Uid(7), Uid(8)], ..before.clone() };
    assert!(matches!(weight_edit(MESH, &before, other), Some(RigEdit::SetSkin(..))));
}

#[test]
fn changes_that_do_not_fit_are_refused_and_change_nothing() {
    let mut rig = Rig::new(Uid(9), "rig");
    let row = |values: &[(u32, f32)]| {
        let mut rows = Weights { starts: vec![0], ..Weights::default() };
        rows.push(values.iter().copied());
        rows
    };
    let patch = WeightPatch { kept: 2, added: Vec::new(), points: vec![1], rows: row(&[(0, 1.0)]) };
    let edit = |patch: &WeightPatch| RigEdit::SetWeights(MESH, Box::new(patch.clone()));
    assert_eq!(rig.apply(&edit(&patch)), Err(EditError::NoSkin(MESH)));
    rig.apply(&RigEdit::SetSkin(MESH, Some(Arc::new(skin(6))))).unwrap();
    let before = (rig.clone(), bytes(&rig));
    let two = WeightPatch { points: vec![1, 1], rows: same(2, &[(0, 1.0)]), ..patch.clone() };
    let joint = |joint, joints| PatchFault::Joint { joint, joints };
    let table = [
        (WeightPatch { points: vec![6], ..patch.clone() }, PatchFault::Point { point: 6, points: 6 }),
        (two.clone(), PatchFault::Order),
        (WeightPatch { points: vec![2, 1], ..two }, PatchFault::Order),
        (WeightPatch { points: vec![1, 2], ..patch.clone() }, PatchFault::Rows),
        (WeightPatch { rows: row(&[(0, f32::NAN)]), ..patch.clone() }, PatchFault::Rows),
        (WeightPatch { rows: row(&[(2, 1.0)]), ..patch.clone() }, joint(2, 2)),
        (WeightPatch { kept: 3, ..patch.clone() }, joint(3, 2)),
        (WeightPatch { kept: 1, ..patch.clone() }, PatchFault::InUse(Uid(2))),
        (WeightPatch { added: vec![(Uid(1), None)], ..patch.clone() }, PatchFault::Twice(Uid(1))),
        (WeightPatch { added: vec![(Uid(3), None), (Uid(3), None)], ..patch.clone() }, PatchFault::Twice(Uid(3))),
    ];
    for (patch, fault) in table {
        assert_eq!(rig.apply(&edit(&patch)), Err(EditError::BadPatch(MESH, fault)), "{patch:?}");
        assert_eq!((&rig, bytes(&rig)), (&before.0, before.1.clone()));
    }
}
