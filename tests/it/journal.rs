//! The journal: what was committed comes back, whatever happened to the file, and nothing else does.

mod clips;
mod damage;
mod evidence;
mod long;
mod places;
mod saves;
mod trouble;
mod weights;

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use bevy::prelude::*;
use proptest::prelude::*;
use rigsmith::{
    files::{
        Disk, RealDisk,
        journal::{
            Basis, Condition, Ending, Journal, JournalError, JournalPlaces, JournalStart, Origin, RecoveredJournal,
            ResumedJournal, SaveMark, file_hash, journal_beside, pending_journal, pending_journals, recover,
        },
        save_atomic,
    },
    mesh::model::Weights,
    plugins::{document::Selection, history::RigHistory},
    prelude::Operation,
    rig::{
        PoseOffset, Rig, RigEdit, SkinData, StoredPose, Uid, UidSource,
        operations::MirrorPlane,
        step::{Commit, Replay},
        template::{read_template, write_template},
    },
};
use tempfile::TempDir;

use crate::edits::{operation, random_rig, steps};

const LONG: Duration = crate::bench::HANG;

/// A rig that is edited with its history and journal, without an app.
pub struct Desk {
    pub rig: Rig,
    pub selection: Selection,
    pub history: RigHistory,
    pub journal: Journal,
    uids: UidSource,
}

impl Desk {
    fn new(disk: Arc<dyn Disk>, start: JournalStart) -> Self {
        let rig = start.rig.clone().unwrap_or_default();
        let journal = Journal::start(disk, start);
        Self { rig, selection: default(), history: default(), journal, uids: UidSource::seeded(5) }
    }

    /// In a folder for such journals, with nothing open.
    fn apart(folder: &Path) -> Self {
        Self::new(Arc::new(RealDisk), JournalStart { rig: Some(Rig::new(Uid(42), "random")), ..start(folder) })
    }

    fn operate(&mut self, operation: &Operation) {
        let done = self.history.edit(&mut self.rig, &mut self.selection, &mut self.uids, None, operation);
        if let Some(step) = done.ok().and_then(|recorded| recorded.step) {
            self.journal.record(Commit::Done(step));
        }
    }

    fn edit(&mut self, edit: RigEdit) {
        self.operate(&Operation::Edits(vec![edit]));
    }

    fn place(&mut self, number: usize) {
        self.operate(&Operation::Place { position: Vec3::splat(number as f32), parent: None });
    }

    fn undo(&mut self) {
        if let Some(Ok(step)) = self.history.undo(&mut self.rig, &mut self.selection) {
            self.journal.record(Commit::Undone(step));
        }
    }

    fn redo(&mut self) {
        if let Some(Ok(step)) = self.history.redo(&mut self.rig, &mut self.selection) {
            self.journal.record(Commit::Redone(step));
        }
    }

    fn flush(&self) {
        self.journal.flush(LONG).unwrap();
    }

    /// The content of the file as it is now.
    fn bytes(&self) -> Vec<u8> {
        self.flush();
        fs::read(self.journal.path().unwrap()).unwrap()
    }

