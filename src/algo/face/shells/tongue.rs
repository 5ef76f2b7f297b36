//! The tongue among the parts of a mouth.
//!
//! Names of objects tell it where a file has them. Without names it is the part that lies within the arch of the teeth
//! and goes on from back to front along its middle, where a row of teeth has a gap.

use std::collections::BTreeMap;

use glam::Vec3;

use super::{ShellKind, Shells};
use crate::algo::face::{
    bones::{extent, map::FaceMap},
    landmarks::Landmarks,
};

/// Least length of a tongue from back to front, in distances of the eyes' outer corners.
const LENGTH: f32 = 0.25;
/// Largest width and height of a tongue as shares of its length.
const SLENDER: [f32; 2] = [1.2, 0.8];
/// Largest width of a tongue as a share of that of the widest part beside it, a row of teeth.
const WITHIN: f32 = 0.85;
/// Number of sections across a tongue, and the least number of them that the middle passes through.
const SECTIONS: usize = 10;
const PASSED: usize = 9;

/// Part of a mouth that the name of an object tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MouthName {
    /// The tongue.
    Tongue,
    /// Teeth or gums.
    Teeth,
}

impl MouthName {
    /// The part that a name tells; `None` if it tells none.
    pub fn of(name: &str) -> Option<Self> {
        let name = name.to_ascii_lowercase();
        let has = |words: &[&str]| words.iter().any(|word| name.contains(word));
        if has(&["tongue"]) {
            Some(Self::Tongue)
        } else if has(&["teeth", "tooth", "gums"]) {
            Some(Self::Teeth)
        } else {
            None
        }
    }
}

/// A shell that is neither skin nor eye.
struct InnerPart {
    low: Vec3,
    high: Vec3,
    points: usize,
    /// Numbers of points with a name of the tongue and with one of teeth.
    named: [usize; 2],
    /// Sections that a triangle on the middle passes through.
    passed: [bool; SECTIONS],
}

impl InnerPart {
    const EMPTY: Self =
        Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY, points: 0, named: [0; 2], passed: [false; SECTIONS] };

    fn is_named(&self, name: MouthName) -> bool {
        let named = match name {
            MouthName::Tongue => self.named[0],
            MouthName::Teeth => self.named[1],
        };
        2 * named > self.points
    }

    fn size(&self) -> Vec3 {
        self.high - self.low
    }

    fn middle(&self) -> Vec3 {
        0.5 * (self.low + self.high)
    }

    /// True for the shape of a tongue: slender, and whole along its middle.
    fn is_slender(&self, e: f32) -> bool {
        let size = self.size();
        size.z >= LENGTH * e
            && size.x <= SLENDER[0] * size.z
            && size.y <= SLENDER[1] * size.z
            && self.passed.iter().filter(|passed| **passed).count() >= PASSED
    }

    /// True for a part that lies in the arch of another, and not around it.
    fn lies_in(&self, teeth: &Self, e: f32) -> bool {
        let margin = 0.03 * e;
        let overlap = self.high.min(teeth.high) - self.low.max(teeth.low);
        let is_around = self.low.cmple(teeth.low + Vec3::splat(margin)).all()
            && self.high.cmpge(teeth.high - Vec3::splat(margin)).all();
        self.size().x <= WITHIN * teeth.size().x
            && self.low.x >= teeth.low.x - margin
            && self.high.x <= teeth.high.x + margin
            && overlap.z > 0.0
            && overlap.y > -0.2 * e
            && !is_around
    }
}

