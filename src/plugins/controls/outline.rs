//! Outlines of visible controls in the rig's space: drawn over the mesh, and hit by clicks.

use bevy::{ecs::system::SystemParam, math::Affine3A, prelude::*};

use super::{NodeVisible, density::CrowdedControl, size::ShapeFactor};
use crate::{
    algo::view::ViewPlane,
    plugins::schema::{Control, NodeLayer, RigNodes},
    rig::{ControlData, LayerDisplay, Uid, shapes::shape},
};

/// A visible control.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlOutline {
    /// Uid of the control.
    pub uid: Uid,
    /// Polylines of the control's shape, in the rig's space.
    pub lines: Vec<Vec<Vec3>>,
    /// sRGB colour, 0 to 1 each: the colour of the control's layer, or its own.
    pub color: [f32; 3],
    /// Display mode of the control's layer.
    pub display: LayerDisplay,
}

/// The controls of rigs.
#[derive(SystemParam)]
pub struct ControlNodes<'w, 's> {
    nodes: Query<'w, 's, Node>,
}

type Node = (
    &'static Uid,
    &'static Control,
    &'static GlobalTransform,
    Option<&'static NodeVisible>,
    Option<&'static NodeLayer>,
    Option<&'static ShapeFactor>,
    Option<&'static CrowdedControl>,
);

impl ControlNodes<'_, '_> {
    /// Visible controls of a rig but those that the view leaves out ([`CrowdedControl`]), in the order of its nodes. `to_rig`
    /// transforms world space to rig space.
    pub fn visible(&self, nodes: Option<&RigNodes>, to_rig: Affine3A) -> Vec<ControlOutline> {
        self.outlines(nodes, to_rig, false)
    }

    /// The controls of [`visible`](Self::visible) and those that the view leaves out.
    pub fn visible_near(&self, nodes: Option<&RigNodes>, to_rig: Affine3A) -> Vec<ControlOutline> {
        self.outlines(nodes, to_rig, true)
    }

    fn outlines(&self, nodes: Option<&RigNodes>, to_rig: Affine3A, with_crowded: bool) -> Vec<ControlOutline> {
        let controls = nodes.into_iter().flat_map(|nodes| nodes.iter()).filter_map(|node| self.nodes.get(node).ok());
        let visible = controls.filter(|(_, _, _, visible, _, _, crowded)| {
            visible.is_none_or(|visible| visible.0) && (with_crowded || crowded.is_none_or(|crowded| !crowded.0))
        });
        visible
            .map(|(uid, control, place, _, layer, factor, _)| ControlOutline {
                uid: *uid,
                lines: sized_lines(&control.0, to_rig * place.affine(), factor.map_or(1.0, |factor| factor.0)),
                color: layer.and_then(|layer| layer.0.color).unwrap_or(control.0.color),
                display: layer.map_or(LayerDisplay::Normal, |layer| layer.0.display),
            })
            .collect()
    }
}

/// Polylines of a control's shape, transformed by the control's `place`. A shape that is not in the library is a
/// circle.
pub fn lines_of(control: &ControlData, place: Affine3A) -> Vec<Vec<Vec3>> {
    sized_lines(control, place, 1.0)
}

/// Outline of a control whose shape is enlarged by a factor.
fn sized_lines(control: &ControlData, place: Affine3A, factor: f32) -> Vec<Vec<Vec3>> {
    let size = control.size * factor;
    let place = place * control.offset.affine();
    let lines = shape(&control.shape).or_else(|| shape("circle")).unwrap_or_default();
    let moved = |point: &Vec3| place.transform_point3(*point * size);
    lines.iter().map(|line| line.iter().map(moved).collect()).collect()
}

/// The control whose outline passes nearest to a point of the view plane, within `reach` (rig units on that plane). Of
/// several at the same distance the first wins.
pub fn control_at(controls: &[ControlOutline], plane: &ViewPlane, point: Vec2, reach: f32) -> Option<Uid> {
    nearest_control(controls, plane, point, reach).map(|(control, _)| control)
}

/// Control of [`control_at`], with the distance of its outline from the point in rig units on the view plane.
pub fn nearest_control(controls: &[ControlOutline], plane: &ViewPlane, point: Vec2, reach: f32) -> Option<(Uid, f32)> {
    let mut best: Option<(f32, Uid)> = None;
    for control in controls.iter().filter(|control| control.display == LayerDisplay::Normal) {
        for line in &control.lines {
            for ends in line.windows(2) {
                let (Some(a), Some(b)) = (plane.project(ends[0]), plane.project(ends[1])) else { continue };
                let along = b - a;
                let part = (point - a).dot(along) / along.length_squared().max(f32::MIN_POSITIVE);
                let distance = point.distance(a + along * part.clamp(0.0, 1.0));
                if distance <= reach && best.is_none_or(|(nearest, _)| distance < nearest) {
                    best = Some((distance, control.uid));
                }
            }
        }
    }
    best.map(|(distance, uid)| (uid, distance))
}
