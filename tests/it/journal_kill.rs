//! Killing a process that edits, at any moment: what it did is recovered, but for the last blink.
//!
//! `RIGSMITH_KILLS` sets the number of kills, 20 otherwise, on a machine that does nothing else: no lost change may then be
//! older than a quarter of a second.

use std::{
    fs,
    io::{BufRead, BufReader, Write},
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::{
        Arc, Mutex,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant, SystemTime},
};

use bevy::prelude::*;
use rigsmith::{
    files::{
        RealDisk,
        journal::{Basis, Journal, JournalPlaces, JournalStart, SaveMark, file_hash, pending_journals, recover},
        save_atomic,
    },
    headless::headless_app,
    mesh::model::Weights,
    plugins::journal::RigJournal,
    prelude::{Change, Operation},
    rig::{
        PoseOffset, Rig, RigEdit, SkinData, Uid,
        step::{Commit, SinkError, StepSink},
        template::{read_template, write_template},
    },
};

use crate::{
    bench::{HANG, RigBench},
    random::Random,
};

const FOLDER: &str = "RIGSMITH_TEST_JOURNAL_FOLDER";
const SEED: &str = "RIGSMITH_TEST_JOURNAL_SEED";
const KILLS: &str = "RIGSMITH_KILLS";
/// Time whose changes may be lost at most.
const BLINK: Duration = Duration::from_millis(250);
/// Number of kills that go on at the same time.
const TOGETHER: usize = 4;

/// A rig that is edited at random; the same seed gives the same edits.
struct EditSession {
    base: RigBench,
    random: Random,
    saves: bool,
}

impl EditSession {
    fn new(seed: u64) -> Self {
        let mut app = headless_app(seed);
        app.finish();
        app.cleanup();
        let base = RigBench::with(app, Rig::new(Uid(seed), "victim"));
        Self { base, random: Random(seed), saves: seed.is_multiple_of(2) }
    }

    /// One change; true if the project should be saved before it.
    fn step(&mut self) -> bool {
        let random = &mut self.random;
        let (rig, head) = (self.base.rig(), self.base.steps());
        let joints: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
        let pick = |random: &mut Random| joints.get(random.below(joints.len().max(1))).copied();
        let mut place = || Vec3::from(std::array::from_fn(|_| random.below(1000) as f32 / 77.0));
        let position = place();
        let (parent, kind) = (pick(random), random.below(20));
        let change = match (kind, parent) {
            (0..=3, Some(_)) if head > 0 => Change::Undo,
            (4..=5, _) => Change::Redo,
            (6, Some(joint)) if joints.len() > 20 => {
                Change::Do(Operation::Delete { joints: vec![joint], keep_children: true })
            }
            (7..=12, Some(joint)) => Change::Do(Operation::Move { to: vec![(joint, position)], with_children: false }),
            (13, Some(joint)) => Change::Do(Operation::Labels(vec![(joint, format!("joint \"{kind}\""))])),
            // What a template cannot hold is left to those that do not save.
            (14, Some(joint)) if !self.saves => Change::Do(Operation::Edits(vec![RigEdit::SetOffset(
                joint,
                Some(PoseOffset { translation: position, ..default() }),
            )])),
            (15, Some(_)) if !self.saves => {
                let count = 2000 + self.random.below(2000) as u32;
                let weights = Weights {
                    starts: (0..=count).collect(),
                    joints: (0..count).map(|point| point % joints.len() as u32).collect(),
                    values: (0..count).map(|point| 0.5 + 1.0 / (point + 1) as f32).collect(),
                };
                let skin = SkinData { joints: joints.clone(), weights, at_rest: true, ..Default::default() };
                Change::Do(Operation::Edits(vec![RigEdit::SetSkin(Uid(3), Some(Arc::new(skin)))]))
            }
            _ => Change::Do(Operation::Place { position, parent }),
        };
        self.base.change(change);
        self.saves && self.random.chance(40)
    }
}

/// Counts what would be written.
#[derive(Clone, Default)]
struct Counter(Arc<AtomicU64>);

