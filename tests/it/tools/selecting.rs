//! The tool for selections: hovering, clicks, boxes, and actions on what is selected.

use rigsmith::{
    editor::{
        ActiveRig,
        actions::ActionRequest,
        notice::Severity,
        panels::log::{LogBook, LogPlugin},
        tools::ToolsPlugin,
    },
    headless::headless_app,
    test_app::strict_app,
};

use super::*;

#[test]
fn hovering_tells_what_a_click_picks() {
    let (mut bench, joints) = RigBench::with_body(Mode::Select).with_joints();
    let mut met = 0;
    for y in 0..10 {
        for x in 0..10 {
            let at = Vec2::new(x as f32, y as f32) * 80.0 + 40.0;
            bench.hover(at);
            let promised = bench.hovered();
            bench.click(PLAIN, at);
            assert_eq!(bench.selected(), promised.into_iter().collect::<Vec<_>>(), "at {at}");
            met += usize::from(promised.is_some());
        }
    }
    assert!(met > 10 && met < 100, "some over the mesh, some beside: {met}");

    bench.click(PLAIN, bench.pixel(joints[5]));
    bench.click(SHIFT, bench.pixel(joints[0]));
    assert_eq!(bench.selected(), [joints[5], joints[0]]);
    bench.hover(bench.pixel(joints[5]));
    bench.click(CONTROL, bench.pixel(joints[5]));
    assert_eq!(bench.selected(), [joints[0]], "Control takes away");
    bench.click(CONTROL, bench.pixel(joints[5]));
    assert_eq!(bench.selected(), [joints[0], joints[5]], "and adds");
    bench.click(SHIFT, Vec2::splat(5.0));
    assert_eq!(bench.selected().len(), 2, "Shift beside everything loses nothing");
    bench.click(PLAIN, Vec2::splat(5.0));
    assert!(bench.selected().is_empty());

    let shoulder = bench.pixel(joints[3]);
    bench.click(PLAIN, shoulder);
    bench.point(
        PLAIN,
        &[(shoulder, PointerAct::Pressed), (shoulder, PointerAct::Released { dragged: false, count: 2 })],
    );
    let mut below = bench.selected();
    assert_eq!(below.last(), Some(&joints[3]), "it stays the active one");
    below.sort();
    let mut wanted = joints[3..].to_vec();
    wanted.sort();
    assert_eq!(below, wanted);
    bench.point(PLAIN, &[(shoulder, PointerAct::Left)]);
    assert_eq!(bench.hovered(), None);
}

#[test]
fn drags_select_boxes() {
    let (mut bench, joints) = RigBench::with_body(Mode::Select).with_joints();
    let [a, b] = [bench.pixel(joints[3]) + Vec2::new(-5.0, -5.0), bench.pixel(joints[5]) + 5.0];
    bench.point(PLAIN, &[(a, PointerAct::Pressed), (b, PointerAct::Dragged)]);
    assert_eq!(bench.app.world().resource::<SelectTool>().band, Some([a, b]));
    // The drag stays with its tool, whatever becomes of the mode.
    bench.mode(Mode::Place);
    bench.point(PLAIN, &[(b, DROPPED)]);
    assert_eq!(bench.selected(), joints[3..]);
    assert_eq!((bench.rig().len(), bench.app.world().resource::<SelectTool>().band), (joints.len(), None));
    bench.mode(Mode::Select);
    let spine = [bench.pixel(joints[2]) - 5.0, bench.pixel(joints[0]) + 5.0];
    let drag = [(spine[0], PointerAct::Pressed), (spine[1], PointerAct::Dragged), (spine[1], DROPPED)];
    bench.point(SHIFT, &drag);
    assert_eq!(bench.selected().len(), joints.len());
    bench.point(CONTROL, &drag);
    assert_eq!(bench.selected(), joints[3..]);
}

#[test]
fn success_is_told_of_edits_that_are_made_alone() {
    let mut app = headless_app(1);
    app.add_plugins((ToolsPlugin, LogPlugin));
    let mut bench = RigBench::with(strict_app(app), Rig::new(Uid(1), "rig"));
    bench.app.insert_resource(ActiveRig(bench.rig)).insert_resource(ViewportSight(Some(front())));
    let joints = bench.chain(&[[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 2.0, 0.0]]);
    bench.send(PickRequest { rig: bench.rig, what: Pick::Joints(vec![joints[2]]), add: false });
    // When the second request comes, there is nothing left to delete.
    bench.app.world_mut().write_message(ActionRequest(Action::Delete));
    bench.app.world_mut().write_message(ActionRequest(Action::Delete));
    bench.frames(3);
    assert_eq!(bench.rig().len(), 2);
    let book = bench.app.world().resource::<LogBook>();
    let told = |severity: Severity| -> Vec<(&str, u32)> {
        let entries = book.entries().filter(|entry| entry.notice.severity == severity);
        entries.map(|entry| (entry.notice.text.as_str(), entry.times)).collect()
    };
    assert_eq!(told(Severity::Done), [("Deleted 1 joint; what hung below moved up.", 1)]);
    let [(refused, 1)] = told(Severity::Error)[..] else { panic!("{:?}", told(Severity::Error)) };
    assert!(refused.starts_with("There is no joint"), "{refused}");
}

#[test]
fn actions_work_on_the_selection() {
    let (mut bench, joints) = RigBench::with_body(Mode::Select).with_joints();
    bench.notices();
    bench.act(Action::Delete);
    assert!(bench.notices()[0].text.contains("No joint is selected"));
    bench.act(Action::SelectAll);
    assert_eq!(bench.selected().len(), joints.len());
    bench.click(PLAIN, bench.pixel(joints[3]));
    bench.act(Action::MirrorSelected);
    assert_eq!(bench.rig().len(), joints.len() + 3);
    bench.change(Change::Undo);
    bench.act(Action::DeleteHierarchy);
    assert_eq!(bench.rig().len(), 3);
    bench.act(Action::Symmetry);
    bench.act(Action::Symmetry);
    assert_eq!(bench.app.world().get::<Symmetry>(bench.rig), Some(&Symmetry(None)));
}
