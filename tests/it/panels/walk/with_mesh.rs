//! Actions of the Loader and those on meshes, and the panels of meshes: a mesh with weights is open, and a template of a folder
//! is chosen.

use rigsmith::{mesh::model::Weights, rig::SkinData};

use super::{of_library::choose, *};
use crate::gestures::boxes;

const MESH: Uid = Uid(0xA1_0003);
const COAT: Uid = Uid(0xA1_0004);

/// The walked app with a mesh that is bound to the joints.
fn with_mesh(panel: Box<dyn EditorPanel>, size: egui::Vec2) -> Walk {
    let mut walk = Walk::new(panel, size);
    let mesh = RigMesh::new(MESH, boxes(&[[[-1.2, 0.8, -0.2], [1.2, 1.2, 0.2]]]), Vec::new());
    walk.desk.app.world_mut().spawn((mesh, SkinOf(walk.desk.rig)));
    let mut weights = Weights { starts: vec![0], ..Weights::default() };
    (0..8).for_each(|point| weights.push([(0, 0.6), (1, 0.2 + 0.01 * point as f32)]));
    let skin = SkinData { joints: JOINTS.to_vec(), weights, at_rest: true, ..SkinData::default() };
    walk.desk.edit(Operation::Edits(vec![RigEdit::SetSkin(MESH, Some(Arc::new(skin)))]));
    walk.rest();
    assert!(walk.desk.rig().skin(MESH).is_some(), "{:?}", walk.desk.told());
    walk
}

#[test]
fn actions_of_the_loader_and_on_meshes_are_taken_back_by_undo() {
    let mut walk = with_mesh(Box::new(HierarchyPanel::default()), egui::vec2(360.0, 600.0));
    choose(&mut walk, "prop");
    for action in Action::all() {
        if OF_FILES.contains(&action) {
            continue;
        }
        // What an action left of the window is none of the next one's.
        walk.desk.app.world_mut().write_message(StageRequest { rig: walk.desk.rig, stage: RigStage::Built });
        walk.rest();
        walk.ready();
        // A template that is fitted is loaded, and then fitted.
        let most = if action == Action::Library(LibraryAction::Fit) { 2 } else { 1 };
        walk.check(&format!("{action:?}"), most, |desk| {
            desk.app.world_mut().write_message(ActionRequest(action));
            desk.frames(4);
        });
    }
    assert!(walk.wrong.is_empty(), "{} are wrong:\n{}", walk.wrong.len(), walk.wrong.join("\n"));
    for action in [
        Action::Skin,
        Action::Library(LibraryAction::DeleteRig),
        Action::Library(LibraryAction::Load),
        Action::Library(LibraryAction::Merge),
    ] {
        let told = walk.desk.told();
        assert!(walk.made.contains(&format!("{action:?}")), "{action:?} made no step: {:?}, {told:?}", walk.made);
    }
}

#[test]
fn all_that_panels_of_meshes_do_is_taken_back_by_undo() {
    let size = egui::vec2(360.0, 2000.0);
    let panels: [(&str, Box<dyn EditorPanel>); 3] = [
        ("Skinning", Box::new(SkinningPanel::default())),
        ("Weights", Box::new(WeightsPanel::default())),
        ("Face", Box::new(FacePanel::default())),
    ];
    let (mut wrong, mut made) = (Vec::new(), BTreeSet::new());
    for (name, panel) in panels {
        let mut walk = with_mesh(panel, size);
        walk.crawl(name);
        wrong.append(&mut walk.wrong);
        made.append(&mut walk.made);
    }
    assert!(wrong.is_empty(), "{} are wrong:\n{}", wrong.len(), wrong.join("\n"));
    for panel in ["Skinning: ", "Weights: "] {
        assert!(made.iter().any(|made| made.starts_with(panel)), "{panel}nothing made a step: {made:?}");
    }
}

/// Meshes that are removed come back with their weights.
#[test]
fn a_mesh_that_the_display_panel_removes_comes_back_by_undo() {
    let mut walk = with_mesh(Box::new(DisplayPanel::default()), egui::vec2(360.0, 2000.0));
    let mut model = boxes(&[[[-0.2, 0.0, -0.2], [0.2, 1.0, 0.2]]]);
    model.name = "coat".to_owned();
    let coat = RigMesh::new(COAT, model, Vec::new());
    let rig = walk.desk.rig;
    walk.desk.app.world_mut().spawn((coat, SkinOf(rig)));
    walk.rest();
    let meshes = |walk: &mut Walk| {
        let world = walk.desk.app.world_mut();
        let mut query = world.query::<&RigMesh>();
        query.iter(world).map(|mesh| mesh.uid).collect::<BTreeSet<Uid>>()
    };
    walk.crawl("Display");
    assert!(walk.wrong.is_empty(), "{} are wrong:\n{}", walk.wrong.len(), walk.wrong.join("\n"));
    let removals = walk.made.iter().filter(|made| made.starts_with("Display: Remove ")).count();
    assert_eq!(removals, 2, "{:?}, {:?}", walk.made, walk.desk.told());
    assert_eq!(meshes(&mut walk), BTreeSet::from([MESH, COAT]));
}
