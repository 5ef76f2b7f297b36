//! Saving: whole files whatever fails, and errors that say what to do.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::{Duration, Instant, SystemTime},
};

use rigsmith::files::{
    Disk, Fault, FaultPlan, FaultyDisk, FileWatch, RealDisk, SaveError, check_place, is_temp_name, remove_stale_temps,
    save_atomic, stage_file,
};
use tempfile::TempDir;

use crate::bench::HANG;

const OLD: &[u8] = b"the old content, which must not be lost";

fn fresh() -> TempDir {
    tempfile::tempdir().unwrap()
}

fn finished() -> Vec<u8> {
    (0..100_000u32).flat_map(u32::to_le_bytes).collect()
}

fn temps(folder: &Path) -> usize {
    fs::read_dir(folder).unwrap().filter(|entry| is_temp_name(&entry.as_ref().unwrap().file_name())).count()
}

fn plans(operations: usize) -> impl Iterator<Item = FaultPlan> {
    (0..operations).flat_map(|at| {
        Fault::ALL.into_iter().flat_map(move |fault| [false, true].map(|lasting| FaultPlan { at, fault, lasting }))
    })
}

#[test]
fn a_staged_file_is_in_its_place_once_it_is_put_there() {
    let folder = fresh();
    let path = folder.path().join("a.skin");
    fs::write(&path, OLD).unwrap();
    drop(stage_file(&RealDisk, &path, b"given up").unwrap());
    assert_eq!((fs::read(&path).unwrap(), temps(folder.path())), (OLD.to_vec(), 0));
    let staged = stage_file(&RealDisk, &path, b"the next one").unwrap();
    // Another save in the folder clears away what dead processes left, and nothing that waits.
    save_atomic(&RealDisk, &folder.path().join("b.skin"), b"another").unwrap();
    assert_eq!((fs::read(&path).unwrap(), temps(folder.path())), (OLD.to_vec(), 1));
    assert_eq!(staged.path(), path);
    staged.put_in_place().unwrap();
    assert_eq!((fs::read(&path).unwrap(), temps(folder.path())), (b"the next one".to_vec(), 0));
}

#[test]
fn a_place_is_checked_without_a_trace() {
    let folder = fresh();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("there"), OLD).unwrap();
    check_place(&RealDisk, &at("there")).unwrap();
    check_place(&RealDisk, &at("later")).unwrap();
    assert!(matches!(check_place(&RealDisk, &at("nowhere/a")), Err(SaveError::NoFolder { .. })));
    assert!(matches!(check_place(&RealDisk, &at("there/a")), Err(SaveError::NoFolder { .. })));
    assert!(matches!(check_place(&RealDisk, folder.path()), Err(SaveError::IsFolder { .. })));
    assert_eq!(fs::read(at("there")).unwrap(), OLD);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn saving_over_a_file_leaves_the_old_or_the_finished_one_whatever_fails() {
    for existed in [true, false] {
        let dry = fresh();
        let counted = FaultyDisk::new(RealDisk, None);
        let prepare = |folder: &TempDir| {
            let path = folder.path().join("rig.rig.ron");
            if existed {
                fs::write(&path, OLD).unwrap();
            }
            path
        };
        save_atomic(&counted, &prepare(&dry), &finished()).unwrap();
        let operations = counted.operations();
        assert!(operations >= 5, "{:?}", counted.log());
        // A short write brings one more of them.
        for plan in plans(operations + 1) {
            let folder = fresh();
            let path = prepare(&folder);
            let disk = FaultyDisk::new(RealDisk, Some(plan));
            let result = save_atomic(&disk, &path, &finished());
            let now = fs::read(&path).ok();
            let context = format!("existed {existed}, {plan:?}, {result:?}, {:?}", disk.log());
            match &result {
                Ok(()) => assert!(now.as_deref() == Some(&finished()), "{context}"),
                Err(SaveError::Unconfirmed { .. }) => assert!(now.as_deref() == Some(&finished()), "{context}"),
                Err(_) => assert!(now.as_deref() == existed.then_some(OLD), "{context}"),
            }
            assert!(result.is_ok() || disk.has_failed(), "{context}");
            assert!(result.is_ok() || plan.fault != Fault::Short, "{context}");
            let names = fs::read_dir(folder.path()).unwrap().count();
            assert!(names - temps(folder.path()) <= 1, "{context}");
            if !plan.lasting && !plan.fault.is_crash() {
                assert_eq!(temps(folder.path()), 0, "{context}");
            }
        }
    }
}

const SAVE_LOOP: &str = "RIGSMITH_TEST_SAVE_LOOP";