impl StepSink for Counter {
    fn record(&self, _committed: Commit) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }

    fn trouble(&self) -> Option<SinkError> {
        None
    }

    fn flush(&self, _limit: Duration) -> Result<(), SinkError> {
        Ok(())
    }
}

fn micros() -> u128 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap().as_micros()
}

/// Does nothing unless the test below starts it in a process of its own.
#[test]
fn child_that_edits_until_killed() {
    let Some(folder) = std::env::var_os(FOLDER).map(PathBuf::from) else {
        return;
    };
    let seed: u64 = std::env::var(SEED).unwrap().parse().unwrap();
    let mut editing = EditSession::new(seed);
    let project = folder.join("victim.rigsmith.ron");
    let places = JournalPlaces { project: None, state: Some(folder.clone()) };
    let rig = Some(editing.base.rig().clone());
    let journal = Journal::start(Arc::new(RealDisk), JournalStart { places: places.clone(), rig, ..default() });
    let rig = editing.base.rig;
    editing.base.app.world_mut().entity_mut(rig).insert(RigJournal::new(journal.clone()));
    let mut pause = Random(seed ^ 0xFACE);
    let started = Instant::now();
    let mut saving: Option<std::thread::JoinHandle<()>> = None;
    // In case the parent is gone.
    while started.elapsed() < HANG {
        let save = editing.step();
        // When the change can be seen it counts as done.
        println!("done {} {}", journal.position(), micros());
        std::io::stdout().flush().unwrap();
        // As an editor would, beside editing; one save at a time.
        if save && saving.as_ref().is_none_or(|thread| thread.is_finished()) {
            let text = write_template(editing.base.rig());
            let mark =
                SaveMark { path: project.clone(), hash: file_hash(text.as_bytes()), position: journal.position() };
            let (journal, places) =
                (journal.clone(), JournalPlaces { project: Some(project.clone()), ..places.clone() });
            saving = Some(std::thread::spawn(move || {
                journal.saving(mark.clone(), HANG).unwrap();
                save_atomic(&RealDisk, &mark.path, text.as_bytes()).unwrap();
                journal.saved(mark, places);
            }));
        }
        std::thread::sleep(Duration::from_micros(1000 + pause.below(4000) as u64));
    }
}

/// Outcome of one kill.
#[derive(Debug, Default, Clone, Copy)]
struct Outcome {
    changes: u64,
    lost: u64,
    /// Age of the oldest lost change when its process was killed.
    oldest: Duration,
    recovery: Duration,
    saved: bool,
}

