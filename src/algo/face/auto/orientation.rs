//! Orientation of a head: the axes under which a face is seen, the head's part of the mesh, its shells and landmarks.
//!
//! Axes are guessed from the shape; landmarks then tell whether a face is there. Where none is clear, the other
//! orientations are tried, and a head that is turned or tilted in its mesh gets the axes of its own face, so that
//! expressions are the same on both sides of it.

use glam::{Quat, Vec3};

use super::{AutoSettings, FaceError, FaceStep};
use crate::algo::face::{
    axes::{HeadAxes, guess_axes, other_axes},
    head_part::head_part,
    landmarks::{CLEAR, LandmarkError, Landmarks, find_landmarks},
    shells::{Shells, find_shells},
};

/// A head in head space, with its shells and landmarks.
pub(super) struct OrientedHead {
    /// Axes of the head in the mesh's space.
    pub axes: HeadAxes,
    /// Certainty of the axes.
    pub certain: bool,
    /// Indices of the mesh's points that belong to the head; `None` if the whole mesh is a head.
    pub part: Option<Vec<u32>>,
    /// Points of the head in head space.
    pub points: Vec<Vec3>,
    /// Triangles over `points`.
    pub triangles: Vec<[u32; 3]>,
    /// Connected parts of the head.
    pub shells: Shells,
    /// Landmarks of the face, in head space.
    pub landmarks: Landmarks,
}

/// Largest number of other orientations that are tried where the guessed one shows no clear face on a head.
const TRIES: usize = 5;
/// Cosine of the largest turn of a face that keeps the axes of its mesh: 4 degrees.
const STRAIGHT: f32 = 0.997_56;

/// Finds the orientation of a head, its part of a mesh and its landmarks.
///
/// `step` begins a step of the progress and fails if the work is cancelled. A mesh without a clear face takes several
/// times as long as another.
pub(super) fn orient(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    settings: &AutoSettings,
    step: &dyn Fn(FaceStep) -> Result<(), FaceError>,
) -> Result<OrientedHead, FaceError> {
    step(FaceStep::Axes)?;
    let given = (settings.up, settings.forward);
    let guess = guess_axes(points, triangles, given.0, given.1).map_err(FaceError::Axes)?;
    let look = |axes: HeadAxes| {
        let part = if settings.whole { None } else { part(points, triangles, axes)? };
        step(FaceStep::Landmarks)?;
        OrientedHead::new(points, triangles, axes, part)
    };
    let mut best = look(guess.axes);
    // Bodies stand on their legs, and tell their axes better than their heads do.
    let is_head = match &best {
        Ok(head) => head.part.is_none(),
        Err(error) => matches!(error, FaceError::Landmarks(_)),
    };
    if is_head && confidence(&best) < CLEAR {
        for axes in other_axes(points, triangles, given, &guess.axes, TRIES) {
            let other = look(axes);
            if matches!(other, Err(FaceError::Cancelled)) {
                return other;
            }
            if confidence(&other) >= CLEAR {
                best = other;
                break;
            }
        }
    }
    let mut head = best?;
    head.certain = guess.certain && head.axes == guess.axes;
    if given == (None, None)
        && head.part.is_none()
        && head.landmarks.confidence >= CLEAR
        && let Some(axes) = own_axes(&head)
    {
        head = head.reoriented(axes);
    }
    Ok(head)
}

fn confidence(head: &Result<OrientedHead, FaceError>) -> f32 {
    head.as_ref().map_or(-1.0, |head| head.landmarks.confidence)
}

/// Indices of the head's points in a body that stands upright under the given axes; `None` if the mesh is a head.
fn part(points: &[Vec3], triangles: &[[u32; 3]], axes: HeadAxes) -> Result<Option<Vec<u32>>, FaceError> {
    let found = head_part(&turned(points, axes.rotation()), triangles).map_err(FaceError::Part)?;
    Ok(found.is_part.then(|| kept(&found.points, triangles)))
}

/// The axes of a face that is turned or tilted under the axes of its head; `None` if it is straight. The face nods in them
/// as it does in the mesh.
fn own_axes(head: &OrientedHead) -> Option<HeadAxes> {
    let marks = &head.landmarks.points;
    let pairs = [(17, 26), (36, 45), (39, 42), (31, 35), (48, 54)];
    let across = pairs.into_iter().map(|(right, left)| marks[left] - marks[right]).sum::<Vec3>().try_normalize()?;
    if across.x >= STRAIGHT {
        return None;
    }
    let back = (Quat::from_rotation_arc(across, Vec3::X) * head.axes.rotation()).inverse();
    Some(HeadAxes { up: back * Vec3::Y, forward: back * Vec3::Z })
}

