//! Templates with parts of them off: whatever local group, feature or switch is off, the rest builds, binds and moves.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt::Write,
    sync::Arc,
};

use bevy::math::{Quat, Vec3};
use rigsmith::{
    algo::weights::WeightSettings,
    headless::Workbench,
    mesh::{
        model::Model,
        obj::{ObjSettings, read_model},
    },
    processor::{Builder, CommandState, Exclusion, SkipReason},
    rig::{
        BuiltRig, NodeType, PoseOffset, Rig, RigEdit, SkinData, TagData, Uid,
        character::{Character, character},
        deform::DeformSkeleton,
        feature::{combined_features, set_feature, set_switch},
    },
    solve::program::{CompileOptions, RigProgram, RigState},
};

use super::{Puppet, all_modules, files, template};

/// Something that can be off: a local group, a combined feature of one group, a switch of one, or a feature tag that
/// has no name.
struct Switch {
    name: String,
    off: Vec<RigEdit>,
    on: Vec<RigEdit>,
}

impl Switch {
    /// The switch whose edits turn it off.
    fn new(rig: &Rig, name: String, off: Vec<RigEdit>) -> Self {
        let mut changed = rig.clone();
        let mut on: Vec<RigEdit> = off.iter().map(|edit| changed.apply(edit).unwrap()).collect();
        on.reverse();
        Self { name, off, on }
    }
}

/// Every switch of a rig.
fn switches(rig: &Rig) -> Vec<Switch> {
    let mut all = Vec::new();
    for group in rig.groups() {
        let mut off = group.clone();
        off.enabled = false;
        all.push(Switch::new(rig, format!("group {}", group.name), vec![RigEdit::SetLocalGroup(off)]));
    }
    let mut named = BTreeSet::new();
    for feature in combined_features(rig) {
        named.extend(feature.tags.iter().copied());
        let group = feature.key.group.and_then(|group| rig.group(group)).map_or("", |group| &group.name);
        let name = format!("{group}:{}", feature.key.name);
        all.push(Switch::new(rig, name.clone(), set_feature(rig, &feature.key, false).unwrap()));
        for switch in &feature.switches {
            // A switch of a choice is turned off by turning another one of the choice on.
            let edits = set_switch(rig, &feature.key, &switch.name, !switch.choice.is_empty()).unwrap();
            all.push(Switch::new(rig, format!("{name}:{}", switch.name), edits));
        }
    }
    for joint in rig.walk() {
        for tag in joint.data.tags.iter().filter(|tag| matches!(tag.kind, rigsmith::rig::TagKind::Feature { .. })) {
            // Each tag of a feature alone, too: of a combined feature one limb may be off.
            let off = TagData { enabled: false, ..tag.clone() };
            let name = format!("feature tag {}", tag.uid);
            all.push(Switch::new(rig, name, vec![RigEdit::SetTag(joint.data.uid, Box::new(off))]));
        }
    }
    all.retain(|switch| !switch.off.is_empty());
    // A feature without parts is the same as its only tag.
    let mut seen = BTreeSet::new();
    all.retain(|switch| seen.insert(format!("{:?}", switch.off)));
    all
}

fn apply(rig: &mut Rig, builder: &mut Builder, edits: &[RigEdit]) {
    for edit in edits {
        rig.apply(edit).unwrap();
        builder.touch(rig, edit);
    }
}

/// The built rig and its program at rest, with the names of what is off for messages.
fn built(builder: &mut Builder, what: &str) -> (BuiltRig, RigState) {
    if let Some(error) = builder.run_all().error {
        panic!("{what}: {error}");
    }
    let built = builder.built();
    let program =
        RigProgram::compile(&built, &CompileOptions::default()).unwrap_or_else(|error| panic!("{what}: {error}"));
    let mut state = RigState::new(Arc::new(program));
    state.evaluate(0.0);
    (built, state)
}

