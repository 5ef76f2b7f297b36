//! The line of the limb's section centroids under a stroke.
//!
//! Stations along the stroke feel out the limb's section square to its axis in space, which need not run in the view plane.
//! Two passes: a coarse one finds the axis roughly and where the limb ends in something bigger (the shoulder in the chest, the
//! hip in the pelvis), the second measures it square to that. Where sections are no longer the limb's own, the line
//! goes on straight: the upper arm's axis into the shoulder.

use glam::Vec3;

use super::{
    section::{Fan, Section},
    track::{Sample, Track},
};
use crate::mesh::{
    ray::{Hit, Ray},
    surface::Surface,
};

/// Every so many samples of the track, the coarse pass and the fine pass take a section.
const COARSE: usize = 4;
const FINE: usize = 2;
/// A fan reaches so many radii: sections of hands, feet and flat limbs fit in.
const REACH: f32 = 2.2;

fn trim() -> f32 {
    std::env::var("TRIM").ok().and_then(|v| v.parse().ok()).unwrap_or(0.5)
}
fn ext() -> f32 {
    std::env::var("EXT").ok().and_then(|v| v.parse().ok()).unwrap_or(3.0)
}
fn border() -> f32 {
    std::env::var("BORDER").ok().and_then(|v| v.parse().ok()).unwrap_or(1.4)
}

/// One place along the centre line.
#[derive(Debug, Clone, Copy)]
pub(super) struct Station {
    /// Arc length along the stroke.
    pub(super) at: f32,
    pub(super) centre: Vec3,
    pub(super) radius: f32,
    /// Unit direction of the limb.
    pub(super) tangent: Vec3,
    /// Whether the section here is the limb's own; otherwise centre and radius are carried on from those that are.
    pub(super) own: bool,
}

/// A centre line.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    /// By rising arc length, at least two.
    pub(super) stations: Vec<Station>,
    /// The median radius.
    pub(super) radius: f32,
}

impl Axis {
    /// `None` if the stroke has no length inside the volume, or the volume no inside.
    pub(super) fn find(surface: &Surface, fan: &Fan, track: &Track) -> Option<Self> {
        let coarse = every(&track.samples, COARSE);
        let half = median(coarse.iter().map(|s| 0.5 * (s.span.far - s.span.near))).filter(|&half| half > 0.0)?;
        let middles: Vec<Vec3> = coarse.iter().map(|s| s.middle).collect();
        let starts = directed(&smooth(&middles, half), half)?;
        let mut hits = Vec::new();
        let sections: Vec<Option<Section>> = coarse
            .iter()
            .zip(&starts)
            .map(|(s, &(_, tangent))| fan.section(surface, s.middle, tangent, 3.0 * half, false, 3, &mut hits))
            .collect();
        let rough = Self::assemble(surface, fan, &coarse, &sections, half)?;

        let fine = every(&track.samples, FINE);
        let sections: Vec<Option<Section>> = fine
            .iter()
            .map(|s| {
                let station = rough.station(s.at, &s.ray);
                fan.section(surface, station.centre, station.tangent, REACH * station.radius, false, 3, &mut hits)
            })
            .collect();
        Self::assemble(surface, fan, &fine, &sections, rough.radius)
    }

