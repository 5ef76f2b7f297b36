//! The registry of feature kinds.

use std::collections::BTreeMap;

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use crate::rig::{Rig, TagKind, Uid, nearest::did_you_mean};

/// A kind of feature. All kinds behave alike; they keep interfaces tidy.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FeatureKind {
    /// The name that tags hold, such as `ik`.
    pub name: String,
    /// The name people see.
    pub title: String,
    /// A sentence about its purpose.
    pub about: String,
    /// The icon's file name in `assets/modules/`.
    pub icon: String,
    /// The form's file name in `assets/modules/`.
    pub form: String,
}

/// The kinds of feature that are known. Games and tools add their own with [`FeatureKinds::register`].
#[derive(Resource, Debug, Clone, PartialEq, Eq)]
pub struct FeatureKinds {
    kinds: BTreeMap<String, FeatureKind>,
}

/// A feature whose kind is not registered. It works as any other; only its icon and form are missing.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the feature \"{name}\" on joint {joint_label} is of the kind \"{kind}\", which is not registered{hint}")]
pub struct UnknownKind {
    /// The joint that carries the tag.
    pub joint: Uid,
    /// Label of the joint, or its uid where it has none.
    pub joint_label: String,
    /// The tag.
    pub tag: Uid,
    /// Name of the feature.
    pub name: String,
    /// The kind it names.
    pub kind: String,
    /// The end of the sentence: kinds that may be meant.
    pub hint: String,
}

/// Name, title and purpose of the built-in kinds.
const BUILT_IN: [(&str, &str, &str); 12] = [
    ("generic", "Feature", "Anything that fits no other kind."),
    ("limb", "Limb", "An arm, a leg or a part of one."),
    ("spine", "Spine", "The trunk: spine, neck or tail."),
    ("hand", "Hand", "Fingers and what poses them."),
    ("foot", "Foot", "Foot roll and toes."),
    ("face", "Face", "Jaw, eyes, brows, lips."),
    ("ik", "IK", "Controls for inverse kinematics."),
    ("fk", "FK", "Controls for forward kinematics."),
    ("space", "Spaces", "Space switching."),
    ("deform", "Deformation", "Twist, stretch and volume."),
    ("dynamics", "Dynamics", "Springs and other motion that follows."),
    ("display", "Display", "Layers, shapes and colours."),
];

impl Default for FeatureKinds {
    fn default() -> Self {
        let mut kinds = Self { kinds: BTreeMap::new() };
        for (name, title, about) in BUILT_IN {
            kinds.register(FeatureKind::new(name, title, about));
        }
        kinds
    }
}

impl FeatureKind {
    /// A kind whose icon is `feature_NAME.svg` and whose form is that of all features.
    pub fn new(name: impl Into<String>, title: impl Into<String>, about: impl Into<String>) -> Self {
        let name = name.into();
        Self {
            icon: format!("feature_{name}.svg"),
            form: "feature.ui.ron".to_owned(),
            title: title.into(),
            about: about.into(),
            name,
        }
    }
}

impl FeatureKinds {
    /// Adds a kind; returns the kind of that name that it replaces.
    pub fn register(&mut self, kind: FeatureKind) -> Option<FeatureKind> {
        self.kinds.insert(kind.name.clone(), kind)
    }

    /// The kind with that name.
    pub fn get(&self, name: &str) -> Option<&FeatureKind> {
        self.kinds.get(name)
    }

    /// Kinds of feature, by name.
    pub fn iter(&self) -> impl Iterator<Item = &FeatureKind> {
        self.kinds.values()
    }

    /// The features of a rig whose kinds are not registered.
    pub fn unknown_in(&self, rig: &Rig) -> Vec<UnknownKind> {
        let tags = rig.walk().flat_map(|joint| joint.data.tags.iter().map(move |tag| (&joint.data, tag)));
        tags.filter_map(|(joint, tag)| match &tag.kind {
            TagKind::Feature { kind, name, .. } if self.get(kind).is_none() => Some(UnknownKind {
                joint: joint.uid,
                joint_label: joint.label.clone().unwrap_or_else(|| joint.uid.to_string()),
                tag: tag.uid,
                name: name.clone(),
                kind: kind.clone(),
                hint: did_you_mean(kind, self.kinds.keys()),
            }),
            _ => None,
        })
        .collect()
    }
}
