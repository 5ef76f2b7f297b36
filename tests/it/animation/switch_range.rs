//! Switches over a range of a clip: every deform joint stands where it stood at every frame, and undo gives the first bytes.

use bevy::prelude::Messages;
use rigsmith::{
    headless::Workbench,
    mesh::model::Trs,
    plugins::{
        commands::BuildStep,
        controls::{SwitchOverRequest, SwitchedOver},
        document::{Change, EditRefusal, EditRequest},
        history::RigHistory,
    },
    rig::{Matching, SwitchData, animation::Splice, format::animation::write_animation, template::write_template},
    solve::{bake_clip::strike, program::RigState},
};

use super::*;

const RANGE: [f32; 2] = [0.4, 1.6];

fn named(built: &BuiltRig, name: &str) -> Uid {
    let mut found = built.nodes.iter().filter(|node| node.kind == NodeType::Control && *node.name == *name);
    found.next().unwrap_or_else(|| panic!("no control {name}")).uid
}

/// A hand that reaches about while the trunk turns, with keys between frames, a cubic track, and a layer on top that moves the
/// hand, the forward arm and the trunk.
fn reach(built: &BuiltRig) -> RigClip {
    let mut clip = RigClip { range: [0.0, 2.0], ..RigClip::new(CLIP, BASE, "reach") };
    let top = ClipLayer { name: "breath".into(), mode: LayerMode::Additive, weight: 0.5, ..ClipLayer::empty(TOP) };
    clip.layers.push(top);
    let [hand, arm, torso] = ["hand_ik_l", "arm_fk_l", "torso"].map(|name| named(built, name));
    let mut set = |layer: usize, node: Uid, property: Property, keys: Vec<Key>| {
        clip.layers[layer].tracks.insert(target(node, property), Arc::new(Track { keys }));
    };
    let cubic = |time: f32, value: [f32; 3], slope: f32| Key {
        ease: Ease::Cubic { arrive: [slope, 0.1, -slope, 0.0], leave: [slope, 0.1, -slope, 0.0] },
        ..Key::vector(time, Vec3::from_array(value))
    };
    let way = vec![
        cubic(0.0, [0.0, 0.0, 0.0], 0.0),
        cubic(0.53, [-0.08, -0.1, 0.12], 0.1),
        cubic(1.21, [-0.02, 0.05, 0.2], -0.1),
        cubic(2.0, [-0.1, -0.05, 0.05], 0.0),
    ];
    set(0, hand, Property::Translation, way);
    let turn = |time: f32, x: f32, y: f32| Key::rotation(time, Quat::from_euler(EulerRot::XYZ, x, y, 0.1 * time));
    set(0, hand, Property::Rotation, vec![turn(0.0, 0.0, 0.0), turn(0.9, 0.4, -0.3), turn(2.0, -0.2, 0.3)]);
    set(0, torso, Property::Rotation, vec![turn(0.0, 0.0, 0.0), turn(1.0, 0.1, 0.4), turn(2.0, 0.0, -0.3)]);
    set(1, hand, Property::Rotation, vec![turn(0.1, 0.1, 0.0), turn(1.7, -0.1, 0.1)]);
    set(1, arm, Property::Rotation, vec![turn(0.1, 0.0, 0.1), turn(1.7, 0.1, 0.0)]);
    set(1, torso, Property::Rotation, vec![turn(0.0, 0.05, 0.0), turn(2.0, -0.05, 0.0)]);
    clip
}

fn bench() -> Workbench {
    let mut rig = biped();
    let clip = reach(&built(&rig));
    apply(&mut rig, RigEdit::AddClip(Box::new(clip), 0));
    bench_of(rig)
}

fn bench_of(rig: Rig) -> Workbench {
    let mut bench = Workbench::with_rig(1, rig);
    assert!(bench.build(BuildStep::All).error.is_none());
    bench
}

fn clip(bench: &Workbench) -> RigClip {
    bench.rig().clip(CLIP).unwrap().clone()
}

/// Everything that is saved of the rig, as text.
fn bytes(bench: &Workbench) -> String {
    let rig = bench.rig();
    format!("{}{}{:?}", write_template(rig), write_animation(rig, None, rig.clips()), rig.pose())
}

fn steps(bench: &mut Workbench) -> usize {
    let rig = bench.rig_entity();
    bench.app_mut().world().get::<RigHistory>(rig).unwrap().steps().1
}

fn undo(bench: &mut Workbench) {
    let rig = bench.rig_entity();
    bench.app_mut().world_mut().write_message(EditRequest { rig, change: Change::Undo });
    bench.app_mut().update();
}

