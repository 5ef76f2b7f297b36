//! Texts of templates for rigs that were edited, written as changes of the text that the rig was read from.

use std::{
    collections::{BTreeSet, HashSet},
    path::Path,
};

use super::PartFiles;
use crate::rig::{
    Rig, TagData, TagKind, Uid,
    nearest::listed,
    part::{DroppedPart, PartChange, PartInstance, without_dropped},
    template::{self, FileMarks, PartRigs, Template, UidStyle, write_template},
};

/// Makes a reader of parts.
pub(crate) type PartReader<'r, 'd> = &'r dyn Fn() -> PartFiles<'d>;

/// The text of a rig's template.
pub(crate) struct TemplateText {
    pub text: String,
    /// Loss of what the former text has, a sentence.
    pub note: Option<String>,
}

/// Parts that were dropped onto joints and are not in the template yet.
#[derive(Default)]
struct FreshParts {
    /// The instances, each with its part as it is fitted.
    parts: Vec<(PartInstance, Rig)>,
    /// True if there are others, whose file cannot be had or whose joints are not known by their labels.
    are_some_lost: bool,
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
    let Some((at, text)) = source else { return plain_text(rig, None, target, reader) };
    let (marks, text) = FileMarks::of(text);
    let written = plain_text(rig, Some((at, &text)), target, reader);
    TemplateText { text: marks.put_on(written.text), ..written }
}

/// [`template_text`] of a text without marks.
fn plain_text(rig: &Rig, source: Option<(&Path, &str)>, target: &Path, reader: PartReader) -> TemplateText {
    let (at, text) = source.map_or((target, None), |(at, text)| (at, Some(text)));
    let template = text.and_then(|text| template::read_template(text.as_bytes()).ok());
    let FreshParts { parts, are_some_lost } = dropped(rig, at, text.zip(template.as_ref()), reader);
    let has_parts = !parts.is_empty() || template.is_some_and(|template| !template.parts.is_empty());
    // Parts beside the one file may not be there beside the other.
    let is_right = |text: &str| !has_parts || at.parent() == target.parent() || says(reader, target, text, rig);
    let changed = changed(rig, at, text, &parts, reader).filter(|changed| is_right(&changed.text));
    let written = changed.unwrap_or_else(|| {
        let lost = if has_parts { PARTS_LOST } else { COMMENTS_LOST };
        TemplateText { text: written_anew(rig, text), note: (has_parts || text.is_some()).then(|| lost.to_owned()) }
    });
    if are_some_lost { TemplateText { note: Some(PARTS_LOST.to_owned()), ..written } } else { written }
}

/// The text of a rig's template that takes nothing but its form from the former text: one that people write is like that.
fn written_anew(rig: &Rig, former: Option<&str>) -> String {
    let Some(former) = former else { return new_template_text(rig) };
    let is_of_people = template::read_header(former.as_bytes()).is_ok_and(|header| header.format >= template::FORMAT);
    let short = if is_of_people { template::write_short_template(rig) } else { None };
    short.unwrap_or_else(|| write_template(rig))
}

/// Most joints and tags of a template whose text somebody reads. The short form takes several times as long to write.
const MOST_READ: usize = 2000;

/// The text of the template of a rig that had no file, as people go on to write it: tags of the short form and names where they
/// are enough, in the layout. A rig that such a text cannot say, and one with more than 2000 joints and tags, is written in full.
pub(crate) fn new_template_text(rig: &Rig) -> String {
    let size: usize = rig.walk().map(|joint| 1 + joint.data.tags.len()).sum();
    let short = if size <= MOST_READ { template::write_short_template(rig) } else { None };
    let Some(text) = short else { return write_template(rig) };
    // Names in the stead of uids may say something else where several things have one name.
    let mut laid_out = [UidStyle::Derived, UidStyle::Kept].into_iter();
    laid_out.find_map(|style| template::format_template(&text, style).ok()).unwrap_or(text)
}

/// True if a text at that path says what the rig is.
fn says(reader: PartReader, at: &Path, text: &str, rig: &Rig) -> bool {
    let Ok(read) = template::read_template(text.as_bytes()) else { return false };
    let own = read.rig.clone();
    let whole = reader().put_together(at, text, read);
    whole.is_ok_and(|template| template::says_the_same(&template.rig, rig, &own))
}

