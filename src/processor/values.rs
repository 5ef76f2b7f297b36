//! Values of a command's parameters, one at a time: for forms, which change one and leave the rest as it is written.

use super::{
    ModuleInfo, RigModule,
    mirror::{place_of, with_changes, write_whole},
};
use crate::rig::{SourceError, fields, ron_text, with_field};

/// Values of all parameters of a command, defaults of omitted parameters included.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterValues {
    complete: String,
    default: String,
}

impl ParameterValues {
    /// The value of a parameter, or of a part of one (`creation.label`, `inputs[0].name`), as RON; `None` if the path names
    /// none, or lies in an optional value that is left out.
    pub fn get(&self, path: &str) -> Option<&str> {
        place_of(&self.complete, path).map(|place| &self.complete[place])
    }

    /// True if the value is the module's default, which holds for tags that leave the parameter out.
    pub fn is_default(&self, path: &str) -> bool {
        self.get(path) == place_of(&self.default, path).map(|place| &self.default[place])
    }
}

/// Parameters of a module as RON, without those that have their default value.
pub fn differing_params<M: RigModule>(module: &M) -> String {
    let (own, default) = (ron_text(module), ron_text(&M::default()));
    let mut params = "()".to_owned();
    // Each comes before those that are there already.
    for field in fields(&own).into_iter().rev().filter(|field| field.depth == 1) {
        let value = |text| place_of(text, field.name).map(|place| &text[place]);
        if let Some(value) = value(&own).filter(|own| value(&default) != Some(own)) {
            params = with_field(&params, field.name, value);
        }
    }
    params
}

impl ModuleInfo {
    /// The values of a tag's parameters.
    ///
    /// # Errors
    /// [`SourceError`] with line and column in the text.
    pub fn values(&self, params: &str) -> Result<ParameterValues, SourceError> {
        Ok(ParameterValues { complete: (self.complete)(params)?, default: (self.complete)("()")? })
    }

    /// The parameters as they are written, with another value of one, or of a part of one (`creation.label`,
    /// `inputs[0].name`). `value` is RON.
    ///
    /// # Errors
    /// A path that names nothing, or a value that the module does not take.
    pub fn with_value(&self, params: &str, path: &str, value: &str) -> Result<String, SourceError> {
        let before = (self.complete)(params)?;
        let place = place_of(&before, path)
            .ok_or_else(|| SourceError::at(params, 0, format!("the module {} has no parameter `{path}`", self.name)))?;
        let mut after = before.clone();
        after.replace_range(place, value);
        let after = (self.complete)(&after)?;
        let mut text = with_changes(params, &before, &after);
        if !(self.complete)(&text).is_ok_and(|written| written == after) {
            // Lists become shorter, values with names become others: all of the parameter is written.
            write_whole(&mut text, &after, path.split(['.', '[']).next().unwrap_or(path));
        }
        self.parse(&text)?;
        Ok(text)
    }

    /// Parameters as they are written, with the value at `path` put back to the module's default. A path that names a whole
    /// parameter takes the parameter out of the text.
    ///
    /// # Errors
    /// A path that names nothing.
    pub fn with_default(&self, params: &str, path: &str) -> Result<String, SourceError> {
        let found = fields(params).into_iter().find(|field| field.depth == 1 && field.name == path);
        if let Some(field) = found {
            let mut text = params.to_owned();
            let rest = text[field.end..].trim_start().len();
            text.replace_range(field.start..text.len() - rest, "");
            self.parse(&text)?;
            return Ok(text);
        }
        let default = (self.complete)("()")?;
        match place_of(&default, path) {
            Some(place) => self.with_value(params, path, &default[place]),
            None => self.with_value(params, path, ""),
        }
    }
}
