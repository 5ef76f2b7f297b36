//! Random edits of an animated character, reloads of its template and updates of its parts: keys of nodes that live are as they
//! were set, and undo brings back the first bytes.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use bevy::math::{Quat, Vec3};
use rigsmith::{
    files::{BUNDLED_PARTS, PartFiles},
    modules,
    plugins::{document::Selection, history::RigHistory},
    processor::Builder,
    rig::{
        GroupData, PoseOffset, Rig, RigEdit, Uid, UidSource,
        animation::{Key, NodeNames, Property, TrackTarget, orphaned_keys},
        operations::{ClipOperation, KeyOperation, Operation},
        project::{Project, ProjectRig, write_project},
        update::{Take, clip_edits, edits_between, pose_edits, update},
    },
};

use super::{BASE, CLIP, Random, animated, share, target};

/// Keys of the base layer by target and time, as they are expected.
type ExpectedKeys = BTreeMap<TrackTarget, BTreeMap<u32, Key>>;

fn keys_of(rig: &Rig) -> ExpectedKeys {
    let layer = &rig.clip(CLIP).unwrap().layers[0];
    let of = |key: &Key| (key.time.to_bits(), *key);
    layer.tracks.iter().map(|(target, track)| (target.clone(), track.keys.iter().map(of).collect())).collect()
}

/// Text of a project with a rig.
pub fn bytes(rig: &Rig) -> String {
    write_project(&Project { rigs: vec![ProjectRig { rig: rig.clone(), skins: Vec::new() }], ..Default::default() })
}

/// Versions of the biped's file, and the one that was taken over last.
pub struct TemplateVersions {
    rigs: Vec<Rig>,
    base: usize,
    reloads: usize,
}

impl TemplateVersions {
    /// The biped as it is, with changed files of parts, and with a changed file of its own.
    pub fn new() -> Self {
        let text = include_str!("../../../assets/templates/biped.rig.ron");
        let with_part = |part: &str, was: &str, is: &str| {
            let (_, content) = BUNDLED_PARTS.iter().find(|(name, _)| *name == part).unwrap();
            let changed = content.replacen(was, is, 1);
            assert_ne!(changed, *content, "{part} has no {was}");
            let files: BTreeMap<PathBuf, Option<Vec<u8>>> = [(PathBuf::from(part), Some(changed.into_bytes()))].into();
            PartFiles::given(&files).complete(Path::new("biped.rig.ron"), text.as_bytes()).unwrap().rig
        };
        let plain =
            PartFiles::given(&BTreeMap::new()).complete(Path::new("biped.rig.ron"), text.as_bytes()).unwrap().rig;
        let mut moved = plain.clone();
        let (tag, joint) = (plain.walk().find_map(|joint| joint.data.tags.first()).unwrap().uid, plain.roots()[0]);
        let other = *plain.children(Some(joint)).first().unwrap();
        moved.apply(&RigEdit::MoveTag { tag, joint: other, index: 0 }).unwrap();
        moved.apply(&RigEdit::SetLabel(other, Some("of another version".into()))).unwrap();
        let rigs = vec![
            with_part("parts/arm.rig.ron", "relative_size: 0.6", "relative_size: 0.7"),
            with_part("parts/leg.rig.ron", "translation: (0, 0.427641, 0)", "translation: (0, 0.43, 0)"),
            moved,
            plain,
        ];
        assert!(rigs[..3].iter().all(|version| *version != rigs[3]));
        Self { base: rigs.len() - 1, rigs, reloads: 0 }
    }

    /// The rig after an update to another version, with poses and clips as they are.
    pub fn updated(&mut self, rig: &Rig, random: &mut Random) -> Rig {
        let next = (self.base + 1 + random.below(self.rigs.len() - 1)) % self.rigs.len();
        let take = if random.chance(2) { Take::Mine } else { Take::Theirs };
        let updated = update(Some(&self.rigs[self.base]), rig, &self.rigs[next], take).rig;
        self.base = next;
        updated
    }

    /// The edits of a reload of another version that leaves keys as they are.
    fn reload(&mut self, rig: &Rig, random: &mut Random) -> Vec<RigEdit> {
        let updated = self.updated(rig, random);
        let mut edits = edits_between(rig, &updated).unwrap();
        edits.extend(pose_edits(rig, &updated));
        edits.extend(clip_edits(rig, &updated).unwrap());
        self.reloads += usize::from(!edits.is_empty());
        edits
    }
}

