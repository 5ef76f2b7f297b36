//! Changes of values: parameters of all commands of a card with another value.

use super::{parameter_text::ValueError, stack::Entry};
use crate::{
    processor::ModuleInfo,
    rig::{Uid, ron_text},
};

/// Change of a value.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum ValueEdit {
    /// Other parameters of tags.
    Set(Vec<(Uid, String)>),
    /// Preview of parameters while a number is dragged.
    Preview(Vec<(Uid, String)>),
    /// End of a drag.
    Commit,
    /// End of a drag that discards the value.
    Cancel,
    /// Nodes that are to be picked for the parameter of that path.
    Pick(String),
    /// A value that the module does not take, with the reason.
    Refused(ValueError),
}

/// Parameters of the commands of an entry with the first of some texts that the module takes as the value of a parameter.
pub(super) fn changed(
    module: &ModuleInfo,
    entry: &Entry,
    path: &str,
    texts: &[String],
) -> Result<Vec<(Uid, String)>, ValueError> {
    let mut refused = ValueError::Missing;
    'texts: for text in texts {
        let mut changed = Vec::new();
        for ((_, tag), params) in entry.tags.iter().zip(&entry.params) {
            match module.with_value(params, path, text) {
                Ok(params) => changed.push((*tag, params)),
                Err(error) => {
                    refused = ValueError::Value { path: path.to_owned(), value: text.clone(), source: error };
                    continue 'texts;
                }
            }
        }
        return Ok(changed);
    }
    Err(refused)
}

/// Change of a parameter of an entry to a text.
pub(super) fn with_text(module: &ModuleInfo, entry: &Entry, path: &str, text: &str) -> ValueEdit {
    changed(module, entry, path, &[ron_text(text)]).map_or_else(ValueEdit::Refused, ValueEdit::Set)
}
