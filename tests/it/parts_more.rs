//! Parts of animals and single joints, and the animals made of them: posed, and checked for what an animator expects.

mod creatures;
mod face;
mod leg;
mod swing;
mod wing;

use std::{collections::BTreeMap, path::Path, sync::Arc};

use bevy::math::{Affine3, Quat, Vec3};
use rigsmith::{
    files::{RealDisk, load_template},
    mesh::model::Trs,
    processor::{Builder, Modules},
    rig::{
        BuiltRig, JointData, NodeType, PoseOffset, RestTransform, Rig, RigEdit, Uid, UidSource,
        feature::{combined_features, set_feature},
        operations::{Operation, TagOperation},
    },
    solve::program::{CompileOptions, RigProgram, RigState},
};

/// The parts that are tested here.
const PARTS: [&str; 7] = ["eye", "jaw", "leg_3joint", "single_control", "spring_chain", "tail", "wing"];
const CHARACTERS: [&str; 2] = ["bird", "quadruped"];

fn template(path: &str) -> Rig {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("assets/templates/{path}.rig.ron"));
    let template = load_template(&RealDisk, &path).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(template.notes, [""; 0], "{path:?}");
    template.rig
}

fn part(name: &str) -> Rig {
    template(&format!("parts/{name}"))
}

fn modules() -> Arc<Modules> {
    Arc::new(rigsmith::modules::all())
}

/// A built rig and an instance of it.
struct Stage {
    rig: Rig,
    built: BuiltRig,
    state: RigState,
}

impl Stage {
    fn new(rig: Rig) -> Self {
        let built = Builder::build(&rig, &modules()).unwrap_or_else(|error| panic!("{}: {error}", rig.about().name));
        let program = RigProgram::compile(&built, &CompileOptions::default());
        let program = program.unwrap_or_else(|error| panic!("{}: {error}", rig.about().name));
        let mut state = RigState::new(Arc::new(program));
        state.evaluate(0.0);
        Self { rig, built, state }
    }

    fn joint(&self, label: &str) -> Uid {
        self.rig.find_label(label).unwrap_or_else(|| panic!("no joint {label}"))
    }

    /// The control with a label and a shape.
    fn control(&self, label: &str, shape: &str) -> Uid {
        let is_it = |node: &&rigsmith::rig::BuiltNode| {
            node.label.as_deref() == Some(label) && node.control.as_ref().is_some_and(|control| control.shape == shape)
        };
        let mut found = self.built.nodes.iter().filter(is_it);
        let node = found.next().unwrap_or_else(|| panic!("no {shape} of {label}"));
        assert!(found.next().is_none(), "several {shape} of {label}");
        node.uid
    }

    fn named(&self, name: &str) -> Uid {
        self.built.nodes.iter().find(|node| &*node.name == name).unwrap_or_else(|| panic!("no node {name}")).uid
    }

    /// Sets an attribute of the node with that label that has it.
    fn set(&mut self, label: &str, name: &str, value: f32) {
        let has = |node: &&rigsmith::rig::BuiltNode| {
            node.label.as_deref() == Some(label) && node.attributes.iter().any(|known| &*known.name == name)
        };
        let node = self.built.nodes.iter().find(has).unwrap_or_else(|| panic!("{label} has no {name}")).uid;
        self.state.set_attribute(node, name, value).unwrap();
        self.state.evaluate(0.0);
    }

    fn shift(&mut self, node: Uid, translation: Vec3) {
        self.pose(node, PoseOffset { translation, ..PoseOffset::IDENTITY });
    }

    fn rotate(&mut self, node: Uid, rotation: Quat) {
        self.pose(node, PoseOffset { rotation, ..PoseOffset::IDENTITY });
    }

    fn pose(&mut self, node: Uid, offset: PoseOffset) {
        self.state.set_offset(node, offset).unwrap();
        self.state.evaluate(0.0);
    }

    fn global(&self, node: Uid) -> Trs {
        self.state.global(node).unwrap()
    }

    fn place(&self, label: &str) -> Vec3 {
        self.global(self.joint(label)).translation
    }

