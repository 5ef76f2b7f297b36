//! The window takes over expressions and forms of the document's folder and of the site's.

use std::{fs, path::Path};

use bevy::prelude::*;
use rigsmith::{
    editor::{
        files::{FilesPlugin, OpenRequest},
        folder_watch::FolderWatchPlugin,
        library::LibraryFolders,
        notice::Severity,
    },
    files::SearchPaths,
    plugins::{commands::RigModules, face::FaceExpressions},
};

use super::{template_text::CHAIN, window_app::WindowBench};

fn asset(path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("assets").join(path)).unwrap()
}

#[test]
fn files_of_the_site_and_beside_the_document_are_in_use() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for name in ["site/faces", "work", "state"] {
        fs::create_dir_all(at(name)).unwrap();
    }
    let smile = asset("expressions/happiness.expr.ron");
    let named = |name: &str| smile.replace("\"happiness\"", &format!("\"{name}\""));
    fs::write(at("site/faces/beaming.expr.ron"), named("beaming")).unwrap();
    fs::write(at("work/t.rig.ron"), CHAIN).unwrap();
    fs::write(at("work/grin.expr.ron"), named("grin")).unwrap();
    let site = at("site");
    let library = move |app: &mut App| {
        app.insert_resource(LibraryFolders(Some(SearchPaths { folders: vec![site.clone()] })));
    };
    let mut window = WindowBench::with_files(at("state"), (library, FilesPlugin, FolderWatchPlugin));
    let has = |window: &WindowBench, name: &str| window.world().resource::<FaceExpressions>().0.get(name).is_some();
    window.until("the site's expression", |window| has(window, "beaming"));
    assert!(!has(&window, "grin"), "no document is open");
    window.base.send(OpenRequest::File(at("work/t.rig.ron")));
    window.until("the document's expression", |window| has(window, "grin"));
    assert!(has(&window, "beaming") && has(&window, "happiness"));
    // A form of the site is that of its module, and a broken file is told and changes nothing.
    let form = asset("modules/control.ui.ron").replace("title: \"Control\"", "title: \"Handle\"");
    fs::write(at("site/control.ui.ron"), form).unwrap();
    window.until("the form", |window| {
        let modules = window.world().resource::<RigModules>().0.clone();
        modules.get("control").unwrap().form.as_deref().is_some_and(|form| form.contains("Handle"))
    });
    fs::write(at("work/grin.expr.ron"), &smile[..smile.len() / 2]).unwrap();
    window.until("the notice", |window| window.notices.include(Severity::Error, "grin.expr.ron"));
    assert!(has(&window, "grin"));
}
