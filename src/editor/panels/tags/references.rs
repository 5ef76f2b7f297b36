//! References in forms: the nodes that they find in the built rig, and a button that refers to the selected joints.

use bevy_egui::egui::{Label, RichText, Ui};

use super::values::Subject;
use crate::{
    editor::{counted::counted, panels::list},
    processor::FindError,
    rig::Uid,
};

/// The most names that are listed.
const NAMED: usize = 3;

/// Draws the nodes that a reference finds, and a button that puts the selected joints in its place; returns the reference to them.
/// `text` is `None` where several commands differ.
pub(super) fn about(ui: &mut Ui, subject: &Subject, label: &str, text: Option<&str>) -> Option<String> {
    let mut picked = None;
    ui.horizontal(|ui| {
        if list::symbol_button(ui, "⌖", &format!("{label}: take the selected joints")) {
            picked = selected(subject);
        }
        let Some(text) = text else { return };
        let (said, color, whole) = match found(subject, text) {
            None => return,
            Some(Ok(nodes)) => {
                let names: Vec<String> = nodes.iter().map(|node| name(subject, *node)).collect();
                let more = if names.len() > NAMED { ", …" } else { "" };
                let count = names.len();
                let nodes = counted(count, "node", "nodes");
                let listed = names.iter().take(NAMED).cloned().collect::<Vec<_>>().join(", ");
                let said = if count == 0 { nodes } else { format!("{nodes}: {listed}{more}") };
                (said, ui.visuals().weak_text_color(), names.join(", "))
            }
            Some(Err(error)) => {
                let error = error.to_string();
                (error.clone(), ui.visuals().error_fg_color, error)
            }
        };
        let line = ui.add(Label::new(RichText::new(said).small().color(color)).truncate());
        if !whole.is_empty() {
            line.on_hover_text(whole);
        }
    });
    picked
}

fn found(subject: &Subject, text: &str) -> Option<Result<Vec<Uid>, FindError>> {
    let (joint, _) = *subject.entry.tags.first()?;
    if text.trim().is_empty() {
        return None;
    }
    Some(subject.builder?.find_from(&subject.shown.rig, joint, text))
}

fn name(subject: &Subject, node: Uid) -> String {
    match subject.shown.rig.joint(node) {
        Some(_) => subject.shown.name(node).into_owned(),
        None => subject.builder.and_then(|builder| builder.name_of(node)).unwrap_or_else(|| node.to_string()),
    }
}

/// A reference to the selected joints by their uids, with the labels that they have.
fn selected(subject: &Subject) -> Option<String> {
    let joints = subject.shown.selection.0.iter().filter(|joint| subject.shown.rig.joint(**joint).is_some());
    let joint = |joint: &Uid| format!("@joint {}#{joint}", subject.shown.name(*joint).replace([' ', '#'], "_"));
    let joints: Vec<String> = joints.map(joint).collect();
    (!joints.is_empty()).then(|| joints.join(" + "))
}
