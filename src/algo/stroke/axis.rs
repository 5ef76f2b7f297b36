//! Centre line of a limb: the centroids of its sections under a stroke.
//!
//! Stations along the stroke measure the limb's section at right angles to its axis in space, which need not lie in the
//! view plane. There are two passes: a coarse one finds the approximate axis and the places where the limb joins a
//! larger part (the shoulder in the chest, the hip in the pelvis), the second measures sections at right angles to that
//! axis. Where sections are not the limb's own, the line is extrapolated: the upper arm's axis into the shoulder.

use glam::Vec3;

use super::{
    HalfSpace,
    section::{Fan, Section},
    track::{Sample, Track},
};
use crate::{
    algo::view::ViewPlane,
    mesh::{
        ray::{Hit, Ray},
        surface::Surface,
    },
};

/// Strides of the coarse pass and the fine pass through the samples of the track.
const COARSE: usize = 4;
const FINE: usize = 2;
/// Reach of a fan in radii: sections of hands, feet and flat limbs fit in.
const REACH: f32 = 2.2;

/// Openness above the median section's from which a section is not the limb's own.
const OPENER: f32 = 0.1;

/// Distance in radii before the border to a larger part at which sections already lean towards it.
const TRIM: f32 = 0.25;
/// Limits, in radii, of the stroke's distance from a larger part's middle and of its length there, from which that part
/// is the limb.
const BESIDE: f32 = 0.4;
const LASTING: f32 = 1.5;
/// Length in radii over which the direction of the extrapolated line is measured.
const STRAIGHT: f32 = 3.0;

/// The part in which a limb ends turns into depth if it goes on there for so many radii of the limb, and so many times
/// as far as to the other side.
const TURNED: f32 = 2.5;
const ONE_SIDED: f32 = 1.6;
/// Distance beyond the stroke, in radii, at which such a part has ended, and distance of the last joint from its tip.
const BEYOND: f32 = 1.5;
const TIP: f32 = 0.8;

/// Largest distance of a joint from the stroke, in radii, where the limb has no section of its own.
const TREMBLE: f32 = 0.35;

/// A place along the centre line.
#[derive(Debug, Clone, Copy)]
pub(super) struct Station {
    /// Arc length along the stroke.
    pub(super) at: f32,
    pub(super) centre: Vec3,
    pub(super) radius: f32,
    /// Unit direction of the limb.
    pub(super) tangent: Vec3,
    /// Marks a section of the limb itself; other centres and radii are extrapolated from those.
    pub(super) own: bool,
    /// Vector from the stroke to the line, across the view.
    aside: Vec3,
}

/// A centre line.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    /// Stations by rising arc length, at least two.
    pub(super) stations: Vec<Station>,
    /// The median radius.
    pub(super) radius: f32,
    within: Option<HalfSpace>,
}

impl Axis {
    /// Finds the centre line; `None` if the stroke has no length inside the volume, or the volume no inside.
    pub(super) fn find(surface: &Surface, plane: &ViewPlane, fan: &Fan, track: &Track) -> Option<Self> {
        let within = track.within;
        let coarse = every(&track.samples, COARSE);
        let half = median(coarse.iter().map(|s| 0.5 * (s.span.far - s.span.near))).filter(|&half| half > 0.0)?;
        let middles: Vec<Vec3> = coarse.iter().map(|s| s.middle).collect();
        let starts = directed(&smooth(&middles, half), half)?;
        let mut hits = Vec::new();
        let starts: Vec<Vec3> = starts.into_iter().map(|(_, tangent)| tangent).collect();
        let sections: Vec<Option<Section>> = coarse
            .iter()
            .zip(&starts)
            .map(|(s, &tangent)| fan.section(surface, within, s.middle, tangent, 3.0 * half, 3, &mut hits))
            .collect();
        let rough = Self::assemble(&coarse, &sections, &starts, half, within)?;

        let fine = every(&track.samples, FINE);
        let places: Vec<Station> = fine.iter().map(|s| rough.station(s.at, &s.ray)).collect();
        let normals: Vec<Vec3> = places.iter().map(|s| s.tangent).collect();
        let sections: Vec<Option<Section>> = places
            .iter()
            .map(|station| {
                fan.section(surface, within, station.centre, station.tangent, REACH * station.radius, 3, &mut hits)
            })
            .collect();
        let mut found = Self::assemble(&fine, &sections, &normals, rough.radius, within)?;
        found.turn_at_end(surface, plane, track);
        Some(found)
    }

