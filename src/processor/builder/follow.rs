//! Taking over what the document says: joints, tags, and what is switched off.

use std::{cmp::Reverse, collections::HashSet, sync::Arc};

use bevy::platform::collections::HashMap;

use super::{Builder, Command, DueWork};
use crate::{
    mesh::model::Trs,
    processor::{
        exclusion::{CommandExclusion, Exclusion, Gap, JointExclusion, SkipReason},
        list::{Switches, command_exclusion, joints_in},
        scope::Trace,
        world::{Aspect, Birth, NOWHERE, NodeId, Value, same},
    },
    rig::{NodeKind, NodeType, Rig, RigEdit, RigJoint, TagData, TagKind, Uid},
};

impl Builder {
    /// Takes over what the document says now. Nothing is carried out: see [`Builder::run_to`].
    pub fn sync(&mut self, rig: &Rig) {
        self.rig = rig.uid();
        let switches = Switches::of(rig);
        self.world.followed += rig.len() as u64;
        self.sync_joints(rig, &switches);
        self.sync_inputs(rig);
        self.spread_moves(None);
        self.sync_list(rig, &switches);
        self.spread_structure();
        self.drop_waste(rig);
    }

    /// Takes over one edit that was applied to the document since the last [`Builder::sync`]. What concerns one tag or
    /// one transform takes no look at anything else, and so does a command's own switch.
    pub fn touch(&mut self, rig: &Rig, edit: &RigEdit) {
        if !self.touch_one(rig, edit) {
            self.sync(rig);
        }
    }

    /// True if that was all there is to do.
    fn touch_one(&mut self, rig: &Rig, edit: &RigEdit) -> bool {
        match edit {
            RigEdit::SetTag(joint, tag) => rig
                .find_tag(tag.uid)
                .is_some_and(|(bearer, tag)| bearer.data.uid == *joint && self.touch_tag(rig, bearer, tag)),
            RigEdit::SetOffset(..) | RigEdit::SetAttributeValue(..) => true,
            RigEdit::SetSkin(..) | RigEdit::SetWeights(..) => true,
            _ => false,
        }
    }

    /// Takes over the parameters and the own switch of a command; false if more than these has changed.
    fn touch_tag(&mut self, rig: &Rig, bearer: &RigJoint, tag: &TagData) -> bool {
        let TagKind::Command { module, params, feature } = &tag.kind else { return false };
        let Some(number) = self.world.creator_of(tag.uid) else { return false };
        let command = &self.commands[number as usize];
        let is_alike = *feature == command.feature && **module == *command.module && command.joint == bearer.data.uid;
        let is_switched = tag.enabled != command.enabled;
        if !is_alike || (is_switched && self.world.places[number as usize] == NOWHERE) {
            return false;
        }
        if is_switched {
            self.switch_command(number, bearer.data.uid, module, command_exclusion(rig, &bearer.data, tag));
        }
        let command = &mut self.commands[number as usize];
        let was_active = command.active;
        if is_switched {
            command.enabled = tag.enabled;
            command.active = !self.world.off.commands.get(&number).is_some_and(CommandExclusion::is_own);
        }
        let reads_anew = *params != *command.params;
        if reads_anew {
            command.params = params.as_str().into();
            command.loaded = None;
        }
        if reads_anew || command.active != was_active {
            self.mark(number, DueWork::Run);
        }
        if is_switched {
            self.spread_structure();
        }
        true
    }

    /// Notes that the document passes over a command of a joint, or does not.
    fn switch_command(&mut self, number: u32, joint: Uid, module: &str, off: Option<Exclusion>) {
        if let Some(off) = off {
            let above = self.world.off.joint(joint).and_then(|gap| gap.above);
            let off = CommandExclusion { module: module.into(), reason: SkipReason::Own(off), above };
            self.set_command_off(number, Some(off));
        } else if self.world.off.commands.get(&number).is_some_and(CommandExclusion::is_own) {
            self.set_command_off(number, None);
        }
    }

