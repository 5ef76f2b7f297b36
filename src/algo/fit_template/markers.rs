//! Markers: places that a person gave, and the rest of a limb fitted around them.

use glam::Vec3;

use super::limbs::{Limb, LimbKind, TemplateLimbs};

/// A place for a joint of the template, in unit space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Marker {
    pub(super) joint: usize,
    pub(super) place: Vec3,
    /// True if it lies apart from the volume of the mesh.
    pub(super) outside: bool,
    /// True if the mesh shows the joint elsewhere for sure.
    pub(super) against: bool,
    /// True if a person gave the place for the partner on the other side of a symmetric figure.
    pub(super) mirrored: bool,
}

impl Marker {
    /// True if the marker moves its limb and tells nothing about the rest of the body.
    pub(super) fn is_alone(&self) -> bool {
        self.outside || self.against
    }
}

/// Joints of a front leg up to which it has no shoulder blade.
const WITHOUT_BLADE: usize = 5;
/// Share of a move along the trunk in which other joints follow: nothing in the mesh shows where on its line a joint of the trunk is,
/// so each rig has it elsewhere, and others are not wrong by as much.
const AXIAL: f32 = 0.3;
/// Steps in which the room of a joint that follows is measured.
const STEPS: usize = 16;
/// Distance to the surface, as a factor of the move, up to which a joint that follows has all the room it needs.
const ROOM: f32 = 2.0;
/// Distance between two markers on a wing, as a share of the template's size, below which both tell as much of the joints about them.
const NEAR: f32 = 0.01;

/// Markers with those that they mean for the other side of a figure that is symmetric about a plane: a partner that a person
/// has not placed goes where the image of the marker is.
pub(super) fn with_partners(
    template: &TemplateLimbs,
    markers: &[Marker],
    (point, normal): (Vec3, Vec3),
) -> Vec<Marker> {
    let is_placed = |joint: usize| markers.iter().any(|marker| marker.joint == joint);
    let partner = |marker: &Marker| {
        let joint = template.mirror[marker.joint].filter(|&joint| !is_placed(joint) && !marker.is_alone())?;
        let place = marker.place - normal * (2.0 * (marker.place - point).dot(normal));
        Some(Marker { joint, place, mirrored: true, ..*marker })
    };
    markers.iter().copied().chain(markers.iter().filter_map(partner)).collect()
}

/// The joint in which a limb turns, and the one after it. The flesh of the trunk hides the first, and a bend shows the second:
/// one that is wrong says nothing about the other.
fn socket(template: &TemplateLimbs, limb: &Limb) -> Option<(usize, usize)> {
    let is_front = limb.kind == LimbKind::Leg && template.trunk.first() != Some(&limb.attach);
    let has_blade = is_front && limb.joints.len() > WITHOUT_BLADE;
    let ball = match limb.kind {
        LimbKind::Wing => 0,
        _ => template.ball_joint(limb)? + usize::from(has_blade),
    };
    Some((*limb.joints.get(ball)?, *limb.joints.get(ball + 1)?))
}

/// The knee that the trunk hides and the hock below it, which bends where it can be seen: a knee that is wrong says nothing about it.
fn hidden_hinge(template: &TemplateLimbs, limb: &Limb) -> Option<(usize, usize)> {
    let joints = (*limb.joints.get(1)?, *limb.joints.get(2)?);
    template.has_hidden_knee(limb).then_some(joints)
}

/// Hip and knee that the trunk hides: both are placed by where the leg leaves it, so one that lies too low or too far back tells
/// it of the other. How far a knee sticks out tells nothing about the hip.
fn hidden_thigh(template: &TemplateLimbs, limb: &Limb) -> Option<[usize; 2]> {
    let joints = [*limb.joints.first()?, *limb.joints.get(1)?];
    template.has_hidden_knee(limb).then_some(joints)
}

/// The part of a move of a joint of a trunk that lies across its legs that leads along it; zero for all other joints. A trunk that
/// stands hangs between shoulders and hips, and is too short or too long as a whole.
fn axial_part(template: &TemplateLimbs, places: &[Vec3], joint: usize, way: Vec3) -> Vec3 {
    let (Some(&first), Some(&last)) = (template.trunk.first(), template.trunk.last()) else { return Vec3::ZERO };
    let along = (places[last] - places[first]).normalize_or_zero();
    if template.trunk.contains(&joint) && !template.is_upright() { along * way.dot(along) } else { Vec3::ZERO }
}

/// The part of a move from a place inside of the volume that goes at most half way to the surface.
fn within(place: Vec3, way: Vec3, is_solid: &dyn Fn(Vec3) -> bool) -> Vec3 {
    if !is_solid(place) {
        return way;
    }
    let step = way * (ROOM / STEPS as f32);
    let room = (1..=STEPS).take_while(|number| is_solid(place + step * *number as f32)).count();
    way * (room as f32 / STEPS as f32)
}

