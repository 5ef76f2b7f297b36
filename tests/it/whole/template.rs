//! Template: read, checked, formatted, built forward and back, written as template, skeleton and glTF, and read again.

use std::sync::Arc;

use rigsmith::{
    files::{FileKind, PartFiles, StoreError, load_model, load_rig_text, load_template, store_model, store_rig},
    mesh::{
        gltf::GltfWriteSettings,
        model::{Model, Trs},
    },
    processor::{Builder, review},
    rig::{
        BuiltRig, Rig, RigEdit, TagData, TagKind,
        character::{Character, character},
        template::{UidStyle, format_template, read_header, read_template, survey_template, write_template},
    },
    solve::program::{CompileOptions, RigProgram, RigState},
};

use super::{
    build, check_limits, limited, lines,
    memory_disk::{MemoryDisk, at},
    promises,
    skin::{cube, held_by_first},
};
use crate::generate::{
    Choices,
    template::{MadeTemplate, template},
};

/// Carries a template through all of it.
pub fn check(bytes: &[u8]) {
    let mut choices = Choices::new(bytes);
    let made = template(&mut choices, &limited(), true);
    let read = PartFiles::given(&made.files).complete(MadeTemplate::path(), made.text.as_bytes());
    let survey = survey_template(made.text.as_bytes());
    let template = match read {
        Ok(template) => template,
        Err(error) => {
            promises::error(&error);
            assert!((1..=lines(&made.text)).contains(&error.line), "{error}\n{}", made.text);
            if let Ok((survey, faults)) = survey {
                let (_, of_parts) = PartFiles::given(&made.files).survey(MadeTemplate::path(), &made.text, survey);
                assert!(!faults.is_empty() || !of_parts.is_empty(), "refused, but no fault is told: {error}");
            }
            return;
        }
    };
    assert!(survey.is_ok_and(|(_, faults)| faults.is_empty()), "read, but faults are told:\n{}", made.text);
    let header = read_header(made.text.as_bytes()).expect("the whole reads, so does its header");
    assert_eq!(header.name, template.rig.about().name);
    let rig = template.rig;
    written_again(&rig, template.instances.is_empty());
    if template.notes.is_empty() {
        formatted_again(&made, &rig);
    }
    stepped(&rig);
    for problem in review(&rig, &limited()) {
        promises::error(&problem);
    }
    let Some(built) = build(&rig) else {
        saved(&rig, None);
        return;
    };
    run(&built, !choices.was_odd());
    saved(&rig, Some(&built));
}

/// The same rig comes back from its text, and the same text from that rig.
pub fn written_again(rig: &Rig, is_alone: bool) {
    let text = write_template(rig);
    let again = read_template(text.as_bytes()).unwrap_or_else(|error| panic!("{error}\n{text}"));
    if is_alone {
        assert_eq!(&again.rig, rig, "{text}");
    }
    // Scales near the limit of numbers leave it in products: as words, since what is no number equals nothing.
    assert_eq!(format!("{:?}", again.rig.rest_globals()), format!("{:?}", rig.rest_globals()));
    assert_eq!(write_template(&again.rig), text);
}

/// A text in its layout says the same, and is in its layout then.
fn formatted_again(made: &MadeTemplate, rig: &Rig) {
    for style in [UidStyle::Kept, UidStyle::Written, UidStyle::Derived] {
        let Ok(formatted) = format_template(&made.text, style) else { continue };
        assert_eq!(format_template(&formatted, style).as_ref(), Ok(&formatted), "{style:?}");
        let read = PartFiles::given(&made.files).complete(MadeTemplate::path(), formatted.as_bytes());
        let read = read.unwrap_or_else(|error| panic!("{style:?}: {error}\n{formatted}"));
        assert_eq!(on_one_line(&read.rig), on_one_line(rig), "{style:?}:\n{}\n{formatted}", made.text);
    }
}

/// The rig with parameters without the blanks between their words: a layout breaks them over lines, and parameters are kept
/// as they are written.
fn on_one_line(rig: &Rig) -> Rig {
    let mut out = rig.clone();
    for joint in rig.walk() {
        for tag in &joint.data.tags {
            let TagKind::Command { module, params, feature } = &tag.kind else { continue };
            let kind = TagKind::Command { module: module.clone(), params: without_blanks(params), feature: *feature };
            let edit = RigEdit::SetTag(joint.data.uid, Box::new(TagData { kind, ..tag.clone() }));
            out.apply(&edit).unwrap_or_else(|error| panic!("{error}: {params}"));
        }
    }
    out
}