impl OrientedHead {
    /// Looks for the face of a mesh, or of a part of it, under the given axes.
    fn new(points: &[Vec3], triangles: &[[u32; 3]], axes: HeadAxes, part: Option<Vec<u32>>) -> Result<Self, FaceError> {
        let mut head = turned(points, axes.rotation());
        let mut faces = triangles.to_vec();
        if let Some(part) = &part {
            (head, faces) = cut(&head, triangles, part);
        }
        let (shells, landmarks) = find_features(&head, &faces).map_err(FaceError::Landmarks)?;
        Ok(Self { axes, certain: true, part, points: head, triangles: faces, shells, landmarks })
    }

    /// Head with its face in the space of other axes.
    fn reoriented(mut self, axes: HeadAxes) -> Self {
        let turn = axes.rotation() * self.axes.rotation().inverse();
        self.points = turned(&self.points, turn);
        let marks = &mut self.landmarks;
        marks.points = marks.points.map(|mark| turn * mark);
        marks.middle = (marks.points[27].x + marks.points[33].x) / 2.0;
        marks.symmetric = false;
        Self { axes, ..self }
    }
}

/// Finds the shells of a head and its landmarks.
///
/// Hats and sunglasses that are as large as skin hide the face: where parts are worn over the skin, the face is searched
/// without them, and with them only if none is clear.
fn find_features(points: &[Vec3], triangles: &[[u32; 3]]) -> Result<(Shells, Landmarks), LandmarkError> {
    let shells = find_shells(points, triangles);
    let Some(bare) = shells.without_worn(points, triangles) else { return find_face(points, triangles, shells) };
    let bare = find_face(points, triangles, bare);
    if bare.as_ref().is_ok_and(|(_, landmarks)| landmarks.confidence >= CLEAR) {
        return bare;
    }
    let dressed = find_face(points, triangles, shells);
    let confidence = |face: &Result<(Shells, Landmarks), _>| face.as_ref().map_or(-1.0, |(_, marks)| marks.confidence);
    if confidence(&bare) > confidence(&dressed) { bare } else { dressed }
}

/// Finds the landmarks of a head whose shells are known.
///
/// Balls that are no eyes, such as buns of hair, mislead the search for landmarks. Where they are not behind the lids, or no
/// face is clear with them, the face is searched without them, and the eyes on that face.
fn find_face(points: &[Vec3], triangles: &[[u32; 3]], shells: Shells) -> Result<(Shells, Landmarks), LandmarkError> {
    let landmarks = find_landmarks(points, triangles, &shells)?;
    let is_clear = landmarks.confidence >= CLEAR;
    if !shells.has_eyes() || (is_clear && shells.are_eyes_on_face(points, &landmarks)) {
        return Ok((shells, landmarks));
    }
    let mut other = shells.without_eyes();
    let least = CLEAR.max(landmarks.confidence + if is_clear { -0.1 } else { 0.2 });
    let Some(plain) = find_landmarks(points, triangles, &other).ok().filter(|plain| plain.confidence >= least) else {
        return Ok((shells, landmarks));
    };
    if !other.mark_eyes(points, triangles, &plain) {
        return Ok((other, plain));
    }
    let found = find_landmarks(points, triangles, &other)?;
    Ok(if found.confidence >= plain.confidence { (other, found) } else { (other, plain) })
}

fn turned(points: &[Vec3], turn: Quat) -> Vec<Vec3> {
    if turn == Quat::IDENTITY { points.to_vec() } else { points.iter().map(|point| turn * *point).collect() }
}

/// Indices of the part's points that belong to triangles with all corners in the part.
fn kept(part: &[bool], triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut used = vec![false; part.len()];
    for triangle in triangles {
        if triangle.iter().all(|corner| part[*corner as usize]) {
            for corner in triangle {
                used[*corner as usize] = true;
            }
        }
    }
    (0..part.len() as u32).filter(|point| used[*point as usize]).collect()
}

/// The mesh of the kept points alone.
fn cut(points: &[Vec3], triangles: &[[u32; 3]], kept: &[u32]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut numbers = vec![u32::MAX; points.len()];
    for (number, point) in kept.iter().enumerate() {
        numbers[*point as usize] = number as u32;
    }
    let whole = |triangle: &[u32; 3]| triangle.iter().all(|corner| numbers[*corner as usize] != u32::MAX);
    let faces = triangles.iter().filter(|t| whole(t)).map(|t| t.map(|corner| numbers[corner as usize])).collect();
    (kept.iter().map(|point| points[*point as usize]).collect(), faces)
}
