//! Visibility, layers and attributes of nodes after features, tags and groups went off and came back: the same as in a
//! document that is opened in that state.

use std::collections::BTreeMap;

use bevy::{
    ecs::{entity_disabling::Disabled, query::Allow},
    prelude::*,
};
use rigsmith::{
    plugins::{commands::Attributes, controls::NodeVisible, schema::NodeLayer},
    prelude::*,
    rig::{
        GroupData, LayerData, TagData, TagKind,
        feature::{combined_features, set_feature},
    },
};

use super::{RigBench, limits::limited_rig, shipped};

/// Visibility, layer and names of attributes of each node that has any of them.
type Shown = BTreeMap<Uid, NodeShown>;
type NodeShown = (Option<bool>, Option<LayerData>, Vec<String>);

fn shown(stage: &mut RigBench) -> Shown {
    let world = stage.app.world_mut();
    let mut nodes = world
        .query_filtered::<(&Uid, Option<&NodeVisible>, Option<&NodeLayer>, Option<&Attributes>), Allow<Disabled>>();
    nodes
        .iter(world)
        .map(|(uid, visible, layer, attributes)| {
            let names = attributes.map_or_else(Vec::new, |attributes| attributes.0.keys().cloned().collect());
            (*uid, (visible.map(|visible| visible.0), layer.map(|layer| layer.0.clone()), names))
        })
        .filter(|(_, (visible, layer, names))| visible.is_some() || layer.is_some() || !names.is_empty())
        .collect()
}

/// State of visibility of the nodes; fails unless it is the same in an app that opens the document as it is now.
#[track_caller]
fn as_opened(stage: &mut RigBench, what: &str) -> Shown {
    let mut opened = RigBench::of_built(stage.rig().clone());
    opened.app.update();
    let now = shown(stage);
    assert_eq!(now, shown(&mut opened), "{what}");
    now
}

/// Forward controls, which their switch hides, are seen when the feature of inverse kinematics goes off.
#[test]
fn a_feature_that_goes_off_leaves_what_opening_without_it_shows() {
    for name in ["arm", "biped"] {
        let (_, rig) = shipped().into_iter().find(|(template, _)| template == name).unwrap();
        let mut stage = RigBench::of_built(rig);
        let first = as_opened(&mut stage, name);
        let mut revealed = 0;
        for feature in combined_features(stage.rig()) {
            if name == "biped" && feature.key.kind != "ik" {
                continue;
            }
            let edits = set_feature(stage.rig(), &feature.key, false).unwrap();
            if edits.is_empty() {
                continue;
            }
            stage.apply_all(edits);
            let now = as_opened(&mut stage, &format!("{name} without {:?}", feature.key));
            let is_revealed = |(uid, node): (&Uid, &NodeShown)| {
                node.0 == Some(true) && first.get(uid).is_some_and(|before| before.0 == Some(false))
            };
            revealed += now.iter().filter(|node| is_revealed(*node)).count();
            stage.change(Change::Undo);
            assert_eq!(shown(&mut stage), first, "{name}: {:?} is on again", feature.key);
        }
        assert!(revealed > 0, "{name}: features hide no control");
    }
}

fn command(uid: u64, module: &str, params: &str) -> Box<TagData> {
    let kind = TagKind::Command { module: module.into(), params: params.into(), feature: None };
    Box::new(TagData { uid: Uid(uid), enabled: true, comment: String::new(), kind })
}

/// A layer that hides controls, and one that hides a joint, are deleted, disabled, undone.
#[test]
fn what_a_layer_hid_is_seen_when_the_layer_is_gone() {
    for nodes in ["@any type:control", "@joint j3#0000000000000003"] {
        let mut rig = limited_rig();
        let params = format!("(nodes: \"{nodes}\", name: \"hidden\", visible: false)");
        let layer = command(78, "layer", &params);
        rig.apply(&RigEdit::AddTag { joint: Uid(2), tag: layer.clone(), index: 1 }).unwrap();
        let mut stage = RigBench::of_built(rig);
        let hidden = as_opened(&mut stage, nodes);
        assert!(hidden.values().any(|node| node.0 == Some(false)), "{nodes}: {hidden:?}");
        let gone = [
            RigEdit::RemoveTag(Uid(2), Uid(78)),
            RigEdit::SetTag(Uid(2), Box::new(TagData { enabled: false, ..TagData::clone(&layer) })),
            RigEdit::SetTag(Uid(2), command(78, "layer", &params.replace("false", "true"))),
        ];
        for edit in gone {
            stage.apply_all(vec![edit.clone()]);
            let now = as_opened(&mut stage, &format!("{nodes}: {edit:?}"));
            assert!(now.values().all(|node| node.0 != Some(false)), "{nodes}: {edit:?}: {now:?}");
            stage.change(Change::Undo);
            assert_eq!(shown(&mut stage), hidden, "{nodes}: {edit:?} undone");
        }
    }
}

/// A joint of a group that is off has neither the layer nor the attribute, and gets none back that was deleted meanwhile.
#[test]
fn a_joint_of_a_group_that_is_off_keeps_nothing_of_its_build() {
    let mut rig = limited_rig();
    let group = GroupData { uid: Uid(50), name: "end".into(), color: [1.0, 0.0, 0.0], enabled: true };
    let tags = [
        command(78, "layer", "(nodes: \"@joint j3#0000000000000003\", name: \"hidden\", visible: false)"),
        command(79, "attribute", "(node: \"@joint j3#0000000000000003\", name: \"bend\", default: 0.25)"),
    ];
    let mut edits = vec![RigEdit::AddLocalGroup(group.clone(), 0), RigEdit::SetGroup(Uid(3), Some(group.uid))];
    edits.extend(tags.into_iter().map(|tag| RigEdit::AddTag { joint: Uid(1), tag, index: 0 }));
    for edit in edits {
        rig.apply(&edit).unwrap();
    }
    let mut stage = RigBench::of_built(rig);
    let first = as_opened(&mut stage, "all on");
    assert_eq!(first[&Uid(3)].2, ["bend"]);
    assert!(first[&Uid(3)].1.is_some());
    let switch = |stage: &mut RigBench, enabled: bool| {
        stage.apply(RigEdit::SetLocalGroup(GroupData { enabled, ..group.clone() }));
    };
    switch(&mut stage, false);
    assert!(!as_opened(&mut stage, "off").contains_key(&Uid(3)));
    switch(&mut stage, true);
    assert_eq!(as_opened(&mut stage, "on again"), first);
    switch(&mut stage, false);
    stage.apply_all(vec![RigEdit::RemoveTag(Uid(1), Uid(78)), RigEdit::RemoveTag(Uid(1), Uid(79))]);
    switch(&mut stage, true);
    assert!(!as_opened(&mut stage, "on without the tags").contains_key(&Uid(3)));
    for _ in 0..5 {
        stage.change(Change::Undo);
    }
    assert_eq!(shown(&mut stage), first, "undone");
}
