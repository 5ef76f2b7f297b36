//! A body that nobody has prepared, from its file to an animated character: fitted, corrected, with a part more, built step by
//! step, keyed, and updated from its template while it is open.

use std::{fs, path::Path, thread::sleep, time::Duration, time::Instant};

use rigsmith::{
    editor::report::WindowReport,
    files::{RealDisk, load_model, load_template},
};

use super::{Display, Hands, PATIENCE, missing_prerequisite};
use crate::prerequisites::{skip, test_data};

/// Most gestures of the whole job, with the letters of the two file names and of a number.
const MOST_GESTURES: usize = 55;

/// The place of a joint on the screen.
fn joint(report: &WindowReport, label: &str) -> [f32; 2] {
    report.places[&report.labels[label]]
}

/// Waits for a file that is written in the background.
fn until_there(path: &Path) {
    let start = Instant::now();
    while !path.exists() && start.elapsed() < PATIENCE {
        sleep(Duration::from_millis(100));
    }
    assert!(path.exists(), "{} was not written", path.display());
}

/// Brings a panel forward.
pub(super) fn show(hands: &Hands, panel: &str) {
    hands.press("Window");
    hands.press(panel);
    // The pointer stays until the menu has gone: a click is where the pointer is in the frame that takes it.
    hands.until("the menu is closed", |report| report.widgets.iter().all(|widget| widget.name != "Reset layout"));
}

