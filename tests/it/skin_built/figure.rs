//! The biped in a body: its joints where they truly are, built, and the body bound to it.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use bevy::math::{Affine3, Affine3A, Quat, Vec3};
use rigsmith::{
    algo::weights::WeightSettings,
    files::{RealDisk, load_model},
    headless::Workbench,
    mesh::{
        model::{Model, Trs},
        skinning::skin_points,
    },
    modules,
    processor::Builder,
    rig::{
        BuiltRig, NodeType, PoseOffset, Rig, RigEdit, SkinData, Uid,
        deform::DeformSkeleton,
        feature::{features_named, set_feature},
    },
    solve::program::{CompileOptions, RigProgram, RigState},
};

use crate::prerequisites::test_data;

/// Bones of the `game_engine` rig whose names differ from the template's labels.
const NAMES: [(&str, &str); 10] = [
    ("hips", "pelvis"),
    ("spine", "spine_01"),
    ("spine_1", "spine_02"),
    ("chest", "spine_03"),
    ("neck", "neck_01"),
    ("upper_arm_", "upperarm_"),
    ("forearm_", "lowerarm_"),
    ("shin_", "calf_"),
    ("toe_", "ball_"),
    ("", ""),
];

/// A body bound to the built biped.
pub struct Figure {
    pub name: String,
    pub rig: Rig,
    pub built: Arc<BuiltRig>,
    pub model: Model,
    pub triangles: Vec<[u32; 3]>,
    pub skin: SkinData,
}

fn asset(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets").join(path)
}

fn biped() -> Rig {
    crate::bench::shipped("biped")
}

impl Figure {
    /// The bundled character, as the template stands.
    pub fn bundled() -> Self {
        Self::new("biped", biped(), load_model(&RealDisk, &asset("models/biped.obj")).unwrap())
    }

    /// A body with the biped at its true joints; `None` without test data.
    pub fn body(name: &str) -> Option<Self> {
        let folder = test_data()?.join("bodies").join(name);
        let json: serde_json::Value =
            serde_json::from_slice(&std::fs::read(folder.join("joints.json")).unwrap()).unwrap();
        let mut rig = biped();
        place(&mut rig, &json["game_engine"]);
        Some(Self::new(name, rig, load_model(&RealDisk, &folder.join("body.obj")).unwrap()))
    }

    fn new(name: &str, rig: Rig, model: Model) -> Self {
        let built = Arc::new(Builder::build(&rig, &Arc::new(modules::all())).unwrap());
        let triangles = model.point_triangles();
        let mut figure = Self { name: name.to_owned(), rig, built, model, triangles, skin: SkinData::default() };
        let mut bench = figure.bench(Some(&figure.built));
        bench.skin(WeightSettings::default(), Vec::new(), &mut |_| {}).unwrap();
        figure.skin = bench.weights().unwrap().clone();
        // Binding sets lengths in commands.
        figure.rig = bench.rig().clone();
        figure.built = Arc::new(Builder::build(&figure.rig, &Arc::new(modules::all())).unwrap());
        figure
    }

    /// The same with the features of a name off.
    pub fn without(self, feature: &str) -> Self {
        let mut rig = self.rig;
        for feature in features_named(&rig, feature).unwrap() {
            for edit in set_feature(&rig, &feature.key, false).unwrap() {
                rig.apply(&edit).unwrap();
            }
        }
        Self::new(&self.name, rig, self.model)
    }

    /// A workbench with the rig and the mesh.
    pub fn bench(&self, built: Option<&Arc<BuiltRig>>) -> Workbench {
        let mut bench = Workbench::with_rig(1, self.rig.clone());
        if let Some(built) = built {
            bench.set_built(built.clone());
        }
        bench.open(self.model.clone(), true).unwrap();
        bench
    }

    /// Weights as the plugins compute them.
    pub fn skinned(&self, built: Option<&Arc<BuiltRig>>) -> SkinData {
        let mut bench = self.bench(built);
        bench.skin(WeightSettings::default(), Vec::new(), &mut |_| {}).unwrap();
        bench.weights().unwrap().clone()
    }

    pub fn joint(&self, label: &str) -> Uid {
        self.rig.find_label(label).unwrap()
    }

    /// Where a joint rests.
    pub fn at(&self, label: &str) -> Vec3 {
        self.rig.position(self.joint(label))
    }

    /// The control of that name.
    pub fn control(&self, name: &str) -> Uid {
        let named = |node: &&rigsmith::rig::BuiltNode| node.kind == NodeType::Control && &*node.name == name;
        self.built.nodes.iter().find(named).unwrap_or_else(|| panic!("there is no control {name}")).uid
    }

