//! Pictures of panels and jobs for the documentation, taken in the real window: only where `RIGSMITH_SHOTS` names a folder for
//! them.

use std::{fs, path::Path, thread::sleep, time::Duration};

use rigsmith::editor::report::{ReportedWidget, WindowReport};

use super::{Display, Hands, missing_prerequisite, whole_job::until_there};
use crate::prerequisites::skip;

/// Time in which toasts go and pictures of the library come.
const REST: Duration = Duration::from_secs(7);

impl Hands<'_> {
    /// Takes a picture with the pointer at rest in a corner of the viewport.
    fn picture(&self, name: &str) {
        self.point(self.corner());
        sleep(REST);
        self.shot(name);
    }

    /// A pixel of the viewport where there is nothing of a character.
    fn corner(&self) -> [f32; 2] {
        let report = self.report().expect("the window reports");
        [report.viewport[0] + 12.0, report.viewport[1] + 12.0]
    }

    /// Turns the wheel by some notches towards what is in the middle of the viewport.
    fn approach(&self, notches: usize) {
        let [left, top, width, height] = self.report().expect("the window reports").viewport;
        self.point([left + 0.5 * width, top + 0.5 * height]);
        (0..notches).for_each(|_| drop(self.xdotool(&["click", "4"])));
        self.rests();
    }

    /// Shows the whole figure again after work near to it.
    fn frame_all(&self) {
        self.key("Home");
        self.rests();
    }

    /// Brings a panel of the dock forward by its tab.
    fn bring(&self, panel: &str) {
        self.press(&format!("Show {panel}"));
        // The pointer stays until the tab has come forward: a click is where the pointer is in the frame that takes it.
        sleep(Duration::from_millis(1500));
        self.frames();
    }

    /// Clicks a joint in the Hierarchy.
    fn select(&self, joint: &str) {
        self.press(joint);
        self.until("it is selected", |report| report.selection == [joint]);
    }

    /// Drags a joint in Pose mode, by which the control that holds it is pulled.
    fn pull(&self, joint: &str, control: &str, by: [f32; 2]) {
        // The handles of what is selected lie in front of joints.
        self.click(self.corner());
        let before = self.until("nothing is selected", |report| report.selected == 0);
        let from = before.places[&before.labels[joint]];
        self.drag(&[from, [from[0] + by[0], from[1] + by[1]]]);
        self.until("the control is pulled", |report| {
            report.steps.len() > before.steps.len() && report.selection == [control] && !report.busy
        });
    }
}

