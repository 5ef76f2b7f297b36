//! `--feature` and `--group`: what of a rig is built.

use std::collections::BTreeSet;

use clap::Args;

use super::Failure;
use crate::rig::{
    Rig, RigEdit, Uid,
    feature::{CombinedFeature, FeatureError, choose_switch, commands_of, features_named, set_feature, set_switch},
    nearest::listed,
};

/// Switches of features and local groups.
#[derive(Args, Debug, Clone, Default)]
pub(super) struct SwitchArgs {
    /// Turns a feature or one of its switches on or off, or chooses one of its switches; may be repeated. GROUP: before
    /// the name means the feature of that local group alone, such as that of one limb
    #[arg(long, value_name = "[GROUP:]NAME=on|off|SWITCH|SWITCH=on|SWITCH=off")]
    feature: Vec<String>,
    /// Turns a local group on or off; may be repeated
    #[arg(long, value_name = "NAME=on|off")]
    group: Vec<String>,
}

impl SwitchArgs {
    /// True if nothing is switched.
    #[cfg(feature = "render")]
    pub fn is_empty(&self) -> bool {
        self.feature.is_empty() && self.group.is_empty()
    }

    /// Switches what the arguments say, in their order, features first.
    pub fn apply(&self, rig: &mut Rig) -> Result<(), Failure> {
        self.feature.iter().try_for_each(|wish| switch_feature(rig, wish))?;
        self.group.iter().try_for_each(|wish| switch_group(rig, wish))
    }
}

fn switch_feature(rig: &mut Rig, wish: &str) -> Result<(), Failure> {
    let wrong = |error: FeatureError| Failure::Usage(format!("--feature {wish}: {error}"));
    let (name, value) = pair("--feature", wish)?;
    // NAME=SWITCH=on and NAME=SWITCH=off, unless a feature is called so.
    let (name, switch) = match name.rsplit_once('=') {
        Some((feature, switch)) if features_named(rig, name).is_err() => (feature, Some(switch)),
        _ => (name, None),
    };
    let features = of_group(rig, wish, name)?;
    let switches: BTreeSet<String> =
        features.iter().flat_map(|feature| &feature.switches).map(|switch| switch.name.clone()).collect();
    let is_known = |switch: &str| switches.contains(switch);
    let is_right = match switch {
        Some(switch) => is_known(switch) && ["on", "off"].contains(&value),
        None => ["on", "off"].contains(&value) || is_known(value),
    };
    if !is_right {
        let known: String = switches.iter().map(|switch| format!(", {switch} or {switch}=off")).collect();
        return Err(Failure::Usage(format!("--feature {wish}: write {name}= and on, off{known}")));
    }
    for feature in features {
        let key = &feature.key;
        let has = |name: &str| feature.switches.iter().any(|switch| switch.name == name);
        let edits = match (switch, value) {
            (Some(switch), _) if !has(switch) => continue,
            (Some(switch), _) => set_switch(rig, key, switch, value == "on"),
            (None, "on" | "off") => set_feature(rig, key, value == "on"),
            // Of a feature without that switch there is nothing to choose.
            (None, _) if !has(value) => continue,
            (None, _) => choose_switch(rig, key, value),
        };
        for edit in edits.map_err(wrong)? {
            rig.apply(&edit).map_err(|error| Failure::Input(Box::new(error)))?;
        }
    }
    Ok(())
}

/// The features that `NAME` or `GROUP:NAME` means: of a group are those that it bears, and those whose commands are on its
/// joints.
fn of_group(rig: &Rig, wish: &str, name: &str) -> Result<Vec<CombinedFeature>, Failure> {
    let wrong = |error: FeatureError| Failure::Usage(format!("--feature {wish}: {error}"));
    let found = features_named(rig, name);
    let Some((group, inner)) = name.split_once(':').filter(|_| found.is_err()) else { return found.map_err(wrong) };
    let named = features_named(rig, inner).map_err(wrong)?;
    let name_of = |uid: Option<Uid>| uid.and_then(|uid| rig.group(uid)).map(|group| group.name.as_str());
    let has_commands = |feature: &CombinedFeature| {
        let mut commands = feature.tags.iter().flat_map(|tag| commands_of(rig, *tag));
        commands.any(|(joint, _)| name_of(rig.joint(joint).and_then(|joint| joint.data.group)) == Some(group))
    };
    let borne = named.iter().filter(|feature| name_of(feature.key.group) == Some(group));
    let mut inside: Vec<CombinedFeature> = borne.cloned().collect();
    if inside.is_empty() {
        inside = named.iter().filter(|feature| has_commands(feature)).cloned().collect();
    }
    if inside.is_empty() {
        let groups: BTreeSet<&str> = named.iter().filter_map(|feature| name_of(feature.key.group)).collect();
        let groups = if groups.is_empty() { "no group".to_owned() } else { listed(&Vec::from_iter(groups), "and") };
        let reason = format!("the group \"{group}\" has no feature \"{inner}\"; it is in {groups}");
        return Err(Failure::Usage(format!("--feature {wish}: {reason}")));
    }
    Ok(inside)
}

fn switch_group(rig: &mut Rig, wish: &str) -> Result<(), Failure> {
    let (name, value) = pair("--group", wish)?;
    let groups: Vec<_> = rig.groups().iter().filter(|group| group.name == name).cloned().collect();
    let enabled = match value {
        "on" => true,
        "off" => false,
        _ => return Err(Failure::Usage(format!("--group {wish}: write {name}=on or {name}=off"))),
    };
    if groups.is_empty() {
        let names: Vec<&str> = rig.groups().iter().map(|group| group.name.as_str()).collect();
        let names = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        return Err(Failure::Usage(format!("--group {wish}: there is no such group; the rig has: {names}")));
    }
    for mut group in groups {
        group.enabled = enabled;
        rig.apply(&RigEdit::SetLocalGroup(group)).map_err(|error| Failure::Input(Box::new(error)))?;
    }
    Ok(())
}

fn pair<'a>(option: &str, text: &'a str) -> Result<(&'a str, &'a str), Failure> {
    let wrong = || Failure::Usage(format!("{option} {text}: write NAME=VALUE, for example {text}=off"));
    text.rsplit_once('=').ok_or_else(wrong)
}