#[test]
fn an_unseen_body_becomes_an_animated_character_by_hand_on_a_display_and_gpu() {
    if let Some(reason) = missing_prerequisite() {
        skip(reason, "RIGSMITH_REQUIRE_GPU");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let body = match test_data() {
        Some(data) => data.join("bodies/male_child_tpose/body.obj"),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/biped.obj"),
    };
    let mesh = folder.join("body.obj");
    fs::copy(body, &mesh).unwrap();
    let display = Display::start().expect("Xvfb did not start");
    let hands = Hands::open(&display, folder, &mesh);
    hands.rests();

    hands.key("f");
    let fitted =
        hands.until("a skeleton is fitted", |report| report.joints > 40 && report.mode == "Move" && !report.busy);
    assert_eq!(fitted.steps, ["Fit"]);
    // The view makes room for the bar of the fit.
    hands.rests();
    let fitted = hands.report().expect("the window reports");

    // A joint is corrected in one gesture, though nothing is selected.
    let elbow = joint(&fitted, "forearm_l");
    hands.drag(&[elbow, [elbow[0] + 5.0, elbow[1] + 8.0]]);
    let corrected = hands.until("the limb follows", |report| report.steps.len() >= 3 && !report.busy);
    assert_eq!(corrected.steps.last().map(String::as_str), Some("Fit around"), "{:?}", corrected.steps);
    assert_eq!(corrected.selection, ["forearm_l"]);
    hands.shot("job_corrected");
    hands.key("Return");
    hands.until("the fit is accepted", |report| report.widgets.iter().all(|widget| widget.name != "Accept"));
    hands.key("b");
    let skinned = hands.until("it is skinned", |report| report.skinned == 1 && !report.busy);
    assert_eq!(skinned.steps.last().map(String::as_str), Some("Skin mesh"));

    // A jaw: a joint in the chin, and the part from the menu of pictures.
    hands.press("head");
    hands.until("the head is selected", |report| report.selection == ["head"]);
    hands.key("a");
    let placing = hands.until("joints are placed", |report| report.mode == "Place");
    let head = joint(&placing, "head");
    hands.click([head[0], head[1] + 9.0]);
    let placed = hands.until("there is a joint more", |report| report.joints == fitted.joints + 1 && !report.busy);
    assert!(placed.selection[0].starts_with("face"), "it is named by its place: {:?}", placed.selection);
    show(&hands, "Tags");
    hands.press("Part");
    hands.press("Part jaw");
    let added = hands.until("the part is added and built", |report| {
        report.steps.last().is_some_and(|step| step == "Add part jaw")
            && report.commands[1] > skinned.commands[1]
            && report.commands[0] == report.commands[1]
    });
    hands.shot("job_part");

    // The build goes one command back, and forwards to its end.
    hands.key("ctrl+Left");
    hands.until("a command is taken back", |report| report.commands[0] + 1 == added.commands[1]);
    hands.key("ctrl+b");
    hands.until("all is built", |report| report.commands[0] == added.commands[1]);

    // A value is typed: what depends on it runs, and nothing else.
    show(&hands, "Process");
    hands.press("Values of control");
    hands.press("Relative size");
    sleep(Duration::from_millis(1500));
    hands.frames();
    hands.write("0.9");
    hands.key("Return");
    let changed = hands.until("the value is set", |report| report.steps.len() > added.steps.len() && !report.busy);
    assert!((1..changed.commands[1] / 4).contains(&changed.ran), "{} of {:?} ran", changed.ran, changed.commands);
    let said = format!("{} ran", changed.ran);
    hands.until("the panel says how many ran", |report| {
        report.widgets.iter().any(|widget| widget.name == said || widget.value == said)
    });
    hands.shot("job_changed");

    // The rig becomes a template, which it follows.
    let template = folder.join("hero.rig.ron");
    hands.key("ctrl+e");
    hands.answer_with("hero.rig.ron");
    until_there(&template);

    hands.key("p");
    let posing = hands.until("controls are posed", |report| report.mode == "Pose");
    let hand = joint(&posing, "hand_l");
    hands.drag(&[hand, [hand[0] - 25.0, hand[1] - 45.0]]);
    let posed = hands.until("the arm is pulled", |report| report.posed > 0 && report.steps.len() > posing.steps.len());
    assert_eq!(posed.selection.len(), 1, "what was pulled is selected");
    hands.key("k");
    let keyed = hands.until("a key is set, in a clip that came with it", |report| report.keys > 0);
    hands.shot("job_keyed");

    // Somebody else saves the template.
    let text = fs::read_to_string(&template).unwrap();
    let next = text.replacen("relative_size: 2.2", "relative_size: 2.4", 1);
    assert_ne!(next, text, "the template has a size to change");
    let beside = folder.join("hero.rig.ron.part");
    fs::write(&beside, next).unwrap();
    fs::rename(&beside, &template).unwrap();
    let offered = hands.until("the change is offered", |report| report.offered > 0);
    hands.click(hands.widget("the badge", |name| name.starts_with("Update: ")));
    hands.press("Take over");
    let updated = hands.until("the change is taken over", |report| {
        report.offered == 0 && report.steps.len() > offered.steps.len() && !report.busy
    });
    assert_eq!((updated.keys, updated.posed, updated.skinned), (keyed.keys, posed.posed, 1), "{:?}", updated.steps);
    assert_eq!(updated.commands, offered.commands);
    hands.shot("job_updated");

    let character = folder.join("hero.glb");
    hands.key("ctrl+e");
    hands.answer_with("hero");
    until_there(&character);
    let model = load_model(&RealDisk, &character).unwrap();
    assert!(model.nodes.len() > fitted.joints, "{} joints", model.nodes.len());
    assert!(model.clips.len() == 1 && !model.points.is_empty(), "{} clips", model.clips.len());
    assert_eq!(load_template(&RealDisk, &template).unwrap().rig.len(), updated.joints);
    if let Some(exports) = std::env::var_os("RIGSMITH_EXPORTS") {
        fs::copy(&character, Path::new(&exports).join("whole_job.glb")).unwrap();
    }
    let gestures = hands.gestures.borrow();
    println!("{} gestures: {}", gestures.len(), gestures.join(" "));
    assert!(gestures.len() <= MOST_GESTURES, "{} gestures: {gestures:?}", gestures.len());
}
