//! Picking: selecting joints with clicks and boxes.
//!
//! A click picks the joint nearest to the first hit of its ray on the *posed* mesh (Pencil Rigger, section 3.1), so
//! small joints are easy to hit. Clicking the same spot again cycles through the next nearest; if the ray misses the
//! mesh, distances are measured on the view plane.
//!
//! Clicks wait while the surface is behind the pose; hovering does not.

use std::collections::HashSet;

use bevy::{
    ecs::{
        entity::{EntityHashMap, EntityHashSet},
        message::MessageId,
    },
    math::Affine3A,
    prelude::*,
};

use super::{
    RigSystems, configure_sets,
    controls::{
        ControlsInUse,
        outline::{ControlNodes, control_at},
    },
    document::{HoveredNode, JointEntities, NodeOf, Selection, entities::BuiltEntities},
    schema::RigNodes,
    surface::{Answer, RigMeshes, RigSurface, answer},
};
use crate::{
    algo::{
        picking::{self, PickCycle, PickTree},
        view::ViewPlane,
    },
    rig::{Rig, Uid},
};

/// Plugin of joint picking.
pub struct PickingPlugin;

impl Plugin for PickingPlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.init_resource::<LastClick>()
            .init_resource::<ControlsInUse>()
            .add_message::<PickRequest>()
            .add_message::<HoverRequest>()
            .add_message::<HoverJoint>()
            .add_message::<PickAnswer>()
            .add_systems(Update, (forget_click, pick, hover).chain().in_set(RigSystems::Pick));
    }
}

/// Request to change the selection.
#[derive(Message, Debug, Clone)]
pub struct PickRequest {
    /// The rig.
    pub rig: Entity,
    /// Joints to pick.
    pub what: Pick,
    /// Adds to the selection if `true` (a selected joint becomes the active one), replaces it if `false`.
    pub add: bool,
}

/// Joints that a [`PickRequest`] picks. View planes are in the rig's space.
#[derive(Debug, Clone)]
pub enum Pick {
    /// The joint picked by a click at a point of the view plane.
    Click {
        /// The view.
        plane: ViewPlane,
        /// The point.
        point: Vec2,
        /// Largest distance, in model units, of clicks at the same spot.
        reach: f32,
    },
    /// Joints in a box between two opposite corners.
    Box {
        /// The view.
        plane: ViewPlane,
        /// The corners.
        corners: [Vec2; 2],
    },
    /// The listed joints.
    Joints(Vec<Uid>),
    /// Every joint of the rig.
    All,
    /// Empty selection.
    None,
}

/// Position of the pointer over a view of a rig. [`HoveredNode`] then follows the joint that a click there would pick, also
/// when the rig, its pose or the selection change under a resting pointer, until the next request.
///
/// While the mesh's surface is being built nothing changes; while it is behind the pose, so is [`HoveredNode`].
#[derive(Message, Debug, Clone, Copy)]
pub struct HoverRequest {
    /// The rig.
    pub rig: Entity,
    /// View, point of the view plane and reach, as in [`Pick::Click`]; `None` when the pointer has left.
    pub what: Option<(ViewPlane, Vec2, f32)>,
}

/// The joint under the pointer outside of any view: in a list, for example. [`HoveredNode`] follows it while the pointer is
/// over no view of that rig.
#[derive(Message, Debug, Clone, Copy)]
pub struct HoverJoint {
    /// The rig.
    pub rig: Entity,
    /// The joint; `None` when the pointer has left it.
    pub joint: Option<Uid>,
}

/// Position of a resting pointer.
struct HoverSpot {
    plane: ViewPlane,
    point: Vec2,
    reach: f32,
}

/// Result of a [`PickRequest`].
#[derive(Message, Debug, Clone)]
pub struct PickAnswer {
    /// The rig.
    pub rig: Entity,
    /// Request that is answered.
    pub request: MessageId<PickRequest>,
    /// The picked joints; empty if the request hit none.
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
    let posed = |uid: Uid| {
        let posed = joints.get(entities.get(uid)?).ok()?;
        Some(to_rig.transform_point3(posed.translation()))
    };
    let all = rig.walk().map(|joint| Some((joint.data.uid, posed(joint.data.uid)?)));
    all.collect::<Option<Vec<_>>>().unwrap_or_else(|| {
        // Entities of joints that were added in this frame come later.
        let rest = rig.rest_globals().into_iter();
        rest.map(|(uid, rest)| (uid, posed(uid).unwrap_or(rest.translation))).collect()
    })
}

