//! Components that only a build writes: what other code writes to them is reverted in the same frame, and told.

use std::collections::BTreeSet;

use bevy::{
    ecs::{entity_disabling::Disabled, query::Allow, query::QueryData, system::SystemParam},
    prelude::*,
};

use super::constraints::targets;
use crate::{
    plugins::{
        document::{
            EditRefusal, EntityWriteError, JointEntities, TagEntities,
            entities::{BuiltEntities, EntityIndex, EntityPart, IndexedEntity},
        },
        runtime::RigRuntime,
        schema::{
            Constrains, ConstraintKind, ConstraintTargets, Control, CreatedBy, CreatedRole, Joint, NodeLayer, NodeOf,
            NodeSlot, Null, ParkedNode,
        },
    },
    rig::{BuiltNode, NodeType, RestTransform, Rig, Uid},
};

/// Components that a build gives to nodes and constraints.
#[derive(QueryData)]
pub(super) struct GuardedComponents {
    of: Option<&'static NodeOf>,
    by: Option<&'static CreatedBy>,
    role: Option<&'static CreatedRole>,
    layer: Option<&'static NodeLayer>,
    control: Option<&'static Control>,
    is_null: Has<Null>,
    is_joint: Has<Joint>,
    is_parked: Has<ParkedNode>,
    kind: Option<&'static ConstraintKind>,
    targets: Option<&'static ConstraintTargets>,
    constrains: Option<&'static Constrains>,
}

type GuardedWrites = (
    Or<(
        Changed<NodeOf>,
        Changed<CreatedBy>,
        Changed<CreatedRole>,
        Changed<NodeLayer>,
        Changed<Control>,
        Added<Null>,
        Added<Joint>,
        Added<ParkedNode>,
        Changed<ConstraintKind>,
        Changed<ConstraintTargets>,
        Changed<Constrains>,
    )>,
    // Instances of games have no document.
    Without<NodeSlot>,
    Allow<Disabled>,
);

/// Entities that lost such a component.
#[derive(SystemParam)]
pub(super) struct GuardedRemovals<'w, 's> {
    of: RemovedComponents<'w, 's, NodeOf>,
    by: RemovedComponents<'w, 's, CreatedBy>,
    role: RemovedComponents<'w, 's, CreatedRole>,
    layer: RemovedComponents<'w, 's, NodeLayer>,
    control: RemovedComponents<'w, 's, Control>,
    null: RemovedComponents<'w, 's, Null>,
    joint: RemovedComponents<'w, 's, Joint>,
    parked: RemovedComponents<'w, 's, ParkedNode>,
    kind: RemovedComponents<'w, 's, ConstraintKind>,
    targets: RemovedComponents<'w, 's, ConstraintTargets>,
    constrains: RemovedComponents<'w, 's, Constrains>,
}

impl GuardedRemovals<'_, '_> {
    fn entities(&mut self) -> BTreeSet<Entity> {
        let nodes = self.of.read().chain(self.by.read()).chain(self.role.read()).chain(self.layer.read());
        let kinds = self.control.read().chain(self.null.read()).chain(self.joint.read()).chain(self.parked.read());
        let constraints = self.kind.read().chain(self.targets.read()).chain(self.constrains.read());
        nodes.chain(kinds).chain(constraints).collect()
    }
}

type GuardedRig<'a> = (&'a JointEntities, &'a TagEntities, &'a BuiltEntities);

/// Reverts what other code wrote to components of a build. It runs behind the systems that follow the build, whose own
/// writes are as they expect them. A relation whose target went away is restored silently.
pub(super) fn keep_built(
    mut commands: Commands,
    written: Query<Entity, GuardedWrites>,
    mut removed: GuardedRemovals,
    views: Query<GuardedComponents, Allow<Disabled>>,
    rigs: Query<GuardedRig>,
    index: Res<EntityIndex>,
    mut refused: MessageWriter<EditRefusal>,
) {
    let mut entities = removed.entities();
    entities.extend(written.iter());
    for entity in entities {
        let (Some(IndexedEntity { rig, uid, part }), Ok(view)) = (index.get(entity), views.get(entity)) else {
            continue;
        };
        let Ok((joints, tags, built)) = rigs.get(rig) else { continue };
        let mut guard = Guard { commands: &mut commands, entity, name: None };
        match part {
            EntityPart::Joint => guard.joint(rig, uid, built, &view),
            EntityPart::Node => guard.node(rig, uid, tags, built, &view),
            EntityPart::Constraint => guard.constraint(uid, (joints, tags, built), &view),
            EntityPart::Tag | EntityPart::Group => {}
        }
        if let Some(name) = guard.name {
            let reason = EntityWriteError::BuiltContent { name };
            warn!("{reason}");
            refused.write(EditRefusal { rig, reason: reason.into() });
        }
    }
}

