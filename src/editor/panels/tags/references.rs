//! References in forms: the nodes that they find in the built rig, and a button that lets a person pick others.

use bevy_egui::egui::{Label, RichText, Ui};

use super::values::Subject;
use crate::{
    editor::{counts::counted, panels::list, style},
    processor::FindError,
    rig::Uid,
};

/// The most names that are listed.
const NAMED: usize = 3;

/// Draws the nodes that a reference finds, and a button that lets a person pick others; returns true if it was clicked.
/// `text` is `None` where several commands differ.
pub(super) fn about(ui: &mut Ui, subject: &Subject, label: &str, path: &str, text: Option<&str>) -> bool {
    let is_waiting = subject.picking.as_deref() == Some(path);
    let tip = match is_waiting {
        true => format!("{label}: take the joints of this card"),
        false => format!("{label}: pick in the viewport"),
    };
    let mut is_clicked = false;
    ui.horizontal(|ui| {
        is_clicked = list::symbol_button(ui, "⌖", &tip);
        if is_waiting {
            let text = RichText::new("Click a joint or a control; Esc leaves it").small();
            ui.add(Label::new(text.color(style::accent(ui.visuals()))).truncate());
            return;
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
    is_clicked
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
