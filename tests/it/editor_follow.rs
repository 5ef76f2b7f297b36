//! The window's document follows the template that it was opened from: offers, answers, and what it leaves alone.

use std::{
    fs,
    path::PathBuf,
    time::{Duration, Instant},
};

use bevy::{prelude::*, window::RequestRedraw};
use rigsmith::{
    editor::{
        ActiveRig,
        actions::{Action, ActionRequest},
        files::{
            FilesPlugin, OpenRequest,
            dialog::{Answer, DialogAnswer},
        },
        follow::{FollowPlugin, OfferAnswer},
        notice::Severity,
    },
    instance::{RigSource, RigTemplates, UpdateOffer},
    plugins::document::{Change, EditRequest},
    prelude::*,
    rig::{RestTransform, RigEdit, operations::Operation, update::Take},
};

use super::{
    bench::{AppBench, HANG, save_whole, wait_with},
    part_fields::PART,
    window_app::Notices,
};

const CHAIN: &str = r#"(
    format: 2,
    name: "chain",
    joints: [
        (label: "a", translation: (0, 1, 0), tags: [control(size: 0.5)]),
        (label: "b", parent: "a", translation: (0, 0.3, 0)),
        (label: "c", parent: "b", translation: (0, 0.4, 0)),
    ],
)
"#;

/// A window without the window, with the chain's template open.
struct Window {
    base: AppBench,
    file: PathBuf,
    notices: Notices,
    _folder: tempfile::TempDir,
}

impl Window {
    fn new() -> Self {
        Self::of(CHAIN)
    }

    /// A window with that template open, beside which is the part of the tests of parts.
    fn of(template: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder for the test");
        let file = folder.path().join("chain.rig.ron");
        fs::write(&file, template).expect("the template is written");
        fs::write(folder.path().join("finger.rig.ron"), PART).expect("the part is written");
        let base = AppBench::with_files(folder.path().join("state"), (FilesPlugin, FollowPlugin));
        let mut window = Self { base, file, notices: Notices::default(), _folder: folder };
        let path = window.file.clone();
        window.base.app.world_mut().write_message(OpenRequest::File(path));
        window.until("the followed document", |window| window.source().is_some_and(|source| source.base().is_some()));
        window.settle();
        window
    }

    fn rig(&self) -> Entity {
        self.base.open_rig()
    }

    fn source(&self) -> Option<&RigSource> {
        self.base.get::<RigSource>(self.base.app.world().get_resource::<ActiveRig>()?.0)
    }

    fn offer(&self) -> Option<&UpdateOffer> {
        self.base.get::<UpdateOffer>(self.rig())
    }

    fn data(&self) -> &Rig {
        self.base.get::<Rig>(self.rig()).expect("a rig is open")
    }

    /// Height of the joint with this label above its parent.
    fn height(&self, label: &str) -> f32 {
        self.data().joint(self.joint(label)).expect("the joint is there").data.rest.translation.y
    }

    fn joint(&self, label: &str) -> Uid {
        self.data().find_label(label).expect("the joint is there")
    }

    fn frame(&mut self) {
        self.base.app.update();
        self.notices.read(&self.base.app);
    }

    fn until(&mut self, what: &str, is_so: impl Fn(&Self) -> bool) {
        wait_with(self, what, Self::frame, is_so, |window| window.notices.list.clone());
    }

    /// Runs frames until nothing is loaded or saved, and for a while in which nothing has to happen that is not there after
    /// four of them.
    fn settle(&mut self) {
        self.until("the end of work", |window| !window.base.has_file_jobs());
        let start = Instant::now();
        (0..4).for_each(|_| self.frame());
        while start.elapsed() < Duration::from_millis(1200) {
            std::thread::sleep(Duration::from_millis(1));
            self.frame();
        }
    }

    fn save(&mut self, from: &str, to: &str) {
        let text = fs::read_to_string(&self.file).expect("the template is there");
        assert!(text.contains(from), "{text}");
        save_whole(&self.file, text.replacen(from, to, 1));
    }

    fn send<M: Message>(&mut self, message: M) {
        self.base.app.world_mut().write_message(message);
        self.frame();
        self.frame();
    }

    fn raise(&mut self, label: &str, height: f32) {
        let (rig, joint) = (self.rig(), self.joint(label));
        let edit = RigEdit::SetRest(joint, RestTransform::from_translation(Vec3::Y * height));
        self.send(EditRequest::operation(rig, Operation::Edits(vec![edit])));
    }
}

