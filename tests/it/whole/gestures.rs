//! Gestures: read from their text, carried out on a mesh, bound, exported, and undone to the first bytes.

use std::time::Duration;

use rigsmith::{
    algo::weights::WeightSettings,
    files::{load_model, store_model},
    headless::Workbench,
    mesh::gltf::GltfWriteSettings,
    plugins::gesture::{Gesture, read_gestures},
    rig::template::write_template,
};

use super::{
    LIMITS,
    memory_disk::{MemoryDisk, at},
    promises,
    skin::cube,
    template::{refused, saved},
};
use crate::generate::{Choices, choices::bend, gestures::gestures};

/// Carries a list of gestures through all of it.
pub fn check(bytes: &[u8]) {
    let mut choices = Choices::new(bytes);
    let made = gestures(&mut choices);
    let mut text = ron::to_string(&made).expect("gestures can be written");
    let is_bent = choices.chance(4);
    if is_bent {
        bend(&mut choices, &mut text);
    }
    let list = match read_gestures(text.as_bytes()) {
        Ok(list) => list,
        Err(error) => {
            assert!(is_bent, "{error}\n{text}");
            return promises::error(&error);
        }
    };
    if !is_bent {
        assert_eq!(list, made);
    }
    let mut bench = Workbench::new(3, "made");
    // An end for what hangs, also where other programs have the processor.
    bench.set_limits(LIMITS, Duration::from_secs(600));
    if !choices.chance(4) {
        bench.open(cube(), true).expect("a cube opens");
    }
    let first = write_template(bench.rig());
    let count = list.len();
    let answers = bench.gestures(list);
    assert_eq!(answers.len(), count, "a gesture has no answer: {text}");
    for (number, answer) in (1..).zip(&answers) {
        assert_eq!(answer.number, number);
        assert!(!answer.out_of_time, "gesture {number} ({}) took too long: {text}", answer.gesture);
        assert!(answer.done || !answer.message.is_empty(), "gesture {number} says nothing: {text}");
    }
    let rig = bench.rig().clone();
    if !rig.is_empty() {
        saved(&rig, None);
        bound(&mut bench);
    }
    // Undone as often as something was done, it is as it was.
    for _ in 0..2 * count + 2 {
        if !bench.gestures(vec![Gesture::Undo]).last().is_some_and(|answer| answer.done) {
            break;
        }
    }
    assert_eq!(write_template(bench.rig()), first, "{text}");
}

/// Binds the mesh, if there is one, and exports the character.
fn bound(bench: &mut Workbench) {
    let settings = WeightSettings { voxel_resolution: 24, ..WeightSettings::default() };
    if let Err(error) = bench.skin(settings, Vec::new(), &mut |_| ()) {
        return promises::error(&error);
    }
    let disk = MemoryDisk::default();
    match store_model(&disk, &at("s.glb"), &bench.character(), &GltfWriteSettings::default()) {
        Ok(_) => {
            let back = load_model(&disk, &at("s.glb")).expect("it was written");
            promises::model(&back);
            assert!(back.objects.iter().all(|object| object.skin.is_some()), "a part is not bound");
        }
        Err(error) => refused(&disk, "s.glb", &error),
    }
}
