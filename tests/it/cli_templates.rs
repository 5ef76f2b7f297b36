//! Commands on templates: new, list, diff, update, merge, inject, extract.

use std::{fs, path::Path, sync::Arc};

use rigsmith::{
    modules,
    processor::{Builder, review},
    rig::Rig,
};
use serde_json::Value;

use super::cli_outputs::{json, rig, rigsmith};

fn builds(rig: &Rig) {
    let modules = Arc::new(modules::all());
    assert_eq!(review(rig, &modules), Vec::new());
    Builder::build(rig, &modules).unwrap();
}

#[test]
fn new_templates_build_and_take_no_others_place() {
    let folder = tempfile::tempdir().unwrap();
    for kind in ["chain", "limb", "sides", "figure", "part"] {
        let name = format!("{kind}.rig.ron");
        assert_eq!(rigsmith(folder.path(), &["new", kind, "-o", &name]).0, 0);
        builds(&rig(folder.path(), &name));
        let (code, said) = rigsmith(folder.path(), &["check", &name]);
        assert_eq!(code, 0, "{said}");
        assert!(fs::read_to_string(folder.path().join(&name)).unwrap().starts_with("// "));
        assert_eq!(rigsmith(folder.path(), &["format", "--check", &name]).0, 0, "{kind}");
        assert_eq!(rigsmith(folder.path(), &["new", kind, "-o", &name]).0, 2, "it is there already");
    }
    assert_eq!(rigsmith(folder.path(), &["new", "chain", "-o", "a.txt"]).0, 2);
    let (code, listed) = json(folder.path(), &["list"]);
    let templates = listed["templates"].as_array().unwrap();
    let counts: Vec<u64> = templates.iter().map(|one| one["joint_count"].as_u64().unwrap()).collect();
    assert_eq!((code, counts), (0, vec![3, 52, 4, 3, 3]));
    assert_eq!(templates[2]["features"].as_array().unwrap().len(), 2);
}

#[test]
fn a_folder_is_listed_by_headers() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir_all(folder.path().join("a/b")).unwrap();
    fs::write(folder.path().join("a/b/broken.rig.ron"), "(format: 1, nam").unwrap();
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates");
    fs::copy(assets.join("biped.rig.ron"), folder.path().join("a/biped.rig.ron")).unwrap();
    fs::copy(assets.join("parts/arm.rig.ron"), folder.path().join("arm.rig.ron")).unwrap();
    let (code, listed) = json(folder.path(), &["list"]);
    assert_eq!(code, 0);
    let templates = listed["templates"].as_array().unwrap();
    assert_eq!(templates.len(), 3);
    assert!(templates[0]["error"].is_string(), "{}", templates[0]);
    assert_eq!((&templates[1]["name"], &templates[1]["joint_count"]), (&Value::from("biped"), &Value::from(52)));
    assert_eq!(templates[2]["needs"]["sockets"][1], "root");
    assert_eq!(rigsmith(folder.path(), &["list", "nowhere"]).0, 1);
}

