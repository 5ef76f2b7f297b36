//! Files that are none, saves that fail, and folders that cannot be written.

use super::*;

#[test]
fn files_that_are_nothing_lose_nothing() {
    let folder = folder();
    let mut window = Window::bundled(folder.path());
    window.place(1.0);
    let rig = window.rig();
    let cases: &[(&str, &[u8], &str)] = &[
        ("notes.txt", b"hello", ".obj, .gltf, .glb or .vrm"),
        ("weights.skin", b"hello", "only weights"),
        ("strokes.ron", b"[]", "neither template nor project"),
    ];
    for (name, bytes, said) in cases {
        let path_buf = folder.path().join(name);
        std::fs::write(&path_buf, bytes).expect("written");
        let entity = window.base.open_rig();
        window.send(FileDragAndDrop::DroppedFile { window: entity, path_buf });
        assert!(window.notices.include(Severity::Error, said), "{name}: {:?}", window.notices.list);
        assert_eq!(window.rig(), rig, "{name}");
        assert!(window.question().is_none(), "{name}: nothing to ask about");
    }
    // By their names these could be something: what they hold is told after asking.
    window.change(Change::Undo);
    for (name, bytes) in
        [("a.glb", &b"hello"[..]), ("b.rigsmith.ron", b"hello"), ("c.rig.ron", b"hello"), ("d.obj", b"")]
    {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("written");
        window.notices.list.clear();
        window.open_file(&path);
        assert!(window.notices.include(Severity::Error, name), "{name}: {:?}", window.notices.list);
        assert!(window.mesh().is_some(), "{name}: the character is still open");
    }
    window.open_file(&folder.path().join("gone.obj"));
    assert!(window.notices.include(Severity::Error, "gone.obj"));
}

#[test]
fn a_failed_save_keeps_everything() {
    let folder = folder();
    let mut window = Window::bundled(folder.path());
    window.place(1.0);
    window.save_as("missing/guy.rigsmith.ron");
    assert!(window.notices.include(Severity::Error, "There is no folder"));
    window.answer(Answer::Cancel);
    let path = window.save_as("guy.rigsmith.ron");
    window.place(0.5);
    // A folder where the file was: nothing can take its place.
    std::fs::remove_file(&path).expect("removed");
    std::fs::create_dir_all(path.join("in the way")).expect("made");
    window.act(Action::Save);
    assert!(window.notices.include(Severity::Error, "Could not write guy.rigsmith.ron"), "{:?}", window.notices.list);
    assert!(window.is_unsaved());
    assert!(window.journal().exists());
}

#[test]
fn an_unwritable_folder_for_journals_is_told_and_work_goes_on() {
    let folder = folder();
    let file = folder.path().join("file");
    std::fs::write(&file, "in the way").expect("written");
    let mut window = Window::with_state(folder.path(), file.join("state"));
    window.open(OpenRequest::Bundled);
    window.place(1.0);
    let journal = window.journal();
    assert!(journal.starts_with(std::env::temp_dir()), "{}", journal.display());
    window.settle();
    let told = |window: &Window| window.notices.list.iter().filter(|n| n.text.contains("RIGSMITH_STATE")).count();
    assert_eq!(told(&window), 1, "{:?}", window.notices.list);
    let path = window.save_as("guy.rigsmith.ron");
    assert!(path.exists() && !window.is_unsaved());
    assert_eq!(told(&window), 1, "told once");
    let steps = window.world().get::<RigHistory>(window.base.open_rig()).map(|history| history.steps().1);
    assert_eq!(steps, Some(1));
    window.act(Action::Quit);
    // The window waits for a moment only: a slow disk removes the journal later.
    wait(&mut (), "the end of the journal", |_| (), |_| !journal.exists());
}
