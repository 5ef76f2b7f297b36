//! `rigsmith check` on files with faults of several kinds: each is told once, at its line, and no fault hides another.

use std::{fs, path::Path};

use crate::cli_build::rigsmith;

/// Checks a file in which the comment at the end of a line is what is told of it: nothing else is told, and nothing twice.
#[track_caller]
fn tells_what_it_says(folder: &Path, name: &str, text: &str) {
    fs::write(folder.join(name), text).unwrap();
    let answer = rigsmith(folder, &["check", name, "--json"]);
    assert_eq!(answer.code, 1, "{}{}", answer.out, answer.err);
    let file = answer.json()["files"][0].clone();
    let told: Vec<(usize, String)> = file["problems"]
        .as_array()
        .unwrap()
        .iter()
        .map(|problem| (problem["line"].as_u64().unwrap() as usize, problem["message"].as_str().unwrap().to_owned()))
        .collect();
    let mut count = 0;
    for (number, line) in text.lines().enumerate().map(|(number, line)| (number + 1, line)) {
        for wanted in line.split("// ").skip(1) {
            count += 1;
            let found = told.iter().any(|(line, message)| *line == number && message.contains(wanted.trim()));
            assert!(found, "line {number}: {wanted}: {told:#?}");
        }
    }
    assert_eq!(told.len(), count, "each once: {told:#?}");
    let remarks = file["remarks"].to_string();
    assert!(!remarks.contains("stays as it is"), "told twice: {remarks}");
}

const PART: &str = r#"(
    format: 2,
    name: "ok",
    kind: "part",
    joints: [(label: "g", tags: [control(creation: (name: "grip"), size: 0.5)])],
)"#;

/// Every part instance is looked at, and the place is that of the instance's change.
#[test]
fn parts_hide_no_faults() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("ok.rig.ron"), PART).unwrap();
    let text = r#"(
    format: 2,
    name: "host",
    joints: [
        (
            label: "body",
            tags: [
                control(at: "@joint qq"), // there is no joint "qq"
            ],
        ),
    ],
    parts: [
        (part: "missing.rig.ron", name: "two", parent: "body"), // part "two": there is no file
        (part: "missing2.rig.ron", name: "three", parent: "body"), // part "three": there is no file
        (part: "ok.rig.ron", name: "k", parent: "body", prefix: "x_", options: {"x": 3}), // part "k": the part has no option "x"
        (
            part: "ok.rig.ron",
            name: "k2",
            parent: "body",
            prefix: "y_",
            changes: [
                (tag: "control/nn", params: (size: 1.0)), // part "k2": the part has no tag "control/nn"
                (joint: "mm", translation: (0, 0, 0)), // part "k2": the part has no joint "mm"
                (
                    tag: "control/grip",
                    params: (
                        size: -1.0, // part "k2": control on joint y_g: size: is -1
                        at: "@joint g + @joint bodyy", // there is no joint "bodyy"; did you mean "body"?
                    ),
                ),
            ],
        ),
        (part: "ok.rig.ron", name: "k3", parent: "body", prefix: "z_"),
    ],
)"#;
    tells_what_it_says(folder.path(), "host.rig.ron", text);
}

/// A change whose names are those of the part and of the host, all but one: the one is told, not the others.
#[test]
fn one_wrong_name_in_a_change_is_told_alone() {
    let folder = tempfile::tempdir().unwrap();
    let text = include_str!("../../assets/templates/biped.rig.ron").replace(
        r#"spaces: "@command null/world + @command null/chest + @joint hips + @joint head","#,
        r#"spaces: "@command null/world + @command null/chest + @joint hips + @joint haed", // there is no joint "haed""#,
    );
    assert_eq!(text.matches("haed").count(), 4, "both arms, each with what is told");
    // Other comments of the template are no expectations.
    let text: Vec<String> = text
        .lines()
        .map(|line| if line.contains("haed") { line.to_owned() } else { line.split("//").next().unwrap().to_owned() })
        .collect();
    tells_what_it_says(folder.path(), "biped.rig.ron", &text.join("\n"));
}

/// Parts that cannot be read are left out, and the rest is built.
#[test]
fn faults_of_the_structure_hide_no_others() {
    let folder = tempfile::tempdir().unwrap();
    let text = r#"(
    format: 2,
    name: "x",
    groups: [(name: "g")],
    joints: [
        (
            label: "a",
            group: "zz", // there is no local group "zz"
            translation: (inf, 0, 0), // joint a has a transform that is not finite
            uid: "zz", // "zz" is no uid
            tags: [
                control(at: "@joint qq"), // there is no joint "qq"
                (x: 1), // there is no field `x` // Expected
                half_joint(share: 3.0), // share: is 3
                Feature(kind: 3, name: "f"), // Expected string; write a text in quotation marks
            ],
        ),
        (
            label: "b", parent: "a", translation: (0, 1, 0) locked: false, // Expected comma
            tags: [control(shape: "nosuch", at: "@joint nobody")], // there is no shape "nosuch" // there is no joint "nobody"
        ),
        (label: "c", parent: "b", translation: (0, 1)), // Expected a tuple of size 3
        (label: "d", parent: "d"), // joint d is its own ancestor
        "e", // Expected opening
    ],
)"#;
    tells_what_it_says(folder.path(), "x.rig.ron", text);
}

