//! Views of the viewport: boxes framed beside bars, zoom to the pointer, and a pointer that leaves.

use bevy::{
    input::{
        ButtonState, InputPlugin,
        mouse::{MouseButtonInput, MouseScrollUnit, MouseWheel},
        touch::TouchPhase,
    },
    prelude::*,
    window::{CursorMoved, PrimaryWindow, WindowEvent},
};
use bevy_egui::{EguiContext, PrimaryEguiContext, egui};
use bevy_panorbit_camera::{ActiveCameraData, PanOrbitCamera};
use rigsmith::{
    algo::view::View,
    editor::{
        ActiveRig,
        actions::ActionRequest,
        camera::{CameraPlugin, FrameWhenReady, ViewportSight},
        mode::Mode,
        notice::StatusLine,
        pointer::{PointerPlugin, PointerState, ViewportArea, WheelUse},
        tools::ToolsPlugin,
        viewport_bars::ViewportBars,
    },
    headless::headless_app,
    plugins::viewport::{FIELD_OF_VIEW, RigViewport, Sight, framing, framing_beside},
    prelude::*,
    test_app::strict_app,
};

use crate::{
    bench::{RigBench, shipped},
    panels::desk::{Desk, Sheet},
    viewport_app::front,
};

const SIZE: Vec2 = Vec2::new(640.0, 520.0);

/// A camera that looks at a point from a distance, in perspective or flat.
fn sight([focus, right, up, back]: [Vec3; 4], distance: f32, is_flat: bool) -> Sight {
    let rotation = Quat::from_mat3(&Mat3::from_cols(right, up, back));
    let camera = Transform::from_translation(focus + back * distance).with_rotation(rotation);
    let projection = if is_flat {
        let mut flat = OrthographicProjection::default_3d();
        let height = 2.0 * (FIELD_OF_VIEW * 0.5).tan() * distance;
        flat.area = Rect::from_center_size(Vec2::ZERO, Vec2::new(height * SIZE.x / SIZE.y, height));
        Projection::Orthographic(flat)
    } else {
        Projection::Perspective(PerspectiveProjection { fov: FIELD_OF_VIEW, ..default() })
    };
    let viewport = RigViewport { focus: distance };
    Sight::new(&camera.into(), &projection, &viewport, SIZE, &GlobalTransform::IDENTITY).unwrap()
}

#[test]
fn a_figure_is_framed_above_the_bars() {
    let figure = [Vec3::new(-0.8, 0.0, -0.2), Vec3::new(0.8, 1.8, 0.2)];
    let animal = [Vec3::new(-0.3, 0.0, -1.0), Vec3::new(0.3, 1.4, 1.0)];
    let bar = |left: f32, top: f32, right: f32| Rect::new(left, top, right, SIZE.y - 12.0);
    for bounds in [figure, animal] {
        for view in [View::Front, View::Left, View::Orbit(35.0, 20.0)] {
            let [right, up, back] = view.axes();
            let corners = (0..8).map(|bits: u32| {
                let [x, y, z] = [0_usize, 1, 2].map(|axis| bounds[((bits >> axis) & 1) as usize][axis]);
                Vec3::new(x, y, z)
            });
            for bars in [vec![bar(12.0, 390.0, 520.0)], vec![bar(12.0, 470.0, 120.0), bar(200.0, 350.0, 400.0)]] {
                let (focus, distance) = framing_beside(bounds, [right, up, back], SIZE, &bars);
                let top = bars.iter().map(|bar| bar.min.y).fold(SIZE.y, f32::min);
                for is_flat in [false, true] {
                    let sight = sight([focus, right, up, back], distance, is_flat);
                    for corner in corners.clone() {
                        let at = sight.project(corner).unwrap();
                        let is_seen = at.cmpge(Vec2::ZERO).all() && at.x <= SIZE.x && at.y <= top;
                        assert!(is_seen, "{corner} of {bounds:?} is at {at}, {view:?}, {bars:?}");
                    }
                }
            }
            // Without bars, beside one in a corner, and beside one at the top the whole viewport is free.
            let whole = framing(bounds, [right, up, back], SIZE.x / SIZE.y);
            let in_corner = Rect::new(560.0, 490.0, 630.0, 510.0);
            let at_top = Rect::new(12.0, 12.0, 600.0, 60.0);
            for bars in [vec![], vec![in_corner, at_top]] {
                assert_eq!(framing_beside(bounds, [right, up, back], SIZE, &bars), whole, "{bounds:?} {view:?}");
            }
        }
    }
    // A bar over most of the viewport leaves the figure a size that can be seen.
    let axes = [Vec3::X, Vec3::Y, Vec3::Z];
    let (_, whole) = framing(figure, axes, SIZE.x / SIZE.y);
    let (_, distance) = framing_beside(figure, axes, SIZE, &[Rect::new(0.0, 100.0, SIZE.x, SIZE.y)]);
    assert!((1.5..2.6).contains(&(distance / whole)), "{distance} after {whole}");
}

