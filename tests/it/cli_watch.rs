//! Templates and meshes that are watched: a save is built, a fault is told, and what could not be written is written later.

use std::{
    fs,
    io::{BufRead, BufReader},
    path::Path,
    process::{Child, Command, Stdio},
    sync::mpsc::{Receiver, channel},
    thread::spawn,
    time::Duration,
};

use rigsmith::{
    files::{RealDisk, load_model},
    mesh::model::Model,
};
use serde_json::Value;

use super::{
    bench::{HANG, save_whole},
    cli_outputs::rigsmith,
    model_files,
    template::place,
};

/// `rigsmith watch` that ends with the test, passed or not.
struct Watch {
    process: Child,
    heard: Receiver<String>,
}

impl Drop for Watch {
    fn drop(&mut self) {
        let _ = self.process.kill();
    }
}

impl Watch {
    fn start(folder: &Path, output: &str, count: &str) -> Self {
        Self::with(folder, output, count, &[])
    }

    fn with(folder: &Path, output: &str, count: &str, more: &[&str]) -> Self {
        let process = Command::new(env!("CARGO_BIN_EXE_rigsmith"))
            .current_dir(folder)
            .args(["watch", "a.rig.ron", "-o", output, "--count", count, "--json"])
            .args(more)
            .stdout(Stdio::piped())
            .spawn();
        let mut process = process.unwrap();
        let lines = BufReader::new(process.stdout.take().unwrap()).lines();
        let (told, heard) = channel();
        spawn(move || lines.map_while(Result::ok).try_for_each(|line| told.send(line)));
        Self { process, heard }
    }

    fn next(&self) -> Value {
        serde_json::from_str(&self.heard.recv_timeout(HANG).unwrap()).unwrap()
    }

    fn ended(&mut self) -> bool {
        self.process.wait().unwrap().success()
    }
}

#[test]
fn a_watched_template_is_built_at_every_save_and_no_broken_one_is_taken_over() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    assert_eq!(rigsmith(folder.path(), &["new", "chain", "-o", "a.rig.ron"]).0, 0);
    let text = fs::read_to_string(at("a.rig.ron")).unwrap();
    let mut watch = Watch::start(folder.path(), "a.glb", "4");
    let glb = || fs::read(at("a.glb")).unwrap();
    let ran = |told: &Value| told["ran"].as_array().unwrap().len();
    let first = watch.next();
    assert_eq!((ran(&first), first["commands"].as_u64()), (3, Some(3)), "{first}");
    let took = ["build_ms", "total_ms"].map(|key| first[key].as_f64().unwrap_or_else(|| panic!("{key}: {first}")));
    assert!(0.0 < took[0] && took[0] <= took[1], "{first}");
    let first_bytes = glb();
    // One parameter: one command; another file in its place, as most programs save.
    save_whole(&at("a.rig.ron"), text.replace("square", "cube"));
    let told = watch.next();
    assert_eq!(told["ran"], serde_json::json!(["control on link_1"]), "{told}");
    // A broken file, one whose build fails, and the next good one.
    save_whole(&at("a.rig.ron"), &text[..200]);
    assert_eq!(watch.next()["ok"], false);
    save_whole(&at("a.rig.ron"), text.replace("square", "no such shape"));
    let told = watch.next();
    assert!(crate::cli::explained(&told).contains("no such shape"), "{told}");
    // The command is told by its line and column, and no program is told to start over.
    let (line, column) = place(&text, "square");
    let place = told["error"]["where"].as_str().unwrap().to_owned();
    assert!(place.starts_with(&format!("a.rig.ron:{line}:")) && !place.ends_with(":1"), "{place}, not {line}:{column}");
    assert!(!told.to_string().contains("(tag ") && !told.to_string().contains("run the command again"), "{told}");
    let after_cube = glb();
    save_whole(&at("a.rig.ron"), text.replace("(0, 0.3, 0)", "(0, 0.5, 0)"));
    assert_eq!(watch.next()["ok"], true);
    assert_ne!(glb(), after_cube);
    save_whole(&at("a.rig.ron"), &text);
    assert_eq!(watch.next()["ok"], true);
    assert!(glb() == first_bytes, "back to the first bytes");
    assert!(watch.ended());
}

