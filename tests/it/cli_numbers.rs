//! Numbers in the answers of commands: as short as those of files, and the same when they are read.

use std::{fs, path::Path};

use rigsmith::rig::format::json::json_text;
use serde_json::{Value, json};

use crate::cli_outputs::rigsmith;

/// Numbers with a fraction or an exponent in a line of JSON, as they are written; those in strings are none.
fn fractions(line: &str) -> Vec<&str> {
    let (mut found, mut start, mut is_text, mut is_escaped) = (Vec::new(), None, false, false);
    for (at, c) in line.char_indices() {
        let is_number = !is_text && (c.is_ascii_digit() || "+-.eE".contains(c));
        match (start, is_number) {
            (None, true) if c.is_ascii_digit() || c == '-' => start = Some(at),
            (Some(from), false) => {
                found.push(&line[from..at]);
                start = None;
            }
            _ => {}
        }
        match c {
            '"' if !is_escaped => is_text = !is_text,
            _ => {}
        }
        is_escaped = is_text && c == '\\' && !is_escaped;
    }
    found.retain(|number| number.contains(['.', 'e', 'E']));
    found
}

/// The line of JSON that a command prints.
fn line(folder: &Path, args: &[&str]) -> String {
    let (code, said) = rigsmith(folder, &[args, &["--json"]].concat());
    assert_eq!(code, 0, "{args:?}: {said}");
    said.lines().find(|line| line.starts_with('{')).unwrap_or_else(|| panic!("{args:?}: {said}")).to_owned()
}

#[test]
fn numbers_are_the_shortest_that_read_back() {
    let written = [
        (json!(0.1_f32), "0.1"),
        (json!(-0.35_f32), "-0.35"),
        (json!(1.4_f32), "1.4"),
        (json!(0.1_f64), "0.1"),
        (json!(0.123456789012_f64), "0.123456789012"),
        (json!(2.5), "2.5"),
        (json!(3.0_f32), "3.0"),
        (json!(123_456_792.0_f64), "123456792.0"),
        (json!(123_456_789_u64), "123456789"),
        (json!({ "a": [0.7_f32, null, "0.10000000149011612"] }), r#"{"a":[0.7,null,"0.10000000149011612"]}"#),
    ];
    for (value, text) in written {
        assert_eq!(json_text(&value).unwrap(), text);
    }
    for number in [f32::MIN_POSITIVE, 1.0 / 3.0, 16_777.217, 3.4e38, -7.3e-12] {
        let text = json_text(&Value::from(number)).unwrap();
        let shortest = number.to_string();
        assert_eq!(text.parse::<f32>().unwrap(), number, "{text}");
        let digits = |text: &str| text.chars().filter(char::is_ascii_digit).count();
        assert!(digits(&text) <= digits(&shortest).max(11), "{text} for {shortest}");
    }
}

#[test]
fn answers_of_commands_have_the_numbers_of_the_files() {
    let folder = tempfile::tempdir().unwrap();
    let templates = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates");
    fs::copy(templates.join("parts/spring_chain.rig.ron"), folder.path().join("spring.rig.ron")).unwrap();
    let listed = line(folder.path(), &["list", "."]);
    assert!(listed.contains("\"min\":0.1,\"max\":20.0"), "{listed}");
    let biped = templates.join("biped.rig.ron");
    let biped = biped.to_str().unwrap();
    let posed = line(folder.path(), &["pose", biped, "--set", "hand_l.translate=(0,0.3,0.25)"]);
    for answer in [listed, posed] {
        for number in fractions(&answer) {
            let digits = number.split(['e', 'E']).next().unwrap_or_default();
            let digits = digits.trim_start_matches(['-', '0', '.']).chars().filter(char::is_ascii_digit).count();
            assert!(digits <= 9, "{number} has more digits than its precision");
        }
    }
}

#[test]
fn the_search_for_numbers_sees_numbers_alone() {
    assert_eq!(fractions(r#"{"a 0.5 \" 0.7":[-0.25,3,1e-7],"b":"1.5","c":2.0}"#), ["-0.25", "1e-7", "2.0"]);
}
