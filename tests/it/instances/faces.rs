//! Expressions of instances by name.

use std::{collections::BTreeMap, path::Path};

use bevy::prelude::*;
use rigsmith::{
    instance::{ExpressFailed, RigInstancePlugin},
    plugins::{
        face::{ExpressError, Expressions},
        runtime::InstanceMode,
    },
};

use super::{AppBench, saved};

/// A head with a jaw and two corners of a mouth, and the poses of three shapes of ARKit and one of its own.
const FACE: &str = r#"(
    format: 2,
    name: "face",
    joints: [
        (uid: "00000000000000a1", label: "skull", translation: (0, 1, 0)),
        (uid: "00000000000000a2", label: "jaw", parent: "00000000000000a1", translation: (0, 0.1, 0),
            tags: [control(keep_pose: true, offset_group: false)]),
        (uid: "00000000000000a3", label: "lip_l", parent: "00000000000000a1", translation: (0.1, 0.1, 0.1),
            tags: [control(keep_pose: true, offset_group: false)]),
        (uid: "00000000000000a4", label: "lip_r", parent: "00000000000000a1", translation: (-0.1, 0.1, 0.1),
            tags: [control(keep_pose: true, offset_group: false)]),
    ],
    poses: [
        (uid: "00000000000000b1", name: "jawOpen", offsets: [
            (joint: "00000000000000a2", rotation: (0.17364818, 0.0, 0.0, 0.9848078)),
        ]),
        (uid: "00000000000000b2", name: "mouthSmileLeft", offsets: [
            (joint: "00000000000000a3", translation: (0.01, 0.02, 0.0)),
        ]),
        (uid: "00000000000000b3", name: "mouthSmileRight", offsets: [
            (joint: "00000000000000a4", translation: (-0.01, 0.02, 0.0)),
        ]),
        (uid: "00000000000000b4", name: "grin", offsets: [
            (joint: "00000000000000a3", translation: (0.0, 0.05, 0.0)),
        ]),
    ],
)
"#;

/// Reasons why expressions were not shown.
#[derive(Resource, Default)]
struct Failures(Vec<ExpressError>);

impl AppBench {
    /// Writes strengths to an instance, as a game does, and runs a frame.
    fn express(&mut self, instance: Entity, strengths: &[(&str, f32)]) {
        let strengths: BTreeMap<String, f32> =
            strengths.iter().map(|(name, strength)| ((*name).to_owned(), *strength)).collect();
        self.app.world_mut().entity_mut(instance).insert(Expressions(strengths));
        self.app.update();
    }

    fn global(&self, node: Entity) -> GlobalTransform {
        *self.app.world().get::<GlobalTransform>(node).unwrap()
    }
}

/// Strengths by name move the joints of a running instance in the same frame, and its face rests without them.
#[test]
fn an_instance_shows_expressions_by_name() {
    for mode in [InstanceMode::Hierarchy, InstanceMode::Direct] {
        let folder = tempfile::tempdir().unwrap();
        let more = |app: &mut App| {
            app.init_resource::<Failures>();
            app.add_observer(|failed: On<ExpressFailed>, mut failures: ResMut<Failures>| {
                failures.0.push(failed.error.clone());
            });
        };
        let mut game = AppBench::game_with(RigInstancePlugin::default(), Path::new("assets"), more);
        let instance = game.open(&saved(folder.path(), FACE), mode);
        let other = game.open(&saved(folder.path(), FACE), mode);
        let [jaw, left, right] = ["jaw", "lip_l", "lip_r"].map(|name| game.node(instance, name));
        let still = game.node(other, "lip_l");
        game.app.update();
        let rest = [left, right].map(|node| game.global(node).translation());
        let moved = |game: &AppBench| [0, 1].map(|side| game.global([left, right][side]).translation() - rest[side]);
        let near = |a: Vec3, b: Vec3| assert!(a.distance(b) < 1e-5, "{mode:?}: {a} beside {b}");

        // By the name of the unit, of one side of it, of ARKit, and of a stored pose.
        game.express(instance, &[("mouth_smile", 0.5)]);
        near(moved(&game)[0], Vec3::new(0.005, 0.01, 0.0));
        near(moved(&game)[1], Vec3::new(-0.005, 0.01, 0.0));
        game.express(instance, &[("mouth_smile_r", 1.0), ("grin", 1.0)]);
        near(moved(&game)[0], Vec3::new(0.0, 0.05, 0.0));
        near(moved(&game)[1], Vec3::new(-0.01, 0.02, 0.0));
        game.express(instance, &[("mouthSmileLeft", 1.5), ("jawOpen", 0.5)]);
        near(moved(&game)[0], Vec3::new(0.015, 0.03, 0.0));
        near(moved(&game)[1], Vec3::ZERO);
        let turned = game.global(jaw).rotation();
        assert!(turned.angle_between(Quat::from_rotation_x(10f32.to_radians())) < 2e-3, "{mode:?}: {turned}");
        near(game.global(still).translation(), rest[0]);

        // An expression whose units have no pose, and a name that nobody knows, change nothing and are told.
        for name in ["anger", "no_such_name"] {
            game.express(instance, &[(name, 1.0)]);
            near(moved(&game)[0], Vec3::new(0.015, 0.03, 0.0));
        }
        let told = &game.app.world().resource::<Failures>().0;
        assert!(
            matches!(&told[..], [ExpressError::NoPose { name, .. }, ExpressError::Unknown { .. }] if name == "anger"),
            "{told:?}"
        );

        game.express(instance, &[]);
        near(moved(&game)[0], Vec3::ZERO);
        game.express(instance, &[("mouth_smile", 1.0)]);
        near(moved(&game)[1], Vec3::new(-0.01, 0.02, 0.0));
        game.app.world_mut().entity_mut(instance).remove::<Expressions>();
        game.app.update();
        near(moved(&game)[1], Vec3::ZERO);
        assert!(game.global(jaw).rotation().angle_between(Quat::IDENTITY) < 1e-3);
    }
}
