//! Colours of keys, curves and the playhead, from those of the window.

use bevy_egui::egui::{Color32, Visuals};

use crate::editor::style;

/// Colours in which keys are painted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::editor::panels) struct KeyColors {
    /// Selected keys and the playhead.
    pub accent: Color32,
    /// Text on the accent.
    pub on_accent: Color32,
    /// Quiet text and tangents.
    pub quiet: Color32,
    /// Keys of a track.
    pub key: Color32,
    /// Keys of several tracks together.
    pub sum: Color32,
    /// Outlines of keys.
    pub outline: Color32,
    /// Markers.
    pub marker: Color32,
}

impl KeyColors {
    pub fn of(visuals: &Visuals) -> Self {
        let accent = style::accent(visuals);
        let is_light = accent.intensity() > 0.45;
        Self {
            accent,
            on_accent: if is_light { Color32::BLACK } else { Color32::WHITE },
            quiet: style::quiet(visuals),
            key: visuals.text_color(),
            sum: visuals.text_color().lerp_to_gamma(visuals.panel_fill, 0.25),
            outline: visuals.extreme_bg_color,
            marker: visuals.text_color().lerp_to_gamma(Color32::from_rgb(64, 150, 220), 0.7),
        }
    }
}
