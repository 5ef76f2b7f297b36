//! Parts of other sizes: spines of more bones, chains of as many joints as they go onto.

use std::{collections::BTreeMap, fs, path::Path, sync::Arc};

use rigsmith::{
    files::{RealDisk, bundled_parts, load_template},
    modules,
    processor::{Builder, review},
    rig::{
        JointData, RestTransform, Rig, RigEdit, Uid, UidSource,
        label::mirrored_label,
        operations::{Operation, OperationError, Outcome, TagError, TagOperation},
        part::{Part, PartNeeds},
        template::read_template,
    },
    solve::program::{CompileOptions, RigProgram, RigState},
};

use super::bench::shipped;

/// A rig whose hips carry a spine with so many joints, the hips and the chest among them.
fn spine(folder: &Path, count: usize) -> Result<Rig, String> {
    let text = format!(
        "(format: 2, name: \"trunk\", joints: [(label: \"hips\", translation: (0, 0.955, -0.006))], parts: [(part: \
         \"parts/spine.rig.ron\", onto: [\"hips\"], adds: true, count: {count})])"
    );
    let path = folder.join("trunk.rig.ron");
    fs::write(&path, text).unwrap();
    load_template(&RealDisk, &path).map(|template| template.rig).map_err(|error| error.to_string())
}

fn labels(rig: &Rig) -> BTreeMap<String, Uid> {
    rig.walk().map(|joint| (joint.data.label.clone().unwrap(), joint.data.uid)).collect()
}

/// Builds a rig, whose joints stand as they rest, to `near`. Returns the number of its controls.
fn controls(rig: &Rig, near: f32) -> usize {
    assert_eq!(review(rig, &Arc::new(modules::all())), Vec::new(), "{}", rig.about().name);
    let built = Builder::build(rig, &Arc::new(modules::all())).unwrap();
    let program = RigProgram::compile(&built, &CompileOptions::default()).unwrap();
    let mut state = RigState::new(Arc::new(program));
    state.evaluate(0.0);
    for joint in rig.walk() {
        let (rest, now) = (rig.position(joint.data.uid), state.global(joint.data.uid).unwrap().translation);
        assert!(rest.distance(now) < near, "{:?} rests at {rest} and stands at {now}", joint.data.label);
    }
    built.nodes.iter().filter(|node| node.control.is_some()).count()
}

#[test]
fn a_spine_has_as_many_joints_as_its_use_says() {
    let folder = tempfile::tempdir().unwrap();
    let usual = spine(folder.path(), 4).unwrap();
    let (known, usual_controls) = (labels(&usual), controls(&usual, 1e-4));
    let chest = usual.position(known["chest"]);
    for count in 3..=9 {
        let rig = spine(folder.path(), count).unwrap();
        let found = labels(&rig);
        assert_eq!(found.len(), count, "{found:?}");
        // The ends stay where they are, what is between lies on the line, each the child of the one before.
        assert!(rig.position(found["chest"]).distance(chest) < 1e-5, "{count}");
        let chain: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
        let gaps: Vec<f32> =
            chain.windows(2).map(|pair| rig.position(pair[0]).distance(rig.position(pair[1]))).collect();
        let (least, most) = gaps.iter().fold((f32::MAX, 0f32), |(least, most), gap| (least.min(*gap), most.max(*gap)));
        assert!(most < 1.5 * least, "{count}: {gaps:?}");
        assert!(chain.windows(2).all(|pair| rig.joint(pair[1]).unwrap().parent == Some(pair[0])));
        // What stays keeps its identity.
        for label in ["hips", "spine", "spine_1", "chest"].into_iter().filter(|label| found.contains_key(*label)) {
            assert_eq!(found[label], known[label], "{count}: {label}");
        }
        let tags = |rig: &Rig| -> Vec<Uid> {
            let all = rig.walk().flat_map(|joint| &joint.data.tags).map(|tag| tag.uid);
            let mut all: Vec<Uid> = all.collect();
            all.sort_unstable();
            all
        };
        assert_eq!(tags(&rig), tags(&usual), "{count}");
        // One forward control a joint.
        // Joints between the points of the curve stand on it, a little beside the line from point to point.
        assert_eq!(controls(&rig, 4e-3) + 4, usual_controls + count, "{count}");
        if count == 7 {
            let expected = ["chest", "hips", "spine", "spine_1", "spine_2", "spine_3", "spine_4"];
            assert_eq!(found.keys().map(String::as_str).collect::<Vec<_>>(), expected);
        }
    }
    // The joints of a spine of seven are those of one of nine, as far as both have them.
    let (seven, nine) = (spine(folder.path(), 7).unwrap(), spine(folder.path(), 9).unwrap());
    let nine = labels(&nine);
    assert!(labels(&seven).iter().all(|(label, uid)| nine[label] == *uid));
    for count in [0, 2, 10, usize::MAX] {
        let error = spine(folder.path(), count).unwrap_err();
        assert!(error.contains("takes 3 to 9 joints") && error.contains("trunk.rig.ron"), "{error}");
    }
}

