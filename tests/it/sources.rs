//! Rigs with documents of their own that follow their templates, in an app.

use std::{
    collections::HashSet,
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

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
    rig::{AttributeValues, PoseOffset, RigJoint, template::write_template, update::Take},
    test_app::strict_app,
};

use super::{
    bench::{RigBench, wait_with},
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
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("t.rig.ron");
        fs::write(folder.path().join("link.rig.ron"), written_part(0)).unwrap();
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

/// A joint of a file that changes at random.
#[derive(Clone)]
struct FileJoint {
    name: String,
    above: Option<usize>,
    /// Place in the rig's space, and turn about Z in degrees.
    place: Vec3,
    turn: f32,
    size: f32,
}

/// The text of a template of these joints, with a control on each and an attribute on the first.
fn template_of_joints(joints: &[Option<FileJoint>]) -> String {
    let mut text = String::from("(\n    format: 2,\n    name: \"living\",\n    joints: [\n");
    for joint in joints.iter().flatten() {
        let above = joint.above.and_then(|above| joints[above].as_ref());
        let (parent, origin, turn) = above.map_or((String::new(), Vec3::ZERO, 0.0), |above| {
            (format!("parent: \"{}\", ", above.name), above.place, above.turn)
        });
        let at = Quat::from_rotation_z(-turn.to_radians()) * (joint.place - origin);
        let attribute = match joint.above {
            None => format!(", attribute(node: \"@command control/{}\", name: \"amount\", default: 0.5)", joint.name),
            Some(_) => String::new(),
        };
        text.push_str(&format!(
            "        (label: \"{}\", {parent}translation: ({:?}, {:?}, {:?}), rotation: (0, 0, {:?}), tags: [control(relative_size: {:?}){attribute}]),\n",
            joint.name, at.x, at.y, at.z, joint.turn - turn, joint.size
        ));
    }
    text.push_str("    ],\n    parts: [(part: \"link.rig.ron\", name: \"link\", prefix: \"link_\")],\n)\n");
    text
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

/// Changes a file in one way. Returns true if that changes what poses mean, and false if it leaves that alone.
fn rewrite(joints: &mut Vec<Option<FileJoint>>, dice: &mut Dice, number: usize) -> bool {
    let living: Vec<usize> = (1..joints.len()).filter(|at| joints[*at].is_some()).collect();
    let one = living[dice.below(living.len() as u64) as usize];
    let is_below = |joints: &[Option<FileJoint>], mut at: usize, above: usize| loop {
        match joints[at].as_ref().and_then(|joint| joint.above) {
            Some(next) if next == above => return true,
            Some(next) => at = next,
            None => return false,
        }
    };
    let is_leaf = joints.iter().flatten().all(|joint| joint.above != Some(one));
    let above = living[dice.below(living.len() as u64) as usize];
    let is_free = above != one && !is_below(joints, above, one);
    let kind = dice.below(6);
    if kind == 0 && is_leaf && living.len() > 4 {
        joints[one] = None;
        return false;
    }
    if kind == 1 || living.len() < 4 {
        let place = joints[one].as_ref().unwrap().place + Vec3::new(0.05 + 0.001 * number as f32, 0.2, 0.0);
        joints.push(Some(FileJoint { name: format!("new_{number}"), above: Some(one), place, turn: 0.0, size: 1.0 }));
        return false;
    }
    let joint = joints[one].as_mut().unwrap();
    match kind {
        2 => joint.name = format!("named_{number}"),
        3 => joint.turn = 45.0 * (dice.below(8) as f32 - 4.0),
        4 if is_free => joint.above = Some(above),
        _ => joint.size = 0.5 + 0.1 * dice.below(10) as f32,
    }
    kind == 3 || kind == 4
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

/// Joints that an update could not hold.
#[derive(Resource, Default)]
struct ListedJoints(HashSet<Uid>);

/// Saves a text by a rename, so that nobody reads half of it: how other ways to save are taken is tested elsewhere.
fn save_whole(path: &Path, text: &str) {
    let beside = path.with_extension("saved");
    fs::write(&beside, text).unwrap();
    fs::rename(&beside, path).unwrap();
}

#[test]
fn a_long_life_of_edits_and_saves_loses_nothing() {
    let steps = std::env::var("RIGSMITH_STEPS").ok().and_then(|steps| steps.parse().ok()).unwrap_or(400);
    let dice = &mut Dice(UidSource::seeded(12));
    let mut joints: Vec<Option<FileJoint>> = Vec::new();
    for number in 0..6usize {
        let place = Vec3::new(0.0, 0.3 * number as f32, 0.02 * number as f32);
        let above = number.checked_sub(1);
        joints.push(Some(FileJoint { name: format!("joint_{number}"), above, place, turn: 0.0, size: 1.0 }));
    }
    let mut studio = Studio::of(true, &template_of_joints(&joints));
    studio.base.app.init_resource::<ListedJoints>();
    studio.base.app.add_observer(|updated: On<RigUpdated>, mut listed: ResMut<ListedJoints>| {
        listed.0 = updated.poses.iter().map(|note| note.deviation.joint).collect();
    });
    let first = write_template(studio.base.rig());
    let (mut done, mut is_mixed, mut reloads, mut offers, mut held) = (0usize, false, 0, 0, 0);
    let (mut version, mut parts) = (0, 0);
    for step in 0..steps {
        let controls: Vec<Uid> = {
            let built = &studio.base.get::<BuildResult>(studio.base.rig).unwrap().0;
            built.nodes.iter().filter(|node| node.control.is_some()).map(|node| node.uid).collect()
        };
        let control = controls[dice.below(controls.len() as u64) as usize];
        let labels: Vec<Uid> = studio.base.rig().walk().map(|joint| joint.data.uid).collect();
        let joint = labels[dice.below(labels.len() as u64) as usize];
        let share = dice.below(1000) as f32 / 1000.0;
        let before = studio.posed_state();
        let edit = match dice.below(10) {
            0..=2 => {
                let turned = PoseOffset::from_rotation(Quat::from_rotation_z(share - 0.5));
                Some(Operation::Pose(vec![(control, turned)]))
            }
            3 => Some(Operation::Edits(vec![RigEdit::SetAttributeValue(control, "amount".into(), Some(share))])),
            4 => Some(Operation::Edits(vec![RigEdit::SetLabel(joint, Some(format!("mine_{step}")))])),
            5 => Some(Operation::Edits(vec![RigEdit::SetLocked(joint, share > 0.5)])),
            6 => {
                let change = if share < 0.7 && done > 0 { Change::Undo } else { Change::Redo };
                studio.base.change(change);
                is_mixed = true;
                None
            }
            _ => {
                let known = studio.built();
                let was = template_of_joints(&joints);
                let is_part = dice.below(4) == 0;
                let mut means_other = false;
                studio.base.app.world_mut().resource_mut::<ListedJoints>().0.clear();
                if is_part {
                    let next =
                        (1..).map(|more| version + more).find(|next| written_part(*next) != written_part(version));
                    version = next.unwrap_or_default();
                    save_whole(&studio.file.with_file_name("link.rig.ron"), &written_part(version));
                    parts += 1;
                } else {
                    means_other = rewrite(&mut joints, dice, step);
                    while template_of_joints(&joints) == was {
                        means_other |= rewrite(&mut joints, dice, step);
                    }
                    studio.save(&template_of_joints(&joints));
                }
                studio.until("the template", |world, _| {
                    world.resource::<RigTemplates>().built(&known.0).is_some_and(|now| !Arc::ptr_eq(now, &known.1))
                        || world.resource::<InstanceReport>().failed.len() > 3
                });
                for _ in 0..4 {
                    studio.base.app.update();
                }
                if studio.base.get::<UpdateOffer>(studio.base.rig).is_some() {
                    offers += 1;
                    let take = if share < 0.5 { Take::Mine } else { Take::Theirs };
                    studio
                        .base
                        .app
                        .world_mut()
                        .write_message(AcceptUpdate { rig: studio.base.rig, choices: take.into() });
                    for _ in 0..4 {
                        studio.base.app.update();
                    }
                    is_mixed = true;
                }
                assert_eq!(studio.instance_report().failed, Vec::<String>::new());
                reloads += 1;
                let after = studio.posed_state();
                for (node, values) in before.values.iter().filter(|(node, _)| studio.is_built(**node)) {
                    assert_eq!(after.values.get(node), Some(values), "step {step}");
                }
                let listed = &studio.base.app.world().resource::<ListedJoints>().0;
                if !means_other && !is_mixed {
                    for (node, offset) in before.pose.iter().filter(|(node, _)| studio.is_built(**node)) {
                        assert_eq!(after.pose.get(node), Some(offset), "step {step}");
                    }
                } else if !is_mixed {
                    for (joint, place, rest) in before.joints.iter().filter(|(joint, ..)| !listed.contains(joint)) {
                        let Some((_, now, rest_now)) = after.joints.iter().find(|(known, ..)| known == joint) else {
                            continue;
                        };
                        // What hangs on a turned joint, and the file knows nothing of, moves at rest.
                        let is_held = rest_now.distance(*rest) < 1e-5;
                        let distance = now.distance(*place);
                        assert!(!is_held || distance < 1e-4, "step {step}: {joint} {place} {now}");
                        held += usize::from(is_held);
                    }
                }
                is_mixed = false;
                None
            }
        };
        done += 1;
        if let Some(operation) = edit {
            studio.base.change(Change::Do(operation));
        }
    }
    assert!(reloads > steps / 10 && parts > steps / 40, "{reloads} reloads, {parts} of them of the part");
    println!("{steps} steps, {reloads} reloads, {parts} of the part, {offers} offered, {held} joints held");
    assert!(held > steps / 10, "{held}");
    for _ in 0..steps * 2 {
        studio.base.change(Change::Undo);
    }
    assert_eq!(write_template(studio.base.rig()), first);
}
