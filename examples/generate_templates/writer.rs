//! Writing a template: joints by label, parent and position, tags by alias.
//!
//! Parameters are written as in a file, with names in place of uids: `@joint hand_l` by label, `@group arm` by name, and
//! `@command ik_hand` by the alias that the command was added with. [`Writer::finish`] puts the uids beside the names.
//! Uids are hashes of the template's name and the alias, so adding a tag leaves all others as they are.

use std::{borrow::Cow, collections::BTreeMap, error::Error};

use bevy::math::{Quat, Vec3};
use rigsmith::{
    modules,
    rig::{
        GroupData, JointData, RestTransform, Rig, RigAbout, RigEdit, TagData, TagKind, Uid, UidSource,
        label::{label_side, mirrored_label},
        operations::{Axis, Operation, PasteTo, PasteWhat, TagClipboard, TagOperation, TagScope},
        reference::{NameKind, NameScope, Names, bind_names, refresh_names},
    },
};

/// What can go wrong while a template is written.
pub type Failure = Box<dyn Error + Send + Sync>;

/// sRGB colours of local groups by side, readable on light and dark ground and without telling red from green.
pub const CENTER: [f32; 3] = [0.94, 0.89, 0.26];
/// See [`CENTER`].
pub const LEFT: [f32; 3] = [0.34, 0.71, 0.91];
/// See [`CENTER`].
pub const RIGHT: [f32; 3] = [0.84, 0.37, 0.0];

/// A template in the making.
pub struct Writer {
    rig: Rig,
    seed: String,
    group: Option<Uid>,
    /// Aliases of tags, with the prefix that they were added under.
    aliases: BTreeMap<String, Uid>,
    prefix: String,
    /// The first thing that went wrong; told by [`Writer::finish`].
    failure: Option<Failure>,
}

impl Writer {
    /// An empty template. `kind` is `part` or `character`.
    pub fn new(name: &str, kind: &str, description: &str) -> Self {
        let rig = Rig::new(hashed(&[name]), name);
        let mut writer = Self::from_rig(rig);
        writer.about(kind, description);
        writer
    }

    /// A template that goes on from a rig with joints.
    pub fn from_rig(rig: Rig) -> Self {
        let seed = rig.about().name.clone();
        Self { rig, seed, group: None, aliases: BTreeMap::new(), prefix: String::new(), failure: None }
    }

    /// Header: `part` or `character`, and a sentence for people.
    pub fn about(&mut self, kind: &str, description: &str) {
        let about = RigAbout {
            name: self.seed.clone(),
            version: "1.0.0".to_owned(),
            kind: kind.to_owned(),
            author: "Rigsmith".to_owned(),
            description: description.to_owned(),
            preview: None,
        };
        self.edit(RigEdit::SetAbout(Box::new(about)));
    }

    /// The rig so far; names in its references have no uids yet.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Makes a local group if there is none of that name; joints that are added next are in it.
    pub fn group(&mut self, name: &str, color: [f32; 3]) -> &mut Self {
        let known = self.rig.groups().iter().find(|group| group.name == name).map(|group| group.uid);
        let uid = known.unwrap_or_else(|| {
            let group = GroupData { uid: self.hashed("group", name), name: name.to_owned(), color, enabled: true };
            let uid = group.uid;
            self.edit(RigEdit::AddLocalGroup(group, usize::MAX));
            uid
        });
        self.group = Some(uid);
        self
    }

    /// Adds a joint with the rig's axes below another one (a root if that is `""`), at a position in the rig's space;
    /// see [`Writer::orient`].
    pub fn joint(&mut self, label: &str, parent: &str, position: [f32; 3]) -> &mut Self {
        let parent = (!parent.is_empty()).then(|| self.find(parent));
        let above = parent.map_or(Vec3::ZERO, |parent| self.rig.position(parent));
        let joint = JointData {
            uid: self.hashed("joint", label),
            label: Some(label.to_owned()),
            group: self.group,
            rest: RestTransform::from_translation(Vec3::from(position) - above),
            ..JointData::default()
        };
        self.edit(RigEdit::AddJoint { joint: Box::new(joint), parent, index: usize::MAX });
        self
    }

    /// A chain of joints, each below the one before.
    pub fn chain(&mut self, parent: &str, joints: &[(&str, [f32; 3])]) -> &mut Self {
        let mut above = parent.to_owned();
        for (label, position) in joints {
            self.joint(label, &above, *position);
            above = (*label).to_owned();
        }
        self
    }

