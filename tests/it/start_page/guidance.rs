//! Help over the window: the tour, the search, toasts, looks and keys.

use rigsmith::rig::animation::RigClip;

use super::*;

#[test]
fn the_tour_advances_when_its_steps_are_done() {
    let folder = folder();
    let mut page = Page::open(folder.path(), None);
    page.click("Take the tour");
    let tour = |page: &Page| page.world().resource::<Tour>().clone();
    assert!(tour(&page).is_on() && page.mesh().as_deref() == Some("biped"));
    assert!(page.desk.says("1 of 3: Put a skeleton in"), "{:?}", page.desk.seen);
    let bytes = write_template(page.desk.rig());

    change(&mut page, Change::Do(Operation::Chain { positions: vec![Vec3::Y, Vec3::Y * 1.5], parent: None }));
    assert!(page.desk.says("2 of 3: Skin it"), "{:?}", page.desk.seen);
    let (uid, points) = {
        let mesh = page.world().get::<RigMesh>(page.mesh_entity()).unwrap();
        (mesh.uid, mesh.rest.points.len())
    };
    let joint = page.desk.rig().walk().next().unwrap().data.uid;
    let skin = RigEdit::SetSkin(uid, Some(Arc::new(held_by(joint, points))));
    change(&mut page, Change::Do(Operation::Edits(vec![skin])));
    assert!(page.desk.says("3 of 3: Pose it"), "{:?}", page.desk.seen);

    let bent = Operation::Pose(vec![(joint, PoseOffset::from_rotation(Quat::from_rotation_z(0.5)))]);
    change(&mut page, Change::Preview(bent));
    assert_eq!(tour(&page).present(), Some(TourStep::Pose), "a drag that may yet be dropped is no pose");
    change(&mut page, Change::Commit);
    assert!(page.desk.says("From a mesh to a pose"), "{:?}", page.desk.seen);

    // What is undone is to be done again, and the rig is as it was, byte by byte.
    for step in [TourStep::Pose, TourStep::Weights, TourStep::Joints] {
        change(&mut page, Change::Undo);
        assert_eq!(tour(&page).present(), Some(step));
    }
    assert_eq!(write_template(page.desk.rig()), bytes);
    page.click("Skip");
    assert!(page.desk.says("2 of 3: Skin it"));
    assert!(page.desk.says("Not yet: there are no joints."), "{:?}", page.desk.seen);
    page.click("End the tour");
    assert!(!tour(&page).is_on());

    // Another document ends it.
    page.send(ActionRequest(Action::StartPage));
    page.click("Take the tour");
    assert!(tour(&page).is_on());
    page.send(OpenRequest::Empty);
    assert!(!tour(&page).is_on());
}

#[test]
fn the_help_finds_actions_and_says_why_not() {
    let folder = folder();
    let mut page = Page::open(folder.path(), None);
    page.send(ActionRequest(Action::Cancel));
    let rows = help::rows(page.world(), "");
    assert_eq!(rows.iter().map(|row| row.action).collect::<Vec<_>>(), Action::all());
    let found = help::rows(page.world(), "ctrl+b the rig");
    let [build] = &found[..] else { panic!("by its key and its name: {found:?}") };
    assert_eq!((build.action, build.keys.as_str()), (Action::Build, "Ctrl+B"));
    assert!(build.obstacle.is_some_and(|why| why.contains("no joint has commands")));
    let redo = help::rows(page.world(), "redo");
    assert_eq!(redo[0].keys, "Ctrl+Shift+Z, Ctrl+Y", "all of its keys");
    let missing: Vec<Action> = rows.into_iter().filter(|row| row.text.is_empty()).map(|row| row.action).collect();
    assert!(missing.is_empty(), "{missing:?}");

    page.send(ActionRequest(Action::Help));
    assert!(page.world().resource::<HelpShown>().0 && page.desk.says("Select mode"));
    // The search has the keyboard at once.
    page.desk.type_text("half-tr");
    page.settle();
    assert!(page.desk.says("No action is called so."), "{:?}", page.desk.seen);
    page.desk.key(egui::Key::Escape);
    page.settle();
    assert!(!page.world().resource::<HelpShown>().0);
    // A click lets an action wait for another key.
    page.send(ActionRequest(Action::Help));
    page.desk.type_text("select mode");
    page.settle();
    page.click("Select mode");
    assert!(page.desk.says("press a key"), "{:?}", page.desk.seen);
    let waiting = page.world().resource::<ChosenKey>().0;
    assert_eq!(waiting, Some(Action::Mode(Mode::Select)));
    page.desk.app.insert_resource(ChosenKey(None));
    page.send(ActionRequest(Action::Help));
    page.send(ActionRequest(Action::Help));
    page.desk.type_text("mesh is open");
    page.settle();
    assert!(page.desk.says("Meshes") && !page.desk.says("Select mode"), "{:?}", page.desk.seen);
}

