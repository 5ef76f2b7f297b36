//! Strokes: a chain of joints from a freehand stroke.
//!
//! Pencil Rigger (section 5.3) proposes a joint at both ends; then, while some point of the stroke lies too far from
//! the line between two neighbours, a joint at the furthest point on either side of that line, recursively; and each
//! joint is placed in depth like a click. Two steps are added here, because a hand is unsteady and a midpoint of hits
//! is not central: the stroke stays in the volume it runs in (one leg of two, the arm before the torso), and each joint
//! takes one step to the centroid of the limb's cross-section.
//!
//! The work is in two parts. [`StrokeSamples`] follows the stroke through the mesh with rays, once. From these samples
//! [`StrokeSamples::chain`] chooses joints, which takes microseconds, so that a preview can vary the threshold or the
//! number of joints while the user watches.

mod axis;
mod corners;
mod gesture;
mod path;
mod section;
mod split;
mod track;

use glam::{Vec2, Vec3};
use thiserror::Error;

pub use gesture::{StrokeKind, classify, is_scribble, is_straight, joint_at};

use self::{
    axis::Axis,
    path::Path,
    section::Fan,
    track::{SAMPLES, Span, Track},
};
use super::{placement::PlaceSettings, view::ViewPlane};
use crate::mesh::{
    ray::{Hit, Ray},
    surface::Surface,
};

/// Largest number of joints of a stroke, for any setting.
pub const MAX_JOINTS: usize = 1000;

/// Depth of a volume, in radii, below which a joint is at the volume's edge.
const EDGE: f32 = 0.5;
/// Least share of the volume's depth between a joint and either side of the volume.
const MARGIN: f32 = 0.15;

/// Least share of a stroke that has to run beside a plane of symmetry for the stroke to have a side.
const SIDE_SHARE: f32 = 0.2;

/// Settings of a stroke's placement in depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StrokeSettings {
    /// Depth and volume, as for a click. The volume is chosen at the start of the stroke, and again where it divides (a
    /// pelvis into legs); in between the stroke stays in its volume. Without a number it is the volume that a click
    /// there would hit, or the nearest one if the stroke runs much more closely along the middle of that one. A depth
    /// other than one half is kept: recentring then only moves the joint across the view.
    pub place: PlaceSettings,
    /// Recentring: each joint takes one step to the centroid of the limb's section.
    pub recentre: bool,
}

/// Half of space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfSpace {
    /// A point of the border, in the surface's space.
    pub point: Vec3,
    /// Unit normal of the border, towards the half.
    pub normal: Vec3,
}

impl HalfSpace {
    /// The side of a plane of symmetry on which a stroke runs, of which some rays cross volumes on both sides (a pelvis
    /// before its legs); `None` if no ray does, or nearly all do.
    ///
    /// `spans` are the ends of the volume on each ray under the stroke, `point`, `normal` and `tolerance` the plane and
    /// the distance below which a place is on it.
    pub fn of_stroke(spans: &[[Vec3; 2]], point: Vec3, normal: Vec3, tolerance: f32) -> Option<Self> {
        let distance = |place: Vec3| (place - point).dot(normal);
        let ends = spans.iter().map(|ends| ends.map(distance));
        let is_across = |[a, b]: [f32; 2]| a.min(b) < -tolerance && a.max(b) > tolerance;
        let (across, beside): (Vec<_>, Vec<_>) = ends.partition(|ends| is_across(*ends));
        let least = SIDE_SHARE * spans.len() as f32;
        let positive = beside.iter().filter(|[a, b]| a + b > 0.0).count();
        let side = if 2 * positive >= beside.len() { 1.0 } else { -1.0 };
        (!across.is_empty() && beside.len() as f32 >= least).then_some(Self { point, normal: normal * side })
    }

