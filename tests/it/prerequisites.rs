//! Test meshes and graphics adapters, which a machine may lack. A test without its prerequisite says on standard error
//! that it is skipped, or fails where `RIGSMITH_REQUIRE_DATA=1` or `RIGSMITH_REQUIRE_GPU=1` says that it must run.

use std::{collections::BTreeSet, io::Write, panic::Location, path::PathBuf, process::Command, sync::Mutex};

/// The bodies of the test data.
pub const BODIES: [&str; 7] = [
    "baby",
    "female_heavy_tpose",
    "female_young",
    "female_young_armsdown",
    "male_child_tpose",
    "male_muscular_action",
    "male_young",
];

/// Folder of test meshes that `RIGSMITH_DATA` names, for tests to which real meshes are an addition.
pub fn data_folder() -> Option<PathBuf> {
    let folder = PathBuf::from(std::env::var_os("RIGSMITH_DATA").filter(|folder| !folder.is_empty())?);
    assert!(
        folder.is_dir(),
        "RIGSMITH_DATA is {}, which is no folder; name the folder of test meshes",
        folder.display()
    );
    Some(folder)
}

/// Folder of test meshes, for tests that need it; without one the test is skipped.
#[track_caller]
pub fn test_data() -> Option<PathBuf> {
    let folder = data_folder();
    if folder.is_none() {
        skip("RIGSMITH_DATA names no folder with test meshes", "RIGSMITH_REQUIRE_DATA");
    }
    folder
}

/// Reports, once for each test, that it is skipped; panics where the environment variable `required` is 1.
///
/// Standard error is written to directly: the test harness hides what a passing test prints.
#[track_caller]
pub fn skip(reason: &str, required: &str) {
    static REPORTED: Mutex<BTreeSet<(String, String)>> = Mutex::new(BTreeSet::new());
    let is_required = std::env::var(required).is_ok_and(|value| value == "1");
    assert!(!is_required, "{required}=1, but {reason}");
    let test = std::thread::current().name().unwrap_or("a test").to_owned();
    let entry = (test.clone(), Location::caller().to_string());
    if REPORTED.lock().is_ok_and(|mut reported| reported.insert(entry)) {
        let _ = writeln!(std::io::stderr(), "skipped: {test}: {reason}");
    }
}

/// Runs one test of this binary without test meshes; whether it passed, and all that it said.
fn without_data(test: &str, required: &str) -> (bool, String) {
    let output = Command::new(std::env::current_exe().unwrap())
        .args([test, "--exact"])
        .env_remove("RIGSMITH_DATA")
        .env("RIGSMITH_REQUIRE_DATA", required)
        .output()
        .unwrap();
    let text = [output.stdout, output.stderr].concat();
    (output.status.success(), String::from_utf8_lossy(&text).into_owned())
}

#[test]
fn a_test_without_its_data_is_skipped_aloud_or_fails() {
    let test = "obj_torture::materials_are_found_where_they_are";
    let (passed, text) = without_data(test, "0");
    assert!(passed && text.contains(&format!("skipped: {test}: RIGSMITH_DATA")), "{text}");
    assert_eq!(text.matches("skipped:").count(), 1, "{text}");
    let (passed, text) = without_data(test, "1");
    assert!(!passed && text.contains("RIGSMITH_REQUIRE_DATA=1, but RIGSMITH_DATA names no folder"), "{text}");
}