fn kill_once(round: u64, folder: &Path) -> Outcome {
    let (_, module) = module_path!().split_once("::").unwrap();
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args([&format!("{module}::child_that_edits_until_killed"), "--exact", "--nocapture", "--test-threads=1"])
        .env(FOLDER, folder)
        .env(SEED, round.to_string())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let output = BufReader::new(child.stdout.take().unwrap());
    let lines = Arc::new(Mutex::new(Vec::<(u64, u128)>::new()));
    let reader = std::thread::spawn({
        let lines = lines.clone();
        move || {
            for line in output.lines().map_while(Result::ok) {
                // A kill may cut the last line.
                let mut words = line.split(' ').skip_while(|word| !word.ends_with("done")).skip(1);
                if let (Some(position), Some(time)) = (words.next(), words.next())
                    && let (Ok(position), Ok(time)) = (position.parse(), time.parse::<u128>())
                    && time > 1_000_000_000_000_000
                {
                    lines.lock().unwrap().push((position, time));
                }
            }
        }
    });
    // Killed after some number of changes, and somewhere within the next.
    let mut random = Random(round ^ 0xBEEF);
    let (patience, changes) = (Instant::now(), 1 + random.below(250));
    while lines.lock().unwrap().len() < changes {
        assert!(patience.elapsed() < HANG, "round {round}: the child does not edit");
        std::thread::sleep(Duration::from_micros(200));
    }
    std::thread::sleep(Duration::from_micros(random.below(5_000) as u64));
    let killed = micros();
    child.kill().unwrap();
    child.wait().unwrap();
    reader.join().unwrap();
    let lines = std::mem::take(&mut *lines.lock().unwrap());

    let started = Instant::now();
    let pending = pending_journals(&RealDisk, folder);
    assert!(pending.len() <= 1, "round {round}: {pending:?}");
    let project = fs::read(folder.join("victim.rigsmith.ron")).ok();
    let saved = project.as_ref().map(|bytes| read_template(bytes).unwrap().rig);
    let hash = |_: &Path| project.as_ref().map(|bytes| file_hash(bytes));
    let mut outcome = Outcome { saved: saved.is_some(), ..default() };
    let rig = match pending.first() {
        Some(pending) => {
            assert!(!pending.project_changed, "round {round}");
            let recovered = recover(&fs::read(&pending.path).unwrap()).unwrap();
            let basis = recovered.basis(hash);
            assert_ne!(basis, Basis::Changed, "round {round}");
            let back = recovered.replay(basis, saved);
            assert_eq!(back.refused, None, "round {round}");
            assert!(back.applied == recovered.changes().len(), "round {round}");
            back.rig
        }
        // Killed before the first change, or right after everything was saved.
        None => saved.unwrap_or_else(|| Rig::new(Uid(round), "victim")),
    };
    outcome.recovery = started.elapsed();

    // The same edits once more tell which state that is.
    let last = lines.last().map_or(0, |line| line.0);
    let mut again = EditSession::new(round);
    let counter = Counter::default();
    let entity = again.base.rig;
    again.base.app.world_mut().entity_mut(entity).insert(RigJournal::new(counter.clone()));
    let mut held = (again.base.rig() == &rig).then_some(0);
    // One change may have been written that could not be told any more; undo may come back to a former state.
    while counter.0.load(Ordering::Relaxed) <= last {
        again.step();
        if again.base.rig() == &rig {
            held = Some(counter.0.load(Ordering::Relaxed));
        }
    }
    let held = held.unwrap_or_else(|| panic!("round {round}: the recovered rig never was, {last} changes"));
    outcome.changes = last;
    outcome.lost = last.saturating_sub(held);
    let oldest = lines.iter().find(|(position, _)| *position > held);
    outcome.oldest =
        oldest.map_or(Duration::ZERO, |(_, time)| Duration::from_micros(killed.saturating_sub(*time) as u64));
    outcome
}

#[test]
fn killed_while_editing_at_most_a_blink_is_lost() {
    let kills: u64 = std::env::var(KILLS).ok().and_then(|kills| kills.parse().ok()).unwrap_or(20);
    let next = AtomicU64::new(1);
    let outcomes = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..TOGETHER {
            scope.spawn(|| {
                loop {
                    let round = next.fetch_add(1, Ordering::Relaxed);
                    if round > kills {
                        return;
                    }
                    let folder = tempfile::tempdir().unwrap();
                    let outcome = kill_once(round, folder.path());
                    // On a machine that does something else a thread may wait for longer.
                    let is_timed = std::env::var_os(KILLS).is_some();
                    assert!(!is_timed || outcome.oldest <= BLINK, "round {round}: {outcome:?}");
                    outcomes.lock().unwrap().push(outcome);
                }
            });
        }
    });
    let outcomes = outcomes.into_inner().unwrap();
    let sum = |of: fn(&Outcome) -> u64| outcomes.iter().map(of).sum::<u64>();
    println!(
        "{} kills, {} after a save: {} changes, {} lost in {} kills, the oldest {:?} old; recovery at most {:?}",
        outcomes.len(),
        outcomes.iter().filter(|outcome| outcome.saved).count(),
        sum(|outcome| outcome.changes),
        sum(|outcome| outcome.lost),
        outcomes.iter().filter(|outcome| outcome.lost > 0).count(),
        outcomes.iter().map(|outcome| outcome.oldest).max().unwrap_or_default(),
        outcomes.iter().map(|outcome| outcome.recovery).max().unwrap_or_default(),
    );
    assert_eq!(outcomes.len() as u64, kills);
    let (changes, lost) = (sum(|outcome| outcome.changes), sum(|outcome| outcome.lost));
    assert!(changes > kills * 10, "hardly anything was edited");
    assert!(2 * lost < changes, "{lost} of {changes} changes are lost");
}