    /// Leads the line on into a part that the limb ends in and that points along the view, like a foot seen from the
    /// front: where the volume goes far to one side of the line in depth, and ends just beyond the stroke.
    fn turn_at_end(&mut self, surface: &Surface, plane: &ViewPlane, track: &Track) {
        // A single section at the very end is one of a sole, not of the limb.
        let Some(last) = self.stations.windows(2).rposition(|pair| pair[0].own && pair[1].own) else { return };
        let last = last + 1;
        let (from, radius) = (self.stations[last], self.stations[last].radius);
        // How far the volume goes towards the camera and away from it, seen from the line.
        let reach = |sample: &Sample| {
            let depth = (from.centre - sample.ray.origin).dot(sample.ray.direction);
            [depth - sample.span.near, sample.span.far - depth]
        };
        let furthest = |sample: &Sample| reach(sample).into_iter().fold(0.0, f32::max);
        let beyond = track.samples.iter().filter(|sample| sample.at > from.at);
        let Some(end) = beyond.max_by(|a, b| furthest(a).total_cmp(&furthest(b))) else { return };
        let [before, behind] = reach(end);
        if before.max(behind) < TURNED * radius
            || before.max(behind) < ONE_SIDED * before.min(behind)
            || track.goes_on(surface, plane, BEYOND * radius)
        {
            return;
        }
        let tip = if before > behind { end.span.near + TIP * radius } else { end.span.far - TIP * radius };
        let tip = end.ray.at(tip);
        let Some(tangent) = (tip - from.centre).try_normalize() else { return };
        let count = self.stations.len() - last - 1;
        for (number, station) in self.stations[last + 1..].iter_mut().enumerate() {
            *station =
                Station { centre: from.centre.lerp(tip, (number + 1) as f32 / count as f32), tangent, ..*station };
        }
    }

    /// Joins sections to a line: finds the limb's own sections and extrapolates over the others.
    fn assemble(
        samples: &[Sample],
        sections: &[Option<Section>],
        normals: &[Vec3],
        radius: f32,
        within: Option<HalfSpace>,
    ) -> Option<Self> {
        let own = own(samples, sections, normals)?;
        let measured = |i: usize| sections[i].filter(|_| own[i]);
        let radius = median((0..samples.len()).filter_map(|i| measured(i).map(|s| s.radius))).unwrap_or(radius);
        let known: Vec<usize> = (0..samples.len()).filter(|&i| measured(i).is_some()).collect();
        let centres: Vec<Vec3> = known.iter().filter_map(|&i| measured(i).map(|s| s.centroid)).collect();
        let radii: Vec<f32> = known.iter().filter_map(|&i| measured(i).map(|s| s.radius)).collect();
        let smoothed = smooth(&centres, 0.4 * radius);
        let line = match directed(&smoothed, radius) {
            Some(line) => line,
            // With a single own section the direction of the stroke in space is used.
            None => {
                let across = (samples[samples.len() - 1].middle - samples[0].middle).try_normalize()?;
                smoothed.iter().map(|&centre| (centre, across)).collect()
            }
        };
        let stations: Vec<Station> = samples
            .iter()
            .enumerate()
            .map(|(i, sample)| {
                let next = known.partition_point(|&k| k < i);
                let (centre, tangent, radius, own) = if known.get(next) == Some(&i) {
                    (line[next].0, line[next].1, radii[next], true)
                } else if next == 0 || next == known.len() {
                    let end = next.saturating_sub(1);
                    let (from, tangent) = end_line(&line, radii[end], next == 0);
                    let on_line = under(from, tangent, &sample.ray);
                    // Far beyond the limb or beside the stroke the extrapolated line is unreliable; the volume's middle
                    // is used.
                    let far = on_line.distance(from) / radii[end];
                    let beside = across(on_line, &sample.ray).length() / radii[end];
                    let trust = (0.5 * (5.0 - far)).min(2.0 - beside).clamp(0.0, 1.0);
                    (sample.middle.lerp(on_line, trust), tangent, radii[end], false)
                } else {
                    let (a, b) = (line[next - 1], line[next]);
                    let tangent = (b.0 - a.0).try_normalize().unwrap_or(a.1);
                    (under(a.0, tangent, &sample.ray), tangent, 0.5 * (radii[next - 1] + radii[next]), false)
                };
                let aside = across(centre, &sample.ray);
                Station { at: sample.at, centre, radius, tangent, own, aside }
            })
            .collect();
        (stations.len() > 1).then_some(Self { stations, radius, within })
    }

