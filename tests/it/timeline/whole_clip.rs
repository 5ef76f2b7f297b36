//! Operations on whole clips and tracks: baking, reducing, retiming, masks of layers, and switches over a range.

use rigsmith::{
    plugins::commands::{BuildRequest, BuildResult, BuildStep},
    rig::{AttributeKind, Matching, NodeType},
};

use super::*;

#[test]
fn tracks_are_baked_and_reduced() {
    let (mut desk, [_, left, right]) = opened();
    let reason = |desk: &Desk, action: TimelineAction| obstacle(desk.app.world(), Action::Timeline(action));
    for action in [TimelineAction::Bake, TimelineAction::Reduce] {
        assert_eq!(reason(&desk, action), Some("no key is selected"), "{action:?}");
    }
    let keys: KeyTimes = [(turned(left), vec![1.0])].into();
    ask(&mut desk, TimelineRequest::Select(keys.clone()));
    let before = clip(&desk).clone();
    act(&mut desk, TimelineAction::Bake);
    assert_eq!((times(&desk, left).len(), times(&desk, right).len()), (61, 4), "the track of the selected key");
    let at = |clip: &RigClip, time: f32| Quat::from_array(clip.value(&turned(left), time).unwrap());
    for frame in 0..=60u8 {
        let time = f32::from(frame) / 30.0;
        assert!(at(&before, time).angle_between(at(clip(&desk), time)) < 2e-3, "frame {frame}");
    }
    ask(&mut desk, TimelineRequest::Select(keys));
    act(&mut desk, TimelineAction::Reduce);
    assert!(times(&desk, left).len() <= 4, "{:?}", times(&desk, left));
    for frame in 0..=60u8 {
        let time = f32::from(frame) / 30.0;
        assert!(at(&before, time).angle_between(at(clip(&desk), time)) < 2e-3, "frame {frame}");
    }
    act(&mut desk, TimelineAction::BakeClip);
    assert_eq!((times(&desk, left).len(), times(&desk, right).len()), (61, 61));
    act(&mut desk, TimelineAction::ReduceClip);
    assert!(times(&desk, left).len() <= 4 && times(&desk, right).len() <= 4);
    act(&mut desk, TimelineAction::NewClip);
    assert_eq!(reason(&desk, TimelineAction::BakeClip), Some("the clip has no keys"));
    assert_eq!(reason(&desk, TimelineAction::ReduceClip), Some("the clip has no keys"));
}

/// Keys go by what they move in sizes of the rig: four hundredths of a millimetre are nothing on one in centimetres.
#[test]
fn keys_are_reduced_by_the_size_of_the_rig() {
    for (unit, left) in [(1.0_f32, 3), (100.0, 1)] {
        let (mut desk, joints) = opened();
        let to = joints.iter().zip(0_u8..).map(|(joint, number)| (*joint, Vec3::Y * f32::from(number) * unit));
        desk.edit(Operation::Move { to: to.collect(), with_children: false });
        let moved = TrackTarget { node: joints[1], property: Property::Translation };
        let list = [(0.0, 0.0), (1.0, 0.004), (2.0, 0.0)].map(|(time, by): (f32, f32)| Key::vector(time, Vec3::Y * by));
        let change = KeyOperation::Set(vec![(moved.clone(), list.to_vec())]);
        desk.edit(Operation::Clips(ClipOperation::Keys { clip: CLIP, layer: BASE, change }));
        let count = |desk: &Desk| clip(desk).layers[0].tracks[&moved].keys.len();
        assert_eq!(count(&desk), 3);
        act(&mut desk, TimelineAction::ReduceClip);
        assert_eq!(count(&desk), left, "a unit of {unit}");
    }
}

