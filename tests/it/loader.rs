//! The Loader panel, the Part menu and the library behind them: templates found, loaded, merged, injected, dropped and written.

#[cfg(feature = "cli")]
mod authoring;
mod landing;
mod older_projects;
mod sides;

use std::{
    fs,
    path::{Path, PathBuf},
    time::{Duration, SystemTime},
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
            ChosenTemplate, DraggedTemplate, LibraryAct, LibraryAction, LibraryFolders, LibraryJobs, LibraryPictures,
            LibraryRequest, SaveTemplate, TemplateContent, TemplateDraft, TemplateLibrary, TemplatePicture,
            TemplateSave, obstacle,
        },
        palette,
        panel::{EditorPanel, Requests},
        panels::{PanelsPlugin, hierarchy::HierarchyPanel, loader::LoaderPanel, tags::TagsPanel},
        result_queue::HeldPlugin,
    },
    files::{HeaderMemory, RealDisk, SearchPaths, TemplatePlace, list_templates, load_template},
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

use super::panels::desk::{Desk, Sheet};

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
            .add_plugins((FilesPlugin, FollowPlugin, PanelsPlugin, HeldPlugin))
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
            let busy = world.resource::<LoadJob>().what().is_some()
                || world.resource::<SaveJob>().what().is_some()
                || world.resource::<LibraryJobs>().what().is_some()
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
fn templates_are_found_by_words_and_folder_and_are_those_of_the_command() {
    let mut studio = Studio::new(LoaderPanel::default());
    studio.settle();
    let seen = studio.tiles();
    for tile in ["Template man", "Template tall man", "Part limb", "Template biped", "Part arm"] {
        assert!(seen.contains(&tile), "{tile} is not among {seen:?}");
    }
    let find = |studio: &mut Studio, words: &str| -> Vec<String> {
        studio.desk.click("Search templates");
        studio.desk.type_text(words);
        studio.settle();
        let found = studio.tiles().into_iter().map(str::to_owned).collect();
        studio.desk.click("Clear search templates");
        studio.settle();
        found
    };
    assert_eq!(find(&mut studio, "limb upper"), ["Part limb"], "by name and description");
    assert_eq!(find(&mut studio, "ANNA"), ["Part limb"], "by author");
    assert_eq!(find(&mut studio, "tall"), ["Template tall man"]);
    assert_eq!(find(&mut studio, "nothing like this"), [""; 0]);
    // The command lists the same in the folder of the site.
    let listing = studio.world().resource::<TemplateLibrary>().listing().clone();
    let of_site = &listing.folders[1];
    assert_eq!(of_site.name, studio.site.display().to_string());
    let names: Vec<String> = of_site.templates.iter().map(|listed| listed.name()).collect();
    assert_eq!(names, ["limb", "tall_man"]);
    #[cfg(feature = "cli")]
    {
        let (code, said) = super::cli_outputs::rigsmith(studio.folder.path(), &["list", "site", "--json"]);
        let start = said.find('{').unwrap();
        let value: serde_json::Value =
            serde_json::Deserializer::from_str(&said[start..]).into_iter().next().unwrap().unwrap();
        let listed = value["templates"].as_array().unwrap();
        let of_command: Vec<&str> = listed.iter().filter_map(|one| one["name"].as_str()).collect();
        assert_eq!((code, of_command), (0, names.iter().map(String::as_str).collect()));
    }
    // A file that is no template is there, with its reason.
    fs::write(studio.site.join("broken.rig.ron"), "(format: 2, nam").unwrap();
    studio.click("List the templates again");
    assert!(studio.tiles().contains(&"Template broken"), "{:?}", studio.tiles());
    // Pictures come by themselves: skeletons, and the reason in place of a broken one.
    let pictured = |desk: &Desk, name: &str| {
        let world = desk.app.world();
        let listing = world.resource::<TemplateLibrary>().listing();
        let listed = listing.templates().find(|listed| listed.name() == name)?;
        world.resource::<LibraryPictures>().get(listed).cloned()
    };
    studio
        .desk
        .until("the pictures", |desk| ["limb", "biped", "broken"].iter().all(|name| pictured(desk, name).is_some()));
    let Some(TemplatePicture::Bones(bones)) = pictured(&studio.desk, "limb") else { panic!("the limb has no picture") };
    assert_eq!((bones.joints.len(), bones.bones.len()), (2, 1));
    assert!(matches!(pictured(&studio.desk, "broken"), Some(TemplatePicture::Nothing)));
}

