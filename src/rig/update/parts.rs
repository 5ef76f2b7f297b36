//! Part instances in an update: where parts go and what they set there, compared field by field.
//!
//! What comes of a part follows from the fields of its instance. So these are compared first, and then the three versions as they
//! are with the fields that the instances have after the update: what is different between them then is no result of the fields.

use std::{
    collections::{BTreeMap, BTreeSet, HashMap, HashSet},
    sync::Arc,
};

use super::{
    Change, ChangeKind, Choices, Take,
    fields::{Field, field, joint_title},
    shown_values::{NamesOfBoth, shown_values},
};
use crate::rig::{
    Rig, TagData, TagKind, Uid,
    format::{
        template::{Template, quaternion, quoted, vector},
        tree::{Tree, with_field},
    },
    part::{PartChange, PartInstance, PartTargets},
};

/// Fields that say where a part is. A part is in one place, so that these are decided together.
const PLACE: [&str; 4] = ["onto", "adds", "parent", "socket"];

/// Name of the field with the name of an instance.
const NAME: &str = "name";

/// A version of a template, with what its parts bring.
#[derive(Debug, Clone)]
pub struct TemplateWithParts {
    /// The template before its parts are in the rig.
    pub template: Template,
    /// The rig with its parts.
    pub rig: Rig,
    /// Every part instance with its part, [fitted](PartInstance::fitted).
    pub fitted: Vec<(PartInstance, Rig)>,
}

/// Part instances of a rig after an update.
#[derive(Debug, Clone, Default)]
pub struct MergedParts {
    /// Instances that all versions have, with the fields that they have then. Joints are named by their uids.
    pub instances: Vec<PartInstance>,
    /// Changes of fields.
    pub changes: Vec<FieldChange>,
    /// True if a field differs between two versions.
    pub differs: bool,
}

/// Change of a field of a part instance.
#[derive(Debug, Clone)]
pub struct FieldChange {
    /// The change as it is listed.
    pub change: Change,
    /// True for the name of the instance.
    pub is_name: bool,
}

/// A version of a template whose part instances have other fields.
#[derive(Debug, Clone)]
pub struct RefittedTemplate {
    /// The template before its parts are in the rig.
    pub template: Template,
    /// The part of each instance, fitted.
    pub fitted: Vec<Rig>,
    /// Changes of instances that are gone with what they changed.
    pub lost: Vec<Change>,
}

/// Compares the fields of the part instances that a rig has `now` with those in the `file`, and with those in the base.
pub fn merge_parts(
    base: Option<&TemplateWithParts>,
    now: &TemplateWithParts,
    file: &TemplateWithParts,
    choices: &Choices,
) -> MergedParts {
    let mut merged = MergedParts::default();
    let names = NamesOfBoth::new(&now.rig, &file.rig);
    let (in_file, in_base) = (file.instances(), base.map(TemplateWithParts::instances).unwrap_or_default());
    for instance in &now.template.parts {
        let Some(theirs) = in_file.get(&instance.uid).map(|instance| by_uids(instance, &file.rig)) else { continue };
        let was = base.zip(in_base.get(&instance.uid)).map(|(base, instance)| by_uids(instance, &base.rig));
        if base.is_some() && was.is_none() {
            // The base may have what the part brings as joints of its own: it tells nothing of the fields.
            continue;
        }
        let mine = by_uids(instance, &now.rig);
        let sides = Sides { base: was.as_ref(), now: &mine, file: &theirs };
        let fields = sides.fields(&now.rig, &file.rig);
        merged.differs |= fields.iter().any(|field| sides.differ(field));
        let instance = sides.merged(&fields, choices, &names, &mut merged.changes);
        merged.instances.push(instance);
    }
    merged
}

