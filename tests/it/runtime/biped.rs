//! A biped as a game's rig has it, built directly: IK and FK on four limbs, reverse feet, twists, a spine along a curve,
//! switches of spaces, fingers, eyes and jaw.

use std::{collections::HashMap, sync::Arc};

use glam::{Quat, Vec3};
use rigsmith::{
    mesh::model::Trs,
    rig::{
        AimUp, Attribute, AttributeKind, BuiltConstraint, BuiltNode, BuiltRig, Channel, Constraint, KeyEase, NodeType,
        Output, Scalar, Target, Uid,
    },
};

/// Makes built rigs from nodes given by label and place.
#[derive(Default)]
pub struct RigBuilder {
    /// Nodes and constraints made so far.
    pub rig: BuiltRig,
    globals: Vec<Trs>,
    by_label: HashMap<String, usize>,
}

impl RigBuilder {
    /// Adds a node at a place in the rig's space.
    pub fn node(&mut self, label: &str, kind: NodeType, parent: &str, at: Vec3) -> Uid {
        self.placed(label, kind, parent, Trs { translation: at, ..Trs::IDENTITY })
    }

    /// Adds a node with a transform in the rig's space.
    pub fn placed(&mut self, label: &str, kind: NodeType, parent: &str, global: Trs) -> Uid {
        let parent = self.by_label.get(parent).copied();
        let above = parent.map_or(Trs::IDENTITY, |parent| self.globals[parent]);
        let uid = Uid(1000 + self.rig.nodes.len() as u64);
        self.by_label.insert(label.to_owned(), self.rig.nodes.len());
        self.globals.push(global);
        self.rig.nodes.push(BuiltNode {
            uid,
            name: label.into(),
            kind,
            parent,
            base: global.relative_to(&above),
            label: Some(label.into()),
            group: None,
            origin: None,
            control: None,
            layer: None,
            attributes: Arc::default(),
        });
        uid
    }

    /// Adds a control below a group of its own at the same place: `LABEL_group` and `LABEL`.
    pub fn control(&mut self, label: &str, parent: &str, global: Trs) -> Uid {
        let group = format!("{label}_group");
        self.placed(&group, NodeType::Null, parent, global);
        self.placed(label, NodeType::Control, &group, global)
    }

    /// Gives a node a number between two ends.
    pub fn attribute(&mut self, node: &str, name: &str, default: f32, ends: (f32, f32)) {
        let kind = AttributeKind::Number { min: Some(ends.0), max: Some(ends.1) };
        self.add(node, Attribute { name: name.into(), kind, default });
    }

    /// Gives a node a choice.
    pub fn choice(&mut self, node: &str, name: &str, choices: &[&str]) {
        let kind = AttributeKind::Choice(choices.iter().map(|choice| (*choice).to_owned()).collect());
        self.add(node, Attribute { name: name.into(), kind, default: 0.0 });
    }

    fn add(&mut self, node: &str, attribute: Attribute) {
        let node = &mut self.rig.nodes[self.by_label[node]];
        node.attributes = node.attributes.iter().cloned().chain([attribute]).collect();
    }

    /// Adds a constraint.
    pub fn constrain(&mut self, constraint: Constraint) -> Uid {
        let number = self.rig.constraints.len() as u64;
        let (uid, command) = (Uid(500_000 + number), Uid(700_000 + number));
        self.rig.constraints.push(BuiltConstraint { uid, command, constraint: Arc::new(constraint) });
        uid
    }

    /// The uid of a label.
    pub fn uid(&self, label: &str) -> Uid {
        self.rig.nodes[self.by_label[label]].uid
    }

    /// Where a node was built.
    pub fn global(&self, label: &str) -> Trs {
        self.globals[self.by_label[label]]
    }

    /// A target that keeps where the driven node was built.
    pub fn kept(&self, driven: &str, target: &str, weight: Scalar) -> Target {
        let offset = self.global(driven).relative_to(&self.global(target));
        Target { node: self.uid(target), weight, offset }
    }

