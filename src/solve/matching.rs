//! Switch matching: edits that throw a switch of a posed rig without a visible jump.
//!
//! A limb between forward and inverse kinematics keeps its joints: the controls of the new side are posed so that they
//! hold the joints in place. A control between spaces keeps its place: its offset makes up for the change of space. All
//! edits are tried on a copy of the instance, so that everything else that moves the controls (parents, other
//! constraints, softness) is taken into account, and the remaining jump is measured.

mod followers;
mod limb;
mod range;

use crate::{
    mesh::model::Trs,
    rig::{BuiltRig, Matching, PoseOffset, RigEdit, Scalar, SwitchData, Uid},
    solve::program::{RigState, StateError},
};

pub use range::{SwitchNote, SwitchOverError, SwitchRange, SwitchedRange, match_switch_over, tolerance_of};

/// Error of matching a switch.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MatchError {
    /// The switch names a node that is not built.
    #[error("node {0}, which the switch matches, is not in the built rig; build the rig again")]
    NoNode(Uid),
    /// The instance refuses the pose.
    #[error(transparent)]
    State(#[from] StateError),
}

/// Edits that throw a switch, and the remaining jump.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MatchedSwitch {
    /// The edits, as one step: poses of controls, and the value of the attribute.
    pub edits: Vec<RigEdit>,
    /// Largest distance that a matched node moved, in the rig's units. A value above about 1e-4 of a limb's length
    /// means that something, such as a limit, keeps the controls from their matched poses.
    pub distance: f32,
    /// Largest angle that a matched node turned by, in degrees.
    pub angle: f32,
}

/// The edits that set the attribute of a switch to `value` while the matched nodes stay where `state` has them.
///
/// `state` is an instance of the rig in its current pose, compiled so that all controls can be posed; it is not
/// changed. Costs some tens of evaluations of the operations that depend on the controls.
///
/// # Errors
/// [`MatchError`] if the program lacks a node or an attribute of the switch.
pub fn match_switch(
    rig: &BuiltRig,
    state: &RigState,
    switch: &SwitchData,
    value: f32,
) -> Result<MatchedSwitch, MatchError> {
    let mut state = state.clone();
    state.evaluate(0.0);
    let mut attempt = Attempt { rig, state, offsets: Vec::new() };
    let kept = match &switch.matching {
        Matching::IkFk { joints, fk, goal, goal_offset, pole, held } => {
            let limb = limb::Limb { joints, fk, goal: *goal, goal_offset: *goal_offset, pole: *pole, held };
            throw_limb(&mut attempt, &limb, switch, value)?
        }
        Matching::Space { control } => {
            let wanted = attempt.global(*control)?;
            attempt.state.set_attribute(switch.control, &switch.attribute, value)?;
            attempt.place(*control, &wanted, None)?;
            vec![(*control, wanted)]
        }
    };
    let value = attempt.state.attribute(switch.control, &switch.attribute).unwrap_or(value);
    let mut thrown = MatchedSwitch::default();
    for (node, wanted) in kept {
        let now = attempt.global(node)?;
        thrown.distance = thrown.distance.max(now.translation.distance(wanted.translation));
        thrown.angle = thrown.angle.max(angle_between(&now, &wanted));
    }
    for (node, offset) in attempt.offsets {
        thrown.edits.push(RigEdit::SetOffset(node, Some(offset)));
    }
    thrown.edits.push(RigEdit::SetAttributeValue(switch.control, switch.attribute.to_string(), Some(value)));
    Ok(thrown)
}

