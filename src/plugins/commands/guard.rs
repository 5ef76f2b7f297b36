//! Components that only a build writes: what other code writes to them is reverted in the same frame, and told.

use std::{collections::BTreeSet, sync::Arc};

use bevy::{
    ecs::{entity_disabling::Disabled, query::Allow, query::QueryData, system::SystemParam},
    prelude::*,
};

use super::{BuildResult, Processor, SuppliedBuild, constraints::targets};
use crate::{
    plugins::{
        document::{
            EditRefusal, EntityWriteError, JointEntities, TagEntities,
            entities::{BuiltEntities, EntityIndex, EntityPart, IndexedEntity},
            refusals::{Bearer, RefusalLog},
        },
        runtime::RigRuntime,
        schema::{
            Attributes, Constrains, ConstraintKind, ConstraintTargets, Control, CreatedBy, CreatedRole, Joint,
            NodeLayer, NodeOf, NodeSlot, Null, ParkedNode,
        },
    },
    rig::{Attribute, BuiltNode, NodeType, RestTransform, Rig, Uid},
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
    mut told: Local<RefusalLog>,
) {
    let mut has_told = false;
    let mut entities = removed.entities();
    entities.extend(written.iter());
    for entity in entities {
        let (Some(IndexedEntity { rig, uid, part }), Ok(view)) = (index.get(entity), views.get(entity)) else {
            continue;
        };
        let Ok((joints, tags, built)) = rigs.get(rig) else { continue };
        let mut guard = Guard { commands: &mut commands, entity, written: Vec::new(), name: String::new() };
        match part {
            EntityPart::Joint => guard.joint(rig, uid, built, &view),
            EntityPart::Node => guard.node(rig, uid, tags, built, &view),
            EntityPart::Constraint => guard.constraint(uid, (joints, tags, built), &view),
            EntityPart::Tag | EntityPart::Group => {}
        }
        let Guard { written, name, .. } = guard;
        let reasons =
            written.into_iter().map(|component| EntityWriteError::BuiltContent { name: name.clone(), component });
        has_told |= told.tell(Bearer::Part(rig, uid), rig, reasons.collect(), |refusal| {
            refused.write(refusal);
        });
    }
    if has_told {
        told.retain(|bearer| matches!(bearer, Bearer::Part(rig, _) if rigs.contains(rig)));
    }
}

/// Puts the result of a build back that other code wrote or removed, before anything follows it. A rig that is not built
/// has no result but a supplied one.
pub(super) fn keep_results(
    mut commands: Commands,
    written: Query<Entity, (Changed<BuildResult>, Without<SuppliedBuild>)>,
    mut removed: RemovedComponents<BuildResult>,
    mut rigs: Query<(&Rig, Option<&BuildResult>, Option<&mut Processor>), Without<SuppliedBuild>>,
    mut refused: MessageWriter<EditRefusal>,
    mut told: Local<RefusalLog>,
) {
    let mut has_told = false;
    let entities: BTreeSet<Entity> = removed.read().chain(written.iter()).collect();
    for entity in entities {
        let Ok((rig, found, processor)) = rigs.get_mut(entity) else { continue };
        let wanted = processor.map(|mut processor| processor.bypass_change_detection().builder.shared_built());
        let is_kept = match (found, &wanted) {
            (Some(found), Some(wanted)) => Arc::ptr_eq(&found.0, wanted) || found.0 == *wanted,
            (None, None) => true,
            _ => false,
        };
        let mut reasons = Vec::new();
        if !is_kept {
            match wanted {
                Some(wanted) => commands.entity(entity).try_insert(BuildResult(wanted)),
                None => commands.entity(entity).try_remove::<BuildResult>(),
            };
            let (name, component) = (rig.about().name.clone(), BuildResult::short_type_path());
            reasons.push(EntityWriteError::BuiltContent { name, component });
        }
        has_told |= told.tell(Bearer::Entity(entity), entity, reasons, |refusal| {
            refused.write(refusal);
        });
    }
    if has_told {
        told.retain(|bearer| matches!(bearer, Bearer::Entity(rig) if rigs.contains(rig)));
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
    mut told: Local<RefusalLog>,
) {
    let mut bare_nodes: BTreeSet<Bearer> = BTreeSet::new();
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
        let name = name.map_or_else(|| uid.to_string(), Name::to_string);
        let reason = EntityWriteError::BuiltContent { name, component: Transform::short_type_path() };
        bare_nodes.insert(Bearer::Part(rig, uid));
        told.tell(Bearer::Part(rig, uid), rig, vec![reason], |refusal| {
            refused.write(refusal);
        });
    }
    told.look_at_others(&bare_nodes);
}