    /// Makes a node follow targets wholly.
    pub fn follow(&mut self, driven: &str, targets: Vec<Target>) {
        self.constrain(Constraint::Transform {
            driven: self.uid(driven),
            targets,
            translate: [true; 3],
            rotate: [true; 3],
            scale: [true; 3],
            weight: Scalar::Value(1.0),
            keep_pose: false,
        });
    }
}

const JOINT: NodeType = NodeType::Joint;
const NULL: NodeType = NodeType::Null;

fn at(translation: Vec3) -> Trs {
    Trs { translation, ..Trs::IDENTITY }
}

/// A transform whose Y axis points from one place to another.
fn along(from: Vec3, to: Vec3) -> Trs {
    let y = (to - from).normalize();
    let x = y.cross(Vec3::Z).normalize();
    let rotation = Quat::from_mat3(&glam::Mat3::from_cols(x, y, x.cross(y))).normalize();
    Trs { translation: from, rotation, scale: Vec3::ONE }
}

/// The biped.
pub fn biped() -> BuiltRig {
    let mut rig = RigBuilder::default();
    rig.control("root", "", Trs::IDENTITY);
    rig.control("cog", "root", at(Vec3::new(0.0, 1.0, 0.0)));
    torso(&mut rig);
    for side in [1.0, -1.0] {
        let letter = if side > 0.0 { "L" } else { "R" };
        arm(&mut rig, letter, side);
        leg(&mut rig, letter, side);
    }
    rig.rig
}

fn torso(rig: &mut RigBuilder) {
    let spine: Vec<Vec3> = (0..6).map(|i| Vec3::new(0.0, 1.0 + 0.09 * i as f32, 0.002 * i as f32)).collect();
    let controls = [0, 2, 4, 5].map(|i| spine[i]);
    let mut points = Vec::new();
    for (i, place) in controls.into_iter().enumerate() {
        let parent = if i < 2 { "cog".to_owned() } else { format!("spine_control_{}", i - 1) };
        points.push(rig.control(&format!("spine_control_{i}"), &parent, at(place)));
    }
    rig.control("chest", "spine_control_3", at(spine[5]));
    rig.attribute("cog", "stretch", 0.0, (0.0, 1.0));
    let mut above = "cog".to_owned();
    let mut chain = Vec::new();
    for (i, place) in spine.iter().enumerate() {
        let next = spine.get(i + 1).copied().unwrap_or(*place + Vec3::Y * 0.1);
        let label = format!("spine_ik_{i}");
        chain.push(rig.placed(&label, NULL, &above, along(*place, next)));
        above = label;
    }
    let stretch = Scalar::attribute(rig.uid("cog"), "stretch");
    rig.constrain(Constraint::Spline {
        joints: chain,
        points,
        stretch,
        twist: Scalar::Value(0.0),
        weight: Scalar::Value(1.0),
    });
    let mut above = String::new();
    for i in 0..spine.len() {
        let (label, source) = (format!("spine_{i}"), format!("spine_ik_{i}"));
        rig.placed(&label, JOINT, &above, rig.global(&source));
        let target = rig.kept(&label, &source, Scalar::Value(1.0));
        rig.follow(&label, vec![target]);
        above = label;
    }
    let neck = [Vec3::new(0.0, 1.5, 0.0), Vec3::new(0.0, 1.56, 0.01), Vec3::new(0.0, 1.62, 0.02)];
    let mut parent = "chest".to_owned();
    for (i, place) in neck.into_iter().enumerate() {
        let control = if i == 2 { "head_control".to_owned() } else { format!("neck_control_{i}") };
        rig.control(&control, &parent, at(place));
        let label = if i == 2 { "head".to_owned() } else { format!("neck_{i}") };
        rig.node(&label, JOINT, &above, place);
        let target = rig.kept(&label, &control, Scalar::Value(1.0));
        rig.follow(&label, vec![target]);
        (parent, above) = (control, label);
    }
    space_switch(rig, "head_control", &["chest", "cog", "root"]);
    rig.control("jaw_control", "head_control", at(Vec3::new(0.0, 1.62, 0.05)));
    rig.node("jaw", JOINT, "head", Vec3::new(0.0, 1.62, 0.05));
    let target = rig.kept("jaw", "jaw_control", Scalar::Value(1.0));
    rig.follow("jaw", vec![target]);
    rig.attribute("head_control", "smile", 0.0, (0.0, 1.0));
    let smile = Scalar::attribute(rig.uid("head_control"), "smile");
    rig.constrain(Constraint::DrivenKey {
        driver: smile,
        keys: vec![(0.0, 0.0), (0.5, 0.7), (1.0, 1.0)],
        ease: KeyEase::Smooth,
        output: Output::Morph("smile".into()),
    });
    for i in 0..18 {
        let angle = i as f32 * 0.35;
        let (control, face) = (format!("face_control_{i}"), format!("face_{i}"));
        let place = at(Vec3::new(0.05 * angle.sin(), 1.66 + 0.05 * angle.cos(), 0.1));
        rig.control(&control, if i < 6 { "jaw_control" } else { "head_control" }, place);
        rig.placed(&face, JOINT, if i < 6 { "jaw" } else { "head" }, place);
        let target = rig.kept(&face, &control, Scalar::Value(1.0));
        rig.follow(&face, vec![target]);
    }
    rig.control("eyes_control", "head_control", at(Vec3::new(0.0, 1.7, 0.8)));
    for (letter, side) in [("L", 1.0), ("R", -1.0)] {
        let (eye, control) = (format!("eye_{letter}"), format!("eye_control_{letter}"));
        rig.control(&control, "eyes_control", at(Vec3::new(0.03 * side, 1.7, 0.8)));
        rig.node(&eye, JOINT, "head", Vec3::new(0.03 * side, 1.7, 0.08));
        rig.constrain(Constraint::Aim {
            driven: rig.uid(&eye),
            targets: vec![Target { node: rig.uid(&control), weight: Scalar::Value(1.0), offset: Trs::IDENTITY }],
            aim: Vec3::Z,
            up: Vec3::Y,
            world_up: AimUp::Axis(rig.uid("head"), Vec3::Y),
            offset: Quat::IDENTITY,
            weight: Scalar::Value(1.0),
        });
    }
}

