//! The whole job by hand: a real window under a virtual display, a real mouse and a real keyboard.
//!
//! Needs `Xvfb`, `xdotool` and a graphics adapter (a software one will do); it says what is missing, and fails for it
//! where `RIGSMITH_REQUIRE_GPU=1`. `RIGSMITH_SHOTS` names a folder for pictures of the window on the way.

mod display;
mod kills;
mod mouse;
mod pictures;
mod whole_job;

use std::{
    cell::RefCell,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread::sleep,
    time::{Duration, Instant},
};

use rigsmith::{
    editor::report::WindowReport,
    files::{
        FileKind,
        journal::{Basis, file_hash, recover},
    },
    render::adapter,
};

use self::display::Display;
use crate::prerequisites::{skip, test_data};

/// A running window and the hands on it.
struct Hands<'a> {
    display: &'a Display,
    folder: &'a Path,
    program: Child,
    /// Everything that the hands did: presses to releases, and keys.
    gestures: RefCell<Vec<String>>,
}

impl Drop for Hands<'_> {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

const PATIENCE: Duration = Duration::from_secs(120);

impl<'a> Hands<'a> {
    fn open(display: &'a Display, folder: &'a Path, file: &Path) -> Self {
        Self::run(display, folder, Some(file))
    }

    /// Opens the window, with its start page if there is no file.
    fn run(display: &'a Display, folder: &'a Path, file: Option<&Path>) -> Self {
        let _ = std::fs::remove_file(folder.join("report.json"));
        let log = std::fs::File::create(folder.join("window.log")).unwrap();
        let program = Command::new(env!("CARGO_BIN_EXE_rigsmith"))
            .arg("edit")
            .args(file)
            .current_dir(folder)
            .env("DISPLAY", &display.name)
            .env("RIGSMITH_WINDOW_REPORT", folder.join("report.json"))
            .env("RIGSMITH_CONFIG", folder.join("config"))
            .env("RIGSMITH_STATE", folder.join("state"))
            .env("TMPDIR", folder)
            .env_remove("WAYLAND_DISPLAY")
            .stdout(Stdio::null())
            .stderr(log)
            .spawn()
            .unwrap();
        let hands = Self { display, folder, program, gestures: RefCell::default() };
        hands.until("the file is open", |report| !report.busy && report.viewport[2] > 0.0);
        let window = hands.xdotool(&["search", "--name", "Rigsmith"]);
        let window = window.split_whitespace().next().unwrap_or_else(|| panic!("there is no window"));
        hands.xdotool(&["windowfocus", window]);
        hands
    }

    fn xdotool(&self, words: &[&str]) -> String {
        let run = Command::new("xdotool").args(words).env("DISPLAY", &self.display.name).output().unwrap();
        sleep(Duration::from_millis(60));
        String::from_utf8_lossy(&run.stdout).into_owned()
    }

    fn report(&self) -> Option<WindowReport> {
        serde_json::from_slice(&std::fs::read(self.folder.join("report.json")).ok()?).ok()
    }

    /// Waits until the window shows what is expected.
    fn until(&self, what: &str, expected: impl Fn(&WindowReport) -> bool) -> WindowReport {
        let start = Instant::now();
        loop {
            let report = self.report();
            if let Some(report) = report.as_ref().filter(|report| expected(report)) {
                return report.clone();
            }
            if start.elapsed() > PATIENCE {
                let log = std::fs::read_to_string(self.folder.join("window.log")).unwrap_or_default();
                let tail: Vec<&str> = log.lines().rev().take(12).collect();
                self.shot("failed");
                panic!("waited in vain until {what}; the window shows {report:#?}\n{}", tail.join("\n"));
            }
            sleep(Duration::from_millis(50));
        }
    }