/// The last click, which the next one at the same spot continues.
#[derive(Resource, Default)]
struct LastClick {
    at: Option<(Entity, ViewPlane)>,
    cycle: PickCycle,
}

impl LastClick {
    /// Forgets the last click if `plane` is another view, or a view of another rig.
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

/// Components of a rig that a pick reads.
type PickItem<'a> = (
    &'a Rig,
    &'a JointEntities,
    &'a GlobalTransform,
    Option<&'a RigSurface>,
    Option<&'a RigMeshes>,
    Option<&'a RigNodes>,
    Option<&'a BuiltEntities>,
);

/// Forgets the last click after an edit, which may change the joints under it.
fn forget_click(changed: Query<Entity, Changed<Rig>>, mut last: ResMut<LastClick>) {
    if last.at.is_some_and(|(rig, _)| changed.contains(rig)) {
        *last = LastClick::default();
    }
}

/// Request with its identity, and the number of the state of the surface that it waits for.
type WaitingPick = (PickRequest, MessageId<PickRequest>, Option<u64>);

fn pick(
    mut requests: MessageReader<PickRequest>,
    mut waiting: Local<Vec<WaitingPick>>,
    rigs: Query<PickItem>,
    mut selections: Query<&mut Selection>,
    joints: Query<&GlobalTransform>,
    controls: ControlNodes,
    in_use: Res<ControlsInUse>,
    mut last: ResMut<LastClick>,
    mut picked: MessageWriter<PickAnswer>,
) {
    waiting.extend(requests.read_with_id().map(|(request, id)| (request.clone(), id, None)));
    // Requests are answered in their order: a request after a waiting click waits, too.
    let mut busy: Vec<Entity> = Vec::new();
    // Joints stand still while requests of one frame are answered.
    let mut trees: EntityHashMap<(PickTree, Vec<Uid>)> = EntityHashMap::default();
    let mut selected: EntityHashMap<HashSet<Uid>> = EntityHashMap::default();
    let mut open = std::mem::take(&mut *waiting).into_iter().peekable();
    while let Some((request, id, mut since)) = open.next() {
        let (Ok(seen), Ok(mut selection)) = (rigs.get(request.rig), selections.get_mut(request.rig)) else {
            continue;
        };
        let (rig, entities, place, surface, meshes, nodes, created) = seen;
        if busy.contains(&request.rig) {
            waiting.push((request, id, since));
            continue;
        }
        let found: Vec<Uid> = match &request.what {
            Pick::None => Vec::new(),
            Pick::All => rig.walk().map(|joint| joint.data.uid).collect(),
            Pick::Joints(joints) => {
                let is_created = |node: Uid| created.is_some_and(|created| created.get(node).is_some());
                joints.iter().copied().filter(|node| rig.joint(*node).is_some() || is_created(*node)).collect()
            }
            Pick::Click { plane, point, reach }
                if let Some(control) = met(&controls, &in_use, place, nodes, plane, *point, *reach) =>
            {
                vec![control]
            }
            Pick::Click { plane, point, reach } => {
                let Answer::Now(surface) = answer(&mut since, meshes.is_some(), surface) else {
                    busy.push(request.rig);
                    waiting.push((request, id, since));
                    continue;
                };
                let hit = first_hit(surface, plane, *point);
                let (tree, uids) =
                    trees.entry(request.rig).or_insert_with(|| posed_tree(rig, entities, place, &joints));
                last.look(request.rig, plane, *reach);
                let next = open.peek().map(|(next, ..)| next);
                // Clicks on controls leave the cycle as it is.
                let is_single = !in_use.0
                    && !last.cycle.is_at(*point, *reach)
                    && next.is_some_and(|next| next.rig == request.rig && is_apart(&next.what, *point));
                let number = if is_single {
                    last.cycle.reset();
                    tree.nearest_at(hit, plane, *point)
                } else {
                    last.cycle.click(*point, *reach, &tree.candidates_at(hit, plane, *point, *reach))
                };
                number.map(|number| uids[number]).into_iter().collect()
            }
            Pick::Box { plane, corners } => {
                let (tree, uids) =
                    trees.entry(request.rig).or_insert_with(|| posed_tree(rig, entities, place, &joints));
                tree.in_box(plane, *corners).into_iter().map(|number| uids[number]).collect()
            }
        };
        if !matches!(request.what, Pick::Click { .. }) {
            *last = LastClick::default();
        }
        if request.add {
            let selected = selected.entry(request.rig).or_insert_with(|| selection.0.iter().copied().collect());
            add_to(&mut selection, selected, &found);
        } else {
            selected.remove(&request.rig);
            selection.set_if_neq(Selection(found.clone()));
        }
        picked.write(PickAnswer { rig: request.rig, request: id, joints: found });
    }
}

