//! Characters that are made from templates with parts, on the command line: parts stay parts, and updates find the template.

use std::{
    fs,
    path::Path,
    sync::{Arc, OnceLock},
};

use rigsmith::{
    files::{RealDisk, bundled_characters, load_model, load_template},
    headless::Workbench,
    plugins::fit::FitTemplates,
    rig::{
        Rig, TagKind, Uid,
        template::Template,
        update::{Change, ChangeKind, diff},
    },
};
use serde_json::Value;
use tempfile::TempDir;

use crate::cli_build::rigsmith;

fn asset(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets").join(name).display().to_string()
}

fn template(path: &Path) -> Template {
    load_template(&RealDisk, path).unwrap()
}

/// Files of the fitted body and of the template beside it, as the command writes them.
fn fitted() -> &'static [String; 2] {
    static FITTED: OnceLock<[String; 2]> = OnceLock::new();
    FITTED.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let answer = rigsmith(folder.path(), &["fit", &asset("models/biped.obj"), "-o", "body.rig.ron"]);
        assert_eq!(answer.code, 0, "{}", answer.err);
        assert!(!answer.err.contains("written"), "{}", answer.err);
        ["body.rig.ron", "body.rig.ron.base"].map(|name| fs::read_to_string(folder.path().join(name)).unwrap())
    })
}

/// A folder with the fitted body, and another one in it with a template of one's own that has a copy of the arm.
fn workplace() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let [body, base] = fitted();
    fs::write(folder.path().join("body.rig.ron"), body).unwrap();
    fs::write(folder.path().join("body.rig.ron.base"), base).unwrap();
    fs::create_dir_all(folder.path().join("own/parts")).unwrap();
    for name in ["biped.rig.ron", "parts/arm.rig.ron"] {
        fs::copy(asset(&format!("templates/{name}")), folder.path().join("own").join(name)).unwrap();
    }
    folder
}

fn replace(path: &Path, old: &str, new: &str) {
    let text = fs::read_to_string(path).unwrap();
    assert_eq!(text.matches(old).count(), 1, "{old}");
    fs::write(path, text.replace(old, new)).unwrap();
}

/// Files and uids of the part instances.
fn instances(template: &Template) -> Vec<(String, Uid)> {
    template.instances.iter().map(|instance| (instance.part.clone(), instance.uid)).collect()
}

/// Differences of two rigs in more than the blanks between numbers.
fn differences(a: &Rig, b: &Rig) -> Vec<Change> {
    let bare = |text: &Option<String>| text.as_ref().map(|text| text.split_whitespace().collect::<String>());
    let is_real = |change: &Change| change.kind != ChangeKind::Changed || bare(&change.from) != bare(&change.to);
    diff(a, b).into_iter().filter(is_real).collect()
}

/// Parameters of the control of the left shoulder.
fn shoulder(rig: &Rig) -> String {
    let clavicle = rig.joint(rig.find_label("clavicle_l").unwrap()).unwrap();
    let control = clavicle.data.tags.iter().find_map(|tag| match &tag.kind {
        TagKind::Command { module, params, .. } if module == "control" => Some(params.clone()),
        _ => None,
    });
    control.unwrap()
}

/// Fields that an update would change, and true if one of them is a conflict.
fn update(folder: &Path, rig: &str, from: &str) -> (Vec<String>, bool) {
    let answer = rigsmith(folder, &["--json", "update", rig, "--from", from, "--dry-run"]);
    assert_eq!(answer.code, 0, "{}", answer.err);
    let json = answer.json();
    let changes = json["changes"].as_array().unwrap();
    let text = |change: &Value, key: &str| change[key].as_str().unwrap_or_default().to_owned();
    let fields = changes.iter().map(|change| format!("{} {}", text(change, "tag"), text(change, "field"))).collect();
    (fields, json["conflicts"] != 0)
}

