//! The Face panel: a click makes a face, sliders pose it, the merge history is there to be cut.

use std::path::PathBuf;

use bevy::prelude::*;
use bevy_egui::egui;
use rigsmith::{
    algo::face::{auto::AutoSettings, bones::FaceBoneKind},
    editor::panels::face::FacePanel,
    files::{RealDisk, load_model},
    plugins::{
        document::{Change, EditRequest},
        face::{Expressions, Face, FaceJob, FaceRequest, FaceRig, PlacedBone},
        surface::{RigMesh, SkinOf},
    },
    prelude::*,
    rig::FaceCut,
};

use super::desk::{Desk, Sheet, ShownWidget};

/// The panel, tall enough for all of it, and the bundled head.
fn with_head() -> (Desk, Entity) {
    opened(None)
}

/// The panel with the bundled head, which belongs to a rig, or to an empty one.
fn opened(rig: Option<Rig>) -> (Desk, Entity) {
    let mut desk = Desk::with(Sheet::Panel(Box::new(FacePanel::default())), egui::vec2(320.0, 1400.0));
    let entity = desk.rig;
    if let Some(rig) = rig {
        desk.app.world_mut().entity_mut(entity).insert(rig);
    }
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/models/head.obj");
    let mesh = RigMesh::new(Uid(99), load_model(&RealDisk, &path).unwrap(), Vec::new());
    let mesh = desk.app.world_mut().spawn((mesh, SkinOf(desk.rig))).id();
    desk.frames(2);
    (desk, mesh)
}

/// Where a word is written.
fn written(desk: &Desk, word: &str) -> Option<egui::Rect> {
    desk.seen.iter().find(|seen| seen.value == word || seen.label == word).map(|seen| seen.rect)
}

/// The number of bones beside its slider.
fn number(desk: &Desk) -> ShownWidget {
    let row = written(desk, "Bones").expect("the density").center().y;
    let is_it = |seen: &&ShownWidget| seen.rect.y_range().contains(row) && seen.value.parse::<f32>().is_ok();
    desk.seen.iter().find(is_it).expect("its number").clone()
}

/// The rail of the slider of happiness, and the number beside it.
pub(super) fn happiness(desk: &Desk) -> [egui::Rect; 2] {
    let happiness = written(desk, "Happiness").expect("a slider for happiness");
    let below = happiness.bottom()..happiness.bottom() + 30.0;
    let number = desk
        .seen
        .iter()
        .filter(|seen| below.contains(&seen.rect.center().y) && seen.value.parse::<f32>().is_ok())
        .min_by(|a, b| a.rect.left().total_cmp(&b.rect.left()))
        .expect("a number below the name")
        .rect;
    // The rail lies before the number that it sets.
    [egui::Rect::from_x_y_ranges(happiness.left()..=number.left() - 8.0, number.y_range()), number]
}

/// Number of expressions of which the panel has drawn pictures.
pub(super) fn pictures(desk: &Desk) -> usize {
    let textures = desk.ctx.tex_manager();
    let textures = textures.read();
    textures.allocated().filter(|(_, texture)| texture.name.starts_with("face ")).count()
}

pub(super) fn wait(desk: &mut Desk, mesh: Entity) {
    desk.frame();
    crate::bench::wait(desk, "the face", Desk::frame, |desk| {
        desk.app.world().get::<FaceJob>(mesh).is_none() && desk.look("Cancel").is_none()
    });
    desk.frames(12);
}

#[test]
fn without_a_mesh_it_says_what_to_do() {
    let mut desk = Desk::new(FacePanel::default());
    desk.frames(2);
    assert!(desk.seen.iter().any(|seen| seen.value.starts_with("Open a head")), "{:?}", desk.seen);
}