/// Largest distance of joints from where they would be, in units of the templates (about meters).
const STILL: f32 = 1e-5;

/// Document joints, by uid, that a control moves, of those that it leaves finite.
fn joints_moved_by(built: &BuiltRig, state: &mut RigState, controls: &[Uid], what: &str) -> BTreeSet<Uid> {
    let joints: Vec<Uid> =
        built.nodes.iter().filter(|node| node.kind == NodeType::Joint).map(|node| node.uid).collect();
    let places = |state: &RigState| -> Vec<[Vec3; 3]> {
        let global = |joint: &Uid| state.global(*joint).unwrap();
        let corners = |joint| {
            let global = global(joint);
            [global.translation, global.rotation * Vec3::X, global.rotation * Vec3::Y]
        };
        joints.iter().map(corners).collect()
    };
    state.evaluate(0.0);
    let before = places(state);
    for control in controls {
        let offset = PoseOffset {
            translation: Vec3::new(0.013, 0.017, -0.011),
            rotation: Quat::from_euler(bevy::math::EulerRot::XYZ, 0.11, -0.07, 0.05),
            ..PoseOffset::default()
        };
        // Controls that nothing depends on are not posable.
        state.set_offset(*control, offset).ok();
    }
    state.evaluate(0.0);
    let after = places(state);
    for control in controls {
        state.set_offset(*control, PoseOffset::default()).ok();
    }
    let mut moved = BTreeSet::new();
    for ((joint, before), after) in joints.iter().zip(before).zip(after) {
        assert!(after.iter().all(|place| place.is_finite()), "{what}: joint {joint} is not finite");
        if before.iter().zip(after).any(|(before, after)| before.distance(after) > STILL) {
            moved.insert(*joint);
        }
    }
    moved
}

fn controls(built: &BuiltRig) -> Vec<Uid> {
    built.nodes.iter().filter(|node| node.kind == NodeType::Control).map(|node| node.uid).collect()
}

/// The joints that meshes can be bound to: all that stand in the document and are on.
fn binds(rig: &Rig, built: &BuiltRig, what: &str) {
    let skeleton = DeformSkeleton::new(rig, Some(built));
    for joint in rig.walk() {
        let on = joint.data.group.and_then(|group| rig.group(group)).is_none_or(|group| group.enabled);
        assert_eq!(skeleton.index(joint.data.uid).is_some(), on, "{what}: joint {:?}", joint.data.label);
    }
    assert!(skeleton.joints().iter().all(|joint| joint.rest.is_finite()), "{what}");
}

/// A small mesh around the bones of a whole template, with the weights that binding gives it.
struct Body {
    model: Model,
    skin: SkinData,
}

impl Body {
    fn new(rig: &Rig, built: &BuiltRig) -> Self {
        let model = bones(rig);
        let mut bench = Workbench::with_rig(1, rig.clone());
        bench.set_built(Arc::new(built.clone()));
        bench.open(model.clone(), true).unwrap();
        bench.skin(WeightSettings::default(), Vec::new(), &mut |_| {}).unwrap();
        let skin = bench.weights().unwrap().clone();
        Self { model, skin }
    }

    /// The mesh stays bound: each point is held wholly by joints that are there, unless all of its joints are off, and
    /// so is what they hang on.
    fn check(&self, rig: &Rig, built: &BuiltRig, what: &str) {
        let holders = DeformSkeleton::new(rig, Some(built)).holders(rig, &self.skin);
        let is_on = |joint: Uid| {
            let joint = self.skin.subjects.get(&joint).copied().unwrap_or(joint);
            let group = rig.joint(joint).and_then(|joint| joint.data.group);
            group.and_then(|group| rig.group(group)).is_none_or(|group| group.enabled)
        };
        for (joint, holder) in self.skin.joints.iter().zip(&holders) {
            assert!(holder.is_some() || !is_on(*joint), "{what}: nothing holds what {joint} holds");
        }
        let (file, rest, skin) = (&self.model, &self.model, Some(&self.skin));
        let bound = character(&Character { rig, built: Some(built), file, rest, nodes: &[], skin });
        let weights = bound.weights.expect("a bound mesh");
        assert_eq!(weights.len(), self.model.points.len(), "{what}");
        for point in 0..weights.len() {
            let sum: f32 = weights.of(point).map(|(_, weight)| weight).sum();
            let is_held = self.skin.weights.of(point).any(|(joint, _)| holders[joint as usize].is_some());
            let wanted = if is_held { 1.0 } else { 0.0 };
            assert!((sum - wanted).abs() < 1e-4, "{what}: the weights of point {point} add up to {sum}");
        }
    }
}

