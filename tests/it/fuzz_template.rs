//! Fuzzing of the template reader: no panic, no hang, and whatever it accepts can be saved and read again.

use rigsmith::rig::template::{read_header, read_template, write_template};

use crate::mutate::run_fuzz;

#[test]
fn no_text_breaks_the_template_reader() {
    let frozen = include_str!("../frozen/format-1.rig.ron");
    let seeds = vec![
        frozen.as_bytes().to_vec(),
        include_str!("../frozen/format-2.rig.ron").as_bytes().to_vec(),
        include_str!("../frozen/format-2-choice.rig.ron").as_bytes().to_vec(),
        frozen.replacen("format: 1,", "format: 3, extra: (a: ['\"', r#\"x\"#]),", 1).into_bytes(),
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
        b"(0.0, 0.0, 0.0)",
    ];
    run_fuzz("template", &seeds, dictionary, |bytes| {
        let header = read_header(bytes);
        match read_template(bytes) {
            Ok(template) => {
                let header = header.expect("the whole reads, so does its header");
                assert_eq!(&header.name, &template.rig.about().name);
                let text = write_template(&template.rig);
                let again = read_template(text.as_bytes()).unwrap_or_else(|error| panic!("{error}\n{text}"));
                assert_eq!(again.notes, Vec::<String>::new());
                assert_eq!(again.rig, template.rig);
                assert_eq!(write_template(&again.rig), text);
            }
            Err(error) => {
                let lines = 1 + bytes.iter().filter(|byte| **byte == b'\n').count();
                assert!((1..=lines).contains(&error.line), "{error}");
            }
        }
    });
}
