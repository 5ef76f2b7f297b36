//! Switches over a range of the open clip: which one, to which value, and over which range.

use bevy::prelude::*;

use super::{
    action::TimelineAction,
    state::{OpenClip, Timeline},
};
use crate::{
    editor::panels::{controls::values_of, node_menu::concerns},
    plugins::{commands::BuildResult, controls::SwitchOverRequest, document::Selection, runtime::RigRuntime},
    rig::{
        Matching, SwitchData, Uid,
        animation::{Property, TrackTarget},
    },
};

/// Seconds from the first to the last selected key, or of the whole clip if they are less than a frame apart.
pub(in crate::editor::panels) fn range(open: &OpenClip, timeline: &Timeline) -> [f32; 2] {
    let times = || timeline.keys.values().flatten().copied();
    let (first, last) = (times().fold(f32::MAX, f32::min), times().fold(f32::MIN, f32::max));
    if last - first >= 1.0 / open.clip.frame_rate { [first, last] } else { open.clip.range }
}

/// Request that gives a switch a value over the range of the timeline.
pub(in crate::editor::panels) fn requested(
    open: &OpenClip,
    timeline: &Timeline,
    switch: &SwitchData,
    value: f32,
) -> SwitchOverRequest {
    SwitchOverRequest {
        rig: open.entity,
        control: switch.control,
        attribute: switch.attribute.to_string(),
        value,
        clip: open.clip.uid,
        layer: open.layer.map(|layer| layer.uid),
        range: range(open, timeline),
    }
}

/// Reason why there is no switch to set, in a few words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NoSwitch {
    NotBuilt,
    NoClip,
    NothingSelected,
    NoSpaces,
    NoKinematics,
}

impl NoSwitch {
    /// The reason, for lists of actions.
    pub fn text(self) -> &'static str {
        match self {
            Self::NotBuilt => "the rig is not built",
            Self::NoClip => "no clip is open",
            Self::NothingSelected => "nothing is selected",
            Self::NoSpaces => "no control that has spaces is selected",
            Self::NoKinematics => "no control of a limb with IK and FK is selected",
        }
    }
}

/// Request of an action, for the first selected node that a switch concerns; or the reason why there is none, in a few words.
pub(super) fn request(world: &World, open: &OpenClip, action: TimelineAction) -> Result<SwitchOverRequest, NoSwitch> {
    let built = world.get::<BuildResult>(open.entity).map(|built| &built.0);
    let (Some(built), Some(runtime)) = (built, world.get::<RigRuntime>(open.entity)) else {
        return Err(NoSwitch::NotBuilt);
    };
    let timeline = world.get_resource::<Timeline>().ok_or(NoSwitch::NoClip)?;
    let selected = world.get::<Selection>(open.entity).map_or(&[] as &[Uid], |selection| &selection.0);
    if selected.is_empty() {
        return Err(NoSwitch::NothingSelected);
    }
    let is_wanted = |switch: &&SwitchData| match switch.matching {
        Matching::IkFk { .. } => action == TimelineAction::SwitchKinematics,
        Matching::Space { .. } => action == TimelineAction::SwitchSpace,
    };
    let switches = || built.switches.iter().map(|switch| &**switch).filter(is_wanted);
    let of_node = |node: &Uid| switches().find(|switch| concerns(built, switch, *node));
    let Some(switch) = selected.iter().find_map(of_node) else {
        return Err(match action {
            TimelineAction::SwitchSpace => NoSwitch::NoSpaces,
            _ => NoSwitch::NoKinematics,
        });
    };
    let target = TrackTarget { node: switch.control, property: Property::Attribute(switch.attribute.to_string()) };
    let shown = || runtime.state().attribute(switch.control, &switch.attribute).unwrap_or_default();
    let now = open.clip.value(&target, range(open, timeline)[0]).map_or_else(shown, |value| value[0]);
    let count = built.node(switch.control).map_or(2, |node| values_of(node, switch).len()).max(1);
    let value = match switch.matching {
        Matching::IkFk { .. } if now >= 0.5 => 0.0,
        Matching::IkFk { .. } => 1.0,
        Matching::Space { .. } => ((now.round().max(0.0) as usize + 1) % count) as f32,
    };
    Ok(requested(open, timeline, switch, value))
}
