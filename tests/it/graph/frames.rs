//! Frames of a graph of many commands: folded to boxes with counts and pins, and opened by a click or a selection, which no
//! document notices.

use std::sync::{Arc, Mutex};

use rigsmith::{
    editor::{
        panel::{EditorPanel, Requests},
        panels::graph::{ChartFrame, FEW, GraphChart},
    },
    plugins::picking::{Pick, PickRequest},
};

use super::*;
use crate::bench::shipped;

/// A panel that the test looks into.
#[derive(Clone, Default)]
pub(super) struct Shared(pub(super) Arc<Mutex<GraphPanel>>);

impl EditorPanel for Shared {
    fn title(&self) -> &'static str {
        "Graph"
    }

    fn show(&mut self, ui: &mut egui::Ui, world: &World, requests: &mut Requests) {
        self.0.lock().unwrap().show(ui, world, requests);
    }
}

/// The bundled biped, built, in a panel as low and wide as the dock's.
struct Biped {
    desk: Desk,
    panel: Shared,
}

impl Biped {
    fn new() -> Self {
        let mut biped = Self::unseen();
        biped.desk.app.world_mut().write_message(BuildRequest { rig: biped.desk.rig, step: BuildStep::All });
        biped.desk.frames(2);
        settle(&mut biped.desk);
        biped
    }

    /// The rig before the panel is drawn, not built.
    fn unseen() -> Self {
        let panel = Shared::default();
        let mut desk = Desk::with(Sheet::Panel(Box::new(panel.clone())), egui::vec2(900.0, 330.0));
        let rig = desk.app.world_mut().spawn(shipped("biped")).id();
        desk.app.insert_resource(rigsmith::editor::ActiveRig(rig));
        desk.rig = rig;
        desk.app.update();
        Self { desk, panel }
    }

    fn chart(&self) -> GraphChart {
        self.panel.0.lock().unwrap().chart(view(&self.desk))
    }

    fn frame(&self, uid: Uid) -> ChartFrame {
        self.chart().frames.into_iter().find(|frame| frame.uid == uid).expect("the frame is there")
    }

    fn open_frames(&self) -> BTreeSet<Uid> {
        self.chart().frames.into_iter().filter(|frame| frame.is_open).map(|frame| frame.uid).collect()
    }

    /// The widget of a frame.
    fn seen(&self, frame: &ChartFrame) -> ShownWidget {
        let names = ["folded", "open"].map(|state| format!("Frame {}, {state}, ", frame.title));
        let is_frame = |seen: &&ShownWidget| names.iter().any(|name| seen.label.starts_with(name));
        let found: Vec<_> = self.desk.seen.iter().filter(is_frame).collect();
        let [found] = found[..] else { panic!("{names:?}: {found:?}") };
        found.clone()
    }

    fn click(&mut self, at: Pos2) {
        self.desk.time += 1.0;
        self.desk.click_at(at);
        self.desk.frames(3);
    }
}

/// Everything that is shown: no two overlap, no command is lost, and the whole has the shape of a panel.
#[track_caller]
fn check(chart: &GraphChart, all: &[Uid]) {
    let mut shown: Vec<Uid> = chart.commands.iter().map(|(tag, _)| *tag).collect();
    let folded = chart.frames.iter().filter(|frame| !frame.is_open);
    shown.extend(folded.flat_map(|frame| &frame.commands));
    shown.sort();
    let mut all = all.to_vec();
    all.sort();
    assert_eq!(shown, all, "every command is shown, or counted in one folded frame");
    let overlap = |a: egui::Rect, b: egui::Rect| a.intersect(b).is_positive();
    for (number, (tag, rect)) in chart.commands.iter().enumerate() {
        let other = chart.commands[..number].iter().find(|(_, other)| overlap(*rect, *other));
        assert!(other.is_none(), "{tag} and {other:?}");
    }
    for (number, frame) in chart.frames.iter().enumerate() {
        let other = chart.frames[..number].iter().find(|other| overlap(frame.rect, other.rect));
        assert!(other.is_none(), "{} and {other:?}", frame.title);
        let strange =
            chart.commands.iter().find(|(tag, rect)| overlap(*rect, frame.rect) && !frame.commands.contains(tag));
        assert!(strange.is_none(), "{}: {strange:?}", frame.title);
    }
    let space = chart.space();
    let aspect = space.width() / space.height();
    assert!((1.8..=3.4).contains(&aspect), "{aspect}");
    let right = chart.wires.iter().filter(|[from, to]| from.x < to.x).count() as f32 / chart.wires.len() as f32;
    assert!(right > 0.6, "{right} of the wires go to the right");
}

