//! Outputs of commands: they write over the files that they were told to, and nothing else.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use rigsmith::{
    files::{RealDisk, load_model, load_template, store_model},
    mesh::{gltf::GltfWriteSettings, model::Image},
    rig::Rig,
};
use serde_json::Value;

use crate::cli::BOX;

pub(super) fn rigsmith(folder: &Path, args: &[&str]) -> (i32, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_rigsmith")).current_dir(folder).args(args).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let said = text(&output.stdout) + &text(&output.stderr);
    assert!(!said.contains("panicked"), "{args:?} panicked: {said}");
    (output.status.code().unwrap(), said)
}

/// The rig of a template in a folder.
pub(super) fn rig(folder: &Path, name: &str) -> Rig {
    load_template(&RealDisk, &folder.join(name)).unwrap().rig
}

/// Runs the command with `--json`; its code, and the first value that it prints.
pub(super) fn json(folder: &Path, args: &[&str]) -> (i32, Value) {
    let (code, said) = rigsmith(folder, &[args, &["--json"]].concat());
    let start = said.find('{').unwrap_or_else(|| panic!("{args:?}: {said}"));
    let mut values = serde_json::Deserializer::from_str(&said[start..]).into_iter::<Value>();
    (code, values.next().unwrap().unwrap_or_else(|error| panic!("{args:?}: {error}: {said}")))
}

const RIG: &str = "rig 1\njoint 0 -1 0 -0.5 0 root\njoint 1 0 0 0.5 0 tip\n";

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [("b.obj", BOX), ("a.rig", RIG), ("no_mesh.gltf", r#"{"asset":{"version":"2.0"}}"#)] {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files.into_iter().filter(|path| path.is_file()).map(|path| (path.clone(), fs::read(path).unwrap())).collect()
}

#[test]
fn images_of_a_model_replace_no_photographs() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    let mut model = load_model(&RealDisk, &at("b.obj")).unwrap();
    let image = |name: &str, mime: &str, bytes: &[u8]| Image {
        name: name.into(),
        mime: mime.into(),
        bytes: bytes.to_vec(),
        ..Default::default()
    };
    model.material_set.images =
        vec![image("holiday", "image/png", b"\x89PNG\r\n\x1a\n"), image("wedding", "image/jpeg", b"\xff\xd8\xff\xe0")];
    store_model(&RealDisk, &at("album.glb"), &model, &GltfWriteSettings::default()).unwrap();
    fs::create_dir(at("out")).unwrap();
    let photographs = ["out/holiday.png", "out/wedding.jpg", "out/new.bin"];
    photographs.iter().for_each(|name| fs::write(at(name), "a photograph").unwrap());
    let (code, said) = rigsmith(folder.path(), &["convert", "album.glb", "out/new.gltf"]);
    assert_eq!(code, 0, "{said}");
    for name in photographs {
        assert_eq!(fs::read_to_string(at(name)).unwrap(), "a photograph", "{name}");
    }
    let back = load_model(&RealDisk, &at("out/new.gltf")).unwrap();
    assert_eq!((back.material_set.images.len(), back.notes), (2, vec![]));
}

#[test]
fn weights_are_saved_beside_a_character_that_is_there() {
    let folder = folder();
    let before = contents(folder.path());
    let args = ["skin", "a.rig", "b.obj", "-o", "missing/c.glb", "--save-weights", "c.skin"];
    let (code, said) = rigsmith(folder.path(), &args);
    assert_eq!((code, contents(folder.path())), (1, before), "{said}");
}

/// Names of the files and folders below a folder.
fn names_below(folder: &Path) -> Vec<PathBuf> {
    let mut names = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() && !path.is_symlink() {
                folders.push(path.clone());
            }
            names.push(path);
        }
    }
    names.sort();
    names
}

