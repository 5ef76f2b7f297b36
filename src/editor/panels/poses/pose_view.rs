//! The pose that the window shows, and what people do to it.

use std::collections::BTreeSet;

use bevy::prelude::*;

use crate::{
    plugins::{
        animation::ClipPlayer,
        commands::BuildResult,
        document::{JointEntities, Selection, Symmetry},
        runtime::RigRuntime,
    },
    rig::{
        BuiltRig, PoseOffset, Rig, Uid,
        animation::{Property, RigClip},
        operations::{MirrorPlane, Operation, WholePose},
    },
};

/// Largest difference by which a shown offset is still that of the document: transforms of entities are rounded.
const ROUNDING: f32 = 2e-6;

/// The rig that is posed, with the pose that is shown: that of the document, or of a clip and what is posed on top of it.
pub(in crate::editor) struct PosedRig<'w> {
    /// Entity of the rig.
    pub entity: Entity,
    /// The document.
    pub rig: &'w Rig,
    /// Result of its commands.
    pub built: Option<&'w BuiltRig>,
    /// Pose that is shown.
    pub shown: WholePose,
    /// True while a clip is shown.
    pub is_clip: bool,
    selected: &'w [Uid],
    symmetry: Option<MirrorPlane>,
}

impl<'w> PosedRig<'w> {
    /// The rig of an entity; `None` if it is none.
    pub fn of(world: &'w World, entity: Entity) -> Option<Self> {
        let rig = world.get::<Rig>(entity)?;
        let is_clip = world.get::<ClipPlayer>(entity).is_some();
        Some(Self {
            entity,
            rig,
            built: world.get::<BuildResult>(entity).map(|built| &*built.0),
            shown: if is_clip { of_clip(world, entity, rig) } else { WholePose::of(rig) },
            is_clip,
            selected: world.get::<Selection>(entity).map_or(&[], |selection| &selection.0),
            symmetry: world.get::<Symmetry>(entity).and_then(|symmetry| symmetry.0),
        })
    }

    /// True if a node is posed, or an attribute of it has a value.
    pub fn is_posed(&self, node: Uid) -> bool {
        self.shown.offsets.contains_key(&node) || self.shown.values.contains_key(&node)
    }

    /// The selected nodes and, with live mirroring, those on the other side.
    pub fn meant(&self) -> BTreeSet<Uid> {
        let mut nodes: BTreeSet<Uid> = self.selected.iter().copied().collect();
        if self.symmetry.is_some() {
            nodes.extend(self.other_side());
        }
        nodes
    }

    /// Nodes on the other side of the selected ones.
    pub fn other_side(&self) -> BTreeSet<Uid> {
        WholePose::other_side(&self.selected.iter().copied().collect(), self.rig, self.built)
    }

    /// Mirror image of a pose.
    pub fn mirrored(&self, pose: &WholePose) -> WholePose {
        let plane = self.symmetry.unwrap_or_else(|| MirrorPlane::sagittal(1.0));
        pose.mirrored(self.rig, self.built, &plane)
    }

    /// Operation that shows another pose, on some nodes or on all.
    pub fn change_to(&self, pose: &WholePose, nodes: Option<&BTreeSet<Uid>>, name: &'static str) -> Operation {
        self.shown.change_to(pose, nodes, name)
    }

    /// Operation that resets the selected nodes, or all.
    pub fn reset(&self, all: bool) -> Operation {
        match (self.is_clip, all) {
            (false, true) => Operation::ResetPose(Vec::new()),
            (false, false) => Operation::ResetPose(self.selected.to_vec()),
            (true, _) => {
                let nodes = (!all).then(|| self.meant());
                self.change_to(&WholePose::default(), nodes.as_ref(), "Reset pose")
            }
        }
    }

    /// Operation that resets a node.
    pub fn reset_of(&self, node: Uid) -> Operation {
        if self.is_clip {
            self.change_to(&WholePose::default(), Some(&BTreeSet::from([node])), "Reset pose")
        } else {
            Operation::ResetPose(vec![node])
        }
    }