#[test]
fn the_palette_says_why_an_action_can_do_nothing() {
    let folder = folder();
    let mut page = Page::open(folder.path(), None);
    page.send(ActionRequest(Action::Cancel));
    let why = |page: &Page, action: Action| palette::obstacle(page.world(), action);
    assert_eq!(why(&page, Action::Accept), Some("nothing is drawn or fitted"));
    assert_eq!(why(&page, Action::NextVolume), Some("no joint is placed, and no stroke is drawn"));
    for action in [Action::XRay, Action::Wireframe, Action::Meshes, Action::Fit, Action::Skin] {
        assert_eq!(why(&page, action), Some("no mesh is open"), "{action:?}");
    }
    page.send(ActionRequest(Action::Palette));
    page.desk.type_text("x-ray");
    page.settle();
    assert!(page.desk.says("X-ray") && page.desk.says("no mesh is open"), "{:?}", page.desk.seen);
    page.desk.key(egui::Key::Escape);
    page.settle();
    page.desk.app.insert_resource(Mode::Place);
    page.send(OpenRequest::Bundled);
    assert_eq!([Action::NextVolume, Action::XRay, Action::Fit].map(|action| why(&page, action)), [None; 3]);
}

#[test]
fn a_key_whose_action_can_do_nothing_tells_the_reason_of_the_palette() {
    let folder = folder();
    let mut page = Page::open(folder.path(), None);
    page.send(ActionRequest(Action::Cancel));
    let is_told =
        |page: &Page, text: &str| page.world().resource::<LogBook>().entries().any(|entry| entry.notice.text == text);
    let actions = [
        Action::Build,
        Action::RollBack,
        Action::StepForward,
        Action::StepBack,
        Action::XRay,
        Action::Wireframe,
        Action::Meshes,
        Action::Deforming,
        Action::OnionSkin,
    ];
    for action in actions {
        let why = palette::obstacle(page.world(), action).unwrap_or_else(|| panic!("{action:?} can do something"));
        page.send(ActionRequest(action));
        assert!(is_told(&page, &format!("{}: {why}.", help::describe(action))), "{action:?} is silent");
    }
    // What can be done needs no word.
    page.send(OpenRequest::Bundled);
    let count = page.world().resource::<LogBook>().next_number();
    page.send(ActionRequest(Action::XRay));
    page.send(ActionRequest(Action::Meshes));
    assert_eq!(page.world().resource::<LogBook>().next_number(), count);
}

#[test]
fn the_help_gives_all_actions_their_usual_keys_again() {
    let folder = folder();
    let mut page = Page::open(folder.path(), None);
    page.send(ActionRequest(Action::Cancel));
    page.send(ActionRequest(Action::Help));
    assert!(!page.desk.find("Usual keys").enabled, "nothing was bound");
    let mut keys = KeyBindings::default();
    keys.bind(Chord::try_from("J".to_owned()).unwrap(), Action::Fit);
    keys.bind(Chord::try_from("F".to_owned()).unwrap(), Action::Skin);
    page.desk.app.insert_resource(keys);
    page.settle();
    // The page takes some frames to its size.
    page.settle();
    page.click("Usual keys");
    assert_eq!(*page.world().resource::<KeyBindings>(), KeyBindings::default());
    assert!(page.world().resource::<HelpShown>().0, "the page stays");
}

#[test]
fn the_palette_brings_panels_forward() {
    let folder = folder();
    let mut page = Page::open(folder.path(), None);
    page.send(ActionRequest(Action::Cancel));
    let all = palette::found_panels(page.world(), "");
    assert!(all.contains(&"Process") && all.contains(&"Timeline") && all.len() > 15, "{all:?}");
    assert_eq!(palette::found_panels(page.world(), "PANEL proc"), ["Process"]);
    page.panels.clear();
    page.send(ActionRequest(Action::Palette));
    page.desk.type_text("process panel");
    page.settle();
    assert!(page.desk.says("Process panel"), "{:?}", page.desk.seen);
    page.desk.key(egui::Key::Enter);
    page.settle();
    assert_eq!(page.panels, ["Process"]);
    assert!(!page.desk.says("Process panel"), "the palette is closed");
}

