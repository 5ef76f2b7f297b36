//! Names of files that are no Unicode, as other programs and old disks leave them: they are read, written and told, whatever
//! else is wrong with the command line.

use std::{
    ffi::{OsStr, OsString},
    fs,
    os::unix::ffi::OsStrExt,
    path::Path,
    process::{Command, Output, Stdio},
};

use serde_json::Value;

use crate::cli::{BOX, explained};

/// A name with a byte that no text in UTF-8 has.
fn name(ending: &str) -> OsString {
    OsStr::from_bytes(&[b"bad\xff".as_slice(), ending.as_bytes()].concat()).to_owned()
}

fn run(folder: &Path, args: &[&OsStr]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rigsmith"));
    command.current_dir(folder).args(args).stdin(Stdio::null()).output().unwrap()
}

#[test]
fn wrong_usage_with_a_name_that_is_no_unicode_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let (mesh, option) = (name(".obj"), OsStr::from_bytes(b"--nope\xff"));
    let json = OsStr::new("--json");
    let usages: [&[&OsStr]; 3] = [&["convert".as_ref(), &mesh], &[option], &["info".as_ref(), &mesh, "more".as_ref()]];
    for args in usages {
        let said = run(folder.path(), args);
        assert_eq!(said.status.code(), Some(2), "{args:?}: {}", String::from_utf8_lossy(&said.stderr));
        assert!(!said.stderr.is_empty(), "{args:?}");
        let answered = run(folder.path(), &[args, &[json]].concat());
        assert_eq!(answered.status.code(), Some(2), "{args:?}: {}", String::from_utf8_lossy(&answered.stderr));
        let answer: Value = serde_json::from_slice(&answered.stdout).unwrap();
        assert!(explained(&answer).contains("command line"), "{answer}");
    }
}

/// Files whose names are no Unicode are inputs and outputs as all others, where the disk takes such names.
#[test]
fn files_whose_names_are_no_unicode_are_read_and_written() {
    let folder = tempfile::tempdir().unwrap();
    let (mesh, model) = (name(".obj"), name(".gltf"));
    if fs::write(folder.path().join(&mesh), BOX).is_err() {
        eprintln!("skipped: the disk takes no name that is no Unicode");
        return;
    }
    let usages: [&[&OsStr]; 3] =
        [&["convert".as_ref(), &mesh, &model], &["info".as_ref(), &model], &["check".as_ref(), &model]];
    for args in usages {
        let said = run(folder.path(), &[args, &[OsStr::new("--json")]].concat());
        assert_eq!(said.status.code(), Some(0), "{args:?}: {}", String::from_utf8_lossy(&said.stdout));
        let answer: Value = serde_json::from_slice(&said.stdout).unwrap();
        assert_eq!(answer["ok"], true, "{answer}");
    }
    assert!(folder.path().join(&model).is_file());
    let missing = run(folder.path(), &["info".as_ref(), &name(".glb"), "--json".as_ref()]);
    assert_eq!(missing.status.code(), Some(1));
    let answer: Value = serde_json::from_slice(&missing.stdout).unwrap();
    assert!(explained(&answer).contains("bad"), "{answer}");
}
