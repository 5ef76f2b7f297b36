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

#[test]
fn the_list_follows_what_ran_last() {
    let mut desk = Desk::new(ProcessPanel::default());
    let labels: Vec<String> = (0..40).map(|number| format!("j{number:02}")).collect();
    let joints = desk.chain(&labels.iter().map(String::as_str).collect::<Vec<_>>());
    let tags: Vec<Uid> =
        joints.iter().map(|joint| super::tag_values::add_command(&mut desk, *joint, "control", "()")).collect();
    let build = |desk: &mut Desk, step: BuildStep| {
        desk.app.world_mut().write_message(BuildRequest { rig: desk.rig, step });
        desk.frames(4);
    };
    build(&mut desk, BuildStep::All);
    build(&mut desk, BuildStep::Follow(true));
    desk.resize(777.0, 148.0);
    // Rows that are scrolled out of sight are not drawn.
    let sees = |desk: &Desk, row: &str| desk.seen.iter().any(|seen| seen.label.starts_with(&format!("{row} control")));
    let set_size = |desk: &mut Desk, tag: Uid, size: f32| {
        let params = vec![(tag, format!("(size: {size})"))];
        desk.edit(Operation::Tags(TagOperation::Params(params)));
        desk.frames(4);
    };
    assert!(sees(&desk, "j00") && !sees(&desk, "j39"), "{:?}", desk.seen);
    set_size(&mut desk, tags[30], 2.0);
    assert!(sees(&desk, "j00") && !sees(&desk, "j30"), "nothing moves until it is asked for");

    desk.click("Follow");
    desk.frames(3);
    assert!(sees(&desk, "j39"), "the last one in effect: {:?}", desk.seen);
    for number in [5, 30, 12] {
        set_size(&mut desk, tags[number], 3.0 + number as f32);
        assert!(sees(&desk, &labels[number]), "{number}: {:?}", desk.seen);
    }
    // Steps lead to the command that they carried out.
    for (step, row) in [(BuildStep::To(3), "j02"), (BuildStep::To(26), "j25"), (BuildStep::Back, "j24")] {
        build(&mut desk, step);
        assert!(sees(&desk, row), "{row}: {:?}", desk.seen);
    }
    desk.click("Follow");
    desk.frames(3);
    build(&mut desk, BuildStep::All);
    assert!(sees(&desk, "j24") && !sees(&desk, "j39"), "{:?}", desk.seen);
}