#[test]
fn headers_are_read_again_only_where_the_file_has_changed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("man.rig.ron");
    let list = |known: &HeaderMemory| {
        let listing = list_templates(&RealDisk, folder.path(), 0, &SearchPaths::default(), known).unwrap();
        let name = listing.templates[0].header.as_ref().unwrap().name.clone();
        (listing, name)
    };
    let write = |name: &str, time: SystemTime| {
        fs::write(&path, MAN.replace("name: \"man\"", &format!("name: \"{name}\""))).unwrap();
        fs::File::options().write(true).open(&path).unwrap().set_modified(time).unwrap();
    };
    let time = SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000);
    write("man", time);
    let mut known = HeaderMemory::default();
    let (listing, name) = list(&known);
    assert_eq!(name, "man");
    known.remember(&listing.templates);
    // Another content of the same length and time is not looked at; one of another time is.
    write("cat", time);
    assert_eq!(list(&known).1, "man");
    write("cat", time + Duration::from_secs(1));
    assert_eq!(list(&known).1, "cat");
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
fn a_part_of_a_search_path_is_dropped_onto_a_joint() {
    let mut studio = Studio::new(Both::default());
    studio.settle();
    let before = studio.desk.rig().clone();
    let steps = studio.desk.steps().1;
    let [from, to] = ["Part limb", "arm_l"].map(|label| studio.desk.find(label).rect.center());
    studio.desk.drag(from, to);
    studio.settle();
    assert_eq!(studio.desk.steps().1, steps + 1, "{:?}", studio.desk.told());
    let [part] = studio.desk.rig().dropped_parts() else { panic!("{:?}", studio.desk.rig().dropped_parts()) };
    let expected = vec![studio.joint("arm_l"), studio.joint("elbow_l")];
    assert_eq!((part.part.as_str(), &part.joints, part.mirror), ("limbs/limb.rig.ron", &expected, false));
    studio.change(Change::Undo);
    assert_eq!(*studio.desk.rig(), before);
    // On the other side it is the mirror image.
    let to = studio.desk.find("arm_r").rect.center();
    studio.desk.drag(from, to);
    studio.settle();
    assert!(studio.desk.rig().dropped_parts()[0].mirror);
    studio.change(Change::Undo);
    // Whatever is no part is merged below the joint.
    let from = studio.desk.find("Template tall man").rect.center();
    studio.desk.drag(from, to);
    studio.settle();
    assert_eq!(studio.desk.rig().len(), 10, "{:?}", studio.desk.told());
    let hips = studio.joint("tall_man_hips");
    assert_eq!(studio.desk.parent(hips), Some(studio.joint("arm_r")));
    // Let go beside the joints it does nothing.
    let steps = studio.desk.steps().1;
    studio.desk.drag(from, to + egui::vec2(0.0, 600.0));
    studio.settle();
    assert_eq!(studio.desk.steps().1, steps);
}

#[test]
fn a_part_is_dropped_onto_a_joint_in_the_viewport() {
    let mut studio = Studio::with(Sheet::Window);
    let plane = ViewPlane::orthographic(View::Front, [Vec3::splat(-3.0), Vec3::splat(3.0)]);
    let sight = Sight { plane, pixel: 0.01, size: Vec2::new(620.0, 1400.0) };
    studio.desk.app.insert_resource(ViewportSight(Some(sight)));
    studio.desk.frames(2);
    let at = sight.project(studio.desk.rig().position(studio.joint("arm_r"))).unwrap();
    let (from, joint) = (egui::pos2(20.0, 1300.0), egui::pos2(at.x, at.y));
    let drop = |studio: &mut Studio, to: egui::Pos2| {
        studio.desk.press(from);
        let dragged = DraggedTemplate { place: studio.limb(), name: "limb".to_owned() };
        egui::DragAndDrop::set_payload(&studio.desk.ctx, dragged);
        studio.desk.move_to(to);
        studio.desk.release(to);
        studio.settle();
    };
    drop(&mut studio, joint + egui::vec2(0.0, 500.0));
    assert!(
        studio.desk.rig().dropped_parts().is_empty() && studio.told("there is no joint"),
        "{:?}",
        studio.desk.told()
    );
    drop(&mut studio, joint + egui::vec2(6.0, 4.0));
    let [part] = studio.desk.rig().dropped_parts() else { panic!("{:?}", studio.desk.told()) };
    assert_eq!((part.joints[0], part.mirror), (studio.joint("arm_r"), true));
}

