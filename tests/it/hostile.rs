//! Hostile inputs through whole commands: bombs, soups, long chains, damaged and huge texts end in a result or in an error
//! that says what, where and what to do, within a bound of memory, and write nothing that Rigsmith does not read.
//!
//! The cases are made here; those of the test data are replayed beside them.

mod clips;
mod memory;

use std::{
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::{Duration, Instant},
};

use rigsmith::{
    files::{RealDisk, load_model, load_packed_clips, load_template},
    rig::template::{read_template, survey_template},
};
use serde_json::Value;

use crate::{cli::explained, prerequisites::test_data};

/// Wait that only a command that hangs reaches.
const HANG: Duration = Duration::from_secs(300);

/// End of a command.
struct CommandEnd {
    code: Option<i32>,
    out: String,
    err: String,
    /// Most bytes of anonymous memory that were seen; 0 where the system does not tell it.
    memory: u64,
}

/// Anonymous memory of a process in bytes.
fn anonymous(process: u32) -> u64 {
    let status = fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("RssAnon:"));
    line.and_then(|line| line.split_whitespace().next()?.parse::<u64>().ok()).unwrap_or_default() * 1024
}

fn run(folder: &Path, args: &[&str]) -> CommandEnd {
    // Files instead of pipes: a full pipe would stop the command while it is watched.
    let (out, err) = (folder.join("out.txt"), folder.join("err.txt"));
    let mut child = Command::new(env!("CARGO_BIN_EXE_rigsmith"))
        .current_dir(folder)
        .args(args)
        .stdin(Stdio::null())
        .stdout(fs::File::create(&out).unwrap())
        .stderr(fs::File::create(&err).unwrap())
        .spawn()
        .unwrap();
    let start = Instant::now();
    let mut memory = 0;
    let status = loop {
        memory = memory.max(anonymous(child.id()));
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if start.elapsed() > HANG {
            child.kill().unwrap();
            panic!("{args:?} hangs");
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    let text = |path: &Path| String::from_utf8_lossy(&fs::read(path).unwrap()).into_owned();
    CommandEnd { code: status.code(), out: text(&out), err: text(&err), memory }
}

/// Runs a command with `--json`, fails unless it ends as promised, and returns its answer.
fn json_answer(folder: &Path, args: &[&str]) -> (CommandEnd, Value) {
    let ended = run(folder, &[args, &["--json"]].concat());
    let said = || format!("{args:?}: {:?} {:.300} {:.300}", ended.code, ended.out, ended.err);
    assert!(matches!(ended.code, Some(0 | 1)), "{}", said());
    assert!(!ended.err.contains("panicked"), "{}", said());
    let is_obeyed = |c: char| c.is_control() && !matches!(c, '\n' | '\t');
    assert!(!ended.out.contains(is_obeyed) && !ended.err.contains(is_obeyed), "{}", said());
    let answer: Value = serde_json::from_str(&ended.out).unwrap_or_else(|error| panic!("{error}: {}", said()));
    assert_eq!(answer["ok"], ended.code == Some(0), "{}", said());
    if ended.code == Some(1) {
        let text = explained(&answer);
        assert!(text.len() < 2000, "an error of a line or two: {}", text.len());
    }
    (ended, answer)
}

fn tags(count: usize, tag: impl Fn(usize) -> String) -> String {
    let tags: Vec<String> = (0..count).map(tag).collect();
    format!(
        "(format: 2, name: \"n\", joints: [(label: \"j\", translation: (0, 0.1, 0), tags: [{}])])",
        tags.join(",\n")
    )
}

fn command(module: &str, params: &str) -> String {
    format!("Command(module: \"{module}\", params: ({params}))")
}

/// Templates whose builds would grow without bound.
fn bombs() -> Vec<(&'static str, String, &'static str)> {
    let any = "at: \"@any\"";
    vec![
        ("chains", tags(18, |n| command("duplicate_chain", &format!("chain: \"@any\", name: \"c{n}\""))), ""),
        ("controls", tags(10, |_| command("control", any)), "nodes and constraints"),
        ("attributes", tags(8000, |n| command("attribute", &format!("name: \"a{n}\""))), "attributes of one node"),
        ("unknown", tags(10_000, |_| command("nope", "")), "there is no module"),
        ("joints", tags(30_000, |_| command("null", "")), "nodes and constraints"),
    ]
}

#[test]
fn bombs_are_told_and_write_nothing() {
    let folder = tempfile::tempdir().unwrap();
    for (name, text, wanted) in bombs() {
        let file = format!("{name}.rig.ron");
        fs::write(folder.path().join(&file), &text).unwrap();
        for args in [&["check", &file][..], &["build", &file, "-o", "out.glb"]] {
            let (ended, answer) = json_answer(folder.path(), args);
            assert_eq!(ended.code, Some(1), "{args:?}: {answer:.300}");
            assert!(answer.to_string().contains(wanted), "{args:?} says \"{wanted}\": {answer:.600}");
            assert!(!folder.path().join("out.glb").exists(), "{args:?}");
        }
    }
}

/// Skeleton text with a chain of joints, or with one joint that bears all others.
fn skeleton(joints: usize, is_chain: bool) -> String {
    let mut text = String::from("rig 1\n");
    for joint in 0..joints {
        let parent = if joint == 0 {
            -1
        } else if is_chain {
            joint as i64 - 1
        } else {
            0
        };
        let _ = writeln!(text, "joint {joint} {parent} {} {joint} 0", if is_chain { 0 } else { joint % 7 });
    }
    text
}

/// A template with a chain of joints, each with a null.
fn chain_of_nulls(joints: usize) -> String {
    let joint = |number: usize| {
        let parent = if number == 0 { String::new() } else { format!("parent: \"j{}\", ", number - 1) };
        let tag = command("null", "");
        format!("(label: \"j{number}\", {parent}translation: (0, 0.1, 0), tags: [{tag}])")
    };
    let joints: Vec<String> = (0..joints).map(joint).collect();
    format!("(format: 2, name: \"n\", joints: [{}])", joints.join(",\n"))
}

/// Triangles: equal ones, a fan about one point, a soup that joins points at random, and loose ones of all sizes.
fn triangles(count: usize) -> [(&'static str, String); 4] {
    let stacked = "v 0 0 0\nv 1 0 0\nv 0 1 0\n".to_owned() + &"f 1 2 3\n".repeat(count);
    let mut fan = String::from("v 0 0 0\n");
    for corner in 0..=count {
        let angle = corner as f64 / count as f64;
        let _ = writeln!(fan, "v {} {} 0", 1.0 - angle, angle);
    }
    for at in 0..count {
        let _ = writeln!(fan, "f 1 {} {}", at + 2, at + 3);
    }
    let mut random = crate::random::Random(5);
    let points = (count / 3).max(3);
    let mut soup = String::new();
    for _ in 0..points {
        let _ = writeln!(soup, "v {} {} {}", random.unit(), random.unit(), random.unit());
    }
    for _ in 0..count {
        let corner = |random: &mut crate::random::Random| random.below(points) + 1;
        let _ = writeln!(soup, "f {} {} {}", corner(&mut random), corner(&mut random), corner(&mut random));
    }
    let mut loose = String::new();
    for at in 0..count {
        for _ in 0..3 {
            let _ = writeln!(loose, "v {} {} {}", random.unit(), random.unit(), random.unit());
        }
        let _ = writeln!(loose, "f {} {} {}", 3 * at + 1, 3 * at + 2, 3 * at + 3);
    }
    [("stacked.obj", stacked), ("fan.obj", fan), ("soup.obj", soup), ("loose.obj", loose)]
}

#[test]
fn shapes_that_broke_binding_are_bound() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("two.rig"), "rig 1\njoint 0 -1 0 0 0 root\njoint 1 0 0 1 0 tip\n").unwrap();
    for (name, text) in triangles(22_000) {
        fs::write(folder.path().join(name), text).unwrap();
        let (ended, answer) = json_answer(folder.path(), &["skin", "two.rig", name, "-o", "out.glb"]);
        assert_eq!(ended.code, Some(0), "{name}: {answer}");
        let model = load_model(&RealDisk, &folder.path().join("out.glb")).unwrap();
        assert!(model.weights.is_some(), "{name}");
    }
    for (name, is_chain) in [("chain.rig", true), ("star.rig", false)] {
        fs::write(folder.path().join(name), skeleton(10_000, is_chain)).unwrap();
        let (ended, answer) = json_answer(folder.path(), &["build", name, "-o", "out.rig.ron"]);
        assert_eq!(ended.code, Some(0), "{name}: {answer}");
        assert_eq!(load_template(&RealDisk, &folder.path().join("out.rig.ron")).unwrap().rig.len(), 10_000, "{name}");
    }
}

#[test]
fn texts_that_no_terminal_should_obey_are_escaped() {
    let folder = tempfile::tempdir().unwrap();
    let label = "\\u{1b}]0;owned\\u{7}\\u{202e}";
    let template =
        format!("(format: 2, name: \"{label}\", joints: [(label: \"{label}\"), (label: \"{label}\", oops: 1)])");
    fs::write(folder.path().join("a.rig.ron"), template).unwrap();
    fs::write(folder.path().join("b.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\no \u{1b}]0;owned\u{7}\nf 1 2 3\n").unwrap();
    for args in [["info", "a.rig.ron"], ["check", "a.rig.ron"], ["info", "b.obj"], ["check", "b.obj"]] {
        json_answer(folder.path(), &args);
        let ended = run(folder.path(), &args);
        let is_obeyed = |c: char| c.is_control() && !matches!(c, '\n' | '\t') || c == '\u{202e}';
        assert!(!ended.out.contains(is_obeyed) && !ended.err.contains(is_obeyed), "{args:?}: {}", ended.err);
    }
}

/// Names make no lines of their own, hide nothing, and do not fill the terminal.
#[test]
fn names_stay_on_their_line_and_within_bounds() {
    let folder = tempfile::tempdir().unwrap();
    let evil = "\\n\\u{2028}\\u{2029}\\u{200b}\\u{feff}a.rig.ron: ok";
    let long = "x".repeat(1 << 20);
    let joints: String =
        [evil, &long].map(|label| format!("(label: \"{label}\"), (label: \"{label}\", oops: 1), ")).concat();
    fs::write(folder.path().join("a.rig.ron"), format!("(format: 2, name: \"{evil}\", joints: [{joints}])")).unwrap();
    let joints: String = [evil, &long].map(|label| format!("(label: \"{label}\"), ")).concat();
    let whole = format!("(format: 2, name: \"{evil}\", joints: [{joints}])");
    fs::write(folder.path().join("b.rig.ron"), whole).unwrap();
    fs::write(folder.path().join("c.obj"), format!("mtllib {long}\nv 0 0 0\nv 1 0 0\nv 0 1 0\no {long}\nf 1 2 3\n"))
        .unwrap();
    for file in ["a.rig.ron", "b.rig.ron", "c.obj"] {
        for command in ["info", "check", "build"].into_iter().filter(|command| *command != "build" || file != "c.obj") {
            let (ended, _) = json_answer(folder.path(), &[command, file]);
            let said = run(folder.path(), &[command, file]);
            assert_eq!(said.code, ended.code, "{command} {file}");
            for text in [&said.out, &said.err] {
                assert!(text.len() < 100_000, "{command} {file}: {} bytes", text.len());
                let hidden = ['\u{2028}', '\u{2029}', '\u{200b}', '\u{feff}'];
                assert!(!text.contains(hidden), "{command} {file}: {text:.2000}");
                let forged = text.lines().any(|line| line.trim_start().starts_with("a.rig.ron: ok"));
                assert!(!forged, "{command} {file}: {text:.2000}");
            }
        }
    }
}

#[test]
fn a_minified_file_with_a_typo_shows_a_piece_of_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let biped = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/biped.rig");
    fs::copy(biped, folder.path().join("b.rig")).unwrap();
    json_answer(folder.path(), &["convert", "b.rig", "b.rig.ron"]);
    let text = fs::read_to_string(folder.path().join("b.rig.ron")).unwrap();
    let line = text.split_whitespace().collect::<Vec<&str>>().join(" ");
    let long = line.replacen("joints: [", &format!("joints: [{}", " ".repeat(70_000)), 1) + " oops";
    fs::write(folder.path().join("long.rig.ron"), long).unwrap();
    for command in ["check", "build", "info"] {
        let (ended, answer) = json_answer(folder.path(), &[command, "long.rig.ron"]);
        assert_eq!(ended.code, Some(1), "{command}: {answer}");
        let place = explained(&answer);
        assert!(place.starts_with("long.rig.ron:1:"), "{command}: {place}");
        let said = run(folder.path(), &[command, "long.rig.ron"]);
        assert!(said.err.len() + said.out.len() < 4000, "{command}: {} bytes", said.err.len() + said.out.len());
    }
}

/// A file of packed clips in which all nodes stay at rest: three bytes of each clip a node.
fn resting_clips(nodes: u64, clips: u64) -> Vec<u8> {
    let number = |out: &mut Vec<u8>, mut number: u64| {
        while number >= 0x80 {
            out.push(number as u8 | 0x80);
            number >>= 7;
        }
        out.push(number as u8);
    };
    let floats = |out: &mut Vec<u8>, list: &[f32]| list.iter().for_each(|number| out.extend(number.to_le_bytes()));
    let mut clip = b"rigclip1\0\0".to_vec();
    floats(&mut clip, &[30.0, 0.0]);
    number(&mut clip, 1);
    number(&mut clip, nodes);
    clip.resize(clip.len() + 3 * nodes as usize, 0);
    let mut out = b"rigpack1".to_vec();
    number(&mut out, nodes);
    for node in 0..nodes {
        out.extend((node + 1).to_le_bytes());
        out.extend([0, 0]);
        floats(&mut out, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]);
    }
    number(&mut out, clips);
    for _ in 0..clips {
        number(&mut out, clip.len() as u64);
        out.extend_from_slice(&clip);
    }
    out
}

