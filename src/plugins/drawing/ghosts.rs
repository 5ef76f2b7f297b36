//! Ghosts: planned joints, the line of a stroke, the span of a ray, and the symmetry plane.

use bevy::prelude::*;

use super::{
    ink::{Ink, Layer, Pen},
    shapes::{Octahedron, ball_radius},
    theme::{Theme, Tint, fade, shade},
};
use crate::{plugins::viewport::Sight, rig::operations::MirrorPlane};

/// Ghosts of the current tool over a rig, in the rig's space.
///
/// The resource is retained: a tool replaces it when it changes (`ghosts.set_if_neq(..)`) and resets it to the default
/// when it ends.
#[derive(Resource, Debug, Clone, PartialEq, Default)]
pub struct Ghosts {
    /// The rig whose space the ghosts are in; `None` for the only rig.
    pub rig: Option<Entity>,
    /// Joints that a click or Enter would make.
    pub joints: Vec<GhostJoint>,
    /// The line drawn so far, on the view plane: one point after another.
    pub stroke: Vec<Vec3>,
    /// The near and the far end of the span of depths; a tick marks the first ghost joint.
    pub depth_span: Option<(Vec3, Vec3)>,
}

impl Ghosts {
    /// Returns `true` if there is nothing to show.
    pub fn is_empty(&self) -> bool {
        self.joints.is_empty() && self.stroke.len() < 2 && self.depth_span.is_none()
    }
}

/// A planned joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GhostJoint {
    /// Position of the joint.
    pub position: Vec3,
    /// Position of its parent; `None` for a root.
    pub parent: Option<Vec3>,
    /// Marks joints that symmetry adds on the other side, which are drawn fainter.
    pub mirrored: bool,
}

/// Draws ghosts into blended ink.
pub fn draw_ghosts(ghosts: &Ghosts, sight: &Sight, theme: &Theme, ball_scale: f32, ink: &mut Ink) {
    let mut pen = Pen::new(ink, sight);
    let tint = |joint: &GhostJoint| if joint.mirrored { theme.ghost_mirrored } else { theme.ghost };
    for joint in &ghosts.joints {
        let Some(parent) = joint.parent else { continue };
        ghost_bone(&mut pen, [parent, joint.position], tint(joint), theme);
    }
    if let Some((near, far)) = ghosts.depth_span {
        let at = ghosts.joints.first().map(|joint| joint.position);
        draw_span(&mut pen, [near, far], at, theme);
    }
    for joint in &ghosts.joints {
        let pixel = sight.pixel_at(joint.position);
        if pixel <= 0.0 {
            continue;
        }
        let bone = joint.parent.map_or(0.0, |parent| parent.distance(joint.position) / pixel);
        let size = ball_radius(bone, ball_scale).max(5.0) * pixel;
        let tint = tint(joint);
        let lift = size + pixel;
        pen.ball(joint.position, size, lift, tint, shade(tint, 0.8));
        pen.ring(
            joint.position,
            [size, size + 1.4 * pixel],
            None,
            lift,
            fade(theme.outline, f32::from(tint[3]) / 255.0),
        );
    }
    for ends in ghosts.stroke.windows(2) {
        pen.layer = Layer::Fixed(0.999_9);
        pen.line([ends[0], ends[1]], 4.6, 0.0, fade(theme.outline, 0.35));
        pen.layer = Layer::Fixed(0.999_92);
        pen.line([ends[0], ends[1]], 2.4, 0.0, theme.stroke);
    }
}

fn ghost_bone(pen: &mut Pen, ends: [Vec3; 2], tint: Tint, theme: &Theme) {
    let [head, tail] = ends;
    let pixel = pen.sight.pixel_at(head.midpoint(tail));
    let length = head.distance(tail);
    if !(pixel > 0.0 && length > 2.0 * pixel) {
        return;
    }
    let width = (length * 0.085).max(1.8 * pixel);
    let Some(shape) = Octahedron::new(head, tail, width, pen.sight.plane.right) else { return };
    let faces = shape.faces();
    let seen = faces.map(|face| face.normal.dot(pen.sight.towards(face.corners[0])) > 0.0);
    for (face, _) in faces.iter().zip(seen).filter(|(_, seen)| *seen) {
        pen.triangle(face.corners, 0.0, fade(tint, 0.45));
    }
    for (ends, [a, b]) in shape.edges() {
        if seen[a] != seen[b] {
            pen.line(ends, 1.4, pixel, fade(theme.outline, f32::from(tint[3]) / 255.0));
        }
    }
}

/// Draws a thin line from the near to the far hit with short bars at its ends, and a longer one at the joint.
fn draw_span(pen: &mut Pen, span: [Vec3; 2], at: Option<Vec3>, theme: &Theme) {
    pen.line(span, 3.0, 0.0, fade(theme.outline, 0.4));
    pen.line(span, 1.4, 0.0, theme.depth);
    let along = (span[1] - span[0]).normalize_or_zero();
    for (place, half) in [(Some(span[0]), 5.0), (Some(span[1]), 5.0), (at, 13.0)] {
        let Some(place) = place else { continue };
        let across = along.cross(pen.sight.towards(place)).try_normalize().unwrap_or(pen.sight.plane.right);
        let half = across * (half * pen.sight.pixel_at(place));
        pen.line([place - half, place + half], 3.4, 0.0, fade(theme.outline, 0.4));
        pen.line([place - half, place + half], 1.6, 0.0, theme.depth);
    }
}

/// Draws a symmetry plane through the box `bounds` (rig space): a faint area within the scene and its border. From the side
/// the border is left alone: an area would lie over all that is seen.
pub fn draw_plane(plane: &MirrorPlane, bounds: [Vec3; 2], sight: &Sight, theme: &Theme, ink: &mut Ink) {
    let normal = plane.normal.normalize_or(Vec3::X);
    let centre = plane.onto(bounds[0].midpoint(bounds[1]));
    let size = (bounds[1] - bounds[0]).length().max(1e-6);
    let up = (Vec3::Y - normal * normal.y).try_normalize().unwrap_or(Vec3::Z);
    let side = normal.cross(up);
    let reach = |axis: Vec3| 0.5 * (bounds[1] - bounds[0]).dot(axis.abs()) + 0.08 * size;
    let (up, side) = (up * reach(up), side * reach(side));
    let corners = [centre - up - side, centre - up + side, centre + up + side, centre + up - side];
    let facing = sight.towards(centre).dot(normal);
    let area = fade(theme.plane, 1.0 - facing * facing);
    let mut pen = Pen::new(ink, sight);
    pen.layer = Layer::Scene;
    if area[3] > 0 {
        pen.quad(corners, 0.0, area);
    }
    for corner in 0..4 {
        pen.line([corners[corner], corners[(corner + 1) % 4]], 1.5, 0.0, theme.plane_border);
    }
}
