//! The window's frame: menu and toolbar above, status line below, panels docked around the viewport.
//!
//! A single system draws the whole window with read access to the world; the requests of panels are carried out after
//! the last panel.

mod borders;

use bevy::{ecs::system::SystemState, prelude::*, window::PrimaryWindow};
use bevy_egui::{EguiContext, EguiPrimaryContextPass, PrimaryEguiContext, egui};
use egui_dock::{DockArea, DockState, NodeIndex, TabViewer, tab_viewer::OnCloseResponse};
use serde::{Deserialize, Serialize};

use self::borders::Borders;
use super::{
    files::attend,
    follow, menu,
    panel::{Panels, Requests},
    pointer::ViewportArea,
    result_queue::HeldPlugin,
    running_work::RunningWorkPlugin,
    settings::EditorSettings,
    status, style, toolbar,
    viewport_bars::ViewportBars,
};

/// Plugin that draws the window.
pub struct DockPlugin;

impl Plugin for DockPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins((HeldPlugin, RunningWorkPlugin))
            .init_resource::<Panels>()
            .init_resource::<Layout>()
            .add_message::<ShowPanel>()
            .add_systems(Update, show_panels.after(attend))
            .add_systems(EguiPrimaryContextPass, draw);
    }
}

/// Name of the viewport's tab.
pub const VIEWPORT: &str = "Viewport";

/// Name of the panel whose tab has a mark while there is an update.
const UPDATER: &str = "Updater";

/// Panels at the left of the viewport.
const LEFT: &[&str] = &["Hierarchy", "Loader", "Groups", "Sets"];

/// Panels at the right of the viewport, above [`LOWER_RIGHT`].
const RIGHT: &[&str] = &["Properties", "Tags", "Controls", "Skinning"];

/// Panels at the right of the viewport, in the lower half.
const LOWER_RIGHT: &[&str] = &["History", "Poses", "Weights", "Face"];

/// Panels below the viewport, which are wide and low.
const BELOW: &[&str] = &["Timeline", "Curves", "Graph", "Process", "Updater", "Display", "Log"];

/// Size of the letters of tabs. All tabs of a place have to fit into its bar in a window of [`FULL_WIDTH`] pixels.
const TAB_TEXT: f32 = 12.0;

/// Width of a window whose tabs have letters of the full size.
const FULL_WIDTH: f32 = 1280.0;

/// Least part of the full size, that of a window of 1024 pixels: smaller letters cannot be read.
const LEAST_TEXT: f32 = 0.8;

/// Size of the letters of tabs in a window of a width, so that none is cut.
fn tab_text(width: f32) -> f32 {
    TAB_TEXT * (width / FULL_WIDTH).clamp(LEAST_TEXT, 1.0)
}

/// Largest distance of a place from a border that it touches.
const NEAR: f32 = 4.0;

/// Largest thickness of borders and of scroll bars of tabs.
const THIN: f32 = 8.5;

/// Height of a bar of tabs with its scroll bar.
const TAB_BAR: f32 = 36.0;

/// Arrangement of the panels; stored between runs.
#[derive(Resource, Clone, Serialize, Deserialize)]
#[serde(from = "DockState<String>", into = "DockState<String>")]
pub struct Layout {
    dock: DockState<String>,
    borders: Borders,
}

impl From<DockState<String>> for Layout {
    fn from(dock: DockState<String>) -> Self {
        Self { dock, borders: Borders::default() }
    }
}

impl From<Layout> for DockState<String> {
    /// The arrangement for a window of any size.
    fn from(Layout { mut dock, borders }: Layout) -> Self {
        borders.restore(&mut dock);
        dock
    }
}

impl Default for Layout {
    fn default() -> Self {
        let mut dock = DockState::new(vec![VIEWPORT.to_owned()]);
        let tabs = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        let tree = dock.main_surface_mut();
        let [centre, _] = tree.split_left(NodeIndex::root(), 0.19, tabs(LEFT));
        let [centre, right] = tree.split_right(centre, 0.75, tabs(RIGHT));
        let [_, _] = tree.split_below(right, 0.5, tabs(LOWER_RIGHT));
        let [_, _] = tree.split_below(centre, 0.78, tabs(BELOW));
        dock.into()
    }
}

impl Layout {
    /// Returns `true` if a panel is shown.
    pub fn shows(&self, title: &str) -> bool {
        self.dock.iter_all_tabs().any(|(_, tab)| tab == title)
    }

