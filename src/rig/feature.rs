//! Features: turning commands on and off together.
//!
//! A command is active if it is enabled itself, its joint's local group is enabled and its feature, if it has one, is.
//! Features of one kind and name within one local group act as one, a [`CombinedFeature`]; a switch is a secondary name
//! that turns a part of it on and off, or chooses one part of several. A feature without a name only organises: it
//! turns its commands on and off, but is never part of a combined feature and never listed. Switches of one choice
//! exclude each other (one solver or another): while the feature is on, exactly one of them is.

mod kinds;

use std::collections::{BTreeMap, BTreeSet, HashMap};

use serde::{Deserialize, Serialize};

use crate::rig::{
    JointData, Rig, RigEdit, TagData, TagKind, Uid,
    nearest::{did_you_mean, listed},
};

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
    /// Choice to which the part belongs, of whose parts one is on at most; empty for a switch of its own.
    pub choice: String,
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
    /// Tags of both states: one at least is enabled, and one is not.
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
    /// A switch of a choice, which another one turns off.
    #[error("\"{switch}\" is one of a choice of the feature \"{feature}\"; turn on {others} instead")]
    Chosen {
        /// Name of the feature.
        feature: String,
        /// The switch.
        switch: String,
        /// The others of the choice.
        others: String,
    },
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

/// The local group that is off, or the features that are off, on the joints of a local group or of a label with this
/// name; a clause such as `the feature ik is off`, or `None`.
pub fn off_at(rig: &Rig, name: &str) -> Option<String> {
    let named = |uid: Uid| rig.group(uid).filter(|group| group.name == name);
    let is_meant = |joint: &JointData| joint.label.as_deref() == Some(name) || joint.group.and_then(named).is_some();
    let mut features: BTreeSet<&str> = BTreeSet::new();
    for joint in rig.walk().map(|joint| &joint.data).filter(|joint| is_meant(joint)) {
        if let Some(group) = joint.group.and_then(|group| rig.group(group)).filter(|group| !group.enabled) {
            return Some(format!("the group {} is off", group.name));
        }
        let commands = joint.tags.iter().filter_map(|tag| match &tag.kind {
            TagKind::Command { feature, .. } => *feature,
            TagKind::Feature { .. } => None,
        });
        let off = commands.filter_map(|feature| rig.find_tag(feature)).filter(|(_, feature)| !feature.enabled);
        features.extend(off.filter_map(|(_, feature)| match &feature.kind {
            TagKind::Feature { name, .. } if !name.is_empty() => Some(name.as_str()),
            _ => None,
        }));
    }
    let features: Vec<&str> = features.into_iter().collect();
    match features[..] {
        [] => None,
        [feature] => Some(format!("the feature {feature} is off")),
        _ => Some(format!("the features {} are off", features.join(", "))),
    }
}

/// The commands of a feature tag, in the order of the document, with their joints.
pub fn commands_of(rig: &Rig, feature: Uid) -> impl Iterator<Item = (Uid, &TagData)> {
    let tags = rig.walk().flat_map(|joint| joint.data.tags.iter().map(move |tag| (joint.data.uid, tag)));
    tags.filter(move |(_, tag)| matches!(tag.kind, TagKind::Command { feature: Some(own), .. } if own == feature))
}