/// Gives `Attributes` back to nodes from which other code took them, with the values that are in effect.
pub(super) fn keep_attributes(
    mut commands: Commands,
    mut removed: RemovedComponents<Attributes>,
    bare: Query<(), (Without<Attributes>, Allow<Disabled>)>,
    rigs: Query<(&Rig, &BuiltEntities, Option<&RigRuntime>)>,
    index: Res<EntityIndex>,
    mut refused: MessageWriter<EditRefusal>,
    mut told: Local<RefusalLog>,
) {
    let mut bare_nodes: BTreeSet<Bearer> = BTreeSet::new();
    for entity in removed.read().filter(|entity| bare.contains(*entity)) {
        let Some(IndexedEntity { rig, uid, .. }) = index.get(entity) else { continue };
        let Ok((document, built, runtime)) = rigs.get(rig) else { continue };
        let joint = built.joints.get(&uid).filter(|joint| joint.entity == entity);
        let created = || built.nodes.get(&uid).filter(|mirrored| mirrored.entity == entity)?.node.as_ref();
        let of_joint = joint.map(|joint| (&joint.name, &joint.attributes));
        let found = of_joint.or_else(|| created().map(|node| (&node.name, &node.attributes)));
        let Some((name, attributes)) = found.filter(|(_, attributes)| !attributes.is_empty()) else { continue };
        let value_of = |attribute: &Attribute| {
            let now = runtime.and_then(|runtime| runtime.state().attribute(uid, &attribute.name));
            let set = || document.attribute_value(uid, &attribute.name).unwrap_or(attribute.default);
            now.unwrap_or_else(|| attribute.clamp(set()))
        };
        let values = attributes.iter().map(|attribute| (attribute.name.to_string(), value_of(attribute)));
        commands.entity(entity).try_insert(Attributes(values.collect()));
        let (name, component) = (name.to_string(), Attributes::short_type_path());
        bare_nodes.insert(Bearer::Part(rig, uid));
        let reason = EntityWriteError::BuiltContent { name, component };
        told.tell(Bearer::Part(rig, uid), rig, vec![reason], |refusal| {
            refused.write(refusal);
        });
    }
    told.look_at_others(&bare_nodes);
}

/// Restoration of one entity.
struct Guard<'a, 'w, 's> {
    commands: &'a mut Commands<'w, 's>,
    entity: Entity,
    /// Names of the components that other code wrote.
    written: Vec<&'static str>,
    /// Name of the node or constraint, if other code wrote to it.
    name: String,
}

