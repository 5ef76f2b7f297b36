//! Documents: the table of `ARCHITECTURE.md` lists every folder, and the paths, links, examples, benches and tests exist that
//! documents name.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::layout::rust_files;

/// Pieces of a text in backticks, with their lines.
fn code_pieces(text: &str) -> Vec<(usize, &str)> {
    let mut is_code = false;
    let mut pieces = Vec::new();
    for (number, line) in text.lines().enumerate() {
        if line.starts_with("```") {
            is_code = !is_code;
        } else if !is_code {
            pieces.extend(line.split('`').skip(1).step_by(2).map(|piece| (number + 1, piece)));
        }
    }
    pieces
}

/// The lines of ARCHITECTURE.md below a heading, up to the next one.
fn section<'a>(text: &'a str, heading: &str) -> impl Iterator<Item = &'a str> {
    let heading = format!("## {heading}");
    text.lines().skip_while(move |line| *line != heading).skip(1).take_while(|line| !line.starts_with("## "))
}

#[test]
fn the_architecture_names_every_folder() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(root.join("ARCHITECTURE.md")).unwrap();
    let mut named: Vec<PathBuf> = Vec::new();
    for row in section(&text, "Where things are").filter(|line| line.starts_with("| `")) {
        let pieces = code_pieces(row);
        let first = Path::new(pieces[0].1);
        let above = first.parent().unwrap_or(Path::new(""));
        for (_, piece) in pieces.iter().filter(|(_, piece)| piece.ends_with('/')) {
            named.extend([Path::new(""), first, above].iter().map(|from| root.join(from).join(piece)));
        }
    }
    let mut open: Vec<PathBuf> =
        ["src", "tests", "benches", "examples", "assets", "fuzz", "docs", ".ci"].map(|folder| root.join(folder)).into();
    let (mut wrong, mut count) = (Vec::new(), 0);
    while let Some(folder) = open.pop() {
        let entries: Vec<PathBuf> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
        let is_product = |path: &Path| {
            ["target", "corpus", "artifacts", "coverage"]
                .iter()
                .any(|name| path.ends_with(Path::new("fuzz").join(name)))
        };
        open.extend(entries.iter().filter(|path| path.is_dir() && !is_product(path)).cloned());
        if !entries.iter().any(|path| path.is_file()) {
            continue;
        }
        count += 1;
        if !named.iter().any(|known| known.components().eq(folder.components())) {
            wrong.push(folder.strip_prefix(root).unwrap().display().to_string());
        }
    }
    wrong.sort();
    assert!(count > 80, "the folders were not found");
    assert!(wrong.is_empty(), "the table of ARCHITECTURE.md lacks these folders:\n{}", wrong.join("\n"));
}

#[test]
fn the_architecture_names_paths_that_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(root.join("ARCHITECTURE.md")).unwrap();
    let tasks: Vec<&str> = section(&text, "Where to change what").collect();
    let folders: Vec<&str> = section(&text, "Where things are").filter(|line| line.starts_with("| `")).collect();
    let is_path = |piece: &str| {
        let is_file = [".rs", ".md", ".mjs", ".svg", ".ron"].iter().any(|ending| piece.ends_with(ending));
        (piece.contains('/') || is_file && !piece.starts_with('.')) && !piece.contains([' ', '*', '(', '{'])
    };
    let (mut wrong, mut count) = (Vec::new(), 0);
    for (line, piece) in code_pieces(&text) {
        let row = text.lines().nth(line - 1).unwrap_or_default();
        if !is_path(piece) || folders.contains(&row) && !piece.ends_with(".rs") {
            continue;
        }
        count += 1;
        // `NAME` stands for the name of a new file: its folder exists.
        let piece = piece.split("NAME").next().unwrap_or(piece);
        let in_root =
            root.join(piece.rsplit_once('/').filter(|_| piece.ends_with('_')).map_or(piece, |(above, _)| above));
        // Outside of the table of tasks, modules of the library are named by their path in it.
        let in_sources = root.join("src").join(piece);
        let is_module = in_sources.exists() || in_sources.with_extension("rs").exists();
        if !in_root.exists() && (tasks.contains(&row) || !is_module) {
            wrong.push(format!("line {line}: {piece}"));
        }
    }
    assert!(count > 100, "the paths were not found");
    assert!(wrong.is_empty(), "write whole paths, from the root of the repository:\n{}", wrong.join("\n"));
}

