//! Features: what governs commands, features that act as one, and kinds of features.

use super::*;

#[test]
fn a_command_is_active_if_all_that_governs_it_is_on() {
    for (tag, group, feature) in (0..8).map(|bits| (bits & 1 > 0, bits & 2 > 0, bits & 4 > 0)) {
        let mut desk = Desk::new();
        // The feature may be anywhere in the rig.
        desk.run(TagOperation::Move { tags: vec![IK_L], joint: HAND_R, before: None });
        desk.run(TagOperation::Enable(vec![HANDLE_L], tag));
        desk.run(TagOperation::EnableGroup(LEFT, group));
        desk.run(TagOperation::Enable(vec![IK_L], feature));
        let arm = &desk.rig.joint(ARM_L).unwrap().data;
        assert_eq!(is_active(&desk.rig, arm, desk.tag(HANDLE_L)), tag && group && feature);
        let hand = &desk.rig.joint(HAND_R).unwrap().data;
        assert!(is_active(&desk.rig, hand, desk.tag(SPACE_R)));
    }
    let mut desk = Desk::new();
    desk.run(TagOperation::Enable(vec![IK_L], false));
    desk.rig.apply(&RigEdit::RemoveTag(ARM_L, IK_L)).unwrap();
    let arm = &desk.rig.joint(ARM_L).unwrap().data;
    assert!(is_active(&desk.rig, arm, desk.tag(HANDLE_L)), "a feature that is gone turns nothing off");
}

/// Features of two groups: `IK` on the left with two switches, on the right without; one unnamed.
fn features() -> Desk {
    let mut desk = Desk::new();
    let put = |desk: &mut Desk, joint, tag: TagData| {
        desk.rig.apply(&RigEdit::AddTag { joint, tag: Box::new(tag), index: 9 }).unwrap();
    };
    put(&mut desk, HAND_L, feature(Uid(0x30), "ik", "IK arm", "soft"));
    put(&mut desk, HAND_L, feature(Uid(0x31), "ik", "IK arm", "stretch"));
    put(&mut desk, ARM_L, feature(Uid(0x32), "ik", "IK arm", "soft"));
    put(&mut desk, ARM_L, feature(Uid(0x33), "ik", "", "soft"));
    put(&mut desk, ARM_L, feature(Uid(0x34), "fk", "IK arm", ""));
    put(&mut desk, HIPS, feature(Uid(0x35), "ik", "IK arm", ""));
    desk
}

