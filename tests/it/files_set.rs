//! Saving files that belong together: whatever fails, the old ones or the finished ones are there, and nothing else changes.

mod other_disks;
mod stopped_saves;

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use glam::Vec3;
use rigsmith::{
    files::{
        Disk, FaultyDisk, FileSet, MeshShape, MeshToSave, ProjectToSave, RealDisk, SaveError, StoreError, is_temp_name,
        load_model, load_project, save_set, store_model, store_project,
    },
    mesh::{
        gltf::GltfWriteSettings,
        model::{Model, Weights},
        obj::{ObjSettings, SidecarFile, read_model},
    },
    rig::{JointData, Rig, RigEdit, SkinData, Uid},
};
use tempfile::TempDir;

use crate::files_faults::plans;

/// A set of each kind that Rigsmith saves, in versions that can be told apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    Gltf,
    Obj,
    Project,
}

/// The texture of a version; two versions share one.
fn texture(version: u32) -> Vec<u8> {
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    bytes.extend((version / 2).to_le_bytes().repeat(500));
    bytes
}

/// A textured triangle whose first point tells the version.
pub fn triangle(version: u32) -> Model {
    let obj = format!("mtllib a.mtl\nv {version} 0 0\nv 1 5 0\nv 0 1 9\nvt 0 0\nusemtl wood\nf 1/1 2/1 3/1\n");
    let mtl = format!("newmtl wood\nKd 0.5 0.5 0.{version}\nmap_Kd wood.png\n");
    let mut sidecar =
        |name: &str| Some(SidecarFile::Bytes(if name == "a.mtl" { mtl.clone().into() } else { texture(version) }));
    read_model(obj.as_bytes(), "scene", &ObjSettings::default(), &mut sidecar).unwrap()
}

/// The version of a triangle, if it is that of its texture.
fn version_of(model: &Model) -> Result<u32, String> {
    let version = model.points.iter().map(|point| point.x as u32).max().unwrap_or_default();
    match &model.material_set.images[..] {
        [image] if image.bytes == texture(version) => Ok(version),
        images => Err(format!("version {version} with {} images; {:?}", images.len(), model.notes)),
    }
}

fn share(version: u32) -> f32 {
    0.25 + version as f32 / 4096.0
}

fn project(mesh: &Path, version: u32) -> ProjectToSave {
    let (mut rig, uid) = (Rig::new(Uid(1), "rig"), Uid(0x50));
    for number in 0..2 {
        let mut joint = JointData { uid: Uid(10 + number), ..Default::default() };
        joint.rest.translation = Vec3::Y * number as f32;
        rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent: None, index: usize::MAX }).unwrap();
    }
    let model = load_model(&RealDisk, mesh).unwrap();
    let mut weights = Weights::default();
    model.points.iter().for_each(|_| weights.push([(0, share(version)), (1, 1.0 - share(version))]));
    let skin = SkinData { joints: vec![Uid(10), Uid(11)], weights, at_rest: true, ..Default::default() };
    rig.apply(&RigEdit::SetSkin(uid, Some(Arc::new(skin)))).unwrap();
    let shape = MeshShape::Open { triangles: model.point_triangles().into(), rest: Arc::new(model.at_rest()) };
    let mesh = MeshToSave { uid, rig: rig.uid(), path: mesh.into(), nodes: Arc::default(), shape };
    ProjectToSave { name: version.to_string(), rigs: vec![rig], meshes: vec![mesh], ..Default::default() }
}

impl Kind {
    pub const ALL: [Self; 3] = [Self::Gltf, Self::Obj, Self::Project];

    pub fn main(self, folder: &Path) -> PathBuf {
        folder.join(match self {
            Self::Gltf => "scene.gltf",
            Self::Obj => "scene.obj",
            Self::Project => "scene.rigsmith.ron",
        })
    }

