//! From joints to bones: which straight pieces a joint pulls with.
//!
//! A joint owns a bone to each of its children, so a hand holds its whole palm and a chest reaches up to both
//! collarbones. Where a chain ends there is no child: the bone then runs through the flesh beyond the last joint.

use glam::Vec3;
use rayon::prelude::*;

use super::{WeightJoint, bone::BoneSegment, sight::Sight, tuning::Tuning};

/// Bones and the typical distance of the surface around each.
#[derive(Debug, Clone, Default)]
pub(crate) struct Bones {
    pub segments: Vec<BoneSegment>,
    pub radii: Vec<f32>,
}

/// Which joint carries the flesh of each: itself, or the nearest ancestor that deforms. All deform if none does.
pub(crate) fn owners(joints: &[WeightJoint]) -> Vec<Option<u32>> {
    if !joints.iter().any(|j| j.deforms) {
        return (0..joints.len() as u32).map(Some).collect();
    }
    let mut owners: Vec<Option<u32>> = vec![None; joints.len()];
    let mut known = vec![false; joints.len()];
    let mut path = Vec::new();
    for start in 0..joints.len() {
        let mut at = Some(start);
        let mut owner = None;
        while let Some(joint) = at {
            if known[joint] {
                owner = owners[joint];
                break;
            }
            if joints[joint].deforms {
                owner = Some(joint as u32);
                owners[joint] = owner;
                known[joint] = true;
                break;
            }
            path.push(joint);
            at = joints[joint].parent;
        }
        for joint in path.drain(..) {
            owners[joint] = owner;
            known[joint] = true;
        }
    }
    owners
}

/// Builds the bones. `points` and `areas` describe the welded surface that `sight` sees.
pub(crate) fn build(joints: &[WeightJoint], points: &[Vec3], areas: &[f32], sight: &Sight, tuning: &Tuning) -> Bones {
    let owners = owners(joints);
    let scale = points.iter().chain(joints.iter().map(|j| &j.head)).fold(0f32, |m, p| m.max(p.abs().max_element()));
    let tiny = scale * 1e-6;
    let mut segments = Vec::new();
    let mut leaves = Vec::new();
    let mut has_child = vec![false; joints.len()];
    for (index, joint) in joints.iter().enumerate() {
        let Some(parent) = joint.parent else { continue };
        has_child[parent] = true;
        let Some(owner) = owners[parent] else { continue };
        let head = joints[parent].head;
        if head.distance(joint.head) > tiny {
            let outside = joints[parent].parent.is_none() && mostly_outside(head, joint.head, sight);
            if !outside {
                segments.push(BoneSegment { joint: owner, head, tail: joint.head });
            }
        }
        let _ = index;
    }
    for (index, joint) in joints.iter().enumerate() {
        if has_child[index] {
            continue;
        }
        let Some(owner) = owners[index] else { continue };
        let tail = joint.tail.filter(|t| t.distance(joint.head) > tiny);
        if tail.is_none() {
            leaves.push((segments.len(), index));
        }
        segments.push(BoneSegment { joint: owner, head: joint.head, tail: tail.unwrap_or(joint.head) });
    }
    drop_repeats(&mut segments, &mut leaves);
    grow_leaves(joints, &mut segments, &leaves, points, areas, sight, tuning);
    let radii = segments.iter().map(|s| radius(s, sight, tuning)).collect::<Vec<_>>();
    let mut known: Vec<f32> = radii.iter().copied().filter(|r| r.is_finite()).collect();
    known.sort_by(f32::total_cmp);
    let typical = known.get(known.len() / 2).copied().unwrap_or(1.0).max(tiny).max(f32::MIN_POSITIVE);
    let radii: Vec<f32> = radii.into_iter().map(|r| if r.is_finite() { r.max(0.05 * typical) } else { typical }).collect();
    let radii = if tuning.region > 0.0 { region_radii(&segments, points, areas, sight, &radii, tuning) } else { radii };
    Bones { segments, radii }
}

/// Of bones at the same place the first one stays: nothing tells them apart.
fn drop_repeats(segments: &mut Vec<BoneSegment>, leaves: &mut Vec<(usize, usize)>) {
    let key = |s: &BoneSegment| [s.head, s.tail].map(|p| p.to_array().map(|c| (c + 0.0).to_bits()));
    let mut order: Vec<usize> = (0..segments.len()).collect();
    order.sort_by_key(|&i| (key(&segments[i]), i));
    let mut keep = vec![true; segments.len()];
    for pair in order.windows(2) {
        if key(&segments[pair[0]]) == key(&segments[pair[1]]) {
            keep[pair[1]] = false;
        }
    }
    let mut place = vec![usize::MAX; segments.len()];
    let mut kept = 0;
    for (i, keep) in keep.iter().enumerate() {
        if *keep {
            place[i] = kept;
            kept += 1;
        }
    }
    leaves.retain_mut(|(segment, _)| {
        *segment = place[*segment];
        *segment != usize::MAX
    });
    let mut i = 0;
    segments.retain(|_| {
        i += 1;
        keep[i - 1]
    });
}

/// True if less than half of the samples between `a` and `b` lie inside the surface: such a bone carries the character
/// through the world and holds no flesh.
fn mostly_outside(a: Vec3, b: Vec3, sight: &Sight) -> bool {
    const SAMPLES: usize = 8;
    let inside = (0..SAMPLES).filter(|&i| sight.winding(a.lerp(b, (i as f32 + 0.5) / SAMPLES as f32)) > 0.33).count();
    inside * 2 < SAMPLES
}

