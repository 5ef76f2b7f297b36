//! One motion on three bodies, which walk in step: the biped as it is, one with short legs and long arms, and a child.
//!
//! ```text
//! cargo run --release --example retarget
//! cargo run --release --example retarget -- capture.bvh
//! cargo run --release --example retarget -- --screenshot retarget.png
//! ```
//!
//! Without a file the motion is a walk that is written here, of a skeleton with other names and another rest pose.

mod common;

use std::{
    f32::consts::{PI, TAU},
    fmt::Write,
    path::Path,
};

use bevy::prelude::*;
use rigsmith::{
    files::{load_motion, load_template},
    mesh::model::Model,
    plugins::{animation::ClipPlayer, commands::RigModules},
    prelude::*,
    processor::{Builder, Fitting, fitted_rig},
    rig::{
        animation::{joint_map::JointMap, motion::Motion},
        format::bvh::read_bvh,
    },
    solve::retarget::{RetargetSettings, retarget},
};

fn main() -> AppExit {
    let mut app = common::app(&[(2.0, "-before"), (2.25, "")]);
    app.add_plugins((RigPlugins, DisplayPlugin, RigInstancePlugin::default()))
        .add_systems(Startup, spawn)
        .add_systems(Update, walk)
        .run()
}

/// A body by what differs from the biped: factors of its legs, its arms, its head and of all of it.
struct Body {
    legs: f32,
    arms: f32,
    head: f32,
    size: f32,
}

const BODIES: [Body; 3] = [
    Body { legs: 0.7, arms: 1.25, head: 1.0, size: 1.0 },
    Body { legs: 1.0, arms: 1.0, head: 1.0, size: 1.0 },
    Body { legs: 0.85, arms: 0.85, head: 1.4, size: 0.65 },
];

impl Body {
    /// Place in this body of a point of the biped. The biped faces along Z, and stands with its arms half lowered.
    fn place(&self, mut point: Vec3) -> Vec3 {
        // Legs from the ankles to the hips; hands hang as low, but farther out.
        let (ankle, hip, is_leg) = (0.1, 0.9, point.x.abs() < 0.3);
        let below = if is_leg { (hip - point.y).clamp(0.0, hip - ankle) } else { 0.0 };
        point.y -= (1.0 - self.legs) * (hip - ankle - below);
        // Arms go down by about as much as they go out.
        let out = (self.arms - 1.0) * (point.x.abs() - 0.18).max(0.0);
        point += Vec3::new(out * point.x.signum(), -1.05 * out, 0.0);
        let neck = 1.46 - (1.0 - self.legs) * (hip - ankle);
        let share = ((point.y - neck) / 0.1).clamp(0.0, 1.0);
        let middle = Vec3::Y * neck;
        point = middle + (point - middle) * (1.0 + (self.head - 1.0) * share);
        point * self.size
    }
}

fn spawn(
    mut commands: Commands,
    modules: Res<RigModules>,
    mut templates: ResMut<Assets<RigTemplate>>,
    mut uids: ResMut<UidSource>,
) -> Result {
    let file = std::env::args().nth(1).filter(|word| !word.starts_with("--"));
    let motion: Motion = match file {
        Some(file) => load_motion(&RealDisk, Path::new(&file))?,
        None => read_bvh(walk_text()?.as_bytes(), "walk")?,
    };
    let biped = load_template(&RealDisk, "assets/templates/biped.rig.ron".as_ref())?.rig;
    let model: Model = load_model(&RealDisk, "assets/models/biped.obj".as_ref())?;
    for (number, body) in BODIES.iter().enumerate() {
        // The same rig and mesh in other proportions. For a mesh of your own, `Workbench::fit` finds the places of the joints.
        let places =
            biped.walk().map(|joint| joint.data.uid).map(|uid| (uid, body.place(biped.position(uid)))).collect();
        let mut rig = fitted_rig(&biped, &Fitting { places, ..default() }, &modules.0)?;
        let mut model = model.clone();
        model.points.iter_mut().for_each(|point| *point = body.place(*point));

        let map = JointMap::new(&motion, &rig, &[])?;
        let built = Builder::build(&rig, &modules.0)?;
        let settings = RetargetSettings { looped: true, ..default() };
        let done = retarget(&rig, &built, &motion, &map, &settings)?;
        let [before, after] = done.keys;
        println!("body {number}: {} bones, {after} keys of {before}", map.bones().count());

        rig.apply(&RigEdit::AddClip(Box::new(done.clip), 0))?;
        let place = Transform::from_xyz(1.3 * (number as f32 - 1.0), 0.0, -1.0);
        let entity = commands.spawn((RigSource::new(templates.add(RigTemplate::new(rig))), place)).id();
        commands.spawn((RigMesh::new(uids.next_uid(), model, Vec::new()), SkinOf(entity)));
    }
    commands.spawn(common::camera(Vec3::new(0.8, 1.3, 5.5), Vec3::new(0.0, 0.8, 0.4)));
    Ok(())
}

