//! Fuzzing of the `.rig` reader: no panic, no hang, and whatever it accepts keeps its promises.

use rigsmith::rig::text::{parse, write};

use crate::mutate::run_fuzz;

#[test]
fn no_text_breaks_the_rig_reader() {
    let seeds: Vec<Vec<u8>> = [
        "rig 1\njoint 0 -1 0 0.95 0 hips\njoint 1 0 0 1.1 0.02 spine # trunk\njoint 2 1 -0.2 1.4 1e-3 arm_l\n",
        "\u{FEFF}# exported\r\nrig 1\r\n\r\njoint 7 3 1 2 3\r\njoint 3 -1 .5 -5e-1 +6 左\r\njoint 4 7 0 0 0 a#b\r\n",
        "rig\t1\rjoint\t0\t-1\t0\t0\t0\rjoint\t1\t-1\t1\t1\t1\tb\r",
        "rig 1\njoint 0 1 0 0 0\njoint 1 2 0 0 0\njoint 2 -1 0 0 0\n",
        "rig 1\n",
    ]
    .map(|text| text.as_bytes().to_vec())
    .to_vec();
    let dictionary: &[&[u8]] = &[b"rig", b"joint", b"rig 1\n", b"joint 0 -1 0 0 0\n", b" -1 ", b"#", b"rig 2"];
    run_fuzz("rig", &seeds, dictionary, |bytes| match parse(bytes) {
        Ok(rig) => {
            for (i, joint) in rig.joints.iter().enumerate() {
                assert!(joint.position.is_finite() && joint.parent.is_none_or(|parent| parent < rig.joints.len()));
                let steps = std::iter::successors(joint.parent, |&at| rig.joints[at].parent).take(rig.joints.len());
                assert!(steps.count() < rig.joints.len(), "joint {i} is its own ancestor");
            }
            let written = write(&rig).unwrap();
            assert!(written.relabelled.is_empty(), "{:?}", written.relabelled);
            assert_eq!(parse(written.text.as_bytes()).unwrap(), rig);
        }
        Err(error) => {
            let lines = 1 + bytes.iter().filter(|byte| b"\r\n".contains(byte)).count();
            assert!(error.line().is_none_or(|line| (1..=lines).contains(&line)), "{error}");
            let text = error.to_string();
            assert!(text.len() < 400 && !text.chars().any(char::is_control), "{text:?}");
        }
    });
}