/// One output that cannot be written leaves none of the others behind.
#[test]
fn outputs_of_a_command_are_all_written_or_none() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    for name in ["mine", "new"] {
        let text = format!("(format: 2,   name: \"{name}\", joints: [(label: \"a\")])");
        fs::write(at(&format!("{name}.rig.ron")), text).unwrap();
    }
    fs::write(at("walker.bvh"), include_str!("retarget/walker.bvh")).unwrap();
    let (code, said) = rigsmith(folder.path(), &["animate", "biped.rig.ron", "walker.bvh", "-o", "w.anim.ron"]);
    assert_eq!(code, 0, "{said}");
    for name in ["folder.skin", "out/w.anim.ron", "demo/biped.glb"] {
        fs::create_dir_all(at(name)).unwrap();
    }
    #[cfg(unix)]
    for name in ["fitted.rig.ron.base", "updated.rig.ron.base"] {
        std::os::unix::fs::symlink("nowhere/base", at(name)).unwrap();
    }
    let commands: &[(&[&str], &str)] = &[
        (&["skin", "a.rig", "b.obj", "-o", "c.glb", "--save-weights", "folder.skin"], "folder.skin"),
        (&["skin", "a.rig", "b.obj", "-o", "c.gltf", "--save-weights", "nowhere/c.skin"], "nowhere/c.skin"),
        (
            &["animate", "biped.rig.ron", "walker.bvh", "--map-out", "map.ron", "-o", "nowhere/w.anim.ron"],
            "nowhere/w.anim.ron",
        ),
        (
            &["animate", "biped.rig.ron", "walker.bvh", "--map-out", "nowhere/map.ron", "-o", "x.anim.ron"],
            "nowhere/map.ron",
        ),
        (
            &[
                "update",
                "biped.rig.ron",
                "--from",
                "biped.rig.ron",
                "--take",
                "mine",
                "--clips",
                "w.anim.ron",
                "-o",
                "out/x.rig.ron",
            ],
            "out/w.anim.ron",
        ),
        #[cfg(unix)]
        (&["fit", "b.obj", "--template", "parts/tail", "-o", "fitted.rig.ron"], "fitted.rig.ron.base"),
        #[cfg(unix)]
        (
            &[
                "update",
                "mine.rig.ron",
                "--from",
                "new.rig.ron",
                "--take",
                "mine",
                "--keep-base",
                "-o",
                "updated.rig.ron",
            ],
            "updated.rig.ron.base",
        ),
    ];
    let before = (names_below(folder.path()), contents(folder.path()));
    for (args, place) in commands {
        let (code, told) = json(folder.path(), args);
        assert_eq!((code, told["error"]["where"].as_str()), (1, Some(*place)), "{args:?}: {told}");
        assert!((names_below(folder.path()), contents(folder.path())) == before, "{args:?} left something behind");
    }
    // The demonstration writes two files into the working folder.
    assert_eq!(rigsmith(&at("demo"), &["--json"]).0, 1);
    assert_eq!(names_below(&at("demo")), [at("demo/biped.glb")]);
    // All templates are put into their layout, or none.
    let mut rules = fs::metadata(at("new.rig.ron")).unwrap().permissions();
    rules.set_readonly(true);
    fs::set_permissions(at("new.rig.ron"), rules).unwrap();
    let (code, said) = rigsmith(folder.path(), &["format", "mine.rig.ron", "new.rig.ron"]);
    assert!(code == 1 && said.contains("write-protected"), "{said}");
    assert!(contents(folder.path()) == before.1, "one of two templates was formatted");
}

