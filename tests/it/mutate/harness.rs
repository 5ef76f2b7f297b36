//! Loop around the mutator: replays findings, tries a set number of mutants, and keeps what it finds.

use std::{
    fs,
    panic::{AssertUnwindSafe, catch_unwind},
    path::{Path, PathBuf},
    sync::mpsc,
    time::{Duration, Instant},
};

use super::Mutator;
use crate::random::Random;

/// One input that takes longer than this counts as a hang.
const HANG: Duration = Duration::from_secs(60);
/// Inputs grow by splicing and repeating, up to this many bytes or four times the largest seed.
const MAX_LEN: usize = 64 << 10;
/// Number of mutants that are kept as further seeds.
const POOL: usize = 256;
/// Mutants that a test tries, on every machine the same ones.
const MUTANTS: u64 = 4000;
/// Targets, each with a folder of findings of its own.
const TARGETS: [&str; 24] = [
    "animation",
    "bvh",
    "edit_sequence",
    "entity_writes",
    "gestures",
    "gltf",
    "journal",
    "obj",
    "packed_clips",
    "peer_gltf",
    "peer_obj",
    "pose_command",
    "project",
    "remote_calls",
    "rig",
    "skin",
    "template",
    "update",
    "whole_clip",
    "whole_gestures",
    "whole_model",
    "whole_project",
    "whole_skin",
    "whole_template",
];
/// Largest numbers of bytes from which generators make an input, small ones as often as large ones.
const CHOICES: [usize; 4] = [16, 128, 512, 2048];

/// Extent of a run.
#[derive(Debug, Clone, Copy)]
enum Budget {
    Mutants(u64),
    Seconds(f64),
}

/// The folder of the findings of one target.
pub fn findings(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz_findings").join(name)
}

/// Replays what was found before, then calls `check` with mutants of `seeds`: a set number of them, or as many as fit into
/// `RIGSMITH_FUZZ_SECONDS`.
///
/// `check` panics where something is wrong: a reader that must not panic, or a promise about what was read. Such an input,
/// and one that takes longer than a minute, is written to `tests/fuzz_findings/NAME/`, and the test fails naming it.
pub fn run_fuzz(name: &str, seeds: &[Vec<u8>], dictionary: &[&[u8]], check: impl Fn(&[u8])) {
    assert!(TARGETS.contains(&name), "{name} is not among the targets");
    run_fuzz_for(Budget::of(MUTANTS), name, seeds, dictionary, check);
}

/// Replays what was found before, then calls `check` with seeded bytes, from which it makes its input: `count` times, or as
/// often as fits into `RIGSMITH_FUZZ_SECONDS`. Findings are kept as those of [`run_fuzz`].
pub fn run_seeded(name: &str, count: u64, check: impl Fn(&[u8])) {
    assert!(TARGETS.contains(&name), "{name} is not among the targets");
    let budget = Budget::of(count);
    let attempts = Attempts { name, watch: Watch::new(name), check };
    let replayed = attempts.replay();
    let mut random = Random(first_seed());
    let (started, mut runs) = (Instant::now(), 0u64);
    while budget.has_room(runs, started) {
        let longest = random.pick(&CHOICES);
        let bytes: Vec<u8> = (0..random.below(longest)).map(|_| random.next() as u8).collect();
        attempts.make(&bytes, &format_args!("run {runs}"));
        runs += 1;
    }
    println!("{name}: {replayed} findings replayed, {runs} inputs in {:.1} s", started.elapsed().as_secs_f64());
}

impl Budget {
    fn of(count: u64) -> Self {
        number_from("RIGSMITH_FUZZ_SECONDS").map_or(Self::Mutants(count), Self::Seconds)
    }

    fn has_room(self, runs: u64, started: Instant) -> bool {
        match self {
            Self::Mutants(count) => runs < count,
            Self::Seconds(seconds) => started.elapsed().as_secs_f64() < seconds,
        }
    }
}

/// Start of the random sequence.
fn first_seed() -> u64 {
    number_from("RIGSMITH_FUZZ_SEED").unwrap_or(1.0) as u64
}

/// Attempts of one target.
struct Attempts<'a, F> {
    name: &'a str,
    watch: Watch,
    check: F,
}

impl<F: Fn(&[u8])> Attempts<'_, F> {
    /// Checks one input; keeps it and fails where something is wrong.
    fn make(&self, bytes: &[u8], origin: &dyn std::fmt::Display) {
        self.watch.begin(bytes);
        let outcome = try_one(bytes, &self.check);
        self.watch.end();
        if let Err(problem) = outcome {
            let path = save_finding(self.name, bytes);
            panic!("{}: {origin} fails: {problem}; kept as {}", self.name, path.display());
        }
    }

    /// Checks what was found before; returns how much it is.
    fn replay(&self) -> usize {
        let keep = findings(self.name);
        let mut known: Vec<PathBuf> =
            fs::read_dir(&keep).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path())).collect();
        known.sort();
        for path in &known {
            self.make(&fs::read(path).unwrap(), &format_args!("the finding {}", path.display()));
        }
        known.len()
    }
}

