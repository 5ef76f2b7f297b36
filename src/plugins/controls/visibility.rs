//! Visibility of nodes, from their layers and attributes; what other code writes to it is put back.

use std::collections::BTreeSet;

use bevy::{
    ecs::{
        entity::EntityHashMap,
        entity_disabling::Disabled,
        query::{Allow, QueryData},
        system::SystemParam,
    },
    prelude::*,
};

use super::{NodeVisible, VISIBLE};
use crate::plugins::{
    document::{
        EntityWriteError,
        refusals::{Bearer, RefusalLog},
    },
    schema::{Attributes, Control, NodeLayer, NodeOf},
};

/// Removals of visibilities and of the components that they follow from.
#[derive(SystemParam)]
pub(super) struct LostComponents<'w, 's> {
    layers: RemovedComponents<'w, 's, NodeLayer>,
    attributes: RemovedComponents<'w, 's, Attributes>,
    controls: RemovedComponents<'w, 's, Control>,
    shown: RemovedComponents<'w, 's, NodeVisible>,
}

impl LostComponents<'_, '_> {
    fn entities(&mut self) -> BTreeSet<Entity> {
        let inputs = self.layers.read().chain(self.attributes.read()).chain(self.controls.read());
        inputs.chain(self.shown.read()).collect()
    }
}

/// Nodes whose visibility, or a component that it follows from, was written; parked ones, too.
type WrittenNodes = (
    Or<(With<Control>, With<NodeLayer>, With<NodeVisible>)>,
    Or<(Changed<NodeLayer>, Changed<Attributes>, Changed<Control>, Changed<NodeVisible>)>,
    Allow<Disabled>,
);

/// Components of a node that decide whether it is visible.
#[derive(QueryData)]
pub(super) struct ShownNode {
    layer: Option<&'static NodeLayer>,
    attributes: Option<&'static Attributes>,
    is_control: Has<Control>,
    shown: Option<&'static NodeVisible>,
    of: Option<&'static NodeOf>,
    name: Option<&'static Name>,
}

/// Visibilities that the plugin wrote last, and refusals of others that were told.
#[derive(Default)]
pub(super) struct ShownState {
    written: EntityHashMap<NodeVisible>,
    told: RefusalLog,
}

/// Updates the visibility of nodes whose layer, attributes or control changed or are gone, and puts it back where other code
/// wrote it.
pub(super) fn show_nodes(
    mut commands: Commands,
    mut lost: LostComponents,
    written: Query<Entity, WrittenNodes>,
    nodes: Query<ShownNode, Allow<Disabled>>,
    mut state: Local<ShownState>,
) {
    let state = &mut *state;
    let mut has_told = false;
    let mut entities = lost.entities();
    entities.extend(written.iter());
    for entity in entities {
        let Ok(node) = nodes.get(entity) else {
            state.written.remove(&entity);
            continue;
        };
        let is_in = node.layer.is_none_or(|layer| layer.0.visible);
        let is_on = node.attributes.and_then(|attributes| attributes.0.get(VISIBLE)).is_none_or(|value| *value >= 0.5);
        let wanted = (node.is_control || node.layer.is_some()).then_some(NodeVisible(is_in && is_on));
        let before = match wanted {
            Some(visible) => state.written.insert(entity, visible),
            None => state.written.remove(&entity),
        };
        let (found, rig) = (node.shown.copied(), node.of.map(|of| of.0));
        // An entity of a game that is no node may have the component.
        let is_node = rig.is_some() || before.is_some() || wanted.is_some();
        if is_node && found != wanted {
            match wanted {
                Some(visible) => commands.entity(entity).try_insert(visible),
                None => commands.entity(entity).try_remove::<NodeVisible>(),
            };
        }
        let Some(rig) = rig else { continue };
        let mut reasons = Vec::new();
        if found != wanted && found != before {
            let name = node.name.map_or_else(|| entity.to_string(), Name::to_string);
            reasons.push(EntityWriteError::BuiltContent { name, component: NodeVisible::short_type_path() });
        }
        has_told |= state.told.tell(Bearer::Entity(entity), rig, reasons, |refusal| {
            commands.write_message(refusal);
        });
    }
    if has_told {
        state.told.retain(|bearer| matches!(bearer, Bearer::Entity(node) if nodes.contains(node)));
    }
}
