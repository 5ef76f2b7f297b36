//! The panel of weights: why it cannot run, and the choices of parts and idle joints.

use super::*;

#[test]
fn skinning_says_why_not_runs_once_and_can_be_cancelled() {
    let mut desk = Desk::new(SkinningPanel::default());
    assert!(!desk.find("Skin").enabled);
    desk.app.world_mut().write_message(ActionRequest(Action::Skin));
    desk.frames(2);
    assert!(desk.told().last().is_some_and(|told| told.contains("no mesh")), "{:?}", desk.told());
    // The weights of two hundred thousand points, which do not land during a drag, however fast they are computed.
    let grid: Vec<[[f32; 3]; 2]> = (0..25_000)
        .map(|i| {
            let (x, y, z) = ((i % 30) as f32, (i / 30 % 30) as f32, (i / 900) as f32);
            [[x * 0.03, y * 0.03, z * 0.03], [x * 0.03 + 0.029, y * 0.03 + 0.029, z * 0.03 + 0.029]]
        })
        .collect();
    let mesh = RigMesh::new(Uid(99), boxes(&grid), Vec::new());
    let mesh = desk.app.world_mut().spawn((mesh, SkinOf(desk.rig))).id();
    desk.frames(2);
    assert!(!desk.find("Skin").enabled, "there are no joints");
    desk.chain(&["a", "b"]);
    desk.frames(2);
    crate::bench::begin_drag(&mut desk.app, desk.rig);
    desk.click("Skin");
    desk.frames(2);
    assert!(desk.app.world().get::<SkinningJob>(mesh).is_some(), "it runs");
    desk.app.world_mut().write_message(ActionRequest(Action::Skin));
    desk.frames(2);
    assert!(desk.told().last().is_some_and(|told| told.contains("running")), "{:?}", desk.told());
    assert!(desk.app.world().get::<SkinningJob>(mesh).is_some(), "nothing is lost");
    desk.click("Cancel");
    wait(&mut desk, mesh);
    assert!(desk.rig().skin(Uid(99)).is_none());
    assert!(desk.told().last().is_some_and(|told| told.contains("cancelled")), "{:?}", desk.told());

    desk.app.world_mut().write_message(EditRequest { rig: desk.rig, change: Change::CancelPreview });
    desk.app.world_mut().entity_mut(mesh).despawn();
    let small = RigMesh::new(Uid(98), boxes(&[[[-0.2, 0.0, -0.2], [0.2, 1.0, 0.2]]]), Vec::new());
    let small = desk.app.world_mut().spawn((small, SkinOf(desk.rig))).id();
    desk.frames(2);
    desk.click("Skin");
    wait(&mut desk, small);
    assert!(desk.rig().skin(Uid(98)).is_some());
    assert!(desk.told().last().is_some_and(|told| told.contains("100 %")), "{:?}", desk.told());
}

#[test]
fn wrong_numbers_of_the_settings_are_told() {
    let mut desk = Desk::new(SkinningPanel::default());
    desk.click("Settings");
    // The header unfolds over some frames.
    desk.frames(40);
    let settings = |desk: &Desk| desk.app.world().resource::<SkinningSettings>().0.clone();
    let type_into = |desk: &mut Desk, field: &str, text: &str| {
        desk.click(field);
        desk.type_text(text);
        desk.key(Key::Enter);
        desk.frames(3);
    };
    let before = settings(&desk);
    let wrong = [
        ("Voxels", "5000", "Voxels stays as it was: 5000 is none of its numbers; write one from 32 to 1024."),
        ("Voxels", "many", "Voxels stays as it was: \"many\" is no number; write one such as 1.5 or -20."),
        ("Influences", "2.5", "Influences stays as it was: 2.5 is no whole number; write one such as 3."),
        ("Influences", "0", "Influences stays as it was: 0 is none of its numbers; write one from 1 to 16."),
    ];
    for (field, text, words) in wrong {
        type_into(&mut desk, field, text);
        assert_eq!(settings(&desk), before, "{field} {text}");
        let last = desk
            .app
            .world()
            .resource::<LogBook>()
            .entries()
            .next_back()
            .map(|last| (last.notice.text.clone(), last.times));
        assert_eq!(last, Some((words.to_owned(), 1)));
    }
    // Escape leaves a text behind, for good.
    desk.click("Voxels");
    desk.type_text("48");
    desk.key(Key::Escape);
    desk.frames(3);
    assert_eq!(settings(&desk), before);
    type_into(&mut desk, "Voxels", "64");
    type_into(&mut desk, "Influences", "3");
    assert_eq!((settings(&desk).voxel_resolution, settings(&desk).max_influences), (64, 3));
    assert_eq!(desk.told().len(), wrong.len());
}

