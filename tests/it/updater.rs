//! The Updater panel: a newer file on the disk, the list of its changes, a choice for each conflict, and the rig after it.

use std::{
    fs,
    path::PathBuf,
    sync::Arc,
    time::{Duration, Instant},
};

use bevy::prelude::*;
use bevy_egui::{EguiContext, EguiPrimaryContextPass, PrimaryEguiContext, egui};
use rigsmith::{
    editor::{
        ActiveRig,
        actions::{Action, ActionRequest},
        dock::DockPlugin,
        files::{FilesPlugin, OpenRequest, StateFolder},
        follow::{FollowPlugin, OfferAnswer},
        library::{LibraryAction, LibraryFolders},
        panels::{PanelsPlugin, updater::UpdaterPanel},
    },
    files::SearchPaths,
    headless::headless_app,
    instance::{RigSource, UpdateOffer},
    modules,
    prelude::*,
    processor::Builder,
    rig::{
        PoseOffset, RestTransform, RigEdit, Uid,
        animation::{Key, Property, TrackTarget},
        operations::{ClipOperation, KeyOperation},
        template::{read_template, write_template},
        update::{Choices, Take, update_with},
    },
    test_app::strict_app,
};

use super::{
    bench::save_whole,
    panels::desk::{Desk, Sheet},
    window_app::decline_foreign_offers,
};

const CHAIN: &str = r#"(
    format: 2,
    name: "chain",
    version: "1.0.0",
    joints: [
        (label: "a", translation: (0, 1, 0), tags: [control(size: 0.5)]),
        (label: "b", parent: "a", translation: (0, 0.3, 0)),
        (label: "c", parent: "b", translation: (0, 0.4, 0)),
    ],
)
"#;

/// The next version: `a` and `b` stand elsewhere, `d` is another joint.
fn next() -> String {
    CHAIN
        .replace("\"1.0.0\"", "\"1.1.0\"")
        .replace("(0, 1, 0)", "(0, 1.25, 0)")
        .replace("(0, 0.3, 0)", "(0, 0.5, 0)")
        .replace("0.4, 0)),", "0.4, 0)),\n        (label: \"d\", parent: \"c\", translation: (0, 0.2, 0)),")
}

struct Studio {
    desk: Desk,
    file: PathBuf,
    folder: tempfile::TempDir,
}

impl Studio {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("chain.rig.ron");
        fs::write(&file, CHAIN).unwrap();
        let mut app = headless_app(7);
        app.insert_resource(StateFolder(Some(folder.path().join("state"))))
            .insert_resource(LibraryFolders(Some(SearchPaths::default())))
            .add_plugins((FilesPlugin, FollowPlugin, PanelsPlugin, DockPlugin, decline_foreign_offers))
            .add_message::<AppExit>();
        let sheet = Sheet::Panel(Box::new(UpdaterPanel::default()));
        let desk = Desk::of(strict_app(app), Entity::PLACEHOLDER, sheet, egui::vec2(320.0, 500.0));
        let mut studio = Self { desk, file, folder };
        studio.desk.app.world_mut().write_message(OpenRequest::File(studio.file.clone()));
        studio.desk.until("the document", |desk| {
            let world = desk.app.world();
            let active = world.get_resource::<ActiveRig>();
            active.and_then(|active| world.get::<RigSource>(active.0)?.base()).is_some()
        });
        studio.desk.rig = studio.desk.app.world().resource::<ActiveRig>().0;
        studio.settle();
        studio
    }

    /// Runs frames for a while, in which nothing has to happen that is not there after four of them.
    fn settle(&mut self) {
        let start = Instant::now();
        self.desk.frames(4);
        while start.elapsed() < Duration::from_millis(1200) {
            self.desk.frame();
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn joint(&self, label: &str) -> Uid {
        self.desk.rig().find_label(label).unwrap()
    }

    fn height(&self, label: &str) -> f32 {
        self.desk.rig().joint(self.joint(label)).unwrap().data.rest.translation.y
    }

    fn raise(&mut self, label: &str, height: f32) {
        let edit = RigEdit::SetRest(self.joint(label), RestTransform::from_translation(Vec3::Y * height));
        self.desk.edit(Operation::Edits(vec![edit]));
    }

    fn save(&mut self, text: &str) {
        save_whole(&self.file, text);
        self.desk.until("the offer", |desk| desk.app.world().get::<UpdateOffer>(desk.rig).is_some());
        self.desk.frames(2);
    }

    fn text(&self) -> String {
        write_template(self.desk.rig())
    }

    /// Texts of the whole window, as the dock draws it.
    fn window(&mut self, width: f32, height: f32) -> Vec<(String, egui::Rect)> {
        let world = self.desk.app.world_mut();
        let entity = world.spawn(PrimaryEguiContext).id();
        let ctx = world.get_mut::<EguiContext>(entity).unwrap().get_mut().clone();
        let mut seen = Vec::new();
        for _ in 0..5 {
            let screen_rect = Some(egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(width, height)));
            ctx.begin_pass(egui::RawInput { screen_rect, ..default() });
            world.run_schedule(EguiPrimaryContextPass);
            seen.clear();
            let mut output = ctx.end_pass();
            // Nothing is drawn, so no texture has to be made.
            output.textures_delta.clear();
            output.shapes.iter().for_each(|shape| texts(&shape.shape, shape.clip_rect, &mut seen));
        }
        world.despawn(entity);
        seen
    }

    /// Rig that `rigsmith update` makes of this one.
    #[cfg(feature = "cli")]
    fn of_command(&self, now: &str, take: &str) -> String {
        let folder = self.folder.path();
        fs::write(folder.join("base.rig.ron"), CHAIN).unwrap();
        fs::write(folder.join("now.rig.ron"), now).unwrap();
        let args = [
            "update",
            "now.rig.ron",
            "--from",
            "chain.rig.ron",
            "--base",
            "base.rig.ron",
            "--take",
            take,
            "-o",
            "out.rig.ron",
        ];
        let (code, said) = super::cli_outputs::rigsmith(folder, &args);
        assert_eq!(code, 0, "{said}");
        write_template(&read_template(&fs::read(folder.join("out.rig.ron")).unwrap()).unwrap().rig)
    }
}