#[test]
fn a_rig_is_brought_to_a_new_version() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let read = |name: &str| fs::read_to_string(at(name)).unwrap();
    assert_eq!(rigsmith(folder.path(), &["new", "chain", "-o", "v1.rig.ron"]).0, 0);
    let v1 = read("v1.rig.ron");
    fs::write(at("v2.rig.ron"), v1.replace("(0, 1, 0)", "(0, 2, 0)").replace("link_3", "tip")).unwrap();
    fs::write(at("mine.rig.ron"), v1.replace("control(shape: \"square\")", "control(shape: \"cube\") /* mine */"))
        .unwrap();
    let (code, told) = json(folder.path(), &["diff", "v1.rig.ron", "v2.rig.ron"]);
    let kinds: Vec<&str> = told["changes"].as_array().unwrap().iter().map(|c| c["kind"].as_str().unwrap()).collect();
    assert_eq!((code, kinds), (0, vec!["renamed", "changed"]), "{told}");
    let change = &told["changes"][1];
    assert_eq!((change["joint"].as_str(), change["field"].as_str()), (Some("link_1"), Some("translation")));
    assert_eq!((change["from"].as_str(), change["to"].as_str()), (Some("(0.0, 1.0, 0.0)"), Some("(0.0, 2.0, 0.0)")));
    assert_eq!(change["conflict"], false);

    let update = ["update", "mine.rig.ron", "--from", "v2.rig.ron", "--base", "v1.rig.ron"];
    let (code, said) = rigsmith(folder.path(), &[&update[..], &["--dry-run"]].concat());
    assert!(code == 0 && said.contains("renamed") && !said.contains("conflict"), "{said}");
    let (code, said) = rigsmith(folder.path(), &[&update[..], &["-o", "out.rig.ron"]].concat());
    assert_eq!(code, 0, "{said}");
    let out = read("out.rig.ron");
    assert!(out.contains("cube\") /* mine */") && out.contains("(0, 2.0, 0)") && out.contains("\"tip\""), "{out}");
    builds(&rig(folder.path(), "out.rig.ron"));

    // Both sides changed it: nothing is written until somebody decides.
    fs::write(at("v3.rig.ron"), v1.replace("\"square\"", "\"sphere\"")).unwrap();
    let update = ["update", "mine.rig.ron", "--from", "v3.rig.ron", "--base", "v1.rig.ron", "-o", "both.rig.ron"];
    let (code, told) = json(folder.path(), &update);
    assert_eq!((code, &told["conflicts"], told["changes"][0]["conflict"].as_bool()), (1, &Value::from(1), Some(true)));
    assert!(!at("both.rig.ron").exists());
    assert_eq!(rigsmith(folder.path(), &[&update[..], &["--take", "theirs"]].concat()).0, 0);
    assert!(read("both.rig.ron").contains("sphere"));
    assert_eq!(rigsmith(folder.path(), &["update", "mine.rig.ron", "--from", "v3.rig.ron", "-o", "mine.rig.ron"]).0, 2);
    assert_eq!(rigsmith(folder.path(), &["diff", "mine.rig.ron", "nothing.rig.ron"]).0, 1);
}

