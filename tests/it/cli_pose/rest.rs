//! Rigs at rest, which are posed without an app: what is told and saved is that of an app.

use std::{fs, sync::Arc};

use rigsmith::{
    headless::Workbench, modules, plugins::commands::BuildStep, processor::Builder, rig::template::read_template,
};

use super::pose;

/// Turned and moved joints, a null, two roots and a joint without a label.
const LIMBS: &str = r#"(
    format: 2,
    name: "limbs",
    joints: [
        (label: "hip", translation: (0.1, 1.0, -0.2), rotation: (0.0, 0.0, 0.6, 0.8), scale: (2.0, 2.0, 2.0)),
        (label: "knee", parent: "hip", translation: (0, -0.4, 0.03), rotation: (0.6, 0.0, 0.0, 0.8)),
        (label: "foot", parent: "knee", translation: (0.013, -0.41, 0.007)),
        (uid: "00000000000000a1", parent: "foot", translation: (0.1, 0.2, 0.3)),
        (label: "prop", kind: Null, translation: (0.5, 0.25, 0.125)),
    ],
)"#;

/// Joints of which one is scaled unevenly, and another one turned below it.
const UNEVEN: &str = r#"(
    format: 2,
    name: "uneven",
    joints: [
        (label: "top", translation: (0, 1, 0), scale: (1.0, 3.0, 1.0)),
        (label: "turned", parent: "top", translation: (0, 0.5, 0), rotation: (0.0, 0.0, 0.6, 0.8)),
        (label: "tip", parent: "turned", translation: (0, 0.5, 0)),
    ],
)"#;

#[test]
fn rigs_at_rest_are_told_and_saved_as_by_an_app() {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [("limbs", LIMBS), ("uneven", UNEVEN)] {
        let [rig, tagged] = ["", "_tagged"].map(|which| format!("{name}{which}.rig.ron"));
        fs::write(folder.path().join(&rig), text).unwrap();
        // A rig with a command, which does nothing here, is posed in an app.
        let with_tag =
            text.replacen("translation", "tags: [Command(module: \"control\", enabled: false)], translation", 1);
        assert_ne!(with_tag, text);
        fs::write(folder.path().join(&tagged), with_tag).unwrap();
        for ending in ["glb", "rig.ron"] {
            let app = format!("{name}_app.{ending}");
            let shown = pose(folder.path(), &tagged, &["-o", &app, "--frames", "1"]);
            let wanted = fs::read(folder.path().join(app)).unwrap();
            for frames in ["0", "1", "30"] {
                let rest = format!("{name}_{frames}.{ending}");
                let told = pose(folder.path(), &rig, &["-o", &rest, "--frames", frames]);
                assert!(told["nodes"].as_array().is_some_and(|nodes| nodes.len() >= 3), "{told}");
                assert_eq!(told["nodes"], shown["nodes"], "{name}");
                assert_eq!(told["error"], shown["error"], "{name}");
                let saved = fs::read(folder.path().join(rest)).unwrap();
                assert!(saved == wanted, "{name}.{ending}: other bytes");
            }
        }
    }
}

/// A bench whose rig was built elsewhere has no processor, and poses as one that builds.
#[test]
fn rigs_that_were_built_elsewhere_are_posed_as_in_an_app_that_builds() {
    for text in [LIMBS, UNEVEN] {
        let rig = read_template(text.as_bytes()).unwrap().rig;
        let built = Builder::build(&rig, &Arc::new(modules::all())).unwrap();
        let [mut supplied, mut own] = [0; 2].map(|_| Workbench::with_rig(5, rig.clone()));
        supplied.set_built(Arc::new(built));
        assert!(own.build(BuildStep::All).error.is_none());
        for bench in [&mut supplied, &mut own] {
            bench.pose_through(&[], &[]).unwrap();
            bench.frames(3).unwrap();
        }
        assert!(supplied.processor().is_none() && own.processor().is_some());
        assert_eq!(supplied.nodes().unwrap(), own.nodes().unwrap());
        let [supplied, own] = [supplied, own].map(|bench| bench.into_posed().unwrap());
        assert_eq!((supplied.rig, supplied.nodes, supplied.built), (own.rig, own.nodes, own.built));
    }
}
