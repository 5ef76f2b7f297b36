//! Part instances of two versions of a template that are one: the pairs are those that comparing each with each finds.

use std::collections::BTreeMap;

use bevy::math::Vec3;
use rigsmith::rig::{RestTransform, Uid, UidSource, part::PartInstance, update::same_parts};

fn derived(part: &PartInstance) -> Uid {
    let joints = part.onto.join(" ");
    let title = if part.name.is_empty() { joints.as_str() } else { part.name.as_str() };
    Uid::derived(["part instance", part.part.as_str(), title])
}

type Rule = fn(&PartInstance, &PartInstance) -> bool;

fn are_alike(old: &PartInstance, new: &PartInstance) -> bool {
    old.name.is_empty() && new.name.is_empty() && old.prefix == new.prefix && old.mirror == new.mirror
}

const RULES: [Rule; 5] = [
    |old, new| !old.name.is_empty() && old.name == new.name,
    |old, new| !old.onto.is_empty() && old.onto == new.onto && are_alike(old, new),
    |old, new| {
        let place = |of: &PartInstance| (of.adds, of.mirror, of.rest, of.parent.clone(), of.onto.clone());
        old.part == new.part && place(old) == place(new)
    },
    |old, new| old.part == new.part && are_alike(old, new),
    |old, new| {
        let labels = |of: &PartInstance| (of.part.clone(), of.prefix.clone(), of.mirror);
        !old.prefix.is_empty() && labels(old) == labels(new)
    },
];

/// Pairs by comparing each instance with each.
fn pairs(own: &[PartInstance], other: &[PartInstance]) -> BTreeMap<Uid, Uid> {
    let alone = |list: &[PartInstance], others: &[PartInstance]| -> Vec<PartInstance> {
        list.iter().filter(|part| others.iter().all(|other| other.uid != part.uid)).cloned().collect()
    };
    let (mut gone, mut come) = (alone(own, other), alone(other, own));
    let mut same = BTreeMap::new();
    for rule in RULES {
        let is_derived = |part: &PartInstance| part.uid == derived(part);
        let are_one = |old: &PartInstance, new: &PartInstance| rule(old, new) && (is_derived(old) || is_derived(new));
        let mut found = BTreeMap::new();
        for new in &come {
            let olds: Vec<&PartInstance> = gone.iter().filter(|old| are_one(old, new)).collect();
            if let [old] = olds[..]
                && come.iter().filter(|rival| are_one(old, rival)).count() == 1
            {
                found.insert(new.uid, old.uid);
            }
        }
        gone.retain(|old| found.values().all(|uid| *uid != old.uid));
        come.retain(|new| !found.contains_key(&new.uid));
        same.extend(found);
    }
    same
}

#[test]
fn pairs_are_those_of_comparing_each_with_each() {
    let mut random = UidSource::seeded(5);
    let mut below = |count: u64| (random.next_uid().0 >> 20) % count;
    let mut by_count = [0; 4];
    for _ in 0..4_000 {
        let mut list = |first: u64| {
            let mut parts: Vec<PartInstance> = Vec::new();
            for number in 0..below(6) {
                let mut pick = |from: &[&str]| from[below(from.len() as u64) as usize].to_owned();
                let mut part = PartInstance {
                    part: pick(&["arm", "leg"]),
                    name: pick(&["", "", "a", "b"]),
                    prefix: pick(&["", "l_"]),
                    ..PartInstance::default()
                };
                part.onto = Some(pick(&["", "x", "y"])).filter(|label| !label.is_empty()).into_iter().collect();
                part.parent = Some(pick(&["", "hip"])).filter(|label| !label.is_empty());
                part.mirror = below(4) == 0;
                let place = [0.0, -0.0, 1.0][below(3) as usize];
                part.rest = RestTransform::from_translation(Vec3::new(place, 0.0, 0.0));
                part.uid = if below(3) == 0 { Uid(first + number) } else { derived(&part) };
                if parts.iter().all(|other| other.uid != part.uid) {
                    parts.push(part);
                }
            }
            parts
        };
        let (own, other) = (list(1), list(100));
        let found = same_parts(&own, &other);
        assert_eq!(found, pairs(&own, &other), "{own:#?} {other:#?}");
        by_count[found.len().min(3)] += 1;
    }
    assert!(by_count.iter().all(|count| *count > 5), "{by_count:?}");
}

/// Thousands of instances of one part are paired by their prefixes.
#[test]
fn thousands_of_renamed_parts_are_paired() {
    let list = |name: &str| -> Vec<PartInstance> {
        let part = |number: usize| {
            let (name, prefix) = (format!("{name}{number}"), format!("p{number}_"));
            let mut part = PartInstance { part: "arm".to_owned(), name, prefix, ..PartInstance::default() };
            part.uid = derived(&part);
            part
        };
        (0..20_000).map(part).collect()
    };
    assert_eq!(same_parts(&list("old"), &list("new")).len(), 20_000);
}