/// The parts that were dropped onto joints and are not in the template yet. `source` is the template with its text.
fn dropped(rig: &Rig, at: &Path, source: Option<(&str, &Template)>, reader: PartReader) -> FreshParts {
    let is_known = |part: &DroppedPart| {
        let Some((text, template)) = source else { return false };
        let known = template.parts.iter().find(|known| known.uid == part.uid);
        // Another part or side on the same joints follows to the same uid.
        known.is_some_and(|known| {
            (&known.part, known.mirror) == (&part.part, part.mirror) || says(reader, at, text, rig)
        })
    };
    // What the template has itself was written out by an earlier save.
    let is_fresh = |uid: Uid| rig.is_taken(uid) && source.is_none_or(|(_, template)| !template.rig.is_taken(uid));
    let mut files = reader();
    let mut fresh = FreshParts::default();
    for part in rig.dropped_parts().iter().filter(|part| !is_known(part)) {
        let labelled = part.instance(rig);
        let has_labels = labelled.is_some();
        // What a part brings does not depend on the labels.
        let instance = labelled.unwrap_or_else(|| part.instance_onto(vec![String::new(); part.joints.len()]));
        let Ok(fitted) = files.fitted_part(at, &instance) else {
            let joints = part.joints.iter().filter_map(|joint| rig.joint(*joint));
            fresh.are_some_lost |= joints.flat_map(|joint| &joint.data.tags).any(|tag| is_fresh(tag.uid));
            continue;
        };
        let brought = instance.brought(&fitted);
        if !has_labels {
            fresh.are_some_lost |= brought.iter().any(|uid| is_fresh(*uid));
        } else if brought.iter().any(|uid| rig.is_taken(*uid)) {
            fresh.parts.push((instance, fitted));
        }
    }
    fresh
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
        return over(rig, at, source?, reader);
    }
    // First what is the rig's own, then the parts, then what is different about them.
    let file = source.and_then(|text| reader().complete(at, text.as_bytes()).ok());
    let has_partners = file.as_ref().is_some_and(|file| !file.instances.is_empty());
    let own = without_dropped(rig, dropped, file.as_ref().map(|file| &file.rig), has_partners).ok()?;
    let base = source.and_then(|text| over(&own, at, text, reader));
    let base = base.unwrap_or_else(|| TemplateText {
        text: written_anew(&own, source),
        note: source.is_some().then(|| COMMENTS_LOST.to_owned()),
    });
    let instances: Vec<PartInstance> = dropped.iter().map(|(instance, _)| instance.clone()).collect();
    let text = template::with_instances(&base.text, &own, rig, &instances)?;
    let changed = over_parts(rig, at, &text, reader)?;
    Some(TemplateText { note: base.note.or(changed.note), ..changed })
}

/// The text, changed so that it says what the rig is.
fn over(rig: &Rig, at: &Path, text: &str, reader: PartReader) -> Option<TemplateText> {
    let has_parts = template::read_template(text.as_bytes()).is_ok_and(|template| !template.parts.is_empty());
    if has_parts {
        return over_parts(rig, at, text, reader);
    }
    Some(TemplateText { text: template::write_template_over(rig, text)?, note: None })
}

