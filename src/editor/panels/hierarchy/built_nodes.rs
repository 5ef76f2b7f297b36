//! Nodes of the built rig in place of its joints alone: what commands made, below what carries it, with the modules. A
//! filter turns the tree into a list.

use std::{collections::HashSet, sync::Arc};

use bevy::prelude::*;
use bevy_egui::egui::{self, Sense, Ui, WidgetInfo, WidgetType, pos2};

use crate::{
    editor::{
        panel::Requests,
        panels::{
            displayed_rig::DisplayedRig,
            list::{self, List},
            tags::show_tag,
        },
    },
    plugins::{
        commands::BuildResult,
        picking::{Pick, PickRequest},
    },
    rig::{BuiltRig, NodeType, Rig, Uid},
};

/// Nodes that are listed, with what they were made from: the build, the filter, `true` for a list, and the joint whose
/// hierarchy alone is listed.
#[derive(Default)]
pub(super) struct BuiltTree {
    made_from: Option<(Arc<BuiltRig>, String, bool, Option<Uid>)>,
    rows: Vec<BuiltRow>,
    /// Active node that was last scrolled into view.
    revealed: Option<Uid>,
}

/// Nodes that are asked for.
#[derive(Clone, Copy)]
pub(super) struct WantedNodes<'a> {
    /// Words that the name of a listed node contains.
    pub filter: &'a str,
    /// True for a list in place of a tree.
    pub is_flat: bool,
    /// Joint whose hierarchy alone is listed, with what its commands made.
    pub top: Option<Uid>,
}

/// A node in the list.
struct BuiltRow {
    node: Uid,
    name: String,
    /// Number of nodes above it.
    depth: usize,
    /// Kind of the node, and module that made it.
    about: String,
    /// Command that made it.
    command: Option<Uid>,
}

/// Width by which a node stands further right than its parent.
const INDENT: f32 = 12.0;
/// Most steps to the right.
const MOST_STEPS: usize = 10;

impl BuiltTree {
    /// Draws the nodes that are asked for. The active node is brought into sight when another becomes active.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        world: &World,
        shown: &DisplayedRig,
        wanted: WantedNodes,
        requests: &mut Requests,
    ) {
        let Some(BuildResult(built)) = world.get::<BuildResult>(shown.entity) else {
            self.made_from = None;
            return list::nothing(ui, "Nothing is built yet.");
        };
        let WantedNodes { filter, is_flat, top } = wanted;
        let is_fresh = self.made_from.as_ref().is_some_and(|(from, words, was_flat, was_top)| {
            Arc::ptr_eq(from, built) && words.as_str() == filter && *was_flat == is_flat && *was_top == top
        });
        if !is_fresh {
            self.rows = rows(built, &shown.rig, wanted);
            self.made_from = Some((Arc::clone(built), filter.to_owned(), is_flat, top));
        }
        let active = shown.selection.active();
        let is_other = active != self.revealed;
        self.revealed = active;
        let (rows, height) = (&self.rows, list::row_height(ui));
        let reveal = active.filter(|_| is_other).and_then(|node| rows.iter().position(|row| row.node == node));
        let list = List { id: "built nodes", count: rows.len(), height, reveal, follow: false };
        list.show(ui, |ui, range, place| {
            for number in range {
                row(ui, place(number), &rows[number], world, shown, requests);
            }
        });
    }
}

/// Nodes that stand in the hierarchy of a joint, or that its commands made: `true` at their places.
fn belonging(built: &BuiltRig, rig: &Rig, top: Uid) -> Vec<bool> {
    let joints: HashSet<Uid> = rig.hierarchy(top).map(|joint| joint.data.uid).collect();
    let mut inside: Vec<bool> = Vec::with_capacity(built.nodes.len());
    for node in &built.nodes {
        let maker = || node.origin.as_ref().and_then(|origin| rig.find_tag(origin.command));
        let is_below = node.parent.is_some_and(|parent| inside[parent]);
        let is_inside =
            is_below || joints.contains(&node.uid) || maker().is_some_and(|(of, _)| joints.contains(&of.data.uid));
        inside.push(is_inside);
    }
    inside
}

