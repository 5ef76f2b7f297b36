//! The command line: one subcommand a file.
//!
//! Exit codes: 0 done, 1 the input is at fault, 2 the command was used wrongly. With `--json` the result is one JSON
//! object on standard output, errors included.

mod animate;
mod argument;
mod binding;
mod build;
mod check;
mod compose;
mod convert;
mod demo;
#[cfg(feature = "render")]
mod device_selection;
mod explanation;
mod expressions;
mod face;
mod fit;
mod format;
mod info;
mod limits;
mod list;
mod modules;
mod new;
mod outputs;
mod pose;
mod process_limits;
mod progress;
mod project_meshes;
#[cfg(feature = "remote")]
mod remote;
#[cfg(feature = "render")]
mod render;
mod report;
mod sketch;
mod skin;
mod switches;
mod timed_disk;
mod update;
mod vrm;
mod watch;

use std::{
    io::Write as _,
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::{
    algo::weights::{Method, WeightSettings},
    mesh::gltf::GltfWriteSettings,
    plugins::limits::RigLimits,
};
use argument::ArgumentError;
use outputs::InPlaceArgs;
use report::{Failure, Report};
use vrm::VrmArgs;

/// Rig characters in minutes: sketch a skeleton into a mesh, skin it, export it.
#[derive(Parser, Debug)]
#[command(name = "rigsmith", version, about, long_about = None, arg_required_else_help = false)]
#[command(after_help = limits::listing())]
struct Cli {
    /// Answer in JSON, for programs
    #[arg(long, global = true, help_heading = "Options of every command")]
    json: bool,
    /// Set a limit of what a command takes, makes or tells, such as joints=2000; may be repeated.
    /// `rigsmith --help` lists them
    #[arg(long, global = true, help_heading = "Options of every command", value_name = "NAME=NUMBER")]
    limit: Vec<limits::LimitSetting>,
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Open the window on a mesh, a template or a project; without a file with the start page
    Edit(EditArgs),
    /// Make gestures (clicks, strokes) on a mesh and save the skeleton, or the skinned character
    Sketch(sketch::SketchArgs),
    /// Bind a mesh to a skeleton and save the character
    Skin(skin::SkinArgs),
    /// Move the skeleton of a template into a mesh by itself
    Fit(fit::FitArgs),
    /// Place a face in a head: bones, weights and expressions
    Face(face::FaceArgs),
    /// Convert between .obj, .gltf, .glb, .rig and .rig.ron where possible, and from .vrm
    Convert(convert::ConvertArgs),
    /// Say what is in a file
    Info(info::InfoArgs),
    /// Look for problems in files
    Check(check::CheckArgs),
    /// Put templates into their layout, with or without the uids that follow from names
    Format(format::FormatArgs),
    /// Write a template to start from, with comments
    New(new::NewArgs),
    /// List the templates of a folder by their headers
    List(list::ListArgs),
    /// Put several rigs into one
    Merge(compose::MergeArgs),
    /// Put a template's tags onto joints of a rig, in order
    Inject(compose::InjectArgs),
    /// Take joints out of a rig into a rig of their own
    Extract(compose::ExtractArgs),
    /// Build a template again whenever its file is saved, and write the character
    Watch(watch::WatchArgs),
    /// Say what differs between two templates
    Diff(update::DiffArgs),
    /// Bring a rig to a new version of its template: what you changed stays
    Update(update::UpdateArgs),
    /// Run the commands of a rig and save the built rig
    Build(build::BuildArgs),
    /// Build a rig, pose it by its controls as an app does, and save the character or a picture
    Pose(pose::PoseArgs),
    /// Put a clip, or the motion of another skeleton, onto a rig, and save the animated character or the clip
    Animate(animate::AnimateArgs),
    /// List the modules of commands, or describe one
    Modules(modules::ModulesArgs),
    /// Take a picture of a mesh, a template or a project, without a window
    #[cfg(feature = "render")]
    Render(render::RenderArgs),
}

impl Command {
    /// The file that the command works on: the first one that is named.
    fn subject(&self) -> Option<&Path> {
        match self {
            Self::Edit(args) => args.file.as_deref(),
            Self::Sketch(args) => Some(&args.gestures),
            Self::Skin(args) => args.meshes.first().map(PathBuf::as_path),
            Self::Fit(args) => Some(&args.mesh),
            Self::Face(args) => Some(&args.mesh),
            Self::Convert(args) => Some(&args.input),
            Self::Info(args) => Some(&args.file),
            Self::Check(args) => args.files.first().map(PathBuf::as_path),
            Self::Format(args) => args.files.first().map(PathBuf::as_path),
            Self::New(args) => Some(&args.output),
            Self::List(args) => args.folder.as_deref(),
            Self::Merge(args) => args.rigs.first().map(PathBuf::as_path),
            Self::Inject(args) => Some(&args.rig),
            Self::Extract(args) => Some(&args.rig),
            Self::Watch(args) => Some(&args.template),
            Self::Diff(args) => Some(&args.to),
            Self::Update(args) => Some(&args.rig),
            Self::Build(args) => Some(&args.rig),
            Self::Pose(args) => Some(&args.rig),
            Self::Animate(args) => args.clips.first().map(|path| &**path),
            Self::Modules(_) => None,
            #[cfg(feature = "render")]
            Self::Render(args) => Some(&args.file),
        }
    }
}

/// Arguments of `edit`.
#[derive(Args, Debug)]
struct EditArgs {
    /// The mesh (.obj, .gltf, .glb, .vrm), the template (.rig.ron) or the project (.rigsmith.ron)
    file: Option<PathBuf>,
    /// Let other programs of this machine control the window over this port; 0 takes a free one
    #[cfg(feature = "remote")]
    #[arg(long, value_name = "PORT")]
    remote: Option<u16>,
    /// Folder in which remote control may read and save templates; the working folder by default
    #[cfg(feature = "remote")]
    #[arg(long, value_name = "FOLDER", requires = "remote")]
    remote_folder: Vec<PathBuf>,
}

impl EditArgs {
    fn window(self) -> Result<WindowRequest, Failure> {
        Ok(WindowRequest {
            file: self.file,
            limits: limits::chosen(),
            #[cfg(feature = "remote")]
            remote: self.remote.map(|port| remote::bind(port, self.remote_folder)).transpose()?,
        })
    }
}

/// Options of the computation of weights.
#[derive(Args, Debug, Clone)]
struct WeightArgs {
    /// Method that binds the mesh to the joints
    #[arg(long, value_enum, default_value_t = MethodArg::Auto)]
    method: MethodArg,
    /// Width of the blend between joints: 1 is usual, less is harder, more is softer
    #[arg(long, default_value_t = 1.0, value_parser = positive)]
    smoothing: f32,
    /// Joints that move one vertex, while weights are computed, at most
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u8).range(1..=8))]
    stored_influences: u8,
    /// Let every part of the mesh bend. Without it, a loose part that lies on one joint moves stiffly with it, as a helmet
    /// does
    #[arg(long)]
    bend_parts: bool,
    /// Labels of joints that get skin in any case, also where they lie outside of the mesh or are marked as not deforming;
    /// may be repeated
    #[arg(long, value_name = "LABEL[,LABEL...]")]
    claim: Vec<String>,
}

