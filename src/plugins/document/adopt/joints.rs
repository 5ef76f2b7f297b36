//! Writes to the entities of joints and created nodes.

use std::collections::{BTreeMap, BTreeSet};

use bevy::prelude::*;

use super::{
    super::{
        entities::{EntityPart, MirroredJoint},
        follow::{rest_of, write_group, write_kind, write_label},
    },
    Adoption, EntityWrite, EntityWriteError,
    sorting::RigWrites,
};
use crate::{
    plugins::schema::{Joint, NodeLabel, NodeOf},
    rig::{JointData, NodeKind, RigEdit, Uid},
};

impl Adoption<'_, '_, '_, '_, '_, '_> {
    /// Adds spawned joints to the document, parents before children.
    pub fn joints_spawned(&mut self, writes: &RigWrites) {
        let mut open: BTreeSet<Entity> = writes.spawned_joints.iter().copied().collect();
        loop {
            let parent_of =
                |entity: Entity| self.views.get(entity).ok().and_then(|view| view.child_of.map(ChildOf::parent));
            let ready: Vec<Entity> = open
                .iter()
                .copied()
                .filter(|entity| parent_of(*entity).is_none_or(|above| !open.contains(&above)))
                .collect();
            if ready.is_empty() {
                return;
            }
            for entity in ready {
                open.remove(&entity);
                self.joint_spawned(entity);
            }
        }
    }

    fn joint_spawned(&mut self, entity: Entity) {
        let rig_entity = self.trial.rig_entity;
        let Ok(view) = self.views.get(entity) else { return };
        let Some(above) = view.child_of.map(ChildOf::parent) else { return };
        self.trial.look_at_entity(entity);
        let parent = if above == rig_entity { None } else { self.uid_of(above, EntityPart::Joint) };
        if parent.is_none() && above != rig_entity {
            self.commands.entity(entity).try_remove::<ChildOf>();
            return self.trial.refuse(EntityWriteError::JointParent);
        }
        let group_entity = view.in_group.map(|group| group.0);
        let rest = rest_of(view.rest, view.transform);
        let name = view.name.map(|name| name.as_str().to_owned());
        let label = view.label.map(|label| label.0.clone()).or(name).filter(|label| !label.is_empty());
        let group = group_entity.and_then(|group| self.uid_of(group, EntityPart::Group));
        let kind = if view.null { NodeKind::Null } else { NodeKind::Joint };
        let asked = view.uid.copied();
        let uid = self.trial.free_uid(asked);
        let data = JointData { uid, label: label.clone(), group, kind, rest, ..JointData::default() };
        let added = RigEdit::AddJoint { joint: Box::new(data), parent, index: usize::MAX };
        if !self.trial.edit(EntityWrite::SpawnedJoint, vec![added]) {
            // The refused entity stays, outside of the rig.
            self.commands.entity(entity).try_remove::<ChildOf>();
            return;
        }
        self.commands.entity(entity).try_insert((uid, rest, NodeOf(rig_entity)));
        write_label(self.commands, entity, label.as_deref());
        if group_entity.is_some() && group.is_none() {
            write_group(self.commands, entity, None);
            self.trial.refuse(EntityWriteError::ForeignGroup(uid));
        }
        self.index.insert(entity, rig_entity, uid, EntityPart::Joint);
        let mirrored = MirroredJoint { entity, label, group, rest, parent: Some(above), kind, tags: Vec::new() };
        self.joints.joints.insert(uid, Box::new(mirrored));
    }

