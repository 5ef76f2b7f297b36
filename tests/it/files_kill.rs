//! Killing a process that saves files that belong together, at any moment: they are whole, and the next save clears up.
//!
//! `RIGSMITH_KILLS` sets the number of kills, 24 otherwise.

use std::{
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::{
        Mutex,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

use rigsmith::files::RealDisk;

use crate::{
    files_set::{Kind, expected, furnished, names, temps},
    random::Random,
};

const FOLDER: &str = "RIGSMITH_TEST_SET_FOLDER";
const ROUND: &str = "RIGSMITH_TEST_SET_ROUND";
const KILLS: &str = "RIGSMITH_KILLS";
/// Versions that are saved in turn.
const VERSIONS: u32 = 7;

fn kind(round: u64) -> Kind {
    Kind::ALL[(round % 3) as usize]
}

/// Does nothing unless the test below starts it in a process of its own.
#[test]
fn child_that_saves_sets_until_killed() {
    let Some(folder) = std::env::var_os(FOLDER).map(PathBuf::from) else {
        return;
    };
    let round: u64 = std::env::var(ROUND).unwrap().parse().unwrap();
    println!("saving");
    let started = Instant::now();
    // In case the parent is gone.
    while started.elapsed() < Duration::from_secs(20) {
        for version in 1..=VERSIONS {
            kind(round).save(&RealDisk, &folder, version).unwrap();
            println!("saved {version}");
        }
    }
}

/// One kill: the saves before it, and the temporary files that it left.
fn kill_once(round: u64, folder: &Path) -> (u64, usize) {
    let (_, module) = module_path!().split_once("::").unwrap();
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args([&format!("{module}::child_that_saves_sets_until_killed"), "--exact", "--nocapture", "--test-threads=1"])
        .env(FOLDER, folder)
        .env(ROUND, round.to_string())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut output = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    while !line.contains("saving") {
        line.clear();
        assert!(output.read_line(&mut line).unwrap() > 0, "the child saves");
    }
    // Spread over several saves.
    std::thread::sleep(Duration::from_micros(Random(round ^ 0x5E7).below(40_000) as u64));
    child.kill().unwrap();
    child.wait().unwrap();
    let saves = output.lines().map_while(Result::ok).filter(|line| line.contains("saved")).count();

    let kind = kind(round);
    let context = format!("round {round}, {kind:?}, {saves} saves");
    let left = temps(folder);
    if saves > 0 || kind.main(folder).exists() {
        let version = kind.load(folder).unwrap_or_else(|error| panic!("{context}: {error}"));
        assert!((1..=VERSIONS).contains(&version), "{context}");
    }
    names(folder);
    kind.save(&RealDisk, folder, VERSIONS + 2).unwrap_or_else(|error| panic!("{context}: {error}"));
    assert_eq!(kind.load(folder), Ok(VERSIONS + 2), "{context}");
    assert_eq!(names(folder), expected(kind, VERSIONS + 2), "{context}");
    (saves as u64, left)
}

#[test]
fn killed_while_saving_sets_are_whole_and_nothing_stays() {
    let kills: u64 = std::env::var(KILLS).ok().and_then(|kills| kills.parse().ok()).unwrap_or(24);
    let next = AtomicU64::new(0);
    let outcomes = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                loop {
                    let round = next.fetch_add(1, Ordering::Relaxed);
                    if round >= kills {
                        return;
                    }
                    let folder = furnished();
                    let outcome = kill_once(round, folder.path());
                    outcomes.lock().unwrap().push(outcome);
                }
            });
        }
    });
    let mut outcomes = outcomes.into_inner().unwrap();
    assert_eq!(outcomes.len() as u64, kills);
    // Where no kill hit a save, more of them do.
    for round in kills..20 * kills {
        if outcomes.iter().any(|outcome| outcome.1 > 0) {
            break;
        }
        outcomes.push(kill_once(round, furnished().path()));
    }
    let saves: u64 = outcomes.iter().map(|outcome| outcome.0).sum();
    let littered = outcomes.iter().filter(|outcome| outcome.1 > 0).count();
    println!("{kills} kills after {saves} saves; {littered} left temporary files, all of which the next save removed");
    assert!(littered > 0, "no kill hit a save");
}