#[test]
fn an_input_is_no_output() {
    let folder = folder();
    let run = |args: &[&str]| rigsmith(folder.path(), args);
    assert_eq!(run(&["skin", "a.rig", "b.obj", "-o", "hero.glb", "--save-weights", "hero.skin"]).0, 0);
    fs::write(folder.path().join("strokes.ron"), "[]").unwrap();
    #[cfg(unix)]
    for (name, to) in
        [("link.obj", "b.obj"), ("link.skin", "hero.skin"), ("picture.png", "b.obj"), ("link.glb", "b.obj")]
    {
        std::os::unix::fs::symlink(to, folder.path().join(name)).unwrap();
    }
    fs::create_dir(folder.path().join("sub")).unwrap();
    let before = contents(folder.path());
    let refused: &[&[&str]] = &[
        // Outputs beside the main one are never an input or the main output.
        &["skin", "a.rig", "b.obj", "-o", "c.glb", "--save-weights", "b.obj"],
        &["skin", "a.rig", "b.obj", "-o", "c.glb", "--save-weights", "b.obj", "--in-place"],
        &["skin", "a.rig", "b.obj", "-o", "c.skin", "--save-weights", "c.skin"],
        &["skin", "a.rig", "b.obj", "-o", "c.skin", "--save-weights", "./sub/../C.SKIN"],
        &["skin", "a.rig", "b.obj", "-o", "c.glb", "--weights-from", "hero.skin", "--save-weights", "hero.skin"],
        &["skin", "a.rig", "b.obj", "-o", "hero.skin", "--weights-from", "hero.skin"],
        &["skin", "hero.glb", "b.obj", "-o", "./hero.glb"],
        &["convert", "b.obj", "b.obj"],
        &["convert", "b.obj", "./sub/../b.obj"],
        &["sketch", "hero.glb", "strokes.ron", "-o", "hero.glb"],
        &["face", "hero.glb", "-o", "hero.glb"],
        &["build", "hero.glb", "-o", "hero.glb"],
        #[cfg(unix)]
        &["skin", "a.rig", "b.obj", "-o", "c.glb", "--weights-from", "hero.skin", "--save-weights", "link.skin"],
        #[cfg(unix)]
        &["convert", "link.obj", "b.obj"],
        #[cfg(unix)]
        &["convert", "b.obj", "link.obj"],
        #[cfg(unix)]
        &["convert", "b.obj", "link.glb", "--in-place"],
        #[cfg(all(unix, feature = "render"))]
        &["render", "b.obj", "-o", "picture.png"],
    ];
    for args in refused {
        let (code, said) = run(args);
        assert_eq!(code, 2, "{args:?}: {said}");
        assert!(["input", "other output", ".skin"].iter().any(|words| said.contains(words)), "{args:?}: {said}");
        assert!(contents(folder.path()) == before, "{args:?} changed something");
    }
    // Whoever says so may.
    for args in [&["convert", "hero.glb", "hero.glb", "--in-place"][..], &["convert", "b.obj", "b.obj", "--in-place"]] {
        let (code, said) = run(args);
        assert_eq!(code, 0, "{args:?}: {said}");
    }
    assert_eq!(load_model(&RealDisk, &folder.path().join("b.obj")).unwrap().face_count(), 6);
}

/// Parts of a template are inputs, although nobody has named them.
#[test]
fn a_part_of_an_input_is_no_output() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("parts")).unwrap();
    let arm = "(format: 2, name: \"arm\", kind: \"part\", joints: [(label: \"a\")])";
    let man = "(format: 2, name: \"man\", joints: [(label: \"body\")], parts: [(part: \"parts/arm.rig.ron\", \
               name: \"l\", parent: \"body\")])";
    for (name, text) in [("parts/arm.rig.ron", arm), ("other.rig.ron", arm), ("man.rig.ron", man)] {
        fs::write(at(name), text).unwrap();
    }
    let commands: [&[&str]; 3] = [
        &["build", "man.rig.ron", "-o", "parts/arm.rig.ron"],
        &["convert", "man.rig.ron", "./parts/../parts/arm.rig.ron"],
        &["merge", "other.rig.ron", "man.rig.ron", "-o", "parts/arm.rig.ron"],
    ];
    for args in commands {
        let (code, said) = rigsmith(folder.path(), args);
        assert!(code == 2 && said.contains("is a part of the input"), "{args:?}: {said}");
        assert_eq!(fs::read_to_string(at("parts/arm.rig.ron")).unwrap(), arm, "{args:?}");
    }
    // Another file that is there is no part of it.
    let (code, said) = rigsmith(folder.path(), &["build", "man.rig.ron", "-o", "other.rig.ron"]);
    assert_eq!(code, 0, "{said}");
}