/// A prism around each bone of a rig's rest pose.
fn bones(rig: &Rig) -> Model {
    let places: BTreeMap<Uid, Vec3> =
        rig.rest_globals().into_iter().map(|(uid, rest)| (uid, rest.translation)).collect();
    let mut text = String::from("o bones\n");
    let mut count = 0;
    for joint in rig.walk() {
        let start = places[&joint.data.uid];
        let above = joint.parent.map_or(Vec3::ZERO, |parent| places[&parent]);
        let ends: Vec<Vec3> = if joint.children.is_empty() {
            vec![start + 0.3 * (start - above).try_normalize().unwrap_or(Vec3::Y) * (start - above).length().max(0.05)]
        } else {
            joint.children.iter().map(|child| places[child]).collect()
        };
        for end in ends {
            let along = (end - start).try_normalize().unwrap_or(Vec3::Y);
            let (u, v) = along.any_orthonormal_pair();
            let width = 0.2 * (end - start).length().max(0.01);
            for place in [start, end] {
                for side in 0..3 {
                    let (sin, cos) = (side as f32 * std::f32::consts::TAU / 3.0).sin_cos();
                    let corner = place + width * (cos * u + sin * v);
                    writeln!(text, "v {} {} {}", corner.x, corner.y, corner.z).unwrap();
                }
            }
            let [a, b, c, d, e, f] = [1, 2, 3, 4, 5, 6].map(|number| count + number);
            write!(text, "f {a} {c} {b}\nf {d} {e} {f}\nf {a} {b} {e} {d}\nf {b} {c} {f} {e}\nf {c} {a} {d} {f}\n")
                .unwrap();
            count += 6;
        }
    }
    read_model(text.as_bytes(), "bones", &ObjSettings::default(), &mut |_| None).unwrap()
}

#[test]
fn with_one_switch_off_the_rest_builds_and_moves_as_before() {
    for (name, _) in files() {
        let mut rig = template(&name);
        let mut builder = Builder::new(all_modules());
        builder.sync(&rig);
        let (whole, mut state) = built(&mut builder, &name);
        let all: BTreeMap<Uid, BTreeSet<Uid>> = controls(&whole)
            .into_iter()
            .map(|control| (control, joints_moved_by(&whole, &mut state, &[control], &name)))
            .collect();
        assert!(all.values().any(|moved| !moved.is_empty()), "{name} does not move");
        for switch in switches(&rig) {
            let what = format!("{name} without {}", switch.name);
            apply(&mut rig, &mut builder, &switch.off);
            let (part, mut state) = built(&mut builder, &what);
            assert_eq!(part, Builder::build(&rig, &all_modules()).unwrap(), "{what}: a full build gives another rig");
            binds(&rig, &part, &what);
            let index = part.index();
            let left = controls(&part);
            let moved: BTreeSet<Uid> =
                left.iter().flat_map(|control| joints_moved_by(&part, &mut state, &[*control], &what)).collect();
            let before: BTreeSet<Uid> = left.iter().filter_map(|control| all.get(control)).flatten().copied().collect();
            if let Some(lost) = before.iter().find(|joint| index.contains_key(joint) && !moved.contains(joint)) {
                let name = part.node(*lost).map(|node| node.name.to_string()).unwrap_or_default();
                panic!("{what}: the controls that are left do not move {name} any more");
            }
            apply(&mut rig, &mut builder, &switch.on);
        }
        assert_eq!(built(&mut builder, &name).0, whole, "{name}: all on again");
    }
}