/// An instance with the uids of the joints that it goes onto and hangs on, in place of their labels, and without its changes.
fn by_uids(instance: &PartInstance, rig: &Rig) -> PartInstance {
    let uid = |label: &String| rig.labelled(label).map_or_else(|| label.clone(), |uid| uid.to_string());
    PartInstance {
        onto: instance.onto.iter().map(uid).collect(),
        parent: instance.parent.as_ref().map(uid),
        changes: Vec::new(),
        ..instance.clone()
    }
}

/// Three versions of an instance.
struct Sides<'a> {
    base: Option<&'a PartInstance>,
    now: &'a PartInstance,
    file: &'a PartInstance,
}

impl Sides<'_> {
    fn differ(&self, field: &Field<PartInstance>) -> bool {
        let mine = (field.text)(self.now);
        mine != (field.text)(self.file) || self.base.is_some_and(|base| (field.text)(base) != mine)
    }

    /// Names in a list of names and values that one of the versions has.
    fn names(&self, of: impl Fn(&PartInstance) -> Vec<String>) -> BTreeSet<String> {
        self.base.into_iter().chain([self.now, self.file]).flat_map(of).collect()
    }

    /// Fields of the instance. Joints are told by their labels in the rig now, else in the file.
    fn fields<'r>(&self, now: &'r Rig, file: &'r Rig) -> Vec<Field<'r, PartInstance>> {
        let joint = move |name: &String| match name.parse::<Uid>() {
            Ok(uid) => joint_title(now, file, uid),
            Err(_) => name.clone(),
        };
        let onto = move |a: &PartInstance| {
            let joints: Vec<String> = a.onto.iter().map(joint).collect();
            (!joints.is_empty()).then(|| format!("[{}]", joints.join(", ")))
        };
        let parent = move |a: &PartInstance| a.parent.as_ref().map(joint);
        let rotation = |a: &PartInstance| Some(quaternion(a.rest.rotation));
        let flag = |is_on: bool| is_on.then(|| "true".to_owned());
        let name = |a: &PartInstance| (!a.name.is_empty()).then(|| quoted(&a.name));
        let prefix = |a: &PartInstance| (!a.prefix.is_empty()).then(|| quoted(&a.prefix));
        let mut list: Vec<Field<PartInstance>> = vec![
            field("part", |a: &PartInstance| Some(quoted(&a.part)), |a, b| a.part.clone_from(&b.part)),
            field(NAME, name, |a: &mut PartInstance, b: &PartInstance| a.name.clone_from(&b.name)),
            field("onto", onto, |a: &mut PartInstance, b: &PartInstance| a.onto.clone_from(&b.onto)),
            field("adds", move |a: &PartInstance| flag(a.adds), |a, b| a.adds = b.adds),
            field("parent", parent, |a: &mut PartInstance, b: &PartInstance| a.parent.clone_from(&b.parent)),
            field("socket", |a: &PartInstance| a.socket.as_deref().map(quoted), |a, b| a.socket.clone_from(&b.socket)),
            field("world", move |a: &PartInstance| flag(a.is_world), |a, b| a.is_world = b.is_world),
            field(
                "translation",
                |a: &PartInstance| Some(vector(a.rest.translation)),
                |a, b| a.rest.translation = b.rest.translation,
            ),
            field("rotation", rotation, |a: &mut PartInstance, b: &PartInstance| a.rest.rotation = b.rest.rotation),
            field("scale", |a: &PartInstance| Some(vector(a.rest.scale)), |a, b| a.rest.scale = b.rest.scale),
            field("prefix", prefix, |a: &mut PartInstance, b: &PartInstance| a.prefix.clone_from(&b.prefix)),
            field("mirror", move |a: &PartInstance| flag(a.mirror), |a, b| a.mirror = b.mirror),
        ];
        for name in self.names(|side| side.counts.iter().map(|(name, _)| name.clone()).collect()) {
            let title = if name.is_empty() { "count".to_owned() } else { format!("counts.{name}") };
            let own = name.clone();
            let text = move |a: &PartInstance| named(&a.counts, &own).map(ToString::to_string);
            let take = move |a: &mut PartInstance, b: &PartInstance| take_named(&mut a.counts, &b.counts, &name);
            list.push(field(&title, text, take));
        }
        for name in self.names(|side| side.options.iter().map(|(name, _)| name.clone()).collect()) {
            let (title, own) = (format!("options.{name}"), name.clone());
            let text = move |a: &PartInstance| named(&a.options, &own).cloned();
            let take = move |a: &mut PartInstance, b: &PartInstance| take_named(&mut a.options, &b.options, &name);
            list.push(field(&title, text, take));
        }
        for name in self.names(|side| side.off.clone()) {
            let (title, own) = (format!("off.{name}"), name.clone());
            let text = move |a: &PartInstance| a.off.contains(&own).then(|| "true".to_owned());
            let take = move |a: &mut PartInstance, b: &PartInstance| {
                a.off.retain(|known| *known != name);
                if b.off.contains(&name) {
                    a.off.push(name.clone());
                }
            };
            list.push(field(&title, text, take));
        }
        list
    }

    /// The instance after the update. Values are told with the `names` that identify now and in the file.
    fn merged(
        &self,
        fields: &[Field<PartInstance>],
        choices: &Choices,
        names: &NamesOfBoth,
        changes: &mut Vec<FieldChange>,
    ) -> PartInstance {
        let Self { base, now, file } = *self;
        let is_moved_by_both = place(now) != place(file)
            && base.is_none_or(|base| place(base) != place(now) && place(base) != place(file));
        let mut merged = now.clone();
        for field in fields {
            let (mine, theirs) = ((field.text)(now), (field.text)(file));
            let was = base.map(&field.text);
            let is_moved = is_moved_by_both && PLACE.contains(&field.name.as_str());
            if mine == theirs || (was.as_ref() == Some(&theirs) && !is_moved) {
                continue;
            }
            let conflict = is_moved || was.as_ref() != Some(&mine);
            let name = format!("part {} {}", now.title(), field.name);
            if !conflict || choices.of(now.uid, Some(&name)) == Take::Theirs {
                (field.take)(&mut merged, file);
            }
            let [from, to] = shown_values(&field.name, [mine, theirs], names);
            let change = Change {
                kind: ChangeKind::Changed,
                uid: now.uid,
                joint: None,
                tag: None,
                field: Some(name),
                from,
                to,
                conflict,
            };
            changes.push(FieldChange { change, is_name: field.name == NAME });
        }
        // Places that are chosen from both sides may be none.
        let is_onto = !merged.onto.is_empty();
        if (merged.socket.is_some() && (is_onto || merged.parent.is_some())) || (is_onto && merged.parent.is_some()) {
            let side = if choices.take == Take::Theirs { file } else { now };
            take_place(&mut merged, side);
        }
        merged
    }
}

