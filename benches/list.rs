//! Time of `rigsmith list` on a folder of many templates.
//!
//! ```text
//! cargo bench --bench list
//! ```
//!
//! Five hundred templates of mixed kinds in five folders: the bundled characters, whose headers say all; the same without their
//! counts of joints, so that the files of their parts have to be read; the bundled parts, whose headers say what they need;
//! and chains written by hand without counts. Runs the command as people do, from its start to its end, and prints the median and
//! the longest of the rounds in milliseconds, after checking that every template was listed with its joints.

use std::{fs, path::Path, process::Command, time::Instant};

use rigsmith::files::{BUNDLED_CHARACTERS, BUNDLED_PARTS};

const TEMPLATES: usize = 500;
const ROUNDS: usize = 15;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::temp_dir().join(format!("rigsmith-list-{}", std::process::id()));
    for number in 0..TEMPLATES {
        let place = folder.join(format!("folder_{}", number % 5));
        fs::create_dir_all(&place)?;
        fs::write(place.join(format!("t{number}.rig.ron")), text(number))?;
    }
    let done = measure(&folder);
    fs::remove_dir_all(&folder)?;
    done
}

/// Text of one of the templates.
fn text(number: usize) -> String {
    let (_, character) = BUNDLED_CHARACTERS[number / 4 % BUNDLED_CHARACTERS.len()];
    match number % 4 {
        0 => character.to_owned(),
        1 => {
            let is_counted = |line: &&str| line.trim_start().starts_with("joint_count:");
            character.lines().filter(|line| !is_counted(line)).map(|line| format!("{line}\n")).collect()
        }
        2 => BUNDLED_PARTS[number / 4 % BUNDLED_PARTS.len()].1.to_owned(),
        _ => {
            let joint = |joint: usize| {
                let parent = joint.checked_sub(1).map_or(String::new(), |above| format!("parent: \"j{above}\", "));
                format!("        (label: \"j{joint}\", {parent}translation: (0, 0.1, 0), tags: [control]),\n")
            };
            let joints: String = (0..3 + number % 40).map(joint).collect();
            format!("(\n    format: 2,\n    name: \"chain {number}\",\n    joints: [\n{joints}    ],\n)\n")
        }
    }
}

fn measure(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let mut times = Vec::with_capacity(ROUNDS);
    for _ in 0..ROUNDS {
        let start = Instant::now();
        let output = Command::new(env!("CARGO_BIN_EXE_rigsmith")).arg("list").arg(folder).arg("--json").output()?;
        times.push(start.elapsed().as_secs_f64() * 1e3);
        let said: serde_json::Value = serde_json::from_slice(&output.stdout)?;
        let list = said["templates"].as_array().map_or(&[][..], Vec::as_slice);
        let counted = list.iter().filter(|one| one["joint_count"].as_u64().is_some_and(|count| count > 0)).count();
        if counted != TEMPLATES {
            return Err(format!("{counted} of {TEMPLATES} templates were listed with their joints").into());
        }
    }
    times.sort_by(f64::total_cmp);
    println!("list of {TEMPLATES} templates: median {:.0} ms, longest {:.0} ms", times[ROUNDS / 2], times[ROUNDS - 1]);
    Ok(())
}
