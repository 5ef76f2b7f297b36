//! Extraction of some joints of a rig to a rig of their own, a template or a part.

use std::collections::{HashMap, HashSet};

use super::{
    EditError, Rig, RigAbout, RigEdit, RigInput, TagData, TagKind, Uid, UidSource,
    part::{HeaderSocket, PartInstance, PartOption, PartTargets},
    reference::{NameKind, Names, references_in},
    remap::Remap,
};

/// Joints taken out of a rig.
#[derive(Debug, Clone, PartialEq)]
pub struct Extraction {
    /// The rig of their own.
    pub rig: Rig,
    /// References to joints, commands and features outside of the extracted rig, a sentence each.
    pub left: Vec<String>,
}

/// The joints of a selection with their groups and tags, where they stand in the rig: each hangs on the nearest of them above
/// it. Uids stay, or all are new with `uids`. The current pose, stored poses, clips and weights
/// are left out, as templates have none.
///
/// # Errors
/// [`EditError::NoJoint`] for a joint that the rig does not have.
pub fn extract(rig: &Rig, joints: &[Uid], name: &str, uids: Option<&mut UidSource>) -> Result<Extraction, EditError> {
    let chosen: HashSet<Uid> = joints.iter().copied().collect();
    if let Some(missing) = joints.iter().find(|uid| rig.joint(**uid).is_none()) {
        return Err(EditError::NoJoint(*missing));
    }
    let inside: Vec<_> = rig.walk().filter(|joint| chosen.contains(&joint.data.uid)).collect();
    let tags: HashSet<Uid> = inside.iter().flat_map(|joint| &joint.data.tags).map(|tag| tag.uid).collect();
    let groups: HashSet<Uid> = inside.iter().filter_map(|joint| joint.data.group).collect();
    let mut remap = Remap::default();
    let mut uid = Uid::derived(["extract", &rig.uid().to_string(), name]);
    if let Some(uids) = uids {
        uid = uids.next_uid();
        let things = groups_in_order(rig, &groups).chain(inside.iter().flat_map(|joint| {
            std::iter::once(joint.data.uid).chain(joint.data.tags.iter().map(|tag| tag.uid)).collect::<Vec<_>>()
        }));
        remap.uids = things.map(|thing| (thing, uids.next_uid())).collect::<HashMap<_, _>>();
    }
    let mut out = Rig::new(uid, name);
    let author = rig.about().author.clone();
    let about = RigAbout { name: name.to_owned(), kind: "part".to_owned(), author, ..RigAbout::default() };
    out.apply(&RigEdit::SetAbout(Box::new(about)))?;
    for group in rig.groups().iter().filter(|group| groups.contains(&group.uid)) {
        let mut group = group.clone();
        group.uid = remap.get(group.uid).unwrap_or(group.uid);
        out.apply(&RigEdit::AddLocalGroup(group, usize::MAX))?;
    }
    let mut left = Vec::new();
    let nearest = nearest_above(rig, &chosen);
    for joint in &inside {
        let mut data = remap.joint(&joint.data);
        let above = nearest.get(&joint.data.uid).copied();
        let parent = above.map(|above| remap.get(above).unwrap_or(above));
        if above != joint.parent {
            data.rest = out.local_rest(parent, &rig.rest_global(joint.data.uid));
        }
        data.mirror = joint.data.mirror.filter(|mirror| chosen.contains(mirror)).and(data.mirror);
        for (tag, copy) in joint.data.tags.iter().zip(&mut data.tags) {
            let (TagKind::Command { module, params, feature }, TagKind::Command { feature: own, .. }) =
                (&tag.kind, &mut copy.kind)
            else {
                continue;
            };
            let on = joint.data.label.clone().unwrap_or_else(|| joint.data.uid.to_string());
            if feature.is_some_and(|feature| !tags.contains(&feature)) {
                *own = None;
                left.push(format!("{module} on {on} was in a feature of another joint; it is in none now"));
            }
            let references = references_in(params).filter_map(|found| found.references.ok()).flat_map(|list| list.0);
            let mut outside: Vec<(NameKind, Uid)> = references
                .flat_map(|reference| reference.uids().collect::<Vec<_>>())
                .filter(|(kind, uid)| match kind {
                    NameKind::Joint => !chosen.contains(uid),
                    NameKind::Command => !tags.contains(uid),
                    NameKind::Group => !groups.contains(uid),
                    NameKind::Label => !chosen.contains(uid) && !tags.contains(uid),
                    // Inputs come along.
                    NameKind::Rig | NameKind::Input => false,
                })
                .collect();
            outside.sort_unstable();
            outside.dedup();
            for (kind, uid) in outside {
                let name = rig.name_of(kind, uid).map_or_else(|| uid.to_string(), |name| name.into_owned());
                left.push(format!("{module} on {on} refers to the {kind} {name}, which is not extracted"));
            }
        }
        out.apply(&RigEdit::AddJoint { joint: Box::new(data), parent, index: usize::MAX })?;
    }
    let named: HashSet<Uid> = out.walk().flat_map(|joint| &joint.data.tags).flat_map(inputs_of).collect();
    let inputs: Vec<RigInput> = rig.inputs().iter().filter(|input| named.contains(&input.uid)).cloned().collect();
    if !inputs.is_empty() {
        out.apply(&RigEdit::SetInputs(inputs))?;
    }
    let about = RigAbout {
        sockets: header_sockets(rig, &chosen, &remap),
        options: settable_options(rig, &out),
        ..out.about().clone()
    };
    if about != *out.about() {
        out.apply(&RigEdit::SetAbout(Box::new(about)))?;
    }
    Ok(Extraction { rig: out, left })
}

