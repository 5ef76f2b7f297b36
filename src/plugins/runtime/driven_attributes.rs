//! Writes of other code to attributes that constraints drive: the run puts them back, and this tells so.

use std::{collections::BTreeSet, sync::Arc};

use bevy::prelude::*;

use super::RigRuntime;
use crate::{
    plugins::{
        commands::BuildResult,
        document::{EditRefusal, EntityWriteError},
        schema::Attributes,
    },
    rig::{Dependency, Rig, TagKind, Uid},
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
            refused.write(EditRefusal { rig, reason: reason.into() });
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
