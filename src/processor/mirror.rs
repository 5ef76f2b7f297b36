//! Values with a side: what they are on the other side of the character.
//!
//! The frame of a mirrored joint is the mirror image of the frame with its X axis turned over, so that it stays
//! right-handed: a direction `(x, y, z)` in a joint's axes becomes `(-x, y, z)`, as one in the rig's axes does, and an
//! angle about X stays while those about Y and Z change their sign.

use std::{collections::HashMap, ops::Range};

use bevy::reflect::{PartialReflect, ReflectMut};
use glam::Vec3;

use super::{Amount, ik::JointAngles};
use crate::rig::{fields, label::mirror_label, list_items, with_field};

/// A number of the opposite sign, without a negative zero.
pub fn opposite(value: f32) -> f32 {
    0.0 - value
}

/// A direction or a place on the other side.
pub fn mirrored_direction(direction: Vec3) -> Vec3 {
    Vec3 { x: opposite(direction.x), ..direction }
}

/// A line on the other side, whose two directions mean the same: one along X stays as it is.
pub fn mirrored_line(line: Vec3) -> Vec3 {
    if line.y == 0.0 && line.z == 0.0 { line } else { mirrored_direction(line) }
}

/// Angles about X, Y and Z on the other side.
pub fn mirrored_angles(angles: Vec3) -> Vec3 {
    Vec3::new(angles.x, opposite(angles.y), opposite(angles.z))
}

/// Lowest and highest angles of a joint on the other side.
pub fn mirrored_limits([x, y, z]: JointAngles) -> JointAngles {
    let over = |(low, high): (Option<f32>, Option<f32>)| (high.map(opposite), low.map(opposite));
    [x, over(y), over(z)]
}

impl Amount {
    /// The opposite number: the same value of an attribute moves both sides alike.
    pub fn opposite(&self) -> Self {
        match self {
            Self::Value(value) => Self::Value(opposite(*value)),
            Self::Attribute(name) => Self::Attribute(match name.strip_prefix(Self::OPPOSITE) {
                Some(name) => name.to_owned(),
                None => format!("{}{name}", Self::OPPOSITE),
            }),
        }
    }

    /// Gives the attribute that it follows the name of the other side.
    fn mirror_name(&mut self) {
        let Self::Attribute(text) = self else { return };
        match text.strip_prefix(Self::OPPOSITE) {
            Some(name) => {
                let mut name = name.to_owned();
                mirror_label(&mut name);
                *text = format!("{}{name}", Self::OPPOSITE);
            }
            None => mirror_label(text),
        }
    }
}

/// Gives the attributes that a module's values name the names of the other side: every [`Amount`], and every text in a field
/// called `attribute` or `SOMETHING_attribute`.
pub(super) fn mirror_attributes(module: &mut dyn PartialReflect) {
    mirror_attributes_in(module, false);
}

/// True for the name of a field whose text is the name of an attribute.
fn is_attribute_field(name: &str) -> bool {
    name == "attribute" || name.ends_with("_attribute")
}

fn mirror_attributes_in(value: &mut dyn PartialReflect, is_attribute: bool) {
    if let Some(amount) = value.try_downcast_mut::<Amount>() {
        amount.mirror_name();
        return;
    }
    if let Some(text) = value.try_downcast_mut::<String>() {
        if is_attribute {
            mirror_label(text);
        }
        return;
    }
    match value.reflect_mut() {
        ReflectMut::Struct(fields) => {
            for at in 0..fields.field_len() {
                let is_attribute = fields.name_at(at).is_some_and(is_attribute_field);
                if let Some(field) = fields.field_at_mut(at) {
                    mirror_attributes_in(field, is_attribute);
                }
            }
        }
        ReflectMut::List(items) => {
            for at in 0..items.len() {
                if let Some(item) = items.get_mut(at) {
                    mirror_attributes_in(item, is_attribute);
                }
            }
        }
        ReflectMut::Tuple(fields) => {
            for at in 0..fields.field_len() {
                if let Some(field) = fields.field_mut(at) {
                    mirror_attributes_in(field, is_attribute);
                }
            }
        }
        ReflectMut::Enum(variant) => {
            for at in 0..variant.field_len() {
                let is_attribute = is_attribute || variant.name_at(at).is_some_and(is_attribute_field);
                if let Some(field) = variant.field_at_mut(at) {
                    mirror_attributes_in(field, is_attribute);
                }
            }
        }
        _ => {}
    }
}

