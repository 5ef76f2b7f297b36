//! The words of `ARCHITECTURE.md`: the table lists every folder, and every path that is named exists.

use std::{
    fs,
    path::{Path, PathBuf},
};

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
    for (number, line) in text.lines().enumerate() {
        for (at, _) in line.match_indices("](") {
            let link = line[at + 2..].split(')').next().unwrap_or_default();
            if !link.contains("://") && !root.join(link).exists() {
                wrong.push(format!("line {}: the link {link}", number + 1));
            }
        }
    }
    assert!(count > 100, "the paths were not found");
    assert!(wrong.is_empty(), "write whole paths, from the root of the repository:\n{}", wrong.join("\n"));
}