/// Buffers, materials and pictures that a mesh names are inputs, too, whatever their names end in.
#[test]
fn a_file_that_an_input_names_is_no_output() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    let run = |args: &[&str]| rigsmith(folder.path(), args);
    assert_eq!(run(&["convert", "b.obj", "made.gltf"]).0, 0);
    // The buffer has the name of a character, the picture that of another, and a library of materials that of a mesh.
    let text = fs::read_to_string(at("made.gltf")).unwrap();
    let buffer = text.split('"').find(|word| word.ends_with(".bin")).unwrap().to_owned();
    fs::rename(at(&buffer), at("buffer.glb")).unwrap();
    let picture = "\"images\": [{\"uri\": \"my%20picture.glb\"}], \"asset\"";
    fs::write(at("named.gltf"), text.replace(&buffer, "buffer.glb").replacen("\"asset\"", picture, 1)).unwrap();
    fs::write(at("my picture.glb"), b"\x89PNG\r\n\x1a\n").unwrap();
    fs::write(at("mtl.obj"), format!("mtllib colours.obj\n{BOX}")).unwrap();
    fs::write(at("colours.obj"), "newmtl red\nKd 1 0 0\n").unwrap();
    fs::remove_file(at("made.gltf")).unwrap();
    let before = contents(folder.path());
    for args in [
        &["skin", "a.rig", "named.gltf", "-o", "buffer.glb"][..],
        &["skin", "a.rig", "named.gltf", "-o", "my picture.glb"],
        &["skin", "a.rig", "named.gltf", "-o", "FOLDER/my picture.glb"],
        &["convert", "named.gltf", "buffer.glb", "--in-place"],
        &["convert", "mtl.obj", "colours.obj"],
    ] {
        let args: Vec<String> =
            args.iter().map(|arg| arg.replace("FOLDER", &folder.path().to_string_lossy())).collect();
        let (code, said) = run(&args.iter().map(String::as_str).collect::<Vec<_>>());
        assert!(code == 2 && said.contains("input"), "{args:?}: {said}");
        assert!(contents(folder.path()) == before, "{args:?} changed something");
    }
    assert_eq!(run(&["skin", "a.rig", "named.gltf", "-o", "other.glb"]).0, 0);
    assert_eq!(run(&["skin", "a.rig", "named.gltf", "-o", "other.glb"]).0, 0, "an output is no input the second time");
}

#[test]
fn nothing_is_written_where_there_is_nothing_to_write() {
    let folder = folder();
    fs::write(folder.path().join("body.obj"), BOX).unwrap();
    fs::write(folder.path().join("body.glb"), "work of days").unwrap();
    let before = contents(folder.path());
    for output in ["body.obj", "body.glb", "new.obj", "new.gltf"] {
        let (code, said) = rigsmith(folder.path(), &["convert", "no_mesh.gltf", output]);
        assert_eq!(code, 1, "{output}: {said}");
        assert!(said.contains("mesh") && said.contains(output), "{said}");
        assert!(contents(folder.path()) == before, "{output}");
    }
}

#[test]
fn a_skeleton_goes_through_glb_and_back() {
    let folder = folder();
    for (from, to) in [("a.rig", "a.glb"), ("a.glb", "back.rig"), ("a.rig", "a.gltf"), ("a.gltf", "again.rig")] {
        let (code, said) = rigsmith(folder.path(), &["convert", from, to]);
        assert_eq!(code, 0, "{from} to {to}: {said}");
    }
    let joints = |name: &str| {
        let text = fs::read_to_string(folder.path().join(name)).unwrap();
        text.lines().filter(|line| line.starts_with("joint")).map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(joints("a.rig"), joints("back.rig"));
    assert_eq!(joints("a.rig"), joints("again.rig"));
}

#[test]
fn the_demonstration_keeps_what_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let glb = folder.path().join("biped.glb");
    fs::write(&glb, "somebody's biped").unwrap();
    let (code, said) = rigsmith(folder.path(), &["--json"]);
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("kept the biped.glb"), "{said}");
    assert_eq!(fs::read_to_string(&glb).unwrap(), "somebody's biped");
}