/// Texts of a shape, with the parts of them that are seen.
fn texts(shape: &egui::Shape, clip: egui::Rect, seen: &mut Vec<(String, egui::Rect)>) {
    match shape {
        egui::Shape::Text(text) => {
            let rect = egui::Rect::from_min_size(text.pos, text.galley.size());
            seen.push((text.galley.text().to_owned(), rect.intersect(clip)));
        }
        egui::Shape::Vec(shapes) => shapes.iter().for_each(|shape| texts(shape, clip, seen)),
        _ => {}
    }
}

#[test]
fn a_newer_file_has_a_badge_on_the_tab_in_the_toolbar_and_in_the_status_line() {
    let mut studio = Studio::new();
    let badges = ["Updater ⬆", "⬆ Update", "the template's file is newer"];
    let find = |seen: &[(String, egui::Rect)], part: &str| seen.iter().find(|(text, _)| text.contains(part)).cloned();
    let before = studio.window(1280.0, 720.0);
    assert!(find(&before, "Updater").is_some(), "the tab is there: {before:?}");
    for badge in badges {
        assert!(find(&before, badge).is_none(), "{badge}");
    }
    studio.save(&next());
    for (width, height) in [(1280.0, 720.0), (1024.0, 600.0)] {
        let seen = studio.window(width, height);
        for badge in badges {
            let (_, rect) = find(&seen, badge).unwrap_or_else(|| panic!("{badge} at {width}: {seen:?}"));
            assert!(
                rect.is_positive() && rect.right() <= width && rect.bottom() <= height,
                "{badge} at {width}: {rect:?}"
            );
        }
    }
}

#[test]
fn a_newer_file_is_listed_and_taken_over_as_the_command_does() {
    for (all, take) in [("All mine", "mine"), ("All theirs", "theirs")] {
        let mut studio = Studio::new();
        assert!(studio.desk.says("The rig has everything that its file has."), "{:?}", studio.desk.seen);
        studio.raise("a", 2.0);
        studio.raise("b", 0.8);
        studio.raise("c", 0.1);
        let before = studio.desk.rig().clone();
        let now = studio.text();
        studio.save(&next());
        // The badge, the notice and the list.
        assert!(studio.desk.told().iter().any(|told| told.contains("2 conflicts") && told.contains("Updater")));
        for told in ["Mine: a translation", "Theirs: a translation", "Mine: b translation", "d", "version"] {
            assert!(studio.desk.says(told), "{told} is not among {:?}", studio.desk.seen);
        }
        assert_eq!(*studio.desk.rig(), before, "nothing happens before the answer");
        let steps = studio.desk.steps().1;
        studio.desk.click(all);
        studio.desk.frames(2);
        let side = if take == "mine" { "Mine: b translation" } else { "Theirs: b translation" };
        assert_eq!(studio.desk.find(side).on, Some(true));
        studio.desk.click("Take over");
        studio.desk.until("the update", |desk| desk.rig().len() == 4);
        studio.settle();
        assert_eq!(studio.desk.steps().1, steps + 1);
        #[cfg(feature = "cli")]
        assert_eq!(studio.text(), studio.of_command(&now, take));
        assert_ne!(studio.text(), now);
        studio.desk.undo(1);
        assert_eq!(studio.text(), now, "undo gives equal bytes");
        assert_eq!(*studio.desk.rig(), before);
    }
}

