//! Bones of joints: which straight pieces a joint pulls with, and how far its flesh reaches.
//!
//! A joint owns a bone to each of its children that does not lie behind it, so a hand holds its whole palm and a chest
//! reaches up to both collarbones. Where a chain ends there is no child: the bone then runs through the flesh beyond
//! the last joint.

use glam::Vec3;
use rayon::prelude::*;

use super::{
    WeightJoint,
    bone::BoneSegment,
    bone_tree::closest_on,
    folds::{Fold, folds},
    holders::Holders,
    keypoints,
    layers::Layers,
    roots::{Homes, MANY_CHILDREN, Roots, parents_first},
    sight::Sight,
};

/// Length of a last bone in the flesh beyond its joint, as a share of the reach of that flesh.
pub(super) const LEAF_REACH: f32 = 0.8;
/// Approximate number of points that measure the girth of bones.
const SAMPLES: usize = 8192;
/// The share of the flesh around a bone that lies within its girth.
const GIRTH: f32 = 0.9;
/// Points handled at a time by one thread.
const CHUNK: usize = 256;
/// A bone with fewer measured points than this takes the typical girth.
const FEW: usize = 4;

/// Bones, their girths, and a tree over them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Bones {
    pub segments: Vec<BoneSegment>,
    /// Usual reach of the flesh around each bone, and of the clothes around that.
    girths: Vec<[f32; 2]>,
    /// The largest of them.
    pub largest_girth: f32,
    /// Island that the flesh of each bone is, if one is around it.
    flesh: Vec<Option<usize>>,
    /// Folds at which each bone may lose skin to another.
    pub folds: Vec<Vec<Fold>>,
    pub holders: Holders,
    homes: Homes,
}

impl Bones {
    /// True if a bone may hold flesh of an island: the body parts that a bone runs through are its own. Parts that no
    /// bone runs through, as hats and capes, belong to the bones of the part that they lie on.
    pub fn may_hold(&self, bone: u32, island: usize) -> bool {
        self.homes.may_hold(bone, self.segments[bone as usize].joint, island)
    }

    /// The joints that alone may hold an island; `None` if all may.
    pub fn joints_of(&self, island: usize) -> Option<&[u32]> {
        self.homes.joints_of(island)
    }

    /// True if a joint is at home in an island of several.
    pub fn is_resident(&self, joint: u32, island: usize) -> bool {
        self.homes.is_resident(joint, island)
    }

    /// Usual reach around a bone of its flesh, or of the clothes of an island that is around the flesh.
    pub fn girth(&self, bone: u32, island: usize) -> f32 {
        let is_over = is_over(self.flesh[bone as usize], self.segments[bone as usize].joint, island, &self.homes);
        self.girths[bone as usize][usize::from(is_over)]
    }

    /// Bones without those of slots, for islands that are bound without regard to body parts.
    pub fn without_slots(&self) -> Vec<BoneSegment> {
        self.segments.iter().filter(|segment| !self.homes.is_slot(segment.joint)).copied().collect()
    }
}

