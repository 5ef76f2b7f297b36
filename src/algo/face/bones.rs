//! Facial bones: one at each centroid of the facial mask, found by k-means.
//!
//! Lids, lips and brows are clustered on their own, so that no bone covers both lips or both lids and each part has
//! bones even at a low density; the rest of the mask is one part. Bones come in mirrored pairs unless asked otherwise:
//! the samples of both sides are folded onto one and its centroids mirrored, with a strip along the middle plane for
//! bones on the plane. Jaw and eyes get bones of their own on top.

mod extras;
pub(crate) mod map;
mod name;
mod sample;
mod spread;

use glam::Vec3;

use crate::algo::{
    face::{grouping::HeadGroups, landmarks::Landmarks, shells::Shells},
    kmeans::KMeansError,
};
use map::{FaceMap, Part};
use sample::Patch;
use spread::{FixedPlace, PARTS, Seat, Spreader};

/// A side of the character.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Side {
    /// The character's left, +x.
    Left,
    /// The plane of symmetry.
    Middle,
    /// The character's right.
    Right,
}

/// A region of the face.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Region {
    /// Forehead, above the brows.
    Forehead,
    /// Eyebrows.
    Brow,
    /// Eyelids.
    Lid,
    /// Nose.
    Nose,
    /// Cheeks.
    Cheek,
    /// Lips.
    Lip,
    /// Chin and lower jaw.
    Jaw,
    /// Temples, beside the eyes.
    Temple,
    /// Eyeballs.
    Eye,
}

/// Function of a facial bone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaceBoneKind {
    /// Moves a patch of skin.
    Skin,
    /// Turns the lower jaw.
    Jaw,
    /// Turns an eyeball.
    Eye,
    /// Moves the tongue; carried by the jaw.
    Tongue,
}

/// One facial bone, a child of the head bone; that of the tongue is one of the jaw bone.
#[derive(Debug, Clone, PartialEq)]
pub struct FaceBone {
    /// Position in head space.
    pub position: Vec3,
    /// Function of the bone.
    pub kind: FaceBoneKind,
    /// Region of the bone.
    pub region: Region,
    /// Side of the bone.
    pub side: Side,
    /// A name such as `brow_01_l`, unique among the bones.
    pub label: String,
    /// Index of the mirrored bone.
    pub pair: Option<usize>,
    /// Index of the given fixed place of the bone.
    pub fixed: Option<usize>,
}

/// A bone at a place that a person chose; it stays there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FixedBone {
    /// Position in head space.
    pub position: Vec3,
    /// Function of the bone.
    pub kind: FaceBoneKind,
}

/// Most bones on the skin. Their clustering takes time with the square of their number: thousands seem to hang.
pub const MOST_BONES: usize = 500;

/// Settings of the placement of bones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FaceBonesSettings {
    /// The number of bones on the skin, fixed ones included, [`MOST_BONES`] at most; jaw and eyes come on top.
    pub bones: usize,
    /// Seed of the clustering.
    pub seed: u64,
    /// Number of random starts of the clustering; the least error is kept.
    pub starts: usize,
    /// Places bones in mirrored pairs if `true`.
    pub symmetric: bool,
    /// Adds bones for jaw, eyes and tongue where the mesh has them if `true`.
    pub extras: bool,
}

impl Default for FaceBonesSettings {
    fn default() -> Self {
        Self { bones: 40, seed: 1, starts: 4, symmetric: true, extras: true }
    }
}

/// The bones of a face.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FaceBones {
    /// Skin bones by region and number, then jaw, eyes and tongue.
    pub bones: Vec<FaceBone>,
    /// Sum over the vertices of the mask of the squared distance to the nearest bone.
    pub square_error: f64,
    /// Largest number of rounds of a part's clustering.
    pub rounds: usize,
}