/// Does nothing unless the test below starts it in a process of its own.
#[test]
fn child_that_saves_until_killed() {
    let Some(path) = std::env::var_os(SAVE_LOOP).map(PathBuf::from) else {
        return;
    };
    let started = Instant::now();
    for round in 0u64.. {
        // In case the parent is gone.
        if started.elapsed() > HANG {
            return;
        }
        println!("saving {round}.");
        let bytes: Vec<u8> = round.to_le_bytes().repeat(32 * 1024);
        save_atomic(&RealDisk, &path, &bytes).unwrap();
    }
}

#[test]
fn killed_while_saving_the_file_is_whole() {
    let folder = fresh();
    let path = folder.path().join("killed.skin");
    fs::write(&path, 7u64.to_le_bytes().repeat(32 * 1024)).unwrap();
    let (_, module) = module_path!().split_once("::").unwrap();
    let mut seen = std::collections::BTreeSet::new();
    let mut left = 0;
    for round in 0..30u64 {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args([&format!("{module}::child_that_saves_until_killed"), "--exact", "--nocapture", "--test-threads=1"])
            .env(SAVE_LOOP, &path)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut started = std::io::BufReader::new(child.stdout.take().unwrap());
        let mut line = String::new();
        while !line.contains(&format!("saving {}.", round % 4)) {
            line.clear();
            assert!(std::io::BufRead::read_line(&mut started, &mut line).unwrap() > 0, "the child saves");
        }
        // Spread over the few milliseconds that one save takes.
        std::thread::sleep(Duration::from_micros(round * 7919 % 6_000));
        child.kill().unwrap();
        child.wait().unwrap();
        let bytes = fs::read(&path).unwrap();
        assert_eq!(bytes.len(), 256 * 1024, "round {round}");
        assert!(bytes.chunks_exact(8).all(|chunk| chunk == &bytes[..8]), "round {round}");
        seen.insert(bytes[..8].to_vec());
        left += usize::from(temps(folder.path()) > left);
    }
    assert!(seen.len() > 1, "at least one child replaced the file");
    println!("{left} of 30 kills left a temporary file");
    save_atomic(&RealDisk, &path, b"the next one").unwrap();
    assert_eq!(temps(folder.path()), 0, "the next save clears up");
}

#[test]
fn what_cannot_be_saved_is_said_with_a_remedy() {
    let folder = fresh();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("file"), OLD).unwrap();
    fs::create_dir(at("folder")).unwrap();
    fs::write(at("protected"), OLD).unwrap();
    let mut permissions = fs::metadata(at("protected")).unwrap().permissions();
    permissions.set_readonly(true);
    fs::set_permissions(at("protected"), permissions).unwrap();
    for (path, expected) in [
        (at("folder"), "it is a folder; give the name of a file in it"),
        (at("folder/"), "it is a folder"),
        (at("folder/.."), "it is a folder"),
        (at("nowhere/"), "add a file name"),
        (PathBuf::new(), "add a file name"),
        (at("missing/rig.rig"), "create it or choose another"),
        (at("file/rig.rig"), "create it or choose another"),
        (at("protected"), "write-protected"),
    ] {
        let error = save_atomic(&RealDisk, &path, b"x").unwrap_err();
        assert!(error.to_string().contains(expected), "{}: {error}", path.display());
    }
    assert_eq!(fs::read(at("file")).unwrap(), OLD);
    assert_eq!(fs::read(at("protected")).unwrap(), OLD);
    assert_eq!(temps(folder.path()), 0);
    for (fault, at_step, expected) in [
        (Fault::NoSpace, "write", "the disk is full, and what was there is unchanged; free some space"),
        (Fault::NoSpace, "sync", "the disk is full, and what was there is unchanged; free some space"),
        (Fault::NoAccess, "create", "choose another folder"),
        (Fault::Io, "sync", "waiting for the disk failed"),
    ] {
        let counted = FaultyDisk::new(RealDisk, None);
        save_atomic(&counted, &at("file"), OLD).unwrap();
        let step = counted.log().iter().position(|name| *name == at_step).unwrap();
        let disk = FaultyDisk::new(RealDisk, Some(FaultPlan { at: step, fault, lasting: false }));
        let error = save_atomic(&disk, &at("file"), b"replacement").unwrap_err().to_string();
        assert!(error.contains(expected) && error.contains("unchanged") && error.contains("file"), "{error}");
    }
}

#[test]
fn a_bare_name_is_saved_in_the_current_folder() {
    // Tests share the current folder: a name that nobody else uses, removed at once.
    let name = format!("rigsmith-test-{}.rig", std::process::id());
    let saved = save_atomic(&RealDisk, Path::new(&name), OLD);
    let read = fs::read(&name);
    let _ = fs::remove_file(&name);
    saved.unwrap();
    assert_eq!(read.unwrap(), OLD);
}

