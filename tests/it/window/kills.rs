//! Killing a window while somebody clicks joints into a body, at any moment: the next window offers what was done, but for
//! the last blink, and its save leaves no unfinished file.
//!
//! A joint counts as seen from the time at which the window's report with it was written, in the frame that placed it. The
//! work is a mesh with joints first; the next window takes it back and saves it as a project, which is saved again and again
//! while it is edited, until that window is killed, and so on. `RIGSMITH_KILLS` sets the number of kills, 2 otherwise, on a
//! machine that does nothing else: no lost joint may then have been seen for longer than a quarter of a second.

use std::{
    collections::BTreeSet,
    ffi::OsStr,
    fs,
    io::BufReader,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread::sleep,
    time::{Duration, Instant, SystemTime},
};

use rigsmith::{
    editor::report::WindowReport,
    files::{
        RealDisk, is_temp_name,
        journal::{Basis, PendingJournal, file_hash_at, pending_journals, recover},
        load_project,
    },
    rig::Rig,
};

use super::{Display, Hands, PATIENCE, missing_prerequisite};
use crate::{prerequisites::skip, random::Random};

const KILLS: &str = "RIGSMITH_KILLS";
/// Time whose edits may be lost at most.
const BLINK: Duration = Duration::from_millis(250);
/// Most kills of windows that open the same files, one after the other.
const A_ROW: u64 = 5;
const BODY: &str = "body.obj";
const PROJECT: &str = "work.rigsmith.ron";
/// Number of clicks that the hand makes without a look at the window.
const CLICKS: usize = 16;
/// File that a process which died in the middle of a save leaves behind.
const UNFINISHED: &str = ".rigsmith-0123456700000000.tmp";

/// Joints of the window at a time.
struct Sighting {
    time: SystemTime,
    joints: BTreeSet<String>,
}

/// Joints in the window's report, and the time at which it was written.
fn sighting(folder: &Path) -> Option<Sighting> {
    let file = fs::File::open(folder.join("report.json")).ok()?;
    let time = file.metadata().ok()?.modified().ok()?;
    let report: WindowReport = serde_json::from_reader(BufReader::new(file)).ok()?;
    Some(Sighting { time, joints: report.places.into_keys().collect() })
}

/// Starts a hand that clicks around the middle of the viewport, where the body is, without waiting for the window.
fn clicking(hands: &Hands, viewport: [f32; 4], saves: bool, random: &mut Random) -> Child {
    let [left, top, width, height] = viewport;
    let mut words: Vec<String> = Vec::new();
    let mut say = |more: &[&str]| words.extend(more.iter().map(|word| (*word).to_owned()));
    for _ in 0..CLICKS {
        let x = left + 0.5 * width + 20.0 * random.signed();
        let y = top + 0.5 * height + random.between(-0.2, 0.1) * height;
        say(&["mousemove", &x.round().to_string(), &y.round().to_string(), "sleep", "0.05", "click", "1"]);
        say(&["sleep", &random.between(0.05, 0.25).to_string()]);
        if saves && random.chance(3) {
            say(&["key", "ctrl+s"]);
        }
    }
    let mut hand = Command::new("xdotool");
    hand.args(words).env("DISPLAY", &hands.display.name).stdout(Stdio::null()).stderr(Stdio::null());
    hand.spawn().unwrap()
}

/// Edits until some joints are there, kills the window at any moment after that, and returns all that was seen before.
fn edit_until_killed(hands: &mut Hands, saves: bool, random: &mut Random) -> (Vec<Sighting>, SystemTime) {
    let placing = hands.until("joints are placed", |report| report.mode == "Place");
    let joints = placing.joints + 3 + random.below(6);
    let rest = Duration::from_millis(random.below(1500) as u64);
    let mut hand = clicking(hands, placing.viewport, saves, random);
    let mut seen: Vec<Sighting> = Vec::new();
    let (start, mut enough) = (Instant::now(), None::<Instant>);
    while enough.is_none_or(|since| since.elapsed() < rest) {
        assert!(
            start.elapsed() < 2 * PATIENCE,
            "the window has {:?} joints",
            seen.last().map(|last| last.joints.len())
        );
        if hand.try_wait().unwrap().is_some() {
            hand = clicking(hands, placing.viewport, saves, random);
        }
        if let Some(now) = sighting(hands.folder)
            && seen.last().is_none_or(|last| last.joints != now.joints)
        {
            if now.joints.len() >= joints {
                enough.get_or_insert_with(Instant::now);
            }
            seen.push(now);
        }
        sleep(Duration::from_millis(2));
    }
    let killed = SystemTime::now();
    hands.program.kill().unwrap();
    hands.program.wait().unwrap();
    // The hand goes on over an empty display.
    hand.kill().unwrap();
    hand.wait().unwrap();
    seen.extend(sighting(hands.folder));
    (seen, killed)
}

/// Journals with unsaved work of dead windows.
fn pending(folder: &Path) -> Vec<PendingJournal> {
    let folders = [folder.to_owned(), folder.join("state")];
    folders.iter().flat_map(|folder| pending_journals(&RealDisk, folder)).collect()
}

/// Rig that a saved project and the journal hold together.
fn recovered_rig(project: &Path, journals: &[PendingJournal]) -> Rig {
    let saved = project.exists().then(|| {
        let loaded = load_project(&RealDisk, project).unwrap_or_else(|error| panic!("{error}"));
        loaded.rigs.into_iter().next().unwrap()
    });
    let Some(journal) = journals.first() else {
        return saved.expect("there is neither a journal nor a project");
    };
    let recovered = recover(&fs::read(&journal.path).unwrap()).unwrap();
    let basis = recovered.basis(|path| file_hash_at(&RealDisk, path));
    assert_ne!(basis, Basis::Changed);
    let back = recovered.replay(basis, saved);
    assert_eq!(back.refused, None);
    assert_eq!(back.applied, recovered.changes().len());
    back.rig
}

