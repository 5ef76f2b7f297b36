//! Bones of jaw, eyes and tongue.

use glam::Vec3;

use super::{FaceBone, FaceBoneKind, FixedBone, Side, map::FaceMap, name};
use crate::algo::face::{
    landmarks::Landmarks,
    shells::{ShellKind, Shells},
};

/// Adds the bones of jaw, eyes and tongue: fixed ones at their places, others if `wanted` and the mesh has them.
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
    let has_jaw = bones.iter().any(|bone| bone.kind == FaceBoneKind::Jaw);
    let first = bones.len();
    for (kind, side) in [(ShellKind::LeftEye, Side::Left), (ShellKind::RightEye, Side::Right)] {
        let ball = || {
            let of = |(i, _): &(usize, &Vec3)| shells.kind(*i) == kind;
            let ball: Vec<Vec3> = points.iter().enumerate().filter(of).map(|(_, &p)| p).collect();
            ball_center(&ball).filter(|_| wanted).map(|center| (center, None))
        };
        if let Some((position, fixed)) = given(FaceBoneKind::Eye, Some(side)).or_else(ball) {
            bones.push(FaceBone { fixed, ..name::extra(position, FaceBoneKind::Eye, side) });
        }
    }
    if bones.len() == first + 2 {
        bones[first].pair = Some(first + 1);
        bones[first + 1].pair = Some(first);
    }
    // The jaw carries the tongue.
    let root = || tongue_root(points, shells, map).filter(|_| wanted && has_jaw).map(|root| (root, None));
    if let Some((position, fixed)) = given(FaceBoneKind::Tongue, None).or_else(root) {
        bones.push(FaceBone { fixed, ..name::extra(position, FaceBoneKind::Tongue, Side::Middle) });
    }
}

/// Share of the tongue's length that lies behind its bone.
const ROOT: f32 = 0.3;

/// Place in the back of the tongue.
fn tongue_root(points: &[Vec3], shells: &Shells, map: &FaceMap) -> Option<Vec3> {
    let of = |(index, _): &(usize, &Vec3)| shells.kind(*index) == ShellKind::Tongue;
    let tongue = || points.iter().enumerate().filter(of).map(|(_, point)| *point);
    let low = tongue().reduce(Vec3::min)?;
    let high = tongue().reduce(Vec3::max)?;
    let middle = 0.5 * (low + high);
    let is_central = (middle.x - map.middle).abs() <= 0.01 * map.scale;
    Some(Vec3::new(if is_central { map.middle } else { middle.x }, middle.y, low.z + ROOT * (high.z - low.z)))
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