/// Lets the bones of last joints run through the flesh around the joint: towards the centroid of the surface that is
/// nearest to the joint, and nearly as far as that surface reaches.
fn grow_leaves(
    joints: &[WeightJoint],
    segments: &mut [BoneSegment],
    leaves: &[(usize, usize)],
    points: &[Vec3],
    areas: &[f32],
    sight: &Sight,
    tuning: &Tuning,
) {
    if leaves.is_empty() {
        return;
    }
    let mut leaf_of = vec![usize::MAX; segments.len()];
    for (leaf, &(segment, _)) in leaves.iter().enumerate() {
        leaf_of[segment] = leaf;
    }
    let mut regions: Vec<Vec<u32>> = vec![Vec::new(); leaves.len()];
    for (index, &point) in points.iter().enumerate() {
        let mut best = (f32::INFINITY, usize::MAX);
        for (s, segment) in segments.iter().enumerate() {
            let d = closest_on(segment, point).distance_squared(point);
            // Beyond the last joint its point and the end of its parent's bone are equally near.
            if d < best.0 || (leaf_of[s] != usize::MAX && d <= best.0 * 1.0001) {
                best = (d, s);
            }
        }
        if best.1 != usize::MAX && leaf_of[best.1] != usize::MAX && sight.clear(point, segments[best.1].head, tuning.sight_margin) {
            regions[leaf_of[best.1]].push(index as u32);
        }
    }
    for (&(segment, joint), region) in leaves.iter().zip(&regions) {
        let head = joints[joint].head;
        let (mut sum, mut area) = (Vec3::ZERO, 0f32);
        for &p in region {
            sum += (points[p as usize] - head) * areas[p as usize];
            area += areas[p as usize];
        }
        let towards = (sum / area).normalize_or_zero();
        let incoming = incoming_direction(joints, joint);
        let tail = if area > 0.0 && towards != Vec3::ZERO {
            let reach = region.iter().map(|&p| (points[p as usize] - head).dot(towards)).fold(0f32, f32::max);
            head + towards * reach * tuning.leaf_reach
        } else if let Some(direction) = incoming {
            match sight.first(head, direction, 0.0) {
                Some(distance) => head + direction * distance * 0.5,
                None => head,
            }
        } else {
            head
        };
        segments[segment].tail = tail;
    }
}

/// The typical distance of the surface that is nearest to each bone and sees it.
fn region_radii(segments: &[BoneSegment], points: &[Vec3], areas: &[f32], sight: &Sight, fallback: &[f32], tuning: &Tuning) -> Vec<f32> {
    let stride = points.len().div_ceil(8192).max(1);
    let nearest: Vec<(u32, f32, f32)> = points
        .par_iter()
        .zip(areas)
        .step_by(stride)
        .filter_map(|(&point, &area)| {
            let (d, s) = segments.iter().enumerate().map(|(i, s)| (closest_on(s, point).distance_squared(point), i)).min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?;
            sight.clear(point, closest_on(&segments[s], point), tuning.sight_margin).then_some((s as u32, d.sqrt(), area))
        })
        .collect();
    let mut by_bone: Vec<Vec<(f32, f32)>> = vec![Vec::new(); segments.len()];
    for (s, d, area) in nearest {
        by_bone[s as usize].push((d, area));
    }
    by_bone
        .iter_mut()
        .zip(fallback)
        .map(|(list, &fallback)| {
            if list.len() < 8 {
                return fallback;
            }
            list.sort_by(|a, b| a.0.total_cmp(&b.0));
            let total: f32 = list.iter().map(|e| e.1).sum();
            let mut sum = 0.0;
            for &(d, area) in list.iter() {
                sum += area;
                if sum >= total * tuning.region {
                    return d;
                }
            }
            fallback
        })
        .collect()
}

/// The direction in which the chain arrives at a joint; ancestors at the same place are passed over.
fn incoming_direction(joints: &[WeightJoint], joint: usize) -> Option<Vec3> {
    let head = joints[joint].head;
    let mut at = joints[joint].parent;
    while let Some(parent) = at {
        let direction = (head - joints[parent].head).normalize_or_zero();
        if direction != Vec3::ZERO {
            return Some(direction);
        }
        at = joints[parent].parent;
    }
    None
}

/// The median distance from the bone to the surface around it; infinite if no ray meets the surface.
fn radius(segment: &BoneSegment, sight: &Sight, tuning: &Tuning) -> f32 {
    const STATIONS: usize = 5;
    const SPOKES: [(f32, f32); 8] = [
        (1.0, 0.0),
        (0.707_106_77, 0.707_106_77),
        (0.0, 1.0),
        (-0.707_106_77, 0.707_106_77),
        (-1.0, 0.0),
        (-0.707_106_77, -0.707_106_77),
        (0.0, -1.0),
        (0.707_106_77, -0.707_106_77),
    ];
    let axis = (segment.tail - segment.head).normalize_or(Vec3::Y);
    let (u, v) = axis.any_orthonormal_pair();
    let mut found = Vec::with_capacity(STATIONS * SPOKES.len());
    for station in 0..STATIONS {
        let origin = segment.head.lerp(segment.tail, (station as f32 + 0.5) / STATIONS as f32);
        found.extend(SPOKES.iter().filter_map(|&(a, b)| sight.first(origin, u * a + v * b, 0.0)));
    }
    found.sort_by(f32::total_cmp);
    found.get((found.len() as f32 * tuning.quantile) as usize).copied().unwrap_or(f32::INFINITY)
}

/// The point of the bone that is nearest to `point`.
pub(crate) fn closest_on(segment: &BoneSegment, point: Vec3) -> Vec3 {
    let along = segment.tail - segment.head;
    let length = along.length_squared();
    if length <= 0.0 {
        return segment.head;
    }
    segment.head + along * ((point - segment.head).dot(along) / length).clamp(0.0, 1.0)
}
