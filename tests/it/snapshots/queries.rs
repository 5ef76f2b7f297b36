//! Questions about what a picture shows, as programs for blind people ask them: names, places, and texts that are cut off.

use bevy_egui::egui::{Rect, Shape, accesskit, epaint::ClippedShape, pos2};

use super::booth::{Nodes, Shot};

/// A widget as screen readers know it.
#[derive(Debug, Clone)]
pub struct Widget {
    pub role: accesskit::Role,
    pub label: String,
    pub value: String,
    pub rect: Rect,
    /// True if another widget gives the name.
    pub is_labelled: bool,
    /// True if it can have the keyboard and be clicked.
    pub is_clickable: bool,
}

/// A text that is painted.
#[derive(Debug, Clone)]
pub struct Text {
    pub text: String,
    /// Area of its letters.
    pub rect: Rect,
    /// Area in which it is seen.
    pub clip: Rect,
}

/// Widgets from the top to the bottom.
pub fn widgets(nodes: &Nodes) -> Vec<Widget> {
    let widget = |node: &accesskit::Node| {
        let bounds = node.bounds()?;
        let [left, top, right, bottom] = [bounds.x0, bounds.y0, bounds.x1, bounds.y1].map(|side| side as f32);
        Some(Widget {
            role: node.role(),
            label: node.label().unwrap_or_default().to_owned(),
            value: node.value().unwrap_or_default().to_owned(),
            rect: Rect::from_min_max(pos2(left, top), pos2(right, bottom)),
            is_labelled: !node.labelled_by().is_empty(),
            is_clickable: node.supports_action(accesskit::Action::Click)
                && node.supports_action(accesskit::Action::Focus),
        })
    };
    let mut widgets: Vec<Widget> = nodes.iter().filter_map(|(_, node)| widget(node)).collect();
    // The tree is a map: its order is that of the places.
    widgets.sort_by(|a, b| {
        let place = |widget: &Widget| (widget.rect.top(), widget.rect.left());
        let ((top, left), (other_top, other_left)) = (place(a), place(b));
        top.total_cmp(&other_top).then(left.total_cmp(&other_left)).then_with(|| a.label.cmp(&b.label))
    });
    widgets
}

/// Texts in the order of painting.
pub fn texts(shapes: &[ClippedShape]) -> Vec<Text> {
    fn collect(shape: &Shape, clip: Rect, found: &mut Vec<Text>) {
        match shape {
            Shape::Text(text) => {
                let rect = text.galley.mesh_bounds.translate(text.pos.to_vec2());
                if rect.is_positive() && text.angle == 0.0 {
                    found.push(Text { text: text.galley.text().to_owned(), rect, clip });
                }
            }
            Shape::Vec(shapes) => shapes.iter().for_each(|shape| collect(shape, clip, found)),
            _ => {}
        }
    }
    let mut found = Vec::new();
    shapes.iter().for_each(|shape| collect(&shape.shape, shape.clip_rect, &mut found));
    found
}

/// Questions about a picture.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Asked {
    /// Everything that can be clicked has a name.
    pub names: bool,
    /// Names of one kind in a row differ, so that each says which one is meant.
    pub apart: bool,
    /// Nothing is laid out beside the picture, and no text is cut off at its side.
    pub room: bool,
}

/// Everything that is wrong with a picture of a width, a sentence each.
pub fn problems(shot: &Shot, width: f32, asked: Asked) -> Vec<String> {
    let mut problems: Vec<String> = shot.missed.iter().map(ToString::to_string).collect();
    if asked.names {
        problems.extend(unnamed(&shot.widgets));
    }
    if asked.apart {
        problems.extend(ambiguous(&shot.widgets));
    }
    if asked.room {
        problems.extend(beside(&shot.widgets, width));
        problems.extend(cut(shot));
    }
    problems
}

fn place(rect: Rect) -> String {
    format!("({:.0}, {:.0}) to ({:.0}, {:.0})", rect.left(), rect.top(), rect.right(), rect.bottom())
}