#[test]
fn each_conflict_has_a_choice_of_its_own_and_keys_and_poses_stay() {
    let mut studio = Studio::new();
    let c = studio.joint("c");
    let bent = PoseOffset { rotation: Quat::from_rotation_z(0.5), ..PoseOffset::IDENTITY };
    studio.desk.edit(Operation::StorePose("straight".to_owned()));
    let create = ClipOperation::Create { name: "wave".to_owned(), frame_rate: 24.0, range: [0.0, 1.0] };
    studio.desk.edit(Operation::Clips(create));
    let clip = studio.desk.rig().clips()[0].uid;
    let key = Box::new(Operation::Pose(vec![(c, bent)]));
    studio.desk.edit(Operation::Keyed { operation: key, clip, layer: None, time: 0.5 });
    studio.raise("a", 2.0);
    studio.raise("b", 0.8);
    let before = studio.desk.rig().clone();
    studio.save(&next());
    studio.desk.click("Theirs: b translation");
    studio.desk.frames(2);
    assert_eq!(studio.desk.find("Theirs: b translation").on, Some(true));
    assert_eq!(studio.desk.find("Mine: a translation").on, Some(true));
    studio.desk.click("Take over");
    studio.desk.until("the update", |desk| desk.rig().len() == 4);
    studio.settle();
    assert_eq!((studio.height("a"), studio.height("b")), (2.0, 0.5));
    let after = studio.desk.rig().clone();
    assert_eq!(after.stored_poses(), before.stored_poses());
    assert_eq!(after.clip(clip).unwrap().key_count(), before.clip(clip).unwrap().key_count());
    let turned = |rig: &rigsmith::rig::Rig| rig.clip(clip).unwrap().sample(0.5).offsets[&c].rotation;
    assert!(turned(&after).angle_between(turned(&before)) < 1e-3);
    assert!(after.pose()[&c].rotation.angle_between(before.pose()[&c].rotation) < 1e-3);
    // The library gives the same for the same choices.
    let base = read_template(CHAIN.as_bytes()).unwrap().rig;
    let file = read_template(next().as_bytes()).unwrap().rig;
    let mut choices = Choices::from(Take::Mine);
    choices.others.insert((studio.joint("b"), Some("translation".to_owned())));
    assert_eq!(write_template(&update_with(Some(&base), &before, &file, &choices).rig), studio.text());
}

#[test]
fn keys_of_a_control_that_is_gone_are_told_before_and_after() {
    let mut studio = Studio::new();
    let built = Builder::build(studio.desk.rig(), &Arc::new(modules::all())).unwrap();
    let control = built.nodes.iter().find(|node| node.control.is_some()).unwrap().uid;
    let create = ClipOperation::Create { name: "wave".to_owned(), frame_rate: 24.0, range: [0.0, 1.0] };
    studio.desk.edit(Operation::Clips(create));
    let (clip, layer) = {
        let clip = &studio.desk.rig().clips()[0];
        (clip.uid, clip.layers[0].uid)
    };
    let target = TrackTarget { node: control, property: Property::Rotation };
    let keys = vec![Key::rotation(0.0, Quat::IDENTITY), Key::rotation(1.0, Quat::from_rotation_z(1.0))];
    let change = KeyOperation::Set(vec![(target.clone(), keys.clone())]);
    studio.desk.edit(Operation::Clips(ClipOperation::Keys { clip, layer, change }));
    studio.save(&CHAIN.replace(", tags: [control(size: 0.5)]", ""));
    let offer = studio.desk.app.world().get::<UpdateOffer>(studio.desk.rig).unwrap().clips.clone();
    let [aside] = &offer.set_aside[..] else { panic!("{offer:?}") };
    assert_eq!((aside.keys.node, aside.keys.keys), (control, 2));
    let line = aside.to_string();
    assert!(studio.desk.says(&line), "{line} is not among {:?}", studio.desk.seen);
    studio.desk.click("Take over");
    studio.desk.until("the update", |desk| desk.rig().walk().all(|joint| joint.data.tags.is_empty()));
    studio.settle();
    let told = studio.desk.told();
    assert!(told.contains(&line), "{told:?}");
    assert!(told.iter().any(|told| told.contains("set aside") && told.contains("the log lists them")), "{told:?}");
    assert_eq!(studio.desk.rig().clip(clip).unwrap().layers[0].tracks[&target].keys, keys);
}

