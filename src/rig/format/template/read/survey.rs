//! Survey of a template with faults: the structure is read again without what is at fault, until the rest can be read.

use std::{borrow::Cow, collections::HashMap, ops::Range};

use super::{
    super::{
        Template,
        file::{TemplateFile, known_names},
        shorthand::{ExplicitText, explicit},
    },
    Places, TEMPLATE, build, in_text, text_of,
};
use crate::rig::{
    SourceError,
    format::{
        commas::with_missing_commas,
        scan::{self, Field, elements_around, list_elements},
        source::{TextLines, ron_options, unknown_name},
    },
    template::quoted,
};

/// Largest number of bytes that are parsed again for the sake of further faults.
const REPARSED: usize = 64 << 20;

/// Reads a template as far as it goes, to tell all that is wrong with it: with every fault of its structure, in the
/// order of the text, and without what is at fault (a joint without its group, say).
///
/// # Errors
/// A text that cannot be read as a template at all, with the faults that were found before that.
pub fn survey_template(bytes: &[u8]) -> Result<(Template, Vec<SourceError>), Vec<SourceError>> {
    let source = text_of(bytes).map_err(|error| vec![error])?;
    if let Some(fault) = SourceError::of_brackets(source) {
        return Err(vec![fault]);
    }
    let first = survey(source);
    if matches!(&first, Ok((_, faults)) if faults.is_empty()) {
        return first;
    }
    let (whole, lacking) = with_missing_commas(source);
    if lacking.is_empty() {
        return first;
    }
    let all = |mut faults: Vec<SourceError>| {
        faults.extend(lacking);
        faults.sort_by_key(|fault| fault.offset);
        faults
    };
    match survey(&whole) {
        Ok((template, faults)) => Ok((template, all(faults))),
        Err(faults) => Err(all(faults)),
    }
}

/// Reads a text as far as it goes, see [`survey_template`].
fn survey(source: &str) -> Result<(Template, Vec<SourceError>), Vec<SourceError>> {
    let explicit = explicit(source);
    let (text, mut notes, mut faults) = (&*explicit.text, Vec::new(), Vec::new());
    let fields = scan::fields(text);
    let readable =
        TEMPLATE.readable(text, &fields, 1, &mut notes).map_err(|error| in_source(&explicit, vec![error]))?;
    // In a file of a newer format they are notes.
    let unknown = if matches!(readable, Cow::Borrowed(_)) { TEMPLATE.unknown(&fields) } else { Vec::new() };
    if !unknown.is_empty() {
        let lines = TextLines::new(text);
        faults.extend(unknown.iter().map(|field| {
            let known = known_names(&fields, field).unwrap_or_default();
            lines.error(field.start, unknown_name("field", field.name, known))
        }));
    }
    let mut survey = Survey { text, fields: &fields, blank: Vec::new(), left_out: Vec::new(), stand_ins: Vec::new() };
    survey.blank.extend(unknown.iter().map(|field| field.start..field.end));
    let Some(file) = survey.read(&readable, &mut faults) else { return Err(in_source(&explicit, faults)) };
    let places = Places::new(text, &fields, &survey.left_out);
    // The first fault scans the fields again.
    drop(survey);
    drop(unknown);
    drop(fields);
    let template = build(&places, file, notes, &mut faults);
    Ok((in_text(&explicit, template), in_source(&explicit, faults)))
}

/// All faults of a text, those of its shorthand too, in the order of the source.
fn in_source(explicit: &ExplicitText, faults: Vec<SourceError>) -> Vec<SourceError> {
    let mut all = explicit.faults_in_source(faults);
    all.sort_by_key(|fault| fault.offset);
    let element_ends: HashMap<usize, usize> = match all.is_empty() || explicit.faults.is_empty() {
        true => HashMap::new(),
        false => list_elements(explicit.source()).into_iter().map(|element| (element.start, element.end)).collect(),
    };
    // An element that cannot be read says nothing of its names.
    let is_unreadable = |fault: &SourceError| {
        let first = all.partition_point(|other| other.offset < fault.offset);
        let end = element_ends.get(&fault.offset);
        end.is_some_and(|end| all.get(first).is_some_and(|other| other.offset < *end))
    };
    let of_shorthand: Vec<SourceError> =
        explicit.faults.iter().filter(|fault| !is_unreadable(fault)).cloned().collect();
    all.extend(of_shorthand);
    all.sort_by_key(|fault| fault.offset);
    all
}

/// The parts of an explicit text that are not read.
struct Survey<'a> {
    text: &'a str,
    fields: &'a [Field<'a>],
    /// Ranges with blanks in their place.
    blank: Vec<Range<usize>>,
    /// Elements of lists among them that nothing stands for.
    left_out: Vec<Range<usize>>,
    /// Texts in place of joints that are at fault, no longer than these.
    stand_ins: Vec<(Range<usize>, String)>,
}