#[test]
fn a_part_goes_onto_the_stroke_that_was_just_drawn() {
    let mut studio = Studio::new(TagsPanel::default());
    let hips = studio.joint("hips");
    let positions = vec![Vec3::new(0.5, 1.0, 0.0), Vec3::new(0.8, 1.0, 0.0)];
    studio.desk.edit(Operation::Chain { positions, parent: Some(hips) });
    let end = studio.desk.selected().to_vec();
    assert_eq!(end.len(), 1, "a stroke selects its end");
    let steps = studio.desk.steps().1;
    studio.click("Part");
    studio.desk.until("the parts", |desk| desk.look("Part limb").is_some());
    assert!(studio.desk.look("Part arm").is_some() && studio.desk.look("Template man").is_none(), "parts alone");
    studio.click("Part limb");
    assert_eq!(studio.desk.steps().1, steps + 1, "{:?}", studio.desk.told());
    let part = &studio.desk.rig().dropped_parts()[0];
    assert_eq!(part.joints, [studio.desk.parent(end[0]).unwrap(), end[0]]);
    // What takes more joints than there are is refused with the reason, and changes nothing.
    let text = studio.text();
    studio.act(TemplatePlace::Bundled("parts/arm.rig.ron"), LibraryAct::Part { joints: end, options: Vec::new() });
    assert_eq!(studio.text(), text);
    assert!(studio.told("needs"), "{:?}", studio.desk.told());
}

#[test]
fn a_part_over_other_commands_is_told_once_it_is_there() {
    let mut studio = Studio::new(LoaderPanel::default());
    let [hips, arm, elbow] = ["hips", "arm_l", "elbow_l"].map(|label| studio.joint(label));
    let onto = |studio: &mut Studio, joints: Vec<Uid>| {
        let place = studio.limb();
        studio.act(place, LibraryAct::Part { joints, options: Vec::new() });
    };
    // Joints that do not follow each other are refused.
    onto(&mut studio, vec![hips, elbow]);
    assert!(studio.desk.rig().dropped_parts().is_empty(), "{:?}", studio.desk.told());
    assert!(!studio.told("was added to joints"), "{:?}", studio.desk.told());
    onto(&mut studio, vec![hips, arm]);
    assert_eq!(studio.desk.rig().dropped_parts().len(), 1, "{:?}", studio.desk.told());
    let own = "Limb was added to joints that have 1 command of their own, which stays";
    assert!(studio.told(own), "{:?}", studio.desk.told());
}

#[test]
fn options_of_a_part_are_set_in_its_card() {
    let mut studio = Studio::new(LoaderPanel::default());
    let arm = studio.joint("arm_l");
    studio.desk.select(&[arm]);
    studio.settle();
    studio.click("Part limb");
    for told in ["Sockets: end on lower_l", "An upper and a lower bone.", "Features: fk"] {
        assert!(studio.desk.says(told), "{told} is not among {:?}", studio.desk.seen);
    }
    assert!(studio.desk.look("Option size").is_some());
    studio.desk.click("Option size");
    studio.desk.hold(egui::Modifiers::COMMAND);
    studio.desk.key(egui::Key::A);
    studio.desk.hold(egui::Modifiers::NONE);
    studio.desk.type_text("0.75");
    studio.desk.frames(2);
    studio.click("Add part");
    let on_arm = studio.desk.rig().joint(arm).unwrap().data.tags.clone();
    let params = on_arm.iter().find_map(|tag| match &tag.kind {
        TagKind::Command { params, .. } => Some(params.clone()),
        TagKind::Feature { .. } => None,
    });
    assert!(params.as_ref().is_some_and(|params| params.contains("0.75")), "{params:?} {:?}", studio.desk.told());
    // A value that the option does not take is refused.
    let text = studio.text();
    let elbow = studio.joint("elbow_r");
    let options = vec![("weight".to_owned(), "1".to_owned())];
    studio.act(studio.limb(), LibraryAct::Part { joints: vec![elbow], options });
    assert!(studio.text() == text && studio.told("has no option \"weight\""), "{:?}", studio.desk.told());
}