    /// Distance of the furthest joint from where it rests, and the turn of the most turned one in degrees.
    fn off_rest(&self) -> (f32, f32) {
        let off = self.rig.rest_globals().into_iter().filter_map(|(joint, rest)| {
            let (_, rotation, translation) = rest.to_scale_rotation_translation();
            let now = self.state.global(joint)?;
            Some((now.translation.distance(translation), now.rotation.angle_between(rotation).to_degrees()))
        });
        off.fold((0.0, 0.0), |(place, angle), (p, a)| (place.max(p), f32::max(angle, a)))
    }

    fn height(&self) -> f32 {
        let places: Vec<Vec3> = self.rig.walk().map(|joint| self.rig.position(joint.data.uid)).collect();
        let low = places.iter().copied().reduce(Vec3::min).unwrap();
        let high = places.iter().copied().reduce(Vec3::max).unwrap();
        // One joint alone has no size.
        if high == low { 1.0 } else { (high - low).length() }
    }

    fn check_rest(&self, what: &str) {
        let (place, angle) = self.off_rest();
        assert!(place < 1e-4 * self.height(), "{what}: a joint moved by {place}");
        // Angles near zero are no better than the root of rounding.
        assert!(angle < 0.1, "{what}: a joint turned by {angle} degrees");
    }
}

#[test]
fn joints_at_rest_stay_where_they_are() {
    for name in PARTS {
        Stage::new(part(name)).check_rest(name);
    }
    for name in CHARACTERS {
        Stage::new(template(name)).check_rest(name);
    }
}

#[test]
fn every_feature_can_be_turned_off() {
    let rigs = PARTS.map(|name| (name, part(name))).into_iter();
    for (name, rig) in rigs.chain(CHARACTERS.map(|name| (name, template(name)))) {
        let features = combined_features(&rig);
        assert!(features.iter().all(|feature| !feature.key.name.is_empty()), "{name}");
        let mut all_off = rig.clone();
        for feature in &features {
            let mut one_off = rig.clone();
            for edit in set_feature(&rig, &feature.key, false).unwrap() {
                one_off.apply(&edit).unwrap();
                all_off.apply(&edit).unwrap();
            }
            let what = format!("{name} without {}", feature.key.name);
            let stage = Stage::new(one_off);
            stage.check_rest(&what);
            assert!(stage.built.constraints.len() < Stage::new(rig.clone()).built.constraints.len(), "{what}");
        }
        Stage::new(all_off).check_rest(name);
    }
}

#[test]
fn groups_have_colours_and_can_be_left_out() {
    let mut names = Vec::new();
    for (name, rig) in
        PARTS.map(|name| (name, part(name))).into_iter().chain(CHARACTERS.map(|name| (name, template(name))))
    {
        assert!(rig.walk().all(|joint| joint.data.group.is_some()), "{name}: every joint is in a group");
        assert!(rig.walk().all(|joint| joint.data.label.is_some()), "{name}: every joint has a label");
        assert!(rig.groups().iter().all(|group| group.color != [0.0; 3]), "{name}");
        names.push(rig.about().name.clone());
        assert!(!rig.about().description.is_empty() && !rig.about().kind.is_empty(), "{name}");
    }
    // A bird without a wing, a fox without a tail.
    for (name, group, gone) in [("bird", "wing_l", 9), ("quadruped", "tail", 6)] {
        let mut rig = template(name);
        let mut data = rig.groups().iter().find(|known| known.name == group).unwrap().clone();
        data.enabled = false;
        rig.apply(&RigEdit::SetLocalGroup(data)).unwrap();
        let stage = Stage::new(rig);
        let joints = stage.built.nodes.iter().filter(|node| node.kind == NodeType::Joint).count();
        assert_eq!(joints + gone, stage.rig.len(), "{name} without {group}");
        stage.check_rest(name);
    }
}