    /// Shows or hides a panel. The viewport always stays.
    pub fn toggle(&mut self, title: &str) {
        if title == VIEWPORT {
            return;
        }
        match self.dock.find_tab_from(|tab| tab == title) {
            Some(path) => {
                self.dock.remove_tab(path);
            }
            None => self.put_back(title),
        }
    }

    /// Shows a panel beside the others of its place in the usual layout. Where none of them is shown, a panel of the place
    /// below the viewport gets it anew, and any other goes to the first place.
    fn put_back(&mut self, title: &str) {
        let places = [LEFT, RIGHT, LOWER_RIGHT, BELOW];
        let neighbours = places.into_iter().find(|place| place.contains(&title)).unwrap_or_default();
        let beside = self.dock.find_tab_from(|tab| neighbours.contains(&tab.as_str()));
        if let Some(leaf) = beside.and_then(|path| self.dock.leaf_mut(path.node_path()).ok()) {
            leaf.append_tab(title.to_owned());
            return;
        }
        let viewport = self.dock.find_main_surface_tab(&VIEWPORT.to_owned()).filter(|_| BELOW.contains(&title));
        match viewport {
            Some((viewport, _)) => {
                self.dock.main_surface_mut().split_below(viewport, 0.78, vec![title.to_owned()]);
            }
            None => self.dock.push_to_first_leaf(title.to_owned()),
        }
    }

    /// Panels of each place, in the order of their tabs.
    pub fn places(&self) -> Vec<Vec<&str>> {
        let leaves = self.dock.iter_leaves();
        leaves.map(|(_, leaf)| leaf.tabs.iter().map(String::as_str).collect()).collect()
    }

    /// Area of the place that a panel is in, with its bar of tabs, as it was drawn last.
    pub fn area(&self, title: &str) -> Option<egui::Rect> {
        let path = self.dock.find_tab_from(|tab| tab == title)?;
        self.dock.leaf(path.node_path()).ok().map(|leaf| leaf.rect)
    }

    /// Returns `true` if a panel is in front of the others in its place.
    pub fn is_forward(&self, title: &str) -> bool {
        let path = self.dock.find_tab_from(|tab| tab == title);
        path.is_some_and(|path| self.dock.leaf(path.node_path()).is_ok_and(|leaf| leaf.active == path.tab))
    }

    /// Panels in front at the two sides of a border between places: left and right, or above and below.
    fn beside(&self, border: egui::Rect) -> Option<[&str; 2]> {
        let centre = border.center();
        let front = |distance: &dyn Fn(egui::Rect) -> f32| {
            let touches = |rect: egui::Rect| distance(rect).abs() <= NEAR && rect.expand(NEAR).intersects(border);
            let mut leaves = self.dock.iter_leaves().map(|(_, leaf)| leaf);
            let leaf = leaves.find(|leaf| touches(leaf.rect))?;
            leaf.tabs.get(leaf.active.0).map(String::as_str)
        };
        if border.height() > border.width() {
            Some([front(&|rect| rect.right() - centre.x)?, front(&|rect| rect.left() - centre.x)?])
        } else {
            Some([front(&|rect| rect.bottom() - centre.y)?, front(&|rect| rect.top() - centre.y)?])
        }
    }

    /// True for what lies in a bar of tabs, or just below it.
    fn is_in_tabs(&self, rect: egui::Rect) -> bool {
        let bar = |area: egui::Rect| area.with_max_y(area.top() + TAB_BAR);
        self.dock.iter_leaves().any(|(_, leaf)| bar(leaf.rect).contains(rect.center()))
    }

    /// Shows a panel in front of the others in its place.
    pub fn bring_forward(&mut self, title: &str) {
        if !self.shows(title) {
            self.toggle(title);
        }
        if let Some(path) = self.dock.find_tab_from(|tab| tab == title) {
            // The path has just been found.
            let _ = self.dock.set_active_tab(path);
        }
    }

    /// Drops panels that do not exist (of another version), and restores a missing viewport.
    pub fn repair(&mut self, known: &[&str]) {
        self.dock.retain_tabs(|tab| tab == VIEWPORT || known.contains(&tab.as_str()));
        if !self.shows(VIEWPORT) {
            *self = Self::default();
        }
    }
}

/// Request to show a panel in front of the others in its place.
#[derive(Message, Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShowPanel(pub &'static str);

fn show_panels(mut requests: MessageReader<ShowPanel>, mut layout: ResMut<Layout>) {
    for ShowPanel(title) in requests.read() {
        layout.bring_forward(title);
    }
}