/// Lets the group above a control follow one of several spaces.
fn space_switch(rig: &mut RigBuilder, control: &str, spaces: &[&str]) {
    rig.choice(control, "space", spaces);
    let group = format!("{control}_group");
    let node = rig.uid(control);
    let targets = spaces.iter().enumerate().map(|(i, space)| {
        let weight = Scalar::Choice { node, name: "space".into(), value: i as f32 };
        rig.kept(&group, space, weight)
    });
    let targets = targets.collect();
    rig.follow(&group, targets);
}

/// Chains of three nodes for IK and FK, and joints that follow both; the goal is what the IK reaches for.
fn limb(rig: &mut RigBuilder, name: &str, parent: [&str; 2], places: [Vec3; 4], goal: &str, pole: Vec3) {
    let frames = [along(places[0], places[1]), along(places[1], places[2]), along(places[2], places[3])];
    let parts = ["upper", "lower", "end"];
    let switch = format!("{name}_settings");
    rig.control(&switch, parent[0], at(places[3]));
    rig.attribute(&switch, "ik", 1.0, (0.0, 1.0));
    rig.attribute(&switch, "stretch", 0.0, (0.0, 1.0));
    rig.attribute(&switch, "soft", 0.0, (0.0, 1.0));
    rig.control(&format!("{name}_pole"), "root", at(pole));
    let (mut fk, mut ik, mut joint) = (parent[0].to_owned(), parent[0].to_owned(), parent[1].to_owned());
    let node = rig.uid(&switch);
    let mut chain = Vec::new();
    for (part, frame) in parts.into_iter().zip(frames) {
        let next = [format!("{name}_fk_{part}"), format!("{name}_ik_{part}"), format!("{name}_{part}")];
        rig.control(&next[0], &fk, frame);
        chain.push(rig.placed(&next[1], NULL, &ik, frame));
        rig.placed(&next[2], JOINT, &joint, frame);
        [fk, ik, joint] = next;
    }
    let end = rig.global(&format!("{name}_ik_end")).relative_to(&rig.global(goal)).rotation;
    rig.constrain(Constraint::TwoBone {
        root: chain[0],
        mid: chain[1],
        end: chain[2],
        goal: rig.uid(goal),
        pole: Some(rig.uid(&format!("{name}_pole"))),
        prefer: Vec3::Z,
        weight: Scalar::Value(1.0),
        soft: Scalar::Attribute { node, name: "soft".into(), factor: 0.1, add: 0.0 },
        stretch: Scalar::attribute(node, "stretch"),
        max_stretch: 2.0,
        twist: Scalar::Value(0.0),
        pin: Scalar::Value(0.0),
        orient_end: Some(end),
    });
    for part in parts {
        let label = format!("{name}_{part}");
        let targets = vec![
            rig.kept(&label, &format!("{name}_fk_{part}"), Scalar::inverse(node, "ik")),
            rig.kept(&label, &format!("{name}_ik_{part}"), Scalar::attribute(node, "ik")),
        ];
        rig.follow(&label, targets);
    }
    // Two twist joints on each bone.
    for (bone, source, reference) in [("upper", "upper", None), ("lower", "end", Some("lower"))] {
        let above = format!("{name}_{bone}");
        let (from, to) = if bone == "upper" { (places[0], places[1]) } else { (places[1], places[2]) };
        let mut driven = Vec::new();
        for i in 0..2 {
            let share = (i + 1) as f32 / 3.0;
            let place = Trs { translation: from.lerp(to, share), ..rig.global(&above) };
            let joint = rig.placed(&format!("{name}_{bone}_twist_{i}"), JOINT, &above, place);
            driven.push((joint, Scalar::Value(if bone == "upper" { share - 1.0 } else { share })));
        }
        rig.constrain(Constraint::Twist {
            source: rig.uid(&format!("{name}_{source}")),
            reference: reference.map(|reference| rig.uid(&format!("{name}_{reference}"))),
            axis: Vec3::Y,
            driven,
        });
    }
}