/// Builds the bones of the joints that take part, in a frame where the surface has unit size. `areas` are those around
/// the points of the welded surface that `sight` sees. Joints for which `claims` is true have bones and may hold any part
/// even if they hang in the air; those for which `slots` is true hold no part that other bones run through.
pub(crate) fn build(
    joints: &[WeightJoint],
    takes_part: &[bool],
    (claims, slots): (&[bool], &[bool]),
    points: &[Vec3],
    areas: &[f32],
    sight: &Sight,
) -> Bones {
    /// Joints closer than this share a place.
    const SAME: f32 = 1e-6;
    let joints = keypoints::set_into_flesh(keypoints::set_back(joints, sight), sight);
    let joints = &joints[..];
    let owners: Vec<Option<u32>> = owners(joints).into_iter().map(|o| o.filter(|&j| takes_part[j as usize])).collect();
    let children = parents_first(joints).1;
    let tree = Roots::new(joints, &children, sight);
    let helpers = tree.helpers(joints, sight);
    let carries: Vec<bool> = joints
        .iter()
        .enumerate()
        .map(|(index, joint)| {
            let Some(parent) = joint.parent else { return false };
            joints[parent].head.distance(joint.head) > SAME && !tree.hangs_in_air[index]
        })
        .collect();
    let behind: Vec<bool> = (0..joints.len()).map(|j| carries[j] && is_behind(joints, &carries, j)).collect();
    let mut leads_on = vec![false; joints.len()];
    for (index, joint) in joints.iter().enumerate() {
        if let Some(parent) = joint.parent {
            leads_on[parent] |= carries[index] && !behind[index];
        }
    }
    let mut segments = Vec::new();
    for (index, joint) in joints.iter().enumerate() {
        let Some(parent) = joint.parent else { continue };
        let Some(owner) = owners[parent] else { continue };
        if carries[index] && passes_beside(joints, &carries, &children, index) {
            continue;
        }
        let is_claimed =
            claims[parent] && (helpers[parent] || !helpers[index]) && joints[parent].head.distance(joint.head) > SAME;
        if (is_claimed || carries[index] && !helpers[index]) && !(behind[index] && leads_on[parent]) {
            segments.push(BoneSegment { joint: owner, head: joints[parent].head, tail: joint.head });
        }
    }
    let mut leaves = Vec::new();
    for (index, joint) in joints.iter().enumerate() {
        let Some(owner) = owners[index] else { continue };
        let is_leaf = children[index].is_empty() && !helpers[index];
        if !(is_leaf || claims[index] && segments.iter().all(|segment| segment.joint != owner)) {
            continue;
        }
        let tail = joint.tail.filter(|t| t.distance(joint.head) > SAME);
        if tail.is_none() {
            leaves.push((segments.len(), index));
        }
        segments.push(BoneSegment { joint: owner, head: joint.head, tail: tail.unwrap_or(joint.head) });
    }
    if segments.is_empty() {
        // All bones lie outside the surface: a rig beside its mesh.
        segments.extend(
            joints
                .iter()
                .zip(&owners)
                .filter_map(|(j, o)| Some(BoneSegment { joint: (*o)?, head: j.head, tail: j.head })),
        );
    }
    drop_repeats(&mut segments, &mut leaves, claims);
    let homes = Homes::new(joints, (claims, slots), &segments, points, sight);
    let layers = Layers::new(joints, homes.residents(), sight);
    let mut flesh: Vec<Option<usize>> = segments.iter().map(|segment| layers.flesh(segment.joint)).collect();
    let regions = leaf_regions(joints, &segments, &leaves, points, (sight, &homes));
    for (&(segment, joint), mut region) in leaves.iter().zip(regions) {
        let (owner, head) = (segments[segment].joint, joints[joint].head);
        let inner = flesh_of_leaf(&mut region, owner, head, (points, areas), &layers, sight);
        flesh[segment] = inner.or(flesh[segment]);
        grow_leaf(joints, joint, &mut segments[segment], &region, (points, areas), sight);
    }
    let holders = Holders::new(&segments);
    let girths = girths(&segments, &flesh, &holders, points, areas, (sight, &homes));
    let mut is_guess = vec![false; segments.len()];
    leaves.iter().for_each(|(segment, _)| is_guess[*segment] = true);
    let folds = folds(&segments, &is_guess);
    let largest_girth = girths.iter().flatten().copied().fold(0.0, f32::max);
    Bones { segments, girths, largest_girth, flesh, folds, holders, homes }
}

/// True if the bone to `joint` turns back along the bone by which the chain arrived at its parent: an ear that hangs on
/// the nose, say. The flesh there is the grandparent's.
fn is_behind(joints: &[WeightJoint], carries: &[bool], joint: usize) -> bool {
    /// The cosine of the sharpest turn that a bone takes.
    const TURN: f32 = -0.25;
    let Some(parent) = joints[joint].parent else { return false };
    let Some(grandparent) = joints[parent].parent else { return false };
    let onwards = (joints[joint].head - joints[parent].head).normalize_or_zero();
    let arriving = (joints[parent].head - joints[grandparent].head).normalize_or_zero();
    carries[parent] && onwards.dot(arriving) < TURN
}

