//! Controls in an app: their visibility, and switches (inverse and forward kinematics, spaces) that keep the pose.
//!
//! A node is visible unless its layer is hidden, or its attribute [`VISIBLE`] is below one half. Commands drive that
//! attribute like any other, so the controls of inverse kinematics hide while a limb follows the forward ones.

pub mod density;
pub mod outline;
mod range;
pub mod size;
mod visibility;

use std::collections::BTreeSet;

use bevy::prelude::*;

use super::{
    RigSystems,
    commands::BuildResult,
    configure_sets,
    document::{EditRefusal, EditRequest},
    runtime::RigRuntime,
};
use crate::{
    rig::{
        AttributeKind, BuiltRig, Matching, Rig, SwitchData, Uid,
        feature::off_at,
        nearest::{listed, nearest},
        operations::Operation,
    },
    solve::matching::{MatchError, SwitchOverError, match_switch},
};

pub use range::{SwitchOverRequest, SwitchedOver, switch_over};

pub use crate::rig::VISIBLE;

/// Plugin of node visibility and switches.
pub struct ControlsPlugin;

impl Plugin for ControlsPlugin {
    fn build(&self, app: &mut App) {
        configure_sets(app);
        app.init_resource::<ControlsInUse>()
            .add_message::<SwitchRequest>()
            .add_message::<SwitchOverRequest>()
            .add_message::<SwitchedOver>()
            .add_message::<EditRequest>()
            .add_message::<EditRefusal>()
            .add_systems(Update, (throw_switches, range::throw_over).chain().in_set(RigSystems::Gesture))
            .register_type::<size::ShapeFactor>()
            .register_type::<density::CrowdedControl>()
            .add_systems(
                PostUpdate,
                (visibility::show_nodes.after(RigSystems::Solve), size::measure_shapes.after(RigSystems::Surface)),
            );
    }
}

/// True while controls are drawn, and picked before joints; false while a skeleton is drawn.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq)]
pub struct ControlsInUse(pub bool);

impl Default for ControlsInUse {
    fn default() -> Self {
        Self(true)
    }
}

/// True if a node is shown and can be picked; on every control and every node of a layer.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[component(immutable)]
#[reflect(Component)]
pub struct NodeVisible(pub bool);

/// Request to set the attribute of a switch (inverse and forward kinematics, spaces) while the nodes that the switch
/// matches keep their place: one step of the history.
#[derive(Message, Debug, Clone, PartialEq)]
pub struct SwitchRequest {
    /// The rig.
    pub rig: Entity,
    /// The node that carries the attribute.
    pub control: Uid,
    /// The attribute.
    pub attribute: String,
    /// Value to set.
    pub value: f32,
}

