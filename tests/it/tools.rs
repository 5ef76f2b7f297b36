//! The editor's tools without a window: what the pointer does becomes what the screen had promised.

mod selecting;
mod slow_frames;
mod strokes;

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
        let end = self.draw(places);
        self.point(PLAIN, &[(end, DROPPED)]);
    }

    /// A stroke that is not released yet; the pixel where it is.
    fn draw(&mut self, places: &[[f32; 3]]) -> Vec2 {
        let sight = self.sight();
        let pixels: Vec<Vec2> = places.iter().map(|place| sight.project(Vec3::from(*place)).unwrap()).collect();
        self.point(PLAIN, &[(pixels[0], PointerAct::Pressed)]);
        for ends in pixels.windows(2) {
            let between = |step: i32| (ends[0].lerp(ends[1], step as f32 / 10.0), PointerAct::Dragged);
            let moves: Vec<_> = (1..=10).map(between).collect();
            self.point(PLAIN, &moves);
        }
        pixels[pixels.len() - 1]
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
