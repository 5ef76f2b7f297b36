//! Gestures that are operations on the selected joints.

use bevy::prelude::*;

use super::Gesture;
use crate::{
    algo::view::ViewPlane,
    plugins::{document::SelectionOperation, surface::RigSurface},
    rig::proportion::{ProportionError, Quantity},
};

/// The operation of a gesture on the selected joints; `None` for all other gestures.
pub(super) fn on_selection(gesture: &Gesture, plane: &ViewPlane) -> Option<SelectionOperation> {
    Some(match gesture {
        Gesture::Move(at) => SelectionOperation::MoveAlong(*plane, (*at).into()),
        Gesture::MoveTo(to) => SelectionOperation::MoveTo(<[f32; 3]>::from(*to).into()),
        Gesture::Rotate(degrees) => SelectionOperation::Rotate(turn(plane.towards(), *degrees)),
        Gesture::Scale(factor) => SelectionOperation::Scale(*factor),
        Gesture::Insert(at) => SelectionOperation::Insert(*plane, (*at).into()),
        Gesture::Delete => SelectionOperation::Delete { keep_children: true },
        Gesture::DeleteHierarchy => SelectionOperation::Delete { keep_children: false },
        Gesture::Parent => SelectionOperation::Parent,
        Gesture::Unparent => SelectionOperation::Unparent,
        Gesture::Orient(along) => SelectionOperation::Orient(*along),
        Gesture::MirrorSelected => SelectionOperation::Mirror,
        _ => return None,
    })
}

/// Refuses a gesture that would put joints out of all proportion to the model, where the rig has one.
pub(super) fn check_proportion(gesture: &Gesture, surface: Option<&RigSurface>) -> Result<(), ProportionError> {
    let distances = |numbers: &[f32]| match extent(surface) {
        Some(size) => numbers.iter().try_for_each(|number| Quantity::Distance { size }.check(*number)),
        None => Ok(()),
    };
    match gesture {
        Gesture::Move((x, y)) | Gesture::Insert((x, y)) => distances(&[*x, *y]),
        Gesture::MoveTo((x, y, z)) => distances(&[*x, *y, *z]),
        Gesture::Scale(factor) => Quantity::Factor.check(*factor),
        _ => Ok(()),
    }
}

/// Largest coordinate of the model; `None` without one.
fn extent(surface: Option<&RigSurface>) -> Option<f32> {
    let (low, high) = surface?.ready()?.bounds()?;
    Some(low.abs().max(high.abs()).max_element()).filter(|extent| extent.is_normal())
}

/// True for a gesture that is an operation on the selected joints.
pub(super) fn is_on_selection(gesture: &Gesture) -> bool {
    use Gesture::{
        Delete, DeleteHierarchy, Insert, MirrorSelected, Move, MoveTo, Orient, Parent, Rotate, Scale, Unparent,
    };
    matches!(
        gesture,
        Move(_)
            | MoveTo(_)
            | Rotate(_)
            | Scale(_)
            | Insert(_)
            | Orient(_)
            | Delete
            | DeleteHierarchy
            | MirrorSelected
            | Parent
            | Unparent
    )
}

fn turn(axis: Vec3, degrees: f32) -> Quat {
    let half = 0.5 * degrees.to_radians();
    let [x, y, z] = (axis * bevy::math::ops::sin(half)).to_array();
    Quat::from_xyzw(x, y, z, bevy::math::ops::cos(half)).normalize()
}
