//! Letters of the graph: as sharp at any scale as those of other panels, and none that are too small to be read.
//!
//! egui draws letters from pictures of the size that a text asks for. In a layer that is scaled the pictures are stretched, which
//! smears them. A text of the graph is laid out in the size that it has on the screen, and made smaller by the scale by which the
//! layer makes it larger again.

use bevy_egui::egui::{
    Color32, FontId, Painter, Pos2, Rect,
    emath::TSTransform,
    epaint::TextShape,
    pos2,
    text::{LayoutJob, TextWrapping},
};

/// Smallest letters that people can read, in points of the screen.
pub(super) const LEAST: f32 = 8.0;
/// Step of the sizes of letters, in points: letters of each size are pictures of their own.
const STEP: f32 = 0.5;

/// Draws a line of text, vertically centred in a rectangle of the graph and cut with an ellipsis, unless it is too small to be
/// read. `size` is in the graph's units, `scale` the number of points of the screen in one of them.
pub(super) fn line(painter: &Painter, rect: Rect, text: &str, size: f32, color: Color32, scale: f32) {
    let points = stepped(size * scale);
    if points >= LEAST {
        write(painter, rect, text, points, color, scale);
    }
}

/// Draws a line of text as [`line`] does, with letters that can be read at any scale, as long as the rectangle is high enough.
pub(super) fn title(painter: &Painter, rect: Rect, text: &str, size: f32, color: Color32, scale: f32) {
    if rect.height() * scale >= LEAST {
        write(painter, rect, text, stepped(size * scale).max(LEAST), color, scale);
    }
}

fn stepped(points: f32) -> f32 {
    (points / STEP).round() * STEP
}

fn write(painter: &Painter, rect: Rect, text: &str, points: f32, color: Color32, scale: f32) {
    let mut job = LayoutJob::simple_singleline(text.to_owned(), FontId::proportional(points), color);
    job.wrap = TextWrapping::truncate_at_width((rect.width() * scale).max(1.0));
    let mut shape = TextShape::new(Pos2::ZERO, painter.layout_job(job), color);
    shape.transform(TSTransform::from_scaling(1.0 / scale));
    shape.pos = pos2(rect.left(), rect.center().y - 0.5 * shape.galley.size().y);
    painter.add(shape);
}
