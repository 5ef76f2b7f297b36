//! Programs of built rigs: one control of a biped, and a thousand bipeds that move in every frame.
//!
//! Prints one JSON line; times are the least and the median of many frames. `--only NAME` runs one part, for a profiler.
//!
//! ```text
//! RIGSMITH_DATA=DATA cargo bench --no-default-features --bench runtime
//! ```
//!
//! `everything` goes from sampled controls over programs, propagation and joints in the world to skinning matrices;
//! `sampled_and_everything` also writes the poses of all controls first, as curves do. `foxes` is Bevy's example
//! `many_foxes` without drawing, its curves sampled too, to be compared with the latter by joints per microsecond.

use std::{
    hint::black_box,
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use bevy::{
    animation::{
        AnimatedBy, AnimationTargetId, animated_field,
        animation_curves::{AnimatableCurve, AnimatableKeyframeCurve},
    },
    asset::uuid::Uuid,
    ecs::system::RunSystemOnce,
    math::{Affine3A, Quat, Vec3},
    prelude::*,
    time::TimeUpdateStrategy,
};
use rayon::prelude::*;
use rigsmith::{
    files::{RealDisk, load_model, load_template},
    mesh::model::{Channel, ChannelTarget, Model, Trs},
    modules,
    plugins::runtime::{ControlPose, InstanceMode, NodeOf, NodeSlot, RigRuntime, RuntimePlugin, spawn_instance},
    processor::Builder,
    rig::{BuiltRig, NodeType, PoseOffset},
    solve::program::{CompileOptions, ExposedNode, Keep, LANES, Memory, RigProgram, RigState},
};

/// Instances in a crowd.
const CROWD: usize = 1000;

/// Frames that are timed.
const FRAMES: usize = 60;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let only = arguments.iter().position(|a| a == "--only").and_then(|i| arguments.get(i + 1));
    let wanted = |name: &str| only.is_none_or(|only| only == name);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates/biped.rig.ron");
    let rig = Builder::build(&load_template(&RealDisk, &path)?.rig, &Arc::new(modules::all()))?;
    let compile = |keep| RigProgram::compile(&rig, &CompileOptions { keep, ..CompileOptions::default() }).map(Arc::new);
    let all = compile(Keep::All)?;
    let game = compile(Keep::DeformAndExposed(vec![ExposedNode::Controls]))?;
    let joints = game.nodes().iter().filter(|node| node.kind == NodeType::Joint).count();
    let controls = controls(&game);
    let mut report = vec![
        format!("\"nodes\": {}", rig.nodes.len()),
        format!("\"joints\": {joints}"),
        format!("\"constraints\": {}", rig.constraints.len()),
        format!("\"controls\": {}", controls.len()),
        format!("\"operations\": [{}, {}]", all.operations(), game.operations()),
    ];
    let mut note =
        |name: &str, [least, median]: [f64; 2]| report.push(format!("\"{name}\": [{least:.3}, {median:.3}]"));

    if wanted("compile") {
        note("compile_us", timed(20, |_| drop(black_box(compile(Keep::All)))).map(|time| time * 1e6));
    }
    if wanted("one") {
        for name in ["hand_ik_l", "foot_ik_r", "index_l", "head", "torso", "root"] {
            let mut state = RigState::new(Arc::clone(&all));
            state.evaluate(0.0);
            let slot = slot(&rig, &all, name).ok_or("no such control")?;
            let times = timed(2000, |frame| {
                state.set_offset_at(slot, sample(frame, 3));
                state.evaluate(0.0);
            });
            note(&format!("one_control_us {name}"), times.map(|time| time * 1e6));
        }
    }
    if wanted("editor") {
        let mut app = app();
        let entity = app.world_mut().spawn(Transform::IDENTITY).id();
        spawn_instance(app.world_mut(), entity, &all, InstanceMode::Hierarchy);
        let slot = slot(&rig, &all, "hand_ik_l").ok_or("no such control")?;
        let control =
            app.world().get::<RigRuntime>(entity).and_then(|runtime| runtime.entity(slot)).ok_or("no entity")?;
        for _ in 0..3 {
            app.world_mut().run_schedule(PostUpdate);
        }
        let times = timed(500, |frame| {
            if let Some(mut transform) = app.world_mut().get_mut::<Transform>(control) {
                transform.translation.x = 0.7 + (frame as f32 * 0.1).sin() * 0.1;
            }
            app.world_mut().run_schedule(PostUpdate);
        });
        note("one_control_with_propagation_us", times.map(|time| time * 1e6));
    }
    if wanted("programs") {
        let mut states: Vec<RigState> =
            (0..CROWD).map(|_| RigState::with_memory(Arc::clone(&game), Memory::Results)).collect();
        let together = |states: &mut [RigState]| {
            let mut states = states.iter_mut();
            RigState::evaluate_together(std::array::from_fn(|_| states.next()), 0.016);
        };
        let programs = |parallel: bool, states: &mut Vec<RigState>| {
            let mut times = Vec::new();
            for frame in 0..FRAMES {
                for (number, state) in states.iter_mut().enumerate() {
                    for (at, control) in controls.iter().enumerate() {
                        state.set_offset_at(*control, sample(frame + number, at));
                    }
                }
                let start = Instant::now();
                if parallel {
                    states.par_chunks_mut(LANES).for_each(together);
                } else {
                    states.chunks_mut(LANES).for_each(together);
                }
                times.push(start.elapsed());
            }
            ends(times)
        };
        let mut others = states.clone();
        let one = programs(false, &mut states);
        let many = programs(true, &mut others);
        note("programs_one_core_ms", one.map(|time| time * 1e3));
        note("programs_ms", many.map(|time| time * 1e3));
        note("programs_joints_per_us", many.map(|time| (joints * CROWD) as f64 / (time * 1e6)));
        let is_equal = states.iter().zip(&others).all(|(a, b)| a.globals() == b.globals());
        note("threads_equal", [f64::from(u8::from(is_equal)); 2]);
    }
    if wanted("everything") {
        let times = everything(&game);
        let names = ["sample_ms", "frame_ms", "matrices_ms", "everything_ms", "sampled_and_everything_ms"];
        for (name, times) in names.iter().zip(&times) {
            note(name, times.map(|time| time * 1e3));
        }
        for (name, at) in [("everything_joints_per_us", 3), ("sampled_and_everything_joints_per_us", 4)] {
            note(name, times[at].map(|time| (joints * CROWD) as f64 / (time * 1e6)));
        }
    }
    if wanted("foxes") {
        match std::env::var_os("RIGSMITH_DATA") {
            Some(data) => {
                let fox = load_model(&RealDisk, &Path::new(&data).join("gltf_skinned/Fox.glb"))?;
                let (joints, times) = foxes(&fox).ok_or("the fox has no clip")?;
                note("foxes_everything_ms", times.map(|time| time * 1e3));
                note("foxes_joints_per_us", times.map(|time| (joints * CROWD) as f64 / (time * 1e6)));
            }
            None => eprintln!("foxes skipped: RIGSMITH_DATA names no folder with test meshes"),
        }
    }
    println!("{{{}}}", report.join(", "));
    Ok(())
}

