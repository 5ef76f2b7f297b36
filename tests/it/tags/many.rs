//! Operations that bring many tags at once.

use rigsmith::rig::{
    Rig, TagKind, Uid, UidSource,
    operations::{Operation, TagOperation},
};

use super::{ARM_L, ARM_R, HAND_L, HAND_R, HIPS, body};

fn add(joints: &[Uid], params: &str) -> Operation {
    let kind = TagKind::Command { module: "null".into(), params: params.into(), feature: None };
    Operation::Tags(TagOperation::Add { joints: joints.to_vec(), kind, index: None })
}

/// Parameters of the last tag of each joint.
fn last_params(rig: &Rig) -> Vec<String> {
    let last = |joint: &Uid| match rig.joint(*joint)?.data.tags.last()?.kind.clone() {
        TagKind::Command { params, .. } => Some(params),
        TagKind::Feature { .. } => None,
    };
    [HIPS, ARM_L, HAND_L, ARM_R, HAND_R].iter().filter_map(last).collect()
}

/// Tags that are added at once have the names that they have one after the other, also labels that they give themselves.
#[test]
fn tags_at_once_are_bound_as_one_by_one() {
    let joints = [HIPS, ARM_L, HAND_L, ARM_R, HAND_R];
    for params in [
        "(at: \"@joint hips\")",
        "(at: \"@joints group:arm_r label:hand_r + @joint arm_l\")",
        "(at: \"@any label:elbow_l\", label: \"elbow_l\")",
        "(at: \"@any group:arm_r label:hand_l\", label: \"hand_l\")",
        "(at: \"@command ik_handle + @command control/grip_l\")",
    ] {
        let (mut at_once, mut one_by_one) = (body(), body());
        let uids = UidSource::seeded(1);
        add(&joints, params).run(&mut at_once, &mut uids.clone(), None).unwrap();
        let mut uids = uids.clone();
        for joint in joints {
            add(&[joint], params).run(&mut one_by_one, &mut uids, None).unwrap();
        }
        assert_eq!(at_once, one_by_one, "{params}");
        let last = last_params(&at_once);
        assert!(last.len() == joints.len() && last.iter().all(|params| params.contains('#')), "{last:?}");
    }
    // A name that the first of the tags makes ambiguous is refused for the second.
    let mut rig = body();
    let before = rig.clone();
    let added = add(&[ARM_L, ARM_R], "(at: \"@command control\")").run(&mut rig, &mut UidSource::seeded(1), None);
    assert!(added.is_ok());
    let mut rig = before.clone();
    let kind =
        TagKind::Command { module: "control".into(), params: "(at: \"@command control\")".into(), feature: None };
    let twice = TagOperation::Add { joints: vec![ARM_L, ARM_R], kind, index: None };
    let refused = Operation::Tags(twice).run(&mut rig, &mut UidSource::seeded(1), None);
    assert!(refused.is_err());
    assert_eq!(rig, before);
}
