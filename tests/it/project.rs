//! Projects: what is saved comes back, what is wrong is named with its place, and a missing mesh loses nothing.

use std::{fs, path::Path, sync::Arc};

use bevy::math::{Quat, Vec3};
use proptest::prelude::*;
use rigsmith::{
    files::{
        Fault, FaultPlan, FaultyDisk, FileKind, LoadError, LoadedProject, MeshShape, MeshState, MeshToSave,
        ProjectNote, ProjectTemplate, ProjectToSave, RealDisk, load_model, load_project, stem, store_model,
        store_project,
    },
    mesh::{
        gltf::GltfWriteSettings,
        model::{Model, Weights},
    },
    rig::{
        PoseOffset, Rig, RigEdit, SkinData, Uid, UidSource, WeightPatch,
        character::{Character, character, import_skeleton},
        operations::Operation,
        project::{
            JournalReference, MeshReference, Project, ProjectCamera, ProjectRig, ProjectView, SkinReference,
            read_project, write_project,
        },
    },
};

use crate::edits::{Bench, command, random_rig, steps};

const FROZEN: &str = include_str!("../frozen/format-1.rigsmith.ron");

fn frozen() -> Project {
    read_project(FROZEN.as_bytes()).unwrap().project
}

/// The rig without what files do not keep: pairs and features that were deleted.
fn as_file(rig: &Rig) -> Rig {
    let project = Project { rigs: vec![ProjectRig { rig: rig.clone(), skins: Vec::new() }], ..Default::default() };
    read_project(write_project(&project).as_bytes()).unwrap().project.rigs.remove(0).rig
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_is_written_comes_back(steps in steps(50)) {
        let rig = random_rig(&steps);
        let fresh = Rig::new(Uid(43), "other");
        let project = Project {
            name: "two \"rigs\"".into(),
            rigs: vec![
                ProjectRig { rig: rig.clone(), skins: Vec::new() },
                ProjectRig { rig: fresh, skins: Vec::new() },
            ],
            ..Default::default()
        };
        let text = write_project(&project);
        let read = read_project(text.as_bytes());
        prop_assert!(read.is_ok(), "{:?}\n{}", read, text);
        let read = read.unwrap();
        prop_assert_eq!(&read.notes, &Vec::<String>::new());
        prop_assert_eq!(write_project(&read.project), text.clone());
        prop_assert_eq!(&read_project(text.as_bytes()).unwrap().project, &read.project);
        let back = &read.project.rigs[0].rig;
        prop_assert_eq!((back.pose(), back.stored_poses()), (rig.pose(), rig.stored_poses()));
        prop_assert_eq!(back.rest_globals(), rig.rest_globals());
    }
}

#[test]
fn the_frozen_file_of_format_1_opens() {
    let read = read_project(FROZEN.as_bytes()).unwrap();
    assert_eq!(read.notes, Vec::<String>::new());
    let project = read.project;
    assert_eq!(write_project(&project), FROZEN);
    assert_eq!(project.name, "Biped \"frozen\"");
    assert_eq!(
        project.meshes,
        [MeshReference {
            uid: Uid(0x50),
            rig: Uid(0x00c0_ffee_00c0_ffee),
            path: "../meshes/body 左.obj".into(),
            hash: 0x0123_4567_89ab_cdef_0123_4567_89ab_cdef,
            nodes: vec![Uid(1), Uid(2)],
        }]
    );
    let ProjectRig { rig, skins } = &project.rigs[0];
    assert_eq!(
        skins,
        &[SkinReference {
            mesh: Uid(0x50),
            path: "biped.0000000000000050.skin".into(),
            hash: 0xfeed_beef_feed_beef,
            at_rest: true,
        }]
    );
    assert_eq!(rig.about().description, "Two lines,\nand 左.");
    assert_eq!(rig.children(Some(Uid(1))), &[Uid(2), Uid(3)]);
    assert_eq!(rig.pose().len(), 2);
    assert_eq!(rig.offset(Uid(2)).unwrap().rotation, Quat::from_xyzw(0.6, 0.0, 0.0, 0.8));
    assert_eq!(rig.stored_poses()[1].name, "wave");
    let gone = &rig.stored_poses()[1].offsets[&Uid(0x99)];
    assert_eq!((gone.translation, gone.scale), (Vec3::new(0.0, 0.5, 0.0), Vec3::new(1.0, 2.0, 1.0)));
    let camera = ProjectCamera { yaw: 0.5, pitch: -0.25, distance: 3.0, focus: Vec3::Y, orthographic: true };
    let view = ProjectView {
        camera: Some(camera),
        mode: "Pose".into(),
        shading: "x_ray".into(),
        switches: [("axes".to_owned(), false), ("grid".to_owned(), true)].into(),
    };
    assert_eq!(project.view, view);
    assert_eq!(project.journal, Some(JournalReference { file: "biped.rigsmith.journal".into(), last: 1234 }));
}

