//! Limbs of a template: its trunk, its long chains, and what hangs on them.
//!
//! Only the hierarchy and the rest pose decide; labels are hints (`head`, `wing`, a side's suffix).

use glam::Vec3;

use super::TemplateJoint;

/// Length of a chain that makes it a limb, as a share of the template's largest side.
const LIMB_LENGTH: f32 = 0.2;
/// Distance from the plane of symmetry within which a joint is on it, as a share of the largest side.
const ON_PLANE: f32 = 0.02;

/// Cosine of the angle between the trunk and up above which the trunk stands upright.
const UPRIGHT: f32 = 0.6;

/// Kind of a limb.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LimbKind {
    /// The neck with the head.
    Head,
    /// An arm, which does not reach the ground.
    Arm,
    /// A leg, which stands on the ground.
    Leg,
    /// A wing.
    Wing,
    /// A tail.
    Tail,
    /// A chain of a template without a plane of symmetry.
    Free,
}

/// A chain of joints from the trunk to an end.
#[derive(Debug, Clone)]
pub(super) struct Limb {
    pub(super) kind: LimbKind,
    /// Joints from the trunk outwards; the joint on the trunk is not one of them.
    pub(super) joints: Vec<usize>,
    /// The joint of the trunk that carries it.
    pub(super) attach: usize,
    /// The limb on the other side.
    pub(super) partner: Option<usize>,
    /// True for what leads to the rest of a body: the wrist of a hand. How much of it a mesh has is open.
    pub(super) stem: bool,
    /// Length of the flesh beyond the last joint.
    pub(super) beyond: f32,
}

/// A template taken apart.
#[derive(Debug, Clone)]
pub(super) struct TemplateLimbs {
    pub(super) positions: Vec<Vec3>,
    pub(super) parents: Vec<Option<usize>>,
    /// Parents before children.
    pub(super) order: Vec<usize>,
    /// Joints from the root to where the head's limb begins.
    pub(super) trunk: Vec<usize>,
    pub(super) limbs: Vec<Limb>,
    /// The mirrored joint of each joint on a side.
    pub(super) mirror: Vec<Option<usize>>,
    pub(super) size: f32,
}

impl TemplateLimbs {
    /// Length of the chain between two joints of one path.
    pub(super) fn length(&self, from: usize, to: usize) -> f32 {
        let (mut joint, mut length) = (to, 0.0);
        while joint != from {
            let Some(parent) = self.parents[joint] else { return length };
            length += self.positions[joint].distance(self.positions[parent]);
            joint = parent;
        }
        length
    }

    /// End of the flesh of a limb: beyond the last joint, in the direction of the last bone.
    pub(super) fn tip(&self, limb: &Limb) -> Vec3 {
        let end = limb.joints[limb.joints.len() - 1];
        let parent = self.parents[end].unwrap_or(end);
        let direction = (self.positions[end] - self.positions[parent]).normalize_or_zero();
        self.positions[end] + direction * limb.beyond
    }

    /// The place at a length from the end of a limb's flesh along its chain; beyond the limb, its joint of the trunk.
    pub(super) fn place_on(&self, limb: &Limb, length: f32) -> Vec3 {
        let (mut place, mut left) = (self.tip(limb), length);
        for &joint in limb.joints.iter().rev().chain(std::iter::once(&limb.attach)) {
            let next = self.positions[joint];
            let step = place.distance(next);
            if left <= step {
                return place.lerp(next, if step > 0.0 { left / step } else { 0.0 });
            }
            left -= step;
            place = next;
        }
        place
    }

    /// Index in the limb of the joint that turns it in the trunk: a shoulder or a hip.
    pub(super) fn ball_joint(&self, limb: &Limb) -> Option<usize> {
        let whole = self.length(limb.attach, limb.joints[limb.joints.len() - 1]);
        match limb.kind {
            LimbKind::Leg => Some(0),
            // A clavicle is short, or begins at the plane of symmetry.
            LimbKind::Arm => {
                let next = self.length(limb.joints[0], *limb.joints.get(1)?);
                let central = self.positions[limb.joints[0]].x.abs() < 0.04 * self.size;
                Some(usize::from(central && next < 0.35 * whole))
            }
            _ => None,
        }
    }

