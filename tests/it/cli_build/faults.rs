//! Faults that `rigsmith check` tells of a template, with their places.

use super::*;

/// A template with a fault of each kind; the comment at the end of a line is what is told of it.
const FAULTY: &str = r#"(
    format: 1,
    uid: "00000000000000ff",
    name: "faulty",
    groups: [(uid: "0000000000000010", name: "arm", color: (0.9, 0.6, 0.0))],
    joints: [
        (
            uid: "0000000000000001",
            label: "root",
            wobbly: true, // no field `wobbly`
            translation: (0.0, 1.0, 0.0),
            tags: [
                Feature(uid: "0000000000000030",
                    kind: "lim", name: "Arm"), // not registered
                Command(uid: "0000000000000020", module: "control",
                    params: (at: "@joint root + @joint arm", sieze: 2.0)), // sieze
                Command(uid: "0000000000000021", module: "contrl", // no module
                    params: ()),
                Command(uid: "0000000000000022", module: "null",
                    params: (orient: false,
                        at: "@joints group:#0000000000000077")), // no local group
            ],
        ),
        (
            uid: "0000000000000002",
            parent: "0000000000000001",
            label: "arm",
            group: "0000000000000099", // not in the file
            translation: (0.5, nil, 0.0), // float
            rotation: (0.0, 0.0, 0.0, 3.0), // not of length 1
            tags: [
                Command(uid: "0000000000000023", module: "limit", params: ()), // all open
                Command(uid: "0000000000000024", module: "ik_handle",
                    feature: "0000000000000035", // not in the file
                    params: (end: "@joint arm", goal: "@joint arm")), // start and end are the same joint
            ],
        ),
    ],
)"#;

#[test]
fn check_tells_all_faults_at_once_with_their_lines() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("faulty.rig.ron"), FAULTY).unwrap();
    let answer = rigsmith(folder.path(), &["check", "faulty.rig.ron", "--json"]);
    assert_eq!(answer.code, 1, "{}", answer.err);
    let problems = answer.json()["files"][0]["problems"].as_array().unwrap().clone();
    let told: Vec<(usize, String)> = problems
        .iter()
        .map(|problem| (problem["line"].as_u64().unwrap() as usize, problem["message"].as_str().unwrap().to_owned()))
        .collect();
    for (number, line) in FAULTY.lines().enumerate().map(|(number, line)| (number + 1, line)) {
        let Some((_, wanted)) = line.split_once("// ") else { continue };
        let found = told.iter().any(|(line, message)| *line == number && message.contains(wanted));
        assert!(found, "line {number}: {wanted}: {told:#?}");
    }
    assert_eq!(told.len(), FAULTY.lines().filter(|line| line.contains("// ")).count(), "each once: {told:#?}");
    // The column is that in the file, where no uids stand beside the names.
    let sieze = problems.iter().find(|problem| problem["message"].to_string().contains("sieze")).unwrap();
    let line = FAULTY.lines().nth(sieze["line"].as_u64().unwrap() as usize - 1).unwrap();
    let column = sieze["column"].as_u64().unwrap() as usize - 1;
    let place = line.find("sieze").unwrap();
    assert!((place..place + "sieze: 2.0".len()).contains(&column), "column {column} in {line}");
}

/// Commands with several faults each; the comment at the end of a line is what is told of it.
const SEVERAL: &str = r#"(
    format: 2,
    name: "several",
    joints: [
        (
            label: "root",
            translation: (0, 1, 0),
            tags: [
                half_joint(
                    at: "@joint rot", // there is no joint "rot"; did you mean "root"?
                    share: 3.0, // share: is 3; write a number from 0 to 1
                    push: 7.0, // push: is 7; write a number from -1 to 1
                    creation: (lable: "half"), // lable
                ),
                ik_handle(
                    start: "@joint rooot", // there is no joint "rooot"; did you mean "root"?
                    end: "@joint arrm", // there is no joint "arrm"; did you mean "arm"?
                    goal: "@this",
                    sfot: 1.0, // sfot
                ),
                contrl(), // contrl on joint root: there is no module "contrl"; did you mean "control"?
                Feature(kind: "lim", name: "Arm"), // the feature "Arm" on joint root is of the kind "lim"
            ],
        ),
        (
            label: "arm",
            parent: "root",
            translation: (0.5, 0, 0),
            tags: [
                half_joint(
                    share: -1.0, // share: is -1; write a number from 0 to 1
                    push: 7.0, // push: is 7; write a number from -1 to 1
                ),
            ],
        ),
    ],
)"#;

