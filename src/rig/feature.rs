//! Features: turning commands on and off together.
//!
//! A command is active if it is enabled itself, its joint's local group is enabled and its feature, if it has one, is.
//! Features of one kind and name within one local group act as one, a [`CombinedFeature`]; a switch is a secondary name
//! that turns a part of it on and off, or chooses one part of several. A feature without a name only organises: it
//! turns its commands on and off, but is never part of a combined feature and never listed.

mod kinds;

use std::collections::{BTreeSet, HashMap};

use serde::{Deserialize, Serialize};

use crate::rig::{JointData, Rig, RigEdit, TagData, TagKind, Uid, nearest::did_you_mean};

pub use kinds::{FeatureKind, FeatureKinds, UnknownKind};

/// Key of a combined feature.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct FeatureKey {
    /// The local group; `None` for joints without one.
    pub group: Option<Uid>,
    /// The kind, from the registry.
    pub kind: String,
    /// The name animators see, not empty.
    pub name: String,
}

/// Features of one kind and name in one local group.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CombinedFeature {
    /// Group, kind and name.
    pub key: FeatureKey,
    /// State of its tags, whatever their switch.
    pub state: FeatureState,
    /// Parts with a switch, in the order of the document.
    pub switches: Vec<FeatureSwitch>,
    /// Tags of the feature, in the order of the document.
    pub tags: Vec<Uid>,
}

/// A part of a combined feature.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FeatureSwitch {
    /// The secondary name.
    pub name: String,
    /// State of the part's tags.
    pub state: FeatureState,
    /// The part's tags.
    pub tags: Vec<Uid>,
}

/// State of tags that act together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FeatureState {
    /// All tags are enabled.
    On,
    /// No tag is enabled.
    Off,
    /// Some tags are enabled.
    Mixed,
}

/// Error of turning features on or off.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FeatureError {
    /// No such feature.
    #[error("there is no feature \"{0}\" of kind \"{1}\" there{2}")]
    NoFeature(String, String, String),
    /// No feature with that name anywhere.
    #[error("no feature of the rig is named \"{0}\"{1}")]
    NoName(String, String),
    /// No such switch.
    #[error("the feature \"{0}\" has no switch \"{1}\"{2}")]
    NoSwitch(String, String, String),
}

/// Returns `true` if a build runs the command (or counts the feature): it is enabled, and so are its joint's local
/// group and its feature. A deleted feature turns nothing off.
pub fn is_active(rig: &Rig, joint: &JointData, tag: &TagData) -> bool {
    let in_group = joint.group.and_then(|group| rig.group(group)).is_none_or(|group| group.enabled);
    let in_feature = match &tag.kind {
        TagKind::Command { feature: Some(feature), .. } => feature_enabled(rig, *feature),
        _ => true,
    };
    tag.enabled && in_group && in_feature
}

fn feature_enabled(rig: &Rig, feature: Uid) -> bool {
    rig.find_tag(feature).is_none_or(|(_, tag)| tag.enabled || !matches!(tag.kind, TagKind::Feature { .. }))
}

/// The commands of a feature tag, in the order of the document, with their joints.
pub fn commands_of(rig: &Rig, feature: Uid) -> impl Iterator<Item = (Uid, &TagData)> {
    let tags = rig.walk().flat_map(|joint| joint.data.tags.iter().map(move |tag| (joint.data.uid, tag)));
    tags.filter(move |(_, tag)| matches!(tag.kind, TagKind::Command { feature: Some(own), .. } if own == feature))
}

/// The combined features of a rig: groups in the rig's order (joints without one first), then as they come first in
/// the document. Features without a name are not among them.
pub fn combined_features(rig: &Rig) -> Vec<CombinedFeature> {
    let mut found: Vec<(CombinedFeature, Vec<(&str, bool)>)> = Vec::new();
    let mut known: HashMap<(Option<Uid>, &str, &str), usize> = HashMap::new();
    for joint in rig.walk() {
        for tag in &joint.data.tags {
            let TagKind::Feature { kind, name, switch } = &tag.kind else { continue };
            if name.is_empty() {
                continue;
            }
            let number = *known.entry((joint.data.group, kind, name)).or_insert_with(|| {
                let key = FeatureKey { group: joint.data.group, kind: kind.clone(), name: name.clone() };
                let feature = CombinedFeature { key, state: FeatureState::Off, switches: Vec::new(), tags: Vec::new() };
                found.push((feature, Vec::new()));
                found.len() - 1
            });
            let (feature, parts) = &mut found[number];
            feature.tags.push(tag.uid);
            parts.push((switch, tag.enabled));
        }
    }
    let place = |group: Option<Uid>| group.and_then(|uid| rig.groups().iter().position(|group| group.uid == uid));
    found.sort_by_key(|(feature, _)| place(feature.key.group));
    found.into_iter().map(|(feature, parts)| with_switches(feature, &parts)).collect()
}

