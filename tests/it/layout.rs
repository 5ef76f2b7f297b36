//! The directions between the parts of the sources, and rules that hold for every file.

use std::{
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
fn code(text: &str) -> String {
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
fn shipped(text: &str) -> String {
    let code = code(text);
    let Some(start) = code.find("#[cfg(test)]") else { return code };
    code[..start].to_owned()
}

/// Where `code` names the path: in one piece or within braces of a `use`.
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
    let rules: [(&str, &[&str]); 17] = [
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
            let code = shipped(&text);
            for name in forbidden {
                wrong.extend(
                    mentions(&code, name).into_iter().map(|line| format!("{}:{line} uses {name}", path.display())),
                );
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
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
        for (number, line) in shipped(&text).lines().enumerate() {
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
    let code = shipped(text);
    assert_eq!(mentions(&code, "std::fs"), [2]);
    assert_eq!(mentions(&code, "App"), [0; 0]);
    assert_eq!(mentions(&code, "crate::plugins"), [3]);
    assert_eq!(mentions(&code, "crate::rig"), [3]);
    assert_eq!(mentions(&code, "crate::cli"), [0; 0]);
}
