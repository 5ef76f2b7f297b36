//! Leftovers of deleted joints: pose and attribute values of what commands made for them go with them, and come back with undo.

use rigsmith::rig::{TagData, step::edits_from_empty, template::read_template};

use super::*;

const RIG: &str = r#"(format: 2, name: "n", joints: [
    (label: "root", tags: [control()]),
    (label: "arm", parent: "root", translation: (0, 1, 0), tags: [control()]),
    (label: "hand", parent: "arm", translation: (0, 1, 0)),
])"#;

/// The document as bytes.
fn bytes(rig: &Rig) -> String {
    ron::to_string(&edits_from_empty(rig)).unwrap()
}

/// A built rig with a pose and attribute values of joints and controls, and the uids of both controls.
fn posed() -> (RigBench, [Uid; 2]) {
    let rig = read_template(RIG.as_bytes()).unwrap().rig;
    let joints: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
    let mut stage = RigBench::of_built(rig);
    let built = stage.app.world().get::<BuildResult>(stage.rig).unwrap().0.clone();
    let control = |joint: usize| {
        let made = built.nodes.iter().find(|node| {
            node.kind == NodeType::Control && node.origin.as_ref().is_some_and(|origin| origin.subject == joints[joint])
        });
        made.unwrap_or_else(|| panic!("no control on joint {joint}")).uid
    };
    let controls = [control(0), control(1)];
    let offset = |x: f32| Some(PoseOffset { translation: Vec3::new(x, 0.0, 0.0), ..default() });
    let mut edits = Vec::new();
    for (number, node) in controls.iter().chain(&joints).enumerate() {
        edits.push(RigEdit::SetOffset(*node, offset(0.1 + number as f32)));
        edits.push(RigEdit::SetAttributeValue(*node, "stretch".to_owned(), Some(number as f32)));
    }
    stage.apply_all(edits);
    (stage, controls)
}

/// Fails unless nothing but the root and its control has a pose and values.
fn check_only_root(stage: &RigBench, [root, arm]: [Uid; 2]) {
    let rig = stage.rig();
    let posed: Vec<Uid> = rig.pose().keys().copied().collect();
    let valued: Vec<Uid> = rig.attribute_values().keys().copied().collect();
    assert_eq!(posed, valued);
    assert_eq!(posed.len(), 2, "{posed:?}, arm's control is {arm}");
    assert!(posed.contains(&root) && posed.contains(&rig.roots()[0]), "{posed:?}");
}

#[test]
fn deleted_joints_take_the_pose_of_their_controls_along() {
    let (mut stage, controls) = posed();
    let before = bytes(stage.rig());
    let arm = stage.rig().children(Some(stage.rig().roots()[0]))[0];
    stage.change(Change::Do(Operation::Delete { joints: vec![arm], keep_children: false }));
    check_only_root(&stage, controls);
    let after = bytes(stage.rig());
    for _ in 0..2 {
        stage.change(Change::Undo);
        assert_eq!(bytes(stage.rig()), before);
        stage.change(Change::Redo);
        assert_eq!(bytes(stage.rig()), after);
    }
}

#[test]
fn despawned_joints_take_the_pose_of_their_controls_along() {
    let (mut stage, controls) = posed();
    let before = bytes(stage.rig());
    let arm = stage.rig().children(Some(stage.rig().roots()[0]))[0];
    let entity = stage.node(arm).unwrap();
    stage.app.world_mut().entity_mut(entity).despawn();
    stage.app.update();
    assert_eq!(stage.rig().joint(arm), None);
    check_only_root(&stage, controls);
    stage.change(Change::Undo);
    assert_eq!(bytes(stage.rig()), before);
}

/// Features that are off may be switched on again, so their poses stay.
#[test]
fn what_is_switched_off_keeps_its_pose() {
    let (mut stage, controls) = posed();
    let arm = stage.rig().children(Some(stage.rig().roots()[0]))[0];
    let tag = stage.rig().joint(arm).unwrap().data.tags[0].clone();
    stage.apply(RigEdit::SetTag(arm, Box::new(TagData { enabled: false, ..tag })));
    let hand = stage.rig().children(Some(arm))[0];
    stage.change(Change::Do(Operation::Delete { joints: vec![hand], keep_children: false }));
    assert!(stage.rig().offset(controls[1]).is_some());
    assert!(stage.rig().attribute_values().contains_key(&controls[1]));
    assert!(!stage.rig().attribute_values().contains_key(&hand));
}