    /// True if the trunk stands upright.
    pub(super) fn is_upright(&self) -> bool {
        let trunk = &self.trunk;
        let (Some(&first), Some(&last)) = (trunk.first(), trunk.last()) else { return false };
        let along = (self.positions[last] - self.positions[first]).normalize_or_zero();
        first != last && along.y > UPRIGHT
    }

    /// True if the trunk lies across four legs or more.
    pub(super) fn is_on_fours(&self) -> bool {
        !self.is_upright() && self.count(LimbKind::Leg) >= 4
    }

    /// True for a hind leg of an animal on all fours.
    pub(super) fn is_hind_leg(&self, limb: &Limb) -> bool {
        limb.kind == LimbKind::Leg && self.is_on_fours() && self.trunk.first() == Some(&limb.attach)
    }

    /// The knee or elbow of a leg of an animal on all fours, above its ankle, ball and toes.
    pub(super) fn hidden_hinge(&self, limb: &Limb) -> Option<usize> {
        let at = limb.joints.len().checked_sub(4).filter(|_| limb.kind == LimbKind::Leg && self.is_on_fours())?;
        limb.joints.get(at).copied()
    }

    /// True for a leg of an animal that walks on two with a hock below its knee, which the trunk hides.
    pub(super) fn has_hidden_knee(&self, limb: &Limb) -> bool {
        limb.kind == LimbKind::Leg && !self.is_upright() && !self.is_on_fours() && limb.joints.len() > 3
    }

    /// True if some leg has such a knee: the trunk of a bird, whose legs carry it before its hips.
    pub(super) fn has_hidden_knees(&self) -> bool {
        self.limbs.iter().any(|limb| self.has_hidden_knee(limb))
    }

    /// Number of limbs of a kind.
    pub(super) fn count(&self, kind: LimbKind) -> usize {
        self.limbs.iter().filter(|l| l.kind == kind).count()
    }

    /// Length between the ends of two limbs along the skeleton, flesh included.
    pub(super) fn way(&self, a: usize, b: usize) -> f32 {
        let path = |limb: &Limb| {
            let mut joint = limb.joints.last().copied();
            let mut path = Vec::new();
            while let Some(j) = joint {
                path.push(j);
                joint = self.parents[j];
            }
            path
        };
        let (a, b) = (&self.limbs[a], &self.limbs[b]);
        let (pa, pb) = (path(a), path(b));
        let Some(&join) = pa.iter().find(|j| pb.contains(j)) else { return 0.0 };
        self.length(join, pa[0]) + self.length(join, pb[0]) + a.beyond + b.beyond
    }
}