/// Draws the window, then carries out the requests of its panels.
fn draw(world: &mut World, state: &mut SystemState<Query<&mut EguiContext, With<PrimaryEguiContext>>>) {
    let context = match state.get_mut(world) {
        Ok(mut contexts) => contexts.single_mut().ok().map(|mut context| context.get_mut().clone()),
        Err(_) => None,
    };
    let Some(ctx) = context else { return };
    style::apply(&ctx, world.get_resource::<EditorSettings>().map(EditorSettings::look).unwrap_or_default());
    if ctx.has_requested_repaint() {
        trace!("drawing on: {:?}", ctx.repaint_causes());
    }
    let (Some(mut panels), Some(mut layout)) = (world.remove_resource::<Panels>(), world.remove_resource::<Layout>())
    else {
        return;
    };
    let mut requests = Requests::default();
    let mut viewport = None;
    let mut ui = egui::Ui::new(
        ctx.clone(),
        "window".into(),
        egui::UiBuilder::new().layer_id(egui::LayerId::background()).max_rect(ctx.viewport_rect()),
    );
    let titles: Vec<&'static str> = panels.panels.iter().map(|panel| panel.title()).collect();
    egui::Panel::top("menu")
        .frame(style::bar(&ctx))
        .show(&mut ui, |ui| menu::show(ui, world, &layout, &titles, &mut requests));
    egui::Panel::top("toolbar").frame(style::bar(&ctx)).show(&mut ui, |ui| toolbar::show(ui, world, &mut requests));
    egui::Panel::bottom("status").frame(style::bar(&ctx)).show(&mut ui, |ui| status::show(ui, world, &mut requests));
    egui::CentralPanel::no_frame().show(&mut ui, |ui| {
        let mut tabs = Tabs {
            panels: &mut panels,
            world,
            requests: &mut requests,
            viewport: &mut viewport,
            closed: None,
            text: tab_text(ctx.viewport_rect().width()),
        };
        layout.borders.note(&layout.dock);
        let style = style::dock(&ctx);
        let least = style.separator.extra;
        // A button on each tab would take as much room as a word.
        DockArea::new(&mut layout.dock)
            .style(style)
            .show_close_buttons(false)
            .show_leaf_close_all_buttons(false)
            .show_leaf_collapse_buttons(false)
            .show_inside(ui, &mut tabs);
        let closed = tabs.closed;
        if layout.borders.follow(&mut layout.dock, least) {
            ctx.request_repaint();
        }
        name_borders(ui, &layout);
        if let Some(closed) = closed.filter(|closed| layout.shows(closed)) {
            layout.toggle(&closed);
        }
    });
    for overlay in &mut panels.overlays {
        overlay.show(&ctx, world, &mut requests);
    }
    name_menus(&ctx);
    world.insert_resource(panels);
    world.insert_resource(layout);
    remember_area(world, viewport);
    let bars = viewport.map(|viewport| ViewportBars::drawn(&ctx, viewport)).unwrap_or_default();
    if world.get_resource_or_init::<ViewportBars>().set_if_neq(bars) {
        trace!("drawing on: a bar came or went");
        world.write_message(bevy::window::RequestRedraw);
    }
    if !requests.is_empty() {
        trace!("drawing on: panels asked for something");
        // Requests take effect in the next frame, which has to be requested, too.
        world.write_message(bevy::window::RequestRedraw);
    }
    requests.carry_out(world);
}

/// Tells screen readers what the borders between places and the scroll bars of tabs are, which the dock draws without names.
fn name_borders(ui: &egui::Ui, layout: &Layout) {
    let is_thin = |widget: &&egui::WidgetRect| {
        widget.sense.senses_drag() && widget.sense.is_focusable() && widget.rect.size().min_elem() <= THIN
    };
    let thin: Vec<(egui::Id, egui::Rect)> = ui.ctx().viewport(|viewport| {
        let widgets = viewport.this_pass.widgets.get_layer(ui.layer_id());
        widgets.filter(is_thin).map(|widget| (widget.id, widget.rect)).collect()
    });
    for (id, rect) in thin {
        let (name, role) = match layout.beside(rect) {
            Some([one, other]) => (format!("Border between {one} and {other}"), egui::accesskit::Role::Splitter),
            None if layout.is_in_tabs(rect) => ("Scroll bar of tabs".to_owned(), egui::accesskit::Role::ScrollBar),
            None => continue,
        };
        ui.ctx().accesskit_node_builder(id, |node| {
            if node.label().is_none() {
                node.set_label(name);
                node.set_role(role);
            }
        });
    }
}