#[test]
fn one_change_is_one_line() {
    let before = write_project(&frozen());
    let changed = |change: &dyn Fn(&mut Project)| {
        let mut project = frozen();
        change(&mut project);
        let after = write_project(&project);
        assert_eq!(before.lines().count(), after.lines().count());
        before.lines().zip(after.lines()).filter(|(a, b)| a != b).count()
    };
    let edited = |edit: RigEdit| changed(&|project| drop(project.rigs[0].rig.apply(&edit).unwrap()));
    let offset = PoseOffset { translation: Vec3::X, ..PoseOffset::from_rotation(Quat::from_rotation_y(1.0)) };
    assert_eq!(edited(RigEdit::SetOffset(Uid(2), Some(offset))), 1);
    assert_eq!(edited(RigEdit::SetLabel(Uid(2), Some("upper_arm_l".into()))), 1);
    assert_eq!(changed(&|project| project.meshes[0].hash = 1), 1);
    assert_eq!(changed(&|project| project.view.mode = "Select".into()), 1);
    assert_eq!(changed(&|project| project.journal.as_mut().unwrap().last = 7), 1);
}

#[test]
fn parameters_stay_as_they_are_with_their_line_breaks_and_however_deep() {
    let mut bench = Bench::new();
    let joint = bench.place([0.0; 3], None);
    let params = ["(a: \"x\",\n  b: r#\"raw\n    text \"with\" lines\n\"#, // params: [\n)", "[\n1]"];
    for (number, params) in params.into_iter().enumerate() {
        let tag = Box::new(command(Uid(100 + number as u64), params, None));
        bench.run(Operation::Edits(vec![RigEdit::AddTag { joint, tag, index: usize::MAX }]));
    }
    // As deep as a rig takes them.
    let deep = |depth: usize| {
        let tag = command(Uid(200), &format!("{}1{}", "[".repeat(depth), "]".repeat(depth)), None);
        RigEdit::AddTag { joint, tag: Box::new(tag), index: usize::MAX }
    };
    assert!((20..200).rev().any(|depth| bench.rig.apply(&deep(depth)).is_ok()));
    assert_eq!(as_file(&bench.rig), bench.rig);
}

/// Where `needle` first starts in `text`: line and column from one.
fn place(text: &str, needle: &str) -> (usize, usize) {
    let at = text.find(needle).unwrap_or_else(|| panic!("no {needle}"));
    let line = text[..at].matches('\n').count() + 1;
    (line, text[..at].chars().rev().take_while(|c| *c != '\n').count() + 1)
}

