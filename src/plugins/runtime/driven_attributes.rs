//! Refused writes of other code to attributes: those that constraints drive, which the run puts back, and those that
//! a node does not have, which are taken off. Both are told.

use std::{collections::BTreeSet, sync::Arc};

use bevy::prelude::*;

use super::RigRuntime;
use crate::{
    plugins::{
        commands::BuildResult,
        document::{EditRefusal, EntityWriteError},
        schema::Attributes,
    },
    rig::{Dependency, Rig, TagKind, Uid, nearest::did_you_mean},
};

/// Tells refused writes to driven attributes, once for each entity and attribute.
pub(super) fn tell_driven(
    mut rigs: Query<(Entity, &mut RigRuntime, Option<&BuildResult>, Option<&Rig>), Changed<RigRuntime>>,
    mut told: Local<BTreeSet<(Entity, Arc<str>)>>,
    mut refused: MessageWriter<EditRefusal>,
    holders: Query<(), With<Attributes>>,
) {
    for (rig, mut runtime, built, document) in &mut rigs {
        if runtime.driven_writes.is_empty() {
            continue;
        }
        let writes = std::mem::take(&mut runtime.bypass_change_detection().driven_writes);
        told.retain(|(entity, _)| holders.contains(*entity));
        let program = runtime.state.program();
        for (entity, slot) in writes {
            let Some(attribute) = program.attributes().get(slot as usize) else { continue };
            if !told.insert((entity, Arc::clone(&attribute.name))) {
                continue;
            }
            let node = &program.nodes()[attribute.node];
            let name = built.and_then(|built| built.0.node(node.uid)).map(|node| node.name.to_string());
            let reason = EntityWriteError::DrivenAttribute {
                node: name.or_else(|| node.label.as_deref().map(str::to_owned)).unwrap_or_else(|| node.uid.to_string()),
                attribute: attribute.name.to_string(),
                driver: driver(built, document, node.uid, &attribute.name),
            };
            warn!("{reason}");
            refused.write(EditRefusal { rig, request: None, reason: reason.into() });
        }
    }
}

/// Takes values off nodes of a document that have no such attributes, and tells so, once for each entity and attribute.
/// Instances of games keep what another template has left.
pub(super) fn tell_unknown(
    mut rigs: Query<(Entity, &mut RigRuntime, Option<&BuildResult>, Has<Rig>), Changed<RigRuntime>>,
    mut told: Local<BTreeSet<(Entity, String)>>,
    mut refused: MessageWriter<EditRefusal>,
    mut holders: Query<&mut Attributes>,
) {
    for (rig, mut runtime, built, has_document) in &mut rigs {
        if runtime.unknown_writes.is_empty() {
            continue;
        }
        let writes = std::mem::take(&mut runtime.bypass_change_detection().unknown_writes);
        if !has_document {
            continue;
        }
        told.retain(|(entity, _)| holders.contains(*entity));
        let program = runtime.state.program();
        for entity in writes {
            let slots = runtime.attributes.get(&entity).map_or(&[][..], Vec::as_slice);
            let (Some(first), Ok(mut values)) = (slots.first(), holders.get_mut(entity)) else { continue };
            let known: Vec<&str> = slots.iter().map(|slot| &*program.attributes()[*slot as usize].name).collect();
            let is_unknown = |name: &&String| !known.contains(&name.as_str());
            let unknown: Vec<String> = values.0.keys().filter(is_unknown).cloned().collect();
            let node = &program.nodes()[program.attributes()[*first as usize].node];
            let name = built.and_then(|built| built.0.node(node.uid)).map(|node| node.name.to_string());
            let name = name.unwrap_or_else(|| node.uid.to_string());
            for attribute in unknown {
                values.0.remove(&attribute);
                if !told.insert((entity, attribute.clone())) {
                    continue;
                }
                let nearest = did_you_mean(&attribute, &known);
                let reason = EntityWriteError::UnknownAttribute { node: name.clone(), attribute, nearest };
                warn!("{reason}");
                refused.write(EditRefusal { rig, request: None, reason: reason.into() });
            }
        }
    }
}

/// Words for the command that drives an attribute; instances of games know no commands.
fn driver(built: Option<&BuildResult>, document: Option<&Rig>, node: Uid, attribute: &Arc<str>) -> String {
    let driven = Dependency::Attribute(node, Arc::clone(attribute));
    let mut constraints = built.into_iter().flat_map(|built| built.0.constraints.iter());
    let Some(found) = constraints.find(|known| known.constraint.drives().contains(&driven)) else {
        return "a constraint of its rig".to_owned();
    };
    let command = document.and_then(|rig| rig.find_tag(found.command));
    let Some((joint, TagKind::Command { module, .. })) = command.map(|(joint, tag)| (joint, &tag.kind)) else {
        return format!("a constraint of the kind {}", found.constraint.kind());
    };
    let joint = joint.data.label.clone().unwrap_or_else(|| joint.data.uid.to_string());
    format!("the command {module} on joint {joint}")
}
