//! The line of the limb's section centroids under a stroke.

use glam::Vec3;

use super::{
    section::{Fan, Section},
    track::Track,
};
use crate::mesh::{ray::Hit, surface::Surface};

/// A centre line, by arc length along the stroke.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    /// One entry a sample of the track.
    pub(super) at: Vec<f32>,
    pub(super) centres: Vec<Vec3>,
    pub(super) radii: Vec<f32>,
    pub(super) tangents: Vec<Vec3>,
    pub(super) reliable: Vec<bool>,
    pub(super) radius: f32,
}

impl Axis {
    /// `None` if the track is too short to have a direction, or no section closes.
    pub(super) fn find(surface: &Surface, fan: &Fan, track: &Track) -> Option<Self> {
        let at: Vec<f32> = track.samples.iter().map(|s| s.at).collect();
        let middles: Vec<Vec3> = track.samples.iter().map(|s| s.middle).collect();
        if middles.len() < 2 {
            return None;
        }
        let half = median(track.samples.iter().map(|s| 0.5 * (s.span.far - s.span.near)))?;
        if !(half > 0.0) {
            return None;
        }
        let mut hits = Vec::new();
        let tangents = tangents(&smooth(&middles, half), half)?;
        let limit = 3.0 * half;
        let sections: Vec<Option<Section>> = middles
            .iter()
            .zip(&tangents)
            .map(|(&middle, &tangent)| fan.section(surface, middle, tangent, limit, 3, &mut hits))
            .collect();
        let radius = median(sections.iter().flatten().map(|s| s.radius))?;
        let reliable: Vec<bool> =
            sections.iter().map(|s| s.is_some_and(|s| s.open == 0.0 && s.radius < 1.6 * radius)).collect();
        let centres: Vec<Vec3> =
            sections.iter().zip(&middles).map(|(s, &middle)| s.map_or(middle, |s| s.centroid)).collect();
        let radii = sections.iter().map(|s| s.map_or(radius, |s| s.radius)).collect();
        let tangents = self::tangents(&smooth(&centres, radius), radius)?;
        Some(Self { at, centres, radii, tangents, reliable, radius })
    }

    /// One step from `middle`, at the arc length `at` of the stroke, to the centroid of the section there, and that
    /// section's radius.
    pub(super) fn recentre(
        &self,
        surface: &Surface,
        fan: &Fan,
        at: f32,
        middle: Vec3,
        hits: &mut Vec<Hit>,
    ) -> Option<(Vec3, f32)> {
        let next = self.at.partition_point(|&a| a < at).min(self.at.len() - 1);
        let tangent = self.tangents[next];
        let limit = 2.0 * self.radius;
        let first = fan.section(surface, middle, tangent, limit, 2, hits)?;
        let second = fan.section(surface, first.centroid, tangent, limit, 1, hits).unwrap_or(first);
        Some((second.centroid, second.radius))
    }
}

/// Weighted mean of the neighbours within twice `reach` along the line.
fn smooth(points: &[Vec3], reach: f32) -> Vec<Vec3> {
    let mut along = vec![0.0; points.len()];
    for i in 1..points.len() {
        along[i] = along[i - 1] + points[i].distance(points[i - 1]);
    }
    (0..points.len())
        .map(|i| {
            let mut sum = Vec3::ZERO;
            let mut total = 0.0;
            for j in 0..points.len() {
                let d = (along[j] - along[i]) / reach;
                let w = 1.0 / (1.0 + d * d * d * d);
                sum += points[j] * w;
                total += w;
            }
            sum / total
        })
        .collect()
}

/// Directions of the secants that reach at least `reach` to both sides where the line is long enough.
fn tangents(points: &[Vec3], reach: f32) -> Option<Vec<Vec3>> {
    let overall = (points[points.len() - 1] - points[0]).try_normalize()?;
    Some(
        (0..points.len())
            .map(|i| {
                let before = (0..i).rev().find(|&j| points[j].distance(points[i]) >= reach).unwrap_or(0);
                let after = (i + 1..points.len())
                    .find(|&j| points[j].distance(points[i]) >= reach)
                    .unwrap_or(points.len() - 1);
                (points[after] - points[before]).try_normalize().unwrap_or(overall)
            })
            .collect(),
    )
}

/// The median; `None` of nothing.
pub(super) fn median(values: impl Iterator<Item = f32>) -> Option<f32> {
    let mut values: Vec<f32> = values.collect();
    values.sort_by(f32::total_cmp);
    values.get(values.len() / 2).copied()
}