#[test]
fn mistakes_are_named_with_their_place() {
    let pose = "(joint: \"0000000000000002\", rotation: (0.6, 0.0, 0.0, 0.8))";
    // What is replaced, by what, what the error is about, and the text whose place it names.
    let table = [
        ("uid: \"0000000000000050\"", "uid: \"5\"", "no uid", "\"5\""),
        ("rig: \"00c0ffee00c0ffee\"", "rig: \"0000000000000077\"", "not in the file", "rig: \"0000000000000077\""),
        ("0123456789abcdef0123456789abcdef", "abc", "no hash of a mesh", "\"abc\""),
        ("feedbeeffeedbeef", "xeedbeeffeedbeef", "no hash of a file", "\"xeed"),
        ("mesh: \"0000000000000050\"", "mesh: \"0000000000000051\"", "not in the file", "mesh: \"0000000000000051\""),
        ("label: \"arm_l\"", "lable: \"arm_l\"", "lable", "lable"),
        (
            "parent: \"0000000000000001\",\n",
            "parent: \"0000000000000077\",\n",
            "names the parent",
            "parent: \"0000000000000077\"",
        ),
        (
            pose,
            "(joint: \"0000000000000003\"), (joint: \"0000000000000003\")",
            "twice",
            "joint: \"0000000000000003\"),\n",
        ),
        (pose, "(joint: \"0000000000000002\", rotation: (0, 0, 0, 0.5))", "not a rotation", "rotation: (0, 0, 0, 0.5)"),
        (pose, "(joint: \"0000000000000002\", turn: 1)", "turn", "turn: 1"),
        (
            "uid: \"0000000000000061\"",
            "uid: \"0000000000000001\"",
            "already used",
            "uid: \"0000000000000001\",\n                    name: \"wave\"",
        ),
        ("scale: (1.0, 2.0, 1.0)", "scale: (1.0, inf, 1.0)", "not finite", "(joint: \"0000000000000099\""),
        ("mode: \"Pose\"", "mode: 3", "xpected", "3,\n        shading"),
        ("last: 1234", "last: -1", "out of bounds", "last: -1"),
        ("format: 1,\n    name", "format: 0,\n    name", "format 0", "format: 0"),
    ];
    for (what, by, about, at) in table {
        assert!(FROZEN.contains(what), "{what}");
        let text = FROZEN.replacen(what, by, 1);
        let error = read_project(text.as_bytes()).expect_err(by);
        assert!(error.to_string().contains(about), "{by}: {error}");
        let (line, column) = place(&text, at);
        assert_eq!(error.line, line, "{by}: {error}");
        // The RON reader names the place where it gave up, which may be the end of what it could not use.
        assert!(error.column.abs_diff(column) <= at.len() + 30, "{by}: {error}, not column {column}");
    }
    for bytes in [&b""[..], b"  ", b"(", b"\xff", b"(format: 1)", b"[]", b"(format: 1, name: \"\", rigs: [(rig: 3)])"] {
        assert!(read_project(bytes).is_err(), "{bytes:?}");
    }
    assert!(read_project(b"(format: 1, name: \"\")").is_ok());
}

#[test]
fn a_newer_format_opens_and_says_what_it_does_not_know() {
    let text = FROZEN
        .replacen("format: 1,", "format: 5, lights: [(x: 1)],", 1)
        .replacen("mode: \"Pose\"", "fog: 0.5, mode: \"Pose\"", 1)
        .replacen("skins: [", "muscles: [], skins: [", 1)
        .replacen("format: 1,", "format: 5, meaning: 42,", 1);
    let read = read_project(text.as_bytes()).unwrap();
    assert_eq!(read.project, frozen());
    let told = read.notes.join("\n");
    for part in ["project has format 5", "`lights`", "`fog`", "`muscles`", "template has format 5"] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let line = place(&text, "meaning: 42").0;
    assert!(told.contains(&format!("line {line}: the field `meaning`")), "{told}");
    let strict = FROZEN.replacen("mode:", "fog: 1, mode:", 1);
    assert!(read_project(strict.as_bytes()).is_err(), "in format 1 it is a mistake");
}

#[test]
fn a_broken_view_is_no_reason_to_refuse_a_project() {
    let text = FROZEN.replacen("yaw: 0.5", "yaw: NaN", 1);
    let read = read_project(text.as_bytes()).unwrap();
    assert_eq!(read.project.view.camera, None);
    assert_eq!(read.notes.len(), 1);
    let mut project = frozen();
    project.view.camera.as_mut().unwrap().distance = f32::INFINITY;
    assert_eq!(read_project(write_project(&project).as_bytes()).unwrap().project.view.camera, None);
}

const CUBE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
    f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

/// A folder with a mesh beside the folder of the project.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        fs::create_dir_all(folder.0.path().join("work")).unwrap();
        fs::create_dir_all(folder.0.path().join("meshes")).unwrap();
        fs::write(folder.mesh(), CUBE).unwrap();
        folder
    }

    fn mesh(&self) -> std::path::PathBuf {
        self.0.path().join("meshes/cube.obj")
    }

    fn project(&self) -> std::path::PathBuf {
        self.0.path().join("work/hero.rigsmith.ron")
    }

    /// The only file with weights.
    fn skin(&self) -> std::path::PathBuf {
        let files = fs::read_dir(self.0.path().join("work")).unwrap().map(|entry| entry.unwrap().path());
        let mut skins = files.filter(|path| path.extension().is_some_and(|ending| ending == "skin"));
        let skin = skins.next().expect("a file with weights");
        assert_eq!(skins.next(), None);
        skin
    }

    fn text(&self) -> String {
        fs::read_to_string(self.project()).unwrap()
    }

    fn load(&self) -> LoadedProject {
        load_project(&RealDisk, &self.project()).unwrap()
    }

    fn save(&self, project: &ProjectToSave) -> Vec<String> {
        store_project(&RealDisk, &self.project(), project).unwrap()
    }
}

