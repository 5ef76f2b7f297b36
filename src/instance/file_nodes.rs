//! Nodes of a file that Bevy loaded below an instance, and whose joints the rig's joints have taken the places of.
//!
//! The file's own clips go on moving the nodes. A joint of the rig follows the node that it replaced wherever no command of the rig
//! drives it, so the clips still move the mesh; [`JointsHeld`] tells the others. The inverse bind poses of the skin are fitted to the
//! rest of the template, where this is not that of the file: at rest the mesh stands as it stood in the file.

use std::{collections::BTreeMap, sync::Arc};

use bevy::{
    animation::AnimationTargetId,
    asset::AssetId,
    math::Affine3A,
    mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes},
    prelude::*,
};

use super::{BoundTo, BuiltTemplate, ExposedNodes, RigInstance, RunningTemplate};
use crate::{
    plugins::{
        runtime::{ControlPose, InstanceMode, RigRuntime, is_near},
        schema::NodeOf,
    },
    rig::{NodeType, PoseOffset, RestTransform, Uid},
    solve::program::{ExposedNode, RigState},
};

/// Largest difference between two places that count as the same: of axes, and of a share of the skeleton's size.
const SAME: f32 = 1e-4;

/// A clip of a file that Bevy loaded moves joints of an instance that follow the rig's own commands, so it does not move the mesh
/// there; or nodes above the joints that the rig does not have. Each is told once.
#[derive(EntityEvent, Debug, Clone, PartialEq, Eq)]
pub struct JointsHeld {
    /// The instance.
    pub entity: Entity,
    /// Names of the file's nodes.
    pub joints: Vec<String>,
}

/// Node of a file before anything has moved it.
#[derive(Component, Debug, Clone, Copy)]
pub(super) struct FileRest {
    pub local: Transform,
    /// Place in the instance's space.
    pub place: Affine3A,
}

/// Rests of some nodes of a file below an instance, and of all nodes above them.
pub(super) fn file_rests(
    joints: &[Entity],
    instance: Entity,
    parents: &Query<&ChildOf>,
    nodes: &Query<(&Transform, Option<&FileRest>), Without<NodeOf>>,
) -> BTreeMap<Entity, FileRest> {
    let mut rests: BTreeMap<Entity, FileRest> = BTreeMap::new();
    for joint in joints {
        let up = std::iter::once(*joint).chain(parents.iter_ancestors(*joint));
        let chain: Vec<Entity> = up.take_while(|node| *node != instance && !rests.contains_key(node)).collect();
        for node in chain.into_iter().rev() {
            let Ok((transform, known)) = nodes.get(node) else { continue };
            let above = parents.get(node).ok().and_then(|of| rests.get(&of.parent()));
            let above = above.map_or(Affine3A::IDENTITY, |above| above.place);
            let fresh = FileRest { local: *transform, place: above * transform.compute_affine() };
            rests.insert(node, known.copied().unwrap_or(fresh));
        }
    }
    rests
}

/// Takes note of the rests of files whose template is not built yet, before a clip moves them.
pub(super) fn note_rests(
    skins: Query<(Entity, &SkinnedMesh), (Added<SkinnedMesh>, Without<BoundTo>)>,
    parents: Query<&ChildOf>,
    instances: Query<(), With<RigInstance>>,
    nodes: Query<(&Transform, Option<&FileRest>), Without<NodeOf>>,
    mut commands: Commands,
) {
    for (mesh, skin) in &skins {
        let Some(instance) = parents.iter_ancestors(mesh).find(|above| instances.contains(*above)) else { continue };
        for (node, rest) in file_rests(&skin.joints, instance, &parents, &nodes) {
            commands.entity(node).try_insert_if_new(rest);
        }
    }
}

/// Skin of a file, as it was before the rig's joints took the places of its own.
#[derive(Component)]
pub(super) struct LoadedSkin {
    pub bindposes: Handle<SkinnedMeshInverseBindposes>,
    pub joints: Vec<Entity>,
    /// Joints, and the nodes above them, at rest.
    pub rests: BTreeMap<Entity, FileRest>,
    /// Parents of those, up to the instance.
    pub parents: BTreeMap<Entity, Entity>,
    /// Nodes of the rig that have taken their places.
    pub nodes: BTreeMap<Entity, Uid>,
}

