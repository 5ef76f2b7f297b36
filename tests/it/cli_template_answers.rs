//! Answers of the commands on templates: what programs read of them, and what a list tells.

use std::fs;

use serde_json::{Value, json as value};

use crate::cli_outputs::{json, rigsmith};

const CRANE: &str = r#"(
    format: 2,
    name: "crane",
    version: "1.2",
    kind: "machine",
    author: "Ada",
    description: "A crane: it lifts.",
    preview: "crane.png",
    sockets: [(name: "hook", joint: "tip")],
    joints: [
        (label: "base", tags: [Feature(kind: "ik", name: "winch", switch: "brake"), control]),
        (label: "tip", parent: "base", translation: (0, 2, 0)),
    ],
)
"#;

const CHAIN: &str = r#"(format: 2, name: "c", joints: [(label: "a", translation: (0, 1, 0)), (label: "b", parent: "a", translation: (0, 1, 0)), (label: "c", parent: "b", translation: (0, 1, 0))])"#;

#[test]
fn a_list_tells_all_of_a_header() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("crane.rig.ron"), CRANE).unwrap();
    let (code, listed) = json(folder.path(), &["list", "."]);
    let one = &listed["templates"][0];
    let told =
        ["name", "version", "kind", "author", "description", "preview", "joint_count"].map(|key| one[key].clone());
    let wanted = value!(["crane", "1.2", "machine", "Ada", "A crane: it lifts.", "crane.png", 2]);
    assert_eq!((code, Value::from(told.to_vec())), (0, wanted), "{listed}");
    assert_eq!(one["features"], value!([{"kind": "ik", "name": "winch", "switches": ["brake"]}]));
    assert_eq!(one["sockets"], value!([{"name": "hook", "joint": "tip"}]));
    let (_, said) = rigsmith(folder.path(), &["list", "."]);
    for word in ["crane (machine 1.2, 2 joints): A crane", "Ada", "crane.png", "winch (brake)", "hook on tip"] {
        assert!(said.contains(word), "{word}: {said}");
    }
}

#[test]
fn every_command_on_templates_answers_programs() {
    let folder = tempfile::tempdir().unwrap();
    let answer = |args: &[&str]| {
        let (code, told) = json(folder.path(), args);
        assert_eq!((code, &told["ok"]), (0, &Value::Bool(true)), "{args:?}: {told}");
        told
    };
    let written = |args: &[&str], name: &str| {
        let told = answer(&[args, &["-o", name]].concat());
        assert_eq!(told["output"], name, "{args:?}: {told}");
        assert!(folder.path().join(name).exists(), "{args:?}");
        told
    };
    written(&["new", "chain"], "v1.rig.ron");
    let text = fs::read_to_string(folder.path().join("v1.rig.ron")).unwrap();
    fs::write(folder.path().join("v2.rig.ron"), text.replace("square", "cube")).unwrap();
    fs::write(folder.path().join("c.rig.ron"), CHAIN).unwrap();
    assert_eq!(answer(&["format", "--check", "v1.rig.ron"])["files"][0]["changed"], false);
    let update = ["update", "v1.rig.ron", "--from", "v2.rig.ron", "--base", "v1.rig.ron"];
    let dry = answer(&[&update[..], &["--dry-run"]].concat());
    assert!(dry.get("output").is_none(), "{dry}");
    let told = [answer(&["diff", "v1.rig.ron", "v2.rig.ron"]), dry, written(&update, "o.rig.ron")];
    for told in told {
        let change = told["changes"][0].as_object().unwrap();
        let fields = ["kind", "joint", "tag", "field", "from", "to", "conflict"].map(|key| change[key].clone());
        let wanted = value!(["changed", "link_1", "control", "params.shape", "\"square\"", "\"cube\"", false]);
        assert_eq!(Value::from(fields.to_vec()), wanted, "{told}");
        assert_eq!(told["changes"].as_array().unwrap().len(), 1, "{told}");
    }
    assert_eq!(written(&["merge", "v1.rig.ron", "c.rig.ron"], "m.rig.ron")["joints"], 6);
    assert_eq!(written(&["inject", "v1.rig.ron", "c.rig.ron", "--joints", "a,b,c"], "i.rig.ron")["tags"], 3);
    let extracted = written(&["extract", "v1.rig.ron", "--joints", "link_1,link_2"], "e.rig.ron");
    assert_eq!((&extracted["joints"], &extracted["left"]), (&value!(2), &value!([])), "{extracted}");
    let listed = answer(&["list", "."])["templates"].as_array().unwrap().len();
    assert_eq!(listed, 7);
}