#[test]
fn rigs_are_made_of_others() {
    let folder = tempfile::tempdir().unwrap();
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates");
    for (from, to) in [("biped.rig.ron", "biped.rig.ron"), ("parts/tail.rig.ron", "tail.rig.ron")] {
        fs::copy(assets.join(from), folder.path().join(to)).unwrap();
    }
    let (biped, tail) = (rig(folder.path(), "biped.rig.ron"), rig(folder.path(), "tail.rig.ron"));

    // A tail on the hips, twice: the second has uids and labels of its own.
    let merge = ["merge", "biped.rig.ron", "tail.rig.ron", "tail.rig.ron", "--parent", "hips", "-o", "tails.rig.ron"];
    let (code, said) = rigsmith(folder.path(), &merge);
    assert_eq!(code, 0, "{said}");
    let merged = rig(folder.path(), "tails.rig.ron");
    assert_eq!(merged.len(), biped.len() + 2 * tail.len());
    let hips = merged.find_label("hips").unwrap();
    let first = tail.walk().next().unwrap().data.uid;
    assert_eq!(merged.joint(first).unwrap().parent, Some(hips));
    assert!(merged.position(first).distance(tail.position(first)) < 1e-5, "it stays where it was");
    let labels: std::collections::BTreeSet<_> = merged.walk().map(|joint| joint.data.label.clone()).collect();
    assert_eq!(labels.len(), merged.len(), "every joint has a label of its own");
    builds(&merged);
    // The same again gives the same bytes.
    let once = fs::read(folder.path().join("tails.rig.ron")).unwrap();
    assert_eq!(rigsmith(folder.path(), &[&merge[..7], &["again.rig.ron"]].concat()).0, 0);
    assert_eq!(fs::read(folder.path().join("again.rig.ron")).unwrap(), once);

    // An arm out of it, and its tags onto another chain.
    let arm = "clavicle_l,upper_arm_l,forearm_l,hand_l";
    let (code, told) = json(folder.path(), &["extract", "biped.rig.ron", "--joints", arm, "-o", "arm.rig.ron"]);
    assert_eq!((code, told["joints"].as_u64()), (0, Some(4)), "{told}");
    assert!(told["left"].as_array().unwrap().iter().any(|left| left.as_str().unwrap().contains("refers to")), "{told}");
    let extracted = rig(folder.path(), "arm.rig.ron");
    let (hand, there) = (biped.find_label("hand_l").unwrap(), extracted.find_label("hand_l").unwrap());
    assert_eq!(hand, there, "uids stay");
    assert_eq!(extracted.about().description, "", "an arm is no biped");
    assert!(extracted.position(there).distance(biped.position(hand)) < 1e-5);
    let new = ["extract", "biped.rig.ron", "--joints", "clavicle_l", "--hierarchy", "--new-uids", "-o", "new.rig.ron"];
    assert_eq!(rigsmith(folder.path(), &new).0, 0);
    let new = rig(folder.path(), "new.rig.ron");
    assert!(new.len() > 15 && new.walk().all(|joint| biped.joint(joint.data.uid).is_none()));

    fs::write(
        folder.path().join("chain.rig.ron"),
        "(format: 2, name: \"c\", joints: [(label: \"a\", translation: (0, 1, 0)), (label: \"b\", parent: \"a\", translation: (0, 1, 0)), (label: \"c\", parent: \"b\", translation: (0, 1, 0))]) // mine\n",
    )
    .unwrap();
    assert_eq!(rigsmith(folder.path(), &["new", "chain", "-o", "part.rig.ron"]).0, 0);
    let part = "part.rig.ron";
    let (code, told) = json(folder.path(), &["inject", part, "chain.rig.ron", "--joints", "a,b,c", "-o", "fk.rig.ron"]);
    assert!(code == 0 && told["tags"] == 3, "{told}");
    builds(&rig(folder.path(), "fk.rig.ron"));
    assert!(fs::read_to_string(folder.path().join("fk.rig.ron")).unwrap().ends_with("// mine\n"));
    let (code, said) =
        rigsmith(folder.path(), &["inject", part, "chain.rig.ron", "--joints", "a,x", "-o", "no.rig.ron"]);
    assert!(
        code == 1 && said.contains("no joint of \"c\" is called \"x\"") && !folder.path().join("no.rig.ron").exists()
    );
    for (joints, told) in [("c,b,a", "\"b\" is not next below \"c\""), ("a,b,b", "\"b\" is given twice")] {
        let (code, said) =
            rigsmith(folder.path(), &["inject", part, "chain.rig.ron", "--joints", joints, "-o", "no.rig.ron"]);
        assert!(code == 1 && said.contains(told) && !folder.path().join("no.rig.ron").exists(), "{joints}: {said}");
    }
}

#[test]
fn overrides_sockets_and_options_are_listed() {
    let folder = tempfile::tempdir().unwrap();
    let part = "(format: 2, name: \"arm\", kind: \"part\", author: \"Ada\", sockets: [(name: \"hand\", joint: \"arm\")], \
                options: [(name: \"size\", default: 0.5, form: Slider(min: 0, max: 1), sets: [(tag: \"control/arm\", param: \"relative_size\")])], \
                joints: [(label: \"arm\", tags: [Feature(kind: \"fk\", name: \"fk\"), control(feature: \"fk\")])])";
    fs::write(folder.path().join("arm.rig.ron"), part).unwrap();
    let whole = "(format: 2, name: \"man\", joints: [(label: \"body\")], parts: [(part: \"arm.rig.ron\", name: \"left\", parent: \"body\", \
                 options: {\"size\": 0.7}, off: [\"fk\"], changes: [(tag: \"control/arm\", params: (shape: \"star\")), \
                 (joint: \"arm\", translation: (1, 0, 0))]), \
                 (part: \"arm.rig.ron\", name: \"right\", parent: \"body\", prefix: \"r_\", mirror: true)])";
    fs::write(folder.path().join("man.rig.ron"), whole).unwrap();
    let (code, said) = rigsmith(folder.path(), &["info", "man.rig.ron"]);
    assert_eq!(code, 0, "{said}");
    for line in [
        "option size: value = 0.7",
        "feature fk: enabled = false",
        "tag control/arm: shape = \"star\"",
        "joint arm: translation = (1.0, 0.0, 0.0)",
        "socket left.hand on arm",
        "socket right.hand on r_arm",
    ] {
        assert!(said.contains(line), "{line}: {said}");
    }
    let (_, info) = json(folder.path(), &["info", "man.rig.ron"]);
    let overrides = info["overrides"].as_array().unwrap();
    assert_eq!(overrides.len(), 4);
    assert_eq!((&overrides[0]["part"], &overrides[2]["field"]), (&"left".into(), &"shape".into()));
    let (_, listed) = json(folder.path(), &["list"]);
    let arm = &listed["templates"][0];
    assert_eq!((&arm["sockets"][0]["name"], &arm["options"][0]["default"]), (&"hand".into(), &"0.5".into()));
    let (_, said) = rigsmith(folder.path(), &["list"]);
    for word in ["Ada", "fk", "hand", "size"] {
        assert!(said.contains(word), "{word}: {said}");
    }
}

