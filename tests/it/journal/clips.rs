//! Clips in the journal: every change of keys comes back after a crash, with its history.

use bevy::math::Quat;
use rigsmith::{
    files::journal::{Basis, recover},
    rig::{
        PoseOffset, Uid,
        animation::{Ease, Key, LayerMode, Property, TrackTarget},
        operations::{ClipOperation, KeyOperation, Operation},
    },
};

use super::Desk;

#[test]
fn clips_come_back_from_the_journal() {
    let folder = tempfile::tempdir().unwrap();
    let mut desk = Desk::apart(folder.path());
    desk.place(1);
    let node = desk.rig.roots()[0];
    let create = ClipOperation::Create { name: "walk".into(), frame_rate: 30.0, range: [0.0, 2.0] };
    desk.operate(&Operation::Clips(create));
    let clip = desk.rig.clips()[0].uid;
    let add = ClipOperation::AddLayer { clip, name: "top \"1\"".into(), mode: LayerMode::Additive };
    desk.operate(&Operation::Clips(add));
    let [base, top] = [0, 1].map(|place: usize| desk.rig.clips()[0].layers[place].uid);
    let change = |layer: Uid, change| Operation::Clips(ClipOperation::Keys { clip, layer, change });
    let rotation = TrackTarget { node, property: Property::Rotation };
    let keys = (0..50).map(|frame| Key::rotation(frame as f32 / 30.0, Quat::from_rotation_x(frame as f32 * 0.1)));
    desk.operate(&change(base, KeyOperation::Set(vec![(rotation.clone(), keys.collect())])));
    let eased = Key { ease: Ease::Cubic { arrive: [1e-9; 4], leave: [0.1; 4] }, ..Key::rotation(0.5, Quat::IDENTITY) };
    desk.operate(&change(top, KeyOperation::Set(vec![(rotation.clone(), vec![eased])])));
    let pose = Operation::Pose(vec![(node, PoseOffset::from_rotation(Quat::from_rotation_y(1.0)))]);
    desk.operate(&Operation::Keyed { operation: Box::new(pose), clip, layer: Some(base), time: 0.77 });
    desk.operate(&change(base, KeyOperation::Move { keys: [(rotation, vec![0.0])].into(), by: -0.5 }));
    desk.undo();
    desk.undo();
    desk.redo();
    let found = recover(&desk.bytes()).unwrap();
    assert!(found.gaps().is_empty());
    let replayed = found.restore(Basis::Journal, None).replayed;
    assert_eq!(replayed.rig, desk.rig);
    assert_eq!(replayed.rig.clips()[0].key_count(), desk.rig.clips()[0].key_count());
    assert!(replayed.rig.clips()[0].key_count() >= 52);
    assert_eq!(replayed.stacks.done.len(), desk.history.steps().1);
}
