//! Reading: limits, errors that say what to do, and models that reach only their own folder.

use std::{
    ffi::OsString,
    fs, io,
    path::{Path, PathBuf},
};

use rigsmith::files::{
    Disk, DiskFile, Entry, Fault, FaultPlan, FaultyDisk, LoadShapesError, ModelFolder, ReadError, RealDisk, UriError,
    load_model, load_shapes, open, read_capped,
};
use tempfile::{TempDir, tempdir};

use crate::disks::only_read;

fn fresh() -> TempDir {
    tempdir().unwrap()
}

fn large() -> Vec<u8> {
    (0..100_000u32).flat_map(u32::to_le_bytes).collect()
}

#[test]
fn what_cannot_be_read_is_said_with_a_remedy() {
    let folder = fresh();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("character.obj"), b"v 0 0 0").unwrap();
    fs::write(at("empty.obj"), b"").unwrap();
    for (path, expected) in [
        (at("charakter.obj"), "did you mean `character.obj`?"),
        (at("Character.OBJ.x"), "did you mean `character.obj`?"),
        (at("quite_different.glb"), "check the path"),
        (at("nowhere/a.obj"), "either; check the path"),
        (at("empty.obj/a.obj"), "is a file, not a folder"),
        (at("empty.obj"), "is empty; export or copy it again"),
        (folder.path().to_path_buf(), "is a folder; give the name of a file in it"),
    ] {
        for error in [
            read_capped(&RealDisk, &path, 1 << 20).unwrap_err().to_string(),
            open(&RealDisk, &path).map(|_| ()).unwrap_err().to_string(),
        ] {
            assert!(error.contains(expected), "{}: {error}", path.display());
        }
    }
    assert_eq!(read_capped(&RealDisk, &at("character.obj"), 7).unwrap(), b"v 0 0 0");
    let error = read_capped(&RealDisk, &at("character.obj"), 6).unwrap_err();
    assert!(matches!(error, ReadError::TooLarge { limit: 6, .. }), "{error}");
}

#[cfg(unix)]
#[test]
fn devices_are_not_read() {
    let error = read_capped(&RealDisk, Path::new("/dev/null"), 10).unwrap_err();
    assert!(matches!(error, ReadError::NotAFile { .. }), "{error}");
}

/// A disk on which every file claims a length of its own; it can only be read.
struct LyingDisk(u64);

/// The name of a file whose content never ends.
const ENDLESS: &str = "endless";

impl Disk for LyingDisk {
    fn entry(&self, path: &Path, follow: bool) -> io::Result<Entry> {
        RealDisk.entry(path, follow).map(|entry| Entry { len: self.0, ..entry })
    }
    fn list(&self, folder: &Path, limit: usize) -> io::Result<Vec<OsString>> {
        RealDisk.list(folder, limit)
    }
    fn open(&self, path: &Path) -> io::Result<Box<dyn io::Read + Send>> {
        match path.ends_with(ENDLESS) {
            true => Ok(Box::new(io::repeat(7))),
            false => RealDisk.open(path),
        }
    }
    only_read!();
}

#[test]
fn a_false_length_neither_reserves_nor_truncates() {
    let folder = fresh();
    let path = folder.path().join("a");
    fs::write(&path, large()).unwrap();
    for claimed in [0, 1, 1 << 40] {
        let read = read_capped(&LyingDisk(claimed), &path, u64::MAX).unwrap();
        assert_eq!(read, large());
        assert!(read.capacity() <= 16 << 20);
    }
    let error = read_capped(&LyingDisk(1), &path, 100).unwrap_err();
    assert!(matches!(error, ReadError::TooLarge { .. }), "{error}");
    let endless = folder.path().join(ENDLESS);
    fs::write(&endless, b"x").unwrap();
    let error = read_capped(&LyingDisk(1), &endless, 1 << 20).unwrap_err();
    assert!(matches!(error, ReadError::TooLarge { .. }), "{error}");
}

#[test]
fn every_failing_read_is_an_error() {
    let folder = fresh();
    let path = folder.path().join("a");
    fs::write(&path, large()).unwrap();
    let counted = FaultyDisk::new(RealDisk, None);
    read_capped(&counted, &path, 1 << 20).unwrap();
    let operations = counted.operations();
    for plan in (0..operations).flat_map(|at| Fault::ALL.map(|fault| FaultPlan { at, fault, lasting: false })) {
        let disk = FaultyDisk::new(RealDisk, Some(plan));
        match read_capped(&disk, &path, 1 << 20) {
            Ok(bytes) => assert!(plan.fault == Fault::Short && bytes == large(), "{plan:?}"),
            Err(error) => assert!(error.to_string().contains('a') && plan.fault != Fault::Short, "{plan:?} {error}"),
        }
    }
}

