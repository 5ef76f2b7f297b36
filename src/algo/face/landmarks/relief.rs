//! Close-up of the face: a fine depth map in normalised face coordinates.

use glam::{Vec2, Vec3, vec2};

use super::search::Pose;
use crate::algo::face::depth_map::{DepthFrame, DepthMap};

/// The side of a pixel, as a share of the eye distance.
const PIXEL: f32 = 0.008;

/// The frame of a fine map around a face.
pub(super) fn close_up(pose: &Pose) -> DepthFrame {
    let low = pose.center + vec2(-0.8, -1.75) * pose.size;
    let high = pose.center + vec2(0.8, 0.8) * pose.size;
    DepthFrame::over(low, high, PIXEL * pose.size, 512)
}

/// A face in normalised coordinates: u to the character's left, v up, from half way between the eyes; depths in eye
/// distances, too.
#[derive(Debug)]
pub(super) struct Relief<'a> {
    /// Depth map of the visible surface.
    pub map: &'a DepthMap,
    /// Point half way between the eyes, in head space.
    pub center: Vec2,
    /// The eye distance.
    pub size: f32,
}

impl Relief<'_> {
    /// The depth at (u, v).
    pub fn at(&self, u: f32, v: f32) -> Option<f32> {
        self.map.sample(self.center + vec2(u, v) * self.size).map(|z| z / self.size)
    }

    /// Position in head space of (u, v, depth).
    pub fn place(&self, u: f32, v: f32, depth: f32) -> Vec3 {
        (self.center + vec2(u, v) * self.size).extend(depth * self.size)
    }

    /// Depths along a path of `count` steps from `from` by `step`; gaps are filled from their ends.
    pub fn line(&self, from: Vec2, step: Vec2, count: usize) -> Vec<f32> {
        let raw: Vec<Option<f32>> =
            (0..count).map(|i| from + step * i as f32).map(|place| self.at(place.x, place.y)).collect();
        fill(&raw)
    }
}

/// Fills gaps along a line by interpolating between their ends.
pub(super) fn fill(raw: &[Option<f32>]) -> Vec<f32> {
    let mut filled: Vec<f32> = raw.iter().map(|depth| depth.unwrap_or(0.0)).collect();
    let mut last: Option<usize> = None;
    for (i, depth) in raw.iter().enumerate() {
        let Some(depth) = *depth else { continue };
        let start = last.map_or(0, |last| last + 1);
        let before = last.and_then(|last| raw.get(last).copied().flatten()).unwrap_or(depth);
        for (k, slot) in filled.iter_mut().enumerate().take(i).skip(start) {
            let part = (k + 1 - start) as f32 / (i + 1 - start) as f32;
            *slot = before + (depth - before) * part;
        }
        last = Some(i);
    }
    if let Some(last) = last {
        let end = filled[last];
        filled.iter_mut().skip(last + 1).for_each(|slot| *slot = end);
    }
    filled
}

/// Smooths a line by 1-2-1, `rounds` times.
pub(super) fn smooth(line: &mut [f32], rounds: usize) {
    for _ in 0..rounds {
        let Some(&first) = line.first() else { return };
        let mut before = first;
        for i in 0..line.len() {
            let here = line[i];
            let after = line.get(i + 1).copied().unwrap_or(here);
            line[i] = (before + 2.0 * here + after) / 4.0;
            before = here;
        }
    }
}