/// Commands that need another, which fails, are told by what they say themselves.
#[test]
fn a_command_that_fails_hides_no_faults_of_those_behind_it() {
    let folder = tempfile::tempdir().unwrap();
    let text = r#"(
    format: 2,
    name: "x",
    joints: [
        (
            label: "a",
            tags: [
                control(
                    size: -1.0, // size: is -1
                    creation: (name: "q"),
                ),
                attribute(
                    node: "@command control/q role:control",
                    name: "g",
                    min: 3.0, // "g" goes from 3 to 1
                    max: 1.0,
                ),
                attribute(node: "@command control/q role:control", name: "h"),
            ],
        ),
    ],
)"#;
    tells_what_it_says(folder.path(), "x.rig.ron", text);
}

/// Each wrong name of an instance is told, and a wrong joint of one hides nothing of the others.
#[test]
fn wrong_names_of_instances_are_told_all_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let part = r#"(
    format: 2,
    name: "ok",
    kind: "part",
    joints: [(label: "g", tags: [Feature(kind: "generic", name: "fk"), control(feature: "fk")])],
)"#;
    fs::write(folder.path().join("ok.rig.ron"), part).unwrap();
    let text = r#"(
    format: 2,
    name: "host",
    colour: 3, // there is no field `colour` here; remove it
    groups: [(name: "g", colour: (1, 0, 0))], // there is no field `colour` here; did you mean `color`?
    joints: [
        (label: "body"),
        (label: "arm", parnt: "body"), // there is no field `parnt` here; did you mean `parent`?
    ],
    parts: [
        (part: "ok.rig.ron", name: "one", onto: ["bdy"], off: ["ffk"]), // part "one": there is no joint "bdy"; did you mean "body"? // part "one": the part has no feature "ffk"; did you mean "fk"?
        (part: "ok.rig.ron", name: "two", onto: ["amr"]), // part "two": there is no joint "amr"; did you mean "arm"?
        (part: "ok.rig.ron", name: "three", prefix: "c_", off: ["fkk", "gg.x"], options: {"x": 1, "y": 2}), // no feature "fkk" // no feature "gg.x" // no option "x" // no option "y"
        (part: "oks.rig.ron", name: "four", prefix: "d_"), // there is no file `oks.rig.ron`; did you mean "ok.rig.ron"?
        (part: "parts/arm.rig.rn", name: "five"), // there is no file `parts/arm.rig.rn`; did you mean "parts/arm.rig.ron"?
        (part: "ok.rig.ron", name: "six", prefix: "e_", socket: "hat"), // part "six": there is no socket "hat"
    ],
)"#;
    tells_what_it_says(folder.path(), "host.rig.ron", text);
}

/// Nodes that a part lacks because another one could not be put into the rig are no fault of its own.
#[test]
fn what_a_part_at_fault_would_bring_is_not_missed() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("ok.rig.ron"), PART).unwrap();
    let text = r#"(
    format: 2,
    name: "host",
    joints: [(label: "body")],
    parts: [
        (part: "ok.rig.ron", name: "one", parent: "bdy"), // part "one": there is no joint "bdy"
        (part: "ok.rig.ron", name: "two", onto: ["g"]),
        (part: "ok.rig.ron", name: "three", onto: ["gg"]), // part "three": there is no joint "gg"
    ],
)"#;
    tells_what_it_says(folder.path(), "host.rig.ron", text);
}

/// A command that the file of a part gets wrong is told with its place in that file.
#[test]
fn faults_of_a_parts_file_have_their_own_place() {
    let folder = tempfile::tempdir().unwrap();
    let part = r#"(
    format: 2,
    name: "p",
    kind: "part",
    joints: [(label: "k", tags: [
        contrl(shape: "ring"),
        control(size: 1.0, shap: "ring"),
    ])],
)"#;
    fs::write(folder.path().join("p.rig.ron"), part).unwrap();
    let outer = "(\nformat: 2, name: \"q\", kind: \"part\",\nparts: [(part: \"p.rig.ron\", name: \"inner\")])";
    fs::write(folder.path().join("q.rig.ron"), outer).unwrap();
    let text = r#"(
    format: 2,
    name: "host",
    joints: [(label: "body")],
    parts: [
        (part: "p.rig.ron", name: "pp"), // part "pp" (p.rig.ron:6:9): contrl on joint k // part "pp" (p.rig.ron:7:28): control on joint k
        (part: "q.rig.ron", name: "qq", prefix: "x_"), // part "qq" (q.rig.ron:3:10, p.rig.ron:6:9): contrl // part "qq" (q.rig.ron:3:10, p.rig.ron:7:28): control
    ],
)"#;
    tells_what_it_says(folder.path(), "host.rig.ron", text);
}

