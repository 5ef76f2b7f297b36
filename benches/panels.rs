//! Time that each panel of the window takes in a frame: egui's pass and the tessellation of what it draws, on the CPU.
//!
//! ```text
//! cargo bench --bench panels
//! cargo bench --bench panels -- Graph
//! ```
//!
//! A rig of 200 joints with 1000 commands, of which each other one refers to the one before, built, a long history, 60
//! stored poses, a clip with 10,000 keys, the bundled body with weights of all joints, 200 of its points and 100 joints
//! selected. A row for each panel has the medians over 300 frames, in milliseconds: while nothing happens, with the pointer
//! moving over it, and with a rig that changes before each frame, which is what a panel does while a value is dragged.
//! `asks` is the number of idle frames after which it asked for another one at once, which has to be 0: the window sleeps
//! then. Below the panels stand the medians of their rows, and the whole window as the dock draws it by default, with the
//! timeline open. `over` marks a row with a median above its target, or with frames that were asked for.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use bevy::prelude::*;
use bevy_egui::{EguiContext, EguiPrimaryContextPass, PrimaryEguiContext, egui};
use rigsmith::{
    editor::{
        ActiveRig,
        actions::ActionRequest,
        dock::DockPlugin,
        files::{FilesPlugin, OpenRequest, StateFolder},
        panel::{Panels, Requests},
        panels::{PanelsPlugin, timeline::TimelineRequest},
        tools::paint::SelectedPoints,
    },
    files::{RealDisk, load_model},
    headless::headless_app,
    mesh::model::Weights,
    plugins::commands::{BuildRequest, BuildResult, BuildStep},
    prelude::*,
    rig::{
        JointData, RestTransform, SkinData, TagData, TagKind,
        animation::{Key, Property, RigClip, Track, TrackTarget},
        reference::NodeRef,
    },
};

const JOINTS: usize = 200;
const COMMANDS: usize = 5;
const TRACKS: usize = 100;
const KEYS: usize = 100;
const FRAMES: usize = 300;
const POINTS: u32 = 200;
const CLIP: Uid = Uid(0x5A_0002);
const MESH: Uid = Uid(0x5A_0004);
/// Panels below the viewport.
const WIDE: [&str; 4] = ["Timeline", "Curves", "Graph", "Log"];
/// Panels that show all keys or all commands.
const LARGE: [&str; 3] = ["Timeline", "Curves", "Graph"];
/// Largest median of a panel, and of one that shows all keys or all commands.
const TARGETS: [Duration; 2] = [Duration::from_millis(2), Duration::from_millis(4)];

fn joint(number: usize) -> Uid {
    Uid(0x1000 + number as u64)
}

fn tag(number: usize) -> Uid {
    Uid(0x10_0000 + number as u64)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::temp_dir().join(format!("rigsmith-bench-panels-{}", std::process::id()));
    let mut bench = Bench::new(folder.clone())?;
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    let is_meant =
        |name: &str| arguments.is_empty() || arguments.iter().any(|argument| name.contains(argument.as_str()));
    println!("{JOINTS} joints, {} commands, {} keys", JOINTS * COMMANDS, TRACKS * KEYS);
    println!(
        "{:<12} {:>10} {:>10} {:>10} {:>10} {:>6}",
        "milliseconds", "idle", "pointed", "changing", "target", "asks"
    );
    let mut rows = Vec::new();
    let count = bench.app.world().resource::<Panels>().panels.len();
    for number in 0..count {
        let name = bench.app.world().resource::<Panels>().panels[number].title();
        if is_meant(name) {
            let row = bench.panel(number, name);
            row.print(name, Some(TARGETS[usize::from(LARGE.contains(&name))]));
            rows.push(row);
        }
    }
    if rows.len() > 1 {
        Row::median_of(&rows).print("median", None);
    }
    if is_meant("window")
        && let Some(row) = bench.window()
    {
        row.print("window", Some(TARGETS[1]));
    }
    // Nothing is lost if the folder stays.
    let _ = std::fs::remove_dir_all(folder);
    Ok(())
}