#[test]
fn a_chain_goes_onto_as_many_joints_as_there_are() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("snake.rig.ron");
    for (part, least) in [("fk_chain", 1), ("ikfk_chain", 3), ("spring_chain", 2), ("tail", 3)] {
        for count in [1, 2, 3, 5, 8] {
            let joint = |number: usize| {
                let parent = if number > 1 { format!("parent: \"bone_{}\", ", number - 1) } else { String::new() };
                format!("(label: \"bone_{number}\", {parent}translation: (0, 0.1, {:?}))", 0.02 * number as f32)
            };
            let joints: Vec<String> = (1..=count).map(joint).collect();
            let onto: Vec<String> = (1..=count).map(|number| format!("\"bone_{number}\"")).collect();
            let text = format!(
                "(format: 2, name: \"snake\", joints: [{}], parts: [(part: \"parts/{part}.rig.ron\", onto: [{}])])",
                joints.join(", "),
                onto.join(", ")
            );
            fs::write(&path, text).unwrap();
            match load_template(&RealDisk, &path) {
                Ok(template) if count >= least => {
                    assert_eq!(template.notes, [""; 0], "{part} onto {count}");
                    assert!(controls(&template.rig, 1e-4) >= count, "{part} onto {count}");
                }
                Err(error) if count < least => assert!(error.to_string().contains("joints"), "{error}"),
                other => panic!("{part} onto {count}: {:?}", other.map(|template| template.notes)),
            }
        }
    }
}

/// A rig of `count` joints that hang on each other as those of a part, and one below the other after its last.
fn host(part: &Rig, count: usize) -> (Rig, Vec<Uid>) {
    let mut rig = Rig::new(Uid(0x5eed_0000), "host");
    let mut joints: Vec<Uid> = Vec::new();
    let mut places: BTreeMap<Uid, Uid> = BTreeMap::new();
    let mut of_part = part.walk();
    for number in 1..=count {
        let uid = Uid(0x5eed_0000 + number as u64);
        let (parent, rest) = match of_part.next() {
            Some(joint) => {
                places.insert(joint.data.uid, uid);
                (joint.parent.map(|parent| places[&parent]), joint.data.rest)
            }
            None => (joints.last().copied(), RestTransform::from_translation(bevy::math::Vec3::new(0.0, 0.1, 0.0))),
        };
        let joint = JointData { uid, label: Some(format!("host_{number}")), rest, ..JointData::default() };
        rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent, index: usize::MAX }).unwrap();
        joints.push(uid);
    }
    (rig, joints)
}

fn dropped(rig: &mut Rig, part: &Arc<Part>, joints: Vec<Uid>) -> Result<Outcome, OperationError> {
    let drop = TagOperation::Drop { part: Arc::clone(part), joints, bindings: BTreeMap::new() };
    Operation::Tags(drop).run(rig, &mut UidSource::seeded(11), None)
}