/// Takes a template apart; `None` without joints.
pub(super) fn limbs(joints: &[TemplateJoint]) -> Option<TemplateLimbs> {
    let positions: Vec<Vec3> = joints.iter().map(|j| j.position).collect();
    let mut parents: Vec<Option<usize>> =
        joints.iter().enumerate().map(|(i, j)| j.parent.filter(|&p| p < joints.len() && p != i)).collect();
    let mut children = vec![Vec::new(); joints.len()];
    for (joint, parent) in parents.iter().enumerate() {
        if let Some(parent) = parent {
            children[*parent].push(joint);
        }
    }
    let roots: Vec<usize> = (0..joints.len()).filter(|&j| parents[j].is_none()).collect();
    let mut order = roots.clone();
    let mut next = 0;
    while next < order.len() {
        order.extend(children[order[next]].iter().copied());
        next += 1;
    }
    // A joint in a circle of parents hangs on nothing.
    for joint in 0..joints.len() {
        if !order.contains(&joint) {
            parents[joint] = None;
            children[joint].clear();
            order.push(joint);
        }
    }
    // Length of the longest chain below each joint, and the number of joints below.
    let mut below = lengths_below(&order, &parents, &positions);
    let mut count = vec![1usize; joints.len()];
    for &joint in order.iter().rev() {
        if let Some(parent) = parents[joint] {
            count[parent] += count[joint];
        }
    }
    let root = roots.into_iter().max_by_key(|&r| (count[r], std::cmp::Reverse(r)))?;
    let (low, high) = positions.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), &p| (l.min(p), h.max(p)));
    let size = (high - low).max_element();
    let mirror = mirrored(&positions, size);
    let (trunk, mut limbs) = if mirror.iter().any(Option::is_some) {
        let (positions, parents, children) = (&positions, &parents, &children);
        let tree =
            JointTree { joints, positions, parents, children, order: &order, below: &below, mirror: &mirror, size };
        tree.body_limbs(root, [low.y, high.y])
    } else {
        // A hand: the joint with the most chains becomes the root, and the wrist another chain.
        let busiest = order.iter().copied().max_by_key(|&j| (children[j].len(), std::cmp::Reverse(j))).unwrap_or(root);
        // Feathers are no limbs of their own: what a mesh shows of a wing is one branch.
        let is_wing = joints.iter().any(|joint| joint.label.contains("wing"));
        let attach = if children[busiest].len() > 1 && !is_wing { busiest } else { root };
        reroot(attach, &mut parents, &mut children);
        (order, below) = ordered(attach, &parents, &children, &positions);
        let segment = |j: usize| parents[j].map_or(0.0, |p| positions[j].distance(positions[p]));
        let mut limbs = Vec::new();
        for &child in &children[attach] {
            let chain = longest_chain(child, &children, &below, &positions);
            let beyond = chain.last().map_or(0.0, |&j| segment(j) * 0.8);
            let stem = chain.contains(&root);
            limbs.push(Limb { kind: LimbKind::Free, joints: chain, attach, partner: None, stem, beyond });
        }
        (vec![attach], limbs)
    };
    for a in 0..limbs.len() {
        let other = mirror[limbs[a].joints[0]];
        limbs[a].partner = limbs.iter().position(|l| Some(l.joints[0]) == other);
    }
    Some(TemplateLimbs { positions, parents, order, trunk, limbs, mirror, size })
}

/// Joints of a template with a plane of symmetry.
struct JointTree<'a> {
    joints: &'a [TemplateJoint<'a>],
    positions: &'a [Vec3],
    parents: &'a [Option<usize>],
    children: &'a [Vec<usize>],
    /// Parents before children.
    order: &'a [usize],
    /// Length of the longest chain below each joint.
    below: &'a [f32],
    /// The mirrored joint of each joint on a side.
    mirror: &'a [Option<usize>],
    /// Largest side of the template.
    size: f32,
}