fn ask(bench: &mut Workbench, switch: &SwitchData, value: f32, range: [f32; 2]) {
    let (rig, control, attribute) = (bench.rig_entity(), switch.control, switch.attribute.to_string());
    let request = SwitchOverRequest { rig, control, attribute, value, clip: CLIP, layer: Some(BASE), range };
    bench.app_mut().world_mut().resource_mut::<Messages<EditRefusal>>().clear();
    bench.app_mut().world_mut().resource_mut::<Messages<SwitchedOver>>().clear();
    bench.app_mut().world_mut().write_message(request);
    bench.app_mut().update();
}

fn refusals(bench: &mut Workbench) -> Vec<String> {
    let mut messages = bench.app_mut().world_mut().resource_mut::<Messages<EditRefusal>>();
    messages.drain().map(|refused| refused.reason.to_string()).collect()
}

/// Bounds of what is not told, in units of the rig and degrees.
const HELD: [f32; 2] = [1e-4, 0.05];

/// Deform joints of a clip, frame by frame.
fn joints(bench: &Workbench, clip: &RigClip) -> Vec<Vec<(String, Trs)>> {
    let program = bench.runtime().unwrap().state().program().clone();
    let mut state = RigState::new(program.clone());
    let at = |frame: u32| {
        strike(&mut state, &clip.sample((f64::from(frame) / 30.0) as f32));
        let nodes = program.nodes().iter().enumerate().filter(|(_, node)| node.kind == NodeType::Joint);
        let name = |node: &rigsmith::solve::program::ProgramNode| node.label.as_deref().unwrap_or("?").to_owned();
        nodes.map(|(slot, node)| (name(node), *state.global_at(slot))).collect()
    };
    (0..=60).map(at).collect()
}

#[track_caller]
fn stand(bench: &Workbench, before: &RigClip, after: &RigClip, [most, turn_most]: [f32; 2], what: &str) {
    let (was, is) = (joints(bench, before), joints(bench, after));
    let hand = |frame: usize| was[frame].iter().find(|(name, _)| name == "hand_l").unwrap().1.translation;
    let way = (0..=60).map(|frame| hand(frame).distance(hand(0))).fold(0.0, f32::max);
    assert!(way > 0.08, "{what}: the hand moves by {way} alone");
    for (frame, (was, is)) in was.iter().zip(&is).enumerate() {
        for ((name, was), (_, is)) in was.iter().zip(is) {
            let off = was.translation.distance(is.translation);
            let turn = was.rotation.conjugate() * is.rotation;
            let angle = 2.0 * turn.xyz().length().atan2(turn.w.abs()).to_degrees();
            assert!(off <= most && angle <= turn_most, "{what}: {name} is off by {off} and {angle}° in frame {frame}");
        }
    }
}

/// Throws a switch over a range, compares, and undoes and redoes it. Returns the clip before and after.
#[track_caller]
fn check(bench: &mut Workbench, switch: &SwitchData, value: f32, range: [f32; 2], what: &str) -> [RigClip; 2] {
    let (before, saved, done) = (clip(bench), bytes(bench), steps(bench));
    ask(bench, switch, value, range);
    assert_eq!(refusals(bench), Vec::<String>::new(), "{what}");
    let told: Vec<SwitchedOver> =
        bench.app_mut().world_mut().resource_mut::<Messages<SwitchedOver>>().drain().collect();
    assert_eq!(told.len(), 1, "{what}");
    assert!(told[0].notes.is_empty(), "{what}: {:?} could not be held", told[0].notes);
    let frames = ((range[1] - range[0]) * 30.0).round() as usize + 1;
    assert!(told[0].frames >= frames, "{what}: {} frames", told[0].frames);
    let after = clip(bench);
    let changed = |(layer, old): (&ClipLayer, &ClipLayer)| {
        layer.tracks.iter().filter(|(target, track)| old.tracks.get(*target) != Some(*track)).count()
    };
    let tracks: usize = after.layers.iter().zip(&before.layers).map(changed).sum();
    assert!(tracks >= 2 && told[0].keys < tracks * frames, "{what}: {} keys of {tracks} tracks", told[0].keys);
    assert_eq!(steps(bench), done + 1, "{what}: one step");
    stand(bench, &before, &after, HELD, what);

    let attribute = target(switch.control, Property::Attribute(switch.attribute.to_string()));
    let state = bench.runtime().unwrap().state();
    let own = state.program().attribute(switch.control, &switch.attribute).unwrap();
    let own = state.program().attributes()[own].default;
    let at = |clip: &RigClip, time: f32| clip.value(&attribute, time).map_or(own, |value| value[0]);
    for frame in 0..=60u8 {
        let time = f32::from(frame) / 30.0;
        let is_in = time > range[0] - 1e-3 && (time < range[1] - 1e-3 || range[1] >= 2.0);
        let wanted = if is_in { value } else { at(&before, time) };
        assert_eq!(at(&after, time), wanted, "{what}: the switch in frame {frame}");
    }

    undo(bench);
    assert_eq!((bytes(bench), steps(bench)), (saved, done), "{what}: undone");
    let rig = bench.rig_entity();
    bench.app_mut().world_mut().write_message(EditRequest { rig, change: Change::Redo });
    bench.app_mut().update();
    assert_eq!(clip(bench), after, "{what}: redone");
    [before, after]
}

