//! Saving files that belong together: all of them or none, each of them whole.

use std::{
    collections::BTreeMap,
    ffi::OsString,
    fs, io,
    path::{Path, PathBuf},
};

use rigsmith::files::{
    Disk, DiskFile, Entry, Fault, FaultPlan, FaultyDisk, RealDisk, SaveError, is_temp_name, save_all_atomic,
};
use tempfile::TempDir;

fn fresh() -> TempDir {
    tempfile::tempdir().unwrap()
}

fn temps(folder: &Path) -> usize {
    fs::read_dir(folder).unwrap().filter(|entry| is_temp_name(&entry.as_ref().unwrap().file_name())).count()
}

/// Everything below a folder, temporary files excepted.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_file() && !is_temp_name(path.file_name().unwrap()))
        .map(|path| (path.clone(), fs::read(path).unwrap()))
        .collect()
}

fn plans(operations: usize) -> impl Iterator<Item = FaultPlan> {
    (0..operations).flat_map(|at| {
        Fault::ALL.into_iter().flat_map(move |fault| [false, true].map(|lasting| FaultPlan { at, fault, lasting }))
    })
}

#[test]
fn saving_a_set_leaves_whole_files_and_puts_them_back_when_one_fails() {
    let set = |folder: &Path, byte: u8| -> Vec<(PathBuf, Vec<u8>)> {
        ["a.bin", "b.png", "c.gltf"].map(|name| (folder.join(name), vec![byte; 5000])).to_vec()
    };
    let dry = fresh();
    let counted = FaultyDisk::new(RealDisk, None);
    save_all_atomic(&RealDisk, &set(dry.path(), 1)).unwrap();
    save_all_atomic(&counted, &set(dry.path(), 2)).unwrap();
    assert_eq!(temps(dry.path()), 0);
    for existed in [true, false] {
        for plan in plans(counted.operations() + 1) {
            let folder = fresh();
            if existed {
                save_all_atomic(&RealDisk, &set(folder.path(), 1)).unwrap();
            }
            let disk = FaultyDisk::new(RealDisk, Some(plan));
            let result = save_all_atomic(&disk, &set(folder.path(), 2));
            let context = format!("existed {existed}, {plan:?}, {result:?}, {:?}", disk.log());
            let now = contents(folder.path());
            for content in now.values() {
                assert!(content.len() == 5000 && content.iter().all(|&b| b == content[0]), "{context}");
            }
            let values: Vec<u8> = now.values().map(|content| content[0]).collect();
            let old: &[u8] = if existed { &[1, 1, 1] } else { &[] };
            match &result {
                Ok(()) | Err(SaveError::Unconfirmed { .. }) => assert_eq!(values, [2, 2, 2], "{context}"),
                Err(SaveError::Mixed { .. }) => assert!(plan.lasting || plan.fault.is_crash(), "{context}"),
                Err(_) => assert_eq!(values, old, "{context}"),
            }
            if !plan.lasting && !plan.fault.is_crash() {
                assert_eq!(temps(folder.path()), 0, "{context}");
            }
        }
    }
}

#[test]
fn the_main_file_of_a_set_comes_last() {
    let folder = fresh();
    let files = [(folder.path().join("images/skin.png"), vec![1]), (folder.path().join("model.gltf"), vec![2])];
    let counted = FaultyDisk::new(RealDisk, None);
    save_all_atomic(&counted, &files).unwrap();
    let renames: Vec<usize> =
        counted.log().iter().enumerate().filter(|(_, name)| **name == "rename").map(|(i, _)| i).collect();
    let last_sync = counted.log().iter().rposition(|name| *name == "sync").unwrap();
    assert_eq!(renames.len(), 2);
    assert!(last_sync < renames[0], "all are synced before the first takes its place");

    let other = fresh();
    let files = files.map(|(path, bytes)| (other.path().join(path.strip_prefix(folder.path()).unwrap()), bytes));
    let plan = FaultPlan { at: renames[1], fault: Fault::Crash, lasting: true };
    save_all_atomic(&FaultyDisk::new(RealDisk, Some(plan)), &files).unwrap_err();
    assert!(files[0].0.exists() && !files[1].0.exists());
}