/// Error of placing bones.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FaceBonesError {
    /// A request for zero bones.
    #[error("no facial bones were asked for; ask for one at least")]
    NoBones,
    /// A mask with fewer vertices than bones.
    #[error(
        "{bones} facial bones do not fit on a facial mask of {vertices} vertices; give a mesh whose face has more, or ask for fewer bones"
    )]
    TooManyBones {
        /// Number of bones requested.
        bones: usize,
        /// Number of vertices of the mask.
        vertices: usize,
    },
    /// More bones than are placed.
    #[error("{bones} facial bones are too many; ask for {} at most", MOST_BONES)]
    AboveMost {
        /// Number of bones requested.
        bones: usize,
    },
    /// A mask without vertices.
    #[error("the facial mask is empty; check which way the head looks (up and forward)")]
    EmptyMask,
    /// More fixed bones than bones in all.
    #[error("{fixed} bones are fixed but only {bones} were asked for; ask for more or free some")]
    TooManyFixed {
        /// Number of fixed places.
        fixed: usize,
        /// Number of bones requested.
        bones: usize,
    },
    /// A point or fixed place that is not finite.
    #[error("{what} {index} is not finite; repair it first")]
    NotFinite {
        /// Kind of the point: "point" or "fixed bone".
        what: &'static str,
        /// Index of the first such point.
        index: usize,
    },
    /// A triangle with a corner that does not exist.
    #[error("triangle {triangle} has a corner past the last point: the mesh is damaged")]
    Triangle {
        /// Index of the first such triangle.
        triangle: usize,
    },
    /// Cancelled by the progress callback.
    #[error("placing facial bones was cancelled")]
    Cancelled,
    /// Error of the clustering.
    #[error("the facial mask could not be clustered: {0}")]
    Cluster(KMeansError),
}

impl From<KMeansError> for FaceBonesError {
    fn from(error: KMeansError) -> Self {
        match error {
            KMeansError::Cancelled => Self::Cancelled,
            error => Self::Cluster(error),
        }
    }
}

/// Places facial bones on the mask of `groups`.
///
/// `points` are in head space, `shells`, `groups` and `landmarks` belong to them. `fixed` are places of bones that stay
/// where they are and count among the bones; the rest is clustered around them. The answer has exactly
/// [`FaceBonesSettings::bones`] bones on the skin, each on the surface, then a jaw bone if the mouth can open, eye bones
/// where there are eyeballs, and with a jaw bone one of the tongue where there is one. The same input and seed give the same bits. `progress` is called with a share from 0
/// to 1 and returns whether to go on.
///
/// If the landmarks are too uncertain (creatures), the mask is clustered as one part and every bone is a `cheek`.
///
/// # Errors
/// See [`FaceBonesError`]; no input panics. Cost: linear in the triangles, and k-means on about a hundred samples a
/// bone.
pub fn place_bones(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    shells: &Shells,
    groups: &HeadGroups,
    landmarks: &Landmarks,
    fixed: &[FixedBone],
    settings: &FaceBonesSettings,
    progress: &(dyn Fn(f32) -> bool + Sync),
) -> Result<FaceBones, FaceBonesError> {
    check(points, triangles, fixed, settings)?;
    let map = FaceMap::new(landmarks, settings.symmetric, extent(points));
    let seen = &groups.visible;
    let vertices = seen.iter().filter(|&&s| s).count();
    if vertices == 0 {
        return Err(FaceBonesError::EmptyMask);
    }
    if settings.bones > vertices {
        return Err(FaceBonesError::TooManyBones { bones: settings.bones, vertices });
    }
    if settings.bones > MOST_BONES {
        return Err(FaceBonesError::AboveMost { bones: settings.bones });
    }
    let patches = sample::patches(points, triangles, seen, &map, group_of, PARTS.len());
    let on_skin: Vec<FixedPlace> = fixed
        .iter()
        .enumerate()
        .filter(|(_, f)| f.kind == FaceBoneKind::Skin)
        .map(|(index, f)| {
            let place = f.position;
            let part = group_of(map.part(place));
            let middle = !PARTS[part].lateral && (place.x - map.middle).abs() < 0.01 * map.scale;
            FixedPlace { place, index, part, middle }
        })
        .collect();
    let mut spreader = Spreader { map: &map, settings, progress, rounds: 0, pairs: 0 };
    let mut seats = spread(&mut spreader, &patches, &on_skin)?;
    let rounds = spreader.rounds;
    let parts: Vec<Part> = seats.iter().map(|s| part_of(s, &map)).collect();
    drop_onto_skin(&mut seats, points, triangles, seen, &map, landmarks.symmetric && settings.symmetric);
    let mut bones = name::name(&seats, &parts, &map);
    let square_error = points
        .iter()
        .zip(seen)
        .filter(|(_, seen)| **seen)
        .map(|(p, _)| f64::from(bones.iter().map(|b| b.position.distance_squared(*p)).fold(f32::INFINITY, f32::min)))
        .sum();
    extras::add(points, shells, landmarks, &map, fixed, settings.extras, &mut bones);
    if !progress(1.0) {
        return Err(FaceBonesError::Cancelled);
    }
    Ok(FaceBones { bones, square_error, rounds })
}

