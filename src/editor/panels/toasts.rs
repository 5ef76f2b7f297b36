//! Toasts: recent notices, in the viewport's lower right corner, or the lower left one where a window is in the way.
//!
//! Toasts are areas of their own, so a click on one never reaches the viewport below, and they cost a frame only when
//! one of them expires: the window sleeps until then. They keep clear of windows, bars and the start page, beside which they are
//! flat and wide, and are below dialogs.

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
    dock::ShowPanel,
    notice::{Notice, Severity},
    panel::{EditorOverlay, Requests},
    pointer::ViewportArea,
    start::{self, StartPage},
};

/// Plugin that wakes the window when a toast expires.
pub struct ToastsPlugin;

impl Plugin for ToastsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<NextToast>().add_message::<ShowPanel>().add_systems(Last, wake_for_toasts);
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
    /// Number of the first notice, which identifies the toast.
    id: u64,
    notice: Notice,
    times: u32,
    /// Expiry in egui's time.
    until: f64,
    /// True while the pointer rests on it: it stays then, though the window may sleep for longer than its time.
    is_read: bool,
}

impl Toasts {
    /// The largest number of toasts at a time.
    pub const MOST: usize = 4;

    /// Takes over the entries that were added since the last call.
    fn follow(&mut self, book: &LogBook, now: f64) {
        let unseen: Vec<_> = book.entries().rev().take_while(|entry| entry.number >= self.next).collect();
        for entry in unseen.into_iter().rev().filter(|entry| !entry.notice.quiet) {
            let until = now + lifetime(&entry.notice).as_secs_f64();
            let known = self.shown.iter().position(|toast| toast.notice == entry.notice);
            let times = known.map_or(0, |place| self.shown[place].times);
            let id = known.map_or(entry.number, |place| self.shown.remove(place).id);
            // An entry stands for several notices in a row, some of which may have been counted.
            let fresh = u32::try_from(entry.number + 1 - self.next).unwrap_or(u32::MAX).min(entry.times);
            let times = times.saturating_add(fresh);
            self.shown.push(Toast { id, notice: entry.notice.clone(), times, until, is_read: false });
        }
        self.next = book.next_number();
        while self.shown.len() > Self::MOST {
            // Errors are kept longest.
            let first = self.shown.iter().position(|toast| toast.notice.severity != Severity::Error).unwrap_or(0);
            self.shown.remove(first);
        }
    }
}

/// Lifetime of a toast, long enough to read it; errors stay longest, and all stay in the log.
fn lifetime(notice: &Notice) -> Duration {
    let reading = Duration::from_millis(45) * notice.text.chars().count().min(200) as u32;
    let more = match notice.severity {
        Severity::Error => 12,
        Severity::Warning => 4,
        Severity::Info | Severity::Done => 2,
    };
    Duration::from_secs(more) + reading
}

/// Height of a toast that has not been drawn yet.
const HEIGHT: f32 = 36.0;
/// Distance between toasts, and from windows.
const GAP: f32 = 6.0;