fn run_fuzz_for(budget: Budget, name: &str, seeds: &[Vec<u8>], dictionary: &[&[u8]], check: impl Fn(&[u8])) {
    assert!(!seeds.is_empty(), "{name}: no seeds");
    let attempts = Attempts { name, watch: Watch::new(name), check };
    let replayed = attempts.replay();
    for (i, seed) in seeds.iter().enumerate() {
        attempts.make(seed, &format_args!("seed {i}"));
    }

    let start = first_seed();
    let longest = seeds.iter().map(Vec::len).max().unwrap_or(0);
    let mut mutator = Mutator::new(start, dictionary, MAX_LEN.max(4 * longest));
    let mut pool: Vec<Vec<u8>> = Vec::new();
    let (started, mut runs) = (Instant::now(), 0u64);
    while budget.has_room(runs, started) {
        let source = |random: &mut Random, pool: &[Vec<u8>]| -> Vec<u8> {
            // Mutants of mutants reach further, but most of the time goes to what is nearly right.
            if pool.is_empty() || !random.chance(4) { random.pick(seeds) } else { random.pick(pool) }
        };
        let input = source(&mut mutator.random, &pool);
        let other = source(&mut mutator.random, &pool);
        let mutant = mutator.mutate(&input, &other);
        attempts.make(&mutant, &format_args!("run {runs}"));
        if mutator.random.chance(16) {
            match pool.len() {
                POOL => {
                    let old = mutator.random.below(POOL);
                    pool[old] = mutant;
                }
                _ => pool.push(mutant),
            }
        }
        runs += 1;
    }
    println!("{name}: {replayed} findings replayed, {runs} mutants in {:.1} s", started.elapsed().as_secs_f64());
}

fn number_from(variable: &str) -> Option<f64> {
    let text = std::env::var(variable).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{variable} is `{text}`; give a number")))
}

/// Calls `check`, and says what went wrong.
fn try_one(bytes: &[u8], check: impl Fn(&[u8])) -> Result<(), String> {
    let started = Instant::now();
    catch_unwind(AssertUnwindSafe(|| check(bytes))).map_err(|panic| {
        let text = panic.downcast_ref::<String>().cloned();
        text.or_else(|| panic.downcast_ref::<&str>().map(|&text| text.to_owned()))
            .unwrap_or_else(|| "a panic".to_owned())
    })?;
    match started.elapsed() {
        took if took > HANG => Err(format!("it took {took:?}")),
        _ => Ok(()),
    }
}

/// Writes a finding under a name made from its content, so that the same one is not kept twice.
fn save_finding(name: &str, bytes: &[u8]) -> PathBuf {
    let hash = bytes.iter().fold(0xCBF2_9CE4_8422_2325u64, |h, &b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01B3));
    let folder = findings(name);
    let path = folder.join(format!("{hash:016x}"));
    fs::create_dir_all(&folder).unwrap();
    fs::write(&path, bytes).unwrap();
    path
}

/// Keeps the input of a run that never comes back, which nothing in its own thread could.
struct Watch {
    inputs: mpsc::Sender<Option<Vec<u8>>>,
}

impl Watch {
    fn new(name: &str) -> Self {
        let (inputs, received) = mpsc::channel::<Option<Vec<u8>>>();
        let name = name.to_owned();
        std::thread::spawn(move || {
            let mut current = None;
            loop {
                match received.recv_timeout(HANG) {
                    Ok(input) => current = input,
                    Err(mpsc::RecvTimeoutError::Timeout) => {
                        if let Some(input) = &current {
                            let path = save_finding(&name, input);
                            eprintln!("{name}: no answer for {HANG:?}; the input is kept as {}", path.display());
                            // A thread cannot be stopped from outside, and the test would never end.
                            std::process::exit(101);
                        }
                    }
                    Err(mpsc::RecvTimeoutError::Disconnected) => return,
                }
            }
        });
        Self { inputs }
    }

    fn begin(&self, input: &[u8]) {
        let _ = self.inputs.send(Some(input.to_vec()));
    }

    fn end(&self) {
        let _ = self.inputs.send(None);
    }
}

#[test]
fn a_panic_is_found_and_kept_as_a_file() {
    let name = format!("self_test_{}", std::process::id());
    let outcome = catch_unwind(|| {
        run_fuzz_for(Budget::Mutants(200_000), &name, &[b"value 17".to_vec()], &[], too_large);
    });
    let kept: Vec<_> = fs::read_dir(findings(&name)).unwrap().map(|entry| entry.unwrap().path()).collect();
    let content = fs::read(&kept[0]).unwrap();
    // The next run fails with what was kept, before anything is mutated.
    let replay = catch_unwind(|| run_fuzz_for(Budget::Mutants(0), &name, &[b"value 17".to_vec()], &[], too_large));
    fs::remove_dir_all(findings(&name)).unwrap();
    let message = *outcome.unwrap_err().downcast::<String>().unwrap();
    assert_eq!(kept.len(), 1);
    assert!(content.ends_with(b"18446744073709551616"));
    assert!(message.contains("too large") && message.contains(kept[0].to_str().unwrap()), "{message}");
    let message = *replay.unwrap_err().downcast::<String>().unwrap();
    assert!(message.contains("the finding") && message.contains("too large"), "{message}");
}

fn too_large(bytes: &[u8]) {
    assert!(!bytes.ends_with(b"18446744073709551616"), "too large");
}

#[test]
fn every_folder_of_findings_has_a_target_that_replays_it() {
    let all = findings("");
    let folders: Vec<String> = (fs::read_dir(&all).unwrap())
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .filter(|name| !name.starts_with("self_test_"))
        .collect();
    assert!(!folders.is_empty(), "{} is empty", all.display());
    assert!(folders.iter().all(|folder| TARGETS.contains(&folder.as_str())), "{folders:?}");
    for folder in folders {
        assert!(fs::read_dir(all.join(&folder)).unwrap().count() > 0, "{folder} is empty");
    }
}