/// A template of joints alone is written as `build` writes it; commands come to it and leave it while it is watched.
#[test]
fn a_watched_template_gets_its_first_commands_and_loses_them() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let joints = "(format: 2, name: \"n\", joints: [(label: \"a\", translation: (0, 1, 0)), \
                  (label: \"b\", parent: \"a\", rotation: (0, 0, 0.6, 0.8), translation: (0, 1, 0))])";
    fs::write(at("a.rig.ron"), joints).unwrap();
    assert_eq!(rigsmith(folder.path(), &["build", "a.rig.ron", "-o", "built.glb"]).0, 0);
    assert_eq!(rigsmith(folder.path(), &["new", "chain", "-o", "chain.rig.ron"]).0, 0);
    let chain = fs::read_to_string(at("chain.rig.ron")).unwrap();
    let mut watch = Watch::start(folder.path(), "a.glb", "3");
    let none = |told: &Value| {
        assert!(told["ok"] == true && told["commands"] == 0 && told["ran"] == serde_json::json!([]), "{told}");
        assert!(fs::read(at("a.glb")).unwrap() == fs::read(at("built.glb")).unwrap());
    };
    none(&watch.next());
    // A first version with commands that cannot be built changes nothing.
    let written = fs::read(at("a.glb")).unwrap();
    save_whole(&at("a.rig.ron"), chain.replace("square", "no such shape"));
    let told = watch.next();
    assert!(told["ok"] == false && told["error"]["where"].as_str().unwrap().starts_with("a.rig.ron:"), "{told}");
    assert_eq!(fs::read(at("a.glb")).unwrap(), written);
    save_whole(&at("a.rig.ron"), &chain);
    let told = watch.next();
    assert_eq!((told["ran"].as_array().unwrap().len(), told["commands"].as_u64()), (3, Some(3)), "{told}");
    save_whole(&at("a.rig.ron"), joints);
    none(&watch.next());
    assert!(watch.ended());
}

/// A template of joints alone is written again, too, once that can be.
#[test]
fn joints_that_could_not_be_written_are_written_as_soon_as_they_can_be() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("a.rig.ron"), "(format: 2, name: \"n\", joints: [(label: \"a\")])").unwrap();
    let mut watch = Watch::start(folder.path(), "out/a.glb", "1");
    let told = watch.next();
    assert!(crate::cli::explained(&told).contains("create it or choose another"), "{told}");
    fs::create_dir(at("out")).unwrap();
    let told = watch.next();
    assert!(told["ok"] == true && at("out/a.glb").exists(), "{told}");
    assert!(watch.ended());
}

#[test]
fn a_character_that_could_not_be_written_is_written_as_soon_as_it_can_be() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    assert_eq!(rigsmith(folder.path(), &["new", "chain", "-o", "a.rig.ron"]).0, 0);
    let text = fs::read_to_string(at("a.rig.ron")).unwrap();
    fs::create_dir(at("out")).unwrap();
    let mut watch = Watch::start(folder.path(), "out/a.glb", "2");
    assert_eq!(watch.next()["ok"], true);
    fs::remove_dir_all(at("out")).unwrap();
    save_whole(&at("a.rig.ron"), text.replace("(0, 0.3, 0)", "(0, 0.5, 0)"));
    let told = watch.next();
    assert!(crate::cli::explained(&told).contains("create it or choose another"), "{told}");
    // The folder is there again, and nobody has saved the template since. The same error is not told again meanwhile.
    fs::create_dir(at("out")).unwrap();
    let told = watch.next();
    assert!(told["ok"] == true && at("out/a.glb").exists(), "{told}");
    assert!(watch.ended());
}

/// A character that cannot be written for the same reason as before is not read and built again meanwhile: a part that is missing for a
/// while is told only once there is a place to write to.
#[test]
fn a_character_is_made_again_only_when_it_may_be_written() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let part = "(format: 2, name: \"q\", kind: \"part\", joints: [(label: \"x\")])";
    fs::write(at("p.rig.ron"), part).unwrap();
    let host = "(format: 2, name: \"n\", joints: [(label: \"a\")], parts: [(part: \"p.rig.ron\", name: \"inner\")])";
    fs::write(at("a.rig.ron"), host).unwrap();
    let mut watch = Watch::start(folder.path(), "out/a.glb", "1");
    let told = watch.next();
    assert!(crate::cli::explained(&told).contains("create it or choose another"), "{told}");
    fs::remove_file(at("p.rig.ron")).unwrap();
    assert!(watch.heard.recv_timeout(Duration::from_millis(2500)).is_err());
    fs::create_dir(at("out")).unwrap();
    let told = watch.next();
    assert!(crate::cli::explained(&told).contains("p.rig.ron"), "{told}");
    save_whole(&at("p.rig.ron"), part);
    let told = watch.next();
    assert!(told["ok"] == true && at("out/a.glb").exists(), "{told}");
    assert!(watch.ended());
}