/// True if the bone to `joint` runs along a longer one of the same parent, and a limb that is small beside it goes off to the
/// side there: a thumb that hangs on the forearm of a figure without wrists. The forearm's flesh is the longer bone's, and what
/// is around the joint is the thumb's. Bones to fingers run side by side, too, but fingers go straight on.
fn passes_beside(joints: &[WeightJoint], carries: &[bool], children: &[Vec<usize>], joint: usize) -> bool {
    /// The flesh of a limb is about this share of its length thick: bones nearer to each other run through the same flesh, and
    /// a limb whose first bone is shorter begins in it.
    const THICK: f32 = 0.25;
    /// The cosine of the least turn to the side: 60 degrees.
    const ASIDE: f32 = 0.5;
    let Some(parent) = joints[joint].parent else { return false };
    let (from, to) = (joints[parent].head, joints[joint].head);
    let way = to - from;
    let length = way.length();
    let goes_aside = |child: &usize| {
        let onwards = joints[*child].head - to;
        onwards.length() < THICK * length && onwards.dot(way) < ASIDE * onwards.length() * length
    };
    if children[parent].len() > MANY_CHILDREN {
        return false;
    }
    let mut limb = children[joint].iter().filter(|child| carries[**child]).peekable();
    if limb.peek().is_none() || !limb.all(goes_aside) {
        return false;
    }
    children[parent].iter().any(|&other| {
        let bone = BoneSegment { joint: 0, head: from, tail: joints[other].head };
        other != joint
            && carries[other]
            && from.distance(bone.tail) > length
            && closest_on(&bone, to).distance(to) < THICK * length
    })
}

/// Joint that carries the flesh of each joint: itself, or the nearest ancestor that deforms. All deform if none does.
fn owners(joints: &[WeightJoint]) -> Vec<Option<u32>> {
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
            path.push(joint);
            if joints[joint].deforms {
                owner = Some(joint as u32);
                break;
            }
            at = joints[joint].parent;
        }
        for joint in path.drain(..) {
            owners[joint] = owner;
            known[joint] = true;
        }
    }
    owners
}

/// Removal of bones at the place of another: one of a joint that claims skin stays, or else the first one, because nothing
/// tells them apart.
fn drop_repeats(segments: &mut Vec<BoneSegment>, leaves: &mut Vec<(usize, usize)>, claims: &[bool]) {
    let key = |s: &BoneSegment| [s.head, s.tail].map(|p| p.to_array().map(|c| (c + 0.0).to_bits()));
    let mut order: Vec<usize> = (0..segments.len()).collect();
    order.sort_by_key(|&i| (key(&segments[i]), !claims[segments[i].joint as usize], i));
    let mut keep = vec![true; segments.len()];
    for pair in order.windows(2) {
        if key(&segments[pair[0]]) == key(&segments[pair[1]]) {
            keep[pair[1]] = false;
        }
    }
    let mut kept = 0;
    let place: Vec<Option<usize>> = keep
        .iter()
        .map(|&keep| {
            kept += usize::from(keep);
            keep.then(|| kept - 1)
        })
        .collect();
    *leaves = leaves.iter().filter_map(|&(segment, joint)| Some((place[segment]?, joint))).collect();
    let mut flags = keep.iter();
    segments.retain(|_| flags.next().copied().unwrap_or(true));
}

/// True if an island is around the flesh of a bone of a joint, as a sleeve is.
fn is_over(flesh: Option<usize>, joint: u32, island: usize, homes: &Homes) -> bool {
    flesh.is_some_and(|flesh| flesh != island) && homes.is_resident(joint, island)
}