#[test]
fn a_set_may_not_name_a_file_twice() {
    let folder = fresh();
    let path = folder.path().join("a.bin");
    let error = save_all_atomic(&RealDisk, &[(path.clone(), vec![1]), (path.clone(), vec![2])]).unwrap_err();
    assert!(matches!(error, SaveError::SameTarget { .. }), "{error}");
    assert!(!path.exists());
    save_all_atomic(&RealDisk, &[]).unwrap();
}

#[test]
fn the_files_of_a_set_stay_below_the_main_file() {
    let outer = tempfile::tempdir().unwrap();
    let main = outer.path().join("out/model.gltf");
    let set = |name: &str| [(main.with_file_name(name), vec![1]), (main.clone(), vec![2])];
    let error = save_all_atomic(&RealDisk, &set("images/skin.png")).unwrap_err();
    assert!(matches!(error, SaveError::NoFolder { .. }), "{error}");
    assert_eq!(fs::read_dir(outer.path()).unwrap().count(), 0, "only folders below the main file's are created");
    fs::create_dir(outer.path().join("out")).unwrap();
    let absolute = outer.path().join("secret").display().to_string();
    for name in ["../secret", "images/../../secret", &absolute] {
        let error = save_all_atomic(&RealDisk, &set(name)).unwrap_err();
        assert!(matches!(error, SaveError::Outside { .. }), "{name}: {error}");
    }
    assert!(!main.exists() && !outer.path().join("secret").exists());
    for name in ["skin.png", "images/deep/skin.png", "./skin.png"] {
        save_all_atomic(&RealDisk, &set(name)).unwrap();
        assert_eq!(fs::read(main.with_file_name(name)).unwrap(), [1]);
    }
}

/// A disk without hard links, as exFAT is.
struct WithoutHardLinks;

impl Disk for WithoutHardLinks {
    fn entry(&self, path: &Path, follow: bool) -> io::Result<Entry> {
        RealDisk.entry(path, follow)
    }
    fn read_link(&self, path: &Path) -> io::Result<PathBuf> {
        RealDisk.read_link(path)
    }
    fn canonical(&self, path: &Path) -> io::Result<PathBuf> {
        RealDisk.canonical(path)
    }
    fn list(&self, folder: &Path, limit: usize) -> io::Result<Vec<OsString>> {
        RealDisk.list(folder, limit)
    }
    fn create(&self, path: &Path) -> io::Result<Box<dyn DiskFile>> {
        RealDisk.create(path)
    }
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        RealDisk.rename(from, to)
    }
    fn hard_link(&self, _: &Path, _: &Path) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }
    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        RealDisk.sync_folder(folder)
    }
    fn remove(&self, path: &Path) -> io::Result<()> {
        RealDisk.remove(path)
    }
    fn create_folder(&self, path: &Path) -> io::Result<()> {
        RealDisk.create_folder(path)
    }
    fn open(&self, path: &Path) -> io::Result<Box<dyn io::Read + Send>> {
        RealDisk.open(path)
    }
}

#[test]
fn a_set_is_put_back_where_there_are_no_hard_links() {
    let folder = fresh();
    let set = |byte: u8| ["a", "b"].map(|name| (folder.path().join(name), vec![byte; 100]));
    save_all_atomic(&WithoutHardLinks, &set(1)).unwrap();
    let counted = FaultyDisk::new(WithoutHardLinks, None);
    save_all_atomic(&counted, &set(2)).unwrap();
    let last = counted.log().iter().rposition(|name| *name == "rename").unwrap();
    let disk = FaultyDisk::new(WithoutHardLinks, Some(FaultPlan { at: last, fault: Fault::Io, lasting: false }));
    save_all_atomic(&disk, &set(3)).unwrap_err();
    assert!(contents(folder.path()).values().all(|content| *content == [2; 100]));
    assert_eq!(temps(folder.path()), 0);
}