/// Sockets on chosen joints.
fn header_sockets(rig: &Rig, chosen: &HashSet<Uid>, remap: &Remap) -> Vec<HeaderSocket> {
    let inside = rig.about().sockets.iter().filter(|socket| chosen.contains(&socket.joint));
    let here = |socket: &HeaderSocket| HeaderSocket {
        joint: remap.get(socket.joint).unwrap_or(socket.joint),
        ..socket.clone()
    };
    inside.map(here).collect()
}

/// Options of a rig of which an extracted one has all that they set.
fn settable_options(rig: &Rig, extracted: &Rig) -> Vec<PartOption> {
    let plain = PartInstance::default();
    let targets = PartTargets::new(&plain, extracted);
    let is_settable = |option: &&PartOption| option.sets.iter().all(|(tag, _)| targets.find_tag(tag).is_ok());
    rig.about().options.iter().filter(is_settable).cloned().collect()
}

/// The nearest chosen joint above each joint that has one above it.
fn nearest_above(rig: &Rig, chosen: &HashSet<Uid>) -> HashMap<Uid, Uid> {
    let mut nearest: HashMap<Uid, Uid> = HashMap::new();
    // Parents come before their children, so one step is enough for each joint.
    for joint in rig.walk() {
        let above = joint.parent.filter(|parent| chosen.contains(parent));
        let above = above.or_else(|| nearest.get(&joint.parent?).copied());
        if let Some(above) = above {
            nearest.insert(joint.data.uid, above);
        }
    }
    nearest
}

/// Inputs that a tag refers to.
fn inputs_of(tag: &TagData) -> Vec<Uid> {
    let TagKind::Command { params, .. } = &tag.kind else { return Vec::new() };
    let references = references_in(params).filter_map(|found| found.references.ok()).flat_map(|list| list.0);
    let uids = references.flat_map(|reference| reference.uids().collect::<Vec<_>>());
    uids.filter(|(kind, _)| *kind == NameKind::Input).map(|(_, uid)| uid).collect()
}

fn groups_in_order<'a>(rig: &'a Rig, groups: &'a HashSet<Uid>) -> impl Iterator<Item = Uid> + 'a {
    rig.groups().iter().map(|group| group.uid).filter(|uid| groups.contains(uid))
}
