//! A journal on a disk that fails: the next place, what is safe all the same, what is told.

use std::{
    ffi::OsString,
    io,
    path::PathBuf,
    sync::atomic::{AtomicBool, Ordering},
};

use rigsmith::{
    files::{DiskFile, Entry, Fault, FaultPlan, FaultyDisk},
    plugins::journal::{JournalTrouble, RigJournal, replayed_bundle},
    prelude::{Change, EditRequest},
    test_app::test_app,
};

use super::*;
use crate::disks::as_on_the_disk;

#[test]
fn the_next_place_is_taken_where_one_cannot_be_written() {
    let folder = fresh();
    // A file where the folder should be.
    fs::write(folder.path().join("state"), b"").unwrap();
    let mut desk = Desk::apart(folder.path());
    desk.place(1);
    desk.flush();
    let path = desk.journal.path().unwrap();
    assert!(path.starts_with(std::env::temp_dir()) && !path.starts_with(folder.path()), "{path:?}");
    assert_eq!(recover_at(&path).rig, desk.rig);
    desk.journal.close(LONG).unwrap();
    assert!(!path.exists());
    // Two windows on one project: the second one leaves the first one's journal alone.
    let folder = fresh();
    let project = folder.path().join("hero.rigsmith.ron");
    let both: Vec<Desk> = (0..2)
        .map(|number| {
            let places = JournalPlaces { project: Some(project.clone()), ..start(folder.path()).places };
            let mut desk =
                Desk::new(Arc::new(RealDisk), JournalStart { places, rig: Some(Rig::new(Uid(1), "")), ..default() });
            desk.place(number);
            desk.flush();
            desk
        })
        .collect();
    assert_eq!(both[0].journal.path(), Some(journal_beside(&project)));
    assert!(both[1].journal.path().unwrap().starts_with(folder.path().join("state")));
    for desk in &both {
        assert_eq!(recover_at(&desk.journal.path().unwrap()).rig, desk.rig);
    }
}

/// All that any journal in the folders gives back, as numbers of changes, with the rigs.
fn rigs_in_journals(folders: &[PathBuf]) -> Vec<Rig> {
    let mut rigs = Vec::new();
    for entry in folders.iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|ending| ending == "journal")
            && let Ok(recovered) = recover(&fs::read(&path).unwrap())
        {
            rigs.push(replayed(&recovered).rig);
        }
    }
    rigs
}

/// Works and saves on a disk that fails as planned. Returns the rigs after each change, and how many are known to be safe.
fn work(folder: &Path, disk: &Arc<FaultyDisk>) -> (Vec<Rig>, usize) {
    let project = folder.join("hero.rigsmith.ron");
    let mut desk = Desk::new(disk.clone(), JournalStart { rig: Some(Rig::new(Uid(42), "random")), ..start(folder) });
    let (mut states, mut safe) = (vec![desk.rig.clone()], 0);
    let mut names = Vec::new();
    let mut note = |desk: &Desk, states: &mut Vec<Rig>| {
        states.push(desk.rig.clone());
        if desk.journal.flush(LONG).is_ok() {
            safe = states.len() - 1;
        }
        names.extend(desk.journal.path());
    };
    for number in 0..3 {
        desk.place(number);
        note(&desk, &mut states);
    }
    desk.undo();
    note(&desk, &mut states);
    let text = write_template(&desk.rig);
    let mark = SaveMark { path: project.clone(), hash: file_hash(text.as_bytes()), position: desk.journal.position() };
    let _ = desk.journal.saving(mark.clone(), LONG);
    if save_atomic(disk.as_ref(), &project, text.as_bytes()).is_ok() {
        desk.journal.saved(mark, JournalPlaces { project: Some(project), ..start(folder).places });
    }
    desk.redo();
    note(&desk, &mut states);
    desk.place(7);
    note(&desk, &mut states);
    if let Some(path) = desk.journal.path().filter(|path| !path.starts_with(folder)) {
        // Found again by the one that started it; other tests use that folder, too.
        let _ = fs::copy(path, folder.join("moved.journal"));
    }
    // What it could not write before it tries again at its end.
    drop(desk);
    for name in names.iter().filter_map(|path| path.file_name()) {
        let _ = fs::remove_file(std::env::temp_dir().join(name));
    }
    (states, safe)
}

