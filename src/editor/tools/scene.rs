//! The edited rig, as tools read it.

use bevy::{
    ecs::system::SystemParam,
    math::{Affine3, Affine3A},
    prelude::*,
};

use crate::{
    editor::{ActiveRig, camera::ViewportSight, counts::counted},
    plugins::{
        animation::ClipPlayer,
        commands::BuildResult,
        document::{JointEntities, Selection, Symmetry},
        picking::posed_joints,
        runtime::RigRuntime,
        surface::{RigMeshes, RigSurface},
        viewport::Sight,
    },
    rig::{BuiltNode, PoseOffset, Rig, Uid},
    solve::program::RigState,
};

/// Cosine of half the angle from which on a node counts as turned.
const LEAST_TURN: f32 = 0.9999;

/// Access to the active rig and its view.
#[derive(SystemParam)]
pub struct Scene<'w, 's> {
    active: Option<Res<'w, ActiveRig>>,
    sight: Res<'w, ViewportSight>,
    rigs: Query<'w, 's, RigQuery>,
    joints: Query<'w, 's, &'static GlobalTransform>,
}

type RigQuery = (
    Ref<'static, Rig>,
    Ref<'static, Selection>,
    Ref<'static, Symmetry>,
    &'static JointEntities,
    &'static GlobalTransform,
    Option<Ref<'static, RigSurface>>,
    Has<RigMeshes>,
    Option<Ref<'static, RigRuntime>>,
    Option<&'static BuildResult>,
    Option<Ref<'static, ClipPlayer>>,
);

/// The active rig.
pub struct EditedRig<'a> {
    /// Entity of the rig.
    pub entity: Entity,
    /// The document.
    pub rig: Ref<'a, Rig>,
    /// Selection of the rig.
    pub selection: Ref<'a, Selection>,
    /// Live mirroring.
    pub symmetry: Ref<'a, Symmetry>,
    /// Entities of the joints.
    pub entities: &'a JointEntities,
    /// World transform of the rig.
    pub place: &'a GlobalTransform,
    /// Posed surface, if there is one yet.
    pub surface: Option<Ref<'a, RigSurface>>,
    /// Marks a rig with a mesh, even if its surface is still being built.
    pub has_mesh: bool,
    /// The running program of a built rig.
    pub runtime: Option<Ref<'a, RigRuntime>>,
    /// Result of its commands.
    pub built: Option<&'a BuildResult>,
    /// Playback of a clip.
    pub player: Option<Ref<'a, ClipPlayer>>,
    joints: &'a Query<'a, 'a, &'static GlobalTransform>,
}

impl Scene<'_, '_> {
    /// View of the viewport.
    pub fn sight(&self) -> Option<Sight> {
        self.sight.0
    }

    /// The active rig, if it exists.
    pub fn rig(&self) -> Option<EditedRig<'_>> {
        let entity = self.active.as_ref()?.0;
        let (rig, selection, symmetry, entities, place, surface, has_mesh, runtime, built, player) =
            self.rigs.get(entity).ok()?;
        let joints = &self.joints;
        Some(EditedRig {
            entity,
            rig,
            selection,
            symmetry,
            entities,
            place,
            surface,
            has_mesh,
            runtime,
            built,
            player,
            joints,
        })
    }

    /// Posed positions of a rig's joints, in the rig's space.
    pub fn posed(&self, rig: &EditedRig) -> Vec<(Uid, Vec3)> {
        posed_joints(&rig.rig, rig.entities, rig.place, &self.joints)
    }

    /// Returns `true` if the display of a tool may have to change: another rig, view, selection or surface.
    pub fn is_changed(&self) -> bool {
        let other = self.sight.is_changed() || self.active.as_ref().is_some_and(|active| active.is_changed());
        other
            || self.rig().is_some_and(|rig| {
                rig.rig.is_changed()
                    || rig.selection.is_changed()
                    || rig.symmetry.is_changed()
                    || rig.runtime.is_some_and(|runtime| runtime.is_changed())
                    || rig.player.is_some_and(|player| player.is_changed())
                    || rig.surface.is_some_and(|surface| surface.is_changed())
            })
    }
}

