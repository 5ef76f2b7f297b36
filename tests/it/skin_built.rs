//! Weights of built joints, wherever they are computed, and limbs that bend with them.

mod figure;
mod goals;
mod late_joints;
mod measure;
mod places;

use std::collections::{BTreeMap, BTreeSet};

use crate::prerequisites::BODIES;
use bevy::{
    math::{Affine3A, Vec3},
    prelude::{Entity, Transform},
};
use rigsmith::{
    algo::weights::WeightSettings,
    headless::Workbench,
    modules::half_joint::HalfJoint,
    plugins::{
        commands::{BuildRequest, BuildStep, BuiltEntities},
        document::{Change, EditRequest},
    },
    processor::RigModule,
    rig::{BuiltRig, Constraint, NodeType, RestTransform, Rig, RigEdit, TagKind, Uid, deform::DeformSkeleton},
    solve::program::RigState,
};

use figure::{Figure, carry};
use measure::Joint;

/// The volume that bent knees, elbows, hips and shoulders lose at most, in hundredths of a section, and the triangles that
/// fold. Weights painted by hand for the same bodies lose 21 to 34, 33 to 60, 23 to 59 and 94 to 160, and fold 3 to 53.
///
/// Half joints move outwards by what each body asks for, shoulders no further than an arm raised to the side allows, where the
/// same length swells; where that is not enough, the border of the flesh that moves is moved.
const KNOWN: [(&str, [(i32, usize); 4]); 8] = [
    ("biped", [(10, 0), (12, 0), (6, 0), (12, 0)]),
    ("baby", [(10, 0), (11, 0), (5, 0), (13, 0)]),
    ("female_heavy_tpose", [(11, 0), (-5, 0), (10, 0), (11, 0)]),
    ("female_young", [(11, 0), (8, 0), (10, 0), (9, 0)]),
    ("female_young_armsdown", [(11, 0), (8, 0), (10, 0), (8, 0)]),
    ("male_child_tpose", [(11, 0), (11, 0), (13, 0), (12, 0)]),
    ("male_muscular_action", [(11, 0), (11, 0), (13, 0), (10, 0)]),
    ("male_young", [(10, 0), (11, 0), (13, 0), (11, 0)]),
];

/// Endings of the labels of both sides.
const SIDES: [&str; 2] = ["_l", "_r"];

/// The bundled biped, and the seven bodies where there is data.
fn figures() -> impl Iterator<Item = Figure> {
    std::iter::once(Figure::bundled()).chain(BODIES.into_iter().filter_map(Figure::body))
}

/// The twist joints of the bone that begins at a joint, with how far along it they lie.
fn twists(figure: &Figure, bone: &str) -> Vec<(Uid, f32)> {
    let skeleton = DeformSkeleton::new(&figure.rig, Some(&figure.built));
    let owner = skeleton.index(figure.joint(bone)).unwrap();
    let start = skeleton.joints()[owner].rest.translation;
    let of =
        skeleton.joints().iter().filter_map(|joint| Some((joint, joint.twist.filter(|twist| twist.joint == owner)?)));
    of.map(|(joint, twist)| {
        let along = twist.end - start;
        (joint.uid, (joint.rest.translation - start).dot(along) / along.length_squared())
    })
    .collect()
}

/// Twist joints say where their bone ends: at the next joint of the limb.
#[test]
fn twist_joints_lie_on_their_bone() {
    let figure = Figure::bundled();
    let skeleton = DeformSkeleton::new(&figure.rig, Some(&figure.built));
    let bones =
        [("thigh", "shin", true), ("shin", "foot", false), ("upper_arm", "forearm", true), ("forearm", "hand", false)];
    for side in ["_l", "_r"] {
        for (bone, end, counter) in bones {
            let found = twists(&figure, &format!("{bone}{side}"));
            let places: Vec<f32> = found.iter().map(|(_, place)| *place).collect();
            let wanted: [f32; 4] = if counter { [0.0, 0.25, 0.5, 0.75] } else { [0.2, 0.4, 0.6, 0.8] };
            let off = places.iter().zip(wanted).map(|(is, wanted)| (is - wanted).abs()).fold(0.0, f32::max);
            assert!(places.len() == 4 && off < 1e-3, "{bone}{side}: {places:?}");
            let end = figure.at(&format!("{end}{side}"));
            for (joint, _) in found {
                let twist = skeleton.joints()[skeleton.index(joint).unwrap()].twist.unwrap();
                assert!(twist.end.distance(end) < 1e-4, "{bone}{side} ends at {}, not {end}", twist.end);
            }
        }
    }
}

