//! Projects: rigs with meshes and weights are saved, opened, saved again and opened from a disk on which the mesh has changed.

use std::sync::Arc;

use rigsmith::{
    files::{
        Fault, FaultPlan, FaultyDisk, MeshShape, MeshState, MeshToSave, ProjectNote, ProjectToSave, load_project,
        store_project,
    },
    mesh::model::Weights,
    rig::{
        Rig, RigEdit, SkinData, Uid, UidSource,
        template::{read_template, write_template},
    },
};

use super::{
    edits::bytes,
    limited,
    memory_disk::{MemoryDisk, at},
    promises,
    skin::cube,
};
use crate::generate::{Choices, clips::clip, edits::operation, models::obj, template::template};

const MESH: Uid = Uid(0x50);

/// Carries a project through all of it.
pub fn check(bytes_of_choices: &[u8]) {
    let choices = &mut Choices::new(bytes_of_choices);
    let made = template(choices, &limited(), false);
    let Some(mut rig) = made.read().map(|template| template.rig) else { return };
    let mut uids = UidSource::seeded(3);
    for number in 0..choices.below(6) as u64 {
        let operation = operation(choices, &rig, &limited(), number * 16);
        let _ = operation.run(&mut rig, &mut uids, None);
    }
    let nodes: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
    let _ = rig.apply(&RigEdit::AddClip(Box::new(clip(choices, 0xC11_9000, &nodes)), 0));
    // Weights of other meshes are not part of this project.
    let skins: Vec<Uid> = rig.skins().map(|(mesh, _)| mesh).collect();
    for mesh in skins {
        rig.apply(&RigEdit::SetSkin(mesh, None)).expect("weights can be taken away");
    }
    let disk = MemoryDisk::default();
    disk.put("mesh.obj", &cube_text());
    let mut meshes = Vec::new();
    if !rig.is_empty() {
        bind(choices, &mut rig);
        let model = cube();
        let shape = MeshShape::Open { triangles: model.point_triangles().into(), rest: Arc::new(model.at_rest()) };
        meshes.push(MeshToSave { uid: MESH, rig: rig.uid(), path: at("mesh.obj"), nodes: Arc::default(), shape });
    }
    let project = ProjectToSave { name: "made".into(), rigs: vec![rig.clone()], meshes, ..ProjectToSave::default() };
    store_project(&disk, &at("p.rigsmith.ron"), &project).unwrap_or_else(|error| panic!("{error}"));
    opened(&disk, &rig, true);
    let saved = disk.get("p.rigsmith.ron");
    store_project(&disk, &at("p.rigsmith.ron"), &project).unwrap_or_else(|error| panic!("{error}"));
    assert!(disk.get("p.rigsmith.ron") == saved, "the second file is another");
    faulty(choices, &disk, &project, &rig);
    // The mesh is another one, or gone; the rig opens all the same.
    match choices.below(3) {
        0 => disk.put("mesh.obj", obj(choices).as_bytes()),
        1 => disk.put("mesh.obj", b"f 1 2 3"),
        _ => disk.put("mesh.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
    }
    opened(&disk, &rig, false);
}

fn cube_text() -> Vec<u8> {
    let mut text = Vec::new();
    for point in cube().points {
        text.extend(format!("v {} {} {}\n", point.x, point.y, point.z).into_bytes());
    }
    for face in ["4 3 2 1", "5 6 7 8", "1 2 6 5", "2 3 7 6", "3 4 8 7", "4 1 5 8"] {
        text.extend(format!("f {face}\n").into_bytes());
    }
    text
}

fn bind(choices: &mut Choices, rig: &mut Rig) {
    let joints: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
    let mut weights = Weights::default();
    for _ in 0..8 {
        let share = 0.5 + 0.5 * choices.unit();
        let other = choices.below(joints.len()) as u32;
        match (other, share < 1.0) {
            (0, _) | (_, false) => weights.push([(0, 1.0)]),
            (other, true) => weights.push([(0, share), (other, 1.0 - share)]),
        }
    }
    let skin = SkinData { joints, weights, at_rest: true, ..SkinData::default() };
    rig.apply(&RigEdit::SetSkin(MESH, Some(Arc::new(skin)))).expect("weights over joints of the rig");
}

/// Opens the project; with its own mesh the rig is as it was saved.
fn opened(disk: &MemoryDisk, rig: &Rig, is_same: bool) {
    let opened = load_project(disk, &at("p.rigsmith.ron")).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(opened.rigs.len(), 1);
    assert_eq!(bytes(&opened.rigs[0]), bytes(rig));
    if is_same {
        assert_eq!(opened.rigs[0].skin(MESH), rig.skin(MESH));
        assert!(opened.meshes.iter().all(|mesh| matches!(mesh.shape, MeshState::Open { .. })));
        // References that are bound to nothing are told each time the rig is read; nothing else is there to tell.
        let text = write_template(rig);
        let own = read_template(text.as_bytes()).unwrap_or_else(|error| panic!("{error}\n{text}")).notes;
        let told = |note: &ProjectNote| matches!(note, ProjectNote::File(text) if own.contains(text));
        assert!(opened.notes.iter().all(told), "{:?}, but of the rig's own text {own:?}", opened.notes);
    }
}

/// A save that fails leaves the project as it was, or as it was to be.
fn faulty(choices: &mut Choices, disk: &MemoryDisk, project: &ProjectToSave, rig: &Rig) {
    let other = ProjectToSave { name: "other".into(), ..project.clone() };
    let plan = FaultPlan { at: choices.below(60), fault: choices.pick(&Fault::ALL), lasting: choices.chance(2) };
    let failing = FaultyDisk::new(disk.clone(), Some(plan));
    if let Err(error) = store_project(&failing, &at("p.rigsmith.ron"), &other) {
        promises::error(&error);
    }
    drop(failing);
    let now = load_project(disk, &at("p.rigsmith.ron")).unwrap_or_else(|error| panic!("{plan:?}: {error}"));
    assert!(now.name == "made" || now.name == "other", "{plan:?}: {}", now.name);
    assert_eq!(bytes(&now.rigs[0]), bytes(rig), "{plan:?}");
    store_project(disk, &at("p.rigsmith.ron"), project).unwrap_or_else(|error| panic!("{plan:?}: {error}"));
    opened(disk, rig, true);
}
