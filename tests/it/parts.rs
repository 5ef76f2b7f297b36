//! The templates that come with the crate: they stand as they rest, and move as an animator expects.

mod biped;
mod freedom;
mod library;
mod limbs;
mod machines;
mod off_parts;
mod switches;
mod trunk;

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use bevy::math::{Quat, Vec3};
use rigsmith::{
    files::BUNDLED_PARTS,
    mesh::model::Trs,
    modules,
    processor::{Builder, Modules, review},
    rig::{
        BuiltNode, BuiltRig, NodeType, PoseOffset, Rig, Uid, UidSource, feature,
        operations::{Operation, TagOperation},
        template::{UidStyle, format_template},
    },
    solve::program::{CompileOptions, RigProgram, RigState},
};

/// Every template with its path below `assets/templates`, sorted.
fn files() -> Vec<(String, PathBuf)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates");
    let mut list = Vec::new();
    for (prefix, folder) in [("", folder.clone()), ("parts/", folder.join("parts"))] {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if let Some(name) = name.strip_suffix(".rig.ron") {
                list.push((format!("{prefix}{name}"), path));
            }
        }
    }
    list.sort();
    assert!(list.len() > 10, "{list:?}");
    list
}

fn template(name: &str) -> Rig {
    crate::bench::shipped(name)
}

fn all_modules() -> Arc<Modules> {
    Arc::new(modules::all())
}

/// A built rig that can be posed.
struct Puppet {
    rig: Rig,
    built: BuiltRig,
    state: RigState,
}

impl Puppet {
    fn of(name: &str) -> Self {
        Self::new(template(name))
    }

    fn new(rig: Rig) -> Self {
        let built =
            Builder::build(&rig, &all_modules()).unwrap_or_else(|error| panic!("{}: {error}", rig.about().name));
        let program = RigProgram::compile(&built, &CompileOptions::default())
            .unwrap_or_else(|error| panic!("{}: {error}", rig.about().name));
        let mut state = RigState::new(Arc::new(program));
        state.evaluate(0.0);
        Self { rig, built, state }
    }

    /// The node of that kind and name; joints by their label.
    fn named(&self, kind: NodeType, name: &str) -> &BuiltNode {
        let is = |node: &&BuiltNode| {
            let by_label = node.origin.is_none() && node.label.as_deref() == Some(name);
            node.kind == kind && (by_label || node.origin.is_some() && *node.name == *name)
        };
        let mut found = self.built.nodes.iter().filter(is);
        let first = found.next().unwrap_or_else(|| {
            let names: Vec<&str> =
                self.built.nodes.iter().filter(|node| node.kind == kind).map(|node| &*node.name).collect();
            panic!("no {kind:?} is named {name}: {names:?}")
        });
        assert!(found.next().is_none(), "two nodes are named {name}");
        first
    }

    fn control(&self, name: &str) -> Uid {
        self.named(NodeType::Control, name).uid
    }

    fn joint(&self, label: &str) -> Uid {
        self.named(NodeType::Joint, label).uid
    }

    fn at(&self, node: Uid) -> Trs {
        self.state.global(node).unwrap()
    }

    /// Where a joint is.
    fn place(&self, label: &str) -> Vec3 {
        self.at(self.joint(label)).translation
    }

    /// A direction of a joint in the rig's space.
    fn axis(&self, label: &str, axis: Vec3) -> Vec3 {
        self.at(self.joint(label)).rotation * axis
    }

    /// Takes a control to a place in the rig's space.
    fn move_to(&mut self, name: &str, place: Vec3) {
        let uid = self.control(name);
        let slot = self.state.program().node(uid).unwrap();
        let offset = self.state.offset_at(slot);
        let now = self.at(uid);
        // What is posed comes after base and parent: now = unposed * offset.
        let turned = now.rotation * offset.rotation.inverse();
        let scale = now.scale / offset.scale;
        let by = turned.inverse() * (place - now.translation) / scale;
        let offset = PoseOffset { translation: offset.translation + by, ..offset };
        self.state.set_offset(uid, offset).unwrap();
        self.state.evaluate(0.0);
    }