fn arm(rig: &mut RigBuilder, letter: &str, side: f32) {
    let name = format!("arm_{letter}");
    let place = |x: f32, y: f32, z: f32| Vec3::new(x * side, y, z);
    let clavicle = format!("clavicle_{letter}");
    let control = format!("clavicle_control_{letter}");
    rig.control(&control, "chest", along(place(0.03, 1.45, 0.0), place(0.18, 1.46, 0.0)));
    rig.placed(&clavicle, JOINT, "spine_5", rig.global(&control));
    let target = rig.kept(&clavicle, &control, Scalar::Value(1.0));
    rig.follow(&clavicle, vec![target]);
    let places = [place(0.18, 1.46, 0.0), place(0.45, 1.45, -0.03), place(0.7, 1.44, 0.0), place(0.8, 1.44, 0.0)];
    let goal = format!("{name}_goal");
    rig.control(&goal, "root", at(places[2]));
    space_switch(rig, &goal, &["root", "cog", "chest", "head_control"]);
    limb(rig, &name, [&control, &clavicle], places, &goal, place(0.45, 1.45, -0.6));
    space_switch(rig, &format!("{name}_pole"), &["root", &goal, "chest"]);
    let hand = format!("{name}_end");
    for finger in 0..5 {
        let mut above = (hand.clone(), hand.clone());
        for bone in 0..3 {
            let z = 0.04 - 0.02 * finger as f32;
            let from = places[2] + place(0.09 + 0.03 * bone as f32, 0.0, z);
            let frame = along(from, from + place(0.03, 0.0, 0.0));
            let next = (format!("finger_control_{letter}_{finger}_{bone}"), format!("finger_{letter}_{finger}_{bone}"));
            rig.control(&next.0, &above.0, frame);
            rig.placed(&next.1, JOINT, &above.1, frame);
            let target = rig.kept(&next.1, &next.0, Scalar::Value(1.0));
            rig.follow(&next.1, vec![target]);
            above = next;
        }
        let settings = format!("{name}_settings");
        let curl = format!("curl_{finger}");
        rig.attribute(&settings, &curl, 0.0, (-1.0, 1.0));
        let group = rig.uid(&format!("finger_control_{letter}_{finger}_1_group"));
        let driver = Scalar::Attribute { node: rig.uid(&settings), name: curl.into(), factor: 1.0, add: 0.0 };
        rig.constrain(Constraint::DrivenKey {
            driver,
            keys: vec![(-1.0, -20.0), (0.0, 0.0), (1.0, 90.0)],
            ease: KeyEase::Linear,
            output: Output::Channel(group, Channel::RotateX),
        });
    }
}

