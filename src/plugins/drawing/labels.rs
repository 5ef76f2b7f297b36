//! Labels beside joints: where they go without covering each other, and letters made of lines.

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

/// Width and height in pixels that a letter takes, for [`label_places`].
pub const LETTER: Vec2 = Vec2::new(8.0, 15.0);

/// A label that wants to be shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LabelWish<'a> {
    /// Its joint's place, in the rig's space.
    pub position: Vec3,
    /// Radius in pixels of the joint's ball; the label stands to the right of it.
    pub radius: f32,
    /// The text.
    pub text: &'a str,
    /// Wishes of higher rank win; among equals what is nearer to the camera.
    pub rank: u8,
}

/// The pixels of the labels' left ends, half way up, so thinned out that none covers another; what is outside the view
/// or behind the camera is left out. `letter` is the size of a letter. The most wanted come first.
pub fn label_places(sight: &Sight, wishes: &[LabelWish], letter: Vec2) -> Vec<(Vec2, String)> {
    let mut order: Vec<(&LabelWish, Vec2, f32)> = wishes
        .iter()
        .filter(|wish| !wish.text.is_empty())
        .filter_map(|wish| {
            let at = sight.project(wish.position)?;
            let distance = (sight.plane.origin - wish.position).dot(sight.plane.towards());
            Some((wish, at + Vec2::new(wish.radius + 4.0, 0.0), distance))
        })
        .filter(|(_, at, _)| at.cmpge(Vec2::ZERO).all() && at.cmple(sight.size).all())
        .collect();
    order.sort_by(|a, b| b.0.rank.cmp(&a.0.rank).then(a.2.total_cmp(&b.2)));
    let mut taken: Vec<Rect> = Vec::new();
    let mut places = Vec::new();
    for (wish, at, _) in order {
        let size = Vec2::new(letter.x * wish.text.chars().count() as f32, letter.y);
        let rect = Rect::from_corners(at - Vec2::new(2.0, size.y * 0.5), at + Vec2::new(size.x, size.y * 0.5));
        if taken.iter().all(|other| other.intersect(rect).is_empty()) {
            taken.push(rect);
            places.push((at, wish.text.to_owned()));
        }
    }
    places
}

/// Writes a label with lines, in front of everything: only the characters of ASCII.
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