/// Next version of a template: its first control is a quarter larger, and one of its groups has another colour.
fn next_version(text: &str) -> String {
    const SIZE: &str = " size: ";
    let start = text.find(SIZE).expect("the template has a control with a size") + SIZE.len();
    let end = start + text[start..].find([',', ')']).expect("the size ends");
    let size: f32 = text[start..end].parse().expect("the size is a number");
    let next = format!("{}{}{}", &text[..start], 1.25 * size, &text[end..]);
    let (number, color) = (r#"version: "2.0.0""#, r#"(name: "arm_l", color: (0.34, 0.71, 0.91))"#);
    assert!(next.contains(number) && next.contains(color), "the template is not that of the biped:\n{next}");
    next.replace(number, r#"version: "2.1.0""#).replace(color, r#"(name: "arm_l", color: (0.2, 0.8, 0.6))"#)
}

#[test]
fn the_next_version_of_the_biped_has_three_changes() {
    let biped = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates/biped.rig.ron");
    let text = fs::read_to_string(biped).unwrap();
    let next = next_version(&text);
    let changed = text.lines().zip(next.lines()).filter(|(before, now)| before != now).count();
    assert_eq!((text.lines().count(), changed), (next.lines().count(), 3));
}

#[test]
fn panels_of_a_character_on_a_display_and_gpu() {
    if std::env::var_os("RIGSMITH_SHOTS").is_none() || missing_prerequisite().is_some() {
        skip("no pictures are asked for", "RIGSMITH_REQUIRE_SHOTS");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let display = Display::start().expect("Xvfb did not start");
    let start = Hands::run(&display, folder, None);
    start.until("the start page shows", |report| report.widgets.iter().any(|widget| widget.name == "Take the tour"));
    start.rests();
    start.picture("start");
    drop(start);

    let body = folder.join("hero.obj");
    fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/biped.obj"), &body).unwrap();
    let hands = Hands::open(&display, folder, &body);
    hands.rests();
    hands.key("f");
    hands.until("a skeleton is fitted", |report| report.joints > 40 && !report.busy);
    hands.key("Return");
    hands.key("b");
    hands.until("it is skinned", |report| report.skinned == 1 && !report.busy);
    hands.key("q");
    rigged(&hands);
    posed(&hands);
    updated(&hands, &folder.join("hero.rig.ron"));
    drop(hands);
    face(&display, folder);
}

/// Panels of a rig that is built: its graph, commands, groups and values, and the library.
fn rigged(hands: &Hands) {
    // The first look of the graph is at what is selected.
    hands.select("hand_l");
    hands.bring("Tags");
    hands.bring("Graph");
    hands.picture("graph");
    hands.bring("Groups");
    hands.bring("Properties");
    hands.bring("Process");
    hands.picture("process");
    hands.bring("Loader");
    hands.press("Template bird");
    hands.bring("Skinning");
    hands.bring("Log");
    hands.picture("loader");
    hands.bring("Hierarchy");
}

/// Three poses of an arm, stored and keyed: their cards, keys and curves.
fn posed(hands: &Hands) {
    hands.key("p");
    hands.until("controls are posed", |report| report.mode == "Pose");
    // In a view of the whole figure its hand is small beside the controls, and pulled by its joint only from near.
    hands.approach(1);
    let report = hands.report().expect("the window reports");
    let uid = &report.labels["hand_l"];
    let rest = report.places[uid];
    hands.bring("Controls");
    hands.bring("Poses");
    hands.bring("Timeline");
    for to in [[-20.0, -70.0], [30.0, -60.0], [20.0, 40.0]] {
        let now = hands.report().expect("the window reports");
        let at = now.places[uid];
        hands.pull("hand_l", "hand_ik_l", [rest[0] + to[0] - at[0], rest[1] + to[1] - at[1]]);
        hands.key("k");
        hands.until("a key is set", |report| report.keys > now.keys && !report.busy);
        hands.press("Store");
        (0..12).for_each(|_| hands.key("period"));
    }
    hands.frame_all();
    hands.picture("timeline");
    hands.bring("Sets");
    let of_sets = |report: &WindowReport| {
        let store = |widget: &&ReportedWidget| widget.name == "Store" && widget.place[0] < report.viewport[0];
        report.widgets.iter().find(store).map(|widget| widget.place)
    };
    let report = hands.until("selections can be stored", |report| of_sets(report).is_some());
    let [left, top, width, height] = of_sets(&report).unwrap();
    hands.click([left + 0.5 * width, top + 0.5 * height]);
    sleep(Duration::from_millis(1500));
    hands.frames();
    hands.picture("poses");
    hands.bring("Curves");
    hands.picture("curves");
    hands.bring("Hierarchy");
}

/// A newer template, and weights that are painted.
fn updated(hands: &Hands, template: &Path) {
    hands.key("ctrl+e");
    hands.answer_with("hero.rig.ron");
    until_there(template);
    sleep(Duration::from_secs(3));
    let beside = template.with_extension("part");
    fs::write(&beside, next_version(&fs::read_to_string(template).unwrap())).unwrap();
    fs::rename(&beside, template).unwrap();
    hands.until("the changes are offered", |report| report.offered == 3);
    hands.bring("Updater");
    hands.picture("updater");

    // The whole figure is small beside a brush.
    hands.approach(1);
    hands.select("upper_arm_l");
    hands.key("t");
    hands.bring("Weights");
    hands.bring("Display");
    let report = hands.until("weights are painted", |report| report.mode == "Paint");
    let [from, to] = ["upper_arm_l", "forearm_l"].map(|joint| report.places[&report.labels[joint]]);
    hands.point([0.5 * (from[0] + to[0]), 0.5 * (from[1] + to[1])]);
    sleep(REST);
    hands.shot("paint");
}

/// A face in the bundled head.
fn face(display: &Display, folder: &Path) {
    let head = folder.join("head.obj");
    fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/head.obj"), &head).unwrap();
    let hands = Hands::open(display, folder, &head);
    // The character's work is offered back.
    if hands.within(Duration::from_secs(10), |report| report.asked).is_some() {
        hands.key("Escape");
    }
    hands.rests();
    hands.bring("Face");
    hands.press("Place face");
    hands.until("a face is placed", |report| report.joints > 10 && report.skinned == 1 && !report.busy);
    // The controls are what people take; bones lie over the face.
    hands.key("h");
    hands.picture("face");
}
