//! Values of open cards, read once for each change of their commands: reading parameters takes longer than drawing them.

use std::{
    collections::{BTreeMap, HashSet},
    sync::Arc,
};

use super::{
    parameter_text::{plain, read},
    stack::Entry,
};
use crate::{
    editor::panels::fields::CommonValue,
    processor::{
        ModuleInfo, ParameterValues,
        form::{Form, FormElement, ListItem},
    },
    rig::{SourceError, Uid, list_items},
};

/// Lowest and highest values about X, Y and Z.
pub(super) type Limits = [(Option<f32>, Option<f32>); 3];

/// Most items of a list that is drawn as rows; longer ones are text.
const MOST_ROWS: usize = 64;

/// Rows of a list.
#[derive(Debug, Clone)]
pub(super) struct Rows {
    /// Elements of each item.
    pub elements: Vec<Vec<FormElement>>,
    /// RON of an item that is added.
    pub fresh: String,
}

impl Rows {
    /// Rows of the list at a path with its items as RON; `None` if the items have no elements, or there are too many.
    fn of(module: &ModuleInfo, path: &str, label: &str, text: &str) -> Option<Self> {
        let item = ListItem::of(module, path)?;
        let count = list_items(text).len();
        let rows = 0..(count <= MOST_ROWS).then_some(count)?;
        Some(Self { elements: rows.map(|number| item.row(path, number, label)).collect(), fresh: item.fresh })
    }
}

/// Value of one parameter in all commands of a card.
#[derive(Debug, Clone, Default)]
pub(super) struct CardValue {
    /// RON of the value in the last command.
    pub text: String,
    /// Value without quotation marks.
    pub plain: String,
    /// True if other commands have another value.
    pub mixed: bool,
    /// True if all commands have the default.
    pub is_default: bool,
    /// Three numbers of all commands.
    pub vector: Option<[CommonValue<f32>; 3]>,
    /// Three switches.
    pub boxes: Option<[bool; 3]>,
    /// Limits; open where there are none.
    pub limits: Limits,
    /// A colour.
    pub color: Option<[f32; 3]>,
    /// Keys of a curve.
    pub curve: Option<Vec<(f32, f32)>>,
    /// Rows of a list that is the same in all commands.
    pub rows: Option<Rows>,
}

/// Values of the commands of a card.
#[derive(Debug, Default)]
pub(super) struct CommandValues {
    /// Values of each command.
    pub commands: Vec<ParameterValues>,
    known: BTreeMap<String, CardValue>,
}

impl CommandValues {
    fn read(module: &ModuleInfo, form: &Form, params: &[String]) -> Result<Self, SourceError> {
        let commands = params.iter().map(|params| module.values(params)).collect::<Result<Vec<_>, _>>()?;
        let mut values = Self { commands, known: BTreeMap::new() };
        values.know(module, &form.content);
        Ok(values)
    }

    fn know(&mut self, module: &ModuleInfo, elements: &[FormElement]) {
        for element in elements {
            if let FormElement::Frame { content, .. } = element {
                self.know(module, content);
            } else if let Some((path, _)) = element.bound() {
                let mut known = self.value(element, path);
                if matches!(element, FormElement::List(_)) && !known.mixed {
                    known.rows = Rows::of(module, path, &element.label(), &known.text);
                    self.know_items(known.rows.as_ref());
                }
                self.known.insert(path.to_owned(), known);
            }
        }
    }

    /// Takes in the values of the items of a list. Only the whole list has a default.
    fn know_items(&mut self, rows: Option<&Rows>) {
        for element in rows.into_iter().flat_map(|rows| rows.elements.iter().flatten()) {
            if let Some((path, _)) = element.bound() {
                let known = CardValue { is_default: true, ..self.value(element, path) };
                self.known.insert(path.to_owned(), known);
            }
        }
    }

    fn value(&self, element: &FormElement, path: &str) -> CardValue {
        let texts = self.commands.iter().map(|values| values.get(path).unwrap_or("None"));
        let CommonValue { value: text, mixed } = CommonValue::of(texts).unwrap_or_default();
        let mut known = CardValue {
            text: text.to_owned(),
            plain: plain(text),
            mixed,
            is_default: self.commands.iter().all(|values| values.is_default(path)),
            ..CardValue::default()
        };
        match element {
            FormElement::Vector(_) => (known.vector, known.boxes) = (self.vector(path), read(text)),
            FormElement::Limits(_) => known.limits = read(text).unwrap_or_default(),
            FormElement::Color(_) => known.color = read(text),
            FormElement::Curve(_) => known.curve = read(text),
            _ => {}
        }
        known
    }

    fn vector(&self, path: &str) -> Option<[CommonValue<f32>; 3]> {
        let all = self.commands.iter().map(|values| read(values.get(path)?));
        let all = all.collect::<Option<Vec<[f32; 3]>>>()?;
        Some([0, 1, 2].map(|axis| CommonValue::of(all.iter().map(|numbers| numbers[axis])).unwrap_or_default()))
    }

    /// The value of a parameter that the form has an element for.
    pub fn get(&self, path: &str) -> Option<&CardValue> {
        self.known.get(path)
    }
}

/// Values of all open cards, by their first tags.
#[derive(Default)]
pub(super) struct ReadValues {
    cards: BTreeMap<Uid, ReadCard>,
}

/// Values of a card, with what they were read from.
struct ReadCard {
    module: &'static str,
    params: Vec<String>,
    values: Result<Arc<CommandValues>, SourceError>,
}

impl ReadValues {
    /// Values of a card; they are read if its commands are others than before.
    pub fn of(&mut self, module: &ModuleInfo, form: &Form, entry: &Entry) -> Result<Arc<CommandValues>, SourceError> {
        let tag = entry.first.uid;
        let is_same = |card: &&ReadCard| card.module == module.name && card.params == entry.params;
        if let Some(card) = self.cards.get(&tag).filter(is_same) {
            return card.values.clone();
        }
        let values = CommandValues::read(module, form, &entry.params).map(Arc::new);
        let card = ReadCard { module: module.name, params: entry.params.clone(), values: values.clone() };
        self.cards.insert(tag, card);
        values
    }

    /// Forgets the values of cards that are not open.
    pub fn keep(&mut self, open: &HashSet<Uid>) {
        self.cards.retain(|tag, _| open.contains(tag));
    }
}