/// The combined features of a rig: groups in the rig's order (joints without one first), then as they come first in
/// the document. Features without a name are not among them.
pub fn combined_features(rig: &Rig) -> Vec<CombinedFeature> {
    let mut found: Vec<(CombinedFeature, Vec<FeaturePart>)> = Vec::new();
    let mut known: HashMap<(Option<Uid>, &str, &str), usize> = HashMap::new();
    for joint in rig.walk() {
        for tag in &joint.data.tags {
            let TagKind::Feature { kind, name, switch, choice } = &tag.kind else { continue };
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
            parts.push(FeaturePart { switch, choice, enabled: tag.enabled });
        }
    }
    let place = |group: Option<Uid>| group.and_then(|uid| rig.groups.place(uid));
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

/// The edits that turn a combined feature on or off, all its parts with it. Of each choice one part is turned on: the
/// first that is on, or the first of all.
///
/// # Errors
/// [`FeatureError::NoFeature`].
pub fn set_feature(rig: &Rig, key: &FeatureKey, on: bool) -> Result<Vec<RigEdit>, FeatureError> {
    let feature = find(rig, key)?;
    let unchosen = if on { feature.unchosen() } else { BTreeSet::new() };
    Ok(enabling(rig, feature.tags.iter().map(|tag| (*tag, on && !unchosen.contains(tag)))))
}

/// Edits that turn one part of a combined feature on or off. Other parts stay as they are, except those of the same choice,
/// which are turned off.
///
/// # Errors
/// [`FeatureError::NoFeature`] and [`FeatureError::NoSwitch`]; [`FeatureError::Chosen`] for one of a choice that would be
/// turned off.
pub fn set_switch(rig: &Rig, key: &FeatureKey, switch: &str, on: bool) -> Result<Vec<RigEdit>, FeatureError> {
    let feature = find(rig, key)?;
    let part = part(&feature, switch)?;
    let rivals: Vec<&FeatureSwitch> =
        feature.others(switch).filter(|other| !part.choice.is_empty() && other.choice == part.choice).collect();
    if !on && !rivals.is_empty() && part.state != FeatureState::Off {
        let names: Vec<&str> = rivals.iter().map(|other| other.name.as_str()).collect();
        let (feature, others) = (feature.key.name.clone(), listed(&names, "or"));
        return Err(FeatureError::Chosen { feature, switch: switch.to_owned(), others });
    }
    let off = rivals.iter().flat_map(|other| &other.tags).filter(|_| on).map(|tag| (*tag, false));
    Ok(enabling(rig, part.tags.iter().map(|tag| (*tag, on)).chain(off)))
}

/// The edits after which of each choice that has one of these tags exactly one switch is on.
pub(in crate::rig) fn settled_choices(rig: &Rig, tags: &[Uid]) -> Vec<RigEdit> {
    let features = combined_features(rig);
    let chosen: BTreeSet<&Uid> = tags.iter().collect();
    let changed = features
        .iter()
        .filter(|feature| feature.state != FeatureState::Off && feature.tags.iter().any(|tag| chosen.contains(tag)));
    let settled = changed.flat_map(|feature| {
        let unchosen = feature.unchosen();
        let in_choice = feature.switches.iter().filter(|part| !part.choice.is_empty()).flat_map(|part| &part.tags);
        in_choice.map(move |tag| (*tag, !unchosen.contains(tag)))
    });
    enabling(rig, settled)
}

/// Choices of which not exactly one switch is on, though their feature is: the feature, the choice, and a tag of it.
pub fn undecided_choices(rig: &Rig) -> Vec<(FeatureKey, String, Uid)> {
    let mut found = Vec::new();
    for feature in combined_features(rig).into_iter().filter(|feature| feature.state != FeatureState::Off) {
        for (choice, parts) in feature.choices() {
            let is_decided = parts.iter().filter(|part| part.state == FeatureState::On).count() == 1
                && parts.iter().all(|part| part.state != FeatureState::Mixed);
            let tag = parts.iter().flat_map(|part| &part.tags).next();
            if let (false, Some(tag)) = (is_decided, tag) {
                found.push((feature.key.clone(), choice.to_owned(), *tag));
            }
        }
    }
    found
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

    /// The parts of each choice.
    fn choices(&self) -> BTreeMap<&str, Vec<&FeatureSwitch>> {
        let mut choices: BTreeMap<&str, Vec<&FeatureSwitch>> = BTreeMap::new();
        for part in self.switches.iter().filter(|part| !part.choice.is_empty()) {
            choices.entry(&part.choice).or_default().push(part);
        }
        choices
    }

    /// Tags of parts that stay off while the feature is on, because another part of their choice is on.
    fn unchosen(&self) -> BTreeSet<Uid> {
        let mut tags = BTreeSet::new();
        for parts in self.choices().into_values() {
            let on = parts.iter().position(|part| part.state != FeatureState::Off).unwrap_or(0);
            let others = parts.iter().enumerate().filter(|(place, _)| *place != on);
            tags.extend(others.flat_map(|(_, part)| part.tags.iter().copied()));
        }
        tags
    }
}

/// A tag of a combined feature.
struct FeaturePart<'a> {
    switch: &'a str,
    choice: &'a str,
    enabled: bool,
}

fn with_switches(mut feature: CombinedFeature, parts: &[FeaturePart]) -> CombinedFeature {
    // Tags of each switch, in the order in which the switches come.
    let mut numbers: HashMap<&str, usize> = HashMap::new();
    let mut switches: Vec<(&FeaturePart, Vec<(bool, Uid)>)> = Vec::new();
    for (part, tag) in parts.iter().zip(&feature.tags).filter(|(part, _)| !part.switch.is_empty()) {
        let number = *numbers.entry(part.switch).or_insert_with(|| {
            switches.push((part, Vec::new()));
            switches.len() - 1
        });
        switches[number].1.push((part.enabled, *tag));
    }
    for (FeaturePart { switch, choice, .. }, own) in switches {
        let (enabled, tags): (Vec<bool>, Vec<Uid>) = own.into_iter().unzip();
        let (name, choice) = ((*switch).to_owned(), (*choice).to_owned());
        feature.switches.push(FeatureSwitch { name, choice, state: state(enabled.into_iter()), tags });
    }
    // Of a choice one part counts: the others are off while the feature is on.
    let unchosen = feature.unchosen();
    let counts = |(part, tag): (&FeaturePart, &Uid)| (part.enabled || !unchosen.contains(tag)).then_some(part.enabled);
    feature.state = state(parts.iter().zip(&feature.tags).filter_map(counts));
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