    /// Operation that puts the mirror image of the selected nodes onto the other side; `None` if they have no other side.
    pub fn mirror_selected(&self) -> Option<Operation> {
        let nodes = self.other_side();
        (!nodes.is_empty()).then(|| self.change_to(&self.mirrored(&self.shown), Some(&nodes), "Mirror pose"))
    }

    /// Operation that swaps the sides of the whole pose.
    pub fn flip(&self) -> Operation {
        self.change_to(&self.mirrored(&self.shown), None, "Flip pose")
    }

    /// Operation that stores what is shown under a name.
    pub fn store(&self, name: String) -> Operation {
        if self.is_clip {
            Operation::StoreShown(name, Box::new(self.shown.clone()))
        } else {
            Operation::StorePose(name)
        }
    }

    /// The shown pose with the values of a clip at a second.
    pub fn at(&self, clip: &RigClip, time: f32) -> WholePose {
        let mut pose = self.shown.clone();
        put_clip(&mut pose, clip, time);
        pose
    }
}

/// Puts the values of a clip at a second into a pose.
pub(in crate::editor) fn put_clip(pose: &mut WholePose, clip: &RigClip, time: f32) {
    let targets: BTreeSet<_> = clip.layers.iter().flat_map(|layer| layer.tracks.keys()).collect();
    for target in targets {
        let Some(value) = clip.value(target, time) else { continue };
        let vector = Vec3::new(value[0], value[1], value[2]);
        let mut offset = pose.offsets.get(&target.node).copied().unwrap_or_default();
        match &target.property {
            Property::Translation => offset.translation = vector,
            Property::Rotation => offset.rotation = Quat::from_array(value),
            Property::Scale => offset.scale = vector,
            Property::Attribute(name) => {
                pose.values.entry(target.node).or_default().insert(name.clone(), value[0]);
                continue;
            }
        }
        if offset == PoseOffset::IDENTITY {
            pose.offsets.remove(&target.node);
        } else {
            pose.offsets.insert(target.node, offset);
        }
    }
}

/// Pose of a rig that shows a clip: that of its running program, or of the entities of its joints.
fn of_clip(world: &World, entity: Entity, rig: &Rig) -> WholePose {
    let mut pose = WholePose::of(rig);
    let mut put = |node: Uid, offset: PoseOffset| {
        let own = rig.offset(node).copied().unwrap_or_default();
        let offset = if is_near(&own, &offset) { own } else { offset };
        if offset == PoseOffset::IDENTITY {
            pose.offsets.remove(&node);
        } else {
            pose.offsets.insert(node, offset);
        }
    };
    if let Some(runtime) = world.get::<RigRuntime>(entity) {
        let state = runtime.state();
        for (slot, node) in state.program().nodes().iter().enumerate().filter(|(_, node)| node.is_posable()) {
            put(node.uid, state.offset_at(slot));
        }
        for (slot, attribute) in state.program().attributes().iter().enumerate().filter(|(_, known)| known.is_settable)
        {
            let (node, value) = (state.program().nodes()[attribute.node].uid, state.attribute_at(slot));
            let name = attribute.name.to_string();
            if value != attribute.default || rig.attribute_value(node, &name).is_some() {
                pose.values.entry(node).or_default().insert(name, value);
            }
        }
    } else if let Some(entities) = world.get::<JointEntities>(entity) {
        for joint in rig.walk() {
            let shown = entities.get(joint.data.uid).and_then(|entity| world.get::<Transform>(entity));
            if let Some(shown) = shown {
                put(joint.data.uid, PoseOffset::between(&joint.data.rest, shown));
            }
        }
    }
    pose
}

fn is_near(a: &PoseOffset, b: &PoseOffset) -> bool {
    let near = |a: Vec3, b: Vec3| (a - b).abs().max_element() <= ROUNDING * a.abs().max_element().max(1.0);
    let aim = if a.rotation.dot(b.rotation) < 0.0 { -b.rotation } else { b.rotation };
    near(a.translation, b.translation) && near(a.scale, b.scale) && (a.rotation - aim).length() <= 2.0 * ROUNDING
}
