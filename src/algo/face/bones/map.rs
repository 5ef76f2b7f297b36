//! Map of a face: the part of the face at a place, measured from the landmarks.

use glam::Vec3;

use crate::algo::face::landmarks::Landmarks;

/// Least confidence at which landmarks locate lids and lips.
const TRUSTED: f32 = 0.3;

/// A part of the face that is clustered on its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Part {
    Forehead,
    Temple,
    Brow,
    UpperLid,
    LowerLid,
    Nose,
    Cheek,
    UpperLip,
    LowerLip,
    Corner,
    Jaw,
}

/// The landmarks of one half of the face, mirrored to positive x, the middle plane at 0; all lines run outwards.
#[derive(Debug, Clone)]
pub(crate) struct Half {
    pub brow: [Vec3; 5],
    pub upper_lid: [Vec3; 4],
    pub lower_lid: [Vec3; 4],
    pub upper_lip: [Vec3; 4],
    pub lower_lip: [Vec3; 4],
    pub upper_inner: [Vec3; 3],
    pub lower_inner: [Vec3; 3],
    pub bridge: [Vec3; 4],
    pub base: [Vec3; 3],
    pub jaw: [Vec3; 9],
}

/// Halves of a face, in which places are looked up.
#[derive(Debug, Clone)]
pub(crate) struct FaceMap {
    /// Left (+x), then right.
    pub halves: [Half; 2],
    /// x of the middle plane.
    pub middle: f32,
    /// The distance of the outer corners of the eyes, or a guess.
    pub scale: f32,
    /// Trust in the landmarks; without it every place is cheek.
    pub trusted: bool,
}

/// True for landmarks that are finite, with a distance between the eyes.
fn is_sound(landmarks: &Landmarks) -> bool {
    let distance = landmarks.eye_distance();
    landmarks.points.iter().all(|p| p.is_finite()) && distance > 0.0 && distance.is_finite()
}

/// The distance of the outer corners of the eyes; without sound landmarks `size`, which replaces it.
pub(crate) fn scale(landmarks: &Landmarks, size: f32) -> f32 {
    if is_sound(landmarks) { landmarks.eye_distance() } else { size.max(f32::MIN_POSITIVE) }
}

impl FaceMap {
    /// Makes the map of landmarks; `symmetric` makes both halves their mean. `size` replaces a missing distance of the
    /// eyes.
    pub fn new(landmarks: &Landmarks, symmetric: bool, size: f32) -> Self {
        let middle = if landmarks.middle.is_finite() { landmarks.middle } else { 0.0 };
        let at = |i: usize, side: f32| {
            let p = landmarks.points.get(i).copied().unwrap_or(Vec3::ZERO);
            Vec3::new(side * (p.x - middle), p.y, p.z)
        };
        let half = |side: f32, index: [usize; 43]| {
            let mut next = index.iter().map(|&i| at(i, side));
            let mut take = || next.next().unwrap_or(Vec3::ZERO);
            Half {
                brow: std::array::from_fn(|_| take()),
                upper_lid: std::array::from_fn(|_| take()),
                lower_lid: std::array::from_fn(|_| take()),
                upper_lip: std::array::from_fn(|_| take()),
                lower_lip: std::array::from_fn(|_| take()),
                upper_inner: std::array::from_fn(|_| take()),
                lower_inner: std::array::from_fn(|_| take()),
                bridge: std::array::from_fn(|_| take()),
                base: std::array::from_fn(|_| take()),
                jaw: std::array::from_fn(|_| take()),
            }
        };
        let mut left = half(1.0, LEFT);
        let mut right = half(-1.0, RIGHT);
        if symmetric {
            left.meet(&mut right);
        }
        let trusted = is_sound(landmarks) && landmarks.confidence >= TRUSTED;
        Self { halves: [left, right], middle, scale: scale(landmarks, size), trusted }
    }

    /// The half at a place, and the place in the half's coordinates.
    pub fn fold(&self, p: Vec3) -> (&Half, Vec3) {
        let x = p.x - self.middle;
        let half = if x < 0.0 { &self.halves[1] } else { &self.halves[0] };
        (half, Vec3::new(x.abs(), p.y, p.z))
    }

