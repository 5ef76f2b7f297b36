//! Stages of a rig: skeleton, edited, built, deleted, in every direction.

use std::{collections::BTreeMap, sync::Arc};

use bevy::prelude::*;
use rigsmith::{
    mesh::model::Weights,
    plugins::{
        commands::Processor,
        document::{Change, ShowRest},
        stage::{DELETE, RESTORE, RigStage, StageRequest},
    },
    prelude::*,
    rig::{PoseOffset, SkinData, StoredPose, template::read_template, template::write_template},
};

use super::{bench::RigBench, template_text::CHAIN};

impl RigBench {
    /// A rig with poses of a joint and of a control, a stored pose, an attribute value and weights.
    fn with_everything() -> Self {
        let rig = read_template(CHAIN.as_bytes()).unwrap().rig;
        let [root, tip] = ["tail_1", "tail_3"].map(|label| rig.find_label(label).unwrap());
        let mut stages = Self::of(rig);
        stages.enter_stage(RigStage::Built);
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
        let before = stages.joint_places();
        stages.edit_or_fail(Operation::Pose(vec![(control, turned), (tip, moved)]));
        assert!(!is_near(&stages.joint_places(), &before), "the control moves joints");
        stages.edit_or_fail(Operation::Edits(vec![
            RigEdit::SetAttributeValue(control, "share".into(), Some(0.25)),
            RigEdit::AddStoredPose(Box::new(stored), 0),
            RigEdit::SetSkin(Uid(9), Some(Arc::new(skin))),
        ]));
        stages
    }

    /// Fails if the operation is refused.
    fn edit_or_fail(&mut self, operation: Operation) {
        self.edit(operation);
        let refused = self.messages::<EditRefusal>().into_iter().next();
        assert!(refused.is_none(), "{refused:?}");
    }

    fn enter_stage(&mut self, stage: RigStage) {
        self.send(StageRequest { rig: self.rig, stage });
        self.app.update();
        assert_eq!(self.stage(), Some(stage));
    }

    fn stage(&self) -> Option<RigStage> {
        self.get::<RigStage>(self.rig).copied()
    }

    /// Places of the joints in the world.
    fn joint_places(&self) -> Vec<(Uid, Vec3)> {
        let place = |joint: &rigsmith::rig::RigJoint| {
            let at = self.get::<GlobalTransform>(self.joint(joint.data.uid)).unwrap().translation();
            (joint.data.uid, at)
        };
        self.rig().walk().map(place).collect()
    }

    /// View of a stage: the commands in effect, whether edits rebuild, and whether the rest pose is shown.
    fn stage_view(&self) -> (usize, bool, bool) {
        let processor = self.get::<Processor>(self.rig).unwrap();
        let rest = self.get::<ShowRest>(self.rig).unwrap().0;
        (processor.builder().cursor(), processor.follows(), rest)
    }
}

/// True if the same joints stand at the same places, but for rounding.
fn is_near(a: &[(Uid, Vec3)], b: &[(Uid, Vec3)]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.0 == b.0 && a.1.distance(b.1) < 1e-5)
}

#[test]
fn every_stage_leads_to_every_other_and_nothing_is_lost() {
    let mut stages = RigBench::with_everything();
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
                stages.enter_stage(stage);
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
                let now = stages.joint_places();
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
    let mut stages = RigBench::with_everything();
    let tip = stages.rig().find_label("tail_3").unwrap();
    let nodes = stages.built().nodes.len();
    stages.enter_stage(RigStage::Edit);
    assert_eq!(stages.built().nodes.len(), stages.rig().len());
    let mut rest = stages.rig().joint(tip).unwrap().data.rest;
    rest.translation.y = 0.5;
    stages.edit_or_fail(Operation::Edits(vec![RigEdit::SetRest(tip, rest)]));
    assert_eq!(stages.stage_view(), (0, false, true));
    stages.enter_stage(RigStage::Built);
    assert_eq!(stages.built().nodes.len(), nodes);
    assert_eq!(stages.rig().joint(tip).unwrap().data.rest.translation.y, 0.5);
}

#[test]
fn deleting_is_one_step_and_comes_back_by_undo_or_by_another_stage() {
    let mut stages = RigBench::with_everything();
    let document = stages.rig().clone();
    let steps = stages.steps();
    stages.enter_stage(RigStage::Deleted);
    assert_eq!((stages.steps(), stages.history().0.last().map(String::as_str)), (steps + 1, Some(DELETE)));
    // Asked for again, nothing happens.
    stages.enter_stage(RigStage::Deleted);
    assert_eq!(stages.steps(), steps + 1);
    stages.change(Change::Undo);
    assert_eq!((stages.stage(), stages.rig() == &document), (Some(RigStage::Built), true));
    stages.change(Change::Redo);
    assert_eq!((stages.stage(), stages.rig().len()), (Some(RigStage::Deleted), 0));

    // Something was done since: it stays, and the rig comes back with it.
    stages.edit_or_fail(Operation::Place { position: Vec3::Y, parent: None });
    stages.enter_stage(RigStage::Skeleton);
    assert_eq!(stages.history().0.last().map(String::as_str), Some(RESTORE));
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
    stages.enter_stage(RigStage::Built);
    assert_eq!(stages.rig(), &document);
}