/// Lets all bodies walk in the same frame, once they are bound to their meshes.
fn walk(bodies: Query<(Entity, Option<&Rig>), (With<RigSource>, Without<ClipPlayer>)>, mut commands: Commands) {
    if bodies.iter().all(|(_, rig)| rig.is_some_and(|rig| rig.skins().next().is_some())) {
        for (entity, rig) in &bodies {
            if let Some(clip) = rig.and_then(|rig| rig.clips().first()) {
                commands.entity(entity).insert(ClipPlayer::new(clip));
            }
        }
    }
}

/// Length of the thigh, and of the shin, in centimetres.
const SHIN: f32 = 40.0;
/// Height of the hips above the ankles, but for the thigh and the shin.
const REST: f32 = 4.0;
/// Height of the ankles.
const ANKLE: f32 = 8.0;
/// Way of a double step, which takes a second.
const STEP: f32 = 88.0;

/// A skeleton in a T-pose: name, depth in the hierarchy, and offset from the joint above.
const SKELETON: [(&str, usize, [f32; 3]); 18] = [
    ("Hips", 0, [0.0, 2.0 * SHIN + REST + ANKLE, 0.0]),
    ("Spine", 1, [0.0, 12.0, 0.0]),
    ("Neck", 2, [0.0, 42.0, 0.0]),
    ("Head", 3, [0.0, 10.0, 0.0]),
    ("LeftArm", 2, [17.0, 36.0, 0.0]),
    ("LeftForeArm", 3, [28.0, 0.0, 0.0]),
    ("LeftHand", 4, [25.0, 0.0, 0.0]),
    ("RightArm", 2, [-17.0, 36.0, 0.0]),
    ("RightForeArm", 3, [-28.0, 0.0, 0.0]),
    ("RightHand", 4, [-25.0, 0.0, 0.0]),
    ("LeftUpLeg", 1, [9.0, -REST, 0.0]),
    ("LeftLeg", 2, [0.0, -SHIN, 0.0]),
    ("LeftFoot", 3, [0.0, -SHIN, 0.0]),
    ("LeftToeBase", 4, [0.0, -6.0, 13.0]),
    ("RightUpLeg", 1, [-9.0, -REST, 0.0]),
    ("RightLeg", 2, [0.0, -SHIN, 0.0]),
    ("RightFoot", 3, [0.0, -SHIN, 0.0]),
    ("RightToeBase", 4, [0.0, -6.0, 13.0]),
];

/// The walk as the text of a BVH file: three double steps.
fn walk_text() -> Result<String, std::fmt::Error> {
    let mut text = String::from("HIERARCHY\n");
    for (number, (name, depth, [x, y, z])) in SKELETON.into_iter().enumerate() {
        let (word, places) = if depth == 0 { ("ROOT", "6 Xposition Yposition Zposition") } else { ("JOINT", "3") };
        writeln!(text, "{word} {name} {{ OFFSET {x} {y} {z} CHANNELS {places} Xrotation Zrotation Yrotation")?;
        let next = SKELETON.get(number + 1).map_or(0, |(_, depth, _)| *depth);
        if next <= depth {
            let ends = "}".repeat(depth + 1 - next);
            writeln!(text, "End Site {{ OFFSET {} {} {} }} {ends}", x / 2.0, y.max(0.0) / 2.0, z / 2.0)?;
        }
    }
    let frames = 3 * common::FRAMES;
    writeln!(text, "MOTION\nFrames: {}\nFrame Time: {}", frames + 1, 1.0 / common::FRAMES as f32)?;
    for frame in 0..=frames {
        let phase = frame as f32 / common::FRAMES as f32;
        let swing = ops::cos(TAU * phase);
        // A body is lowest while both feet stand.
        let height = 76.0 - ops::cos(2.0 * TAU * phase);
        write!(text, "0 {} {} 0 0 0", height + REST + ANKLE, STEP * phase)?;
        write!(text, " 0 0 {} 0 0 0 0 0 0", 6.0 * swing)?;
        for side in [1.0, -1.0] {
            // Hanging arms swing against the legs, and the elbows bend to the front.
            write!(text, " {} {} 0 0 0 {} 0 0 0", 25.0 * side * swing, -75.0 * side, -25.0 * side)?;
        }
        for shift in [0.0, 0.5] {
            let [thigh, knee, ankle] = leg(height, (phase + shift).fract()).map(f32::to_degrees);
            write!(text, " {thigh} 0 0 {knee} 0 0 {ankle} 0 0 0 0 0")?;
        }
        writeln!(text)?;
    }
    Ok(text)
}

/// Angles of hip, knee and ankle at a moment of a double step: the foot stands for a half, and swings ahead in the other.
fn leg(height: f32, phase: f32) -> [f32; 3] {
    let swing = (2.0 * phase - 1.0).max(0.0);
    let ahead = STEP / 4.0 * if phase < 0.5 { 1.0 - 4.0 * phase } else { -ops::cos(PI * swing) };
    let way = Vec2::new(ahead, height - 9.0 * ops::sin(PI * swing));
    let knee = 2.0 * ops::acos((way.length() / (2.0 * SHIN)).min(1.0));
    let hip = -ops::atan2(way.x, way.y) - knee / 2.0;
    // The toes hang behind at first, and are lifted before the heel is set down.
    [hip, knee, 0.5 * ops::sin(TAU * swing) - hip - knee]
}