#[test]
fn with_any_two_switches_off_the_rest_builds_binds_and_moves() {
    let mut pairs = 0;
    for (name, _) in files() {
        let mut rig = template(&name);
        let mut builder = Builder::new(all_modules());
        builder.sync(&rig);
        let (whole, mut state) = built(&mut builder, &name);
        let body = Body::new(&rig, &whole);
        let mut all: BTreeMap<Uid, BTreeSet<Uid>> = controls(&whole)
            .into_iter()
            .map(|control| (control, joints_moved_by(&whole, &mut state, &[control], &name)))
            .collect();
        // Controls that carry the whole rig would hide what does not move by itself, so they stay unless all do.
        let every = whole.nodes.iter().filter(|node| node.kind == NodeType::Joint).count();
        if all.values().any(|moved| (1..every).contains(&moved.len())) {
            all.retain(|_, moved| moved.len() < every);
        }
        assert!(all.values().any(|moved| !moved.is_empty()), "{name} does not move");
        let switches = switches(&rig);
        for (number, first) in switches.iter().enumerate() {
            apply(&mut rig, &mut builder, &first.off);
            for second in &switches[number + 1..] {
                let mut both = rig.clone();
                // Switched from what the first left, as its tags may be among those of the second.
                let back: Vec<RigEdit> = second.off.iter().map(|edit| both.apply(edit).unwrap()).collect();
                let what = format!("{name} without {} and {}", first.name, second.name);
                apply(&mut rig, &mut builder, &second.off);
                let (part, mut state) = built(&mut builder, &what);
                binds(&rig, &part, &what);
                let left: Vec<Uid> = controls(&part).into_iter().filter(|control| all.contains_key(control)).collect();
                let moved = joints_moved_by(&part, &mut state, &left, &what);
                let index = part.index();
                let before = left.iter().flat_map(|control| &all[control]);
                if let Some(lost) = before.into_iter().find(|joint| index.contains_key(joint) && !moved.contains(joint))
                {
                    let name = part.node(*lost).map(|node| node.name.to_string()).unwrap_or_default();
                    panic!("{what}: the controls that are left do not move {name} any more");
                }
                body.check(&rig, &part, &what);
                let back: Vec<RigEdit> = back.into_iter().rev().collect();
                apply(&mut rig, &mut builder, &back);
                pairs += 1;
            }
            apply(&mut rig, &mut builder, &first.on);
        }
    }
    assert!(pairs > 1000, "{pairs}");
}

#[test]
fn what_is_passed_over_says_why() {
    let mut rig = template("biped");
    let arm = rig.groups().iter().find(|group| group.name == "arm_r").unwrap().clone();
    rig.apply(&RigEdit::SetLocalGroup(rigsmith::rig::GroupData { enabled: false, ..arm })).unwrap();
    let mut builder = Builder::new(all_modules());
    builder.sync(&rig);
    assert!(builder.run_all().error.is_none());
    let skipped: Vec<SkipReason> = builder
        .list()
        .iter()
        .filter_map(|entry| builder.status(entry.command))
        .filter(|status| status.state == CommandState::Skipped)
        .map(|status| status.skipped.expect("a reason"))
        .collect();
    assert!(skipped.iter().any(|reason| matches!(reason, SkipReason::Own(Exclusion::Joint { .. }))));
    let needed: Vec<String> = skipped
        .iter()
        .filter(|reason| matches!(reason, SkipReason::Reference { .. }))
        .map(ToString::to_string)
        .collect();
    assert!(needed.iter().any(|text| text.contains("hand_r is in the group arm_r, which is off")), "{needed:?}");
    let error = builder.find(&rig, "@joint hand_r").unwrap_err().to_string();
    assert!(error.contains("hand_r is in the group arm_r, which is off"), "{error}");
}

