//! Other fields of part instances in a template's text, and more instances.

use bevy::math::{EulerRot, Quat, Vec3};

use super::super::{labels::header_labels, patch::Patch};
use crate::rig::{
    Rig, Uid, degrees,
    format::{
        template::{quoted, shorthand::Declarations, vector},
        tree::{NodeId, Tree},
    },
    part::{PartInstance, PartTargets},
};

/// The text of a template with other fields of its part instances. `parts` are the instances before and after, each with its
/// fitted part, and `rigs` the template with its parts. Joints have the names after that they have in the second rig. `None`
/// for a text with another number of instances.
pub(crate) fn with_instance_fields(text: &str, parts: [&[(PartInstance, Rig)]; 2], rigs: [&Rig; 2]) -> Option<String> {
    let declared = Declarations::find(text)?;
    let tree = &declared.tree;
    let elements = tree.elements(tree.root(), "parts");
    if parts.iter().any(|parts| parts.len() != elements.len()) {
        return None;
    }
    let mut patch = Patch::new(tree);
    header_labels(&mut patch, tree, rigs[0], rigs[1]);
    for joint in &declared.joints {
        let Some(parent) = rigs[1].joint(joint.uid).and_then(|joint| joint.parent) else { continue };
        let written = tree.string(joint.node, "parent").filter(|written| written.parse::<Uid>().is_err());
        let label = rigs[1].joint(parent).and_then(|parent| parent.data.label.as_deref());
        if written.is_some() && written.as_deref() != label {
            let bearers = rigs[1].walk().filter(|other| other.data.label.as_deref() == label).count();
            let text = label.filter(|_| bearers == 1).map_or_else(|| format!("\"{parent}\""), quoted);
            patch.set(joint.node, "parent", &text);
        }
    }
    for ((item, was), is) in elements.iter().zip(parts[0]).zip(parts[1]) {
        instance_fields(&mut patch, tree, item.value, was, is);
    }
    Some(patch.text())
}

fn instance_fields(
    patch: &mut Patch,
    tree: &Tree,
    node: NodeId,
    (was, was_fitted): &(PartInstance, Rig),
    (is, is_fitted): &(PartInstance, Rig),
) {
    // The uid follows from the file and the name, and of a part without a name from the joints that it goes onto.
    let follows = was.part != is.part || was.name != is.name || was.name.is_empty() && was.onto != is.onto;
    if follows && tree.field(node, "uid").is_none() {
        patch.put_first(node, &format!("uid: \"{}\"", was.uid));
    }
    for ((name, before), (_, after)) in field_texts(was).into_iter().zip(field_texts(is)) {
        if before != after {
            patch.set_or_remove(node, name, after.as_deref());
        }
    }
    let mut gone = Vec::new();
    let (old, new) = (PartTargets::new(was, was_fitted), PartTargets::new(is, is_fitted));
    for (number, (item, change)) in tree.elements(node, "changes").iter().zip(&was.changes).enumerate() {
        if let Some(name) = &change.tag
            && let Ok(tag) = old.find_tag(name)
        {
            if is_fitted.find_tag(tag).is_none() {
                gone.push(number);
            } else if new.find_tag(name) != Ok(tag) {
                patch.set(item.value, "tag", &quoted(&is.name_of_tag(is_fitted, tag)));
            }
        }
        let place = change.joint.as_ref().and_then(|label| old.find_joint(label).ok());
        if let (Some(label), Some(joint)) = (&change.joint, place.and_then(|place| was_fitted.walk().nth(place))) {
            let uid = joint.data.uid;
            match is_fitted.walk().position(|joint| joint.data.uid == uid) {
                None => gone.push(number),
                Some(place) if new.find_joint(label) != Ok(place) => {
                    let name = is.name_of_joint(is_fitted, place).map_or_else(|| uid.to_string(), str::to_owned);
                    patch.set(item.value, "joint", &quoted(&name));
                }
                Some(_) => {}
            }
        }
    }
    if !gone.is_empty() {
        patch.exchange(node, "changes", &gone, &[]);
    }
}

