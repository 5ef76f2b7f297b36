//! Markers: places that a person gave, and the rest of a limb fitted around them.

use glam::Vec3;

use super::limbs::TemplateLimbs;

/// A place for a joint of the template, in unit space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Marker {
    pub(super) joint: usize,
    pub(super) place: Vec3,
    /// True if it lies apart from the volume of the mesh.
    pub(super) outside: bool,
    /// True if the mesh shows the joint elsewhere for sure.
    pub(super) against: bool,
}

impl Marker {
    /// True if the marker moves its limb and tells nothing about the rest of the body.
    pub(super) fn is_alone(&self) -> bool {
        self.outside || self.against
    }
}

/// Moves joints so that each marker's joint is at its place; the rest of its limb follows, less with the distance along
/// the skeleton, and joints between two markers share what both ask. Joints of other limbs follow only without
/// `limb_alone`, and never a marker that contradicts the mesh.
pub(super) fn warp(template: &TemplateLimbs, places: &mut [Vec3], markers: &[Marker], limb_alone: bool) {
    if markers.is_empty() {
        return;
    }
    let moves: Vec<Vec3> = markers.iter().map(|m| m.place - places[m.joint]).collect();
    let mut children = vec![Vec::new(); places.len()];
    for (joint, parent) in template.parents.iter().enumerate() {
        if let Some(parent) = parent {
            children[*parent].push(joint);
        }
    }
    let limb_length = |joint: usize| {
        let limb = template.limbs.iter().find(|l| l.joints.contains(&joint));
        limb.map_or(0.3 * template.size, |l| {
            template.length(l.attach, l.joints[l.joints.len() - 1]).max(0.05 * template.size)
        })
    };
    // The limb that each joint belongs to, with all that hangs on it; the trunk is one, too.
    let mut limb_of = vec![usize::MAX; places.len()];
    for &joint in &template.order {
        let own = template.limbs.iter().position(|l| l.joints.contains(&joint));
        limb_of[joint] = match (own, template.parents[joint]) {
            (Some(limb), _) => limb,
            (None, Some(parent)) if !template.trunk.contains(&joint) => limb_of[parent],
            _ => usize::MAX,
        };
    }
    let mut sums = vec![(Vec3::ZERO, 0.0f32); places.len()];
    for (marker, &way) in markers.iter().zip(&moves) {
        let reach = 0.6 * limb_length(marker.joint);
        let limb_alone = limb_alone || marker.is_alone();
        // Distances along the skeleton from the marker.
        let mut distance = vec![f32::INFINITY; places.len()];
        distance[marker.joint] = 0.0;
        // What hangs on a joint that is moved far goes with it.
        let mut is_below = vec![false; places.len()];
        for &joint in template.order.iter().filter(|_| marker.is_alone()) {
            let above = template.parents[joint];
            is_below[joint] = joint == marker.joint || above.is_some_and(|above| is_below[above]);
        }
        let mut open = vec![marker.joint];
        while let Some(joint) = open.pop() {
            let neighbours = children[joint].iter().copied().chain(template.parents[joint]);
            for next in neighbours.filter(|&n| !limb_alone || limb_of[n] == limb_of[marker.joint]) {
                let bone = template.positions[joint].distance(template.positions[next]);
                let there = distance[joint] + if is_below[next] { 0.0 } else { bone };
                if there < distance[next] && there < reach {
                    distance[next] = there;
                    open.push(next);
                }
            }
        }
        for (sum, &distance) in sums.iter_mut().zip(&distance) {
            if distance < reach {
                let near = 1.0 - distance / reach;
                sum.0 += way * near * near;
                sum.1 += near;
            }
        }
    }
    for (place, (sum, near)) in places.iter_mut().zip(&sums) {
        if *near > 0.0 {
            *place += *sum / near;
        }
    }
    for marker in markers {
        places[marker.joint] = marker.place;
    }
}