#[test]
fn templates_are_formatted_in_place_or_not_at_all() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    let read = |name: &str| fs::read_to_string(at(name)).unwrap();
    let rough = "(format: 2, name: \"a\", // mine\n joints: [(label: \"j\"), (label: \"k\",parent:\"j\")])\n";
    let tidy = "(\n    format: 2,\n    name: \"a\", // mine\n    joints: [\n        (label: \"j\"),\n        (label: \"k\", parent: \"j\"),\n    ],\n)\n";
    fs::write(at("a.rig.ron"), rough).unwrap();
    let (code, said) = rigsmith(folder.path(), &["format", "--check", "a.rig.ron"]);
    assert_eq!((code, read("a.rig.ron").as_str()), (1, rough), "{said}");
    let (code, said) = rigsmith(folder.path(), &["format", "a.rig.ron"]);
    assert_eq!((code, read("a.rig.ron").as_str()), (0, tidy), "{said}");
    assert_eq!(rigsmith(folder.path(), &["format", "--check", "a.rig.ron"]).0, 0);
    let (code, said) = rigsmith(folder.path(), &["format", "--uids", "write", "a.rig.ron", "--json"]);
    assert!(code == 0 && said.contains("\"changed\":true"), "{said}");
    assert_eq!(read("a.rig.ron").matches("uid: ").count(), 3);
    assert_eq!(rigsmith(folder.path(), &["format", "--uids", "derive", "a.rig.ron"]).0, 0);
    assert_eq!(read("a.rig.ron"), tidy);
    // One file that is at fault, and none is touched; another kind of file is wrong usage.
    fs::write(at("a.rig.ron"), rough).unwrap();
    fs::write(at("bad.rig.ron"), "(format: 2, name: \"b\", joints: [(label: \"j\", parent: \"x\")])").unwrap();
    let (code, said) = rigsmith(folder.path(), &["format", "a.rig.ron", "bad.rig.ron"]);
    assert!(code == 1 && said.contains("no joint \"x\"") && said.contains("bad.rig.ron"), "{said}");
    assert_eq!(read("a.rig.ron"), rough);
    // All files are told at once, also those that are at fault.
    fs::write(at("worse.rig.ron"), "(format: 2, name: \"w\", joints: [(label: \"j\", parent: \"y\")])").unwrap();
    let (code, said) = json(folder.path(), &["format", "--check", "bad.rig.ron", "a.rig.ron", "worse.rig.ron"]);
    let told = |file: usize, text: &str| said["files"][file]["error"].as_str().is_some_and(|told| told.contains(text));
    assert!(code == 1 && told(0, "no joint \"x\"") && told(2, "no joint \"y\""), "{said}");
    assert!(said["files"][1]["changed"] == true && said["files"][1]["error"].is_null(), "{said}");
    assert_eq!(rigsmith(folder.path(), &["format", "b.obj"]).0, 2);
    // What is converted keeps what its author wrote.
    assert_eq!(rigsmith(folder.path(), &["convert", "a.rig.ron", "c.rig.ron"]).0, 0);
    assert_eq!(read("c.rig.ron"), rough);
}

/// An update and a fit keep a version of the template beside their output, under a name that nobody gave.
#[test]
fn the_version_that_is_kept_replaces_nothing_but_a_template() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    for name in ["mine", "new"] {
        let text = format!("(format: 2, name: \"{name}\", joints: [(label: \"a\")])");
        fs::write(at(&format!("{name}.rig.ron")), text).unwrap();
    }
    fs::write(at("out.rig.ron.base"), "work of days").unwrap();
    let update =
        ["update", "mine.rig.ron", "--from", "new.rig.ron", "--take", "mine", "--keep-base", "-o", "out.rig.ron"];
    let fit = ["fit", "b.obj", "--template", "parts/tail", "-o", "out.rig.ron"];
    for args in [&update[..], &fit] {
        let before = contents(folder.path());
        let (code, told) = json(folder.path(), args);
        assert_eq!(code, 1, "{args:?}: {told}");
        assert!(told["error"]["what"].as_str().unwrap().contains("out.rig.ron.base"), "{args:?}: {told}");
        assert!(contents(folder.path()) == before, "{args:?}");
    }
    fs::write(at("out.rig.ron.base"), "(format: 2, name: \"old\")").unwrap();
    let (code, told) = json(folder.path(), &update);
    assert_eq!(code, 0, "{told}");
    assert!(fs::read_to_string(at("out.rig.ron.base")).unwrap().contains("\"new\""));
}