/// Memory of a command, in bytes, that its input of `size` bytes may take.
fn memory_allowance(size: u64) -> u64 {
    (64 << 20) + 16 * size
}

#[test]
fn files_and_builds_stay_within_their_memory() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    // 200 buffers that name one file of 10 MB.
    fs::write(at("b.bin"), vec![0; 10_000_000]).unwrap();
    let buffers = vec![r#"{"uri":"b.bin","byteLength":10000000}"#; 200].join(",");
    fs::write(at("buffers.gltf"), format!(r#"{{"asset":{{"version":"2.0"}},"buffers":[{buffers}]}}"#)).unwrap();
    // Images that are not there, and names for each of them.
    let images: Vec<String> = (0..5000).map(|n| format!(r#"{{"uri":"texture_{n:08}.png"}}"#)).collect();
    fs::write(at("images.gltf"), format!(r#"{{"asset":{{"version":"2.0"}},"images":[{}]}}"#, images.join(",")))
        .unwrap();
    for (name, text) in triangles(6_000) {
        fs::write(at(name), text).unwrap();
    }
    // Objects of one triangle each, which are more than a file of this size may have.
    let object = |n: usize| format!("o p{n}\nv {n} 0 0\nv {n} 1 0\nv {n} 0 1\nf -3 -2 -1\n");
    fs::write(at("objects.obj"), (0..40_000).map(object).collect::<String>()).unwrap();
    fs::write(at("clips.rigclip"), resting_clips(1_000, 3_000)).unwrap();
    assert_eq!(load_packed_clips(&RealDisk, &at("clips.rigclip")).unwrap().clips.len(), 3_000);
    fs::write(at("two.rig"), skeleton(2, true)).unwrap();
    fs::write(at("dense.rigclip"), crate::packed_clips::dense_clip(1 << 20)).unwrap();
    fs::write(at("chain.rig"), skeleton(8_000, true)).unwrap();
    fs::write(at("long.rig"), skeleton(40_000, true)).unwrap();
    fs::write(at("longer.rig"), skeleton(64_000, true)).unwrap();
    fs::write(at("unknown.rig.ron"), tags(6_000, |_| command("nope", ""))).unwrap();
    fs::write(at("nulls.rig.ron"), chain_of_nulls(1_500)).unwrap();
    // Nodes that get one attribute after the other.
    let attributes: Vec<String> = (0..1_000).map(|n| format!("attribute(name: \"a{n}\")")).collect();
    let joint = |n: usize| format!("(label: \"j{n}\", tags: [{}])", attributes.join(", "));
    let joints: Vec<String> = (0..12).map(joint).collect();
    fs::write(at("attributes.rig.ron"), format!("(format: 2, name: \"n\", joints: [{}])", joints.join(", "))).unwrap();
    let size = |file: &str| fs::metadata(at(file)).unwrap().len();
    let cases = [
        (&["info", "buffers.gltf"][..], size("buffers.gltf") + 10_000_000),
        (&["check", "buffers.gltf"], size("buffers.gltf") + 10_000_000),
        (&["info", "images.gltf"], size("images.gltf")),
        (&["check", "stacked.obj"], size("stacked.obj")),
        (&["convert", "soup.obj", "soup.glb"], size("soup.obj")),
        (&["info", "clips.rigclip"], size("clips.rigclip")),
        (&["check", "clips.rigclip"], size("clips.rigclip")),
        (&["info", "dense.rigclip"], size("dense.rigclip")),
        (&["animate", "two.rig", "dense.rigclip", "-o", "dense.anim.ron"], size("dense.rigclip")),
        (&["check", "objects.obj"], size("objects.obj")),
        (&["convert", "objects.obj", "objects.glb"], size("objects.obj")),
        (&["check", "chain.rig"], size("chain.rig")),
        (&["convert", "chain.rig", "chain.rig.ron"], size("chain.rig")),
        (&["check", "unknown.rig.ron"], size("unknown.rig.ron")),
        (&["build", "unknown.rig.ron"], size("unknown.rig.ron")),
        (&["info", "chain.rig"], size("chain.rig")),
        (&["info", "longer.rig"], size("longer.rig")),
        (&["build", "chain.rig"], size("chain.rig")),
        (&["build", "chain.rig", "-o", "built.rig.ron"], size("chain.rig")),
        (&["build", "long.rig"], size("long.rig")),
        (&["build", "long.rig", "-o", "built.rig.ron"], size("long.rig")),
        (&["convert", "long.rig", "long.rig.ron"], size("long.rig")),
        (&["build", "nulls.rig.ron"], size("nulls.rig.ron")),
        (&["build", "attributes.rig.ron"], size("attributes.rig.ron")),
        (&["check", "attributes.rig.ron"], size("attributes.rig.ron")),
    ];
    for (args, size) in cases {
        let (ended, _) = json_answer(folder.path(), args);
        assert!(
            ended.memory <= memory_allowance(size),
            "{args:?}: {} KiB of {}",
            ended.memory >> 10,
            memory_allowance(size) >> 10
        );
    }
    // The chain that was written last, as a template.
    let ended = run(folder.path(), &["format", "--check", "long.rig.ron"]);
    assert_eq!(ended.code, Some(1), "it is not laid out by people");
    let allowance = memory_allowance(size("long.rig.ron"));
    assert!(ended.memory <= allowance, "format: {} KiB of {}", ended.memory >> 10, allowance >> 10);
}

/// Gigabytes that are no file of their kind are refused by their beginning, and what is too large is told as that.
#[test]
fn gigabytes_of_nothing_are_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let long = |name: &str, size: u64| fs::File::create(folder.path().join(name)).unwrap().set_len(size).unwrap();
    let large = ["zeros.glb", "zeros.gltf", "zeros.vrm", "zeros.skin", "zeros.bvh"].map(|name| (name, 3 << 30));
    // Packed clips and skeletons of more than a gigabyte are too large, whatever is in them.
    for (name, size) in large.into_iter().chain([("zeros.rigclip", 1 << 30), ("zeros.rig", 1 << 30)]) {
        long(name, size);
        let (ended, answer) = json_answer(folder.path(), &["check", name]);
        assert_eq!(ended.code, Some(1), "{answer}");
        assert!(ended.memory <= memory_allowance(0), "{name}: {} KiB", ended.memory >> 10);
        fs::remove_file(folder.path().join(name)).unwrap();
    }
    long("large.mtl", 65 << 20);
    fs::write(folder.path().join("a.obj"), "mtllib large.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n").unwrap();
    let (ended, answer) = json_answer(folder.path(), &["info", "a.obj"]);
    assert_eq!(ended.code, Some(0), "{answer}");
    let notes = answer["notes"].to_string();
    assert!(notes.contains("large.mtl") && notes.contains("too large") && !notes.contains("not found"), "{notes}");
}

/// A million frames of motion capture are read, and are too many for a clip.
#[test]
fn a_million_frames_of_motion_stay_within_their_memory() {
    let folder = tempfile::tempdir().unwrap();
    let walker = include_str!("retarget/walker.bvh");
    let (head, _) = walker.split_once("MOTION").unwrap();
    let width = rigsmith::rig::format::bvh::read_bvh(walker.as_bytes(), "walker").unwrap().width();
    let row = "0 90".to_owned() + &" 0".repeat(width - 2) + "\n";
    let text = format!("{head}MOTION\nFrames: 1000000\nFrame Time: 0.0083333\n{}", row.repeat(1_000_000));
    fs::write(folder.path().join("long.bvh"), &text).unwrap();
    for args in [&["info", "long.bvh"][..], &["animate", "biped.rig.ron", "long.bvh", "-o", "long.anim.ron"]] {
        let (ended, answer) = json_answer(folder.path(), args);
        assert_eq!(ended.code, Some(i32::from(args[0] == "animate")), "{args:?}: {answer}");
        assert!(args[0] == "animate" || answer.to_string().contains("1000000"), "{answer}");
        assert!(ended.memory <= memory_allowance(text.len() as u64), "{args:?}: {} KiB", ended.memory >> 10);
    }
    assert!(!folder.path().join("long.anim.ron").exists());
}

/// Commands that take a hostile file, by its kind.
fn commands_for(file: &str) -> Vec<Vec<&str>> {
    let kinds: [(&str, &[&[&str]]); 6] = [
        (".rig.ron", &[&["check", "FILE"], &["info", "FILE"], &["build", "FILE", "-o", "out.glb"]]),
        (".rig", &[&["check", "FILE"], &["info", "FILE"], &["convert", "FILE", "out.rig.ron"]]),
        (".obj", &[&["check", "FILE"], &["info", "FILE"], &["skin", "two.rig", "FILE", "-o", "out.glb"]]),
        (".gltf", &[&["check", "FILE"], &["info", "FILE"], &["convert", "FILE", "out.obj"]]),
        (".ron", &[&["check", "FILE"], &["sketch", "box.obj", "FILE", "-o", "out.glb"]]),
        ("", &[]),
    ];
    let (_, commands) = kinds.into_iter().find(|(ending, _)| file.ends_with(ending)).unwrap();
    let named = |args: &&[&'static str]| args.iter().map(|arg| if *arg == "FILE" { file } else { arg }).collect();
    commands.iter().map(named).collect()
}

#[test]
fn hostile_files_of_the_data_are_told_or_read() {
    let Some(data) = test_data() else { return };
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("two.rig"), "rig 1\njoint 0 -1 0 0 0 root\njoint 1 0 0 1 0 tip\n").unwrap();
    fs::write(folder.path().join("box.obj"), crate::cli::BOX).unwrap();
    let mut files: Vec<PathBuf> =
        fs::read_dir(data.join("hostile")).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    let mut count = 0;
    for file in files.iter().map(|file| file.to_str().unwrap()) {
        for args in commands_for(file) {
            json_answer(folder.path(), &args);
            count += 1;
            for output in ["out.glb", "out.obj"].map(|name| folder.path().join(name)) {
                if output.exists() {
                    load_model(&RealDisk, &output).unwrap_or_else(|error| panic!("{args:?}: {error}"));
                    fs::remove_file(output).unwrap();
                }
            }
            let _ = fs::remove_file(folder.path().join("out.rig.ron"));
        }
    }
    assert!(count > 40, "{count} commands");
}

#[test]
fn a_cut_template_is_told_as_one() {
    let arm = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates/parts/arm.rig.ron");
    let text = fs::read_to_string(arm).unwrap();
    let first = text.find('(').unwrap() + 1;
    for end in (first..text.trim_end().len() - 1).step_by(61) {
        let cut = &text[..text.floor_char_boundary(end)];
        let error = read_template(cut.as_bytes()).expect_err("a cut template is none");
        assert!(error.message.contains("cut short"), "{end} bytes: {error}");
        let faults = survey_template(cut.as_bytes()).expect_err("a cut template is none");
        assert!(faults.len() == 1 && faults[0] == error, "{end} bytes: {faults:?}");
    }
}
