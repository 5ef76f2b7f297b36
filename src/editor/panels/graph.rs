//! Graph panel: commands as nodes, references as wires, features and local groups as frames.
//!
//! The same document as the Tags and the Process panel, seen as a graph that lays itself out: the graph is derived from the
//! rig and its builder whenever one of them changes, and every edit is an operation on tags. In a graph of many commands
//! frames are folded to boxes, but for those of selected joints. Only places of nodes that a person moved, and frames that
//! a person opened or folded, are the graph's own ([`GraphView`]); places are stored with the project's view, frames last as
//! long as the window.

mod action;
mod arrange;
mod boxes;
mod canvas;
mod carry_out;
mod chart;
mod edits;
mod focus;
mod gesture;
pub mod layout;
mod letters;
mod look;
mod menu;
mod model;
mod node;
mod state;
mod wires;

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use bevy::{ecs::change_detection::Tick, prelude::*};
use bevy_egui::egui::{self, Id, Popup, Pos2, Rect, Response, SetOpenCommand, Ui, emath::TSTransform};
use egui_snarl::{NodeId, Snarl};

pub use self::{
    action::{GraphAction, obstacle, over_graph},
    chart::{ChartFrame, GraphChart},
    focus::MOST_LIT,
    state::{FEW, GraphLook, GraphRequest, GraphView},
};
use self::{
    boxes::Tally,
    canvas::{Canvas, NodePart, SCALES, Scene},
    edits::Bench,
    focus::Focus,
    gesture::{Gesture, Hand, Outcome, is_dropped, pointer},
    layout::LayoutNode,
    look::ModuleLooks,
    menu::{Menu, MenuTarget, add_to_selected, button, send},
    model::Graph,
    wires::Spots,
};
use super::{
    displayed_rig::{DisplayedRig, Stamp},
    list,
};
use crate::{
    editor::{
        actions::ActionRequest,
        counts::counted,
        library::DraggedModule,
        notice::Notice,
        panel::{EditorPanel, Requests},
    },
    plugins::{
        RigSystems,
        commands::{Processor, RigModules},
    },
    processor::{CommandStatus, Modules},
    rig::Uid,
};

/// Plugin of the graph: its state and actions.
pub struct GraphPlugin;

impl Plugin for GraphPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<GraphView>()
            .add_message::<GraphRequest>()
            .add_message::<ActionRequest>()
            .add_message::<Notice>()
            .add_systems(Update, carry_out::attend.after(RigSystems::Gesture).before(RigSystems::Edits))
            .add_systems(Last, carry_out::follow_selection);
    }
}

/// Name of the panel.
const TITLE: &str = "Graph";

/// Scale of the first look at a graph that does not fit into the panel at a larger one: names can be read.
const FIRST_SCALE: f32 = 0.7;

/// Seconds for which a command that ran flashes.
const FLASH: f64 = 0.7;

/// The panel.
#[derive(Default)]
pub struct GraphPanel {
    made_from: Option<(Stamp, Option<Tick>)>,
    modules: Option<Arc<Modules>>,
    looks: ModuleLooks,
    graph: Graph,
    /// Nodes and edges that the layout was made of.
    laid_out: (Vec<LayoutNode>, Vec<(usize, usize)>),
    /// Places of the layout.
    laid: Vec<[f32; 2]>,
    /// Commands that each command read in its last run.
    reads: BTreeMap<Uid, Vec<Uid>>,
    /// Place of each command; `None` where its frame is folded.
    places: Vec<Option<[f32; 2]>>,
    /// Place of each folded frame.
    folded: Vec<Option<[f32; 2]>>,
    /// Frames that are open.
    open: Vec<bool>,
    /// True if the graph was made again since it was laid out.
    is_stale: bool,
    tallies: Vec<Tally>,
    statuses: Vec<Option<CommandStatus>>,
    /// Number of runs of each command when the graph was made last; `None` before that.
    runs: Option<BTreeMap<Uid, u32>>,
    /// Second at which each command that ran began to flash.
    flashes: BTreeMap<Uid, f64>,
    snarl: Snarl<Uid>,
    in_snarl: BTreeMap<Uid, NodeId>,
    transform: TSTransform,
    /// Rig that is in view, and the number of the last request of the view.
    looked: Option<(Entity, u64)>,
    gesture: Option<Gesture>,
    /// Commands whose wires are drawn in full.
    focus: Focus,
    menu: Option<MenuTarget>,
    words: String,
    /// True if all nodes were in view in the last frame.
    sees_all: bool,
    /// True if the graph was laid out again while all of it was in view, and is brought into view again.
    refits: bool,
}

