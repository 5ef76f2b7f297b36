//! The nearest few joints of every solid voxel, with path lengths, from one search for all joints together.

use glam::Vec3;

use super::BoneSegment;
use crate::mesh::voxels::Voxels;

/// The most joints a voxel can keep.
pub(super) const MOST: usize = 16;
/// Lengths of steps to neighbours over a face, an edge and a corner, near the ratio of 1 : √2 : √3.
const STEP: [u32; 3] = [10, 14, 17];
/// Factor of a step's length inside the outer half of the surface layer, which may bridge a narrow gap.
const SHELL_STEP: u32 = 2;
/// Length beyond the ratio of [`Limits`] that a path may have before it is given up, in tenths of a cell.
const SLACK: f32 = 100.0;
/// Segments of a joint whose distances are measured exactly; a joint with more is a mistake in the input.
const MOST_SEGMENTS: usize = 64;
/// Joints outside the solid for which the nearest solid cell is searched, each over all cells.
const MOST_OUTSIDE: usize = 1024;

/// The bones gathered by joint, in the order of joint indices.
pub(super) struct Joints {
    /// Index of each joint in the caller's terms, rising.
    ids: Vec<u32>,
    /// First segment of each joint, and one more at the end.
    starts: Vec<usize>,
    segments: Vec<(Vec3, Vec3)>,
}

impl Joints {
    /// Gathers segments with finite ends.
    pub(super) fn new(bones: &[BoneSegment]) -> Self {
        let mut bones: Vec<&BoneSegment> = bones.iter().filter(|b| b.head.is_finite() && b.tail.is_finite()).collect();
        bones.sort_by_key(|b| b.joint);
        let mut joints = Self { ids: Vec::new(), starts: vec![0], segments: Vec::new() };
        for group in bones.chunk_by(|a, b| a.joint == b.joint) {
            joints.ids.push(group[0].joint);
            joints.segments.extend(group.iter().take(MOST_SEGMENTS).map(|b| (b.head, b.tail)));
            joints.starts.push(joints.segments.len());
        }
        joints
    }

    /// The joint's index in the caller's terms.
    pub(super) fn id(&self, joint: u32) -> u32 {
        self.ids[joint as usize]
    }

    fn segments(&self, joint: usize) -> &[(Vec3, Vec3)] {
        &self.segments[self.starts[joint]..self.starts[joint + 1]]
    }

    /// The box of all segments.
    pub(super) fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let first = self.segments.first()?.0;
        Some(
            self.segments
                .iter()
                .fold((first, first), |(low, high), (a, b)| (low.min(*a).min(*b), high.max(*a).max(*b))),
        )
    }

    /// Vector from the nearest point of a joint's bones to `point`.
    fn offset(&self, joint: u32, point: Vec3) -> Vec3 {
        let mut best = Vec3::INFINITY;
        let mut least = f32::INFINITY;
        for &(head, tail) in self.segments(joint as usize) {
            let (along, to) = (tail - head, point - head);
            let length = along.length_squared();
            let t = if length > 0.0 { (to.dot(along) / length).clamp(0.0, 1.0) } else { 0.0 };
            let offset = to - along * t;
            if offset.length_squared() < least {
                (best, least) = (offset, offset.length_squared());
            }
        }
        best
    }

    /// The straight distance from a joint's bones to `point`.
    pub(super) fn distance(&self, joint: u32, point: Vec3) -> f32 {
        self.offset(joint, point).length()
    }

    /// Length of the path to a cell, as a multiple of the straight line, at least 1. Both are measured in steps between cells, so
    /// the error of such lengths cancels; a cell of slack covers where on the bone a path begins.
    pub(super) fn detour(&self, joint: u32, center: Vec3, cost: u32, cell: f32) -> f32 {
        let mut steps = (self.offset(joint, center) / cell).abs().to_array();
        steps.sort_by(f32::total_cmp);
        let [low, middle, high] = steps;
        let straight = 17.0 * low + 14.0 * (middle - low) + 10.0 * (high - middle);
        let slack = 2.0 * STEP[2] as f32;
        ((cost as f32 + slack) / (straight + 1.5 * slack)).max(1.0)
    }
}

/// Limits on the joints that a voxel keeps.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    /// Number of joints that a voxel keeps, at most [`MOST`].
    pub(super) labels: usize,
    /// Joints further than this multiple of the nearest one's distance have no weight.
    pub(super) ratio: f32,
}

/// The nearest joints of all solid voxels.
pub(super) struct Field {
    labels: usize,
    /// Entries of each voxel, `labels` in number, of joint and path length in tenths of a cell, nearest first; unused
    /// ones have the length `u32::MAX`.
    entries: Vec<(u32, u32)>,
}