    pub fn save(self, disk: &dyn Disk, folder: &Path, version: u32) -> Result<(), StoreError> {
        let path = self.main(folder);
        match self {
            Self::Project => store_project(disk, &path, &project(&folder.join("mesh.obj"), version)).map(drop),
            _ => store_model(disk, &path, &triangle(version), &GltfWriteSettings::default()).map(drop),
        }
    }

    /// The version in a folder, if it is whole.
    pub fn load(self, folder: &Path) -> Result<u32, String> {
        let path = self.main(folder);
        if self != Self::Project {
            return version_of(&load_model(&RealDisk, &path).map_err(|error| error.to_string())?);
        }
        let project = load_project(&RealDisk, &path).map_err(|error| error.to_string())?;
        let version: u32 = project.name.parse().map_err(|_| project.name.clone())?;
        let weights = project.rigs[0].skins().next().and_then(|(_, skin)| skin.weights.of(0).next());
        match (project.notes.is_empty(), weights) {
            (true, Some((0, weight))) if weight == share(version) => Ok(version),
            _ => Err(format!("version {version}, weights {weights:?}; {:?}", project.notes)),
        }
    }
}

/// A folder with files of somebody else under every name that comes to mind.
pub fn furnished() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in FOREIGN {
        fs::write(folder.path().join(name), name.repeat(10)).unwrap();
    }
    fs::write(folder.path().join("mesh.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    folder
}

const FOREIGN: [&str; 7] = [
    "wood.png",
    "wood.0123456789abcdef.png",
    "scene.bin",
    "scene.mtl",
    "scene.0000000000000050.skin",
    "notes.txt",
    "scene.0123456789abcdef.bin",
];

/// The names in a folder, after checking that what is somebody else's is as it was.
pub fn names(folder: &Path) -> BTreeSet<String> {
    for name in FOREIGN {
        assert_eq!(fs::read_to_string(folder.join(name)).ok(), Some(name.repeat(10)), "{name} was touched");
    }
    fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

/// The names in a folder where nothing but this version was ever saved.
pub fn expected(kind: Kind, version: u32) -> BTreeSet<String> {
    let folder = furnished();
    kind.save(&RealDisk, folder.path(), version).unwrap();
    names(folder.path())
}

pub fn temps(folder: &Path) -> usize {
    fs::read_dir(folder).unwrap().filter(|entry| is_temp_name(&entry.as_ref().unwrap().file_name())).count()
}

/// A copy of a furnished folder.
pub fn copy(from: &Path) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in names(from) {
        fs::copy(from.join(&name), folder.path().join(&name)).unwrap();
    }
    folder
}

/// Fails every operation of a save in every way.
fn check_every_operation(kind: Kind, existed: bool) {
    let before = furnished();
    if existed {
        kind.save(&RealDisk, before.path(), 1).unwrap();
    }
    let dry = copy(before.path());
    let counted = FaultyDisk::new(RealDisk, None);
    kind.save(&counted, dry.path(), 2).unwrap();
    let (done, after) = (names(dry.path()), expected(kind, 3));
    assert_eq!(done, expected(kind, 2));
    for plan in plans(counted.operations() + 1) {
        let folder = copy(before.path());
        let disk = FaultyDisk::new(RealDisk, Some(plan));
        let result = kind.save(&disk, folder.path(), 2);
        let context = format!("{kind:?}, existed {existed}, {plan:?}, {result:?}, {:?}", disk.log());
        let is_new = matches!(&result, Ok(()) | Err(StoreError::Save(SaveError::Unconfirmed { .. })));
        match (is_new, existed) {
            (false, false) => assert!(!kind.main(folder.path()).exists(), "{context}"),
            (is_new, _) => assert_eq!(kind.load(folder.path()), Ok(if is_new { 2 } else { 1 }), "{context}"),
        }
        names(folder.path());
        if is_new && !disk.has_failed() {
            assert_eq!(names(folder.path()), done, "{context}");
        }
        drop(disk);
        // The next save clears away what is left.
        kind.save(&RealDisk, folder.path(), 3).unwrap_or_else(|error| panic!("{context}: {error}"));
        assert_eq!(kind.load(folder.path()), Ok(3), "{context}");
        assert_eq!(names(folder.path()), after, "{context}");
    }
}

#[test]
fn a_gltf_is_saved_whole_or_not_at_all() {
    check_every_operation(Kind::Gltf, false);
}

#[test]
fn a_gltf_is_saved_over_another_whole_or_not_at_all() {
    check_every_operation(Kind::Gltf, true);
}

#[test]
fn an_obj_is_saved_whole_or_not_at_all() {
    check_every_operation(Kind::Obj, false);
}

#[test]
fn an_obj_is_saved_over_another_whole_or_not_at_all() {
    check_every_operation(Kind::Obj, true);
}

#[test]
fn a_project_is_saved_whole_or_not_at_all() {
    check_every_operation(Kind::Project, false);
}

#[test]
fn a_project_is_saved_over_another_whole_or_not_at_all() {
    check_every_operation(Kind::Project, true);
}

#[test]
fn companions_are_found_by_content_and_cleared_with_their_main_file() {
    for kind in Kind::ALL {
        let folder = furnished();
        let before = names(folder.path());
        for version in [1, 1, 2, 3, 2, 1] {
            kind.save(&RealDisk, folder.path(), version).unwrap();
            assert_eq!(kind.load(folder.path()), Ok(version));
            let now = names(folder.path());
            assert_eq!(now, expected(kind, version), "nothing of the versions before is left");
            let added: Vec<&str> = now.difference(&before).map(String::as_str).collect();
            let stems: BTreeSet<&str> = added.iter().map(|name| name.split('.').next().unwrap()).collect();
            assert_eq!(added.len(), if kind == Kind::Project { 2 } else { 3 }, "{added:?}");
            assert!(stems.iter().all(|stem| ["scene", "wood"].contains(stem)), "readable names: {added:?}");
        }
    }
}

#[test]
fn what_is_there_already_is_not_written_again() {
    for kind in Kind::ALL {
        let folder = furnished();
        let count = |version: u32, operation: &str| {
            let disk = FaultyDisk::new(RealDisk, None);
            kind.save(&disk, folder.path(), version).unwrap();
            disk.log().iter().filter(|name| **name == operation).count()
        };
        assert!(count(2, "hard_link") > 0);
        assert_eq!((count(2, "hard_link"), count(2, "create")), (0, 1), "{kind:?}: only the main file");
    }
}

#[test]
fn a_copy_of_the_main_file_keeps_its_companions() {
    for kind in Kind::ALL {
        let folder = furnished();
        kind.save(&RealDisk, folder.path(), 1).unwrap();
        let backup = folder.path().join("backup of scene.txt");
        fs::copy(kind.main(folder.path()), &backup).unwrap();
        kind.save(&RealDisk, folder.path(), 2).unwrap();
        kind.save(&RealDisk, folder.path(), 4).unwrap();
        fs::rename(&backup, kind.main(folder.path())).unwrap();
        assert_eq!(kind.load(folder.path()), Ok(1), "{kind:?}");
    }
}

#[test]
fn companions_that_other_files_name_stay() {
    // Deep in a large mesh, in a rig, in a project of the folder above, and in a model of one below.
    let deep = format!("{}\nusemtl wood\n", "# 0.125\n".repeat(1 << 18));
    let users: [(&str, &str); 4] =
        [("large.obj", deep.as_str()), ("fox.rig.ron", ""), ("../all.rigsmith.ron", ""), ("parts/hat.gltf", "")];
    for kind in Kind::ALL {
        for (user, before) in users {
            let above = tempfile::tempdir().unwrap();
            let folder = above.path().join("models");
            fs::create_dir_all(folder.join("parts")).unwrap();
            fs::write(folder.join("mesh.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
            let listed = || -> BTreeSet<String> {
                let entries = fs::read_dir(&folder).unwrap();
                entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
            };
            let others = listed();
            kind.save(&RealDisk, &folder, 2).unwrap();
            let mut companions: BTreeSet<String> = listed().difference(&others).cloned().collect();
            companions.remove(kind.main(&folder).file_name().unwrap().to_str().unwrap());
            assert!(!companions.is_empty());
            let named: String = companions.iter().map(|name| format!("{before}uses models/{name}\n")).collect();
            fs::write(folder.join(user), named).unwrap();
            for version in [4, 6] {
                kind.save(&RealDisk, &folder, version).unwrap();
                assert!(companions.is_subset(&listed()), "{kind:?}, {user}: {companions:?} of {:?}", listed());
            }
            fs::remove_file(folder.join(user)).unwrap();
        }
    }
}

#[test]
fn models_share_a_texture_until_the_last_one_drops_it() {
    let folder = furnished();
    for (kind, version) in [(Kind::Gltf, 2), (Kind::Obj, 3), (Kind::Gltf, 4)] {
        kind.save(&RealDisk, folder.path(), version).unwrap();
    }
    assert_eq!((Kind::Obj.load(folder.path()), Kind::Gltf.load(folder.path())), (Ok(3), Ok(4)));
    Kind::Obj.save(&RealDisk, folder.path(), 5).unwrap();
    assert_eq!((Kind::Obj.load(folder.path()), Kind::Gltf.load(folder.path())), (Ok(5), Ok(4)));
    let textures = names(folder.path()).into_iter().filter(|name| name.ends_with(".png")).count();
    assert_eq!(textures, 2 + 1, "two of somebody else and a shared one");
}

#[test]
fn a_name_that_is_taken_is_left_alone() {
    for kind in Kind::ALL {
        let fresh = expected(kind, 1);
        let before = names(furnished().path());
        let folder = furnished();
        for name in fresh.difference(&before).filter(|name| **name != *kind.main(Path::new("")).to_str().unwrap()) {
            fs::write(folder.path().join(name), "mine").unwrap();
        }
        let taken = names(folder.path());
        kind.save(&RealDisk, folder.path(), 1).unwrap();
        assert_eq!(kind.load(folder.path()), Ok(1));
        kind.save(&RealDisk, folder.path(), 4).unwrap();
        for name in taken.difference(&before) {
            assert_eq!(fs::read_to_string(folder.path().join(name)).unwrap(), "mine", "{name}");
        }
    }
    // It may even appear in the midst of a save.
    let folder = tempfile::tempdir().unwrap();
    let mut set = FileSet::new(&folder.path().join("a.gltf"));
    let name = set.add(&RealDisk, "a.bin", vec![1, 2, 3]);
    set.finish(b"{}".to_vec());
    fs::write(folder.path().join(&name), "mine").unwrap();
    let error = save_set(&RealDisk, &set).unwrap_err();
    assert!(matches!(&error, SaveError::Occupied { path } if path.ends_with(&name)), "{error}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no main file, and nothing left over");
    assert_eq!(fs::read_to_string(folder.path().join(&name)).unwrap(), "mine");
}

/// A set that is saved through a link is whole in the folder of the file that the link leads to, where others open it, and is
/// read through the link, too.
#[test]
fn a_link_stays_a_link_and_companions_lie_beside_the_file_that_it_leads_to() {
    #[cfg(unix)]
    for kind in Kind::ALL {
        let (folder, other) = (furnished(), furnished());
        let (main, real) = (kind.main(folder.path()), kind.main(other.path()));
        std::os::unix::fs::symlink(&real, &main).unwrap();
        let before = names(folder.path());
        for version in [1, 2] {
            // The mesh of a project has to lie below the project's folder.
            let saved = match kind {
                Kind::Project => store_project(&RealDisk, &main, &project(&other.path().join("mesh.obj"), version)),
                _ => store_model(&RealDisk, &main, &triangle(version), &GltfWriteSettings::default()),
            };
            assert_eq!(saved.unwrap(), [""; 0], "{kind:?}");
            assert_eq!((kind.load(folder.path()), kind.load(other.path())), (Ok(version), Ok(version)), "{kind:?}");
        }
        assert!(main.is_symlink(), "{kind:?}");
        assert_eq!(names(folder.path()), before, "{kind:?}: nothing lies beside the link");
        assert_eq!(names(other.path()), expected(kind, 2), "{kind:?}: nothing is left of the former version");
        // What lies beside a link is read from there, as other programs do.
        if kind == Kind::Gltf {
            for name in names(other.path()).difference(&before) {
                fs::rename(other.path().join(name), folder.path().join(name)).unwrap();
            }
            assert_eq!(kind.load(folder.path()), Ok(2));
        }
    }
}

#[test]
fn companions_are_as_private_as_their_main_file() {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let folder = furnished();
        Kind::Gltf.save(&RealDisk, folder.path(), 1).unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        fs::set_permissions(Kind::Gltf.main(folder.path()), fs::Permissions::from_mode(0o600)).unwrap();
        Kind::Gltf.save(&RealDisk, folder.path(), 2).unwrap();
        let before = names(furnished().path());
        for name in names(folder.path()).difference(&before) {
            assert_eq!(mode(&folder.path().join(name)), 0o600, "{name}");
        }
    }
}

#[test]
fn a_model_that_a_format_holds_nothing_of_is_refused() {
    let folder = furnished();
    let empty = Model::default();
    for (name, remedy) in [("scene.obj", "no mesh"), ("scene.gltf", "neither"), ("scene.glb", "neither")] {
        let path = folder.path().join(name);
        fs::write(&path, "work of days").unwrap();
        let error = store_model(&RealDisk, &path, &empty, &GltfWriteSettings::default()).unwrap_err();
        assert!(matches!(error, StoreError::Nothing { .. }) && error.to_string().contains(remedy), "{error}");
        assert_eq!(fs::read_to_string(&path).unwrap(), "work of days");
    }
}

#[test]
fn what_cannot_be_read_again_is_not_written() {
    let folder = furnished();
    Kind::Obj.save(&RealDisk, folder.path(), 1).unwrap();
    let before = names(folder.path());
    let mut broken = triangle(2);
    broken.points[1].y = f32::NAN;
    let path = Kind::Obj.main(folder.path());
    let error = store_model(&RealDisk, &path, &broken, &GltfWriteSettings::default()).unwrap_err();
    assert!(matches!(error, StoreError::Unreadable { .. }), "{error}");
    assert_eq!((Kind::Obj.load(folder.path()), names(folder.path())), (Ok(1), before));
}

#[test]
fn saves_at_the_same_time_leave_one_of_them_whole() {
    for kind in Kind::ALL {
        let folder = furnished();
        let done: BTreeMap<u32, ()> = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..4u32)
                .map(|thread| {
                    let folder = folder.path();
                    scope.spawn(move || {
                        for round in 0..6 {
                            // A set that another thread changes in between is refused, never mixed.
                            match kind.save(&RealDisk, folder, (thread + round) % 5 + 1) {
                                Ok(()) => {}
                                Err(StoreError::Save(SaveError::Occupied { .. })) => {}
                                Err(error) => panic!("{error}"),
                            }
                        }
                    })
                })
                .collect();
            threads.into_iter().enumerate().map(|(at, thread)| (at as u32, thread.join().unwrap())).collect()
        });
        assert_eq!(done.len(), 4);
        let version = kind.load(folder.path()).unwrap();
        assert_eq!(names(folder.path()), expected(kind, version), "{kind:?}");
        assert_eq!(temps(folder.path()), 0);
    }
}