/// A rig whose numbers add up to no number, and one that is flattened, are told before they are built.
#[test]
fn places_that_are_no_numbers_and_flat_scales_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let text = r#"(
    format: 2,
    name: "far",
    joints: [
        (label: "a", translation: (3e38, 0, 0)),
        (
            label: "b",
            parent: "a",
            translation: (3e38, 0, 0), // joint b is at no finite place
        ),
        (label: "c", parent: "b", translation: (0, 1, 0)),
    ],
)"#;
    tells_what_it_says(folder.path(), "far.rig.ron", text);
    let built = rigsmith(folder.path(), &["build", "far.rig.ron", "-o", "far.glb"]);
    assert!(built.code == 1 && !folder.path().join("far.glb").exists(), "{}", built.err);
    let flat = "(format: 2, name: \"flat\", joints: [(label: \"a\", scale: (0, 1, 1)), (label: \"b\", translation: (1, 0, 0))])";
    fs::write(folder.path().join("flat.rig.ron"), flat).unwrap();
    let answer = rigsmith(folder.path(), &["check", "flat.rig.ron", "--json"]).json();
    let remarks = answer["files"][0]["remarks"].to_string();
    assert!(remarks.contains("1 joint has a scale of nothing") && remarks.contains(": a;"), "{remarks}");
}

/// Mirror partners are pairs: a joint that names itself, and a ring of three, are told, and open all the same.
#[test]
fn mirror_partners_in_rings_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let text = r#"(
    format: 2,
    name: "rings",
    joints: [
        (label: "a", mirror: "a"), // joint a is its own mirror partner; name the joint on its other side
        (label: "b", mirror: "c"), // the mirror partners "b", "c" and "d" make a ring; let two joints name each other
        (label: "c", mirror: "d"),
        (label: "d", mirror: "b"),
        (label: "e", mirror: "f"),
        (label: "f", mirror: "e"),
        (label: "g", mirror: "f"),
        (label: "h", mirror: "c"),
    ],
)"#;
    tells_what_it_says(folder.path(), "rings.rig.ron", text);
    let built = rigsmith(folder.path(), &["build", "rings.rig.ron", "-o", "rings.glb"]);
    assert!(built.code == 0 && folder.path().join("rings.glb").exists(), "{}", built.err);
}

/// A joint without a label is told by its number, where the way from the joint above it is more than a number can hold.
#[test]
fn joints_of_a_text_that_are_too_far_apart_are_told_by_number_and_label() {
    let folder = tempfile::tempdir().unwrap();
    for (label, name) in [("", "joint 1 is"), (" tip", "joint 1 \"tip\" is")] {
        let text = format!("rig 1\njoint 0 -1 3e38 0 0\njoint 1 0 -3e38 0 0{label}\n");
        fs::write(folder.path().join("far.rig"), text).unwrap();
        for args in [["check", "far.rig"], ["info", "far.rig"], ["build", "far.rig"]] {
            let answer = rigsmith(folder.path(), &args);
            let said = answer.out + &answer.err;
            assert_eq!(answer.code, 1, "{args:?}: {said}");
            assert!(said.contains(name) && said.contains("write smaller coordinates"), "{args:?}: {said}");
        }
    }
}

/// Each of many joints with one label is told at its own place.
#[test]
fn joints_with_one_label_are_told_each() {
    const COUNT: usize = 10_000;
    let folder = tempfile::tempdir().unwrap();
    // Two joints on a line, and letters of several bytes before the second.
    let pair = "  (label: \"é\", translation: (0, 0.1, 0)), (label: \"é\")";
    let text = format!("(format: 2, name: \"n\", joints: [\n{}\n])", vec![pair; COUNT / 2].join(",\n"));
    fs::write(folder.path().join("alike.rig.ron"), text).unwrap();
    let answer = rigsmith(folder.path(), &["check", "alike.rig.ron", "--json"]);
    assert_eq!(answer.code, 1, "{}{}", answer.out, answer.err);
    let file = answer.json()["files"][0].clone();
    let problems = file["problems"].as_array().unwrap();
    assert_eq!(problems.len(), COUNT - 1);
    let second = pair.chars().count() - "(label: \"é\")".chars().count();
    for (number, problem) in problems.iter().enumerate().map(|(number, problem)| (number + 1, problem)) {
        let column = if number % 2 == 0 { 4 } else { second + 2 };
        let place = (problem["line"].as_u64().unwrap() as usize, problem["column"].as_u64().unwrap() as usize);
        assert_eq!(place, (2 + number / 2, column), "{problem}");
    }
}