/// Widgets that can be clicked and that nothing names.
fn unnamed(widgets: &[Widget]) -> Vec<String> {
    let has_name = |widget: &Widget| !widget.label.trim().is_empty() || widget.is_labelled;
    // The number beside a slider has the slider's name.
    let is_of_slider = |number: &Widget| {
        let is_beside = |other: &Widget| {
            let gap = number.rect.left() - other.rect.right();
            other.rect.y_range().contains(number.rect.center().y) && (-number.rect.width() - 2.0..20.0).contains(&gap)
        };
        number.role == accesskit::Role::SpinButton
            && widgets.iter().any(|other| other.role == accesskit::Role::Slider && has_name(other) && is_beside(other))
    };
    // The area of an open menu takes clicks, so that they meet nothing below it.
    let is_menu = |area: &Widget| {
        let is_within = |other: &Widget| area.rect.contains_rect(other.rect) && other.is_clickable && has_name(other);
        area.role == accesskit::Role::Unknown && widgets.iter().any(is_within)
    };
    let lacks =
        |widget: &&Widget| widget.is_clickable && !has_name(widget) && !is_of_slider(widget) && !is_menu(widget);
    let told = |widget: &Widget| {
        format!("{:?} {:?} at {} can be clicked and has no name", widget.role, widget.value, place(widget.rect))
    };
    widgets.iter().filter(lacks).map(told).collect()
}

/// Widgets of one row with the same name and role.
fn ambiguous(widgets: &[Widget]) -> Vec<String> {
    let named: Vec<&Widget> =
        widgets.iter().filter(|widget| widget.is_clickable && !widget.label.trim().is_empty()).collect();
    let mut problems = Vec::new();
    for (number, one) in named.iter().enumerate() {
        let is_twin = |other: &&&Widget| {
            let shared = one.rect.y_range().intersection(other.rect.y_range()).span();
            one.role == other.role
                && one.label == other.label
                && shared > 0.5 * one.rect.height().min(other.rect.height())
        };
        if let Some(other) = named[number + 1..].iter().find(is_twin) {
            let (here, there) = (place(one.rect), place(other.rect));
            problems.push(format!("{:?} {:?} at {here} has the name of that at {there}", one.role, one.label));
        }
    }
    problems
}

/// Widgets that reach beyond the sides. Texts of fields may be longer than the field, which scrolls them.
fn beside(widgets: &[Widget], width: f32) -> Vec<String> {
    let is_told = |widget: &&Widget| {
        let is_field = matches!(widget.role, accesskit::Role::TextInput | accesskit::Role::MultilineTextInput);
        !is_field && (widget.is_clickable || widget.role == accesskit::Role::Label)
    };
    let is_beside = |widget: &&Widget| widget.rect.right() > width + 0.5 || widget.rect.left() < -0.5;
    let told = |widget: &Widget| {
        let name = if widget.label.is_empty() { &widget.value } else { &widget.label };
        format!("{:?} {name:?} at {} reaches beyond the width of {width}", widget.role, place(widget.rect))
    };
    widgets.iter().filter(is_told).filter(is_beside).map(told).collect()
}

/// Texts of which letters are cut off at a side. Texts within fields scroll.
fn cut(shot: &Shot) -> Vec<String> {
    let fields = |text: &Text| {
        let is_field = |widget: &&Widget| {
            matches!(
                widget.role,
                accesskit::Role::TextInput | accesskit::Role::MultilineTextInput | accesskit::Role::SpinButton
            )
        };
        shot.widgets.iter().filter(is_field).any(|field| field.rect.expand(2.0).contains(text.clip.center()))
    };
    let is_seen = |text: &&Text| text.rect.intersects(text.clip);
    let is_cut =
        |text: &&Text| text.rect.left() < text.clip.left() - 1.0 || text.rect.right() > text.clip.right() + 1.0;
    let told = |text: &Text| format!("{:?} at {} is cut off by {}", text.text, place(text.rect), place(text.clip));
    shot.texts.iter().filter(is_seen).filter(is_cut).filter(|text| !fields(text)).map(told).collect()
}
