//! Turn and tilt of a face: its plane of symmetry, fitted to the depth map.

use bevy::math::ops;
use glam::{Vec2, Vec3, vec2, vec3};

use crate::algo::face::depth_map::DepthMap;

use super::search::Pose;

/// The unit normal of the face's plane of symmetry, towards the character's left.
///
/// Places on one side are mirrored through a plane and compared with the depth seen there; the plane (turn, tilt and
/// offset) with the smallest mean difference is searched by halving steps. Differences count up to a limit, since
/// scars, hair and shadows of the view are on one side only.
pub(super) fn plane(map: &DepthMap, pose: &Pose) -> Vec3 {
    let d = pose.size;
    let mut places = Vec::new();
    for row in 0..30 {
        for column in 1..11 {
            for side in [-1.0, 1.0] {
                let at = pose.center + vec2(side * column as f32 * 0.045, (0.35 - row as f32 * 0.045) * pose.tall) * d;
                places.extend(map.sample(at).map(|depth| at.extend(depth)));
            }
        }
    }
    if places.len() < 200 {
        return Vec3::X;
    }
    let depth = places.iter().map(|place| place.z).sum::<f32>() / places.len() as f32;
    let center = pose.center.extend(depth);
    let cost = |plane: Vec3| {
        let (normal, offset) = (normal(plane.truncate()), plane.z * d);
        let (mut sum, mut count) = (0.0f32, 0u32);
        for place in &places {
            let mirror = *place - 2.0 * ((*place - center).dot(normal) - offset) * normal;
            if let Some(depth) = map.sample(mirror.truncate()) {
                sum += ((depth - mirror.z).abs() / d).min(0.06);
                count += 1;
            }
        }
        if (count as usize) * 3 < places.len() { f32::INFINITY } else { sum / count as f32 }
    };
    let mut best = (cost(Vec3::ZERO), Vec3::ZERO);
    let mut step = 0.1f32;
    while step > 0.003 {
        let from = best;
        for (turn, tilt, offset) in [
            (1.0, 0.0, 0.0),
            (0.0, 1.0, 0.0),
            (0.0, 0.0, 0.5),
            (1.0, 0.0, 0.5),
            (1.0, 0.0, -0.5),
            (0.0, 1.0, 0.5),
            (0.0, 1.0, -0.5),
        ] {
            for sign in [-1.0, 1.0] {
                let next = from.1 + sign * step * vec3(turn, tilt, offset);
                let worth = cost(next);
                if worth < best.0 && next.truncate().abs().max_element() < 0.6 {
                    best = (worth, next);
                }
            }
        }
        if best == from {
            step *= 0.5;
        }
    }
    normal(best.1.truncate())
}

/// The normal for a turn (about y) and a tilt (about z), in radians.
fn normal(angles: Vec2) -> Vec3 {
    let (turn, tilt) = (angles.x, angles.y);
    vec3(ops::cos(turn) * ops::cos(tilt), ops::sin(tilt), -ops::sin(turn) * ops::cos(tilt))
}
