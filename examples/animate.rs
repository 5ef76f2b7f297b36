//! A clip on a character, played by Bevy's own animation, and a motion of the game on top: it dances, and looks at a ball.
//!
//! ```text
//! cargo run --example animate
//! cargo run --example animate -- --screenshot animate.png
//! ```
//!
//! The picture has a second one beside it, `animate-before.png`, from a moment before.

mod common;

use std::{
    f32::consts::{FRAC_PI_3, PI, TAU},
    sync::Arc,
};

use bevy::{app::AnimationSystems, prelude::*};
use rigsmith::{
    plugins::{
        animation::{ClipTargets, animation_clip},
        runtime::RigRuntime,
    },
    prelude::*,
    rig::{
        BuiltRig,
        animation::{Key, Property, RigClip, Track, TrackTarget},
    },
};

/// Seconds of the clip, which is played over and over.
const SECONDS: f32 = 2.0;
/// Keys of each track of the clip.
const KEYS: usize = 24;

/// The thing that the character looks at.
#[derive(Component)]
struct Ball;

fn main() -> AppExit {
    let mut app = common::app(&[(2.0, "-before"), (3.0, "")]);
    app.add_plugins((RigPlugins, DisplayPlugin, RigInstancePlugin::default()))
        .add_systems(Startup, spawn)
        .add_systems(Update, (dance, circle))
        // Bevy has written the pose of the clip, and the rig is not evaluated yet.
        .add_systems(PostUpdate, look.after(AnimationSystems).before(RigSystems::Solve))
        .run()
}

fn spawn(
    mut commands: Commands,
    files: TemplateFiles,
    mut uids: ResMut<UidSource>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) -> Result {
    let rig = commands.spawn(RigSource::new(files.open("assets/templates/biped.rig.ron"))).id();
    let model = load_model(&RealDisk, "assets/models/biped.obj".as_ref())?;
    commands.spawn((RigMesh::new(uids.next_uid(), model, Vec::new()), SkinOf(rig)));
    let (sphere, red) = (meshes.add(Sphere::new(0.08)), materials.add(Color::srgb(0.8, 0.2, 0.15)));
    commands.spawn((Ball, Mesh3d(sphere), MeshMaterial3d(red), Transform::default()));
    commands.spawn(common::camera(Vec3::new(1.0, 1.5, 3.2), Vec3::new(0.0, 0.95, 0.0)));
    Ok(())
}

/// Uid of the control with that name.
fn control(built: &BuiltRig, name: &str) -> Option<Uid> {
    built.nodes.iter().find(|node| node.control.is_some() && &*node.name == name).map(|node| node.uid)
}

/// Gives a character its clip, once it is built and bound to its mesh.
fn dance(
    rigs: Query<(Entity, &Rig, &BuildResult, &RigRuntime), Without<AnimationPlayer>>,
    mut uids: ResMut<UidSource>,
    mut clips: ResMut<Assets<AnimationClip>>,
    mut graphs: ResMut<Assets<AnimationGraph>>,
    mut commands: Commands,
) {
    for (entity, rig, built, runtime) in &rigs {
        if rig.skins().next().is_none() {
            continue;
        }
        let clip = dance_clip(&built.0, &mut uids);
        // Bevy finds the nodes by their uids; a graph of your own may blend further clips.
        let clip = clips.add(animation_clip(&clip, runtime.state().program(), runtime.mode()));
        let (graph, index) = AnimationGraph::from_clip(clip);
        let mut player = AnimationPlayer::default();
        player.play(index).repeat();
        commands.entity(entity).insert((ClipTargets, player, AnimationGraphHandle(graphs.add(graph))));
    }
}

/// A clip with keys on controls: knees bend and the chest turns on each beat, the arms swing, the head nods.
fn dance_clip(built: &BuiltRig, uids: &mut UidSource) -> RigClip {
    let mut clip = RigClip::new(uids.next_uid(), uids.next_uid(), "dance");
    clip.range = [0.0, SECONDS];
    let tracks = &mut clip.layers[0].tracks;
    let mut track = |name: &str, property: Property, key: &dyn Fn(f32, f32) -> Key| {
        let Some(node) = control(built, name) else { return };
        let at = |number: usize| number as f32 / KEYS as f32;
        let keys = (0..=KEYS).map(|number| key(SECONDS * at(number), TAU * at(number))).collect();
        tracks.insert(TrackTarget { node, property }, Arc::new(Track { keys }));
    };
    // Values are those of poses: offsets from the place of the control at rest.
    track("torso", Property::Translation, &|time, turn| {
        Key::vector(time, Vec3::new(0.05 * ops::sin(turn), -0.07 + 0.04 * ops::cos(2.0 * turn), 0.0))
    });
    track("chest_ik", Property::Rotation, &|time, turn| {
        Key::rotation(time, Quat::from_rotation_y(0.25 * ops::sin(turn)))
    });
    track("head", Property::Rotation, &|time, turn| {
        Key::rotation(time, Quat::from_rotation_x(0.12 * ops::sin(2.0 * turn)))
    });
    for (hand, side) in [("hand_ik_l", 1.0), ("hand_ik_r", -1.0)] {
        track(hand, Property::Translation, &|time, turn| {
            Key::vector(time, Vec3::new(0.0, -0.1, 0.12 + 0.12 * side * ops::sin(turn)))
        });
    }
    clip
}

/// Moves the ball in a circle before the character.
fn circle(mut ball: Single<&mut Transform, With<Ball>>, time: Res<Time>) {
    let (sine, cosine) = ops::sin_cos(PI * time.elapsed_secs());
    ball.translation = Vec3::new(0.55 * cosine, 1.5 + 0.3 * sine, 0.6);
}

/// Turns the head towards the ball, on top of what the clip does with it.
fn look(
    rigs: Query<(Entity, &BuildResult), With<AnimationPlayer>>,
    nodes: InstanceNodes,
    places: Query<&GlobalTransform>,
    parents: Query<&ChildOf>,
    ball: Single<&Transform, With<Ball>>,
    mut heads: Query<&mut Transform, Without<Ball>>,
) {
    for (rig, built) in &rigs {
        let Some(head) = control(&built.0, "head").and_then(|head| nodes.find_uid(rig, head)) else { continue };
        let (Ok(place), Ok(parent)) = (places.get(head), parents.get(head)) else { continue };
        let (Ok(parent), Ok(mut transform)) = (places.get(parent.parent()), heads.get_mut(head)) else { continue };
        // The character faces along Z. A neck turns so far and no further.
        let way = (ball.translation - place.translation()).normalize_or(Vec3::Z);
        let (axis, angle) = Quat::from_rotation_arc(Vec3::Z, way).to_axis_angle();
        let turn = Quat::from_axis_angle(axis, angle.min(FRAC_PI_3));
        // The control's own transform is told in the space of its parent.
        let space = parent.rotation();
        transform.rotation = (space.inverse() * turn * space * transform.rotation).normalize();
    }
}