#[test]
fn a_fitted_character_keeps_the_parts_of_its_template() {
    let folder = workplace();
    let [text, _] = fitted();
    let body = template(&folder.path().join("body.rig.ron"));
    let biped = template(Path::new(&asset("templates/biped.rig.ron")));
    assert_eq!(instances(&body), instances(&biped));
    assert_eq!(body.rig.uid(), biped.rig.uid());
    assert!(text.contains("// The left arm can follow hips and head, too."), "comments stay");
    // Each joint of a part has a line for its place.
    for label in ["spine", "thigh_l", "thumb_01_r"] {
        let start = format!("(joint: \"{label}\", translation: (");
        let line = text.lines().find(|line| line.trim_start().starts_with(&start));
        assert!(line.is_some_and(|line| line.trim_end().ends_with("),")), "{label}: {text}");
    }
    // The file says the rig that a fit gives.
    let mut bench = Workbench::new(7, "body");
    bench.open(load_model(&RealDisk, Path::new(&asset("models/biped.obj"))).unwrap(), true).unwrap();
    bench.offer_templates(FitTemplates(Arc::new(bundled_characters)));
    bench.fit(|_| (), &mut |_| ()).unwrap();
    assert_eq!(differences(&body.rig, bench.rig()), Vec::new());
    let rests = |rig: &Rig| rig.walk().map(|joint| (joint.data.uid, joint.data.rest)).collect::<Vec<_>>();
    assert_eq!(rests(&body.rig), rests(bench.rig()));
    assert!(!differences(&body.rig, &biped.rig).is_empty(), "it was fitted");
}

#[test]
fn an_update_of_a_fitted_character_tells_what_changed() {
    let folder = workplace();
    let at = |name: &str| folder.path().join(name);
    let none = (Vec::new(), false);
    assert_eq!(update(folder.path(), "body.rig.ron", &asset("templates/biped.rig.ron")), none);
    assert_eq!(update(folder.path(), "body.rig.ron", "own/biped.rig.ron"), none);
    replace(&at("own/biped.rig.ron"), "\"four_arrows\"", "\"circle\"");
    let root = "control/root params.shape";
    assert_eq!(update(folder.path(), "body.rig.ron", "own/biped.rig.ron"), (vec![root.to_owned()], false));
    replace(&at("own/parts/arm.rig.ron"), "\"half_circle\"", "\"square\"");
    let all = [root, "control/shoulder_l params.shape", "control/shoulder_r params.shape"].map(str::to_owned);
    assert_eq!(update(folder.path(), "body.rig.ron", "own/biped.rig.ron"), (all.to_vec(), false));
    // The updated character has its parts, its places and the new values.
    let answer =
        rigsmith(folder.path(), &["update", "body.rig.ron", "--from", "own/biped.rig.ron", "-o", "next.rig.ron"]);
    assert_eq!(answer.code, 0, "{}", answer.err);
    let [body, next] = ["body.rig.ron", "next.rig.ron"].map(|name| template(&at(name)));
    assert_eq!(instances(&next), instances(&body));
    assert!(shoulder(&next.rig).contains("\"square\"") && shoulder(&body.rig).contains("\"half_circle\""));
    assert_eq!(differences(&body.rig, &next.rig).len(), 3);
    assert_eq!(update(folder.path(), "next.rig.ron", "own/biped.rig.ron"), none);
    // Without the template beside it, an update cannot know who changed what.
    fs::remove_file(at("body.rig.ron.base")).unwrap();
    assert!(update_conflicts(folder.path()));
}

/// True if an update of the body tells conflicts.
fn update_conflicts(folder: &Path) -> bool {
    let answer = rigsmith(folder, &["--json", "update", "body.rig.ron", "--from", "own/biped.rig.ron", "--dry-run"]);
    answer.json()["conflicts"].as_u64().unwrap() > 0
}