    /// The part at a place on the skin.
    pub fn part(&self, place: Vec3) -> Part {
        if !self.trusted {
            return Part::Cheek;
        }
        let (half, p) = self.fold(place);
        let e = self.scale;
        if let Some(part) = half.lip(p, e) {
            return part;
        }
        let upper = line_distance(&half.upper_lid, p);
        let lower = line_distance(&half.lower_lid, p);
        let brow = line_distance(&half.brow, p);
        let over = p.y > height(&half.eye_line(), p.x);
        if half.in_eye(p) {
            return if over { Part::UpperLid } else { Part::LowerLid };
        }
        let (lid_share, brow_share) = (upper.min(lower) / (0.09 * e), brow / (0.085 * e));
        if over && lid_share.min(brow_share) < 1.6 && p.x < half.brow[4].x * 1.03 && p.y < height(&half.brow, p.x) {
            return if lid_share < brow_share { Part::UpperLid } else { Part::Brow };
        }
        if !over && lower.min(upper) < 0.065 * e {
            return Part::LowerLid;
        }
        if lid_share < 0.6 {
            return Part::UpperLid;
        }
        if brow_share < 1.0 {
            return Part::Brow;
        }
        let wing = half.base[2];
        let top = half.bridge[0].y;
        let down = ((top - p.y) / (top - wing.y).max(1e-3 * e)).clamp(0.0, 1.0);
        if p.y < top + 0.03 * e && p.y > half.base[0].y - 0.07 * e && p.x < 0.09 * e + (1.3 * wing.x - 0.09 * e) * down
        {
            return Part::Nose;
        }
        let outer = half.upper_lid[3];
        if p.y > height(&half.brow, p.x) {
            return if p.x > 1.02 * outer.x { Part::Temple } else { Part::Forehead };
        }
        if p.x > 1.02 * outer.x && p.y > outer.y - 0.1 * e {
            return Part::Temple;
        }
        let corner = half.upper_lip[3];
        if p.y < height(&[corner, half.jaw[6]], p.x) { Part::Jaw } else { Part::Cheek }
    }

    /// Nearness of a place to brows, eyes, nose and mouth: 1 on them, falling to 0 over half the face.
    pub fn restless(&self, place: Vec3) -> f32 {
        if !self.trusted {
            return 0.0;
        }
        let (half, p) = self.fold(place);
        let lines: [&[Vec3]; 5] = [&half.brow, &half.lower_lid, &half.upper_lip, &half.lower_lip, &half.base];
        let distance = lines.iter().map(|line| line_distance(line, p)).fold(f32::INFINITY, f32::min);
        let far = distance / (0.2 * self.scale);
        1.0 / (1.0 + far * far)
    }

    /// Distance of a place inwards from the corner of the lips, as a share of half the mouth's width; negative outside.
    pub fn lip_inset(&self, place: Vec3) -> f32 {
        let (half, p) = self.fold(place);
        let corner = half.lip_corner();
        (corner.x - p.x) / corner.x.max(1e-3 * self.scale)
    }

    /// Distance of a place inwards from the nearer corner of an eye, as a share of half the eye's width; negative
    /// outside.
    pub fn lid_inset(&self, place: Vec3) -> f32 {
        let (half, p) = self.fold(place);
        let (inner, outer) = (half.upper_lid[0], half.upper_lid[3]);
        let width = (0.5 * (outer.x - inner.x)).max(1e-3 * self.scale);
        (p.x - inner.x).min(outer.x - p.x) / width
    }
}

impl Half {
    /// Makes both halves their mean.
    fn meet(&mut self, other: &mut Self) {
        fn mean(a: &mut [Vec3], b: &mut [Vec3]) {
            for (a, b) in a.iter_mut().zip(b) {
                *a = 0.5 * (*a + *b);
                *b = *a;
            }
        }
        mean(&mut self.brow, &mut other.brow);
        mean(&mut self.upper_lid, &mut other.upper_lid);
        mean(&mut self.lower_lid, &mut other.lower_lid);
        mean(&mut self.upper_lip, &mut other.upper_lip);
        mean(&mut self.lower_lip, &mut other.lower_lip);
        mean(&mut self.upper_inner, &mut other.upper_inner);
        mean(&mut self.lower_inner, &mut other.lower_inner);
        mean(&mut self.bridge, &mut other.bridge);
        mean(&mut self.base, &mut other.base);
        mean(&mut self.jaw, &mut other.jaw);
    }

