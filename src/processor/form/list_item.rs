//! Items of lists in forms: the elements that edit one item, by the type of the list.

use bevy::reflect::{TypeInfo, enums::EnumInfo};

use super::{FormBinding, FormElement, TypeAt, type_at};
use crate::{processor::ModuleInfo, rig::with_field};

/// Elements for one item of a list, and the item that a person adds to the list.
#[derive(Debug, Clone, PartialEq)]
pub struct ListItem {
    /// Elements of an item: a single one without a parameter for a plain value, else one for each field of the item.
    pub elements: Vec<FormElement>,
    /// RON of the item that is added.
    pub fresh: String,
}

impl ListItem {
    /// Elements for the items of a parameter; `None` if it is no list, or its items are of a type that has no element.
    pub fn of(module: &ModuleInfo, path: &str) -> Option<Self> {
        let TypeInfo::List(list) = type_at(module, path).ok()?.info? else { return None };
        let info = list.item_info()?;
        let item = TypeAt { info: Some(info), path: info.type_path_table() };
        let takes = |value: &str| module.parse(&with_parameter(path, &format!("[{value}]"))).is_ok();
        let elements = match (element("", item, &takes), info) {
            (Some(plain), _) => vec![plain],
            (None, TypeInfo::Struct(fields)) => {
                let of = |field: &'static bevy::reflect::NamedField| {
                    let at = TypeAt { info: field.type_info(), path: field.type_path_table() };
                    element(field.name(), at, &|value: &str| takes(&with_field("()", field.name(), value)))
                };
                fields.iter().map(of).collect::<Option<Vec<_>>>()?
            }
            (None, _) => return None,
        };
        let fresh = fresh(&elements, takes)?;
        Some(Self { elements, fresh })
    }

    /// Elements of the item with that number, counted from 0, of a list of that path and label. Their parameters are paths of
    /// values in the list: `inputs[0].name`.
    pub fn row(&self, path: &str, number: usize, label: &str) -> Vec<FormElement> {
        let row = |element: &FormElement| {
            let mut bound = element.clone();
            let name = element.label();
            if let Some((param, said)) = bound.binding_mut() {
                let dot = if param.is_empty() { "" } else { "." };
                *param = format!("{path}[{number}]{dot}{param}");
                *said = format!("{}: {}", number + 1, if name.is_empty() { label } else { &name });
            }
            bound
        };
        self.elements.iter().map(row).collect()
    }
}

/// Parameters of a module with one value, at a path.
fn with_parameter(path: &str, value: &str) -> String {
    path.rsplit('.').fold(value.to_owned(), |value, name| with_field("()", name, &value))
}

/// Element that edits a value of a type; `None` for a type that has none. `takes` tells which texts the value can have.
fn element(param: &str, at: TypeAt, takes: &dyn Fn(&str) -> bool) -> Option<FormElement> {
    let bound = FormBinding { param: param.to_owned(), label: String::new() };
    let number = || FormElement::Number {
        param: param.to_owned(),
        label: String::new(),
        step: super::hundredth(),
        unit: String::new(),
    };
    let bare = at.bare();
    match bare.short_path() {
        "bool" => Some(FormElement::Check(bound)),
        "f32" | "f64" | "u8" | "u16" | "u32" | "u64" | "usize" | "i32" | "i64" => Some(number()),
        "String" => Some(FormElement::Text(bound)),
        "Amount" => Some(FormElement::Amount(bound)),
        "NodeRef" | "NodeRefs" => Some(FormElement::Node(bound)),
        "Vec3" | "[f32; 3]" | "[bool; 3]" => Some(FormElement::Vector(bound)),
        path if path.starts_with("[(Option<f32>, Option<f32>); 3]") => Some(FormElement::Limits(bound)),
        _ => {
            let Some(TypeInfo::Enum(info)) = bare.info else { return None };
            let is_optional = at.short_path().starts_with("Option<");
            let options = options(info, is_optional, takes)?;
            Some(FormElement::Menu { param: param.to_owned(), label: String::new(), options })
        }
    }
}

/// Variants as they stand in files, after `None` for an optional value; `None` if a variant is more than a name.
fn options(info: &EnumInfo, is_optional: bool, takes: &dyn Fn(&str) -> bool) -> Option<Vec<String>> {
    let mut options: Vec<String> = is_optional.then(|| "None".to_owned()).into_iter().collect();
    for name in info.variant_names() {
        let spellings = [(*name).to_owned(), snake_case(name)];
        options.push(spellings.into_iter().find(|spelling| takes(spelling))?);
    }
    Some(options)
}

/// A name such as `RotateX` as `rotate_x`.
fn snake_case(name: &str) -> String {
    let mut text = String::with_capacity(name.len() + 4);
    for letter in name.chars() {
        if letter.is_uppercase() && !text.is_empty() {
            text.push('_');
        }
        text.extend(letter.to_lowercase());
    }
    text
}

/// RON of an item for elements: its default if it has fields.
fn fresh(elements: &[FormElement], takes: impl Fn(&str) -> bool) -> Option<String> {
    let texts: &[&str] = match elements {
        [FormElement::Number { param, .. }] if param.is_empty() => &["1.0", "1"],
        [FormElement::Amount(bound)] if bound.param.is_empty() => &["1.0"],
        [FormElement::Check(bound)] if bound.param.is_empty() => &["false"],
        [FormElement::Text(bound) | FormElement::Node(bound)] if bound.param.is_empty() => &["\"\""],
        [FormElement::Vector(bound)] if bound.param.is_empty() => &["(0.0, 0.0, 0.0)", "(false, false, false)"],
        [FormElement::Limits(bound)] if bound.param.is_empty() => &["((None, None), (None, None), (None, None))"],
        [FormElement::Menu { param, options, .. }] if param.is_empty() => {
            return options.first().cloned();
        }
        _ => &["()"],
    };
    texts.iter().find(|text| takes(text)).map(|text| (*text).to_owned())
}