    fn sync_joints(&mut self, rig: &Rig, switches: &Switches) {
        let mut off = HashMap::default();
        let before = std::mem::take(&mut self.world.joints);
        let mut seen = HashSet::with_capacity(rig.len());
        // Joints that are left out: their children hang on what is above, and stay where they are.
        let mut left_out: HashMap<Uid, (Option<NodeId>, Trs)> = HashMap::default();
        for (order, joint) in rig.walk().enumerate() {
            let data = &joint.data;
            let rest: Trs = data.rest.into();
            let (parent, base) = match joint.parent {
                Some(parent) => match left_out.get(&parent) {
                    Some((above, between)) => (*above, *between * rest),
                    None => (self.world.id(parent), rest),
                },
                None => (None, rest),
            };
            if let Some(reason) = switches.joint(data) {
                off.insert(data.uid, JointExclusion { off: reason, above: parent });
                left_out.insert(data.uid, (parent, base));
                continue;
            }
            let node = self.world.slot(data.uid, None);
            seen.insert(node);
            self.world.joints.push(node);
            let kind = match data.kind {
                NodeKind::Joint => NodeType::Joint,
                NodeKind::Null => NodeType::Null,
            };
            let label: Option<Arc<str>> = data.label.as_deref().map(Into::into);
            let birth = Birth { kind, name: None, origin: None, order: order as u32 };
            self.set_document(node, Aspect::Birth, Some(Value::Birth(Arc::new(birth))));
            self.set_document(node, Aspect::Parent, Some(Value::Parent(parent)));
            self.set_document(node, Aspect::Base, Some(Value::Base(Arc::new(base))));
            self.set_document(node, Aspect::Label, Some(Value::Label(label)));
            self.set_document(node, Aspect::Group, Some(Value::Group(data.group)));
        }
        for node in before.into_iter().filter(|node| !seen.contains(node)) {
            self.clear_document(node);
        }
        self.set_joints_off(off, &switches.groups);
    }

    fn sync_inputs(&mut self, rig: &Rig) {
        if self.world.declared == rig.inputs() {
            return;
        }
        self.built.forget();
        self.world.declared = rig.inputs().to_vec();
        let before = std::mem::take(&mut self.world.inputs);
        for (order, input) in rig.inputs().iter().enumerate() {
            let node = self.world.slot(input.uid, None);
            self.world.inputs.push(node);
            let birth = Birth { kind: NodeType::Null, name: None, origin: None, order: order as u32 };
            let label: Option<Arc<str>> = Some(input.name.as_str().into());
            self.set_document(node, Aspect::Birth, Some(Value::Birth(Arc::new(birth))));
            self.set_document(node, Aspect::Parent, Some(Value::Parent(None)));
            self.set_document(node, Aspect::Base, Some(Value::Base(Arc::new(input.rest.into()))));
            self.set_document(node, Aspect::Label, Some(Value::Label(label)));
            self.set_document(node, Aspect::Group, Some(Value::Group(None)));
        }
        for node in before {
            if !self.world.inputs.contains(&node) && !self.world.joints.contains(&node) {
                self.clear_document(node);
            }
        }
    }

    fn clear_document(&mut self, node: NodeId) {
        for aspect in [Aspect::Birth, Aspect::Parent, Aspect::Base, Aspect::Label, Aspect::Group] {
            self.set_document(node, aspect, None);
        }
    }

    /// Notes which joints and groups are off.
    fn set_joints_off(&mut self, joints: HashMap<Uid, JointExclusion>, groups: &HashMap<Uid, Arc<str>>) {
        let off = &mut self.world.off;
        if off.joints != joints || off.groups != *groups {
            (off.joints, off.groups) = (joints, groups.clone());
            self.structure_changed = Some(0);
        }
    }

    /// Notes whether a command is passed over, and why. Those that look for its nodes have to look again if that
    /// changes.
    pub(super) fn set_command_off(&mut self, number: u32, off: Option<CommandExclusion>) {
        let commands = &mut self.world.off.commands;
        if commands.get(&number) == off.as_ref() {
            return;
        }
        match off {
            Some(off) => commands.insert(number, off),
            None => commands.remove(&number),
        };
        self.structure_changes_after(number);
    }

    /// Notes whether a command made less than it would.
    pub(super) fn set_partial(&mut self, number: u32, gap: Option<Gap>) {
        let partial = &mut self.world.off.partial;
        if partial.get(&number) == gap.as_ref() {
            return;
        }
        match gap {
            Some(gap) => partial.insert(number, gap),
            None => partial.remove(&number),
        };
        self.structure_changes_after(number);
    }