/// The text of a template with parts, changed so that it says what the rig is; `None` if it cannot be. Parts of which nothing is
/// left are taken out, and those of which something is different that no change says are written out.
fn over_parts(rig: &Rig, at: &Path, text: &str, reader: PartReader) -> Option<TemplateText> {
    if says(reader, at, text, rig) {
        return Some(TemplateText { text: text.to_owned(), note: None });
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
        && let Some(changed) = over(rig, at, &rest, reader)
    {
        let are_lost = gone.iter().any(|number| has_remains(&read, &changed.text, &parts[*number]));
        return Some(TemplateText {
            note: if are_lost { Some(PARTS_LOST.to_owned()) } else { changed.note },
            ..changed
        });
    }
    let before = ReadText::put_together(at, text, read, parts, reader)?;
    let mut written_out = BTreeSet::new();
    loop {
        let said = match before.changed(rig, text, &written_out, at, reader) {
            Ok(text) => {
                let titles: Vec<&str> = written_out.iter().map(|number| before.parts[*number].0.title()).collect();
                return Some(TemplateText { text, note: (!titles.is_empty()).then(|| written_out_note(&titles)) });
            }
            Err(said) => said,
        };
        // What cannot be said of a part is said without the part.
        let known = written_out.len();
        let said = said.as_ref().unwrap_or(&before.whole);
        written_out.extend(template::differing_parts(said, rig, &before.own, &before.parts));
        if written_out.len() == known {
            return None;
        }
    }
}

/// Note about parts of a template that are parts no more.
fn written_out_note(titles: &[&str]) -> String {
    let (parts, were) = if titles.len() == 1 { ("part", "was") } else { ("parts", "were") };
    format!(
        "the {parts} {} {were} written out: no change of a part says what the rig is now; the others are parts as before",
        listed(titles, "and")
    )
}

/// A text of a template with parts, as it was read.
struct ReadText {
    /// Joints and tags that the template has itself.
    own: Rig,
    /// The template with its parts.
    whole: Rig,
    /// The template with its parts, without the changes of these, other labels excepted.
    plain: Rig,
    /// Every instance with its part, as it is fitted.
    parts: Vec<(PartInstance, Rig)>,
}

impl ReadText {
    fn of(at: &Path, text: &str, reader: PartReader) -> Option<Self> {
        let read = template::read_template(text.as_bytes()).ok()?;
        let parts = reader().fitted(at, &read).ok()?;
        Self::put_together(at, text, read, parts, reader)
    }

    fn put_together(
        at: &Path,
        text: &str,
        read: Template,
        parts: Vec<(PartInstance, Rig)>,
        reader: PartReader,
    ) -> Option<Self> {
        let own = read.rig.clone();
        let mut without_changes = read.clone();
        for part in &mut without_changes.parts {
            // Other parts may go onto joints by the labels that changes give.
            for change in &mut part.changes {
                let (joint, label) = (change.joint.clone(), change.label.clone());
                *change = PartChange { joint, label, ..PartChange::default() };
            }
            part.changes.retain(|change| change.label.is_some());
        }
        let mut files = reader();
        let whole = files.put_together(at, text, read).ok()?.rig;
        let plain = files.put_together(at, text, without_changes).ok()?.rig;
        Some(Self { own, whole, plain, parts })
    }

    fn says(&self, rig: &Rig) -> bool {
        template::says_the_same(&self.whole, rig, &self.own)
    }

    /// The text, changed so that it says what the rig is, without the parts that have these numbers. Otherwise the rig that a changed
    /// text says, if one could be read.
    fn changed(
        &self,
        rig: &Rig,
        text: &str,
        written_out: &BTreeSet<usize>,
        at: &Path,
        reader: PartReader,
    ) -> Result<String, Option<Rig>> {
        let mut said = None;
        // The order of a text stays if it can.
        for in_order in [false, true] {
            // What parts bring follows from what the template has itself. Only what is different then is a change of a part.
            let own = template::write_own_over(rig, &self.rigs(), text, written_out, in_order);
            let own = own.and_then(|text| Some((Self::of(at, &text, reader)?, text)));
            let Some((read, own)) = own else { continue };
            if read.says(rig) {
                return Ok(own);
            }
            // Names are what people write; uids say it where a name means something else.
            for with_names in [true, false] {
                let changed = template::write_changes_over(rig, &read.rigs(), &own, with_names);
                let Some(changed) = changed else { continue };
                let Some(read) = Self::of(at, &changed, reader) else { continue };
                if read.says(rig) {
                    return Ok(changed);
                }
                said = said.or(Some(read.whole));
            }
            said = said.or(Some(read.whole));
        }
        Err(said)
    }

    fn rigs(&self) -> PartRigs<'_> {
        PartRigs { own: &self.own, before: &self.whole, plain: &self.plain, parts: &self.parts }
    }
}

/// True if a text from which a part was taken out has, as its own, tags that may be those of the part from a time when its
/// file was another: tags that the template `before` lacks, on the joints of the part, or like its own on new joints and in
/// changes of other parts.
fn has_remains(before: &Template, text: &str, (instance, part): &(PartInstance, Rig)) -> bool {
    let Ok(after) = template::read_template(text.as_bytes()) else { return false };
    let module = |tag: &TagData| match &tag.kind {
        TagKind::Command { module, .. } => Some(module.clone()),
        TagKind::Feature { .. } => None,
    };
    let modules: HashSet<_> = part.walk().flat_map(|joint| &joint.data.tags).filter_map(module).collect();
    let is_like = |tag: &TagData| module(tag).is_some_and(|module| modules.contains(&module));
    let onto: HashSet<Uid> = instance.onto.iter().filter_map(|label| before.rig.labelled(label)).collect();
    let has_own = instance.onto.is_empty() || instance.adds;
    let is_own = after.rig.walk().any(|joint| {
        let is_new = has_own && before.rig.joint(joint.data.uid).is_none();
        let mut fresh = joint.data.tags.iter().filter(|tag| !before.rig.is_taken(tag.uid));
        fresh.any(|tag| onto.contains(&joint.data.uid) || is_new && is_like(tag))
    });
    let changes = before.parts.iter().flat_map(|part| &part.changes);
    let known: HashSet<Uid> = changes.flat_map(|change| &change.tags).map(|tag| tag.uid).collect();
    let mut changes = after.parts.iter().flat_map(|part| &part.changes).flat_map(|change| &change.tags);
    is_own || changes.any(|tag| !known.contains(&tag.uid) && is_like(tag))
}
