//! Places of part instances and of their changes in a template's text.

use std::collections::HashMap;

use crate::rig::format::scan::fields;

/// Places in a template's text of its part instances and of their changes.
pub(super) struct InstancePlaces {
    /// Bracket of the field at a place.
    brackets: HashMap<usize, usize>,
    /// The field `changes` in a bracket.
    lists: HashMap<usize, usize>,
    /// Starts of the changes in a field, each with its bracket.
    subjects: HashMap<usize, Vec<(usize, usize)>>,
    /// Start of the parameters in a bracket.
    params: HashMap<usize, usize>,
}

impl InstancePlaces {
    /// Places in a text.
    pub fn new(source: &str) -> Self {
        let (mut brackets, mut lists, mut params) = (HashMap::new(), HashMap::new(), HashMap::new());
        let mut subjects: HashMap<usize, Vec<(usize, usize)>> = HashMap::new();
        for (number, field) in fields(source).iter().enumerate() {
            brackets.entry(field.start).or_insert(field.bracket);
            match (field.name, field.parent) {
                ("changes", _) => {
                    lists.entry(field.bracket).or_insert(number);
                }
                ("params", _) => {
                    params.entry(field.bracket).or_insert(field.start);
                }
                ("tag" | "joint", Some(list)) => subjects.entry(list).or_default().push((field.start, field.bracket)),
                _ => {}
            }
        }
        for of_list in subjects.values_mut() {
            of_list.dedup_by_key(|(_, bracket)| *bracket);
        }
        Self { brackets, lists, subjects, params }
    }

    /// Places of the changes of the instance at a place, each with its parameters if it has any.
    pub fn changes(&self, instance: usize) -> Vec<(usize, Option<usize>)> {
        let list = self.brackets.get(&instance).and_then(|bracket| self.lists.get(bracket));
        let subjects = list.and_then(|list| self.subjects.get(list)).into_iter().flatten();
        subjects.map(|(start, bracket)| (*start, self.params.get(bracket).copied())).collect()
    }
}