/// Peer: Bevy's example `many_foxes` without drawing. A thousand foxes play a clip of their file through Bevy's own
/// animation, their transforms propagate, and skinning matrices are made. Joints of a fox, and seconds a frame.
fn foxes(fox: &Model) -> Option<(usize, [f64; 2])> {
    let clip = fox.clips.first()?;
    let target = |node: usize| AnimationTargetId(Uuid::from_u128(node as u128 + 1));
    let mut curves = AnimationClip::default();
    for Channel { target: what, times, values, .. } in &clip.channels {
        let vectors = || values.chunks_exact(3).map(Vec3::from_slice);
        match what {
            ChannelTarget::Translation(node) => {
                let curve = AnimatableKeyframeCurve::new(times.iter().copied().zip(vectors())).ok()?;
                let field = animated_field!(Transform::translation);
                curves.add_curve_to_target(target(*node), AnimatableCurve::new(field, curve));
            }
            ChannelTarget::Rotation(node) => {
                let turns = values.chunks_exact(4).map(Quat::from_slice);
                let curve = AnimatableKeyframeCurve::new(times.iter().copied().zip(turns)).ok()?;
                let field = animated_field!(Transform::rotation);
                curves.add_curve_to_target(target(*node), AnimatableCurve::new(field, curve));
            }
            _ => {}
        }
    }
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), TransformPlugin, AnimationPlugin))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(16)));
    app.finish();
    app.cleanup();
    let world = app.world_mut();
    let clip = world.resource_mut::<Assets<AnimationClip>>().add(curves);
    let (graph, index) = AnimationGraph::from_clip(clip);
    let graph = world.resource_mut::<Assets<AnimationGraph>>().add(graph);
    let joints: Vec<usize> = fox.skins.first()?.joints.clone();
    let mut placed: Vec<Vec<Entity>> = Vec::new();
    for number in 0..CROWD {
        let mut player = AnimationPlayer::default();
        player.play(index).repeat().seek_to(number as f32 * 0.001);
        let place = Transform::from_xyz((number % 40) as f32, 0.0, (number / 40) as f32);
        let rig = world.spawn((place, player, AnimationGraphHandle(graph.clone()))).id();
        let mut nodes: Vec<Entity> = Vec::new();
        for (number, node) in fox.nodes.iter().enumerate() {
            let Trs { translation, rotation, scale } = node.rest;
            let above = node.parent.map_or(rig, |parent| nodes[parent]);
            let place = Transform { translation, rotation, scale };
            nodes.push(world.spawn((place, ChildOf(above), target(number), AnimatedBy(rig))).id());
        }
        placed.push(joints.iter().map(|joint| nodes[*joint]).collect());
    }
    for _ in 0..5 {
        app.update();
    }
    let mut matrices = vec![Affine3A::IDENTITY; CROWD * joints.len()];
    let times = timed(FRAMES, |_| {
        app.update();
        skin(app.world_mut(), &placed, &mut matrices);
        black_box(&matrices);
    });
    Some((joints.len(), times))
}

