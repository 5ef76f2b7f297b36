//! The displacement field of a mix of units on one head.

use glam::{Quat, Vec3};

use super::{
    BonePose, Mix, UnitSet,
    openings::{OpeningLines, OpeningSide},
    pitch,
    text::{Part, Unit, UnitMove},
    yaw,
};
use crate::algo::face::{
    bones::{FaceBone, FaceBoneKind},
    landmarks::{Landmarks, mirrored},
};

/// The field, ready to be sampled at points of the rest pose.
pub(super) struct Field {
    scale: f32,
    opening_lines: OpeningLines,
    sources: Vec<Source>,
    /// Rotation and movement of the jaw bone.
    jaw: Quat,
    jaw_shift: Vec3,
    /// Movement of the tongue bone, which the jaw carries.
    tongue: Vec3,
    /// Rotation of the skin below the mouth by units that say nothing else of the skin, and its pivot.
    skin_jaw: Option<Quat>,
    pivot: Vec3,
    /// Rotations of the left and the right eye.
    eyes: [Quat; 2],
}

/// One unit on one side.
struct Source {
    /// Side of the face that it is restricted to.
    side: Option<usize>,
    strength: f32,
    moves: Vec<Move>,
}

/// A move of a unit, on this head.
struct Move {
    center: Vec3,
    by: Vec3,
    /// Reciprocals of the radii.
    narrow: [f32; 2],
    part: Part,
}

impl Field {
    /// Makes the field; `None` if the landmarks are degenerate. The jaw turns about the jaw bone if there is one.
    pub fn new(mix: &Mix, units: &UnitSet, bones: &[FaceBone], landmarks: &Landmarks) -> Option<Self> {
        let opening_lines = OpeningLines::new(landmarks)?;
        let distance = landmarks.eye_distance();
        let mut sources = Vec::new();
        let (mut open, mut open_skin, mut jaw_shift, mut tongue) = (0.0, 0.0, Vec3::ZERO, Vec3::ZERO);
        let mut gaze = [[0.0_f32; 2]; 2];
        for (unit, strengths) in units.units().iter().zip(&mix.strengths) {
            let both = (strengths[0] + strengths[1]) * 0.5;
            open += unit.jaw * both;
            if unit.moves.is_empty() {
                open_skin += unit.jaw * both;
            }
            let shift = unit.jaw_shift;
            jaw_shift += match unit.whole {
                true => shift * strengths[0] + shift.with_x(-shift.x) * strengths[1],
                false => shift.with_x(0.0) * both,
            };
            tongue += unit.tongue.with_x(0.0) * both;
            for (side, &strength) in strengths.iter().enumerate().filter(|(_, strength)| **strength > 0.0) {
                gaze[side][0] += unit.gaze.out * strength;
                gaze[side][1] += unit.gaze.up * strength;
                sources.push(Source::new(unit, side, strength, landmarks));
            }
        }
        let eye = |side: usize, [out, up]: [f32; 2]| {
            yaw(if side == 0 { out } else { -out }.clamp(-40.0, 40.0)) * pitch(-up.clamp(-35.0, 35.0))
        };
        Some(Self {
            scale: 1.0 / distance,
            opening_lines,
            sources,
            jaw: pitch(open.clamp(0.0, 35.0)),
            jaw_shift: jaw_shift * distance,
            tongue: tongue * distance,
            skin_jaw: (open_skin > 0.0).then(|| pitch(open_skin.min(35.0))),
            pivot: jaw_pivot(bones, landmarks),
            eyes: [eye(0, gaze[0]), eye(1, gaze[1])],
        })
    }

    /// The field of one unit on one side, without its jaw.
    pub fn of_unit(unit: &Unit, side: usize, opening_lines: &OpeningLines, landmarks: &Landmarks) -> Self {
        Self {
            scale: 1.0 / landmarks.eye_distance(),
            opening_lines: opening_lines.clone(),
            sources: vec![Source::new(unit, side, 1.0, landmarks)],
            jaw: Quat::IDENTITY,
            jaw_shift: Vec3::ZERO,
            tongue: Vec3::ZERO,
            skin_jaw: None,
            pivot: Vec3::ZERO,
            eyes: [Quat::IDENTITY; 2],
        }
    }