#[test]
fn a_changed_template_is_offered_and_taken_over_as_one_step() {
    let mut window = Window::new();
    assert!(window.offer().is_none(), "what is open is the file");
    window.save("0.3, 0)", "0.5, 0)");
    window.until("the offer", |window| window.offer().is_some());
    let changes: Vec<String> =
        window.offer().into_iter().flat_map(|offer| offer.changes.iter()).map(|c| c.to_string()).collect();
    assert!(changes.len() == 1 && changes[0].contains('b'), "{changes:?}");
    assert_eq!(window.height("b"), 0.3, "nothing happens before the answer");
    window.send(OfferAnswer::Take(Take::Mine));
    window.until("the update", |window| window.height("b") == 0.5);
    window.settle();
    assert!(
        window.offer().is_none() && window.notices.include(Severity::Done, "1 change taken over"),
        "{:?}",
        window.notices.list
    );
    // Undone, it stays undone until the file changes again; then both changes are offered.
    let rig = window.rig();
    window.send(EditRequest { rig, change: Change::Undo });
    window.settle();
    assert!(window.height("b") == 0.3 && window.offer().is_none());
    window.save("0.4, 0)", "0.6, 0)");
    window.until("the next offer", |window| window.offer().is_some());
    assert_eq!(window.offer().map(|offer| offer.changes.len()), Some(2));
}

/// A window that sleeps runs no frames until the file has changed, and the offer is there with those that follow.
#[test]
fn a_changed_template_wakes_a_window_that_sleeps() {
    let mut window = Window::new();
    let (wakes, woken) = std::sync::mpsc::channel();
    window.base.app.world().resource::<RigTemplates>().set_wake(move || {
        let _ = wakes.send(());
    });
    window.save("0.3, 0)", "0.5, 0)");
    woken.recv_timeout(HANG).expect("the window is woken");
    (0..4).for_each(|_| window.frame());
    assert!(window.offer().is_some(), "{:?}", window.notices.list);
    window.settle();
    assert!(woken.try_recv().is_err(), "it sleeps on while the file stays as it is");
}

/// A window that sleeps draws one frame when it is woken, and those that this one and the next ones ask for.
#[test]
fn a_woken_window_draws_until_the_change_is_told() {
    for is_live in [false, true] {
        let mut window = Window::new();
        if is_live {
            window.send(OfferAnswer::Live(true));
            window.settle();
        }
        let (wakes, woken) = std::sync::mpsc::channel();
        window.base.app.world().resource::<RigTemplates>().set_wake(move || {
            let _ = wakes.send(());
        });
        window.save("0.3, 0)", "0.5, 0)");
        woken.recv_timeout(HANG).expect("the window is woken");
        window.base.messages::<RequestRedraw>();
        window.frame();
        let mut frames = 1;
        while !window.base.messages::<RequestRedraw>().is_empty() {
            window.frame();
            frames += 1;
            assert!(frames < 20, "the window never sleeps");
        }
        let told = if is_live { "1 change taken over" } else { "The template's file has changed" };
        assert!(window.notices.list.iter().any(|notice| notice.text.contains(told)), "{:?}", window.notices.list);
        assert_eq!(window.height("b"), if is_live { 0.5 } else { 0.3 });
    }
}

#[test]
fn what_is_left_is_left_until_the_file_changes_again() {
    let mut window = Window::new();
    window.save("0.3, 0)", "0.5, 0)");
    window.until("the offer", |window| window.offer().is_some());
    window.send(OfferAnswer::Leave);
    window.settle();
    assert!(window.offer().is_none() && window.height("b") == 0.3);
    window.save("0.5, 0)", "0.7, 0)");
    window.until("the next offer", |window| window.offer().is_some());
    window.send(OfferAnswer::TakeAlways);
    window.until("the update", |window| window.height("b") == 0.7);
    // From now on nobody is asked.
    window.save("0.4, 0)", "0.9, 0)");
    window.until("the live update", |window| window.height("c") == 0.9);
    assert!(window.offer().is_none());
}

#[test]
fn what_both_sides_changed_is_a_conflict_that_people_decide() {
    for (take, height) in [(Take::Mine, 0.8), (Take::Theirs, 0.5)] {
        let mut window = Window::new();
        window.raise("b", 0.8);
        window.raise("c", 0.1);
        window.save("0.3, 0)", "0.5, 0)");
        window.until("the offer", |window| window.offer().is_some());
        let conflicts =
            window.offer().into_iter().flat_map(|offer| offer.changes.iter()).filter(|c| c.conflict).count();
        assert_eq!(conflicts, 1);
        window.send(OfferAnswer::Take(take));
        window.until("the update", |window| window.offer().is_none() && window.height("b") == height);
        window.settle();
        assert_eq!((window.height("b"), window.height("c")), (height, 0.1), "{take:?}");
        assert!(window.offer().is_none(), "{take:?}");
    }
}

#[test]
fn a_save_of_the_window_itself_is_no_news() {
    let mut window = Window::new();
    window.raise("b", 0.8);
    let path = window.file.clone();
    window.send(ActionRequest(Action::Export));
    window.send(DialogAnswer(Answer::Path(path.clone())));
    // The window asks before it writes over a file.
    window.send(DialogAnswer(Answer::Save));
    window
        .until("the saved template", |window| fs::read_to_string(&window.file).is_ok_and(|text| text.contains("0.8")));
    window.raise("b", 0.9);
    window.settle();
    assert!(window.offer().is_none() && window.height("b") == 0.9, "{:?}", window.offer());
    // What others save afterwards does not touch it either.
    window.save("0.4, 0)", "0.6, 0)");
    window.until("the offer", |window| window.offer().is_some());
    assert_eq!(window.offer().map(|offer| offer.changes.len()), Some(1));
    window.send(OfferAnswer::Take(Take::Mine));
    window.until("the update", |window| window.height("c") == 0.6);
    assert_eq!(window.height("b"), 0.9);
}