    /// Joins sections to a line: finds those that are the limb's own, carries the line on over the others.
    fn assemble(surface: &Surface, fan: &Fan, samples: &[Sample], sections: &[Option<Section>], radius: f32) -> Option<Self> {
        let own = own(samples, sections)?;
        let measured = |i: usize| sections[i].filter(|_| own[i]);
        let radius = median((0..samples.len()).filter_map(|i| measured(i).map(|s| s.radius))).unwrap_or(radius);
        let known: Vec<usize> = (0..samples.len()).filter(|&i| measured(i).is_some()).collect();
        let centres: Vec<Vec3> = known.iter().filter_map(|&i| measured(i).map(|s| s.centroid)).collect();
        let radii: Vec<f32> = known.iter().filter_map(|&i| measured(i).map(|s| s.radius)).collect();
        let smoothed = smooth(&centres, 0.4 * radius);
        let line = match directed(&smoothed, radius) {
            Some(line) => line,
            // One own section only: the direction of the stroke in space is all there is.
            None => {
                let across = (samples[samples.len() - 1].middle - samples[0].middle).try_normalize()?;
                smoothed.iter().map(|&centre| (centre, across)).collect()
            }
        };
        let mut stations: Vec<Station> = samples
            .iter()
            .enumerate()
            .map(|(i, sample)| {
                let next = known.partition_point(|&k| k < i);
                if known.get(next) == Some(&i) {
                    let (centre, tangent) = line[next];
                    return Station { at: sample.at, centre, radius: radii[next], tangent, own: true };
                }
                let (a, b) = (line[next.saturating_sub(1)], line[next.min(line.len() - 1)]);
                let tangent = (b.0 - a.0).try_normalize().unwrap_or(a.1);
                let radius = 0.5 * (radii[next.saturating_sub(1)] + radii[next.min(line.len() - 1)]);
                Station { at: sample.at, centre: under(a.0, tangent, &sample.ray), radius, tangent, own: false }
            })
            .collect();
        let mut hits = Vec::new();
        let (first, last) = (known[0], known[known.len() - 1]);
        let ways: [(usize, bool, Vec<usize>); 2] =
            [(first, true, (0..first).rev().collect()), (last, false, (last + 1..samples.len()).collect())];
        for (end, at_start, way) in ways {
            let radius = stations[end].radius;
            let (from, tangent) = end_line(&line, radius, at_start);
            let mut centre = from;
            for &i in &way {
                let guess = under(centre, tangent, &samples[i].ray);
                let section = fan.section(surface, guess, tangent, border() * radius, true, 3, &mut hits);
                centre = section.map_or(guess, |s| s.centroid);
                // Far beyond the limb its line says nothing any more; the volume's middle does.
                let trust = (0.5 * (5.0 - centre.distance(from) / radius)).clamp(0.0, 1.0);
                stations[i].centre = samples[i].middle.lerp(centre, trust);
                stations[i].radius = radius;
                stations[i].tangent = tangent;
            }
        }
        if std::env::var("DUMP").is_ok() {
            for (i, s) in stations.iter().enumerate() {
                eprintln!("{:.3} {:.3} own {} r {:.4} sec {:.4} c {:.4} sc {:.4} m {:.4} t {:.2}", s.at, samples[i].source, s.own, s.radius, sections[i].map_or(0.0, |s| s.radius), s.centre, sections[i].map_or(Vec3::ZERO, |s| s.centroid), samples[i].middle, s.tangent);
            }
            eprintln!();
        }
        (stations.len() > 1).then_some(Self { stations, radius })
    }

    /// The line under `ray`, which stands at the arc length `at` of the stroke.
    pub(super) fn station(&self, at: f32, ray: &Ray) -> Station {
        let next = self.stations.partition_point(|s| s.at < at).clamp(1, self.stations.len() - 1);
        let (a, b) = (self.stations[next - 1], self.stations[next]);
        let t = if b.at > a.at { ((at - a.at) / (b.at - a.at)).clamp(0.0, 1.0) } else { 0.0 };
        let tangent = a.tangent.lerp(b.tangent, t).try_normalize().unwrap_or(a.tangent);
        let radius = a.radius + (b.radius - a.radius) * t;
        let centre = a.centre.lerp(b.centre, t);
        let slid = under(centre, tangent, ray) - centre;
        Station { at, centre: centre + slid.clamp_length_max(radius), radius, tangent, own: if t < 0.5 { a.own } else { b.own } }
    }

    /// The centroid of the limb's section under `ray`, which stands at the arc length `at` of the stroke, and its radius.
    pub(super) fn recentre(&self, surface: &Surface, fan: &Fan, at: f32, ray: &Ray, hits: &mut Vec<Hit>) -> (Vec3, f32) {
        let station = self.station(at, ray);
        let reach = if station.own { REACH } else { border() };
        let section =
            fan.section(surface, station.centre, station.tangent, reach * station.radius, !station.own, 1, hits);
        section.map_or((station.centre, station.radius), |s| (s.centroid, s.radius))
    }
}