impl Shells {
    /// Marks the tongue as [`ShellKind::Tongue`], and what was marked before and is none as [`ShellKind::Inside`].
    ///
    /// `points` and `triangles` are those that the shells were found in, `landmarks` belong to them. `name_of` gives the part
    /// that the name of a point's object tells; a name decides, and without one shape and place do. Linear time.
    pub fn mark_tongue(
        &mut self,
        points: &[Vec3],
        triangles: &[[u32; 3]],
        landmarks: &Landmarks,
        name_of: &dyn Fn(usize) -> Option<MouthName>,
    ) {
        for kind in self.kinds.iter_mut().filter(|kind| **kind == ShellKind::Tongue) {
            *kind = ShellKind::Inside;
        }
        let map = FaceMap::new(landmarks, landmarks.symmetric, extent(points));
        if !map.trusted {
            return;
        }
        let parts = self.inner_parts(points, triangles, name_of);
        let named: Vec<u32> =
            parts.iter().filter(|(_, part)| part.is_named(MouthName::Tongue)).map(|(shell, _)| *shell).collect();
        let found: Vec<u32> =
            if named.is_empty() { tongue_by_shape(&parts, &map).into_iter().collect() } else { named };
        for shell in found {
            if let Some(kind) = self.kinds.get_mut(shell as usize) {
                *kind = ShellKind::Tongue;
            }
        }
    }

    fn inner_parts(
        &self,
        points: &[Vec3],
        triangles: &[[u32; 3]],
        name_of: &dyn Fn(usize) -> Option<MouthName>,
    ) -> BTreeMap<u32, InnerPart> {
        let mut parts: BTreeMap<u32, InnerPart> = BTreeMap::new();
        for (point, place) in points.iter().enumerate() {
            let Some(&shell) = self.shell_of.get(point).filter(|_| self.kind(point) == ShellKind::Inside) else {
                continue;
            };
            let part = parts.entry(shell).or_insert(InnerPart::EMPTY);
            part.low = part.low.min(*place);
            part.high = part.high.max(*place);
            part.points += 1;
            match name_of(point) {
                Some(MouthName::Tongue) => part.named[0] += 1,
                Some(MouthName::Teeth) => part.named[1] += 1,
                None => {}
            }
        }
        for corners in triangles {
            let [Some(a), Some(b), Some(c)] = corners.map(|corner| points.get(corner as usize).copied()) else {
                continue;
            };
            let Some(part) = self.shell_of.get(corners[0] as usize).and_then(|shell| parts.get_mut(shell)) else {
                continue;
            };
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            let (x, back, length) = (part.middle().x, part.low.z, part.size().z);
            if low.x > x || high.x < x {
                continue;
            }
            for (section, passed) in part.passed.iter_mut().enumerate() {
                let [from, to] = [section, section + 1].map(|end| back + length * end as f32 / SECTIONS as f32);
                *passed |= low.z < to && high.z > from;
            }
        }
        parts
    }
}

/// The shell whose shape and place are those of a tongue: behind the lips, and in the arch of a row of teeth.
fn tongue_by_shape(parts: &BTreeMap<u32, InnerPart>, map: &FaceMap) -> Option<u32> {
    let e = map.scale;
    let inside: Vec<(u32, &InnerPart)> = parts
        .iter()
        .filter(|(_, part)| {
            let (half, place) = map.fold(part.middle());
            let corner = half.lip_corner();
            place.x < 1.3 * corner.x
                && (place.y - corner.y).abs() < 0.4 * e
                && place.z < half.lip_line()[0].z + 0.02 * e
        })
        .map(|(shell, part)| (*shell, part))
        .collect();
    let is_tongue = |(shell, part): &&(u32, &InnerPart)| {
        (part.middle().x - map.middle).abs() < 0.1 * e
            && part.is_slender(e)
            && !part.is_named(MouthName::Teeth)
            && inside.iter().any(|(other, teeth)| other != shell && part.lies_in(teeth, e))
    };
    let slimness = |part: &InnerPart| part.size().z / part.size().x.max(f32::MIN_POSITIVE);
    let best = inside.iter().filter(is_tongue).max_by(|(a, one), (b, other)| {
        // The first of equals.
        slimness(one).total_cmp(&slimness(other)).then(b.cmp(a))
    });
    best.map(|(shell, _)| *shell)
}
