//! Level: how an animal on all fours stands, from its plane of symmetry and the ends of its legs, and how the trunk of a bird
//! lies, from its tail and its neck.
//!
//! The alignment of a template's joints with centre lines tips to and fro with the proportions of legs, neck and tail. What
//! stands on four feet shows its directions: left across the plane of symmetry, and the ground through the ends of its legs.

use glam::{Mat3, Quat, Vec3};

use super::{
    assign::{Directions, Hypothesis},
    limbs::{LimbKind, TemplateLimbs},
    tree::Tree,
};

/// Cosine of the angle between the left direction of an alignment and the normal of the plane of symmetry above which they
/// are one.
const SAME_LEFT: f32 = 0.9;
/// Cosine of the angle from the alignment above which the ends of legs tell the ground.
const STANDS: f32 = 0.8;
/// Distance between front and hind feet, as a share of the template's in the alignment's scale, above which they tell the
/// ground.
const APART: f32 = 0.4;
/// Height of the ends of forelegs over those of hind legs from which on an animal stands on its hind legs, and the most of what
/// hind legs may end over the lowest end, as shares of the height of the template's hips in the alignment's scale.
const RAISED: f32 = 0.3;
const ON_GROUND: f32 = 0.15;

/// Turns a hypothesis to how an animal stands, and tells how a bird's trunk lies and where its middle is.
pub(super) fn stand(template: &TemplateLimbs, tree: &Tree, hypothesis: &mut Hypothesis, directions: &Directions) {
    hypothesis.trunk = along_trunk(template, tree, hypothesis, directions);
    let left = hypothesis.alignment.rotation * Vec3::X;
    hypothesis.middle = directions.mirror.filter(|(_, normal)| left.dot(*normal).abs() > SAME_LEFT);
    if let Some(turn) = level(template, tree, hypothesis, directions) {
        hypothesis.alignment = hypothesis.alignment.turned(turn, &hypothesis.pairs);
    }
}

/// The turn of an animal on all fours; `None` for other templates, and where its legs are raised.
pub(super) fn level(
    template: &TemplateLimbs,
    tree: &Tree,
    hypothesis: &Hypothesis,
    directions: &Directions,
) -> Option<Quat> {
    if !template.is_on_fours() {
        return None;
    }
    let turn = hypothesis.alignment.rotation;
    let (rest, way) = way_of_feet(template, tree, hypothesis)?;
    if way.length() < APART * hypothesis.alignment.scale * rest.length() {
        return None;
    }
    // A ground that a person tells is level, and so is that of an animal on its hind legs.
    let up = directions.up.or_else(|| up_on_hind_legs(template, tree, hypothesis, way, directions));
    let way = up.map_or(way, |up| way - up * way.dot(up));
    turned_by(turn, rest, way, directions)
}

/// The axis of the file along which an animal stands on its hind legs: its forelegs, such as the arms of a dinosaur, end high above
/// the hind feet by the way from these to those, and nothing lies below the hind feet. `None` for one that stands on all legs.
fn up_on_hind_legs(
    template: &TemplateLimbs,
    tree: &Tree,
    hypothesis: &Hypothesis,
    way: Vec3,
    directions: &Directions,
) -> Option<Vec3> {
    let scale = hypothesis.alignment.scale;
    let up = hypothesis.alignment.rotation * Vec3::Y;
    let axis = directions.file_axes.into_iter().flat_map(|axis| [axis, -axis]).find(|axis| axis.dot(up) > STANDS)?;
    let height = |leaf: usize| tree.lines[leaf].at(0.0).dot(axis);
    let lowest = tree.branches.leaves.iter().map(|&leaf| height(leaf)).fold(f32::INFINITY, f32::min);
    let legs = template.limbs.iter().zip(&hypothesis.leaves).filter(|(limb, _)| template.is_hind_leg(limb));
    let hind = legs.filter_map(|(_, leaf)| Some(height((*leaf)?))).fold(f32::NEG_INFINITY, f32::max);
    let tall = scale * template.positions[*template.trunk.first()?].y;
    (way.dot(axis) > RAISED * tall && hind - lowest < ON_GROUND * tall).then_some(axis)
}

/// The turn of a bird, whose trunk lies between its tail and its neck as the template's does: wings and legs, which are posed,
/// tip the alignment of all joints. `None` for other templates, without a tail or a neck, and where the two are far apart.
fn along_trunk(
    template: &TemplateLimbs,
    tree: &Tree,
    hypothesis: &Hypothesis,
    directions: &Directions,
) -> Option<Quat> {
    if !template.has_hidden_knees() {
        return None;
    }
    let end = |kind: LimbKind| {
        let at = template.limbs.iter().position(|limb| limb.kind == kind)?;
        let line = tree.lines[(*hypothesis.leaves.get(at)?)?].among(&tree.branches, &hypothesis.leaves);
        Some((template.positions[*template.limbs[at].joints.first()?], line.at(line.free)))
    };
    let (tail, neck) = (end(LimbKind::Tail)?, end(LimbKind::Head)?);
    turned_by(hypothesis.alignment.rotation, neck.0 - tail.0, neck.1 - tail.1, directions)
}

/// The turn that keeps left, across the plane of symmetry, and takes a way of the template to one of the mesh.
fn turned_by(turn: Quat, rest: Vec3, way: Vec3, directions: &Directions) -> Option<Quat> {
    let left = turn * Vec3::X;
    let left = match directions.mirror {
        Some((_, normal)) if left.dot(normal).abs() > SAME_LEFT => normal * left.dot(normal).signum(),
        _ => left,
    };
    let without = |way: Vec3, axis: Vec3| way - axis * way.dot(axis);
    let left = directions.up.map_or(left, |up| without(left, up)).try_normalize()?;
    let along = without(way, left).try_normalize()?;
    let rest = without(rest, Vec3::X).try_normalize()?;
    let to = Mat3::from_cols(left, along, left.cross(along));
    let from = Mat3::from_cols(Vec3::X, rest, Vec3::X.cross(rest));
    let level = Quat::from_mat3(&(to * from.transpose())).normalize();
    ((level * Vec3::Y).dot(turn * Vec3::Y) > STANDS).then_some(level)
}

/// The way from the hind feet to the front feet, in the template and in the mesh.
fn way_of_feet(template: &TemplateLimbs, tree: &Tree, hypothesis: &Hypothesis) -> Option<(Vec3, Vec3)> {
    let feet: Vec<(Vec3, Vec3)> = template
        .limbs
        .iter()
        .zip(&hypothesis.leaves)
        .filter(|(limb, _)| limb.kind == LimbKind::Leg)
        .filter_map(|(limb, leaf)| Some((template.tip(limb), tree.lines[(*leaf)?].at(0.0))))
        .collect();
    let middle = feet.iter().map(|foot| foot.0.z).sum::<f32>() / feet.len().max(1) as f32;
    let mean = |is_front: bool| {
        let own = feet.iter().filter(|foot| (foot.0.z > middle) == is_front);
        let (rest, place, count) =
            own.fold((Vec3::ZERO, Vec3::ZERO, 0.0), |sum, foot| (sum.0 + foot.0, sum.1 + foot.1, sum.2 + 1.0));
        // One foot alone of a pair steps aside.
        (count > 1.0).then(|| (rest / count, place / count))
    };
    let (front, hind) = (mean(true)?, mean(false)?);
    Some((front.0 - hind.0, front.1 - hind.1))
}
