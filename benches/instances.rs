//! Time from a saved file to a crowd that goes on with it.
//!
//! ```text
//! cargo bench --bench instances --no-default-features
//! ```
//!
//! A thousand instances of the bundled biped, all of them posed, in an app without window and renderer that runs frame after
//! frame. Each round saves the template's file with one parameter changed (beside and renamed) and measures, from the moment
//! at which the file is there, the time until the end of the frame in which every instance stands right, and how long that
//! frame took; frames in which nothing happens are measured, too. Prints medians and worst cases in milliseconds.

use std::{
    fs,
    path::Path,
    time::{Duration, Instant},
};

use bevy::{ecs::system::RunSystemOnce, prelude::*};
use rigsmith::{
    headless::headless_app,
    instance::{InstanceNodes, RigInstance, RigInstancePlugin, RigUpdated, TemplateFiles},
    plugins::runtime::{ControlPose, InstanceMode, RigRuntime},
};

const INSTANCES: usize = 1000;
const ROUNDS: usize = 30;

/// Number of instances that were told of an update.
#[derive(Resource, Default)]
struct Updates {
    instances: usize,
    commands: usize,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let templates = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/templates"));
    let folder = std::env::temp_dir().join(format!("rigsmith-instances-{}", std::process::id()));
    fs::create_dir_all(folder.join("parts"))?;
    let file = folder.join("biped.rig.ron");
    println!("{INSTANCES} instances, milliseconds");
    println!("{:<34} {:>8} {:>8} {:>8} {:>8} {:>8}", "", "saved", "worst", "frame", "worst", "idle");
    for mode in [InstanceMode::Direct, InstanceMode::Hierarchy] {
        for (name, changed, before, after) in [
            ("size of one control", "biped.rig.ron", "size: 0.573", "size: 0.6"),
            ("size in a part of both hands", "parts/hand.rig.ron", "relative_size: 0.35", "relative_size: 0.36"),
            ("stretch of the thumbs", "parts/hand.rig.ron", "weight: \"ik\"", "weight: \"ik\", max_stretch: 1.4"),
            ("softness of the thumbs", "parts/hand.rig.ron", "weight: \"ik\"", "weight: \"ik\", soft: 0.1"),
        ] {
            for file in ["biped.rig.ron", "parts/hand.rig.ron"] {
                fs::copy(templates.join(file), folder.join(file))?;
            }
            let changed = folder.join(changed);
            let text = fs::read_to_string(&changed)?;
            if !text.contains(before) {
                println!("{mode:?}, {name}: not in the template");
                continue;
            }
            let other = text.replacen(before, after, 1);
            let told = measured(&file, &changed, &[text.as_str(), other.as_str()], mode)?;
            println!("{:<34} {told}", format!("{mode:?}, {name}"));
        }
    }
    fs::remove_dir_all(folder)?;
    Ok(())
}

/// Times of saves of `changed`, the template's own file or that of a part.
fn measured(
    file: &Path,
    changed: &Path,
    texts: &[&str; 2],
    mode: InstanceMode,
) -> Result<String, Box<dyn std::error::Error>> {
    let mut app = headless_app(1);
    app.add_plugins(RigInstancePlugin::live()).init_resource::<Updates>();
    app.add_observer(|updated: On<RigUpdated>, mut updates: ResMut<Updates>| {
        updates.instances += 1;
        updates.commands = updated.ran.len();
    });
    app.finish();
    app.cleanup();
    let path = file.to_owned();
    let template = app
        .world_mut()
        .run_system_once(move |files: TemplateFiles| files.open(path.clone()))
        .map_err(|error| error.to_string())?;
    let instances: Vec<Entity> =
        (0..INSTANCES).map(|_| app.world_mut().spawn((RigInstance(template.clone()), mode)).id()).collect();
    while !instances.iter().all(|instance| app.world().get::<RigRuntime>(*instance).is_some()) {
        app.update();
    }
    for (number, instance) in instances.into_iter().enumerate() {
        let found = app.world_mut().run_system_once(move |nodes: InstanceNodes| nodes.find(instance, "hand_ik_l"));
        let hand = found.map_err(|error| error.to_string())?.ok_or("there is no control of the hand")?;
        let lift = 0.001 * (number % 100) as f32;
        match mode {
            InstanceMode::Direct => app.world_mut().get_mut::<ControlPose>(hand).ok_or("no pose")?.translation.y = lift,
            InstanceMode::Hierarchy => {
                app.world_mut().get_mut::<Transform>(hand).ok_or("no pose")?.translation.y += lift
            }
        }
    }
    for _ in 0..5 {
        app.update();
    }
    let (mut saved, mut frames, mut idle) = (Vec::new(), Vec::new(), Vec::new());
    for round in 1..=ROUNDS {
        // At any time between two looks.
        std::thread::sleep(Duration::from_millis(60) + Duration::from_micros(700 * round as u64));
        idle.push(frame(&mut app));
        *app.world_mut().resource_mut::<Updates>() = Updates::default();
        let beside = changed.with_extension("tmp");
        fs::write(&beside, texts[round % 2])?;
        fs::rename(beside, changed)?;
        let start = Instant::now();
        loop {
            let frame = frame(&mut app);
            if app.world().resource::<Updates>().instances == INSTANCES {
                saved.push(start.elapsed());
                frames.push(frame);
                break;
            }
        }
    }
    let commands = app.world().resource::<Updates>().commands;
    let sorted = |mut times: Vec<Duration>| -> [f64; 2] {
        times.sort_unstable();
        [times[times.len() / 2], times[times.len() - 1]].map(|time| time.as_secs_f64() * 1e3)
    };
    let ([saved, slowest], [frame, longest], [idle, _]) = (sorted(saved), sorted(frames), sorted(idle));
    Ok(format!("{saved:>8.2} {slowest:>8.2} {frame:>8.2} {longest:>8.2} {idle:>8.2}  ({commands} commands ran)"))
}

fn frame(app: &mut App) -> Duration {
    let start = Instant::now();
    app.update();
    start.elapsed()
}