    /// Turns all joints so that their Y lies along their bones, Z to the front.
    pub fn orient(&mut self) -> &mut Self {
        let joints: Vec<Uid> = self.rig.walk().map(|joint| joint.data.uid).collect();
        self.operation(&Operation::Orient { joints, along: Axis::Y });
        self
    }

    /// Turns a joint to a rotation in the rig's space; what is below stays where it is.
    pub fn turn(&mut self, label: &str, rotation: Quat) -> &mut Self {
        let joint = self.find(label);
        let (scale, _, place) = self.rig.rest_global(joint).to_scale_rotation_translation();
        let global = bevy::math::Affine3::from_scale_rotation_translation(scale, rotation, place);
        let parent = self.rig.joint(joint).and_then(|joint| joint.parent);
        let rest = self.rig.local_rest(parent, &global);
        self.operation(&Operation::Rest { to: vec![(joint, rest)], with_children: false });
        self
    }

    /// Puts joints that are there already into a local group.
    pub fn members(&mut self, name: &str, color: [f32; 3], labels: &[String]) -> &mut Self {
        self.group(name, color);
        for label in labels {
            let joint = self.find(label);
            self.edit(RigEdit::SetGroup(joint, self.group));
        }
        self
    }

    /// Joints with sides become pairs by their labels.
    pub fn pair(&mut self) -> &mut Self {
        let partner = |label: &str| self.rig.find_label(&mirrored_label(label)?);
        let joints = self.rig.walk().filter_map(|joint| Some((joint.data.uid, partner(joint.data.label.as_deref()?)?)));
        let pairs: Vec<RigEdit> = joints.map(|(joint, partner)| RigEdit::SetMirror(joint, Some(partner))).collect();
        self.operation(&Operation::Edits(pairs));
        self
    }

    /// Writes tags with aliases of their own: within `write` they are found by the alias alone, outside as
    /// `PREFIX.ALIAS`. So a part can be put into a character twice.
    pub fn part(&mut self, prefix: &str, write: impl FnOnce(&mut Self)) -> &mut Self {
        let inner = format!("{}{prefix}.", self.prefix);
        let outer = std::mem::replace(&mut self.prefix, inner);
        write(self);
        self.prefix = outer;
        self
    }

    /// Adds a feature tag: what animators and riggers switch. Commands join it by its name; several tags of one kind and
    /// name in one local group act as one.
    pub fn feature(&mut self, joint: &str, kind: &str, name: &str) -> &mut Self {
        self.switch(joint, kind, name, "")
    }

    /// Adds a feature tag with a switch; commands join it as `NAME:SWITCH`.
    pub fn switch(&mut self, joint: &str, kind: &str, name: &str, switch: &str) -> &mut Self {
        let alias = if switch.is_empty() { format!("feature {name}") } else { format!("feature {name}:{switch}") };
        let (name, switch) = (name.to_owned(), switch.to_owned());
        let feature = TagKind::Feature { kind: kind.to_owned(), name, switch, choice: String::new() };
        self.tag(joint, &alias, feature);
        self
    }

    /// Adds a command tag to a joint.
    pub fn command(&mut self, joint: &str, alias: &str, module: &str, params: impl Into<String>) -> &mut Self {
        let command = TagKind::Command { module: module.to_owned(), params: params.into(), feature: None };
        self.tag(joint, alias, command);
        self
    }

    /// Adds a command tag to a joint, in a feature.
    pub fn optional(
        &mut self,
        feature: &str,
        joint: &str,
        alias: &str,
        module: &str,
        params: impl Into<String>,
    ) -> &mut Self {
        let found = self.lookup(&format!("feature {feature}"));
        if found.is_none() {
            self.fail(format!("{alias}: there is no feature {feature} before it"));
        }
        let command = TagKind::Command { module: module.to_owned(), params: params.into(), feature: found };
        self.tag(joint, alias, command);
        self
    }

    /// Copies the tags of all joints on the left to their partners, mirrored.
    pub fn mirror(&mut self) -> &mut Self {
        self.bind();
        let modules = modules::all();
        let left = |label: &Option<String>| label.as_deref().is_some_and(|label| label_side(label) > 0);
        let joints: Vec<Uid> =
            self.rig.walk().filter(|joint| left(&joint.data.label)).map(|joint| joint.data.uid).collect();
        let copied = match TagClipboard::copy(&self.rig, &TagScope::Joints(joints), false, |_| true) {
            Ok(copied) => copied,
            Err(error) => return self.fail(error.to_string()),
        };
        let copied = copied.map_params(|module, params| modules.get(module)?.mirrored(params).ok());
        let paste = TagOperation::Paste { clipboard: copied.into(), what: PasteWhat::Both, to: PasteTo::Mirror };
        self.operation(&Operation::Tags(paste));
        self
    }

