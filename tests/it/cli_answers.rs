//! Errors of every command for programs: one object of JSON, nothing beside it, with the file that is at fault.

use std::{collections::BTreeSet, fs, path::Path};

use serde_json::Value;

use crate::{
    cli::{BOX, explained},
    cli_outputs::rigsmith,
};

/// Commands that take no file, or go on until a person ends them: `watch` waits for a file that can be read.
const WITHOUT: [&str; 4] = ["edit", "help", "modules", "watch"];

/// Commands with what each may be given. `OBJ`, `RON`, `RIG` and `BVH` stand for the file that is at fault.
const COMMANDS: [&[&str]; 26] = [
    &["sketch", "OBJ", "g.ron", "-o", "out.rig"],
    &["sketch", "b.obj", "RON", "-o", "out.rig"],
    &["skin", "RIG", "b.obj", "-o", "out.glb"],
    &["skin", "a.rig", "OBJ", "-o", "out.glb"],
    &["fit", "OBJ", "-o", "out.rig.ron"],
    &["face", "OBJ", "-o", "out.glb"],
    &["convert", "OBJ", "out.glb"],
    &["convert", "RIG", "out.rig"],
    &["info", "OBJ"],
    &["info", "RIG"],
    &["check", "OBJ"],
    &["check", "j.rig.ron", "RIG"],
    &["format", "RIG"],
    &["merge", "RIG", "j.rig.ron", "-o", "out.rig.ron"],
    &["merge", "j.rig.ron", "RIG", "-o", "out.rig.ron"],
    &["inject", "RIG", "j.rig.ron", "--joints", "j", "-o", "out.rig.ron"],
    &["inject", "j.rig.ron", "RIG", "--joints", "j", "-o", "out.rig.ron"],
    &["extract", "RIG", "--joints", "j", "-o", "out.rig.ron"],
    &["diff", "RIG", "j.rig.ron"],
    &["diff", "j.rig.ron", "RIG"],
    &["update", "RIG", "--from", "j.rig.ron", "-o", "out.rig.ron"],
    &["update", "j.rig.ron", "--from", "RIG", "-o", "out.rig.ron"],
    &["build", "RIG", "-o", "out.glb"],
    &["pose", "RIG", "-o", "out.glb"],
    &["animate", "RIG", "walker.bvh", "-o", "out.anim.ron"],
    &["animate", "j.rig.ron", "BVH", "-o", "out.anim.ron"],
];

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [
        ("b.obj", BOX),
        ("a.rig", "rig 1\njoint 0 -1 0 -0.5 0 root\njoint 1 0 0 0.5 0 tip\n"),
        ("g.ron", "[Click((0.2, 0.2))]"),
        ("j.rig.ron", "(format: 2, name: \"n\", joints: [(label: \"j\")])"),
        ("walker.bvh", include_str!("retarget/walker.bvh")),
        ("damaged.obj", "v 0 0\n"),
        ("damaged.ron", "[Klick((0.2, 0.2))]"),
        ("damaged.rig.ron", "(format: 2, name: \"n\", joints: [(label: \"j\", oops: 1)])"),
        ("damaged.bvh", "HIER"),
    ] {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

/// Exit code of a command with `--json`, and the one value that it prints.
fn answer(folder: &Path, args: &[&str]) -> (i32, Value) {
    let (code, said) = rigsmith(folder, &[args, &["--json"]].concat());
    (code, serde_json::from_str(&said).unwrap_or_else(|error| panic!("{args:?}: {error}: {said}")))
}

#[test]
fn every_command_names_the_file_that_is_at_fault() {
    let folder = folder();
    for state in ["missing", "damaged"] {
        for command in COMMANDS {
            let file = |ending: &str| format!("{state}.{ending}");
            let (mut args, mut fault) = (Vec::new(), String::new());
            for arg in command {
                let named = match *arg {
                    "OBJ" => file("obj"),
                    "RON" => file("ron"),
                    "RIG" => file("rig.ron"),
                    "BVH" => file("bvh"),
                    _ => (*arg).to_owned(),
                };
                if named.starts_with(state) {
                    fault.clone_from(&named);
                }
                args.push(named);
            }
            let args: Vec<&str> = args.iter().map(String::as_str).collect();
            let (code, said) = answer(folder.path(), &args);
            let told = explained(&said);
            assert_eq!(code, 1, "{args:?}: {told}");
            let place = said["error"]["where"].as_str().unwrap_or_default();
            assert!(place == fault || place.starts_with(&format!("{fault}:")), "{args:?}: {told}");
            let written = ["out.rig", "out.rig.ron", "out.glb", "out.anim.ron"].map(|name| folder.path().join(name));
            assert!(!written.iter().any(|path| path.exists()), "{args:?}");
        }
    }
}

/// Faults that are not of a file's text name the thing and the file or folder that it would be in.
#[test]
fn errors_name_what_is_not_there_and_where() {
    let folder = folder();
    let cases: [(&[&str], &str, &str); 7] = [
        (&["extract", "j.rig.ron", "--joints", "elbow", "-o", "out.rig.ron"], "j.rig.ron", "elbow"),
        (&["inject", "j.rig.ron", "j.rig.ron", "--joints", "elbow", "-o", "out.rig.ron"], "j.rig.ron", "elbow"),
        (&["skin", "a.rig", "b.obj", "-o", "out.glb", "--rigid", "hat=tip"], "b.obj", "hat"),
        (&["new", "chain", "-o", "nowhere/x.rig.ron"], "nowhere/x.rig.ron", "nowhere"),
        (&["list", "nowhere"], "nowhere", "nowhere"),
        (&["convert", "b.obj", "nowhere/b.glb"], "nowhere/b.glb", "nowhere"),
        (&["modules", "elbow"], "command line", "elbow"),
    ];
    for (args, place, thing) in cases {
        let (code, said) = answer(folder.path(), args);
        let told = explained(&said);
        assert_eq!((code, said["error"]["where"].as_str()), (1, Some(place)), "{args:?}: {told}");
        assert!(told.contains(thing), "{args:?}: {told}");
    }
}

/// A command that is added has to be added to the table as well.
#[test]
fn every_command_is_in_the_table() {
    let folder = folder();
    let (_, help) = rigsmith(folder.path(), &["--help"]);
    let lines = help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let names = lines.filter_map(|line| line.strip_prefix("  ").filter(|line| !line.starts_with(' ')));
    let listed: BTreeSet<&str> = names.filter_map(|line| line.split_whitespace().next()).collect();
    let mut known: BTreeSet<&str> = COMMANDS.iter().map(|command| command[0]).chain(WITHOUT).collect();
    known.extend(["list", "new"]);
    // Pictures need an adapter; their errors of reading are those of the others.
    known.extend(listed.get("render"));
    assert_eq!(listed, known);
}