#[test]
fn parts_tell_what_holds_them_and_keep_to_choices() {
    let mut desk = Desk::new(SkinningPanel::default());
    desk.resize(320.0, 900.0);
    let boxes = boxes(&[[[-0.2, 0.0, -0.2], [0.2, 1.0, 0.2]], [[-0.1, 1.05, -0.1], [0.1, 1.2, 0.1]]]);
    let mesh = RigMesh::new(Uid(97), boxes, Vec::new());
    let mesh = desk.app.world_mut().spawn((mesh, SkinOf(desk.rig))).id();
    let joints = desk.chain(&["low", "high"]);
    desk.frames(2);
    desk.click("Skin");
    wait(&mut desk, mesh);
    desk.click("Parts (2)");
    desk.frames(30);
    let says =
        |desk: &Desk, text: &str| desk.seen.iter().any(|seen| seen.value.contains(text) || seen.label.contains(text));
    assert!(says(&desk, "Automatic: moves with low"), "{:?}", desk.seen);
    // The joint of a choice holds the object after the next computation.
    desk.select(&joints[1..]);
    let key = (Uid(97), MeshPart::Object(0));
    desk.app.world_mut().resource_mut::<SkinningParts>().0.insert(key, PartBinding::Rigid(joints[1]));
    desk.frames(2);
    assert!(says(&desk, "Moves with high"), "{:?}", desk.seen);
    desk.click("Skin");
    wait(&mut desk, mesh);
    let mesh = desk.app.world().get::<RigMesh>(mesh).unwrap();
    assert_eq!(held_objects(mesh, desk.rig().skin(Uid(97)).unwrap())[0], Some(joints[1]));
}

/// A box clicked free bends after the next computation and can be made rigid again; a joint far above the boxes is idle until
/// it claims skin.
#[test]
fn rigid_parts_and_idle_joints_have_a_choice_each() {
    let mut desk = Desk::new(SkinningPanel::default());
    desk.resize(360.0, 1400.0);
    let boxes = boxes(&[[[-0.2, 0.0, -0.2], [0.2, 1.0, 0.2]], [[-0.1, 1.05, -0.1], [0.1, 1.2, 0.1]]]);
    let mesh = RigMesh::new(Uid(97), boxes, Vec::new());
    let mesh = desk.app.world_mut().spawn((mesh, SkinOf(desk.rig))).id();
    let joints = desk.chain(&["low", "high", "far"]);
    desk.frames(2);
    desk.click("Skin");
    wait(&mut desk, mesh);
    open(&mut desk, "Rigid parts (");
    let rigid = {
        let report = desk.app.world().resource::<SkinningResults>().get(mesh).unwrap().as_ref().unwrap();
        assert!(report.idle_joints.iter().any(|idle| idle.joint == joints[2]), "{report:?}");
        report.rigid_parts.clone()
    };
    assert_eq!(desk.find("rigid").on, Some(true));
    desk.click("rigid");
    desk.frames(2);
    let chosen = desk.app.world().resource::<SkinningParts>().0.clone();
    let [(key, PartBinding::Bends)] = chosen.into_iter().collect::<Vec<_>>()[..] else { panic!("{:?}", desk.seen) };
    let first = rigid.into_iter().find(|rigid| (Uid(97), rigid.part) == key).unwrap();
    desk.click("Skin");
    wait(&mut desk, mesh);
    let bends = |desk: &Desk| {
        let report = desk.app.world().resource::<SkinningResults>().get(mesh).unwrap().as_ref().unwrap();
        let is_rigid = report.rigid_parts.iter().any(|rigid| rigid.part == first.part);
        !is_rigid && report.bending_parts.iter().any(|(part, name)| *part == first.part && *name == first.name)
    };
    assert!(bends(&desk));
    assert_eq!(desk.find("rigid").on, Some(false), "the row stays");
    desk.click("rigid");
    desk.frames(2);
    assert!(desk.app.world().resource::<SkinningParts>().0.is_empty());
    open(&mut desk, "Rigid parts (");
    open(&mut desk, "Idle joints (");
    desk.click("claims skin");
    desk.frames(2);
    assert_eq!(desk.app.world().resource::<SkinningClaims>().0.len(), 1);
    desk.click("claims skin");
    desk.frames(2);
    assert!(desk.app.world().resource::<SkinningClaims>().0.is_empty());
}

