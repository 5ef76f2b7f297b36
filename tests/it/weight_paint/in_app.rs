//! Changes of weights in an app: one step each, or refused with the reason.

use super::*;

#[test]
fn whole_meshes_change_as_one_step_and_undo_gives_the_first_bytes() {
    for number in 0..3 {
        let (mut bench, [one, other], _) = app();
        let prune = PruneSettings { below: 0.5, most: 1 };
        let (mesh, what) =
            [(one, WeightChange::Normalise), (one, WeightChange::Prune(prune)), (other, WeightChange::CopyFrom(one))]
                [number];
        let uid = bench.get::<RigMesh>(mesh).unwrap().uid;
        let before = (bench.rig().clone(), bytes(bench.rig()));
        let steps = bench.get::<RigHistory>(bench.rig).unwrap().steps().1;
        assert_eq!(change(&mut bench, mesh, what), Ok(8), "{what:?}");
        let (names, done) = bench.get::<RigHistory>(bench.rig).unwrap().steps();
        assert_eq!((names.last(), done), (Some(&what.name()), steps + 1));
        let after = bench.rig().skin(uid).unwrap().clone();
        if mesh == one {
            rows(&after.weights).iter().for_each(|row| assert!((sum(row) - 1.0).abs() < 1e-6, "{row:?}"));
        }
        bench.change(Change::Undo);
        assert_eq!((bench.rig(), bytes(bench.rig())), (&before.0, before.1), "{what:?}");
        bench.change(Change::Redo);
        assert_eq!(bench.rig().skin(uid), Some(&after));
    }
}

#[test]
fn changes_of_whole_meshes_are_refused_with_the_reason() {
    let (mut bench, [one, other], joints) = app();
    let nothing = bench.app.world_mut().spawn_empty().id();
    let before = bench.rig().clone();
    let prune = |below, most| WeightChange::Prune(PruneSettings { below, most });
    let table = [
        (nothing, WeightChange::Normalise, "belongs to no rig"),
        (other, WeightChange::Normalise, "has no weights"),
        (one, WeightChange::CopyFrom(other), "to copy from has no weights"),
        (one, WeightChange::CopyFrom(one), "another mesh"),
        (one, WeightChange::CopyFrom(nothing), "another mesh"),
        (one, prune(f32::NAN, 4), "threshold"),
        (one, prune(0.1, 0), "at least one influence"),
    ];
    for (mesh, what, words) in table {
        let error = change(&mut bench, mesh, what).unwrap_err().to_string();
        assert!(error.contains(words), "{what:?}: {error}");
        assert_eq!(bench.rig(), &before);
    }
    // Locked joints keep theirs, and what is in order makes no step.
    bench.edit(Operation::Lock(vec![joints[1]], true));
    assert_eq!(change(&mut bench, one, WeightChange::Normalise), Ok(8));
    let [was, is] = [&before, bench.rig()].map(|rig| rows(&rig.skin(MESH).unwrap().weights));
    for (was, is) in was.iter().zip(&is) {
        assert_eq!(weight(was, 1), weight(is, 1));
        assert!((sum(is) - 1.0).abs() < 1e-6);
    }
    assert_eq!(change(&mut bench, one, WeightChange::Normalise), Ok(0));
}

#[test]
fn copied_weights_keep_to_the_locks_of_the_target() {
    let (mut bench, [one, other], joints) = app();
    let fresh =
        SkinData { joints: vec![joints[1]], weights: same(8, &[(0, 0.25)]), at_rest: true, ..SkinData::default() };
    bench.edit(Operation::Edits(vec![RigEdit::SetSkin(Uid(0x51), Some(Arc::new(fresh)))]));
    bench.edit(Operation::Lock(vec![joints[1]], true));
    assert_eq!(change(&mut bench, other, WeightChange::CopyFrom(one)), Ok(8));
    let skin = bench.rig().skin(Uid(0x51)).unwrap();
    assert_eq!(skin.joints, [joints[1], joints[0]], "the list only grows");
    for row in rows(&skin.weights) {
        assert_eq!((weight(&row, 0), weight(&row, 1)), (0.25, 0.75), "{row:?}");
    }
}

#[test]
fn single_weights_and_strokes_become_edits_of_their_points() {
    let (mut bench, _, joints) = app();
    let rig = bench.rig().clone();
    let skin = rig.skin(MESH).unwrap().clone();
    let joint = PaintableJoint { uid: joints[1], subject: None };
    let set = |weight: f32| row_edit(&rig, (MESH, &skin), joint, [2, 5], weight);
    bench.edit(set(0.5).unwrap());
    let after = rows(&bench.rig().skin(MESH).unwrap().weights);
    for point in [2, 5] {
        assert_eq!((weight(&after[point], 1), weight(&after[point], 0)), (0.5, 0.5));
    }
    assert!(after[0] == rows(&skin.weights)[0]);
    bench.change(Change::Undo);
    assert_eq!(bench.rig(), &rig);
    assert_eq!(set(f32::NAN), None);
    assert_eq!(locks(&rig, [(joints[0], None), (Uid(77), Some(joints[0]))]), [false, false]);

    let mesh = boxes(&[[[-0.2, 0.0, -0.2], [0.2, 1.0, 0.2]]]);
    let canvas = Canvas::new(&mesh.points, &mesh.point_triangles());
    let mut stroke = PaintStroke::new(brush(BrushMode::Add, 0.3), Some(1), None, vec![false; 2], 8).unwrap();
    assert_eq!(stroke_edit(MESH, &skin, &[], &stroke), None, "nothing is painted yet");
    stroke.dab(&canvas, &skin.weights, &canvas.nearest(Vec3::new(0.3, 1.1, 0.3)).unwrap(), None);
    let operation = stroke_edit(MESH, &skin, &[], &stroke).unwrap();
    let Operation::Named { name, edits } = &operation else { panic!("{operation:?}") };
    let [RigEdit::SetWeights(MESH, patch)] = &edits[..] else { panic!("{edits:?}") };
    assert_eq!((*name, patch.points.len()), ("Paint weights", 1), "one corner is within reach");
    bench.edit(operation);
    assert_ne!(bench.rig(), &rig);
    bench.change(Change::Undo);
    assert_eq!(bench.rig(), &rig);
}