/// Tells screen readers what the grounds of open menus and lists are: they take clicks and have no names of their own.
fn name_menus(ctx: &egui::Context) {
    let grounds: Vec<egui::Id> = ctx.viewport(|viewport| {
        let widgets = &viewport.this_pass.widgets;
        // An area has its ground under this name.
        let grounds = widgets.layer_ids().map(|layer| layer.id.with("move"));
        grounds.filter(|ground| widgets.get(*ground).is_some_and(|widget| widget.sense.is_focusable())).collect()
    });
    for ground in grounds {
        ctx.accesskit_node_builder(ground, |node| {
            if node.label().is_none() {
                node.set_label("Menu");
                node.set_role(egui::accesskit::Role::Menu);
            }
        });
    }
}

/// Publishes the viewport's area for the pointer and the camera.
fn remember_area(world: &mut World, viewport: Option<egui::Rect>) {
    let scale = world.query_filtered::<&Window, With<PrimaryWindow>>().single(world).map_or(1.0, Window::scale_factor);
    let Some(mut area) = world.get_resource_mut::<ViewportArea>() else { return };
    let rect = viewport.unwrap_or(egui::Rect::NOTHING);
    let (min, size) = if rect.is_positive() {
        (Vec2::new(rect.min.x, rect.min.y), Vec2::new(rect.width(), rect.height()))
    } else {
        (Vec2::ZERO, Vec2::ZERO)
    };
    if area.min != min || area.size != size || area.scale != scale {
        area.min = min;
        area.size = size;
        area.scale = scale;
    }
}

/// The contents of tabs.
struct Tabs<'a> {
    panels: &'a mut Panels,
    world: &'a World,
    requests: &'a mut Requests,
    viewport: &'a mut Option<egui::Rect>,
    /// Panel that a person closes.
    closed: Option<String>,
    /// Size of the letters of tabs.
    text: f32,
}

impl TabViewer for Tabs<'_> {
    type Tab = String;

    fn id(&mut self, tab: &mut String) -> egui::Id {
        egui::Id::new(tab.as_str())
    }

    fn title(&mut self, tab: &mut String) -> egui::WidgetText {
        match tab.as_str() {
            UPDATER if follow::offer(self.world).is_some() => {
                egui::RichText::new(format!("{UPDATER} ⬆")).size(self.text).color(style::ACCENT).into()
            }
            name => egui::RichText::new(name).size(self.text).into(),
        }
    }

    /// A tab tells its name to screen readers; the middle button closes its panel.
    fn on_tab_button(&mut self, tab: &mut String, response: &egui::Response) {
        response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Button, true, format!("Show {tab}")));
        if tab != VIEWPORT && response.middle_clicked() {
            self.closed = Some(tab.clone());
        }
    }

    fn context_menu(&mut self, ui: &mut egui::Ui, tab: &mut String, _path: egui_dock::NodePath) {
        if tab != VIEWPORT && ui.button("Close").on_hover_text("The Window menu shows it again").clicked() {
            self.closed = Some(tab.clone());
            ui.close();
        }
    }

    fn ui(&mut self, ui: &mut egui::Ui, tab: &mut String) {
        if tab == VIEWPORT {
            let rect = ui.max_rect();
            *self.viewport = Some(rect);
            ui.allocate_rect(rect, egui::Sense::hover());
            let painter = ui.painter_at(rect);
            for painted in &mut self.panels.painters {
                painted.paint(&painter, rect, self.world);
            }
            for painted in &mut self.panels.painters {
                painted.widgets(ui, rect, self.world, self.requests);
            }
            return;
        }
        match self.panels.panels.iter_mut().find(|panel| panel.title() == tab) {
            Some(panel) => panel.show(ui, self.world, self.requests),
            None => {
                ui.weak("This panel does not exist in this version.");
            }
        }
    }

    /// The viewport has no margin.
    fn tab_style_override(&self, tab: &String, style: &egui_dock::TabStyle) -> Option<egui_dock::TabStyle> {
        (tab == VIEWPORT).then(|| {
            let mut style = style.clone();
            style.tab_body.inner_margin = egui::Margin::ZERO;
            style
        })
    }

    fn on_close(&mut self, _tab: &mut String) -> OnCloseResponse {
        OnCloseResponse::Close
    }

    fn is_closeable(&self, tab: &String) -> bool {
        tab != VIEWPORT
    }

    fn allowed_in_windows(&self, tab: &mut String) -> bool {
        tab != VIEWPORT
    }

    fn clear_background(&self, tab: &String) -> bool {
        tab != VIEWPORT
    }

    fn scroll_bars(&self, _tab: &String) -> [bool; 2] {
        [false, false]
    }
}