#[test]
fn check_tells_all_faults_of_one_commands_parameters() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("several.rig.ron"), SEVERAL).unwrap();
    let answer = rigsmith(folder.path(), &["check", "several.rig.ron", "--json"]);
    assert_eq!(answer.code, 1, "{}", answer.err);
    let json = answer.json();
    let file = &json["files"][0];
    let problems = file["problems"].as_array().unwrap();
    let wanted: Vec<(usize, &str)> = SEVERAL
        .lines()
        .enumerate()
        .filter_map(|(number, line)| Some((number + 1, line.split_once("// ")?.1)))
        .collect();
    for (line, words) in &wanted {
        let is_told =
            |problem: &&Value| problem["line"] == *line && problem["message"].as_str().unwrap().contains(words);
        assert_eq!(problems.iter().filter(is_told).count(), 1, "line {line}: {words}: {file:#}");
    }
    assert_eq!(problems.len(), wanted.len(), "each once: {file:#}");
    assert!(file["error"].as_str().unwrap().contains("4 commands cannot be built"), "{file:#}");
}

#[test]
fn check_tells_every_problem_of_a_template_with_its_place() {
    let folder = with_arm();
    let text = ARM
        .replace("shape: \"circle\"", "shape: \"cirle\"")
        .replace("min: 0.0", "mini: 0.0")
        .replace("\"insert_joints\"", "\"insert_joins\"");
    fs::write(folder.path().join("bad.rig.ron"), &text).unwrap();
    let answer = rigsmith(folder.path(), &["check", "arm.rig.ron", "bad.rig.ron"]);
    assert_eq!(answer.code, 1, "{}", answer.out);
    assert!(answer.out.starts_with("arm.rig.ron: ok\n"), "{}", answer.out);
    let place = |words: &str| {
        let at = text.find(words).unwrap();
        let line = text[..at].matches('\n').count() + 1;
        (line, text[..at].rsplit('\n').next().unwrap().chars().count() + 1)
    };
    // Where the uid of the tag stands, or on the parameter that is wrong.
    let column_of = |told: &str| told.split(':').nth(2).unwrap().parse::<usize>().unwrap();
    let wanted = [
        (place("shape: \"cirle\""), "cirle"),
        (place("mini"), "mini"),
        (place("\"0000000000000023\""), "insert_joins"),
    ];
    for ((line, column), words) in wanted {
        let told = answer.out.lines().find(|told| told.starts_with(&format!("bad.rig.ron:{line}:")));
        let told = told.unwrap_or_else(|| panic!("line {line} for {words}: {}", answer.out));
        assert!(told.contains(words), "{told}");
        assert!((column..column + 6).contains(&column_of(told)), "column {column}: {told}");
    }
    let json = rigsmith(folder.path(), &["--json", "check", "bad.rig.ron"]).json();
    let problems = json["files"][0]["problems"].as_array().unwrap();
    // What drives the hand is a control that cannot be made: that is told once.
    assert_eq!(problems.len(), 3, "{json}");
    for (problem, ((line, column), words)) in problems.iter().zip(wanted) {
        assert_eq!(problem["line"], line, "{problem}");
        assert!((column..column + 6).contains(&(problem["column"].as_u64().unwrap() as usize)), "{problem}");
        assert!(problem["message"].as_str().unwrap().contains(words), "{problem}");
    }
    // What builds and still cannot move is told, too: an arm that follows its control and is part of a chain that
    // reaches for another one.
    let circle = ARM.replace(
        r#"Command(uid: "0000000000000024""#,
        r#"Command(uid: "0000000000000025", module: "ik_handle", params: (start: "@joint root#0000000000000001",
                    end: "@this", goal: "@command control#0000000000000020 role:control", prefer: (0.0, 0.0, 1.0))),
                Command(uid: "0000000000000024""#,
    );
    fs::write(folder.path().join("circle.rig.ron"), &circle).unwrap();
    let answer = rigsmith(folder.path(), &["check", "circle.rig.ron"]);
    assert_eq!(answer.code, 1, "{}", answer.out);
    assert!(answer.out.lines().any(|line| line.starts_with("circle.rig.ron:")), "{}", answer.out);
    // The bundled templates have none.
    let templates = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates");
    let mut open = vec![templates];
    while let Some(path) = open.pop() {
        if path.is_dir() {
            open.extend(fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path()));
        } else if path.to_str().unwrap().ends_with(".rig.ron") {
            let answer = rigsmith(folder.path(), &["check", path.to_str().unwrap()]);
            assert_eq!(answer.code, 0, "{}", answer.out);
        }
    }
}
