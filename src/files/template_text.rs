//! Texts of templates that say what a rig is, as changes of the text that it was read from.

use std::path::Path;

use super::PartFiles;
use crate::rig::{
    Rig,
    part::{PartChange, PartInstance, without_dropped},
    template::{self, PartRigs, Template, write_template},
};

/// Makes a reader of parts.
pub(crate) type PartReader<'r, 'd> = &'r dyn Fn() -> PartFiles<'d>;

/// The text of a rig's template.
pub(crate) struct TemplateText {
    pub text: String,
    /// Loss of what the former text has, a sentence.
    pub note: Option<&'static str>,
}

const PARTS_LOST: &str =
    "the parts of the template were written out: its text could not be changed to say what the rig is now";
const COMMENTS_LOST: &str =
    "the file was written anew: its text could not be changed to say what the rig is now, and its comments are gone";

/// The text of a rig's template for a file at `target`. `source` is the file of the same rig whose text is changed, with that
/// text; without one the text is written anew.
pub(crate) fn template_text(
    rig: &Rig,
    source: Option<(&Path, &str)>,
    target: &Path,
    reader: PartReader,
) -> TemplateText {
    let (at, text) = source.map_or((target, None), |(at, text)| (at, Some(text)));
    let template = text.and_then(|text| template::read_template(text.as_bytes()).ok());
    let dropped = dropped(rig, at, template.as_ref(), reader);
    let has_parts = !dropped.is_empty() || template.is_some_and(|template| !template.parts.is_empty());
    // Parts beside the one file may not be there beside the other.
    let is_right = |text: &str| !has_parts || at.parent() == target.parent() || says(reader, target, text, rig);
    match changed(rig, at, text, &dropped, reader).filter(|changed| is_right(&changed.text)) {
        Some(changed) => changed,
        None => {
            let lost = if has_parts { PARTS_LOST } else { COMMENTS_LOST };
            TemplateText { text: write_template(rig), note: (has_parts || text.is_some()).then_some(lost) }
        }
    }
}

/// True if a text at that path says what the rig is.
fn says(reader: PartReader, at: &Path, text: &str, rig: &Rig) -> bool {
    reader().complete(at, text.as_bytes()).is_ok_and(|template| template::says_the_same(&template.rig, rig))
}

/// The parts that were dropped onto joints and are not in the template yet, each as it is fitted.
fn dropped(rig: &Rig, at: &Path, template: Option<&Template>, reader: PartReader) -> Vec<(PartInstance, Rig)> {
    let is_known = |instance: &PartInstance| {
        template.is_some_and(|template| template.parts.iter().any(|known| known.uid == instance.uid))
    };
    let mut files = reader();
    let instances = rig.dropped_parts().iter().filter_map(|part| part.instance(rig));
    let fitted = instances.filter(|instance| !is_known(instance)).filter_map(|instance| {
        let part = files.fitted_part(at, &instance).ok()?;
        Some((instance, part))
    });
    fitted.filter(|(instance, part)| instance.brought(part).iter().any(|uid| rig.is_taken(*uid))).collect()
}

/// The text that says what the rig is; `None` without a text that could be changed so.
fn changed(
    rig: &Rig,
    at: &Path,
    source: Option<&str>,
    dropped: &[(PartInstance, Rig)],
    reader: PartReader,
) -> Option<TemplateText> {
    if dropped.is_empty() {
        return over(rig, at, source?, reader).map(|text| TemplateText { text, note: None });
    }
    // First what is the rig's own, then the parts, then what is different about them.
    let file = source.and_then(|text| reader().complete(at, text.as_bytes()).ok());
    let has_partners = file.as_ref().is_some_and(|file| !file.instances.is_empty());
    let own = without_dropped(rig, dropped, file.as_ref().map(|file| &file.rig), has_partners).ok()?;
    let base = source.and_then(|text| over(&own, at, text, reader));
    let note = (source.is_some() && base.is_none()).then_some(COMMENTS_LOST);
    let base = base.unwrap_or_else(|| write_template(&own));
    let instances: Vec<PartInstance> = dropped.iter().map(|(instance, _)| instance.clone()).collect();
    let text = template::with_instances(&base, &own, rig, &instances)?;
    over_parts(rig, at, &text, reader).map(|text| TemplateText { text, note })
}

/// The text, changed so that it says what the rig is.
fn over(rig: &Rig, at: &Path, text: &str, reader: PartReader) -> Option<String> {
    let has_parts = template::read_template(text.as_bytes()).is_ok_and(|template| !template.parts.is_empty());
    if has_parts { over_parts(rig, at, text, reader) } else { template::write_template_over(rig, text) }
}

/// The text of a template with parts, changed so that it says what the rig is; `None` if something of the parts is different
/// in it. Parts of which nothing is left are taken out.
fn over_parts(rig: &Rig, at: &Path, text: &str, reader: PartReader) -> Option<String> {
    if says(reader, at, text, rig) {
        return Some(text.to_owned());
    }
    let read = template::read_template(text.as_bytes()).ok()?;
    let parts = reader().fitted(at, &read).ok()?;
    let is_gone = |(instance, part): &(PartInstance, Rig)| {
        let brought = instance.brought(part);
        !brought.is_empty() && !brought.iter().any(|uid| rig.is_taken(*uid))
    };
    let gone: Vec<usize> = (0..parts.len()).filter(|number| is_gone(&parts[*number])).collect();
    if !gone.is_empty()
        && let Some(rest) = template::without_instances(text, rig, &gone)
        && let Some(text) = over(rig, at, &rest, reader)
    {
        return Some(text);
    }
    let own = read.rig.clone();
    let mut without_changes = read.clone();
    for part in &mut without_changes.parts {
        // Other parts may go onto joints by the labels that changes give.
        for change in &mut part.changes {
            *change = PartChange { joint: change.joint.clone(), label: change.label.clone(), ..PartChange::default() };
        }
        part.changes.retain(|change| change.label.is_some());
    }
    let mut files = reader();
    let before = files.put_together(at, text, read).ok()?.rig;
    let plain = files.put_together(at, text, without_changes).ok()?.rig;
    let rigs = PartRigs { own: &own, before: &before, plain: &plain, parts: &parts };
    // Names are what people write; uids say it where a name means something else.
    let texts = [true, false].into_iter().filter_map(|names| template::write_parts_over(rig, &rigs, text, names));
    texts.into_iter().find(|text| says(reader, at, text, rig))
}