    fn move_by(&mut self, name: &str, by: Vec3) {
        let place = self.at(self.control(name)).translation;
        self.move_to(name, place + by);
    }

    /// Turns a control about its own axes.
    fn turn(&mut self, name: &str, rotation: Quat) {
        let uid = self.control(name);
        let slot = self.state.program().node(uid).unwrap();
        let offset = PoseOffset { rotation, ..self.state.offset_at(slot) };
        self.state.set_offset(uid, offset).unwrap();
        self.state.evaluate(0.0);
    }

    fn set(&mut self, control: &str, attribute: &str, value: f32) {
        let uid = self.control(control);
        self.state.set_attribute(uid, attribute, value).unwrap();
        self.state.evaluate(0.0);
    }

    fn created(&self) -> usize {
        self.built.nodes.iter().filter(|node| node.origin.is_some()).count()
    }

    /// Largest distance of the document's joints from where they rest, as a share of the rig's height, their largest turn
    /// in degrees, and the joint's name.
    fn off_rest(&self) -> (f32, f32, String) {
        let places: Vec<Vec3> = self.rig.walk().map(|joint| self.rig.position(joint.data.uid)).collect();
        let (low, high) =
            places.iter().fold((Vec3::MAX, Vec3::MIN), |(low, high), place| (low.min(*place), high.max(*place)));
        let size = (high - low).max_element().max(1e-3);
        let (mut worst, mut angle, mut which) = (0.0_f32, 0.0_f32, String::new());
        for joint in self.rig.walk() {
            let (_, rotation, place) = self.rig.rest_global(joint.data.uid).to_scale_rotation_translation();
            let now = self.at(joint.data.uid);
            let between = rotation.conjugate() * now.rotation;
            let turned = 2.0 * between.xyz().length().atan2(between.w.abs()).to_degrees();
            let off = now.translation.distance(place) / size;
            if off > worst || turned > angle {
                which = joint.data.label.clone().unwrap_or_default();
            }
            (worst, angle) = (worst.max(off), angle.max(turned));
        }
        (worst, angle, which)
    }
}

/// Files as a person would write them: no uid, the layout of `rigsmith format`, and as many lines as one can read.
#[test]
fn files_are_written_by_people() {
    for (name, path) in files() {
        let text = std::fs::read_to_string(path).unwrap();
        assert_eq!(format_template(&text, UidStyle::Derived).unwrap(), text, "{name} has uids");
        assert!(format_template(&text, UidStyle::Kept).unwrap() == text, "{name}: `rigsmith format` it");
        // A hand has five fingers, each with its own controls, and a bird eight toes and a tail with limits of their own.
        let most = match name.as_str() {
            "biped" => 300,
            "parts/hand" => 600,
            "bird" => 620,
            _ => 550,
        };
        assert!(text.lines().count() <= most, "{name} has {} lines", text.lines().count());
    }
    // Every part comes with the program, so that a template finds it wherever it lies.
    let parts: Vec<String> =
        files().into_iter().filter_map(|(name, _)| Some(name.strip_prefix("parts/")?.to_owned())).collect();
    let bundled: Vec<&str> =
        BUNDLED_PARTS.iter().map(|(name, _)| &name["parts/".len()..name.len() - ".rig.ron".len()]).collect();
    assert_eq!(parts, bundled);
}

#[test]
fn every_template_is_without_problems_and_stands_as_it_rests() {
    for (name, _) in files() {
        let rig = template(&name);
        let problems = review(&rig, &all_modules());
        assert!(problems.is_empty(), "{name}: {problems:?}");
        assert!(rig.walk().any(|joint| !joint.data.tags.is_empty()), "{name} has no tags");
        let puppet = Puppet::new(rig);
        let (off, angle, which) = puppet.off_rest();
        assert!(off < 1e-4 && angle < 0.1, "{name}: {which} is off by {off} of the height and {angle} degrees");
    }
}