/// A rig with joints like those of a part, without labels, below a joint of its own that is turned and lies elsewhere,
/// and everything larger. Returns the joints in the part's order.
fn host(part: &Rig, name: &str, factor: f32) -> (Rig, Vec<Uid>) {
    let mut rig = Rig::new(Uid(0x5eed_0000), name);
    let root = JointData {
        uid: Uid(0x5eed_0001),
        label: Some("host".to_owned()),
        rest: RestTransform {
            translation: Vec3::new(0.3, 0.7, -0.2),
            rotation: Quat::from_rotation_y(0.7) * Quat::from_rotation_x(0.2),
            scale: Vec3::ONE,
        },
        ..JointData::default()
    };
    rig.apply(&RigEdit::AddJoint { joint: Box::new(root), parent: None, index: 0 }).unwrap();
    let joints = add(&mut rig, part, factor, 0);
    (rig, joints)
}

fn add(rig: &mut Rig, part: &Rig, factor: f32, first: u64) -> Vec<Uid> {
    let mut made = BTreeMap::new();
    let mut joints = Vec::new();
    for (number, joint) in part.walk().enumerate() {
        let uid = Uid(0x5eed_1000 + first + number as u64);
        let mut rest = joint.data.rest;
        rest.translation *= factor;
        let copy = JointData { uid, rest, ..JointData::default() };
        let parent = joint.parent.map_or(Uid(0x5eed_0001), |parent| made[&parent]);
        rig.apply(&RigEdit::AddJoint { joint: Box::new(copy), parent: Some(parent), index: usize::MAX }).unwrap();
        made.insert(joint.data.uid, uid);
        joints.push(uid);
    }
    joints
}

fn drop_onto(rig: &mut Rig, part: &Rig, joints: &[Uid]) {
    let operation =
        TagOperation::Drop { part: Arc::new(part.clone().into()), joints: joints.to_vec(), bindings: BTreeMap::new() };
    Operation::Tags(operation).run(rig, &mut UidSource::seeded(rig.len() as u64), None).unwrap();
}

#[test]
fn every_part_can_be_dropped_onto_joints_elsewhere() {
    for name in PARTS {
        let part = part(name);
        let (mut rig, joints) = host(&part, name, 1.7);
        drop_onto(&mut rig, &part, &joints);
        let stage = Stage::new(rig.clone());
        stage.check_rest(&format!("{name} dropped"));
        assert_eq!(stage.built.constraints.len(), Stage::new(part.clone()).built.constraints.len(), "{name}");
        // A second one beside the first, with a group of its own.
        let more = add(&mut rig, &part, 0.6, 0x100);
        drop_onto(&mut rig, &part, &more);
        let twice = Stage::new(rig.clone());
        twice.check_rest(&format!("{name} dropped twice"));
        assert_eq!(twice.built.constraints.len(), 2 * stage.built.constraints.len(), "{name}");
        let groups: Vec<&str> = rig.groups().iter().map(|group| group.name.as_str()).collect();
        assert_eq!(groups.len(), 2, "{name}: {groups:?}");
        // Moving what it hangs on takes its root along.
        let mut moved = Stage::new(rig);
        let before = moved.global(joints[0]).translation;
        moved.shift(Uid(0x5eed_0001), Vec3::new(0.05, 0.0, 0.0));
        assert!(moved.global(joints[0]).translation.distance(before) > 0.04, "{name} stays behind");
    }
}

#[test]
fn chains_of_other_lengths_take_parts_for_chains() {
    for name in ["tail", "spring_chain"] {
        let part = part(name);
        for count in [3, 9] {
            let mut rig = Rig::new(Uid(1), name);
            let joints: Vec<Uid> = (10..10 + count).map(Uid).collect();
            for (number, uid) in joints.iter().enumerate() {
                let rest = RestTransform::from_translation(Vec3::new(0.0, 0.2, 0.02 * number as f32));
                let joint = JointData { uid: *uid, rest, ..JointData::default() };
                let parent = number.checked_sub(1).map(|above| joints[above]);
                rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent, index: 0 }).unwrap();
            }
            drop_onto(&mut rig, &part, &joints);
            let stage = Stage::new(rig);
            stage.check_rest(&format!("{name} on {count} joints"));
            let controls = stage.built.nodes.iter().filter(|node| node.kind == NodeType::Control).count();
            assert!(controls >= count as usize, "{name} on {count} joints: {controls} controls");
        }
    }
}

/// An affine map as its parts, for directions of axes.
fn axis(global: Trs, axis: Vec3) -> Vec3 {
    Affine3::from_quat(global.rotation).transform_vector3(axis)
}
