//! Names of modules, files and types: nouns of the field, no pronouns and no participles that stand alone.

use std::{fs, path::Path};

use crate::layout::{code, rust_files};

/// Words of which no module, file or type has one in its name: pronouns, and participles that stand for a noun.
const NO_NAMES: &str = "what who whose which that this it its they them these those he him his she her something \
    everything anything nobody somebody told amiss known seen gone";

/// Nouns that end like a participle.
const NOUNS_IN_ED: [&str; 5] = ["biped", "quadruped", "embed", "seed", "bone_reseed"];

/// True if a name is a pronoun, has one among its words, or is a participle.
fn is_pale_name(name: &str) -> bool {
    let mut words = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() {
            words.push('_');
        }
        words.extend(letter.to_lowercase());
    }
    let is_participle = !name.contains(char::is_uppercase) && name.ends_with("ed") && !NOUNS_IN_ED.contains(&name);
    let has_pronoun = words.split('_').any(|word| NO_NAMES.split_whitespace().any(|other| other == word));
    is_participle || has_pronoun
}

/// Modules and types that a text declares.
fn declared_names(text: &str) -> Vec<&str> {
    let declared = |line| {
        let mut words = str::split_whitespace(line).skip_while(|word| word.starts_with("pub"));
        // A path may stand between the brackets of a visibility.
        let first = words.by_ref().find(|word| !word.ends_with(')'))?;
        let name = matches!(first, "struct" | "enum" | "trait" | "type" | "mod").then(|| words.next())??;
        name.split(|letter: char| !letter.is_alphanumeric() && letter != '_').next()
    };
    text.lines().filter_map(declared).collect()
}

#[test]
fn names_are_nouns_of_the_field() {
    let text = "struct Told;\npub(in crate::rig) enum PasteWhat {\npub(super) type A<'a> = B;\n    mod known {";
    assert_eq!(declared_names(text), ["Told", "PasteWhat", "A", "known"]);
    for (name, is_pale) in [
        ("told", true),
        ("Told", true),
        ("KnownNode", true),
        ("PasteWhat", true),
        ("keep_moved", true),
        ("placed_bones", false),
        ("biped", false),
        ("MarkerReached", false),
        ("Item", false),
    ] {
        assert_eq!(is_pale_name(name), is_pale, "{name}");
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (mut wrong, mut count) = (Vec::new(), 0);
    for folder in ["src", "benches", "examples", "tests", "fuzz/fuzz_targets", "fuzz/src"] {
        for path in rust_files(&root.join(folder)) {
            let code = code(&fs::read_to_string(&path).unwrap());
            let mut names = declared_names(&code);
            let stem = path.file_stem().unwrap().to_string_lossy();
            names.push(&stem);
            count += names.len();
            names.retain(|name| is_pale_name(name));
            wrong.extend(
                names.into_iter().map(|name| format!("{}: {name}", path.strip_prefix(root).unwrap().display())),
            );
        }
    }
    assert!(count > 3000, "the names were not found: {count}");
    assert!(wrong.is_empty(), "name these by nouns:\n{}", wrong.join("\n"));
}