    pub fn joints_written(&mut self, writes: &RigWrites) {
        for &(entity, uid) in &writes.joints {
            let Some(mirrored) = self.joints.joints.get(&uid).filter(|mirrored| mirrored.entity == entity).cloned()
            else {
                continue;
            };
            let Ok(view) = self.views.get(entity) else { continue };
            if self.rig().joint(uid).is_none() {
                continue;
            }
            self.trial.look_at(uid);
            self.hold_uid(entity, uid, view.uid.copied());
            if !view.joint {
                self.commands.entity(entity).try_insert(Joint);
                self.trial.refuse(EntityWriteError::JointMarker(uid));
            }
            let mut next = mirrored.clone();
            let kind = if view.null { NodeKind::Null } else { NodeKind::Joint };
            if kind != mirrored.kind {
                if self.trial.edit(EntityWrite::Kind, vec![RigEdit::SetKind(uid, kind)]) {
                    next.kind = kind;
                } else {
                    write_kind(self.commands, entity, mirrored.kind);
                }
            }
            let mut label = view.label.map(|label| label.0.clone()).filter(|label| !label.is_empty());
            let name = view.name.map(|name| name.as_str().to_owned()).filter(|name| !name.is_empty());
            if label == mirrored.label && name.is_some() && name != mirrored.label {
                // Inspectors write the name of an entity.
                label.clone_from(&name);
            }
            if label != mirrored.label
                && self.trial.edit(EntityWrite::Label, vec![RigEdit::SetLabel(uid, label.clone())])
            {
                next.label.clone_from(&label);
            }
            // Label and `Name` are equal; an empty label counts as none.
            match &next.label {
                Some(label) => {
                    if view.label.is_none_or(|told| told.0 != *label) {
                        self.commands.entity(entity).try_insert(NodeLabel(label.clone()));
                    }
                    if name.as_ref() != Some(label) {
                        self.commands.entity(entity).try_insert(Name::new(label.clone()));
                    }
                }
                None if view.label.is_some() || view.name.is_some() => write_label(self.commands, entity, None),
                None => {}
            }
            let told_group = view.in_group.map(|group| self.uid_of(group.0, EntityPart::Group));
            if told_group != mirrored.group.map(Some) {
                let is_taken = match told_group {
                    Some(None) => {
                        self.trial.refuse(EntityWriteError::ForeignGroup(uid));
                        false
                    }
                    told => {
                        let group = told.flatten();
                        self.trial.edit(EntityWrite::Group, vec![RigEdit::SetGroup(uid, group)])
                    }
                };
                if is_taken {
                    next.group = told_group.flatten();
                } else {
                    write_group(self.commands, entity, mirrored.group.and_then(|group| self.groups.get(group)));
                }
            }
            let rest = view.rest.copied();
            if rest != Some(mirrored.rest) {
                let set = rest.map(|rest| RigEdit::SetRest(uid, rest));
                if set.is_some_and(|set| self.trial.edit(EntityWrite::Rest, vec![set])) {
                    // The transform is written when the entity follows the document, which still holds the former rest
                    // pose.
                } else {
                    self.commands.entity(entity).try_insert(mirrored.rest);
                }
            }
            let above = view.child_of.map(ChildOf::parent);
            if mirrored.parent.is_some() && above != mirrored.parent && self.joint_moved(entity, uid, &mirrored, above)
            {
                // The parent that the entity has now, so that an undo in the same frame is written to it.
                next.parent = above;
            }
            self.joints.joints.insert(uid, next);
        }
        let written: BTreeMap<Uid, Entity> = writes.nodes.iter().map(|(entity, uid)| (*uid, *entity)).collect();
        for (uid, entity) in written {
            self.node_written(entity, uid);
        }
    }

    /// Adopts a new parent; `true` if the document takes it.
    fn joint_moved(&mut self, entity: Entity, uid: Uid, mirrored: &MirroredJoint, above: Option<Entity>) -> bool {
        let rig_entity = self.trial.rig_entity;
        let parent = match above {
            None => Some(None),
            Some(above) if above == rig_entity => Some(None),
            Some(above) => self.uid_of(above, EntityPart::Joint).map(Some),
        };
        let is_taken = match parent {
            None => {
                self.trial.refuse(EntityWriteError::ForeignParent(uid));
                false
            }
            Some(parent) if self.rig().joint(uid).is_some_and(|joint| joint.parent == parent) => false,
            Some(parent) => {
                let set = RigEdit::SetParent { joint: uid, parent, index: usize::MAX };
                self.trial.edit(EntityWrite::Parent, vec![set])
            }
        };
        // An accepted parent is set after the build. A refused one is replaced by the former parent, if that still
        // exists.
        if let Some(before) = mirrored.parent.filter(|before| !is_taken && self.views.contains(*before)) {
            self.commands.entity(entity).try_insert(ChildOf(before));
        }
        self.trial.respawn |= !is_taken;
        is_taken
    }

    /// Reverts writes of other code to a created node, which follows its command only.
    fn node_written(&mut self, entity: Entity, uid: Uid) {
        let Some(built) = &self.built else { return };
        if built.constraints.get(&uid).is_some_and(|mirrored| mirrored.entity == entity) {
            let told = self.views.get(entity).ok().and_then(|view| view.uid.copied());
            self.trial.look_at(uid);
            return self.hold_uid(entity, uid, told);
        }
        let Some(mirrored) = built.nodes.get(&uid).cloned() else { return };
        let (Some(node), Ok(view)) =
            (mirrored.node.as_ref().filter(|_| mirrored.entity == entity), self.views.get(entity))
        else {
            return;
        };
        self.trial.look_at(uid);
        self.hold_uid(entity, uid, view.uid.copied());
        if mirrored.is_parked {
            return;
        }
        let group = node.group.and_then(|group| self.groups.get(group));
        let written = [
            ("Name", view.name.is_none_or(|name| *name.as_str() != *node.name)),
            ("NodeLabel", view.label.map(|label| label.0.as_str()) != node.label.as_deref()),
            ("InGroup", view.in_group.map(|group| group.0) != group),
            ("RestTransform", view.rest.copied() != Some(node.base.into())),
            ("ChildOf", view.child_of.map(ChildOf::parent) != mirrored.parent),
        ];
        if written.iter().any(|(_, is_other)| *is_other) {
            write_label(self.commands, entity, node.label.as_deref());
            self.commands
                .entity(entity)
                .try_insert((Name::new(node.name.to_string()), crate::rig::RestTransform::from(node.base)));
            write_group(self.commands, entity, group);
            if let Some(parent) = mirrored.parent {
                self.commands.entity(entity).try_insert(ChildOf(parent));
            }
            for (component, _) in written.into_iter().filter(|(_, is_other)| *is_other) {
                self.trial.refuse(EntityWriteError::CreatedContent { name: node.name.to_string(), component });
            }
        }
    }
}
