//! Projects: what is saved comes back, what is wrong is named with its place, and a missing mesh loses nothing.

mod meshes;

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
        FaceCut, PoseOffset, Rig, RigEdit, SkinData, Uid, UidSource, WeightPatch,
        character::{Character, character, import_skeleton},
        operations::Operation,
        project::{
            JournalReference, MeshReference, Project, ProjectCamera, ProjectRig, ProjectView, SkinReference,
            read_project, write_project,
        },
        step::edits_from_empty,
    },
};

use crate::{
    edits::{Bench, command, random_rig, steps},
    template::place,
};

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
        graph: [].into(),
        clip: None,
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
        ("last: 1234", "last: -1", "out of bounds; write a whole number", "last: -1"),
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
        .replacen("format: 1,", "format: 9, lights: [(x: 1)],", 1)
        .replacen("mode: \"Pose\"", "fog: 0.5, mode: \"Pose\"", 1)
        .replacen("skins: [", "muscles: [], skins: [", 1)
        .replacen("format: 1,", "format: 5, meaning: 42,", 1);
    let read = read_project(text.as_bytes()).unwrap();
    assert_eq!(read.project, frozen());
    let told = read.notes.join("\n");
    for part in ["project has format 9", "`lights`", "`fog`", "`muscles`", "template has format 5"] {
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

#[test]
fn the_frozen_file_of_format_5_keeps_places_in_the_graph() {
    let text = include_str!("../frozen/format-5.rigsmith.ron");
    let read = read_project(text.as_bytes()).unwrap();
    assert_eq!(read.notes, Vec::<String>::new());
    let mut project = read.project;
    let places: [(Uid, [f32; 2]); 2] = [(Uid(0xb1), [-40.0, 220.0]), (Uid(0xc0), [0.0, 1020.5])];
    assert!(project.view.graph.iter().map(|(uid, place)| (*uid, *place)).eq(places));
    assert_eq!(write_project(&project), text);
    // A place that is none is left out, and told.
    let broken = read_project(text.replacen("220.0", "inf", 1).as_bytes()).unwrap();
    assert_eq!((broken.project.view.graph.len(), broken.notes.len()), (1, 1), "{:?}", broken.notes);
    // Without places the file is of the format before.
    project.view.graph.clear();
    assert_eq!(write_project(&project), include_str!("../frozen/format-4.rigsmith.ron"));
}

#[test]
fn the_frozen_file_of_format_6_keeps_cuts_of_faces() {
    let text = include_str!("../frozen/format-6.rigsmith.ron");
    let read = read_project(text.as_bytes()).unwrap();
    assert_eq!(read.notes, Vec::<String>::new());
    let mut project = read.project;
    let rig = &project.rigs[0].rig;
    assert_eq!(rig.face_cut(Uid(0xd0)), Some(FaceCut { bones: 80, groups: Some(9) }));
    assert_eq!(rig.face_cut(Uid(0xd1)), Some(FaceCut { bones: 24, groups: None }));
    assert_eq!(rig.face_cut(Uid(0xd2)), None);
    assert_eq!(write_project(&project), text);
    // A journal begins with edits that make the whole document.
    let mut again = Rig::new(rig.uid(), "chain");
    edits_from_empty(rig).iter().for_each(|edit| drop(again.apply(edit).unwrap()));
    assert_eq!(again.face_cuts(), rig.face_cuts());
    let twice = text.replacen("00000000000000d1", "00000000000000d0", 1);
    let error = read_project(twice.as_bytes()).unwrap_err();
    assert!(error.to_string().contains("two cuts"), "{error}");
    assert_eq!(error.line, place(&twice, "bones: 24").0, "{error}");
    // All edits have inverses, and without cuts the file is of the format before.
    let inverses: Vec<RigEdit> = [Uid(0xd0), Uid(0xd1)]
        .into_iter()
        .map(|mesh| project.rigs[0].rig.apply(&RigEdit::SetFaceCut(mesh, None)).unwrap())
        .collect();
    assert_eq!(write_project(&project), include_str!("../frozen/format-5.rigsmith.ron"));
    for inverse in inverses {
        project.rigs[0].rig.apply(&inverse).unwrap();
    }
    assert_eq!(write_project(&project), text);
}

#[test]
fn the_frozen_file_of_format_7_keeps_texts_of_templates_with_parts() {
    let text = include_str!("../frozen/format-7.rigsmith.ron");
    let read = read_project(text.as_bytes()).unwrap();
    assert_eq!(read.notes, Vec::<String>::new());
    let mut project = read.project;
    let kept = project.templates[0].text.clone().unwrap();
    assert!(kept.starts_with("(\n    format: 2,") && kept.contains("\n        // The tail.\n"), "{kept}");
    assert_eq!(write_project(&project), text);
    // Marks of strings in the text are no marks of the project.
    project.templates[0].text = Some("(name: r##\"a\"##) // \"#".to_owned());
    assert_eq!(read_project(write_project(&project).as_bytes()).unwrap().project, project);
    // Without the text the file is of the format before.
    project.templates[0].text = None;
    assert_eq!(write_project(&project), include_str!("../frozen/format-6.rigsmith.ron"));
}

#[test]
fn the_frozen_file_of_format_8_keeps_the_open_clip() {
    let text = include_str!("../frozen/format-8.rigsmith.ron");
    let read = read_project(text.as_bytes()).unwrap();
    assert_eq!(read.notes, Vec::<String>::new());
    let mut project = read.project;
    assert_eq!(project.view.clip, Some(Uid(0xc1)));
    assert_eq!(write_project(&project), text);
    // Where the first clip is open the file is of the format before.
    project.view.clip = None;
    assert_eq!(write_project(&project), include_str!("../frozen/format-7.rigsmith.ron"));
}

const CUBE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
    f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

/// A folder with a project's folder, in which its mesh has one of its own.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        fs::create_dir_all(folder.0.path().join("work/meshes")).unwrap();
        fs::write(folder.mesh(), CUBE).unwrap();
        folder
    }

    fn mesh(&self) -> std::path::PathBuf {
        self.0.path().join("work/meshes/cube.obj")
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
        ..Default::default()
    }
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
    let followed =
        ProjectTemplate { rig: project.rigs[0].uid(), path: file, base: Arc::new(template.base.clone()).into() };
    project.templates = vec![followed.clone()];
    folder.save(&project);
    assert_eq!(folder.load().templates, [followed]);
}
