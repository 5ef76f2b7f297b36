//! Curves: values over time, with keys and tangents that are dragged.

use bevy::math::EulerRot;
use rigsmith::{
    editor::panels::{
        curves::{CurvesPanel, curve::curves},
        timeline::TimeAxis,
    },
    rig::{animation::ClipLayer, operations::KeyEase},
};

use super::*;

fn moved(node: Uid) -> TrackTarget {
    TrackTarget { node, property: Property::Translation }
}

/// The curves of a translation whose Y rises from 0 to 1 in two seconds, with all of its keys selected.
fn open() -> (Desk, Uid) {
    let (mut desk, [_, left, _]) = desk_with(CurvesPanel::default());
    let line = [0.0, 1.0, 2.0].map(|time: f32| Key::vector(time, Vec3::Y * time * 0.5)).to_vec();
    let set = KeyOperation::Set(vec![(moved(left), line)]);
    desk.edit(Operation::Clips(ClipOperation::Keys { clip: CLIP, layer: BASE, change: set }));
    ask(&mut desk, TimelineRequest::Open(Some(CLIP)));
    ask(&mut desk, TimelineRequest::Select([(moved(left), vec![0.0, 1.0, 2.0])].into()));
    (desk, left)
}

/// Pixel of a time and a value, of values from 0 to 1 with twelve hundredths of room.
fn place(desk: &Desk, time: f32, value: f32) -> Pos2 {
    let (rect, [start, end]) = (desk.find("Curves of the selected tracks").rect, timeline(desk).span);
    let x = rect.left() + (time - start) / (end - start) * rect.width();
    Pos2::new(x, rect.bottom() - (value + 0.12) / 1.24 * rect.height())
}

fn keys(desk: &Desk, node: Uid) -> &[Key] {
    &clip(desk).layers[0].tracks[&moved(node)].keys
}

#[test]
fn a_key_is_dragged_in_value_or_in_time() {
    let (mut desk, left) = open();
    ask(&mut desk, TimelineRequest::Select([(moved(left), vec![1.0])].into()));
    let (before, steps) = (bytes(&desk), desk.steps().1);
    desk.drag(place(&desk, 1.0, 0.5), place(&desk, 1.0, 0.8));
    let key = keys(&desk, left)[1];
    assert!((key.value[1] - 0.8).abs() < 0.01 && key.value[0] == 0.0 && key.time == 1.0, "{key:?}");
    assert_eq!(desk.steps().1, steps + 1);
    undo(&mut desk);
    assert_eq!(bytes(&desk), before);
    desk.drag(place(&desk, 1.0, 0.5), place(&desk, 1.3, 0.5));
    let key = keys(&desk, left)[1];
    assert!((key.time * 30.0 - 39.0).abs() < 1e-3 && key.value[1] == 0.5, "{key:?}");
    undo(&mut desk);
    assert_eq!((bytes(&desk), desk.steps().1), (before, steps));
}

#[test]
fn a_tangent_turns_on_both_sides_or_one() {
    let (mut desk, left) = open();
    let ease = KeyOperation::Ease { keys: [(moved(left), vec![0.0, 1.0, 2.0])].into(), ease: KeyEase::Cubic };
    desk.edit(Operation::Clips(ClipOperation::Keys { clip: CLIP, layer: BASE, change: ease }));
    ask(&mut desk, TimelineRequest::Select([(moved(left), vec![1.0])].into()));
    let slopes = |desk: &Desk| match keys(desk, left)[1].ease {
        Ease::Cubic { arrive, leave } => [arrive[1], leave[1]],
        other => panic!("{other:?}"),
    };
    assert_eq!(slopes(&desk), [0.5, 0.5]);
    let (before, steps) = (bytes(&desk), desk.steps().1);
    // The end of the tangent behind the key, 42 pixels along its slope.
    let (at, ahead) = (place(&desk, 1.0, 0.5), place(&desk, 1.1, 0.55));
    let end = at + (ahead - at).normalized() * 42.0;
    desk.drag(end, egui::pos2(end.x, at.y));
    let level = slopes(&desk);
    assert!(level[0].abs() < 0.05 && level[0] == level[1], "{level:?}");
    assert_eq!(desk.steps().1, steps + 1);
    undo(&mut desk);
    desk.hold(Modifiers::ALT);
    desk.drag(end, egui::pos2(end.x, at.y));
    desk.hold(Modifiers::NONE);
    let broken = slopes(&desk);
    assert!(broken[0] == 0.5 && broken[1].abs() < 0.05, "{broken:?}");
    undo(&mut desk);
    assert_eq!(bytes(&desk), before);
}