struct Bench {
    app: App,
    rig: Entity,
}

/// Medians of a panel.
struct Row {
    idle: Duration,
    pointed: Duration,
    changing: Duration,
    asks: usize,
}

impl Row {
    /// Medians of the medians of panels, and the sum of the frames that they asked for.
    fn median_of(rows: &[Self]) -> Self {
        Self {
            idle: median(rows.iter().map(|row| row.idle).collect()),
            pointed: median(rows.iter().map(|row| row.pointed).collect()),
            changing: median(rows.iter().map(|row| row.changing).collect()),
            asks: rows.iter().map(|row| row.asks).sum(),
        }
    }

    fn print(&self, name: &str, target: Option<Duration>) {
        let times = [self.idle, self.pointed, self.changing];
        let [idle, pointed, changing] = times.map(|time| time.as_secs_f64() * 1e3);
        let most = target.map_or_else(|| "-".to_owned(), |target| target.as_millis().to_string());
        let is_over = target.is_some_and(|target| times.iter().any(|time| *time > target) || self.asks > 0);
        let mark = if is_over { " over" } else { "" };
        println!("{name:<12} {idle:>10.3} {pointed:>10.3} {changing:>10.3} {most:>10} {:>6}{mark}", self.asks);
    }
}

fn median(mut times: Vec<Duration>) -> Duration {
    times.sort_unstable();
    times.get(times.len() / 2).copied().unwrap_or_default()
}

impl Bench {
    fn new(folder: std::path::PathBuf) -> Result<Self, Box<dyn std::error::Error>> {
        let mut app = headless_app(1);
        app.insert_resource(StateFolder(Some(folder)))
            .add_plugins((FilesPlugin, PanelsPlugin, DockPlugin))
            .add_message::<ActionRequest>()
            .add_message::<AppExit>();
        app.finish();
        app.cleanup();
        app.world_mut().write_message(OpenRequest::Empty);
        let started = Instant::now();
        while !app.world().contains_resource::<ActiveRig>() {
            app.update();
            if started.elapsed() > Duration::from_secs(60) {
                return Err("no rig is open".into());
            }
        }
        let rig = app.world().resource::<ActiveRig>().0;
        let mut bench = Self { app, rig };
        bench.fill()?;
        if bench.app.world().get::<BuildResult>(rig).is_none() {
            return Err("the rig is not built".into());
        }
        Ok(bench)
    }

    fn edit(&mut self, edits: Vec<RigEdit>) {
        self.operate(Operation::Edits(edits));
    }

    fn operate(&mut self, operation: Operation) {
        self.app.world_mut().write_message(EditRequest::operation(self.rig, operation));
        self.app.update();
    }