    /// First and last distance of a ray inside of the half-space; the last below the first if it is nowhere.
    fn covered(&self, ray: &Ray) -> [f32; 2] {
        let (inside, rises) = ((ray.origin - self.point).dot(self.normal), ray.direction.dot(self.normal));
        let border = -inside / rises;
        match (rises > 1e-6, rises < -1e-6) {
            (true, _) => [border, f32::INFINITY],
            (_, true) => [f32::NEG_INFINITY, border],
            _ if inside >= 0.0 => [f32::NEG_INFINITY, f32::INFINITY],
            _ => [f32::INFINITY, f32::NEG_INFINITY],
        }
    }
}

impl Default for StrokeSettings {
    fn default() -> Self {
        Self { place: PlaceSettings::default(), recentre: true }
    }
}

/// Choice of the joints of a stroke.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ChainChoice {
    /// Joints wherever the stroke is further than this from the line between two neighbours; model units on the view
    /// plane. Zero, negative or NaN makes a joint of every point of the stroke, of [`MAX_JOINTS`] at most.
    Threshold(f32),
    /// Automatic: joints at the firm corners of the stroke as for [`ChainChoice::Threshold`] and at the bends of the
    /// limb, in depth, too (an ankle seen from the front), each moved to the bend near it. A piece that is most of the
    /// chain gets a joint to bend at, where it fits the limb best, so a limb drawn straight has at least three.
    Limb(f32),
    /// Exactly this many joints, where they fit the stroke and the limb best; fewer than two count as two, more than
    /// [`MAX_JOINTS`] as that many.
    Joints(usize),
}

/// Error of making a chain of a stroke.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum StrokeError {
    /// A stroke with fewer than two different finite points.
    #[error(
        "the stroke has {finite} usable points of {given}, which make no line; draw at least two different points in the view"
    )]
    TooShort {
        /// Number of points given.
        given: usize,
        /// Number of finite points, repetitions counted once.
        finite: usize,
    },
    /// A stroke without a point over the mesh.
    #[error("the stroke does not cross the mesh in this view; draw it over the mesh, or turn the view")]
    Misses,
}

/// A joint of a chain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlacedJoint {
    /// Position in the surface's space.
    pub position: Vec3,
    /// Radius of the circle with the area of the limb's section here; `None` if the surface is open here or recentring is off.
    pub radius: Option<f32>,
    /// The point of the stroke for this joint, on the view plane.
    pub source: Vec2,
    /// Number of hits of the ray through that point; 1 means that the joint lies on the surface.
    pub hits: usize,
}

/// Note to the user about a stroke.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StrokeNote {
    /// The stroke begins or ends beside the mesh; the end joint is at the nearest point of the stroke over the mesh.
    EndMoved {
        /// End of the stroke: `true` for its start.
        start: bool,
    },
    /// The ray at the start of the stroke goes through several volumes; one of them was chosen.
    VolumeChosen {
        /// Number of the chosen volume, from one.
        volume: u32,
        /// Number of volumes.
        of: u32,
    },
    /// Inner joints were left out because the mesh has a gap at their places.
    JointsLeftOut {
        /// Number of joints left out.
        count: usize,
    },
}

/// The joints of a stroke, in the stroke's order: each is the parent of the next.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StrokeChain {
    /// The joints; at least one, two unless both ends fall on one point.
    pub joints: Vec<PlacedJoint>,
    /// Notes to the user.
    pub notes: Vec<StrokeNote>,
}

/// A stroke followed through the mesh: all the data from which chains are chosen.
#[derive(Debug, Clone)]
pub struct StrokeSamples {
    plane: ViewPlane,
    settings: StrokeSettings,
    path: Path,
    track: Track,
    axis: Option<Axis>,
    fan: Fan,
}

impl StrokeSamples {
    /// Follows the stroke `points` (on `plane`) through `surface`.
    ///
    /// Points that are not finite and repetitions are dropped. Costs about a thousand rays whatever the number of points,
    /// twice that where a choice between volumes must be made.
    ///
    /// # Errors
    /// [`StrokeError::TooShort`] without two different points, [`StrokeError::Misses`] if nothing lies under the stroke.
    pub fn new(
        surface: &Surface,
        plane: &ViewPlane,
        points: &[Vec2],
        settings: StrokeSettings,
    ) -> Result<Self, StrokeError> {
        Self::within(surface, plane, points, settings, None)
    }