#[test]
fn a_biped_is_folded_to_boxes_with_counts() {
    let biped = Biped::new();
    let all = commands(&biped.desk);
    assert!(all.len() > 200, "{}", all.len());
    let chart = biped.chart();
    check(&chart, &all);
    assert!(biped.open_frames().is_empty() && chart.commands.len() < all.len() / 10, "{chart:?}");
    // All of it is in the panel, and says how many commands are built.
    for frame in &chart.frames {
        assert_eq!((frame.built, frame.failed), (frame.commands.len(), 0), "{}", frame.title);
    }
    let arm = chart.frames.iter().find(|frame| frame.title == "arm_l · ik").expect("the arm's feature");
    let seen = biped.seen(arm);
    assert!(seen.label.contains("folded") && seen.label.contains(&format!("{} built", arm.built)), "{}", seen.label);
    assert!(seen.rect.width() > 20.0, "{:?}", seen.rect);
    assert_eq!(chart, Biped::new().chart(), "the same rig has the same places");
}

#[test]
fn a_click_opens_a_frame_and_another_folds_it() {
    let mut biped = Biped::new();
    let (all, chart) = (commands(&biped.desk), biped.chart());
    let (before, steps) = (bytes(&biped.desk), biped.desk.steps());
    let arm = chart.frames.iter().find(|frame| frame.title == "arm_l · ik").unwrap().clone();
    let at = biped.seen(&arm).rect.center();
    biped.click(at);
    assert_eq!(biped.open_frames(), BTreeSet::from([arm.uid]));
    let opened = biped.chart();
    check(&opened, &all);
    assert_eq!(opened.commands.len(), chart.commands.len() + arm.commands.len());
    let now = biped.frame(arm.uid).rect;
    let inside = opened.commands.iter().filter(|(_, rect)| now.contains_rect(*rect)).count();
    assert_eq!(inside, arm.commands.len(), "all of its commands are in the frame");
    // The title folds it: it is the upper edge of the frame.
    act(&mut biped.desk, GraphAction::ShowAll);
    let seen = biped.seen(&arm).rect;
    biped.click(seen.center_top() + egui::vec2(0.0, 2.0));
    assert_eq!(biped.chart(), chart, "the places are those of before");
    assert_eq!((bytes(&biped.desk), biped.desk.steps()), (before, steps), "no document notices");
}

#[test]
fn selected_joints_open_their_frames() {
    let mut biped = Biped::new();
    let before = bytes(&biped.desk);
    let all = commands(&biped.desk);
    let hand = biped.desk.rig().find_label("hand_l").unwrap();
    biped.desk.select(&[hand]);
    biped.desk.frames(2);
    let of_hand: BTreeSet<Uid> = view(&biped.desk).selected.clone();
    assert!(!of_hand.is_empty());
    let chart = biped.chart();
    check(&chart, &all);
    let holds = |frame: &ChartFrame| frame.commands.iter().any(|tag| of_hand.contains(tag));
    assert!(chart.frames.iter().all(|frame| frame.is_open == holds(frame)), "{:?}", biped.open_frames());
    assert!(of_hand.iter().all(|tag| chart.commands.iter().any(|(shown, _)| shown == tag)));
    // One of them folded by hand stays so until it is selected again; all go with the selection.
    let first = chart.frames.iter().find(|frame| frame.is_open).unwrap().uid;
    biped.desk.app.world_mut().write_message(GraphRequest::Fold(first, false));
    biped.desk.frames(3);
    assert!(!biped.open_frames().contains(&first));
    let head = biped.desk.rig().find_label("head").unwrap();
    biped.desk.select(&[head]);
    biped.desk.select(&[hand]);
    biped.desk.frames(2);
    assert!(biped.open_frames().contains(&first));
    biped.desk.select(&[]);
    biped.desk.frames(2);
    assert!(biped.open_frames().is_empty(), "{:?}", biped.open_frames());
    // More than fit into a panel open nothing.
    act(&mut biped.desk, GraphAction::SelectAll);
    assert_eq!(view(&biped.desk).selected.len(), all.len());
    assert!(biped.open_frames().is_empty());
    assert_eq!(bytes(&biped.desk), before);
}

