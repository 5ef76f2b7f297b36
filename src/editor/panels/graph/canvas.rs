//! The canvas: Snarl with the nodes in view, over wires and frames.
//!
//! Snarl lays out each of its nodes in every frame, so it only has those in view, and none while there are too many to be
//! read: then a node is a rectangle. Selection and wires are the panel's own, since Snarl forgets what leaves the view.

use std::collections::{BTreeMap, BTreeSet};

use bevy_egui::egui::{
    self, Color32, Frame, Id, Painter, Pos2, Rect, Response, Sense, Shape, Stroke, StrokeKind, Style, Ui,
    emath::TSTransform,
};
use egui_snarl::{
    InPin, NodeId, OutPin, Snarl,
    ui::{BackgroundPattern, PinInfo, SnarlPin, SnarlStyle, SnarlViewer},
};

use super::{
    boxes::{self, Tally},
    focus::Focus,
    letters,
    model::{Graph, GraphWire},
    node,
    wires::{self, HEAD, Spots, WireInk},
};
use crate::{
    editor::{panels::process, style},
    processor::CommandStatus,
    rig::Uid,
};

/// Most nodes that Snarl lays out.
pub(super) const MOST_DETAILED: usize = 40;
/// Most rectangles with titles.
const MOST_TITLED: usize = 150;
/// Smallest scale at which nodes are laid out.
const READABLE: f32 = 0.45;
/// Smallest scale at which rectangles have titles.
const LEGIBLE: f32 = 0.3;
/// Smallest and largest scale.
pub(super) const SCALES: [f32; 2] = [0.03, 2.0];

/// Part of a node that the pointer can meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NodePart {
    Body(usize),
    Output(usize),
    Input(usize, usize),
}

/// Shape under the pointer while it drags, in the graph's space.
pub(super) enum Ink {
    Wire([Pos2; 2]),
    Box(Rect),
}

/// State of all nodes as the canvas draws them.
#[derive(Clone, Copy)]
pub(super) struct Scene<'a> {
    pub graph: &'a Graph,
    pub rects: &'a [Rect],
    /// Rectangle of each folded frame.
    pub boxes: &'a [Option<Rect>],
    /// Numbers of the commands of each frame.
    pub tallies: &'a [Tally],
    pub statuses: &'a [Option<CommandStatus>],
    /// Strength of each node's flash, 0 to 1.
    pub glow: &'a [f32],
    pub selected: &'a BTreeSet<Uid>,
    pub hovered: Option<GraphWire>,
    /// Commands whose wires are drawn in full.
    pub focus: &'a Focus,
    pub ink: Option<&'a Ink>,
}

impl Scene<'_> {
    fn spots(&self) -> Spots<'_> {
        Spots { graph: self.graph, rects: self.rects, boxes: self.boxes }
    }
}

/// A drawing of the graph.
pub(super) struct Canvas<'a> {
    pub scene: Scene<'a>,
    pub id: Id,
    /// Space of the canvas on the screen.
    pub area: Rect,
    /// Transform from the graph to the screen.
    pub transform: TSTransform,
    /// Another transform than that of the last frame.
    pub want: Option<TSTransform>,
    /// Keeps the transform: the pointer selects or moves.
    pub hold: bool,
    /// Nodes that Snarl has.
    pub shown: &'a mut BTreeMap<Uid, NodeId>,
    /// Nodes in view.
    pub visible: Vec<usize>,
    /// Parts of nodes, with what the pointer does to them.
    pub touched: Vec<(NodePart, Response)>,
}