/// Node of a file that a joint of an instance follows.
#[derive(Component, Debug, Clone, Copy)]
pub(super) struct FollowedNode {
    instance: Entity,
    /// The joint; `None` for a node above the joints that the rig does not have.
    node: Option<Uid>,
    /// Transform before anything has moved it.
    rest: Transform,
    /// Inverse of the transform that is the joint's rest.
    back: Affine3A,
    /// The joint's axes at rest in those of the node.
    turn: Affine3A,
    has_moved: bool,
    /// True if the joint has to be written although the node did not move.
    is_pending: bool,
    is_told: bool,
}

/// Fit of a skin to the rest of a rig.
struct SkinFit {
    /// Inverse bind poses; `None` if those of the file fit.
    bindposes: Option<Vec<Mat4>>,
    followed: Vec<(Entity, FollowedNode)>,
}

impl LoadedSkin {
    /// Place of a node when the rig is at rest: that of the rig's node, or below one.
    fn rig_place(&self, node: Entity, rig: &BTreeMap<Uid, Affine3A>) -> Affine3A {
        let (mut at, mut place, mut below) = (Some(node), None, Vec::new());
        while let Some(node) = at {
            place = self.nodes.get(&node).and_then(|uid| rig.get(uid)).copied();
            if place.is_some() {
                break;
            }
            below.push(self.rests.get(&node).map_or(Affine3A::IDENTITY, |rest| rest.local.compute_affine()));
            at = self.parents.get(&node).copied();
        }
        below.into_iter().rev().fold(place.unwrap_or(Affine3A::IDENTITY), |above, local| above * local)
    }

    fn file_place(&self, node: Entity) -> Affine3A {
        self.rests.get(&node).map_or(Affine3A::IDENTITY, |rest| rest.place)
    }

    /// Places of the joints in the pose in which the file bound the mesh; its topmost joint stands as at rest.
    fn bound_places(&self, bindposes: &[Mat4]) -> Option<Vec<Affine3A>> {
        let is_top = |joint: &Entity| {
            let mut above = self.parents.get(joint);
            while let Some(node) = above {
                if self.joints.contains(node) {
                    return false;
                }
                above = self.parents.get(node);
            }
            true
        };
        let top = self.joints.iter().position(is_top)?;
        let whole = self.file_place(self.joints[top]) * Affine3A::from_mat4(bindposes[top]);
        let places: Vec<Affine3A> =
            bindposes.iter().map(|matrix| whole * Affine3A::from_mat4(*matrix).inverse()).collect();
        places.iter().all(Affine3A::is_finite).then_some(places)
    }

    /// Fits the skin to a rig at rest. The rest of a template is either that of the file's nodes or the pose in which the file
    /// bound the mesh; the nearer of the two is what it is measured against.
    fn fit(&self, instance: Entity, rig: &BTreeMap<Uid, Affine3A>, bindposes: Option<&[Mat4]>) -> SkinFit {
        let bindposes = bindposes.filter(|matrices| matrices.len() == self.joints.len());
        let wanted: Vec<Affine3A> = self.joints.iter().map(|joint| self.rig_place(*joint, rig)).collect();
        let at_rest: Vec<Affine3A> = self.joints.iter().map(|joint| self.file_place(*joint)).collect();
        let size = at_rest.iter().map(|place| place.translation.length()).fold(f32::MIN_POSITIVE, f32::max);
        let away = |places: &[Affine3A]| {
            let (mut sum, mut most) = (0.0, 0.0_f32);
            for (place, wanted) in places.iter().zip(&wanted) {
                let difference = difference(place, wanted, size);
                sum += difference;
                most = most.max(difference);
            }
            (sum, most)
        };
        let (rest_sum, rest_most) = away(&at_rest);
        let bound = bindposes.and_then(|matrices| self.bound_places(matrices));
        let nearer = bound.map(|places| (away(&places), places)).filter(|((sum, _), _)| *sum < rest_sum);
        let is_bound = nearer.is_some();
        let (most, places) = nearer.map_or((rest_most, at_rest), |((_, most), places)| (most, places));
        let is_same = most <= SAME;
        let fitted = bindposes.filter(|_| !is_same).map(|matrices| {
            let each = matrices.iter().zip(&places).zip(&wanted).map(|((matrix, place), wanted)| {
                let fitted = Mat4::from(wanted.inverse() * *place) * *matrix;
                if fitted.is_finite() { fitted } else { *matrix }
            });
            each.collect()
        });
        let place_of = |node: Entity| {
            let joint = self.joints.iter().position(|joint| *joint == node);
            joint.map_or_else(|| self.file_place(node), |joint| places[joint])
        };
        let mut followed = Vec::new();
        for (node, FileRest { local, .. }) in &self.rests {
            let uid = self.nodes.get(node).copied();
            if uid.is_none() && self.joints.contains(node) {
                // It moves the mesh itself.
                continue;
            }
            let above = self.parents.get(node).map_or(Affine3A::IDENTITY, |above| place_of(*above));
            let rest = if is_bound { above.inverse() * place_of(*node) } else { local.compute_affine() };
            let turn =
                if is_same { Affine3A::IDENTITY } else { place_of(*node).inverse() * self.rig_place(*node, rig) };
            let next = FollowedNode {
                instance,
                node: uid,
                rest: *local,
                back: rest.inverse(),
                turn,
                has_moved: false,
                is_pending: true,
                is_told: false,
            };
            followed.push((*node, next));
        }
        SkinFit { bindposes: fitted, followed }
    }
}

