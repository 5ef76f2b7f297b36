//! Style of the window: dark, quiet, one accent colour.

use bevy_egui::egui::{self, Color32, CornerRadius, FontId, Margin, Stroke, TextStyle};

/// Colour of chosen, active or imminent items.
pub const ACCENT: Color32 = Color32::from_rgb(255, 158, 44);
/// Colour of obstacles.
pub const OBSTACLE: Color32 = Color32::from_rgb(255, 190, 90);
/// Colour of quiet text.
pub const QUIET: Color32 = Color32::from_rgb(150, 154, 162);

const BACKGROUND: Color32 = Color32::from_rgb(36, 38, 43);
const RAISED: Color32 = Color32::from_rgb(52, 55, 62);
const LINE: Color32 = Color32::from_rgb(24, 25, 29);

/// Sets the style once.
pub fn apply(ctx: &egui::Context) {
    let done = egui::Id::new("rigsmith style");
    if ctx.data(|data| data.get_temp::<bool>(done)).is_some() {
        return;
    }
    ctx.data_mut(|data| data.insert_temp(done, true));
    ctx.set_theme(egui::Theme::Dark);
    ctx.all_styles_mut(|style| {
        style.text_styles = [
            (TextStyle::Heading, FontId::proportional(15.0)),
            (TextStyle::Body, FontId::proportional(13.0)),
            (TextStyle::Button, FontId::proportional(13.0)),
            (TextStyle::Small, FontId::proportional(11.0)),
            (TextStyle::Monospace, FontId::monospace(12.0)),
        ]
        .into();
        style.spacing.item_spacing = egui::vec2(6.0, 4.0);
        style.spacing.button_padding = egui::vec2(7.0, 3.0);
        style.spacing.interact_size.y = 20.0;
        let visuals = &mut style.visuals;
        visuals.panel_fill = BACKGROUND;
        visuals.window_fill = BACKGROUND;
        visuals.extreme_bg_color = Color32::from_rgb(26, 27, 31);
        visuals.faint_bg_color = Color32::from_rgb(42, 44, 50);
        visuals.selection.bg_fill = Color32::from_rgb(120, 72, 16);
        visuals.selection.stroke = Stroke::new(1.0, Color32::from_rgb(255, 224, 184));
        visuals.hyperlink_color = ACCENT;
        visuals.widgets.inactive.weak_bg_fill = RAISED;
        visuals.widgets.inactive.bg_fill = RAISED;
        for widget in [
            &mut visuals.widgets.noninteractive,
            &mut visuals.widgets.inactive,
            &mut visuals.widgets.hovered,
            &mut visuals.widgets.active,
            &mut visuals.widgets.open,
        ] {
            widget.corner_radius = CornerRadius::same(3);
        }
        visuals.widgets.noninteractive.fg_stroke.color = Color32::from_rgb(206, 209, 214);
        visuals.widgets.noninteractive.bg_stroke.color = LINE;
    });
}

/// The frame of bars across the window.
pub fn bar(_ctx: &egui::Context) -> egui::Frame {
    egui::Frame::new().fill(BACKGROUND).inner_margin(Margin::symmetric(8, 3))
}

/// The style of the dock.
pub fn dock(ctx: &egui::Context) -> egui_dock::Style {
    let mut style = egui_dock::Style::from_egui(&ctx.global_style());
    style.separator.width = 3.0;
    style.separator.color_idle = LINE;
    style.separator.color_hovered = ACCENT;
    style.tab_bar.height = 24.0;
    style.tab_bar.bg_fill = Color32::from_rgb(30, 31, 35);
    style.tab.tab_body.inner_margin = Margin::same(6);
    style.tab.tab_body.stroke = Stroke::NONE;
    style
}
