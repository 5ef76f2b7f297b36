//! The `.rig` text format: what is read, what is refused and where, and that writing loses nothing.

use std::time::Instant;

use glam::Vec3;
use proptest::prelude::*;
use rigsmith::rig::text::{RigText, RigTextError, RigTextJoint, may_begin_with, parse, write};

fn joint(parent: Option<usize>, position: [f32; 3], label: Option<&str>) -> RigTextJoint {
    RigTextJoint { parent, position: position.into(), label: label.map(str::to_owned) }
}

#[test]
fn well_formed_texts_are_read() {
    let two = vec![joint(None, [0.0, 1.0, -0.5], Some("hips")), joint(Some(0), [0.0, 1.5, 0.0], None)];
    for (name, text, expected) in [
        ("plain", "rig 1\njoint 0 -1 0 1 -0.5 hips\njoint 1 0 0 1.5 0\n", two.clone()),
        ("no last line end", "rig 1\njoint 0 -1 0 1 -0.5 hips\njoint 1 0 0 1.5 0", two.clone()),
        ("CRLF", "rig 1\r\njoint 0 -1 0 1 -0.5 hips\r\njoint 1 0 0 1.5 0\r\n", two.clone()),
        ("CR", "rig 1\rjoint 0 -1 0 1 -0.5 hips\rjoint 1 0 0 1.5 0\r", two.clone()),
        ("BOM", "\u{FEFF}rig 1\njoint 0 -1 0 1 -0.5 hips\njoint 1 0 0 1.5 0\n", two.clone()),
        ("tabs and blanks", "\t rig\t1 \n\n \t\njoint\t0  -1 0\t1 -0.5\u{A0}hips \n joint 1 0 0 1.5 0", two.clone()),
        (
            "comments",
            "# before\nrig 1 # version\n#joint 9 9\njoint 0 -1 0 1 -0.5 hips #left\njoint 1 0 0 1.5 0 # none",
            two.clone(),
        ),
        ("parent after child", "rig 1\njoint 1 0 0 1.5 0\njoint 0 -1 0 1 -0.5 hips", two.clone()),
        ("gaps", "rig 1\njoint 900 17 0 1.5 0\njoint 17 -1 0 1 -0.5 hips", two.clone()),
        ("exponents", "rig 1\njoint 0 -1 0e9 10e-1 -5.E-1 hips\njoint 1 0 .0 +1.5 -0", {
            let mut joints = two.clone();
            joints[1].position.z = -0.0;
            joints
        }),
        ("no joints", "rig 1", vec![]),
        (
            "several roots",
            "rig 1\njoint 0 -1 0 0 0\njoint 1 -1 1 0 0",
            vec![joint(None, [0.0; 3], None), joint(None, [1.0, 0.0, 0.0], None)],
        ),
        (
            "odd labels",
            "rig 1\njoint 0 -1 0 0 0 arm#2.L\u{301}左",
            vec![joint(None, [0.0; 3], Some("arm#2.L\u{301}左"))],
        ),
        ("numeric label", "rig 1\njoint 0 -1 0 0 0 7", vec![joint(None, [0.0; 3], Some("7"))]),
    ] {
        assert_eq!(parse(text.as_bytes()).unwrap_or_else(|e| panic!("{name}: {e}")).joints, expected, "{name}");
    }
}

