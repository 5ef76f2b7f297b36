//! Twist and half joints that are switched on after a mesh was bound: they take their shares in the app, in one step.

use std::collections::BTreeMap;

use bevy::prelude::*;
use rigsmith::{
    algo::weights::WeightSettings,
    headless::Workbench,
    plugins::{
        commands::{BuildRequest, BuildStep},
        document::{Change, EditRequest},
        history::RigHistory,
        painting::{PaintableJoint, row_edit},
        skinning::SkinningJob,
    },
    rig::{
        Rig, RigEdit, SkinData, Uid,
        deform::DeformSkeleton,
        feature::{features_named, set_feature},
        operations::Operation,
    },
};

use super::figure::Figure;
use crate::bench::wait;

/// Edits that turn the features of a name on or off.
fn switch(rig: &Rig, feature: &str, on: bool) -> Vec<RigEdit> {
    let features = features_named(rig, feature).unwrap();
    features.iter().flat_map(|feature| set_feature(rig, &feature.key, on).unwrap()).collect()
}

/// An app in which the bundled character is built and bound while a feature is off.
fn app(feature: &str) -> Workbench {
    let figure = Figure::bundled();
    let mut rig = crate::bench::shipped("biped");
    for edit in switch(&rig, feature, false) {
        rig.apply(&edit).unwrap();
    }
    let mut bench = Workbench::with_rig(1, rig);
    bench.open(figure.model, true).unwrap();
    let entity = bench.rig_entity();
    bench.app_mut().world_mut().write_message(BuildRequest { rig: entity, step: BuildStep::All });
    bench.app_mut().update();
    bench.skin(WeightSettings::default(), Vec::new(), &mut |_| {}).unwrap();
    bench
}

/// Updates an app until its background jobs are over and what they found is in the document.
fn settle(bench: &mut Workbench) {
    let app = bench.app_mut();
    app.update();
    wait(app, "the end of the jobs", App::update, |app| {
        let mut jobs = app.world().try_query::<&SkinningJob>();
        jobs.as_mut().is_none_or(|jobs| jobs.iter(app.world()).next().is_none())
    });
    (0..2).for_each(|_| app.update());
}

fn change(bench: &mut Workbench, change: Change) {
    let rig = bench.rig_entity();
    bench.app_mut().world_mut().write_message(EditRequest { rig, change });
    settle(bench);
}

fn steps(bench: &mut Workbench) -> usize {
    let rig = bench.rig_entity();
    bench.app_mut().world().get::<RigHistory>(rig).unwrap().steps().1
}

/// Sum of the weights of each joint.
fn held(skin: &SkinData) -> BTreeMap<Uid, f32> {
    let mut held = BTreeMap::new();
    for (joint, weight) in skin.weights.joints.iter().zip(&skin.weights.values) {
        *held.entry(skin.joints[*joint as usize]).or_default() += weight;
    }
    held
}

/// Each created joint holds about what it holds where it was there when the mesh was bound; undo and redo take the weights
/// with them.
#[test]
fn joints_that_are_switched_on_take_their_shares() {
    let whole = held(&Figure::bundled().skin);
    for feature in ["twist", "volume"] {
        let mut bench = app(feature);
        let before = bench.weights().unwrap().clone();
        let done = steps(&mut bench);
        let edits = switch(bench.rig(), feature, true);
        change(&mut bench, Change::Do(Operation::Edits(edits)));
        assert_eq!(steps(&mut bench), done + 2, "{feature}: the switch, and the weights");
        let after = bench.weights().unwrap().clone();
        let built = bench.built().unwrap().clone();
        let skeleton = DeformSkeleton::new(bench.rig(), Some(&built));
        let late: Vec<Uid> =
            skeleton.joints().iter().map(|joint| joint.uid).filter(|uid| !before.joints.contains(uid)).collect();
        assert!(late.len() >= 8, "{feature}: {} joints", late.len());
        let shares = held(&after);
        for joint in &late {
            let (is, wanted) = (shares.get(joint).copied().unwrap_or(0.0), whole[joint]);
            assert!((is - wanted).abs() < 0.25 * wanted + 1.0, "{feature}: {joint} holds {is}, not {wanted}");
        }
        for point in 0..after.weights.len() {
            let sum: f32 = after.weights.of(point).map(|(_, weight)| weight).sum();
            assert!((sum - 1.0).abs() < 1e-4, "{feature}: point {point} holds {sum}");
        }
        // Undo takes back the weights, then the switch; redo brings both, and makes no step of its own.
        change(&mut bench, Change::Undo);
        assert_eq!(bench.weights(), Some(&before));
        change(&mut bench, Change::Undo);
        assert_eq!(steps(&mut bench), done);
        change(&mut bench, Change::Redo);
        assert_eq!((steps(&mut bench), bench.weights()), (done + 1, Some(&before)));
        change(&mut bench, Change::Redo);
        assert_eq!((steps(&mut bench), bench.weights()), (done + 2, Some(&after)));
        // Off and on again, the weights name all joints.
        let off = switch(bench.rig(), feature, false);
        change(&mut bench, Change::Do(Operation::Edits(off)));
        let on = switch(bench.rig(), feature, true);
        change(&mut bench, Change::Do(Operation::Edits(on)));
        assert_eq!((steps(&mut bench), bench.weights()), (done + 4, Some(&after)), "{feature}");
    }
}

/// Weights that are painted while the shares are computed are not lost, and get their shares then.
#[test]
fn painted_weights_get_their_shares_too() {
    let mut bench = app("twist");
    let (mesh, before) = bench.rig().skins().map(|(mesh, skin)| (mesh, skin.clone())).next().unwrap();
    let head = bench.rig().find_label("head").unwrap();
    let number = before.joints.iter().position(|joint| *joint == head).unwrap() as u32;
    let is_other = |point: &u32| before.weights.of(*point as usize).all(|(joint, _)| joint != number);
    let others: Vec<u32> = (0..before.weights.len() as u32).filter(is_other).take(2).collect();
    let (begun, point) = (others[0], others[1]);
    let joint = PaintableJoint { uid: head, subject: None };
    let painted = |points: &[u32]| row_edit(bench.rig(), (mesh, &before), joint, points.to_vec(), 1.0).unwrap();
    let (begins, goes_on) = (painted(&[begun]), painted(&[begun, point]));
    let edits = switch(bench.rig(), "twist", true);
    let (rig, done) = (bench.rig_entity(), steps(&mut bench));
    // The stroke begins with the switch, so that the shares wait for its end however fast they are computed.
    for change in [Change::Do(Operation::Edits(edits)), Change::Preview(begins)] {
        bench.app_mut().world_mut().write_message(EditRequest { rig, change });
    }
    bench.app_mut().update();
    bench.app_mut().world_mut().write_message(EditRequest { rig, change: Change::Preview(goes_on) });
    bench.app_mut().update();
    wait(bench.app_mut(), "the shares", App::update, |app| {
        let mut jobs = app.world().try_query::<&SkinningJob>().expect("there are jobs");
        jobs.single(app.world()).expect("the shares wait for the end of the stroke").waits()
    });
    change(&mut bench, Change::Commit);
    assert_eq!(steps(&mut bench), done + 3, "the switch, the stroke, and the shares");
    let after = bench.weights().unwrap();
    assert!(after.joints.iter().any(|joint| !before.joints.contains(joint)), "the new joints have shares");
    let row: Vec<(Uid, f32)> =
        after.weights.of(point as usize).map(|(joint, weight)| (after.joints[joint as usize], weight)).collect();
    assert_eq!(row, [(head, 1.0)], "the stroke stays");
}