/// Keys that delete joints elsewhere delete keys over the curves, too, and a right click has the menu of keys.
#[test]
fn the_curves_have_the_keys_and_the_menu_of_the_timeline() {
    let (mut desk, left) = open();
    desk.move_to(place(&desk, 1.5, 0.9));
    desk.frames(2);
    assert_eq!(timeline(&desk).hovered, Some("Curves"));
    desk.move_to(Pos2::new(2000.0, 2000.0));
    desk.frames(2);
    assert_eq!(timeline(&desk).hovered, None);
    ask(&mut desk, TimelineRequest::Select([(moved(left), vec![0.0])].into()));
    desk.secondary_click_at(place(&desk, 1.0, 0.5));
    let wanted: KeyTimes = [(moved(left), vec![1.0])].into();
    assert_eq!(timeline(&desk).keys, wanted, "a right click selects the key under it");
    let steps = desk.steps().1;
    desk.click("Delete keys");
    desk.frames(3);
    assert_eq!((keys(&desk, left).len(), desk.steps().1), (2, steps + 1));
}

#[test]
fn a_box_selects_the_keys_of_the_curves_in_it() {
    let (mut desk, left) = open();
    let steps = desk.steps();
    let chosen = |desk: &Desk| timeline(desk).keys.get(&moved(left)).cloned().unwrap_or_default();
    // From above on the left and from below on the right; the keys of X and Z lie below both.
    desk.drag(place(&desk, 0.7, 1.05), place(&desk, 2.05, 0.3));
    assert_eq!(chosen(&desk), [1.0, 2.0]);
    desk.drag(place(&desk, 1.4, 0.2), place(&desk, 0.7, 0.7));
    assert_eq!(chosen(&desk), [1.0]);
    desk.hold(Modifiers::SHIFT);
    desk.drag(place(&desk, 0.4, 0.1), place(&desk, -0.05, -0.08));
    assert_eq!(chosen(&desk), [0.0, 1.0], "with Shift more");
    desk.hold(Modifiers::NONE);
    desk.drag(place(&desk, 0.3, 0.6), place(&desk, 0.6, 0.9));
    assert_eq!(chosen(&desk), [0.0, 1.0], "an empty box leaves the curves as they are");
    // Escape drops a box.
    desk.time += 1.0;
    desk.press(place(&desk, 1.4, 0.2));
    desk.move_to(place(&desk, 0.7, 0.7));
    desk.key(KeyboardKey::Escape);
    desk.release(place(&desk, 0.7, 0.7));
    desk.frames(3);
    assert_eq!(chosen(&desk), [0.0, 1.0]);
    assert_eq!(desk.steps(), steps, "a selection is no step");
}

/// Keys that stand too close together to be dragged one by one are in a box all the same.
#[test]
fn a_box_selects_keys_that_stand_close_together() {
    let (mut desk, left) = open();
    let dense: Vec<Key> =
        (0..=200).map(|step| step as f32 * 0.01).map(|time| Key::vector(time, Vec3::Y * time)).collect();
    let wanted = dense.iter().filter(|key| key.time > 0.495 && key.time < 1.005).count();
    let set = KeyOperation::Set(vec![(moved(left), dense)]);
    desk.edit(Operation::Clips(ClipOperation::Keys { clip: CLIP, layer: BASE, change: set }));
    ask(&mut desk, TimelineRequest::Select([(moved(left), vec![0.0])].into()));
    // The curve rises to 2 within the same height, so that the box is as high as the panel.
    let rect = desk.find("Curves of the selected tracks").rect;
    let place = |desk: &Desk, time: f32, y: f32| egui::pos2(place(desk, time, 0.0).x, y);
    desk.drag(place(&desk, 0.495, rect.top() + 4.0), place(&desk, 1.005, rect.bottom() - 4.0));
    assert_eq!(timeline(&desk).keys[&moved(left)].len(), wanted);
}