#[test]
fn whatever_fails_what_was_said_to_be_safe_is_recovered() {
    let dry = fresh();
    let counted = Arc::new(FaultyDisk::new(RealDisk, None));
    let (states, safe) = work(dry.path(), &counted);
    assert_eq!(safe, states.len() - 1);
    let operations = counted.operations();
    assert!(operations > 40, "{:?}", counted.log());
    let mut held = 0;
    for at in 0..operations {
        for fault in Fault::ALL {
            // A crash lasts anyway, and a short write is no failure.
            let both = !fault.is_crash() && fault != Fault::Short;
            for lasting in [false, true].into_iter().filter(|lasting| both || !lasting) {
                let folder = fresh();
                let plan = FaultPlan { at, fault, lasting };
                let disk = Arc::new(FaultyDisk::new(RealDisk, Some(plan)));
                let (states, safe) = work(folder.path(), &disk);
                let folders = [folder.path().to_owned(), folder.path().join("state")];
                let rigs = rigs_in_journals(&folders);
                // What the project itself holds counts where no journal is left.
                let project = fs::read(folder.path().join("hero.rigsmith.ron")).ok();
                let saved = project.and_then(|bytes| Some(read_template(&bytes).ok()?.rig));
                let context = format!("{plan:?}: safe {safe}, {} journals, {:?}", rigs.len(), disk.log());
                let reached = |rig: &Rig| states.iter().rposition(|state| state == rig);
                for rig in &rigs {
                    assert!(reached(rig).is_some(), "a state that never was; {context}");
                }
                let best = rigs.iter().chain(&saved).filter_map(reached).max();
                assert!(safe == 0 || best.is_some_and(|best| best >= safe), "{best:?}; {context}");
                held += usize::from(safe == states.len() - 1);
            }
        }
    }
    assert!(held > operations * 2, "hardly any work survived: {held}");
}

/// A disk that is full while the switch is on.
struct SwitchedDisk(Arc<AtomicBool>);

impl SwitchedDisk {
    fn check(&self) -> io::Result<RealDisk> {
        if self.0.load(Ordering::Relaxed) {
            return Err(io::ErrorKind::StorageFull.into());
        }
        Ok(RealDisk)
    }
}

struct SwitchedFile(Box<dyn DiskFile>, SwitchedDisk);

impl DiskFile for SwitchedFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.1.check()?;
        self.0.write(bytes)
    }
    fn keep_permissions(&mut self, of: &Path) -> io::Result<()> {
        self.0.keep_permissions(of)
    }
    fn sync(&mut self) -> io::Result<()> {
        self.0.sync()
    }
}

impl Disk for SwitchedDisk {
    as_on_the_disk!();
    fn create(&self, path: &Path) -> io::Result<Box<dyn DiskFile>> {
        Ok(Box::new(SwitchedFile(self.check()?.create(path)?, Self(self.0.clone()))))
    }
    fn hard_link(&self, existing: &Path, path: &Path) -> io::Result<()> {
        RealDisk.hard_link(existing, path)
    }
}

#[test]
fn a_full_disk_is_told_and_nothing_is_missing_once_there_is_room() {
    let folder = fresh();
    let full = Arc::new(AtomicBool::new(false));
    let set = |on| full.store(on, Ordering::Relaxed);
    let begin = JournalStart { rig: Some(Rig::new(Uid(42), "random")), ..start(folder.path()) };
    let mut desk = Desk::new(Arc::new(SwitchedDisk(full.clone())), begin);
    desk.place(0);
    desk.flush();
    assert_eq!(desk.journal.trouble(), None);
    set(true);
    desk.place(1);
    let refused = desk.journal.flush(LONG).unwrap_err();
    assert!(refused.to_string().contains("save soon"), "{refused}");
    assert_eq!(desk.journal.trouble().as_deref(), Some(&refused));
    desk.place(2);
    // What was written before is still there.
    assert_eq!(recover_at(&desk.journal.path().unwrap()).rig.len(), 1);
    set(false);
    desk.undo();
    desk.flush();
    assert_eq!(desk.journal.trouble(), None);
    assert_eq!(recover_at(&desk.journal.path().unwrap()).rig, desk.rig);
    assert_eq!(desk.rig.len(), 2);
}

