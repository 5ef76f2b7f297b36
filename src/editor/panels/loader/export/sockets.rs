//! Sockets of a template: the places that others hang on, and those that it hangs on itself.

use bevy::math::Vec3;
use bevy_egui::egui::{Label, RichText, Ui};

use super::{
    draft::HeaderDraft,
    text_entry::{NoNumbers, TypedFields},
};
use crate::{
    editor::{
        notice::Notice,
        panel::Requests,
        panels::{
            displayed_rig::{DisplayedRig, Stamp},
            list,
        },
    },
    rig::{
        Uid,
        part::{HeaderSocket, PartNeeds},
    },
};

/// The sockets in the form.
#[derive(Default)]
pub(super) struct SocketList {
    fields: TypedFields,
    /// Places that the rig hangs on, in words, with the state that they were read from.
    needs: Option<(Stamp, String)>,
}

impl SocketList {
    /// Draws the sockets.
    pub fn show(&mut self, ui: &mut Ui, shown: &DisplayedRig, draft: &mut HeaderDraft, requests: &mut Requests) {
        ui.strong("Sockets");
        let needs = self.needs(shown);
        if !needs.is_empty() {
            let tip =
                "As a part the rig hangs there: on what is above its roots, and on what its commands refer to as root";
            let text = RichText::new(format!("In: {needs}")).small();
            ui.add(Label::new(text).wrap()).on_hover_text(tip);
        }
        let about = shown.rig.about();
        let mut removed = None;
        for (number, socket) in about.sockets.iter().enumerate() {
            if self.socket(ui, shown, (number, socket), draft, requests) {
                removed = Some(number);
            }
        }
        let selected = selected_joint(shown);
        let button = ui.add_enabled(selected.is_ok(), bevy_egui::egui::Button::new("+ Socket"));
        let button = button.on_hover_text("A place on the selected joint that other parts hang on");
        let reason = selected.as_ref().err().map(ToString::to_string).unwrap_or_default();
        if button.on_disabled_hover_text(reason).clicked()
            && let Ok((joint, label)) = selected
        {
            let name = free_name(label.replace('.', "_"), about.sockets.iter().map(|socket| socket.name.as_str()));
            let socket = HeaderSocket { name, joint, translation: Vec3::ZERO, rotation: Vec3::ZERO };
            draft.change("Add socket", requests, |about| about.sockets.push(socket));
        }
        if let Some(number) = removed {
            draft.change("Remove socket", requests, |about| drop(about.sockets.remove(number)));
        }
    }

    fn needs(&mut self, shown: &DisplayedRig) -> &str {
        if self.needs.as_ref().is_none_or(|(stamp, _)| *stamp != shown.stamp()) {
            let places = PartNeeds::of(&shown.rig).sockets;
            let places: Vec<String> = places.iter().map(ToString::to_string).collect();
            self.needs = Some((shown.stamp(), places.join(", ")));
        }
        self.needs.as_ref().map_or("", |(_, needs)| needs)
    }

    /// Draws a socket; returns true if it is to go.
    fn socket(
        &mut self,
        ui: &mut Ui,
        shown: &DisplayedRig,
        (number, socket): (usize, &HeaderSocket),
        draft: &mut HeaderDraft,
        requests: &mut Requests,
    ) -> bool {
        let name = &socket.name;
        let mut is_removed = false;
        ui.horizontal(|ui| {
            let width = (ui.available_width() - 66.0).max(60.0);
            if let Some(name) = self.fields.text(ui, shown.entity, &format!("Name of socket {name}"), name, width) {
                let name = name.trim().to_owned();
                draft.change("Change socket", requests, |about| about.sockets[number].name = name);
            }
            if list::symbol_button(ui, "⌖", &format!("Socket {name} onto the selected joint")) {
                match selected_joint(shown) {
                    Ok((joint, _)) => {
                        draft.change("Change socket", requests, |about| about.sockets[number].joint = joint);
                    }
                    Err(reason) => requests.send(Notice::warning(format!("The socket {name} stays: {reason}"))),
                }
            }
            is_removed = list::symbol_button(ui, "✖", &format!("Remove socket {name}"));
        });
        let is_there = shown.rig.joint(socket.joint).is_some();
        let gone = if is_there { "" } else { ", which is gone: the file will not have the socket" };
        ui.add(Label::new(RichText::new(format!("on {}{gone}", shown.name(socket.joint))).small()).wrap());
        let rows = [("Place", socket.translation), ("Turn", socket.rotation)];
        for (row, (what, now)) in rows.into_iter().enumerate() {
            ui.horizontal(|ui| {
                ui.label(what);
                let field = format!("{what} of socket {name}");
                let width = ui.available_width();
                let tip = if row == 0 { "x, y, z" } else { "degrees about X, Y, Z" };
                match self.fields.numbers(ui, shown.entity, &field, now.to_array(), width) {
                    Some(Ok(numbers)) => draft.change("Change socket", requests, |about| {
                        let socket = &mut about.sockets[number];
                        let of_row = if row == 0 { &mut socket.translation } else { &mut socket.rotation };
                        *of_row = Vec3::from(numbers);
                    }),
                    Some(Err(NoNumbers(text))) => {
                        let text = format!("{field} stays as it was: \"{text}\" is not three numbers ({tip})");
                        requests.send(Notice::warning(text));
                    }
                    None => {}
                }
            });
        }
        is_removed
    }
}

/// A name, with a number if it is taken.
pub(super) fn free_name<'n>(name: String, taken: impl Iterator<Item = &'n str> + Clone) -> String {
    let numbered = (2..).map(|number| format!("{name}_{number}"));
    let is_free = |name: &String| taken.clone().all(|taken| taken != name);
    std::iter::once(name.clone()).chain(numbered).find(is_free).unwrap_or_default()
}

/// Reason why the active joint can bear no socket; its text says what to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
enum NoSocket {
    #[error("Select its joint first")]
    NoJoint,
    #[error("The file names the joint by its label: name the joint first")]
    NoLabel,
    #[error("Another joint has the same label, by which the file names it: rename one of them first")]
    SameLabel,
}

/// The active joint with its label.
fn selected_joint(shown: &DisplayedRig) -> Result<(Uid, String), NoSocket> {
    let joint = shown.selection.0.last().and_then(|joint| shown.rig.joint(*joint)).ok_or(NoSocket::NoJoint)?;
    let label = joint.data.label.clone().ok_or(NoSocket::NoLabel)?;
    match shown.rig.walk().filter(|other| other.data.label.as_ref() == Some(&label)).count() {
        1 => Ok((joint.data.uid, label)),
        _ => Err(NoSocket::SameLabel),
    }
}
