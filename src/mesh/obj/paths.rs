//! Paths of files that an OBJ or MTL refers to: their meaning, and the check that they are safe to open.

/// The path of a file below the folder of the model, with `/` between its parts, or `None` if it leads elsewhere.
///
/// `\` separates as `/` does, `.` and inner `..` are resolved. Absolute paths, drives, URLs, paths that climb out of
/// the folder, control characters and empty paths give `None`. The caller has to judge symbolic links.
pub fn safe_relative_path(path: &str) -> Option<String> {
    let path = path.trim();
    if path.starts_with(['/', '\\']) || path.contains(|c: char| c == ':' || c.is_control()) {
        return None;
    }
    let mut parts: Vec<&str> = Vec::new();
    for part in path.split(['/', '\\']) {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop()?;
            }
            _ => parts.push(part),
        }
    }
    (!parts.is_empty()).then(|| parts.join("/"))
}

/// Candidate paths for a file named `path` by a file in `folder` (a safe path, or empty), the likeliest first: next to
/// the file that names it, below the model, and, since exporters write the paths of their authors' disks, by its bare
/// name in both.
pub(super) fn candidates(folder: &str, path: &str) -> Vec<String> {
    let bare = path.rsplit(['/', '\\']).next().unwrap_or_default();
    let mut found: Vec<String> = Vec::new();
    for name in [path, bare] {
        let absolute = name.trim().starts_with(['/', '\\']);
        let beside =
            if absolute { None } else { safe_relative_path(format!("{folder}/{name}").trim_start_matches('/')) };
        for place in [beside, safe_relative_path(name)].into_iter().flatten() {
            if !found.contains(&place) {
                found.push(place);
            }
        }
    }
    found
}

/// Folder part of a safe path; empty for none.
pub(super) fn folder_of(path: &str) -> &str {
    path.rsplit_once('/').map_or("", |(folder, _)| folder)
}

/// File names that the text after `mtllib` may stand for: the whole text as one file name with blanks, which is the
/// first entry; or several file names separated by blanks, in which `\ ` stands for a blank.
pub fn library_names(statement: &str) -> Vec<String> {
    let statement = statement.trim().trim_matches('"');
    let mut names = vec![statement.to_owned()];
    let mut name = String::new();
    let mut letters = statement.chars().peekable();
    while let Some(letter) = letters.next() {
        match letter {
            '\\' if letters.peek().is_some_and(|next| next.is_whitespace()) => name.extend(letters.next()),
            _ if letter.is_whitespace() => names.extend((!name.is_empty()).then(|| std::mem::take(&mut name))),
            _ => name.push(letter),
        }
    }
    if !name.is_empty() && name != names[0] {
        names.push(name);
    }
    names
}