impl JointTree<'_> {
    /// Distance of a joint from its parent.
    fn segment(&self, j: usize) -> f32 {
        self.parents[j].map_or(0.0, |p| self.positions[j].distance(self.positions[p]))
    }

    /// True for joints on the plane of symmetry.
    fn is_central(&self, j: usize) -> bool {
        self.positions[j].x.abs() < ON_PLANE * self.size && self.mirror[j].is_none()
    }

    /// Trunk from the root upwards, and the limbs of a body: the head, and what hangs on the trunk. `heights` are the lowest
    /// and the highest place of a joint.
    fn body_limbs(&self, root: usize, heights: [f32; 2]) -> (Vec<usize>, Vec<Limb>) {
        let (size, parents, children) = (self.size, self.parents, self.children);
        let mut limbs = Vec::new();
        let head = head_joint(self.joints, self.order, &|j| self.is_central(j), parents, root);
        let mut path = vec![head];
        while let Some(parent) = parents[path[path.len() - 1]] {
            path.push(parent);
        }
        path.reverse();
        // The trunk ends where the last pair of limbs is carried.
        let is_limb = |c: usize| !self.is_central(c) && self.below[c] + self.segment(c) > LIMB_LENGTH * size;
        let carries = |j: usize| children[j].iter().any(|&c| is_limb(c));
        let from = path.iter().position(|&j| j == root).unwrap_or(0);
        let last = (from..path.len()).rev().find(|&i| carries(path[i])).unwrap_or(from);
        let trunk = path[from..=last].to_vec();
        let head_joints = path[last + 1..].to_vec();
        if !head_joints.is_empty() {
            // A snout or a beak has joints of its own.
            let snout = self.order.iter().filter(|&&j| parents[j] == Some(head) && self.is_central(j));
            let snout = snout.map(|&j| self.below[j] + self.segment(j)).fold(0.0, f32::max);
            let beyond = if snout > 0.0 { snout } else { (0.085 * size).max(self.segment(head) * 0.8) };
            limbs.push(Limb {
                kind: LimbKind::Head,
                joints: head_joints,
                attach: path[last],
                partner: None,
                stem: false,
                beyond,
            });
        }
        for &attach in &trunk {
            let hanging = children[attach].iter().filter(|child| !trunk.contains(child) && !path.contains(child));
            limbs.extend(hanging.filter_map(|&child| self.hanging_limb(attach, child, heights)));
        }
        (trunk, limbs)
    }

    /// Limb that begins with `child` below the joint `attach` of the trunk; `None` for a short chain that is no tail.
    fn hanging_limb(&self, attach: usize, child: usize, [low, high]: [f32; 2]) -> Option<Limb> {
        let (joints, positions) = (self.joints, self.positions);
        let length = self.below[child] + self.segment(child);
        let chain = longest_chain(child, self.children, self.below, positions);
        let is_long = length > LIMB_LENGTH * self.size;
        let end = chain[chain.len() - 1];
        let (kind, beyond) = if self.is_central(child) {
            if !is_long && !joints[child].label.contains("tail") {
                return None;
            }
            (LimbKind::Tail, self.segment(end))
        } else {
            if !is_long {
                return None;
            }
            let lowest = chain.iter().map(|&j| positions[j].y).fold(f32::INFINITY, f32::min);
            let is_winged = chain.iter().any(|&j| joints[j].label.contains("wing"));
            let kind = match (is_winged, lowest < low + 0.12 * (high - low)) {
                (true, _) => LimbKind::Wing,
                (_, true) => LimbKind::Leg,
                _ => LimbKind::Arm,
            };
            (kind, self.segment(end) * 0.9)
        };
        Some(Limb { kind, joints: chain, attach, partner: None, stem: false, beyond })
    }
}

/// The joint at the other side of the plane `x = 0` for each joint that has one.
fn mirrored(positions: &[Vec3], size: f32) -> Vec<Option<usize>> {
    let near = (1e-3 * size).max(f32::MIN_POSITIVE);
    let other = |joint: usize| {
        let p = positions[joint];
        if p.x.abs() <= near {
            return None;
        }
        let image = Vec3::new(-p.x, p.y, p.z);
        (0..positions.len()).find(|&o| positions[o].distance(image) < near)
    };
    (0..positions.len()).map(other).collect()
}

/// The last central joint with the hint `head` in its label, else the highest and foremost central end.
fn head_joint(
    joints: &[TemplateJoint],
    order: &[usize],
    central: &dyn Fn(usize) -> bool,
    parents: &[Option<usize>],
    root: usize,
) -> usize {
    let in_tree = |mut j: usize| {
        loop {
            if j == root {
                return true;
            }
            match parents[j] {
                Some(p) if central(j) => j = p,
                _ => return false,
            }
        }
    };
    let candidates: Vec<usize> = order.iter().copied().filter(|&j| central(j) && in_tree(j)).collect();
    let lower = |j: usize| joints[j].label.to_lowercase();
    let named = candidates.iter().copied().find(|&j| lower(j).contains("head") || lower(j).contains("skull"));
    named.unwrap_or_else(|| {
        let high = |j: usize| joints[j].position.y + 0.5 * joints[j].position.z;
        candidates.iter().copied().fold(root, |best, j| if high(j) > high(best) { j } else { best })
    })
}