/// Poses both the forward and the inverse controls of a limb so that its joints have the rig transforms `wanted`, whichever of
/// the two holds the limb with the switch at `value`.
///
/// # Errors
/// [`MatchError`] if the program lacks a node or an attribute of the switch.
pub(super) fn hold_limb(
    rig: &BuiltRig,
    state: RigState,
    switch: &SwitchData,
    wanted: &[Trs],
    value: f32,
) -> Result<RigState, MatchError> {
    let Matching::IkFk { joints, fk, goal, goal_offset, pole, held } = &switch.matching else { return Ok(state) };
    let limb = limb::Limb { joints, fk, goal: *goal, goal_offset: *goal_offset, pole: *pole, held };
    let mut attempt = Attempt { rig, state, offsets: Vec::new() };
    let above = limb.above(&mut attempt)?;
    attempt.state.set_attribute(switch.control, &switch.attribute, 1.0)?;
    limb.hold(&mut attempt, wanted, &above, [1.0, 1.0])?;
    attempt.state.set_attribute(switch.control, &switch.attribute, value)?;
    // A control above the limb that follows the goal stands elsewhere where the goal has less of an effect.
    if !limb.is_above_held(&mut attempt, &above)? {
        limb.hold(&mut attempt, wanted, &above, [value, value])?;
    }
    attempt.state.evaluate(0.0);
    Ok(attempt.state)
}

/// Throws the switch of a limb and poses controls so that the limb, and the joints behind it that the switch weighs, stay;
/// returns these joints with their former rig transforms.
fn throw_limb(
    attempt: &mut Attempt<'_>,
    limb: &limb::Limb<'_>,
    switch: &SwitchData,
    value: f32,
) -> Result<Vec<(Uid, Trs)>, MatchError> {
    let before = attempt.state.attribute(switch.control, &switch.attribute).unwrap_or_default();
    let wanted = limb.joints.iter().map(|node| attempt.global(*node)).collect::<Result<Vec<Trs>, _>>()?;
    let length: f32 = wanted.windows(2).map(|pair| pair[0].translation.distance(pair[1].translation)).sum();
    let followers = followers::followers(attempt, switch, limb, 1e-4 * length);
    let above = limb.above(attempt)?;
    let behind = followers.iter().map(|of| attempt.global(of.joint)).collect::<Result<Vec<Trs>, _>>()?;
    attempt.state.set_attribute(switch.control, &switch.attribute, value)?;
    let value = attempt.state.attribute(switch.control, &switch.attribute).unwrap_or(value);
    // A goal may hang below the control that turns a joint behind the limb, and such a control below one of the limb.
    for (follower, wanted) in followers.iter().zip(&behind) {
        follower.hold(attempt, wanted, length)?;
    }
    limb.hold(attempt, &wanted, &above, [before, value])?;
    for (follower, wanted) in followers.iter().zip(&behind) {
        follower.hold(attempt, wanted, length)?;
    }
    let of_limb = limb.joints.iter().copied().zip(wanted);
    let of_limb = of_limb.chain(limb.held.iter().copied().zip(above));
    Ok(of_limb.chain(followers.iter().map(|follower| follower.joint).zip(behind)).collect())
}

/// Current value of a scalar.
fn number(attempt: &Attempt<'_>, scalar: &Scalar) -> f32 {
    match scalar {
        Scalar::Value(value) => *value,
        Scalar::Attribute { node, name, factor, add } => {
            factor * attempt.state.attribute(*node, name).unwrap_or_default() + add
        }
        Scalar::Choice { .. } | Scalar::Channel { .. } => 0.0,
    }
}

/// Angle between two rotations in degrees. It is computed from the vector part: the dot product of two quaternions has
/// no digits left for small angles.
pub(super) fn angle_between(a: &Trs, b: &Trs) -> f32 {
    let between = a.rotation.conjugate() * b.rotation;
    2.0 * bevy::math::ops::atan2(between.xyz().length(), between.w.abs()).to_degrees()
}