/// An app with the viewport's camera after its first frames.
fn camera_app() -> App {
    let mut app = headless_app(1);
    app.add_plugins((InputPlugin, CameraPlugin))
        .init_resource::<WheelUse>()
        .init_resource::<PointerState>()
        .add_message::<ActionRequest>()
        .insert_resource(ViewportArea { size: SIZE, scale: 1.0, ..default() });
    app.finish();
    app.cleanup();
    app.update();
    app.update();
    app
}

#[test]
fn a_bar_that_comes_gets_room_unless_the_view_was_moved() {
    let mut app = camera_app();
    let rig = app.world_mut().spawn(shipped("biped")).id();
    app.insert_resource(ActiveRig(rig));
    app.update();
    app.update();
    app.insert_resource(FrameWhenReady(true));
    let mut cameras = app.world_mut().query::<&mut PanOrbitCamera>();
    let mut view = |app: &mut App, bars: ViewportBars, yaw: f32| {
        app.insert_resource(bars);
        app.update();
        app.update();
        let mut camera = cameras.single_mut(app.world_mut()).unwrap();
        let view = (camera.target_focus, camera.target_radius);
        camera.target_yaw += yaw;
        view
    };
    let bar = vec![Rect::new(12.0, 390.0, 520.0, 508.0)];
    let lasting = ViewportBars { lasting: bar.clone(), ..default() };
    let whole = view(&mut app, ViewportBars::default(), 0.0);
    let above = view(&mut app, lasting.clone(), 0.0);
    assert!(above.1 > 1.1 * whole.1 && above.0.y < whole.0.y, "{above:?} after {whole:?}");
    assert_eq!(view(&mut app, ViewportBars::default(), 0.0), whole, "the bar is gone");
    let brief = ViewportBars { brief: bar, ..default() };
    assert_eq!(view(&mut app, brief, 0.0), whole, "a bar of one gesture moves nothing");
    assert_eq!(view(&mut app, ViewportBars::default(), 0.3), whole);
    assert_eq!(view(&mut app, lasting, 0.0), whole, "a person has turned the view");
}

#[test]
fn the_switch_of_pose_mode_is_in_an_upper_corner() {
    let mut app = headless_app(1);
    app.add_plugins(ToolsPlugin);
    let mut app = strict_app(app);
    let rig = app.world_mut().spawn(shipped("biped")).id();
    app.insert_resource(ActiveRig(rig)).insert_resource(Mode::Pose);
    let mut desk = Desk::of(app, rig, Sheet::Window, egui::vec2(SIZE.x, SIZE.y));
    desk.frames(4);
    let switch = desk.find("Move joints, too").rect;
    assert!(switch.right() > SIZE.x - 40.0 && switch.bottom() < 60.0, "{switch:?} covers what is posed");
}

