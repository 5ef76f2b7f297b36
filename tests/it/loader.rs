//! The Loader panel, the Part menu and the library behind them: templates found, loaded, merged, injected, dropped and written.

#[cfg(feature = "cli")]
mod authoring;
mod dropping;
mod landing;
mod listing;
mod older_projects;
mod saving;
mod sides;

use std::{
    fs,
    path::{Path, PathBuf},
    time::Duration,
};

use bevy::prelude::*;
use bevy_egui::egui;
use rigsmith::{
    algo::view::{View, ViewPlane},
    editor::{
        ActiveRig,
        actions::{Action, ActionRequest},
        camera::ViewportSight,
        files::{FilesPlugin, LoadJob, OpenRequest, SaveJob, StateFolder},
        follow::FollowPlugin,
        library::{
            ChosenTemplate, DraggedModule, DraggedTemplate, LibraryAct, LibraryAction, LibraryFolders, LibraryJobs,
            LibraryPictures, LibraryRequest, SaveTemplate, TemplateContent, TemplateDraft, TemplateLibrary,
            TemplatePicture, TemplateSave, obstacle,
        },
        palette,
        panel::{EditorPanel, Requests},
        panels::{PanelsPlugin, hierarchy::HierarchyPanel, loader::LoaderPanel, tags::TagsPanel},
        recovery::Recovery,
        result_queue::HeldPlugin,
        running_work::{RunningWorkPlugin, StopWork, StoppableWork, running},
    },
    files::{RealDisk, SearchPaths, TemplatePlace, load_template},
    headless::headless_app,
    instance::RigSource,
    plugins::{document::Change, fit::FittedRig, stage::RigStage, surface::RigMeshes, viewport::Sight},
    prelude::*,
    rig::{
        PoseOffset, TagKind, Uid,
        operations::ClipOperation,
        template::{read_header, write_template},
    },
    test_app::strict_app,
};

use super::{
    panels::desk::{Desk, Sheet},
    window_app::decline_foreign_offers,
};

/// A part of the left side, with a group, a feature, an option and a socket.
const LIMB: &str = r#"(
    format: 2,
    name: "limb",
    version: "1.0.0",
    kind: "part",
    author: "Anna",
    description: "An upper and a lower bone.",
    sockets: [(name: "end", joint: "lower_l")],
    options: [(name: "size", default: 0.5, sets: [(tag: "control/upper_l", param: "size")])],
    groups: [(name: "limb_l")],
    joints: [
        (
            label: "upper_l",
            group: "limb_l",
            tags: [Feature(kind: "fk", name: "fk"), control(feature: "fk", size: 0.5)],
        ),
        (label: "lower_l", parent: "upper_l", group: "limb_l", translation: (0, -0.3, 0), tags: [null()]),
    ],
)
"#;

const MAN: &str = r#"(
    format: 2,
    name: "man",
    version: "1.0.0",
    joints: [
        (label: "hips", translation: (0, 1, 0), tags: [control(size: 0.5)]),
        (label: "arm_l", parent: "hips", translation: (0.2, 0.4, 0)),
        (label: "elbow_l", parent: "arm_l", translation: (0, -0.3, 0)),
        (label: "arm_r", parent: "hips", translation: (-0.2, 0.4, 0)),
        (label: "elbow_r", parent: "arm_r", translation: (0, -0.3, 0)),
    ],
)
"#;

/// The Hierarchy and the Loader, side by side.
#[derive(Default)]
struct Both(HierarchyPanel, LoaderPanel);

impl EditorPanel for Both {
    fn title(&self) -> &'static str {
        "Both"
    }

    fn show(&mut self, ui: &mut egui::Ui, world: &World, requests: &mut Requests) {
        let Self(hierarchy, loader) = self;
        ui.columns_const(|[left, right]| {
            hierarchy.show(left, world, requests);
            loader.show(right, world, requests);
        });
    }
}

