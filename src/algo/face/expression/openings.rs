//! Openings of mouth and eyes: the assignment of skin to lips and lids, and its share in the jaw's movement.
//!
//! The line of a mouth or an eye is drawn through the middle of its inner landmarks. Between the corners it divides the
//! skin sharply, beyond them the two sides blend.

use glam::Vec3;

use super::text::Part;
use crate::algo::face::landmarks::Landmarks;

/// Half the height, in eye distances, in which the skin of a closed mouth goes over from the upper to the lower lip.
const CLOSED_BLEND: f32 = 0.12;

/// Known lip and lid of a point: touching lips cannot be told apart by position.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct OpeningSide {
    /// Upper lip (`true`), lower lip (`false`) or unknown.
    pub upper_lip: Option<bool>,
    /// Upper lid (`true`), lower lid (`false`) or unknown.
    pub upper_lid: Option<bool>,
}

impl OpeningSide {
    /// The known lip and lid of a landmark.
    pub fn of_landmark(mark: usize) -> Self {
        let (upper_lip, upper_lid) = match mark {
            49..=53 | 61..=63 => (Some(true), None),
            55..=59 | 65..=67 => (Some(false), None),
            37 | 38 | 43 | 44 => (None, Some(true)),
            40 | 41 | 46 | 47 => (None, Some(false)),
            _ => (None, None),
        };
        Self { upper_lip, upper_lid }
    }
}

/// The lines that divide lips and lids, in eye distances from the origin of head space.
#[derive(Debug, Clone)]
pub(super) struct OpeningLines {
    scale: f32,
    middle: f32,
    mouth: Line,
    /// True if the lips can part; a mouth that is one closed surface stretches instead.
    lips_part: bool,
    /// Lines of the left and the right eye.
    eyes: [Line; 2],
}

impl OpeningLines {
    /// Makes the lines of landmarks; `None` if the landmarks are degenerate.
    pub fn new(landmarks: &Landmarks) -> Option<Self> {
        let distance = landmarks.eye_distance();
        if !(distance.is_finite() && distance > 1e-12 && landmarks.points.iter().all(|point| point.is_finite())) {
            return None;
        }
        let scale = 1.0 / distance;
        let line = |marks: &[[usize; 2]]| {
            let mut points: Vec<[f32; 2]> = marks
                .iter()
                .map(|&[a, b]| {
                    let middle = landmarks.points[a].midpoint(landmarks.points[b]) * scale;
                    [middle.x, middle.y]
                })
                .collect();
            points.sort_by(|a, b| a[0].total_cmp(&b[0]));
            Line { points }
        };
        Some(Self {
            scale,
            middle: landmarks.middle * scale,
            lips_part: landmarks.mouth_open,
            mouth: line(&[[48, 48], [60, 60], [61, 67], [62, 66], [63, 65], [64, 64], [54, 54]]),
            eyes: [line(&[[42, 42], [43, 47], [44, 46], [45, 45]]), line(&[[36, 36], [37, 41], [38, 40], [39, 39]])],
        })
    }

    /// Share of the left (0) or right (1) side at a point; the two sum to 1.
    pub fn side(&self, point: Vec3, side: usize) -> f32 {
        let left = ramp((point.x * self.scale - self.middle) / 0.08);
        if side == 0 { left } else { 1.0 - left }
    }

    /// Share of a part at a point, 0 to 1.
    pub fn part(&self, part: Part, point: Vec3, known: OpeningSide) -> f32 {
        match part {
            Part::Everywhere => 1.0,
            Part::UpperLip => self.upper_lip(point, known),
            Part::LowerLip => 1.0 - self.upper_lip(point, known),
            Part::UpperLid => self.upper(self.eye(point), point, known.upper_lid),
            Part::LowerLid => 1.0 - self.upper(self.eye(point), point, known.upper_lid),
        }
    }

    /// Returns `true` if a point is too near to the mouth's line to tell its side by position.
    pub fn is_near_mouth_line(&self, point: Vec3) -> bool {
        let place = self.mouth.place(point * self.scale);
        self.lips_part && place.beyond <= 0.0 && place.above.abs() < 0.04
    }

    /// Returns `true` for points above the mouth's line.
    pub fn above_mouth(&self, point: Vec3) -> bool {
        self.mouth.place(point * self.scale).above > 0.0
    }

    /// Share of the jaw's movement at a point, 0 to 1: all below the mouth's line; half at the corners, less on the
    /// cheeks.
    pub fn jaw(&self, point: Vec3, known: OpeningSide) -> f32 {
        let place = self.mouth.place(point * self.scale);
        let corner = place.corner.powi(2).min(1.0);
        let half_width = 0.03 + 0.32 * corner + 0.25 * place.beyond.max(0.0);
        let above = match known.upper_lip {
            Some(true) => place.above.max(0.0) + 0.03,
            Some(false) => place.above.min(0.0) - 0.03,
            None => place.above,
        };
        1.0 - ramp(above / half_width)
    }

    fn eye(&self, point: Vec3) -> &Line {
        let [left, right] = &self.eyes;
        if point.x * self.scale >= self.middle { left } else { right }
    }

    fn upper_lip(&self, point: Vec3, known: OpeningSide) -> f32 {
        if self.lips_part {
            return self.upper(&self.mouth, point, known.upper_lip);
        }
        ramp(self.mouth.place(point * self.scale).above / CLOSED_BLEND)
    }

    fn upper(&self, line: &Line, point: Vec3, known: Option<bool>) -> f32 {
        match known {
            Some(upper) => f32::from(u8::from(upper)),
            None => {
                let place = line.place(point * self.scale);
                ramp(place.above / (0.015 + 0.4 * place.beyond.max(0.0)))
            }
        }
    }
}

/// A line from corner to corner by rising x, in eye distances.
#[derive(Debug, Clone)]
struct Line {
    points: Vec<[f32; 2]>,
}

/// Coordinates of a point relative to a line.
struct Place {
    /// Height above the line.
    above: f32,
    /// Distance beyond the nearest corner, negative between the corners.
    beyond: f32,
    /// Position along the line: 0 at its middle, 1 at the corners.
    corner: f32,
}

impl Line {
    fn place(&self, point: Vec3) -> Place {
        let (Some(&[from, first]), Some(&[to, last])) = (self.points.first(), self.points.last()) else {
            return Place { above: point.y, beyond: 0.0, corner: 1.0 };
        };
        let height = if point.x <= from {
            first
        } else if point.x >= to {
            last
        } else {
            let next = self.points.partition_point(|corner| corner[0] <= point.x);
            let [a, b] = [self.points[next - 1], self.points[next.min(self.points.len() - 1)]];
            let along = (point.x - a[0]) / (b[0] - a[0]).max(1e-6);
            a[1] + (b[1] - a[1]) * along.clamp(0.0, 1.0)
        };
        let half = ((to - from) * 0.5).max(1e-6);
        let off = (point.x - (from + to) * 0.5).abs();
        Place { above: point.y - height, beyond: off - half, corner: off / half }
    }
}

/// A smooth step from 0 at −1 to 1 at 1.
fn ramp(x: f32) -> f32 {
    let t = (x * 0.5 + 0.5).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