    fn fill(&mut self) -> Result<(), Box<dyn std::error::Error>> {
        let add = |number: usize| {
            let data = JointData {
                uid: joint(number),
                label: Some(format!("joint_of_a_chain_{number:03}")),
                rest: RestTransform::from_translation(Vec3::new(0.01, 0.05, 0.0)),
                ..default()
            };
            let parent = match number {
                0 => None,
                _ if number.is_multiple_of(12) => Some(joint(number - 12)),
                _ => Some(joint(number - 1)),
            };
            RigEdit::AddJoint { joint: Box::new(data), parent, index: usize::MAX }
        };
        self.edit((0..JOINTS).map(add).collect());
        for number in 0..12 {
            let joints = (0..JOINTS).skip(number).step_by(12).map(joint).collect();
            self.operate(Operation::Group { joints, name: format!("Group {number}"), color: None });
        }
        let command = |number: usize| {
            let (at, index) = (number / COMMANDS, number % COMMANDS);
            let params = match number % 2 {
                1 => format!("(at: \"{}\")", NodeRef::command(tag(number - 1))),
                _ => "()".to_owned(),
            };
            let module = if index == 0 { "control" } else { "null" };
            let kind = TagKind::Command { module: module.to_owned(), params, feature: None };
            let data = TagData { uid: tag(number), enabled: true, comment: String::new(), kind };
            RigEdit::AddTag { joint: joint(at), tag: Box::new(data), index }
        };
        self.edit((0..JOINTS * COMMANDS).map(command).collect());
        for number in 0..78 {
            self.operate(Operation::Labels(vec![(joint(number), format!("another_name_{number:03}"))]));
        }
        for number in 0..60 {
            let offset = PoseOffset::from_rotation(Quat::from_rotation_z(0.1 + 0.01 * number as f32));
            self.operate(Operation::Pose(vec![(joint(number), offset)]));
            self.operate(Operation::StorePose(format!("Pose {number}")));
        }
        let mut clip = RigClip { range: [0.0, 4.0], ..RigClip::new(CLIP, Uid(0x5A_0003), "clip") };
        for number in 0..TRACKS {
            let turn = |key: usize| {
                let time = 4.0 * key as f32 / (KEYS - 1) as f32;
                Key::rotation(time, Quat::from_rotation_z(0.4 * bevy::math::ops::sin(3.0 * time + number as f32)))
            };
            let target = TrackTarget { node: joint(number), property: Property::Rotation };
            clip.layers[0].tracks.insert(target, Arc::new(Track { keys: (0..KEYS).map(turn).collect() }));
        }
        self.edit(vec![RigEdit::AddClip(Box::new(clip), 0)]);
        self.add_body()?;
        self.app.world_mut().write_message(BuildRequest { rig: self.rig, step: BuildStep::All });
        self.app.world_mut().write_message(TimelineRequest::Open(Some(CLIP)));
        let what = Pick::Joints((0..JOINTS).step_by(2).map(joint).collect());
        self.app.world_mut().write_message(PickRequest { rig: self.rig, what, add: false });
        for _ in 0..20 {
            self.app.update();
        }
        Ok(())
    }

    /// Adds the bundled body, each point of which four joints hold.
    fn add_body(&mut self) -> Result<(), Box<dyn std::error::Error>> {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/models/biped.obj");
        let model = load_model(&RealDisk, path.as_ref())?;
        let mut weights = Weights { starts: vec![0], ..Weights::default() };
        for point in 0..model.points.len() {
            weights.push((0..4).map(|number| (((point + number * 50) % JOINTS) as u32, 0.25)));
        }
        let skin = SkinData { joints: (0..JOINTS).map(joint).collect(), weights, at_rest: true, ..SkinData::default() };
        self.app.world_mut().spawn((RigMesh::new(MESH, model, Vec::new()), SkinOf(self.rig)));
        self.edit(vec![RigEdit::SetSkin(MESH, Some(Arc::new(skin)))]);
        self.app.insert_resource(SelectedPoints { mesh: Some(MESH), points: (0..POINTS).collect() });
        Ok(())
    }

    /// Draws frames; `move_pointer` moves the pointer over the middle. Returns the time of each, and how many asked for another.
    fn frames(
        &mut self,
        stage: &mut Stage,
        move_pointer: bool,
        mut before: impl FnMut(&mut App, usize),
    ) -> (Vec<Duration>, usize) {
        let (mut times, mut asks) = (Vec::with_capacity(FRAMES), 0);
        for number in 0..FRAMES {
            before(&mut self.app, number);
            let events = if move_pointer {
                let (column, row) = ((number % 20) as f32 / 20.0, (number / 20 % 15) as f32 / 15.0);
                vec![egui::Event::PointerMoved(egui::pos2(stage.size.x * column, stage.size.y * row))]
            } else {
                Vec::new()
            };
            let (time, is_awake) = stage.draw(&mut self.app, events);
            times.push(time);
            asks += usize::from(is_awake);
        }
        (times, asks)
    }