#[cfg(unix)]
mod on_unix {
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;

    #[test]
    fn permissions_are_kept() {
        let folder = fresh();
        let path = folder.path().join("private");
        fs::write(&path, OLD).unwrap();
        for mode in [0o600, 0o640, 0o755] {
            fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
            save_atomic(&RealDisk, &path, b"replacement").unwrap();
            assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o7777, mode);
        }
    }

    #[test]
    fn links_are_followed_not_replaced() {
        let folder = fresh();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("real")).unwrap();
        fs::write(at("real/rig"), OLD).unwrap();
        symlink("real/rig", at("link")).unwrap();
        symlink(at("link"), at("link_to_link")).unwrap();
        symlink("real/later", at("dangling")).unwrap();
        symlink("circle_b", at("circle_a")).unwrap();
        symlink("circle_a", at("circle_b")).unwrap();
        symlink("real", at("folder_link")).unwrap();
        save_atomic(&RealDisk, &at("link_to_link"), b"one").unwrap();
        assert_eq!(fs::read(at("real/rig")).unwrap(), b"one");
        save_atomic(&RealDisk, &at("dangling"), b"two").unwrap();
        assert_eq!(fs::read(at("real/later")).unwrap(), b"two");
        save_atomic(&RealDisk, &at("folder_link/rig"), b"three").unwrap();
        assert_eq!(fs::read(at("real/rig")).unwrap(), b"three");
        for link in ["link", "link_to_link", "dangling", "folder_link"] {
            assert!(fs::symlink_metadata(at(link)).unwrap().is_symlink(), "{link}");
        }
        assert!(matches!(save_atomic(&RealDisk, &at("circle_a"), b"x"), Err(SaveError::LinkLoop { .. })));
        assert!(matches!(save_atomic(&RealDisk, &at("folder_link"), b"x"), Err(SaveError::IsFolder { .. })));
    }

    #[test]
    fn devices_are_refused() {
        for path in ["/dev/null", "/dev/full"] {
            if Path::new(path).exists() {
                let error = save_atomic(&RealDisk, Path::new(path), b"x").unwrap_err();
                assert!(matches!(error, SaveError::NotAFile { .. }), "{error}");
            }
        }
    }

    #[test]
    fn a_read_only_folder_is_refused_and_nothing_lost() {
        let folder = fresh();
        let path = folder.path().join("rig");
        fs::write(&path, OLD).unwrap();
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o555)).unwrap();
        if fs::write(folder.path().join("probe"), b"").is_ok() {
            println!("skipped: the administrator may write anywhere");
        } else {
            let error = save_atomic(&RealDisk, &path, b"x").unwrap_err();
            assert!(matches!(error, SaveError::NoAccess { .. }), "{error}");
            assert_eq!(fs::read(&path).unwrap(), OLD);
        }
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
    }

    #[test]
    fn a_full_disk_leaves_the_old_file() {
        let folder = fresh();
        let mounted = Command::new("mount")
            .args(["-t", "tmpfs", "-o", "size=64k", "tmpfs"])
            .arg(folder.path())
            .stderr(Stdio::null())
            .status();
        if !mounted.is_ok_and(|status| status.success()) {
            println!("skipped: a small file system cannot be mounted here");
            return;
        }
        let path = folder.path().join("rig");
        let outcome = std::panic::catch_unwind(|| {
            save_atomic(&RealDisk, &path, OLD).unwrap();
            let error = save_atomic(&RealDisk, &path, &finished()).unwrap_err();
            assert!(matches!(error, SaveError::NoSpace { bytes: 400_000, .. }), "{error}");
            assert_eq!(fs::read(&path).unwrap(), OLD);
            assert_eq!(temps(path.parent().unwrap()), 0);
        });
        let _ = Command::new("umount").arg(folder.path()).status();
        outcome.unwrap();
    }
}