#[test]
fn a_part_of_a_limb_that_is_off_leaves_the_others() {
    let mut rig = template("biped");
    for feature in combined_features(&rig) {
        let group = feature.key.group.and_then(|group| rig.group(group)).map_or("", |group| &group.name);
        if group == "arm_l" && feature.key.name == "ik" {
            for edit in set_feature(&rig, &feature.key, false).unwrap() {
                rig.apply(&edit).unwrap();
            }
        }
    }
    let puppet = Puppet::new(rig);
    assert!(puppet.built.nodes.iter().all(|node| *node.name != *"hand_ik_l"));
    puppet.control("hand_ik_r");
    puppet.control("arm_fk_l");
}

/// The part `arm` below a chest whose control carries the rig.
#[test]
fn a_dropped_part_goes_with_the_control_that_carries_the_rig() {
    use rigsmith::rig::{
        JointData, RestTransform, TagKind, UidSource,
        operations::{Operation, TagOperation},
        part::{PartNeeds, Socket},
    };
    let part = template("parts/arm");
    let needs = PartNeeds::of(&part);
    assert_eq!(needs.joints, ["clavicle_l", "upper_arm_l", "forearm_l", "hand_l"]);
    assert_eq!(needs.sockets, [Socket::Parent("clavicle_l".into()), Socket::Root]);
    let mut uids = UidSource::seeded(5);
    let mut rig = Rig::new(uids.next_uid(), "host");
    let control = TagKind::Command {
        module: "control".into(),
        params: "(axes: rig, creation: (name: \"root\"))".into(),
        feature: None,
    };
    let tag = TagData { uid: uids.next_uid(), enabled: true, comment: String::new(), kind: control };
    let chest = JointData {
        uid: uids.next_uid(),
        label: Some("chest".into()),
        rest: RestTransform::from_translation(Vec3::new(0.0, 1.27, 0.0)),
        tags: vec![tag],
        ..JointData::default()
    };
    let mut above = Some(chest.uid);
    rig.apply(&RigEdit::AddJoint { joint: Box::new(chest), parent: None, index: 0 }).unwrap();
    let mut joints = Vec::new();
    for joint in part.walk() {
        let mut data = JointData { uid: uids.next_uid(), rest: joint.data.rest, ..JointData::default() };
        if joint.parent.is_none() {
            data.rest.translation.y -= 1.27;
        }
        joints.push(data.uid);
        let edit = RigEdit::AddJoint { joint: Box::new(data), parent: above, index: usize::MAX };
        above = joints.last().copied();
        rig.apply(&edit).unwrap();
    }
    let drop = |joints: &[Uid]| {
        Operation::Tags(TagOperation::Drop {
            part: Arc::new(part.clone().into()),
            joints: joints.to_vec(),
            bindings: BTreeMap::new(),
        })
    };
    let before = rig.clone();
    let refused = drop(&joints[..3]).run(&mut rig, &mut uids, None).unwrap_err().to_string();
    assert!(refused.contains("clavicle_l, upper_arm_l, forearm_l, hand_l"), "{refused}");
    assert!(rig == before);
    drop(&joints).run(&mut rig, &mut uids, None).unwrap();
    let mut puppet = Puppet::new(rig);
    let before = ["upper_arm_l", "hand_l"].map(|joint| puppet.place(joint));
    puppet.move_by("root", Vec3::X);
    for (joint, before) in ["upper_arm_l", "hand_l"].into_iter().zip(before) {
        let by = puppet.place(joint) - before;
        assert!(by.distance(Vec3::X) < 1e-4, "{joint} moves by {by}");
    }
}