impl Field {
    /// Searches from the voxels on all bones at once (Dial's algorithm: buckets of whole lengths). `None` if
    /// `progress` says to stop.
    pub(super) fn new(
        voxels: &Voxels,
        joints: &Joints,
        limits: Limits,
        progress: &dyn Fn(f32) -> bool,
    ) -> Option<Self> {
        let cells = voxels.cells();
        let labels = limits.labels;
        let mut field = Self { labels, entries: vec![(u32::MAX, u32::MAX); cells.len() * labels] };
        let mut seeds = seeds(voxels, joints, &cells);
        seeds.sort_unstable();
        let mut seeds = seeds.into_iter().peekable();

        let longest = (STEP[2] * SHELL_STEP) as usize;
        let mut buckets: Vec<Vec<(u32, u32)>> = vec![Vec::new(); longest + 1];
        let (mut cost, mut waiting) = (0u32, 0usize);
        let mut first = 0usize;
        loop {
            if waiting == 0 {
                match seeds.peek() {
                    Some(&(next, ..)) => cost = cost.max(next),
                    None => break,
                }
            }
            let slot = cost as usize % buckets.len();
            while let Some((_, joint, cell)) = seeds.next_if(|&(at, ..)| at <= cost) {
                if field.improve(cell as usize, joint, cost) {
                    buckets[slot].push((cell, joint));
                    waiting += 1;
                }
            }
            let mut bucket = std::mem::take(&mut buckets[slot]);
            waiting -= bucket.len();
            for &(cell, joint) in &bucket {
                if !field.holds(cell as usize, joint, cost) {
                    continue;
                }
                // The nearest joint of a voxel settles first. Others count only while they are not much further;
                // beyond the slack no path of theirs leads to a place where they matter.
                let nearest = field.entries[cell as usize * labels].1;
                first += usize::from(nearest == cost);
                if (cost - nearest) as f32 > (limits.ratio - 1.0) * nearest as f32 + SLACK {
                    continue;
                }
                let at = cells[cell as usize].map(usize::from);
                let core = voxels.is_core(at);
                voxels.neighbours(at, |index, kind, inside| {
                    let length = if core || inside { STEP[kind] } else { STEP[kind] * SHELL_STEP };
                    let reached = cost + length;
                    if field.improve(index, joint, reached) {
                        buckets[reached as usize % (longest + 1)].push((index as u32, joint));
                        waiting += 1;
                    }
                });
            }
            bucket.clear();
            buckets[slot] = bucket;
            cost += 1;
            if cost.is_multiple_of(64) && !progress((first as f32 / cells.len() as f32).min(1.0)) {
                return None;
            }
        }
        Some(field)
    }

    /// `true` if a joint reaches the voxel.
    pub(super) fn is_reached(&self, cell: usize) -> bool {
        self.entries[cell * self.labels].1 != u32::MAX
    }

    /// The joints of a voxel and their path lengths, nearest first.
    pub(super) fn of(&self, cell: usize) -> impl Iterator<Item = (u32, u32)> + '_ {
        self.entries[cell * self.labels..(cell + 1) * self.labels].iter().copied().take_while(|e| e.1 != u32::MAX)
    }

    fn holds(&self, cell: usize, joint: u32, cost: u32) -> bool {
        self.of(cell).any(|entry| entry == (joint, cost))
    }

    /// Enters a path if it is among the shortest; a joint appears once. Lengths only fall, so a joint that is pushed
    /// out by nearer ones could never have come back.
    fn improve(&mut self, cell: usize, joint: u32, cost: u32) -> bool {
        let entries = &mut self.entries[cell * self.labels..(cell + 1) * self.labels];
        if entries[entries.len() - 1].1 <= cost {
            return false;
        }
        let mut end = entries.len() - 1;
        for (i, entry) in entries.iter().enumerate() {
            if entry.0 == joint {
                if entry.1 <= cost {
                    return false;
                }
                end = i;
                break;
            }
            if entry.1 == u32::MAX {
                end = i;
                break;
            }
        }
        while end > 0 && entries[end - 1].1 > cost {
            entries[end] = entries[end - 1];
            end -= 1;
        }
        entries[end] = (joint, cost);
        true
    }
}

/// Starts of paths: length so far, joint, cell.
fn seeds(voxels: &Voxels, joints: &Joints, cells: &[[u16; 3]]) -> Vec<(u32, u32, u32)> {
    let mut seeds = Vec::new();
    let mut outside = 0;
    for joint in 0..joints.ids.len() {
        let first = seeds.len();
        for &(head, tail) in joints.segments(joint) {
            let mut last = usize::MAX;
            voxels.along(head, tail, |cell| {
                if cell != last {
                    seeds.push((0, joint as u32, cell as u32));
                    last = cell;
                }
            });
        }
        if seeds.len() == first && outside < MOST_OUTSIDE {
            outside += 1;
            let joint = joint as u32;
            // The bone lies outside: its paths begin at the nearest solid cell with the distance to it.
            let distance = |cell: &[u16; 3]| joints.distance(joint, voxels.center(cell.map(usize::from)));
            let nearest = cells.iter().map(distance).enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((cell, far)) = nearest {
                let cost = (far / voxels.cell() as f32 * STEP[0] as f32).min(1e6);
                seeds.push((cost as u32, joint, cell as u32));
            }
        }
    }
    seeds
}
