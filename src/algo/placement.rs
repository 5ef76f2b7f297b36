//! Placing a joint in depth: a ray through the surface, and a point between its hits.
//!
//! A joint is placed at the midpoint of the closest and the furthest hit, at the hit itself if there is only one, and
//! not at all without hits (Pencil Rigger, section 3.2). A depth other than one half reaches any point between the two,
//! which that paper's section 5.1 leaves to the future. If a ray goes through several volumes, such as an arm before a
//! torso or one leg behind the other, [`PlaceSettings::volume`] takes the entry and exit of one of them instead.

use glam::Vec3;

use crate::mesh::{
    ray::{Hit, Ray},
    surface::{Surface, Volume, volumes},
};

/// Settings of the conversion of a ray's hits to a position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaceSettings {
    /// Depth: 0 at the near hit, 1 at the far hit; clamped, and one half for NaN.
    pub depth: f32,
    /// Volume: `None` spans the closest and the furthest hit. `Some(n)` takes the n-th entry/exit pair from the camera,
    /// counted from one and starting over after the last; 0 counts as 1.
    pub volume: Option<u32>,
}

impl Default for PlaceSettings {
    fn default() -> Self {
        Self { depth: 0.5, volume: None }
    }
}

impl PlaceSettings {
    /// The depth clamped to 0 to 1.
    pub fn depth(&self) -> f32 {
        if self.depth.is_nan() { 0.5 } else { self.depth.clamp(0.0, 1.0) }
    }
}

/// Position of a joint that is placed with a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Placement {
    /// No joint: the ray misses the surface.
    Nothing,
    /// A joint at the only hit of the ray.
    Single {
        /// Position of the hit, in the surface's space.
        position: Vec3,
    },
    /// A joint between two hits.
    Between {
        /// Position of the joint, in the surface's space.
        position: Vec3,
        /// The near end of the span that the depth runs along.
        near: Vec3,
        /// The far end of the span.
        far: Vec3,
        /// Number of the span's volume, from one, if one was requested.
        volume: Option<u32>,
        /// Number of volumes on the ray. More than one is worth a note to the user: the midpoint of the closest and
        /// furthest hit may lie between volumes, outside the body.
        volumes: u32,
    },
}

impl Placement {
    /// The joint's position, if there is one.
    pub fn position(&self) -> Option<Vec3> {
        match *self {
            Self::Nothing => None,
            Self::Single { position } | Self::Between { position, .. } => Some(position),
        }
    }
}

/// Places a joint with `ray`: one query of the surface.
pub fn place(surface: &Surface, ray: &Ray, settings: PlaceSettings) -> Placement {
    let mut hits = Vec::new();
    surface.hits(ray, &mut hits);
    place_hits(ray, &hits, settings)
}

/// Places a joint, given all `hits` of `ray`, nearest first.
///
/// If a volume is requested but the hits make no pair (an open sheet), the span of all hits is taken.
pub fn place_hits(ray: &Ray, hits: &[Hit], settings: PlaceSettings) -> Placement {
    let (first, last) = match hits {
        [] => return Placement::Nothing,
        [only] => return Placement::Single { position: ray.at(only.distance) },
        [first, .., last] => (first.distance, last.distance),
    };
    let pairs: Vec<Volume> = volumes(hits).into_iter().filter(|pair| pair.far > pair.near).collect();
    let chosen = settings.volume.and_then(|n| nth_volume(&pairs, n));
    let span = chosen.map_or(Volume { near: first, far: last }, |(_, span)| span);
    Placement::Between {
        position: ray.at(span.near + (span.far - span.near) * settings.depth()),
        near: ray.at(span.near),
        far: ray.at(span.far),
        volume: chosen.map(|(index, _)| index),
        volumes: pairs.len() as u32,
    }
}

/// The n-th volume, counted from one and starting over after the last, with its number.
fn nth_volume(pairs: &[Volume], n: u32) -> Option<(u32, Volume)> {
    let count = u32::try_from(pairs.len()).ok().filter(|&count| count > 0)?;
    let index = n.saturating_sub(1) % count;
    Some((index + 1, pairs[index as usize]))
}
