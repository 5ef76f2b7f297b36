//! Stages of a rig: skeleton, edited, built, deleted, in every direction.

use std::{collections::BTreeMap, sync::Arc};

use bevy::prelude::*;
use rigsmith::{
    mesh::model::Weights,
    plugins::{
        commands::{BuildResult, Processor},
        document::{Change, JointEntities, ShowRest},
        history::RigHistory,
        stage::{DELETE, RESTORE, RigStage, StageRequest},
    },
    prelude::*,
    rig::{PoseOffset, SkinData, StoredPose, template::read_template, template::write_template},
    test_app::test_app,
};

use super::template_text::CHAIN;

struct Stages {
    app: App,
    rig: Entity,
}

impl Stages {
    /// A rig with poses of a joint and of a control, a stored pose, an attribute value and weights; not built yet.
    fn new() -> Self {
        let rig = read_template(CHAIN.as_bytes()).unwrap().rig;
        let [root, tip] = ["tail_1", "tail_3"].map(|label| rig.find_label(label).unwrap());
        let mut app = test_app();
        let entity = app.world_mut().spawn(rig).id();
        let mut stages = Self { app, rig: entity };
        stages.request(RigStage::Built);
        let built = stages.built();
        // Nodes stand in the order of the hierarchy: the first control is not that of the first joint.
        let is_of_root = |node: &rigsmith::rig::BuiltNode| {
            node.control.is_some() && node.origin.as_ref().is_some_and(|origin| origin.subject == root)
        };
        let control = built.nodes.iter().find(|node| is_of_root(node)).unwrap().uid;
        let turned = PoseOffset { rotation: Quat::from_rotation_z(0.7), ..PoseOffset::IDENTITY };
        let moved = PoseOffset { translation: Vec3::X * 0.1, ..PoseOffset::IDENTITY };
        let weights = Weights { starts: vec![0, 1], joints: vec![0], values: vec![1.0] };
        let skin = SkinData { joints: vec![tip], weights, at_rest: true, subjects: BTreeMap::new() };
        let offsets = BTreeMap::from([(control, turned), (tip, moved)]);
        let stored = StoredPose { uid: Uid(7), name: "bent".into(), offsets, ..StoredPose::default() };
        let before = stages.places();
        stages.operate(Operation::Pose(vec![(control, turned), (tip, moved)]));
        assert!(!is_near(&stages.places(), &before), "the control moves joints");
        stages.operate(Operation::Edits(vec![
            RigEdit::SetAttributeValue(control, "share".into(), Some(0.25)),
            RigEdit::AddStoredPose(Box::new(stored), 0),
            RigEdit::SetSkin(Uid(9), Some(Arc::new(skin))),
        ]));
        stages
    }

    fn operate(&mut self, operation: Operation) {
        self.app.world_mut().write_message(EditRequest::operation(self.rig, operation));
        self.app.update();
        let refused = self.app.world_mut().resource_mut::<Messages<EditRefusal>>().drain().next();
        assert!(refused.is_none(), "{refused:?}");
    }

    fn change(&mut self, change: Change) {
        self.app.world_mut().write_message(EditRequest { rig: self.rig, change });
        self.app.update();
    }

    fn request(&mut self, stage: RigStage) {
        self.app.world_mut().write_message(StageRequest { rig: self.rig, stage });
        self.app.update();
        self.app.update();
        assert_eq!(self.stage(), Some(stage));
    }

    fn stage(&self) -> Option<RigStage> {
        self.app.world().get::<RigStage>(self.rig).copied()
    }

    fn rig(&self) -> &Rig {
        self.app.world().get::<Rig>(self.rig).unwrap()
    }

    fn built(&self) -> Arc<rigsmith::rig::BuiltRig> {
        self.app.world().get::<BuildResult>(self.rig).unwrap().0.clone()
    }

    fn steps(&self) -> (Vec<String>, usize) {
        let (names, done) = self.app.world().get::<RigHistory>(self.rig).unwrap().steps();
        (names.into_iter().map(str::to_owned).collect(), done)
    }

    /// Places of the joints in the world.
    fn places(&self) -> Vec<(Uid, Vec3)> {
        let entities = self.app.world().get::<JointEntities>(self.rig).unwrap();
        let place = |joint: &rigsmith::rig::RigJoint| {
            let entity = entities.get(joint.data.uid).unwrap();
            let at = self.app.world().get::<GlobalTransform>(entity).unwrap().translation();
            (joint.data.uid, at)
        };
        self.rig().walk().map(place).collect()
    }

    /// What a stage shows: the commands in effect, whether edits rebuild, and whether the rest pose is shown.
    fn stage_view(&self) -> (usize, bool, bool) {
        let processor = self.app.world().get::<Processor>(self.rig).unwrap();
        let rest = self.app.world().get::<ShowRest>(self.rig).unwrap().0;
        (processor.builder().cursor(), processor.follows(), rest)
    }
}