    /// Corner of the mouth: between the outer corner of the lips and the end of the slit.
    pub fn lip_corner(&self) -> Vec3 {
        0.5 * (self.upper_lip[3] + self.upper_inner[2])
    }

    /// The line between the lips.
    pub fn lip_line(&self) -> [Vec3; 3] {
        std::array::from_fn(|i| 0.5 * (self.upper_inner[i] + self.lower_inner[i]))
    }

    /// The line between the lids.
    pub fn eye_line(&self) -> [Vec3; 4] {
        std::array::from_fn(|i| 0.5 * (self.upper_lid[i] + self.lower_lid[i]))
    }

    /// The middle of the eye's opening.
    pub fn eye(&self) -> Vec3 {
        0.25 * (self.upper_lid[1] + self.upper_lid[2] + self.lower_lid[1] + self.lower_lid[2])
    }

    fn in_eye(&self, p: Vec3) -> bool {
        p.x > self.upper_lid[0].x
            && p.x < self.upper_lid[3].x
            && p.y < height(&self.upper_lid, p.x)
            && p.y > height(&self.lower_lid, p.x)
    }

    /// Part of the lips at a place, if any.
    fn lip(&self, p: Vec3, e: f32) -> Option<Part> {
        let over = p.y > height(&self.lip_line(), p.x);
        let corner = self.lip_corner();
        let inside = p.x < corner.x
            && p.y < height(&self.upper_lip, p.x)
            && p.y > height(&self.lower_lip, p.x)
            && p.z > corner.z - 0.1 * e;
        let distance = line_distance(if over { &self.upper_lip } else { &self.lower_lip }, p);
        if !inside && distance > if over { 0.07 * e } else { 0.05 * e } {
            return None;
        }
        Some(match (p.x > 0.86 * corner.x, over) {
            (true, _) => Part::Corner,
            (_, true) => Part::UpperLip,
            (_, false) => Part::LowerLip,
        })
    }
}

/// Landmarks of the left half, in the order of the lines of [`Half`].
const LEFT: [usize; 43] = [
    22, 23, 24, 25, 26, 42, 43, 44, 45, 42, 47, 46, 45, 51, 52, 53, 54, 57, 56, 55, 54, 62, 63, 64, 66, 65, 64, 27, 28,
    29, 30, 33, 34, 35, 8, 9, 10, 11, 12, 13, 14, 15, 16,
];
/// Landmarks of the right half, in the same order.
const RIGHT: [usize; 43] = [
    21, 20, 19, 18, 17, 39, 38, 37, 36, 39, 40, 41, 36, 51, 50, 49, 48, 57, 58, 59, 48, 62, 61, 60, 66, 67, 60, 27, 28,
    29, 30, 33, 32, 31, 8, 7, 6, 5, 4, 3, 2, 1, 0,
];

/// The distance of a point from a line of segments.
pub(crate) fn line_distance(line: &[Vec3], p: Vec3) -> f32 {
    line.windows(2)
        .map(|s| (p - nearest_on_segment(s[0], s[1], p)).length_squared())
        .fold(f32::INFINITY, f32::min)
        .sqrt()
}

/// The point of a segment nearest to `p`.
pub(crate) fn nearest_on_segment(a: Vec3, b: Vec3, p: Vec3) -> Vec3 {
    let along = b - a;
    let t = (p - a).dot(along) / along.length_squared().max(f32::MIN_POSITIVE);
    a + along * t.clamp(0.0, 1.0)
}

/// The height of a line that runs outwards, at `x`; level beyond its ends.
pub(crate) fn height(line: &[Vec3], x: f32) -> f32 {
    for s in line.windows(2) {
        if x <= s[1].x {
            let t = (x - s[0].x) / (s[1].x - s[0].x).max(f32::MIN_POSITIVE);
            return s[0].y + (s[1].y - s[0].y) * t.clamp(0.0, 1.0);
        }
    }
    line.last().map_or(0.0, |p| p.y)
}