/// Parameters with the values that differ between two complete ones, `before` and `after`. Everything else stays as it is
/// written, and what is left out stays left out where that is possible.
pub(super) fn with_changes(params: &str, before: &str, after: &str) -> String {
    let now = values(before);
    let then = values(after);
    let mut changed: Vec<(&Path, &str)> = Vec::new();
    for (path, value) in &then {
        if now.get(path) != Some(value) {
            changed.push((path, value));
        }
    }
    changed.sort_unstable();
    let mut out = params.to_owned();
    let mut whole: Vec<&str> = Vec::new();
    for (path, value) in changed {
        let written = values_with_places(&out);
        match written.iter().find(|(known, ..)| known == path) {
            Some((_, start, end)) => out.replace_range(*start..*end, value),
            // A value that is left out has no side, or else all of the parameter is written.
            None => whole.extend(path.first().map(|(name, _)| name.as_str()).filter(|name| !whole.contains(name))),
        }
    }
    whole.into_iter().for_each(|name| write_whole(&mut out, after, name));
    out
}

/// Writes one parameter as a whole, as it is in complete ones, `after`.
pub(super) fn write_whole(params: &mut String, after: &str, name: &str) {
    let Some(value) = place_of(after, name).map(|place| &after[place]) else { return };
    *params = with_field(params, name, value);
}

/// Place of the value of a parameter, or of a part of one: `creation.label`, `inputs[0].name`.
pub(super) fn place_of(params: &str, path: &str) -> Option<Range<usize>> {
    let Some((list, rest)) = path.split_once('[') else { return place_of_field(params, path) };
    let (number, rest) = rest.split_once(']')?;
    let list = place_of_field(params, list)?;
    let items = list_items(&params[list.clone()]);
    let item = items.get(number.parse::<usize>().ok()?)?;
    let item = list.start + item.start..list.start + item.end;
    match rest.strip_prefix('.') {
        Some(rest) => {
            let inside = place_of(&params[item.clone()], rest)?;
            Some(item.start + inside.start..item.start + inside.end)
        }
        None => rest.is_empty().then_some(item),
    }
}

/// Place of the value of a field, by the names of fields from the outside in.
fn place_of_field(params: &str, path: &str) -> Option<Range<usize>> {
    let fields = fields(params);
    let mut found = None;
    for name in path.split('.') {
        found = Some(fields.iter().position(|field| field.parent == found && field.name == name)?);
    }
    let field = &fields[found?];
    Some(value_range(params, field.value, field.end))
}

/// Names of fields from the outside in, each with its number among those of its name in the same value.
type Path = Vec<(String, usize)>;

/// The values without fields in them, by their paths.
fn values(text: &str) -> HashMap<Path, &str> {
    values_with_places(text).into_iter().map(|(path, start, end)| (path, &text[start..end])).collect()
}

fn values_with_places(text: &str) -> Vec<(Path, usize, usize)> {
    let fields = fields(text);
    let mut paths: Vec<Path> = Vec::with_capacity(fields.len());
    let mut counts: HashMap<(Option<usize>, &str), usize> = HashMap::new();
    let mut is_leaf = vec![true; fields.len()];
    for field in &fields {
        let count = counts.entry((field.parent, field.name)).or_default();
        let mut path = field.parent.map_or_else(Vec::new, |parent| paths[parent].clone());
        path.push((field.name.to_owned(), *count));
        *count += 1;
        paths.push(path);
        if let Some(parent) = field.parent {
            is_leaf[parent] = false;
        }
    }
    let leaves = fields.iter().zip(paths).zip(is_leaf).filter(|(_, is_leaf)| *is_leaf);
    let placed = leaves.map(|((field, path), _)| {
        let range = value_range(text, field.value, field.end);
        (path, range.start, range.end)
    });
    placed.collect()
}

/// A value without the blanks around it and the comma after it.
fn value_range(text: &str, start: usize, end: usize) -> Range<usize> {
    let value = &text[start..end];
    let trimmed = value.trim().trim_end_matches(',').trim_end();
    let start = start + value.len() - value.trim_start().len();
    start..start + trimmed.len()
}
