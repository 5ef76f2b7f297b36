//! The editor's tools without a window: what the pointer does becomes what the screen had promised.

use bevy::prelude::*;
use rigsmith::{
    algo::placement::Placement,
    editor::{
        actions::Action,
        camera::ViewportSight,
        mode::Mode,
        notice::StatusLine,
        pointer::{ModifierKeys, PointerAct, WheelUse},
        tools::{
            place::PlaceTool,
            select::SelectTool,
            stroke::{StrokeState, StrokeTool, StrokeTune},
        },
    },
    mesh::model::Weights,
    plugins::{
        display::{MeshDisplay, WeightColors},
        document::HoveredNode,
        drawing::Ghosts,
        stroke::StrokeParent,
        viewport::{RigViewport, Sight},
    },
    prelude::*,
    rig::{PoseOffset, SkinData},
};

use crate::{
    bench::RigBench,
    viewport_app::{CONTROL, DROPPED, PLAIN, SHIFT, front},
};

const CLICKED: PointerAct = PointerAct::Released { dragged: false, count: 1 };

/// From the character's left, without perspective.
fn left() -> Sight {
    let camera = Transform::from_xyz(4.0, 0.9, 0.0).looking_at(Vec3::Y * 0.9, Vec3::Y);
    let mut flat = OrthographicProjection::default_3d();
    flat.area = Rect::from_center_half_size(Vec2::ZERO, Vec2::splat(1.1));
    let (projection, viewport) = (Projection::Orthographic(flat), RigViewport { focus: 4.0 });
    Sight::new(&camera.into(), &projection, &viewport, Vec2::splat(800.0), &GlobalTransform::IDENTITY).unwrap()
}

impl RigBench {
    /// The bundled character without joints, seen from the front.
    fn with_body(mode: Mode) -> Self {
        let mut bench = Self::in_mode(mode);
        bench.open_body();
        bench
    }

    fn in_mode(mode: Mode) -> Self {
        let mut bench = Self::with_tools();
        bench.mode(mode);
        bench
    }

    fn look(&mut self, sight: Sight) {
        self.app.insert_resource(ViewportSight(Some(sight)));
    }

    fn sight(&self) -> Sight {
        self.app.world().resource::<ViewportSight>().0.unwrap()
    }

    fn hover(&mut self, at: Vec2) {
        self.point(PLAIN, &[(at, PointerAct::Moved)]);
    }

    fn click(&mut self, held: ModifierKeys, at: Vec2) {
        self.point(held, &[(at, PointerAct::Moved), (at, PointerAct::Pressed), (at, CLICKED)]);
    }

    /// A stroke through places of the rig's space, drawn in many small movements over several frames.
    fn stroke(&mut self, places: &[[f32; 3]]) {
        let sight = self.sight();
        let pixels: Vec<Vec2> = places.iter().map(|place| sight.project(Vec3::from(*place)).unwrap()).collect();
        self.point(PLAIN, &[(pixels[0], PointerAct::Pressed)]);
        for ends in pixels.windows(2) {
            let between = |step: i32| (ends[0].lerp(ends[1], step as f32 / 10.0), PointerAct::Dragged);
            let moves: Vec<_> = (1..=10).map(between).collect();
            self.point(PLAIN, &moves);
        }
        self.point(PLAIN, &[(pixels[pixels.len() - 1], DROPPED)]);
    }

    /// Draws and waits until the chain is shown.
    fn preview(&mut self, places: &[[f32; 3]]) {
        self.stroke(places);
        self.wait("the preview", |bench| match &bench.app.world().resource::<StrokeTool>().state {
            StrokeState::Preview(preview) => preview.chain().is_some(),
            _ => panic!("no preview: {:?}", bench.app.world().resource::<StatusLine>()),
        });
    }

    fn is_previewing(&self) -> bool {
        matches!(self.app.world().resource::<StrokeTool>().state, StrokeState::Preview(_))
    }

    fn place_tool(&self) -> &PlaceTool {
        self.app.world().resource::<PlaceTool>()
    }

    fn ghosts(&self) -> &Ghosts {
        self.app.world().resource::<Ghosts>()
    }

    fn places(&self) -> Vec<Vec3> {
        self.rig().rest_globals().iter().map(|(_, joint)| joint.translation).collect()
    }

    fn hovered(&self) -> Option<Uid> {
        self.get::<HoveredNode>(self.rig).unwrap().0
    }

    fn operate(&mut self, operation: Operation) {
        self.edit(operation);
        self.app.update();
    }

