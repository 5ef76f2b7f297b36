//! Lists of a rig whose items have uids.

use rigsmith::rig::{EditError, GroupData, RestTransform, Rig, RigEdit, RigInput, StoredPose, Uid};

/// Groups, inputs and stored poses are found by their uids wherever they were added, removed or exchanged in their lists.
#[test]
fn lists_with_uids_find_their_items_after_each_edit() {
    let mut rig = Rig::new(Uid(1), "lists");
    let group =
        |number: u64| GroupData { uid: Uid(number), name: format!("g{number}"), color: [0.5; 3], enabled: true };
    let pose = |number: u64| StoredPose { uid: Uid(number), name: format!("p{number}"), ..StoredPose::default() };
    let input = |number: u64| RigInput { uid: Uid(number), name: format!("i{number}"), rest: RestTransform::default() };
    let check = |rig: &Rig, places: [&[u64]; 3]| {
        let groups: Vec<u64> = rig.groups().iter().map(|group| group.uid.0).collect();
        let poses: Vec<u64> = rig.stored_poses().iter().map(|pose| pose.uid.0).collect();
        let inputs: Vec<u64> = rig.inputs().iter().map(|input| input.uid.0).collect();
        assert_eq!([&groups[..], &poses[..], &inputs[..]], places);
        for number in 1..50 {
            let uid = Uid(number);
            assert_eq!(rig.group(uid).map(|group| group.uid), groups.contains(&number).then_some(uid));
            assert_eq!(rig.stored_pose(uid).map(|pose| pose.uid), poses.contains(&number).then_some(uid));
            assert_eq!(rig.input(uid).map(|input| input.uid), inputs.contains(&number).then_some(uid));
            let is_listed = groups.contains(&number) || poses.contains(&number) || inputs.contains(&number);
            assert_eq!(rig.is_taken(uid), is_listed, "{number}");
        }
    };
    let mut undo = Vec::new();
    let before = rig.clone();
    let mut apply = |rig: &mut Rig, edit: RigEdit| undo.push(rig.apply(&edit).unwrap());
    for (number, place) in [(10, 9), (11, 0), (12, 1), (13, 9)] {
        apply(&mut rig, RigEdit::AddLocalGroup(group(number), place));
        apply(&mut rig, RigEdit::AddStoredPose(Box::new(pose(number + 10)), place));
    }
    apply(&mut rig, RigEdit::SetInputs([30, 31, 32].map(input).to_vec()));
    check(&rig, [&[11, 12, 10, 13], &[21, 22, 20, 23], &[30, 31, 32]]);
    apply(&mut rig, RigEdit::RemoveLocalGroup(Uid(12)));
    apply(&mut rig, RigEdit::RemoveStoredPose(Uid(23)));
    apply(&mut rig, RigEdit::SetInputs([32, 33, 30].map(input).to_vec()));
    check(&rig, [&[11, 10, 13], &[21, 22, 20], &[32, 33, 30]]);
    apply(&mut rig, RigEdit::SetLocalGroup(GroupData { name: "other".into(), ..group(13) }));
    apply(&mut rig, RigEdit::SetStoredPose(Box::new(StoredPose { name: "other".into(), ..pose(20) })));
    apply(&mut rig, RigEdit::AddLocalGroup(group(14), 1));
    check(&rig, [&[11, 14, 10, 13], &[21, 22, 20], &[32, 33, 30]]);
    assert_eq!(rig.group(Uid(13)).map(|group| group.name.as_str()), Some("other"));
    assert_eq!(rig.stored_pose(Uid(20)).map(|pose| pose.name.as_str()), Some("other"));
    assert_eq!(rig.apply(&RigEdit::RemoveLocalGroup(Uid(12))), Err(EditError::NoGroup(Uid(12))));
    while let Some(edit) = undo.pop() {
        rig.apply(&edit).unwrap();
    }
    assert_eq!(rig, before);
    check(&rig, [&[], &[], &[]]);
}