#[test]
fn an_app_keeps_what_its_rigs_ask_for_and_tells_trouble_once() {
    let folder = fresh();
    let plan = FaultPlan { at: 40, fault: Fault::NoSpace, lasting: true };
    let disk = Arc::new(FaultyDisk::new(RealDisk, Some(plan)));
    let mut app = test_app();
    let rig = app.world_mut().spawn(Rig::new(Uid(1), "kept")).id();
    let other = app.world_mut().spawn(Rig::default()).id();
    let start = JournalStart { rig: app.world().get::<Rig>(rig).cloned(), ..start(folder.path()) };
    let journal = Journal::start(disk, start);
    app.world_mut().entity_mut(rig).insert(RigJournal::new(journal.clone()));
    let place = Operation::Place { position: Vec3::ONE, parent: None };
    let send = |app: &mut App, rig, change| {
        app.world_mut().write_message(EditRequest { rig, change });
        app.update();
    };
    send(&mut app, rig, Change::Do(place.clone()));
    send(&mut app, rig, Change::Do(place.clone()));
    send(&mut app, other, Change::Do(place.clone()));
    send(&mut app, rig, Change::Undo);
    assert_eq!(journal.position(), 3);
    app.world().get::<RigJournal>(rig).unwrap().flush(LONG).unwrap();
    let back = recover_at(&journal.path().unwrap());
    assert_eq!(Some(&back.rig), app.world().get::<Rig>(rig));
    // A recovered rig goes on like any other.
    let again = app.world_mut().spawn(replayed_bundle(&back)).id();
    send(&mut app, again, Change::Redo);
    assert_eq!(app.world().get::<Rig>(again).map(Rig::len), Some(2));
    send(&mut app, again, Change::Undo);
    send(&mut app, again, Change::Undo);
    assert_eq!(app.world().get::<Rig>(again).map(Rig::len), Some(0));

    assert!(app.world_mut().resource_mut::<Messages<JournalTrouble>>().drain().next().is_none());
    let mut told = Vec::new();
    for _ in 0..40 {
        send(&mut app, rig, Change::Do(place.clone()));
        let _ = journal.flush(LONG);
        app.update();
        told.extend(app.world_mut().resource_mut::<Messages<JournalTrouble>>().drain());
    }
    assert_eq!(told.len(), 1, "{told:?}");
    assert_eq!(told[0].rig, rig);
    let reason = told[0].reason.clone().unwrap().to_string();
    assert!(reason.contains("save soon") && reason.contains("state"), "{reason}");
    assert_eq!(app.world().get::<Rig>(rig).map(Rig::len), Some(41), "editing goes on");
}

/// A desk that works on a project in a folder of its own, with a change that is on the disk.
fn on_share(disk: Arc<dyn Disk>, share: &Path, folder: &Path) -> Desk {
    fs::create_dir(share).unwrap();
    let project = share.join("hero.rigsmith.ron");
    let places = JournalPlaces { project: Some(project.clone()), ..start(folder).places };
    let begin = JournalStart { places, rig: Some(Rig::new(Uid(1), "hero")), ..default() };
    let mut desk = Desk::new(disk, begin);
    desk.place(1);
    desk.flush();
    assert_eq!(desk.journal.path(), Some(journal_beside(&project)));
    desk
}

/// A file without a name goes on taking bytes, which nobody would find after a crash.
#[cfg(unix)]
#[test]
fn a_journal_whose_file_is_gone_is_written_anew() {
    for is_folder_gone in [true, false] {
        let folder = fresh();
        let [share, away] = ["share", "away"].map(|name| folder.path().join(name));
        let mut desk = on_share(Arc::new(RealDisk), &share, folder.path());
        let beside = desk.journal.path().unwrap();
        match is_folder_gone {
            true => fs::rename(&share, &away).unwrap(),
            false => fs::remove_file(&beside).unwrap(),
        }
        desk.place(2);
        desk.flush();
        let path = desk.journal.path().unwrap();
        assert_eq!((path == beside, share.exists()), (!is_folder_gone, !is_folder_gone), "{}", path.display());
        assert_eq!((recover_at(&path).rig, desk.journal.trouble()), (desk.rig.clone(), None));
        if is_folder_gone {
            // What went away with the folder took the last change as well.
            assert_eq!(recover_at(&away.join(beside.file_name().unwrap())).rig, desk.rig);
            // Without another change, too: whoever saves waits for the journal.
            fs::remove_file(&path).unwrap();
            desk.flush();
            assert_eq!(recover_at(&desk.journal.path().unwrap()).rig, desk.rig);
        }
        desk.journal.close(LONG).unwrap();
    }
}

/// A disk with a folder of another machine, which cannot be reached while the switch is on.
#[derive(Clone)]
struct NetworkDisk {
    share: PathBuf,
    is_gone: Arc<AtomicBool>,
}