#[test]
fn a_click_makes_a_face_that_sliders_pose() {
    let (mut desk, mesh) = with_head();
    assert!(written(&desk, "Regions").is_none(), "there is no face yet");
    desk.click("Place face");
    wait(&mut desk, mesh);
    assert!(FaceRig::read(desk.rig()).bones.len() >= 40);
    assert!(desk.told().iter().any(|told| told.contains("facial bones")), "{:?}", desk.told());
    assert!(desk.look("Place again").is_some() && written(&desk, "Regions").is_some(), "{:?}", desk.seen);
    assert_eq!(desk.steps().0, 1, "one step of the history");

    // A region selects its bones.
    let lips = desk.seen.iter().find(|seen| seen.label.starts_with("lip ")).expect("lips have bones").label.clone();
    desk.click(&lips);
    desk.frames(2);
    let count: usize = lips["lip ".len()..].parse().unwrap();
    assert_eq!(desk.selected().len(), count);

    // An expression is one step, however long its slider is dragged.
    let [slider, number] = happiness(&desk);
    let at = |share: f32| egui::pos2(slider.left() + share * slider.width(), slider.center().y);
    desk.drag(at(0.02), at(0.6));
    desk.until("the step of the drag", |desk| desk.steps().0 == 2);
    desk.frames(4);
    let shown = desk.app.world().get::<Expressions>(mesh).cloned().unwrap_or_default();
    assert!(shown.0.get("happiness").is_some_and(|strength| *strength > 0.2), "{shown:?}");
    assert!(!desk.rig().pose().is_empty(), "{:?} {:?} {shown:?}", desk.steps(), desk.told());
    assert_eq!(desk.steps().0, 2, "the drag is one step");
    // The strength is part of the document: undo and redo move the slider with the face.
    let strengths = |desk: &Desk| desk.app.world().get::<Expressions>(mesh).cloned().unwrap_or_default();
    desk.app.world_mut().write_message(EditRequest { rig: desk.rig, change: Change::Undo });
    desk.frames(4);
    assert!(strengths(&desk).0.is_empty() && desk.rig().pose().is_empty(), "{:?}", strengths(&desk));
    desk.app.world_mut().write_message(EditRequest { rig: desk.rig, change: Change::Redo });
    desk.frames(4);
    assert_eq!(strengths(&desk), shown);
    assert!(!desk.rig().pose().is_empty());
    assert_eq!(desk.steps(), (2, 2), "showing what the document says is no edit");
    let (reopened, head) = opened(Some(desk.rig().clone()));
    assert_eq!(reopened.app.world().get::<Expressions>(head), Some(&shown), "an opened face has its strengths");
    desk.click("Reset");
    desk.until("the step of the reset", |desk| desk.steps().1 == 3);
    desk.frames(4);
    assert!(desk.rig().pose().is_empty(), "back at rest");

    // Escape drops the drag: the face and the slider go back, and no step is made.
    let steps = desk.steps();
    desk.time += 1.0;
    desk.press(at(0.02));
    desk.move_to(at(0.3));
    desk.move_to(at(0.6));
    desk.until("a drag that is seen", |desk| !desk.rig().pose().is_empty());
    desk.key(egui::Key::Escape);
    desk.move_to(at(0.7));
    desk.release(at(0.7));
    desk.frames(4);
    assert!(desk.rig().pose().is_empty() && strengths(&desk).0.is_empty(), "{:?}", strengths(&desk));
    assert_eq!(desk.steps(), steps);

    // What is typed is one step, and what is no strength is told.
    let type_in = |desk: &mut Desk, text: &str| {
        desk.time += 1.0;
        desk.click_at(number.center());
        desk.frames(2);
        desk.type_text(text);
        desk.key(egui::Key::Enter);
        desk.frames(4);
    };
    for (text, words) in [("much", "is no number"), ("70", "is none of its numbers")] {
        type_in(&mut desk, text);
        assert!(desk.told().last().is_some_and(|told| told.contains(words)), "{text}: {:?}", desk.told());
        assert_eq!(desk.steps(), steps, "{text}");
    }
    type_in(&mut desk, "0.75");
    desk.until("the step of the number", |desk| desk.steps().0 > steps.0);
    desk.frames(4);
    assert_eq!(strengths(&desk).0.get("happiness"), Some(&0.75));
    assert_eq!(desk.steps(), (steps.0 + 1, steps.1 + 1));
}

