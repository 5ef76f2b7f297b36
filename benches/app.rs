//! Times of one change of a built rig in an app, from the write to the entities.
//!
//! ```text
//! cargo bench --bench app --no-default-features
//! cargo bench --bench app --no-default-features -- ik_handle
//! cargo bench --bench app --no-default-features -- one_thread
//! ```
//!
//! With `one_thread` all systems run one after the other, so that the times hold their work without the waking of threads
//! that Bevy's executor hands them to.
//!
//! The bundled biped in an app with `RigPlugins` and no window, built and at rest. Each round makes one change and runs one
//! `App::update`; rounds alternate with updates in which nothing happens, whose median is subtracted. Prints median and
//! 95th percentile in milliseconds, and, for edits, the commands that ran.

use std::time::{Duration, Instant};

use bevy::{
    ecs::schedule::{ScheduleLabel, SingleThreadedExecutor},
    prelude::*,
};
use rigsmith::{
    files::{RealDisk, load_template},
    headless::headless_app,
    plugins::{
        commands::{BuildDone, BuildRequest, BuildResult, BuildStep, BuiltEntities},
        schema::Attributes,
    },
    prelude::*,
    rig::{Matching, PoseOffset, TagData, TagKind},
};

const ROUNDS: usize = 400;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/templates/biped.rig.ron"));
    let mut app = headless_app(1);
    app.finish();
    app.cleanup();
    let rig = app.world_mut().spawn(load_template(&RealDisk, file)?.rig).id();
    app.update();
    app.world_mut().write_message(BuildRequest { rig, step: BuildStep::All });
    (0..20).for_each(|_| app.update());
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    if arguments.iter().any(|argument| argument == "one_thread") {
        for label in [PreUpdate.intern(), Update.intern(), PostUpdate.intern(), Last.intern()] {
            app.edit_schedule(label, |schedule| {
                schedule.set_executor(SingleThreadedExecutor::new());
            });
        }
    }
    let filter = arguments.into_iter().find(|argument| argument != "one_thread");
    let mut bench = Bench { app, rig, filter };
    let built = bench.app.world().get::<BuildResult>(rig).ok_or("the rig is not built")?.0.clone();
    let goal = built.switches.iter().find_map(|switch| match switch.matching {
        Matching::IkFk { goal, .. } => Some((goal, switch.control, switch.attribute.clone())),
        Matching::Space { .. } => None,
    });
    let (goal, holder, attribute) = goal.ok_or("no limb has inverse kinematics")?;
    let entities = bench.app.world().get::<BuiltEntities>(rig).ok_or("nothing is built")?;
    let control = entities.get(goal).ok_or("the control has no entity")?;
    let holder = entities.get(holder).ok_or("the switch has no entity")?;

    println!("{} nodes, {} constraints", built.nodes.len(), built.constraints.len());
    println!("{:<44} {:>8} {:>8} {:>8}", "milliseconds more than an idle update", "median", "95 %", "commands");
    bench.measure("pose a hand through its Transform", |app, round| {
        if let Some(mut transform) = app.world_mut().get_mut::<Transform>(control) {
            transform.translation.y += if round % 2 == 0 { 0.05 } else { -0.05 };
        }
    });
    bench.measure("pose a hand through the document", |app, round| {
        let translation = Vec3::new(0.0, 0.05 * (round % 2) as f32, 0.0);
        let offset = PoseOffset { translation, ..PoseOffset::IDENTITY };
        app.world_mut().write_message(EditRequest::operation(rig, Operation::Pose(vec![(goal, offset)])));
    });
    bench.measure("turn a switch", |app, round| {
        if let Some(mut values) = app.world_mut().get_mut::<Attributes>(holder) {
            values.0.insert(attribute.to_string(), (round % 2) as f32);
        }
    });
    for module in ["control", "ik_handle", "twist"] {
        let Some((joint, tag)) = tag_of(&bench, module) else { continue };
        bench.measure(&format!("edit one parameter of a command: {module}"), |app, round| {
            let mut tag = tag.clone();
            if let TagKind::Command { params, .. } = &mut tag.kind
                && round % 2 == 0
            {
                *params = changed(module, params);
            }
            let edit = RigEdit::SetTag(joint, Box::new(tag));
            app.world_mut().write_message(EditRequest::operation(rig, Operation::Edits(vec![edit])));
        });
    }
    Ok(())
}

/// The last command of a module.
fn tag_of(bench: &Bench, module: &str) -> Option<(Uid, TagData)> {
    let rig = bench.app.world().get::<Rig>(bench.rig)?;
    let is_meant = |tag: &&TagData| {
        matches!(&tag.kind, TagKind::Command { module: known, params, .. }
        if **known == *module && !params.contains("shape_scale") && !params.contains("max_stretch"))
    };
    let tags = rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| (joint.data.uid, tag)));
    tags.filter(|(_, tag)| is_meant(tag)).last().map(|(joint, tag)| (joint, tag.clone()))
}

/// Parameters with one value changed that the tag leaves out.
fn changed(module: &str, params: &str) -> String {
    let more = match module {
        "control" => "shape_scale: (1.0, 1.1, 1.0)",
        "ik_handle" => "max_stretch: 1.4",
        _ => "shares: []",
    };
    let inner = params.trim().trim_end_matches(')').trim_end().trim_end_matches(',');
    // Closing brackets of the last value went with the outer one.
    let open = inner.matches('(').count() - inner.matches(')').count();
    format!("{inner}{}, {more})", ")".repeat(open - 1))
}

struct Bench {
    app: App,
    rig: Entity,
    /// Text that the names of the measured changes contain.
    filter: Option<String>,
}

impl Bench {
    fn measure(&mut self, name: &str, mut change: impl FnMut(&mut App, usize)) {
        if !self.filter.as_ref().is_none_or(|filter| name.contains(filter)) {
            return;
        }
        let (mut busy, mut idle) = (Vec::new(), Vec::new());
        let mut commands = 0;
        self.app.world_mut().resource_mut::<Messages<BuildDone>>().clear();
        for round in 0..ROUNDS {
            change(&mut self.app, round);
            busy.push(self.update());
            let done = self.app.world_mut().resource_mut::<Messages<BuildDone>>().drain().last();
            commands = commands.max(done.map_or(0, |done| done.report.executed.len()));
            self.app.update();
            idle.push(self.update());
        }
        busy.sort_unstable();
        idle.sort_unstable();
        let rest = idle[ROUNDS / 2];
        let more = |share: usize| busy[ROUNDS * share / 100].saturating_sub(rest).as_secs_f64() * 1e3;
        println!("{name:<44} {:>8.3} {:>8.3} {commands:>8}", more(50), more(95));
    }

    fn update(&mut self) -> Duration {
        let start = Instant::now();
        self.app.update();
        start.elapsed()
    }
}
