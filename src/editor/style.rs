//! Style of the window: quiet, one accent colour, dark or light, and with high contrast.

use bevy_egui::egui::{self, Color32, CornerRadius, FontId, Margin, Stroke, TextStyle, Theme, Visuals};
use serde::{Deserialize, Serialize};

/// Colour of chosen, active or imminent items in the dark theme; [`accent`] gives that of the theme in use.
pub const ACCENT: Color32 = Color32::from_rgb(255, 158, 44);
/// Colour of obstacles in the dark theme; [`obstacle`] gives that of the theme in use.
pub const OBSTACLE: Color32 = Color32::from_rgb(255, 190, 90);
/// Colour of quiet text in the dark theme; [`quiet`] gives that of the theme in use.
pub const QUIET: Color32 = Color32::from_rgb(150, 154, 162);

/// Brightness of the window.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum WindowTheme {
    /// Light text on a dark ground.
    #[default]
    Dark,
    /// Dark text on a light ground.
    Light,
}

impl WindowTheme {
    /// The name in the Display panel.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dark => "Dark",
            Self::Light => "Light",
        }
    }

    /// The other theme.
    pub fn other(self) -> Self {
        match self {
            Self::Dark => Self::Light,
            Self::Light => Self::Dark,
        }
    }
}

/// Look of the window.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Look {
    /// Brightness.
    pub theme: WindowTheme,
    /// Marks text and lines that differ as much as possible from their ground.
    pub high_contrast: bool,
}

/// Colours of a look.
struct Palette {
    background: Color32,
    raised: Color32,
    deep: Color32,
    faint: Color32,
    tabs: Color32,
    line: Color32,
    text: Color32,
    quiet: Color32,
    accent: Color32,
    obstacle: Color32,
    error: Color32,
    chosen: Color32,
    chosen_text: Color32,
}

const DARK: Palette = Palette {
    background: Color32::from_rgb(36, 38, 43),
    raised: Color32::from_rgb(52, 55, 62),
    deep: Color32::from_rgb(26, 27, 31),
    faint: Color32::from_rgb(42, 44, 50),
    tabs: Color32::from_rgb(30, 31, 35),
    line: Color32::from_rgb(24, 25, 29),
    text: Color32::from_rgb(206, 209, 214),
    quiet: QUIET,
    accent: ACCENT,
    obstacle: OBSTACLE,
    error: Color32::from_rgb(255, 96, 88),
    chosen: Color32::from_rgb(120, 72, 16),
    chosen_text: Color32::from_rgb(255, 224, 184),
};

const DARK_CONTRAST: Palette = Palette {
    background: Color32::from_rgb(10, 11, 13),
    raised: Color32::from_rgb(38, 40, 46),
    deep: Color32::BLACK,
    faint: Color32::from_rgb(24, 26, 30),
    tabs: Color32::BLACK,
    line: Color32::from_rgb(150, 153, 160),
    text: Color32::WHITE,
    quiet: Color32::from_rgb(210, 213, 220),
    accent: Color32::from_rgb(255, 184, 84),
    obstacle: Color32::from_rgb(255, 214, 120),
    error: Color32::from_rgb(255, 140, 130),
    chosen: Color32::from_rgb(150, 86, 0),
    chosen_text: Color32::WHITE,
};

const LIGHT: Palette = Palette {
    background: Color32::from_rgb(242, 243, 245),
    raised: Color32::from_rgb(222, 225, 230),
    deep: Color32::WHITE,
    faint: Color32::from_rgb(233, 235, 239),
    tabs: Color32::from_rgb(228, 231, 235),
    line: Color32::from_rgb(196, 200, 207),
    text: Color32::from_rgb(38, 40, 46),
    quiet: Color32::from_rgb(92, 96, 104),
    accent: Color32::from_rgb(168, 84, 0),
    obstacle: Color32::from_rgb(146, 82, 0),
    error: Color32::from_rgb(184, 28, 28),
    chosen: Color32::from_rgb(255, 214, 160),
    chosen_text: Color32::from_rgb(84, 44, 0),
};

const LIGHT_CONTRAST: Palette = Palette {
    background: Color32::WHITE,
    raised: Color32::from_rgb(226, 228, 232),
    deep: Color32::WHITE,
    faint: Color32::from_rgb(240, 241, 244),
    tabs: Color32::from_rgb(232, 234, 238),
    line: Color32::from_rgb(70, 72, 78),
    text: Color32::BLACK,
    quiet: Color32::from_rgb(56, 58, 64),
    accent: Color32::from_rgb(128, 58, 0),
    obstacle: Color32::from_rgb(112, 60, 0),
    error: Color32::from_rgb(150, 0, 0),
    chosen: Color32::from_rgb(255, 204, 132),
    chosen_text: Color32::BLACK,
};

fn palette(look: Look) -> &'static Palette {
    match (look.theme, look.high_contrast) {
        (WindowTheme::Dark, false) => &DARK,
        (WindowTheme::Dark, true) => &DARK_CONTRAST,
        (WindowTheme::Light, false) => &LIGHT,
        (WindowTheme::Light, true) => &LIGHT_CONTRAST,
    }
}

