//! Fits that begin anew: with another template, or facing the other way.

use super::*;

/// The choice of another template takes the fit back, with its corrections, and begins anew: one step, one Esc.
#[test]
fn another_template_takes_the_place_of_a_fit() {
    let mut window = Window::new(body());
    let before = window.text();
    window.fit();
    assert_eq!(window.open().unwrap().report.template, "biped");
    window.drag("forearm_l", Vec3::new(0.0, 0.01, 0.0));
    assert!(window.steps() > 1 && !window.markers().is_empty());
    let is_choice = |seen: &&ShownWidget| seen.value == "biped" || seen.label == "biped";
    let combo = window.desk.seen.iter().find(is_choice).expect("the template is chosen in the bar").rect;
    window.desk.time += 1.0;
    window.desk.click_at(combo.center());
    window.desk.frames(2);
    window.desk.click("quadruped");
    window.desk.frames(4);
    window.settle();
    assert_eq!(window.open().unwrap().report.template, "quadruped", "{:?}", window.told().notices);
    let joints = character("quadruped").walk().count();
    assert_eq!(window.rig().len(), joints, "no joint of the biped is left");
    assert_eq!((window.steps(), window.markers().len()), (1, 0));
    window.act(Action::Cancel);
    window.desk.frames(4);
    assert_eq!(window.text(), before);
}

/// A figure that was taken to face the other way is turned by a button; where the mesh is sure, its objection is told.
#[test]
fn a_fit_turns_round() {
    let mut window = Window::fitted();
    let (front, hand) = (window.open().unwrap().report.fit.forward, window.at("hand_l"));
    window.desk.click("Turn round");
    window.desk.frames(4);
    window.settle();
    let report = window.open().unwrap().report.clone();
    assert_eq!(report.template, "biped");
    assert!(report.fit.forward.dot(front) < -0.99, "{}", report.fit.forward);
    let mirrored = hand * Vec3::new(-1.0, 1.0, 1.0);
    assert!(window.at("hand_l").distance(mirrored) < 0.05 * report.fit.height, "left and right change their places");
    assert_eq!(window.steps(), 1);
    let mut warnings = report.warnings().map(ToString::to_string);
    let warning = warnings.find(|warning| warning.contains("contradicts the mesh")).expect("a warning");
    window.says(&warning);
    assert!(window.desk.says(&warning), "the bar tells {warning}");
}

/// Joints that the rig had before are not replaced by those of another template.
#[test]
fn own_joints_have_no_other_template() {
    let mut window = Window::fitted();
    assert!(window.open().unwrap().has_own_template);
    window.act(Action::Accept);
    window.fit();
    assert!(!window.open().unwrap().has_own_template);
    assert!(window.desk.look("Turn round").is_some());
    assert!(window.desk.look("Template").is_none());
}
