//! The directions between the parts of the sources, and rules that hold for every file.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

fn sources(folder: &str) -> Vec<(PathBuf, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut open = vec![root.join(folder), root.join(format!("{folder}.rs"))];
    let mut files = Vec::new();
    while let Some(path) = open.pop() {
        match fs::read_dir(&path) {
            Ok(entries) => open.extend(entries.map(|entry| entry.unwrap().path())),
            Err(_) if path.extension().is_some_and(|ending| ending == "rs") => {
                // Folders of later parts are not there yet.
                let Ok(text) = fs::read_to_string(&path) else { continue };
                files.push((path.strip_prefix(&root).unwrap().to_owned(), text));
            }
            Err(_) => {}
        }
    }
    files.sort();
    files
}

/// Code with comments and the insides of strings and characters blanked, so that words in them do not count.
pub fn code(text: &str) -> String {
    let chars: Vec<char> = text.chars().collect();
    let mut out = String::with_capacity(text.len());
    let mut at = 0;
    let skip = |out: &mut String, from: usize, to: usize| {
        out.extend(chars[from..to.min(chars.len())].iter().map(|c| if *c == '\n' { '\n' } else { ' ' }));
        to.min(chars.len())
    };
    let find = |from: usize, what: &str| {
        let what: Vec<char> = what.chars().collect();
        (from..chars.len()).find(|&i| chars[i..].starts_with(&what)).map_or(chars.len(), |i| i + what.len())
    };
    while at < chars.len() {
        let rest = &chars[at..];
        let word_before = at > 0 && (chars[at - 1].is_alphanumeric() || chars[at - 1] == '_');
        at = if rest.starts_with(&['/', '/']) {
            let end = find(at, "\n");
            skip(&mut out, at, end)
        } else if rest.starts_with(&['/', '*']) {
            let end = find(at + 2, "*/");
            skip(&mut out, at, end)
        } else if rest[0] == 'r'
            && !word_before
            && matches!(rest.get(1), Some('"' | '#'))
            && raw_quote(&rest[1..]).is_some()
        {
            let hashes = raw_quote(&rest[1..]).unwrap_or_default();
            let end = find(at + hashes + 2, &format!("\"{}", "#".repeat(hashes)));
            skip(&mut out, at, end)
        } else if rest[0] == '"' {
            let mut end = at + 1;
            while end < chars.len() && chars[end] != '"' {
                end += if chars[end] == '\\' { 2 } else { 1 };
            }
            skip(&mut out, at, end + 1)
        } else if rest[0] == '\'' && rest.get(1) == Some(&'\\') {
            let end = find(at + 3, "'");
            skip(&mut out, at, end)
        } else if rest[0] == '\'' && rest.get(2) == Some(&'\'') {
            skip(&mut out, at, at + 3)
        } else {
            out.push(rest[0]);
            at + 1
        };
    }
    out
}

/// The number of hashes of a raw string whose marks these are.
fn raw_quote(marks: &[char]) -> Option<usize> {
    let hashes = marks.iter().take_while(|mark| **mark == '#').count();
    (marks.get(hashes) == Some(&'"')).then_some(hashes)
}

/// Code without unit tests.
fn code_without_tests(text: &str) -> String {
    let code = code(text);
    let Some(start) = code.find("#[cfg(test)]") else { return code };
    code[..start].to_owned()
}

/// Lines in which `code` names the path: in one piece or within braces of a `use`.
fn mentions(code: &str, path: &str) -> Vec<usize> {
    let mut lines = Vec::new();
    for (number, line) in code.lines().enumerate() {
        let direct = line.match_indices(path).any(|(at, _)| {
            let is_part = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || c == '_');
            !is_part(line[..at].chars().next_back()) && !is_part(line[at + path.len()..].chars().next())
        });
        if direct {
            lines.push(number + 1);
        }
    }
    for (number, item) in uses(code) {
        if item == path || item.starts_with(&format!("{path}::")) {
            lines.push(number);
        }
    }
    lines.sort_unstable();
    lines.dedup();
    lines
}