    fn structure_changes_after(&mut self, number: u32) {
        let from = match self.world.places[number as usize] {
            NOWHERE => 0,
            place => place + 1,
        };
        self.structure_changed = Some(self.structure_changed.map_or(from, |before| before.min(from)));
    }

    fn set_document(&mut self, node: NodeId, aspect: Aspect, value: Option<Value>) {
        if let Some(value) = &value {
            self.world.note_parent(node, value);
        }
        let cell = self.world.cell_mut(node, aspect);
        if !same(cell.document.as_ref(), value.as_ref()) {
            cell.document = value;
            self.world.anchors.note_written(node, aspect);
            self.changed(node, aspect, None, aspect == Aspect::Parent);
        }
    }

    fn sync_list(&mut self, rig: &Rig, switches: &Switches) {
        let mut list = Vec::with_capacity(self.list.len());
        for uid in joints_in(rig, &self.range) {
            let Some(joint) = rig.joint(uid) else { continue };
            for tag in &joint.data.tags {
                let TagKind::Command { module, params, feature } = &tag.kind else { continue };
                let number = self.world.command(tag.uid);
                let off = switches.command(&joint.data, tag);
                let active = off.is_none();
                self.world.bearers[number as usize] = uid;
                self.switch_command(number, uid, module, off);
                if number as usize == self.commands.len() {
                    self.commands.push(Command {
                        joint: uid,
                        module: module.as_str().into(),
                        params: params.as_str().into(),
                        loaded: None,
                        enabled: tag.enabled,
                        feature: *feature,
                        active,
                        trace: Trace::default(),
                        asks: false,
                        ran_in: 0,
                        due: DueWork::Nothing,
                        error: None,
                        micros: 0.0,
                        runs: 0,
                    });
                    self.mark(number, DueWork::Run);
                } else {
                    let command = &mut self.commands[number as usize];
                    (command.enabled, command.feature) = (tag.enabled, *feature);
                    let reads_anew = *command.module != **module || *command.params != **params;
                    if reads_anew {
                        command.module = module.as_str().into();
                        command.params = params.as_str().into();
                        command.loaded = None;
                    }
                    if reads_anew || command.active != active || command.joint != uid {
                        (command.active, command.joint) = (active, uid);
                        self.mark(number, DueWork::Run);
                    }
                }
                list.push(number);
            }
        }
        if list == self.list {
            return;
        }
        // With other places, everything may read something else, and everything has to be looked at.
        self.built.forget();
        self.world.anchors.forget();
        let had_any = !self.list.is_empty();
        let reached = self.list.get(self.cursor as usize).copied();
        for number in std::mem::replace(&mut self.list, list) {
            self.world.places[number as usize] = NOWHERE;
        }
        self.due.clear();
        for at in 0..self.list.len() {
            let number = self.list[at];
            self.world.places[number as usize] = at as u32;
            let command = &mut self.commands[number as usize];
            command.due = command.due.max(DueWork::Check);
            self.due.push(Reverse((at as u32, number)));
        }
        self.graph_changed = Some(0);
        let still = reached.map(|number| self.world.places[number as usize]).filter(|place| *place != NOWHERE);
        let end = if had_any { self.list.len() as u32 } else { 0 };
        self.cursor = still.unwrap_or(end);
        if self.failed.is_some_and(|number| self.world.places[number as usize] == NOWHERE) {
            self.failed = None;
        }
    }

    /// Marks the later readers of what `writer` (`None`: the document) has moved in the rig's space: in one walk, since
    /// each node of a chain moves all nodes below it.
    pub(super) fn spread_moves(&mut self, writer: Option<u32>) {
        if self.moved.is_empty() {
            return;
        }
        let moved = std::mem::take(&mut self.moved);
        let from = writer.map(|writer| self.world.places[writer as usize]);
        for number in self.world.global_readers(moved) {
            let place = self.world.places[number as usize];
            if place != NOWHERE && from.is_none_or(|from| place > from) {
                self.mark(number, DueWork::Check);
            }
        }
    }

    pub(super) fn mark(&mut self, number: u32, due: DueWork) {
        let command = &mut self.commands[number as usize];
        if command.due < due {
            command.due = due;
            let place = self.world.places[number as usize];
            if place != NOWHERE {
                self.due.push(Reverse((place, number)));
            }
        }
    }
}