/// A window without the window: the man's template is open, and the folder of the site has a limb and another man.
struct Studio {
    desk: Desk,
    site: PathBuf,
    folder: tempfile::TempDir,
}

impl Studio {
    fn new(panel: impl EditorPanel) -> Self {
        Self::with(Sheet::Panel(Box::new(panel)))
    }

    fn with(sheet: Sheet) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let site = folder.path().join("site");
        let home = folder.path().join("home");
        fs::create_dir_all(site.join("limbs")).unwrap();
        fs::create_dir_all(&home).unwrap();
        fs::write(site.join("limbs").join("limb.rig.ron"), LIMB).unwrap();
        let other = MAN.replace("(0, 1, 0)", "(0, 1.5, 0)").replace("\"1.0.0\"", "\"2.0.0\"");
        fs::write(site.join("tall_man.rig.ron"), other.replace("name: \"man\"", "name: \"tall_man\"")).unwrap();
        fs::write(home.join("man.rig.ron"), MAN).unwrap();
        let mut app = headless_app(7);
        app.insert_resource(StateFolder(Some(folder.path().join("state"))))
            .insert_resource(LibraryFolders(Some(SearchPaths { folders: vec![site.clone()] })))
            .add_plugins((
                FilesPlugin,
                FollowPlugin,
                PanelsPlugin,
                HeldPlugin,
                RunningWorkPlugin,
                decline_foreign_offers,
            ))
            .add_message::<AppExit>();
        let size = egui::vec2(620.0, 1400.0);
        let desk = Desk::of(strict_app(app), Entity::PLACEHOLDER, sheet, size);
        let mut studio = Self { desk, site, folder };
        studio.open(OpenRequest::File(studio.man()));
        studio.desk.until("the followed file", |desk| {
            desk.app.world().get::<RigSource>(desk.rig).is_some_and(|source| source.base().is_some())
        });
        studio
    }

    fn man(&self) -> PathBuf {
        self.folder.path().join("home").join("man.rig.ron")
    }

    fn limb(&self) -> TemplatePlace {
        TemplatePlace::File(self.site.join("limbs").join("limb.rig.ron"))
    }

    fn tall(&self) -> TemplatePlace {
        TemplatePlace::File(self.site.join("tall_man.rig.ron"))
    }

    fn world(&self) -> &World {
        self.desk.app.world()
    }

    /// Opens a document and runs frames until nothing is read or written.
    fn open(&mut self, request: OpenRequest) {
        let before = self.world().get_resource::<ActiveRig>().copied();
        self.desk.app.world_mut().write_message(request);
        self.desk.until("the document", |desk| desk.app.world().get_resource::<ActiveRig>().copied() != before);
        self.settle();
    }

    fn settle(&mut self) {
        let mut quiet = 0;
        while quiet < 5 {
            self.desk.frame();
            let world = self.world();
            let busy = world.resource::<LoadJob>().name().is_some()
                || world.resource::<SaveJob>().name().is_some()
                || world.resource::<Recovery>().is_looking()
                || world.resource::<LibraryJobs>().name().is_some()
                || world.resource::<TemplateSave>().is_writing()
                || world.resource::<TemplateLibrary>().is_listing();
            quiet = if busy { 0 } else { quiet + 1 };
            std::thread::sleep(Duration::from_millis(1));
        }
        self.desk.rig = self.world().resource::<ActiveRig>().0;
        self.desk.frames(2);
    }

    fn send<M: Message>(&mut self, message: M) {
        self.desk.app.world_mut().write_message(message);
        self.desk.frames(2);
        self.settle();
    }

    fn click(&mut self, label: &str) {
        self.desk.click(label);
        self.settle();
    }

    fn change(&mut self, change: Change) {
        let rig = self.desk.rig;
        self.send(EditRequest { rig, change });
    }

    fn act(&mut self, place: TemplatePlace, act: LibraryAct) {
        self.send(LibraryRequest { place, act });
    }

    fn joint(&self, label: &str) -> Uid {
        self.desk.rig().find_label(label).unwrap_or_else(|| panic!("no joint {label}"))
    }

    fn height(&self, label: &str) -> f32 {
        self.desk.rig().joint(self.joint(label)).unwrap().data.rest.translation.y
    }

    fn text(&self) -> String {
        write_template(self.desk.rig())
    }

    /// Names of the tiles that are seen.
    fn tiles(&self) -> Vec<&str> {
        let labels = self.desk.seen.iter().map(|seen| seen.label.as_str());
        labels.filter(|label| label.starts_with("Template ") || label.starts_with("Part ")).collect()
    }

    fn told(&self, part: &str) -> bool {
        self.desk.told().iter().any(|told| told.contains(part))
    }

    fn source_file(&self) -> Option<String> {
        let source = self.world().get::<RigSource>(self.desk.rig)?;
        source.base().map(|base| base.about().name.clone())
    }
}

