//! Options: values that a part lets its uses set, each with a form for people.

use serde::{Deserialize, Serialize};

use super::PartError;

/// A value that a part lets its uses set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PartOption {
    /// Name, by which an instance sets it.
    pub name: String,
    /// The value that the part has without it, as RON.
    pub default: String,
    /// Description for people.
    pub description: String,
    /// Form of the value; any value without one.
    pub form: Option<OptionForm>,
    /// Parameters that it sets: the tag, called as in a change of an instance, and the parameter.
    pub sets: Vec<(String, String)>,
}

/// Form of the value of an option. The words are those of the forms of modules.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum OptionForm {
    /// A number of a range.
    Slider {
        /// Smallest value.
        min: f32,
        /// Largest value.
        max: f32,
        /// Step of the slider; any value is taken.
        #[serde(default)]
        step: Option<f32>,
    },
    /// Any finite number.
    Number,
    /// Either `true` or `false`.
    Check,
    /// One of several texts.
    Menu {
        /// The texts.
        options: Vec<String>,
    },
    /// Any text.
    Text,
}

/// Error of an option that an instance sets.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OptionError {
    /// The part has no such option.
    #[error("the part has no option \"{name}\"{nearest}")]
    Unknown {
        /// The name.
        name: String,
        /// End of the sentence with similar names.
        nearest: String,
    },
    /// The form does not take the value.
    #[error("option \"{name}\" takes {wanted}, not {value}")]
    Value {
        /// Name of the option.
        name: String,
        /// Values that the form takes, in words.
        wanted: String,
        /// The value, as RON.
        value: String,
    },
    /// A parameter that the option sets is not there.
    #[error("option \"{name}\" of the part sets nothing: {reason}; correct the part's file")]
    Target {
        /// Name of the option.
        name: String,
        /// The reason.
        reason: Box<PartError>,
    },
}

impl PartOption {
    /// Checks a value against the form.
    ///
    /// # Errors
    /// A value that the form does not take.
    pub fn check(&self, value: &str) -> Result<(), OptionError> {
        let (is_right, wanted) = match &self.form {
            None => (true, String::new()),
            Some(OptionForm::Slider { min, max, .. }) => {
                let number = ron::from_str::<f32>(value);
                (number.is_ok_and(|number| (*min..=*max).contains(&number)), format!("a number from {min} to {max}"))
            }
            Some(OptionForm::Number) => (ron::from_str::<f32>(value).is_ok_and(f32::is_finite), "a number".to_owned()),
            Some(OptionForm::Check) => (ron::from_str::<bool>(value).is_ok(), "true or false".to_owned()),
            Some(OptionForm::Text) => (ron::from_str::<String>(value).is_ok(), "a text in quotes".to_owned()),
            Some(OptionForm::Menu { options }) => (
                ron::from_str::<String>(value).is_ok_and(|text| options.contains(&text)),
                format!("one of {}", options.iter().map(|text| format!("\"{text}\"")).collect::<Vec<_>>().join(", ")),
            ),
        };
        let (name, value) = (self.name.clone(), value.to_owned());
        if is_right { Ok(()) } else { Err(OptionError::Value { name, wanted, value }) }
    }
}
