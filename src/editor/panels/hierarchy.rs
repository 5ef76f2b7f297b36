//! Hierarchy panel: the joints with their tags, or all nodes that are built, as a tree or as a list; of the whole document,
//! or of one of several rigs in it, as they are after a merge.
//!
//! The panel shows the rig's own selection and changes it with pick requests, so the viewport and the tree never
//! differ.

mod built_nodes;
mod keys;
mod menu;
mod row;
mod row_tags;
pub mod rows;

use std::collections::HashSet;

use bevy::prelude::*;
use bevy_egui::egui::{self, ComboBox, DragAndDrop, Rect, Sense, Ui, WidgetInfo, WidgetType};

use super::{
    displayed_rig::{DisplayedRig, Stamp},
    list::{self, List},
};
use crate::{
    editor::{
        counts::counted,
        library::{DraggedTemplate, goes_onto_both},
        notice::Notice,
        panel::{EditorPanel, Requests},
    },
    plugins::{
        commands::BuildResult,
        document::EditRequest,
        picking::{HoverJoint, Pick, PickRequest},
    },
    rig::{Rig, Uid, operations::Operation},
};
use built_nodes::{BuiltTree, WantedNodes};
use rows::{Row, flat_rows, rows, within};

/// The panel.
#[derive(Default)]
pub struct HierarchyPanel {
    filter: String,
    folded: HashSet<Uid>,
    tree: Tree,
    /// Marks a change of the folded joints.
    stale: bool,
    selected: (Option<Stamp>, HashSet<Uid>),
    /// The active joint that was last scrolled into view.
    revealed: Option<Uid>,
    /// First joint of a range selection.
    anchor: Option<Uid>,
    rename: Option<Rename>,
    group: String,
    /// The joint that the tree last reported as hovered.
    pointed: Option<Uid>,
    /// The joint of the row under the pointer.
    under: Option<Uid>,
    /// True if a part is dragged that goes onto both sides.
    is_for_both: bool,
    built: BuiltTree,
    /// True if all nodes of the built rig are listed, not its joints alone.
    shows_built: bool,
    /// True if the rows are a list, without their hierarchy.
    is_flat: bool,
    /// Joint whose hierarchy alone is listed.
    top: Option<Uid>,
}

/// The listed rows with the state they were made from.
#[derive(Default)]
struct Tree {
    made_from: Option<(Stamp, String)>,
    rows: Vec<Row>,
    deepest: usize,
}

/// A label being typed.
struct Rename {
    joint: Uid,
    text: String,
    /// Marks that the field has had the keyboard focus.
    focused: bool,
}

/// Joints dragged to another parent.
struct DraggedJoints(Vec<Uid>);

impl EditorPanel for HierarchyPanel {
    fn title(&self) -> &'static str {
        "Hierarchy"
    }

    fn show(&mut self, ui: &mut Ui, world: &World, requests: &mut Requests) {
        let Some(shown) = DisplayedRig::of(world) else {
            return list::nothing(ui, "No rig is open.");
        };
        if shown.rig.is_empty() {
            self.rename = None;
            return list::nothing(ui, "No joints yet: place them with clicks or draw them with strokes.");
        }
        self.top = self.top.filter(|top| shown.rig.joint(*top).is_some());
        if self.shows_built {
            return self.built_nodes(ui, world, &shown, requests);
        }
        self.bar(ui, &shown, world.get::<BuildResult>(shown.entity).is_some());
        self.choose_top(ui, &shown);
        self.reveal_active(&shown);
        self.refresh(&shown);
        keys::press(self, ui, &shown, requests);
        let reveal = self.newly_active(&shown);
        self.under = None;
        let dragged = DragAndDrop::payload::<DraggedTemplate>(ui.ctx());
        self.is_for_both = dragged.is_some_and(|dragged| goes_onto_both(world, &dragged));
        let drawn = self.list(ui, &shown, reveal, requests);
        self.end_rename(&shown, drawn, requests);
        if self.under != self.pointed {
            self.pointed = self.under;
            requests.send(HoverJoint { rig: shown.entity, joint: self.under });
        }
    }
}

