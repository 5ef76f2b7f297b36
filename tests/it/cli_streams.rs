//! Standard output and standard error that are closed or full: the command ends with exit code 1, without a trace.

use std::{
    fs::{self, File, OpenOptions},
    path::Path,
    process::{Command, Stdio},
};

const BOX: &str = "mtllib missing.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
const RIG: &str = "rig 1\njoint 0 -1 0 0 0 root\njoint 1 0 0 0.5 0 tip\n";

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let gestures = "[Stroke(points: [(0.1, 0.1), (0.1, 0.4)])]";
    let template = "(format: 2, name: \"n\", joints: [(label: \"j\")])";
    for (name, text) in [("b.obj", BOX), ("a.rig", RIG), ("g.ron", gestures), ("j.rig.ron", template)] {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

/// A stream that takes nothing. A stream that is closed before the command starts is none of them: the runtime of Rust opens
/// the null device in its place, in the way in which other programs (Python, Node.js) open it to discard an output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stream {
    /// A device without room.
    Full,
    /// A pipe that nobody reads any more.
    Closed,
}

impl Stream {
    fn stdio(self) -> Stdio {
        match self {
            Self::Full => OpenOptions::new().write(true).open("/dev/full").unwrap().into(),
            Self::Closed => {
                let (reader, writer) = std::io::pipe().unwrap();
                drop(reader);
                writer.into()
            }
        }
    }
}

/// Exit code of a command, and what it wrote to the other stream.
fn run(folder: &Path, args: &[&str], stream: Stream, is_out: bool) -> (Option<i32>, String) {
    let other = folder.join("other.txt");
    let file = || Stdio::from(File::create(&other).unwrap());
    let (out, err) = if is_out { (stream.stdio(), file()) } else { (file(), stream.stdio()) };
    let mut command = Command::new(env!("CARGO_BIN_EXE_rigsmith"));
    command.current_dir(folder).args(args).env_remove("DISPLAY").stdin(Stdio::null()).stdout(out).stderr(err);
    let status = command.status().unwrap();
    (status.code(), fs::read_to_string(other).unwrap())
}

#[test]
fn an_output_that_takes_nothing_is_a_failure() {
    let folder = folder();
    let commands: [&[&str]; 21] = [
        &["--help"],
        &["build", "--help"],
        &["--version"],
        &["modules"],
        &["modules", "--json"],
        &["info", "b.obj"],
        &["info", "b.obj", "--json"],
        &["check", "b.obj", "missing.obj"],
        &["convert", "a.rig", "out.rig.ron"],
        &["build", "a.rig", "--json"],
        &["skin", "a.rig", "b.obj", "-o", "out.glb"],
        &["sketch", "b.obj", "g.ron", "-o", "out.rig"],
        &["new", "limb", "-o", "limb.rig.ron"],
        &["info", "missing.obj", "--json"],
        &["list", "."],
        &["diff", "j.rig.ron", "j.rig.ron"],
        &["merge", "j.rig.ron", "j.rig.ron", "-o", "merged.rig.ron"],
        &["extract", "j.rig.ron", "--joints", "j", "-o", "extracted.rig.ron"],
        &["update", "j.rig.ron", "--from", "j.rig.ron", "-o", "updated.rig.ron"],
        &["pose", "j.rig.ron", "--json"],
        &["watch", "j.rig.ron", "-o", "watched.glb", "--count", "1"],
    ];
    for args in commands {
        for stream in [Stream::Full, Stream::Closed] {
            // What the command before it wrote would stand in the way of `new`.
            let _ = fs::remove_file(folder.path().join("limb.rig.ron"));
            let (code, said) = run(folder.path(), args, stream, true);
            assert_eq!(code, Some(1), "{args:?} {stream:?}: {said}");
            assert!(!said.contains("panicked") && !said.contains("RUST_BACKTRACE"), "{args:?} {stream:?}: {said}");
        }
    }
}

/// Whoever discards an output has it discarded, however the null device was opened.
#[cfg(unix)]
#[test]
fn a_discarded_output_is_no_failure() {
    let folder = folder();
    for is_read in [false, true] {
        let null = OpenOptions::new().read(is_read).write(true).open("/dev/null").unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_rigsmith"));
        command.current_dir(folder.path()).args(["info", "a.rig"]).stdin(Stdio::null()).stdout(null);
        assert_eq!(command.status().unwrap().code(), Some(0), "opened for reading, too: {is_read}");
    }
}

#[test]
fn errors_and_notes_that_nobody_can_read_are_a_failure() {
    let folder = folder();
    for stream in [Stream::Full, Stream::Closed] {
        // The material library that is not there is a note.
        for (args, wanted) in [
            (&["info", "b.obj"][..], 1),
            (&["info", "missing.obj"], 1),
            (&["skin", "a.rig", "b.obj", "-o", "out.glb"], 1),
            (&["info", "a.rig"], 0),
            (&["no_such_command"], 2),
            (&["info", "b.obj", "--limit", "joints=many"], 2),
        ] {
            let (code, said) = run(folder.path(), args, stream, false);
            assert_eq!(code, Some(wanted), "{args:?} {stream:?}: {said}");
        }
    }
}