#[test]
fn a_changed_part_reaches_fitted_characters() {
    let folder = workplace();
    let at = |name: &str| folder.path().join(name);
    // Beside the character, where its parts are looked for first.
    fs::create_dir(at("parts")).unwrap();
    fs::copy(at("own/parts/arm.rig.ron"), at("parts/arm.rig.ron")).unwrap();
    assert!(shoulder(&template(&at("body.rig.ron")).rig).contains("\"half_circle\""));
    replace(&at("parts/arm.rig.ron"), "\"half_circle\"", "\"square\"");
    assert!(shoulder(&template(&at("body.rig.ron")).rig).contains("\"square\""));
    // Beside the template that was fitted, from another folder.
    fs::create_dir(at("made")).unwrap();
    let body = asset("models/biped.obj");
    let fit = ["fit", &body, "--template", "own/biped.rig.ron", "-o", "made/hero.rig.ron"];
    let answer = rigsmith(folder.path(), &fit);
    assert!(answer.code == 0 && !answer.err.contains("written"), "{}", answer.err);
    let answer = rigsmith(folder.path(), &["convert", "own/biped.rig.ron", "made/plain.rig.ron"]);
    assert!(answer.code == 0 && answer.err.is_empty(), "{}", answer.err);
    let own = template(&at("own/biped.rig.ron"));
    for name in ["made/hero.rig.ron", "made/plain.rig.ron"] {
        let made = template(&at(name));
        let file = |part: String| match part.as_str() {
            "parts/arm.rig.ron" => "../own/parts/arm.rig.ron".to_owned(),
            _ => part,
        };
        let wanted: Vec<(String, Uid)> = instances(&own).into_iter().map(|(part, uid)| (file(part), uid)).collect();
        assert_eq!(instances(&made), wanted, "{name}");
        assert!(shoulder(&made.rig).contains("\"half_circle\""), "{name}");
    }
    fs::remove_dir_all(at("parts")).unwrap();
    let hero = template(&at("made/hero.rig.ron"));
    assert_eq!(differences(&template(&at("body.rig.ron")).rig, &hero.rig), Vec::new());
    replace(&at("own/parts/arm.rig.ron"), "\"half_circle\"", "\"sphere\"");
    for name in ["made/hero.rig.ron", "made/plain.rig.ron"] {
        assert!(shoulder(&template(&at(name)).rig).contains("\"sphere\""), "{name}");
    }
    // It came with the part already.
    assert_eq!(update(folder.path(), "made/hero.rig.ron", "own/biped.rig.ron"), (Vec::new(), false));
}

#[test]
fn a_fit_in_a_sketch_keeps_parts() {
    let folder = workplace();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("fit.ron"), "[Fit(template: \"biped\")]").unwrap();
    let body = asset("models/biped.obj");
    let answer = rigsmith(folder.path(), &["sketch", &body, "fit.ron", "-o", "sketched.rig.ron"]);
    assert_eq!(answer.code, 0, "{}", answer.err);
    let [sketched, fitted] = ["sketched.rig.ron", "body.rig.ron"].map(|name| template(&at(name)));
    assert_eq!(instances(&sketched), instances(&fitted));
    assert_eq!(differences(&sketched.rig, &fitted.rig), Vec::new());
    assert_eq!(update(folder.path(), "sketched.rig.ron", "own/biped.rig.ron"), (Vec::new(), false));
}

/// A skeleton that was built has no commands, and so no parts that bring some: the command says so. Parts of joints alone
/// stay.
#[test]
fn built_skeletons_keep_the_parts_that_they_can_have() {
    let folder = workplace();
    let at = |name: &str| folder.path().join(name);
    let bone =
        "(format: 2, name: \"bone\", joints: [(label: \"a\"), (label: \"b\", parent: \"a\", translation: (0, 1, 0))])";
    fs::write(at("bone.rig.ron"), bone).unwrap();
    let host = "(\n    format: 2,\n    name: \"host\",\n    joints: [(label: \"root\")],\n    parts: [(part: \"bone.rig.ron\", parent: \"root\")],\n)\n";
    fs::write(at("host.rig.ron"), host).unwrap();
    for command in ["build", "pose"] {
        let answer = rigsmith(folder.path(), &[command, "body.rig.ron", "-o", "built.rig.ron"]);
        assert!(answer.code == 0 && answer.err.contains("the built skeleton alone"), "{command}: {}", answer.err);
        let built = template(&at("built.rig.ron"));
        assert!(built.instances.is_empty() && built.rig.walk().all(|joint| joint.data.tags.is_empty()), "{command}");
        let answer = rigsmith(folder.path(), &[command, "host.rig.ron", "-o", "stays.rig.ron"]);
        assert!(answer.code == 0 && answer.err.is_empty(), "{command}: {}", answer.err);
        let [host, stays] = ["host.rig.ron", "stays.rig.ron"].map(|name| template(&at(name)));
        assert_eq!((instances(&stays), stays.rig.len()), (instances(&host), 3), "{command}");
    }
}
