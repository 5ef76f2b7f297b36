//! Bones of jaw and eyes.

use glam::Vec3;

use super::{FaceBone, FaceBoneKind, FixedBone, Side, map::FaceMap, name};
use crate::algo::face::{
    landmarks::Landmarks,
    shells::{ShellKind, Shells},
};

/// Largest deviation of the front of an eyeball from a sphere, as a share of its radius (root of the mean square).
const ROUND: f32 = 0.15;

/// Adds the bones of jaw and eyes: fixed ones at their places, others if `wanted` and the mesh has them.
pub(super) fn add(
    points: &[Vec3],
    shells: &Shells,
    landmarks: &Landmarks,
    map: &FaceMap,
    fixed: &[FixedBone],
    wanted: bool,
    bones: &mut Vec<FaceBone>,
) {
    let given = |kind: FaceBoneKind, side: Option<Side>| {
        let is =
            |f: &FixedBone| f.kind == kind && side.is_none_or(|s| (s == Side::Right) == (f.position.x < map.middle));
        fixed.iter().position(is).map(|i| (fixed[i].position, Some(i)))
    };
    let ear: Vec3 = map.halves.iter().map(|h| h.jaw[8] + h.jaw[6]).sum::<Vec3>() / 4.0;
    let own = (wanted && landmarks.mouth_open && map.trusted).then_some((ear.with_x(map.middle), None));
    if let Some((position, fixed)) = given(FaceBoneKind::Jaw, None).or(own) {
        bones.push(FaceBone { fixed, ..name::extra(position, FaceBoneKind::Jaw, Side::Middle) });
    }
    let first = bones.len();
    for (kind, side) in [(ShellKind::LeftEye, Side::Left), (ShellKind::RightEye, Side::Right)] {
        let ball = || ball_center(&points_of(points, shells, kind)).filter(|_| wanted).map(|center| (center, None));
        if let Some((position, fixed)) = given(FaceBoneKind::Eye, Some(side)).or_else(ball) {
            bones.push(FaceBone { fixed, ..name::extra(position, FaceBoneKind::Eye, side) });
        }
    }
    if bones.len() == first + 2 {
        bones[first].pair = Some(first + 1);
        bones[first + 1].pair = Some(first);
    }
}

/// Points of the shells of a kind.
fn points_of(points: &[Vec3], shells: &Shells, kind: ShellKind) -> Vec<Vec3> {
    points.iter().enumerate().filter(|(point, _)| shells.kind(*point) == kind).map(|(_, place)| *place).collect()
}

/// Centre and radius of the eyeballs that are shells of their own: left, right, as far as they are round in front.
pub(crate) fn eyeballs(points: &[Vec3], shells: &Shells) -> Vec<(Vec3, f32)> {
    let of = |kind: ShellKind| {
        let ball = points_of(points, shells, kind);
        let center = ball_center(&ball)?;
        let front: Vec<f32> = ball.iter().filter(|at| at.z > center.z).map(|at| at.distance(center)).collect();
        let mean = front.iter().sum::<f32>() / front.len().max(1) as f32;
        let square = front.iter().map(|far| (far - mean) * (far - mean)).sum::<f32>() / front.len().max(1) as f32;
        (mean > 0.0 && square.sqrt() < ROUND * mean).then_some((center, mean))
    };
    [ShellKind::LeftEye, ShellKind::RightEye].into_iter().filter_map(of).collect()
}

/// Centre of an eyeball: that of the best-fitting sphere, or of its box if no sphere fits nearby.
fn ball_center(ball: &[Vec3]) -> Option<Vec3> {
    let low = ball.iter().copied().reduce(Vec3::min)?;
    let high = ball.iter().copied().reduce(Vec3::max)?;
    let middle = 0.5 * (low + high);
    // |p|² = 2 c·p + d, relative to the middle of the box, by least squares.
    let mut sums = glam::DMat4::ZERO;
    let mut right = glam::DVec4::ZERO;
    for p in ball {
        let q = (*p - middle).as_dvec3();
        let row = q.extend(1.0);
        sums += glam::DMat4::from_cols(row * row.x, row * row.y, row * row.z, row * row.w);
        right += row * q.length_squared();
    }
    let size = f64::from((high - low).max_element());
    if sums.determinant().abs() > 1e-9 * size * size * size * size * size * size * (ball.len() as f64) {
        let center = 0.5 * (sums.inverse() * right).truncate();
        if center.is_finite() && center.length() < 0.5 * size {
            return Some(middle + center.as_vec3());
        }
    }
    Some(middle)
}
