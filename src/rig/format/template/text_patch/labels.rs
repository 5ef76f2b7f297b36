//! Sockets, options and chains in the header of a text.

use std::collections::HashMap;

use super::{super::write, patch::Patch};
use crate::rig::{
    Rig,
    format::{
        template::quoted,
        tree::{Item, Tree},
    },
    part::{HeaderSocket, PartOption},
};

/// Fields before which sockets and options are put: what lists headers reads the beginning of a file alone.
const BEHIND_HEADER: [&str; 5] = ["groups", "inputs", "joints", "parts", "poses"];

/// Writes sockets and options that are others now, and the labels of joints that sockets, chains and branches name. A socket whose joint is
/// gone goes.
pub(super) fn header_labels(patch: &mut Patch, tree: &Tree, before: &Rig, rig: &Rig) {
    sockets(patch, tree, before, rig);
    options(patch, tree, before, rig);
    let lists = ["chains", "branches"].map(|list| tree.elements(tree.root(), list));
    if lists.iter().all(|list| list.is_empty()) {
        return;
    }
    let by_label = before.joints_by_label();
    let renamed = |label: &str| {
        let now = rig.joint(*by_label.get(label)?)?.data.label.clone()?;
        (now != label).then(|| quoted(&now))
    };
    for chain in lists.into_iter().flatten() {
        for item in tree.elements(chain.value, "joints") {
            let label: Option<String> = ron::from_str(tree.written(item.value)).ok();
            if let Some(now) = label.as_deref().and_then(renamed) {
                patch.replace(item.value, &now);
            }
        }
    }
}

fn sockets(patch: &mut Patch, tree: &Tree, before: &Rig, rig: &Rig) {
    let elements = tree.elements(tree.root(), "sockets");
    let now: Vec<_> = write::labelled_sockets(rig).collect();
    let names: Vec<&str> = now.iter().map(|(socket, _)| socket.name.as_str()).collect();
    let pairs = Pairs::of(tree, elements, &names);
    let known: HashMap<&str, &HeaderSocket> =
        before.about().sockets.iter().map(|socket| (socket.name.as_str(), socket)).collect();
    for (place, number) in &pairs.both {
        let (node, (socket, label)) = (elements[*place].value, now[*number]);
        let name = tree.string(node, "name").unwrap_or_default();
        let Some(was) = known.get(name.as_str()) else { continue };
        if name != socket.name {
            patch.set(node, "name", &quoted(&socket.name));
        }
        if tree.string(node, "joint").is_none_or(|written| written != label) {
            patch.set(node, "joint", &quoted(label));
        }
        patch.set_numbers(node, "translation", &was.translation.to_array(), &socket.translation.to_array());
        patch.set_numbers(node, "rotation", &was.rotation.to_array(), &socket.rotation.to_array());
    }
    let fresh: Vec<String> =
        pairs.fresh.iter().map(|number| write::socket_text(now[*number].0, now[*number].1)).collect();
    patch.exchange_before(tree.root(), "sockets", (pairs.gone.as_slice(), fresh.as_slice()), &BEHIND_HEADER);
}

fn options(patch: &mut Patch, tree: &Tree, before: &Rig, rig: &Rig) {
    let elements = tree.elements(tree.root(), "options");
    let now = &rig.about().options;
    let names: Vec<&str> = now.iter().map(|option| option.name.as_str()).collect();
    let pairs = Pairs::of(tree, elements, &names);
    let known: HashMap<&str, &PartOption> =
        before.about().options.iter().map(|option| (option.name.as_str(), option)).collect();
    for (place, number) in &pairs.both {
        let (node, option) = (elements[*place].value, &now[*number]);
        let name = tree.string(node, "name").unwrap_or_default();
        let Some(was) = known.get(name.as_str()) else { continue };
        if was.name != option.name {
            patch.set(node, "name", &quoted(&option.name));
        }
        if was.default != option.default {
            patch.set(node, "default", &option.default);
        }
        if was.description != option.description {
            let text = Some(quoted(&option.description)).filter(|_| !option.description.is_empty());
            patch.set_or_remove(node, "description", text.as_deref());
        }
        if was.form != option.form {
            patch.set_or_remove(node, "form", option.form.as_ref().map(write::form_text).as_deref());
        }
        if was.sets != option.sets {
            patch.set(node, "sets", &write::targets_text(option));
        }
    }
    let fresh: Vec<String> = pairs.fresh.iter().map(|number| write::option_text(&now[*number])).collect();
    patch.exchange_before(tree.root(), "options", (pairs.gone.as_slice(), fresh.as_slice()), &BEHIND_HEADER);
}

/// Elements of a list in a text, and what the list is to have.
struct Pairs {
    /// Elements that stay, each with the number of what it is now.
    both: Vec<(usize, usize)>,
    /// Elements that go.
    gone: Vec<usize>,
    /// Numbers of what comes.
    fresh: Vec<usize>,
}

impl Pairs {
    /// Pairs by name. As many as go and come are the same ones with other names.
    fn of(tree: &Tree, elements: &[Item], names: &[&str]) -> Self {
        let written: Vec<Option<String>> = elements.iter().map(|item| tree.string(item.value, "name")).collect();
        let numbers: HashMap<&str, usize> = names.iter().enumerate().map(|(number, name)| (*name, number)).collect();
        let find = |name: &Option<String>| numbers.get(name.as_deref()?).copied();
        let (mut both, mut gone, mut is_known) = (Vec::new(), Vec::new(), vec![false; names.len()]);
        for (place, name) in written.iter().enumerate() {
            match find(name) {
                Some(number) => {
                    both.push((place, number));
                    is_known[number] = true;
                }
                None => gone.push(place),
            }
        }
        let mut fresh: Vec<usize> = (0..names.len()).filter(|number| !is_known[*number]).collect();
        if gone.len() == fresh.len() {
            both.extend(gone.drain(..).zip(fresh.drain(..)));
        }
        Self { both, gone, fresh }
    }
}