impl Canvas<'_> {
    /// Draws the canvas; returns what the pointer does to its ground.
    pub fn show(&mut self, ui: &mut Ui, snarl: &mut Snarl<Uid>) -> Response {
        // Snarl selects, and cuts wires, with modifiers held; here that is the panel's own.
        let held = ui.input_mut(|input| std::mem::take(&mut input.modifiers));
        let mut look = SnarlStyle::new();
        look.collapsible = Some(false);
        look.centering = Some(false);
        look.header_drag_space = Some(egui::Vec2::ZERO);
        look.node_frame = Some(Frame::NONE);
        look.header_frame = Some(Frame::NONE);
        look.bg_frame = Some(Frame::NONE.fill(ui.visuals().extreme_bg_color));
        [look.min_scale, look.max_scale] = SCALES.map(Some);
        let widget = egui_snarl::ui::SnarlWidget::new().id(self.id).style(look);
        let ground = ui.scope(|ui| {
            // Without spacing a node is as large as its content.
            ui.spacing_mut().item_spacing = egui::Vec2::ZERO;
            widget.show(snarl, self, ui)
        });
        ui.input_mut(|input| input.modifiers = held);
        let ground = ground.inner;
        self.name(&ground, self.view(), "Graph of commands", None);
        for (number, space) in self.scene.spots().frames().into_iter().enumerate() {
            let (frame, on_screen) = (&self.scene.graph.frames[number], self.transform * space);
            if space.intersects(self.view()) {
                // What the pointer does there, the ground tells.
                let named =
                    ui.interact(on_screen.intersect(self.area), self.id.with(("frame", frame.uid.0)), Sense::hover());
                self.name(&named, space, &boxes::said(&self.scene, number), None);
            }
        }
        self.tell_unread(ui, ground)
    }

    fn is_detailed(&self) -> bool {
        self.transform.scaling >= READABLE && self.visible.len() <= MOST_DETAILED
    }

    /// The part of the graph in view.
    pub fn view(&self) -> Rect {
        self.transform.inverse() * self.area
    }

    /// Draws rectangles in place of nodes: in one shape, and titles where they can be read.
    fn rectangles(&self, painter: &Painter, look: &Style) {
        let scene = &self.scene;
        let visuals = &look.visuals;
        let unit = 1.0 / self.transform.scaling.max(1e-3);
        let mut mesh = egui::Mesh::default();
        for number in &self.visible {
            let (node, rect) = (&scene.graph.nodes[*number], scene.rects[*number]);
            let is_selected = scene.selected.contains(&node.tag);
            if is_selected || scene.glow[*number] > 0.0 {
                let strength = if is_selected { 1.0 } else { scene.glow[*number] };
                mesh.add_colored_rect(rect.expand(2.0 * unit), style::accent(visuals).gamma_multiply(strength));
            }
            mesh.add_colored_rect(rect, visuals.widgets.inactive.bg_fill);
            let state = Rect::from_min_max(rect.min, egui::pos2(rect.left() + 8.0f32.max(2.0 * unit), rect.bottom()));
            mesh.add_colored_rect(state, process::color(visuals, scene.statuses[*number].as_ref()));
        }
        painter.add(Shape::mesh(mesh));
        if !self.has_titles() {
            return;
        }
        for number in &self.visible {
            let rect = scene.rects[*number];
            let place =
                Rect::from_min_max(rect.min + egui::vec2(14.0, 0.0), egui::pos2(rect.right() - 6.0, rect.top() + HEAD));
            let title = &scene.graph.nodes[*number].title;
            letters::title(painter, place, title, 15.0, visuals.text_color(), self.transform.scaling);
        }
    }

    /// True if rectangles in place of nodes have titles.
    fn has_titles(&self) -> bool {
        self.transform.scaling >= LEGIBLE && self.visible.len() <= MOST_TITLED
    }

    /// Tells about a node or folded frame under the pointer whose letters are too small to be drawn.
    fn tell_unread(&self, ui: &Ui, ground: Response) -> Response {
        let scene = &self.scene;
        let Some(at) = ui.input(|input| input.pointer.hover_pos()).filter(|_| ground.hovered()) else { return ground };
        let at = self.transform.inverse() * at;
        let node = self.visible.iter().copied().rfind(|number| scene.rects[*number].contains(at));
        if let Some(node) = node.filter(|_| !self.is_detailed() && !self.has_titles()) {
            return ground.on_hover_ui_at_pointer(|ui| node::about(ui, scene, node));
        }
        let is_unread =
            |folded: &Rect| folded.contains(at) && folded.height() * self.transform.scaling < letters::LEAST;
        match scene.boxes.iter().position(|folded| folded.as_ref().is_some_and(is_unread)) {
            Some(frame) => ground.on_hover_text_at_pointer(boxes::said(scene, frame)),
            None => ground,
        }
    }

    fn draw_ink(&self, painter: &Painter, visuals: &egui::Visuals) {
        let unit = 1.0 / self.transform.scaling.max(1e-3);
        let accent = style::accent(visuals);
        match self.scene.ink {
            Some(Ink::Wire(ends)) => {
                painter.add(Shape::line(wires::curve(*ends), Stroke::new(2.0 * unit, accent)));
            }
            Some(Ink::Box(rect)) => {
                let stroke = Stroke::new(unit, accent);
                painter.rect(*rect, 0.0, accent.gamma_multiply(0.15), stroke, StrokeKind::Inside);
            }
            None => {}
        }
    }
}

/// Pin of a node without pins of Snarl's.
struct NoPin;

impl SnarlPin for NoPin {
    fn draw(self, look: &SnarlStyle, style: &Style, rect: Rect, painter: &Painter) -> egui_snarl::ui::PinWireInfo {
        PinInfo::circle().draw(look, style, rect, painter)
    }
}