/// The place above the lines of the source is that of the sentence, whatever the letters before it.
#[test]
fn columns_count_characters() {
    let folder = tempfile::tempdir().unwrap();
    let text = "(\n    format: 2,\n    name: \"Käferfüße ☃\" oops: 1,\n)\n";
    fs::write(folder.path().join("x.rig.ron"), text).unwrap();
    let answer = rigsmith(folder.path(), &["build", "x.rig.ron"]);
    assert_eq!(answer.code, 1, "{}", answer.err);
    let (_, rest) = answer.err.split_once("line 3, column ").unwrap_or_else(|| panic!("{}", answer.err));
    let column = rest.split(':').next().unwrap();
    assert!(answer.err.contains(&format!("x.rig.ron:3:{column}]")), "{}", answer.err);
}

/// A missing comma is told, and nothing that only follows from it.
#[test]
fn missing_commas_are_told_alone_and_hide_no_others() {
    let folder = tempfile::tempdir().unwrap();
    let text = r#"(
    format: 2,
    name: "x"
    joints: [ // Expected comma before `joints`
        (label: "a" tags: [control()]), // Expected comma before `tags`
        (
            label: "b",
            parent: "a",
            translation: (0 1, 0), // Expected comma before `1`
            tags: [control() null()], // Expected comma before `null`
        ),
        (
            label: "c",
            parent: "b",
            translation: (0, 1, 0),
            tags: [control(shape: "circle" size: -1.0)], // Expected comma before `size` // size: is -1
        ),
    ]
    groups: [ // Expected comma before `groups`
        (name: "g")
        (name: "h"), // Expected comma before `(`
    ],
)"#;
    tells_what_it_says(folder.path(), "x.rig.ron", text);
    let answer = rigsmith(folder.path(), &["build", "x.rig.ron"]);
    assert!(answer.code == 1 && answer.err.contains("Expected comma before `joints`"), "{}", answer.err);
}

/// A wrong bracket is told alone, at its place, by `check` and by `build`.
#[test]
fn wrong_brackets_are_told_alone() {
    let folder = tempfile::tempdir().unwrap();
    let text = |tags: &str, end: &str| {
        format!(
            "(\n    format: 2,\n    name: \"x\",\n    joints: [\n        (label: \"a\", tags: {tags}\n        (label: \"b\", \
             parent: \"a\", tags: [control(shap: 1)]),\n    ],\n){end}\n"
        )
    };
    for (text, place, words) in [
        (text("[control()),", ""), (5, 38), "`)` stands where `]` closes the last open bracket; write `]` before it"),
        (text("[control(]),", ""), (5, 37), "`]` stands where `)` closes the last open bracket"),
        (text("[control()])),", ""), (5, 40), "`)` stands where `]` closes the last open bracket"),
        (text("[control()]),", ")"), (8, 2), "`)` closes nothing; remove it"),
    ] {
        fs::write(folder.path().join("x.rig.ron"), text).unwrap();
        let answer = rigsmith(folder.path(), &["check", "x.rig.ron", "--json"]);
        let problems = answer.json()["files"][0]["problems"].clone();
        let told = problems.as_array().unwrap();
        assert!(answer.code == 1 && told.len() == 1, "{problems}");
        assert_eq!(
            (told[0]["line"].as_u64(), told[0]["column"].as_u64()),
            (Some(place.0), Some(place.1)),
            "{problems}"
        );
        assert!(told[0]["message"].as_str().unwrap().contains(words), "{problems}");
        let answer = rigsmith(folder.path(), &["build", "x.rig.ron"]);
        let place = format!("x.rig.ron:{}:{}]", place.0, place.1);
        assert!(answer.code == 1 && answer.err.contains(&place), "{}", answer.err);
    }
}

#[test]
fn a_folder_is_told_as_one() {
    let folder = tempfile::tempdir().unwrap();
    let answer = rigsmith(folder.path(), &["check", "."]);
    assert!(
        answer.code == 1 && answer.out.contains("this is a folder; give the files in it"),
        "{}{}",
        answer.out,
        answer.err
    );
    let answer = rigsmith(folder.path(), &["info", "."]);
    assert!(answer.code == 2 && answer.err.contains("`.` is a folder"), "{}{}", answer.out, answer.err);
}