/// Whoever updates the rig by its own name finds the version that was kept through a link.
#[cfg(unix)]
#[test]
fn the_version_of_a_link_is_kept_beside_the_file_that_it_leads_to() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("sub")).unwrap();
    for name in ["sub/real", "new"] {
        fs::write(at(&format!("{name}.rig.ron")), format!("(format: 2, name: \"{name}\", joints: [(label: \"a\")])"))
            .unwrap();
    }
    std::os::unix::fs::symlink("sub/real.rig.ron", at("link.rig.ron")).unwrap();
    let update = ["--from", "new.rig.ron", "--take", "theirs", "--keep-base"];
    let (code, told) = json(
        folder.path(),
        &[&["update", "link.rig.ron"][..], &update, &["-o", "link.rig.ron", "--in-place"]].concat(),
    );
    assert_eq!(code, 0, "{told}");
    assert!(at("link.rig.ron").is_symlink() && !at("link.rig.ron.base").exists());
    assert!(fs::read_to_string(at("sub/real.rig.ron.base")).unwrap().contains("\"new\""));
    let (code, told) = json(folder.path(), &["update", "sub/real.rig.ron", "--from", "new.rig.ron", "--dry-run"]);
    assert_eq!((code, told["base"].as_str()), (0, Some("sub/real.rig.ron.base")), "{told}");
}

#[test]
fn a_template_out_of_its_layout_is_told_in_three_parts() {
    let folder = folder();
    let text = "(format: 2,   name: \"n\", joints: [(label: \"a\")])";
    fs::write(folder.path().join("n.rig.ron"), text).unwrap();
    let (code, told) = json(folder.path(), &["format", "--check", "n.rig.ron"]);
    assert_eq!(code, 1, "{told}");
    assert_eq!(told["ok"], false, "{told}");
    assert_eq!(told["error"]["where"], "n.rig.ron", "{told}");
    for part in ["what", "do"] {
        assert!(told["error"][part].as_str().is_some_and(|said| !said.is_empty()), "{told}");
    }
    assert_eq!(fs::read_to_string(folder.path().join("n.rig.ron")).unwrap(), text);
}

#[test]
fn a_check_tells_the_place_that_the_reader_tells() {
    let folder = folder();
    let files = [
        ("m.gltf", r#"{"asset":{"version":"2.0"},"meshes":[{"primitives":[{"attributes":{"POSITION":7}}]}]}"#),
        ("p.rigsmith.ron", "(\n    format: 1,\n    name: 7,\n)"),
        ("c.anim.ron", "(\n    format: 1,\n    clips: 7,\n)"),
    ];
    for (name, text) in files {
        fs::write(folder.path().join(name), text).unwrap();
        let [of_info, of_check] = ["info", "check"].map(|command| {
            let (code, told) = json(folder.path(), &[command, name]);
            assert_eq!(code, 1, "{command} {name}: {told}");
            told["error"]["where"].as_str().unwrap().to_owned()
        });
        assert_eq!(of_check, of_info, "{name}");
        assert!(of_check.len() > name.len() && of_check.starts_with(name), "{of_check}");
    }
}

/// Readers of text know the line of a fault, and every command that reads it tells it.
#[test]
fn places_of_faults_have_lines() {
    let folder = folder();
    let files = [
        ("m.obj", "v 0 0 0\nv 1 x 0\n", "m.obj:2"),
        ("s.rig", "rig 1\njoint 0 -1 0 0 0 a\njoint 1 0 0 zero 0 b\n", "s.rig:3"),
        ("w.bvh", "HIERARCHY\nROOT hips\n{\n  OFFSET 0 up 0\n}\n", "w.bvh:4"),
    ];
    for (name, text, _) in files {
        fs::write(folder.path().join(name), text).unwrap();
    }
    let rig = "(format: 2, name: \"n\", joints: [(label: \"j\")])";
    fs::write(folder.path().join("j.rig.ron"), rig).unwrap();
    let of = |args: &[&str]| {
        let (code, told) = json(folder.path(), args);
        assert_eq!(code, 1, "{args:?}: {told}");
        told["error"]["where"].as_str().unwrap().to_owned()
    };
    for (name, _, place) in files {
        for command in ["info", "check"] {
            assert_eq!(of(&[command, name]), place, "{command}");
        }
    }
    assert_eq!(of(&["convert", "m.obj", "out.glb"]), "m.obj:2");
    assert_eq!(of(&["skin", "s.rig", "b.obj", "-o", "out.glb"]), "s.rig:3");
    assert_eq!(of(&["animate", "j.rig.ron", "w.bvh", "-o", "out.anim.ron"]), "w.bvh:4");
}