    /// Report of the window once it is as expected; `None` if it is not within a time.
    fn within(&self, time: Duration, expected: impl Fn(&WindowReport) -> bool) -> Option<WindowReport> {
        let start = Instant::now();
        while start.elapsed() < time {
            if let Some(report) = self.report().filter(|report| expected(report)) {
                return Some(report);
            }
            sleep(Duration::from_millis(50));
        }
        None
    }

    fn count(&self, gesture: String) {
        self.gestures.borrow_mut().push(gesture);
    }

    fn key(&self, key: &str) {
        self.count(key.to_owned());
        self.xdotool(&["key", "--clearmodifiers", key]);
    }

    fn write(&self, text: &str) {
        text.chars().for_each(|letter| self.count(letter.to_string()));
        self.xdotool(&["type", "--delay", "25", text]);
    }

    /// Presses a key for each number of steps to be in effect, one after the other.
    fn steps(&self, key: &str, heads: impl Iterator<Item = usize>) {
        for head in heads {
            self.key(key);
            self.until("the step shows", |report| report.head == head);
        }
    }

    /// Answers where to write with a name: it is what is selected in the path that is proposed.
    fn answer_with(&self, name: &str) {
        self.until("a path is asked for", |report| report.asked);
        // The question may be known before it is drawn and its field has the keyboard.
        sleep(Duration::from_millis(2500));
        self.frames();
        self.write(name);
        sleep(Duration::from_millis(500));
        self.frames();
        self.shot("answered");
        self.key("Return");
        self.until("the question is answered", |report| !report.asked);
    }

    /// Pictures of every mode: the joint at one pixel selected, the pointer over the mesh at another.
    fn tour(&self, joint: [f32; 2], over: [f32; 2]) {
        let modes = [("q", "select"), ("a", "place"), ("w", "move"), ("e", "rotate"), ("r", "scale"), ("g", "weights")];
        for (key, name) in modes {
            self.key(key);
            let place = if name == "place" { [over[0], over[1] - 30.0] } else { [joint[0] + 60.0, joint[1] - 90.0] };
            self.xdotool(&["mousemove", &place[0].round().to_string(), &place[1].round().to_string()]);
            // Toasts go, colours come.
            self.rests();
            self.shot(name);
        }
        self.key("p");
        self.rests();
        self.shot("pose");
    }

    /// The middle of the last drawn widget that is meant, once it stands still and can be used: popups are drawn last.
    fn widget(&self, what: &str, is_meant: impl Fn(&str) -> bool) -> [f32; 2] {
        let find = |report: &WindowReport| {
            let found = report.widgets.iter().rev().find(|widget| widget.enabled && is_meant(&widget.name));
            found.map(|widget| widget.place)
        };
        let start = Instant::now();
        loop {
            let seen = self.until(&format!("there is {what}"), |report| find(report).is_some());
            sleep(Duration::from_millis(700));
            self.frames();
            let again = self.report().as_ref().and_then(find);
            if let Some([left, top, width, height]) = again.filter(|again| find(&seen) == Some(*again)) {
                return [left + 0.5 * width, top + 0.5 * height];
            }
            assert!(start.elapsed() < PATIENCE, "{what} never stands still");
        }
    }

    /// Clicks the widget with that name.
    fn press(&self, name: &str) {
        self.click(self.widget(name, |known| known == name));
    }

    /// Time of processors that the program has used, in hundredths of a second.
    fn processor_time(&self) -> u64 {
        let text = std::fs::read_to_string(format!("/proc/{}/stat", self.program.id())).unwrap();
        let fields: Vec<&str> = text[text.rfind(')').unwrap()..].split_whitespace().collect();
        fields[12].parse::<u64>().unwrap() + fields[13].parse::<u64>().unwrap()
    }

    /// Waits until the program sleeps: toasts go first.
    fn rests(&self) {
        let start = Instant::now();
        let mut used = Vec::new();
        while used.last() != Some(&0) && used.last() != Some(&1) {
            assert!(start.elapsed() < PATIENCE, "the window never rests; hundredths of a second in 2 s: {used:?}");
            let before = self.processor_time();
            sleep(Duration::from_secs(2));
            used.push(self.processor_time() - before);
        }
    }

