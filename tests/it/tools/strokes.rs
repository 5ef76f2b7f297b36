//! The tool for strokes: previews, ticks and scribbles.

use bevy_egui::egui;
use rigsmith::editor::notice::Notice;

use super::*;
use crate::panels::desk::{Desk, Sheet};

const ARM: [[f32; 3]; 3] = [[0.17, 1.4, 0.0], [0.37, 1.2, 0.0], [0.53, 1.02, 0.0]];

#[test]
fn what_is_previewed_is_what_is_taken() {
    for symmetry in [false, true] {
        let mut bench = RigBench::with_body(Mode::Stroke);
        if symmetry {
            bench.act(Action::Symmetry);
        }
        bench.preview(&ARM);
        assert!(bench.rig().is_empty(), "a preview changes nothing");
        assert_eq!(*bench.app.world().resource::<WheelUse>(), WheelUse::Tool);
        let count = |bench: &RigBench| bench.ghosts().joints.iter().filter(|joint| !joint.mirrored).count();
        let before = count(&bench);
        let at = Vec2::splat(400.0);
        bench.point(PLAIN, &[(at, PointerAct::Wheel(1.0)), (at, PointerAct::Wheel(2.0))]);
        assert_eq!(count(&bench), before + 3);
        bench.send(StrokeTune::Choice(ChainChoice::Joints(5)));
        assert_eq!(count(&bench), 5);
        assert!(bench.status().hint.starts_with("5 joints"), "{:?}", bench.status());
        let mut shown: Vec<Vec3> = bench.ghosts().joints.iter().map(|joint| joint.position).collect();
        let StrokeState::Preview(preview) = &bench.app.world().resource::<StrokeTool>().state else { panic!() };
        let request = StrokeRequest { chain: None, parent: StrokeParent::Natural, ..preview.request.clone() };
        bench.act(Action::Accept);
        assert!(!bench.is_previewing() && bench.ghosts().is_empty());
        let mut taken = bench.places();
        assert_eq!(taken.len(), if symmetry { 10 } else { 5 });

        // The same stroke, asked for without a window.
        let mut other = RigBench::with_body(Mode::Select);
        if symmetry {
            other.act(Action::Symmetry);
        }
        other.app.world_mut().write_message(StrokeRequest { rig: other.rig, ..request });
        other.wait("the chain", |bench| !bench.rig().is_empty());
        assert_eq!(other.places(), taken, "to the bit");
        let order = |a: &Vec3, b: &Vec3| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y));
        shown.sort_by(order);
        taken.sort_by(order);
        for (shown, taken) in shown.iter().zip(&taken) {
            assert!(shown.distance(*taken) <= EXACT, "{shown} was shown, {taken} was taken");
        }
    }
}

/// Texts of the notices so far.
#[derive(Resource, Default)]
struct NoticeTexts(Vec<String>);

fn keep(mut notices: MessageReader<Notice>, mut told: ResMut<NoticeTexts>) {
    told.0.extend(notices.read().map(|notice| notice.text.clone()));
}

/// The bar under a preview takes whole texts, and tells numbers that it does not take.
#[test]
fn wrong_numbers_of_the_bar_are_told() {
    let mut bench = RigBench::with_body(Mode::Stroke);
    bench.preview(&ARM);
    bench.app.init_resource::<NoticeTexts>().add_systems(Last, keep);
    bench.frames(3);
    let RigBench { app, rig } = bench;
    let mut desk = Desk::of(app, rig, Sheet::Window, egui::vec2(900.0, 500.0));
    desk.frames(3);
    let choice = |desk: &Desk| match &desk.app.world().resource::<StrokeTool>().state {
        StrokeState::Preview(preview) => preview.request.choice,
        other => panic!("{other:?}"),
    };
    let type_in = |desk: &mut Desk, text: &str| {
        desk.app.insert_resource(NoticeTexts::default());
        desk.click("Number of joints");
        desk.type_text(text);
        desk.key(egui::Key::Enter);
        desk.frames(2);
        desk.app.world().resource::<NoticeTexts>().0.clone()
    };
    let before = choice(&desk);
    for (text, words) in [
        ("500", "500 is none of its numbers; write one from 2 to 60"),
        ("4.5", "4.5 is no whole number; write one such as 3"),
        ("few", "\"few\" is no number; write one such as 1.5 or -20"),
    ] {
        let told = type_in(&mut desk, text);
        assert_eq!(told, [format!("The number of joints stays as it was: {words}.")]);
        assert_eq!(choice(&desk), before, "{text}");
    }
    assert_eq!(type_in(&mut desk, "12"), [""; 0]);
    assert_eq!(choice(&desk), ChainChoice::Joints(12));
}

