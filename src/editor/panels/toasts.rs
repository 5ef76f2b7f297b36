//! Toasts: recent notices, in the viewport's lower right corner.
//!
//! Toasts are areas of their own, so a click on one never reaches the viewport below, and they cost a frame only when
//! one of them expires: the window sleeps until then.

use std::time::Duration;

use bevy::{
    prelude::*,
    winit::{UpdateMode, WinitSettings},
};
use bevy_egui::egui::{
    self, Align2, Area, Frame, Id, Label, Order, Rect, RichText, Sense, Stroke, Ui, WidgetInfo, WidgetType,
};

use super::log::{LogBook, severity_symbol};
use crate::editor::{
    notice::{Notice, Severity},
    panel::{EditorOverlay, Requests},
    pointer::ViewportArea,
};

/// Plugin that wakes the window when a toast expires.
pub struct ToastsPlugin;

impl Plugin for ToastsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<NextToast>().add_systems(Last, wake_for_toasts);
    }
}

/// Time at which the next toast expires, in seconds since the program's start; `None` while none expires.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Default)]
struct NextToast(Option<f64>);

/// Shortens the window's sleep while there are toasts, and restores it.
fn wake_for_toasts(
    next: Res<NextToast>,
    time: Res<Time<Real>>,
    settings: Option<ResMut<WinitSettings>>,
    mut usual: Local<Option<(UpdateMode, UpdateMode)>>,
) {
    // Setting a wait triggers a frame: it is set when a toast appears or expires, not in every frame.
    if !next.is_changed() {
        return;
    }
    let Some(mut settings) = settings else { return };
    let Some(until) = next.0 else {
        if let Some((focused, unfocused)) = usual.take() {
            (settings.focused_mode, settings.unfocused_mode) = (focused, unfocused);
        }
        return;
    };
    let (focused, unfocused) = *usual.get_or_insert((settings.focused_mode, settings.unfocused_mode));
    let left = Duration::from_secs_f64((until - time.elapsed_secs_f64()).clamp(0.02, 60.0));
    let shortened = |mode: UpdateMode| match mode {
        UpdateMode::Reactive { wait, react_to_device_events, react_to_user_events, react_to_window_events } => {
            UpdateMode::Reactive {
                wait: wait.min(left),
                react_to_device_events,
                react_to_user_events,
                react_to_window_events,
            }
        }
        UpdateMode::Continuous => mode,
    };
    (settings.focused_mode, settings.unfocused_mode) = (shortened(focused), shortened(unfocused));
}

/// The overlay.
#[derive(Default)]
pub struct Toasts {
    /// Number of the first unseen log entry.
    next: u64,
    shown: Vec<Toast>,
}

/// A notice on the screen.
struct Toast {
    number: u64,
    notice: Notice,
    times: u32,
    /// Expiry in egui's time; `None` if the toast stays until it is closed.
    until: Option<f64>,
}

impl Toasts {
    /// The largest number of toasts at a time.
    pub const MOST: usize = 4;

    /// Takes over the entries that were added since the last call.
    fn follow(&mut self, book: &LogBook, now: f64) {
        let unseen: Vec<_> = book.entries().rev().take_while(|entry| entry.number >= self.next).collect();
        for entry in unseen.into_iter().rev().filter(|entry| !entry.notice.quiet) {
            let until = lifetime(&entry.notice).map(|time| now + time.as_secs_f64());
            // A repeated notice renews its toast.
            self.shown.retain(|toast| toast.notice != entry.notice);
            let (number, notice, times) = (entry.number, entry.notice.clone(), entry.times);
            self.shown.push(Toast { number, notice, times, until });
        }
        self.next = book.next_number();
        while self.shown.len() > Self::MOST {
            // A toast that expires is dropped first; unclosed errors are still in the log.
            let first = self.shown.iter().position(|toast| toast.until.is_some()).unwrap_or(0);
            self.shown.remove(first);
        }
    }
}