    /// A spine and a left arm.
    fn with_joints(mut self) -> (Self, Vec<Uid>) {
        let chain = |places: &[[f32; 3]]| places.iter().map(|place| Vec3::from(*place)).collect::<Vec<_>>();
        self.operate(Operation::Chain {
            positions: chain(&[[0.0, 0.95, 0.0], [0.0, 1.15, 0.0], [0.0, 1.4, 0.0]]),
            parent: None,
        });
        let neck = self.selected()[0];
        self.operate(Operation::Chain {
            positions: chain(&[[0.17, 1.4, 0.0], [0.37, 1.2, 0.0], [0.53, 1.02, 0.0]]),
            parent: Some(neck),
        });
        self.act(Action::SelectNone);
        let joints = self.rig().walk().map(|joint| joint.data.uid).collect();
        (self, joints)
    }

    fn pixel(&self, joint: Uid) -> Vec2 {
        self.sight().project(self.rig().position(joint)).unwrap()
    }
}

/// A millionth of the character's size.
const EXACT: f32 = 1.7e-6;

#[test]
fn the_ghost_is_where_the_joint_goes() {
    let table: &[(Sight, [f32; 3], f32, u32, bool)] = &[
        (front(), [0.0, 1.2, 0.0], 0.0, 0, false),
        (front(), [0.11, 0.5, 0.0], 0.0, 0, false),
        (front(), [0.11, 0.5, 0.0], 0.0, 0, true),
        (front(), [0.003, 1.2, 0.0], 0.0, 0, true),
        (front(), [0.37, 1.2, 0.0], 6.0, 0, true),
        (left(), [0.0, 0.5, 0.0], 0.0, 1, true),
        (left(), [0.0, 0.5, 0.0], -4.0, 2, true),
    ];
    for (sight, place, wheel, tabs, symmetry) in table {
        let mut bench = RigBench::with_body(Mode::Place);
        bench.look(*sight);
        if *symmetry {
            bench.act(Action::Symmetry);
            assert!(bench.app.world().get::<Symmetry>(bench.rig).unwrap().0.is_some());
        }
        let at = sight.project(Vec3::from(*place)).unwrap();
        bench.hover(at);
        for _ in 0..*tabs {
            bench.act(Action::NextVolume);
        }
        bench.point(PLAIN, &[(at, PointerAct::Wheel(*wheel))]);
        let ghost = bench.place_tool().ghost.expect("a ghost over the mesh");
        let promised: Vec<Vec3> = [Some(ghost.position), ghost.mirrored].into_iter().flatten().collect();
        let drawn: Vec<Vec3> = bench.ghosts().joints.iter().map(|joint| joint.position).collect();
        assert_eq!(drawn, promised, "what is drawn at {place:?}");
        assert!(bench.status().obstacle.is_none() && bench.status().hint.contains("Click places"));
        bench.click(PLAIN, at);
        let placed = bench.places();
        assert_eq!(placed.len(), promised.len(), "{place:?}");
        for place in promised {
            assert!(placed.iter().any(|placed| placed.distance(place) <= EXACT), "{placed:?} has no {place:?}");
        }
        assert_eq!(placed.len(), if *symmetry && place[0] != 0.003 { 2 } else { 1 }, "both sides of {place:?}");
    }
}

#[test]
fn tab_goes_through_the_volumes() {
    let mut bench = RigBench::with_body(Mode::Place);
    bench.look(left());
    let at = left().project(Vec3::new(0.0, 0.5, 0.0)).unwrap();
    bench.hover(at);
    let mut seen = Vec::new();
    for _ in 0..4 {
        let ghost = bench.place_tool().ghost.unwrap();
        let Placement::Between { volume, volumes, .. } = ghost.placement else { panic!("{ghost:?}") };
        assert_eq!(volumes, 2, "both legs");
        seen.push((volume, ghost.position.x.signum() * ghost.position.x.abs().min(0.06)));
        let hint = bench.status().hint.clone();
        assert_eq!(hint.contains("2 volumes: Tab for the near one"), volume.is_none(), "{hint}");
        bench.act(Action::NextVolume);
    }
    let volumes: Vec<Option<u32>> = seen.iter().map(|(volume, _)| *volume).collect();
    assert_eq!(volumes, [None, Some(1), Some(2), None]);
    assert!(seen[0].1.abs() < 0.03, "midway: between the legs");
    assert_eq!((seen[1].1, seen[2].1), (0.06, -0.06), "the near leg is the left one");
    // One volume: Tab changes nothing.
    let mut bench = RigBench::with_body(Mode::Place);
    bench.hover(front().project(Vec3::new(0.0, 1.2, 0.0)).unwrap());
    bench.act(Action::NextVolume);
    assert_eq!(bench.place_tool().settings.volume, None);
}

