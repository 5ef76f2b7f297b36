//! Rigs with documents of their own that follow their templates, in an app.

mod long_life;
mod parts;

use std::{collections::HashSet, fs, path::PathBuf, sync::Arc};

use bevy::{ecs::system::RunSystemOnce, prelude::*};
use rigsmith::{
    headless::headless_app,
    instance::{
        AcceptUpdate, BuiltTemplate, RigBuilt, RigFailed, RigInstancePlugin, RigSource, RigTemplate, RigTemplates,
        RigUpdated, TemplateFiles, UpdateOffer,
    },
    mesh::model::Model,
    plugins::{
        commands::{BuildFailure, BuildResult},
        document::{Change, JointEntities},
        runtime::RigRuntime,
        surface::{RigMesh, SkinOf},
    },
    prelude::*,
    rig::{
        AttributeValues, PoseOffset, RigJoint,
        animation::{Key, Property, RigClip, TrackTarget},
        operations::{ClipOperation, KeyOperation},
        template::write_template,
        update::Take,
    },
    test_app::strict_app,
};

use super::{
    bench::{RigBench, save_whole, wait_with},
    template_text::{CHAIN, Dice},
};

#[derive(Resource, Default, Debug, PartialEq)]
struct InstanceReport {
    built: usize,
    updated: usize,
    failed: Vec<String>,
}

struct Studio {
    base: RigBench,
    file: PathBuf,
    _folder: tempfile::TempDir,
}

impl Studio {
    fn new(is_live: bool) -> Self {
        Self::of(is_live, CHAIN)
    }

    fn of(is_live: bool, text: &str) -> Self {
        Self::with_part(is_live, text, ("link.rig.ron", written_part(0).as_str()))
    }

    /// A rig of a template beside the file of a part.
    fn with_part(is_live: bool, text: &str, (name, part): (&str, &str)) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("t.rig.ron");
        fs::write(folder.path().join(name), part).unwrap();
        fs::write(&file, text).unwrap();
        let mut app = headless_app(1);
        app.add_plugins(RigInstancePlugin::live()).init_resource::<InstanceReport>();
        app.add_observer(|_: On<RigBuilt>, mut told: ResMut<InstanceReport>| told.built += 1)
            .add_observer(|_: On<RigUpdated>, mut told: ResMut<InstanceReport>| told.updated += 1)
            .add_observer(|failed: On<RigFailed>, mut told: ResMut<InstanceReport>| {
                told.failed.push(failed.error.to_string())
            });
        let mut app = strict_app(app);
        let path = file.clone();
        let template = app.world_mut().run_system_once(move |files: TemplateFiles| files.open(path.clone())).unwrap();
        let source = if is_live { RigSource::live(template) } else { RigSource::new(template) };
        let mut studio = Self { base: RigBench::with(app, source), file, _folder: folder };
        studio.until("the rig", |world, rig| world.get::<BuildResult>(rig).is_some());
        studio.base.app.update();
        assert_eq!(studio.instance_report().built, 1);
        studio
    }

    /// The template, and what was built of it last.
    fn built(&self) -> (Handle<RigTemplate>, Arc<BuiltTemplate>) {
        let template = self.base.get::<RigSource>(self.base.rig).unwrap().template.clone();
        let built = self.base.app.world().resource::<RigTemplates>().built(&template).unwrap().clone();
        (template, built)
    }

    fn instance_report(&self) -> &InstanceReport {
        self.base.app.world().resource::<InstanceReport>()
    }

    fn until(&mut self, what: &str, is_so: impl Fn(&World, Entity) -> bool) {
        let done = |studio: &Self| is_so(studio.base.app.world(), studio.base.rig);
        let report = |studio: &Self| format!("{:?}", studio.instance_report());
        wait_with(self, what, |studio| studio.base.app.update(), done, report);
    }

    fn save(&self, text: &str) {
        save_whole(&self.file, text);
    }

    fn joint(&self, label: &str) -> Uid {
        self.base.rig().find_label(label).unwrap()
    }

    fn height(&self, label: &str) -> f32 {
        self.base.rig().joint(self.joint(label)).unwrap().data.rest.translation.y
    }
}