/// A change of the rig that is no change of its keys.
fn deed(rig: &Rig, random: &mut Random, versions: &mut TemplateVersions) -> Operation {
    let joints: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
    let (one, other) = (random.pick(&joints), random.pick(&joints));
    let edits = |edits| Operation::Named { name: "deed", edits };
    match random.below(9) {
        0 => Operation::Labels(vec![(one, format!("joint {}", random.below(1000)))]),
        1 => edits(vec![RigEdit::SetParent { joint: one, parent: Some(other), index: random.below(3) }]),
        2 => {
            let group =
                GroupData { uid: Uid(random.next()), name: "g".into(), color: [0.5; 3], enabled: random.chance(2) };
            edits(vec![RigEdit::AddLocalGroup(group.clone(), 0), RigEdit::SetGroup(one, Some(group.uid))])
        }
        3 => Operation::Pose(vec![(one, PoseOffset::from_rotation(Quat::from_rotation_x(share(random))))]),
        4 => Operation::Move { to: vec![(one, Vec3::new(share(random), 1.0, 0.0))], with_children: true },
        5 => {
            let tags = rig.joint(one).map_or(&[][..], |joint| joint.data.tags.as_slice());
            let off = tags.iter().map(|tag| {
                let mut tag = tag.clone();
                tag.enabled = !tag.enabled;
                RigEdit::SetTag(one, Box::new(tag))
            });
            edits(off.take(1).collect())
        }
        6 if random.chance(6) && joints.len() > 20 => Operation::Delete { joints: vec![one], keep_children: true },
        8 => edits(versions.reload(rig, random)),
        // An update to a version with another place of a joint, another name, or a command of a part that says something else.
        _ => {
            let mut file = rig.clone();
            let mut rest = rig.joint(one).map(|joint| joint.data.rest).unwrap_or_default();
            let tag = rig.joint(one).and_then(|joint| joint.data.tags.first().cloned());
            match (random.below(3), tag) {
                (0, _) => {
                    let label = Some(format!("version {}", random.below(1000)));
                    file.apply(&RigEdit::SetLabel(one, label)).unwrap();
                }
                (1, Some(mut tag)) => {
                    tag.comment = format!("version {}", random.below(1000));
                    file.apply(&RigEdit::SetTag(one, Box::new(tag))).unwrap();
                }
                _ => {
                    rest.translation += Vec3::splat(share(random) * 0.01);
                    file.apply(&RigEdit::SetRest(one, rest)).unwrap();
                }
            }
            for clip in rig.clips() {
                file.apply(&RigEdit::RemoveClip(clip.uid)).unwrap();
            }
            let updated = update(Some(rig), rig, &file, Take::Theirs);
            let mut list = edits_between(rig, &updated.rig).unwrap();
            list.extend(clip_edits(rig, &updated.rig).unwrap());
            edits(list)
        }
    }
}

/// A change of keys, with what is expected after it.
fn change(random: &mut Random, rig: &Rig, expected: &mut ExpectedKeys) -> Operation {
    let targets: Vec<TrackTarget> = expected.keys().cloned().collect();
    let joints: Vec<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
    let fresh = || target(Uid(0), Property::Rotation);
    let mut at = if targets.is_empty() { fresh() } else { random.pick(&targets) };
    if random.chance(4) && !joints.is_empty() {
        at = target(random.pick(&joints), Property::Rotation);
    }
    let known: Vec<Key> = expected.get(&at).map(|keys| keys.values().copied().collect()).unwrap_or_default();
    let own = expected.entry(at.clone()).or_default();
    let change = match random.below(3) {
        0 if !known.is_empty() => {
            let key = random.pick(&known);
            own.remove(&key.time.to_bits());
            KeyOperation::Delete([(at.clone(), vec![key.time])].into())
        }
        1 if !known.is_empty() => {
            let (key, by) = (random.pick(&known), random.below(64) as f32 / 32.0);
            own.remove(&key.time.to_bits());
            own.insert((key.time + by).to_bits(), Key { time: key.time + by, ..key });
            KeyOperation::Move { keys: [(at.clone(), vec![key.time])].into(), by }
        }
        _ => {
            let time = random.below(64) as f32 / 32.0;
            let value = Quat::from_rotation_y(share(random));
            let key = match at.property {
                Property::Rotation => Key::rotation(time, value),
                Property::Attribute(_) => Key::number(time, value.y),
                Property::Translation | Property::Scale => Key::vector(time, Vec3::splat(value.y)),
            };
            own.insert(time.to_bits(), key);
            KeyOperation::Set(vec![(at.clone(), vec![key])])
        }
    };
    expected.retain(|_, keys| !keys.is_empty());
    Operation::Clips(ClipOperation::Keys { clip: CLIP, layer: BASE, change })
}