#[test]
fn a_template_is_loaded_with_poses_and_keys_kept_and_taken_back_whole() {
    let mut studio = Studio::new(LoaderPanel::default());
    let arm = studio.joint("arm_l");
    let bent = PoseOffset { rotation: Quat::from_rotation_z(0.5), ..PoseOffset::IDENTITY };
    studio.desk.edit(Operation::Pose(vec![(arm, bent)]));
    studio.desk.edit(Operation::StorePose("bent".to_owned()));
    let create = ClipOperation::Create { name: "wave".to_owned(), frame_rate: 24.0, range: [0.0, 1.0] };
    studio.desk.edit(Operation::Clips(create));
    let clip = studio.desk.rig().clips()[0].uid;
    let key = Operation::Pose(vec![(arm, PoseOffset { rotation: Quat::from_rotation_z(0.7), ..bent })]);
    studio.desk.edit(Operation::Keyed { operation: Box::new(key), clip, layer: None, time: 0.5 });
    let (before, steps) = (studio.desk.rig().clone(), studio.desk.steps().1);
    assert!(before.clip(clip).unwrap().key_count() > 0);
    studio.settle();
    studio.click("Template tall man");
    assert!(studio.desk.says("2.0.0 · 5 joints"), "{:?}", studio.desk.seen);
    studio.click("Load");
    assert_eq!((studio.height("hips"), studio.desk.steps().1), (1.5, steps + 1), "{:?}", studio.desk.told());
    let loaded = studio.desk.told().iter().filter(|told| told.starts_with("Loaded ")).count();
    assert_eq!(loaded, 1, "told once, when it is done: {:?}", studio.desk.told());
    let after = studio.desk.rig().clone();
    let turned = |rig: &rigsmith::rig::Rig| rig.clip(clip).unwrap().sample(0.5).offsets[&arm].rotation;
    assert_eq!(after.clip(clip).unwrap().key_count(), before.clip(clip).unwrap().key_count(), "keys stay");
    assert!(turned(&after).angle_between(turned(&before)) < 1e-3);
    let names = |rig: &rigsmith::rig::Rig| rig.stored_poses().iter().map(|pose| pose.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&after), ["bent"], "stored poses stay");
    let posed = [&after, &before].map(|rig| rig.pose()[&arm].rotation);
    assert!(posed[0].angle_between(posed[1]) < 1e-3, "the pose stays");
    assert_eq!(after.about().name, "tall_man");
    // The rig follows the file that it was loaded from.
    studio.desk.until("the followed file", |desk| {
        let source = desk.app.world().get::<RigSource>(desk.rig);
        source.and_then(|source| source.base()).is_some_and(|base| base.about().name == "tall_man")
    });
    studio.change(Change::Undo);
    assert_eq!(*studio.desk.rig(), before);
    assert_eq!(studio.source_file().as_deref(), Some("man"), "and the one before again");
    studio.change(Change::Redo);
    assert_eq!(*studio.desk.rig(), after);
    // Without them, clips and stored poses go.
    studio.act(studio.tall(), LibraryAct::Load { keep: false });
    assert!(studio.desk.rig().clips().is_empty() && studio.desk.rig().stored_poses().is_empty());
    assert_eq!(studio.desk.rig().len(), 5);
    studio.change(Change::Undo);
    assert_eq!(*studio.desk.rig(), after);
}