/// Moves wings along `forward` as a whole, as markers on them ask: the bones of a wing lie at one depth behind its leading edge, so
/// one that lies too far forward tells it of all others. Between two markers each joint takes more of the nearer one's.
pub(super) fn shift_wings(
    template: &TemplateLimbs,
    places: &mut [Vec3],
    markers: &[Marker],
    forward: Vec3,
    is_solid: &dyn Fn(Vec3) -> bool,
) {
    let limb_of = limbs_of_joints(template);
    let starts = places.to_vec();
    for (number, _) in template.limbs.iter().enumerate().filter(|(_, limb)| limb.kind == LimbKind::Wing) {
        let own = markers.iter().filter(|marker| limb_of[marker.joint] == Some(number) && !marker.is_alone());
        let own: Vec<(Vec3, f32)> = own
            .map(|marker| (template.positions[marker.joint], (marker.place - starts[marker.joint]).dot(forward)))
            .collect();
        for joint in (0..places.len()).filter(|&joint| limb_of[joint] == Some(number)) {
            let (mut sum, mut weight) = (0.0, 0.0);
            for (place, way) in &own {
                let near = 1.0 / (template.positions[joint].distance(*place) + NEAR * template.size);
                sum += way * near;
                weight += near;
            }
            if weight > 0.0 {
                places[joint] += within(starts[joint], forward * (sum / weight), is_solid);
            }
        }
    }
}

/// The limb that each joint belongs to, with all that hangs on it; `None` for the trunk.
fn limbs_of_joints(template: &TemplateLimbs) -> Vec<Option<usize>> {
    let mut limb_of = vec![None; template.positions.len()];
    for &joint in &template.order {
        let own = template.limbs.iter().position(|limb| limb.joints.contains(&joint));
        limb_of[joint] = match (own, template.parents[joint]) {
            (Some(limb), _) => Some(limb),
            (None, Some(parent)) if !template.trunk.contains(&joint) => limb_of[parent],
            _ => None,
        };
    }
    limb_of
}

/// Moves joints so that each marker's joint is at its place; the rest of its limb follows inside of the volume, less with the
/// distance along the skeleton, and joints between two markers share what both ask. A shoulder or hip does not follow the
/// bend of its limb, nor the bend the shoulder or hip. Joints of other limbs follow only without `limb_alone`, and never a
/// marker that contradicts the mesh.
pub(super) fn warp(
    template: &TemplateLimbs,
    places: &mut [Vec3],
    markers: &[Marker],
    limb_alone: bool,
    is_solid: &dyn Fn(Vec3) -> bool,
) {
    if markers.is_empty() {
        return;
    }
    let moves: Vec<Vec3> = markers.iter().map(|m| m.place - places[m.joint]).collect();
    let starts = places.to_vec();
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
    // The trunk is one, too.
    let limb_of = limbs_of_joints(template);
    let of_limb = |limb: &Limb| socket(template, limb).into_iter().chain(hidden_hinge(template, limb));
    let sockets: Vec<(usize, usize)> = template.limbs.iter().flat_map(of_limb).collect();
    let is_apart = |a: usize, b: usize| sockets.contains(&(a, b)) || sockets.contains(&(b, a));
    let mut sums = vec![(Vec3::ZERO, 0.0f32); places.len()];
    let mut is_carried = vec![false; places.len()];
    for (marker, &way) in markers.iter().zip(&moves) {
        let reach = 0.6 * limb_length(marker.joint);
        let limb_alone = limb_alone || marker.is_alone();
        let axial = if marker.is_alone() { Vec3::ZERO } else { axial_part(template, &starts, marker.joint, way) };
        // Distances along the skeleton from the marker.
        let mut distance = vec![f32::INFINITY; places.len()];
        distance[marker.joint] = 0.0;
        // What hangs on a joint that is moved far goes with it.
        let mut is_below = vec![false; places.len()];
        for &joint in template.order.iter().filter(|_| marker.is_alone()) {
            let above = template.parents[joint];
            is_below[joint] = joint == marker.joint || above.is_some_and(|above| is_below[above]);
            is_carried[joint] |= is_below[joint];
        }
        for [hip, knee] in template.limbs.iter().filter_map(|limb| hidden_thigh(template, limb)) {
            let other = match marker.joint {
                joint if joint == hip => knee,
                joint if joint == knee => hip,
                _ => continue,
            };
            let image = template.mirror[other].map_or(Vec3::ZERO, |image| starts[other] - starts[image]);
            let left = image.normalize_or_zero();
            sums[other].0 += way - left * way.dot(left);
            sums[other].1 += 1.0;
        }
        let mut open = vec![marker.joint];
        while let Some(joint) = open.pop() {
            let neighbours = children[joint].iter().copied().chain(template.parents[joint]);
            for next in neighbours.filter(|&n| !limb_alone || limb_of[n] == limb_of[marker.joint]) {
                let bone = template.positions[joint].distance(template.positions[next]);
                let there = distance[joint] + if is_below[next] { 0.0 } else { bone };
                let is_held = is_apart(joint, next) && !is_below[next];
                if there < distance[next] && there < reach && !is_held {
                    distance[next] = there;
                    open.push(next);
                }
            }
        }
        for (sum, &distance) in sums.iter_mut().zip(&distance) {
            if distance < reach {
                let near = 1.0 - distance / reach;
                sum.0 += (way - axial * (1.0 - AXIAL)) * near * near;
                sum.1 += near;
            }
        }
    }
    for ((place, (sum, near)), is_carried) in places.iter_mut().zip(&sums).zip(&is_carried) {
        if *near > 0.0 {
            let way = *sum / *near;
            let way = if *is_carried { way } else { within(*place, way, is_solid) };
            *place += way;
        }
    }
    for marker in markers {
        places[marker.joint] = marker.place;
    }
}
