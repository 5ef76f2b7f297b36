//! Context menus of nodes, of wires, and of the ground between them.

use bevy::prelude::*;
use bevy_egui::egui::Ui;

use super::{
    action::{GraphAction, obstacle},
    edits::Bench,
    model::GraphWire,
    state::{GraphRequest, GraphView},
};
use crate::{
    editor::{
        actions::{Action, ActionRequest},
        notice::Notice,
        panel::Requests,
        panels::{displayed_rig::DisplayedRig, tags::library::library, words},
    },
    plugins::document::EditRequest,
    rig::{
        TagKind, Uid,
        operations::{Operation, TagOperation},
    },
};

/// Subject of a menu.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MenuTarget {
    Node(Uid),
    /// Wire between two commands: (command that reads, input, command that is read from).
    Wire(Uid, usize, Uid),
    /// Feature tag, or local group.
    Frame(Uid),
    Ground,
}

/// Sends an operation on tags.
pub(super) fn send(operation: TagOperation, shown: &DisplayedRig, requests: &mut Requests) {
    requests.send(EditRequest::operation(shown.entity, Operation::Tags(operation)));
}

/// Menu of the graph.
pub(super) struct Menu<'a> {
    pub world: &'a World,
    pub shown: &'a DisplayedRig<'a>,
    pub bench: Bench<'a>,
    /// Words typed into the library of modules.
    pub words: &'a mut String,
}

impl Menu<'_> {
    /// Draws the menu of a subject.
    pub fn show(&mut self, ui: &mut Ui, target: MenuTarget, requests: &mut Requests) {
        ui.set_min_width(190.0);
        match target {
            MenuTarget::Node(tag) => self.node(ui, tag, requests),
            MenuTarget::Wire(to, input, from) => self.wire(ui, (to, input, from), requests),
            MenuTarget::Frame(uid) => self.frame(ui, uid, requests),
            MenuTarget::Ground => self.ground(ui, requests),
        }
    }

    /// Adds a command of a module that is let go: into a wire, behind a node, or to the selected joints.
    pub fn drop_module(&mut self, module: &'static str, target: MenuTarget, requests: &mut Requests) {
        let at = |tag: Uid| self.bench.graph.at.get(&tag).copied();
        match target {
            MenuTarget::Wire(to, input, from) => {
                if let (Some(to), Some(from)) = (at(to), at(from)) {
                    self.insert(GraphWire { to, input, from }, module, requests);
                }
            }
            MenuTarget::Node(tag) => {
                if let Some(number) = at(tag) {
                    send(self.behind(number, module), self.shown, requests);
                }
            }
            MenuTarget::Frame(_) | MenuTarget::Ground => match selected_joints(self.shown) {
                joints if joints.is_empty() => {
                    let text = format!("{module} was not added: no joint is selected to carry it; select one first.");
                    requests.send(Notice::error(text));
                }
                joints => {
                    send(TagOperation::Add { joints, kind: command(module), index: None }, self.shown, requests);
                }
            },
        }
    }

    /// The operation that adds a command behind another.
    fn behind(&self, number: usize, module: &str) -> TagOperation {
        let (joint, before) = (self.bench.graph.nodes[number].joint, self.bench.graph.next_on_joint(number));
        TagOperation::Insert { joint, before, kind: command(module), rewired: None }
    }

    /// Inserts a command into a wire.
    fn insert(&self, wire: GraphWire, module: &str, requests: &mut Requests) {
        let nodes = &self.bench.graph.nodes;
        match self.bench.inserted(wire, module) {
            Ok((operation, is_rewired)) => {
                send(operation, self.shown, requests);
                if !is_rewired {
                    let (from, to) = (&nodes[wire.from].title, &nodes[wire.to].title);
                    let text = format!("{module} makes no nodes yet, so {to} still refers to {from}.");
                    requests.send(Notice::info(text));
                }
            }
            Err(error) => requests.send(Notice::error(format!("Nothing was inserted: {error}."))),
        }
    }

    fn frame(&mut self, ui: &mut Ui, uid: Uid, requests: &mut Requests) {
        let graph = self.bench.graph;
        let Some(place) = graph.frames.iter().position(|frame| frame.uid == uid) else {
            ui.weak("The frame is gone.");
            return;
        };
        let frame = &graph.frames[place];
        let view = self.world.get_resource::<GraphView>();
        let is_open = view.is_none_or(|view| view.is_open(uid, graph.nodes.len()));
        if ui.button(if is_open { "Fold the frame" } else { "Open the frame" }).clicked() {
            requests.send(GraphRequest::Fold(uid, !is_open));
            ui.close();
        }
        let name = format!("Turn {} {}", frame.name, if frame.enabled { "off" } else { "on" });
        if ui.button(name).clicked() {
            let operation = match frame.is_feature {
                true => TagOperation::Enable(vec![uid], !frame.enabled),
                false => TagOperation::EnableGroup(uid, !frame.enabled),
            };
            send(operation, self.shown, requests);
            ui.close();
        }
        if ui.button("Select its commands").clicked() {
            let inside = graph.nodes.iter().filter(|node| node.frame == Some(place)).map(|node| node.tag);
            requests.send(GraphRequest::Select(inside.collect()));
            ui.close();
        }
        ui.separator();
        self.ground(ui, requests);
    }

    fn node(&mut self, ui: &mut Ui, tag: Uid, requests: &mut Requests) {
        let Some(number) = self.bench.graph.at.get(&tag).copied() else {
            ui.weak("The command is gone.");
            return;
        };
        for action in [GraphAction::Toggle, GraphAction::Delete] {
            self.entry(ui, action, requests);
        }
        ui.separator();
        ui.menu_button("Add command behind", |ui| {
            if let Some(module) = library(ui, self.bench.modules, self.words) {
                send(self.behind(number, module), self.shown, requests);
            }
        });
        ui.menu_button("Put into feature", |ui| {
            let mut attach = |ui: &mut Ui, name: &str, feature: Option<Uid>| {
                if ui.button(name).clicked() {
                    send(TagOperation::Attach(vec![tag], feature), self.shown, requests);
                    ui.close();
                }
            };
            attach(ui, "None", None);
            for joint in self.shown.rig.walk() {
                for tag in &joint.data.tags {
                    if let TagKind::Feature { kind, name, switch, .. } = &tag.kind {
                        attach(ui, &words::feature(kind, name, switch), Some(tag.uid));
                    }
                }
            }
        });
        ui.separator();
        self.entry(ui, GraphAction::ShowSelected, requests);
    }

    fn wire(&mut self, ui: &mut Ui, (to, input, from): (Uid, usize, Uid), requests: &mut Requests) {
        let at = |tag: Uid| self.bench.graph.at.get(&tag).copied();
        let (Some(to), Some(from)) = (at(to), at(from)) else {
            ui.weak("The commands are gone.");
            return;
        };
        let wire = GraphWire { to, input, from };
        let nodes = &self.bench.graph.nodes;
        ui.weak(format!("{} ➡ {}", nodes[from].title, nodes[to].title));
        if ui.button("Remove reference").clicked() {
            match self.bench.disconnected(wire) {
                Ok(operation) => send(operation, self.shown, requests),
                Err(error) => requests.send(Notice::error(format!("The wire stays: {error}."))),
            }
            ui.close();
        }
        ui.menu_button("Insert command", |ui| {
            if let Some(module) = library(ui, self.bench.modules, self.words) {
                self.insert(wire, module, requests);
            }
        });
    }

    fn ground(&mut self, ui: &mut Ui, requests: &mut Requests) {
        ui.menu_button("Add command", |ui| add_to_selected(ui, self.shown, &self.bench, self.words, requests));
        ui.separator();
        let all = [
            GraphAction::SelectAll,
            GraphAction::SelectNone,
            GraphAction::ShowAll,
            GraphAction::OpenFrames,
            GraphAction::FoldFrames,
            GraphAction::LayOut,
        ];
        for action in all {
            self.entry(ui, action, requests);
        }
    }

    fn entry(&self, ui: &mut Ui, action: GraphAction, requests: &mut Requests) {
        button(ui, self.world, action, action.name(), requests);
    }
}

