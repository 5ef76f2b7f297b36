//! Chains: which end of a lone chain is its root, and how a chain is rolled about itself.
//!
//! A tail or an ear shows two ends that are much alike. The root is where the chain hangs on something: on a joint that is
//! there already, on the rest of the mesh outside of the part that is fitted, or else at the thicker end.

use std::collections::BTreeSet;

use glam::{Mat3, Quat, Vec3};

use super::{assign::Directions, limbs::TemplateLimbs, tree::Tree};
use crate::mesh::surface::Surface;

/// Penalty of a chain whose root is at the end that hangs on nothing.
const REVERSED: f32 = 1.0;
/// Penalty of a chain that gets thicker to its tip, for a factor of e.
const THICKENING: f32 = 0.15;
/// Share of a branch, from its end, in which its thickness is taken.
const END: f32 = 0.5;
/// Distance from the nearest point within which points are attached, as a share of the part's size.
const SEAM: f32 = 0.02;
/// Distance from the rest of the mesh up to which the part hangs on it, as a share of the part's size.
const HANGS: f32 = 0.25;
/// Mean radii of a chain from its end within which the root is on it.
const END_RADII: f32 = 2.0;
/// Length of a chain's level part below which it hangs down or stands up.
const LEVEL: f32 = 0.3;

/// Seam on which the triangles of a region hang on all others; `None` where they hang on nothing.
pub(super) fn seam(points: &[Vec3], triangles: &[[u32; 3]], region: &[u32]) -> Option<Vec3> {
    let inside: BTreeSet<u32> = region.iter().copied().collect();
    let is_sound = |corners: &&[u32; 3]| {
        corners.iter().all(|corner| points.get(*corner as usize).is_some_and(|point| point.is_finite()))
    };
    let others = triangles.iter().enumerate().filter(|(at, _)| !inside.contains(&(*at as u32)));
    let outside: Vec<[u32; 3]> = others.map(|(_, corners)| corners).filter(is_sound).copied().collect();
    if outside.is_empty() {
        return None;
    }
    let own = inside.iter().filter_map(|at| triangles.get(*at as usize)).filter(is_sound);
    let corners: BTreeSet<u32> = own.flatten().copied().collect();
    let own: Vec<Vec3> = corners.iter().map(|corner| points[*corner as usize]).collect();
    let (low, high) = own.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), &p| (l.min(p), h.max(p)));
    let size = (high - low).max_element();
    let rest = Surface::build(points, &outside);
    let distances: Vec<f32> =
        own.iter().map(|&point| rest.closest_point(point).map_or(f32::INFINITY, |hit| hit.distance)).collect();
    let least = distances.iter().copied().fold(f32::INFINITY, f32::min);
    if least.is_nan() || least > HANGS * size {
        return None;
    }
    let near = own.iter().zip(&distances).filter(|(_, distance)| **distance <= least + SEAM * size);
    let (sum, count) = near.fold((Vec3::ZERO, 0), |(sum, count), (point, _)| (sum + *point, count + 1));
    Some(sum / count.max(1) as f32)
}

/// True for a template that is one chain, such as a tail.
pub(super) fn is_lone(template: &TemplateLimbs) -> bool {
    matches!(template.limbs.as_slice(), [limb] if limb.partner.is_none() && template.trunk.len() <= 1)
}

/// Penalty of a chain that ends at a leaf, of those that there are.
pub(super) fn penalty(tree: &Tree, leaves: &[usize], leaf: usize, root: Option<Vec3>) -> f32 {
    let over = |of: &dyn Fn(usize) -> f32| leaves.iter().map(|&other| of(other)).fold(0.0f32, f32::max);
    match root {
        Some(root) => {
            let away = |leaf: usize| tree.lines[leaf].at(0.0).distance(root);
            REVERSED * (1.0 - away(leaf) / over(&away).max(1e-9))
        }
        None => {
            let thick = |leaf: usize| tree.lines[leaf].radius_within(END);
            let least = leaves.iter().map(|&other| thick(other)).fold(f32::INFINITY, f32::min);
            THICKENING * bevy::math::ops::ln(thick(leaf).max(1e-6) / least.max(1e-6)).max(0.0)
        }
    }
}