impl HierarchyPanel {
    /// Draws the nodes of the built rig in place of the joints.
    fn built_nodes(&mut self, ui: &mut Ui, world: &World, shown: &DisplayedRig, requests: &mut Requests) {
        self.rename = None;
        if self.pointed.take().is_some() {
            requests.send(HoverJoint { rig: shown.entity, joint: None });
        }
        let tip = "Nodes whose name, kind or module contains all of these words";
        let (mut is_back, is_flat) = (false, &mut self.is_flat);
        list::search_bar(ui, "Filter", tip, &mut self.filter, |ui| {
            // The joints change with it.
            self.stale |= flat_button(ui, is_flat);
            is_back = ui.button("Joints").on_hover_text("Back to the joints").clicked();
        });
        self.shows_built = !is_back;
        self.choose_top(ui, shown);
        let wanted = WantedNodes { filter: &self.filter, is_flat: self.is_flat, top: self.top };
        self.built.show(ui, world, shown, wanted, requests);
    }

    /// Draws the choice between all hierarchies and one of them, where there are several, or one was chosen in the menu of a
    /// joint.
    fn choose_top(&mut self, ui: &mut Ui, shown: &DisplayedRig) {
        let roots = shown.rig.roots();
        if roots.len() < 2 && self.top.is_none() {
            return;
        }
        let mut next = self.top;
        let only = |top: Uid| format!("Only {}", shown.name(top));
        let now = next.map_or_else(|| "All".to_owned(), only);
        let combo = ComboBox::from_id_salt("top").selected_text(now).width(ui.available_width()).truncate();
        let combo = combo.show_ui(ui, |ui| {
            ui.selectable_value(&mut next, None, "All");
            for root in roots {
                ui.selectable_value(&mut next, Some(*root), only(*root));
            }
        });
        combo.response.widget_info(|| WidgetInfo::labeled(WidgetType::ComboBox, true, "Listed hierarchy"));
        combo.response.on_hover_text("All nodes, or those of one hierarchy");
        self.list_below(next);
    }

    /// Lists the hierarchy of a joint alone, or everything.
    fn list_below(&mut self, top: Option<Uid>) {
        self.stale |= self.top != top;
        self.top = top;
    }

    /// Draws the filter, the fold buttons, the switch to a list, and that to the built nodes if there are any.
    fn bar(&mut self, ui: &mut Ui, shown: &DisplayedRig, is_built: bool) {
        let mut fold: Option<bool> = None;
        let shows_built = &mut self.shows_built;
        let tip = "Joints whose label, group or tags contain all of these words";
        let is_flat = &mut self.is_flat;
        list::search_bar(ui, "Filter", tip, &mut self.filter, |ui| {
            self.stale |= flat_button(ui, is_flat);
            if is_built && ui.button("Nodes").on_hover_text("All built nodes, controls too").clicked() {
                *shows_built = true;
            }
            if *is_flat {
                return;
            }
            if list::symbol_button(ui, "⏵", "Fold all") {
                fold = Some(true);
            }
            if list::symbol_button(ui, "⏷", "Unfold all") {
                fold = Some(false);
            }
        });
        if let Some(fold) = fold {
            let parents = shown.rig.walk().filter(|joint| fold && !joint.children.is_empty());
            self.folded = parents.map(|joint| joint.data.uid).collect();
            self.stale = true;
        }
        if !self.filter.trim().is_empty() {
            let found = self.tree.rows.iter().filter(|row| row.matches).count();
            ui.weak(format!("{found} of {}", counted(shown.rig.len(), "joint", "joints")));
        }
    }

    /// Lists the rows again after a change of the rig, the filter or the folded joints.
    fn refresh(&mut self, shown: &DisplayedRig) {
        let stamp = shown.stamp();
        let fresh = self.tree.made_from.as_ref().is_some_and(|(from, filter)| *from == stamp && *filter == self.filter);
        if !fresh || std::mem::take(&mut self.stale) {
            self.folded.retain(|joint| shown.rig.joint(*joint).is_some());
            for above in self.top.into_iter().flat_map(|top| shown.rig.ancestors(top)) {
                self.folded.remove(&above.data.uid);
            }
            let all = match self.is_flat {
                true => flat_rows(&shown.rig, &self.filter),
                false => rows(&shown.rig, &self.folded, &self.filter),
            };
            self.tree.rows = match self.top {
                Some(top) => within(&shown.rig, all, top),
                None => all,
            };
            self.tree.deepest = self.tree.rows.iter().map(|row| row.depth).max().unwrap_or_default();
            self.tree.made_from = Some((stamp, self.filter.clone()));
        }
        let stamp = shown.selection_stamp();
        if self.selected.0 != Some(stamp) {
            self.selected = (Some(stamp), shown.selection.0.iter().copied().collect());
        }
    }