#[test]
fn temporary_names_are_told_from_others() {
    let folder = fresh();
    let plan = FaultPlan { at: 3, fault: Fault::Crash, lasting: true };
    save_atomic(&FaultyDisk::new(RealDisk, Some(plan)), &folder.path().join("rig"), &finished()).unwrap_err();
    assert_eq!(temps(folder.path()), 1, "a crash leaves one behind, and its name is recognised");
    fs::write(folder.path().join("mine.tmp"), b"").unwrap();
    assert_eq!(remove_stale_temps(&RealDisk, folder.path()).unwrap(), 1);
    assert_eq!(temps(folder.path()), 0);
    let at = |name: &str| folder.path().join(name);
    let (anchor, member) = (at(".rigsmith-0123456700000000.tmp"), at(".rigsmith-0123456700000001.tmp"));
    let mut living = RealDisk.create(&anchor).unwrap();
    living.lock().unwrap();
    fs::write(&member, b"half").unwrap();
    assert_eq!(remove_stale_temps(&RealDisk, folder.path()).unwrap(), 0, "the save is still under way");
    drop(living);
    fs::write(at(".rigsmith-fedcba9800000001.tmp"), b"without its anchor").unwrap();
    assert_eq!(remove_stale_temps(&RealDisk, folder.path()).unwrap(), 3);
    assert!(!anchor.exists() && !member.exists());
    assert!(folder.path().join("mine.tmp").exists());
    for name in [".rigsmith-.tmp", ".rigsmith-0123456789abcdeg.tmp", "rigsmith-0123456789abcdef.tmp", "a.tmp", ""] {
        assert!(!is_temp_name(name.as_ref()), "{name}");
    }
    assert!(is_temp_name(".rigsmith-0123456789abcdef.tmp".as_ref()));
}

#[test]
fn saves_from_many_threads_do_not_meet() {
    let folder = fresh();
    let path = folder.path().join("rig");
    std::thread::scope(|scope| {
        for thread in 0..8u8 {
            let path = &path;
            scope.spawn(move || {
                for _ in 0..10 {
                    save_atomic(&RealDisk, path, &[thread; 10_000]).unwrap();
                }
            });
        }
    });
    let bytes = fs::read(&path).unwrap();
    assert!(bytes.len() == 10_000 && bytes.iter().all(|&b| b == bytes[0]));
    assert_eq!(temps(folder.path()), 0);
}

/// Sets the time of a file's last change.
fn set_time(path: &Path, time: SystemTime) {
    fs::OpenOptions::new().write(true).open(path).unwrap().set_modified(time).unwrap();
}

#[test]
fn a_clock_that_goes_back_hides_no_save_and_leaves_nothing() {
    let folder = fresh();
    let path = folder.path().join("rig");
    let hour = Duration::from_secs(3600);
    save_atomic(&RealDisk, &path, b"first").unwrap();
    let mut watch = FileWatch::new(&path, 1000);
    watch.know(b"first".to_vec());
    assert_eq!(watch.look(&RealDisk), None);
    // The clock was an hour ahead at the first save, and is right at the second one.
    set_time(&path, SystemTime::now() + hour);
    watch.look(&RealDisk);
    save_atomic(&RealDisk, &path, b"other").unwrap();
    set_time(&path, SystemTime::now() - hour);
    let content = (0..3).find_map(|_| watch.look(&RealDisk).map(<[u8]>::to_vec));
    assert_eq!(content.as_deref(), Some(&b"other"[..]));
    // A save that died while the clock was ahead is cleared as any other.
    let plan = FaultPlan { at: 3, fault: Fault::Crash, lasting: true };
    save_atomic(&FaultyDisk::new(RealDisk, Some(plan)), &folder.path().join("dead"), &finished()).unwrap_err();
    assert_eq!(temps(folder.path()), 1);
    for entry in fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap()) {
        if is_temp_name(&entry.file_name()) {
            set_time(&entry.path(), SystemTime::now() + hour);
        }
    }
    assert_eq!(remove_stale_temps(&RealDisk, folder.path()).unwrap(), 1);
    assert_eq!((fs::read(&path).unwrap(), temps(folder.path())), (b"other".to_vec(), 0));
}

#[test]
fn a_folder_that_vanishes_is_told_and_not_made_again() {
    let folder = fresh();
    let inner = folder.path().join("share");
    let path = inner.join("rig");
    fs::create_dir(&inner).unwrap();
    save_atomic(&RealDisk, &path, OLD).unwrap();
    let mut watch = FileWatch::new(&path, 1000);
    watch.know(OLD.to_vec());
    fs::remove_dir_all(&inner).unwrap();
    let error = save_atomic(&RealDisk, &path, b"new").unwrap_err().to_string();
    assert!(error.contains("create it or choose another"), "{error}");
    assert!(!inner.exists(), "a folder of another machine must not be made here");
    assert_eq!(watch.look(&RealDisk), None);
    // It is there again: both go on.
    fs::create_dir(&inner).unwrap();
    save_atomic(&RealDisk, &path, b"new").unwrap();
    let content = (0..3).find_map(|_| watch.look(&RealDisk).map(<[u8]>::to_vec));
    assert_eq!(content.as_deref(), Some(&b"new"[..]));
}
