//! The window takes over expressions and forms of the document's folder and of the site's.

use std::{fs, path::Path, time::Duration};

use bevy::{ecs::message::MessageCursor, prelude::*};
use rigsmith::{
    editor::{
        files::{FilesPlugin, OpenRequest, StateFolder},
        folder_watch::FolderWatchPlugin,
        library::LibraryFolders,
        notice::{Notice, Severity},
    },
    files::SearchPaths,
    headless::headless_app,
    plugins::{commands::RigModules, face::FaceExpressions},
    test_app::strict_app,
};

use super::{bench::HANG, template_text::CHAIN};

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
    let mut app = headless_app(7);
    app.insert_resource(StateFolder(Some(at("state"))))
        .insert_resource(LibraryFolders(Some(SearchPaths { folders: vec![at("site")] })))
        .add_plugins((FilesPlugin, FolderWatchPlugin))
        .add_message::<AppExit>();
    let mut app = strict_app(app);
    let mut notices: Vec<Notice> = Vec::new();
    let mut cursor = MessageCursor::<Notice>::default();
    let mut until = |app: &mut App, what: &str, is_so: &dyn Fn(&World, &[Notice]) -> bool| {
        let start = std::time::Instant::now();
        loop {
            app.update();
            notices.extend(cursor.read(app.world().resource::<Messages<Notice>>()).cloned());
            if is_so(app.world(), &notices) {
                return;
            }
            assert!(start.elapsed() < HANG, "{what} does not come: {notices:?}");
            std::thread::sleep(Duration::from_millis(5));
        }
    };
    let has = |world: &World, name: &str| world.resource::<FaceExpressions>().0.get(name).is_some();
    until(&mut app, "the site's expression", &|world, _| has(world, "beaming"));
    assert!(!has(app.world(), "grin"), "no document is open");
    app.world_mut().write_message(OpenRequest::File(at("work/t.rig.ron")));
    until(&mut app, "the document's expression", &|world, _| has(world, "grin"));
    assert!(has(app.world(), "beaming") && has(app.world(), "happiness"));
    // A form of the site is that of its module, and a broken file is told and changes nothing.
    let form = asset("modules/control.ui.ron").replace("title: \"Control\"", "title: \"Handle\"");
    fs::write(at("site/control.ui.ron"), form).unwrap();
    until(&mut app, "the form", &|world, _| {
        let modules = world.resource::<RigModules>().0.clone();
        modules.get("control").unwrap().form.as_deref().is_some_and(|form| form.contains("Handle"))
    });
    fs::write(at("work/grin.expr.ron"), &smile[..smile.len() / 2]).unwrap();
    until(&mut app, "the notice", &|_, notices| {
        notices.iter().any(|notice| notice.severity == Severity::Error && notice.text.contains("grin.expr.ron"))
    });
    assert!(has(app.world(), "grin"));
}