/// Twist joints take their shares from the joint of their bone and from nobody else, linearly between one and the next.
#[test]
fn twist_joints_share_the_flesh_of_their_bone() {
    for figure in figures().map(|figure| figure.without("volume")) {
        let plain = figure.skinned(None);
        for bone in ["thigh_l", "shin_l", "upper_arm_l", "forearm_l"] {
            let owner = figure.joint(bone);
            let stations = twists(&figure, bone);
            let skeleton = DeformSkeleton::new(&figure.rig, Some(&figure.built));
            let end = skeleton.joints()[skeleton.index(stations[0].0).unwrap()].twist.unwrap().end;
            let (start, along) = (figure.at(bone), end - figure.at(bone));
            let step = stations[1].1 - stations[0].1;
            for (point, place) in figure.model.points.iter().enumerate() {
                let of = |joint: Uid| figure.weight(&figure.skin, point, joint);
                let shared: f32 = stations.iter().map(|(joint, _)| of(*joint)).sum();
                let held = figure.weight(&plain, point, owner);
                assert!((of(owner) + shared - held).abs() < 0.02, "{}: {bone}, point {point}", figure.name);
                let at = ((*place - start).dot(along) / along.length_squared()).clamp(0.0, 1.0);
                for (joint, station) in &stations {
                    let last = *station + step > 0.99 && stations[0].1 > 0.01;
                    let near = if last && at > *station { 1.0 } else { (1.0 - (at - station).abs() / step).max(0.0) };
                    let (is, wanted) = (of(*joint), held * near);
                    assert!((is - wanted).abs() < 0.02, "{}: {bone} at {at}: {is}, not {wanted}", figure.name);
                }
            }
        }
    }
}

/// Shares of joints that are not built go to the joints that they were made for, and come back.
#[test]
fn weights_wait_for_joints_that_are_not_built() {
    let figure = Figure::bundled();
    let plain = DeformSkeleton::new(&figure.rig, None);
    let built = DeformSkeleton::new(&figure.rig, Some(&figure.built));
    let created: BTreeSet<Uid> = figure.skin.subjects.keys().copied().collect();
    assert_eq!(created.len(), 40, "32 twist joints and 8 half joints");
    let holders = plain.holders(&figure.rig, &figure.skin);
    for (joint, holder) in figure.skin.joints.iter().zip(holders) {
        let holder = plain.joints()[holder.unwrap()].uid;
        let subject = figure.skin.subjects.get(joint).copied().unwrap_or(*joint);
        assert_eq!(holder, subject);
    }
    let all: Vec<Option<usize>> = (0..built.joints().len()).map(Some).collect();
    assert_eq!(built.holders(&figure.rig, &figure.skin), all);
    // Exported without a build: what the twist joints held is with their bones.
    let mut bench = figure.bench(None);
    bench.bind(figure.skin.clone()).unwrap();
    let model = bench.character();
    let weights = model.weights.unwrap();
    assert_eq!(model.nodes.len(), figure.rig.len());
    for point in (0..weights.len()).step_by(97) {
        let sum: f32 = weights.of(point).map(|(_, weight)| weight).sum();
        assert!((sum - 1.0).abs() < 1e-5);
        let row: BTreeSet<u32> = weights.of(point).map(|(joint, _)| joint).collect();
        assert_eq!(row.len(), weights.of(point).len(), "a joint is named once");
    }
    // With it: all joints are there.
    bench.set_built(figure.built.clone());
    assert_eq!(bench.character().weights.unwrap().len(), weights.len());
    assert!(bench.character().nodes.len() >= figure.rig.len() + 40);
    assert_eq!(bench.weights(), Some(&figure.skin));
}

