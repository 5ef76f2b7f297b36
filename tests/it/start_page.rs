//! Start page, tour, help and settings of the window, without the window: pages are drawn as the dock draws them, and clicked.

mod guidance;

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use bevy::{ecs::message::MessageCursor, prelude::*};
use bevy_egui::egui;
use rigsmith::{
    editor::{
        ActiveRig,
        actions::{Action, ActionRequest},
        dock::{Layout, ShowPanel},
        files::{
            FilesPlugin, LoadJob, OpenRequest, RemoveMeshRequest, SaveJob, StateFolder,
            dialog::{Answer, Dialog, DialogAnswer, Question},
            title,
        },
        help::{self, HelpPlugin, HelpShown},
        keys::{Chord, ChosenKey, KeyBindings},
        mode::Mode,
        next_step::next_step,
        notice::Notice,
        palette::{self, PalettePlugin},
        panels::{PanelsPlugin, display::DisplayPanel, log::LogBook, skinning::SkinningPanel},
        recovery::Recovery,
        screen::{HiddenMeshes, ScreenPlugin},
        settings::{EditorSettings, SettingsFolder, SettingsPlugin},
        start::{self, BonePicture, RecentFiles, RecentProblem, StartPage, StartPictures, StartPlugin, Tour, TourStep},
        style::WindowTheme,
    },
    headless::headless_app,
    mesh::model::Weights,
    plugins::{
        drawing::RigDrawing,
        surface::{RigMesh, RigMeshes, SkinOf},
    },
    prelude::*,
    rig::{PoseOffset, RigEdit, SkinData, template::write_template},
    test_app::strict_app,
};

use crate::{
    bench::{HANG, shipped, wait},
    panels::desk::{Desk, Sheet},
};

const SIZE: egui::Vec2 = egui::vec2(1280.0, 720.0);
const PYRAMID: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

/// A window of its own settings and journals, without the window.
struct Page {
    desk: Desk,
    folder: PathBuf,
    cursor: MessageCursor<ShowPanel>,
    /// Panels that were asked for.
    panels: Vec<&'static str>,
}

impl Page {
    fn open(folder: &Path, file: Option<&Path>) -> Self {
        let mut app = headless_app(7);
        app.insert_resource(StateFolder(Some(folder.join("state"))))
            .insert_resource(SettingsFolder(Some(folder.join("config"))))
            .add_plugins((
                FilesPlugin,
                SettingsPlugin,
                ScreenPlugin,
                StartPlugin { file: file.map(Path::to_path_buf) },
                HelpPlugin,
                PalettePlugin,
                PanelsPlugin,
            ))
            .add_message::<AppExit>();
        let desk = Desk::of(strict_app(app), Entity::PLACEHOLDER, Sheet::Window, SIZE);
        let (cursor, panels) = (MessageCursor::default(), Vec::new());
        let mut page = Self { desk, folder: folder.to_owned(), cursor, panels };
        page.settle();
        page
    }

    fn world(&self) -> &World {
        self.desk.app.world()
    }

    fn frame(&mut self) {
        self.desk.frame();
        let asked = self.desk.app.world().resource::<Messages<ShowPanel>>();
        self.panels.extend(self.cursor.read(asked).map(|asked| asked.0));
        // Work that other tests left in the system's folder for temporary files is none of ours.
        let foreign = match self.world().resource::<Dialog>().question() {
            Some(Question::Recover(list)) => list.iter().all(|pending| !pending.path.starts_with(&self.folder)),
            _ => false,
        };
        if foreign {
            self.desk.app.world_mut().write_message(DialogAnswer(Answer::Cancel));
        }
    }

    /// Runs frames until nothing goes on in the background.
    fn settle(&mut self) {
        let start = std::time::Instant::now();
        let mut quiet = 0;
        while quiet < 5 {
            self.frame();
            let world = self.world();
            let busy = world.resource::<LoadJob>().name().is_some()
                || world.resource::<SaveJob>().name().is_some()
                || world.resource::<Recovery>().is_looking();
            quiet = if busy { 0 } else { quiet + 1 };
            assert!(start.elapsed() < HANG, "something never ends");
            std::thread::sleep(Duration::from_millis(2));
        }
        if let Some(active) = self.world().get_resource::<ActiveRig>() {
            self.desk.rig = active.0;
        }
    }

