//! Values of changes as people read them: uids stand beside names only where the names do not identify.

use std::borrow::Cow;

use super::fields::tag_title;
use crate::rig::{
    Rig, TagKind, Uid,
    reference::{NameKind, NameScope, Names, RigNameIndex, without_uids},
};

/// Values of the two sides of a field. Uids that tell them apart stay.
pub(super) fn shown_values(field: &str, values: [Option<String>; 2], now: &Rig, file: &Rig) -> [Option<String>; 2] {
    if !values.iter().flatten().any(|value| value.contains('#')) {
        return values;
    }
    let names = NamesOfBoth { now: RigNameIndex::new(now), file: RigNameIndex::new(file) };
    let shown =
        [&values[0], &values[1]].map(|value| value.as_deref().map(|value| shown(field, value, &names, [now, file])));
    if shown[0] == shown[1] { values } else { shown }
}

fn shown(field: &str, value: &str, names: &NamesOfBoth, rigs: [&Rig; 2]) -> String {
    let joint_alone = |joint: &str| name_alone(joint, |name| names.find(NameScope::default(), NameKind::Joint, name));
    let kind = match field {
        // A label with a comma keeps its uid.
        "onto" => {
            let joints = value.strip_prefix('[').and_then(|list| list.strip_suffix(']')).unwrap_or(value);
            return format!("[{}]", joints.split(", ").map(joint_alone).collect::<Vec<_>>().join(", "));
        }
        "parent" | "mirror" | "joint" => NameKind::Joint,
        "group" => NameKind::Group,
        "feature" => return name_alone(value, |name| features(rigs, name)),
        _ => return without_uids(value, names, |_| true).into_owned(),
    };
    name_alone(value, |name| names.find(NameScope::default(), kind, name))
}

/// The name of a value `name#uid`, if `find` finds nothing else by it; else the value.
fn name_alone(value: &str, find: impl Fn(&str) -> Vec<Uid>) -> String {
    let named = value.rsplit_once('#').filter(|(name, uid)| {
        let uid = uid.parse::<Uid>().ok();
        !name.is_empty() && uid.is_some_and(|uid| find(name) == [uid])
    });
    named.map_or(value, |(name, _)| name).to_owned()
}

/// Features with a title in either rig.
fn features(rigs: [&Rig; 2], title: &str) -> Vec<Uid> {
    let tags = rigs.into_iter().flat_map(|rig| rig.walk().flat_map(|joint| &joint.data.tags));
    let mut found: Vec<Uid> = tags
        .filter(|tag| matches!(tag.kind, TagKind::Feature { .. }) && tag_title(tag) == title)
        .map(|tag| tag.uid)
        .collect();
    found.sort_unstable();
    found.dedup();
    found
}

/// Names in the rig as it is now and in the file: what has one name in one of them and another name in the other has both.
struct NamesOfBoth<'a> {
    now: RigNameIndex<'a>,
    file: RigNameIndex<'a>,
}

impl Names for NamesOfBoth<'_> {
    fn name_of(&self, kind: NameKind, uid: Uid) -> Option<Cow<'_, str>> {
        self.now.name_of(kind, uid).or_else(|| self.file.name_of(kind, uid))
    }

    fn find(&self, scope: NameScope, kind: NameKind, name: &str) -> Vec<Uid> {
        let mut found = self.now.find(scope, kind, name);
        let more = self.file.find(scope, kind, name);
        found.extend(more.into_iter().filter(|uid| !found.contains(uid)).collect::<Vec<Uid>>());
        found
    }

    fn all(&self, scope: NameScope, kind: NameKind) -> Vec<Cow<'_, str>> {
        self.now.all(scope, kind)
    }
}