/// A folder of many files with one fault is told in one line, and by all of its files to programs.
#[test]
fn a_fault_that_many_templates_have_is_told_once() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("good.rig.ron"), "(format: 2, name: \"good\", joints: [(label: \"a\")])").unwrap();
    fs::write(folder.path().join("one.rig.ron"), "(format: 2, nam").unwrap();
    for number in 0..300 {
        fs::write(folder.path().join(format!("bad{number:03}.rig.ron")), "no template").unwrap();
    }
    let (code, said) = rigsmith(folder.path(), &["list", "."]);
    assert_eq!(code, 0, "{said}");
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(lines.len(), 3, "{said}");
    assert!(lines[0].contains("good (1 joint)"), "{said}");
    let of_many: Vec<&str> = lines.iter().copied().filter(|line| line.contains("and 295 more files: line 1")).collect();
    assert_eq!(of_many.len(), 1, "{said}");
    assert!(of_many[0].contains("bad000.rig.ron, ") && of_many[0].contains("bad004.rig.ron and"), "{said}");
    assert!(lines.iter().any(|line| line.contains("one.rig.ron: line 1")), "{said}");
    let (_, listed) = json(folder.path(), &["list", "."]);
    let faults = listed["templates"].as_array().unwrap().iter().filter(|one| one["error"].is_string());
    assert_eq!(faults.count(), 301);
}

#[test]
fn the_version_that_was_taken_over_is_the_base_of_the_next_update() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    assert_eq!(rigsmith(folder.path(), &["new", "chain", "-o", "v1.rig.ron"]).0, 0);
    let v1 = fs::read_to_string(at("v1.rig.ron")).unwrap();
    let mine = v1.replace("\"square\"", "\"cube\"");
    fs::write(at("mine.rig.ron"), &mine).unwrap();
    fs::write(at("v2.rig.ron"), v1.replace("(0, 1, 0)", "(0, 2, 0)")).unwrap();
    fs::write(at("v3.rig.ron"), v1.replace("(0, 1, 0)", "(0, 3, 0)")).unwrap();
    // Nobody knows the base: every difference is a conflict.
    let (code, told) = json(folder.path(), &["update", "mine.rig.ron", "--from", "v2.rig.ron", "-o", "out.rig.ron"]);
    assert_eq!((code, &told["conflicts"]), (1, &Value::from(2)), "{told}");
    assert!(told["error"]["do"].as_str().unwrap().contains("--base"), "{told}");
    let first =
        ["update", "mine.rig.ron", "--from", "v2.rig.ron", "--base", "v1.rig.ron", "--keep-base", "-o", "out.rig.ron"];
    assert_eq!(rigsmith(folder.path(), &first).0, 0);
    assert!(at("out.rig.ron.base").exists());
    let next = ["update", "out.rig.ron", "--from", "v3.rig.ron", "-o", "next.rig.ron"];
    let (code, told) = json(folder.path(), &next);
    assert_eq!((code, &told["conflicts"]), (0, &Value::from(0)), "{told}");
    assert!(told["base"].as_str().unwrap().ends_with("out.rig.ron.base"));
    let text = fs::read_to_string(at("next.rig.ron")).unwrap();
    assert!(text.contains("cube") && text.contains("(0, 3.0, 0)"), "{text}");
    assert!(at("next.rig.ron.base").exists(), "and so it goes on");
    let (_, listed) = json(folder.path(), &["list"]);
    assert_eq!(listed["templates"].as_array().unwrap().len(), 6, "a base is no template of its own");
}