#[test]
fn the_first_look_is_at_a_selection_that_is_folded() {
    let mut biped = Biped::unseen();
    let rig = biped.desk.rig();
    let joints: Vec<Uid> = rig.walk().filter(|joint| joint.data.group.is_some()).map(|joint| joint.data.uid).collect();
    let request = PickRequest { rig: biped.desk.rig, what: Pick::Joints(joints), add: false };
    biped.desk.app.world_mut().write_message(request);
    (0..3).for_each(|_| biped.desk.app.update());
    biped.desk.frames(3);
    assert!(view(&biped.desk).selected.len() > FEW && biped.open_frames().is_empty());
    let names: Vec<&str> = biped.desk.seen.iter().map(|seen| seen.label.as_str()).collect();
    assert!(names.iter().any(|name| name.starts_with("Frame ") && name.contains(", folded, ")), "{names:?}");
}

#[test]
fn many_selected_joints_open_what_can_be_read_and_the_first_look_is_at_them() {
    let mut biped = Biped::unseen();
    biped.desk.app.world_mut().write_message(BuildRequest { rig: biped.desk.rig, step: BuildStep::All });
    let rig = biped.desk.rig();
    let labels = ["upper_arm_l", "thumb_01_l", "index_01_l", "foot_l", "thigh_l"];
    let joints: Vec<Uid> = labels.iter().map(|label| rig.find_label(label).unwrap()).collect();
    let request = PickRequest { rig: biped.desk.rig, what: Pick::Joints(joints), add: false };
    biped.desk.app.world_mut().write_message(request);
    (0..3).for_each(|_| biped.desk.app.update());
    biped.desk.frames(3);
    let selected = view(&biped.desk).selected.clone();
    assert!((2..=FEW).contains(&selected.len()), "{}", selected.len());
    let chart = biped.chart();
    let opened: usize = chart.frames.iter().filter(|frame| frame.is_open).map(|frame| frame.commands.len()).sum();
    assert!((1..=FEW).contains(&opened), "{opened}");
    // Names can be read, those of selected commands among them.
    let is_selected = |seen: &&ShownWidget| seen.on == Some(true) && seen.rect.width() > 100.0;
    assert!(biped.desk.seen.iter().any(|seen| is_selected(&seen)), "{:?}", biped.desk.seen);
    // One joint alone opens all of its frames.
    let foot = biped.desk.rig().find_label("foot_l").unwrap();
    biped.desk.select(&[foot]);
    biped.desk.frames(2);
    let of_foot = view(&biped.desk).selected.clone();
    let is_open = |frame: &ChartFrame| frame.is_open == frame.commands.iter().any(|tag| of_foot.contains(tag));
    assert!(biped.chart().frames.iter().all(is_open), "{:?}", biped.open_frames());
}

#[test]
fn a_folded_frame_is_dragged_and_stays_where_it_is_put() {
    let mut biped = Biped::new();
    let (before, steps, chart) = (bytes(&biped.desk), biped.desk.steps(), biped.chart());
    let arm = chart.frames.iter().find(|frame| frame.title == "arm_l · ik").unwrap().clone();
    let seen = biped.seen(&arm).rect;
    let scale = seen.width() / arm.rect.width();
    // Above all others.
    let by = egui::vec2(0.0, chart.space().top() - arm.rect.bottom() - 2.0 * GRID);
    biped.desk.drag(seen.center(), seen.center() + scale * by);
    biped.desk.frames(2);
    assert_eq!(view(&biped.desk).moved.keys().copied().collect::<Vec<_>>(), [arm.uid]);
    let now = biped.frame(arm.uid);
    assert!(!now.is_open && (now.rect.min - arm.rect.min - by).length() < 0.1, "{now:?} {by:?}");
    assert!(view(&biped.desk).selected.is_empty(), "nothing is selected by the way");
    // A click opens it as before; folded again, it is where it was put.
    act(&mut biped.desk, GraphAction::ShowAll);
    let at = biped.seen(&now).rect.center();
    biped.click(at);
    assert_eq!(biped.open_frames(), BTreeSet::from([arm.uid]));
    biped.desk.app.world_mut().write_message(GraphRequest::Fold(arm.uid, false));
    biped.desk.frames(3);
    assert_eq!(biped.frame(arm.uid).rect, now.rect);
    act(&mut biped.desk, GraphAction::LayOut);
    assert_eq!(biped.chart(), chart);
    assert_eq!((bytes(&biped.desk), biped.desk.steps()), (before, steps), "no document notices");
}