#[test]
fn wheel_and_drag_change_the_depth() {
    let mut bench = RigBench::with_body(Mode::Place);
    let at = front().project(Vec3::new(0.0, 1.2, 0.0)).unwrap();
    bench.hover(Vec2::new(5.0, 5.0));
    assert_eq!(*bench.app.world().resource::<WheelUse>(), WheelUse::Zoom, "beside the mesh the wheel zooms");
    bench.hover(at);
    assert_eq!(*bench.app.world().resource::<WheelUse>(), WheelUse::Tool);
    let depth = |bench: &RigBench| bench.place_tool().ghost.unwrap().position.z;
    let middle = depth(&bench);
    bench.point(PLAIN, &[(at, PointerAct::Wheel(4.0))]);
    assert!(depth(&bench) < middle - 0.01, "up is deeper");
    bench.point(PLAIN, &[(at, PointerAct::Wheel(-8.0))]);
    assert!(depth(&bench) > middle + 0.01);
    bench.point(PLAIN, &[(at, PointerAct::Wheel(-100.0))]);
    let Placement::Between { near, .. } = bench.place_tool().ghost.unwrap().placement else { panic!() };
    assert!((depth(&bench) - near.z).abs() <= EXACT, "no nearer than the surface");
    // A drag: along the ray of the press, wherever the pointer goes.
    bench.point(PLAIN, &[(at, PointerAct::Wheel(10.0)), (at, PointerAct::Pressed)]);
    let start = bench.place_tool().ghost.unwrap();
    bench.point(PLAIN, &[(at + Vec2::new(90.0, -30.0), PointerAct::Dragged)]);
    let dragged = bench.place_tool().ghost.unwrap();
    assert_eq!(dragged.ray, start.ray);
    assert!(dragged.position.z < start.position.z - 0.01);
    bench.point(PLAIN, &[(at + Vec2::new(90.0, -30.0), DROPPED)]);
    assert_eq!(bench.places().len(), 1);
    assert!(bench.places()[0].distance(dragged.position) <= EXACT);
    assert_eq!(bench.place_tool().settings.depth, 0.5, "the next joint begins in the middle");
    bench.mode(Mode::Select);
    assert_eq!(*bench.app.world().resource::<WheelUse>(), WheelUse::Zoom);
    assert!(bench.ghosts().is_empty(), "no ghost without its mode");
}

#[test]
fn on_a_posed_rig_joints_stand_where_the_ghost_was() {
    let (mut bench, joints) = RigBench::with_body(Mode::Place).with_joints();
    let turn = PoseOffset::from_rotation(Quat::from_rotation_z(0.4));
    bench.operate(Operation::Pose(vec![(joints[1], turn)]));
    for symmetry in [false, true] {
        if symmetry {
            bench.act(Action::Symmetry);
        }
        bench.app.world_mut().write_message(PickRequest {
            rig: bench.rig,
            what: Pick::Joints(vec![joints[2]]),
            add: false,
        });
        bench.hover(front().project(Vec3::new(0.12, 1.25, 0.0)).unwrap());
        let ghost = bench.place_tool().ghost.unwrap();
        let before = bench.rig().len();
        bench.click(PLAIN, front().project(Vec3::new(0.12, 1.25, 0.0)).unwrap());
        assert_eq!(bench.rig().len(), before + 1 + usize::from(symmetry));
        let posed: Vec<Vec3> = bench.rig().posed_globals().iter().map(|(_, joint)| joint.translation).collect();
        for place in [Some(ghost.position), ghost.mirrored].into_iter().flatten() {
            assert!(posed.iter().any(|posed| posed.distance(place) <= 3.0 * EXACT), "{posed:?} has no {place}");
        }
        assert_eq!(bench.rig().pose().len(), 1, "placing poses nothing");
    }
}

