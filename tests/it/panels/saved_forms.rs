//! Forms of modules that are saved while cards of their tags are open.

use std::{fs, path::Path};

use bevy_egui::egui;
use rigsmith::{
    editor::{
        ActiveRig,
        folder_watch::FolderWatchPlugin,
        library::LibraryFolders,
        panels::{PanelsPlugin, tags::TagsPanel},
    },
    files::SearchPaths,
    headless::headless_app,
    rig::{Rig, Uid},
};

use super::{
    desk::{Desk, Sheet},
    tag_values::{add_command, params_of},
};

/// The Tags panel in an app that watches a folder of the site.
fn desk_with_site(site: &Path) -> Desk {
    let mut app = headless_app(1);
    app.insert_resource(LibraryFolders(Some(SearchPaths { folders: vec![site.to_owned()] })))
        .add_plugins((PanelsPlugin, FolderWatchPlugin));
    app.finish();
    app.cleanup();
    let rig = app.world_mut().spawn(Rig::new(Uid(1), "rig")).id();
    app.insert_resource(ActiveRig(rig));
    Desk::of(app, rig, Sheet::Panel(Box::new(TagsPanel::default())), egui::vec2(400.0, 1600.0))
}

/// A form of controls with a slider of that name and these ends, and further elements.
fn form(label: &str, ends: [f32; 2], more: &str) -> String {
    let [min, max] = ends;
    format!(
        "(title: \"Control\", content: [Slider(param: \"relative_size\", label: \"{label}\", min: {min:?}, max: {max:?}, \
         step: 0.5), {more}])"
    )
}

#[test]
fn an_open_card_has_the_form_that_was_saved_last() {
    let site = tempfile::tempdir().unwrap();
    let mut desk = desk_with_site(site.path());
    let save = |text: &str| fs::write(site.path().join("control.ui.ron"), text).unwrap();
    let [a, _] = desk.chain(&["a", "b"])[..] else { panic!() };
    let tag = add_command(&mut desk, a, "control", "()");
    desk.select(&[a]);
    desk.click("Values of control");
    desk.frames(3);
    let has = |desk: &Desk, label: &str| desk.look(label).is_some();
    assert!(has(&desk, "Relative size slider") && has(&desk, "Offset group"), "{:?}", desk.seen);

    // Another label, another range, and fewer fields.
    save(&form("Extent", [0.5, 8.0], "Check(param: \"hierarchy\", label: \"In a chain\")"));
    desk.until("the saved form", |desk| has(desk, "Extent slider"));
    assert!(has(&desk, "In a chain") && !has(&desk, "Relative size slider") && !has(&desk, "Offset group"));
    let drag_to_end = |desk: &mut Desk, label: &str| {
        let slider = desk.find(label).rect;
        desk.drag(slider.center(), slider.right_center() + egui::vec2(30.0, 0.0));
        desk.frames(3);
        params_of(desk, tag)
    };
    let params = drag_to_end(&mut desk, "Extent slider");
    assert!(params.contains("relative_size: 8"), "{params}");

    // A field more, whose value is read and written.
    let fields = "Check(param: \"hierarchy\"), Check(param: \"offset_group\", label: \"With a group\")";
    save(&form("Extent", [0.5, 4.0], fields));
    desk.until("the field", |desk| has(desk, "With a group"));
    assert_eq!(desk.find("With a group").on, Some(true), "the default");
    desk.click("With a group");
    desk.frames(3);
    assert!(params_of(&desk, tag).contains("offset_group: false"), "{}", params_of(&desk, tag));
    let params = drag_to_end(&mut desk, "Extent slider");
    assert!(params.contains("relative_size: 4"), "{params}");

    // Broken forms are told, and change nothing; the next one that can be read is taken.
    let whole = form("Girth", [0.5, 2.0], fields);
    for (text, reason) in
        [(whole.replace("relative_size", "relative_sizes"), "relative_sizes"), (whole[..40].to_owned(), "")]
    {
        let count = desk.told().len();
        save(&text);
        desk.until("the notice", |desk| desk.told().len() > count);
        let told = desk.told().pop().unwrap_or_default();
        assert!(told.contains("control.ui.ron is not in use") && told.contains(reason), "{told}");
        desk.frames(3);
        assert!(has(&desk, "Extent slider") && has(&desk, "With a group") && !has(&desk, "Girth slider"), "{told}");
    }
    save(&whole);
    desk.until("the form without the fault", |desk| has(desk, "Girth slider"));
}