/// The points that are nearest to the bone of each last joint and see the joint.
fn leaf_regions(
    joints: &[WeightJoint],
    segments: &[BoneSegment],
    leaves: &[(usize, usize)],
    points: &[Vec3],
    (sight, homes): (&Sight, &Homes),
) -> Vec<Vec<u32>> {
    let mut regions: Vec<Vec<u32>> = vec![Vec::new(); leaves.len()];
    if leaves.is_empty() {
        return regions;
    }
    let mut leaf_of = vec![usize::MAX; segments.len()];
    for (leaf, &(segment, _)) in leaves.iter().enumerate() {
        leaf_of[segment] = leaf;
    }
    let holders = Holders::new(segments);
    let nearest: Vec<usize> = points
        .par_chunks(CHUNK)
        .enumerate()
        .flat_map_iter(|(number, chunk)| {
            let mut near = Vec::new();
            let (leaf_of, holders) = (&leaf_of, &holders);
            chunk.iter().enumerate().map(move |(at, &point)| {
                let index = number * CHUNK + at;
                // Beyond the last joint its place and the end of its parent's bone are equally near.
                let island = sight.island(index);
                let cost = |b: u32| {
                    let segment = &segments[b as usize];
                    let may_hold = homes.may_hold(b, segment.joint, island);
                    if may_hold { closest_on(segment, point).distance(point) } else { f32::INFINITY }
                };
                holders.cheapest((point, 1e-4), homes.joints_of(island), cost, |distance| distance, &mut near);
                let leaf = near.iter().map(|e| leaf_of[e.1 as usize]).find(|&l| l != usize::MAX);
                leaf.filter(|&l| sight.clear(index, point, joints[leaves[l].1].head)).unwrap_or(usize::MAX)
            })
        })
        .collect();
    for (point, &leaf) in nearest.iter().enumerate() {
        if leaf != usize::MAX {
            regions[leaf].push(point as u32);
        }
    }
    regions
}

/// Leaves the flesh alone in the region of the last joint at `head`, without what lies on it or is around it, and returns the
/// island of the flesh. Flesh that lies evenly around the joint, as the rim of a head around the joint of a hat, tells no way.
fn flesh_of_leaf(
    region: &mut Vec<u32>,
    joint: u32,
    head: Vec3,
    (points, areas): (&[Vec3], &[f32]),
    layers: &Layers,
    sight: &Sight,
) -> Option<usize> {
    /// The length of the mean of ways is more than this share of their mean length where most lead to one side.
    const UNEVEN: f32 = 0.3;
    let island = |point: &u32| sight.island(*point as usize);
    let way = |point: &u32| points[*point as usize] - head;
    let flesh = layers.flesh_of_last(joint, region.iter().map(|point| (island(point), way(point).length())))?;
    let (mut sum, mut lengths) = (Vec3::ZERO, 0.0);
    for point in region.iter().filter(|point| island(point) == flesh) {
        sum += way(point) * areas[*point as usize];
        lengths += way(point).length() * areas[*point as usize];
    }
    if sum.length() > UNEVEN * lengths {
        region.retain(|point| island(point) == flesh);
    }
    Some(flesh)
}

/// Lets the bone of a last joint run through the flesh around the joint: towards the centroid of the surface that is
/// nearest to the joint, and nearly as far as that surface reaches. The direction in which the chain arrives would miss
/// the toes of a foot that was entered from above.
fn grow_leaf(
    joints: &[WeightJoint],
    joint: usize,
    segment: &mut BoneSegment,
    region: &[u32],
    (points, areas): (&[Vec3], &[f32]),
    sight: &Sight,
) {
    let head = joints[joint].head;
    let sum: Vec3 = region.iter().map(|&p| (points[p as usize] - head) * areas[p as usize]).sum();
    let towards = sum.normalize_or_zero();
    segment.tail = if towards != Vec3::ZERO {
        let reach = region.iter().map(|&p| (points[p as usize] - head).dot(towards)).fold(0f32, f32::max);
        head + towards * reach * LEAF_REACH
    } else {
        // Nothing of the surface is nearest to it: half way to whatever lies ahead.
        incoming_direction(joints, joint)
            .and_then(|direction| Some(head + direction * sight.first(head, direction)? * 0.5))
            .unwrap_or(head)
    };
}