#[test]
fn tangents_of_turns_are_slopes_of_their_angles() {
    let node = Uid(5);
    // A turn about all axes, as a curve through three keys with the slopes of its quaternion.
    let at = |time: f32| Quat::from_euler(EulerRot::XYZ, 0.4 * time, 0.3 - 0.2 * time, 0.5 * time * time);
    let slope = |time: f32| {
        let (before, after) = (at(time - 1e-3), at(time + 1e-3));
        ((after - before) * 500.0).to_array()
    };
    let key = |time: f32| Key {
        ease: Ease::Cubic { arrive: slope(time), leave: slope(time) },
        ..Key::rotation(time, at(time))
    };
    let mut layer = ClipLayer::empty(BASE);
    layer.tracks.insert(turned(node), Arc::new(Track { keys: [0.0, 1.0, 2.0].map(key).to_vec() }));
    let axis = TimeAxis { span: [0.0, 2.0], x: egui::Rangef::new(0.0, 800.0) };
    let found = curves(&layer, &turned(node), "node", &axis);
    for (curve, wanted) in found.iter().zip([0.4_f32, -0.2, 1.0]) {
        let [arrive, leave] = curve.keys[1].slopes.expect("slopes");
        let wanted = wanted.to_degrees();
        assert!((arrive - wanted).abs() < 0.2 && (leave - wanted).abs() < 0.2, "{}: {arrive} {leave}", curve.name);
        // The drawn curve has that slope at the key.
        let near =
            |time: f32| curve.points.iter().min_by(|a, b| (a.0 - time).abs().total_cmp(&(b.0 - time).abs())).unwrap();
        let (a, b) = (near(0.98), near(1.02));
        assert!(((b.1 - a.1) / (b.0 - a.0) - wanted).abs() < 1.5, "{}", curve.name);
    }
    // Another slope of one angle leaves those of the others.
    let changed = found[1].keys[1].with_slopes(&Property::Rotation, 1, [30.0, 30.0]);
    let keys = vec![key(0.0), changed, key(2.0)];
    layer.tracks.insert(turned(node), Arc::new(Track { keys }));
    let now = curves(&layer, &turned(node), "node", &axis);
    let slopes: Vec<f32> = now.iter().map(|curve| curve.keys[1].slopes.expect("slopes")[0]).collect();
    assert!((slopes[1] - 30.0).abs() < 0.05, "{slopes:?}");
    assert!(
        (slopes[0] - 0.4_f32.to_degrees()).abs() < 0.2 && (slopes[2] - 1.0_f32.to_degrees()).abs() < 0.2,
        "{slopes:?}"
    );
    // With the middle axis at a right angle the outer angles do not follow from the turn.
    let locked = Key { ease: key(1.0).ease, ..Key::rotation(1.0, Quat::from_rotation_y(std::f32::consts::FRAC_PI_2)) };
    layer.tracks.insert(turned(node), Arc::new(Track { keys: vec![key(0.0), locked] }));
    let locked = curves(&layer, &turned(node), "node", &axis);
    assert_eq!(locked[0].keys[1].slopes, None);
}

#[test]
fn the_panel_says_what_to_do_while_there_are_no_curves() {
    let (mut desk, [hips, left, _]) = desk_with(CurvesPanel::default());
    assert!(desk.says("No clip is open: choose or make one in the Timeline."));
    desk.select(&[hips]);
    ask(&mut desk, TimelineRequest::Open(Some(CLIP)));
    assert!(desk.says("Select keys in the Timeline, or a control that has keys, to see its curves."));
    // The curves of a selected node, where no key is selected.
    desk.select(&[left]);
    assert!(desk.look("Curves of the selected tracks").is_some());
}

/// A control is told by its own name, as in the rows of the Timeline, and not by the label that it shares with its joint.
#[test]
fn curves_of_controls_have_the_names_of_controls() {
    let (mut desk, _) = desk_with(CurvesPanel::default());
    let entity = desk.rig;
    desk.app.world_mut().entity_mut(entity).insert(crate::bench::shipped("biped"));
    let build = rigsmith::plugins::commands::BuildStep::All;
    desk.app.world_mut().write_message(rigsmith::plugins::commands::BuildRequest { rig: entity, step: build });
    desk.frames(4);
    act(&mut desk, TimelineAction::NewClip);
    let built = desk.app.world().get::<BuildResult>(entity).unwrap().0.clone();
    let hand = built.nodes.iter().find(|node| &*node.name == "hand_ik_l").unwrap();
    assert_ne!(hand.label.as_deref(), Some("hand_ik_l"));
    desk.app.world_mut().get_mut::<Selection>(entity).unwrap().0 = vec![hand.uid];
    act(&mut desk, TimelineAction::Key);
    desk.frames(2);
    let told = |name: &str| desk.says(&format!("{name} translation X"));
    let seen: Vec<&str> = desk.seen.iter().map(|seen| seen.value.as_str()).collect();
    assert_eq!((told("hand_ik_l"), told("hand_l")), (true, false), "{seen:?}");
}

#[test]
fn turns_are_angles_without_jumps() {
    let node = Uid(5);
    let turn = |time: f32| Key::rotation(time, Quat::from_rotation_y((time * 170.0).to_radians()));
    let mut layer = ClipLayer::empty(BASE);
    let keys: Vec<Key> = (0..=8).map(|number| turn(number as f32 * 0.5)).collect();
    layer.tracks.insert(turned(node), Arc::new(Track { keys }));
    let axis = TimeAxis { span: [0.0, 4.0], x: egui::Rangef::new(0.0, 800.0) };
    let found = curves(&layer, &turned(node), "node", &axis);
    assert_eq!(
        found.iter().map(|curve| curve.name.as_str()).collect::<Vec<_>>(),
        ["node rotation X", "node rotation Y", "node rotation Z"]
    );
    for curve in &found {
        for pair in curve.points.windows(2) {
            assert!((pair[1].1 - pair[0].1).abs() < 5.0, "{}: {pair:?}", curve.name);
        }
    }
    let last = found[1].points.last().unwrap();
    assert!((last.1 - 680.0).abs() < 0.1, "{last:?}");
    // A key with another angle has the rotation of all three.
    let key = found[1].keys[1];
    let other = key.with_value(&Property::Rotation, 1, 30.0);
    let wanted = Quat::from_rotation_y(30f32.to_radians());
    assert!(Quat::from_array(other.value).angle_between(wanted) < 1e-3, "{other:?}");
}