fn kinematics(built: &BuiltRig) -> SwitchData {
    let arm = named(built, "arm_fk_l");
    let is_arm = |switch: &SwitchData| matches!(&switch.matching, Matching::IkFk { fk, .. } if fk.contains(&arm));
    built.switches.iter().find(|switch| is_arm(switch)).map(|switch| (**switch).clone()).unwrap()
}

#[test]
fn an_arm_goes_to_forward_kinematics_and_back() {
    let mut bench = bench();
    let switch = kinematics(bench.built().unwrap());
    let [before, after] = check(&mut bench, &switch, 0.0, RANGE, "forward");
    // Controls of the forward arm have keys in the range, and the keys of the hand are those of before.
    let built = built(bench.rig());
    let hand = target(named(&built, "hand_ik_l"), Property::Translation);
    assert_eq!(before.layers[0].tracks[&hand], after.layers[0].tracks[&hand]);
    let forearm = target(named(&built, "arm_fk_l_2"), Property::Rotation);
    let keys = &after.layers[0].tracks[&forearm].keys;
    assert!(keys.iter().filter(|key| (0.4..1.6).contains(&key.time)).count() > 2, "{keys:?}");
    // What a layer on top animates gets its keys there.
    let arm = target(named(&built, "arm_fk_l"), Property::Rotation);
    assert!(after.layers[1].tracks[&arm].keys.len() > 4 && !after.layers[0].tracks.contains_key(&arm));

    check(&mut bench, &switch, 1.0, [0.8, 1.2], "and inverse again");
    ask(&mut bench, &switch, 1.0, [0.85, 1.1]);
    let said = refusals(&mut bench);
    assert!(said.len() == 1 && said[0].contains("has that value in the whole range already"), "{said:?}");
}

#[test]
fn a_whole_clip_goes_to_forward_kinematics_and_back() {
    let mut bench = bench();
    let switch = kinematics(bench.built().unwrap());
    check(&mut bench, &switch, 0.0, [0.0, 2.0], "forward");
    check(&mut bench, &switch, 1.0, [0.0, 2.0], "inverse");
}

#[test]
fn a_hand_changes_its_space_over_a_range() {
    let mut bench = bench();
    let built = bench.built().unwrap();
    let hand = named(built, "hand_ik_l");
    let is_hand = |switch: &SwitchData| matches!(switch.matching, Matching::Space { control } if control == hand);
    let switch = built.switches.iter().find(|switch| is_hand(switch)).map(|switch| (**switch).clone()).unwrap();
    for value in [1.0, 3.0] {
        check(&mut bench, &switch, value, RANGE, &format!("space {value}"));
        undo(&mut bench);
    }
    check(&mut bench, &switch, 2.0, [0.5, 2.0], "space to the end");
}

#[test]
fn what_cannot_be_switched_over_a_range_is_told() {
    let mut bench = bench();
    let switch = kinematics(bench.built().unwrap());
    let saved = bytes(&bench);
    let refused = |bench: &mut Workbench, switch: &SwitchData, range: [f32; 2], wanted: &str| {
        ask(bench, switch, 0.0, range);
        let said = refusals(bench);
        assert!(said.len() == 1 && said[0].contains(wanted), "{said:?}");
    };
    refused(&mut bench, &switch, [1.0, 0.5], "has no frames");
    refused(&mut bench, &switch, [0.0, f32::NAN], "has no frames");
    refused(&mut bench, &switch, [0.0, 1e6], "no more than");
    refused(&mut bench, &SwitchData { attribute: "nothing".into(), ..switch.clone() }, RANGE, "no switch");
    assert_eq!(bytes(&bench), saved);

    // Layers that concern the hand alone can have no keys of the other controls.
    let mut rig = bench.rig().clone();
    let hand = named(bench.built().unwrap(), "hand_ik_l");
    for layer in clip(&bench).layers {
        let about = rigsmith::rig::animation::LayerAbout { mask: vec![hand], ..layer.about() };
        apply(&mut rig, RigEdit::SetLayer { clip: CLIP, layer: layer.uid, about: Box::new(about) });
    }
    refused(&mut bench_of(rig), &switch, RANGE, "has no layer for keys");
}

