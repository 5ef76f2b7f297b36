//! The walk over the Loader: a part of a folder is chosen, and the form that writes templates is open, with a file of the test's
//! folder.

use std::fs;

use rigsmith::editor::library::ListTemplates;

use super::*;

/// A template of two joints, with an option and a socket, of a kind.
fn limb(kind: &str) -> String {
    format!(
        r#"(
    format: 2,
    name: "limb",
    version: "1.0.0",
    kind: "{kind}",
    sockets: [(name: "end", joint: "lower")],
    options: [(name: "size", default: 0.5, sets: [(tag: "control/upper", param: "size")])],
    joints: [
        (label: "upper", translation: (0, 1, 0), tags: [control(size: 0.5)]),
        (label: "lower", parent: "upper", translation: (0, -0.3, 0), tags: [null()]),
    ],
)
"#
    )
}

/// Chooses a template of a folder, as a click on its tile does.
pub(super) fn choose(walk: &mut Walk, kind: &str) -> TemplatePlace {
    let site = walk.folder.path().join("site");
    fs::create_dir_all(&site).unwrap();
    let file = site.join("limb.rig.ron");
    fs::write(&file, limb(kind)).unwrap();
    let world = walk.desk.app.world_mut();
    world.insert_resource(LibraryFolders(Some(SearchPaths { folders: vec![site] })));
    world.write_message(ListTemplates);
    let place = TemplatePlace::File(file);
    walk.desk.until("the listed template", |desk| {
        desk.app.world().resource::<TemplateLibrary>().listing().find(&place).is_some()
    });
    walk.desk.app.insert_resource(ChosenTemplate(Some(place.clone())));
    walk.rest();
    place
}

#[test]
fn all_that_the_loader_does_is_taken_back_by_undo() {
    let mut walk = Walk::new(Box::new(LoaderPanel::default()), egui::vec2(360.0, 2000.0));
    let chosen = choose(&mut walk, "part");
    let file = walk.folder.path().join("saved.rig.ron");
    // A picture needs a viewport.
    let draft = TemplateDraft { is_open: true, path: file.display().to_string(), picture: false, replace: true };
    walk.shelf = Some(Shelf { chosen, draft });
    walk.ready();
    let seen: Vec<String> = walk.names().into_iter().map(|(name, _)| name).collect();
    for wanted in ["Load", "Merge", "Add part", "Delete rig", "Option size", "Template file", "Save template"] {
        assert!(seen.iter().any(|name| name == wanted), "{wanted} is not in sight: {seen:?}");
    }
    walk.crawl("Loader");
    assert!(walk.wrong.is_empty(), "{} are wrong:\n{}", walk.wrong.len(), walk.wrong.join("\n"));
    for button in ["Load", "Merge", "Add part", "Delete rig"] {
        let told = walk.desk.told();
        assert!(walk.made.contains(&format!("Loader: {button}")), "{button}: {:?}, {told:?}", walk.made);
    }
    assert!(file.exists(), "templates are written to the file of the form");
}