#[test]
fn a_part_that_has_another_name_in_a_newer_version_keeps_its_joints() {
    let mut studio = Studio::new(LoaderPanel::default());
    let doll = |name: &str| {
        let part = format!("(part: \"limb.rig.ron\", name: \"{name}\", parent: \"hips\")");
        format!("(format: 2, name: \"doll\", joints: [(label: \"hips\", tags: [control(size: 0.5)])], parts: [{part}])")
    };
    let [old, new] = [studio.man().with_file_name("doll.rig.ron"), studio.site.join("doll.rig.ron")];
    fs::write(old.with_file_name("limb.rig.ron"), LIMB).unwrap();
    fs::write(new.with_file_name("limb.rig.ron"), LIMB.replace("(0, -0.3, 0)", "(0, -0.5, 0)")).unwrap();
    fs::write(&old, doll("arm")).unwrap();
    fs::write(&new, doll("wing")).unwrap();
    studio.open(OpenRequest::File(old));
    studio.desk.until("the followed file", |desk| {
        desk.app.world().get::<RigSource>(desk.rig).is_some_and(|source| !source.taken_over().parts.is_empty())
    });
    let lower = studio.joint("lower_l");
    let bent = PoseOffset { rotation: Quat::from_rotation_z(0.5), ..PoseOffset::IDENTITY };
    studio.desk.edit(Operation::Pose(vec![(lower, bent)]));
    studio.act(TemplatePlace::File(new), LibraryAct::Load { keep: true });
    assert_eq!((studio.height("lower_l"), studio.joint("lower_l")), (-0.5, lower), "{:?}", studio.desk.told());
    assert!(studio.desk.rig().pose().contains_key(&lower), "the pose stays");
    assert_eq!(studio.desk.rig().len(), 3);
}

#[test]
fn stages_go_forwards_and_backwards_at_any_time() {
    let mut studio = Studio::new(LoaderPanel::default());
    let before = studio.text();
    let stage = |studio: &Studio| studio.world().get::<RigStage>(studio.desk.rig).copied();
    let order = [
        ("Edit skeleton", RigStage::Edit),
        ("Delete rig", RigStage::Deleted),
        ("Build rig", RigStage::Built),
        ("Load skeleton", RigStage::Skeleton),
        ("Delete rig", RigStage::Deleted),
        ("Load skeleton", RigStage::Skeleton),
        ("Build rig", RigStage::Built),
    ];
    for (label, wanted) in order {
        studio.click(label);
        assert_eq!(stage(&studio), Some(wanted), "{label}");
        assert_eq!(studio.desk.find(label).on, Some(true), "{label} is shown as the stage");
        assert_eq!(studio.desk.rig().is_empty(), wanted == RigStage::Deleted);
    }
    assert_eq!(studio.text(), before);
    // While it is deleted, no other template takes its place.
    studio.click("Template tall man");
    studio.click("Delete rig");
    assert!(!studio.desk.find("Load").enabled);
    let reason = obstacle(studio.world(), LibraryAction::Load);
    assert_eq!(reason, Some("the rig is deleted: choose another stage first"));
}