    /// The template, with uids beside all names.
    ///
    /// # Errors
    /// The first thing that went wrong.
    pub fn finish(mut self) -> Result<Rig, Failure> {
        self.bind();
        match self.failure {
            Some(failure) => Err(failure),
            None => Ok(self.rig),
        }
    }

    fn bind(&mut self) {
        let tags: Vec<(Uid, TagData)> =
            self.rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| (joint.data.uid, tag.clone()))).collect();
        let aliases: BTreeMap<Uid, &String> = self.aliases.iter().map(|(alias, tag)| (*tag, alias)).collect();
        let mut edits = Vec::new();
        let mut failure = None;
        for (joint, mut tag) in tags {
            let TagKind::Command { params, .. } = &mut tag.kind else { continue };
            let alias = aliases.get(&tag.uid).map_or("", |alias| alias.as_str());
            let prefix = alias.rsplit_once('.').map_or("", |(prefix, _)| &alias[..=prefix.len()]);
            let names = Aliases { writer: self, prefix };
            let (text, bad) = bind_names(params, &names);
            if let Some(bad) = bad.first() {
                failure = failure.or(Some(format!("{}, {alias}: {bad}", self.seed)));
            }
            let text = refresh_names(&text, &self.rig).into_owned();
            if text != *params {
                *params = text;
                edits.push(RigEdit::SetTag(joint, Box::new(tag)));
            }
        }
        edits.into_iter().for_each(|edit| self.edit(edit));
        if let Some(failure) = failure {
            self.fail(failure);
        }
    }

    fn tag(&mut self, joint: &str, alias: &str, kind: TagKind) {
        let joint = self.find(joint);
        let alias = format!("{}{alias}", self.prefix);
        let uid = self.hashed("tag", &alias);
        if self.aliases.insert(alias.clone(), uid).is_some() {
            self.fail(format!("there are two tags {alias}"));
        }
        let tag = TagData { uid, enabled: true, comment: String::new(), kind };
        self.edit(RigEdit::AddTag { joint, tag: Box::new(tag), index: usize::MAX });
    }

    fn lookup(&self, alias: &str) -> Option<Uid> {
        self.aliases.get(&format!("{}{alias}", self.prefix)).or_else(|| self.aliases.get(alias)).copied()
    }

    fn find(&mut self, label: &str) -> Uid {
        let found = self.rig.find_label(label);
        found.unwrap_or_else(|| {
            self.fail(format!("there is no joint {label}"));
            Uid::default()
        })
    }

    fn edit(&mut self, edit: RigEdit) {
        if let Err(error) = self.rig.apply(&edit) {
            self.fail(error.to_string());
        }
    }

    fn operation(&mut self, operation: &Operation) {
        let mut uids = UidSource::seeded(self.hashed("operation", operation.name()).0);
        if let Err(error) = operation.run(&mut self.rig, &mut uids, None) {
            self.fail(error.to_string());
        }
    }

    fn fail(&mut self, what: String) -> &mut Self {
        let told = format!("{}: {what}", self.seed);
        self.failure.get_or_insert_with(|| told.into());
        self
    }

    fn hashed(&self, kind: &str, name: &str) -> Uid {
        hashed(&[&self.seed, kind, name])
    }
}

/// A uid that is the same for the same words (FNV-1a, then SplitMix64).
fn hashed(words: &[&str]) -> Uid {
    let bytes = words.iter().flat_map(|word| word.bytes().chain([0]));
    let hash =
        bytes.fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3));
    UidSource::seeded(hash).next_uid()
}

/// The names of the rig, and aliases of tags in place of the names of commands.
struct Aliases<'a> {
    writer: &'a Writer,
    prefix: &'a str,
}

impl Names for Aliases<'_> {
    fn name_of(&self, kind: NameKind, uid: Uid) -> Option<Cow<'_, str>> {
        self.writer.rig.name_of(kind, uid)
    }

    fn find(&self, scope: NameScope, kind: NameKind, name: &str) -> Vec<Uid> {
        let aliases = &self.writer.aliases;
        match kind {
            NameKind::Command => {
                let found = aliases.get(&format!("{}{name}", self.prefix)).or_else(|| aliases.get(name));
                found.copied().into_iter().collect()
            }
            _ => self.writer.rig.find(scope, kind, name),
        }
    }

    fn all(&self, scope: NameScope, kind: NameKind) -> Vec<Cow<'_, str>> {
        match kind {
            NameKind::Command => self.writer.aliases.keys().map(|alias| Cow::Borrowed(alias.as_str())).collect(),
            _ => self.writer.rig.all(scope, kind),
        }
    }
}
