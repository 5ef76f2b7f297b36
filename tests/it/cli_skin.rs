//! Parts of a mesh and joints that `rigsmith skin` reports: what moves as one, what holds no skin, and what options say of it.

use std::fs;

use serde_json::Value;

use crate::{cli_build::rigsmith, prerequisites::test_data};

/// A tube along x and a box that floats beside it, as the objects `body` and `pouch`.
fn tube_with_pouch(low: [f32; 3], high: [f32; 3]) -> String {
    let mut text = "o body\n".to_owned();
    for ring in 0..41 {
        let x = ring as f32 * 0.1;
        text += &format!("v {x} -0.3 -0.3\nv {x} 0.3 -0.3\nv {x} 0.3 0.3\nv {x} -0.3 0.3\n");
    }
    text += "f 4 3 2 1\nf 161 162 163 164\n";
    for ring in 0..40 {
        for side in 0..4 {
            let (a, b) = (ring * 4 + side + 1, ring * 4 + (side + 1) % 4 + 1);
            text += &format!("f {a} {b} {} {}\n", b + 4, a + 4);
        }
    }
    text += "o pouch\n";
    for corner in 0..8 {
        let pick = |axis: usize| if corner >> axis & 1 == 1 { high[axis] } else { low[axis] };
        text += &format!("v {} {} {}\n", pick(0), pick(1), pick(2));
    }
    for [a, b, c, d] in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
        text += &format!("f {} {} {} {}\n", a + 165, b + 165, c + 165, d + 165);
    }
    text
}

const TUBE_RIG: &str = "rig 1\njoint 0 -1 0.1 0 0 base\njoint 1 0 2 0 0 tip\njoint 2 0 2 9 0 far\n";

#[test]
fn rigid_parts_and_idle_joints_are_told_and_chosen() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("tube.rig"), TUBE_RIG).unwrap();
    let tube = tube_with_pouch([2.8, 0.5, -0.1], [3.1, 0.7, 0.1]);
    fs::write(folder.path().join("tube.obj"), &tube).unwrap();
    // Without a name of its own the pouch is a numbered part.
    fs::write(folder.path().join("one.obj"), tube.replace("o pouch\n", "")).unwrap();
    let skin = |json: &[&str], mesh: &str, options: &[&str]| {
        let args = [json, &["skin", "tube.rig", mesh, "-o", "a.glb"], options].concat();
        rigsmith(folder.path(), &args)
    };
    let told = skin(&["--json"], "tube.obj", &[]);
    let json = told.json();
    let pouch = &json["rigid_parts"][0];
    assert_eq!(
        (&pouch["part"], &pouch["points"], &pouch["joint"]),
        (&"pouch".into(), &8.into(), &"tip".into()),
        "{json}"
    );
    assert_eq!(json["rigid_parts"].as_array().unwrap().len(), 1, "{json}");
    let far = &json["idle_joints"][0];
    assert_eq!((&far["joint"], &far["reason"]), (&"far".into(), &"outside".into()), "{json}");
    assert!((far["distance"].as_f64().unwrap() - 8.338).abs() < 0.01, "{json}");
    let text = skin(&[], "tube.obj", &[]).out;
    assert!(text.contains("moving as one with tip: pouch (8 points)"), "{text}");
    assert!(text.contains("outside of the mesh (--claim lets them): far (8.3"), "{text}");

    for (mesh, part) in [("tube.obj", "pouch"), ("one.obj", "part 2")] {
        for option in ["--blend", "--bend"] {
            let blended = skin(&["--json"], mesh, &[option, part]).json();
            assert_eq!(blended["rigid_parts"].as_array().map(Vec::len), Some(0), "{mesh}: {blended}");
        }
        let rigid = skin(&["--json"], mesh, &["--rigid", &format!("{part}=base")]).json();
        let told = &rigid["rigid_parts"][0];
        assert_eq!((&told["part"], &told["joint"]), (&part.into(), &"base".into()), "{mesh}: {rigid}");
        assert_eq!(rigid["weights"]["given"], 8, "{mesh}: {rigid}");
    }
    let wrong = skin(&[], "tube.obj", &["--blend", "pouch,poach"]);
    assert!(wrong.code == 1 && wrong.err.contains("\"pouch\""), "names the nearest parts: {}", wrong.err);
    let wrong = skin(&[], "tube.obj", &["--claim", "base,fra"]);
    assert!(wrong.code == 1 && wrong.err.contains("\"far\""), "names the nearest joints: {}", wrong.err);
    let claimed = skin(&[], "tube.obj", &["--claim", "far"]);
    assert!(claimed.code == 0 && claimed.out.contains("although they claim it"), "{}{}", claimed.out, claimed.err);
    // A larger thing is the body's, until the joint beside it claims skin.
    fs::write(folder.path().join("tube.rig"), TUBE_RIG.replace("2 9 0 far", "2 3.4 0 far")).unwrap();
    fs::write(folder.path().join("thing.obj"), tube_with_pouch([1.6, 2.2, -0.4], [2.4, 2.8, 0.4])).unwrap();
    let is_idle = |json: &Value| json["idle_joints"].as_array().unwrap().iter().any(|idle| idle["joint"] == "far");
    let left = skin(&["--json"], "thing.obj", &[]).json();
    assert!(is_idle(&left), "{left}");
    let claimed = skin(&["--json"], "thing.obj", &["--claim", "far"]).json();
    assert!(!is_idle(&claimed) && claimed["rigid_parts"][0]["joint"] == "far", "{claimed}");
}