#[test]
fn the_wheel_zooms_to_the_pointer() {
    let mut app = camera_app();
    let mut cameras = app.world_mut().query::<(Entity, &PanOrbitCamera, &GlobalTransform, &Projection, &RigViewport)>();
    let mut seen = |app: &App| {
        let (camera, orbit, place, projection, viewport) = cameras.single(app.world()).unwrap();
        let sight = Sight::new(place, projection, viewport, SIZE, &GlobalTransform::IDENTITY).unwrap();
        (camera, *orbit, sight)
    };
    let (camera, first, before) = seen(&app);
    let [viewport_size, window_size] = [Some(SIZE); 2];
    app.insert_resource(ActiveCameraData { entity: Some(camera), viewport_size, window_size, manual: true });
    for at in [Vec2::new(90.0, 60.0), Vec2::new(500.0, 470.0), SIZE * 0.5] {
        app.world_mut().resource_mut::<ViewportArea>().pointer = Some(at);
        let places = [0.8, 1.0, 1.3].map(|part| before.ray(at).at(part * first.target_radius));
        for (notches, left) in [(3.0, 0.512), (-3.0, 1.0)] {
            let (unit, window, phase) = (MouseScrollUnit::Line, Entity::PLACEHOLDER, TouchPhase::Moved);
            app.world_mut().write_message(MouseWheel { unit, x: 0.0, y: notches, window, phase });
            app.update();
            app.update();
            let (_, orbit, sight) = seen(&app);
            let part = orbit.target_radius / first.target_radius;
            assert!((part - left).abs() < 1e-3, "{part} of the distance is left after {notches} notches");
            for place in places {
                let now = sight.project(place).unwrap();
                assert!(now.distance(at) < 0.1, "{place} moved from {at} to {now} by {notches} notches");
            }
        }
        let (_, orbit, _) = seen(&app);
        assert!(orbit.target_focus.distance(first.target_focus) < 1e-3, "the way back leads elsewhere");
    }
    // With the pointer elsewhere, and by keys, nothing moves aside.
    app.world_mut().resource_mut::<ViewportArea>().pointer = None;
    app.update();
    let (_, orbit, _) = seen(&app);
    assert!(orbit.target_focus.distance(first.target_focus) < 1e-3);
}

#[test]
fn a_hint_about_the_pointer_goes_when_the_pointer_leaves_the_viewport() {
    let mut app = headless_app(1);
    app.add_plugins((ToolsPlugin, PointerPlugin)).add_message::<WindowEvent>();
    let mut bench = RigBench::with(strict_app(app), Rig::new(Uid(1), "rig"));
    bench.app.insert_resource(ActiveRig(bench.rig)).insert_resource(ViewportSight(Some(front())));
    let world = bench.app.world_mut();
    let window = world.spawn((Window::default(), PrimaryWindow)).id();
    world.spawn((EguiContext::default(), PrimaryEguiContext));
    let area = ViewportArea { min: Vec2::new(100.0, 50.0), size: Vec2::splat(800.0), scale: 1.0, pointer: None };
    bench.app.insert_resource(area);
    bench.open_body();
    bench.mode(Mode::Place);
    let send = |bench: &mut RigBench, event: WindowEvent| {
        bench.app.world_mut().write_message(event);
        bench.app.update();
        bench.app.update();
    };
    let move_to = |bench: &mut RigBench, position: Vec2| {
        send(bench, WindowEvent::CursorMoved(CursorMoved { window, position, delta: None }));
    };
    let hold = |bench: &mut RigBench, state: ButtonState| {
        send(bench, WindowEvent::MouseButtonInput(MouseButtonInput { button: MouseButton::Left, state, window }));
    };
    let (beside, panel) = (Vec2::new(130.0, 80.0), Vec2::new(40.0, 300.0));
    let is_told = |bench: &RigBench| {
        let status: &StatusLine = bench.status();
        status.obstacle.as_ref().is_some_and(|obstacle| obstacle.contains("beside the mesh"))
    };
    move_to(&mut bench, beside);
    assert!(is_told(&bench), "{:?}", bench.status());
    move_to(&mut bench, panel);
    assert!(!is_told(&bench), "the pointer is over a panel: {:?}", bench.status());

    // A drag that ends over a panel.
    move_to(&mut bench, beside);
    hold(&mut bench, ButtonState::Pressed);
    move_to(&mut bench, beside + Vec2::new(0.0, 30.0));
    move_to(&mut bench, panel);
    hold(&mut bench, ButtonState::Released);
    assert!(!is_told(&bench), "the drag ended over a panel: {:?}", bench.status());

    // A panel that comes over a resting pointer.
    move_to(&mut bench, beside);
    assert!(is_told(&bench), "{:?}", bench.status());
    bench.app.world_mut().resource_mut::<ViewportArea>().min.x = 200.0;
    bench.app.update();
    bench.app.update();
    assert!(!is_told(&bench), "a panel has come over the pointer: {:?}", bench.status());
}