/// Files in a folder and those below it whose name is one that is looked for.
fn remains(folder: &Path, is_meant: impl Fn(&OsStr) -> bool) -> Vec<PathBuf> {
    let (mut open, mut found) = (vec![folder.to_owned()], Vec::new());
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
            if entry.path().is_dir() {
                open.push(entry.path());
            } else if is_meant(&entry.file_name()) {
                found.push(entry.path());
            }
        }
    }
    found
}

/// Outcome of one kill.
#[derive(Debug, Default)]
struct Outcome {
    joints: usize,
    lost: usize,
    /// Time for which the longest seen one of the lost joints was seen.
    oldest: Duration,
}

/// Opens what a dead window left, takes its work back and saves it, by which unfinished files go.
fn taken_back<'a>(display: &'a Display, folder: &'a Path, rig: &Rig, is_offered: bool) -> Hands<'a> {
    for place in [folder.to_owned(), folder.join("state")] {
        fs::write(place.join(UNFINISHED), "half").unwrap();
    }
    let project = folder.join(PROJECT);
    let is_saved = project.exists();
    let hands = Hands::open(display, folder, &if is_saved { project.clone() } else { folder.join(BODY) });
    if is_offered {
        hands.until("the work is offered back", |report| report.asked);
        sleep(Duration::from_millis(1500));
        hands.frames();
        hands.key("Return");
    }
    hands.until("the work is back", |report| report.joints == rig.len() && !report.asked && !report.busy);
    hands.rests();
    let before = fs::metadata(&project).and_then(|entry| entry.modified()).ok();
    hands.key("ctrl+s");
    if !is_saved {
        hands.answer_with("work");
    }
    let start = Instant::now();
    while fs::metadata(&project).and_then(|entry| entry.modified()).ok() == before {
        assert!(start.elapsed() < PATIENCE, "nothing was saved");
        sleep(Duration::from_millis(100));
    }
    hands.rests();
    let unfinished = remains(folder, is_temp_name);
    assert!(unfinished.is_empty(), "{unfinished:?}");
    assert_eq!(recovered_rig(&project, &[]).len(), rig.len());
    hands
}

/// Kills windows one after the other, each in the work of the one before it: a mesh first, a project from then on.
fn outcomes_of_kills(display: &Display, kills: u64, random: &mut Random) -> Vec<Outcome> {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let body = folder.join(BODY);
    fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/biped.obj"), &body).unwrap();
    let mut hands = Hands::open(display, folder, &body);
    hands.rests();
    let mut outcomes = Vec::new();
    for _ in 0..kills {
        hands.key("a");
        let project = folder.join(PROJECT);
        let (seen, killed) = edit_until_killed(&mut hands, project.exists(), random);
        drop(hands);

        let journals = pending(folder);
        assert!(journals.len() <= 1, "{journals:?}");
        let rig = recovered_rig(&project, &journals);
        let there: BTreeSet<String> = rig.walk().map(|joint| joint.data.uid.to_string()).collect();
        let [first, .., last] = &seen[..] else { panic!("the window reports nothing new") };
        let lost: BTreeSet<&String> = last.joints.difference(&there).collect();
        let since = |joint: &String| seen.iter().find(|sighting| sighting.joints.contains(joint)).map(|seen| seen.time);
        let ages = lost.iter().copied().filter_map(|joint| killed.duration_since(since(joint)?).ok());
        let joints = last.joints.difference(&first.joints).count();
        outcomes.push(Outcome { joints, lost: lost.len(), oldest: ages.max().unwrap_or_default() });
        hands = taken_back(display, folder, &rig, !journals.is_empty());
    }
    // All is saved, so nothing is left to take back.
    drop(hands);
    let unsaved = pending(folder);
    let remains = remains(folder, |name| is_temp_name(name) || name.to_string_lossy().contains(".journal"));
    assert!(unsaved.is_empty() && remains.is_empty(), "{unsaved:?} {remains:?}");
    outcomes
}

#[test]
fn a_killed_window_loses_at_most_a_blink_on_a_display_and_gpu() {
    if let Some(reason) = missing_prerequisite() {
        skip(reason, "RIGSMITH_REQUIRE_GPU");
        return;
    }
    let asked: Option<u64> = std::env::var(KILLS).ok().and_then(|kills| kills.parse().ok());
    let kills = asked.unwrap_or(2);
    let display = Display::start().expect("Xvfb did not start");
    let mut outcomes: Vec<Outcome> = Vec::new();
    while (outcomes.len() as u64) < kills {
        let mut random = Random(outcomes.len() as u64 ^ 0x0D15_91A7);
        let more = outcomes_of_kills(&display, A_ROW.min(kills - outcomes.len() as u64), &mut random);
        // On a machine that does something else a thread may wait for longer.
        assert!(asked.is_none() || more.iter().all(|outcome| outcome.oldest <= BLINK), "{more:?}");
        outcomes.extend(more);
        println!("{} kills: {:?}", outcomes.len(), outcomes.last());
    }
    let sum = |of: fn(&Outcome) -> usize| outcomes.iter().map(of).sum::<usize>();
    let (joints, lost) = (sum(|outcome| outcome.joints), sum(|outcome| outcome.lost));
    let oldest = outcomes.iter().map(|outcome| outcome.oldest).max().unwrap_or_default();
    println!("{} kills of a window: {joints} joints, {lost} lost, the oldest seen for {oldest:?}", outcomes.len());
    assert!(joints >= 3 * outcomes.len(), "hardly anything was edited");
    assert!(lost < joints, "all {joints} joints are lost");
}
