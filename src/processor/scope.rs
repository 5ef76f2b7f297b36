//! Scope of a command: the only way in which a module reads and changes the built world.

mod node_changes;
mod own_transforms;
mod references;
mod trace;

use std::sync::Arc;

use own_transforms::OwnAnchors;
use trace::world_children;
pub(super) use trace::{Read, Trace};

use super::{
    AttributeList, Creation, ModuleError,
    resolve::Asker,
    world::{Aspect, Birth, NodeId, Value, World},
};
use crate::{
    mesh::model::Trs,
    rig::{Constraint, ControlData, Dependency, LayerData, NodeType, Origin, SwitchData, Uid, created_uid},
};

/// The side of the body that a node is on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Side {
    /// The character's left: towards +X.
    Left,
    /// The character's right: towards -X.
    Right,
    /// The middle plane.
    Middle,
}

/// The built world as one command sees it: as the commands before it left it, and what it does itself.
///
/// Everything that is read through it is noted, so that the command runs again when it changes; everything that is
/// written is taken back when the command is rolled back. Transforms are local (relative to the parent) or in the rig's
/// space, as each method says.
pub struct BuildScope<'a> {
    pub(super) world: &'a mut World,
    pub(super) trace: &'a mut Trace,
    pub(super) asker: Asker,
    pub(super) command: u32,
    pub(super) module: Arc<str>,
    own: OwnAnchors,
}

impl<'a> BuildScope<'a> {
    /// The scope of a command with that number, of a module with that name, that is about to run.
    pub(super) fn new(
        world: &'a mut World,
        trace: &'a mut Trace,
        asker: Asker,
        command: u32,
        module: Arc<str>,
    ) -> Self {
        Self { world, trace, asker, command, module, own: OwnAnchors::default() }
    }
}

