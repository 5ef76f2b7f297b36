//! Border between face and neck: the line of the jaw, seen from the side.

use glam::{Vec2, Vec3};

use super::profile;
use crate::algo::face::landmarks::Landmarks;

/// Distance from the jaw's line that still belongs to the face, as a share of the distance of the eyes: the line runs
/// along the bone's edge, and landmarks found on a mesh are not exact.
const MARGIN: f32 = 0.15;

/// The jaw's line from ear to chin, as depth and height.
pub struct Jaw {
    /// Places of the line by depth, hindmost first.
    line: Vec<Vec2>,
    margin: f32,
    chin: f32,
}

impl Jaw {
    /// Makes the line of the lower of the two sides, so that it leaves no landmark out where they differ.
    pub fn new(landmarks: &Landmarks) -> Self {
        let mut line: Vec<Vec2> = (0..=8)
            .map(|index| {
                let (right, left) = (profile(landmarks.points[index]), profile(landmarks.points[16 - index]));
                Vec2::new((right.x + left.x) * 0.5, right.y.min(left.y))
            })
            .collect();
        line.sort_by(|a, b| a.x.total_cmp(&b.x));
        // The line must not fall towards the back, as a line of wrong landmarks may.
        let mut lowest = f32::MAX;
        for place in &mut line {
            lowest = lowest.min(place.y);
            place.y = lowest;
        }
        let margin = MARGIN * landmarks.eye_distance();
        let chin = landmarks.points[6..=10].iter().map(|point| point.y).fold(f32::MAX, f32::min);
        Self { line, margin, chin }
    }

    /// Height of the underside of the chin.
    pub fn chin(&self) -> f32 {
        self.chin
    }

    /// Returns `true` if a point is not below the jaw.
    pub fn above(&self, point: Vec3) -> bool {
        let at = profile(point);
        let next = self.line.partition_point(|place| place.x < at.x);
        let height = match (next.checked_sub(1).and_then(|last| self.line.get(last)), self.line.get(next)) {
            (Some(last), Some(next)) => last.lerp(*next, (at.x - last.x) / (next.x - last.x).max(f32::MIN_POSITIVE)).y,
            (Some(end), None) | (None, Some(end)) => end.y,
            (None, None) => f32::MIN,
        };
        // The line is steep near the ears, so the distance counts and not only the height.
        at.y >= height || self.line.windows(2).any(|ends| near(at, ends[0], ends[1], self.margin))
    }
}

/// Returns `true` if a place lies within `reach` of a segment.
fn near(at: Vec2, from: Vec2, to: Vec2, reach: f32) -> bool {
    let along = to - from;
    let share = ((at - from).dot(along) / along.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
    at.distance_squared(from + along * share) <= reach * reach
}
