//! Poses: assignments and switches in the text form of the command line, on a built rig; then frames, stored and exported.

use std::time::Duration;

use rigsmith::{
    files::{load_model, store_model},
    headless::{
        Workbench,
        posing::{ControlWrite, PoseError},
    },
    mesh::gltf::GltfWriteSettings,
    plugins::commands::BuildStep,
    rig::project::{Project, ProjectRig, read_project, write_project},
};

use super::{
    LIMITS, limited,
    memory_disk::{MemoryDisk, at},
    promises,
    skin::{cube, held_by_first},
    template::refused,
};
use crate::generate::{
    Choices,
    choices::{bend, text_of},
    params::NAMES,
    template::template,
};

/// Greatest distance of an entity from where the program puts it, as a share of the rig's extent.
const NEAR: f32 = 1e-4;

/// Names that assignments may use: nodes of the rig, references, and others.
fn name(choices: &mut Choices, bench: &Workbench) -> String {
    let names: Vec<String> =
        bench.built().map(|built| built.nodes.iter().map(|node| node.name.to_string()).collect()).unwrap_or_default();
    match choices.below(8) {
        0..=4 if !names.is_empty() => names[choices.below(names.len())].clone(),
        5 => choices.pick(&["@root", "@any pick:0", "@module control pick:END", "@joint", "@"]).to_owned(),
        _ => choices.pick(&NAMES).to_owned(),
    }
}

/// A text as `--set` takes it; some are none.
fn assignment(choices: &mut Choices, bench: &Workbench) -> String {
    let name = name(choices, bench);
    let mut number = || text_of(choices.any_number());
    let vector = format!("({}, {}, {})", number(), number(), number());
    let mut text = match choices.below(6) {
        0 => format!("{name}.translate={vector}"),
        1 => format!("{name}.rotate={vector}"),
        2 => format!("{name}.scale={vector}"),
        3 => format!("{name}.{}={}", choices.pick(&NAMES), text_of(choices.any_number())),
        4 => format!("{name}.{}={}", choices.pick(&NAMES), choices.pick(&NAMES)),
        _ => format!("{name}.translate=(1e30, 0, 0)"),
    };
    if choices.chance(8) {
        bend(choices, &mut text);
    }
    text
}

/// Carries assignments through all of it.
pub fn check(bytes: &[u8]) {
    let mut choices = Choices::new(bytes);
    let made = template(&mut choices, &limited(), true);
    let Some(rig) = made.read().map(|template| template.rig) else { return };
    let mut bench = Workbench::with_rig(4, rig);
    bench.set_limits(LIMITS, Duration::from_secs(600));
    let report = bench.build(BuildStep::All);
    let mut writes = Vec::new();
    for _ in 0..1 + choices.below(6) {
        let text = assignment(&mut choices, &bench);
        match text.parse::<ControlWrite>() {
            Ok(write) => writes.push(write),
            Err(error) => promises::error(&error),
        }
    }
    let switches: Vec<(String, String)> = (0..choices.below(3))
        .map(|_| (name(&mut choices, &bench), choices.pick(&["ik", "fk", "0", "1", "0.5", "NaN", ""]).to_owned()))
        .collect();
    let switches: Vec<(&str, &str)> = switches.iter().map(|(name, value)| (name.as_str(), value.as_str())).collect();
    let posed = bench.pose_through(&writes, &switches);
    if report.error.is_some() {
        // What was built before the command that failed may run, or not.
        if let Err(error) = posed {
            promises::error(&error);
        }
        return;
    }
    match posed {
        Ok(held) => held.iter().for_each(|held| assert!(!held.to_string().is_empty())),
        Err(error @ (PoseError::CannotRun(_) | PoseError::NotFinite { .. })) => return promises::error(&error),
        Err(error) => promises::error(&error),
    }
    drop(bench.frames(choices.below(4) as u32));
    let nodes = match bench.nodes() {
        Ok(nodes) => nodes,
        Err(error) => return promises::error(&error),
    };
    if !choices.was_odd() {
        let far = nodes.iter().map(|node| node.program.translation.abs().max_element()).fold(1.0, f32::max);
        for node in &nodes {
            let off = node.entity.translation.distance(node.program.translation) / far;
            assert!(off <= NEAR, "{} is {off} off", node.node.name);
        }
    }
    stored(&bench);
    exported(&mut bench, choices.was_odd());
}

/// The posed document comes back from a project.
fn stored(bench: &Workbench) {
    let rig = match bench.posed_document() {
        Ok(rig) => rig,
        Err(error) => return promises::error(&error),
    };
    let project = Project { rigs: vec![ProjectRig { rig, skins: Vec::new() }], ..Project::default() };
    let text = write_project(&project);
    let read = read_project(text.as_bytes()).unwrap_or_else(|error| panic!("{error}\n{text}"));
    assert_eq!(read.project, project);
}

/// The posed character is written and read.
fn exported(bench: &mut Workbench, was_odd: bool) {
    bench.open(cube(), true).expect("a cube opens");
    let skin = held_by_first(bench.rig(), 8);
    bench.bind(skin).expect("weights over joints of the rig");
    let disk = MemoryDisk::default();
    let settings = GltfWriteSettings { all_joints: true, bind_unweighted: true, ..GltfWriteSettings::default() };
    match store_model(&disk, &at("p.glb"), &bench.character(), &settings) {
        Ok(_) => promises::model(&load_model(&disk, &at("p.glb")).expect("it was written")),
        Err(error) => {
            assert!(was_odd, "{error}");
            refused(&disk, "p.glb", &error);
        }
    }
}
