//! A character that falls and gets up again: its joints are handed over to physics and back.
//!
//! ```text
//! cargo run --example ragdoll
//! cargo run --example ragdoll -- --screenshot ragdoll.png
//! ```
//!
//! The physics are a few lines of this file: a point for each joint, rods between them, and a floor. With a physics engine,
//! its bodies write the [`OutsideTransform`]s instead.

mod common;

use bevy::prelude::*;
use rigsmith::{plugins::document::JointEntities, prelude::*};

/// Seconds at which the character falls, and at which it begins to get up.
const FALL: f32 = 1.0;
const RISE: f32 = 3.5;

/// A joint of the falling body.
struct Point {
    joint: Entity,
    place: Vec3,
    before: Vec3,
    /// Rotation when it began to fall.
    rotation: Quat,
    /// The first joint below, and the way to it when it began to fall.
    below: Option<(usize, Vec3)>,
}

/// A rod between two points: its length, and how much shorter it may become.
struct Rod {
    ends: [usize; 2],
    length: f32,
    least: f32,
}

#[derive(Resource, Default)]
struct Body {
    points: Vec<Point>,
    rods: Vec<Rod>,
}

fn main() -> AppExit {
    let mut app = common::app(&[(0.9, "-before"), (2.8, ""), (5.5, "-after")]);
    app.add_plugins((RigPlugins, DisplayPlugin, RigInstancePlugin::default()))
        .init_resource::<Body>()
        .add_systems(Startup, spawn)
        .add_systems(Update, (throw, step).chain())
        .run()
}

fn spawn(mut commands: Commands, files: TemplateFiles, mut uids: ResMut<UidSource>) -> Result {
    let rig = commands.spawn(RigSource::new(files.open("assets/templates/biped.rig.ron"))).id();
    let model = load_model(&RealDisk, "assets/models/biped.obj".as_ref())?;
    commands.spawn((RigMesh::new(uids.next_uid(), model, Vec::new()), SkinOf(rig)));
    commands.spawn(common::camera(Vec3::new(1.6, 1.3, 2.4), Vec3::new(0.0, 0.75, 0.2)));
    Ok(())
}

/// Hands the joints over after a while, with a push, and takes them back later.
fn throw(
    mut commands: Commands,
    rigs: Query<(Entity, &Rig, &JointEntities), With<BuildResult>>,
    places: Query<&GlobalTransform>,
    mut body: ResMut<Body>,
    time: Res<Time>,
    mut clock: Local<f32>,
) {
    let Ok((entity, rig, joints)) = rigs.single() else { return };
    if rig.skins().next().is_none() {
        return;
    }
    *clock += time.delta_secs();
    if *clock < FALL {
        return;
    }
    if body.points.is_empty() {
        *body = Body::of(rig, joints, &places);
    }
    // Getting up, the rig takes over little by little.
    let share = (1.0 - 0.8 * (*clock - RISE)).clamp(0.0, 1.0);
    commands.entity(entity).insert(HandOver { share });
}

impl Body {
    fn of(rig: &Rig, joints: &JointEntities, places: &Query<&GlobalTransform>) -> Self {
        let walked: Vec<_> = rig.walk().collect();
        let number = |uid: Uid| walked.iter().position(|joint| joint.data.uid == uid);
        let entities: Vec<Option<Entity>> = walked.iter().map(|joint| joints.get(joint.data.uid)).collect();
        let at =
            |number: usize| entities[number].and_then(|entity| places.get(entity).ok()).copied().unwrap_or_default();
        let mut body = Self::default();
        for (place, joint) in walked.iter().enumerate() {
            let Some(entity) = entities[place] else { continue };
            let (from, above) = (at(place), joint.parent.and_then(number));
            let below = joint.children.first().and_then(|child| number(*child));
            // The upper body is pushed more than the feet.
            let push = Vec3::new(0.004, 0.0, 0.02) * from.translation().y;
            body.points.push(Point {
                joint: entity,
                place: from.translation(),
                before: from.translation() - push,
                rotation: from.rotation(),
                below: below.map(|below| (below, at(below).translation() - from.translation())),
            });
            let mut rod = |end: usize, least: f32| {
                let length = at(end).translation().distance(from.translation());
                body.rods.push(Rod { ends: [place, end], length, least: least * length });
            };
            let Some(above) = above else { continue };
            rod(above, 1.0);
            // Limbs bend, but do not fold up; the trunk hardly bends.
            if let Some(over) = walked[above].parent.and_then(number) {
                rod(over, if from.translation().x.abs() < 0.15 { 0.95 } else { 0.6 });
            }
            for sibling in walked[above].children.iter().filter_map(|child| number(*child)).filter(|it| *it < place) {
                rod(sibling, 1.0);
            }
        }
        body
    }
}

/// Moves the points, and tells the joints where they are.
fn step(mut commands: Commands, mut body: ResMut<Body>, time: Res<Time>) {
    let Body { points, rods } = &mut *body;
    let dt = time.delta_secs().min(0.05);
    for point in points.iter_mut() {
        let next = point.place + (point.place - point.before) * 0.99 - Vec3::Y * 9.8 * dt * dt;
        point.before = std::mem::replace(&mut point.place, next);
    }
    for _ in 0..40 {
        for Rod { ends: [a, b], length, least } in rods.iter() {
            let way = points[*b].place - points[*a].place;
            let wanted = way.length().clamp(*least, *length);
            let pull = way * (0.5 * (1.0 - wanted / way.length().max(1e-4)));
            points[*a].place += pull;
            points[*b].place -= pull;
        }
        for point in points.iter_mut().filter(|point| point.place.y < 0.07) {
            point.place.y = 0.07;
            // The floor is rough.
            point.before = point.before.lerp(point.place, 0.05);
        }
    }
    for point in points.iter() {
        let turn = point.below.map_or(Quat::IDENTITY, |(below, way)| {
            let now = points[below].place - point.place;
            Quat::from_rotation_arc(way.normalize_or(Vec3::Y), now.normalize_or(Vec3::Y))
        });
        commands.entity(point.joint).insert(OutsideTransform(Isometry3d::new(point.place, turn * point.rotation)));
    }
}