impl Guard<'_, '_, '_> {
    /// Puts a component back where it differs; returns whether it did.
    fn put_back<C: Component + Clone + PartialEq>(&mut self, found: Option<&C>, wanted: Option<C>) -> bool {
        if found == wanted.as_ref() {
            return false;
        }
        match wanted {
            Some(wanted) => self.commands.entity(self.entity).try_insert(wanted),
            None => self.commands.entity(self.entity).try_remove::<C>(),
        };
        true
    }

    /// Puts a component back where it differs.
    fn hold<C: Component + Clone + PartialEq + TypePath>(&mut self, found: Option<&C>, wanted: Option<C>) {
        if self.put_back(found, wanted) {
            self.written.push(C::short_type_path());
        }
    }

    /// Puts a marker back where it differs.
    fn mark<C: Component + Default + TypePath>(&mut self, is_found: bool, is_wanted: bool) {
        match (is_found, is_wanted) {
            (false, true) => self.commands.entity(self.entity).try_insert(C::default()),
            (true, false) => self.commands.entity(self.entity).try_remove::<C>(),
            _ => return,
        };
        self.written.push(C::short_type_path());
    }

    /// A relation: silent where Bevy took it away together with its target.
    fn relate<C: Component + Clone + PartialEq + TypePath>(&mut self, found: Option<&C>, wanted: Option<C>) {
        if self.put_back(found, wanted) && found.is_some() {
            self.written.push(C::short_type_path());
        }
    }

    fn joint(&mut self, rig: Entity, uid: Uid, built: &BuiltEntities, view: &GuardedComponentsItem) {
        let node = built.joints.get(&uid).filter(|joint| joint.entity == self.entity);
        let layer = node.and_then(|node| node.layer.as_deref()).cloned().map(NodeLayer);
        self.hold(view.of, Some(NodeOf(rig)));
        self.hold(view.layer, layer);
        self.hold(view.control, None);
        self.hold(view.role, None);
        self.mark::<ParkedNode>(view.is_parked, false);
        if !self.written.is_empty() {
            self.name = node.map_or_else(|| uid.to_string(), |node| node.name.to_string());
        }
    }

    fn node(&mut self, rig: Entity, uid: Uid, tags: &TagEntities, built: &BuiltEntities, view: &GuardedComponentsItem) {
        let Some(mirrored) = built.nodes.get(&uid).filter(|mirrored| mirrored.entity == self.entity) else { return };
        if mirrored.is_parked {
            self.mark::<ParkedNode>(view.is_parked, true);
            if !self.written.is_empty() {
                self.commands.entity(self.entity).try_insert(Disabled);
                self.name = uid.to_string();
            }
            return;
        }
        let Some(node) = &mirrored.node else { return };
        self.hold(view.of, Some(NodeOf(rig)));
        self.hold(view.role, role_of(node));
        self.hold(view.layer, node.layer.as_deref().cloned().map(NodeLayer));
        self.hold(view.control, node.control.as_deref().cloned().map(Control));
        self.mark::<Null>(view.is_null, node.kind == NodeType::Null);
        self.mark::<Joint>(view.is_joint, node.kind == NodeType::Joint);
        self.mark::<ParkedNode>(view.is_parked, false);
        self.relate(view.by, tags.get(mirrored.command).map(CreatedBy));
        if !self.written.is_empty() {
            self.name = node.name.to_string();
        }
    }

    fn constraint(&mut self, uid: Uid, (joints, tags, built): GuardedRig, view: &GuardedComponentsItem) {
        let Some(mirrored) = built.constraints.get(&uid).filter(|mirrored| mirrored.entity == self.entity) else {
            return;
        };
        let nodes: Vec<Option<Entity>> =
            mirrored.uids.iter().map(|node| joints.get(*node).or_else(|| built.get(*node))).collect();
        let driven = mirrored.constraint.drives().len().min(1);
        self.hold(view.kind, Some(ConstraintKind(mirrored.constraint.kind())));
        let sources = nodes.get(driven..).unwrap_or_default();
        self.hold(view.targets, Some(targets(&mirrored.constraint, sources)));
        let constrains = nodes.first().copied().flatten().filter(|_| driven > 0).map(Constrains);
        self.relate(view.constrains, constrains);
        self.relate(view.by, tags.get(mirrored.command).map(CreatedBy));
        if !self.written.is_empty() {
            self.name = mirrored.constraint.kind().to_owned();
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