fn open_shape(model: &Model) -> MeshShape {
    MeshShape::Open { rest: Arc::new(model.at_rest()), triangles: model.point_triangles().into() }
}

/// Project that the editor would save after opening.
fn to_save(loaded: LoadedProject) -> ProjectToSave {
    let meshes = loaded.meshes.into_iter().map(|mesh| MeshToSave {
        uid: mesh.uid,
        rig: mesh.rig,
        path: mesh.path,
        nodes: mesh.nodes,
        shape: match mesh.shape {
            MeshState::Open { model, .. } => open_shape(&model),
            MeshState::Missing { shape, .. } => shape,
        },
    });
    let meshes = meshes.collect();
    let LoadedProject { name, rigs, templates, view, journal, .. } = loaded;
    ProjectToSave { name, rigs, meshes, templates, view, journal }
}

/// A cube held by two joints, posed.
fn cube(mesh: &Path) -> ProjectToSave {
    let mut bench = Bench::new();
    let joints = bench.chain(&[[0.5, 0.0, 0.5], [0.5, 1.0, 0.5]], None);
    let mut weights = Weights::default();
    for point in 0..8 {
        let up = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0][point];
        let all = [(0, 0.7 - 0.4 * up), (1, 0.2 + 0.4 * up), (2, 0.1)];
        weights.push(all);
    }
    // The last one is a joint that a command created for the second.
    let created = Uid(0xC0_FFEE);
    let subjects = [(created, joints[1])].into();
    let skin = SkinData { joints: vec![joints[0], joints[1], created], weights, at_rest: true, subjects };
    let uid = Uid(0x50);
    bench.run(Operation::Edits(vec![RigEdit::SetSkin(uid, Some(Arc::new(skin)))]));
    bench.run(Operation::Pose(vec![(joints[1], PoseOffset::from_rotation(Quat::from_rotation_x(0.5)))]));
    bench.run(Operation::StorePose("bent".into()));
    let model = load_model(&RealDisk, mesh).unwrap();
    let mesh = MeshToSave {
        uid,
        rig: bench.rig.uid(),
        path: mesh.to_owned(),
        nodes: Arc::default(),
        shape: open_shape(&model),
    };
    ProjectToSave {
        name: "hero".into(),
        rigs: vec![bench.rig],
        meshes: vec![mesh],
        templates: Vec::new(),
        view: frozen().view,
        journal: frozen().journal,
    }
}

#[test]
fn what_is_saved_is_opened_and_saving_that_changes_nothing() {
    let folder = Folder::new();
    let project = cube(&folder.mesh());
    assert_eq!(folder.save(&project), Vec::<String>::new());
    let names: Vec<String> = {
        let mut names: Vec<String> = fs::read_dir(folder.0.path().join("work"))
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    };
    assert_eq!(names.len(), 2);
    assert!(names[0].starts_with("hero.") && names[0].ends_with(".skin") && names[1] == "hero.rigsmith.ron");
    assert!(folder.text().contains("path: \"../meshes/cube.obj\""), "{}", folder.text());
    let text = folder.text();
    let loaded = folder.load();
    assert!(loaded.notes.is_empty(), "{:?}", loaded.notes);
    assert_eq!(loaded.rigs, project.rigs);
    assert_eq!((&loaded.name, &loaded.view, &loaded.journal), (&project.name, &project.view, &project.journal));
    assert!(matches!(&loaded.meshes[0].shape, MeshState::Open { changed: false, .. }));
    folder.save(&to_save(loaded));
    assert_eq!(folder.text(), text);

    // The whole folder moved elsewhere.
    let moved = tempfile::tempdir().unwrap();
    for name in ["work", "meshes"] {
        fs::rename(folder.0.path().join(name), moved.path().join(name)).unwrap();
    }
    let loaded = load_project(&RealDisk, &moved.path().join("work/hero.rigsmith.ron")).unwrap();
    assert!(loaded.notes.is_empty(), "{:?}", loaded.notes);
    assert_eq!(loaded.rigs, project.rigs);
    assert_eq!(FileKind::of(&folder.project()), Some(FileKind::Project));
    assert_eq!(stem(&folder.project()), "hero");
}

