//! Pictures of panels and jobs for the documentation, taken in the real window: only where `RIGSMITH_SHOTS` names a folder for
//! them.

use std::{fs, path::Path, thread::sleep, time::Duration};

use super::{Display, Hands, missing_prerequisite, whole_job::show};
use crate::prerequisites::skip;

/// Time in which toasts go and pictures of the library come.
const REST: Duration = Duration::from_secs(7);

impl Hands<'_> {
    /// Takes a picture with the pointer at rest in the viewport, below the character.
    fn picture(&self, name: &str) {
        let Some(report) = self.report() else { return };
        let [left, top, ..] = report.viewport;
        self.xdotool(&["mousemove", &(left + 12.0).round().to_string(), &(top + 12.0).round().to_string()]);
        sleep(REST);
        self.shot(name);
    }

    fn select(&self, joint: &str) {
        self.press(joint);
        self.until("it is selected", |report| report.selection == [joint]);
    }
}

#[test]
fn panels_of_a_character_on_a_display_and_gpu() {
    if std::env::var_os("RIGSMITH_SHOTS").is_none() || missing_prerequisite().is_some() {
        skip("no pictures are asked for", "RIGSMITH_REQUIRE_SHOTS");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models");
    let (body, head) = (folder.join("hero.obj"), folder.join("head.obj"));
    fs::copy(models.join("biped.obj"), &body).unwrap();
    fs::copy(models.join("head.obj"), &head).unwrap();
    let display = Display::start().expect("Xvfb did not start");
    let hands = Hands::open(&display, folder, &body);
    hands.rests();
    hands.key("f");
    hands.until("a skeleton is fitted", |report| report.joints > 40 && !report.busy);
    hands.key("Return");
    hands.key("b");
    hands.until("it is skinned", |report| report.skinned == 1 && !report.busy);
    hands.key("q");

    // The first look of the graph is at what is selected.
    hands.select("hand_l");
    show(&hands, "Tags");
    show(&hands, "Graph");
    hands.picture("graph");

    show(&hands, "Loader");
    hands.press("Template bird");
    show(&hands, "Timeline");
    hands.picture("loader");
    show(&hands, "Hierarchy");

    hands.key("p");
    let report = hands.until("controls are posed", |report| report.mode == "Pose");
    let hand = report.places[&report.labels["hand_l"]];
    show(&hands, "Poses");
    for (number, to) in [[-20.0, -70.0], [30.0, -60.0], [20.0, 40.0]].into_iter().enumerate() {
        let now = hands.report().unwrap();
        let at = now.places[&now.labels["hand_l"]];
        hands.drag(&[at, [hand[0] + to[0], hand[1] + to[1]]]);
        hands.until("the arm is pulled", |report| report.steps.len() > now.steps.len() && !report.busy);
        hands.key("k");
        hands.until("a key is set", |report| report.keys > now.keys || number > 0);
        hands.press("Store");
        (0..12).for_each(|_| hands.key("period"));
    }
    hands.picture("poses");
    show(&hands, "Curves");
    hands.picture("curves");

    hands.key("ctrl+e");
    hands.answer_with("hero.rig.ron");
    let template = folder.join("hero.rig.ron");
    super::whole_job::until_there(&template);
    sleep(Duration::from_secs(3));
    let text = fs::read_to_string(&template).unwrap();
    fs::write(&template, text.replace("relative_size: 0.6", "relative_size: 0.75")).unwrap();
    hands.until("the change is offered", |report| report.offered > 0);
    show(&hands, "Updater");
    hands.picture("updater");

    hands.select("upper_arm_l");
    hands.key("t");
    show(&hands, "Weights");
    hands.picture("paint");
    drop(hands);

    let hands = Hands::open(&display, folder, &head);
    // The character's work is offered back.
    if hands.within(Duration::from_secs(10), |report| report.asked).is_some() {
        hands.key("Escape");
    }
    hands.rests();
    show(&hands, "Face");
    hands.press("Place face");
    hands.until("a face is placed", |report| report.joints > 10 && report.skinned == 1 && !report.busy);
    hands.picture("face");
}