    /// Unfolds the joints above a joint that became active.
    fn reveal_active(&mut self, shown: &DisplayedRig) {
        let active = shown.selection.active();
        if active != self.revealed
            && let Some(active) = active
        {
            let before = self.folded.len();
            for above in shown.rig.ancestors(active) {
                self.folded.remove(&above.data.uid);
            }
            if self.folded.len() != before {
                self.stale = true;
            }
        }
    }

    /// Row of the joint that became active since the last call.
    fn newly_active(&mut self, shown: &DisplayedRig) -> Option<usize> {
        let active = shown.selection.active();
        if active == self.revealed {
            return None;
        }
        self.revealed = active;
        self.row_of(active?)
    }

    fn row_of(&self, joint: Uid) -> Option<usize> {
        self.tree.rows.iter().position(|row| row.joint == joint)
    }

    /// Draws the visible rows; returns `true` if the row being renamed was among them.
    fn list(&mut self, ui: &mut Ui, shown: &DisplayedRig, reveal: Option<usize>, requests: &mut Requests) -> bool {
        let height = list::row_height(ui);
        let tree = std::mem::take(&mut self.tree);
        let renamed = self.rename.as_ref().map(|rename| rename.joint);
        let reveal = reveal.or_else(|| {
            let rename = self.rename.as_ref().filter(|rename| !rename.focused)?;
            tree.rows.iter().position(|row| row.joint == rename.joint)
        });
        let mut drawn = false;
        List { id: "joints", count: tree.rows.len(), height, reveal, follow: false }.show(ui, |ui, range, place| {
            let view = ui.clip_rect();
            let ground = ui.interact(view, ui.id().with("ground"), Sense::click());
            ground.widget_info(|| WidgetInfo::labeled(WidgetType::Other, true, "Space below the joints"));
            for number in range {
                drawn |= renamed == Some(tree.rows[number].joint);
                row::show(self, ui, place(number), &tree, number, shown, requests);
            }
            self.ground(ui, view, &ground, shown, requests);
        });
        self.tree = tree;
        drawn
    }

    /// Handles the area below the last row: a click clears the selection, a drop makes roots.
    fn ground(&mut self, ui: &Ui, view: Rect, ground: &egui::Response, shown: &DisplayedRig, requests: &mut Requests) {
        if ground.clicked() {
            requests.send(PickRequest { rig: shown.entity, what: Pick::None, add: false });
        }
        autoscroll(ui, view);
        if let Some(dragged) = ground.dnd_release_payload::<DraggedJoints>() {
            reparent(&dragged.0, None, shown, requests);
        }
    }

    /// Accepts the typed text once the field has lost the focus or is out of view; Escape drops it.
    fn end_rename(&mut self, shown: &DisplayedRig, drawn: bool, requests: &mut Requests) {
        let over = self.rename.as_ref().is_some_and(|rename| !drawn && rename.focused);
        if over {
            self.accept_rename(shown, requests);
        }
    }

    fn accept_rename(&mut self, shown: &DisplayedRig, requests: &mut Requests) {
        let Some(Rename { joint, text, .. }) = self.rename.take() else { return };
        let Some(known) = shown.rig.joint(joint) else { return };
        if known.data.label.as_deref().unwrap_or_default() != text.trim() {
            let operation = Operation::Labels(vec![(joint, text.trim().to_owned())]);
            requests.send(EditRequest::operation(shown.entity, operation));
        }
    }

    fn start_rename(&mut self, joint: Uid, shown: &DisplayedRig) {
        if let Some(known) = shown.rig.joint(joint) {
            let text = known.data.label.clone().unwrap_or_default();
            self.rename = Some(Rename { joint, text, focused: false });
        }
    }