#[test]
fn a_model_reaches_only_its_own_folder() {
    let outer = fresh();
    let at = |name: &str| outer.path().join(name);
    fs::create_dir_all(at("model/Textures")).unwrap();
    fs::create_dir_all(at("model_2")).unwrap();
    fs::write(at("secret.png"), b"secret").unwrap();
    fs::write(at("model_2/b.png"), b"secret").unwrap();
    fs::write(at("model/m.gltf"), b"{}").unwrap();
    fs::write(at("model/Textures/Skin 1.PNG"), b"skin").unwrap();
    let folder = ModelFolder::of(&RealDisk, &at("model/m.gltf")).unwrap();
    for uri in [
        "Textures/Skin 1.PNG",
        "textures/skin 1.png",
        r"textures\SKIN 1.png",
        "./Textures//Skin 1.PNG",
        r".\Textures\..\Textures\Skin 1.PNG",
    ] {
        assert_eq!(folder.read(uri, 100).unwrap(), b"skin", "{uri}");
        assert!(folder.has(uri), "{uri}");
    }
    let long = "a/".repeat(5000);
    let secret = at("secret.png");
    for (uri, expected) in [
        ("../secret.png", "outside its folder"),
        ("Textures/../../secret.png", "outside its folder"),
        (r"..\secret.png", "outside its folder"),
        ("../model_2/b.png", "outside its folder"),
        ("..", "outside its folder"),
        (secret.to_str().unwrap(), "absolute path"),
        (r"\\server\share\a.png", "absolute path"),
        (r"\\?\C:\a.png", "absolute path"),
        (r"C:\textures\a.png", "absolute path"),
        ("c:a.png", "absolute path"),
        ("file:///etc/passwd", "URL"),
        ("https://example.org/a.png", "URL"),
        ("data:image/png;base64,AAAA", "URL"),
        ("", "names no file"),
        (".", "names no file"),
        ("a\0.png", "control characters"),
        ("a\n.png", "control characters"),
        (&long, "too long"),
        ("Textures", "is a folder"),
        ("Textures/skin 2.png", "did you mean `Skin 1.PNG`?"),
        ("m.gltf/a.png", "is a file, not a folder"),
        ("nowhere/a.png", "there is no folder"),
    ] {
        let error = folder.read(uri, 100).unwrap_err().to_string();
        assert!(error.contains(expected), "{uri}: {error}");
        assert!(error.len() < 600 && !error.contains('\0'), "{error}");
        assert!(!folder.has(uri), "{uri}");
    }
    assert!(matches!(folder.read("m.gltf", 1), Err(UriError::Read { source: ReadError::TooLarge { .. }, .. })));
    assert!(ModelFolder::of(&RealDisk, &at("nowhere/m.gltf")).is_err());
}

/// The name of a link that leads nowhere is the most like itself.
#[cfg(unix)]
#[test]
fn a_link_that_leads_nowhere_is_told_as_one() {
    let folder = fresh();
    let link = folder.path().join("body.obj");
    fs::write(folder.path().join("body_2.obj"), b"v 0 0 0").unwrap();
    std::os::unix::fs::symlink("gone.obj", &link).unwrap();
    for error in [
        read_capped(&RealDisk, &link, 1 << 20).unwrap_err().to_string(),
        open(&RealDisk, &link).map(|_| ()).unwrap_err().to_string(),
    ] {
        assert!(error.contains("a symbolic link to a file that is not there"), "{error}");
        assert!(!error.contains("did you mean"), "{error}");
    }
}

#[cfg(unix)]
#[test]
fn links_out_of_a_model_folder_are_refused() {
    use std::os::unix::fs::symlink;

    let outer = fresh();
    let at = |name: &str| outer.path().join(name);
    fs::create_dir_all(at("model/textures")).unwrap();
    fs::write(at("secret.png"), b"secret").unwrap();
    fs::write(at("model/a.png"), b"a").unwrap();
    symlink("../secret.png", at("model/link.png")).unwrap();
    symlink("..", at("model/up")).unwrap();
    symlink("../a.png", at("model/textures/inside.png")).unwrap();
    let folder = ModelFolder::of(&RealDisk, &at("model/m.gltf")).unwrap();
    for uri in ["link.png", "LINK.png", "up/secret.png", "up/SECRET.png", "up/model/a.png", "up"] {
        let result = folder.read(uri, 100);
        assert!(matches!(result, Err(UriError::Outside { .. })), "{uri}: {result:?}");
    }
    assert_eq!(folder.read("textures/inside.png", 100).unwrap(), b"a");
}

#[test]
fn folders_of_missing_files_are_listed_once() {
    let outer = fresh();
    let at = |name: &str| outer.path().join(name);
    fs::write(at("m.gltf"), b"{}").unwrap();
    for number in 0..20 {
        fs::write(at(&format!("texture_{number}.png")), b"skin").unwrap();
    }
    let lists = |missing: usize| {
        let disk = FaultyDisk::new(RealDisk, None);
        let folder = ModelFolder::of(&disk, &at("m.gltf")).unwrap();
        let told = |number: usize| folder.read(&format!("textur_{number}.png"), 10).unwrap_err().to_string();
        let hinted = (0..missing).filter(|number| told(*number).contains("did you mean `texture_")).count();
        assert_eq!(folder.read("TEXTURE_7.png", 10).unwrap(), b"skin");
        (disk.log().iter().filter(|name| **name == "list").count(), hinted)
    };
    assert_eq!(lists(1), (1, 1));
    assert_eq!(lists(20), (1, 20));
    let (listed, hinted) = lists(400);
    assert_eq!(listed, 1);
    assert!((20..100).contains(&hinted), "{hinted} of 400 missing files are compared with all names");
}

#[test]
fn a_folder_of_shapes_is_read_whole_or_not_at_all() {
    let folder = fresh();
    let at = |name: &str| folder.path().join(name);
    (0..4096).for_each(|number| fs::write(at(&format!("a{number:04}.txt")), "").unwrap());
    fs::write(at("z.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let rest = load_model(&RealDisk, &at("z.obj")).unwrap();
    assert_eq!(load_shapes(&RealDisk, folder.path(), &rest).unwrap().names, ["z"]);
    (0..4096).for_each(|number| fs::write(at(&format!("b{number:04}.obj")), "").unwrap());
    let error = load_shapes(&RealDisk, folder.path(), &rest).unwrap_err();
    assert!(matches!(error, LoadShapesError::TooMany { found: 4097, .. }), "{error}");
}
