//! Characters of the data folder, exported, for the Khronos validator and for a look at what arrives.
//!
//! The files go to the folder in `RIGSMITH_EXPORTS` if it is set; the CI runs the validator on what is there.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use rigsmith::{
    algo::weights::WeightSettings,
    files::{RealDisk, load_model, load_template, store_model},
    headless::Workbench,
    mesh::{gltf::GltfWriteSettings, model::Model},
    rig::{RigEdit, UidSource, character::import_rig_text, operations::Operation, text},
};

use crate::prerequisites::test_data;

/// Folder of exports that a validator shall see.
pub fn exports() -> (PathBuf, Option<tempfile::TempDir>) {
    match std::env::var_os("RIGSMITH_EXPORTS") {
        Some(folder) => (folder.into(), None),
        None => {
            let folder = tempfile::tempdir().unwrap();
            (folder.path().into(), Some(folder))
        }
    }
}

/// The `game_engine` rig of a body: heads and parents only.
fn game_engine(body: &std::path::Path) -> Vec<RigEdit> {
    let json: serde_json::Value = serde_json::from_slice(&fs::read(body.join("joints.json")).unwrap()).unwrap();
    let bones = json["game_engine"].as_object().unwrap();
    let number: BTreeMap<&str, usize> = bones.keys().enumerate().map(|(n, name)| (name.as_str(), n)).collect();
    let mut rig = "rig 1\n".to_owned();
    for (name, bone) in bones {
        let parent = bone["parent"].as_str().map_or(-1, |parent| number[parent] as i64);
        let [x, y, z] = [0, 1, 2].map(|axis| bone["head"][axis].as_f64().unwrap());
        rig.push_str(&format!("joint {} {parent} {x} {y} {z} {name}\n", number[name.as_str()]));
    }
    let text = text::parse(rig.as_bytes()).unwrap();
    import_rig_text(&text, &mut UidSource::seeded(5)).0
}

fn skinned(model: &Model) -> bool {
    model.objects.iter().any(|object| object.skin.is_some())
}

#[test]
fn bodies_skinned_to_game_engine() {
    let Some(data) = test_data() else { return };
    let (folder, _guard) = exports();
    for name in ["baby", "female_young", "male_muscular_action"] {
        let body = data.join("bodies").join(name);
        let mut bench = Workbench::new(1, name);
        bench.operate(Operation::Edits(game_engine(&body))).unwrap();
        bench.open(load_model(&RealDisk, &body.join("body.obj")).unwrap(), true).unwrap();
        let report = bench.skin(WeightSettings::default(), Vec::new(), &mut |_| ()).unwrap();
        assert_eq!(report.weights.points, 13_380);
        let path = folder.join(format!("body_{name}.glb"));
        store_model(&RealDisk, &path, &bench.character(), &GltfWriteSettings::default()).unwrap();
        let back = load_model(&RealDisk, &path).unwrap();
        assert!(skinned(&back));
        let weights = back.weights.as_ref().unwrap();
        assert!((0..weights.len()).all(|point| weights.of(point).len() > 0), "{name} has unweighted vertices");
        assert!((0..weights.len()).all(|point| weights.of(point).len() <= 4));
        // Labels are the nodes' names, unchanged, and every joint is one that deforms or carries one that does.
        assert!(back.nodes.iter().any(|node| node.name == "upperarm_l"));
        let joints = back.nodes.iter().filter(|node| node.joint).count();
        assert!((50..=53).contains(&joints), "{name}: {joints} joints");
        let all = GltfWriteSettings { all_joints: true, ..Default::default() };
        let path = folder.join(format!("body_{name}_all.gltf"));
        store_model(&RealDisk, &path, &bench.character(), &all).unwrap();
        let back = load_model(&RealDisk, &path).unwrap();
        assert_eq!(back.nodes.iter().filter(|node| node.joint).count(), 53);
    }
}