impl Survey<'_> {
    /// The file without what is at fault, which is told; `None` where too much is.
    fn read(&mut self, readable: &str, faults: &mut Vec<SourceError>) -> Option<TemplateFile> {
        for _ in 0..=(REPARSED / self.text.len().max(1)).clamp(1, 200) {
            let patched = self.patched(readable);
            let error = match ron_options().from_str(&patched) {
                Ok(file) => return Some(file),
                Err(error) => error,
            };
            // Offsets in bytes are the same in both texts, columns are not.
            let fault = SourceError::from_ron(&patched, &error);
            let at = fault.offset;
            let lacking = match &error.code {
                ron::Error::MissingStructField { field, .. } => Some(&**field),
                _ => None,
            };
            // The lack of a field that was left out is no fault of its own.
            let left = self.fields.iter().rfind(|field| {
                Some(field.name) == lacking
                    && field.start < at
                    && self.blank.iter().any(|range| range.start == field.start)
            });
            let found = match left {
                Some(field) => self.leave_out_element(field.start),
                None => {
                    faults.push(SourceError::at(self.text, at, fault.message));
                    let is_field = lacking.is_none() && self.leave_out_field(at);
                    is_field || self.leave_out_element(at)
                }
            };
            if !found {
                return None;
            }
        }
        None
    }

    /// Leaves out the innermost field around a place, unless an element of a list within it holds the place.
    fn leave_out_field(&mut self, at: usize) -> bool {
        let around = self.fields.iter().filter(|field| field.value <= at && at < field.end);
        let Some(field) = around.max_by_key(|field| field.start).map(|field| field.start..field.end) else {
            return false;
        };
        let inner = elements_around(self.text, at).into_iter().next();
        if inner.is_some_and(|element| field.start < element.start) || self.is_blank(&field) {
            return false;
        }
        self.blank.push(field);
        true
    }

    /// Leaves out the innermost element of a list around a place. A joint that says who it is keeps that.
    fn leave_out_element(&mut self, at: usize) -> bool {
        let is_tried =
            |element: &Range<usize>| self.is_blank(element) || self.stand_ins.iter().any(|(range, _)| range == element);
        let mut around = elements_around(self.text, at).into_iter();
        let Some(element) = around.find(|element| !self.is_blank(element)) else { return false };
        if !is_tried(&element)
            && let Some(stand_in) = self.stand_in(&element)
        {
            self.stand_ins.push((element, stand_in));
            return true;
        }
        // A comma that is left behind would be one too many.
        let rest = &self.text[element.end..];
        let comma = rest.find(',').filter(|at| rest[..*at].trim().is_empty());
        self.left_out.push(element.clone());
        self.blank.push(element.start..element.end + comma.map_or(0, |at| at + 1));
        true
    }

    fn is_blank(&self, range: &Range<usize>) -> bool {
        self.blank.iter().any(|blank| blank.start <= range.start && range.end <= blank.end)
    }

    /// Text of a joint with its uid, its label and its parent alone, if it has these and the text is no longer than the joint.
    fn stand_in(&self, element: &Range<usize>) -> Option<String> {
        let list = self.fields.iter().filter(|field| field.value <= element.start && element.end <= field.end);
        let list = list.max_by_key(|field| field.start)?;
        if list.name != "joints" || list.depth != 1 {
            return None;
        }
        let own = |name: &str| {
            let is_own = |field: &&Field| element.contains(&field.start) && field.depth == 3 && field.name == name;
            let field = self.fields.iter().find(is_own)?;
            let mut quotes = self.text[field.value..field.end].split('"');
            quotes.next()?.trim().is_empty().then_some(())?;
            let text = quotes.next()?;
            (!text.contains('\\')).then_some(text)
        };
        let mut text = format!("(uid: {}", quoted(own("uid")?));
        for name in ["label", "parent"] {
            text.extend(own(name).map(|value| format!(", {name}: {}", quoted(value))));
        }
        text.push(')');
        (text.len() <= element.len()).then_some(text)
    }

    /// The text with blanks and stand-ins, in which all that is left has its place.
    fn patched(&self, readable: &str) -> String {
        let mut bytes = readable.as_bytes().to_vec();
        let clear = |bytes: &mut [u8]| bytes.iter_mut().filter(|byte| **byte != b'\n').for_each(|byte| *byte = b' ');
        self.blank.iter().for_each(|range| clear(&mut bytes[range.clone()]));
        for (range, text) in &self.stand_ins {
            if !self.is_blank(range) {
                clear(&mut bytes[range.clone()]);
                bytes[range.start..range.start + text.len()].copy_from_slice(text.as_bytes());
            }
        }
        String::from_utf8_lossy(&bytes).into_owned()
    }
}