/// A part on any number of joints: what is dropped is all that those joints of the part hold, and builds; else nothing
/// changes, and the joints that it needs are told.
#[test]
fn every_part_goes_whole_onto_as_many_joints_as_it_needs_or_is_refused() {
    let mut least = BTreeMap::new();
    for (name, part) in bundled_parts() {
        let name = name.trim_start_matches("parts/").trim_end_matches(".rig.ron").to_owned();
        for count in 1..=part.rig.len() + 2 {
            let what = format!("{name} on {count} joints");
            let sized = part.sized_for(count).unwrap_or_else(|_| part.rig.clone());
            let (mut rig, joints) = host(&sized, count);
            let before = rig.clone();
            match dropped(&mut rig, &part, joints) {
                Err(OperationError::Tag(TagError::PartNeeds { part: told, joints: needed, given })) => {
                    assert!(rig == before, "{what}: refused, but changed");
                    assert_eq!((told, given), (part.rig.about().name.clone(), count), "{what}");
                    assert!(needed.len() > count && !least.contains_key(&name), "{what}: {needed:?}");
                }
                Err(error) => panic!("{what}: {error}"),
                Ok(outcome) => {
                    least.entry(name.clone()).or_insert(count);
                    let needs = PartNeeds::of(&sized).joints;
                    assert!(needs.len() <= count, "{what}: needs {needs:?}");
                    let tags = |rig: &Rig| -> usize { rig.walk().take(count).map(|joint| joint.data.tags.len()).sum() };
                    assert_eq!(tags(&rig), tags(&sized), "{what}");
                    let is_told = outcome.notes.iter().any(|note| note.contains("left over"));
                    assert_eq!(is_told, sized.len() != count, "{what}: {:?}", outcome.notes);
                    controls(&rig, 0.02);
                }
            }
        }
    }
    let expected = [
        ("arm", 4),
        ("bendy_limb", 5),
        ("eye", 1),
        ("fk_chain", 1),
        ("front_leg", 3),
        ("hand", 16),
        ("ikfk_chain", 3),
        ("jaw", 1),
        ("leg", 4),
        ("leg_3joint", 4),
        ("lips", 1),
        ("neck_chain", 3),
        ("neck_head", 1),
        ("single_control", 1),
        ("spine", 3),
        ("spring_chain", 2),
        ("tail", 3),
        ("tongue", 3),
        ("wing", 9),
    ];
    let expected: BTreeMap<String, usize> =
        expected.into_iter().map(|(name, count)| (name.to_owned(), count)).collect();
    assert_eq!(least, expected);
}

#[test]
fn joints_that_do_not_follow_each_other_as_those_of_the_part_are_refused() {
    let part = |wanted: &str| {
        let mut parts = bundled_parts().into_iter();
        parts.find(|(name, _)| *name == format!("parts/{wanted}.rig.ron")).unwrap().1
    };
    let arm = part("arm");
    let (mut rig, joints) = host(&arm.rig, 4);
    let before = rig.clone();
    let [a, b, c, d] = joints[..] else { panic!("{joints:?}") };
    for (joints, told) in [
        (vec![d, c, b, a], ["\"host_3\" is not next below \"host_4\"", "clavicle_l, upper_arm_l, forearm_l, hand_l"]),
        (vec![a, c, b, d], ["\"host_3\" is not next below \"host_1\"", "upper_arm_l next below clavicle_l"]),
        (vec![a, b, b, d], ["\"host_2\" is given twice", "\"arm\""]),
        (vec![a, a], ["\"host_1\" is given twice", "\"arm\""]),
        (vec![a], ["needs 4 joints", "clavicle_l, upper_arm_l, forearm_l, hand_l; it gets 1:"]),
    ] {
        let error = dropped(&mut rig, &arm, joints.clone()).unwrap_err().to_string();
        assert!(told.iter().all(|told| error.contains(told)), "{joints:?}: {error}");
        assert!(rig == before, "{joints:?}: refused, but changed");
    }
    // Joints between those that are given are passed over.
    let (mut rig, joints) = host(&part("fk_chain").rig, 5);
    dropped(&mut rig, &part("fk_chain"), vec![joints[0], joints[2], joints[4]]).unwrap();
    // Fingers are no chain.
    let hand = part("hand");
    let (mut rig, joints) = host(&part("fk_chain").sized_for(16).unwrap(), 16);
    let error = dropped(&mut rig, &hand, joints).unwrap_err().to_string();
    assert!(error.contains("index_01_l next below hand_l") && error.contains("\"host_5\""), "{error}");
}

