//! Hierarchy of joints as ranges: whether a joint stands below another is found without a walk.

use super::{WeightJoint, roots::parents_first};

/// Ranges of joints in depth-first order.
#[derive(Debug, Clone)]
pub(super) struct Hierarchy {
    /// Place of each joint, and the place behind the last joint below it. Joints among their own ancestors have none.
    ranges: Vec<[usize; 2]>,
}

impl Hierarchy {
    /// Hierarchy of joints whose parents exist, in any order.
    pub fn new(joints: &[WeightJoint]) -> Self {
        let (order, _) = parents_first(joints);
        let mut sizes = vec![0; joints.len()];
        for &joint in order.iter().rev() {
            sizes[joint] += 1;
            if let Some(parent) = joints[joint].parent {
                sizes[parent] += sizes[joint];
            }
        }
        let mut ranges = vec![[usize::MAX; 2]; joints.len()];
        // Places that are free for the next root, and for the next child of each joint.
        let (mut next_root, mut next) = (0, vec![0; joints.len()]);
        for &joint in &order {
            let free = match joints[joint].parent {
                Some(parent) => &mut next[parent],
                None => &mut next_root,
            };
            let first = *free;
            *free += sizes[joint];
            ranges[joint] = [first, first + sizes[joint]];
            next[joint] = first + 1;
        }
        Self { ranges }
    }

    /// True if a joint is `top` or stands below it.
    pub fn has(&self, top: usize, joint: usize) -> bool {
        let [first, end] = self.ranges[top];
        (first..end).contains(&self.ranges[joint][0])
    }

    /// Number of joints from `top` down, itself included.
    pub fn count(&self, top: usize) -> usize {
        let [first, end] = self.ranges[top];
        end - first
    }
}

/// Joints without twist and half joints: the bones that others share. Each has the nearest such joint above it.
pub(super) struct Cores {
    /// Nearest of these joints above each joint.
    pub above: Vec<Option<usize>>,
    /// Largest distance of each joint from those of which it is the nearest above; 0 without any.
    pub longest: Vec<f32>,
}

impl Cores {
    /// Cores of joints whose parents exist, in any order.
    pub fn new(joints: &[WeightJoint]) -> Self {
        let is_core = |joint: usize| joints[joint].twist.is_none() && joints[joint].halves.is_none();
        let mut above: Vec<Option<usize>> = vec![None; joints.len()];
        let mut longest: Vec<f32> = vec![0.0; joints.len()];
        for joint in parents_first(joints).0 {
            let Some(parent) = joints[joint].parent else { continue };
            above[joint] = if is_core(parent) { Some(parent) } else { above[parent] };
            if let Some(core) = above[joint].filter(|_| is_core(joint)) {
                longest[core] = longest[core].max(joints[joint].head.distance(joints[core].head));
            }
        }
        Self { above, longest }
    }
}
