//! Grouping: face, middle and back of a head by average linkage in depth.
//!
//! After "automatic placement of bones on face models", section 3.1: the vertices are merged by their depth until three
//! groups remain, and the middle one again by height into an upper and a lower part. A plain cut at three depends on
//! how the modeller spread the vertices and may leave the sides of the jaw out of the face. So if the front group
//! misses landmarks, the same merge history is cut deeper and groups are joined from the front, until the joined group
//! holds all landmarks.

use glam::{Vec2, Vec3};
use thiserror::Error;

use super::{
    landmarks::Landmarks,
    sections,
    shells::{ShellKind, Shells},
};
use crate::algo::linkage::{Dendrogram, LinkageError, average_linkage_1d};

mod jaw;
mod spread;
mod visible;

pub use visible::visible_mask;

/// A part of the head by depth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HeadGroup {
    /// The front.
    Face,
    /// The part between front and back.
    Middle,
    /// The back.
    Back,
}

/// The groups of a head.
#[derive(Debug, Clone, PartialEq)]
pub struct HeadGroups {
    /// The merge history of the depths.
    pub depth: Dendrogram,
    /// Number of groups at the cut, before front groups were joined.
    pub groups: usize,
    /// The group of each point.
    pub of: Vec<HeadGroup>,
    /// Marks points of the facial mask: skin of the face group without the neck.
    pub mask: Vec<bool>,
    /// Marks points of the mask that are visible from the front, not the walls of mouth, nose and sockets.
    pub visible: Vec<bool>,
    /// Mean of the upper half of the middle group.
    pub upper_mean: Vec3,
    /// Mean of the lower half of the middle group.
    pub lower_mean: Vec3,
    /// Height of the underside of the chin.
    pub chin: f32,
}

/// Error of grouping a head.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum GroupingError {
    /// No points or triangles.
    #[error("the head has no points or no triangles to group; pick a mesh with a surface")]
    Empty,
    /// A coordinate that is not finite.
    #[error("point {point} has a coordinate that is not a finite number; remove it or repair the mesh")]
    NotFinite {
        /// Index of the point.
        point: usize,
    },
    /// Points at one or two depths only.
    #[error("the head is flat: {depths} different depth(s) make no face, middle and back; check which way it looks")]
    Flat {
        /// Number of different depths.
        depths: usize,
    },
    /// No skin in the front group.
    #[error("no skin lies at the landmarks of the face; check which way the head looks")]
    NoMask,
    /// The linkage failed.
    #[error(transparent)]
    Linkage(LinkageError),
}

/// Allowed distance of the face's border behind the last landmark, as a share of the distance of the eyes: landmarks
/// found on a mesh are not exact.
const SLACK: f32 = 0.08;
/// Distance of the face's border behind the last landmark from which a deeper cut is sought, as the same share.
const FARTHEST: f32 = 0.4;
/// Largest number of groups tried to include the landmarks.
const MOST_GROUPS: usize = 256;
/// Largest number of groups tried for the middle's upper and lower part.
const MOST_HEIGHTS: usize = 12;