#[test]
fn features_of_one_kind_and_name_in_one_group_act_as_one() {
    let mut desk = features();
    let key = |group, kind: &str| FeatureKey { group, kind: kind.into(), name: "IK arm".into() };
    let listed: Vec<_> = combined_features(&desk.rig).into_iter().map(|feature| (feature.key, feature.tags)).collect();
    let expected = [
        (key(None, "ik"), vec![Uid(0x35)]),
        (key(Some(LEFT), "ik"), vec![IK_L, Uid(0x32), Uid(0x30), Uid(0x31)]),
        (key(Some(LEFT), "fk"), vec![Uid(0x34)]),
        (key(Some(RIGHT), "ik"), vec![IK_R]),
    ];
    assert_eq!(listed, expected, "and the unnamed one is not offered");

    let off = |desk: &Desk| {
        let all = [IK_L, Uid(0x30), Uid(0x31), Uid(0x32), Uid(0x33), Uid(0x34), Uid(0x35), IK_R];
        all.into_iter().filter(|uid| !desk.tag(*uid).enabled).map(|uid| uid.0).collect::<Vec<_>>()
    };
    let state = |desk: &Desk| {
        let feature = combined_features(&desk.rig).swap_remove(1);
        let active: Vec<String> = feature.active_switches().map(str::to_owned).collect();
        (feature.state, active.join(" "))
    };
    let left = key(Some(LEFT), "ik");
    assert_eq!(state(&desk), (FeatureState::On, "soft stretch".into()));
    desk.run(TagOperation::SetSwitch(left.clone(), "soft".into(), false));
    assert_eq!(off(&desk), [0x30, 0x32]);
    assert_eq!(state(&desk), (FeatureState::Mixed, "stretch".into()));
    desk.run(TagOperation::ChooseSwitch(left.clone(), "soft".into()));
    assert_eq!(off(&desk), [0x31]);
    desk.run(TagOperation::SetFeature(left.clone(), false));
    assert_eq!(off(&desk), [0x20, 0x30, 0x31, 0x32]);
    assert_eq!(state(&desk), (FeatureState::Off, String::new()));
    desk.run(TagOperation::ChooseSwitch(left.clone(), "stretch".into()));
    assert_eq!(off(&desk), [0x30, 0x32]);
    desk.run(TagOperation::SetFeature(left.clone(), true));
    assert_eq!(off(&desk), [0; 0]);
    desk.run(TagOperation::Enable(vec![Uid(0x30)], false));
    assert_eq!(combined_features(&desk.rig)[1].switches[0].state, FeatureState::Mixed);

    assert_eq!(features_named(&desk.rig, "IK arm").unwrap().len(), 4);
    for (error, says) in [
        (desk.refusal(TagOperation::SetSwitch(left, "sotf".into(), true)), "did you mean \"soft\"?"),
        (desk.refusal(TagOperation::SetFeature(key(Some(RIGHT), "fk"), true)), "\"IK arm\" of kind \"fk\""),
        (features_named(&desk.rig, "IK amr").unwrap_err().into(), "did you mean \"IK arm\"?"),
    ] {
        assert!(error.to_string().contains(says), "{error}");
    }
}

#[test]
fn kinds_of_feature_are_registered_from_outside_and_unknown_ones_told() {
    let mut desk = Desk::new();
    desk.run(TagOperation::Feature { tag: IK_L, kind: "wing".into(), name: "W".into(), switch: String::new() });
    desk.run(TagOperation::Feature { tag: IK_R, kind: "spnie".into(), name: "S".into(), switch: String::new() });
    let mut kinds = FeatureKinds::default();
    let unknown = kinds.unknown_in(&desk.rig);
    assert_eq!(unknown.iter().map(|unknown| unknown.tag).collect::<Vec<_>>(), [IK_L, IK_R]);
    assert!(unknown[1].to_string().contains("did you mean \"spine\"?"), "{}", unknown[1]);
    assert!(unknown[1].to_string().starts_with("the feature \"S\" on joint "), "{}", unknown[1]);
    assert!(!unknown[1].to_string().contains(&IK_R.to_string()), "{}", unknown[1]);
    let wing = FeatureKind { icon: "wing.svg".into(), ..FeatureKind::new("wing", "Wing", "Feathers.") };
    assert_eq!(kinds.register(wing.clone()), None);
    assert_eq!(kinds.get("wing"), Some(&wing));
    assert_eq!(kinds.unknown_in(&desk.rig).len(), 1);
    assert!(kinds.iter().any(|kind| kind.name == "ik" && !kind.icon.is_empty() && !kind.form.is_empty()));
}

#[test]
fn every_kind_of_feature_has_its_form_and_icon() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/modules");
    for kind in FeatureKinds::default().iter() {
        let form = read_form(&std::fs::read(folder.join(&kind.form)).unwrap()).unwrap();
        let edited: Vec<&str> = form.elements().iter().filter_map(|e| e.bound()).map(|(param, _)| param).collect();
        assert_eq!(edited, ["kind", "name", "switch"]);
        let offers = |e: &&FormElement| matches!(e, FormElement::Menu { options, .. } if options.contains(&kind.name));
        assert!(form.elements().iter().any(offers), "the form does not offer {}", kind.name);
        let icon = std::fs::read_to_string(folder.join(&kind.icon)).unwrap();
        assert!(icon.starts_with("<svg") && icon.contains("viewBox=\"0 0 24 24\""), "{}", kind.name);
    }
}