fn leg(rig: &mut RigBuilder, letter: &str, side: f32) {
    let name = format!("leg_{letter}");
    let place = |y: f32, z: f32| Vec3::new(0.1 * side, y, z);
    let places = [place(0.95, 0.0), place(0.5, 0.03), place(0.08, 0.0), place(0.02, 0.12)];
    let control = format!("{name}_goal");
    rig.control(&control, "root", at(places[2]));
    for (attribute, ends) in [("roll", (-90.0, 90.0)), ("bank", (-60.0, 60.0)), ("toes", (-60.0, 60.0))] {
        rig.attribute(&control, attribute, 0.0, ends);
    }
    let pivots = ["heel", "inner", "outer", "toe_tip", "ball"];
    let spots = [
        Vec3::new(0.1 * side, 0.0, -0.05),
        Vec3::new(0.06 * side, 0.0, 0.1),
        Vec3::new(0.14 * side, 0.0, 0.1),
        Vec3::new(0.1 * side, 0.0, 0.18),
        Vec3::new(0.1 * side, 0.02, 0.12),
    ];
    let mut above = control.clone();
    for (pivot, spot) in pivots.into_iter().zip(spots) {
        let label = format!("{name}_{pivot}");
        rig.node(&label, NULL, &above, spot);
        above = label;
    }
    rig.node(&format!("{name}_toes"), NULL, &format!("{name}_toe_tip"), spots[4]);
    let goal = format!("{name}_ankle");
    rig.node(&goal, NULL, &above, places[2]);
    let node = rig.uid(&control);
    let pivot = |rig: &RigBuilder, part: &str| rig.uid(&format!("{name}_{part}"));
    rig.constrain(Constraint::Foot {
        heel: pivot(rig, "heel"),
        toe: pivot(rig, "toe_tip"),
        ball: pivot(rig, "ball"),
        inner: Some(pivot(rig, "inner")),
        outer: Some(pivot(rig, "outer")),
        roll: Scalar::attribute(node, "roll"),
        break_angle: Scalar::Value(30.0),
        bank: Scalar::attribute(node, "bank"),
        toes: Some((pivot(rig, "toes"), Scalar::attribute(node, "toes"))),
        swivel: Scalar::Value(0.0),
    });
    limb(rig, &name, ["spine_control_0", "spine_0"], places, &goal, place(0.5, 0.8));
    space_switch(rig, &format!("{name}_pole"), &["root", &control, "cog"]);
    let toe = format!("{name}_toe");
    rig.control(&format!("{name}_toe_control"), &format!("{name}_fk_end"), at(places[3]));
    rig.node(&toe, JOINT, &format!("{name}_end"), places[3]);
    let settings = rig.uid(&format!("{name}_settings"));
    let targets = vec![
        rig.kept(&toe, &format!("{name}_toe_control"), Scalar::inverse(settings, "ik")),
        rig.kept(&toe, &format!("{name}_toes"), Scalar::attribute(settings, "ik")),
    ];
    rig.follow(&toe, targets);
}