impl EditorOverlay for Toasts {
    fn show(&mut self, ctx: &egui::Context, world: &World, requests: &mut Requests) {
        let Some(book) = world.get_resource::<LogBook>() else { return };
        let now = ctx.input(|input| input.time);
        self.follow(book, now);
        self.shown.retain(|toast| toast.is_read || toast.until > now);
        let window = ctx.content_rect();
        let (areas, width) = room(ctx, world, window);
        let mut taken = self.windows(ctx);
        let mut closed = None;
        for toast in self.shown.iter_mut().rev() {
            let id = area_id(toast.id);
            let height = ctx.memory(|memory| memory.area_rect(id)).map_or(HEIGHT, |rect| rect.height());
            let size = egui::vec2(width, height);
            // Without room the notice is in the log alone.
            let Some(place) = areas.iter().find_map(|area| free_place(*area, size, &taken)) else { continue };
            let shown = Area::new(id)
                .order(Order::Middle)
                .pivot(Align2::RIGHT_BOTTOM)
                .fixed_pos(place.right_bottom())
                .constrain_to(window)
                .sense(Sense::click())
                .fade_in(false)
                .show(ctx, |ui| draw(ui, toast, width));
            ctx.move_to_top(shown.response.layer_id);
            let panel = toast.notice.panel;
            let said = panel.map_or_else(|| "Show in the log".to_owned(), |panel| format!("Show in {panel}"));
            shown.response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, &said));
            if shown.inner {
                closed = Some(toast.id);
            } else if shown.response.clicked() {
                requests.send(ShowPanel(panel.unwrap_or("Log")));
            }
            let rect: Rect = shown.response.rect;
            // A toast under the pointer stays, and a little longer.
            let is_over = ctx.input(|input| input.pointer.hover_pos()).is_some_and(|pointer| rect.contains(pointer));
            // One that comes where the pointer rests is read only once the pointer moves.
            let is_move = |event: &egui::Event| matches!(event, egui::Event::PointerMoved(_));
            let is_moved = ctx.input(|input| input.events.iter().any(is_move));
            let is_read = is_over && (toast.is_read || is_moved);
            if is_read || toast.is_read {
                toast.until = toast.until.max(now + 2.0);
            }
            toast.is_read = is_read;
            taken.push(rect);
        }
        let expiring = self.shown.iter().filter(|toast| !toast.is_read);
        let next = expiring.map(|toast| toast.until).min_by(f64::total_cmp);
        if world.get_resource::<NextToast>().is_some_and(|known| known.0 != next) {
            requests.set(NextToast(next));
        }
        if let Some(closed) = closed {
            self.shown.retain(|toast| toast.id != closed);
            ctx.request_repaint();
        }
    }
}

impl Toasts {
    /// Rectangles of the windows and bars on the screen.
    fn windows(&self, ctx: &egui::Context) -> Vec<Rect> {
        let own: Vec<Id> = self.shown.iter().map(|toast| area_id(toast.id)).collect();
        ctx.memory(|memory| {
            let layers = memory.areas().visible_layer_ids().into_iter();
            let layers = layers.filter(|layer| layer.order == Order::Middle && !own.contains(&layer.id));
            layers.filter_map(|layer| memory.area_rect(layer.id)).collect()
        })
    }
}

fn area_id(toast: u64) -> Id {
    Id::new(("toast", toast))
}

/// Areas for toasts, the best first, and the width of a toast: the viewport, or the strips below and above the start page, which
/// leaves the viewport no room.
fn room(ctx: &egui::Context, world: &World, window: Rect) -> ([Rect; 2], f32) {
    if world.get_resource::<StartPage>().is_some_and(StartPage::is_shown) {
        let page = ctx.memory(|memory| memory.area_rect(start::page_id()));
        let below = page.map_or(window, |page| window.with_min_y(page.bottom()));
        // Two stand side by side where both have room for a sentence in a line.
        let width = ((window.width() - 24.0) / 2.0).clamp(480.0, 620.0);
        return ([below, window], width.min((window.width() - 16.0).max(140.0)));
    }
    let area = viewport(world).map_or(window, |area| area.intersect(window));
    ([area; 2], (area.width() - 16.0).clamp(140.0, 340.0))
}

/// The lowest free place on the right of an area, or on its left.
fn free_place(area: Rect, size: egui::Vec2, taken: &[Rect]) -> Option<Rect> {
    let column = |left: f32| {
        let mut bottom = area.bottom() - 8.0;
        loop {
            let place = Rect::from_min_size(egui::pos2(left, bottom - size.y), size);
            if place.top() < area.top() {
                return None;
            }
            let above =
                taken.iter().filter(|rect| rect.expand(GAP - 1.0).intersects(place)).map(|rect| rect.top() - GAP);
            match above.min_by(f32::total_cmp) {
                // Each round goes up.
                Some(next) if next < bottom => bottom = next,
                Some(_) => return None,
                None => return Some(place),
            }
        }
    };
    column(area.right() - 8.0 - size.x).or_else(|| column(area.left() + 8.0))
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
            let times = if toast.times > 1 { format!(" ×{}", toast.times) } else { String::new() };
            let room = ui.available_width() - 24.0;
            ui.allocate_ui(egui::vec2(room, 0.0), |ui| {
                ui.set_width(room);
                let text =
                    RichText::new(format!("{}{times}", toast.notice.text)).color(ui.visuals().strong_text_color());
                ui.add(Label::new(text).wrap().selectable(false));
            });
            let cross = ui.add(egui::Button::new(RichText::new("✖").small()).frame(false));
            cross.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, "Close"));
            closed = cross.on_hover_text("Close").clicked();
        });
    });
    closed
}