#[test]
fn a_live_rig_takes_over_what_the_file_changed_and_keeps_what_is_its_own() {
    let mut studio = Studio::new(true);
    let (tip, middle) = (studio.joint("tail_3"), studio.joint("tail_2"));
    studio.base.apply(RigEdit::SetLocked(middle, true));
    let posed = PoseOffset { translation: Vec3::X * 0.1, ..PoseOffset::IDENTITY };
    let built = studio.base.get::<BuildResult>(studio.base.rig).unwrap().0.clone();
    let on_root = |node: &&rigsmith::rig::BuiltNode| node.control.is_some() && node.name.contains("tail_1");
    let control = built.nodes.iter().find(on_root).unwrap().uid;
    studio.base.change(Change::Do(Operation::Pose(vec![(control, posed)])));
    let entity = studio.base.get::<JointEntities>(studio.base.rig).unwrap().get(tip).unwrap();
    studio.save(&CHAIN.replace("(0, 1, 0)", "(0, 1.5, 0)"));
    studio.until("the update", |world, _| world.resource::<InstanceReport>().updated == 1);
    assert_eq!(studio.height("tail_1"), 1.5);
    assert!(studio.base.rig().joint(middle).unwrap().data.locked && studio.base.rig().offset(control) == Some(&posed));
    assert_eq!(studio.base.get::<JointEntities>(studio.base.rig).unwrap().get(tip), Some(entity));
    studio.base.app.update();
    let place = studio.base.get::<GlobalTransform>(entity).unwrap().translation();
    assert!((place - Vec3::new(0.1, 2.1, 0.0)).length() < 1e-5, "{place}");

    // Undone, the base is the one before, and nothing is taken over until the file changes again.
    let after = studio.base.get::<RigSource>(studio.base.rig).unwrap().base().unwrap().clone();
    studio.base.change(Change::Undo);
    assert_eq!(studio.height("tail_1"), 1.0);
    let before = studio.base.get::<RigSource>(studio.base.rig).unwrap().base().unwrap().clone();
    assert!(before != after);
    for _ in 0..80 {
        studio.base.app.update();
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    assert_eq!((studio.height("tail_1"), studio.instance_report().updated), (1.0, 1));
    studio.base.change(Change::Redo);
    assert_eq!(studio.base.get::<RigSource>(studio.base.rig).unwrap().base(), Some(&after));
    studio.base.change(Change::Undo);
    studio.save(&CHAIN.replace("(0, 1, 0)", "(0, 1.25, 0)"));
    studio.until("the next", |world, _| world.resource::<InstanceReport>().updated == 2);
    assert_eq!(studio.height("tail_1"), 1.25);
    // Undo to the start.
    for _ in 0..4 {
        studio.base.change(Change::Undo);
    }
    let first = rigsmith::rig::template::read_template(CHAIN.as_bytes()).unwrap().rig;
    assert_eq!(studio.base.rig(), &first);
}

#[test]
fn a_conflict_is_offered_and_decided_by_a_choice() {
    for (take, height) in [(Take::Mine, 2.0), (Take::Theirs, 1.5)] {
        let mut studio = Studio::new(true);
        let root = studio.joint("tail_1");
        let mut rest = studio.base.rig().joint(root).unwrap().data.rest;
        rest.translation.y = 2.0;
        studio.base.apply(RigEdit::SetRest(root, rest));
        studio.save(&CHAIN.replace("(0, 1, 0)", "(0, 1.5, 0)").replace("relative_size: 0.5", "relative_size: 0.75"));
        studio.until("the offer", |world, rig| world.get::<UpdateOffer>(rig).is_some());
        let offer = studio.base.get::<UpdateOffer>(studio.base.rig).unwrap().changes.clone();
        let of: Vec<(Option<&str>, bool)> =
            offer.iter().map(|change| (change.field.as_deref(), change.conflict)).collect();
        assert_eq!(of, [(Some("translation"), true), (Some("params.relative_size"), false)]);
        assert_eq!(
            [offer[0].from.as_deref(), offer[0].to.as_deref()],
            [Some("(0.0, 2.0, 0.0)"), Some("(0.0, 1.5, 0.0)")]
        );
        assert_eq!(studio.height("tail_1"), 2.0, "nothing happens by itself");
        studio.base.app.world_mut().write_message(AcceptUpdate { rig: studio.base.rig, choices: take.into() });
        studio.until("the update", |world, _| world.resource::<InstanceReport>().updated == 1);
        assert_eq!(studio.height("tail_1"), height);
        let tip = studio.base.rig().joint(studio.joint("tail_3")).unwrap().clone();
        assert!(format!("{:?}", tip.data.tags).contains("0.75"));
        assert!(studio.base.get::<UpdateOffer>(studio.base.rig).is_none());
    }
}

#[test]
fn an_update_that_is_not_live_waits_and_one_that_cannot_be_built_is_taken_back() {
    let mut studio = Studio::new(false);
    studio.save(&CHAIN.replace("(0, 1, 0)", "(0, 1.5, 0)"));
    studio.until("the offer", |world, rig| world.get::<UpdateOffer>(rig).is_some());
    assert_eq!((studio.height("tail_1"), studio.instance_report().updated), (1.0, 0));

    // The file alone builds; with what was changed here it does not.
    let mut studio = Studio::new(true);
    let first = studio.joint("tail_1");
    let tag = studio.base.rig().joint(first).unwrap().data.tags[0].uid;
    studio.base.apply(RigEdit::RemoveTag(first, tag));
    assert!(studio.base.get::<BuildFailure>(studio.base.rig).is_none());
    let before = studio.base.rig().clone();
    studio.save(&CHAIN.replace(
        "parent: \"tail_1\", translation: (0, 0.3, 0), tags: [control]",
        "parent: \"tail_1\", translation: (0, 0.3, 0), tags: [control, orient(targets: \"@command control/tail_1\")]",
    ));
    studio.until("the failure", |world, _| !world.resource::<InstanceReport>().failed.is_empty());
    studio.base.app.update();
    studio.base.app.update();
    assert_eq!((studio.base.rig(), studio.instance_report().updated), (&before, 0));
    assert!(studio.base.get::<BuildFailure>(studio.base.rig).is_none(), "it is built as before");
    studio.save(&CHAIN.replace("(0, 1, 0)", "(0, 1.5, 0)"));
    studio.until("the next good save", |world, _| world.resource::<InstanceReport>().updated == 1);
    assert_eq!(studio.height("tail_1"), 1.5);
}

#[test]
fn a_mesh_of_a_rig_from_a_template_is_bound() {
    let mut studio = Studio::new(true);
    let points = (0..40).map(|number| {
        let (ring, turn) = ((number / 4) as f32, (number % 4) as f32 * std::f32::consts::FRAC_PI_2);
        Vec3::new(0.1 * turn.cos(), 0.9 + 0.08 * ring, 0.1 * turn.sin())
    });
    let mut text = String::new();
    for point in points {
        text.push_str(&format!("v {} {} {}\n", point.x, point.y, point.z));
    }
    for ring in 0..9 {
        for side in 0..4 {
            let (a, b) = (ring * 4 + side + 1, ring * 4 + (side + 1) % 4 + 1);
            text.push_str(&format!("f {a} {b} {} {}\n", b + 4, a + 4));
        }
    }
    let path = studio.file.with_extension("obj");
    fs::write(&path, text).unwrap();
    let model: Model = rigsmith::files::load_model(&rigsmith::files::RealDisk, &path).unwrap();
    let uid = Uid(4242);
    studio.base.app.world_mut().spawn((RigMesh::new(uid, model, Vec::new()), SkinOf(studio.base.rig)));
    studio.until("the weights", |world, rig| world.get::<Rig>(rig).is_some_and(|rig| rig.skin(uid).is_some()));
    let weights = studio.base.rig().skin(uid).unwrap().clone();
    studio.save(&CHAIN.replace("relative_size: 0.5", "relative_size: 0.75"));
    studio.until("the update", |world, _| world.resource::<InstanceReport>().updated == 1);
    assert_eq!(studio.base.rig().skin(uid), Some(&weights), "weights stay");
}

#[test]
fn another_name_in_the_file_is_the_same_joint_for_ever() {
    let mut studio = Studio::new(true);
    let tip = studio.joint("tail_3");
    let entity = studio.base.get::<JointEntities>(studio.base.rig).unwrap().get(tip).unwrap();
    let renamed = CHAIN.replace("tail_3", "tip");
    studio.save(&renamed);
    studio.until("the other name", |world, _| world.resource::<InstanceReport>().updated == 1);
    assert_eq!(studio.joint("tip"), tip);
    // Later versions of the file have the new name; what they change of the joint arrives.
    studio.save(&renamed.replace("relative_size: 0.5", "relative_size: 0.75").replace("(0, 1, 0)", "(0, 1.5, 0)"));
    studio.until("the next save", |world, _| world.resource::<InstanceReport>().updated == 2);
    assert_eq!((studio.joint("tip"), studio.height("tail_1")), (tip, 1.5));
    assert!(format!("{:?}", studio.base.rig().joint(tip).unwrap().data.tags).contains("0.75"));
    assert_eq!(studio.base.get::<JointEntities>(studio.base.rig).unwrap().get(tip), Some(entity));
    studio.save(&renamed.replace("tip", "end"));
    studio.until("a third name", |world, _| world.resource::<InstanceReport>().updated == 3);
    assert_eq!(studio.joint("end"), tip);
}

#[test]
fn a_live_update_that_moves_what_a_pose_means_holds_the_joints() {
    let mut studio = Studio::new(true);
    let built = studio.base.get::<BuildResult>(studio.base.rig).unwrap().0.clone();
    let control =
        |name: &str| built.nodes.iter().find(|node| node.control.is_some() && node.name.contains(name)).unwrap().uid;
    let turn = |angle: f32| PoseOffset::from_rotation(Quat::from_rotation_z(angle));
    studio
        .base
        .change(Change::Do(Operation::Pose(vec![(control("tail_1"), turn(0.4)), (control("tail_2"), turn(0.3))])));
    let place = |studio: &mut Studio| {
        studio.base.app.update();
        let tip = studio.joint("tail_3");
        let entity = studio.base.get::<JointEntities>(studio.base.rig).unwrap().get(tip).unwrap();
        studio.base.get::<GlobalTransform>(entity).unwrap().translation()
    };
    let before = place(&mut studio);
    // The second joint's axes are turned by a quarter; what hangs on it stays where it is.
    let turned = CHAIN
        .replace(
            "parent: \"tail_1\", translation: (0, 0.3, 0),",
            "parent: \"tail_1\", translation: (0, 0.3, 0), rotation: (0, 0, 90),",
        )
        .replace("parent: \"tail_2\",", "parent: \"tail_2\", ");
    let third = turned.find("label: \"tail_3\"").unwrap();
    let (head, tail) = turned.split_at(third);
    let turned = format!("{head}{}", tail.replacen("(0, 0.3, 0)", "(0.3, 0, 0)", 1));
    assert_ne!(turned, CHAIN);
    studio.save(&turned);
    studio.until("the update", |world, _| world.resource::<InstanceReport>().updated == 1);
    let after = place(&mut studio);
    assert!((after - before).length() < 1e-5, "{before} {after}");
    studio.base.change(Change::Undo);
    assert!((place(&mut studio) - before).length() < 1e-5);
}

/// The part that the template uses, in one of many versions: places, values and the number of its joints.
fn written_part(version: u64) -> String {
    let mut text = String::from("(\n    format: 2,\n    name: \"link\",\n    joints: [\n");
    for joint in 0..2 + version % 3 {
        let parent = joint.checked_sub(1).map_or(String::new(), |above| format!("parent: \"{above}\", "));
        let (place, size) = (0.1 + 0.01 * (version % 7) as f32, 0.5 + 0.1 * (version % 5) as f32);
        text.push_str(&format!(
            "        (label: \"{joint}\", {parent}translation: (0, {place:?}, 0), tags: [control(relative_size: {size:?})]),\n"
        ));
    }
    text.push_str("    ],\n)\n");
    text
}

/// State that must stay through an update: poses and values of nodes, and places of the joints.
#[derive(Debug, PartialEq)]
struct PosedState {
    pose: std::collections::BTreeMap<Uid, PoseOffset>,
    values: AttributeValues,
    /// Where each joint stands, and where it stands at rest.
    joints: Vec<(Uid, Vec3, Vec3)>,
}

impl Studio {
    fn posed_state(&self) -> PosedState {
        let runtime = self.base.get::<RigRuntime>(self.base.rig).unwrap();
        let rig = self.base.rig();
        let joint = |joint: &RigJoint| {
            let uid = joint.data.uid;
            Some((uid, runtime.state().global(uid)?.translation, rig.position(uid)))
        };
        let joints = rig.walk().filter_map(joint).collect();
        PosedState { pose: rig.pose().clone(), values: rig.attribute_values().clone(), joints }
    }

    fn is_built(&self, node: Uid) -> bool {
        self.base.get::<BuildResult>(self.base.rig).unwrap().0.node(node).is_some()
    }
}