    /// The station under `ray`, which is at the arc length `at` of the stroke.
    pub(super) fn station(&self, at: f32, ray: &Ray) -> Station {
        let next = self.stations.partition_point(|s| s.at < at).clamp(1, self.stations.len() - 1);
        let (a, b) = (self.stations[next - 1], self.stations[next]);
        let t = if b.at > a.at { ((at - a.at) / (b.at - a.at)).clamp(0.0, 1.0) } else { 0.0 };
        let tangent = a.tangent.lerp(b.tangent, t).try_normalize().unwrap_or(a.tangent);
        let radius = a.radius + (b.radius - a.radius) * t;
        let centre = a.centre.lerp(b.centre, t);
        let slid = under(centre, tangent, ray) - centre;
        let nearer = if t < 0.5 { a } else { b };
        Station { at, centre: centre + slid.clamp_length_max(radius), radius, tangent, ..nearer }
    }

    /// Mean distance of the stroke from the line; the trembling of a hand is averaged out.
    pub(super) fn aside(&self) -> f32 {
        let pieces: Vec<f32> = self
            .stations
            .chunks(8)
            .map(|piece| (piece.iter().map(|s| s.aside).sum::<Vec3>() / piece.len() as f32).length())
            .collect();
        pieces.iter().sum::<f32>() / pieces.len() as f32
    }

    /// The centroid of the limb's section under `ray`, which is at the arc length `at` of the stroke, and its radius.
    pub(super) fn recentre(
        &self,
        surface: &Surface,
        fan: &Fan,
        at: f32,
        ray: &Ray,
        hits: &mut Vec<Hit>,
    ) -> (Vec3, f32) {
        let station = self.station(at, ray);
        if !station.own {
            // No section was measured here: the line may correct a trembling hand, but must not lead away from the
            // stroke.
            let aside = across(station.centre, ray);
            let too_far = aside - aside.clamp_length_max(TREMBLE * station.radius);
            return (station.centre - too_far, station.radius);
        }
        let section =
            fan.section(surface, self.within, station.centre, station.tangent, REACH * station.radius, 1, hits);
        section.map_or((station.centre, station.radius), |s| (s.centroid, s.radius))
    }
}

/// Marks the limb's own sections.
///
/// The walk starts at the section of median size and goes both ways. A section is not the limb's own if it is open
/// although the limb's sections are closed, if its centre jumps aside, or if it grows and at the same time leaves the
/// line of the sections a radius back. `None` if there is no section at all.
fn own(samples: &[Sample], sections: &[Option<Section>], normals: &[Vec3]) -> Option<Vec<bool>> {
    let mut by_size: Vec<(f32, usize)> =
        sections.iter().enumerate().filter_map(|(i, s)| s.map(|s| (s.radius, i))).collect();
    by_size.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let seed = by_size.get(by_size.len() / 2)?.1;
    let open = median(sections.iter().flatten().map(|s| s.open))? + OPENER;
    let mut own = vec![false; sections.len()];
    own[seed] = true;
    let ways: [Vec<usize>; 2] = [(seed + 1..sections.len()).collect(), (0..seed).rev().collect()];
    for way in ways {
        let mut line: Vec<(Section, Vec3)> = sections[seed].map(|s| (s, normals[seed])).into_iter().collect();
        let mut before = line.last().copied();
        let mut other: Vec<usize> = Vec::new();
        for &i in &way {
            let (Some(section), Some((last, normal))) = (sections[i], before) else { continue };
            before = Some((section, normals[i]));
            let step = section.centroid - last.centroid;
            let jump = (step.reject_from_normalized(normal).length() - 0.3 * step.length()) / last.radius;
            let end = line[line.len() - 1].0.centroid;
            let back = line.iter().rev().find(|(s, _)| s.centroid.distance(end) >= s.radius);
            let (back, normal) = back.copied().unwrap_or(line[0]);
            let way = section.centroid - back.centroid;
            let aside = (way.reject_from_normalized(normal).length() - 0.1 * way.length()) / back.radius;
            // A constriction of the limb is no measure for later sections.
            let growth = section.radius / back.radius.max(0.8 * line[0].0.radius);
            if section.open > open || jump > 0.6 {
                other.clear();
                continue;
            }
            if growth > 1.8 || (growth > 1.2 && aside > 0.1) {
                // A larger part begins. If the stroke goes on along its middle, that part is the limb now: a thigh
                // after the knee.
                let beside = across(section.centroid, &samples[i].ray).length();
                if beside > BESIDE * section.radius {
                    other.clear();
                    continue;
                }
                other.push(i);
                let far = sections[other[0]].map_or(0.0, |s| s.centroid.distance(section.centroid));
                if far < LASTING * section.radius {
                    continue;
                }
                line.clear();
            }
            for i in other.drain(..).chain([i]) {
                own[i] = true;
                line.extend(sections[i].map(|s| (s, normals[i])));
            }
        }
        // Just before the limb joins a larger part its sections already lean towards it.
        let Some(border) = way.iter().position(|&i| !own[i]) else { continue };
        for &i in way[..border].iter().rev() {
            let (Some(here), Some(section)) = (sections[i], sections[way[border.saturating_sub(1)]]) else { continue };
            if here.centroid.distance(section.centroid) > TRIM * section.radius {
                break;
            }
            own[i] = false;
        }
    }
    Some(own)
}