    fn send<M: Message>(&mut self, message: M) {
        self.desk.app.world_mut().write_message(message);
        self.settle();
    }

    fn click(&mut self, label: &str) {
        self.desk.click(label);
        self.settle();
    }

    fn is_shown(&self) -> bool {
        self.world().resource::<StartPage>().is_shown()
    }

    fn mode(&self) -> Mode {
        *self.world().resource::<Mode>()
    }

    /// Name of the open mesh.
    fn mesh(&self) -> Option<String> {
        let mesh = self.world().get::<RigMeshes>(self.desk.rig)?.iter().next()?;
        Some(self.world().get::<RigMesh>(mesh)?.file.name.clone())
    }

    fn mesh_entity(&self) -> Entity {
        self.world().get::<RigMeshes>(self.desk.rig).unwrap().iter().next().unwrap()
    }

    fn settings(&self) -> &EditorSettings {
        self.world().resource::<EditorSettings>()
    }

    fn asks_nothing(&self) -> bool {
        self.world().resource::<Dialog>().question().is_none()
    }

    /// Closes the window, which writes its settings.
    fn quit(mut self) {
        self.send(ActionRequest(Action::Quit));
    }
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a folder for the test")
}

fn write(folder: &Path, name: &str) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, PYRAMID).expect("written");
    path
}

#[test]
fn the_page_appears_without_a_file_and_not_with_one() {
    let folder = folder();
    let mut page = Page::open(folder.path(), None);
    assert!(page.is_shown() && page.mesh().is_none() && page.asks_nothing());
    assert_eq!(title(page.world()), "untitled - Rigsmith");
    let offered = [
        "Rig a character",
        "Build a rig",
        "Make a face",
        "Take the tour",
        "Mesh biped",
        "Mesh hand",
        "Mesh head",
        "Template biped",
        "Template bird",
        "Template hand",
        "Template quadruped",
    ];
    for label in offered {
        assert!(page.desk.look(label).is_some(), "{label} is not among {:?}", page.desk.seen);
    }
    page.send(ActionRequest(Action::Cancel));
    assert!(!page.is_shown() && page.desk.look("Mesh hand").is_none(), "Escape closes it");
    page.send(ActionRequest(Action::StartPage));
    assert!(page.is_shown() && page.desk.look("Mesh hand").is_some(), "its action shows it again");
    // Nothing that cannot be opened closes it.
    page.send(OpenRequest::File(folder.path().join("gone.obj")));
    assert!(page.is_shown());
    let file = write(folder.path(), "box.obj");
    page.send(OpenRequest::File(file.clone()));
    assert!(!page.is_shown() && page.mesh().as_deref() == Some("box"));
    page.quit();

    let mut with_file = Page::open(folder.path(), Some(&file));
    assert!(!with_file.is_shown() && with_file.mesh().as_deref() == Some("box"));
    assert!(with_file.desk.look("Mesh hand").is_none());
    with_file.send(ActionRequest(Action::StartPage));
    with_file.send(OpenRequest::Empty);
    assert!(!with_file.is_shown(), "an empty project is something that was asked for");
}

/// The notice about a first file that cannot be opened goes in a while; the page says how to go on.
#[test]
fn the_page_appears_where_the_first_file_cannot_be_opened() {
    let folder = folder();
    fs::write(folder.path().join("damaged.rig.ron"), "(format: 2, joints: [").unwrap();
    fs::write(folder.path().join("notes.txt"), "no rig").unwrap();
    for name in ["gone.obj", "damaged.rig.ron", "notes.txt"] {
        let mut page = Page::open(folder.path(), Some(&folder.path().join(name)));
        assert!(page.is_shown() && page.desk.look("Mesh hand").is_some(), "{name}: {:?}", page.desk.seen);
        assert_eq!(title(page.world()), "untitled - Rigsmith", "{name}");
        assert!(page.desk.told().iter().any(|told| told.contains(name)), "{name}: {:?}", page.desk.told());
        page.send(ActionRequest(Action::Cancel));
        assert!(!page.is_shown(), "{name}: Escape closes it");
        page.quit();
    }
}