/// A box around the chain of `rigsmith new chain`, that wide, with so many rings of points.
fn column(width: f32, rings: u32) -> String {
    model_files::column(width, 1.2, rings)
}

#[test]
fn a_first_template_and_a_first_mesh_are_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    assert_eq!(rigsmith(folder.path(), &["new", "chain", "-o", "new.rig.ron"]).0, 0);
    let text = fs::read_to_string(at("new.rig.ron")).unwrap();
    let mut watch = Watch::with(folder.path(), "a.glb", "1", &["--mesh", "a.obj"]);
    // Neither is there yet.
    for file in ["a.obj", "a.rig.ron"] {
        let told = watch.next();
        assert!(told["ok"] == false && told["error"]["where"] == file, "{told}");
        assert!(!told.to_string().contains("run the command again"), "{told}");
    }
    // A broken template, and one whose command fails, end nothing either.
    save_whole(&at("a.rig.ron"), &text[..200]);
    assert_eq!(watch.next()["ok"], false);
    save_whole(&at("a.rig.ron"), text.replace("square", "no such shape"));
    let told = watch.next();
    let line = place(&text, "square").0;
    assert!(told["error"]["where"].as_str().unwrap().starts_with(&format!("a.rig.ron:{line}:")), "{told}");
    // With both of them there, the character is written.
    save_whole(&at("a.obj"), column(0.1, 5));
    save_whole(&at("a.rig.ron"), &text);
    let told = watch.next();
    assert!(told["ok"] == true && at("a.glb").exists(), "{told}");
    assert!(watch.ended());
}

#[test]
fn a_saved_mesh_is_written_with_its_weights() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    assert_eq!(rigsmith(folder.path(), &["new", "chain", "-o", "a.rig.ron"]).0, 0);
    save_whole(&at("a.obj"), column(0.1, 5));
    let mut watch = Watch::with(folder.path(), "a.glb", "4", &["--mesh", "a.obj"]);
    let glb = || load_model(&RealDisk, &at("a.glb")).unwrap();
    assert_eq!(watch.next()["ok"], true);
    let first = glb();
    // Wider: as many points, and nothing of the rig runs.
    save_whole(&at("a.obj"), column(0.2, 5));
    let told = watch.next();
    assert_eq!((&told["ok"], &told["ran"]), (&Value::from(true), &serde_json::json!([])), "{told}");
    let moved = told["mesh"]["moved"].as_f64().unwrap();
    assert!((moved - 0.1 * 2f64.sqrt()).abs() < 1e-4, "{told}");
    assert_eq!(told["mesh"]["points"], serde_json::json!([20, 20]));
    let wider = glb();
    let width = |model: &Model| model.points.iter().map(|point| point.x).fold(0.0, f32::max);
    assert!((width(&wider) - 0.2).abs() < 1e-5 && (width(&first) - 0.1).abs() < 1e-5);
    let joints = |model: &Model| model.nodes.iter().map(|node| node.name.clone()).collect::<Vec<_>>();
    assert_eq!(joints(&wider), joints(&first));
    // More points, each of them held by joints.
    save_whole(&at("a.obj"), column(0.2, 9));
    let told = watch.next();
    assert_eq!(told["mesh"]["points"], serde_json::json!([20, 36]), "{told}");
    assert!(told["mesh"]["weights"]["copied"].as_u64().unwrap() >= 20, "{told}");
    let more = glb();
    assert!(more.points.len() >= 36 && !more.skins.is_empty());
    // A broken mesh changes nothing, and the next good one is taken.
    let written = fs::read(at("a.glb")).unwrap();
    save_whole(&at("a.obj"), "v 1 2\nf 1 2 3 4 5 6 7 8 9\n");
    let told = watch.next();
    assert!(told["ok"] == false && told["error"]["where"].as_str().unwrap().contains("a.obj"), "{told}");
    assert_eq!(fs::read(at("a.glb")).unwrap(), written);
    save_whole(&at("a.obj"), column(0.1, 5));
    assert_eq!(watch.next()["mesh"]["points"], serde_json::json!([36, 20]));
    assert!(watch.ended());
}
