//! Values of changes as people read them: uids stand beside names only where the names do not identify.

use std::{borrow::Cow, cell::OnceCell, collections::HashMap};

use super::fields::tag_title;
use crate::rig::{
    Rig, TagKind, Uid,
    reference::{NameKind, NameScope, Names, RigNameIndex, without_uids},
};

/// Values of the two sides of a field. Uids that tell them apart stay.
pub(super) fn shown_values(field: &str, values: [Option<String>; 2], names: &NamesOfBoth) -> [Option<String>; 2] {
    if !values.iter().flatten().any(|value| value.contains('#')) {
        return values;
    }
    let shown = [&values[0], &values[1]].map(|value| value.as_deref().map(|value| shown(field, value, names)));
    if shown[0] == shown[1] { values } else { shown }
}

fn shown(field: &str, value: &str, names: &NamesOfBoth) -> String {
    let joint_alone = |joint: &str| name_alone(joint, |name| names.find(NameScope::default(), NameKind::Joint, name));
    let kind = match field {
        // A label with a comma keeps its uid.
        "onto" => {
            let joints = value.strip_prefix('[').and_then(|list| list.strip_suffix(']')).unwrap_or(value);
            return format!("[{}]", joints.split(", ").map(joint_alone).collect::<Vec<_>>().join(", "));
        }
        "parent" | "mirror" | "joint" => NameKind::Joint,
        "group" => NameKind::Group,
        "feature" => return name_alone(value, |name| names.features(name).to_vec()),
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

/// Names in the rig as it is now and in the file, for all changes of an update: what has one name in one of them and another name
/// in the other has both.
pub(super) struct NamesOfBoth<'a> {
    rigs: [&'a Rig; 2],
    now: RigNameIndex<'a>,
    file: RigNameIndex<'a>,
    features: OnceCell<HashMap<String, Vec<Uid>>>,
}

impl<'a> NamesOfBoth<'a> {
    /// Names of two rigs.
    pub fn new(now: &'a Rig, file: &'a Rig) -> Self {
        let rigs = [now, file];
        Self { rigs, now: RigNameIndex::new(now), file: RigNameIndex::new(file), features: OnceCell::new() }
    }

    /// Features with a title in either rig, sorted.
    fn features(&self, title: &str) -> &[Uid] {
        let features = self.features.get_or_init(|| {
            let mut features: HashMap<String, Vec<Uid>> = HashMap::new();
            for tag in self.rigs.into_iter().flat_map(|rig| rig.walk().flat_map(|joint| &joint.data.tags)) {
                if matches!(tag.kind, TagKind::Feature { .. }) {
                    features.entry(tag_title(tag)).or_default().push(tag.uid);
                }
            }
            for list in features.values_mut() {
                list.sort_unstable();
                list.dedup();
            }
            features
        });
        features.get(title).map_or(&[], Vec::as_slice)
    }
}

impl Names for NamesOfBoth<'_> {
    fn name_of(&self, kind: NameKind, uid: Uid) -> Option<Cow<'_, str>> {
        self.now.name_of(kind, uid).or_else(|| self.file.name_of(kind, uid))
    }

    fn find(&self, scope: NameScope, kind: NameKind, name: &str) -> Vec<Uid> {
        let mut found = self.now.find(scope, kind, name);
        // Several things of one rig make the name ambiguous, whatever the other one has.
        if found.len() < 2 {
            let more = self.file.find(scope, kind, name);
            let known = found.first().copied();
            found.extend(more.into_iter().filter(|uid| Some(*uid) != known));
        }
        found
    }

    fn all(&self, scope: NameScope, kind: NameKind) -> Vec<Cow<'_, str>> {
        self.now.all(scope, kind)
    }
}