#[derive(ValueEnum, Debug, Clone, Copy)]
enum MethodArg {
    /// Heat on the surface where it can be trusted, voxels elsewhere
    Auto,
    /// Heat on the surface
    Heat,
    /// Distances through the volume
    Voxel,
}

impl WeightArgs {
    fn settings(&self) -> WeightSettings {
        WeightSettings {
            max_influences: usize::from(self.stored_influences),
            smoothing: self.smoothing,
            stiff_parts: !self.bend_parts,
            method: match self.method {
                MethodArg::Auto => Method::Auto,
                MethodArg::Heat => Method::Heat,
                MethodArg::Voxel => Method::Voxel,
            },
            ..Default::default()
        }
    }
}

/// Options of exported characters.
#[derive(Args, Debug, Clone)]
struct ExportArgs {
    /// Joints that move one vertex, in what is written, at most; more than 4 need a second set that not every program reads
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u8).range(1..=8))]
    influences: u8,
    /// Write all joints, not only joints with weights and their ancestors
    #[arg(long)]
    all_joints: bool,
}

impl ExportArgs {
    fn settings(&self) -> GltfWriteSettings {
        GltfWriteSettings {
            max_influences: usize::from(self.influences),
            all_joints: self.all_joints,
            ..Default::default()
        }
    }
}

fn positive(text: &str) -> Result<f32, ArgumentError> {
    match text.parse::<f32>() {
        Ok(number) if number > 0.0 && number.is_finite() => Ok(number),
        _ => Err(ArgumentError::NotPositive),
    }
}

/// The seed of uids, so that the same command writes the same bytes.
const SEED: u64 = 0x5249_4753_4D49_5448;

/// Subject of a command without a file.
const COMMAND_LINE: &str = "command line";

/// A file to write.
type Output = PathBuf;