/// Place in egui's memory of the look in use.
fn look_id() -> egui::Id {
    egui::Id::new("rigsmith look")
}

fn look_of(ctx: &egui::Context) -> Look {
    ctx.data(|data| data.get_temp(look_id())).unwrap_or_default()
}

/// Sets the style if the look is another one than before.
pub fn apply(ctx: &egui::Context, look: Look) {
    if ctx.data(|data| data.get_temp::<Look>(look_id())) == Some(look) {
        return;
    }
    ctx.data_mut(|data| data.insert_temp(look_id(), look));
    // The size of the interface is that of the whole window, in which the pointer is followed, too.
    ctx.options_mut(|options| options.zoom_with_keyboard = false);
    let (theme, plain) = match look.theme {
        WindowTheme::Dark => (Theme::Dark, Visuals::dark()),
        WindowTheme::Light => (Theme::Light, Visuals::light()),
    };
    ctx.set_theme(theme);
    ctx.style_mut_of(theme, |style| {
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
        style.visuals = plain;
        color(&mut style.visuals, look);
    });
}

fn color(visuals: &mut Visuals, look: Look) {
    let palette = palette(look);
    visuals.panel_fill = palette.background;
    visuals.window_fill = palette.background;
    visuals.extreme_bg_color = palette.deep;
    visuals.faint_bg_color = palette.faint;
    visuals.selection.bg_fill = palette.chosen;
    visuals.selection.stroke = Stroke::new(1.0, palette.chosen_text);
    visuals.hyperlink_color = palette.accent;
    visuals.warn_fg_color = palette.obstacle;
    visuals.error_fg_color = palette.error;
    visuals.weak_text_color = Some(palette.quiet);
    // A caret that blinks asks for frames for as long as a text field has the focus.
    visuals.text_cursor.blink = false;
    visuals.widgets.inactive.weak_bg_fill = palette.raised;
    visuals.widgets.inactive.bg_fill = palette.raised;
    for widget in [
        &mut visuals.widgets.noninteractive,
        &mut visuals.widgets.inactive,
        &mut visuals.widgets.hovered,
        &mut visuals.widgets.active,
        &mut visuals.widgets.open,
    ] {
        widget.corner_radius = CornerRadius::same(3);
        if look.high_contrast {
            widget.bg_stroke = Stroke::new(1.0, palette.line);
            widget.fg_stroke.color = palette.text;
        }
    }
    visuals.widgets.noninteractive.fg_stroke.color = palette.text;
    visuals.widgets.noninteractive.bg_stroke.color = palette.line;
    if look.high_contrast {
        visuals.window_stroke = Stroke::new(1.0, palette.line);
        visuals.widgets.hovered.bg_stroke = Stroke::new(2.0, palette.accent);
    }
}

/// Colour of chosen, active or imminent items.
pub fn accent(visuals: &Visuals) -> Color32 {
    visuals.hyperlink_color
}

/// Least contrast of letters and symbols with their ground.
pub const LEAST_CONTRAST: f32 = 3.0;

/// A colour for letters and symbols on panels and fields: as it is where it stands out there, else nearer to white or black.
pub fn readable(visuals: &Visuals, color: Color32) -> Color32 {
    let end = if visuals.dark_mode { Color32::WHITE } else { Color32::BLACK };
    let grounds = [visuals.panel_fill, visuals.widgets.inactive.weak_bg_fill];
    let stands_out = |color: &Color32| grounds.iter().all(|ground| contrast(*color, *ground) >= LEAST_CONTRAST);
    (0..=20).map(|step| color.lerp_to_gamma(end, step as f32 * 0.05)).find(stands_out).unwrap_or(end)
}

/// Contrast of two opaque colours, from 1 of equal ones to 21 of black and white, as the Web Content Accessibility Guidelines 2
/// define it.
pub fn contrast(one: Color32, other: Color32) -> f32 {
    let luminance = |color: Color32| {
        let linear = egui::Rgba::from(color);
        0.2126 * linear.r() + 0.7152 * linear.g() + 0.0722 * linear.b()
    };
    let (one, other) = (luminance(one) + 0.05, luminance(other) + 0.05);
    one.max(other) / one.min(other)
}

/// Colour of obstacles.
pub fn obstacle(visuals: &Visuals) -> Color32 {
    visuals.warn_fg_color
}

/// Colour of quiet text.
pub fn quiet(visuals: &Visuals) -> Color32 {
    visuals.weak_text_color()
}

/// The frame of bars across the window.
pub fn bar(ctx: &egui::Context) -> egui::Frame {
    egui::Frame::new().fill(palette(look_of(ctx)).background).inner_margin(Margin::symmetric(8, 3))
}

/// The style of the dock.
pub fn dock(ctx: &egui::Context) -> egui_dock::Style {
    let palette = palette(look_of(ctx));
    let mut style = egui_dock::Style::from_egui(&ctx.global_style());
    style.separator.width = 3.0;
    style.separator.color_idle = palette.line;
    style.separator.color_hovered = palette.accent;
    style.tab_bar.height = 24.0;
    style.tab_bar.bg_fill = palette.tabs;
    style.tab.tab_body.inner_margin = Margin::same(6);
    style.tab.tab_body.stroke = Stroke::NONE;
    style
}