/// Skinning matrices of all joints, each rig's in one piece, on all threads.
fn skin(world: &mut World, rigs: &[Vec<Entity>], matrices: &mut [Affine3A]) {
    let bind = Affine3A::from_translation(Vec3::Y);
    let globals = world.query::<&GlobalTransform>();
    let (world, joints) = (&*world, rigs.first().map_or(1, Vec::len).max(1));
    matrices.par_chunks_mut(joints).zip(rigs).for_each(|(matrices, rig)| {
        for (place, matrix) in globals.iter_many_manual(world, rig).zip(matrices) {
            *matrix = place.affine() * bind;
        }
    });
}

/// A pose that differs from frame to frame.
fn sample(frame: usize, control: usize) -> PoseOffset {
    let angle = 0.3 * ((frame as f32) * 0.13 + control as f32).sin();
    let moved = Vec3::new(0.03 * angle, 0.02 * angle, -0.03 * angle);
    PoseOffset { translation: moved, rotation: Quat::from_rotation_x(angle), scale: Vec3::ONE }
}

/// Slots of the controls.
fn controls(program: &RigProgram) -> Vec<usize> {
    (0..program.nodes().len()).filter(|slot| program.nodes()[*slot].kind == NodeType::Control).collect()
}

/// The slot of the first control with that name.
fn slot(rig: &BuiltRig, program: &RigProgram, name: &str) -> Option<usize> {
    let node = rig.nodes.iter().find(|node| node.kind == NodeType::Control && *node.name == *name)?;
    program.node(node.uid)
}

fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, TransformPlugin, RuntimePlugin))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(16)));
    app.finish();
    app.cleanup();
    app.update();
    app
}

/// A thousand bipeds: sampling, everything in `PostUpdate`, skinning matrices, the sum of the last two and of all.
fn everything(program: &Arc<RigProgram>) -> [[f64; 2]; 5] {
    let mut app = app();
    let rigs: Vec<Entity> = (0..CROWD)
        .map(|number| {
            let place = Transform::from_xyz((number % 40) as f32, 0.0, (number / 40) as f32);
            let rig = app.world_mut().spawn(place).id();
            spawn_instance(app.world_mut(), rig, program, InstanceMode::Direct);
            rig
        })
        .collect();
    let joints: Vec<Vec<Entity>> = rigs
        .iter()
        .map(|rig| {
            let runtime = app.world().get::<RigRuntime>(*rig);
            let slots = (0..program.nodes().len()).filter(|slot| program.nodes()[*slot].kind == NodeType::Joint);
            slots.filter_map(|slot| runtime.and_then(|runtime| runtime.entity(slot))).collect()
        })
        .collect();
    let mut matrices = vec![Affine3A::IDENTITY; joints.iter().map(Vec::len).sum()];
    let mut times = [const { Vec::new() }; 5];
    for frame in 0..FRAMES {
        let start = Instant::now();
        let _ = app.world_mut().run_system_once(move |mut poses: Query<(&mut ControlPose, &NodeSlot, &NodeOf)>| {
            poses.par_iter_mut().for_each(|(mut pose, slot, rig)| {
                *pose = sample(frame + rig.0.index().index() as usize, slot.0 as usize).into();
            });
        });
        let sampled = start.elapsed();
        app.world_mut().run_schedule(PostUpdate);
        let ran = start.elapsed();
        skin(app.world_mut(), &joints, &mut matrices);
        let all = start.elapsed();
        black_box(&matrices);
        // The first frames grow lists.
        if frame >= 5 {
            for (times, time) in times.iter_mut().zip([sampled, ran - sampled, all - ran, all - sampled, all]) {
                times.push(time);
            }
        }
    }
    times.map(ends)
}

/// Least and median seconds of calls.
fn timed(count: usize, mut call: impl FnMut(usize)) -> [f64; 2] {
    let times = (0..count).map(|frame| {
        let start = Instant::now();
        call(frame);
        start.elapsed()
    });
    ends(times.collect())
}

fn ends(mut times: Vec<Duration>) -> [f64; 2] {
    times.sort_unstable();
    [times[0].as_secs_f64(), times[times.len() / 2].as_secs_f64()]
}