impl NetworkDisk {
    fn reach(&self, path: &Path) -> io::Result<RealDisk> {
        match self.is_gone.load(Ordering::Relaxed) && path.starts_with(&self.share) {
            true => Err(io::ErrorKind::HostUnreachable.into()),
            false => Ok(RealDisk),
        }
    }
}

struct NetworkFile(Box<dyn DiskFile>, PathBuf, NetworkDisk);

impl DiskFile for NetworkFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.2.reach(&self.1)?;
        self.0.write(bytes)
    }
    fn keep_permissions(&mut self, of: &Path) -> io::Result<()> {
        self.0.keep_permissions(of)
    }
    fn sync(&mut self) -> io::Result<()> {
        self.2.reach(&self.1)?;
        self.0.sync()
    }
}

impl Disk for NetworkDisk {
    fn entry(&self, path: &Path, follow: bool) -> io::Result<Entry> {
        self.reach(path)?.entry(path, follow)
    }
    fn read_link(&self, path: &Path) -> io::Result<PathBuf> {
        self.reach(path)?.read_link(path)
    }
    fn canonical(&self, path: &Path) -> io::Result<PathBuf> {
        self.reach(path)?.canonical(path)
    }
    fn list(&self, folder: &Path, limit: usize) -> io::Result<Vec<OsString>> {
        self.reach(folder)?.list(folder, limit)
    }
    fn create(&self, path: &Path) -> io::Result<Box<dyn DiskFile>> {
        Ok(Box::new(NetworkFile(self.reach(path)?.create(path)?, path.to_owned(), self.clone())))
    }
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.reach(to)?.rename(from, to)
    }
    fn hard_link(&self, existing: &Path, path: &Path) -> io::Result<()> {
        self.reach(path)?.hard_link(existing, path)
    }
    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        self.reach(folder)?.sync_folder(folder)
    }
    fn remove(&self, path: &Path) -> io::Result<()> {
        self.reach(path)?.remove(path)
    }
    fn create_folder(&self, path: &Path) -> io::Result<()> {
        self.reach(path)?.create_folder(path)
    }
    fn open(&self, path: &Path) -> io::Result<Box<dyn io::Read + Send>> {
        self.reach(path)?.open(path)
    }
}

#[test]
fn work_on_a_network_folder_that_vanishes_is_kept_on_this_machine() {
    let folder = fresh();
    let share = folder.path().join("share");
    let is_gone = Arc::new(AtomicBool::new(false));
    let disk = NetworkDisk { share: share.clone(), is_gone: is_gone.clone() };
    let mut desk = on_share(Arc::new(disk.clone()), &share, folder.path());
    let beside = desk.journal.path().unwrap();
    is_gone.store(true, Ordering::Relaxed);
    desk.place(2);
    desk.flush();
    let here = desk.journal.path().unwrap();
    assert!(here.starts_with(folder.path().join("state")), "{}", here.display());
    assert_eq!((recover_at(&here).rig, desk.journal.trouble()), (desk.rig.clone(), None));
    // A save is told, and takes nothing away; with the folder it comes back, and so does the journal beside it.
    let project = share.join("hero.rigsmith.ron");
    let save = |desk: &Desk| {
        let text = write_template(&desk.rig);
        let mark =
            SaveMark { path: project.clone(), hash: file_hash(text.as_bytes()), position: desk.journal.position() };
        desk.journal.saving(mark.clone(), LONG).unwrap();
        save_atomic(&disk, &project, text.as_bytes())?;
        let places = JournalPlaces { project: Some(project.clone()), ..start(folder.path()).places };
        desk.journal.saved(mark, places);
        Ok::<(), rigsmith::files::SaveError>(())
    };
    let error = save(&desk).unwrap_err().to_string();
    assert!(error.contains("share"), "{error}");
    desk.place(3);
    desk.flush();
    assert_eq!(recover_at(&here).rig, desk.rig);
    is_gone.store(false, Ordering::Relaxed);
    save(&desk).unwrap();
    desk.place(4);
    desk.flush();
    assert_eq!(desk.journal.trouble(), None);
    let path = desk.journal.path().unwrap();
    assert_eq!(recover_at(&path).rig, desk.rig, "{}", path.display());
    assert!(beside.exists(), "what was cut off stays until a person decides about it");
    desk.journal.close(LONG).unwrap();
}