/// All paths that `use` items name, written out, with their lines.
fn uses(code: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    for (start, _) in code.match_indices("use ") {
        let fresh =
            code[..start].trim_end_matches(' ').chars().next_back().is_none_or(|c| matches!(c, '\n' | ')' | '{' | 'b'));
        let Some(end) = code[start..].find(';').filter(|_| fresh) else { continue };
        let line = code[..start].matches('\n').count() + 1;
        let mut prefixes: Vec<String> = Vec::new();
        let mut path = String::new();
        for c in code[start + 4..start + end].chars().chain([',']) {
            match c {
                '{' => prefixes.push(std::mem::take(&mut path)),
                ',' | '}' => {
                    if !path.is_empty() {
                        found.push((line, format!("{}{path}", prefixes.concat())));
                    }
                    path.clear();
                    if c == '}' {
                        prefixes.pop();
                    }
                }
                c if c.is_whitespace() => {}
                c => path.push(c),
            }
        }
    }
    found
}

#[test]
fn parts_depend_in_one_direction() {
    let pure = [
        "std::fs",
        "std::path",
        "std::env",
        "bevy::app",
        "bevy::ecs",
        "bevy::render",
        "bevy::window",
        "bevy::tasks",
        "crate::plugins",
        "crate::editor",
        "crate::cli",
        "crate::files",
        "crate::headless",
        "crate::test_app",
        "App",
        "Commands",
        "ResMut",
    ];
    let rules: [(&str, &[&str]); 18] = [
        ("rig", &pure),
        ("mesh", &pure),
        ("algo", &pure),
        ("solve", &pure),
        ("processor", &["std::fs", "crate::plugins", "crate::editor", "crate::cli", "crate::files", "App", "Commands"]),
        ("modules", &pure),
        ("rig", &["crate::algo", "crate::processor", "crate::modules", "crate::solve"]),
        ("mesh", &["crate::algo", "crate::rig", "crate::processor", "crate::modules", "crate::solve"]),
        ("algo", &["crate::rig", "crate::processor", "crate::modules", "crate::solve"]),
        ("solve", &["crate::algo", "crate::processor", "crate::modules"]),
        ("processor", &["crate::algo", "crate::modules"]),
        ("modules", &["crate::algo"]),
        ("plugins", &["std::fs", "std::path", "crate::cli", "crate::editor", "crate::files"]),
        ("files", &["crate::cli", "crate::editor", "bevy::app", "App"]),
        ("instance", &["std::fs", "crate::cli", "crate::editor", "crate::headless"]),
        ("remote", &["std::fs", "crate::cli", "crate::editor", "crate::headless"]),
        ("cli", &["crate::editor"]),
        ("headless", &["crate::cli", "crate::editor", "crate::files"]),
    ];
    let known: Vec<&str> = rules.iter().map(|(folder, _)| *folder).chain(["editor"]).collect();
    for entry in fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("src")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        assert!(!path.is_dir() || known.contains(&name.as_str()), "the folder src/{name} has no rule");
    }
    let mut wrong = Vec::new();
    for (folder, forbidden) in rules.into_iter().chain([("editor", &["crate::cli"] as &[&str])]) {
        let files = sources(folder);
        assert!(!files.is_empty(), "there is nothing in {folder}");
        for (path, text) in files {
            let code = code_without_tests(&text);
            for name in forbidden {
                wrong.extend(
                    mentions(&code, name).into_iter().map(|line| format!("{}:{line} uses {name}", path.display())),
                );
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Parts of the crate that the column "uses" of the architecture's table gives to each part.
fn uses_of_parts() -> BTreeMap<String, BTreeSet<String>> {
    let text = include_str!("../../ARCHITECTURE.md");
    let rows = text.lines().filter_map(|line| line.strip_prefix("| ")).filter(|row| row.starts_with("`src/"));
    let quoted = |cell: &str| -> Vec<String> { cell.split('`').skip(1).step_by(2).map(str::to_owned).collect() };
    let mut allowed: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for row in rows {
        let cells: Vec<&str> = row.trim_end_matches(" |").split(" | ").collect();
        let (first, last) = (cells[0], cells.get(2).copied().unwrap_or_default());
        for path in quoted(first).iter().filter_map(|path| path.strip_prefix("src/")) {
            let part = path.split('/').next().unwrap_or_default().trim_end_matches(".rs");
            allowed.entry(part.to_owned()).or_default().extend(quoted(last));
        }
    }
    allowed
}

#[test]
fn parts_use_what_the_architecture_says() {
    let allowed = uses_of_parts();
    let parts: Vec<String> = allowed.keys().filter(|part| !part.is_empty() && *part != "main").cloned().collect();
    assert!(parts.len() > 12, "the table was not read: {parts:?}");
    for entry in fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("src")).unwrap() {
        let name = entry.unwrap().path().file_stem().unwrap().to_string_lossy().into_owned();
        assert!(parts.contains(&name) || name == "lib" || name == "main", "the table lacks src/{name}");
    }
    let mut wrong = Vec::new();
    for part in &parts {
        for (path, text) in sources(part) {
            let code = code_without_tests(&text);
            for other in parts.iter().filter(|other| *other != part && !allowed[part].contains(*other)) {
                let lines = mentions(&code, &format!("crate::{other}"));
                wrong.extend(lines.into_iter().map(|line| format!("{}:{line} uses {other}", path.display())));
            }
        }
    }
    assert!(wrong.is_empty(), "say it in the table, or turn the dependency round:\n{}", wrong.join("\n"));
}

#[test]
fn files_stay_readable_and_never_panic_on_purpose() {
    let mut wrong = Vec::new();
    let files = sources("");
    assert!(files.len() > 50, "the sources were not found");
    for (path, text) in files {
        let lines = text.lines().count();
        if lines > 500 {
            wrong.push(format!("{} has {lines} lines", path.display()));
        }
        for (number, line) in code_without_tests(&text).lines().enumerate() {
            for word in [".unwrap()", ".expect(", "panic!(", "todo!(", "unimplemented!(", "unreachable!("] {
                if line.contains(word) {
                    wrong.push(format!("{}:{} has {word}", path.display(), number + 1));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_check_sees_code_and_only_code() {
    let text = "// std::fs\n/* App */ let a = \"std::fs\"; let b = r#\"App \" \"#; let c = '\"'; std::fs::read();\nuse crate::{\n    plugins::{a, b},\n    rig,\n};\n#[cfg(test)]\nmod tests { App }";
    let code = code_without_tests(text);
    assert_eq!(mentions(&code, "std::fs"), [2]);
    assert_eq!(mentions(&code, "App"), [0; 0]);
    assert_eq!(mentions(&code, "crate::plugins"), [3]);
    assert_eq!(mentions(&code, "crate::rig"), [3]);
    assert_eq!(mentions(&code, "crate::cli"), [0; 0]);
}

/// An error is a type of its own, not a text.
#[test]
fn errors_are_types() {
    let mut wrong = Vec::new();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let programs = ["benches", "examples"].into_iter().flat_map(|folder| rust_files(&root.join(folder)));
    let programs = programs.map(|path| {
        let text = fs::read_to_string(&path).unwrap();
        (path, text)
    });
    for (path, text) in sources("").into_iter().chain(programs) {
        // Programs may pass on any error, if it is one.
        let is_program = path.starts_with(root);
        let code = code(&text).replace('\n', " ");
        for (at, _) in code.match_indices("Result<") {
            let inside = &code[at + "Result<".len()..];
            let mut depth = 1;
            let end = inside.char_indices().find(|(place, c)| {
                // An arrow closes nothing.
                let is_arrow = *c == '>' && inside[..*place].ends_with('-');
                depth += match c {
                    '<' | '(' | '[' => 1,
                    '>' | ')' | ']' if !is_arrow => -1,
                    _ => 0,
                };
                depth == 0
            });
            let Some((end, _)) = end else { continue };
            let error = last_argument(&inside[..end]);
            let is_any = error == Some("Box<dyn Error>") && !is_program;
            if is_any || matches!(error, Some("String" | "&'static str" | "&str")) {
                wrong.push(format!("{}: Result<{}>", path.display(), &inside[..end]));
            }
        }
    }
    assert!(wrong.is_empty(), "make enums of these errors:\n{}", wrong.join("\n"));
}

/// The last of several generic arguments; `None` for a single one.
fn last_argument(arguments: &str) -> Option<&str> {
    let mut depth = 0;
    let mut comma = None;
    for (at, c) in arguments.char_indices() {
        match c {
            '<' | '(' | '[' => depth += 1,
            '>' | ')' | ']' if !arguments[..at].ends_with('-') => depth -= 1,
            ',' if depth == 0 && !arguments[at + 1..].trim().is_empty() => comma = Some(at),
            _ => {}
        }
    }
    Some(arguments[comma? + 1..].trim().trim_end_matches(',').trim())
}

/// The first words of every block of documentation, with their lines.
fn documentation(text: &str) -> Vec<(usize, &str)> {
    let mut blocks = Vec::new();
    let mut before = "";
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        let mark = ["///", "//!"].into_iter().find(|mark| line.starts_with(mark)).unwrap_or_default();
        if !mark.is_empty() && mark != before {
            blocks.push((number + 1, line[mark.len()..].trim()));
        }
        before = mark;
    }
    blocks
}

/// Files of Rust in a folder and below it, sorted.
pub fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut open = vec![folder.to_owned()];
    let mut files = Vec::new();
    while let Some(path) = open.pop() {
        if path.is_dir() {
            open.extend(fs::read_dir(&path).unwrap().map(|entry| entry.unwrap().path()));
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            files.push(path);
        }
    }
    files.sort();
    files
}

/// First words that name no subject: pronouns, prepositions, conjunctions and adverbs.
const NO_SUBJECTS: &str = "What How Where Which Whether Those Who Whose Why That Its Their It They This These \
    Something Everything Anything Somebody Nobody Both Neither Some Same There Always Never Not Only Also \
    As For By Of In Or or And But So Like From With Without At On \
    About Above Across Against Along Beside Between Over Towards";

/// First words that name no subject of an item of the tests either.
const QUESTIONS: &str = "What How Which Whether It That Those Some";

/// Documentation begins with a noun of the field: of items in the sources, the benches and the examples, and of modules in
/// the tests, whose items begin with no question.
#[test]
fn documentation_names_its_subject() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut wrong = Vec::new();
    let mut count = 0;
    for folder in ["src", "benches", "examples", "tests"] {
        for path in rust_files(&root.join(folder)) {
            let text = fs::read_to_string(&path).unwrap();
            let of_module = |line: usize| text.lines().nth(line - 1).is_some_and(|line| line.starts_with("//!"));
            for (line, words) in documentation(&text) {
                let is_item_of_tests = folder == "tests" && !of_module(line);
                let no_subjects = if is_item_of_tests { QUESTIONS } else { NO_SUBJECTS };
                count += usize::from(!is_item_of_tests);
                let first = words.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default();
                let is_pale = !is_item_of_tests && words.starts_with("The same");
                if is_pale || no_subjects.split_whitespace().any(|word| word == first) {
                    wrong.push(format!("{}:{line}: {words}", path.strip_prefix(root).unwrap().display()));
                }
            }
        }
    }
    assert!(count > 5000, "the documentation was not found: {count} blocks");
    assert!(wrong.is_empty(), "begin with a noun of the field:\n{}", wrong.join("\n"));
}

/// Nouns that texts of the window count.
const COUNTED: [&str; 21] = [
    "joints",
    "commands",
    "keys",
    "points",
    "nodes",
    "tracks",
    "frames",
    "changes",
    "conflicts",
    "edits",
    "clips",
    "tags",
    "bones",
    "faces",
    "triangles",
    "motions",
    "layers",
    "ghosts",
    "places",
    "units",
    "influences",
];

/// Places of a line at which a number of any size stands before a noun in the plural.
fn plurals(line: &str) -> Vec<&'static str> {
    let noun = |(at, _): (usize, &str)| {
        let rest = &line[at + 2..];
        let word = rest.split(|letter: char| !letter.is_alphabetic()).next().unwrap_or_default();
        let is_verb = rest[word.len()..].starts_with(" the ");
        COUNTED.into_iter().find(|noun| *noun == word && !is_verb)
    };
    line.match_indices("} ").filter_map(noun).collect()
}

#[test]
fn numbers_of_the_window_have_words_that_fit() {
    assert_eq!(plurals("format!(\"{count} joints, {} keys of {a}\")"), ["joints", "keys"]);
    assert_eq!(plurals("format!(\"{key} keys the selected ones, {} joint\")"), [""; 0]);
    let mut wrong = Vec::new();
    for (path, text) in sources("editor") {
        for (number, line) in text.lines().enumerate().filter(|(_, line)| !line.trim_start().starts_with("//")) {
            let found = plurals(line);
            if !found.is_empty() {
                wrong.push(format!("{}:{}: {found:?}, where `counted` belongs", path.display(), number + 1));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