    /// The weight of a joint at a point.
    pub fn weight(&self, skin: &SkinData, point: usize, joint: Uid) -> f32 {
        skin.weights.of(point).filter(|(number, _)| skin.joints[*number as usize] == joint).map(|(_, w)| w).sum()
    }

    /// The rig at rest, ready to be posed.
    pub fn state(&self) -> RigState {
        let program = RigProgram::compile(&self.built, &CompileOptions::default()).unwrap();
        let mut state = RigState::new(Arc::new(program));
        state.evaluate(0.0);
        state
    }

    /// The matrices from rest to pose of the joints that the weights name.
    pub fn matrices(&self, state: &RigState) -> Vec<Affine3A> {
        let skeleton = DeformSkeleton::new(&self.rig, Some(&self.built));
        let matrix = |uid: &Uid| {
            let rest = Affine3A::from(skeleton.joints()[skeleton.index(*uid).unwrap()].rest);
            state.global(*uid).unwrap().affine() * rest.inverse()
        };
        self.skin.joints.iter().map(matrix).collect()
    }

    /// The points as a pose moves them.
    pub fn posed(&self, state: &RigState) -> Vec<Vec3> {
        let mut points = Vec::new();
        skin_points(&self.model.points, &self.skin.weights, &self.matrices(state), &mut points);
        points
    }
}

/// Moves a control by a rigid motion of the rig's space.
pub fn carry(state: &mut RigState, control: Uid, motion: Affine3A) {
    let now = state.global(control).unwrap();
    let (_, turn, _) = motion.to_scale_rotation_translation();
    let to = Trs { translation: motion.transform_point3(now.translation), rotation: turn * now.rotation, ..now };
    // Controls that were not posed yet stand at what their offset is put on.
    let translation = now.rotation.inverse() * (to.translation - now.translation) / now.scale;
    let rotation = (now.rotation.inverse() * to.rotation).normalize();
    state.set_offset(control, PoseOffset { translation, rotation, scale: Vec3::ONE }).unwrap();
    state.evaluate(0.0);
    let off = state.global(control).unwrap().translation.distance(to.translation);
    assert!(off < 1e-4, "the control is off by {off}");
}

/// Puts the joints of the template at the heads of the bones, turned with the bones that lead on from them.
fn place(rig: &mut Rig, bones: &serde_json::Value) {
    let head = |label: &str| {
        let renamed = NAMES.iter().find(|(ours, _)| label == *ours || ours.ends_with('_') && label.starts_with(ours));
        let name = renamed.map_or(label.to_owned(), |(ours, theirs)| label.replacen(ours, theirs, 1));
        let bone = &bones[&name];
        let number = |axis: usize| bone["head"][axis].as_f64().unwrap_or_else(|| panic!("no bone {name}")) as f32;
        Vec3::new(number(0), number(1), number(2))
    };
    let mut globals: HashMap<Uid, Affine3> = HashMap::new();
    for joint in rig.walk() {
        let data = &joint.data;
        let label = data.label.as_deref().unwrap();
        let old = rig.rest_global(data.uid);
        // The main bone leads to the first joint in the middle of the children.
        let leading = match label {
            "hips" => Some("spine"),
            "chest" => Some("neck"),
            "hand_l" => Some("middle_01_l"),
            "hand_r" => Some("middle_01_r"),
            _ => None,
        };
        let child = leading.map(|label| rig.find_label(label).unwrap()).or_else(|| joint.children.first().copied());
        let turn = child.map_or_else(
            || {
                // Last joints turn with the joint before.
                let parent = joint.parent.unwrap();
                let before = rig.rest_global(parent).to_scale_rotation_translation().1;
                globals[&parent].to_scale_rotation_translation().1 * before.inverse()
            },
            |child| {
                let was = rig.position(child) - old.translation;
                let is = head(rig.joint(child).unwrap().data.label.as_deref().unwrap()) - head(label);
                Quat::from_rotation_arc(was.normalize(), is.normalize())
            },
        );
        let rotation = (turn * old.to_scale_rotation_translation().1).normalize();
        globals.insert(data.uid, Affine3A::from_rotation_translation(rotation, head(label)).into());
    }
    let joints: Vec<(Uid, Option<Uid>)> = rig.walk().map(|joint| (joint.data.uid, joint.parent)).collect();
    for (uid, parent) in joints {
        let rest = rig.local_rest(parent, &globals[&uid]);
        rig.apply(&RigEdit::SetRest(uid, rest)).unwrap();
    }
}
