//! Clips packed into few bytes, with the real binary and real files.

use std::fs;

use rigsmith::{
    files::{RealDisk, load_model, load_packed_clips},
    mesh::model::Model,
    rig::animation::file_clip::motion_of,
};

use super::{WALKER, json};
use crate::{cli_build::rigsmith, packed_clips::dense_clip};

/// Greatest distance between joints of the same names as the first clips of two files are played.
fn off(a: &Model, b: &Model) -> f32 {
    let [a, b] = [a, b].map(|model| motion_of(model, &model.clips[0]));
    let mut most = 0.0_f32;
    for time in [0.0, 0.13, 0.4, 0.85] {
        for name in ["hips", "head", "hand_l", "foot_l", "foot_r"] {
            let [is, was] = [&a, &b].map(|motion| motion.globals_at(time)[motion.find(name).unwrap()].translation);
            most = most.max(is.distance(was));
        }
    }
    most
}

#[test]
fn packed_clips_are_written_and_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let run = |args: &[&str]| json(folder.path(), args);
    fs::write(path("walker.bvh"), WALKER).unwrap();
    run(&["animate", "biped", "walker.bvh", "-o", "walk.glb"]);
    let answer = run(&["animate", "biped", "walker.bvh", "-o", "walk.rigclip"]);
    let facts = &answer["packed"][0];
    assert_eq!((&facts["name"], &facts["frames"]), (&"walker".into(), &19.into()), "{answer}");
    assert!(facts["reduction"].as_f64().unwrap() > 4.0, "{answer}");
    // The answer as a whole tells the reduction of the file, and its motion that of the keys.
    for name in ["bytes_before", "bytes_after", "reduction"] {
        assert_eq!(answer[name], facts[name], "{name}: {answer}");
    }
    let keys = &answer["motions"][0];
    let of_keys = keys["keys_before"].as_f64().unwrap() / keys["keys_after"].as_f64().unwrap();
    assert!((keys["reduction"].as_f64().unwrap() - of_keys).abs() < 1e-3, "{answer}");
    let [packed_length, length] = ["walk.rigclip", "walk.glb"].map(|name| fs::metadata(path(name)).unwrap().len());
    assert!(2 * packed_length < length, "{packed_length} of {length}");

    // The joints move as in the file of the character.
    let packed = load_packed_clips(&RealDisk, &path("walk.rigclip")).unwrap();
    let whole = load_model(&RealDisk, &path("walk.glb")).unwrap();
    let off_by = off(&packed.model("walk"), &whole);
    assert!(off_by < 1e-3, "{off_by}");
    let facts = run(&["info", "walk.rigclip"]);
    assert_eq!((&facts["kind"], &facts["clips"]), (&"packed_clips".into(), &1.into()), "{facts}");
    assert_eq!(facts["joints"], packed.nodes.len());
    assert_eq!(rigsmith(folder.path(), &["check", "walk.rigclip"]).code, 0);

    // It is motion for any rig, and keys for its own joints.
    let again = run(&["animate", "biped", "walk.rigclip", "-o", "again.anim.ron"]);
    assert_eq!((&again["onto"], &again["found_by"]), (&"controls".into(), &"names".into()), "{again}");
    run(&["animate", "walk.glb", "walk.glb", "-o", "own.rigclip"]);
    let own = run(&["animate", "walk.glb", "own.rigclip", "-o", "own.anim.ron"]);
    assert_eq!((&own["onto"], &own["found_by"]), (&"joints".into(), &"joints".into()), "{own}");
    let bytes = |name: &str| fs::read(path(name)).unwrap();
    run(&["animate", "walk.glb", "walk.glb", "-o", "twice.rigclip"]);
    assert_eq!(bytes("own.rigclip"), bytes("twice.rigclip"));
}

/// Few bytes may be many keys; how much memory they take is told before they are unpacked.
#[test]
fn clips_that_unpack_to_too_much_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("dense.rigclip"), dense_clip(2_000)).unwrap();
    let run = |limit: &str| {
        rigsmith(folder.path(), &["animate", "biped", "dense.rigclip", "-o", "out.anim.ron", "--limit", limit])
    };
    let answer = run("unpacked=1000");
    assert_eq!(answer.code, 1, "{} {}", answer.out, answer.err);
    let is_told = |text: &str| text.contains("dense.rigclip") && text.contains("--limit unpacked=");
    assert!(is_told(&answer.err), "{}", answer.err);
    assert!(!folder.path().join("out.anim.ron").exists());
    // The motion has no joint of the rig, which is found out after it is unpacked.
    let answer = run("unpacked=1000000");
    assert!(!answer.err.contains("unpacked"), "{}", answer.err);
    // What the file holds is told without unpacking it.
    assert_eq!(rigsmith(folder.path(), &["info", "dense.rigclip", "--limit", "unpacked=0"]).code, 0);
}

#[test]
fn damaged_packed_clips_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("walker.bvh"), WALKER).unwrap();
    json(folder.path(), &["animate", "biped", "walker.bvh", "-o", "walk.rigclip"]);
    let bytes = fs::read(path("walk.rigclip")).unwrap();
    let refused = |name: &str, bytes: &[u8], told: &str| {
        fs::write(path(name), bytes).unwrap();
        let answer = rigsmith(folder.path(), &["animate", "biped", name, "-o", "out.anim.ron"]);
        assert!(answer.code != 0 && answer.err.contains(told), "{} {}", answer.out, answer.err);
        assert!(!path("out.anim.ron").exists());
    };
    refused("cut.rigclip", &bytes[..bytes.len() - 5], "cut off");
    refused("other.rigclip", b"something else", "no packed clip");
    for length in (8..bytes.len()).step_by(bytes.len() / 5) {
        refused("short.rigclip", &bytes[..length], "");
    }
    let mesh = ["animate", "biped", "walker.bvh", "--mesh", "body.obj", "-o", "out.rigclip"];
    let answer = rigsmith(folder.path(), &mesh);
    assert!(answer.code == 2 && answer.err.contains("--mesh is for a character"), "{}", answer.err);
}
