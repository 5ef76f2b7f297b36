//! A viewport without a window: where it is seen from, what the hand on the pointer holds, and the bundled character in it.

use bevy::prelude::*;
use rigsmith::{
    editor::{
        ActiveRig,
        actions::{Action, ActionRequest},
        camera::ViewportSight,
        mode::Mode,
        notice::{Notice, StatusLine},
        pointer::{ModifierKeys, PointerAct, ViewportPointer},
        tools::ToolsPlugin,
    },
    files::{RealDisk, load_model},
    headless::headless_app,
    plugins::viewport::{RigViewport, Sight},
    prelude::*,
    test_app::strict_app,
};

use crate::bench::RigBench;

/// The mesh of [`RigBench::open_body`].
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

impl RigBench {
    /// An empty rig that is open in an app with the tools, seen from its front.
    pub fn with_tools() -> Self {
        let mut app = headless_app(1);
        app.add_plugins(ToolsPlugin);
        let mut bench = Self::with(strict_app(app), Rig::new(Uid(1), "rig"));
        bench.app.insert_resource(ActiveRig(bench.rig)).insert_resource(ViewportSight(Some(front())));
        bench
    }

    /// Gives the rig the bundled character's mesh, and waits until it can be pointed at.
    pub fn open_body(&mut self) -> Entity {
        let model = load_model(&RealDisk, "assets/models/biped.obj".as_ref()).unwrap();
        let mesh = self.app.world_mut().spawn((RigMesh::new(MESH, model, Vec::new()), SkinOf(self.rig))).id();
        self.wait("the surface", |bench| bench.surface().is_some_and(|surface| surface.ready().is_some()));
        mesh
    }

    pub fn mode(&mut self, mode: Mode) {
        self.app.insert_resource(mode);
        self.app.update();
    }

    pub fn act(&mut self, action: Action) {
        self.send(ActionRequest(action));
    }

    /// One frame in which the pointer does all this.
    pub fn point(&mut self, held: ModifierKeys, acts: &[(Vec2, PointerAct)]) {
        for (at, act) in acts {
            self.app.world_mut().write_message(ViewportPointer { at: *at, act: *act, held });
        }
        self.app.update();
    }

    pub fn selected(&self) -> Vec<Uid> {
        self.get::<Selection>(self.rig).unwrap().0.clone()
    }

    /// Selects joints and created nodes.
    pub fn select(&mut self, nodes: &[Uid]) {
        self.app.world_mut().get_mut::<Selection>(self.rig).unwrap().0 = nodes.to_vec();
        self.app.update();
    }

    pub fn status(&self) -> &StatusLine {
        self.app.world().resource()
    }

    pub fn notices(&mut self) -> Vec<Notice> {
        self.messages()
    }
}
