//! The Process panel: its head leaves the list room.

use super::*;

#[test]
fn a_low_panel_shows_commands_below_two_lines() {
    let mut desk = Desk::new(ProcessPanel::default());
    let joints = desk.chain(&["a", "b", "c", "d"]);
    let kind = TagKind::Command { module: "null".into(), params: "()".into(), feature: None };
    for _ in 0..3 {
        let add = TagOperation::Add { joints: joints.clone(), kind: kind.clone(), index: None };
        desk.edit(Operation::Tags(add));
    }
    desk.app.world_mut().write_message(BuildRequest { rig: desk.rig, step: BuildStep::All });
    desk.frames(3);
    // Sizes of the panel below the viewport in a window of 1280x720, and of one beside it.
    for (width, height, least) in [(777.0, 148.0, 4), (252.0, 440.0, 12)] {
        desk.resize(width, height);
        let whole = desk.seen.iter().filter(|seen| seen.label.contains(" null ") && seen.rect.bottom() <= height);
        assert!(whole.count() >= least, "{width} x {height}: {:?}", desk.seen);
        for name in ["Roll all back", "Live", "Follow", "Selection only", "Filter commands"] {
            let rect = desk.find(name).rect;
            assert!(rect.left() >= 0.0 && rect.right() <= width, "{name} at {rect:?} of {width}");
        }
        assert!(desk.says("12 of 12"), "{:?}", desk.seen);
    }
}