#[test]
fn malformed_texts_name_the_line_and_the_field() {
    for (text, line, expected) in [
        (&b""[..], None, "begins with the line `rig 1`"),
        (b"\n# nothing\n", None, "empty"),
        (b"\xEF\xBB\xBF", None, "empty"),
        (b"joint 0 -1 0 0 0", Some(1), "begin the file with the line `rig 1`"),
        (b"# Wavefront\nv 0 0 0", Some(2), "found `v`"),
        (b"rig", Some(1), "`` is not a version"),
        (b"rig one", Some(1), "`one` is not a version"),
        (b"rig 0", Some(1), "`0` is not a version"),
        (b"rig -1", Some(1), "`-1` is not a version"),
        (b"rig 2", Some(1), "format version 2, and this program reads up to 1"),
        (b"rig 1 x", Some(1), "unexpected `x`"),
        (b"rig 1\nrig 1", Some(2), "second `rig` header"),
        (b"rig 1\nbone 0", Some(2), "unknown keyword `bone`"),
        (b"rig 1\nJoint 0 -1 0 0 0", Some(2), "unknown keyword `Joint`"),
        (b"rig 1\njoint", Some(2), "INDEX is missing"),
        (b"rig 1\njoint 0", Some(2), "PARENT is missing"),
        (b"rig 1\njoint 0 -1", Some(2), "X is missing"),
        (b"rig 1\njoint 0 -1 0", Some(2), "Y is missing"),
        (b"rig 1\njoint 0 -1 0 0 # 0", Some(2), "Z is missing"),
        (b"rig 1\njoint x -1 0 0 0", Some(2), "INDEX is `x`"),
        (b"rig 1\njoint -1 -1 0 0 0", Some(2), "INDEX is `-1`"),
        (b"rig 1\njoint 0.0 -1 0 0 0", Some(2), "INDEX is `0.0`"),
        (b"rig 1\njoint 99999999999999999999 -1 0 0 0", Some(2), "INDEX is `9999"),
        (b"rig 1\njoint 0 -2 0 0 0", Some(2), "PARENT is `-2`; it must be a whole number from 0 on, or -1"),
        (b"rig 1\njoint 0 hips 0 0 0", Some(2), "PARENT is `hips`"),
        (b"rig 1\njoint 0 -1 0,5 0 0", Some(2), "X is `0,5`, which is not a number"),
        (b"rig 1\njoint 0 -1 0 nan 0", Some(2), "Y is `nan`; it must be finite"),
        (b"rig 1\njoint 0 -1 0 0 -inf", Some(2), "Z is `-inf`; it must be finite"),
        (b"rig 1\njoint 0 -1 0 0 1e39", Some(2), "Z is `1e39`; it must be finite"),
        (b"rig 1\njoint 0 -1 0 0 0 left arm", Some(2), "unexpected `arm` after LABEL"),
        (b"rig 1\njoint 0 -1 0 0 0 a\x1b[2Jb", Some(2), "control characters"),
        (b"rig 1\njoint 3 -1 0 0 0\n\njoint 3 -1 0 0 0", Some(4), "INDEX 3 is taken by line 2"),
        (b"rig 1\njoint 5 -1 0 0 0\njoint 2 4 0 0 0", Some(3), "PARENT of joint 2 is 4"),
        (b"rig 1\njoint 4 4 0 0 0", Some(2), "4 -> 4"),
        (b"rig 1\njoint 0 -1 0 0 0\njoint 9 5 0 0 0\njoint 5 7 0 0 0\njoint 7 9 0 0 0", Some(3), "5 -> 7 -> 9 -> 5"),
        (b"rig 1\r\njoint 0 -1 0 0 0\r\n\rjoint x", Some(4), "INDEX is `x`"),
        (b"rig 1\n\xFF", Some(2), "not UTF-8"),
        (b"rig 1\n# \xC3\x28", Some(2), "not UTF-8"),
        (b"\xFF\xFEr\0i\0g\0", Some(1), "UTF-16"),
    ] {
        let shown = String::from_utf8_lossy(text);
        let error = parse(text).expect_err(&shown);
        assert!(error.to_string().contains(expected), "{shown:?}: {error}");
        assert_eq!(error.line(), line, "{shown:?}: {error}");
        if let Some(line) = line {
            assert!(error.to_string().starts_with(&format!("line {line}: ")), "{error}");
        }
    }
}