/// Draws the library; the module that is chosen goes onto the selected joints.
pub(super) fn add_to_selected(
    ui: &mut Ui,
    shown: &DisplayedRig,
    bench: &Bench,
    words: &mut String,
    requests: &mut Requests,
) {
    let joints = selected_joints(shown);
    if joints.is_empty() {
        ui.weak("Select a joint, or a command of it, first.");
        return;
    }
    if let Some(module) = library(ui, bench.modules, words) {
        send(TagOperation::Add { joints, kind: command(module), index: None }, shown, requests);
    }
}

/// Draws the button of an action, with the reason if it can do nothing at present.
pub(super) fn button(ui: &mut Ui, world: &World, action: GraphAction, name: &str, requests: &mut Requests) {
    let why_not = obstacle(world, action);
    let response = ui.add_enabled(why_not.is_none(), bevy_egui::egui::Button::new(name));
    let response = response.on_hover_text(action.name());
    if response.clicked() {
        requests.send(ActionRequest(Action::Graph(action)));
        ui.close();
    }
    if let Some(why_not) = why_not {
        response.on_disabled_hover_text(why_not);
    }
}

fn selected_joints(shown: &DisplayedRig) -> Vec<Uid> {
    shown.selection.0.iter().copied().filter(|joint| shown.rig.joint(*joint).is_some()).collect()
}

fn command(module: &str) -> TagKind {
    TagKind::Command { module: module.to_owned(), feature: None, params: "()".to_owned() }
}
