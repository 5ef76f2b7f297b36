//! Folders of the site, names and versions of templates on the command line.

use std::{fs, path::Path, process::Command};

use serde_json::Value;

/// Runs the command in a folder, with folders of the site.
fn rigsmith(folder: &Path, site: &[&Path], config: &Path, args: &[&str]) -> (i32, Value) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rigsmith"));
    command.current_dir(folder).env("RIGSMITH_CONFIG", config);
    command.env("RIGSMITH_TEMPLATES", std::env::join_paths(site).unwrap());
    let output = command.arg("--json").args(args).output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    let value = serde_json::from_str(&said).unwrap_or_else(|error| panic!("{error}: {said}"));
    (output.status.code().unwrap(), value)
}

fn template(version: &str, height: &str) -> String {
    format!(
        "(format: 2, name: \"mast\", version: \"{version}\", joints: [(label: \"foot\"), (label: \"top\", parent: \"foot\", translation: (0, {height}, 0))])"
    )
}

#[test]
fn templates_of_the_site_are_listed_named_and_compared() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for place in ["project", "rigs", "more", "config"] {
        fs::create_dir(at(place)).unwrap();
    }
    fs::write(at("project/mine.rig.ron"), template("1.9", "1")).unwrap();
    fs::write(at("rigs/mast.rig.ron"), template("1.10", "2")).unwrap();
    fs::write(at("more/mast.rig.ron"), template("1.2", "3")).unwrap();
    fs::write(at("config/rigsmith.ron"), "(templates: [\"../more\"])").unwrap();
    let rigs = at("rigs");
    let run = |args: &[&str]| rigsmith(&at("project"), &[&rigs], &at("config"), args);

    let (code, listed) = run(&["list"]);
    let files: Vec<&str> =
        listed["templates"].as_array().unwrap().iter().map(|one| one["file"].as_str().unwrap()).collect();
    assert_eq!((code, files.len()), (0, 3), "{listed}");
    assert!(files[0].ends_with("mine.rig.ron") && files[1].contains("rigs") && files[2].contains("more"), "{files:?}");
    for (one, newer) in listed["templates"].as_array().unwrap().iter().zip([true, false, true]) {
        assert_eq!(one["newer"]["version"] == "1.10", newer, "{one}");
    }
    let bundled = listed["bundled"].as_array().unwrap();
    assert!(bundled.iter().any(|one| one["name"] == "biped" && one["joint_count"] == 52), "{listed}");
    // Of a folder, only what is in it; but a newer copy elsewhere is told.
    let (_, listed) = run(&["list", "."]);
    assert_eq!(listed["templates"].as_array().unwrap().len(), 1);
    assert!(
        listed["templates"][0]["newer"]["file"].as_str().unwrap().contains("rigs") && listed.get("bundled").is_none()
    );

    // By name: the first folder that has it.
    let (code, told) = run(&["update", "mine.rig.ron", "--from", "mast", "--base", "mine.rig.ron", "--dry-run"]);
    assert_eq!((code, &told["version"]["from"], &told["version"]["to"]), (0, &"1.9".into(), &"1.10".into()), "{told}");
    let heights: Vec<&Value> = told["changes"].as_array().unwrap().iter().map(|change| &change["to"]).collect();
    assert!(heights.contains(&&Value::from("(0.0, 2.0, 0.0)")), "{told}");
    let (code, told) = run(&["diff", "biped", "biped.rig.ron"]);
    assert_eq!((code, &told["changes"]), (0, &Value::Array(Vec::new())), "{told}");
    assert_eq!(run(&["diff", "biped", "nothing"]).0, 1);

    fs::write(at("config/rigsmith.ron"), "(templates: 3)").unwrap();
    let (code, told) = run(&["list"]);
    assert_eq!(code, 1);
    assert!(told.to_string().contains("rigsmith.ron"), "{told}");
}

/// Files are versions of one template if kind and uid agree, and authors where the uid follows from the name.
#[test]
fn templates_of_one_name_are_no_versions_of_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for place in ["project", "config", "rigs"] {
        fs::create_dir(at(place)).unwrap();
    }
    let write = |name: &str, header: &str| {
        let text = format!("(format: 2, {header}, joints: [(label: \"foot\")])");
        fs::write(at("project").join(format!("{name}.rig.ron")), text).unwrap();
    };
    // As somebody begins: the name of a part that comes with Rigsmith, and nothing more.
    write("a_tail", "name: \"tail\"");
    for (name, header, kind) in [
        ("b_old", "version: \"1.0\", author: \"me\"", "prop"),
        ("c_new", "version: \"2.0\", author: \"me\"", "prop"),
        ("d_other", "version: \"1.0\", author: \"you\"", "prop"),
        ("e_part", "version: \"1.0\", author: \"me\"", "part"),
        ("f_old", "uid: \"00000000000000f0\", version: \"1.0\", author: \"me\"", "prop"),
        ("g_new", "uid: \"00000000000000f0\", version: \"2.0\", author: \"you\"", "prop"),
        ("h_part", "uid: \"00000000000000f0\", version: \"1.0\", author: \"me\"", "part"),
    ] {
        write(name, &format!("name: \"mast\", kind: \"{kind}\", {header}"));
    }
    let (code, listed) = rigsmith(&at("project"), &[&at("rigs")], &at("config"), &["list"]);
    assert_eq!(code, 0, "{listed}");
    let newer = |list: &str| -> Vec<String> {
        let told = listed[list].as_array().unwrap().iter().filter(|one| one["newer"].is_object());
        told.map(|one| one["file"].as_str().unwrap().rsplit(['/', '\\']).next().unwrap().to_owned()).collect()
    };
    assert_eq!(newer("templates"), ["b_old.rig.ron", "f_old.rig.ron"], "{listed}");
    assert_eq!(newer("bundled"), Vec::<String>::new(), "the hand is no old version of the character \"hand\"");
}

#[test]
fn expressions_of_the_site_are_shown_and_broken_ones_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for place in ["site/faces", "none", "config"] {
        fs::create_dir_all(at(place)).unwrap();
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let smile = fs::read_to_string(root.join("assets/expressions/happiness.expr.ron")).unwrap();
    fs::write(at("site/faces/beaming.expr.ron"), smile.replace("\"happiness\"", "\"beaming\"")).unwrap();
    fs::write(at("site/broken.expr.ron"), &smile[..smile.len() / 2]).unwrap();
    let head = root.join("assets/models/head.obj").display().to_string();
    let beaming = ["face", &head, "--bones", "8", "--expression", "beaming=1", "-o", "face.rig.ron"];
    let (code, told) = rigsmith(folder.path(), &[&at("site")], &at("config"), &beaming);
    assert_eq!(code, 0, "{told}");
    assert_eq!(told["expressions"]["beaming"], 1.0, "{told}");
    let notes = told["notes"].to_string();
    assert!(notes.contains("broken.expr.ron"), "{told}");
    assert_eq!(notes.matches("broken.expr.ron").count(), 1, "{told}");
    // Without the folder nobody knows it.
    let (code, told) = rigsmith(folder.path(), &[&at("none")], &at("config"), &beaming);
    assert!(code == 2 && told.to_string().contains("beaming"), "{told}");
}