impl EditorPanel for GraphPanel {
    fn title(&self) -> &'static str {
        TITLE
    }

    fn show(&mut self, ui: &mut Ui, world: &World, requests: &mut Requests) {
        let (Some(shown), Some(view), Some(modules)) =
            (DisplayedRig::of(world), world.get_resource::<GraphView>(), world.get_resource::<RigModules>())
        else {
            return list::nothing(ui, "No rig is open.");
        };
        let is_pointed = ui.rect_contains_pointer(ui.max_rect());
        if is_pointed != view.hovered {
            requests.send(GraphRequest::Hover(is_pointed));
        }
        let now = ui.input(|input| input.time);
        self.refresh(world, &shown, &modules.0, now);
        self.arrange(view);
        self.bar(ui, world, &shown, view, &modules.0, requests);
        if self.graph.nodes.is_empty() {
            self.gesture = None;
            return list::nothing(ui, "No joint has commands yet: add tags to the selected joints, or a part.");
        }
        self.canvas(ui, world, &shown, view, &modules.0, requests);
    }
}

impl GraphPanel {
    /// Makes the graph again if the rig or its build changed.
    fn refresh(&mut self, world: &World, shown: &DisplayedRig, modules: &Arc<Modules>, now: f64) {
        let processor = world.get_entity(shown.entity).ok().and_then(|rig| rig.get_ref::<Processor>());
        let made_from = Some((shown.stamp(), processor.as_ref().map(|processor| processor.last_changed())));
        let has_same_modules = self.modules.as_ref().is_some_and(|known| Arc::ptr_eq(known, modules));
        if self.made_from == made_from && has_same_modules {
            return;
        }
        if !has_same_modules {
            self.looks.clear();
            self.graph = Graph::default();
            self.modules = Some(modules.clone());
        }
        if self.made_from.is_none_or(|(stamp, _)| !stamp.is_of(shown.entity)) {
            (self.runs, self.gesture, self.menu) = (None, None, None);
            self.flashes.clear();
        }
        self.made_from = made_from;
        let builder = processor.as_ref().map(|processor| processor.builder());
        let known = std::mem::take(&mut self.graph);
        self.graph = Graph::of(&shown.rig, builder, modules, &mut self.looks, known);
        self.statuses = self.graph.nodes.iter().map(|node| builder?.status(node.tag)).collect();
        self.note_runs(now);
        self.tallies = Tally::all(&self.graph, &self.statuses);
        self.is_stale = true;
    }

    /// Lets the commands flash that ran since the last look.
    fn note_runs(&mut self, now: f64) {
        let nodes = self.graph.nodes.iter().zip(&self.statuses);
        let runs: BTreeMap<Uid, u32> =
            nodes.filter_map(|(node, status)| Some((node.tag, status.as_ref()?.runs))).collect();
        if let Some(before) = &self.runs {
            let ran = runs.iter().filter(|(tag, runs)| before.get(tag).copied().unwrap_or(0) < **runs);
            self.flashes.extend(ran.map(|(tag, _)| (*tag, now)));
        }
        self.runs = Some(runs);
    }

    /// Strength of each node's flash; asks for frames as long as there is one.
    fn glow(&mut self, ui: &Ui) -> Vec<f32> {
        let now = ui.input(|input| input.time);
        self.flashes.retain(|_, began| now - *began < FLASH);
        if !self.flashes.is_empty() {
            ui.ctx().request_repaint();
        }
        let strength = |began: &f64| (1.0 - (now - began) / FLASH).clamp(0.0, 1.0) as f32;
        self.graph.nodes.iter().map(|node| self.flashes.get(&node.tag).map_or(0.0, strength)).collect()
    }

    /// Draws the buttons above the graph.
    fn bar(
        &mut self,
        ui: &mut Ui,
        world: &World,
        shown: &DisplayedRig,
        view: &GraphView,
        modules: &Arc<Modules>,
        requests: &mut Requests,
    ) {
        let (graph, words) = (&self.graph, &mut self.words);
        ui.horizontal(|ui| {
            let bench = Bench { rig: &shown.rig, modules, graph };
            ui.menu_button("+ Add", |ui| add_to_selected(ui, shown, &bench, words, requests));
            button(ui, world, GraphAction::LayOut, "Lay out again", requests);
            button(ui, world, GraphAction::ShowAll, "Show all", requests);
            if !graph.frames.is_empty() {
                button(ui, world, GraphAction::OpenFrames, "Open all", requests);
                button(ui, world, GraphAction::FoldFrames, "Fold all", requests);
            }
            let count = counted(graph.nodes.len(), "command", "commands");
            let selected = view.selected.len();
            let text = if selected == 0 { count } else { format!("{count}, {selected} selected") };
            ui.add(egui::Label::new(egui::RichText::new(text).weak()).truncate());
        });
    }

