//! A template's rig in another body: joints at new places, axes along the bones, lengths in commands to scale.

use std::collections::{BTreeMap, HashMap};

use glam::{Affine3A, Quat, Vec3};

use super::{Modules, Resize};
use crate::rig::{EditError, Rig, RigEdit, TagData, TagKind, Uid};

/// Sine of the bend of a chain from which on its plane is known.
const BENT: f32 = 0.06;
/// Largest turn about a bone that brings its axes into the plane of the bend, in radians.
const MOST_TWIST: f32 = 1.2;

/// Places of a rig's joints in a body.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Fitting {
    /// Position of each joint in the rig's space. Joints that are left out keep their place beside their parents.
    pub places: BTreeMap<Uid, Vec3>,
    /// Rotation from the axes of the template (Y up, facing +Z) to those of the body.
    pub turn: Quat,
    /// Lowest point of the body along its up direction, in the rig's space.
    pub floor: f32,
}

/// The rig with its joints at the places of a fitting. Each joint's axes turn with the bone that leads on from it, and about it
/// with the plane in which its chain bends; tags, groups, labels and references stay, and lengths in the parameters of
/// commands (sizes of shapes, distances of nulls) follow the size of the body.
///
/// # Errors
/// A place that is not finite.
pub fn fitted_rig(rig: &Rig, fitting: &Fitting, modules: &Modules) -> Result<Rig, EditError> {
    let before: HashMap<Uid, Affine3A> =
        rig.rest_globals().into_iter().map(|(uid, global)| (uid, Affine3A::from(global))).collect();
    let at = |uid: Uid| before.get(&uid).map_or(Vec3::ZERO, |global| global.translation.into());
    let factor = factor(rig, fitting, &at);
    let mut places: HashMap<Uid, Vec3> = HashMap::new();
    let mut fitted = rig.clone();
    let mut globals: HashMap<Uid, Affine3A> = HashMap::new();
    // Places first, since the axes of a joint follow its children.
    for joint in rig.walk() {
        let uid = joint.data.uid;
        let beside = match joint.parent {
            Some(parent) => places[&parent] + fitting.turn * (at(uid) - at(parent)) * factor,
            None => fitting.turn * at(uid) * factor,
        };
        places.insert(uid, fitting.places.get(&uid).copied().unwrap_or(beside));
    }
    for joint in rig.walk() {
        let uid = joint.data.uid;
        let rotation =
            turn(rig, uid, fitting, &at, &places, joint.parent.and_then(|parent| globals.get(&parent)), &before)
                * before[&uid].to_scale_rotation_translation().1;
        globals.insert(uid, Affine3A::from_rotation_translation(rotation.normalize(), places[&uid]));
    }
    let joints: Vec<(Uid, Option<Uid>)> = rig.walk().map(|joint| (joint.data.uid, joint.parent)).collect();
    for (uid, parent) in joints {
        let rest = fitted.local_rest(parent, &globals[&uid].into());
        fitted.apply(&RigEdit::SetRest(uid, rest))?;
    }
    for (joint, tag) in resized_tags(rig, fitting, factor, &at, &places, modules) {
        fitted.apply(&RigEdit::SetTag(joint, Box::new(tag)))?;
    }
    Ok(fitted)
}

/// Size of the body as a factor of the template's: by the lengths of all bones between fitted joints.
fn factor(rig: &Rig, fitting: &Fitting, at: &impl Fn(Uid) -> Vec3) -> f32 {
    let (mut was, mut is) = (0.0, 0.0);
    for joint in rig.walk() {
        let ends = joint.parent.and_then(|parent| Some((parent, fitting.places.get(&parent)?)));
        let (Some((parent, from)), Some(to)) = (ends, fitting.places.get(&joint.data.uid)) else { continue };
        was += at(parent).distance(at(joint.data.uid));
        is += from.distance(*to);
    }
    if was > 0.0 && is > 0.0 { is / was } else { 1.0 }
}

/// Rotation of a joint from the template to the body, in the rig's space.
fn turn(
    rig: &Rig,
    uid: Uid,
    fitting: &Fitting,
    at: &impl Fn(Uid) -> Vec3,
    places: &HashMap<Uid, Vec3>,
    parent: Option<&Affine3A>,
    before: &HashMap<Uid, Affine3A>,
) -> Quat {
    let Some(joint) = rig.joint(uid) else { return fitting.turn };
    // The bone that leads on is the one along the joint's own Y axis.
    let along: Vec3 = before[&uid].matrix3.y_axis.into();
    let toward = |child: &Uid| (at(*child) - at(uid)).normalize_or_zero().dot(along.normalize_or_zero());
    let leading = joint.children.iter().max_by(|a, b| toward(a).total_cmp(&toward(b)));
    let Some(leading) = leading else {
        // Last joints turn with the joint before.
        let above = joint.parent.and_then(|parent| before.get(&parent)).zip(parent);
        return above.map_or(fitting.turn, |(was, is)| {
            let rotation = |global: &Affine3A| global.to_scale_rotation_translation().1;
            rotation(is) * rotation(was).inverse()
        });
    };
    let was = fitting.turn * (at(*leading) - at(uid));
    let is = places[leading] - places[&uid];
    let (Some(was), Some(is)) = (was.try_normalize(), is.try_normalize()) else { return fitting.turn };
    let arc = Quat::from_rotation_arc(was, is) * fitting.turn;
    let Some(above) = joint.parent else { return arc };
    // A chain that bends in both bodies bends about the same axis of its joint.
    let plane = |from: Vec3, middle: Vec3, to: Vec3| {
        let normal = (middle - from).normalize_or_zero().cross((to - middle).normalize_or_zero());
        (normal.length() > BENT).then(|| normal.normalize())
    };
    let template = plane(at(above), at(uid), at(*leading)).map(|normal| arc * normal);
    let body = plane(places[&above], places[&uid], places[leading]);
    let (Some(template), Some(body)) = (template, body) else { return arc };
    let across = |normal: Vec3| (normal - is * normal.dot(is)).try_normalize();
    let (Some(template), Some(body)) = (across(template), across(body)) else { return arc };
    let angle = bevy::math::ops::atan2(template.cross(body).dot(is), template.dot(body));
    if angle.abs() <= MOST_TWIST { Quat::from_axis_angle(is, angle) * arc } else { arc }
}

/// Tags with other lengths than before.
fn resized_tags(
    rig: &Rig,
    fitting: &Fitting,
    factor: f32,
    at: &impl Fn(Uid) -> Vec3,
    places: &HashMap<Uid, Vec3>,
    modules: &Modules,
) -> Vec<(Uid, TagData)> {
    let up = fitting.turn * Vec3::Y;
    let mut changed = Vec::new();
    for joint in rig.walk() {
        let uid = joint.data.uid;
        let height = at(uid).y;
        let above = places[&uid].dot(up) - fitting.floor;
        let is_standing = joint.parent.is_none() && height > 0.0 && above > 0.0;
        let floor_factor = if is_standing { above / height } else { factor };
        let change = Resize { factor, floor_factor, turn: fitting.turn };
        for tag in &joint.data.tags {
            let TagKind::Command { module, params, .. } = &tag.kind else { continue };
            let Some(Ok(text)) = modules.get(module).map(|info| info.resized(params, &change)) else { continue };
            if text != *params {
                let mut tag = tag.clone();
                if let TagKind::Command { params, .. } = &mut tag.kind {
                    *params = text;
                }
                changed.push((uid, tag));
            }
        }
    }
    changed
}