#[test]
fn messages_stay_short_for_hostile_files() {
    let long = "x".repeat(1 << 20);
    let ring: String = (0..1000).map(|i| format!("joint {i} {} 0 0 0\n", (i + 1) % 1000)).collect();
    for text in [
        long.clone(),
        format!("rig {long}"),
        format!("rig 1\n{long}"),
        format!("rig 1\njoint 0 -1 {long}"),
        format!("rig 1\njoint 0 -1 0 0 0 \u{1}{long}"),
        format!("rig 1\n{ring}"),
    ] {
        let error = parse(text.as_bytes()).unwrap_err().to_string();
        assert!(error.len() < 300, "{}", error.len());
    }
}

#[test]
fn labels_that_the_format_cannot_hold_are_replaced_and_reported() {
    let labels = ["left arm", "#1", "", "tab\tand\u{3000}wide", "a#b", "bell\u{7}"];
    let rig = RigText { joints: labels.map(|label| joint(None, [0.0; 3], Some(label))).to_vec() };
    let written = write(&rig).unwrap();
    let reported: Vec<_> =
        written.relabelled.iter().map(|entry| (entry.joint, entry.from.as_str(), entry.to.as_str())).collect();
    assert_eq!(
        reported,
        [
            (0, "left arm", "left_arm"),
            (1, "#1", "_1"),
            (2, "", ""),
            (3, "tab\tand\u{3000}wide", "tab_and_wide"),
            (5, "bell\u{7}", "bell_"),
        ]
    );
    assert!(written.relabelled[0].to_string().contains("`left_arm`"), "{}", written.relabelled[0]);
    assert!(written.relabelled.iter().all(|entry| !entry.to_string().contains(char::is_control)));
    let read: Vec<_> = parse(written.text.as_bytes()).unwrap().joints.into_iter().map(|joint| joint.label).collect();
    let expected = [Some("left_arm"), Some("_1"), None, Some("tab_and_wide"), Some("a#b"), Some("bell_")];
    assert_eq!(read, expected.map(|label| label.map(str::to_owned)));
}

#[test]
fn what_could_not_be_read_back_is_not_written() {
    let broken = |joints: Vec<RigTextJoint>| write(&RigText { joints }).unwrap_err();
    assert_eq!(broken(vec![joint(Some(1), [0.0; 3], None)]), RigTextError::WriteParent { joint: 0, parent: 1 });
    assert_eq!(broken(vec![joint(None, [0.0, f32::NAN, 0.0], None)]), RigTextError::WriteNotFinite { joint: 0 });
    let error = broken(vec![joint(Some(1), [0.0; 3], None), joint(Some(0), [0.0; 3], None)]);
    assert!(error.to_string().contains("0 -> 1 -> 0"), "{error}");
}

#[test]
fn the_text_is_one_line_a_joint_with_the_shortest_numbers() {
    let rig = RigText {
        joints: vec![
            joint(None, [0.0, 0.1, -2.0], Some("hips")),
            joint(Some(0), [1e-20, 16_777_216.0, f32::MAX], None),
        ],
    };
    let expected = "rig 1\njoint 0 -1 0 0.1 -2 hips\njoint 1 0 1e-20 16777216 3.4028235e38\n";
    assert_eq!(write(&rig).unwrap().text, expected);
}

#[test]
fn a_million_joints_are_read_quickly() {
    // One long chain, one star and one in descending order, so that no shape is quadratic.
    for (name, line) in [
        ("chain", (|i: i64| format!("joint {i} {} 0.25 {i}.5 -1e-3 bone_{i}\n", i - 1)) as fn(i64) -> String),
        ("star", |i| format!("joint {i} {} 0.25 {i}.5 -1e-3\n", if i == 0 { -1 } else { 0 })),
        ("descending", |i| {
            let i = 999_999 - i;
            format!("joint {} {} 0 0 0\n", 3 * i, if i == 0 { -1 } else { 3 * (i - 1) })
        }),
    ] {
        let text: String = std::iter::once("rig 1\n".to_owned()).chain((0..1_000_000).map(line)).collect();
        let started = Instant::now();
        let rig = parse(text.as_bytes()).unwrap();
        let took = started.elapsed();
        println!("{name}: {} bytes in {took:?}", text.len());
        assert_eq!(rig.joints.len(), 1_000_000);
        // A step that takes time with the square of a million lines takes hours.
        assert!(took < 10 * crate::bench::HANG, "{name}: {took:?}");
    }
}