/// Values of the fields that say where a part is.
fn place(instance: &PartInstance) -> (&[String], bool, Option<&str>, Option<&str>) {
    (&instance.onto, instance.adds, instance.parent.as_deref(), instance.socket.as_deref())
}

fn take_place(instance: &mut PartInstance, from: &PartInstance) {
    instance.onto.clone_from(&from.onto);
    instance.adds = from.adds;
    instance.parent.clone_from(&from.parent);
    instance.socket.clone_from(&from.socket);
}

/// Value of a name in a list.
fn named<'n, T>(list: &'n [(String, T)], name: &str) -> Option<&'n T> {
    list.iter().find(|(known, _)| known == name).map(|(_, value)| value)
}

/// Gives a name the value that it has in another list, or none.
fn take_named<T: Clone>(list: &mut Vec<(String, T)>, from: &[(String, T)], name: &str) {
    let value = named(from, name).cloned();
    match (list.iter().position(|(known, _)| known == name), value) {
        (Some(at), Some(value)) => list[at].1 = value,
        (Some(at), None) => drop(list.remove(at)),
        (None, Some(value)) => list.push((name.to_owned(), value)),
        (None, None) => {}
    }
}

impl TemplateWithParts {
    /// The instances by their uids.
    fn instances(&self) -> HashMap<Uid, &PartInstance> {
        self.template.parts.iter().map(|part| (part.uid, part)).collect()
    }

