//! Nodes that get keys when a motion goes onto controls.

use std::{collections::BTreeSet, sync::Arc};

use rigsmith::{
    modules,
    processor::Builder,
    rig::{
        NodeType,
        animation::{Property, motion::Motion},
        format::bvh::read_bvh,
    },
};

use super::{PlayedRig, RetargetSettings, motion, shipped, test_data};

/// Names of the controls that have keys, with `.` before a property of theirs. Panics if a node that is no control has keys.
fn keyed(rig: &str, motion: &Motion) -> BTreeSet<String> {
    let settings = RetargetSettings { frame_rate: Some(30.0), ..RetargetSettings::default() };
    let played = PlayedRig::new(shipped(rig), motion, &settings);
    assert!(played.done.unmoved.is_empty(), "{rig}: {:?}", played.done.unmoved);
    let built = Builder::build(&played.rig, &Arc::new(modules::all())).unwrap();
    let name = |(target, _): (&rigsmith::rig::animation::TrackTarget, _)| {
        let node = built.node(target.node).unwrap();
        assert_eq!(node.kind, NodeType::Control, "{rig}: {} has keys", node.name);
        match &target.property {
            Property::Translation => format!("{}.translation", node.name),
            Property::Rotation => format!("{}.rotation", node.name),
            Property::Scale => format!("{}.scale", node.name),
            Property::Attribute(name) => format!("{}.{name}", node.name),
        }
    };
    played.done.clip.layers[0].tracks.iter().map(name).collect()
}

/// Two legs and a trunk, without any data.
#[test]
fn a_walk_has_its_keys_on_controls() {
    let walker = read_bvh(include_bytes!("walker.bvh"), "walker").unwrap();
    let keyed = keyed("biped", &walker);
    for name in ["torso.translation", "head.rotation"] {
        assert!(keyed.contains(name), "{name}: {keyed:?}");
    }
    assert!(!keyed.iter().any(|name| name.starts_with("root.")), "{keyed:?}");
}

#[test]
fn captured_motion_has_its_keys_on_controls() {
    let Some(data) = test_data() else { return };
    let motion = motion(&data, "cmu_01_01");
    let keyed_biped = keyed("biped", &motion);
    for name in ["torso.translation", "torso.rotation", "neck.rotation", "head.rotation"] {
        assert!(keyed_biped.contains(name), "{name}: {keyed_biped:?}");
    }
    let of_spine = keyed_biped.iter().filter(|name| name.starts_with("spine_fk") && name.ends_with(".rotation"));
    assert!(of_spine.count() >= 2, "{keyed_biped:?}");
    // The hind legs have a joint more than a human's: their forward controls turn what the motion turns.
    let keyed = keyed("quadruped", &motion);
    let of_legs = keyed.iter().filter(|name| name.starts_with("leg_fk_l") && name.ends_with(".rotation"));
    assert!(of_legs.count() >= 2, "{keyed:?}");
    assert!(keyed.contains("body.translation") && keyed.contains("body.rotation"), "{keyed:?}");
}