/// The combined features with that name, of any kind and in any local group, as for a name that a person types.
///
/// # Errors
/// [`FeatureError::NoName`] with the nearest names if there is none.
pub fn features_named(rig: &Rig, name: &str) -> Result<Vec<CombinedFeature>, FeatureError> {
    let all = combined_features(rig);
    let names: BTreeSet<String> = all.iter().map(|feature| feature.key.name.clone()).collect();
    let found: Vec<_> = all.into_iter().filter(|feature| feature.key.name == name).collect();
    match found.is_empty() {
        true => Err(FeatureError::NoName(name.to_owned(), did_you_mean(name, names))),
        false => Ok(found),
    }
}

/// The edits that turn a combined feature on or off, all its parts with it.
///
/// # Errors
/// [`FeatureError::NoFeature`].
pub fn set_feature(rig: &Rig, key: &FeatureKey, on: bool) -> Result<Vec<RigEdit>, FeatureError> {
    let feature = find(rig, key)?;
    Ok(enabling(rig, feature.tags.into_iter().map(|tag| (tag, on))))
}

/// The edits that turn one part of a combined feature on or off and leave the others.
///
/// # Errors
/// [`FeatureError::NoFeature`] and [`FeatureError::NoSwitch`].
pub fn set_switch(rig: &Rig, key: &FeatureKey, switch: &str, on: bool) -> Result<Vec<RigEdit>, FeatureError> {
    let feature = find(rig, key)?;
    let part = part(&feature, switch)?;
    Ok(enabling(rig, part.tags.iter().map(|tag| (*tag, on))))
}

/// The edits that turn one part of a combined feature on and all other parts with a switch off; tags without a switch
/// belong to all parts and are turned on.
///
/// # Errors
/// [`FeatureError::NoFeature`] and [`FeatureError::NoSwitch`].
pub fn choose_switch(rig: &Rig, key: &FeatureKey, switch: &str) -> Result<Vec<RigEdit>, FeatureError> {
    let feature = find(rig, key)?;
    part(&feature, switch)?;
    let others: BTreeSet<Uid> = feature.others(switch).flat_map(|part| part.tags.iter().copied()).collect();
    Ok(enabling(rig, feature.tags.iter().map(|tag| (*tag, !others.contains(tag)))))
}

impl CombinedFeature {
    /// Names of the parts that are on.
    pub fn active_switches(&self) -> impl Iterator<Item = &str> {
        self.switches.iter().filter(|part| part.state == FeatureState::On).map(|part| part.name.as_str())
    }

    fn others(&self, switch: &str) -> impl Iterator<Item = &FeatureSwitch> {
        self.switches.iter().filter(move |part| part.name != switch)
    }
}

fn with_switches(mut feature: CombinedFeature, parts: &[(&str, bool)]) -> CombinedFeature {
    feature.state = state(parts.iter().map(|(_, enabled)| *enabled));
    for (number, (name, _)) in parts.iter().enumerate() {
        let is_first = parts[..number].iter().all(|(other, _)| other != name);
        if name.is_empty() || !is_first {
            continue;
        }
        let own = parts.iter().zip(&feature.tags).filter(|((other, _), _)| other == name);
        let (enabled, tags): (Vec<bool>, Vec<Uid>) = own.map(|((_, enabled), tag)| (*enabled, *tag)).unzip();
        feature.switches.push(FeatureSwitch { name: (*name).to_owned(), state: state(enabled.into_iter()), tags });
    }
    feature
}

fn state(mut enabled: impl Iterator<Item = bool>) -> FeatureState {
    let Some(first) = enabled.next() else { return FeatureState::Off };
    match enabled.all(|other| other == first) {
        true if first => FeatureState::On,
        true => FeatureState::Off,
        false => FeatureState::Mixed,
    }
}

fn find(rig: &Rig, key: &FeatureKey) -> Result<CombinedFeature, FeatureError> {
    let mut all = combined_features(rig);
    match all.iter().position(|feature| feature.key == *key) {
        Some(place) => Ok(all.swap_remove(place)),
        None => {
            let names = all.iter().filter(|other| other.key.group == key.group).map(|other| &other.key.name);
            Err(FeatureError::NoFeature(key.name.clone(), key.kind.clone(), did_you_mean(&key.name, names)))
        }
    }
}

fn part<'a>(feature: &'a CombinedFeature, switch: &str) -> Result<&'a FeatureSwitch, FeatureError> {
    feature.switches.iter().find(|part| part.name == switch).ok_or_else(|| {
        let names = feature.switches.iter().map(|part| &part.name);
        FeatureError::NoSwitch(feature.key.name.clone(), switch.to_owned(), did_you_mean(switch, names))
    })
}

/// The edits that enable or disable tags; tags in the wanted state need none.
fn enabling(rig: &Rig, tags: impl Iterator<Item = (Uid, bool)>) -> Vec<RigEdit> {
    let edit = |(tag, enabled)| {
        let (joint, tag) = rig.find_tag(tag)?;
        let next = TagData { enabled, ..tag.clone() };
        (tag.enabled != enabled).then(|| RigEdit::SetTag(joint.data.uid, Box::new(next)))
    };
    tags.filter_map(edit).collect()
}