/// Lifetime of a toast, long enough to read it; `None` for errors.
fn lifetime(notice: &Notice) -> Option<Duration> {
    let reading = Duration::from_millis(45) * notice.text.chars().count().min(200) as u32;
    match notice.severity {
        Severity::Error => None,
        Severity::Warning => Some(Duration::from_secs(4) + reading),
        Severity::Info | Severity::Done => Some(Duration::from_secs(2) + reading),
    }
}

impl EditorOverlay for Toasts {
    fn show(&mut self, ctx: &egui::Context, world: &World, requests: &mut Requests) {
        let Some(book) = world.get_resource::<LogBook>() else { return };
        let now = ctx.input(|input| input.time);
        self.follow(book, now);
        self.shown.retain(|toast| toast.until.is_none_or(|until| until > now));
        let window = ctx.content_rect();
        let area = viewport(world).map_or(window, |area| area.intersect(window));
        let mut bottom = area.bottom() - 8.0;
        let mut closed = None;
        for toast in self.shown.iter_mut().rev() {
            let width = (area.width() - 16.0).clamp(140.0, 340.0);
            let corner = egui::pos2(area.right() - 8.0, bottom);
            let shown = Area::new(Id::new(("toast", toast.number)))
                .order(Order::Foreground)
                .pivot(Align2::RIGHT_BOTTOM)
                .fixed_pos(corner)
                .constrain_to(window)
                .sense(Sense::click())
                .fade_in(false)
                .show(ctx, |ui| draw(ui, toast, width));
            if shown.inner {
                closed = Some(toast.number);
            }
            let rect: Rect = shown.response.rect;
            if let Some(until) = &mut toast.until {
                // A toast under the pointer stays.
                let read = ctx.input(|input| input.pointer.hover_pos()).is_some_and(|pointer| rect.contains(pointer));
                if read && *until < now + 1.0 {
                    *until = now + 2.0;
                }
            }
            bottom = rect.top() - 6.0;
        }
        let next = self.shown.iter().filter_map(|toast| toast.until).min_by(f64::total_cmp);
        if world.get_resource::<NextToast>().is_some_and(|known| known.0 != next) {
            requests.set(NextToast(next));
        }
        if let Some(closed) = closed {
            self.shown.retain(|toast| toast.number != closed);
            ctx.request_repaint();
        }
    }
}

/// The viewport in the window.
fn viewport(world: &World) -> Option<Rect> {
    let area = world.get_resource::<ViewportArea>()?;
    let rect = Rect::from_min_size(egui::pos2(area.min.x, area.min.y), egui::vec2(area.size.x, area.size.y));
    (rect.width() > 60.0 && rect.height() > 60.0).then_some(rect)
}

/// Draws a toast; returns `true` if it was closed.
fn draw(ui: &mut Ui, toast: &Toast, width: f32) -> bool {
    let (symbol, color) = severity_symbol(ui, toast.notice.severity);
    let visuals = ui.visuals();
    let frame = Frame::new()
        .fill(visuals.window_fill)
        .stroke(Stroke::new(1.0, color.gamma_multiply(0.7)))
        .corner_radius(5.0)
        .inner_margin(egui::Margin::symmetric(8, 6));
    let mut closed = false;
    frame.show(ui, |ui| {
        ui.set_width(width - 18.0);
        ui.horizontal_top(|ui| {
            ui.label(RichText::new(symbol).color(color));
            let times = if toast.times > 1 { format!("{}× ", toast.times) } else { String::new() };
            let room = ui.available_width() - 24.0;
            ui.allocate_ui(egui::vec2(room, 0.0), |ui| {
                ui.set_width(room);
                let text =
                    RichText::new(format!("{times}{}", toast.notice.text)).color(ui.visuals().strong_text_color());
                ui.add(Label::new(text).wrap().selectable(false));
            });
            let cross = ui.add(egui::Button::new(RichText::new("✖").small()).frame(false));
            cross.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, "Close"));
            closed = cross.on_hover_text("Close").clicked();
        });
    });
    closed
}