#[test]
fn placing_says_why_it_cannot() {
    let mut bench = RigBench::in_mode(Mode::Place);
    bench.hover(Vec2::splat(400.0));
    assert!(bench.status().obstacle.as_ref().unwrap().contains("no mesh"), "{:?}", bench.status());
    let mut bench = RigBench::with_body(Mode::Place);
    bench.hover(Vec2::splat(5.0));
    assert!(bench.status().obstacle.as_ref().unwrap().contains("beside the mesh"), "{:?}", bench.status());
    bench.notices();
    bench.click(PLAIN, Vec2::splat(5.0));
    assert!(bench.places().is_empty());
    assert!(bench.notices()[0].text.contains("beside the mesh"));
    // A double click places one joint, not two in the same place.
    let at = Vec2::splat(400.0);
    bench.click(PLAIN, at);
    bench.point(PLAIN, &[(at, PointerAct::Pressed), (at, PointerAct::Released { dragged: false, count: 2 })]);
    assert_eq!(bench.places().len(), 1);
    // Control and a click selects the next parent.
    bench.act(Action::SelectNone);
    bench.click(CONTROL, at);
    assert_eq!((bench.places().len(), bench.selected().len()), (1, 1));
    assert!(bench.ghosts().joints.is_empty(), "no ghost where a click selects");
}

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
        bench.app.world_mut().write_message(StrokeTune::Choice(ChainChoice::Joints(5)));
        bench.app.update();
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
    bench.app.world_mut().write_message(EditRequest { rig: bench.rig, change: Change::Undo });
    bench.app.update();
    bench.act(Action::DeleteHierarchy);
    assert_eq!(bench.rig().len(), 3);
    bench.act(Action::Symmetry);
    bench.act(Action::Symmetry);
    assert_eq!(bench.app.world().get::<Symmetry>(bench.rig), Some(&Symmetry(None)));
}

#[test]
fn the_weights_mode_shows_and_restores() {
    let (mut bench, joints) = RigBench::with_body(Mode::Select).with_joints();
    bench.app.world_mut().resource_mut::<MeshDisplay>().weights = WeightColors::AllJoints;
    bench.mode(Mode::Weights);
    assert!(bench.status().obstacle.as_ref().unwrap().contains("no weights yet"));
    let points = 10;
    let mut weights = Weights::default();
    for point in 0..points {
        weights.push(if point < 4 { vec![(1, 0.5), (0, 0.5)] } else { vec![(0, 1.0)] });
    }
    let skin = SkinData { joints: vec![joints[0], joints[3]], weights, at_rest: true, ..Default::default() };
    bench.operate(Operation::Edits(vec![RigEdit::SetSkin(Uid(98), Some(std::sync::Arc::new(skin)))]));
    bench.click(PLAIN, bench.pixel(joints[3]));
    bench.app.update();
    assert_eq!(bench.app.world().resource::<MeshDisplay>().weights, WeightColors::Joint(joints[3]));
    assert!(bench.status().hint.contains("moves 4 of 10 points"), "{:?}", bench.status());
    bench.mode(Mode::Select);
    assert_eq!(bench.app.world().resource::<MeshDisplay>().weights, WeightColors::AllJoints, "as it was");
    assert_eq!(bench.rig().len(), joints.len());
}

#[test]
fn idle_tools_change_nothing_and_hovering_does_no_more_than_it_must() {
    for mode in [Mode::Select, Mode::Place, Mode::Stroke, Mode::Weights] {
        let (mut bench, _) = RigBench::with_body(mode).with_joints();
        let at = front().project(Vec3::new(0.0, 1.2, 0.0)).unwrap();
        bench.hover(at);
        bench.app.update();
        let ticks = |bench: &RigBench| {
            let world = bench.app.world();
            let changed = |id: Option<bevy::ecs::change_detection::ComponentTicks>| id.map(|ticks| ticks.changed);
            [
                changed(world.get_resource_change_ticks::<Ghosts>()),
                changed(world.get_resource_change_ticks::<StatusLine>()),
                changed(world.get_resource_change_ticks::<WheelUse>()),
                changed(world.get_resource_change_ticks::<MeshDisplay>()),
                changed(world.get_resource_change_ticks::<StrokeTool>()),
                changed(world.get_resource_change_ticks::<PlaceTool>()),
            ]
        };
        let before = ticks(&bench);
        for _ in 0..3 {
            bench.app.update();
        }
        assert_eq!(ticks(&bench), before, "{mode:?} idles");
        // However often the pointer moves within a frame, it hovers once, and neither rig nor surface notice.
        let (rig, asked) = (bench.rig().clone(), bench.app.world().get::<RigSurface>(bench.rig).unwrap().wanted());
        for step in 0..20 {
            let moves: Vec<_> = (0..30)
                .map(|part| (at + Vec2::new((step * 30 + part) as f32 * 0.02, 0.0), PointerAct::Moved))
                .collect();
            bench.app.world_mut().resource_mut::<Messages<HoverRequest>>().clear();
            bench.point(PLAIN, &moves);
            let hovers = bench.app.world_mut().resource_mut::<Messages<HoverRequest>>().drain().count();
            assert!(hovers <= 1, "{mode:?}: {hovers} requests in a frame");
        }
        assert_eq!(bench.rig(), &rig, "{mode:?}");
        assert_eq!(bench.app.world().get::<RigSurface>(bench.rig).unwrap().wanted(), asked, "{mode:?}");
    }
}