    /// The template with the fields of `merged` instances, before its parts are in the rig. What refers to something of a part
    /// refers to the same thing when that has another name. `fit` fits the part of an instance. `None` where one does not fit.
    pub fn with_fields(
        &self,
        merged: &[PartInstance],
        fit: &mut dyn FnMut(&PartInstance) -> Option<Rig>,
    ) -> Option<RefittedTemplate> {
        let mut template = self.template.clone();
        self.bind(&mut template);
        let by_uid: HashMap<Uid, &PartInstance> = merged.iter().map(|to| (to.uid, to)).collect();
        for part in &mut template.parts {
            let own = by_uids(part, &self.rig);
            let to = by_uid.get(&part.uid).copied();
            // Joints that the other version alone has are no place in this one.
            let is_here = |name: &String| name.parse::<Uid>().is_ok_and(|uid| self.rig.joint(uid).is_some());
            let has_place = |to: &&PartInstance| to.onto.iter().chain(&to.parent).all(is_here);
            take_place(part, to.filter(has_place).unwrap_or(&own));
            let Some(to) = to else { continue };
            part.part.clone_from(&to.part);
            part.name.clone_from(&to.name);
            part.counts.clone_from(&to.counts);
            part.options.clone_from(&to.options);
            part.prefix.clone_from(&to.prefix);
            part.off.clone_from(&to.off);
            (part.rest, part.is_world, part.mirror) = (to.rest, to.is_world, to.mirror);
        }
        self.rename_sockets(&mut template.parts);
        let labelled = self.rig.walk().filter_map(|joint| Some((joint.data.uid, joint.data.label.clone()?)));
        let mut labels: BTreeMap<Uid, String> = labelled.collect();
        let (mut fitted, mut lost) = (Vec::new(), Vec::new());
        for (part, own) in template.parts.iter_mut().zip(&self.template.parts) {
            let rig = fit(part)?;
            let names = own.changes.iter().map(subject);
            let changes = std::mem::take(&mut part.changes);
            for (change, name) in changes.into_iter().zip(names) {
                if is_there(&change, &rig) {
                    part.changes.push(change);
                } else {
                    lost.push(lost_change(own, &name));
                }
            }
            for joint in rig.walk().skip(part.onto.len()) {
                let uid = part.uid_of(joint.data.uid);
                let given = labels.get(&uid);
                let is_given =
                    part.changes.iter().any(|change| change.label.is_some() && change.label.as_ref() == given);
                if let Some(label) = joint.data.label.clone().filter(|_| !is_given) {
                    labels.insert(uid, label);
                }
            }
            fitted.push(rig);
        }
        let name = |joint: &mut String| {
            if let Some(label) = joint.parse::<Uid>().ok().and_then(|uid| labels.get(&uid)) {
                joint.clone_from(label);
            }
        };
        for part in &mut template.parts {
            part.onto.iter_mut().chain(&mut part.parent).for_each(name);
        }
        for socket in &mut template.sockets {
            if let Some(label) = self.rig.labelled(&socket.label).and_then(|uid| labels.get(&uid)) {
                socket.label.clone_from(label);
            }
        }
        Some(RefittedTemplate { template, fitted, lost })
    }

    /// Gives the sockets that `parts` hang on the names that they have with the instances called as they are there.
    fn rename_sockets(&self, parts: &mut [PartInstance]) {
        let titles = |of: &[PartInstance]| of.iter().map(|part| part.title().to_owned()).collect::<Vec<_>>();
        let (was, is) = (titles(&self.template.parts), titles(parts));
        let places: HashMap<&str, usize> =
            was.iter().enumerate().rev().map(|(place, title)| (title.as_str(), place)).collect();
        let present: HashSet<&str> = is.iter().map(String::as_str).collect();
        for socket in parts.iter_mut().filter_map(|part| part.socket.as_mut()) {
            let Some((instance, name)) = socket.rsplit_once('.') else { continue };
            // A name that an instance has is no former one.
            let place = places.get(instance).copied().filter(|_| !present.contains(instance));
            if let Some(title) = place.and_then(|place| is.get(place)) {
                *socket = format!("{title}.{name}");
            }
        }
    }