/// Difference between two places: of their axes, and of their origins as a share of a size.
fn difference(a: &Affine3A, b: &Affine3A, size: f32) -> f32 {
    let axes = |of: &Affine3A| [of.matrix3.x_axis, of.matrix3.y_axis, of.matrix3.z_axis];
    let turned: f32 = axes(a).iter().zip(axes(b)).map(|(a, b)| (*a - b).length()).sum();
    turned + (a.translation - b.translation).length() / size
}

/// Places of a template's nodes at rest.
pub(super) struct RigRest {
    template: Arc<BuiltTemplate>,
    places: BTreeMap<Uid, Affine3A>,
}

impl RigRest {
    fn of(template: &Arc<BuiltTemplate>) -> Self {
        let mut state = RigState::new(template.whole.clone());
        state.evaluate(0.0);
        let nodes = template.whole.nodes().iter().enumerate();
        let places = nodes.map(|(slot, node)| (node.uid, state.global_at(slot).affine())).collect();
        Self { template: template.clone(), places }
    }
}

/// True if a skin was loaded, or a template may have another rest.
pub(super) fn fit_is_due(
    skins: Query<(), Added<LoadedSkin>>,
    instances: Query<(), Changed<RunningTemplate>>,
    loaded: Query<(), With<LoadedSkin>>,
) -> bool {
    !skins.is_empty() || !instances.is_empty() && !loaded.is_empty()
}

type BindposesId = AssetId<SkinnedMeshInverseBindposes>;

/// Fits loaded skins to the rest of their templates.
pub(super) fn fit_skins(
    mut skins: Query<(Ref<LoadedSkin>, &BoundTo, &mut SkinnedMesh)>,
    instances: Query<(Ref<RunningTemplate>, Option<&ExposedNodes>)>,
    mut nodes: Query<&mut FollowedNode>,
    mut bindposes: Option<ResMut<Assets<SkinnedMeshInverseBindposes>>>,
    mut adapted: Local<Vec<(BindposesId, BindposesId)>>,
    mut rest: Local<Option<RigRest>>,
    mut commands: Commands,
) {
    for (loaded, BoundTo(instance), mut skin) in &mut skins {
        let Ok((template, exposed)) = instances.get(*instance) else { continue };
        if !(loaded.is_added() || template.is_changed()) {
            continue;
        }
        let known = rest.take().filter(|known| Arc::ptr_eq(&known.template, template.get()));
        let rig = rest.insert(known.unwrap_or_else(|| RigRest::of(template.get())));
        let matrices = bindposes.as_ref().and_then(|assets| assets.get(&loaded.bindposes)).map(|found| found.to_vec());
        let SkinFit { bindposes: fitted, followed } = loaded.fit(*instance, &rig.places, matrices.as_deref());
        match (fitted, &mut bindposes) {
            (Some(fitted), Some(assets)) => {
                skin.inverse_bindposes = shared(&mut adapted, assets, loaded.bindposes.id(), fitted);
            }
            _ if skin.inverse_bindposes != loaded.bindposes => skin.inverse_bindposes = loaded.bindposes.clone(),
            _ => {}
        }
        for (node, next) in followed {
            match nodes.get_mut(node) {
                Ok(mut known) => (known.back, known.turn, known.is_pending) = (next.back, next.turn, true),
                Err(_) => {
                    commands.entity(node).try_insert(next);
                }
            }
        }
        // A node that the template does not have any more would be told as a fault.
        let is_there = |node: &ExposedNode| !matches!(node, ExposedNode::Uid(uid) if !rig.places.contains_key(uid));
        if let Some(ExposedNodes(exposed)) = exposed
            && !exposed.iter().all(is_there)
        {
            let left = exposed.iter().filter(|node| is_there(node)).cloned().collect();
            commands.entity(*instance).try_insert(ExposedNodes(left));
        }
    }
}