    /// Keeps a picture of the window if that was asked for.
    fn shot(&self, name: &str) {
        if let Some(folder) = std::env::var_os("RIGSMITH_SHOTS") {
            let folder = PathBuf::from(folder);
            std::fs::create_dir_all(&folder).unwrap();
            self.display.picture().save(folder.join(format!("{name}.png"))).unwrap();
        }
    }
}

fn there(tool: &str) -> bool {
    Command::new(tool).arg("-version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok()
}

/// Prerequisite that is missing to drive a window.
fn missing_prerequisite() -> Option<&'static str> {
    if cfg!(not(target_os = "linux")) {
        Some("windows are driven on Linux only")
    } else if !there("Xvfb") {
        Some("Xvfb is not installed")
    } else if !there("xdotool") {
        Some("xdotool is not installed")
    } else if adapter().is_none() {
        Some("there is no graphics adapter, not even a software one")
    } else {
        None
    }
}

/// A mesh and the places of joints that strokes are drawn along: pelvis, head, shoulder, elbow, hand, hip, knee, ankle.
fn subject(folder: &Path) -> (PathBuf, [[f32; 3]; 8]) {
    if let Some(body) = test_data().map(|data| data.join("bodies/female_young")) {
        let text = std::fs::read_to_string(body.join("joints.json")).unwrap();
        let all: serde_json::Value = serde_json::from_str(&text).unwrap();
        let at = |name: &str| [0, 1, 2].map(|i| all["game_engine"][name]["head"][i].as_f64().unwrap() as f32);
        let names = ["pelvis", "head", "upperarm_l", "lowerarm_l", "hand_l", "thigh_l", "calf_l", "foot_l"];
        let copy = folder.join("body.obj");
        std::fs::copy(body.join("body.obj"), &copy).unwrap();
        return (copy, names.map(at));
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models");
    let text = std::fs::read_to_string(root.join("biped.rig")).unwrap();
    let at = |name: &str| {
        let line = text.lines().find(|line| line.split_whitespace().nth(6) == Some(name)).unwrap();
        let words: Vec<&str> = line.split_whitespace().collect();
        [3, 4, 5].map(|i| words[i].parse().unwrap())
    };
    let copy = folder.join("biped.obj");
    std::fs::copy(root.join("biped.obj"), &copy).unwrap();
    let names = ["hips", "head", "upper_arm_l", "forearm_l", "hand_l", "thigh_l", "shin_l", "foot_l"];
    (copy, names.map(at))
}

/// Pixels of a place in an orthographic view, from where the corners of the unit cube appear.
fn pixel(report: &WindowReport, place: [f32; 3]) -> [f32; 2] {
    let [origin, axes @ ..] = report.axes.map(|corner| corner.unwrap());
    let mut at = origin;
    for (axis, along) in axes.iter().zip(place) {
        at[0] += (axis[0] - origin[0]) * along;
        at[1] += (axis[1] - origin[1]) * along;
    }
    at
}

/// True once a journal beside the project, or in the folder of the window's state, holds a change that the project lacks.
fn is_change_kept(folder: &Path) -> bool {
    let files = [folder.to_owned(), folder.join("state")].map(std::fs::read_dir).into_iter().flatten().flatten();
    let paths = files.flatten().map(|file| file.path());
    let journals = paths.filter(|path| path.extension().is_some_and(|ending| ending == "journal"));
    let hash = |path: &Path| std::fs::read(path).ok().map(|bytes| file_hash(&bytes));
    let holds = |bytes: Vec<u8>| {
        recover(&bytes).is_ok_and(|journal| match journal.basis(hash) {
            Basis::Project { contained } => journal.changes().len() > contained,
            _ => false,
        })
    };
    journals.flat_map(std::fs::read).any(holds)
}

/// Fitted, skinned and posed in six gestures: a key, a key, a key, a click, a drag; and all of a fit taken back with one key.
#[test]
fn a_body_is_fitted_by_a_key_on_a_display_and_gpu() {
    if let Some(reason) = missing_prerequisite() {
        skip(reason, "RIGSMITH_REQUIRE_GPU");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let display = Display::start().expect("Xvfb did not start");
    let (mesh, _) = subject(folder);
    let hands = Hands::open(&display, folder, &mesh);
    hands.rests();

    hands.key("f");
    let fitted = hands.until("a skeleton is fitted", |report| report.joints > 40 && !report.busy);
    assert_eq!((fitted.steps.len(), fitted.mode.as_str()), (1, "Move"));
    hands.shot("fitted");
    hands.key("Escape");
    hands.until("the fit is taken back", |report| report.joints == 0 && report.head == 0);

    hands.key("f");
    hands.until("a skeleton is fitted again", |report| report.joints > 40 && report.head == 1 && !report.busy);
    // The view makes room for the bar of the fit.
    hands.rests();
    let fitted = hands.report().expect("the window reports");
    // A joint near the middle of the picture is moved: the joints around it follow as a step of their own.
    let elbow = *fitted.places.values().max_by(|a, b| a[0].total_cmp(&b[0])).unwrap();
    hands.click(elbow);
    hands.until("a joint is selected", |report| report.selected == 1);
    hands.drag(&[elbow, [elbow[0] + 6.0, elbow[1] + 6.0]]);
    let corrected = hands.until("the fit is corrected", |report| report.steps.len() >= 3 && !report.busy);
    assert_eq!(corrected.steps[0], "Fit");
    assert_eq!(corrected.steps.last().map(String::as_str), Some("Fit around"), "{:?}", corrected.steps);
    hands.shot("corrected");
    hands.key("Return");
    hands.until("the fit is accepted", |report| report.widgets.iter().all(|widget| widget.name != "Accept"));
    hands.key("b");
    hands.until("it is skinned", |report| report.skinned == 1 && !report.busy);
    hands.shot("fitted_and_skinned");
}

#[test]
fn a_person_rigs_a_body_by_hand_on_a_display_and_gpu() {
    if let Some(reason) = missing_prerequisite() {
        skip(reason, "RIGSMITH_REQUIRE_GPU");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let display = Display::start().expect("Xvfb did not start");
    let (mesh, [pelvis, head, shoulder, elbow, hand, hip, knee, ankle]) = subject(folder);

    let hands = Hands::open(&display, folder, &mesh);
    hands.shot("opened");
    hands.rests();
    // The corners of the unit cube are rounded to whole pixels: a model one or two units high keeps that fine enough.
    hands.key("1");
    hands.key("5");
    let aim = hands.until("the view is flat", |report| {
        report.axes[3].is_some() && report.axes[0].is_some() && report.axes[3] == report.axes[0]
    });
    let at = |place: [f32; 3]| pixel(&aim, place);

    hands.key("m");
    hands.key("s");
    hands.until("strokes are drawn", |report| report.mode == "Stroke");
    let strokes = [vec![pelvis, head], vec![shoulder, elbow, hand], vec![hip, knee, ankle]];
    for (number, stroke) in strokes.iter().enumerate() {
        let line: Vec<[f32; 2]> = stroke.iter().map(|place| at(*place)).collect();
        hands.drag(&line);
        sleep(Duration::from_millis(800));
        hands.frames();
        hands.shot(["stroke_spine", "stroke", "stroke_leg"][number]);
        hands.key("Return");
        hands.until("the stroke is taken", |report| report.steps.len() == number + 1 && !report.busy);
    }
    let sketched = hands.until("there is a biped", |report| report.joints >= 12);
    hands.shot("sketched");

    hands.key("b");
    hands.until("it is skinned", |report| report.skinned == 1 && !report.busy);
    hands.shot("skinned");

    hands.key("p");
    hands.until("joints are posed", |report| report.mode == "Pose");
    let nearest = |report: &WindowReport, to: [f32; 2]| {
        let apart = |at: &[f32; 2]| (at[0] - to[0]).hypot(at[1] - to[1]);
        report.places.values().copied().min_by(|a, b| apart(a).total_cmp(&apart(b))).unwrap()
    };
    let joint = nearest(&sketched, at(elbow));
    let ring = 90.0;
    // On a busy machine the rings may be drawn after the press, which selects nothing then: a person tries again.
    let turned = (0..6).find_map(|_| {
        hands.click(joint);
        hands.until("a joint is selected", |report| report.selected == 1);
        sleep(Duration::from_millis(500));
        hands.frames();
        hands.drag(&[[joint[0] + ring, joint[1]], [joint[0] + 0.8 * ring, joint[1] - 0.6 * ring]]);
        // A drag shows before it is a step.
        hands.within(PATIENCE / 6, |report| report.posed > 0 && report.steps.len() == 5 && !report.busy)
    });
    let posed = turned.expect("the joint is not turned");
    hands.shot("posed");

    if std::env::var_os("RIGSMITH_SHOTS").is_some() {
        hands.tour(joint, at(knee));
    }

    let steps = posed.steps.len();
    hands.steps("ctrl+z", (0..steps).rev());
    hands.until("everything is undone", |report| report.head == 0 && report.joints == 0);
    hands.steps("ctrl+shift+z", 1..=steps);
    let again = hands.until("everything is done again", |report| report.head == steps && !report.busy);
    assert_eq!((again.joints, again.skinned, again.posed), (posed.joints, posed.skinned, posed.posed));

    let project = folder.join("work.rigsmith.ron");
    hands.key("ctrl+s");
    hands.answer_with("work");
    let start = Instant::now();
    while !project.exists() && start.elapsed() < PATIENCE {
        sleep(Duration::from_millis(100));
    }
    assert_eq!(FileKind::of(&project), Some(FileKind::Project));
    assert!(project.exists(), "nothing was saved");

    // One more change that is not saved, and then the process is gone.
    hands.key("q");
    hands.until("joints are selected", |report| report.mode == "Select");
    hands.key("shift+p");
    hands.until("the pose is taken back", |report| report.posed == 0);
    let start = Instant::now();
    while !is_change_kept(folder) {
        assert!(start.elapsed() < PATIENCE, "the journal does not hold the change");
        sleep(Duration::from_millis(50));
    }
    drop(hands);

    let hands = Hands::open(&display, folder, &project);
    hands.until("the work is offered back", |report| report.asked);
    sleep(Duration::from_millis(1500));
    hands.frames();
    hands.shot("offered");
    hands.key("Return");
    let recovered = hands.until("the work is back", |report| {
        report.posed == 0 && report.joints == posed.joints && report.skinned == 1 && !report.busy
    });
    assert_eq!(recovered.joints, posed.joints);

    let character = folder.join("character.glb");
    hands.key("ctrl+e");
    hands.answer_with("character");
    let start = Instant::now();
    while !character.exists() && start.elapsed() < PATIENCE {
        sleep(Duration::from_millis(100));
    }
    let bytes = std::fs::read(&character).expect("nothing was exported");
    let file = gltf::Gltf::from_slice(&bytes).unwrap();
    let skin = file.skins().next().expect("the character has no skin");
    assert!(skin.joints().count() >= 12, "{} joints", skin.joints().count());
    if let Some(exports) = std::env::var_os("RIGSMITH_EXPORTS") {
        std::fs::write(Path::new(&exports).join("by_hand.glb"), &bytes).unwrap();
    }
    hands.shot("exported");
}