/// RON without blanks and comments outside of its strings, and without commas before a closing bracket.
fn without_blanks(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(next) = rest.chars().next() {
        let length = match next {
            '"' => string_length(rest),
            '/' if rest.starts_with("//") => rest.find('\n').unwrap_or(rest.len()),
            '/' if rest.starts_with("/*") => rest.find("*/").map_or(rest.len(), |at| at + 2),
            _ => next.len_utf8(),
        };
        let (word, after) = rest.split_at(length);
        rest = after;
        if next == '/' || next.is_whitespace() {
            continue;
        }
        if matches!(next, ')' | ']' | '}') && out.ends_with(',') {
            out.pop();
        }
        out.push_str(word);
    }
    out
}

/// Bytes of the string at the start of a text, with its marks.
fn string_length(text: &str) -> usize {
    let mut is_escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            _ if is_escaped => is_escaped = false,
            '\\' => is_escaped = true,
            '"' => return at + 1,
            _ => {}
        }
    }
    text.len()
}

/// Every place of the list, forward and back, has the state that a build to that place from nothing has.
pub fn stepped(rig: &Rig) {
    let fresh = |place: usize| {
        let mut builder = Builder::new(limited());
        builder.sync(rig);
        builder.run_to(place);
        builder
    };
    let mut builder = fresh(0);
    let bare = builder.built();
    let mut states = vec![bare.clone()];
    while builder.cursor() < builder.len() {
        let before = builder.cursor();
        let report = builder.step_forward();
        check_limits(&builder, rig);
        if report.error.is_some() {
            assert_eq!(builder.cursor(), before, "a command that fails is not in effect");
            break;
        }
        states.push(builder.built());
    }
    let end = builder.cursor();
    for place in [end / 2, end] {
        assert_eq!(fresh(place).built(), states[place], "place {place}");
    }
    for place in (0..end).rev() {
        builder.step_back();
        assert_eq!(builder.built(), states[place], "back to {place}");
    }
    builder.roll_back();
    assert_eq!(builder.built(), bare);
    builder.run_to(end);
    assert_eq!(Some(&builder.built()), states.last());
}

/// A built rig runs, the same way twice; an ordinary one to finite places.
pub fn run(built: &BuiltRig, is_ordinary: bool) {
    let program = match RigProgram::compile(built, &CompileOptions::default()) {
        Ok(program) => Arc::new(program),
        Err(error) => return promises::error(&error),
    };
    let globals = |dt: f32| {
        let mut state = RigState::new(program.clone());
        state.evaluate(0.0);
        state.evaluate(dt);
        state.globals().to_vec()
    };
    let bits = |list: &[Trs]| -> Vec<[u32; 10]> {
        let numbers = |at: &Trs| {
            let (t, r, s) = (at.translation, at.rotation, at.scale);
            [t.x, t.y, t.z, r.x, r.y, r.z, r.w, s.x, s.y, s.z].map(f32::to_bits)
        };
        list.iter().map(numbers).collect()
    };
    let once = globals(0.02);
    assert_eq!(bits(&once), bits(&globals(0.02)), "two runs differ");
    if is_ordinary {
        let lost = once.iter().zip(&built.nodes).find(|(at, _)| !at.translation.is_finite());
        assert!(lost.is_none(), "{lost:?}");
    }
}

/// Rigs that can be saved can be read, and say as much; one that cannot be saved is an error, and leaves no file.
pub fn saved(rig: &Rig, built: Option<&BuiltRig>) {
    let disk = MemoryDisk::default();
    store_rig(&disk, &at("r.rig.ron"), rig).unwrap_or_else(|error| panic!("{error}\n{}", write_template(rig)));
    assert_eq!(load_template(&disk, &at("r.rig.ron")).expect("it was written").rig.len(), rig.len());
    match store_rig(&disk, &at("r.rig"), rig) {
        Ok(_) => assert_eq!(load_rig_text(&disk, &at("r.rig")).expect("it was written").joints.len(), rig.len()),
        Err(error) => refused(&disk, "r.rig", &error),
    }
    let (mesh, skin) = (cube(), (!rig.is_empty()).then(|| held_by_first(rig, 8)));
    let model = character(&Character { rig, built, file: &mesh, rest: &mesh, nodes: &[], skin: skin.as_ref() });
    let settings = GltfWriteSettings { all_joints: true, bind_unweighted: true, ..GltfWriteSettings::default() };
    for name in ["r.glb", "r.gltf"] {
        match store_model(&disk, &at(name), &model, &settings) {
            Ok(_) => {
                let again = load_model(&disk, &at(name)).expect("it was written");
                promises::model(&again);
                assert_eq!(joints(&again), joints(&model), "{name}");
            }
            Err(error) => refused(&disk, name, &error),
        }
    }
}

fn joints(model: &Model) -> usize {
    model.nodes.iter().filter(|node| node.joint).count()
}

/// Fails unless a refusal left nothing behind, and names the file.
pub fn refused(disk: &MemoryDisk, name: &str, error: &StoreError) {
    promises::error(error);
    assert!(FileKind::of(error.path()).is_some() && error.path() == at(name), "{error}");
    assert!(!disk.names().iter().any(|known| known == name), "{error}, but the file is there");
}