#[test]
fn templates_are_merged_injected_and_extracted() {
    let mut studio = Studio::new(LoaderPanel::default());
    studio.settle();
    let before = studio.desk.rig().clone();
    let elbow = studio.joint("elbow_l");
    studio.desk.select(&[elbow]);
    studio.click("Template tall man");
    studio.click("Merge");
    let merged = studio.joint("tall_man_hips");
    assert_eq!((studio.desk.rig().len(), studio.desk.parent(merged)), (10, Some(elbow)));
    studio.change(Change::Undo);
    assert_eq!(*studio.desk.rig(), before);
    // The tags of the limb go onto the joints in the order in which they were selected.
    let joints = [studio.joint("arm_r"), studio.joint("elbow_r")];
    studio.desk.select(&joints);
    studio.click("Part limb");
    studio.click("Inject");
    let tags = |studio: &Studio, joint: Uid| studio.desk.rig().joint(joint).unwrap().data.tags.len();
    assert_eq!(joints.map(|joint| tags(&studio, joint)), [2, 1], "{:?}", studio.desk.told());
    assert!(studio.desk.rig().dropped_parts().is_empty(), "its tags are the rig's own");
    studio.change(Change::Undo);
    assert_eq!(*studio.desk.rig(), before);
    // Selected joints become a part of their own, which the list has then.
    studio.desk.select(&joints);
    let path = studio.site.join("arm_of_man");
    let content = TemplateContent::Joints(joints.to_vec());
    studio.send(SaveTemplate { path: path.clone(), replace: false, content });
    let file = studio.site.join("arm_of_man.rig.ron");
    let part = load_template(&RealDisk, &file).unwrap().rig;
    assert_eq!((part.len(), part.about().kind.as_str()), (2, "part"));
    assert!(studio.tiles().contains(&"Part arm of man"), "{:?}", studio.tiles());
    // A file that is there is replaced only if that was said.
    let text = fs::read(&file).unwrap();
    let all: Vec<Uid> = studio.desk.rig().walk().map(|joint| joint.data.uid).collect();
    let content_of_all = TemplateContent::Joints(all);
    studio.send(SaveTemplate { path: path.clone(), replace: false, content: content_of_all.clone() });
    assert!(fs::read(&file).unwrap() == text && studio.told("tick Replace"), "{:?}", studio.desk.told());
    studio.send(SaveTemplate { path, replace: true, content: content_of_all });
    assert_eq!(load_template(&RealDisk, &file).unwrap().rig.len(), 5);
    // Without a typed path it is a file of the first joint's name; the template that is open stays as it is.
    let text = fs::read(studio.man()).unwrap();
    studio.send(ActionRequest(Action::Library(LibraryAction::Save)));
    studio.desk.frames(30);
    studio.click("Extract selected");
    let file = studio.man().with_file_name("arm_r.rig.ron");
    assert_eq!(load_template(&RealDisk, &file).unwrap().rig.len(), 2);
    let path = studio.man();
    studio.send(SaveTemplate { path, replace: false, content: TemplateContent::Joints(joints.to_vec()) });
    assert!(fs::read(studio.man()).unwrap() == text);
}

#[test]
fn a_template_is_written_with_its_header_and_a_picture() {
    let mut studio = Studio::new(LoaderPanel::default());
    studio.send(ActionRequest(Action::Library(LibraryAction::Save)));
    assert!(studio.world().resource::<TemplateDraft>().is_open);
    studio.desk.frames(30);
    let steps = studio.desk.steps().1;
    for (field, text) in [("Author", "Ben"), ("Kind", "character"), ("Description", "A man of sticks.")] {
        studio.desk.click(field);
        studio.desk.type_text(text);
        studio.desk.frames(2);
    }
    studio.desk.click("Name");
    studio.desk.frames(2);
    assert_eq!(studio.desk.steps().1, steps + 3, "each field is a step");
    let path = studio.site.join("sticks.rig.ron");
    studio.desk.click("Template file");
    studio.desk.type_text(&path.display().to_string());
    studio.desk.frames(2);
    studio.click("Save template");
    studio.desk.until("the template", |_| path.exists());
    studio.settle();
    let header = read_header(&fs::read(&path).unwrap()).unwrap();
    let of = (header.name.as_str(), header.author.as_str(), header.kind.as_str(), header.description.as_str());
    assert_eq!(of, ("man", "Ben", "character", "A man of sticks."));
    assert_eq!(header.preview.as_deref(), Some("sticks.png"));
    let shown = |desk: &Desk| {
        let world = desk.app.world();
        let listing = world.resource::<TemplateLibrary>().listing();
        let listed = listing.find(&TemplatePlace::File(path.clone()))?;
        world.resource::<LibraryPictures>().get(listed).cloned()
    };
    studio.desk.until("its picture in the list", |desk| matches!(shown(desk), Some(TemplatePicture::Image(_))));
    let picture = fs::read(studio.site.join("sticks.png")).unwrap();
    let picture = image::load_from_memory(&picture).unwrap().to_rgba8();
    let drawn = picture.pixels().filter(|pixel| pixel.0[3] > 0).count();
    assert!(picture.width() == picture.height() && drawn > 100, "{drawn} pixels");
    assert_eq!(load_template(&RealDisk, &path).unwrap().rig.len(), 5);
    // Undo of the header's steps gives the rig of before.
    (0..4).for_each(|_| studio.change(Change::Undo));
    assert_eq!(studio.desk.rig().about().author, "");
}

