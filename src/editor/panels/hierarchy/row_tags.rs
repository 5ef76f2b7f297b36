//! Tags of a joint in its row: the first one by its name and the number of the others, or the number alone where there is
//! no room beside the name of the joint.

use bevy_egui::egui::{Align2, FontId, Rect, Sense, TextStyle, Ui, WidgetInfo, WidgetType, vec2};

use crate::{
    editor::panels::properties::tags::name as tag_name,
    rig::{TagData, Uid},
};

/// Least width of a row's text in which the number of tags is told.
const LEAST_ROOM: f32 = 60.0;
/// Room between the name of the joint and its tags.
const GAP: f32 = 6.0;
/// Size of the letters.
const LETTERS: f32 = 10.0;

/// Draws the tags at the right of the text of a joint's row, and returns the room that is left for the name.
pub(super) fn show(ui: &Ui, text: Rect, (joint, name): (Uid, &str), tags: &[TagData]) -> Rect {
    let Some(first) = tags.first().filter(|_| text.width() >= LEAST_ROOM) else { return text };
    let color = ui.visuals().weak_text_color();
    let measured = |text: String, font: FontId| ui.painter().layout_no_wrap(text, font, color);
    let font = FontId::proportional(LETTERS);
    let of_first = tag_name(first);
    let words = if tags.len() > 1 { format!("{of_first} +{}", tags.len() - 1) } else { of_first };
    let room = text.width() - measured(name.to_owned(), TextStyle::Body.resolve(ui.style())).size().x - GAP;
    let words = measured(words, font.clone());
    let said = if words.size().x <= room { words } else { measured(tags.len().to_string(), font) };
    let size = said.size();
    let place = Align2::RIGHT_CENTER.align_size_within_rect(size, text.shrink2(vec2(2.0, 0.0)));
    ui.painter().galley(place.min, said, color);
    let whole = text.with_min_x(place.left() - GAP);
    let tip = ui.interact(whole, ui.id().with((joint, "tags")), Sense::hover());
    let listed = listed(tags);
    tip.widget_info(|| WidgetInfo::labeled(WidgetType::Other, true, format!("Tags of {name}: {listed}")));
    tip.on_hover_text(listed.as_str());
    text.with_max_x(whole.left())
}

/// Names of tags, in their order.
fn listed(tags: &[TagData]) -> String {
    let name = |tag: &TagData| if tag.enabled { tag_name(tag) } else { format!("{} (off)", tag_name(tag)) };
    tags.iter().map(name).collect::<Vec<_>>().join(", ")
}