    /// Follows a stroke as [`StrokeSamples::new`] does, in half of space: volumes end at its border. A leg drawn from the
    /// side begins in half of the pelvis, not in its middle.
    ///
    /// # Errors
    /// As [`StrokeSamples::new`].
    pub fn within(
        surface: &Surface,
        plane: &ViewPlane,
        points: &[Vec2],
        settings: StrokeSettings,
        within: Option<HalfSpace>,
    ) -> Result<Self, StrokeError> {
        let path = Path::new(points)?;
        let fan = Fan::new();
        let with_axis = |track: Track| {
            let axis = Axis::find(surface, plane, &fan, &track);
            (track, axis)
        };
        let follow = |volume| Track::follow(surface, plane, &path, volume, None, within).map(with_axis);
        let (mut track, mut axis) = follow(settings.place.volume).ok_or(StrokeError::Misses)?;
        // A volume that the stroke leaves soon is not its limb: for example a hand before the hip at which a leg
        // begins.
        if settings.place.volume.is_none() && (track.samples.len() as f32) < 0.8 * SAMPLES as f32 {
            let others = (0..track.volumes_at_start as usize).rev();
            let others = others.filter_map(|first| Track::follow(surface, plane, &path, None, Some(first), within));
            let longest = others.max_by_key(|other| other.samples.len());
            if let Some(longest) =
                longest.filter(|other| other.samples.len() as f32 > 1.25 * track.samples.len() as f32)
            {
                (track, axis) = with_axis(longest);
            }
        }
        if settings.place.volume.is_none()
            && track.ambiguous
            && let Some(near) = follow(Some(1)).filter(|near| follows_front(near, (&track, axis.as_ref())))
        {
            (track, axis) = near;
        }
        Ok(Self { plane: *plane, settings, path, track, axis, fan })
    }

    /// Points midway through the volume under the stroke, at even lengths along it, in the surface's space; at least
    /// one.
    pub fn middles(&self) -> impl Iterator<Item = Vec3> {
        self.track.samples.iter().map(|sample| sample.middle)
    }

    /// Entry and exit of the volume under the stroke, at even lengths along it, in the surface's space.
    pub fn crossings(&self) -> impl Iterator<Item = [Vec3; 2]> {
        self.track.samples.iter().map(|sample| [sample.ray.at(sample.span.near), sample.ray.at(sample.span.far)])
    }

    /// Chooses joints and places them: a ray, and a fan of section rays if recentring is on, for each.
    pub fn chain(&self, surface: &Surface, choice: ChainChoice) -> StrokeChain {
        let places = match choice {
            ChainChoice::Threshold(threshold) => split::by_threshold(&self.path, threshold),
            ChainChoice::Limb(threshold) => corners::automatic(&self.path, &self.track, self.axis.as_ref(), threshold),
            ChainChoice::Joints(count) => corners::choose(&self.track, self.axis.as_ref(), count.clamp(2, MAX_JOINTS)),
        };
        let [first, last] = self.track.covered();
        let mut notes = Vec::new();
        if first > 0.0 {
            notes.push(StrokeNote::EndMoved { start: true });
        }
        if last < self.path.length() {
            notes.push(StrokeNote::EndMoved { start: false });
        }
        if self.track.volumes_at_start > 1 {
            notes
                .push(StrokeNote::VolumeChosen { volume: self.track.volume_at_start, of: self.track.volumes_at_start });
        }
        let mut chain = StrokeChain { joints: Vec::with_capacity(places.len()), notes };
        let mut left_out = 0;
        let mut hits = Vec::new();
        let mut before = None;
        for at in places {
            let at = at.clamp(first, last);
            // Several joints beyond the mesh's edge are all placed at its last point: one is enough.
            if before == Some(at) {
                continue;
            }
            before = Some(at);
            match self.place(surface, at, &mut hits) {
                Some(joint) => chain.joints.push(joint),
                None => left_out += 1,
            }
        }
        if left_out > 0 {
            chain.notes.push(StrokeNote::JointsLeftOut { count: left_out });
        }
        chain
    }