#[test]
fn the_bundled_character_is_exported() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
    let (folder, _guard) = exports();
    let rig = load_template(&RealDisk, &root.join("templates/biped.rig.ron")).unwrap().rig;
    let joints = rig.len();
    let mut bench = Workbench::with_rig(1, rig);
    bench.open(load_model(&RealDisk, &root.join("models/biped.obj")).unwrap(), true).unwrap();
    bench.skin(WeightSettings::default(), Vec::new(), &mut |_| ()).unwrap();
    let path = folder.join("bundled_biped.glb");
    let all = GltfWriteSettings { all_joints: true, ..Default::default() };
    store_model(&RealDisk, &path, &bench.character(), &all).unwrap();
    let back = load_model(&RealDisk, &path).unwrap();
    assert!(skinned(&back));
    assert_eq!(back.nodes.iter().filter(|node| node.joint).count(), joints);
    let weights = back.weights.as_ref().unwrap();
    assert!((0..weights.len()).all(|point| (1..=4).contains(&weights.of(point).len())));
}

#[test]
fn characters_pass_through_the_workbench() {
    let Some(data) = test_data() else { return };
    let (folder, _guard) = exports();
    let files = [
        "creatures/bird-eagle.glb",
        "creatures/fox-dog.glb",
        "creatures/fox-fox.glb",
        "hands/webxr_generic_hand_left.glb",
        "gltf_skinned/CesiumMan.glb",
        "gltf_skinned/Fox.glb",
        "gltf_skinned/RiggedSimple.glb",
        "gltf_skinned/RobotExpressive.glb",
        "gltf_skinned/SimpleSkin.gltf",
        "gltf_skinned/cesium_man.gltf",
        "gltf_skinned/rigged_simple.gltf",
        "bodies/male_young/body_gt.glb",
    ];
    for file in files {
        let model = load_model(&RealDisk, &data.join(file)).unwrap();
        let clips: Vec<(String, usize)> = model.clips.iter().map(|c| (c.name.clone(), c.channels.len())).collect();
        let stem = file.replace(['/', '.'], "_");
        // Opened as joints and weights, and written as they are.
        let mut bench = Workbench::new(2, "character");
        bench.open(model.clone(), false).unwrap();
        assert_eq!(bench.rig().len(), model.nodes.len(), "{file}");
        let settings = GltfWriteSettings { bind_unweighted: true, all_joints: true, ..Default::default() };
        let path = folder.join(format!("{stem}.glb"));
        store_model(&RealDisk, &path, &bench.character(), &settings).unwrap();
        let back = load_model(&RealDisk, &path).unwrap();
        assert_eq!(skinned(&back), skinned(&model), "{file}");
        let back_clips: Vec<(String, usize)> = back.clips.iter().map(|c| (c.name.clone(), c.channels.len())).collect();
        assert_eq!(back_clips, clips, "{file}: clips");
        for (before, after) in model.clips.iter().zip(&back.clips) {
            for (before, after) in before.channels.iter().zip(&after.channels) {
                assert_eq!((&before.times, &before.values), (&after.times, &after.values), "{file}: keys");
            }
        }
        let triangles = |model: &Model| model.parts.iter().map(|part| part.triangles.len()).sum::<usize>();
        assert_eq!(triangles(&back), triangles(&model), "{file}: triangles");
        assert_eq!(back.material_set.materials.len(), model.material_set.materials.len(), "{file}: materials");
        assert_eq!(back.material_set.images.len(), model.material_set.images.len(), "{file}: images");
        let morphs = |model: &Model| model.objects.iter().map(|o| o.morph_names.len()).sum::<usize>();
        assert_eq!(morphs(&back), morphs(&model), "{file}: morph targets");
        // Skinned anew, at rest: the clips stay, and no vertex is left without weights.
        bench.skin(WeightSettings::default(), Vec::new(), &mut |_| ()).unwrap();
        let path = folder.join(format!("{stem}_anew.glb"));
        store_model(&RealDisk, &path, &bench.character(), &GltfWriteSettings::default()).unwrap();
        let anew = load_model(&RealDisk, &path).unwrap();
        assert!(anew.objects.iter().all(|object| object.skin.is_some()), "{file}");
        let weights = anew.weights.as_ref().unwrap();
        assert!((0..weights.len()).all(|point| weights.of(point).len() > 0), "{file}");
    }
}
