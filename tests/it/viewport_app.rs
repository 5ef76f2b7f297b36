//! A viewport without a window: where it is seen from, what the hand on the pointer holds, and the bundled character in it.

use bevy::prelude::*;
use rigsmith::{
    editor::{
        ActiveRig,
        camera::ViewportSight,
        pointer::{ModifierKeys, PointerAct},
        tools::ToolsPlugin,
    },
    files::{RealDisk, load_model},
    headless::headless_app,
    plugins::viewport::{RigViewport, Sight},
    prelude::*,
    test_app::strict_app,
};

use crate::bench::wait;

/// The mesh of [`open_body`].
pub const MESH: Uid = Uid(99);

pub const PLAIN: ModifierKeys = ModifierKeys { shift: false, control: false, alt: false };
pub const SHIFT: ModifierKeys = ModifierKeys { shift: true, ..PLAIN };
pub const CONTROL: ModifierKeys = ModifierKeys { control: true, ..PLAIN };
pub const DROPPED: PointerAct = PointerAct::Released { dragged: true, count: 1 };

/// The bundled character from its front.
pub fn front() -> Sight {
    let camera = Transform::from_xyz(0.0, 0.9, 4.0).looking_at(Vec3::Y * 0.9, Vec3::Y);
    let projection = Projection::Perspective(PerspectiveProjection { fov: 0.55, ..default() });
    let viewport = RigViewport { focus: 4.0 };
    Sight::new(&camera.into(), &projection, &viewport, Vec2::splat(800.0), &GlobalTransform::IDENTITY).unwrap()
}

/// An app with the tools, in which an empty rig is open.
pub fn tools_app() -> (App, Entity) {
    let mut app = headless_app(1);
    app.add_plugins(ToolsPlugin);
    let mut app = strict_app(app);
    let rig = app.world_mut().spawn(Rig::new(Uid(1), "rig")).id();
    app.insert_resource(ActiveRig(rig)).insert_resource(ViewportSight(Some(front())));
    (app, rig)
}

/// Gives a rig the bundled character's mesh, and waits until it can be pointed at.
pub fn open_body(app: &mut App, rig: Entity) -> Entity {
    let model = load_model(&RealDisk, "assets/models/biped.obj".as_ref()).unwrap();
    let mesh = app.world_mut().spawn((RigMesh::new(MESH, model, Vec::new()), SkinOf(rig))).id();
    wait(app, "the surface", App::update, |app| {
        app.world().get::<RigSurface>(rig).is_some_and(|surface| surface.ready().is_some())
    });
    mesh
}
