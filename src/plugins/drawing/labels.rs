//! Labels beside joints: positions without overlap, and letters made of lines.

use bevy::{
    color::LinearRgba,
    gizmos::{config::DefaultGizmoConfigGroup, gizmos::GizmoBuffer},
    prelude::*,
};

use super::{
    ink::{Layer, Pen},
    theme::Tint,
};
use crate::plugins::viewport::Sight;

/// Width and height of a letter in pixels, for [`label_places`].
pub const LETTER: Vec2 = Vec2::new(8.0, 15.0);

/// A label to be placed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LabelCandidate<'a> {
    /// Position of its joint, in the rig's space.
    pub position: Vec3,
    /// Radius in pixels of the joint's ball; the label stands to the right of it.
    pub radius: f32,
    /// The text.
    pub text: &'a str,
    /// Rank: labels of higher rank win; among equals the one nearer to the camera.
    pub rank: u8,
}

/// Pixel positions of the labels' left ends, at half their height, thinned out so that none covers another; labels
/// outside the view or behind the camera are left out. `letter` is the size of a letter. The highest ranks come first.
pub fn label_places(sight: &Sight, candidates: &[LabelCandidate], letter: Vec2) -> Vec<(Vec2, String)> {
    let mut order: Vec<(&LabelCandidate, Vec2, f32)> = candidates
        .iter()
        .filter(|candidate| !candidate.text.is_empty())
        .filter_map(|candidate| {
            let at = sight.project(candidate.position)?;
            let distance = (sight.plane.origin - candidate.position).dot(sight.plane.towards());
            Some((candidate, at + Vec2::new(candidate.radius + 4.0, 0.0), distance))
        })
        .filter(|(_, at, _)| at.cmpge(Vec2::ZERO).all() && at.cmple(sight.size).all())
        .collect();
    order.sort_by(|a, b| b.0.rank.cmp(&a.0.rank).then(a.2.total_cmp(&b.2)));
    let mut taken: Vec<Rect> = Vec::new();
    let mut places = Vec::new();
    for (candidate, at, _) in order {
        let size = Vec2::new(letter.x * candidate.text.chars().count() as f32, letter.y);
        let rect = Rect::from_corners(at - Vec2::new(2.0, size.y * 0.5), at + Vec2::new(size.x, size.y * 0.5));
        if taken.iter().all(|other| other.intersect(rect).is_empty()) {
            taken.push(rect);
            places.push((at, candidate.text.to_owned()));
        }
    }
    places
}

/// Writes a label with lines, in front of everything; ASCII characters only.
pub(super) fn write_label(pen: &mut Pen, at: Vec2, text: &str, tint: Tint, outline: Tint) {
    let mut letters = GizmoBuffer::<DefaultGizmoConfigGroup, ()>::default();
    letters.text(Isometry3d::IDENTITY, text, 10.0, Vec2::new(-0.5, 0.0), LinearRgba::WHITE);
    let sight = *pen.sight;
    let place = |point: Vec3| sight.plane.lift(sight.point(at + Vec2::new(point.x, -point.y)));
    let layer = pen.layer;
    for (width, color, depth) in [(3.6, outline, 0.999_94), (1.3, tint, 0.999_96)] {
        pen.layer = Layer::Fixed(depth);
        for ends in letters.strip_positions.windows(2) {
            if ends.iter().all(|end| end.is_finite()) {
                pen.line([place(ends[0]), place(ends[1])], width, 0.0, color);
            }
        }
        for ends in letters.list_positions.chunks_exact(2) {
            pen.line([place(ends[0]), place(ends[1])], width, 0.0, color);
        }
    }
    pen.layer = layer;
}