#[test]
fn the_next_step_leads_to_clips_that_came_with_a_rig() {
    let folder = folder();
    let mut page = Page::open(folder.path(), None);
    page.send(ActionRequest(Action::Cancel));
    change(&mut page, Change::Do(Operation::Place { position: Vec3::Y, parent: None }));
    for (number, said) in
        [(0, r#"The rig has a clip, "clip 0""#), (1, "The rig has 2 clips: choose one in the Timeline")]
    {
        let clip = RigClip::new(Uid(70 + number), Uid(80 + number), format!("clip {number}"));
        change(&mut page, Change::Do(Operation::Edits(vec![RigEdit::AddClip(Box::new(clip), usize::MAX)])));
        let next = next_step(page.world()).expect("a next step");
        assert!(next.starts_with(said), "{next}");
    }
}

#[test]
fn toasts_keep_clear_of_windows() {
    let folder = folder();
    let mut page = Page::open(folder.path(), None);
    page.send(ActionRequest(Action::Cancel));
    page.send(ActionRequest(Action::Help));
    let toasts = |page: &Page| {
        let crosses = page.desk.seen.iter().filter(|seen| seen.label == "Close");
        crosses.map(|cross| cross.rect).collect::<Vec<_>>()
    };
    for number in 0..3 {
        page.desk.app.world_mut().write_message(Notice::error(format!("something went wrong, number {number}")));
    }
    page.desk.frames(4);
    let help = page.desk.ctx.memory(|memory| memory.area_rect(help::page_id())).expect("the help is shown");
    for toast in toasts(&page) {
        assert!(!help.intersects(toast), "{toast:?} covers {help:?}");
    }
    page.send(ActionRequest(Action::Help));
    page.desk.frames(4);
    let low: Vec<f32> = toasts(&page).iter().map(|toast| toast.bottom()).collect();
    assert!(low.len() >= 3 && low.iter().any(|bottom| *bottom > 640.0), "{low:?}");
}

/// Toasts that a person reads beside the start page lie on none of its choices, in windows of all sizes.
#[test]
fn toasts_keep_clear_of_the_start_page() {
    let folder = folder();
    let mut page = Page::open(folder.path(), None);
    assert!(page.is_shown());
    for (width, height) in [(1280.0, 720.0), (1024.0, 600.0), (560.0, 640.0), (1920.0, 1080.0)] {
        page.desk.resize(width, height);
        for text in ["There is nothing to undo.", "hero.glb was not opened: line 12, column 7: expected a number."] {
            page.desk.app.world_mut().write_message(Notice::error(text));
        }
        page.desk.frames(5);
        let start = page.desk.ctx.memory(|memory| memory.area_rect(start::page_id())).expect("the page is shown");
        let crosses = page.desk.seen.iter().filter(|seen| seen.label == "Close");
        let toasts: Vec<egui::Rect> = crosses.map(|cross| cross.rect).collect();
        assert!(!toasts.is_empty(), "{width} x {height}: nothing is told");
        let window = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(width, height));
        for shown in page.desk.seen.iter().filter(|seen| seen.label.starts_with("Show in")) {
            let is_beside = !start.intersects(shown.rect) && window.contains_rect(shown.rect);
            assert!(is_beside, "{width} x {height}: {:?} lies on {start:?}", shown.rect);
        }
        for tile in page.desk.seen.iter().filter(|seen| seen.label.starts_with("Template ")) {
            assert!(toasts.iter().all(|toast| !tile.rect.intersects(*toast)), "{width} x {height}: {}", tile.label);
        }
    }
}

#[test]
fn looks_are_kept_and_keys_that_are_bound_twice_are_told() {
    let folder = folder();
    let mut page = Page::open(folder.path(), None);
    for action in [Action::UiLarger, Action::UiLarger, Action::Theme, Action::Contrast] {
        page.send(ActionRequest(action));
    }
    let settings = page.settings().clone();
    assert_eq!((settings.ui_scale, settings.theme, settings.high_contrast), (1.25, WindowTheme::Light, true));
    for _ in 0..20 {
        page.send(ActionRequest(Action::UiLarger));
    }
    assert_eq!(page.settings().ui_scale, 2.5, "there is a largest size");
    page.send(ActionRequest(Action::UiUsual));
    page.send(ActionRequest(Action::UiSmaller));
    page.quit();
    let again = Page::open(folder.path(), None);
    let settings = again.settings();
    assert_eq!((settings.ui_scale, settings.theme, settings.high_contrast), (0.9, WindowTheme::Light, true));
    again.quit();

    let file = folder.path().join("config/settings.ron");
    let keys = r#"(settings: (ui_scale: 99.0), keys: Some([("Ctrl+B", Build), ("Ctrl+B", Skin), ("F1", Help)]))"#;
    fs::write(&file, keys).expect("written");
    let page = Page::open(folder.path(), None);
    assert_eq!(page.settings().ui_scale, 2.5, "no size in which nothing can be read");
    let keys = page.world().resource::<KeyBindings>();
    let chord = Chord::try_from("Ctrl+B".to_owned()).unwrap();
    assert_eq!((keys.action(&chord), keys.0.len()), (Some(Action::Build), 2));
    let told: Vec<String> =
        page.world().resource::<LogBook>().entries().map(|entry| entry.notice.text.clone()).collect();
    let refused = r#"Ctrl+B is bound to "Build the rig" and not to "Skin" as well"#;
    assert!(told.iter().any(|told| told.contains(refused)), "{told:?}");
    assert!(KeyBindings::default().clone().refuse_doubles().is_empty(), "no default key is bound twice");
}