#[test]
fn weights_follow_a_mesh_that_has_changed() {
    let folder = Folder::new();
    let project = cube(&folder.mesh());
    folder.save(&project);
    // The same cube with another point in its top, in another order.
    let changed = CUBE.replacen("f 3 4 8 7\n", "v 0.5 1 0.5\nf 3 4 9\nf 4 8 9\nf 8 7 9\nf 7 3 9\n", 1);
    fs::write(folder.mesh(), changed).unwrap();
    let loaded = folder.load();
    assert!(matches!(&loaded.meshes[0].shape, MeshState::Open { changed: true, .. }));
    assert!(loaded.notes.iter().any(|note| matches!(note, ProjectNote::MeshChanged(_))), "{:?}", loaded.notes);
    assert!(loaded.notes.iter().any(|note| note.to_string().contains("8 points copied")), "{:?}", loaded.notes);
    let skin = loaded.rigs[0].skin(Uid(0x50)).unwrap();
    assert_eq!(skin.weights.len(), 9);
    let before = project.rigs[0].skin(Uid(0x50)).unwrap();
    for point in 0..8 {
        let pairs = skin.weights.of(point).zip(before.weights.of(point));
        assert!(pairs.into_iter().all(|(a, b)| a.0 == b.0 && (a.1 - b.1).abs() < 1e-6));
    }
    folder.save(&to_save(folder.load()));
    assert!(folder.load().notes.is_empty(), "saved, it is the project's mesh");
}

#[test]
fn a_missing_mesh_loses_nothing() {
    let folder = Folder::new();
    let project = cube(&folder.mesh());
    folder.save(&project);
    let text = folder.text();
    let skin = fs::read(folder.skin()).unwrap();
    let away = folder.0.path().join("meshes/elsewhere.obj");
    fs::rename(folder.mesh(), &away).unwrap();
    let loaded = folder.load();
    assert_eq!(loaded.rigs, project.rigs, "weights and poses included");
    let note = loaded.notes.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
    assert!(note.contains("cube.obj") && note.contains("put it back"), "{note}");
    let MeshState::Missing { error, .. } = &loaded.meshes[0].shape else { panic!("{:?}", loaded.meshes[0].shape) };
    assert!(matches!(**error, LoadError::Read(_)));
    folder.save(&to_save(loaded));
    assert_eq!(folder.text(), text);
    assert_eq!(fs::read(folder.skin()).unwrap(), skin);
    fs::rename(&away, folder.mesh()).unwrap();
    assert!(folder.load().notes.is_empty());
}

#[test]
fn broken_weights_are_told_and_the_rest_opens() {
    let folder = Folder::new();
    let project = cube(&folder.mesh());
    folder.save(&project);
    let (skin, text) = (folder.skin(), folder.text());
    let name = skin.file_stem().unwrap().to_str().unwrap();
    let whole = fs::read(&skin).unwrap();
    let missing = || fs::remove_file(&skin).unwrap();
    let cut = || fs::write(&skin, &whole[..whole.len() / 2]).unwrap();
    let outside = || fs::write(folder.project(), text.replacen(name, &format!("../work/{name}"), 1)).unwrap();
    for (break_it, about) in [(&missing as &dyn Fn(), "no file"), (&cut, "skin"), (&outside, "below the project")] {
        let _ = fs::remove_file(&skin);
        folder.save(&project);
        break_it();
        let loaded = folder.load();
        assert_eq!(loaded.notes.len(), 1, "{:?}", loaded.notes);
        assert!(loaded.notes[0].to_string().contains(about), "{:?}", loaded.notes);
        assert!(loaded.rigs[0].skins().next().is_none());
        assert_eq!(loaded.rigs[0].stored_poses(), project.rigs[0].stored_poses());
        assert!(matches!(&loaded.meshes[0].shape, MeshState::Open { changed: false, .. }));
    }
    // A link that leads out of the project's folder is as good as a path that does.
    #[cfg(unix)]
    {
        fs::remove_file(folder.project()).unwrap();
        let _ = fs::remove_file(&skin);
        folder.save(&project);
        let elsewhere = folder.0.path().join("elsewhere.skin");
        fs::rename(&skin, &elsewhere).unwrap();
        std::os::unix::fs::symlink(&elsewhere, &skin).unwrap();
        let loaded = folder.load();
        assert!(loaded.notes[0].to_string().contains("below the project"), "{:?}", loaded.notes);
        assert!(loaded.rigs[0].skins().next().is_none());
    }
    // A mesh far away is told and opened.
    let _ = fs::remove_file(&skin);
    folder.save(&project);
    let far = folder.0.path().join("meshes/cube.obj").display().to_string();
    fs::write(folder.project(), folder.text().replace("../meshes/cube.obj", &far)).unwrap();
    let loaded = folder.load();
    assert!(loaded.notes.len() == 1 && loaded.notes[0].to_string().contains("is far from"), "{:?}", loaded.notes);
    // Weights of another save: still those of this mesh.
    fs::remove_file(&skin).unwrap();
    folder.save(&project);
    let hash = text.split(".skin\", hash: \"").nth(1).unwrap()[..16].to_owned();
    fs::write(folder.project(), text.replace(&format!("hash: \"{hash}\""), "hash: \"0000000000000000\"")).unwrap();
    let loaded = folder.load();
    assert!(loaded.notes.len() == 1 && loaded.notes[0].to_string().contains("another time"), "{:?}", loaded.notes);
    assert_eq!(loaded.rigs, project.rigs);
}