#[test]
fn selected_commands_of_folded_frames_are_not_moved() {
    let mut biped = Biped::new();
    act(&mut biped.desk, GraphAction::SelectAll);
    let arm = biped.chart().frames.into_iter().find(|frame| frame.title == "arm_l · ik").unwrap();
    biped.desk.app.world_mut().write_message(GraphRequest::Fold(arm.uid, true));
    biped.desk.frames(2);
    act(&mut biped.desk, GraphAction::ShowAll);
    let (chart, arm) = (biped.chart(), biped.frame(arm.uid));
    // From the graph to the panel.
    let seen = biped.seen(&arm).rect;
    let scale = seen.width() / arm.rect.width();
    let (_, rect) = chart.commands.iter().find(|(tag, _)| *tag == arm.commands[0]).unwrap();
    let at = seen.min + scale * (rect.center() - arm.rect.min);
    biped.desk.drag(at, at + scale * egui::vec2(3.0 * GRID, 0.0));
    biped.desk.frames(2);
    let moved = &view(&biped.desk).moved;
    let shown: BTreeSet<Uid> = chart.commands.iter().map(|(tag, _)| *tag).collect();
    assert_eq!(moved.keys().copied().collect::<BTreeSet<_>>(), shown, "those that are seen");
    assert!(shown.len() < commands(&biped.desk).len());
    act(&mut biped.desk, GraphAction::OpenFrames);
    assert!(biped.chart().space().is_finite());
}

#[test]
fn all_frames_are_opened_and_folded() {
    let mut biped = Biped::new();
    let (all, folded) = (commands(&biped.desk), biped.chart());
    biped.desk.click("Open all");
    biped.desk.frames(3);
    let opened = biped.chart();
    check(&opened, &all);
    assert_eq!(opened.commands.len(), all.len());
    biped.desk.click("Fold all");
    biped.desk.frames(3);
    assert_eq!(biped.chart(), folded);
}

#[test]
fn a_failed_command_is_counted_in_its_box_and_nothing_moves() {
    let mut biped = Biped::new();
    let chart = biped.chart();
    let arm = chart.frames.iter().find(|frame| frame.title == "arm_r · ik").unwrap().clone();
    let wrong = vec![(*arm.commands.last().unwrap(), "(oops: 1)".to_owned())];
    biped.desk.edit(Operation::Tags(TagOperation::Params(wrong)));
    biped.desk.frames(3);
    let now = biped.frame(arm.uid);
    assert_eq!((now.failed, now.commands.len(), now.rect), (1, arm.commands.len(), arm.rect));
    assert!(biped.seen(&now).label.ends_with("1 failed"), "{}", biped.seen(&now).label);
    biped.desk.undo(1);
    // One more command in a folded frame moves nothing.
    let joint = biped.desk.rig().find_tag(arm.commands[0]).unwrap().0.data.uid;
    let kind = TagKind::Command { module: "null".into(), params: "()".into(), feature: Some(arm.uid) };
    biped.desk.edit(Operation::Tags(TagOperation::Add { joints: vec![joint], kind, index: None }));
    biped.desk.frames(3);
    assert_eq!(biped.frame(arm.uid).commands.len(), arm.commands.len() + 1);
    let places = |chart: &GraphChart| chart.frames.iter().map(|frame| frame.rect).collect::<Vec<_>>();
    assert_eq!(places(&biped.chart()), places(&chart));
}