/// Gives a `Transform` back to nodes from which other code took it, so that they stand where they last stood.
pub(super) fn keep_places(
    mut commands: Commands,
    mut removed: RemovedComponents<Transform>,
    bare: Query<(Option<&RestTransform>, Option<&Name>), (Without<Transform>, Allow<Disabled>)>,
    rigs: Query<(&Rig, Option<&RigRuntime>)>,
    index: Res<EntityIndex>,
    mut refused: MessageWriter<EditRefusal>,
) {
    for entity in removed.read() {
        let Some(IndexedEntity { rig, uid, part: EntityPart::Joint | EntityPart::Node }) = index.get(entity) else {
            continue;
        };
        let (Ok((rest, name)), Ok((document, runtime))) = (bare.get(entity), rigs.get(rig)) else { continue };
        let posed = || {
            let offset = document.offset(uid).copied().unwrap_or_default();
            offset.on(&rest.copied().unwrap_or_default())
        };
        let place = runtime.and_then(|runtime| runtime.shown_at(uid)).unwrap_or_else(posed);
        commands.entity(entity).try_insert(place);
        let reason = EntityWriteError::BuiltContent { name: name.map_or_else(|| uid.to_string(), Name::to_string) };
        warn!("{reason}");
        refused.write(EditRefusal { rig, reason: reason.into() });
    }
}

/// Restoration of one entity.
struct Guard<'a, 'w, 's> {
    commands: &'a mut Commands<'w, 's>,
    entity: Entity,
    /// Name of the thing that other code wrote to.
    name: Option<String>,
}

impl Guard<'_, '_, '_> {
    /// Puts a component back where it differs; returns whether it did.
    fn hold<C: Component + Clone + PartialEq>(&mut self, found: Option<&C>, wanted: Option<C>) -> bool {
        if found == wanted.as_ref() {
            return false;
        }
        match wanted {
            Some(wanted) => self.commands.entity(self.entity).try_insert(wanted),
            None => self.commands.entity(self.entity).try_remove::<C>(),
        };
        true
    }

    /// Puts a marker back where it differs; returns whether it did.
    fn mark<C: Component + Default>(&mut self, is_found: bool, is_wanted: bool) -> bool {
        match (is_found, is_wanted) {
            (false, true) => self.commands.entity(self.entity).try_insert(C::default()),
            (true, false) => self.commands.entity(self.entity).try_remove::<C>(),
            _ => return false,
        };
        true
    }

    /// A relation: silent where Bevy took it away together with its target.
    fn relate<C: Component + Clone + PartialEq>(&mut self, found: Option<&C>, wanted: Option<C>) -> bool {
        self.hold(found, wanted) && found.is_some()
    }

    fn joint(&mut self, rig: Entity, uid: Uid, built: &BuiltEntities, view: &GuardedComponentsItem) {
        let node = built.joints.get(&uid).filter(|(of, _)| *of == self.entity).map(|(_, node)| node);
        let layer = node.and_then(|node| node.layer.as_deref()).cloned().map(NodeLayer);
        let mut is_other = self.hold(view.of, Some(NodeOf(rig)));
        is_other |= self.hold(view.layer, layer);
        is_other |= self.hold(view.control, None);
        is_other |= self.hold(view.role, None);
        is_other |= self.mark::<ParkedNode>(view.is_parked, false);
        if is_other {
            self.name = Some(node.map_or_else(|| uid.to_string(), |node| node.name.to_string()));
        }
    }

    fn node(&mut self, rig: Entity, uid: Uid, tags: &TagEntities, built: &BuiltEntities, view: &GuardedComponentsItem) {
        let Some(mirrored) = built.nodes.get(&uid).filter(|mirrored| mirrored.entity == self.entity) else { return };
        if mirrored.is_parked {
            if self.mark::<ParkedNode>(view.is_parked, true) {
                self.commands.entity(self.entity).try_insert(Disabled);
                self.name = Some(uid.to_string());
            }
            return;
        }
        let Some(node) = &mirrored.node else { return };
        let mut is_other = self.hold(view.of, Some(NodeOf(rig)));
        is_other |= self.hold(view.role, role_of(node));
        is_other |= self.hold(view.layer, node.layer.as_deref().cloned().map(NodeLayer));
        is_other |= self.hold(view.control, node.control.as_deref().cloned().map(Control));
        is_other |= self.mark::<Null>(view.is_null, node.kind == NodeType::Null);
        is_other |= self.mark::<Joint>(view.is_joint, node.kind == NodeType::Joint);
        is_other |= self.mark::<ParkedNode>(view.is_parked, false);
        is_other |= self.relate(view.by, tags.get(mirrored.command).map(CreatedBy));
        if is_other {
            self.name = Some(node.name.to_string());
        }
    }

    fn constraint(&mut self, uid: Uid, (joints, tags, built): GuardedRig, view: &GuardedComponentsItem) {
        let Some(mirrored) = built.constraints.get(&uid).filter(|mirrored| mirrored.entity == self.entity) else {
            return;
        };
        let nodes: Vec<Option<Entity>> =
            mirrored.uids.iter().map(|node| joints.get(*node).or_else(|| built.get(*node))).collect();
        let driven = mirrored.constraint.drives().len().min(1);
        let mut is_other = self.hold(view.kind, Some(ConstraintKind(mirrored.constraint.kind())));
        let sources = nodes.get(driven..).unwrap_or_default();
        is_other |= self.hold(view.targets, Some(targets(&mirrored.constraint, sources)));
        let constrains = nodes.first().copied().flatten().filter(|_| driven > 0).map(Constrains);
        is_other |= self.relate(view.constrains, constrains);
        is_other |= self.relate(view.by, tags.get(mirrored.command).map(CreatedBy));
        if is_other {
            self.name = Some(mirrored.constraint.kind().to_owned());
        }
    }
}

/// Role of a created node.
pub(super) fn role_of(node: &BuiltNode) -> Option<CreatedRole> {
    node.origin.as_ref().map(|origin| CreatedRole {
        role: origin.role.to_string(),
        subject: origin.subject,
        number: origin.number,
    })
}