/// Reason why no window opens, in a line.
#[derive(Debug, thiserror::Error)]
pub enum WindowError {
    /// The program was built without the window.
    #[error("this build has no editor; build with the feature `editor`")]
    NoEditor,
    /// The stack of the main thread, which the window runs on, is too small.
    #[error("the window needs a larger stack; raise the limit (`ulimit -s`)")]
    SmallStack,
    /// The window cannot be opened.
    #[error(transparent)]
    Window(Box<dyn std::error::Error + Send + Sync>),
}

/// Window to open.
#[derive(Debug, Clone, Default)]
pub struct WindowRequest {
    /// The file; the start page without one.
    pub file: Option<PathBuf>,
    /// Limits of what the window takes and makes.
    pub limits: RigLimits,
    /// Remote control of the window.
    #[cfg(feature = "remote")]
    pub remote: Option<crate::remote::RemotePlugin>,
}

/// Function that opens the window, and returns when it is closed.
pub type OpenWindow<'a> = &'a dyn Fn(WindowRequest) -> Result<ExitCode, WindowError>;

/// Runs the command line of this process. `window` opens the editor, which this module does not depend on.
pub fn main(window: OpenWindow) -> ExitCode {
    if !process_limits::has_small_stack() {
        return run(window);
    }
    let own_stack = process_limits::on_own_stack(|| run(&|_| Err(WindowError::SmallStack)));
    own_stack.unwrap_or_else(|error| {
        let json = std::env::args_os().any(|argument| argument == "--json");
        report::finish(Err(Failure::Input(Box::new(error))), json, COMMAND_LINE)
    })
}

/// Runs the command line on this thread. It is a function of its own, so that [`main`] itself needs little of a small stack.
#[inline(never)]
fn run(window: OpenWindow) -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        // Help and version are results; only wrong usage is reported as JSON. Names of files may be no Unicode.
        Err(error) if error.use_stderr() && std::env::args_os().any(|argument| argument == "--json") => {
            return report::finish(Err(Failure::Usage(error.to_string().trim_end().to_owned())), true, "");
        }
        Err(error) => {
            let is_told = error.print().is_ok() && std::io::stdout().flush().is_ok();
            let code = u8::try_from(error.exit_code()).unwrap_or(1);
            return ExitCode::from(if is_told { code } else { code.max(1) });
        }
    };
    limits::choose(&cli.limit);
    report::choose_json(cli.json);
    let subject = cli.command.as_ref().and_then(Command::subject).map(|path| path.display().to_string());
    if let Err(error) = process_limits::prepare() {
        let failure = Failure::Input(Box::new(error));
        return report::finish(Err(failure), cli.json, subject.as_deref().unwrap_or(COMMAND_LINE));
    }
    let result = match cli.command {
        None if cli.json => demo::run(None),
        None => match window(WindowRequest { limits: limits::chosen(), ..WindowRequest::default() }) {
            Ok(code) => return code,
            Err(reason) => demo::run(Some(&reason)),
        },
        Some(Command::Edit(args)) => match args.window().map(window) {
            Ok(Ok(code)) => return code,
            Ok(Err(reason)) => Err(Failure::Usage(format!("{reason}; sketch, skin and convert work without a window"))),
            Err(failure) => Err(failure),
        },
        Some(Command::Sketch(args)) => sketch::run(&args),
        Some(Command::Skin(args)) => skin::run(&args),
        Some(Command::Fit(args)) => fit::run(&args),
        Some(Command::Face(args)) => face::run(&args),
        Some(Command::Convert(args)) => convert::run(&args),
        Some(Command::Info(args)) => info::run(&args),
        Some(Command::Check(args)) => check::run(&args),
        Some(Command::Format(args)) => format::run(&args),
        Some(Command::Diff(args)) => update::run_diff(&args),
        Some(Command::Update(args)) => update::run_update(&args),
        Some(Command::New(args)) => new::run(&args),
        Some(Command::List(args)) => list::run(&args),
        Some(Command::Merge(args)) => compose::merge(&args),
        Some(Command::Inject(args)) => compose::inject(&args),
        Some(Command::Extract(args)) => compose::extract(&args),
        Some(Command::Watch(args)) => watch::run(&args, cli.json),
        Some(Command::Build(args)) => build::run(&args),
        Some(Command::Pose(args)) => pose::run(&args),
        Some(Command::Animate(args)) => animate::run(&args),
        Some(Command::Modules(args)) => Ok(modules::run(&args)),
        #[cfg(feature = "render")]
        Some(Command::Render(args)) => render::run(&args),
    };
    report::finish(result, cli.json, subject.as_deref().unwrap_or(COMMAND_LINE))
}
