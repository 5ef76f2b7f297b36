//! Slow frames: a release of the button and a key come together, and none of the two is lost.

use std::cell::Cell;

use bevy::{
    ecs::message::MessageCursor,
    input::{
        ButtonState,
        keyboard::{Key, KeyboardInput},
        mouse::MouseButtonInput,
    },
    window::{CursorMoved, PrimaryWindow, WindowEvent, WindowFocused},
};
use bevy_egui::PrimaryEguiContext;
use rigsmith::{
    editor::{
        ActiveRig,
        actions::{ActionRequest, ActionsPlugin},
        keys::KeysPlugin,
        notice::Notice,
        pointer::{PointerPlugin, ViewportArea},
        tools::ToolsPlugin,
    },
    headless::headless_app,
    test_app::strict_app,
};

use super::*;

/// Words of the notice about a stroke that was accepted because its mode was left.
const ACCEPTED: &str = "accepted as you left its mode";

const ARM: [[f32; 3]; 3] = [[0.17, 1.4, 0.0], [0.37, 1.2, 0.0], [0.53, 1.02, 0.0]];

/// Deed of a hand at the mouse or the keyboard.
#[derive(Debug, Clone, Copy)]
enum Input {
    To(Vec2),
    Down,
    Up,
    Press(&'static str),
    Lift(&'static str),
}

use Input::{Down, Lift, Press, To, Up};

/// The tools behind a mouse and a keyboard: what the window's system tells becomes actions and pointer events.
struct Hand {
    base: RigBench,
    window: Entity,
}

impl Hand {
    /// The bundled character without joints, seen from the front.
    fn with_body(mode: Mode) -> Self {
        let mut app = headless_app(1);
        app.add_message::<KeyboardInput>().add_message::<WindowFocused>().add_message::<WindowEvent>().add_plugins((
            ToolsPlugin,
            ActionsPlugin,
            KeysPlugin,
            PointerPlugin,
        ));
        let mut base = RigBench::with(strict_app(app), Rig::new(Uid(1), "rig"));
        let area = ViewportArea { size: Vec2::splat(800.0), scale: 1.0, ..default() };
        base.app.insert_resource(ActiveRig(base.rig)).insert_resource(ViewportSight(Some(front())));
        base.app.insert_resource(area);
        base.app.world_mut().spawn(PrimaryEguiContext);
        let window = base.app.world_mut().spawn(PrimaryWindow).id();
        base.mode(mode);
        base.open_body();
        Self { base, window }
    }

    fn with_joints(mode: Mode) -> (Self, Vec<Uid>) {
        let Self { base, window } = Self::with_body(mode);
        let (base, joints) = base.with_joints();
        (Self { base, window }, joints)
    }

    /// One frame in which all of this comes, in that order.
    fn frame(&mut self, inputs: &[Input]) {
        let window = self.window;
        for input in inputs {
            let button =
                |state| WindowEvent::MouseButtonInput(MouseButtonInput { button: MouseButton::Left, state, window });
            let event = match *input {
                To(position) => WindowEvent::CursorMoved(CursorMoved { window, position, delta: None }),
                Down => button(ButtonState::Pressed),
                Up => button(ButtonState::Released),
                Press(name) => self.keyboard(name, ButtonState::Pressed),
                Lift(name) => self.keyboard(name, ButtonState::Released),
            };
            self.base.app.world_mut().write_message(event);
        }
        self.base.app.update();
    }

    /// A key's event, which the window's system passes on twice: among its keys, and among all that happens in it.
    fn keyboard(&mut self, name: &str, state: ButtonState) -> WindowEvent {
        let (key_code, logical_key) = match name {
            "Enter" => (KeyCode::Enter, Key::Enter),
            "Escape" => (KeyCode::Escape, Key::Escape),
            "Tab" => (KeyCode::Tab, Key::Tab),
            "Delete" => (KeyCode::Delete, Key::Delete),
            "Ctrl" => (KeyCode::ControlLeft, Key::Control),
            "z" => (KeyCode::KeyZ, Key::Character("z".into())),
            other => panic!("{other} has no code here"),
        };
        let input = KeyboardInput { key_code, logical_key, state, text: None, repeat: false, window: self.window };
        self.base.app.world_mut().write_message(input.clone());
        WindowEvent::KeyboardInput(input)
    }

    fn pixels(&self, places: &[[f32; 3]]) -> Vec<Vec2> {
        places.iter().map(|place| self.base.sight().project(Vec3::from(*place)).unwrap()).collect()
    }
}

/// Places of the joints of a stroke that is accepted at leisure.
fn drawn_at_leisure() -> Vec<Vec3> {
    let mut bench = RigBench::with_body(Mode::Stroke);
    bench.preview(&ARM);
    bench.act(Action::Accept);
    bench.wait("the chain", |bench| !bench.rig().is_empty());
    bench.places()
}

#[test]
fn a_stroke_is_taken_by_a_key_beside_its_release() {
    let wanted = drawn_at_leisure();
    // A request beside the events of the pointer has no order among them.
    for action in [Action::Accept, Action::Save] {
        let mut bench = RigBench::with_body(Mode::Stroke);
        let end = bench.draw(&ARM);
        bench.app.world_mut().write_message(ActionRequest(action));
        bench.point(PLAIN, &[(end, DROPPED)]);
        assert!(!bench.is_previewing(), "{action:?} was lost");
        bench.wait("the chain", |bench| !bench.rig().is_empty());
        assert_eq!(bench.places(), wanted, "{action:?}");
    }
    // A key while the line is drawn is none of its preview.
    let mut bench = RigBench::with_body(Mode::Stroke);
    let end = bench.draw(&ARM);
    bench.act(Action::Accept);
    bench.point(PLAIN, &[(end, DROPPED)]);
    assert!(bench.is_previewing());
    // What is dropped after it was accepted stays dropped.
    let mut bench = RigBench::with_body(Mode::Stroke);
    let end = bench.draw(&ARM);
    for action in [Action::Accept, Action::Cancel] {
        bench.app.world_mut().write_message(ActionRequest(action));
    }
    bench.point(PLAIN, &[(end, DROPPED)]);
    bench.frames(3);
    assert!(!bench.is_previewing() && bench.rig().is_empty());
}

#[test]
fn a_stroke_and_enter_come_in_any_number_of_frames() {
    let wanted = drawn_at_leisure();
    let hand = Hand::with_body(Mode::Stroke);
    let pixels = hand.pixels(&ARM);
    let between = |step: usize| {
        let ends = &pixels[step / 10..step / 10 + 2];
        To(ends[0].lerp(ends[1], (step % 10 + 1) as f32 / 10.0))
    };
    let line: Vec<Input> = [To(pixels[0]), Down].into_iter().chain((0..20).map(between)).collect();
    let frames: [Vec<Vec<Input>>; 3] = [
        vec![line.clone(), vec![Up], vec![Press("Enter")]],
        vec![line.clone(), vec![Up, Press("Enter"), Lift("Enter")]],
        vec![[line.as_slice(), &[Up, Press("Enter"), Lift("Enter")]].concat()],
    ];
    for frames in frames {
        let mut hand = Hand::with_body(Mode::Stroke);
        frames.iter().for_each(|inputs| hand.frame(inputs));
        hand.base.wait("the chain", |bench| !bench.rig().is_empty());
        assert!(!hand.base.is_previewing(), "in {} frames", frames.len());
        assert_eq!(hand.base.places(), wanted, "in {} frames", frames.len());
    }
}

#[test]
fn keys_after_a_drag_find_it_done_and_keys_before_its_end_drop_it() {
    let undo = [Press("Ctrl"), Press("z"), Lift("z"), Lift("Ctrl")];
    // Steps that are known and steps in effect, beyond those before the drag.
    let table: &[(&str, &[Input], &[Input], [usize; 2])] = &[
        ("no key", &[], &[], [1, 1]),
        ("Escape after it", &[], &[Press("Escape")], [1, 1]),
        ("Escape before its end", &[Press("Escape")], &[], [0, 0]),
        ("undo after it", &[], &undo, [1, 0]),
        ("undo before its end", &undo, &[], [0, 0]),
    ];
    for mode in [Mode::Move, Mode::Pose] {
        for (what, before_end, after_end, steps) in table {
            let (mut hand, joints) = Hand::with_joints(mode);
            let at = hand.base.pixel(joints[5]);
            hand.frame(&[To(at)]);
            hand.frame(&[Down]);
            let (rig, (known, done)) = (hand.base.rig().clone(), hand.base.history());
            hand.frame(&[To(at + Vec2::new(-20.0, 10.0)), To(at + Vec2::new(-40.0, 25.0))]);
            assert_ne!(hand.base.rig(), &rig, "{mode:?}: the drag is seen");
            hand.frame(&[*before_end, &[To(at + Vec2::new(-45.0, 30.0)), Up], *after_end].concat());
            hand.base.frames(2);
            let (now_known, now_done) = hand.base.history();
            assert_eq!([now_known.len() - known.len(), now_done - done], *steps, "{mode:?}, {what}");
            assert_eq!(hand.base.rig() == &rig, steps[1] == 0, "{mode:?}, {what}");
        }
    }
}

#[test]
fn a_key_after_a_click_is_for_what_was_clicked() {
    let (mut hand, joints) = Hand::with_joints(Mode::Select);
    let pixels = [hand.base.pixel(joints[0]), hand.base.pixel(joints[5])];
    hand.frame(&[To(pixels[0]), Down, Up]);
    assert_eq!(hand.base.selected(), [joints[0]]);
    hand.frame(&[To(pixels[1]), Down, Up, Press("Delete"), Lift("Delete")]);
    hand.base.frames(2);
    let is_left = [joints[0], joints[5]].map(|joint| hand.base.rig().joint(joint).is_some());
    assert_eq!(is_left, [true, false], "the joint under the click is deleted");

    // The joint of a click lies in the volume that was shown, and Tab chooses the one of the next.
    let mut hand = Hand::with_body(Mode::Place);
    hand.base.look(left());
    let at = left().project(Vec3::new(0.0, 0.5, 0.0)).unwrap();
    hand.frame(&[To(at)]);
    let ghost = hand.base.place_tool().ghost.expect("a ghost over the mesh");
    hand.frame(&[Down, Up, Press("Tab"), Lift("Tab")]);
    hand.base.frames(2);
    let placed = hand.base.places();
    assert!(placed.len() == 1 && placed[0].distance(ghost.position) <= EXACT, "{placed:?} for {ghost:?}");
    assert_eq!(hand.base.place_tool().settings.volume, Some(1));
}

/// The pointer comes from another joint and goes on to a third place within the frame of the click.
#[test]
fn a_click_with_control_takes_out_the_joint_under_the_press() {
    for mode in [Mode::Select, Mode::Move, Mode::Pose] {
        let (mut hand, joints) = Hand::with_joints(mode);
        let [a, b] = [joints[0], joints[5]];
        let [at_a, at_b] = [hand.base.pixel(a), hand.base.pixel(b)];
        hand.frame(&[To(at_a), Down, Up]);
        hand.frame(&[To(at_b), Press("Ctrl"), Down, Up]);
        assert_eq!(hand.base.selected(), [a, b], "{mode:?}");
        hand.frame(&[To(at_b + Vec2::new(1.0, 0.0))]);
        hand.frame(&[To(at_a), Down, Up, To(at_b)]);
        assert_eq!(hand.base.selected(), [b], "{mode:?}: the pointer came from the other one, and goes back there");
    }
}

#[test]
fn a_double_click_within_a_frame_selects_the_hierarchy() {
    for mode in [Mode::Select, Mode::Move, Mode::Pose] {
        let (mut hand, joints) = Hand::with_joints(mode);
        let shoulder = hand.base.pixel(joints[3]);
        hand.frame(&[To(shoulder), Down, Up, Down, Up]);
        let mut below = hand.base.selected();
        assert_eq!(below.last(), Some(&joints[3]), "{mode:?}: it stays the active one");
        below.sort();
        let mut wanted = joints[3..].to_vec();
        wanted.sort();
        assert_eq!(below, wanted, "{mode:?}");
    }
}

/// The handle of a gizmo lies over the joint that the first click selected.
#[test]
fn a_double_click_over_two_frames_selects_the_hierarchy_in_every_mode() {
    for mode in [Mode::Select, Mode::Move, Mode::Rotate, Mode::Scale, Mode::Pose] {
        let (mut bench, joints) = RigBench::with_body(mode).with_joints();
        let shoulder = bench.pixel(joints[3]);
        bench.click(PLAIN, shoulder);
        assert_eq!(bench.selected(), [joints[3]], "{mode:?}");
        let again = PointerAct::Released { dragged: false, count: 2 };
        bench.point(PLAIN, &[(shoulder, PointerAct::Pressed), (shoulder, again)]);
        assert_eq!(bench.selected().len(), joints[3..].len(), "{mode:?}");
        assert_eq!(bench.selected().last(), Some(&joints[3]), "{mode:?}");
    }
}

/// One press is on a handle of the gizmo, the other one on a joint beside it.
#[test]
fn each_press_of_a_frame_belongs_to_what_lies_under_it() {
    let modes = [Mode::Move, Mode::Scale, Mode::Pose];
    for (mode, is_handle_first) in modes.into_iter().flat_map(|mode| [(mode, true), (mode, false)]) {
        let (mut hand, joints) = Hand::with_joints(mode);
        let [a, b] = [joints[0], joints[5]];
        let [at_a, at_b] = [hand.base.pixel(a), hand.base.pixel(b)];
        hand.frame(&[To(at_a), Down, Up]);
        assert_eq!(hand.base.selected(), [a], "{mode:?}");
        hand.frame(&[To(at_a + Vec2::new(1.0, 0.0))]);
        let [first, last] = if is_handle_first { [at_a, at_b] } else { [at_b, at_a] };
        hand.frame(&[To(first), Down, Up, To(last), Down, Up]);
        let wanted = if is_handle_first { b } else { a };
        assert_eq!(hand.base.selected(), [wanted], "{mode:?}, the handle first: {is_handle_first}");
    }
}

/// Joints are clicked with another tool than the handle of the gizmo.
#[test]
fn clicks_of_two_tools_in_one_frame_add_up() {
    for mode in [Mode::Scale, Mode::Pose] {
        let (mut hand, joints) = Hand::with_joints(mode);
        let [a, b] = [joints[0], joints[5]];
        let [at_a, at_b] = [hand.base.pixel(a), hand.base.pixel(b)];
        hand.frame(&[To(at_a), Down, Up]);
        hand.frame(&[To(at_a + Vec2::new(1.0, 0.0))]);
        assert_eq!(hand.base.selected(), [a], "{mode:?}");
        // The first click adds one, the second takes the other out.
        hand.frame(&[Press("Ctrl"), To(at_b), Down, Up, To(at_a), Down, Up, Lift("Ctrl")]);
        assert_eq!(hand.base.selected(), [b], "{mode:?}");
    }
}

/// The joint of the second click is no more selected, and that of the third one is.
#[test]
fn clicks_with_control_in_one_frame_add_up() {
    for mode in [Mode::Select, Mode::Move, Mode::Pose] {
        let (mut hand, joints) = Hand::with_joints(mode);
        let nodes = [joints[0], joints[3], joints[5]];
        let [a, b, c] = nodes.map(|joint| hand.base.pixel(joint));
        hand.base.select(&nodes);
        hand.frame(&[Press("Ctrl"), To(a), Down, Up, To(b), Down, Up]);
        assert_eq!(hand.base.selected(), [nodes[2]], "{mode:?}");
        hand.frame(&[To(a), Down, Up, To(c), Down, Up]);
        assert_eq!(hand.base.selected(), [nodes[0]], "{mode:?}");
    }
}

#[test]
fn leaving_the_mode_of_a_stroke_is_told_once_its_chain_is_there() {
    let is_told = |bench: &RigBench, part: &str| {
        let notices = bench.app.world().resource::<Messages<Notice>>();
        MessageCursor::<Notice>::default().read(notices).any(|notice| notice.text.contains(part))
    };
    let mut bench = RigBench::with_body(Mode::Stroke);
    bench.preview(&ARM);
    bench.mode(Mode::Select);
    assert!(!bench.rig().is_empty() && is_told(&bench, ACCEPTED));
    // The next stroke is accepted by a key, which needs no word.
    bench.mode(Mode::Stroke);
    bench.notices();
    bench.preview(&[[0.11, 0.85, 0.0], [0.11, 0.5, 0.0], [0.12, 0.1, 0.0]]);
    let count = bench.rig().len();
    bench.act(Action::Accept);
    bench.wait("the chain", |bench| bench.rig().len() > count);
    assert!(!is_told(&bench, ACCEPTED));

    // A stroke beside the mesh becomes no chain, whoever leaves before that is known.
    let mut bench = RigBench::with_body(Mode::Stroke);
    let corner = [Vec2::splat(5.0), Vec2::new(5.0, 60.0)];
    bench.point(PLAIN, &[(corner[0], PointerAct::Pressed), (corner[1], PointerAct::Dragged)]);
    bench.app.insert_resource(Mode::Select);
    bench.point(PLAIN, &[(corner[1], DROPPED)]);
    let is_accepted = Cell::new(false);
    bench.wait("the refusal", |bench| {
        is_accepted.set(is_accepted.get() || is_told(bench, ACCEPTED));
        is_told(bench, "No chain") || is_told(bench, "Nothing was drawn")
    });
    bench.app.update();
    assert!(!is_accepted.get() && !is_told(&bench, ACCEPTED) && bench.rig().is_empty());
}
