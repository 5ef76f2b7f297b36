//! Texts of parameters: values of known types read from RON, numbers that people type, and errors of both.

use serde::de::DeserializeOwned;

use crate::rig::{SourceError, parse_ron};

/// Reason why a value that a person gives is not taken.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(super) enum ValueError {
    /// No value at all.
    #[error("there is no value")]
    Missing,
    /// A text that is no number.
    #[error("\"{0}\" is no number")]
    NotANumber(String),
    /// A value that the module does not take.
    #[error("`{path}` cannot be {value}: {}", source.message)]
    Value {
        /// Path of the parameter.
        path: String,
        /// The value as RON.
        value: String,
        /// Error of the module's reader.
        source: SourceError,
    },
    /// Parameters that the module does not take.
    #[error("{}", .0.message)]
    Parameters(#[from] SourceError),
}

/// The value of a text; `None` for one of another type, and for an optional value that is left out.
pub(super) fn read<T: DeserializeOwned>(text: &str) -> Option<T> {
    parse_ron::<Option<T>>(text).ok().flatten()
}

/// A value without quotation marks.
pub(super) fn plain(value: &str) -> String {
    ron::from_str::<String>(value).unwrap_or_else(|_| value.to_owned())
}

/// The number that a person typed, with a point or a comma.
pub(super) fn typed_number(text: &str) -> Result<f32, ValueError> {
    let text = text.trim();
    text.replace(',', ".").parse().map_err(|_| ValueError::NotANumber(text.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn optional_values_are_read_with_and_without_some() {
        for text in ["(1.0, 2.5, -3.0)", "Some((1.0, 2.5, -3.0))"] {
            assert_eq!(read::<[f32; 3]>(text), Some([1.0, 2.5, -3.0]), "{text}");
        }
        assert_eq!(read::<[f32; 3]>("None"), None);
        assert_eq!(read::<[f32; 3]>("(1.0, 2.5)"), None);
        let limits = read::<[(Option<f32>, Option<f32>); 3]>("((None, 1.0), (None, None), (-2.0, Some(3.0)))");
        assert_eq!(limits, Some([(None, Some(1.0)), (None, None), (Some(-2.0), Some(3.0))]));
    }
}