fn check(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    fixed: &[FixedBone],
    settings: &FaceBonesSettings,
) -> Result<(), FaceBonesError> {
    if settings.bones == 0 {
        return Err(FaceBonesError::NoBones);
    }
    let on_skin = fixed.iter().filter(|f| f.kind == FaceBoneKind::Skin).count();
    if on_skin > settings.bones {
        return Err(FaceBonesError::TooManyFixed { fixed: on_skin, bones: settings.bones });
    }
    if let Some(index) = points.iter().position(|p| !p.is_finite()) {
        return Err(FaceBonesError::NotFinite { what: "point", index });
    }
    if let Some(index) = fixed.iter().position(|f| !f.position.is_finite()) {
        return Err(FaceBonesError::NotFinite { what: "fixed bone", index });
    }
    if let Some(triangle) = triangles.iter().position(|t| t.iter().any(|&i| i as usize >= points.len())) {
        return Err(FaceBonesError::Triangle { triangle });
    }
    Ok(())
}

/// Substitute for the distance of the eyes: two fifths of the mesh's largest extent.
pub(crate) fn extent(points: &[Vec3]) -> f32 {
    let low = points.iter().fold(Vec3::INFINITY, |a, &b| a.min(b));
    let high = points.iter().fold(Vec3::NEG_INFINITY, |a, &b| a.max(b));
    0.4 * (high - low).max_element()
}

/// Index in [`PARTS`] of the group in which a part of the face is clustered.
fn group_of(part: Part) -> usize {
    match part {
        Part::UpperLip => 1,
        Part::LowerLip => 2,
        Part::Corner => 3,
        Part::Brow => 4,
        Part::UpperLid => 5,
        Part::LowerLid => 6,
        _ => 0,
    }
}

/// The part of a seat: the part that it was clustered in, or, for a seat of the rest, the part at its place.
fn part_of(seat: &Seat, map: &FaceMap) -> Part {
    match seat.part {
        1 => Part::UpperLip,
        2 => Part::LowerLip,
        3 => Part::Corner,
        4 => Part::Brow,
        5 => Part::UpperLid,
        6 => Part::LowerLid,
        _ => {
            let part = map.part(seat.place);
            // A centroid of the rest that lies over a hole in it is named after the surrounding skin.
            match part {
                Part::UpperLid | Part::LowerLid | Part::UpperLip | Part::Corner => Part::Cheek,
                Part::LowerLip => Part::Jaw,
                Part::Brow => Part::Forehead,
                part => part,
            }
        }
    }
}

/// Seats for all bones, part by part.
fn spread(spreader: &mut Spreader, patches: &[[Patch; 2]], fixed: &[FixedPlace]) -> Result<Vec<Seat>, FaceBonesError> {
    let settings = *spreader.settings;
    let of = |part: usize| fixed.iter().copied().filter(|f| f.part == part).collect::<Vec<_>>();
    let mut symmetric = settings.symmetric;
    let mut least: Vec<usize> = (0..PARTS.len()).map(|part| spreader.needed(&of(part))).collect();
    if !symmetric || least.iter().sum::<usize>() > settings.bones {
        // The partners of so many fixed bones do not fit.
        symmetric = false;
        least = (0..PARTS.len()).map(|part| of(part).len()).collect();
    }
    let empty: Vec<bool> = patches.iter().map(|p| p.iter().all(Patch::is_empty)).collect();
    let mut quotas = spread::quotas(settings.bones, &least, &empty, symmetric);
    // Bones without room anywhere go to the largest part in the middle.
    let missing = settings.bones - quotas.iter().sum::<usize>().min(settings.bones);
    if missing > 0
        && let Some(part) = (0..PARTS.len()).find(|&p| !empty[p])
    {
        quotas[part] += missing;
    }
    let mut seats = Vec::with_capacity(settings.bones);
    for (part, &count) in quotas.iter().enumerate().filter(|(_, count)| **count > 0) {
        let fixed = of(part);
        let sides = &patches[part];
        let pairs = symmetric && (!PARTS[part].lateral || count % 2 == 0);
        if pairs {
            spreader.mirrored(part, sides, count, &fixed, &mut seats)?;
        } else if PARTS[part].lateral && !sides[0].is_empty() && !sides[1].is_empty() {
            let is_right = |f: &FixedPlace| f.place.x < spreader.map.middle;
            let right: Vec<FixedPlace> = fixed.iter().copied().filter(is_right).collect();
            let left: Vec<FixedPlace> = fixed.iter().copied().filter(|f| !is_right(f)).collect();
            let on_left = count.div_ceil(2).clamp(left.len(), count - right.len());
            spreader.plain(part, &[&sides[0]], on_left, &left, &mut seats)?;
            spreader.plain(part, &[&sides[1]], count - on_left, &right, &mut seats)?;
        } else {
            spreader.plain(part, &[&sides[0], &sides[1]], count, &fixed, &mut seats)?;
        }
    }
    Ok(seats)
}