#[test]
fn a_disk_that_fails_leaves_the_old_project_or_the_finished_one() {
    let folder = Folder::new();
    let old = cube(&folder.mesh());
    let mut new = cube(&folder.mesh());
    new.name = "another".into();
    let root = new.rigs[0].roots()[0];
    new.rigs[0].apply(&RigEdit::SetLabel(root, Some("root".into()))).unwrap();
    let counted = FaultyDisk::new(RealDisk, None);
    folder.save(&old);
    store_project(&counted, &folder.project(), &new).unwrap();
    for at in 0..counted.operations() {
        for fault in Fault::ALL {
            folder.save(&old);
            let disk = FaultyDisk::new(RealDisk, Some(FaultPlan { at, fault, lasting: true }));
            let saved = store_project(&disk, &folder.project(), &new);
            let loaded = folder.load();
            let context = format!("{at} {fault:?} {saved:?} {:?}", loaded.notes);
            assert!(loaded.name == old.name || loaded.name == new.name, "{context}");
            if saved.is_ok() {
                assert_eq!(loaded.rigs, new.rigs, "{context}");
            }
            let expected = if loaded.name == new.name { &new } else { &old };
            assert_eq!(loaded.rigs[0].rest_globals(), expected.rigs[0].rest_globals(), "{context}");
            assert_eq!(loaded.rigs[0].skins().count(), 1, "{context}");
        }
    }
}

#[test]
fn weights_of_a_mesh_that_is_not_open_are_told() {
    let folder = Folder::new();
    let mut project = cube(&folder.mesh());
    project.meshes.clear();
    let notes = folder.save(&project);
    assert!(notes.len() == 1 && notes[0].contains("0000000000000050"), "{notes:?}");
    assert_eq!(folder.load().meshes.len(), 0);
}

#[test]
fn a_character_with_a_skeleton_of_its_own_goes_through_a_project() {
    let folder = Folder::new();
    let posed = cube(&folder.mesh());
    let model = load_model(&RealDisk, &folder.mesh()).unwrap();
    let parts = Character {
        rig: &posed.rigs[0],
        built: None,
        file: &model,
        rest: &model,
        nodes: &[],
        skin: posed.rigs[0].skin(Uid(0x50)).map(|skin| &**skin),
    };
    let path = folder.0.path().join("meshes/cube.glb");
    store_model(&RealDisk, &path, &character(&parts), &GltfWriteSettings::default()).unwrap();

    let model = load_model(&RealDisk, &path).unwrap();
    let mut uids = UidSource::seeded(9);
    let mut rig = Rig::new(uids.next_uid(), "cube");
    let skeleton = import_skeleton(&model, &mut uids);
    assert!(!skeleton.nodes.is_empty() && skeleton.skin.is_some());
    skeleton.edits.iter().for_each(|edit| drop(rig.apply(edit).unwrap()));
    let uid = uids.next_uid();
    rig.apply(&RigEdit::SetSkin(uid, skeleton.skin)).unwrap();
    let nodes = skeleton.nodes.into();
    let mesh = MeshToSave { uid, rig: rig.uid(), path: path.clone(), nodes, shape: open_shape(&model) };
    let project = ProjectToSave { name: "cube".into(), rigs: vec![rig], meshes: vec![mesh], ..Default::default() };
    folder.save(&project);
    let loaded = folder.load();
    assert!(loaded.notes.is_empty(), "{:?}", loaded.notes);
    assert_eq!(loaded.rigs, project.rigs);
    assert!(!loaded.rigs[0].skin(uid).unwrap().at_rest, "the file's own bind pose");
    assert_eq!(loaded.meshes[0].nodes[..], project.meshes[0].nodes[..]);
}

