//! Saves on file systems that tell nobody of them and keep time and length of the file.

use std::{
    ffi::OsString,
    fs, io,
    path::{Path, PathBuf},
    sync::atomic::{AtomicUsize, Ordering},
    time::{Duration, Instant},
};

use rigsmith::files::{Disk, DiskFile, Entry, LOOK, PartFiles, RealDisk, SearchPaths, TemplateWatch};

use crate::disks::only_read;

/// A disk whose files seem to stay as they are; it can only be read. It counts the files that are opened.
#[derive(Default)]
struct MuteDisk {
    opened: AtomicUsize,
}

impl Disk for MuteDisk {
    fn entry(&self, path: &Path, follow: bool) -> io::Result<Entry> {
        RealDisk.entry(path, follow).map(|entry| Entry { len: 1, modified: None, ..entry })
    }
    fn list(&self, folder: &Path, limit: usize) -> io::Result<Vec<OsString>> {
        RealDisk.list(folder, limit)
    }
    fn open(&self, path: &Path) -> io::Result<Box<dyn io::Read + Send>> {
        self.opened.fetch_add(1, Ordering::Relaxed);
        RealDisk.open(path)
    }
    only_read!();
}

const TEMPLATE: &str =
    "(format: 2, name: \"t\", joints: [(label: \"body\")], parts: [(part: \"p.rig.ron\", parent: \"body\")])";
const PART: &str = "(format: 2, name: \"p\", kind: \"part\", joints: [(label: \"a\", tags: [control])])";

/// Longest time after which a save is taken note of where only the content tells of it.
const LONGEST: Duration = Duration::from_secs(2);

#[test]
fn a_save_of_which_only_the_content_tells_is_noticed_within_two_seconds() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let start = Instant::now();
    for pause in [LOOK, Duration::from_millis(250)] {
        // A save may come at any time between two reads of the content.
        for before in 0..=(Duration::from_millis(500).as_millis() / pause.as_millis()) as u32 {
            for (name, text, save) in [
                ("t.rig.ron", TEMPLATE, TEMPLATE.replace("body", "hips")),
                ("p.rig.ron", PART, PART.replace("\"a\"", "\"b\"")),
            ] {
                fs::write(at("t.rig.ron"), TEMPLATE).unwrap();
                fs::write(at("p.rig.ron"), PART).unwrap();
                let disk = MuteDisk::default();
                let mut files = PartFiles::new(&disk).with_site(SearchPaths { folders: Vec::new() });
                files.complete(&at("t.rig.ron"), TEMPLATE.as_bytes()).unwrap();
                let mut watch = TemplateWatch::new(&at("t.rig.ron"));
                watch.read(&disk).unwrap();
                watch.follow(files.asked, true);
                for look in 0..before {
                    assert_eq!(watch.look_at(&disk, start + pause * look), None, "{name} is as it was");
                }
                assert_eq!(save.len(), text.len());
                fs::write(at(name), &save).unwrap();
                let most = (LONGEST.as_millis() / pause.as_millis()) as u32;
                let seen = (0..most).find_map(|look| watch.look_at(&disk, start + pause * (before + look)));
                let content = if name == "t.rig.ron" { save } else { TEMPLATE.to_owned() };
                assert_eq!(seen.as_deref(), Some(content.as_bytes()), "{name}, saved after {before} looks");
            }
        }
    }
}

#[test]
fn a_file_that_seems_unchanged_is_read_twice_a_second_and_no_more() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.rig.ron");
    fs::write(&path, PART).unwrap();
    let disk = MuteDisk::default();
    let mut watch = TemplateWatch::new(&path);
    watch.read(&disk).unwrap();
    let (start, before) = (Instant::now(), disk.opened.load(Ordering::Relaxed));
    let looks = (Duration::from_secs(10).as_millis() / LOOK.as_millis()) as u32;
    assert!((0..looks).all(|look| watch.look_at(&disk, start + LOOK * look).is_none()));
    let reads = disk.opened.load(Ordering::Relaxed) - before;
    assert!((19..=21).contains(&reads), "{reads} reads in {looks} looks");
}
