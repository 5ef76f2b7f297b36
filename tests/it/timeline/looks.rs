//! Looks of the timeline: its bar on one line, the page that turns, and the onion skin.

use rigsmith::editor::onion::{OnionSkin, OnionStep, onion_ghosts, onion_times};

use super::*;

#[test]
fn the_bar_stays_on_one_line() {
    let (mut desk, _) = opened();
    // Widths of the panel below the viewport in windows of 1280 and of 1024 pixels, and in a large one.
    for width in [600.0, 755.0, 1400.0] {
        desk.resize(width, 300.0);
        let fields = [
            "Clip",
            "Menu of the clip",
            "Play or pause the clip",
            "Frame",
            "Start frame",
            "End frame",
            "Frames a second",
        ];
        let rects = fields.map(|name| desk.find(name).rect);
        for (name, rect) in fields.iter().zip(rects) {
            let off = (rect.center().y - rects[2].center().y).abs();
            assert!(off < 4.0 && rect.right() <= width + 0.5, "{name} at {width}: {rect:?}");
        }
    }
    // What a narrow bar leaves out is in its menu.
    desk.resize(600.0, 300.0);
    assert!(desk.look("Add marker").is_none());
    desk.click("Menu of the clip");
    desk.frames(2);
    desk.click("Add marker");
    desk.frames(3);
    assert_eq!(clip(&desk).markers.len(), 1);
}

#[test]
fn the_visible_span_follows_the_playhead() {
    let (mut desk, _) = opened();
    desk.app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(100)));
    let before = bytes(&desk);
    ask(&mut desk, TimelineRequest::Show([0.0, 0.5]));
    act(&mut desk, TimelineAction::Play);
    for _ in 0..15 {
        desk.frame();
        let (time, [start, end]) = (timeline(&desk).time, timeline(&desk).span);
        assert!((start..=end).contains(&time), "{time} is not in {start} to {end}");
        assert!((end - start - 0.5).abs() < 1e-4, "the length stays");
    }
    assert!(timeline(&desk).span[0] > 0.0);
    assert_eq!(bytes(&desk), before);
}

#[test]
fn the_onion_skin_shows_frames_or_keys_beside_the_playhead() {
    let (mut desk, [_, left, _]) = opened();
    ask(&mut desk, TimelineRequest::Scrub(0.5));
    let (before, steps) = (bytes(&desk), desk.steps());
    assert!(onion_ghosts(desk.app.world()).is_empty(), "off at first");
    desk.app.world_mut().write_message(ActionRequest(Action::OnionSkin));
    desk.frames(2);
    let ghosts = onion_ghosts(desk.app.world());
    let places: Vec<i32> = ghosts.iter().map(|ghost| ghost.place).collect();
    assert_eq!(places, [-2, -1, 1, 2]);
    assert!((ghosts[3].time - (0.5 + 10.0 / 30.0)).abs() < 1e-4, "{}", ghosts[3].time);
    // Each is the skeleton of the clip at its moment.
    let end = desk.rig().position(left).y;
    for ghost in &ghosts {
        let bone = ghost.bones.iter().map(|ends| ends[1]).rfind(|at| at.y > end).expect("a bone above");
        let arm = bone - Vec3::Y * end;
        let turn = arm.angle_between(Vec3::Y);
        assert!(
            (arm.length() - 1.0).abs() < 1e-4 && (turn - ghost.time * 0.5).abs() < 2e-3,
            "{turn} at {}",
            ghost.time
        );
    }
    let keys = OnionSkin { on: true, count: 2, step: OnionStep::Keys };
    let times = onion_times(clip(&desk), 0.5, &keys);
    assert_eq!(times, [(-1, 0.0), (1, 0.51), (2, 1.0)]);
    let wide = OnionSkin { on: true, count: 5, step: OnionStep::Frames(10) };
    assert!(onion_times(clip(&desk), 0.0, &wide).iter().all(|(place, _)| *place > 0), "none before the start");
    assert_eq!((bytes(&desk), desk.steps()), (before, steps));
}