/// The menu has what a reduction may change, which reductions of tracks follow as well.
#[test]
fn keys_are_reduced_within_the_tolerance_that_is_chosen() {
    let (mut desk, [hips, ..]) = opened();
    desk.resize(900.0, 640.0);
    let [moved, turn] =
        [Property::Translation, Property::Rotation].map(|property| TrackTarget { node: hips, property });
    let times = [0.0_f32, 1.0, 2.0];
    // The middle key moves by 4 mm and turns by half a degree, on a rig that is larger than a human.
    let middle = |time: f32| if time == 1.0 { 1.0 } else { 0.0 };
    let places = times.map(|time| Key::vector(time, Vec3::Y * (0.004 * middle(time)))).to_vec();
    let turns = times.map(|time| Key::rotation(time, Quat::from_rotation_x(0.5_f32.to_radians() * middle(time))));
    let change = KeyOperation::Set(vec![(moved.clone(), places), (turn.clone(), turns.to_vec())]);
    desk.edit(Operation::Clips(ClipOperation::Keys { clip: CLIP, layer: BASE, change }));
    let counts = |desk: &Desk| [&moved, &turn].map(|target| clip(desk).layers[0].tracks[target].keys.len());
    let (before, steps) = (bytes(&desk), desk.steps());
    assert_eq!((timeline(&desk).tolerance.millimetres, timeline(&desk).tolerance.degrees), (0.05, 0.01));
    act(&mut desk, TimelineAction::ReduceClip);
    assert_eq!(counts(&desk), [3, 3]);
    undo(&mut desk);
    for (field, text, left) in [("Tolerance in millimetres", "5", [1, 3]), ("Tolerance in degrees", "1", [1, 1])] {
        desk.click("Menu of the clip");
        desk.frames(2);
        desk.click(field);
        desk.type_text(text);
        desk.key(KeyboardKey::Enter);
        desk.frames(3);
        assert_eq!((bytes(&desk), desk.steps().1), (before.clone(), steps.1), "a choice is no step");
        desk.click("Reduce keys of the whole clip");
        desk.frames(3);
        assert_eq!(counts(&desk), left, "{field}");
        assert!(desk.look(field).is_none(), "the menu is closed");
        undo(&mut desk);
    }
    let keys: KeyTimes = [(moved.clone(), vec![1.0]), (turn.clone(), vec![1.0])].into();
    ask(&mut desk, TimelineRequest::Select(keys));
    desk.secondary_click_at(at(&desk, "hips", 1.5));
    assert!(desk.look("Tolerance in degrees").is_some(), "{:?}", desk.seen);
    desk.click("Reduce keys of tracks");
    desk.frames(3);
    assert_eq!(counts(&desk), [1, 1]);
}

#[test]
fn clips_are_retimed_with_their_keys() {
    let (mut desk, [_, left, _]) = opened();
    act(&mut desk, TimelineAction::Longer);
    assert_eq!((clip(&desk).range, times(&desk, left)), ([0.0, 4.0], vec![0.0, 1.02, 2.0, 4.0]));
    act(&mut desk, TimelineAction::Shorter);
    assert_eq!((clip(&desk).range, times(&desk, left)), ([0.0, 2.0], vec![0.0, 0.51, 1.0, 2.0]));
    // Typed numbers stretch the keys while that is on.
    let before = bytes(&desk);
    act(&mut desk, TimelineAction::Stretch);
    assert_eq!(bytes(&desk), before);
    let typed = |desk: &mut Desk, field: &str, text: &str| {
        let steps = desk.steps().1;
        desk.click(field);
        desk.type_text(text);
        desk.key(KeyboardKey::Enter);
        desk.frames(3);
        assert_eq!(desk.steps().1, steps + 1, "{field}");
    };
    let near = |desk: &Desk, wanted: [f32; 4]| {
        let times = times(desk, left);
        assert!(times.len() == 4 && times.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-5), "{times:?}");
    };
    typed(&mut desk, "End frame", "90");
    assert_eq!(clip(&desk).range, [0.0, 3.0]);
    near(&desk, [0.0, 0.765, 1.5, 3.0]);
    typed(&mut desk, "Frames a second", "15");
    assert_eq!((clip(&desk).range, clip(&desk).frame_rate), ([0.0, 6.0], 15.0));
    near(&desk, [0.0, 1.53, 3.0, 6.0]);
    undo(&mut desk);
    undo(&mut desk);
    assert_eq!(bytes(&desk), before);
    act(&mut desk, TimelineAction::Stretch);
    typed(&mut desk, "End frame", "90");
    near(&desk, [0.0, 0.51, 1.0, 2.0]);
    undo(&mut desk);
    ask(&mut desk, TimelineRequest::Open(None));
    for action in [TimelineAction::Longer, TimelineAction::Shorter, TimelineAction::SwitchSpace] {
        let said = obstacle(desk.app.world(), Action::Timeline(action));
        assert!(said.is_some_and(|said| said.starts_with("no clip is open")), "{action:?}");
    }
}

