//! Building and posing on a workbench, through the same requests and the same entities as in an app.

use std::{str::FromStr, sync::Arc, time::Duration};

use bevy::{prelude::*, time::TimeUpdateStrategy};

use super::{
    Workbench, WorkbenchError,
    held_values::{NodeWrite, rotation},
};
pub use super::{held_values::HeldValue, posed_node::PosedNode};
use crate::{
    mesh::model::Trs,
    plugins::{
        commands::{
            BuildDone, BuildRequest, BuildResult, BuildStep, BuiltEntities, NamedProgramError, Processor, RunFailure,
        },
        controls::{SwitchError, SwitchRequest, number_of},
        document::JointEntities,
        runtime::{RigRuntime, is_near},
        schema::Attributes,
    },
    processor::{Exclusion, FindError, RunReport},
    rig::{
        AttributeKind, BuiltNode, BuiltRig, PoseOffset, RestTransform, Rig, RigEdit, Uid, nearest::listed,
        proportion::ProportionError,
    },
};

/// Value to write to an entity: `CONTROL.translate=(x,y,z)`, `.rotate=(x,y,z)` in degrees about X, Y and Z in that
/// order, `.scale=(x,y,z)`, all relative to the control's rest pose, in its own axes; or `NODE.ATTRIBUTE=value` with a
/// number, or the name of a choice where the attribute has choices.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlWrite {
    /// The node: a name, a label, or a reference that begins with `@`.
    pub node: String,
    /// The value.
    pub value: WriteValue,
}

/// The channel that a [`ControlWrite`] sets.
#[derive(Debug, Clone, PartialEq)]
pub enum WriteValue {
    /// Translation in units of the rig, along the control's own axes at rest.
    Translate(Vec3),
    /// Rotation in degrees about the X, Y and Z axes, in that order.
    Rotate(Vec3),
    /// Scale factors along the control's own axes.
    Scale(Vec3),
    /// Attribute by name, and its value.
    Attribute(String, f32),
    /// Attribute by name, and its value as text: the name of one of its choices, or a number. A name wins.
    AttributeText(String, String),
}

impl WriteValue {
    /// Name of the attribute that is set; `None` for a channel of a control.
    pub(super) fn attribute(&self) -> Option<&str> {
        match self {
            Self::Attribute(name, _) | Self::AttributeText(name, _) => Some(name),
            Self::Translate(_) | Self::Rotate(_) | Self::Scale(_) => None,
        }
    }

    /// Name of the channel or attribute that is set.
    pub(super) fn channel(&self) -> &str {
        match self {
            Self::Translate(_) => "translate",
            Self::Rotate(_) => "rotate",
            Self::Scale(_) => "scale",
            Self::Attribute(name, _) | Self::AttributeText(name, _) => name,
        }
    }

    /// The value for a node, with the number in place of the text of an attribute.
    fn on(&self, node: &BuiltNode) -> Result<Self, PoseError> {
        let Self::AttributeText(attribute, text) = self else { return Ok(self.clone()) };
        let kind = node.attributes.iter().find(|known| *known.name == **attribute).map(|known| &known.kind);
        let choices: Vec<&str> = match kind {
            Some(AttributeKind::Choice(names)) => names.iter().map(String::as_str).collect(),
            _ => Vec::new(),
        };
        if let Some(number) = number_of(&choices, text) {
            return Ok(Self::Attribute(attribute.clone(), number));
        }
        let known = if choices.is_empty() { "a number".to_owned() } else { listed(&choices, "or") };
        let (node, attribute, value) = (node.name.to_string(), attribute.clone(), text.clone());
        Err(PoseError::NoValue { node, attribute, value, known })
    }
}

