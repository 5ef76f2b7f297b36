//! Target of a gizmo: its joints, its position and its parts.

use bevy::prelude::*;

use super::one_side;
use crate::{
    editor::{
        mode::Mode,
        settings::GizmoSpace,
        tools::{
            gizmo::{GizmoFrame, GizmoParts},
            pose::own_axes,
            scene::Scene,
        },
    },
    rig::Uid,
    solve::pull::is_within_limb,
};

/// Gizmo of the current selection.
#[derive(Debug, Clone, PartialEq)]
pub struct GizmoTarget {
    /// The joints that it moves.
    pub joints: Vec<Uid>,
    /// Position and axes of the gizmo.
    pub frame: GizmoFrame,
    /// Parts of the gizmo.
    pub parts: GizmoParts,
}

impl GizmoTarget {
    /// The gizmo of a mode; `None` in modes without one, and without a selection. `moves` shows arrows in Pose mode for
    /// every joint.
    pub fn new(mode: Mode, space: GizmoSpace, moves: bool, scene: &Scene) -> Option<Self> {
        let mut parts = GizmoParts::default();
        match mode {
            Mode::Move => parts.moves = true,
            Mode::Rotate => parts.turns = true,
            Mode::Scale => parts.scales = true,
            Mode::Pose => parts.turns = true,
            Mode::Select | Mode::Place | Mode::Stroke | Mode::Weights | Mode::Paint => return None,
        }
        let (rig, sight) = (scene.rig()?, scene.sight()?);
        let joints = one_side(&rig, mode == Mode::Pose, rig.symmetry.0.as_ref());
        let active = rig.selection.active().filter(|active| joints.contains(active)).or(joints.last().copied())?;
        if mode == Mode::Pose {
            let joint = rig.rig.joint(active);
            let control = rig.built_node(active).and_then(|node| node.control.as_ref());
            let channels = control.map(|control| control.channels);
            let is_root = joint.is_some_and(|joint| joint.parent.is_none());
            // Handles of a joint that its controls hold would set poses that nobody sees, and be in the way of a pull.
            let is_free = channels.is_some() || !rig.is_overridden(active);
            parts.moves = match channels {
                Some(channels) => channels.translate.contains(&true),
                None => (moves || is_root) && (is_free || is_within_limb(&rig.rig, active)),
            };
            parts.turns = channels.map_or(is_free, |channels| channels.rotate.contains(&true));
        }
        let own = if mode == Mode::Pose { rig.posed_global(active) } else { rig.rig.rest_global(active) };
        let origin = if mode == Mode::Pose || space == GizmoSpace::Local {
            own.translation
        } else {
            joints.iter().map(|joint| rig.rig.position(*joint)).sum::<Vec3>() / joints.len() as f32
        };
        let axes = match space {
            GizmoSpace::Local => own_axes(&own),
            GizmoSpace::View => [sight.plane.right, sight.plane.up, sight.plane.towards()],
            GizmoSpace::World => {
                let to_rig = rig.place.affine().inverse().matrix3;
                own_axes(&bevy::math::Affine3 { matrix3: to_rig.into(), translation: Vec3::ZERO })
            }
        };
        Some(Self { joints, frame: GizmoFrame { origin, axes }, parts })
    }
}
