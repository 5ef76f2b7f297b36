//! Picking: which joints the user means.
//!
//! A click means the joint nearest to where its ray first meets the *posed* mesh (Pencil Rigger, section 3.1), so small
//! joints are easy to hit. Clicking the same spot again cycles through the next nearest; where the ray misses the mesh,
//! distances are measured on the view plane.
//!
//! Clicks wait while the surface is behind the pose; hovering does not.

use bevy::{
    ecs::entity::{EntityHashMap, EntityHashSet},
    math::Affine3A,
    prelude::*,
};

use super::{
    RigSystems, configure_sets,
    document::{Hovered, JointEntities, JointOf, Selection},
    surface::{Answer, RigMeshes, RigSurface, answer},
};
use crate::{
    algo::{
        picking::{self, PickCycle},
        view::ViewPlane,
    },
    rig::{Rig, Uid},
};

/// Adds joint picking.
pub struct PickingPlugin;

impl Plugin for PickingPlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.init_resource::<LastClick>()
            .add_message::<PickRequest>()
            .add_message::<HoverRequest>()
            .add_message::<HoverJoint>()
            .add_message::<Picked>()
            .add_systems(Update, (forget_click, pick, hover).chain().in_set(RigSystems::Pick));
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

/// Tells where the pointer is over a view of a rig. [`Hovered`] then follows what a click there would pick, also when the
/// rig, its pose or the selection change under a pointer that rests, until the next request.
///
/// While the mesh's surface is being built nothing changes; while it is behind the pose, so is the answer.
#[derive(Message, Debug, Clone, Copy)]
pub struct HoverRequest {
    /// The rig.
    pub rig: Entity,
    /// View, point of the view plane and reach, as in [`Pick::Click`]; `None` when the pointer has left.
    pub what: Option<(ViewPlane, Vec2, f32)>,
}

/// Names the joint that the pointer is at where no view is: in a list, for example. [`Hovered`] follows while the pointer
/// is over no view of that rig.
#[derive(Message, Debug, Clone, Copy)]
pub struct HoverJoint {
    /// The rig.
    pub rig: Entity,
    /// The joint; `None` when the pointer has left it.
    pub joint: Option<Uid>,
}

/// Where the pointer rests.
struct HoverSpot {
    plane: ViewPlane,
    point: Vec2,
    reach: f32,
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

/// The last click, which the next one at the same spot goes on from.
#[derive(Resource, Default)]
struct LastClick {
    at: Option<(Entity, ViewPlane)>,
    cycle: PickCycle,
}

impl LastClick {
    /// Forgets it if `plane` is another view, or a view of another rig.
    fn look(&mut self, rig: Entity, plane: &ViewPlane, reach: f32) {
        if !self.is_seen(rig, plane, reach) {
            self.cycle.reset();
        }
        self.at = Some((rig, *plane));
    }

    fn is_seen(&self, rig: Entity, plane: &ViewPlane, reach: f32) -> bool {
        self.at.is_some_and(|(last_rig, last)| {
            let near = |a: Vec3, b: Vec3| a.distance(b) <= 1e-3;
            last_rig == rig
                && near(last.right, plane.right)
                && near(last.up, plane.up)
                && last.origin.distance(plane.origin) <= reach.max(0.0)
        })
    }
}

/// What a pick looks at.
type Seen<'a> = (&'a Rig, &'a JointEntities, &'a GlobalTransform, Option<&'a RigSurface>, Option<&'a RigMeshes>);

/// An edit may change which joints lie under the last click.
fn forget_click(changed: Query<Entity, Changed<Rig>>, mut last: ResMut<LastClick>) {
    if last.at.is_some_and(|(rig, _)| changed.contains(rig)) {
        *last = LastClick::default();
    }
}