/// Fields of an instance as a file has them; `None` for those that are left out.
fn field_texts(instance: &PartInstance) -> Vec<(&'static str, Option<String>)> {
    let list = |names: &[String]| {
        let texts: Vec<String> = names.iter().map(|name| quoted(name)).collect();
        (!texts.is_empty()).then(|| format!("[{}]", texts.join(", ")))
    };
    let flag = |is_on: bool| is_on.then(|| "true".to_owned());
    let only = instance.counts.iter().find(|(chain, _)| chain.is_empty()).map(|(_, count)| count.to_string());
    let of_chains = instance.counts.iter().filter(|(chain, _)| !chain.is_empty());
    let counts: Vec<String> =
        of_chains.map(|(chain, count)| format!("(chain: {}, count: {count})", quoted(chain))).collect();
    let options: Vec<String> =
        instance.options.iter().map(|(name, value)| format!("{}: {value}", quoted(name))).collect();
    let rest = &instance.rest;
    let (at, scale) = (vector(rest.translation), format!("{:?}", rest.scale.x));
    vec![
        ("part", Some(quoted(&instance.part))),
        ("name", (!instance.name.is_empty()).then(|| quoted(&instance.name))),
        ("onto", list(&instance.onto)),
        ("adds", flag(instance.adds)),
        ("parent", instance.parent.as_deref().map(quoted)),
        ("socket", instance.socket.as_deref().map(quoted)),
        ("world", flag(instance.is_world)),
        ("translation", Some(at).filter(|at| at != "(0.0, 0.0, 0.0)")),
        ("rotation", (rest.rotation != Quat::IDENTITY).then(|| angles_text(rest.rotation))),
        ("scale", Some(scale).filter(|scale| scale != "1.0")),
        ("prefix", (!instance.prefix.is_empty()).then(|| quoted(&instance.prefix))),
        ("mirror", flag(instance.mirror)),
        ("count", only),
        ("counts", (!counts.is_empty()).then(|| format!("[{}]", counts.join(", ")))),
        ("options", (!options.is_empty()).then(|| format!("{{{}}}", options.join(", ")))),
        ("off", list(&instance.off)),
    ]
}

/// A rotation as three angles: in whole thousandths of a degree where these are exact.
fn angles_text(rotation: Quat) -> String {
    let (x, y, z) = rotation.to_euler(EulerRot::XYZ);
    let angles = Vec3::new(x, y, z).map(f32::to_degrees);
    let rounded = angles.map(|angle| (angle * 1000.0).round() / 1000.0);
    vector(if degrees(rounded) == rotation { rounded } else { angles })
}

/// The text of a template with those part instances of another text that it does not have, each behind the one behind which it
/// stands there. `own` and `file` are the instances of both. `None` for a text that is no template.
pub(crate) fn with_instances_of(
    text: &str,
    own: &[PartInstance],
    (file_text, file): (&str, &[PartInstance]),
    fresh: &[Uid],
) -> Option<String> {
    let (tree, other) = (Tree::parse(text)?, Tree::parse(file_text)?);
    let elements = other.elements(other.root(), "parts");
    if elements.len() != file.len() {
        return None;
    }
    let list = tree.field(tree.root(), "parts").map(|field| field.value);
    let mut patch = Patch::new(&tree);
    let (mut behind, mut texts) = (None, Vec::new());
    for (item, instance) in elements.iter().zip(file) {
        if let Some(place) = own.iter().position(|own| own.uid == instance.uid) {
            behind = Some(place);
        } else if fresh.contains(&instance.uid) {
            let written = other.written(item.value);
            match list {
                Some(list) => patch.insert(list, behind, written),
                None => texts.push(written.to_owned()),
            }
        }
    }
    if !texts.is_empty() {
        patch.append(tree.root(), "parts", &texts);
    }
    Some(patch.text())
}