/// Handle of inverse bind poses that were fitted from others; equal ones are shared.
fn shared(
    adapted: &mut Vec<(BindposesId, BindposesId)>,
    assets: &mut Assets<SkinnedMeshInverseBindposes>,
    from: BindposesId,
    matrices: Vec<Mat4>,
) -> Handle<SkinnedMeshInverseBindposes> {
    adapted.retain(|(_, made)| assets.contains(*made));
    let is_same = |made: BindposesId| assets.get(made).is_some_and(|known| **known == *matrices);
    let known = adapted.iter().find(|(of, made)| *of == from && is_same(*made)).map(|(_, made)| *made);
    if let Some(handle) = known.and_then(|made| assets.get_strong_handle(made)) {
        return handle;
    }
    let handle = assets.add(SkinnedMeshInverseBindposes::from(matrices));
    adapted.push((from, handle.id()));
    handle
}

/// Lets the joints of instances follow the nodes of files that they have taken the places of.
pub(super) fn follow_nodes(
    mut files: Query<(Ref<Transform>, &mut FollowedNode, Option<&Name>, Has<AnimationTargetId>), Without<NodeOf>>,
    rigs: Query<(&RigRuntime, Option<&ExposedNodes>)>,
    mut joints: Query<(Option<&mut ControlPose>, Option<&mut Transform>), With<NodeOf>>,
    mut commands: Commands,
) {
    let mut held: BTreeMap<Entity, Vec<String>> = BTreeMap::new();
    let mut unexposed: BTreeMap<Entity, Vec<ExposedNode>> = BTreeMap::new();
    for (transform, mut followed, name, is_animated) in &mut files {
        let followed = followed.bypass_change_detection();
        if !(transform.is_changed() || followed.is_pending) {
            continue;
        }
        followed.is_pending = false;
        followed.has_moved |= !is_near(&transform, &followed.rest);
        let Ok((runtime, _)) = rigs.get(followed.instance) else { continue };
        if !followed.has_moved {
            continue;
        }
        let program = runtime.state().program();
        let slot = followed.node.and_then(|node| program.node(node));
        let is_free = |slot: &usize| {
            let node = &program.nodes()[*slot];
            node.kind == NodeType::Joint && !node.is_driven
        };
        let Some(slot) = slot.filter(is_free) else {
            if !followed.is_told && (followed.node.is_some() || is_animated) {
                followed.is_told = true;
                let name = name.map_or_else(|| "a node without a name".to_owned(), Name::to_string);
                held.entry(followed.instance).or_default().push(name);
            }
            continue;
        };
        let node = &program.nodes()[slot];
        let moved = followed.turn.inverse() * followed.back * transform.compute_affine() * followed.turn;
        let (scale, rotation, translation) = (node.base.affine() * moved).to_scale_rotation_translation();
        let rest = RestTransform::from(node.base);
        let offset = PoseOffset::between(&rest, &Transform { translation, rotation, scale });
        let Some(joint) = runtime.entity(slot) else { continue };
        let Ok((pose, local)) = joints.get_mut(joint) else { continue };
        match (runtime.mode(), pose, local) {
            (InstanceMode::Hierarchy, _, Some(mut local)) => {
                local.set_if_neq(offset.on(&rest));
            }
            (InstanceMode::Direct, Some(mut pose), _) if node.is_posable() => {
                pose.set_if_neq(offset.into());
            }
            (InstanceMode::Direct, ..) if !node.is_posable() => {
                followed.is_pending = true;
                unexposed.entry(followed.instance).or_default().push(ExposedNode::Uid(node.uid));
            }
            _ => {}
        }
    }
    for (instance, nodes) in unexposed {
        let exposed = rigs.get(instance).ok().and_then(|(_, exposed)| exposed);
        let mut list = exposed.map_or_else(|| vec![ExposedNode::Controls], |exposed| exposed.0.clone());
        let before = list.len();
        for node in nodes {
            if !list.contains(&node) {
                list.push(node);
            }
        }
        if list.len() > before {
            commands.entity(instance).try_insert(ExposedNodes(list));
        }
    }
    for (entity, joints) in held {
        warn!("a clip of a loaded file does not move {}: the rig's own commands do", joints.join(", "));
        commands.trigger(JointsHeld { entity, joints });
    }
}