    /// The transform that brings into view what was asked for; `None` if nothing was.
    fn wanted(
        &mut self,
        rig: Entity,
        view: &GraphView,
        (rects, boxes): (&[Rect], &[Option<Rect>]),
        area: Rect,
    ) -> Option<TSTransform> {
        let (number, look) = view.look;
        let is_other = self.looked.is_none_or(|(known, _)| known != rig);
        let refits = std::mem::take(&mut self.refits);
        if self.looked == Some((rig, number)) && !refits || !area.is_positive() {
            return None;
        }
        let is_asked = self.looked != Some((rig, number)) && !is_other;
        let look = if is_asked { look } else { GraphLook::All };
        self.looked = Some((rig, number));
        let is_meant = |tag: &Uid| look == GraphLook::All || view.selected.contains(tag);
        let spots = Spots { graph: &self.graph, rects, boxes };
        let nodes = self.graph.nodes.iter().enumerate().filter(|(_, node)| is_meant(&node.tag));
        let mut space = nodes.fold(Rect::NOTHING, |space, (number, _)| space.union(spots.shown(number)));
        if look == GraphLook::All {
            space = spots.frames().into_iter().filter(|frame| frame.is_finite()).fold(space, Rect::union);
        }
        if !space.is_finite() {
            return None;
        }
        let space = space.expand(30.0);
        let fitting = area.size() / space.size();
        let fitted = fitting.min_elem().clamp(SCALES[0], 1.0);
        let (mut scale, mut centre) = (fitted, space.center());
        if is_other && fitted < FIRST_SCALE {
            (scale, centre) = first_look(spots, view, area).unwrap_or_else(|| {
                let start = space.min + area.size() / (2.0 * FIRST_SCALE);
                (FIRST_SCALE, start)
            });
        }
        let from = area.center() - scale * centre.to_vec2();
        Some(TSTransform::new(from.to_vec2(), scale))
    }

