//! Looks of the window: letters in colours stand out on the grounds of every theme.

use bevy_egui::egui::{self, Color32};
use rigsmith::editor::style::{self, LEAST_CONTRAST, Look, WindowTheme, contrast, readable};

#[test]
fn coloured_letters_stand_out_in_every_look() {
    let colors =
        [(230, 96, 96), (120, 190, 80), (90, 150, 240), (92, 184, 92), (214, 178, 92), (0, 0, 0), (255, 255, 255)];
    assert!((contrast(Color32::BLACK, Color32::WHITE) - 21.0).abs() < 0.01);
    for (theme, high_contrast) in
        [WindowTheme::Dark, WindowTheme::Light].into_iter().flat_map(|theme| [(theme, false), (theme, true)])
    {
        let ctx = egui::Context::default();
        style::apply(&ctx, Look { theme, high_contrast });
        let style = ctx.global_style();
        let visuals = &style.visuals;
        for (red, green, blue) in colors {
            let color = Color32::from_rgb(red, green, blue);
            let shown = readable(visuals, color);
            for ground in [visuals.panel_fill, visuals.widgets.inactive.weak_bg_fill] {
                let found = contrast(shown, ground);
                assert!(found >= LEAST_CONTRAST, "{theme:?}: {color:?} as {shown:?} on {ground:?}: {found}");
            }
            let stands_out = contrast(color, visuals.widgets.inactive.weak_bg_fill) >= LEAST_CONTRAST;
            assert!(
                !stands_out || theme == WindowTheme::Light || shown == color,
                "{color:?} is as it was on dark ground"
            );
        }
    }
}
