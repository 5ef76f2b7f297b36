//! Journals of windows that end, and of two windows on one project.

use super::*;

/// Ends a window as a crash does: its journal stays, and others can recover it once its thread has let go of it.
pub(super) fn crash(window: Window) {
    let journal = window.journal();
    drop(window);
    wait(&mut (), "the end of the journal's thread", |_| (), |_| !matches!(RealDisk.is_locked(&journal), Ok(true)));
}

#[test]
fn quitting_asks_about_unsaved_changes_and_leaves_no_journal() {
    let folder = folder();
    let mut window = Window::bundled(folder.path());
    let journal = window.journal();
    assert!(journal.exists(), "there is a journal before the first edit");
    window.place(1.0);
    window.act(Action::Quit);
    assert!(matches!(window.question(), Some(Question::Unsaved { .. })));
    assert!(window.base.app.should_exit().is_none());
    window.answer(Answer::Cancel);
    assert!(window.question().is_none() && window.base.app.should_exit().is_none() && journal.exists());
    window.base.app.world_mut().write_message(ActionRequest(Action::Quit));
    window.update();
    window.base.app.world_mut().write_message(DialogAnswer(Answer::Save));
    window.update();
    assert!(matches!(window.question(), Some(Question::Path { purpose: Purpose::Save, .. })));
    let path = folder.path().join("guy.rigsmith.ron");
    window.base.app.world_mut().write_message(DialogAnswer(Answer::Path(path.clone())));
    let start = Instant::now();
    while window.base.app.should_exit().is_none() {
        assert!(start.elapsed() < HANG, "it never quits: {:?}", window.notices.list);
        window.update();
    }
    assert!(path.exists());
    drop(window);
    // The window waits for a moment only: a slow disk removes the journals later.
    let (state, beside) = (folder.path().join("state"), folder.path().join("guy.rigsmith.journal"));
    let left = || std::fs::read_dir(&state).into_iter().flatten().count() > 0 || journal.exists() || beside.exists();
    wait(&mut (), "the end of all journals", |_| (), |_| !left());
}

/// Waits until the journal of a window is at a path.
fn wait_for_journal(window: &Window, path: &Path) {
    let start = Instant::now();
    while window.journal() != path {
        assert!(start.elapsed() < HANG, "the journal never moves to {}", path.display());
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn the_second_window_on_a_project_is_told() {
    let told = |window: &Window| window.notices.include(Severity::Warning, "open in another window");
    let folder = folder();
    let mut first = Window::bundled(folder.path());
    first.place(1.0);
    let project = first.save_as("guy.rigsmith.ron");
    first.place(1.1);
    wait_for_journal(&first, &journal_beside(&project));
    first.settle();
    assert!(!told(&first), "{:?}", first.notices.list);
    let mut second = Window::new(folder.path());
    second.open_file(&project);
    assert_ne!(second.journal(), journal_beside(&project));
    second.settle();
    assert!(told(&second), "{:?}", second.notices.list);
    assert!(!told(&first), "{:?}", first.notices.list);
    // The first window's journal is its own: both can be recovered.
    assert!(journal_beside(&project).exists() && second.journal().exists());
    second.act(Action::Quit);
    drop(second);
    first.act(Action::Save);
    first.act(Action::Quit);
    // The window waits for a moment only: a slow disk removes the journal later.
    wait(&mut (), "the end of the journal", |_| (), |_| !journal_beside(&project).exists());
    let mut third = Window::new(folder.path());
    third.open_file(&project);
    wait_for_journal(&third, &journal_beside(&project));
    third.settle();
    assert!(!told(&third), "{:?}", third.notices.list);
}