fn any_rig() -> impl Strategy<Value = RigText> {
    let coordinate = prop_oneof![
        any::<u32>().prop_map(f32::from_bits).prop_filter("finite", |value| value.is_finite()),
        -10.0f32..10.0,
        Just(0.0),
        Just(-0.0),
    ];
    let label = proptest::option::of("[^#\\s\\p{Cc}][^\\s\\p{Cc}]{0,11}");
    let one = (any::<u64>(), [coordinate.clone(), coordinate.clone(), coordinate], label);
    (proptest::collection::vec(one, 0..40), any::<u64>()).prop_map(|(rows, seed)| {
        // Parents come from an order that is not that of the numbers, so children stand before them as well.
        let mut order: Vec<usize> = (0..rows.len()).collect();
        order.sort_by_key(|&i| rows[i].0 ^ seed);
        let mut parents = vec![None; rows.len()];
        for (rank, &i) in order.iter().enumerate() {
            let pick = (rows[i].0 % (rank as u64 + 1)) as usize;
            parents[i] = (pick < rank).then(|| order[pick]);
        }
        let joints = rows.into_iter().zip(parents).map(|((_, [x, y, z], label), parent)| RigTextJoint {
            parent,
            position: Vec3::new(x, y, z),
            label,
        });
        RigText { joints: joints.collect() }
    })
}

proptest! {
    #[test]
    fn what_is_written_is_read_back_bit_for_bit(rig in any_rig()) {
        let written = write(&rig).unwrap();
        prop_assert!(written.relabelled.is_empty(), "{:?}", written.relabelled);
        let read = parse(written.text.as_bytes()).unwrap();
        prop_assert_eq!(&read, &rig);
        for (a, b) in read.joints.iter().zip(&rig.joints) {
            prop_assert_eq!(a.position.to_array().map(f32::to_bits), b.position.to_array().map(f32::to_bits));
        }
        prop_assert_eq!(write(&read).unwrap().text, written.text);
    }

    #[test]
    fn any_labels_can_be_written(labels in proptest::collection::vec(any::<String>(), 0..8)) {
        let rig = RigText { joints: labels.iter().map(|label| joint(None, [1.0; 3], Some(label))).collect() };
        let written = write(&rig).unwrap();
        let read = parse(written.text.as_bytes()).unwrap();
        prop_assert_eq!(read.joints.len(), labels.len());
        prop_assert!(write(&read).unwrap().relabelled.is_empty());
    }
}

/// The first bytes of a file are enough to refuse it, and a refused beginning is refused like the whole file.
#[test]
fn beginnings_of_other_files_are_known() {
    for text in
        ["", "rig 1", "\u{FEFF}rig 1\njoint", "# a comment", "\n\n  # one\r\n\trig 1", "ri", "rig 9", "# cut \u{e9}"]
    {
        assert!(may_begin_with(text.as_bytes()), "{text:?}");
    }
    // The last character is cut.
    assert!(may_begin_with(&"# cut \u{e9}".as_bytes()[..7]));
    let others: [&[u8]; 6] =
        [&[0; 4096], b"joint 0 -1 0 0 0", b"# a\n{}", b"\xFF\xFEr\0i\0g\0", b"glTF\x02\0\0\0", b"rig 1\n\xFF\xFF"];
    for bytes in others {
        assert!(!may_begin_with(bytes), "{bytes:?}");
        let longer = [bytes, b"\njoint 0 -1 0 0 0\n"].concat();
        assert_eq!(parse(bytes), parse(&longer), "{bytes:?}");
        assert!(parse(bytes).is_err());
    }
}
