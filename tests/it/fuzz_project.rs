//! Fuzzing of the project reader: no panic, no hang, and whatever it accepts can be saved and read again.

use rigsmith::rig::project::{read_project, write_project};

use crate::mutate::run_fuzz;

#[test]
fn no_text_breaks_the_project_reader() {
    let frozen = include_str!("../frozen/format-1.rigsmith.ron");
    let newer = frozen.replacen("format: 1,", "format: 99, extra: (a: ['\"', r#\"x\"#]),", 1);
    let seeds = vec![
        frozen.as_bytes().to_vec(),
        newer.into_bytes(),
        b"(format: 1, name: \"n\")".to_vec(),
        b"(format: 1, name: \"\", rigs: [(rig: (format: 1, uid: \"0000000000000001\", name: \"n\", joints: [(
            uid: \"0000000000000002\", translation: (0, 1, 2), tags: [Command(uid: \"0000000000000003\", module: \"m\",
            params: /* a */ (\"b
        \") // c
            )])]), pose: [(joint: \"0000000000000002\", scale: (1, 2, 3))])])"
            .to_vec(),
    ];
    let dictionary: &[&[u8]] = &[
        b"uid: \"0000000000000001\",",
        b"joint: \"0000000000000001\",",
        b"rig: (format: 1, uid: \"0000000000000009\", name: \"\"),",
        b"rigs: [",
        b"meshes: [",
        b"pose: [",
        b"poses: [",
        b"offsets: [",
        b"params: ",
        b"format: 2",
        b"Some(",
        b"r#\"",
        b"/*",
        b"//",
        b"rotation: (0.0, 0.0, 0.0, 1.0)",
    ];
    run_fuzz("project", &seeds, dictionary, |bytes| match read_project(bytes) {
        Ok(read) => {
            let text = write_project(&read.project);
            let again = read_project(text.as_bytes()).unwrap_or_else(|error| panic!("{error}\n{text}"));
            assert_eq!(again.notes, Vec::<String>::new());
            assert_eq!(again.project, read.project);
            assert_eq!(write_project(&again.project), text);
        }
        Err(error) => {
            let lines = 1 + bytes.iter().filter(|byte| **byte == b'\n').count();
            assert!((1..=lines).contains(&error.line), "{error}");
        }
    });
}
