//! Picking: which joints the user means.
//!
//! A click means the joint nearest to where its ray first meets the *posed* mesh (Pencil Rigger, section 3.1), so small
//! joints are easy to hit. Clicking the same spot again cycles through the next nearest; where the ray misses the mesh,
//! distances are measured on the view plane.

use bevy::{math::Affine3A, prelude::*};

use super::{
    RigSystems, configure_sets,
    document::{JointEntities, Selection},
    surface::RigSurface,
};
use crate::{
    algo::{picking, view::ViewPlane},
    rig::{Rig, Uid},
};

/// Adds joint picking.
pub struct PickingPlugin;

impl Plugin for PickingPlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.add_message::<PickRequest>().add_message::<Picked>().add_systems(Update, pick.in_set(RigSystems::Pick));
    }
}

/// Asks to change what is selected.
#[derive(Message, Debug, Clone)]
pub struct PickRequest {
    /// The rig.
    pub rig: Entity,
    /// What to pick.
    pub what: Pick,
    /// True to add to the selection (a joint that is selected already becomes the active one); false to replace it.
    pub add: bool,
}

/// What a [`PickRequest`] picks. View planes are in the rig's space.
#[derive(Debug, Clone)]
pub enum Pick {
    /// The joint that a click at a point of the view plane means.
    Click {
        /// The view.
        plane: ViewPlane,
        /// The point.
        point: Vec2,
        /// How far apart, in model units, clicks still count as the same spot.
        reach: f32,
    },
    /// All joints in a box between two opposite corners.
    Box {
        /// The view.
        plane: ViewPlane,
        /// The corners.
        corners: [Vec2; 2],
    },
    /// These joints.
    Joints(Vec<Uid>),
    /// All joints.
    All,
    /// No joint.
    None,
}

/// What was picked.
#[derive(Message, Debug, Clone)]
pub struct Picked {
    /// The rig.
    pub rig: Entity,
    /// The joints that the request meant; empty if it met none.
    pub joints: Vec<Uid>,
}

/// Positions of a rig's joints as posed, in the rig's space, in the order of [`Rig::walk`].
pub fn posed_joints(
    rig: &Rig,
    entities: &JointEntities,
    place: &GlobalTransform,
    joints: &Query<&GlobalTransform>,
) -> Vec<(Uid, Vec3)> {
    let to_rig: Affine3A = place.affine().inverse();
    let rest = rig.rest_globals().into_iter();
    rest.map(|(uid, rest)| {
        let posed = entities.get(uid).and_then(|entity| joints.get(entity).ok());
        (uid, posed.map_or(rest.translation, |posed| to_rig.transform_point3(posed.translation())))
    })
    .collect()
}

fn pick(
    mut requests: MessageReader<PickRequest>,
    mut rigs: Query<(&Rig, &mut Selection, &JointEntities, &GlobalTransform, Option<&RigSurface>)>,
    joints: Query<&GlobalTransform>,
    mut cycle: Local<picking::PickCycle>,
    mut picked: MessageWriter<Picked>,
) {
    for request in requests.read() {
        let Ok((rig, mut selection, entities, place, surface)) = rigs.get_mut(request.rig) else { continue };
        let found: Vec<Uid> = match &request.what {
            Pick::None => Vec::new(),
            Pick::All => rig.walk().map(|joint| joint.data.uid).collect(),
            Pick::Joints(joints) => joints.iter().copied().filter(|joint| rig.joint(*joint).is_some()).collect(),
            Pick::Click { plane, point, reach } => {
                let posed = posed_joints(rig, entities, place, &joints);
                let positions: Vec<Vec3> = posed.iter().map(|(_, position)| *position).collect();
                let ray = plane.ray(*point);
                let hit = surface.and_then(|surface| surface.hits(&ray).first().map(|hit| ray.at(hit.distance)));
                let candidates = picking::candidates_at(hit, plane, *point, &positions, *reach);
                cycle.click(*point, *reach, &candidates).map(|number| posed[number].0).into_iter().collect()
            }
            Pick::Box { plane, corners } => {
                let posed = posed_joints(rig, entities, place, &joints);
                let positions: Vec<Vec3> = posed.iter().map(|(_, position)| *position).collect();
                picking::in_box(plane, *corners, &positions).into_iter().map(|number| posed[number].0).collect()
            }
        };
        if !matches!(request.what, Pick::Click { .. }) {
            cycle.reset();
        }
        let mut next = if request.add { selection.0.clone() } else { Vec::new() };
        next.retain(|joint| !found.contains(joint));
        next.extend(&found);
        selection.set_if_neq(Selection(next));
        picked.write(Picked { rig: request.rig, joints: found });
    }
}