fn pick(
    mut requests: MessageReader<PickRequest>,
    mut waiting: Local<Vec<(PickRequest, Option<u64>)>>,
    rigs: Query<Seen>,
    mut selections: Query<&mut Selection>,
    joints: Query<&GlobalTransform>,
    mut last: ResMut<LastClick>,
    mut picked: MessageWriter<Picked>,
) {
    waiting.extend(requests.read().map(|request| (request.clone(), None)));
    // Requests are answered in their order: what comes after a click that waits, waits too.
    let mut busy: Vec<Entity> = Vec::new();
    waiting.retain_mut(|(request, since)| {
        let (Ok(seen), Ok(mut selection)) = (rigs.get(request.rig), selections.get_mut(request.rig)) else {
            return false;
        };
        let (rig, entities, place, surface, meshes) = seen;
        if busy.contains(&request.rig) {
            return true;
        }
        let found: Vec<Uid> = match &request.what {
            Pick::None => Vec::new(),
            Pick::All => rig.walk().map(|joint| joint.data.uid).collect(),
            Pick::Joints(joints) => joints.iter().copied().filter(|joint| rig.joint(*joint).is_some()).collect(),
            Pick::Click { plane, point, reach } => {
                let Answer::Now(surface) = answer(since, meshes.is_some(), surface) else {
                    busy.push(request.rig);
                    return true;
                };
                let posed = posed_joints(rig, entities, place, &joints);
                let candidates = candidates(&posed, surface, plane, *point, *reach);
                last.look(request.rig, plane, *reach);
                last.cycle.click(*point, *reach, &candidates).map(|number| posed[number].0).into_iter().collect()
            }
            Pick::Box { plane, corners } => {
                let posed = posed_joints(rig, entities, place, &joints);
                let positions: Vec<Vec3> = posed.iter().map(|(_, position)| *position).collect();
                picking::in_box(plane, *corners, &positions).into_iter().map(|number| posed[number].0).collect()
            }
        };
        if !matches!(request.what, Pick::Click { .. }) {
            *last = LastClick::default();
        }
        let mut next = if request.add { selection.0.clone() } else { Vec::new() };
        next.retain(|joint| !found.contains(joint));
        next.extend(&found);
        selection.set_if_neq(Selection(next));
        picked.write(Picked { rig: request.rig, joints: found });
        false
    });
}

/// The joints that a click may mean, as indices into `posed`.
fn candidates(
    posed: &[(Uid, Vec3)],
    surface: Option<&RigSurface>,
    plane: &ViewPlane,
    point: Vec2,
    reach: f32,
) -> Vec<usize> {
    let positions: Vec<Vec3> = posed.iter().map(|(_, position)| *position).collect();
    let ray = plane.ray(point);
    let hit = surface.and_then(RigSurface::ready).and_then(|surface| surface.closest(&ray));
    picking::candidates_at(hit.map(|hit| ray.at(hit.distance)), plane, point, &positions, reach)
}

/// Keeps [`Hovered`] at what a click under the pointer would pick. Looks again only when something changed.
fn hover(
    mut requests: MessageReader<HoverRequest>,
    mut named: MessageReader<HoverJoint>,
    mut spots: Local<EntityHashMap<HoverSpot>>,
    rigs: Query<Seen>,
    changed: Query<(), Or<(Changed<Rig>, Changed<RigSurface>, Changed<GlobalTransform>)>>,
    moved: Query<&JointOf, Changed<GlobalTransform>>,
    joints: Query<&GlobalTransform>,
    last: Res<LastClick>,
    mut hovered: Query<&mut Hovered>,
) {
    let mut due: Vec<Entity> = Vec::new();
    for HoverRequest { rig, what } in requests.read() {
        match what {
            Some((plane, point, reach)) => {
                spots.insert(*rig, HoverSpot { plane: *plane, point: *point, reach: *reach });
            }
            None => {
                spots.remove(rig);
            }
        }
        due.push(*rig);
    }
    spots.retain(|rig, _| rigs.contains(*rig));
    if !spots.is_empty() {
        let moved: EntityHashSet = moved.iter().map(|of| of.0).collect();
        due.extend(spots.keys().filter(|rig| last.is_changed() || moved.contains(*rig) || changed.contains(**rig)));
    }
    due.sort_unstable();
    due.dedup();
    for rig in due {
        let (Ok(seen), Ok(mut hovered)) = (rigs.get(rig), hovered.get_mut(rig)) else { continue };
        let joint = match spots.get(&rig) {
            None => None,
            Some(spot) => match under(spot, rig, seen, &joints, &last) {
                Some(joint) => joint,
                None => continue,
            },
        };
        hovered.set_if_neq(Hovered(joint));
    }
    for HoverJoint { rig, joint } in named.read() {
        if let (false, Ok(mut hovered)) = (spots.contains_key(rig), hovered.get_mut(*rig)) {
            hovered.set_if_neq(Hovered(*joint));
        }
    }
}

/// What a click would pick; the outer `None` as long as the surface is being built.
fn under(
    spot: &HoverSpot,
    entity: Entity,
    (rig, entities, place, surface, meshes): Seen,
    joints: &Query<&GlobalTransform>,
    last: &LastClick,
) -> Option<Option<Uid>> {
    if meshes.is_some() && surface.and_then(RigSurface::ready).is_none() {
        return None;
    }
    let HoverSpot { plane, point, reach } = spot;
    let posed = posed_joints(rig, entities, place, joints);
    let candidates = candidates(&posed, surface, plane, *point, *reach);
    let number = match last.is_seen(entity, plane, *reach) {
        true => last.cycle.peek(*point, *reach, &candidates),
        false => candidates.first().copied(),
    };
    Some(number.map(|number| posed[number].0))
}