    fn measure(&mut self, mut stage: Stage) -> Row {
        // The first frames lay texts out and put their glyphs into the atlas; what moved comes to rest.
        for _ in 0..60 {
            stage.draw(&mut self.app, Vec::new());
            self.app.update();
        }
        let (idle, asks) = self.frames(&mut stage, false, |_, _| ());
        let (pointed, _) = self.frames(&mut stage, true, |_, _| ());
        let rig = self.rig;
        let (changing, _) = self.frames(&mut stage, false, |app, number| {
            let place = Vec3::new(0.01, 0.05, 0.001 * (number % 7) as f32);
            let edit = RigEdit::SetRest(joint(3), RestTransform::from_translation(place));
            let change = Change::Preview(Operation::Edits(vec![edit]));
            app.world_mut().write_message(EditRequest { rig, change });
            app.update();
        });
        let change = Change::CancelPreview;
        self.app.world_mut().write_message(EditRequest { rig, change });
        self.app.update();
        Row { idle: median(idle), pointed: median(pointed), changing: median(changing), asks }
    }

    fn panel(&mut self, number: usize, name: &str) -> Row {
        let size = if WIDE.contains(&name) { egui::vec2(777.0, 300.0) } else { egui::vec2(252.0, 620.0) };
        let stage = Stage { ctx: egui::Context::default(), size, subject: Subject::Panel(number), time: 0.0 };
        self.measure(stage)
    }

    /// Medians of the whole window; `None` without a context to draw it in.
    fn window(&mut self) -> Option<Row> {
        let entity = self.app.world_mut().spawn(PrimaryEguiContext).id();
        let mut context = self.app.world_mut().get_mut::<EguiContext>(entity)?;
        let ctx = context.get_mut().clone();
        let stage = Stage { ctx, size: egui::vec2(1280.0, 720.0), subject: Subject::Window, time: 0.0 };
        let row = self.measure(stage);
        self.app.world_mut().despawn(entity);
        Some(row)
    }
}

#[derive(Clone, Copy)]
enum Subject {
    /// A panel by its number.
    Panel(usize),
    /// Whole window, as the dock draws it.
    Window,
}

struct Stage {
    ctx: egui::Context,
    size: egui::Vec2,
    subject: Subject,
    time: f64,
}

impl Stage {
    /// Draws a frame. Requests of panels are dropped: the app is measured elsewhere.
    fn draw(&mut self, app: &mut App, events: Vec<egui::Event>) -> (Duration, bool) {
        self.time += 1.0 / 60.0;
        let screen_rect = Some(egui::Rect::from_min_size(egui::Pos2::ZERO, self.size));
        let input = egui::RawInput { screen_rect, time: Some(self.time), events, ..default() };
        let mut panels = match self.subject {
            Subject::Panel(_) => app.world_mut().remove_resource::<Panels>(),
            Subject::Window => None,
        };
        let started = Instant::now();
        let mut output = match (self.subject, &mut panels) {
            (Subject::Panel(number), Some(panels)) => {
                let (world, panel) = (app.world(), &mut panels.panels[number]);
                self.ctx.run_ui(input, |ui| panel.show(ui, world, &mut Requests::default()))
            }
            _ => {
                self.ctx.begin_pass(input);
                app.world_mut().run_schedule(EguiPrimaryContextPass);
                self.ctx.end_pass()
            }
        };
        let shapes = std::mem::take(&mut output.shapes);
        let meshes = self.ctx.tessellate(shapes, output.pixels_per_point);
        let time = started.elapsed();
        std::hint::black_box(meshes);
        output.textures_delta.clear();
        if let Some(panels) = panels {
            app.insert_resource(panels);
        }
        let is_awake = output.viewport_output.values().any(|viewport| viewport.repaint_delay.is_zero());
        (time, is_awake)
    }
}
