//! Limits of commands: `--limit` sets them, and errors say which one and what went over it.

use std::{fs, path::Path, sync::Arc};

use rigsmith::{
    plugins::limits::{Limit, RigLimits},
    processor::{BuildProblem, Builder, review},
    rig::template::read_template,
};
use serde_json::Value;

use crate::{
    cli::explained,
    cli_outputs::{json, rigsmith},
};

const BOX: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
const GESTURES: &str = "[Click((0.2, 0.2)), Stroke(points: [(0.1, 0.1), (0.1, 0.2), (0.1, 0.4)])]";

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let chain: String = (0..6).map(|joint| format!("joint {joint} {} 0 {joint} 0 j{joint}\n", joint - 1)).collect();
    let tags: Vec<String> =
        (0..4).map(|number| format!("Command(module: \"attribute\", params: (name: \"a{number}\"))")).collect();
    let rig = format!(
        "(format: 2, name: \"n\", joints: [(label: \"j\", translation: (0, 0.1, 0), tags: [{}, {}])])",
        tags.join(", "),
        "Command(module: \"null\", params: (at: \"@any\")), Command(module: \"null\", params: (at: \"@any\"))"
    );
    for (name, text) in [
        ("chain.rig", format!("rig 1\n{chain}")),
        ("tags.rig.ron", rig),
        ("b.obj", BOX.to_owned()),
        ("g.ron", GESTURES.to_owned()),
    ] {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

#[test]
fn each_limit_can_be_set_and_is_named_by_its_error() {
    let folder = folder();
    let biped = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/models/biped.obj");
    let skeleton = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/models/biped.rig");
    let out = ["-o", "out.glb"];
    let (code, said) = rigsmith(folder.path(), &["skin", "chain.rig", "b.obj", "-o", "skinned.glb"]);
    assert_eq!(code, 0, "{said}");
    // Command, limit that is one too low, and what its error tells beside the name of the limit.
    let cases: [(&[&str], &str, &str); 16] = [
        (&["info", "chain.rig"], "joints=5", "the rig has 6 joints"),
        (&["check", "chain.rig"], "joints=5", "the rig has 6 joints"),
        (&["convert", "chain.rig", "out.rig.ron"], "joints=5", "the rig has 6 joints"),
        (&["build", "chain.rig"], "joints=5", "the rig has 6 joints"),
        (&["diff", "tags.rig.ron", "tags.rig.ron"], "joints=0", "the rig has 1 joints"),
        (&["info", "b.obj"], "points=3", "the mesh has 4 points"),
        (&["check", "b.obj"], "triangles=3", "the mesh has 4 triangles"),
        (&["skin", "chain.rig", "b.obj", out[0], out[1]], "points=3", "the mesh has 4 points"),
        (&["info", "skinned.glb"], "influences=3", "influences, and no more than 3 are taken"),
        (&["info", "g.ron"], "gestures=1", "the list has 2 gestures"),
        (&["sketch", "b.obj", "g.ron", out[0], "out.rig"], "stroke_points=2", "gesture 2 (Stroke) has 3 points"),
        (&["build", "tags.rig.ron"], "attributes=3", "attribute on j"),
        (&["build", "tags.rig.ron"], "nodes=1", "null on j"),
        (&["check", "tags.rig.ron"], "nodes=1", "null on joint j"),
        (&["build", "tags.rig.ron", out[0], out[1]], "work=3", "on j: there would be more than 3 values"),
        (&["skin", skeleton, biped, out[0], out[1]], "seconds=0", "binding the mesh took longer than 0 s"),
    ];
    for (args, setting, wanted) in cases {
        let (name, _) = setting.split_once('=').unwrap();
        let limited = [args, &["--limit", setting, "--json"]].concat();
        let (code, said) = rigsmith(folder.path(), &limited);
        assert_eq!(code, 1, "{limited:?}: {said}");
        let answer: Value = serde_json::from_str(&said).unwrap_or_else(|error| panic!("{error}: {said}"));
        let told = explained(&answer);
        assert!(told.contains(name), "{limited:?}: {told}");
        assert!(answer.to_string().contains(wanted), "{limited:?}: {answer:.800}");
        assert!(!folder.path().join("out.glb").exists(), "{limited:?}");
        // With the limits that hold otherwise the command is done.
        if !args.contains(&biped) {
            let (code, said) = rigsmith(folder.path(), args);
            assert_eq!(code, 0, "{args:?}: {said}");
            for written in ["out.glb", "out.rig", "out.rig.ron"] {
                let _ = fs::remove_file(folder.path().join(written));
            }
        }
    }
}

#[test]
fn commands_are_given_up_when_their_time_is_over() {
    let folder = folder();
    let walker = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/it/retarget/walker.bvh");
    let commands: [(&[&str], &str); 16] = [
        (&["check", "tags.rig.ron"], "checking the files"),
        (&["format", "tags.rig.ron"], "formatting the templates"),
        (&["format", "--check", "tags.rig.ron", "tags.rig.ron"], "formatting the templates"),
        (&["list", "."], "listing the templates"),
        (&["pose", "tags.rig.ron", "-o", "out.glb"], "building the rig"),
        (&["build", "tags.rig.ron", "-o", "out.glb"], "building the rig"),
        (&["animate", "tags.rig.ron", walker, "-o", "out.anim.ron"], "building the rig"),
        (&["merge", "tags.rig.ron", "tags.rig.ron", "-o", "out.rig.ron"], "merging the rigs"),
        (&["inject", "tags.rig.ron", "tags.rig.ron", "--joints", "j", "-o", "out.rig.ron"], "injecting the template"),
        (&["extract", "tags.rig.ron", "--joints", "j", "-o", "out.rig.ron"], "extracting the joints"),
        (&["convert", "b.obj", "out.glb"], "converting the file"),
        (&["convert", "chain.rig", "out.rig.ron"], "converting the file"),
        (&["convert", "chain.rig", "out.glb"], "converting the file"),
        (&["info", "chain.rig"], "reading the file"),
        (&["diff", "tags.rig.ron", "tags.rig.ron"], "comparing the templates"),
        (&["update", "tags.rig.ron", "--from", "tags.rig.ron", "-o", "out.rig.ron"], "updating the rig"),
    ];
    for (args, work) in commands {
        gives_up(folder.path(), args, work);
    }
}

/// Files of all kinds are read in their time, and a picture is drawn in it.
#[test]
fn reading_and_drawing_have_a_time() {
    let folder = folder();
    #[cfg(feature = "render")]
    for file in ["chain.rig", "tags.rig.ron", "b.obj"] {
        gives_up(folder.path(), &["render", file, "-o", "out.png"], "drawing the picture");
    }
    for file in ["chain.rig", "tags.rig.ron", "b.obj", "g.ron"] {
        gives_up(folder.path(), &["info", file], "reading the file");
    }
}

/// Fails unless a command without time says that its work took too long, and writes nothing.
fn gives_up(folder: &Path, args: &[&str], work: &str) {
    let (code, said) = rigsmith(folder, &[args, &["--limit", "seconds=0", "--json"]].concat());
    let answer: Value = serde_json::from_str(&said).unwrap_or_else(|error| panic!("{error}: {said}"));
    let told = explained(&answer);
    assert_eq!(code, 1, "{args:?}: {told}");
    assert!(told.contains(&format!("{work} took longer than 0 s and had to stop")), "{args:?}: {told}");
    assert!(told.contains("raise the limit `seconds`"), "{args:?}: {told}");
    for written in ["out.glb", "out.anim.ron", "out.rig.ron", "out.png"] {
        assert!(!folder.join(written).exists(), "{args:?}");
    }
}

/// A rig stays as it was built so far, and its command says why it goes no further.
#[test]
fn builds_begin_no_command_after_their_time() {
    let text = "(format: 2, name: \"n\", joints: [(label: \"j\", tags: [Command(module: \"null\")])])";
    let rig = read_template(text.as_bytes()).unwrap().rig;
    let mut modules = rigsmith::modules::all();
    modules.deadline = Some(RigLimits::default().with(Limit::Seconds, 0).deadline());
    let error = Builder::build(&rig, &Arc::new(modules.clone())).unwrap_err();
    assert!(matches!(error.problem, BuildProblem::OutOfTime(_)), "{error}");
    assert_eq!(review(&rig, &Arc::new(modules.clone())), [error]);
    modules.deadline = Some(RigLimits::default().deadline());
    assert!(Builder::build(&rig, &Arc::new(modules)).is_ok());
}

/// A review that went on behind the limit would build the rig anew for each command.
#[test]
fn a_rig_over_its_limit_has_one_problem() {
    let tags = vec!["Command(module: \"null\")"; 300].join(", ");
    let text = format!("(format: 2, name: \"n\", joints: [(label: \"j\", tags: [{tags}])])");
    let rig = read_template(text.as_bytes()).unwrap().rig;
    let mut modules = rigsmith::modules::all();
    modules.limits = RigLimits::default().with(Limit::Nodes, 50).build();
    let problems = review(&rig, &Arc::new(modules));
    assert_eq!(problems.len(), 1, "{problems:?}");
    assert!(problems[0].to_string().contains("more than 50 nodes and constraints"), "{problems:?}");
}

#[test]
fn what_is_told_has_limits() {
    let folder = folder();
    let run = |args: &[&str]| rigsmith(folder.path(), args);
    let (code, said) = run(&["info", "chain.rig", "--limit", "listed=2"]);
    assert!(code == 0 && said.contains("and 4 more") && !said.contains("j3"), "{said}");
    // A file with a note for each of two libraries of materials that are missing.
    fs::write(folder.path().join("notes.obj"), format!("mtllib one.mtl\nmtllib two.mtl\n{BOX}")).unwrap();
    let (code, said) = run(&["info", "notes.obj", "--limit", "notes=1"]);
    assert!(code == 0 && said.contains("1 more note is left out; --limit notes=N tells more"), "{said}");
    let missing = format!("{}.obj", "a".repeat(100));
    let (code, said) = run(&["info", &missing, "--limit", "message=60"]);
    assert!(code == 1 && said.len() < 100 && said.contains('…'), "{said}");
}

/// Errors in lists for programs have the limit of messages, too.
#[test]
fn errors_in_lists_are_short() {
    let folder = folder();
    let long = "x".repeat(100_000);
    let rig = |joint: String| format!("(format: 2, name: \"n\", joints: [({joint})])");
    for (name, text) in [
        ("label.rig.ron", rig(format!("label: \"{long}\", parent: \"{long}y\""))),
        ("module.rig.ron", rig(format!("label: \"a\", tags: [Command(module: \"{long}\")]"))),
        ("long.ron", format!("[SelectLabel(\"{long}\")]")),
    ] {
        fs::write(folder.path().join(name), text).unwrap();
    }
    for (args, list, key) in [
        (&["format", "label.rig.ron", "tags.rig.ron", "--check"][..], "files", "error"),
        (&["sketch", "b.obj", "long.ron", "-o", "o.rig.ron"], "gestures", "message"),
        (&["build", "module.rig.ron"], "commands", "error"),
    ] {
        let (_, told) = json(folder.path(), args);
        let error = told[list][0][key].as_str().unwrap_or_else(|| panic!("{args:?}: {told:.600}"));
        assert!(error.len() < 5_000 && error.contains('…'), "{args:?}: {} bytes", error.len());
    }
}

/// No build is nothing to wait for.
#[test]
fn a_watch_of_no_builds_is_refused() {
    let folder = folder();
    let (code, said) = rigsmith(folder.path(), &["watch", "tags.rig.ron", "-o", "out.glb", "--count", "0"]);
    assert_eq!(code, 2, "{said}");
    assert!(said.to_string().contains("--count"), "{said}");
    assert!(!folder.path().join("out.glb").exists());
}

#[test]
fn limits_are_listed_and_checked() {
    let folder = folder();
    let run = |args: &[&str]| rigsmith(folder.path(), args);
    let (code, said) = run(&["--help"]);
    assert_eq!(code, 0);
    for name in ["joints", "nodes", "attributes", "work", "points", "triangles", "influences", "gestures"] {
        assert!(said.lines().any(|line| line.trim_start().starts_with(&format!("{name} "))), "{name}: {said}");
    }
    for wrong in ["joints", "joints=-1", "joints=many", "nothing=3"] {
        for command in ["info", "edit"] {
            let (code, said) = run(&[command, "b.obj", "--limit", wrong]);
            assert!(code == 2 && said.contains("NAME=NUMBER"), "{command} {wrong}: {said}");
        }
    }
}