/// A single thing is counted in the singular, and joints of one name are named once with their number.
#[test]
fn reports_count_what_they_name() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("one.rig"), "rig 1\njoint 0 -1 0.1 0 0 base\n").unwrap();
    let text = rigsmith(folder.path(), &["info", "one.rig"]).out;
    assert!(text.contains("1 joint, 1 root, 0 local groups"), "{text}");
    fs::write(folder.path().join("tube.rig"), format!("{TUBE_RIG}joint 3 0 3 9 0 far\n")).unwrap();
    fs::write(folder.path().join("tube.obj"), tube_with_pouch([2.8, 0.5, -0.1], [3.1, 0.7, 0.1])).unwrap();
    let text = rigsmith(folder.path(), &["skin", "tube.rig", "tube.obj", "-o", "a.glb"]).out;
    assert!(text.contains("outside of the mesh (--claim lets them): far (2 joints, 8.3"), "{text}");
}

/// Whole words of labels tell joints that carry or steer things, unless flesh hangs below them.
#[test]
fn slots_are_told_by_their_labels() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("tube.obj"), tube_with_pouch([2.8, 0.5, -0.1], [3.1, 0.7, 0.1])).unwrap();
    let slots = |tip: &str, end: &str| {
        let rig = format!("rig 1\njoint 0 -1 0.1 0 0 base\njoint 1 0 2 0 0 {tip}\njoint 2 1 3.4 0 0 {end}\n");
        fs::write(folder.path().join("tube.rig"), rig).unwrap();
        let json = rigsmith(folder.path(), &["--json", "skin", "tube.rig", "tube.obj", "-o", "a.glb"]).json();
        let idle = json["idle_joints"].as_array().unwrap().iter();
        idle.map(|idle| format!("{} {}", idle["joint"], idle["reason"])).collect::<Vec<String>>()
    };
    for label in ["handslot.l", "WeaponSocketR", "hand_prop", "IKTarget", "kneeIK.l", "POLE", "attach-1"] {
        assert_eq!(slots("tip", label), [format!("\"{label}\" \"slot\"")]);
    }
    for label in ["eye_socket", "proper", "Mike", "controller", "slotted"] {
        assert!(slots("tip", label).is_empty(), "{label}");
    }
    assert!(slots("tip_ctrl", "end").is_empty(), "flesh hangs below the control");
}

/// A character of many parts: poles and targets are idle, and a part goes to the joint that a person names.
#[test]
fn parts_of_a_character_go_by_their_names() {
    let Some(data) = test_data() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mage = data.join("characters/Mage.glb").display().to_string();
    let skin = |options: &[&str]| {
        let args = ["--json", "skin", mage.as_str(), mage.as_str(), "-o", "a.glb"];
        rigsmith(folder.path(), &args.iter().chain(options).copied().collect::<Vec<&str>>()).json()
    };
    let json = skin(&[]);
    let list = |json: &Value, key: &str| json[key].as_array().unwrap().clone();
    let idle = list(&json, "idle_joints");
    let knee = idle.iter().find(|idle| idle["joint"] == "kneeIK.l").unwrap_or_else(|| panic!("{json}"));
    assert!(knee["reason"] == "outside" && knee["distance"].as_f64().unwrap() > 0.0, "{json}");
    assert!(list(&json, "rigid_parts").iter().any(|part| part["joint"] == "head"), "{json}");
    let moved = skin(&["--rigid", "Mage_Hat=hand.r"]);
    let hat = list(&moved, "rigid_parts").into_iter().find(|part| part["part"] == "Mage_Hat");
    assert_eq!(hat.unwrap_or_else(|| panic!("{moved}"))["joint"], "hand.r");
}
