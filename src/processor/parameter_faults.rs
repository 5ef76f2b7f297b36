//! Faults in the text of a command's parameters, all at once.
//!
//! The RON reader stops at the first fault. The field that holds it is blanked, which leaves all other places as they are,
//! and the rest is read again, until it can be read or the fault is in no field.

use std::ops::Range;

use super::{BuildProblem, Modules};
use crate::rig::{
    Field, SourceError, fields,
    reference::{RigNameIndex, bind_names},
};

/// Largest number of faulty fields of one command that are looked for.
const MOST: usize = 32;

/// Text of parameters with its faults.
pub(super) struct SurveyedParams {
    /// Faults in the order of the text.
    pub problems: Vec<BuildProblem>,
    /// The parameters with faulty fields blanked; `None` if they cannot be read without those either.
    pub rest: Option<String>,
}

/// Reads the parameters of a command of the rig with these names. References to labels that are not in the rig are told with the
/// nearest.
pub(super) fn survey_params(names: &RigNameIndex, modules: &Modules, module: &str, params: &str) -> SurveyedParams {
    let Some(info) = modules.get(module) else {
        return SurveyedParams { problems: modules.load(module, params).err().into_iter().collect(), rest: None };
    };
    let mut left: Vec<Field> = fields(params).into_iter().filter(|field| field.depth == 1).collect();
    let (mut found, mut rest) = (Vec::new(), params.to_owned());
    let mut is_readable = false;
    for _ in 0..MOST {
        let Err(error) = info.parse(&rest) else {
            is_readable = true;
            break;
        };
        let holder = left.iter().rposition(|field| field.start <= error.offset && error.offset < field.end);
        let Some(field) = holder.map(|at| left.remove(at)) else {
            // What blanked fields leave behind, such as a field that is needed, is no fault of its own.
            if found.is_empty() {
                found.push(error);
            }
            break;
        };
        blank(&mut rest, field.start..field.end);
        found.extend(faults_of_field(names, params, &field, error));
    }
    found.sort_by_key(|error| error.offset);
    let problems = found.into_iter().map(BuildProblem::Parameters).collect();
    SurveyedParams { problems, rest: is_readable.then_some(rest) }
}

/// The parameters without the field of that name; `None` if there is none.
pub(super) fn without_field(params: &str, name: &str) -> Option<String> {
    let field = fields(params).into_iter().find(|field| field.depth == 1 && field.name == name)?;
    let mut rest = params.to_owned();
    blank(&mut rest, field.start..field.end);
    Some(rest)
}

/// Name of the field that a parameter is in, of which errors tell a part: `names` of `names[2]`.
pub(super) fn field_of(parameter: &str) -> &str {
    parameter.split([',', ' ', '[', '.']).next().unwrap_or_default()
}

/// Faults of a field that cannot be read: its references to nothing, and the error of the reader unless it is about one
/// of those.
fn faults_of_field(names: &RigNameIndex, params: &str, field: &Field, error: SourceError) -> Vec<SourceError> {
    let bad = bind_names(&params[field.value..field.end], names).1;
    let places = bad.iter().map(|bad| bad.range.start + field.value..bad.range.end + field.value);
    let is_told = places.clone().any(|place| place.contains(&error.offset));
    let references = bad.iter().zip(places);
    let references = references.map(|(bad, place)| SourceError::at(params, place.start, bad.error.to_string()));
    let others = (!is_told).then(|| SourceError::at(params, error.offset, error.message));
    references.chain(others).collect()
}

/// Puts spaces in the place of a part of a text, whose lines stay.
fn blank(text: &mut String, range: Range<usize>) {
    let blanks: String = text[range.clone()].bytes().map(|byte| if byte == b'\n' { '\n' } else { ' ' }).collect();
    text.replace_range(range, &blanks);
}