#[test]
fn chains_that_do_not_fit_are_told_and_left_out() {
    let read = |chains: &str| {
        let text = format!(
            "(format: 2, name: \"part\", chains: [{chains}], joints: [(label: \"a\"), (label: \"b\", parent: \"a\", \
             translation: (0, 1, 0)), (label: \"c\", parent: \"a\", translation: (1, 0, 0))])"
        );
        read_template(text.as_bytes()).unwrap()
    };
    assert_eq!(read("(name: \"x\", joints: [\"a\", \"b\"])").chains.len(), 1);
    for (chains, told) in [
        ("(name: \"x\", joints: [\"a\", \"z\"])", "in the file"),
        ("(name: \"x\", joints: [\"a\"])", "two joints"),
        ("(name: \"x\", joints: [\"b\", \"c\"])", "parent of the next"),
        ("(name: \"x\", joints: [\"a\", \"b\"], min: 3)", "`min` is 1 to 2"),
        ("(name: \"x\", joints: [\"a\", \"b\"], max: 1)", "`max` 2 to"),
        ("(name: \"x\", joints: [\"a\", \"b\"]), (name: \"y\", joints: [\"a\", \"c\"])", "one of its joints"),
    ] {
        let template = read(chains);
        assert!(template.notes.len() == 1 && template.notes[0].contains(told), "{chains}: {:?}", template.notes);
    }
    // Branches are side by side.
    let branches = |list: &str| {
        let text = format!(
            "(format: 2, name: \"part\", chains: [(name: \"x\", joints: [\"a\", \"b\"])], branches: [{list}], joints: [(label: \"a\"), \
             (label: \"b\", parent: \"a\"), (label: \"c\", parent: \"a\")])"
        );
        read_template(text.as_bytes()).unwrap()
    };
    let template = branches("(name: \"y\", joints: [\"b\", \"c\"])");
    assert!(template.notes.is_empty() && template.chains.len() == 2 && template.chains[1].is_fan);
    for (list, told) in [
        ("(name: \"y\", joints: [\"a\", \"b\"])", "hang on one joint"),
        ("(name: \"y\", joints: [\"b\", \"b\"])", "hang on one joint"),
        ("(name: \"x\", joints: [\"b\", \"c\"])", "has its name"),
    ] {
        let template = branches(list);
        assert!(template.notes.len() == 1 && template.notes[0].contains(told), "{list}: {:?}", template.notes);
    }
    // A use that asks for what the part does not have is told with its place.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.rig.ron");
    for (count, told) in [("count: 3", "no chain"), ("counts: [(chain: \"tail\", count: 3)]", "no chain")] {
        let text = format!("(format: 2, name: \"a\", parts: [\n    (part: \"parts/jaw.rig.ron\", {count}),\n])");
        fs::write(&path, text).unwrap();
        let error = load_template(&RealDisk, &path).unwrap_err().to_string();
        assert!(error.contains(told) && error.contains("line 2"), "{error}");
    }
}

#[test]
fn both_sides_of_a_character_of_parts_are_partners() {
    for (name, joints) in [("biped", 52), ("quadruped", 42), ("bird", 48)] {
        let rig = shipped(name);
        assert_eq!(rig.len(), joints, "{name}");
        assert!(rig.walk().all(|joint| joint.data.group.is_some()), "{name}: every joint is in a group");
        assert!(rig.groups().iter().all(|group| !group.name.ends_with("_2")), "{name}: {:?}", rig.groups());
        let mut pairs = 0;
        for joint in rig.walk() {
            let label = joint.data.label.as_deref().unwrap();
            let other = mirrored_label(label).and_then(|label| rig.find_label(&label));
            if !joint.data.tags.is_empty() && other.is_some() {
                assert_eq!(joint.data.mirror, other, "{name}: {label}");
                pairs += 1;
            }
        }
        assert!(pairs > 8, "{name}: {pairs}");
    }
}

/// The program's own parts are found wherever a template lies, and a file of the same name beside it counts more.
#[test]
fn parts_that_come_with_the_program_are_found_anywhere() {
    let folder = tempfile::tempdir().unwrap();
    let text = "(format: 2, name: \"a\", parts: [(part: \"parts/single_control.rig.ron\")])";
    let path = folder.path().join("a.rig.ron");
    fs::write(&path, text).unwrap();
    let load = || load_template(&RealDisk, &path).map(|template| template.rig);
    assert!(load().unwrap().find_label("control").is_some());
    fs::create_dir(folder.path().join("parts")).unwrap();
    let own = "(format: 2, name: \"mine\", joints: [(label: \"own\")])";
    fs::write(folder.path().join("parts/single_control.rig.ron"), own).unwrap();
    assert!(load().unwrap().find_label("own").is_some());
    // A broken file is told, not passed over.
    fs::write(folder.path().join("parts/single_control.rig.ron"), &own[..20]).unwrap();
    assert!(load().unwrap_err().to_string().contains("single_control.rig.ron"));
}