    /// Folds or unfolds a joint, with `deep` its whole hierarchy.
    fn fold(&mut self, joint: Uid, fold: bool, deep: bool, shown: &DisplayedRig) {
        let all: Vec<Uid> = match deep {
            true => shown.rig.hierarchy(joint).map(|joint| joint.data.uid).collect(),
            false => vec![joint],
        };
        for joint in all {
            if fold {
                self.folded.insert(joint)
            } else {
                self.folded.remove(&joint)
            };
        }
        self.stale = true;
    }
}

/// Draws the switch between a list and a tree; returns `true` if it was clicked.
fn flat_button(ui: &mut Ui, is_flat: &mut bool) -> bool {
    let said = "As a list";
    let button = ui.selectable_label(*is_flat, "☰").on_hover_text("As a list, without the hierarchy");
    button.widget_info(|| WidgetInfo::selected(WidgetType::SelectableLabel, true, *is_flat, said));
    let is_clicked = button.clicked();
    *is_flat ^= is_clicked;
    is_clicked
}

/// Selects joints; the last is active.
fn select(joints: Vec<Uid>, shown: &DisplayedRig, requests: &mut Requests) {
    requests.send(PickRequest { rig: shown.entity, what: Pick::Joints(joints), add: false });
}

/// Joints of `joints` that are below none of the others, in the order of the tree.
fn tops(rig: &Rig, joints: &[Uid]) -> Vec<Uid> {
    let listed: HashSet<Uid> = joints.iter().copied().collect();
    let is_top = |joint: &Uid| !rig.ancestors(*joint).any(|above| listed.contains(&above.data.uid));
    rig.walk().map(|joint| joint.data.uid).filter(|joint| listed.contains(joint)).filter(is_top).collect()
}

/// Reason why joints cannot be moved below `parent`, if any.
fn obstacle(joints: &[Uid], parent: Option<Uid>, shown: &DisplayedRig) -> Option<String> {
    let parent = parent?;
    if joints.contains(&parent) {
        return Some(format!("{} cannot hang below itself", shown.name(parent)));
    }
    let above = shown.rig.ancestors(parent).find(|above| joints.contains(&above.data.uid))?;
    let (joint, parent) = (shown.name(above.data.uid), shown.name(parent));
    Some(format!("{joint} cannot hang below {parent}, which hangs below it"))
}

/// Moves joints below another, or sends a notice with the reason. Joints already there stay.
fn reparent(joints: &[Uid], parent: Option<Uid>, shown: &DisplayedRig, requests: &mut Requests) {
    if joints == [parent.unwrap_or_default()] {
        // The joint was dropped on itself.
        return;
    }
    if let Some(obstacle) = obstacle(joints, parent, shown) {
        let text = format!("{obstacle}. Drop it on a joint outside its hierarchy.");
        requests.send(Notice::warning(text).named());
        return;
    }
    let elsewhere = |joint: &Uid| shown.rig.joint(*joint).is_some_and(|joint| joint.parent != parent);
    let joints: Vec<Uid> = joints.iter().copied().filter(elsewhere).collect();
    if !joints.is_empty() {
        requests.send(EditRequest::operation(shown.entity, Operation::Reparent { joints, parent }));
    }
}

/// Scrolls while dragged joints are near an edge of the view.
fn autoscroll(ui: &Ui, view: Rect) {
    let Some(pointer) = ui.input(|input| input.pointer.latest_pos()) else { return };
    if !DragAndDrop::has_payload_of_type::<DraggedJoints>(ui.ctx()) || !view.x_range().contains(pointer.x) {
        return;
    }
    let edge = 24.0;
    let (up, down) = (view.top() + edge - pointer.y, pointer.y - (view.bottom() - edge));
    let speed = if up > 0.0 { up.min(edge) } else { -down.clamp(0.0, edge) };
    if speed != 0.0 {
        ui.scroll_with_delta_animation(egui::vec2(0.0, speed * 0.4), egui::style::ScrollAnimation::none());
        ui.ctx().request_repaint();
    }
}