    /// The joint at the arc length `at` of the stroke.
    fn place(&self, surface: &Surface, at: f32, hits: &mut Vec<Hit>) -> Option<PlacedJoint> {
        let source = self.path.at(at);
        let ray = self.plane.ray(source);
        surface.hits(&ray, hits);
        let span = self.track.span_at(hits, &ray, at)?;
        let count = hits.len();
        let depth = self.settings.place.depth();
        let section = self.axis.as_ref().map(|axis| axis.recentre(surface, &self.fan, at, &ray, hits));
        let position = match section {
            Some((centroid, radius)) if self.settings.recentre && depth == 0.5 => {
                self.kept_inside(surface, centroid, ray.at(span.middle()), radius, at, hits)
            }
            // The chosen depth, at the section's centroid across the view.
            Some((centroid, _)) if self.settings.recentre => {
                let ray = self.plane.project(centroid).map_or(ray, |point| self.plane.ray(point));
                surface.hits(&ray, hits);
                let span = self.track.span_at(hits, &ray, at).unwrap_or(span);
                ray.at(span.at(depth))
            }
            _ => ray.at(span.at(depth)),
        };
        Some(PlacedJoint { position, radius: section.map(|(_, radius)| radius), source, hits: count })
    }
}

impl StrokeSamples {
    /// A joint moved from `position` by the least distance that puts it well inside of the volume: in depth, or, if the
    /// ray through it meets only an edge of the volume, towards `anchor`, which is inside. Sections that are open or
    /// extrapolated may have led the joint out.
    fn kept_inside(
        &self,
        surface: &Surface,
        position: Vec3,
        anchor: Vec3,
        radius: f32,
        at: f32,
        hits: &mut Vec<Hit>,
    ) -> Vec3 {
        for step in 0..4 {
            let place = position.lerp(anchor, step as f32 / 4.0);
            let Some(seen) = self.plane.project(place) else { break };
            let ray = self.plane.ray(seen);
            surface.hits(&ray, hits);
            let Some(Span { near, far }) = self.track.span_at(hits, &ray, at) else { continue };
            if far - near >= EDGE * radius {
                let depth = (place - ray.origin).dot(ray.direction);
                let margin = MARGIN * (far - near);
                let kept = depth.clamp(near + margin, far - margin);
                return if kept == depth { place } else { ray.at(kept) };
            }
        }
        anchor
    }
}

/// Returns `true` if a stroke follows the volumes nearest to the camera rather than those that a click would hit: it
/// runs along their middle much more closely (an arm before the torso), or stays over them much longer.
fn follows_front(near: &(Track, Option<Axis>), usual: (&Track, Option<&Axis>)) -> bool {
    let (near_length, usual_length) = (near.0.samples.len() as f32, usual.0.samples.len() as f32);
    let closer = match (&near.1, usual.1) {
        (Some(near), Some(usual)) => {
            near.aside() < 0.4 * near.radius && near.aside() + 0.2 * near.radius < usual.aside()
        }
        (near, usual) => near.is_some() && usual.is_none(),
    };
    near_length >= 0.9 * usual_length && (closer || usual_length < 0.8 * near_length)
}

/// Samples a stroke and chooses its joints in one call; see [`StrokeSamples`] for previews.
///
/// # Errors
/// As [`StrokeSamples::new`].
pub fn stroke_chain(
    surface: &Surface,
    plane: &ViewPlane,
    points: &[Vec2],
    settings: StrokeSettings,
    choice: ChainChoice,
) -> Result<StrokeChain, StrokeError> {
    Ok(StrokeSamples::new(surface, plane, points, settings)?.chain(surface, choice))
}
