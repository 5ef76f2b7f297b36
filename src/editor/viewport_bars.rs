//! Bars over the lower edge of the viewport, which views of the model leave room for.

use bevy::prelude::*;
use bevy_egui::egui;

/// Name of the bar of fits.
pub const FIT_BAR: &str = "fit bar";
/// Name of the bar under a previewed stroke.
pub const STROKE_BAR: &str = "stroke bar";

/// Bars of the last frame, in pixels from the viewport's top left corner.
#[derive(Resource, Debug, Clone, PartialEq, Default)]
pub struct ViewportBars {
    /// Bars that stay while people work with the whole figure; the view makes room for them when they come.
    pub lasting: Vec<Rect>,
    /// Bars of a single gesture; only views that are asked for leave room for them.
    pub brief: Vec<Rect>,
}

impl ViewportBars {
    /// Bars that are drawn at present over a viewport.
    pub(super) fn drawn(ctx: &egui::Context, viewport: egui::Rect) -> Self {
        let bar = |name: &str| {
            let id = egui::Id::new(name);
            let layer = egui::LayerId::new(egui::Order::Middle, id);
            let rect = ctx.memory(|memory| memory.area_rect(id).filter(|_| memory.areas().is_visible(&layer)))?;
            let rect = rect.intersect(viewport).translate(-viewport.min.to_vec2());
            rect.is_positive().then(|| Rect::new(rect.min.x, rect.min.y, rect.max.x, rect.max.y))
        };
        Self { lasting: bar(FIT_BAR).into_iter().collect(), brief: bar(STROKE_BAR).into_iter().collect() }
    }

    /// All bars.
    pub fn all(&self) -> Vec<Rect> {
        self.lasting.iter().chain(&self.brief).copied().collect()
    }
}