    /// Refers by uids to what parts bring, in the template's own tags, joints and changes of instances.
    fn bind(&self, template: &mut Template) {
        for joint in template.rig.joints.values_mut().filter(|joint| !joint.data.tags.is_empty()) {
            Arc::make_mut(joint).data.tags.iter_mut().for_each(|tag| self.bind_tag(tag));
        }
        for hung in &mut template.hung {
            if let Some(parent) = self.rig.joint(hung.joint).and_then(|joint| joint.parent) {
                hung.parent = parent.to_string();
            }
        }
        for (part, (instance, fitted)) in template.parts.iter_mut().zip(&self.fitted) {
            let targets = PartTargets::new(instance, fitted);
            let joints: Vec<Uid> = fitted.walk().map(|joint| joint.data.uid).collect();
            part.changes.iter_mut().for_each(|change| self.bind_change(change, instance, &targets, &joints));
        }
    }

    /// Gives a tag the parameters that it has in the rig, whose references are bound.
    fn bind_tag(&self, tag: &mut TagData) {
        if let Some((_, bound)) = self.rig.find_tag(tag.uid) {
            tag.kind.clone_from(&bound.kind);
        }
    }

    /// Refers by uids in a change of an instance whose part has these `joints`.
    fn bind_change(&self, change: &mut PartChange, instance: &PartInstance, targets: &PartTargets, joints: &[Uid]) {
        change.tags.iter_mut().for_each(|tag| self.bind_tag(tag));
        if let Some(tag) = change.tag.as_ref().and_then(|name| targets.find_tag(name).ok()) {
            if let Some(params) = &mut change.params
                && let Some((_, bound)) = self.rig.find_tag(instance.uid_of(tag))
                && let TagKind::Command { params: bound, .. } = &bound.kind
            {
                *params = with_values_of(params, bound);
            }
            change.tag = Some(tag.to_string());
        }
        let place = change.joint.as_ref().and_then(|label| targets.find_joint(label).ok());
        if let Some(joint) = place.and_then(|place| joints.get(place)) {
            change.joint = Some(joint.to_string());
        }
    }
}

/// True if a part has what a change is of, which is named by its uid.
fn is_there(change: &PartChange, part: &Rig) -> bool {
    let name = change.tag.as_ref().or(change.joint.as_ref());
    name.and_then(|name| name.parse::<Uid>().ok()).is_none_or(|uid| part.is_taken(uid))
}

/// Joint or tag that a change is of, as the file names it.
fn subject(change: &PartChange) -> String {
    let joint = change.joint.as_ref().map(|label| format!("joint {label}"));
    let tag = change.tag.as_ref().map(|name| format!("tag {name}"));
    joint.or(tag).unwrap_or_default()
}

/// A change of an instance that goes with what it is of.
fn lost_change(instance: &PartInstance, subject: &str) -> Change {
    Change {
        kind: ChangeKind::Removed,
        uid: instance.uid,
        joint: None,
        tag: None,
        field: Some(format!("part {} change of {subject}", instance.title())),
        from: None,
        to: None,
        conflict: false,
    }
}

/// Parameters with the values that others have for them.
fn with_values_of(params: &str, others: &str) -> String {
    let (Some(own), Some(others)) = (Tree::parse(params), Tree::parse(others)) else { return params.to_owned() };
    let mut out = params.to_owned();
    for key in own.node(own.root()).items.iter().filter_map(|item| item.key) {
        if let Some(value) = others.field(others.root(), key) {
            out = with_field(&out, key, others.written(value.value));
        }
    }
    out
}