/// A hand with counts of its chains, on the other side where `is_right`.
fn hand(folder: &Path, counts: &[(&str, usize)], is_right: bool) -> Result<Rig, String> {
    let counts: Vec<String> =
        counts.iter().map(|(chain, count)| format!("(chain: \"{chain}\", count: {count})")).collect();
    let counts = counts.join(", ");
    let text = format!(
        "(format: 2, name: \"arm\", parts: [(part: \"parts/hand.rig.ron\", name: \"hand\", mirror: {is_right}, counts: [{counts}])])"
    );
    let path = folder.join("arm.rig.ron");
    fs::write(&path, text).unwrap();
    load_template(&RealDisk, &path).map(|template| template.rig).map_err(|error| error.to_string())
}

#[test]
fn a_hand_has_as_many_fingers_of_as_many_joints_as_its_use_says() {
    const FINGERS: [&str; 5] = ["thumb", "index", "middle", "ring", "pinky"];
    let folder = tempfile::tempdir().unwrap();
    let usual = hand(folder.path(), &[], false).unwrap();
    let known = labels(&usual);
    for fingers in 1..=6 {
        for joints in 2..=6 {
            let mut counts: Vec<(&str, usize)> = vec![("fingers", fingers)];
            counts.extend(FINGERS.map(|finger| (finger, joints)));
            let rig = hand(folder.path(), &counts, false).unwrap();
            let found = labels(&rig);
            assert_eq!(found.len(), 1 + fingers * joints, "{found:?}");
            // What stays keeps its identity and its place.
            for finger in FINGERS.iter().take(fingers) {
                let root = format!("{finger}_01_l");
                assert_eq!(found[&root], known[&root]);
                assert!(rig.position(found[&root]).distance(usual.position(known[&root])) < 1e-5, "{root}");
                let (end, was) = (format!("{finger}_0{joints}_l"), format!("{finger}_03_l"));
                assert_eq!(found[&end], known[&was], "{end} is the end");
            }
            assert_eq!(found.contains_key("pinky2_01_l"), fingers == 6);
            // A control for each joint, one for the finger, one for its tip, and one for all.
            assert_eq!(controls(&rig, 1e-4), 1 + fingers * (joints + 2), "{fingers} fingers of {joints} joints");
            // All of them curl.
            let built = Builder::build(&rig, &Arc::new(modules::all())).unwrap();
            let program = RigProgram::compile(&built, &CompileOptions::default()).unwrap();
            let mut state = RigState::new(Arc::new(program));
            let named = |name: &str| {
                let node = built.nodes.iter().find(|node| &*node.name == name && node.control.is_some());
                node.unwrap_or_else(|| panic!("no control {name}")).uid
            };
            state.set_attribute(named("fingers_l"), "curl", 1.0).unwrap();
            state.evaluate(0.0);
            // The base of a thumb does not curl: the second joint of two turns where it is.
            let is_end = |label: &&String| label.contains(&format!("_0{joints}_"));
            for label in found.keys().filter(is_end).filter(|label| joints > 2 || !label.starts_with("thumb")) {
                let (rest, now) = (rig.position(found[label]), state.global(found[label]).unwrap().translation);
                assert!(rest.distance(now) > 0.004, "{label} of {fingers} fingers of {joints} joints stands");
            }
        }
    }
    // The right hand has the same on its side.
    let right = hand(folder.path(), &[("fingers", 6), ("thumb", 2)], true).unwrap();
    let left = hand(folder.path(), &[("fingers", 6), ("thumb", 2)], false).unwrap();
    for joint in left.walk() {
        let label = mirrored_label(joint.data.label.as_deref().unwrap()).unwrap();
        let other = right.find_label(&label).unwrap_or_else(|| panic!("no joint {label}"));
        let (place, mirrored) = (left.position(joint.data.uid), right.position(other));
        assert!((place * glam::Vec3::new(-1.0, 1.0, 1.0)).distance(mirrored) < 1e-5, "{label}");
    }
    let error = hand(folder.path(), &[("fingers", 7)], false).unwrap_err();
    assert!(error.contains("takes 1 to 6"), "{error}");
}