/// The direction in which the chain arrives at a joint; ancestors at the same place are passed over.
fn incoming_direction(joints: &[WeightJoint], joint: usize) -> Option<Vec3> {
    /// Longer chains at one place are no chains.
    const FAR: usize = 64;
    let head = joints[joint].head;
    let mut at = joints[joint].parent;
    for _ in 0..FAR {
        let parent = at?;
        let direction = (head - joints[parent].head).normalize_or_zero();
        if direction != Vec3::ZERO {
            return Some(direction);
        }
        at = joints[parent].parent;
    }
    None
}

/// Usual reach of the surface around each bone: a high quantile, by area, of the distances of the points that
/// are nearest to the bone and see it; of the flesh, and of clothes around it. Points of parts that lie on others count for
/// bones that are nearest to no other points, as for the bone of a hat.
fn girths(
    segments: &[BoneSegment],
    flesh: &[Option<usize>],
    holders: &Holders,
    points: &[Vec3],
    areas: &[f32],
    (sight, homes): (&Sight, &Homes),
) -> Vec<[f32; 2]> {
    let stride = points.len().div_ceil(SAMPLES).max(1);
    let samples: Vec<usize> = (0..points.len()).step_by(stride).collect();
    let measured: Vec<Option<(u32, f32)>> = samples
        .par_chunks(256)
        .flat_map_iter(|chunk| {
            let mut near = Vec::new();
            chunk.iter().map(move |&p| {
                let (point, island) = (points[p], sight.island(p));
                let cost = |b: u32| {
                    let segment = &segments[b as usize];
                    let may_hold = homes.may_hold(b, segment.joint, island);
                    if may_hold { closest_on(segment, point).distance(point) } else { f32::INFINITY }
                };
                holders.cheapest((point, 0.0), homes.joints_of(island), cost, |distance| distance, &mut near);
                let &(distance, bone) = near.first().filter(|nearest| nearest.0.is_finite())?;
                sight.clear(p, point, closest_on(&segments[bone as usize], point)).then_some((bone, distance))
            })
        })
        .collect();
    let mut around: Vec<[Vec<(f32, f32)>; 3]> = vec![Default::default(); segments.len()];
    for (&p, measure) in samples.iter().zip(measured) {
        if let Some((bone, distance)) = measure {
            let (island, joint) = (sight.island(p), segments[bone as usize].joint);
            let layer = match homes.lies_on_others(island) {
                true => 2,
                false => usize::from(is_over(flesh[bone as usize], joint, island, homes)),
            };
            around[bone as usize][layer].push((distance, areas[p]));
        }
    }
    let girth = |lists: &mut [Vec<(f32, f32)>; 3]| {
        let measure = |list: &mut Vec<(f32, f32)>| if list.len() >= FEW { quantile(list) } else { None };
        let [flesh, over, lying] = lists.each_mut().map(measure);
        let flesh = flesh.or(over).or(lying);
        [flesh, over.or(flesh)]
    };
    let mut girths: Vec<[Option<f32>; 2]> = around.iter_mut().map(girth).collect();
    let mut known: Vec<f32> = girths.iter().filter_map(|[flesh, _]| *flesh).collect();
    known.sort_by(f32::total_cmp);
    // Without a single measure no bone has a girth, and plain distance decides.
    let typical = known.get(known.len() / 2).copied().unwrap_or(f32::INFINITY);
    for girth in girths.iter_mut().flatten() {
        *girth = girth.filter(|&g| g > 0.05 * typical || typical == f32::INFINITY).or(Some(typical));
    }
    girths.into_iter().map(|girths| girths.map(|girth| girth.unwrap_or(typical))).collect()
}

/// The distance within which [`GIRTH`] of the area lies.
fn quantile(list: &mut [(f32, f32)]) -> Option<f32> {
    list.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f32 = list.iter().map(|e| e.1).sum();
    let mut sum = 0.0;
    list.iter()
        .find(|e| {
            sum += e.1;
            sum >= total * GIRTH
        })
        .map(|e| e.0)
}
