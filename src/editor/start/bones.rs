//! Pictures of skeletons: joints and bones in a square, seen along the axis in which the skeleton is thinnest.

use std::collections::BTreeMap;

use bevy::math::{Vec2, Vec3};
use bevy_egui::egui::{Color32, Painter, Pos2, Rect, Stroke};

use crate::rig::{Rig, Uid};

/// A skeleton in a square: places from (0, 0), the upper left corner, to (1, 1).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BonePicture {
    /// Places of the joints.
    pub joints: Vec<Vec2>,
    /// Bones, each from a joint to its parent, by index.
    pub bones: Vec<[usize; 2]>,
}

/// Share of the square that stays free at each side.
const MARGIN: f32 = 0.08;

impl BonePicture {
    /// The picture of a rig at rest.
    pub fn of(rig: &Rig) -> Self {
        let places: Vec<(Uid, Vec3)> =
            rig.rest_globals().into_iter().map(|(uid, global)| (uid, global.translation)).collect();
        let numbers: BTreeMap<Uid, usize> =
            places.iter().enumerate().map(|(number, (uid, _))| (*uid, number)).collect();
        let flat = flattened(&places.iter().map(|(_, place)| *place).collect::<Vec<_>>());
        let parents = rig.walk().filter_map(|joint| Some([joint.data.uid, joint.parent?]));
        let bones = parents.filter_map(|[joint, parent]| Some([*numbers.get(&joint)?, *numbers.get(&parent)?]));
        Self { bones: bones.collect(), joints: flat }
    }

    /// Draws the picture into a square.
    pub(in crate::editor) fn paint(&self, painter: &Painter, square: Rect, bone: Color32, joint: Color32) {
        let at = |place: Vec2| -> Pos2 { square.min + square.size() * bevy_egui::egui::vec2(place.x, place.y) };
        for [a, b] in &self.bones {
            let (Some(from), Some(to)) = (self.joints.get(*a), self.joints.get(*b)) else { continue };
            painter.line_segment([at(*from), at(*to)], Stroke::new(1.4, bone));
        }
        for place in &self.joints {
            painter.circle_filled(at(*place), 1.3, joint);
        }
    }
}

/// Places in the square, seen along the axis of the least extent: from the front, from the left or from above.
fn flattened(places: &[Vec3]) -> Vec<Vec2> {
    let bounds = places.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)));
    let extent = bounds.1 - bounds.0;
    if !extent.is_finite() {
        return Vec::new();
    }
    let least = extent.min_element();
    let view = |p: Vec3| {
        if extent.z == least {
            Vec2::new(p.x, -p.y)
        } else if extent.x == least {
            Vec2::new(-p.z, -p.y)
        } else {
            Vec2::new(p.x, p.z)
        }
    };
    let flat: Vec<Vec2> = places.iter().map(|place| view(*place)).collect();
    let (low, high) =
        flat.iter().fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)));
    let scale = (1.0 - 2.0 * MARGIN) / (high - low).max_element().max(f32::MIN_POSITIVE);
    let middle = 0.5 * (low + high);
    flat.into_iter().map(|place| (place - middle) * scale + 0.5).collect()
}
