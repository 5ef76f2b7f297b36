//! Mesh files: a model is read, written in every format and read again, and goes through a workbench with its skeleton.

use rigsmith::{
    files::{load_model, store_model},
    headless::Workbench,
    mesh::{
        gltf::GltfWriteSettings,
        model::{ChannelTarget, Model},
    },
    rig::animation::file_clip::motion_of,
};

use super::{
    memory_disk::{MemoryDisk, at},
    promises,
    template::refused,
};
use crate::generate::{
    Choices,
    models::{model, obj},
};

fn settings() -> GltfWriteSettings {
    GltfWriteSettings { all_joints: true, bind_unweighted: true, max_influences: 8, ..GltfWriteSettings::default() }
}

/// Carries a glTF file, and an OBJ file, through all of it.
pub fn check(bytes: &[u8]) {
    let choices = &mut Choices::new(bytes);
    let text = obj(choices);
    let made = model(choices);
    let disk = MemoryDisk::default();
    disk.put("m.obj", text.as_bytes());
    let read = load_model(&disk, &at("m.obj")).unwrap_or_else(|error| panic!("{error}\n{text}"));
    as_obj(&read);
    as_gltf(&read, true);
    disk.put("m.glb", &made.glb);
    match load_model(&disk, &at("m.glb")) {
        Ok(read) => {
            promises::model(&read);
            as_gltf(&read, !made.is_bent);
            if read.face_count() > 0 {
                as_obj(&read);
            }
            through_workbench(&read, !made.is_bent);
            for clip in &read.clips {
                let motion = motion_of(&read, clip);
                assert_eq!(motion.values.len(), motion.frames() * motion.width());
                assert!(motion.values.iter().all(|value| value.is_finite()) && motion.frame_time > 0.0);
            }
        }
        Err(error) => {
            assert!(made.is_bent, "{error}");
            promises::error(&error);
        }
    }
}

/// Saves a model under a name on a disk of its own and reads it.
fn saved(model: &Model, name: &str, is_whole: bool) -> Option<(MemoryDisk, Model)> {
    let disk = MemoryDisk::default();
    match store_model(&disk, &at(name), model, &settings()) {
        Ok(_) => {
            let read = load_model(&disk, &at(name)).unwrap_or_else(|error| panic!("saved, but: {error}"));
            Some((disk, read))
        }
        Err(error) => {
            assert!(!is_whole, "{name}: {error}");
            refused(&disk, name, &error);
            None
        }
    }
}

/// Models that were written as GLB give the same bytes when they are written again, and the same model as with a buffer
/// beside it.
fn as_gltf(model: &Model, is_whole: bool) {
    // A model that is read has the name of its file, and the scene that is written has the name of the model.
    let model = &Model { name: "a".to_owned(), ..model.clone() };
    let Some((disk, first)) = saved(model, "a.glb", is_whole) else { return };
    promises::model(&first);
    let triangles = |model: &Model| model.parts.iter().map(|part| part.triangles.len()).sum::<usize>();
    assert_eq!(triangles(&first), triangles(model));
    if is_whole {
        assert_eq!(first.clips.len(), model.clips.iter().filter(|clip| !clip.channels.is_empty()).count());
    }
    let (again, second) = saved(&first, "a.glb", true).expect("it was written before");
    assert_eq!(second, first);
    assert!(again.get("a.glb") == disk.get("a.glb"), "the second file is another");
    let (beside, third) = saved(&first, "a.gltf", true).expect("it was written before");
    assert_eq!(third, first);
    let has_temporaries = beside.names().iter().any(|name| name.starts_with(".rigsmith-"));
    assert!(!has_temporaries, "{:?}", beside.names());
}

/// Models that were written as OBJ have the points and faces of the model at rest, and a model that was read from OBJ gives
/// the same bytes each time.
fn as_obj(model: &Model) {
    let Some((_, first)) = saved(model, "a.obj", false) else { return };
    assert_eq!(first.points.len(), model.points.len());
    assert!(first.points.iter().all(|point| point.is_finite()));
    assert_eq!(first.face_count(), model.face_count());
    let (disk, second) = saved(&first, "a.obj", true).expect("it was written before");
    assert_eq!(second.points, first.points);
    let (again, third) = saved(&second, "a.obj", true).expect("it was written before");
    assert_eq!(third, second);
    assert!(again.get("a.obj") == disk.get("a.obj"), "the next file is another");
}

/// Opened with its skeleton and exported as it is, a model keeps nodes, clips, weights and triangles.
fn through_workbench(model: &Model, is_whole: bool) {
    let mut bench = Workbench::new(2, "made");
    bench.open(model.clone(), false).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(bench.rig().len(), model.nodes.len());
    let Some((_, back)) = saved(&bench.character(), "c.glb", is_whole) else { return };
    promises::model(&back);
    let of_nodes = |model: &Model| -> usize {
        let channels = model.clips.iter().flat_map(|clip| &clip.channels);
        channels.filter(|channel| !matches!(channel.target, ChannelTarget::MorphWeights(_))).count()
    };
    assert_eq!(of_nodes(&back), of_nodes(model));
    let triangles = |model: &Model| model.parts.iter().map(|part| part.triangles.len()).sum::<usize>();
    assert_eq!(triangles(&back), triangles(model));
    let skinned = |model: &Model| model.objects.iter().filter(|object| object.skin.is_some()).count();
    assert_eq!(skinned(&back), skinned(model));
}
