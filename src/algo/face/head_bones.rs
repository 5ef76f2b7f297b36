//! Head and neck bones: one through each mean of the middle group.
//!
//! After "automatic placement of bones on face models", section 3.1: the head bone passes the mean of the upper part in
//! the direction of up, the neck bone the mean of the lower part in the direction of the neck, and the two are joined.
//! Seen from the side these two lines meet in the joint. For a straight neck that meets the head's line far from the
//! skull's base or not at all, the joint is the skull's base.

use glam::{Vec2, Vec3};
use thiserror::Error;

use super::{
    grouping::HeadGroups,
    landmarks::Landmarks,
    sections::{self, Section, border},
};

/// A bone from its joint to its end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bone {
    /// Position of the joint, about which the bone turns.
    pub head: Vec3,
    /// Position of the bone's end.
    pub tail: Vec3,
}

/// The two bones that carry a face, joined: the neck's tail is the head's head.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeadBones {
    /// Bone from the root of the neck to the base of the skull.
    pub neck: Bone,
    /// Bone from the base of the skull to the crown.
    pub head: Bone,
}

/// Error of placing head and neck bones.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum HeadBonesError {
    /// No points or triangles.
    #[error("the head has no points or no triangles to put bones into; pick a mesh with a surface")]
    Empty,
    /// A coordinate that is not finite.
    #[error("point {point} has a coordinate that is not a finite number; remove it or repair the mesh")]
    NotFinite {
        /// Index of the point.
        point: usize,
    },
    /// A mesh without height.
    #[error("the head is flat: a head bone needs height; check which way is up")]
    Flat,
}

/// Largest width of a neck's section, relative to its narrowest one.
const NECK_WIDENS: f32 = 1.25;
/// Largest height of the skull's base between chin and crown: about the upper lip.
const SKULL_BASE: f32 = 0.35;
/// Length of the shortest neck bone, as a share of the height from chin to crown.
const SHORTEST: f32 = 0.2;
/// Inset of a bone's start from the end of the mesh, as a share of the way.
const EDGE: f32 = 0.06;
/// Largest distance of the neck bone from the middle of the neck, as a share of the extent.
const INWARD: f32 = 0.25;

/// Places head and neck bones.
///
/// All in head space (+x the character's left, +y up, +z forward) and one unit. The head bone is upright, above the
/// groups' upper mean. A neck that leaves the head backwards, as with most quadrupeds, is followed between its open end
/// and the skull; a head without neck gets a short neck bone just below the skull's base.
///
/// # Errors
/// [`HeadBonesError`]: no points or triangles, coordinates that are not finite, no height. Linear time.
pub fn head_bones(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    groups: &HeadGroups,
    landmarks: &Landmarks,
) -> Result<HeadBones, HeadBonesError> {
    if points.is_empty() || triangles.is_empty() {
        return Err(HeadBonesError::Empty);
    }
    if let Some(point) = points.iter().position(|point| !point.is_finite()) {
        return Err(HeadBonesError::NotFinite { point });
    }
    let (low, high) = points.iter().fold((Vec3::MAX, Vec3::MIN), |(low, high), p| (low.min(*p), high.max(*p)));
    if high.y <= low.y {
        return Err(HeadBonesError::Flat);
    }
    let shape = Shape { points, triangles, low, high, chin: groups.chin };
    let center = (landmarks.points[36] + landmarks.points[45]) * 0.25 + groups.upper_mean * 0.5;
    let end = border::largest(points, triangles).filter(|end| end.is_neck(low, high, center));
    let bones = match end {
        Some(end) if leaves_backwards(&end, center) => slanted(&shape, end.center, center, groups),
        end => upright(&shape, end.as_ref(), groups),
    };
    Ok(if landmarks.symmetric { centered(bones, landmarks.middle) } else { bones })
}

/// Shape of the head, shared by both ways of placing.
struct Shape<'a> {
    points: &'a [Vec3],
    triangles: &'a [[u32; 3]],
    low: Vec3,
    high: Vec3,
    chin: f32,
}