/// Which sections are the limb's own.
///
/// Starts at the section of median size and walks both ways. A section is not the limb's where its centre jumps aside from
/// the line of those before, or jumps less but the section grows as well. `None` if there is no section at all.
fn own(samples: &[Sample], sections: &[Option<Section>]) -> Option<Vec<bool>> {
    let mut by_size: Vec<(f32, usize)> =
        sections.iter().enumerate().filter_map(|(i, s)| s.map(|s| (s.radius, i))).collect();
    by_size.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let seed = by_size.get(by_size.len() / 2)?.1;
    let mut own = vec![false; samples.len()];
    own[seed] = true;
    let ways: [Vec<usize>; 2] = [(seed + 1..samples.len()).collect(), (0..seed).rev().collect()];
    for way in ways {
        let mut line: Vec<Section> = sections[seed].into_iter().collect();
        for &i in &way {
            let (Some(section), Some(&last)) = (sections[i], line.last()) else { continue };
            // The direction of the last few own sections; one radius back is far enough to be steady.
            let back = line.iter().rev().find(|s| s.centroid.distance(last.centroid) >= last.radius);
            let step = section.centroid - last.centroid;
            let gap = (samples[i].source - samples[if i > seed { i - 1 } else { i + 1 }].source).length();
            let aside = match back.and_then(|b| (last.centroid - b.centroid).try_normalize()) {
                Some(direction) => step.reject_from_normalized(direction).length(),
                None => 0.5 * step.length(),
            };
            let jump = (aside - 0.3 * gap) / last.radius;
            let growth = (section.radius - 0.2 * gap) / last.radius;
            if jump > 0.6 || (jump > 0.2 && growth > 1.2) || growth > 1.6 {
                continue;
            }
            own[i] = true;
            line.push(section);
        }
        // Just before the limb ends in something bigger its sections already lean that way.
        let Some(border) = way.iter().position(|&i| !own[i]) else { continue };
        for &i in way[..border].iter().rev() {
            let (Some(here), Some(section)) = (sections[i], sections[way[border.saturating_sub(1)]]) else { continue };
            if here.centroid.distance(section.centroid) > trim() * section.radius {
                break;
            }
            own[i] = false;
        }
    }
    Some(own)
}

/// The point and direction from which the line goes on straight beyond its start or end: the mean over two radii.
fn end_line(line: &[(Vec3, Vec3)], radius: f32, at_start: bool) -> (Vec3, Vec3) {
    let end = if at_start { 0 } else { line.len() - 1 };
    let (from, tangent) = line[end];
    let mut sum = Vec3::ZERO;
    for &(centre, tangent) in line {
        let far = centre.distance(from) / radius;
        if far < ext() {
            sum += tangent;
        }
    }
    (from, sum.try_normalize().unwrap_or(tangent))
}

/// The point of the line from `from` along the unit vector `direction` that comes closest to `ray`; `from` itself where the
/// line runs nearly along the ray.
fn under(from: Vec3, direction: Vec3, ray: &Ray) -> Vec3 {
    let along = direction.dot(ray.direction);
    let steep = 1.0 - along * along;
    if steep < 0.05 {
        return from;
    }
    let to = ray.origin - from;
    from + direction * ((direction.dot(to) - along * ray.direction.dot(to)) / steep)
}

/// Every `step`-th sample and the last.
fn every(samples: &[Sample], step: usize) -> Vec<Sample> {
    let mut some: Vec<Sample> = samples.iter().copied().step_by(step).collect();
    if (samples.len() - 1) % step != 0 {
        some.push(samples[samples.len() - 1]);
    }
    some
}

/// Mean of each point and its neighbours, which weigh less the more reaches away they are along the line.
fn smooth(points: &[Vec3], reach: f32) -> Vec<Vec3> {
    let mut along = vec![0.0; points.len()];
    for i in 1..points.len() {
        along[i] = along[i - 1] + points[i].distance(points[i - 1]);
    }
    let mean = |i: usize| {
        // Equally far to both sides, so that the mean does not shorten the line at its ends.
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

/// Each point with the direction of the secant that reaches at least `reach` to both sides, where the line is long
/// enough. `None` if all points are one.
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

/// The median; `None` of nothing.
fn median(values: impl Iterator<Item = f32>) -> Option<f32> {
    let mut values: Vec<f32> = values.collect();
    values.sort_by(f32::total_cmp);
    values.get(values.len() / 2).copied()
}