/// Groups a head in depth, and its middle in height.
///
/// `points` are in head space (+x the character's left, +y up, +z forward), in any unit, and so are `landmarks`. The
/// mask holds every skin point of the face group that does not lie below the jaw. `wanted` is the number of groups (2
/// or more) at which a person cut the history; the front groups that hold landmarks are joined in this case, too.
/// `progress` is called with the finished share and cancels by returning `false`.
///
/// # Errors
/// [`GroupingError`]: no points or triangles, coordinates that are not finite, fewer than three depths, no skin in
/// front, or cancelled ([`LinkageError`]).
///
/// Costs one linkage of the depths, n log n; the rest is cheap.
pub fn group_head(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    shells: &Shells,
    landmarks: &Landmarks,
    wanted: Option<usize>,
    progress: &(dyn Fn(f32) -> bool + Sync),
) -> Result<HeadGroups, GroupingError> {
    if points.is_empty() || triangles.is_empty() {
        return Err(GroupingError::Empty);
    }
    if let Some(point) = points.iter().position(|point| !point.is_finite()) {
        return Err(GroupingError::NotFinite { point });
    }
    let depths: Vec<f32> = points.iter().map(|point| point.z).collect();
    let depth = average_linkage_1d(&depths, &|done| progress(0.8 * done)).map_err(GroupingError::Linkage)?;
    let borders = borders(&depths, &depth);
    if borders.len() < 2 {
        return Err(GroupingError::Flat { depths: borders.len() + 1 });
    }
    let eyes = landmarks.eye_distance();
    let rear = landmarks.points.iter().map(|point| point.z).fold(f32::MAX, f32::min);
    let cut = cut(&borders, rear, eyes, wanted);
    let of: Vec<HeadGroup> = depths
        .iter()
        .map(|depth| match depth {
            depth if *depth >= cut.face => HeadGroup::Face,
            depth if *depth >= cut.middle => HeadGroup::Middle,
            _ => HeadGroup::Back,
        })
        .collect();

    let jaw = jaw::Jaw::new(landmarks);
    let mask: Vec<bool> = (0..points.len())
        .map(|point| of[point] == HeadGroup::Face && shells.kind(point) == ShellKind::Skin && jaw.above(points[point]))
        .collect();
    if !mask.contains(&true) {
        return Err(GroupingError::NoMask);
    }
    let chin = jaw.chin();
    let [upper_mean, lower_mean] = heights(points, triangles, shells, &of, landmarks, chin)?;
    let visible = visible_mask(points, triangles, &mask, landmarks);
    progress(1.0);
    Ok(HeadGroups { depth, groups: cut.groups, of, mask, visible, upper_mean, lower_mean, chin })
}

/// Borders of the merge history, last merge first: a cut into k groups uses the first k - 1 borders, and each group
/// begins at one of them.
///
/// On a line groups are intervals, so a merge joins one interval to the next, and the border is the lower end of the
/// upper one.
fn borders(values: &[f32], history: &Dendrogram) -> Vec<f32> {
    let mut lowest = values.to_vec();
    let mut borders = Vec::with_capacity(history.merges.len());
    for merge in &history.merges {
        let first = lowest.get(merge.first as usize).copied().unwrap_or(f32::MAX);
        let second = lowest.get(merge.second as usize).copied().unwrap_or(f32::MAX);
        lowest.push(first.min(second));
        // A merge of points at one depth is not a border.
        if merge.height > 0.0 && first != second {
            borders.push(first.max(second));
        }
    }
    borders.reverse();
    borders
}

/// Borders of the groups in depth.
struct Cut {
    groups: usize,
    face: f32,
    middle: f32,
}

/// The cut with the fewest groups whose joined front groups hold all landmarks without reaching far behind them.
///
/// With a `wanted` number, a cut into that many groups, joined from the front just as far as landmarks reach.
fn cut(borders: &[f32], rear: f32, eyes: f32, wanted: Option<usize>) -> Cut {
    let (nearest, farthest) = (rear - SLACK * eyes, rear - FARTHEST * eyes);
    // A border behind the face's must exist, or there is no back.
    let behind = |taken: &[f32], face: f32| taken.iter().copied().find(|border| *border < face);
    if let Some(wanted) = wanted {
        let groups = wanted.clamp(2, borders.len() + 1);
        let taken = &borders[..groups - 1];
        let holding = taken.iter().copied().filter(|border| *border <= nearest).fold(f32::MIN, f32::max);
        // Landmarks may reach behind every border: then all groups but the hindmost are the face.
        let hindmost = taken.iter().copied().fold(f32::MAX, f32::min);
        let face = if holding > f32::MIN { holding } else { hindmost };
        let middle = taken.iter().copied().filter(|border| *border < face).fold(f32::MIN, f32::max);
        return Cut { groups, face, middle };
    }
    let mut closest: Option<(f32, Cut)> = None;
    for groups in 3..=MOST_GROUPS.min(borders.len() + 1) {
        let taken = &borders[..groups - 1];
        let holding = taken.iter().copied().filter(|border| *border <= nearest).fold(f32::MIN, f32::max);
        let Some(middle) = behind(taken, holding) else { continue };
        if holding >= farthest {
            return Cut { groups, face: holding, middle };
        }
        if closest.as_ref().is_none_or(|closest| holding > closest.0) {
            closest = Some((holding, Cut { groups, face: holding, middle }));
        }
    }
    match closest {
        Some((_, cut)) => cut,
        // Landmarks reach to the very back: all groups but the last two are the face.
        None => {
            let (a, b) = (borders[0], borders[1]);
            Cut { groups: 3, face: a.max(b), middle: a.min(b) }
        }
    }
}