/// Point and direction from which the line is extrapolated beyond its start or end: the mean direction over
/// [`STRAIGHT`] radii.
fn end_line(line: &[(Vec3, Vec3)], radius: f32, at_start: bool) -> (Vec3, Vec3) {
    let end = if at_start { 0 } else { line.len() - 1 };
    let (from, tangent) = line[end];
    let mut sum = Vec3::ZERO;
    for &(centre, tangent) in line {
        let far = centre.distance(from) / radius;
        if far < STRAIGHT {
            sum += tangent;
        }
    }
    (from, sum.try_normalize().unwrap_or(tangent))
}

/// Vector from a ray to a point, at right angles to the ray.
fn across(point: Vec3, ray: &Ray) -> Vec3 {
    (point - ray.origin).reject_from_normalized(ray.direction)
}

/// The point of the line from `from` along the unit vector `direction` that comes closest to `ray`; `from` itself if
/// the line is nearly parallel to the ray.
fn under(from: Vec3, direction: Vec3, ray: &Ray) -> Vec3 {
    let along = direction.dot(ray.direction);
    let steep = 1.0 - along * along;
    if steep < 0.05 {
        return from;
    }
    let to = ray.origin - from;
    from + direction * ((direction.dot(to) - along * ray.direction.dot(to)) / steep)
}

/// Samples at every `step`-th index, and the last.
fn every(samples: &[Sample], step: usize) -> Vec<Sample> {
    let mut some: Vec<Sample> = samples.iter().copied().step_by(step).collect();
    if !(samples.len() - 1).is_multiple_of(step) {
        some.push(samples[samples.len() - 1]);
    }
    some
}

/// Mean of each point and its neighbours, with weights that fall with the distance along the line in units of `reach`.
fn smooth(points: &[Vec3], reach: f32) -> Vec<Vec3> {
    let mut along = vec![0.0; points.len()];
    for i in 1..points.len() {
        along[i] = along[i - 1] + points[i].distance(points[i - 1]);
    }
    let mean = |i: usize| {
        // The window is equal on both sides, so that the mean does not shorten the line at its ends.
        let room = (along[i] - along[0]).min(along[points.len() - 1] - along[i]);
        let mut sum = points[i];
        let mut total = 1.0;
        for j in (0..points.len()).filter(|&j| j != i) {
            let away = (along[j] - along[i]).abs();
            let far = away / reach;
            let weight = if away <= room * 1.0001 { 1.0 / (1.0 + far * far * far * far) } else { 0.0 };
            sum += points[j] * weight;
            total += weight;
        }
        sum / total
    };
    (0..points.len()).map(mean).collect()
}

/// Points with the direction of the secant that reaches at least `reach` to both sides, where the line is long enough.
/// `None` if all points are equal.
fn directed(points: &[Vec3], reach: f32) -> Option<Vec<(Vec3, Vec3)>> {
    let last = points.len().checked_sub(1)?;
    let overall = (points[last] - points[0]).try_normalize()?;
    let direction = |i: usize| {
        let far = |&j: &usize| points[j].distance(points[i]) >= reach;
        let before = (0..i).rev().find(far).unwrap_or(0);
        let after = (i + 1..=last).find(far).unwrap_or(last);
        (points[i], (points[after] - points[before]).try_normalize().unwrap_or(overall))
    };
    Some((0..=last).map(direction).collect())
}

/// The median; `None` of an empty list.
fn median(values: impl Iterator<Item = f32>) -> Option<f32> {
    let mut values: Vec<f32> = values.collect();
    values.sort_by(f32::total_cmp);
    values.get(values.len() / 2).copied()
}