#[test]
fn keys_live_through_random_deeds_and_undo_brings_back_the_first_bytes() {
    let steps: usize = std::env::var("RIGSMITH_STEPS").ok().and_then(|count| count.parse().ok()).unwrap_or(1000);
    let modules = Arc::new(modules::all());
    let mut rig = animated();
    let mut first = bytes(&rig);
    let (mut history, mut selection, mut uids) = (RigHistory::default(), Selection::default(), UidSource::seeded(2));
    let mut random = Random(2026);
    // What is expected after each step in effect, and what was before the first.
    let mut expected: Vec<ExpectedKeys> = vec![keys_of(&rig)];
    let mut undone: Vec<ExpectedKeys> = Vec::new();
    let (mut built, mut orphaned, mut in_effect) = (0, 0, 0);
    let mut known = NodeNames::default();
    let mut versions = TemplateVersions::new();
    for step in 0..steps {
        let now = expected.last().unwrap().clone();
        match random.below(10) {
            0 | 1 if expected.len() > 1 => {
                history.undo(&mut rig, &mut selection).unwrap().unwrap();
                undone.extend(expected.pop());
            }
            2 if !undone.is_empty() => {
                history.redo(&mut rig, &mut selection).unwrap().unwrap();
                expected.extend(undone.pop());
            }
            kind => {
                let mut next = now.clone();
                let operation = match kind {
                    kind if kind < 6 => change(&mut random, &rig, &mut next),
                    _ => deed(&rig, &mut random, &mut versions),
                };
                // A refused operation changes nothing, and one without effect is no step.
                let done = history.edit(&mut rig, &mut selection, &mut uids, None, &operation);
                if done.is_ok_and(|recorded| recorded.step.is_some()) {
                    expected.push(next);
                    undone.clear();
                }
            }
        }
        assert_eq!(keys_of(&rig), *expected.last().unwrap(), "step {step}");
        if step % 100 == 0 {
            let result = Builder::build(&rig, &modules).ok();
            built += usize::from(result.is_some());
            known.extend(&NodeNames::of(&rig, result.as_ref()));
            let there = NodeNames::of(&rig, result.as_ref());
            let gone = rig.clip(CLIP).unwrap().nodes().into_iter().filter(|node| !there.0.contains_key(node));
            let mut listed: Vec<Uid> =
                orphaned_keys(&rig, result.as_ref(), &known).iter().map(|orphan| orphan.node).collect();
            listed.sort_unstable();
            listed.dedup();
            assert_eq!(listed, gone.collect::<Vec<_>>(), "step {step}");
            orphaned += listed.len();
        }
        // A history holds some thousand steps at most.
        if step % 1000 == 999 || step + 1 == steps {
            let (last, count) = (bytes(&rig), history.steps().1);
            in_effect += count;
            (0..count).for_each(|_| drop(history.undo(&mut rig, &mut selection).unwrap().unwrap()));
            assert_eq!((bytes(&rig), history.steps().1), (first, 0), "step {step}");
            (0..count).for_each(|_| drop(history.redo(&mut rig, &mut selection).unwrap().unwrap()));
            assert_eq!(bytes(&rig), last, "step {step}");
            (history, first) = (RigHistory::default(), last);
            expected.drain(..expected.len() - 1);
            undone.clear();
        }
    }
    assert!(built > 0 && in_effect > steps / 10, "{built} builds, {in_effect} steps in effect");
    assert!(versions.reloads > steps / 100, "{} reloads that change something", versions.reloads);
    assert!(orphaned > 0, "commands that are off leave keys of their nodes");
}