/// Nodes of a built rig that are asked for: each below its parent, or as a list, as they are with words.
fn rows(built: &BuiltRig, rig: &Rig, WantedNodes { filter, is_flat, top }: WantedNodes) -> Vec<BuiltRow> {
    let words: Vec<String> = filter.split_whitespace().map(str::to_lowercase).collect();
    let inside = top.map(|top| belonging(built, rig, top));
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); built.nodes.len()];
    let mut roots = Vec::new();
    for (number, node) in built.nodes.iter().enumerate() {
        match node.parent {
            Some(parent) => children[parent].push(number),
            None => roots.push(number),
        }
    }
    let mut stack: Vec<(usize, usize)> = roots.into_iter().rev().map(|root| (root, 0)).collect();
    let mut rows = Vec::with_capacity(built.nodes.len());
    while let Some((number, depth)) = stack.pop() {
        stack.extend(children[number].iter().rev().map(|child| (*child, depth + 1)));
        let node = &built.nodes[number];
        let kind = match node.kind {
            NodeType::Joint => "joint",
            NodeType::Null => "null",
            NodeType::Control => "control",
        };
        let about = match &node.origin {
            Some(origin) if &*origin.module != kind => format!("{kind} of {}", origin.module),
            _ => kind.to_owned(),
        };
        let name = node.label.as_deref().unwrap_or(&node.name).to_owned();
        let text = format!("{name} {about}").to_lowercase();
        let is_inside = inside.as_ref().is_none_or(|inside| inside[number]);
        if is_inside && words.iter().all(|word| text.contains(word.as_str())) {
            let depth = if words.is_empty() && !is_flat { depth } else { 0 };
            let command = node.origin.as_ref().map(|origin| origin.command);
            rows.push(BuiltRow { node: node.uid, name, depth, about, command });
        }
    }
    let left = rows.iter().map(|row| row.depth).min().unwrap_or_default();
    rows.iter_mut().for_each(|row| row.depth = (row.depth - left).min(MOST_STEPS));
    rows
}

fn row(ui: &mut Ui, rect: egui::Rect, row: &BuiltRow, world: &World, shown: &DisplayedRig, requests: &mut Requests) {
    let is_selected = shown.selection.0.contains(&row.node);
    let response = ui.interact(rect, ui.id().with(("built", row.node.0)), Sense::click());
    let said = format!("{}, {}", row.name, row.about);
    response.widget_info(|| WidgetInfo::selected(WidgetType::SelectableLabel, true, is_selected, &said));
    if is_selected {
        ui.painter().rect_filled(rect, 2.0, ui.visuals().selection.bg_fill.gamma_multiply(0.6));
    } else if response.hovered() {
        ui.painter().rect_filled(rect, 2.0, ui.visuals().widgets.hovered.weak_bg_fill);
    }
    let left = rect.left() + 4.0 + INDENT * row.depth as f32;
    let middle = (rect.left() + 0.62 * rect.width()).max(left + 30.0);
    let name = egui::Rect::from_min_max(pos2(left, rect.top()), pos2(middle, rect.bottom()));
    list::line(ui, name, &row.name, ui.visuals().text_color());
    let about = egui::Rect::from_min_max(pos2(middle + 4.0, rect.top()), rect.right_bottom());
    list::line(ui, about, &row.about, ui.visuals().weak_text_color());
    if response.clicked() {
        let add = ui.input(|input| input.modifiers.shift || input.modifiers.command);
        requests.send(PickRequest { rig: shown.entity, what: Pick::Joints(vec![row.node]), add });
    }
    if let Some(command) = row.command {
        response.context_menu(|ui| {
            if ui.button("Show the command that made it").clicked() {
                show_tag(world, shown, command, requests);
                ui.close();
            }
        });
    }
    response.on_hover_text(said);
}