/// A face that is opened from a file has the density that it was placed with, and is placed again with it.
#[test]
fn the_density_is_that_of_the_opened_face() {
    let number_of_bones = |desk: &Desk| {
        let row = written(desk, "Bones").expect("the density").center().y;
        let mut in_row = desk.seen.iter().filter(|seen| seen.rect.y_range().contains(row));
        in_row.find_map(|seen| seen.value.parse::<f32>().ok()).expect("its number")
    };
    let (mut desk, mesh) = with_head();
    assert_eq!(number_of_bones(&desk), 40.0);
    let settings = AutoSettings { bones: 24, ..AutoSettings::default() };
    desk.app.world_mut().write_message(FaceRequest { mesh, settings, fit: None });
    wait(&mut desk, mesh);
    let is_skin = |bone: &&PlacedBone| bone.kind == FaceBoneKind::Skin;
    let count = FaceRig::read(desk.rig()).bones.iter().filter(is_skin).count();
    assert!((4..36).contains(&count), "{count} bones");
    assert_eq!(desk.rig().face_cut(Uid(99)), Some(FaceCut { bones: 24, groups: None }));
    assert_eq!(number_of_bones(&desk), 24.0, "the panel follows the document");
    let (mut reopened, _) = opened(Some(desk.rig().clone()));
    assert_eq!(number_of_bones(&reopened), 24.0);
    reopened.until("the pictures of an opened face", |desk| pictures(desk) == 6);
    // A document of an older version has only the bones.
    let mut older = desk.rig().clone();
    older.apply(&RigEdit::SetFaceCut(Uid(99), None)).unwrap();
    let (reopened, _) = opened(Some(older));
    assert_eq!(number_of_bones(&reopened), count as f32);
    // What undo takes back, the panel takes back.
    desk.app.world_mut().write_message(EditRequest { rig: desk.rig, change: Change::Undo });
    desk.frames(4);
    assert_eq!((desk.rig().face_cut(Uid(99)), number_of_bones(&desk)), (None, 40.0));
}

#[test]
fn a_number_of_bones_that_cannot_be_is_told() {
    let (mut desk, mesh) = with_head();
    let type_in = |desk: &mut Desk, text: &str| {
        desk.time += 1.0;
        desk.click_at(number(desk).rect.center());
        desk.frames(2);
        desk.type_text(text);
        desk.key(egui::Key::Enter);
        desk.frames(4);
    };
    for (text, words) in [
        ("900", "900 is none of its numbers; write one from 4 to 150"),
        ("12.5", "12.5 is no whole number; write one such as 3"),
        ("some", "\"some\" is no number; write one such as 1.5 or -20"),
    ] {
        type_in(&mut desk, text);
        assert_eq!(desk.told().pop(), Some(format!("Bones stays as it was: {words}.")));
        assert_eq!((number(&desk).value.as_str(), desk.rig().face_cut(Uid(99))), ("40", None), "{text}");
    }
    type_in(&mut desk, "24");
    assert_eq!(desk.rig().face_cut(Uid(99)), Some(FaceCut { bones: 24, groups: None }));
    assert!(desk.app.world().get::<FaceJob>(mesh).is_none(), "there is no face yet that is placed again");
}