/// True if the same joints stand at the same places, but for rounding.
fn is_near(a: &[(Uid, Vec3)], b: &[(Uid, Vec3)]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.0 == b.0 && a.1.distance(b.1) < 1e-5)
}

#[test]
fn every_stage_leads_to_every_other_and_nothing_is_lost() {
    let mut stages = Stages::new();
    let (document, bytes) = (stages.rig().clone(), write_template(stages.rig()));
    let commands = stages.stage_view().0;
    assert!(commands > 0);
    let mut places: BTreeMap<&str, Vec<(Uid, Vec3)>> = BTreeMap::new();
    let mut walked = 0;
    for from in RigStage::ALL {
        for to in RigStage::ALL.into_iter().filter(|to| *to != from) {
            for stage in [from, to] {
                if stages.stage() == Some(stage) {
                    continue;
                }
                stages.request(stage);
                if stage == RigStage::Deleted {
                    assert!(stages.rig().is_empty() && stages.rig().groups().is_empty());
                    assert_eq!(stages.rig().stored_poses(), document.stored_poses());
                    assert_eq!(stages.rig().skin(Uid(9)), document.skin(Uid(9)));
                    continue;
                }
                assert_eq!(stages.rig(), &document, "{from:?} to {to:?}");
                assert_eq!(write_template(stages.rig()), bytes);
                let expected = match stage {
                    RigStage::Built => (commands, true, false),
                    stage => (0, false, stage == RigStage::Edit),
                };
                assert_eq!(stages.stage_view(), expected, "{from:?} to {to:?}");
                let now = stages.places();
                let before = places.entry(stage.name()).or_insert_with(|| now.clone());
                assert!(is_near(before, &now), "{from:?} to {to:?}: {stage:?} was {before:?} and is {now:?}");
            }
            walked += 1;
        }
    }
    assert_eq!(walked, 12);
    // The stages differ in where joints stand: the pose of the control, that of the joints alone, and rest.
    assert!(!is_near(&places["Built"], &places["Skeleton"]) && !is_near(&places["Skeleton"], &places["Edit"]));
}

#[test]
fn edits_at_a_stage_stay_and_run_only_where_commands_are_in_effect() {
    let mut stages = Stages::new();
    let tip = stages.rig().find_label("tail_3").unwrap();
    let nodes = stages.built().nodes.len();
    stages.request(RigStage::Edit);
    assert_eq!(stages.built().nodes.len(), stages.rig().len());
    let mut rest = stages.rig().joint(tip).unwrap().data.rest;
    rest.translation.y = 0.5;
    stages.operate(Operation::Edits(vec![RigEdit::SetRest(tip, rest)]));
    assert_eq!(stages.stage_view(), (0, false, true));
    stages.request(RigStage::Built);
    assert_eq!(stages.built().nodes.len(), nodes);
    assert_eq!(stages.rig().joint(tip).unwrap().data.rest.translation.y, 0.5);
}

#[test]
fn deleting_is_one_step_and_comes_back_by_undo_or_by_another_stage() {
    let mut stages = Stages::new();
    let document = stages.rig().clone();
    let steps = stages.steps().1;
    stages.request(RigStage::Deleted);
    assert_eq!((stages.steps().1, stages.steps().0.last().map(String::as_str)), (steps + 1, Some(DELETE)));
    // Asked for again, nothing happens.
    stages.request(RigStage::Deleted);
    assert_eq!(stages.steps().1, steps + 1);
    stages.change(Change::Undo);
    assert_eq!((stages.stage(), stages.rig() == &document), (Some(RigStage::Built), true));
    stages.change(Change::Redo);
    assert_eq!((stages.stage(), stages.rig().len()), (Some(RigStage::Deleted), 0));

    // Something was done since: it stays, and the rig comes back with it.
    stages.operate(Operation::Place { position: Vec3::Y, parent: None });
    stages.request(RigStage::Skeleton);
    assert_eq!(stages.steps().0.last().map(String::as_str), Some(RESTORE));
    assert_eq!(stages.rig().len(), document.len() + 1);
    for joint in document.walk() {
        assert_eq!(stages.rig().joint(joint.data.uid), Some(joint));
    }
    assert_eq!(stages.rig().pose(), document.pose());
    // Undone step by step.
    stages.change(Change::Undo);
    assert_eq!((stages.stage(), stages.rig().len()), (Some(RigStage::Deleted), 1));
    stages.change(Change::Undo);
    stages.change(Change::Undo);
    assert_eq!(stages.rig(), &document);
    assert_ne!(stages.stage(), Some(RigStage::Deleted));
    stages.request(RigStage::Built);
    assert_eq!(stages.rig(), &document);
}