impl EditedRig<'_> {
    /// Name of a joint or created node for people: its label, its name, or the first digits of its uid.
    pub fn name(&self, node: Uid) -> String {
        match self.built_node(node).filter(|_| self.rig.joint(node).is_none()) {
            Some(created) => created.name.to_string(),
            None => joint_name(&self.rig, node),
        }
    }

    /// A node of the built rig.
    pub fn built_node(&self, node: Uid) -> Option<&BuiltNode> {
        self.built?.0.node(node)
    }

    /// The running state and the slot of a built node; `None` for a rig that is not built.
    pub fn built_slot(&self, node: Uid) -> Option<(&RigState, usize)> {
        let state = self.runtime.as_ref()?.state();
        Some((state, state.program().node(node)?))
    }

    /// True for a node of a built rig whose pose has no effect: constraints drive it, and it does not turn by itself.
    pub fn is_overridden(&self, node: Uid) -> bool {
        let Some((state, slot)) = self.built_slot(node) else { return false };
        if !state.program().nodes()[slot].is_driven {
            return false;
        }
        let mut tried = state.clone();
        tried.evaluate(0.0);
        let (offset, before) = (tried.offset_at(slot), tried.global_at(slot).rotation);
        let turn = Quat::from_xyzw(0.12, 0.14, 0.1, 1.0).normalize();
        // A hinge at its end turns one way alone.
        let has_turned = [turn, turn.inverse()].into_iter().any(|turn| {
            tried.set_offset_at(slot, PoseOffset { rotation: (offset.rotation * turn).normalize(), ..offset });
            tried.evaluate(0.0);
            tried.global_at(slot).rotation.dot(before).abs() < LEAST_TURN
        });
        !has_turned
    }

    /// Transform of a joint or created node as posed, in the rig's space.
    pub fn posed_global(&self, node: Uid) -> Affine3 {
        match self.built_slot(node) {
            Some((state, slot)) => state.global_at(slot).affine().into(),
            None => self.shown_global(node).map_or_else(|| self.rig.posed_global(node), Into::into),
        }
    }

    /// Transform of a joint in the rig's space as a clip shows it; `None` for rigs that are built, or that play no clip.
    fn shown_global(&self, joint: Uid) -> Option<Affine3A> {
        if self.player.is_none() || self.runtime.is_some() {
            return None;
        }
        let shown = self.joints.get(self.entities.get(joint)?).ok()?;
        Some(self.place.affine().inverse() * shown.affine())
    }

    /// Pose offset of a joint of a rig that is not built: as a clip shows it, or else that of the document.
    pub fn shown_offset(&self, joint: Uid) -> Option<PoseOffset> {
        let found = self.rig.joint(joint)?;
        let Some(shown) = self.shown_global(joint) else {
            return Some(self.rig.offset(joint).copied().unwrap_or_default());
        };
        let parent = found.parent.map_or(Some(Affine3A::IDENTITY), |parent| self.shown_global(parent))?;
        let local = GlobalTransform::from(parent.inverse() * shown).compute_transform();
        Some(PoseOffset::between(&found.data.rest, &local))
    }

    /// True for a joint of the document and for a node that commands created.
    pub fn has_node(&self, node: Uid) -> bool {
        self.rig.joint(node).is_some() || self.built_slot(node).is_some()
    }

    /// The joint on the other side; a central joint itself.
    pub fn other_side(&self, joint: Option<Uid>) -> Option<Uid> {
        joint.map(|joint| self.rig.joint(joint).and_then(|joint| joint.data.mirror).unwrap_or(joint))
    }

    /// Posed position of a point that rests below `parent`, in the rig's space.
    pub fn posed_below(&self, parent: Option<Uid>, rests: Vec3) -> Vec3 {
        let to_rest = self.rig.rest_from_pose(parent);
        if to_rest == Affine3::IDENTITY { rests } else { to_rest.inverse().transform_point3(rests) }
    }

    /// Size of the character in the rig's units: the longest side of its surface, or of its skeleton.
    pub fn size(&self) -> f32 {
        let [low, high] = self.bounds();
        (high - low).max_element()
    }

    /// Least and greatest corner of its surface, or of its skeleton at rest; a unit cube if there is neither.
    pub fn bounds(&self) -> [Vec3; 2] {
        if let Some(surface) = &self.surface {
            return surface.bounds();
        }
        let joints = self.rig.rest_globals();
        let bounds = joints.iter().fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], (_, joint)| {
            [low.min(joint.translation), high.max(joint.translation)]
        });
        let is_solid = (bounds[1] - bounds[0]).max_element() > 0.0;
        if is_solid { bounds } else { [Vec3::splat(-0.5), Vec3::splat(0.5)] }
    }
}

/// A joint's name for people: its label, or the first digits of its uid.
pub fn joint_name(rig: &Rig, joint: Uid) -> String {
    let label = rig.joint(joint).and_then(|joint| joint.data.label.clone());
    label.unwrap_or_else(|| format!("joint {:04x}", joint.0 >> 48))
}

/// `1 joint`, `2 joints`.
pub fn joints(count: usize) -> String {
    counted(count, "joint", "joints")
}