    fn canvas(
        &mut self,
        ui: &mut Ui,
        world: &World,
        shown: &DisplayedRig,
        view: &GraphView,
        modules: &Arc<Modules>,
        requests: &mut Requests,
    ) {
        let area = ui.available_rect_before_wrap();
        let glow = self.glow(ui);
        if is_dropped(ui) {
            self.gesture = None;
        }
        let (rest, rest_boxes) = (self.rects(view, egui::Vec2::ZERO), self.boxes(view, egui::Vec2::ZERO));
        let want = self.wanted(shown.entity, view, (rest.as_slice(), rest_boxes.as_slice()), area);
        let transform = want.unwrap_or(self.transform);
        let inverse = transform.inverse();
        let at = ui.input(|input| input.pointer.latest_pos()).map(|at| inverse * at);
        let (held, is_down) = ui.input(|input| (input.modifiers, input.pointer.primary_down()));
        let hand = Hand {
            graph: &self.graph,
            rects: &rest,
            boxes: &rest_boxes,
            selected: &view.selected,
            at,
            pressed: None,
            held,
            scale: transform.scaling,
        };
        let by = match &self.gesture {
            Some(Gesture::Nodes(_, from) | Gesture::Folded(_, from)) => hand.shift(*from),
            _ => egui::Vec2::ZERO,
        };
        let is_free = self.gesture.is_none() && ui.rect_contains_pointer(area);
        let hovered = if is_free { hand.wire_at() } else { None };
        let under = if is_free { hand.commands_at() } else { BTreeSet::new() };
        let (rects, boxes) = (self.rects(view, by), self.boxes(view, by));
        let hand = Hand { rects: &rects, boxes: &boxes, ..hand };
        let ink = self.gesture.as_ref().and_then(|gesture| hand.ink(gesture));
        self.focus = Focus::of(&view.selected, under);
        let id = Id::new("command graph");
        let mut canvas = Canvas {
            scene: Scene {
                graph: &self.graph,
                rects: &rects,
                boxes: &boxes,
                tallies: &self.tallies,
                statuses: &self.statuses,
                glow: &glow,
                selected: &view.selected,
                hovered,
                focus: &self.focus,
                ink: ink.as_ref(),
            },
            id,
            area,
            transform,
            want,
            hold: is_down,
            shown: &mut self.in_snarl,
            visible: Vec::new(),
            touched: Vec::new(),
        };
        let ground = canvas.show(ui, &mut self.snarl);
        self.transform = canvas.transform;
        let shown_nodes = rects.iter().filter(|rect| rect.is_finite()).count();
        let space = canvas.view();
        self.sees_all =
            canvas.visible.len() == shown_nodes && boxes.iter().flatten().all(|rect| rect.intersects(space));
        let (at, pressed) = pointer(ui, &canvas);
        let hand = Hand { at, pressed, scale: canvas.transform.scaling, ..hand };
        let mut outcomes = Vec::new();
        let mut gesture = self.gesture.take();
        for (part, response) in &canvas.touched {
            hand.touch(Some(*part), response, &mut gesture, &mut outcomes);
        }
        hand.touch(None, &ground, &mut gesture, &mut outcomes);
        let bench = Bench { rig: &shown.rig, modules, graph: &self.graph };
        if !is_down && let Some(gesture) = gesture.take() {
            outcomes.extend(hand.end(gesture, &bench));
        }
        self.gesture = gesture;
        let mut opened = None;
        for outcome in outcomes {
            match outcome {
                Outcome::Select(tags) => requests.send(GraphRequest::Select(tags)),
                Outcome::Fold(frame, is_open) => requests.send(GraphRequest::Fold(frame, is_open)),
                Outcome::Move(list) => requests.send(GraphRequest::Move(list)),
                Outcome::Edit(operation) => send(operation, shown, requests),
                Outcome::Refused(error) => requests.send(Notice::error(format!("The wire was not set: {error}."))),
                Outcome::Menu(target) => {
                    self.menu = Some(target);
                    opened = Some(SetOpenCommand::Bool(true));
                }
                Outcome::CloseMenu => opened = Some(SetOpenCommand::Bool(false)),
            }
        }
        let mut menu = Menu { world, shown, bench, words: &mut self.words };
        if let Some(module) = dropped_module(&ground, &canvas.touched) {
            menu.drop_module(module.0, hand.target(None), requests);
        }
        let Some(target) = self.menu else { return };
        Popup::context_menu(&ground).open_memory(opened).show(|ui| menu.show(ui, target, requests));
    }
}

/// Scale and centre of the first look at a large graph with selected commands, at which names can be read: all of them with
/// what they read and what reads them, or all of them, or else where most of them are together. `None` without any.
fn first_look(spots: Spots, view: &GraphView, area: Rect) -> Option<(f32, Pos2)> {
    let graph = spots.graph;
    let is_selected = |number: usize| view.selected.contains(&graph.nodes[number].tag);
    let selected: Vec<Rect> =
        (0..graph.nodes.len()).filter(|number| is_selected(*number)).map(|number| spots.shown(number)).collect();
    let first = selected.first()?.center();
    let alone = selected.iter().copied().fold(Rect::NOTHING, Rect::union);
    let around = graph.wires.iter().filter(|wire| is_selected(wire.from) || is_selected(wire.to));
    let around =
        around.flat_map(|wire| [wire.from, wire.to]).map(|number| spots.shown(number)).fold(alone, Rect::union);
    for space in [around, alone] {
        let space = space.expand(30.0);
        let scale = (area.size() / space.size()).min_elem();
        if scale >= FIRST_SCALE {
            return Some((scale.min(1.0), space.center()));
        }
    }
    // Those of folded frames share a box, and are no crowd.
    let open: Vec<Rect> = (0..graph.nodes.len())
        .filter(|number| is_selected(*number))
        .map(|number| spots.rects[number])
        .filter(|rect| rect.is_finite())
        .collect();
    let seen = |centre: Pos2| Rect::from_center_size(centre, area.size() / FIRST_SCALE);
    let together = |centre: Pos2| open.iter().filter(|rect| seen(centre).contains_rect(**rect)).count();
    let mut best = (0, first);
    for centre in open.iter().map(Rect::center) {
        let count = together(centre);
        if count > best.0 {
            best = (count, centre);
        }
    }
    Some((FIRST_SCALE, best.1))
}

/// Module of the library that is let go over the graph.
fn dropped_module(ground: &Response, parts: &[(NodePart, Response)]) -> Option<DraggedModule> {
    let mut all = parts.iter().map(|(_, part)| part).chain([ground]);
    all.find_map(|part| part.dnd_release_payload::<DraggedModule>()).map(|module| *module)
}
