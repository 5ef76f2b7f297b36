//! Tracking of a stroke through the mesh: the volume that it runs in.

use glam::{Vec2, Vec3};

use super::{HalfSpace, path::Path};
use crate::{
    algo::view::ViewPlane,
    mesh::{
        ray::{Hit, Ray},
        surface::{Surface, volumes},
    },
};

/// Number of rays that follow a stroke, whatever its length.
pub(super) const SAMPLES: usize = 96;

/// An interval of a ray, as distances from its origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Span {
    pub(super) near: f32,
    pub(super) far: f32,
}

impl Span {
    pub(super) fn middle(self) -> f32 {
        self.at(0.5)
    }

    pub(super) fn at(self, depth: f32) -> f32 {
        self.near + (self.far - self.near) * depth
    }

    fn overlap(self, other: Self) -> f32 {
        self.far.min(other.far) - self.near.max(other.near)
    }
}

/// A ray under the stroke that crosses the volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sample {
    /// Arc length along the stroke.
    pub(super) at: f32,
    /// The point on the view plane.
    pub(super) source: Vec2,
    pub(super) ray: Ray,
    /// Entry and exit of the volume.
    pub(super) span: Span,
    /// Point midway between entry and exit.
    pub(super) middle: Vec3,
}

/// The course of a stroke through one volume.
#[derive(Debug, Clone)]
pub(super) struct Track {
    /// Samples whose ray crosses the volume, by rising arc length; not empty.
    pub(super) samples: Vec<Sample>,
    pub(super) volume_at_start: u32,
    pub(super) volumes_at_start: u32,
    /// Marks a stroke that could have followed other volumes.
    pub(super) ambiguous: bool,
    volume: Option<u32>,
    /// The half of space in which volumes count.
    pub(super) within: Option<HalfSpace>,
}

impl Track {
    /// Follows a stroke; `None` if no ray hits the surface. `first` is the number of the volume, from zero, in which
    /// the stroke starts; without it the volume is chosen by `volume`, as everywhere.
    pub(super) fn follow(
        surface: &Surface,
        plane: &ViewPlane,
        path: &Path,
        volume: Option<u32>,
        first: Option<usize>,
        within: Option<HalfSpace>,
    ) -> Option<Self> {
        let mut hits = Vec::new();
        let mut samples: Vec<Sample> = Vec::with_capacity(SAMPLES);
        let (mut volume_at_start, mut volumes_at_start) = (1, 1);
        let mut ambiguous = false;
        for i in 0..SAMPLES {
            let at = path.length() * (i as f32 / (SAMPLES - 1) as f32);
            let source = path.at(at);
            let ray = plane.ray(source);
            surface.hits(&ray, &mut hits);
            let spans = spans(&hits, &ray, within);
            ambiguous |= spans.len() > 1;
            let span = match samples.last() {
                None if spans.is_empty() => continue,
                None => {
                    let chosen = first.filter(|first| *first < spans.len()).unwrap_or_else(|| start(&spans, volume));
                    (volume_at_start, volumes_at_start) = (chosen as u32 + 1, spans.len() as u32);
                    spans[chosen]
                }
                Some(before) => match continuing(&spans, before.span, volume) {
                    Some(span) => span,
                    None => continue,
                },
            };
            samples.push(Sample { at, source, ray, span, middle: ray.at(span.middle()) });
        }
        (!samples.is_empty()).then_some(Self { samples, volume_at_start, volumes_at_start, ambiguous, volume, within })
    }

    /// Arc lengths of the first and last sample.
    pub(super) fn covered(&self) -> [f32; 2] {
        [self.samples[0].at, self.samples[self.samples.len() - 1].at]
    }

    /// Returns `true` if a ray at a distance beyond the stroke's end still meets the volume in which the stroke ends.
    pub(super) fn goes_on(&self, surface: &Surface, plane: &ViewPlane, distance: f32) -> bool {
        let (middle, end) = (self.samples[self.samples.len() / 2], self.samples[self.samples.len() - 1]);
        let ray = plane.ray(end.source + (end.source - middle.source).normalize_or_zero() * distance);
        let mut hits = Vec::new();
        surface.hits(&ray, &mut hits);
        spans(&hits, &ray, self.within).iter().any(|span| span.overlap(end.span) > 0.0)
    }

    /// The span of a ray that belongs to the tracked volume near the arc length `at`.
    pub(super) fn span_at(&self, hits: &[Hit], ray: &Ray, at: f32) -> Option<Span> {
        let next = self.samples.partition_point(|s| s.at < at).min(self.samples.len() - 1);
        let nearest =
            if next > 0 && at - self.samples[next - 1].at < self.samples[next].at - at { next - 1 } else { next };
        continuing(&spans(hits, ray, self.within), self.samples[nearest].span, self.volume)
    }
}

/// The volumes of a ray, cut off at the border of a half-space. Sheets without thickness count only if there is no
/// volume; several of them make one span.
fn spans(hits: &[Hit], ray: &Ray, within: Option<HalfSpace>) -> Vec<Span> {
    let mut spans = whole_spans(hits);
    let Some([near, far]) = within.map(|half| half.covered(ray)) else { return spans };
    spans.retain_mut(|span| {
        let is_inside = span.far >= near && span.near <= far;
        *span = Span { near: span.near.max(near), far: span.far.min(far) };
        is_inside
    });
    spans
}

fn whole_spans(hits: &[Hit]) -> Vec<Span> {
    let all: Vec<Span> = volumes(hits).into_iter().map(|v| Span { near: v.near, far: v.far }).collect();
    let solid: Vec<Span> = all.iter().copied().filter(|s| s.far > s.near).collect();
    match (solid.is_empty(), hits) {
        (true, [first, .., last]) => vec![Span { near: first.distance, far: last.distance }],
        (true, _) => all,
        _ => solid,
    }
}

/// Index of the volume of a stroke at its start: the requested one, or the one that holds the midpoint of the closest
/// and furthest hit, or, if that midpoint lies outside of all volumes, the nearest.
fn start(spans: &[Span], volume: Option<u32>) -> usize {
    if let Some(n) = volume {
        return n.saturating_sub(1) as usize % spans.len();
    }
    let middle = 0.5 * (spans[0].near + spans[spans.len() - 1].far);
    spans.iter().position(|s| s.near <= middle && middle <= s.far).unwrap_or(0)
}

/// The volume that continues the span `before`; `None` without one.
///
/// If one volume divides into several, as the hips into two legs, one of these is chosen as at the start.
fn continuing(spans: &[Span], before: Span, volume: Option<u32>) -> Option<Span> {
    let within: Vec<Span> = spans.iter().copied().filter(|s| s.overlap(before) > 0.6 * (s.far - s.near)).collect();
    if within.len() > 1 {
        return Some(within[start(&within, volume)]);
    }
    let mut best = None;
    let mut most = f32::NEG_INFINITY;
    for &span in spans {
        let overlap = span.overlap(before);
        if overlap > most {
            (best, most) = (Some(span), overlap);
        }
    }
    best.filter(|_| most >= 0.0)
}