/// Spawns a box as a mesh of that name.
fn spawn_named(desk: &mut Desk, uid: u64, name: &str) -> Entity {
    let model =
        rigsmith::mesh::model::Model { name: name.to_owned(), ..boxes(&[[[-0.2, 0.0, -0.2], [0.2, 1.0, 0.2]]]) };
    let mesh = (RigMesh::new(Uid(uid), model, Vec::new()), SkinOf(desk.rig));
    desk.app.world_mut().spawn(mesh).id()
}

/// Weights that were painted on a body are not lost to the skinning of a coat that comes later.
#[test]
fn meshes_with_weights_keep_them_where_another_has_none() {
    let mut desk = Desk::new(SkinningPanel::default());
    let joints = desk.chain(&["a", "b"]);
    let body = spawn_named(&mut desk, 98, "body");
    let points = desk.app.world().get::<RigMesh>(body).unwrap().rest.points.len();
    let mut weights = rigsmith::mesh::model::Weights::default();
    (0..points).for_each(|_| weights.push([(0, 1.0)]));
    let painted = rigsmith::rig::SkinData { joints: vec![joints[1]], weights, at_rest: true, ..default() };
    desk.edit(Operation::Edits(vec![RigEdit::SetSkin(Uid(98), Some(std::sync::Arc::new(painted.clone())))]));
    let coat = spawn_named(&mut desk, 99, "coat");
    desk.frames(2);
    let next = rigsmith::editor::next_step::next_step(desk.app.world()).unwrap();
    assert!(next.contains("coat has no weights yet"), "{next}");
    desk.app.world_mut().write_message(ActionRequest(Action::Skin));
    desk.frames(2);
    wait(&mut desk, coat);
    assert!(desk.rig().skin(Uid(99)).is_some(), "{:?}", desk.told());
    assert_eq!(desk.rig().skin(Uid(98)).map(|skin| &**skin), Some(&painted));
    assert!(desk.told().iter().any(|told| told.starts_with("body keeps its weights.")), "{:?}", desk.told());
    // With weights everywhere, all are computed.
    desk.app.world_mut().write_message(ActionRequest(Action::Skin));
    desk.frames(2);
    wait(&mut desk, body);
    wait(&mut desk, coat);
    assert_ne!(desk.rig().skin(Uid(98)).map(|skin| &**skin), Some(&painted), "{:?}", desk.told());
}

#[test]
fn one_of_several_meshes_is_skinned_alone() {
    let mut desk = Desk::new(SkinningPanel::default());
    desk.chain(&["a", "b"]);
    spawn_named(&mut desk, 98, "body");
    let coat = spawn_named(&mut desk, 99, "coat");
    desk.frames(2);
    desk.click("Skin coat alone");
    wait(&mut desk, coat);
    let bound: Vec<Uid> = desk.rig().skins().map(|(mesh, _)| mesh).collect();
    assert_eq!(bound, [Uid(99)], "{:?}", desk.told());
    desk.app.world_mut().entity_mut(coat).despawn();
    desk.frames(2);
    assert!(desk.look("Skin body alone").is_none(), "the only mesh has the common button");
}
