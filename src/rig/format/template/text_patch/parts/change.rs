//! Differences of joints and tags, in the words of a change.

use std::collections::HashSet;

use crate::rig::{
    JointData, TagData, TagKind, Uid,
    format::{
        layout::value_on_one_line,
        template::{quoted, rotation_text, shorthand::TAG_FIELDS, text_patch::canonical, vector},
        tree::{Item, Tree},
    },
    reference::{Names, RigNameIndex, bind_names, refresh_names, without_uids},
};

/// A field of a change that is written, or taken out where it has no value.
pub(super) type FieldChange = (&'static str, Option<String>);

/// Style of values in changes.
pub(super) struct Words<'d> {
    pub names: RigNameIndex<'d>,
    /// True for references without uids.
    pub with_names: bool,
}

impl Words<'_> {
    /// A value as it is written into the text.
    pub fn styled(&self, text: &str) -> String {
        if self.with_names { without_uids(text, &self.names, |_| true).into_owned() } else { text.to_owned() }
    }

    /// Parameters with the current names beside the uids.
    fn current(&self, params: &str) -> String {
        refresh_names(&bind_names(params, &self.names).0, &self.names).into_owned()
    }

    /// Returns `true` if two tags say something different.
    pub fn differ(&self, a: &TagData, b: &TagData) -> bool {
        let compared = |tag: &TagData| {
            let mut tag = tag.clone();
            if let TagKind::Command { params, .. } = &mut tag.kind {
                *params = canonical(&self.current(params));
            }
            tag
        };
        compared(a) != compared(b)
    }
}

/// A tag on one line, in the short form; `None` for one that does not fit into it.
pub(in super::super) fn short_tag(names: &dyn Names, tag: &TagData, features: &HashSet<Uid>) -> Option<String> {
    let mut fields = vec![format!("uid: \"{}\"", tag.uid)];
    if !tag.enabled {
        fields.push("enabled: false".to_owned());
    }
    if !tag.comment.is_empty() {
        fields.push(format!("comment: {}", quoted(&tag.comment)));
    }
    let name = match &tag.kind {
        TagKind::Command { module, params, feature } => {
            let params = value_on_one_line(&refresh_names(params, names));
            let tree = Tree::parse(&params)?;
            let node = tree.node(tree.root());
            let fits = |item: &Item| item.key.is_some_and(|key| !TAG_FIELDS.contains(&key));
            let is_name = module.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
                && module.starts_with(|c: char| c.is_ascii_lowercase());
            if node.bracket != Some('(')
                || !node.items.iter().all(fits)
                || !is_name
                || params.contains('\n')
                || params.contains("/*")
            {
                return None;
            }
            let feature = feature.filter(|feature| features.contains(feature));
            fields.extend(feature.map(|feature| format!("feature: \"{feature}\"")));
            let value = |item: &Item| format!("{}: {}", item.key.unwrap_or_default(), tree.written(item.value));
            fields.extend(node.items.iter().map(value));
            module.as_str()
        }
        TagKind::Feature { kind, name, switch, choice } => {
            fields.push(format!("kind: {}", quoted(kind)));
            let others = [("name", name), ("switch", switch), ("choice", choice)];
            let said = others.iter().filter(|(_, text)| !text.is_empty());
            fields.extend(said.map(|(field, text)| format!("{field}: {}", quoted(text))));
            "Feature"
        }
    };
    Some(format!("{name}({})", fields.join(", ")))
}

/// A joint before and after a change, and as the part gives it.
pub(super) struct JointDiff<'d> {
    pub before: &'d JointData,
    pub now: &'d JointData,
    pub plain: &'d JointData,
    /// Label that the joint has without changes.
    pub label: Option<&'d str>,
}

impl JointDiff<'_> {
    /// Fields of the change that are different now.
    pub fn fields(&self) -> Vec<FieldChange> {
        let Self { before, now, plain, label } = *self;
        let mut fields = Vec::new();
        if before.label != now.label {
            let value = now.label.as_deref().filter(|now| Some(*now) != label);
            fields.push(("label", value.map(quoted)));
        }
        if before.locked != now.locked {
            fields.push(("locked", (now.locked != plain.locked).then(|| now.locked.to_string())));
        }
        let (was, is, of_part) = (&before.rest, &now.rest, &plain.rest);
        if was.translation != is.translation {
            let value = (is.translation != of_part.translation).then(|| vector(is.translation));
            fields.push(("translation", value));
        }
        if was.rotation != is.rotation {
            fields.push(("rotation", (is.rotation != of_part.rotation).then(|| rotation_text(is.rotation))));
        }
        if was.scale != is.scale {
            fields.push(("scale", (is.scale != of_part.scale).then(|| vector(is.scale))));
        }
        fields
    }
}

/// A tag before and after a change, and as the part gives it.
pub(super) struct TagDiff<'d, 'w> {
    pub before: &'d TagData,
    pub now: &'d TagData,
    pub plain: &'d TagData,
    pub words: &'d Words<'w>,
}

impl TagDiff<'_, '_> {
    /// Fields of the change that are different now, without its parameters.
    pub fn fields(&self) -> Vec<FieldChange> {
        let Self { before, now, plain, .. } = *self;
        let mut fields = Vec::new();
        if before.enabled != now.enabled {
            fields.push(("enabled", (now.enabled != plain.enabled).then(|| now.enabled.to_string())));
        }
        if before.comment != now.comment {
            fields.push(("comment", (now.comment != plain.comment).then(|| quoted(&now.comment))));
        }
        let (before, now, plain) = (self.values(before), self.values(now), self.values(plain));
        let missing = |values: &[(String, String)]| -> Vec<String> {
            let is_there = |key: &str| values.iter().any(|(other, _)| other == key);
            plain.iter().filter(|(key, _)| !is_there(key)).map(|(key, _)| quoted(key)).collect()
        };
        let unset = missing(&now);
        if unset != missing(&before) {
            fields.push(("unset", (!unset.is_empty()).then(|| format!("[{}]", unset.join(", ")))));
        }
        fields
    }

    /// Parameters that are different now, with their value where it is not that of the part.
    pub fn params(&self) -> Vec<(String, Option<String>)> {
        let (before, now, plain) = (self.values(self.before), self.values(self.now), self.values(self.plain));
        let find = |values: &[(String, String)], key: &str| {
            values.iter().find(|(other, _)| other == key).map(|(_, value)| value.clone())
        };
        let is_same = |a: &Option<String>, b: &Option<String>| match (a, b) {
            (Some(a), Some(b)) => canonical(a) == canonical(b),
            (a, b) => a.is_none() && b.is_none(),
        };
        let mut changed = Vec::new();
        for (key, value) in &now {
            let value = Some(value.clone());
            if !is_same(&find(&before, key), &value) {
                let is_of_part = is_same(&find(&plain, key), &value);
                let text = value.filter(|_| !is_of_part).map(|value| value_on_one_line(&self.words.styled(&value)));
                changed.push((key.clone(), text));
            }
        }
        let gone = before.iter().filter(|(key, _)| find(&now, key).is_none());
        changed.extend(gone.map(|(key, _)| (key.clone(), None)));
        changed
    }

    /// Parameters of a command by name.
    fn values(&self, tag: &TagData) -> Vec<(String, String)> {
        let TagKind::Command { params, .. } = &tag.kind else { return Vec::new() };
        let current = self.words.current(params);
        let Some(tree) = Tree::parse(&current) else { return Vec::new() };
        let items = tree.node(tree.root()).items;
        items.iter().filter_map(|item| Some((item.key?.to_owned(), tree.written(item.value).to_owned()))).collect()
    }
}
