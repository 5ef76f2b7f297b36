//! Forms: how a module's parameters are laid out for editing, the `*.ui.ron` files.
//!
//! ```ron
//! (
//!     title: "Control",
//!     content: [
//!         Node(param: "at"),
//!         Frame(label: "Shape", content: [
//!             Menu(param: "shape", options: ["circle", "cube"]),
//!             Slider(param: "relative_size", min: 0.05, max: 2.0, step: 0.05),
//!             Color(param: "color"),
//!         ]),
//!         Separator,
//!         Comment("Limits stop a person, never a constraint."),
//!     ],
//! )
//! ```
//!
//! Every element but frames, separators and comments is bound to a parameter: `param` is its name, or a path into it
//! (`creation.label`, `limits.rotate`). What an element shows before anything is written comes from the module, and so
//! do the label (the name with blanks) and the tip (the parameter's line of documentation) where they are left out.

mod list_item;

use bevy::reflect::TypeInfo;
use serde::{Deserialize, Serialize};

pub use list_item::ListItem;

use super::ModuleInfo;
use crate::rig::{SourceError, fields, nearest::did_you_mean, ron_options, ron_text, utf8, with_field};

/// The longest form that is read, in bytes.
pub const MAX_BYTES: usize = 1 << 20;

/// The form of a module.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Form {
    /// Title above the elements.
    pub title: String,
    /// The elements from top to bottom.
    pub content: Vec<FormElement>,
}

/// One element of a form.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum FormElement {
    /// Elements that belong together, to fold away.
    Frame {
        /// Title of the frame.
        label: String,
        /// Folded out at first.
        #[serde(default = "yes")]
        open: bool,
        /// The elements.
        content: Vec<FormElement>,
    },
    /// A line of text.
    Text(FormBinding),
    /// A box to check.
    Check(FormBinding),
    /// One of several values.
    Menu {
        /// The parameter.
        param: String,
        /// See [`FormBinding::label`].
        #[serde(default)]
        label: String,
        /// The values as they stand in files, without quotation marks.
        options: Vec<String>,
    },
    /// A number between two ends.
    Slider {
        /// The parameter.
        param: String,
        /// See [`FormBinding::label`].
        #[serde(default)]
        label: String,
        /// The lowest value that the slider reaches; others can be typed.
        min: f32,
        /// The highest.
        max: f32,
        /// Step of the slider.
        #[serde(default = "hundredth")]
        step: f32,
        /// Text after the number, such as a unit.
        #[serde(default)]
        unit: String,
    },
    /// A number, or the name of an attribute that it follows ([`Amount`](super::Amount)).
    Amount(FormBinding),
    /// A number without ends.
    Number {
        /// The parameter.
        param: String,
        /// See [`FormBinding::label`].
        #[serde(default)]
        label: String,
        /// Change of the number per pixel of a drag.
        #[serde(default = "hundredth")]
        step: f32,
        /// Text after the number, such as a unit.
        #[serde(default)]
        unit: String,
    },
    /// Three numbers or three boxes, for X, Y and Z.
    Vector(FormBinding),
    /// Three pairs of lowest and highest values, each of which may be open, for X, Y and Z.
    Limits(FormBinding),
    /// An sRGB colour; may be left out where the parameter may.
    Color(FormBinding),
    /// References to nodes.
    Node(FormBinding),
    /// Keys of a curve: pairs of numbers, the first ones increasing.
    Curve(FormBinding),
    /// Several values of one kind: a row for each, which can be added, moved and removed ([`ListItem`]).
    List(FormBinding),
    /// A line across.
    Separator,
    /// A note for people.
    Comment(String),
}

/// Binding of an element that has no settings of its own.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FormBinding {
    /// The parameter, or a path into it.
    pub param: String,
    /// Label beside the element; the last name of the path, with blanks, if empty.
    #[serde(default)]
    pub label: String,
}

fn yes() -> bool {
    true
}

fn hundredth() -> f32 {
    0.01
}

/// Parameter and label of an element, borrowed as the element is; `None` for elements that edit nothing.
macro_rules! binding {
    ($element:expr) => {
        match $element {
            FormElement::Text(FormBinding { param, label })
            | FormElement::Check(FormBinding { param, label })
            | FormElement::Vector(FormBinding { param, label })
            | FormElement::Limits(FormBinding { param, label })
            | FormElement::Color(FormBinding { param, label })
            | FormElement::Node(FormBinding { param, label })
            | FormElement::Curve(FormBinding { param, label })
            | FormElement::Amount(FormBinding { param, label })
            | FormElement::List(FormBinding { param, label })
            | FormElement::Menu { param, label, .. }
            | FormElement::Slider { param, label, .. }
            | FormElement::Number { param, label, .. } => Some((param, label)),
            FormElement::Frame { .. } | FormElement::Separator | FormElement::Comment(_) => None,
        }
    };
}