#[test]
fn an_update_is_left_and_later_ones_come_live() {
    let mut studio = Studio::new();
    studio.save(&CHAIN.replace("(0, 0.3, 0)", "(0, 0.5, 0)"));
    assert!(studio.desk.look("Mine: b translation").is_none(), "a change that is no conflict has no choice");
    studio.desk.click("Leave");
    studio.settle();
    assert!(studio.desk.app.world().get::<UpdateOffer>(studio.desk.rig).is_none() && studio.height("b") == 0.3);
    studio.save(&CHAIN.replace("(0, 0.3, 0)", "(0, 0.6, 0)"));
    studio.desk.click("Live");
    studio.desk.until("the update", |desk| {
        let rig = desk.rig();
        rig.find_label("b").and_then(|b| rig.joint(b)).is_some_and(|b| b.data.rest.translation.y == 0.6)
    });
    save_whole(&studio.file, CHAIN.replace("(0, 0.4, 0)", "(0, 0.9, 0)"));
    studio.desk.until("the live update", |desk| {
        let rig = desk.rig();
        rig.find_label("c").and_then(|c| rig.joint(c)).is_some_and(|c| c.data.rest.translation.y == 0.9)
    });
    // A conflict is asked about all the same, and the action of the palette answers it.
    studio.raise("c", 0.1);
    studio.save(&CHAIN.replace("(0, 0.4, 0)", "(0, 0.95, 0)"));
    assert_eq!(studio.height("c"), 0.1);
    let take = ActionRequest(Action::Library(LibraryAction::TakeTheirs));
    studio.desk.app.world_mut().write_message(take);
    studio.desk.until("the answer", |desk| {
        let rig = desk.rig();
        let c = rig.find_label("c").and_then(|c| rig.joint(c));
        c.is_some_and(|c| (c.data.rest.translation.y - 0.95).abs() < 1e-6)
    });
    studio.settle();
    assert!((studio.height("c") - 0.95).abs() < 1e-6);
    studio.desk.click("Live");
    studio.settle();
    assert!(!studio.desk.app.world().get::<RigSource>(studio.desk.rig).unwrap().is_live);
    studio.desk.app.world_mut().write_message(OfferAnswer::Live(true));
    studio.settle();
    assert!(studio.desk.app.world().get::<RigSource>(studio.desk.rig).unwrap().is_live);
}

/// Parents that people choose joint by joint, and that are a circle together, end in a rig without one.
#[test]
fn mixed_choices_of_parents_make_no_circle() {
    let chain = |parents: [&str; 3]| {
        let joint = |label: &str, parent: &str| {
            let parent = if parent.is_empty() { String::new() } else { format!("parent: \"{parent}\", ") };
            format!("(label: \"{label}\", {parent}translation: (0, 1, 0)),")
        };
        let [p, q, r] = parents;
        let mut joints = [("p", p), ("q", q), ("r", r)];
        // Parents come first in a file.
        joints.sort_by_key(|(label, _)| {
            let mut depth = 0;
            let mut above = parents["pqr".find(label).unwrap()];
            while !above.is_empty() {
                depth += 1;
                above = parents["pqr".find(above).unwrap()];
            }
            depth
        });
        let joints: Vec<String> = joints.iter().map(|(label, parent)| joint(label, parent)).collect();
        let text = format!("(format: 2, name: \"x\", joints: [{}])", joints.concat());
        read_template(text.as_bytes()).unwrap().rig
    };
    let base = chain(["", "", ""]);
    let now = chain(["q", "r", ""]);
    let file = chain(["", "p", "q"]);
    let uids = ["p", "q", "r"].map(|label| base.find_label(label).unwrap());
    for mask in 0..8_usize {
        let mut choices = Choices::from(Take::Mine);
        let chosen = uids.iter().enumerate().filter(|(number, _)| mask >> number & 1 == 1);
        choices.others.extend(chosen.map(|(_, uid)| (*uid, Some("parent".to_owned()))));
        let updated = update_with(Some(&base), &now, &file, &choices).rig;
        assert_eq!(updated.walk().count(), 3, "every joint hangs somewhere: {mask}");
    }
}