    /// Displacement of the skin at `point`, in units of the mesh: a sum over units and the jaw's part, each linear in its
    /// strength or in the jaw's rotation matrix.
    pub fn at(&self, point: Vec3, known: OpeningSide) -> Vec3 {
        let mut sum = Vec3::ZERO;
        if let Some(jaw) = self.skin_jaw {
            let arm = point - self.pivot;
            sum = (jaw * arm - arm) * self.opening_lines.jaw(point, known);
        }
        for source in &self.sources {
            let share = source.side.map_or(1.0, |side| self.opening_lines.side(point, side)) * source.strength;
            if share > 0.0 {
                sum += source.at(point, known, self.scale, &self.opening_lines) * (share / self.scale);
            }
        }
        sum
    }

    /// Rotation of the skin below the mouth by units that say nothing else of the skin.
    pub fn skin_jaw(&self) -> Option<Quat> {
        self.skin_jaw
    }

    /// Pose of a bone of jaw, eyes or tongue.
    pub fn turn(&self, bone: &FaceBone) -> BonePose {
        let (translation, rotation) = match bone.kind {
            FaceBoneKind::Skin => (Vec3::ZERO, Quat::IDENTITY),
            FaceBoneKind::Jaw => (self.jaw_shift, self.jaw),
            FaceBoneKind::Tongue => {
                let arm = bone.position - self.pivot;
                (self.jaw * (arm + self.tongue) - arm + self.jaw_shift, self.jaw)
            }
            FaceBoneKind::Eye => {
                let [left, right] = self.eyes;
                (Vec3::ZERO, if self.opening_lines.side(bone.position, 0) >= 0.5 { left } else { right })
            }
        };
        BonePose { translation, rotation }
    }
}

impl Source {
    fn new(unit: &Unit, side: usize, strength: f32, landmarks: &Landmarks) -> Self {
        let moves = unit.moves.iter().map(|one| Move::new(one, side, landmarks)).collect();
        Self { side: (!unit.whole).then_some(side), strength, moves }
    }

    /// Displacement in eye distances: near each place its own movement, in between a blend, and less with distance.
    fn at(&self, point: Vec3, known: OpeningSide, scale: f32, opening_lines: &OpeningLines) -> Vec3 {
        let (mut sum, mut weights, mut outside) = (Vec3::ZERO, 0.0, 1.0);
        for one in &self.moves {
            let off = (point - one.center) * scale;
            let square = (off.x * one.narrow[0]).powi(2) + (off.y * one.narrow[1]).powi(2);
            if square >= 1.0 {
                continue;
            }
            let part = opening_lines.part(one.part, point, known);
            let near = (1.0 - square) * (1.0 - square) * part;
            let weight = near / (square + 0.05);
            sum += one.by * weight;
            weights += weight;
            outside *= 1.0 - near;
        }
        if weights > 0.0 { sum * ((1.0 - outside) / weights) } else { Vec3::ZERO }
    }
}

impl Move {
    fn new(one: &UnitMove, side: usize, landmarks: &Landmarks) -> Self {
        let mirror = |v: Vec3| if side == 0 { v } else { Vec3::new(-v.x, v.y, v.z) };
        let mean = |marks: &[u8]| {
            let mut sum = Vec3::ZERO;
            for &mark in marks {
                let mark = if side == 0 { usize::from(mark) } else { mirrored(usize::from(mark)) };
                sum += landmarks.points.get(mark).copied().unwrap_or_default();
            }
            sum / marks.len().max(1) as f32
        };
        let at = mean(&one.at);
        let way = if one.toward.is_empty() { Vec3::ZERO } else { mean(&one.toward) - at };
        let distance = landmarks.eye_distance();
        Self {
            center: at + mirror(one.offset) * distance,
            by: mirror(one.by) + way * (one.share / distance),
            narrow: [1.0 / one.reach.0.max(1e-3), 1.0 / one.reach.1.max(1e-3)],
            part: one.part,
        }
    }
}

/// The point about which the skin below the mouth turns: the jaw bone, or the hinge.
pub(super) fn jaw_pivot(bones: &[FaceBone], landmarks: &Landmarks) -> Vec3 {
    let jaw_bone = bones.iter().find(|bone| bone.kind == FaceBoneKind::Jaw);
    jaw_bone.map_or_else(|| hinge(landmarks), |bone| bone.position)
}

/// Approximate hinge of the lower jaw: a little in front of and below the ears, where the outline begins.
fn hinge(landmarks: &Landmarks) -> Vec3 {
    let points = &landmarks.points;
    let outline = (points[0] + points[16] + points[1] + points[15]) * 0.25;
    Vec3::new(landmarks.middle, outline.y, outline.z)
}