#[test]
fn layers_have_masks() {
    let (mut desk, [_, left, right]) = opened();
    act(&mut desk, TimelineAction::NewLayer);
    desk.click("Layers");
    desk.frames(2);
    desk.select(&[]);
    assert!(!desk.find("Mask of Layer 2: all").enabled, "nothing is selected");
    desk.select(&[left, right]);
    let mask = |desk: &Desk| clip(desk).layers[1].mask.clone();
    let steps = desk.steps().1;
    desk.click("Mask of Layer 2: all");
    desk.frames(3);
    assert_eq!((mask(&desk), desk.steps().1), (vec![left, right], steps + 1));
    // The button says which nodes these are.
    desk.click("Mask of Layer 2: arm_l, arm_r");
    desk.frames(3);
    assert_eq!((mask(&desk), desk.steps().1), (vec![], steps + 2));
    // The menu says the same.
    desk.select(&[right]);
    desk.secondary_click("Layer 2");
    desk.click("Mask: only the selected nodes");
    desk.frames(3);
    assert_eq!(mask(&desk), [right]);
    desk.secondary_click("Layer 2");
    desk.click("Mask: all nodes");
    desk.frames(3);
    assert_eq!((mask(&desk), desk.steps().1), (vec![], steps + 4));
    undo(&mut desk);
    assert_eq!(mask(&desk), [right]);
}

/// The bundled biped, built, with a clip that moves its left hand.
fn biped() -> (Desk, impl Fn(&Desk, &str) -> Uid) {
    let (mut desk, _) = desk_with(TimelinePanel::default());
    let entity = desk.rig;
    desk.app.world_mut().entity_mut(entity).insert(crate::bench::shipped("biped"));
    desk.frames(3);
    desk.app.world_mut().write_message(BuildRequest { rig: entity, step: BuildStep::All });
    desk.frames(3);
    let named = |desk: &Desk, name: &str| {
        let built = &desk.app.world().get::<BuildResult>(desk.rig).unwrap().0;
        let is = |node: &&rigsmith::rig::BuiltNode| node.kind == NodeType::Control && *node.name == *name;
        built.nodes.iter().find(is).unwrap().uid
    };
    let hand = named(&desk, "hand_ik_l");
    let mut clip = RigClip { range: [0.0, 2.0], ..RigClip::new(CLIP, BASE, "reach") };
    let target = TrackTarget { node: hand, property: Property::Translation };
    let way = [(0.0, Vec3::ZERO), (0.8, Vec3::new(-0.05, -0.1, 0.1)), (2.0, Vec3::new(0.0, -0.05, 0.15))];
    let keys = way.map(|(time, place)| Key::vector(time, place)).to_vec();
    clip.layers[0].tracks.insert(target, Arc::new(Track { keys }));
    desk.edit(Operation::Edits(vec![RigEdit::AddClip(Box::new(clip), 0)]));
    ask(&mut desk, TimelineRequest::Open(Some(CLIP)));
    (desk, named)
}