#[test]
fn features_and_groups_are_switched_in_the_loader() {
    let mut studio = Studio::new(LoaderPanel::default());
    let joints = ["arm_l", "elbow_l"].map(|label| studio.joint(label)).to_vec();
    studio.act(studio.limb(), LibraryAct::Part { joints, options: Vec::new() });
    let before = studio.text();
    studio.click("Groups");
    studio.desk.frames(30);
    studio.click("limb_l");
    assert!(!studio.desk.rig().groups()[0].enabled);
    studio.change(Change::Undo);
    studio.click("Features");
    studio.desk.frames(30);
    studio.click("fk");
    let features = |studio: &Studio| {
        let tags = studio.desk.rig().walk().flat_map(|joint| joint.data.tags.clone()).collect::<Vec<_>>();
        tags.into_iter()
            .filter(|tag| matches!(tag.kind, TagKind::Feature { .. }))
            .map(|tag| tag.enabled)
            .collect::<Vec<_>>()
    };
    assert_eq!(features(&studio), [false]);
    studio.change(Change::Undo);
    assert_eq!(studio.text(), before);
}

#[test]
fn a_template_is_fitted_onto_the_mesh() {
    let mut studio = Studio::new(LoaderPanel::default());
    studio.open(OpenRequest::Model("biped".to_owned()));
    let before = studio.desk.rig().clone();
    let biped = TemplatePlace::Bundled("biped");
    studio.desk.app.insert_resource(ChosenTemplate(Some(biped)));
    studio.settle();
    assert!(studio.world().get::<RigMeshes>(studio.desk.rig).is_some_and(|meshes| !meshes.is_empty()));
    studio.click("Onto this mesh");
    studio.desk.until("the fit", |desk| desk.app.world().get::<FittedRig>(desk.rig).is_some());
    studio.settle();
    assert!(studio.desk.rig().len() > 40);
    let steps = studio.desk.steps().1;
    (0..steps).for_each(|_| studio.change(Change::Undo));
    assert_eq!(*studio.desk.rig(), before);
}

#[test]
fn actions_of_the_library_are_in_the_palette_with_the_reason_why_they_cannot() {
    let mut studio = Studio::new(LoaderPanel::default());
    for action in LibraryAction::ALL {
        let found = palette::found(action.name());
        assert!(found.contains(&Action::Library(action)), "{action:?} is not found by its name");
    }
    let reasons = [
        (LibraryAction::Load, Some("no template is chosen in the Loader")),
        (LibraryAction::TakeMine, Some("the file has no changes")),
        (LibraryAction::EditSkeleton, None),
        (LibraryAction::Loader, None),
    ];
    for (action, reason) in reasons {
        assert_eq!(palette::obstacle(studio.world(), Action::Library(action)), reason, "{action:?}");
    }
    let limb = studio.limb();
    studio.desk.app.insert_resource(ChosenTemplate(Some(limb)));
    studio.settle();
    let reason = |studio: &Studio, action| palette::obstacle(studio.world(), Action::Library(action));
    assert_eq!(reason(&studio, LibraryAction::Part), Some("no joint is selected"));
    assert_eq!(reason(&studio, LibraryAction::Fit), Some("no mesh is open"));
    let (arm, steps) = (studio.joint("arm_l"), studio.desk.steps().1);
    studio.desk.select(&[arm]);
    studio.send(ActionRequest(Action::Library(LibraryAction::Part)));
    assert_eq!(studio.desk.steps().1, steps + 1, "{:?}", studio.desk.told());
    // An action that can do nothing says why.
    studio.send(ActionRequest(Action::Library(LibraryAction::Fit)));
    assert!(studio.told("no mesh is open"));
}

#[test]
fn the_panel_fits_into_a_narrow_dock_and_names_everything() {
    let mut studio = Studio::new(LoaderPanel::default());
    for (width, height) in [(243.0, 640.0), (194.0, 520.0)] {
        studio.desk.resize(width, height);
        studio.settle();
        studio.click("Template man");
        for label in ["Load skeleton", "Search templates", "Folder of templates", "Load", "Merge"] {
            let found = studio.desk.find(label);
            assert!(
                found.rect.left() >= 0.0 && found.rect.right() <= width + 1.0,
                "{label} at {width}: {:?}",
                found.rect
            );
        }
    }
}