/// Reason why a switch was not set.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SwitchError {
    /// The built rig has no switch with that name.
    #[error("there is no switch \"{name}\" in the built rig{nearest}; switches: {known}")]
    NoSwitch {
        /// Requested name.
        name: String,
        /// Nearest name, as the rest of a sentence.
        nearest: String,
        /// Names of all switches.
        known: String,
    },
    /// The switch has no such value.
    #[error("switch \"{name}\" has no value \"{value}\"; write one of: {known}")]
    NoValue {
        /// The name of the switch.
        name: String,
        /// Requested value.
        value: String,
        /// Possible values.
        known: String,
    },
    /// The switch is not built, because something is off.
    #[error("switch \"{name}\" is not built: {off}; turn it on")]
    Off {
        /// Requested name.
        name: String,
        /// Clause about the group or the features that are off.
        off: String,
    },
    /// The switch has no such value while something is off.
    #[error("switch \"{name}\" has no value \"{value}\": {off}; turn it on, or write one of: {known}")]
    NoValueOff {
        /// The name of the switch.
        name: String,
        /// Requested value.
        value: String,
        /// Clause about the features that are off.
        off: String,
        /// Possible values.
        known: String,
    },
    /// The rig is not built, or cannot run.
    #[error("the rig is not built, so it has no switches; build it first")]
    NotBuilt,
    /// The rig has no such clip.
    #[error("the rig has no such clip; choose another one")]
    NoClip,
    /// See [`MatchError`].
    #[error(transparent)]
    Match(#[from] MatchError),
    /// See [`SwitchOverError`].
    #[error(transparent)]
    Over(#[from] SwitchOverError),
}

fn throw_switches(
    mut requests: MessageReader<SwitchRequest>,
    rigs: Query<(&BuildResult, &RigRuntime)>,
    mut commands: Commands,
) {
    for SwitchRequest { rig, control, attribute, value } in requests.read() {
        match edits_of(rigs.get(*rig).ok(), *control, attribute, *value) {
            Ok(operation) => {
                commands.write_message(EditRequest::operation(*rig, operation));
            }
            Err(error) => {
                commands.write_message(EditRefusal { rig: *rig, request: None, reason: error.into() });
            }
        }
    }
}

fn edits_of(
    rig: Option<(&BuildResult, &RigRuntime)>,
    control: Uid,
    attribute: &str,
    value: f32,
) -> Result<Operation, SwitchError> {
    let (built, runtime) = rig.ok_or(SwitchError::NotBuilt)?;
    let found = built.0.switches.iter().find(|switch| switch.control == control && *switch.attribute == *attribute);
    let switch = found.ok_or_else(|| SwitchError::NoSwitch {
        name: attribute.to_owned(),
        nearest: String::new(),
        known: names(&built.0),
    })?;
    let matched = match_switch(&built.0, runtime.state(), switch, value)?;
    let name = match switch.matching {
        Matching::IkFk { .. } => "Switch kinematics",
        Matching::Space { .. } => "Switch space",
    };
    Ok(Operation::Named { name, edits: matched.edits })
}

fn names(built: &BuiltRig) -> String {
    let names: Vec<String> = built.switches.iter().filter_map(|switch| name_of(built, switch)).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// Name of a switch: the name of its control, a dot, and its attribute.
fn name_of(built: &BuiltRig, switch: &SwitchData) -> Option<String> {
    built.node(switch.control).map(|node| format!("{}.{}", node.name, switch.attribute))
}

/// Switches that `name` matches, each as its control, its attribute and the number of `value`. A name is that of a
/// local group (`arm_l`), the label or the name of the control that carries the attribute, the label of a joint that
/// the switch matches, or `CONTROL.ATTRIBUTE`. A value is `ik`, `fk`, the name of a choice, or a number.
///
/// # Errors
/// No switch has the name, or none of them has the value; the error lists the possible ones.
pub fn find_switches(
    built: &BuiltRig,
    rig: &Rig,
    name: &str,
    value: &str,
) -> Result<Vec<(Uid, String, f32)>, SwitchError> {
    let is_meant = |switch: &&std::sync::Arc<SwitchData>| {
        let Some(control) = built.node(switch.control) else { return false };
        let matched = match &switch.matching {
            Matching::IkFk { joints, .. } => joints.clone(),
            Matching::Space { control } => vec![*control],
        };
        let of_node = |uid: &Uid| {
            let node = built.node(*uid);
            let group = node.and_then(|node| node.group).and_then(|group| rig.group(group));
            node.is_some_and(|node| node.label.as_deref() == Some(name))
                || group.is_some_and(|group| group.name == name)
        };
        *control.name == *name
            || control.label.as_deref() == Some(name)
            || name_of(built, switch).as_deref() == Some(name)
            || matched.iter().any(of_node)
    };
    let mut found = Vec::new();
    // Values of the switches that the name matches: a limb has kinematics and spaces.
    let mut possible: Vec<&str> = Vec::new();
    for switch in built.switches.iter().filter(is_meant) {
        let choices = choices(built, switch);
        match number_of(&choices, value) {
            Some(number) => found.push((switch.control, switch.attribute.to_string(), number)),
            None if choices.is_empty() => possible.push("a number"),
            None => possible.extend(choices),
        }
    }
    let off = if found.is_empty() { off_at(rig, name) } else { None };
    if found.is_empty() && possible.is_empty() {
        if let Some(off) = off.or_else(|| off_at_control(built, rig, name)) {
            return Err(SwitchError::Off { name: name.to_owned(), off });
        }
        let known: Vec<String> = built.switches.iter().filter_map(|switch| name_of(built, switch)).collect();
        let near = nearest(name, &known, 3);
        let nearest = if near.is_empty() { String::new() } else { format!("; did you mean {}?", listed(&near, "or")) };
        return Err(SwitchError::NoSwitch { name: name.to_owned(), nearest, known: names(built) });
    }
    if found.is_empty() {
        let mut seen = BTreeSet::new();
        possible.retain(|value| seen.insert(*value));
        let (name, value) = (name.to_owned(), value.to_owned());
        let known = possible.join(", ");
        return Err(match off {
            Some(off) => SwitchError::NoValueOff { name, value, off, known },
            None => SwitchError::NoValue { name, value, known },
        });
    }
    Ok(found)
}

/// Clause about what is off at the joint of the control that a switch is named by, as `CONTROL` or `CONTROL.ATTRIBUTE`.
fn off_at_control(built: &BuiltRig, rig: &Rig, name: &str) -> Option<String> {
    let stem = name.rsplit_once('.').map_or(name, |(control, _)| control);
    let control = built.nodes.iter().find(|node| *node.name == *name || *node.name == *stem)?;
    off_at(rig, control.label.as_deref()?)
}

/// Names of the values of a switch, in their order.
fn choices<'a>(built: &'a BuiltRig, switch: &SwitchData) -> Vec<&'a str> {
    let mut attributes = built.node(switch.control).into_iter().flat_map(|node| node.attributes.iter());
    match attributes.find(|known| known.name == switch.attribute).map(|known| &known.kind) {
        Some(AttributeKind::Choice(names)) => names.iter().map(String::as_str).collect(),
        _ if matches!(switch.matching, Matching::IkFk { .. }) => vec!["fk", "ik"],
        _ => Vec::new(),
    }
}

/// The number of a value that is one of `choices`, or a number itself.
pub(crate) fn number_of(choices: &[&str], value: &str) -> Option<f32> {
    let number = choices.iter().position(|choice| *choice == value).map(|number| number as f32);
    number.or_else(|| value.parse().ok().filter(|number: &f32| number.is_finite()))
}