    /// Saves the rig as a template, which stands for a project here, up to the given moment of a save.
    fn save(&self, project: &Path, moment: Moment) {
        let text = write_template(&self.rig);
        let hash = file_hash(text.as_bytes());
        let mark = SaveMark { path: project.into(), hash, position: self.journal.position() };
        if moment >= Moment::Noted {
            self.journal.saving(mark.clone(), LONG).unwrap();
        }
        if moment >= Moment::InPlace {
            save_atomic(&RealDisk, project, text.as_bytes()).unwrap();
        }
        if moment >= Moment::Rotated {
            let places = start(project.parent().unwrap()).places;
            self.journal.saved(mark, JournalPlaces { project: Some(project.into()), ..places });
            self.flush();
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Moment {
    Before,
    Noted,
    InPlace,
    Rotated,
}

fn start(folder: &Path) -> JournalStart {
    JournalStart { places: JournalPlaces { project: None, state: Some(folder.join("state")) }, ..default() }
}

fn fresh() -> TempDir {
    tempfile::tempdir().unwrap()
}

fn hash_at(path: &Path) -> Option<u64> {
    Some(file_hash(&fs::read(path).ok()?))
}

/// The document as the editor would offer it.
fn replayed(recovered: &RecoveredJournal) -> Replay {
    let basis = recovered.basis(hash_at);
    let project = match basis {
        Basis::Journal => None,
        _ => Some(read_template(&fs::read(recovered.project().unwrap()).unwrap()).unwrap().rig),
    };
    let replayed = recovered.replay(basis, project);
    assert_eq!(replayed.refused, None);
    replayed
}

fn recover_at(path: &Path) -> Replay {
    replayed(&recover(&fs::read(path).unwrap()).unwrap())
}

fn skin(points: u32, seed: u32) -> Arc<SkinData> {
    let mut weights = Weights { starts: vec![0], ..default() };
    for point in 0..points {
        for joint in 0..=point.wrapping_add(seed) % 4 {
            weights.joints.push(joint);
            weights.values.push(1.0 / (1 + point.wrapping_add(seed) % 4) as f32);
        }
        weights.starts.push(weights.joints.len() as u32);
    }
    Arc::new(SkinData {
        joints: (0..4).map(|joint| Uid(100 + joint)).collect(),
        weights,
        at_rest: seed.is_multiple_of(2),
        subjects: (0..seed % 3).map(|joint| (Uid(103 - u64::from(joint)), Uid(100))).collect(),
    })
}

/// A journal with a record of every kind, and the desk that wrote it.
fn one_of_each(folder: &Path) -> (Desk, Vec<u8>) {
    let mut rig = Rig::new(Uid(7), "base");
    let mut uids = UidSource::seeded(1);
    Operation::Place { position: Vec3::ONE, parent: None }.run(&mut rig, &mut uids, None).unwrap();
    rig.apply(&RigEdit::SetSkin(Uid(8), Some(skin(3, 0)))).unwrap();
    let joint = rig.roots()[0];
    let mut desk =
        Desk::new(Arc::new(RealDisk), JournalStart { rig: Some(rig), context: "open: a".into(), ..start(folder) });
    desk.place(1);
    desk.edit(RigEdit::SetOffset(joint, Some(PoseOffset { translation: Vec3::X, ..default() })));
    desk.edit(RigEdit::AddStoredPose(Box::new(StoredPose { uid: Uid(77), name: "p".into(), ..default() }), 0));
    desk.edit(RigEdit::Batch(vec![
        RigEdit::SetSkin(Uid(8), Some(skin(5, 1))),
        RigEdit::SetLabel(joint, Some("x".into())),
    ]));
    desk.undo();
    desk.undo();
    desk.redo();
    desk.journal.context("open: a, b");
    desk.save(&folder.join("not there/p.rigsmith.ron"), Moment::Noted);
    desk.edit(RigEdit::SetSkin(Uid(9), Some(skin(5, 1))));
    let bytes = desk.bytes();
    (desk, bytes)
}

#[test]
fn every_kind_of_record_comes_back() {
    let folder = fresh();
    let (mut desk, bytes) = one_of_each(folder.path());
    let recovered = recover(&bytes).unwrap();
    assert_eq!(recovered.ending, Ending::Open);
    assert_eq!((recovered.origin(), recovered.context()), (&Origin::Empty, "open: a, b"));
    assert_eq!(recovered.process, std::process::id());
    assert_eq!((recovered.changes().len(), recovered.marks().len()), (8, 1));
    assert_eq!(recovered.marks()[0].position, 7);
    assert_eq!(recovered.basis(hash_at), Basis::Journal);
    let back = replayed(&recovered);
    assert_eq!((&back.rig, &back.selection), (&desk.rig, &Some(desk.selection.0.clone())));
    // The same weights are in the file once.
    let large = bytes.len();
    desk.edit(RigEdit::SetSkin(Uid(10), Some(skin(5, 1))));
    assert!(desk.bytes().len() - large < 400, "the weights were written again");

    let mut history = RigHistory::restored(&back.stacks);
    let (names, head) = desk.history.steps();
    assert_eq!(history.steps(), (names[..names.len() - 1].to_vec(), head - 1));
    let (mut rig, mut selection) = (back.rig.clone(), Selection(back.selection.unwrap()));
    while history.undo(&mut rig, &mut selection).is_some_and(|undone| undone.is_ok()) {}
    assert_eq!(&rig, recovered.base().unwrap());
    while history.redo(&mut rig, &mut selection).is_some_and(|redone| redone.is_ok()) {}
    assert_eq!(rig, back.rig);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_was_done_undone_and_redone_is_recovered(before in steps(20), steps in steps(40)) {
        let folder = fresh();
        let base = random_rig(&before);
        let mut desk = Desk::new(Arc::new(RealDisk), JournalStart { rig: Some(base), ..start(folder.path()) });
        for step in &steps {
            match step.2 % 7 {
                0 | 1 => desk.undo(),
                2 => desk.redo(),
                _ => {
                    let operation = operation(&desk.rig, step);
                    let plane = (step.1 % 3 == 0).then(|| MirrorPlane::sagittal(2.0));
                    let done = desk.history.edit(&mut desk.rig, &mut desk.selection, &mut desk.uids, plane, &operation);
                    if let Some(step) = done.ok().and_then(|recorded| recorded.step) {
                        desk.journal.record(Commit::Done(step));
                    }
                }
            }
        }
        let recovered = recover(&desk.bytes()).unwrap();
        prop_assert_eq!(recovered.changes().len() as u64, desk.journal.position());
        let back = replayed(&recovered);
        prop_assert_eq!(&back.rig, &desk.rig);
        if let Some(selection) = &back.selection {
            prop_assert_eq!(selection, &desk.selection.0);
        }
        let history = RigHistory::restored(&back.stacks);
        prop_assert_eq!(history.steps(), desk.history.steps());
    }
}

/// A journal apart from projects, in which two joints were placed before its process ended: its bytes and its path.
fn of_two_joints(folder: &Path) -> (Vec<u8>, PathBuf) {
    let mut desk = Desk::apart(folder);
    desk.place(1);
    desk.place(2);
    (desk.bytes(), desk.journal.path().unwrap())
}

#[test]
fn what_could_not_be_replayed_is_kept() {
    let folder = fresh();
    let (bytes, path) = of_two_joints(folder.path());
    let recovered = recover(&bytes).unwrap();
    // The rig has the second joint already.
    let mut other = recovered.base().unwrap().clone();
    other.apply(&recovered.changes()[1].step().forward[0]).unwrap();
    let restored = recovered.restore(Basis::Changed, Some(other));
    assert_eq!((restored.replayed.applied, restored.replayed.refused.is_some()), (1, true));
    let ResumedJournal { journal, .. } =
        Journal::resume(Arc::new(RealDisk), start(folder.path()).places, &recovered, &restored, &path);
    journal.flush(LONG).unwrap();
    assert_eq!(journal.position(), 1);
    assert_eq!(recover(&fs::read(&path).unwrap()).unwrap().changes().len(), 1);
    let mut kept = path.into_os_string();
    kept.push(".kept");
    assert_eq!(fs::read(kept).unwrap(), bytes);
}

#[test]
fn a_journal_of_the_first_format_still_opens() {
    let recovered = recover(include_bytes!("../frozen/format-1.journal")).unwrap();
    let back = replayed(&recovered);
    assert_eq!((recovered.ending, back.applied, back.rig.len()), (Ending::Open, 55, 11));
    assert_eq!(back.rig.about().name, "victim");
    let kinds = |is: fn(&Commit) -> bool| recovered.changes().iter().filter(|change| is(change)).count();
    assert!(kinds(|change| matches!(change, Commit::Undone(_))) > 0);
    assert!(kinds(|change| matches!(change, Commit::Redone(_))) > 0);
    assert!(back.rig.skins().count() == 1 && !back.rig.pose().is_empty());
}

#[test]
fn weights_of_a_large_mesh_are_handed_over_whole_and_written_once() {
    let folder = fresh();
    let mut desk = Desk::apart(folder.path());
    desk.place(0);
    let large = skin(500_000, 1);
    for _ in 0..3 {
        let skin = Arc::new(large.as_ref().clone());
        let operation = Operation::Edits(vec![RigEdit::SetSkin(Uid(8), Some(skin.clone()))]);
        let recorded = desk.history.edit(&mut desk.rig, &mut desk.selection, &mut desk.uids, None, &operation).unwrap();
        desk.journal.record(Commit::Done(recorded.step.unwrap()));
        assert!(Arc::ptr_eq(desk.rig.skin(Uid(8)).unwrap(), &skin), "what the caller has is shared, not copied");
    }
    desk.place(1);
    let bytes = desk.bytes();
    let back = replayed(&recover(&bytes).unwrap());
    assert!(back.rig == desk.rig && back.rig.skin(Uid(8)) == Some(&large));
    assert!(bytes.len() < 500_000 * 14, "{}", bytes.len());
}

#[test]
fn a_long_day_is_back_after_one_replay_of_its_changes() {
    let folder = fresh();
    let mut desk = Desk::apart(folder.path());
    for number in 0..200 {
        desk.place(number);
    }
    let joints: Vec<Uid> = desk.rig.walk().map(|joint| joint.data.uid).collect();
    for number in 0..20_000 {
        let to = vec![(joints[number % joints.len()], Vec3::splat(number as f32 / 7.0))];
        desk.operate(&Operation::Move { to, with_children: true });
    }
    let bytes = desk.bytes();
    let recovered = recover(&bytes).unwrap();
    assert_eq!(recovered.changes().len(), 20_200);
    let back = replayed(&recovered);
    assert_eq!((back.applied, &back.rig), (20_200, &desk.rig));
    assert!(bytes.len() < 20_200 * 700, "{} bytes", bytes.len());
}