impl SnarlViewer<Uid> for Canvas<'_> {
    fn title(&mut self, tag: &Uid) -> String {
        let number = self.scene.graph.at.get(tag);
        number.map_or_else(String::new, |number| self.scene.graph.nodes[*number].title.clone())
    }

    fn inputs(&mut self, _: &Uid) -> usize {
        0
    }

    fn show_input(&mut self, _: &InPin, _: &mut Ui, _: &mut Snarl<Uid>) -> impl SnarlPin + 'static {
        NoPin
    }

    fn outputs(&mut self, _: &Uid) -> usize {
        0
    }

    fn show_output(&mut self, _: &OutPin, _: &mut Ui, _: &mut Snarl<Uid>) -> impl SnarlPin + 'static {
        NoPin
    }

    fn current_transform(&mut self, to_global: &mut TSTransform, snarl: &mut Snarl<Uid>) {
        if let Some(want) = self.want {
            *to_global = want;
        } else if self.hold {
            *to_global = self.transform;
        }
        self.transform = *to_global;
        let view = self.view();
        let rects = self.scene.rects.iter().enumerate();
        self.visible = rects.filter(|(_, rect)| rect.intersects(view)).map(|(number, _)| number).collect();
        let detailed: BTreeMap<Uid, usize> = match self.is_detailed() {
            true => self.visible.iter().map(|number| (self.scene.graph.nodes[*number].tag, *number)).collect(),
            false => BTreeMap::new(),
        };
        self.shown.retain(|tag, node| {
            let stays = detailed.contains_key(tag);
            if !stays && snarl.get_node(*node).is_some() {
                snarl.remove_node(*node);
            }
            stays
        });
        for (tag, number) in detailed {
            let at = self.scene.rects[number].min;
            let node = *self.shown.entry(tag).or_insert_with(|| snarl.insert_node(at, tag));
            if let Some(node) = snarl.get_node_info_mut(node) {
                node.pos = at;
            }
        }
    }

    fn draw_background(
        &mut self,
        _: Option<&BackgroundPattern>,
        viewport: &Rect,
        _: &SnarlStyle,
        look: &Style,
        painter: &Painter,
        _: &Snarl<Uid>,
    ) {
        let visuals = &look.visuals;
        let unit = 1.0 / self.transform.scaling.max(1e-3);
        boxes::draw(painter, *viewport, &self.scene, visuals, unit);
        let ink = WireInk {
            reference: visuals.text_color().gamma_multiply(0.6),
            besides: style::quiet(visuals).gamma_multiply(0.35),
            selected: style::accent(visuals),
            focus: self.scene.focus,
            hovered: self.scene.hovered,
            unit,
        };
        wires::draw(painter, *viewport, self.scene.spots(), &ink);
        boxes::draw_folded(painter, *viewport, &self.scene, visuals, unit);
        if !self.is_detailed() {
            self.rectangles(painter, look);
        }
        self.draw_ink(painter, visuals);
    }

    fn show_header(&mut self, id: NodeId, _: &[InPin], _: &[OutPin], ui: &mut Ui, snarl: &mut Snarl<Uid>) {
        let Some(number) = snarl.get_node(id).and_then(|tag| self.scene.graph.at.get(tag)).copied() else { return };
        let rect = self.scene.rects[number];
        ui.allocate_exact_size(rect.size(), Sense::hover());
        node::draw(ui, &self.scene, number, self.transform.scaling);
        let said = node::said(&self.scene, number);
        let frame = self.id.with(("snarl-node", id)).with("frame");
        if let Some(body) = ui.ctx().read_response(frame) {
            let is_selected = self.scene.selected.contains(&self.scene.graph.nodes[number].tag);
            self.name(&body, rect, &said, Some(is_selected));
            self.touched.push((NodePart::Body(number), body));
        }
        for (part, at, said) in node::pins(&self.scene, number) {
            let rect = Rect::from_center_size(at, egui::vec2(14.0, 14.0));
            let tag = self.scene.graph.nodes[number].tag;
            let salt = match part {
                NodePart::Input(_, input) => input + 1,
                _ => 0,
            };
            let pin = ui.interact(rect, self.id.with((tag.0, salt)), Sense::click_and_drag());
            self.name(&pin, rect, &said, None);
            let is_near = pin.hovered() || pin.dragged();
            let color = if is_near { style::accent(ui.visuals()) } else { ui.visuals().text_color() };
            ui.painter().circle(at, if is_near { 5.5 } else { 4.0 }, color, Stroke::new(1.0, Color32::from_gray(60)));
            self.touched.push((part, pin.on_hover_text(said)));
        }
    }

    fn has_on_hover_popup(&mut self, _: &Uid) -> bool {
        true
    }

    fn show_on_hover_popup(&mut self, id: NodeId, _: &[InPin], _: &[OutPin], ui: &mut Ui, snarl: &mut Snarl<Uid>) {
        if let Some(number) = snarl.get_node(id).and_then(|tag| self.scene.graph.at.get(tag)) {
            node::about(ui, &self.scene, *number);
        }
    }
}

impl Canvas<'_> {
    /// Tells screen readers what a part of the graph is, and where it is on the screen.
    fn name(&self, response: &Response, rect: Rect, said: &str, selected: Option<bool>) {
        use egui::{WidgetInfo, WidgetType};
        response.widget_info(|| match selected {
            Some(selected) => WidgetInfo::selected(WidgetType::SelectableLabel, true, selected, said),
            None => WidgetInfo::labeled(WidgetType::Button, true, said),
        });
        let rect = (self.transform * rect).intersect(self.area);
        let bounds = egui::accesskit::Rect {
            x0: rect.min.x.into(),
            y0: rect.min.y.into(),
            x1: rect.max.x.into(),
            y1: rect.max.y.into(),
        };
        response.ctx.accesskit_node_builder(response.id, |node| node.set_bounds(bounds));
    }
}
