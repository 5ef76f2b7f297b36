//! Switches of which exactly one is on, and the template format that holds them.

use rigsmith::rig::{
    Rig, Uid, UidSource,
    feature::{FeatureError, FeatureKey, FeatureState, combined_features, undecided_choices},
    operations::{Operation, TagOperation},
    template::{read_header, read_template, write_template},
};

const FROZEN: &str = include_str!("../frozen/format-2-choice.rig.ron");

fn frozen() -> Rig {
    let template = read_template(FROZEN.as_bytes()).unwrap();
    assert!(template.notes.is_empty(), "{:?}", template.notes);
    template.rig
}

fn run(rig: &mut Rig, operation: TagOperation) -> Result<(), String> {
    let done = Operation::Tags(operation).run(rig, &mut UidSource::seeded(1), None);
    done.map(drop).map_err(|error| error.to_string())
}

/// Switches of ccd, fabrik and soft, and the state of their feature.
fn state(rig: &Rig) -> ([bool; 3], FeatureState) {
    let on = [0x30, 0x31, 0x32].map(|uid| rig.find_tag(Uid(uid)).unwrap().1.enabled);
    (on, combined_features(rig)[0].state)
}

#[test]
fn format_2_is_read_and_written_to_the_byte() {
    assert_eq!(write_template(&frozen()), FROZEN);
    let needs = read_header(FROZEN.as_bytes()).unwrap().needs.unwrap();
    assert_eq!((needs.joints, needs.sockets), (vec!["root".to_owned()], vec!["parent of root".into(), "root".into()]));
    let wrong = FROZEN.replacen("joints: [\"root\"]", "joints: [\"foot\"]", 1);
    let notes = read_template(wrong.as_bytes()).unwrap().notes;
    assert!(notes.iter().any(|note| note.contains("needs")), "{notes:?}");
}

#[test]
fn of_a_choice_exactly_one_switch_is_on() {
    let mut rig = frozen();
    let key = FeatureKey { group: None, kind: "ik".into(), name: "reach".into() };
    assert_eq!(state(&rig), ([true, false, true], FeatureState::On));
    run(&mut rig, TagOperation::SetSwitch(key.clone(), "fabrik".into(), true)).unwrap();
    assert_eq!(state(&rig), ([false, true, true], FeatureState::On));
    // Turning the chosen one off would leave none.
    let refused = run(&mut rig, TagOperation::SetSwitch(key.clone(), "fabrik".into(), false)).unwrap_err();
    let chosen = FeatureError::Chosen { feature: "reach".into(), switch: "fabrik".into(), others: "\"ccd\"".into() };
    assert_eq!(refused, chosen.to_string());
    // A switch that stands for itself turns nothing else off.
    run(&mut rig, TagOperation::SetSwitch(key.clone(), "soft".into(), false)).unwrap();
    assert_eq!(state(&rig), ([false, true, false], FeatureState::Mixed));
    run(&mut rig, TagOperation::SetFeature(key.clone(), true)).unwrap();
    assert_eq!(state(&rig), ([false, true, true], FeatureState::On));
    run(&mut rig, TagOperation::SetFeature(key.clone(), false)).unwrap();
    assert_eq!(state(&rig), ([false; 3], FeatureState::Off));
    run(&mut rig, TagOperation::SetFeature(key, true)).unwrap();
    assert_eq!(state(&rig), ([true, false, true], FeatureState::On));
    assert!(undecided_choices(&rig).is_empty());
    // Two that are on by hand are told; making them a choice decides.
    run(&mut rig, TagOperation::Enable(vec![Uid(0x31)], true)).unwrap();
    assert_eq!(undecided_choices(&rig).len(), 1);
    let tags: Vec<Uid> = [0x30, 0x31, 0x32].map(Uid).into();
    run(&mut rig, TagOperation::Choice(tags.clone(), String::new())).unwrap();
    assert_eq!(state(&rig), ([true; 3], FeatureState::On));
    run(&mut rig, TagOperation::Choice(tags, "any".into())).unwrap();
    assert_eq!(state(&rig), ([true, false, false], FeatureState::On));
}

/// Tags of one switch may stand anywhere: the switches come as their first tags do, each with all of its tags.
#[test]
fn switches_gather_their_tags_in_the_order_of_the_document() {
    let count = 200;
    let switch = |number: usize| match number % 3 {
        0 => String::new(),
        1 => format!("own {number}"),
        _ => format!("shared {}", number % 4),
    };
    let tag = |number: usize| format!("Feature(kind: \"ik\", name: \"limb\", switch: {:?})", switch(number));
    let tags = (0..count).map(tag).collect::<Vec<String>>().join(", ");
    let text = format!("(format: 2, name: \"n\", joints: [(label: \"a\", tags: [{tags}])])");
    let rig = read_template(text.as_bytes()).unwrap().rig;
    let features = combined_features(&rig);
    assert_eq!((features.len(), features[0].tags.len()), (1, count));
    let mut names: Vec<String> = Vec::new();
    for name in (0..count).map(switch).filter(|name| !name.is_empty()) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let found: Vec<&str> = features[0].switches.iter().map(|part| part.name.as_str()).collect();
    assert_eq!(found, names);
    for part in &features[0].switches {
        let own = (0..count).filter(|number| switch(*number) == part.name).map(|number| features[0].tags[number]);
        assert_eq!(part.tags, own.collect::<Vec<_>>(), "{}", part.name);
    }
}