/// The offset that brings a node to the place and the rotation of `wanted`; its scale stays. `now` is its rig transform with
/// the offset that it has.
pub(super) fn offset_towards(now: &Trs, offset: &PoseOffset, wanted: &Trs) -> PoseOffset {
    // Rig transform of the node without its pose: now = unposed * offset.
    let turned = (now.rotation * offset.rotation.conjugate()).normalize();
    let divided = |a: f32, b: f32| if b == 0.0 { a } else { a / b };
    let scale = |a: glam::Vec3, b: glam::Vec3| glam::Vec3::new(divided(a.x, b.x), divided(a.y, b.y), divided(a.z, b.z));
    let unposed = scale(now.scale, offset.scale);
    let origin = now.translation - turned * (unposed * offset.translation);
    PoseOffset {
        translation: scale(turned.conjugate() * (wanted.translation - origin), unposed),
        rotation: (turned.conjugate() * wanted.rotation).normalize(),
        scale: offset.scale,
    }
}

/// A copy of an instance on which poses are tried.
struct Attempt<'a> {
    rig: &'a BuiltRig,
    state: RigState,
    /// Offsets of the changed nodes, each node once, in the order of their first change.
    offsets: Vec<(Uid, PoseOffset)>,
}

impl Attempt<'_> {
    fn global(&mut self, node: Uid) -> Result<Trs, MatchError> {
        self.state.evaluate(0.0);
        self.state.global(node).ok_or(MatchError::NoNode(node))
    }

    fn offset(&self, node: Uid) -> PoseOffset {
        self.state.program().node(node).map_or(PoseOffset::IDENTITY, |slot| self.state.offset_at(slot))
    }

    fn set(&mut self, node: Uid, offset: PoseOffset) -> Result<(), MatchError> {
        self.state.set_offset(node, offset)?;
        match self.offsets.iter_mut().find(|(known, _)| *known == node) {
            Some((_, known)) => *known = offset,
            None => self.offsets.push((node, offset)),
        }
        Ok(())
    }

    /// Poses a node so that its rig transform is `wanted`; its scale stays. With `rotate_only`, its position stays,
    /// too, unless it would be off by more than that distance.
    fn place(&mut self, node: Uid, wanted: &Trs, rotate_only: Option<f32>) -> Result<(), MatchError> {
        // Constraints and other drivers of the node are compensated in further rounds.
        for round in 0..3 {
            let now = self.global(node)?;
            let near = now.translation.distance(wanted.translation) <= 1e-6 * wanted.translation.length().max(1e-3);
            if round > 0 && near && angle_between(&now, wanted) < 1e-3 {
                break;
            }
            let offset = self.offset(node);
            let mut next = offset_towards(&now, &offset, wanted);
            let off = (next.translation - offset.translation) * (now.scale / offset.scale);
            if rotate_only.is_some_and(|most| off.length() <= most) {
                next.translation = offset.translation;
            }
            self.set(node, next)?;
        }
        Ok(())
    }

    /// The node itself or the nearest posable node above it; the node itself if there is none.
    fn handle(&self, node: Uid) -> Uid {
        let index = self.rig.nodes.iter().position(|known| known.uid == node);
        let mut at = index;
        while let Some(here) = at.map(|at| &self.rig.nodes[at]) {
            if here.control.is_some() || here.kind == crate::rig::NodeType::Control {
                return here.uid;
            }
            at = here.parent;
        }
        node
    }

    /// Poses the nearest posable node so that `node`, which it carries, has the rig transform `wanted`.
    fn place_carried(&mut self, node: Uid, wanted: &Trs) -> Result<(), MatchError> {
        let handle = self.handle(node);
        if handle == node {
            return self.place(node, wanted, None);
        }
        let carried = self.global(node)?.relative_to(&self.global(handle)?);
        let scale = self.global(handle)?.scale;
        let rotation = (wanted.rotation * carried.rotation.conjugate()).normalize();
        let translation = wanted.translation - rotation * (scale * carried.translation);
        self.place(handle, &Trs { translation, rotation, scale }, None)
    }

    /// Rig transform of a node as built.
    fn built(&self, node: Uid) -> Option<Trs> {
        let mut at = self.rig.nodes.iter().position(|known| known.uid == node)?;
        let mut global = self.rig.nodes[at].base;
        while let Some(parent) = self.rig.nodes[at].parent {
            global = self.rig.nodes[parent].base * global;
            at = parent;
        }
        Some(global)
    }
}