/// Moves free seats to the nearest place on the mask's triangles; pairs stay mirror images where the mesh is symmetric.
fn drop_onto_skin(
    seats: &mut [Seat],
    points: &[Vec3],
    triangles: &[[u32; 3]],
    seen: &[bool],
    map: &FaceMap,
    mirror: bool,
) {
    let skin: Vec<(usize, [Vec3; 3])> = triangles
        .iter()
        .filter(|t| t.iter().all(|&i| seen.get(i as usize).copied().unwrap_or(false)))
        .map(|t| t.map(|i| points[i as usize]))
        .map(|c| (group_of(map.part((c[0] + c[1] + c[2]) / 3.0)), c))
        .collect();
    let drop = |seat: &Seat| {
        let mut best = (f32::INFINITY, seat.place);
        // The seat's own part comes first: the other lip may be nearer.
        for own in [true, false] {
            for (_, c) in skin.iter().filter(|(part, _)| !own || *part == seat.part) {
                let sphere = ((c[0] + c[1] + c[2]) / 3.0).distance_squared(seat.place);
                let reach = c[0].distance_squared(c[1]).max(c[0].distance_squared(c[2]));
                if sphere > 2.0 * (best.0 + reach) {
                    continue;
                }
                let on = nearest_on_triangle(c, seat.place);
                let distance = on.distance_squared(seat.place);
                if distance < best.0 {
                    best = (distance, on);
                }
            }
            if best.0.is_finite() {
                break;
            }
        }
        best.1
    };
    for i in 0..seats.len() {
        if seats[i].fixed.is_some() {
            continue;
        }
        let mut place = drop(&seats[i]);
        if seats[i].middle {
            place.x = map.middle;
        }
        if mirror
            && let Some(other) = seats[..i].iter().find(|s| s.pair.is_some() && s.pair == seats[i].pair)
            && other.fixed.is_none()
        {
            place = other.place.with_x(2.0 * map.middle - other.place.x);
        }
        seats[i].place = place;
    }
}

/// The point of a triangle nearest to `p`.
fn nearest_on_triangle(c: &[Vec3; 3], p: Vec3) -> Vec3 {
    let normal = (c[1] - c[0]).cross(c[2] - c[0]);
    let inside = (0..3).all(|i| {
        let (a, b) = (c[i], c[(i + 1) % 3]);
        (b - a).cross(p - a).dot(normal) >= 0.0
    });
    if inside && normal.length_squared() > 0.0 {
        return p - normal * ((p - c[0]).dot(normal) / normal.length_squared());
    }
    (0..3)
        .map(|i| map::nearest_on_segment(c[i], c[(i + 1) % 3], p))
        .min_by(|a, b| a.distance_squared(p).total_cmp(&b.distance_squared(p)))
        .unwrap_or(p)
}

/// Region of the face at a place on the skin.
pub fn region_of(position: Vec3, landmarks: &Landmarks) -> Region {
    name::region(FaceMap::new(landmarks, landmarks.symmetric, 1.0).part(position)).0
}

/// Side of the face at a place; the middle is a strip of a hundredth of the eyes' distance either way.
pub fn side_of(position: Vec3, landmarks: &Landmarks) -> Side {
    let map = FaceMap::new(landmarks, true, 0.0);
    match position.x - map.middle {
        x if x.abs() <= 0.01 * map.scale => Side::Middle,
        x if x < 0.0 => Side::Right,
        _ => Side::Left,
    }
}

/// Label of a bone: `brow_01_l`; `jaw`, `eye_l` and `tongue` for jaw, eyes and tongue.
pub fn label(region: Region, side: Side, number: usize, kind: FaceBoneKind) -> String {
    match kind {
        FaceBoneKind::Skin => format!("{}_{number:02}_{}", region.word(), side.letter()),
        FaceBoneKind::Jaw => "jaw".to_owned(),
        FaceBoneKind::Eye => format!("eye_{}", side.letter()),
        FaceBoneKind::Tongue => "tongue".to_owned(),
    }
}