impl FormElement {
    /// The parameter that it edits, and its label as written; `None` for frames, separators and comments.
    pub fn bound(&self) -> Option<(&str, &str)> {
        binding!(self).map(|(param, label)| (param.as_str(), label.as_str()))
    }

    /// Parameter and label of an element that edits one, to change them.
    fn binding_mut(&mut self) -> Option<(&mut String, &mut String)> {
        binding!(self)
    }

    /// Label beside the element: as written, or the last name of the parameter's path with blanks.
    pub fn label(&self) -> String {
        match self.bound() {
            Some((param, "")) => {
                let name = param.rsplit('.').next().unwrap_or(param).replace('_', " ");
                let mut chars = name.chars();
                chars.next().map_or_else(String::new, |first| first.to_uppercase().chain(chars).collect())
            }
            Some((_, label)) => label.to_owned(),
            None => match self {
                Self::Frame { label, .. } => label.clone(),
                Self::Comment(text) => text.clone(),
                _ => String::new(),
            },
        }
    }

    /// The kind of element as it is called in files.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Frame { .. } => "Frame",
            Self::Text(_) => "Text",
            Self::Check(_) => "Check",
            Self::Menu { .. } => "Menu",
            Self::Slider { .. } => "Slider",
            Self::Number { .. } => "Number",
            Self::Vector(_) => "Vector",
            Self::Limits(_) => "Limits",
            Self::Color(_) => "Color",
            Self::Node(_) => "Node",
            Self::Curve(_) => "Curve",
            Self::List(_) => "List",
            Self::Amount(_) => "Amount",
            Self::Separator => "Separator",
            Self::Comment(_) => "Comment",
        }
    }
}

impl Form {
    /// All elements, those in frames after their frame.
    pub fn elements(&self) -> Vec<&FormElement> {
        fn add<'a>(elements: &'a [FormElement], list: &mut Vec<&'a FormElement>) {
            for element in elements {
                list.push(element);
                if let FormElement::Frame { content, .. } = element {
                    add(content, list);
                }
            }
        }
        let mut list = Vec::new();
        add(&self.content, &mut list);
        list
    }
}

/// Reads a form, whatever module it is for.
///
/// # Errors
/// [`SourceError`] with line and column.
pub fn read_form(bytes: &[u8]) -> Result<Form, SourceError> {
    parse(utf8(bytes, MAX_BYTES, "form")?)
}

/// Reads a form; the binding of an element stands in the element's own brackets.
fn parse(text: &str) -> Result<Form, SourceError> {
    let options = ron_options().with_default_extension(ron::extensions::Extensions::UNWRAP_VARIANT_NEWTYPES);
    options.from_str(text).map_err(|error| SourceError::from_ron(text, &error))
}

/// Reads the form of a module and checks that every element edits a parameter that the module has, of a type that the
/// element can edit, and each only once.
///
/// # Errors
/// The first thing wrong, with line and column.
pub fn read_module_form(bytes: &[u8], module: &ModuleInfo) -> Result<Form, SourceError> {
    let text = utf8(bytes, MAX_BYTES, "form")?;
    let form = parse(text)?;
    // The elements' parameters stand in the text in the order of the elements.
    let mut places = fields(text).into_iter().filter(|field| field.name == "param").map(|field| field.start);
    let mut seen: Vec<&str> = Vec::new();
    for element in form.elements() {
        let Some((param, _)) = element.bound() else { continue };
        let place = places.next().unwrap_or_default();
        let wrong = |message: String| SourceError::at(text, place, message);
        let info = type_at(module, param).map_err(|error| wrong(error.to_string()))?;
        if seen.contains(&param) {
            return Err(wrong(format!("`{param}` is edited twice; keep one of the two")));
        }
        seen.push(param);
        check(element, info).map_err(|needed| {
            let kind = element.kind();
            wrong(format!("a {kind} cannot edit `{param}`, which is {}: {needed}", info.short_path()))
        })?;
        if let FormElement::Menu { options, .. } = element {
            let quoted = info.bare().short_path() == "String";
            for option in options {
                let value = if quoted { ron_text(option) } else { option.clone() };
                let set = param.rsplit('.').fold(value, |value, name| with_field("()", name, &value));
                let known = module.parse(&set);
                known.map_err(|error| wrong(format!("`{param}` cannot be \"{option}\": {}", error.message)))?;
            }
        }
    }
    Ok(form)
}

/// A type, and the type behind an `Option`.
#[derive(Clone, Copy)]
struct TypeAt {
    info: Option<&'static TypeInfo>,
    path: &'static bevy::reflect::TypePathTable,
}

