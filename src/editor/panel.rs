//! Panels: one file each. They read the world and return requests; they never change it.

use bevy::prelude::*;
use bevy_egui::egui;

/// Requests of panels, carried out after all panels have been drawn.
#[derive(Default)]
pub struct Requests {
    list: Vec<Box<dyn FnOnce(&mut World) + Send>>,
}

impl Requests {
    /// Sends a message: an edit, a pick, an action, a notice.
    pub fn send<M: Message>(&mut self, message: M) {
        self.list.push(Box::new(move |world| {
            world.write_message(message);
        }));
    }

    /// Replaces a resource of the editor itself (display settings, the mode), never a rig.
    pub fn set<R: Resource>(&mut self, resource: R) {
        self.list.push(Box::new(move |world| world.insert_resource(resource)));
    }

    /// Returns `true` without requests.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Carries the requests out, in order.
    pub fn carry_out(self, world: &mut World) {
        for request in self.list {
            request(world);
        }
    }
}

/// A panel in the dock.
pub trait EditorPanel: Send + Sync + 'static {
    /// Name on the tab and in saved layouts.
    fn title(&self) -> &'static str;

    /// Draws the panel. Called once or more a frame, so it must not rely on a single call.
    fn show(&mut self, ui: &mut egui::Ui, world: &World, requests: &mut Requests);
}

/// An overlay above the whole window: dialogs, prompts, toasts.
pub trait EditorOverlay: Send + Sync + 'static {
    /// Draws the overlay.
    fn show(&mut self, ctx: &egui::Context, world: &World, requests: &mut Requests);
}

/// A painter above the viewport: labels, rubber bands, numbers beside the pointer.
pub trait ViewportPainter: Send + Sync + 'static {
    /// Paints into `painter`, whose clip rectangle is the viewport; `area` is the viewport in window coordinates.
    fn paint(&mut self, painter: &egui::Painter, area: egui::Rect, world: &World);

    /// Draws widgets above the viewport (a small bar for the threshold of a stroke, for example).
    fn widgets(&mut self, _ui: &mut egui::Ui, _area: egui::Rect, _world: &World, _requests: &mut Requests) {}
}

/// Panels, overlays and painters, in the order in which they were added.
#[derive(Resource, Default)]
pub struct Panels {
    /// Panels in the dock.
    pub panels: Vec<Box<dyn EditorPanel>>,
    /// Overlays above the window.
    pub overlays: Vec<Box<dyn EditorOverlay>>,
    /// Painters above the viewport.
    pub painters: Vec<Box<dyn ViewportPainter>>,
}

/// Titles of the panels in the dock, in the order in which they were added.
#[derive(Resource, Debug, Clone, Default)]
pub struct PanelTitles(pub Vec<&'static str>);

/// Extension of [`App`] that adds to [`Panels`].
pub trait PanelApp {
    /// Adds a panel to the dock.
    fn add_panel(&mut self, panel: impl EditorPanel) -> &mut Self;
    /// Adds an overlay.
    fn add_overlay(&mut self, overlay: impl EditorOverlay) -> &mut Self;
    /// Adds a painter over the viewport.
    fn add_painter(&mut self, painter: impl ViewportPainter) -> &mut Self;
}

impl PanelApp for App {
    fn add_panel(&mut self, panel: impl EditorPanel) -> &mut Self {
        self.init_resource::<Panels>().init_resource::<PanelTitles>();
        self.world_mut().resource_mut::<PanelTitles>().0.push(panel.title());
        self.world_mut().resource_mut::<Panels>().panels.push(Box::new(panel));
        self
    }

    fn add_overlay(&mut self, overlay: impl EditorOverlay) -> &mut Self {
        self.init_resource::<Panels>();
        self.world_mut().resource_mut::<Panels>().overlays.push(Box::new(overlay));
        self
    }

    fn add_painter(&mut self, painter: impl ViewportPainter) -> &mut Self {
        self.init_resource::<Panels>();
        self.world_mut().resource_mut::<Panels>().painters.push(Box::new(painter));
        self
    }
}
