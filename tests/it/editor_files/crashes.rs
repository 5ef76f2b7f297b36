//! Crashes of a window: journals are offered, recovered and kept.

use super::{journals::crash, *};

#[test]
fn a_crash_loses_nothing() {
    let folder = folder();
    let mut window = Window::bundled(folder.path());
    window.place(1.0);
    window.place(0.5);
    window.change(Change::Undo);
    let (rig, points) = (window.rig(), window.mesh().map(|mesh| mesh.rest.points.clone()));
    let journal = window.journal();
    assert!(journal.starts_with(folder.path().join("state")));
    crash(window);

    let mut window = Window::bundled(folder.path());
    let Some(Question::Recover(list)) = window.question() else { panic!("nothing is offered") };
    let pending = list.iter().find(|pending| pending.path == journal).expect("our work is offered");
    assert_eq!(pending.changes, 3);
    window.answer(Answer::Recover(journal.clone()));
    assert_eq!(window.rig(), rig, "{:?}", window.notices.list);
    assert_eq!(window.mesh().map(|mesh| mesh.rest.points.clone()), points);
    assert!(window.is_unsaved(), "recovered work is in no file");
    let is_asked_again = match window.question() {
        Some(Question::Recover(list)) => list.iter().any(|pending| pending.path.starts_with(folder.path())),
        _ => false,
    };
    assert!(!is_asked_again, "what was recovered is offered once");
    window.change(Change::Redo);
    assert_eq!(window.rig().len(), rig.len() + 1, "what was undone can be done again");
    window.change(Change::Undo);
    window.change(Change::Undo);
    assert_eq!(window.rig().len(), rig.len() - 1);
    // A second crash.
    crash(window);
    let mut window = Window::bundled(folder.path());
    let offered = match window.question() {
        Some(Question::Recover(list)) => list.iter().find(|p| p.path.starts_with(folder.path())).cloned(),
        _ => None,
    };
    let offered = offered.expect("the work that went on is offered");
    window.answer(Answer::Forget(offered.path.clone()));
    assert!(!offered.path.exists());
}

#[test]
fn a_damaged_journal_is_offered_recovered_and_kept() {
    let folder = folder();
    let mut window = Window::bundled(folder.path());
    for height in [1.0, 0.5, 0.25] {
        window.place(height);
    }
    let journal = window.journal();
    crash(window);
    let mut bytes = std::fs::read(&journal).expect("the journal of the crash");
    // In the text of the last step but one.
    let middle = bytes.windows(5).enumerate().filter(|(_, word)| word == b"after").map(|(at, _)| at).nth(1).unwrap();
    bytes[middle] ^= 1;
    std::fs::write(&journal, &bytes).unwrap();
    let unreadable = folder.path().join("state/rigsmith-00000000000000aa.journal");
    std::fs::write(&unreadable, b"RIGJRNL\0 and nothing that makes sense").unwrap();

    let mut window = Window::bundled(folder.path());
    let Some(Question::Recover(list)) = window.question() else { panic!("nothing is offered") };
    let of = |path: &Path| list.iter().find(|pending| pending.path == path).expect("it is offered");
    let (damaged, hopeless) = (of(&journal), of(&unreadable));
    assert!(can_recover(damaged) && !can_recover(hopeless));
    let text = describe(damaged);
    assert!(text.starts_with("the bundled character: 2 edits, damaged: "), "{text}");
    assert!(text.ends_with(" records can be recovered"), "{text}");
    assert!(describe(hopeless).contains("none of its records can be read"), "{}", describe(hopeless));
    window.answer(Answer::Recover(journal.clone()));
    assert_eq!(window.rig().walk().filter(|joint| joint.data.rest.translation.y == 0.5).count(), 0);
    assert!(window.rig().walk().any(|joint| joint.data.rest.translation.y == 0.25), "what came after the damage");
    assert!(window.notices.include(Severity::Warning, "the journal was damaged"), "{:?}", window.notices.list);
    assert!(window.notices.include(Severity::Warning, "is kept as"), "{:?}", window.notices.list);
    assert!(window.notices.include(Severity::Info, "a step is lost after 1 edit"), "{:?}", window.notices.list);
    let mut kept = journal.clone().into_os_string();
    kept.push(".damaged");
    assert_eq!(std::fs::read(&kept).unwrap(), bytes);
    // Nobody is asked about the other one again before the next start, and it stays until somebody says so.
    window.answer(Answer::Cancel);
    assert!(unreadable.exists());
    crash(window);
    let mut window = Window::bundled(folder.path());
    window.answer(Answer::Forget(unreadable.clone()));
    assert!(!unreadable.exists() && PathBuf::from(kept).exists());
}

#[test]
fn a_crash_after_saving_recovers_what_came_later() {
    let folder = folder();
    let mut window = Window::bundled(folder.path());
    window.place(1.0);
    let path = window.save_as("guy.rigsmith.ron");
    window.place(0.5);
    let rig = window.rig();
    crash(window);
    let mut window = Window::new(folder.path());
    window.open_file(&path);
    let Some(Question::Recover(list)) = window.question() else {
        panic!("nothing is offered beside the project: {:?}", window.notices.list)
    };
    let ours: Vec<_> = list.iter().filter(|pending| pending.path.starts_with(folder.path())).cloned().collect();
    assert_eq!(ours.iter().map(|pending| pending.changes).collect::<Vec<_>>(), [1]);
    window.answer(Answer::Recover(ours[0].path.clone()));
    assert_eq!(window.rig(), rig);
    assert_eq!(title(window.world()), "guy* - Rigsmith");
    window.act(Action::Save);
    assert!(!window.is_unsaved() && window.question().is_none(), "it knows where it was saved");
}