impl BuildScope<'_> {
    /// The joint that carries the tag.
    pub fn joint(&self) -> NodeId {
        self.asker.joint
    }

    /// The command's tag.
    pub fn command(&self) -> Uid {
        self.world.commands[self.command as usize]
    }

    /// The rig that is built.
    pub fn rig(&self) -> Uid {
        self.asker.rig
    }

    /// The uid of a node.
    pub fn uid(&self, node: NodeId) -> Uid {
        self.world.uid(node)
    }

    /// The node with that uid, if the builder has ever seen one.
    pub fn id(&self, uid: Uid) -> Option<NodeId> {
        self.world.id(uid)
    }

    /// The name of a node, for messages only: a command does not run again when it changes.
    pub fn name(&self, node: NodeId) -> String {
        self.world.name(node, self.asker.place + 1)
    }

    /// The name of a node, to be used in what is built: the command runs again when it changes.
    pub fn name_to_keep(&mut self, node: NodeId) -> String {
        let mut at = Some(node);
        while let Some(link) = at {
            // All that a name is made of: see `World::name`.
            let birth = self.read(link, Aspect::Birth);
            self.read(link, Aspect::Label);
            at = match birth {
                Some(Value::Birth(birth)) => {
                    let subject = birth.origin.as_ref().map(|origin| origin.subject);
                    subject.and_then(|subject| self.world.id(subject)).filter(|subject| *subject != link)
                }
                _ => None,
            };
        }
        self.name(node)
    }

    /// Joint, null or control; `None` if the node is not there.
    pub fn kind(&mut self, node: NodeId) -> Option<NodeType> {
        match self.read(node, Aspect::Birth) {
            Some(Value::Birth(birth)) => Some(birth.kind),
            _ => None,
        }
    }

    /// Origin of a node: command and purpose; `None` for joints of the document.
    pub fn origin(&mut self, node: NodeId) -> Option<Arc<Origin>> {
        match self.read(node, Aspect::Birth) {
            Some(Value::Birth(birth)) => birth.origin.clone(),
            _ => None,
        }
    }

    /// The parent of a node.
    pub fn parent(&mut self, node: NodeId) -> Option<NodeId> {
        match self.read(node, Aspect::Parent) {
            Some(Value::Parent(parent)) => parent,
            _ => None,
        }
    }

    /// The children of a node in order, those that the command itself made included.
    pub fn children(&mut self, node: NodeId) -> Vec<NodeId> {
        let before = world_children(self.world, node, self.asker.place);
        let now = world_children(self.world, node, self.asker.place + 1);
        self.trace.reads.push(Read::Children(node, before));
        now
    }

    /// The children of a node that are joints.
    pub fn child_joints(&mut self, node: NodeId) -> Vec<NodeId> {
        let children = self.children(node);
        children.into_iter().filter(|child| self.kind(*child) == Some(NodeType::Joint)).collect()
    }

    /// The nodes from `top` down to `end`, both included.
    ///
    /// # Errors
    /// If `end` is not below `top`.
    pub fn chain(&mut self, top: NodeId, end: NodeId) -> Result<Vec<NodeId>, ModuleError> {
        let mut chain = vec![end];
        let mut at = end;
        while at != top {
            let Some(parent) = self.parent(at) else {
                return Err(ModuleError::other(format!(
                    "{} is not below {}: choose the ends of one chain, the upper one first",
                    self.name(end),
                    self.name(top)
                )));
            };
            chain.push(parent);
            at = parent;
        }
        chain.reverse();
        Ok(chain)
    }

    /// The transform of a node relative to its parent.
    pub fn base(&mut self, node: NodeId) -> Trs {
        match self.read(node, Aspect::Base) {
            Some(Value::Base(base)) => *base,
            _ => Trs::IDENTITY,
        }
    }

    /// The transform of a node in the rig's space.
    pub fn global(&mut self, node: NodeId) -> Trs {
        let place = self.asker.place + 1;
        if self.world.is_moved_by(self.command, node, place) {
            return self.global_of_own(node);
        }
        let (global, count) = self.world.global_kept(node, place);
        self.world.work += count;
        if self.trace.globals.insert(node, global).is_none() {
            let readers = &mut self.world.slots[node.0 as usize].global_readers;
            if let Err(at) = readers.binary_search(&self.command) {
                readers.insert(at, self.command);
                self.world.global_reads += 1;
            }
        }
        global
    }

    /// Transform of a node in the rig's space.
    pub fn position(&mut self, node: NodeId) -> glam::Vec3 {
        self.global(node).translation
    }

    /// The side of the body that a node stands on, with a thousandth of its distance from the ground for the middle.
    pub fn side(&mut self, node: NodeId) -> Side {
        let position = self.position(node);
        let near = 1e-3 * position.length().max(1e-3);
        match position.x {
            x if x > near => Side::Left,
            x if x < -near => Side::Right,
            _ => Side::Middle,
        }
    }

    /// The label of a node.
    pub fn label(&mut self, node: NodeId) -> Option<Arc<str>> {
        match self.read(node, Aspect::Label) {
            Some(Value::Label(label)) => label,
            _ => None,
        }
    }

    /// The local group of a node.
    pub fn group(&mut self, node: NodeId) -> Option<Uid> {
        match self.read(node, Aspect::Group) {
            Some(Value::Group(group)) => group,
            _ => None,
        }
    }

    /// Appearance, channels and limits of a control.
    pub fn control(&mut self, node: NodeId) -> Option<Arc<ControlData>> {
        match self.read(node, Aspect::Control) {
            Some(Value::Control(control)) => Some(control),
            _ => None,
        }
    }

    /// The layer of a node.
    pub fn layer(&mut self, node: NodeId) -> Option<Arc<LayerData>> {
        match self.read(node, Aspect::Layer) {
            Some(Value::Layer(layer)) => Some(layer),
            _ => None,
        }
    }

    /// The attributes of a node, in order.
    pub fn attributes(&mut self, node: NodeId) -> AttributeList {
        match self.read(node, Aspect::Attributes) {
            Some(Value::Attributes(attributes)) => attributes,
            _ => AttributeList::default(),
        }
    }

    /// Makes a node. Its identity follows from the command, `role` (what the node is for), `subject` (the node it is
    /// made for) and `number`: the same purpose gives the same node in every build, whatever else changes. It takes
    /// the label and group of the joint that carries the tag unless `creation` says otherwise, and stands on `parent`
    /// (below the rig for `None`) at `base`, which is relative to it.
    ///
    /// # Errors
    /// If the command made a node for the same purpose before, or the creation parameters name another rig.
    #[expect(clippy::too_many_arguments, reason = "each is needed for every node, and a builder would hide that")]
    pub fn spawn(
        &mut self,
        kind: NodeType,
        role: &str,
        subject: NodeId,
        number: u32,
        parent: Option<NodeId>,
        base: Trs,
        creation: &Creation,
    ) -> Result<NodeId, ModuleError> {
        if let Some(rig) = creation.global_group
            && rig != self.asker.rig
        {
            return Err(ModuleError::parameter(
                "global_group",
                format!("{rig} is another rig; leave it out, or carry the tag over to that rig"),
            ));
        }
        self.check_inside(parent)?;
        let node = self.identity(role, subject, number)?;
        self.world.note_made();
        let origin = Origin {
            command: self.command(),
            module: self.module.clone(),
            role: role.into(),
            subject: self.uid(subject),
            number,
        };
        let birth = Birth {
            kind,
            name: creation.name.as_deref().map(Into::into),
            origin: Some(Arc::new(origin)),
            order: self.trace.made,
        };
        self.trace.made += 1;
        let joint = self.joint();
        let label = match &creation.label {
            Some(label) => Some(label.as_str().into()),
            None => self.label(joint),
        };
        let group = match creation.local_group {
            Some(group) => Some(group),
            None => self.group(joint),
        };
        self.write(node, Aspect::Birth, Value::Birth(Arc::new(birth)));
        self.write(node, Aspect::Parent, Value::Parent(parent));
        self.write(node, Aspect::Base, Value::Base(Arc::new(base)));
        self.write(node, Aspect::Label, Value::Label(label));
        self.write(node, Aspect::Group, Value::Group(group));
        Ok(node)
    }

    /// Refuses an input where something of the rig is needed.
    fn check_inside(&self, node: Option<NodeId>) -> Result<(), ModuleError> {
        match node.filter(|node| self.world.is_input(*node)) {
            Some(input) => Err(ModuleError::other(format!(
                "{} is an input, outside of the rig: follow it, but hang nothing below it and do not move it",
                self.name(input)
            ))),
            None => Ok(()),
        }
    }

    /// Makes a node like [`BuildScope::spawn`], given where it stands in the rig's space.
    ///
    /// # Errors
    /// See [`BuildScope::spawn`].
    #[expect(clippy::too_many_arguments, reason = "as in `spawn`")]
    pub fn spawn_at(
        &mut self,
        kind: NodeType,
        role: &str,
        subject: NodeId,
        number: u32,
        parent: Option<NodeId>,
        global: Trs,
        creation: &Creation,
    ) -> Result<NodeId, ModuleError> {
        let base = match parent {
            Some(parent) => global.relative_to(&self.global(parent)),
            None => global,
        };
        self.spawn(kind, role, subject, number, parent, base, creation)
    }

    /// Adds a constraint or solver. Those that drive the same node run in the order in which they are added.
    ///
    /// # Errors
    /// If the command made something for the same purpose before.
    pub fn constrain(
        &mut self,
        role: &str,
        subject: NodeId,
        number: u32,
        constraint: Constraint,
    ) -> Result<NodeId, ModuleError> {
        for driven in constraint.drives() {
            let (Dependency::Node(uid) | Dependency::Attribute(uid, _)) = driven;
            self.check_inside(self.world.id(uid))?;
        }
        let id = self.identity(role, subject, number)?;
        self.world.note_made();
        for driven in constraint.drives() {
            let (Dependency::Node(uid) | Dependency::Attribute(uid, _)) = driven;
            if let Some(node) = self.world.id(uid) {
                let driven_by = &mut self.world.slots[node.0 as usize].driven_by;
                if !driven_by.contains(&id) {
                    driven_by.push(id);
                }
            }
        }
        let number = self.trace.made;
        self.trace.made += 1;
        self.write(id, Aspect::Constraint, Value::Constraint(number, Arc::new(constraint)));
        Ok(id)
    }

    /// Adds a switch that can be thrown without a jump.
    ///
    /// # Errors
    /// If the command made something for the same purpose before.
    pub fn switch(&mut self, role: &str, subject: NodeId, switch: SwitchData) -> Result<(), ModuleError> {
        let id = self.identity(role, subject, 0)?;
        let number = self.trace.made;
        self.trace.made += 1;
        self.write(id, Aspect::Switch, Value::Switch(number, Arc::new(switch)));
        Ok(())
    }

    fn read(&mut self, node: NodeId, aspect: Aspect) -> Option<Value> {
        self.world.work += 1;
        let value = self.world.read_at(node, aspect, self.asker.place + 1).cloned();
        let command = self.command;
        if !self.is_own(node, aspect) {
            // Who is among the readers has noted it already.
            let readers = self.world.cell_mut(node, aspect).readers_mut();
            if let Err(at) = readers.binary_search(&command) {
                readers.insert(at, command);
                self.trace.reads.push(Read::Cell(node, aspect, value.clone()));
            }
        }
        value
    }

    /// True if the command itself wrote it.
    fn is_own(&self, node: NodeId, aspect: Aspect) -> bool {
        self.world.cell(node, aspect).writes().iter().any(|(writer, _)| *writer == self.command)
    }

    pub(super) fn write(&mut self, node: NodeId, aspect: Aspect, value: Value) {
        let command = self.command;
        self.world.work += 1;
        self.world.note_parent(node, &value);
        self.world.anchors.note_written(node, aspect);
        self.own.note_written(node, aspect);
        let writes = self.world.cell_mut(node, aspect).writes_mut();
        match writes.iter_mut().find(|(writer, _)| *writer == command) {
            Some((_, old)) => *old = value,
            None => {
                writes.push((command, value));
                self.trace.writes.push((node, aspect));
            }
        }
    }

    /// The place of something that the command makes for a purpose.
    fn identity(&mut self, role: &str, subject: NodeId, number: u32) -> Result<NodeId, ModuleError> {
        if self.world.is_full(self.asker.place + 1) {
            let limit = self.world.limits.made;
            return Err(ModuleError::TooMany { what: "nodes and constraints", name: "nodes", limit });
        }
        self.world.check_work()?;
        let uid = created_uid(self.command(), role, self.uid(subject), number);
        let node = self.world.slot(uid, Some(self.command));
        let mine = |aspect: Aspect| self.is_own(node, aspect);
        let foreign = self.world.slots[node.0 as usize].creator != Some(self.command);
        if foreign || mine(Aspect::Birth) || mine(Aspect::Constraint) || mine(Aspect::Switch) {
            let subject = self.name(subject);
            return Err(ModuleError::other(format!(
                "the module makes \"{role}\" number {number} for {subject} twice; it has to count them"
            )));
        }
        Ok(node)
    }
}