/// Reason why a control was not posed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PoseError {
    /// The text does not describe a write.
    #[error("\"{0}\" sets nothing; write CONTROL.translate=(x,y,z), .rotate, .scale, or NODE.ATTRIBUTE=value")]
    Syntax(String),
    /// The rig is not built.
    #[error("the rig is not built; build it first")]
    NotBuilt,
    /// The built rig cannot run.
    #[error("the built rig cannot run: {0}")]
    CannotRun(NamedProgramError),
    /// The built rig has no node with that name.
    #[error("no {what} is called \"{name}\"{nearest}")]
    NoNode {
        /// Requested kind of node, in words.
        what: &'static str,
        /// Requested name.
        name: String,
        /// Nearest names, as the rest of a sentence.
        nearest: String,
    },
    /// The nodes that a reference finds are of another kind.
    #[error("\"{name}\" finds nodes, but no {what}{nearest}")]
    OtherKind {
        /// Requested kind of node, in words.
        what: &'static str,
        /// The reference.
        name: String,
        /// Labels that name nodes of the kind, as the rest of a sentence.
        nearest: String,
    },
    /// The node is not built, because something is off.
    #[error("\"{name}\" is not built: {off}; turn it on")]
    Off {
        /// Requested name.
        name: String,
        /// Switch that is off.
        off: Exclusion,
    },
    /// Several nodes have that name.
    #[error("\"{name}\" may be any of {candidates}{off}; write one of these names")]
    Ambiguous {
        /// Requested name.
        name: String,
        /// Names of the nodes that the requested name may mean.
        candidates: String,
        /// Clause about the features that are off there, in brackets; empty if none is.
        off: String,
    },
    /// The node has no such attribute.
    #[error("\"{node}\" has no attribute \"{attribute}\"{known}")]
    NoAttribute {
        /// The node.
        node: String,
        /// The attribute.
        attribute: String,
        /// Attributes of the node, as the rest of a sentence.
        known: String,
    },
    /// The attribute takes no such value.
    #[error("\"{attribute}\" of \"{node}\" has no value \"{value}\"; write {known}")]
    NoValue {
        /// The node.
        node: String,
        /// The attribute.
        attribute: String,
        /// Requested value.
        value: String,
        /// Possible values, as a list in words.
        known: String,
    },
    /// A value out of all proportion to the rig.
    #[error("{value} for \"{node}\" is out of all proportion to the rig; write numbers up to {most}")]
    OutOfRange {
        /// The node.
        node: String,
        /// Requested value.
        value: String,
        /// Largest number that is taken.
        most: f32,
    },
    /// A number that makes no sense on any rig.
    #[error("\"{node}\": {reason}")]
    Disproportionate {
        /// The node.
        node: String,
        /// Reason, with the number.
        reason: ProportionError,
    },
    /// A pose in which a node has no finite place.
    #[error("the pose puts \"{node}\" at no finite place; write smaller values")]
    NotFinite {
        /// The node.
        node: String,
    },
    /// A reference finds no node.
    #[error(transparent)]
    Reference(#[from] FindError),
    /// A switch could not be set.
    #[error(transparent)]
    Switch(#[from] SwitchError),
    /// See [`WorkbenchError`].
    #[error(transparent)]
    Workbench(#[from] WorkbenchError),
}

impl FromStr for ControlWrite {
    type Err = PoseError;

    fn from_str(text: &str) -> Result<Self, PoseError> {
        let wrong = || PoseError::Syntax(text.to_owned());
        let (target, value) = text.rsplit_once('=').ok_or_else(wrong)?;
        let (node, channel) = target.trim().rsplit_once('.').ok_or_else(wrong)?;
        let node = node.trim().to_owned();
        let number = |text: &str| text.trim().parse::<f32>().ok().filter(|number| number.is_finite()).ok_or_else(wrong);
        let vector = || -> Result<Vec3, PoseError> {
            let inner = value.trim().strip_prefix('(').and_then(|text| text.strip_suffix(')')).ok_or_else(wrong)?;
            let numbers = inner.split(',').map(number).collect::<Result<Vec<f32>, _>>()?;
            <[f32; 3]>::try_from(numbers).map(Vec3::from).map_err(|_| wrong())
        };
        let value = match channel.trim() {
            "translate" => WriteValue::Translate(vector()?),
            "rotate" => WriteValue::Rotate(vector()?),
            "scale" => WriteValue::Scale(vector()?),
            "" => return Err(wrong()),
            _ if value.trim().is_empty() => return Err(wrong()),
            attribute => WriteValue::AttributeText(attribute.to_owned(), value.trim().to_owned()),
        };
        if node.is_empty() { Err(wrong()) } else { Ok(Self { node, value }) }
    }
}

impl Workbench {
    /// Builds, steps or rolls back the rig, as a [`BuildRequest`] in an app does.
    pub fn build(&mut self, step: BuildStep) -> RunReport {
        self.app.world_mut().resource_mut::<Messages<BuildDone>>().clear();
        self.app.world_mut().write_message(BuildRequest { rig: self.rig, step });
        self.app.update();
        let done = self.app.world_mut().resource_mut::<Messages<BuildDone>>().drain().last();
        done.map(|done| done.report).unwrap_or_default()
    }

    /// Processor of the rig; `None` before the first build.
    pub fn processor(&self) -> Option<&Processor> {
        self.app.world().get::<Processor>(self.rig)
    }

    /// Running program of the rig.
    ///
    /// # Errors
    /// If the rig is not built, or the built rig cannot run.
    pub fn runtime(&self) -> Result<&RigRuntime, PoseError> {
        let world = self.app.world();
        if let Some(failure) = world.get::<RunFailure>(self.rig) {
            return Err(PoseError::CannotRun(NamedProgramError::new(failure.0.clone(), self.rig())));
        }
        world.get::<RigRuntime>(self.rig).ok_or(PoseError::NotBuilt)
    }

    /// Writes values to the entities of controls and nodes, and runs one frame.
    ///
    /// # Errors
    /// See [`PoseError`]. Nothing is written then, unless the pose has no finite place for a node.
    pub fn pose(&mut self, writes: &[ControlWrite]) -> Result<(), PoseError> {
        self.pose_through(writes, &[]).map(drop)
    }

    /// Writes values as [`pose`](Self::pose) does, then sets switches, each given by name and value, which keep that pose as
    /// [`switch`](Self::switch) does, then writes the values once more, for controls that the switches moved. Returns the values
    /// that locks and limits hold.
    ///
    /// # Errors
    /// See [`PoseError`].
    pub fn pose_through(
        &mut self,
        writes: &[ControlWrite],
        switches: &[(&str, &str)],
    ) -> Result<Vec<HeldValue>, PoseError> {
        self.runtime()?;
        let mut found: Vec<NodeWrite> = Vec::with_capacity(writes.len());
        for write in writes {
            let node = self.find_node(&write.node, &write.value)?;
            let value = write.value.on(&node)?;
            found.push((self.entity(node.uid).ok_or(PoseError::NotBuilt)?, node, value));
        }
        self.check_range(&found)?;
        self.write_values(&found)?;
        let mut thrown: Vec<(Uid, String)> = Vec::new();
        for (name, value) in switches {
            thrown.extend(self.throw(name, value)?);
        }
        if !thrown.is_empty() {
            // A switch stands as it was thrown, whatever was written to it before.
            let is_switch = |(_, node, value): &NodeWrite| {
                thrown
                    .iter()
                    .any(|(control, attribute)| *control == node.uid && value.attribute() == Some(attribute.as_str()))
            };
            found.retain(|write| !is_switch(write));
            self.write_values(&found)?;
        }
        self.held_values(&found)
    }

    /// Writes values to entities, and runs one frame.
    fn write_values(&mut self, values: &[NodeWrite]) -> Result<(), PoseError> {
        let program = Arc::clone(self.runtime()?.state().program());
        for (entity, node, value) in values {
            let (entity, world) = (*entity, self.app.world_mut());
            if let WriteValue::Attribute(name, value) = value {
                if let Some(mut attributes) = world.get_mut::<Attributes>(entity) {
                    attributes.0.insert(name.clone(), *value);
                }
                continue;
            }
            let base = program.node(node.uid).map_or(node.base, |slot| program.nodes()[slot].base);
            let rest = RestTransform::from(base);
            let Some(mut transform) = world.get_mut::<Transform>(entity) else { continue };
            let before = PoseOffset::between(&rest, &transform);
            let offset = match *value {
                WriteValue::Translate(translation) => PoseOffset { translation, ..before },
                WriteValue::Rotate(degrees) => PoseOffset { rotation: rotation(degrees), ..before },
                WriteValue::Scale(scale) => PoseOffset { scale, ..before },
                WriteValue::Attribute(..) | WriteValue::AttributeText(..) => before,
            };
            *transform = offset.on(&rest);
        }
        self.app.update();
        self.runtime().map(drop)
    }

    /// Sets the switches that `name` matches, without moving the nodes that they match: see
    /// [`find_switches`](crate::plugins::controls::find_switches).
    ///
    /// # Errors
    /// The built rig has no such switch or value, or the rig is not built.
    pub fn switch(&mut self, name: &str, value: &str) -> Result<(), PoseError> {
        self.throw(name, value).map(drop)
    }

    /// Sets the switches that `name` matches; returns their controls and attributes.
    fn throw(&mut self, name: &str, value: &str) -> Result<Vec<(Uid, String)>, PoseError> {
        let mut thrown = Vec::new();
        for (control, attribute, value) in self.switches_named(name, value)? {
            thrown.push((control, attribute.clone()));
            self.app.world_mut().write_message(SwitchRequest { rig: self.rig, control, attribute, value });
            self.app.update();
            self.refused().map_or(Ok(()), Err)?;
        }
        Ok(thrown)
    }

    /// Runs `count` frames of a sixtieth of a second each, so that springs move. No other time passes in a workbench.
    ///
    /// # Errors
    /// If the time of [`Workbench::set_limits`] is over.
    pub fn frames(&mut self, count: u32) -> Result<(), WorkbenchError> {
        let step = TimeUpdateStrategy::ManualDuration(Duration::from_nanos(16_666_667));
        self.app.insert_resource(step);
        let done = (0..count).try_for_each(|_| {
            self.app.update();
            self.check_time("the frames")
        });
        self.app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
        done
    }

    /// Nodes of the built rig with the transforms of their entities and of the program.
    ///
    /// # Errors
    /// If the rig is not built or cannot run.
    pub fn nodes(&self) -> Result<Vec<PosedNode>, PoseError> {
        Ok(self.iter_nodes()?.collect())
    }

    /// Nodes as in [`nodes`](Self::nodes), made one after the other.
    ///
    /// # Errors
    /// If the rig is not built or cannot run.
    pub fn iter_nodes(&self) -> Result<impl Iterator<Item = PosedNode>, PoseError> {
        let (world, state) = (self.app.world(), self.runtime()?.state());
        let built = self.built().ok_or(PoseError::NotBuilt)?;
        let to_rig = world.get::<GlobalTransform>(self.rig).copied().unwrap_or_default().affine().inverse();
        let nodes = built.nodes.iter().filter_map(move |node| {
            let global = world.get::<GlobalTransform>(self.entity(node.uid)?)?;
            let entity = GlobalTransform::from(to_rig * global.affine()).compute_transform();
            let place = state.global(node.uid)?;
            let (translation, rotation, scale) = (place.translation, place.rotation, place.scale);
            let parent = node.parent.map(|parent| built.nodes[parent].uid);
            Some(PosedNode { node: node.clone(), parent, entity, program: Transform { translation, rotation, scale } })
        });
        Ok(nodes)
    }

    fn entity(&self, node: Uid) -> Option<Entity> {
        let world = self.app.world();
        let joint = world.get::<JointEntities>(self.rig)?.get(node);
        joint.or_else(|| world.get::<BuiltEntities>(self.rig)?.get(node))
    }
}

impl Workbench {
    /// Document with the pose and the attribute values that the entities have now, as it would be stored.
    ///
    /// # Errors
    /// If the rig is not built or cannot run.
    pub fn posed_document(&self) -> Result<Rig, PoseError> {
        let state = self.runtime()?.state();
        let mut rig = self.rig().clone();
        let mut edits = Vec::new();
        for (slot, node) in state.program().nodes().iter().enumerate() {
            let offset = Some(state.offset_at(slot)).filter(|offset| *offset != PoseOffset::IDENTITY);
            if rig.offset(node.uid).copied() != offset {
                edits.push(RigEdit::SetOffset(node.uid, offset));
            }
        }
        for (slot, attribute) in state.program().attributes().iter().enumerate().filter(|(_, known)| known.is_settable)
        {
            let (node, value) = (state.program().nodes()[attribute.node].uid, state.attribute_at(slot));
            let known = rig.attribute_value(node, &attribute.name).unwrap_or(attribute.default);
            if known.to_bits() != value.to_bits() {
                edits.push(RigEdit::SetAttributeValue(node, attribute.name.to_string(), Some(value)));
            }
        }
        let edits = RigEdit::Batch(edits);
        rig.apply(&edits).map_err(|error| WorkbenchError::Refused(error.into()))?;
        Ok(rig)
    }

    /// Transforms of the built nodes' entities relative to their parents, in the order of the nodes. A node that stands where
    /// it was built, but for rounding, has exactly the transform that it was built with: entities keep what they have where a
    /// run differs from it by rounding only, so theirs depends on what was before.
    ///
    /// # Errors
    /// If the rig is not built or cannot run.
    pub fn posed_nodes(&self) -> Result<Vec<Trs>, PoseError> {
        let built = self.built().ok_or(PoseError::NotBuilt)?;
        self.runtime()?;
        let local = |node: &BuiltNode| {
            let local = *self.app.world().get::<Transform>(self.entity(node.uid)?)?;
            let base =
                Transform { translation: node.base.translation, rotation: node.base.rotation, scale: node.base.scale };
            let Transform { translation, rotation, scale } = if is_near(&local, &base) { base } else { local };
            Some(Trs { translation, rotation, scale })
        };
        Ok(built.nodes.iter().map(|node| local(node).unwrap_or(node.base)).collect())
    }

    /// The posed rig alone: entities and program, which take several times its memory, are gone.
    ///
    /// # Errors
    /// If the rig is not built or cannot run.
    pub fn into_posed(mut self) -> Result<PosedRig, PoseError> {
        let nodes = self.posed_nodes()?;
        let world = self.app.world_mut();
        let built = Arc::clone(&world.get::<BuildResult>(self.rig).ok_or(PoseError::NotBuilt)?.0);
        // Tables of a copy would stand beside the app.
        let rig = world.get_mut::<Rig>(self.rig).map(|mut rig| std::mem::take(&mut *rig)).unwrap_or_default();
        Ok(PosedRig { rig, built, nodes })
    }
}

/// A rig in the pose that its entities had.
pub struct PosedRig {
    /// The document.
    pub rig: Rig,
    /// Result of its commands.
    pub built: Arc<BuiltRig>,
    /// Transforms of the built nodes, relative to their parents.
    pub nodes: Vec<Trs>,
}