/// The turn of a chain that leads along a direction, as level as the template's: what little a chain is bent does not tell
/// how it is rolled.
pub(super) fn level(template: &TemplateLimbs, turn: Quat, directions: &Directions) -> Option<Quat> {
    let limb = template.limbs.first()?;
    let rest = (template.tip(limb) - template.positions[limb.attach]).try_normalize()?;
    let along = turn * rest;
    let up = directions.up.unwrap_or(directions.file_axes[1]);
    let upright = match directions.forward.and_then(|forward| up.cross(forward).try_normalize()) {
        Some(left) => Quat::from_mat3(&Mat3::from_cols(left, up, left.cross(up))),
        None => Quat::from_rotation_arc(Vec3::Y, up),
    };
    let rest = upright * rest;
    let flat = |way: Vec3| Some(way - up * way.dot(up)).filter(|flat| flat.length() > LEVEL);
    let yaw = match (flat(rest), flat(along), directions.forward) {
        (Some(from), Some(to), None) => {
            let angle = bevy::math::ops::atan2(from.cross(to).dot(up), from.dot(to));
            Quat::from_axis_angle(up, angle)
        }
        _ => Quat::IDENTITY,
    };
    Some((Quat::from_rotation_arc(yaw * rest, along) * yaw * upright).normalize())
}

/// Spreads the joints of a chain, with what hangs on them, over all of its branch, from the tip at a leaf over the middle of the
/// mesh to its root.
pub(super) fn spread(template: &TemplateLimbs, tree: &Tree, tip: usize, root: Option<Vec3>, places: &mut [Vec3]) {
    let Some(limb) = template.limbs.first() else { return };
    let ends: Vec<usize> = tree.branches.leaves.iter().copied().filter(|&leaf| leaf != tip).collect();
    let end = |leaf: usize| tree.lines[leaf].at(0.0);
    // The end next to the root, or the one furthest from the tip.
    let key = |leaf: usize| root.map_or_else(|| -end(leaf).distance(end(tip)), |root| end(leaf).distance(root));
    let first = ends.into_iter().min_by(|&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
    let near = |leaf: &usize| root.is_none_or(|root| end(*leaf).distance(root) < 0.5 * end(tip).distance(root));
    let mut line = tree.lines[tip].points.clone();
    match (first.filter(near), root) {
        (Some(leaf), _) => line.extend(tree.lines[leaf].points.iter().rev()),
        (None, Some(root)) => line.push(root),
        (None, None) => return,
    }
    // The furthest end of a stump is on its rim.
    let reach = END_RADII * tree.lines[tip].mean_radius();
    if let Some(root) = root.filter(|root| line.last().is_some_and(|last| last.distance(*root) < reach)) {
        line.truncate(line.iter().rposition(|place| place.distance(root) > 0.5 * reach).map_or(1, |at| at + 1));
        line.push(root);
    }
    let whole: f32 = line.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    let last = limb.joints[limb.joints.len() - 1];
    let rest = (template.length(limb.attach, last) + limb.beyond).max(1e-9);
    let before = places.to_vec();
    let is_own = |joint: usize| joint == limb.attach || limb.joints.contains(&joint);
    for &joint in &template.order {
        if is_own(joint) {
            places[joint] = along(&line, whole * (1.0 - template.length(limb.attach, joint) / rest));
        } else if let Some(parent) = template.parents[joint] {
            // What hangs on the chain, such as feathers, goes along.
            places[joint] += places[parent] - before[parent];
        }
    }
}

/// The place at a length along a polyline.
fn along(line: &[Vec3], mut length: f32) -> Vec3 {
    for pair in line.windows(2) {
        let step = pair[0].distance(pair[1]);
        if length <= step {
            return pair[0].lerp(pair[1], if step > 0.0 { length / step } else { 0.0 });
        }
        length -= step;
    }
    line.last().copied().unwrap_or_default()
}
