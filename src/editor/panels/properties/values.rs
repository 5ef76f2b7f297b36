//! What the selected joints have in common, and the operations that change it.

use std::f32::consts::PI;

use bevy::{math::EulerRot, prelude::*};

use crate::{
    editor::panels::{
        fields::Shared,
        shown::{Shown, Stamp},
    },
    rig::{NodeKind, RestTransform, Rig, Uid, operations::Operation},
};

/// Values of the selected joints; positions in model units, angles in degrees.
#[derive(Debug, Default)]
pub(super) struct Values {
    made_from: Option<(Stamp, Stamp)>,
    /// The selected joints, the active one last.
    pub joints: Vec<Uid>,
    /// Empty for no label.
    pub label: Shared<String>,
    pub group: Shared<Option<Uid>>,
    pub kind: Shared<NodeKind>,
    pub locked: Shared<bool>,
    /// In the rig's space.
    pub position: [Shared<f32>; 3],
    /// Relative to the parent.
    pub local: [Shared<f32>; 3],
    /// Relative to the parent, degrees, turns about X, then the turned Y, then the turned Z.
    pub rotation: [Shared<f32>; 3],
    pub scale: [Shared<f32>; 3],
    /// From each joint to its children.
    pub lengths: Vec<f32>,
    /// The size of the rig, for the speed of drags.
    pub extent: f32,
    /// The angles as they were typed last, which say the same rotation as those computed from it.
    typed: Vec<(Uid, Vec3)>,
}

/// Which of a joint's vectors is edited.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Position,
    Local,
    Rotation,
    Scale,
}

impl Values {
    /// Reads them again if the rig or the selection changed.
    pub fn refresh(&mut self, shown: &Shown) {
        let key = (shown.stamp(), shown.selection_stamp());
        if self.made_from == Some(key) {
            return;
        }
        let typed = std::mem::take(&mut self.typed);
        *self = Self::of(&shown.rig, &shown.selection.0, typed).unwrap_or_default();
        self.made_from = Some(key);
    }

    fn of(rig: &Rig, selected: &[Uid], typed: Vec<(Uid, Vec3)>) -> Option<Self> {
        let known: Vec<_> = selected.iter().filter_map(|uid| rig.joint(*uid)).collect();
        let data = || known.iter().map(|joint| &joint.data);
        let globals: std::collections::HashMap<Uid, Vec3> =
            rig.rest_globals().into_iter().map(|(uid, global)| (uid, global.translation)).collect();
        let place = |uid: Uid| globals.get(&uid).copied().unwrap_or_default();
        let vector = |of: &dyn Fn(Uid, &RestTransform) -> Vec3| -> Option<[Shared<f32>; 3]> {
            let list: Vec<Vec3> = data().map(|joint| of(joint.uid, &joint.rest)).collect();
            let axis = |axis: usize| Shared::of(list.iter().map(|vector| vector[axis]));
            Some([axis(0)?, axis(1)?, axis(2)?])
        };
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for place in globals.values().filter(|place| place.is_finite()) {
            (low, high) = (low.min(*place), high.max(*place));
        }
        let lengths = known.iter().flat_map(|joint| {
            let head = place(joint.data.uid);
            joint.children.iter().map(move |child| (*child, head))
        });
        Some(Self {
            made_from: None,
            label: Shared::of(data().map(|joint| joint.label.clone().unwrap_or_default()))?,
            group: Shared::of(data().map(|joint| joint.group))?,
            kind: Shared::of(data().map(|joint| joint.kind))?,
            locked: Shared::of(data().map(|joint| joint.locked))?,
            position: vector(&|uid, _| place(uid))?,
            local: vector(&|_, rest| rest.translation)?,
            rotation: vector(&|uid, rest| angles(uid, rest.rotation, &typed))?,
            scale: vector(&|_, rest| rest.scale)?,
            lengths: lengths.map(|(child, head)| place(child).distance(head)).collect(),
            extent: (high - low).max_element().max(0.0),
            joints: data().map(|joint| joint.uid).collect(),
            typed,
        })
    }

    /// The operation that gives all selected joints a number on an axis of one of their vectors.
    pub fn set(&mut self, rig: &Rig, part: Part, axis: usize, number: f32, with_children: bool) -> Option<Operation> {
        if part == Part::Position {
            let to = self.joints.iter().map(|uid| {
                let mut place = rig.position(*uid);
                place[axis] = number;
                (*uid, place)
            });
            return Some(Operation::Move { to: to.collect(), with_children });
        }
        let mut to = Vec::with_capacity(self.joints.len());
        let mut typed = Vec::new();
        for uid in &self.joints {
            let mut rest = rig.joint(*uid)?.data.rest;
            match part {
                Part::Position => {}
                Part::Local => rest.translation[axis] = number,
                Part::Scale => rest.scale[axis] = number,
                Part::Rotation => {
                    let mut turned = angles(*uid, rest.rotation, &self.typed);
                    turned[axis] = number;
                    rest.rotation = rotation(turned);
                    typed.push((*uid, turned));
                }
            }
            to.push((*uid, rest));
        }
        if !typed.is_empty() {
            self.typed = typed;
        }
        Some(Operation::Rest { to, with_children })
    }

    /// How far a pixel of a drag goes.
    pub fn speed(&self) -> f64 {
        let extent = if self.extent.is_finite() && self.extent > 0.0 { self.extent } else { 1.0 };
        f64::from(extent) / 1000.0
    }
}

/// Angles in degrees; those that were typed, if they still say the same.
fn angles(uid: Uid, turned: Quat, typed: &[(Uid, Vec3)]) -> Vec3 {
    let known = typed.iter().find(|(joint, _)| *joint == uid).map(|(_, angles)| *angles);
    if let Some(known) = known.filter(|known| rotation(*known).dot(turned).abs() > 1.0 - 1e-6) {
        return known;
    }
    let (x, y, z) = turned.to_euler(EulerRot::XYZ);
    Vec3::new(x, y, z) * (180.0 / PI)
}

/// The rotation that angles in degrees say.
fn rotation(angles: Vec3) -> Quat {
    let [x, y, z] = (angles * (PI / 180.0)).to_array();
    Quat::from_euler(EulerRot::XYZ, x, y, z).normalize()
}