/// Returns `true` if a neck leaves the head backwards rather than downwards: by the position of its end and the
/// direction of the cut.
fn leaves_backwards(end: &border::End, center: Vec3) -> bool {
    let down = -(end.center - center).normalize_or_zero().y;
    let cut = end.high - end.low;
    down < 0.6 || (down < 0.9 && cut.y > cut.z)
}

/// A human neck: below the head.
fn upright(shape: &Shape, end: Option<&border::End>, groups: &HeadGroups) -> HeadBones {
    let upper = groups.upper_mean;
    let crown = crown(shape, upper);
    let chin = shape.chin.clamp(shape.low.y, crown);
    let skull = chin + SKULL_BASE * (crown - chin);
    let below = chin - shape.low.y;
    let sections = if below > 0.1 * (crown - chin) {
        sections::neck(shape.points, shape.triangles, end, shape.low.y, chin)
    } else {
        Vec::new()
    };
    let Some(neck) = NeckLine::new(&sections) else {
        // Without a neck: a short bone at the bottom of the head.
        let (bottom, top) = column(shape, upper).unwrap_or((shape.low.y, crown));
        let root = upper.with_y(bottom + EDGE * (top - bottom));
        let joint = (chin + skull) * 0.5;
        let shortest = root.y + SHORTEST * (crown - root.y);
        return joined(root, upper.with_y(joint.max(shortest).min((root.y + crown) * 0.5)), crown);
    };
    // The neck's line passes the lower mean if that lies in the neck; a mean among the shoulders does not count.
    let place = neck.at(groups.lower_mean.y);
    let off = (groups.lower_mean - place).with_x(0.0);
    let inside = groups.lower_mean.y >= neck.bottom && groups.lower_mean.y <= chin && off.length() <= 0.25 * neck.width;
    let shift = if inside { off.with_y(0.0) } else { Vec3::ZERO };
    let meet = if neck.slope.y.abs() > 1e-3 {
        neck.middle.y + (upper.z - neck.middle.z - shift.z) / neck.slope.y
    } else {
        (chin + skull) * 0.5
    };
    let mut joint = upper.with_y(meet.clamp(chin, skull));
    let mut root = neck.at(neck.bottom) + shift;
    let shortest = SHORTEST * (crown - chin);
    if joint.y - root.y < shortest {
        joint.y = joint.y.max((root.y + shortest).min(skull));
        // A neck cut close below the chin: the bone is lengthened towards its end.
        let missing = shortest - (joint.y - root.y);
        if let Some(end) = end.filter(|end| missing > 0.0 && end.center.y < root.y) {
            root = root.lerp(end.center, (missing / (root.y - end.center.y)).min(1.0 - EDGE));
        }
    }
    joined(inward(shape, root), joint, crown)
}

/// The neck of a quadruped: behind the head, from its open end to the skull.
fn slanted(shape: &Shape, end: Vec3, center: Vec3, groups: &HeadGroups) -> HeadBones {
    let upper = groups.upper_mean;
    let axis = (center - end).normalize_or_zero();
    let (from, to) = (end.dot(axis), center.dot(axis));
    let sections = sections::sections(shape.points, shape.triangles, axis, [from + 0.04 * (to - from), to], 32);
    let (bottom, top) = column(shape, upper).unwrap_or((shape.low.y, shape.high.y));
    let height = top - bottom;
    // The cut is ragged, so the middle of its border is more exact than the first sections.
    let root = end + axis * EDGE * (to - from);
    // Passage of the neck's middle below the head's line; not above the skull's base.
    let passing = sections
        .iter()
        .min_by(|a, b| (a.centroid.z - upper.z).abs().total_cmp(&(b.centroid.z - upper.z).abs()))
        .map_or(upper.y, |section| section.centroid.y);
    let mut joint = upper.with_y(passing.clamp(bottom + 0.2 * height, bottom + 0.6 * height));
    let shortest = SHORTEST * height;
    if root.distance(joint) < shortest {
        joint.y = (root.y + shortest).clamp(joint.y, (bottom + 0.6 * height).max(joint.y));
    }
    joined(root, joint, top)
}