/// A right click on the row of a control offers what its menu in the viewport does, over the selected keys.
#[test]
fn the_row_of_a_control_has_its_switches_over_the_selected_keys() {
    let (mut desk, named) = biped();
    desk.resize(900.0, 700.0);
    let hand = named(&desk, "hand_ik_l");
    let built = Arc::clone(&desk.app.world().get::<BuildResult>(desk.rig).unwrap().0);
    let is_of_hand = |matching: &Matching| matches!(matching, Matching::Space { control } if *control == hand);
    let spaces = built.switches.iter().find(|switch| is_of_hand(&switch.matching)).expect("spaces");
    let attributes = &built.node(spaces.control).unwrap().attributes;
    let attribute = attributes.iter().find(|known| known.name == spaces.attribute).expect("the attribute");
    let AttributeKind::Choice(names) = &attribute.kind else { panic!("{attribute:?}") };

    let target = TrackTarget { node: hand, property: Property::Translation };
    ask(&mut desk, TimelineRequest::Select([(target, vec![0.8, 2.0])].into()));
    desk.select(&[]);
    desk.secondary_click("hand_ik_l");
    assert_eq!(desk.selected(), [hand], "a right click selects");
    let over = |desk: &Desk, value: &str| {
        let wanted = format!("{value}, frames 24 to 60").to_lowercase();
        let found = desk.seen.iter().find(|seen| seen.label.to_lowercase() == wanted);
        found.unwrap_or_else(|| panic!("no {wanted} in {:?}", desk.seen)).label.clone()
    };
    let entries = ["FK", names[1].as_str()].map(|value| over(&desk, value));
    desk.key(KeyboardKey::Escape);
    desk.frames(2);
    let throw = |desk: &mut Desk, entry: &str| {
        desk.secondary_click("hand_ik_l");
        desk.click(entry);
        desk.frames(4);
        assert!(desk.look("Select its keys").is_none(), "the menu is closed");
    };
    for entry in &entries {
        let told = desk.told().len();
        assert!(desk.is_one_step(entry, bytes, |desk| throw(desk, entry)), "{entry}: {:?}", desk.told());
        let said = desk.told()[told..].join("\n");
        assert!(said.contains("all joints move as before"), "{entry}: {said}");
    }
    throw(&mut desk, &entries[0]);
    let settings = named(&desk, "arm_settings_l");
    let switch = TrackTarget { node: settings, property: Property::Attribute("ik_fk".into()) };
    let at = |desk: &Desk, time: f32| clip(desk).value(&switch, time).map(|value| value[0]);
    assert_eq!((at(&desk, 0.5), at(&desk, 0.9), at(&desk, 2.0)), (Some(1.0), Some(0.0), Some(0.0)));
    desk.secondary_click("hand_ik_l");
    desk.click("Select its keys");
    desk.frames(3);
    let keys: usize =
        clip(&desk).layers[0].tracks.iter().filter(|(key, _)| key.node == hand).map(|(_, t)| t.keys.len()).sum();
    assert!(keys > 2 && selected(&desk) == keys, "{} of {keys}", selected(&desk));
}

#[test]
fn switches_over_a_range_are_one_step_each() {
    let (mut desk, named) = biped();
    let reason = |desk: &Desk, action: TimelineAction| obstacle(desk.app.world(), Action::Timeline(action));
    let both = [TimelineAction::SwitchKinematics, TimelineAction::SwitchSpace];
    desk.select(&[]);
    for action in both {
        assert_eq!(reason(&desk, action), Some("nothing is selected"));
    }
    let finger = desk.rig().find_label("index_02_l").unwrap();
    desk.select(&[finger]);
    assert_eq!(reason(&desk, both[0]), Some("no control of a limb with IK and FK is selected"));
    assert_eq!(reason(&desk, both[1]), Some("no control that has spaces is selected"));
    let hand = named(&desk, "hand_ik_l");
    for action in both {
        desk.select(&[hand]);
        assert_eq!(reason(&desk, action), None, "{action:?}");
        let told = desk.told().len();
        assert!(
            desk.is_one_step(&format!("{action:?}"), bytes, |desk| act(desk, action)),
            "{action:?}: {:?}",
            desk.told()
        );
        let said = desk.told()[told..].join("\n");
        assert!(said.contains("all joints move as before"), "{action:?}: {said}");
    }

    // The selected keys are the range.
    let target = TrackTarget { node: hand, property: Property::Translation };
    ask(&mut desk, TimelineRequest::Select([(target, vec![0.8, 2.0])].into()));
    desk.select(&[hand]);
    act(&mut desk, TimelineAction::SwitchKinematics);
    let settings = named(&desk, "arm_settings_l");
    let switch = TrackTarget { node: settings, property: Property::Attribute("ik_fk".into()) };
    let at = |desk: &Desk, time: f32| clip(desk).value(&switch, time).map(|value| value[0]);
    assert_eq!((at(&desk, 0.5), at(&desk, 0.9), at(&desk, 2.0)), (Some(1.0), Some(0.0), Some(0.0)));
}