/// Joints of a rig as posed, for picks.
fn posed_tree(
    rig: &Rig,
    entities: &JointEntities,
    place: &GlobalTransform,
    joints: &Query<&GlobalTransform>,
) -> (PickTree, Vec<Uid>) {
    let (uids, positions) = posed_joints(rig, entities, place, joints).into_iter().unzip();
    (PickTree::new(positions), uids)
}

/// True if a request is no click near a point of the same view plane, which would go on with the cycle of a click there.
fn is_apart(what: &Pick, point: Vec2) -> bool {
    match what {
        Pick::Click { point: other, reach, .. } => point.distance(*other) > *reach,
        _ => true,
    }
}

/// Adds joints at the end of a selection, of which `selected` has all joints.
fn add_to(selection: &mut Mut<Selection>, selected: &mut HashSet<Uid>, found: &[Uid]) {
    if found.iter().any(|joint| selected.contains(joint)) {
        let mut next = selection.0.clone();
        match found {
            [only] => next.retain(|joint| joint != only),
            _ => {
                let found: HashSet<Uid> = found.iter().copied().collect();
                next.retain(|joint| !found.contains(joint));
            }
        }
        next.extend(found);
        selection.set_if_neq(Selection(next));
    } else if !found.is_empty() {
        selection.0.extend(found);
    }
    selected.extend(found);
}

/// The control whose outline a click meets.
fn met(
    controls: &ControlNodes,
    in_use: &ControlsInUse,
    place: &GlobalTransform,
    nodes: Option<&RigNodes>,
    plane: &ViewPlane,
    point: Vec2,
    reach: f32,
) -> Option<Uid> {
    let visible = in_use.0.then(|| controls.visible(nodes, place.affine().inverse()))?;
    control_at(&visible, plane, point, reach)
}

/// The joints that a click may pick, as indices into `posed`.
fn candidates(
    posed: &[(Uid, Vec3)],
    surface: Option<&RigSurface>,
    plane: &ViewPlane,
    point: Vec2,
    reach: f32,
) -> Vec<usize> {
    let positions: Vec<Vec3> = posed.iter().map(|(_, position)| *position).collect();
    picking::candidates_at(first_hit(surface, plane, point), plane, point, &positions, reach)
}

/// Place where the ray of a click first meets the mesh.
fn first_hit(surface: Option<&RigSurface>, plane: &ViewPlane, point: Vec2) -> Option<Vec3> {
    let ray = plane.ray(point);
    let hit = surface.and_then(RigSurface::ready)?.closest(&ray)?;
    Some(ray.at(hit.distance))
}

/// Updates [`HoveredNode`] to the joint that a click under the pointer would pick. Queries again only after a change.
fn hover(
    mut requests: MessageReader<HoverRequest>,
    mut named: MessageReader<HoverJoint>,
    mut spots: Local<EntityHashMap<HoverSpot>>,
    rigs: Query<PickItem>,
    changed: Query<(), Or<(Changed<Rig>, Changed<RigSurface>, Changed<GlobalTransform>)>>,
    moved: Query<&NodeOf, Changed<GlobalTransform>>,
    joints: Query<&GlobalTransform>,
    controls: ControlNodes,
    in_use: Res<ControlsInUse>,
    last: Res<LastClick>,
    mut hovered: Query<&mut HoveredNode>,
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
            Some(spot)
                if let Some(control) = met(&controls, &in_use, seen.2, seen.5, &spot.plane, spot.point, spot.reach) =>
            {
                Some(control)
            }
            Some(spot) => match under(spot, rig, seen, &joints, &last) {
                Some(joint) => joint,
                None => continue,
            },
        };
        hovered.set_if_neq(HoveredNode(joint));
    }
    for HoverJoint { rig, joint } in named.read() {
        if let (false, Ok(mut hovered)) = (spots.contains_key(rig), hovered.get_mut(*rig)) {
            hovered.set_if_neq(HoveredNode(*joint));
        }
    }
}

/// The joint that a click would pick; the outer `None` while the surface is being built.
fn under(
    spot: &HoverSpot,
    entity: Entity,
    (rig, entities, place, surface, meshes, ..): PickItem,
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