const FOLLOWS: &str = include_str!("../frozen/format-3.rigsmith.ron");

#[test]
fn the_frozen_file_of_format_4_keeps_dropped_parts() {
    let text = include_str!("../frozen/format-4.rigsmith.ron");
    let read = read_project(text.as_bytes()).unwrap();
    assert_eq!(read.notes, Vec::<String>::new());
    let [part] = read.project.rigs[0].rig.dropped_parts() else { panic!("{:?}", read.project) };
    assert_eq!((part.uid, part.part.as_str(), part.mirror), (Uid(0xc0), "parts/fk_chain.rig.ron", true));
    assert_eq!(part.joints, [Uid(0xa1)]);
    assert_eq!(write_project(&read.project), text);
    let wrong = text.replacen("mirror: true", "mirrored: true", 1);
    assert!(read_project(wrong.as_bytes()).unwrap_err().to_string().contains("mirrored"));
}

#[test]
fn the_template_that_a_rig_follows_is_kept_with_its_version() {
    let read = read_project(FOLLOWS.as_bytes()).unwrap();
    assert_eq!(read.notes, Vec::<String>::new());
    let template = &read.project.templates[0];
    let height = |rig: &Rig| rig.walk().next().unwrap().data.rest.translation.y;
    assert_eq!((template.path.as_str(), height(&template.base)), ("parts/chain.rig.ron", 1.0));
    assert_eq!(height(&read.project.rigs[0].rig), 2.0);
    assert_eq!(write_project(&read.project), FOLLOWS);
    for (from, to, what) in [
        (
            "rig: \"00000000000000a0\",\n            path",
            "rig: \"00000000000000b0\",\n            path",
            "which is not in the file",
        ),
        ("base: (\n                format: 1", "base: (\n                format: 0", "format 0"),
        ("path: \"parts", "way: 1, path: \"parts", "way"),
    ] {
        let error = read_project(FOLLOWS.replacen(from, to, 1).as_bytes()).unwrap_err();
        assert!(error.to_string().contains(what) && error.line > 30, "{what}: {error}");
    }
    // On the disk its path goes with the project's folder.
    let folder = Folder::new();
    let mut project = cube(&folder.mesh());
    let file = folder.mesh().with_file_name("t.rig.ron");
    let followed = ProjectTemplate { rig: project.rigs[0].uid(), path: file, base: Arc::new(template.base.clone()) };
    project.templates = vec![followed.clone()];
    folder.save(&project);
    let path = folder.0.path().join("work/../meshes/t.rig.ron");
    assert_eq!(folder.load().templates, [ProjectTemplate { path, ..followed }]);
}

/// Weights of some points, with a joint that joins the list, are saved with the others; taking them back gives the first
/// file.
#[test]
fn painted_weights_are_saved_with_the_project() {
    let folder = Folder::new();
    let mut project = cube(&folder.mesh());
    folder.save(&project);
    let text = folder.text();
    let mesh = project.meshes[0].uid;
    let before = project.rigs[0].skin(mesh).unwrap().clone();
    let mut rows = Weights { starts: vec![0], ..Weights::default() };
    rows.push([(3, 0.75), (0, 0.25)]);
    rows.push([(1, 1.0)]);
    let patch = WeightPatch::new(&before, vec![(Uid(0x77), Some(before.joints[0]))], vec![2, 7], rows);
    let inverse = project.rigs[0].apply(&RigEdit::SetWeights(mesh, Box::new(patch))).unwrap();
    folder.save(&project);
    assert_ne!(folder.text(), text, "the file names other weights");
    let loaded = folder.load();
    assert!(loaded.notes.is_empty(), "{:?}", loaded.notes);
    assert_eq!(loaded.rigs, project.rigs);
    project.rigs[0].apply(&inverse).unwrap();
    folder.save(&project);
    assert_eq!((folder.text(), folder.load().rigs), (text, project.rigs));
}