/// Documents for people, from the root of the repository.
const DOCUMENTS: [&str; 6] =
    ["README.md", "ARCHITECTURE.md", "benches/README.md", "fuzz/README.md", "docs/gestures.md", "docs/write-a-rig.md"];

/// Paths of the tests, such as `journal::long::undo_and_redo_of_older_steps_survive_a_fold`.
fn test_paths() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it");
    let mut paths = Vec::new();
    for file in rust_files(&folder) {
        let module = file.strip_prefix(&folder).unwrap().with_extension("");
        let module: Vec<_> = module.iter().map(|part| part.to_string_lossy()).collect();
        let text = fs::read_to_string(&file).unwrap();
        let mut is_test = false;
        for line in text.lines().map(str::trim) {
            is_test |= line == "#[test]";
            if let Some(function) = line.strip_prefix("fn ").filter(|_| is_test) {
                let name = function.split('(').next().unwrap_or_default();
                paths.push(format!("{}::{name}", module.join("::")));
                is_test = false;
            }
        }
    }
    paths
}

/// Words behind a mark, up to the first letter that no name has, with their lines.
fn names_behind<'a>(text: &'a str, mark: &'a str) -> impl Iterator<Item = (usize, &'a str)> {
    let is_of_name = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_' || c == ':';
    let names = text.lines().enumerate().flat_map(move |(number, line)| {
        line.match_indices(mark).map(move |(at, _)| {
            let rest = line[at + mark.len()..].trim_start_matches("-- ");
            (number + 1, &rest[..rest.find(|c: char| !is_of_name(c)).unwrap_or(rest.len())])
        })
    });
    names.filter(|(_, name)| !name.is_empty())
}

/// Names in the last column of tables whose header says that they are names of tests, with their lines.
fn tests_of_tables(text: &str) -> Vec<(usize, &str)> {
    let (mut names, mut is_table) = (Vec::new(), false);
    for (number, line) in text.lines().enumerate() {
        is_table = line.starts_with('|') && (is_table || line.contains("--test it NAME"));
        if is_table {
            let last = line.trim_end_matches(" |").rsplit(" | ").next().unwrap_or_default();
            let pieces = last.split('`').skip(1).step_by(2).filter(|piece| !piece.contains(' '));
            names.extend(pieces.map(|name| (number + 1, name)));
        }
    }
    names
}

#[test]
fn documents_name_what_exists() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let tests = test_paths();
    assert!(tests.len() > 1000, "the tests were not found");
    let (mut wrong, mut count) = (Vec::new(), 0);
    for document in DOCUMENTS {
        let text = fs::read_to_string(root.join(document)).unwrap();
        let folder = root.join(document).parent().unwrap().to_owned();
        let mut check = |is_there: bool, line: usize, what: String| {
            count += 1;
            if !is_there {
                wrong.push(format!("{document}:{line}: {what}"));
            }
        };
        for (number, line) in text.lines().enumerate() {
            for (at, _) in line.match_indices("](") {
                let link = line[at + 2..].split([')', '#']).next().unwrap_or_default();
                let is_there = link.contains("://") || folder.join(link).exists();
                check(is_there, number + 1, format!("the link {link}"));
            }
        }
        for (line, name) in names_behind(&text, "--test it ").chain(tests_of_tables(&text)) {
            check(tests.iter().any(|test| test.contains(name)), line, format!("the test {name}"));
        }
        for (kind, folder) in [("--example ", "examples"), ("--bench ", "benches")] {
            for (line, name) in names_behind(&text, kind) {
                let file = root.join(folder).join(name);
                let is_there = file.with_extension("rs").exists() || file.join("main.rs").exists();
                check(is_there, line, format!("`{kind}{name}`"));
            }
        }
    }
    assert!(count > 100, "the documents were not read: {count} names");
    assert!(wrong.is_empty(), "documents name what does not exist:\n{}", wrong.join("\n"));
}