/// A hand with the part of the tests of parts.
const HAND: &str = r#"(
    format: 2,
    name: "hand",
    joints: [(label: "palm", tags: [control()])],
    parts: [
        (part: "finger.rig.ron", name: "index", parent: "palm", translation: (0, 0.1, 0), prefix: "a_"),
    ],
)
"#;

#[test]
fn a_project_remembers_the_parts_of_the_version_that_its_rig_follows() {
    let mut window = Window::of(HAND);
    window.raise("a_bone_3", 0.7);
    let joint = window.joint("a_bone_3");
    let project = window.file.with_file_name("hand.rigsmith.ron");
    window.send(ActionRequest(Action::Save));
    window.send(DialogAnswer(Answer::Path(project.clone())));
    window.until("the project", |_| project.exists());
    window.settle();
    // Somebody calls the part otherwise, and makes it longer; the project is opened again.
    window.save("name: \"index\"", "name: \"pointer\", count: 4");
    let before = window.rig();
    window.send(OpenRequest::File(project));
    window.until("the opened project", |window| window.rig() != before && window.source().is_some());
    window.until("the offer", |window| window.offer().is_some());
    let changes: Vec<String> =
        window.offer().into_iter().flat_map(|offer| offer.changes.iter()).map(|c| c.to_string()).collect();
    assert!(changes.iter().any(|change| change.contains("count: nothing to 4")), "{changes:?}");
    assert!(!changes.iter().any(|change| change.contains("conflict")), "{changes:?}");
    window.send(OfferAnswer::Take(Take::Mine));
    window.until("the update", |window| window.data().find_label("a_bone_4").is_some());
    // The part is the same one, with what was changed of it.
    assert_eq!((window.joint("a_bone_4"), window.data().len()), (joint, 5));
    assert_eq!(window.height("a_bone_4"), 0.7);
}

#[test]
fn fields_of_parts_that_the_file_changed_are_there_after_the_next_save() {
    let mut window = Window::of(HAND);
    window.raise("a_bone_1", 0.7);
    window.save("prefix: \"a_\"", "prefix: \"b_\", count: 5");
    window.until("the offer", |window| window.offer().is_some());
    let conflicts = window.offer().into_iter().flat_map(|offer| offer.changes.iter()).filter(|c| c.conflict).count();
    assert_eq!(conflicts, 0);
    window.send(OfferAnswer::Take(Take::Mine));
    window.until("the update", |window| window.data().find_label("b_bone_5").is_some());
    assert_eq!((window.height("b_bone_1"), window.data().len()), (0.7, 6));
    let path = window.file.clone();
    window.send(ActionRequest(Action::Export));
    window.send(DialogAnswer(Answer::Path(path)));
    window.send(DialogAnswer(Answer::Save));
    window
        .until("the saved template", |window| fs::read_to_string(&window.file).is_ok_and(|text| text.contains("0.7")));
    let text = fs::read_to_string(&window.file).expect("the template is there");
    assert!(text.contains("prefix: \"b_\", count: 5") && text.contains("(joint: \"bone_1\""), "{text}");
    assert!(!text.contains("a_") && !text.contains("Command(") && text.lines().count() == 8, "{text}");
}

#[test]
fn a_broken_save_changes_nothing_and_is_told() {
    let mut window = Window::new();
    save_whole(&window.file, "(format: 2, name: \"chain\", joints: [(");
    window.until("the notice", |window| window.notices.include(Severity::Error, "not taken over"));
    assert!(window.offer().is_none() && window.height("b") == 0.3);
    save_whole(&window.file, CHAIN.replace("0.3", "0.35"));
    window.until("the offer", |window| window.offer().is_some());
}

#[test]
fn a_project_remembers_the_version_that_its_rig_follows() {
    let mut window = Window::new();
    window.raise("c", 0.1);
    let project = window.file.with_file_name("chain.rigsmith.ron");
    window.send(ActionRequest(Action::Save));
    window.send(DialogAnswer(Answer::Path(project.clone())));
    window.until("the project", |_| project.exists());
    window.settle();
    // Somebody changes the template; the project is opened again.
    window.save("0.3, 0)", "0.5, 0)");
    let before = window.rig();
    window.send(OpenRequest::File(project));
    window.until("the opened project", |window| window.rig() != before && window.source().is_some());
    window.until("the offer", |window| window.offer().is_some());
    let changes: Vec<(String, bool)> = window
        .offer()
        .into_iter()
        .flat_map(|offer| offer.changes.iter())
        .map(|c| (c.to_string(), c.conflict))
        .collect();
    // What was changed in the project is its own, and no conflict.
    assert!(changes.len() == 1 && changes[0].0.contains('b') && !changes[0].1, "{changes:?}");
    window.send(OfferAnswer::Take(Take::Mine));
    window.until("the update", |window| window.height("b") == 0.5);
    assert_eq!(window.height("c"), 0.1);
}