/// A place in the neck, moved towards the middle of its horizontal section if it is near the skin.
fn inward(shape: &Shape, place: Vec3) -> Vec3 {
    let range = [place.y, place.y + 1e-4 * (shape.high.y - shape.low.y)];
    let found = sections::sections(shape.points, shape.triangles, Vec3::Y, range, 2);
    let Some(section) = found.first() else { return place };
    let reach = Vec3::new(section.extent.y, 0.0, section.extent.x) * INWARD;
    let off = (place - section.centroid).clamp(-reach, reach);
    (section.centroid + off).with_y(place.y)
}

fn joined(root: Vec3, joint: Vec3, crown: f32) -> HeadBones {
    HeadBones { neck: Bone { head: root, tail: joint }, head: Bone { head: joint, tail: joint.with_y(crown) } }
}

/// The bones moved onto the plane of symmetry.
fn centered(bones: HeadBones, middle: f32) -> HeadBones {
    let onto = |bone: Bone| Bone { head: bone.head.with_x(middle), tail: bone.tail.with_x(middle) };
    HeadBones { neck: onto(bones.neck), head: onto(bones.head) }
}

/// The crown's height: the top of the head straight above a place.
fn crown(shape: &Shape, above: Vec3) -> f32 {
    column(shape, above).map_or(shape.high.y, |(_, top)| top).max(above.y)
}

/// Heights at which the vertical line through a place enters and leaves the mesh.
fn column(shape: &Shape, through: Vec3) -> Option<(f32, f32)> {
    let at = Vec2::new(through.x, through.z);
    let (mut bottom, mut top) = (f32::MAX, f32::MIN);
    for triangle in shape.triangles {
        let [Some(a), Some(b), Some(c)] = triangle.map(|corner| shape.points.get(corner as usize)) else { continue };
        let [p, q, r] = [a, b, c].map(|corner| Vec2::new(corner.x, corner.z) - at);
        let area = (q - p).perp_dot(r - p);
        let weights = Vec3::new(q.perp_dot(r), r.perp_dot(p), p.perp_dot(q)) / area;
        // The triangle is enlarged a little, so that no line along an edge slips through.
        if area != 0.0 && weights.min_element() >= -1e-4 {
            let height = weights.dot(Vec3::new(a.y, b.y, c.y));
            bottom = bottom.min(height);
            top = top.max(height);
        }
    }
    match top > bottom {
        true => Some((bottom, top)),
        // The line leaves through the open end.
        false => (top > through.y).then_some((shape.low.y, top)),
    }
}

/// The middle of an upright neck: x and z as straight functions of y.
struct NeckLine {
    /// Mean of the centroids.
    middle: Vec3,
    /// Change of x and z with y.
    slope: Vec2,
    /// Height of the neck's root.
    bottom: f32,
    /// Depth and width of the narrowest section.
    width: f32,
}

impl NeckLine {
    /// Fits the line to the centroids of the sections near the narrowest.
    fn new(sections: &[Section]) -> Option<Self> {
        let narrow = sections::narrowest(sections)?;
        let width = sections[narrow].size();
        let is_neck = |section: &&Section| section.size() <= NECK_WIDENS * width;
        let first = narrow - sections[..narrow].iter().rev().take_while(is_neck).count();
        let last = narrow + sections[narrow..].iter().take_while(is_neck).count();
        let neck = &sections[first..last.max(first + 1)];
        let count = neck.len() as f32;
        let middle = neck.iter().map(|section| section.centroid).sum::<Vec3>() / count;
        let (mut xy, mut zy, mut yy) = (0.0, 0.0, 0.0);
        for section in neck {
            let off = section.centroid - middle;
            xy += off.x * off.y;
            zy += off.z * off.y;
            yy += off.y * off.y;
        }
        // A slope of more than 25 degrees belongs to chin and shoulders, not to a neck.
        let slope = if yy > 0.0 && neck.len() >= 3 { Vec2::new(xy, zy) / yy } else { Vec2::ZERO };
        Some(Self { middle, slope: slope.clamp_length_max(0.45), bottom: neck[0].at, width })
    }

    /// Point of the line at a height.
    fn at(&self, height: f32) -> Vec3 {
        let up = height - self.middle.y;
        Vec3::new(self.middle.x + self.slope.x * up, height, self.middle.z + self.slope.y * up)
    }
}