impl TypeAt {
    fn short_path(&self) -> &'static str {
        self.path.short_path()
    }

    /// The type without an `Option` around it.
    fn bare(self) -> Self {
        if let Some(TypeInfo::Enum(info)) = self.info
            && info.type_path_table().short_path().starts_with("Option<")
            && let Some(bevy::reflect::enums::VariantInfo::Tuple(some)) = info.variant("Some")
            && let Some(field) = some.field_at(0)
        {
            return Self { info: field.type_info(), path: field.type_path_table() };
        }
        self
    }
}

/// Reason why a path names no parameter of a module.
#[derive(Debug, thiserror::Error)]
enum NoParameter {
    /// The path goes on behind a parameter without fields.
    #[error("`{parameter}` of {module} has no parts; name it as a whole")]
    Whole {
        /// The path as far as it can be followed.
        parameter: String,
        /// Name of the module.
        module: &'static str,
    },
    /// A name of the path is unknown.
    #[error("the module {module} has no parameter `{path}`{nearest}")]
    Unknown {
        /// Name of the module.
        module: &'static str,
        /// The path.
        path: String,
        /// Proposal of another name, or nothing.
        nearest: String,
    },
}

/// The type of the parameter that a path with dots names.
fn type_at(module: &ModuleInfo, path: &str) -> Result<TypeAt, NoParameter> {
    let mut at = TypeAt { info: Some(module.type_info), path: module.type_info.type_path_table() };
    let mut before = String::new();
    for name in path.split('.') {
        let Some(TypeInfo::Struct(info)) = at.info else {
            return Err(NoParameter::Whole { parameter: before, module: module.name });
        };
        let Some(field) = info.field(name) else {
            let nearest = did_you_mean(name, info.field_names().iter().copied());
            return Err(NoParameter::Unknown { module: module.name, path: path.to_owned(), nearest });
        };
        at = TypeAt { info: field.type_info(), path: field.type_path_table() };
        before = if before.is_empty() { name.to_owned() } else { format!("{before}.{name}") };
    }
    Ok(at)
}

/// Reason why an element of a form cannot edit its parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
enum ElementError {
    /// Menu without options.
    #[error("list the `options`")]
    NoOptions,
    /// Slider whose ends are equal or swapped.
    #[error("`min` has to be below `max`")]
    EmptyRange,
    /// Parameter for which another element is made.
    #[error("use {0}")]
    Use(&'static str),
    /// Parameter with fields, for which no element is made.
    #[error("name the parts of it one by one")]
    UseParts,
}

/// Checks that an element can edit a type.
fn check(element: &FormElement, at: TypeAt) -> Result<(), ElementError> {
    let bare = at.bare();
    let path = bare.short_path();
    let is_enum = matches!(bare.info, Some(TypeInfo::Enum(_)));
    let is_number = matches!(path, "f32" | "f64" | "u8" | "u16" | "u32" | "u64" | "usize" | "i32" | "i64");
    let is_list = path.starts_with("Vec<");
    let fits = match element {
        FormElement::Text(_) => matches!(path, "String" | "Uid"),
        FormElement::Check(_) => path == "bool",
        FormElement::Menu { options, .. } => {
            if options.is_empty() {
                return Err(ElementError::NoOptions);
            }
            path == "String" || is_enum
        }
        FormElement::Slider { min, max, .. } => {
            if min >= max {
                return Err(ElementError::EmptyRange);
            }
            is_number
        }
        FormElement::Number { .. } => is_number,
        FormElement::Vector(_) => matches!(path, "Vec3" | "[f32; 3]" | "[bool; 3]"),
        FormElement::Limits(_) => path.starts_with("[(Option<f32>, Option<f32>); 3]"),
        FormElement::Color(_) => path == "[f32; 3]",
        FormElement::Node(_) => matches!(path, "NodeRef" | "NodeRefs"),
        FormElement::Curve(_) => path == "Vec<(f32, f32)>",
        FormElement::List(_) => is_list,
        FormElement::Amount(_) => path == "Amount",
        FormElement::Frame { .. } | FormElement::Separator | FormElement::Comment(_) => true,
    };
    if fits {
        return Ok(());
    }
    Err(match path {
        "bool" => ElementError::Use("Check"),
        "NodeRef" | "NodeRefs" => ElementError::Use("Node"),
        "String" | "Uid" => ElementError::Use("Text or Menu"),
        "Vec3" | "[bool; 3]" => ElementError::Use("Vector"),
        "[f32; 3]" => ElementError::Use("Color or Vector"),
        "Vec<(f32, f32)>" => ElementError::Use("Curve or List"),
        _ if path.starts_with("[(Option<f32>") => ElementError::Use("Limits"),
        _ if is_number => ElementError::Use("Slider or Number"),
        "Amount" => ElementError::Use("Amount"),
        _ if is_enum => ElementError::Use("Menu"),
        _ if is_list => ElementError::Use("List"),
        _ => ElementError::UseParts,
    })
}