#[test]
fn every_template_builds_without_any_one_of_its_features() {
    for (name, _) in files() {
        let whole = template(&name);
        for combined in feature::combined_features(&whole) {
            // Each switch off; of a choice each one on in its turn.
            let switches = combined.switches.iter().map(|part| Some((part.name.clone(), !part.choice.is_empty())));
            for switch in switches.chain([None]) {
                let mut rig = whole.clone();
                let edits = match &switch {
                    Some((switch, is_on)) => feature::set_switch(&rig, &combined.key, switch, *is_on),
                    None => feature::set_feature(&rig, &combined.key, false),
                };
                for edit in edits.unwrap() {
                    rig.apply(&edit).unwrap();
                }
                let what = format!("{name} without {} {switch:?}", combined.key.name);
                let built = Builder::build(&rig, &all_modules());
                assert!(built.is_ok(), "{what}: {}", built.unwrap_err());
                let puppet = Puppet::new(rig);
                let (off, angle, which) = puppet.off_rest();
                assert!(off < 1e-4 && angle < 0.1, "{what}: {which} is off by {off} and {angle} degrees");
            }
        }
    }
}

/// Each part goes onto a chain of joints elsewhere: twice the size, turned about, and without labels.
#[test]
fn every_part_drops_onto_joints_elsewhere() {
    for (name, _) in files() {
        let Some(part) = name.strip_prefix("parts/") else { continue };
        let part_rig = template(&name);
        let mut uids = UidSource::seeded(7);
        let mut rig = Rig::new(uids.next_uid(), "elsewhere");
        let turn = Quat::from_rotation_y(0.7);
        let mut edits = Vec::new();
        let mut joints = Vec::new();
        let mut places = std::collections::HashMap::new();
        for joint in part_rig.walk() {
            let uid = uids.next_uid();
            places.insert(joint.data.uid, uid);
            let mut data = rigsmith::rig::JointData { uid, rest: joint.data.rest, ..Default::default() };
            data.rest.translation *= 2.0;
            if joint.parent.is_none() {
                data.rest.translation = turn * data.rest.translation + Vec3::new(3.0, 0.5, -1.0);
                data.rest.rotation = (turn * data.rest.rotation).normalize();
            }
            let parent = joint.parent.map(|parent| places[&parent]);
            edits.push(rigsmith::rig::RigEdit::AddJoint { joint: Box::new(data), parent, index: usize::MAX });
            joints.push(uid);
        }
        Operation::Edits(edits).run(&mut rig, &mut uids, None).unwrap();
        let drop = TagOperation::Drop { part: Arc::new(part_rig.into()), joints, bindings: Default::default() };
        let outcome = Operation::Tags(drop).run(&mut rig, &mut uids, None).unwrap();
        assert!(outcome.notes.is_empty(), "{part}: {:?}", outcome.notes);
        let puppet = Puppet::new(rig);
        let (off, angle, which) = puppet.off_rest();
        assert!(off < 1e-4 && angle < 0.1, "{part}: {which} is off by {off} and {angle} degrees");
        assert_eq!(puppet.created(), Puppet::of(&name).created(), "{part}");
    }
}

/// Prints what each template is made of; a table for the documentation.
#[test]
fn templates_build_the_same_every_time() {
    let modules = all_modules();
    for (name, _) in files() {
        let rig = template(&name);
        let [built, other] = [0; 2].map(|_| Builder::build(&rig, &modules).unwrap());
        assert!(built == other, "{name} differs from build to build");
        let created = built.nodes.iter().filter(|node| node.origin.is_some()).count();
        let deform = built.nodes.iter().filter(|node| node.kind == NodeType::Joint).count();
        let controls = built.nodes.iter().filter(|node| node.kind == NodeType::Control).count();
        println!(
            "{name}: {deform} joints, {created} created nodes, {controls} controls, {} constraints",
            built.constraints.len()
        );
    }
}