/// Of several meshes, the first one with a face is shown, until another is chosen.
#[test]
fn the_face_of_each_mesh_is_shown() {
    let (mut desk, first) = with_head();
    assert!(desk.look("Mesh").is_none(), "there is one mesh");
    let mut second = desk.app.world().get::<RigMesh>(first).unwrap().clone();
    second.uid = Uid(98);
    desk.app.world_mut().spawn((second, SkinOf(desk.rig)));
    desk.frames(2);
    assert_eq!(number(&desk).value, "40");
    let cut = RigEdit::SetFaceCut(Uid(98), Some(FaceCut { bones: 24, groups: None }));
    desk.edit(Operation::Edits(vec![cut]));
    assert_eq!(number(&desk).value, "24");
    // Both have one name, and so a number.
    let name = desk.app.world().get::<RigMesh>(first).unwrap().file.name.clone();
    assert!(!name.is_empty());
    desk.click("Mesh");
    desk.frames(2);
    let entry = desk.seen.iter().find(|seen| seen.label == name && seen.clickable).expect("an entry").rect.center();
    desk.click_at(entry);
    desk.frames(3);
    assert_eq!(number(&desk).value, "40");
    desk.click("Place face");
    wait(&mut desk, first);
    assert!(desk.app.world().get::<Face>(first).is_some());
    // The usual number of bones is none of the document's.
    assert_eq!([99, 98].map(|mesh| desk.rig().face_cut(Uid(mesh)).map(|cut| cut.bones)), [None, Some(24)]);
}

#[test]
fn the_merge_history_can_be_cut() {
    let (mut desk, mesh) = with_head();
    desk.click("Place face");
    wait(&mut desk, mesh);
    let groups_of = |desk: &Desk, mesh: Entity| desk.app.world().get::<Face>(mesh).unwrap().analysis.groups.groups;
    let groups = |desk: &Desk| groups_of(desk, mesh);
    let before = groups(&desk);
    assert!(before >= 3);
    desk.click("Grouping");
    desk.frames(20);
    assert!(written(&desk, "groups").is_some(), "{:?}", desk.seen);
    assert!(written(&desk, HINT_AUTO).is_some(), "{:?}", desk.seen);
    // Its colours and its ends have names.
    let key = ["Front to back:", "⏺ face", "⏺ middle", "⏺ back", "- - cut"].map(|word| written(&desk, word).is_some());
    assert_eq!(key, [true; 5], "{:?}", desk.seen);
    // Near the roots of the tree all merges that are drawn are undone.
    let tree = desk.find("Merge history").rect;
    desk.click_at(egui::pos2(tree.left() + 60.0, tree.bottom() - 10.0));
    desk.frames(2);
    assert!(written(&desk, HINT_BY_HAND).is_some(), "{:?}", desk.seen);
    // The cut is a step of the document, which the panel follows.
    assert_eq!(desk.steps(), (2, 2));
    let cut = desk.rig().face_cut(Uid(99)).expect("a cut").groups;
    assert!(cut.is_some_and(|groups| groups as usize > before), "{cut:?}");
    for (change, hint) in [(Change::Undo, HINT_AUTO), (Change::Redo, HINT_BY_HAND)] {
        desk.app.world_mut().write_message(EditRequest { rig: desk.rig, change });
        desk.frames(4);
        assert!(written(&desk, hint).is_some(), "{hint}: {:?}", desk.seen);
    }
    desk.click("Place again");
    wait(&mut desk, mesh);
    let deep = groups(&desk);
    // Opened again, the head is grouped by the cut of the document.
    let (mut reopened, again) = opened(Some(desk.rig().clone()));
    crate::bench::wait(&mut reopened, "the face that was opened", Desk::frame, |desk| {
        desk.app.world().get::<Face>(again).is_some()
    });
    assert_eq!(groups_of(&reopened, again), deep);
    assert_eq!(reopened.steps(), (0, 0), "showing what the document says is no edit");
    assert!(deep > before && deep > 10, "{before} groups became {deep}");
    // Cut near its top, and left to the mesh again.
    let tree = desk.find("Merge history").rect;
    desk.click_at(egui::pos2(tree.left() + 60.0, tree.top() + 22.0));
    desk.frames(2);
    desk.click("Place again");
    wait(&mut desk, mesh);
    let shallow = groups(&desk);
    assert!(shallow < before.max(4), "{deep} groups became {shallow}");
}

const HINT_AUTO: &str = "Cut where every feature lies in the face. Front groups are joined.";
const HINT_BY_HAND: &str = "Cut by hand; place again to use it. The front groups that hold features are joined.";