#[test]
fn each_job_leads_where_it_says_without_a_question() {
    let folder = folder();
    let mut page = Page::open(folder.path(), None);
    page.click("Rig a character");
    assert_eq!((page.mesh().as_deref(), page.mode(), page.is_shown()), (Some("biped"), Mode::Stroke, false));
    assert!(page.desk.rig().is_empty() && page.asks_nothing());

    page.send(ActionRequest(Action::StartPage));
    page.click("Build a rig");
    assert_eq!((page.mesh(), page.mode(), page.is_shown()), (None, Mode::Select, false));
    assert!(page.desk.rig().walk().any(|joint| !joint.data.tags.is_empty()) && page.asks_nothing());
    assert!(page.panels.contains(&"Tags"));

    page.send(ActionRequest(Action::StartPage));
    page.click("Make a face");
    assert_eq!((page.mesh().as_deref(), page.mode(), page.is_shown()), (Some("head"), Mode::Pose, false));
    assert!(page.panels.contains(&"Face") && page.asks_nothing());

    // A picture opens what it shows, and leaves the mode.
    page.send(ActionRequest(Action::StartPage));
    page.click("Template hand");
    assert_eq!((page.mode(), page.is_shown()), (Mode::Pose, false));
    assert_eq!(page.desk.rig().len(), shipped("hand").len());

    // A bundled mesh is copied beside the project that uses it.
    page.send(ActionRequest(Action::StartPage));
    page.click("Mesh head");
    page.send(ActionRequest(Action::SaveAs));
    page.send(DialogAnswer(Answer::Path(folder.path().join("face"))));
    let copy = fs::read(folder.path().join("head.obj")).expect("copied");
    assert!(copy == fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/models/head.obj")).unwrap());
    page.send(OpenRequest::File(folder.path().join("face.rigsmith.ron")));
    assert_eq!(page.mesh().as_deref(), Some("head"));
}

/// A template goes onto the open mesh as one step, and undo brings back every byte.
#[test]
fn a_template_is_put_onto_the_open_mesh() {
    let folder = folder();
    let mut page = Page::open(folder.path(), None);
    page.click("Mesh hand");
    let bytes = write_template(page.desk.rig());
    page.send(ActionRequest(Action::StartPage));
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates/hand.rig.ron");
    page.send(OpenRequest::File(file));
    assert!(!page.is_shown() && page.asks_nothing());
    assert_eq!((page.mesh().as_deref(), page.desk.steps()), (Some("hand"), (1, 1)));
    assert_eq!(page.desk.rig().len(), shipped("hand").len());
    change(&mut page, Change::Undo);
    assert_eq!(write_template(page.desk.rig()), bytes);
}

#[test]
fn pictures_show_the_bundled_meshes_and_templates() {
    let folder = folder();
    let mut page = Page::open(folder.path(), None);
    wait(&mut page, "the pictures", Page::frame, |page| {
        page.world().resource::<StartPictures>().model("head").is_some()
    });
    let pictures = page.world().resource::<StartPictures>();
    for name in ["biped", "hand", "head"] {
        let image = pictures.model(name).unwrap();
        let filled = image.pixels.iter().filter(|pixel| pixel.a() > 0).count();
        assert!(10 * filled > image.pixels.len(), "{name}: {filled} pixels");
    }
    for name in ["biped", "bird", "hand", "quadruped"] {
        let (picture, rig) = (pictures.template(name).unwrap(), shipped(name));
        assert_eq!(picture, &BonePicture::of(&rig), "the same every time");
        assert_eq!(picture.joints.len(), rig.len());
        assert!(picture.joints.iter().all(|at| at.cmpge(Vec2::ZERO).all() && at.cmple(Vec2::ONE).all()), "{name}");
    }
    page.desk.frames(2);
    let small = BonePicture::of(&Rig::new(Uid(1), "empty"));
    assert!(small.joints.is_empty() && small.bones.is_empty());
}

#[test]
fn recent_files_are_kept_and_missing_ones_are_grey() {
    let folder = folder();
    let [kept, gone] = ["kept.obj", "gone.obj"].map(|name| write(folder.path(), name));
    let mut first = Page::open(folder.path(), Some(&gone));
    first.send(OpenRequest::File(kept.clone()));
    assert_eq!(first.settings().recent, [kept.clone(), gone.clone()]);
    first.quit();

    fs::remove_file(&gone).expect("removed");
    let mut page = Page::open(folder.path(), None);
    assert_eq!(page.settings().recent, [kept.clone(), gone.clone()], "kept over two runs");
    wait(&mut page, "the look at the files", Page::frame, |page| {
        page.world().resource::<RecentFiles>().list().len() == 2
    });
    page.desk.frames(2);
    let list = page.world().resource::<RecentFiles>().list();
    assert_eq!((list[0].problem, list[1].problem), (None, Some(RecentProblem::Gone)));
    let row = page.desk.find("gone.obj: the file is not there any more");
    assert!(!row.enabled);
    page.desk.click_at(row.rect.center());
    page.settle();
    assert!(page.is_shown() && page.mesh().is_none(), "a click on it does nothing");
    page.click("Remove gone.obj from the list");
    assert_eq!(page.settings().recent, std::slice::from_ref(&kept));
    assert!(page.desk.seen.iter().all(|seen| !seen.label.contains("gone.obj")));
    page.click("Open kept.obj");
    assert!(!page.is_shown() && page.mesh().as_deref() == Some("kept"));

    let mut many = EditorSettings::default();
    (0..20).for_each(|number| many.remember(format!("{number}.obj").into()));
    assert_eq!((many.recent.len(), many.recent[0].clone()), (EditorSettings::RECENT, PathBuf::from("19.obj")));
}

#[test]
fn a_panel_comes_forward() {
    let mut layout = Layout::default();
    assert!(layout.is_forward("Properties") && !layout.is_forward("Skinning"));
    layout.bring_forward("Skinning");
    assert!(layout.is_forward("Skinning") && !layout.is_forward("Properties"));
    layout.toggle("Skinning");
    assert!(!layout.is_forward("Skinning"));
    layout.bring_forward("Skinning");
    assert!(layout.shows("Skinning") && layout.is_forward("Skinning"), "a closed one is opened");
}

/// Weights for all points of a mesh, held by one joint.
fn held_by(joint: Uid, points: usize) -> SkinData {
    let mut weights = Weights::default();
    (0..points).for_each(|_| weights.push(vec![(0, 1.0)]));
    SkinData { joints: vec![joint], weights, at_rest: true, ..Default::default() }
}

fn change(page: &mut Page, change: Change) {
    let rig = page.desk.rig;
    page.send(EditRequest { rig, change });
}

/// A desk with a panel, the switches of the display, a body and its two joints.
fn with_body(sheet: Sheet) -> (Desk, Entity, Vec<Uid>) {
    let mut app = headless_app(1);
    app.add_plugins((PanelsPlugin, ScreenPlugin));
    let mut app = strict_app(app);
    let rig = app.world_mut().spawn(Rig::new(Uid(1), "rig")).id();
    app.insert_resource(ActiveRig(rig));
    let mut desk = Desk::of(app, rig, sheet, egui::vec2(300.0, 900.0));
    let mut model = crate::gestures::boxes(&[[[-0.2, 0.0, -0.2], [0.2, 1.0, 0.2]]]);
    model.name = "body".to_owned();
    let mesh = (RigMesh::new(Uid(97), model, Vec::new()), SkinOf(rig), Visibility::default());
    let mesh = desk.app.world_mut().spawn(mesh).id();
    let joints = desk.chain(&["low", "high"]);
    (desk, mesh, joints)
}

#[test]
fn bones_and_meshes_are_hidden_by_switches() {
    let (mut desk, mesh, joints) = with_body(Sheet::Panel(Box::new(DisplayPanel::default())));
    let visibility = |desk: &Desk| *desk.app.world().get::<Visibility>(mesh).unwrap();
    let drawing = |desk: &Desk| desk.app.world().resource::<RigDrawing>().clone();
    let steps = desk.steps();
    desk.click("Bones");
    desk.frames(2);
    assert!(!drawing(&desk).bones && desk.find("Bones").on == Some(false));
    desk.click("Bones");
    desk.click("Meshes");
    desk.frames(2);
    assert!(drawing(&desk).bones && visibility(&desk) == Visibility::Hidden);
    assert_eq!((desk.find("Meshes").on, desk.find("body").on), (Some(false), Some(false)));
    // One of them, by itself.
    desk.click("body");
    desk.frames(2);
    assert_eq!((visibility(&desk), desk.find("Meshes").on), (Visibility::Inherited, Some(true)));
    desk.click("body");
    desk.frames(2);
    assert_eq!(visibility(&desk), Visibility::Hidden);
    assert!(!desk.app.world().resource::<HiddenMeshes>().all);
    desk.click("Meshes");
    desk.frames(2);
    assert_eq!(visibility(&desk), Visibility::Inherited, "the common switch shows all");

    desk.click("Joints that deform");
    desk.frames(2);
    assert!(drawing(&desk).deforming && desk.says("No joint moves a point yet: skin the mesh first."));
    let points = desk.app.world().get::<RigMesh>(mesh).unwrap().rest.points.len();
    let skin = RigEdit::SetSkin(Uid(97), Some(Arc::new(held_by(joints[0], points))));
    desk.edit(Operation::Edits(vec![skin]));
    assert!(desk.says("1 of 2 joints moves points of a mesh."), "{:?}", desk.seen);
    assert_eq!(desk.steps().0, steps.0 + 1, "showing and hiding is no step");
}

/// Meshes that the panel asks to remove.
#[derive(Resource, Default)]
struct Removals(Vec<Uid>);

#[test]
fn one_of_several_meshes_can_be_removed() {
    let (mut desk, ..) = with_body(Sheet::Panel(Box::new(DisplayPanel::default())));
    desk.app.init_resource::<Removals>().add_message::<RemoveMeshRequest>();
    desk.app.add_systems(Last, |mut asked: MessageReader<RemoveMeshRequest>, mut removals: ResMut<Removals>| {
        removals.0.extend(asked.read().map(|request| request.0));
    });
    desk.frames(2);
    assert!(desk.look("Remove body").is_none(), "the only mesh stays");
    let mut model = crate::gestures::boxes(&[[[-0.2, 0.0, -0.2], [0.2, 1.0, 0.2]]]);
    model.name = "coat".to_owned();
    let rig = desk.rig;
    desk.app.world_mut().spawn((RigMesh::new(Uid(98), model, Vec::new()), SkinOf(rig), Visibility::default()));
    desk.frames(2);
    desk.click("Remove coat");
    desk.frames(2);
    assert_eq!(desk.app.world().resource::<Removals>().0, [Uid(98)]);
    assert_eq!((desk.find("body").on, desk.find("coat").on), (Some(true), Some(true)), "nothing is hidden by it");
}

/// Weights whose joints are gone are no weights.
#[test]
fn nothing_stale_is_told_of_weights_without_joints() {
    let (mut desk, mesh, joints) = with_body(Sheet::Panel(Box::new(SkinningPanel::default())));
    let points = desk.app.world().get::<RigMesh>(mesh).unwrap().rest.points.len();
    let skin = RigEdit::SetSkin(Uid(97), Some(Arc::new(held_by(joints[0], points))));
    desk.edit(Operation::Edits(vec![skin]));
    let all = format!("100 % of {points} points have weights");
    assert!(desk.says(&all), "{:?}", desk.seen);
    let next = |desk: &Desk| next_step(desk.app.world()).unwrap_or_default();
    assert!(next(&desk).contains("poses"), "{}", next(&desk));
    desk.edit(Operation::Delete { joints: joints.clone(), keep_children: true });
    desk.frames(2);
    assert!(!desk.says(&all) && !next(&desk).contains("poses"), "{:?}", desk.seen);
    assert!(desk.says("The joints of its weights are gone: undo, or make joints and skin again."));
    desk.chain(&["other"]);
    desk.frames(2);
    assert!(next(&desk).contains("no weights yet"), "{}", next(&desk));
    desk.undo(3);
    assert!(desk.says(&all), "undo brings them back");
}