#[test]
fn a_picture_that_cannot_be_written_leaves_neither_a_file_nor_its_name() {
    let mut studio = Studio::new(LoaderPanel::default());
    let (picture, path) = (studio.site.join("hero.png"), studio.site.join("hero.rig.ron"));
    fs::create_dir(&picture).unwrap();
    let (before, done) = (studio.desk.rig().clone(), studio.desk.steps().1);
    studio.send(SaveTemplate { path: path.clone(), replace: true, content: TemplateContent::Rig { picture: true } });
    assert!(studio.told("Could not write hero.rig.ron"), "{:?}", studio.desk.told());
    assert!(picture.is_dir() && !path.exists());
    assert_eq!((studio.desk.rig(), studio.desk.steps().1), (&before, done), "the header is as before");
}

#[test]
fn a_picture_that_is_not_the_templates_is_replaced_only_if_that_was_said() {
    let mut studio = Studio::new(LoaderPanel::default());
    // A texture that is called as the character is.
    let texture = studio.site.join("hero.png");
    fs::write(&texture, b"a texture").unwrap();
    let path = studio.site.join("hero.rig.ron");
    let content = TemplateContent::Rig { picture: true };
    let steps = studio.desk.steps();
    let save = |replace: bool| SaveTemplate { path: path.clone(), replace, content: content.clone() };
    studio.send(save(false));
    assert!(studio.told("a picture hero.png already"), "{:?}", studio.desk.told());
    assert!(fs::read(&texture).unwrap() == b"a texture" && !path.exists() && studio.desk.steps() == steps);
    studio.send(save(true));
    assert!(path.exists() && fs::read(&texture).unwrap() != b"a texture", "{:?}", studio.desk.told());
    // In the form the tick is for one file.
    studio.desk.app.insert_resource(TemplateDraft {
        is_open: true,
        path: path.display().to_string(),
        replace: true,
        ..TemplateDraft::default()
    });
    studio.desk.frames(30);
    fs::write(&texture, b"a texture").unwrap();
    studio.click("Save template");
    assert!(fs::read(&texture).unwrap() != b"a texture", "{:?}", studio.desk.told());
    assert!(!studio.world().resource::<TemplateDraft>().replace);
    // The template that is open has its own picture, which goes with it.
    let own = SaveTemplate { path: studio.man(), replace: false, content };
    studio.send(own.clone());
    let picture = studio.man().with_file_name("man.png");
    fs::write(&picture, b"an older picture").unwrap();
    studio.send(own);
    assert!(fs::read(&picture).unwrap() != b"an older picture", "{:?}", studio.desk.told());
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

/// The name by which a template calls a part of a folder.
#[test]
fn parts_are_called_relative_to_the_document_or_the_site() {
    let site = SearchPaths { folders: vec![PathBuf::from("/site")] };
    let cases = [
        ("/home/parts/arm.rig.ron", "parts/arm.rig.ron"),
        ("/site/limbs/arm.rig.ron", "limbs/arm.rig.ron"),
        ("/elsewhere/arm.rig.ron", "/elsewhere/arm.rig.ron"),
    ];
    for (file, name) in cases {
        let place = TemplatePlace::File(PathBuf::from(file));
        assert_eq!(place.part_name(Some(Path::new("/home")), &site), name);
    }
    assert_eq!(TemplatePlace::Bundled("parts/arm.rig.ron").part_name(None, &site), "parts/arm.rig.ron");
}