#[test]
fn joints_are_turned_and_rigs_hung_where_one_says() {
    let folder = tempfile::tempdir().unwrap();
    let chain = |name: &str| {
        format!(
            "(format: 2, name: \"{name}\", joints: [(label: \"{name}_1\", translation: (0, 1, 0)), (label: \"{name}_2\", parent: \"{name}_1\", translation: (0.3, 0, 0)), (label: \"{name}_3\", parent: \"{name}_2\", translation: (0.3, 0, 0))])"
        )
    };
    for name in ["a", "b", "c"] {
        fs::write(folder.path().join(format!("{name}.rig.ron")), chain(name)).unwrap();
    }
    let files = ["a.rig.ron", "b.rig.ron", "c.rig.ron"];
    let merge = |parents: &[&str]| {
        let given = parents.iter().flat_map(|parent| ["--parent", parent]);
        let args: Vec<&str> = ["merge"].into_iter().chain(files).chain(given).chain(["-o", "all.rig.ron"]).collect();
        rigsmith(folder.path(), &args)
    };
    let (code, said) = merge(&["a_3", "c:b_2"]);
    assert_eq!(code, 0, "{said}");
    let all = rig(folder.path(), "all.rig.ron");
    let above = |rig: &Rig, label: &str| {
        let parent = rig.joint(rig.find_label(label).unwrap()).unwrap().parent?;
        rig.joint(parent)?.data.label.clone()
    };
    assert_eq!((above(&all, "b_1").as_deref(), above(&all, "c_1").as_deref()), (Some("a_3"), Some("b_2")));
    assert!(merge(&["a_3", "a_2"]).0 != 0 && merge(&["b:a_3", "b.rig.ron:a_2"]).0 != 0, "one parent for each");

    // The Y axis along the bones, which lie along X.
    let extract = [
        "extract",
        "a.rig.ron",
        "--joints",
        "a_1",
        "--hierarchy",
        "--orient",
        "y",
        "--kind",
        "template",
        "-o",
        "turned.rig.ron",
    ];
    let (code, said) = rigsmith(folder.path(), &extract);
    assert_eq!(code, 0, "{said}");
    let turned = rig(folder.path(), "turned.rig.ron");
    assert_eq!(turned.about().kind, "template");
    let second = turned.joint(turned.find_label("a_2").unwrap()).unwrap().data.rest.translation;
    assert!(second.distance(glam::Vec3::new(0.0, 0.3, 0.0)) < 1e-5, "{second}");
    let before = rig(folder.path(), "a.rig.ron");
    for label in ["a_1", "a_2", "a_3"] {
        let place = |rig: &Rig| rig.position(rig.find_label(label).unwrap());
        assert!(place(&before).distance(place(&turned)) < 1e-5, "{label} stands where it stood");
    }
    assert_eq!(rigsmith(folder.path(), &["new", "chain", "-o", "part.rig.ron"]).0, 0);
    let inject =
        ["inject", "part.rig.ron", "a.rig.ron", "--joints", "a_1,a_2,a_3", "--orient", "y", "-o", "fk.rig.ron"];
    let (code, said) = rigsmith(folder.path(), &inject);
    assert_eq!(code, 0, "{said}");
    let injected = rig(folder.path(), "fk.rig.ron");
    let second = injected.joint(injected.find_label("a_2").unwrap()).unwrap().data.rest.translation;
    assert!(second.distance(glam::Vec3::new(0.0, 0.3, 0.0)) < 1e-5, "{second}");
    builds(&injected);
    // What comes out of a rig is written as people write it.
    let extract = ["extract", "fk.rig.ron", "--joints", "a_2,a_3", "-o", "out.rig.ron"];
    assert_eq!(rigsmith(folder.path(), &extract).0, 0);
    let text = fs::read_to_string(folder.path().join("out.rig.ron")).unwrap();
    assert!(text.contains("control(") && !text.contains("Command(") && !text.contains("author"), "{text}");
    assert_eq!(rigsmith(folder.path(), &["format", "--check", "out.rig.ron"]).0, 0, "in its layout: {text}");
    builds(&rig(folder.path(), "out.rig.ron"));
}