/// Bends the joints of a figure: for each the loss of volume, in hundredths, and the folds.
fn bends(figure: &Figure, side: &str, known: &[(&str, [(i32, usize); 4])], wrong: &mut Vec<String>) {
    let mut line = format!("{:<22} {side:<3}", figure.name);
    let known = known.iter().find(|(name, _)| *name == figure.name).map(|(_, known)| known);
    for (number, joint) in Joint::ALL.into_iter().enumerate() {
        let bent = joint.bend(figure, side);
        let folds = measure::folds(figure, &bent);
        let loss = (100.0 * measure::loss(figure, joint, side, &bent)).round() as i32;
        line += &format!("  {joint:?} {loss:>3} % {folds:>2}");
        let (most, folded) = match known {
            Some(known) => known[number],
            None => (15, 0),
        };
        if loss > most || folds > folded {
            wrong.push(format!("{}: {joint:?}{side} loses {loss} %, {folds} folds", figure.name));
        }
    }
    println!("{line}");
}

/// Limbs bent by a right angle through their IK controls.
#[test]
fn bent_limbs_keep_what_they_kept() {
    let mut wrong = Vec::new();
    for figure in figures() {
        for side in SIDES {
            bends(&figure, side, &KNOWN, &mut wrong);
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// A right angle is a right angle: the measure above bends what it says.
#[test]
fn limbs_are_bent_by_a_right_angle() {
    for figure in figures() {
        for (joint, side) in Joint::ALL.into_iter().flat_map(|joint| SIDES.map(|side| (joint, side))) {
            if joint.is_raised(&figure, side) {
                // Its right angle is one with the trunk.
                assert!(figure.name.ends_with("action"), "{}: {joint:?}{side} is raised", figure.name);
                continue;
            }
            let bent = joint.bend(&figure, side);
            let angle = joint.angle(&figure, side, &bent).to_degrees();
            assert!((angle - 90.0).abs() < 3.0, "{}: {joint:?}{side} turns by {angle}", figure.name);
        }
    }
}

/// Entities of an app whose controls are written stand where the measured states are, so that what is measured is seen.
#[test]
fn entities_bend_as_measured() {
    for figure in figures() {
        let mut bench = figure.bench(None);
        assert!(bench.build(BuildStep::All).error.is_none());
        for (joint, side) in Joint::ALL.into_iter().flat_map(|joint| SIDES.map(|side| (joint, side))) {
            let bent = joint.bend(&figure, side);
            pose_entities(&mut bench, &bent);
            for node in bench.nodes().unwrap() {
                let wanted = bent.global(node.node.uid).unwrap().translation;
                let off = node.entity.translation.distance(wanted);
                assert!(off < 1e-4, "{}, {joint:?}{side}: {} is off by {off}", figure.name, node.node.name);
            }
        }
    }
}

/// Writes the `Transform`s of all controls so that they are posed as in a state.
fn pose_entities(bench: &mut Workbench, state: &RigState) {
    let rig = bench.rig_entity();
    let entities = bench.app_mut().world().get::<BuiltEntities>(rig).unwrap();
    let nodes = state.program().nodes().iter().enumerate().filter(|(_, node)| node.kind == NodeType::Control);
    let posed: Vec<(Entity, Transform)> = nodes
        .map(|(slot, node)| {
            (entities.get(node.uid).unwrap(), state.offset_at(slot).on(&RestTransform::from(node.base)))
        })
        .collect();
    for (entity, transform) in posed {
        *bench.app_mut().world_mut().get_mut::<Transform>(entity).unwrap() = transform;
    }
    bench.app_mut().update();
}

/// Hands and feet are where their controls are, in the bundled body and in the others.
#[test]
fn hands_and_feet_reach_their_goals() {
    for figure in figures() {
        let hands = [("hand", "upper_arm", "forearm"), ("foot", "thigh", "shin")];
        for (end, root, mid) in hands {
            for side in ["_l", "_r"] {
                let [end_at, root_at, mid_at] = [end, root, mid].map(|label| figure.at(&format!("{label}{side}")));
                let length = root_at.distance(mid_at) + mid_at.distance(end_at);
                let goal = figure.control(&format!("{end}_ik{side}"));
                // Half way to the root of the limb, and a little forward: within reach.
                let to = root_at.midpoint(end_at) + Vec3::Z * 0.2 * length;
                let mut state = figure.state();
                let way = to - state.global(goal).unwrap().translation;
                carry(&mut state, goal, Affine3A::from_translation(way));
                let is = state.global(figure.joint(&format!("{end}{side}"))).unwrap().translation;
                let off = is.distance(state.global(goal).unwrap().translation);
                assert!(off < 1e-4, "{}: {end}{side} is off by {off}", figure.name);
            }
        }
    }
}

/// Lengths of half joints in a rig, by the name that their command gives them.
fn pushes(rig: &Rig) -> BTreeMap<String, f32> {
    let reader = ron::Options::default().with_default_extension(ron::extensions::Extensions::IMPLICIT_SOME);
    let tags = rig.walk().flat_map(|joint| &joint.data.tags);
    let halves = tags.filter_map(|tag| match &tag.kind {
        TagKind::Command { module, params, .. } if *module == HalfJoint::NAME => {
            Some(reader.from_str::<HalfJoint>(params).unwrap())
        }
        _ => None,
    });
    halves.filter_map(|half| Some((half.creation.name?, half.push))).collect()
}

/// Binding gives half joints the lengths that the mesh asks for, in the same step as the weights, unless a command says that
/// its length stays.
#[test]
fn binding_sets_the_lengths_of_half_joints() {
    let figure = Figure::bundled();
    let before = crate::bench::shipped("biped");
    let [was, is] = [pushes(&before), pushes(&figure.rig)];
    assert_eq!(is.len(), 8, "{is:?}");
    assert!(is["shin_half_l"] > 0.01 && is["thigh_half_l"] > 0.1, "{is:?}");
    assert!(was.get("shin_half_l") != is.get("shin_half_l"), "{was:?}");

    let mut rig = before.clone();
    let (joint, mut tag) = rig
        .walk()
        .flat_map(|joint| joint.data.tags.iter().map(|tag| (joint.data.uid, tag.clone())).collect::<Vec<_>>())
        .find(|(_, tag)| matches!(&tag.kind, TagKind::Command { params, .. } if params.contains("shin_half_l")))
        .unwrap();
    if let TagKind::Command { params, .. } = &mut tag.kind {
        *params = params.replacen('(', "(fit_push: false, ", 1);
    }
    rig.apply(&RigEdit::SetTag(joint, Box::new(tag))).unwrap();
    let mut bench = Workbench::with_rig(1, rig.clone());
    bench.open(figure.model.clone(), true).unwrap();
    let entity = bench.rig_entity();
    bench.app_mut().world_mut().write_message(BuildRequest { rig: entity, step: BuildStep::All });
    bench.app_mut().update();
    let opened = bench.rig().clone();
    bench.skin(WeightSettings::default(), Vec::new(), &mut |_| {}).unwrap();
    let bound = pushes(bench.rig());
    assert_eq!(bound["shin_half_l"], pushes(&rig)["shin_half_l"]);
    assert_eq!(bound["shin_half_r"], is["shin_half_r"]);
    // The limbs run with what was bound, and one undo takes back all of it.
    bench.app_mut().update();
    let length = |built: &BuiltRig| {
        let half = built.nodes.iter().find(|node| &*node.name == "shin_half_r").unwrap().uid;
        built.constraints.iter().find_map(|constraint| match &*constraint.constraint {
            Constraint::Transform { driven, targets, .. } if *driven == half => {
                Some(targets[1].offset.translation.length())
            }
            _ => None,
        })
    };
    assert_eq!(length(bench.built().unwrap()), length(&figure.built));
    bench.app_mut().world_mut().write_message(EditRequest { rig: entity, change: Change::Undo });
    bench.app_mut().update();
    assert_eq!(bench.rig(), &opened);
}