/// Curves beside the span are what they were, whatever their keys are.
#[test]
fn curves_beside_a_span_stay() {
    let mut random = Random(7);
    for round in 0..60 {
        let property = [Property::Translation, Property::Rotation, Property::Attribute("a".into())][round % 3].clone();
        let value = |random: &mut Random| match property {
            Property::Rotation => turn(random, 0.5).to_array(),
            Property::Attribute(_) => [share(random), 0.0, 0.0, 0.0],
            _ => [share(random), share(random), share(random), 0.0],
        };
        let slope = |random: &mut Random| {
            let mut slope = [share(random), share(random), share(random), share(random)];
            slope[property.width()..].fill(0.0);
            slope
        };
        let count = 1 + random.below(6);
        let keys = (0..count).map(|number| {
            let ease = match random.below(3) {
                0 => Ease::Stepped,
                1 => Ease::Linear,
                _ => Ease::Cubic { arrive: slope(&mut random), leave: slope(&mut random) },
            };
            Key { time: number as f32 * 0.4, value: value(&mut random), ease }
        });
        let former = Track { keys: keys.collect() };
        let splice = Splice { span: [0.63, 1.37], gap: 1e-4, keeps_before: true, keeps_behind: true };
        let inside = [0.63, 1.0, 1.37].map(|time| Key { time, value: value(&mut random), ease: Ease::Linear });
        let after = Track { keys: splice.spliced(&former.keys, &property, &inside) };
        assert!(after.keys.windows(2).all(|pair| pair[0].time < pair[1].time), "{:?}", after.keys);
        let near = |time: f32, wanted: &Track, most: f32| {
            let (a, b) = (after.sample(&property, time).unwrap(), wanted.sample(&property, time).unwrap());
            let off = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(off <= most, "{round}: {property:?} is off by {off} at {time}: {former:?}");
        };
        // A normalised cubic is cut into two that are nearly the same.
        let most = if property == Property::Rotation { 2e-2 } else { 2e-5 };
        for step in 0..=100u8 {
            let time = f32::from(step) * 0.022;
            if !(0.6298..1.37).contains(&time) {
                near(time, &former, most);
            } else if (0.63..1.3698).contains(&time) {
                near(time, &Track { keys: inside.to_vec() }, 2e-5);
            }
        }
    }
}

#[test]
fn a_clip_of_another_frame_rate_keeps_its_frames() {
    let mut rig = biped();
    let node = rig.roots()[0];
    apply(&mut rig, RigEdit::AddClip(Box::new(clip_on(&[node], &mut Random(5))), 0));
    let before = rig.clips()[0].clone();
    let mut uids = UidSource::seeded(4);
    let set = Operation::Clips(ClipOperation::SetRate { clip: CLIP, rate: 60.0 });
    set.run(&mut rig, &mut uids, None).unwrap();
    let after = &rig.clips()[0];
    assert_eq!((after.frame_rate, after.range), (60.0, [0.0, 1.0]));
    let halved: Vec<f32> = before.key_times().iter().map(|time| time * 0.5).collect();
    assert!(after.key_times().iter().zip(&halved).all(|(a, b)| (a - b).abs() < 1e-6), "{:?}", after.key_times());
    let all: Vec<TrackTarget> = before.layers[0].tracks.keys().cloned().collect();
    for target in all {
        for step in 0..=20u8 {
            let time = f32::from(step) * 0.1;
            let (was, is) = (before.value(&target, time).unwrap(), after.value(&target, 0.5 * time).unwrap());
            assert!(was.iter().zip(&is).all(|(a, b)| (a - b).abs() < 1e-4), "{target:?} at {time}");
        }
    }
    let refused = Operation::Clips(ClipOperation::SetRate { clip: CLIP, rate: 0.0 }).run(&mut rig, &mut uids, None);
    assert!(matches!(refused, Err(OperationError::BadNumber(_))));
}