#[test]
fn a_preview_is_dropped_or_kept_never_lost() {
    let table: &[(&str, fn(&mut RigBench), usize)] = &[
        ("Escape", |bench| bench.act(Action::Cancel), 0),
        ("undo", |bench| bench.act(Action::Undo), 0),
        ("Enter", |bench| bench.act(Action::Accept), 1),
        ("another mode", |bench| bench.mode(Mode::Select), 1),
        ("saving", |bench| bench.act(Action::Save), 1),
        ("another stroke", |bench| bench.stroke(&[[0.11, 0.85, 0.0], [0.11, 0.5, 0.0], [0.12, 0.1, 0.0]]), 1),
        ("a click", |bench| bench.click(PLAIN, Vec2::splat(5.0)), 0),
    ];
    for (what, make, chains) in table {
        let mut bench = RigBench::with_body(Mode::Stroke);
        bench.preview(&ARM);
        make(&mut bench);
        bench.app.update();
        assert_eq!(bench.rig().roots().len(), *chains, "{what}");
        assert_eq!(bench.is_previewing(), ["another stroke", "a click"].contains(what), "{what}");
        if *what == "Escape" {
            assert!(bench.ghosts().is_empty(), "nothing is left to see");
            let mut steps =
                bench.app.world().get::<rigsmith::plugins::history::RigHistory>(bench.rig).unwrap().steps().0;
            assert_eq!(steps.pop(), None, "nothing is left to undo");
        }
    }
    // Escape while the button is down.
    let mut bench = RigBench::with_body(Mode::Stroke);
    bench.point(PLAIN, &[(Vec2::splat(300.0), PointerAct::Pressed), (Vec2::splat(350.0), PointerAct::Dragged)]);
    assert_eq!(bench.ghosts().stroke.len(), 2, "the line follows at once");
    bench.act(Action::Cancel);
    bench.point(PLAIN, &[(Vec2::splat(400.0), PointerAct::Dragged), (Vec2::splat(400.0), DROPPED)]);
    assert!(!bench.is_previewing() && bench.ghosts().is_empty());
    // Beside the mesh there is no chain, and a word about it.
    bench.notices();
    let corner = [Vec2::splat(5.0), Vec2::new(5.0, 60.0)];
    bench.point(PLAIN, &[(corner[0], PointerAct::Pressed), (corner[1], PointerAct::Dragged), (corner[1], DROPPED)]);
    bench.wait("the refusal", |bench| !bench.is_previewing());
    assert!(bench.notices().iter().any(|notice| notice.text.contains("does not cross the mesh")));
}

#[test]
fn ticks_insert_and_scribbles_delete_at_once() {
    let (mut bench, joints) = RigBench::with_body(Mode::Stroke).with_joints();
    let elbow = (bench.pixel(joints[4]) + bench.pixel(joints[5])) * 0.5;
    let across = (bench.pixel(joints[5]) - bench.pixel(joints[4])).normalize().perp() * 20.0;
    bench.point(PLAIN, &[(elbow - across, PointerAct::Pressed), (elbow + across, PointerAct::Dragged)]);
    assert!(bench.status().hint.contains("put a joint into"), "{:?}", bench.status());
    bench.point(PLAIN, &[(elbow + across, DROPPED)]);
    bench.wait("the joint", |bench| bench.rig().len() == joints.len() + 1);
    assert!(!bench.is_previewing());

    let hand = bench.pixel(joints[5]);
    let mut moves = vec![(hand + Vec2::new(-20.0, -20.0), PointerAct::Pressed)];
    for swing in 0..7 {
        let x = if swing % 2 == 0 { 20.0 } else { -20.0 };
        moves.push((hand + Vec2::new(x, -18.0 + 6.0 * swing as f32), PointerAct::Dragged));
    }
    bench.point(PLAIN, &moves);
    assert!(bench.status().hint.contains("delete 1 joint"), "{:?}", bench.status());
    bench.point(PLAIN, &[(moves[moves.len() - 1].0, DROPPED)]);
    bench.wait("the deletion", |bench| bench.rig().joint(joints[5]).is_none());
    assert_eq!(bench.rig().len(), joints.len());

    // From a joint on: the pointer says so, and a click selects it.
    bench.hover(bench.pixel(joints[0]));
    assert_eq!(bench.hovered(), Some(joints[0]));
    assert!(bench.status().hint.contains("continue from"), "{:?}", bench.status());
    bench.click(PLAIN, bench.pixel(joints[0]));
    assert_eq!(bench.selected(), [joints[0]]);
}
