//! Fuzzing of the template reader: no panic, no hang, and whatever it accepts can be saved and read again.

use rigsmith::rig::template::{
    UidStyle, format_template, read_header, read_template, survey_template, write_template, write_template_over,
};

use crate::mutate::run_fuzz;

#[test]
fn no_text_breaks_the_template_reader() {
    let frozen = include_str!("../frozen/format-1.rig.ron");
    let seeds = vec![
        frozen.as_bytes().to_vec(),
        include_str!("../frozen/format-2.rig.ron").as_bytes().to_vec(),
        include_str!("../frozen/format-2-choice.rig.ron").as_bytes().to_vec(),
        frozen.replacen("format: 1,", "format: 3, extra: (a: ['\"', r#\"x\"#]),", 1).into_bytes(),
        super::template_text::CHAIN.as_bytes().to_vec(),
        include_bytes!("../../assets/start/limb.rig.ron").to_vec(),
        include_bytes!("../../assets/start/sides.rig.ron").to_vec(),
        b"(format: 1, uid: \"0000000000000001\", name: \"n\")".to_vec(),
        b"(format: 1, uid: \"0000000000000001\", name: \"n\", joints: [(uid: \"0000000000000002\", translation: (0, 1, 2),
            tags: [Command(uid: \"0000000000000003\", module: \"m\", params: /* a */ () // b
        )])])".to_vec(),
    ];
    let dictionary: &[&[u8]] = &[
        b"uid: \"0000000000000001\",",
        b"parent: \"0000000000000001\",",
        b"joints: [",
        b"face: (part: Eye, label: \"a\", at: (1, 2, 3)),",
        b"groups: [",
        b"tags: [",
        b"params: ",
        b"format: 3",
        b"Some(",
        b"None",
        b"r#\"",
        b"/*",
        b"//",
        b"'\\''",
        b"Command(",
        b"Feature(",
        b"format: 2,",
        b"label: \"a\", parent: \"a\",",
        b"control(feature: \"ik\", ",
        b"@command control/a",
        b"rotation: (0, 90, 0),",
        b"(0.0, 0.0, 0.0)",
    ];
    run_fuzz("template", &seeds, dictionary, |bytes| {
        let header = read_header(bytes);
        drop(survey_template(bytes));
        match read_template(bytes) {
            Ok(template) => {
                let header = header.expect("the whole reads, so does its header");
                assert_eq!(&header.name, &template.rig.about().name);
                let text = write_template(&template.rig);
                let again = read_template(text.as_bytes()).unwrap_or_else(|error| panic!("{error}\n{text}"));
                // What nobody could bind is told again.
                let unbound = |note: &&String| note.ends_with("it stays as it is");
                assert_eq!(again.notes.len(), template.notes.iter().filter(unbound).count(), "{:?}", again.notes);
                assert_eq!(again.rig, template.rig);
                assert_eq!(write_template(&again.rig), text);
                // What is saved over it, or laid out, says the same.
                let source = std::str::from_utf8(bytes).unwrap().trim_start_matches('\u{FEFF}');
                if template.notes.is_empty() {
                    assert_eq!(write_template_over(&template.rig, source).as_deref(), Some(source));
                }
                for style in [UidStyle::Kept, UidStyle::Written, UidStyle::Derived] {
                    if let Ok(formatted) = format_template(source, style) {
                        assert_eq!(format_template(&formatted, style).as_ref(), Ok(&formatted));
                    }
                }
            }
            Err(error) => {
                let lines = 1 + bytes.iter().filter(|byte| **byte == b'\n').count();
                assert!((1..=lines).contains(&error.line), "{error}");
            }
        }
    });
}