/// Means of the upper and the lower part of the middle group.
fn heights(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    shells: &Shells,
    of: &[HeadGroup],
    landmarks: &Landmarks,
    chin: f32,
) -> Result<[Vec3; 2], GroupingError> {
    let skin: Vec<[u32; 3]> = triangles
        .iter()
        .filter(|triangle| {
            triangle
                .iter()
                .all(|corner| (*corner as usize) < points.len() && shells.kind(*corner as usize) == ShellKind::Skin)
        })
        .copied()
        .collect();
    let middle: Vec<[u32; 3]> = skin
        .iter()
        .filter(|triangle| triangle.iter().filter(|corner| of[**corner as usize] == HeadGroup::Middle).count() >= 2)
        .copied()
        .collect();
    let middle = if middle.is_empty() { &skin } else { &middle };
    let samples = spread::over(points, middle);
    if samples.is_empty() {
        return Err(GroupingError::Empty);
    }
    let values: Vec<f32> = samples.iter().map(|sample| sample.y).collect();
    let history = average_linkage_1d(&values, &|_| true).map_err(GroupingError::Linkage)?;
    let borders = borders(&values, &history);
    let mean = |keep: &dyn Fn(f32) -> bool| {
        let kept = samples.iter().filter(|sample| keep(sample.y));
        let (sum, count) = kept.fold((Vec3::ZERO, 0), |(sum, count), sample| (sum + *sample, count + 1));
        let mean = sum / (count.max(1)) as f32;
        (count > 0).then(|| if landmarks.symmetric { mean.with_x(landmarks.middle) } else { mean })
    };
    let parts = |border: f32| Some([mean(&|y| y >= border)?, mean(&|y| y < border)?]);
    let all = mean(&|_| true).unwrap_or_default();
    // A group that is flat in height: both parts are the whole.
    let Some(plain) = borders.first().and_then(|border| parts(*border)) else { return Ok([all, all]) };
    if plain[1].y < chin {
        return Ok(plain);
    }
    // The lower part includes more than the neck. If there is a neck, the split nearest to its narrowest section is
    // taken.
    let bottom = points.iter().map(|point| point.y).fold(f32::MAX, f32::min);
    let neck = sections::neck(points, &skin, sections::border::largest(points, &skin).as_ref(), bottom, chin);
    let Some(narrow) = sections::narrowest(&neck).map(|index| neck[index].at) else { return Ok(plain) };
    let nearest = borders
        .iter()
        .take(MOST_HEIGHTS)
        .filter(|border| parts(**border).is_some_and(|[_, lower]| lower.y < chin))
        .min_by(|a, b| (**a - narrow).abs().total_cmp(&(**b - narrow).abs()));
    Ok(nearest.and_then(|border| parts(*border)).unwrap_or(plain))
}

/// A position as depth and height.
fn profile(point: Vec3) -> Vec2 {
    Vec2::new(point.z, point.y)
}
