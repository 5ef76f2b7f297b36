//! Limits of the process that a command runs in: small stacks and address spaces, and any number of threads.

#![cfg(target_os = "linux")]

use std::{
    path::Path,
    process::{Command, Output},
};

use serde_json::Value;

use crate::cli::explained;

/// Runs a command under limits of a shell.
fn limited(limit: &str, threads: Option<&str>, args: &[&str]) -> Output {
    let mut command = Command::new("sh");
    command.args(["-c", &format!("ulimit {limit} && exec \"$0\" \"$@\""), env!("CARGO_BIN_EXE_rigsmith")]);
    command.args(args).current_dir(Path::new(env!("CARGO_MANIFEST_DIR")));
    if let Some(threads) = threads {
        command.env("RAYON_NUM_THREADS", threads);
    }
    command.output().unwrap()
}

#[test]
fn commands_run_on_a_small_stack() {
    for args in [
        ["info", "assets/models/biped.obj"],
        ["check", "assets/templates/biped.rig.ron"],
        ["build", "assets/templates/biped.rig.ron"],
        ["modules", "--json"],
    ] {
        let output = limited("-s 64", None, &args);
        assert_eq!(output.status.code(), Some(0), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
        assert!(!output.stdout.is_empty(), "{args:?}");
    }
}

#[test]
fn a_small_address_space_is_told() {
    // Room for a program without its symbols, which are not loaded.
    let space = 480;
    let output = limited(&format!("-v {}", space << 10), None, &["info", "assets/models/biped.obj", "--json"]);
    let told = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(1), "{told}");
    let answer: Value = serde_json::from_str(&told).unwrap();
    let told = explained(&answer);
    assert!(told.contains(&format!("may address {space} MiB")) && told.contains("ulimit -v"), "{told}");
}

/// A million threads have stacks of terabytes.
#[test]
fn threads_are_as_many_as_make_sense() {
    for threads in ["1000000", "0", "x", "3"] {
        let output = limited("-v 33554432", Some(threads), &["check", "assets/models/biped.obj"]);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{threads}: {told}");
    }
}

/// Sixteen threads take a gigabyte for their heaps, and leave nothing of it for the command.
#[test]
fn threads_leave_room_for_the_command() {
    for space in [512, 1024] {
        let output = limited(&format!("-v {}", space << 10), Some("16"), &["info", "assets/models/biped.obj"]);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{space} MiB: {told}");
    }
}