/// The longest chain from a joint to an end.
fn longest_chain(from: usize, children: &[Vec<usize>], below: &[f32], positions: &[Vec3]) -> Vec<usize> {
    let mut chain = vec![from];
    loop {
        let here = chain[chain.len() - 1];
        let reach = |c: usize| below[c] + positions[c].distance(positions[here]);
        let Some(next) = children[here].iter().copied().reduce(|a, b| if reach(b) > reach(a) + 1e-6 { b } else { a })
        else {
            return chain;
        };
        chain.push(next);
    }
}

/// Length of the longest chain below each joint.
fn lengths_below(order: &[usize], parents: &[Option<usize>], positions: &[Vec3]) -> Vec<f32> {
    let mut below = vec![0.0f32; positions.len()];
    for &joint in order.iter().rev() {
        if let Some(parent) = parents[joint] {
            below[parent] = below[parent].max(below[joint] + positions[joint].distance(positions[parent]));
        }
    }
    below
}

/// Makes `root` the root of its tree by turning round the links above it.
fn reroot(root: usize, parents: &mut [Option<usize>], children: &mut [Vec<usize>]) {
    let (mut joint, mut above) = (root, parents[root]);
    parents[root] = None;
    while let Some(parent) = above {
        above = parents[parent];
        children[parent].retain(|&c| c != joint);
        children[joint].push(parent);
        parents[parent] = Some(joint);
        joint = parent;
    }
}

/// The joints below `root`, parents first, then all others, with the lengths of chains below them.
fn ordered(
    root: usize,
    parents: &[Option<usize>],
    children: &[Vec<usize>],
    positions: &[Vec3],
) -> (Vec<usize>, Vec<f32>) {
    let mut order = vec![root];
    order.extend((0..parents.len()).filter(|&j| j != root && parents[j].is_none()));
    let mut next = 0;
    while next < order.len() {
        order.extend(children[order[next]].iter().copied());
        next += 1;
    }
    let below = lengths_below(&order, parents, positions);
    (order, below)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joint(label: &str, parent: Option<usize>, position: [f32; 3]) -> TemplateJoint<'_> {
        TemplateJoint { label, parent, position: Vec3::from_array(position) }
    }

    #[test]
    fn a_figure_has_a_head_two_arms_and_two_legs() {
        let mut joints = vec![
            joint("hips", None, [0.0, 1.0, 0.0]),
            joint("chest", Some(0), [0.0, 1.4, 0.0]),
            joint("head", Some(1), [0.0, 1.6, 0.0]),
        ];
        for (side, upper, hand, thigh, foot) in
            [(1.0, "arm_l", "hand_l", "leg_l", "foot_l"), (-1.0, "arm_r", "hand_r", "leg_r", "foot_r")]
        {
            let at = joints.len();
            joints.push(joint(upper, Some(1), [0.2 * side, 1.4, 0.0]));
            joints.push(joint(hand, Some(at), [0.7 * side, 1.0, 0.0]));
            joints.push(joint(thigh, Some(0), [0.1 * side, 0.9, 0.0]));
            joints.push(joint(foot, Some(at + 2), [0.1 * side, 0.0, 0.0]));
        }
        let found = limbs(&joints).unwrap();
        assert_eq!(found.trunk, [0, 1]);
        assert_eq!(
            [LimbKind::Head, LimbKind::Arm, LimbKind::Leg, LimbKind::Tail].map(|k| found.count(k)),
            [1, 2, 2, 0]
        );
        assert!(found.limbs.iter().all(|l| l.kind == LimbKind::Head || l.partner.is_some()));
    }

    #[test]
    fn circles_of_parents_and_lone_joints_are_no_limbs() {
        let circle = [joint("a", Some(1), [0.0; 3]), joint("b", Some(0), [0.0, 1.0, 0.0])];
        assert!(limbs(&circle).is_none_or(|t| t.limbs.is_empty()));
        assert!(limbs(&[]).is_none());
        assert!(limbs(&circle[..1]).is_none_or(|t| t.limbs.is_empty()));
    }
}
